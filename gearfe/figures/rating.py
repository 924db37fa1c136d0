"""Pictures of a rating: safety factors, and values of the standard next to computed ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ..gears.rating.report import safety_bars
from .style import BLUE, GREY, ORANGE, RED, new_figure, tidy

if TYPE_CHECKING:
    from ..gears.rating.rate import Rating
    from ..gears.rating.scuffing import Scuffing


def rating_picture(rating: Rating, compared: Sequence[Mapping[str, Any]] = ()) -> Any:
    """Bars of safety factors with the required ones; contact temperatures; ratios of computed values to the standard.

    Parameters
    ----------
    rating : Rating
        The rating.
    compared : sequence of mapping
        Rows with ``name``, ``standard`` and ``computed``.
    """
    count = 1 + bool(compared) + (rating.scuffing is not None)
    figure = new_figure({1: 5.5, 2: 9.0, 3: 13.0}[count], 4.4)
    panels = list(figure.subplots(1, count, squeeze=False)[0])
    axes, bars = panels.pop(0), safety_bars(rating)
    places = range(len(bars))
    colours = [BLUE if value >= least else RED for _, value, least in bars]
    axes.bar(places, [value for _, value, _ in bars], color=colours, width=0.6)
    for place, (_, value, least) in zip(places, bars, strict=True):
        axes.plot([place - 0.4, place + 0.4], [least, least], color=GREY, linewidth=2)
        axes.annotate(f"{value:.3g}", (place, value), ha="center", va="bottom", fontsize=9)
    axes.set_xticks(list(places), [name.replace(" ", "\n", 1) for name, _, _ in bars], fontsize=8)
    axes.set_ylabel("safety factor  (grey: required)")
    axes.set_title(f"ISO 6336:{rating.edition}", loc="left", fontsize=10)
    tidy(axes)
    if rating.scuffing is not None:
        _temperatures(panels.pop(0), rating.scuffing)
    if compared:
        other, rows = panels.pop(0), list(compared)
        spots = range(len(rows))
        other.barh(spots, [row["computed"] / row["standard"] for row in rows], color=ORANGE, height=0.6)
        other.axvline(1.0, color=BLUE, linewidth=1.5)
        other.set_yticks(list(spots), [row["name"] for row in rows], fontsize=8)
        other.invert_yaxis()
        other.set_xlabel("computed over standard")
        tidy(other)
    return figure


def _temperatures(axes: Any, heat: Scuffing) -> None:
    """Contact temperature over the path of contact with the temperatures of bulk and scuffing."""
    axes.plot(heat.path.gamma, heat.path.contact, color=RED, linewidth=1.5, label="contact")
    axes.axhline(heat.theta_M_C, color=BLUE, linewidth=1.2, label="bulk")
    axes.axhline(heat.theta_S_C, color=GREY, linewidth=1.2, linestyle="--", label="scuffing")
    axes.set_xlabel("position on the path: 0 pitch point, left the pinion's root")
    axes.set_ylabel("temperature (deg C)")
    axes.set_title(f"ISO/TS 6336-20, S_B = {heat.S_B:.3g}", loc="left", fontsize=10)
    axes.legend(fontsize=8)
    tidy(axes)


def rating_plot(rating: Rating) -> Any:
    """Picture of a rating alone."""
    return rating_picture(rating)
