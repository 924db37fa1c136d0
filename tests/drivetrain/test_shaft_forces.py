"""Constant forces on shafts: deflections and reactions of beams, in statics, transients and run-ups."""

from __future__ import annotations

import math
import tomllib
from typing import Any

import numpy as np
import pytest

from gearfe import Gear, InputError, build_train, constant, simulate, steady_state
from gearfe.base.tables.examples import job_file
from gearfe.base.tables.jobs import train_tables
from gearfe.drivetrain.gearbox.job import job_train, train_job
from gearfe.drivetrain.train import Bearing, Damping, Drive, GearTrain, Shaft, ShaftForce, ShaftGear
from gearfe.drivetrain.train.misalignment import static_bearing_loads, static_state
from gearfe.drivetrain.train.model import TrainModel
from gearfe.fem.beams import Section
from gearfe.multibody import TimeFunction, smoothed_step

#: A steel shaft of 30 mm, 400 mm long from y = 0, on knife edges at y = 50 and 350 mm (m, Pa, kg/m3).
LENGTH, SPAN, DIAMETER, YOUNG, POISSON, DENSITY = 0.4, 0.3, 0.03, 200e9, 0.3, 7850.0


GEAR = Gear(30, 2e-3, math.radians(20.0), 10e-3, bore_diameter=DIAMETER)


def beam(y: float, *, axial: float = 1e9, ramp: TimeFunction | None = None, **values: float) -> TrainModel:
    """The shaft under a force (N) and moment (N m) at y (m); knife edges are stiff across it and free to tilt."""
    section = Section(LENGTH, DIAMETER, DIAMETER, young=YOUNG, poisson=POISSON, density=DENSITY)
    middle, places = (0.0, 0.5 * LENGTH, 0.0), {"left": (0.0, 0.05, 0.0), "right": (0.0, 0.35, 0.0)}
    names = ("force_x", "force_y", "force_z", "moment_x", "moment_y", "moment_z")
    loads = tuple(values.get(name, 0.0) for name in names)
    assert set(values) <= set(names)
    bearings = tuple(Bearing(name, (1e12, along, 1e12, 0.0, 0.0)) for name, along in (("left", axial), ("right", 0.0)))
    return build_train(
        GearTrain(
            shafts=(Shaft("spindle", middle, LENGTH, 0.5 * DIAMETER, tuple(places), DENSITY, sections=(section,)),),
            gears=(ShaftGear("disc", "spindle", 0.02, GEAR, DENSITY),),  # a train has one; it bends nothing
            meshes=(),
            drive=Drive("spindle", None, constant(100.0), along=0.2),
            rigid_bores=places,
            bearings=bearings,
            damping=Damping(beta=3e-4),
            forces=(ShaftForce("spindle", y, loads, ramp or constant(1.0)),),
        )
    )


def model_of(raw: dict[str, Any]) -> TrainModel:
    """Train of a job whose meshes have a constant stiffness."""
    job = train_job("job", train_tables(raw, "job"))
    return build_train(job_train(job, [2e8] * len(job.meshes)))


def deflection(model: TrainModel, y: float) -> np.ndarray:
    """Displacement and rotation of the section at y (m) along x, y, z."""
    q = static_state(model)
    assert q is not None
    rows = model.placed.bodies[0].section_rows(np.array([y]), model.train.frame)[0]
    return rows @ q[: rows.shape[1]]


def stiffness() -> tuple[float, float]:
    """E I (N m2), and shear stiffness kappa G A (N) of a round section, Cowper's kappa = 6 (1 + nu)/(7 + 6 nu)."""
    area = math.pi / 4.0 * DIAMETER**2
    kappa = 6.0 * (1.0 + POISSON) / (7.0 + 6.0 * POISSON)
    return YOUNG * math.pi / 64.0 * DIAMETER**4, kappa * YOUNG / (2.0 * (1.0 + POISSON)) * area


@pytest.mark.parametrize(("key", "axis"), [("force_x", 0), ("force_z", 2)])
def test_a_force_between_two_bearings(key: str, axis: int) -> None:
    """F L^3/(48 E I) of bending and F L/(4 kappa G A) of shear in the middle; half of the force in each bearing."""
    model = beam(0.2, **{key: 1000.0})
    EI, GA = stiffness()
    expected = 1000.0 * SPAN**3 / (48.0 * EI) + 1000.0 * SPAN / (4.0 * GA)
    assert deflection(model, 0.2)[axis] == pytest.approx(expected, rel=2e-4)
    q = static_state(model)
    loads = static_bearing_loads(model, q)
    assert loads["left"][axis] == pytest.approx(500.0)
    assert loads["right"][axis] == pytest.approx(500.0)


def test_an_overhung_force() -> None:
    """A belt at the end: F c^2 (L + c)/(3 E I) + shear there, bearing forces F (L + c)/L and -F c/L."""
    model = beam(0.4, force_z=-800.0)
    EI, GA = stiffness()
    c = 0.05
    expected = -800.0 * (c**2 * (SPAN + c) / (3.0 * EI) + (c + c**2 / SPAN) / GA)
    assert deflection(model, 0.4)[2] == pytest.approx(expected, rel=2e-4)
    loads = static_bearing_loads(model, static_state(model))
    assert loads["right"][2] == pytest.approx(-800.0 * (SPAN + c) / SPAN)
    assert loads["left"][2] == pytest.approx(800.0 * c / SPAN)


@pytest.mark.parametrize(("key", "axis", "other", "sign"), [("moment_x", 3, 2, 1.0), ("moment_z", 5, 0, -1.0)])
def test_a_moment_in_the_middle(key: str, axis: int, other: int, sign: float) -> None:
    """Rotation M L/(12 E I) where it acts, beside shear; bearing forces M/L in opposite directions.

    On the shaft they have the moment -M: about x, y x z = x and z of +y at larger y.
    """
    model = beam(0.2, **{key: 60.0})
    EI, GA = stiffness()
    expected = 60.0 * SPAN / (12.0 * EI) + 60.0 / (SPAN * GA)
    assert deflection(model, 0.2)[axis] == pytest.approx(expected, rel=2e-2)
    loads = static_bearing_loads(model, static_state(model))
    assert loads["right"][other] == pytest.approx(sign * 60.0 / SPAN)
    assert loads["left"][other] == pytest.approx(-sign * 60.0 / SPAN)


def test_a_force_along_the_shaft() -> None:
    """The bearing that holds the shaft along its axis carries all of it."""
    loads = static_bearing_loads(model := beam(0.39, force_y=250.0), static_state(model))
    assert loads["left"][1] == pytest.approx(250.0)
    assert loads["right"][1] == pytest.approx(0.0, abs=1e-6)


def test_a_transient_settles_at_the_static_state() -> None:
    """With a ramp and damping the forces of the bearings end at those of statics."""
    model = beam(0.4, force_x=500.0, ramp=smoothed_step(5e-3, 10e-3, 1.0))
    response = simulate(model, np.linspace(0.0, 40e-3, 801))
    static = static_bearing_loads(model, static_state(model))
    columns = response.bearing_forces()
    for name, load in static.items():
        forces = np.column_stack([columns[f"bearing_{name}_force_{axis}_N"] for axis in "xyz"])
        assert forces[0] == pytest.approx(np.zeros(3), abs=1e-9)
        assert forces[-1] == pytest.approx(load[:3], rel=1e-4, abs=1e-2)


def gearbox(force: str) -> dict[str, Any]:
    """The gearbox that `gearfe new` writes, with a force on its output."""
    return tomllib.loads(job_file("gearbox") + f'\n[[train.forces]]\nshaft = "output"\n{force}\n')


def test_mesh_forces_do_not_change_but_bearing_forces_do() -> None:
    """In a gearbox the forces of the output's bearings change by those of a beam, all others and torques stay."""
    free, pulled = model_of(tomllib.loads(job_file("gearbox"))), model_of(gearbox("y_mm = 0.0\nforce_x_N = 300.0"))
    assert pulled.kinematics.steady_forces == pytest.approx(free.kinematics.steady_forces)
    before, after = (static_bearing_loads(model, static_state(model)) for model in (free, pulled))
    change = {name: after[name] - before[name] for name in before}
    of_output = [name for name in change if name in pulled.train.shaft("output").bores]
    assert sum(change[name][0] for name in of_output) == pytest.approx(300.0)
    places = {name: float(pulled.train.bore_points[name][1]) for name in of_output}
    assert sum(change[name][0] * places[name] for name in of_output) == pytest.approx(0.0, abs=1e-3 * 300.0)
    for name in change.keys() - set(of_output):
        assert change[name][:3] == pytest.approx(np.zeros(3), abs=1e-3)


@pytest.mark.parametrize(
    ("force", "words"),
    [
        ("y_mm = 0.0", "force and moment are zero"),
        ("y_mm = 1e4\nforce_x_N = 1.0", "must be on shaft 'output'"),
        ("y_mm = 0.0\nforce_x_N = inf", "finite"),
        ("y_mm = 0.0\nforce_x_N = 1.0\nramp_centre_ms = 2.0", "is the middle of a ramp, which has no width"),
    ],
)
def test_mistakes_are_named(force: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        model_of(gearbox(force))


@pytest.mark.parametrize("table", ["drive", "loads"])
def test_a_middle_of_a_ramp_without_width_is_named(table: str) -> None:
    """The width makes the ramp: without it the middle said nothing."""
    raw = tomllib.loads(job_file("gearbox"))
    entry = raw["train"][table] if table == "drive" else raw["train"][table][0]
    entry.pop("ramp_width_ms", None)
    entry["ramp_centre_ms"] = 2.0
    with pytest.raises(InputError, match=r"ramp_centre_ms.*has no width"):
        model_of(raw)


def test_means_begin_after_the_ramps_of_forces() -> None:
    """What is reported under load leaves out the ramp of a force, as it does that of a torque."""
    free = model_of(tomllib.loads(job_file("gearbox")))
    late = 1e3 * free.load_end + 3.0
    pulled = model_of(gearbox(f"y_mm = 0.0\nforce_x_N = 300.0\nramp_centre_ms = {late}\nramp_width_ms = 2.0"))
    assert pulled.load_end == pytest.approx(1e-3 * (late + 1.0))
    early = model_of(gearbox("y_mm = 0.0\nforce_x_N = 300.0"))
    assert early.load_end == free.load_end


def test_means_begin_after_the_ramp_of_the_drive() -> None:
    raw = tomllib.loads(job_file("gearbox"))
    late = 1e3 * model_of(raw).load_end + 3.0
    raw["train"]["drive"] |= {"ramp_centre_ms": late, "ramp_width_ms": 2.0}
    assert model_of(raw).load_end == pytest.approx(1e-3 * (late + 1.0))


@pytest.mark.parametrize(("table", "named"), [("drive", "drive"), ("loads", "load 1"), ("forces", "force 1")])
def test_a_ramp_that_begins_after_the_end_of_the_run_is_named(table: str, named: str) -> None:
    """A ramp of 2 ms about its middle: in a run of 0.1 ms it begins after the end, or before it."""
    raw = gearbox("y_mm = 0.0\nforce_x_N = 300.0")
    entry = raw["train"][table] if table == "drive" else raw["train"][table][0]
    for middle, late in ((3.0, True), (1.0, False)):
        entry |= {"ramp_centre_ms": middle, "ramp_width_ms": 2.0}
        said = simulate(model_of(raw), np.linspace(0.0, 1e-4, 3), method="taylor").warnings
        assert any(f"the ramp of the {named}" in text and "never acts" in text for text in said) == late


@pytest.mark.parametrize("number", [1, 2])
def test_the_force_that_is_refused_is_named_by_its_number(number: int) -> None:
    raw = gearbox("y_mm = 0.0\nforce_x_N = 1.0")
    raw["train"]["forces"] = 2 * raw["train"]["forces"]
    raw["train"]["forces"][number - 1] = raw["train"]["forces"][number - 1] | {"y_mm": 1e4}
    with pytest.raises(InputError, match=f"force {number} on"):
        model_of(raw)


def test_unknown_shafts_and_turning_frames_are_refused() -> None:
    raw = gearbox("y_mm = 0.0\nforce_x_N = 1.0")
    raw["train"]["forces"][0]["shaft"] = "ouput"
    with pytest.raises(InputError, match="unknown shaft 'ouput'"):
        model_of(raw)
    planetary = tomllib.loads(job_file("planetary"))
    sun = next(iter(planetary["shafts"]))
    planetary["train"]["forces"] = [{"shaft": sun, "y_mm": planetary["shafts"][sun].get("y_mm", 0.0), "force_x_N": 5.0}]
    with pytest.raises(InputError, match="frame of carrier"):
        model_of(planetary)


def test_a_shaft_that_nothing_holds_along_its_axis() -> None:
    with pytest.raises(InputError, match="held by nothing along its axis"):
        beam(0.2, axial=0.0, force_y=10.0)


def test_a_run_up_has_the_force_in_its_mean() -> None:
    """With constant mesh stiffnesses the mean bearing forces of a steady state are those of statics."""
    model = model_of(gearbox("y_mm = 0.0\nforce_x_N = 300.0\nforce_z_N = -40.0"))
    state = steady_state(model, 120.0)
    static = static_bearing_loads(model, static_state(model))
    for number, name in enumerate(model.bores):
        assert state.bearing[0].real[number][:3] == pytest.approx(static[name][:3], abs=1e-3)
