"""Gear ratio, belt, rack, rolling: motion and reaction against closed forms, with every method, and in files."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.mechanisms import load_mechanism
from gearfe.mechanisms.results import reactions
from gearfe.multibody import (
    Body,
    Gravity,
    Hinge,
    Linkage,
    Moment,
    Prismatic,
    System,
    consistent_start,
    constant,
    integrate,
)
from gearfe.multibody.planar.bodies import Frames
from gearfe.multibody.planar.couplings import Belt, GearRatio, Rack
from gearfe.multibody.planar.joints import Joint, Rolling, Row
from tests.makers.files import mechanism_file

TIMES = np.linspace(0.0, 0.8, 5)
METHODS = [("taylor", 1e-11), ("implicit", 1e-6)]


def run(bodies, joints, forces, method: str, tolerance: float):  # type: ignore[no-untyped-def]
    system = System([Linkage(tuple(bodies), tuple(joints), tuple(forces))])
    return integrate(system, TIMES, method=method, tolerance=tolerance)


def two_shafts(**angles: float) -> tuple[list[Body], list[Hinge]]:
    bodies = [Body("a", 1.0, 0.3, angle=angles.get("a", 0.0)), Body("b", 1.0, 0.8, (0.0, 0.0), (2.0, 0.0))]
    return bodies, [Hinge("a", "ground"), Hinge("b", "ground", (0.0, 0.0), (2.0, 0.0))]


@pytest.mark.parametrize(("method", "tolerance"), METHODS)
@pytest.mark.parametrize(
    ("coupling", "ratio", "lever"),
    [
        (GearRatio("a", "b", -0.4), -0.4, 1.0),
        (Belt("a", "b", 0.1, 0.25), 0.4, 0.1),
        (Belt("a", "b", 0.1, 0.25, crossed=True), -0.4, 0.1),
    ],
)
def test_coupled_shafts_are_one_inertia(coupling, ratio, lever, method, tolerance):  # type: ignore[no-untyped-def]
    """(I_a + i^2 I_b) a'' = T; what passes through the coupling turns b: i^2 I_b a''."""
    bodies, hinges = two_shafts(a=0.7)
    made = run(bodies, [*hinges, coupling], [Moment("a", constant(2.0))], method, tolerance)
    acceleration = 2.0 / (0.3 + ratio**2 * 0.8)
    np.testing.assert_allclose(made.q[:, 2] - 0.7, 0.5 * acceleration * TIMES**2, atol=1e-7)
    np.testing.assert_allclose(made.q[:, 5], ratio * 0.5 * acceleration * TIMES**2, atol=1e-7)
    row = next(i for i, n in enumerate(made.system.row_names()) if "gear" in n or "belt" in n)
    np.testing.assert_allclose(np.abs(lever * made.multipliers[:, row]), ratio**2 * 0.8 * acceleration, rtol=1e-5)


@dataclass(frozen=True)
class Differential(Joint):
    """A carrier turns by the mean of two bodies' turns."""

    a: str
    b: str
    line: str
    name: str = ""

    def rows(self, frames: Frames) -> list[Row]:
        """theta_a + theta_b - 2 theta_line."""
        return [Row("angles", frames.angle(self.a) + frames.angle(self.b) - 2.0 * frames.angle(self.line))]


@pytest.mark.parametrize(("method", "tolerance"), METHODS)
def test_a_joint_may_hold_three_bodies(method: str, tolerance: float) -> None:
    """(I_a + I_c/4) a'' + I_c/4 b'' = T, I_c/4 a'' + (I_b + I_c/4) b'' = 0."""
    bodies, hinges = two_shafts()
    bodies.append(Body("c", 1.0, 0.4, (0.0, 0.0), (1.0, 0.0)))
    hinges.append(Hinge("c", "ground", (0.0, 0.0), (1.0, 0.0)))
    joints = [*hinges, Differential("a", "b", "c")]
    made = run(bodies, joints, [Moment("a", constant(2.0))], method, tolerance)
    a, b = np.linalg.solve([[0.3 + 0.1, 0.1], [0.1, 0.8 + 0.1]], [2.0, 0.0])
    for angle, acceleration in ((2, a), (5, b), (8, 0.5 * (a + b))):
        np.testing.assert_allclose(made.q[:, angle], 0.5 * acceleration * TIMES**2, atol=1e-7)


@pytest.mark.parametrize(("method", "tolerance"), METHODS)
def test_a_rack_carries_its_share(method: str, tolerance: float) -> None:
    """(I/r^2 + m) x'' = T/r - m g, the rack moves up."""
    bodies = [Body("pinion", 1.0, 0.02, angle=0.2), Body("rack", 3.0, 1.0, (0.0, 0.0), (0.1, 0.5))]
    joints = [
        Hinge("pinion", "ground"),
        Prismatic("rack", "ground", origin=(0.1, 0.0), direction=(0.0, 1.0)),
        Rack("rack", "pinion", 0.1, (0.0, 2.0)),
    ]
    made = run(bodies, joints, [Gravity(), Moment("pinion", constant(5.0))], method, tolerance)
    acceleration = (5.0 / 0.1 - 3.0 * 9.81) / (0.02 / 0.01 + 3.0)
    np.testing.assert_allclose(made.q[:, 4] - 0.5, 0.5 * acceleration * TIMES**2, atol=1e-7)
    np.testing.assert_allclose(made.q[:, 2] - 0.2, 5.0 * acceleration * TIMES**2, atol=1e-6)
    row = next(i for i, n in enumerate(made.system.row_names()) if "rack" in n and "length" in n)
    np.testing.assert_allclose(np.abs(made.multipliers[:, row]), 3.0 * (acceleration + 9.81), rtol=1e-5)


@pytest.mark.parametrize(("method", "tolerance"), METHODS)
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_wheel_rolls_down_a_slope(method: str, tolerance: float, side: float) -> None:
    """s'' = g sin(slope)/(1 + I/(m r^2)); friction is I s''/r^2, the normal force m g cos(slope)."""
    slope, r, m, inertia = -0.3, 0.2, 2.0, 0.05
    x, y = math.cos(slope), math.sin(slope)
    wheel = Body("wheel", m, inertia, position=(0.4 * x - side * r * y, 0.4 * y + side * r * x), angle=1.0)
    made = run([wheel], [Rolling("wheel", "ground", r, direction=(3 * x, 3 * y))], [Gravity()], method, tolerance)
    acceleration = -9.81 * y / (1.0 + inertia / (m * r * r))
    travel = (made.q[:, 0] - made.q[0, 0]) * x + (made.q[:, 1] - made.q[0, 1]) * y
    np.testing.assert_allclose(travel, 0.5 * acceleration * TIMES**2, atol=1e-7)
    np.testing.assert_allclose(made.q[:, 2] - 1.0, -side * travel / r, atol=1e-6)
    np.testing.assert_allclose(np.abs(made.multipliers[:, 0]), m * 9.81 * x, rtol=1e-5)
    np.testing.assert_allclose(np.abs(made.multipliers[:, 1]), inertia * acceleration / r**2, rtol=1e-5)


@pytest.mark.parametrize(("method", "tolerance"), METHODS)
def test_a_wheel_on_a_cart_and_momentum(method: str, tolerance: float) -> None:
    """On a free cart without forces: momentum stays, slip stays zero, energy stays."""
    cart = Body("cart", 4.0, 1.0, velocity=(0.5, 0.0))
    wheel = Body("wheel", 2.0, 0.05, position=(0.0, 0.2), rate=-7.0, velocity=(1.9, 0.0))
    joints = [Prismatic("cart", "ground"), Rolling("wheel", "cart", 0.2)]
    made = run([cart, wheel], joints, [], method, tolerance)
    np.testing.assert_allclose(made.v[:, 3] - made.v[:, 0] + 0.2 * made.v[:, 5], 0.0, atol=1e-6)
    np.testing.assert_allclose(
        4.0 * made.v[:, 0] + 2.0 * made.v[:, 3], 4.0 * made.v[0, 0] + 2.0 * made.v[0, 3], atol=1e-6
    )


def test_a_rolling_wheel_on_a_tilting_board_keeps_the_energy() -> None:
    board = Body("board", 3.0, 0.4, angle=0.1)
    wheel = Body("wheel", 1.0, 0.01, position=(-0.2 * math.sin(0.1) + 0.1, 0.2 * math.cos(0.1)))
    made = run([board, wheel], [Hinge("board", "ground"), Rolling("wheel", "board", 0.2)], [Gravity()], "taylor", 1e-11)
    total = sum(made.system.energy(made.q, made.v))
    assert np.ptp(total) < 1e-9


TRAIN = """
[run]
end_s = 0.5
step_s = 0.1
[bodies.motor]
mass_kg = 1.0
inertia_kg_m2 = 0.1
[bodies.load]
mass_kg = 1.0
inertia_kg_m2 = 0.9
position_m = [1.0, 0.0]
[joints.m]
type = "hinge"
body = "motor"
[joints.l]
type = "hinge"
body = "load"
to_point = [1.0, 0.0]
[joints.pair]
type = "gear"
body = "motor"
to = "load"
ratio = -0.5
[forces.drive]
type = "moment"
body = "motor"
moment_N_m = 1.3
"""

GEAR = '"gear"\nbody = "motor"\nto = "load"\nratio = -0.5'


def test_a_file_with_gears_and_its_reaction(tmp_path: Path) -> None:
    mechanism = load_mechanism(mechanism_file(tmp_path, TRAIN))
    made = integrate(mechanism.system, [0.0, 0.5], start=mechanism.start())
    acceleration = 1.3 / (0.1 + 0.25 * 0.9)
    assert made.v[-1, 2] == pytest.approx(0.5 * acceleration)
    assert reactions(mechanism, made)["pair_moment_N_m"][-1] == pytest.approx(0.1 * acceleration - 1.3)


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("ratio = -0.5\n", "", "ratio: is required"),
        ('to = "load"\n', "", "name the other body"),
        ("ratio = -0.5", "ratio = 0.0", r"joints\.pair\.ratio = 0.*must be finite and not 0"),
        ("ratio = -0.5", "ratio = -0.5\nradius_m = 1.0", "does not belong"),
        ('type = "gear"', 'type = "belt"', "does not belong|is required"),
        (
            GEAR,
            '"belt"\nbody = "motor"\nto = "load"\nradius_m = -0.1\nto_radius_m = 0.2',
            r"joints\.pair\.radius_m = -0\.1: must",
        ),
        (GEAR, '"rack"\nbody = "motor"\nto = "load"\nradius_m = 0.0', r"joints\.pair\.radius_m = 0"),
    ],
)
def test_wrong_couplings(tmp_path: Path, old: str, new: str, text: str) -> None:
    with pytest.raises(InputError, match=text):
        load_mechanism(mechanism_file(tmp_path, TRAIN.replace(old, new)))


def test_couplings_that_contradict_each_other_are_told(tmp_path: Path) -> None:
    """Two gear pairs of different ratios hold both shafts: nothing is free, and a speed contradicts them."""
    second = TRAIN + '[joints.other]\ntype = "gear"\nbody = "motor"\nto = "load"\nratio = -0.4\n'
    with pytest.raises(InputError, match=r"nothing is free to move .*, without 'pair' or 'other' something would be"):
        load_mechanism(mechanism_file(tmp_path, second)).start()
    driven = (
        second + '[joints.speed]\ntype = "prescribed"\nbody = "motor"\ncoordinate = "rate"\nmotion_rad_per_s = 3.0\n'
    )
    with pytest.raises(InputError, match="velocities cannot meet it"):
        load_mechanism(mechanism_file(tmp_path, driven)).start()


def test_wrong_radii() -> None:
    for wrong in (lambda: Belt("a", "b", 0.0, 1.0), lambda: Rack("a", "b", 0.0), lambda: Rolling("a", "b", -1.0)):
        with pytest.raises(InputError, match="radius"):
            wrong()


def test_starts_close(tmp_path: Path) -> None:
    """A wheel that starts off its line is put on it."""
    wheel = Body("wheel", 1.0, 0.1, position=(0.3, 0.25))
    system = System([Linkage((wheel,), (Rolling("wheel", "ground", 0.2),), ())])
    assert consistent_start(system).q[1] == pytest.approx(0.2, abs=1e-12)
