"""Unusual but legal gears, loads below the mesh, and statuses: each position is answered or honestly flagged."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gearfe.contact.compliance import gear_body
from gearfe.contact.laws import ContactLaw, Exact, Nitsche, Penalty
from gearfe.contact.scene import MeshingPair
from gearfe.contact.solver import solve_positions, stable
from gearfe.elasticity import Material
from gearfe.gear.pair import Gear, GearPair, TipRelief
from gearfe.meshing.recipe import sector_recipes
from gearfe.meshing.tooth_sector import sector_mesh
from gearfe.stiffness.sweep import elastic_pair

from .gears import pair as gear_pair

RELIEF = TipRelief(20e-6, 1.5e-3, 2.0)
CASES = {
    "eight and one hundred and fifty teeth": ((8, 150), 20.0, {"profile_shift": 0.5}, {}),
    "low pressure angle": ((25, 40), 14.5, {}, {}),
    "high pressure angle": ((17, 23), 30.0, {"rack_tip_radius": 0.1}, {"rack_tip_radius": 0.1}),
    "undercut": ((11, 40), 20.0, {}, {}),
    "relief on both": ((20, 30), 20.0, {"tip_relief": RELIEF}, {"tip_relief": RELIEF}),
    "backlash": ((20, 30), 20.0, {"tooth_thinning": 50e-6}, {}),
    "rounded tips": ((20, 30), 25.0, {"tip_round": 1e-4}, {"tip_round": 1e-4}),
}


def build(name: str, law: ContactLaw, coarsen: float = 1.5) -> tuple[GearPair, MeshingPair]:
    teeth, alpha, one, two = CASES[name]
    module = 2.5e-3
    gears = [
        Gear(z, module, math.radians(alpha), 10e-3, 0.3 * module * z, **options)
        for z, options in zip(teeth, (one, two), strict=True)
    ]
    pair = GearPair(gears[0], gears[1])
    bodies = [
        gear_body(
            sector_mesh(gear, recipe, cache=False), Material(), "strain", gear.face_width, with_stress=law.uses_stress
        )
        for gear, recipe in zip(gears, sector_recipes(pair, coarsen=coarsen), strict=True)
    ]
    return pair, MeshingPair(bodies[0], bodies[1], pair.working_centre_distance, 10e-3, law)


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("law", [Nitsche(), Penalty()], ids=lambda law: law.name)
def test_whole_mesh_cycle(name: str, law: ContactLaw) -> None:
    """Every position converges; the cycle closes; the hubs' torques balance the force between the gears' centres."""
    gears, pair = build(name, law)
    angles = np.linspace(0, pair.pitch_angle, 8)
    twist = 4e-3 * gears.wheel.module / gears.wheel.base_radius + gears.contact_twist
    positions = solve_positions(pair, angles, twist)
    assert [p.status for p in positions] == ["converged"] * len(angles)
    torques = np.array([p.torque_wheel for p in positions])
    assert (torques > 0).all()
    assert torques[-1] == pytest.approx(torques[0], rel=1e-7)
    for p in positions:
        force = np.matmul(p.scene.rotation, p.forces.reshape(-1, 2, 1))[:, :, 0]
        on_wheel = force[p.scene.of_wheel].sum(axis=0)
        assert np.allclose(force.sum(axis=0), 0, atol=1e-8 * np.abs(on_wheel).max())
        # moments about the pinion's centre: the hubs hold the moment of the contact force F on the wheel, a F_y
        balance = p.torque_pinion + p.torque_wheel - pair.centre_distance * on_wheel[1]
        assert abs(balance) < 1e-8 * p.torque_wheel
    ratio = np.array([p.torque_wheel / p.torque_pinion for p in positions]) / gears.gear_ratio
    assert np.median(np.abs(ratio - 1)) < 2e-3  # contact on the path: force along the line of action


def test_out_of_reach_and_below_the_mesh() -> None:
    """Backlash not taken up is no contact (zero torque); an overlap that no contact point sees is never a silent
    zero."""
    gears, pair = build("backlash", Nitsche())
    angles = np.linspace(0, pair.pitch_angle, 5)
    apart = solve_positions(pair, angles, 0.9 * gears.contact_twist)
    assert {p.status for p in apart} == {"no_contact"}
    assert all(p.torque_wheel == 0.0 for p in apart)
    _, tight = build("rounded tips", Nitsche())
    grazing = solve_positions(tight, angles, 1e-8)
    assert {p.status for p in grazing} <= {"under_resolved", "converged"}
    assert "under_resolved" in {p.status for p in grazing}
    assert all(np.isnan(p.torque_wheel) for p in grazing if p.status == "under_resolved")


def test_a_torque_that_falls_with_the_twist_is_no_answer() -> None:
    """Campaign gears, seed 111, case 274: a sharp corner dents by 0.2 modules and snaps on, its tangent below zero."""
    (_, pair), angle = build("relief on both", Nitsche()), np.array([0.1])
    (found,) = solve_positions(pair, angle, np.radians([0.05]))
    assert stable(found) is found
    fallen = stable(replace(found, tangent=-found.tangent))
    assert fallen.status == "not_converged"
    assert math.isnan(fallen.torque_wheel)


@pytest.mark.parametrize(("teeth", "degrees"), [((20, 30), 0.5), ((15, 60), 0.2), ((15, 60), 0.5)])
def test_sharp_tips_dig_in_alike_under_penalty_and_the_exact_law(teeth: tuple[int, int], degrees: float) -> None:
    """Points of the corner's own gear bear: on the other one they hold it from either side, which cost up to 0.5 %,
    hundreds of steps and a second solution."""
    gears = gear_pair(*teeth)
    angles = gears.mesh_cycle * np.arange(16) / 16 + 0.003
    penalty, exact = (
        solve_positions(elastic_pair(gears, law=law), angles, math.radians(degrees)) for law in (Penalty(), Exact())
    )
    assert {p.status for p in (*penalty, *exact)} == {"converged"}
    assert max(p.iterations for p in penalty) < 25
    off = [abs(p.torque_wheel / q.torque_wheel - 1) for p, q in zip(penalty, exact, strict=True)]
    assert max(off) < 1e-3


def test_the_exact_law_on_fine_flanks_of_a_round() -> None:
    """Where Newton's method from the Hertzian guess fails, the law starts from a penalty."""
    form = {"module": 1.32e-3, "pressure_angle": 20.0, "width": 58.3e-3, "dedendum": 1.28, "rack_tip_radius": 0.185}
    one = {"profile_shift": 0.577, "tip_round": 0.0761e-3}
    two = {"profile_shift": -0.397, "tooth_thinning": 43e-6}
    gears = gear_pair(
        15, 32, pinion=one, wheel=two, centre_distance=31.2848e-3, bore=0.2, tip_shortening=0.0602, **form
    )
    angle = gears.mesh_cycle * np.array([5.37]) / 8
    torques = []
    for law in (Exact(), Nitsche()):
        (found,) = solve_positions(
            elastic_pair(gears, law=law, flank_coarsen=0.3), angle, math.radians(0.3) + gears.contact_twist
        )
        assert found.status == "converged"
        torques.append(found.torque_wheel)
    assert torques[0] == pytest.approx(torques[1], rel=5e-4)
