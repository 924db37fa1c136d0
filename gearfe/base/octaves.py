r"""Third octaves and A-weighting of spectra: IEC 61260-1:2014 and IEC 61672-1:2013.

Bands have the exact mid-band frequencies :math:`f_m = 1000\,\mathrm{Hz}\cdot G^{x/3}`, :math:`G = 10^{3/10}`, and the
edges :math:`f_m G^{\pm 1/6}` (IEC 61260-1, 5.2 to 5.5, base ten). They are named by the nominal frequencies of its
annex E.
The A-weighting is the rational function of IEC 61672-1, annex E, (E.6):

.. math:: A(f) = 20 \lg \frac{f_4^2 f^4}{(f^2 + f_1^2)\sqrt{(f^2 + f_2^2)(f^2 + f_3^2)}\,(f^2 + f_4^2)} - A_{1000} .

Each line of a spectrum is weighted at its own frequency and belongs completely to the band that holds it. The sum over
the bands is therefore that over the lines. Where the resolution is wider than a band, some bands hold no line.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .typing import Array, IntArray

#: Octave ratio G, and reference frequency (Hz): IEC 61260-1, 3.2 and 3.3.
RATIO, REFERENCE_HZ = 10.0**0.3, 1000.0
#: Digits of the nominal frequencies in a decade from 10 Hz: IEC 61260-1, table E.1.
NOMINAL = (1.0, 1.25, 1.6, 2.0, 2.5, 3.15, 4.0, 5.0, 6.3, 8.0)


def _poles() -> tuple[float, float, float, float]:
    """Frequencies f_1 to f_4 of the A-weighting (Hz), from f_r, f_L, f_H and f_A as of IEC 61672-1, annex E."""
    reference, low, high, a = 1000.0, 10.0**1.5, 10.0**3.9, 10.0**2.45
    drop = math.sqrt(0.5)
    b = (reference**2 + low**2 * high**2 / reference**2 - drop * (low**2 + high**2)) / (1.0 - drop)
    c = low**2 * high**2
    root = math.sqrt(b * b - 4.0 * c)
    first, fourth = math.sqrt(0.5 * (-b - root)), math.sqrt(0.5 * (-b + root))
    second, third = (0.5 * (3.0 - math.sqrt(5.0)) * a, 0.5 * (3.0 + math.sqrt(5.0)) * a)
    return first, second, third, fourth


F1, F2, F3, F4 = _poles()


def _response(frequency: Array) -> Array:
    square = frequency**2
    with np.errstate(divide="ignore"):
        shares = (
            F4**2 * square**2 / ((square + F1**2) * np.sqrt((square + F2**2) * (square + F3**2)) * (square + F4**2))
        )
        return np.asarray(20.0 * np.log10(shares))


def a_weighting(frequency: ArrayLike) -> Array:
    """A-weighting (dB) at frequencies (Hz), 0 at 1000 Hz; minus infinity at 0 Hz."""
    return np.asarray(_response(np.asarray(frequency, dtype=float)) - _response(np.array(REFERENCE_HZ)))


def middle(number: ArrayLike) -> Array:
    """Exact mid-band frequencies (Hz) of the third octaves x, 0 at 1000 Hz."""
    return np.asarray(REFERENCE_HZ * RATIO ** (np.asarray(number, dtype=float) / 3.0))


def edges(number: ArrayLike) -> tuple[Array, Array]:
    """Lower and upper band edges (Hz) of the third octaves x."""
    centre = middle(number)
    return centre * RATIO ** (-1.0 / 6.0), centre * RATIO ** (1.0 / 6.0)


def nominal(number: int) -> str:
    """Nominal frequency of a third octave as texts have it: 31.5, 1000, 1250."""
    decade, place = divmod(number, 10)
    return f"{NOMINAL[place] * 10.0 ** (3 + decade):.6g}"


def number_of(frequency: Array) -> IntArray:
    """Number x of the third octave that holds each frequency (Hz > 0); a lower edge belongs to its band."""
    return np.floor(3.0 * np.log(frequency / REFERENCE_HZ) / math.log(RATIO) + 0.5 + 1e-12).astype(np.int64)


@dataclass(frozen=True)
class ThirdOctaves:
    """Powers in third octaves.

    Attributes
    ----------
    number
        Numbers x of the bands, rising without gaps, shape (n,).
    power, weighted
        Sum of the lines of each band (W), and of the A-weighted ones.
    lines
        Lines in each band.
    """

    number: IntArray
    power: Array
    weighted: Array
    lines: IntArray

    @property
    def names(self) -> list[str]:
        """Nominal frequencies (Hz)."""
        return [nominal(int(x)) for x in self.number]

    def columns(self, reference: float = 1e-12) -> dict[str, Array]:
        """Columns of a table; levels re `reference` (W), minus infinity as NaN."""
        low, high = edges(self.number)
        return {
            "nominal_frequency_Hz": np.array([float(name) for name in self.names]),
            "middle_frequency_Hz": middle(self.number),
            "lower_edge_Hz": low,
            "upper_edge_Hz": high,
            "lines": self.lines,
            "radiated_power_level_dB": decibels(self.power, reference),
            "radiated_power_level_dBA": decibels(self.weighted, reference),
        }


def decibels(power: ArrayLike, reference: float = 1e-12) -> Array:
    """Levels (dB) of powers; NaN of none."""
    values = np.asarray(power, dtype=float)
    return np.asarray(10.0 * np.log10(np.where(values > 0.0, values, np.nan) / reference))


def third_octaves(frequency: Array, power: Array) -> ThirdOctaves:
    """Sum the powers (W) of lines (Hz) in third octaves. The constant and lines that are not finite are left out."""
    inside = (frequency > 0.0) & np.isfinite(power)
    places, values = frequency[inside], power[inside]
    if not len(places):
        empty = np.zeros(0)
        return ThirdOctaves(empty.astype(np.int64), empty, empty, empty.astype(np.int64))
    bands = number_of(places)
    first, count = int(bands.min()), int(bands.max() - bands.min()) + 1
    louder = values * 10.0 ** (0.1 * a_weighting(places))
    return ThirdOctaves(
        first + np.arange(count),
        np.bincount(bands - first, values, count),
        np.bincount(bands - first, louder, count),
        np.bincount(bands - first, minlength=count),
    )
