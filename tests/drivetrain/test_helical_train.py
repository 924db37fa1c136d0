"""Helical gears in trains: axial forces and tilting moments on shafts and bearings, by closed forms and by symmetry."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.linalg import eigh

from gearfe.base.errors import InputError
from gearfe.drivetrain.runup.run_up import steady_state
from gearfe.drivetrain.train import GearTrain, TrainModel, build_train, simulate
from gearfe.drivetrain.train.misalignment import misalignments, static_state
from gearfe.drivetrain.train.states import train_states
from gearfe.multibody import constant, integrate
from tests.makers.helical_trains import (
    BETA,
    FIXED,
    FLOATING,
    HIGH,
    LOW,
    helical_chain,
    helical_gear,
    helical_pair,
)
from tests.makers.mesh_laws import hertzian_law
from tests.makers.trains import curve, elastic

TORQUE = 60.0
X, Y, Z = 0, 1, 2


def at_rest(model: TrainModel) -> dict[str, np.ndarray]:
    """Force (N) and moment (N m) of the shafts on the bores under the steady torques, by bore."""
    q = static_state(model)
    assert q is not None
    acting = sum(direction * float(torque(1.0)) for direction, torque in model.torques)
    still = np.zeros((1, len(q)))
    return dict(zip(model.bores, model.bearings(q[None], still, still, acting[None], 0.0)[0], strict=True))


def carried(force: np.ndarray, place: np.ndarray, x: float) -> dict[str, np.ndarray]:
    """Forces on the high and the low bearing of a shaft along y at x, by statics, under a force at a place.

    The high bearing takes all of the axial force; about the middle of the low one, moments about x and z balance.
    """
    span = HIGH - LOW
    moment = np.cross(place - np.array([x, LOW, 0.0]), force)
    high = np.array([-moment[Z] / span, force[Y], moment[X] / span])
    return {"high": high, "low": force - high}


@pytest.mark.parametrize("hand", ["right", "left"])
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_bearings_carry_axial_force_and_tilting_moment(hand: str, sense: float) -> None:
    """F_a = F_t tan(beta) on the reference circle, on a driver towards the thumb of the hand whose fingers turn so."""
    train = helical_pair(hand, sense)
    model = build_train(train)
    found = at_rest(model)
    driver, driven = (gear.gear for gear in train.gears)
    tangential = TORQUE / driven.reference_radius
    thrust = sense * (1.0 if hand == "right" else -1.0) * tangential * math.tan(BETA)
    alpha = driver.transverse_pressure_angle
    # the driver at x = 0 pushes the driven gear, to its +x, towards -z where it turns about +y
    on_driven = np.array([tangential * math.tan(alpha), -thrust, -sense * tangential])
    place = np.array([driver.reference_radius, 0.01, 0.0])
    for name, x, force in (
        ("s0", 0.0, -on_driven),
        ("s1", driver.reference_radius + driven.reference_radius, on_driven),
    ):
        for end, expected in carried(force, place, x).items():
            np.testing.assert_allclose(found[f"{name} {end}"][:3], expected, rtol=1e-6, atol=1e-6 * tangential)
            np.testing.assert_allclose(found[f"{name} {end}"][3:], 0.0, atol=1e-9)
    assert model.kinematics.steady_forces[0] == pytest.approx(TORQUE / driven.base_radius, rel=1e-12)


def test_hinges_share_the_axial_force() -> None:
    train = helical_pair(on_bearings=False)
    found = at_rest(build_train(train))
    thrust = TORQUE / train.gears[1].gear.reference_radius * math.tan(BETA)
    for end in ("high", "low"):
        assert found[f"s0 {end}"][Y] == pytest.approx(0.5 * thrust, rel=1e-9)
        assert found[f"s1 {end}"][Y] == pytest.approx(-0.5 * thrust, rel=1e-9)


@pytest.mark.parametrize("stiffness", [2e8, None, curve(20, mean=2e8, swing=0.0)])
def test_the_transient_has_the_forces_of_statics(stiffness: object) -> None:
    """A constant, a rigid mesh, a curve: after the start, without anything that varies, in steady running."""
    train = helical_pair(stiffness=stiffness, torque=TORQUE)
    train = dataclasses.replace(train, damping=dataclasses.replace(train.damping, ratio=0.3))
    model = build_train(train)
    run = simulate(model, np.array([0.0, 0.02]), tolerance=1e-9)
    expected = at_rest(model)
    for number, bore in enumerate(model.bores):
        np.testing.assert_allclose(run.bearing_load[-1, number, :3], expected[bore][:3], rtol=1e-4, atol=0.1)


def test_an_idler_gear_has_no_axial_force() -> None:
    """What one mesh pushes along the axis the other pushes back; its bearings carry the tilting moment of both."""
    train = helical_chain(BETA, idler=True)
    found = at_rest(build_train(train))
    gears = {gear.name: gear.gear for gear in train.gears}
    thrust = TORQUE / gears["d"].reference_radius * math.tan(BETA)
    assert found["s1 high"][Y] == pytest.approx(0.0, abs=1e-8 * thrust)
    assert found["s0 high"][Y] == pytest.approx(thrust, rel=1e-9)
    assert found["s2 high"][Y] == pytest.approx(-thrust, rel=1e-9)
    # moment about z: the axial forces at -r and at +r of the idler add up
    couple = 2.0 * gears["b"].reference_radius * thrust
    radial = TORQUE / gears["d"].reference_radius * math.tan(gears["b"].transverse_pressure_angle)
    high, low = found["s1 high"], found["s1 low"]
    assert high[X] + low[X] == pytest.approx(0.0, abs=1e-8 * radial)
    assert abs(high[X]) == pytest.approx(couple / (HIGH - LOW), rel=1e-9)


def test_two_gears_of_a_shaft_whose_axial_forces_cancel() -> None:
    """Both of one hand, with tan(beta)/r alike: the thrusts of the driven and of the driving gear are equal."""
    first = helical_gear(30, "left")
    beta = BETA
    for _ in range(60):  # tan(beta) = kappa r, and r grows with beta
        beta = math.atan(first.twist_rate * -1.0 * helical_gear(24, "left", beta).reference_radius)
    found = at_rest(build_train(helical_chain(beta)))
    thrust = abs(found["s0 high"][Y])
    assert thrust > 100.0
    assert found["s1 high"][Y] == pytest.approx(0.0, abs=1e-9 * thrust)
    uneven = at_rest(build_train(helical_chain(BETA)))
    assert abs(uneven["s1 high"][Y]) > 0.1 * thrust


def mirrored(train: GearTrain) -> GearTrain:
    """The same train seen in a mirror across the axes: ends of the shafts and hands change places, rotations do not."""
    opposite = {"right": "left", "left": "right"}
    gears = tuple(
        dataclasses.replace(
            gear, along=-gear.along, gear=helical_gear(gear.gear.teeth, opposite[gear.gear.hand], gear.gear.helix_angle)
        )
        for gear in train.gears
    )
    places = {name: (x, -y, z) for name, (x, y, z) in train.rigid_bores.items()}
    return dataclasses.replace(train, gears=gears, rigid_bores=places)


def test_the_exchange_of_hands_mirrors_the_motion() -> None:
    shape = curve(20, mean=2e8, swing=0.2)
    train = helical_pair(stiffness=shape, backlash=30e-6, speed=1500.0)
    times = np.linspace(0.0, 2e-3, 41)
    one, two = (simulate(build_train(t), times, tolerance=1e-10) for t in (train, mirrored(train)))
    assert one.bearing_load is not None
    assert two.bearing_load is not None
    signs = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])  # of forces, and of moments, which are no arrows
    largest = np.abs(one.bearing_load).max()
    assert np.abs(one.bearing_load[..., Y]).max() > 0.05 * largest
    np.testing.assert_allclose(two.bearing_load, one.bearing_load * signs, rtol=0.0, atol=1e-9 * largest)
    np.testing.assert_allclose(two.contact_force, one.contact_force, rtol=1e-9)
    np.testing.assert_allclose(two.transmission_error, one.transmission_error, rtol=1e-9, atol=1e-15)


def test_a_run_up_has_the_axial_force_of_the_mesh_force() -> None:
    """Harmonic balance against the transient, each bearing's force along the axis."""
    shape = curve(20, mean=2e8, swing=0.2)
    train = helical_pair(stiffness=shape, speed=900.0, damping=3000.0)
    train = dataclasses.replace(train, damping=dataclasses.replace(train.damping, ratio=0.05))
    model = build_train(train)
    state = steady_state(model, 900.0, tolerance=1e-7)
    period = 2.0 * math.pi / 20.0 / 900.0
    theta = state.lattice.theta[:, 0]
    run = simulate(model, np.concatenate([[0.0], (200 + theta / (2.0 * math.pi)) * period]), tolerance=1e-9)
    np.testing.assert_allclose(run.contact_force[1:, 0], state.force[:, 0], rtol=2e-4)
    assert run.bearing_load is not None
    axial = run.bearing_load[1:, :2, Y].sum(axis=1)
    thrust = TORQUE / train.gears[1].gear.reference_radius * math.tan(BETA)
    assert axial.mean() == pytest.approx(thrust, rel=1e-3)
    assert np.ptp(axial) > 0.01 * thrust  # the axial vibration of the shaft


def by_hand(train: GearTrain, mesh: float) -> tuple[np.ndarray, np.ndarray]:
    """Mass and stiffness of both shafts on their bearings from vectors in space, 12 coordinates, x y z and turns."""
    model = build_train(train)
    M, K, normal = np.zeros((12, 12)), np.zeros((12, 12)), np.zeros(12)
    gears = [gear.gear for gear in train.gears]
    alpha, axial = gears[0].transverse_pressure_angle, math.tan(gears[0].base_helix_angle)
    n = np.array([math.sin(alpha), -axial, -math.cos(alpha)])  # right-handed driver that turns about +y
    place = np.array([gears[0].reference_radius, 0.01, 0.0])
    for number, (body, item) in enumerate(zip(model.shafts, train.shafts, strict=True)):
        at, centre = slice(6 * number, 6 * number + 6), body.rotor.centre
        inertia = [body.rotor.transverse, body.rotor.polar, body.rotor.transverse]
        M[at, at] = np.diag([body.rotor.mass] * 3 + inertia)
        normal[at] = (1.0 - 2.0 * number) * np.concatenate([n, np.cross(place - centre, n)])
        for y, springs in ((HIGH, FIXED), (LOW, FLOATING)):
            arm = np.array([item.point[0], y, 0.0]) - centre
            for direction, k in zip(np.eye(3), springs[:3], strict=True):
                row = np.concatenate([direction, np.cross(arm, direction)])
                K[at, at] += k * np.outer(row, row)
    return M, K + mesh * np.outer(normal, normal)


def test_natural_frequencies_against_an_assembly_by_hand() -> None:
    """Rotation of the driver is prescribed, so its turn about y is held."""
    train = helical_pair()
    M, K = by_hand(train, 2e8)
    free = [i for i in range(12) if i != 4]
    squares = eigh(K[np.ix_(free, free)], M[np.ix_(free, free)], eigvals_only=True)
    found = build_train(train).coupled_frequencies_hz
    np.testing.assert_allclose(np.sort(found), np.sqrt(squares) / (2.0 * math.pi), rtol=1e-7)
    spur = np.sqrt(eigh(*by_hand(helical_pair(beta=0.0), 2e8)[::-1], eigvals_only=True)[1:])
    assert np.abs(spur[:11] / np.sqrt(squares) - 1.0).max() > 1e-3  # the helix couples axial motion and rotation


def test_energy_of_a_helical_mesh_is_that_of_its_work() -> None:
    """Kinetic and elastic energy against the work of drive and load, without damping, in a hanging transient."""
    train = helical_pair(backlash=20e-6, speed=400.0)
    train = dataclasses.replace(
        train, bearings=tuple(dataclasses.replace(b, damping=(0.0,) * 5) for b in train.bearings),
        damping=dataclasses.replace(train.damping, gyroscopic=False),
    )  # fmt: skip
    model = build_train(train)
    times = np.linspace(0.0, 4e-3, 20001)
    moved = train_states(model, integrate(model.system, times, method="taylor", tolerance=1e-11, start=model.start))
    assert (moved.contact_force[:, 0] == 0.0).any()
    bent = np.maximum(moved.approach[:, 0], 0.0) + np.minimum(moved.approach[:, 0] + 20e-6, 0.0)
    stiffness = model.system.stiffness - 2e8 * np.outer(model.meshes[0].row, model.meshes[0].row)
    elastic_energy = 0.5 * np.einsum("ti,ij,tj->t", moved.q, stiffness, moved.q) + 0.5 * 2e8 * bent**2
    kinetic = 0.5 * np.einsum("ti,ij,tj->t", moved.v, model.system.mass, moved.v)
    torque = sum(direction[:, None] * f(times) for direction, f in model.torques)
    power = np.einsum("it,ti->t", torque, moved.v)
    work = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(times))])
    total = kinetic + elastic_energy - work
    assert np.ptp(total) < 1e-5 * (kinetic + elastic_energy).max()


def test_a_spur_mesh_has_no_axial_part() -> None:
    line = build_train(helical_pair(beta=0.0)).meshes[0]
    assert line.axial == 0.0


def test_axial_motion_is_part_of_the_transmission_error() -> None:
    """A soft axial bearing: the driver moves along its axis by F_a/k, the flanks close by tan(beta_b) times that."""
    train = helical_pair(along=0.0)
    model = build_train(train)
    (mesh,) = misalignments(model)
    q = static_state(model)
    assert q is not None
    approach, spring = float(q @ model.meshes[0].row), model.kinematics.steady_forces[0] / 2e8
    assert approach == pytest.approx(spring, rel=1e-9)
    thrust = TORQUE / train.gears[1].gear.reference_radius * math.tan(BETA)
    axial = math.tan(train.gears[0].gear.base_helix_angle) * 2.0 * thrust / FIXED[1]
    held = tuple(
        dataclasses.replace(one, stiffness=(one.stiffness[0], 1e4 * one.stiffness[1], *one.stiffness[2:]))
        for one in train.bearings
    )
    stiff = dataclasses.replace(train, bearings=held)
    (other,) = misalignments(build_train(stiff))
    assert mesh.apart - other.apart == pytest.approx(axial, rel=2e-4)


def test_a_mesh_law_of_helical_gears_is_refused() -> None:
    with pytest.raises(InputError, match=r"helix_angle.*a mesh law takes spur gears only"):
        build_train(helical_pair(stiffness=hertzian_law()))


def test_an_elastic_housing_feels_the_axial_force() -> None:
    """The bores of a frame move along the axis in the sense of the thrust."""
    train = elastic(dataclasses.replace(helical_pair(), bearings=()))
    model = build_train(train)
    found = at_rest(model)
    thrust = TORQUE / train.gears[1].gear.reference_radius * math.tan(BETA)
    assert found["s0 high"][Y] + found["s0 low"][Y] == pytest.approx(thrust, rel=1e-6)
    q = static_state(model)
    assert q is not None
    moved = dict(zip(model.bores, model.axial @ q, strict=True))
    assert moved["s0 high"] > 0.0 > moved["s1 high"]


def floating(train: GearTrain, *shafts: str) -> GearTrain:
    """The train with bearings of these shafts that hold them nowhere along the axis."""
    bearings = tuple(
        dataclasses.replace(one, stiffness=FLOATING) if one.bore.split()[0] in shafts else one for one in train.bearings
    )
    return dataclasses.replace(train, bearings=bearings)


@pytest.mark.parametrize("shaft", ["s0", "s1"])
def test_a_shaft_that_nothing_holds_along_its_axis(shaft: str) -> None:
    with pytest.raises(InputError, match=rf"shaft '{shaft}' bearings.*held by nothing along its axis"):
        build_train(floating(helical_pair(), shaft))
    build_train(floating(helical_pair(beta=0.0), shaft))  # spur gears do not push it


def by_torque(train: GearTrain, torque: float = 40.0) -> GearTrain:
    """The train with a torque that drives it, which falls with the speed."""
    return dataclasses.replace(train, drive=dataclasses.replace(train.drive, torque=constant(torque), slope=0.1))


@pytest.mark.parametrize("shaft", ["s0", "s1"])
def test_a_shaft_that_nothing_holds_while_a_torque_drives(shaft: str) -> None:
    """Rolling is free there, too, and accelerates; the push along the axis is no part of it."""
    for torque in (40.0, 55.0):
        with pytest.raises(InputError, match=rf"shaft '{shaft}' bearings.*held by nothing along its axis"):
            build_train(by_torque(floating(helical_pair(), shaft), torque))
    build_train(by_torque(floating(helical_pair(beta=0.0), shaft)))
    build_train(by_torque(helical_pair()))
    with pytest.raises(InputError, match="held by nothing along its axis"):
        build_train(by_torque(floating(helical_pair(stiffness=None), shaft)))  # a rigid mesh


@pytest.mark.parametrize("drives", ["speed", "torque"])
def test_a_shaft_that_nothing_holds_against_tilting(drives: str) -> None:
    """One bearing without a stiffness against tilting, the gear beside it."""
    for beta in (0.0, BETA):
        train = helical_pair(beta=beta)
        shafts = (train.shafts[0], dataclasses.replace(train.shafts[1], bores=("s1 high",)))
        bearings = tuple(one for one in train.bearings if one.bore != "s1 low")
        places = {name: place for name, place in train.rigid_bores.items() if name != "s1 low"}
        train = dataclasses.replace(train, shafts=shafts, bearings=bearings, rigid_bores=places)
        with pytest.raises(InputError, match=r"shaft 's1' bearings.*held by nothing against tilting"):
            build_train(train if drives == "speed" else by_torque(train))
        stiff = tuple(
            dataclasses.replace(one, stiffness=(*FIXED[:3], 1e4, 1e4)) if one.bore == "s1 high" else one
            for one in bearings
        )
        build_train(dataclasses.replace(train, bearings=stiff))


def test_a_floating_shaft_between_two_meshes() -> None:
    """Thrusts that cancel, of an idler, leave it in place; others screw it away."""
    build_train(floating(helical_chain(BETA, idler=True), "s1"))
    with pytest.raises(InputError, match="shaft 's1' bearings"):
        build_train(floating(helical_chain(math.radians(25.0)), "s1"))
