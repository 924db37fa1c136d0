"""Motion of gear trains against theory: energy, rotor dynamics, symmetries, high-precision solutions."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson, solve_ivp

from gearfe.drivetrain.train import Bearing, Damping, Drive, GearMesh, GearTrain, Load, Shaft, build_train, simulate
from gearfe.drivetrain.train.states import train_states
from gearfe.multibody import constant, integrate
from tests.makers.trains import ALPHA, SHIPPED, SPEED, base_radius, braking, changed, curve, elastic, gear, train

PERIOD = 0.15 * 2 * math.pi / SPEED  # common mesh period of two 20/30 stages


def uniform(end: float, count: int) -> np.ndarray:
    return np.linspace(0.0, end, count)


def energies(model, moved) -> tuple[np.ndarray, np.ndarray]:  # type: ignore[no-untyped-def]
    """Whole energy with absolute speeds, and the power of drive and loads."""
    v = moved.v.copy()
    spin = [int(i) + 5 for i in model.first]
    v[:, spin] += model.angle(moved.time, 1)[:, None] * model.ratios
    kinetic = 0.5 * np.einsum("ni,ij,nj->n", v, model.system.mass, v)
    potential = 0.5 * np.einsum("ni,ij,nj->n", moved.q, model.system.stiffness, moved.q)
    drive = model.train.drive
    row = [s.name for s in model.train.shafts].index(drive.shaft)
    relative = v @ model.spin_reference[row]
    power = moved.drive_torque * relative
    for direction, function in model.torques:
        power = power + function(moved.time) * (v @ direction)
    return kinetic + potential, power


def test_energy_balance_of_the_undamped_train() -> None:
    """Constant stiffness, no damping: what drive and load put in is kinetic and elastic energy."""
    model = build_train(elastic(train(SHIPPED), skew=0.4, uneven=0.2))
    trajectory = integrate(model.system, uniform(0.006, 6001), method="taylor", tolerance=1e-11, start=model.start)
    moved = train_states(model, trajectory)
    energy, power = energies(model, moved)
    work = cumulative_simpson(power, x=moved.time, initial=0.0)
    through = cumulative_simpson(moved.drive_torque * SPEED, x=moved.time, initial=0.0)
    assert np.abs(energy - energy[0] - work).max() < 1e-8 * np.abs(through).max()


def lone_rotor(**changes: object) -> GearTrain:
    """One driven shaft with a disc in the middle, both bores isotropic bearings."""
    from gearfe.drivetrain.train import ShaftGear

    shaft = Shaft("rotor", (0.0, 0.0, 0.0), 0.2, 0.01, ("a", "b"))
    gear_train = GearTrain(
        (shaft,), (ShaftGear("disc", "rotor", 0.0, gear(60, 0.02)),), (), Drive("rotor", "a", constant(4000.0)),
        rigid_bores={"a": (0.0, 0.09, 0.0), "b": (0.0, -0.09, 0.0)},
        bearings=tuple(Bearing(b, (2e6, 1e7, 2e6, 0.0, 0.0)) for b in "ab"),
    )  # fmt: skip
    return dataclasses.replace(gear_train, **changes)  # type: ignore[arg-type]


def test_gyroscopic_splitting() -> None:
    """Jt w^2 -+ Jp Omega w - k = 0: a tilted spinning rotor precesses forward and backward at two frequencies."""
    model = build_train(lone_rotor())
    body = model.shafts[0].rotor
    k, lever = 2 * 2e6 * 0.09**2, body.polar * 4000.0 / (2 * body.transverse)
    root = math.hypot(lever, math.sqrt(k / body.transverse))
    forward, backward = root + lever, root - lever
    assert forward / backward > 1.5
    times = uniform(0.02, 401)
    tilt = 1e-4
    start = dataclasses.replace(model.start, q=tilt * np.eye(6)[3], v=np.zeros(6))
    moved = integrate(model.system, times, method="taylor", tolerance=1e-11, start=start)
    # z = theta_1 + i theta_2: Jt z'' - i Jp Omega z' + k z = 0, so z = A e^(i w_f t) + B e^(-i w_b t)
    a = tilt * backward / (forward + backward)
    z = a * np.exp(1j * forward * times) + (tilt - a) * np.exp(-1j * backward * times)
    assert np.abs(moved.q[:, 3] + 1j * moved.q[:, 4] - z).max() < 1e-8 * tilt
    still = build_train(lone_rotor(damping=Damping(gyroscopic=False)))
    plain = integrate(
        still.system, times, method="taylor", tolerance=1e-11, start=dataclasses.replace(still.start, q=start.q)
    )
    assert np.abs(plain.q[:, 3] - tilt * np.cos(math.sqrt(k / body.transverse) * times)).max() < 1e-8 * tilt


def test_modal_damping_decays_as_it_should() -> None:
    """A free vibration of the one mode of a single stage: exp(-zeta omega t) cos(omega_d t)."""
    model = build_train(train([(20, 30)], damping=Damping(ratio=0.02), loads=()))
    omega = 2 * math.pi * model.coupled_frequencies_hz[-1]
    inertia = model.shafts[1].rotor.polar
    assert omega == pytest.approx(math.sqrt(1e8 * base_radius(30) ** 2 / inertia), rel=1e-9)
    v = np.zeros(12)
    v[11] = 1e-3
    times = uniform(0.004, 201)
    moved = integrate(
        model.system, times, method="taylor", tolerance=1e-11, start=dataclasses.replace(model.start, v=v)
    )
    damped = omega * math.sqrt(1 - 0.02**2)
    expected = 1e-3 / damped * np.exp(-0.02 * omega * times) * np.sin(damped * times)
    assert np.abs(moved.q[:, 11] - expected).max() < 1e-8 * 1e-3 / omega


def pair_scene() -> GearTrain:
    """Two spins, one bearing translation, a torsional spring at the drive, mesh damping, periodic stiffness."""
    one = Shaft("s0", (0.0, 0.0, 0.0), 0.06, 0.01, ("a",))
    two = Shaft("s1", (0.0625, 0.0, 0.0), 0.06, 0.01, ("b",))
    base = train([(20, 30)], ys=[0.0])
    mesh = GearMesh("d0", "g0", curve(20, swing=0.12), damping=300.0)
    return changed(
        base, shafts=(one, two), meshes=(mesh,), rigid_bores={"a": (0.0, 0.0, 0.0), "b": (0.0625, 0.0, 0.0)},
        bearings=(Bearing("b", (4e7, 0.0, 6e7, 1.0, 1.0), (50.0, 0.0, 80.0, 0.0, 0.0)),),
        drive=Drive("s0", "a", constant(SPEED), 2e4, 0.3), loads=(Load("s1", "b", braking(1)),),
    )  # fmt: skip


def test_single_pair_against_a_high_precision_solution() -> None:
    """Written out by hand for the two spins and the bearing's two translations, integrated to 1e-13."""
    model = build_train(pair_scene())
    J1, J2, m = (model.shafts[0].rotor.polar, model.shafts[1].rotor.polar, model.shafts[1].rotor.mass)
    r1, r2 = base_radius(20), base_radius(30)
    table, load = curve(20, swing=0.12), braking(1)
    s, c = math.sin(ALPHA), math.cos(ALPHA)

    def rhs(t: float, y: np.ndarray) -> np.ndarray:
        p1, p2, x, z, w1, w2, vx, vz = y  # rests of the rotations, translation of the driven gear
        # n = (sin, 0, -cos); delta = r1 phi1 + r2 phi2 - n . u
        delta, rate = r1 * p1 + r2 * p2 - (s * x - c * z), r1 * w1 + r2 * w2 - (s * vx - c * vz)
        F = float(table(SPEED * t + p1).value) * delta + 300.0 * rate
        return np.array([
            w1, w2, vx, vz,
            (-2e4 * p1 - 0.3 * w1 - r1 * F) / J1,
            (float(load(t)) - r2 * F) / J2,
            (-4e7 * x - 50.0 * vx + s * F) / m,
            (-6e7 * z - 80.0 * vz - c * F) / m,
        ])  # fmt: skip

    times = uniform(4e-3, 161)
    y = np.zeros((161, 8))
    for begin, end in ((0.0, 1e-3), (1e-3, 4e-3)):  # the load's ramp ends at 1 ms
        part = (times >= begin) & (times <= end)
        state = y[np.flatnonzero(part)[0]]
        # the curve has kinks of its second derivative every 0.45 deg: short steps
        found = solve_ivp(rhs, (begin, end), state, "DOP853", times[part], rtol=1e-13, atol=1e-18, max_step=2e-6)
        y[part] = found.y.T
    trajectory = integrate(model.system, times, method="taylor", tolerance=1e-12, start=model.start)
    q = trajectory.q
    mine = np.stack([q[:, 5], q[:, 11], q[:, 6], q[:, 8]], axis=1)
    assert np.abs(mine - y[:, :4]).max(axis=0) == pytest.approx(0.0, abs=1e-9 * np.abs(y[:, :4]).max(axis=0).min())
    v = trajectory.v
    speeds = np.stack([v[:, 5], v[:, 11], v[:, 6], v[:, 8]], axis=1)
    assert (np.abs(speeds - y[:, 4:]).max(axis=0) < 1e-9 * np.abs(y[:, 4:]).max(axis=0)).all()


def test_phase_follows_the_state_not_the_nominal_angle() -> None:
    """A soft coupling lets the driver lag behind: the stiffness is that of its actual rotation."""
    gear_train = changed(pair_scene(), drive=Drive("s0", "a", constant(SPEED), 5e2, 0.3))
    model = build_train(gear_train)
    times = uniform(4e-3, 81)
    moved = train_states(model, integrate(model.system, times, method="taylor", tolerance=1e-9, start=model.start))
    line = model.meshes[0]
    lag = moved.q[:, 5]
    assert np.abs(lag).max() > 0.02
    delta, rate = moved.q @ line.row, moved.v @ line.row
    actual = curve(20, swing=0.12)(SPEED * times + lag).value * delta + 300.0 * rate
    assert moved.contact_force[:, 0] == pytest.approx(actual, rel=1e-12, abs=1e-9)


def test_tolerance_one_millionth() -> None:
    gear_train = elastic(
        train(SHIPPED, stiffness=lambda z: curve(z, swing=0.12), damping=Damping(ratio=0.01)), skew=0.3, uneven=0.2
    )
    model = build_train(gear_train)
    coarse, fine = (simulate(model, uniform(7e-3, 201), tolerance=tol) for tol in (1e-6, 1e-12))
    for name in ("contact_force", "speed", "acceleration", "attachment_acceleration"):
        one, two = getattr(coarse, name), getattr(fine, name)
        least = 1e-6 * np.abs(two).max()  # the drive's own acceleration relative to its bore is zero
        assert (np.abs(one - two).max(axis=0) <= 1e-5 * np.maximum(np.abs(two).max(axis=0), least)).all(), name
    assert simulate(model, uniform(7e-3, 11), estimate=True).estimates["integration"] < 1e-5


def test_explicit_and_implicit_agree() -> None:
    gear_train = elastic(train([(20, 30)], stiffness=lambda z: curve(z, swing=0.1), damping=Damping(beta=1e-6)))
    model = build_train(gear_train)
    one = simulate(model, uniform(1e-3, 21), method="taylor", tolerance=1e-9)
    two = simulate(model, uniform(1e-3, 21), method="implicit", tolerance=1e-6)
    assert np.abs(one.contact_force - two.contact_force).max() < 1e-3 * np.abs(one.contact_force).max()
    assert two.statistics["method"] == "implicit"


def test_symmetric_scene_has_no_axial_motion() -> None:
    gear_train = elastic(train(SHIPPED, stiffness=curve, ys=[0.0, 0.0], gears=()))
    base = train(SHIPPED, stiffness=curve)
    # both gears of the middle shaft straddle its middle symmetrically: two equal halves of each at +-y
    halves, meshes = [], []
    for item in base.gears:
        distance = 0.006 if item.name.endswith("0") else 0.018
        for sign in (1, -1):
            halves.append(
                dataclasses.replace(item, name=f"{item.name}{'+' if sign > 0 else '-'}", along=sign * distance)
            )
    for mesh in base.meshes:
        meshes += [GearMesh(mesh.driver + s, mesh.driven + s, mesh.stiffness) for s in "+-"]
    gear_train = changed(gear_train, gears=tuple(halves), meshes=tuple(meshes))
    response = simulate(build_train(gear_train), uniform(5e-3, 101))
    across = np.abs(response.modal_acceleration[:, [6 * i for i in range(6)]]).max()  # type: ignore[index]
    assert across > 10.0
    assert np.abs(response.attachment_acceleration).max() < 1e-9 * across
    lopsided = simulate(build_train(elastic(base, uneven=0.3, skew=0.3)), uniform(5e-3, 101))
    assert np.abs(lopsided.attachment_acceleration).max() > 0.1


def test_reversing_speeds_and_torques_mirrors_the_result() -> None:
    """The mirror is the plane of the axes: forces equal, rotations opposite, z opposite, x and y equal."""
    gear_train = elastic(train(SHIPPED, stiffness=curve), uneven=0.3)
    model = build_train(gear_train)
    back = changed(
        gear_train, drive=Drive("s0", "s0+", constant(-SPEED)), loads=(Load("s2", "s2+", -1.0 * braking(2)),)
    )
    one, two = (simulate(m, uniform(5e-3, 101), tolerance=1e-9) for m in (model, build_train(back)))
    assert np.abs(one.contact_force - two.contact_force).max() < 1e-7 * one.contact_force.max()
    assert np.abs(one.speed + two.speed).max() < 1e-7 * 600
    a, b = one.modal_acceleration, two.modal_acceleration
    assert a is not None
    assert b is not None
    sign = np.append(np.tile([1.0, 1.0, -1.0, -1.0, -1.0, 1.0], 6), [1.0, -1.0])
    assert np.abs(a - sign * b).max() < 1e-6 * np.abs(a).max()
    assert one.contact_force[20:].min() > 0.0  # F > 0 presses in both senses
