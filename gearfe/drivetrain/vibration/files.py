"""All files of a vibration job: tables, summary, pictures, fields; one folder, whole or not at all."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ...base.errors import InputError, given, unknown_name
from ...base.files import whole_set, write_csv, write_json
from ...base.progress import Stopwatch
from ...base.spectrum import uniform_step, window_values
from ...base.typing import Array, IntArray
from ..gearbox import bearing_report
from ..gearbox.fields import write_gears, write_housing
from ..gearbox.radiation import REFERENCE_POWER
from ..gearbox.report import attachment_to_draw
from ..gearbox.shaft_report import misalignment_columns, shaft_entries, yielding
from ..gearbox.stage_report import stage_entries
from ..train.gear_train import GearTrain
from ..train.model import TrainModel
from ..train.response import TrainResponse
from . import analysis, deflection
from .errors import Run, with_errors
from .follow import Followed, TrainRun, follow
from .report import train_summary
from .spectra import TrainRecord, TrainSpectra, record

#: Frames of the animation, and steps of the field files at most.
FRAMES, FIELD_STEPS = 50, 101
#: Files that depend on the options: what is left of them from an earlier run is removed.
MAY_WRITE = (
    "spectrum.csv",
    "misalignment.csv",
    "response.png",
    "response_zoom.png",
    "spectrum.png",
    "radiated_power.png",
    "third_octaves.csv",
    "transmission_error.png",
    "load_share.png",
    "gears.vtkhdf",
    "housing.vtkhdf",
    "fields.png",
    "fields.gif",
    *analysis.FILES,
    bearing_report.FILE,
)


@dataclass(frozen=True)
class OutputChoice:
    """What is written beside the tables and the summary.

    Attributes
    ----------
    fields, animation
        Whether to write fields, and to draw an animation of them.
    attachment
        Name of the attachment in the pictures; None: the bore that carries the load's reaction.
    picture_time
        Time of the picture of the fields (s); None: 4.55 ms, or the end of a shorter run.
    window, spectrum_start, spectrum_length
        Record of the spectrum, see `gearfe.drivetrain.vibration.spectra.TrainRecord` (s).
    deflections
        Frequencies (Hz) of operating deflection shapes, each of which takes the nearest line.
    """

    fields: bool = False
    animation: bool = True
    attachment: str | None = None
    picture_time: float | None = None
    window: str = "none"
    spectrum_start: float = 0.0
    spectrum_length: float | None = None
    deflections: tuple[float, ...] = ()


class Pictures(Protocol):
    """Who draws a run: `gearfe.figures.train.TrainPictures`. Pictures stand above the results that they draw."""

    def curves(self, folder: Path, train: GearTrain, made: Followed, spectra: TrainSpectra, attachment: str) -> None:
        """Draw curves and spectra into a folder.

        Parameters
        ----------
        folder : Path
            Folder of the pictures.
        train : GearTrain
            The train.
        made : Followed
            The run with its curves.
        spectra : TrainSpectra
            Its spectra.
        attachment : str
            Attachment whose acceleration is drawn.
        """

    def analysis(self, folder: Path, made: analysis.Analysed, spectra: TrainSpectra | None, attachment: str) -> None:
        """Draw the analyses of [spectrum].

        Parameters
        ----------
        folder : Path
            Folder of the pictures.
        made : Analysed
            The analyses.
        spectra : TrainSpectra or None
            Computed spectra, with which measured ones are compared.
        attachment : str
            Attachment whose acceleration is drawn.
        """

    def fields(self, path: Path, train: GearTrain, response: TrainResponse, steps: IntArray) -> str:
        """Draw the fields at some output times; return an empty text, or why nothing was drawn.

        Parameters
        ----------
        path : Path
            The file.
        train : GearTrain
            The train.
        response : TrainResponse
            Its motion.
        steps : ndarray of int
            Numbers of the output steps.
        """


@dataclass(frozen=True)
class Written:
    """Names of the files, the last piece of the response, the spectra (None where the run was too short), problems of
    the drawing, the summary."""

    names: tuple[str, ...]
    response: TrainResponse
    spectra: TrainSpectra | None
    problems: tuple[str, ...]
    summary: dict[str, Any]


def check_choice(choice: OutputChoice, times: np.ndarray, attachments: tuple[str, ...]) -> None:
    """Refuse before the long computation what cannot be written after it.

    Raises
    ------
    InputError
        Unknown window or attachment, a record or a picture's time outside of the run.
    """
    _, count = record(times, choice.spectrum_start, choice.spectrum_length)
    deflection.nearest_lines(choice.deflections, count, uniform_step(times))
    window_values(choice.window, 2)
    if choice.attachment is not None and choice.attachment not in attachments:
        raise unknown_name("--attachment", choice.attachment, attachments)
    time = choice.picture_time
    if time is not None and not times[0] <= time <= times[-1]:
        problem = f"lies outside of the run, {1e3 * times[0]:g}..{1e3 * times[-1]:g} ms"
        raise InputError("--picture-ms", float(f"{1e3 * time:.12g}"), problem, "choose another time")


def write_run(
    folder: Path,
    planned: TrainRun,
    choice: OutputChoice,
    *,
    watch: Stopwatch,
    draw: Pictures | None = None,
    beside: analysis.Analysis | None = None,
) -> Written:
    """Write the tables, ``summary.json`` and what else is chosen while a run goes on.

    A run that ended early is made once more up to where it came, and gets the same files.

    Parameters
    ----------
    folder : Path
        Folder of the files.
    planned : TrainRun
        The run.
    choice : OutputChoice
        What is written.
    watch : Stopwatch
        Measures the stages.
    draw
        Draws the pictures.
    beside
        Analyses of [spectrum] beside the spectrum.
    """
    train, times = planned.model.train, planned.times
    problems: list[str] = []
    with whole_set(folder, MAY_WRITE) as target:
        passes = _Passes(planned, folder, target / "response.csv", watch, beside)
        made = passes.to_the_end(choice)
        response, spectra = made.response, made.spectra
        run = Run(train_summary(made, {}, planned.stability, **planned.further), spectra)
        if planned.again is not None:
            with watch.stage("error estimates"):
                named = tuple(run.summary.get("dominant_lines", ()))
                repeated = passes.repeated(choice, str(response.statistics["method"]), named)
                run = Run(with_errors(run, planned.model, repeated, band_hz=planned.band_hz), spectra)
        with watch.stage("tables"):
            if spectra is not None:
                write_csv(target / "spectrum.csv", spectra.columns())
                if (octaves := spectra.octaves) is not None:
                    write_csv(target / "third_octaves.csv", octaves.columns(REFERENCE_POWER))
            if tilted := yielding(planned.model):
                write_csv(target / "misalignment.csv", misalignment_columns(tilted))
        attachment = attachment_to_draw(made.curves.attachment_names, choice.attachment, train)
        if draw is not None and spectra is not None:
            with watch.stage("pictures"):
                draw.curves(target, train, made, spectra, attachment)
        if beside is not None and beside.requested and response.status != "done":
            problems.append("spectra over time and measured ones are left out: the run ended early")
        elif beside is not None and beside.requested:
            with watch.stage("spectra over time"):
                analysed = beside.write(target, spectra, attachment, None if draw is None else draw.analysis)
            run = Run({**run.summary, **analysed}, spectra)
        if choice.fields and made.outputs:
            with watch.stage("fields"):
                problems += _fields(target, train, made.kept, times[: made.outputs], choice, draw)
        if run.summary.get("bearings"):
            write_csv(target / bearing_report.FILE, bearing_report.bearing_columns(run.summary["bearings"]))
        if choice.deflections and not made.deflections:
            problems.append("deflection shapes are left out: the run ended early")
        if made.deflections:
            with watch.stage("deflection shapes"):
                deflection.write_deflections(target, train, made.response, made.deflections)
            shapes = deflection.deflection_entries(train, made.deflections)
            run = Run({**run.summary, "deflections": shapes}, spectra)
        watch.seconds["total"] = time.perf_counter() - watch.begun
        stages = stage_entries(planned.model, run.summary.get("mean_contact_forces_N"))
        summary = {**run.summary, **shaft_entries(planned.model), **stages, "timings_s": dict(watch.seconds)}
        write_json(target / "summary.json", summary)
        names = tuple(sorted(path.name for path in target.iterdir()))
    return Written(names, response, spectra, tuple(problems), summary)


@dataclass(frozen=True)
class _Passes:
    """Passes of a planned run: the one whose response is written, and those that estimate its errors.

    Attributes
    ----------
    folder, table
        For temporary files; ``response.csv``.
    beside
        Watches the pieces of the written one.
    """

    planned: TrainRun
    folder: Path
    table: Path
    watch: Stopwatch
    beside: analysis.Analysis | None

    def to_the_end(self, choice: OutputChoice) -> Followed:
        """The run with its table; one that ended early is made once more up to where it came."""
        times = self.planned.times
        made = self._followed(times, choice)
        response = made.response
        if response.status != "done" and 2 <= made.outputs < len(times):
            whole = replace(choice, spectrum_start=0.0, spectrum_length=None)
            made = replace(self._followed(times[: made.outputs], whole), response=response)
        compiling = float(response.statistics.get("compile_seconds", 0.0))
        if compiling > 0.0:
            self.watch.seconds["transient"] -= compiling
            self.watch.seconds["compiling"] = compiling
        return made

    def repeated(self, choice: OutputChoice, method: str, named: tuple[str, ...]) -> Callable[[TrainModel], Run]:
        """The numbers of the run with another train, and the spectra of the named signals."""
        times, every = self.planned.times, self.planned.every
        again = given(self.planned.again, "again")

        def run(changed: TrainModel) -> Run:
            found = follow(again(changed, method)(times), times, every, record=self._record(times, choice, named))
            return Run(train_summary(replace(found, spectra=None), {}), found.spectra)

        return run

    @property
    def _radiation(self) -> Array | None:
        """Surface matrix of the housing, where it is known."""
        housing = self.planned.model.train.housing
        return housing.radiation if housing is not None and housing.has_mesh else None

    def _followed(self, times: Array, choice: OutputChoice) -> Followed:
        keep = field_steps(times, choice) if choice.fields else None
        with self.watch.stage("transient"):
            pieces = self.planned.pieces(times)
            run = _timed(pieces if self.beside is None else self.beside.watching(pieces), self.watch)
            record = self._record(times, choice)
            return follow(
                run, times, self.planned.every, table=self.table, bearings=self.table.with_name("bearings.csv"),
                radiation=self._radiation, record=record, keep=keep, deflection=self._deflection(times, choice),
            )  # fmt: skip

    def _deflection(self, times: Array, choice: OutputChoice) -> deflection.DeflectionRecord | None:
        """What makes operating deflection shapes; None where none are asked for, or the run ended early."""
        if not choice.deflections or len(times) < len(self.planned.times):
            return None
        return deflection.DeflectionRecord(
            self.planned.model.train, times, self.planned.every, choice.deflections, window=choice.window,
            start=choice.spectrum_start, length=choice.spectrum_length,
        )  # fmt: skip

    def _record(self, times: Array, choice: OutputChoice, signals: tuple[str, ...] | None = None) -> TrainRecord | None:
        """What makes the spectra of some signals, by default of all; None for too short a run."""
        if len(times) <= 2:
            return None
        return TrainRecord(
            times,
            self.planned.every,
            self._radiation,
            window=choice.window,
            start=choice.spectrum_start,
            length=choice.spectrum_length,
            folder=self.folder,
            signals=signals,
        )


def _timed(pieces: Iterable[TrainResponse], watch: Stopwatch) -> Iterator[TrainResponse]:
    """The pieces; what is done with them is timed as ``tables`` and not as ``transient``."""
    for piece in pieces:
        handed = time.perf_counter()
        yield piece
        elapsed = time.perf_counter() - handed
        watch.seconds["tables"] = watch.seconds.get("tables", 0.0) + elapsed
        watch.seconds["transient"] = watch.seconds.get("transient", 0.0) - elapsed


def field_steps(times: Array, choice: OutputChoice) -> IntArray:
    """Numbers of the output times that the files and pictures of the fields show, rising."""
    series, still, film = _shown(times, choice)
    return np.unique(np.concatenate([series, [still], film]))


def _shown(times: Array, choice: OutputChoice) -> tuple[IntArray, int, IntArray]:
    """Output times of the series, of the picture, and of the animation."""
    last = len(times) - 1
    series = np.arange(0, last + 1, max(1, -(-last // (FIELD_STEPS - 1))))
    requested = 4.55e-3 if choice.picture_time is None else choice.picture_time
    film = np.unique(np.linspace(0, last, min(FRAMES, last + 1)).round().astype(np.int64))
    return series, int(np.abs(times - requested).argmin()), film


def _fields(
    target: Path,
    train: GearTrain,
    kept: TrainResponse,
    times: Array,
    choice: OutputChoice,
    draw: Pictures | None,
) -> list[str]:
    """Write and draw the fields of the response at the output times of `field_steps`."""
    steps = field_steps(times, choice)
    series, still, film = (np.searchsorted(steps, some) for some in _shown(times, choice))
    write_gears(target / "gears.vtkhdf", train, kept, series)
    if train.housing is not None and train.housing.has_mesh:
        write_housing(target / "housing.vtkhdf", train.housing, kept, series)
    if draw is None:
        return []
    problem = draw.fields(target / "fields.png", train, kept, still[None])
    if choice.animation and not problem:
        problem = draw.fields(target / "fields.gif", train, kept, film)
    return [f"fields were not drawn: {problem}"] if problem else []
