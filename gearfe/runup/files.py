"""Files of a run-up, all or none."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..output.arrays import save_arrays
from ..output.files import whole_set, write_csv, write_json
from . import pictures, report
from .instability import InstabilityMap
from .modes import coupled_modes, crossings
from .run_up import RunUp

#: Speeds of the Campbell diagram.
CAMPBELL = 7
#: All that a run can write.
FILES = (
    "runup.csv", "orders.csv", "waterfall.csv", "waterfall.npz", "modes.csv", "critical_speeds.csv", "summary.json",
    "waterfall.png", "campbell.png", "orders.png", "meshes.png",
    "instability.csv", "instability.png",
)  # fmt: skip


def write_runup(
    folder: Path, run: RunUp, *, multiples: int, title: str, attachment: str | None, draw: bool, watch: Any,
    further: Mapping[str, Any], unstable: InstabilityMap | None = None,
) -> tuple[dict[str, Any], list[str]]:  # fmt: skip
    """Write tables, pictures and the summary; returns the summary and the names of the files.

    Parameters
    ----------
    further
        Entries of the summary that tell what was computed.
    unstable
        Map of parametric instability, where one was asked for.
    """
    bore = pictures.attachment_to_draw(run, attachment)
    with watch.stage("modes"):
        modes = coupled_modes(run.train, np.linspace(run.speeds[0], run.speeds[-1], CAMPBELL), run.band_hz)
        met = crossings(run.train, modes, multiples)
    with whole_set(folder, may_write=FILES) as target:
        with watch.stage("tables"):
            write_csv(target / "runup.csv", report.runup_columns(run))
            write_csv(target / "orders.csv", report.order_columns(run, multiples))
            write_csv(target / "waterfall.csv", report.waterfall_columns(run))
            save_arrays(target / "waterfall.npz", report.waterfall(run))
            write_csv(target / "modes.csv", report.mode_columns(modes))
            write_csv(target / "critical_speeds.csv", report.critical_columns(modes, met))
            if unstable is not None:
                write_csv(target / "instability.csv", report.instability_columns(unstable))
        if draw:
            with watch.stage("pictures"):
                pictures.draw_waterfall(target / "waterfall.png", run, multiples, bore, title)
                pictures.draw_campbell(target / "campbell.png", run, modes, met, multiples, title)
                pictures.draw_orders(target / "orders.png", run, multiples, bore, title)
                pictures.draw_forces(target / "meshes.png", run, title)
                if unstable is not None:
                    pictures.draw_instability(target / "instability.png", unstable, title)
        made = {**further, **report.summary(run, modes, multiples), "warnings": report.warnings(run)}
        made["timings_s"] = dict(watch.seconds)
        write_json(target / "summary.json", made)
        names = sorted(path.name for path in target.iterdir())
    return made, names
