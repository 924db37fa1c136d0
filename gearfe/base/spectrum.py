r"""Spectra of equally spaced samples: one-sided amplitudes, windows, peaks, orders, band levels, waterfall.

For N samples :math:`x_n` at the step h and a window :math:`w_n` with mean :math:`\bar w`,

.. math::
    \hat x_k = \frac{c_k}{N \bar w}\sum_{n=0}^{N-1} w_n x_n e^{-2\pi i k n/N}, \qquad f_k = \frac{k}{N h},
    \qquad k = 0 \ldots \lfloor N/2 \rfloor,

with :math:`c_k = 2`, but 1 for the constant (k = 0) and, when N is even, for the Nyquist frequency (k = N/2): a
constant c gives c at 0 Hz, a sine of amplitude A on a bin gives A there. Dividing by :math:`\bar w` keeps amplitudes
right for every window (coherent gain). Sums of squares over a band are divided by the window's noise bandwidth
:math:`B = \overline{w^2}/\bar w^2` in bins (F. J. Harris, Proc. IEEE 66, 1978, Sec. IV).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .errors import InputError
from .shown import ShownTable
from .typing import Array, ComplexArray

#: Window -> coefficients a_j of ``w_n = sum_j (-1)^j a_j cos(2 pi j n/N)``; periodic (no repeated end sample).
#: Hann, Hamming, Blackman: Harris 1978, Table I; flat top: ISO 18431-2:2004.
WINDOWS: dict[str, tuple[float, ...]] = {
    "none": (1.0,),
    "hann": (0.5, 0.5),
    "hamming": (0.54, 0.46),
    "blackman": (0.42, 0.5, 0.08),
    "flattop": (1.0, 1.933, 1.286, 0.388, 0.0322),
}
#: Largest deviation of a step from the mean one, in parts of it.
UNEVEN = 1e-6


@dataclass(frozen=True, eq=False, repr=False)
class Spectrum(ShownTable):
    """One-sided amplitude spectrum of one or several signals.

    Attributes
    ----------
    frequency : ndarray, shape (m,)
        Frequencies of the bins (Hz), 0 first.
    value : ndarray of complex, shape (m,) or (m, s)
        Complex amplitudes: the part at f is ``Re(value exp(2 pi i f (t - t0)))``, t0 the first sample's time.
    samples
        N; of a band-limited spectrum more than twice the lines.
    window
        Name of the window.
    noise_bandwidth
        B, bins (1 without a window).
    """

    frequency: Array
    value: ComplexArray
    samples: int
    window: str
    noise_bandwidth: float

    AXES = ("frequency_Hz",)

    def facts(self) -> dict[str, str]:
        """Lines, signals and window."""
        highest = float(np.max(np.abs(self.value[1:]), initial=0.0))
        return {
            "lines": f"{len(self.frequency)}, 0 to {self.frequency[-1]:.6g} Hz, each {self.resolution:.4g} Hz",
            "signals": str(1 if self.value.ndim == 1 else self.value.shape[1]),
            "window": self.window,
            "largest amplitude": f"{highest:.4g} in the unit of the signal, without the constant",
        }

    def columns(self) -> dict[str, Array]:
        """Frequencies, and the amplitude of each signal in its unit."""
        signals = self.amplitude.reshape(len(self.frequency), -1).T
        return {"frequency_Hz": self.frequency, **{f"amplitude_{i + 1}": a for i, a in enumerate(signals)}}

    @property
    def amplitude(self) -> Array:
        """Amplitudes, shape of `value`, in the signal's unit."""
        return np.abs(self.value)

    @property
    def resolution(self) -> float:
        """Distance of the bins (Hz), 1/(N h)."""
        return float(self.frequency[1])

    @property
    def nyquist(self) -> float:
        """Half the sampling frequency (Hz); the lines may end below it."""
        return 0.5 * self.samples * self.resolution

    @property
    def weight(self) -> Array:
        """(m,) share of the squared amplitude in the mean square: 1/2, but 1 for the constant and at Nyquist."""
        weight = np.full(len(self.frequency), 0.5)
        weight[0] = 1.0
        if 2 * (len(weight) - 1) == self.samples:
            weight[-1] = 1.0
        return weight


@dataclass(frozen=True)
class Peak:
    """A local maximum of a spectrum: its bin's number, frequency (Hz) and amplitude (the signal's unit)."""

    bin: int
    frequency: float
    amplitude: float


@dataclass(frozen=True)
class OrderLine:
    """A multiple of a shaft's or mesh's frequency: its name, the order and the frequency (Hz)."""

    name: str
    order: int
    frequency: float


@dataclass(frozen=True, eq=False)
class Waterfall:
    """Spectra of overlapping pieces: middle times (k,) in s, frequencies (m,) in Hz, amplitudes (k, m)."""

    time: Array
    frequency: Array
    amplitude: Array


def uniform_step(time: ArrayLike) -> float:
    """Step of equally spaced times (s).

    Raises
    ------
    InputError
        For fewer than two times, or steps that differ.
    """
    t = np.asarray(time, dtype=float)
    if t.ndim != 1 or len(t) < 2:
        raise InputError("time", t.shape, "needs two samples at least", "take a longer signal")
    step = float((t[-1] - t[0]) / (len(t) - 1))
    if not (step > 0.0 and np.all(np.abs(np.diff(t) - step) <= UNEVEN * step)):
        raise InputError("time", None, "must increase in equal steps", "resample the signal")
    return step


def window_values(name: str, length: int) -> Array:
    """(length,) values of a window; see `WINDOWS`."""
    return window_at(name, np.arange(length) / length)


def window_at(name: str, place: Array) -> Array:
    """Values of a window at places of the record, 0 at its beginning and 1 at its end."""
    if name not in WINDOWS:
        raise InputError("window", name, "must be one of " + ", ".join(WINDOWS), "")
    angle = 2.0 * math.pi * place
    return np.asarray(sum((-1) ** j * a * np.cos(j * angle) for j, a in enumerate(WINDOWS[name])))


def amplitude_spectrum(
    values: ArrayLike, step: float, *, window: str = "none", start: int = 0, length: int | None = None
) -> Spectrum:
    """One-sided amplitude spectrum; see the module for its scaling.

    Parameters
    ----------
    values : (n,) or (n, s)
        Samples of one or s signals.
    step
        Time between samples (s).
    window
        ``none``, ``hann``, ``hamming``, ``blackman`` or ``flattop``.
    start, length
        First sample and number of samples of the window; by default all that follow `start`.

    Raises
    ------
    InputError
        Unknown window, a window longer than the signal, values that are not finite, a step that is not positive.
    """
    x = np.asarray(values, dtype=float)
    if x.ndim not in (1, 2) or len(x) < 2:
        raise InputError("signal", x.shape, "must hold two samples at least, (n,) or (n, signals)", "")
    if not (step > 0.0 and math.isfinite(step)):
        raise InputError("step", step, "must be finite and > 0 s", "give the time between samples")
    if not 0 <= start <= len(x) - 2:
        raise InputError("start", start, f"the signal has {len(x)} samples", f"choose 0..{len(x) - 2}")
    count = len(x) - start if length is None else length
    if count < 2:
        raise InputError("window length", count, "must be two samples at least", "take a longer window")
    if start + count > len(x):
        problem = f"the window is longer than the signal, which has {len(x) - start} samples from its start"
        raise InputError("window length", count, problem, "shorten the window or take a longer signal")
    x = x[start : start + count]
    if not np.all(np.isfinite(x)):
        raise InputError("signal", None, "holds values that are not finite", "cut them off")
    w = window_values(window, count)
    gain = float(w.mean())
    scale = np.full(count // 2 + 1, 2.0 / (count * gain))
    scale[0] *= 0.5
    if count % 2 == 0:
        scale[-1] *= 0.5
    shape = (-1,) + (1,) * (x.ndim - 1)
    value = np.fft.rfft(x * w.reshape(shape), axis=0) * scale.reshape(shape)
    frequency = np.arange(len(value)) / (count * step)
    return Spectrum(frequency, value, count, window, float(np.mean(w**2)) / gain**2)


def peaks(frequency: ArrayLike, amplitude: ArrayLike, count: int = 5, *, above: float = 0.0) -> tuple[Peak, ...]:
    """Largest local maxima, the largest first; the constant is none.

    Parameters
    ----------
    frequency, amplitude : (m,)
        A spectrum.
    count
        How many at most.
    above
        Least amplitude, in parts of the largest one.
    """
    f, a = np.asarray(frequency, dtype=float), np.asarray(amplitude, dtype=float)
    inner = a[1:]
    left = np.concatenate([[-np.inf], inner[:-1]])
    right = np.concatenate([inner[1:], [-np.inf]])
    indices = 1 + np.flatnonzero((inner > left) & (inner >= right) & (inner > 0.0))
    indices = indices[np.argsort(-a[indices], kind="stable")]
    if len(indices):
        indices = indices[a[indices] >= above * a[indices[0]]]
    return tuple(Peak(int(k), float(f[k]), float(a[k])) for k in indices[:count])


def order_lines(fundamentals: Mapping[str, float], highest: float) -> tuple[OrderLine, ...]:
    """Multiples of named frequencies (Hz) up to `highest` (Hz), ascending; of equal ones the lower order first.

    Parameters
    ----------
    fundamentals
        Name -> frequency, for example those of the shafts and of the meshes.
    """
    lines = [
        OrderLine(name, k, k * abs(f))
        for name, f in fundamentals.items()
        if f != 0.0
        for k in range(1, int(min(1000, highest / abs(f) * (1.0 + 1e-12))) + 1)
    ]
    return tuple(sorted(lines, key=lambda line: (float(f"{line.frequency:.9g}"), line.order)))


def nearest_line(frequency: float, lines: Iterable[OrderLine], within: float) -> OrderLine | None:
    """Line nearest to a frequency (Hz), no farther than `within` (Hz); of equally near ones the lowest order."""
    near = [line for line in lines if abs(line.frequency - frequency) <= within]
    return min(near, key=lambda line: (round(abs(line.frequency - frequency), 6), line.order), default=None)


def waterfall(
    values: ArrayLike, step: float, length: int, *, hop: int | None = None, window: str = "hann"
) -> Waterfall:
    """Compute the spectra of pieces of a signal.

    Parameters
    ----------
    values : array_like, shape (n,)
        The signal.
    step : float
        Time between samples (s).
    length : int
        Samples of a piece.
    hop : int, optional
        Samples from one piece to the next; half a piece by default.
    window : str
        See `WINDOWS`.

    Raises
    ------
    InputError
        For more than one signal, and a hop below one sample.
    """
    x = np.asarray(values, dtype=float)
    advance = max(1, length // 2) if hop is None else hop
    if x.ndim != 1 or advance < 1:
        raise InputError("waterfall", None, "needs one signal and a hop of one sample at least", "")
    starts = range(0, max(1, len(x) - length + 1), advance)
    parts = [amplitude_spectrum(x, step, window=window, start=s, length=length) for s in starts]
    middle = step * (np.array(starts) + 0.5 * (length - 1))
    return Waterfall(middle, parts[0].frequency, np.array([p.amplitude for p in parts]))
