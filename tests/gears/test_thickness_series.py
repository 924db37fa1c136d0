"""DIN 3967: allowances of published reports and of the standard's own example, and what is refused."""

from __future__ import annotations

from itertools import pairwise

import pytest

from gearfe import InputError, rate
from gearfe.base.tables.rating import GearRatingTable, MeshRatingTable
from gearfe.gears.geometry.pair import GearPair
from gearfe.gears.geometry.thickness_series import SERIES, TABLE, TOLERANCES, thickness_allowances
from gearfe.gears.rating.report import measures
from tests.makers.rated import SPUR, fzg_c14


@pytest.mark.parametrize(
    ("diameter", "printed"),
    [
        (341.183, (-130.0, -190.0)),  # gears of the NREL 5 MW gearbox, series cd25, as a commercial program prints them
        (378.0, (-130.0, -190.0)),
        (756.0, (-175.0, -255.0)),
        (1350.517, (-240.0, -340.0)),
        (1953.0, (-320.0, -450.0)),
    ],
)
def test_series_cd25_of_a_published_report(diameter: float, printed: tuple[float, float]) -> None:
    assert thickness_allowances("cd25", diameter) == printed
    assert thickness_allowances("25cd", diameter) == printed


def test_the_example_of_the_standard() -> None:
    """Designation 27cd at 100 mm, DIN 3967, 3.1: -70 and -170 um."""
    assert thickness_allowances("27cd", 100.0) == (-70.0, -170.0)


def test_the_table_grows_with_diameter_and_series() -> None:
    rows = [([float(v) for v in one.split()], [float(v) for v in two.split()]) for one, two in TABLE.values()]
    for upper, tolerance in rows:
        assert len(upper) == len(SERIES)
        assert len(tolerance) == len(TOLERANCES)
        assert upper == sorted(upper, reverse=True)
        assert tolerance == sorted(tolerance)
    for (upper, tolerance), (more, wider) in pairwise(rows):
        assert all(a <= b for a, b in zip(upper, more, strict=True))
        assert all(a < b for a, b in zip(tolerance, wider, strict=True))


@pytest.mark.parametrize(
    ("series", "diameter"), [("cd31", 100.0), ("x25", 100.0), ("25", 100.0), ("", 1.0), ("cd25", 2e4)]
)
def test_series_that_there_are_not(series: str, diameter: float) -> None:
    with pytest.raises(InputError, match="thickness_series"):
        thickness_allowances(series, diameter)


def test_a_series_gives_the_limits_that_its_allowances_give() -> None:
    mesh = fzg_c14()
    pair = GearPair(mesh.pinion, mesh.wheel, 91.5e-3)
    by_series = {name: GearRatingTable(thickness_series="cd25") for name in ("pinion", "wheel")}
    by_number = {name: GearRatingTable(thickness_allowances_um=(-70.0, -110.0)) for name in ("pinion", "wheel")}
    one, two = (measures(pair, ("pinion", "wheel"), keys, MeshRatingTable()) for keys in (by_series, by_number))
    assert one == two
    assert "span_limits_mm" in one["pinion"]
    both = {"pinion": GearRatingTable(thickness_series="cd25", thickness_allowances_um=(0.0, 0.0))}
    with pytest.raises(InputError, match="together"):
        measures(pair, ("pinion", "wheel"), both | {"wheel": GearRatingTable()}, MeshRatingTable())
    assert rate(mesh, SPUR | {"thickness_series": "cd25", "gears": {}}).S_H
