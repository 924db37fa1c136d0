r"""What line loads on a half-plane and on a wedge do to their surface, without any mesh.

**Half-plane** (Flamant): a line load f per width at t moves the surface at s by :math:`-\tfrac{2}{\pi E'}\ln|s-t|\,f`
plus a constant, with :math:`E' = E/(1-\nu^2)` in plane strain and E in plane stress.

**Wedge** (Michell): a load at the corner of a wedge of half angle :math:`\alpha` moves points at the distance y from
the corner by :math:`-\tfrac{1}{E'}\,A\ln y\,f` with the tensor

.. math:: A = \mathrm{diag}\Big(\frac{1}{\alpha+\tfrac12\sin 2\alpha},\;\frac{1}{\alpha-\tfrac12\sin 2\alpha}\Big)

along and across its middle (Timoshenko & Goodier, *Theory of Elasticity*, sec. 38). A flank that ends in a corner is a
half-plane seen from near and a wedge seen from far,

.. math::
    u(s) \approx -\tfrac{1}{E'}\Big(\tfrac2\pi\ln|s-t|\,I + W\ln(y(s)+y(t))\Big) f, \qquad W = A - \tfrac2\pi I .

What the exact wedge (Mellin's transform) has besides is bounded, nothing at a right angle, and changes the torques of
sharp tips by at most 0.006 %: left out.
"""

from __future__ import annotations

import math

import numpy as np

from ..typing import Array

#: Rule that averages over an elliptic pressure on |x| < 1: Gauss-Chebyshev of the second kind, exact for polynomials of
#: degree 2 n - 1.
POINTS = 24
_TURN = math.pi * np.arange(1, POINTS + 1) / (POINTS + 1)
ELLIPSE_X = np.cos(_TURN)
ELLIPSE_W = np.sin(_TURN) ** 2 * 2.0 / (POINTS + 1)


def wedge_tensor(half_angle: float) -> Array:
    """W along (first) and across (second) the middle of a wedge, shape (2,) (-)."""
    sine = 0.5 * math.sin(2 * half_angle)
    return np.array([1 / (half_angle + sine), 1 / (half_angle - sine)]) - 2 / math.pi


def mean_log(x: Array, half_width: Array) -> Array:
    """Mean of ln|x - s| over an elliptic pressure on |s| < half_width, both in m.

    Inside it is ln(a/2) - 1/2 + (x/a)^2, outside what makes the surface of Hertz's contact.
    """
    r = np.abs(x) / half_width
    out = np.maximum(r, 1.0)
    far = out**2 - out * np.sqrt(out**2 - 1) + np.arccosh(out)
    return np.asarray(np.log(half_width / 2) - 0.5 + np.where(r <= 1.0, r**2, far))


def log_integral(z: Array) -> Array:
    """Integral of ln|z|: z ln|z| - z."""
    return z * np.log(np.where(z != 0, np.abs(z), 1.0)) - z
