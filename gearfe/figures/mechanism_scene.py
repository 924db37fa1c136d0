"""A mechanism at one state: bodies, mass centres, springs, slots, points at rest, names, paths of points."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..mechanisms.model import Mechanism
from ..mechanisms.plates import PlateLink
from ..rigid import GROUND, Prismatic, Slot, Spring
from ..rigid.distance import Distance
from ..typing import Array
from .style import COLOURS, GREY

#: Bodies beyond which names would hide the mechanism.
MOST_NAMES = 20
#: Zigzags of a spring, and its half width in parts of the picture's size.
COILS, COIL_WIDTH = 9, 0.016
#: Width of a letter of a name (points), at most.
WIDTH = 6.0
Point = tuple[float, float]


def draw_state(axes: Any, mechanism: Mechanism, q: Array, *, alpha: float = 1.0, names: bool = False) -> None:
    """Bodies as outlines of their points at one state, q of shape (1, k); with `names` those of bodies and points."""
    size = _size(mechanism, q)
    _couplings(axes, mechanism, q, size, alpha)
    for number, (name, body, points) in enumerate(_points(mechanism)):
        ends = np.array([_at(q, body, p) for p in points.values()]).reshape(-1, 2)
        centre = _at(q, body, (0.0, 0.0))
        if len(ends) == 1:
            ends = np.vstack([ends, centre])
        loop = ends if len(ends) < 3 else np.vstack([ends, ends[:1]])
        colour = COLOURS[number % len(COLOURS)]
        if len(ends) > 2:
            axes.fill(loop[:, 0], loop[:, 1], color=colour, alpha=0.1 * alpha, linewidth=0)
        axes.plot(loop[:, 0], loop[:, 1], "-o", color=colour, lw=2, ms=3.5, alpha=alpha)
        axes.plot(*centre, "+", color=colour, ms=8, alpha=alpha)
        if names:
            _name(axes, name, ends.mean(axis=0) if len(ends) else centre, colour, weight="bold")
    magnification = mechanism.file.figure.magnification
    for number, (name, link) in enumerate(mechanism.links.items(), start=len(_points(mechanism))):
        colour = COLOURS[number % len(COLOURS)]
        shape = link.exaggerated(q, link.smooth, magnification)[0]
        nodes = link.exaggerated(q, link.beam.link.ends, magnification)[0]
        axes.plot(*shape.T, lw=2, color=colour, alpha=alpha)
        axes.plot(*nodes.T, "o", ms=3, color=colour, alpha=alpha)
        if names:
            _name(axes, name, shape[len(shape) // 2], colour, weight="bold")
    for number, (name, plate) in enumerate(
        mechanism.plates.items(), start=len(_points(mechanism)) + len(mechanism.links)
    ):
        colour = COLOURS[number % len(COLOURS)]
        places = plate.exaggerated(q, magnification)[0]
        draw_plate(axes, plate, places, colour, alpha)
        if names:
            _name(axes, name, np.array([places.real.mean(), places.imag.mean()]), colour, weight="bold")
    if mechanism.elastic and magnification != 1.0:
        axes.text(0.01, 0.01, f"deflections x {magnification:g}", transform=axes.transAxes, fontsize=8)
    for name, place in mechanism.file.ground.points_m.items():
        axes.plot(*place, "k^", ms=6, mfc="none", alpha=alpha)
        if names:
            _name(axes, name, np.array(place), "black")
    if names:
        _point_names(axes, mechanism, q)


def draw_plate(axes: Any, plate: PlateLink, places: np.ndarray, colour: str, alpha: float) -> None:
    """A link of finite elements, filled, with its edge; `places` are those of its nodes as complex numbers."""
    from matplotlib.collections import LineCollection, PolyCollection

    at = np.stack([places.real, places.imag], axis=1)
    corners = plate.part.plate.triangles[:, [0, 3, 1, 4, 2, 5]]
    axes.add_collection(
        PolyCollection(list(at[corners]), facecolor=colour, alpha=0.18 * alpha, linewidth=0), autolim=False
    )
    axes.add_collection(LineCollection(list(at[plate.border]), colors=colour, lw=1.4, alpha=alpha), autolim=False)


def draw_paths(axes: Any, mechanism: Mechanism, q: Array) -> None:
    """Paths of points over the run, q of shape (n, k)."""
    for path in mechanism.file.paths:
        body = mechanism.linkage.body_index[path.body]
        if body == len(mechanism.linkage.bodies):
            continue
        if isinstance(path.point, str):
            label = f"{path.body}.{path.point}"
            body, point = mechanism.point(label)
        else:
            label = f"{path.body} {path.point}"
            centre = mechanism.file.bodies[path.body].centre_m
            point = (path.point[0] - centre[0], path.point[1] - centre[1])
        axes.plot(*_place(q, body, point), lw=0.8, alpha=0.7, color=GREY, zorder=1, label=label)


def frame(axes: Any, mechanism: Mechanism, q: Array) -> None:
    """Limits that hold the whole run, labels with their unit."""
    x: list[float] = []
    y: list[float] = []
    for _, body, points in _points(mechanism):
        for point in [*points.values(), (0.0, 0.0)]:
            a, b = _place(q, body, point)
            x += [a.min(), a.max()]
            y += [b.min(), b.max()]
    for link in mechanism.links.values():
        shapes = link.exaggerated(q, link.beam.link.ends, mechanism.file.figure.magnification)
        x += [shapes[:, :, 0].min(), shapes[:, :, 0].max()]
        y += [shapes[:, :, 1].min(), shapes[:, :, 1].max()]
    for plate in mechanism.plates.values():
        places = plate.exaggerated(q, mechanism.file.figure.magnification)
        x += [places.real.min(), places.real.max()]
        y += [places.imag.min(), places.imag.max()]
    for a, b in _coupled(mechanism, q):
        x += [a.min(), a.max()]
        y += [b.min(), b.max()]
    ground = mechanism.file.ground.points_m.values()
    x += [place[0] for place in ground]
    y += [place[1] for place in ground]
    pad = 0.06 * max(max(x) - min(x), max(y) - min(y), 1e-9)
    axes.set_xlim(min(x) - pad, max(x) + pad)
    axes.set_ylim(min(y) - pad, max(y) + pad)
    axes.set_aspect("equal")
    axes.grid(color="#e5e7eb", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")


def _coupled(mechanism: Mechanism, q: Array) -> list[tuple[Array, Array]]:
    """Places of the ends of springs and distance joints."""
    linkage = mechanism.linkage
    turned = np.append(q[:, : 3 * len(linkage.bodies)], np.zeros((len(q), 3)), axis=1)  # the ground stands still
    parts = [*linkage.forces, *linkage.joints]
    return [
        _place(turned, linkage.body_index[body], linkage.frames.arm(body, at))
        for part in parts
        if isinstance(part, (Spring, Distance))
        for body, at in ((part.a, part.point_a), (part.b, part.point_b))
    ]


def _points(mechanism: Mechanism) -> list[tuple[str, int, dict[str, Point]]]:
    """Name and number of each rigid body, and its named points relative to the mass centre."""
    return [
        (
            name,
            mechanism.linkage.body_index[name],
            {p: mechanism.point(f"{name}.{p}")[1] for p in table.points_m},
        )
        for name, table in mechanism.file.bodies.items()
        if name not in mechanism.elastic
    ]


def _place(q: Array, body: int, point: Point) -> tuple[Array, Array]:
    c, s = np.cos(q[:, 3 * body + 2]), np.sin(q[:, 3 * body + 2])
    x, y = point
    return q[:, 3 * body] + c * x - s * y, q[:, 3 * body + 1] + s * x + c * y


def _at(q: Array, body: int, point: Point) -> Array:
    """Place of a point relative to the mass centre at the first state."""
    return np.array([float(value[0]) for value in _place(q, body, point)])


def _size(mechanism: Mechanism, q: Array) -> float:
    """Largest extent of the bodies and the points at rest (m)."""
    places = [_at(q, body, p) for _, body, points in _points(mechanism) for p in [*points.values(), (0.0, 0.0)]]
    places += [np.array(place) for place in mechanism.file.ground.points_m.values()]
    return float(np.ptp(places, axis=0).max()) if places else 1.0


def _couplings(axes: Any, mechanism: Mechanism, q: Array, size: float, alpha: float) -> None:
    """Springs as zigzags, rods of constant length as thin lines, slots and guides as dashed ones."""
    linkage = mechanism.linkage
    turned = np.append(q[:, : 3 * len(linkage.bodies)], np.zeros((len(q), 3)), axis=1)  # the ground stands still

    def seen(body: str, at: Point) -> Array:
        return _at(turned, linkage.body_index[body], linkage.frames.arm(body, at))

    for force in linkage.forces:
        if isinstance(force, Spring):
            line = _coil(seen(force.a, force.point_a), seen(force.b, force.point_b), COIL_WIDTH * size)
            axes.plot(*line.T, color=GREY, lw=1.1, alpha=alpha, zorder=1.5)
    for joint in linkage.joints:
        if isinstance(joint, Distance):
            ends = np.array([seen(joint.a, joint.point_a), seen(joint.b, joint.point_b)])
            axes.plot(*ends.T, color=GREY, lw=1.1, alpha=alpha, zorder=1.5)
        elif isinstance(joint, (Slot, Prismatic)):
            origin, point = seen(joint.line, joint.origin), seen(joint.body, joint.point)
            reach = (joint.origin[0] + joint.direction[0], joint.origin[1] + joint.direction[1])
            along = seen(joint.line, reach) - origin
            along /= np.linalg.norm(along)
            places = [0.0, float((point - origin) @ along)]
            ends = np.array(
                [origin + (min(places) - 0.15 * size) * along, origin + (max(places) + 0.15 * size) * along]
            )
            axes.plot(*ends.T, color=GREY, lw=1.0, dashes=(6, 4), alpha=alpha, zorder=1)
            if joint.line == GROUND:
                axes.plot(*point, "s", ms=9, mfc="none", color=GREY, alpha=alpha)


def _coil(a: Array, b: Array, half: float) -> Array:
    """Points of a zigzag from a to b."""
    along = b - a
    length = float(np.hypot(*along))
    if length == 0.0:
        return np.array([a, b])
    across = np.array([-along[1], along[0]]) / length * half
    where = np.concatenate([[0.0, 0.15], 0.15 + 0.7 * (np.arange(2 * COILS) + 0.5) / (2 * COILS), [0.85, 1.0]])
    side = np.concatenate([[0.0, 0.0], np.tile([1.0, -1.0], COILS), [0.0, 0.0]])
    return np.asarray(a + where[:, None] * along + side[:, None] * across)


def _name(axes: Any, text: str, place: Array, colour: str, weight: str = "normal") -> None:
    from matplotlib.patheffects import withStroke

    halo = [withStroke(linewidth=2.5, foreground="white")]
    offset = (8.0, -6.0) if weight == "bold" else (5.0, 5.0)
    low, high = axes.get_xlim()
    room = 72.0 * axes.bbox.width / axes.figure.dpi * (high - place[0]) / (high - low)  # points to the frame's end
    if offset[0] + WIDTH * len(text) > room:  # to the left, or it would leave the frame
        offset = (-offset[0], offset[1])
    look = {
        "ha": "left" if offset[0] > 0.0 else "right",
        "fontsize": 8,
        "color": colour,
        "weight": weight,
        "path_effects": halo,
        "annotation_clip": True,
    }
    axes.annotate(text, place, xytext=offset, textcoords="offset points", **look)


def _point_names(axes: Any, mechanism: Mechanism, q: Array) -> None:
    """Names of the bodies' points, one for those that meet in a joint and have the same name."""
    near = 1e-3 * max(_size(mechanism, q), 1e-12)
    labelled = [(name, np.array(place)) for name, place in mechanism.file.ground.points_m.items()]
    for _, body, points in _points(mechanism):
        for name, point in points.items():
            place = _at(q, body, point)
            if not any(name == other and np.abs(place - there).max() < near for other, there in labelled):
                labelled.append((name, place))
                _name(axes, name, place, "#374151")
