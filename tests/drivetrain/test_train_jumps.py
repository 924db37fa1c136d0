"""A mesh with backlash as one degree of freedom: both branches and both jumps over its speed, against DOP853."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

from gearfe.drivetrain.runup.run_up import run_up
from gearfe.drivetrain.train import TrainModel, build_train, simulate
from gearfe.multibody import TimeFunction, constant, smoothed_step
from tests.makers.train_pairs import pair
from tests.makers.trains import base_radius, curve

Array = NDArray[np.float64]

#: Mean stiffness (N/m), its swing, damping ratio, torque (N m), backlash (m); the driven gear's base radius (m).
K, SWING, ZETA, TORQUE, BACKLASH, R2 = 1e8, 0.2, 0.05, 30.0, 20e-6, base_radius(30)


def model_at(speed: TimeFunction) -> TrainModel:
    """The pair, its driver on a stiff drive, a damper that always acts; `speed` in units of the resonance."""
    train = pair(curve(20, mean=K, swing=SWING, count=40), torque=constant(TORQUE), backlash=BACKLASH)
    mass = build_train(train).shafts[1].rotor.polar / R2**2
    mesh = dataclasses.replace(train.meshes[0], damping=2.0 * ZETA * math.sqrt(K * mass))
    drive = dataclasses.replace(train.drive, speed=math.sqrt(K / mass) / 20.0 * speed)
    return build_train(dataclasses.replace(train, meshes=(mesh,), drive=drive))


def round_once(start: Array, speed: float, tolerance: float = 1e-9) -> tuple[Array, Array, tuple[float, float]]:
    """Over a mesh cycle, in units of static approach and of natural periods over 2 pi, from events to events.

    x'' + 2 zeta x' + k(tau) g(x) = 1, k = 1 + SWING cos(speed tau); place and rate at the end, their derivatives to
    those at the begin, least and largest x.
    """
    j = BACKLASH / (TORQUE / R2 / K)

    def rhs(t: float, y: Array) -> list[float]:
        k = 1.0 + SWING * math.cos(speed * t)
        force, slope = (k * y[0], k) if y[0] > 0.0 else (k * (y[0] + j), k) if y[0] < -j else (0.0, 0.0)
        made = [y[1], 1.0 - force - 2 * ZETA * y[1]]
        for d in (2, 4):
            made += [y[d + 1], -slope * y[d] - 2 * ZETA * y[d + 1]]
        return made

    ends = [lambda t, y: y[0], lambda t, y: y[0] + j]
    for end in ends:
        end.terminal = True  # type: ignore[attr-defined]
    t, y, extremes = 0.0, np.array([*start, 1.0, 0.0, 0.0, 1.0]), [start[0]]
    while t < 2 * math.pi / speed:
        run = solve_ivp(
            rhs,
            (t, 2 * math.pi / speed),
            y,
            "DOP853",
            rtol=tolerance,
            atol=1e-3 * tolerance,
            events=ends,
            dense_output=True,
        )
        looks = run.sol(np.linspace(t, run.t[-1], 300))[0]
        extremes += [looks.min(), looks.max()]
        t, y = run.t[-1], run.y[:, -1]
        if run.status == 1:  # a little beyond the event, whose force is 0 on both sides
            y, t = y + 1e-10 * np.array(rhs(t, y)), t + 1e-10
    return y[:2], y[2:].reshape(2, 2).T, (min(extremes), max(extremes))


def orbit(speed: float, start: Array) -> tuple[Array, tuple[float, float]]:
    """A motion that repeats with the mesh, by Newton's method; its start, least and largest place (m)."""
    for _ in range(15):
        end, slope, extremes = round_once(start, speed)
        step = np.linalg.solve(slope - np.eye(2), end - start)
        start = start - step
        if np.abs(step).max() < 1e-7:
            unit = TORQUE / R2 / K
            return start, (unit * extremes[0], unit * extremes[1])
    raise AssertionError("no orbit")


def jump(speed: float, start: Array) -> float:
    """The turning point of the orbits near a place: a multiplier of 1."""

    def lacks(z: Array) -> Array:
        end, slope, _ = round_once(z[:2], z[2])
        return np.array([*(end - z[:2]), 1.0 - np.trace(slope) + np.linalg.det(slope)])

    found, _, converged, message = fsolve(lacks, [*start, speed], full_output=True, xtol=1e-8, epsfcn=1e-12)
    assert converged == 1, message
    return float(found[2])


def settled(speeds: tuple[float, ...]) -> Array:
    start = np.array([1.0, 0.0])
    for speed in speeds:
        for _ in range(25):
            start, _, _ = round_once(start, speed, 1e-5)
    return start


def sweep(speeds: list[float]) -> list[tuple[float, float]]:
    """Least and largest approach at each of the speeds that gearfe's train takes in turn, 200 mesh cycles long each."""
    rate = float(model_at(constant(1.0)).train.driven.speed(0.0))
    cycle = [2 * math.pi / (20 * s * rate) for s in speeds]
    speed, at, ends = constant(speeds[0]), 200 * cycle[0], [200 * cycle[0]]
    for (one, two), c in zip(itertools.pairwise(speeds), cycle[1:], strict=True):
        speed, at = speed + smoothed_step(at + 5 * c, 10 * c, two - one), at + 200 * c
        ends.append(at)
    spans = [np.linspace(end - c, end, 301) for end, c in zip(ends, cycle, strict=True)]
    made = simulate(model_at(speed), np.concatenate([[0.0], *spans]), tolerance=1e-8)
    return [(x.min(), x.max()) for x in made.transmission_error[1:, 0].reshape(len(speeds), -1)]


@pytest.mark.parametrize("up", [True, False])
def test_both_branches_and_both_jumps(up: bool) -> None:
    """A train that runs up, or down, by small steps stays on its branch up to the jump, and leaves it there.

    Branches, and the speeds of the jumps, within 1e-3 of orbits and their turning points by DOP853 with events.
    """
    before = [0.7, 0.8, 0.85, 0.88, 0.9] if up else [1.1, 1.0, 0.95, 0.91, 0.89, 0.87, 0.86, 0.85, 0.845, 0.84]
    first, _ = orbit(before[-1], settled((0.7, 0.8, 0.9) if up else (1.05, 0.95, 0.9, 0.86, 0.84)))
    turn = jump(before[-1], first)
    near = [turn * (1.0 - (1.0 if up else -1.0) * off) for off in (2e-3, 9e-4, 4e-4, 0.0, -4e-4, -9e-4)]
    found = dict(zip([*before, *near], sweep([*before, *near]), strict=True))
    for part in (before[::-1], near[:2]):
        start = first
        for speed in part:
            start, true = orbit(speed, start)
            assert found[speed] == pytest.approx(true, abs=1e-3 * (true[1] - true[0])), speed
    assert np.abs(np.subtract(found[near[-1]], found[near[1]])).max() > 0.2 * np.ptp(found[near[1]])  # it has jumped


def test_the_jumps_of_a_run_up() -> None:
    """Turning points of the steady states by harmonic balance: the same two."""
    model = model_at(constant(1.0))
    unit = float(model.train.driven.speed(0.0))
    turns = run_up(model, unit * np.linspace(0.8, 1.0, 9), tolerance=1e-4, stability=False).turning_speeds / unit
    one = jump(0.905, orbit(0.9, settled((0.7, 0.8, 0.9)))[0])
    two = jump(0.835, orbit(0.84, settled((1.05, 0.95, 0.9, 0.86, 0.84)))[0])
    assert turns == pytest.approx([one, two], rel=1e-3)
