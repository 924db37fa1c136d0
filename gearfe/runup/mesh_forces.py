r"""Forces of all flanks of a train at the freedoms of its meshes, with their derivatives, over one period.

The same forces as `gearfe.train.forces`, with :math:`\psi = \Omega t`: the phase of a flank is
:math:`s(g\psi + u_r) + \varphi_0`, so the rotation's feedback on the phase is kept. What stands in the linear part
already, the mean stiffness along the approach, is taken off.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ..train.arrays import cubics, law_arrays
from ..train.forces import CurveFlank, LawFlank
from ..typing import Array, BoolArray, IntArray
from .balance import Pushes
from .law_kernel import BEND, BEYOND, CROSS, FORCE, MOMENT, RESULTS, ROWS, TANGENT, jets


class FlankForces(NamedTuple):
    """A flank over S places of the period."""

    force: Array  # (S,) N along its approach, damping included
    tangent: Array  # (S,) N/m
    cross: Array  # (S,) N/rad: of the force with the phase
    per_rate: Array | None  # (S,) N s/m
    moment: Array | None  # (S,) N m on the phase
    moment_by_approach: Array | None  # (S,) N m/m
    bend: Array | None  # (S,) N m/rad: of the moment with the phase
    apart: BoolArray  # (S,)
    beyond: BoolArray  # (S,) farther than the law is known


@dataclass(frozen=True, eq=False)
class MeshForces:
    """Forces of flanks at the m freedoms.

    Parameters
    ----------
    flanks
        Of all meshes.
    freedoms : (f, 2)
        For each flank the numbers of its approach and of its driver's rotation among the freedoms.
    turns
        Turns of the drive in a period, negative where it turns backwards.
    """

    flanks: Sequence[CurveFlank | LawFlank]
    freedoms: IntArray
    turns: float
    _pairs: dict[tuple[int, int], Array] = field(default_factory=dict, repr=False)

    def flank(self, number: int, theta: Array, u: Array, du: Array) -> FlankForces:
        """One flank at theta (S,), freedoms and rates (S, m)."""
        flank = self.flanks[number]
        along, turn = self.freedoms[number]
        phase = flank.sense * (flank.ratio * self.turns * theta + u[:, turn]) + flank.phase
        approach = u[:, along] - flank.gap
        if isinstance(flank, CurveFlank):
            return self._curve(number, flank, phase, approach)
        return self._law(number, flank, phase, approach, du[:, along])

    def _curve(self, number: int, flank: CurveFlank, phase: Array, approach: Array) -> FlankForces:
        nodes, table = flank.curve.nodes, self._tables[number]
        x = phase - np.floor((phase - nodes[0]) / flank.curve.period) * flank.curve.period
        cell = np.minimum(np.searchsorted(nodes[1:], x, side="right"), len(nodes) - 2)
        c, x = table[cell].T, x - nodes[cell]
        k = c[0] + x * (c[1] + x * (c[2] + x * c[3]))
        slope = c[1] + x * (2.0 * c[2] + 3.0 * x * c[3])
        bears = (approach > 0.0) | (not flank.parts)
        force = np.where(bears, k * approach, 0.0)
        cross = np.where(bears, slope * approach, 0.0)
        none = np.zeros(len(phase), dtype=bool)
        return FlankForces(force, np.where(bears, k, 0.0), cross, None, None, None, None, ~bears, none)

    def _law(self, number: int, flank: LawFlank, phase: Array, approach: Array, rate: Array) -> FlankForces:
        tables, slots = self._tables[number], flank.law.slots
        count = len(phase)
        pairs = self._pairs.get((number, count))
        if pairs is None:
            pairs = self._pairs[number, count] = np.zeros((count, slots))
        out = np.zeros((count, RESULTS))
        work = np.zeros((ROWS + 2 * slots, slots))
        jets()(*tables, flank.law.reach, phase, np.ascontiguousarray(approach), pairs, work, out)
        push = 1.0 + flank.damping * rate
        acts = push > 0.0
        push = np.where(acts, push, 0.0)
        F = out[:, FORCE]
        per_rate = np.where(acts, flank.damping * F, 0.0) if flank.damping > 0.0 else None
        return FlankForces(
            F * push, out[:, TANGENT] * push, out[:, CROSS] * push, per_rate, out[:, MOMENT], out[:, CROSS],
            out[:, BEND], F <= 0.0, out[:, BEYOND] > 0.0,
        )  # fmt: skip

    @cached_property
    def _tables(self) -> list[Any]:
        made: list[Any] = []
        for flank in self.flanks:
            if isinstance(flank, CurveFlank):
                made.append(cubics(flank.curve))
                continue
            laws = law_arrays([flank.law])
            made.append((laws.nodes[0], laws.forces[0], laws.touch[0], laws.energies[0], laws.coupling[0]))
        return made

    def __call__(self, theta: Array, speed: float, u: Array, du: Array) -> Pushes:  # noqa: ARG002
        """Forces at the freedoms, what the linear part has taken off."""
        value = np.zeros_like(u)
        by_place = np.zeros((*u.shape, u.shape[1]))
        by_rate = None
        for number, (flank, (d, r)) in enumerate(zip(self.flanks, self.freedoms, strict=True)):
            at = self.flank(number, theta, u, du)
            value[:, d] += flank.mean * u[:, d] - at.force
            by_place[:, d, d] += flank.mean - at.tangent
            by_place[:, d, r] -= flank.sense * at.cross
            if at.per_rate is not None:
                by_rate = np.zeros_like(by_place) if by_rate is None else by_rate
                by_rate[:, d, d] -= at.per_rate
            if at.moment is not None and at.moment_by_approach is not None:
                value[:, r] -= flank.sense * at.moment
                by_place[:, r, d] -= flank.sense * at.moment_by_approach
                by_place[:, r, r] -= at.bend
        return Pushes(value, by_place, by_rate)


def sampled(samples: int) -> Array:
    """(samples,) even places of the period (rad)."""
    return 2.0 * math.pi * np.arange(samples) / samples
