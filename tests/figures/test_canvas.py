"""Ticks drawn together are those of matplotlib, pixel by pixel; kept texts are as large as matplotlib's."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg, RendererAgg
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.ticker import LogLocator

from gearfe.figures.canvas import PictureAxes, PictureCanvas, PictureFigure


def _plain(figure: Any) -> None:
    axes = figure.add_subplot()
    axes.grid(True, color="#e5e7eb")
    axes.plot([-3.0, 250.0], [1e-9, 4e-9])
    axes.set_title("a title beside an offset", loc="left")
    axes.set_ylabel("label")


def _logarithmic(figure: Any) -> None:
    axes = figure.add_subplot()
    axes.set_xscale("log")
    axes.set_xlim(3.0, 4e5)
    axes.set_yscale("log")
    axes.set_ylim(2.0, 90.0)
    axes.yaxis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))
    axes.yaxis.set_minor_formatter("{x:g}")
    axes.grid(True, which="both")


def _named(figure: Any) -> None:
    axes = figure.add_subplot()
    axes.set_xticks(range(4), ["one", "", "three\nlines\nof it", "four"])
    axes.tick_params(axis="x", labelrotation=60, labelsize=7, length=0, pad=9, colors="#6b7280")
    axes.invert_yaxis()


def _several(figure: Any) -> None:
    upper, lower = figure.subplots(2, 1, sharex=True)
    lower.plot([0.0, 1.0], [10.0, 2e6])
    upper.tick_params(labelbottom=False)
    lower.set_xlabel("below")
    above = upper.twiny()
    above.set_xlim(0.0, 33.0)
    above.set_xlabel("above")
    upper.set_title("higher than the axis on top")


def _bar(figure: Any) -> None:
    axes = figure.add_subplot()
    shown = axes.pcolormesh(np.arange(12.0).reshape(3, 4))
    figure.colorbar(shown, ax=axes, label="bar")


def _pixels(kind: type, draw: Any) -> Any:
    figure = kind(figsize=(4.0, 3.0), layout="constrained")
    canvas = FigureCanvasAgg(figure)  # texts letter by letter in both
    draw(figure)
    canvas.draw()
    return np.array(canvas.buffer_rgba())


@pytest.mark.parametrize("draw", [_plain, _logarithmic, _named, _several, _bar])
def test_ticks_drawn_together_are_the_same_picture(draw: Any) -> None:
    assert np.array_equal(_pixels(PictureFigure, draw), _pixels(Figure, draw))


def test_an_axis_makes_no_tick_for_each_label() -> None:
    """One for all; matplotlib before 3.10 makes a second one that is not drawn."""
    figure = PictureFigure(figsize=(4.0, 3.0))
    axes = figure.add_subplot()
    axes.set_xticks(range(9), list("abcdefghi"))
    PictureCanvas(figure).draw()
    assert isinstance(axes, PictureAxes)
    assert len(axes.xaxis.majorTicks) <= 2


@pytest.mark.parametrize("text", ["0", "−150", "rotation of the drive  (deg)", "Ågy|"])
def test_kept_texts_are_as_large_as_drawn_ones(text: str) -> None:
    figure = PictureFigure(figsize=(4.0, 3.0), dpi=130)
    renderer, plain = PictureCanvas(figure).get_renderer(), RendererAgg(520, 390, 130)
    prop = FontProperties(size=10.5)
    assert renderer.get_text_width_height_descent(text, prop, False) == pytest.approx(
        plain.get_text_width_height_descent(text, prop, False)
    )


def test_kept_texts_follow_the_settings_of_matplotlib() -> None:
    """The same properties name another font after a change of rcParams, here one whose letters are equally wide."""
    renderer, prop = PictureCanvas(PictureFigure(dpi=130)).get_renderer(), FontProperties(size=40.0)
    wide = [renderer.get_text_width_height_descent(text, prop, False)[0] for text in ("illi" * 4, "mwwm" * 4)]
    assert wide[1] > 2.0 * wide[0]
    with rc_context({"font.sans-serif": ["DejaVu Sans Mono"]}):
        even = [renderer.get_text_width_height_descent(text, prop, False)[0] for text in ("illi" * 4, "mwwm" * 4)]
    assert even[1] == pytest.approx(even[0], rel=0.1)


@pytest.mark.parametrize("angle", [0.0, 90.0])
def test_kept_texts_stand_where_matplotlib_puts_them(angle: float) -> None:
    """Ink of a text begins and ends at most a pixel beside that of matplotlib's."""
    extents = []
    for canvas in (PictureCanvas, FigureCanvasAgg):
        figure = Figure(figsize=(3.0, 3.0), dpi=130)
        figure.text(0.4, 0.4, "speed  (rad/s)", rotation=angle)
        made = canvas(figure)
        made.draw()
        rows, columns = np.nonzero(np.array(made.buffer_rgba())[..., 0] < 128)
        extents.append((rows.min(), rows.max(), columns.min(), columns.max()))
    assert np.abs(np.diff(extents, axis=0)).max() <= 1
