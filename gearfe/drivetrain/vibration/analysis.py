"""Analyses of ``[spectrum]`` beside the spectrum: over short times, orders over a run-up, measured ones beside."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...base.files import write_csv
from ...base.spectrum import Waterfall
from ...base.typing import Array
from ..gearbox.job import TrainJob
from ..train import build_train
from ..train.gear_train import GearTrain
from ..train.response import TrainResponse
from .measured import Measured, read_measured
from .run import repeater
from .short_time import OrderTracks, Tracked, averaged, check_part, check_turns, order_tracks, short_time, steady_from
from .spectra import TrainSpectra

#: Multiples of the meshes' orders that are tracked where none are named.
MULTIPLES = 3
#: Files that an analysis may write.
FILES = (
    "spectrogram.csv", "spectrogram.png", "spectrum_averaged.csv", "order_tracks.csv", "order_tracks.png",
    "measured.csv", "measured.png",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Analysed:
    """What an analysis found.

    Attributes
    ----------
    names
        Signals, as in response.csv.
    falls
        Spectra over short times, one a signal; none where not requested.
    average
        (lines, signals) of these, from `start` (s) on, over so many `parts`.
    tracks
        Orders; None where not requested.
    mesh_orders
        Turns of the first shaft that turns after which each mesh repeats once, inverted.
    measured
        Measured spectra, and the computed one at each of their attachments.
    """

    names: tuple[str, ...]
    falls: list[Waterfall]
    average: Array
    parts: int
    start: float
    tracks: OrderTracks | None
    mesh_orders: Array
    measured: tuple[Measured, ...]


class Analysis:
    """Follows a run beside its files.

    Parameters
    ----------
    job, train
        The job and its train.
    every
        Samples of the response in an output step.
    start
        Begin of the spectrum's record (s).

    Raises
    ------
    InputError
        Measured files that cannot be read, or name attachments that the train does not have; parts and turns that
        are longer than the run.
    """

    def __init__(self, job: TrainJob, train: GearTrain, every: int, start: float) -> None:
        self.table, self.train, self.every, self.start = job.spectrum, train, every, start
        self._step = 1e-6 * job.table.step_us
        self.measured = read_measured(job)
        turning = train.kinematics
        #: turns of the first shaft that turns for one of the drive
        self.ratio = float(turning.ratios[turning.first_turning])
        self.mesh_orders = np.array([float(c) for c in turning.cycles]) / abs(self.ratio)
        self._tracked: Tracked | None = None
        if self.table.short_time_ms is not None:  # refused before the long computation
            check_part(1e-3 * self.table.short_time_ms, self._step, float(job.times[-1]))
        if self.table.order_turns is not None:
            check_turns(self.ratio * train.driven.speed.integral()(job.times), self.table.order_turns)

    @property
    def requested(self) -> bool:
        """Whether any analysis is requested."""
        return bool(self.measured) or self._over_time

    @property
    def _over_time(self) -> bool:
        return self.table.short_time_ms is not None or self.table.order_turns is not None

    def watching(self, pieces: Iterable[TrainResponse]) -> Iterator[TrainResponse]:
        """The pieces as they go by."""
        self._tracked = Tracked(self.every, self._step) if self._over_time else None
        for piece in pieces:
            if self._tracked is not None:
                self._tracked.add(piece)
            yield piece

    def made(self) -> Analysed:
        """What was found, when the run has gone by.

        Raises
        ------
        InputError
            Parts or turns that are longer than the run.
        """
        falls: list[Waterfall] = []
        average, parts, tracks = np.zeros((0, 0)), 0, None
        names: tuple[str, ...] = ()
        if self._tracked is not None:
            time, angle, values = self._tracked.finished()
            names, table = self._tracked.names, self.table
            if table.short_time_ms is not None:
                falls = short_time(values, self._tracked.step, 1e-3 * table.short_time_ms)
                lines = falls[0].frequency <= self._tracked.highest * (1.0 + 1e-12)
                falls = [Waterfall(time[0] + f.time, f.frequency[lines], f.amplitude[:, lines]) for f in falls]
                columns = [averaged(fall, self.start) for fall in falls]
                average, parts = np.column_stack([one for one, _ in columns]), columns[0][1]
            if table.order_turns is not None:
                orders = np.array(table.orders) if table.orders else self._orders()
                turned = self.ratio * angle
                tracks = order_tracks(time, turned, values, orders, table.order_turns, self._tracked.highest)
        return Analysed(names, falls, average, parts, self.start, tracks, self.mesh_orders, self.measured)

    def _orders(self) -> Array:
        return np.unique(np.outer(self.mesh_orders, np.arange(1, MULTIPLES + 1)).round(9))

    def write(
        self,
        folder: Path,
        spectra: TrainSpectra | None,
        attachment: str,
        draw: Callable[[Path, Analysed, TrainSpectra | None, str], None] | None,
    ) -> dict[str, Any]:
        """Write tables and pictures of the analyses into a folder; return entries of the summary.

        Parameters
        ----------
        folder : Path
            The folder.
        spectra : TrainSpectra or None
            Computed spectra, with which measured ones are compared.
        attachment : str
            Attachment in the pictures.
        draw : callable or None
            ``draw(folder, analysed, spectra, attachment)`` adds pictures.
        """
        made = self.made()
        entries: dict[str, Any] = {}
        if made.falls:
            write_csv(folder / "spectrogram.csv", spectrogram_columns(made))
            names = [f"{name}_rms_amplitude" for name in made.names]
            columns = {"frequency_Hz": made.falls[0].frequency, **dict(zip(names, made.average.T, strict=True))}
            write_csv(folder / "spectrum_averaged.csv", columns)
            entries["spectrogram"] = {"parts": len(made.falls[0].time), "averaged_parts": made.parts}
        if made.tracks is not None:
            write_csv(folder / "order_tracks.csv", track_columns(made))
            entries["order_tracks"] = {"parts": len(made.tracks.time), "orders": made.tracks.orders.tolist()}
        if made.measured:
            write_csv(folder / "measured.csv", measured_columns(made))
            entries["measured"] = [self._compared(one, spectra) for one in made.measured]
        if draw is not None and entries:
            draw(folder, made, spectra, attachment)
        return entries

    def _compared(self, one: Measured, spectra: TrainSpectra | None) -> dict[str, Any]:
        """Rms of a measured spectrum, and of the computed one in the same band."""
        found: dict[str, Any] = {"name": one.name, "attachment": one.attachment}
        low, high = float(one.frequency[one.frequency > 0.0].min()), float(one.frequency[-1])
        found |= {"from_Hz": low, "to_Hz": high, "measured_rms_m_per_s2": _rms(one.amplitude[one.frequency > 0.0])}
        if spectra is not None:
            frequency = spectra.spectrum.frequency
            lines = (frequency >= low * (1.0 - 1e-9)) & (frequency <= high * (1.0 + 1e-9)) & (frequency > 0.0)
            amplitude = spectra.amplitude(f"attachment_{one.attachment}_acceleration_m_per_s2")[lines]
            found["computed_rms_m_per_s2"] = _rms(amplitude) / math.sqrt(spectra.spectrum.noise_bandwidth)
        return found


def _rms(amplitude: Array) -> float:
    return math.sqrt(0.5 * float((np.asarray(amplitude) ** 2).sum()))


def steady_start(job: TrainJob, train: GearTrain, every: int) -> float:
    """Time (s) from which a run is steady, from a rough one; see `gearfe.drivetrain.vibration.short_time.steady_from`.

    Raises
    ------
    InputError
        When it is not steady for its last quarter.
    """
    tracked, period = Tracked(every, 1e-6 * job.table.step_us), None
    for piece in repeater(job, every)(build_train(train), job.table.method)(job.times):
        tracked.add(piece)
        period = piece.common_period_s
    time, _, values = tracked.finished()
    kinds = ("contact_force", "transmission_error", "attachment")
    groups = [values[:, [i for i, name in enumerate(tracked.names) if name.startswith(kind)]] for kind in kinds]
    start = steady_from(time, [group for group in groups if group.shape[1]], period)
    last = job.times[np.searchsorted(job.times, start * (1.0 - 1e-12), side="left")]
    return float(last)


def record_start(job: TrainJob, train: GearTrain, every: int, watch: Callable[[str], Any]) -> float:
    """Return the begin of the spectrum's record (s), given or where the motion is found to be steady.

    Parameters
    ----------
    job : TrainJob
        The train's job.
    train : GearTrain
        Its train.
    every : int
        Samples of the response in an output step.
    watch : callable
        ``watch(name)`` measures a stage.

    Raises
    ------
    InputError
        If no begin is given and the motion is not steady for its last quarter.
    """
    if job.spectrum.start is not None:
        return job.spectrum.start
    with watch("steady part"):
        return steady_start(job, train, every)


def spectrogram_columns(made: Analysed) -> dict[str, Any]:
    """Columns of spectrogram.csv: a row for each part and frequency."""
    fall = made.falls[0]
    columns: dict[str, Any] = {
        "time_s": np.repeat(fall.time, len(fall.frequency)),
        "frequency_Hz": np.tile(fall.frequency, len(fall.time)),
    }
    return columns | {name: one.amplitude.ravel() for name, one in zip(made.names, made.falls, strict=True)}


def track_columns(made: Analysed) -> dict[str, Any]:
    """Columns of order_tracks.csv: a row for each order and part; NaN above the band is an empty cell."""
    assert made.tracks is not None
    t = made.tracks
    count = len(t.orders)
    columns: dict[str, Any] = {
        "order": np.repeat(t.orders, len(t.time)),
        "time_s": np.tile(t.time, count),
        "speed_rad_per_s": np.tile(t.speed, count),
        "frequency_Hz": np.outer(t.orders, np.abs(t.speed)).ravel() / (2.0 * math.pi),
    }
    size = np.abs(t.amplitude).transpose(1, 0, 2).reshape(count * len(t.time), -1)
    return columns | {name: size[:, i] for i, name in enumerate(made.names)}


def measured_columns(made: Analysed) -> dict[str, Any]:
    """Columns of measured.csv: a row for each line of each measured spectrum."""
    return {
        "name": [one.name for one in made.measured for _ in one.frequency],
        "attachment": [one.attachment for one in made.measured for _ in one.frequency],
        "frequency_Hz": np.concatenate([one.frequency for one in made.measured]),
        "acceleration_m_per_s2": np.concatenate([one.amplitude for one in made.measured]),
    }
