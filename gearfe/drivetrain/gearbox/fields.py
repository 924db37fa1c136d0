r"""Fields of a gear train over time: the housing's vibration and the turning gears, as VTKHDF series and as pictures.

A gear has its centre c at rest, its displacement d, the rotation :math:`\varphi` about the axis a and the small tilt
:math:`\theta`. A point of the gear or its shaft at :math:`X_0` is then at

.. math:: X = c + d + (I + \theta\times)\, R(a, \varphi)\,(X_0 - c) .
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError, given
from ...base.progress import count
from ...base.typing import Array, ComplexArray, IntArray
from ...fem.reduction.modal_body import ModalBody
from ...gears.geometry.derived import gear_outline
from ...gears.geometry.spur_gear import Gear
from ...output.exchange.vtkhdf import VtkHdfSeries
from ..train.gear_train import GearTrain
from ..train.response import TrainResponse

#: Steps whose fields are in memory at a time.
_AT_ONCE = 25
#: Points round a shaft.
_ROUND = 32
#: Largest displacement of the housing in a picture, in parts of its size.
_SHOWN = 0.02


@dataclass(frozen=True, eq=False)
class Solid:
    """Surface of a body that moves with a gear, or with the cross-sections of an elastic shaft.

    Attributes
    ----------
    gear
        Number of the gear whose motion it follows, or of the first one on its shaft; -1 on a shaft without any.
    shaft
        Number of its shaft.
    points : (n, 3)
        At the start of the run (m).
    quads : (f, 4)
    triangles : (t, 3)
    section : (n,) or None
        Of an elastic shaft the number of the cross-section that each point belongs to.
    """

    gear: int
    shaft: int
    points: Array
    quads: IntArray
    triangles: IntArray
    section: IntArray | None = None


def gear_surface(gear: Gear, angle: float, *, per_segment: int = 3) -> tuple[Array, IntArray]:
    """Surface of a gear about its own axis (the third coordinate): points (4 k, 3) in m and quadrilaterals.

    Parameters
    ----------
    angle
        Where tooth 0 points (rad).
    per_segment
        Pieces of each of the profile's curves.
    """
    outline = 1e-3 * gear_outline(gear, angle, (0.0, 0.0), per_segment=per_segment)[:-1]
    inner = outline * (0.5 * gear.bore_diameter / np.linalg.norm(outline, axis=1, keepdims=True))
    k, half = len(outline), 0.5 * gear.face_width
    rings = [np.column_stack([ring, np.full(k, z)]) for z in (-half, half) for ring in (inner, outline)]
    here, after = np.arange(k), np.roll(np.arange(k), -1)
    # rings: 0 inner and 1 outer at the bottom, 2 inner and 3 outer at the top; each quad anticlockwise from outside
    sides = ((1, 0), (2, 3), (3, 1), (0, 2))
    quads = [np.column_stack([a * k + here, b * k + here, b * k + after, a * k + after]) for a, b in sides]
    return np.concatenate(rings), np.concatenate(quads)


def turned_surface(radii: Array, places: Array) -> tuple[Array, IntArray, IntArray]:
    """Surface of a turned part about the third axis with radii at rising places along it, closed at its ends.

    Points stand ring by ring, then come the middles of both ends; with them quadrilaterals, and triangles of the ends.
    """
    angle, rings = 2.0 * np.pi * np.arange(_ROUND) / _ROUND, len(radii)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    points = [np.column_stack([radius * circle, np.full(_ROUND, z)]) for radius, z in zip(radii, places, strict=True)]
    ends = [[0.0, 0.0, places[0]], [0.0, 0.0, places[-1]]]
    start, after = np.arange(_ROUND), np.roll(np.arange(_ROUND), -1)
    belt = np.column_stack([start, after, _ROUND + after, _ROUND + start])
    quads = np.concatenate([belt + _ROUND * ring for ring in range(rings - 1)])
    last = _ROUND * (rings - 1)
    bottom = np.column_stack([np.full(_ROUND, last + _ROUND), after, start])
    top = np.column_stack([np.full(_ROUND, last + _ROUND + 1), last + start, last + after])
    return np.concatenate([*points, ends]), quads, np.concatenate([bottom, top])


def solids(train: GearTrain, response: TrainResponse, *, per_segment: int = 2) -> tuple[Solid, ...]:
    """Surfaces of all gears and shafts, where they stand at the start."""
    frame = train.frame
    angles = train.kinematics.angles
    found = []
    carried: set[str] = set()
    for gear in train.gears:
        number, shaft = response.gear_names.index(gear.name), train.shaft_number(gear.shaft)
        points, quads = gear_surface(gear.gear, angles[gear.name], per_segment=per_segment)
        none = np.zeros((0, 3), dtype=np.int64)
        found.append(Solid(number, shaft, response.gear_centres[number] + points @ frame, quads, none))
        if gear.shaft not in carried:
            carried.add(gear.shaft)
            found.append(_shaft(train, shaft, number, response))
    found += [_shaft(train, i, -1, response) for i, s in enumerate(train.shafts) if s.name not in carried]
    return tuple(found)


def moved(solid: Solid, response: TrainResponse, frame: Array, step: int, exaggeration: float = 1.0) -> Array:
    """Return the points of a surface at an output step.

    Displacement and tilt are exaggerated, the turning is not.

    Parameters
    ----------
    solid : Solid
        The surface.
    response : TrainResponse
        The motion.
    frame : ndarray, shape (3, 3)
        Directions of the train, its axis last.
    step : int
        Number of the output step.
    exaggeration : float
        Factor on displacement and tilt.

    Returns
    -------
    points : ndarray, shape (n, 3)
        In m.
    """
    if solid.section is not None:
        return _moved_sections(solid.points, solid.section, response, frame, step, exaggeration)
    pose, centre = response.gear_pose[step, solid.gear], response.gear_centres[solid.gear]
    angle = float(pose[3:] @ frame[2])
    tilt = exaggeration * (pose[3:] - angle * frame[2])
    turned = _turned(solid.points - centre, frame[2], angle)
    return np.asarray(centre + exaggeration * pose[:3] + turned + np.cross(tilt, turned))


def _moved_sections(
    points: Array, section: IntArray, response: TrainResponse, frame: Array, step: int, exaggeration: float
) -> Array:
    """Points (n, 3) of an elastic shaft at an output step: each moves with its cross-section, `section` (n,)."""
    sections, coordinates = given(response.sections, "sections"), given(response.section_coordinates, "coordinates")
    poses, axis, at_step = sections.rows @ coordinates[step], frame[2], np.empty_like(points)
    for number in np.unique(section):
        mine, centre, pose = section == number, sections.centres[number], poses[number]
        spin = float(pose[3:] @ axis)
        turned = _turned(
            points[mine] - centre, axis, float(sections.ratios[number] * response.drive_angle[step]) + spin
        )
        tilt = exaggeration * (pose[3:] - spin * axis)
        at_step[mine] = centre + exaggeration * pose[:3] + turned + np.cross(tilt, turned)
    return at_step


def _rolled(solid: Solid, train: GearTrain, response: TrainResponse, step: int) -> Array:
    """(n, 3) points of a surface at an output step, had all shafts only rolled with the drive: no vibration."""
    ratio, centre = float(train.kinematics.ratios[solid.shaft]), np.array(train.shafts[solid.shaft].point)
    return np.asarray(
        centre + _turned(solid.points - centre, train.frame[2], ratio * float(response.drive_angle[step]))
    )


def _turned(arm: Array, axis: Array, angle: float) -> Array:
    """(n, 3) vectors turned about a unit axis."""
    along = np.outer(arm @ axis, axis)
    return np.asarray(along + np.cos(angle) * (arm - along) + np.sin(angle) * np.cross(axis, arm))


def write_gears(path: Path, train: GearTrain, response: TrainResponse, steps: Sequence[int] | IntArray) -> None:
    """Write a VTKHDF series of the gears and shafts.

    It has places, displacement from the start and from rolling (m), and the number of the gear.

    Parameters
    ----------
    path : Path
        The file.
    train : GearTrain
        The train.
    response : TrainResponse
        Its motion.
    steps : sequence of int
        Numbers of the output steps.
    """
    parts, frame = solids(train, response), train.frame
    starts = np.cumsum([0, *(len(part.points) for part in parts)])
    cells = {
        "quad": np.concatenate([part.quads + s for part, s in zip(parts, starts, strict=False)]),
        "triangle": np.concatenate([part.triangles + s for part, s in zip(parts, starts, strict=False)]),
    }
    rest = np.concatenate([part.points for part in parts])
    number = np.repeat([part.gear + 1 for part in parts], np.diff(starts)).astype(np.uint8)
    with VtkHdfSeries(path) as series:
        for count, step in enumerate(steps):
            points = np.concatenate([moved(part, response, frame, int(step)) for part in parts])
            smooth = np.concatenate([_rolled(part, train, response, int(step)) for part in parts])
            moves = {"displacement_m": points - rest, "vibration_m": points - smooth}
            data = {"gear": number} | {name: values.astype(np.float32) for name, values in moves.items()}
            series.add(float(response.time[step]), points, None if count else cells, point_data=data)


def write_housing(
    path: Path,
    body: ModalBody,
    response: TrainResponse,
    steps: Sequence[int] | IntArray,
) -> None:
    """Write a VTKHDF series of the housing: displacement (m), acceleration along the outward normal (m/s2).

    Parameters
    ----------
    path : Path
        The file.
    body : ModalBody
        The reduced housing.
    response : TrainResponse
        The motion.
    steps : sequence of int
        Numbers of the output steps.
    """
    position, acceleration = _coordinates(response)
    chosen = np.asarray(steps, dtype=np.int64)
    with VtkHdfSeries(path) as series:
        for first in range(0, len(chosen), _AT_ONCE):
            some = chosen[first : first + _AT_ONCE]
            displacement = body.reconstruct(position[some]).astype(np.float32)
            normal = body.normal_component(acceleration[some]).astype(np.float32)
            for i, step in enumerate(some):
                start = first + i == 0
                data = {"displacement_m": displacement[i], "normal_acceleration_m_per_s2": normal[i]}
                series.add(
                    float(response.time[step]),
                    body.nodes if start else None,
                    body.cells if start else None,
                    point_data=data,
                )
            count(first + len(some), len(chosen), "fields")


def shown_factor(train: GearTrain, pose: ComplexArray, modal: ComplexArray | None) -> float:
    """Factor by which a vibration can be seen: its largest displacement is `_SHOWN` of the train's size.

    Parameters
    ----------
    train : GearTrain
        The train.
    pose : ndarray of complex, shape (gears, 6)
        Amplitudes of each gear's displacement (m) and rotation (rad).
    modal : ndarray of complex, shape (N,), optional
        Amplitudes of the housing's coordinates.
    """
    body, places = train.housing, [np.array([train.shaft(gear.shaft).point for gear in train.gears])]
    tips = np.array([gear.gear.tip_radius for gear in train.gears])
    moves, turns = np.linalg.norm(pose[:, :3], axis=1), np.linalg.norm(pose[:, 3:], axis=1)
    most = float((moves + tips * turns).max())
    if body is not None and body.has_mesh and modal is not None:
        most = max(most, float(np.hypot(*body.reconstruct(np.array([modal.real, modal.imag]))).max()))
        places.append(body.nodes)
    size = float(np.ptp(np.concatenate(places), axis=0).max()) + 2.0 * float(tips.max())
    return _SHOWN * size / most if most > 0.0 else 1.0


def frames(
    train: GearTrain, response: TrainResponse, steps: Sequence[int] | IntArray, *, exaggeration: float | None = None
) -> dict[str, NDArray[np.generic]]:
    """Return the arrays that `gearfe.figures.train_scene` draws: surfaces in m, and their colours.

    Parameters
    ----------
    train : GearTrain
        The train.
    response : TrainResponse
        Its motion.
    steps : sequence of int
        Numbers of the output steps.
    exaggeration
        Factor on displacement and tilt; by default such that the housing's largest one is seen.
    """
    body, chosen = train.housing, np.asarray(steps, dtype=np.int64)
    arrays: dict[str, NDArray[np.generic]] = {"time": response.time[chosen]}
    factor = 1.0 if exaggeration is None else exaggeration
    if body is not None and body.has_mesh:
        from ...fem.bodies.mesh_checks import boundary_faces

        faces = boundary_faces(body.elements)
        used, renumbered = np.unique(faces, return_inverse=True)
        rows = (3 * used[:, None] + np.arange(3)).ravel()
        shapes = np.asarray(body.shapes[rows])
        position, acceleration = _coordinates(response)
        shift = (position[chosen] @ shapes.T).reshape(len(chosen), -1, 3)
        if exaggeration is None:
            size, most = float(np.ptp(body.nodes, axis=0).max()), float(np.abs(shift).max(initial=0.0))
            factor = _rounded(_SHOWN * size / most) if most > 0.0 else 1.0
        normal = (acceleration[chosen] @ shapes.T).reshape(len(chosen), -1, 3)
        arrays |= {
            "housing_faces": renumbered.reshape(faces.shape),
            "housing_points": (body.nodes[used] + factor * shift).astype(np.float32),
            "housing_values": np.einsum("snk,nk->sn", normal, body.normals[used]).astype(np.float32),
        }
    parts, frame = solids(train, response, per_segment=4), train.frame
    smooth = [np.concatenate([_rolled(part, train, response, int(s)) for part in parts]) for s in chosen]
    true = [np.concatenate([moved(part, response, frame, int(s)) for part in parts]) for s in chosen]
    shown = [np.concatenate([moved(part, response, frame, int(s), factor) for part in parts]) for s in chosen]
    starts = np.cumsum([0, *(len(part.points) for part in parts)])
    arrays |= {
        "gear_quads": np.concatenate([part.quads + s for part, s in zip(parts, starts, strict=False)]),
        "gear_triangles": np.concatenate([part.triangles + s for part, s in zip(parts, starts, strict=False)]),
        "gear_points": np.array(shown, dtype=np.float32),
        "gear_values": np.array(
            [1e6 * np.linalg.norm(p - q, axis=1) for p, q in zip(true, smooth, strict=True)], dtype=np.float32
        ),
        "exaggeration": np.array(factor),
    }
    return arrays


def _coordinates(response: TrainResponse) -> tuple[Array, Array]:
    if response.modal is None or response.modal_acceleration is None:
        raise InputError("housing", None, "is rigid and has no field", "take an elastic housing")
    return response.modal, response.modal_acceleration


def _shaft(train: GearTrain, number: int, gear: int, response: TrainResponse) -> Solid:
    """Surface of a shaft that follows a gear, or its own cross-sections where it has some."""
    shaft, sections = train.shafts[number], response.sections
    mine = np.zeros(0, dtype=np.int64) if sections is None else np.flatnonzero(sections.shaft == number)
    if sections is None or not len(mine):
        half = 0.5 * shaft.length
        points, quads, triangles = turned_surface(np.full(2, shaft.radius), np.array([-half, half]))
        return Solid(gear, number, np.array(shaft.point) + points @ train.frame, quads, triangles)
    places = (sections.centres[mine] - np.array(shaft.point)) @ train.frame[2]
    points, quads, triangles = turned_surface(sections.radii[mine], places)
    belongs = np.concatenate([np.repeat(mine, _ROUND), mine[[0, -1]]])
    return Solid(gear, number, np.array(shaft.point) + points @ train.frame, quads, triangles, belongs)


def _rounded(factor: float) -> float:
    """Down to one digit."""
    power = 10.0 ** np.floor(np.log10(factor))
    return float(np.floor(factor / power) * power)
