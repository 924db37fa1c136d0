"""Fields on whole gears, against a plain finite-element solution of the whole gear and against theory."""

import csv
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse.linalg import splu

from gearfe import StiffnessCurve
from gearfe.base.errors import InputError
from gearfe.fem.plane import element_stiffness
from gearfe.figures import stress
from gearfe.figures.stress import color_limit
from gearfe.gears.contact.compliance import turn
from gearfe.gears.contact.laws import Penalty
from gearfe.gears.gearmesh.fields import GearRecovery, field_recovery, flank_pressures, straight_triangles
from gearfe.gears.gearmesh.fields_output import chosen_positions, fields_size, size_note, write_fields
from gearfe.gears.gearmesh.sweep import elastic_pair, sweep_stiffness
from gearfe.gears.geometry.derived import path_place
from gearfe.gears.teeth.whole_gear import whole_gear
from tests.makers.gears import pair
from tests.makers.solving import nodal, peak_pressure, solve_position

ANGLE, TWIST = math.radians(3.0), math.radians(0.15)


@pytest.fixture(scope="module")
def gears():
    return pair(17, 23, tip_round=0.1e-3)


@pytest.fixture(scope="module")
def elastic(gears):
    return elastic_pair(gears, law="nitsche", coarsen=3.0)


@pytest.fixture(scope="module")
def position(gears, elastic):
    return solve_position(elastic, ANGLE, TWIST)


@pytest.fixture(scope="module")
def fields(elastic, position):
    return field_recovery(elastic)(position)


def test_a_whole_gear_is_closed(elastic, gears):
    mesh = elastic.wheel.mesh
    whole = whole_gear(mesh)
    corners = whole.points[whole.triangles[:, :3]]
    # curved area by the midpoints' share: 4 straight triangles per element come close; every node is used
    a, b, c = np.moveaxis(whole.points[straight_triangles(whole.triangles)], 1, 0)
    area = 0.5 * np.sum((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    outer = np.pi * gears.wheel.tip_radius**2
    inner = np.pi * gears.wheel.root_radius**2
    bore = np.pi * (0.5 * gears.wheel.bore_diameter) ** 2
    assert inner - bore < area < outer - bore
    assert len(np.unique(whole.triangles)) == len(whole.points)
    assert len(np.unique(np.round(whole.points, 9), axis=0)) == len(whole.points)  # no node twice
    edges = np.sort(np.concatenate([whole.triangles[:, [i, j]] for i, j in ((0, 1), (1, 2), (2, 0))]), axis=1)
    _, uses = np.unique(edges, axis=0, return_counts=True)
    assert np.count_nonzero(uses == 1) == sum(len(e) for e in whole.boundaries.values())  # only the outline is open
    radius = np.linalg.norm(whole.points[whole.boundaries["bore"][:, [0, 2]]], axis=-1)
    np.testing.assert_allclose(radius, 0.5 * gears.wheel.bore_diameter, rtol=1e-9)
    assert corners.shape[0] == mesh.teeth * len(mesh.triangles)


@pytest.mark.parametrize("gear", [0, 1])
def test_fields_are_those_of_the_whole_gear(gear, elastic, position, fields):
    """Assemble the whole gear, load it with the contact forces, clamp the bore, solve: the same displacements."""
    body, field = elastic.bodies[gear], fields[gear]
    whole = whole_gear(body.mesh)
    size = 2 * len(whole.points)
    matrices = element_stiffness(field.points[field.triangles], body.material, body.plane, body.thickness)
    unknowns = (2 * field.triangles[:, :, None] + np.arange(2)).reshape(len(matrices), 12)
    from scipy.sparse import csc_array

    rows = np.broadcast_to(unknowns[:, :, None], matrices.shape)
    columns = np.broadcast_to(unknowns[:, None, :], matrices.shape)
    stiffness = csc_array((matrices.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size))
    load = np.zeros(size)
    for on, tooth, _, force in nodal(elastic, position, ANGLE, TWIST):
        if on == gear:
            nodes = whole.numbers[tooth % body.teeth][body.flank.nodes]
            np.add.at(load.reshape(-1, 2), nodes, force.view(float).reshape(-1, 2))
    free = np.setdiff1d(np.arange(size), (2 * np.unique(whole.boundaries["bore"])[:, None] + np.arange(2)).ravel())
    found = np.zeros(size)
    found[free] = splu(stiffness[free][:, free].tocsc()).solve(load[free])
    np.testing.assert_allclose(field.displacement.ravel(), found, atol=1e-9 * np.abs(found).max())


def test_points_stand_where_the_flanks_are(elastic, position, fields):
    for on, tooth, points, _ in nodal(elastic, position, ANGLE, TWIST):
        body = elastic.bodies[on]
        nodes = whole_gear(body.mesh).numbers[tooth % body.teeth][body.flank.nodes]
        np.testing.assert_allclose(fields[on].points[nodes] @ [1, 1j], points, atol=1e-12)


def test_the_bore_does_not_move(elastic, fields):
    for body, field in zip(elastic.bodies, fields, strict=True):
        bore = np.unique(whole_gear(body.mesh).boundaries["bore"])
        assert np.abs(field.displacement[bore]).max() == 0.0


@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_a_uniform_strain_gives_its_stress(gears, plane):
    """u = G x at the sector's nodes: sigma = lambda tr(G) I + mu (G + G^T) everywhere, summed over the elements."""
    body = elastic_pair(gears, coarsen=3.0, plane=plane, law="penalty").pinion
    gradient = 1e-4 * np.array([[1.0, 0.7], [-0.2, -0.5]])
    moved = (body.mesh.points @ gradient.T).ravel()
    sums = (GearRecovery(body).stress_rows @ moved).reshape(-1, 3)
    e, nu = 200e9, 0.3
    xx, yy, shear = gradient[0, 0], gradient[1, 1], gradient[0, 1] + gradient[1, 0]
    if plane == "strain":
        factor = e / ((1 + nu) * (1 - 2 * nu))
        expected = [factor * ((1 - nu) * xx + nu * yy), factor * ((1 - nu) * yy + nu * xx), e / (2 * (1 + nu)) * shear]
    else:
        factor = e / (1 - nu**2)
        expected = [factor * (xx + nu * yy), factor * (yy + nu * xx), e / (2 * (1 + nu)) * shear]
    counts = np.bincount(body.mesh.triangles.ravel())
    np.testing.assert_allclose(sums / counts[:, None], np.tile(expected, (len(counts), 1)), rtol=1e-9)


def test_turning_the_whole_picture_changes_nothing(elastic, position, fields):
    """The same loads on a gear drawn at another angle: stresses turn with it, von Mises stays."""
    turned = GearRecovery(elastic.pinion).at(elastic, 0, replace(position, pinion_angle=ANGLE + 0.4))
    np.testing.assert_allclose(turned.von_mises, fields[0].von_mises, rtol=1e-9)
    np.testing.assert_allclose(turned.displacement, fields[0].displacement @ turn(0.4).T, atol=1e-15)


def test_stress_below_a_line_contact(elastic, position, fields):
    """Hertz: the largest von Mises stress in plane strain is 0.56 times the peak pressure, below the surface."""
    for field in fields:
        assert 0.4 * peak_pressure(position) < field.von_mises.max() < 1.1 * peak_pressure(position)
    far = fields[0].von_mises[np.linalg.norm(fields[0].points - np.array([-20e-3, 0.0]), axis=1) < 3e-3]
    assert far.max() < 0.05 * fields[0].von_mises.max()


def test_principal_stresses_are_the_eigenvalues(fields):
    """Of the full tensor with its component along the axis, by LAPACK."""
    from gearfe.fem.plane import principal_stresses

    xx, yy, zz, xy = fields[0].stress[::501].T
    full = np.zeros((len(xx), 3, 3))
    full[:, 0, 0], full[:, 1, 1], full[:, 2, 2] = xx, yy, zz
    full[:, 0, 1] = full[:, 1, 0] = xy
    expected = np.linalg.eigvalsh(full)[:, ::-1]
    found = np.stack([p[::501] for p in fields[0].principal], axis=1)
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())
    # zz in the middle, on top, and at the bottom
    cases = np.array([[2.0, -1.0, 0.5, 0.0], [1.0, -1.0, 3.0, 0.0], [1.0, 2.0, -4.0, 0.0]])
    np.testing.assert_allclose(np.stack(principal_stresses(cases), 1), [[2, 0.5, -1], [3, 1, -1], [2, 1, -4]])


def test_the_pressure_carries_the_load(gears, elastic, position, fields):
    """On the path of contact the force along the line of action is T/r_b; the pressure is that force's spread."""
    force = position.torque_wheel / gears.wheel.base_radius
    totals = [0.0, 0.0]
    for one in flank_pressures(elastic, position):
        weights = elastic.bodies[one.gear].flank.weights  # (edges, points an edge): Gauss's rule in the arc length
        edges = np.unique(one.place.astype(int))
        assert (np.diff(one.place) > 0).all()
        totals[one.gear] += gears.wheel.face_width * float(weights[edges].ravel() @ one.pressure)
    assert np.mean(totals) == pytest.approx(force, rel=2e-3)  # both flanks together carry it: the law is two-sided
    for gear, total in enumerate(totals):
        assert total == pytest.approx(force, rel=0.03)
        field = fields[gear]
        assert field.pressure.min() == 0.0
        assert 0.8 * peak_pressure(position) < field.pressure.max() <= peak_pressure(position)
        loaded = field.points[field.pressure > 0]
        start, end = (np.array(path_place(gears, s)) * 1e-3 for s in (0.0, gears.tangent_length))
        along = (end - start) / np.linalg.norm(end - start)
        off = np.abs((loaded - start) @ np.array([-along[1], along[0]]))
        assert off.max() < 0.2e-3  # loaded nodes lie on the line of action


def test_a_one_sided_law_presses_on_both_flanks(gears):
    """Penalty with points on the pinion alone: the wheel's pressure is the pinion's, on the other flank."""
    elastic = elastic_pair(gears, coarsen=3.0, law=Penalty(sides="pinion"))
    position = solve_position(elastic, ANGLE, TWIST)
    found = flank_pressures(elastic, position)
    assert {one.gear for one in found} == {0, 1}
    for pair_number in {one.pair for one in found}:
        peaks = [one.pressure.max() for one in found if one.pair == pair_number]
        assert peaks[0] == pytest.approx(peaks[1], rel=1e-12)


def test_the_series_and_the_table_of_pressures(gears, elastic, tmp_path):
    h5py = pytest.importorskip("h5py")
    curve = sweep_stiffness(gears, twist=TWIST, angles=np.radians([1.0, 2.0]), elastic=elastic)
    drawn = []
    pressures = write_fields(tmp_path, elastic, curve, None, draw=lambda position, fields: drawn.append(fields))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["fields.vtkhdf", "pressure.csv"]
    assert [angle for angle, _ in pressures] == pytest.approx([1.0, 2.0])
    assert len(drawn) == 1  # the most stressed one
    with h5py.File(tmp_path / "fields.vtkhdf") as file:
        root = file["VTKHDF"]
        np.testing.assert_allclose(root["Steps/Values"][:], [1.0, 2.0])
        count = int(root["NumberOfPoints"][0])
        arrays = [root[name] for name in ("Points", "Connectivity", "Offsets", "Types")]
        arrays += [values for group in ("PointData", "CellData") for values in root[group].values()]
        assert fields_size(elastic, 2) == pytest.approx(sum(a.nbytes for a in arrays), rel=1e-4)
        data = {name: root["PointData"][name][:] for name in root["PointData"]}
        points = root["Points"][:]
    assert set(data) == {
        "displacement_m", "von_mises_Pa", "principal_1_Pa", "principal_2_Pa", "principal_3_Pa", "contact_pressure_Pa",
    }  # fmt: skip
    one, two, three = (data[f"principal_{i}_Pa"].astype(float) for i in (1, 2, 3))
    mises = np.sqrt(0.5 * ((one - two) ** 2 + (two - three) ** 2 + (three - one) ** 2))
    np.testing.assert_allclose(data["von_mises_Pa"], mises, atol=1e-5 * mises.max())
    assert (one >= two).all()
    assert (two >= three).all()
    # points turn with the gears (1 deg here), the displacement is the elastic one: microns, and nothing at the bore
    turned = points[:count] @ turn3(math.radians(1.0)).T
    pinion = len(GearRecovery(elastic.pinion).whole.points)
    np.testing.assert_allclose(points[count : count + pinion], turned[:pinion], atol=1e-12)
    assert 0 < np.abs(data["displacement_m"]).max() < 1e-4
    with open(tmp_path / "pressure.csv") as stream:
        rows = list(csv.DictReader(stream))
    largest = [max(float(r["pressure_MPa"]) for r in rows if float(r["pinion_angle_deg"]) == a) for a in (1.0, 2.0)]
    # pressures at points lie about Hertz's or, where an edge bears beside the path, above it
    assert (np.array(largest) > 0.95e-6 * curve.peak_pressure).all()
    for r in rows[::7]:
        gear = gears.pinion if r["gear"] == "pinion" else gears.wheel
        roll = math.sqrt((float(r["diameter_mm"]) / 2) ** 2 - (1e3 * gear.base_radius) ** 2)
        assert float(r["roll_length_mm"]) == pytest.approx(roll, rel=1e-9)


def turn3(angle):
    return np.block([[turn(angle), np.zeros((2, 1))], [np.zeros((1, 2)), np.ones((1, 1))]])


def test_an_animation_is_one_whole_file(gears, elastic, tmp_path, monkeypatch):
    image = pytest.importorskip("PIL.Image")
    curve = sweep_stiffness(gears, twist=TWIST, angles=np.arange(5) * gears.mesh_cycle / 5, elastic=elastic)
    frames = stress.frames_of(elastic, curve, 3)
    np.testing.assert_allclose([f.angle for f in frames], np.degrees(gears.mesh_cycle) * np.arange(3) / 3)
    stress.stress_animation(tmp_path / "a.gif", elastic, curve, 3)
    with image.open(tmp_path / "a.gif") as made:
        assert made.n_frames == 3
        assert made.info["loop"] == 0
        pictures = []
        for k in range(3):
            made.seek(k)
            pictures.append(np.asarray(made.convert("RGB"), dtype=int))
    assert all(np.abs(pictures[0] - other).max() > 100 for other in pictures[1:])  # the gears move
    assert (pictures[0][-20:] == pictures[1][-20:]).all()  # the axes do not

    def broken(*_, **__):
        raise OSError(28, "no space left")

    monkeypatch.setattr(image.Image, "save", broken)
    with pytest.raises(OSError, match="no space"):
        stress.stress_animation(tmp_path / "b.gif", elastic, curve, 3)
    assert [p.name for p in tmp_path.iterdir()] == ["a.gif"]


def test_colours_reach_what_a_small_area_exceeds():
    """A unit square of two triangles with stress 1, and a hundredth of that area with stress 50."""
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    parts = [(square, triangles, np.ones(4)), (0.1 * square, triangles, np.full(4, 50.0))]
    assert color_limit(parts, share=0.02) == 1.0
    assert color_limit(parts, share=0.005) == 50.0
    assert color_limit([(square, triangles, np.zeros(4))]) == 1.0


def test_choosing_positions(gears, elastic):
    curve: StiffnessCurve = sweep_stiffness(gears, twist=TWIST, angles=np.radians([1.0, 2.0, 3.0]), elastic=elastic)
    assert list(chosen_positions(curve, [3.0, 1.0, 3.0])) == [0, 2]
    assert list(chosen_positions(curve, None)) == [0, 1, 2]
    assert list(chosen_positions(curve, [1.6, 3.4])) == [1, 2]  # the nearest
    with pytest.raises(InputError, match=r"is outside of the computed pinion angles; the nearest is 3 deg"):
        chosen_positions(curve, [4.1])


def test_the_size_is_told_before(elastic):
    """Positions of the second mesh cycle are those of the first again: what is offered instead is one cycle."""
    teeth = elastic.bodies[0].teeth
    whole = np.arange(1.0, 41.0)
    one = int(np.ceil(360 / teeth - 1e-9))
    said = size_note(elastic, whole, None)
    assert said.startswith(
        f"fields of 40 positions take {fields_size(elastic, 40) / 1e6:.3g} MB; less: --fields 1 ... "
    )
    assert f"the {one} angles of one mesh cycle, take {fields_size(elastic, one) / 1e6:.3g} MB" in said
    assert size_note(elastic, whole, [3.0]) == f"fields of 1 position take {fields_size(elastic, 1) / 1e6:.3g} MB"
    assert "fewer: --fields 1 3" in size_note(elastic, whole[:4], None)
