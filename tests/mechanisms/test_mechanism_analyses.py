"""Equilibrium, modes and inverse dynamics of mechanisms, against closed forms and against forward dynamics."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.cli.main import main
from gearfe.mechanisms import load_mechanism
from gearfe.mechanisms.rest import run_rest
from gearfe.multibody import (
    Body,
    CoordinateSpring,
    Fixed,
    Gravity,
    Hinge,
    Linkage,
    Moment,
    System,
    consistent_start,
    constant,
    integrate,
)
from gearfe.multibody.core.equilibrium import equilibrium
from gearfe.multibody.core.inverse import prescribed_motion
from gearfe.multibody.core.modes import modes
from gearfe.multibody.planar.beam import Beam
from gearfe.multibody.planar.beam_link import BeamLink, Section
from gearfe.multibody.planar.turning import TurningFrame
from tests.makers.files import csv_rows, mechanism_file
from tests.places import GEOMETRY

ROD = """
title = "rod"
[run]
end_s = 1.0
step_s = 0.05
modes = 1
[bodies.rod]
mass_kg = 2.0
inertia_kg_m2 = 0.5
centre_m = [0.5, 0.0]
angle_deg = 30.0
points_m = { O = [0.0, 0.0], tip = [1.0, 0.0] }
[joints.O]
type = "hinge"
body = "rod"
[forces.gravity]
type = "gravity"
acceleration_m_per_s2 = [0.0, -9.81]
[forces.damper]
type = "coordinate_spring"
body = "rod"
coordinate = "angle"
damping_Nm_s_per_rad = 0.4
[[outputs]]
name = "angle_rad"
value = "angle(rod)"
"""
DRIVE = """
[joints.motor]
type = "prescribed"
body = "rod"
coordinate = "angle"
motion_rad = { constant = 0.5235987755982988, sine = 0.8, frequency_hz = 1.0 }
"""


def test_a_pendulum_hangs_and_swings(tmp_path: Path) -> None:
    """l^2 (I + m r^2) + l c + m g r = 0, from a start 120 deg away."""
    out = tmp_path / "out"
    assert main(["mechanism", str(mechanism_file(tmp_path, ROD)), "--analysis", "modes", "--out", str(out)]) == 0
    summary = json.loads((out / "summary.json").read_text())
    assert summary["outputs"]["angle_rad"] == pytest.approx(-math.pi / 2, abs=1e-10)
    inertia, stiffness = 0.5 + 2.0 * 0.25, 2.0 * 9.81 * 0.5
    (mode,) = csv_rows(out / "modes.csv")
    omega = math.sqrt(stiffness / inertia)
    assert float(mode["frequency_Hz"]) == pytest.approx(omega / (2 * math.pi), rel=1e-10)
    assert float(mode["damping_ratio"]) == pytest.approx(0.4 / (2 * inertia * omega), rel=1e-10)
    (reaction,) = csv_rows(out / "reactions.csv")
    assert float(reaction["O_y_N"]) == pytest.approx(2.0 * 9.81, rel=1e-10)
    assert {"equilibrium.csv", "bodies.csv", "shapes.csv", "modes.png", "picture.png"} <= {
        p.name for p in out.iterdir()
    }


def test_equilibrium_is_the_least_energy() -> None:
    """Two hinged rods with springs under gravity: no disturbance on the joints lowers the energy."""
    bodies = [Body(n, 1.0, 0.1, (0.5, 0.0), (x, 0.0), 0.1) for n, x in (("a", 0.0), ("b", 1.0))]
    joints = [Hinge("a", "ground"), Hinge("b", "a", (0.0, 0.0), (1.0, 0.0))]
    forces = [Gravity(), CoordinateSpring("a", "angle", 8.0), CoordinateSpring("b", "angle", 5.0, relative_to="a")]
    system = System([Linkage(tuple(bodies), tuple(joints), tuple(forces))])
    found = equilibrium(system, consistent_start(system))
    least = system.energy(found.q, 0.0 * found.q)[1]
    rng = np.random.default_rng(4)
    for _ in range(20):
        near = consistent_start(system, q=found.q + 1e-3 * rng.standard_normal(system.size)).q
        far = np.abs(near - found.q).max()
        assert system.energy(near, 0.0 * near)[1] > least + 0.1 * far**2


def test_two_masses_on_springs_have_the_modes_of_the_book() -> None:
    """m x'' + K x = 0, K = k [[2, -1], [-1, 1]]: w^2 = k/m (3 -+ sqrt 5)/2, here with inertia on torsion springs."""
    bodies = tuple(Body(n, 1.0, 0.2) for n in "ab")
    joints = (Hinge("a", "ground"), Hinge("b", "ground"))
    forces = (CoordinateSpring("a", "angle", 5.0), CoordinateSpring("b", "angle", 5.0, relative_to="a"))
    system = System([Linkage(bodies, joints, forces)])
    start = consistent_start(system)
    found = modes(system, start, equilibrium(system, start), 5)
    expected = np.sqrt(25.0 * (3.0 + np.array([-1.0, 1.0]) * math.sqrt(5.0)) / 2.0)
    np.testing.assert_allclose(2 * math.pi * found.frequencies, expected, rtol=1e-12)
    np.testing.assert_allclose(found.damping_ratios, 0.0, atol=1e-10)
    golden = (1.0 + math.sqrt(5.0)) / 2.0
    assert found.shapes[0, 5].real / found.shapes[0, 2].real == pytest.approx(golden, rel=1e-9)


@pytest.mark.parametrize(
    ("speed", "out_of_plane"),
    [(0.0, (3.5160, 22.0345)), (1.0, (3.6816, 22.1810)), (3.0, (4.7973, 23.3203)), (10.0, (11.2023, 33.6404))],
)
def test_a_rotating_beam_stiffens(speed: float, out_of_plane: tuple[float, float]) -> None:
    """Wright, Smith, Thresher & Wang, J. Appl. Mech. 49 (1982) 197-202: in the plane w^2 = w_out^2 - Omega^2."""
    second = 1e-8
    section = Section(1e-2, second, shear_factor=1.0)
    link = BeamLink(
        "rod", 1.0, section, 1.0 / second, 100.0, poisson_ratio=-0.5, elements=6
    )  # EI = rho A = 1, EA = 1e6
    linkage = Linkage(link.nodes(), (Fixed("rod"),), (TurningFrame(speed),))
    system = System([linkage, Beam(linkage, link)])
    start = consistent_start(system)
    found = modes(system, start, equilibrium(system, start), 2)
    expected = np.sqrt(np.array(out_of_plane) ** 2 - speed**2)
    np.testing.assert_allclose(2 * math.pi * found.frequencies, expected, rtol=6e-4)


def test_extension_in_a_turning_frame() -> None:
    """E A u'' + rho A w^2 (s + u) = 0 with u(0) = 0, u'(L) = 0: s + u = sin(k s)/(k cos(k L)), k^2 = rho w^2/E."""
    link = BeamLink("rod", 1.0, Section.rectangle(0.01, 0.01), 2e9, 7850.0, elements=3)
    omega = 100.0
    linkage = Linkage(link.nodes(), (Fixed("rod"),), (TurningFrame(omega),))
    system = System([linkage, Beam(linkage, link)])
    found = equilibrium(system, consistent_start(system))
    k = math.sqrt(7850.0 / 2e9) * omega
    assert found.q[-3] == pytest.approx(math.tan(k) / k, rel=1e-9)
    assert found.q[-3] - 1.0 == pytest.approx(7850.0 * omega**2 / (3 * 2e9), rel=0.03)


def test_a_free_body_in_a_turning_frame_moves_straight() -> None:
    """Seen from the frame: x + i y = (x0 + v0 t) exp(-i w t)."""
    w = 2.0
    body = Body("b", 3.0, 1.0, position=(1.0, 0.0), velocity=(0.0, -w))  # at rest in space
    system = System([Linkage((body,), (), (TurningFrame(w),))])
    run = integrate(system, np.linspace(0.0, 1.0, 5), tolerance=1e-11)
    np.testing.assert_allclose(run.q[:, 0] + 1j * run.q[:, 1], np.exp(-1j * w * run.time), atol=1e-9)


def test_inverse_dynamics_of_a_driven_pendulum_is_the_closed_form(tmp_path: Path) -> None:
    out = tmp_path / "out"
    path = mechanism_file(tmp_path, ROD + DRIVE)
    assert (
        main(["mechanism", str(path), "--analysis", "inverse", "--reactions", "--out", str(out), "--no-pictures"]) == 0
    )
    table, motion = csv_rows(out / "reactions.csv"), csv_rows(out / "trajectory.csv")
    t = np.array([float(r["time_s"]) for r in table])
    w = 2 * math.pi
    angle, rate = math.radians(30) + 0.8 * np.sin(w * t), 0.8 * w * np.cos(w * t)
    torque = 1.0 * (-0.8 * w * w * np.sin(w * t)) + 2.0 * 9.81 * 0.5 * np.cos(angle) + 0.4 * rate
    np.testing.assert_allclose([float(r["angle_rad"]) for r in motion], angle, atol=1e-12)
    np.testing.assert_allclose([float(r["motor_moment_N_m"]) for r in table], torque, atol=1e-9)


def test_inverse_is_forward_dynamics_of_a_four_bar() -> None:
    """The moment found for the motion makes the motion when it drives the free mechanism."""
    root = GEOMETRY / "andrews.toml"
    mechanism = load_mechanism(root)
    times = np.linspace(0.0, 0.01, 6)
    free = integrate(mechanism.system, times, start=mechanism.start(), tolerance=1e-11)
    drive = mechanism.linkage.forces
    linkage = mechanism.linkage
    crank = next(f.body for f in drive if isinstance(f, Moment))
    k = 3 * linkage.body_index[crank] + 2
    # the angle of the free run as a polynomial of high degree, prescribed instead of the moment
    from gearfe.multibody import Prescribed, polynomial

    fine = np.linspace(0.0, 0.01, 200)
    fit = np.polynomial.Chebyshev.fit(fine, free.dense(fine)[:, k], 24).convert(kind=np.polynomial.Polynomial)
    joints = (*linkage.joints, Prescribed(crank, "angle", polynomial(tuple(fit.coef))))
    loads = tuple(f for f in drive if not isinstance(f, Moment))
    driven = System([Linkage(linkage.bodies, joints, loads)])
    made = prescribed_motion(driven, consistent_start(driven, q=free.q[0], v=free.v[0]), times)
    np.testing.assert_allclose(made.q, free.q, atol=1e-7)
    row = next(i for i, n in enumerate(driven.row_names()) if n.startswith("prescribed"))
    moment = next(float(f.function(0.0)) for f in drive if isinstance(f, Moment))
    np.testing.assert_allclose(-made.multipliers[1:-1, row], moment, rtol=1e-3)


@pytest.mark.parametrize(
    ("change", "analysis", "text"),
    [
        (('[joints.O]\ntype = "hinge"\nbody = "rod"\n', ""), "equilibrium", "was not found"),
        (("[0.0, -9.81]", "[0.0, 0.0]"), "equilibrium", "without force"),
        (("angle_deg = 30.0", "angle_deg = 90.0"), "equilibrium", "not stable"),
        (("[[outputs]]", DRIVE + "[[outputs]]"), "modes", "modes are those of a state of rest"),
        (("[[outputs]]", DRIVE + "[[outputs]]"), "equilibrium", "moves at 0 s"),
    ],
)
def test_what_has_no_rest_is_told(tmp_path: Path, change: tuple[str, str], analysis: str, text: str) -> None:
    made = ROD.replace(*change, 1).replace("[run]\n", f'[run]\nanalysis = "{analysis}"\n')
    with pytest.raises(InputError, match=text):
        run_rest(load_mechanism(mechanism_file(tmp_path, made)), tmp_path / "out")
    assert not list((tmp_path / "out").glob("*.csv"))


def test_a_motion_that_is_not_prescribed_whole_has_no_inverse(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    path = mechanism_file(tmp_path, ROD)
    assert main(["mechanism", str(path), "--analysis", "inverse", "--out", str(tmp_path / "out")]) == 2
    assert "prescribe a motion for each" in capsys.readouterr().err


def test_a_constant_load_bends_the_equilibrium() -> None:
    forces = (CoordinateSpring("a", "angle", 4.0), Moment("a", constant(1.0)))
    system = System([Linkage((Body("a", 1.0, 0.1),), (Hinge("a", "ground"),), forces)])
    assert equilibrium(system, consistent_start(system)).q[2] == pytest.approx(0.25, rel=1e-12)
