"""The unloaded transmission error of exact rigid flanks, against the theory of involutes."""

import math

import numpy as np
import pytest

from gearfe.gears.geometry.first_contact import ToothFlanks
from gearfe.gears.geometry.gear_data import TipRelief
from gearfe.gears.geometry.pair import Gear, GearPair
from tests.makers.gears import pair
from tests.makers.unloaded import unloaded_twist

NM = 1e-9


def error(gears, angles):
    """Unloaded transmission error (m) counted from where unmodified flanks touch."""
    return (unloaded_twist(gears, angles) - gears.contact_twist) * gears.wheel.base_radius


PLAIN = {
    "20/30": {},
    "tip rounds": {"tip_round": 0.15e-3},
    "backlash from the distance": {"centre_distance": 62.6e-3},
    "backlash from thinning": {"tooth_thinning": 60e-6},
    "profile shift": {"z1": 14, "z2": 40, "pressure_angle": 20.0, "profile_shift": 0.3},
    "S0 gearing": {"pinion": {"profile_shift": 0.35}, "wheel": {"profile_shift": -0.35}},
    "extreme teeth": {"z1": 17, "z2": 150, "pressure_angle": 20.0},
    "low angle": {"z1": 40, "z2": 60, "pressure_angle": 14.5},
}


@pytest.mark.parametrize("case", PLAIN)
def test_involutes_transmit_uniformly(case):
    """The law of gearing: contact ratio above 1 and no modification make no error, at any angle."""
    gears = pair(**PLAIN[case])
    angles = np.linspace(-2.0, 2.5, 61) * gears.mesh_cycle
    np.testing.assert_allclose(error(gears, angles), 0.0, atol=NM)


def test_backlash_is_half_on_either_side():
    gears = pair(centre_distance=62.6e-3)
    expected = 0.5 * gears.normal_backlash / gears.wheel.base_radius
    np.testing.assert_allclose(unloaded_twist(gears, [0.0, 0.1]), expected, atol=1e-7)


@pytest.mark.parametrize("relieved", ["pinion", "wheel", "both"])
def test_relief_is_the_error_where_no_full_flank_touches(relieved):
    """TE = the least over the pairs in contact of the sum of both reliefs at their roll lengths."""
    relief = TipRelief(15e-6, 3.5e-3)
    form = {"tip_relief": relief}
    sides = {"pinion": {"pinion": form}, "wheel": {"wheel": form}, "both": form}[relieved]
    gears = pair(**sides)
    angles = np.linspace(0.0, gears.mesh_cycle, 91)
    expected, clear = np.full(len(angles), np.inf), np.ones(len(angles), dtype=bool)
    start, end = gears.path_limits(rounded=False)
    for k in range(-3, 4):
        s1 = np.array([gears.pinion_roll_at(a + k * gears.mesh_cycle) for a in angles])
        s2 = gears.tangent_length - s1
        total = np.zeros(len(angles))
        for one, s, has in ((gears.pinion, s1, relieved != "wheel"), (gears.wheel, s2, relieved != "pinion")):
            tip = math.sqrt(one.tip_radius**2 - one.base_radius**2)
            total += relief.amount * np.clip((s - (tip - relief.length)) / relief.length, 0.0, None) * has
        inside = (s1 > start + 1e-4) & (s1 < end - 1e-4)
        expected[inside] = np.minimum(expected[inside], total[inside])
        # a sharp tip just off the path may bear before the relieved flanks do
        clear &= (np.abs(s1 - start + 3e-4) > 4e-4) & (np.abs(s1 - end - 3e-4) > 4e-4)
    found = error(gears, angles)
    known = np.isfinite(expected)
    assert (found[known] < expected[known] + 0.03 * relief.amount).all()  # theory to first order in the relief
    assert (known & clear).mean() > 0.6
    np.testing.assert_allclose(found[known & clear], expected[known & clear], atol=0.03 * relief.amount)
    assert found.min() > -NM


def test_long_relief_makes_an_error_at_some_angle():
    gears = pair(tip_relief=TipRelief(20e-6, 3.5e-3))
    found = error(gears, np.linspace(0.0, gears.mesh_cycle, 91))
    assert 2e-6 < found.max() < 20e-6
    assert found.min() == pytest.approx(0.0, abs=NM)


def test_it_repeats_with_the_mesh_cycle():
    gears = pair(17, 31, tip_relief=TipRelief(20e-6, 3e-3))
    angles = np.linspace(0.0, 1.0, 20) * gears.mesh_cycle
    np.testing.assert_allclose(error(gears, angles + 5 * gears.mesh_cycle), error(gears, angles), atol=1e-12)


def outline(gear, names):
    """Points (m) of some segments of a gear's left half profile as complex numbers, root to tip."""
    t = np.linspace(0.0, 1.0, 20001)
    points = np.concatenate([one.points(t) for one in gear.profile.segments if one.name in names])
    return points[:, 0] + 1j * points[:, 1]


@pytest.mark.parametrize("undercut", ["pinion", "wheel"])
def test_an_undercut_root_is_touched_below_its_edge(undercut):
    """19/85 teeth, contact ratio 1.4 instead of 2.2: the mate's tip round meets the root 0.05 mm below the edge of the
    undercut. Against the dense outlines: the least turn of the wheel at which any of their points meet."""
    sizes = {"module": 4.21e-3, "pressure_angle": math.radians(20.0), "face_width": 12e-3}
    form = {"addendum": 1.11, "dedendum": 1.39, "rack_tip_radius": 0.308}
    relief = TipRelief(17.8e-6, 1.57e-3, 1.0)
    small = Gear(19, bore_diameter=27e-3, profile_shift=-0.438, tip_relief=relief, **sizes, **form)
    large = Gear(85, bore_diameter=193e-3, profile_shift=-0.453, tip_round=0.253e-3, **sizes, **form)
    gears = GearPair(small, large) if undercut == "pinion" else GearPair(large, small)
    names = ("trochoid", "involute", "relief", "flank", "tip_round")
    pinion, wheel = (outline(gear, names) for gear in (gears.pinion, gears.wheel))
    order = np.argsort(np.abs(wheel), kind="stable")
    angles, mates = np.linspace(0.0, gears.mesh_cycle, 60, endpoint=False), gears.wheel.teeth
    expected = np.full(len(angles), np.inf)
    for i, angle in enumerate(angles):
        for k in range(-3, 4):
            seen = pinion * np.exp(1j * (angle + k * gears.mesh_cycle)) - gears.working_centre_distance
            frame = -angle / gears.gear_ratio + math.pi - (2 * k + 1) * math.pi / mates
            at = np.interp(np.abs(seen), np.abs(wheel)[order], np.angle(wheel)[order], left=np.nan, right=np.nan)
            apart = np.angle(seen * np.exp(-1j * (frame + at)))
            expected[i] = min(expected[i], np.nanmin(np.where(np.isfinite(apart), apart, np.inf)))
    found = ToothFlanks(gears).first_contacts(angles)
    least = unloaded_twist(gears, angles)
    first = found.twist == least[found.position]
    gear = 0 if undercut == "pinion" else 1
    assert (found.place[first, gear] < 0).any()
    np.testing.assert_allclose(least * gears.wheel.base_radius, expected * gears.wheel.base_radius, atol=2 * NM)
