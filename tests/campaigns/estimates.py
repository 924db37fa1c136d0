"""Error estimates against the truth, on scenes that nobody looked at when the estimates were made.

- *curve*: the estimate of `gearfe stiffness` against a mesh several times finer;
- *frequencies*: the estimate of `gearfe housing` against elements that are 1.5 mm thin at re-entrant edges;
- *reduction*: the bound on the response against a body with many more modes;
- *response*: the integration estimate of `gearfe vibration` against a tolerance of 1e-11;
- *trajectory*: the estimate of `gearfe mechanism` against a tolerance of 1e-12.

An estimate covers a case when the true error does not exceed it. A result that is off by more than ten times its
estimate is silently wrong.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gearfe.base.tables.housing import HousingMeshTable
from gearfe.base.tables.jobs import load_job
from gearfe.base.tables.pair import LAWS

from .campaign import Campaign, Case, Columns
from .linkages import linkage
from .outcome import Check, Finding, Outcome
from .pairs import LARGEST_OVERLAP, chosen, log_uniform, rounded, running_pair, twist_of_overlap
from .rows import housing, row
from .toml_text import toml_text

#: Headlines take turns: cheap ones come more often.
KINDS = (
    "trajectory",
    "response",
    "curve",
    "frequencies",
    "trajectory",
    "response",
    "curve",
    "reduction",
    "trajectory",
    "response",
)
#: Element sizes of the truth of a curve, as a share of the case's; errors fall with its power of 1.5 to 2.
FINER = 0.35
#: A truth's tolerance is at most that share of the case's.
FAR_FINER = 1e-2
#: Loads of the responses, as a share of those of the trains.
LIGHTER = 0.02
#: Errors below this are rounding, which no estimate means.
ROUNDING = 1e-12


def draw(random: np.random.Generator, number: int) -> Case:
    """A random scene of the headline whose turn it is."""
    kind = KINDS[number % len(KINDS)]
    return MAKERS[kind](random, number, kind)


def run(case: Case, folder: Path) -> Finding:
    """True error and estimate."""
    found = RUNS[case.kind](case, case.write(folder))
    if isinstance(found, str):
        return Finding("stopped", found)
    true, stated, unit = found
    measures = {"true_error": float(f"{true:.4g}"), "estimate": float(f"{stated:.4g}"), "unit": unit}
    measures |= {"covered": bool(true <= stated + ROUNDING)}
    return Finding("done", "", [Check("true error", true, 10.0 * stated + 10 * ROUNDING)], measures)


#: True error, estimate, unit; or why there is none.
Found = tuple[float, float, str] | str


def _draw_curve(random: np.random.Generator, number: int, kind: str) -> Case:
    pair = running_pair(random, most_teeth=80)
    sweep = {
        "twist_deg": twist_of_overlap(pair, log_uniform(random, 0.02, LARGEST_OVERLAP)),
        "twist_from": "contact",
        "law": str(random.choice(sorted(LAWS))),
        "coarsen": chosen(random, None, lambda: rounded(random.uniform(1.0, 2.0), 2)),
    }
    tables = {"pair": pair, "stiffness": sweep}
    return Case(number, kind, {"job.toml": toml_text(tables)}, "gearfe stiffness job.toml --out out")


def _run_curve(case: Case, job_path: Path) -> Found:
    """Worst relative error over six positions."""
    from gearfe.gears.gearmesh.job import read_stiffness_job
    from gearfe.gears.gearmesh.sweep import sweep_stiffness

    job = read_stiffness_job(job_path)
    del case
    angles = job.pair.mesh_cycle * (np.arange(6) + 0.19) / 6
    options = {**job.sweep, "angles": angles}
    curve = sweep_stiffness(job.pair, job.model, estimate_error=True, **options)
    truth = sweep_stiffness(job.pair, job.model, coarsen=max(0.2, FINER * job.table.coarsen), **options)
    if not math.isfinite(curve.worst_error) or (truth.status != "converged").any():
        return "the curve has no estimate, or the finer one did not converge everywhere"
    off = np.abs(curve.torque_wheel / truth.torque_wheel - 1)
    return float(np.nanmax(off)), curve.worst_error, "relative"


def _draw_trajectory(random: np.random.Generator, number: int, kind: str) -> Case:
    which = str(random.choice(["folding", "loops", "springs", "light", "chain"]))
    tables, _ = linkage(random, which)
    tables["run"]["tolerance"] = chosen(random, 1e-9, lambda: rounded(log_uniform(random, 1e-9, 1e-4), 2))
    return Case(number, kind, {"job.toml": toml_text(tables)}, "gearfe mechanism job.toml --out out", {"which": which})


def _run_trajectory(case: Case, job_path: Path) -> Found:
    """Worst error of a coordinate over the run (m or rad)."""
    from gearfe.mechanisms.error_estimate import trajectory_error
    from gearfe.mechanisms.job import output_times
    from gearfe.mechanisms.model import load_mechanism
    from gearfe.mechanisms.results import evaluate
    from gearfe.multibody import integrate

    del case
    mechanism = load_mechanism(job_path)
    start, run_table = mechanism.start(), mechanism.file.run
    times = output_times(run_table.end_s, run_table.step_s)
    made = integrate(mechanism.system, times, start=start, tolerance=mechanism.tolerance, raise_on_failure=False)
    if made.status != 0:
        return made.message
    stated = trajectory_error(mechanism, start, evaluate(mechanism, made), mechanism.tolerance).coordinates
    finest = 1e-12 if made.method == "taylor" else max(1e-11, 1e-5 * mechanism.tolerance)
    options: dict[str, Any] = {"method": made.method, "start": start, "raise_on_failure": False}
    truth = integrate(mechanism.system, times, tolerance=finest, **options)
    while truth.status != 0 and 10.0 * finest <= FAR_FINER * mechanism.tolerance:
        finest *= 10.0  # redundant loops stop at folds when rounding is all that the tolerance leaves
        truth = integrate(mechanism.system, times, tolerance=finest, **options)
    if truth.status != 0:
        return f"the truth: {truth.message}"
    if not math.isfinite(stated):
        return "no estimate: a finer run ended early"
    return float(np.abs(made.q - truth.q).max()), stated, "m or rad"


def _draw_response(random: np.random.Generator, number: int, kind: str) -> Case:
    tables, files, _ = row(random, "general")
    tables["train"]["tolerance"] = chosen(random, 1e-6, lambda: rounded(log_uniform(random, 1e-8, 1e-3), 2))
    # the motion is linear in the load, tolerance and error are relative: a light one keeps soft bearings within the
    # displacements that the gears' geometry allows
    for load in tables["train"]["loads"]:
        load["torque_Nm"] = rounded(LIGHTER * load["torque_Nm"], 3)
    return Case(number, kind, {"job.toml": toml_text(tables), **files}, "gearfe vibration job.toml --out out")


def _run_response(case: Case, job_path: Path) -> Found:
    """Worst error of a contact force over the run, relative to its largest value."""
    from gearfe.drivetrain.gearbox.job import job_train, read_train_job
    from gearfe.drivetrain.gearbox.mesh_stiffness import train_curves
    from gearfe.drivetrain.train import build_train, simulate

    del case
    job = read_train_job(job_path)
    model = build_train(job_train(job, train_curves(job), None))
    options: dict[str, Any] = {"tolerance": job.table.tolerance, "method": job.table.method, "raise_on_failure": False}
    made = simulate(model, job.times, estimate=True, **options)
    truth = simulate(model, job.times, tolerance=1e-11, raise_on_failure=False)
    if made.status != "done" or truth.status != "done":
        return "; ".join(made.warnings) or f"the truth: {truth.status}"
    scale = np.maximum(np.abs(truth.contact_force).max(axis=0), 1e-300)
    off = np.abs(made.contact_force - truth.contact_force).max(axis=0) / scale
    return float(off.max()), made.estimates["integration"], "relative"


def _draw_body(random: np.random.Generator, number: int, kind: str) -> Case:
    table = housing(random, 62.5)
    return Case(number, kind, {"job.toml": toml_text({"housing": table})}, "gearfe housing job.toml --out out")


def _run_frequencies(case: Case, job_path: Path) -> Found:
    """Of the first ten natural frequencies that whose error is largest against its estimate."""
    from gearfe.drivetrain.housing.body import reduced_housing
    from gearfe.fem.reduction.error import mesh_error, reduction_error

    del case
    table = load_job(job_path, ("housing",))["housing"]
    truth = reduced_housing(dataclasses.replace(table, mesh=HousingMeshTable(size_mm=1.5)))
    body = reduced_housing(table)
    band = float(body.coupled.frequencies_hz[9])
    stated = mesh_error(body, band).frequency_errors[:10] + reduction_error(body, band).frequency_errors[:10]
    off = np.abs(body.coupled.frequencies_hz[:10] / truth.coupled.frequencies_hz[:10] - 1)
    worst = int(np.argmax(off / stated))
    return float(off[worst]), float(stated[worst]), "relative"


def _run_reduction(case: Case, job_path: Path) -> Found:
    """Accelerances of the bores up to the band's end, rms, against a body with many more modes."""
    from gearfe.drivetrain.housing.build import housing_from_table, reduced
    from gearfe.fem.reduction.error import accelerances, reduction_error

    del case
    table = load_job(job_path, ("housing",))["housing"]
    whole = housing_from_table(table)
    rich = dataclasses.replace(table.reduction, modes_below_Hz=1e9, modes=120, quasi_static_levels=2)
    body, truth = reduced(whole, table.reduction), reduced(whole, rich)
    stated = reduction_error(body, table.reduction.band_Hz).response
    if not math.isfinite(stated):
        return "no estimate of the reduction"
    one, two = (accelerances(b, table.reduction.band_Hz) for b in (body, truth))
    return float(np.linalg.norm(one - two) / np.linalg.norm(two)), stated, "relative rms"


MAKERS: dict[str, Callable[[np.random.Generator, int, str], Case]] = {
    "curve": _draw_curve,
    "trajectory": _draw_trajectory,
    "response": _draw_response,
    "frequencies": _draw_body,
    "reduction": _draw_body,
}
RUNS: dict[str, Callable[[Case, Path], Found]] = {
    "curve": _run_curve,
    "trajectory": _run_trajectory,
    "response": _run_response,
    "frequencies": _run_frequencies,
    "reduction": _run_reduction,
}


def tables(outcomes: Sequence[Outcome]) -> dict[str, Columns]:
    """For each headline: how many cases are covered, by how much the estimate is too large, how many are far off."""
    kinds = [kind for kind in MAKERS if any(row.kind == kind and row.measures for row in outcomes)]
    columns: dict[str, list[Any]] = {
        "headline": kinds, "cases": [], "covered_percent": [], "median_estimate_over_error": [],
        "largest_error_over_estimate": [], "median_true_error": [],
    }  # fmt: skip
    for kind in kinds:
        rows = [row.measures for row in outcomes if row.kind == kind and row.measures]
        true = np.array([max(r["true_error"], 1e-16) for r in rows])
        stated = np.array([max(r["estimate"], 1e-16) for r in rows])
        columns["cases"].append(len(rows))
        columns["covered_percent"].append(float(f"{100 * np.mean([r['covered'] for r in rows]):.4g}"))
        columns["median_estimate_over_error"].append(float(f"{np.median(stated / true):.3g}"))
        columns["largest_error_over_estimate"].append(float(f"{(true / stated).max():.3g}"))
        columns["median_true_error"].append(float(f"{np.median(true):.3g}"))
    return {"estimates_outcomes_by_headline": columns} if kinds else {}


CAMPAIGN = Campaign("estimates", 200, (0, 1, 2), 600.0, draw, run, tables, compiles=True)
