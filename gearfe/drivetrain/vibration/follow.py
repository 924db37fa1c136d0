"""What is kept of a run whose pieces go by: its table, its spectra, means and extremes, curves and fields to draw."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import InputError
from ...base.files import Table, csv_table
from ...base.typing import Array, IntArray
from ..gearbox.stability import NOT_COMPUTED, Stability
from ..train.model import TrainModel
from ..train.response import TrainResponse, joined
from .deflection import Deflection, DeflectionRecord
from .spectra import TrainRecord, TrainSpectra, response_columns

#: Parts of the curves in a picture: more than it has columns of pixels.
DRAWN = 4000
#: Samples that a spline through a piece shares with the piece before.
_SHARED = 3


@dataclass(frozen=True)
class TrainRun:
    """A transient that is computed when its pieces are taken.

    Attributes
    ----------
    model
        The train.
    times : (n,)
        Output times (s).
    pieces
        Makes the run over the given output times, `every` samples in a step, and hands it over piece by piece.
    further
        Entries of the summary.
    again
        Makes the same of a changed train by the method that the run took: the summary's numbers then have estimates
        of their errors.
    band_hz
        Upper end of the band (Hz) for which the reduction's error holds.
    stability
        Of the steady motion.
    """

    model: TrainModel
    times: Array
    pieces: Callable[[Array], Iterable[TrainResponse]]
    every: int = 1
    further: Mapping[str, Any] = field(default_factory=dict)
    again: Callable[[TrainModel, str], Callable[[Array], Iterable[TrainResponse]]] | None = None
    band_hz: float = 5000.0
    stability: Stability = NOT_COMPUTED


@dataclass(frozen=True, eq=False)
class Followed:
    """What is kept of a run.

    Attributes
    ----------
    response
        The last piece: what is no sample holds for the whole run.
    outputs
        Number of output times.
    least_force, least_loaded_force, largest_force, mean_force : (meshes,)
        Of all samples (N); under load: after the load's ramps; the mean over `periods` common mesh periods at the end.
    mean_power, mean_loss : (meshes,)
        Power that drivers give to the meshes and that friction takes (W), over the same times.
    periods
        Whole periods of the mean, 0 where it is over all times under load.
    peak_acceleration, start_acceleration : (attachments,)
        Largest size, and size at the first sample (m/s2).
    curves
        The response for pictures: all samples, or the least and the largest ones of equal parts of the run.
    kept
        The response at the output times that are kept.
    spectra
        None where the run was too short.
    deflections
        Operating deflection shapes that were asked for.
    """

    response: TrainResponse
    outputs: int
    least_force: Array
    least_loaded_force: Array
    largest_force: Array
    mean_force: Array
    mean_power: Array
    mean_loss: Array
    periods: int
    peak_acceleration: Array
    start_acceleration: Array
    curves: TrainResponse
    kept: TrainResponse
    spectra: TrainSpectra | None
    deflections: tuple[Deflection, ...] = ()


def follow(
    pieces: Iterable[TrainResponse],
    times: Array,
    every: int,
    *,
    table: Path | None = None,
    bearings: Path | None = None,
    radiation: Array | None = None,
    record: TrainRecord | None = None,
    keep: IntArray | None = None,
    deflection: DeflectionRecord | None = None,
) -> Followed:
    """Follow a run to its end; each piece is dropped when the next one comes.

    Parameters
    ----------
    pieces
        Samples of the response, `every` of them in an output step.
    times : (n,)
        Output times (s) of the whole run.
    every : int
        Samples of the response in an output step.
    table
        File to write: ``response.csv``; None for none.
    bearings
        File to write: ``bearings.csv``; None for none.
    radiation
        Surface matrix of the housing.
    record
        Makes the spectra.
    keep
        Numbers of output times whose response is kept, rising.
    deflection
        Makes operating deflection shapes.

    Raises
    ------
    InputError
        When there is no piece.
    """
    numbers = np.zeros(0, dtype=np.int64) if keep is None else every * keep
    envelope = Envelope(every * (len(times) - 1) + 1)
    extremes: _Extremes | None = None
    kept: list[TrainResponse] = []
    passed = 0
    with _table(table) as written, _table(bearings) as loads:
        for piece in pieces:
            if extremes is None:
                mean = RunningMean(times, piece.load_end_s, piece.common_period_s)
                extremes = _Extremes(piece)
            count = len(piece.time)
            if written is not None:
                written.write(response_columns(piece.every(every, -passed % every), radiation))
            if loads is not None:
                loads.write(piece.every(every, -passed % every).bearing_columns())
            if record is not None and count:
                record.add(piece)
            if deflection is not None and count:
                deflection.add(piece)
            envelope.add(passed, _drawn(piece))
            mean.add(piece.time, np.hstack([piece.contact_force, piece.mesh_power, piece.friction_power]))
            extremes.add(piece)
            inside = numbers[(numbers >= passed) & (numbers < passed + count)]
            kept.append(piece.at(inside - passed))
            passed += count
    if extremes is None:
        raise InputError("response", None, "the run has no piece", "give the response")
    force, power, loss = np.split(mean.value, 3)
    return Followed(
        piece,
        (passed + every - 1) // every,
        extremes.least,
        extremes.least_loaded if np.isfinite(extremes.least_loaded).all() else extremes.least,
        extremes.largest,
        force,
        power,
        loss,
        mean.periods,
        extremes.peak,
        extremes.start,
        _curves(piece, envelope.values()),
        joined(kept),
        record.spectra() if record is not None and record.complete else None,
        deflection.deflections() if deflection is not None else (),
    )


def _table(path: Path | None) -> AbstractContextManager[Table | None]:
    """A table that is written piece by piece, or none."""
    return nullcontext() if path is None else csv_table(path, gaps=False)


class RunningMean:
    """Mean over the last whole periods after `begin` of values that arrive piece by piece.

    The integral is that of cubics through the samples, so its ends need not lie on them. Without a complete period the
    mean is that of all times after `begin`, at least of the last step, and `periods` is 0.

    Parameters
    ----------
    times : (n,)
        Times of the run (s), of which the last two count.
    begin
        Where the start-up ends (s).
    period
        Common period (s) or None.
    """

    def __init__(self, times: Array, begin: float, period: float | None) -> None:
        end = float(times[-1])
        self.periods = 0 if not period else max(0, int((end - begin) / period * (1.0 + 1e-12)))
        low = end - self.periods * period if self.periods and period else min(begin, float(times[-2]))
        self._low = max(low, float(times[0]))
        self._total: Array | float = 0.0
        self._last: tuple[Array, Array] | None = None
        self._from = self._to = self._low

    def add(self, time: Array, values: Array) -> None:
        """Go on with samples (n,), (n, k)."""
        if not len(time):
            return
        if self._last is not None:
            time, values = (np.concatenate([one, two]) for one, two in zip(self._last, (time, values), strict=True))
        self._last = time[-_SHARED:], values[-_SHARED:]
        end = float(time[-1])
        if len(time) > 1 and end > self._to:
            self._total = self._total + _integral(time, values, max(self._to, float(time[0])))
            self._to = end

    @property
    def value(self) -> Array:
        """(k,) the mean; NaN where the run ended before the times that it is taken over."""
        if not self._to > self._from:
            return np.full(0 if self._last is None else self._last[1].shape[1], np.nan)
        return np.asarray(self._total) / (self._to - self._from)


def _integral(time: Array, values: Array, begin: float) -> Array:
    """From `begin` to the last of the times, (k,), of the cubics through samples (n, k) with slopes by differences."""
    at = max(int(np.searchsorted(time, begin, side="right")) - 1, 0)
    slope = np.gradient(values, time, axis=0, edge_order=2 if len(time) > 2 else 1)
    h = np.diff(time)[:, None]
    whole = 0.5 * h * (values[:-1] + values[1:]) + h * h / 12.0 * (slope[:-1] - slope[1:])
    x, h0 = begin - time[at], float(h[at, 0])  # less the part of its interval before `begin`
    rise, (m0, m1) = (values[at + 1] - values[at]) / h0, slope[at : at + 2]
    c2, c3 = (3.0 * rise - 2.0 * m0 - m1) / h0, (m0 + m1 - 2.0 * rise) / h0**2
    before = x * (values[at] + x * (m0 / 2.0 + x * (c2 / 3.0 + x * c3 / 4.0)))
    return np.asarray(whole[at:].sum(axis=0) - before)


class _Extremes:
    """Least and largest forces and accelerations so far."""

    def __init__(self, first: TrainResponse) -> None:
        meshes, push = first.contact_force.shape[1], np.abs(first.attachment_acceleration)
        self.least, self.least_loaded = np.full((2, meshes), np.inf)
        self.largest, self.peak = np.full(meshes, -np.inf), np.zeros(push.shape[1])
        self.start = push[:1].sum(axis=0)

    def add(self, piece: TrainResponse) -> None:
        force, push = piece.contact_force, np.abs(piece.attachment_acceleration)
        self.least = np.minimum(self.least, _min(force))
        self.least_loaded = np.minimum(self.least_loaded, _min(force[piece.time >= piece.load_end_s]))
        self.largest = np.maximum(self.largest, -_min(-force))
        self.peak = np.maximum(self.peak, -_min(-push))


def _min(values: Array) -> Array:
    return np.asarray(values.min(axis=0, initial=np.inf))


class Envelope:
    """Least and largest values of signals in equal parts of a run, or the samples where these are few.

    Parameters
    ----------
    samples
        Of the whole run.
    parts
        At most.
    """

    def __init__(self, samples: int, parts: int = DRAWN) -> None:
        self.width = -(-samples // parts)
        self._number = -1  # of the part under way
        self._rows: list[Array] = []

    def add(self, first: int, values: Array) -> None:
        """Take samples (n, k) whose first is number `first` of the run."""
        if not len(values):
            return
        if self.width == 1:
            self._rows.append(np.array(values))
            return
        number = (first + np.arange(len(values))) // self.width
        starts = np.flatnonzero(np.diff(number, prepend=number[0] - 1))
        low, high = np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)
        both = np.stack([low, high], axis=1)
        if number[0] == self._number:
            before = self._rows[-1][-1:]
            both[0] = np.minimum(both[0, 0], before[0, 0]), np.maximum(both[0, 1], before[0, 1])
            self._rows[-1] = self._rows[-1][:-1]
        self._number = int(number[-1])
        self._rows.append(both)

    def values(self) -> Array:
        """(rows, k) samples, or two rows a part: the least and the largest values."""
        if not self._rows:
            return np.zeros((0, 0))
        whole = np.concatenate(self._rows)
        return whole if self.width == 1 else whole.reshape(-1, whole.shape[-1])


#: What the pictures draw.
_CURVES = (
    "drive_angle", "contact_force", "transmission_error", "apart", "speed", "acceleration", "attachment_acceleration",
)  # fmt: skip


def _drawn(piece: TrainResponse) -> Array:
    return np.column_stack([piece.time, *(getattr(piece, name) for name in _CURVES)])


def _curves(piece: TrainResponse, values: Array) -> TrainResponse:
    """The response whose curves are the columns of `_drawn`."""
    empty = piece.every(1, len(piece.time))
    if not len(values):
        return empty
    widths = [1] + [1 if getattr(piece, n).ndim == 1 else getattr(piece, n).shape[1] for n in _CURVES]
    parts = np.split(values, np.cumsum(widths)[:-1], axis=1)
    made: dict[str, Any] = dict(zip(("time", *_CURVES), parts, strict=True))
    made |= {name: made[name][:, 0] for name in ("time", "drive_angle")}
    return replace(empty, **made)
