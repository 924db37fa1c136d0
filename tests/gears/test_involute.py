"""The exact tooth profile against its definition: the involute of the base circle, and what a simulated rack leaves."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gearfe.gears.geometry.curves import coordinates, inv, inverse_inv
from gearfe.gears.geometry.gear_data import GearData
from gearfe.gears.geometry.involute import tooth_profile
from gearfe.gears.geometry.pair import Gear, TipRelief

NM = 1e-12  # 1e-9 mm, the accuracy that profile points must have (m)


def gear(teeth=20, degrees=20.0, module=2.5e-3, **form):
    form.setdefault("rack_tip_radius", 0.3 if degrees < 28 else 0.1)
    return Gear(teeth, module, math.radians(degrees), 10e-3, 0.2 * teeth * module, **form)


FORMS = {
    "20 teeth": gear(),
    "25 deg, rounded tip": gear(30, 25.0, tip_round=0.1e-3),
    "undercut": gear(8),
    "undercut, sharp rack": gear(9, rack_tip_radius=0.0),
    "undercut, negative shift": gear(12, profile_shift=-0.3),
    "shifted": gear(12, profile_shift=0.6),
    "rack tip above the pitch line": gear(25, profile_shift=1.1, addendum=0.9),
    "14.5 deg, 150 teeth": gear(150, 14.5),
    "30 deg, 150 teeth": gear(150, 30.0),
    "30 deg, 8 teeth": gear(8, 30.0),
    "thinned": gear(25, tooth_thinning=0.1e-3),
    "full fillet": gear(rack_tip_radius=0.37),
    "sharp rack": gear(40, rack_tip_radius=0.0),
    "linear relief": gear(20, 25.0, tip_relief=TipRelief(20e-6, 1.5e-3)),
    "parabolic relief, rounded tip": gear(20, 25.0, tip_relief=TipRelief(30e-6, 2e-3, 2.0), tip_round=0.2e-3),
}
each_form = pytest.mark.parametrize("one", FORMS.values(), ids=FORMS.keys())


@pytest.mark.parametrize("degrees", [0.0, 1e-3, 1.0, 14.5, 20.0, 45.0, 80.0, 89.0])
def test_inverse_involute_function(degrees):
    angle = math.radians(degrees)
    # inv is flat (angle^3/3) near zero, so the angle is known to eps/angle^2 at best
    assert inverse_inv(inv(angle)) == pytest.approx(angle, abs=1e-13 + 1e-15 / max(angle, 1e-4) ** 2)


def test_involute_function_table():
    """inv 20 deg = 0.014904 and inv 14.5 deg = 0.0055448, as printed in every gear handbook's table."""
    assert inv(math.radians(20.0)) == pytest.approx(0.014904, abs=5e-7)
    assert inv(math.radians(14.5)) == pytest.approx(0.0055448, abs=5e-8)


@each_form
def test_segments_are_joined_tangent_and_simple(one):
    profile = one.profile
    t = np.linspace(0.0, 1.0, 301)
    names = [s.name for s in profile.segments]
    assert names == [n for n in ("root_circle", "trochoid", "involute", "tip_round", "tip") if n in names]
    for before, after in zip(profile.segments, profile.segments[1:], strict=False):
        assert before.end == after.start
        tangent = np.abs(before.normals(np.array([1.0])) - after.normals(np.array([0.0]))).max()
        corner = (after.name == "tip" and not one.tip_round) or (after.name == "involute" and profile.undercut)
        assert corner or tangent < 1e-9, (before.name, after.name)
    for segment in profile.segments:
        ends = segment.curve.point(np.array([0.0, 1.0]))
        np.testing.assert_allclose(coordinates(ends), [segment.start, segment.end], atol=NM)
        np.testing.assert_allclose(np.linalg.norm(segment.normals(t), axis=1), 1.0, rtol=1e-14)
    points = np.concatenate([s.points(t) for s in profile.segments])
    radius, angle = np.hypot(*points.T), np.arctan2(points[:, 1], points[:, 0])
    # a polar angle over a radius that never falls, inside its half pitch: no loop, no crossing with a neighbour
    assert np.diff(radius).min() > -NM
    assert angle.min() >= 0.0
    assert angle.max() <= math.pi / one.teeth + 1e-15
    np.testing.assert_allclose([radius[0], angle[0]], [one.root_radius, math.pi / one.teeth], rtol=1e-13)
    np.testing.assert_allclose([radius[-1], angle[-1]], [one.tip_radius, 0.0], rtol=1e-13, atol=1e-15)


@each_form
def test_normals_point_outwards_and_stand_on_the_curve(one):
    t, h = np.linspace(0.05, 0.95, 40), 1e-4
    for segment in one.profile.segments:
        tangent = (segment.points(t + h) - segment.points(t - h)) / (2 * h)
        tangent /= np.linalg.norm(tangent, axis=1)[:, None]
        outward = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)  # the material lies right of the way to the tip
        away = [abs(t - b) > 2 * h for b in segment.breaks]
        keep = np.all(away, axis=0) if away else slice(None)
        np.testing.assert_allclose(segment.normals(t)[keep], outward[keep], atol=1e-6)


@each_form
def test_involute_normals_touch_the_base_circle(one):
    profile = one.profile
    end = min(profile.round_roll, profile.relief_roll)
    s = np.linspace(profile.form_roll, end, 50)
    points, normals = coordinates(profile.flank.at(s)), coordinates(profile.flank.normal_at(s))
    lever = points[:, 0] * normals[:, 1] - points[:, 1] * normals[:, 0]
    np.testing.assert_allclose(lever, one.base_radius, rtol=1e-13)
    # the tangent from the base circle has the length s, and unrolls from the base circle
    np.testing.assert_allclose(np.hypot(*points.T) ** 2, one.base_radius**2 + s**2, rtol=1e-13)
    foot = points - s[:, None] * normals
    unrolled = -np.diff(np.unwrap(np.arctan2(foot[:, 1], foot[:, 0]))) * one.base_radius
    np.testing.assert_allclose(unrolled, np.diff(s), atol=NM)


@each_form
def test_tooth_thickness_on_any_circle(one):
    """s_y = 2 r_y [(pi/2 + 2 x tan(alpha))/z + inv(alpha) - inv(alpha_y)] less the thinning (ISO 21771, 5.5.2)."""
    alpha, z = one.pressure_angle, one.teeth
    s = np.linspace(one.form_roll, min(one.profile.round_roll, one.profile.relief_roll), 20)
    x, y = coordinates(one.profile.flank.at(s)).T
    alpha_y = np.arccos(np.minimum(1.0, one.base_radius / np.hypot(x, y)))
    half = (math.pi / 2 + 2 * one.profile_shift * math.tan(alpha)) / z + inv(alpha) - (np.tan(alpha_y) - alpha_y)
    half -= one.tooth_thinning / one.pitch_diameter
    np.testing.assert_allclose(np.arctan2(y, x), half, atol=1e-10)


def rack_distance(one, points, travel):
    """Signed distance (m) of gear points to the rack's cutting tooth after a travel X along its pitch line.

    The rack tooth is built from its definition alone: flanks at the pressure angle, half a pitch wide (plus the
    thinning) on the reference line, tip land at the dedendum, corner round tangent to land and flank. It is a
    trapezium offset by the corner's radius, met in the gear's space, whose middle is turned to +y.
    """
    m, alpha, rho = one.module, one.pressure_angle, one.rack_tip_radius * one.module
    turn = math.pi / 2 - math.pi / one.teeth - travel / one.reference_radius
    c, s = np.cos(turn), np.sin(turn)
    x = np.abs(points[:, :1] * c - points[:, 1:] * s - travel)
    height = points[:, :1] * s + points[:, 1:] * c - (one.reference_radius + one.profile_shift * m)
    # corner of the trapezium: rho above the land and rho inside the flank
    corner_y = -one.dedendum * m + rho
    flank_x = math.pi * m / 4 + one.tooth_thinning / 2 + corner_y * math.tan(alpha)
    corner_x = flank_x - rho / math.cos(alpha)
    along = (x - corner_x) * math.sin(alpha) + (height - corner_y) * math.cos(alpha)
    across = (x - corner_x) * math.cos(alpha) - (height - corner_y) * math.sin(alpha)
    below = corner_y - height
    outside_corner = (along < 0.0) & (x > corner_x)
    nearest = np.where(outside_corner, np.hypot(x - corner_x, height - corner_y), np.maximum(across, below))
    return nearest - rho


@each_form
def test_root_and_flank_are_what_a_rack_leaves(one):
    """At the closest of many rack positions every point is just touched, and at none is it cut into."""
    profile = one.profile
    t = np.linspace(0.0, 1.0, 33)
    points = np.concatenate([s.points(t) for s in profile.segments if s.name in ("root_circle", "trochoid")])
    rolls = np.linspace(profile.form_roll, profile.round_roll, 33)
    unrelieved = rolls[rolls <= profile.relief_roll]
    points = np.concatenate([points, coordinates(profile.flank.at(unrelieved))])
    width = 9.0 * one.module
    centre = np.zeros((len(points), 1))
    for _ in range(6):  # refined scans of the rack's travel, 401 positions each
        travel = centre + width * np.linspace(-1.0, 1.0, 401)
        distance = rack_distance(one, points, travel)
        best = distance.argmin(axis=1)
        centre = np.take_along_axis(travel, best[:, None], axis=1)
        width /= 40.0
    np.testing.assert_allclose(distance.min(axis=1), 0.0, atol=NM)


@each_form
def test_arc_lengths(one):
    for segment in one.profile.segments:
        t = np.linspace(0.0, 1.0, 20001)
        chords = np.hypot(*np.diff(segment.points(t), axis=0).T).sum()
        assert segment.length == pytest.approx(chords, rel=1e-7)
        goal = np.linspace(0.0, segment.length, 23)
        found = segment.parameter_at(goal)
        np.testing.assert_allclose(segment.arc_length_at(found), goal, atol=1e-15)
        assert found[0] == 0.0
        assert found[-1] == 1.0
        assert np.all(np.diff(found) > 0.0)


def test_arc_length_of_the_involute():
    """An involute unrolled from s1 to s2 is (s2^2 - s1^2)/(2 r_b) long."""
    one = gear(30)
    flank = one.profile.segment("involute")
    exact = (one.profile.round_roll**2 - one.form_roll**2) / (2 * one.base_radius)
    assert flank.length == pytest.approx(exact, rel=1e-13)


def test_roll_lengths_and_parameters():
    one = gear(20, 25.0, tip_round=0.1e-3, tip_relief=TipRelief(20e-6, 2e-3))
    profile, flank = one.profile, one.profile.segment("involute")
    assert profile.tip_roll == pytest.approx(math.sqrt(one.tip_radius**2 - one.base_radius**2), rel=1e-14)
    assert profile.relief_roll == pytest.approx(profile.tip_roll - 2e-3, rel=1e-14)
    s = np.linspace(profile.form_roll, profile.round_roll, 9)
    t = profile.flank.parameter(s)
    np.testing.assert_allclose(profile.flank.roll(t), s, rtol=1e-14)
    np.testing.assert_allclose(flank.points(t), coordinates(profile.flank.at(s)), atol=NM)
    assert flank.breaks == pytest.approx([float(profile.flank.parameter(profile.relief_roll))])


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0, 3.0])
def test_tip_relief_is_taken_off_along_the_involute_normal(exponent):
    amount, length = 25e-6, 2e-3
    plain = gear(30, 25.0)
    relieved = gear(30, 25.0, tip_relief=TipRelief(amount, length, exponent))
    tip = plain.profile.tip_roll
    s = np.linspace(tip - 1.5 * length, tip, 31)
    moved = coordinates(relieved.profile.flank.at(s)) - coordinates(plain.profile.flank.at(s))
    normal = coordinates(plain.profile.flank.normal_at(s))
    expected = amount * np.maximum(0.0, (s - (tip - length)) / length) ** exponent
    np.testing.assert_allclose(moved, -expected[:, None] * normal, atol=1e-17)
    assert expected[-1] == pytest.approx(amount)


def test_tip_round_touches_flank_and_tip_circle():
    radius = 0.25e-3
    one = gear(20, 25.0, tip_round=radius, tip_relief=TipRelief(30e-6, 2e-3))
    tip_round = one.profile.segment("tip_round")
    t = np.linspace(0.0, 1.0, 50)
    centres = tip_round.points(t) - radius * tip_round.normals(t)
    np.testing.assert_allclose(centres, centres[:1].repeat(50, axis=0), atol=NM)
    assert np.hypot(*centres[0]) == pytest.approx(one.tip_radius - radius, abs=NM)
    assert np.hypot(*tip_round.end) == pytest.approx(one.tip_radius, abs=NM)


def test_the_undercut_junction_lies_on_both_curves():
    one = gear(8)
    assert one.undercut
    assert not gear(18).undercut
    trochoid, flank = one.profile.segment("trochoid"), one.profile.segment("involute")
    joint = np.array([1.0])
    np.testing.assert_allclose(trochoid.curve.point(joint), flank.curve.point(1.0 - joint), atol=1e-15)


def small_gear(teeth: int, profile_shift: float) -> GearData:
    """A gear by a sharp rack at 14.5 deg, unchecked: gears have 8 teeth at least, profiles need not."""
    return GearData(
        teeth=teeth, module=1e-3, pressure_angle=math.radians(14.5), face_width=1e-2, bore_diameter=1e-3,
        profile_shift=profile_shift, addendum=1.0, dedendum=1.25, rack_tip_radius=0.0,
    )  # fmt: skip


def test_waist_of_a_severely_undercut_tooth():
    """6 teeth at 14.5 deg with a sharp rack are cut through at x = -0.5; 7 teeth at x = -0.6 just hold together.

    The half angle 0.00196 of that waist was found by sweeping the rack tip in another program.
    """
    whole = tooth_profile(small_gear(teeth=7, profile_shift=-0.6))
    points = whole.segment("trochoid").points(np.linspace(0.0, 1.0, 4001))
    assert np.arctan2(points[:, 1], points[:, 0]).min() == pytest.approx(0.00196, abs=5e-6)
    with pytest.raises(ValueError, match="cuts the tooth through"):
        tooth_profile(small_gear(teeth=6, profile_shift=-0.5))


def test_zero_length_segments_are_left_out():
    land = (math.pi / 4 - 1.25 * math.tan(math.radians(30))) * math.cos(math.radians(30)) / (1 - 0.5)
    names = [s.name for s in gear(30, 30.0, rack_tip_radius=land).profile.segments]
    assert names == ["trochoid", "involute", "tip"]
    pointed_rack_on_pitch_line = gear(20, rack_tip_radius=0.0, dedendum=0.5, profile_shift=0.5, addendum=0.5)
    assert [s.name for s in pointed_rack_on_pitch_line.profile.segments] == ["root_circle", "involute", "tip"]
    assert tooth_profile(gear()).segments == gear().profile.segments
