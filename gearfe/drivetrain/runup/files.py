"""Files of a run-up, all or none."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from ...base.files import whole_set, write_csv, write_json
from ...output.arrays import save_arrays
from ..gearbox import bearing_report
from ..gearbox.report import attachment_to_draw
from ..gearbox.shaft_report import misalignment_columns, shaft_entries, yielding
from ..gearbox.stage_report import stage_entries
from ..modes.swinging import mesh_modes, write_modes
from . import report
from .critical import CriticalSpeeds, critical_speeds
from .instability import InstabilityMap
from .run_up import RunUp

#: All that a run can write.
FILES = (
    "runup.csv", "orders.csv", "waterfall.csv", "waterfall.npz", "modes.csv", "critical_speeds.csv", "summary.json",
    "misalignment.csv",
    "waterfall.png", "bearing_forces.png", "campbell.png", "orders.png", "meshes.png",
    "instability.csv", "instability.png", "mode_gears.vtkhdf", "mode_housing.vtkhdf", bearing_report.FILE,
)  # fmt: skip


class Pictures(Protocol):
    """Who draws a run-up: `figures.runup.RunUpPictures`. Pictures stand above the results that they draw."""

    def __call__(self, folder: Path, run: RunUp, critical: CriticalSpeeds, multiples: int, bore: int) -> None:
        """Draw into a folder."""

    def instability(self, path: Path, made: InstabilityMap) -> None:
        """Draw the map of parametric instability."""


@dataclass(frozen=True)
class RunUpChoice:
    """Outputs of a run-up: highest multiples of the mesh frequencies and of the shafts' turns, the attachment whose
    acceleration is drawn, and whether the modes with much strain in the meshes are written as fields.
    """

    multiples: int
    attachment: str | None = None
    fields: bool = False
    shaft_multiples: int = 2


def write_runup(
    folder: Path, run: RunUp, choice: RunUpChoice, *, draw: Pictures | None, watch: Any,
    further: Mapping[str, Any], unstable: InstabilityMap | None = None,
) -> tuple[dict[str, Any], list[str]]:  # fmt: skip
    """Write tables, pictures and the summary of a run-up, all or none.

    Parameters
    ----------
    folder : Path
        Folder of the files.
    run : RunUp
        The run-up.
    choice : RunUpChoice
        What is written.
    draw : Pictures or None
        Draws the pictures; None: there are none.
    watch : Stopwatch
        Measures the stages.
    further : mapping
        Entries of the summary that describe the job.
    unstable : InstabilityMap, optional
        Map of parametric instability.

    Returns
    -------
    summary : dict
        Content of summary.json.
    names : list of str
        Names of the files.
    """
    multiples, model = choice.multiples, run.train.model
    bore = model.bores.index(attachment_to_draw(model.bores, choice.attachment, model.train))
    with watch.stage("modes"):
        critical = critical_speeds(run, multiples, choice.shaft_multiples)
    with whole_set(folder, may_write=FILES) as target:
        with watch.stage("tables"):
            for name, columns in report.tables(run, critical, multiples, unstable).items():
                write_csv(target / f"{name}.csv", columns)
            if tilted := yielding(model):
                write_csv(target / "misalignment.csv", misalignment_columns(tilted))
            save_arrays(target / "waterfall.npz", report.waterfall(run))
        if draw is not None:
            with watch.stage("pictures"):
                draw(target, run, critical, multiples, bore)
                if unstable is not None:
                    draw.instability(target / "instability.png", unstable)
        modes = critical.campbell.modes
        if choice.fields and (chosen := mesh_modes(modes)):
            with watch.stage("fields"):
                write_modes(target, model, modes, chosen, float(run.speeds[-1]))
        bearings = bearing_report.bearing_summary(model.operating)
        if bearings:
            write_csv(target / bearing_report.FILE, bearing_report.bearing_columns(bearings))
        results = {
            "bearings": bearings,
            **shaft_entries(model),
            **stage_entries(model),
            **report.summary(run, critical),
        }
        summary = {**further, **results, "warnings": report.warnings(run)}
        summary["timings_s"] = dict(watch.seconds)
        write_json(target / "summary.json", summary)
        names = sorted(path.name for path in target.iterdir())
    return summary, names
