"""Picture of the meshes of a gear pair."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..gear.drawing import zone
from ..gear.pair import GearPair
from ..meshing.export import MeshPart
from ..typing import Array
from .style import BLUE, GREY, ORANGE, RED, new_figure, save

#: Elements beyond which the edges inside of the whole gears would be a grey area: their outlines are drawn there.
MOST = 40000


def mesh_figure(path: str | Path, parts: Mapping[str, MeshPart], pair: GearPair | None) -> None:
    """The whole meshes, and beside them the meshing zone of `pair`, if it is told; contact boundaries in red."""
    both = pair is not None
    figure = new_figure(12.5 if both else 7.0, 6.4)
    views = list(np.atleast_1d(figure.subplots(1, 2 if both else 1)))
    for number, axes in enumerate(views):
        for (name, part), colour in zip(parts.items(), (BLUE, ORANGE), strict=False):
            _draw(axes, part, colour, 0.25 if number == 0 else 0.6, name, zoomed=number > 0)
        axes.set_aspect("equal")
        axes.set_xlabel("x (mm)")
        axes.autoscale_view()
    views[0].set_ylabel("y (mm)")
    elements = sum(len(part.triangles) for part in parts.values())
    views[0].set_title(f"{elements} triangles of second order", loc="left", fontsize=11)
    if pair is not None:
        x, y, half = zone(pair)
        views[1].set_xlim(x - half, x + half)
        views[1].set_ylim(y - half, y + half)
        views[1].set_title("meshing zone", loc="left", fontsize=11)
    handles, labels = views[-1].get_legend_handles_labels()
    entries = dict(zip(labels, handles, strict=True))
    views[-1].legend(entries.values(), entries.keys(), loc="upper right", fontsize=9, framealpha=0.9)
    save(figure, path)


def _draw(axes: Any, part: MeshPart, colour: str, width: float, name: str, *, zoomed: bool) -> None:
    from matplotlib.collections import LineCollection

    points = 1e3 * part.points
    if zoomed or len(part.triangles) <= MOST:
        axes.add_collection(LineCollection(list(_edges(points, part.triangles)), colors=GREY, linewidths=width))
    around = np.concatenate([edges for key, edges in part.boundaries.items() if key != "contact"])
    axes.add_collection(LineCollection(list(points[around]), colors=colour, linewidths=1.0, label=name))
    if "contact" in part.boundaries:
        red = LineCollection(
            list(points[part.boundaries["contact"]]), colors=RED, linewidths=1.6, label="contact boundary"
        )
        axes.add_collection(red)


def _edges(points: Array, triangles: Any) -> Array:
    """Curved edges of the triangles as three points each, shape (e, 3, 2), each edge once."""
    sides = triangles[:, [[0, 3, 1], [1, 4, 2], [2, 5, 0]]].reshape(-1, 3)
    _, once = np.unique(sides[:, 1], return_index=True)
    made: Array = points[sides[once]]
    return made
