"""A ring on an off-centre web against brick elements of scikit-fem, which share nothing with the extruded body."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from skfem import Basis, BilinearForm, ElementHex2, ElementVector, FacetBasis, LinearForm, MeshHex, MeshHex2, condense
from skfem import solve as solved
from skfem.helpers import ddot, eye, sym_grad, trace

from gearfe.fem.extruded import Layers, condense_extruded, lobatto_functions, section_integrals
from gearfe.fem.multifrontal import unknowns_of
from gearfe.fem.plane import Material, second_order

STEEL = Material()
#: Radii of bore, hub, rim, and outside (m); half of the face width; the web along the axis (m).
RADII = BORE, HUB, RIM, OUTSIDE = 10e-3, 14e-3, 24e-3, 28e-3
HALF, WEB = 10e-3, (3e-3, 8e-3)


def pressure(angle, z):
    """Radial pulls (Pa) on the outer circle round angle 0: even along the axis, and in proportion to z."""
    around = np.maximum(np.cos(angle), 0.0) ** 4
    return 1e6 * around, 1e6 * around * z / HALF


def divided(marks, count):
    """Ends of elements, so many between two marks each, closer to each other near them."""
    share = 0.5 - 0.5 * np.cos(np.pi * np.linspace(0, 1, count + 1))
    parts = [low + (high - low) * share[:-1] for low, high in itertools.pairwise(marks)]
    return np.concatenate([*parts, marks[-1:]])


def compliance_of_bricks(radial, around, along):
    """Work (J) of each load on the displacements by each, shape (2, 2): half of the ring, mirrored at its cut."""
    r, z = divided(RADII, radial), divided([-HALF, 0.5 * (WEB[0] - HALF), *WEB, HALF], along)
    mesh = MeshHex.init_tensor(r, np.linspace(0.0, np.pi, around + 1), z)
    centre = mesh.p[:, mesh.t].mean(axis=1)
    web = (centre[0] > HUB) & (centre[0] < RIM)
    mesh = mesh.restrict(np.flatnonzero(~web | ((centre[2] > WEB[0]) & (centre[2] < WEB[1]))))
    marks = {
        "bore": mesh.facets_satisfying(lambda x: np.isclose(x[0], BORE)),
        "outside": mesh.facets_satisfying(lambda x: np.isclose(x[0], OUTSIDE)),
        "cut": mesh.facets_satisfying(lambda x: np.isclose(x[1], 0.0) | np.isclose(x[1], np.pi)),
    }
    curved = MeshHex2.from_mesh(mesh)
    r, angle, z = curved.doflocs
    curved = MeshHex2(np.stack([r * np.cos(angle), r * np.sin(angle), z]), curved.t)
    element = ElementVector(ElementHex2())
    basis = Basis(curved, element, intorder=5)
    lam, mu = STEEL.lame()

    @BilinearForm
    def stiffness(u, v, _):
        strain = sym_grad(u)
        return ddot(lam * eye(trace(strain), 3) + 2 * mu * strain, sym_grad(v))

    def load(number):
        def pulled(v, w):
            angle = np.arctan2(w.x[1], w.x[0])
            return pressure(angle, w.x[2])[number] * (np.cos(angle) * v[0] + np.sin(angle) * v[1])

        return LinearForm(pulled).assemble(FacetBasis(curved, element, facets=marks["outside"], intorder=6))

    held = np.concatenate([basis.get_dofs(marks["bore"]).all(), basis.get_dofs(marks["cut"]).all("u^2")])
    matrix, loads = stiffness.assemble(basis), [load(0), load(1)]
    moved = [solved(*condense(matrix, one, D=held)) for one in loads]
    return 2.0 * np.array([[one @ other for other in moved] for one in loads])


def compliance_of_layers(radial, around, orders):
    """The same by an extruded body whose section has a web."""
    r, angle = divided(RADII, radial), 2 * np.pi * np.arange(around) / around
    n = len(r)
    corners = np.stack([np.outer(np.cos(angle), r).ravel(), np.outer(np.sin(angle), r).ravel()], axis=1)
    cells = [
        (n * i + j, n * i + j + 1, n * ((i + 1) % around) + j + 1, n * ((i + 1) % around) + j)
        for i in range(around)
        for j in range(n - 1)
    ]
    triangles = np.array([t for a, b, c, d in cells for t in ((a, b, c), (a, c, d))])
    points, quadratic, edges = second_order(corners, triangles)
    plane = points @ np.array([1, 1j])
    ends = plane[edges]
    radius = np.abs(ends).mean(axis=1)
    plane[len(corners) :] = radius * np.exp(1j * (np.angle(ends[:, 0]) + 0.5 * np.angle(ends[:, 1] / ends[:, 0])))
    points = np.stack([plane.real, plane.imag], axis=1)
    centre = np.abs(plane[quadratic[:, :3]].mean(axis=1))
    functions = lobatto_functions([-HALF, *WEB, HALF], orders)
    bore = np.flatnonzero(np.isclose(np.abs(plane), BORE))
    factor = condense_extruded(
        points, quadratic, section_integrals(points, quadratic, STEEL), (functions, functions),
        retained=bore[:0], fixed=bore, layers=Layers((centre > HUB) & (centre < RIM), WEB),
    )  # fmt: skip
    outside = np.flatnonzero(np.isclose(np.abs(plane), OUTSIDE))
    outside = outside[np.argsort(np.angle(plane[outside]) % (2 * np.pi))]
    at, count = np.angle(plane[outside]), functions.count
    middle = ~(outside < len(corners))
    share = OUTSIDE * 2 * np.pi / around * np.where(middle, 2 / 3, 1 / 3)  # Simpson's rule
    loads = np.zeros((len(outside), 3 * count, 2))
    for number in (0, 1):
        along = np.stack([pressure(0.0, z)[number] * np.ones(1) for z in functions.points])[:, 0]
        axial = (functions.weights * along) @ functions.values
        size = share * np.maximum(np.cos(at), 0.0) ** 4
        loads[:, :count, number] = np.outer(size * np.cos(at), axial)
        loads[:, count : 2 * count, number] = np.outer(size * np.sin(at), axial)
    forward, _ = factor.reduced_loads(unknowns_of(outside, 3 * count), loads.reshape(-1, 2))
    return forward.T @ forward


def test_rim_on_an_off_centre_web_yields_as_bricks_do():
    """Both loads on both displacements; their coupling is that of the off-centre web, and vanishes without one."""
    bricks = compliance_of_bricks(1, 10, 1)
    layers = compliance_of_layers(1, 16, [5, 3, 3])
    assert np.abs(bricks[0, 1]) > 0.4 * bricks[0, 0]
    assert np.abs(layers / bricks - 1.0).max() < 0.03


def test_layers_over_the_whole_axis_change_nothing():
    functions = lobatto_functions([-HALF, HALF], [3])
    every, narrow = Layers(np.array([False, True]), (-HALF, HALF)).groups(functions)
    assert np.array_equal(every[1], narrow[1])


@pytest.mark.slow
def test_bricks_and_layers_approach_each_other():
    """Both are too stiff on coarse meshes, at the edges where the web meets rim and hub."""
    coarse = compliance_of_layers(1, 24, [5, 3, 3]) / compliance_of_bricks(1, 10, 1) - 1.0
    fine = compliance_of_layers(3, 40, [9, 6, 5]) / compliance_of_bricks(3, 18, 3) - 1.0
    assert np.abs(fine).max() < 0.5 * np.abs(coarse).max()
    assert np.abs(fine).max() < 5e-3
