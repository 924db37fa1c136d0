"""Friction of meshes: loss, efficiency, energy, the formula of the coefficient, mistakes."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.drivetrain.train import Bearing, Damping, Drive, Load, build_train, simulate
from gearfe.drivetrain.train.forces import LawFlank, TrainForces
from gearfe.drivetrain.train.friction import Lubrication, Sliding, smooth_sign
from gearfe.drivetrain.train.series import train_order
from gearfe.gears.geometry.pair import MeshGeometry
from gearfe.multibody import TimeFunction, constant, smoothed_step
from tests.makers.mesh_laws import hertzian_law
from tests.makers.rated import fzg
from tests.makers.train_pairs import R1, R2, pair
from tests.makers.trains import gear, series_at_start

GEOMETRY = MeshGeometry(gear(20), gear(30))


def rubbing(law, friction, **options):  # type: ignore[no-untyped-def]
    train = pair(law, **options)
    return dataclasses.replace(train, meshes=(dataclasses.replace(train.meshes[0], friction=friction),))


def sliding(**changes):  # type: ignore[no-untyped-def]
    return dataclasses.replace(Sliding(0.08, 0.07, 6, 7, 5.0 / 3.0, R1, -0.08, R1 * math.tan(0.43)), **changes)


@pytest.mark.parametrize("s", [1e-6, -1e-6])
def test_the_series_of_friction_sums_up_to_its_law(s):
    """Two flanks along a motion that is a polynomial of time, one just at its pitch point."""
    angle = (constant(600.0) + TimeFunction(sines=((20.0, 4e4, 0.3),))).integral(0.0, 0.0)
    law = hertzian_law(0.3)
    flanks = (
        LawFlank(3, 2, 1.0, 1.0, 0.006, 1e8, 0.0, law, 0.2, sliding(pitch_phase=0.131)),
        LawFlank(4, 5, 1.0, -1.0, 0.0585, 0.0, -2e-6, law, 0.0, sliding(across=8)),
    )
    forces = TrainForces(9, angle, (), flanks, ())
    random, t, most = np.random.default_rng(4), 0.21e-3, 30
    u = np.zeros((9, most + 1))
    u[:, :5] = random.normal(size=(9, 5)) * [1e-6, 2e-7, 1e-7, 1e-7, 1e-7]
    u[3:5, 0], u[6:] = (3.1e-5, 1.7e-5), 1e-2 * u[6:]
    parameters, memory, pieces = series_at_start(forces, t, math.copysign(1.0, s), u, s)
    out, orders = np.zeros(9), np.zeros((most, 9))
    for j in range(most):
        train_order(j, t, s, u, parameters, memory, pieces, out)
        orders[j] = out
    powers = np.arange(most + 1)
    for x in (0.0, 0.3, 0.9):
        now, rate = u @ x**powers, (u[:, 1:] * powers[1:]) @ x ** powers[:-1] / s
        true = forces(np.array([t + s * x]), now[None], rate[None])[0]
        assert np.abs(true[6:]).min() > 0.0
        assert x ** powers[:-1] @ orders == pytest.approx(true, rel=1e-11, abs=1e-11 * np.abs(true).max())


def loss_factor(law, force):  # type: ignore[no-untyped-def]
    """H_V = 1/p_b int sum_k F_k/F v_k/v_b de, with v_k = |e_k| (omega_1 + omega_2) and v_b = r_b1 omega_1."""
    phases = law.cycle * (np.arange(4000) + 0.5) / 4000
    shares = law(phases, law.approach(phases, force)).pair_forces / force
    pitch = GEOMETRY.pinion_angle_at(R1 * math.tan(GEOMETRY.working_pressure_angle))
    e = R1 * (law.pair_phases(phases) - pitch)
    return float((shares * np.abs(e) * (1.0 + 20.0 / 30.0) / R1).sum(axis=1).mean())


def slow(law, mu, torque):  # type: ignore[no-untyped-def]
    """Two mesh cycles at 1 rad/s under a torque, after its ramp, much damped."""
    train = rubbing(law, mu, speed=1.0, torque=smoothed_step(0.01, 0.02, torque), damping=Damping(ratio=0.3))
    model = build_train(train)
    made = simulate(model, np.linspace(0.0, 0.05 + 4 * math.pi / 20, 3001), tolerance=1e-6)
    return model, made.at(np.flatnonzero(made.time > 0.05))


@pytest.mark.parametrize("relief", [0.0, 5e-6])
def test_the_loss_of_slow_running_is_the_loss_factor(relief):
    """1 - efficiency = mu H_V with the load sharing of the law (Ohlendorf 1958; Niemann and Winter II)."""
    law, mu, torque = hertzian_law(relief=relief), 0.05, 60.0
    assert GEOMETRY.pinion_angle_at(R1 * math.tan(math.radians(25))) == pytest.approx(-math.pi / 40)
    _, made = slow(law, mu, torque)
    loss, power = (np.trapezoid(x[:, 0], made.time) / np.ptp(made.time) for x in (made.friction_power, made.mesh_power))
    assert power - loss == pytest.approx(torque * 2.0 / 3.0, rel=2e-4)  # what arrives at the load
    assert loss / power == pytest.approx(mu * loss_factor(law, torque / R2), rel=0.02)


def test_forces_of_slow_running_are_those_of_statics():
    """Moments about the driven gear's axis, and the loss mu F_k |v_k| of each pair, from the law alone."""
    law, mu, torque = hertzian_law(), 0.08, 60.0
    model, made = slow(law, mu, torque)
    line, tangent = model.meshes[0], math.tan(math.radians(25))
    phase = made.drive_angle + line.phase
    e = R1 * (law.pair_phases(phase) + math.pi / 40)
    force = np.full(len(phase), torque / R2)
    for _ in range(20):  # R2 F + mu sum F_k sgn(v_k) (R2 tan alpha - e_k) = T
        drag = (
            mu * law(phase, law.approach(phase, force)).pair_forces * smooth_sign(5.0 / 3.0 * e / line.sliding.speed)[0]
        )
        force = (torque - (drag * (R2 * tangent - e)).sum(axis=1)) / R2
    assert np.ptp(force) > 0.05 * torque / R2
    away = np.abs(e).min(axis=1) > 3e-4  # at the pitch point the yielding teeth slide, too
    assert away.mean() > 0.9
    assert np.abs(made.contact_force[:, 0] - force)[away].max() < 1e-3 * torque / R2
    loss = (drag * 5.0 / 3.0 * e).sum(axis=1)
    assert made.friction_power[:, 0].mean() == pytest.approx(loss.mean(), rel=1e-3)


@pytest.mark.parametrize("backlash", [None, 10e-6])
def test_energy_balance_with_friction_in_fast_running(backlash):
    """Drive + load = change of kinetic and elastic energy + loss, without other damping; teeth part, and meet."""
    law, torque = hertzian_law(relief=3e-6), constant(40.0)
    train = rubbing(law, 0.06, speed=700.0, torque=torque, backlash=backlash)
    model = build_train(train)
    times = np.linspace(0.0, 2e-3, 40_001)
    made = simulate(model, times, tolerance=1e-10)
    line = model.meshes[0]
    assert (made.contact_force[:, 0] == 0).any()
    kinetic = 0.5 * made.speed_absolute**2 @ np.array([s.rotor.polar for s in model.shafts])
    phase = line.sense * made.drive_angle + line.phase
    elastic = law(phase, made.transmission_error[:, 0]).energy
    if backlash is not None:
        elastic = elastic + law(-phase, -made.transmission_error[:, 0] - backlash).energy
    flow = made.drive_torque * made.speed_absolute[:, 0] + 40.0 * made.speed_absolute[:, 1] - made.friction_power[:, 0]
    dt = times[1] - times[0]
    work = np.concatenate([[0.0], np.cumsum(0.5 * (flow[1:] + flow[:-1])) * dt])
    change = kinetic + elastic - kinetic[0] - elastic[0]
    assert (made.friction_power >= 0.0).all()
    assert np.abs(change - work).max() < 1e-4 * np.abs(elastic).max()
    assert np.abs(change - work).max() < 1e-6 * np.abs(kinetic).max()


def test_friction_pushes_the_bores_across_the_line_of_action():
    """Bearings as springs: their forces on the driven shaft balance that of the mesh, friction included."""
    law, mu, torque = hertzian_law(), 0.1, 60.0
    torque_at = smoothed_step(0.01, 0.02, torque)
    train = rubbing(law, mu, speed=3.0, torque=torque_at, damping=Damping(ratio=0.3), ys=[0.0])
    stiff = (1e8, 1e8, 1e8, 1e6, 1e6)
    train = dataclasses.replace(train, bearings=tuple(Bearing(bore, stiff) for bore in ("s1+", "s1-")))
    model = build_train(train)
    made = simulate(model, np.linspace(0.0, 0.1, 401), tolerance=1e-6).at(np.arange(240, 401))
    line = model.meshes[0]
    phase = line.sense * made.drive_angle + line.phase
    shares = law(phase, made.transmission_error[:, 0]).pair_forces
    e = R1 * (law.pair_phases(phase) + math.pi / 40)
    drag = mu * (shares * smooth_sign(5.0 * e / line.sliding.speed)[0]).sum(axis=1)
    across = np.cross(train.frame[2], line.direction)
    mesh = np.outer(made.contact_force[:, 0], line.direction) + np.outer(drag, across)
    away = np.abs(e).min(axis=1) > 3e-4
    assert (made.gear_pose[:, 1, :3] * 2e8)[away] == pytest.approx(mesh[away], abs=5e-3 * np.abs(mesh).max())
    assert np.abs(drag[away]).max() > 0.05 * np.abs(mesh).max()


def test_a_drive_that_reverses_is_braked_both_ways():
    law = hertzian_law()
    turn = smoothed_step(0.03, 0.04, -40.0) + constant(20.0)
    torque = smoothed_step(1e-3, 2e-3, 30.0)
    train = rubbing(law, 0.1, torque=torque, backlash=30e-6, damping=Damping(ratio=0.05))
    train = dataclasses.replace(train, drive=Drive("s0", "s0+", turn))
    made = simulate(build_train(train), np.linspace(0.0, 0.06, 1201), tolerance=1e-6)
    assert made.speed[0, 0] * made.speed[-1, 0] < 0.0
    assert (made.friction_power >= 0.0).all()
    first, last = made.mesh_power[60:200, 0].mean(), made.mesh_power[-200:, 0].mean()
    assert first > 30.0 * 20.0 * 2 / 3  # the load brakes: more goes in than comes out
    assert -30.0 * 20.0 * 2 / 3 < last < 0.0  # the load drives: less arrives at the drive


def test_the_mean_coefficient_by_schlenk():
    """By hand: 200 N/mm, v_t = 15 m/s, 25 deg, r_w 25 and 37.5 mm, 40 mPa s, Ra 0.4 um."""
    sine = math.sin(math.radians(25))
    by_hand = 0.048 * (200.0 / (2 * 15.0 * sine * (25.0 * 37.5 / 62.5) * sine)) ** 0.2 * 40.0**-0.05 * 0.4**0.25
    oil = Lubrication(0.040, 0.4e-6)
    assert oil.coefficient(GEOMETRY, 2000.0, 600.0) == pytest.approx(by_hand, rel=1e-12)
    assert oil.coefficient(GEOMETRY, -2000.0, -600.0) == pytest.approx(by_hand, rel=1e-12)
    assert oil.coefficient(GEOMETRY, 100.0, 600.0) == oil.coefficient(GEOMETRY, 1500.0, 600.0)  # 150 N/mm at least
    law = hertzian_law()
    model = build_train(rubbing(law, oil, torque=constant(2000.0 * R2)))
    assert model.meshes[0].sliding.coefficient == pytest.approx(by_hand, rel=1e-6)


@pytest.mark.parametrize(
    ("width", "force", "rpm", "oil", "printed"),
    [
        (14.0, 5912.1, 1500.0, Lubrication(46.23e-3, 0.600e-6, 0.85), "0.0483"),
        (14.0, 5912.1, 1500.0, Lubrication(46.23e-3, 0.600e-6, 0.846), "0.0481"),
        (14.0, 5912.1, 1500.0, Lubrication(13.28e-3, 0.355e-6, 0.846), "0.0449"),
        (40.0, 6370.7, 1800.0, Lubrication(49.85e-3, 0.355e-6, 0.65), "0.0256"),
    ],
)
def test_the_coefficient_of_fzg_pairs_as_printed(width, force, rpm, oil, printed):
    """Coefficients by Schlenk in the reports C14 and C40 of an open program, with the forces and oils they print."""
    coefficient = oil.coefficient(fzg(width), force, rpm * math.pi / 30.0)
    assert f"{coefficient:.4f}" == printed


def test_mistakes():
    law = hertzian_law()
    for friction in (-0.1, 0.6, math.nan):
        with pytest.raises(InputError, match="must be 0 to"):
            build_train(rubbing(law, friction))
    with pytest.raises(InputError, match="load"):
        build_train(rubbing(1e8, 0.05))
    with pytest.raises(InputError, match="viscosity"):
        build_train(rubbing(law, Lubrication(-1.0, 1e-6)))
    still = dataclasses.replace(
        rubbing(law, Lubrication(0.04, 1e-6)),
        drive=Drive("s0", "s0+", constant(0.0)),
        loads=(Load("s1", None, constant(1.0)),),
    )
    with pytest.raises(InputError, match="the gears do not rotate"):
        build_train(still)
