"""Every gear or pair that cannot be made or cannot run is refused, with the key, the limit and a cure."""

from __future__ import annotations

import math
import re

import pytest

from gearfe.base.errors import InputError
from gearfe.gears.geometry.pair import Gear, GearPair, TipRelief

#: Waist of the tooth below zero: see the test of the waist in test_involute.py.
SEVERED = {
    "teeth": 8,
    "pressure_angle": math.radians(14.5),
    "profile_shift": -0.9,
    "rack_tip_radius": 0.0,
    "bore_diameter": 1e-3,
}


def gear(teeth=20, **form):
    data = {"module": 2.5e-3, "pressure_angle": math.radians(20.0), "face_width": 10e-3, "bore_diameter": 5e-3}
    return Gear(teeth, **{**data, **form})


@pytest.mark.parametrize(
    ("form", "field", "says"),
    [
        ({"teeth": 7}, "teeth", ">= 8"),
        ({"teeth": 20.5}, "teeth", "whole number"),
        ({"teeth": True}, "teeth", "whole number"),
        ({"teeth": math.nan}, "teeth", "whole number"),
        ({"module": -1e-3}, "module", "> 0"),
        ({"module": math.nan}, "module", "finite"),
        ({"module": math.inf}, "module", "finite"),
        ({"module": "2.5"}, "module", "finite number"),
        ({"pressure_angle": 0.0}, "pressure_angle", ">= 0.08"),
        ({"pressure_angle": 20.0}, "pressure_angle", "<= 0.78"),
        ({"face_width": 0.0}, "face_width", "> 0"),
        ({"bore_diameter": 0.0}, "bore_diameter", "> 0"),
        ({"bore_diameter": 44e-3}, "bore_diameter", r"<= 42.5 mm.*root circle of 43.75 mm"),
        ({"profile_shift": math.inf}, "profile_shift", "finite"),
        ({"profile_shift": -5.0}, "profile_shift", "no tooth thickness"),
        ({"addendum": -1.0}, "addendum", "> 0"),
        ({"dedendum": -1.25}, "dedendum", "> 0"),
        ({"dedendum": 2.2}, "dedendum", "no land.*< 2.1579"),
        ({"rack_tip_radius": -0.1}, "rack_tip_radius", ">= 0"),
        ({"rack_tip_radius": 0.5}, "rack_tip_radius", "land.*<= 0.471"),
        ({"pressure_angle": math.radians(30.0)}, "rack_tip_radius", "land.*<= 0.1103"),
        ({"tip_round": -1e-4}, "tip_round", ">= 0"),
        ({"tip_round": 2e-3}, "tip_round", r"overlap: must be < 1\.\d+ mm"),
        ({"tip_shortening": -0.1}, "tip_shortening", ">= 0"),
        ({"tooth_thinning": -1e-6}, "tooth_thinning", ">= 0"),
        ({"tooth_thinning": 4e-3}, "tooth_thinning", "no tooth thickness.*must be < 3927 um"),  # pi m/2
        ({"module": 2.5e-6, "tooth_thinning": 4e-5}, "tooth_thinning", "must be < 3.927 um; .* a larger module"),
        # thinning alone would leave some: 4 tan(20 deg) x > 2 thinning/m - pi
        ({"tooth_thinning": 4e-5, "profile_shift": -3.0}, "profile_shift", r"must be > -2\.1358"),
        ({"addendum": 2.0}, "addendum", r"pointed.*must be < 1\.\d+"),
        ({"teeth": 8, "profile_shift": 0.9}, "addendum", "pointed"),
        ({"tip_shortening": 2.0}, "addendum", "below the start of the involute: must be > "),
        (SEVERED, "profile_shift", r"cuts the tooth through.* from 0\.999\d* on"),
        ({"tip_relief": TipRelief(-1e-6, 1e-3)}, "tip_relief.amount", ">= 0"),
        ({"tip_relief": TipRelief(1e-5, 0.0)}, "tip_relief.length", "> 0"),
        ({"tip_relief": TipRelief(1e-5, 1e-3, 0.5)}, "tip_relief.exponent", ">= 1"),
        ({"tip_relief": TipRelief(1e-5, 20e-3)}, "tip_relief.length", r"longer than the flank: must be <= \d"),
        ({"tip_relief": TipRelief(5e-4, 1e-3)}, "tip_relief.amount", "too steep: must be <= 0.2 mm"),
        (
            {"tip_relief": TipRelief(1e-6, 5e-5), "tip_round": 2e-4},
            "tip_relief.length",
            "inside the tip round: must be >",
        ),
    ],
)
def test_a_gear_that_cannot_be_made(form, field, says):
    with pytest.raises(InputError) as caught:
        gear(**form)
    assert caught.value.field == field
    assert re.search(says, str(caught.value))
    assert caught.value.cure


def test_too_large_a_bore_is_an_error_however_small_the_root():
    with pytest.raises(InputError, match="inside the root circle"):
        gear(8, dedendum=3.4, addendum=0.5, rack_tip_radius=0.0, profile_shift=-0.4)


@pytest.mark.parametrize(
    ("pinion", "wheel", "distance", "field", "says"),
    [
        ({}, {"teeth": 30, "module": 2e-3}, None, "wheel.module", "2 mm and 2.5 mm"),
        ({}, {"pressure_angle": math.radians(25.0)}, None, "wheel.pressure_angle", "25 deg and 20 deg"),
        ({}, {"teeth": 30}, 58e-3, "centre_distance", r"no working pressure angle.*> 58\.7\d* mm"),
        ({}, {"teeth": 30}, math.nan, "centre_distance", "finite"),
        ({}, {"teeth": 30}, 62.4e-3, "centre_distance", "jams.*must be >= 62.5 mm"),
        ({}, {"teeth": 30}, 65e-3, "centre_distance", r"contact ratio of 0.7278 < 1: must be <= 64\.\d+ mm"),
        ({"profile_shift": -0.8}, {"profile_shift": -0.8}, None, "pinion.profile_shift", "no working pressure angle"),
        ({"addendum": 1.3}, {"teeth": 30}, None, "pinion.addendum", "root circle.*be < 1.25"),
        ({"teeth": 30}, {"addendum": 1.3}, None, "wheel.addendum", "root circle.*be < 1.25"),
        ({"addendum": 0.5}, {"addendum": 0.5}, None, "pinion.addendum", "contact ratio of .* < 1: must be >= "),
        (
            {"addendum": 0.8, "tip_round": 1.3e-3},
            {"addendum": 0.8, "tip_round": 1.3e-3},
            None,
            "pinion.tip_round",
            "leaves a contact ratio of .* < 1",
        ),
        ({"teeth": 8}, {"teeth": 20}, None, "pinion.profile_shift", "undercut.*contact ratio 0.89.*>= 1.*0.58"),
        ({"teeth": 20}, {"teeth": 8}, None, "wheel.profile_shift", "undercut"),
        (
            {"teeth": 18, "dedendum": 1.3, "rack_tip_radius": 0.44},
            {"teeth": 150, "addendum": 1.2},
            None,
            "wheel.addendum",
            r"below the start of the pinion's involute.*must be < 1\.0",
        ),
    ],
)
def test_a_pair_that_cannot_run(pinion, wheel, distance, field, says):
    one, two = gear(**pinion), gear(**wheel)
    with pytest.raises(InputError) as caught:
        GearPair(one, two, distance)
    assert caught.value.field == field
    assert re.search(says, str(caught.value)), str(caught.value)
    assert caught.value.cure


def test_the_limits_that_errors_name_are_sharp():
    def refused(**form):
        with pytest.raises(InputError) as caught:
            gear(**form)
        return float(re.findall(r"(?:<|<=|>) ([\d.]+)", str(caught.value))[0])

    pointed = refused(addendum=2.0)
    assert gear(addendum=pointed - 1e-4).tip_thickness < 1e-6
    largest = refused(tip_round=2e-3)
    assert "tip" in [s.name for s in gear(tip_round=0.999e-3 * largest).profile.segments]
    refused(tip_round=1.001e-3 * largest)
    land = refused(rack_tip_radius=0.6)
    gear(rack_tip_radius=land)
    refused(rack_tip_radius=land + 5e-4)  # 1 um more is rounding
