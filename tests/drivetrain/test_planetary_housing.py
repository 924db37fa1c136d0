"""Planetary stages in an elastic housing: bearings between frames that turn and bores that stand still."""

from __future__ import annotations

import dataclasses
import itertools
import math
from fractions import Fraction
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from scipy.linalg import expm

from gearfe.base.errors import InputError
from gearfe.drivetrain.modes.orders import train_orders
from gearfe.drivetrain.modes.report import frozen_carriers
from gearfe.drivetrain.modes.whirl import train_modes
from gearfe.drivetrain.runup.critical import critical_speeds
from gearfe.drivetrain.runup.orders import orders
from gearfe.drivetrain.runup.report import phases
from gearfe.drivetrain.runup.run_up import RunUp, run_up, steady_state
from gearfe.drivetrain.train import Damping, Drive, GearTrain, Guide, TrainResponse, build_train, simulate
from gearfe.drivetrain.train.model import TrainModel
from gearfe.drivetrain.train.states import TrainStates, train_states
from gearfe.multibody import constant, integrate
from tests.drivetrain.test_planetary_roles import built, roles, two_stages
from tests.makers.planetary import stage
from tests.makers.trains import curve, elastic

DAMPED = Damping(beta=2e-6)


def in_housing(train: GearTrain, factor: float = 1.0, beta: float = 2e-6) -> GearTrain:
    """The train in an elastic frame whose mass and stiffness are so many times those of the maker."""
    made = elastic(train, skew=0.3)
    assert made.housing is not None
    body = dataclasses.replace(
        made.housing, mass=factor * made.housing.mass, stiffness=factor * made.housing.stiffness,
        damping=beta * factor * made.housing.stiffness,
    )  # fmt: skip
    return dataclasses.replace(made, housing=body)


def planets(errors: list[float] | None = None, **changes: object) -> GearTrain:
    """A stage on bearings that yield along the axis and against tilts, too, as those of gearboxes do."""
    train = stage(3, (31, 35), mesh=rigid_curve, errors=errors, **changes)
    soft = tuple(dataclasses.replace(b, stiffness=(1e8, 1e8, 1e8, 1e5, 1e5)) for b in train.bearings)
    return dataclasses.replace(train, bearings=soft)


def rigid_curve(teeth: int) -> object:
    return curve(teeth, mean=5e8, swing=0.15)


def states(model: TrainModel, times: np.ndarray, method: str = "taylor") -> TrainStates:
    trajectory = integrate(model.system, times, method=method, tolerance=1e-11, start=model.start)
    return train_states(model, trajectory)


def fixed(model: TrainModel, moved: TrainStates, shaft: int) -> np.ndarray:
    """Displacement of a shaft along x and z in axes that stand still."""
    q = moved.q[:, model.first[shaft] : model.first[shaft] + 3]
    return np.einsum("nij,nj->ni", model.frame_turns(moved.time, [shaft])[:, 0], q)[:, [0, 2]]


@pytest.mark.parametrize("damper", [0.0, 5e3])
def test_a_ring_in_a_housing_moves_as_in_axes_that_stand_still(damper: float) -> None:
    """Meshes and the other bearings next to nothing: ring and housing are linear and constant seen from the ground.

    There an exponential of their matrix has their motion; the train describes the ring in the frame of the carrier.
    """
    train = stage(3, (31, 35), mesh=1e-2, loads=(), drive=Drive("sun", None, constant(900.0)), guides=(Guide("ring"),))
    slight = [dataclasses.replace(b, stiffness=(1e-2,) * 5) for b in train.bearings]
    dampers = damper, 0.0, damper, 1e-4 * damper, 1e-4 * damper
    ring = dataclasses.replace(train.bearings[1], stiffness=(1e8, 1e8, 1e8, 1e5, 1e5), damping=dampers)
    train = in_housing(dataclasses.replace(train, bearings=(slight[0], ring, slight[2])))
    assert train.housing is not None
    train = dataclasses.replace(train, housing=dataclasses.replace(train.housing, damping=0.0 * train.housing.damping))
    model = build_train(train)
    v = model.start.v.copy()
    at = range(train.housing.size)[train.housing.attachment("ring")]
    v[at[0]], v[at[2]] = 0.3, -0.2
    model = dataclasses.replace(model, start=dataclasses.replace(model.start, v=v))
    times = np.linspace(0.0, 0.01, 101)
    moved = states(model, times)
    rotor, n = model.shafts[1].rotor, train.housing.size
    M, C, K = np.zeros((3, n + 5, n + 5))
    M[:n, :n], K[:n, :n] = train.housing.mass, train.housing.stiffness
    M[at[4], at[4]] += rotor.polar  # the ring is held against turning in its bore
    inertia = rotor.mass, rotor.mass, rotor.mass, rotor.transverse, rotor.transverse
    for row, (axis, mass, spring, loss) in enumerate(
        zip((0, 1, 2, 3, 5), inertia, (1e8, 1e8, 1e8, 1e5, 1e5), dampers, strict=True)
    ):
        pull = np.zeros(n + 5)
        pull[n + row], pull[at[axis]] = 1.0, -1.0
        M[n + row, n + row] = mass
        K += spring * np.outer(pull, pull)
        C += loss * np.outer(pull, pull)
    turning = float(model.kinematics.ratios[2]) * 900.0 * times[-1]
    assert turning > 2.0
    A = np.block([[np.zeros_like(M), np.eye(n + 5)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    start = np.concatenate([np.zeros(n + 5), v[:n], np.zeros(5)])
    step, state, expected = expm(A * times[1]), start, [np.zeros(2)]
    for _ in times[1:]:
        state = step @ state
        expected.append(state[[n, n + 2]])
    found = fixed(model, moved, 1)
    np.testing.assert_allclose(found, expected, atol=1e-6 * np.abs(expected).max())


def test_forces_between_shafts_and_housing_balance() -> None:
    """What the bearings do to the housing moves it, and its reaction the shafts, seen from the ground, to 1e-9."""
    train = planets([5e-6, 0.0, 0.0], damping=DAMPED)
    dampers = tuple(dataclasses.replace(b, damping=(5e3, 0.0, 5e3, 0.5, 0.5)) for b in train.bearings)
    train = in_housing(dataclasses.replace(train, bearings=dampers))
    model = build_train(train)
    body = train.housing
    assert body is not None
    moved = states(model, np.linspace(0.0, 0.01, 51))
    size = np.abs(moved.bearing[:, :, :3]).max()
    q, v, a = (x[:, : body.size] for x in (moved.q, moved.v, moved.a))
    forces = a @ body.mass + v @ (body.damping + DAMPED.beta * body.stiffness) + q @ body.stiffness
    for bore, name in enumerate(model.bores):
        np.testing.assert_allclose(
            moved.bearing[:, bore, [0, 2]], forces[:, body.attachment(name)][:, [0, 2]], atol=1e-9 * size
        )
    speed = float(model.kinematics.ratios[2]) * float(train.driven.speed(0.0))
    turns = model.frame_turns(moved.time, [0])[:, 0]
    e1, e2, _ = train.frame
    total = moved.bearing[:, :, :3].sum(axis=1)
    for number, shaft in enumerate(model.shafts):
        at = slice(int(model.first[number]), int(model.first[number]) + 3)
        q, v, a = moved.q[:, at], moved.v[:, at], moved.a[:, at]
        arm = np.zeros(3)
        if train.carrier_of(train.shafts[number].name):
            arm = np.array(train.shafts[number].point)
            # it goes round with the carrier, whose small rotation has its own centrifugal force
            turned = moved.q[:, int(model.first[2]) + 5]
            q = q - np.outer(turned, np.cross(train.frame[2], arm))
        right = np.outer(e2, e1) - np.outer(e1, e2)
        inside = a + 2.0 * speed * v @ right.T - speed**2 * (q + arm) * np.abs(e1 + e2)
        total += shaft.rotor.mass * np.einsum("nij,nj->ni", turns, inside)
    np.testing.assert_allclose(total[:, [0, 2]], 0.0, atol=1e-9 * size)


def test_a_stiff_and_heavy_housing_is_a_rigid_one() -> None:
    """What differs falls as one over its mass and stiffness."""
    train = planets([5e-6, 0.0, 0.0], damping=DAMPED)
    times = np.linspace(0.0, 0.002, 41)
    rigid = simulate(build_train(train), times, tolerance=1e-9, method="taylor")

    def off(factor: float) -> float:
        response = simulate(build_train(in_housing(train, factor)), times, tolerance=1e-9, method="taylor")
        loads = response.bearing_load[:, :, [0, 2]] - rigid.bearing_load[:, :, [0, 2]]
        return float(np.abs(response.contact_force - rigid.contact_force).max() + np.abs(loads).max())

    large, small = off(1e5), off(1e6)
    assert small < 1e-3 * np.abs(rigid.contact_force).max()
    assert large / small == pytest.approx(10.0, rel=0.05)


def spectrum(response: TrainResponse) -> np.ndarray:
    at = response.attachment_names.index("ring")
    return np.abs(np.fft.rfft(response.bore_acceleration[1:, at, 0])) / 512.0


def test_sidebands_at_a_point_of_the_housing_are_those_of_mcfadden_and_smith() -> None:
    """Equal planets make only orders 3 k of the carrier in an elastic housing, too; unequal ones make others.

    The mesh of the ring has the order 101: 99 and 102 are its sidebands.
    """
    speed, alpha = 1500.0, 600.0
    for errors, alike in (([0.0, 0.0, 0.0], True), ([5e-6, 0.0, 0.0], False)):
        drive = Drive("sun", "sun", constant(speed))
        train = in_housing(planets(errors, damping=Damping(alpha=alpha, beta=2e-6), drive=drive))
        assert train.housing is not None
        body = dataclasses.replace(train.housing, damping=alpha * train.housing.mass)
        model = build_train(dataclasses.replace(train, housing=body))
        turn = 2.0 * math.pi / (speed * float(model.kinematics.ratios[2]))
        time = turn * np.concatenate([[0.0], 2.0 + np.arange(1024) / 1024.0])
        lines = spectrum(simulate(model, time, tolerance=1e-8, method="taylor"))
        others = np.delete(lines[:150], range(0, 150, 3))
        assert int(np.argmax(lines[90:110])) + 90 in (99, 102)
        assert (others.max() < 1e-3 * lines[90:110].max()) == alike


def test_a_steady_state_in_an_elastic_housing_is_what_the_transient_comes_to() -> None:
    """Unequal planets and an uneven frame: forces of meshes and bearings and the motion of a bore, by their lines.

    The carrier turns once in 101 cycles of the meshes, so the line k1 x mesh + k2 x carrier is 101 k1 + k2 of its turn.
    """
    train, speed = unequal_in_housing(), 1500.0
    model = build_train(train)
    state = steady_state(model, speed, tolerance=1e-4, stability=False)
    turn = 2.0 * math.pi / (speed * float(model.kinematics.ratios[2]))
    time = turn * np.concatenate([[0.0], 2.0 + np.arange(2048) / 2048.0])
    response = simulate(model, time, tolerance=1e-9, method="taylor")

    def off(values: np.ndarray, found: np.ndarray) -> float:
        """Largest difference of a line, in parts of the largest line of all signals."""
        samples = values[1:].reshape(2048, -1)
        lines = np.fft.rfft(samples, axis=0) / 1024.0
        lines[0] *= 0.5
        expected = np.zeros_like(lines)
        for (cycles, passes), each in zip(state.waves, found.reshape(len(found), -1), strict=True):
            number = (101 * cycles + passes) % 2048  # higher lines are sampled as lower ones
            expected[min(number, 2048 - number)] += each if number <= 1024 else each.conj()
        return float(np.abs(expected - lines).max() / np.abs(lines[1:]).max())

    at = response.attachment_names.index("ring")
    moved = response.bore_acceleration[:, at, :3] @ train.frame[2]
    assert off(response.contact_force, state.lines(state.force)) < 1e-4
    assert off(response.bearing_load[:, :, :3], state.bearing[:, :, :3]) < 1e-4
    assert off(moved, state.acceleration[:, at]) < 1e-4


def test_sidebands_of_a_run_up_are_the_orders_that_ideal_planets_let_through() -> None:
    """The sum over the planets of their pushes says which sidebands are zero; harmonic balance finds these, too."""
    model = build_train(in_housing(planets(damping=Damping(alpha=100.0, beta=2e-6))))
    state = steady_state(model, 200.0, stability=False)
    size = np.abs(state.bearing[:, :, :3]).max(axis=(1, 2))
    named = {name for order in train_orders(model, 2, 0) for name in order.names}
    for cycles in (1, 2):
        for passes in (-1, 1):
            line = float(size[state.numbers[cycles, passes]])
            name = f"{cycles} x mesh 1 {'-' if passes < 0 else '+'} 1 x carrier arm"
            assert (name in named) == (line > 1e-3 * size[1:].max())
    assert "1 x mesh 1 + 1 x carrier arm" in named


def test_a_run_up_names_sidebands_that_meet_modes() -> None:
    """The order of the sideband crosses each mode at f = (n + c) speed / 2 pi."""
    model = build_train(in_housing(planets(damping=Damping(alpha=100.0, beta=2e-6))))
    run = run_up(model, [100.0, 120.0], stability=False)
    critical = critical_speeds(run, 1, 0)
    met = [c for c in critical.campbell.met if c.cut.name.startswith("1 x mesh 1 + 1 x carrier arm")]
    assert met
    ratio, cycles = float(model.kinematics.ratios[2]), float(model.kinematics.cycles[0])
    for crossing in met:
        assert crossing.frequency == pytest.approx((cycles + ratio) * crossing.speed / (2.0 * math.pi), rel=1e-12)
        own = critical.campbell.modes.at(crossing.speed)
        assert own is not None
        assert own[crossing.mode] == pytest.approx(crossing.frequency, rel=1e-6)
    assert any("carrier arm" in name for cut in orders(run, 1) for name in cut.names)
    assert [each.get("carriers") for each in phases(run)] == [None, ["arm"]]


def test_modes_with_carriers_in_an_elastic_housing_are_those_of_the_start_position() -> None:
    """Without gyroscopic moments they do not depend on the speed: no force of a frame is in them."""
    model = build_train(in_housing(planets(damping=Damping(gyroscopic=False)), beta=0.0))
    modes = train_modes(model, [0.0, 500.0], 3000.0)
    expected = model.coupled_frequencies_hz
    expected = np.sort(expected[(expected > 1.0) & (expected < 3000.0)])
    for row in np.sort(modes.frequency, axis=1):
        np.testing.assert_allclose(row, expected, rtol=1e-8)
    assert "carrier arm at its start position" in " ".join(frozen_carriers(model))
    still = stage(3, (30, 36), mesh=rigid_curve, guides=(Guide("carrier"),), loads=())
    assert not frozen_carriers(build_train(in_housing(still)))


def unequal_in_housing() -> GearTrain:
    """A pin out of place, in an uneven frame with much damping: motions settle within some turns of the carrier."""
    alpha = 1200.0
    drive = Drive("sun", "sun", constant(1500.0))
    train = planets([5e-6, 0.0, 0.0], damping=Damping(alpha=alpha, beta=2e-6), drive=drive)
    dampers = tuple(dataclasses.replace(b, damping=(5e3, 0.0, 5e3, 0.5, 0.5)) for b in train.bearings)
    train = in_housing(dataclasses.replace(train, bearings=dampers))
    assert train.housing is not None
    body = dataclasses.replace(train.housing, damping=alpha * train.housing.mass)
    return dataclasses.replace(train, housing=body)


def test_a_carrier_that_stands_still_needs_no_turning() -> None:
    """A star stage: the carrier is fixed, so the run-up and the modes are there, too."""
    train = in_housing(
        stage(3, (30, 36), mesh=rigid_curve, guides=(Guide("carrier"),), loads=(), damping=Damping(ratio=0.05))
    )
    model = build_train(train)
    assert not model.forces.turned
    assert len(train_modes(model, [0.0, 100.0], 3000.0).speeds) == 2
    assert steady_state(model, 200.0).orbit.found


def test_what_an_elastic_housing_refuses_is_named() -> None:
    with pytest.raises(InputError, match="rigid bearing in an elastic housing"):
        build_train(in_housing(stage(3, (31, 35), bearing=None)))
    with pytest.raises(InputError, match="damping ratio"):
        build_train(in_housing(stage(3, (31, 35), damping=Damping(ratio=0.05))))


def test_two_stages_in_a_stiff_housing_are_those_in_a_rigid_one() -> None:
    """Two carriers turn at different speeds; what the housing yields falls as its stiffness rises."""
    raw = roles(two_stages(), "sun", "arm2", -60.0, ring=Fraction(0), ring2=Fraction(0))
    raw["train"]["damping"] = {"rayleigh_beta_s": 2e-6}
    rigid = built(raw)
    assert len(rigid.train.carriers) == 2
    times = np.linspace(0.0, 2e-3, 201)
    expected = simulate(rigid, times, tolerance=1e-8).contact_force

    def off(factor: float) -> float:
        response = simulate(build_train(in_housing(rigid.train, factor)), times, tolerance=1e-8)
        return float(np.abs(response.contact_force - expected).max() / np.abs(expected).max())

    near, nearer = off(1e6), off(1e7)
    assert near < 1e-3
    assert nearer == pytest.approx(0.1 * near, rel=0.1)


def test_sidebands_of_slow_differences_are_folded() -> None:
    """Two mesh frequencies of 10 and 9 orders and a carrier of 2: each sum of few of them has one line."""
    system = SimpleNamespace(turns=(0.1, 1.0 / 9.0, 0.5), orders=((1, 0, 0), (0, 1, 0)))
    run = SimpleNamespace(train=SimpleNamespace(system=system, passes={2: ("carrier arm", 3)}))
    cuts = orders(cast(RunUp, run), 2)
    expected = set()
    for a, b, c in itertools.product(range(-2, 3), range(-2, 3), range(-3, 4)):
        if abs(a) + abs(b) <= 2 and 10 * a + 9 * b + 2 * c > 0:
            expected.add((a, b, c))
    assert {cut.waves for cut in cuts} == expected
    assert len(cuts) == len(expected)
    for cut in cuts:
        a, b, c = cut.waves
        assert cut.order == pytest.approx(10 * a + 9 * b + 2 * c, abs=1e-12)
    (slow,) = [cut for cut in cuts if cut.waves == (-1, 1, 1)]
    assert slow.names == ("1 x mesh 2 + 1 x carrier arm - 1 x mesh 1",)
