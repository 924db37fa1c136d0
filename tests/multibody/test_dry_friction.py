"""Dry friction smoothed over a narrow width of speed, against Coulomb's law in closed form: slip, stick, reversal."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from gearfe.base.typing import Array
from gearfe.mechanisms import load_mechanism
from gearfe.multibody import Body, Gravity, Hinge, Linkage, Moment, Status, System, Trajectory, integrate, polynomial
from gearfe.multibody.core.stopped import short_steps
from gearfe.multibody.core.trajectory import IntegrationError
from gearfe.multibody.planar.linkage import BodyVariables, StateFunction
from tests.places import GEOMETRY

MASS, LENGTH, G = 2.0, 1.0, 9.81
INERTIA = MASS * LENGTH**2 / 3  # of a bar about its end
TIGHT = 1e-9


class Friction(StateFunction):
    """``drive sin(3 t) - moment tanh(rate / width)`` of a body, or of a body against the one before."""

    def __init__(self, moment: float, width: float, body: int = 0, drive: float = 0.0) -> None:
        self.moment, self.width, self.drive = moment, width, drive
        self.terms = {3 * body + 2: 1.0} | ({3 * body - 1: -1.0} if body else {})

    def value(self, t: float, q: Array, v: Array) -> float:
        """Moment (N m)."""
        rate = sum(sign * v[i] for i, sign in self.terms.items())
        return float(self.drive * math.sin(3 * t) - self.moment * math.tanh(rate / self.width))

    def write(self, bodies: BodyVariables) -> int:
        """Its register."""
        tape = bodies.tape
        brake = tape.tanh(tape.sum(tape.rate(self.terms), f=1.0 / self.width))
        push = tape.sincos(tape.sum(tape.function(polynomial((0.0, 1.0))), f=3.0))[0]
        return tape.sum(push, brake, f=self.drive, g=-self.moment)


def bar(friction: Friction, *, gravity: bool = False, angle: float = 0.5, rate: float = 0.0) -> System:
    """A uniform bar hinged at its end."""
    body = Body("rod", MASS, MASS * LENGTH**2 / 12, (LENGTH / 2, 0.0), (0.0, 0.0), angle, (0.0, 0.0), rate)
    forces: tuple[Any, ...] = (Moment("rod", friction), *([Gravity((0.0, -G))] if gravity else []))
    return System([Linkage((body,), (Hinge("rod", "ground"),), forces)])


def run(system: System, method: str, end: float = 6.0) -> Trajectory:
    """Run at a tight tolerance; a few thousand steps must do."""
    return integrate(system, np.linspace(0.0, end, 601), method=method, tolerance=TIGHT, most_steps=5000)


@pytest.mark.parametrize("width", [1e-4, 1e-7, 1e-9])
def test_a_bar_slips_and_then_sticks(width: float) -> None:
    """The angle until it sticks is I w^2 / 2 M; it then creeps by nothing, as no load drives it."""
    moved = run(bar(Friction(0.5, width), rate=2.0), "auto")
    assert moved.q[-1, 2] - 0.5 == pytest.approx(INERTIA * 2.0**2 / (2 * 0.5), abs=1e2 * TIGHT + width**2)
    assert abs(moved.v[-1, 2]) < 1e-3 * width


@pytest.mark.parametrize("method", ["auto", "implicit"])
@pytest.mark.parametrize("width", [1e-7, 1e-9])
def test_a_load_drives_through_stiction(width: float, method: str) -> None:
    """Under A sin(3 t) it sticks until that is M, slides until its speed is none, and sticks until -A sin(3 t) is M."""
    drive, moment = 1.0, 0.6
    begin = math.asin(moment / drive) / 3.0

    def speed(t: float) -> float:
        return (drive / 3.0 * (math.cos(3 * begin) - math.cos(3 * t)) - moment * (t - begin)) / INERTIA

    end = brentq(speed, 2.0 * begin, math.pi / 3.0 + begin, xtol=1e-14)
    assert abs(drive * math.sin(3 * end)) < moment
    dt = end - begin
    cosines = math.cos(3 * begin) * dt - (math.sin(3 * end) - math.sin(3 * begin)) / 3.0
    slid = (drive / 3.0 * cosines - moment * dt**2 / 2.0) / INERTIA
    again = math.pi / 3.0 + begin
    moved = run(bar(Friction(moment, width, drive=drive)), method, 0.5 * (end + again))
    assert moved.q[-1, 2] - 0.5 == pytest.approx(slid, abs=1e2 * TIGHT + 5.0 * width)  # and creeps by some widths


def turning_angles(angle: float, moment: float, count: int) -> list[float]:
    """Where a pendulum turns: weight and friction do no work between two of these angles."""
    weight, found = MASS * G * LENGTH / 2, [angle]
    bottom = -math.pi / 2
    for _ in range(count):
        first, sense = found[-1], math.copysign(1.0, bottom - found[-1])

        def lost(other: float, first: float = first, sense: float = sense) -> float:
            return weight * (math.sin(first) - math.sin(other)) - moment * sense * (other - first)

        found.append(brentq(lost, bottom + 1e-3 * sense, bottom + abs(first - bottom) * sense, xtol=1e-14))
    return found


@pytest.mark.parametrize("method", ["taylor", "implicit", "auto"])
@pytest.mark.parametrize("width", [1e-4, 1e-7, 1e-9])
def test_friction_reverses_with_a_pendulum(width: float, method: str) -> None:
    """Every reversal takes place within the width: its turning angles follow from the energy alone."""
    moved = run(bar(Friction(0.6, width), gravity=True), method)
    times, rates = moved.time, moved.v[:, 2]
    turns = [k for k in range(1, len(times) - 1) if rates[k] * rates[k + 1] < 0.0]
    expected = turning_angles(0.5, 0.6, len(turns))[1:]
    assert len(turns) > 2

    def rate(t: float) -> float:
        return float(moved.dense(np.array([t]), 1)[0, 2])

    found = [float(moved.dense(np.array([brentq(rate, times[k], times[k + 1], xtol=1e-13)]))[0, 2]) for k in turns]
    assert found == pytest.approx(expected, abs=1e2 * TIGHT + 1e-2 * width)


def test_two_frictional_joints() -> None:
    """The joint between two bars sticks, the other slips; the energy lost is M times the angles travelled."""
    width, moment, first, second = 1e-7, 3.0, -0.5, -1.0
    tip = (math.cos(first), math.sin(first))
    bodies = (
        Body("one", MASS, MASS / 12, (0.5, 0.0), (0.0, 0.0), first),
        Body("two", MASS, MASS / 12, (0.5, 0.0), tip, second),
    )
    joints = (Hinge("one", "ground"), Hinge("one", "two", (1.0, 0.0), (0.0, 0.0)))
    loads = (Moment("one", Friction(moment, width)), Moment("two", Friction(moment, width, 1), "one"))
    system = System([Linkage(bodies, joints, (Gravity((0.0, -G)), *loads))])
    moved = run(system, "auto")
    assert moved.status is Status.DONE
    step = 3e-3  # a turn between two of these times is missed by up to 10 rad/s2 step^2/4: 1e-5 of the energy in all
    times = np.linspace(0.0, 6.0, round(6.0 / step) + 1)
    q = moved.dense(times)
    height, rates = q[:, 1] + q[:, 4], moved.v[-1]
    travelled = np.abs(np.diff(q[:, 2])).sum() + np.abs(np.diff(q[:, 5] - q[:, 2])).sum()
    kinetic = MASS / 2 * (rates[[0, 1, 3, 4]] ** 2).sum() + MASS / 24 * (rates[[2, 5]] ** 2).sum()
    assert MASS * G * (height[0] - height[-1]) - kinetic == pytest.approx(moment * travelled, rel=1e-5)
    assert abs(rates[5] - rates[2]) < 10.0 * width < abs(rates[2])


ARM = """
[run]
end_s = 0.3
step_s = 1e-3
[bodies.arm]
rate_rad_per_s = 2.0
points_m = { root = [0.0, 0.0], tip = [0.5, 0.0] }
[bodies.arm.beam]
length_m = 0.5
width_m = 0.02
height_m = 0.02
youngs_modulus_GPa = 2100.0
density_kg_per_m3 = 7800.0
elements = 2
damping_s = 1e-5
[bodies.weight]
mass_kg = 10.0
inertia_kg_m2 = 1e-6
position_m = [0.5, 0.0]
velocity_m_per_s = [0.0, 1.0]
[joints.root]
type = "hinge"
body = "arm"
point = "root"
[joints.tip]
type = "hinge"
body = "weight"
to = "arm"
to_point = "tip"
"""
FRICTION = """
[forces.friction]
type = "moment"
body = "{body}"
moment_N_m = "-{moment}*tanh(rate({body})/{width})"
"""


def rubbed(folder: Path, text: str, tolerance: float = 1e-6, **friction: Any) -> Trajectory:
    """Run a mechanism file with friction on a body; a few thousand steps must do."""
    path = folder / "mechanism.toml"
    path.write_text(text + FRICTION.format(**friction), encoding="utf-8")
    mechanism = load_mechanism(path)
    return integrate(
        mechanism.system, np.linspace(0.0, mechanism.file.run.end_s, 101), start=mechanism.start(), tolerance=tolerance,
        most_steps=5000,
    )  # fmt: skip


@pytest.mark.parametrize("width", [1e-3, 1e-5, 1e-7, 1e-9])
def test_the_root_of_an_elastic_beam_slips_and_sticks(tmp_path: Path, width: float) -> None:
    """A rigid arm would slip by I w^2/2M. The beam has M^2/2k of that energy when it sticks, k = 3 EI/L with shear.

    The moment sets in at once, which makes it vibrate, and the damper takes up to as much again.
    """
    moment, length = 40.0, 0.5
    inertia = 10.0 * length**2 + 7800.0 * 4e-4 * length**3 / 3.0
    bending, shear = 2100e9 * 0.02**4 / 12.0, 2100e9 / 2.6 * 4e-4 * 5.0 / 6.0
    energy = inertia * 2.0**2 / 2.0
    share = moment**2 / 2.0 * (length / (3.0 * bending) + 1.0 / (shear * length)) / energy
    moved = rubbed(tmp_path, ARM, body="arm", moment=moment, width=width)
    assert -2.0 * share < moved.q[-1, 2] / (energy / moment) - 1.0 < -share
    assert abs(moved.v[-1, 2]) < width


@pytest.mark.parametrize(("job", "body"), [("elastic_slider_crank", "rod"), ("elastic_coupler", "rocker")])
def test_friction_on_elastic_mechanisms_comes_to_its_limit(tmp_path: Path, job: str, body: str) -> None:
    """Widths of 1e-5, 1e-7 and 1e-9 rad/s give one motion within the tolerances of two runs and 0.2 s of creeping."""
    text, tolerance = (GEOMETRY / f"{job}.toml").read_text(encoding="utf-8"), 1e-5
    widths, motions = (1e-5, 1e-7, 1e-9), []
    for width in widths:
        (folder := tmp_path / str(width)).mkdir()
        motions.append(rubbed(folder, text, tolerance, body=body, moment=0.6, width=width).q)
    for width, motion in zip(widths[:2], motions[:2], strict=True):
        assert np.abs(motion - motions[2]).max() < 2.0 * tolerance + 0.2 * width


@pytest.mark.parametrize("width", [1e-14, 1e-16, 1e-18, 1e-20, 1e-22])
@pytest.mark.parametrize("widths_away", [0.1, 0.5, -5.0, 1e3])
def test_friction_that_reverses_faster_than_time_resolves_is_named(
    tmp_path: Path, width: float, widths_away: float
) -> None:
    """The moment M turns a node of the inertia I through the width w in the time I w/M: the decay where it sticks."""
    moment, step = 40.0, 3e-16
    (tmp_path / "arm.toml").write_text(ARM + FRICTION.format(body="arm", moment=moment, width=width), encoding="utf-8")
    mechanism = load_mechanism(tmp_path / "arm.toml")
    system, start = mechanism.system, mechanism.start()
    root = system.coordinate_names().index("arm_angle_rad")
    v, a = np.zeros((2, system.size))
    inertia = system.mass[root, root]
    v[root], a[root] = widths_away * width, -math.copysign(moment / inertia, widths_away)
    cause = short_steps(system, start, 0.1, (start.q, v, a), step, 0.3)
    assert cause.startswith(f"forces.friction.moment_N_m = '-40.0*tanh(rate(arm)/{width})' on arm ")
    named = re.search(r" within (\S+) s; let it build up over (\S+) times the range of speeds", cause)
    assert named is not None
    takes, wider = float(named[1]), float(named[2])
    assert 0.5 < takes / (inertia * width / moment) < 8.0
    assert 10.0 * step < wider * takes < 1e5 * step


@pytest.mark.parametrize(
    ("text", "body", "moment", "width"),
    [("arm", "arm", 40.0, 1e-12), ("arm", "arm", 40.0, 1e-22), ("elastic_slider_crank", "rod", 0.6, 1e-14),
     ("elastic_slider_crank", "rod", 0.6, 1e-18), ("elastic_slider_crank", "rod", 0.6, 1e-22)],
)  # fmt: skip
def test_a_run_that_stops_for_friction_says_how_to_change_it(
    tmp_path: Path, text: str, body: str, moment: float, width: float
) -> None:
    job = ARM if text == "arm" else (GEOMETRY / f"{text}.toml").read_text(encoding="utf-8")
    with pytest.raises(IntegrationError) as stopped:
        rubbed(tmp_path, job, body=body, moment=moment, width=width)
    cause = str(stopped.value)
    assert f"forces.friction.moment_N_m = '-{moment}*tanh(rate({body})/{width})' on {body} " in cause
    wider = re.search(r"let it build up over (\S+) times the range of speeds", cause)
    assert wider is not None
    assert rubbed(tmp_path, job, body=body, moment=moment, width=float(wider[1]) * width).status is Status.DONE
