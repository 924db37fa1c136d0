"""K-charts of the flanks of a pair, with tolerances and index deviations."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..base.tables.gearbox import NamedMesh
from ..base.typing import Array
from ..gears.geometry.deviation_job import FlankOf, flank_deviations
from ..gears.geometry.modifications import ends_of
from ..gears.geometry.pair import GearPair
from ..gears.geometry.tolerances import tolerances
from .style import BLUE, GREY, ORANGE, headed, new_figure, some_of, tidy

#: Lines of a panel; of more profiles, so many are drawn.
MOST_LINES = 24


@dataclass(frozen=True)
class _Chart:
    """Deviations of the flanks of one side of a gear.

    Attributes
    ----------
    roll, active
        Roll lengths, and ends of the path of contact (mm).
    lines
        Deviations (um), one array a profile.
    band
        Half the width of the tolerance (um), where there is one.
    pitch
        Index deviations (um), where teeth differ.
    width
        Places along the axes (mm), and the deviations there of the modifications along the width (um), at the form and
        at the tip circle; None without.
    """

    title: str
    roll: Array
    active: tuple[float, ...]
    lines: list[Array]
    band: Array | None
    pitch: Array | None
    width: tuple[Array, Array, Array] | None


def _chart(mesh: NamedMesh, pair: GearPair, g: int, side: str, folder: Path) -> _Chart:
    one = FlankOf(mesh, pair, g, side, folder)
    gear, active = one.gear, one.active
    ends = gear.form_roll, gear.profile.tip_roll
    roll = np.unique(np.concatenate([np.linspace(*ends, 400), active]))
    own = flank_deviations(one)
    index, band = 1e6 * np.array(own.turn) * gear.reference_radius, None
    if mesh.tolerance_class is not None:
        allowed = tolerances(gear, mesh.tolerance_class)
        band = 1e6 * (0.5 * allowed.form + allowed.slope * ((roll - ends[0]) / (ends[1] - ends[0])))
    return _Chart(
        title=f"{mesh.gears[g].name}, {side} flanks{', driving' if side == mesh.flank else ''}",
        roll=1e3 * roll,
        active=tuple(1e3 * s for s in active),
        lines=[np.zeros(len(roll)) if one is None else 1e6 * one.at(roll)[0] for one in own.profiles],
        band=band,
        pitch=index if len(index) > 1 else None,
        width=_along_width(one, 1e-3 * mesh.gears[g].y_mm),
    )


def _along_width(one: FlankOf, centre: float) -> tuple[Array, Array, Array] | None:
    """Places along the axes (mm) and deviations there (um) at form and tip circle, its middle at y (m)."""
    if not one.own.along_width():
        return None
    from ..gears.gearmesh.width_job import material_along  # which loads finite elements

    face = centre - 0.5 * one.gear.face_width, centre + 0.5 * one.gear.face_width
    y = np.linspace(*face, 201)
    form, tip = (1e6 * material_along(one, face, np.full(len(y), roll), y) for roll in ends_of(one.gear))
    return 1e3 * y, form, tip


def flank_picture(mesh: NamedMesh, pair: GearPair, folder: Path) -> Any:
    """K-charts: deviation over roll length of both flanks of both gears, along the width, and index deviations."""
    charts = [_chart(mesh, pair, g, side, folder) for g in (0, 1) for side in ("left", "right")]
    pitch = any(chart.pitch is not None for chart in charts)
    width = any(chart.width is not None for chart in charts)
    rows = 1 + width + pitch
    figure = new_figure(11.0, 5.0 + 2.6 * (rows - 1))
    grid = figure.subplots(rows, len(charts), squeeze=False, height_ratios=(2.2, *(1,) * (rows - 1)))
    for column, chart in enumerate(charts):
        axes = grid[0][column]
        tidy(axes)
        lines = chart.lines
        if chart.band is not None:
            middle = np.mean(lines, axis=0)
            edges = (middle - chart.band, middle + chart.band)
            axes.fill_betweenx(chart.roll, *edges, color="#e5e7eb")
        for i in some_of(len(lines), MOST_LINES):
            axes.plot(lines[i], chart.roll, color=BLUE, linewidth=1.4 if len(lines) == 1 else 0.7)
        for end in chart.active:
            axes.axhline(end, color=GREY, linewidth=0.9, linestyle=(0, (4, 3)))
        axes.set_title(chart.title, loc="left", fontsize=9.5)
        axes.set_xlabel("deviation (µm), + material", fontsize=9)
        if column == 0:
            axes.set_ylabel("roll length (mm)", fontsize=9)
        if width:
            _draw_width(grid[1][column], chart, first=column == 0)
        if pitch:
            below = grid[-1][column]
            tidy(below)
            if chart.pitch is None:
                below.set_visible(False)
                continue
            below.bar(np.arange(len(chart.pitch)), chart.pitch, color=ORANGE, width=0.7)
            below.set_xlabel("tooth", fontsize=9)
            if column == 0:
                below.set_ylabel("index deviation (µm)", fontsize=9)
    allowed = f"; grey: profile tolerances, ISO 1328-1 class {mesh.tolerance_class}"
    grey = "" if mesh.tolerance_class is None else allowed
    title = "Deviations of the flanks; dashed: ends of the path of contact" + grey
    headed(figure, title)
    return figure


def _draw_width(axes: Any, chart: _Chart, *, first: bool) -> None:
    """Deviations along the face width, at form and tip circle where they differ."""
    tidy(axes)
    if chart.width is None:
        axes.set_visible(False)
        return
    y, form, tip = chart.width
    axes.plot(y, tip, color=BLUE, linewidth=1.3, label="tip")
    if np.abs(tip - form).max() > 0.0:
        axes.plot(y, form, color=ORANGE, linewidth=1.3, label="form circle")
        axes.legend(fontsize=7, frameon=False)
    axes.set_xlabel("y along the axes (mm)", fontsize=9)
    if first:
        axes.set_ylabel("deviation (µm)", fontsize=9)
