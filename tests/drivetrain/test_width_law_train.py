"""Laws over the face width in trains: transients, harmonic balance, energy, statics, and jobs that compute them."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.base.tables.jobs import train_tables
from gearfe.drivetrain.gearbox.job import TrainJob, job_train, read_train_job, train_job
from gearfe.drivetrain.gearbox.mesh_stiffness import rounded_up, train_curves, usual_tilt
from gearfe.drivetrain.runup.condensed import condense
from gearfe.drivetrain.runup.run_up import steady_state
from gearfe.drivetrain.train import GearTrain, build_train, simulate
from gearfe.drivetrain.train.forces import WidthFlank
from gearfe.drivetrain.train.misalignment import TiltingTrain
from gearfe.drivetrain.train.states import train_states
from gearfe.drivetrain.train.statics import static_errors
from gearfe.gears.gearmesh import width_law_store
from gearfe.gears.gearmesh.job import StiffnessJob
from gearfe.gears.gearmesh.width_job import job_lines
from gearfe.gears.gearmesh.width_law import WidthLaw
from gearfe.gears.geometry.pair import gear_pair
from gearfe.gears.width import sweep_width
from gearfe.multibody import constant, integrate
from tests.drivetrain.test_mesh_tilting import bearing_forces, settled
from tests.drivetrain.test_planetary_job import SHIPPED, tables
from tests.drivetrain.test_width_spring import text
from tests.makers.files import job_file
from tests.makers.helical_trains import HIGH, LOW, helical_pair
from tests.makers.pushes import slopes_of
from tests.makers.width_laws import Slices, sliced_law

TEETH = 20
PITCH = 2.0 * math.pi / TEETH


def lawful_pair(law: WidthLaw | None = None, **changes: object) -> GearTrain:
    """The helical pair on bearings with a law of slices."""
    return helical_pair(stiffness=law or sliced_law(), **changes)  # type: ignore[arg-type]


def damped(train: GearTrain, ratio: float = 0.06) -> GearTrain:
    return dataclasses.replace(train, damping=dataclasses.replace(train.damping, ratio=ratio))


@pytest.mark.parametrize("speed", [700.0, 2500.0])
def test_transient_and_harmonic_balance_agree(speed: float) -> None:
    """Two formulations: compiled recurrences over time, and jets of the law over the phases."""
    model = build_train(damped(lawful_pair(speed=speed, damping=1000.0)))
    state = steady_state(model, speed, tolerance=1e-7)
    theta = state.lattice.theta[:, 0]
    times = (160 + theta / (2.0 * math.pi)) * PITCH / speed
    run = simulate(model, np.concatenate([[0.0], times]), tolerance=1e-9)
    np.testing.assert_allclose(run.contact_force[1:, 0], state.force[:, 0], atol=3e-4 * np.abs(state.force).max())
    moved = run.transmission_error[1:, 0]
    np.testing.assert_allclose(moved, state.transmission_error[:, 0], atol=3e-4 * np.ptp(moved))


def test_derivatives_of_the_forces() -> None:
    """By finite differences, where both flanks bear at places of their own."""
    model = build_train(lawful_pair(sliced_law(backlash=20e-6), damping=500.0))
    assert [flank.tilt >= 0 for flank in model.forces.flanks] == [True, False]
    forces = condense(model).forces
    m = condense(model).system.linear.size
    rng = np.random.default_rng(3)
    u, du = 1e-5 * rng.normal(size=(12, m)), 1e-3 * rng.normal(size=(12, m))
    for flank in (0, 1):
        u[6 * flank : 6 * flank + 6, forces.freedoms[flank, 0]] = 4e-5
    theta = rng.uniform(0.0, 6.0, size=(12, 1))
    by_place, by_rate = slopes_of(forces(theta, 100.0, u, du))
    for i in range(m):
        step = 1e-10 * np.eye(m)[i]
        for found, (du_step, u_step) in ((by_place, (0.0, 1.0)), (by_rate, (1e4, 0.0))):
            low, high = (
                forces(theta, 100.0, u + sign * u_step * step, du + sign * du_step * step).value for sign in (-1.0, 1.0)
            )
            slope = (high - low) / (2e-10 * max(u_step, du_step))
            np.testing.assert_allclose(found[:, :, i], slope, rtol=1e-4, atol=1e-5 * np.abs(found).max())


def test_energy_is_kept_while_teeth_part_and_meet() -> None:
    """Hardly turning, undamped: the law's energy beside the rest, through cells of approach and tilt, and apart."""
    train = lawful_pair(speed=1e-6, torque=60.0, damping_acts="in_contact")
    train = dataclasses.replace(
        train, bearings=tuple(dataclasses.replace(b, damping=(0.0,) * 5) for b in train.bearings),
        drive=dataclasses.replace(train.drive, speed=constant(1e-6)),
        damping=dataclasses.replace(train.damping, gyroscopic=False),
    )  # fmt: skip
    model = build_train(train)
    (line,), (flank,) = model.meshes, model.forces.flanks
    assert isinstance(flank, WidthFlank)
    times = np.linspace(0.0, 4e-3, 8001)
    start = dataclasses.replace(model.start, q=model.start.q - 1.5e-5 * line.row / (line.row @ line.row))
    moved = train_states(model, integrate(model.system, times, method="taylor", tolerance=1e-11, start=start))
    gamma, delta = moved.q @ line.tilt, moved.q @ line.row
    phase = line.phase + line.sense * (moved.q @ model.directions[:, flank.turn])
    elastic = flank.law(phase, delta, gamma).energy
    spring = line.mean * np.outer(line.row, line.row) + flank.against * np.outer(line.tilt, line.tilt)
    elastic += 0.5 * np.einsum("ti,ij,tj->t", moved.q, model.system.stiffness - spring, moved.q)
    kinetic = 0.5 * np.einsum("ti,ij,tj->t", moved.v, model.system.mass, moved.v)
    work = moved.q @ sum(direction * float(f(0.0)) for direction, f in model.torques)
    total = kinetic + elastic - work
    apart = flank.law(phase, delta, gamma).force == 0.0
    assert 0.02 < apart.mean() < 0.9
    _, part, side = flank.law.cells(phase, delta - flank.law.first_contact(phase, gamma), gamma)
    assert len(np.unique(part)) > 4
    assert len(np.unique(side)) > 1
    assert np.ptp(total) < 1e-7 * np.ptp(kinetic)


def test_bearings_carry_the_force_and_the_moment_of_the_law() -> None:
    """Spur gears at rest: sums of the bearings' forces, and of their moments about the middle of the width."""
    along, speed = 0.01, 1e-9
    law = sliced_law(Slices(swing=0.0, error=0.0))
    model = build_train(lawful_pair(law, beta=0.0, along=along, speed=speed))
    (line,), (flank, *_) = model.meshes, model.forces.flanks
    assert isinstance(flank, WidthFlank)
    q = settled(model)
    delta, gamma = q @ line.row, q @ line.tilt
    phase = line.phase + line.sense * (q @ model.directions[:, flank.turn])
    at = flank.law(phase, delta, gamma)
    assert line.along is not None
    couple = float(at.couple[0] + line.along.lever * at.force[0])  # about the middle of the width
    assert abs(couple) > 0.1
    forces = bearing_forces(model, q)
    for name, sign in (("s0", -1.0), ("s1", 1.0)):
        carried = {end: sign * float(forces[f"{name} {end}"] @ line.direction) for end in ("high", "low")}
        assert sum(carried.values()) == pytest.approx(float(at.force[0]), rel=1e-6)
        moment = carried["high"] * (HIGH - along) + carried["low"] * (LOW - along)
        assert moment == pytest.approx(couple, rel=1e-5)


def test_gears_that_tilt_beyond_the_law_end_the_run() -> None:
    law = sliced_law(tilt=2e-5)
    model = build_train(damped(lawful_pair(law, along=0.03, torque=120.0, speed=300.0)))
    run = simulate(model, np.linspace(0.0, 5e-3, 200), raise_on_failure=False)
    assert run.status == "beyond the mesh law"
    assert any("write mesh_model_tilt_um = " in sentence for sentence in run.warnings)


def test_a_law_over_the_width_refuses_what_needs_tooth_pairs() -> None:
    with pytest.raises(InputError, match="needs a mesh law of tooth pairs"):
        build_train(lawful_pair(friction=0.05))
    train = lawful_pair()
    uneven = dataclasses.replace(train.gears[0], pitch_errors=((1e-6, -1e-6) * 10, ()))
    with pytest.raises(InputError, match="has teeth with pitch errors"):
        build_train(dataclasses.replace(train, gears=(uneven, train.gears[1])))


def test_a_job_computes_the_law(tmp_path: Path) -> None:
    """Static transmission error and mean force of a train are those of its contact at the carried torque."""
    job = read_train_job(job_file(tmp_path, text("potential").replace("positions = 24\n", "")))
    (law,) = train_curves(job)
    assert isinstance(law, WidthLaw)
    assert len(law.tilts) == 1  # hinges
    train = job_train(job, (law,))
    pair = gear_pair(*(gear.gear for gear in train.gears))
    angles = pair.mesh_cycle * (np.arange(12) + 0.5) / 12
    sweep = sweep_width(job_lines(StiffnessJob(job.meshes[0], pair)), [75.0], angles=angles)
    (static,) = static_errors(train, angles)
    assert static is not None
    yields = sweep.transmission_error[0] - law.first_contact(angles)
    np.testing.assert_allclose(static, sweep.transmission_error[0], rtol=0.0, atol=2.0 * law.error * yields.max())
    assert np.mean(static) == pytest.approx(np.mean(sweep.transmission_error[0]), rel=2.0 * law.rms_error)
    model = build_train(train)
    state = steady_state(model, 100.0, tolerance=1e-5)
    assert state.force[:, 0].mean() == pytest.approx(75.0 / pair.wheel.base_radius, rel=1e-3)
    assert not state.beyond


def test_keys_of_laws_need_one(tmp_path: Path) -> None:
    given = text("variable_stiffness").replace('mesh_model = "var', 'mesh_model_tilt_um = 3.0\nmesh_model = "var')
    with pytest.raises(InputError, match=r"mesh_model_tilt_um = 3\.0: says how far a mesh law is known"):
        read_train_job(job_file(tmp_path, given))
    alike = text("potential", "").replace('mesh_model = "pot', 'mesh_model_tilt_um = 3.0\nmesh_model = "pot')
    job = read_train_job(job_file(tmp_path, alike.replace("positions = 24\n", "")))
    with pytest.raises(InputError, match="is for loads that vary along the face width"):
        train_curves(job)


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_law_has_the_tilt_of_its_force_whatever_the_load_in_the_end(sense: float) -> None:
    """A mesh that carries its force by torques on its gears tilts as under the steady torque that makes this force."""

    def still(torque: float) -> TiltingTrain:
        return TiltingTrain(build_train(helical_pair(sense=sense, torque=torque, stiffness=2e8, moments=True)), 0)

    loaded, light, idle = still(60.0), still(1e-3), still(0.0)
    force = abs(float(loaded.model.kinematics.steady_forces[0]))
    np.testing.assert_allclose(idle.at(1.0, np.zeros(2), force).tilts, loaded.at(1.0, np.zeros(2)).tilts, rtol=1e-6)
    tilt = usual_tilt(loaded, 0.0, 0.02)
    assert tilt * 0.02 > 1e-7
    assert [usual_tilt(train, force, 0.02) for train in (light, idle)] == pytest.approx([tilt, tilt], rel=1e-2)
    assert usual_tilt(idle, 0.0, 0.02) > 0.0  # gears that can tilt have a law with a stiffness against it
    hinges = build_train(helical_pair(torque=60.0, stiffness=2e8, moments=True, on_bearings=False))
    assert usual_tilt(TiltingTrain(hinges, 0), force, 0.02) == 0.0


def test_a_law_without_tilts_flags_them() -> None:
    law = sliced_law(cells=(24, 12, 0))
    tilts = np.array([0.0, 0.5e-8, 2e-8, -2e-8]) / law.width
    np.testing.assert_array_equal(law.past(np.full(4, 1e-6), tilts), [False, False, True, True])
    assert not law.past(np.full(4, -1e-6), tilts).any()  # apart


def test_forces_that_differ_by_round_off_are_rounded_up_alike() -> None:
    for force in (1500.0, 8613.1, 0.02):
        assert len({rounded_up(force * (1.0 + i * 1e-12)) for i in range(-3, 4)}) == 1
        assert force * (1.0 - 1e-9) <= rounded_up(force) <= 1.01 * force


def helical_stage(**changes: object) -> TrainJob:
    """The shipped planetary stage with helical gears and a law between sun and planets, springs at the ring."""
    helix = {f"gears__{gear}__helix_angle_deg": 12.0 for gear in ("sun", "planet", "ring")}
    helix |= {"shafts__planet__x_mm": 79.74257, "meshes__sun_planet__stiffness_N_per_m": None}  # type: ignore[dict-item]
    given = {**helix, "gears__sun__helix_hand": "right", "meshes__sun_planet__mesh_model": "potential", **changes}
    raw = tables(**given)
    raw.pop("stiffness", None)
    return train_job(SHIPPED, train_tables(raw, SHIPPED))


def test_equal_planets_share_the_law_of_the_largest_range(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[float, float]] = []

    def recorded(_: StiffnessJob, force: float, tilt: float) -> WidthLaw:
        asked.append((force, tilt))
        return sliced_law()

    monkeypatch.setattr(width_law_store, "cached_width_law", recorded)
    found = train_curves(helical_stage(**RING))
    assert len(asked) == 2
    assert found[0] is found[1] is found[2]
    assert found[3] is found[4] is found[5]
    assert min(tilt for _, tilt in asked) > 0.0


RING = {"meshes__planet_ring__stiffness_N_per_m": None, "meshes__planet_ring__mesh_model": "potential"}
FREE = {"gears__ring__rim": "free"}
SPRING = {"meshes__planet_ring__mesh_model": "variable_stiffness"}
LEFT = {
    "gears__planet__microgeometry__left": {"helix_crowning_um": 8.0},
    "meshes__sun_planet__mesh_model": "variable_stiffness", "meshes__sun_planet__backlash_um": 100.0,
}  # fmt: skip
PITCHES = {"gears__planet__microgeometry__pitch_um": [1.0, -1.0] * 11}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (RING | FREE, r"^gears\.ring\.rim = 'free': is not held.* give rim = \"bolted\""),
        (RING | FREE | SPRING, r"^gears\.ring\.rim = 'free': is not held"),
        ({"meshes__sun_planet__friction": 0.05}, "leave it out, or .*helix_angle_deg"),
        (PITCHES, "has pitch errors, and .*helix_angle_deg"),
        (LEFT, 'one stiffness for both; .* leave backlash_um out, or write mesh_model = "potential"'),
    ],
)
def test_what_laws_over_the_width_refuse_is_refused_before_the_first(
    changes: dict[str, object], message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*_: object) -> WidthLaw:
        raise AssertionError("a law was computed before all meshes were checked")

    monkeypatch.setattr(width_law_store, "cached_width_law", never)
    with pytest.raises(InputError, match=message):
        train_curves(helical_stage(**changes))
