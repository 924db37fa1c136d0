r"""What bodies do inside: forces, tangent and surface stress, at small strain or of Saint Venant-Kirchhoff.

Small strain: :math:`\sigma = C:\varepsilon(u)` on the undeformed bodies. Finite strain, total Lagrangian, with
:math:`F = I + \nabla u`, :math:`E = \tfrac12(F^T F - I)`, :math:`S = C:E` (Bonet & Wood, *Nonlinear Continuum Mechanics
for Finite Element Analysis*, 2008, sec. 6.4),

.. math::
    f(v) = \int F S : \nabla v, \qquad
    K(u, v) = \int \mathrm{sym}(F^T\nabla v) : C : \mathrm{sym}(F^T\nabla u) + (\nabla u\, S):\nabla v .

The reference is each gear as it stands at the given angles, undeformed; the material does not notice that turn. Plane
stress takes the reduced lambda of small strain.

The normal stress that Nitsche's law compares with the pressure is :math:`n_0\cdot\sigma n_0` at small strain. At finite
strain the pressure p acts on the undeformed area along the mate's present normal n, so it is
:math:`-n\cdot F S\, n_0`.
Its change with n is left out of the tangent: without friction FS n_0 is parallel to n at the solution.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix

from .bodies import Bodies

Array = NDArray[np.float64]
Kinematics = Literal["small", "finite"]


class Constitution(Protocol):
    """What the solver asks of the bodies; `w` holds the contact points' fields."""

    def forces(self, u: Array) -> Array: ...
    def tangent(self, u: Array) -> Any: ...
    def normal_stress(self, u: Any, w: Any) -> Any: ...
    def normal_stress_rate(self, u: Any, w: Any) -> Any: ...


@dataclass(frozen=True)
class SmallStrain:
    """Linear elastic bodies with a given stiffness (N/m)."""

    stiffness: Any

    def forces(self, u: Array) -> Array:
        """Internal forces (N)."""
        return np.asarray(self.stiffness @ u)

    def tangent(self, u: Array) -> Any:  # noqa: ARG002 (the protocol's)
        """Their derivative, sparse (N/m)."""
        return self.stiffness

    def normal_stress(self, u: Any, w: Any) -> Any:
        """n0 . sigma(u) n0 with the normal n0 of the undeformed surface."""
        from skfem.helpers import dot, grad, mul, trace

        n0, lam, mu = (w[name] for name in ("slave_normal", "lam", "mu"))
        return lam * trace(grad(u)) + 2 * mu * dot(n0, mul(grad(u), n0))

    def normal_stress_rate(self, u: Any, w: Any) -> Any:
        """Its variation: the same, being linear."""
        return self.normal_stress(u, w)


@dataclass(frozen=True)
class SaintVenantKirchhoff:
    """Hyperelastic bodies; `mesh` has them in their present places, undeformed."""

    bodies: Bodies
    mesh: Any

    @cached_property
    def bases(self) -> list[Any]:
        """Quadrature of degree 4, which integrates the energy's fourth power of grad u, on each body."""
        return self.bodies.bases(self.mesh)

    def forces(self, u: Array) -> Array:
        """Internal forces (N)."""
        from skfem import LinearForm
        from skfem.helpers import ddot, grad, mul

        total = np.zeros(len(u))
        for part, basis in zip(self.bodies.parts, self.bases, strict=True):
            lam, mu = part.material.lame(part.plane)
            h = grad(basis.interpolate(u))
            nominal = part.thickness * mul(_deformation(h), _second_stress(h, lam, mu))
            form = LinearForm(lambda v, w: ddot(w.nominal, grad(v)))
            total += form.assemble(basis, nominal=nominal)
        return total

    def tangent(self, u: Array) -> Any:
        """Their derivative, sparse (N/m): int v_iJ A_iJkL d_kL, A = S_JL d_ik + F_iI C_IJKL F_kK, block by block."""
        total: Any = 0
        for part, basis in zip(self.bodies.parts, self.bases, strict=True):
            lam, mu = part.material.lame(part.plane)
            h = np.asarray(basis.interpolate(u).grad)
            f, s = _deformation(h), _second_stress(h, lam, mu)
            left = np.einsum("iI...,kI...->ik...", f, f)
            # a vector function is a scalar one times a unit vector: dN_a/dX_J, shape (2, elements, points, 6)
            slopes = np.stack([np.asarray(made[0].grad[0]) for made in basis.basis[::2]], axis=-1)
            weight = part.thickness * basis.dx
            blocks = np.empty((basis.nelems, 6, 2, 6, 2))
            for i, k, j in itertools.product(range(2), range(2), range(2)):
                # A_ijkL d_kL, summed over L, for all six functions
                bent = sum(
                    (
                        (i == k) * s[j, m]
                        + lam * f[i, j] * f[k, m]
                        + (j == m) * mu * left[i, k]
                        + mu * f[i, m] * f[k, j]
                    )[..., None]
                    * slopes[m]
                    for m in range(2)
                )
                block = np.matmul(slopes[j].transpose(0, 2, 1), weight[..., None] * bent)
                blocks[:, :, i, :, k] = block if j == 0 else blocks[:, :, i, :, k] + block
            dofs = basis.element_dofs.T
            rows, columns = np.broadcast_arrays(dofs[:, :, None], dofs[:, None, :])
            total = (
                total + coo_matrix((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(len(u), len(u))).tocsr()
            )
        return total

    def normal_stress(self, u: Any, w: Any) -> Any:
        """-n . F S n0 with the mate's present normal n and the undeformed surface's n0."""
        from skfem.helpers import dot, grad, mul

        h = grad(u)
        return -dot(w["n"], mul(mul(_deformation(h), _second_stress(h, w["lam"], w["mu"])), w["slave_normal"]))

    def normal_stress_rate(self, u: Any, w: Any) -> Any:
        """Its variation with u at given n."""
        from skfem.helpers import dot, grad, mul, transpose

        h, d = grad(w["state"]), grad(u)
        f, lam, mu = _deformation(h), w["lam"], w["mu"]
        product = mul(transpose(f), d)
        strain = 0.5 * (product + transpose(product))
        rate = mul(d, _second_stress(h, lam, mu)) + mul(f, _isotropic(strain, lam, mu))
        return -dot(w["n"], mul(rate, w["slave_normal"]))


def _deformation(h: Any) -> Any:
    """F = I + grad u."""
    f = np.array(h)
    f[0, 0] += 1.0
    f[1, 1] += 1.0
    return f


def _second_stress(h: Any, lam: Any, mu: Any) -> Any:
    """S = C : E of the displacement gradient h."""
    h = np.asarray(h)
    strain = 0.5 * (h + np.swapaxes(h, 0, 1) + np.einsum("kI...,kJ...->IJ...", h, h))
    return _isotropic(strain, lam, mu)


def _isotropic(strain: Any, lam: Any, mu: Any) -> Any:
    """lam tr(E) I + 2 mu E."""
    stress = 2 * mu * np.asarray(strain)
    trace = lam * (strain[0, 0] + strain[1, 1])
    stress[0, 0] += trace
    stress[1, 1] += trace
    return stress
