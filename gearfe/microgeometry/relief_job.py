"""From the [relief] table of a job file to the search, and from its result to tables and lines."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..contact.half_plane_step import HalfPlanePair
from ..errors import InputError
from ..gear.deviation_job import FlankOf, deviations_of, modification
from ..gear.pair import GearPair
from ..loadmap.root_stress import PairRoots
from ..stiffness.job import StiffnessJob
from ..tables.microgeometry import VARIABLES, MicrogeometryTable, ReliefTable
from ..typing import Array
from ..versions import versions
from .relief import ReliefResult
from .relief_problem import Evaluation, ReliefProblem, Variable

#: Torques at which the best is compared with none: shares of the range that the job's torques span, widened.
COMPARED = 17


class PitchErrors(NamedTuple):
    """The best relief, and none, on gears with pitch errors."""

    best: Evaluation
    without: Evaluation


def relief_problem(
    table: ReliefTable,
    base: MicrogeometryTable,
    pair: GearPair,
    folder: Path,
    law: HalfPlanePair,
    roots: PairRoots | None,
) -> ReliefProblem:
    """The search of a job file, of gears without pitch errors."""
    made = [modification(FlankOf(base, pair, g, base.flank, folder, mirrored=base.flank == "right")) for g in (0, 1)]
    variables = []
    for one in table.variables:
        quantity, factor = VARIABLES[one.key]
        low, high, tolerance = (factor * value for value in (one.low, one.high, one.tolerance))
        variables.append(Variable(quantity, low, high, one.gear, tolerance))
    return ReliefProblem(
        law,
        (made[0], made[1]),
        tuple(variables),
        table.torques_Nm,
        table.weights,
        table.peak_to_peak_weight,
        table.pressure_weight,
        table.root_stress_weight,
        positions=table.positions,
        roots=roots,
    )


def with_pitch_errors(made: ReliefResult, base: MicrogeometryTable, pair: GearPair, folder: Path) -> PitchErrors | None:
    """The best relief, and none, on gears with the pitch errors of [microgeometry]; None where there are none."""
    pinion, wheel = (one.turn for one in deviations_of(base, pair, folder))
    if not any((*pinion, *wheel)):
        return None
    problem = replace(made.problem, turns=(pinion, wheel), mesh_cycles=base.mesh_cycles)
    best, without = problem.evaluate(made.x), problem.evaluate([v.absent for v in problem.variables])
    return PitchErrors(best, without)


def named(error: InputError, table: ReliefTable, problem: ReliefProblem) -> InputError:
    """The error of bounds that hold no gear in the words of the job file."""
    first = table.variables[0]
    if error.field != problem.variables[0].name:
        return error
    return InputError(f"relief.variables, {first.key}", (first.low, first.high), error.problem, error.cure)


def names_of(table: ReliefTable) -> list[str]:
    """Names of the variables in the job's keys."""
    return [f"{one.key} {one.gear}" for one in table.variables]


def in_units(table: ReliefTable, x: Any) -> list[float]:
    """Values in the job's units."""
    return [float(value / VARIABLES[one.key][1]) for one, value in zip(table.variables, x, strict=True)]


def map_table(table: ReliefTable, made: ReliefResult) -> dict[str, Array]:
    """The map: a row for each point."""
    grids = np.meshgrid(*made.axes, indexing="ij")
    columns = {
        name.replace(" ", "_"): grid.ravel() / VARIABLES[one.key][1]
        for name, one, grid in zip(names_of(table), table.variables, grids, strict=False)
    }
    # what is no gear has no objective
    return {**columns, "objective": np.where(np.isfinite(made.map), made.map, np.nan).ravel()}


def comparison(made: ReliefResult) -> dict[str, Array]:
    """Peak-to-peak error of the best, and of none, against torque."""
    problem = made.problem
    low, high = min(problem.torques), max(problem.torques)
    torques = np.unique(np.concatenate([np.linspace(0.5 * low, 1.5 * high, COMPARED), problem.torques]))
    none = [v.absent for v in problem.variables]
    return {
        "torque_Nm": torques,
        "peak_to_peak_best_um": 1e6 * problem.mesh(made.x, torques).peak_to_peak,
        "peak_to_peak_without_um": 1e6 * problem.mesh(none, torques).peak_to_peak,
    }


def report_lines(table: ReliefTable, made: ReliefResult, errors: PitchErrors | None) -> list[str]:
    """Lines to print."""
    values = ", ".join(f"{n} = {v:.4g}" for n, v in zip(names_of(table), in_units(table, made.x), strict=True))
    lines = [f"best of {made.evaluations} evaluations: {values}"]
    for i, torque in enumerate(table.torques_Nm):
        best, without = (1e6 * one.peak_to_peak[i] for one in (made.best, made.without))
        line = f"at {torque:.4g} N m: transmission error {best:.3g} um peak to peak, without {without:.3g} um"
        lines.append(line + f", largest pressure {1e-6 * made.best.pressure[i]:.4g} MPa")
    lines.append(f"objective {made.best.value:.4g}, without {made.without.value:.4g}")
    for name, one, low, high in zip(names_of(table), table.variables, made.low, made.high, strict=True):
        if one.tolerance > 0.0:
            lines.append(f"  {name} less by {one.tolerance:g}: {low:.4g}, more by {one.tolerance:g}: {high:.4g}")
    if any(one.tolerance > 0.0 for one in table.variables):
        lines.append(f"  at the worst corner of all tolerances: {made.worst:.4g}")
    if errors is not None:
        line = (
            f"  with the pitch errors of [microgeometry]: {errors.best.value:.4g}, without {errors.without.value:.4g}"
        )
        lines.append(line + (f" ({errors.best.problem})" if errors.best.problem else ""))
    bounds = [
        name
        for name, v, value in zip(names_of(table), made.problem.variables, made.x, strict=True)
        if min(value - v.low, v.high - value) < 1e-3 * (v.high - v.low)
    ]
    if bounds:
        lines.append("at a bound: " + ", ".join(bounds) + "; wider bounds may hold a better one")
    return lines


def summary(
    job: StiffnessJob,
    base: MicrogeometryTable,
    table: ReliefTable,
    made: ReliefResult,
    errors: PitchErrors | None,
    timings: Mapping[str, float],
) -> dict[str, Any]:
    """Content of relief.json."""
    return {
        "job": {**job.tables, "microgeometry": asdict(base), "relief": asdict(table)},
        "versions": versions(),
        "best": dict(zip(names_of(table), in_units(table, made.x), strict=True)),
        "objective": made.best.value,
        "objective_without": made.without.value,
        "peak_to_peak_um": (1e6 * made.best.peak_to_peak).tolist(),
        "peak_to_peak_without_um": (1e6 * made.without.peak_to_peak).tolist(),
        "largest_pressure_MPa": (1e-6 * made.best.pressure).tolist(),
        "largest_root_stress_MPa": (1e-6 * made.best.root_stress).tolist(),
        "objective_at_low_tolerance": made.low.tolist(),
        "objective_at_high_tolerance": made.high.tolist(),
        "objective_at_worst_corner": made.worst,
        "with_pitch_errors": None
        if errors is None
        else {
            name: {"objective": one.value, "peak_to_peak_um": (1e6 * one.peak_to_peak).tolist(), "problem": one.problem}
            for name, one in errors._asdict().items()
        },
        "evaluations": made.evaluations,
        "timings_s": dict(timings),
    }
