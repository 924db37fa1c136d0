"""All files of a vibration job: tables, summary, pictures, fields; one folder, whole or not at all."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..output.files import whole_set, write_csv, write_json
from ..stopwatch import Stopwatch
from ..train.response import TrainResponse
from ..train.scene import TrainScene
from .report import train_summary
from .spectra import TrainSpectra, record, response_columns, spectra

#: Frames of the animation, and steps of the field files at most.
FRAMES, FIELD_STEPS = 50, 101
#: Files that depend on the options: what is left of them from an earlier run is removed.
MAY_WRITE = (
    "spectrum.csv",
    "response.png",
    "spectrum.png",
    "radiated_power.png",
    "gears.vtkhdf",
    "housing.vtkhdf",
    "fields.png",
    "fields.gif",
)


@dataclass(frozen=True)
class OutputChoice:
    """What is written beside the tables and the summary.

    Attributes
    ----------
    pictures, fields, animation
        Whether to draw curves and spectra, to write fields with a picture, and the animation.
    attachment
        Name of the attachment in the pictures; None: the bore that carries the load's reaction.
    picture_time
        Time of the picture of the fields (s); None: 4.55 ms, or the end of a shorter run.
    window, spectrum_start, spectrum_length
        Record of the spectrum, see `gearfe.vibration.spectra.TrainRecord` (s).
    """

    pictures: bool = True
    fields: bool = False
    animation: bool = True
    attachment: str | None = None
    picture_time: float | None = None
    window: str = "none"
    spectrum_start: float = 0.0
    spectrum_length: float | None = None


@dataclass(frozen=True)
class Written:
    """Names of the files, the spectra (None where the run was too short), problems of the drawing, the summary."""

    names: tuple[str, ...]
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
    from ..errors import unknown_name
    from ..spectrum import window_values

    record(times, choice.spectrum_start, choice.spectrum_length)
    window_values(choice.window, 2)
    if choice.attachment is not None and choice.attachment not in attachments:
        raise unknown_name("--attachment", choice.attachment, attachments)
    time = choice.picture_time
    if time is not None and not times[0] <= time <= times[-1]:
        problem = f"lies outside of the run, {1e3 * times[0]:g}..{1e3 * times[-1]:g} ms"
        raise InputError("--picture-ms", float(f"{1e3 * time:.12g}"), problem, "choose another time")


def write_all(
    folder: Path,
    scene: TrainScene,
    response: TrainResponse,
    choice: OutputChoice,
    *,
    title: str,
    watch: Stopwatch,
    every: int = 1,
    further: Mapping[str, Any] | None = None,
    progress: Callable[[int, int, str], None] | None = None,
    started: float | None = None,
) -> Written:
    """Write ``response.csv``, ``spectrum.csv``, ``summary.json`` and what else is chosen.

    `every` samples of the response make an output step. A run that ended early gets the same files, as far as it came.
    With `started` (of `time.perf_counter`) the watch gets the total.
    """
    radiation = None if scene.housing is None else scene.housing.radiation
    made = None
    with watch.stage("spectra"):
        if response.status == "done":
            first, duration = choice.spectrum_start, choice.spectrum_length
            made = spectra(response, radiation, every=every, window=choice.window, start=first, length=duration)
        elif len(response.time) > 3 * every:
            made = spectra(response, radiation, every=every, window=choice.window)
    problems: list[str] = []
    outputs = response.every(every)
    with whole_set(folder, MAY_WRITE) as target:
        with watch.stage("tables"):
            write_csv(target / "response.csv", _lists(response_columns(outputs, radiation)))
            if made is not None:
                write_csv(target / "spectrum.csv", _lists(made.columns()))
        if choice.pictures and made is not None:
            with watch.stage("pictures"):
                _pictures(target, scene, response, made, choice, title)
        if choice.fields:
            with watch.stage("fields"):
                problems += _fields(target, scene, outputs, choice, title, progress)
        if started is not None:
            watch.seconds["total"] = time.perf_counter() - started
        summary = train_summary(response, made, watch.seconds, **(further or {}))
        write_json(target / "summary.json", summary)
        names = tuple(sorted(path.name for path in target.iterdir()))
    return Written(names, made, tuple(problems), summary)


def _lists(columns: Mapping[str, np.ndarray]) -> dict[str, list[float]]:
    return {name: values.tolist() for name, values in columns.items()}


def _pictures(
    target: Path, scene: TrainScene, response: TrainResponse, made: TrainSpectra, choice: OutputChoice, title: str
) -> None:
    from .pictures import attachment_to_draw, draw_power, draw_response, draw_spectrum

    loaded = next((load.bore for load in scene.loads if load.bore is not None), None)
    attachment = attachment_to_draw(response, choice.attachment, loaded)
    draw_response(target / "response.png", response, attachment, title)
    draw_spectrum(target / "spectrum.png", response, made, attachment, title)
    if made.power is not None:
        draw_power(target / "radiated_power.png", response, made, title)


def _fields(
    target: Path,
    scene: TrainScene,
    response: TrainResponse,
    choice: OutputChoice,
    title: str,
    progress: Callable[[int, int, str], None] | None,
) -> list[str]:
    from ..output.train_scene import draw_scene
    from .fields import frames, step_at, write_gears, write_housing

    last = len(response.time) - 1
    stride = max(1, -(-last // (FIELD_STEPS - 1)))
    steps = np.arange(0, last + 1, stride)
    write_gears(target / "gears.vtkhdf", scene, response, steps)
    if scene.housing is not None:
        write_housing(target / "housing.vtkhdf", scene.housing, response, steps, progress=progress)
    wanted = min(4.55e-3, float(response.time[-1])) if choice.picture_time is None else choice.picture_time
    still = step_at(response, min(wanted, float(response.time[-1])))
    problem = draw_scene(target / "fields.png", frames(scene, response, [still]), title)
    if choice.animation and not problem:
        film = np.unique(np.linspace(0, last, min(FRAMES, last + 1)).round().astype(int))
        problem = draw_scene(target / "fields.gif", frames(scene, response, film), title)
    return [f"fields were not drawn: {problem}"] if problem else []
