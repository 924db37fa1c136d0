"""Cams with profiles from tables: lift, force and moment of a harmonic cam, energy, what wrong ones get."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from gearfe.errors import InputError
from gearfe.mechanisms import evaluate, load_mechanism
from gearfe.mechanisms.results import reactions
from gearfe.rigid import integrate

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
motion = {SPEED}
[forces.spring]
type = "coordinate_spring"
body = "follower"
coordinate = "y"
stiffness = {SPRING}
"""


def write(folder: Path, text: str, points: int = 91, turn: float = 2 * math.pi) -> Path:
    angle = np.linspace(0.0, turn, points)
    rows = "\n".join(f"{a},{LIFT * (1.0 - math.cos(a))}" for a in angle)
    (folder / "lift.csv").write_text("angle,lift\n" + rows + "\n", encoding="utf-8")
    path = folder / "mechanism.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("method", ["explicit", "implicit"])
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


def test_a_free_cam_and_its_follower_keep_their_energy(tmp_path: Path) -> None:
    text = CAM.replace("[bodies.follower]", "rate_rad_per_s = 20.0\n[bodies.follower]")
    mechanism = load_mechanism(write(tmp_path, text))
    run = integrate(mechanism.system, np.linspace(0.0, 0.6, 13), start=mechanism.start(), tolerance=1e-9)
    energy = evaluate(mechanism, run).energy["total_J"]
    assert np.ptp(energy) < 1e-7 * energy[0]
    assert np.ptp(run.v[:, 2]) > 0.1  # the follower takes some and gives it back


@pytest.mark.parametrize(
    ("old", "new", "turn", "text"),
    [
        ('"periodic"', '"cubic"', 2 * math.pi, "must be periodic over one turn"),
        ("", "", math.pi, "must end with the value"),
        ("", "", 4 * math.pi, "must be periodic over one turn"),
        ('profile = "lift"', 'profile = "left"', 2 * math.pi, "left"),
        ('to = "cam"\n', "", 2 * math.pi, "name the other body"),
        ('coordinate = "y"', 'coordinate = "rate"', 2 * math.pi, "must be one of angle, x, y"),
    ],
)
def test_wrong_cams(tmp_path: Path, old: str, new: str, turn: float, text: str) -> None:
    with pytest.raises(InputError, match=text):
        load_mechanism(write(tmp_path, CAM.replace(old, new, 1), turn=turn))
