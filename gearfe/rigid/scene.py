"""The planar scene as one element of the contract: every planar body, joint and force, evaluated on whole arrays."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..errors import InputError
from .contract import Array, Element
from .planar import Scene, Spring
from .tables import Assembly, assemble


class PlanarScene(Element):
    """Planar bodies with their joints and forces; the coordinates are (x, y, theta) of every mass centre.

    Parameters
    ----------
    scene : Scene
        What the mechanism consists of.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.name = "planar scene"
        self.assembly: Assembly = assemble(scene)
        self.size = 3 * len(scene.bodies)
        self.rows = len(self.assembly.row_label)
        self.row_names = self.assembly.row_label
        self.breaks = self.assembly.breaks
        # springs come first among the forces, in the order of the scene
        springs = [force for force in scene.forces if isinstance(force, Spring)]
        self._springs = [f"spring {force.name or number!r}" for number, force in enumerate(springs, start=1)]
        self._index = self.assembly.tables.rows.ints
        self._value = self.assembly.tables.rows.reals

    def mass(self) -> Array:
        """Diagonal of masses and inertias."""
        return np.diag([m for b in self.scene.bodies for m in (b.mass, b.mass, b.inertia)])

    def start(self) -> tuple[Array, Array]:
        """Start state of the mass centres."""
        return self.assembly.start_q, self.assembly.start_v

    def units(self) -> tuple[Array, Array]:
        """The mechanism's length where a coordinate or a row is a length, 1 where it is an angle."""
        length = self.assembly.length
        return np.tile([length, length, 1.0], self.size // 3), np.where(self.holds_points, length, 1.0)

    @cached_property
    def holds_points(self) -> np.ndarray:
        """Whether each row holds points (m) rather than an angle (rad)."""
        return np.asarray(self._value[:, [0, 1, 3, 4, 5, 6, 8, 9, 10, 11]].any(axis=1))

    # constraints ------------------------------------------------------------------------------------------------
    @cached_property
    def _columns(self) -> np.ndarray:
        """Coordinate numbers (rows, 2, 3) of both bodies; the ground's stand one past the end."""
        return 3 * self._index[:, :2, None] + np.arange(3)

    @cached_property
    def _functions(self) -> list:
        """Time functions in the order of the tables, as evaluators."""
        return [_evaluator(self.assembly.tables.times, k) for k in range(len(self.assembly.tables.times.first) - 1)]

    def _times(self, t: float, derivative: int) -> Array:
        out = np.zeros(self.rows)
        for r in np.flatnonzero(self._index[:, 3] >= 0):
            out[r] = self._functions[self._index[r, 3]](t, derivative)
        return out

    def residual(self, t: float, q: Array) -> Array:
        """Values of all rows."""
        p = _pose(q)
        x, y, th, c, s = (p[k][self._index[:, :2]] for k in range(5))
        f = self._value[:, :10].reshape(-1, 2, 5)
        g = (f[:, :, 0] * x + f[:, :, 1] * y + f[:, :, 2] * th + f[:, :, 3] * c + f[:, :, 4] * s).sum(axis=1)
        for r in self.assembly.tables.rows.lines:
            n, d, _ = _line(self._value[r], p, self._index[r])
            g[r] += n @ d
        return g + self._value[:, 14] - self._times(t, 0)

    def jacobian(self, t: float, q: Array) -> Array:  # noqa: ARG002
        """G of all rows."""
        return self._spread(self.gradients(q))

    def rate(self, t: float, q: Array) -> Array:  # noqa: ARG002
        """Minus the rates of the prescribed motions."""
        return -self._times(t, 1)

    def velocity_terms(self, t: float, q: Array, v: Array) -> Array:
        """(dG/dt) v minus the second derivatives of the prescribed motions."""
        p, w = _pose(q), np.append(v, np.zeros(3))[2::3]
        c, s = p[3][self._index[:, :2]], p[4][self._index[:, :2]]
        f = self._value[:, :10].reshape(-1, 2, 5)
        turn = w[self._index[:, :2]] ** 2
        out = -(turn * (f[:, :, 3] * c + f[:, :, 4] * s)).sum(axis=1)
        full = np.append(v, np.zeros(3)).reshape(-1, 3)
        for r in self.assembly.tables.rows.lines:
            a, b = self._index[r, :2]
            n, d, arm = _line(self._value[r], p, self._index[r])
            spin_a, spin_b = w[a], w[b]
            du = full[b, :2] - full[a, :2] + spin_b * np.array([-arm[1], arm[0]])
            dn = spin_a * np.array([-n[1], n[0]])
            out[r] += -(spin_a**2) * (n @ d) + 2 * (dn @ du) - spin_b**2 * (n @ arm)
        return out - self._times(t, 2)

    def gradients(self, q: Array) -> Array:
        """Gradients (rows, 2, 3) with respect to the poses of both bodies."""
        p = _pose(q)
        c, s = p[3][self._index[:, :2]], p[4][self._index[:, :2]]
        f = self._value[:, :10].reshape(-1, 2, 5)
        out = f[:, :, :3].copy()
        out[:, :, 2] += f[:, :, 4] * c - f[:, :, 3] * s
        for r in self.assembly.tables.rows.lines:
            n, d, arm = _line(self._value[r], p, self._index[r])
            out[r, 0] = -n[0], -n[1], n[0] * d[1] - n[1] * d[0]
            out[r, 1] = n[0], n[1], n[1] * arm[0] - n[0] * arm[1]
        return out

    def curvature(self, q: Array, multipliers: Array) -> Array:
        """d(G^T lambda)/dq at fixed lambda: the geometric stiffness of the joints, (size, size)."""
        p = _pose(q)
        f = self._value[:, :10].reshape(-1, 2, 5)
        c, s = p[3][self._index[:, :2]], p[4][self._index[:, :2]]
        full = np.zeros((self.size + 3, self.size + 3))
        theta = 3 * self._index[:, :2] + 2
        np.add.at(full, (theta, theta), -multipliers[:, None] * (f[:, :, 3] * c + f[:, :, 4] * s))
        for r in self.assembly.tables.rows.lines:
            a, b = 3 * self._index[r, :2]
            n, d, arm = _line(self._value[r], p, self._index[r])
            side = np.array([-n[1], n[0]]) * multipliers[r]
            full[a : a + 2, a + 2] -= side
            full[a + 2, a : a + 2] -= side
            full[b : b + 2, a + 2] += side
            full[a + 2, b : b + 2] += side
            cross = side @ np.array([-arm[1], arm[0]])
            full[a + 2, b + 2] += cross
            full[b + 2, a + 2] += cross
            full[a + 2, a + 2] -= multipliers[r] * (n @ d)
            full[b + 2, b + 2] -= multipliers[r] * (n @ arm)
        return full[: self.size, : self.size]

    def _spread(self, gradients: Array) -> Array:
        full = np.zeros((self.rows, self.size + 3))
        np.add.at(full, (np.arange(self.rows)[:, None, None], self._columns), gradients)
        return full[:, : self.size]

    # forces -----------------------------------------------------------------------------------------------------
    def force(self, t: float, q: Array, v: Array) -> Array:
        """All applied forces on the scene."""
        return self._forces(t, q, v)[0]

    def force_jacobian(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Derivatives of the forces: springs in closed form."""
        n = self.size
        by_q, by_v = np.zeros((n + 3, n + 3)), np.zeros((n + 3, n + 3))
        forces = self.assembly.tables.forces
        p = _pose(q)
        full = np.append(v, np.zeros(3)).reshape(-1, 3)
        for number, (index, value) in enumerate(zip(forces.ints, forces.reals, strict=True)):
            a, b = int(index[1]), int(index[2])
            if index[0] == 0:
                arms = _arms(p, index, value)
                span, length, unit, speed = self._span(p, full, number, arms)
                k, damping = value[4:6]
                where = np.r_[3 * a : 3 * a + 3, 3 * b : 3 * b + 3]
                J = np.zeros((2, 6))  # d(span)/d(poses)
                J[:, :2], J[:, 3:5] = -np.eye(2), np.eye(2)
                J[:, 2], J[:, 5] = (arms[0][1], -arms[0][0]), (-arms[1][1], arms[1][0])
                pull = _pull(value, length, float(unit @ speed))
                across = np.eye(2) - np.outer(unit, unit)
                turned = speed @ across / length if damping else np.zeros(2)
                w = full[[a, b], 2]
                Jt = np.zeros((2, 6))  # d(span velocity)/d(poses)
                Jt[:, 2], Jt[:, 5] = w[0] * arms[0], -w[1] * arms[1]
                dt_q = k * unit @ J + damping * (turned @ J + unit @ Jt)
                local = -J.T @ (np.outer(unit, dt_q) + pull * across @ J)
                push = pull * span
                local[2, 2] -= push @ arms[0]
                local[5, 5] += push @ arms[1]
                by_q[np.ix_(where, where)] += local
                by_v[np.ix_(where, where)] -= damping * np.outer(J.T @ unit, unit @ J)
            elif index[0] == 1:
                for matrix, factor in ((by_q, value[0]), (by_v, value[1])):
                    matrix[a, a] -= factor
                    matrix[b, b] -= factor
                    matrix[a, b] += factor
                    matrix[b, a] += factor
            elif index[0] == 2:
                push = np.array([self._functions[index[3]](t, 0), self._functions[index[4]](t, 0)])
                by_q[3 * a + 2, 3 * a + 2] -= push @ _turned(p, a, value[:2])
        return by_q[:n, :n], by_v[:n, :n]

    def power(self, t: float, q: Array, v: Array) -> float:
        """Power of applied moments and point forces less the loss in dampers (W)."""
        return self._forces(t, q, v)[1]

    def potential(self, q: Array) -> float:
        """Energy of gravity (datum x = y = 0) and of all springs (J)."""
        forces = self.assembly.tables.forces
        p = _pose(q)
        flat = np.append(q, np.zeros(3))
        energy = -float(forces.weight @ flat)
        for number, (index, value) in enumerate(zip(forces.ints, forces.reals, strict=True)):
            if index[0] == 0:
                _, length, _, _ = self._span(p, None, number, _arms(p, index, value))
                energy += 0.5 * value[4] * (length - value[6]) ** 2
            elif index[0] == 1:
                energy += 0.5 * value[0] * (flat[index[1]] - flat[index[2]] - value[2]) ** 2
        return energy

    def _forces(self, t: float, q: Array, v: Array) -> tuple[Array, float]:
        forces = self.assembly.tables.forces
        F = forces.weight.copy()
        p = _pose(q)
        flat_q, flat = np.append(q, np.zeros(3)), np.append(v, np.zeros(3))
        full = flat.reshape(-1, 3)
        power = 0.0
        for number, (index, value) in enumerate(zip(forces.ints, forces.reals, strict=True)):
            a, b = int(index[1]), int(index[2])
            if index[0] == 0:
                arms = _arms(p, index, value)
                span, length, unit, speed = self._span(p, full, number, arms)
                rate = float(unit @ speed)
                push = _pull(value, length, rate) * span
                power -= value[5] * rate * rate
                for body, sign, arm in ((a, 1.0, arms[0]), (b, -1.0, arms[1])):
                    F[3 * body : 3 * body + 2] += sign * push
                    F[3 * body + 2] += sign * (arm[0] * push[1] - arm[1] * push[0])
            elif index[0] == 1:
                rate = flat[a] - flat[b]
                loss = -value[1] * rate
                push = -value[0] * (flat_q[a] - flat_q[b] - value[2]) + loss
                power += loss * rate
                F[a] += push
                F[b] -= push
            elif index[0] == 2:
                push = np.array([self._functions[index[3]](t, 0), self._functions[index[4]](t, 0)])
                arm = _turned(p, a, value[:2])
                F[3 * a : 3 * a + 2] += push
                F[3 * a + 2] += arm[0] * push[1] - arm[1] * push[0]
                power += float(push @ (full[a, :2] + full[a, 2] * np.array([-arm[1], arm[0]])))
            else:
                moment = float(self._functions[index[3]](t, 0))
                F[3 * a + 2] += moment
                F[3 * b + 2] -= moment
                power += moment * (full[a, 2] - full[b, 2])
        return F[: self.size], power

    def _span(self, p, full, number, arms):  # type: ignore[no-untyped-def]
        """Span of a spring from its first to its second point, its length, direction and (with `full`) velocity."""
        index, value = self.assembly.tables.forces.ints[number], self.assembly.tables.forces.reals[number]
        a, b = index[1], index[2]
        span = np.array([p[0][b] - p[0][a], p[1][b] - p[1][a]]) + arms[1] - arms[0]
        length = float(np.hypot(*span))
        if length == 0.0 and (value[5] > 0.0 or value[6] > 0.0):
            problem = "joins two points that coincide, so its force has no direction"
            cure = "move its points apart, or give it neither a free length nor damping"
            raise InputError(self._springs[number], None, problem, cure)
        speed = None
        if full is not None:
            turn = [w * np.array([-r[1], r[0]]) for w, r in zip(full[[a, b], 2], arms, strict=True)]
            speed = full[b, :2] - full[a, :2] + turn[1] - turn[0]
        return span, length, span / length if length > 0.0 else np.zeros(2), speed


def _pull(value: Array, length: float, rate: float) -> float:
    """Tension of a spring over its length (N/m): the stiffness itself where it has neither free length nor damping."""
    pull = float(value[4])
    if value[6] > 0.0:
        pull -= float(value[4] * value[6]) / length
    if value[5] > 0.0:
        pull += float(value[5]) * rate / length
    return pull


def _evaluator(times, k):  # type: ignore[no-untyped-def]
    from .timefunctions import TimeFunction

    pieces = slice(times.first[k], times.first[k + 1])
    sines = slice(times.sine_first[k], times.sine_first[k + 1])
    return TimeFunction(
        tuple(times.start[pieces]),
        tuple(times.origin[pieces]),
        tuple(tuple(row) for row in times.factor[pieces]),
        tuple(tuple(row) for row in times.sine[sines]),
    )


def _pose(q: Array) -> tuple[Array, ...]:
    """x, y, theta, cos, sin of every body and of the ground."""
    full = np.append(q, np.zeros(3)).reshape(-1, 3)
    return full[:, 0], full[:, 1], full[:, 2], np.cos(full[:, 2]), np.sin(full[:, 2])


def _turned(p, body, arm):  # type: ignore[no-untyped-def]
    c, s = p[3][body], p[4][body]
    return np.array([c * arm[0] - s * arm[1], s * arm[0] + c * arm[1]])


def _line(value, p, index):  # type: ignore[no-untyped-def]
    """Normal, distance vector and arm of a moving line."""
    a, b = index[0], index[1]
    n = _turned(p, a, value[10:12])
    arm = _turned(p, b, value[12:14])
    return n, np.array([p[0][b] - p[0][a], p[1][b] - p[1][a]]) + arm, arm


def _arms(p, index, value):  # type: ignore[no-untyped-def]
    return _turned(p, index[1], value[0:2]), _turned(p, index[2], value[2:4])
