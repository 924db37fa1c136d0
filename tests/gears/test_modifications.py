"""Modifications and pitch errors of flanks in closed form, and what is refused."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gearfe import InputError
from gearfe.gears.geometry import pitch_errors
from gearfe.gears.geometry.deviation import Deviation
from gearfe.gears.geometry.modifications import FlankModification, Relief, Waviness, tooth_deviations
from gearfe.gears.geometry.pair import Gear
from gearfe.gears.geometry.tolerances import rounded, tolerances
from tests.makers.gears import pair as gear_pair

PAIR = gear_pair(tip_round=1e-4)
PINION, WHEEL = PAIR.pinion, PAIR.wheel
LOW, HIGH = PINION.form_roll, PINION.profile.tip_roll


def profile(**made) -> Deviation:
    found = tooth_deviations(PINION, FlankModification(**made)).profiles[0]
    assert found is not None
    return found


# ---- modifications -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", ["linear", "parabolic", "arc"])
@pytest.mark.parametrize("tip", [True, False])
def test_reliefs(shape, tip) -> None:
    amount, length = 20e-6, 3e-3
    start, end, sign = (HIGH - length, HIGH, 1) if tip else (LOW + length, LOW, -1)
    made = profile(**{"tip_relief" if tip else "root_relief": Relief(amount, start, shape)})
    x = np.linspace(0, length, 50)
    radius = (length**2 + amount**2) / (2 * amount)  # the circle tangent at x = 0 through (length, amount)
    depth = {
        "linear": amount * x / length,
        "parabolic": amount * (x / length) ** 2,
        "arc": radius - np.sqrt(radius**2 - x**2),
    }[shape]
    assert -made.at(start + sign * x)[0] == pytest.approx(depth, abs=1e-13)
    assert abs(made.at(np.array(start - sign * 1e-3))[0]) < 1e-20
    assert -made.at(np.array(end))[0] == pytest.approx(amount)
    assert bool(set(made.kinks) & {start}) == (shape == "linear")


def test_crowning_and_slope() -> None:
    s = np.array([LOW, 0.5 * (LOW + HIGH), HIGH])
    assert profile(crowning=5e-6).at(s)[0] == pytest.approx([-5e-6, 0, -5e-6], abs=1e-18)
    assert profile(slope=4e-6).at(s)[0] == pytest.approx([-2e-6, 0, 2e-6], abs=1e-18)


def test_a_wave_goes_on_from_tooth_to_tooth() -> None:
    """On the path of contact s/r_b = angle + 2 pi k/z: every tooth has the phase n times the angle there."""
    wave = Waviness(2e-6, 11, 0.3)
    made = tooth_deviations(PINION, FlankModification(waviness=(wave,)))
    assert len(made.profiles) == 20
    angle = 0.37
    for tooth in range(20):
        turn = angle + 2 * math.pi * tooth / 20
        turn -= 2 * math.pi * round((turn - 0.4) / (2 * math.pi))  # the turn in which the tooth has that roll length
        s = PINION.base_radius * turn
        if LOW < s < HIGH:
            found = made.profiles[made.profile[tooth]]
            assert found.at(np.array(s))[0] == pytest.approx(2e-6 * math.sin(11 * angle + 0.3), abs=1e-11)
    assert len(tooth_deviations(PINION, FlankModification(waviness=(replace(wave, waves=40),))).profiles) == 1


@pytest.mark.parametrize(
    ("made", "told"),
    [
        (
            {"tip_relief": Relief(1e-5, HIGH - 6e-3), "root_relief": Relief(1e-5, LOW + 7e-3)},
            "overlaps the root relief",
        ),
        ({"tip_relief": Relief(1e-5, HIGH + 1e-3)}, "leaves the flank"),
        ({"root_relief": Relief(1e-5, LOW - 1e-3)}, "leaves the flank"),
        ({"tip_relief": Relief(-1e-6, HIGH - 1e-3)}, "must be >= 0"),
        ({"tip_relief": Relief(1e-6, HIGH - 1e-3, end=HIGH - 2e-3)}, "must be between"),
        ({"tip_relief": Relief(10e-6, HIGH - 4e-5, end=HIGH)}, "too steep"),
        ({"crowning": 2e-4}, "0.05 module"),
        ({"measured": (Deviation.straight([0, 1], [0, 0]),) * 3}, "each of the 20 teeth"),
    ],
)
def test_modifications_that_are_refused(made, told) -> None:
    with pytest.raises(InputError, match=told):
        tooth_deviations(PINION, FlankModification(**made))


# ---- pitch errors --------------------------------------------------------------------------------------------------


def test_tolerances_of_the_standard() -> None:
    """d = 50 mm, m = 2.5 mm in class 5 by hand; two classes double."""
    five, seven = (tolerances(PINION, c) for c in (5, 7))
    assert 1e6 * five.single == pytest.approx(0.05 + 1.0 + 5)
    assert 1e6 * five.cumulative == pytest.approx(0.1 + 0.55 * 50**0.5 + 1.75 + 12)
    assert 1e6 * five.slope == pytest.approx(5.05)
    assert 1e6 * five.form == pytest.approx(6.375)
    assert seven.cumulative == pytest.approx(2 * five.cumulative)
    assert five.total == pytest.approx(math.hypot(five.slope, five.form))


def test_tolerances_against_published_values() -> None:
    """d = 120 mm, m = 3 mm in class 6, as calculators of ISO 1328-1:2013 publish it: 8.94 and 28.80 um, rounded 9.0
    and 29 um, profile 12 um.
    """
    gear = Gear(40, 3e-3, math.radians(20), 30e-3, 20e-3)
    made = tolerances(gear, 6)
    assert 1e6 * made.single == pytest.approx(8.94, abs=0.005)
    assert 1e6 * made.cumulative == pytest.approx(28.80, abs=0.005)
    told = made.rounded_um
    assert (told["f_pT"], told["F_pT"], told["F_alphaT"]) == (9.0, 29.0, 12.0)


@pytest.mark.parametrize(
    ("value", "told"), [(10.4, 10), (10.5, 11), (9.74, 9.5), (9.75, 10), (5.0, 5.0), (4.96, 5.0), (4.94, 4.9)]
)
def test_rounding_of_tolerances(value, told) -> None:
    """5.2.3: to 1 um above 10, to 0.5 um from 5 on, to 0.1 um below."""
    assert rounded(value) == told


def test_gears_that_the_standard_does_not_have() -> None:
    with pytest.raises(InputError, match=r"module_mm = 0\.4.*0\.5 to 70"):
        tolerances(Gear(40, 0.4e-3, math.radians(20), 5e-3, 4e-3), 6)


def test_drawn_gears_are_as_bad_as_the_class_and_come_again() -> None:
    allowed = tolerances(PINION, 7)
    reached = []
    for seed in range(12):
        index = pitch_errors.sampled(PINION, 7, seed)
        assert (index == pitch_errors.sampled(PINION, 7, seed)).all()
        shares = np.ptp(index) / allowed.cumulative, np.abs(pitch_errors.single_of(index)).max() / allowed.single
        reached.append(max(shares))
    assert reached == pytest.approx([1.0] * 12)
    assert (pitch_errors.sampled(PINION, 7, 0) != pitch_errors.sampled(PINION, 7, 1)).all()


def test_single_pitch_deviations() -> None:
    index = np.array([0.0, 3e-6, -1e-6, 2e-6])
    assert pitch_errors.from_single(pitch_errors.single_of(index)) == pytest.approx(index, abs=1e-18)
    with pytest.raises(InputError, match="add up to 0"):
        pitch_errors.from_single([1e-6, 2e-6])
    with pytest.raises(InputError, match="each of the 20 teeth"):
        pitch_errors.turns(PINION, index)
