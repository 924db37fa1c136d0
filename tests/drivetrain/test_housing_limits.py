"""Frequencies and materials of housings that no run could finish, or no estimate covers, are refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gearfe.base.config import build
from gearfe.base.errors import InputError
from gearfe.base.tables.housing import HousingTable
from gearfe.drivetrain.housing.model import Housing
from gearfe.fem.plane import Material
from gearfe.fem.reduction.lanczos import lowest_modes
from tests.makers.housing_meshes import box


def block(material: Material) -> Housing:
    """A block of 0.6 x 0.1 x 0.1 m, free."""
    return Housing.from_arrays(*box((6, 1, 1), (0.6, 0.1, 0.1)), material=material)


def test_a_frequency_above_all_modes_of_the_mesh_is_refused() -> None:
    with pytest.raises(InputError, match=r"modes_below_Hz = 1e\+09|modes_below_Hz = 1000000000") as caught:
        block(Material()).reduce(below_hz=1e9)
    assert "3.13e+03 m/s" in str(caught.value)  # sqrt(mu/rho) of steel


def test_a_wrong_unit_of_the_density_is_named_by_the_speed_of_its_waves() -> None:
    """Kilograms taken for tonnes, and more: frequencies fall, and thousands of modes lie below the limit."""
    with pytest.raises(InputError, match=r"shear waves of 3.13 m/s.*check modulus, density"):
        block(Material(density=7.85e9)).reduce(below_hz=10e3)


def test_a_usual_frequency_is_no_trouble() -> None:
    assert block(Material()).reduce(below_hz=10e3, least_modes=4, estimate=False).modes >= 4


def test_thin_bodies_are_stopped_by_the_count() -> None:
    """A diagonal pair with eigenvalues 1, 2, ..., of which 300 lie below the limit."""
    values = np.arange(1.0, 1001.0)
    from scipy import sparse

    mass = sparse.eye_array(1000, format="csr")
    with pytest.raises(InputError, match="more than 50 modes lie below it"):
        lowest_modes(lambda b: b / values[:, None], mass, limit=300.5, at_most=50)
    assert len(lowest_modes(lambda b: b / values[:, None], mass, limit=40.5, at_most=50).eigenvalues) == 40


@pytest.mark.parametrize(
    ("keys", "field", "words"),
    [
        ({"density_kg_per_m3": 7.85}, "density_kg_per_m3", "waves of 1.6e\\+05 m/s"),  # g/cm3
        ({"density_kg_per_m3": 7.85e-9}, "density_kg_per_m3", "another unit"),  # t/mm3
        ({"youngs_modulus_GPa": 2e-6}, "density_kg_per_m3", "youngs_modulus_GPa = 2e-06 give waves of 0.505 m/s"),
        ({"poisson_ratio": 0.4999}, "poisson_ratio", "-0.99 to 0.49.*give 0.49"),
        ({"poisson_ratio": -0.999}, "poisson_ratio", "-0.99 to 0.49"),
    ],
)
def test_materials_that_cannot_be_are_refused(keys: dict[str, Any], field: str, words: str) -> None:
    with pytest.raises(InputError, match=rf"material\.{field} = .*{words}"):
        build(HousingTable, {"material": keys}, "housing")


def test_the_same_from_python() -> None:
    with pytest.raises(InputError, match=r"poisson_ratio = 0.495: must be -0.99 to 0.49"):
        block(Material(poisson_ratio=0.495))
