"""Third octaves and A-weighting against the tables of the standards."""

from __future__ import annotations

import numpy as np
import pytest

from gearfe.base.octaves import a_weighting, edges, middle, nominal, number_of, third_octaves

#: IEC 61672-1:2013, table 3: A-weighting (dB) at the nominal frequencies, computed at the exact ones.
A_WEIGHTS = {
    "10": -70.4, "12.5": -63.4, "16": -56.7, "20": -50.5, "25": -44.7, "31.5": -39.4, "40": -34.6, "50": -30.2,
    "63": -26.2, "80": -22.5, "100": -19.1, "125": -16.1, "160": -13.4, "200": -10.9, "250": -8.6, "315": -6.6,
    "400": -4.8, "500": -3.2, "630": -1.9, "800": -0.8, "1000": 0.0, "1250": 0.6, "1600": 1.0, "2000": 1.2,
    "2500": 1.3, "3150": 1.2, "4000": 1.0, "5000": 0.5, "6300": -0.1, "8000": -1.1, "10000": -2.5, "12500": -4.3,
    "16000": -6.6, "20000": -9.3,
}  # fmt: skip
#: IEC 61260-1:2014, table E.1: exact mid-band frequencies (Hz, base ten, five digits).
MIDDLES = {
    "25": 25.119, "31.5": 31.623, "40": 39.811, "50": 50.119, "63": 63.096, "80": 79.433, "100": 100.00, "125": 125.89,
    "160": 158.49, "200": 199.53, "250": 251.19, "315": 316.23, "400": 398.11, "500": 501.19, "630": 630.96,
    "800": 794.33, "1000": 1000.0, "1250": 1258.9, "1600": 1584.9, "2000": 1995.3, "2500": 2511.9, "3150": 3162.3,
    "4000": 3981.1, "5000": 5011.9, "6300": 6309.6, "8000": 7943.3,
}  # fmt: skip


def numbers() -> dict[str, int]:
    return {nominal(x): x for x in range(-20, 14)}


def test_weights_are_those_of_the_table() -> None:
    found = numbers()
    assert found.keys() == A_WEIGHTS.keys()
    for name, weight in A_WEIGHTS.items():
        assert round(float(a_weighting(middle(found[name]))), 1) == pytest.approx(weight, abs=1e-9), name


def test_bands_are_those_of_the_table() -> None:
    found = numbers()
    for name, frequency in MIDDLES.items():
        assert float(middle(found[name])) == pytest.approx(frequency, rel=5e-5), name


def test_edges_touch_and_have_the_ratio_of_a_third_octave() -> None:
    """IEC 61260-1, 5.5: f_1 = G^(-1/6) f_m, f_2 = G^(1/6) f_m; 891.25 and 1122.0 Hz at 1 kHz."""
    x = np.arange(-18, 14)
    low, high = edges(x)
    np.testing.assert_allclose(low[1:], high[:-1], rtol=1e-12)
    np.testing.assert_allclose(high / low, 10.0**0.1, rtol=1e-12)
    assert [float(edge) for edge in edges(0)] == pytest.approx([891.25, 1122.0], rel=2e-5)
    np.testing.assert_array_equal(number_of(low), x)  # a lower edge belongs to its band
    np.testing.assert_array_equal(number_of(high * (1 - 1e-9)), x)


def test_power_is_kept_and_a_tone_is_in_one_band() -> None:
    random = np.random.default_rng(1)
    frequency, power = np.arange(0.0, 9000.0, 7.0), random.random(1286)
    made = third_octaves(frequency, power)
    assert made.power.sum() == pytest.approx(power[1:].sum(), rel=1e-12)
    assert made.lines.sum() == 1285
    assert made.weighted.sum() == pytest.approx((power[1:] * 10 ** (0.1 * a_weighting(frequency[1:]))).sum(), rel=1e-12)
    tone = third_octaves(np.array([0.0, 100.0, 1000.0]), np.array([5.0, 1e-6, 1e-3]))
    levels = dict(zip(tone.names, tone.columns()["radiated_power_level_dB"].tolist(), strict=True))
    assert (levels["1000"], levels["100"]) == pytest.approx((90.0, 60.0))
    weighted = dict(zip(tone.names, tone.columns()["radiated_power_level_dBA"].tolist(), strict=True))
    assert (weighted["1000"], weighted["100"]) == pytest.approx((90.0, 60.0 - 19.1), abs=0.06)


def test_no_lines_no_bands() -> None:
    assert len(third_octaves(np.zeros(1), np.ones(1)).number) == 0
