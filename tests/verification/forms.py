r"""The contact's weak form as scikit-fem forms on pairs of points.

A contact point x_s of one body and its closest point x_m on the deformed mate, :math:`x_s - x_m(\xi) = g\,n(\xi)`, form
a pair; fields of the first carry the index s, those of the second m. For all v (`tests.verification.laws`)

.. math::
    a(u, v) - \int \frac{\theta}{\gamma}\,\sigma_n(u)\,\sigma_n(v)
    = \ell(v) + \int p\; n\cdot[v] + \int \frac{\theta}{\gamma}\,p\,\sigma_n(v), \qquad
    [v] = v_s - v_m, \qquad p = \max(0,\; -\gamma g - s\,\sigma_n) .

With the mate's tangent :math:`a = x_m'`, :math:`N = n\cdot\delta x_m'` and :math:`\kappa = -a\cdot n'` the variations
are (Laursen, *Computational Contact and Impact Mechanics*, 2002, ch. 5, in two dimensions)

.. math::
    \delta\xi = \frac{a\cdot[v] + g N}{a\cdot a - g\kappa}, \qquad \delta g = n\cdot[v] - (n\cdot a)\,\delta\xi,

    \Delta(n\cdot[v]) = \frac{g}{a\cdot a} N_\Delta N_\delta - \Bigl(1 - \frac{g\kappa}{a\cdot a}\Bigr)
    (N_\Delta\,\delta\xi + N_\delta\,\Delta\xi + \kappa\,\delta\xi\,\Delta\xi) .

The normal is blended between edges (`gearfe.contact.flank`), hence the small n . a; its kinks are left out of the
last formula. In the forms `w` holds, at each pair: g, n, a, kappa; X_xi = dX/dxi of the mate's undeformed edge; gamma,
s and theta; stress_rate P, with which delta sigma_n = P : grad v_s (`tests.verification.constitution`); p; active,
H(p); and share, the part of a point's stretch of surface that faces the mate, which changes with xi at its sharp end.
"""

from __future__ import annotations

from typing import Any

from skfem import BilinearForm, LinearForm
from skfem.helpers import ddot, dot, grad, mul


def trial_pressure(g: Any, sigma_n: Any, gamma: Any, s: float) -> Any:
    """-gamma g - s sigma_n; the pressure is its positive part."""
    return -gamma * g - s * sigma_n


def normal_jump(v_s: Any, v_m: Any, w: Any) -> Any:
    """n . [v]."""
    return dot(w.n, v_s - v_m)


def tilt(v_m: Any, w: Any) -> Any:
    """N = n . dv_m/dxi."""
    return dot(w.n, mul(grad(v_m), w.X_xi))


def slide(v_s: Any, v_m: Any, w: Any) -> Any:
    """delta xi, how the closest point moves along the mate."""
    return (dot(w.a, v_s - v_m) + w.g * tilt(v_m, w)) / (dot(w.a, w.a) - w.g * w.kappa)


def gap_rate(v_s: Any, v_m: Any, w: Any) -> Any:
    """delta g."""
    return normal_jump(v_s, v_m, w) - dot(w.n, w.a) * slide(v_s, v_m, w)


def normal_stress_rate(v_s: Any, w: Any) -> Any:
    """delta sigma_n."""
    return ddot(w.stress_rate, grad(v_s))


def pressure_rate(v_s: Any, v_m: Any, w: Any) -> Any:
    """delta p."""
    return -w.active * (w.gamma * gap_rate(v_s, v_m, w) + w.s * normal_stress_rate(v_s, w))


def turning(u_s: Any, u_m: Any, v_s: Any, v_m: Any, w: Any) -> Any:
    """Delta(n . [v])."""
    tilt_u, tilt_v = tilt(u_m, w), tilt(v_m, w)
    slide_u, slide_v = slide(u_s, u_m, w), slide(v_s, v_m, w)
    bend = w.g / dot(w.a, w.a)
    turned = tilt_u * slide_v + tilt_v * slide_u + w.kappa * slide_u * slide_v
    return bend * tilt_u * tilt_v - (1 - bend * w.kappa) * turned


@LinearForm
def pressure_work(v_s: Any, v_m: Any, w: Any) -> Any:
    """p n . [v]."""
    return w.share * w.p * normal_jump(v_s, v_m, w)


@LinearForm
def stress_work(v_s: Any, v_m: Any, w: Any) -> Any:
    """theta/gamma p sigma_n(v)."""
    return w.share * w.p * w.theta / w.gamma * normal_stress_rate(v_s, w)


@BilinearForm
def contact_tangent(u_s: Any, u_m: Any, v_s: Any, v_m: Any, w: Any) -> Any:
    """Derivative of both."""
    rate = w.share * pressure_rate(u_s, u_m, w) + w.share_rate * slide(u_s, u_m, w) * w.p
    tested = normal_jump(v_s, v_m, w) + w.theta / w.gamma * normal_stress_rate(v_s, w)
    return rate * tested + w.share * w.p * turning(u_s, u_m, v_s, v_m, w)


@BilinearForm
def stress_term(u: Any, v: Any, w: Any) -> Any:
    """theta/gamma sigma_n(u) sigma_n(v)."""
    return w.theta / w.gamma * normal_stress_rate(u, w) * normal_stress_rate(v, w)


@LinearForm
def gap_change(v_s: Any, v_m: Any, w: Any) -> Any:
    """delta g where the surface faces the mate."""
    return w.share * gap_rate(v_s, v_m, w)


@LinearForm
def unit_pressure_work(v_s: Any, v_m: Any, w: Any) -> Any:
    """n . [v] where the surface faces the mate."""
    return w.share * normal_jump(v_s, v_m, w)
