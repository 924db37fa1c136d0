r"""Contact laws: what the pressure at a quadrature point is, given gap and stress there.

All laws share one shape, so one solver serves them (Chouly, Mlika & Renard, *Numer. Math.* 139, 2018):

.. math:: p = \max(0,\; -\gamma g - s\,\sigma_n),

with the gap g (negative where the bodies overlap), the normal stress :math:`\sigma_n` of the body that carries the
point, and the law's parameter :math:`\gamma` (Pa/m). The virtual work of the contact is :math:`\sum_q w_q\, p_q\,
\delta g_q`.

A law provides, and nothing else needs to be touched to add one:

1. ``name``: the text that selects it;
2. ``uses_stress``: s above (0 or 1); with 1 the bodies keep the stress rows of their flanks;
3. ``parameter(youngs_modulus, sizes)``: gamma at the edges of a flank, from the body's modulus (Pa) and its edge
lengths (m); 4. ``sides``: ``both`` (unbiased: each flank carries half of the pressure), ``pinion`` or ``wheel``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError

Array = NDArray[Any]
Sides = Literal["both", "pinion", "wheel"]


class ContactLaw(Protocol):
    """See the module's docstring for what a law must provide."""

    @property
    def name(self) -> str: ...
    @property
    def uses_stress(self) -> bool: ...
    @property
    def sides(self) -> Sides: ...
    def parameter(self, youngs_modulus: float, sizes: Array) -> Array: ...


@dataclass(frozen=True)
class Penalty:
    """p = max(0, -gamma g): simple and fast; the bodies overlap by p/gamma.

    Parameters
    ----------
    stiffness
        gamma (Pa/m); 1e17 Pa/m is 1e8 N/mm3. ``None`` takes 300 E/h with h the largest edge of the flank: steel at
        0.07 mm then overlaps by 2 nm at 1.5 GPa. Far stiffer, the points over-constrain the edges and rounding shows
        in the pressures.
    sides
        One side by default: two would ask twice for the same thing.
    """

    stiffness: float | None = None
    sides: Sides = "pinion"

    @property
    def name(self) -> str:
        return "penalty"

    @property
    def uses_stress(self) -> bool:
        return False

    def parameter(self, youngs_modulus: float, sizes: Array) -> Array:
        """gamma at each edge (Pa/m)."""
        stiffness = self.stiffness
        return np.full(len(sizes), 300 * youngs_modulus / sizes.max() if stiffness is None else stiffness)


@dataclass(frozen=True)
class Nitsche:
    """p = max(0, -sigma_n - gamma g) with gamma = gamma0 E/h: consistent, so the overlap vanishes with the mesh.

    The variant theta = 0: no term in the variation of the stress.

    Parameters
    ----------
    gamma0
        gamma h/E (-); about 1 is the most accurate, far above it the law turns into a stiff penalty.
    """

    gamma0: float = 1.0
    sides: Sides = "both"

    @property
    def name(self) -> str:
        return "nitsche"

    @property
    def uses_stress(self) -> bool:
        return True

    def parameter(self, youngs_modulus: float, sizes: Array) -> Array:
        """gamma at each edge (Pa/m)."""
        return self.gamma0 * youngs_modulus / sizes


#: Selectable laws.
LAWS: dict[str, type[Penalty] | type[Nitsche]] = {"nitsche": Nitsche, "penalty": Penalty}


def law_named(name: str) -> ContactLaw:
    """The law called `name` with its default parameter."""
    if name not in LAWS:
        raise InputError("law", name, "must be one of " + ", ".join(LAWS))
    return LAWS[name]()
