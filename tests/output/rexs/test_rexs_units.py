"""Units of REXS: converted exactly, rounded once, and back without a change."""

from __future__ import annotations

import math
import random
from decimal import Decimal

import pytest

from gearfe.output.exchange.rexs.schema import schema
from gearfe.output.exchange.rexs.units import UNITS, converted, written


@pytest.mark.parametrize(
    ("text", "unit", "target", "value"),
    [
        ("0.015", "mm", "um", 15.0),
        ("15", "mum", "mm", 0.015),
        ("206000", "N / mm^2", "GPa", 206.0),
        ("206000", "MPa", "GPa", 206.0),
        ("7.85", "kg / dm^3", "kg / m^3", 7850.0),
        ("11.4", "kN", "N", 11400.0),
        ("1e7", "N mm / rad", "N m / rad", 1e4),
        ("180", "°", "rad", math.pi),
        ("1500", "1 / min", "rad / s", 50.0 * math.pi),
        ("12", "none", "none", 12.0),
    ],
)
def test_known_values(text, unit, target, value):
    assert converted(Decimal(text), unit, target) == value


def test_every_float_survives_a_write_and_a_read():
    """Also where the ratio of units has pi, and where it is no power of two."""
    draw = random.Random(4)
    pairs = [
        ("rad / s", "1 / min"),
        ("um", "mm"),
        ("GPa", "MPa"),
        ("kg / m^3", "kg / dm^3"),
        ("deg", "deg"),
        ("rad", "deg"),
    ]
    for unit, target in pairs:
        for _ in range(500):
            number = draw.choice((-1.0, 1.0)) * draw.uniform(1.0, 10.0) * 10.0 ** draw.randint(-8, 8)
            text = written(number, unit, target)
            assert converted(Decimal(text), target, unit) == number, (number, unit, target)
            float(text)
    assert written(2.0, "mm", "mm") == "2.0"
    assert written(157.07963267948966, "rad / s", "1 / min") == "1500.0"


def test_units_of_the_attributes_that_are_used_are_known():
    """Units without a size here are those of results: wear, heat, electricity."""
    unknown = {item.unit for item in schema().attributes.values() if item.unit not in UNITS}
    assert not unknown & {"mm", "mum", "deg", "N m", "N / m", "1 / min", "MPa", "kN", "kg", "kg m^2", "kW"}


def test_the_table_has_what_the_schema_of_2_0_0_has():
    """Counted in the schema file of the REXS API: 96 components, 1824 attributes, 3759 mappings, 13 relations."""
    table = schema()
    assert len(table.components) == 96
    assert len(table.attributes) == 1824
    assert sum(len(names) for names in table.components.values()) == 3759
    assert len(table.relations) == 13
    assert sum(len(item) for item in table.relations.values()) == 276
    assert table.ordered == {"ordered_assembly", "manufacturing_step"}
    assert table.attribute("cylindrical_gear", "helix_angle_reference_diameter").unit == "deg"
    assert table.current("rack_shaped_tool", "tip_radius_factor") == "tip_corner_radius_factor_reference_profile"
