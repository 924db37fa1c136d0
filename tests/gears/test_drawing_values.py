"""Gears by what their drawings tell: tip and root diameters, span sizes."""

from __future__ import annotations

import math

import pytest

from gearfe.base.config import build
from gearfe.base.errors import InputError
from gearfe.base.tables.pair import PairTable
from gearfe.gears.geometry.derived import derived_geometry
from gearfe.gears.geometry.pair import Gear, GearPair

PAIR = {
    "module_mm": 3.0,
    "pressure_angle_deg": 20.0,
    "face_width_mm": 25.0,
    "centre_distance_mm": 128.2,
    "pinion": {"teeth": 24, "bore_diameter_mm": 35.0, "profile_shift": 0.35},
    "wheel": {"teeth": 61, "bore_diameter_mm": 50.0, "profile_shift": -0.18},
}


def made(**pinion: float) -> GearPair:
    table = build(PairTable, {**PAIR, "addendum": 1.1, "pinion": {**PAIR["pinion"], **pinion}}, "pair")
    return GearPair.from_table(table)


@pytest.mark.parametrize(
    ("teeth", "spanned", "size"), [(17, 2, 4.6663), (20, 3, 7.6604), (30, 4, 10.7526), (45, 6, 16.8670)]
)
def test_span_sizes_of_handbooks(teeth, spanned, size) -> None:
    """Module 1, 20 deg, no profile shift: the tables of W_k in handbooks, four decimals."""
    gear = Gear(teeth, 1e-3, math.radians(20.0), 10e-3, 4e-3)
    assert 1e3 * gear.span_size(spanned) == pytest.approx(size, abs=6e-5)


def test_the_span_touches_the_flanks_near_the_middle() -> None:
    for teeth, x in ((17, 0.0), (24, 0.35), (61, -0.18), (120, 0.5)):
        gear = Gear(teeth, 3e-3, math.radians(20.0), 10e-3, 10e-3, profile_shift=x)
        size = gear.span_size(gear.span_teeth)
        touched = math.hypot(gear.base_radius, 0.5 * size)  # plates are tangents of the base circle
        assert gear.form_radius < touched < gear.tip_radius


def test_drawing_values_are_the_gears() -> None:
    pair = made(tip_diameter_mm=79.9, root_diameter_mm=66.5, span_mm=23.6, span_teeth=3)
    assert 2e3 * pair.pinion.tip_radius == pytest.approx(79.9, abs=1e-12)
    assert 2e3 * pair.pinion.root_radius == pytest.approx(66.5, abs=1e-12)
    assert 1e3 * pair.pinion.span_size(3) == pytest.approx(23.6, abs=1e-12)
    assert derived_geometry(pair, (3, None))["pinion"]["span_mm"] == pytest.approx(23.6, abs=1e-12)
    assert pair.wheel.addendum == 1.1
    # thinner teeth by what the span lacks, seen along the base tangent
    whole = made()
    lacking = whole.pinion.span_size(3) - 23.6e-3
    assert pair.normal_backlash - whole.normal_backlash == pytest.approx(lacking, rel=1e-9)


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"tip_diameter_mm": 79.9, "addendum": 1.0}, "pair.pinion.tip_diameter_mm = 79.9: says what addendum = 1 says"),
        ({"span_mm": 23.6}, "pair.pinion.span_teeth: is required with the other one"),
        ({"span_mm": 30.0, "span_teeth": 3}, r"span_mm = 30.0: must be <= 23.\d+ mm, the span over 3 teeth"),
        (
            {"tip_diameter_mm": 95.0},
            r"pair.pinion.tip_diameter_mm = 95.0: the tooth is pointed below its tip circle: must be < 82.78\d+ mm",
        ),
        (
            {"root_diameter_mm": 75.0},
            r"pair.pinion.root_diameter_mm = 75.0: is too small: must be < 74.1 mm",
        ),
    ],
)
def test_mistakes_name_the_drawing_value(keys, told) -> None:
    with pytest.raises(InputError, match=told):
        made(**keys)
