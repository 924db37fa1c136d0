"""A mechanism at one state: bodies, mass centres, springs, slots, points at rest, names, paths of points."""

from __future__ import annotations

import itertools
from functools import partial
from typing import Any

import numpy as np

from ..base.typing import Array, ComplexArray
from ..mechanisms.links import FlexibleLink
from ..mechanisms.model import Mechanism
from ..mechanisms.plates import PlateLink
from ..multibody import GROUND, Prismatic, Slot, Spring, Trajectory
from ..multibody.planar.joints import Distance
from .style import COLOURS, GREY

#: Bodies beyond which names would hide the mechanism.
MOST_NAMES = 20
#: Zigzags of a spring, and its half width in parts of the picture's size.
COILS, COIL_WIDTH = 9, 0.016
#: Width of a letter of a name (points), at most.
WIDTH = 6.0
#: Largest distance of a path from the chords that draw it, in parts of its size; pieces of a step to begin with, which
#: see a turn that ends where it begins; most states of a picture.
SAGITTA, LEAST_PIECES, MOST_STATES = 5e-4, 8, 40_000
Point = tuple[float, float]


def draw_state(axes: Any, mechanism: Mechanism, q: Array, *, alpha: float = 1.0, names: bool = False) -> None:
    """Draw the bodies as outlines of their points at one state.

    Parameters
    ----------
    axes : Axes
        Where to draw.
    mechanism : Mechanism
        The mechanism.
    q : ndarray, shape (1, size)
        Coordinates.
    alpha : float
        Opacity, 0 to 1.
    names : bool
        Whether bodies and points are named.
    """
    draw_backdrop(axes, mechanism, q, alpha=alpha)
    magnification = mechanism.file.figure.magnification
    for (body, points), colour in zip(rigid_ends(mechanism), body_colours(mechanism), strict=False):
        centre = place_of(q, body, (0.0, 0.0))[0]
        ends = np.array([place_of(q, body, (p.real, p.imag))[0] for p in points])
        loop = ends if len(ends) < 3 else np.append(ends, ends[0])
        if len(ends) > 2:
            axes.fill(loop.real, loop.imag, color=colour, alpha=0.1 * alpha, linewidth=0)
        axes.plot(loop.real, loop.imag, "-o", color=colour, lw=2, ms=3.5, alpha=alpha)
        axes.plot(centre.real, centre.imag, "+", color=colour, ms=8, alpha=alpha)
    for link, colour in zip(mechanism.links.values(), body_colours(mechanism), strict=False):
        shape, nodes = (link_places(link, at, q, magnification)[0] for at in (link.smooth, link.beam.link.ends))
        axes.plot(shape.real, shape.imag, lw=2, color=colour, alpha=alpha)
        axes.plot(nodes.real, nodes.imag, "o", ms=3, color=colour, alpha=alpha)
    for plate, colour in zip(mechanism.plates.values(), body_colours(mechanism), strict=False):
        _draw_plate(axes, plate, plate.exaggerated(q, magnification)[0], colour, alpha)
    if names:
        draw_names(axes, mechanism, q)


def draw_backdrop(axes: Any, mechanism: Mechanism, q: Array, *, alpha: float = 1.0) -> None:
    """Draw springs, rods, guides, points at rest, and the factor of deflections.

    Parameters
    ----------
    axes : Axes
        Where to draw.
    mechanism : Mechanism
        The mechanism.
    q : ndarray, shape (1, size)
        Coordinates.
    alpha : float
        Opacity, 0 to 1.
    """
    _couplings(axes, mechanism, q, _size(mechanism, q), alpha)
    magnification = mechanism.file.figure.magnification
    if mechanism.elastic and magnification != 1.0:
        axes.text(0.01, 0.01, f"deflections x {magnification:g}", transform=axes.transAxes, fontsize=8)
    for place in mechanism.file.ground.points_m.values():
        axes.plot(*place, "k^", ms=6, mfc="none", alpha=alpha)


def draw_names(axes: Any, mechanism: Mechanism, q: Array) -> None:
    """Names of the bodies in their colours, and of points."""
    magnification = mechanism.file.figure.magnification
    rigid = [name for name in mechanism.file.bodies if name not in mechanism.elastic]
    middles = [
        np.mean([place_of(q, body, (p.real, p.imag))[0] for p in points]) for body, points in rigid_ends(mechanism)
    ]
    named = list(zip(rigid, middles, body_colours(mechanism), strict=False))
    for (name, link), colour in zip(mechanism.links.items(), body_colours(mechanism), strict=False):
        shape = link_places(link, link.smooth, q, magnification)[0]
        named.append((name, shape[len(shape) // 2], colour))
    for (name, plate), colour in zip(mechanism.plates.items(), body_colours(mechanism), strict=False):
        named.append((name, plate.exaggerated(q, magnification)[0].mean(), colour))
    for name, place, colour in named:
        _name(axes, name, complex(place), colour, weight="bold")
    for name, place in mechanism.file.ground.points_m.items():
        _name(axes, name, complex(*place), "black")
    _point_names(axes, mechanism, q)


def rigid_ends(mechanism: Mechanism) -> list[tuple[int, ComplexArray]]:
    """Number of each rigid body, and its named points relative to the mass centre; beside a single one the centre."""
    found = []
    for _, body, points in _points(mechanism):
        ends = np.array([complex(*point) for point in points.values()], dtype=complex)
        found.append((body, np.append(ends, 0.0) if len(ends) < 2 else ends))
    return found


def _draw_plate(axes: Any, plate: PlateLink, places: np.ndarray, colour: str, alpha: float) -> None:
    """A link of finite elements, filled, with its edge; `places` are those of its nodes as complex numbers."""
    from matplotlib.collections import LineCollection, PolyCollection

    at = np.stack([places.real, places.imag], axis=1)
    corners = plate.part.plate.triangles[:, [0, 3, 1, 4, 2, 5]]
    axes.add_collection(
        PolyCollection(list(at[corners]), facecolor=colour, alpha=0.18 * alpha, linewidth=0), autolim=False
    )
    axes.add_collection(LineCollection(list(at[plate.border]), colors=colour, lw=1.4, alpha=alpha), autolim=False)


def draw_paths(axes: Any, mechanism: Mechanism, q: Array) -> None:
    """Paths of points over the run, q of shape (n, k): states that `drawn_states` has chosen."""
    for label, body, point in path_points(mechanism):
        places = place_of(q, body, point)
        axes.plot(places.real, places.imag, lw=0.8, alpha=0.7, color=GREY, zorder=1, label=label)


def drawn_states(mechanism: Mechanism, trajectory: Trajectory) -> Array:
    """Return states over the run, shape (n, k), whose chords leave the paths by at most `SAGITTA` of the picture.

    The paths are those of the file's points, and of the points of rigid bodies, which the frame of the picture holds.
    They follow from the solution between the output times, not from these.
    """
    if len(trajectory.time) < 2 or len(trajectory.dense.times) < 2:
        return trajectory.q
    begin, end = sorted((trajectory.time[0], trajectory.time[-1]))
    ends = np.sort(trajectory.dense.times)
    ends = np.unique(np.concatenate([[begin], ends[(ends > begin) & (ends < end)], [end]]))
    pieces = int(np.clip(MOST_STATES // len(ends), 1, LEAST_PIECES))
    times = np.interp(np.arange((len(ends) - 1) * pieces + 1) / pieces, np.arange(len(ends)), ends)
    tracks = [(body, point) for _, body, point in path_points(mechanism)]
    tracks += [(body, (p.real, p.imag)) for body, points in rigid_ends(mechanism) for p in points]

    def places(at: Array) -> ComplexArray:
        q = trajectory.dense(at)
        return (
            np.stack([place_of(q, *track) for track in tracks], axis=1) if tracks else np.zeros((len(at), 1), complex)
        )

    z = places(times)
    size = float(max(np.ptp(z.real), np.ptp(z.imag)))
    while len(times) < MOST_STATES:
        middle = 0.5 * (times[1:] + times[:-1])
        between = places(middle)
        off = np.abs(between - 0.5 * (z[1:] + z[:-1])).max(axis=1)
        wanted = np.flatnonzero(off > SAGITTA * size)
        if not len(wanted):
            break
        times, z = np.insert(times, wanted + 1, middle[wanted]), np.insert(z, wanted + 1, between[wanted], axis=0)
    return trajectory.dense(times)


def path_points(mechanism: Mechanism) -> list[tuple[str, int, Point]]:
    """Label, body and place relative to the mass centre of the points whose paths are drawn."""
    found = []
    for path in mechanism.file.paths:
        if isinstance(path.point, str):
            label = f"{path.body}.{path.point}"
            found.append((label, *mechanism.point(label)))
        else:
            body = mechanism.linkage.body_index[path.body]
            found.append((f"{path.body} {path.point}", body, mechanism.linkage.frames.arm(path.body, path.point)))
    return found


def body_colours(mechanism: Mechanism) -> list[str]:
    """Colours of the bodies in their order."""
    return list(itertools.islice(itertools.cycle(COLOURS), max(len(mechanism.file.bodies), 1)))


def frame(axes: Any, mechanism: Mechanism, q: Array) -> None:
    """Limits that hold the whole run, labels with their unit."""
    factor = mechanism.file.figure.magnification
    places = [*_rigid_places(mechanism, q), *(place for _, *ends in coupled(mechanism, q) for place in ends)]
    places += [link_places(link, link.beam.link.ends, q, factor) for link in mechanism.links.values()]
    places += [plate.exaggerated(q, factor) for plate in mechanism.plates.values()]
    low, high = (np.array([[f(p.real), f(p.imag)] for p in places]) for f in (np.min, np.max))
    (x0, y0), (x1, y1) = low.min(axis=0), high.max(axis=0)
    pad = 0.06 * max(x1 - x0, y1 - y0, 1e-9)
    axes.set_xlim(x0 - pad, x1 + pad)
    axes.set_ylim(y0 - pad, y1 + pad)
    axes.set_aspect("equal")
    axes.grid(color="#e5e7eb", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")


def link_places(link: FlexibleLink, at: Array, q: Array, factor: float) -> ComplexArray:
    """Return places of a flexible link with exaggerated deflections, as complex numbers.

    Parameters
    ----------
    link : FlexibleLink
        The link.
    at : ndarray, shape (k,)
        Stations along the link (m).
    q : ndarray, shape (n, size)
        Coordinates.
    factor : float
        Factor on the deflections.

    Returns
    -------
    places : ndarray of complex, shape (n, k)
        x + i y (m).
    """
    shape = link.exaggerated(q, at, factor)
    return np.asarray(shape[:, :, 0] + 1j * shape[:, :, 1])


def coupled(mechanism: Mechanism, q: Array) -> list[tuple[Spring | Distance, ComplexArray, ComplexArray]]:
    """Springs and distance joints with the places of both ends."""
    parts = [p for p in (*mechanism.linkage.forces, *mechanism.linkage.joints) if isinstance(p, (Spring, Distance))]
    seen = partial(_seen, mechanism, q)
    return [(part, seen(part.a, part.point_a), seen(part.b, part.point_b)) for part in parts]


def _seen(mechanism: Mechanism, q: Array, body: str, at: Point) -> ComplexArray:
    """Places of a point of a body, or of the ground, which stands still."""
    linkage = mechanism.linkage
    every = np.append(q[:, : 3 * len(linkage.bodies)], np.zeros((len(q), 3)), axis=1)
    return place_of(every, linkage.body_index[body], linkage.frames.arm(body, at))


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


def place_of(q: Array, body: int, point: Point) -> ComplexArray:
    """Places (n,) of a point relative to the mass centre, as complex numbers (m)."""
    turn = np.exp(1j * q[:, 3 * body + 2])
    return np.asarray(q[:, 3 * body] + 1j * q[:, 3 * body + 1] + turn * complex(*point))


def _rigid_places(mechanism: Mechanism, q: Array) -> list[ComplexArray]:
    """Places of the points and mass centres of rigid bodies, and of the points at rest."""
    made = [place_of(q, body, p) for _, body, points in _points(mechanism) for p in [*points.values(), (0.0, 0.0)]]
    return [*made, *(np.array([complex(*place)]) for place in mechanism.file.ground.points_m.values())]


def _size(mechanism: Mechanism, q: Array) -> float:
    """Largest extent of the bodies and the points at rest (m)."""
    places = np.array([place[0] for place in _rigid_places(mechanism, q)])
    return float(max(np.ptp(places.real), np.ptp(places.imag))) if len(places) else 1.0


def _couplings(axes: Any, mechanism: Mechanism, q: Array, size: float, alpha: float) -> None:
    """Springs as zigzags, rods of constant length as thin lines, slots and guides as dashed ones."""
    for part, one, other in coupled(mechanism, q):
        line = np.array([one[0], other[0]])
        if isinstance(part, Spring):
            line = _coil(one[0], other[0], COIL_WIDTH * size)
        axes.plot(line.real, line.imag, color=GREY, lw=1.1, alpha=alpha, zorder=1.5)
    for joint in mechanism.linkage.joints:
        if isinstance(joint, (Slot, Prismatic)):
            reach = (joint.origin[0] + joint.direction[0], joint.origin[1] + joint.direction[1])
            ends = ((joint.line, joint.origin), (joint.body, joint.point), (joint.line, reach))
            origin, point, beyond = (_seen(mechanism, q, *end)[0] for end in ends)
            along = (beyond - origin) / abs(beyond - origin)
            places = [0.0, float(((point - origin) * along.conjugate()).real)]
            line = origin + np.array([min(places) - 0.15 * size, max(places) + 0.15 * size]) * along
            axes.plot(line.real, line.imag, color=GREY, lw=1.0, dashes=(6, 4), alpha=alpha, zorder=1)
            if joint.line == GROUND:
                axes.plot(point.real, point.imag, "s", ms=9, mfc="none", color=GREY, alpha=alpha)


def _coil(a: complex, b: complex, half: float) -> ComplexArray:
    """Points of a zigzag from a to b."""
    if a == b:
        return np.array([a, b])
    where = np.concatenate([[0.0, 0.15], 0.15 + 0.7 * (np.arange(2 * COILS) + 0.5) / (2 * COILS), [0.85, 1.0]])
    side = np.concatenate([[0.0, 0.0], np.tile([1.0, -1.0], COILS), [0.0, 0.0]])
    return np.asarray(a + (where + 1j * side * half / abs(b - a)) * (b - a))


def _name(axes: Any, text: str, place: complex, colour: str, weight: str = "normal") -> None:
    from matplotlib.patheffects import withStroke

    halo = [withStroke(linewidth=2.5, foreground="white")]
    offset = (8.0, -6.0) if weight == "bold" else (5.0, 5.0)
    low, high = axes.get_xlim()
    room = 72.0 * axes.bbox.width / axes.figure.dpi * (high - place.real) / (high - low)  # points to the frame's end
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
    axes.annotate(text, (place.real, place.imag), xytext=offset, textcoords="offset points", **look)


def _point_names(axes: Any, mechanism: Mechanism, q: Array) -> None:
    """Names of the bodies' points, one for those that meet in a joint and have the same name."""
    near = 1e-3 * max(_size(mechanism, q), 1e-12)
    labelled = [(name, complex(*place)) for name, place in mechanism.file.ground.points_m.items()]
    for _, body, points in _points(mechanism):
        for name, point in points.items():
            place = complex(place_of(q, body, point)[0])
            if not any(name == other and abs(place - there) < near for other, there in labelled):
                labelled.append((name, place))
                _name(axes, name, place, "#374151")
