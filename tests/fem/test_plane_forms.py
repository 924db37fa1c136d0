"""Plane elasticity against scikit-fem: the batched arrays of `gearfe.fem.plane` are the weak forms written here."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from skfem import CellBasis, ElementTriP2, ElementVector, Functional, MeshTri2
from skfem.helpers import ddot, eye, grad, mul, sym_grad, trace, transpose

from gearfe.fem.plane import (
    Material,
    Plane,
    element_stiffness,
    finite_strain_rates,
    physical_gradients,
    stress_rows,
    triangle_rule,
)
from gearfe.gears.contact.whole_gears.bodies import stiffness_form
from tests.makers.contact_cases import STEEL, WIDTH, meshes

#: Corner and middle nodes of the three points of degree 2 that the finite strain is integrated with.
THREE = np.array([[1, 4, 1], [1, 1, 4]]) / 6, np.full(3, 1 / 6)


def plane_basis(quadrature: Any) -> tuple[Any, Any, np.ndarray]:
    """Sector mesh of a gear, scikit-fem's basis on its curved triangles, and its unknowns of each node."""
    sector = meshes("modified", 5.0)[0]
    mesh = MeshTri2(np.ascontiguousarray(sector.points.T), np.ascontiguousarray(sector.triangles.T))
    basis = CellBasis(mesh, ElementVector(ElementTriP2()), quadrature=quadrature)
    unknowns = np.empty((len(sector.points), 2), dtype=np.int64)
    unknowns[sector.triangles] = basis.element_dofs.T.reshape(-1, 6, 2)
    return sector, basis, unknowns


def stress(strain: Any, material: Material, plane: Plane) -> Any:
    """lam tr(E) I + 2 mu E."""
    lam, mu = material.lame(plane)
    return lam * eye(trace(strain), 2) + 2 * mu * strain


@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_element_stiffness_is_the_form_of_each_triangle(plane: Plane) -> None:
    r, s, weights, *_ = triangle_rule()
    sector, basis, _ = plane_basis((np.stack([r, s]), weights))
    blocks = element_stiffness(sector.points[sector.triangles], STEEL, plane, WIDTH)
    form = stiffness_form(STEEL, plane, WIDTH).elemental(basis).data.reshape(12, 12, -1)
    np.testing.assert_allclose(form, blocks.transpose(1, 2, 0), rtol=0, atol=1e-13 * np.abs(blocks).max())


@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_stress_rows_are_the_stress_of_a_field(plane: Plane) -> None:
    r, s, weights, _, slopes = triangle_rule()
    sector, basis, unknowns = plane_basis((np.stack([r, s]), weights))
    u = np.random.default_rng(0).standard_normal(unknowns.size)
    gradients = physical_gradients(sector.points[sector.triangles], slopes)[0]
    rows = stress_rows(gradients, STEEL, plane)
    of_rows = np.einsum("mqsai,mai->smq", rows, u[unknowns[sector.triangles]])
    of_form = np.asarray(stress(sym_grad(basis.interpolate(u)), STEEL, plane))
    expected = np.stack([of_form[0, 0], of_form[1, 1], of_form[0, 1]])
    np.testing.assert_allclose(of_rows, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_finite_strain_rates_are_the_rate_of_the_energy(plane: Plane) -> None:
    """int sigma(eps) : eta with eta = grad u^T grad u / 2 is cubic in u: two differences give its exact rate."""
    sector, basis, unknowns = plane_basis(THREE)
    generator = np.random.default_rng(1)
    u, rate = generator.standard_normal((2, unknowns.size))

    @Functional
    def extra_energy(w: Any) -> Any:
        h = grad(w["u"])
        return WIDTH * ddot(stress(0.5 * (h + transpose(h)), STEEL, plane), 0.5 * mul(transpose(h), h))

    def energy(step: float) -> float:
        return float(extra_energy.assemble(basis, u=basis.interpolate(u + step * rate)))

    half, whole = ((energy(step) - energy(-step)) / (2 * step) for step in (0.5, 1.0))
    expected = (4 * half - whole) / 3
    fields = np.stack([u[unknowns], rate[unknowns]], axis=-1)
    found = finite_strain_rates(sector.points, sector.triangles, fields, STEEL, plane, WIDTH)
    assert found == pytest.approx([expected], rel=1e-10)
