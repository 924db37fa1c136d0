"""When the damper of a mesh acts: always, or in contact only; transients, run-up and stability against formulas."""

import dataclasses
import math

import numpy as np
import pytest

from gearfe import InputError
from gearfe.drivetrain.runup.run_up import steady_state
from gearfe.drivetrain.train import GearMesh, build_train, simulate
from tests.makers.gear_oscillator import GearOscillator
from tests.makers.mesh_laws import hertzian_law
from tests.makers.train_pairs import BACKLASH, damped_pair
from tests.makers.trains import SPEED, base_radius, changed, train

METHODS = ["taylor", "implicit"]
RULES = ["always", "in_contact"]


def oscillator(model, mass, damper, torque, speed, acts):
    line = model.meshes[0]
    return GearOscillator(
        mass, damper, line.backlash, lambda t: torque / base_radius(30), line.curve, line.sense * line.ratio * speed,
        line.phase, acts == "in_contact",
    )  # fmt: skip


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("acts", RULES)
def test_transients_meet_an_integration_that_locates_the_touches(acts, method):
    torque, speed = 20.0, 1150.0
    made, mass, damper = damped_pair(acts, torque=torque, speed=speed)
    model = build_train(made)
    rows = oscillator(model, mass, damper, torque, speed, acts).run(2e-3, 2.5e-7)
    assert len(set(rows[:, 3])) > 1  # teeth part
    response = simulate(model, rows[::80, 0], tolerance=1e-8, method=method)
    size = np.abs(rows[:, 1]).max()
    np.testing.assert_allclose(response.transmission_error[:, 0], rows[::80, 1], rtol=0, atol=3e-6 * size)


def test_the_rules_differ_where_teeth_part():
    """What the comparison above tells apart: by far more than its bound."""
    ends = []
    for acts in RULES:
        made, mass, damper = damped_pair(acts, torque=20.0, speed=1150.0)
        rows = oscillator(build_train(made), mass, damper, 20.0, 1150.0, acts).run(2e-3, 1e-6)
        ends.append(rows[:, 1])
    assert np.abs(ends[0] - ends[1]).max() > 1e-3 * np.abs(ends[0]).max()


@pytest.mark.parametrize("acts", RULES)
def test_a_wheel_between_both_flanks_keeps_its_speed_or_not(acts):
    """Without a load a flank gives back exp(-pi zeta / sqrt(1 - zeta^2)) of the speed; in the gap c alone may brake."""
    k, ratio = 1e8, 0.05
    made, mass, damper = damped_pair(acts, torque=0.0, ratio=ratio, stiffness=k)
    start, radius = 0.2, base_radius(30)  # m/s
    shafts = (made.shafts[0], dataclasses.replace(made.shafts[1], initial_speed=-SPEED * 20 / 30 + start / radius))
    model = build_train(changed(made, shafts=shafts))
    v0 = float(model.start.v @ model.meshes[0].row)
    omega = math.sqrt(k / mass)
    contact = math.pi / (omega * math.sqrt(1.0 - ratio**2))
    left = -v0 * math.exp(-math.pi * ratio / math.sqrt(1.0 - ratio**2))
    flight = 0.5 * BACKLASH / abs(left)
    t = np.array([0.0, contact, contact + 0.5 * flight, contact + flight])
    response = simulate(model, t, tolerance=1e-10)
    x = response.transmission_error[:, 0]
    decay = damper / mass
    far = left * (t[2:] - contact) if acts == "in_contact" else left * -np.expm1(-decay * (t[2:] - contact)) / decay
    assert v0 > 0.0
    np.testing.assert_allclose(x[1:], [0.0, *far], rtol=0, atol=1e-12)
    assert (response.contact_force[2:, 0] == 0.0).all() == (acts == "in_contact")


@pytest.mark.parametrize("acts", RULES)
def test_steady_motions_and_multipliers_meet_shooting(acts):
    """Where teeth part in each period: the motion, its force, and the map of small disturbances."""
    torque, speed = 20.0, 1150.0
    made, mass, damper = damped_pair(acts, torque=torque, speed=speed, ratio=0.08)
    model = build_train(made)
    state = steady_state(model, speed, tolerance=1e-4)
    assert 0.05 < state.apart[0] < 0.9
    one = oscillator(model, mass, damper, torque, speed, acts)
    period = 2.0 * math.pi / (20 * speed)
    h = period / 600
    along = state.transmission_error[:, 0]
    rate = float(np.real(np.sum(1j * 2 * math.pi * state.frequency * state.lines(along))))
    y = one.periodic(period, h, np.array([along[0], rate]), side=1 if along[0] > 0.0 else 0)
    side = 1 if y[0] > 0.0 else 0
    rows = one.run(period, h, tuple(y), side=side)
    assert along.max() == pytest.approx(rows[:, 1].max(), rel=1e-3)
    assert along.min() == pytest.approx(rows[:, 1].min(), abs=1e-3 * np.ptp(rows[:, 1]))
    assert state.apart[0] == pytest.approx(np.mean(rows[:-1, 3] == 0), abs=5e-3)
    multipliers = np.linalg.eigvals(one.around(period, h, y, side)[1])
    assert abs(state.multipliers[0]) == pytest.approx(np.abs(multipliers).max(), rel=5e-3)
    decay = period * damper / mass  # in contact only: the product of both multipliers says how long it acts
    share = 1.0 if acts == "always" else 1.0 - np.mean(rows[:-1, 3] == 0)
    assert math.log(abs(np.prod(state.multipliers[:2]))) == pytest.approx(-decay * share, rel=1e-2)


@pytest.mark.parametrize("acts", RULES)
def test_a_transient_ends_in_the_steady_motion(acts):
    torque, speed = 20.0, 1150.0
    model = build_train(damped_pair(acts, torque=torque, speed=speed, ratio=0.08)[0])
    state = steady_state(model, speed, tolerance=1e-4, stability=False)
    period = 2.0 * math.pi / (20 * speed)
    late = period * (150 + np.linspace(0.0, 1.0, 65))
    response = simulate(model, [0.0, *late], tolerance=1e-7, method="taylor")
    force, error = response.contact_force[1:, 0], response.transmission_error[1:, 0]
    assert error.max() == pytest.approx(state.transmission_error[:, 0].max(), rel=2e-3)
    assert force.mean() == pytest.approx(torque / base_radius(30), rel=2e-2)
    again = steady_state(model, speed, state, tolerance=1e-4, stability=False)
    assert error.min() == pytest.approx(again.transmission_error[:, 0].min(), abs=1e-3 * np.ptp(error))


@pytest.mark.parametrize("acts", RULES)
def test_the_damper_of_a_mesh_law(acts):
    """Always: d times the rate beside the law's force; in contact: in proportion to that force, without a pull."""
    law = hertzian_law(2 * math.pi / 20)
    made = train([(20, 30)], stiffness=lambda _: law)
    mesh = dataclasses.replace(made.meshes[0], damping=800.0, damping_acts=acts)
    model = build_train(changed(made, meshes=(mesh,)))
    line = model.meshes[0]
    response = simulate(model, np.linspace(0.0, 1.5e-3, 200), tolerance=1e-7)
    rate = -(response.speed_absolute[:, 0] * base_radius(20) + response.speed_absolute[:, 1] * base_radius(30))
    rate *= -line.sense
    phase = line.sense * line.ratio * response.drive_angle + line.phase
    pure = law(phase, response.transmission_error[:, 0]).force
    with_damper = pure + 800.0 * rate if acts == "always" else pure * (1.0 + 800.0 / line.reference * rate)
    np.testing.assert_allclose(response.contact_force[:, 0], with_damper, rtol=1e-6, atol=1e-6 * pure.max())


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"damping_acts": "sometimes"}, "must be 'always' or 'in_contact'"),
        ({"damping_acts": "in_contact"}, "a spring that acts both ways"),
        ({"damping_acts": "always", "stiffness": None}, "no deflection to damp"),
        ({"damping": 5.0, "stiffness": None}, "no deflection to damp"),
    ],
)
def test_what_a_mesh_cannot_do_is_refused(changes, words):
    made = train([(20, 30)])
    mesh = dataclasses.replace(made.meshes[0], **changes)
    assert isinstance(mesh, GearMesh)
    with pytest.raises(InputError, match=words):
        build_train(changed(made, meshes=(mesh,)))
