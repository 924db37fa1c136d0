"""Two formulations of the same contact: condensed compliance against plain scikit-fem forms on whole gears."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import coo_matrix

from gearfe.fem.plane import element_stiffness
from gearfe.gears.contact.laws import ContactLaw, Nitsche, Penalty
from gearfe.gears.contact.whole_gears.bodies import Bodies
from gearfe.gears.contact.whole_gears.pair import ElasticGear
from gearfe.gears.contact.whole_gears.position import solve_position as solve_whole
from gearfe.gears.teeth.whole_gear import whole_gear
from tests.makers.contact_cases import STEEL, WIDTH, condensed, meshes, whole
from tests.makers.solving import peak_pressure, solve_position

COARSE = 5.0

CASES = [
    # pair, plane, law, pinion angle, twist (deg), pairs in contact
    ("sharp", "strain", Nitsche(), 0.0, 0.05, 1),
    ("sharp", "strain", Nitsche(), 9.0, 0.05, 2),
    ("sharp", "strain", Nitsche(), 15.0, 0.05, 2),  # the pair ahead leaves, on a sharp corner
    ("sharp", "stress", Nitsche(), 3.0, 0.05, 2),  # the next pair comes in, on the other gear's corner
    ("sharp", "strain", Nitsche(2.0, sides="wheel"), 9.0, 0.05, 2),
    ("sharp", "strain", Penalty(1e15), 6.0, 0.05, 2),
    ("modified", "strain", Nitsche(), 5.0, 0.05, 2),  # on relief and tip round
    ("modified", "stress", Nitsche(), 10.0, 0.3, 2),
    ("modified", "stress", Penalty(1e15), 25.0, 0.15, 1),
    ("modified", "strain", Penalty(1e15, sides="pinion"), 20.0, 0.05, 1),
]


@pytest.mark.parametrize(("name", "plane", "law", "angle", "twist", "pairs"), CASES)
def test_both_routes_give_the_same_position(
    name: str, plane: str, law: ContactLaw, angle: float, twist: float, pairs: int
) -> None:
    place = math.radians(angle), math.radians(twist)
    small = solve_position(condensed(name, COARSE, plane, law), *place)  # type: ignore[arg-type]
    full = solve_whole(whole(name, COARSE, plane), law, *place)
    assert small.status == full.status == "converged"
    assert np.count_nonzero(small.contacts.torque_wheel > 1e-3 * small.torque_wheel) == pairs
    assert full.peak_pressure == pytest.approx(peak_pressure(small), rel=1e-8)
    for quantity in ("torque_wheel", "torque_pinion", "torque_wheel_reaction"):
        assert getattr(full, quantity) == pytest.approx(getattr(small, quantity), rel=1e-8), quantity


def test_without_twist_nothing_touches_on_either_route() -> None:
    apart = math.radians(5.0), math.radians(-0.05)
    assert solve_position(condensed("sharp", COARSE, "strain", Nitsche()), *apart).status == "no_contact"
    assert solve_whole(whole("sharp", COARSE, "strain"), Nitsche(), *apart).status == "no_contact"


def test_whole_gear_is_closed_and_made_of_turned_sectors() -> None:
    sector = meshes("sharp", COARSE)[0]
    gear = whole_gear(sector)
    assert len(np.unique(gear.triangles)) == len(gear.points)
    sides = np.sort(gear.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    _, owners = np.unique(sides, axis=0, return_counts=True)
    outline = sum(len(edges) for edges in gear.boundaries.values())
    assert np.count_nonzero(owners == 1) == outline
    assert owners.max() == 2
    turned = gear.points[gear.numbers[3]]
    angle = 3 * 2 * math.pi / sector.teeth
    rotation = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    np.testing.assert_allclose(turned, sector.points @ rotation.T, rtol=0, atol=1e-15)


@pytest.mark.parametrize(("name", "angle"), [("sharp", 9.0), ("modified", 10.0)])
def test_condensed_teeth_are_those_of_the_whole_gears(name: str, angle: float) -> None:
    """Static condensation is exact: torques, and the reaction of supports of which some are condensed."""
    pair, place = whole(name, COARSE, "strain"), (math.radians(angle), math.radians(0.05))
    arcs = pair.arcs(*place)
    assert arcs is not None
    assert 1 <= len(arcs.arcs[0].mesh.contact) < pair.pinion.mesh.teeth
    part = solve_whole(pair, Nitsche(), *place)
    full = solve_whole(replace(pair, condensed=False), Nitsche(), *place)
    assert part.status == full.status == "converged"
    for quantity in ("torque_wheel", "torque_pinion", "torque_wheel_reaction"):
        assert getattr(part, quantity) == pytest.approx(getattr(full, quantity), rel=1e-9), quantity


def test_scikit_fem_form_and_batched_element_stiffness_agree() -> None:
    sector = meshes("modified", COARSE)[0]
    gear = whole_gear(sector)
    bodies = Bodies((ElasticGear(sector, STEEL, "stress", WIDTH).body(gear),))
    blocks = element_stiffness(gear.points[gear.triangles], STEEL, "stress", WIDTH)
    unknowns = bodies.unknowns[bodies.node_of[0]][gear.triangles].reshape(-1, 12)
    rows, columns = np.broadcast_arrays(unknowns[:, :, None], unknowns[:, None, :])
    size = bodies.stiffness.shape[0]
    mine = coo_matrix((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size)).tocsr()
    own = np.unique(unknowns)
    difference = abs(bodies.stiffness[own][:, own] - mine[own][:, own]).max()
    assert difference < 1e-13 * abs(mine).max()
