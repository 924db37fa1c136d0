"""Planetary stages in trains: published frequencies, kinds of modes, load sharing, balance of energy."""

from __future__ import annotations

import dataclasses
import math
from fractions import Fraction

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.drivetrain.modes.orders import train_orders
from gearfe.drivetrain.modes.whirl import WhirlModes, train_modes
from gearfe.drivetrain.runup.condensed import condense
from gearfe.drivetrain.runup.report import far_shafts, warnings
from gearfe.drivetrain.runup.run_up import run_up, steady_state
from gearfe.drivetrain.train import (
    Damping,
    Drive,
    GearMesh,
    GearTrain,
    Guide,
    TrainResponse,
    build_train,
    simulate,
)
from gearfe.drivetrain.train.misalignment import static_state
from gearfe.drivetrain.train.planetary import mesh_families
from gearfe.drivetrain.train.states import train_states
from gearfe.fem.beams import Section
from gearfe.multibody import constant, integrate, smoothed_step
from tests.makers.planetary import ALONG, ALPHA, LIN_PARKER, MODULE, SPEED, TILT, TORQUE, gear, stage
from tests.makers.trains import curve

#: Lin & Parker (1999), three planets: frequencies (Hz) and kinds; translational ones are double, six pairs of them.
PUBLISHED = [
    (743.2, "translational"), (1102.4, "translational"), (1475.7, "rotational"), (1896.0, "translational"),
    (1930.3, "rotational"), (2276.4, "translational"), (2658.3, "rotational"), (6986.3, "translational"),
    (7462.8, "rotational"), (9647.9, "translational"), (11775.3, "rotational"),
]  # fmt: skip


#: Teeth of sun and planets with which so many planets have room and fit.
TEETH = {3: (30, 36), 4: (30, 36), 5: (30, 25), 6: (36, 24)}


def modes_of(count: int, angles: list[float] | None = None) -> WhirlModes:
    drive = Drive("sun", "sun", constant(SPEED), torque=constant(TORQUE))
    return train_modes(build_train(stage(count, TEETH[count], angles=angles, drive=drive)), [0.0], 2e4)


def test_the_frequencies_of_lin_and_parker_to_every_printed_digit() -> None:
    found = modes_of(3)
    printed = [pair for pair in PUBLISHED for _ in range(2 if pair[1] == "translational" else 1)]
    assert found.free == 1  # the published 0 Hz
    assert [f"{f:.1f}" for f in found.frequency[0]] == [f"{f:.1f}" for f, _ in printed]
    assert [label.split(",")[0] for label in found.labels[0]] == [f"{kind} mode of carrier arm" for _, kind in printed]
    pairs = [i for i, (_, kind) in enumerate(printed) if kind == "translational"]
    np.testing.assert_allclose(found.frequency[0][pairs[::2]], found.frequency[0][pairs[1::2]], rtol=1e-10)


@pytest.mark.parametrize("count", [4, 5, 6])
def test_kinds_and_degeneracies_for_more_planets(count: int) -> None:
    """6 rotational modes with the free one, 6 pairs of translational ones, 3 planet modes of multiplicity N - 3."""
    found = modes_of(count)
    kinds = [label.split()[0] for label in found.labels[0]]
    assert (kinds.count("rotational"), kinds.count("translational")) == (5, 12)
    assert kinds.count("planet") == 3 * (count - 3)
    planet = found.frequency[0][[i for i, kind in enumerate(kinds) if kind == "planet"]].reshape(3, -1)
    np.testing.assert_allclose(planet, planet[:, :1] * np.ones(count - 3), rtol=1e-9)


def test_planets_at_unequal_distances_have_mixed_modes() -> None:
    """96 + ... : angles at multiples of 360/(z_s + z_r) deg, not opposite to each other."""
    pitch = 2.0 * math.pi / (30 + 102)
    labels = modes_of(3, [0.0, 40 * pitch, 90 * pitch]).labels[0]
    assert any(label.startswith("mixed") for label in labels)


@pytest.mark.parametrize("count", [3, 5])
def test_a_purely_torsional_stage_has_the_closed_form_of_kahraman(count: int) -> None:
    """J. Sound Vib. 173 (1994) 125, ring fixed."""
    k = 5e8
    teeth = (30, 36) if count == 3 else (30, 35)
    train = stage(count, teeth, mesh=k, pin=None, bearing=None, ring=None)
    train = dataclasses.replace(train, drive=Drive("sun", "sun", constant(SPEED), torque=constant(TORQUE)))
    found = build_train(train).coupled_frequencies_hz
    ms, mp = LIN_PARKER["sun"][1], LIN_PARKER["planet"][1]
    mc = (LIN_PARKER["carrier"][1] + count * LIN_PARKER["planet"][0]) / math.cos(ALPHA) ** 2
    L1 = mp * mc * ms
    L2 = -(count * k * mp * mc + 2 * k * mc * ms + count * 2 * k * mp * ms)
    L3 = count * k * k * (count * mp + mc + 4 * ms)
    root = math.sqrt(L2**2 - 4 * L1 * L3)
    squares = sorted([0.0, *[2 * k / mp] * (count - 1), (-L2 - root) / (2 * L1), (-L2 + root) / (2 * L1)])
    np.testing.assert_allclose(found, np.sqrt(squares) / (2 * math.pi), rtol=1e-9, atol=1e-3)


def run(train: object, end: float = 4e-3, tolerance: float = 1e-10) -> TrainResponse:
    return simulate(build_train(train), np.linspace(0.0, end, 161), tolerance=tolerance, method="taylor")  # type: ignore[arg-type]


def test_three_ideal_planets_share_alike_and_their_forces_balance() -> None:
    """In a transient with stiffness that varies: shares to 1e-9; the sun's meshes make the torque of its drive."""
    swinging = stage(mesh=_rigid_curve, damping=Damping(ratio=0.03))
    response = run(swinging)
    force = response.contact_force
    scale = np.abs(force).max()
    for kind in (force[:, :3], force[:, 3:]):
        assert np.ptp(kind) > 0.1 * scale
        np.testing.assert_allclose(kind - kind.mean(axis=1, keepdims=True), 0.0, atol=1e-9 * scale)
    arm = 0.5 * MODULE * 30 * math.cos(ALPHA)
    np.testing.assert_allclose(response.drive_torque, arm * force[:, :3].sum(axis=1), atol=1e-9 * arm * scale)
    np.testing.assert_allclose(response.bearing_load[..., :3], 0.0, atol=1e-8 * scale)


def _rigid_curve(teeth: int) -> object:
    """The curve of the makers over one pitch of gears of this module; its phase does not depend on the module."""
    return curve(teeth, mean=5e8, swing=0.15)


def test_energy_is_that_of_drive_and_load() -> None:
    """Hinges and springs without damping under a torque that sets in: work is the rise of the energy, to 1e-9."""
    torque = -TORQUE * 4.4
    load = stage().loads[0]
    train = stage(pin=None, bearing=None, ring=None)
    train = dataclasses.replace(train, loads=(dataclasses.replace(load, torque=smoothed_step(1e-3, 2e-3, torque)),))
    model = build_train(train)
    t = np.linspace(0.0, 4e-3, 6401)
    response = simulate(model, t, tolerance=1e-11, method="taylor")
    radius = {"sun": 15 * MODULE * math.cos(ALPHA), "planet": 18 * MODULE * math.cos(ALPHA), "carrier": 33 * MODULE}
    inertia = {name: LIN_PARKER[name][1] * r**2 for name, r in radius.items()}
    inertia["carrier"] += 3 * LIN_PARKER["planet"][0] * radius["carrier"] ** 2
    speed = dict(zip(response.shaft_names, response.speed_absolute.T, strict=True))
    kinetic = 0.5 * (inertia["sun"] * speed["sun"] ** 2 + inertia["carrier"] * speed["carrier"] ** 2)
    kinetic += 0.5 * inertia["planet"] * sum(speed[f"planet{k}"] ** 2 for k in range(3))
    energy = kinetic + 0.5 * (response.contact_force**2).sum(axis=1) / 5e8
    power = response.drive_torque * speed["sun"] + smoothed_step(1e-3, 2e-3, torque)(t) * speed["carrier"]
    h = t[1] - t[0]
    work = h / 3.0 * (power[0:-2:2] + 4 * power[1:-1:2] + power[2::2]).cumsum()
    assert np.abs(power).max() > 10.0
    np.testing.assert_allclose(
        energy[2::2] - energy[0], work, atol=1e-9 * np.abs(power).max() * t[-1] + 1e-9 * energy[0]
    )


def test_a_pin_out_of_place_takes_its_share_by_the_stiffness_of_the_planets() -> None:
    """Two meshes of k and a pin of k_p in a row: F_1 - F_2 = k cos(a) e / (1 + 2 k cos^2(a)/k_p)."""
    k, pin, error = 5e8, 1e8, 5e-6
    slow = Drive("sun", "sun", constant(1e-3))  # no centrifugal forces
    model = build_train(stage(mesh=k, pin=pin, bearing=None, ring=None, errors=[error, 0.0, 0.0], drive=slow))
    q = static_state(model)
    assert q is not None
    force = np.array([k * line.row @ q for line in model.meshes])
    c = math.cos(ALPHA)
    apart = k * c * error / (1.0 + 2.0 * k * c**2 / pin)
    np.testing.assert_allclose(np.abs(force[[0, 3]] - force[[1, 4]]), apart, rtol=1e-9)
    np.testing.assert_allclose(force[:3].sum(), 3 * model.kinematics.steady_forces[0], rtol=1e-9)


def test_a_sun_that_moves_shares_the_load_alike_in_spite_of_a_pin_out_of_place() -> None:
    """With three planets a sun without stiffness across the axis finds the place where their forces are equal."""
    given = stage(bearing=1e9, errors=[2e-5, 0.0, 0.0])
    spreads = []
    for stiffness in (1e9, 1e4):
        sun = dataclasses.replace(given.bearings[0], stiffness=(stiffness, ALONG, stiffness, TILT, TILT))
        model = build_train(dataclasses.replace(given, bearings=(sun, *given.bearings[1:])))
        q = static_state(model)
        assert q is not None
        force = np.array([5e8 * line.row @ q for line in model.meshes])[:3]
        spreads.append(float(np.ptp(force) / force.mean()))
    assert spreads[0] > 1.0
    assert spreads[1] < 1e-2


@pytest.mark.parametrize("bearing", [1e8, None])
def test_bearing_forces_stand_still_in_axes_that_do(bearing: float | None) -> None:
    """A pin out of place pushes the ring: in the housing this force goes round once a turn of the carrier."""
    train = stage(errors=[2e-5, 0.0, 0.0], damping=Damping(ratio=0.3), bearing=bearing)
    model = build_train(train)
    turn = 2.0 * math.pi / (SPEED * float(model.kinematics.ratios[2]))
    response = simulate(model, np.linspace(0.0, 1.25 * turn, 501), tolerance=1e-8, method="taylor")
    ring = response.bearing_load[:, response.attachment_names.index("ring"), [0, 2]]  # x, z = e1, -e2
    late = ring[100:, 0] - 1j * ring[100:, 1]
    angle = np.unwrap(np.angle(late))
    assert np.ptp(np.abs(late)) < 1e-3 * np.abs(late).mean()
    np.testing.assert_allclose(np.ptp(angle), 2.0 * math.pi, rtol=1e-3)


def test_sidebands_at_the_ring_are_of_orders_that_the_number_of_planets_divides() -> None:
    """McFadden & Smith (1985): equal planets make only orders N k of the carrier at a point that stands still.

    Ring 101, three planets: the mesh has the order 101 in the frame of the carrier, the bearing of the ring 102.
    """
    drive = Drive("sun", "sun", constant(1500.0))
    train = stage(3, (31, 35), mesh=_rigid_curve, damping=Damping(ratio=0.3), drive=drive)
    model = build_train(train)
    turn = 2.0 * math.pi / (1500.0 * float(model.kinematics.ratios[2]))
    time = turn * np.concatenate([[0.0], 1.0 + np.arange(1024) / 1024.0])
    response = simulate(model, time, tolerance=1e-9, method="taylor")
    force = response.bearing_load[1:, response.attachment_names.index("ring"), 0]
    lines = np.abs(np.fft.rfft(force)) / 512.0
    assert lines[102] > 0.1
    others = np.delete(lines[:150], range(0, 150, 3))
    assert others.max() < 1e-6 * lines[102]


@pytest.mark.parametrize("damping", [Damping(ratio=0.2), Damping(alpha=1500.0, beta=3e-5)])
def test_a_steady_state_of_the_run_up_is_what_the_transient_comes_to(damping: Damping) -> None:
    """With planets out of phase and one pin out of place: translational modes swing, Coriolis forces act.

    The centrifugal forces of the planets are m W^2/k = 0.1 % of the stiffness of a pin: it yields by 0.1 mm. Dampers
    in fixed axes pull the displaced sun, ring and carrier backwards, so that bearings have forces across.
    """
    train = stage(3, (31, 35), mesh=_rigid_curve, errors=[5e-6, 0.0, 0.0], damping=damping)
    speed = math.sqrt(1e-3 * 1e8 / LIN_PARKER["planet"][0]) * (31 + 101) / 31
    model = build_train(dataclasses.replace(train, drive=Drive("sun", "sun", constant(speed))))
    state = steady_state(model, speed, tolerance=1e-5)
    response = simulate(model, np.arange(200 * 64 + 1) * state.period / 64, tolerance=1e-9, method="taylor")
    force, size = response.contact_force[-65:-1], float(np.abs(state.force).max())
    np.testing.assert_allclose(state.force.mean(axis=0), force.mean(axis=0), atol=1e-4 * size)
    np.testing.assert_allclose(state.force.min(axis=0), force.min(axis=0), atol=1e-3 * size)
    np.testing.assert_allclose(state.force.max(axis=0), force.max(axis=0), atol=1e-3 * size)
    load = response.bearing_load[-65:-1, :, :3]  # in fixed axes
    turned = model.fixed_axes(
        response.time[-65:-1], np.broadcast_to(state.bearing[0].real.reshape(1, 3, 2, 3), (64, 3, 2, 3))
    )
    np.testing.assert_allclose(turned[:, :, 0].mean(axis=0), load.mean(axis=0), atol=1e-3 * np.abs(load).max())


@pytest.mark.parametrize("pin", [1e8, 3e7])
def test_planets_move_outwards_by_their_centrifugal_force_over_the_stiffness_of_the_pin(pin: float) -> None:
    """k u = m W^2 (r + u) without meshes, in a steady state and in the static one; m r W^2/k in first order."""
    speed, mass, arm = 3000.0, LIN_PARKER["planet"][0], 33 * MODULE
    train = stage(mesh=1e3, pin=pin, loads=(), drive=Drive("sun", "sun", constant(speed)))
    model = build_train(train)
    push = mass * (speed * float(model.kinematics.ratios[2])) ** 2
    linear = condense(model).system.linear
    steady = model.modal.T @ linear.modal(np.zeros(1), speed, np.zeros((1, linear.size), dtype=complex))[0].real
    static = static_state(model)
    assert static is not None
    for q in (steady, static):
        for planet, angle in zip((3, 4, 5), (0.0, 2.0 * math.pi / 3.0, 4.0 * math.pi / 3.0), strict=True):
            moved = q[model.first[planet] : model.first[planet] + 3]
            outwards = moved @ np.array([math.cos(angle), 0.0, -math.sin(angle)])
            assert outwards == pytest.approx(push * arm / (pin - push), rel=1e-4)  # the meshes have 1e-5 of it
            assert outwards == pytest.approx(push * arm / pin, rel=2.0 * push / pin)


def test_a_run_up_names_shafts_that_move_by_more_than_a_quarter_of_a_module() -> None:
    """The first planet, at angle 0, moves by m W^2 r/(k - m W^2) along x alone: 0.24 and 0.26 modules."""
    mass, arm, pin = LIN_PARKER["planet"][0], 33 * MODULE, 1e8
    train = stage(mesh=1e3, pin=pin, loads=())
    ratio = abs(float(build_train(train).kinematics.ratios[2]))

    def speed(modules: float) -> float:
        push = pin * modules * MODULE / (arm + modules * MODULE)
        return math.sqrt(push / mass) / ratio

    speeds = [speed(0.24), speed(0.26)]
    model = build_train(dataclasses.replace(train, drive=Drive("sun", "sun", constant(speeds[0]))))
    run = run_up(model, speeds, stability=False)
    moved = [state.displacement[3] / MODULE for state in run.states]
    np.testing.assert_allclose(moved, [0.24, 0.26], rtol=1e-3)
    said = [sentence for sentence in far_shafts(run) if sentence.startswith(f"shaft {train.shafts[3].name} moves")]
    assert len(said) == 1
    assert f"at 1 of 2 states, the first at {speeds[1]:.6g} rad/s" in said[0]
    assert said[0] in warnings(run)


@pytest.mark.parametrize("gyroscopic", [True, False])
def test_coriolis_forces_split_translational_modes_by_the_speed_of_the_carrier(gyroscopic: bool) -> None:
    """A free rotor on a spring seen from a frame that turns: its frequencies are w0 - W and w0 + W.

    They act without gyroscopic moments, too.
    """
    train = stage(mesh=1.0, bearing=1e8, loads=(), damping=Damping(gyroscopic=gyroscopic))
    model = build_train(train)
    speed = 300.0
    found = train_modes(model, [speed], 4000.0)
    turning = speed * float(model.kinematics.ratios[2])
    rest = math.sqrt(1e8 / LIN_PARKER["ring"][0])
    for sign in (-1.0, 1.0):
        expected = (rest + sign * turning) / (2.0 * math.pi)
        assert np.abs(found.frequency[0] - expected).min() < 1e-6 * expected


#: A bearing whose damper couples displacements with tilts, alike in all directions across the axis.
COUPLED = np.diag([900.0, 0.0, 900.0, 0.7, 0.7])
COUPLED[[0, 4, 2, 3], [4, 0, 3, 2]] = [20.0, 20.0, -20.0, -20.0]
DAMPERS = {
    "bearings": ({"damping": (900.0, 0.0, 900.0, 0.7, 0.7)}, Damping()),
    "coupled": ({"damping": tuple(map(tuple, COUPLED.tolist()))}, Damping()),
    "alpha": ({}, Damping(alpha=300.0)),
    "beta": ({}, Damping(beta=3e-5)),
    "elastic": ({"damping": (900.0, 0.0, 900.0, 0.7, 0.7)}, Damping(alpha=100.0, beta=2e-6)),
}


def sun_alone(case: str, *, carrier_turns: bool) -> GearTrain:
    """A stage whose sun turns with 300 rad/s in dampers, and whose meshes are next to nothing."""
    keys, damping = DAMPERS[case]
    guides = (Guide("ring"),) if carrier_turns else (Guide("carrier"),)
    drive = Drive("sun", "sun", constant(300.0))
    train = stage(3, (31, 35), mesh=1e-6, loads=(), damping=damping, guides=guides, drive=drive)
    sun = dataclasses.replace(train.bearings[0], stiffness=(2e7, 1e9, 2e7, 4e3, 4e3), **keys)
    shafts = train.shafts
    if case == "elastic":
        section = Section(0.03, 0.03, 0.03, 0.0, 0.0, young=2e11, poisson=0.3, density=7800.0)
        changes = {"mass": None, "polar_inertia": None, "transverse_inertia": None}
        made = dataclasses.replace(shafts[0], radius=0.015, sections=(section,), damping_ratio=0.02, **changes)
        shafts = (made, *shafts[1:])
        train = dataclasses.replace(train, rigid_bores={**train.rigid_bores, "sun": (0.0, 0.013, 0.0)})
    return dataclasses.replace(train, shafts=shafts, bearings=(sun, *train.bearings[1:]))


@pytest.mark.parametrize("case", list(DAMPERS))
def test_a_whirl_decays_as_in_axes_that_stand_still(case: str) -> None:
    """Seen from a frame that turns with W, a whirl of the pole p has p - iW or, against it, p + iW."""
    poles, ratio = [], 0.0
    for turns in (False, True):
        model = build_train(sun_alone(case, carrier_turns=turns))
        ratio = float(model.frame_ratios[0])
        found = train_modes(model, [300.0], 3e4)
        chosen = np.flatnonzero(found.share("bending", "sun")[0] > 0.999)
        size, zeta = 2.0 * math.pi * found.frequency[0, chosen], found.damping_ratio[0, chosen]
        poles.append(size * (-zeta + 1j * np.sqrt(1.0 - zeta**2)))
    still, turning = poles
    assert len(still) == len(turning) >= 4
    assert (still.real < -10.0).all()
    expected = [p + sense * 300j * ratio for p in still for sense in (-1.0, 1.0)]
    for pole in turning:
        assert min(abs(pole - p) for p in expected) < 1e-8 * abs(pole)
    np.testing.assert_allclose(np.sort(turning.real), np.sort(still.real), rtol=1e-8)


def test_a_damped_ring_moves_as_in_axes_that_stand_still() -> None:
    """Its motion and the load on its bore in closed form; what its energy loses, it does to the bore."""
    k, c, m = 1e8, 4e3, LIN_PARKER["ring"][0]
    train = stage(3, (31, 35), mesh=1e-6, loads=(), drive=Drive("sun", None, constant(900.0)), guides=(Guide("ring"),))
    ring = dataclasses.replace(train.bearings[1], damping=(c, 0.0, c, 0.0, 0.0))
    model = build_train(dataclasses.replace(train, bearings=(train.bearings[0], ring, train.bearings[2])))
    start = model.start.v.copy()
    start[model.first[1]], start[model.first[1] + 2] = 0.3, -0.2
    begun = dataclasses.replace(model, start=dataclasses.replace(model.start, v=start))
    t = np.linspace(0.0, 0.01, 6401)
    states = train_states(model, integrate(model.system, t, method="taylor", tolerance=1e-12, start=begun.start))
    at = slice(int(model.first[1]), int(model.first[1]) + 3)
    turns, spin = model.frame_turns(t, [1])[:, 0], 900.0 * float(model.frame_ratios[1])
    assert spin * t[-1] > 2.0
    e1, e2, _ = train.frame
    across = spin * (np.outer(e2, e1) - np.outer(e1, e2))
    place = np.einsum("nij,nj->ni", turns, states.q[:, at])
    rate = np.einsum("nij,nj->ni", turns, states.v[:, at] + states.q[:, at] @ across.T)
    decay, swing = c / (2.0 * m), math.sqrt(k / m - (c / (2.0 * m)) ** 2)
    free = np.exp(-decay * t) * np.sin(swing * t) / swing
    moved = free[:, None] * [0.3, 0.0, -0.2]
    np.testing.assert_allclose(place, moved, atol=1e-8 * np.abs(moved).max())
    load = states.bearing[:, 1, :3]
    np.testing.assert_allclose(load, k * place + c * rate, atol=1e-9 * np.abs(load).max())
    power = (load * rate).sum(axis=1)
    work = t[1] / 3.0 * (power[0:-2:2] + 4.0 * power[1:-1:2] + power[2::2]).cumsum()
    energy = 0.5 * m * (rate**2).sum(axis=1)
    np.testing.assert_allclose(energy[2::2] + work, energy[0], rtol=2e-9)


def test_mesh_phases_follow_from_the_places_of_the_planets() -> None:
    """z_s/N = 10 and z_r/N = 34: three planets in phase; harmonics excite rotational modes only."""
    train = stage()
    for family in mesh_families(train.layout, train.kinematics.phases):
        assert family.phases == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)
        assert [kind for kind, value in family.excites(1).items() if value] == ["rotational"]


def test_planets_in_mesh_with_each_other_are_two_sets_though_they_are_alike() -> None:
    """Sun 30, planets 20 and 20, ring 100: those that mesh with the sun, and those that mesh with the ring."""
    train = stage(3, (30, 35))
    beside = math.acos((25.0**2 + 40.0**2 - 20.0**2) / (2.0 * 25.0 * 40.0))
    shafts, gears, meshes, pins = list(train.shafts[:3]), list(train.gears[:2]), [], []
    for k in range(3):
        for kind, arm, angle in (("inner", 25.0, 0.0), ("outer", 40.0, beside)):
            turn, name = 2.0 * math.pi * k / 3.0 + angle, f"{kind}{k}"
            point = (arm * MODULE * math.cos(turn), 0.0, -arm * MODULE * math.sin(turn))
            shafts.append(dataclasses.replace(train.shafts[3], name=name, point=point))
            gears.append(dataclasses.replace(train.gears[2], name=name, shaft=name, gear=gear(20)))
            pins.append(dataclasses.replace(train.carriers[0].pins[0], shaft=name))
        meshes += [GearMesh("sun", f"inner{k}", 5e8), GearMesh(f"inner{k}", f"outer{k}", 5e8)]
        meshes.append(GearMesh(f"outer{k}", "ring", 5e8))
    carrier = dataclasses.replace(train.carriers[0], pins=tuple(pins))
    train = dataclasses.replace(
        train, shafts=tuple(shafts), gears=tuple(gears), meshes=tuple(meshes), carriers=(carrier,)
    )
    sets = [[train.shafts[shaft].name for shaft, _ in row] for row in train.layout.carriers[0].sets]
    assert sets == [["inner0", "inner1", "inner2"], ["outer0", "outer1", "outer2"]]


def test_a_differential_is_guided_at_its_ratio() -> None:
    """w_c = (z_s w_s + z_r w_r)/(z_s + z_r), and the ring turns so in a run."""
    train = stage(guides=(Guide("ring", Fraction(-1, 4)),), damping=Damping(ratio=0.1))
    model = build_train(train)
    expected = Fraction(30 - Fraction(102, 4), 132)
    assert model.kinematics.ratios[2] == expected
    response = run(train, tolerance=1e-8)
    np.testing.assert_allclose(response.speed_absolute[:, 1], -0.25 * SPEED, rtol=1e-9)
    np.testing.assert_allclose(response.speed_absolute[:, 2].mean(), float(expected) * SPEED, rtol=1e-2)


def test_what_a_stage_cannot_be_is_refused() -> None:
    good = stage()
    carrier = good.carriers[0]
    uneven = dataclasses.replace(good.bearings[0], stiffness=(1e8, 1e8, 2e8, 1e8, 1e8))
    on_axis = tuple(
        dataclasses.replace(shaft, point=(0.0, 0.0, 0.0)) if shaft.name == "planet1" else shaft for shaft in good.shafts
    )
    wrong = [
        ({"carriers": (carrier, dataclasses.replace(carrier, name="second", pins=()))}, "has no planets"),
        ({"carriers": (dataclasses.replace(carrier, shaft="arm"),)}, "unknown shaft 'arm'"),
        ({"bearings": (uneven, *good.bearings[1:])}, "differs across the axis"),
        ({"shafts": on_axis}, "lies on the axis"),
        ({"guides": ()}, "turns freely"),
        ({"guides": (Guide("ring"), Guide("carrier"))}, "is fixed, but"),
        ({"guides": (Guide("ring"), Guide("sun"))}, "driven and fixed or guided at once"),
        ({"drive": None}, "no shaft is driven"),
    ]
    for changes, text in wrong:
        with pytest.raises(InputError, match=text):
            build_train(dataclasses.replace(good, **changes))  # type: ignore[arg-type]


def test_planets_that_collide_are_refused() -> None:
    """Six planets of 36 teeth round a sun of 30 overlap: 2 r_c sin(30 deg) < d_a."""
    with pytest.raises(InputError, match=r"'planet0'.*overlaps gear 'planet1'"):
        build_train(stage(6, (30, 36)))


def test_frames_turn_by_nothing_beside_the_mean_motion() -> None:
    """Coriolis forces take the speed of the frame alone: their spin is a direction without any coordinate."""
    model = build_train(stage())
    frames = [gyro.spin for gyro in model.forces.gyros if gyro.euler]
    assert len(frames) == 2 * 6  # translations and tilts of six shafts
    assert not model.directions[:, frames].any()


def test_a_stage_that_a_torque_drives_goes_round_farther_than_its_teeth_yield() -> None:
    """Three times the torque that the load needs: the carrier runs ahead by millimetres of its planets' way."""
    given = stage(ring=None)
    drive = Drive("sun", "sun", constant(SPEED), torque=constant(3.0 * TORQUE), damping=0.0)
    model = build_train(dataclasses.replace(given, drive=drive, damping=Damping(ratio=0.05)))
    response = simulate(model, np.linspace(0.0, 0.1, 51), tolerance=1e-6)
    assert response.status == "done"
    carrier = response.speed[:, response.shaft_names.index("carrier")]
    inertia = {name: LIN_PARKER[name][1] * r**2 for name, r in _radii().items()}
    inertia["carrier"] += 3 * LIN_PARKER["planet"][0] * _radii()["carrier"] ** 2
    ratios = dict(zip(response.shaft_names, model.ratios, strict=True))
    of_sun = (
        inertia["sun"] + inertia["carrier"] * ratios["carrier"] ** 2 + 3 * inertia["planet"] * (ratios["planet0"] ** 2)
    )
    rise = 2.0 * TORQUE / of_sun * 0.1 * ratios["carrier"]
    assert carrier[-1] - carrier[0] == pytest.approx(rise, rel=2e-2)
    assert any("follow the nominal" in warning for warning in response.warnings)


def _radii() -> dict[str, float]:
    """Radii that the inertias of the stage are over, without the ring."""
    return {"sun": 15 * MODULE * math.cos(ALPHA), "planet": 18 * MODULE * math.cos(ALPHA), "carrier": 33 * MODULE}


def test_a_torque_may_act_on_a_planet() -> None:
    given = stage()
    load = dataclasses.replace(given.loads[0], shaft="planet0", bore=None, torque=constant(-1.0))
    model = build_train(dataclasses.replace(given, loads=(*given.loads, load)))
    assert static_state(model) is not None


def test_a_stage_that_turns_as_one_has_modes_and_no_orders_of_its_meshes() -> None:
    given = stage()
    locked = dataclasses.replace(given, guides=(Guide("ring", ratio=Fraction(1)),), loads=())
    model = build_train(locked)
    orders = train_orders(model, 3, 2)
    assert {name for order in orders for name in order.names} == {
        f"{a} x shaft {shaft.name}" for a in (1, 2) for shaft in locked.shafts
    }
