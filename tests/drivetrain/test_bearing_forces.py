"""Forces and moments of the bearings: balance of each shaft and of the housing, reactions by hand, run-up."""

import dataclasses
import math

import numpy as np
import pytest

from gearfe.drivetrain.runup.run_up import steady_state
from gearfe.drivetrain.train import Bearing, Damping, build_train, simulate
from gearfe.multibody import constant
from tests.makers.trains import ALPHA, SPEED, base_radius, changed, curve, elastic, train

METHOD = "taylor"


def loaded(stages=((20, 30),), *, torque=60.0, **changes):
    made = train(list(stages), stiffness=lambda teeth: curve(teeth, swing=0.15), **changes)
    load = dataclasses.replace(made.loads[0], torque=constant(-torque * (-1) ** len(stages)))
    return changed(made, loads=(load,))


def springs(made):
    """Each bore on springs, the first shaft softly."""
    names = [bore for shaft in made.shafts for bore in shaft.bores]
    return tuple(
        Bearing(name, (2e8 + 1e7 * i, 1e8, 3e8, 1e4, 2e4), (300.0, 200.0, 300.0, 0.1, 0.2))
        for i, name in enumerate(names)
    )


def simple_supports(made, load_on_wheel):
    """Reactions of both bores of each shaft by moments: {bore: (x, z)}; forces act at the gears' middle."""
    found = {}
    for shaft, sign in zip(made.shafts, (-1.0, 1.0), strict=True):
        one, two = (made.rigid_bores[bore][1] for bore in shaft.bores)
        along = next(g.along for g in made.gears if g.shaft == shaft.name)
        for bore, share in zip(shaft.bores, ((along - two) / (one - two), (one - along) / (one - two)), strict=True):
            found[bore] = tuple(sign * share * f for f in load_on_wheel)
    return found


@pytest.mark.parametrize("sprung", [False, True])
def test_static_reactions_are_those_of_simple_supports(sprung):
    """Force T/r_b along the line of action, shares by the levers; moments, which statics leave open, are 0."""
    made = loaded(damping=Damping(beta=2e-4, ratio=0.3))
    if sprung:
        soft = tuple(dataclasses.replace(b, stiffness=(*b.stiffness[:3], 0.0, 0.0)) for b in springs(made))
        made = changed(made, bearings=tuple(dataclasses.replace(b, damping=(0.0,) * 5) for b in soft))
    made = changed(made, meshes=(dataclasses.replace(made.meshes[0], stiffness=1e8),))
    model = build_train(made)
    response = simulate(model, [0.0, 0.15, 0.2], tolerance=1e-8, method="implicit" if sprung else METHOD)
    load = response.bearing_load[-1]
    force = 60.0 / base_radius(30)
    np.testing.assert_allclose(response.contact_force[-1], force, rtol=1e-6)
    on_wheel = force * model.meshes[0].direction[[0, 2]]  # along x and z
    assert abs(model.meshes[0].direction[0]) == pytest.approx(math.sin(ALPHA))
    for bore, (x, z) in simple_supports(made, on_wheel).items():
        np.testing.assert_allclose(load[model.bores.index(bore), [0, 2]], (x, z), atol=2e-5 * force)
    np.testing.assert_allclose(load[:, 3:], 0.0, atol=1e-6 * force)
    np.testing.assert_allclose(load[:, 1], 0.0, atol=1e-6 * force)


def left_over(model, response):
    """What mesh and bearings leave for the inertia of each shaft: force, moment about its mass centre, (n, 3) each."""
    line = model.meshes[0]
    for i, shaft in enumerate(model.train.shafts):
        centre = model.shafts[i].rotor.centre
        force = (1.0 if i else -1.0) * response.contact_force * line.direction
        moment = np.cross(line.point - centre, force)
        for bore in shaft.bores:
            load = response.bearing_load[:, model.bores.index(bore)]
            arm = model.train.bore_points[bore] - centre
            force = force - load[:, :3]
            moment = moment - load[:, 3:] - np.cross(arm, load[:, :3])
        yield force, moment


@pytest.mark.parametrize("kind", ["rigid", "elastic", "springs", "springs and elastic"])
def test_each_shaft_is_in_balance(kind):
    """Bearing forces are what inertia, mesh force and gyroscopic moments need, at all times of a transient."""
    made = loaded()
    if "springs" in kind:
        made = changed(made, bearings=springs(made))
    if "elastic" in kind:
        made = elastic(made, uneven=0.2, skew=0.5)
    model = build_train(made)
    response = simulate(model, np.linspace(0.0, 2e-3, 60), tolerance=1e-8, method=METHOD)
    v, a = motions(model, response)
    size, frame = np.abs(response.contact_force).max(), made.frame
    for i, (force, moment) in enumerate(left_over(model, response)):
        at, body = int(model.first[i]), model.shafts[i].rotor
        np.testing.assert_allclose(force, body.mass * a[:, at : at + 3], atol=1e-7 * size)
        spin = response.speed_absolute[:, i, None]
        tilts = body.transverse * a[:, at + 3 : at + 5]
        tilts += body.polar * spin * np.stack([v[:, at + 4], -v[:, at + 3]], axis=1)
        np.testing.assert_allclose(moment @ frame[:2].T, tilts, atol=1e-8 * size)


def motions(model, response):
    """Rates and second rates of the coordinates, from a run of the same model (they are not in the response)."""
    from gearfe.drivetrain.train.states import train_states
    from gearfe.multibody import integrate

    run = integrate(model.system, response.time, tolerance=1e-8, method=METHOD, start=model.start)
    states = train_states(model, run)
    return states.v, states.a


def test_a_run_up_has_the_bearing_forces_of_its_transients():
    made = elastic(loaded(damping=Damping(ratio=0.05)), uneven=0.2, skew=0.5)
    made = changed(made, bearings=springs(made)[:2])
    model = build_train(made)
    state = steady_state(model, SPEED, tolerance=1e-5, stability=False)
    samples, periods = 64, 60
    times = np.arange(periods * samples + 1) * state.period / samples
    response = simulate(model, times, tolerance=1e-8, method=METHOD)
    last = response.bearing_load[-samples - 1 : -1]
    lines = np.fft.rfft(last, axis=0) * (2.0 / samples)
    size = np.abs(last).max(axis=(0, 1))[None]
    np.testing.assert_allclose(state.bearing[0].real / size, last.mean(axis=0) / size, atol=2e-4)
    for k in (1, 2, 3):
        np.testing.assert_allclose(np.abs(state.bearing[k]) / size, np.abs(lines[k]) / size, atol=2e-4)


def test_rotations_are_those_of_the_shafts_and_the_drive_angle_is_prescribed():
    """An elastic coupling twists by the torque over its stiffness; speeds are the rates of the rotations."""
    made = loaded(damping=Damping(ratio=0.3))
    made = changed(made, drive=dataclasses.replace(made.drive, stiffness=5e3))
    response = simulate(build_train(made), np.linspace(0.0, 0.1, 2001), tolerance=1e-9, method=METHOD)
    np.testing.assert_allclose(response.drive_angle, SPEED * response.time, rtol=1e-14)
    twist = response.drive_angle - response.rotation[:, 0]
    np.testing.assert_allclose(twist * 5e3, response.drive_torque, rtol=1e-7, atol=1e-9)
    assert twist[-200:].mean() == pytest.approx(60.0 * 20 / 30 / 5e3, rel=1e-2)
    rate = np.gradient(response.rotation, response.time, axis=0)[1:-1]
    assert np.abs(rate - response.speed[1:-1]).mean() < 1e-2 * SPEED
    columns = response.columns()
    assert columns["rotation_s0_deg"][-1] == pytest.approx(np.degrees(response.rotation[-1, 0]))
    assert (columns["drive_torque_Nm"] == response.drive_torque).all()
