r"""Force and approach of one rolling element between its raceways.

**Point contact** (Hertz). Two bodies with the curvature sum :math:`\Sigma\rho` and the curvature difference F touch
over an ellipse with the axis ratio :math:`\kappa = a/b`, which solves (T. A. Harris and M. N. Kotzalas, Rolling Bearing
Analysis, 5th ed., 2007, Essential Concepts, ch. 6; ISO/TS 16281:2008, eq. 2)

.. math:: F = 1 - \frac{2 D(m)}{\kappa^2 E(m)},\quad m = 1 - \kappa^{-2},\quad D = \frac{K - E}{m}

with the complete elliptic integrals K and E; Carlson's :math:`R_D` has D without cancellation. The force at the
approach :math:`\delta` is

.. math::
    Q = k\,\delta^{3/2},\quad k = \frac{2}{3}\,\Sigma\rho\,E'\Big(\frac{2}{\Sigma\rho\,\delta^*}\Big)^{3/2},\quad
    \delta^* = \frac{2K}{\pi}\Big(\frac{\pi}{2\kappa^2E}\Big)^{1/3},\quad
    \frac1{E'} = \frac{1-\nu_1^2}{E_1} + \frac{1-\nu_2^2}{E_2} .

**Line contact.** For a steel roller of the effective length L between its two raceways, ISO/TS 16281:2008, eq. 37, has
:math:`Q = c\,L^{8/9}\delta^{10/9}`, a fit to measurements as Palmgren's
(:math:`\delta = 2\cdot3.84\cdot10^{-5} Q^{0.9}/L^{0.8}` in N and mm, which is 3 % stiffer).
"""

from __future__ import annotations

import math

#: Exponents of the force over the approach, of points and of lines.
POINT, LINE = 1.5, 10.0 / 9.0
#: c of a line contact (N/m2 with lengths in m): 35948 N/mm2, ISO/TS 16281:2008.
LINE_CONSTANT = 35948e6
#: Largest logarithm of an axis ratio: contacts longer than this are lines.
_LONGEST = 12.0


def axis_ratio(difference: float) -> float:
    """Return the axis ratio a/b >= 1 of the contact ellipse of bodies with a curvature difference in [0, 1)."""
    if difference <= 0.0:
        return 1.0
    from scipy.optimize import brentq  # 0.25 s, which trains without ball bearings save

    return math.exp(brentq(lambda x: _difference(math.exp(x)) - difference, 0.0, _LONGEST, xtol=1e-14, rtol=1e-14))


def _difference(ratio: float) -> float:
    """Curvature difference of bodies whose contact ellipse has this axis ratio."""
    from scipy.special import ellipe, elliprd

    complement = ratio**-2.0
    return float(1.0 - 2.0 * elliprd(0.0, complement, 1.0) / 3.0 / (ratio**2 * ellipe(1.0 - complement)))


def point_constant(curvature_sum: float, difference: float, modulus: float) -> float:
    """Return k of ``Q = k delta^1.5`` (N/m^1.5).

    Parameters
    ----------
    curvature_sum
        Sum of the four principal curvatures (1/m), concave ones negative.
    difference
        Curvature difference F, in [0, 1).
    modulus
        E' (Pa) of both bodies.
    """
    from scipy.special import ellipe, ellipk

    ratio = axis_ratio(difference)
    m = 1.0 - ratio**-2.0
    first, second = float(ellipk(m)), float(ellipe(m))
    approach = 2.0 * first / math.pi * (math.pi / (2.0 * ratio**2 * second)) ** (1.0 / 3.0)
    return 2.0 / 3.0 * curvature_sum * modulus * (2.0 / (curvature_sum * approach)) ** 1.5


def groove_constant(diameter: float, osculation: float, gamma: float, modulus: float) -> float:
    """Return k (N/m^1.5) of a ball in a groove.

    Parameters
    ----------
    diameter
        Of the ball (m).
    osculation
        Radius of the groove over the diameter of the ball, > 0.5.
    gamma
        Ball diameter times the cosine of the contact angle over the pitch diameter; negative for the outer ring.
    modulus
        E' (Pa).
    """
    rolling = 2.0 * gamma / (1.0 - gamma)
    groove = 1.0 / osculation
    total = 4.0 + rolling - groove
    return point_constant(total / diameter, (rolling + groove) / total, modulus)


def in_series(inner: float, outer: float) -> float:
    """Return k (N/m^1.5) of a ball between both raceways, whose approaches add up at one force."""
    return (inner ** (-1.0 / POINT) + outer ** (-1.0 / POINT)) ** -POINT
