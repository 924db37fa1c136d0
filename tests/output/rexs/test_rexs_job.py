"""Jobs from REXS models: each component type becomes its table, and every value of the file is in the list."""

from __future__ import annotations

import dataclasses
import math
import re
import shutil
import tomllib
from decimal import Decimal
from typing import Any

import pytest

import gearfe
from gearfe.base.errors import InputError
from gearfe.base.tables.jobs import gearbox_of, train_tables
from gearfe.cli.main import main
from gearfe.output.exchange.rexs import Attribute, Component, Relation, read_rexs, rexs_job
from gearfe.output.exchange.rexs.ledger import KINDS
from tests.makers.rexs_models import pose, saved, spur_pair, with_attributes, xml_of
from tests.places import DATA

EXAMPLES = DATA / "rexs"
SEW = EXAMPLES / "SEW_3-stage_cylindrical_gearbox_1.0.rexs"
FVA = EXAMPLES / "FVA_Planetary_stage_-_Minus_gearing_1.1.rexs"


def job_of(folder, parts, joints, version="2.0", more="", **options):
    return rexs_job(saved(folder, xml_of(parts, joints, version, more)), **options)


def tables_of(folder, parts, joints, **options):
    return job_of(folder, parts, joints, **options).tables


def complete(job) -> None:
    """Every attribute with a value and every relation of the model is used or in the list, and the text is the job."""
    listed = {(entry.number, word) for entry in job.entries for word in re.findall(r"\w+", entry.attribute)}
    for number, component in job.model.components.items():
        for name in component.attributes:
            assert (number, name) in listed, f"{component.label}: {name}"
    assert all(entry.rule for entry in job.entries if entry.kind != "read")
    text = job.text("model.rexs")
    read = tomllib.loads(text)
    assert {name: read[name] for name in read} == {name: table for name, table in job.tables.items() if name in read}
    assert set(job.tables) == set(read)
    assert max(len(line) for line in text.splitlines() if not line.startswith("##")) <= 121
    for kind in KINDS:
        for line in job.lines(kind):
            assert line == line.strip()


def test_a_spur_stage(tmp_path):
    job = job_of(tmp_path, *spur_pair())
    complete(job)
    t = job.tables
    pinion = t["gears"]["pinion"]
    assert (pinion["teeth"], pinion["module_mm"], pinion["face_width_mm"], pinion["y_mm"]) == (20, 2.0, 20.0, 50.0)
    assert pinion["material"] == "steel"
    assert t["materials"]["steel"] == {
        "youngs_modulus_GPa": 206.0, "poisson_ratio": 0.3, "density_kg_per_m3": 7830.0,
    }  # fmt: skip
    assert t["meshes"]["stage"]["stiffness"] == {"torque_Nm": 60.0}  # 30 N m times 40/20
    assert t["train"]["drive"]["speed_rad_per_s"] == pytest.approx(50.0 * math.pi, rel=1e-15)
    # the output turns against +y, and takes power: a torque along +y
    assert t["train"]["loads"][0]["torque_Nm"] == 60.0
    assert t["bearings"]["B11"]["stiffness_N_per_m"] == [2e8, 1e8, 2e8]
    assert t["bearings"]["B11"]["tilt_stiffness_Nm_per_rad"] == [1e4, 1e4]
    assert [section["outer_diameter_mm"] for section in t["shafts"]["input"]["sections"]] == [20.0, 25.0]
    assert (t["shafts"]["output"]["x_mm"], t["shafts"]["output"]["z_mm"]) == (60.0, 0.0)
    assert not job.left


def test_gears_bearings_and_trains_take_the_tables(tmp_path):
    """What the commands read of the text is the gearbox."""
    raw = tomllib.loads(job_of(tmp_path, *spur_pair()).text())
    box = gearbox_of(raw, "job.toml")
    assert box.meshes["stage"].stiffness.torque_Nm == 60.0
    train = train_tables(raw, "job.toml")["train"]
    assert train.drive.shaft == "input"


def test_power_that_flows_the_other_way_turns_the_mesh(tmp_path):
    parts, joints = spur_pair()
    parts = with_attributes(parts, 8, torque_around_u_axis=-30.0)
    t = tables_of(tmp_path, parts, joints)
    assert (t["meshes"]["stage"]["driver"], t["meshes"]["stage"]["driven"]) == ("wheel", "pinion")
    assert t["meshes"]["stage"]["stiffness"] == {"torque_Nm": 30.0}
    assert t["train"]["drive"]["shaft"] == "output"
    assert t["train"]["drive"]["speed_rad_per_s"] == pytest.approx(-25.0 * math.pi, rel=1e-11)
    assert t["train"]["loads"][0]["torque_Nm"] == -30.0


def test_power_instead_of_torque(tmp_path):
    parts, joints = spur_pair()
    parts = with_attributes(parts, 8, torque_around_u_axis=None, power=30.0 * 50.0 * math.pi / 1e3)
    assert tables_of(tmp_path, parts, joints)["meshes"]["stage"]["stiffness"]["torque_Nm"] == pytest.approx(60.0)


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.6, 0.8), (-1.0, 0.0, 0.0)])
def test_gearboxes_that_stand_in_space(tmp_path, axis):
    """Shafts along any axis of the gear unit: distances along and across them stay."""
    parts, joints = spur_pair()
    a = axis
    across = (0.0, 0.0, 1.0) if abs(a[2]) < 0.5 else (1.0, 0.0, 0.0)
    turned = []
    for number, kind, name, attributes in parts:
        place = {}
        if number != 1 and "support_vector" in attributes:
            u, _, w = attributes["support_vector"]
            place["support_vector"] = [u * x + w * y for x, y in zip(a, across, strict=True)]
            place |= {"u_axis_vector": list(a), "w_axis_vector": list(across)}
        turned.append((number, kind, name, {**attributes, **place}))
    t = tables_of(tmp_path, turned, joints)
    first, second = t["shafts"]["input"], t["shafts"]["output"]
    assert math.hypot(second["x_mm"] - first["x_mm"], second["z_mm"] - first["z_mm"]) == pytest.approx(60.0)
    assert t["gears"]["wheel"]["y_mm"] - first["y_mm"] == pytest.approx(0.0, abs=1e-9)
    assert t["train"]["loads"][0]["torque_Nm"] == 60.0


def test_a_shaft_that_runs_backwards(tmp_path):
    """Its u axis points against that of the first shaft: sections, places, speeds and torques turn round."""
    parts, joints = spur_pair()
    back = {**pose(100.0, 0.0, 60.0, (-1.0, 0.0, 0.0))}
    parts = with_attributes(parts, 4, **back)
    parts = with_attributes(parts, 9, torque_around_u_axis=-60.0, u_coordinate_on_shaft=5.0)
    parts = with_attributes(parts, 8, torque_around_u_axis=None)
    t = tables_of(tmp_path, parts, joints)
    assert [section["outer_diameter_mm"] for section in t["shafts"]["output"]["sections"]] == [28.0, 30.0]
    assert t["shafts"]["output"]["y_mm"] == 50.0
    assert t["train"]["loads"][0] | {"y_mm": 95.0, "torque_Nm": 60.0} == t["train"]["loads"][0]


def test_oblique_shafts_are_left_out_in_words(tmp_path):
    parts, joints = spur_pair()
    tilted = {"u_axis_vector": [0.8, 0.6, 0.0]}
    job = job_of(tmp_path, with_attributes(parts, 4, **tilted), joints)
    complete(job)
    assert "not parallel" in job.left["shafts", "output"][1]
    assert "gears" not in job.tables
    assert job.left["meshes", "stage"][0]["centre_distance_mm"] == 60.0
    assert "## [meshes.stage]" in job.text()


def test_cones_bores_and_sections_in_any_order(tmp_path):
    parts, joints = spur_pair()
    parts = with_attributes(parts, 21, outer_diameter_end=24.0, inner_diameter_begin=4.0, inner_diameter_end=6.0)
    parts.sort(key=lambda part: -part[0])
    first = tables_of(tmp_path, parts, joints)["shafts"]["input"]["sections"][0]
    assert first == {
        "length_mm": 40.0, "outer_diameter_start_mm": 20.0, "outer_diameter_end_mm": 24.0,
        "inner_diameter_start_mm": 4.0, "inner_diameter_end_mm": 6.0,
    }  # fmt: skip


def test_sections_with_a_gap_make_a_rigid_shaft(tmp_path):
    parts, joints = spur_pair()
    job = job_of(tmp_path, with_attributes(parts, 22, u_coordinate_on_shaft=45.0), joints)
    assert "sections" not in job.tables["shafts"]["input"]
    assert any("begins at 45 mm, the section before it ends at 40 mm" in line for line in job.lines("ignored"))


def test_shafts_without_places_follow_the_centre_distances(tmp_path):
    parts, joints = spur_pair()
    bare = []
    for number, kind, name, attributes in parts:
        kept = {
            key: value for key, value in attributes.items() if not key.endswith("_vector") and "reference" not in key
        }
        if number in (5, 6):
            kept["u_coordinate_on_shaft"] = 50.0
        if number in (11, 12, 13, 14):
            kept["u_coordinate_on_shaft_inner_side"] = 20.0 if number % 2 else 80.0
        if number == 7:
            kept["rotating_angle_around_neg_u_axis"] = 90.0
        bare.append((number, kind, name, kept))
    t = tables_of(tmp_path, bare, joints)
    assert (t["shafts"]["output"]["x_mm"], t["shafts"]["output"]["z_mm"]) == (pytest.approx(0.0, abs=1e-9), 60.0)
    assert [t["bearings"][f"B{number}"]["y_mm"] for number in (11, 12)] == [20.0, 80.0]
    assert t["gears"]["wheel"]["y_mm"] == 50.0


def test_teeth_by_tool_and_by_diameters(tmp_path):
    parts, joints = spur_pair(tip_diameter=44.2, span_measurement=15.3, number_of_teeth_for_span_measurement=3)
    tool = {
        "addendum_coefficient_reference_profile": 1.4, "tip_corner_radius_factor_reference_profile": 0.25,
        "normal_module": 2.0,
    }  # fmt: skip
    parts += [(50, "rack_shaped_tool", "hob", tool), (51, "cylindrical_gear_manufacturing_settings", "", {})]
    joints += [("manufacturing_step", {"workpiece": 33, "tool": 50, "manufacturing_settings": 51}, 1)]
    gears = tables_of(tmp_path, parts, joints)["gears"]
    assert gears["pinion"]["tip_diameter_mm"] == 44.2
    assert (gears["pinion"]["span_mm"], gears["pinion"]["span_teeth"]) == (15.3, 3)
    assert (gears["wheel"]["dedendum"], gears["wheel"]["rack_tip_radius"]) == (1.4, 0.25)


def test_thinning_follows_from_the_generated_profile_shift(tmp_path):
    parts, joints = spur_pair()
    settings = {"generated_addendum_modification_coefficient": -0.02}
    parts += [(51, "cylindrical_gear_manufacturing_settings", "", settings), (50, "rack_shaped_tool", "hob", {})]
    joints += [("manufacturing_step", {"workpiece": 31, "tool": 50, "manufacturing_settings": 51}, 1)]
    pinion = tables_of(tmp_path, parts, joints)["gears"]["pinion"]
    assert pinion["tooth_thinning_um"] == pytest.approx(2e3 * 0.02 * 2.0 * math.tan(math.radians(20.0)), rel=1e-8)


THICKNESS = "normal_tooth_thickness_at_reference_diameter"
GENERATED = "generated_addendum_modification_coefficient"
NOMINAL = 2.0 * (0.5 * math.pi + 2.0 * 0.1 * math.tan(math.radians(20.0)))


def with_thickness(gear, shift=0.1, generated=None):
    """A pair whose pinion has these attributes, of a profile shift, and settings of its last step."""
    parts, joints = spur_pair(**gear)
    for number in (31, 32):
        parts = with_attributes(parts, number, addendum_modification_coefficient=shift)
    settings = {} if generated is None else {GENERATED: generated}
    parts += [(51, "cylindrical_gear_manufacturing_settings", "", settings), (50, "rack_shaped_tool", "hob", {})]
    return parts, [*joints, ("manufacturing_step", {"workpiece": 31, "tool": 50, "manufacturing_settings": 51}, 1)]


def of_attribute(job, attribute):
    return [(entry.kind, entry.key, entry.rule) for entry in job.entries if attribute in entry.attribute.split(", ")]


@pytest.mark.parametrize(
    ("gear", "shift", "generated", "attribute", "said"),
    [
        ({THICKNESS: NOMINAL + 0.05}, 0.1, None, THICKNESS, "thicker than nominal by 50 um"),
        ({THICKNESS: 3.1}, None, None, THICKNESS, "needs the profile shift"),
        ({}, 0.1, 0.12, GENERATED, "thicker than nominal by 29.1"),
        ({}, None, 0.12, GENERATED, "needs the profile shift"),
        ({THICKNESS: NOMINAL - 0.1}, 0.1, 0.08, THICKNESS, f"{GENERATED} says it"),
        ({THICKNESS: NOMINAL - 0.1, "span_measurement": 15.3}, 0.1, None, "span_measurement", f"{THICKNESS} says it"),
        ({"span_measurement": 15.3}, 0.1, None, "span_measurement", "needs span and number of teeth"),
    ],
)
def test_a_tooth_thickness_that_no_key_holds_is_ignored_in_words(tmp_path, gear, shift, generated, attribute, said):
    job = job_of(tmp_path, *with_thickness(gear, shift, generated))
    complete(job)
    ((kind, _, rule),) = of_attribute(job, attribute)
    assert (kind, said in rule) == ("ignored", True), rule
    keys = {entry.key for entry in job.entries if entry.kind == "derived"}
    assert ("tooth_thinning_um" in job.tables["gears"]["pinion"]) == ("gears.pinion.tooth_thinning_um" in keys)


def test_the_thickness_holds_where_the_generated_shift_does_not(tmp_path):
    parts, joints = with_thickness({THICKNESS: NOMINAL - 0.08}, 0.1, 0.12)
    job = job_of(tmp_path, parts, joints)
    assert job.tables["gears"]["pinion"]["tooth_thinning_um"] == pytest.approx(80.0, rel=1e-6)
    assert of_attribute(job, THICKNESS)[0][0] == "derived"
    assert of_attribute(job_of(tmp_path, *with_thickness({THICKNESS: NOMINAL})), THICKNESS)[0][0] == "read"


def test_a_missing_profile_shift_follows_from_the_centre_distance(tmp_path):
    parts, joints = spur_pair()
    for number in (33, 34):
        parts = with_attributes(parts, number, addendum_modification_coefficient=None)
    parts = with_attributes(parts, 7, center_distance=60.5)
    t = tables_of(tmp_path, parts, joints)
    assert t["gears"]["wheel"]["profile_shift"] == "from centre distance"


def test_helices_have_hands(tmp_path):
    parts, joints = spur_pair(helix_angle_reference_diameter=12.5)
    gears = tables_of(tmp_path, with_attributes(parts, 6, helix_angle_reference_diameter=-12.5), joints)["gears"]
    assert (gears["pinion"]["helix_angle_deg"], gears["pinion"]["helix_hand"]) == (12.5, "right")
    assert (gears["wheel"]["helix_angle_deg"], gears["wheel"]["helix_hand"]) == (12.5, "left")


def test_bores(tmp_path):
    """The shaft's diameter; of a pinion that is cut into its shaft, 1.5 modules below the root circle."""
    parts, joints = spur_pair()
    gears = tables_of(tmp_path, parts, joints)["gears"]
    assert (gears["pinion"]["bore_diameter_mm"], gears["wheel"]["bore_diameter_mm"]) == (25.0, 30.0)
    thick = with_attributes(parts, 22, outer_diameter_begin=34.0, outer_diameter_end=34.0)
    # d_f = 40 - 2.5 x 2 = 35 mm
    assert tables_of(tmp_path, thick, joints)["gears"]["pinion"]["bore_diameter_mm"] == 29.0
    given = with_attributes(parts, 5, inner_diameter=22.0)
    assert tables_of(tmp_path, given, joints)["gears"]["pinion"]["bore_diameter_mm"] == 22.0


# --- bearings -------------------------------------------------------------------------------------------------------

#: Catalogue values and what the bearings have inside (SKF and FAG catalogues): d, D, B (mm), C0 (kN), balls, ball (mm).
BALL_BEARINGS = {
    "6202": (15.0, 35.0, 11.0, 3.75, 8, 5.953),
    "6205": (25.0, 52.0, 15.0, 7.8, 9, 7.938),
    "6207": (35.0, 72.0, 17.0, 15.3, 9, 11.112),
    "6305": (25.0, 62.0, 17.0, 11.4, 7, 11.5),
    "6308": (40.0, 90.0, 23.0, 24.0, 8, 15.081),
}


@pytest.mark.parametrize("name", BALL_BEARINGS)
def test_ball_bearings_from_catalogue_values(tmp_path, name):
    bore, outside, width, rating, balls, size = BALL_BEARINGS[name]
    parts, joints = spur_pair()
    catalogue = {
        "bearing_type": "radial_grooved_ball_bearing", "inner_diameter": bore, "outer_diameter": outside,
        "width": width, "radial_static_load_rating": rating, "operating_radial_bearing_clearance": 8.0,
        "axial_force_absorption": "both_directions",
    }  # fmt: skip
    kind = "rolling_bearing_with_catalog_geometry"
    parts = [(11, kind, name, {**pose(20.0, 0.0, 0.0), **catalogue}) if p[0] == 11 else p for p in parts]
    entry = next(iter(tables_of(tmp_path, parts, joints)["bearings"].values()))
    assert entry["elements"] == balls
    assert entry["element_diameter_mm"] == pytest.approx(size, rel=0.04)
    assert entry["pitch_diameter_mm"] == 0.5 * (bore + outside)
    assert entry["radial_clearance_um"] == 8.0


@pytest.mark.parametrize(
    ("given", "type_", "keys"),
    [
        ("radial_grooved_ball_bearing", "deep_groove_ball", {"inner_osculation": 0.515}),
        ("angular_contact_ball_bearing", "angular_contact_ball", {"contact_angle_deg": 25.0, "carries": "-y"}),
        ("radial_roller_bearing", "cylindrical_roller", {"roller_length_mm": 9.0}),
        ("radial_tapered_roller_bearing", "tapered_roller", {"contact_angle_deg": 25.0, "roller_length_mm": 9.0}),
    ],
)
def test_bearings_with_their_inner_geometry(tmp_path, given, type_, keys):
    parts, joints = spur_pair()
    kind = "rolling_bearing_with_detailed_geometry"
    bearing = {**pose(20.0, 0.0, 0.0), "bearing_type": given, "axial_force_absorption": "negative"}
    parts = [(11, kind, "A", bearing) if part[0] == 11 else part for part in parts]
    row = {
        "number_of_rolling_elements": 11, "reference_diameter_rolling_bearing": 46.0, "pressure_angle": 25.0,
        "raceway_radius_of_inner_ring": 5.15,
    }  # fmt: skip
    element = {"diameter_of_rolling_element": 10.0, "length_of_rolling_element": 9.0}
    parts += [(60, "rolling_bearing_row", "", row), (61, "rolling_element", "", element)]
    joints += [
        ("ordered_assembly", {"assembly": 11, "part": 60}, 1), ("ordered_assembly", {"assembly": 60, "part": 61}, 1),
    ]  # fmt: skip
    job = job_of(tmp_path, parts, joints)
    complete(job)
    entry = job.tables["bearings"]["A"]
    assert (entry["type"], entry["elements"], entry["element_diameter_mm"]) == (type_, 11, 10.0)
    assert {key: entry[key] for key in keys} == keys
    assert not job.left


def test_rigid_and_floating_bearings(tmp_path):
    parts, joints = spur_pair()
    parts = with_attributes(parts, 11, radial_stiffness=1e20, axial_force_absorption="no_direction")
    job = job_of(tmp_path, parts, joints)
    assert job.tables["bearings"]["B11"]["stiffness_N_per_m"] == [1e10, 0.0, 1e10]
    assert job.tables["bearings"]["B11"]["tilt_stiffness_Nm_per_rad"] == [1e4, 1e4]
    assert any("rigid: 1e+10" in line for line in job.lines("derived"))


def test_bearings_between_shafts_are_comments(tmp_path):
    parts, joints = spur_pair()
    parts.append((70, "concept_bearing", "between", pose(50.0, 0.0, 0.0)))
    job = job_of(tmp_path, parts, [*joints, ("side", {"assembly": 70, "inner_part": 3, "outer_part": 4})])
    complete(job)
    assert "between a shaft and the housing" in job.left["bearings", "between"][1]
    assert "bearings between: carries shaft 3 (input)" in job.text()


# --- couplings, masses, oil, load cases -------------------------------------------------------------------------------


def test_couplings_masses_and_their_limits(tmp_path):
    parts, joints = spur_pair()
    parts += [
        (70, "shaft", "motor", pose(-60.0, 0.0, 0.0)),
        (71, "shaft_section", "", {"u_coordinate_on_shaft": 0.0, "length": 50.0, "outer_diameter_begin": 30.0}),
        (72, "coupling", "flange", {"rotational_stiffness": 5e6, "radial_stiffness": 1e6}),
        (73, "additional_mass", "rotor", {
            "mass_of_component": 4.0, "moment_of_inertia_u_axis": 0.02, "u_coordinate_on_shaft": 10.0,
        }),
        (74, "concept_bearing", "M", {**pose(-40.0, 0.0, 0.0), "radial_stiffness": 1e8}),
    ]  # fmt: skip
    joints += [
        ("assembly", {"assembly": 70, "part": 71}), ("side", {"assembly": 72, "inner_part": 70, "outer_part": 3}),
        ("assembly", {"assembly": 70, "part": 73}), ("side", {"assembly": 74, "inner_part": 70, "outer_part": 2}),
    ]  # fmt: skip
    job = job_of(tmp_path, parts, joints)
    complete(job)
    assert job.tables["couplings"]["flange"] == {"shafts": ["motor", "input"], "stiffness_Nm_per_rad": 5000.0}
    assert job.tables["machines"]["rotor"]["inertia_kg_m2"] == 0.02
    assert job.tables["machines"]["rotor"]["y_mm"] == -50.0
    ignored = job.lines("ignored")
    assert any("mass_of_component" in line for line in ignored)
    assert any("coupling 72 radial_stiffness" in line for line in ignored)


def test_oil_makes_friction_where_roughness_is_known(tmp_path):
    parts, joints = spur_pair(arithmetic_mean_roughness_flank_iso_4287_1997=0.4)
    parts = with_attributes(parts, 6, arithmetic_mean_roughness_flank_iso_4287_1997=0.6)
    parts = with_attributes(parts, 2, temperature_lubricant=40.0)
    oil = {
        "viscosity_at_40_degree_celsius": 100.0, "viscosity_at_100_degree_celsius": 11.0,
        "density_at_15_degree_celsius": 0.88,
    }  # fmt: skip
    parts.append((80, "lubricant", "VG 100", oil))
    joints.append(("reference", {"origin": 2, "referenced": 80}))
    mesh = tables_of(tmp_path, parts, joints)["meshes"]["stage"]
    assert mesh["oil_viscosity_mPa_s"] == pytest.approx(100.0 * (880.0 - 0.65 * 25.0) / 1e3, rel=1e-5)
    assert mesh["roughness_um"] == 0.5
    rough = with_attributes(parts, 6, arithmetic_mean_roughness_flank_iso_4287_1997=None)
    job = job_of(tmp_path, rough, joints)
    assert "oil_viscosity_mPa_s" not in job.tables["meshes"]["stage"]
    assert any("needs the roughness" in line for line in job.lines("ignored"))


@pytest.mark.parametrize(
    ("low", "high", "density", "temperature"),
    [
        (0.1, 0.05, 0.88, 40.0), (0.3, 0.2, 0.88, 40.0), (-5.0, 11.0, 0.88, 40.0), (100.0, 0.0, 0.88, 40.0),
        (100.0, 11.0, 0.88, -300.0), (100.0, 11.0, -0.88, 40.0), (100.0, 11.0, 0.05, 280.0), (11.0, 100.0, 0.88, 40.0),
        (9e5, 0.51, 0.88, -49.0), (1e40, 11.0, 0.88, 40.0),
    ],
)  # fmt: skip
def test_what_no_oil_has_is_ignored_in_words(tmp_path, low, high, density, temperature):
    parts, joints = spur_pair(arithmetic_mean_roughness_flank_iso_4287_1997=0.4)
    parts = with_attributes(parts, 6, arithmetic_mean_roughness_flank_iso_4287_1997=0.6)
    parts = with_attributes(parts, 2, temperature_lubricant=temperature)
    names = "viscosity_at_40_degree_celsius", "viscosity_at_100_degree_celsius", "density_at_15_degree_celsius"
    parts.append((80, "lubricant", "VG 100", dict(zip(names, (low, high, density), strict=True))))
    job = job_of(tmp_path, parts, [*joints, ("reference", {"origin": 2, "referenced": 80})])
    complete(job)
    assert "oil_viscosity_mPa_s" not in job.tables["meshes"]["stage"]
    for name in names:
        ((kind, _, rule),) = of_attribute(job, name)
        assert (kind, "out of range" in rule) == ("ignored", True)


def pulled(along: tuple[float, float, float] = (1.0, 0.0, 0.0), **more: Any) -> tuple[list[Any], list[Any]]:
    """A spur stage with a belt on its output: force and moment in the system of the shaft, and no torque."""
    parts, joints = spur_pair()
    parts = [(n, kind, name, pose(0.0, 0.0, 60.0, along) if n == 4 else a) for n, kind, name, a in parts]
    parts.append((90, "external_load", "belt", {"u_coordinate_on_shaft": 10.0, **more}))
    joints.append(("assembly", {"assembly": 4, "part": 90}))
    return parts, joints


def test_forces_across_shafts_become_forces_of_the_train(tmp_path):
    """u, v, w of the shaft are y, z, x of the job; the torque balance stays that of the loads with a torque."""
    plain = rexs_job(saved(tmp_path, xml_of(*spur_pair()))).tables
    values = {
        "force_u_direction": 5.0,
        "force_v_direction": 100.0,
        "force_w_direction": -30.0,
        "torque_around_v_axis": 2.0,
        "torque_around_w_axis": -4.0,
    }
    job = rexs_job(saved(tmp_path, xml_of(*pulled(**values))))
    (force,) = job.tables["train"]["forces"]
    expected = {"force_x_N": -30.0, "force_y_N": 5.0, "force_z_N": 100.0, "moment_x_Nm": -4.0, "moment_z_Nm": 2.0}
    assert {key: force[key] for key in expected} == expected
    assert force["shaft"] == "output"
    assert force["y_mm"] == 10.0
    assert job.tables["meshes"] == plain["meshes"]
    assert job.tables["train"]["loads"] == plain["train"]["loads"]
    derived = {entry.attribute for entry in job.entries if entry.kind == "derived" and entry.number == 90}
    assert set(values) <= derived


def test_forces_follow_the_direction_of_the_shaft(tmp_path):
    """On a shaft that runs against y, u and v turn about w; without a place a force is listed as ignored."""
    back = (-1.0, 0.0, 0.0)
    job = rexs_job(saved(tmp_path, xml_of(*pulled(back, force_u_direction=7.0, force_v_direction=100.0))))
    (force,) = job.tables["train"]["forces"]
    assert (force["force_y_N"], force["force_z_N"], force["y_mm"]) == (-7.0, -100.0, -10.0)
    parts, joints = pulled(force_v_direction=100.0)
    del parts[-1][3]["u_coordinate_on_shaft"]
    job = rexs_job(saved(tmp_path, xml_of(parts, joints)))
    assert "forces" not in job.tables["train"]
    assert any("place on the shaft" in line for line in job.lines("ignored"))


def test_forces_on_planetary_stages_are_listed():
    """The frame of the carrier turns: the force is named with its size and the reason."""
    model = read_rexs(FVA)
    shaft = next(item for item in model.of_kind("shaft") if item.name.startswith("Sonnenwelle"))
    names = {"u_coordinate_on_shaft": ("10", "mm"), "force_w_direction": ("1234.5", "N")}
    attributes = {name: Attribute(name, Decimal(value), unit) for name, (value, unit) in names.items()}
    belt = Component(9000, "external_load", "belt", attributes)
    joint = Relation(9001, "assembly", {"assembly": shaft.number, "part": 9000})
    job = rexs_job(
        dataclasses.replace(model, components={**model.components, 9000: belt}, relations=(*model.relations, joint))
    )
    assert "forces" not in job.tables["train"]
    assert any("1234.5" in line and "planetary" in line for line in job.lines("ignored"))
    assert job.tables["train"]["loads"] == rexs_job(FVA).tables["train"]["loads"]


SPECTRUM = """<load_spectrum id="1">
<load_case id="1"><component id="8" type="external_load"><attribute id="torque_around_u_axis" unit="N m">10</attribute>
</component></load_case>
<load_case id="2"><component id="8" type="external_load"><attribute id="torque_around_u_axis" unit="N m">45</attribute>
</component><component id="3" type="shaft"><attribute id="rotational_speed" unit="1 / min">300</attribute></component>
</load_case><accumulation><component id="5" type="cylindrical_gear"/></accumulation></load_spectrum>"""


def test_load_cases(tmp_path):
    parts, joints = spur_pair()
    first = job_of(tmp_path, parts, joints, more=SPECTRUM)
    complete(first)
    assert first.tables["meshes"]["stage"]["stiffness"] == {"torque_Nm": 20.0}
    assert first.tables["meshes"]["stage"]["loadmap"] == {"torques_Nm": [20.0, 90.0]}
    assert any("load case 2" in line for line in first.lines("ignored"))
    assert any("accumulation" in line for line in first.lines("ignored"))
    second = job_of(tmp_path, parts, joints, more=SPECTRUM, load_case=2)
    assert second.tables["meshes"]["stage"]["stiffness"] == {"torque_Nm": 90.0}
    assert second.tables["train"]["drive"]["speed_rad_per_s"] == pytest.approx(10.0 * math.pi, rel=1e-15)
    with pytest.raises(InputError, match="known names: 1, 2"):
        job_of(tmp_path, parts, joints, more=SPECTRUM, load_case=7)


# --- modifications --------------------------------------------------------------------------------------------------


def modified(kind: str, attributes: dict, sides=(31, 32), **gear):
    parts, joints = spur_pair(**gear)
    parts.append((90, kind, "", attributes))
    return parts, [*joints, *(("reference", {"origin": side, "referenced": 90}) for side in sides)]


@pytest.mark.parametrize(
    ("kind", "attributes", "expected"),
    [
        ("tip_relief", {"tip_relief_depth": 0.012, "tip_relief_datum_length": 1.5, "shape_of_relief": "parabolic"},
         {"tip_relief_um": 12.0, "tip_relief_length_mm": 1.5, "tip_relief_shape": "parabolic"}),
        ("tip_relief", {"tip_relief_depth": 0.012, "tip_relief_datum_diameter": 42.5, "shape_of_relief": "circular"},
         {"tip_relief_um": 12.0, "tip_relief_start_diameter_mm": 42.5, "tip_relief_shape": "arc"}),
        ("root_relief", {"root_relief_depth": 0.01, "root_relief_datum_diameter": 38.6},
         {"root_relief_um": 10.0, "root_relief_start_diameter_mm": 38.6, "root_relief_shape": "linear"}),
        ("profile_crowning", {"profile_crowning_at_tip": 0.004, "profile_crowning_at_root": 0.004},
         {"profile_crowning_um": 4.0}),
        ("helix_crowning", {"helix_crowning_amount_datum_face": 0.005, "helix_crowning_amount_non_datum_face": 0.007},
         {"helix_crowning_um": 6.0}),
        ("profile_slope", {"profile_slope": -0.003}, {"profile_slope_um": -3.0}),
        ("helix_slope", {"helix_slope": 0.008}, {"helix_slope_um": 8.0}),
        ("profile_twist", {"profile_twist": 0.002}, {"bias_um": 2.0}),
        ("end_relief_datum_face", {"end_relief_depth_datum_face": 0.02, "end_relief_length_datum_face": 3.0},
         {"end_relief_high_um": 20.0, "end_relief_high_length_mm": 3.0, "end_relief_shape": "linear"}),
        ("end_relief_non_datum_face",
         {"end_relief_depth_non_datum_face": 0.02, "end_relief_length_non_datum_face": 3.0},
         {"end_relief_low_um": 20.0, "end_relief_low_length_mm": 3.0, "end_relief_shape": "linear"}),
    ],
)  # fmt: skip
def test_modifications_of_flanks(tmp_path, kind, attributes, expected):
    job = job_of(tmp_path, *modified(kind, attributes, datum_face_orientation="positive"))
    complete(job)
    assert job.tables["gears"]["pinion"]["microgeometry"] == expected
    assert not job.left


def test_flanks_change_places_with_the_datum_face(tmp_path):
    relief = {"tip_relief_depth": 0.012, "tip_relief_datum_length": 1.5}
    for orientation, side in (("positive", "left"), ("negative", "right")):
        job = job_of(tmp_path, *modified("tip_relief", relief, (31,), datum_face_orientation=orientation))
        assert list(job.tables["gears"]["pinion"]["microgeometry"]) == [side]


@pytest.mark.parametrize("kind", ["triangular_tip_relief", "topographical_modification", "profile_deviation"])
def test_modifications_without_a_key_are_in_the_list(tmp_path, kind):
    job = job_of(tmp_path, *modified(kind, {}))
    assert any(line.startswith(f"{kind} 90") for line in job.lines("ignored"))


# --- what strangers write -------------------------------------------------------------------------------------------


def test_components_that_a_job_has_not_are_in_the_list(tmp_path):
    parts, joints = spur_pair()
    parts += [(95, "bevel_stage", "angle", {}), (96, "sleeve", "", {}), (97, "nonsense", "", {"a": 1.0})]
    job = job_of(tmp_path, parts, joints)
    complete(job)
    ignored = job.lines("ignored")
    for kind in ("bevel_stage 95", "sleeve 96", "nonsense 97"):
        assert any(line.startswith(f"{kind} component") for line in ignored)
    assert "bevel_stage 95" in job.left["train", ""][1]
    assert list(job.tables["meshes"]) == ["stage"]


def test_units_that_a_file_leaves_out_are_in_the_list(tmp_path):
    text = xml_of(*spur_pair()).replace('id="center_distance" unit="mm"', 'id="center_distance"')
    job = rexs_job(saved(tmp_path, text))
    assert job.tables["meshes"]["stage"]["centre_distance_mm"] == 60.0
    assert any("unit of center_distance" in line for line in job.lines("defaulted"))


def with_motor(kind, attributes, relation, index=1):
    """A shaft of a motor before the input shaft, and the coupling between them."""
    parts, joints = spur_pair()
    parts = with_attributes(parts, 1, gear_shift_index=index)
    parts += [
        (70, "shaft", "motor", pose(-60.0, 0.0, 0.0)),
        (71, "shaft_section", "", {"u_coordinate_on_shaft": 0.0, "length": 50.0, "outer_diameter_begin": 30.0}),
        (72, kind, "clutch", attributes),
        (74, "concept_bearing", "M", {**pose(-40.0, 0.0, 0.0), "radial_stiffness": 1e8}),
    ]  # fmt: skip
    joints += [
        ("assembly", {"assembly": 70, "part": 71}), relation,
        ("side", {"assembly": 74, "inner_part": 70, "outer_part": 2}),
    ]  # fmt: skip
    return parts, joints


def test_couplings_of_version_1_0(tmp_path):
    """A relation of its own, and a type that later versions do not have."""
    relation = ("coupling", {"assembly": 72, "side_1": 70, "side_2": 3})
    model = with_motor("fixed_coupling", {"rotational_stiffness": (5e6, "N mm / rad")}, relation)
    tables = job_of(tmp_path, *model, version="1.0").tables
    assert tables["couplings"]["clutch"] == {"shafts": ["motor", "input"], "stiffness_Nm_per_rad": 5000.0}


@pytest.mark.parametrize(("index", "engaged"), [(1, True), (2, False)])
def test_clutches_are_those_of_the_engaged_gear(tmp_path, index, engaged):
    relation = ("side", {"assembly": 72, "inner_part": 70, "outer_part": 3})
    attributes = {"rotational_stiffness": 5e6, "is_engaged": [True, False]}
    job = job_of(tmp_path, *with_motor("switchable_coupling", attributes, relation, index))
    assert ("clutch" in job.tables.get("couplings", {})) == engaged
    assert engaged or "not engaged" in job.left["couplings", "clutch"][1]


def test_places_in_the_system_of_another_component(tmp_path):
    """A gear and a bearing in the system of their shaft, which is turned about u in that of the gear unit."""
    parts, joints = spur_pair()
    parts = with_attributes(parts, 4, w_axis_vector=[0.0, -1.0, 0.0])
    within = {"reference_component_for_position": 4, "support_vector": [50.0, 0.0, 0.0]}
    parts = with_attributes(parts, 6, **within)
    parts = with_attributes(parts, 13, **{**within, "support_vector": [21.5, 0.0, 0.0]})
    tables = tables_of(tmp_path, parts, joints)
    assert tables["gears"]["wheel"]["y_mm"] == 50.0
    assert tables["bearings"]["B13"]["y_mm"] == 21.5


def test_names_of_the_model_cannot_leave_their_comments(tmp_path):
    evil = "x\n[train]\nhousing = 1 \r\u2028 \x7f ] #"
    parts, joints = spur_pair()
    parts = [(number, kind, evil if number in (3, 5) else name, attributes) for number, kind, name, attributes in parts]
    text = xml_of(parts, joints).replace("&#10;", " ")
    job = rexs_job(saved(tmp_path, text))
    assert tomllib.loads(job.text("a\n[b].rexs")) == dict(job.tables)


def test_equal_names_get_their_numbers(tmp_path):
    parts, joints = spur_pair()
    parts = [(n, kind, "Rad [1]" if n in (5, 6) else name, attributes) for n, kind, name, attributes in parts]
    assert list(tables_of(tmp_path, parts, joints)["gears"]) == ["Rad_1", "Rad_1_6"]


def test_what_no_job_can_have_is_a_comment_with_the_reason(tmp_path):
    parts, joints = spur_pair(number_of_teeth=5)
    job = job_of(tmp_path, parts, joints)
    complete(job)
    assert ">= 8" in job.left["gears", "pinion"][1]
    text = job.text()
    assert "## [gears.pinion]" in text
    assert "## [train]" in text
    assert "train" not in job.tables
    uncommented = "\n".join(line.removeprefix("## ") for line in text.splitlines())
    assert tomllib.loads(uncommented)["gears"]["pinion"]["teeth"] == 5


# --- the published examples -----------------------------------------------------------------------------------------


def test_three_stages_of_the_published_model():
    """Ratio 67/23 76/13 87/14; the model's output torque is 500 N m."""
    job = gearfe.rexs_job(SEW)
    complete(job)
    t = job.tables
    torques = [mesh["stiffness"]["torque_Nm"] for mesh in t["meshes"].values()]
    assert torques == pytest.approx([500.0 / (87 / 14) / (76 / 13), 500.0 / (87 / 14), 500.0], rel=1e-8)
    assert t["train"]["drive"]["speed_rad_per_s"] == pytest.approx(1400.0 * math.pi / 30.0, rel=1e-15)
    # an odd number of external meshes turns the sense, and the output takes power: along +y
    assert t["train"]["loads"] == [t["train"]["loads"][0] | {"shaft": "ABW", "torque_Nm": 500.0}]
    hands = [gear["helix_hand"] for gear in t["gears"].values()]
    assert hands == ["right", "left", "left", "right", "right", "left"]
    # middles of the faces where both versions of the coordinate agree with the place in space
    assert [gear["y_mm"] for gear in t["gears"].values()] == [154.0, 156.5, 175.0, 177.5, 227.0, 227.0]
    balls = {name: entry.get("elements") for name, entry in t["bearings"].items()}
    assert balls["Lager_6205-Z"] == 9
    assert not job.left


def test_the_planetary_model_balances():
    """Willis: carrier over sun 1 + 61/17 in torque; the planets share it alike."""
    job = gearfe.rexs_job(FVA)
    complete(job)
    train = job.tables["train"]
    assert train["drive"]["shaft"] == "Sonnenwelle"
    load = train["loads"][0]
    assert load["shaft"] == "Steg_1"
    assert load["torque_Nm"] == pytest.approx(-1591.5494309189535 * (1.0 + 61.0 / 17.0), rel=1e-10)
    ring = job.tables["gears"]["Hohlrad"]
    assert (ring["teeth"], ring["rim_diameter_mm"], ring["cutter_teeth"]) == (-61, -280.0, 23)
    sun, inner = job.tables["meshes"].values()  # written once for the three planets
    assert (sun["driver"], sun["driven"]) == ("Sonnenrad", "Planetenrad")
    assert (inner["driver"], inner["driven"]) == ("Planetenrad", "Hohlrad")
    share = 1591.5494309189535 / 3.0 / 17.0  # N m a tooth
    assert sun["stiffness"]["torque_Nm"] == pytest.approx(share * 22.0, rel=1e-8)
    assert inner["stiffness"]["torque_Nm"] == pytest.approx(share * 61.0, rel=1e-8)
    assert inner["stiffness_N_per_m"] == 20.0e6 * 50.0  # 20 N/(mm um) over 50 mm
    assert list(job.tables["carriers"].values()) == [{"shaft": "Steg_1", "planets": 3}]
    assert job.tables["shafts"]["Hohlradwelle"]["speed_ratio"] == 0
    # the carrier is Steg 1, the shaft between its cheeks and Steg 2: 100, 50 and 8 mm
    assert [section["length_mm"] for section in job.tables["shafts"]["Steg_1"]["sections"]] == [100.0, 50.0, 8.0]
    assert len(job.tables["shafts"]) == 4


def test_a_job_has_the_name_of_its_model(tmp_path, monkeypatch, capsys):
    """A version number in the name stays; parts without a key are printed for two of each kind, the others counted."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(FVA, tmp_path / "stage_1.1.rexs")
    assert main(["new", "--from", "stage_1.1.rexs"]) == 0
    assert (tmp_path / "stage_1.1.toml").is_file()
    said = capsys.readouterr().out
    assert said.count("not in the job, a comment in the file: bearings") == 2
    assert "... and 4 more bearings, comments in the file" in said


def test_the_command(tmp_path, capsys):
    target = tmp_path / "box.toml"
    assert main(["new", "--from", str(SEW), str(target)]) == 0
    said = capsys.readouterr().out
    assert re.search(r"\d+ read, \d+ derived, \d+ defaulted, \d+ ignored", said)
    assert f"gearfe gear {target}" in said
    raw = tomllib.loads(target.read_text(encoding="utf-8"))
    assert len(raw["gears"]) == 6
    assert main(["new", "--from", str(SEW), str(target)]) == 2
    assert "exists" in capsys.readouterr().err
    assert main(["new", "--from", str(SEW), str(target), "--force"]) == 0
    assert main(["new", "--from", str(SEW), str(target), "more.toml", "--force"]) == 2
    assert main(["new", "gearbox", str(tmp_path / "x.toml"), "--load-case", "2"]) == 2
    assert main(["new", "--from", str(tmp_path / "lost.rexs"), str(tmp_path / "y.toml")]) == 2


@pytest.mark.parametrize(("model", "said"), [(SEW, "shafts 77 mm apart"), (FVA, "radial_assembly")])
def test_gears_of_the_published_models_run(tmp_path, capsys, model, said):
    """Every mesh of the job has its geometry without an edit: helical ones, and those of a ring."""
    target = tmp_path / "box.toml"
    assert main(["new", "--from", str(model), str(target)]) == 0
    assert main(["gear", str(target), "--out", str(tmp_path / "gear"), "--no-pictures"]) == 0
    assert said in capsys.readouterr().out


def test_the_planetary_train_is_read(tmp_path):
    """Three planets with six meshes, and a carrier that turns by 17/(17 + 61) of the sun."""
    raw = tomllib.loads(gearfe.rexs_job(FVA).text())
    tables = train_tables(raw, "fva.toml")
    assert len(tables["gearbox"].meshes) == 6
    train = tables["train"]
    planets = [shaft for shaft in train.shafts if shaft.carrier is not None]
    places = sorted(math.degrees(math.atan2(shaft.z_mm, shaft.x_mm)) % 360.0 for shaft in planets)
    assert places == pytest.approx([0.0, 120.0, 240.0])
    assert [math.hypot(shaft.x_mm, shaft.z_mm) for shaft in planets] == pytest.approx(3 * [78.0])


def test_the_planetary_model_of_version_1_4():
    """JSON, power instead of torque, oil, and a part of the carrier without a place or sections."""
    job = gearfe.rexs_job(EXAMPLES / "FVA_Planetary_stage_-_Minus_gearing_1.4.rexsj")
    complete(job)
    load = job.tables["train"]["loads"][0]
    assert load["torque_Nm"] == pytest.approx(-100e3 / (50.0 * math.pi) * 78.0 / 17.0, rel=1e-10)
    sun, inner = job.tables["meshes"].values()
    assert sun["mesh_model"] == "variable_stiffness"  # helix slopes make the load vary along the width
    assert "oil_viscosity_mPa_s" not in {*sun, *inner}  # springs have no friction of their own
    assert any("oil_viscosity_mPa_s" in line for line in job.lines("ignored"))
    # the carrier reaches over its planets, which are 50 mm wide and begin at its end
    assert [section["length_mm"] for section in job.tables["shafts"]["Plate"]["sections"]] == [100.0, 50.0]
    assert train_tables(tomllib.loads(job.text()), "fva.toml")["train"].carriers


def test_shafts_without_a_place_follow_their_couplings(tmp_path):
    relation = ("side", {"assembly": 72, "inner_part": 70, "outer_part": 3})
    coupling = {"u_coordinate_on_shaft_inner_side": 50.0, "u_coordinate_on_shaft_outer_side": -5.0}
    parts, joints = with_motor("coupling", coupling, relation)
    parts = [(n, k, name, {} if n == 70 else a) for n, k, name, a in parts]
    shafts = tables_of(tmp_path, parts, joints)["shafts"]
    assert (shafts["motor"]["x_mm"], shafts["motor"]["y_mm"]) == (0.0, -30.0)  # its end at -5 mm, 50 mm long


def test_planets_that_differ_stay_apart():
    """One planet with another face width: meshes alone, and the reason in the list."""
    model = gearfe.read_rexs(FVA)
    width = model.components[248].attributes["face_width"]
    model.components[248].attributes["face_width"] = dataclasses.replace(width, value=Decimal(49))
    job = rexs_job(model)
    complete(job)
    assert "carriers" not in job.tables
    assert len(job.tables["meshes"]) == 6
    assert "train" not in job.tables
    assert any("planets differ" in line for line in job.lines("ignored"))


def test_tips_of_a_ring_stay_on_the_involutes_of_the_planets():
    """Root form circle of the planets by ISO 21771: 82.8268 mm; the tip of the ring may reach 0.9347 modules."""
    assert gearfe.rexs_job(FVA).tables["gears"]["Hohlrad"]["addendum"] == 0.9


def test_meshes_whose_load_varies_along_the_width_are_springs():
    models = [mesh.get("mesh_model") for mesh in gearfe.rexs_job(SEW).tables["meshes"].values()]
    assert models == 3 * ["variable_stiffness"]


def test_a_rating_of_the_model(tmp_path):
    """Hardness, yield strength, roughness, quality, series of DIN 3967 and oil become [rating]."""
    gear = {
        "arithmetic_mean_roughness_flank_iso_4287_1997": 0.5,
        "global_tolerance_class_iso_1328_2013": "5",
        "tooth_thickness_deviation_tolerance_series_din_3967_1978": "cd25",
    }
    parts, joints = spur_pair(**gear)
    oil = {
        "viscosity_at_40_degree_celsius": 220.0,
        "viscosity_at_100_degree_celsius": 19.0,
        "density_at_15_degree_celsius": 0.89,
    }
    parts = with_attributes(parts, 2, temperature_lubricant=80.0)
    parts = with_attributes(parts, 10, surface_hardness_vickers=720.0, yield_strength=900.0)
    parts.append((80, "lubricant", "oil", oil))
    job = job_of(tmp_path, parts, [*joints, ("reference", {"origin": 2, "referenced": 80})])
    complete(job)
    table = job.tables["rating"]
    assert table["viscosity_40_mm2_per_s"] == 220.0
    assert table["viscosity_100_mm2_per_s"] == 19.0
    assert table["oil_temperature_C"] == 80.0
    assert table["oil_density_kg_per_m3"] == pytest.approx(890.0)
    pinion, wheel = table["gears"]["pinion"], table["gears"]["wheel"]
    assert wheel == {"material": "Eh", "hardness": 720.0, "yield_strength_MPa": 900.0}
    rough = {"quality": 5, "flank_ra_um": 0.5, "flank_roughness_um": 3.0, "thickness_series": "cd25"}
    assert pinion == wheel | rough


@pytest.mark.parametrize(
    ("treated", "values", "material", "hardness"),
    [
        ("nitrided_steel", {"surface_hardness_vickers": 700.0}, "NT", 700.0),
        ("nitrided_through_hardened_steel", {}, "NV", None),
        ("normalized_wrought_low_carbon_steel", {"surface_hardness_vickers": 200.0}, "St", 190.0),
        ("grey_cast_iron", {"surface_hardness_vickers": 200.0, "yield_strength": 250.0}, "GG", 190.0),
        ("nodular_cast_iron_perlitic_or_bainitic_structure", {}, "GGG", None),
        ("black_malleable_cast_iron", {}, "GTS", None),
        ("through_hardened_wrought_steel", {"surface_hardness_vickers": 420.0}, "V", 420.0),
        ("through_hardened_cast_steel", {"surface_hardness_vickers": 300.0}, "V_cast", 300.0),
        ("flame_or_induction_hardened_steel", {"surface_hardness_vickers": 650.0}, "IF", 650.0),
    ],
)
def test_no_material_is_replaced_by_another(tmp_path, treated, values, material, hardness):
    """A heat treatment becomes the material of the rating even if hardness or yield strength are missing or strange."""
    parts, joints = spur_pair()
    parts = with_attributes(parts, 10, heat_treated_material_type_iso_6336_2019=treated, **values)
    job = job_of(tmp_path, parts, joints)
    complete(job)
    for entry in job.tables["rating"]["gears"].values():
        assert entry["material"] == material
        assert entry.get("hardness") == (None if hardness is None else pytest.approx(hardness))
        assert entry.get("yield_strength_MPa") == values.get("yield_strength")
    assert not [entry for entry in job.entries if entry.kind == "ignored" and "rating" in entry.attribute]


def test_a_heat_treatment_without_a_material_of_the_standard_is_listed_as_ignored(tmp_path):
    """A type of heat treatment and a yield strength that the rating does not take are not noted as read."""
    parts, joints = spur_pair()
    name = "heat_treated_material_type_iso_6336_2019"
    parts = with_attributes(parts, 10, **{name: "not_heat_treated"}, yield_strength=300.0)
    job = job_of(tmp_path, parts, joints)
    kinds = {(entry.attribute, entry.kind) for entry in job.entries}
    for attribute in (name, "yield_strength"):
        assert (attribute, "ignored") in kinds
        assert (attribute, "read") not in kinds


def test_a_material_without_an_elastic_modulus_has_its_strength_in_the_rating(tmp_path):
    """The elastic modulus decides on [materials] only."""
    parts, joints = spur_pair()
    parts = with_attributes(parts, 10, elastic_modulus=None, heat_treated_material_type_iso_6336_2019="nitrided_steel")
    gears = job_of(tmp_path, parts, joints).tables["rating"]["gears"]
    assert [entry["material"] for entry in gears.values()] == ["NT", "NT"]
