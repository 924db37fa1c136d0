"""Derived quantities of gears and pairs against handbooks, and the path of contact against plane geometry."""

from __future__ import annotations

import dataclasses
import math
import pickle
from itertools import pairwise

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.gears.geometry.curves import inv
from gearfe.gears.geometry.pair import Gear, GearPair, TipRelief
from gearfe.gears.rating import dynamics, stiffness


def gear(teeth, module=2.5e-3, degrees=25.0, **form):
    form.setdefault("rack_tip_radius", 0.3 if degrees < 26 else 0.1)
    return Gear(teeth, module, math.radians(degrees), 10e-3, 0.2 * teeth * module, **form)


SHIPPED = GearPair(gear(20, tip_round=0.1e-3), gear(30, tip_round=0.1e-3))


def handbook_pair(distance=None):
    """Profile shifted spur gears: m 3, 20 deg, 12/24 teeth, x 0.6/0.36, tip diameters 44.840 and 79.400 mm.

    The worked example of the KHK gear handbook ("Calculation of gear dimensions", profile shifted spur gear), also
    tabulated by D. Bolsover, "Profile shifted external spur gears", where the centre distance 56.5 mm is the input.
    """

    def one(teeth, shift, tip_diameter):
        shortening = teeth / 2 + 1.0 + shift - tip_diameter / 6.0
        return gear(teeth, 3e-3, 20.0, profile_shift=shift, tip_shortening=shortening)

    return GearPair(one(12, 0.6, 44.840), one(24, 0.36, 79.400), distance)


def test_profile_shifted_pair_of_the_handbook():
    pair = handbook_pair()
    assert math.degrees(pair.working_pressure_angle) == pytest.approx(26.0886, abs=5e-5)
    assert pair.working_centre_distance == pytest.approx(56.4999e-3, abs=5e-8)
    assert pair.backlash == 0.0
    given = handbook_pair(56.5e-3)
    assert math.degrees(given.working_pressure_angle) == pytest.approx(26.0888, abs=5e-5)
    assert inv(given.working_pressure_angle) == pytest.approx(0.034317, abs=5e-7)
    assert given.reference_centre_distance == pytest.approx(54e-3)
    assert [2 * g.base_radius for g in (given.pinion, given.wheel)] == pytest.approx([33.8289e-3, 67.6579e-3], abs=5e-8)
    working = [2 * given.pinion_working_radius, 2 * given.wheel_working_radius]
    assert working == pytest.approx([37.667e-3, 75.333e-3], abs=5e-7)
    assert [2 * g.root_radius for g in (given.pinion, given.wheel)] == pytest.approx([32.1e-3, 66.66e-3])
    assert given.contact_ratio == pytest.approx(1.202, abs=5e-4)


@pytest.mark.parametrize(("z1", "z2", "degrees"), [(20, 30, 25.0), (24, 150, 20.0), (20, 150, 30.0), (35, 150, 14.5)])
def test_contact_ratio_is_the_textbook_formula(z1, z2, degrees):
    """eps = [sqrt(r_a1^2 - r_b1^2) + sqrt(r_a2^2 - r_b2^2) - a sin(alpha)] / (pi m cos(alpha))."""
    pair = GearPair(gear(z1, degrees=degrees), gear(z2, degrees=degrees))
    m, alpha = 2.5, math.radians(degrees)
    reach = sum(math.sqrt((m * z / 2 + m) ** 2 - (m * z / 2 * math.cos(alpha)) ** 2) for z in (z1, z2))
    expected = (reach - m * (z1 + z2) / 2 * math.sin(alpha)) / (math.pi * m * math.cos(alpha))
    assert pair.contact_ratio == pytest.approx(expected, rel=1e-12)
    assert pair.contact_ratio_active == pytest.approx(expected, rel=1e-12)
    assert pair.contact_ratio_effective == pytest.approx(expected, rel=1e-12)
    assert pair.path_length == pytest.approx(expected * pair.base_pitch)
    assert pair.working_pressure_angle == alpha
    assert pair.gear_ratio == z2 / z1


def test_path_ends_where_the_tip_circles_cross_the_line_of_action():
    pair = GearPair(gear(20, profile_shift=0.2), gear(30), 63.2e-3)
    assert pair.backlash > 0.0
    alpha, a = pair.working_pressure_angle, pair.working_centre_distance
    direction = np.array([math.sin(alpha), math.cos(alpha)])
    pitch_point = np.array([pair.pinion_working_radius, 0.0])

    def along(point):
        return pitch_point + (point - pair.path["C"].pinion_roll) * direction

    path = pair.path
    assert np.hypot(*along(path["E"].pinion_roll)) == pytest.approx(pair.pinion.tip_radius, rel=1e-13)
    assert np.hypot(*(along(path["A"].pinion_roll) - [a, 0.0])) == pytest.approx(pair.wheel.tip_radius, rel=1e-13)
    for point in path.values():
        assert np.hypot(*along(point.pinion_roll)) ** 2 == pytest.approx(
            pair.pinion.base_radius**2 + point.pinion_roll**2
        )
        assert point.pinion_roll + point.wheel_roll == pytest.approx(a * math.sin(alpha))
    assert path["D"].pinion_roll - path["A"].pinion_roll == pytest.approx(pair.base_pitch)
    assert path["E"].pinion_roll - path["B"].pinion_roll == pytest.approx(pair.base_pitch)
    assert path["D"].pinion_angle - path["A"].pinion_angle == pytest.approx(pair.mesh_cycle)
    assert path["C"].pinion_roll / pair.pinion_working_radius == pytest.approx(math.sin(alpha))


def test_pitch_point_angle_of_standard_gears():
    """At 20 teeth the left flank crosses the reference circle 90/20 deg from the tooth's middle: so at -4.5 deg."""
    assert math.degrees(SHIPPED.path["C"].pinion_angle) == pytest.approx(-4.5)


def test_backlash_from_thinning_and_from_centre_distance():
    """On the reference circles thinning is backlash; a wider centre adds 2 da tan(alpha) to first order."""
    thinned = GearPair(gear(20, tooth_thinning=30e-6), gear(30, tooth_thinning=50e-6))
    assert thinned.backlash == pytest.approx(80e-6)
    assert thinned.normal_backlash == pytest.approx(80e-6 * math.cos(math.radians(25)))
    assert thinned.contact_twist == pytest.approx(thinned.normal_backlash / 2 / thinned.wheel.base_radius)
    wider = GearPair(gear(20), gear(30), 62.5e-3 + 1e-6)
    assert wider.backlash == pytest.approx(2e-6 * math.tan(math.radians(25)), rel=1e-3)
    assert GearPair(gear(20), gear(30)).contact_twist == 0.0


def test_tip_round_and_relief_shorten_the_effective_path():
    """The round starts where a circle inside the tip circle touches the flank: s = rho + sqrt((r_a-rho)^2 - r_b^2)."""
    rho, relief = 0.2e-3, 1.5e-3
    pair = GearPair(gear(20, tip_round=rho), gear(30, tip_relief=TipRelief(20e-6, relief)))
    one, two = pair.pinion, pair.wheel
    tips = [math.sqrt(g.tip_radius**2 - g.base_radius**2) for g in (one, two)]
    rounded = rho + math.sqrt((one.tip_radius - rho) ** 2 - one.base_radius**2)
    pitch, tangent = pair.base_pitch, pair.tangent_length
    assert pair.contact_ratio == pytest.approx((sum(tips) - tangent) / pitch)
    assert pair.contact_ratio_active == pytest.approx((rounded + tips[1] - tangent) / pitch)
    assert pair.contact_ratio_effective == pytest.approx((rounded + tips[1] - relief - tangent) / pitch)
    assert pair.path["E"].pinion_roll == pytest.approx(rounded)


def test_form_circle_and_undercut_limit():
    """A rack whose straight flank reaches h_aP = 1 undercuts below z = 2/sin^2(alpha): 17.1 teeth at 20 deg."""
    deep = {"degrees": 20.0, "dedendum": 1.0, "rack_tip_radius": 0.0}
    assert gear(17, **deep).undercut
    assert not gear(18, **deep).undercut
    # form circle of the 18: tangent point of the rack's last straight point, one module below the pitch line
    m, alpha = 2.5e-3, math.radians(20.0)
    expected = 9 * m * math.sin(alpha) - m / math.sin(alpha)
    assert gear(18, **deep).form_roll == pytest.approx(expected)
    assert gear(12, profile_shift=1.0 - 6 * math.sin(alpha) ** 2 + 1e-9, **deep).form_roll == pytest.approx(
        0.0, abs=1e-8
    )


def test_an_undercut_pair_warns_while_the_path_survives():
    pair = GearPair(gear(12, degrees=20.0), gear(40, degrees=20.0))
    assert pair.pinion.undercut
    assert 1.0 < pair.contact_ratio < 1.4
    assert len(pair.warnings) == 1
    assert "undercut" in pair.warnings[0]
    assert pair.path["A"].pinion_roll == pair.pinion.form_roll
    assert SHIPPED.warnings == ()


def test_long_relief_warns():
    relieved = TipRelief(20e-6, 4e-3)
    pair = GearPair(gear(20, tip_relief=relieved), gear(30, tip_relief=relieved))
    assert pair.contact_ratio_effective < 1.0 < pair.contact_ratio_active
    assert any("relief" in text for text in pair.warnings)


def test_swapping_the_gears_mirrors_the_path():
    swapped = GearPair(SHIPPED.wheel, SHIPPED.pinion)
    assert swapped.contact_ratio == pytest.approx(SHIPPED.contact_ratio, rel=1e-14)
    for name, other in zip("ABCDE", "EDCBA", strict=True):
        assert swapped.path[name].pinion_roll == pytest.approx(SHIPPED.path[other].wheel_roll)


def test_gears_are_values():
    one, same, other = gear(20), gear(20), gear(20, addendum=0.9)
    assert one == same
    assert hash(one) == hash(same)
    assert one != other
    with pytest.raises(dataclasses.FrozenInstanceError):
        one.teeth = 21
    copy = pickle.loads(pickle.dumps(SHIPPED))
    assert copy == SHIPPED
    assert copy.contact_ratio == SHIPPED.contact_ratio
    assert gear(20).tip_thickness == pytest.approx(2 * gear(20).tip_radius * gear(20).profile.tip_half_angle)


def test_iso_6336_stiffness_of_the_shipped_pair():
    """By hand: q' = 0.04723 + 0.15551/20 + 0.25791/30, C_M 0.8, C_B 0.975 * 1.1, E 200/206."""
    assert stiffness.flexibility(SHIPPED.pinion, SHIPPED.wheel) == pytest.approx(0.0636025)
    assert stiffness.rack_factor(SHIPPED.pinion) == pytest.approx(1.0725)
    assert stiffness.single_stiffness(SHIPPED, 200e9, 200e9) / 1e9 == pytest.approx(13.1, abs=0.05)
    assert stiffness.mesh_stiffness(SHIPPED, 200e9, 200e9) / 1e9 == pytest.approx(17.4, abs=0.05)
    assert stiffness.pair_modulus(210e9, 70e9) == pytest.approx(105e9)


def test_iso_6336_dynamic_factor():
    """Clause 6.5 by hand: 200 N/mm, c' 13.1 N/(mm um), 2 um of pitch and 1.5 um of profile deviation, 5 um relief."""
    mean = 13.1 * (0.75 * SHIPPED.contact_ratio + 0.25)
    assert 1.0 < SHIPPED.contact_ratio <= 1.5
    given = {"stiffness": 1e7 * mean, "mass": 0.1, "force": 2000.0 / math.cos(math.radians(25))}
    speed = np.array([0.5, 0.85, 1.0, 1.15, 1.325, 1.5, 3.0]) * math.sqrt(1e7 * mean / 0.1) / 20
    p, f, k = 13.1 * 2.0 / 200, 13.1 * 1.5 / 200, abs(1 - 13.1 * 5.0 / 200)
    sub, top = 0.32 * p + 0.34 * f + 0.23 * k, 1 + 0.32 * p + 0.34 * f + 0.90 * k
    end = 0.47 * p + 0.47 * f + 0.75
    by_hand = [1 + 0.5 * sub, 1 + 0.85 * sub, top, top, 0.5 * (top + end), end, end]
    found = dynamics.dynamic_factor(SHIPPED, speed * (1 - 1e-12), **given, relief=5e-6, deviations=(2e-6, 1.5e-6))
    assert found == pytest.approx(by_hand, rel=1e-9)
    light = dynamics.dynamic_factor(SHIPPED, speed[:2], **{**given, "force": 500.0 / math.cos(math.radians(25))})
    assert light == pytest.approx([1 + 0.5 * 0.23, 1.9], rel=1e-9)  # N_S = 0.5 + 0.35 sqrt(0.5) = 0.75


def test_random_legal_gears_have_simple_profiles():
    """Over random racks and teeth: segments joined, radius never falling, polar angle inside the half pitch."""
    random = np.random.default_rng(20)
    legal = pairs = 0
    t = np.linspace(0.0, 1.0, 101)
    for _ in range(400):
        m = random.uniform(0.2, 12.0) * 1e-3
        relief = TipRelief(random.uniform(0.0, 0.02) * m, random.uniform(0.2, 0.8) * m, random.choice([1.0, 2.0]))
        form = {
            "profile_shift": random.uniform(-0.7, 1.0),
            "addendum": random.uniform(0.6, 1.2),
            "dedendum": random.uniform(0.9, 1.5),
            "rack_tip_radius": random.uniform(0.0, 0.35),
            "tip_round": random.choice([0.0, 0.05]) * m,
            "tip_relief": relief if random.random() < 0.5 else None,
            "tooth_thinning": random.uniform(0.0, 0.05) * m,
        }
        try:
            one = gear(int(random.integers(5, 151)), m, random.uniform(13.0, 31.0), **form)
        except InputError:
            continue
        legal += 1
        segments = one.profile.segments
        assert all(a.end == b.start for a, b in pairwise(segments))
        assert all(s.length > 0.0 for s in segments)
        points = np.concatenate([s.points(t) for s in segments])
        radius, angle = np.hypot(*points.T), np.arctan2(points[:, 1], points[:, 0])
        assert np.diff(radius).min() > -1e-13 * one.tip_radius
        assert angle.min() >= 0.0
        assert angle.max() <= math.pi / one.teeth * (1 + 1e-12)
        try:
            pair = GearPair(one, dataclasses.replace(one, teeth=one.teeth + 20, profile_shift=0.1))
        except InputError:
            continue
        pairs += 1
        assert pair.contact_ratio >= pair.contact_ratio_active >= 1.0
    assert legal > 150
    assert pairs > 30
