"""Scuffing against the printed values of a published report, Blok's temperature of a line contact, and limits."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from gearfe import InputError
from gearfe.gears.geometry.mesh_geometry import MeshGeometry
from gearfe.gears.rating import scuffing as module
from gearfe.gears.rating.data import Oil, pair_data
from gearfe.gears.rating.rate import Rating, rate
from tests.makers.rated import (
    HELICAL,
    HELICAL_FLASH_PRINTED,
    HELICAL_OIL,
    HELICAL_SCUFFING,
    SPUR,
    SPUR_RING,
    helical_flash,
    helical_stage,
    spur_ring,
    spur_stage,
)

#: Oil of the spur stage: its report has 75 C.
SPUR_OIL = SPUR | HELICAL_OIL | {"oil_temperature_C": 75.0}


def check(rating: Rating, printed: dict[str, str]) -> None:
    """Compare with printed numbers, to half a unit of the last digit."""
    for name, text in printed.items():
        assert getattr(rating.scuffing, name) == pytest.approx(
            float(text), abs=0.501 * 10.0 ** -len(text.partition(".")[2])
        ), name


def test_integral_temperature_as_printed() -> None:
    """All values of the report, from the line load to the safety factor."""
    check(rate(helical_stage(), HELICAL | HELICAL_OIL), HELICAL_SCUFFING)


def test_flash_temperature_as_printed_with_the_friction_that_it_implies() -> None:
    """The product of both roughnesses instead of their mean: all printed temperatures follow.

    The formula of the standard gives 0.0465 for 0.041; docs/development/verification.md.
    """
    rating = rate(helical_stage(), helical_flash())
    printed = dict(HELICAL_FLASH_PRINTED)
    # B_M of three decimals leaves 0.003 K of 75 K open
    assert rating.scuffing is not None
    assert rating.scuffing.theta_B_C == pytest.approx(float(printed.pop("theta_B_C")), abs=0.005 + 0.003)
    check(rating, printed)


def test_flash_temperature_is_that_of_blok() -> None:
    """1.11 mu w |v1 - v2|/((B1 sqrt v1 + B2 sqrt v2) sqrt(2 b)) with Hertz' half width b, here of spur gears and rings.

    The specification rounds the constants of Blok and Hertz, 0.51 times 1.22 for 0.62134, and its angle factor, printed
    as 1.016, exceeds that of the force along the path by sqrt(cos(alpha_t)/cos(alpha_wt)).
    """
    for pair, table in ((spur_stage(), SPUR_OIL), (spur_ring(), SPUR_OIL | SPUR_RING)):
        rating = rate(pair, table | {"tip_relief_um": 500.0, "gears": {}})
        heat, data = rating.scuffing, rating.pair
        assert heat is not None
        inside = slice(1, -1)  # without load at both ends
        gamma, share = heat.path.gamma[inside], heat.path.share[inside]
        omega_1 = 2.0 * math.pi * rating.load.speed / 60.0
        T_1 = 0.5 * data.d_b[0] * math.tan(data.alpha_wt)
        R_1 = T_1 * (1.0 + gamma)
        R_2 = abs(data.u) * T_1 * (1.0 - gamma / data.u)
        v_1, v_2 = 1e-3 * omega_1 * R_1, 1e-3 * omega_1 / abs(data.u) * R_2
        rho = 1.0 / np.abs(1.0 / R_1 + np.sign(data.u) / R_2)
        w = share * heat.w_Bt_N_per_mm / math.cos(data.alpha_t)
        E_r = 206e3 / (1.0 - 0.3**2)
        half = np.sqrt(8.0 * w * rho / (math.pi * E_r))
        # B in N/(mm sqrt(m s) K), speeds in m/s, lengths in mm: w |v1 - v2|/(B sqrt(v)) is in N/m sqrt(m)
        flash = 1.11 * heat.mu_m * w * np.abs(v_1 - v_2)
        flash /= 13.78 * (np.sqrt(v_1) + np.sqrt(v_2)) * np.sqrt(2e-3 * half)
        flash *= math.sqrt(math.cos(data.alpha_t) / math.cos(data.alpha_wt))
        assert heat.path.flash[inside] == pytest.approx(flash, rel=2e-3, abs=1e-9)


@pytest.mark.parametrize("relief", [0.0, 0.3, 1.0, 2.0])
def test_two_pairs_carry_the_whole_load(relief: float) -> None:
    """A base pitch further is the place of the next pair: both shares add up to 1."""
    pair = pair_data(spur_stage())
    low, high = module.ends(pair)
    step = 2.0 * math.pi / (pair.z[0] * math.tan(pair.alpha_wt))
    places = np.linspace(low, high - step, 50)[1:-1]
    both = module.load_share(pair, places, relief, 6) + module.load_share(pair, places + step, relief, 6)
    assert both == pytest.approx(1.0)
    assert module.load_share(pair, low, relief, 6) == pytest.approx(max(0.0, 1.0 - relief) / 3.0)
    assert (high - low) / step == pytest.approx(pair.eps_alpha)


def test_the_driver_decides_on_which_side_contact_begins() -> None:
    """Gears that exchange driving have the factor of approach on the other side of the pitch point."""
    forward = rate(spur_stage(), SPUR_OIL).scuffing
    pair = spur_stage()
    table = SPUR_OIL | {"torque_driver_Nm": 2.0 * SPUR["torque_driver_Nm"] / 3.0, "speed_rpm": 0.5 * SPUR["speed_rpm"]}
    table["gears"] = {"wheel": {"mates": 3}, "pinion": {"alternating_factor": 0.7}}
    turned = rate(MeshGeometry(pair.wheel, pair.pinion, pair.centre_distance), table)
    backward = turned.scuffing
    assert forward is not None
    assert backward is not None
    assert turned.driver == 1
    left = forward.path.gamma < -0.01
    right = forward.path.gamma > 0.01
    assert (forward.path.flash[left] > backward.path.flash[left]).all()
    assert (forward.path.flash[right] < backward.path.flash[right]).all()


def test_a_path_beside_the_pitch_point_has_a_flash_temperature_alone() -> None:
    """Planet and ring of the report touch on one side of the pitch point; H_V is the mean of share times sliding."""
    rating = rate(spur_ring(), SPUR_OIL | SPUR_RING)
    heat, pair = rating.scuffing, rating.pair
    assert heat is not None
    assert heat.Gamma_A > 0.0
    assert heat.S_B > 1.0
    assert heat.S_intS is None
    one, two = rating.loss.eps
    x = np.linspace(-two, one, 200_001)
    share = np.where((x > one - 1.0) & (x < 1.0 - two), 1.0, 0.5)
    mean = np.mean(share * np.abs(x)) * (one + two)
    expected = 2.0 * math.pi * (pair.u + 1.0) / (pair.z[0] * pair.u) * mean
    factor = rating.loss.H_V
    assert factor == pytest.approx(expected, rel=1e-4)


def test_viscosity_meets_that_of_the_data_sheet() -> None:
    for temperature, nu in ((40.0, 220.0), (100.0, 19.0)):
        oil = Oil(temperature, 19.0, 890.0)
        density = 890.0 - 0.7 * (temperature - 16.0)
        assert module.viscosity(oil, 220.0) == pytest.approx(1e-3 * nu * density)


def test_factors_are_continuous() -> None:
    """X_eps where an addendum contact ratio is 1, K_Bgamma at total contact ratios of 2 and 3.5."""
    for two in (0.2, 0.7):
        assert module.contact_ratio_factor(1.0, two) == pytest.approx(module.contact_ratio_factor(1.0 - 1e-9, two))
        assert module.contact_ratio_factor(two, 1.0) == pytest.approx(module.contact_ratio_factor(two, 1.0 - 1e-9))
    assert module.helical_factor(2.0) == 1.0
    assert module.helical_factor(2.0 + 1e-12) == pytest.approx(1.0, abs=1e-5)
    assert module.helical_factor(3.5) == pytest.approx(module.helical_factor(3.5 - 1e-12), abs=1e-4)


def test_load_stages_follow_the_square() -> None:
    """Torques of ISO 14635-1 grow with the square of the stage, 3.7 N m, from the third on within 10 %."""
    for stage, torque in enumerate(module.STAGES[2:], 3):
        assert torque == pytest.approx(3.726 * stage**2, rel=0.1)


def test_without_an_oil_temperature_there_is_no_scuffing() -> None:
    rating = rate(helical_stage(), HELICAL)
    assert rating.scuffing is None
    assert rating.loss.P_V_W is None
    assert "scuffing" not in {entry.group for entry in rating.entries()}


@pytest.mark.parametrize(
    ("keys", "field"),
    [
        ({"oil_temperature_C": 90.0}, "viscosity_100_mm2_per_s"),
        ({"oil_temperature_C": 90.0, "viscosity_100_mm2_per_s": 220.0}, "viscosity_100_mm2_per_s"),
        (
            {"oil_temperature_C": -40.0, "viscosity_40_mm2_per_s": 1e5, "viscosity_100_mm2_per_s": 2.0},
            "oil_temperature_C",
        ),
        ({"scuffing_load_stage": 12}, "scuffing_load_stage"),
        ({"oil": "polyglycol"}, "oil"),
        ({"oil_temperature_C": 90.0, "viscosity_100_mm2_per_s": 19.0, "oil": "water"}, "oil"),
        (
            {"oil_temperature_C": 90.0, "viscosity_100_mm2_per_s": 19.0, "scuffing_load_stage": 15},
            "scuffing_load_stage",
        ),
    ],
)
def test_tables_that_are_refused(keys: dict[str, Any], field: str) -> None:
    with pytest.raises(InputError) as caught:
        rate(helical_stage(), HELICAL | keys)
    assert caught.value.field == f"rating.{field}"


def test_a_gear_without_relief_does_not_take_that_of_its_mate() -> None:
    """Relief of one gear is that with 0 written for the other; the approach factor takes that of the driven gear."""

    def heat(**reliefs: float) -> module.Scuffing:
        gears = {name: {"tip_relief_um": value} for name, value in reliefs.items()}
        rating = rate(spur_stage(), SPUR_OIL | {"gears": gears})
        assert rating.driver == 0
        assert rating.scuffing is not None
        return rating.scuffing

    none, driven, driver = heat(pinion=0.0, wheel=0.0), heat(wheel=20.0), heat(pinion=20.0)
    assert driver.S_B == heat(pinion=20.0, wheel=0.0).S_B == none.S_B
    assert driven.S_B == heat(pinion=0.0, wheel=20.0).S_B
    entering = none.path.gamma < -0.01
    approach = np.abs(none.path.gamma[entering]) ** 3 / 50.0
    ratio = (1.0 + (none.C_eff_um - 20.0) * approach) / (1.0 + none.C_eff_um * approach)
    loaded = none.path.share[entering] > 1e-6
    assert (driven.path.flash / none.path.flash)[entering][loaded] == pytest.approx(ratio[loaded])
    assert driven.path.share == pytest.approx(none.path.share)


def test_flanks_that_friction_does_not_heat_are_infinitely_safe() -> None:
    """A torque whose flash temperature is lost in rounding against that of the oil."""
    heat = rate(spur_stage(), SPUR_OIL | {"torque_driver_Nm": 1e-300}).scuffing
    assert heat is not None
    assert math.isinf(heat.S_B)
