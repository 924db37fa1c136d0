"""What all pictures share: a canvas, colours, axes; files are written whole as PNG (or PDF, SVG: the suffix decides).

Drawn on matplotlib's `Figure` with the Agg canvas: no window system, no global state. matplotlib is imported when the
first picture is drawn.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..output.files import whole_file

BLUE, ORANGE, GREEN, RED, GREY = "#1f5a99", "#d9730d", "#3a8c5c", "#b3261e", "#6b7280"
COLOURS = (BLUE, ORANGE, GREEN, RED, "#6d4c9f", "#0f766e", "#8a5a2b")
DPI = 130


def new_figure(width: float, height: float) -> Any:
    """Empty figure (inches) on the Agg canvas."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save(figure: Any, path: str | Path, *, dpi: int = DPI) -> None:
    """Write a figure whole."""
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=dpi)


def tidy(axes: Any) -> None:
    """Axes with a light grid, open at the top and to the right."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(True, color="#e5e7eb", linewidth=0.8)
    axes.set_axisbelow(True)


def fixed(width: float, height: float) -> Any:
    """Empty figure (inches) whose axes are placed by hand: twice as fast as a layout that is solved for."""
    figure = new_figure(width, height)
    figure.set_layout_engine("none")
    return figure


def save_fixed(figure: Any, path: str | Path) -> None:
    """Write a PNG whole. The canvas is drawn once; `savefig` draws it twice."""
    figure.set_dpi(DPI)
    with whole_file(path) as temporary:
        figure.canvas.print_png(temporary, pil_kwargs={"compress_level": 4})


def panel(axes: Any, ylabel: str, letter: str, title: str) -> Any:
    """The axes with a light grid, a label and a lettered title, both left out where empty."""
    tidy(axes)
    if ylabel:
        axes.set_ylabel(ylabel)
    if title:
        axes.set_title(f"({letter})  {title}", fontsize=10.5, loc="left")
    return axes
