"""One case of each kind of job, in this process: tables of a job in, tables and summary out.

Objects that cases share are computed once. A `Shared` keeps the condensed gears and the root meshes of the last pair,
so cases that differ only in load or microgeometry only cost positions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.files import read_csv
from ..base.progress import Stopwatch
from ..base.tables.jobs import job_tables
from ..gears.geometry.face import NOMINAL
from .expressions import Answer

if TYPE_CHECKING:
    from ..gears.gearmesh.job import Keep

#: Tables of a job as parsed from TOML.
Raw = dict[str, Any]


class Shared:
    """Objects of the last case that the next may use: pure functions of the key."""

    def __init__(self) -> None:
        self._key = ""
        self._made: dict[str, Any] = {}

    def get(self, key: str, name: str, make: Callable[[], Any]) -> Any:
        """Return the result of `make`, kept under `name` until the key changes."""
        if key != self._key:
            self._key, self._made = key, {}
        if name not in self._made:
            self._made[name] = make()
        return self._made[name]


def solve(
    kind: str, raw: Raw, path: Path, shared: Shared, *, estimate: bool = False, mesh: str | None = None
) -> Answer:
    """Tables and summary of one case.

    Parameters
    ----------
    kind
        Of the job.
    raw
        Its tables.
    path
        The job file, for messages; files that the tables name lie beside it.
    shared
        What cases share.
    estimate
        With the error estimates of the job.
    mesh
        Name of the mesh, of a job that computes one and has several.

    Raises
    ------
    InputError
        What the job's command would refuse.
    """
    if kind in _OF_MESHES:
        return _OF_MESHES[kind](raw, path, shared, estimate, mesh)
    return _KINDS[kind](raw, path, shared, estimate)


def _stiffness(raw: Raw, path: Path, shared: Shared, estimate: bool, mesh: str | None) -> Answer:
    from ..gears.gearmesh.report import summary
    from ..gears.gearmesh.sweep import sweep_stiffness

    job = _only_mesh(raw, path, mesh)
    if job.mesh.along_width():
        return _along_width(job, shared, None, (raw, path), estimate=estimate)
    sweep, elastic = job.sweep, job.elastic(_kept(job, shared))
    curve = sweep_stiffness(job.pair, elastic=elastic, estimate_error=estimate, **sweep)
    return Answer({"stiffness": curve.columns()}, summary(job, curve, {}), _positions(curve.failed))


def _loadmap(raw: Raw, path: Path, shared: Shared, _estimate: bool, mesh: str | None) -> Answer:
    from ..gears.gearmesh.job import job_map
    from ..gears.gearmesh.report import map_summary, map_tables

    job = _only_mesh(raw, path, mesh)
    table = job.mesh.loads
    if job.mesh.along_width():
        return _along_width(job, shared, table, (raw, path))
    load_map = job_map(job, table, keep=_kept(job, shared))
    return Answer(map_tables(load_map), map_summary(job, table, load_map, {}), _positions(load_map.failed))


def _along_width(job: Any, shared: Shared, table: Any, file: tuple[Raw, Path], *, estimate: bool = False) -> Answer:
    """A mesh whose load varies along the face width: [stiffness], or the torques of a load map's table."""
    from ..gears.gearmesh import width_job
    from ..gears.gearmesh.width_report import load_columns, root_columns, sweep_columns, width_summary
    from ..gears.gearmesh.width_root import wide_roots

    shafts = by_shafts = None
    if job.mesh.misalignment_from_shafts:
        from ..drivetrain.gearbox import shaft_tilts

        shafts = shaft_tilts.shaft_tilts(*file, job.mesh)
        job = replace(job, mesh=shafts.mesh)
    if table is None:
        width_job.check_stiffness_job(job)
    else:
        width_job.check_map_job(job, table)
    gears = [(gear.teeth, gear.form, gear.drawn, gear.y_mm) for gear in job.mesh.gears]
    sizes = job.materials, job.table.coarsen, job.table.flank_coarsen, job.mesh.flank
    lines = width_job.job_lines(job, keep=partial(shared.get, repr((gears, job.mesh.centre_distance_mm, sizes))))
    untilted, solve = lines, None
    if shafts is None:
        sweep = width_job.job_sweep(job, lines, table)
    else:
        by_shafts = shaft_tilts.job_tilts(job, lines, shafts, table, None)
        sweep, lines = by_shafts.sweep, by_shafts.lines

        def solve(changed: Any) -> Any:
            return shaft_tilts.job_tilts(job, changed, shafts, table, None).sweep

    mesh = lines.compliance.mesh
    errors = width_job.estimated_errors(job, untilted, sweep, table, Stopwatch(), solve) if estimate else None
    roots = wide_roots(lines, sweep) if table is not None and table.root_stress else None
    name = "stiffness" if table is None else "loadmap"
    rows = {name: sweep_columns(job, mesh, sweep, roots), "load": load_columns(job, sweep)}
    if roots is not None:
        rows["root"] = root_columns(job, sweep, roots)
    summary = width_summary(job, mesh, sweep, {}, errors=errors, roots=roots)
    failed = _positions(sweep.status != "converged")
    if by_shafts is not None:
        rows["misalignment"] = shaft_tilts.tilt_columns(job, by_shafts)
        summary |= shaft_tilts.tilt_entries(job, by_shafts)
        failed = failed or "; ".join(by_shafts.warnings)
    return Answer(rows, summary, failed)


def _vibration(raw: Raw, path: Path, _shared: Shared, estimate: bool) -> Answer:
    from ..base.tables.jobs import train_tables
    from ..drivetrain.gearbox.job import train_job
    from ..drivetrain.vibration.analysis import Analysis, record_start
    from ..drivetrain.vibration.files import OutputChoice, write_run
    from ..drivetrain.vibration.run import simulated

    job, watch = train_job(path, train_tables(raw, path)), Stopwatch()
    planned = simulated(job, (), watch=watch, estimate=estimate)
    start = record_start(job, planned.model.train, planned.every, watch.stage)
    choice = OutputChoice(window=job.spectrum.window, spectrum_start=start, spectrum_length=job.spectrum.duration)
    beside = Analysis(job, planned.model.train, planned.every, start)
    with TemporaryDirectory() as name:  # a response may be longer than memory
        folder = Path(name)
        made = write_run(folder, planned, choice, watch=watch, beside=beside)
        files = sorted(folder.glob("*.csv"), key=lambda path: (path.stem != "response", path.stem))
        rows = {path.stem: read_csv(path, path.stem) for path in files}  # a short run has one
    status = made.response.status
    return Answer(rows, made.summary, "" if status == "done" else status)


def _runup(raw: Raw, path: Path, _shared: Shared, _estimate: bool) -> Answer:
    from ..base.tables.jobs import train_tables
    from ..drivetrain.gearbox.job import train_job
    from ..drivetrain.runup import report
    from ..drivetrain.runup.critical import critical_speeds
    from ..drivetrain.runup.job import described, solved

    table, job = job_tables(raw, path, ("runup",))["runup"], train_job(path, train_tables(raw, path))
    run, unstable = solved(job, table, watch=Stopwatch())
    critical = critical_speeds(run, table.multiples, table.shaft_multiples)
    notes = report.warnings(run)
    summary_of_run = {
        **described(job, table, run.train.model.train),
        **report.summary(run, critical),
        "warnings": notes,
    }
    whole = summary_of_run["speeds_reached"] == summary_of_run["speeds"]
    rows = report.tables(run, critical, table.multiples, unstable)
    return Answer(rows, summary_of_run, "" if whole else "; ".join(notes) or "not all speeds were reached")


def _modes(raw: Raw, path: Path, _shared: Shared, _estimate: bool) -> Answer:
    from ..base.tables.jobs import train_tables
    from ..base.tables.modes import ModesTable
    from ..drivetrain.gearbox.job import train_job
    from ..drivetrain.modes import report
    from ..drivetrain.modes.job import described, solved

    tables, job = job_tables(raw, path, (), ("modes", "runup")), train_job(path, train_tables(raw, path))
    table = tables.get("modes", ModesTable())
    result = solved(job, table, tables.get("runup"), watch=Stopwatch())
    return Answer(report.tables(result.campbell), {**described(job, table, result), **report.summary(result)}, "")


def _mechanism(raw: Raw, path: Path, _shared: Shared, estimate: bool) -> Answer:
    from ..base.tables.mechanism import mechanism_tables
    from ..mechanisms.error_estimate import trajectory_error
    from ..mechanisms.job import summarise
    from ..mechanisms.model import make_mechanism
    from ..mechanisms.rest import summarise_rest
    from ..mechanisms.solve import solve

    mechanism = make_mechanism(mechanism_tables(raw), path)
    made, tolerance = solve(mechanism), mechanism.tolerance
    if made.rest is not None:
        return Answer(made.tables(), summarise_rest(mechanism, made.start, made.rest, made.results, made.modes))
    integrated = mechanism.file.run.analysis == "transient"
    error = trajectory_error(mechanism, made.start, made.results, tolerance) if estimate and integrated else None
    return Answer(made.tables(), summarise(mechanism, made.start, made.results, tolerance, {}, error), made.problem)


def _only_mesh(raw: Raw, path: Path, mesh: str | None) -> Any:
    from ..base.tables.jobs import only_mesh
    from ..gears.gearmesh.job import stiffness_job

    return stiffness_job(only_mesh(raw, path, mesh, "study.mesh"), path.parent)


def _kept(job: Any, shared: Shared) -> Keep:
    """Return the shared objects for the data that determine the condensed gears."""
    gears = [(gear.teeth, gear.form, gear.drawn) for gear in job.mesh.gears]
    key = gears, job.mesh.centre_distance_mm, replace(job.model, deviations=NOMINAL)
    return partial(shared.get, repr(key))


def _positions(failed: Any) -> str:
    count = int(np.count_nonzero(failed))
    return f"{count} of {np.size(failed)} positions failed" if count else ""


_OF_MESHES: dict[str, Callable[[Raw, Path, Shared, bool, str | None], Answer]] = {
    "stiffness": _stiffness,
    "loadmap": _loadmap,
}
_KINDS: dict[str, Callable[[Raw, Path, Shared, bool], Answer]] = {
    "vibration": _vibration,
    "runup": _runup,
    "modes": _modes,
    "mechanism": _mechanism,
}
