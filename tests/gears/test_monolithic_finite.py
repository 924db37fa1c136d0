"""Whole gears of Saint Venant-Kirchhoff bodies: balance of moments, and the first-order share of condensed gears."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gearfe.fem.plane import Material
from gearfe.gears.contact.compliance import NEIGHBOURS, MeshingPair, finite_strain_shares, gear_body
from gearfe.gears.contact.laws import Nitsche, PairModel
from gearfe.gears.contact.whole_gears.pair import ElasticGear, WholePair
from gearfe.gears.contact.whole_gears.position import solve_position
from gearfe.gears.geometry.pair import Gear, GearPair
from gearfe.gears.teeth.tooth_sector import sector_mesh, sector_recipes
from tests.makers.contact_cases import whole
from tests.makers.contact_problems import PRESS, two_blocks
from tests.makers.solving import solve_positions


def test_tangent_is_the_derivative_of_the_forces() -> None:
    """Central differences at a random state; without displacement it is the stiffness of small strain."""
    problem = two_blocks(Nitsche(), "segments", load=PRESS, kinematics="finite")
    made = np.random.default_rng(0)
    u, d = (1e-2 * made.standard_normal(problem.unknowns.size) for _ in range(2))
    bodies, step = problem.constitution, 1e-5
    tangent = bodies.tangent(u)
    rate = (bodies.forces(u + step * d) - bodies.forces(u - step * d)) / (2 * step)
    np.testing.assert_allclose(tangent @ d, rate, rtol=0, atol=1e-9 * np.abs(rate).max())
    assert abs(tangent - tangent.T).max() < 1e-14 * abs(tangent).max()
    at_rest = bodies.tangent(np.zeros_like(u))
    assert abs(at_rest - problem.bodies.stiffness).max() < 1e-14 * abs(at_rest).max()


def test_moments_balance_in_the_deformed_place() -> None:
    """Finite strain fulfils the balance of moments where the bodies are: the reactions at the bore carry the moment of
    the contact forces. Small strain fulfils it in the undeformed place only."""
    pair = replace(whole("modified", 10.0, "strain"), condensed=False)
    place = math.radians(10.0), math.radians(0.3)
    small = solve_position(pair, Nitsche(), *place)
    finite = solve_position(replace(pair, kinematics="finite"), Nitsche(), *place, tolerance=1e-9)
    assert small.status == finite.status == "converged"
    assert finite.torque_wheel_reaction == pytest.approx(finite.torque_wheel, rel=1e-8)
    assert abs(small.torque_wheel_reaction / small.torque_wheel - 1) > 1e-4


def test_a_light_load_keeps_the_digits_of_its_strains() -> None:
    """Strains are some 1e-7. By differences of products of F, which are near 1, the iteration stalls at rounding."""
    pair = replace(whole("modified", 10.0, "strain"), kinematics="finite")
    found = solve_position(pair, Nitsche(), math.radians(10.0), math.radians(2e-4))
    assert found.status == "converged"
    assert found.solution is not None
    assert found.iterations <= 8
    assert found.solution.residuals[-1] < 1e-10


def both_routes(angle_deg: float, twist_deg: float, neighbours: int = NEIGHBOURS) -> tuple[float, float]:
    """Finite strain's share of the torque, first-order on condensed gears and true on whole ones.

    20/30 pair with rounded tips on the same mesh; at 4 deg two tooth pairs carry, at 13 deg one (at 0.05 deg).
    """
    form = {"module": 2.5e-3, "pressure_angle": math.radians(25), "face_width": 10e-3, "tip_round": 0.1e-3}
    pair = GearPair(Gear(20, bore_diameter=17.5e-3, **form), Gear(30, bore_diameter=26.25e-3, **form))
    meshes = [
        sector_mesh(gear, recipe, cache=False)
        for gear, recipe in zip((pair.pinion, pair.wheel), sector_recipes(pair, coarsen=3.0), strict=True)
    ]
    steel, width = Material(), 10e-3
    bodies = [gear_body(mesh, steel, "strain", width) for mesh in meshes]
    condensed = MeshingPair(pair, bodies[0], bodies[1], PairModel(law=Nitsche()))
    pinion, wheel = (ElasticGear(mesh, steel, "strain", width) for mesh in meshes)
    full = WholePair(pinion, wheel, pair.working_centre_distance, width, kinematics="finite")
    place = math.radians(angle_deg), math.radians(twist_deg)
    found = solve_positions(condensed, [place[0]], place[1])
    finite = solve_position(full, Nitsche(), *place, tolerance=1e-8)
    assert finite.status == "converged"
    share = finite_strain_shares(condensed, found, neighbours)[0]
    return float(share), finite.torque_wheel / float(found.torque_wheel[0]) - 1


@pytest.mark.slow
@pytest.mark.parametrize("angle_deg", [4.0, 13.0])
def test_cheap_form_at_a_small_twist(angle_deg: float) -> None:
    """The envelope theorem's first-order share is a few parts in 1e5 of the torque off."""
    share, true = both_routes(angle_deg, 0.05)
    assert share == pytest.approx(true, abs=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("twist_deg", [0.25, 0.5])
def test_what_the_cheap_form_leaves_out_is_of_second_order(twist_deg: float) -> None:
    """The remainder is below the square of the share (all sectors taken along: few of them miss first-order parts)."""
    share, true = both_routes(4.0, twist_deg, neighbours=15)
    assert abs(share - true) < share**2
