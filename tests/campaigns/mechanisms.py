"""Planar mechanisms: links through their folds, long runs, redundant loops, stiff springs, light links, closed chains.

Each case is a mechanism file, so that `gearfe mechanism` runs it again. Checks of a run that reached its end:

- *energy*: the total (kinetic + potential - work) keeps its start value, relative to the largest kinetic energy;
- *closed*: the constraints hold, relative to the size of the mechanism;
- *angle* (folding links): the crank angle is that of the closed equation of motion of the folding two-link crank;
- *back* (chains): run backwards from the end, the start comes back;
- *estimate*: the error that the run states of itself is not exceeded by more than ten times.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from gearfe.mechanisms.error_estimate import trajectory_error
from gearfe.mechanisms.job import output_times
from gearfe.mechanisms.model import Mechanism, load_mechanism
from gearfe.mechanisms.results import evaluate
from gearfe.multibody import Start, Trajectory, consistent_start, integrate
from tests.makers.rigid_cases import folding_angle

from .campaign import Campaign, Case
from .linkages import KINDS, linkage
from .outcome import Check, Finding
from .toml_text import toml_text

#: Energy and closure may err by so many tolerances: mechanisms amplify the error of a step (docs/mechanisms.md), the
#: more the longer they run; below the floor rounding is what is left.
AMPLIFIED, FLOOR = 30.0, 2e-11
#: Implicit runs state a tolerance for the coordinates; speeds of stiff modes err by the ratio of their frequencies.
IMPLICIT = 3e4


def draw(random: np.random.Generator, number: int) -> Case:
    """Half of all cases are folding links; the other kinds take turns."""
    kind = "folding" if number % 2 == 0 else KINDS[(number // 2) % len(KINDS)]
    tables, data = linkage(random, kind)
    return Case(number, kind, {"job.toml": toml_text(tables)}, "gearfe mechanism job.toml --out out", data)


def run(case: Case, folder: Path) -> Finding:
    """Integrate and check."""
    mechanism = load_mechanism(case.write(folder))
    start = mechanism.start()
    table = mechanism.file.run
    times = output_times(table.end_s, table.step_s)
    made = integrate(
        mechanism.system, times, start=start, method=table.method, tolerance=mechanism.tolerance, raise_on_failure=False
    )
    measures: dict[str, Any] = {
        "method": made.method,
        "tolerance": table.tolerance,
        "steps": made.statistics["steps"],
        "reached_s": made.reached,
        "redundant": len(start.freedoms.redundant),
        "bodies": len(mechanism.linkage.bodies),
    }
    if len(made.dense.times) < 2:
        return Finding("stopped", made.message, (), measures)
    checks = _checks(case, mechanism, start, made)
    if made.status != 0:
        return Finding("stopped", f"{made.message} at {made.reached:.6g} of {table.end_s:g} s", checks[:0], measures)
    return Finding("done", "", checks, measures)


def _checks(case: Case, mechanism: Mechanism, start: Start, made: Trajectory) -> list[Check]:
    tolerance = mechanism.tolerance
    allowed = max((AMPLIFIED if made.method == "taylor" else IMPLICIT) * tolerance, FLOOR)
    turns = float(case.data.get("amplification", 1.0))
    energy = evaluate(mechanism, made).energy
    total = energy["total_J"]
    scale = max(float(energy["kinetic_J"].max()), float(np.ptp(energy["potential_J"])), 1e-12)
    linkage = mechanism.linkage
    few = np.linspace(0, len(made.time) - 1, min(50, len(made.time))).astype(int)
    gap = max(float(np.abs(mechanism.system.residual(made.time[i], made.q[i])).max(initial=0.0)) for i in few)
    checks = [Check("energy", float(np.ptp(total)) / scale, turns * allowed)]
    checks.append(Check("closed", gap / linkage.assembly.length, max(100 * tolerance, 1e-9)))
    if case.kind == "folding":
        exact = folding_angle(float(case.data["theta"]), float(case.data["omega"]), made.time)
        limit = max(40.0 * tolerance, 2e-10)
        checks.append(Check("angle", float(np.abs(made.q[:, 2] - exact).max()), limit))
    if case.kind != "long":
        checks += _estimate(mechanism, start, made, allowed)
    if case.kind == "chain" and tolerance <= 1e-7:
        checks += _backwards(case, mechanism, start, made)
    return checks


def _estimate(mechanism: Mechanism, start: Start, made: Trajectory, floor: float) -> list[Check]:
    """The error that the command would state, against a run far finer than the one it is made from."""
    tolerance = mechanism.tolerance
    if tolerance < 1e-9 or made.method != "taylor":
        return []  # no run is far finer than that
    stated = trajectory_error(mechanism, start, evaluate(mechanism, made), tolerance).coordinates
    options: dict[str, Any] = {"method": made.method, "start": start, "tolerance": 1e-12}
    truth = integrate(mechanism.system, made.time, raise_on_failure=False, **options)
    if truth.status != 0:
        return []
    off = float(np.abs(made.q - truth.q).max())
    return [Check("estimate", off, 10.0 * stated + 1e-3 * floor)]


def _backwards(case: Case, mechanism: Mechanism, start: Start, made: Trajectory) -> list[Check]:
    """Run back to the start; chains are chaotic, so errors grow with a rate that the case states."""
    end = consistent_start(mechanism.system, made.reached, q=made.q[-1], v=made.v[-1])
    options: dict[str, Any] = {"method": made.method, "tolerance": mechanism.tolerance, "start": end}
    back = integrate(mechanism.system, [made.reached, 0.0], raise_on_failure=False, **options)
    if back.status != 0:
        return []
    growth = math.exp(min(12.0, float(case.data["growth_per_s"]) * made.reached))
    off = float(np.abs(back.q[-1] - start.q).max())
    return [Check("back", off, growth * max(AMPLIFIED * mechanism.tolerance, FLOOR))]


CAMPAIGN = Campaign("mechanisms", 400, (0, 1, 2, 3, 5, 7), 120.0, draw, run, compiles=True)
