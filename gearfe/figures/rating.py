"""Pictures of a rating: safety factors, and values of the standard next to computed ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ..gears.rating.report import safety_bars
from .style import BLUE, GREY, ORANGE, RED, new_figure, tidy

if TYPE_CHECKING:
    from ..gears.rating.rate import Rating


def rating_picture(rating: Rating, compared: Sequence[Mapping[str, Any]] = ()) -> Any:
    """Bars of the safety factors with the required ones; of the ratios of computed values to those of the standard.

    Parameters
    ----------
    rating : Rating
        The rating.
    compared : sequence of mapping
        Rows with ``name``, ``standard`` and ``computed``.
    """
    figure = new_figure(9.0 if compared else 5.5, 4.4)
    panels = figure.subplots(1, 2) if compared else [figure.subplots()]
    axes, bars = panels[0], safety_bars(rating)
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
    if compared:
        other, rows = panels[1], list(compared)
        spots = range(len(rows))
        other.barh(spots, [row["computed"] / row["standard"] for row in rows], color=ORANGE, height=0.6)
        other.axvline(1.0, color=BLUE, linewidth=1.5)
        other.set_yticks(list(spots), [row["name"] for row in rows], fontsize=8)
        other.invert_yaxis()
        other.set_xlabel("computed over standard")
        tidy(other)
    return figure


def rating_plot(rating: Rating) -> Any:
    """Picture of a rating alone."""
    return rating_picture(rating)
