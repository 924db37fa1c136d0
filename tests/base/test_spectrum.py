"""Spectra of signals whose spectrum is known exactly."""

import math

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.base.spectrum import (
    WINDOWS,
    OrderLine,
    amplitude_spectrum,
    nearest_line,
    order_lines,
    peaks,
    uniform_step,
    waterfall,
    window_values,
)

STEP = 35e-6


def tone(n, *parts, constant=0.0):
    """Samples of a constant and of parts (bin, amplitude, phase) that fit n samples a whole number of times."""
    k = np.arange(n)
    return constant + sum(a * np.cos(2 * math.pi * b * k / n + p) for b, a, p in parts)


@pytest.mark.parametrize("n", [200, 201])
@pytest.mark.parametrize("window", list(WINDOWS))
def test_amplitudes_are_exact(n, window):
    """Harris 1978: lines farther apart than the window's main lobe do not touch."""
    spectrum = amplitude_spectrum(tone(n, (14, 9.7, 0.3), (40, 0.25, -2.0), constant=-3.5), STEP, window=window)
    assert spectrum.frequency[14] == pytest.approx(14 / (n * STEP), rel=1e-14)
    assert spectrum.amplitude[[0, 14, 40]] == pytest.approx([3.5, 9.7, 0.25], abs=1e-12)
    assert np.angle(spectrum.value[[14, 40]]) == pytest.approx([0.3, -2.0], abs=1e-12)
    far = [k for k in range(n // 2 + 1) if min(k, abs(k - 14), abs(k - 40)) > 5]
    assert np.abs(spectrum.amplitude[far]).max() < 1e-13


def test_constant_and_nyquist_are_not_doubled():
    alternating = 2.5 * (-1.0) ** np.arange(200)
    spectrum = amplitude_spectrum(7.0 + alternating, STEP)
    assert spectrum.frequency[-1] == pytest.approx(0.5 / STEP, rel=1e-14)
    assert spectrum.nyquist == pytest.approx(0.5 / STEP, rel=1e-14)
    assert spectrum.amplitude[[0, -1]] == pytest.approx([7.0, 2.5], rel=1e-14)
    assert spectrum.amplitude[1:-1].max() < 1e-13
    # an odd number of samples has no Nyquist line: its last line is a sine like all others
    assert amplitude_spectrum(tone(201, (100, 2.5, 0.1)), STEP).amplitude[-1] == pytest.approx(2.5, rel=1e-12)


def test_the_shipped_record():
    """7 ms in steps of 35 us, the start not counted twice: 142.9 Hz between the lines."""
    spectrum = amplitude_spectrum(np.zeros(200), STEP)
    assert spectrum.resolution == pytest.approx(1 / 7e-3, rel=1e-14)
    assert len(spectrum.frequency) == 101


def test_several_signals_at_once():
    a, b = tone(64, (5, 1.0, 0.0)), tone(64, (9, 2.0, 1.0))
    both = amplitude_spectrum(np.column_stack([a, b]), 1e-3, window="hann")
    assert both.value.shape == (33, 2)
    for column, signal in enumerate((a, b)):
        alone = amplitude_spectrum(signal, 1e-3, window="hann")
        assert both.value[:, column] == pytest.approx(alone.value, abs=1e-15)


def test_windows():
    """Noise bandwidths of Harris 1978, Table I: Hann 1.50, Hamming 1.36, Blackman 1.73 bins."""
    zeros = np.zeros(4096)
    for name, bins in (("none", 1.0), ("hann", 1.5), ("hamming", 1.36), ("blackman", 1.73)):
        assert amplitude_spectrum(zeros, 1.0, window=name).noise_bandwidth == pytest.approx(bins, abs=0.005)
    assert window_values("hann", 4) == pytest.approx([0.0, 0.5, 1.0, 0.5])
    # flat top: a line half-way between two bins loses less than 0.02 dB
    between = np.cos(2 * math.pi * 20.5 * np.arange(256) / 256)
    top = amplitude_spectrum(between, 1.0, window="flattop").amplitude.max()
    assert abs(20 * math.log10(top)) < 0.02


def band_rms(spectrum, low=0.0, high=math.inf):
    """Root mean square of the part between two frequencies (Hz), by Parseval's theorem."""
    inside = (spectrum.frequency >= low) & (spectrum.frequency <= high)
    square = np.tensordot(np.where(inside, spectrum.weight, 0.0), spectrum.amplitude**2, axes=1)
    return np.sqrt(square / spectrum.noise_bandwidth)


@pytest.mark.parametrize("window", list(WINDOWS))
def test_band_rms_of_a_line(window):
    n = 400
    spectrum = amplitude_spectrum(tone(n, (60, 3.0, 0.7), (150, 4.0, 0.0), constant=1.0), 1e-3, window=window)
    around = spectrum.resolution * np.array([50, 70])
    assert band_rms(spectrum, *around) == pytest.approx(3 / math.sqrt(2), rel=1e-12)
    assert band_rms(spectrum, 0.0, 0.0) * math.sqrt(spectrum.noise_bandwidth) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("n", [500, 501])
def test_parseval(n):
    noise = np.random.default_rng(3).standard_normal((n, 3))
    rms = band_rms(amplitude_spectrum(noise, 1e-3))
    assert rms == pytest.approx(np.sqrt((noise**2).mean(axis=0)), rel=1e-13)


def test_peaks_come_largest_first():
    spectrum = amplitude_spectrum(tone(200, (4, 10.7, 0.0), (14, 9.7, 1.0), (60, 2.0, 0.0), constant=100.0), STEP)
    found = peaks(spectrum.frequency, spectrum.amplitude, 3)
    assert [p.bin for p in found] == [4, 14, 60]
    assert [p.frequency for p in found] == pytest.approx([4 / 7e-3, 2000.0, 60 / 7e-3], rel=1e-12)
    assert [p.amplitude for p in found] == pytest.approx([10.7, 9.7, 2.0], rel=1e-12)
    assert len(peaks(spectrum.frequency, spectrum.amplitude, 9, above=0.5)) == 2
    assert peaks([0.0, 1.0, 2.0], [5.0, 0.0, 0.0]) == ()
    # the last line can be one, a plateau is one
    assert [p.bin for p in peaks(range(6), [0.0, 1.0, 3.0, 3.0, 1.0, 2.0])] == [2, 5]


def test_orders_of_the_shipped_train():
    """600 rad/s, teeth 20/30 and 20/30: meshes at 1909.9 and 1273.2 Hz with the common order at 636.6 Hz."""
    drive = 600 / (2 * math.pi)
    lines = order_lines({"mesh 1": 20 * drive, "mesh 2": 20 * drive * 20 / 30}, 4000.0)
    assert [(line.name, line.order) for line in lines] == [
        ("mesh 2", 1), ("mesh 1", 1), ("mesh 2", 2), ("mesh 1", 2), ("mesh 2", 3),
    ]  # fmt: skip
    assert [line.frequency for line in lines] == pytest.approx(
        [1273.2395, 1909.8593, 2546.4791, 3819.7186, 3819.7186], abs=1e-3
    )
    assert nearest_line(2000.0, lines, 142.9) == lines[1]
    assert nearest_line(3819.0, lines, 10.0) == lines[3]  # of equal ones the lower order
    assert nearest_line(571.0, lines, 142.9) is None
    assert order_lines({"still": 0.0}, 100.0) == ()
    assert order_lines({"backwards": -25.0}, 60.0)[1] == OrderLine("backwards", 2, 50.0)


def test_waterfall_of_a_run_up():
    """The line of a linear run-up moves by its rate; each piece shows it at its middle time."""
    step, rate = 1e-4, 1000.0  # s, Hz/s
    t = step * np.arange(10_000)
    fall = waterfall(np.cos(2 * math.pi * (200 * t + 0.5 * rate * t**2)), step, 1000, hop=500)
    assert fall.amplitude.shape == (len(fall.time), 501)
    line = fall.frequency[fall.amplitude.argmax(axis=1)]
    assert np.abs(line - (200 + rate * fall.time)).max() <= 5 * fall.frequency[1]
    assert np.diff(line).min() > 0


def test_steps():
    assert uniform_step(0.5 + STEP * np.arange(201)) == pytest.approx(STEP, rel=1e-12)
    for bad in ([0.0], [0.0, 1.0, 3.0], [0.0, -1.0], np.zeros(4)):
        with pytest.raises(InputError, match="time"):
            uniform_step(bad)


@pytest.mark.parametrize(
    ("values", "step", "options", "message"),
    [
        (np.zeros(10), 1.0, {"length": 11}, "the window is longer than the signal, which has 10 samples"),
        (np.zeros(10), 1.0, {"start": 5, "length": 6}, "which has 5 samples from its start"),
        (np.zeros(10), 1.0, {"length": 1}, "two samples at least"),
        (np.zeros(10), 1.0, {"start": -1}, "choose 0..8"),
        (np.zeros(10), 1.0, {"start": 9}, "choose 0..8"),
        (np.zeros(10), 1.0, {"window": "han"}, "must be one of none, hann"),
        (np.zeros(10), 0.0, {}, "step = 0.0: must be finite and > 0"),
        (np.array([0.0, np.nan]), 1.0, {}, "not finite"),
        (np.zeros(1), 1.0, {}, "two samples at least"),
        (np.zeros((4, 2, 2)), 1.0, {}, "(n,) or (n, signals)"),
    ],
)
def test_mistakes(values, step, options, message):
    with pytest.raises(InputError) as error:
        amplitude_spectrum(values, step, **options)
    assert message in str(error.value)


def test_more_mistakes():
    with pytest.raises(InputError, match="window is longer"):
        waterfall(np.zeros(10), 1.0, 11)
    with pytest.raises(InputError, match="one signal"):
        waterfall(np.zeros((10, 2)), 1.0, 4)
