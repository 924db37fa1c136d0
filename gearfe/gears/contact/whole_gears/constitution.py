r"""Internal forces, tangent and surface stress of bodies, at small strain or of Saint Venant-Kirchhoff.

Small strain: :math:`\sigma = C:\varepsilon(u)` on the undeformed bodies. Finite strain, total Lagrangian, with
:math:`h = \nabla u`, :math:`F = I + h`, :math:`E = \mathrm{sym}\,h + \tfrac12 h^T h`, :math:`S = C:E`
(Bonet & Wood, *Nonlinear Continuum Mechanics for Finite Element Analysis*, 2008, sec. 6.4),

.. math::
    f(v) = \int F S : \nabla v, \qquad
    K(u, v) = \int \mathrm{sym}(F^T\nabla u) : C : \mathrm{sym}(F^T\nabla v) + (\nabla u\, S):\nabla v .

The reference is each undeformed body in its present place: the material is isotropic, so its turn changes nothing.
Plane stress takes the reduced lambda of small strain.

The normal stress that Nitsche's law compares with the pressure is :math:`n_0\cdot\sigma n_0` at small strain. At finite
strain the pressure acts on the undeformed area along the present normal n of the mate, so it is
:math:`-n\cdot F S\, n_0`. Its change with n is left out of the tangent: without friction F S n_0 is parallel to n at
the solution.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from skfem import BilinearForm, LinearForm
from skfem.helpers import ddot, dot, eye, grad, mul, prod, trace, transpose

from ....base.typing import Array
from .bodies import Bodies

Kinematics = Literal["small", "finite"]


@dataclass(frozen=True)
class SmallStrain:
    """Linear elastic bodies with a given stiffness (N/m)."""

    stiffness: Any

    def forces(self, u: Array) -> Array:
        """Return the internal forces (N)."""
        return np.asarray(self.stiffness @ u)

    def tangent(self, u: Array) -> Any:  # noqa: ARG002
        """Return their derivative, sparse (N/m)."""
        return self.stiffness

    def surface_stress(self, h: Array, n: Array, n0: Array, lam: Array, mu: Array) -> tuple[Array, Array]:  # noqa: ARG002
        """Return sigma_n = n0 . sigma n0 at points of the surface, and P with delta sigma_n = P : grad v.

        Parameters
        ----------
        h : ndarray, shape (2, 2, q, 1)
            grad u.
        n, n0 : ndarray, shape (2, q, 1)
            Present normal of the mate, and outward normal of the undeformed surface.
        lam, mu : ndarray, shape (q, 1)
            Lame constants (Pa).
        """
        rate = np.asarray(eye(lam, 2) + 2 * mu * prod(n0, n0))
        return ddot(rate, h), rate


@LinearForm
def internal_work(v: Any, w: Any) -> Any:
    """F S : grad v."""
    return w.thickness * ddot(mul(w.F, w.S), grad(v))


@BilinearForm
def internal_tangent(u: Any, v: Any, w: Any) -> Any:
    """sym(F^T grad u) : C : sym(F^T grad v) + (grad u S) : grad v."""
    strain_u, strain_v = _sym(mul(transpose(w.F), grad(u))), _sym(mul(transpose(w.F), grad(v)))
    return w.thickness * (ddot(isotropic(strain_u, w.lam, w.mu), strain_v) + ddot(mul(grad(u), w.S), grad(v)))


@dataclass(frozen=True)
class SaintVenantKirchhoff:
    """Hyperelastic bodies; `mesh` holds them undeformed, in their present places.

    `remainder` is the stiffness of parts that are condensed away, at small strain (N/m, sparse).
    """

    bodies: Bodies
    mesh: Any
    remainder: Any

    @cached_property
    def bases(self) -> list[Any]:
        """Quadrature of degree 4, which integrates the energy's fourth power of grad u, on each body."""
        return self.bodies.bases(self.mesh)

    def forces(self, u: Array) -> Array:
        """Return the internal forces (N)."""
        return np.asarray(self._assembled(internal_work, u) + self.remainder @ u)

    def tangent(self, u: Array) -> Any:
        """Return their derivative, sparse (N/m)."""
        return self._assembled(internal_tangent, u) + self.remainder

    def _assembled(self, form: Any, u: Array) -> Any:
        total: Any = 0
        for part, basis in zip(self.bodies.parts, self.bases, strict=True):
            lam, mu = part.material.lame(part.plane)
            f, s = deformation(np.asarray(basis.interpolate(u).grad), lam, mu)
            total = total + form.assemble(basis, F=f, S=s, lam=lam, mu=mu, thickness=part.thickness)
        return total

    def surface_stress(self, h: Array, n: Array, n0: Array, lam: Array, mu: Array) -> tuple[Array, Array]:
        """Return the normal stress on the surface and its rate, as P with delta sigma_n = P : grad v.

        sigma_n = -n . F S n0; with b = F^T n, delta sigma_n = -n . grad v S n0 - b . (C : sym(F^T grad v)) n0.

        Parameters
        ----------
        h : ndarray, shape (2, 2, q, 1)
            grad u.
        n, n0 : ndarray, shape (2, q, 1)
            Present normal of the mate, and outward normal of the undeformed surface.
        lam, mu : ndarray, shape (q, 1)
            Lame constants (Pa).
        """
        f, s = deformation(h, lam, mu)
        b = mul(transpose(f), n)
        rate = prod(n, mul(s, n0)) + lam * dot(b, n0) * f + mu * (prod(mul(f, b), n0) + prod(mul(f, n0), b))
        return -dot(n, mul(mul(f, s), n0)), -rate


def deformation(h: Array, lam: Any, mu: Any) -> tuple[Array, Array]:
    """Return F = I + grad u and S = C : E of h = grad u.

    E is sym(h) + h^T h / 2: the difference F^T F - I leaves only nine digits of a strain of 1e-7.
    """
    strain = _sym(h) + 0.5 * mul(transpose(h), h)
    return eye(np.ones(h.shape[2:]), 2) + h, isotropic(strain, lam, mu)


def isotropic(strain: Array, lam: Any, mu: Any) -> Array:
    """Return C : E = lam tr(E) I + 2 mu E."""
    return np.asarray(eye(lam * trace(strain), 2) + 2 * mu * strain)


def _sym(a: Array) -> Array:
    return 0.5 * (a + transpose(a))
