"""Names of sidebands: each states the sum of mesh and carrier orders that its line has."""

from __future__ import annotations

import itertools
import re
from fractions import Fraction
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gearfe.drivetrain.gearbox.stage_report import stage_entries
from gearfe.drivetrain.runup.orders import orders
from tests.drivetrain.test_planetary_roles import built, roles, tables

#: Frequencies over that of the drive: two meshes whose difference is slower than the carrier.
MESHES, CARRIER, PLANETS = (11.3, 10.9), 0.73, 3
TERM = re.compile(r"(^|[+-]) ?(\d+) x (mesh \d+|carrier \w+)")


def two_meshes(carrier: float) -> Any:
    """A run of two meshes of phases of their own and a carrier."""
    system = SimpleNamespace(turns=(1 / MESHES[0], 1 / MESHES[1], 1 / carrier), orders=((1, 0, 0), (0, 1, 0)))
    return SimpleNamespace(train=SimpleNamespace(system=system, passes={2: ("carrier arm", PLANETS)}))


def terms(name: str) -> dict[str, int]:
    """Signed multiples in a name."""
    return {what: int(times) * (-1 if sign == "-" else 1) for sign, times, what in TERM.findall(name)}


@pytest.mark.parametrize("carrier", [CARRIER, 31.7])
def test_a_name_is_the_sum_that_its_line_is(carrier: float) -> None:
    """Lines of a negative order are those of the positive one with the signs of all terms changed."""
    frequency = {"mesh 1": MESHES[0], "mesh 2": MESHES[1], "carrier arm": carrier}
    place = {"mesh 1": 0, "mesh 2": 1, "carrier arm": 2}
    cuts = orders(two_meshes(carrier), 2)
    for cut in cuts:
        assert cut.order > 0.0
        for name in cut.names:
            found = terms(name)
            assert cut.order == pytest.approx(sum(k * frequency[what] for what, k in found.items()), rel=1e-12)
            assert {place[what]: k for what, k in found.items()} == {i: k for i, k in enumerate(cut.waves) if k}
            assert not name.startswith("-")


@pytest.mark.parametrize("carrier", [CARRIER, 31.7])
def test_each_sum_of_meshes_and_passes_has_one_name(carrier: float) -> None:
    """Two multiples of meshes in all, and up to as many rotations of the carrier as it has planets, of either sign."""
    cuts = [cut.waves for cut in orders(two_meshes(carrier), 2)]
    sums = {
        k for k in itertools.product(range(-2, 3), range(-2, 3), range(-PLANETS, PLANETS + 1))
        if abs(k[0]) + abs(k[1]) + abs(k[2]) > 0 and abs(k[0]) + abs(k[1]) <= 2
    }  # fmt: skip
    rate = np.array([*MESHES, carrier])
    assert len(cuts) == len(set(cuts))
    assert set(cuts) == {k for k in sums if np.array(k) @ rate > 0.0}


def test_a_carrier_that_is_faster_than_its_meshes_stands_first() -> None:
    """18/12/42, carrier driven, ring at 101/100 of its speed: 42 (101/100 - 1) = 0.42 mesh cycles per turn."""
    raw = roles(tables(), "arm", "sun", -100.0, ring=Fraction(101, 100))
    model = built(raw)
    entry = stage_entries(model)["planetary"]["orders"][0]
    assert entry["order"] == pytest.approx(0.42)
    named = {"1 x carrier arm - 1 x mesh sun-planet_1": 0.58, "1 x mesh sun-planet_1 + 1 x carrier arm": 1.42}
    assert entry["sidebands"] == pytest.approx(named)
