r"""Spectrum of a record of motion that is known at all times: the Fourier coefficients, with nothing folded into them.

For a record from :math:`t_0` to :math:`t_0 + T` with the window w of mean :math:`\bar w`,

.. math::
    \hat x_k = \frac{2}{T \bar w}\int_0^T w\, x\, e^{-2\pi i f_k t}\,dt, \qquad f_k = k/T \le \frac{1}{2 h},

half of it for the constant. The output step h only says up to where there are lines. The integral is the trapezoidal
sum over samples m times as fine as the output (`samples_per_step`), which is exact for a periodic record. If a record
ends with another value than it began with, the ramp between its ends is integrated exactly.

Samples may come piece by piece. They pass a linear-phase low-pass filter (a sinc with a Kaiser window; Oppenheim &
Schafer, Discrete-Time Signal Processing, Sec. 7.5). Every (m/2)-th is kept, twice the output's number in all. Only
components above three times the output's Nyquist frequency would be aliased below it; the filter reduces them by 140
dB. Its effect on lines below the Nyquist frequency is divided out. Beyond its ends the record is continued
periodically, because its coefficients are those of the periodic continuation. The filter therefore has no transient.
"""

from __future__ import annotations

import math
import tempfile
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from .errors import InputError
from .spectrum import Spectrum, window_at
from .typing import Array, ComplexArray

#: Sampling frequency of the motion, in parts of twice the highest natural frequency, at least: with 2 the leakage of a
#: fast mode through the ends of a record is within 1e-3 of the largest line; on lines of the record it would need 1.
OVERSAMPLING = 2.0
#: Modes beyond this (Hz) are springs instead of constraints: their motion follows that of the others.
FASTEST = 1e6
#: Half length of the filter in kept samples, and the attenuation (dB) that has this length by Kaiser's formulas.
REACH, STOP_BAND_DB = 10, 145.0
#: Kaiser's relation between the attenuation and the parameter of his window.
_BETA = 0.1102 * (STOP_BAND_DB - 8.7)


def samples_per_step(step: float, highest: float) -> int:
    """Return the samples per output step (s) for modes up to `highest` (Hz): 1, or an even number.

    Half the sampling frequency then lies `OVERSAMPLING` times above the highest mode, of those up to `FASTEST`.
    """
    needed = 2.0 * OVERSAMPLING * min(highest, FASTEST) * step * (1.0 - 1e-9)
    return 1 if needed <= 1.0 else 2 * math.ceil(0.5 * needed)


def finer(times: Array, highest: float) -> tuple[Array, int]:
    """Return times (s) to sample a motion with modes up to `highest` (Hz), and their number per output step.

    Parameters
    ----------
    times : (n,)
        Output times, equally spaced.
    """
    step = float(times[-1] - times[0]) / (len(times) - 1)
    every = samples_per_step(step, highest)
    return subdivided(times, every), every


def subdivided(times: Array, every: int) -> Array:
    """Equally spaced times (n,) with `every` steps instead of each one."""
    count = len(times) - 1
    finer_times = times[0] + float(times[-1] - times[0]) / (every * count) * np.arange(every * count + 1)
    finer_times[::every] = times
    return np.asarray(finer_times)


class RecordSpectrum:
    """Spectrum of signals whose samples arrive piece by piece; see the module.

    Parameters
    ----------
    signals
        Number of signals.
    steps
        Output steps of the record.
    step
        Output step h (s).
    every
        Samples in an output step: 1, or an even number.
    window
        See `gearfe.base.spectrum.WINDOWS`.
    folder
        For the temporary file of a long record.
    """

    def __init__(
        self, signals: int, steps: int, step: float, every: int, window: str = "none", *, folder: Path | None = None
    ) -> None:
        if every != 1 and every % 2:
            raise InputError("samples per step", every, "must be 1 or an even number", "take samples_per_step")
        self.signals, self.steps, self.step, self.every, self.window = signals, steps, step, every, window
        self._last = steps * every
        weights = window_at(window, np.arange(self._last) / self._last)
        self._gain, self._square = float(weights.mean()), float(np.mean(weights**2))
        self._keep = max(1, every // 2)
        self._decimator = Decimator(self._keep)
        self._kept = ColumnStore(signals, folder)
        self._decimator.add(np.zeros((2 * self._decimator.half, signals)))
        #: windowed last sample less the first one
        self._rise = np.zeros(signals)
        self._next = 0

    @property
    def complete(self) -> bool:
        """Return whether all samples have arrived."""
        return self._next == self._last + 1

    def add(self, first: int, samples: Array) -> None:
        """Take the samples (n, signals) whose first is number `first` of the record; those beside it are left out."""
        begin, end = max(0, first), min(self._last + 1, first + len(samples))
        if end <= begin:
            return
        if begin != self._next:
            raise InputError("samples", begin, f"must go on with number {self._next}", "give the pieces in order")
        self._next = end
        x = samples[begin - first : end - first] * window_at(self.window, np.arange(begin, end) / self._last)[:, None]
        if not np.all(np.isfinite(x)):
            raise InputError("signal", None, "holds values that are not finite", "cut them off")
        if begin == 0:
            self._rise -= x[0]
            x[0] *= 0.5
        if self.complete:
            self._rise += x[-1]
            x[-1] *= 0.5
        self._kept.append(self._decimator.add(x))
        if self.complete:
            self._kept.append(self._decimator.add(np.zeros((2 * self._decimator.half + self._keep, self.signals))))

    @cached_property
    def frequency(self) -> Array:
        """(lines,) frequencies (Hz) up to half the output's sampling frequency, 0 first."""
        return np.arange(self.steps // 2 + 1) / (self.steps * self.step)

    @cached_property
    def _scale(self) -> Array:
        """(lines,) from sums of kept samples to amplitudes; the filter's response is divided out."""
        half, weights = self._decimator.half, self._decimator.weights
        turn = 2.0 * np.pi * np.arange(self.steps // 2 + 1) / self._last
        response = np.full(len(turn), weights[half])
        for j in range(1, half + 1):
            response += 2.0 * weights[half + j] * np.cos(j * turn)
        scale = 2.0 * self._keep / (self._last * self._gain * response)
        scale[0] *= 0.5
        if self.every == 1 and self.steps % 2 == 0:
            scale[-1] *= 0.5  # samples at the Nyquist frequency itself
        return np.asarray(scale)

    @cached_property
    def _ramp(self) -> ComplexArray:
        """(lines,) amplitudes of a ramp from 0 to 1: those of the integral less those of the trapezoidal sum."""
        half = np.pi * np.arange(1, self.steps // 2 + 1) / self._last  # half the angle between samples
        missing = 1j * (1.0 / half - 1.0 / np.tan(half)) / (self._last * self._gain)
        if self.every == 1 and self.steps % 2 == 0:
            missing[-1] = 0.0  # no phase is known there
        return np.concatenate([[0.0], missing])

    def column(self, signal: int) -> ComplexArray:
        """(lines,) complex amplitudes of a signal."""
        if not self.complete:
            problem = f"{self._next} of {self._last + 1} samples have arrived"
            raise InputError("record", None, problem, "give all of them")
        period, linear = self._last // self._keep, self._kept.column(signal)
        place = (np.arange(len(linear)) - self._decimator.half // self._keep) % period
        kept = np.bincount(place, weights=linear, minlength=period)
        return np.asarray(np.fft.rfft(kept)[: self.steps // 2 + 1] * self._scale + self._rise[signal] * self._ramp)

    def spectrum(self, signals: int | None = None) -> Spectrum:
        """Spectrum of the first `signals` signals, by default of all, one column each."""
        value = np.empty((len(self.frequency), self.signals if signals is None else signals), dtype=complex)
        for i in range(value.shape[1]):
            value[:, i] = self.column(i)
        return Spectrum(self.frequency, value, self._last, self.window, self._square / self._gain**2)


def low_pass(keep: int) -> Array:
    """Return (2 REACH keep + 1,) weights of sum 1. Their response is a half at half the rate of the kept samples.

    Passes up to half of that frequency, stops from one and a half on; with every sample kept there is nothing to stop.
    """
    if keep == 1:
        return np.ones(1)
    half = REACH * keep
    weights: Any = np.sinc(np.arange(-half, half + 1) / keep) * np.kaiser(2 * half + 1, _BETA)
    return np.asarray(weights / weights.sum())


class Decimator:
    """Every `keep`-th value of signals behind the low-pass filter; samples come piece by piece.

    The first value is that at sample `half`: what comes before the samples is added before them.
    """

    def __init__(self, keep: int) -> None:
        self.keep, self.weights = keep, low_pass(keep)
        self.half = len(self.weights) // 2
        self._open: Array | None = None

    def add(self, samples: Array) -> Array:
        """(rows, signals) values that these samples (n, signals) complete."""
        x = samples if self._open is None else np.concatenate([self._open, samples])
        count = max(0, (len(x) - len(self.weights)) // self.keep + 1)
        self._open = x[count * self.keep :]
        if not count:
            return x[:0]
        windows = np.lib.stride_tricks.sliding_window_view(x, len(self.weights), axis=0)[:: self.keep]
        return np.asarray(windows @ self.weights)


#: Bytes up to which the table stays in memory.
IN_MEMORY = 32 << 20


class ColumnStore:
    """Rows of `columns` numbers, appended block by block; the file, in `folder`, goes away with the object."""

    def __init__(self, columns: int, folder: Path | None = None) -> None:
        self.columns = columns
        self._blocks: list[int] = []
        self._file = tempfile.SpooledTemporaryFile(max_size=IN_MEMORY, dir=None if folder is None else str(folder))  # noqa: SIM115 (lives as long as the table)

    def append(self, rows: Array) -> None:
        """Add a block of rows, (n, columns)."""
        if len(rows):
            self._blocks.append(len(rows))
            self._file.write(np.ascontiguousarray(rows.T).tobytes())

    def column(self, number: int) -> Array:
        """(rows,) a whole column."""
        parts, begin = [], 0
        for count in self._blocks:
            self._file.seek(8 * (begin + number * count))
            parts.append(np.frombuffer(self._file.read(8 * count)))
            begin += count * self.columns
        self._file.seek(0, 2)
        return np.concatenate(parts) if parts else np.zeros(0)
