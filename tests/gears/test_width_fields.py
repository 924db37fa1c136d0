"""Fields in space on gears with face widths: energy, stress and pressure by second routes, and the files."""

from __future__ import annotations

import math
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from gearfe.cli.main import main
from gearfe.fem.extruded import elasticity
from gearfe.fem.plane import triangle_rule, triangle_shapes
from gearfe.gears.contact.flank import edge_shapes
from gearfe.gears.contact.flank_compliance import local_bracket
from gearfe.gears.contact.panels import EDGES
from gearfe.gears.gearmesh.fields import half_plane_stress
from gearfe.gears.gearmesh.width_fields import SolidField, ellipse_stress, line_contacts, solid_fields
from gearfe.gears.gearmesh.width_root import line_loads
from gearfe.gears.width import WidthSweep, sweep_width
from tests.makers.wide_gears import HELICAL_JOB, helical_lines

TORQUE = 100.0


@lru_cache
def fields() -> tuple[WidthSweep, tuple[SolidField, SolidField]]:
    """A position of the helical pair, and its fields."""
    sweep = sweep_width(helical_lines(), [TORQUE], angles=[0.1])
    ((_, found),) = solid_fields(helical_lines(), sweep, [(0, 0)])
    return sweep, found


def gradients(field: SolidField, places: np.ndarray, z: np.ndarray, low: int) -> tuple[np.ndarray, np.ndarray]:
    """Gradients of the displacement in space at places of the wedges above a level, and the volume per unit weight."""
    plane, plane_slopes = triangle_shapes(*places.T)
    axial, axial_slopes, _ = edge_shapes(z)
    slopes = np.concatenate([
        np.einsum("qai,qb->qbai", plane_slopes, axial), np.einsum("qa,qb->qba", plane, axial_slopes)[..., None]
    ], axis=-1).reshape(len(places), 18, 3)  # fmt: skip
    at, moved = (
        np.concatenate([values[low + level][field.triangles] for level in range(3)], axis=1)
        for values in (field.points, field.displacement)
    )
    jacobian = np.einsum("qai,max->mqix", slopes, at, optimize=True)
    along = np.einsum("qai,max->mqix", slopes, moved, optimize=True)
    found = np.einsum("mqji,mqix->mqjx", np.linalg.inv(jacobian), along)
    return found.swapaxes(-1, -2), np.linalg.det(jacobian)


def voigt(gradient: np.ndarray) -> np.ndarray:
    strain = gradient + gradient.swapaxes(-1, -2)
    diagonal = 0.5 * np.stack([strain[..., i, i] for i in range(3)], axis=-1)
    return np.concatenate([diagonal, strain[..., [1, 0, 0], [2, 2, 1]]], axis=-1)


@pytest.mark.parametrize("gear", [0, 1])
def test_strain_energy_is_the_work_of_the_loads(gear: int) -> None:
    """Wedges in space, integrated over the whole gear, against the influence of the contact's own sections."""
    sweep, found = fields()
    lines, field = helical_lines(), found[gear]
    side, mesh = lines.compliance.sides[gear], lines.compliance.mesh
    pairs, of_point = np.unique(sweep.points.pair, return_inverse=True)
    loads = line_loads(lines, sweep, gear, of_point, len(pairs))
    size = loads[0].size
    k = len(side.local.stations)
    every = np.kron(np.ones((k, k)), 2 / math.pi * np.eye(2) + side.local.wedge)
    bracket = local_bracket(side.local) - math.log(lines.compliance.length) * every
    bracket = side.local.inverse_modulus * bracket.reshape(k, 2, k, 2)
    work = 0.0
    for i, j in np.ndindex(len(pairs), len(pairs)):
        step = int(pairs[i] - pairs[j]) * (1 - 2 * gear)
        influence = side.influence[abs(step)].reshape(size, size)
        work += 0.5 * loads[i].ravel() @ (influence if step >= 0 else influence.T) @ loads[j].ravel()
        if i == j:
            work -= 0.5 * np.einsum("kin,kilj,ljn->", loads[i], bracket, loads[j])
    law, energy = elasticity(mesh.materials[gear]), 0.0
    r, s, area, *_ = triangle_rule(4)
    t, length = np.polynomial.legendre.leggauss(3)
    for low in range(0, len(field.z) - 2, 2):
        for height, share in zip(0.5 * (t + 1), 0.5 * length, strict=True):
            gradient, volume = gradients(field, np.stack([r, s], axis=1), np.full(len(r), height), low)
            strain = voigt(gradient)
            energy += (
                0.5 * share * float(np.einsum("mq,q,mqi,ij,mqj->", volume, area, strain, law, strain, optimize=True))
            )
    assert energy == pytest.approx(work, rel=2e-3)


def test_stress_is_that_of_the_displacement_in_space() -> None:
    """Away from contacts: gradients of the wedges at their nodes, averaged over the elements there."""
    _, found = fields()
    for gear, field in enumerate(found):
        law = elasticity(helical_lines().compliance.mesh.materials[gear])
        low, n = len(field.z) // 2 - (len(field.z) // 2) % 2, field.points.shape[1]
        corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.0], [0.5, 0.5], [0.0, 0.5]])
        gradient, _ = gradients(field, corners, np.full(6, 0.5), low)
        stress = voigt(gradient) @ law
        sums, counts = np.zeros((n, 6)), np.bincount(field.triangles.ravel(), minlength=n)
        np.add.at(sums, field.triangles.ravel(), stress.reshape(-1, 6))
        middle = field.points[low + 1]
        centre = gear * helical_lines().compliance.mesh.sections.wheel_centre
        section = helical_lines().compliance.mesh.gears[gear]
        radius = np.hypot(middle[:, 0] - centre, middle[:, 1])
        # below the fillets, where the sections' displacement by bumps is all there is
        below = radius < section.root_radius - 0.5 * section.module
        off = np.abs(sums / counts[:, None] - field.stress[low + 1])[below]
        assert off.max() < 0.02 * np.abs(field.stress[low + 1][below]).max()


def test_pressure_carries_the_torque() -> None:
    """Nodal pressures times shares of flank and width: line loads at the levels, by the base radii, and the torque."""
    sweep, found = fields()
    mesh = helical_lines().compliance.mesh
    for gear, field in enumerate(found):
        edges = np.sort(field.triangles[:, [[0, 3], [3, 1], [1, 4], [4, 2], [2, 5], [5, 0]]].reshape(-1, 2), axis=1)
        pieces, uses = np.unique(edges, axis=0, return_counts=True)
        outline = pieces[uses == 1]
        places = field.points[..., :2] - [gear * mesh.sections.wheel_centre, 0.0]
        squares = (places**2).sum(axis=-1)[:, outline]
        # moment of a pressure on a straight piece: p (x dx + y dy) = p d(r^2)/2
        moments = field.pressure[:, outline].mean(axis=-1) * np.abs(np.diff(squares, axis=-1)[..., 0]) / 2.0
        loads = sum(contact.line_load for contact in line_contacts(helical_lines(), sweep, (0, 0), field.z))
        expected = np.trapezoid(loads, field.z) * mesh.gears[gear].base_radius
        assert np.trapezoid(moments.sum(axis=1), field.z) == pytest.approx(expected, rel=0.02)
        assert expected == pytest.approx(TORQUE * mesh.gears[gear].base_radius / mesh.gears[1].base_radius, rel=0.01)


def test_seen_from_the_other_side() -> None:
    """Half a turn about x: the same stresses and volumes, with y and z reversed."""
    _, (field, _) = fields()
    other = field.mirrored()
    assert (np.diff(other.z) > 0.0).all()
    assert np.allclose(other.von_mises[::-1], field.von_mises, rtol=1e-12)
    assert np.allclose(other.principal[::-1], field.principal, rtol=1e-6, atol=1.0)
    middle = np.array([[1 / 3, 1 / 3]])
    for low in (0, len(field.z) - 3):
        turned, volume = gradients(other, middle, np.array([0.5]), low)
        known, expected = gradients(field, middle, np.array([0.5]), len(field.z) - 3 - low)
        assert np.allclose(volume, expected, rtol=1e-9)
        assert volume.min() > 0.0
        sign = np.array([1.0, -1.0, -1.0])
        assert np.allclose(turned, known * np.outer(sign, sign), rtol=1e-6, atol=1e-12)


def test_elliptic_pressure_is_that_of_its_panels() -> None:
    shares = np.diff(EDGES * np.sqrt(1 - EDGES**2) + np.arcsin(EDGES)) / np.pi
    half, force = 2e-4, 1e5
    x, z = (grid.ravel() for grid in np.meshgrid(np.linspace(-6e-4, 6e-4, 13), np.linspace(5e-5, 1e-3, 7)))
    panels = half_plane_stress(x, z, half * EDGES, force * shares / (half * np.diff(EDGES)))
    assert ellipse_stress(x, z, half, force) == pytest.approx(panels, abs=2e-3 * 2 * force / (math.pi * half))
    surface = ellipse_stress(np.array([0.0, 0.5 * half]), np.zeros(2), half, force)
    largest = 2.0 * force / (math.pi * half)
    assert surface[1] == pytest.approx([-largest, -largest * math.sqrt(0.75)], rel=1e-12)


def test_file_opens_in_vtk(tmp_path: Path) -> None:
    """Whole gears in space: volume of both, places, pressure on the flank, a series in the pinion angle."""
    pyvista = pytest.importorskip("pyvista")
    path, out = tmp_path / "job.toml", tmp_path / "out"
    path.write_text(HELICAL_JOB)
    angles = ["--angles", "0", "9", "9"]
    assert (
        main(["stiffness", str(path), "--out", str(out), "--no-estimate", "--fields", "9", *angles, "--coarsen", "3"])
        == 0
    )
    assert (out / "stress_9deg.png").exists()
    grid = pyvista.read(out / "fields.vtkhdf")
    assert set(grid.celltypes) == {32}
    sizes = grid.compute_cell_sizes(length=False, area=False)["Volume"]
    assert sizes.min() > 0.0
    gear = grid.cell_data["gear"]
    for number in (0, 1):
        assert sizes[gear == number].sum() > 0.0
        solid = grid.extract_cells(gear == number)
        assert solid.bounds[5] - solid.bounds[4] == pytest.approx(5e-3, rel=1e-6)
    for name in ("displacement_m", "von_mises_Pa", "principal_1_Pa", "principal_3_Pa", "contact_pressure_Pa"):
        assert np.isfinite(grid.point_data[name]).all()
    assert grid.point_data["contact_pressure_Pa"].max() > 1e8
    assert (grid.point_data["principal_1_Pa"] >= grid.point_data["principal_3_Pa"]).all()
