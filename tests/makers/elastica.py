"""Large deflections of a cantilever in closed form."""

from __future__ import annotations

import math

from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc


def elastica(load: float) -> tuple[float, float, float]:
    """x, y and angle at the tip of a cantilever of unit length and EI under a force `load` across it.

    Bisshopp & Drucker, Quart. Appl. Math. 3 (1945) 272-275, with elliptic integrals.
    """

    def integrals(slope: float) -> tuple[float, float]:
        k2 = (1.0 + math.sin(slope)) / 2.0
        phi = math.asin(1.0 / math.sqrt(2.0 * k2))
        return ellipk(k2) - ellipkinc(phi, k2), ellipe(k2) - ellipeinc(phi, k2)

    slope = brentq(lambda p: integrals(p)[0] - math.sqrt(load), 1e-9, math.pi / 2 - 1e-12, xtol=1e-15)
    first, second = integrals(slope)
    return math.sqrt(2.0 * math.sin(slope) / load), 1.0 - 2.0 * second / first, slope
