"""Files of the modes of a train, all or none."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ...base.errors import InputError
from ...base.files import whole_set, write_csv, write_json
from ..gearbox import bearing_report
from ..gearbox.shaft_report import shaft_entries
from ..gearbox.stage_report import stage_entries
from . import report
from .critical import Campbell
from .energies import HOUSING
from .job import ModesResult
from .swinging import write_modes
from .whirl import STRONG, WhirlModes

#: All that a run can write.
FILES = (
    "modes.csv", "critical_speeds.csv", "summary.json", "campbell.png", "mode_gears.vtkhdf", "mode_housing.vtkhdf",
    bearing_report.FILE,
)  # fmt: skip


class Pictures(Protocol):
    """Who draws the modes: `figures.campbell.draw_campbell`. Pictures stand above the results that they draw."""

    def __call__(self, path: Path, found: Campbell, title: str) -> None:
        """Draw the Campbell diagram."""


def write_modes_result(
    folder: Path, result: ModesResult, *, fields: Sequence[int] | None, draw: Pictures | None, title: str, watch: Any,
    further: Mapping[str, Any],
) -> tuple[dict[str, Any], list[str]]:  # fmt: skip
    """Write tables, the Campbell diagram, fields and the summary, all or none.

    Parameters
    ----------
    folder : Path
        Folder of the files.
    result : ModesResult
        The modes.
    fields : sequence of int or None
        Numbers, from 1, of the modes that are written as fields; none given: those in which shafts move by themselves
        or meshes strain; None: no fields.
    draw : Pictures or None
        Draws the diagram; None: there is none.
    title : str
        Second line of its heading.
    watch : Stopwatch
        Measures the stages.
    further : mapping
        Entries of the summary that describe the job.

    Returns
    -------
    summary : dict
        Content of summary.json.
    names : list of str
        Names of the files.

    Raises
    ------
    InputError
        For the number of a mode that is not there.
    """
    modes = result.campbell.modes
    chosen = None if fields is None else chosen_modes(modes, fields)
    with whole_set(folder, may_write=FILES) as target:
        with watch.stage("tables"):
            for name, columns in report.tables(result.campbell).items():
                write_csv(target / f"{name}.csv", columns)
        if draw is not None:
            with watch.stage("pictures"):
                draw(target / "campbell.png", result.campbell, title)
        if chosen:
            with watch.stage("fields"):
                write_modes(target, result.model, modes, chosen, result.speed)
        bearings = bearing_report.bearing_summary(result.model.operating)
        if bearings:
            write_csv(target / bearing_report.FILE, bearing_report.bearing_columns(bearings))
        parts = {"bearings": bearings, **shaft_entries(result.model), **stage_entries(result.model)}
        summary = {**further, **parts, **report.summary(result), "warnings": report.warnings(result)}
        summary["timings_s"] = dict(watch.seconds)
        write_json(target / "summary.json", summary)
        names = sorted(path.name for path in target.iterdir())
    return summary, names


def chosen_modes(modes: WhirlModes, numbers: Sequence[int]) -> list[int]:
    """Numbers, from 0, of the modes with the given numbers from 1; without any, of those that are not the housing's."""
    count, row = modes.frequency.shape[1], modes.fastest
    for number in numbers:
        if not 1 <= number <= count:
            cure = f"choose 1 to {count}, or a higher band_Hz" if count else "take a higher band_Hz"
            raise InputError("--fields", number, f"is no number of a mode: there are {count} up to the band", cure)
    if numbers:
        return [number - 1 for number in dict.fromkeys(numbers)]
    strained = modes.mesh_strain[row].sum(axis=1) >= STRONG
    moves = np.array([kind != HOUSING for kind in modes.kinds[row]], dtype=bool)
    return np.flatnonzero(strained | moves).tolist()
