"""Gears and meshes by name: a gearbox is what its separate pairs are, and every mistake names key, value and cure."""

from __future__ import annotations

import math
import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.base.tables.jobs import job_tables, meshes_of, read_train_tables
from gearfe.base.tables.text import toml_document
from gearfe.drivetrain.gearbox.job import job_train, read_train_job
from gearfe.drivetrain.gearbox.mesh_stiffness import train_curves
from gearfe.drivetrain.train.checks import check_train
from gearfe.gears.gearmesh.job import read_stiffness_job, stiffness_job
from gearfe.gears.gearmesh.sweep import sweep_stiffness
from gearfe.gears.geometry.deviation_job import deviations_of
from gearfe.gears.geometry.pair import GearPair, pair_of
from tests.makers.gearboxes import GEARS, MESHES, SPEED, TORQUE, pair_text, text
from tests.places import DOCS, GEOMETRY

Z = {name: row[0] for name, row in GEARS.items()}


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("box") / "box.toml"
    made.write_text(text())
    return made


def carried() -> dict[str, float]:
    """Torque at the driven gear of each mesh by the numbers of teeth alone (N m)."""
    shaft = TORQUE * Z["pinion_2"] / Z["wheel_2"]  # of s3, that of the wheel of the first stage
    return {"in": shaft * Z["idler"] / Z["wheel_1"], "through": shaft, "out": TORQUE}


def test_stiffness_of_each_mesh_is_that_of_a_pair_of_its_own(path: Path, tmp_path: Path) -> None:
    """At the torque that the mesh carries, with the widths and materials of its own gears."""
    job = read_train_job(path)
    curves, train = train_curves(job), job_train(job)
    for mesh, force, curve in zip(train.meshes, train.kinematics.steady_forces, curves, strict=True):
        name, torque = mesh.name, abs(float(force)) * train.gear(mesh.driven).gear.base_radius
        assert torque == pytest.approx(carried()[name], rel=1e-12)
        (tmp_path / "pair.toml").write_text(pair_text(name, torque))
        pair = read_stiffness_job(tmp_path / "pair.toml")
        angles = pair.pair.mesh_cycle * np.arange(8) / 8
        alone = sweep_stiffness(pair.pair, pair.model, **{**pair.sweep, "angles": angles})
        assert curve.k_mesh == pytest.approx(alone.k_mesh, rel=1e-12)
        assert curve.transmission_error == pytest.approx(alone.transmission_error, rel=1e-12)
    assert len({round(curve.k_mesh.mean()) for curve in curves}) == 3


def test_steady_forces_and_speeds_follow_from_the_teeth(path: Path) -> None:
    train = job_train(read_train_job(path), (1e8, 1e8, 1e8))
    check_train(train)
    kinematics = train.kinematics
    for (name, torque), mesh, force in zip(carried().items(), train.meshes, kinematics.steady_forces, strict=True):
        module, teeth = GEARS[MESHES[name][1]][1], Z[MESHES[name][1]]
        base = 0.5e-3 * module * teeth * math.cos(math.radians(20.0))
        assert mesh.name == name
        assert force == pytest.approx(torque / base, rel=1e-12)
    ratios = [1.0, -Z["sun"] / Z["idler"], Z["sun"] / Z["wheel_1"]]
    ratios.append(-ratios[-1] * Z["pinion_2"] / Z["wheel_2"])
    assert [float(r) for r in kinematics.ratios] == pytest.approx(ratios, rel=1e-12)
    assert train.driven.speed(np.array([0.0]))[0] == SPEED


def test_phases_are_those_of_the_teeth(path: Path) -> None:
    """The idler has its teeth in one place: its second mesh begins where its first one and its teeth put it.

    A tooth of the sun stands on the line of centres, so a space of the idler faces it, less the twist by which the
    idler lags until its flank touches. On a straight line of axes the other mate is half a turn (17 pitches) away:
    a space faces that, too, and the nearest tooth is half a pitch behind.
    """
    train = job_train(read_train_job(path), (1e8, 1e8, 1e8))
    lag = GearPair(train.gear("sun").gear, train.gear("idler").gear).contact_twist
    assert Z["idler"] % 2 == 0
    first, second, third = (float(phase) for phase in train.kinematics.phases)
    assert first == third == 0.0  # the first meshes of gears that hang together
    assert lag > 1e-4
    assert second == pytest.approx(math.pi / Z["idler"] - lag, rel=1e-12)


def test_a_job_of_a_pair_and_one_by_name_are_the_same(tmp_path: Path) -> None:
    """All of model, sweep and gears: the digits of everything below."""
    for name in MESHES:
        (tmp_path / "pair.toml").write_text(pair_text(name, 30.0))
        (tmp_path / "box.toml").write_text(text())
        one, two = read_stiffness_job(tmp_path / "pair.toml"), read_stiffness_job(tmp_path / "box.toml", name)
        assert one.pair == two.pair
        assert one.model == two.model
        assert str(one.sweep) == str(two.sweep)


def test_a_mesh_has_keys_of_its_own() -> None:
    job = text(
        meshes__in__stiffness={"twist_deg": 0.02, "coarsen": 2.0},
        meshes__out__loadmap={"torques_Nm": [3.0]},
        loadmap={"torque_start_Nm": 1.0, "torque_stop_Nm": 9.0, "positions": 5},
    )
    meshes = {mesh.name: mesh for mesh in meshes_of(tomllib.loads(job), "box.toml", None)}
    assert (meshes["in"].stiffness.twist_deg, meshes["in"].stiffness.torque_Nm) == (0.02, None)
    assert (meshes["in"].stiffness.coarsen, meshes["out"].stiffness.coarsen) == (2.0, 3.0)
    assert meshes["out"].stiffness.torque_Nm == 30.0
    assert (meshes["out"].loads.torques(), meshes["out"].loads.positions) == ([3.0], 5)
    assert meshes["in"].loads.torques()[-1] == 9.0


def whole(job: str, folder: Path) -> None:
    """All that reads a job: its tables, then the train."""
    file = folder / "box.toml"
    file.write_text(job)
    read = read_train_job(file)
    job_train(read)
    for mesh in read.meshes:
        deviations_of(mesh, pair_of(mesh), folder)


GEAR: dict[str, Any] = {
    "teeth": 20, "module_mm": 2.0, "face_width_mm": 14.0, "bore_diameter_mm": 16.0, "pressure_angle_deg": 20.0,
}  # fmt: skip
#: What is changed, and the words of the message.
WRONG_GEARS: list[tuple[dict[str, Any], str]] = [
    ({"gears__sun__teeth": None}, r"gears\.sun\.teeth: is required"),
    ({"gears__sun__teeth": 7}, r"gears\.sun\.teeth = 7: must be .*>= 8"),
    ({"gears__sun__tooth": 21}, r"gears\.sun: unknown name 'tooth'; did you mean 'teeth'"),
    ({"gears__sun__beta_deg": 12.0}, r"gears\.sun: unknown name 'beta_deg'; did you mean 'helix_angle_deg'"),
    ({"gears__sun__material": "stell"}, r"gears\.sun\.material: unknown name 'stell'; did you mean 'steel'"),
    ({"gears__sun__material": "gold"}, r"gears\.sun\.material: unknown name 'gold'; known names: bronze, iron, steel"),
    ({"gears__sun__material": 206.0}, r"gears\.sun\.material = 206.0: must be a text"),
    ({"gears__sun__module_mm": 2.1}, r"gears\.idler\.module_mm = 2.0: makes modules of 2.1 and 2 in mesh 'in'"),
    ({"gears__wheel_2__pressure_angle_deg": 25.0}, r"gears\.wheel_2\.pressure_angle_deg = 25.0: makes pressure angles"),
    ({"gears__sun__module_mm": None}, r"gears\.sun\.module_mm: is required; give the module"),
    ({"gears__sun__pitch_diameter_mm": 43.0}, r"gears\.sun\.pitch_diameter_mm = 43.0: contradicts module_mm = 2"),
    ({"gears__sun__face_width_mm": None}, r"gears\.sun\.face_width_mm: is required"),
    ({"gears__sun__bore_diameter_mm": 60.0}, r"gears\.sun\.bore_diameter_mm = 60.0: "),
    ({"gears__sun__tip_diameter_mm": 80.0}, r"gears\.sun\.tip_diameter_mm = 80.0: .*must be < "),
    ({"gears__sun__shaft": "s5"}, r"gears\.sun\.shaft: unknown name 's5'; known names: s1, s2, s3, s4"),
    ({"gears__sun__shaft": ["s1", "s2"]}, r"gears\.sun\.shaft = \['s1', 's2'\]: must be a text.*the one shaft"),
    ({"gears__sun__shaft": None}, r"gears\.sun\.shaft: is required: the gear is on no shaft"),
    ({"gears__sun__shaft": None, "gears__sun__y_mm": None}, r"gears\.sun\.shaft: is required: the gear is on no shaft"),
    ({"gears__sun__y_mm": 80.0}, r"gear 'sun'.* beyond the end of shaft 's1'"),
    ({"gears__a b": GEAR}, r"name in \[gears\] = 'a b': must have letters, digits"),
    ({"gears__Sun": GEAR}, r"name in \[gears\] = '(Sun|sun)': differs from .* upper and lower case"),
    ({"gears__teeth": 20}, r"gears\.teeth = 20: is in \[gears\], .*\[gears\.NAME\]"),
    ({"gears": {}}, r"\[gears\]: is empty"),
    ({"gears": None}, r"\[gears\]: is missing"),
    (
        {"gears__sun__microgeometry": {"tip_relief_um": 9.0}, "train__curves": {}},
        r"microgeometry\.tip_relief_length_mm",
    ),
    ({"gears__sun__profile_shift": "from centre distance"}, r"gears\.sun\.profile_shift .*needs a mesh with centre_"),
    ({"pair": {"pinion": GEAR, "wheel": GEAR}}, r"\[pair\]: conflicts with \[gears\.NAME\]"),
    ({"microgeometry": {}}, r"\[microgeometry\]: conflicts with .*write \[gears\.NAME\.microgeometry\]"),
    (
        {"train__gears": [{"name": "g", "shaft": "s1", "y_mm": 0.0, "teeth": 20}]},
        r"shaft: unknown name 's1'|stands bes",
    ),
]
WRONG_MESHES: list[tuple[dict[str, Any], str]] = [
    ({"meshes__in__driver": None}, r"meshes\.in\.driver: is required"),
    ({"meshes__in__driver": "son"}, r"meshes\.in\.driver: unknown name 'son'; did you mean 'sun'"),
    ({"meshes__in__driver": ["sun", "idler"]}, r"meshes\.in\.driver = \['sun', 'idler'\]: must be a text"),
    ({"meshes__in__driven": "sun"}, r"meshes\.in\.driven = 'sun': is the driver, too"),
    ({"meshes__in__driven": "wheel_2"}, r"gears\.wheel_2\.module_mm = 3.0: makes modules"),
    ({"meshes__out__driver": "wheel_1", "meshes__out__driven": "pinion_2"}, r"is on shaft 's3' with the driver"),
    ({"meshes__again": {"driver": "idler", "driven": "sun"}}, r"meshes\.again: has the gears of \[meshes\.in\]"),
    ({"meshes__in__centre_distance_mm": 56.0}, r"mesh 'in': .* 55 mm apart, the gears need 56 mm"),
    ({"meshes__in__centre_distance_mm": 54.0}, r"meshes\.in\.centre_distance_mm = 54.0: .*must be >= "),
    ({"meshes__in__centre_distance_mm": -1.0}, r"meshes\.in\.centre_distance_mm = -1.0: must be > 0"),
    ({"meshes__in__law": "map"}, r"meshes\.in\.law = 'map': names the contact law"),
    ({"meshes__in__mesh_model": "potental"}, r"meshes\.in\.mesh_model = 'potental': must be one of"),
    ({"meshes__in__stiffness": {"coarsen": 9.0}}, r"meshes\.in\.stiffness\.coarsen = 9.0: must be"),
    ({"meshes__in__stiffness": {"twist_deg": 1.0, "torque_Nm": 1.0}}, r"meshes\.in\.stiffness\.torque_Nm.*twist_deg"),
    ({"meshes__in__loadmap": {"torque_start_Nm": 1.0}}, r"meshes\.in\.loadmap\.torque_stop_Nm: is missing"),
    ({"meshes__in__friction": 0.9}, r"meshes\.in\.friction = 0.9: must be"),
    ({"meshes__in__friction": 0.05}, r"meshes\.in\.friction.*needs a mesh law"),
    ({"meshes__in__backlash_um": -3.0}, r"meshes\.in\.backlash_um = -3.0"),
    ({"meshes__in__rigid": True, "meshes__in__stiffness_N_per_m": 1e8}, r"meshes\.in\.rigid = True: conflicts with"),
    ({"meshes": {}}, r"\[meshes\]: is empty"),
    ({"meshes": None}, r"\[meshes\]: is missing"),
    ({"meshes__in.out": {"driver": "sun", "driven": "idler"}}, r"name in \[meshes\] = 'in.out': must have letters"),
    ({"meshes__driver": "sun"}, r"meshes\.driver = 'sun': is in \[meshes\]"),
]
WRONG_SHAFTS: list[tuple[dict[str, Any], str]] = [
    ({"shafts__s1__x_mm": None}, r"shafts\.s1\.x_mm: is required"),
    ({"shafts__s1__length_mm": 0.0}, r"shafts\.s1\.length_mm = 0.0: must be finite and > 0"),
    ({"shafts__s1__radius_mm": -2.0}, r"shafts\.s1\.radius_mm = -2.0"),
    ({"shafts__s1__radius": 2.0}, r"shafts\.s1: unknown name 'radius'; did you mean 'radius_mm'"),
    ({"shafts__s1__x_mm": 1.0}, r"shafts 's1' and 's2' are 54 mm apart, the gears need 55 mm"),
    ({"shafts__s4__z_mm": 40.0}, r"shafts 's3' and 's4' are 79.*mm apart, the gears need 69 mm"),
    ({"shafts__s5": {"x_mm": 300.0, "length_mm": 9.0, "radius_mm": 2.0}}, r"shafts\.s5\.attachments: no bearing carr"),
    ({"shafts__s2__length_mm": 20.0}, r"beyond the end of shaft 's2'"),
    ({"shafts__s2__elastic": True}, r"shafts\.s2: unknown name 'elastic'"),
    (
        {"shafts__s2__bending_stiffness": 1.0},
        r"shafts\.s2\.bending_stiffness = 1.0: stiffnesses of elastic shafts are not",
    ),
    ({"shafts": {}}, r"\[shafts\]: is empty"),
    ({"shafts": None}, r"\[shafts\]: is missing"),
    ({"shafts__s 1": {"x_mm": 300.0, "length_mm": 9.0, "radius_mm": 2.0}}, r"name in \[shafts\] = 's 1'"),
    ({"train__drive__shaft": "s9"}, r"train\.drive\.shaft: unknown name 's9'; known names: s1, s2, s3, s4"),
    ({"train__loads": [{"shaft": "s8", "torque_Nm": 1.0}]}, r"train\.loads\[0\]\.shaft: unknown name 's8'"),
]
WRONG_BEARINGS: list[tuple[dict[str, Any], str]] = [
    ({"bearings__s1_left__shaft": None}, r"bearings\.s1_left\.shaft: is required"),
    ({"bearings__s1_left__shaft": "s0"}, r"bearings\.s1_left\.shaft: unknown name 's0'; known names: s1, s2, s3, s4"),
    ({"bearings__s1_left__stiffness_N_per_m": [1e8]}, r"s1_left\.stiffness_N_per_m = \[.*\]: must have 3 entries"),
    ({"bearings__s1_left__stiffness_N_per_m": [-1e8, 0.0, 0.0]}, r"bearings\.s1_left\.stiffness_N_per_m\[0\] = -1"),
    ({"bearings__s1_left__damping_N_s_per_m": [1.0, 0.0, 0.0]}, r"s1_left\.damping_N_s_per_m.*needs a stiffness"),
    ({"bearings__s1_left__tilt_damping_Nm_s_per_rad": [0.0, 1.0]}, r"tilt_damping_Nm_s_per_rad.*needs a stiffness"),
    ({"bearings__s1_left__tilt_stiffness_Nm_per_rad": [1.0, 1.0]}, r"tilt_stiffness.*add stiffness_N_per_m"),
    (
        {"bearings__s1_left__stiffness": [1e8, 2e8, 1e8, 3e4, 4e4]},
        r"write stiffness_N_per_m = \[1000.*, 2000.*, 1000.*\] and tilt_stiffness_Nm_per_rad = \[30000",
    ),
    ({"bearings__s1_left__damping": 3.0}, r"write damping_N_s_per_m, and tilt_damping_Nm_s_per_rad for the tilts"),
    ({"bearings__s1_left__stiffness_matrix": [[1.0] * 5] * 5}, r"write stiffness_matrix_N_m_rad"),
    ({"bearings__s1_left__damping_matrix": [[1.0] * 5] * 5}, r"write damping_matrix_N_m_s_rad"),
    ({"bearings__s1_left__clearance_um": 3.0}, r"bearings\.s1_left: unknown name 'clearance_um'"),
    ({"bearings__s1_left__y_mm": 70.0}, r"attachment 's1_left': lies 25 mm beyond the end of shaft 's1'"),
    ({"bearings__s1_left__y_mm": None}, r"bearings\.s1_left\.y_mm: is required: other bearings have one"),
    ({"bearings__s1_left__attachment": "s1_right"}, r"bearings\.s1_right\.attachment = 's1_right': is that of \[bear"),
    ({"train__housing": "elastic"}, r"bearings\.s1_left\.y_mm = -40.0: conflicts with an elastic housing.*attachment"),
    ({"bearings": {}}, r"\[bearings\]: is empty"),
    ({"bearings": None}, r"shafts\.s1\.attachments: no bearing carries the shaft"),
    ({"bearings__7 b": {"shaft": "s1", "y_mm": 0.0}}, r"name in \[bearings\] = '7 b'"),
    (
        {"train__drive__attachment": "s2_left"},
        r"train\.drive\.attachment: unknown name 's2_left'; did you mean 's1_left",
    ),
    (
        {"train__bearings": [{"attachment": 1, "stiffness_N_per_m": [1.0] * 3}]},
        r"\[\[train\.bearings\]\]: conflicts with \[bear",
    ),
    ({"train__rigid_bores": [{"attachment": 1, "x_mm": 0.0, "y_mm": 0.0}]}, r"rigid_bores\]\]: conflicts with"),
]
WRONG_MATERIALS: list[tuple[dict[str, Any], str]] = [
    ({"materials__steel__youngs_modulus_GPa": 206e9}, r"materials\.steel\.youngs_modulus_GPa = 2060+.*must be finite"),
    ({"materials__steel__youngs_modulus_GPa": 0.0}, r"materials\.steel\.youngs_modulus_GPa = 0.0"),
    (
        {"materials__steel__youngs_modulus_GPa": "206"},
        r"materials\.steel\.youngs_modulus_GPa = '206': must be a number",
    ),
    (
        {"materials__steel__poisson_ratio": 0.5},
        r"materials\.steel\.poisson_ratio = 0.5: must be finite and >= 0 and < 0.5",
    ),
    ({"materials__steel__poisson_ratio": -0.1}, r"materials\.steel\.poisson_ratio = -0.1"),
    ({"materials__steel__density_kg_per_m3": 0.0}, r"materials\.steel\.density_kg_per_m3 = 0.0"),
    ({"materials__steel__rho": 7850.0}, r"materials\.steel: unknown name 'rho'; did you mean 'density_kg_per_m3'"),
    ({"materials__steel__yield_MPa": 500.0}, r"materials\.steel\.yield_MPa = 500.0: materials that yield"),
    ({"materials__steel": 206.0}, r"materials\.steel = 206.0: is in \[materials\]"),
    ({"materials": {}}, r"\[materials\]: is empty"),
    ({"materials": None}, r"gears\.sun\.material: unknown name 'steel'; known names: none"),
    ({"materials__18Cr Ni": {}}, r"name in \[materials\] = '18Cr Ni': must have"),
]
#: Mistakes that join several tables.
ORDERS = {"shaft": "s4", "torque_Nm": 60.0, "orders_Nm_deg": [[1.0, 2.0, 0.0]]}
BOTH = {
    "gears__pinion_2__profile_shift": "from centre distance",
    "gears__wheel_2__profile_shift": "from centre distance",
}
WRONG_TOGETHER: list[tuple[dict[str, Any], str]] = [
    ({"pair": {"pinion": {"teeth": 20}}}, r"\[pair\]: conflicts with \[gears\.NAME\]"),
    ({"meshes__in__mesh_table": "r.csv", "meshes__in__rigid": True}, r"meshes\.in\.rigid = True: .*with mesh_table"),
    (
        {"meshes__in__mesh_table": "r.csv", "meshes__in__mesh_model": "potential"},
        r"meshes\.in\.mesh_model = .*mesh_tab",
    ),
    (
        {"train__loads": [{**ORDERS, "mesh": "outt"}]},
        r"train\.loads\[0\]\.mesh: unknown name 'outt'; did you mean 'out'",
    ),
    (
        {"train__loads": [{**ORDERS, "mesh": "sun-idler"}]},
        r"loads\[0\]\.mesh: unknown name 'sun-idler'; known names: in, ",
    ),
    (
        {"train__loads": [{**ORDERS, "orders_Nm_deg": [], "mesh": "out"}]},
        r"train\.loads\[0\]\.mesh = 'out': .*add orders_Nm_deg",
    ),
    ({**BOTH, "meshes__out__centre_distance_mm": 69.0}, r"gears\.pinion_2\.profile_shift .*needs a mesh with centre_"),
    (
        {
            "gears__idler__profile_shift": "from centre distance",
            "meshes__in__centre_distance_mm": 55.1,
            "meshes__through__centre_distance_mm": 79.2,
        },
        r"gears\.idler\.profile_shift = .*: is 0\.0\d* by mesh 'in', but 0\.1\d* by mesh 'through'; write a number",
    ),
]
WRONG = [*WRONG_TOGETHER, *WRONG_GEARS, *WRONG_MESHES, *WRONG_SHAFTS, *WRONG_BEARINGS, *WRONG_MATERIALS]


@pytest.mark.parametrize(("changes", "words"), WRONG, ids=[str(row[0])[:60] for row in WRONG])
def test_mistakes(changes: dict[str, Any], words: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=words) as caught:
        whole(text(**changes), tmp_path)
    assert caught.value.cure or "must be" in caught.value.problem or "unknown name" in caught.value.problem


def test_the_gearbox_itself_is_read(path: Path) -> None:
    tables = read_train_tables(path)
    assert list(tables["gearbox"].meshes) == list(MESHES)
    assert set(job_tables(tomllib.loads(text()), "box.toml", ("gears",))) == {"gears"}


def test_the_page_has_the_gearbox_of_these_tests(tmp_path: Path) -> None:
    """Its job is read, and its speeds, torques and distances are those that it states."""
    page = (DOCS / "gearbox.md").read_text(encoding="utf-8")
    (job,) = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    (tmp_path / "box.toml").write_text(job)
    train = job_train(read_train_job(tmp_path / "box.toml"), (1e8, 1e8, 1e8))
    check_train(train)
    stated = re.search(r"Speeds ([-\d., ]+) rad/s", page)
    assert stated is not None
    speeds = [float(word) for word in stated[1].split(", ")]
    assert [100.0 * float(ratio) for ratio in train.kinematics.ratios] == pytest.approx(speeds, abs=0.005)
    torques = [
        abs(float(force)) * train.gear(mesh.driven).gear.base_radius
        for mesh, force in zip(train.meshes, train.kinematics.steady_forces, strict=True)
    ]
    assert torques == pytest.approx([26.57, 35.17, 60.0], abs=0.005)
    assert "26.57 N m in `in`" in page
    assert "35.17 N m in `through`" in page


def by_name(raw: dict[str, Any]) -> dict[str, Any]:
    """The shipped train, shorthand and lists, with every part by its name."""
    pair, train = raw.pop("pair"), raw["train"]
    shared = {key: value for key, value in pair.items() if not isinstance(value, dict)}
    raw["gears"] = {
        gear["name"]: {
            **shared, **pair[gear["gear"]], "material": "steel", "shaft": gear["shaft"], "y_mm": gear["y_mm"]
        }
        for gear in train.pop("gears")
    }  # fmt: skip
    raw["materials"] = {"steel": pair["material"]}
    raw["meshes"] = {f"{mesh['driver']}-{mesh['driven']}": mesh for mesh in train.pop("meshes")}
    shafts = train.pop("shafts")
    raw["bearings"] = {f"at_{a}": {"shaft": s["name"], "attachment": a} for s in shafts for a in s["attachments"]}
    raw["shafts"] = {s.pop("name"): {k: v for k, v in s.items() if k != "attachments"} for s in shafts}
    train["drive"]["attachment"] = "at_1"
    return raw


@pytest.mark.parametrize("variant", ["standard", "undamped_springs", "operating"])
def test_the_shipped_train_by_name_is_the_shipped_train(variant: str, tmp_path: Path) -> None:
    """In its elastic housing: gears, shafts, bores, kinematics, contact models, sweeps."""
    raw = by_name(tomllib.loads((GEOMETRY / "gear_train.toml").read_text(encoding="utf-8")))
    (tmp_path / "box.toml").write_text(toml_document(raw))
    jobs = [read_train_job(path, variant) for path in (GEOMETRY / "gear_train.toml", tmp_path / "box.toml")]
    one, two = (job.rigid_train for job in jobs)
    for part in ("shafts", "gears", "meshes", "drive", "loads", "rigid_bores", "bearings", "damping"):
        assert getattr(one, part) == getattr(two, part), part
    assert one.kinematics.phases == pytest.approx(two.kinematics.phases, rel=0.0, abs=0.0)
    assert (one.kinematics.steady_forces == two.kinematics.steady_forces).all()
    for first, second in zip(jobs[0].meshes, jobs[1].meshes, strict=True):
        own, other = stiffness_job(first), stiffness_job(second)
        assert (own.pair, own.model, str(own.sweep)) == (other.pair, other.model, str(other.sweep))


@pytest.mark.parametrize("key", ["mesh_table", "curve"])
@pytest.mark.parametrize(
    ("content", "words"),
    [(None, "there is no such file"), ("fraction,k\n0,1\n", "fraction_of_pitch|pinion_angle_deg")],
)
def test_mistakes_in_files_of_a_mesh_name_its_key(key: str, content: str | None, words: str, tmp_path: Path) -> None:
    (tmp_path / "box.toml").write_text(text(**{f"meshes__in__{key}": "in.csv"}))
    if content is not None:
        (tmp_path / "in.csv").write_text(content)
    with pytest.raises(InputError, match=rf"meshes\.in\.{key} = 'in\.csv': .*({words})"):
        train_curves(read_train_job(tmp_path / "box.toml"))
