r"""Contact laws of the oracle: what the pressure is, given gap and stress.

**Laws at points.** :math:`p = \max(0, -\gamma g - s\,\sigma_n)` in the weak form of `gearfe.verification.forms`:
penalty with s = theta = 0, Nitsche's family with s = 1 and theta = 1, 0 or -1 (Chouly, Mlika & Renard, *Numer. Math.*
139, 2018, written with the gap g in place of its negative). For theta = 1 it is the derivative of the energy
:math:`\tfrac12 a(u,u) + \int (p^2 - \sigma_n^2)/(2 \gamma)`, convex only for gamma0 above a bound (some 4 to 20);
theta = -1 converges for every gamma0; theta = 0 has no term in the variation of the stress. Where two sides carry
points, each takes half of the integrals.

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

import math
from dataclasses import dataclass
from typing import ClassVar, Literal, get_args

import numpy as np

from ..errors import InputError
from ..typing import Array

#: Surfaces that carry the contact points: the first of each couple (``pinion``), the second (``wheel``), both with half
#: of the pressure each, or the one whose end, a tooth's tip, is nearer to the contact.
Sides = Literal["both", "pinion", "wheel", "tip"]
Theta = Literal[1, 0, -1]


@dataclass(frozen=True)
class Nitsche:
    """p = max(0, -gamma g - sigma_n) with gamma = gamma0 E/h: consistent, the overlap vanishes with the mesh.

    Parameters
    ----------
    gamma0
        gamma h/E (-).
    """

    gamma0: float = 1.0
    sides: Sides = "both"
    theta: Theta = 0
    name: ClassVar[str] = "nitsche"
    #: s above.
    uses_stress: ClassVar[bool] = True

    def __post_init__(self) -> None:
        _check_sides(self.sides, ("both", "pinion", "wheel"))
        _check_positive("gamma0", self.gamma0, "gamma h/E")
        if self.theta not in get_args(Theta):
            raise InputError("theta", self.theta, "must be 1, 0 or -1", "0 is the cheapest, -1 the most robust")

    def parameter(self, youngs_modulus: float, sizes: Array) -> Array:
        """gamma (Pa/m) at edges of lengths `sizes` (m) of a body of Young's modulus (Pa)."""
        return self.gamma0 * youngs_modulus / sizes


@dataclass(frozen=True)
class Penalty:
    """p = max(0, -gamma g): the bodies overlap by p/gamma.

    Parameters
    ----------
    stiffness
        gamma (Pa/m); ``None`` takes 300 E/h with h the longest edge of the surface.
    """

    stiffness: float | None = None
    sides: Sides = "tip"
    name: ClassVar[str] = "penalty"
    uses_stress: ClassVar[bool] = False
    theta: ClassVar[Theta] = 0

    def __post_init__(self) -> None:
        _check_sides(self.sides, get_args(Sides))
        if self.stiffness is not None:
            _check_positive("stiffness", self.stiffness, "Pa/m, pressure for each metre of overlap")

    def parameter(self, youngs_modulus: float, sizes: Array) -> Array:
        """gamma (Pa/m) at edges of lengths `sizes` (m) of a body of Young's modulus (Pa)."""
        return np.full(len(sizes), 300 * youngs_modulus / sizes.max() if self.stiffness is None else self.stiffness)


@dataclass(frozen=True)
class Exact:
    """No overlap in the mean of each multiplier function, no tension. Two sides would ask twice for the same thing."""

    sides: Sides = "tip"
    name: ClassVar[str] = "exact"
    uses_stress: ClassVar[bool] = False
    theta: ClassVar[Theta] = 0

    def __post_init__(self) -> None:
        _check_sides(self.sides, ("tip", "pinion", "wheel"))

    def parameter(self, youngs_modulus: float, sizes: Array) -> Array:
        """c (Pa/m) of the active set, lambda - c (mean gap) > 0; moves no solution."""
        return youngs_modulus / sizes


ContactLaw = Nitsche | Penalty | Exact


def side_share(law: ContactLaw, side: int) -> float:
    """Part of the pressure's integral that runs over the first (0) or second (1) surface of a couple: 0, 1/2 or 1."""
    if law.sides == "both":
        return 0.5
    return float((law.sides == "wheel") == (side == 1))


def _check_sides(sides: str, allowed: tuple[str, ...]) -> None:
    if sides not in allowed:
        raise InputError("sides", sides, "must be one of " + ", ".join(allowed))


def _check_positive(name: str, value: float, meaning: str) -> None:
    if not (isinstance(value, int | float) and math.isfinite(value) and value > 0):
        raise InputError(name, value, f"must be finite and > 0: {meaning}")
