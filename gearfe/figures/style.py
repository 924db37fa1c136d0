"""What pictures share: canvas, colours, axes, legends; files are written whole as PNG (or PDF, SVG: by the suffix).

Drawn on matplotlib's `Figure` with the Agg canvas: no window system, no global state. matplotlib is imported when the
first picture is drawn.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.files import whole_file
from ..base.typing import Array, IntArray

BLUE, ORANGE, GREEN, RED, GREY = "#1f5a99", "#d9730d", "#3a8c5c", "#b3261e", "#6b7280"
COLOURS = (BLUE, ORANGE, GREEN, RED, "#6d4c9f", "#0f766e", "#8a5a2b")
#: The same again and again, for any number of curves.
CYCLE = COLOURS * 8
DPI = 130
#: Frequencies (Hz) from and to which is drawn; None: all.
Band = tuple[float, float] | None
#: Reference of the levels of accelerations (m/s2), ISO 1683, and how far below the largest one a level is drawn (dB).
REFERENCE, RANGE_DB = 1e-6, 70.0


def new_figure(width: float, height: float) -> Any:
    """Empty figure (inches) on the Agg canvas."""
    from .canvas import PictureCanvas, PictureFigure

    figure = PictureFigure(figsize=(width, height), layout="constrained")
    PictureCanvas(figure)
    return figure


def literal(figure: Any) -> None:
    """Draw all texts as they are written: a $ in a user's name begins no formula. Powers on logarithmic axes stay.

    Ticks are those that there are: to ask for them would place those of limits that are not finite.
    """
    from matplotlib.axis import Axis
    from matplotlib.text import Text
    from matplotlib.ticker import LogFormatter

    left = [figure]
    while left:
        artist = left.pop()
        if isinstance(artist, Text):
            artist.set_parse_math(False)
        elif isinstance(artist, Axis):
            left.append(artist.label)
            if not isinstance(artist.get_major_formatter(), LogFormatter):
                left += [artist.offsetText, *artist.majorTicks, *artist.minorTicks]
        else:
            left += artist.get_children()


def save(figure: Any, path: str | Path, *, dpi: int = DPI) -> None:
    """Write a figure whole, as its suffix says; axes are laid out and drawn once; `savefig` draws twice."""
    literal(figure)
    figure.set_dpi(dpi)
    layout = figure.get_layout_engine()
    if layout is not None:
        layout.execute(figure)
        figure.set_layout_engine("none")
    with whole_file(path) as temporary:
        if temporary.suffix == ".png":
            figure.canvas.print_png(temporary, pil_kwargs={"compress_level": 4})
        else:
            figure.savefig(temporary, dpi=dpi)


def write_film(path: str | Path, pictures: Sequence[NDArray[np.uint8]], palette: Any, *, ms: int, dither: bool) -> None:
    """Write pictures as an endless GIF in the colours of a palette.

    Parameters
    ----------
    path : path
        The film.
    pictures : sequence of ndarray of uint8, shape (h, w, 3)
        The pictures.
    palette : Image
        Pillow image with the palette.
    ms : int
        Time of each picture (ms).
    dither : bool
        Whether colours are dithered.
    """
    from PIL import Image

    how = Image.Dither.FLOYDSTEINBERG if dither else Image.Dither.NONE
    first, *rest = (Image.fromarray(picture).quantize(palette=palette, dither=how) for picture in pictures)
    with whole_file(path) as temporary:
        first.save(temporary, save_all=True, append_images=rest, duration=ms, loop=0, optimize=False)


def level(amplitude: Array, reference: float = REFERENCE) -> Array:
    """Level of the rms of sines of these amplitudes (dB), by default of accelerations."""
    return np.asarray(20.0 * np.log10(np.maximum(np.abs(amplitude), 1e-12) / math.sqrt(2.0) / reference))


def headed(figure: Any, title: str) -> None:
    """Write a title above all panels."""
    figure.suptitle(title, fontsize=11, x=0.01, ha="left")


def single(width: float, height: float, title: str) -> tuple[Any, Any]:
    """Figure (inches) with one panel under a title, and its axes with a light grid."""
    figure = new_figure(width, height)
    axes = figure.add_subplot()
    tidy(axes)
    axes.set_title(title, fontsize=11, loc="left")
    return figure, axes


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


def panel(axes: Any, ylabel: str, letter: str, title: str) -> Any:
    """Give axes a light grid, a label and a lettered title; return them.

    Parameters
    ----------
    axes : Axes
        The axes; changed.
    ylabel : str
        Label of the ordinate; none if empty.
    letter : str
        Letter of the panel.
    title : str
        Title; none if empty.
    """
    tidy(axes)
    if ylabel:
        axes.set_ylabel(ylabel)
    if title:
        axes.set_title(f"({letter})  {title}", fontsize=10.5, loc="left")
    return axes


def labelled(axes: Any, title: str, below: str) -> Any:
    """The axes of one panel among several: light grid, small title and label."""
    tidy(axes)
    axes.set_title(title, loc="left", fontsize=9.5)
    axes.set_xlabel(below, fontsize=9)
    axes.tick_params(labelsize=8.5)
    return axes


def legend_beside(axes: Any) -> None:
    """Names of the curves to the right of the panel."""
    axes.legend(fontsize=8, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))


def bars(axes: Any, x: Array, tops: Array, width: float, bottom: float, colour: str, name: str | None = None) -> None:
    """Draw bars between `bottom` and their tops as one object: 60 rectangles take 60 times as long.

    Parameters
    ----------
    axes : Axes
        The axes, with limits; changed.
    x, tops : ndarray, shape (n,)
        Middles and upper ends.
    width, bottom : float
        Width and lower end of all.
    colour : str
        Colour.
    name : str, optional
        Name in the legend.
    """
    from matplotlib.collections import PolyCollection

    left, right, low = x - 0.5 * width, x + 0.5 * width, np.full(len(x), bottom)
    corners = np.array([[left, right, right, left], [low, low, tops, tops]]).transpose(2, 1, 0)
    axes.add_collection(PolyCollection(list(corners), facecolors=colour, linewidths=0.0, label=name))


def some_of(count: int, most: int) -> IntArray:
    """Numbers of the curves that are drawn of so many: all, or `most` evenly spread ones."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))


def shades(low: float, high: float, *, logarithmic: bool = False) -> tuple[Callable[[float], Any], Any]:
    """Colour of a value between two, and what a colour bar is drawn of."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm, Normalize

    norm, colours = (LogNorm if logarithmic else Normalize)(low, high), on_white("viridis", 0.0, 0.82)
    return lambda value: colours(norm(value)), ScalarMappable(norm, colours)


def on_white(name: str, low: float, high: float) -> Any:
    """A part of matplotlib's colour map: what is left out is too light for lines on white."""
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap

    return ListedColormap(colormaps[name](np.linspace(low, high, 256)))
