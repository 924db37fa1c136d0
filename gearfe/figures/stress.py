"""Pictures of the stress on both gears: one position, and a film over the mesh cycle joined by Pillow."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ..base import progress
from ..base.progress import one_thread
from ..base.typing import Array, IntArray
from ..gears.contact.compliance import MeshingPair
from ..gears.gearmesh.curve import StiffnessCurve
from ..gears.gearmesh.fields import solved_fields, straight_triangles
from ..gears.geometry.derived import zone
from ..gears.geometry.pair import GearPair
from .style import new_figure, save, write_film

#: Points, shape (n, 2) (mm), straight triangles, shape (m, 3), and stress at the points (MPa) of one gear.
Part = tuple[Array, IntArray, Array]
#: What is drawn, in half widths of the picture; milliseconds a frame.
DRAWN, FRAME_MS = 1.25, 83


@dataclass(frozen=True)
class Frame:
    """The meshing zone at a pinion angle (deg): what is drawn of both gears."""

    angle: float
    parts: Sequence[Part]


class SectionOfFields(Protocol):
    """A section of a gear to draw: n points, m triangles of six nodes."""

    @property
    def points(self) -> Array:
        """Undeformed, shape (n, 2) (m)."""

    @property
    def triangles(self) -> IntArray:
        """Shape (m, 6)."""

    @property
    def displacement(self) -> Array:
        """Shape (n, 2) (m)."""

    @property
    def von_mises(self) -> Array:
        """Shape (n,) (Pa)."""


def _cut_out(field: SectionOfFields, zoom: tuple[float, float, float]) -> Part:
    """What of a deformed gear is near the zone."""
    x, y, half = zoom
    points = 1e3 * (field.points + field.displacement)
    near = (np.abs(points[field.triangles[:, :3]].mean(axis=1) - (x, y)) < DRAWN * half).all(axis=1)
    used, local = np.unique(straight_triangles(field.triangles[near]), return_inverse=True)
    return points[used], local.reshape(-1, 3), 1e-6 * field.von_mises[used]


def stress_figure(
    folder: Path,
    pair: GearPair,
    place: tuple[float, float],
    fields: Sequence[SectionOfFields],
    most: float | None = None,
    *,
    note: str = "",
) -> None:
    """Draw ``stress_<angle>deg.png``: von Mises stress in the meshing zone, deformed.

    Parameters
    ----------
    folder : Path
        Folder of the picture.
    pair : GearPair
        The gears.
    place : pair of float
        Pinion angle and twist of the wheel (rad).
    fields : sequence of SectionOfFields
        Fields of pinion and wheel.
    most : float, optional
        End of the colours (MPa).
    note
        Words for the title's second line.
    """
    from matplotlib.ticker import MaxNLocator

    zoom = zone(pair, modules=1.5)
    shown = [_cut_out(field, zoom) for field in fields]
    largest = max(float(stress[triangles].max(initial=0.0)) for _, triangles, stress in shown)
    top = color_limit(shown) if most is None else most
    figure = new_figure(8.0, 7.0)
    axes = figure.add_subplot()
    drawn = _draw_zone(axes, shown, zoom, top)
    angle, twist = (math.degrees(part) for part in place)
    title = (
        f"Gear pair {pair.pinion.teeth}/{pair.wheel.teeth}, pinion at {angle:.6g}°, wheel twisted by {twist:.4g}°, "
        "deformation to scale"
    )
    axes.set_title(f"{title}\n{note}largest value {largest:.4g} MPa", loc="left", fontsize=11)
    bar = figure.colorbar(drawn, ax=axes, shrink=0.85, extend="max" if largest > top else "neither")
    bar.set_label("von Mises stress (MPa)")
    bar.locator = MaxNLocator(8)
    bar.update_ticks()
    save(figure, folder / f"stress_{angle:.6g}deg.png", dpi=110)


def _draw_zone(axes: Any, parts: Sequence[Part], zoom: tuple[float, float, float], top: float) -> Any:
    """Draw the stress of both gears in the meshing zone, colours from 0 to `top`; return them for a colour bar."""
    x, y, half = zoom
    drawn = None
    for points, triangles, stress in parts:
        drawn = axes.tripcolor(
            points[:, 0], points[:, 1], triangles, stress, shading="gouraud", cmap="turbo", vmin=0.0, vmax=top
        )
        drawn.set_in_layout(False)  # the axes hold it, and asking for its extent takes a second
        _draw_rim(axes, points, triangles)
    axes.set_aspect("equal")
    axes.set_xlim(x - half, x + half)
    axes.set_ylim(y - half, y + half)
    axes.set_xlabel("x (mm)")
    axes.set_ylabel("y (mm)")
    return drawn


def color_limit(parts: Sequence[Part], *, share: float = 0.004) -> float:
    """Return the stress that a `share` of the area exceeds. Colours up to it also show the roots."""
    level = np.concatenate([stress[triangles].mean(axis=1) for _, triangles, stress in parts])
    edges = [(p[t[:, 1]] - p[t[:, 0]], p[t[:, 2]] - p[t[:, 0]]) for p, t, _ in parts]
    area = np.abs(np.concatenate([a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] for a, b in edges]))
    if not (len(level) and level.max() > 0):
        return 1.0
    order = np.argsort(level)[::-1]
    beyond = np.cumsum(area[order]) / area.sum()
    return float(level[order[min(int(np.searchsorted(beyond, share)), len(order) - 1)]])


def _draw_rim(axes: Any, points: Array, triangles: IntArray) -> None:
    """Draw the edges that belong to one triangle only, as one line with gaps (thousands of lines take seconds)."""
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    _, first, count = np.unique(edges[:, 0] * len(points) + edges[:, 1], return_index=True, return_counts=True)
    ends = points[edges[first[count == 1]]]
    gaps = np.full((len(ends), 1, 2), np.nan)
    x, y = np.concatenate([ends, gaps], axis=1).reshape(-1, 2).T
    axes.plot(x, y, color="#111827", linewidth=0.7, solid_capstyle="round")


def frames_of(elastic: MeshingPair, curve: StiffnessCurve, count: int) -> list[Frame]:
    """Frames of `stress_animation`."""
    angles = np.arange(count) * curve.mesh_cycle / count
    twists = curve.interpolant("twist")(angles).value + curve.lost_motion
    place = zone(elastic.gears, modules=1.5)
    frames: list[Frame] = []
    with one_thread():
        for position, fields in solved_fields(elastic, angles, twists):
            parts = [_cut_out(field, place) for field in fields]
            frames.append(Frame(math.degrees(position.pinion_angle), parts))
            progress.count(len(frames), count, "frames solved")
    return frames


def stress_animation(path: str | Path, elastic: MeshingPair, curve: StiffnessCurve, count: int) -> None:
    """Write the von Mises stress in the meshing zone over one mesh cycle as an endless GIF.

    The twists are the curve's own where it has them, interpolated between its positions otherwise. The file appears
    whole or not at all, and not without a solution.

    Parameters
    ----------
    path : path
        The film.
    elastic : MeshingPair
        The condensed gears.
    curve : StiffnessCurve
        Solved positions.
    count : int
        Number of frames.

    Raises
    ------
    InputError
        When the curve does not cover the mesh cycle.
    """
    from PIL import Image

    pair, frames = elastic.gears, frames_of(elastic, curve, count)
    if not frames:
        return
    zoom, top = zone(pair, modules=1.5), max(color_limit(frame.parts) for frame in frames)
    title = f"Gear pair {pair.pinion.teeth}/{pair.wheel.teeth}, von Mises stress"
    pictures: list[Any] = []
    figure = new_figure(6.6, 5.6)
    axes = figure.add_subplot()
    bar = None
    for done, frame in enumerate(frames, start=1):
        axes.clear()
        drawn = _draw_zone(axes, frame.parts, zoom, top)
        axes.set_title(f"{title}, pinion at {frame.angle:.2f}°", loc="left", fontsize=10)
        if bar is None:
            bar = figure.colorbar(drawn, ax=axes, shrink=0.85, extend="max")
            bar.set_label("von Mises stress (MPa)")
            figure.canvas.draw()
            figure.set_layout_engine("none")  # no frame may move the axes
        figure.canvas.draw()
        pictures.append(np.asarray(figure.canvas.buffer_rgba())[..., :3].copy())
        progress.count(done, len(frames), "frames drawn")
    palette = Image.new("P", (1, 1))
    palette.putpalette(_palette())
    write_film(path, pictures, palette, ms=FRAME_MS, dither=False)


def _palette() -> list[int]:
    """The colour map's colours and greys for lines and text: 256 times red, green, blue."""
    from matplotlib import colormaps

    colors = np.round(255 * colormaps["turbo"](np.linspace(0, 1, 224))[:, :3]).astype(int)
    greys = np.round(np.linspace(0, 255, 32)).astype(int)[:, None].repeat(3, axis=1)
    return [int(v) for v in np.concatenate([colors, greys]).ravel()]
