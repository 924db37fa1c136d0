"""Spectra of all signals of a train's response, and of the power that its housing radiates."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...base.errors import InputError
from ...base.octaves import ThirdOctaves, third_octaves
from ...base.record_spectrum import FASTEST, RecordSpectrum
from ...base.spectrum import Spectrum, uniform_step
from ...base.typing import Array, ComplexArray
from ..gearbox.radiation import AIR_IMPEDANCE, RadiatedPower, instantaneous_power
from ..train.response import TrainResponse

#: Columns of response.csv that are no signals of the spectrum.
NO_SIGNALS = ("time_s", "drive_angle_deg", "instantaneous_radiated_power_W", "band_limited")
#: Beginnings of names of others.
NO_SIGNAL = ("rotation_",)


@dataclass(frozen=True, eq=False)
class TrainSpectra:
    """Spectra of all signals over one record.

    Attributes
    ----------
    names
        Signals, as in response.csv.
    spectrum
        One column a signal.
    power
        Equivalent radiated power; None for a rigid housing.
    start, step, every
        Time of the first sample and between outputs (s); samples of the motion in an output step.
    """

    names: tuple[str, ...]
    spectrum: Spectrum
    power: RadiatedPower | None
    start: float
    step: float
    every: int

    def amplitude(self, name: str) -> Array:
        """(m,) amplitudes of a signal."""
        return np.abs(self.value(name))

    def value(self, name: str) -> ComplexArray:
        """(m,) complex amplitudes of a signal."""
        return self.spectrum.value[:, self.names.index(name)]

    @property
    def octaves(self) -> ThirdOctaves | None:
        """Radiated power in third octaves, plain and A-weighted; None for a rigid housing."""
        if self.power is None:
            return None
        return third_octaves(self.power.frequency, self.power.power / self.spectrum.noise_bandwidth)

    def columns(self) -> dict[str, Array]:
        """Columns of spectrum.csv."""
        amplitude = self.spectrum.amplitude
        made = {"frequency_Hz": self.spectrum.frequency}
        made |= {name: amplitude[:, i] for i, name in enumerate(self.names)}
        if self.power is not None:
            level = np.where(self.power.power > 0.0, self.power.level, np.nan)  # what radiates nothing has none
            made |= {"radiated_power_W": self.power.power, "radiated_power_level_dB": level}
        return made


def response_columns(response: TrainResponse, radiation: Array | None = None) -> dict[str, Array]:
    """Columns of response.csv; `radiation` is the housing's surface matrix.

    The values are those of the motion at the times, so they hold vibration of all frequencies: ``band_limited`` is 0.
    """
    made = response.columns()
    if radiation is not None and response.modal_velocity is not None:
        made["instantaneous_radiated_power_W"] = instantaneous_power(radiation, response.modal_velocity)
    made["band_limited"] = np.zeros(len(response.time), dtype=np.int64)
    return made


class TrainRecord:
    """Spectra of all signals of a response that arrives piece by piece.

    The record is a part of the output times. It holds its first sample but not its last: n steps are n samples, as in a
    period that repeats. Thus 7 ms in 200 steps give lines 1/(7 ms) apart.

    Parameters
    ----------
    times : (n,)
        Output times (s), equally spaced.
    every
        Samples of the response in an output step, see `gearfe.base.record_spectrum.finer`.
    radiation : (N, N) or None
        Surface matrix of the housing.
    window
        See `gearfe.base.spectrum.WINDOWS`.
    start, length
        Begin and duration of the record (s); by default all of it.
    folder
        For temporary files of a long record.
    signals
        Names of the only signals whose spectra are wanted; of the radiated power there is then the mean alone, its
        lines are NaN. By default all.

    Raises
    ------
    InputError
        A record that is longer than the response or has fewer than two samples; an unknown window.
    """

    def __init__(
        self,
        times: Array,
        every: int = 1,
        radiation: Array | None = None,
        *,
        window: str = "none",
        start: float = 0.0,
        length: float | None = None,
        folder: Path | None = None,
        signals: Collection[str] | None = None,
    ) -> None:
        self._folder, self._signals = folder, signals
        self.step, self.every, self.window = uniform_step(times), every, window
        self.first, self.count = record(times, start, length)
        self.start = float(times[self.first])
        self._radiation = radiation
        # |F^T v|^2 = v^T R v
        self._factor = None if radiation is None or signals is not None else _root(np.asarray(radiation))
        self._names: tuple[str, ...] = ()
        self._made: RecordSpectrum | None = None
        self._arrived, self._square = 0, 0.0

    def add(self, piece: TrainResponse) -> None:
        """Take the samples that follow those taken before.

        Raises
        ------
        InputError
            When they are too far apart for the highest modes, whose vibration would fold into the spectrum.
        """
        highest, nyquist = float(piece.coupled_frequencies_Hz.max(initial=0.0)), 0.5 * self.every / self.step
        if min(highest, FASTEST) > nyquist:
            problem = f"modes up to {highest:.6g} Hz would fold, half the sampling frequency is {nyquist:.6g} Hz"
            raise InputError("response", None, problem, "simulate at the times of gearfe.base.record_spectrum.finer")
        every = response_columns(piece) | piece.bearing_forces()
        columns = {
            name: values
            for name, values in every.items()
            if name not in NO_SIGNALS
            and not name.startswith(NO_SIGNAL)
            and (self._signals is None or name in self._signals)
        }
        values = np.column_stack(list(columns.values()))
        number = self._arrived - self.first * self.every
        self._arrived += len(values)
        if self._radiation is not None and piece.modal_velocity is not None:
            inside = piece.modal_velocity[max(0, -number) : max(0, self.count * self.every - number)]
            self._square += float(((inside @ self._radiation) * inside).sum())
            if self._factor is not None:
                values = np.column_stack([values, piece.modal_velocity @ self._factor])
        if self._made is None:
            self._names = tuple(columns)
            self._made = RecordSpectrum(
                values.shape[1], self.count, self.step, self.every, self.window, folder=self._folder
            )
        self._made.add(number, values)

    @property
    def complete(self) -> bool:
        """Whether all samples have arrived."""
        return self._made is not None and self._made.complete

    def spectra(self) -> TrainSpectra:
        """The spectra, when all samples have arrived."""
        if self._made is None:
            raise InputError("record", None, "no sample has arrived", "add the response")
        signals = len(self._names)
        spectrum = self._made.spectrum(signals)
        power = None
        mean = AIR_IMPEDANCE * self._square / (self.count * self.every)
        if self._radiation is not None and self._signals is not None:
            power = RadiatedPower(spectrum.frequency, np.full(len(spectrum.frequency), np.nan), mean)
        elif self._made.signals > signals:
            square = sum(np.abs(self._made.column(i)) ** 2 for i in range(signals, self._made.signals))
            power = RadiatedPower(spectrum.frequency, AIR_IMPEDANCE * spectrum.weight * square, mean)
        return TrainSpectra(self._names, spectrum, power, self.start, self.step, self.every)


def spectra(
    response: TrainResponse,
    radiation: Array | None = None,
    *,
    every: int = 1,
    window: str = "none",
    start: float = 0.0,
    length: float | None = None,
) -> TrainSpectra:
    """Return the spectra of a response at hand, see `TrainRecord`.

    Parameters
    ----------
    response : TrainResponse
        The motion.
    radiation : ndarray, shape (N, N), optional
        Surface matrix of the housing.
    every : int
        Samples of the response in an output step.
    window : str
        See `gearfe.base.spectrum.WINDOWS`.
    start, length : float
        Begin and duration of the record (s); by default all of it.
    """
    times = response.time[::every]
    made = TrainRecord(times, every, radiation, window=window, start=start, length=length)
    made.add(response)
    return made.spectra()


def record(time: Array, start: float = 0.0, length: float | None = None) -> tuple[int, int]:
    """First sample and number of samples of the record of a spectrum; see `TrainRecord`."""
    step = uniform_step(time)
    available = len(time) - 1
    first = round((start - float(time[0])) / step)
    if not 0 <= first <= available - 2:
        problem = f"must leave two samples at least of {time[0]:g}..{time[-1]:g} s"
        raise InputError("spectrum start", start, problem, "begin earlier")
    count = available - first if length is None else round(length / step)
    if count > available - first:
        problem = f"the window is longer than the signal, which has {(available - first) * step:g} s from its start"
        raise InputError("window length", length, problem, "shorten the window or compute for longer")
    if count < 2:
        raise InputError("window length", length, f"is less than two steps of {step:g} s", "lengthen the window")
    return first, count


def _root(matrix: Array) -> Array:
    """F with F F^T = matrix, (N, rank); the matrix is symmetric and positive semi-definite."""
    values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    used = values > len(matrix) * np.finfo(float).eps * values.max(initial=0.0)
    return np.asarray(vectors[:, used] * np.sqrt(values[used]))
