r"""The weak form of the contact as scikit-fem forms on pairs of points.

A contact point x_s of one body and its closest point x_m on the deformed mate form a pair:
:math:`x_s - x_m(\xi) = g\,n(\xi)`. Fields of the first have the index s, those of the second m. Find u such that for
all v (Chouly, Mlika & Renard, *Numer. Math.* 139, 2018, with theta = 0 and the gap g instead of its negative; gamma and
s are those of `gearfe.gears.contact.laws`)

.. math::
    a(u, v) = \ell(v) + \int p\; n\cdot[v], \qquad [v] = v_s - v_m, \qquad p = \max(0,\; -\gamma g - s\,\sigma_n) .

With the mate's tangent :math:`a = x_m'`, :math:`N = n\cdot\delta x_m'` and :math:`\kappa = -a\cdot n'` the variations
are (Laursen, *Computational Contact and Impact Mechanics*, 2002, ch. 5, in two dimensions)

.. math::
    \delta\xi = \frac{a\cdot[v] + g N}{a\cdot a - g\kappa}, \qquad \delta g = n\cdot[v] - (n\cdot a)\,\delta\xi,

    \Delta(n\cdot[v]) = \frac{g}{a\cdot a} N_\Delta N_\delta - \Bigl(1 - \frac{g\kappa}{a\cdot a}\Bigr)
    (N_\Delta\,\delta\xi + N_\delta\,\Delta\xi + \kappa\,\delta\xi\,\Delta\xi) .

The normal is blended between edges (`gearfe.gears.contact.flank`), hence the small n . a; its kinks are left out of the
last formula. In the forms `w` holds, at each pair: g, n, a, kappa; X_xi = dX/dxi of the mate's undeformed edge; gamma
and s; stress_rate P, with which delta sigma_n = P : grad v_s (`.constitution`); p; active, H(p); share, the part of the
stretch of surface of a point that faces the mate; and share_rate, its change with xi at the mate's sharp end.
"""

from __future__ import annotations

from typing import Any

from skfem import BilinearForm, LinearForm
from skfem.helpers import ddot, dot, grad, mul


def trial_pressure(g: Any, sigma_n: Any, gamma: Any, s: float) -> Any:
    """Return -gamma g - s sigma_n, whose positive part is the pressure.

    Parameters
    ----------
    g : field
        Gap (m).
    sigma_n : field
        Normal stress of the surface (Pa).
    gamma : field
        The law's stiffness (Pa/m).
    s : float
        Factor of the normal stress: 1 for Nitsche's law, 0 for the penalty.
    """
    return -gamma * g - s * sigma_n


def normal_jump(v_s: Any, v_m: Any, w: Any) -> Any:
    """n . [v]."""
    return dot(w.n, v_s - v_m)


def tilt(v_m: Any, w: Any) -> Any:
    """N = n . dv_m/dxi."""
    return dot(w.n, mul(grad(v_m), w.X_xi))


def slide(v_s: Any, v_m: Any, w: Any) -> Any:
    """delta xi, the motion of the closest point along the mate."""
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
    """Return Delta(n . [v]), the change of the normal jump with the displacements.

    Parameters
    ----------
    u_s, u_m : field
        Change of the displacements of both bodies.
    v_s, v_m : field
        Test functions of both bodies.
    w : FormExtraParams
        Data of the pairs of points, see the module's docstring.
    """
    tilt_u, tilt_v = tilt(u_m, w), tilt(v_m, w)
    slide_u, slide_v = slide(u_s, u_m, w), slide(v_s, v_m, w)
    bend = w.g / dot(w.a, w.a)
    turned = tilt_u * slide_v + tilt_v * slide_u + w.kappa * slide_u * slide_v
    return bend * tilt_u * tilt_v - (1 - bend * w.kappa) * turned


@LinearForm
def pressure_work(v_s: Any, v_m: Any, w: Any) -> Any:
    """p n . [v]."""
    return w.share * w.p * normal_jump(v_s, v_m, w)


@BilinearForm
def contact_tangent(u_s: Any, u_m: Any, v_s: Any, v_m: Any, w: Any) -> Any:
    """Return the derivative of the work of the pressure.

    Parameters
    ----------
    u_s, u_m : field
        Change of the displacements of both bodies.
    v_s, v_m : field
        Test functions of both bodies.
    w : FormExtraParams
        Data of the pairs of points, see the module's docstring.
    """
    rate = w.share * pressure_rate(u_s, u_m, w) + w.share_rate * slide(u_s, u_m, w) * w.p
    return rate * normal_jump(v_s, v_m, w) + w.share * w.p * turning(u_s, u_m, v_s, v_m, w)
