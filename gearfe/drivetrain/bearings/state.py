r"""Forces and stiffness of a rolling bearing at a displacement.

Every contact stores the energy :math:`V = c\,s_+^{n+1}/(n+1)`, with the approach s of `gearfe.drivetrain.bearings
.geometry`. The load is the gradient of their sum, the stiffness its second derivative:

.. math::
    F = \sum Q\,\nabla s,\quad K = \sum Q'\,\nabla s\,\nabla s^T + Q\,\nabla^2 s,\quad Q = c\,s_+^n .

The approach of a ball, a distance of two points that move linearly with u, is convex in u; that of a roller is linear.
So K is positive semi-definite, and the equilibrium under a load is unique.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.typing import Array
from .geometry import BallBearing, RollerBearing

#: Elements that carry less than this part of the largest load of an element are not counted as loaded.
LEAST = 1e-6
#: A bearing with fewer loaded elements than this does not support its shaft.
FEWEST = 2


@dataclass(frozen=True, eq=False)
class BearingState:
    """A rolling bearing at a displacement.

    Attributes
    ----------
    displacement : ndarray, shape (5,)
        u: along e1, a, e2 (m), tilts about e1, e2 (rad).
    energy
        J.
    load : ndarray, shape (5,)
        What the shaft exerts on the bearing: forces (N), moments (N m).
    stiffness : ndarray, shape (5, 5)
        Derivative of the load (N/m, N, N m/rad).
    element_loads : ndarray, shape (rows * elements,)
        Load of each rolling element (N).
    astray
        Whether a loaded ball of a bearing with a contact angle has run to the side of its grooves that has no shoulder.
    """

    displacement: Array
    energy: float
    load: Array
    stiffness: Array
    element_loads: Array
    astray: bool = False

    @property
    def loaded(self) -> int:
        """Number of loaded rolling elements."""
        most = float(self.element_loads.max(initial=0.0))
        return int((self.element_loads > LEAST * most).sum())

    @property
    def unloaded(self) -> bool:
        """Whether the bearing does not support its shaft."""
        return self.loaded < FEWEST


def deflected(bearing: BallBearing | RollerBearing, displacement: Array) -> BearingState:
    """Return the state of a bearing at u: along e1, a, e2 (m), tilts about e1, e2 (rad)."""
    contacts, u = bearing.contacts, np.asarray(displacement, dtype=float)
    vector = contacts.begin + np.stack([contacts.radial @ u, contacts.axial @ u], axis=-1)
    if contacts.normal is None:
        length = np.linalg.norm(vector, axis=1)
        direction = vector / length[:, None]
    else:
        direction = contacts.normal
        length = np.einsum("ni,ni->n", direction, vector)
    approach = np.maximum(length - contacts.distance, 0.0)
    force = contacts.constant * approach**contacts.exponent
    slope = contacts.constant * contacts.exponent * approach ** (contacts.exponent - 1.0) * (approach > 0.0)
    gradient = direction[:, :1] * contacts.radial + direction[:, 1:] * contacts.axial
    stiffness = gradient.T @ (slope[:, None] * gradient)
    astray = False
    if contacts.normal is None:
        crossed = direction[:, 1] * contacts.begin[:, 1] < 0.0
        astray = bearing.contact_angle != 0.0 and bool((crossed & (force > 0.0)).any())
        across = -direction[:, 1:] * contacts.radial + direction[:, :1] * contacts.axial
        stiffness += across.T @ ((force / length)[:, None] * across)
    load = gradient.T @ force
    energy = float(force @ approach) / (contacts.exponent + 1.0)
    if isinstance(bearing, RollerBearing):
        stiffness[1, 1] += bearing.axial_stiffness
        load[1] += bearing.axial_stiffness * u[1]
        energy += 0.5 * bearing.axial_stiffness * float(u[1]) ** 2
    elements = np.bincount(contacts.element, weights=force, minlength=bearing.count)
    return BearingState(u, energy, load, 0.5 * (stiffness + stiffness.T), elements, astray)
