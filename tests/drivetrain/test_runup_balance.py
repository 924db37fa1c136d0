"""Harmonic balance and continuation against closed forms and an independent shooting code."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.drivetrain.runup.balance import Oscillator, error_of, solve
from gearfe.drivetrain.runup.first import first_motion
from gearfe.drivetrain.runup.linear import Linear
from tests.makers.oscillators import (
    around,
    duffing,
    meshing,
    rates,
    response_curve,
    settled_at,
    shooting,
    start_of,
    synthesis,
    turning_speed,
)


@pytest.mark.parametrize("heavy", [0.05, 3.0])
@pytest.mark.parametrize("shafts", [1, 3])
@pytest.mark.parametrize("alike", [False, True])
def test_flexibility_of_a_damped_gyroscopic_system(heavy, shafts, alike):
    """Against the dense dynamic stiffness; some modes are overdamped, some alike, as of equal planets.

    Forces that turn with the speed act along few directions, or along more than half as many as there are modes.
    """
    rng = np.random.default_rng(1)
    n, m, speed = 10, 3, 4.0
    squares = rng.uniform(10.0, 50.0, n) ** 2
    if alike:
        squares[5:] = squares[:5]
    root = rng.normal(size=(n, n))
    damping = np.diag(heavy * rng.uniform(1.0, 2.0) * np.ones(n)) if alike else heavy * root @ root.T
    places, tilts = rng.normal(size=(n, m)), rng.normal(size=(n, 2 * shafts))
    skew = np.kron(np.diag(rng.normal(size=shafts)), np.array([[0.0, -1.0], [1.0, 0.0]]))
    gyroscopic, stiffening = tilts @ skew @ tilts.T, 0.3 * tilts @ tilts.T
    linear = Linear(squares, damping, places, rng.normal(size=n), gyroscopic, stiffening, rng.normal(size=n))
    omega = np.array([0.0, 3.0, 20.0, 55.0])
    forces = rng.normal(size=(4, m)) + 1j * rng.normal(size=(4, m))
    forces[0] = forces[0].real
    for turning in (speed, 0.0, -2.0 * speed):
        H, modal = linear.flexibility(omega, turning), linear.modal(omega, turning, forces)
        constant = linear.constant + turning**2 * linear.thrown
        for number, w in enumerate(omega):
            Z = np.diag(squares - w**2) - turning**2 * stiffening + 1j * w * (damping - turning * gyroscopic)
            assert np.allclose(H[number], places.T @ np.linalg.solve(Z, places), rtol=1e-9, atol=1e-12)
            push = places @ forces[number] + (constant if w == 0.0 else 0.0)
            assert np.allclose(modal[number], np.linalg.solve(Z, push), rtol=1e-9, atol=1e-11)
        rest = places.T @ np.linalg.solve(np.diag(squares) - turning**2 * stiffening, constant)
        assert np.allclose(linear.rest(turning), rest, rtol=1e-11)


def test_a_part_that_moves_freely_is_refused():
    with pytest.raises(InputError, match="moves freely"):
        Linear(np.array([0.0, 1.0]), np.zeros((2, 2)), np.eye(2), np.zeros(2))


def test_a_linear_oscillator_has_its_closed_response():
    system = dataclasses.replace(duffing(0.0, 0.02, 0.5), load=0.3)
    for speed in (0.4, 1.0, 1.7):
        orbit = settled_at(system.oscillator, speed, 1e-10)
        assert orbit.places[0, 0].real == pytest.approx(0.3, rel=1e-9)
        assert abs(orbit.places[1, 0] - 0.5 / (1 - speed**2 + 0.04j * speed)) < 1e-8 * abs(orbit.places[1, 0])


@pytest.mark.parametrize("order", [1, 3])
def test_a_slowly_stiffening_spring_in_its_series(order):
    """``(1 + e cos) x = 1`` at no speed: x = 1/(1 + e cos), whose harmonics are known."""
    e = 0.3
    orbit = settled_at(meshing(e, 0.5, 1.0).oscillator, 1e-6, 1e-10)
    r = (math.sqrt(1 - e * e) - 1) / e
    assert orbit.places[order, 0].real == pytest.approx(2 * r**order / math.sqrt(1 - e * e), rel=1e-5)


def test_duffing_on_three_branches_and_its_turning_points():
    system = duffing(0.05, 0.03, 0.2)
    made = response_curve(system.oscillator, np.arange(0.8, 1.4, 0.02))
    assert made.note == ""
    assert len(made.turns) == 2
    assert sorted(set(made.branch)) == [0, 1, 2]
    three = [o for o in made.orbits if abs(o.speed - 1.1) < 1e-9]
    assert len(three) == 3
    for orbit in three:
        exact = shooting(system, orbit.speed, start_of(orbit))
        assert np.abs(start_of(orbit) - exact).max() < 1e-6
    for turn in made.turns:
        one, two = made.orbits[turn.number - 1], made.orbits[turn.number + 1]
        assert one.speed == two.speed
        exact = turning_speed(system, one.speed, start_of(one), start_of(two))
        assert turn.speed == pytest.approx(exact, rel=1e-3)


@pytest.mark.parametrize("beside", [1e-6, 1e-5, 1e-4, 3e-4, 1e-3])
def test_a_given_speed_beside_a_turning_point_is_on_each_branch_once(beside):
    """Where the orbit at a given speed is the one nearest to the turning point, too."""
    system, speeds = duffing(0.05, 0.03, 0.2), np.arange(0.8, 1.4, 0.02)
    up, down = (turn.speed for turn in response_curve(system.oscillator, speeds).turns)
    speeds = np.sort(np.append(speeds, [up * (1.0 - beside), down * (1.0 + beside)]))
    made = response_curve(system.oscillator, speeds)
    assert made.note == ""
    assert len(made.turns) == 2
    met = [(b, o.speed) for o, b in zip(made.orbits, made.branch, strict=True) if o.speed in speeds]
    assert len(met) == len(set(met))
    for turn, speed in zip(made.turns, (up, down), strict=True):
        assert made.orbits[turn.number].speed == pytest.approx(speed, rel=1e-2)


def test_an_oscillator_with_backlash_on_both_branches_and_its_jumps():
    """k (1 + e cos) with parting teeth: amplitude and jumps against shooting with located touches."""
    system, together = meshing(0.1, 0.03, 1.0), meshing(0.1, 0.03, 1.0, gap=0.0)
    made = response_curve(system.oscillator, np.arange(0.85, 1.1, 0.01), 2e-4, highest=20.0)
    assert made.note == ""
    assert len(made.turns) == 2
    for branch in (0, 1, 2):
        at = [o for o, b in zip(made.orbits, made.branch, strict=True) if b == branch and o.error > 0.0]
        for orbit in at[:: max(1, len(at) // 2)]:
            exact = shooting(system, orbit.speed, start_of(orbit), parts=True)
            assert np.abs(start_of(orbit) - exact).max() < 1e-3 * max(1.0, np.abs(exact).max())
            assert np.abs(start_of(orbit) - exact).max() < 5.0 * orbit.error
    up, down = (turn.speed for turn in made.turns)
    # up: where the motion of teeth that never part touches 0
    least = [synthesis(settled_at(together.oscillator, w, 1e-9).places, 4096).min() for w in (0.999 * up, 1.001 * up)]
    assert least[0] > 0.0 > least[1]
    # down: by shooting
    one, two = (made.orbits[made.turns[1].number + k] for k in (-1, 1))
    exact = turning_speed(system, one.speed, start_of(one), start_of(two), parts=True)
    assert down == pytest.approx(exact, rel=1e-3)


@pytest.mark.parametrize("speed", [0.7, 0.93, 1.0])
def test_a_first_motion_grows_out_of_rest(speed):
    """Before the resonance, and within it, where the large motion with parting teeth alone is left; by shooting."""
    system = meshing(0.1, 0.03, 1.0)
    orbit = first_motion(system.oscillator, speed, tolerance=1e-4, highest=20.0)
    assert orbit is not None
    exact = shooting(system, speed, start_of(orbit), parts=True)
    assert np.abs(start_of(orbit) - exact).max() < 3e-4 * max(1.0, np.abs(exact).max())
    u = synthesis(orbit.places, 512)[:, 0]
    assert (u.min() < 0.0) == (speed == 1.0)


def test_the_back_side_bears_behind_the_gap():
    """Light load, one mode, teeth that hit both ways: shooting finds the same motion."""
    system = dataclasses.replace(meshing(0.1, 0.2, 0.3, gap=0.5), swing=1.0)
    orbit = settled_at(system.oscillator, 0.7, 1e-4, 32)
    u = synthesis(orbit.places, 512)[:, 0]
    assert u.min() < -0.5
    gap = around(system, 0.7, start_of(orbit)) - start_of(orbit)
    assert np.abs(gap).max() < 1e-3


@pytest.mark.parametrize("phase", [0.0, 1.3])
def test_what_a_force_puts_in_the_damper_takes_out(phase):
    system = dataclasses.replace(duffing(0.05, 0.03, 0.2), phase=phase)
    orbit = settled_at(system.oscillator, 0.9, 1e-9)
    theta = 2 * math.pi * np.arange(256) / 256
    rate = synthesis(rates(orbit.places, 0.9), 256)[:, 0]
    put = (0.2 * np.cos(theta + phase) * rate).mean()
    assert put == pytest.approx(2 * 0.03 * (rate**2).mean(), rel=1e-7)


def test_the_begin_of_the_period_does_not_matter():
    made = [
        settled_at(dataclasses.replace(duffing(0.05, 0.03, 0.2), phase=p).oscillator, 0.9, 1e-9) for p in (0.0, 1.3)
    ]
    turned = np.exp(1.3j * np.arange(6))[:, None]
    assert np.abs(made[1].places[:6] - turned * made[0].places[:6]).max() < 1e-7


def test_the_estimate_covers_the_error():
    """Random oscillators that part: the orbit against one of many more harmonics."""
    rng = np.random.default_rng(3)
    covered, factors = 0, []
    for _ in range(12):
        system = meshing(rng.uniform(0.05, 0.3), rng.uniform(0.05, 0.2), 1.0).oscillator
        speed = rng.uniform(0.3, 1.6)
        orbit = settled_at(system, speed, 1e-2, 4)
        fine = settled_at(system, speed, 1e-6, 64)
        true = float(np.linalg.norm(fine.places - orbit.with_harmonics(fine.harmonics)))
        covered += orbit.error >= true
        factors.append(orbit.error / max(true, 1e-300))
    assert covered == 12
    assert np.median(factors) < 10.0


def test_a_stretch_without_solution_is_told():
    """Without damping the response at a linear resonance is infinite."""
    system = duffing(0.0, 0.0, 0.2).oscillator
    made = response_curve(system, np.array([0.9, 0.95, 1.0, 1.05]))
    assert made.note
    assert [o.speed for o in made.orbits] == [0.9, 0.95]


def test_error_of_a_known_orbit_is_round_off():
    system: Oscillator = duffing(0.05, 0.03, 0.2).oscillator
    orbit = settled_at(system, 0.5, 1e-9, 64)
    assert error_of(system, *solve(system, 0.5, orbit.places, 1e-9))[0] < 1e-6


def test_a_curve_passes_each_speed_once_between_two_turning_points():
    """Random springs that part: the walk comes to an end, and what it keeps belongs to branches of one direction."""
    rng = np.random.default_rng(3)
    speeds = np.linspace(0.15, 2.6, 60)
    for _ in range(10):
        ripple, damping, gap = rng.uniform(0.05, 0.4), 10 ** rng.uniform(-1.7, -1.0), rng.choice([math.inf, 2.0])
        made = response_curve(meshing(ripple, damping, 1.0, gap=gap).oscillator, speeds, 1e-3)
        assert not made.note
        passed = [(b, o.speed) for b, o in zip(made.branch, made.orbits, strict=True) if o.speed in speeds]
        assert len(passed) == len(set(passed))
        assert {speed for _, speed in passed} == set(speeds.tolist())
