"""Spectra of motion whose fastest part is faster than the output: nothing of it may be found below."""

import math

import numpy as np
import pytest
from scipy import signal

from gearfe.base.errors import InputError
from gearfe.base.record_spectrum import IN_MEMORY, ColumnStore, RecordSpectrum, finer, low_pass, samples_per_step
from gearfe.drivetrain.train import build_train, simulate
from gearfe.drivetrain.vibration.spectra import TrainRecord, spectra
from tests.makers.train_responses import STEP, made_up
from tests.makers.trains import curve, train

T = 200 * STEP
NYQUIST = 0.5 / STEP


def spectrum(motion, *, steps=200, every=8, window="none", pieces=1):
    """Spectrum of a function of time over `steps` steps."""
    time = STEP / every * np.arange(steps * every + 1)
    made = RecordSpectrum(1, steps, STEP, every, window)
    at = 0
    for part in np.array_split(motion(time)[:, None], pieces):
        made.add(at, part)
        at += len(part)
    return made.spectrum()


def tone(frequency, amplitude=1.0, phase=0.3):
    return lambda t: amplitude * np.cos(2 * math.pi * frequency * t + phase)


def exact(frequency, f, phase=0.3):
    """Fourier coefficients over T of cos(2 pi frequency t + phase) at the frequencies f, by integration."""
    both = [
        np.exp(s * 1j * phase) * np.exp(1j * math.pi * (s * frequency - f) * T) * np.sinc((s * frequency - f) * T)
        for s in (1, -1)
    ]
    return both[0] + both[1]


@pytest.mark.parametrize("keep", [2, 3, 8, 40])
def test_the_filter_stops_what_would_fold(keep):
    turns, response = signal.freqz(low_pass(keep), worN=20_001)
    place = turns / math.pi * 2 * keep  # in units of the output's Nyquist frequency
    assert np.abs(response[place >= 3]).max() < 1e-7
    assert np.abs(response[place <= 1]).min() > 1 - 1e-6


@pytest.mark.parametrize("every", [1, 2, 4, 6, 8, 14])
@pytest.mark.parametrize("steps", [2, 7, 200, 201])
def test_tones_come_back(every, steps):
    """A constant and two lines of the record, one at the last frequency below Nyquist."""
    line = 1 / (steps * STEP)
    last = (steps - 1) // 2
    lines = [(0, 3.0)] if last == 0 else [(0, 3.0), (last, 0.7)]
    found = spectrum(lambda t: 3.0 + (last > 0) * tone(last * line, 0.7)(t), steps=steps, every=every)
    assert found.frequency == pytest.approx(line * np.arange(steps // 2 + 1))
    expected = np.zeros(steps // 2 + 1)
    for k, size in lines:
        expected[k] = size
    assert found.amplitude[:, 0] == pytest.approx(expected, abs=1e-12)
    assert found.samples == steps * every


@pytest.mark.parametrize("every", [2, 4, 8, 14])
def test_tones_above_leave_nothing(every):
    """All lines between the output's and the samples' Nyquist frequency, one by one."""
    for k in range(101, 100 * every, 7):
        found = spectrum(tone(k / T), every=every)
        assert found.amplitude.max() < 1e-7, k


@pytest.mark.parametrize("window", ["none", "hann", "flattop"])
def test_against_the_fourier_method(window):
    """The same from scipy.signal.resample, which cuts the transform of all samples (a record that repeats)."""
    every, steps = 8, 200
    x = np.random.default_rng(4).standard_normal(every * steps)
    made = RecordSpectrum(1, steps, STEP, every, window)
    made.add(0, np.append(x, x[0])[:, None])
    weights = signal.get_window({"none": "boxcar"}.get(window, window), every * steps)
    if window == "flattop":  # scipy's and ISO 18431-2's coefficients differ
        weights = sum(
            (-1) ** j * a * np.cos(2 * math.pi * j * np.arange(every * steps) / (every * steps))
            for j, a in enumerate((1.0, 1.933, 1.286, 0.388, 0.0322))
        )
    few = signal.resample(x * weights, 2 * steps)
    other = np.fft.rfft(few)[:101] / steps / weights.mean()
    other[0] *= 0.5
    assert made.column(0) == pytest.approx(other, abs=1e-6 * np.abs(other).max())


@pytest.mark.parametrize("frequency", [1234.5, 9876.0, 20_050.0, 61_000.0])
def test_tones_that_do_not_fit_the_record(frequency):
    """Their Fourier integral over the record, which a tone above the band has below it, too (leakage)."""
    found = spectrum(tone(frequency), every=16)
    value = exact(frequency, found.frequency)
    value[0] *= 0.5
    assert np.abs(found.value[:, 0] - value).max() < 1e-3
    if frequency > NYQUIST:  # with a window next to nothing is left
        assert spectrum(tone(frequency), every=16, window="hann").amplitude[:60].max() < 1e-5


@pytest.mark.parametrize("every", [1, 2, 8])
def test_pieces_are_the_whole(every):
    x = np.random.default_rng(1).standard_normal(200 * every + 1)

    def motion(time):
        return x[: len(time)]

    whole = spectrum(motion, every=every, window="hamming")
    for pieces in (2, 7, 190):
        assert spectrum(motion, every=every, window="hamming", pieces=pieces).value == pytest.approx(
            whole.value, abs=1e-14
        )


def test_pieces_in_order():
    made = RecordSpectrum(1, 10, STEP, 2)
    made.add(-5, np.zeros((5, 1)))  # before the record
    made.add(-2, np.ones((6, 1)))
    with pytest.raises(InputError, match="must go on with number 4"):
        made.add(5, np.zeros((1, 1)))
    with pytest.raises(InputError, match="4 of 21 samples"):
        made.column(0)


def test_how_finely():
    assert samples_per_step(35e-6, 7_000.0) == 1
    assert samples_per_step(35e-6, 14_000.0) == 2
    assert samples_per_step(35e-6, 69_000.0) == 10
    times, every = finer(STEP * np.arange(201), 69_000.0)
    assert every == 10
    assert (times[::10] == STEP * np.arange(201)).all()  # not one output time moves
    assert np.diff(times) == pytest.approx(STEP / 10, rel=1e-9)


def test_a_large_table_by_columns():
    rows = np.arange(3.0 * 200_000).reshape(-1, 3)
    store = ColumnStore(3)
    for block in np.array_split(np.vstack([rows] * 8), 5):
        store.append(block)
    assert 8 * rows.nbytes > IN_MEMORY
    assert (store.column(1) == np.tile(rows[:, 1], 8)).all()


# ---- trains ----------------------------------------------------------------------------------------------------------


def test_the_spectrum_does_not_depend_on_the_output_step():
    """Modes above the output's Nyquist frequency: the point samples' own transform is wrong, the spectrum is not."""
    model = build_train(train([(20, 30)], stiffness=lambda z: curve(z, 1e8, 0.3)))
    highest = float(model.coupled_frequencies_hz.max())
    duration = 300.0 / highest
    found = {}
    for steps in (200, 300, 900):
        times, every = finer(np.linspace(0.0, duration, steps + 1), highest)
        made = simulate(model, times, tolerance=1e-10)
        found[steps] = spectra(made, every=every).amplitude("contact_force_1_N")[:100]
        if steps == 200:
            assert every > 1
            points = np.abs(np.fft.rfft(made.every(every).contact_force[:-1, 0])) / 100
    largest = found[900][1:].max()
    assert np.abs(points[1:100] - found[900][1:]).max() > 0.1 * largest
    for steps in (200, 300):
        assert found[steps] == pytest.approx(found[900], abs=2e-3 * largest), steps


def test_samples_that_would_fold_are_refused():
    response = made_up(coupled_frequencies_Hz=np.array([560.0, 20_000.0]))
    with pytest.raises(InputError, match="modes up to 20000 Hz would fold"):
        spectra(response)


def test_the_power_of_a_fast_motion():
    """Two coordinates: the slow one's line is there, the fast one is in the mean only."""
    steps, every = 200, 8
    time = STEP / every * np.arange(steps * every + 1)
    rates = np.column_stack([tone(14 / T, 0.02)(time), tone(700 / T, 0.05)(time)])
    long = {
        name: np.repeat(getattr(made_up(), name)[:1], len(time), axis=0)
        for name in (
            "contact_force",
            "transmission_error",
            "speed",
            "speed_absolute",
            "drive_torque",
            "acceleration",
            "acceleration_absolute",
        )
    }
    long |= {"attachment_acceleration": np.zeros((len(time), 6)), "drive_angle": 600.0 * time}
    response = made_up(time=time, modal=rates, modal_velocity=rates, modal_acceleration=rates, **long)
    record = TrainRecord(time[::every], every, np.array([[2e-3, 5e-4], [5e-4, 1e-3]]))
    record.add(response)
    power = record.spectra().power
    assert power.power[14] == pytest.approx(0.5 * 1.2041 * 343.21 * 2e-3 * 0.02**2, rel=1e-9)
    assert np.delete(power.power, 14).max() < 1e-12 * power.power[14]
    assert power.mean == pytest.approx(0.5 * 1.2041 * 343.21 * (2e-3 * 0.02**2 + 1e-3 * 0.05**2), rel=1e-9)
    few = TrainRecord(time[::every], every, np.array([[2e-3, 5e-4], [5e-4, 1e-3]]), signals=("contact_force_1_N",))
    few.add(response)
    assert few.spectra().names == ("contact_force_1_N",)
    assert few.spectra().power.mean == pytest.approx(power.mean, rel=1e-12)
    whole = record.spectra().value("contact_force_1_N")
    assert few.spectra().value("contact_force_1_N") == pytest.approx(whole, rel=1e-12, abs=1e-12 * abs(whole[0]))
