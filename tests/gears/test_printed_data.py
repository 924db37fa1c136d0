"""Published gear data as printed: what fits except for rounding is accepted and reported, what follows is computed."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import Any

import pytest

from gearfe.base.config import build
from gearfe.base.errors import InputError
from gearfe.base.tables.pair import FROM_DISTANCE, PairTable
from gearfe.drivetrain.gearbox.job import job_train, read_train_job
from gearfe.drivetrain.gearbox.mesh_stiffness import train_curves
from gearfe.drivetrain.train import build_train
from gearfe.gears.geometry.curves import inv
from gearfe.gears.geometry.derived import derived_geometry
from gearfe.gears.geometry.gear_data import nominal_span
from gearfe.gears.geometry.pair import Gear, GearPair

SHARED = {"pressure_angle_deg": 20.0, "face_width_mm": 14.0}
#: FZG test gears of type C, x as printed by two programs.
FZG_C = {"module_mm": 4.5, "centre_distance_mm": 91.5, "dedendum": 1.39, "rack_tip_radius": 0.25}
PINION_C = {"teeth": 16, "profile_shift": 0.1817, "tip_diameter_mm": 82.45}
WHEEL_C = {"teeth": 24, "profile_shift": 0.1715, "tip_diameter_mm": 118.35}


def table(shared: dict[str, Any], pinion: dict[str, Any], wheel: dict[str, Any]) -> PairTable:
    gears = {"pinion": {"bore_diameter_mm": 10.0} | pinion, "wheel": {"bore_diameter_mm": 10.0} | wheel}
    return build(PairTable, {**SHARED, **shared, **gears}, "pair")


def pair(shared: dict[str, Any], pinion: dict[str, Any], wheel: dict[str, Any]) -> GearPair:
    return GearPair.from_table(table(shared, pinion, wheel))


def message(shared: dict[str, Any], pinion: dict[str, Any], wheel: dict[str, Any]) -> str:
    with pytest.raises(InputError) as caught:
        pair(shared, pinion, wheel)
    return str(caught.value)


def jam_um(z1: int, z2: int, m: float, a: float, x: float) -> float:
    """Jam (um) on the line of action, p_b - j_bn of two teeth without backlash at a (mm): 2 r_b inv(alpha_w) ..."""
    angle = math.radians(20.0)
    working = math.acos(0.5 * (z1 + z2) * m * math.cos(angle) / a)
    fits = inv(angle) + 2.0 * x * math.tan(angle) / (z1 + z2)
    return 1e3 * (z1 + z2) * m * math.cos(angle) * (fits - inv(working))


@pytest.mark.parametrize(
    ("shared", "pinion", "wheel"),
    [
        (FZG_C, PINION_C, WHEEL_C),
        (
            {"module_mm": 4.5, "centre_distance_mm": 91.5, "rack_tip_radius": 0.38},
            {"teeth": 16, "profile_shift": 0.8532, "tip_diameter_mm": 88.77},
            {"teeth": 24, "profile_shift": -0.5, "tip_diameter_mm": 112.5},
        ),
        (
            {"module_mm": 21.0, "centre_distance_mm": 584.0, "rack_tip_radius": 0.38},
            {"teeth": 18, "profile_shift": 0.3890, "tip_diameter_mm": 432.838, "root_diameter_mm": 341.838},
            {"teeth": 36, "profile_shift": 0.5039, "tip_diameter_mm": 815.663, "root_diameter_mm": 724.663},
        ),
        ({"module_mm": 2.1167, "centre_distance_mm": 50.8}, {"teeth": 24}, {"teeth": 24}),  # diametral pitch 12
    ],
    ids=["FZG C", "FZG A", "wind turbine", "diametral pitch"],
)
def test_a_jam_by_rounding_is_taken_up_by_thinner_teeth(shared, pinion, wheel) -> None:
    made = pair(shared, pinion, wheel)
    x = pinion.get("profile_shift", 0.0) + wheel.get("profile_shift", 0.0)
    jam = jam_um(pinion["teeth"], wheel["teeth"], shared["module_mm"], shared["centre_distance_mm"], x)
    assert jam > 0.0
    assert made.normal_backlash == 0.0
    assert made.contact_twist == 0.0
    assert 1e6 * made.wheel.tooth_thinning * math.cos(math.radians(20.0)) == pytest.approx(jam, rel=1e-6)
    assert f"jams the teeth by {jam:.3g} um" in made.warnings[0]
    assert made.working_centre_distance == 1e-3 * shared["centre_distance_mm"]
    # the outlines themselves leave what is needed: space of the pinion and tooth of the wheel on the pitch circles
    half = inv(made.working_pressure_angle)
    thickness = [2.0 * g.base_radius * (g.base_angle - half) for g in (made.pinion, made.wheel)]
    assert sum(thickness) == pytest.approx(made.base_pitch, abs=1e-14)


def test_a_jam_of_more_than_rounding_is_refused_with_the_least_distance() -> None:
    said = message({**FZG_C, "centre_distance_mm": 91.498}, PINION_C, WHEEL_C)
    assert "pair.centre_distance_mm = 91.498: jams the teeth" in said
    least = float(said.split("must be >= ")[1].split(" mm")[0])
    assert abs(jam_um(16, 24, 4.5, least, 0.3532)) < 1e-6
    assert pair({**FZG_C, "centre_distance_mm": least - 0.9e-3}, PINION_C, WHEEL_C).notes
    assert "jams" in message({**FZG_C, "centre_distance_mm": least - 1.1e-3}, PINION_C, WHEEL_C)


def test_python_takes_the_same() -> None:
    form = {"module": 4.5e-3, "pressure_angle": math.radians(20.0), "face_width": 14e-3, "bore_diameter": 30e-3}
    made = GearPair(Gear(16, profile_shift=0.1817, **form), Gear(24, profile_shift=0.1715, **form), 91.5e-3)
    assert made.normal_backlash == 0.0
    assert made.notes
    assert not GearPair(made.pinion, made.wheel, 91.5e-3).notes  # already thin enough


def test_spans_that_are_too_large_by_rounding_are_those_without_backlash() -> None:
    """W_3 = 7.66043 mm of 20 teeth of module 1 (handbooks: 7.6604); printed with four digits it may exceed that."""
    whole = nominal_span(20, 0.0, math.radians(20.0), 3)
    made = pair({"module_mm": 1.0}, {"teeth": 20, "span_mm": 7.661, "span_teeth": 3}, {"teeth": 30})
    assert made.pinion.tooth_thinning == 0.0
    assert f"{1e3 * (7.661 - whole):.3g} um larger than that without backlash" in made.warnings[0]
    beyond = {"teeth": 20, "span_mm": whole + 1.1e-3, "span_teeth": 3}
    assert f"must be <= {whole:.6g} mm" in message({"module_mm": 1.0}, beyond, {"teeth": 30})


def test_pitch_diameters_of_inch_gears_have_one_module() -> None:
    """Diametral pitch 12: 17 and 23 teeth have 35.983 and 48.683 mm, whose modules differ in the sixth digit."""
    made = pair({}, {"teeth": 17, "pitch_diameter_mm": 35.983}, {"teeth": 23, "pitch_diameter_mm": 48.683})
    assert made.pinion.module == made.wheel.module == pytest.approx((35.983e-3 + 48.683e-3) / 40, rel=1e-14)
    assert "common module 2.11665 mm" in made.warnings[0]
    made = pair({"module_mm": 2.1167}, {"teeth": 24, "pitch_diameter_mm": 50.8}, {"teeth": 24})
    assert made.pinion.module == made.wheel.module == 2.1167e-3
    wrong = {"teeth": 24, "pitch_diameter_mm": 50.79}
    assert "contradicts module_mm" in message({"module_mm": 2.1167}, wrong, {"teeth": 24})
    said = message({}, {"teeth": 20, "pitch_diameter_mm": 50.0}, {"teeth": 30, "pitch_diameter_mm": 76.0})
    assert "pair.wheel.pitch_diameter_mm = 76.0" in said
    assert "must be equal to 75 mm" in said


def test_a_full_fillet_rounded_up_is_the_full_fillet() -> None:
    """(pi/4 - h_fP tan alpha) cos alpha/(1 - sin alpha) = 0.317883 at 25 degrees, printed as 0.318."""
    shared = {"module_mm": 3.175, "pressure_angle_deg": 25.0, "rack_tip_radius": 0.318}
    made = pair(shared, {"teeth": 28}, {"teeth": 28})
    assert "0.317883 is taken" in made.warnings[0]
    exact = pair({**shared, "rack_tip_radius": 0.31788}, {"teeth": 28}, {"teeth": 28})
    assert made.pinion.profile.form_roll == pytest.approx(exact.pinion.profile.form_roll, abs=2e-8)
    assert not exact.notes


def test_a_tip_clearance_below_zero_by_rounding_is_none() -> None:
    shared = {"module_mm": 2.5, "dedendum": 1.1, "rack_tip_radius": 0.1}
    made = pair(shared, {"teeth": 40, "tip_diameter_mm": 105.501}, {"teeth": 40})
    assert "tip clearance of the pinion is -0.5 um" in made.warnings[0]
    said = message(shared, {"teeth": 40, "tip_diameter_mm": 105.6}, {"teeth": 40})
    assert "pair.pinion.tip_diameter_mm = 105.6" in said
    assert "must be < 105.5 mm" in said


@pytest.mark.parametrize("derived", ["pinion", "wheel"])
def test_a_profile_shift_follows_from_the_centre_distance(derived: str) -> None:
    """FZG type C: exact for 91.5 mm is 0.1818/0.171380507 (a published report)."""
    shifts = {"pinion": 0.1818, "wheel": 0.1713805070343507}
    gears = {name: {**form, "profile_shift": shifts[name]} for name, form in (("pinion", PINION_C), ("wheel", WHEEL_C))}
    gears[derived]["profile_shift"] = FROM_DISTANCE
    made = pair(FZG_C, gears["pinion"], gears["wheel"])
    assert getattr(made, derived).profile_shift == pytest.approx(shifts[derived], abs=2e-9)
    assert made.normal_backlash == 0.0
    assert f"profile_shift of the {derived} by the centre distance: {shifts[derived]:.6g}" in made.warnings
    assert derived_geometry(made)[derived]["profile_shift"] == getattr(made, derived).profile_shift
    assert 2e3 * getattr(made, derived).tip_radius == pytest.approx(gears[derived]["tip_diameter_mm"], abs=1e-12)


def test_the_shift_of_one_gear_may_stand_in_the_shared_table() -> None:
    made = pair({**FZG_C, "profile_shift": FROM_DISTANCE}, PINION_C, {"teeth": 24, "tip_diameter_mm": 118.35})
    assert made.wheel.profile_shift == pytest.approx(0.3532 - 0.1817 - 1.9493e-5, abs=1e-7)


@pytest.mark.parametrize(
    ("shared", "pinion", "wheel", "says"),
    [
        ({**FZG_C, "profile_shift": FROM_DISTANCE}, {"teeth": 16}, {"teeth": 24}, "is written for both gears"),
        (
            FZG_C,
            {"teeth": 16, "profile_shift": FROM_DISTANCE},
            {"teeth": 24, "profile_shift": FROM_DISTANCE},
            "pair.wheel.profile_shift = 'from centre distance': is written for both gears",
        ),
        (
            {"module_mm": 4.5},
            {"teeth": 16, "profile_shift": FROM_DISTANCE},
            {"teeth": 24},
            "needs a centre distance; add pair.centre_distance_mm",
        ),
        (
            FZG_C,
            {"teeth": 16, "profile_shift": "from center distance"},
            {"teeth": 24},
            "did you mean 'from centre distance'?",
        ),
        (
            {**FZG_C, "centre_distance_mm": 80.0},
            {"teeth": 16, "profile_shift": FROM_DISTANCE},
            {"teeth": 24},
            "pair.centre_distance_mm = 80.0: leaves no working pressure angle: must be > 84.57",
        ),
    ],
)
def test_mistakes_with_a_shift_from_the_centre_distance(shared, pinion, wheel, says) -> None:
    assert says in message(shared, pinion, wheel)


def test_a_shift_out_of_range_is_told_as_a_centre_distance() -> None:
    """The bound is sharp: at it the gear exists, 1 um beyond it does not."""
    gears = {"teeth": 16, "profile_shift": 0.1817}, {"teeth": 24, "profile_shift": FROM_DISTANCE}
    shared = {"module_mm": 4.5, "centre_distance_mm": 99.5, "rack_tip_radius": 0.25}
    said = message(shared, *gears)
    assert "pair.centre_distance_mm = 99.5: makes profile_shift 2.5684 of the wheel: the tooth is pointed" in said
    most = float(said.split("must be <= ")[1].split(" mm")[0])
    assert "pointed" not in message({**shared, "centre_distance_mm": most - 1e-4}, *gears)  # but other things
    assert "pointed" in message({**shared, "centre_distance_mm": most + 1e-3}, *gears)


WRITTEN = """
module_mm = 2.5
[pinion]
teeth = 20
bore_diameter_mm = 10
{pinion}
[wheel]
teeth = 30
bore_diameter_mm = 10
{wheel}
"""


@pytest.mark.parametrize(
    ("pinion", "wheel", "key", "kind"),
    [
        ("tip_diameter_mm = 60", "", "pair.pinion.tip_diameter_mm", "pointed"),
        ("tip_diameter_mm = 46", "", "pair.pinion.tip_diameter_mm", "too small"),
        ("addendum = 2", "", "pair.pinion.addendum", "pointed"),
        ("", "tip_shortening = 2.2", "pair.wheel.tip_shortening", "below the start of the involute"),
        ("root_diameter_mm = 51", "", "pair.pinion.root_diameter_mm", "too small"),
        ("root_diameter_mm = 38", "", "pair.pinion.root_diameter_mm", "no land"),
        ("dedendum = 2.3", "", "pair.pinion.dedendum", "no land"),
        ("span_mm = 12\nspan_teeth = 3", "", "pair.pinion.span_mm", "no tooth thickness"),
        ("tooth_thinning_um = 5000", "", "pair.pinion.tooth_thinning_um", "no tooth thickness"),
        ("tip_diameter_mm = 56.3", "root_diameter_mm = 69.0", "pair.pinion.tip_diameter_mm", "root circle"),
        ("", "root_diameter_mm = 70.5", "pair.wheel.root_diameter_mm", "root circle"),
        ("", "dedendum = 0.9", "pair.wheel.dedendum", "root circle"),
        ("tip_diameter_mm = 52", "tip_diameter_mm = 77", "pair.pinion.tip_diameter_mm", "contact ratio"),
        ("tip_shortening = 0.6", "tip_shortening = 0.4", "pair.pinion.tip_shortening", "contact ratio"),
        ("", "tip_diameter_mm = 75.2", "pair.wheel.tip_diameter_mm", "contact ratio"),
        ("", "profile_shift = -1.9", "pair.wheel.profile_shift", "below the start of the involute"),
        ("profile_shift = 2.4", "", "pair.pinion.profile_shift", "pointed"),
    ],
)
def test_bounds_are_those_of_the_key_that_was_written(pinion: str, wheel: str, key: str, kind: str) -> None:
    """The bound that the message names is sharp: on its allowed side the same mistake is gone, beyond it is not."""

    def refusal(pinion: str, wheel: str) -> str:
        try:
            pair_table = build(
                PairTable, {**SHARED, **tomllib.loads(WRITTEN.format(pinion=pinion, wheel=wheel))}, "pair"
            )
            GearPair.from_table(pair_table)
        except InputError as error:
            return str(error)
        return ""

    said = refusal(pinion, wheel)
    assert said.startswith(f"{key} = "), said
    assert kind in said
    bound = said.split("must be ")[1]
    sign, number = bound.split(" ")[0], float(bound.split(" ")[1].rstrip(":;"))
    side, name = key.split(".")[1:]
    old = next(line for line in (pinion if side == "pinion" else wheel).split("\n") if line.startswith(name))
    inward = -1.0 if sign[0] == "<" else 1.0
    for step, same in ((inward, False), (-inward, True)):
        near = number + step * 2e-3 * max(1.0, abs(number) / 100.0)
        texts = {"pinion": pinion, "wheel": wheel}
        texts[side] = texts[side].replace(old, f"{name} = {near!r}")
        again = refusal(**texts)
        assert (bool(again) and (kind or "must") in again) == same, (near, again)


def test_shared_addenda_are_bounded_together() -> None:
    shared = {"module_mm": 2.5, "addendum": 0.5}
    said = message(shared, {"teeth": 20}, {"teeth": 30})
    assert "pair.addendum = 0.5: gives a contact ratio of" in said
    least = float(said.split("must be >= ")[1].split(";")[0])
    made = pair({**shared, "addendum": least + 1e-5}, {"teeth": 20}, {"teeth": 30})
    assert made.contact_ratio == pytest.approx(1.0, abs=1e-4)


def test_tips_that_cut_into_a_root_are_bounded_by_their_diameter() -> None:
    pinion = {"teeth": 10, "rack_tip_radius": 0.47, "bore_diameter_mm": 5.0}
    said = message({"module_mm": 2.5}, pinion, {"teeth": 30, "tip_diameter_mm": 80.75})
    assert "pair.wheel.tip_diameter_mm = 80.75: makes the tip cut" in said
    most = float(said.split("must be < ")[1].split(" mm")[0])
    pair({"module_mm": 2.5}, pinion, {"teeth": 30, "tip_diameter_mm": most - 1e-3})
    assert "cut" in message({"module_mm": 2.5}, pinion, {"teeth": 30, "tip_diameter_mm": most + 1e-3})


TRAIN = """
[pair]
module_mm = 4.5
pressure_angle_deg = 20.0
face_width_mm = 14.0
{distance}
[pair.pinion]
teeth = 16
profile_shift = 0.1817
bore_diameter_mm = 30.0
[pair.wheel]
teeth = 24
profile_shift = 0.1715
bore_diameter_mm = 30.0
[train]
housing = "rigid"
shafts = [
    {{name = "in", x_mm = 0.0, length_mm = 60.0, radius_mm = 15.0, attachments = ["1", "2"]}},
    {{name = "out", x_mm = {x}, length_mm = 60.0, radius_mm = 15.0, attachments = ["3", "4"]}},
]
gears = [
    {{name = "g1", shaft = "in", gear = "pinion", y_mm = 0.0}},
    {{name = "g2", shaft = "out", gear = "wheel", y_mm = 0.0}},
]
meshes = [{{driver = "g1", driven = "g2", stiffness_N_per_m = 2e8}}]
drive = {{shaft = "in", attachment = "1", speed_rad_per_s = 100.0}}
rigid_bores = [
    {{attachment = "1", x_mm = 0.0, y_mm = 30.0}}, {{attachment = "2", x_mm = 0.0, y_mm = -30.0}},
    {{attachment = "3", x_mm = {x}, y_mm = 30.0}}, {{attachment = "4", x_mm = {x}, y_mm = -30.0}},
]
"""


@pytest.mark.parametrize("distance", ["", "centre_distance_mm = 91.5"])
def test_shafts_as_far_apart_as_printed_carry_their_gears(distance: str, tmp_path: Path) -> None:
    """The shifts need 91.500094 mm; shafts 91.5 mm apart are those of the gears except for rounding."""
    job = tmp_path / "train.toml"
    job.write_text(TRAIN.format(distance=distance, x=91.5))
    read = read_train_job(job)
    model = build_train(job_train(read, train_curves(read)))
    line = model.meshes[0]
    assert line.pair.normal_backlash == 0.0
    assert model.kinematics.steady_forces[0] == 0.0
    assert [note for note in model.mesh_notes if note.startswith("mesh g1-g2: the centre distance jams")] == (
        model.mesh_notes if distance else []
    )
    assert bool(model.mesh_notes) == bool(distance)  # without the distance nothing jams
    job.write_text(TRAIN.format(distance="", x=91.49))
    with pytest.raises(InputError, match=r"are 91.49 mm apart, the gears need 91.500"):
        build_train(job_train(read_train_job(job)))
