r"""Flexibility of the gear bodies between rigid bore and teeth: their twist, and their bending by the axial force.

*Twist.* Under a torque T a disc of the width b that is held at the radius :math:`r_0` turns at the root circle
:math:`r_f` by :math:`T\,|1/r_0^2 - 1/r_f^2|/(4\pi G b)` (Timoshenko and Goodier, *Theory of Elasticity*, 3rd ed., 1970,
art. 43). Along the line of action that is times :math:`r_b^2/T`.

*Bending.* The axial force :math:`F_{bt}\tan\beta_b` of a helical gear bends its body as a plate by Mindlin's theory
(J. Appl. Mech. 18, 1951), clamped at :math:`r_0` and loaded at its free edge, the reference circle r. Deflection
:math:`w\cos n\theta` and rotations :math:`\psi_r\cos n\theta`, :math:`\psi_\theta\sin n\theta` minimise

.. math::
    \int\left[D\left(\kappa_r^2 + \kappa_\theta^2 + 2\nu\kappa_r\kappa_\theta
    + \tfrac{1-\nu}{2}\kappa_{r\theta}^2\right) + \tfrac56 G b\,(\gamma_r^2 + \gamma_\theta^2)\right]\tfrac r2\,dr
    - \text{load}, \quad
    D = \frac{E b^3}{12(1-\nu^2)}

with :math:`\kappa_r = \psi_r'`, :math:`\kappa_\theta = (\psi_r + n\psi_\theta)/r`,
:math:`\kappa_{r\theta} = \psi_\theta' - (\psi_\theta + n\psi_r)/r`, :math:`\gamma_r = \psi_r + w'`,
:math:`\gamma_\theta = \psi_\theta - n w/r`. The force is even over the zone of contact, 2 c long, so along the line of
action the flexibility is :math:`\tan^2\beta_b\sum_n w_n(r)\,[\sin(n c/r)/(n c/r)]^2`. It leaves out the teeth.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.polynomial import legendre

from ...base.typing import Array
from ...fem.plane import Material
from ..geometry.mesh_geometry import MeshGeometry
from ..geometry.spur_gear import Gear

#: Harmonics of the force along the edge, and polynomials along the radius. Twice as many change the sum by 3e-4.
HARMONICS, POLYNOMIALS = 40, 16


def body_twist(gear: Gear, material: Material) -> float:
    """Return the flexibility (m/N) of a gear by the twist of its body between the held circle and the root circle.

    It acts along the line of action. NaN for a ring with a free rim, and for a rim on a web.
    """
    if not _solid(gear):
        return math.nan
    stretch = abs(1.0 / gear.held_radius**2 - 1.0 / gear.root_radius**2)
    return gear.base_radius**2 * stretch / (4.0 * math.pi * _shear_modulus(material) * gear.face_width)


def body_bending(gear: Gear, material: Material, zone: float) -> float:
    """Return the flexibility (m/N) of a gear by the bending of its body under the axial force.

    Parameters
    ----------
    gear : Gear
        The gear.
    material : Material
        Of the gear.
    zone : float
        Length of the zone of contact along the reference circle (m), see `contact_zone`.

    Returns
    -------
    float
        Along the line of action; 0 for spur gears, NaN for a ring with a free rim and for a rim on a web.
    """
    if not _solid(gear):
        return math.nan
    if not gear.helical:
        return 0.0
    radius, order = gear.reference_radius, np.arange(HARMONICS)
    spread = np.sinc(order * 0.5 * zone / (math.pi * radius)) ** 2
    deflections = edge_deflections(gear.held_radius, radius, gear.face_width, material)
    return math.tan(gear.base_helix_angle) ** 2 * float(spread @ deflections)


def contact_zone(pair: MeshGeometry) -> float:
    """Return the length of the zone of contact (m): path of contact plus the advance of the helix over the width."""
    return pair.contact_ratio * pair.base_pitch + pair.common_width * abs(math.tan(pair.pinion.base_helix_angle))


def edge_deflections(clamped: float, edge: float, thickness: float, material: Material) -> Array:
    r"""Return the deflection at a force on the free edge of a clamped annular plate, by its harmonics.

    Parameters
    ----------
    clamped, edge : float
        Radii of the clamped circle, inside or outside, and of the loaded edge (m).
    thickness : float
        Of the plate (m).
    material : Material
        Of the plate.

    Returns
    -------
    ndarray, shape (HARMONICS,)
        Parts :math:`\cos n\theta` of the deflection (m/N), n = 0, 1, ...
    """
    E, nu = material.youngs_modulus, material.poisson_ratio
    bending, shear = E * thickness**3 / 12.0 / (1.0 - nu**2), 5.0 / 6.0 * _shear_modulus(material) * thickness
    place, weight = legendre.leggauss(POLYNOMIALS + 2)
    half = 0.5 * (edge - clamped)
    r = clamped + half * (1.0 + place)
    # Legendre polynomials, integrated from the clamped circle: the first is 2 at the edge, the others 0
    rate = legendre.legvander(place, POLYNOMIALS - 1) / half
    value = legendre.legvander(place, POLYNOMIALS) @ legendre.legint(np.eye(POLYNOMIALS), lbnd=-1)
    over, zero = value / r[:, None], np.zeros_like(value)
    load = np.zeros(3 * POLYNOMIALS)
    load[0] = 2.0
    deflections = []
    for n in range(HARMONICS):
        area = (math.pi * (1.0 if n else 2.0) * abs(half) * weight * r)[:, None]
        # strains by the amounts of the polynomials of w, psi_r and psi_theta
        radial, around = np.hstack([zero, rate, zero]), np.hstack([zero, over, n * over])
        warped = np.hstack([zero, -n * over, rate - over])
        sheared = np.vstack([np.hstack([rate, value, zero]), np.hstack([-n * over, zero, value])])
        stiffness = bending * ((radial + nu * around).T @ (area * radial) + (around + nu * radial).T @ (area * around))
        stiffness += 0.5 * (1.0 - nu) * bending * warped.T @ (area * warped)
        stiffness += shear * sheared.T @ (np.vstack([area, area]) * sheared)
        scale = 1.0 / np.sqrt(np.diag(stiffness))
        amounts = np.linalg.solve(stiffness * np.outer(scale, scale), load * scale) * scale
        deflections.append(float(load @ amounts))
    return np.array(deflections)


def _solid(gear: Gear) -> bool:
    return gear.narrow_web is None and not (gear.internal and gear.rim == "free")


def _shear_modulus(material: Material) -> float:
    return material.youngs_modulus / (2.0 * (1.0 + material.poisson_ratio))
