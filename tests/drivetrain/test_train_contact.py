"""Trains whose teeth part and meet: energy, separation, back flanks, transmission error, known oscillators."""

from __future__ import annotations

import dataclasses
import math
import re

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gearfe.base.errors import InputError
from gearfe.drivetrain.train import Damping, build_train, simulate
from gearfe.drivetrain.train.statics import static_errors
from gearfe.gears.gearmesh.curve import StiffnessCurve
from gearfe.multibody import TimeFunction, constant, smoothed_step
from tests.makers.mesh_laws import hertzian_law
from tests.makers.train_pairs import R2, free_energy, free_pair, pair
from tests.makers.trains import MODULE, TORQUE, base_radius, curve, train


@pytest.mark.parametrize("cycles", [20, pytest.param(1000, marks=pytest.mark.slow)])
def test_a_free_pair_keeps_its_energy(cycles):
    """Undamped, with one and two pairs in contact in turns and teeth that part: 1e-9 of the elastic energy."""
    law = hertzian_law(relief=3e-6)
    model = free_pair(law, 800.0)
    times = np.linspace(0.0, cycles * 2 * math.pi / 20 / 600.0, 40 * min(cycles, 100))
    energy, elastic_part, moved = free_energy(model, law, times, 1e-10)
    assert (moved.contact_force == 0).any()  # they part
    assert np.abs(energy - energy[0]).max() < 1e-9 * energy.max()
    assert np.abs(energy - energy[0]).max() < 1e-6 * elastic_part.max()


def test_slow_running_is_the_static_transmission_error():
    law = hertzian_law(relief=5e-6)
    torque, period = smoothed_step(0.01, 0.02, 60.0), 2 * math.pi / 20 / 0.3
    gear_train = pair(law, speed=0.3, torque=torque, damping=Damping(ratio=0.05))
    model = build_train(gear_train)
    made = simulate(model, np.linspace(0.0, period + 0.05, 401), tolerance=1e-6)
    late = made.time > 0.05
    line = model.meshes[0]
    run = made.transmission_error[late, 0]
    static = law.approach(line.sense * line.ratio * model.angle(made.time[late]) + line.phase, 60.0 / R2)
    assert np.abs(run - static).max() < 1e-3 * np.ptp(static)
    assert static_errors(gear_train, made.drive_angle[late])[0] == pytest.approx(static, abs=1e-14)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_static_errors_beside_laws_and_springs(sign):
    """Of a law the mirrored approach on the back flanks; of a spring force over stiffness; none of a rigid mesh."""
    law, j, angle, shape = hertzian_law(relief=5e-6), 20e-6, np.linspace(0.0, 1.0, 301), curve(20)
    load, force = constant(sign * 60.0), 60.0 / R2
    (found,) = static_errors(pair(law, torque=load, backlash=j), angle)
    expected = law.approach(angle, force) if sign > 0.0 else -j - law.approach(-angle, force)
    assert found == pytest.approx(expected, abs=1e-14)
    (found,) = static_errors(pair(shape, torque=load, backlash=j), angle)
    yields = force / np.asarray(shape(sign * angle).value)
    assert found == pytest.approx(yields if sign > 0.0 else -j - yields, rel=1e-12)
    assert static_errors(pair(None, torque=load), angle) == (None,)
    assert (static_errors(pair(law, torque=load), angle)[0] is None) == (sign < 0.0)


@pytest.mark.parametrize("back", [None, hertzian_law(relief=2e-6, cells=15)])
def test_a_load_that_drives_bears_on_the_back_flanks(back):
    """Behind the backlash j, the mirrored law or their own: the approach is -(j + that of the mirrored phase)."""
    law, j = dataclasses.replace(hertzian_law(relief=5e-6), back=back), 20e-6
    gear_train = pair(law, speed=1.0, torque=smoothed_step(0.01, 0.02, -60.0), backlash=j, damping=Damping(ratio=0.02))
    with pytest.raises(InputError, match="back flanks"):
        build_train(pair(law, speed=1.0, torque=constant(-60.0)))
    model = build_train(gear_train)
    made = simulate(model, np.linspace(0.0, 0.2, 201), tolerance=1e-6)
    late = made.time > 0.1
    phase = model.meshes[0].sense * model.angle(made.time[late]) + model.meshes[0].phase
    static = -j - law.sides[1].approach(-phase, 60.0 / R2)
    assert made.contact_force[late, 0] == pytest.approx(np.full(late.sum(), -60.0 / R2), rel=1e-3)
    assert np.abs(made.transmission_error[late, 0] - static).max() < 1e-3 * np.ptp(static)
    assert static_errors(gear_train, made.drive_angle[late])[0] == pytest.approx(static, abs=1e-14)


def test_the_mirrored_train_moves_alike():
    """Drive and load reversed: the other flanks of the same teeth bear, and all forces are the same."""
    law = hertzian_law(relief=2e-6)
    made = [
        simulate(
            build_train(pair(law, speed=s * 600.0, torque=s * smoothed_step(0.2e-3, 0.4e-3, 40.0), backlash=10e-6)),
            np.linspace(0.0, 2e-3, 101),
            tolerance=1e-9,
        ).contact_force
        for s in (1.0, -1.0)
    ]
    assert (made[0] == 0).any()
    assert made[1] == pytest.approx(made[0], abs=1e-4 * np.abs(made[0]).max())


@pytest.mark.parametrize("damping", [0.0, 400.0])
def test_an_oscillator_with_backlash_against_events_by_scipy(damping):
    """One degree of freedom, k = k0 (1 + e cos), a damper that always acts, flanks that part behind a backlash.

    scipy's DOP853 at 1e-12 with each stretch between touches integrated by itself.
    """
    j, swing, torque = 3e-6, 0.25, constant(2.0) + TimeFunction(sines=((30.0, 9e3, 0.2),))
    shape = curve(20, mean=1e8, swing=swing, method="cubic", count=40)
    gear_train = pair(shape, torque=torque, backlash=j)
    mesh = dataclasses.replace(gear_train.meshes[0], damping=damping)
    model = build_train(dataclasses.replace(gear_train, meshes=(mesh,)))
    times = np.linspace(0.0, 2e-3, 101)
    made = simulate(model, times, tolerance=1e-9)
    inertia = model.shafts[1].rotor.polar
    line = model.meshes[0]

    def force(t, x):  # type: ignore[no-untyped-def]
        phase = 600.0 * t + line.phase
        if x > 0.0:
            return float(shape(phase).value) * x
        return float(shape(-phase).value) * (x + j) if x < -j else 0.0

    def rhs(t, y):  # type: ignore[no-untyped-def]
        return [y[1], R2 * (float(torque(t)) - R2 * (force(t, y[0]) + damping * y[1])) / inertia]

    fine = np.unique(np.concatenate([times, np.linspace(0, 2e-3, 2001)]))
    true = solve_ivp(rhs, (0, 2e-3), [0.0, 0.0], "DOP853", t_eval=fine, rtol=1e-12, atol=1e-18, max_step=5e-7).y
    x = np.interp(times, fine, true[0])
    assert (x < -j).any()
    assert ((x > -j) & (x < 0.0)).any()
    assert np.abs(made.transmission_error[:, 0] - x).max() < 1e-3 * np.abs(x).max()


def test_mistakes():
    law = hertzian_law()
    with pytest.raises(InputError, match="wedged"):
        build_train(pair(law, backlash=-1e-6))
    with pytest.raises(InputError, match="has a period of"):
        build_train(pair(hertzian_law(0.3)))
    with pytest.raises(InputError, match="back flanks with a period of"):
        build_train(pair(dataclasses.replace(law, back=hertzian_law(0.3))))


def test_when_teeth_part_does_not_depend_on_the_output_times():
    """Number, share and longest time without contact: from 21 times as from 20,001, whose samples agree."""
    mesh = {"torque": constant(20.0), "backlash": 30e-6, "speed": 600.0}
    gear_train = pair(hertzian_law(relief=3e-6), **mesh, damping=Damping(ratio=0.01))
    swing = constant(600.0) + TimeFunction(sines=((20.0, 9e3, 0.0),))
    model = build_train(dataclasses.replace(gear_train, drive=dataclasses.replace(gear_train.drive, speed=swing)))
    few, many = (simulate(model, np.linspace(0.0, 5e-3, n), tolerance=1e-8) for n in (21, 20_001))
    names = ("contacts_lost", "contacts_regained", "share_without_contact", "longest_without_contact_s")
    for name in names:
        assert few.statistics[name] == pytest.approx(many.statistics[name], rel=1e-9)
    apart = many.apart[:, 0]
    assert many.statistics["contacts_lost"][0] == int((apart[1:] & ~apart[:-1]).sum()) > 5
    assert many.statistics["share_without_contact"][0] == pytest.approx(apart.mean(), abs=2e-3)
    assert 0.0 < many.statistics["longest_without_contact_s"][0] < 1e-3


def test_a_load_that_keeps_no_flank_in_contact_runs_with_a_remark():
    """Nothing brakes, or what swings about nothing: the pair runs on, apart or not, and says so."""
    for load in (constant(0.0), constant(0.0) + TimeFunction(sines=((5.0, 6e3, 0.2),))):
        made = simulate(build_train(pair(hertzian_law(), torque=load, backlash=10e-6)), np.linspace(0.0, 1e-3, 21))
        assert made.status == "done"
        assert [w for w in made.warnings if "no load keeps the teeth of mesh d0-g0 in contact" in w]
    braked = pair(hertzian_law(), torque=constant(20.0), backlash=10e-6)
    assert not simulate(build_train(braked), np.linspace(0.0, 1e-3, 21)).warnings


def test_a_law_that_does_not_reach_says_what_to_ask_for():
    law = hertzian_law()
    gear_train = pair(law, torque=smoothed_step(0.5e-3, 1e-3, 3.0 * law.largest_force * R2))
    made = simulate(build_train(gear_train), np.linspace(0.0, 2e-3, 101), raise_on_failure=False)
    assert made.status == "beyond the mesh law"
    assert made.time_reached < 1.2e-3
    assert any("N m" in warning and "mesh_model_torque_Nm" in warning for warning in made.warnings)


def runge_kutta(model, times, tolerance):  # type: ignore[no-untyped-def]
    """Forces and approaches of a train of one mesh by scipy's DOP853, from the forces' plain formulas."""
    modal, W = model.modal, model.directions
    n = len(modal.eigenvalues)

    def rhs(t, y):  # type: ignore[no-untyped-def]
        q, v = modal.origin + modal.T @ y[:n], modal.T @ y[n:]
        force = W @ model.forces.at_one_time(t, q @ W, v @ W)
        return np.r_[y[n:], modal.constant - modal.eigenvalues * y[:n] - modal.damping @ y[n:] + modal.T.T @ force]

    y = solve_ivp(rhs, (0.0, times[-1]), np.zeros(2 * n), "DOP853", t_eval=times, rtol=tolerance, atol=1e-20).y
    u, du = (modal.origin + y[:n].T @ modal.T.T) @ W, y[n:].T @ modal.T.T @ W
    pushes = [made.force for made in model.forces.of_flanks(times, u, du)]
    return pushes[0] - pushes[1], u[:, model.forces.flanks[0].direction]


def test_parting_and_back_flanks_against_runge_kutta():
    """Lift-off, back flank and return, with friction and both kinds of damping: the error follows the tolerance.

    Steps of order 8 that know nothing of cells and touches; the estimate of the error covers the true one.
    """
    law = dataclasses.replace(hertzian_law(relief=3e-6), back=hertzian_law(relief=1e-6, cells=10))
    torque = constant(10.0) + TimeFunction(sines=((25.0, 6e3, 3.2),))
    gear_train = pair(law, torque=torque, backlash=8e-6, damping=Damping(ratio=0.005))
    mesh = dataclasses.replace(gear_train.meshes[0], damping=300.0, friction=0.05)
    model, times = build_train(dataclasses.replace(gear_train, meshes=(mesh,))), np.linspace(0.0, 0.7e-3, 71)
    force, approach = runge_kutta(model, times, 1e-12)
    assert (force[1:10] > 0.0).all()
    assert (force[-10:] > 0.0).all()
    assert (force < 0.0).sum() > 10
    assert (force == 0.0).sum() > 10
    own = 1e-9  # error of Runge-Kutta at steps that it ends nowhere, from the series at 1e-8 and 1e-10
    for tolerance in (1e-4, 1e-6, 1e-8):
        made = simulate(model, times, tolerance=tolerance, estimate=True)
        off = np.abs(made.contact_force[:, 0] - force).max() / np.abs(force).max()
        assert off < tolerance + own
        assert np.abs(made.transmission_error[:, 0] - approach).max() < (tolerance + own) * np.abs(approach).max()
        assert off < made.estimates["integration"] + own


@pytest.mark.parametrize("factor", [1e-3, 1e-6])
def test_a_stiffness_in_another_unit_is_refused(factor):
    """N/mm or N/um for N/m: the flanks would approach by more than a quarter of a module."""
    force = abs(TORQUE) / base_radius(30)
    for stiffness in (1e8 * factor, curve(20, 1e8 * factor)):
        yields = force / (1e8 * factor * (1.0 if isinstance(stiffness, float) else 0.9))
        words = re.escape(f"deflects by {1e3 * yields:.3g} mm, {yields / MODULE:.3g} modules, under the force")
        with pytest.raises(InputError, match=rf"{words}.*stiffnesses are in N/m"):
            build_train(train([(20, 30)], stiffness=lambda _, k=stiffness: k))


def test_a_curve_of_another_wheel_is_refused():
    """The mesh cycle is that of the pinion, so the wheel's base radius alone shows whose curve it is."""
    angle = np.radians(np.arange(18.0))
    table = StiffnessCurve(
        pinion_angle=angle, k_mesh=np.full(18, 1e8), mesh_cycle=math.radians(18.0), base_radius=base_radius(40)
    )
    words = rf"base radius of {1e3 * base_radius(40):.6g} mm, the driven gear has {1e3 * base_radius(30):.6g} mm"
    with pytest.raises(InputError, match=words):
        build_train(train([(20, 30)], stiffness=lambda _: table))
    build_train(train([(20, 40)], stiffness=lambda _: table))
