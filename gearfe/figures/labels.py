"""Texts beside points of a picture that cover neither each other nor the lines, and stay inside of the frame."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from ..typing import Array
from .style import GREY

#: Places that are tried: sideways in parts of a text's width, upwards in its heights.
SIDEWAYS, UPWARDS = (0.0, -0.55, 0.55, -1.0, 1.0, -1.5, 1.5), (0.0, 0.35, 0.7, 1.05, 1.4, 2.1, 2.8, 3.5)
#: Room between texts, and between a text and its point (points of 1/72 inch).
ROOM, ABOVE = 1.5, 5.0


class _Box(NamedTuple):
    left: float
    low: float
    right: float
    high: float

    def meets(self, other: _Box) -> bool:
        return self.left < other.right and other.left < self.right and self.low < other.high and other.low < self.high


def label_lines(axes: Any, labels: Sequence[tuple[float, float, str]], x: Array, y: Array, **look: Any) -> None:
    """Label some of the vertical lines from 0 to (x, y), each at the nearest free place; without one, not at all.

    Parameters
    ----------
    axes
        With their final limits.
    labels
        (x, y, text), the most important first.
    x, y : (n,)
        Tips of all lines, which no label covers.
    """
    renderer = axes.figure.canvas.get_renderer()
    scale = axes.figure.dpi / 72.0
    frame = axes.get_window_extent(renderer)
    tips = axes.transData.transform(np.column_stack([x, y]))
    taken: list[_Box] = []
    for at_x, at_y, text in labels:
        note = axes.text(at_x, at_y, text, ha="center", va="bottom", **look)
        size = note.get_window_extent(renderer)
        note.remove()
        width, height = size.width + 2.0 * ROOM * scale, size.height + 2.0 * ROOM * scale
        tip = axes.transData.transform((at_x, at_y))
        places = sorted(product(SIDEWAYS, UPWARDS), key=lambda place: math.hypot(place[0] * width, place[1] * height))
        for aside, above in places:
            middle = float(np.clip(tip[0] + aside * width, frame.x0 + 0.5 * width, frame.x1 - 0.5 * width))
            low = tip[1] + ABOVE * scale + above * height
            box = _Box(middle - 0.5 * width, low, middle + 0.5 * width, low + height)
            free = box.high < frame.y1 and not any(box.meets(other) for other in taken)
            if free and not np.any((tips[:, 0] > box.left) & (tips[:, 0] < box.right) & (tips[:, 1] > box.low)):
                taken.append(box)
                far = abs(middle - tip[0]) > 0.5 * width or low - tip[1] > 2.0 * ABOVE * scale
                axes.annotate(
                    text, (at_x, at_y), axes.transData.inverted().transform((middle, low)), ha="center", va="bottom",
                    arrowprops={"arrowstyle": "-", "color": GREY, "linewidth": 0.6, "shrinkB": 3.0} if far else None,
                    bbox={"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 0.6}, **look,
                )  # fmt: skip
                break
