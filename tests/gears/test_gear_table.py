"""The [pair] table of a job file: the shipped pair, shared and own keys, and errors in the file's own words."""

from __future__ import annotations

import dataclasses
import math
import re
import tomllib

import pytest

from gearfe.base.config import build
from gearfe.base.errors import InputError
from gearfe.base.tables.gearbox import pair_gearbox
from gearfe.base.tables.jobs import load_job, table_class
from gearfe.gears.geometry.pair import GearPair, TipRelief
from tests.places import GEOMETRY

SHIPPED = GEOMETRY / "gear_train.toml"

MINIMAL = """
module_mm = 2.5
pressure_angle_deg = 20
face_width_mm = 10
[pinion]
teeth = 20
bore_diameter_mm = 10
[wheel]
teeth = 30
bore_diameter_mm = 15
"""


def pair(text):
    return GearPair.from_table(build(table_class("pair"), tomllib.loads(text), "pair"))


def test_the_shipped_pair():
    table = load_job(SHIPPED, ("pair",))["pair"]
    made = GearPair.from_table(table)
    one, two = made.pinion, made.wheel
    assert (one.teeth, two.teeth) == (20, 30)
    assert [one.pitch_diameter, two.pitch_diameter] == pytest.approx([50e-3, 75e-3])
    assert [one.bore_diameter, two.bore_diameter] == pytest.approx([10e-3, 15e-3])
    assert made.working_centre_distance == pytest.approx(62.5e-3)
    assert math.degrees(made.working_pressure_angle) == pytest.approx(25.0)
    for gear in (one, two):
        form = (gear.face_width, gear.addendum, gear.dedendum, gear.rack_tip_radius, gear.tip_round)
        assert form == pytest.approx((10e-3, 1.0, 1.25, 0.3, 0.1e-3))
    steel = pair_gearbox(table).gears["pinion"].material
    assert steel == pair_gearbox(table).gears["wheel"].material
    assert (steel.youngs_modulus_GPa, steel.poisson_ratio, steel.density_kg_per_m3) == (200.0, 0.3, 7850.0)


def test_the_shipped_file_says_what_is_not_published():
    """The model it follows gives no addendum, dedendum, rack tip radius, tip round and bore."""
    unpublished = re.findall(r"^(\w+) = .*\(not published\)", SHIPPED.read_text(), flags=re.MULTILINE)
    assert set(unpublished) == {"addendum", "dedendum", "rack_tip_radius", "tip_round_mm", "bore_diameter_mm"}


def test_own_keys_win_over_shared_ones():
    made = pair("""
        module_mm = 2
        pressure_angle_deg = 20
        face_width_mm = 12
        centre_distance_mm = 51.0
        tip_relief_amount_um = 10
        tip_relief_length_mm = 0.8
        tooth_thinning_um = 5
        [pinion]
        teeth = 20
        bore_diameter_mm = 8
        pitch_diameter_mm = 40
        profile_shift = 0.2
        tip_relief_exponent = 2
        [wheel]
        teeth = 30
        bore_diameter_mm = 12
        face_width_mm = 10
        rack_tip_radius = 0.2
        dedendum = 1.3
        addendum = 0.9
        tip_shortening = 0.05
        tip_round_mm = 0.05
        tip_relief_amount_um = 0
        [wheel.material]
        youngs_modulus_GPa = 70
        """)
    one, two = made.pinion, made.wheel
    assert made.centre_distance == pytest.approx(51e-3)
    assert (one.module, two.module) == pytest.approx((2e-3, 2e-3))
    assert (one.face_width, two.face_width) == pytest.approx((12e-3, 10e-3))
    assert one.tip_relief == TipRelief(pytest.approx(10e-6), pytest.approx(0.8e-3), 2.0)
    assert two.tip_relief is None
    assert (one.profile_shift, two.profile_shift) == (0.2, 0.0)
    assert (one.tooth_thinning, two.tooth_thinning) == pytest.approx((5e-6, 5e-6))
    wheel_form = (two.rack_tip_radius, two.dedendum, two.addendum, two.tip_shortening, two.tip_round)
    assert wheel_form == pytest.approx((0.2, 1.3, 0.9, 0.05, 0.05e-3))


def test_materials_may_differ():
    table = build(table_class("pair"), tomllib.loads(MINIMAL + "[wheel.material]\nyoungs_modulus_GPa = 70\n"), "pair")
    gears = pair_gearbox(table).gears
    assert gears["pinion"].material.youngs_modulus_GPa == 200.0
    assert gears["wheel"].material.youngs_modulus_GPa == 70.0


def test_every_key_of_the_table_is_documented():
    for name in ("pair",):
        cls = table_class(name)
        for field in dataclasses.fields(cls):
            assert field.metadata["doc"]


@pytest.mark.parametrize(
    ("old", "new", "field", "says"),
    [
        ("teeth = 20", "teeth = 7", "pair.pinion.teeth", ">= 8"),
        ("teeth = 20", "teeth = 20.0", "pair.pinion.teeth", "whole number"),
        ("teeth = 20", 'teeth = "20"', "pair.pinion.teeth", "number"),
        ("teeth = 20", "tooth = 20", "pair.pinion", "'tooth'.*did you mean 'teeth'"),
        ("bore_diameter_mm = 10", "", "pair.pinion.bore_diameter_mm", "is required.*stiffness"),
        ("bore_diameter_mm = 15", "bore_diameter_mm = -1", "pair.wheel.bore_diameter_mm", "> 0"),
        (
            "bore_diameter_mm = 15",
            "bore_diameter_mm = 70",
            "pair.wheel.bore_diameter_mm",
            "= 70.0.*<= 67.5 mm.*68.75 mm",
        ),
        ("module_mm = 2.5", "", "pair.pinion.module_mm", "is required"),
        ("module_mm = 2.5", "module_mm = nan", "pair.module_mm", "finite"),
        ("teeth = 30", "teeth = 30\nmodule_mm = 2", "pair.wheel.module_mm", "= 2.0.*2 mm and 2.5 mm"),
        ("teeth = 30", "teeth = 30\npitch_diameter_mm = 70", "pair.wheel.pitch_diameter_mm", "contradicts module_mm"),
        ("pressure_angle_deg = 20", "", "pair.pressure_angle_deg", "is required"),
        ("pressure_angle_deg = 20", "pressure_angle_deg = 60", "pair.pressure_angle_deg", "<= 45"),
        ("pressure_angle_deg = 20", "pressure_angle_deg = 30", "pair.pinion.rack_tip_radius", "= 0.3.*<= 0.1103"),
        ("face_width_mm = 10", "", "pair.face_width_mm", "is required"),
        ("module_mm = 2.5", "module_mm = 2.5\naddendum = 2.0", "pair.addendum", "pointed"),
        ("module_mm = 2.5", "module_mm = 2.5\ntip_round_mm = 2.0", "pair.tip_round_mm", "= 2.0.*must be < "),
        ("teeth = 20", "teeth = 20\ntip_relief_amount_um = 20", "pair.pinion.tip_relief_length_mm", "is required"),
        (
            "teeth = 20",
            "teeth = 20\ntip_relief_amount_um = 900\ntip_relief_length_mm = 1",
            "pair.pinion.tip_relief_amount_um",
            "= 900.0.*too steep",
        ),
        ("module_mm = 2.5", "module_mm = 2.5\ncentre_distance_mm = 60", "pair.centre_distance_mm", "= 60.0: jams"),
        ("module_mm = 2.5", "module_mm = 2.5\ncentre_distance_mm = 0", "pair.centre_distance_mm", "> 0"),
        ("teeth = 20", "teeth = 8", "pair.pinion.profile_shift", "undercut"),
        ("module_mm = 2.5", "module_mm = 2.5\nmaterial = 3", "pair.material", "table"),
        (
            "module_mm = 2.5",
            "module_mm = 2.5\nmaterial = {poisson_ratio = 0.5}",
            "pair.material.poisson_ratio",
            "< 0.5",
        ),
    ],
)
def test_errors_speak_of_the_file(old, new, field, says):
    assert old in MINIMAL
    assert pair(MINIMAL).pinion.teeth == 20
    with pytest.raises(InputError) as caught:
        pair(MINIMAL.replace(old, new, 1))
    assert caught.value.field == field, str(caught.value)
    assert re.search(says, str(caught.value)), str(caught.value)
    assert caught.value.cure
