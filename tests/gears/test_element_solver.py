"""What the elements of the flanks resolve, in the laws on them: told by the half-plane law before they are asked."""

from __future__ import annotations

import math
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from gearfe.cli.main import main
from gearfe.gears.contact.compliance import MeshingPair
from gearfe.gears.gearmesh.positions import position_solver
from gearfe.gears.gearmesh.sweep import elastic_pair, sweep_loads, sweep_stiffness
from gearfe.gears.geometry.pair import TipRelief
from gearfe.gears.teeth.tooth_sector import sector_recipes
from tests.makers.gears import pair as gear_pair
from tests.makers.solving import solve_positions
from tests.places import GEOMETRY

PAIR = gear_pair(tip_round=1e-4)
JOB = GEOMETRY / "gear_train.toml"
#: One tooth pair in the middle of its path.
MIDDLE = PAIR.mesh_cycle * np.linspace(0.62, 0.92, 5)
EVERYWHERE = PAIR.mesh_cycle * (np.arange(12) + 0.3) / 12
#: Twists (deg) of contacts of about 0.6, 1.2, 2 and 6 elements.
NARROW, ONE, TWO, WIDE = 0.001, 0.006, 0.02, 0.1


@lru_cache
def elastic_of(law: str) -> MeshingPair:
    return elastic_pair(PAIR, law=law)


def test_elements_in_a_contact_are_hertzs_width_over_the_flanks_element() -> None:
    """2 b = 2 sqrt(4 F rho/(pi E* w)) (Johnson, eq. 4.43), with the radii of the involutes on the line of action."""
    solver = position_solver(elastic_of("nitsche"))
    size = max(recipe.flank for recipe in sector_recipes(PAIR))
    for degrees in (NARROW, TWO):
        found = solver.half_plane.solve(MIDDLE, np.full(5, math.radians(degrees)))
        elements = solver.elements_per_contact(found)
        for angle, position, seen in zip(MIDDLE, found, elements, strict=True):
            assert len(position.contacts.pair) == 1
            roll = PAIR.pinion_roll_at(angle - PAIR.mesh_cycle)  # the pair -1 bears
            radius = roll * (PAIR.tangent_length - roll) / PAIR.tangent_length
            line = position.torque_wheel / PAIR.wheel.base_radius / 10e-3
            half = math.sqrt(4 * line * radius / (math.pi * 200e9 / (2 * (1 - 0.3**2))))
            assert seen == pytest.approx(2 * half / size, rel=0.05)


@pytest.mark.parametrize(("law", "bound"), [("nitsche", 6e-3), ("penalty", 1e-2)])
def test_resolved_positions_are_near_the_half_plane_law(law: str, bound: float) -> None:
    """Beyond one element the error is below the documented bound, and falls as the contact gets wider."""
    solver, known = position_solver(elastic_of(law)), position_solver(elastic_of("half_plane"))
    worst = []
    for degrees in (ONE, TWO, WIDE):
        twists = np.full(len(EVERYWHERE), math.radians(degrees))
        found, expected = solver.solve(EVERYWHERE, twists), known.solve(EVERYWHERE, twists)
        assert {p.status for p in found} <= {"converged", "under_resolved"}
        off = [
            abs(p.torque_wheel / q.torque_wheel - 1)
            for p, q in zip(found, expected, strict=True)
            if p.status == "converged"
        ]
        assert len(off) >= 6
        worst.append(max(off))
    assert worst[0] < bound
    assert worst[1] < bound / 2
    assert worst[2] < 1e-3


@pytest.mark.parametrize("law", ["nitsche", "penalty"])
def test_a_load_that_the_elements_do_not_resolve_has_no_numbers(law: str) -> None:
    elastic, twist = elastic_of(law), math.radians(NARROW)
    curve = sweep_stiffness(PAIR, twist=twist, angles=EVERYWHERE, elastic=elastic, estimate_error=True)
    assert set(curve.status) == {"under_resolved"}
    assert curve.failed.all()
    for name in ("torque_wheel", "torque_pinion", "k_mesh", "k_tangent", "peak_pressure", "load_share"):
        assert np.isnan(getattr(curve, name)).all(), name
    assert set(curve.law) == {law}
    every = solve_positions(elastic, EVERYWHERE, twist)
    assert "converged" in {p.status for p in every}


def test_the_same_of_torques_and_maps() -> None:
    """2 N m lie below what the elements resolve, 200 N m far above."""
    light, loaded = (
        sweep_stiffness(PAIR, torque=t, angles=EVERYWHERE, elastic=elastic_of("nitsche")) for t in (2.0, 200.0)
    )
    assert set(light.status) == {"under_resolved"}
    assert np.isnan(light.twist).all()
    assert set(loaded.status) == {"converged"}
    assert loaded.torque_wheel == pytest.approx(200.0, rel=1e-9)
    mapped = sweep_loads(PAIR, [2.0, 200.0], angles=EVERYWHERE, elastic=elastic_of("nitsche"))
    assert [set(level) for level in mapped.status] == [{"under_resolved"}, {"converged"}]
    assert mapped.curves[1].k_mesh == pytest.approx(loaded.k_mesh, rel=1e-4)


def test_a_finer_flank_resolves_more() -> None:
    twist = math.radians(0.003)
    coarse, fine = (
        sweep_stiffness(PAIR, twist=twist, angles=MIDDLE, law="nitsche", flank_coarsen=size) for size in (2.0, 0.4)
    )
    assert set(coarse.status) == {"under_resolved"}
    assert set(fine.status) == {"converged"}


def test_the_command_says_the_cure(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--out", str(tmp_path), "--law", "nitsche", "--twist-deg", str(NARROW), "--angles", "2", "6", "14"]
    assert main(["stiffness", str(JOB), *options, "--no-pictures"]) == 1
    said = capsys.readouterr().err
    assert 'law = "half_plane"' in said
    assert "flank_coarsen" in said


def test_steps_that_open_all_gaps_go_on_from_the_points_that_bear() -> None:
    """On fine flanks the penalty's overlap is less than mixing large displacements opens: half_plane agrees."""
    form = {"module": 0.391e-3, "pressure_angle": 26.18, "width": 53.4e-3, "addendum": 0.969, "dedendum": 1.2}
    relief = TipRelief(2.85e-6, 0.228e-3, 2.0)
    pinion = {"bore": 0.47, "profile_shift": 0.0585, "tip_relief": relief}
    wheel = {"bore": 0.286, "profile_shift": -0.444, "tooth_thinning": 9.91e-6}
    gears = gear_pair(11, 65, centre_distance=14.7211e-3, pinion=pinion, wheel=wheel, **form, rack_tip_radius=0.127)
    load = {"twist": math.radians(0.1212), "angles": [2.19 * gears.mesh_cycle / 6], "kinematics": "small"}
    found = sweep_stiffness(gears, law="penalty", flank_coarsen=0.35, **load)
    assert found.torque_wheel == pytest.approx(sweep_stiffness(gears, **load).torque_wheel, rel=1e-3)


def test_flanks_of_a_few_points_have_an_answer() -> None:
    """Five edges with two points each: fewer than may bear beside those that do."""
    gears = gear_pair(20, 30)
    elastic = elastic_pair(gears, law="penalty", coarsen=5.0, flank_coarsen=10.0, points_per_edge=2)
    assert [body.flank.edges for body in elastic.bodies] == [5, 5]
    found = solve_positions(elastic, gears.mesh_cycle * np.arange(12) / 12, math.radians(0.3))
    assert set(found.status) == {"converged"}
    assert (found.torque_wheel > 0.0).all()
