"""Helical gears: printed values of others, and the relations of ISO 21771 found a second way, in space."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gearfe import Gear, GearPair
from gearfe.base.config import build
from gearfe.base.errors import InputError
from gearfe.base.tables.gearbox import named_gearbox
from gearfe.base.tables.named import NamedGearTable, NamedMeshTable
from gearfe.base.tables.pair import PairTable
from gearfe.cli.main import main
from gearfe.gears.contact.laws import PairModel
from gearfe.gears.contact.whole_gears.pair import whole_pair
from gearfe.gears.gearmesh.sweep import elastic_pair
from gearfe.gears.geometry.derived import derived_geometry
from gearfe.gears.geometry.mesh_geometry import MeshGeometry
from gearfe.gears.rating.stiffness import STEEL, flexibility, mesh_stiffness, single_stiffness
from tests.makers.gears import gear

DEGREE = math.pi / 180.0


def iso_tr_6336_30() -> GearPair:
    """Example 1 of ISO/TR 6336-30, as two open programs quote it: x_2 = 0 follows from the centre distance."""
    both: dict[str, Any] = {"dedendum": 1.4, "rack_tip_radius": 0.39, "helix_angle": 15.8 * DEGREE}
    form = 8e-3, 20 * DEGREE, 0.1
    heights = [0.5 * (tip - z * 8 / math.cos(15.8 * DEGREE)) / 8 for z, tip in ((17, 159.66), (103, 872.35))]
    pinion = Gear(17, *form, 0.05, profile_shift=0.145, addendum=heights[0] - 0.145, hand="left", **both)
    return GearPair(pinion, Gear(103, *form, 0.3, addendum=heights[1], **both), 0.5)


def test_printed_values_of_iso_tr_6336_30() -> None:
    pair = iso_tr_6336_30()
    pinion, wheel = pair.pinion, pair.wheel
    force = 2 * 9000 / pinion.pitch_diameter
    assert force == pytest.approx(127_352, abs=0.5)
    assert math.pi * pinion.pitch_diameter * 6 == pytest.approx(2.664, abs=5e-4)  # m/s at 360/min
    assert pinion.virtual_teeth == pytest.approx(18.905, abs=5e-4)
    assert wheel.virtual_teeth == pytest.approx(114.543, abs=5e-4)
    assert 1 / flexibility(pinion, wheel) == pytest.approx(17.85584, abs=5e-6)
    assert 1e-9 * single_stiffness(pair, STEEL, STEEL) == pytest.approx(12.37047, abs=5e-6)
    # its contact ratio is that of tip diameters of two digits: 5 um of the diameter are 0.001 of the ratio
    assert 1e-9 * mesh_stiffness(pair, STEEL, STEEL) == pytest.approx(17.46485, abs=5e-4)


def test_printed_zone_factors_of_iso_tr_6336_30() -> None:
    """Z_H and Z_beta of ISO 6336-2 are made of base helix angle and transverse angles alone."""
    pair = iso_tr_6336_30()
    base, working = pair.pinion.base_helix_angle, pair.working_pressure_angle
    angle = pair.pinion.transverse_pressure_angle
    zone = math.sqrt(2 * math.cos(base) * math.cos(working) / math.sin(working)) / math.cos(angle)
    assert zone == pytest.approx(2.39533, abs=5e-6)
    assert 1 / math.sqrt(math.cos(pair.pinion.helix_angle)) == pytest.approx(1.01944, abs=5e-6)
    assert math.sqrt(1 / pair.contact_ratio) == pytest.approx(0.803, abs=5e-4)  # Z_eps, eps_beta > 1
    assert pair.overlap_ratio == pytest.approx(100 * math.sin(15.8 * DEGREE) / (8 * math.pi), rel=1e-12)


#: Three stages of the REXS example model of a gear unit by SEW: teeth, module (mm), helix angle (deg, signed, of the
#: first gear), profile shifts, centre distance (mm). Shifts have four digits: 1e-4 m_n of them is 0.1 um here.
STAGES = [
    ((23, 67), 1.0, 30.0, (0.581, 0.5131), 53.0),
    ((13, 76), 1.25, -10.0, (0.521, -0.094), 57.0),
    ((14, 87), 1.5, 10.0, (0.536, -0.4815), 77.0),
]


@pytest.mark.parametrize(("teeth", "module", "helix", "shifts", "distance"), STAGES)
def test_centre_distances_of_a_rexs_model(
    teeth: tuple[int, int], module: float, helix: float, shifts: tuple[float, float], distance: float
) -> None:
    hands = ("right", "left") if helix > 0.0 else ("left", "right")
    gears = [
        Gear(z, 1e-3 * module, 20 * DEGREE, 0.02, 5e-3, profile_shift=x, helix_angle=abs(helix) * DEGREE, hand=hand)
        for z, x, hand in zip(teeth, shifts, hands, strict=True)
    ]
    pair = MeshGeometry(gears[0], gears[1])
    assert 1e3 * pair.working_centre_distance == pytest.approx(distance, abs=1e-4 * module)


def helical_pair(width: float = 20e-3, **form: Any) -> GearPair:
    both: dict[str, Any] = {"module": 2e-3, "pressure_angle": 20.0, "width": width, **form}
    both.setdefault("helix_angle", 25 * DEGREE)
    return GearPair(gear(23, **both), gear(47, **{**both, "hand": "left"}))


def flank_in_space(one: Gear, roll: np.ndarray, z: float, *, left: bool) -> tuple[np.ndarray, np.ndarray]:
    """Points and outward normals of a flank of tooth 0 at roll lengths and a height z, both from the helix alone."""
    flank, rate = one.profile.flank, one.twist_rate
    point, normal = flank.at(roll), flank.normal_at(roll)
    if not left:
        point, normal = point.conj(), normal.conj()
    turn = np.exp(1j * rate * z)
    point, normal = point * turn, normal * turn
    points = np.stack([point.real, point.imag, np.full(len(roll), z)], axis=1)
    # tangents: along the section, and along the helix d/dz = (i kappa P, 1)
    along = np.stack([-normal.imag, normal.real, np.zeros(len(roll))], axis=1)
    helix = 1j * rate * point
    normals = np.cross(along, np.stack([helix.real, helix.imag, np.ones(len(roll))], axis=1))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    outward = np.einsum("ij,ij->i", normals[:, :2], np.stack([normal.real, normal.imag], axis=1))
    return points, normals * np.sign(outward)[:, None]


@pytest.mark.parametrize("hand", ["right", "left"])
def test_span_size_is_the_distance_of_parallel_planes(hand: str) -> None:
    """Planes that touch a left flank and the right flank k - 1 teeth before it lie W_k apart, measured in space."""
    one = gear(29, module=3e-3, pressure_angle=20.0, profile_shift=0.3, tooth_thinning=40e-6,
               helix_angle=22 * DEGREE, hand=hand)  # fmt: skip
    k = one.span_teeth
    roll = np.linspace(1.1 * one.form_roll + 1e-4, 0.95 * one.profile.tip_roll, 7)
    left, outward = flank_in_space(one, roll, 0.0, left=True)
    assert np.abs(outward[:, 2]) == pytest.approx(math.sin(one.base_helix_angle), rel=1e-9)
    turned = 2 * math.pi * (k - 1) / one.teeth
    c, s = math.cos(turned), math.sin(turned)
    back = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])  # the tooth k - 1 places clockwise
    # anvil on the right flank: its normal is opposite, so it touches at another height z, found from the angle
    right, inward = flank_in_space(one, roll, 0.0, left=False)
    right, inward = right @ back.T, inward @ back.T
    for at in range(len(roll)):
        # turning the right flank's generator line by kappa z at height z turns its normal likewise
        wanted = math.atan2(-outward[at, 1], -outward[at, 0])
        turn = math.remainder(wanted - math.atan2(inward[at, 1], inward[at, 0]), 2 * math.pi)
        z = turn / one.twist_rate
        c, s = math.cos(turn), math.sin(turn)
        point = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ right[at] + (0.0, 0.0, z)
        normal = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ inward[at]
        assert normal == pytest.approx(-outward[at], abs=1e-12)
        assert outward[at] @ (left[at] - point) == pytest.approx(one.span_size(k), rel=1e-9)


def test_root_is_the_envelope_of_the_rack_s_transverse_section() -> None:
    """The rack, its normal section stretched by 1/cos(beta), is rolled past: nothing stays that it would cut off."""
    one = gear(17, module=4e-3, pressure_angle=20.0, helix_angle=30 * DEGREE, profile_shift=0.4, rack_tip_radius=0.25)
    m, alpha, stretch = one.module, one.pressure_angle, 1 / math.cos(one.helix_angle)
    depth, rho, r = (one.dedendum - 0.25) * m, 0.25 * m, one.reference_radius
    half = 0.25 * math.pi * m - depth * math.tan(alpha) - rho / math.cos(alpha)
    x, y = stretch * half, r - (depth - one.profile_shift * m)  # centre of the round where the rack has not moved
    move = np.linspace(-2.0 * m, 2.0 * m, 400_001)
    root = one.profile.root
    assert root is not None
    for point in root.point(np.linspace(0.0, 1.0, 9)):
        # the gear's frame has tooth 0 on +x, its space at pi/z; the rack's space stands on +y
        turned = point * np.exp(1j * (0.5 * math.pi - math.pi / one.teeth))
        seen = turned * np.exp(-1j * move / r) - move
        inside = ((seen.real - x) / (stretch * rho)) ** 2 + ((seen.imag - y) / rho) ** 2 - 1.0
        assert inside.min() == pytest.approx(0.0, abs=1e-8)


def test_a_helix_of_nothing_is_a_spur_gear_to_the_last_bit() -> None:
    spur, zero = gear(23, profile_shift=0.2), gear(23, profile_shift=0.2, helix_angle=0.0)
    assert spur == zero
    assert zero.transverse_module == zero.module
    assert zero.transverse_pressure_angle == zero.pressure_angle
    assert zero.virtual_teeth == 23
    assert zero.twist_rate == 0.0


def test_overlap_lets_the_teeth_hand_over() -> None:
    """A transverse contact ratio below one runs where the total is one, and its limit is that of the message."""
    low: dict[str, Any] = {"addendum": 0.55, "dedendum": 1.0, "rack_tip_radius": 0.2}
    wide = helical_pair(20e-3, **low)
    assert wide.contact_ratio < 1.0 < wide.total_contact_ratio
    narrow = 1.05 * (1.0 - wide.contact_ratio) * math.pi * 2e-3 / math.sin(25 * DEGREE)
    assert helical_pair(narrow, **low).total_contact_ratio == pytest.approx(1.0, abs=0.05)
    narrow *= 0.9 / 1.05
    with pytest.raises(
        InputError, match=r"pinion\.addendum = 0\.55: gives a contact ratio of .* overlap ratio"
    ) as said:
        helical_pair(narrow, **low)
    assert said.value.limit is not None
    least = said.value.limit[1]
    both: dict[str, Any] = {"module": 2e-3, "pressure_angle": 20.0, "width": narrow, "helix_angle": 25 * DEGREE, **low}
    for addendum, runs in ((least + 1e-4, True), (least - 1e-4, False)):
        pinion, wheel = gear(23, **{**both, "addendum": addendum}), gear(47, **both, hand="left")
        if runs:
            assert GearPair(pinion, wheel).total_contact_ratio >= 1.0
        else:
            with pytest.raises(InputError, match="contact ratio"):
                GearPair(pinion, wheel)


def test_spur_gears_still_need_a_contact_ratio_of_one() -> None:
    with pytest.raises(InputError, match=r"gives a contact ratio of 0\.\d+ < 1:"):
        helical_pair(helix_angle=0.0, addendum=0.55, dedendum=1.0)


def test_backlash_across_the_flanks_and_along_the_circles() -> None:
    pair = helical_pair(tooth_thinning=30e-6)
    # both gears lose 30 um of normal thickness on the reference circles, which are the working ones here
    assert pair.normal_backlash == pytest.approx(60e-6 * math.cos(20 * DEGREE), rel=1e-9)
    assert pair.backlash == pytest.approx(60e-6 / math.cos(25 * DEGREE), rel=1e-9)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"helix_angle": -0.1}, r"helix_angle = -0\.1: is too small: must be >= 0"),
        ({"helix_angle": 0.8}, r"helix_angle = 0\.8: is too large: must be <= 0\.785"),
        ({"helix_angle": math.nan}, r"helix_angle = nan: must be a finite number"),
        ({"helix_angle": 0.2, "hand": "up"}, r"hand = 'up': must be right or left"),
    ],
)
def test_wrong_helices_of_a_gear(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        gear(23, **changes)


def test_wrong_pairs_of_helices() -> None:
    one = gear(23, helix_angle=0.2)
    with pytest.raises(InputError, match=r"wheel\.hand = 'right': is the hand of both helices"):
        GearPair(one, gear(47, helix_angle=0.2))
    with pytest.raises(InputError, match=r"wheel\.helix_angle = .*differ in helix angle"):
        GearPair(one, gear(47, helix_angle=0.3, hand="left"))


PAIR: dict[str, Any] = {
    "module_mm": 3.5, "pressure_angle_deg": 20.0, "helix_angle_deg": 15.0, "face_width_mm": 23.0,
    "pinion": {"teeth": 20, "profile_shift": 0.1809, "bore_diameter_mm": 30.0},
    "wheel": {"teeth": 30, "profile_shift": 0.0891, "bore_diameter_mm": 30.0},
}  # fmt: skip


def pair_of_table(**changes: Any) -> GearPair:
    table = {**PAIR, "pinion": dict(PAIR["pinion"]), "wheel": dict(PAIR["wheel"])}
    for key, value in changes.items():
        side, _, inner = key.partition("__")
        (table[side] if inner else table)[inner or key] = value
    table = {key: value for key, value in table.items() if value is not None}
    return GearPair.from_table(build(PairTable, table, "pair"))


def test_fzg_gears_of_a_job_file() -> None:
    """FZG test gears H501: 20/30, 15 deg, on the test rig's centre distance of 91.5 mm by shifts of four digits."""
    pair = pair_of_table()
    assert 1e3 * pair.working_centre_distance == pytest.approx(91.5, abs=1e-4 * 3.5)
    assert (pair.pinion.hand, pair.wheel.hand) == ("right", "left")
    assert 1e3 * pair.pinion.tip_radius == pytest.approx(35 / math.cos(15 * DEGREE) + 3.5 * 1.1809, rel=1e-12)
    other = pair_of_table(wheel__helix_hand="right")
    assert (other.pinion.hand, other.wheel.hand) == ("left", "right")


def test_drawing_values_of_a_helical_gear() -> None:
    """Diameters and the span size of a gear give that gear again."""
    plain = pair_of_table(tooth_thinning_um=20.0)
    pinion = plain.pinion
    drawn = pair_of_table(
        module_mm=None,
        centre_distance_mm=91.5,
        pinion__pitch_diameter_mm=1e3 * pinion.pitch_diameter,
        pinion__tip_diameter_mm=2e3 * pinion.tip_radius,
        pinion__root_diameter_mm=2e3 * pinion.root_radius,
        pinion__span_mm=1e3 * pinion.span_size(4),
        pinion__span_teeth=4,
        wheel__pitch_diameter_mm=1e3 * plain.wheel.pitch_diameter,
        wheel__profile_shift="from centre distance",
        wheel__tooth_thinning_um=20.0,
    )
    for name in ("module", "addendum", "dedendum", "tooth_thinning"):
        assert getattr(drawn.pinion, name) == pytest.approx(getattr(pinion, name), rel=1e-9)
    assert drawn.wheel.profile_shift == pytest.approx(0.0891, abs=1e-4)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"pinion__helix_hand": "left", "wheel__helix_hand": "left"},
            r"pair\.wheel\.helix_hand = 'left': is that of gear",
        ),
        ({"helix_angle_deg": None, "wheel__helix_hand": "left"}, r"pair\.wheel\.helix_hand = 'left': .*without helix"),
        ({"helix_angle_deg": -15.0}, r"pair\.helix_angle_deg = -15\.0: must be .*helix_hand"),
        ({"wheel__helix_angle_deg": 14.0}, r"pair\.wheel\.helix_angle_deg = 14\.0: .*must be equal to 15 deg"),
        ({"wheel__span_mm": 60.0, "wheel__span_teeth": 4}, r"pair\.wheel\.span_mm = 60\.0: must be <="),
        ({"wheel__tip_diameter_mm": 140.0}, r"pair\.wheel\.tip_diameter_mm = 140\.0: .*must be < \d"),
    ],
)
def test_mistakes_in_helical_pairs(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        pair_of_table(**changes)


def idler(**changes: dict[str, Any]) -> dict[str, str]:
    """Hands of three gears in a row, and of a fourth that meshes with none."""
    form = {"module_mm": 2.0, "pressure_angle_deg": 20.0, "face_width_mm": 15.0, "bore_diameter_mm": 16.0}
    gears = {name: {"teeth": 25, "helix_angle_deg": 12.0, **form, **changes.get(name, {})} for name in "abcd"}
    meshes = {"one": {"driver": "a", "driven": "b"}, "two": {"driver": "b", "driven": "c"}}
    box = named_gearbox(
        {name: build(NamedGearTable, table, f"gears.{name}") for name, table in gears.items()},
        {name: build(NamedMeshTable, table, f"meshes.{name}") for name, table in meshes.items()},
        {},
    )
    return {name: box.gears[name].form["helix_hand"] for name in gears}


def test_hands_go_through_an_idler() -> None:
    assert idler() == {"a": "right", "b": "left", "c": "right", "d": "right"}
    assert idler(c={"helix_hand": "left"}) == {"a": "left", "b": "right", "c": "left", "d": "right"}
    assert idler(d={"helix_hand": "left"})["d"] == "left"
    with pytest.raises(InputError, match=r"gears\.c\.helix_hand = 'left': is that of gear 'b' in mesh 'two'"):
        idler(a={"helix_hand": "right"}, c={"helix_hand": "left"})
    with pytest.raises(InputError, match=r"gears\.c\.helix_angle_deg = 13\.0: makes helix angles of 12 and 13"):
        idler(c={"helix_angle_deg": 13.0})


JOB = """[pair]
module_mm = 3.5
pressure_angle_deg = 20.0
helix_angle_deg = 15.0
face_width_mm = 23.0
[pair.pinion]
teeth = 20
profile_shift = 0.1809
bore_diameter_mm = 30.0
[pair.wheel]
teeth = 30
profile_shift = 0.0891
bore_diameter_mm = 30.0
[stiffness]
torque_Nm = 300.0
"""


def test_gearfe_gear_shows_a_helical_pair(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    job = tmp_path / "job.toml"
    job.write_text(JOB)
    assert main(["gear", str(job), "--out", str(tmp_path / "out")]) == 0
    made = json.loads((tmp_path / "out" / "gear_pair.json").read_text())
    assert made["overlap_ratio"] == pytest.approx(23 * math.sin(15 * DEGREE) / (3.5 * math.pi), rel=1e-12)
    assert made["total_contact_ratio"] == made["contact_ratio"] + made["overlap_ratio"]
    assert made["pinion"]["helix_hand"] == "right"
    assert made["pinion"]["lead_mm"] == pytest.approx(math.pi * 20 * 3.5 / math.sin(15 * DEGREE), rel=1e-12)
    assert made == {**made, **json.loads(json.dumps(derived_geometry(pair_of_table())))}
    assert "overlap_ratio" in capsys.readouterr().out
    assert (tmp_path / "out" / "gear_pair.png").stat().st_size > 10_000


def test_helices_in_the_picture_lean_with_their_hands() -> None:
    """Along +y, with the axis upright, the teeth of a right-handed helix lean to the right."""
    from gearfe.figures.gears import pair_picture

    figure = pair_picture(pair_of_table())
    view = figure.axes[2]
    pinion = [line for line in view.lines if line.get_color() == view.lines[0].get_color()]
    slopes = [np.nanmean(np.diff(line.get_xdata())) for line in pinion if np.isfinite(line.get_xdata()).sum() > 2]
    assert len(slopes) >= 9
    assert min(slopes) > 0.0
    assert len(pair_picture(pair_of_table(helix_angle_deg=None)).axes) == 2


def test_functions_take_no_helical_gears() -> None:
    pair = helical_pair()
    with pytest.raises(InputError, match=r"pinion\.helix_angle = 0\.43\d+: .*the law of plane sections takes spur"):
        elastic_pair(pair)
    with pytest.raises(InputError, match=r"the check on whole gears takes spur"):
        whole_pair(pair, PairModel())


def test_places_along_the_axes_leave_a_common_width() -> None:
    pair = pair_of_table(pinion__y_mm=4.0, wheel__y_mm=-3.0)
    assert 1e3 * pair.common_width == pytest.approx(23.0 - 7.0, rel=1e-12)
    assert pair.overlap_ratio == pytest.approx(16 * math.sin(15 * DEGREE) / (3.5 * math.pi), rel=1e-12)
    assert pair_of_table(wheel__y_mm=1.0, wheel__face_width_mm=30.0).common_width == pytest.approx(23e-3, rel=1e-12)
    with pytest.raises(InputError, match=r"pair\.wheel\.y_mm = 23\.5: leaves no common face width"):
        pair_of_table(wheel__y_mm=23.5)
