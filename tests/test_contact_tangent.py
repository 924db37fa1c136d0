"""The general iteration's matrix at a sharp corner that dents its mate, against finite differences, and its steps."""

import math

import numpy as np
import pytest

from gearfe.contact.closest import unreached
from gearfe.contact.linearised import linearise
from gearfe.contact.overlap import WHOLE, overlaps, windows_of
from gearfe.contact.scene import assemble, project_all
from gearfe.contact.solver import solve_positions
from gearfe.stiffness.sweep import elastic_pair

from .gears import pair

TWIST = math.radians(0.5)


@pytest.fixture(scope="module")
def gears():
    return pair()


def test_stiffness_of_the_contact_forces(gears):
    elastic = elastic_pair(gears, law="nitsche", coarsen=2.0)
    angle = 0.8 * gears.mesh_cycle
    found = overlaps(elastic, np.array([angle]), np.array([TWIST]))[0]
    scene = assemble(elastic, windows_of(elastic, found, angle, TWIST, WHOLE))
    rng = np.random.default_rng(3)
    start, along = 1e-6 * rng.normal(size=(2, 2 * len(scene.points)))
    pressure = 1e9 * rng.uniform(size=len(scene.weight))

    def at(step):
        placed = scene.placed(start + step * along)
        return project_all([scene], [placed], [scene.rigid.place])[0], placed

    rigid, placed = at(0.0)
    active = np.flatnonzero(~unreached(rigid.gap) & (scene.rigid.gap < 0))
    lin = linearise(scene, rigid, active, pressure, placed)
    step = 1e-4
    ends = [linearise(scene, p, active, pressure, x) for p, x in (at(step), at(-step))]
    for end in ends:
        np.testing.assert_array_equal(end.unknowns, lin.unknowns)
    force = [end.weighted @ pressure[active] for end in ends]
    difference = (force[0] - force[1]) / (2 * step)
    exact = lin.stiffness @ along[lin.unknowns]
    assert np.abs(exact - difference).max() < 2e-6 * np.abs(difference).max()
    opened = (ends[0].gap - ends[1].gap) / (2 * step)
    np.testing.assert_allclose(lin.opening @ along[lin.unknowns], opened, rtol=0, atol=1e-6 * np.abs(opened).max())


@pytest.mark.parametrize("law", ["nitsche", "penalty"])
def test_sharp_corners_under_a_large_twist_converge(gears, law):
    """Corners that dent deeply, and the penalty law, whose points change sides: no position is given up."""
    elastic = elastic_pair(gears, law=law)
    angles = np.arange(60, 65) * gears.mesh_cycle / 72
    made = solve_positions(elastic, angles, TWIST)
    assert [p.status for p in made] == ["converged"] * len(angles)
    # their torque is the twist's and their tangent its slope
    step = 1e-6 * TWIST
    for angle, position in list(zip(angles, made, strict=True))[::2]:
        more, less = solve_positions(elastic, np.array([angle] * 2), TWIST + np.array([step, -step]))
        assert position.tangent == pytest.approx((more.torque_wheel - less.torque_wheel) / (2 * step), rel=1e-4)
