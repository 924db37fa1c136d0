"""What no train with a mesh law may change: balances, reversal of time, exchange of the gears, known limits."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from gearfe.drivetrain.train import Drive, build_train
from gearfe.drivetrain.train.forces import LawFlank
from gearfe.drivetrain.train.states import train_states
from gearfe.multibody import TimeFunction, constant, integrate
from tests.makers.mesh_laws import hertzian_law
from tests.makers.train_pairs import R1, R2, pair


def thrown(law, rate, **changes):  # type: ignore[no-untyped-def]
    """Both shafts free (the drive a spring that does no work to speak of), the driver faster than rolling asks for by
    `rate` (m/s) on the line of action.
    """
    train = pair(law, **changes)
    shafts = (dataclasses.replace(train.shafts[0], initial_speed=600.0 + rate / R1), train.shafts[1])
    drive = Drive("s0", "s0+", constant(600.0), stiffness=1e-15)
    return build_train(dataclasses.replace(train, shafts=shafts, drive=drive, loads=()))


def test_rattle_keeps_momentum_and_energy() -> None:
    """Thrown to and fro between both flanks of a spring: J1 w1/r1 - J2 w2/r2 and the energy, to 1e-6.

    The force of a curve has no moment on the phase, and does no work on it: the energy is that of a constant k.
    """
    model = thrown(1e8, 0.02, backlash=20e-6)
    run = integrate(model.system, np.linspace(0.0, 0.2, 4001), method="taylor", tolerance=1e-11, start=model.start)
    moved = train_states(model, run)
    inertia = np.array([s.rotor.polar for s in model.shafts])
    rates = moved.v[:, [int(i) + 5 for i in model.first]] + model.angle(moved.time, 1)[:, None] * model.ratios
    momentum = rates @ (inertia / [R1, -R2])
    approach = moved.q @ model.meshes[0].row
    bent = np.maximum(approach, 0.0) + np.maximum(-approach - 20e-6, 0.0)
    mass = 1.0 / (R1**2 / inertia[0] + R2**2 / inertia[1])  # of the motion against each other
    energy = 0.5 * mass * (rates @ [R1, R2]) ** 2 + 0.5 * 1e8 * bent**2
    free = 0.5 * mass * 0.02**2
    assert ((approach[1:] > 0.0) & (approach[:-1] <= 0.0)).sum() > 10
    assert ((approach[1:] < -20e-6) & (approach[:-1] >= -20e-6)).sum() > 10
    assert np.ptp(momentum) < 1e-9 * np.abs(momentum).max()
    assert np.ptp(energy) < 1e-6 * free


def test_rattle_of_a_law_keeps_its_energy() -> None:
    """Both flanks of a mesh law with transmission error, its moment on the phase included: 1e-6 of what is thrown."""
    law = hertzian_law(relief=3e-6)
    model = thrown(law, 0.02, backlash=20e-6)
    line = model.meshes[0]
    run = integrate(model.system, np.linspace(0.0, 0.05, 4001), method="taylor", tolerance=1e-11, start=model.start)
    moved = train_states(model, run)
    spins = moved.q[:, [int(i) + 5 for i in model.first]]
    rates = moved.v[:, [int(i) + 5 for i in model.first]] + model.angle(moved.time, 1)[:, None] * model.ratios
    phase = line.sense * (line.ratio * model.angle(moved.time) + spins[:, 0]) + line.phase
    inertia = np.array([s.rotor.polar for s in model.shafts])
    approach = moved.q @ line.row
    elastic = law(phase, approach).energy + law(-phase, -approach - 20e-6).energy
    energy = 0.5 * rates**2 @ inertia + elastic
    free = 0.5 * 0.02**2 / (R1**2 / inertia[0] + R2**2 / inertia[1])
    assert (moved.contact_force[:, 0] > 0.0).any()
    assert (moved.contact_force[:, 0] < 0.0).any()
    assert np.ptp(energy) < 1e-6 * free


def test_without_damping_time_runs_back() -> None:
    """At the end all speeds turn round: the train goes the same way back, through parting teeth and back flanks."""
    law, end = hertzian_law(relief=3e-6), 8e-3
    model = thrown(law, 0.05, backlash=20e-6)
    times = np.linspace(0.0, end, 401)
    there = integrate(model.system, times, method="taylor", tolerance=1e-11, start=model.start)
    forces = train_states(model, there).contact_force[:, 0]
    assert (forces > 0.0).any()
    assert (forces < 0.0).any()
    assert (forces == 0.0).any()
    line, angle = model.meshes[0], float(model.angle(np.array([end]))[0])
    mesh = dataclasses.replace(model.train.meshes[0], phase=(line.phase + angle) % (2 * math.pi / 20))
    again = build_train(dataclasses.replace(model.train, meshes=(mesh,)))
    # rounding grows with each impact: 1e-11 in a step is 1e-4 of the forces after there and back
    speeds = np.zeros(model.system.size)
    speeds[[int(i) + 5 for i in model.first]] = 600.0 * np.array(model.ratios, dtype=float)
    start = dataclasses.replace(again.start, q=there.q[-1], v=-there.v[-1] - 2.0 * speeds)
    back = integrate(again.system, times, method="taylor", tolerance=1e-11, start=start)
    assert train_states(again, back).contact_force[::-1, 0] == pytest.approx(forces, abs=3e-4 * np.abs(forces).max())


@pytest.mark.parametrize("friction", [0.0, 0.06])
def test_driven_rattle_balances_momentum_and_energy(friction: float) -> None:
    """A light load, 2000 rad/s that swing, damping in contact: balances within 1e-6 at the tolerance 1e-6.

    Momentum of the driven shaft against the impulses on it, and kinetic and elastic energy against the work of drive,
    load, damping and friction: forces by their plain formulas, integrated by Gauss' rule over each step.
    """
    law, torque, backlash = hertzian_law(relief=3e-6), 0.2, 30e-6
    train = pair(law, torque=constant(torque), backlash=backlash)
    mesh = dataclasses.replace(train.meshes[0], damping=3000.0, friction=friction)
    speed = constant(2000.0) + TimeFunction(sines=((20.0, 400.0, 0.3),))
    drive = dataclasses.replace(train.drive, speed=speed)
    model = build_train(dataclasses.replace(train, meshes=(mesh,), drive=drive))

    def run(times):  # type: ignore[no-untyped-def]
        return integrate(model.system, times, method="taylor", tolerance=1e-6, start=model.start)

    ends = run(np.array([0.0, 0.02])).dense.times
    nodes, weights = np.polynomial.legendre.leggauss(12)
    inner = ends[:-1, None] + 0.5 * np.diff(ends)[:, None] * (1.0 + nodes)
    times = np.append(np.hstack([ends[:-1, None], inner]).ravel(), ends[-1])
    share = np.append(np.hstack([0.0 * ends[:-1, None], 0.5 * np.diff(ends)[:, None] * weights]).ravel(), 0.0)
    again = run(times)
    assert np.array_equal(again.dense.times, ends)  # the same steps
    moved = train_states(model, again)
    line, spin = model.meshes[0], [int(i) + 5 for i in model.first]
    rates = moved.v[:, spin] + model.angle(times, 1)[:, None] * model.ratios
    force, approach = moved.contact_force[:, 0], moved.approach[:, 0]
    assert (force > 0.0).sum() > 1000
    assert (force < 0.0).sum() > 1000
    assert (force == 0.0).sum() > 1000
    phase = model.angle(times) + moved.q[:, spin[0]] + line.phase
    front, rear = law(phase, approach), law(-phase, -approach - backlash)
    drag, u, du = 0.0 * times, moved.q @ model.directions, moved.v @ model.directions
    for flank, pushes in zip(model.forces.flanks, model.forces.of_flanks(times, u, du), strict=True):
        made = pushes.drag
        if made is not None and isinstance(flank, LawFlank) and flank.sliding is not None:
            columns = model.directions[spin[1], [flank.sliding.across, flank.sliding.spin]]
            drag = drag + made.value @ columns
    pull = line.row[spin[1]] * force + drag
    inertia = np.array([s.rotor.polar for s in model.shafts])
    lacks = inertia[1] * (rates[:, 1] - rates[0, 1]) - np.cumsum(share * (torque - pull))
    assert np.abs(lacks[:: 1 + len(nodes)]).max() < 1e-6 * inertia[1] * np.ptp(rates[:, 1])
    damped = (force - front.force + rear.force) * (moved.v @ line.row)
    power = moved.drive_torque * rates[:, 0] + torque * rates[:, 1] - damped - moved.friction_power[:, 0]
    energy = 0.5 * rates**2 @ inertia + front.energy + rear.energy
    lacks = energy - energy[0] - np.cumsum(share * power)
    assert np.abs(lacks[:: 1 + len(nodes)]).max() < 1e-6 * (share * np.abs(power)).sum()
    assert np.abs(lacks[:: 1 + len(nodes)]).max() < 1e-7 * (0.5 * rates**2 @ inertia).max()
