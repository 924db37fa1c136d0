r"""Contact laws of the oracle: what the pressure is, given gap and stress.

**Laws at points.** :math:`p = \max(0, -\gamma g - s\,\sigma_n)` in the weak form of `tests.verification.forms`:
those of `gearfe.contact.laws` with theta = 0, and Nitsche's family with s = 1 and theta = 1, 0 or -1 (Chouly, Mlika &
Renard, *Numer. Math.* 139, 2018, written with the gap g in place of its negative). For theta = 1 it is the derivative
of the energy :math:`\tfrac12 a(u,u) + \int (p^2 - \sigma_n^2)/(2 \gamma)`, convex only for gamma0 above a bound (some
4 to 20); theta = -1 converges for every gamma0; theta = 0 has no term in the variation of the stress. Where two sides
carry points, each takes half of the integrals.

**The exact law.** The pressure is :math:`p = \sum_i \lambda_i\psi_i` with

.. math::
    \lambda_i \ge 0, \qquad \int \psi_i\, g \ge 0, \qquad \lambda_i \int \psi_i\, g = 0 ,

and basis :math:`\psi_i` that are linear on the halves of the quadratic edges of one surface, one for each of its nodes.
They are not negative, so neither are the pressures. Stability: for :math:`\lambda = \sum \lambda_i \psi_i` take the
displacement :math:`v = \sum \lambda_i N_i` with the same nodal values. On each edge the symmetric part of :math:`\int
\psi_i N_j` is positive definite, so :math:`\int \lambda v \ge c \lVert\lambda\rVert^2` with one c for all meshes, and
the inf-sup condition follows (Wohlmuth, *Acta Numerica* 20, 2011, sec. 3; linear multipliers on halves of quadratic
edges: Puso, Laursen & Solberg, *Comput. Methods Appl. Mech. Eng.* 197, 2008).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal, get_args

import numpy as np

from gearfe.contact import laws
from gearfe.contact.laws import ElementLaw, Penalty, Sides, carrying, check_sides
from gearfe.errors import InputError
from gearfe.typing import Array

__all__ = ["Exact", "Nitsche", "Penalty", "shares_of", "theta_of"]

Theta = Literal[1, 0, -1]


@dataclass(frozen=True)
class Nitsche(laws.Nitsche):
    """Nitsche's family."""

    theta: Theta = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.theta not in get_args(Theta):
            raise InputError("theta", self.theta, "must be 1, 0 or -1", "0 is the cheapest, -1 the most robust")


@dataclass(frozen=True)
class Exact:
    """No overlap in the mean of each multiplier function, no tension. Two sides would ask twice for the same thing."""

    sides: Sides = "tip"
    name: ClassVar[str] = "exact"
    uses_stress: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_sides(self.sides, ("tip", "pinion", "wheel"))

    def parameter(self, youngs_modulus: float, sizes: Array) -> Array:
        """c (Pa/m) of the active set, lambda - c (mean gap) > 0; moves no solution."""
        return youngs_modulus / sizes


def theta_of(law: ElementLaw) -> Theta:
    """theta above."""
    return law.theta if isinstance(law, Nitsche) else 0


def shares_of(law: ElementLaw, to_end: Array) -> Array:
    """Parts of the pressure's integral over either surface of couples, whose contacts lie `to_end` (m) from the ends of
    these, both of shape (m, 2): 0, 1/2 or 1.
    """
    bears = carrying(law, to_end)
    return np.asarray(bears / bears.sum(axis=1, keepdims=True))
