"""Cams with profiles from tables: lift, force and moment of a harmonic cam, energy, what wrong ones get."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from gearfe.base.errors import InputError
from gearfe.mechanisms import evaluate, load_mechanism
from gearfe.mechanisms.results import reactions
from gearfe.multibody import integrate

LIFT, MASS, SPRING, SPEED = 0.02, 0.5, 400.0, 30.0
CAM = f"""
[run]
end_s = 0.3
step_s = 0.01
[bodies.cam]
mass_kg = 1.0
inertia_kg_m2 = 0.01
[bodies.follower]
mass_kg = {MASS}
inertia_kg_m2 = 0.01
[joints.bearing]
type = "hinge"
body = "cam"
[joints.guide]
type = "prismatic"
body = "follower"
direction = [0.0, 1.0]
[joints.contact]
type = "cam"
body = "follower"
to = "cam"
coordinate = "y"
profile = "lift"
[tables.lift]
file = "lift.csv"
x = "angle"
y = "lift"
interpolation = "periodic"
"""
MOTOR = f"""
[joints.motor]
type = "prescribed"
body = "cam"
coordinate = "rate"
motion_rad_per_s = {SPEED}
[forces.spring]
type = "coordinate_spring"
body = "follower"
coordinate = "y"
stiffness_N_per_m = {SPRING}
"""


def write(folder: Path, text: str, points: int = 91, turn: float = 2 * math.pi) -> Path:
    angle = np.linspace(0.0, turn, points)
    rows = "\n".join(f"{a},{LIFT * (1.0 - math.cos(a))}" for a in angle)
    (folder / "lift.csv").write_text("angle,lift\n" + rows + "\n", encoding="utf-8")
    path = folder / "mechanism.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("method", ["taylor", "implicit"])
def test_a_harmonic_cam_lifts_and_pushes(tmp_path: Path, method: str) -> None:
    """y = h (1 - cos wt); force m y'' + k y, moment of the motor force times h sin wt."""
    mechanism = load_mechanism(write(tmp_path, CAM + MOTOR))
    times = np.linspace(0.0, 0.3, 31)
    run = integrate(mechanism.system, times, start=mechanism.start(), method=method, tolerance=1e-9)
    y = LIFT * (1.0 - np.cos(SPEED * times))
    force = MASS * LIFT * SPEED**2 * np.cos(SPEED * times) + SPRING * y
    np.testing.assert_allclose(run.q[:, 4], y, atol=1e-6 * LIFT)
    made = reactions(mechanism, run)
    np.testing.assert_allclose(made["contact_y_N"], force, atol=2e-3 * np.abs(force).max())
    np.testing.assert_allclose(made["motor_moment_N_m"], force * LIFT * np.sin(SPEED * times), atol=3e-3 * 0.3)
    inverse = load_mechanism(tmp_path / "mechanism.toml")
    assert inverse.start().freedoms.net == 0


def test_slopes_of_a_load_beside_many_cams(tmp_path: Path) -> None:
    """A motor's line by a table falls by 0.5 N m s, however many profiles stand on the tape before it."""
    text = CAM.replace("[bodies.follower]", "rate_rad_per_s = 3.0\n[bodies.follower]")
    table = CAM[CAM.index("[tables.lift]") :]
    for k in range(15):
        write(tmp_path, text, points=31 + k)
        (tmp_path / "lift.csv").rename(tmp_path / f"lift{k}.csv")
        text += table.replace("tables.lift]", f"tables.lift{k}]").replace("lift.csv", f"lift{k}.csv")
        text += (
            f'[joints.contact{k}]\ntype = "cam"\nbody = "follower"\nto = "cam"\ncoordinate = "y"\nprofile = "lift{k}"\n'
        )
    text += '[tables.line]\nfile = "line.csv"\nx = "rate"\ny = "moment"\n'
    text += '[forces.motor]\ntype = "moment"\nbody = "cam"\nmoment_N_m = "line(rate(cam))"\n'
    (tmp_path / "line.csv").write_text("rate,moment\n0,5\n4,3\n10,0\n", encoding="utf-8")
    linkage = load_mechanism(write(tmp_path, text)).linkage
    q, v = linkage.start()
    assert linkage.force(0.0, q, v)[2] == pytest.approx(3.5, rel=1e-14)
    by_q, by_v = linkage.force_jacobian(0.0, q, v)
    assert by_v[2, 2] == pytest.approx(-0.5, rel=1e-14)
    assert not by_q.any()


def test_a_free_cam_and_its_follower_keep_their_energy(tmp_path: Path) -> None:
    text = CAM.replace("[bodies.follower]", "rate_rad_per_s = 20.0\n[bodies.follower]")
    mechanism = load_mechanism(write(tmp_path, text))
    run = integrate(mechanism.system, np.linspace(0.0, 0.6, 13), start=mechanism.start(), tolerance=1e-9)
    energy = evaluate(mechanism, run).energy["total_J"]
    assert np.ptp(energy) < 1e-7 * energy[0]
    assert np.ptp(run.v[:, 2]) > 0.1  # the follower takes some and gives it back


@pytest.mark.parametrize(
    ("method", "tolerance", "error"), [("taylor", 1e-12, 1e-12), ("implicit", 1e-7, 1e-6), ("implicit", 1e-8, 1e-7)]
)
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_free_cam_turns_as_its_energy_says(
    tmp_path: Path, method: str, tolerance: float, error: float, sense: float
) -> None:
    """(I + m s'(a)^2) a'^2 = 2 E: the time to an angle a is an integral, by Gauss's points between the knots.

    The output times are those at which the cam is at a knot: a step across it would err by ten times the bound.
    """
    text = CAM.replace("[bodies.follower]", f"rate_rad_per_s = {20.0 * sense}\n[bodies.follower]")
    mechanism = load_mechanism(write(tmp_path, text, points=25))
    knots = np.linspace(0.0, 2 * math.pi, 25)
    spline = CubicSpline(knots, LIFT * (1.0 - np.cos(knots)), bc_type="periodic")
    x, weight = np.polynomial.legendre.leggauss(20)
    angles = (knots[:-1, None] + 0.5 * (1.0 + x) * np.diff(knots)[:, None]).ravel()
    inertia = 0.01 + MASS * np.array([0.0, *spline(angles, 1)]) ** 2
    turn = float(np.sqrt(inertia[1:] / (inertia[0] * 20.0**2)) @ np.tile(0.5 * weight * knots[1], 24))
    options = {"start": mechanism.start(), "method": method, "tolerance": tolerance}
    run = integrate(mechanism.system, [0.0, turn, 3.0 * turn], **options)
    np.testing.assert_allclose(run.q[1:, 2], 2 * math.pi * sense * np.array([1.0, 3.0]), rtol=error)
    np.testing.assert_allclose(run.q[1:, 4], 0.0, atol=error * LIFT)
    np.testing.assert_allclose(run.v[1:, 2], 20.0 * sense, rtol=error)


@pytest.mark.parametrize(
    ("old", "new", "turn", "text"),
    [
        ('"periodic"', '"cubic"', 2 * math.pi, "must be periodic over one turn"),
        ("", "", math.pi, "must end with its first value"),
        ("", "", 4 * math.pi, "must be periodic over one turn"),
        ('profile = "lift"', 'profile = "left"', 2 * math.pi, "left"),
        ('to = "cam"\n', "", 2 * math.pi, "name the other body"),
        ('coordinate = "y"', 'coordinate = "rate"', 2 * math.pi, "must be one of angle, x, y"),
    ],
)
def test_wrong_cams(tmp_path: Path, old: str, new: str, turn: float, text: str) -> None:
    with pytest.raises(InputError, match=text):
        load_mechanism(write(tmp_path, CAM.replace(old, new, 1), turn=turn))
