r"""Spectra over short times, orders over a run-up, and where a run is steady; all of equally spaced samples.

**Orders.** The amplitude of the order k is that of its Fourier integral over the angle :math:`\varphi` of a shaft, with
Hann's window w over a part of :math:`\Phi` round :math:`\varphi_0`,

.. math::
    \hat x_k(\varphi_0) = \frac{2}{\int w\,d\varphi} \int_{\varphi_0-\Phi/2}^{\varphi_0+\Phi/2}
    w\, x\, e^{-i k \varphi}\,d\varphi, \qquad w = 1 + \cos\frac{2\pi(\varphi-\varphi_0)}{\Phi},

which resamples the signal over the angle without interpolation: the trapezoidal sum is taken over the samples at hand,
whose angles are known exactly. An order whose frequency lies above the band of the samples has no value.

**Steady.** The run is cut into parts of whole periods. A signal is steady from the first part on after which its mean,
and its rms about the mean, stay within `STEADY_WITHIN` of those of the last quarter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...base.errors import InputError
from ...base.record_spectrum import Decimator
from ...base.shown import percent
from ...base.spectrum import Waterfall, waterfall
from ...base.typing import Array, ComplexArray
from ..train.response import TrainResponse

#: Parts of a run, at least; how near they must stay to be steady where the motion repeats, and where it does not; which
#: part of the largest signal, or of their own largest level, signals must have to count.
PARTS, STEADY_WITHIN, WITHOUT_PERIOD, STILL = 20, 0.01, 0.05, 0.02
#: How far parts of spectra and orders lie apart, in parts of their length.
HOP = 0.25


@dataclass(frozen=True, eq=False)
class OrderTracks:
    """Amplitudes of orders along a run-up.

    Attributes
    ----------
    time, speed : (m,)
        When the shaft is in the middle of each part (s), and how fast it turns there (rad/s).
    orders : (k,)
    amplitude : (m, k, s)
        Of s signals, complex: the part is ``Re(amplitude exp(i order angle))``; NaN above the band.
    """

    time: Array
    speed: Array
    orders: Array
    amplitude: ComplexArray


def short_time(values: Array, step: float, length: float) -> list[Waterfall]:
    """Spectra over parts of `length` (s), one `Waterfall` a signal; `values` (n, s) are `step` (s) apart.

    Raises
    ------
    InputError
        Parts that are longer than the run or hold less than eight samples.
    """
    check_part(length, step, (len(values) - 1) * step)
    count = round(length / step)
    return [waterfall(one, step, count, hop=max(1, round(HOP * count))) for one in values.T]


def check_part(length: float, step: float, duration: float) -> None:
    """Raise `InputError` unless parts of `length` (s) hold eight samples and are no longer than the run."""
    if not 8 * step * (1.0 - 1e-9) <= length <= duration * (1.0 + 1e-9):
        problem = f"must be >= {8e3 * step:.4g} ms (eight samples) and <= {1e3 * duration:.4g} ms (the run)"
        raise InputError("spectrum.short_time_ms", float(f"{1e3 * length:.12g}"), problem, "choose another duration")


def check_turns(angle: Array, turns: float) -> tuple[int, int, float]:
    """First and end of the longest stretch in which an angle (rad) goes one way, and its sense; not too short.

    Raises
    ------
    InputError
        When it is less than so many turns.
    """
    first, last, sense = _one_way(angle)
    whole = float(abs(angle[last - 1] - angle[first])) / (2.0 * math.pi) if last > first else 0.0
    if whole * (1.0 + 1e-9) < turns:
        problem = f"the first shaft that turns makes {whole:.4g} turns in one sense"
        raise InputError("spectrum.order_turns", turns, problem, "take less turns, or a longer run")
    return first, last, sense


def averaged(fall: Waterfall, start: float) -> tuple[Array, int]:
    """Root mean square of the amplitudes over the parts that begin at `start` (s) or later, and how many these are."""
    half = 0.5 / float(fall.frequency[1])
    used = fall.time - half >= start - 1e-9
    amplitude = fall.amplitude[used] if used.any() else fall.amplitude[-1:]
    return np.sqrt((amplitude**2).mean(axis=0)), len(amplitude)


def order_tracks(
    time: Array, angle: Array, values: Array, orders: Array, turns: float, highest: float = math.inf
) -> OrderTracks:
    """Return the amplitudes of orders over parts of so many turns.

    Parameters
    ----------
    time, angle : (n,)
        Of the samples (s, rad); the longest stretch in which the angle goes one way counts.
    values : ndarray, shape (n, s)
        Signals.
    orders : ndarray, shape (k,)
        Cycles in a turn of the shaft.
    turns : float
        Turns in a part.
    highest
        End of the samples' band (Hz).

    Raises
    ------
    InputError
        When the shaft makes less turns.
    """
    first, last, sense = check_turns(angle, turns)
    t, phi, x = time[first:last], sense * angle[first:last], values[first:last]
    width, whole = 2.0 * math.pi * turns, float(phi[-1] - phi[0])
    count = max(1, int((whole - width) / (HOP * width) * (1.0 + 1e-9)) + 1)
    middles = phi[0] + width * (0.5 + HOP * np.arange(count))
    ends = np.searchsorted(phi, [middles - 0.5 * width, middles + 0.5 * width])
    places = np.interp(middles, phi, t)
    speeds = np.interp(middles, phi, np.gradient(phi, t))
    made = np.full((len(middles), len(orders), values.shape[1]), np.nan, dtype=complex)
    for i, (middle, low, high) in enumerate(zip(middles, *ends, strict=True)):
        part = phi[low:high]
        weight = 1.0 + np.cos(2.0 * math.pi * (part - middle) / width)
        steps = np.diff(part)
        quadrature = np.zeros(len(part))  # the trapezoidal rule: the window is zero at both ends
        quadrature[:-1] += 0.5 * steps
        quadrature[1:] += 0.5 * steps
        quadrature *= weight
        known = orders * speeds[i] / (2.0 * math.pi) <= highest
        kernel = np.exp(-1j * np.outer(orders[known], part)) * quadrature
        made[i, known] = 2.0 / quadrature.sum() * (kernel @ x[low:high])
    return OrderTracks(places, sense * speeds, np.asarray(orders, dtype=float), made)


def _one_way(angle: Array) -> tuple[int, int, float]:
    """Longest stretch in which an angle rises or falls all the time: first, end, sense."""
    if len(angle) < 2:
        return 0, len(angle), 1.0
    sign = np.sign(np.diff(angle))
    borders = np.flatnonzero(np.diff(sign, prepend=np.nan, append=np.nan) != 0.0)
    lengths = np.where(sign[borders[:-1]] == 0.0, 0, np.diff(borders))
    best = int(np.argmax(lengths))
    return int(borders[best]), int(borders[best + 1]) + 1, float(sign[borders[best]] or 1.0)


def steady_from(time: Array, groups: list[Array], period: float | None) -> float:
    """Time (s) from which all signals are steady; see the module.

    Parameters
    ----------
    time : (n,)
        Equally spaced.
    groups : list of (n, s)
        Signals of one kind each, as forces: what is small beside the largest of its group counts little.
    period
        After which a steady run repeats (s), or None.

    Raises
    ------
    InputError
        When the run has not been steady for its last quarter.
    """
    step, duration = float(time[1] - time[0]), float(time[-1] - time[0])
    part = duration / PARTS
    if period:
        part = period * math.ceil(part / period * (1.0 - 1e-9))
    count = int(duration / part * (1.0 + 1e-9))
    cure = "compute for longer (duration_ms), or give the begin of the record in ms"
    if count < 4:
        problem = f"has only {count} parts of {1e3 * part:.4g} ms in the run: at least 4 are needed"
        raise InputError("spectrum.spectrum_from_ms", "steady", problem, cure)
    begin = time[-1] - part * np.arange(count, 0, -1)  # parts end with the run
    off = np.zeros(count)
    for values in groups:
        mean, rms = np.empty((count, values.shape[1])), np.empty((count, values.shape[1]))
        for i, start in enumerate(begin):
            low = round((start - time[0]) / step)
            some = values[low : low + max(2, round(part / step))]
            mean[i], rms[i] = some.mean(axis=0), some.std(axis=0)
        quarter = max(1, count // 4)
        last = [level[-quarter:].mean(axis=0) for level in (mean, rms)]
        # what is little beside its group, or beside what it was at the start, need not come to rest
        least = STILL * np.maximum(rms.max(axis=0), last[1].max(initial=0.0))
        for level, end, floor in ((mean, last[0], np.maximum(least, last[1])), (rms, last[1], least)):
            scale = np.maximum(np.abs(end), floor)
            scale[scale == 0.0] = 1.0
            off = np.maximum(off, (np.abs(level - end) / scale).max(axis=1, initial=0.0))
    late = np.flatnonzero(off > (STEADY_WITHIN if period else WITHOUT_PERIOD))
    first = int(late[-1]) + 1 if len(late) else 0
    if first > count - max(1, count // 4):
        worst = off[-max(1, count // 4) :].max()
        problem = (
            f"the run is not steady: forces or accelerations still change by {percent(worst, 3)} in its last quarter"
        )
        raise InputError("spectrum.spectrum_from_ms", "steady", problem, cure)
    return float(begin[first])


class Tracked:
    """Contact forces, transmission errors and attachments' accelerations, and the drive's angle.

    The signals pass the low-pass filter of `base.record_spectrum`. Of m samples per output step every (m/2)-th is kept,
    so nothing is aliased up to half the output's sampling frequency. Beyond its ends the run is held.

    Parameters
    ----------
    every
        Samples of the response in an output step: 1, or an even number.
    step
        Output step (s).
    """

    def __init__(self, every: int, step: float) -> None:
        self._decimator = Decimator(max(1, every // 2))
        self.step = step * self._decimator.keep / every
        self.highest = 0.5 / step
        self.names: tuple[str, ...] = ()
        self._arrived = 0  # samples
        self._last = np.zeros((0, 0))
        self._rows: list[Array] = []
        self._angles: list[Array] = []
        self._start = 0.0

    def add(self, piece: TrainResponse) -> None:
        """Take the samples that follow those taken before."""
        if not len(piece.time):
            return
        columns, keep = signals(piece), self._decimator.keep
        values = np.column_stack(list(columns.values()))
        if not self.names:
            self.names, self._start = tuple(columns), float(piece.time[0])
            self._decimator.add(np.repeat(values[:1], self._decimator.half, axis=0))
        self._angles.append(piece.drive_angle[-self._arrived % keep :: keep])
        self._arrived += len(values)
        self._rows.append(self._decimator.add(values))
        self._last = values[-1:]

    def finished(self) -> tuple[Array, Array, Array]:
        """Times (n,), angles of the drive (n,) and signals (n, s)."""
        if not self._rows:
            return np.zeros(0), np.zeros(0), np.zeros((0, 0))
        angle = np.concatenate(self._angles)
        beyond = np.repeat(self._last, self._decimator.half + self._decimator.keep, axis=0)
        values = np.concatenate([*self._rows, self._decimator.add(beyond)])[: len(angle)]
        return self._start + self.step * np.arange(len(angle)), angle, values


def signals(piece: TrainResponse) -> dict[str, Array]:
    """Columns that are tracked, by the names of response.csv."""
    made = {f"contact_force_{i + 1}_N": force for i, force in enumerate(piece.contact_force.T)}
    made |= {f"transmission_error_{i + 1}_um": 1e6 * error for i, error in enumerate(piece.transmission_error.T)}
    for name, moved in zip(piece.attachment_names, piece.attachment_acceleration.T, strict=True):
        made[f"attachment_{name}_acceleration_m_per_s2"] = moved
    return made
