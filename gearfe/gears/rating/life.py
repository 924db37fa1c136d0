r"""Strength over the number of load cycles: life factors of ISO 6336-2 and -3, and the permissible stress between.

A stress number has its static value up to :math:`N_{stat}` cycles and its reference value at :math:`N_{ref}`. Between
them the strength is a straight line of logarithms (ISO 6336-2:2006, 5.4; ISO 6336-3:2006, 5.4). From :math:`N_{ref}` on
it falls to the factor 0.85 at :math:`10^{10}` cycles. With optimum lubrication, material and manufacture, proven by
experience, it stays at 1 (Tables 2 and 1). Beyond :math:`10^{10}` cycles it does not fall further.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

from . import materials

#: Cycles to which the life factors are given.
LAST = 1e10


@dataclass(frozen=True)
class LifeCurve:
    """A life factor over the number of cycles.

    Attributes
    ----------
    points
        Numbers of cycles and life factors from the static one to the reference one, which is 1.
    last
        Life factor at 1e10 cycles.
    """

    points: tuple[tuple[float, float], ...]
    last: float

    @property
    def static_cycles(self) -> float:
        """N_stat."""
        return self.points[0][0]

    @property
    def reference_cycles(self) -> float:
        """N_ref."""
        return self.points[-1][0]

    @property
    def static(self) -> float:
        """Life factor of static load."""
        return self.points[0][1]

    def at(self, cycles: float) -> float:
        """Life factor at a number of cycles."""
        knots = [*self.points, (LAST, self.last)]
        return _interpolated(knots, cycles)

    def strength(self, cycles: float, static: float, reference: float) -> float:
        """Return the strength at a number of cycles (N/mm^2).

        Parameters
        ----------
        cycles : float
            Number of load cycles.
        static, reference : float
            Strength for static load, and with the life factor 1 (N/mm^2).
        """
        # between both the factors of the table are scaled, in logarithms, to what both strengths leave
        scale = math.log(static / reference) / math.log(self.static) if self.static != 1.0 else 0.0
        knots = [(n, reference * factor**scale) for n, factor in self.points]
        return _interpolated([*knots, (LAST, reference * self.last)], cycles)

    def cycles_at(self, stress: float, static: float, reference: float) -> float:
        """Number of cycles that a stress (N/mm^2) is borne for; infinite below the strength at 1e10 cycles."""
        if stress > static:
            return 0.0
        if stress <= self.strength(LAST, static, reference):
            return math.inf
        low, high = math.log(self.static_cycles), math.log(LAST)
        for _ in range(200):
            middle = 0.5 * (low + high)
            borne = self.strength(math.exp(middle), static, reference) >= stress
            low, high = (middle, high) if borne else (low, middle)
        return math.exp(low)


@dataclass(frozen=True)
class FatigueCurve:
    """S-N curve of the flank or the root of a gear: life factors, static and reference strength (N/mm^2)."""

    life: LifeCurve
    static: float
    reference: float

    def cycles(self, stress: float) -> float:
        """Number of cycles that a stress (N/mm^2) is borne for."""
        return self.life.cycles_at(stress, self.static, self.reference)


def _interpolated(knots: list[tuple[float, float]], cycles: float) -> float:
    """Value on straight lines of logarithms through knots, constant beyond their ends."""
    if cycles <= knots[0][0]:
        return knots[0][1]
    for (n0, y0), (n1, y1) in pairwise(knots):
        if cycles <= n1:
            share = math.log(cycles / n0) / math.log(n1 / n0)
            return y0 * (y1 / y0) ** share
    return knots[-1][1]


def flank_life(material: str, last: float, *, pitting: bool = False) -> LifeCurve:
    """Z_NT of a material, ISO 6336-2:2006, Table 2; `last`: its value at 1e10 cycles, `pitting`: some is allowed."""
    if material in materials.SOFT_IRON or material in ("NT", "NV"):
        return LifeCurve(((1e5, 1.3), (2e6, 1.0)), last)
    if material == "NV_nitrocar":
        return LifeCurve(((1e5, 1.1), (2e6, 1.0)), last)
    if pitting:
        return LifeCurve(((6e5, 1.6), (1e7, 1.3), (1e9, 1.0)), last)
    return LifeCurve(((1e5, 1.6), (5e7, 1.0)), last)


def root_life(material: str, last: float) -> LifeCurve:
    """Y_NT of a material, ISO 6336-3:2006, Table 1; `last`: its value at 1e10 cycles."""
    if material in materials.SOFT_IRON or material in ("NT", "NV"):
        return LifeCurve(((1e3, 1.6), (3e6, 1.0)), last)
    if material == "NV_nitrocar":
        return LifeCurve(((1e3, 1.1), (3e6, 1.0)), last)
    if material in ("Eh", "IF"):
        return LifeCurve(((1e3, 2.5), (3e6, 1.0)), last)
    return LifeCurve(((1e4, 2.5), (3e6, 1.0)), last)
