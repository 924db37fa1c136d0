"""Fields on whole gears, against a plain finite-element solution of the whole gear and against theory."""

import math

import numpy as np
import pytest
from scipy.sparse.linalg import splu

from gearfe import StiffnessCurve
from gearfe.contact.scene import assemble, turn
from gearfe.contact.solver import solve_position
from gearfe.elasticity import element_stiffness
from gearfe.errors import InputError
from gearfe.fields import gear_recovery, pair_recovery, straight_triangles
from gearfe.fields_output import chosen_positions
from gearfe.meshing.whole_gear import whole_gear
from gearfe.stiffness import elastic_pair, sweep_stiffness

from .gears import pair

ANGLE, TWIST = math.radians(3.0), math.radians(0.1)


@pytest.fixture(scope="module")
def gears():
    return pair(17, 23, tip_round=0.1e-3)


@pytest.fixture(scope="module")
def elastic(gears):
    return elastic_pair(gears, coarsen=3.0)


@pytest.fixture(scope="module")
def position(elastic):
    return solve_position(elastic, ANGLE, TWIST)


@pytest.fixture(scope="module")
def fields(elastic, position):
    return pair_recovery(elastic).at(position, ANGLE, TWIST)


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
    scene = position.scene
    for w in scene.windows:
        if w.gear == gear:
            nodes = whole.numbers[w.tooth % body.teeth][body.flank.nodes[w.flank_nodes]]
            force = np.matmul(scene.rotation[w.nodes], position.forces[w.unknowns].reshape(-1, 2, 1))[:, :, 0]
            np.add.at(load.reshape(-1, 2), nodes, force)
    free = np.setdiff1d(np.arange(size), (2 * np.unique(whole.boundaries["bore"])[:, None] + np.arange(2)).ravel())
    found = np.zeros(size)
    found[free] = splu(stiffness[free][:, free].tocsc()).solve(load[free])
    np.testing.assert_allclose(field.displacement.ravel(), found, atol=1e-9 * np.abs(found).max())


def test_points_stand_where_the_flanks_are(elastic, position, fields):
    scene = position.scene
    for w in scene.windows:
        body = elastic.bodies[w.gear]
        nodes = whole_gear(body.mesh).numbers[w.tooth % body.teeth][body.flank.nodes[w.flank_nodes]]
        np.testing.assert_allclose(fields[w.gear].points[nodes], scene.points[w.nodes], atol=1e-12)
        compliance = assemble(elastic, scene.windows).compliance
        placed = scene.placed(compliance @ position.forces)[w.nodes]
        np.testing.assert_allclose(
            fields[w.gear].points[nodes] + fields[w.gear].displacement[nodes], placed, atol=1e-12
        )


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
    sums = (gear_recovery(body).stress_rows @ moved).reshape(-1, 3)
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
    recovery = pair_recovery(elastic).gears[0]
    from gearfe.fields import gear_field

    turned = gear_field(recovery, elastic, position, ANGLE + 0.4, 0)
    np.testing.assert_allclose(turned.von_mises, fields[0].von_mises, rtol=1e-9)
    np.testing.assert_allclose(turned.displacement, fields[0].displacement @ turn(0.4).T, atol=1e-15)


def test_stress_below_a_line_contact(elastic, position, fields):
    """Hertz: the largest von Mises stress in plane strain is 0.56 times the peak pressure, below the surface."""
    for field in fields:
        assert 0.4 * position.peak_pressure < field.von_mises.max() < 1.1 * position.peak_pressure
    far = fields[0].von_mises[np.linalg.norm(fields[0].points - np.array([-20e-3, 0.0]), axis=1) < 3e-3]
    assert far.max() < 0.05 * fields[0].von_mises.max()


def test_choosing_positions(gears, elastic):
    curve: StiffnessCurve = sweep_stiffness(gears, twist=TWIST, angles=np.radians([1.0, 2.0, 3.0]), elastic=elastic)
    assert list(chosen_positions(curve, [3.0, 1.0])) == [2, 0]
    assert list(chosen_positions(curve, None)) == [0, 1, 2]
    with pytest.raises(InputError, match=r"none of the sweep's angles; the nearest is 3 deg"):
        chosen_positions(curve, [3.4])
