r"""Forces of all flanks of a train at the freedoms of its meshes, with their derivatives, over the phases.

The same forces as `train.forces`: with the turns n of the drive in a period of each phase :math:`\theta`, the
phase of a flank is :math:`s(g\,n\cdot\theta + u_r) + \varphi_0`, up to whole cycles of the mesh, so the rotation's
feedback on the phase is kept. What the linear part already contains, the mean stiffness along the approach, is taken
off.

A damper that acts in contact only has a force that jumps at the touch. It is the rate of change of what does not,

.. math:: c\,H(\delta)\,\dot\delta = \frac{d}{dt}\,c\max(\delta, 0) ,

so its harmonics are :math:`ik\cdot\omega` times those of :math:`c\max(\delta, 0)`, and Newton's method has their
derivatives.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...base.typing import Array, IntArray
from ..train.forces import Flank, FlankForces, LawFlank, Slip, SpeedTorque
from ..train.friction import Sliding
from .balance import Entries, Pushes


@dataclass(frozen=True, eq=False)
class Rubbing:
    """Friction of a flank at any speed of the drive.

    Parameters
    ----------
    sliding
        At the speed that the model was built for.
    speed
        That one (rad/s).
    coefficient
        Of friction at another speed; None: the same.
    """

    sliding: Sliding
    speed: float
    coefficient: Callable[[float], float] | None

    def at(self, speed: float) -> Sliding:
        """Friction at a speed; it sets in as far along the path of contact as at the model's."""
        mu = self.sliding.coefficient if self.coefficient is None else self.coefficient(speed)
        return replace(self.sliding, coefficient=mu, speed=self.sliding.speed * abs(speed / self.speed))


#: What two flanks may differ in that are evaluated at once: where they act, and when.
PLACES = ("direction", "turn", "phase", "mean", "gap", "tilt", "across", "spin")
#: A torque repeats with a phase where its cycles in the phase's period are a whole number to this part.
WHOLE = 1e-9


@dataclass(frozen=True, eq=False)
class SwingingTorque:
    """A torque ``amplitude sin(omega t + phase)`` along a freedom, which repeats with a phase of the motion.

    Parameters
    ----------
    freedom
        Its number.
    amplitude, omega, phase
        N m, rad/s, rad.
    turns : (n,)
        Turns of the drive in a period of each phase.
    per_turn
        Cycles in a turn of the drive of one that follows the speed, which counts instead of omega; else 0.
    """

    freedom: int
    amplitude: float
    omega: float
    phase: float
    turns: Array
    per_turn: float = 0.0

    def at_speed(self, speed: float) -> float:
        """Angular frequency (rad/s) at a speed of the drive (rad/s)."""
        return self.per_turn * abs(speed) if self.per_turn else self.omega

    def waves(self, speed: float) -> IntArray | None:
        """Cycles in a period of each phase at a speed of the drive (rad/s), (n,); None where none has whole ones."""
        cycles = self.at_speed(speed) / abs(speed) * self.turns
        whole = np.round(cycles)
        found = np.flatnonzero((np.abs(cycles - whole) <= WHOLE * cycles) & (whole > 0.0))
        return None if not len(found) else np.asarray(whole * (np.arange(len(cycles)) == found[0]), dtype=np.int64)

    def at(self, theta: Array, speed: float) -> Array:
        """The torque (N m) at phases theta (S, n)."""
        waves = self.waves(speed)
        assert waves is not None  # such speeds are left out before
        return np.asarray(self.amplitude * np.sin(theta @ waves + self.phase))


@dataclass(frozen=True, eq=False)
class MeshForces:
    """Forces of flanks at the m freedoms.

    Parameters
    ----------
    flanks
        Of all meshes.
    freedoms : (f, 4)
        For each flank the numbers of its approach and of its driver's rotation among the freedoms, and of the
        displacement and turn that its friction acts on, or of the tilt of its gears (-1 without).
    turns : (f, n)
        For each flank the turns of the drive in a period of the phase that its mesh follows, negative where it turns
        backwards; 0 of other phases.
    rubbing
        Friction of each flank, or None.
    torques
        Those that swing.
    speed_torques
        Torques over speed, whose directions are numbers of freedoms.
    """

    flanks: Sequence[Flank]
    freedoms: IntArray
    turns: Array
    rubbing: Sequence[Rubbing | None]
    torques: Sequence[SwingingTorque] = ()
    speed_torques: Sequence[SpeedTorque] = ()
    _pairs: dict[tuple[int, int], Array] = field(default_factory=dict, repr=False)

    @cached_property
    def _alike(self) -> list[list[int]]:
        """Numbers of flanks whose forces follow from phase, approach and rates alike: they are evaluated at once."""
        groups: list[list[int]] = []
        for number, (flank, rubs) in enumerate(zip(self.flanks, self.rubbing, strict=True)):
            for group in groups:
                if _same(flank, self.flanks[group[0]], PLACES) and _same(rubs, self.rubbing[group[0]], PLACES):
                    group.append(number)
                    break
            else:
                groups.append([number])
        return groups

    def of_flanks(self, theta: Array, speed: float, u: Array, du: Array) -> list[FlankForces]:
        """Return the forces of each flank at S places of the phases.

        Parameters
        ----------
        theta : ndarray, shape (S, n)
            Phases of the motion (rad).
        speed : float
            Speed of the drive (rad/s).
        u, du : ndarray, shape (S, m)
            Freedoms (m, rad) and their rates (m/s, rad/s).
        """
        found: dict[int, FlankForces] = {}
        for group, whole in zip(self._alike, self._of_groups(theta, speed, u, du), strict=True):
            for place, number in enumerate(group):
                found[number] = _rows(whole, slice(place * len(theta), (place + 1) * len(theta)))
        return [found[number] for number in range(len(self.flanks))]

    def _of_groups(self, theta: Array, speed: float, u: Array, du: Array) -> Iterator[FlankForces]:
        """Forces of the flanks of each group, one flank after the other."""
        sense, ratio, begin, gap = self._places
        along, turn, across, spin = self.freedoms.T
        phases = (sense * ratio)[:, None] * (self.turns @ theta.T) + sense[:, None] * u.T[turn] + begin[:, None]
        approaches = u.T[along]
        rates = du.T[np.array([along, across, np.where(spin < 0, turn, spin)])]
        for group in self._alike:
            flank, rubs = self.flanks[group[0]], self.rubbing[group[0]]
            phase, tilt = phases[group].ravel(), u.T[across[group]].ravel() if flank.tilt >= 0 else 0.0
            later = gap[group] - flank.gap
            beyond = flank.beyond_touch(phase, (approaches[group] - later[:, None]).ravel(), tilt)
            pairs = None
            if isinstance(flank, LawFlank):
                pairs = self._pairs.get((group[0], len(phase)))
                if pairs is None:
                    pairs = self._pairs[group[0], len(phase)] = np.zeros((len(phase), flank.law.slots))
            slip = Slip(speed, rates[:, group].reshape(3, -1).T, None if rubs is None else rubs.at(speed), tilt)
            yield flank.forces(phase, beyond, slip, pairs)

    @cached_property
    def _places(self) -> tuple[Array, ...]:
        """Senses, ratios, phases at the start (rad) and gaps (m) of the flanks."""
        rows = [(flank.sense, flank.ratio, flank.phase, flank.gap) for flank in self.flanks]
        return tuple(np.array(rows, dtype=float).reshape(-1, 4).T)

    def __call__(self, theta: Array, speed: float, u: Array, du: Array) -> Pushes:
        """Forces at the freedoms, what the linear part has taken off."""
        value, momentum, size = np.zeros_like(u), None, u.shape[1]
        by, momentum_by = list[Entries](), list[Entries]()
        for group, at in zip(self._alike, self._of_groups(theta, speed, u, du), strict=True):
            sense, mean = self.flanks[group[0]].sense, np.array([self.flanks[number].mean for number in group])
            d, r, a, s = self.freedoms[group].T

            def shaped(values: Array | float, count: int = len(group)) -> Array:
                values = values if isinstance(values, np.ndarray) else np.full(count * len(u), values)
                return values.reshape(count, -1).T

            force, tangent, cross = shaped(at.force), shaped(at.tangent), shaped(at.cross)
            value[:, d] += mean * u[:, d] - force  # each flank has its own approach
            by += [(d, d, mean - tangent), (d, r, -sense * cross)]
            if at.couple is not None and at.couple_by_phase is not None:
                _add(value, a, -shaped(at.couple))
                slopes = ((d, a, at.by_tilt), (a, d, at.couple_by_approach), (a, a, at.couple_by_tilt))
                by += [(row, column, -shaped(slope)) for row, column, slope in slopes if slope is not None]
                by.append((a, r, -sense * shaped(at.couple_by_phase)))
                if at.moment_by_tilt is not None:
                    by.append((r, a, -sense * shaped(at.moment_by_tilt)))
            if at.momentum is not None and at.per_rate is not None:
                momentum = np.zeros_like(u) if momentum is None else momentum
                value[:, d] += shaped(at.push)
                momentum[:, d] -= shaped(at.momentum)
                momentum_by += [(d, d, -shaped(at.per_rate)), (d, r, -sense * shaped(at.momentum_by_phase))]
                continue
            if at.per_rate is not None:
                by.append((d, size + d, -shaped(at.per_rate)))
            if at.moment is not None and at.moment_by_approach is not None and at.bend is not None:
                _add(value, r, -sense * shaped(at.moment))
                by += [(r, d, -sense * shaped(at.moment_by_approach)), (r, r, -shaped(at.bend))]
            if at.drag is not None:
                for i, on in enumerate((a, s)):
                    _add(value, on, -shaped(at.drag.value[:, i]))
                    by += [
                        (on, d, -shaped(at.drag.by_approach[:, i])),
                        (on, r, -sense * shaped(at.drag.by_phase[:, i])),
                    ]
                    for rate, slope in ((d, at.drag.by_rate), (a, at.drag.by_across_rate), (s, at.drag.by_turn_rate)):
                        by.append((on, size + rate, -shaped(slope[:, i])))
        for torque in self.torques:
            value[:, torque.freedom] += torque.at(theta, speed)
        for over in self.speed_torques:
            d = over.direction
            value[:, d] += over.at(speed, du[:, d])
            by.append((np.array([d]), np.array([size + d]), over.slope(speed, du[:, d])[:, None]))
        return Pushes(value, by, momentum, momentum_by)


def _add(values: Array, columns: IntArray, more: Array) -> None:
    """Add (S, f) to columns (f,) of values, of which some may be the same."""
    for column, each in zip(columns.tolist(), more.T, strict=True):
        values[:, column] += each


def _same(one: Any, two: Any, without: Sequence[str] = ()) -> bool:
    """Whether two values are equal, arrays and records of them included, except for some fields of records."""
    if one is two:
        return True
    if type(one) is not type(two):
        return False
    if isinstance(one, np.ndarray):
        return np.array_equal(one, two)
    if is_dataclass(one):
        names = [item.name for item in fields(one) if item.name not in without]
        return all(_same(getattr(one, name), getattr(two, name), without) for name in names)
    return bool(one == two)


def _rows(forces: FlankForces, rows: slice) -> FlankForces:
    """Forces at some of the places."""
    drag = None if forces.drag is None else type(forces.drag)(*(values[rows] for values in forces.drag))
    parts = {
        name: values[rows]
        for name, values in forces._asdict().items()
        if isinstance(values, np.ndarray) and values.ndim
    }
    return forces._replace(**parts, drag=drag)
