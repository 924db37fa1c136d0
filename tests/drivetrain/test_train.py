"""Gear trains against theory: mean forces, statics, kinematics; what is reported, left out or refused."""

from __future__ import annotations

import dataclasses
import math
import subprocess
import sys

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.drivetrain.runup.train_stability import train_stability
from gearfe.drivetrain.train import Bearing, Damping, Drive, GearMesh, Load, build_train, simulate
from gearfe.drivetrain.train.elements import outline_moments
from gearfe.drivetrain.train.states import train_states
from gearfe.multibody import IntegrationError, constant, integrate, smoothed_step
from tests.makers.full_model import full_model
from tests.makers.trains import (
    ALPHA,
    SHIPPED,
    SPEED,
    TORQUE,
    base_radius,
    braking,
    changed,
    curve,
    elastic,
    gear,
    train,
)

PERIOD = 0.15 * 2 * math.pi / SPEED  # common mesh period of two 20/30 stages


def uniform(end: float, count: int) -> np.ndarray:
    return np.linspace(0.0, end, count)


@pytest.mark.parametrize("stages", [[(20, 30)], SHIPPED, [(20, 30), (19, 31), (24, 36)]], ids=["two", "three", "four"])
def test_mean_forces_and_their_ratio_over_whole_periods(stages: list[tuple[int, int]]) -> None:
    """Once the vibration is periodic no shaft accelerates on average: F = torque/base radius, stage by stage.

    The four-shaft train repeats after many mesh cycles; there the constant stiffness decays to the static forces.
    """
    expected, torque = [], abs(TORQUE)
    for one, two in reversed(stages):
        expected.insert(0, torque / base_radius(two))
        torque *= one / two
    periodic = len(stages) < 3
    stiffness = (lambda z: curve(z, swing=0.15)) if periodic else 1e8
    gear_train = elastic(
        train(stages, stiffness=stiffness, damping=Damping(ratio=0.03), ys=[0.012, -0.0, -0.012][: len(stages)])
    )
    model = build_train(gear_train)
    assert gear_train.kinematics.steady_forces == pytest.approx(expected, rel=1e-12)
    cycles = model.kinematics.common_turns
    assert cycles is not None or not periodic
    period = float(cycles) * 2 * math.pi / SPEED if cycles is not None and periodic else 1e-3
    count = math.ceil((0.03 if periodic else 0.09) / period)
    times = np.concatenate([[0.0], np.linspace(count * period, (count + 1) * period, 801)])
    response = simulate(model, times, tolerance=1e-9)
    mean = response.contact_force[1:-1].mean(axis=0)
    assert mean == pytest.approx(expected, rel=1e-5)
    assert response.status == "done"
    assert not response.warnings


def test_initial_speeds() -> None:
    """A free shaft may start at another speed: with the mesh as spring it swings about rolling."""
    base = train([(20, 30)], loads=())
    omega = 2 * math.pi * build_train(base).coupled_frequencies_hz[-1]
    shafts = (base.shafts[0], dataclasses.replace(base.shafts[1], initial_speed=-390.0))
    response = simulate(build_train(changed(base, shafts=shafts)), uniform(2e-3, 41), tolerance=1e-9)
    assert response.speed[:, 1] == pytest.approx(-400 + 10 * np.cos(omega * response.time), abs=1e-6)
    shafts = (dataclasses.replace(base.shafts[0], initial_speed=500.0), base.shafts[1])
    with pytest.raises(InputError, match="contradicts the drive"):
        build_train(changed(base, shafts=shafts))


def test_rolling_of_the_shipped_train() -> None:
    model = build_train(train(SHIPPED))
    assert model.system.breaks == pytest.approx([0.0, 1e-3])  # steps end where the load's ramp does
    assert model.load_end == 1e-3
    response = simulate(model, uniform(1e-3, 11))
    assert model.ratios == pytest.approx([1, -2 / 3, 4 / 9])
    assert response.common_period_s == pytest.approx(1.5707963e-3, rel=1e-7)
    assert response.mesh_frequencies_Hz == pytest.approx([20 * 600 / (2 * math.pi), 20 * 400 / (2 * math.pi)])
    assert response.speed[0] == pytest.approx([600.0, -400.0, 800 / 3])


def test_mass_and_inertia_of_a_gear_lie_between_those_of_its_circles() -> None:
    item = gear(30)
    area, second = outline_moments(item)
    assert math.pi * item.root_radius**2 < area < math.pi * item.tip_radius**2
    assert 0.5 * math.pi * item.root_radius**4 < second < 0.5 * math.pi * item.tip_radius**4
    slim = dataclasses.replace(item, teeth=60, module=item.module / 2, tip_round=5e-5)
    assert outline_moments(slim)[0] == pytest.approx(math.pi * slim.reference_radius**2, rel=0.03)


def test_law_for_one_state_equals_law_for_whole_arrays() -> None:
    """The compiled law, called in Python, against the vectorised forces: speed ramp, curves, gyroscopic moments."""
    speed = constant(600.0) + smoothed_step(1e-3, 1e-3, 50.0)
    for method in ("cubic", "linear"):
        gear_train = elastic(
            train(SHIPPED, stiffness=lambda z, m=method: curve(z, method=m), drive=Drive("s0", "s0+", speed))
        )
        system = (model := build_train(gear_train)).system
        rng = np.random.default_rng(1)
        t = rng.uniform(0, 0.01, 7)
        q, v = 1e-3 * rng.standard_normal((2, 7, system.size))
        W = model.directions
        many = model.forces(t, q @ W, v @ W) @ W.T
        for i in range(7):
            one = system.force(t[i], q[i], v[i]) + system.damping @ v[i] + system.stiffness @ q[i]
            scale = np.abs(system.stiffness @ q[i]).max()
            assert np.abs(one - many[i]).max() < 1e-13 * scale


@pytest.mark.parametrize("rigid_housing", [True, False])
def test_ideal_rigid_mesh(rigid_housing: bool) -> None:
    """A rigid housing leaves nothing free: F is exact statics. In an elastic one it is a stiff spring's limit."""
    if rigid_housing:
        response = simulate(build_train(train(SHIPPED, stiffness=None)), uniform(2e-3, 41))
        force = -smoothed_step(0.5e-3, 1e-3, TORQUE)(response.time) / base_radius(30)
        assert response.contact_force[:, 1] == pytest.approx(force, abs=1e-6)
        assert response.contact_force[:, 0] == pytest.approx(force * 2 / 3, abs=1e-6)
        return
    damping = Damping(beta=2e-6)
    stiff = [
        elastic(train(SHIPPED, stiffness=k, damping=dataclasses.replace(damping, beta=2e-6)), skew=0.2)
        for k in (None, 2e10, 4e10)
    ]
    ideal, one, two = (simulate(build_train(s), uniform(3e-3, 61), tolerance=1e-8, method="taylor") for s in stiff)
    extrapolated = 2 * two.contact_force - one.contact_force  # the error falls with 1/k
    assert np.abs(extrapolated - ideal.contact_force).max() < 2e-3 * np.abs(ideal.contact_force).max()
    assert (
        np.abs(two.contact_force - ideal.contact_force).max()
        < 0.7 * np.abs(one.contact_force - ideal.contact_force).max()
    )


@pytest.mark.parametrize("method", ["auto", "taylor", "implicit"])
def test_rigid_meshes_in_a_rigid_housing_are_statics(method: str) -> None:
    """Nothing is left to integrate: forces and the drive's torque by hand."""
    model = build_train(train(SHIPPED, stiffness=None))
    made = simulate(model, uniform(2e-3, 5), method=method, estimate=True)
    assert made.status == "done"
    force = abs(TORQUE) / base_radius(30)
    assert made.contact_force[-1] == pytest.approx([force * 2 / 3, force])
    assert made.drive_torque[-1] == pytest.approx(abs(TORQUE) * 4 / 9)


def test_a_loop_of_rigid_meshes_is_refused() -> None:
    """How two rigid paths share a load in a rigid housing is open; springs or an elastic housing tell it."""
    base = train([(20, 30)])
    sides = (("a", -0.02), ("b", 0.02))
    twice = tuple(dataclasses.replace(g, name=g.name + s, along=y) for g in base.gears for s, y in sides)
    meshes = tuple(GearMesh("d0" + s, "g0" + s, None) for s in "ab")
    one_stage = changed(base, gears=twice, meshes=meshes)
    with pytest.raises(InputError, match=r"mesh 'd0b-g0b' rigid.*leaves the forces open"):
        build_train(one_stage)
    build_train(changed(one_stage, meshes=(meshes[0], dataclasses.replace(meshes[1], stiffness=1e8))))
    build_train(elastic(one_stage))


def test_drive_of_changing_speed() -> None:
    """Rigid meshes in a rigid housing: the drive's torque is the reduced inertia times its acceleration."""
    speed = smoothed_step(1e-3, 2e-3, SPEED)
    model = build_train(train(SHIPPED, stiffness=None, drive=Drive("s0", "s0+", speed), loads=()))
    response = simulate(model, uniform(3e-3, 61))
    reduced = sum(s.rotor.polar * g**2 for s, g in zip(model.shafts, model.ratios, strict=True))
    assert response.drive_torque == pytest.approx(
        reduced * speed(response.time, 1), abs=1e-9 * 600 / 2e-3 * reduced * 1e3
    )
    last = model.shafts[2].rotor.polar * model.ratios[2] * speed(response.time, 1)
    assert response.contact_force[:, 1] == pytest.approx(last / base_radius(30), abs=1e-6)
    assert response.speed[:, 1] == pytest.approx(-2 / 3 * speed(response.time), abs=1e-9)
    assert response.acceleration[:, 2] == pytest.approx(4 / 9 * speed(response.time, 1), abs=1e-6)


def test_static_deflection_with_bearings() -> None:
    """One stage on bearings: spin, shift and tilt of the driven shaft under the static force, by hand."""
    k, kb, kt = 1e8, 5e7, 3e3
    gear_train = train([(20, 30)], stiffness=k, ys=[0.012], damping=Damping(ratio=0.3))
    gear_train = changed(
        gear_train, bearings=tuple(Bearing(b, (kb, 2 * kb, 1.5 * kb, kt, 2 * kt)) for b in ("s1+", "s1-"))
    )
    model = build_train(gear_train)
    moved = train_states(
        model, integrate(model.system, [0.0, 0.05, 0.08], method="taylor", tolerance=1e-10, start=model.start)
    )
    q = moved.q[-1, model.first[1] : model.first[1] + 6]
    F = abs(TORQUE) / base_radius(30)
    # the driver turns about +y, its pitch point at +x moves towards -z: t = -z, c = +x
    n = np.array([math.sin(ALPHA), 0.0, -math.cos(ALPHA)])
    y0 = model.shafts[1].rotor.centre[1]
    K = np.zeros((2, 2))  # shift along x and tilt about z: bores at +-33 mm, both of stiffness kb
    for y in (0.033, -0.033):
        arm = np.array([1.0, -(y - y0)])  # x-shift at height y: u_x - theta_z (y - y0)
        K += kb * np.outer(arm, arm) + np.diag([0.0, 2 * kt])
    shift, tilt = np.linalg.solve(K, F * n[0] * np.array([1.0, -(0.012 - y0)]))
    assert q[0] == pytest.approx(shift, rel=1e-6)
    frame = model.train.frame
    assert frame == pytest.approx(np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]))  # e2 = a x e1 = -z
    assert -q[4] == pytest.approx(tilt, rel=1e-6)  # the tilt coordinate about e2 = -z
    assert q[1] == pytest.approx(0.0, abs=1e-12)
    delta = moved.q[-1] @ model.meshes[0].row
    assert k * delta == pytest.approx(F, rel=1e-6)
    assert moved.contact_force[-1, 0] == pytest.approx(F, rel=1e-6)


def test_stiff_bearings_are_hinges() -> None:
    """In an elastic housing: the coupled frequencies approach those with hinges from below, as 1/stiffness."""
    gear_train = elastic(train(SHIPPED), skew=0.3)
    hinged = build_train(gear_train).coupled_frequencies_hz[:12]
    off = []
    for k in (1e11, 2e11):
        bearings = tuple(Bearing(b, (k, k, k, 1e-2 * k, 1e-2 * k)) for b in gear_train.bore_points)
        off.append(hinged - build_train(changed(gear_train, bearings=bearings)).coupled_frequencies_hz[:12])
    assert (off[1] > 0.0).all()
    assert (off[1] < 5e-3 * hinged).all()
    assert off[0] / off[1] == pytest.approx(2.0, rel=0.02)


def test_rigid_housing_reports_redundant_hinges() -> None:
    response = simulate(build_train(train(SHIPPED)), uniform(1e-3, 11))
    assert len(response.statistics["redundant_constraints"]) == 3 * 5
    assert all("hinge" in name for name in response.statistics["redundant_constraints"])
    assert response.modal is None
    assert not response.attachment_acceleration.any()
    assert simulate(build_train(elastic(train(SHIPPED))), uniform(1e-3, 11)).statistics["redundant_constraints"] == []


def test_speeds_are_relative_to_the_bore() -> None:
    response = simulate(build_train(elastic(train(SHIPPED), skew=0.3)), uniform(3e-3, 61))
    assert response.speed[:, 0] == pytest.approx(SPEED, abs=1e-9)
    assert np.abs(response.speed_absolute[:, 0] - SPEED).max() > 1e-3
    assert response.drive_angle == pytest.approx(SPEED * response.time)
    own = response.modal_velocity[:, 6 * 4 + 4]  # type: ignore[index]  # bore s2+: rotation about y
    assert response.speed_absolute[:, 2] - response.speed[:, 2] == pytest.approx(own, abs=1e-9)


def test_what_is_left_out_shows() -> None:
    """Removing a bore, the gyroscopic moments or the reaction torque changes the result; a fixed number each."""
    gear_train = elastic(train(SHIPPED, stiffness=curve), skew=0.3, uneven=0.3)
    times = uniform(4e-3, 81)
    whole = simulate(build_train(gear_train), times)
    size = np.abs(whole.attachment_acceleration).max()
    shafts = (*gear_train.shafts[:2], dataclasses.replace(gear_train.shafts[2], bores=("s2+",)))
    bore = simulate(build_train(changed(gear_train, shafts=shafts)), times)
    assert np.abs(bore.contact_force - whole.contact_force).max() > 0.01 * whole.contact_force.max()
    assert bore.attachment_names == ("s0+", "s0-", "s1+", "s1-", "s2+")
    still = simulate(build_train(changed(gear_train, damping=Damping(gyroscopic=False))), times)
    assert np.abs(still.attachment_acceleration - whole.attachment_acceleration).max() > 1e-4 * size
    outside = changed(gear_train, loads=(Load("s2", None, gear_train.loads[0].torque),))
    free = simulate(build_train(outside), times)
    assert np.abs(free.attachment_acceleration - whole.attachment_acceleration).max() > 1e-3 * size
    # the reaction is the whole torque on the bore: statics of its rotation about y
    slow = Damping(ratio=0.5)
    turned = []
    for loads in (gear_train.loads, outside.loads):
        model = build_train(changed(gear_train, damping=slow, loads=loads, meshes=train(SHIPPED).meshes))
        end = train_states(
            model, integrate(model.system, [0.0, 0.05, 0.06], method="taylor", tolerance=1e-9, start=model.start)
        )
        turned.append(end.q[-1, : gear_train.housing.size])  # type: ignore[union-attr]
    push = np.zeros(gear_train.housing.size)  # type: ignore[union-attr]
    push[6 * 4 + 4] = -TORQUE
    response = build_train(changed(gear_train, loads=gear_train.loads)).modal
    T, eigenvalues = response.T, response.eigenvalues
    direction = T[: len(push)].T @ push
    assert turned[0] - turned[1] == pytest.approx((T @ (direction / eigenvalues))[: len(push)], rel=1e-5, abs=1e-12)


def test_instability_ends_with_a_status() -> None:
    gear_train = train([(20, 30)], stiffness=lambda z: curve(z, 1e8, 0.6))
    frequency = build_train(gear_train).coupled_frequencies_hz[-1]
    fast = changed(gear_train, drive=Drive("s0", "s0+", constant(2 * frequency * 2 * math.pi / 20)))
    times = uniform(0.05, 1001)
    with pytest.raises(IntegrationError, match=r"of 0.05 s: diverged") as raised:
        simulate(build_train(fast), times)
    response = simulate(build_train(fast), times, raise_on_failure=False)
    assert raised.value.result.status == response.status == "diverged"
    assert 0.0 < response.time_reached < 0.05
    assert len(response.time) == len(response.contact_force) < 1001
    assert np.isfinite(response.contact_force).all()
    text = " ".join((*response.warnings, *train_stability(build_train(fast)).warnings))
    for piece in ("parametrically unstable", "the run ended at", "more than 0.25 module", "pulls"):
        assert piece in text


def test_a_rigid_housing_loads_no_finite_elements() -> None:
    code = (
        "import sys; from tests.makers.trains import *; from gearfe.drivetrain.train import build_train, simulate;"
        "simulate(build_train(train(SHIPPED)), np.linspace(0, 1e-4, 3));"
        "print([m for m in ('skfem', 'gmsh', 'meshio', 'pyvista', 'matplotlib', 'h5py') if m in sys.modules])"
    )
    made = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert made.stdout.strip() == "[]"


@pytest.mark.slow
def test_reduced_against_full_housing_in_the_coupled_transient() -> None:
    """Same Newmark steps on the whole finite-element model of the reference housing and on its default reduction."""
    from tests.makers.housing_meshes import reference_housing
    from tests.makers.train_full import coupled_transient, low_pass

    housing = reference_housing()
    base, body = train(SHIPPED, stiffness=curve), housing.reduce()
    names = {old: str(i + 1) for i, old in enumerate(base.rigid_bores)}
    shafts = tuple(
        dataclasses.replace(s, point=(float(p[0]), 0.0, float(p[2])), bores=tuple(names[b] for b in s.bores))
        for s, p in zip(base.shafts, body.attachment_points[::2], strict=True)
    )
    gear_train = changed(
        base, shafts=shafts, housing=body, rigid_bores={}, drive=Drive("s0", "1", constant(SPEED)),
        loads=(Load("s2", "5", braking(2)),), damping=Damping(beta=1.6e-6, gyroscopic=False),
    )  # fmt: skip
    model, full, step = build_train(gear_train), full_model(housing), 5e-6
    options = {"beta": 1.6e-6, "step": step, "steps": 1400}
    _, force, acceleration = coupled_transient(model, full.mass, full.stiffness, **options)
    _, less_force, less = coupled_transient(model, body.mass, body.stiffness, **options)
    assert (np.abs(force - less_force).max(axis=0) <= 1e-3 * np.abs(force).max(axis=0)).all()
    one, two = low_pass(acceleration, step, 5000.0), low_pass(less, step, 5000.0)
    assert (np.sqrt(((one - two) ** 2).sum(axis=0) / (one**2).sum(axis=0)) <= 1e-3).all()


def test_periods_of_other_trains() -> None:
    assert train([(17, 34)]).kinematics.common_turns == pytest.approx(1 / 17)
    assert train([(20, 30), (30, 20)]).kinematics.common_turns == pytest.approx(1 / 20)


def test_gears_that_share_a_part_of_their_width_are_a_note():
    """A computed mesh model is that of the whole width; a given constant is what the user wrote."""
    for stiffness, notes in ((curve, 1), (1e8, 0)):
        made = train([(20, 30)], stiffness=stiffness)
        moved = tuple(
            dataclasses.replace(one, along=one.along + 4e-3) if one.name == "g0" else one for one in made.gears
        )
        assert len(build_train(made).mesh_notes) == 0
        found = build_train(dataclasses.replace(made, gears=moved)).mesh_notes
        assert len(found) == notes
        assert all("share 6 of 10 mm of face width" in note for note in found)
