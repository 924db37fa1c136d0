"""Pitch errors of a train's gears: which teeth meet, energy, slow running, shaft orders, from the job file."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.drivetrain.train import Damping, GearTrain, build_train, simulate
from gearfe.drivetrain.train.forces import LawFlank
from gearfe.drivetrain.train.model import TrainModel
from gearfe.drivetrain.train.statics import static_errors
from gearfe.gears.geometry.curves import inv
from gearfe.multibody import constant, smoothed_step
from tests.makers.mesh_laws import hertzian_law
from tests.makers.train_pairs import free_energy, free_pair, pair
from tests.makers.trains import curve, train


def uneven(gear_train: GearTrain, seed: int = 0, size: float = 5e-6) -> GearTrain:
    """All flanks of all gears with errors of their own."""
    rng = np.random.default_rng(seed)
    gears = tuple(
        dataclasses.replace(g, pitch_errors=tuple(tuple(rng.uniform(-size, size, g.gear.teeth)) for _ in range(2)))
        for g in gear_train.gears
    )
    return dataclasses.replace(gear_train, gears=gears)


def facing(gear_train: GearTrain, number: int, side: float, turned: float, psi: float) -> tuple[int, int, float]:
    """Teeth of driver and driven gear that meet at the driver's rotation `turned`, and their gap (m) without errors.

    From the places of involutes on the line of action: with the driver's centre in the origin, the driven gear's at
    (a, 0) and the driver turning counter-clockwise (else all is seen from behind), a flank of roll length s stands at
    s = r_b (theta + alpha_w), theta the angle at which its involute leaves the base circle; both gears' rolls make up
    the length a sin(alpha_w) where they touch. `psi` is the angle of the driver's tooth that is asked for.
    """
    mesh, sense = gear_train.meshes[number], gear_train.kinematics.senses[number]
    places = gear_train.kinematics.angles
    one, two = gear_train.gear(mesh.driver), gear_train.gear(mesh.driven)
    arm = np.subtract(gear_train.shaft(two.shaft).point, gear_train.shaft(one.shaft).point)
    towards = math.atan2(gear_train.frame[1] @ arm, gear_train.frame[0] @ arm)
    a = 0.5 * 2.5e-3 * (one.gear.teeth + two.gear.teeth)
    seen = sense * side  # +1: from the front

    def middles(item: Any, turn: float, line: float) -> np.ndarray:
        tau = places[item.name] + 2 * math.pi * np.arange(item.gear.teeth) / item.gear.teeth + turn
        return np.asarray(seen * (tau - line))

    alpha = one.gear.pressure_angle  # unshifted gears at their reference distance
    driver = middles(one, sense * turned, towards)
    driven = middles(two, -sense * turned * one.gear.teeth / two.gear.teeth, towards + math.pi)
    j1 = int(np.argmin(np.abs(np.angle(np.exp(1j * (driver - psi))))))
    assert abs(np.angle(np.exp(1j * (driver[j1] - psi)))) < 1e-9

    def roll(gear: Any, tau: float) -> float:
        root = gear.half_thickness_angle + inv(gear.pressure_angle)
        return float(gear.base_radius * (np.angle(np.exp(1j * tau)) + root + alpha))

    gaps = np.array([a * math.sin(alpha) - roll(one.gear, driver[j1]) - roll(two.gear, t) for t in driven])
    j2 = int(np.argmin(np.abs(gaps)))
    return j1, j2, float(gaps[j2])


def two_stages(driver: int, driven: int) -> GearTrain:
    return train([(20, 31), (driver, driven)], stiffness=law_of)


def idler() -> GearTrain:
    """Shafts s0, s1, s2, the gear of s1 between the others."""
    gear_train = train([(20, 31), (31, 27)], stiffness=law_of, ys=[0.012, 0.012])
    return dataclasses.replace(
        gear_train,
        gears=tuple(g for g in gear_train.gears if g.name != "d1"),
        meshes=(gear_train.meshes[0], dataclasses.replace(gear_train.meshes[1], driver="g0")),
    )


def law_of(teeth: int) -> Any:
    return hertzian_law(2 * math.pi / teeth)


@pytest.mark.parametrize("speed", [600.0, -600.0])
@pytest.mark.parametrize(
    ("made", "phases"),
    [(lambda: two_stages(30, 27), (0.1, 0.2)), (lambda: two_stages(23, 40), (0.0, 0.05)), (idler, (None, 0.04))],
)
def test_which_teeth_meet(made: Any, phases: tuple[float | None, ...], speed: float) -> None:
    """By the places of all flanks on the line of action, for driving and back flanks and both senses."""
    gear_train = uneven(made())
    meshes = tuple(
        dataclasses.replace(m, phase=p, backlash=0.0) for m, p in zip(gear_train.meshes, phases, strict=True)
    )
    drive = dataclasses.replace(gear_train.drive, speed=constant(speed))
    gear_train = dataclasses.replace(gear_train, meshes=meshes, drive=drive, loads=())
    model = build_train(gear_train)
    flanks = [f for f in model.forces.flanks if isinstance(f, LawFlank)]
    assert len(flanks) == 4
    looked = 0
    for number, flank in enumerate(flanks):
        i, side = number // 2, (1.0, -1.0)[number % 2]
        gears = [gear_train.gear(name) for name in (meshes[i].driver, meshes[i].driven)]
        errors = [g.pitch_errors[0 if model.meshes[i].sense * side > 0.0 else 1] for g in gears]
        for angle in np.linspace(0.01, 40.0, 61):
            drive_angle = np.array([math.copysign(angle, speed)])
            phase = flank.phase_and_approach(drive_angle, np.zeros((1, 100)))[0]
            turned = abs(model.meshes[i].ratio) * angle
            for shift, psi in zip(flank.shifts_at(phase)[0], flank.law.pair_phases(phase)[0], strict=True):
                j1, j2, gap = facing(gear_train, i, side, turned, psi)
                if abs(psi) < 4.0 / gears[0].gear.teeth:  # about the path of contact
                    looked += 1
                    assert abs(gap) < 1e-9
                    assert shift == pytest.approx(-errors[0][j1] - errors[1][j2], abs=1e-18)
    assert looked > 300


def test_a_free_pair_with_pitch_errors_keeps_its_energy() -> None:
    """Each tooth pair at its own approach, through the full period of 60 mesh cycles."""
    law = hertzian_law(relief=3e-6)
    model = build_train(uneven(free_pair(law, 800.0).train, size=3e-6))
    times = np.linspace(0.0, 60 * 2 * math.pi / 20 / 600.0, 2001)
    energy, elastic_part, _ = free_energy(model, shifted(model), times, 1e-10)
    assert np.abs(energy - energy[0]).max() < 1e-9 * energy.max()
    assert np.abs(energy - energy[0]).max() < 1e-6 * elastic_part.max()


def shifted(model: TrainModel) -> Any:
    (flank,) = (f for f in model.forces.flanks if isinstance(f, LawFlank))
    return lambda phase, approach: flank.law(phase, approach, flank.shifts_at(phase))


def test_slow_running_has_the_orders_of_the_shafts() -> None:
    """The static error at all times; a sine of one turn of the pinion is order 1 of its shaft, with its amplitude."""
    law, e = hertzian_law(), 10e-6
    gear_train = pair(law, speed=1.0, torque=smoothed_step(0.01, 0.02, 5.0), damping=Damping(ratio=0.05))
    errors = tuple(e * math.sin(2 * math.pi * j / 20) for j in range(20))
    gears = (dataclasses.replace(gear_train.gears[0], pitch_errors=(errors, (0.0,) * 20)), *gear_train.gears[1:])
    gear_train = dataclasses.replace(gear_train, gears=gears)
    model = build_train(gear_train)
    times = 0.05 + 4 * math.pi * np.arange(1200) / 1200  # two turns
    made = simulate(model, np.concatenate([[0.0], times]), tolerance=1e-6)
    run = made.transmission_error[1:, 0]
    static = static_errors(gear_train, made.drive_angle[1:])[0]
    assert static is not None
    assert np.abs(run - static).max() < 1e-3 * np.ptp(static)
    amplitude = 2.0 * np.abs(np.fft.rfft(run)) / len(run)
    # each pair holds the error of its tooth over about a pitch: the hold of a staircase
    assert int(np.argmax(amplitude[1:])) + 1 == 2  # twice in two turns
    assert amplitude[2] == pytest.approx(e, rel=0.02)


def test_mistakes() -> None:
    gear_train = uneven(pair(hertzian_law()))
    few = dataclasses.replace(gear_train.gears[0], pitch_errors=((1e-6,) * 19, ()))
    with pytest.raises(InputError, match="one for each of the 20 teeth"):
        build_train(dataclasses.replace(gear_train, gears=(few, gear_train.gears[1])))
    for stiffness in (curve(20), 1e8, None):
        mesh = dataclasses.replace(gear_train.meshes[0], stiffness=stiffness)
        with pytest.raises(InputError, match="pitch errors on gear 'd0', which curves, laws over the face width"):
            build_train(dataclasses.replace(gear_train, meshes=(mesh,)))
