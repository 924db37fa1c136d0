"""A mechanism at one state, coloured by how far its points are from the start, or how fast they move."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ..base.typing import Array, ComplexArray, IntArray
from ..mechanisms.model import Mechanism
from ..multibody import Trajectory
from .mechanism_scene import draw_backdrop, draw_names, draw_state, link_places, place_of, rigid_ends

#: Pieces of an edge of a body, each of one colour.
PIECES = 24
#: Longest arrow of a velocity, as a share of the picture.
ARROW = 0.16
#: Share of the colours within bodies; opaque, since seams of triangles would show through.
PALE = 0.5
LABELS = {"displacement": "displacement from the start (m)", "velocity": "velocity (m/s)"}


class Shape(NamedTuple):
    """Points of a body that get a colour."""

    places: Callable[[Array, float], ComplexArray]  # of states (n, k), deflections times a factor: (n, points), m
    rim: int  # so many of the points follow each other along the edge
    triangles: IntArray  # (t, 3) of the points, to be filled
    arrows: IntArray  # points that get an arrow of their velocity


def draw_field(axes: Any, mechanism: Mechanism, trajectory: Trajectory, time: float, *, names: bool) -> None:
    """Draw the bodies at a time in the colours that ``figure.colour`` asks for, with their bar.

    Displacements stand above the pale start, velocities have arrows at points.

    Parameters
    ----------
    axes : Axes
        Where to draw.
    mechanism : Mechanism
        The mechanism.
    trajectory : Trajectory
        Its motion.
    time : float
        The time (s).
    names : bool
        Whether bodies and points are named.
    """
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import LineCollection
    from matplotlib.colors import ListedColormap, Normalize

    kind, factor = str(mechanism.file.figure.colour), mechanism.file.figure.magnification
    start = trajectory.start.q[None, :]
    q, v = (trajectory.dense(np.array([time]), k) for k in range(2))
    shapes = _shapes(mechanism)
    if kind == "displacement":
        draw_state(axes, mechanism, start, alpha=0.2)
        moves = [(shape.places(q, 1.0) - shape.places(start, 1.0))[0] for shape in shapes]
    else:
        moves = [_velocities(shape, q, v, mechanism.system.units) for shape in shapes]
    largest = max((float(np.abs(move).max(initial=0.0)) for move in moves), default=0.0)
    look: dict[str, Any] = {"cmap": colormaps["viridis"], "norm": Normalize(0.0, largest or 1.0)}
    pale = {**look, "cmap": ListedColormap(1.0 - PALE * (1.0 - look["cmap"](np.arange(256))))}
    draw_backdrop(axes, mechanism, q)
    places = [shape.places(q, factor)[0] for shape in shapes]
    for shape, z, move in zip(shapes, places, moves, strict=True):
        value, corners = np.abs(move), np.stack([z.real, z.imag], axis=1)
        if len(shape.triangles):
            axes.tripcolor(z.real, z.imag, shape.triangles, value, shading="gouraud", zorder=1.6, **pale)
        if shape.rim > 1:
            pieces = np.stack([corners[: shape.rim - 1], corners[1 : shape.rim]], axis=1)
            edges = LineCollection(list(pieces), lw=3, zorder=2, capstyle="round", **look)
            edges.set_array(0.5 * (value[: shape.rim - 1] + value[1 : shape.rim]))
            axes.add_collection(edges, autolim=False)
    if kind == "velocity" and largest > 0.0:
        tails = np.concatenate([z[shape.arrows] for shape, z in zip(shapes, places, strict=True)])
        arrows = np.concatenate([move[shape.arrows] for shape, move in zip(shapes, moves, strict=True)])
        scale = largest / (ARROW * max(np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())))
        look_of_arrows: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "width": 0.004, "zorder": 3}
        axes.quiver(tails.real, tails.imag, arrows.real, arrows.imag, scale=scale, color="#374151", **look_of_arrows)
    if names:
        draw_names(axes, mechanism, q)
    axes.figure.colorbar(ScalarMappable(**look), ax=axes, label=LABELS[kind], shrink=0.85)


def _velocities(shape: Shape, q: Array, v: Array, units: Array) -> ComplexArray:
    """Velocities of the points of a shape (m/s), as complex numbers: places are smooth functions of the coordinates."""
    speed = float(np.abs(v / units).max())
    step = 1e-5 / speed if speed > 0.0 else 1.0
    return np.asarray((shape.places(q + step * v, 1.0) - shape.places(q - step * v, 1.0))[0] / (2.0 * step))


def _shapes(mechanism: Mechanism) -> list[Shape]:
    none = np.zeros((0, 3), dtype=int)
    shapes = []
    for body, ends in rigid_ends(mechanism):
        count = len(ends)
        loop = np.append(ends, ends[0]) if count > 2 else ends
        knots = np.arange(len(loop)) * PIECES
        rim = np.interp(np.arange(knots[-1] + 1), knots, loop) if count > 1 else ends
        triangles = none
        if count > 2:  # a fan about the middle
            number = np.arange(len(rim) - 1)
            triangles = np.stack([number, number + 1, np.full_like(number, len(rim))], axis=1)
        points = np.append(rim, ends.mean())
        shapes.append(Shape(partial(_rigid_places, body, points), len(rim), triangles, knots[:count]))
    for link in mechanism.links.values():
        at = link.smooth
        shapes.append(Shape(partial(link_places, link, at), len(at), none, np.array([0, len(at) - 1])))
    for plate in mechanism.plates.values():
        t = plate.part.plate.triangles
        small = np.concatenate([t[:, [0, 3, 5]], t[:, [3, 1, 4]], t[:, [5, 4, 2]], t[:, [3, 4, 5]]])
        shapes.append(Shape(plate.exaggerated, 0, small, np.zeros(0, dtype=int)))
    return shapes


def _rigid_places(body: int, points: ComplexArray, q: Array, factor: float) -> ComplexArray:  # noqa: ARG001
    """Places of points given relative to the mass centre."""
    return np.stack([place_of(q, body, (point.real, point.imag)) for point in points], axis=1)
