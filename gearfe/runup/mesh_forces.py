r"""Forces of all flanks of a train at the freedoms of its meshes, with their derivatives, over the phases.

The same forces as `gearfe.train.forces`: with the turns n of the drive in a period of each phase :math:`\theta`, the
phase of a flank is :math:`s(g\,n\cdot\theta + u_r) + \varphi_0`, but for whole cycles of the mesh, so the rotation's
feedback on the phase is kept. What stands in the linear part already, the mean stiffness along the approach, is taken
off.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ..train.forces import CurveFlank, Flank, LawFlank
from ..train.friction import Sliding, smooth_sign
from ..typing import Array, BoolArray, IntArray
from .balance import Pushes
from .law_kernel import BEND, BEYOND, CROSS, FORCE, MOMENT, RESULTS, ROWS, TANGENT, Jets, evaluate_law, law_tables


class Drag(NamedTuple):
    """Friction of a flank, (S, 2) each: force across the line of action (N) and its moment about P (N m), with their
    derivatives: with approach and phase, with the rates of approach, of the way across, and of the turn.
    """

    value: Array
    by_approach: Array
    by_phase: Array
    by_rate: Array
    by_across_rate: Array
    by_turn_rate: Array


class FlankForces(NamedTuple):
    """A flank at S places of the phases."""

    force: Array  # (S,) N along its approach, damping included
    tangent: Array  # (S,) N/m
    cross: Array  # (S,) N/rad: of the force with the phase
    apart: BoolArray  # (S,)
    beyond: BoolArray  # (S,) farther than the law is known
    per_rate: Array | None = None  # (S,) N s/m
    moment: Array | None = None  # (S,) N m on the phase
    moment_by_approach: Array | None = None  # (S,) N m/m
    bend: Array | None = None  # (S,) N m/rad: of the moment with the phase
    drag: Drag | None = None


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


@dataclass(frozen=True, eq=False)
class MeshForces:
    """Forces of flanks at the m freedoms.

    Parameters
    ----------
    flanks
        Of all meshes.
    freedoms : (f, 4)
        For each flank the numbers of its approach and of its driver's rotation among the freedoms, and of the
        displacement and turn that its friction acts on (-1 without).
    turns : (f, n)
        For each flank the turns of the drive in a period of the phase that its mesh follows, negative where it turns
        backwards; 0 of other phases.
    rubbing
        Friction of each flank, or None.
    """

    flanks: Sequence[Flank]
    freedoms: IntArray
    turns: Array
    rubbing: Sequence[Rubbing | None]
    _pairs: dict[tuple[int, int], Array] = field(default_factory=dict, repr=False)

    def flank(self, number: int, theta: Array, speed: float, u: Array, du: Array) -> FlankForces:
        """One flank at phases theta (S, n) and a speed of the drive (rad/s), freedoms and rates (S, m)."""
        flank = self.flanks[number]
        along, turn, across, spin = self.freedoms[number]
        phase = flank.sense * (flank.ratio * (theta @ self.turns[number]) + u[:, turn]) + flank.phase
        approach = u[:, along] - flank.gap
        if isinstance(flank, CurveFlank):
            return self._curve(flank, phase, approach)
        return self._law(number, flank, phase, approach, speed, du[:, [along, across, spin]])

    def _curve(self, flank: CurveFlank, phase: Array, approach: Array) -> FlankForces:
        k, slope = flank.curve(phase)
        bears = (approach > 0.0) | (not flank.parts)
        force = np.where(bears, k * approach, 0.0)
        cross = np.where(bears, slope * approach, 0.0)
        none = np.zeros(len(phase), dtype=bool)
        return FlankForces(force, np.where(bears, k, 0.0), cross, ~bears, none)

    def _law(
        self, number: int, flank: LawFlank, phase: Array, approach: Array, speed: float, rates: Array
    ) -> FlankForces:
        tables, slots = self._tables[number], flank.law.slots
        count = len(phase)
        pairs = self._pairs.get((number, count))
        if pairs is None:
            pairs = self._pairs[number, count] = np.zeros((count, slots))
        out, slopes, work = np.zeros((count, RESULTS)), np.zeros((2, count, slots)), np.zeros((ROWS + 2 * slots, slots))
        evaluate_law(tables, Jets(phase, np.ascontiguousarray(approach), pairs, slopes, work, out))
        push = 1.0 + flank.damping * rates[:, 0]
        acts = push > 0.0
        push = np.where(acts, push, 0.0)
        more = np.where(acts, flank.damping, 0.0)
        F = out[:, FORCE]
        rubs, drag = self.rubbing[number], None
        if rubs is not None:
            drag = _drag(flank, rubs.at(speed), phase, (pairs, slopes), (push, more), speed, rates)
        return FlankForces(
            F * push, out[:, TANGENT] * push, out[:, CROSS] * push, F <= 0.0, out[:, BEYOND] > 0.0,
            F * more if flank.damping > 0.0 else None, out[:, MOMENT], out[:, CROSS], out[:, BEND], drag,
        )  # fmt: skip

    @cached_property
    def _tables(self) -> list[Any]:
        return [law_tables(flank.law) if isinstance(flank, LawFlank) else None for flank in self.flanks]

    def __call__(self, theta: Array, speed: float, u: Array, du: Array) -> Pushes:
        """Forces at the freedoms, what the linear part has taken off."""
        value = np.zeros_like(u)
        by_place = np.zeros((*u.shape, u.shape[1]))
        by_rate = None
        for number, (flank, (d, r, a, s)) in enumerate(zip(self.flanks, self.freedoms, strict=True)):
            at = self.flank(number, theta, speed, u, du)
            value[:, d] += flank.mean * u[:, d] - at.force
            by_place[:, d, d] += flank.mean - at.tangent
            by_place[:, d, r] -= flank.sense * at.cross
            if by_rate is None and (at.per_rate is not None or at.drag is not None):
                by_rate = np.zeros_like(by_place)
            if at.per_rate is not None and by_rate is not None:
                by_rate[:, d, d] -= at.per_rate
            if at.moment is not None and at.moment_by_approach is not None:
                value[:, r] -= flank.sense * at.moment
                by_place[:, r, d] -= flank.sense * at.moment_by_approach
                by_place[:, r, r] -= at.bend
            if at.drag is not None and by_rate is not None:
                for i, on in enumerate((a, s)):
                    value[:, on] -= at.drag.value[:, i]
                    by_place[:, on, d] -= at.drag.by_approach[:, i]
                    by_place[:, on, r] -= flank.sense * at.drag.by_phase[:, i]
                    by_rate[:, on, d] -= at.drag.by_rate[:, i]
                    by_rate[:, on, a] -= at.drag.by_across_rate[:, i]
                    by_rate[:, on, s] -= at.drag.by_turn_rate[:, i]
        return Pushes(value, by_place, by_rate)


def _drag(
    flank: LawFlank, one: Sliding, phase: Array, found: tuple[Array, Array], pushes: tuple[Array, Array], speed: float,
    rates: Array,
) -> Drag:  # fmt: skip
    """Friction of `gearfe.train.friction` with its derivatives; `found` and `pushes` are values with theirs."""
    (pairs, slopes), (push, more) = found, pushes
    arm = one.radius * (flank.law.pair_phases(phase) - one.pitch_phase)
    turning = one.ratio * speed + rates[:, 2, None]
    share, slope = smooth_sign((rates[:, 1, None] + arm * turning) / one.speed)
    steep = one.coefficient * pairs * push[:, None] * slope / one.speed
    pulls = one.coefficient * share
    drag = pulls * pairs * push[:, None]
    arms = np.stack([np.ones_like(arm), arm])  # of the force and of its moment

    def summed(x: Array) -> Array:
        return np.asarray((arms * x).sum(axis=2).T)

    by_phase = summed(pulls * slopes[1] * push[:, None] + steep * one.radius * turning)
    by_phase[:, 1] += one.radius * drag.sum(axis=1)
    return Drag(
        summed(drag), summed(pulls * slopes[0] * push[:, None]), by_phase, summed(pulls * pairs * more[:, None]),
        summed(steep), summed(steep * arm),
    )  # fmt: skip
