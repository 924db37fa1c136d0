r"""Misalignment of the gears in mesh under the steady torques: what shafts, bearings and housing yield.

With the mean stiffness of the meshes the train solves :math:`K q = f`, f the torques that it carries in the end, on the
flanks that statics press. It is at rest. Planetary stages also have the centrifugal forces of the planets at the speed
in the end. Gears are rigid discs: their tilts :math:`\theta_1` of the driver and :math:`\theta_2` of the driven gear
are those of the sections at the middles of their faces. With the axis a and n the direction of the force on the driven
gear,

.. math::
    \gamma = (\theta_1 - \theta_2)\cdot(a\times n), \qquad \gamma_\perp = (\theta_1 - \theta_2)\cdot n

are the tilt in the plane of action and the one across it. The first is > 0 where it closes the gap towards larger y,
the second where the driven gear moves to the left of n towards larger y. Over the common face width b,
:math:`f_{sh} = b\,\gamma` is the misalignment by deformation of ISO 6336-1; that of ISO counts its amount.

A gear's motion has three parts. That of the *housing* is the motion of the straight line through the bores of its
shaft. That of the *bearings* is the motion of the line through the displacements of the shaft against the bores. That
of the *shafts* is the remainder: bending. On a shaft in one bore the lines have the tilts there.

**Loads that vary along the face width** tilt the gears further. Contact at given tilts
:math:`t = (\gamma, \gamma_\perp)` stores the energy :math:`V(t)`. Its moments about the middle of the common width are
:math:`M = \partial V/\partial t`. They act on the driven gear, and with the opposite sign on the driver. With R the
rows of t in q the train is at rest where

.. math::
    t = R\,K^{-1}(f - R^T M(t)) .

The compliance :math:`R K^{-1} R^T` is positive semi-definite and V convex, so there is one solution.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array
from .bearings import shaft_motion
from .checks import overlap
from .model import TrainModel, bore_selector
from .operating import operating_point

#: Squares of frequencies, and loads of modes without any, below this part of the largest are round-off.
ROUND_OFF = 1e-10
#: What yields, in the order of the parts of a misalignment.
PARTS = ("shafts", "bearings", "housing")


@dataclass(frozen=True)
class MeshMisalignment:
    """Misalignment of two gears in mesh, all of it and its parts by shafts, bearings and housing.

    Attributes
    ----------
    mesh, driver, driven
        Names.
    force
        Along the line of action (N), < 0 on the back flanks.
    width
        Common face width b (m).
    in_plane, across
        Tilts in the plane of action and across it (rad).
    apart
        How far the gears' centres move apart along the line of action (m): a part of the transmission error.
    in_plane_parts, across_parts, apart_parts : three numbers
        Of them, by shafts, bearings and housing.
    driver_tilt, driven_tilt : three numbers
        Tilts of the gears about x, y and z (rad), without their rotation about the axis.
    """

    mesh: str
    driver: str
    driven: str
    force: float
    width: float
    in_plane: float
    across: float
    apart: float
    in_plane_parts: tuple[float, ...]
    across_parts: tuple[float, ...]
    apart_parts: tuple[float, ...]
    driver_tilt: tuple[float, ...]
    driven_tilt: tuple[float, ...]

    @property
    def f_sh(self) -> float:
        """Misalignment in the plane of action over the common face width (m), ISO 6336-1."""
        return self.in_plane * self.width


def misalignments(model: TrainModel) -> tuple[MeshMisalignment, ...]:
    """Misalignment of each mesh under the steady torques; none where a part of the train moves freely under them."""
    q = static_state(model)
    if q is None:
        return ()
    return tuple(
        _misalignment(model, q, number, force) for number, force in enumerate(model.kinematics.steady_forces.tolist())
    )


def _misalignment(model: TrainModel, q: Array, number: int, force: float) -> MeshMisalignment:
    """Misalignment of one mesh with its force (N) in the state q."""
    train, line = model.train, model.meshes[number]
    driver, driven = train.gear(line.given.driver), train.gear(line.given.driven)
    a, n, axial = train.frame[2], pressed_direction(model, number), line.axial * math.copysign(1.0, force)
    moves = [gear_motion(model, q, gear.name) for gear in (driver, driven)]
    between = moves[0] - moves[1]  # (parts, 6)
    in_plane, across, apart = between[:, 3:] @ np.cross(a, n), between[:, 3:] @ n, -between[:, :3] @ (n + axial * a)
    turns = [move[:, 3:].sum(axis=0) for move in moves]
    tilts = [turn - (turn @ a) * a for turn in turns]
    return MeshMisalignment(
        mesh=line.name,
        driver=driver.name,
        driven=driven.name,
        force=force,
        width=overlap(driver, driven),
        in_plane=float(in_plane.sum()),
        across=float(across.sum()),
        apart=float(apart.sum()),
        in_plane_parts=tuple(in_plane.tolist()),
        across_parts=tuple(across.tolist()),
        apart_parts=tuple(apart.tolist()),
        driver_tilt=tuple(tilts[0].tolist()),
        driven_tilt=tuple(tilts[1].tolist()),
    )


def pressed_direction(model: TrainModel, number: int) -> Array:
    """Direction (3,) of the force of a mesh on its driven gear, on the flanks that the steady torques press."""
    train, line = model.train, model.meshes[number]
    n, a = line.direction, train.frame[2]
    if model.kinematics.steady_forces[number] >= 0.0:
        return n
    # the line of action of the back flanks is the mirror image at the line of centres
    driver, driven = (train.shaft(train.gear(name).shaft) for name in (line.given.driver, line.given.driven))
    along = np.cross(a, np.array(driven.point) - np.array(driver.point))
    along = along / np.linalg.norm(along)
    return np.asarray(n - 2.0 * (n @ along) * along)


@dataclass(frozen=True)
class Tilts:
    """Tilts of a mesh at rest.

    Attributes
    ----------
    tilts : ndarray, shape (2,)
        In the plane of action and across it (rad).
    compliance : ndarray, shape (2, 2)
        How far they fall with the moments of the contact (rad/(N m)).
    """

    tilts: Array
    compliance: Array


@dataclass(frozen=True, eq=False)
class TiltingTrain:
    """A train at rest under multiples of its steady torques and the moments that tilt the gears of one mesh.

    Parameters
    ----------
    model : TrainModel
        The train; `GearMesh.moments` of the mesh lets the shafts keep the static deflections by those moments.
    number : int
        Of the mesh.
    """

    model: TrainModel
    number: int

    @cached_property
    def rows(self) -> Array:
        """Tilts in the plane of action and across it for unit coordinates of the system, shape (2, size)."""
        model, placed = self.model, self.model.placed
        train, line = model.train, model.meshes[self.number]
        n = pressed_direction(model, self.number)
        between = np.zeros((3, placed.size))
        for sign, name in ((1.0, line.given.driver), (-1.0, line.given.driven)):
            gear = train.gear(name)
            shaft = train.shaft_number(gear.shaft)
            turns = train.frame.T @ placed.bodies[shaft].turn_rows(gear.along)
            between += sign * placed.whole(shaft, turns)
        return np.stack([np.cross(train.frame[2], n) @ between, n @ between])

    @cached_property
    def torques(self) -> Array:
        """Torques on both gears of the mesh against which it carries one newton, on coordinates of the system, (size,).

        Torques further along the train differ from these by what other meshes carry.
        """
        model, placed = self.model, self.model.placed
        line = model.meshes[self.number]
        torques = np.zeros(placed.size)
        for name in (line.given.driver, line.given.driven):
            gear = model.train.gear(name)
            shaft = model.train.shaft_number(gear.shaft)
            turn = placed.whole(shaft, placed.bodies[shaft].turn_rows(gear.along)[2])
            torques += math.copysign(gear.gear.base_radius, float(line.row @ turn)) * turn
        return torques

    def at(self, factor: float, moments: Array, force: float = 0.0) -> Tilts:
        """Return the tilts under `factor` times the steady torques and moments on the mesh.

        Parameters
        ----------
        factor : float
            Of the steady torques.
        moments : ndarray, shape (2,)
            In the plane of action and across it (N m).
        force : float
            What the mesh carries besides (N), by torques on its own two gears.

        Raises
        ------
        InputError
            For a train that moves freely under its torques, and rolling bearings that cannot carry the load.
        """
        model, operating = self.model, self.model.operating
        T, stiffness = model.modal.T, self._stiffness
        outer = model.outer_push
        push = (
            factor * (_steady_push(model) - outer)
            + outer
            + _thrown(model)
            + force * self.torques
            - self.rows.T @ moments
        )
        if operating.bearings:
            # dampers on shafts in turning frames add a skew part, which has no energy; `checks` refuses rolling
            # bearings on such shafts
            even = 0.5 * (stiffness + stiffness.T)
            point = operating_point(operating.geometry, self._motions, even, T, push)
            q = point.coordinates
            for name, state in point.bearings.items():
                stiffness = stiffness + self._motions[name].T @ state.stiffness @ self._motions[name]
        solved = _solved(T.T @ stiffness @ T, T.T @ np.column_stack([push, self.rows.T]))
        if solved is None:
            problem = "moves freely under the steady torques, so nothing says how far they tilt its gears"
            raise InputError("train", None, problem, "hold every shaft by bearings, and drive the train")
        if not operating.bearings:
            q = T @ solved[:, 0]
        return Tilts(self.rows @ q, self.rows @ T @ solved[:, 1:])

    @cached_property
    def _motions(self) -> dict[str, Array]:
        """Bore -> motion of the shaft against it, of rolling bearings."""
        return {name: shaft_motion(self.model.train, self.model.placed, name) for name in self.model.operating.bearings}

    @cached_property
    def _stiffness(self) -> Array:
        """Of all parts but rolling bearings, held where the train is driven, shape (size, size)."""
        model = self.model
        stiffness = model.system.stiffness + _changed(model)
        for name, state in model.operating.bearings.items():
            stiffness = stiffness - self._motions[name].T @ state.stiffness @ self._motions[name]
        return stiffness + _held(model)


def _held(model: TrainModel) -> Array:
    """Stiffness (size, size) that holds a train which a torque drives where it is driven, whatever the torque there."""
    row, largest = model.drive_row, float(model.modal.eigenvalues.max(initial=0.0))
    if model.train.driven.torque is None:
        return np.zeros((len(row), len(row)))
    seen = model.modal.T.T @ row
    return np.asarray(largest / float(seen @ seen) * np.outer(row, row))


def _changed(model: TrainModel) -> Array:
    """What the stiffness (size, size) of the running train has more than that of its system."""
    speed, turning = model.steady_speed, model.turning
    return np.asarray(model.back_flanks - speed**2 * turning.stiffening - speed * turning.circulating)


def _thrown(model: TrainModel) -> Array:
    """Centrifugal forces (size,) of planets at the speed in the end."""
    return np.asarray(model.steady_speed**2 * model.turning.thrown)


def _steady_push(model: TrainModel) -> Array:
    """Force of the torques at their end on the coordinates of the system, shape (size,)."""
    push = np.zeros(model.system.size)
    for direction, torque in model.torques:
        push += direction * float(replace(torque, sines=())(model.torque_end))
    return push


def _solved(K: Array, forces: Array) -> Array | None:
    """Solutions y of K y = forces (n, k) that move nothing freely; None where the first of these does."""
    squares, shapes = np.linalg.eigh(0.5 * (K + K.T))  # what dampers in frames that turn add to K is skew
    pushed = shapes.T @ forces
    free = squares <= ROUND_OFF * max(float(squares.max(initial=0.0)), 1e-300)
    if np.abs(pushed[free, 0]).max(initial=0.0) > ROUND_OFF * float(np.abs(pushed[:, 0]).max(initial=0.0)):
        return None
    held = shapes[:, ~free]
    return np.asarray(held @ np.linalg.solve(held.T @ K @ held, pushed[~free]))


def static_state(model: TrainModel) -> Array | None:
    """Coordinates of the system (size,) under the steady torques; None where these move it freely.

    With rolling bearings they are those of the operating point: their stiffness there does not hold from no load on.
    """
    if model.operating.bearings:
        return model.operating.coordinates
    modal = model.modal
    changed = _changed(model) + _held(model)
    push = modal.constant + modal.T.T @ (model.preload + _steady_push(model) + _thrown(model) - changed @ modal.origin)
    y = _solved(np.diag(modal.eigenvalues) + modal.T.T @ changed @ modal.T, push[:, None])
    return None if y is None else np.asarray(modal.origin + modal.T @ y[:, 0])


def static_mesh_forces(model: TrainModel, q: Array) -> Array:
    """Return the force of each mesh (N) under the steady torques, < 0 on the back flanks, shape (meshes,).

    Errors of pins and springs of different stiffness divide the torque unevenly among planets; the forces of
    `TrainKinematics.steady_forces` are those of equal shares.

    Parameters
    ----------
    model : TrainModel
        A train with springs as meshes.
    q : ndarray, shape (size,)
        What `static_state` returned.
    """
    steady = model.kinematics.steady_forces.tolist()
    return np.array(
        [
            -line.mean * float(line.columns[1] @ q) if force < 0.0 else line.mean * float(line.row @ q)
            for line, force in zip(model.meshes, steady, strict=True)
        ]
    )


def static_bearing_loads(model: TrainModel, q: Array) -> dict[str, Array]:
    """Return bore -> force (N) and moment (N m) of its shaft on it along x, y, z (6,), under the steady torques.

    Parameters
    ----------
    model : TrainModel
        The train.
    q : ndarray, shape (size,)
        What `static_state` returned.
    """
    acting = model.preload + _steady_push(model) + _thrown(model) - _changed(model) @ q
    still = np.zeros((1, len(q)))
    found = model.bearings(q[None], still, still, acting[None], model.steady_speed)[0]
    loads = dict(zip(model.bores, found, strict=True))
    e1, e2, axis = model.train.frame
    for name, state in model.operating.bearings.items():  # not linear from no load on
        loads[name] = np.concatenate(
            [np.array([e1, axis, e2]).T @ state.load[:3], np.array([e1, e2]).T @ state.load[3:]]
        )
    return loads


def gear_motion(model: TrainModel, q: Array, name: str) -> Array:
    """Displacement and rotation of a gear along x, y, z by its shaft, its bearings and the housing, (3, 6).

    Parameters
    ----------
    model : TrainModel
        The train.
    q : ndarray, shape (size,)
        Coordinates of the system.
    name : str
        Name of the gear.
    """
    train, frame = model.train, model.train.frame
    gear = train.gear(name)
    number = train.shaft_number(gear.shaft)
    shaft, body = train.shafts[number], model.shafts[number]
    own = q[model.first[number] : model.first[number] + body.size]
    base = np.array(shaft.point, dtype=float)

    def section(along: float) -> Array:
        point = base + (along - float(base @ frame[2])) * frame[2]
        turn = frame.T @ (body.turn_rows(along) @ own)
        return np.concatenate([body.point_rows(point, frame, along) @ own, turn])

    places = np.array([float(train.bore_points[bore] @ frame[2]) for bore in shaft.bores])
    if not shaft.bores:  # of a planet the pin counts as its bearing
        places = np.array([float(base @ frame[2])])
    at_bores = np.array([section(place) for place in places])
    bores = np.zeros_like(at_bores)
    if train.housing is not None:
        bores = np.array([bore_selector(train, bore).T @ q[: train.housing.size] for bore in shaft.bores])
    whole = section(gear.along)
    by_housing = _line(places, bores, gear.along, frame)
    by_bearings = _line(places, at_bores - bores, gear.along, frame)
    return np.array([whole - by_housing - by_bearings, by_bearings, by_housing])


def _line(places: Array, moves: Array, along: float, frame: Array) -> Array:
    """Motion at `along` of the straight line that follows displacements (and of one place rotations) best, (6,)."""
    axis = frame[2]
    if np.ptp(places) > 0.0:
        slope, start = np.polyfit(places - along, moves[:, :3], 1)
        return np.concatenate([start, np.cross(axis, slope - (slope @ axis) * axis)])
    mean = moves.mean(axis=0)
    tilt = mean[3:] - (mean[3:] @ axis) * axis
    return np.concatenate([mean[:3] + np.cross(tilt, axis) * (along - places[0]), tilt])
