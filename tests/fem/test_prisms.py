"""Extruded elements of order 3: exactness, surfaces, convergence, and the estimate of their error."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from gearfe.base.tables.housing import FeetTable, HousingMeshTable, HousingReductionTable, HousingTable, ShaftAxisTable
from gearfe.drivetrain.housing.build import housing_from_table, inside_faces
from gearfe.drivetrain.housing.model import rigid_motions
from gearfe.fem.bodies.mesh_checks import boundary_faces
from gearfe.fem.bodies.meshes import Prisms
from gearfe.fem.bodies.surface import nodal_normals
from gearfe.fem.meshing.housing_mesh import Extrusion, housing_mesh
from gearfe.fem.plane import Material
from gearfe.fem.prisms import LATTICE, ORDER
from gearfe.fem.reduction.error import mesh_error
from gearfe.fem.reduction.lanczos import lowest_modes
from gearfe.fem.reduction.sparse_solver import factorize
from tests.makers.housing_meshes import surface_area

STEEL = Material()
#: Errors of frequencies fall with the elements' thickness at inner right angles to this power (Williams 1952).
RATE = 2.0 * 0.544
#: A small bracket: one shaft, walls and base with all the re-entrant edges of the large ones.
BRACKET = HousingTable(
    wall_x_mm=(-30.0, 30.0),
    wall_z_mm=(-40.0, 22.0),
    inner_gap_mm=30.0,
    wall_thickness_mm=(6.0, 5.0),
    base_thickness_mm=10.0,
    shafts=(ShaftAxisTable(x_mm=0.0),),
    feet=FeetTable(length_x_mm=15.0, width_y_mm=12.0, height_mm=8.0),
    mesh=HousingMeshTable(size_mm=12.0),
    reduction=HousingReductionTable(modes=15, band_Hz=8000.0),
)


@pytest.fixture(scope="module")
def bracket() -> Prisms:
    return Prisms(housing_mesh(BRACKET))


def block(cells: tuple[int, int, int], size: tuple[float, float, float], bend: float = 0.0) -> Prisms:
    """The box 0..size of equal elements; `bend` moves the nodes within the plane of x and z."""
    nx, ny, nz = cells
    x, z = (np.linspace(0.0, s, ORDER * n + 1) for s, n in zip((size[0], size[2]), (nx, nz), strict=True))
    points = np.stack(np.meshgrid(x, z, indexing="ij"), axis=-1).reshape(-1, 2)
    lattice = np.rint(ORDER * LATTICE).astype(np.int64)
    triangles = []
    for i in range(nx):
        for k in range(nz):
            for start, side in (((0, 0), 1), ((ORDER, ORDER), -1)):
                at = np.array([ORDER * i, ORDER * k]) + start + side * lattice
                triangles.append(at[:, 0] * (ORDER * nz + 1) + at[:, 1])
    a, b = (points / (size[0], size[2])).T
    bump = bend * np.sin(np.pi * a) * np.sin(np.pi * b)
    points = points + np.column_stack([bump, -0.7 * bump])
    levels = np.linspace(0.0, size[1], ORDER * ny + 1)
    return Prisms(Extrusion(points, np.array(triangles), levels, np.ones((ny, len(triangles)), dtype=bool)))


def volume_mm3(table: HousingTable) -> float:
    """Volume of the bracket by hand."""
    (x0, x1), (z0, z1) = table.wall_x_mm, table.wall_z_mm
    depth, shaft, feet = table.inner_gap_mm + sum(table.wall_thickness_mm), table.shafts[0], table.feet
    made = (x1 - x0) * (z1 - z0) * sum(table.wall_thickness_mm) + (x1 - x0) * depth * table.base_thickness_mm
    made += 4.0 * feet.length_x_mm * feet.width_y_mm * feet.height_mm
    ring = math.pi * (shaft.boss_radius_mm**2 - shaft.bore_radius_mm**2)
    made += 2.0 * ring * shaft.boss_height_mm - math.pi * shaft.bore_radius_mm**2 * sum(table.wall_thickness_mm)
    return made


def test_mass_rigid_motions_and_symmetry(bracket: Prisms) -> None:
    made = bracket.assemble(STEEL)
    assert made.nodal_mass.sum() == pytest.approx(1e-9 * 7850.0 * volume_mm3(BRACKET), rel=5e-5)
    size = abs(made.stiffness).max()
    assert np.abs(made.stiffness @ rigid_motions(bracket.nodes)).max() < 1e-12 * size
    assert abs(made.stiffness - made.stiffness.T).max() < 1e-12 * size
    lost = bracket.energy_lost(STEEL, rigid_motions(bracket.nodes), np.zeros(6), [])
    assert np.abs(lost).max() < 1e-20 * STEEL.youngs_modulus


def test_patch(bracket: Prisms) -> None:
    """A linear field loads no node inside, and has the energy of its uniform stress, arcs and all."""
    made = bracket.assemble(STEEL)
    gradient = np.random.default_rng(3).standard_normal((3, 3))
    field = (bracket.nodes @ gradient.T).ravel()
    force = (made.stiffness @ field).reshape(-1, 3)
    inside = np.setdiff1d(np.arange(len(bracket.nodes)), boundary_faces(bracket.cells))
    assert len(inside) > 500
    assert np.abs(force[inside]).max() < 1e-11 * np.abs(force).max()
    strain = 0.5 * (gradient + gradient.T)
    density = STEEL.lame()[0] * np.trace(strain) ** 2 + 2.0 * STEEL.shear_modulus * np.sum(strain**2)
    volume = made.nodal_mass.sum() / STEEL.density
    assert field @ made.stiffness @ field == pytest.approx(density * volume, rel=1e-10)


def test_cubic_fields_are_exact() -> None:
    """Bending by a force at the end (Timoshenko, Goodier, Theory of Elasticity, sec. 21), nu = 0."""
    soft = Material(poisson_ratio=0.0)
    mesh = block((2, 1, 2), (0.4, 0.1, 0.2))
    x, _, z = mesh.nodes.T
    z = z - 0.1
    # u = -x^2 z / 2 + z^3 / 3 - c^2 z, w = x^3 / 6, sigma_xz = -G (c^2 - z^2), c the half height
    field = np.column_stack([-(x**2) * z / 2.0 + z**3 / 3.0 - 0.01 * z, 0.0 * x, x**3 / 6.0]).ravel()
    force = (mesh.assemble(soft).stiffness @ field).reshape(-1, 3)
    ends = (np.abs(x) < 1e-12) | (np.abs(x - 0.4) < 1e-12)
    assert np.abs(force[~ends]).max() < 1e-11 * np.abs(force).max()
    assert (
        mesh.energy_lost(soft, field[:, None], np.zeros(1), [np.flatnonzero(ends)])[0, 0]
        < 1e-15 * field @ force.ravel()
    )


def test_outer_surface(bracket: Prisms) -> None:
    """What rigid motions push aside is the area of the outer faces along each axis, by hand."""
    surface = bracket.surface([], lambda centres: ~inside_faces(BRACKET, centres))
    squares = np.diag(surface.radiation(np.tile(np.eye(3), (len(bracket.nodes), 1))))
    (x0, x1), (z0, z1), feet, shaft = BRACKET.wall_x_mm, BRACKET.wall_z_mm, BRACKET.feet, BRACKET.shafts[0]
    thickness = sum(BRACKET.wall_thickness_mm)
    depth, r = BRACKET.inner_gap_mm + thickness, shaft.bore_radius_mm
    # of mantles half is seen along x and half along z; those of the bores count here
    mantles = 2.0 * math.pi * shaft.boss_radius_mm * shaft.boss_height_mm
    mantles += math.pi * r * (thickness + 2.0 * shaft.boss_height_mm)
    across_x = 2.0 * ((z1 - z0) * thickness + depth * BRACKET.base_thickness_mm) + mantles
    walls = (x1 - x0) * (z1 - z0) - math.pi * r**2 + (x1 - x0) * BRACKET.base_thickness_mm  # outer faces, one side
    # seen along y: both outer faces, and both sides of the feet, whose outer ones are flush with the walls
    across_y = 2.0 * (walls + 4.0 * feet.length_x_mm * feet.height_mm)
    across_z = (x1 - x0) * (thickness + depth) + 8.0 * feet.length_x_mm * feet.width_y_mm + mantles
    np.testing.assert_allclose(1e6 * squares, [across_x, across_y, across_z], rtol=2e-4)


def test_shown_cells_fill_the_body(bracket: Prisms) -> None:
    """Wedges between the nodes: volume but for the arcs, a closed surface that looks outward."""
    p = bracket.nodes[bracket.cells]
    tets = [(0, 1, 2, 3), (1, 2, 3, 4), (2, 3, 4, 5)]
    volume = sum(np.abs(np.linalg.det(p[:, [b, c, d]] - p[:, [a]])).sum() for a, b, c, d in tets) / 6.0
    assert 1e9 * volume == pytest.approx(volume_mm3(BRACKET), rel=3e-3)
    faces = boundary_faces(bracket.cells)
    a, b, c = (bracket.nodes[faces[:, k]] for k in range(3))
    assert 1e9 * np.sum(a * np.cross(b, c)) / 6.0 == pytest.approx(1e9 * volume, rel=1e-9)  # Gauss' theorem
    whole = bracket.surface([])
    assert surface_area(bracket.nodes, whole.faces) == pytest.approx(surface_area(bracket.nodes, faces), rel=1e-12)
    shaft, wall = BRACKET.shafts[0], 0.5e-3 * BRACKET.inner_gap_mm + 1e-3 * BRACKET.wall_thickness_mm[0]
    x, y, z = bracket.nodes.T
    mantle = (np.abs(np.hypot(x, z) - 1e-3 * shaft.boss_radius_mm) < 1e-6) & (y > wall + 1e-3) & (y < y.max() - 1e-3)
    radial = np.column_stack([x, 0.0 * x, z])[mantle] / (1e-3 * shaft.boss_radius_mm)
    assert len(radial) > 20
    np.testing.assert_allclose(nodal_normals(bracket.nodes, whole.faces)[mantle], radial, atol=0.05)
    box = block((2, 1, 1), (0.2, 0.1, 0.1))
    assert surface_area(box.nodes, box.surface([]).faces) == pytest.approx(0.1, rel=1e-12)


def clamped(cells: tuple[int, int, int], size: tuple[float, float, float], bend: float = 0.0) -> tuple[np.ndarray, ...]:
    """First six frequencies (rad/s) of a box held at x = 0, and what the estimate takes off their squares, in parts."""
    mesh = block(cells, size, bend)
    held = np.flatnonzero(mesh.nodes[:, 0] < 1e-9)
    free = (3 * np.flatnonzero(mesh.nodes[:, 0] > 1e-9)[:, None] + np.arange(3)).ravel()
    found = mesh.assemble(STEEL)
    k, m = found.stiffness.tocsr()[free][:, free], found.mass[free][:, free]
    modes = lowest_modes(factorize(k).solve, m, count=6)
    fields = np.zeros((mesh.nodes.size, 6))
    fields[free] = modes.vectors
    lost = np.diag(mesh.energy_lost(STEEL, fields, modes.eigenvalues, [held])) / modes.eigenvalues
    return np.sqrt(modes.eigenvalues), lost


@pytest.mark.parametrize(
    ("cells", "size", "bend"),
    [
        ((3, 1, 1), (0.4, 0.1, 0.1), 0.0),
        ((3, 1, 1), (0.4, 0.1, 0.1), 0.01),
        ((2, 1, 2), (0.2, 0.02, 0.2), 0.0),
        ((2, 2, 1), (0.2, 0.2, 0.02), 0.0),
    ],
    ids=["beam", "distorted beam", "plate across the layers", "plate along them"],
)
def test_estimate_covers_clamped_beams_and_plates(
    cells: tuple[int, int, int], size: tuple[float, float, float], bend: float
) -> None:
    """The truth's mesh errs as well, by less than a third of the coarse one's."""
    coarse, lost = clamped(cells, size, bend)
    truth, _ = clamped(tuple(3 * n for n in cells), size, bend)  # type: ignore[arg-type]
    true, estimate = coarse / truth - 1.0, np.sqrt(1.0 + lost) - 1.0
    assert np.all(true > 0.0)
    assert np.all(true < estimate), estimate / true
    assert np.median(estimate / true) < 5.0


def test_estimate_falls_at_the_rate_of_singular_edges() -> None:
    """Below h^1.42: alpha is 0.711 where a clamped face meets a free one at a right angle (Williams 1952)."""
    (_, one), (_, two) = (clamped((3 * n, n, n), (0.4, 0.1, 0.1)) for n in (1, 2))
    assert 1.05 < np.log2(one[0] / two[0]) < 1.5


def test_bracket_against_thin_elements() -> None:
    """Frequencies and responses against elements that are a quarter as thick at the re-entrant edges."""
    body = housing_from_table(BRACKET).reduce()
    thin = dataclasses.replace(BRACKET, mesh=HousingMeshTable(size_mm=3.0))
    truth = housing_from_table(thin).reduce(modes=15, estimate=False)
    true = body.coupled.frequencies_hz[:8] / truth.coupled.frequencies_hz[:8] - 1.0
    true /= 1.0 - (3.0 / 12.0) ** RATE  # the truth errs, too
    told = mesh_error(body, 8000.0).frequency_errors[:8]
    assert np.all(true > 0.0)
    assert np.all(true < told), told / true
    assert np.median(told / true) < 5.0
