"""Jobs as REXS 2.0: valid by the table of the schema, and back again without a change of any number."""

from __future__ import annotations

import dataclasses
import functools
import json
import math
import os
import tomllib
import zipfile
from decimal import Decimal
from typing import Any

import pytest

import gearfe
from gearfe.base.errors import InputError
from gearfe.base.tables.examples import job_file
from gearfe.base.tables.jobs import gearbox_of, train_tables
from gearfe.cli.main import main
from gearfe.drivetrain.gearbox.rexs_results import RexsResults
from gearfe.output.exchange.rexs import Model, read_rexs, rexs_job, write_rexs
from gearfe.output.exchange.rexs.read import read_model
from gearfe.output.exchange.rexs.schema import OWN, schema
from gearfe.output.exchange.rexs.units import UNITS
from gearfe.output.exchange.rexs.write import rexs_bytes
from tests.makers.rexs_models import saved, spur_pair, xml_of
from tests.places import DATA, GEOMETRY

EXAMPLES = sorted((DATA / "rexs").glob("*.rexs*"))

#: A job with every table by name, and numbers that no decimal has: thirds, and those with all digits.
ODD = """
[materials.steel]
youngs_modulus_GPa = 206.33333333333334
poisson_ratio = 0.29
density_kg_per_m3 = 7833.123456789012
[materials.iron]
youngs_modulus_GPa = 170.1

[gears.sun-1]
teeth = 21
module_mm = 2.1166666666666667
pressure_angle_deg = 22.5
helix_angle_deg = 13.1
helix_hand = "left"
face_width_mm = 20.1
profile_shift = 0.1
addendum = 1.05
dedendum = 1.3
rack_tip_radius = 0.2
tip_round_mm = 0.07
tooth_thinning_um = 33.3
bore_diameter_mm = 17.7
material = "steel"
shaft = "in_"
y_mm = 3.3333333333333335
[gears.sun-1.microgeometry]
tip_relief_um = 11.1
tip_relief_length_mm = 1.3
helix_crowning_um = 4.7
profile_slope_um = -2.3
end_relief_low_um = 7.0
end_relief_low_length_mm = 2.0
[[gears.sun-1.microgeometry.waviness]]
amplitude_um = 0.3
waves = 21
[gears.sun-1.microgeometry.right]
tip_relief_um = 5.5
tip_relief_length_mm = 1.1

[gears.wheel]
teeth = 40
module_mm = 2.1166666666666667
pressure_angle_deg = 22.5
helix_angle_deg = 13.1
face_width_mm = 19.9
profile_shift = "from centre distance"
bore_diameter_mm = 30.0
material = { youngs_modulus_GPa = 199.9 }
shaft = "out"
y_mm = 3.0

[meshes.first]
driver = "sun-1"
driven = "wheel"
centre_distance_mm = 67.12345678901234
mesh_model = "mean_stiffness"
damping_N_s_per_m = 12.5
misalignment_um = 3.0
[meshes.first.stiffness]
torque_Nm = 77.7
[meshes.first.loadmap]
torques_Nm = [10.0, 77.7]

[shafts.in_]
x_mm = -12.345678901234567
z_mm = 0.1
y_mm = 1.1
material = "steel"
damping_ratio = 0.01
[[shafts.in_.sections]]
length_mm = 33.3
outer_diameter_mm = 18.1
[[shafts.in_.sections]]
length_mm = 41.7
outer_diameter_start_mm = 20.0
outer_diameter_end_mm = 25.1
inner_diameter_mm = 3.3
material = "iron"

[shafts.out]
x_mm = 54.777777777777886
z_mm = 0.1
length_mm = 80.0
radius_mm = 15.0
initial_speed_rad_per_s = 3.0

[bearings.A]
shaft = "in_"
y_mm = -30.3
type = "deep_groove_ball"
elements = 9
element_diameter_mm = 7.938
pitch_diameter_mm = 38.5
inner_osculation = 0.5173
radial_clearance_um = 4.1
damping_N_s_per_m = [1.0, 2.0, 3.0]
tilt_damping_Nm_s_per_rad = [0.0, 0.0]
[bearings.B]
shaft = "in_"
y_mm = 33.0
type = "angular_contact_ball"
elements = 12
element_diameter_mm = 7.0
pitch_diameter_mm = 38.0
contact_angle_deg = 25.0
carries = "-y"
axial_preload_um = 3.0
[bearings.C]
shaft = "out"
y_mm = -30.0
stiffness_N_per_m = [1.1e8, 2.2e7, 3.3e8]
tilt_stiffness_Nm_per_rad = [1.7e4, 1.9e4]
[bearings.D]
shaft = "out"
y_mm = 30.0
stiffness_N_per_m = [3e8, 0.0, 3e8]
tilt_stiffness_Nm_per_rad = [1e4, 1e4]
[bearings.E]
shaft = "out"
y_mm = 35.0

[machines.motor]
shaft = "in_"
y_mm = -40.0
inertia_kg_m2 = 0.0123
stiffness_Nm_per_rad = 4567.8

[stiffness]
kinematics = "small"
[train]
housing = "rigid"
duration_ms = 12.3
[train.drive]
shaft = "in_"
y_mm = -35.0
speed_rad_per_s = 123.45678901234567
[[train.loads]]
shaft = "out"
torque_Nm = 147.1
[[train.forces]]
shaft = "out"
y_mm = 12.3
force_x_N = 33.333333333333336
moment_z_Nm = -1.1
[train.damping]
rayleigh_beta_s = 3.3e-7
[modes]
[runup]
speed_start_rad_per_s = 10.0
speed_stop_rad_per_s = 200.0
"""

JOBS = {
    "gearbox": job_file("gearbox"),
    "odd": ODD,
    **{path.stem[:3] + path.stem[-3:]: rexs_job(path).text(path.name) for path in EXAMPLES},
}


@pytest.mark.parametrize("form", ["xml", "json", "zip"])
@pytest.mark.parametrize("name", JOBS)
def test_a_job_comes_back_without_a_change(name, form):
    raw = tomllib.loads(JOBS[name])
    back = rexs_job(read_model(rexs_bytes(raw, form), name))
    assert dict(back.tables) == raw
    assert tomllib.loads(back.text()) == raw
    assert not back.left


def check_valid(model: Model) -> None:
    """Check component types, attributes, units, types of values, enumerations, relations and their order."""
    table = schema()
    assert model.version == "2.0"
    cases = [part for spectrum in model.spectra for case in spectrum.cases for part in case.components]
    for component in [*model.components.values(), *cases]:
        assert component.kind in table.components
        for attribute in component.attributes.values():
            if attribute.name.startswith(OWN):
                assert attribute.unit == "none"
                continue
            known = table.attribute(component.kind, attribute.name)
            assert known is not None, (component.kind, attribute.name)
            assert attribute.unit == known.unit
            assert attribute.unit in UNITS
            assert not known.choices or attribute.value in known.choices, attribute
    kinds = {number: component.kind for number, component in model.components.items()}
    for relation in model.relations:
        joined = frozenset((kinds[number], role) for role, number in relation.roles.items())
        assert joined in table.relations[relation.kind], (relation.kind, joined)
        assert (relation.order is not None) == (relation.kind in table.ordered)


@pytest.mark.parametrize("name", JOBS)
def test_files_are_valid_by_the_table_of_the_schema(name):
    check_valid(read_model(rexs_bytes(tomllib.loads(JOBS[name])), name))


def test_other_programs_find_what_rexs_can_say():
    """Without the attributes of this program the numbers of the standard are those of the job."""
    raw = tomllib.loads(ODD)
    model = read_model(rexs_bytes(raw), "odd")
    by_name = {(part.kind, part.name): part for part in model.components.values()}

    def number(kind: str, name: str, attribute: str, unit: str) -> float:
        return by_name[kind, name].attributes[attribute].number(unit)

    assert number("cylindrical_gear", "sun-1", "normal_module", "mm") == 2.1166666666666667
    assert number("cylindrical_gear", "sun-1", "helix_angle_reference_diameter", "deg") == -13.1
    assert number("material", "steel", "elastic_modulus", "GPa") == 206.33333333333334
    assert number("material", "steel", "density", "kg / m^3") == 7833.123456789012
    assert number("shaft", "in_", "rotational_speed", "rad / s") == 123.45678901234567
    assert number("concept_bearing", "D", "bending_stiffness", "N m / rad") == 1e4
    assert number("external_load", "load 1", "torque_around_u_axis", "N m") == 147.1
    assert number("external_load", "force 1", "force_w_direction", "N") == 33.333333333333336
    assert number("external_load", "force 1", "torque_around_v_axis", "N m") == -1.1
    tip = [part.attributes["tip_relief_depth"].number("um") for part in model.of_kind("tip_relief")]
    assert tip == [11.1, 5.5]  # left and right


def test_bare_models_keep_the_standard_part(tmp_path):
    """A job of another program's model, written without the attributes of this one, has the same gears and shafts."""
    first = rexs_job(saved(tmp_path, xml_of(*spur_pair())))
    model = read_model(rexs_bytes(first.tables), "x")
    for component in model.components.values():
        for name in [name for name in component.attributes if name.startswith(OWN)]:
            del component.attributes[name]
    again = rexs_job(model).tables
    for kind in ("materials", "gears", "meshes", "shafts", "bearings"):
        assert again[kind] == first.tables[kind], kind
    assert again["train"]["drive"] == first.tables["train"]["drive"]


def test_a_pair_with_its_flanks():
    """[pair] and [microgeometry] become gears by name with the same numbers."""
    raw: dict[str, Any] = tomllib.loads(job_file("loadmap"))
    back = rexs_job(read_model(rexs_bytes(raw), "pair")).tables
    one, two = (next(iter(gearbox_of(job, "x").meshes.values())) for job in (raw, dict(back)))
    assert dict(two.driver.form) == dict(one.driver.form)
    assert dict(two.driven.form) == dict(one.driven.form)
    assert two.driver.microgeometry == one.driver.microgeometry
    assert two.driver.material == one.driver.material
    assert back["loadmap"]["torques_Nm"] == raw["loadmap"]["torques_Nm"]


def test_tables_of_a_mesh_find_that_of_a_pair(tmp_path, capsys):
    """[rating.meshes.pinion-wheel] of a job with [pair] holds for the mesh that comes back."""
    source = (GEOMETRY / "fzg_c.toml").read_text() + "\n[rating.meshes.pinion-wheel]\nlife_h = 600.0\n"
    back = rexs_job(read_model(rexs_bytes(tomllib.loads(source)), "fzg"))
    assert list(back.tables["meshes"]) == ["pinion-wheel"]
    (tmp_path / "back.toml").write_text(back.text())
    assert main(["rating", str(tmp_path / "back.toml"), "--no-pictures", "--out", str(tmp_path / "out")]) == 0
    assert "error" not in capsys.readouterr().err


@pytest.mark.parametrize("name", ["gear_train.toml", "helical.toml"])
def test_lists_of_a_train(name):
    """[[train.shafts]] and so on become tables by name: what the commands read of both is the same."""
    raw = tomllib.loads((GEOMETRY / name).read_text(encoding="utf-8"))
    back = rexs_job(read_model(rexs_bytes(raw), name))
    assert not back.left
    one, two = (train_tables(job, name, "") for job in (raw, dict(back.tables)))
    for gear, other in ((gear, two["gearbox"].gears[key]) for key, gear in one["gearbox"].gears.items() if gear.shaft):
        for key in ("form", "y_mm", "shaft", "teeth", "density_kg_per_m3", "material", "microgeometry"):
            assert getattr(gear, key) == getattr(other, key), (gear.name, key)
    for kind in ("shafts", "bearings", "machines", "couplings", "drive", "loads", "damping", "curves", "variants"):
        assert getattr(one["train"], kind) == getattr(two["train"], kind), kind
    for mesh, other in zip(one["train"].meshes, two["train"].meshes, strict=True):
        same = [item.name for item in dataclasses.fields(mesh) if item.name != "centre_distance_mm"]
        assert [getattr(mesh, key) for key in same] == [getattr(other, key) for key in same]
    for key, mesh in one["gearbox"].meshes.items():
        other = two["gearbox"].meshes.get(key)
        if other is not None:
            for value in ("centre_distance_mm", "misalignment_um", "misalignment_across_um"):
                assert getattr(mesh, value) == getattr(other, value)


def test_keys_that_follow_late_come_back():
    """A mesh whose springs follow from its width, with a further key that REXS does not have."""
    raw = dict(rexs_job(EXAMPLES[-1]).tables)
    mesh = next(iter(raw["meshes"].values()))
    assert mesh["mesh_model"] == "variable_stiffness"
    raw["meshes"] = {**raw["meshes"], next(iter(raw["meshes"])): {**mesh, "damping_N_s_per_m": 3.0}}
    assert dict(rexs_job(read_model(rexs_bytes(raw), "x")).tables) == raw


def test_json_numbers_are_numbers(tmp_path):
    path = tmp_path / "a.rexsj"
    write_rexs(tomllib.loads(ODD), path)
    tree = json.loads(path.read_text(encoding="utf-8"), parse_float=Decimal)
    values = [
        a["floating_point"] for c in tree["model"]["components"] for a in c["attributes"] if "floating_point" in a
    ]
    assert len(values) > 50
    assert all(isinstance(value, (Decimal, int)) for value in values)


def test_files_by_their_endings(tmp_path):
    raw = tomllib.loads(job_file("gearbox"))
    for name in ("a.rexs", "a.rexsj", "a.rexsz", "a.rexs.zip"):
        gearfe.write_rexs(raw, tmp_path / name)
        assert dict(gearfe.rexs_job(tmp_path / name).tables) == raw
    assert zipfile.is_zipfile(tmp_path / "a.rexsz")
    with pytest.raises(InputError, match=r"must end in \.rexs"):
        write_rexs(raw, tmp_path / "a.xml")
    assert not (tmp_path / "a.xml").exists()


def test_what_is_no_gearbox_is_refused(tmp_path):
    with pytest.raises(InputError, match="gears by name"):
        write_rexs({"bodies": {}, "run": {}}, tmp_path / "a.rexs")
    raw = tomllib.loads(job_file("gearbox"))
    raw["gears"]["input_pinion"]["teeth"] = "many"
    with pytest.raises(InputError, match=r"input_pinion\.teeth"):
        write_rexs(raw, tmp_path / "a.rexs")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("table = 'nonsense'\nkept = []\n[keys]", "nonsense"),
        ("table = 'gears'\nkept = []\n[keys]\nteeth = '21'", ""),
        ("table = 'gears'\nkept = []\nkeys = 3", "must have a table keys"),
        ("table = 'gears'\nkept = 'teeth'", "a list kept"),
        ("= = =", "not valid TOML"),
        ("[" * 10_000, "not valid TOML"),
    ],
)
def test_own_attributes_of_strangers_are_checked(tmp_path, text, words):
    parts, joints = spur_pair(custom_gearfe_keys=text)
    path = saved(tmp_path, xml_of(parts, joints))
    if words:
        with pytest.raises(InputError, match=words):
            rexs_job(path)
    else:  # a key of a wrong type is a comment
        assert "teeth" in rexs_job(path).left["gears", "pinion"][1]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("train = 3", "must be a separate table"),
        ("[nonsense]\na = 1", "nonsense"),
        ("[train]\nnonsense = 1", "nonsense"),
        ("[gears.x]\nteeth = 20", "separate table"),
    ],
)
def test_own_tables_of_strangers_are_checked(tmp_path, text, words):
    parts, joints = spur_pair()
    parts = [(n, kind, name, {**a, "custom_gearfe_tables": text} if n == 1 else a) for n, kind, name, a in parts]
    with pytest.raises(InputError, match=words):
        rexs_job(saved(tmp_path, xml_of(parts, joints)))


def test_the_command(tmp_path, capsys):
    job = tmp_path / "box.toml"
    job.write_text(ODD, encoding="utf-8")
    assert main(["gear", str(job), "--out", str(tmp_path / "out"), "--export", "rexs", "--no-pictures"]) == 0
    shown = capsys.readouterr()
    assert "gearbox.rexs" in shown.out
    assert "no statics of the train in the REXS file: machine 'motor'" in shown.err
    assert dict(rexs_job(tmp_path / "out" / "gearbox.rexs").tables) == tomllib.loads(ODD)
    assert read_rexs(tmp_path / "out" / "gearbox.rexs").application.startswith("gearfe")


# --- results --------------------------------------------------------------------------------------------------------

RATED = """
[rating]
quality = 6
hardness = 700.0
material = "Eh"
"""


#: Jobs whose train can run; in that with odd numbers a machine is beyond the end of its shaft.
TRAINS = [name for name in JOBS if name != "odd"]


@functools.cache
def with_results(name: str) -> tuple[dict[str, Any], RexsResults]:
    """A job of `JOBS`, rated, and its results."""
    raw = tomllib.loads(JOBS[name] + ("" if "[rating]" in JOBS[name] else RATED))
    return raw, gearfe.rexs_results(raw)


@pytest.mark.parametrize("form", ["xml", "json", "zip"])
@pytest.mark.parametrize("name", TRAINS)
def test_files_with_results_are_valid_and_change_no_number(name, form):
    raw, known = with_results(name)
    assert not known.notes
    model = read_model(rexs_bytes(raw, form, name, known.results), name)
    check_valid(model)
    back = rexs_job(model)
    assert dict(back.tables) == raw
    assert not back.left
    written = {(part.kind, attribute) for part in model.spectra[0].cases[0].components for attribute in part.attributes}
    assert ("cylindrical_stage_gear_data", "safety_factor_pitting_iso_6336_2019") in written
    assert ("shaft", "rotational_speed") in written
    ignored = {entry.attribute for entry in back.entries if entry.kind == "ignored"}
    assert "safety_factor_pitting_iso_6336_2019" in ignored  # the reader lists what it has no key for


def test_every_result_has_an_attribute_in_the_schema():
    """A name that no component of its table has would be left out silently."""
    kinds = {
        "gears": ("cylindrical_gear", "ring_gear"),
        "meshes": ("cylindrical_stage",),
        "shafts": ("shaft",),
        "bearings": ("rolling_bearing_with_detailed_geometry",),
        "gear_data": ("cylindrical_stage_gear_data",),
    }
    for edition in (2006, 2019):
        for name in TRAINS:
            raw, _ = with_results(name)
            raw = {**raw, "rating": {**raw["rating"], "edition": edition}}
            for result in gearfe.rexs_results(raw).results:
                known = [schema().attribute(kind, result.attribute) for kind in kinds[result.table]]
                if (edition, result.attribute) != (2006, "load_distribution_influence_factor_tooth_root_iso_6336_2006"):
                    assert any(known), result


@pytest.mark.parametrize("name", TRAINS)
def test_forces_on_every_shaft_balance(name):
    """Tooth forces, bearing forces and the torques of drive and loads, on shafts with gears that are no planets."""
    raw, known = with_results(name)
    number = {(r.table, r.name, r.attribute): r.value for r in known.results}
    loads = raw["train"]["loads"]
    for shaft in (shaft for shaft in raw["shafts"] if not raw["shafts"][shaft].get("carrier")):
        gears = [gear for gear, entry in raw["gears"].items() if entry["shaft"] == shaft]
        carried = [bearing for bearing, entry in raw["bearings"].items() if entry["shaft"] == shaft]
        largest = sum(abs(number["gears", gear, f"force_acting_on_shaft_{a}"]) for gear in gears for a in "uvw")
        for axis in "uvw":
            forces = [number["gears", gear, f"force_acting_on_shaft_{axis}"] for gear in gears]
            forces += [number["bearings", item, f"force_acting_on_inner_component_{axis}"] for item in carried]
            assert sum(forces) == pytest.approx(0.0, abs=1e-6 * max(largest, 1.0))
        given = sum(load["torque_Nm"] for load in loads if load["shaft"] == shaft)
        # rings are held, sun and planets are driven: their torque is the train's own
        if shaft != raw["train"]["drive"]["shaft"] and raw["shafts"][shaft].get("speed_ratio") != 0.0 and gears:
            turned = sum(number["gears", gear, "torque_acting_on_shaft_u"] for gear in gears)
            assert turned == pytest.approx(-given, abs=1e-9 * largest)


def test_forces_balance_where_errors_of_pins_divide_the_torque():
    """On sun, ring and planets at a speed without centrifugal forces; the sun has the torque of the load."""
    raw = tomllib.loads((GEOMETRY / "planetary.toml").read_text(encoding="utf-8"))
    raw["carriers"]["arm"]["pin_tangential_errors_um"] = [60.0, 0.0, -20.0]
    raw["train"]["drive"]["speed_rad_per_s"] = 0.01
    number = {(r.table, r.name, r.attribute): r.value for r in gearfe.rexs_results(raw).results}
    shares = [number["gear_data", f"sun_planet{k}/sun", "torque"] for k in ("", "_2", "_3")]
    assert max(shares) - min(shares) > 0.01 * abs(sum(shares))
    assert sum(shares) == pytest.approx(-7302.0 * 17 / 78)
    for shaft in ("sun", "ring"):
        largest = abs(number["gears", shaft, "force_acting_on_shaft_v"])
        assert largest > 500.0
        for axis in "vw":
            push = number["gears", shaft, f"force_acting_on_shaft_{axis}"]
            carried = number["bearings", shaft, f"force_acting_on_inner_component_{axis}"]
            assert push + carried == pytest.approx(0.0, abs=1e-6 * largest)
    for planet in ("planet", "planet_2", "planet_3"):
        assert number["gears", planet, "torque_acting_on_shaft_u"] == pytest.approx(0.0, abs=1e-6 * 500.0)


def test_results_are_those_of_the_rating_and_of_statics():
    """S_H of `gearfe.rate_mesh`; tooth forces of the last stage of the first model, 500 N m at its output."""
    name = next(name for name in TRAINS if name.startswith("SEW"))
    raw, known = with_results(name)
    number = {(r.table, r.name, r.attribute): r for r in known.results}
    mesh, entry = list(raw["meshes"].items())[-1]
    gear = raw["gears"][entry["driven"]]
    helix, width = math.radians(gear["helix_angle_deg"]), gear["teeth"] * gear["module_mm"]
    tangential = 2e3 * 500.0 * math.cos(helix) / width
    where = f"{mesh}/{entry['driven']}"
    of_mesh = number["meshes", mesh, "nominal_tangential_force_at_reference_diameter"]
    assert of_mesh.value == pytest.approx(tangential)
    axial = number["gear_data", where, "total_tooth_force_u_direction"]
    assert abs(axial.value) == pytest.approx(tangential * math.tan(helix))
    assert abs(number["gear_data", where, "torque"].value) == pytest.approx(500.0)
    assert number["gear_data", where, "power_for_rotational_speed"].value == pytest.approx(
        500.0 * abs(number["shafts", gear["shaft"], "rotational_speed"].value)
    )


@pytest.mark.parametrize("place", ["stiffness/first", "first"])
def test_curves_of_stiffness_are_taken_from_their_folder(tmp_path, place):
    """With the last torque's face load factor, unless the job file is newer than they are."""
    job, folder = tmp_path / "box.toml", tmp_path / "out"
    job.write_text(job_file("gearbox"), encoding="utf-8")
    place = folder / place
    place.mkdir(parents=True)
    (place / "stiffness.csv").write_text(
        "pinion_angle_deg,k_tangent_N_per_m\n0,2e8\n5,nan\n10,2.5e8\n", encoding="utf-8"
    )
    (place / "summary.json").write_text('{"by_torque": {"K_H_beta": [1.5, 1.25]}}', encoding="utf-8")
    known = gearfe.rexs_results(job, folder)
    found = {result.attribute: result for result in known.results if result.name.startswith("first")}
    assert found["meshing_stiffness_characteristic"].value == [2e8, 2.5e8]
    assert found["face_load_factor_contact_stress"].value == 1.25
    path = tmp_path / "box.rexs"
    write_rexs(job, path, known.results)
    case = read_rexs(path).spectra[0].cases[0]
    curve = next(part.attributes for part in case.components if "meshing_stiffness_characteristic" in part.attributes)
    assert [float(value) for value in curve["meshing_stiffness_characteristic"].value] == [2e5, 2.5e5]  # N/mm
    later = (place / "stiffness.csv").stat().st_mtime + 10.0
    os.utime(job, (later, later))
    known = gearfe.rexs_results(job, folder)
    assert "meshing_stiffness_characteristic" not in {result.attribute for result in known.results}
    assert any("changed after" in note for note in known.notes)


def test_what_cannot_be_computed_is_named():
    """A load that reacts on a bearing that does not exist, and a hardness out of range: the file has the rest."""
    raw = tomllib.loads(job_file("gearbox"))
    raw["train"]["loads"][0]["attachment"] = "nowhere"
    raw["rating"] = {"hardness": 100.0}
    known = gearfe.rexs_results(raw)
    assert [note.partition(":")[0] for note in known.notes] == [
        "no statics of the train in the REXS file",
        *(f"no rating of mesh {name} in the REXS file" for name in raw["meshes"]),
    ]
    assert dict(rexs_job(read_model(rexs_bytes(raw, "xml", "x", known.results), "x")).tables) == raw


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--export", "rexs", "--results", "nowhere"], "is no folder"),
        (["--export", "rexs", "--results", "box.toml"], "is no folder"),
        (["--results", "."], "is of --export rexs only"),
    ],
)
def test_a_folder_of_results_that_is_not_used_is_named(options, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "box.toml").write_text(job_file("gearbox"), encoding="utf-8")
    assert main(["gear", "box.toml", "--no-pictures", *options]) == 2
    assert words in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["box.toml"]
