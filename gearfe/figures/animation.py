"""Animation of the stress in the meshing zone: frames drawn off-screen on the Agg canvas, joined to a GIF by Pillow."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..output.files import whole_file
from ..typing import Array, IntArray
from .style import color_limit, draw_zone, new_figure

Part = tuple[Array, IntArray, Array]


@dataclass(frozen=True)
class Frame:
    """One picture of the meshing zone.

    Attributes
    ----------
    angle
        Pinion angle (deg).
    parts
        For each gear: points, shape (n, 2) (mm), straight triangles, shape (m, 3), and stress at the points (MPa).
    """

    angle: float
    parts: Sequence[Part]


def cut_out(points: Array, triangles: IntArray, stress: Array, zoom: tuple[float, float, float]) -> Part:
    """The part of a gear near the zone; its second-order triangles, shape (m, 6), drawn as four straight ones each."""
    x, y, half = zoom
    middle = points[triangles[:, :3]].mean(axis=1)
    near = (np.abs(middle - (x, y)) < 1.25 * half).all(axis=1)
    six = triangles[near]
    straight = six[:, [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]]].reshape(-1, 3)
    used, local = np.unique(straight, return_inverse=True)
    return points[used], local.reshape(-1, 3), stress[used]


def stress_animation(
    path: str | Path,
    frames: Sequence[Frame],
    *,
    title: str,
    zoom: tuple[float, float, float],
    per_second: float = 12.0,
    progress: Callable[[int, int, str], None] | None = None,
) -> None:
    """Write an endless GIF; the file appears whole or not at all.

    Parameters
    ----------
    zoom
        Centre x, y and half width (mm) of the picture.
    per_second
        Frames per second.
    """
    from PIL import Image

    top = max(color_limit(frame.parts) for frame in frames)
    pictures: list[Any] = []
    figure = new_figure(6.6, 5.6)
    axes = figure.add_subplot()
    bar = None
    for done, frame in enumerate(frames, start=1):
        axes.clear()
        drawn = draw_zone(axes, frame.parts, zoom, top)
        axes.set_title(f"{title}, pinion at {frame.angle:.2f}°", loc="left", fontsize=10)
        if bar is None:
            bar = figure.colorbar(drawn, ax=axes, shrink=0.85, extend="max")
            bar.set_label("von Mises stress (MPa)")
            figure.canvas.draw()
            figure.set_layout_engine("none")  # no frame may move the axes
        figure.canvas.draw()
        picture = Image.fromarray(np.asarray(figure.canvas.buffer_rgba())[..., :3].copy())
        pictures.append(picture)
        if progress is not None:
            progress(done, len(frames), "frames drawn")
    palette = Image.new("P", (1, 1))
    palette.putpalette(_palette())
    indexed = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    with whole_file(path) as temporary:
        indexed[0].save(
            temporary,
            save_all=True,
            append_images=indexed[1:],
            duration=round(1000 / per_second),
            loop=0,
            optimize=False,
        )


def _palette() -> list[int]:
    """The colour map's colours and greys for lines and text: 256 times red, green, blue."""
    from matplotlib import colormaps

    colors = np.round(255 * colormaps["turbo"](np.linspace(0, 1, 224))[:, :3]).astype(int)
    greys = np.round(np.linspace(0, 255, 32)).astype(int)[:, None].repeat(3, axis=1)
    return [int(v) for v in np.concatenate([colors, greys]).ravel()]
