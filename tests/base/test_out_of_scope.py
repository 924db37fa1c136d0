"""What is out of scope is refused by its name, bounds are those of the key that was written, no message is long."""

from __future__ import annotations

import dataclasses
import math
import re
import typing
from collections.abc import Iterator
from pathlib import Path

import pytest

from gearfe.base.config import read_toml, type_hints
from gearfe.base.errors import GEAR_TABLES, LONGEST_MESSAGE, OUT_OF_SCOPE, SYMBOLS, InputError, UnitWarning
from gearfe.base.suspects import suspects
from gearfe.base.tables.jobs import TABLES, table_class
from gearfe.cli.main import main
from gearfe.fem.plane import Material
from gearfe.gears.geometry.curves import inverse_inv
from tests.places import GEOMETRY

JOB = str(GEOMETRY / "gear_train.toml")
LONG = "q" * 10_000
SPACED = "q " * 5_000


def refused(capsys: pytest.CaptureFixture[str], *line: str) -> str:
    assert main(list(line)) == 2
    message = capsys.readouterr().err
    assert message.startswith("gearfe: error: ")
    assert len(message) < LONGEST_MESSAGE + 100
    return message


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ("pair.double_helical=true", "double helical gears"),
        ("pair.transverse_module_mm=3", "data of the transverse section"),
        ("pair.wheel.internal=true", "internal gears"),
        ("pair.wheel.ring=true", "internal gears"),
        ("train.planets=3", "planetary gears"),
        ("train.carrier='arm'", "planetary gears"),
        ("pair.pinion.cone_angle_deg=30", "bevel gears"),
        ("worm.starts=2", "worm gears"),
        ("pair.lead_crowning_um=5", "along the face width"),
        ("train.shafts.0.torsional_stiffness_Nm_per_rad=1e5", "elastic shafts"),
        ("pair.spiral_angle_deg=30", "bevel gears"),
        ("pair.cone_distance_mm=50", "bevel gears"),
        ("pair.shaft_angle_deg=90", "shafts that are not parallel"),
        ("pair.alpha_t_deg=20", "data of the transverse section"),
        ("pair.coast_side_pressure_angle_deg=25", "asymmetric teeth"),
        ("pair.tooth_form='cycloid'", "teeth of another form"),
        ("pair.pinion.rack=true", "racks"),
        ("pair.temperature_C=80", "temperatures"),
        ("pair.material.yield_strength_MPa=400", "materials that yield"),
        ("pair.wheel.rim_thickness_mm=5", "webs and rims by this name"),
        ("pair.pinion.web_thickness_mm=8", "web_width_mm"),
    ],
)
def test_well_known_names_are_not_taken_for_slips(change: str, what: str, capsys: pytest.CaptureFixture[str]) -> None:
    message = refused(capsys, "gear", JOB, "--set", change)
    assert what in message
    assert "not supported" in message
    assert "spur gears" in message
    assert "did you mean" not in message


def test_negative_numbers_of_teeth_are_internal_gears(capsys: pytest.CaptureFixture[str]) -> None:
    assert "held at its rim" in refused(capsys, "gear", JOB, "--set", "pair.wheel.teeth=-60")


def keys_of(table: type) -> Iterator[str]:
    """Keys of a table and of the tables within it."""
    for name, hint in type_hints(table).items():
        yield name
        for inner in (hint, *typing.get_args(hint)):
            for one in (inner, *typing.get_args(inner)):
                if dataclasses.is_dataclass(one):
                    yield from keys_of(typing.cast(type, one))


@pytest.mark.parametrize("table", sorted(set(TABLES) & set(GEAR_TABLES)))
def test_no_key_that_exists_is_out_of_scope(table: str) -> None:
    refused = [words for words, (what, _) in OUT_OF_SCOPE.items() if not what.endswith("by this name")]
    for key in set(keys_of(table_class(table))):
        # [microgeometry] has a crowning of the profile; elsewhere the word means that of the lead
        assert key == "profile_crowning_um" or not any(re.search(words, key) for words in refused), key


def test_symbols_stand_for_keys_that_exist() -> None:
    keys = {key for table in TABLES for key in keys_of(table_class(table))}
    assert set(SYMBOLS.values()) <= keys


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ("pair.pinion.z=20", "teeth"), ("pair.m_n=3", "module_mm"), ("pair.alpha_deg=20", "pressure_angle_deg"),
        ("pair.beta_deg=15", "helix_angle_deg"), ("pair.normal_pressure_angle_deg=20", "pressure_angle_deg"),
        ("pair.b_mm=20", "face_width_mm"), ("pair.pinion.x1=0.2", "profile_shift"), ("pair.a=96", "centre_distance_mm"),
        ("pair.pinion.d_a_mm=75", "tip_diameter_mm"), ("pair.material.E_MPa=210000", "youngs_modulus_GPa"),
        ("pair.material.nu=0.3", "poisson_ratio"), ("pair.material.rho=7850", "density_kg_per_m3"),
        ("train.drive.n_rpm=1500", "speed_rad_per_s"),
    ],
)  # fmt: skip
def test_symbols_of_gear_technology(change: str, key: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert f"did you mean {key!r}?" in refused(capsys, "gear", JOB, "--set", change)


@pytest.mark.parametrize(("word", "kind"), [("revolute", "hinge"), ("translational", "prismatic"), ("weld", "fixed")])
def test_joints_by_their_names_in_other_programs(
    word: str, kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    job = mechanism(tmp_path, ('type = "hinge"', f'type = "{word}"'))
    assert f"did you mean {kind!r}?" in refused(capsys, "mechanism", str(job), "--out", str(tmp_path / "out"))


def contact_ratio(distance: float, tips: tuple[float, float], bases: tuple[float, float], base_pitch: float) -> float:
    """ISO 21771: (sqrt(ra1^2 - rb1^2) + sqrt(ra2^2 - rb2^2) - sqrt(a^2 - (rb1 + rb2)^2)) / p_b."""
    rolls = sum(math.sqrt(tip**2 - base**2) for tip, base in zip(tips, bases, strict=True))
    return (rolls - math.sqrt(distance**2 - sum(bases) ** 2)) / base_pitch


@pytest.mark.parametrize("distance", [98.5, 120.0])
def test_a_centre_distance_without_contact_states_the_largest(
    distance: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """23/41 teeth, module 3: at the bound the contact ratio is 1."""
    job = tmp_path / "pair.toml"
    job.write_text(PAIR, encoding="utf-8")
    message = refused(capsys, "gear", str(job), "--set", f"pair.centre_distance_mm={distance}")
    bound = float(message.partition("must be <= ")[2].partition(" mm")[0])
    cos = math.cos(math.radians(20.0))
    ratio = contact_ratio(bound, (37.5, 64.5), (34.5 * cos, 61.5 * cos), 3.0 * math.pi * cos)
    assert ratio == pytest.approx(1.0, abs=1e-3)  # a bound of five digits
    assert "pair.centre_distance_mm = " in message


def test_a_tip_round_that_ends_contact_states_the_largest(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    job = tmp_path / "pair.toml"
    job.write_text(PAIR.replace("module_mm = 3.0", "module_mm = 3.0\naddendum = 0.7"), encoding="utf-8")
    change = "pair.wheel.tip_round_mm={}"
    message = refused(capsys, "gear", str(job), "--set", change.format(1.6))
    bound = float(message.partition("must be <= ")[2].partition(" mm")[0])
    line = ["gear", str(job), "--out", str(tmp_path / "out"), "--no-pictures", "--set"]
    assert main([*line, change.format(bound - 1e-4)]) == 0
    assert "must be <= " in refused(capsys, *line, change.format(bound + 1e-4))


@pytest.mark.parametrize("long", [LONG, SPACED])
@pytest.mark.parametrize("place", ["command", "file", "option", "key", "table", "value", "set", "out"])
def test_names_of_ten_thousand_letters_are_cut(place: str, long: str, capsys: pytest.CaptureFixture[str]) -> None:
    lines = {
        "command": [long],
        "file": ["gear", long],
        "option": ["gear", JOB, f"--{long}"],
        "key": ["gear", JOB, "--set", f"pair.{long}=1"],
        "table": ["gear", JOB, "--set", f"{long}.{long}=1"],
        "value": ["gear", JOB, "--set", f"pair.module_mm='{long}'"],
        "set": ["gear", JOB, "--set", long],
        "out": ["gear", JOB, "--out", long],
    }
    message = refused(capsys, *lines[place])
    assert "..." in message or len(message) < 200


def test_names_are_cut_in_the_field_of_an_error_too() -> None:
    assert len(str(InputError(LONG, LONG, LONG, SPACED))) < LONGEST_MESSAGE + 10


#: 20 teeth, module 2, x 0.2, 20 deg. The tooth is pointed where inv(alpha') = pi/2z + 2 x tan(alpha)/z + inv(alpha),
#: so below a tip diameter of m z cos(alpha)/cos(alpha') = 46.6203 mm (ISO 21771).
POINTED = """
[pair]
module_mm = 2.0
pressure_angle_deg = 20.0
face_width_mm = 20.0
[pair.pinion]
teeth = 20
profile_shift = 0.2
bore_diameter_mm = 15.0
{drawn}
[pair.wheel]
teeth = 200
bore_diameter_mm = 100.0
"""


def pointed_diameter_mm() -> float:
    alpha = math.radians(20.0)
    involute = 0.5 * math.pi / 20 + 0.4 * math.tan(alpha) / 20 + math.tan(alpha) - alpha
    low, high = 0.1, 1.4
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if math.tan(middle) - middle < involute else (low, middle)
    return 40.0 * math.cos(alpha) / math.cos(low)


def diameter_of_one_pair_mm() -> float:
    """Tip diameter from which on the pinion reaches one base pitch of path beside the mate's tip of 404 mm."""
    alpha, base = math.radians(20.0), math.cos(math.radians(20.0))
    working = inverse_inv(math.tan(alpha) - alpha + 2.0 * math.tan(alpha) * 0.2 / 220)
    length = 220.0 * base * math.tan(working)
    mate = math.sqrt(202.0**2 - (200.0 * base) ** 2)
    return 2.0 * math.hypot(20.0 * base, 2.0 * math.pi * base + length - mate)


@pytest.mark.parametrize(
    ("drawn", "bound"),
    [
        ("tip_diameter_mm = 40.7", "must be > 40.8 mm; use a larger tip_diameter_mm"),  # d + 2 x m
        ("tip_diameter_mm = 41.0", f"must be >= {diameter_of_one_pair_mm():.6g} mm; use a larger tip_diameter_mm"),
        ("root_diameter_mm = 41.0", "must be < 40.8 mm; use a smaller root_diameter_mm"),
        ("tip_diameter_mm = 49.5", f"must be < {pointed_diameter_mm():.6g} mm; use a smaller tip_diameter_mm"),
        ("root_diameter_mm = 0.5", "must be > 1 mm; use a larger root_diameter_mm"),  # half a module of rim
        ("span_mm = 5.0\nspan_teeth = 3", "mm; use a larger span_mm"),
    ],
)
def test_bounds_are_of_the_key_that_was_written(
    drawn: str, bound: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    job = tmp_path / "job.toml"
    job.write_text(POINTED.format(drawn=drawn))
    message = refused(capsys, "gear", str(job))
    assert f"pair.pinion.{drawn.partition(' ')[0]} = " in message
    assert bound in message


def mechanism(tmp_path: Path, *changes: tuple[str, str]) -> Path:
    """The shipped slider crank with changes of its text."""
    text = (Path(JOB).parent / "slider_crank.toml").read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    job = tmp_path / "mechanism.toml"
    job.write_text(text, encoding="utf-8")
    return job


@pytest.mark.parametrize(
    ("value", "cure"),
    [
        ("x(rod.B)^2", "write x(rod.B) ** 2"),
        ("theta(crank)", "did you mean 'angle'?"),
        ("omega(crank)", "did you mean 'rate'?"),
        ("ln(2)", "did you mean 'log'?"),
        ("sin(t)", "did you mean 'time'?"),
        (LONG[:1500], "..."),
    ],
)
def test_words_of_other_programs_in_expressions(
    value: str, cure: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = f'[[outputs]]\nname = "of_mine"\nvalue = "{value}"\n'
    job = mechanism(tmp_path)
    job.write_text(job.read_text(encoding="utf-8") + output, encoding="utf-8")
    message = refused(capsys, "mechanism", str(job), "--out", str(tmp_path / "out"))
    assert cure in message


@pytest.mark.parametrize(
    ("old", "new", "remark"),
    [
        ("angle_deg = 45.0", "angle_rad = 45.0", "bodies.crank.angle_rad = 45 is 7.16 turns; if it is in degrees"),
        ("B = [1.0, 0.0]", "B = [1000.0, 0.0]", "bodies.rod.points_m.B[0] = 1000 m is 1414 times the median"),
    ],
)
def test_units_are_suspected_by_name(
    old: str, new: str, remark: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    job = mechanism(tmp_path, (old, new))
    main(["mechanism", str(job), "--out", str(tmp_path / "out"), "--until", "0.005", "--no-pictures", "--no-estimate"])
    assert f"gearfe: warning: {remark}" in capsys.readouterr().err


PAIR = """[pair]
module_mm = 3.0
pressure_angle_deg = 20.0
face_width_mm = 20.0
pinion = { teeth = 23, bore_diameter_mm = 20.0 }
wheel = { teeth = 41, bore_diameter_mm = 20.0 }
[pair.material]
"""


@pytest.mark.parametrize(
    ("line", "remark"),
    [
        ("youngs_modulus_GPa = 210000.0", "is stiffer than diamond; if it is in MPa, write 210"),
        ("youngs_modulus_GPa = 70e9", "is stiffer than diamond; if it is in Pa, write 70"),
        ("youngs_modulus_GPa = 0.00021", "is softer than rubber"),
        ("density_kg_per_m3 = 785000", "is denser than any solid"),
        ("density_kg_per_m3 = 7.85", "is lighter than any solid; if it is in g/cm3, write 7850"),
        ("density_kg_per_m3 = 7.85e-9", "is lighter than any solid; if it is in t/mm3, write 7850"),
        ("density_kg_per_m3 = 2.7e-6", "is lighter than any solid; if it is in kg/mm3, write 2700"),
    ],
)
def test_materials_are_suspected_by_name(
    line: str, remark: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    job = tmp_path / "pair.toml"
    job.write_text(PAIR + line + "\n", encoding="utf-8")
    main(["gear", str(job), "--out", str(tmp_path / "out"), "--no-pictures"])
    errors = capsys.readouterr().err
    key, number = line.split(" = ")
    assert f"gearfe: warning: pair.material.{key} = {float(number):g} {remark}" in errors
    cure = remark.partition("; ")[2]
    if "error" in errors:  # beyond the range of the key: the error has the same cure
        assert errors.strip().endswith(cure)


@pytest.mark.parametrize("values", [{"youngs_modulus": 210e3}, {"density": 7.85}, {"density": 7.85e-9}])
def test_materials_of_the_python_interface_are_suspected(values: dict[str, float]) -> None:
    """The modulus in MPa, and the density in g/cm3 or t/mm3, where SI units are expected."""
    with pytest.warns(UnitWarning, match="use SI units"):
        Material(**values)


def test_angles_of_joints_that_may_be_degrees() -> None:
    raw = {
        "joints": {
            "drive": {"coordinate": "angle", "motion_rad": {"constant": 45, "step": 90.0, "polynomial": [0.0, 300.0]}},
            "turn": {"coordinate": "angle", "motion_rad": 20.0 * math.pi},
            "slide": {"coordinate": "x", "motion_m": 45.0},
        },
        "forces": {"spring": {"coordinate": "angle", "reference_rad": 30.0}},
        "start": {"positions": {"angle(crank)": 180.0, "x(rod.B)": 12.0}},
    }
    names = [text.partition(" = ")[0] for text in suspects(raw)]
    assert names == [
        "joints.drive.motion_rad.constant", "joints.drive.motion_rad.step", "forces.spring.reference_rad",
        "start.positions.angle(crank)",
    ]  # fmt: skip
    assert "write 0.785398163 rad" in suspects(raw)[0]


def test_no_shipped_job_is_suspected() -> None:
    for job in sorted(Path(JOB).parent.glob("*.toml")):
        assert suspects(read_toml(job)) == [], job.name
