"""Figure, axes and canvas that draw what matplotlib's draw, in less time.

*Ticks*: matplotlib makes and draws seven objects for each tick. Here an axis keeps one tick with the look of all
(`Axes.tick_params`). To be drawn it is moved: its marks and its grid lines to all places at once, its label to one
place after another. The picture is the same, pixel by pixel. Single ticks cannot have a look of their own.

*Texts*: matplotlib from 3.11 on lays a text out each time that it is measured or drawn, and draws it glyph by glyph.
Here a text is laid out and drawn once, and its image is kept. Letters start at whole pixels, as up to matplotlib 3.10.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import XAxis, XTick, YAxis, YTick
from matplotlib.backends.backend_agg import FigureCanvasAgg, RendererAgg, get_hinting_flag
from matplotlib.figure import Figure
from matplotlib.font_manager import findfont
from matplotlib.ticker import NullLocator

from ..base.typing import Array

#: Boxes (pixels) of the labels on the first and on the second side of an axis.
Boxes = tuple[list[Any], list[Any]]
#: Images of texts that are kept: more than a picture has.
KEPT_TEXTS = 2000


class _Together:
    """One tick that stands for all major, or all minor, ticks of an axis: marks, grid lines and labels."""

    places: Array = np.zeros(0)  # in data coordinates
    labels: tuple[str, ...] = ()  # text of each

    def draw(self: Any, renderer: Any) -> None:
        """Draw grid lines, marks and labels at all places."""
        count = len(self.places)
        self._stand(self.gridline, np.repeat(self.places, 3), np.tile((0.0, 1.0, np.nan), count))
        self._stand(self.tick1line, self.places, np.zeros(count))
        self._stand(self.tick2line, self.places, np.ones(count))
        for lines in (self.gridline, self.tick1line, self.tick2line):
            lines.draw(renderer)
        for label in (self.label1, self.label2):
            for moved in self.moved(label):
                moved.draw(renderer)

    def moved(self: Any, label: Any) -> Iterator[Any]:
        """The label at each place that has a text, if labels are visible."""
        move = label.set_x if isinstance(self, XTick) else label.set_y
        for place, text in zip(self.places.tolist(), self.labels, strict=True):
            if text and label.get_visible():
                move(place)
                label.set_text(text)
                yield label

    def _stand(self, line: Any, along: Array, beside: Array) -> None:
        line.set_data(*((along, beside) if isinstance(self, XTick) else (beside, along)))


class _TogetherX(_Together, XTick):
    pass


class _TogetherY(_Together, YTick):
    pass


class _Axis:
    """What both axes have: one tick for the major ones, one for the minor ones."""

    _known: tuple[Any, Boxes] | None = None

    def get_major_ticks(self: Any, numticks: int | None = None) -> list[Any]:  # noqa: ARG002
        """Return the one that stands for all."""
        return [self.majorTicks[0]]

    def get_minor_ticks(self: Any, numticks: int | None = None) -> list[Any]:  # noqa: ARG002
        """Return the one that stands for all."""
        return [self.minorTicks[0]]

    def _update_ticks(self: Any) -> list[Any]:
        """Major and minor ticks, as far as they lie within the limits."""
        groups = []
        scaled = self.get_transform().transform
        low, high = sorted(scaled(np.array(self.get_view_interval(), dtype=float)))
        slack = 1e-10 * (high - low)
        for locator, places_of, formatter, which in (
            (self.get_major_locator(), self.get_majorticklocs, self.get_major_formatter(), "majorTicks"),
            (self.get_minor_locator(), self.get_minorticklocs, self.get_minor_formatter(), "minorTicks"),
        ):
            if isinstance(locator, NullLocator):
                continue
            places = np.asarray(places_of(), dtype=float)
            texts = formatter.format_ticks(places)
            inside = np.flatnonzero(np.abs(scaled(places) - 0.5 * (low + high)) <= 0.5 * (high - low) + slack)
            if len(inside):
                tick = getattr(self, which)[0]
                tick.places, tick.labels = places[inside], tuple(texts[number] for number in inside)
                groups.append(tick)
        return groups

    def _get_ticklabel_bboxes(self: Any, ticks: list[Any], renderer: Any) -> Boxes:
        """Boxes of all labels; matplotlib asks for them three times in a drawing."""
        looks = [(t.labels, t.places.tobytes(), t.label1.get_fontsize(), t.label1.get_rotation()) for t in ticks]
        key = (id(renderer), self.axes.bbox.bounds, tuple(self.get_view_interval()), looks)
        if self._known is None or self._known[0] != key:
            boxes = [
                [label.get_window_extent(renderer) for tick in ticks for label in tick.moved(getattr(tick, side))]
                for side in ("label1", "label2")
            ]
            self._known = key, (boxes[0], boxes[1])
        return self._known[1]


class _AxisX(_Axis, XAxis):
    _tick_class = _TogetherX


class _AxisY(_Axis, YAxis):
    _tick_class = _TogetherY


class PictureAxes(Axes):
    """Axes whose ticks are drawn together."""

    def _init_axis(self) -> None:
        self.xaxis, self.yaxis = _AxisX(self), _AxisY(self)
        for axis, sides in ((self.xaxis, ("bottom", "top")), (self.yaxis, ("left", "right"))):
            for side in sides:
                self.spines[side].register_axis(axis)


class PictureFigure(Figure):
    """Figure whose panels are `PictureAxes`, unless a projection is asked for."""

    def add_subplot(self, *args: Any, **kwargs: Any) -> Any:
        """Add a panel, as `Figure.add_subplot` does."""
        return super().add_subplot(*args, **_classed(kwargs))

    def add_axes(self, *args: Any, **kwargs: Any) -> Any:
        """Add a panel, as `Figure.add_axes` does."""
        return super().add_axes(*args, **_classed(kwargs))


def _classed(kwargs: dict[str, Any]) -> dict[str, Any]:
    return kwargs if "projection" in kwargs else {"axes_class": PictureAxes, **kwargs}


@dataclass(frozen=True, eq=False)
class _Written:
    """Image of a text, its offset and its width, height and descent (pixels)."""

    image: Any
    offset: tuple[float, float]
    size: tuple[float, float, float]


_WRITTEN: dict[tuple[str, int, str, int, float], _Written] = {}


class _Renderer(RendererAgg):
    """Agg that lays out and draws a text once."""

    def _written(self, text: str, prop: Any) -> _Written:
        # a family such as "sans-serif" names the font that the settings of matplotlib give it now
        key = (text, hash(prop), findfont(prop), get_hinting_flag(), self.dpi)
        if key not in _WRITTEN:
            if len(_WRITTEN) >= KEPT_TEXTS:
                _WRITTEN.clear()
            font = self._prepare_font(prop)
            font.set_text(text, 0.0, flags=get_hinting_flag())
            font.draw_glyphs_to_bitmap(antialiased=True)
            width, height = font.get_width_height()
            left, up = font.get_bitmap_offset()
            size = (width / 64.0, height / 64.0, font.get_descent() / 64.0)
            _WRITTEN[key] = _Written(np.array(font.get_image()), (left / 64.0, up / 64.0), size)
        return _WRITTEN[key]

    def draw_text(
        self, gc: Any, x: float, y: float, s: str, prop: Any, angle: float, ismath: Any = False, mtext: Any = None
    ) -> None:
        """Draw a text as its kept image; formulas and slanting texts as matplotlib does."""
        if ismath or angle % 90.0:
            super().draw_text(gc, x, y, s, prop, angle, ismath, mtext)
            return
        written, turned = self._written(s, prop), math.radians(angle)
        left, up = written.offset
        at_x = round(x + left + written.size[2] * math.sin(turned))
        at_y = round(y + up + written.size[2] * math.cos(turned))
        self._renderer.draw_text_image(written.image, at_x, at_y + 1, angle, gc)

    def get_text_width_height_descent(self, s: str, prop: Any, ismath: Any) -> Any:
        """Width, height and descent of a text (pixels)."""
        return super().get_text_width_height_descent(s, prop, ismath) if ismath else self._written(s, prop).size


class PictureCanvas(FigureCanvasAgg):
    """Canvas that draws texts by their kept images."""

    _size: tuple[float, float, float] | None = None

    def get_renderer(self) -> Any:
        """Return the renderer of the figure's size."""
        key = (*self.figure.bbox.size, self.figure.dpi)
        if self._size != key:
            self.renderer, self._size = _Renderer(*key), key
        return self.renderer
