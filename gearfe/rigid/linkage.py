"""Planar bodies with joints and forces as one element of the contract: all forms and vectors, on whole arrays.

With the vectors V = sum w (x, y) + R(theta) p of the tables, a product U . V has the gradient J_U^T V + J_V^T U, and
the generalised force of g on a vector is J_V^T g, where J_V = dV/dq holds w and the arms R p, a quarter turn ahead.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..errors import InputError
from ..typing import Array, IntArray
from .contract import Element
from .forces import Force
from .forms import Frames
from .joints import Joint
from .linkage_tape import write_linkage
from .planar import Body, add_at, body_numbers, turned, with_ground
from .tables import Assembly, assemble

if TYPE_CHECKING:
    from .tape import Tape


class Pose(NamedTuple):
    """Where all bodies and, last, the ground stand: shapes (n + 1,) and of vectors (v, 2) and (v, 2, 2)."""

    row: Array  # (n + 1, 5) x, y, theta, cos theta, sin theta
    vector: Array  # (v, 2)
    arm: Array  # (v, 2, 2) arms of both ends, in the ground's axes


class Rates(NamedTuple):
    """How fast they move."""

    row: Array  # (n + 1, 3)
    vector: Array  # (v, 2)
    spin: Array  # (v, 2) angular velocities of both ends


class Linkage(Element):
    """Planar bodies with their joints and forces; the coordinates are (x, y, theta) of every mass centre.

    Parameters
    ----------
    bodies, joints, forces
        What it consists of; joints and forces name bodies, or the ground.

    Raises
    ------
    InputError
        For names of bodies that are used twice or not there, and arguments that are not finite.
    """

    def __init__(
        self, bodies: tuple[Body, ...], joints: tuple[Joint, ...] = (), forces: tuple[Force, ...] = ()
    ) -> None:
        self.bodies, self.joints, self.forces = bodies, joints, forces
        self.frames = Frames(bodies, body_numbers(bodies, joints, forces))
        self.body_index = self.frames.number
        self.name = "linkage"
        self.assembly: Assembly = assemble(joints, forces, self.frames)
        self.size = 3 * len(bodies)
        self.rows = len(self.assembly.row_label)
        self.row_names = self.assembly.row_label
        self.breaks = self.assembly.breaks
        self._forms, self._vectors, self._forces = self.assembly.tables
        #: Constraints with a profile: row, which of its bodies, number of that, profile.
        self._profiles = [(r, k, int(self._forms.bodies[r, k]), p) for r, k, p in self.assembly.profiles]
        self._loaded = bool(len(self._forces.spring) or len(self._forces.along))
        self._lawful = np.isin(np.arange(len(self._forces.spring)), [i for i, _ in self.assembly.tension_laws])
        loads = [self.assembly.functions[k] if k >= 0 else None for k in self._forms.motion[self.rows :]]
        #: Values of constant loads; whether others, or dampers, give or take energy; whether joints prescribe motions.
        self._steady = np.array([float(f(0.0)) if f is not None and f.steady else 0.0 for f in loads])
        lossy = self._forces.spring[:, 1].any() or self._forces.along[:, 1].any()
        varying = self.assembly.state_loads or self.assembly.tension_laws
        self.powered = bool(lossy or varying) or any(f is not None and not f.steady for f in loads)
        self.driven = bool((self._forms.motion[: self.rows] >= 0).any())
        self._known: tuple[Array, Pose] | None = None

    def mass(self) -> Array:
        """Diagonal of masses and inertias."""
        return np.diag([m for b in self.bodies for m in (b.mass, b.mass, b.inertia)])

    def start(self) -> tuple[Array, Array]:
        """Start state of the mass centres."""
        return self.assembly.start_q, self.assembly.start_v

    def units(self) -> tuple[Array, Array]:
        """The mechanism's length where a coordinate or a row is a length, 1 where it is an angle."""
        length = self.assembly.length
        return np.tile([length, length, 1.0], self.size // 3), self._forms.unit

    @property
    def algebraic(self) -> bool:
        """Whether loads do not depend on the state, and no constraint has a profile."""
        return not (self.assembly.state_loads or self.assembly.tension_laws or self.assembly.profiles)

    @property
    def pieced(self) -> bool:
        """Whether loads have corners."""
        return bool(self.pieces(0.0, *self.start()))

    def pieces(self, t: float, q: Array, v: Array) -> tuple[int | None, ...]:
        """Numbers of the smooth pieces that loads and laws of springs are on."""
        found = [piece for _, load in self.assembly.state_loads for piece in load.pieces(t, q, v)]
        if self.assembly.tension_laws:
            pose = self.pose(q)
            rates = self._motion(pose, v)
            for i, law in self.assembly.tension_laws:
                span, speed = pose.vector[i], rates.vector[i]
                length = float(np.hypot(*span))
                found += law.pieces(t, length, float(span @ speed) / length if length > 0.0 else 0.0)
        return tuple(found)

    def write(self, tape: Tape, places: IntArray) -> bool:
        """The linkage on a tape, see `gearfe.rigid.contract`."""
        return write_linkage(self, tape, places)

    def pose(self, q: Array) -> Pose:
        """Bodies and vectors at the coordinates q; those of the last ones are remembered."""
        if self._known is None or not np.array_equal(self._known[0], q):
            self._known = q.copy(), self._pose(q)
        return self._known[1]

    def _pose(self, q: Array) -> Pose:
        full = with_ground(q)
        row = np.concatenate([full, np.cos(full[..., 2:]), np.sin(full[..., 2:])], axis=-1)
        ends, at = self._vectors.end, row[..., self._vectors.bodies, :]
        c, s = at[..., 3], at[..., 4]
        arm = np.stack([c * ends[:, :, 1] - s * ends[:, :, 2], s * ends[:, :, 1] + c * ends[:, :, 2]], axis=-1)
        return Pose(row, (ends[:, :, :1] * at[..., :2] + arm).sum(axis=-2), arm)

    def _motion(self, pose: Pose, v: Array) -> Rates:
        row = with_ground(v)
        at = row[..., self._vectors.bodies, :]
        spin = at[..., 2]
        ends = self._vectors.end[:, :, :1] * at[..., :2] + spin[..., None] * turned(pose.arm)
        return Rates(row, ends.sum(axis=-2), spin)

    def _vector_jacobian(self, pose: Pose) -> Array:
        """J_V = dV/d(x, y, theta) of both bodies, shape (..., v, 2 components, 2 bodies, 3)."""
        J = np.zeros((*pose.vector.shape, 2, 3))
        J[..., 0, :, 0] = J[..., 1, :, 1] = self._vectors.end[:, :, 0]
        J[..., 2] = np.swapaxes(turned(pose.arm), -1, -2)
        return J

    def _times(self, t: float | Array, derivative: int) -> Array:
        """Motions of the constraints."""
        out = np.zeros((*np.shape(t), self.rows))
        for r in np.flatnonzero(self._forms.motion[: self.rows] >= 0):
            out[..., r] = self.assembly.functions[self._forms.motion[r]](t, derivative)
        return out

    def _affine(self, pose: Pose, first: int = 0) -> Array:
        """Values of the affine parts of the forms from number `first` on."""
        at = pose.row[..., self._forms.bodies[first:], :]
        return np.einsum("rbk,...rbk->...r", self._forms.factor[first:], at) + self._forms.constant[first:]

    def _affine_gradients(self, pose: Pose) -> Array:
        """Gradients of the affine parts of all forms, shape (r, 2, 3)."""
        factor, at = self._forms.factor, pose.row[..., self._forms.bodies, :]
        out = np.broadcast_to(factor[:, :, :3], (*at.shape[:-1], 3)).copy()
        out[..., 2] += factor[:, :, 4] * at[..., 3] - factor[:, :, 3] * at[..., 4]
        return out

    def _affine_bend(self, pose: Pose) -> Array:
        """Second derivatives of all forms by the two angles, their products left out, shape (r, 2)."""
        factor, at = self._forms.factor, pose.row[self._forms.bodies]
        return -(factor[:, :, 3] * at[:, :, 3] + factor[:, :, 4] * at[:, :, 4])

    def residual(self, t: float | Array, q: Array) -> Array:
        """Values of all rows in states (..., size)."""
        pose = self.pose(q)
        g = self._affine(pose)[..., : self.rows] - self._times(t, 0)
        row, one, two = self._forms.product.T
        if len(row):
            add_at(g, (pose.vector[..., one, :] * pose.vector[..., two, :]).sum(axis=-1), row)
        for r, _, body, profile in self._profiles:
            g[..., r] -= profile.value(pose.row[..., body, 2])
        return g

    def jacobian(self, t: float | Array, q: Array) -> Array:  # noqa: ARG002
        """G of all rows in states (..., size)."""
        full, rows = np.zeros((*q.shape[:-1], self.rows, self.size + 3)), np.arange(self.rows)[:, None]
        gradients = self.gradients(q)
        for side in range(2):
            full[..., rows, 3 * self._forms.bodies[: self.rows, side, None] + np.arange(3)] += gradients[..., side, :]
        return full[..., : self.size]

    def rate(self, t: float | Array, q: Array) -> Array:  # noqa: ARG002
        """Minus the rates of the prescribed motions."""
        return -self._times(t, 1)

    def velocity_terms(self, t: float, q: Array, v: Array) -> Array:
        """(dG/dt) v minus the second derivatives of the prescribed motions."""
        pose = self.pose(q)
        motion = self._motion(pose, v)
        spin = motion.row[self._forms.bodies[: self.rows], 2]
        out = (spin**2 * self._affine_bend(pose)[: self.rows]).sum(axis=1) - self._times(t, 2)
        for r, _, body, profile in self._profiles:
            out[r] -= profile.bend(pose.row[body, 2]) * motion.row[body, 2] ** 2
        row, one, two = self._forms.product.T
        if not len(row):
            return out
        inward = -(motion.spin[:, :, None] ** 2 * pose.arm).sum(axis=1)  # V'' less what accelerations make of it
        V, rate = pose.vector, motion.vector
        bend = (inward[one] * V[two] + 2.0 * rate[one] * rate[two] + V[one] * inward[two]).sum(axis=1)
        np.add.at(out, row, bend)
        return out

    def gradients(self, q: Array) -> Array:
        """Gradients (..., rows, 2, 3) of all rows with respect to the poses of both bodies."""
        pose = self.pose(q)
        out = self._affine_gradients(pose)[..., : self.rows, :, :]
        for r, side, body, profile in self._profiles:
            out[..., r, side, 2] -= profile.slope(pose.row[..., body, 2])
        row, one, two = self._forms.product.T
        if len(row):
            J, V = self._vector_jacobian(pose), pose.vector
            for a, b in ((one, two), (two, one)):
                part = np.einsum("...pcbk,...pc->...pbk", J[..., a, :, :, :], V[..., b, :])
                add_at(out, part, row, slice(None), slice(None))
        return out

    def curvature(self, q: Array, multipliers: Array) -> Array:
        """d(G^T lambda)/dq at fixed lambda: the geometric stiffness of the joints, (size, size)."""
        pose = self.pose(q)
        full = np.zeros((self.size + 3, self.size + 3))
        angles = 3 * self._forms.bodies[: self.rows] + 2
        np.add.at(full, (angles, angles), multipliers[:, None] * self._affine_bend(pose)[: self.rows])
        for r, _, body, profile in self._profiles:
            full[3 * body + 2, 3 * body + 2] -= multipliers[r] * profile.bend(pose.row[body, 2])
        row, one, two = self._forms.product.T
        if not len(row):
            return full[: self.size, : self.size]
        J = self._vector_jacobian(pose).reshape(-1, 2, 6)
        both = multipliers[row, None, None] * np.einsum("pci,pcj->pij", J[one], J[two])
        both += np.swapaxes(both, 1, 2)
        for k, other in ((one, two), (two, one)):
            bend = -np.einsum("pbc,pc->pb", pose.arm[k], pose.vector[other]) * multipliers[row, None]
            both[:, [2, 5], [2, 5]] += bend
        where = self._places(one)
        np.add.at(full, (where[:, :, None], where[:, None, :]), both)
        return full[: self.size, : self.size]

    def _places(self, vectors: IntArray) -> IntArray:
        """Numbers of the six coordinates that vectors depend on, the ground's past the end."""
        return (3 * self._vectors.bodies[vectors][:, :, None] + np.arange(3)).reshape(-1, 6)

    def force(self, t: float | Array, q: Array, v: Array) -> Array:
        """All applied forces on the bodies in states (..., size)."""
        total = np.broadcast_to(self._forces.weight, (*q.shape[:-1], self.size + 3)).copy()
        if self._loaded:
            pose = self.pose(q)
            motion = self._motion(pose, v)
            springs, along = self._springs(t, pose, motion), self._along(t, pose, motion)
            J = self._vector_jacobian(pose)[..., : springs.length.shape[-1], :, :, :]
            pulls = np.einsum("...scbk,...sc->...sbk", J, springs.pull[..., None] * springs.span)
            places = self._places(np.arange(J.shape[-4]))
            add_at(total, -pulls.reshape(*pulls.shape[:-2], 6), places)
            add_at(total, (along.value + along.given)[..., None] * along.gradient, along.places)
        return total[..., : self.size]

    def force_jacobian(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Derivatives of the forces by q and v in closed form."""
        n = self.size
        by_q, by_v = np.zeros((n + 3, n + 3)), np.zeros((n + 3, n + 3))
        pose = self.pose(q)
        motion = self._motion(pose, v)
        springs = self._springs(t, pose, motion)
        J = self._vector_jacobian(pose)[: len(springs.length)].reshape(-1, 2, 6)
        unit, pull = springs.unit, springs.pull
        k, damping = self._forces.spring[:, :2].T.copy()
        for i, law in self.assembly.tension_laws:
            by_length, by_rate = law.slopes(t, float(springs.length[i]), float(springs.rate[i]))
            k[i] += by_length
            damping[i] += by_rate
        across = np.eye(2) - unit[:, :, None] * unit[:, None, :]
        drift = np.zeros_like(J)  # d(rate of the span)/d(poses)
        drift[:, :, [2, 5]] = -np.swapaxes(motion.spin[: len(J), :, None] * pose.arm[: len(J)], 1, 2)
        turn = np.einsum("sc,scd->sd", motion.vector[: len(J)], across)
        turn *= (damping / (springs.length + (springs.length == 0.0)))[:, None]
        stretch = np.einsum("sc,sci->si", unit, J)
        tension = k[:, None] * stretch + np.einsum("sc,sci->si", turn, J)
        tension += damping[:, None] * np.einsum("sc,sci->si", unit, drift)
        local = -np.einsum("si,sj->sij", stretch, tension)
        local -= pull[:, None, None] * np.einsum("sci,scd,sdj->sij", J, across, J)
        push = pull[:, None] * springs.span
        local[:, [2, 5], [2, 5]] += np.einsum("sbc,sc->sb", pose.arm[: len(J)], push)
        where = self._places(np.arange(len(J)))
        pairs = (where[:, :, None], where[:, None, :])
        np.add.at(by_q, pairs, local)
        np.add.at(by_v, pairs, -damping[:, None, None] * np.einsum("si,sj->sij", stretch, stretch))
        along = self._along(t, pose, motion)
        stiffness, damping = self._forces.along.T
        pairs = (along.places[:, :, None], along.places[:, None, :])
        outer = along.gradient[:, :, None] * along.gradient[:, None, :]
        np.add.at(by_q, pairs, -stiffness[:, None, None] * outer)
        np.add.at(by_v, pairs, -damping[:, None, None] * outer)
        bend = np.zeros_like(along.gradient)
        bend[:, [2, 5]] = self._affine_bend(pose)[self.rows :]
        at = (along.places, along.places)
        np.add.at(by_q, at, (along.value + along.given)[:, None] * bend)
        swing = bend * motion.row.ravel()[along.places]  # d(gradient)/dt
        np.add.at(by_q, pairs, -damping[:, None, None] * along.gradient[:, :, None] * swing[:, None, :])
        for k, load in self.assembly.state_loads:
            slopes = load.slopes(t, q, v)
            for total, slope in zip((by_q, by_v), slopes, strict=True):
                np.add.at(total[:, :n], along.places[k], np.outer(along.gradient[k], slope))
        return by_q[:n, :n], by_v[:n, :n]

    def power(self, t: Array, q: Array, v: Array) -> Array:
        """Power of the loads that vary less the loss in dampers (W), at times (k,) of states (k, n)."""
        pose = self._pose(q)
        motion = self._motion(pose, v)
        springs, along = self._springs(t, pose, motion), self._along(t, pose, motion)
        losses = springs.rate**2 @ self._forces.spring[:, 1] + along.rate**2 @ self._forces.along[:, 1]
        given = ((along.given - self._steady) * along.rate).sum(axis=-1)
        return np.asarray(given - (springs.given * springs.rate).sum(axis=-1) - losses)

    def steady_work(self, q: Array) -> Array:
        """Work of the constant loads (J), but for a constant, in states (..., size)."""
        return np.asarray(self._affine(self.pose(q), self.rows) @ self._steady)

    def potential(self, q: Array) -> Array:
        """Energy of gravity (datum x = y = 0) and of all springs (J) in states (..., size)."""
        pose = self.pose(q)
        span = pose.vector[..., : len(self._forces.spring), :]
        stretch = np.hypot(span[..., 0], span[..., 1]) - self._forces.spring[:, 2]
        moved = self._affine(pose, self.rows)
        elastic = 0.5 * (stretch**2 @ self._forces.spring[:, 0] + moved**2 @ self._forces.along[:, 0])
        return np.asarray(elastic - q @ self._forces.weight[: self.size])

    def _along(self, t: float | Array, pose: Pose, motion: Rates) -> _Along:
        """Forces along forms."""
        bodies, lead = self._forms.bodies[self.rows :], pose.row.shape[:-2]
        gradient = self._affine_gradients(pose)[..., self.rows :, :, :].reshape(*lead, -1, 6)
        places = (3 * bodies[:, :, None] + np.arange(3)).reshape(-1, 6)
        rate = (gradient * motion.row.reshape(*lead, -1)[..., places]).sum(axis=-1)
        stiffness, damping = self._forces.along.T
        given = np.zeros(rate.shape)
        for i, k in enumerate(self._forms.motion[self.rows :]):
            if k >= 0:
                given[..., i] = self.assembly.functions[k](t)
        q, v = (x[..., :-1, :3].reshape(*lead, -1) for x in (pose.row, motion.row))
        for k, load in self.assembly.state_loads:
            given[..., k] = load.values(t, q, v)
        value = -stiffness * self._affine(pose, self.rows) - damping * rate
        return _Along(gradient, places, rate, value, given)

    def _springs(self, t: float | Array, pose: Pose, motion: Rates) -> _Springs:
        """Spans, lengths, directions, rates of the lengths, and tensions over lengths."""
        stiffness, damping, free = self._forces.spring.T
        span, speed = pose.vector[..., : len(free), :], motion.vector[..., : len(free), :]
        length = np.hypot(span[..., 0], span[..., 1])
        pointless = (length == 0.0) & ((damping > 0.0) | (free > 0.0) | self._lawful)
        if pointless.any():
            problem = "joins two points that coincide, so its force has no direction"
            cure = "move its points apart, or give it neither a free length nor damping"
            first = int(pointless.any(axis=tuple(range(pointless.ndim - 1))).argmax())
            raise InputError(self.assembly.spring_label[first], None, problem, cure)
        divisor = np.where(length > 0.0, length, 1.0)
        unit = span / divisor[..., None]
        rate = (unit * speed).sum(axis=-1)
        given = np.zeros(rate.shape)
        for i, law in self.assembly.tension_laws:
            given[..., i] = law.values(t, length[..., i], rate[..., i])
        pull = stiffness * (1.0 - np.where(free > 0.0, free / divisor, 0.0)) + (damping * rate + given) / divisor
        return _Springs(span, length, unit, rate, given, pull)


class _Along(NamedTuple):
    gradient: Array  # (f, 6)
    places: IntArray  # (f, 6) numbers of the coordinates
    rate: Array  # (f,)
    value: Array  # (f,) of springs and dampers
    given: Array  # (f,) of the loads


class _Springs(NamedTuple):
    span: Array  # (s, 2)
    length: Array
    unit: Array  # (s, 2), zero where the points coincide
    rate: Array  # of the length
    given: Array  # tension of the laws
    pull: Array  # tension / length
