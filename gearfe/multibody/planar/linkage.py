"""Combine planar bodies, joints and forces to one element of the contract, with its tape and energies.

In the variables x, y, theta, cos theta, sin theta of the bodies, forms (`multibody.planar.forms`) are affine or
quadratic, and vectors have affine components. The tension T along a span D pulls with (T / |D|) D.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array, IntArray
from ..core.tape_evaluation import TapeElement, TapeValues
from ..series.tape import Tape
from ..series.timefunctions import TimeFunction
from .assembly import Assembly, Held, assemble, body_numbers
from .bodies import Body, Frames
from .couplings import with_carriers
from .forces import Along, Force, SpanFunction, StateFunction, Tension
from .joints import Joint, places
from .variables import Affine, BodyVariables

#: A load beyond this value (N, N m) where a run ends has a pole there.
POLE = 1e7


def write_row(bodies: BodyVariables, row: Held, unit: float) -> None:
    """Write a constraint."""
    (terms, constant), products = bodies.form(row.form), []
    for pair in row.form.products:
        for u, v in zip(*map(bodies.vector, pair), strict=True):
            products += [(i, j, f * g) for i, f in u.terms.items() for j, g in v.terms.items()]
            for a, b in ((u, v), (v, u)):
                for i, f in a.terms.items():
                    terms[i] = terms.get(i, 0.0) + f * b.constant
            constant += u.constant * v.constant
    if row.profile is not None:
        body, profile = row.profile
        terms[profile.write(bodies.tape, bodies.places[3 * body + 2])] = -1.0
    bodies.tape.row(terms, products, constant, row.motion, unit)


def write_tension(bodies: BodyVariables, spring: Tension) -> tuple[tuple[Affine, Affine], int]:
    """Write a tension along a vector; return the vector's components, and the register of its law, -1 for none."""
    tape, law = bodies.tape, -1
    stiffness, damping, free = spring.stiffness, spring.damping, spring.free_length
    x, y = bodies.vector(spring.vector)
    span = [tape.linear(*x), tape.linear(*y)]
    pull = tape.number(stiffness)  # tension over length
    if free != 0.0 or damping != 0.0 or spring.law is not None:
        square = tape.sum(tape.mul(span[0], span[0]), tape.mul(span[1], span[1]))
        inverse = tape.power(square, -0.5)
        if free != 0.0:
            pull = tape.sum(inverse, f=-stiffness * free, c=stiffness)
        if damping != 0.0 or spring.law is not None:
            speed = [tape.rate(x.terms), tape.rate(y.terms)]
            flow = tape.sum(tape.mul(span[0], speed[0]), tape.mul(span[1], speed[1]))
            pull = tape.sum(pull, tape.div(flow, square), g=damping)
        if spring.law is not None:
            law = register(spring.law, spring.law.write(tape, tape.mul(square, inverse), tape.mul(flow, inverse)))
            pull = tape.sum(pull, tape.mul(law, inverse))
    for part, along in zip(span, (x, y), strict=True):
        opposite = {i: -f for i, f in along.terms.items()}
        tape.push(tape.mul(pull, part), opposite, estimated=spring.law is None)
    return (x, y), law


def write_along(bodies: BodyVariables, force: Along) -> tuple[Affine, int]:
    """Write a force along a form; return the form, and the register of the load, -1 for none."""
    tape, form, load = bodies.tape, bodies.form(force.form), -1
    if force.stiffness != 0.0 or force.damping != 0.0:
        pull = tape.sum(tape.linear(*form), tape.rate(form.terms), f=-force.stiffness, g=-force.damping)
        tape.push(pull, form.terms, estimated=True)
    if isinstance(force.load, StateFunction):
        load = register(force.load, force.load.write(bodies))
        tape.push(load, form.terms)
    elif force.load is not None:
        load = tape.function(force.load)
        tape.push(load, form.terms, estimated=True)
    return form, load


def register(load: StateFunction | SpanFunction, number: object) -> int:
    """Number of the register that a load has written, refused where it is none."""
    if isinstance(number, int):
        return number
    cure = "return the result of the tape's operations; other loads are a gearfe.multibody.LocalForce"
    raise InputError(f"{type(load).__name__}.write", None, "gives no number of a register", cure)


class Observed(NamedTuple):
    """Registers of the springs, s in all, and of the forces along forms, f in all; -1 for none."""

    span: IntArray  # (2, s) components
    speed: IntArray  # (2, s) their rates
    law: IntArray  # (s,)
    form: IntArray  # (f,)
    rate: IntArray  # (f,)
    load: IntArray  # (f,)


class Linkage(TapeElement):
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
        self.bodies, self.forces = bodies, forces
        self.frames = Frames(bodies, body_numbers(bodies, joints, forces))
        self.joints = joints = with_carriers(joints, self.frames)
        self.body_index = self.frames.number
        self.name = "linkage"
        self.assembly: Assembly = assemble(joints, forces, self.frames)
        self.size = 3 * len(bodies)
        self.rows = len(self.assembly.rows)
        self.row_names = self.assembly.row_label
        self.breaks = self.assembly.breaks
        springs = [spring for _, spring in self.assembly.springs]
        loads = [a.load for a in self.assembly.along]
        #: Stiffness, damping, free length of the springs; stiffness and damping along forms.
        self._spring = np.array([s[1:4] for s in springs], dtype=float).reshape(-1, 3)
        self._along = np.array([a[1:3] for a in self.assembly.along], dtype=float).reshape(-1, 2)
        #: Springs whose force needs a direction.
        self._pointed = np.array([s.damping > 0.0 or s.free_length > 0.0 or s.law is not None for s in springs], bool)
        #: Values of constant loads; whether others, or dampers, give or take energy; whether joints prescribe motions.
        self._steady = np.array([float(f(0.0)) if isinstance(f, TimeFunction) and f.steady else 0.0 for f in loads])
        lossy = self._spring[:, 1].any() or self._along[:, 1].any() or any(s.law is not None for s in springs)
        self.powered = bool(lossy) or any(
            f is not None and not (isinstance(f, TimeFunction) and f.steady) for f in loads
        )
        self.driven = any(row.motion is not None for row in self.assembly.rows)
        self.planar_bodies = tuple(body.name for body in bodies)
        self.row_joint = self.assembly.row_joint
        self.joint_places = tuple(places(joint) for joint in joints)
        self.coordinate_names = tuple(f"{b}_{c}" for b in self.planar_bodies for c in ("x_m", "y_m", "angle_rad"))
        self.turns = tuple(range(2, self.size, 3))
        profiles = any(row.profile is not None for row in self.assembly.rows)
        self.algebraic = not (self.assembly.state_loads or self.assembly.tension_laws or profiles)
        self.steady_forces = self.algebraic and not (self._spring.size or self._along.any())

    def mass(self) -> Array:
        """Diagonal of masses and inertias."""
        return np.diag([m for b in self.bodies for m in (b.mass, b.mass, b.inertia)])

    def start(self) -> tuple[Array, Array]:
        """Start state of the mass centres."""
        return self.assembly.start_q, self.assembly.start_v

    def units(self) -> tuple[Array, Array]:
        """The mechanism's length where a coordinate or a row is a length, 1 where it is an angle."""
        length = self.assembly.length
        return np.tile([length, length, 1.0], len(self.bodies)), np.where(self.assembly.row_holds_length, length, 1.0)

    def gap_text(self, gaps: Array, row: int) -> str:
        """The gap of the joint that a row belongs to: in its unit and relative to the mechanism's length."""
        joint, lengths = self.row_joint, self.assembly.row_holds_length
        if not lengths[row]:
            return f"{gaps[row]:.3g} rad"
        same = [r for r in range(len(gaps)) if joint[r] == joint[row] and lengths[r]]
        gap, length = float(np.linalg.norm(gaps[same])), self.assembly.length
        return f"{gap:.3g} m ({gap / length:.2g} of the mechanism's length, {length:.3g} m)"

    def write(self, tape: Tape, places: IntArray) -> bool:
        """The linkage on a tape, see `gearfe.multibody.core.contract`."""
        self._write(BodyVariables(tape, places))
        return True

    def _write(self, bodies: BodyVariables) -> tuple[list[tuple[tuple[Affine, Affine], int]], list[tuple[Affine, int]]]:
        """Spans of the springs and forms of the other forces, with the registers of laws and loads."""
        for row, unit in zip(self.assembly.rows, self.units()[1], strict=True):
            write_row(bodies, row, float(unit))
        tape, (springs, along) = bodies.tape, (self.assembly.springs, self.assembly.along)
        tape.constant[bodies.places] += self.assembly.weight
        return [write_tension(bodies, spring) for _, spring in springs], [write_along(bodies, force) for force in along]

    @property
    def values(self) -> TapeValues:
        """Return the written values and those of the energies, on a separate tape."""
        return self._own[0]

    @property
    def observed(self) -> Observed:
        """Registers there that energies ask for."""
        return self._own[1]

    @cached_property
    def _own(self) -> tuple[TapeValues, Observed]:
        tape = Tape(self.size)
        springs, along = self._write(BodyVariables(tape, np.arange(self.size)))
        spans = [[*(tape.linear(*x) for x in span), *(tape.rate(x.terms) for x in span), law] for span, law in springs]
        forms = [[tape.linear(*form), tape.rate(form.terms), load] for form, load in along]
        one, two = np.array(spans, dtype=np.int64).reshape(-1, 5).T, np.array(forms, dtype=np.int64).reshape(-1, 3).T
        return TapeValues(tape), Observed(one[:2], one[2:4], one[4], *two)

    def force(self, t: float | Array, q: Array, v: Array) -> Array:
        """All applied forces on the bodies in states (..., size)."""
        return self.values.force(q, self._registers(t, q, v))

    def force_jacobian(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Derivatives of the forces by q and v."""
        return self.values.force_slopes(q, v, self._registers(t, q, v))

    def _registers(self, t: float | Array, q: Array, v: Array) -> Array:
        """Registers in states (..., size); springs without a direction are refused."""
        R, seen = self.values.registers(t, q, v), self.observed
        pointless = self._pointed & (R[seen.span] == 0.0).all(axis=0).T
        if pointless.any():
            problem = "joins two points that coincide, so its force has no direction"
            cure = "move its points apart, or give it neither a free length nor damping"
            first = int(pointless.any(axis=tuple(range(pointless.ndim - 1))).argmax())
            raise InputError(self.assembly.springs[first][0], None, problem, cure)
        return R

    def _lengths(self, R: Array) -> tuple[Array, Array]:
        """Lengths of the springs and their rates, shapes (..., s)."""
        span, speed = R[self.observed.span], R[self.observed.speed]
        length = np.hypot(*span)
        return length.T, ((span * speed).sum(axis=0) / np.where(length > 0.0, length, 1.0)).T

    @property
    def pieced(self) -> bool:
        """Return whether loads have corners."""
        return bool(self.values.switches)

    def pieces(self, t: float | Array, q: Array, v: Array) -> IntArray:
        """Numbers of the smooth pieces that loads and laws of springs are on, shape (..., s); -1 without a value."""
        return self.values.pieces(self.values.registers(t, q, v))

    @property
    def has_knots(self) -> bool:
        """Return whether joints follow profiles."""
        return self.values.has_knots

    def knots(self, q: Array) -> IntArray:
        """Pieces of the profiles that joints are on, shape (..., profiles)."""
        return self.values.knots(q)

    def load_problem(self, t: float, q: Array, v: Array) -> str:
        """Return which load or law of a spring has no value at a state, and why, or an empty string."""
        problems = [load.problem(t, q, v) for _, load in self.assembly.state_loads]
        if self.assembly.tension_laws:
            lengths, rates = self._lengths(self.values.registers(t, q, v))
            problems += [law.problem(t, float(lengths[k]), float(rates[k])) for k, law in self.assembly.tension_laws]
        return next(filter(None, problems), "")

    def load_pole(self, t: float, q: Array, v: Array) -> str:
        """Return that the largest load grows beyond all bounds, or an empty string where it is below `POLE`."""
        sizes = [(abs(load.value(t, q, v)), load) for _, load in self.assembly.state_loads]
        size, largest = max(sizes, key=lambda pair: pair[0], default=(0.0, None))
        return "" if largest is None or not size > POLE else largest.pole(t, size)

    def load_values(self, t: float, q: Array, v: Array) -> list[tuple[str, float]]:
        """Return loads and laws of springs with the bodies that they act on, and their values (N, N m)."""
        along, springs = self.assembly.along, self.assembly.springs
        values = [
            (self._on(load.described, along[k].form.bodies), load.value(t, q, v))
            for k, load in self.assembly.state_loads
        ]
        if self.assembly.tension_laws:
            lengths, rates = self._lengths(self.values.registers(t, q, v))
            values += [
                (self._on(law.described, springs[k][1].vector.ends), law.value(t, float(lengths[k]), float(rates[k])))
                for k, law in self.assembly.tension_laws
            ]
        return values

    def _on(self, load: str, numbers: Iterable[int]) -> str:
        """A load and the names of the bodies with these numbers, that of the ground left out."""
        names = [self.bodies[number].name for number in numbers if number < len(self.bodies)]
        return f"{load} on {' and '.join(names)}"

    def pole_between(self, before: tuple[float, Array, Array], after: tuple[float, Array, Array]) -> str:
        """Return which load leaves a smooth piece at a pole between two states (t, q, v), or an empty string."""
        for _, load in self.assembly.state_loads:
            tape = Tape(self.size)
            load.write(BodyVariables(tape, np.arange(self.size)))
            alone = TapeValues(tape)
            one, two = (alone.pieces(alone.registers(*state)) for state in (before, after))
            if (one != two).any():
                return load.pole(before[0], abs(load.value(*before)))
        return ""

    def power(self, t: Array, q: Array, v: Array) -> Array:
        """Power of the loads that vary less the loss in dampers (W), at times (k,) of states (k, n)."""
        R, seen = self._registers(t, q, v), self.observed
        rates, along = self._lengths(R)[1], R[seen.rate].T
        losses = rates**2 @ self._spring[:, 1] + along**2 @ self._along[:, 1]
        given = ((R[seen.load].T - self._steady) * along).sum(axis=-1)
        return np.asarray(given - (R[seen.law].T * rates).sum(axis=-1) - losses)

    def steady_work(self, q: Array) -> Array:
        """Work of the constant loads (J), except for a constant, in states (..., size)."""
        return np.asarray(self._at_rest(q)[self.observed.form].T @ self._steady)

    def potential(self, q: Array) -> Array:
        """Energy of gravity (datum x = y = 0) and of all springs (J) in states (..., size)."""
        R = self._at_rest(q)
        stretch, moved = self._lengths(R)[0] - self._spring[:, 2], R[self.observed.form].T
        elastic = 0.5 * (stretch**2 @ self._spring[:, 0] + moved**2 @ self._along[:, 0])
        return np.asarray(elastic - q @ self.assembly.weight)

    def _at_rest(self, q: Array) -> Array:
        """Registers without speeds, at the time 0."""
        return self.values.registers(0.0, q, np.zeros_like(q))
