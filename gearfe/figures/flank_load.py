"""Pictures of gears whose load varies along the face width: load over the flanks, stress at the roots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..gears.gearmesh.width_report import FlankLoad
from ..gears.geometry.deviation_job import GEARS
from ..gears.width import WidthSweep
from .style import BLUE, CYCLE, GREY, headed, labelled, new_figure


def flank_load_picture(
    flanks: Sequence[FlankLoad], sweep: WidthSweep, base_radius: float, path: tuple[float, float], title: str = ""
) -> Any:
    """Load over the flank at the largest torque, and curves of all torques.

    Parameters
    ----------
    flanks
        Contact pattern of each load.
    sweep
        The sweep.
    base_radius
        Of the wheel (m).
    path
        Roll lengths of the pinion between which the path of contact runs (m).
    title
        Above the picture.
    """
    figure = new_figure(11.5, 6.6)
    grid = figure.add_gridspec(2, 2, width_ratios=(1.35, 1.0))
    pattern = figure.add_subplot(grid[:, 0])
    largest = flanks[-1]
    labelled(pattern, f"largest line load over the mesh cycle, {largest.torque:.4g} N m", "y along the axes (mm)")
    values = 1e-3 * largest.line_load
    surface = pattern.pcolormesh(
        1e3 * largest.y, 1e3 * largest.roll, values, cmap="viridis", vmin=0.0, shading="nearest"
    )
    if np.isfinite(values).any() and np.nanmax(values) > np.nanmin(values):
        levels = pattern.contour(1e3 * largest.y, 1e3 * largest.roll, values, 8, colors="white", linewidths=0.6)
        pattern.clabel(levels, fontsize=7, fmt="%.4g")
    for end in path:
        pattern.axhline(1e3 * end, color=GREY, linewidth=0.9, linestyle=(0, (4, 3)))
    pattern.set_ylabel("roll length on the pinion (mm)")
    bar = figure.colorbar(surface, ax=pattern, shrink=0.85, pad=0.02)
    bar.set_label("N/mm")
    width = figure.add_subplot(grid[0, 1])
    labelled(width, "load per width of all tooth pairs, mean of the positions  (N/mm)", "y along the axes (mm)")
    error = figure.add_subplot(grid[1, 1])
    labelled(error, "transmission error  (µm)", "pinion angle (°)")
    stiffness = error.twinx()
    stiffness.set_ylabel("tangent stiffness (N/µm), dashed", fontsize=8, color=GREY)
    for i, (flank, colour) in enumerate(zip(flanks, CYCLE, strict=False)):
        name = f"{flank.torque:.4g} N m"
        width.plot(1e3 * flank.y, 1e-3 * flank.mean, color=colour, linewidth=1.3, label=name)
        angle = np.degrees(sweep.angle)
        error.plot(
            angle, 1e6 * sweep.transmission_error[i], ".-", color=colour, linewidth=1.3, markersize=3, label=name
        )
        tangent = 1e-6 * sweep.stiffness[i] / base_radius**2
        stiffness.plot(angle, tangent, color=colour if len(flanks) > 1 else BLUE, linewidth=0.9, linestyle=(0, (4, 3)))
    width.set_ylim(bottom=min(0.0, width.get_ylim()[0]))
    width.legend(fontsize=7, frameon=False)
    headed(figure, title)
    return figure


def root_picture(columns: Mapping[str, Any], title: str = "") -> Any:
    """Draw the largest root stress over the mesh cycle along the width: panels by gear, curves by torque.

    Parameters
    ----------
    columns
        Of `gearfe.gears.gearmesh.width_report.root_columns`.
    title
        Above the picture.
    """
    figure = new_figure(10.0, 4.0)
    gear, torque = np.asarray(columns["gear"]), np.asarray(columns["torque_wheel_Nm"])
    for name, axes in zip(GEARS, figure.subplots(1, 2, sharey=True).tolist(), strict=True):
        labelled(axes, f"largest root stress over the mesh cycle, {name}  (MPa)", "y along the axes (mm)")
        for value, colour in zip(np.unique(torque), CYCLE, strict=False):
            chosen = (gear == name) & (torque == value)
            y, stress = (np.asarray(columns[key])[chosen] for key in ("y_mm", "root_stress_MPa"))
            axes.plot(y, stress, color=colour, linewidth=1.3, label=f"{value:.4g} N m")
        axes.set_ylim(bottom=0.0)
        axes.legend(fontsize=7, frameon=False)
    headed(figure, title)
    return figure
