"""Sun, ring and carrier as driven, loaded, fixed, guided and free members, and rings as drivers of their meshes.

Speeds and torques are those of Willis, z_s w_s + z_r w_r = (z_s + z_r) w_c and T_s : T_r : T_c = z_s : z_r :
-(z_s + z_r), in fractions; with stepped planets z_s z_2 replaces z_s, and z_1 z_r replaces z_r.
"""

from __future__ import annotations

import copy
import dataclasses
import itertools
import json
import math
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.base.tables.jobs import meshes_of, train_tables
from gearfe.cli.main import main
from gearfe.drivetrain.gearbox.job import job_train, train_job
from gearfe.drivetrain.gearbox.mesh_loads import drive_speed, mesh_loads
from gearfe.drivetrain.gearbox.mesh_stiffness import train_curves
from gearfe.drivetrain.train import Drive, GearMesh, Guide, TrainModel, build_train, simulate
from gearfe.drivetrain.train.misalignment import static_state
from gearfe.gears.geometry.pair import pair_of
from gearfe.multibody import constant, smoothed_step
from tests.campaigns.toml_text import toml_text
from tests.makers.files import job_file
from tests.makers.planetary import ALPHA, LIN_PARKER, MODULE, SPEED, stage

F = Fraction
MODULE_MM = 2.0
MEMBERS = ("sun", "ring", "arm")
#: Teeth of sun, planet (both gears) and ring: a simple stage, and one with stepped planets.
SIMPLE, STEPPED = (18, 12, 12, 42), (21, 30, 15, 66)


def gear(teeth: int, shaft: str, y: float = 0.0) -> dict[str, Any]:
    form = {"module_mm": MODULE_MM, "pressure_angle_deg": 25.0, "face_width_mm": 20.0, "addendum": 0.8, "dedendum": 1.1}
    held = {"rim_diameter_mm": MODULE_MM * (14 - teeth)} if teeth < 0 else {"bore_diameter_mm": 0.6 * teeth}
    return {"teeth": teeth, **form, "rack_tip_radius": 0.15, **held, "shaft": shaft, "y_mm": y}


def member(x: float = 0.0, y: float = 0.0, **keys: Any) -> dict[str, Any]:
    inertia = {"mass_kg": 2.0, "polar_inertia_kg_m2": 2e-3, "transverse_inertia_kg_m2": 2e-3}
    return {"x_mm": x, "y_mm": y, "length_mm": 60.0, "radius_mm": 4.0, **inertia, **keys}


def mesh(driver: str, driven: str) -> dict[str, Any]:
    return {"driver": driver, "driven": driven, "stiffness_N_per_m": 4e8, "backlash_um": 60.0}


def tables(teeth: tuple[int, int, int, int] = SIMPLE, tail: str = "", at: float = 0.0) -> dict[str, Any]:
    """A stage with three planets, its parts named with a tail and `at` mm along the axis."""
    sun, one, two, ring = teeth
    apart = 0.0 if one == two else 15.0
    gears = {"sun": gear(sun, "sun" + tail, at - apart), "planet": gear(one, "planet" + tail, at - apart)}
    gears |= {"ring": gear(-ring, "ring" + tail, at + apart)}
    if apart:
        gears["second"] = gear(two, "planet" + tail, at + apart)
    spring = {"stiffness_N_per_m": [2e8, 2e8, 2e8], "tilt_stiffness_Nm_per_rad": [1e6, 1e6]}
    places = {"sun": at - apart, "ring": at + apart, "arm": at}
    arm = 0.5 * MODULE_MM * (sun + one)
    pin = {"pin_stiffness_N_per_m": [2e8, 2e8, 2e8], "pin_tilt_stiffness_Nm_per_rad": [1e6, 1e6]}
    return {
        "gears": {name + tail: entry for name, entry in gears.items()},
        "meshes": {
            "inner" + tail: mesh("sun" + tail, "planet" + tail),
            "outer" + tail: mesh(("second" if apart else "planet") + tail, "ring" + tail),
        },
        "shafts": {name + tail: member(y=y) for name, y in places.items()}
        | {"planet" + tail: member(arm, at, carrier="arm" + tail)},
        "carriers": {"arm" + tail: {"shaft": "arm" + tail, "planets": 3, **pin}},
        "bearings": {name + tail: {"shaft": name + tail, "y_mm": y, **spring} for name, y in places.items()},
    }


def two_stages() -> dict[str, Any]:
    """The carrier of the first one drives the sun of the second one, of 20/13/46 teeth."""
    first, second = tables(), tables((20, 13, 13, 46), "2", 200.0)
    joined = {kind: first[kind] | second[kind] for kind in first}
    return {**joined, "couplings": {"both": {"shafts": ["arm", "sun2"], "stiffness_Nm_per_rad": 1e5}}}


def roles(raw: dict[str, Any], drive: str, load: str, torque: float, **held: Fraction | int) -> dict[str, Any]:
    """A job in which one shaft is driven and one loaded; others are held at ratios of the drive's speed."""
    raw = copy.deepcopy(raw)
    for name, ratio in held.items():
        raw["shafts"][name]["speed_ratio"] = str(ratio) if ratio else 0
    raw["train"] = {
        "housing": "rigid",
        "duration_ms": 3.0,
        "step_us": 20.0,
        "drive": {"shaft": drive, "attachment": drive, "speed_rad_per_s": 100.0},
        "loads": [{"shaft": load, "attachment": load, "torque_Nm": torque}],
        "damping": {"ratio": 0.02},
    }
    return raw


def built(raw: dict[str, Any], folder: Path = Path()) -> TrainModel:
    path = folder / "job.toml"
    job = train_job(path, train_tables(copy.deepcopy(raw), path))
    return build_train(job_train(job, train_curves(job)))


def static_forces(model: TrainModel) -> np.ndarray:
    q = static_state(model)
    assert q is not None
    return np.array([line.mean * (line.row @ q) for line in model.meshes])


@pytest.mark.parametrize("teeth", [SIMPLE, STEPPED])
@pytest.mark.parametrize("ratio", [F(0), F(-1, 3), F(1, 2)])
@pytest.mark.parametrize(("drive", "held", "load"), list(itertools.permutations(MEMBERS)))
def test_every_member_in_every_role(
    teeth: tuple[int, int, int, int], ratio: Fraction, drive: str, held: str, load: str
) -> None:
    """Fixed, or a differential with two inputs; the load brakes or pulls: speeds and torques exact, forces to 1e-9."""
    sun, one, two, ring = teeth
    share = {"sun": F(sun * two), "ring": F(one * ring), "arm": F(-sun * two - one * ring)}
    speed = {drive: F(1), held: ratio}
    speed[load] = -sum(share[name] * speed[name] for name in (drive, held)) / share[load]
    for torque in (50.0, -50.0):
        model = built(roles(tables(teeth), drive, load, torque, **{held: ratio}))
        train, rolled = model.train, model.kinematics.rolling
        assert {name: rolled.ratios[train.shaft_number(name)] for name in MEMBERS} == speed
        assert rolled.reactions(train.shaft_number(load)) == (share[drive] / share[load], share[held] / share[load])
        sun_torque = torque * float(share["sun"] / share[load])
        radius = {gear.name: gear.gear.base_radius for gear in train.gears}
        inner = abs(sun_torque) / (3.0 * radius["sun"])
        second = radius.get("second_1", radius["planet_1"])
        expected = np.repeat([inner, inner * radius["planet_1"] / second], 3)
        np.testing.assert_allclose(static_forces(model), expected, rtol=1e-9)


@pytest.mark.parametrize(
    ("drive", "load", "held", "ratio"),
    [
        ("sun", "arm2", ("ring", "ring2"), F(3, 10) * F(10, 33)),
        ("arm2", "sun", ("ring", "ring2"), F(10, 3) * F(33, 10)),
        ("ring", "ring2", ("sun", "arm2"), F(42, 60) * F(-20, 46)),
        ("ring2", "ring", ("sun", "arm2"), F(-46, 20) * F(60, 42)),
        ("ring", "arm2", ("sun", "ring2"), F(42, 60) * F(20, 66)),
    ],
)
def test_two_coupled_stages_in_every_direction(drive: str, load: str, held: tuple[str, ...], ratio: Fraction) -> None:
    """Ratios multiply, powers of drive and load are equal, and planets of each stage share alike to 1e-9."""
    model = built(roles(two_stages(), drive, load, -60.0, **dict.fromkeys(held, 0)))
    number = model.train.shaft_number(load)
    rolled = model.kinematics.rolling
    assert rolled.ratios[number] == ratio
    assert rolled.reactions(number)[0] == -ratio
    force = static_forces(model).reshape(4, 3)
    np.testing.assert_allclose(force, force.mean(axis=1, keepdims=True) * np.ones(3), rtol=1e-9)
    np.testing.assert_allclose(force.ravel(), model.kinematics.steady_forces, rtol=1e-9)


@pytest.mark.parametrize(("drive", "held", "load"), list(itertools.permutations(("sun", "ring", "carrier"))))
def test_the_power_of_every_drive_balances(drive: str, held: str, load: str) -> None:
    """Work of drive and load is the rise of the energy to 1e-9, in hinges and without damping."""
    size = {"sun": 30.0, "ring": 102.0, "carrier": -132.0}
    ramp = smoothed_step(1e-3, 2e-3, 40.0 * math.copysign(1.0, size[drive] * size[load]))
    given = stage(pin=None, bearing=None, ring=None, guides=(Guide(held),))
    train = dataclasses.replace(
        given,
        drive=Drive(drive, drive, constant(SPEED)),
        loads=(dataclasses.replace(given.loads[0], shaft=load, bore=load, torque=ramp),),
    )
    t = np.linspace(0.0, 4e-3, 6401)
    response = simulate(build_train(train), t, tolerance=1e-11, method="taylor")
    base = 0.5 * MODULE * math.cos(ALPHA)
    radius = {"sun": 30 * base, "ring": 102 * base, "carrier": 33 * MODULE, "planet": 36 * base}
    inertia = {name: LIN_PARKER[name][1] * r**2 for name, r in radius.items()}
    inertia["carrier"] += 3 * LIN_PARKER["planet"][0] * radius["carrier"] ** 2
    speed = dict(zip(response.shaft_names, response.speed_absolute.T, strict=True))
    kinetic = sum(0.5 * inertia[name.rstrip("012")] * rate**2 for name, rate in speed.items())
    energy = kinetic + 0.5 * (response.contact_force**2).sum(axis=1) / 5e8
    power = response.drive_torque * speed[drive] + ramp(t) * speed[load]
    work = (t[1] - t[0]) / 3.0 * (power[0:-2:2] + 4 * power[1:-1:2] + power[2::2]).cumsum()
    assert np.abs(power).max() > 10.0
    room = 1e-9 * (np.abs(power).max() * t[-1] + np.abs(energy).max())
    np.testing.assert_allclose(energy[2::2] - energy[0], work, atol=room)


# --- a ring that drives its mesh ------------------------------------------------------------------------------------


def pair_of_two(driver: str, drive: str, torque: float, speed: float = 100.0, **keys: Any) -> dict[str, Any]:
    """A planet and a ring on fixed axes."""
    raw = tables()
    raw["shafts"]["planet"].pop("carrier")
    raw["bearings"]["planet"] = raw["bearings"]["arm"] | {"shaft": "planet"}
    entry = {"driver": driver, "driven": {"planet": "ring", "ring": "planet"}[driver], **keys}
    made = {
        "gears": {name: raw["gears"][name] for name in ("planet", "ring")},
        "meshes": {"outer": entry if "mesh_table" in keys else {"stiffness_N_per_m": 4e8, **entry}},
        "shafts": {name: raw["shafts"][name] for name in ("planet", "ring")},
        "bearings": {name: raw["bearings"][name] for name in ("planet", "ring")},
    }
    made = roles(made, drive, "ring" if drive == "planet" else "planet", torque)
    made["train"]["drive"]["speed_rad_per_s"] = speed
    return made


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_ring_drives_a_pinion_on_fixed_axes(sign: float) -> None:
    """It pushes in its sense of rotation, its mate against its own; the other roles are named in the error."""
    model = built(pair_of_two("ring", "ring", -sign * 30.0, sign * 100.0))
    assert model.train.meshes[0].ring_drives
    assert model.kinematics.senses == (-sign,)
    assert model.kinematics.ratios == (F(42, 12), F(1))
    planet = model.train.gear("planet").gear
    np.testing.assert_allclose(static_forces(model), [30.0 / planet.base_radius], rtol=1e-9)
    with pytest.raises(InputError, match=r"gear 'ring' drives gear 'planet'.*exchange driver and driven"):
        built(pair_of_two("planet", "ring", -sign * 30.0, sign * 100.0))
    with pytest.raises(InputError, match=r"gear 'planet' drives gear 'ring'.*exchange driver and driven"):
        built(pair_of_two("ring", "planet", -sign * 30.0, sign * 100.0))


def test_a_ring_may_be_the_driver_in_a_planetary_stage() -> None:
    """There it is a name: phases, senses and forces are those of the other order."""
    plain = roles(tables(), "ring", "arm", -50.0, sun=0)
    other = copy.deepcopy(plain)
    other["meshes"]["outer"] |= {"driver": "ring", "driven": "planet"}
    one, two = built(plain), built(other)
    assert one.kinematics.senses == two.kinematics.senses
    np.testing.assert_allclose(two.kinematics.phases, one.kinematics.phases, atol=1e-12)
    np.testing.assert_allclose(static_forces(two), static_forces(one), rtol=1e-12)


def test_a_mesh_of_the_python_interface_may_have_a_ring_as_driver() -> None:
    given = stage()
    meshes = tuple(
        dataclasses.replace(mesh, driver="ring", driven=mesh.driver, name="") if mesh.driven == "ring" else mesh
        for mesh in given.meshes
    )
    train = dataclasses.replace(given, meshes=meshes)
    assert [mesh.name for mesh in train.meshes[3:]] == ["ring-planet0", "ring-planet1", "ring-planet2"]
    assert isinstance(train.meshes[3], GearMesh)
    np.testing.assert_allclose(static_forces(build_train(train)), static_forces(build_train(given)), rtol=1e-12)


def test_loads_for_ratings_are_those_of_the_gear_that_drives() -> None:
    """Torque, speed against the housing in 1/min, and the speed of the drive that belongs to it."""
    for driver, torque, speed in (("planet", 50.0 * 12 / 42, 100.0), ("ring", 50.0, 100.0)):
        raw = pair_of_two(driver, driver, -50.0 if driver == "planet" else -50.0 * 12 / 42)
        job = train_job("job.toml", train_tables(raw, "job.toml"))
        load = mesh_loads(job.rigid_train)["outer"]
        assert load.drives == (driver == "ring")
        assert load.torque == pytest.approx(torque, rel=1e-12)
        assert load.speed == pytest.approx(speed * 30.0 / math.pi, rel=1e-12)
        assert drive_speed(job, "outer", load.speed) == (1, pytest.approx(speed, rel=1e-12))


@pytest.mark.parametrize("backlash", [None, 80.0])
def test_phase_and_table_of_a_ring_that_drives_follow_its_rotation(tmp_path: Path, backlash: float | None) -> None:
    """k over the ring's rotation past a tooth on the line of centres, from the phase that is given."""
    fraction = np.arange(2000) / 2000.0

    def stiffness(part: np.ndarray) -> np.ndarray:
        return np.asarray(4e8 * (1.0 + 0.2 * np.cos(2 * np.pi * part) + 0.1 * np.sin(4 * np.pi * part)))

    rows = [f"{x:.12g},{k:.12g},0" for x, k in zip(fraction, stiffness(fraction), strict=True)]
    text = "fraction_of_pitch,k_mesh_N_per_m,transmission_error_unloaded_um\n" + "\n".join(rows)
    (tmp_path / "mesh.csv").write_text(text + "\n", encoding="utf-8")
    keys = {"mesh_table": "mesh.csv", "phase_deg": 1.25}
    model = built(
        pair_of_two("ring", "ring", -30.0, **keys, **({} if backlash is None else {"backlash_um": backlash})), tmp_path
    )
    turned = np.linspace(0.0, 0.4, 37)
    part = (math.radians(1.25) + turned) / (2 * math.pi / 42)
    np.testing.assert_allclose(model.meshes[0].stiffness(turned), stiffness(part), rtol=2e-6)


def test_a_given_phase_of_a_ring_that_contradicts_its_teeth_is_refused_with_that_of_the_ring() -> None:
    raw = roles(tables(), "ring", "arm", -50.0, sun=0)
    raw["meshes"]["outer"] |= {"driver": "ring", "driven": "planet", "phase_deg": 1.0}
    raw["meshes"]["inner"]["phase_deg"] = 2.0
    with pytest.raises(InputError, match=r"phase_deg = 1.*which make it ([0-9.]+) deg") as refused:
        built(raw)
    raw["meshes"]["outer"]["phase_deg"] = float(refused.value.problem.split("make it ")[1].split(" deg")[0])
    built(raw)


def test_a_ring_that_drives_is_the_wheel_of_its_contact(tmp_path: Path) -> None:
    """Contact laws, stiffness.csv and its torque_Nm have the external gear as pinion, whoever drives."""
    raw = {kind: pair_of_two("ring", "ring", -30.0)[kind] for kind in ("gears", "meshes")}
    for name in ("planet", "ring"):
        raw["gears"][name].pop("shaft")
        raw["gears"][name].pop("y_mm")
    raw["meshes"]["outer"] = {"driver": "ring", "driven": "planet", "stiffness": {"torque_Nm": 40.0}}
    (named,) = meshes_of(raw, tmp_path / "job.toml", None, None)
    pair = pair_of(named)
    assert (pair.pinion.teeth, pair.wheel.teeth) == (12, -42)
    assert named.described == "mesh outer: ring drives planet"


@pytest.mark.parametrize(("drive", "ratio"), [("planet", F(12, 42)), ("ring", F(42, 12))])
def test_the_power_of_a_mesh_is_that_of_its_driver(drive: str, ratio: Fraction) -> None:
    raw = pair_of_two(drive, drive, -30.0)
    raw["train"]["damping"]["ratio"] = 0.5
    response = simulate(built(raw), np.linspace(0.0, 2e-2, 201), tolerance=1e-8)
    assert response.mesh_power[-1, 0] == pytest.approx(30.0 * 100.0 * float(ratio), rel=1e-6)


@pytest.mark.parametrize("drive", ["ring", "planet"])
def test_the_angle_of_a_load_with_orders_of_a_mesh_is_that_of_its_driver(drive: str) -> None:
    """5 N m sin(z (phase + rotation)) of the gear that drives, from its given phase."""
    raw = pair_of_two(drive, drive, -30.0, phase_deg=1.25)
    raw["train"]["loads"][0] |= {"orders_Nm_deg": [[1.0, 5.0, 0.0]], "mesh": "outer"}
    teeth, t = {"ring": 42, "planet": 12}[drive], np.linspace(0.0, 1e-2, 33)
    total = sum(torque(t) for _, torque in built(raw).forces.torques)
    expected = -30.0 + 5.0 * np.sin(teeth * (math.radians(1.25) + 100.0 * t))
    np.testing.assert_allclose(total, expected, rtol=1e-9)


@pytest.mark.parametrize(("drive", "load", "rate"), [("sun", "arm", F(42, 60)), ("arm", "sun", F(42, 18))])
def test_orders_of_a_mesh_of_a_stage_follow_its_rotation_whichever_flanks_it_presses(
    drive: str, load: str, rate: Fraction
) -> None:
    """The first tooth of the sun begins on the line of centres; rotation of the sun against the carrier."""
    raw = roles(tables(), drive, load, -50.0, ring=0)
    raw["meshes"]["inner"]["phase_deg"] = 2.0
    raw["train"]["loads"][0] |= {"orders_Nm_deg": [[1.0, 5.0, 0.0]], "mesh": "inner_1"}
    model = built(raw)
    t = np.linspace(0.0, 1e-2, 33)
    total = sum(torque(t) for _, torque in model.forces.torques)
    begin = 2.0 if drive == "sun" else -2.0  # a phase is given in the sense in which the sun pushes
    expected = -50.0 + 5.0 * np.sin(18 * (math.radians(begin) + 100.0 * float(rate) * t))
    np.testing.assert_allclose(total, expected, rtol=1e-9)


def test_orders_count_turns_of_a_shaft_that_turns(tmp_path: Path) -> None:
    """The sun, the first shaft, is fixed: orders are those of the next one, here the ring, and finite."""
    raw = roles(tables(), "ring", "arm", -50.0, sun=0)
    raw["train"]["drive"]["speed_rad_per_s"] = 1000.0
    raw["train"] |= {"duration_ms": 20.0, "step_us": 50.0}
    raw["spectrum"] = {"order_turns": 1.0}
    path = job_file(tmp_path, toml_text(raw))
    out = tmp_path / "out"
    assert main(["vibration", str(path), "--out", str(out), "--no-pictures", "--no-estimate", "-q"]) == 0
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    header = (out / "order_tracks.csv").read_text(encoding="utf-8").splitlines()[0]
    assert "inf" not in header
    assert "nan" not in header
    near = [line["order_of_first_shaft"] for lines in summary["dominant_lines"].values() for line in lines]
    assert all(order is not None and math.isfinite(order) for order in near)
