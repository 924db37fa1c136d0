"""The half-plane law in sweeps, at torques, in load maps and fields, next to the laws on the mesh."""

from __future__ import annotations

import math
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from gearfe import InputError
from gearfe.cli.main import main
from gearfe.fem.plane import Material
from gearfe.gears.contact.compliance import MeshingPair, finite_strain_shares
from gearfe.gears.contact.laws import HalfPlane, on_elements
from gearfe.gears.gearmesh.curve import StiffnessCurve
from gearfe.gears.gearmesh.positions import position_solver
from gearfe.gears.gearmesh.sweep import elastic_pair, sweep_loads, sweep_stiffness
from tests.makers.gears import pair as gear_pair
from tests.makers.solving import solve_positions

PAIR = gear_pair(tip_round=1e-4)
ANGLES = (np.arange(5) + 0.3) * PAIR.mesh_cycle / 5
POLYMER, STEEL = Material(3e9, 0.38), Material(210e9, 0.3)


@lru_cache
def elastic_of(law: str) -> MeshingPair:
    return elastic_pair(PAIR, law=law)


@pytest.mark.parametrize("kinematics", ["small", "finite"])
def test_curve_beside_nitsches(kinematics: str) -> None:
    options = {"twist": math.radians(0.3), "angles": ANGLES, "kinematics": kinematics}
    found = sweep_stiffness(PAIR, elastic=elastic_of("half_plane"), law="half_plane", **options)
    expected = sweep_stiffness(PAIR, elastic=elastic_of("nitsche"), **options)
    assert set(found.law) == {"half_plane"}
    assert found.contact_law == "half_plane"
    for name, bound in (
        ("k_mesh", 1e-3),
        ("torque_pinion", 1e-3),
        ("torque_wheel_reaction", 1e-3),
        ("k_tangent", 5e-3),
    ):
        assert getattr(found, name) == pytest.approx(getattr(expected, name), rel=bound), name
    assert found.load_share == pytest.approx(expected.load_share, abs=2e-3)
    assert found.transmission_error_unloaded == pytest.approx(expected.transmission_error_unloaded, abs=1e-15)


@pytest.mark.parametrize("other", [0, 4])
def test_positions_with_loads_take_one_that_is_solved_again_without(other: int) -> None:
    """As where a torque changes a little at a position whose loads nobody asks for."""
    solver, twists = position_solver(elastic_of("half_plane")), np.full(5, math.radians(0.3))
    kept = np.array([1, 3])
    found, again = solver.solve(ANGLES, twists, kept), solver.solve(ANGLES[[other]], twists[[other]])
    made = found.replaced(np.array([other]), again)
    assert made.torque_wheel == pytest.approx(found.torque_wheel, rel=1e-12)
    for one, before in zip(made.loads, found.loads, strict=True):
        assert np.array_equal(one.position, before.position)
        assert np.array_equal(one.force, before.force)


def test_share_of_finite_strain() -> None:
    """From the forces and their rates on a coarse flank as from Nitsche's on a fine one."""
    twist = math.radians(0.4)
    solver = position_solver(elastic_of("half_plane"))
    found = finite_strain_shares(solver.elastic, solver.solve(ANGLES, np.full(5, twist), np.arange(5)))
    fine = elastic_of("nitsche")
    expected = finite_strain_shares(fine, solve_positions(fine, ANGLES, twist))
    assert found == pytest.approx(expected, rel=0.03)


def test_nodal_loads_have_the_moments_of_the_contacts() -> None:
    """What fields are recovered from: forces on both gears cancel and make the reactions at the wheel's bore."""
    solver = position_solver(elastic_of("half_plane"))
    for position, angle in zip(solver.solve(ANGLES, np.full(5, 2e-3), np.arange(5)), ANGLES, strict=True):
        total, wheel = 0j, 0.0
        for gear, body in enumerate(solver.elastic.bodies):
            for tooth, load in zip(position.loads[gear].tooth, position.loads[gear].force, strict=True):
                turn = np.exp(1j * solver.elastic.tooth_angle(gear, tooth, angle, 2e-3))
                forces, places = load.view(complex) * turn, body.flank.points @ np.array([1, 1j]) * turn
                total += forces.sum()
                wheel -= gear * (np.conj(places) * forces).imag.sum()
        size = np.abs(position.contacts.force).sum()
        assert abs(total) < 1e-9 * size
        assert wheel == pytest.approx(position.torque_wheel_reaction, rel=1e-6)


@pytest.mark.parametrize("law", ["half_plane", "nitsche"])
def test_rates_are_those_of_differences(law: str) -> None:
    solver = position_solver(elastic_of(law))
    twist, step = 3e-3, 1e-5
    low, middle, high = (solver.solve(ANGLES, np.full(5, twist + k * step), np.arange(5)) for k in (-1, 0, 1))
    for one, two, three in zip(low, middle, high, strict=True):
        rate = (three.contacts.force - one.contacts.force) / (2 * step)
        assert two.contacts.force_rate == pytest.approx(rate, rel=1e-2)
        turned = np.angle(three.contacts.normal / one.contacts.normal) / (2 * step)
        if law == "nitsche":  # a normal by panels is not smooth where a tip begins to bear
            assert two.contacts.normal_rate == pytest.approx(turned, abs=0.02)
        assert two.tangent == pytest.approx((three.torque_wheel - one.torque_wheel) / (2 * step), rel=3e-3)


def test_contacts_on_the_mesh_are_those_of_half_planes() -> None:
    """Force, place, material and normal of every contact, by another formulation of it."""
    twists = np.full(5, math.radians(0.2))
    found, other = (
        position_solver(elastic_of(law)).solve(ANGLES, twists).contacts for law in ("nitsche", "half_plane")
    )
    assert np.array_equal(found.pair, other.pair)
    assert found.force == pytest.approx(other.force, rel=4e-3)
    assert np.abs(found.normal / other.normal - 1).max() < 1e-3
    assert (np.abs(found.point - other.point) / other.half_width).max() < 0.1
    assert (np.abs(found.arc - other.arc) / other.half_width[:, None]).max() < 0.1
    assert found.half_width == pytest.approx(other.half_width, rel=0.03)


def test_given_torque() -> None:
    torque = 150.0
    found = sweep_stiffness(PAIR, torque=torque, angles=ANGLES, law="half_plane", elastic=elastic_of("half_plane"))
    assert set(found.status) == {"converged"}
    assert found.torque_wheel == pytest.approx(torque, rel=1e-6)
    again = sweep_stiffness(
        PAIR, twist=found.twist[2], angles=ANGLES[2:3], law="half_plane", elastic=elastic_of("half_plane")
    )
    assert again.torque_wheel == pytest.approx(torque, rel=2e-4)  # its own share of finite strain


def test_load_map() -> None:
    torques = [20.0, 60.0, 200.0]
    found = sweep_loads(PAIR, torques, angles=ANGLES, law="half_plane", elastic=elastic_of("half_plane"))
    for curve, torque in zip(found.curves, torques, strict=True):
        assert set(curve.status) == {"converged"}
        direct = sweep_stiffness(PAIR, torque=torque, angles=ANGLES, law="half_plane", elastic=elastic_of("half_plane"))
        assert curve.k_mesh == pytest.approx(direct.k_mesh, rel=3e-4)
        assert curve.peak_pressure == pytest.approx(direct.peak_pressure, rel=3e-4, nan_ok=True)


def test_no_other_solver_takes_it() -> None:
    with pytest.raises(InputError, match=r"gearfe.gears.contact.half_plane solves it"):
        on_elements(HalfPlane())
    assert not position_solver(elastic_of("half_plane")).on_elements
    assert isinstance(elastic_of("half_plane").law, HalfPlane)


JOB = """
[pair]
pressure_angle_deg = 25.0
face_width_mm = 10.0
tip_round_mm = 0.1
[pair.pinion]
teeth = 20
pitch_diameter_mm = 50.0
bore_diameter_mm = 10.0
[pair.wheel]
teeth = 30
pitch_diameter_mm = 75.0
bore_diameter_mm = 15.0
[pair.material]
youngs_modulus_GPa = 200.0
poisson_ratio = 0.3
[stiffness]
twist_deg = 0.05
angle_step_deg = 6.0
law = "half_plane"
"""


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    job = tmp_path / "job.toml"
    job.write_text(JOB)
    assert main(["stiffness", str(job), "--out", str(tmp_path / "out"), "--no-pictures", "--fields"]) == 0
    assert "half_plane" in capsys.readouterr().out
    curve = StiffnessCurve.from_csv(tmp_path / "out" / "stiffness.csv")
    assert set(curve.law) == {"half_plane"}
    rows = np.genfromtxt(tmp_path / "out" / "pressure.csv", delimiter=",", names=True, dtype=None, encoding="utf8")
    pressed = rows["pressure_MPa"][np.abs(rows["pinion_angle_deg"] - 6.0) < 1e-6]
    assert pressed.max() == pytest.approx(1e-6 * curve.peak_pressure[1], rel=0.02)
    job.write_text(JOB + 'law_sides = "pinion"\n')
    assert main(["stiffness", str(job), "--out", str(tmp_path / "out")]) != 0
    assert "law_sides" in capsys.readouterr().err


@pytest.mark.parametrize("torque", [0.3, 12.0])
def test_estimate_covers_a_plastic_pinion_on_a_steel_wheel(torque: float) -> None:
    """From light loads to where sharp tips dig in: the error against a mesh 2.9 times finer, at all positions."""
    pinion = {"profile_shift": 0.4, "bore": 8e-3 / 27e-3}
    wheel = {"profile_shift": -0.4, "bore": 20e-3 / 75e-3}
    pair = gear_pair(18, 50, module=1.5e-3, pressure_angle=20.0, width=12e-3, pinion=pinion, wheel=wheel)
    angles = (np.arange(8) + 0.19) * pair.mesh_cycle / 8
    options = {"torque": torque, "angles": angles, "materials": (POLYMER, STEEL)}
    found = sweep_stiffness(pair, estimate_error=True, **options)
    finer = sweep_stiffness(pair, coarsen=0.35, **options)
    true = np.abs(found.k_mesh / finer.k_mesh - 1)
    assert (true < found.relative_error).all()
    assert np.median(found.relative_error / true) < 10


def test_estimate_covers_what_a_finer_mesh_shows() -> None:
    """From influence functions of two meshes; against elements half as large."""
    options = {"twist": math.radians(0.05), "angles": ANGLES, "law": "half_plane", "kinematics": "small"}
    found = sweep_stiffness(PAIR, estimate_error=True, elastic=elastic_of("half_plane"), **options)
    finer = sweep_stiffness(PAIR, coarsen=0.5, flank_coarsen=0.5, **options)
    true = np.abs(finer.k_mesh / found.k_mesh - 1)
    assert (true <= found.relative_error).all()
    assert found.worst_error < 3e-3
