"""Picture of the contact pressure along the flanks of both gears."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..typing import Array
from .style import new_figure, save, tidy


def pressure_figure(path: str | Path, *, title: str, lines: Sequence[Sequence[tuple[float, Array, Array]]]) -> None:
    """Pressure against the diameter, one line per loaded flank, coloured by the pinion angle.

    Parameters
    ----------
    lines
        For pinion and wheel: pinion angle (deg), diameters (mm) and pressures (MPa) of each loaded flank.
    """
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    angles = [angle for gear in lines for angle, _, _ in gear] or [0.0]
    norm = Normalize(min(angles), max(*angles, min(angles) + 1e-6))
    colors = colormaps["viridis"]
    figure = new_figure(10.5, 4.2)
    both: Any = figure.subplots(1, 2, sharey=True)
    for axes, gear, name in zip(both, lines, ("pinion", "wheel"), strict=True):
        tidy(axes)
        for angle, diameter, pressure in gear:
            axes.plot(diameter, pressure, linewidth=1.5, color=colors(0.95 * norm(angle)))
        axes.set_title(name, loc="left", fontsize=10)
        axes.set_xlabel("diameter (mm)")
    both[0].set_ylim(bottom=0.0)  # shared, and only now that both are drawn
    both[0].set_ylabel("contact pressure (MPa)")
    figure.suptitle(title, x=0.01, ha="left", fontsize=11)
    bar = figure.colorbar(ScalarMappable(norm, colors), ax=list(both), pad=0.015, aspect=30)
    bar.set_label("pinion angle (deg)")
    save(figure, path, dpi=120)
