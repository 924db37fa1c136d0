"""Motor, load and couplings: torsional frequencies, starts by torque, power, any nominal speed, mistakes."""

from __future__ import annotations

import csv
import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import simpson
from scipy.linalg import eigh

from gearfe.base.errors import InputError
from gearfe.base.tables.text import toml_document
from gearfe.cli.main import main
from gearfe.drivetrain.bearings import BallBearing
from gearfe.drivetrain.gearbox.job import job_train, read_train_job
from gearfe.drivetrain.modes.whirl import train_modes
from gearfe.drivetrain.runup.run_up import steady_state
from gearfe.drivetrain.train import (
    Bearing,
    Coupling,
    Damping,
    Drive,
    GearTrain,
    Load,
    Machine,
    Shaft,
    TrainModel,
    build_train,
    simulate,
)  # fmt: skip
from gearfe.drivetrain.train.misalignment import misalignments, static_state
from gearfe.fem.beams import Section
from gearfe.multibody import TimeFunction, constant
from tests.makers.gearboxes import tables
from tests.makers.mesh_laws import hertzian_law
from tests.makers.trains import base_radius, changed, curve, elastic, train

MOTOR, BRAKE = Machine("motor", "s0", 4e-3, 2.5e4, 1.5), Machine("brake", "s1", 9e-3, 4e4, 2.0)
MESH = 2e8
TORQUE = 60.0


def chain(*, stiffness: Any = MESH, machines: tuple[Machine, ...] = (MOTOR, BRAKE), **drive: Any) -> GearTrain:
    """Motor, two shafts in hinges, brake, under a constant torque."""
    made = train([(20, 30)], stiffness=stiffness)
    names = [machine.name for machine in machines]
    on = {shaft: next((m.name for m in machines if m.shaft == shaft and m.name in names), "") for shaft in ("s0", "s1")}
    load = dataclasses.replace(made.loads[0], torque=constant(TORQUE), machine=on["s1"])
    drive = {"machine": on["s0"], **drive}
    return changed(made, machines=machines, loads=(load,), drive=dataclasses.replace(made.driven, **drive))


def sampled(values: np.ndarray | None) -> np.ndarray:
    assert values is not None
    return values


def inertias(model: TrainModel) -> list[float]:
    return [body.rotor.polar for body in model.shafts]


def closed(model: TrainModel) -> tuple[np.ndarray, np.ndarray]:
    """Mass and stiffness of motor, first shaft, second shaft and brake, by hand."""
    one, two = inertias(model)
    mesh = np.array([0.0, base_radius(20), base_radius(30), 0.0])
    springs = (np.array([1.0, -1.0, 0.0, 0.0]), MOTOR.stiffness), (np.array([0.0, 0.0, -1.0, 1.0]), BRAKE.stiffness)
    K = MESH * np.outer(mesh, mesh) + sum(k * np.outer(row, row) for row, k in springs)
    return np.diag([MOTOR.inertia, one, two, BRAKE.inertia]), K


def test_torsional_frequencies_of_motor_gears_and_load() -> None:
    model = build_train(chain())
    M, K = closed(model)
    expected = np.sqrt(eigh(K[1:, 1:], M[1:, 1:], eigvals_only=True)) / (2.0 * math.pi)
    np.testing.assert_allclose(model.coupled_frequencies_hz, expected, rtol=1e-9)


def test_torsional_frequencies_of_a_free_chain() -> None:
    model = build_train(chain(torque=constant(40.0)))
    M, K = closed(model)
    expected = np.sqrt(np.maximum(eigh(K, M, eigvals_only=True), 0.0)) / (2.0 * math.pi)
    found = model.coupled_frequencies_hz
    assert found[0] < 1e-3
    np.testing.assert_allclose(found[1:], expected[1:], rtol=1e-9)


def coupled(**changes: Any) -> GearTrain:
    """A second shaft on the axis of the first one, which drives it by a coupling."""
    made = train([(20, 30)], stiffness=MESH)
    shaft = Shaft("in", (0.0, -0.1, 0.0), 0.08, 0.012, ("in+", "in-"))
    bores = {**made.rigid_bores, "in+": (0.0, -0.07, 0.0), "in-": (0.0, -0.13, 0.0)}
    load = dataclasses.replace(made.loads[0], torque=constant(TORQUE))
    whole = changed(
        made, shafts=(*made.shafts, shaft), rigid_bores=bores, drive=Drive("in", "in+", constant(600.0)), loads=(load,),
        couplings=(Coupling("clutch", ("in", "s0"), 3e4, 0.5),),
    )  # fmt: skip
    return changed(whole, **changes)


def test_a_coupling_turns_both_shafts_alike_and_yields() -> None:
    made = coupled()
    assert [float(r) for r in made.kinematics.ratios] == pytest.approx([1.0, -20 / 30, 1.0])
    np.testing.assert_allclose(made.kinematics.steady_forces, TORQUE / base_radius(30), rtol=1e-12)
    model = build_train(made)
    one, two, _ = inertias(model)
    mesh = np.array([base_radius(20), base_radius(30)])
    K = MESH * np.outer(mesh, mesh) + np.diag([3e4, 0.0])
    expected = np.sqrt(eigh(K, np.diag([one, two]), eigvals_only=True)) / (2.0 * math.pi)
    np.testing.assert_allclose(model.coupled_frequencies_hz, expected, rtol=1e-9)
    # settled: the coupling carries the drive's torque, which the teeth raise from the load's
    response = simulate(build_train(changed(made, damping=Damping(ratio=0.3))), [0.0, 0.1, 0.2], tolerance=1e-9)
    np.testing.assert_allclose(sampled(response.spring_torque)[-1], TORQUE * 20 / 30, rtol=1e-6)
    np.testing.assert_allclose(response.drive_torque[-1], TORQUE * 20 / 30, rtol=1e-6)


def test_a_start_by_torque_follows_the_closed_form() -> None:
    """J w' = T - c w of a rigid chain from rest: w = T/c (1 - exp(-c t/J))."""
    torque, slope = 30.0, 0.4
    made = train([(20, 30)], stiffness=None, loads=())
    made = changed(made, drive=Drive("s0", "s0+", constant(0.0), torque=constant(torque), slope=slope))
    model = build_train(made)
    one, two = inertias(model)
    inertia, t = one + two * (20 / 30) ** 2, np.linspace(0.0, 0.02, 41)
    response = simulate(model, t, tolerance=1e-10)
    expected = torque / slope * (1.0 - np.exp(-slope * t / inertia))
    np.testing.assert_allclose(response.speed[:, 0], expected, rtol=1e-8, atol=1e-8 * expected.max())
    np.testing.assert_allclose(response.speed[:, 1], -expected * 20 / 30, rtol=1e-8, atol=1e-8 * expected.max())
    np.testing.assert_allclose(response.drive_torque, torque - slope * response.speed[:, 0], rtol=1e-9)


@pytest.mark.parametrize("kind", ["curve", "law"])
def test_the_nominal_speed_of_a_drive_by_torque_does_not_matter(kind: str) -> None:
    """T - c (w - w0) with two nominal speeds, torques to match: phases of the teeth follow the true rotation."""
    law = hertzian_law(2.0 * math.pi / 20)
    stiffness = (lambda teeth: law) if kind == "law" else lambda teeth: curve(teeth, swing=0.3)
    slope, t = 0.2, np.linspace(0.0, 0.01, 101)
    responses = []
    for nominal in (600.0, 480.0):
        drive = {"speed": constant(nominal), "torque": constant(45.0 + slope * (600.0 - nominal)), "slope": slope}
        made = chain(stiffness=stiffness, machines=(BRAKE,), **drive)
        rolling = [600.0, -400.0]
        begin = [dataclasses.replace(s, initial_speed=w) for s, w in zip(made.shafts, rolling, strict=True)]
        made = changed(made, shafts=tuple(begin), machines=(dataclasses.replace(BRAKE, initial_speed=-400.0),))
        load = dataclasses.replace(
            made.loads[0], slope=0.05, torque=constant(TORQUE + 0.05 * (600 - nominal) * -20 / 30)
        )
        responses.append(simulate(build_train(changed(made, loads=(load,))), t, tolerance=1e-10))
    one, two = responses
    np.testing.assert_allclose(two.speed, one.speed, rtol=1e-7)
    np.testing.assert_allclose(sampled(two.machine_speed), sampled(one.machine_speed), rtol=1e-7)
    scale = np.abs(one.contact_force).max()
    np.testing.assert_allclose(two.contact_force, one.contact_force, atol=1e-6 * scale)
    np.testing.assert_allclose(two.drive_torque, one.drive_torque, rtol=1e-7)


def test_what_the_drive_gives_is_stored_taken_or_lost() -> None:
    """Power balance of a chain that starts by torque against a load that grows with the speed."""
    made = chain(torque=constant(55.0), slope=0.05, speed=constant(300.0))
    load = dataclasses.replace(made.loads[0], slope=0.1)
    mesh = dataclasses.replace(made.meshes[0], damping=300.0)
    made = changed(made, loads=(load,), meshes=(mesh,))
    model = build_train(made)
    t = np.linspace(0.0, 0.02, 20001)
    r = simulate(model, t, tolerance=1e-11)
    motor, brake = sampled(r.machine_speed).T
    one, two = r.speed.T
    closing = base_radius(20) * one + base_radius(30) * two
    given = r.drive_torque * motor + (TORQUE - 0.1 * (brake + 200.0)) * brake
    lost = MOTOR.damping * (motor - one) ** 2 + BRAKE.damping * (brake - two) ** 2 + 300.0 * closing**2
    twists = [
        (torque - machine.damping * (a - b)) / machine.stiffness
        for machine, torque, a, b in zip(
            (MOTOR, BRAKE), sampled(r.spring_torque).T, (motor, brake), (one, two), strict=True
        )
    ]
    (M, _), speeds = closed(model), np.array([motor, one, two, brake])
    energy = 0.5 * np.diag(M) @ speeds**2 + 0.5 * MESH * r.transmission_error[:, 0] ** 2
    energy += sum(0.5 * machine.stiffness * twist**2 for machine, twist in zip((MOTOR, BRAKE), twists, strict=True))
    balance = energy[-1] - energy[0] - simpson(given - lost, x=t)
    assert abs(balance) < 1e-7 * np.ptp(energy)


def test_a_drive_that_changes_speed_accelerates_its_machines() -> None:
    """Behind a rigid train the brake's spring feels its inertia: k (u_b - u_s) = -J g psi''."""
    ramp = TimeFunction((-math.inf,), (0.0,), ((100.0, 5000.0),))
    made = chain(stiffness=None, machines=(dataclasses.replace(BRAKE, damping=40.0),), speed=ramp)
    made = changed(made, loads=())
    response = simulate(build_train(made), np.linspace(0.0, 0.05, 11), tolerance=1e-10)
    # about +y on the shaft: the machine is pulled along with -20/30 of the drive
    assert sampled(response.spring_torque)[-1, 0] == pytest.approx(BRAKE.inertia * 5000.0 * 20 / 30, rel=1e-6)


def test_steady_states_are_at_the_speed_of_the_machine() -> None:
    made = changed(chain(stiffness=lambda teeth: curve(teeth, swing=0.1)), damping=Damping(ratio=0.05))
    model = build_train(made)
    state = steady_state(model, 600.0, tolerance=1e-6)
    t = np.linspace(0.0, 0.6, 60001)
    response = simulate(model, t, tolerance=1e-9)
    late = response.contact_force[t > 0.6 - 2 * math.pi / 600.0, 0]
    found = state.force[:, 0]
    assert found.mean() == pytest.approx(TORQUE / base_radius(30), rel=1e-6)
    assert np.ptp(found) == pytest.approx(np.ptp(late), rel=2e-3)
    with pytest.raises(InputError, match=r"drive.*is by torque"):
        steady_state(build_train(changed(made, drive=dataclasses.replace(made.driven, torque=constant(40.0)))), 600.0)


def test_modes_have_the_energy_of_machines_in_the_torsion_of_their_shafts() -> None:
    free = tuple(dataclasses.replace(machine, damping=0.0) for machine in (MOTOR, BRAKE))
    made = changed(chain(machines=free), damping=Damping(gyroscopic=False))
    modes = train_modes(build_train(made), [600.0], 1e5)
    M, K = closed(build_train(made))
    values, shapes = eigh(K[1:, 1:], M[1:, 1:])
    np.testing.assert_allclose(modes.frequency[0], np.sqrt(values) / (2.0 * math.pi), rtol=1e-9)
    for n, shape in enumerate(shapes.T):
        on_second = shape[1] ** 2 * M[2, 2] + shape[2] ** 2 * M[3, 3]
        strain = BRAKE.stiffness * (shape[2] - shape[1]) ** 2 / values[n]
        assert modes.share("torsion", "s1")[0, n] == pytest.approx(0.5 * (on_second + strain), rel=1e-6)


def test_rolling_bearings_of_a_train_by_torque_are_those_of_the_load() -> None:
    made = elastic(chain())
    names = [bore for shaft in made.shafts for bore in shaft.bores]
    made = changed(made, bearings=tuple(Bearing(name, BallBearing(8, 7.9e-3, 33.5e-3)) for name in names))
    free = changed(made, drive=dataclasses.replace(made.driven, torque=constant(40.0), slope=0.1))
    for name in names:
        one, two = (build_train(x).operating.bearings[name].stiffness for x in (made, free))
        np.testing.assert_allclose(two, one, rtol=1e-6, atol=1e-6 * np.abs(one).max())


def test_a_start_from_rest_does_not_matter_for_the_operating_point() -> None:
    made = chain(torque=constant(40.0), slope=0.1)
    names = [bore for shaft in made.shafts for bore in shaft.bores]
    made = changed(made, bearings=tuple(Bearing(name, BallBearing(8, 7.9e-3, 33.5e-3)) for name in names))
    resting = changed(
        made,
        shafts=tuple(dataclasses.replace(shaft, initial_speed=0.0) for shaft in made.shafts),
        machines=tuple(dataclasses.replace(machine, initial_speed=0.0) for machine in made.machines),
    )
    for name in names:
        one, two = (build_train(x).operating.bearings[name].stiffness for x in (made, resting))
        np.testing.assert_array_equal(one, two)


def test_shafts_of_a_coupling_do_not_overlap() -> None:
    made = coupled()
    inside = tuple(dataclasses.replace(s, point=(0.0, -0.07, 0.0)) if s.name == "in" else s for s in made.shafts)
    bores = {**made.rigid_bores, "in+": (0.0, -0.06, 0.0), "in-": (0.0, -0.08, 0.0)}
    with pytest.raises(InputError, match=r"coupling 'clutch': shafts 'in' and 's0' overlap by \d+"):
        build_train(changed(made, shafts=inside, rigid_bores=bores))


@pytest.mark.parametrize("order", [("in", "s0"), ("s0", "in")])
def test_two_shafts_have_one_coupling(order: tuple[str, str]) -> None:
    made = coupled()
    with pytest.raises(InputError, match=r"coupling 'second' = .*joins the shafts of coupling 'clutch', too"):
        build_train(changed(made, couplings=(*made.couplings, Coupling("second", order, 1e4))))


def test_a_coupling_against_gears_is_refused_by_its_shafts() -> None:
    """Shafts that gears turn at two speeds, end to end: no coupling turns them alike."""
    made = coupled()
    wheel = dataclasses.replace(made.gears[1], name="g9", shaft="in2", along=-0.1)
    shaft = Shaft("in2", (0.0625, -0.1, 0.0), 0.08, 0.012, ("x+", "x-"))
    pinion = dataclasses.replace(made.gears[0], name="d9", shaft="in", along=-0.1)
    bores = {**made.rigid_bores, "x+": (0.0625, -0.07, 0.0), "x-": (0.0625, -0.13, 0.0)}
    mesh = dataclasses.replace(made.meshes[0], driver="d9", driven="g9", name="m9")
    twice = changed(
        made, shafts=(*made.shafts, shaft), gears=(*made.gears, pinion, wheel), meshes=(*made.meshes, mesh),
        rigid_bores=bores, couplings=(*made.couplings, Coupling("back", ("s1", "in2"), 1e4)),
    )  # fmt: skip
    assert [float(r) for r in twice.kinematics.ratios] == pytest.approx([1.0, -2 / 3, 1.0, -2 / 3])
    other = tuple(dataclasses.replace(g, gear=made.gears[1].gear) if g.name == "d9" else g for g in twice.gears)
    with pytest.raises(InputError, match="closes a loop that cannot turn"):
        _ = changed(twice, gears=other).kinematics


@pytest.mark.parametrize(("aside", "fits"), [(0.0, False), (0.01, False), (0.03, True)])
def test_shafts_do_not_overlap(aside: float, fits: bool) -> None:
    """Rigid shafts without a coupling, on one axis or so near that they cut each other."""
    made = coupled(couplings=())
    point, bores = (aside, -0.07, 0.0), {"in+": (aside, -0.06, 0.0), "in-": (aside, -0.08, 0.0)}
    shafts = tuple(dataclasses.replace(s, point=point) if s.name == "in" else s for s in made.shafts)
    given = changed(
        made, shafts=shafts, rigid_bores={**made.rigid_bores, **bores}, gears=made.gears, couplings=(),
        drive=dataclasses.replace(made.driven, shaft="s0", bore="s0+"),
    )  # fmt: skip
    with pytest.raises(InputError) as error:
        build_train(given)
    assert ("overlaps shaft" in error.value.problem) is not fits, str(error.value)
    assert fits or "mm along the axis" in error.value.problem


def test_a_shaft_may_run_in_the_bore_of_another() -> None:
    made = coupled()
    outer = Section(0.08, 0.06, 0.06, 0.03, 0.03)
    hollow = tuple(
        dataclasses.replace(s, sections=(outer,), radius=0.03, point=(0.0, -0.06, 0.0)) if s.name == "in" else s
        for s in made.shafts
    )
    bores = {**made.rigid_bores, "in+": (0.0, -0.05, 0.0), "in-": (0.0, -0.09, 0.0)}
    drive = dataclasses.replace(made.driven, shaft="s0", bore="s0+")
    given = changed(made, shafts=hollow, rigid_bores=bores, couplings=(), drive=drive)
    with pytest.raises(InputError, match="is held by nothing"):  # and not for its room
        build_train(given)
    tight = tuple(
        dataclasses.replace(s, sections=(Section(0.08, 0.06, 0.06, 0.015, 0.015),)) if s.name == "in" else s
        for s in hollow
    )
    with pytest.raises(InputError, match="overlaps shaft"):
        build_train(changed(given, shafts=tight))


def test_gears_of_a_train_by_torque_tilt_as_those_of_one_by_speed() -> None:
    made = chain()
    names = [bore for shaft in made.shafts for bore in shaft.bores]
    springs = tuple(Bearing(name, (1e8 + 1e7 * i, 1e8, 2e8, 1e4, 1e4)) for i, name in enumerate(names))
    made = changed(made, bearings=springs)
    free = changed(made, drive=dataclasses.replace(made.driven, torque=constant(33.0)))
    (one,), (two,) = (misalignments(build_train(x)) for x in (made, free))
    assert abs(one.in_plane) > 1e-6
    assert two.in_plane == pytest.approx(one.in_plane, rel=1e-6)
    assert two.across == pytest.approx(one.across, rel=1e-6)


def test_a_machine_twists_the_elastic_shaft_up_to_its_place() -> None:
    """From its gear, an elastic shaft twists by T l/(G I_p) up to the machine that is loaded."""
    made = train([(20, 30)])
    section = Section(0.09, 0.02, 0.02, 0.0, 0.0, young=206e9, poisson=0.3, density=7850.0)
    output = dataclasses.replace(made.shafts[1], sections=(section,))
    saw = dataclasses.replace(BRAKE, along=-0.045)
    loads = (dataclasses.replace(made.loads[0], torque=constant(TORQUE), machine="brake"),)
    made = changed(made, shafts=(made.shafts[0], output), machines=(saw,), loads=loads)
    model = build_train(made)
    q, place = sampled(static_state(model)), made.gears[1].along
    gear = q[model.first[1] : model.first[1] + model.shafts[1].size] @ model.shafts[1].turn_rows(place)[2]
    turned = q @ model.driveline.machines[0] - gear
    shear = 206e9 / 2.6
    polar = math.pi * 0.02**4 / 32.0
    twist = TORQUE * (place + 0.045) / (shear * polar) + TORQUE / BRAKE.stiffness
    assert turned == pytest.approx(twist, rel=1e-6)
    with pytest.raises(InputError, match=r"machine 'brake' y_mm: is required: shaft 's1' is elastic"):
        build_train(changed(made, machines=(BRAKE,)))
    with pytest.raises(InputError, match=r"machine 'brake' y_mm = 80.0: must be on shaft 's1', from -45 to 45 mm"):
        build_train(changed(made, machines=(dataclasses.replace(BRAKE, along=0.08),)))


WRONG: list[tuple[dict[str, Any], str]] = [
    ({"machines": (MOTOR, MOTOR)}, "machine 'motor': is named twice"),
    ({"machines": (dataclasses.replace(MOTOR, shaft="s9"), BRAKE)}, "machine 'motor': names an unknown shaft 's9'"),
    ({"machines": (dataclasses.replace(MOTOR, inertia=0.0), BRAKE)}, "machine 'motor' inertia = 0.0: .*> 0"),
    ({"machines": (dataclasses.replace(MOTOR, stiffness=math.inf), BRAKE)}, "machine 'motor' stiffness = inf"),
    ({"machines": (dataclasses.replace(MOTOR, damping=-1.0), BRAKE)}, "machine 'motor' damping = -1.0: .*>= 0"),
    ({"machines": (dataclasses.replace(MOTOR, initial_speed=1.0), BRAKE)}, "motor' initial speed = 1.0: contradicts"),
    ({"machines": (BRAKE,)}, "drive machine: unknown name 'motor'"),
    ({"couplings": (Coupling("c", ("s0", "s0"), 1e4),)}, "coupling 'c' = 's0': names one shaft twice"),
    ({"couplings": (Coupling("c", ("s0", "s1"), 1e4),)}, "coupling 'c': shafts 's0' and 's1' are 62.5 mm apart"),
    ({"loads": (Load("s1", None, constant(1.0), slope=-1.0),)}, "load on 's1' slope = -1.0: .*runs away"),
    (
        {"drive": Drive("s0", "s0+", constant(1.0), torque=constant(1.0)),
         "loads": (Load("s1", None, constant(1.0), ((1.0, 1.0, 0.0),)),)},
        "load on 's1' orders: follow a prescribed speed",
    ),
    ({"drive": Drive("s0", "s0+", constant(1.0), slope=1.0)}, "drive slope = 1.0: is of a drive by torque"),
    ({"drive": Drive("s0", "s0+", constant(1.0), 1e4, torque=constant(1.0))}, "drive stiffness.*conflicts with a torq"),
    (
        {"drive": Drive("s0", "s0+", constant(1.0), torque=constant(1.0)), "damping": Damping(alpha=1.0)},
        "damping alpha = 1.0: would brake the rotation itself",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "message"), WRONG, ids=range(len(WRONG)))
def test_mistakes_of_a_driveline_are_named(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        build_train(changed(chain(), **changes))


# --- job files ------------------------------------------------------------------------------------------------------

MACHINES = {
    "motor": {"shaft": "s1", "inertia_kg_m2": 4e-3, "stiffness_Nm_per_rad": 2.5e4, "damping_Nm_s_per_rad": 1.5},
    "saw": {"shaft": "s4", "inertia_kg_m2": 9e-3, "stiffness_Nm_per_rad": 4e4},
}


def job(**changes: Any) -> dict[str, Any]:
    made = tables(**{"machines": MACHINES, **changes})
    for name in made["meshes"]:
        made["meshes"][name]["stiffness_N_per_m"] = 3e8
    made["train"]["curves"] = {}
    return made


def test_machines_and_torques_of_a_file(tmp_path: Path) -> None:
    made = job(
        train__drive={
            "shaft": "s1", "machine": "motor", "speed_rad_per_s": 100.0, "torque_Nm": {"sines": [], "constant": 50.0},
            "torque_slope_Nm_s_per_rad": 0.2,
        },
        train__loads=[{"shaft": "s4", "machine": "saw", "torque_Nm": 60.0, "torque_slope_Nm_s_per_rad": 0.1}],
    )  # fmt: skip
    (tmp_path / "box.toml").write_text(toml_document(made))
    found = job_train(read_train_job(tmp_path / "box.toml"), (3e8, 3e8, 3e8))
    assert found.machines[0] == Machine("motor", "s1", 4e-3, 2.5e4, 1.5)
    assert (found.driven.machine, found.driven.bore, found.driven.slope) == ("motor", None, 0.2)
    assert found.driven.torque is not None
    assert float(found.driven.torque(0.0)) == 50.0
    assert (found.loads[0].machine, found.loads[0].slope) == ("saw", 0.1)
    arguments = [
        "vibration",
        str(tmp_path / "box.toml"),
        "--out",
        str(tmp_path / "v"),
        "--no-pictures",
        "--no-estimate",
    ]
    assert main(arguments) == 0
    with (tmp_path / "v" / "response.csv").open() as stream:
        row = list(csv.DictReader(stream))[-1]
    assert {"machine_motor_speed_rad_per_s", "machine_saw_speed_rad_per_s", "machine_saw_torque_Nm"} <= row.keys()


def test_couplings_of_a_file(tmp_path: Path) -> None:
    made = job(
        shafts__s0={"x_mm": 0.0, "y_mm": -120.0, "length_mm": 90.0, "radius_mm": 8.0},
        bearings__s0_left={"shaft": "s0", "y_mm": -150.0},
        couplings={"clutch": {"shafts": ["s0", "s1"], "stiffness_Nm_per_rad": 3e4}},
        train__drive={"shaft": "s0", "attachment": "s0_left", "speed_rad_per_s": 100.0},
    )
    (tmp_path / "box.toml").write_text(toml_document(made))
    found = job_train(read_train_job(tmp_path / "box.toml"), (3e8, 3e8, 3e8))
    assert found.couplings == (Coupling("clutch", ("s0", "s1"), 3e4, 0.0),)
    ratios = dict(zip((s.name for s in found.shafts), found.kinematics.ratios, strict=True))
    assert ratios["s0"] == ratios["s1"] == 1


SOFT, LOAD = {"stiffness_Nm_per_rad": 1.0}, {"shaft": "s4", "torque_Nm": 1.0}
WRONG_KEYS: list[tuple[dict[str, Any], str]] = [
    ({"machines__motor__shaft": "s9"}, r"machines\.motor\.shaft: unknown name 's9'; known names: s1, s2, s3, s4"),
    ({"machines__motor__shaft": None}, r"machines\.motor\.shaft: is required"),
    ({"machines__motor__inertia_kg_m2": 0.0}, r"machines\.motor\.inertia_kg_m2 = 0.0: must be finite and > 0"),
    ({"machines__motor__inertia_kg_m2": None}, r"machines\.motor\.inertia_kg_m2: is required"),
    ({"machines__motor__stiffness_Nm_per_rad": -1.0}, r"machines\.motor\.stiffness_Nm_per_rad = -1.0: must be finite"),
    ({"machines__motor__damping_Nm_s_per_rad": -1.0}, r"machines\.motor\.damping_Nm_s_per_rad = -1.0: must be fin"),
    ({"machines__motor__inertia": 1.0}, r"machines\.motor: unknown name 'inertia'; did you mean 'inertia_kg_m2'"),
    ({"machines__a b": {}}, r"name in \[machines\] = 'a b'"),
    ({"machines": {}}, r"\[machines\]: is empty"),
    ({"couplings__c": {"shafts": ["s1"], **SOFT}}, r"couplings\.c\.shafts.*must have 2 entries"),
    ({"couplings__c": {"shafts": ["s1", "s1"], **SOFT}}, r"couplings\.c\.shafts.*one shaft twice"),
    ({"couplings__c": {"shafts": ["s1", "s8"], **SOFT}}, r"couplings\.c\.shafts: unknown name 's8'"),
    ({"couplings": {"c": {"shafts": ["s1", "s2"]}}}, r"couplings\.c\.stiffness_Nm_per_rad: is required"),
    ({"couplings__c": {"shafts": ["s1", "s2"], **SOFT}}, r"coupling 'c': shafts .* 55 mm apart"),
    ({"train__drive__machine": "saw"}, r"train\.drive\.machine: unknown name 'saw'.*motor"),
    (
        {"train__drive": {"shaft": "s1", "machine": "motor", "speed_rad_per_s": 1.0, "y_mm": 7.0}},
        r"train\.drive\.y_mm = 7.0: conflicts with machine",
    ),
    ({"train__loads": [{**LOAD, "machine": "saw", "y_mm": 7.0}]}, r"loads\[0\]\.y_mm = 7.0: conflicts with machine"),
    ({"train__loads": [{**LOAD, "machine": "x"}]}, r"train\.loads\[0\]\.machine: unknown name 'x'"),
    ({"train__drive__torque_slope_Nm_s_per_rad": 1.0}, r"torque_slope_Nm_s_per_rad = 1.0: is of a torque"),
    (
        {"train__drive__torque_Nm": 1.0, "train__drive__stiffness_Nm_per_rad": 1e4},
        r"train\.drive\.stiffness_Nm_per_rad = 10000.0: conflicts with torque_Nm",
    ),
    (
        {"train__machines": [{"name": "m", "shaft": "s1", "inertia_kg_m2": 1.0, "stiffness_Nm_per_rad": 1.0}]},
        r"\[\[train\.machines\]\]: conflicts with \[machines\.NAME\]",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "message"), WRONG_KEYS, ids=range(len(WRONG_KEYS)))
def test_mistakes_of_a_file_name_key_value_and_cure(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    (tmp_path / "box.toml").write_text(toml_document(job(**changes)))
    with pytest.raises(InputError, match=message):
        build_train(job_train(read_train_job(tmp_path / "box.toml"), (3e8, 3e8, 3e8)))
