"""Torques of orders of a mesh or of a shaft, which follow the speed."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.drivetrain.runup.run_up import run_up, steady_state
from gearfe.drivetrain.train import build_train, simulate
from gearfe.multibody import TimeFunction, constant, sine
from tests.makers.train_pairs import damped_pair
from tests.makers.trains import changed

TORQUE, SPEED, TEETH = 60.0, 700.0, 20


def model(orders=(), mesh="", torque=None, speed=SPEED):
    made, *_ = damped_pair("always", torque=TORQUE, speed=speed, ratio=0.08)
    load = dataclasses.replace(made.loads[0], torque=torque or constant(TORQUE), orders=orders, mesh=mesh)
    return build_train(changed(made, loads=(load,)))


@pytest.mark.parametrize(
    ("order", "of_mesh", "cycles"), [(1.0, True, 20.0), (2.0, True, 40.0), (0.5, True, 10.0), (3.0, False, 2.0)]
)
def test_an_order_is_the_sine_of_its_frequency(order: float, of_mesh: bool, cycles: float) -> None:
    """Orders of the mesh count its cycles, 20 a turn of the drive; those of the driven shaft its turns, 2/3 of them."""
    name = model().meshes[0].name if of_mesh else ""
    start = order * TEETH * model().meshes[0].phase if of_mesh else 0.0
    followed = model(((order, 4.0, 0.4),), name)
    fixed = model(torque=constant(TORQUE) + sine(4.0, cycles * SPEED, 0.4 + start))
    one, two = (steady_state(made, SPEED, tolerance=1e-5, stability=False) for made in (followed, fixed))
    assert one.period == two.period
    np.testing.assert_allclose(one.force, two.force, atol=1e-6 * np.ptp(two.force))
    for t in (0.0, 1.3e-4, 2.7e-3):
        both = [sum(float(f(t)) for _, f in made.torques) for made in (followed, fixed)]
        assert both[0] == pytest.approx(both[1], abs=1e-9)


def test_orders_follow_the_speed_of_a_run_up() -> None:
    """At each speed the motion is that under a sine of the mesh frequency there; speeds in between are not left out."""
    speeds = np.linspace(600.0, 650.0, 6)
    name = model().meshes[0].name
    run = run_up(model(((1.0, 4.0, 0.4),), name), speeds, stability=False)
    assert not run.notes
    assert [state.speed for state in run.states] == speeds.tolist()
    phase = TEETH * model().meshes[0].phase
    for state in (run.states[1], run.states[4]):
        torque = constant(TORQUE) + sine(4.0, TEETH * state.speed, 0.4 + phase)
        alone = steady_state(model(torque=torque), state.speed, stability=False)
        assert np.ptp(state.force) == pytest.approx(np.ptp(alone.force), rel=5e-3)
        assert state.force.max() == pytest.approx(alone.force.max(), rel=2e-3)


def test_the_steady_motion_under_an_order_is_that_of_a_long_transient() -> None:
    made = model(((1.0, 4.0, 0.4),), model().meshes[0].name)
    state = steady_state(made, SPEED, tolerance=1e-5, stability=False)
    theta = state.lattice.theta[:, 0]
    times = (120 + np.append(theta, 2.0 * math.pi) / (2.0 * math.pi)) * 2.0 * math.pi / (TEETH * SPEED)
    run = simulate(made, np.concatenate([[0.0], times]), tolerance=1e-8)
    moved = run.transmission_error[1:-1, 0]
    np.testing.assert_allclose(moved, state.transmission_error[:, 0], atol=2e-3 * np.ptp(moved))


@pytest.mark.parametrize(
    ("orders", "mesh", "says"),
    [
        (((0.0, 1.0, 0.0),), "", "must be .order >= 0.001"),
        (((4e-4, 1.0, 0.0),), "", "must be .order >= 0.001"),
        (((1.0, math.inf, 0.0),), "", "all finite"),
        (((1.0, 1.0, 0.0),), "other", "other"),
        ((), "other", "is of orders"),
    ],
)
def test_mistakes(orders, mesh, says) -> None:
    with pytest.raises(InputError, match=says):
        model(orders, mesh)


def test_an_order_between_fractions_has_its_frequency_in_a_transient() -> None:
    """2.0004 lies nearer to 2 than to any other fraction with a denominator up to 1000."""
    made = model(((2.0004, 4.0, 0.0),), model().meshes[0].name)
    _, torque = made.torques[-1]
    assert torque.sines[0][1] == pytest.approx(2.0004 * TEETH * SPEED, rel=1e-12)


CHANGING = {
    "sine": constant(SPEED) + sine(5.0, 30.0, 0.0),
    "line": TimeFunction((-math.inf,), (0.0,), ((SPEED, 1000.0),)),  # no breaks, as an expression becomes one piece
}


@pytest.mark.parametrize("speed", CHANGING.values(), ids=CHANGING)
def test_orders_need_one_speed(speed: TimeFunction) -> None:
    made, *_ = damped_pair("always", torque=TORQUE, speed=SPEED, ratio=0.08)
    drive = dataclasses.replace(made.drive, speed=speed)
    load = dataclasses.replace(made.loads[0], orders=((1.0, 1.0, 0.0),))
    with pytest.raises(InputError, match="constant speed only"):
        build_train(changed(made, drive=drive, loads=(load,)))
