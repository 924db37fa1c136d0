"""The estimate of the mesh's error: against finer meshes, other elements, fields whose error is known to be none."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from gearfe.base.tables.housing import FeetTable, HousingMeshTable, HousingTable, ShaftAxisTable
from gearfe.drivetrain.housing.attachments import Attachment
from gearfe.drivetrain.housing.build import housing_from_table
from gearfe.drivetrain.housing.model import Housing, rigid_motions
from gearfe.fem.bodies.mesh_error import energy_lost
from gearfe.fem.plane import Material
from gearfe.fem.reduction.error import accelerances, mesh_error
from gearfe.fem.reduction.lanczos import lowest_modes
from gearfe.fem.reduction.sparse_solver import factorize
from gearfe.fem.solid import assemble
from tests.makers.housing_meshes import REFERENCE, bent, box, reference_housing

STEEL = Material()


def clamped(cells: tuple[int, int, int], size: tuple[float, float, float], order: int = 2) -> tuple[np.ndarray, ...]:
    """First six frequencies (rad/s) of a box held at x = 0, and their estimated relative errors."""
    nodes, tets = box(cells, size, order=order)
    held = np.flatnonzero(nodes[:, 0] < 1e-9)
    free = (3 * np.flatnonzero(nodes[:, 0] > 1e-9)[:, None] + np.arange(3)).ravel()
    found = assemble(nodes, tets, STEEL)
    k, m = found.stiffness.tocsr()[free][:, free], found.mass[free][:, free]
    modes = lowest_modes(factorize(k).solve, m, count=6)
    fields = np.zeros((nodes.size, 6))
    fields[free] = modes.vectors
    lost = np.diag(energy_lost(nodes, tets, STEEL, fields, modes.eigenvalues, [held])) / modes.eigenvalues
    return np.sqrt(modes.eigenvalues), np.sqrt(1.0 + lost) - 1.0


@pytest.mark.parametrize(
    ("cells", "size", "finer"),
    [((4, 1, 1), (0.4, 0.1, 0.1), 3), ((4, 4, 1), (0.2, 0.2, 0.02), 3), ((8, 5, 1), (0.2, 0.12, 0.006), 2)],
    ids=["beam", "plate", "thin plate"],
)
def test_estimate_covers_clamped_beams_and_plates_one_element_thick(
    cells: tuple[int, int, int], size: tuple[float, float, float], finer: int
) -> None:
    """Clamped edges and bending through one element; the smoothed stress of Zienkiewicz and Zhu missed 1.7 to 42 times.

    The mesh of the truth errs as well, by less than a third of the other one.
    """
    coarse, estimate = clamped(cells, size)
    truth, _ = clamped(tuple(finer * n for n in cells), size)  # type: ignore[arg-type]
    true = coarse / truth - 1.0
    assert np.all(true < estimate), estimate / true
    assert np.median(estimate / true) < 3.0


def test_estimate_falls_as_the_error_does() -> None:
    coarse, one = clamped((4, 1, 1), (0.4, 0.1, 0.1))
    middle, two = clamped((8, 2, 2), (0.4, 0.1, 0.1))
    fine, _ = clamped((20, 5, 5), (0.4, 0.1, 0.1))
    assert one[0] / two[0] == pytest.approx((coarse[0] - fine[0]) / (middle[0] - fine[0]), rel=0.25)


def test_linear_elements_are_known_to_be_far_off() -> None:
    """Bending with linear tetrahedra is locked: off by more than half, and told so."""
    coarse, estimate = clamped((8, 2, 1), (0.4, 0.1, 0.02), order=1)
    truth, _ = clamped((8, 2, 1), (0.4, 0.1, 0.02))
    assert coarse[0] / truth[0] > 1.5
    assert estimate[0] > math.sqrt(2.0) - 1.0  # as large as the stiffness: told as unknown
    nodes, tets = box((8, 2, 1), (0.4, 0.1, 0.02), order=1)
    housing = Housing.from_arrays(nodes, tets, fixed=((0, 0, 0), (1, 0, 0)))
    assert any("too stiff" in note for note in housing.notes)
    assert math.isinf(mesh_error(housing.reduce(15), 1000.0).frequency_errors[0])


def test_rigid_motions_and_exact_fields_have_no_error() -> None:
    """Curved elements too: a rotation is exact; pure bending is quadratic, so quadratic elements contain it."""
    nodes, tets = box((2, 2, 2), (1.0, 1.0, 1.0), mapped=bent)
    scale = STEEL.youngs_modulus
    lost = energy_lost(nodes, tets, STEEL, rigid_motions(nodes), np.zeros(6), [])
    assert np.abs(lost).max() < 1e-20 * scale
    nodes, tets = box((3, 2, 2), (1.0, 0.5, 0.5))
    x, y, z = nodes.T
    nu = STEEL.poisson_ratio
    field = np.column_stack([x * z, -nu * y * z, -0.5 * (x**2 - nu * y**2 + nu * z**2)]).reshape(-1, 1)
    surface = np.flatnonzero(
        (np.abs(x - 0.5) > 0.5 - 1e-9) | (np.abs(y - 0.25) > 0.25 - 1e-9) | (np.abs(z - 0.25) > 0.25 - 1e-9)
    )
    lost = energy_lost(nodes, tets, STEEL, field, np.zeros(1), [surface])
    assert lost[0, 0] < 1e-20 * scale
    # the same field with a cubic part that is not in equilibrium is caught
    field[::3, 0] += x**3
    assert energy_lost(nodes, tets, STEEL, field, np.zeros(1), [surface])[0, 0] > 1e-6 * scale


def test_tetrahedra_against_extruded_elements() -> None:
    """The stored housing, tetrahedra of CalculiX's, and extruded elements: two meshes, two elements, two assemblies."""
    body = reference_housing().reduce(modes=15)
    truth = housing_from_table(stored_table(8.0)).reduce(modes=15)
    assert truth.rigid_mass[0, 0] == pytest.approx(body.rigid_mass[0, 0], rel=3e-3)  # its bores are polygons
    true = body.coupled.frequencies_hz[:8] / truth.coupled.frequencies_hz[:8] - 1.0
    told = mesh_error(body, 2000.0).frequency_errors[:8]
    assert np.all(true > 0.002)  # from above, and thin elements at the edges are nearer
    assert np.all(true < told), told / true
    assert np.median(told / true) < 5.0
    one, two = accelerances(body, 2000.0), accelerances(truth, 2000.0)
    off = float(np.linalg.norm(one - two) / np.linalg.norm(two))
    assert off < mesh_error(body, 2000.0).response < 5.0 * off


def stored_table(size_mm: float) -> HousingTable:
    """The stored housing as a table."""
    p = {name: 1e3 * value for name, value in REFERENCE["params"].items() if isinstance(value, float)}
    shaft = ShaftAxisTable(x_mm=0.0, bore_radius_mm=p["rb"], boss_radius_mm=p["ro"], boss_height_mm=p["hb"])
    return HousingTable(
        wall_x_mm=(p["x0"], p["x1"]),
        wall_z_mm=(p["z0"], p["z1"]),
        inner_gap_mm=p["yin"],
        wall_thickness_mm=(p["tw"], p["tw"]),
        base_thickness_mm=p["tb"],
        shafts=tuple(dataclasses.replace(shaft, x_mm=1e3 * x) for x in REFERENCE["params"]["xs"]),
        feet=FeetTable(length_x_mm=p["foot"], width_y_mm=p["foot"], height_mm=p["fh"]),
        mesh=HousingMeshTable(size_mm=size_mm),
    )


@pytest.mark.parametrize("held", [True, False])
def test_softened_bodies(held: bool) -> None:
    """A softening of a part of the stiffness lowers all frequencies alike; rigid-body modes stay at zero."""
    nodes, tets = box((3, 1, 1), (0.3, 0.1, 0.1))
    ends = [np.flatnonzero(nodes[:, 0] < 1e-9), np.flatnonzero(nodes[:, 0] > 0.3 - 1e-9)]
    attachment = Attachment("end", np.array([0.3, 0.05, 0.05]), np.array([1.0, 0.0, 0.0]), ends[1])
    body = Housing.from_arrays(nodes, tets, fixed=ends[0] if held else None, attachments=[attachment]).reduce(modes=12)
    assert body.softening.shape == body.stiffness.shape
    assert np.linalg.eigvalsh(body.softening).min() > -1e-9 * np.abs(body.softening).max()
    soft = dataclasses.replace(body, softening=0.21 * body.stiffness).softened()
    rigid = 0 if held else 6
    ratio = soft.coupled.frequencies_hz[rigid:] / body.coupled.frequencies_hz[rigid:]
    np.testing.assert_allclose(ratio, 1.0 / math.sqrt(1.21), rtol=1e-6)
    assert np.all(soft.coupled.frequencies_hz[:rigid] == 0.0)
    own = [b.coupled.frequencies_hz[rigid : rigid + 3] for b in (body.softened(), body.softened(0.5), body)]
    assert np.all(own[0] < own[1])
    assert np.all(own[1] < own[2])
    told = mesh_error(body, 1000.0)
    np.testing.assert_allclose(told.frequency_errors[rigid : rigid + 3], own[2] / own[0] - 1.0)
    assert np.all(told.frequency_errors[:rigid] == 0.0)
    # modes above the highest one kept have no estimate, and that is not none at all
    assert math.isinf(told.frequency_errors[-1])
    assert math.isinf(mesh_error(body, 1e6).response)
