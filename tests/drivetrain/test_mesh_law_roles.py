"""Mesh laws in trains: exchange of driver and driven, grid of cells, the linear limit, several mates, ramps."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from gearfe import GearPair
from gearfe.drivetrain.train import Damping, GearMesh, Load, build_train, simulate
from gearfe.drivetrain.train.states import train_states
from gearfe.gears.contact.half_plane import half_plane_pair
from gearfe.gears.contact.laws import law_named
from gearfe.gears.gearmesh.law import MeshLaw
from gearfe.gears.gearmesh.law_make import mesh_law
from gearfe.gears.gearmesh.sweep import elastic_pair
from gearfe.multibody import TimeFunction, constant, integrate, smoothed_step
from tests.makers.mesh_laws import CYCLE, DESIGN, PAIR, STEEL, hertzian_law
from tests.makers.train_pairs import R1, R2, free_energy, free_pair, pair
from tests.makers.trains import base_radius, train

EXCHANGED = GearPair(PAIR.wheel, PAIR.pinion)


@pytest.fixture(scope="module")
def laws() -> tuple[MeshLaw, MeshLaw]:
    """The law of a pair, and that of the same gears where the wheel drives: other contact solutions."""
    one, two = (
        mesh_law(
            half_plane_pair(elastic_pair(p, materials=(STEEL, STEEL), law=law_named("half_plane"), coarsen=2.0)),
            5 * DESIGN,
        )
        for p in (PAIR, EXCHANGED)
    )
    return one, two


def exchanged(phase: np.ndarray) -> np.ndarray:
    """Phase of the exchanged pair whose teeth stand alike: as far from the pitch point, before it for behind it."""
    here, there = (
        p.pinion_angle_at(p.pinion.base_radius * math.tan(p.working_pressure_angle)) for p in (PAIR, EXCHANGED)
    )
    return there - (phase - here) * R1 / R2


@pytest.mark.parametrize("force", [200.0, 1500.0, 4000.0])
def test_either_gear_may_drive(laws: tuple[MeshLaw, MeshLaw], force: float) -> None:
    """The same flanks under the same torques, whichever gear's rotation counts as the phase: F' r_b1 = F r_b1 + M.

    The exchanged pair's moment gives back the force, F' + M'/r_b2 = F, where edges bear, too.
    """
    law, other = laws
    phase = np.linspace(0.0, law.cycle, 200)
    approach = law.approach(phase, force)
    pushed = force + law(phase, approach).moment / R1
    turned = exchanged(phase) + approach / R2  # the wheel lags behind by the approach
    found = other.approach(turned, pushed)
    off = np.abs(found - approach) / approach.mean()
    assert np.quantile(off, 0.9) < 1e-3
    assert off.max() < 5e-3
    back = pushed + other(turned, found).moment / R2
    assert np.abs(pushed / force - 1.0).max() > 10 * np.abs(back / force - 1.0).max()
    assert back == pytest.approx(np.full(200, force), rel=1e-3)


def test_a_train_moves_alike_whichever_gear_is_called_the_driver(laws: tuple[MeshLaw, MeshLaw]) -> None:
    """Without backlash, under a load that changes its sign: the driving flank of one law is the other's back."""
    load = constant(10.0) + TimeFunction(sines=((25.0, 6e3, 0.2),))
    gear_train = pair(laws[0], torque=load, backlash=0.0, damping=Damping(ratio=0.01), speed=1500.0)
    model, times = build_train(gear_train), np.linspace(0.0, 3e-3, 301)
    phase = -float(exchanged(np.array(model.meshes[0].phase))) % laws[1].cycle
    other = build_train(
        dataclasses.replace(gear_train, meshes=(GearMesh("g0", "d0", laws[1], backlash=0.0, phase=phase),))
    )
    one, two = (simulate(m, times, tolerance=1e-8) for m in (model, other))
    assert (one.contact_force > 100.0).any()
    assert (one.contact_force < -100.0).any()
    assert one.transmission_error == pytest.approx(
        -two.transmission_error, abs=2e-3 * np.abs(one.transmission_error).max()
    )
    assert one.speed == pytest.approx(two.speed, abs=2e-3 * np.ptp(one.speed[:, 1]))


def test_the_grid_of_the_cells_does_not_matter() -> None:
    """15, 30, 60 and 120 cells: touch of order 4, forces of a train, with parting and back flanks, to 2e-5 and 3e-6."""
    counts, relief = (15, 30, 60, 120), 5e-6
    made = {cells: hertzian_law(relief=relief, cells=cells) for cells in counts}
    angle = np.random.default_rng(1).uniform(-0.45 * CYCLE, 0.45 * CYCLE, 2000)
    true = 0.5 * relief * (1 - np.cos(20 * angle))
    off = [np.abs(made[cells].first_contact(angle) - true).max() for cells in counts]
    assert (np.divide(off[:-1], off[1:]) > 12.0).all()
    forces = []
    for cells in counts:
        gear_train = pair(made[cells], torque=smoothed_step(1e-4, 2e-4, 40.0), backlash=10e-6, speed=700.0)
        model = build_train(dataclasses.replace(gear_train, damping=Damping(ratio=0.01)))
        forces.append(simulate(model, np.linspace(0.0, 2e-3, 401), tolerance=1e-9).contact_force)
    assert (forces[0] == 0.0).any()
    away = [np.abs(force - forces[-1]).max() / np.abs(forces[-1]).max() for force in forces[:-1]]
    assert away[0] < 4e-5
    assert away[1] < 5e-6


def test_small_motions_are_those_of_the_linear_law() -> None:
    """About a static load, almost at rest, a map acts as its tangent: off by the amplitude squared."""
    law, torque = hertzian_law(), 60.0
    off = []
    for amplitude in (0.01, 0.005, 0.0025):
        load = constant(torque) + TimeFunction(sines=((amplitude * torque, 2e4, 0.0),))
        phase = 0.3 * CYCLE
        rest = float(law.approach(phase, torque / R2)[0])
        tangent = float(law([phase], [rest]).tangent[0])
        found = []
        for stiffness, begin in ((law, rest), (tangent, torque / R2 / tangent)):
            gear_train = pair(stiffness, torque=load, speed=1e-6)
            mesh = dataclasses.replace(gear_train.meshes[0], phase=phase if stiffness is law else None)
            model = build_train(dataclasses.replace(gear_train, meshes=(mesh,)))
            start = dataclasses.replace(model.start, q=model.start.q.copy())
            start.q[model.first[1] + 5] = begin / model.meshes[0].row[model.first[1] + 5]
            run = integrate(model.system, np.linspace(0.0, 2e-3, 101), method="taylor", tolerance=1e-11, start=start)
            found.append(train_states(model, run).contact_force[:, 0] - torque / R2)
        off.append(np.abs(found[0] - found[1]).max())
        assert off[-1] < 0.5 * amplitude * np.abs(found[1]).max()
    assert np.divide(off[:-1], off[1:]) == pytest.approx([4.0, 4.0], rel=0.15)


def test_each_mesh_of_an_idler_has_its_own_phase() -> None:
    """A loaded idler: at slow speed each mesh has the error of its own phase, the first under F2 + (T + M2)/r_b."""
    one, two = hertzian_law(relief=5e-6), hertzian_law(2 * math.pi / 30, relief=3e-6)
    line = train([(20, 30), (30, 24)], ys=[0.0, 0.0])
    gear_train = dataclasses.replace(
        line,
        gears=tuple(g for g in line.gears if g.name != "d1"),
        meshes=(GearMesh("d0", "g0", one), GearMesh("g0", "g1", two)),
        drive=dataclasses.replace(line.driven, speed=constant(0.3)),
        loads=(Load("s2", None, smoothed_step(0.01, 0.02, -20.0)), Load("s1", None, smoothed_step(0.01, 0.02, 30.0))),
        damping=Damping(ratio=0.05),
    )
    model = build_train(gear_train)
    last = 20.0 / base_radius(24)
    times = np.linspace(0.0, 1.1, 301)
    run = integrate(model.system, times, method="taylor", tolerance=1e-7, start=model.start)
    moved = train_states(model, run)
    late = times > 0.06
    force: float | np.ndarray = last
    for number, law in ((1, two), (0, one)):
        mesh, turned = model.meshes[number], moved.q[late, model.first[number] + 5]
        phase = mesh.sense * (mesh.ratio * model.angle(times[late]) + turned) + mesh.phase
        static = law.approach(phase, force)
        assert np.abs(moved.approach[late, number] - static).max() < 1e-3 * np.ptp(static)
        force = last + (30.0 + law(phase, static).moment) / R2


def test_a_torque_that_ramps_through_zero() -> None:
    """From the driving to the back flanks, through the backlash and to and fro once: statics before and after."""
    law, j = hertzian_law(relief=5e-6), 20e-6
    torque = smoothed_step(0.01, 0.02, 60.0) + smoothed_step(0.3, 0.2, -100.0) + smoothed_step(0.7, 0.2, 100.0)
    gear_train = pair(law, speed=1.0, torque=torque, backlash=j, damping=Damping(ratio=0.05))
    model = build_train(gear_train)
    made = simulate(model, np.linspace(0.0, 1.0, 1001), tolerance=1e-6)
    phase = model.angle(made.time) + model.meshes[0].phase
    for begin, end, force in ((0.08, 0.2, 60.0), (0.45, 0.6, -40.0), (0.85, 1.0, 60.0)):
        part = (made.time > begin) & (made.time < end)
        sign = math.copysign(1.0, force)
        static = law.approach(sign * phase[part], abs(force) / R2)
        static = static if force > 0.0 else -j - static
        assert np.abs(made.transmission_error[part, 0] - static).max() < 2e-3 * 5e-6
        assert made.contact_force[part, 0] == pytest.approx(np.full(part.sum(), force / R2), rel=1e-3)


@pytest.mark.parametrize("force", [800.0, 2000.0])
def test_a_free_pair_of_gears_keeps_its_energy_over_a_thousand_cycles(
    laws: tuple[MeshLaw, MeshLaw], force: float
) -> None:
    """Without damping, one and two pairs in turns that part within a nanosecond of each other: 1e-9 at 1e-10."""
    model = free_pair(laws[0], force)
    energy, _, moved = free_energy(model, laws[0], np.linspace(0.0, 1000 * CYCLE / 600.0, 4000), 1e-10)
    assert (moved.contact_force == 0.0).mean() > 0.1
    assert np.ptp(energy) < 1e-9 * energy.max()
