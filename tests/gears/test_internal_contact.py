"""Contact of internal pairs: laws against each other and against whole gears, free rims, deviations, commands."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve

from gearfe.base.errors import InputError
from gearfe.base.files import read_numbers
from gearfe.cli.main import main
from gearfe.fem.plane import Material, element_stiffness
from gearfe.gears.contact.compliance import gear_body
from gearfe.gears.contact.half_plane import solve_half_plane
from gearfe.gears.contact.laws import PairModel, Penalty
from gearfe.gears.contact.whole_gears.pair import whole_pair
from gearfe.gears.contact.whole_gears.position import solve_position
from gearfe.gears.gearmesh.law_make import mesh_law
from gearfe.gears.gearmesh.positions import position_solver
from gearfe.gears.gearmesh.sweep import elastic_pair, sweep_loads, sweep_stiffness
from gearfe.gears.geometry.deviation import Deviation
from gearfe.gears.geometry.face import ToothDeviations, face_of
from gearfe.gears.geometry.first_contact import first_contact_curve
from gearfe.gears.geometry.pair import Gear, GearPair
from gearfe.gears.geometry.validity import overlap_warnings
from gearfe.gears.teeth.tooth_sector import sector_mesh, sector_recipes
from gearfe.gears.teeth.whole_gear import whole_gear

ANGLE = math.radians(20.0)
PLANET = Gear(22, 4e-3, ANGLE, 0.05, 0.0432, rack_tip_radius=0.25)
RING = Gear(-61, 4e-3, ANGLE, 0.05, rim_diameter=0.28, cutter_teeth=23, rack_tip_radius=0.0, addendum=0.9)
PAIR = GearPair(PLANET, RING)
#: Cutter of a small ring.
CUT: dict[str, Any] = {"cutter_teeth": 18, "rack_tip_radius": 0.05, "dedendum": 1.0}


@cache
def solver() -> Any:
    return position_solver(elastic_pair(PAIR))


@pytest.mark.parametrize("angle", [-0.2, -0.1, 0.05, 0.12])
def test_torque_is_the_derivative_of_the_energy(angle: float) -> None:
    twist, step = 3e-5, 3e-9
    low, here, high = solver().solve(np.full(3, angle), twist + step * np.array([-1.0, 0.0, 1.0]))
    rate = (high.energy - low.energy) / (2.0 * step)
    assert rate == pytest.approx(here.torque_wheel, rel=2e-4)
    assert (high.torque_wheel - low.torque_wheel) / (2.0 * step) == pytest.approx(here.tangent, rel=2e-3)


def test_ratio_of_torques_on_the_path_is_that_of_the_teeth() -> None:
    curve = sweep_stiffness(PAIR, torque=5.0, angles=[0.05, 0.0, -0.2], kinematics="small", elastic=solver().elastic)
    np.testing.assert_allclose(curve.torque_wheel / curve.torque_pinion, 61 / 22, rtol=3e-6)
    np.testing.assert_allclose(curve.torque_wheel_reaction, curve.torque_wheel, rtol=1e-5)


def test_law_on_half_planes_agrees_with_fine_elements_over_a_cycle() -> None:
    """Within 0.15 %, the bound that is asked for; whole gears share the elements' equations, see below."""
    angles, twist = np.arange(6) * PAIR.mesh_cycle / 6, math.radians(0.002)
    coarse = sweep_stiffness(PAIR, twist=twist, angles=angles, kinematics="small", elastic=solver().elastic)
    fine = sweep_stiffness(
        PAIR, twist=twist, angles=angles, kinematics="small", law="nitsche", coarsen=0.7, flank_coarsen=0.5
    )
    np.testing.assert_allclose(coarse.k_mesh, fine.k_mesh, rtol=1.5e-3)


def test_condensed_gears_are_the_whole_gears() -> None:
    pair = GearPair(
        Gear(12, 4e-3, math.radians(25.0), 0.02, 0.015, rack_tip_radius=0.2, profile_shift=0.2),
        Gear(-32, 4e-3, math.radians(25.0), 0.02, rim_diameter=0.17, addendum=0.6, profile_shift=-0.2, **CUT),
    )
    model, twist = PairModel(law=Penalty(), coarsen=4.0), math.radians(0.03)
    curve = sweep_stiffness(pair, model, twist=twist, angles=[-0.15], kinematics="small")
    whole = solve_position(whole_pair(pair, model), Penalty(), -0.15, twist + pair.contact_twist)
    assert curve.status[0] == whole.status == "converged"
    assert whole.torque_wheel == pytest.approx(curve.torque_wheel[0], rel=1e-6)
    assert whole.torque_pinion == pytest.approx(curve.torque_pinion[0], rel=1e-6)


def test_a_free_rim_is_the_whole_ring_with_mean_displacement_and_turn_held() -> None:
    """All unknowns of the ring in one sparse system, its three conditions bordering it."""
    pair = GearPair(PLANET, replace(RING, rim="free"))
    gear, recipe = pair.wheel, sector_recipes(pair, coarsen=4.0)[1]
    mesh, material = sector_mesh(gear, recipe), Material()
    body, whole = gear_body(mesh, material, "strain", gear.face_width, with_stress=False), whole_gear(mesh)
    parts = element_stiffness(whole.points[whole.triangles], material, "strain", gear.face_width)
    unknowns = (2 * whole.triangles[:, :, None] + np.arange(2)).reshape(len(parts), 12)
    size = 2 * len(whole.points)
    rows, columns = np.broadcast_arrays(unknowns[:, :, None], unknowns[:, None, :])
    means = np.zeros((3, len(whole.points), 2))
    for start, middle, end in whole.boundaries["rim"]:  # Simpson's rule on an arc that is nearly straight
        length = np.linalg.norm(whole.points[end] - whole.points[start])
        for node, share in ((start, 1 / 6), (middle, 4 / 6), (end, 1 / 6)):
            x, y = whole.points[node]
            means[:, node] += share * length * np.array([[1.0, 0.0], [0.0, 1.0], [-y, x]])
    held = means.reshape(3, size) * parts.max()
    at = np.nonzero(held)
    system = coo_matrix(
        (
            np.concatenate([parts.ravel(), held[at], held[at]]),
            (
                np.concatenate([rows.ravel(), size + at[0], at[1]]),
                np.concatenate([columns.ravel(), at[1], size + at[0]]),
            ),
        )
    ).tocsc()
    load, tooth, node = np.zeros(size + 3), 5, len(body.flank.nodes) // 2
    numbers = [own[body.flank.nodes] for own in whole.numbers]
    load[2 * numbers[0][node] + 1] = 1e6
    moved = spsolve(system, load)[:size].reshape(-1, 2)
    for step in (0, 1, tooth):
        unit = np.zeros(2 * len(body.flank.nodes))
        unit[2 * node + 1] = 1e6
        answer = body.interface @ body.driven(step) @ unit + (body.own @ unit if step == 0 else 0.0)
        c, s = math.cos(step * mesh.pitch), math.sin(step * mesh.pitch)
        turned = answer.reshape(-1, 2) @ np.array([[c, s], [-s, c]])
        np.testing.assert_allclose(turned, moved[numbers[step]], atol=2e-4 * np.abs(moved).max())


def test_a_free_rim_is_softer_and_its_check_is_refused() -> None:
    angles = [0.05]
    curves = {}
    for rim in ("bolted", "free"):
        pair = GearPair(PLANET, replace(RING, rim=rim, rim_diameter=0.4))
        curves[rim] = sweep_stiffness(pair, torque=500.0, angles=angles, coarsen=2.0).k_mesh[0]
    assert curves["free"] < curves["bolted"]
    with pytest.raises(InputError, match=r"wheel.rim.*bolted"):
        whole_pair(pair, PairModel())


def test_the_mesh_has_the_area_of_the_ring() -> None:
    mesh = sector_mesh(RING, sector_recipes(PAIR)[1])
    whole = whole_gear(mesh)
    assert set(whole.boundaries) == {"rim", "root", "flank_right", "flank_left", "tip"}
    corners = whole.points[whole.triangles]
    r = np.array([1 / 6, 2 / 3, 1 / 6])
    s = np.array([1 / 6, 1 / 6, 2 / 3])
    t = 1.0 - r - s
    slopes = np.stack(
        [
            np.stack([1 - 4 * t, 4 * r - 1, 0 * r, 4 * (t - r), 4 * s, -4 * s], axis=-1),
            np.stack([1 - 4 * t, 0 * r, 4 * s - 1, -4 * r, 4 * r, 4 * (t - s)], axis=-1),
        ]
    )
    jacobian = np.einsum("iqa,eaj->eqij", slopes, corners)
    area = np.linalg.det(jacobian).sum() / 6.0
    half = RING.profile.polyline(2000)
    z = half[:, 0] + 1j * half[:, 1]
    free = 61 * abs(np.sum((z[:-1].conj() * z[1:]).imag))  # two halves of 1/2 each
    assert area == pytest.approx(math.pi * 0.14**2 - free, rel=1e-4)


@pytest.mark.parametrize("gear", [0, 1])
def test_a_thicker_flank_touches_earlier_by_as_much(gear: int) -> None:
    height, sides = 3e-6, [ToothDeviations(), ToothDeviations()]
    rolls = [-0.1, 0.1]
    sides[gear] = ToothDeviations(profiles=(Deviation.straight(rolls, [height, height]),))
    twist = first_contact_curve(PAIR, np.array([0.05, -0.1]), deviations=(sides[0], sides[1]))
    np.testing.assert_allclose(twist, -height / RING.base_radius, rtol=1e-6)


def test_a_pitch_error_of_one_tooth_counts_where_that_tooth_meets() -> None:
    error, turn = 4e-6, np.zeros(61)
    turn[-1] = error / RING.reference_radius
    sides = ToothDeviations(), ToothDeviations(turn=tuple(turn))
    for number, shift in ((0, -error * math.cos(ANGLE) / RING.base_radius), (1, 0.0)):
        angle = np.array([0.05 - number * PAIR.mesh_cycle])
        assert first_contact_curve(PAIR, angle, number=number, deviations=sides)[0] == pytest.approx(shift, abs=1e-13)


@pytest.mark.parametrize("tip_round", [0.0, 3e-4])
def test_places_of_a_radius_on_a_ring_flank(tip_round: float) -> None:
    face = face_of(replace(RING, tip_round=tip_round))
    u = np.linspace(0.0, face.end, 41)
    np.testing.assert_allclose(face.at_radius(np.abs(face.points(u))), u, atol=1e-6)
    curvature = face.turning(np.array([0.3]))[0][0]
    assert curvature == pytest.approx(1.0 / face.flank.roll(np.array(0.3)), rel=1e-4)


def test_many_teeth_in_contact_and_conforming_flanks() -> None:
    """A planet of 50 teeth: candidates lie further apart than any of an external pair."""
    pair = GearPair(replace(PLANET, teeth=50, bore_diameter=0.08), RING)
    assert any("radially" in text for text in pair.warnings)
    curve = sweep_stiffness(pair, torque=500.0, angles=[0.0, 0.04], kinematics="small")
    assert (curve.status == "converged").all()
    assert (curve.beyond_validity == 0).all()


def test_contacts_that_are_wide_against_the_smaller_radius_are_flagged() -> None:
    """Of a soft pair near the start of the path, where the planet's radius of curvature is 7 mm."""
    soft = Material(5e8, 0.3)
    curve = sweep_stiffness(
        PAIR, torque=250.0, angles=[-0.3, -0.1], kinematics="small", coarsen=2.0, materials=(soft, soft)
    )
    assert (curve.status == "converged").all()
    assert curve.beyond_validity.tolist() == [1, 0]
    assert "half-planes do not hold" in " ".join(overlap_warnings(PAIR, curve.twist, curve.beyond_validity))


def test_loads_map_with_pitch_errors_and_root_stress() -> None:
    turn = tuple(1e-8 * np.sin(2.0 * np.pi * np.arange(61) / 61))
    elastic = solver().elastic.deviated((ToothDeviations(), ToothDeviations(turn=turn)))
    made = sweep_loads(PAIR, [200.0, 500.0], positions=3, mesh_cycles=1, root_stress=True, elastic=elastic)
    assert (made.cells.status == "converged").all()
    assert made.root is not None
    assert np.nanmin(made.root.stress) > 0.0
    # twice and a half the torque makes about as much more stress at the root
    ratio = np.nanmax(made.root.stress[1], axis=-1) / np.nanmax(made.root.stress[0], axis=-1)
    assert (np.abs(ratio / 2.5 - 1.0) < 0.2).all()


def test_a_mesh_law_holds_for_positions_that_it_was_not_fitted_to() -> None:
    model = position_solver(elastic_pair(PAIR, coarsen=2.0)).contact_model
    law = mesh_law(model, 6000.0, tolerance=0.02)
    assert law.base_radii == (PLANET.base_radius, RING.base_radius)
    rng = np.random.default_rng(46)
    angles = rng.uniform(-2.0, 2.0, 24)
    approach = law.first_contact(angles) + law.reach * rng.uniform(0.1, 1.0, 24)
    solved, made = solve_half_plane(model, angles, approach / RING.base_radius), law(angles, approach)
    np.testing.assert_allclose(RING.base_radius * made.force, solved.torque_wheel, rtol=0.02)
    np.testing.assert_allclose(PLANET.base_radius * made.force + made.moment, solved.torque_pinion, rtol=0.02)


TEXT = """
[gears.planet]
teeth = 22
bore_diameter_mm = 43.2
rack_tip_radius = 0.25
module_mm = 4.0
pressure_angle_deg = 20.0
face_width_mm = 50.0
[gears.planet.microgeometry]
tip_relief_um = 10.0
tip_relief_length_mm = 3.0
[gears.ring]
teeth = -61
rim_diameter_mm = 280.0
addendum = 0.9
cutter_teeth = 23
rack_tip_radius = 0.1
tooth_thinning_um = 60.0
module_mm = 4.0
pressure_angle_deg = 20.0
face_width_mm = 50.0
[gears.ring.microgeometry]
tip_relief_um = 12.0
tip_relief_start_mm = 33.0
[meshes.outer]
driver = "planet"
driven = "ring"
[stiffness]
torque_Nm = 500.0
angle_step_deg = 4.0
coarsen = 2.0
[loadmap]
torques_Nm = [300.0, 500.0]
positions = 3
mesh_cycles = 1
"""


def test_commands_take_internal_pairs(tmp_path: Path) -> None:
    (tmp_path / "job.toml").write_text(TEXT)
    job, out = str(tmp_path / "job.toml"), str(tmp_path / "out")
    assert main(["stiffness", job, "--out", out, "--no-pictures", "--no-estimate", "--fields", "0"]) == 0
    table = read_numbers(tmp_path / "out" / "stiffness.csv", "table", ("torque_wheel_Nm", "k_mesh_N_per_m"))
    np.testing.assert_allclose(table["torque_wheel_Nm"], 500.0)
    assert (tmp_path / "out" / "fields.vtkhdf").exists()
    assert main(["loadmap", job, "--out", str(tmp_path / "map"), "--no-pictures"]) == 0
    summary = json.loads((tmp_path / "map" / "loadmap.json").read_text())
    assert "back" not in json.dumps(summary.get("positions", ""))
    assert main(["mesh", job, "--out", str(tmp_path / "gears.msh"), "--teeth", "1"]) == 0
    assert b"wheel_rim" in (tmp_path / "gears.msh").read_bytes()
