"""Torques that oscillate with whole or fractional multiples of the mesh frequency in steady running."""

import dataclasses
import math

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.drivetrain.runup.run_up import run_up, steady_state
from gearfe.drivetrain.train import build_train
from gearfe.multibody import TimeFunction, constant, sine
from tests.makers.gear_oscillator import GearOscillator
from tests.makers.train_pairs import damped_pair
from tests.makers.trains import base_radius, changed

TORQUE, SPEED = 60.0, 700.0


def oscillating(multiple, amplitude=4.0, phase=0.4):
    made, mass, damper = damped_pair("always", torque=TORQUE, speed=SPEED, ratio=0.08)
    omega = multiple * 20 * SPEED
    torque = constant(TORQUE) + sine(amplitude, omega, phase)
    load = dataclasses.replace(made.loads[0], torque=torque)
    return build_train(changed(made, loads=(load,))), mass, damper, torque


@pytest.mark.parametrize(("multiple", "cycles"), [(1.0, 1), (1.5, 2), (2.0 / 3.0, 3), (7.0, 1), (1.0 / 20.0, 20)])
def test_a_torque_at_a_multiple_of_the_mesh_frequency_meets_shooting(multiple, cycles):
    model, mass, damper, torque = oscillating(multiple)
    state = steady_state(model, SPEED, tolerance=1e-5)
    period = cycles * 2.0 * math.pi / (20 * SPEED)
    assert state.period == pytest.approx(period, rel=1e-12)
    line = model.meshes[0]
    one = GearOscillator(
        mass, damper, line.backlash, lambda t: float(torque(t)) / base_radius(30), line.curve,
        line.sense * line.ratio * SPEED, line.phase, False,
    )  # fmt: skip
    h = period / (400 * cycles)
    along = state.transmission_error[:, 0]
    rate = float(np.real(np.sum(1j * 2 * math.pi * state.frequency * state.lines(along))))
    side = 1 if along[0] > 0.0 else 0
    y = one.periodic(period, h, np.array([along[0], rate]), side)
    rows = one.run(period, h, tuple(y), side=side)
    at = np.interp(np.arange(len(along)) / len(along) * period, rows[:, 0], rows[:, 1])
    np.testing.assert_allclose(along, at, atol=1e-3 * np.ptp(at))
    map_ = one.around(period, h, y, side)[1]
    assert abs(state.multipliers[0]) == pytest.approx(np.abs(np.linalg.eigvals(map_)).max(), rel=5e-3)


def test_a_run_up_has_the_speeds_at_which_the_motion_repeats_and_says_where_not():
    model, *_ = oscillating(1.0)
    run = run_up(model, [SPEED, 1.02 * SPEED, 2.0 * SPEED], stability=False)
    assert [state.speed for state in run.states] == [SPEED, 2.0 * SPEED]
    (note,) = run.notes
    assert "at 1 of 3 speeds no motion was sought: at 714 rad/s" in note
    assert "0.980392157 times the frequency of mesh 1" in note
    alone = steady_state(model, SPEED, stability=False)
    np.testing.assert_allclose(run.states[0].force.max(), alone.force.max(), rtol=1e-3)
    with pytest.raises(InputError, match="does not repeat within 12 mesh cycles"):
        steady_state(model, 1.02 * SPEED)


def test_a_torque_that_never_rests_is_refused():
    model, *_ = oscillating(1.0)
    load = dataclasses.replace(model.train.loads[0], torque=TimeFunction(coefficients=((TORQUE, 3.0),)))
    with pytest.raises(InputError, match="write what oscillates in sines"):
        steady_state(build_train(changed(model.train, loads=(load,))), SPEED)
