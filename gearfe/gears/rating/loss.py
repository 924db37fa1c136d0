r"""Loss factor of a gear pair, ISO/TR 15144-1:2014 after Ohlendorf (Niemann/Winter, Maschinenelemente II).

With the load shared evenly where two pairs touch, sliding takes the share :math:`\mu_m H_V` of the power:

.. math::
    \varepsilon_{1,2} = \frac{z_{1,2}}{2\pi}\,(\tan\alpha_{a1,2} - \tan\alpha_{wt}), \quad
    H_V = \frac{\pi\,(u + 1)}{z_1 u\cos\beta_b}\,(1 - \varepsilon_\alpha + \varepsilon_1^2 + \varepsilon_2^2).

That is where one pair alone touches at the pitch point. Where that formula does not hold, as with many planets and
rings, the same mean of load share times sliding is taken. It is
:math:`H_V = \frac{2\pi(u + 1)}{z_1 u\cos\beta_b}\int X|x|\,dx` over the path from :math:`-\varepsilon_2` to
:math:`\varepsilon_1` base pitches from the pitch point, X = 1/2 where two pairs touch.

The power lost, :math:`P_V = P\mu_m H_V`, has the mean coefficient of friction of ISO/TS 6336-21.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from .data import PairData
from .ledger import cited

_SOURCE = "ISO/TR 15144-1:2014"


@dataclass(frozen=True)
class Loss:
    """Parts of the contact ratio and loss factor."""

    eps: tuple[float, float] = cited("addendum contact ratios", f"{_SOURCE}, loss factor")
    H_V: float = cited("loss factor: sliding takes mu_m H_V of the power", f"{_SOURCE}, loss factor")
    P_V_W: float | None = cited("power that sliding takes", "P mu_m H_V, mu_m of ISO/TS 6336-21", "W")


def loss(pair: PairData, heat: float | None = None) -> Loss:
    """Return the loss factor of a pair with a transverse contact ratio below 3.

    `heat`: power of the mesh times the mean coefficient of friction (W), None: not known.
    """
    one, two = (
        z / (2.0 * math.pi) * (math.sqrt((d_a / d_b) ** 2 - 1.0) - math.tan(pair.alpha_wt))
        for z, d_a, d_b in zip(pair.z, pair.d_a, pair.d_b, strict=True)
    )

    def moment(x: float) -> float:
        """Integral of |x| from 0 (base pitches squared)."""
        return 0.5 * x * abs(x)

    # half of the load on the whole path, and again half of it where one pair alone touches
    shared = moment(one) - moment(-two)
    if one + two < 2.0:
        shared += moment(1.0 - two) - moment(one - 1.0)
    else:  # a sixth less where three pairs touch; `shared` is twice the integral
        shared -= sum(moment(one - 2.0 + i) - moment(-two + i) for i in range(3)) / 3.0
    H_V = math.pi * (pair.u + 1.0) / (pair.z[0] * pair.u * math.cos(pair.beta_b)) * shared
    return Loss(eps=(one, two), H_V=H_V, P_V_W=None if heat is None else heat * H_V)
