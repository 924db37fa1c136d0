"""Internal gears and internal pairs: profile, geometry by ISO 21771, interferences, files, and mistakes in them."""

from __future__ import annotations

import itertools
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.cli.main import main
from gearfe.gears.geometry.balls import ball_diameter, over_balls
from gearfe.gears.geometry.curves import Arc, inv
from gearfe.gears.geometry.cutter import cutter_of, tips_apart
from gearfe.gears.geometry.derived import derived_geometry, gear_outline
from gearfe.gears.geometry.mesh_geometry import MeshGeometry
from gearfe.gears.geometry.outline import whole_outline
from gearfe.gears.geometry.pair import Gear, GearPair
from gearfe.gears.geometry.ring import radial_clearance, ring_depths

ANGLE = math.radians(20.0)


def ring(**changes: Any) -> Gear:
    """Ring gear of the planetary example of FVA (z -61, m 4, cutter with 23 teeth), its tips shortened."""
    values: dict[str, Any] = {"rim_diameter": 0.28, "addendum": 0.9, "cutter_teeth": 23, "rack_tip_radius": 0.0}
    return Gear(-61, 4e-3, ANGLE, 0.05, **(values | changes))


def planet(teeth: int = 22, **changes: Any) -> Gear:
    return Gear(teeth, 4e-3, ANGLE, 0.05, 0.03, **({"rack_tip_radius": 0.25} | changes))


RINGS = {
    "sharp cutter": ring(),
    "default cutter": ring(cutter_teeth=None, rack_tip_radius=0.3),
    "shifted": ring(profile_shift=-0.4, cutter_shift=0.2, rack_tip_radius=0.2),
    "thinned": ring(tooth_thinning=2e-4, tip_round=3e-4, rack_tip_radius=0.2),
    "given form": ring(cutter_teeth=None, form_diameter=0.2535),
    "helical": ring(helix_angle=math.radians(15.0), rim_diameter=0.3, rack_tip_radius=0.2),
}


@pytest.mark.parametrize("gear", RINGS.values(), ids=RINGS.keys())
def test_pieces_join_without_steps_and_kinks_except_at_the_tip(gear: Gear) -> None:
    ends = np.array([0.0, 1.0])
    for one, two in itertools.pairwise(gear.profile.segments):
        points = one.curve.point(ends)[1], two.curve.point(ends)[0]
        assert abs(points[0] - points[1]) < 1e-15
        turn = abs(np.angle(two.curve.normal(ends)[0] / one.curve.normal(ends)[1]))
        assert turn < 1e-13 or (one.name, two.name) == ("involute", "tip")
    for segment in gear.profile.segments:
        t, h = np.linspace(0.05, 0.95, 9), 1e-6
        tangent = (segment.curve.point(t + h) - segment.curve.point(t - h)) / (2 * h)
        np.testing.assert_allclose(1j * tangent / np.abs(tangent), segment.curve.normal(t), atol=1e-6)
        np.testing.assert_allclose(np.abs(tangent), segment.curve.speed(t), rtol=1e-6)


@pytest.mark.parametrize("rho", [0.0, 0.2])
def test_the_root_is_the_envelope_of_the_rolling_cutter(rho: float) -> None:
    gear = ring(rack_tip_radius=rho, profile_shift=-0.3, cutter_shift=0.1)
    cutter = cutter_of(gear)
    addendum = cutter.tip_radius / gear.module - 0.5 * cutter.teeth - 0.1
    tool = Gear(23, 4e-3, ANGLE, 0.05, 0.02, profile_shift=0.1, addendum=addendum, tip_round=rho * gear.module)
    t = np.linspace(0.0, 1.0, 201)
    outline = np.concatenate(
        [s.curve.point(t) for s in tool.profile.segments if s.name not in ("root_circle", "trochoid")]
    )
    outline = np.concatenate([outline, outline.conj()])
    # the cutter's tooth faces the gear's space on +x, its centre at a_0
    turn = np.linspace(-1.2, 1.2, 4001)[:, None]
    placed = (cutter.centre_distance + np.exp(1j * turn) * outline) * np.exp(-1j * turn * 23 / 61)
    middle = -np.exp(1j * math.pi / gear.teeth)
    swept = (placed * middle).ravel()
    names = {"trochoid", "root_circle"} if rho else {"root_circle"}
    for segment in gear.profile.segments:
        if segment.name in names or segment.name == "involute":
            points = segment.curve.point(np.linspace(0.02, 0.98, 15))
            normals = segment.curve.normal(np.linspace(0.02, 0.98, 15))
            for point, normal in zip(points, normals, strict=True):
                near = swept[np.abs(swept - point) < 2e-4]
                into = -((near - point) * normal.conj()).real  # along a chord of 0.2 mm the curve bends by 2e-8 m
                assert into.max() < 3e-6
                assert np.abs(near - point).min() < 2e-5


def test_a_given_form_diameter_makes_a_circular_fillet() -> None:
    gear = RINGS["given form"]
    fillet = gear.profile.segment("fillet").curve
    assert isinstance(fillet, Arc)
    assert 2.0 * gear.form_radius == pytest.approx(0.2535, rel=1e-14)
    assert abs(complex(*fillet.centre)) + abs(fillet.radius) == pytest.approx(gear.root_radius, rel=1e-14)


def test_metric_handbook_example_of_a_shifted_internal_pair() -> None:
    """Elements of Metric Gear Technology, table 5-1: its x_2 of internal gears has the opposite sign.

    It computes with inv(alpha_w) = 0.060401, whose last digit is 1.6e-4 deg.
    """
    pinion = Gear(16, 3e-3, ANGLE, 0.02, 0.01)
    wheel = Gear(-24, 3e-3, ANGLE, 0.02, rim_diameter=0.1, profile_shift=-0.5, cutter_teeth=18, rack_tip_radius=0.1)
    pair = MeshGeometry(pinion, wheel)
    assert math.degrees(pair.working_pressure_angle) == pytest.approx(31.0937, abs=1.6e-4)
    assert 1e3 * pair.working_centre_distance == pytest.approx(13.1683, abs=5e-5)
    assert 2e3 * pair.pinion_working_radius == pytest.approx(52.673, abs=5e-4)
    assert 2e3 * pair.wheel_working_radius == pytest.approx(79.010, abs=5e-4)
    assert 2e3 * wheel.base_radius == pytest.approx(67.658, abs=5e-4)
    assert 2e3 * wheel.tip_radius == pytest.approx(69.0, abs=1e-9)
    assert 2e3 * wheel.root_radius == pytest.approx(82.5, abs=1e-9)


@pytest.mark.parametrize("helix", [0.0, 15.0])
def test_rigid_flanks_touch_on_the_path_with_opposite_normals(helix: float) -> None:
    angle = math.radians(helix)
    pair = GearPair(planet(helix_angle=angle), ring(helix_angle=angle, addendum=0.85, rim_diameter=0.3))
    for point in pair.path.values():
        placed, normals = [], []
        for number, (gear, tooth, roll, centre) in enumerate(
            ((pair.pinion, 0, point.pinion_roll, 0.0), (pair.wheel, -1, point.wheel_roll, pair.wheel_centre))
        ):
            turn = np.exp(1j * pair.tooth_angle(number, tooth, point.pinion_angle, 0.0))
            placed.append(turn * gear.profile.flank.at(np.array(roll)) + centre)
            normals.append(turn * gear.profile.flank.normal_at(np.array(roll)))
        assert abs(placed[0] - placed[1]) < 1e-15
        assert abs(normals[0] + normals[1]) < 1e-14
    # the pitch point and the ratio of speeds: both gears turn the same way
    assert pair.gear_ratio == -61 / 22
    assert pair.wheel_angle_at(0.1) == pytest.approx(0.1 * 22 / 61)
    assert pair.pinion_working_radius + pair.working_centre_distance == pytest.approx(pair.wheel_working_radius)


def test_contact_ratio_by_the_signed_formula() -> None:
    pair = GearPair(planet(), ring())
    length = 0.0
    for z, r in ((22, pair.pinion.tip_radius), (-61, pair.wheel.tip_radius)):
        base = 0.5 * abs(z) * 4e-3 * math.cos(ANGLE)
        length += math.copysign(math.sqrt(r**2 - base**2), z)
    length -= 0.5 * (22 - 61) * 4e-3 * math.sin(ANGLE)
    assert pair.contact_ratio == pytest.approx(length / (math.pi * 4e-3 * math.cos(ANGLE)), rel=1e-13)


def test_a_larger_centre_distance_jams_and_a_smaller_one_has_backlash() -> None:
    distance = 78e-3
    wide = GearPair(planet(), ring(), distance - 2e-4)
    # both flanks give way by da sin(alpha_w) along the line of action, to first order
    assert wide.base_backlash == pytest.approx(2.0 * 2e-4 * math.sin(ANGLE), rel=0.02)
    with pytest.raises(InputError, match=r"centre_distance.*must be <= 78 mm"):
        GearPair(planet(), ring(), distance + 2e-4)


@pytest.mark.parametrize("gear", [*RINGS.values(), planet(), planet(23, profile_shift=0.4, tooth_thinning=1e-4)])
def test_balls_touch_the_flank(gear: Gear) -> None:
    if gear.helical:
        return
    size = ball_diameter(gear)
    centres = 0.5 * abs(over_balls(gear, size) - size)
    if gear.tooth_count % 2:
        centres /= math.cos(0.5 * math.pi / gear.tooth_count)
    centre = gear.sign * centres * np.exp(1j * math.pi / gear.teeth)
    points = gear.profile.flank.point(np.linspace(0.0, 1.0, 20001))
    away = np.abs(points - centre)
    assert away.min() == pytest.approx(0.5 * size, rel=1e-7)
    touched = abs(points[away.argmin()])
    assert touched == pytest.approx(
        gear.reference_radius + gear.sign * gear.profile_shift * gear.module, abs=0.1 * gear.module
    )


def test_span_over_spaces_is_the_arc_of_the_base_circle_between_their_flanks() -> None:
    gear = RINGS["thinned"]
    for k in (2, gear.span_teeth):
        arc = (
            2.0
            * gear.base_radius
            * ((k - 1) * math.pi / gear.tooth_count + math.pi / gear.tooth_count + gear.base_angle)
        )
        assert gear.span_size(k) == pytest.approx(-arc, rel=1e-13)


@pytest.mark.parametrize("teeth", range(40, 58))
def test_rolling_finds_the_trochoid_interference_of_the_closed_condition(teeth: int) -> None:
    """DIN 3993: tips pass each other where z1 (inv a1 + d1) - z2 (inv a2 + d2) + (z2 - z1) inv aw >= 0."""
    pinion, gear, distance = planet(teeth), ring(), 0.5 * (61 - teeth) * 4e-3
    apart = tips_apart(gear, pinion.tip_radius, teeth, distance, ANGLE)
    depths = ring_depths(pinion, gear, distance, 0.0)
    if abs(apart) > math.radians(0.01):
        assert (max(depths) > 1e-7) == (apart < 0.0)


def radial_condition(pinion: Gear, wheel: Gear) -> float:
    """Angle (rad) left where a pinion without backlash is moved into a ring radially (Colbourne 1987, ch. 8)."""
    a1, a2 = (math.acos(gear.base_radius / gear.tip_radius) for gear in (pinion, wheel))
    share, ratio = math.cos(a1) / math.cos(a2), wheel.tooth_count / pinion.tooth_count
    at1 = math.asin(math.sqrt((1.0 - share**2) / (1.0 - ratio**-2)))
    at2 = math.asin(math.sqrt((share**-2 - 1.0) / (ratio**2 - 1.0)))
    half = inv(ANGLE)
    return at1 + inv(a1) - half - ratio * (at2 + inv(a2) - half)


@pytest.mark.parametrize("teeth", [20, 30, 40, 50, 54])
def test_radial_assembly_by_the_closed_condition(teeth: int) -> None:
    pinion, gear = planet(teeth), ring()
    clearance = radial_clearance(pinion, gear, 0.5 * (61 - teeth) * 4e-3)
    assert (clearance > 0.0) == (radial_condition(pinion, gear) > 0.0)


def test_outlines_of_both_gears_close_and_leave_the_area_of_the_spaces() -> None:
    gear = ring()
    outline = gear_outline(gear, 0.3, (10.0, 0.0), per_segment=64)
    assert np.allclose(outline[0], outline[-1])
    assert len(whole_outline(gear)) == 61
    z = outline[:, 0] - 1e4 + 1j * outline[:, 1]
    area = 0.5e-6 * abs(np.sum((z[:-1].conj() * z[1:]).imag))
    assert math.pi * gear.tip_radius**2 < area < math.pi * gear.root_radius**2


TEXT = """
[gears.planet]
teeth = 22
bore_diameter_mm = 43.2
rack_tip_radius = 0.25
module_mm = 4.0
pressure_angle_deg = 20.0
face_width_mm = 50.0

[gears.ring]
teeth = -61
rim_diameter_mm = 280.0
addendum = 0.9
cutter_teeth = 23
rack_tip_radius = 0.0
module_mm = 4.0
pressure_angle_deg = 20.0
face_width_mm = 50.0

[meshes.outer]
driver = "planet"
driven = "ring"
centre_distance_mm = -78.0
"""


def job(folder: Path, *changes: tuple[str, str]) -> str:
    text = TEXT
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "ring.toml").write_text(text)
    return str(folder / "ring.toml")


def test_gear_reports_the_signs_of_the_standard(tmp_path: Path) -> None:
    assert main(["gear", job(tmp_path), "--out", str(tmp_path), "--no-pictures", "--export", "dxf,csv"]) == 0
    made = json.loads((tmp_path / "gear_pair.json").read_text())
    pair = GearPair(planet(), ring())
    assert made["centre_distance_mm"] == -78.0
    assert made["gear_ratio"] == -61 / 22
    assert made["wheel"]["teeth"] == -61
    for key in ("pitch", "working_pitch", "base", "tip", "root", "form", "rim"):
        assert made["wheel"][f"{key}_diameter_mm"] < 0.0 < made["pinion"].get(f"{key}_diameter_mm", 1.0)
    assert made["wheel"]["span_mm"] < 0.0
    assert made["wheel"]["over_balls_mm"] < 0.0
    assert made["path_of_contact"]["A"]["wheel_roll_mm"] == pytest.approx(1e3 * pair.path["A"].wheel_roll)
    assert made["radial_assembly"] is True
    # 1/rho_1 - 1/rho_2 of the magnitudes
    start = pair.path["A"]
    assert made["relative_curvature_A_per_mm"] == pytest.approx(
        1e-3 * (1 / start.pinion_roll - 1 / abs(start.wheel_roll))
    )
    assert (tmp_path / "wheel.dxf").exists()
    assert (tmp_path / "wheel.csv").exists()


def test_the_picture_is_drawn(tmp_path: Path) -> None:
    assert main(["gear", job(tmp_path), "--out", str(tmp_path)]) == 0
    assert (tmp_path / "gear_pair.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    "change",
    [
        ("centre_distance_mm = -78.0", "centre_distance_mm = 78.0"),
        ("rim_diameter_mm = 280.0", "rim_diameter_mm = -280.0"),
        ("addendum = 0.9\ncutter", "tip_diameter_mm = -236.8\ncutter"),
        ("addendum = 0.9\ncutter", "tip_diameter_mm = 236.8\nroot_diameter_mm = -254.0\ncutter"),
        ("rim_diameter_mm = 280.0", "rim_diameter_mm = 280.0\nspan_teeth = 7\nspan_mm = -80.17276888"),
        ("rim_diameter_mm = 280.0", "rim_diameter_mm = 280.0\npitch_diameter_mm = -244.0"),
    ],
)
def test_sizes_may_be_written_with_or_without_the_minus_sign(tmp_path: Path, change: tuple[str, str]) -> None:
    made = []
    for name, changes in (("one", ()), ("two", (change,))):
        (tmp_path / name).mkdir()
        assert main(["gear", job(tmp_path / name, *changes), "--out", str(tmp_path / name), "--no-pictures"]) == 0
        made.append(json.loads((tmp_path / name / "gear_pair.json").read_text()))
    for key in ("centre_distance_mm", "contact_ratio"):
        assert made[1][key] == pytest.approx(made[0][key], rel=1e-6)
    for key in ("tip_diameter_mm", "root_diameter_mm", "rim_diameter_mm"):
        assert made[1]["wheel"][key] == pytest.approx(made[0]["wheel"][key], rel=1e-12)


def test_a_profile_shift_follows_from_the_centre_distance(tmp_path: Path) -> None:
    changes = ("cutter_teeth = 23", 'cutter_teeth = 23\nprofile_shift = "from centre distance"'), ("-78.0", "-77.6")
    path = job(tmp_path, *changes)
    assert main(["gear", path, "--out", str(tmp_path), "--no-pictures"]) == 0
    made = json.loads((tmp_path / "gear_pair.json").read_text())
    angle = math.acos(78.0 * math.cos(ANGLE) / 77.6)
    shift = (22 - 61) * (inv(angle) - inv(ANGLE)) / (2.0 * math.tan(ANGLE))
    assert made["wheel"]["profile_shift"] == pytest.approx(shift, rel=1e-12)
    assert made["backlash_mm"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "field", "text"),
    [
        ("teeth = -61", "teeth = -11", "gears.ring.teeth", "<= -12 for an internal gear"),
        ("teeth = -61", "teeth = 7", "gears.ring.teeth", ">= 8"),
        ("teeth = -61", "teeth = 61", "gears.ring.rim_diameter_mm", "internal gears alone"),
        ("teeth = -61", "teeth = -22", "gears.ring.cutter_teeth", "<= 20"),
        ("teeth = 22", "teeth = 62", "gears.ring.teeth", "leaves no room for the 62 teeth"),
        ("rim_diameter_mm = 280.0\n", "", "gears.ring.rim_diameter_mm", "is required"),
        ("rim_diameter_mm = 280.0", "bore_diameter_mm = 280.0", "gears.ring.bore_diameter_mm", "rim_diameter_mm"),
        ("rim_diameter_mm = 280.0", "rim_diameter_mm = 255.0", "gears.ring.rim_diameter_mm", "must be >= 256 mm"),
        ("cutter_teeth = 23", "cutter_teeth = 60", "gears.ring.cutter_teeth", "<= 59"),
        ("cutter_teeth = 23", "cutter_teeth = 58", "gears.ring.cutter_teeth", "tips of cutter and gear meet"),
        ("cutter_teeth = 23", "cutter_teeth = 10", "gears.ring.addendum", "past the begin of its involute"),
        ("rack_tip_radius = 0.0", "rack_tip_radius = 0.9", "gears.ring.rack_tip_radius", "must be <="),
        ("addendum = 0.9\n", "addendum = 2.9\n", "gears.ring.addendum", "base circle"),
        ("addendum = 0.9\n", "addendum = 1.0\n", "gears.ring.addendum", "must be < 0.934"),
        ("cutter_teeth = 23", "form_diameter_mm = 230.0", "gears.ring.form_diameter_mm", "between tip and root circle"),
        ("cutter_teeth = 23", "form_diameter_mm = 240.0", "gears.ring.form_diameter_mm", "does not fit the space"),
        (
            "cutter_teeth = 23",
            "cutter_teeth = 23\nform_diameter_mm = 253.0",
            "gears.ring.form_diameter_mm",
            "leave out",
        ),
        ("cutter_teeth = 23", 'rim = "welded"', "gears.ring.rim", "bolted"),
        ("cutter_teeth = 23", "cutter_shift = 1e9", "gears.ring.cutter_shift", "too large"),
        ("-78.0", "-79.0", "meshes.outer.centre_distance_mm", "must be <= 78"),
        ("-78.0", "-73.0", "meshes.outer.centre_distance_mm", "must be finite and >"),
        ("-78.0", "-75.0", "meshes.outer.centre_distance_mm", "use a larger centre distance"),
        ("teeth = 22", "teeth = 54", "gears.", "beside the path"),
        (
            "bore_diameter_mm = 43.2",
            "bore_diameter_mm = 43.2\ncutter_teeth = 20",
            "gears.planet.cutter_teeth",
            "internal",
        ),
        ("bore_diameter_mm = 43.2", "", "gears.planet.bore_diameter_mm", "is required"),
        (
            "bore_diameter_mm = 43.2",
            "bore_diameter_mm = 43.2\ntip_diameter_mm = -90",
            "gears.planet.tip_diameter_mm",
            "> 0",
        ),
    ],
)
def test_mistakes_are_named_with_field_range_and_cure(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, field: str, text: str
) -> None:
    path = job(tmp_path, (old, new), *((("-78.0", "-14.0"),) if "54" in new else ()))
    assert main(["gear", path, "--out", str(tmp_path / "out"), "--no-pictures"]) == 2
    message = capsys.readouterr().err
    assert field in message
    assert text in message
    assert not (tmp_path / "out").exists()


def test_contact_over_the_width_takes_internal_pairs_with_held_rims(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    helix = (
        ("face_width_mm = 50.0", "face_width_mm = 8.0\nhelix_angle_deg = 15.0"),
        ("\ncentre_distance_mm = -78.0", ""),
    )
    other = ("addendum = 0.9\n", "addendum = 0.85\n"), ("rim_diameter_mm = 280.0", "rim_diameter_mm = 300.0")
    table = ("[meshes.outer]", "[stiffness]\ntorque_Nm = 50.0\nangle_step_deg = 5.0\n\n[meshes.outer]")
    run = ["stiffness", job(tmp_path, *helix, *other, table), "--out", str(tmp_path / "out"), "--no-pictures"]
    assert main([*run, "--no-estimate"]) == 0
    axial = 50.0 * math.tan(math.radians(15.0)) / (0.5 * 61 * 4e-3 / math.cos(math.radians(15.0)))
    assert f"axial force on the wheel {-axial:.4g} N" in capsys.readouterr().out
    free = ("rim_diameter_mm = 300.0", 'rim_diameter_mm = 300.0\nrim = "free"')
    assert main(["stiffness", job(tmp_path, *helix, *other, free, table), "--out", str(tmp_path / "free")]) == 2
    message = capsys.readouterr().err
    assert "gears.ring.rim = 'free': is not held" in message
    assert 'give rim = "bolted"' in message


def test_hands_of_helical_internal_pairs_are_equal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    helix = (
        ("face_width_mm = 50.0", "face_width_mm = 50.0\nhelix_angle_deg = 15.0"),
        ("\ncentre_distance_mm = -78.0", ""),
    )
    other = ("addendum = 0.9\n", "addendum = 0.85\n"), ("rim_diameter_mm = 280.0", "rim_diameter_mm = 300.0")
    assert main(["gear", job(tmp_path, *helix, *other), "--out", str(tmp_path), "--no-pictures"]) == 0
    made = json.loads((tmp_path / "gear_pair.json").read_text())
    assert made["pinion"]["helix_hand"] == made["wheel"]["helix_hand"] == "right"
    wrong = ("addendum = 0.85", 'helix_hand = "left"\naddendum = 0.85')
    path = job(tmp_path, *helix, *other, wrong)
    path = job(tmp_path, *helix, *other, wrong, ("teeth = 22", 'teeth = 22\nhelix_hand = "right"'))
    assert main(["gear", path, "--out", str(tmp_path), "--no-pictures"]) == 2
    assert "has the hand of its mate" in capsys.readouterr().err


def test_rings_that_do_not_exist_are_refused_in_python() -> None:
    cases: list[tuple[str, Any]] = [
        ("rim_diameter", {"rim_diameter": None}),
        ("rim_diameter", {"rim_diameter": math.nan}),
        ("bore_diameter", {"bore_diameter": 0.1}),
        ("rim", {"rim": "loose"}),
        ("cutter_teeth", {"cutter_teeth": 23.0}),
        ("cutter_teeth", {"cutter_teeth": True}),
        ("form_diameter", {"form_diameter": math.inf, "cutter_teeth": None}),
        ("addendum", {"addendum": 1.9}),
        ("profile_shift", {"profile_shift": 40.0}),
    ]
    for field, changes in cases:
        with pytest.raises(InputError) as caught:
            ring(**changes)
        assert caught.value.field == field
    with pytest.raises(InputError, match=r"rim_diameter.*internal gears"):
        planet(rim_diameter=0.3)
    with pytest.raises(InputError, match=r"pinion.teeth.*swap"):
        GearPair(ring(), planet())
    with pytest.raises(InputError, match=r"pinion.teeth"):
        GearPair(ring(), replace(ring(), rim_diameter=0.3))


def test_derived_geometry_of_an_internal_pair_is_plain_data() -> None:
    made = derived_geometry(GearPair(planet(), ring()))
    assert json.loads(json.dumps(made)) == made


@pytest.mark.parametrize("teeth", [-25, -34, -61, -120, -300])
def test_default_cutters_make_usual_rings(teeth: int) -> None:
    gear = Gear(teeth, 2e-3, ANGLE, 0.02, rim_diameter=2e-3 * (abs(teeth) + 8), addendum=0.5, rack_tip_radius=0.2)
    assert gear.form_radius < gear.root_radius
    assert cutter_of(gear).teeth == abs(teeth) // 2
