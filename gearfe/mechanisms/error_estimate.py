"""Estimate the error of a run from two more runs with finer steps and perturbed starts.

The error falls with the tolerance. The difference to a finer run is therefore the error of the coarser run, except for
the share of the finer one, 1/`SHARPER`. Rounding does not fall with the tolerance, and runs share part of it. It is
measured by disturbing the start. Each of N steps rounds a coordinate or velocity of size s by about eps s, which
accumulates like a random walk to eps s sqrt(N). Applied at the start, this disturbance grows over the whole run. Both
signs of the disturbance are run, because the larger of |e + d| and |e - d| is |e| + |d|. The difference e and the
response d to the disturbance thus cannot cancel. A factor of `SAFETY` stands for what the runs share.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..base.errors import InputError
from ..base.progress import stage
from ..base.typing import Array
from ..multibody import Start, Status, Trajectory, integrate
from .model import Mechanism
from .results import Results, outputs_at

#: The finer runs' tolerance is that much smaller, their longest step that share of the median step of the first one.
SHARPER, SHORTER, SAFETY = 30.0, 0.6, 2.0
LEAST_TOLERANCE = 1e-13
#: Below this a smaller tolerance leaves the steps of series as they are, so that the longest step alone makes a run
#: finer: then it is that share of the shortest step, for at most so many times the steps.
SHARPEST, MOST_STEPS = 1e-12, 6.0
#: The same of a run that stopped early, most of whose steps are short ones just before its end; times its steps after
#: which a finer one is given up: it approaches what stopped the run.
STOPPED_STEPS, GIVEN_UP = 1.5, 3.0


@dataclass(frozen=True)
class TrajectoryError:
    """Estimated errors of a run.

    Attributes
    ----------
    coordinates
        Of the worst coordinate, over the run (m or rad); NaN if a finer run failed.
    outputs
        Of each output of the file, over the run, in its own unit.
    tolerance
        Of the finer runs.
    """

    coordinates: float
    outputs: Mapping[str, float] = field(default_factory=dict)
    tolerance: float = math.nan


@stage("error estimate by finer runs")
def trajectory_error(mechanism: Mechanism, start: Start, results: Results, tolerance: float) -> TrajectoryError:
    """Estimate a run's errors from two finer runs, whose starts are perturbed to both sides.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism.
    start : Start
        Start of the run.
    results : Results
        The run with its outputs.
    tolerance : float
        Relative tolerance of the run; those of the finer runs follow from it.

    Returns
    -------
    error : TrajectoryError
        Largest differences over the output times, times `SAFETY`; NaN if a finer run fails or ends earlier.
    """
    run = results.trajectory
    used = max(tolerance / SHARPER, LEAST_TOLERANCE)
    worst, outputs = 0.0, dict.fromkeys(results.outputs, 0.0)
    by_q, by_v = rounding(mechanism, start, run)
    if not (np.isfinite(by_q).all() and np.isfinite(by_v).all()):  # a run beyond all numbers
        return TrajectoryError(math.nan, dict.fromkeys(results.outputs, math.nan), used)
    for sign in (1.0, -1.0):
        perturbed = replace(start, q=start.q + sign * by_q, v=start.v + sign * by_v)
        finer = finer_run(mechanism, perturbed, run, used)
        if finer is None or len(finer.time) < len(run.time):
            return TrajectoryError(math.nan, dict.fromkeys(results.outputs, math.nan), used)
        with np.errstate(over="ignore", invalid="ignore"):
            other = outputs_at(mechanism, finer)
            for table in mechanism.file.outputs:
                off = np.abs(results.outputs[table.name] - other[table.name])
                if table.wrap is not None:
                    off = np.minimum(off, table.wrap - off)
                # np.maximum keeps NaN
                outputs[table.name] = float(np.maximum(outputs[table.name], SAFETY * off.max(initial=0.0)))
            worst = float(np.maximum(worst, SAFETY * np.abs(run.q - finer.q).max(initial=0.0)))
    return TrajectoryError(worst, outputs, used)


def rounding(mechanism: Mechanism, start: Start, run: Trajectory) -> tuple[Array, Array]:
    """Return what rounding adds to coordinates and velocities over a run's steps, with random signs drawn once."""
    unit = mechanism.system.units
    walk = np.finfo(float).eps * math.sqrt(len(run.dense.times))
    signs = np.random.default_rng(0).choice([-1.0, 1.0], (2, start.q.size))
    with np.errstate(over="ignore", invalid="ignore"):
        sizes = np.maximum(unit, np.abs(run.q).max(axis=0)), np.abs(run.v).max(axis=0)
        by_q, by_v = walk * signs * sizes
    return by_q, by_v


def finer_run(mechanism: Mechanism, start: Start, run: Trajectory, tolerance: float) -> Trajectory | None:
    """Repeat a run with another tolerance and shorter steps.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism.
    start : Start
        Start of the finer run.
    run : Trajectory
        Run whose steps and output times are the measure.
    tolerance : float
        Relative tolerance of the finer run.

    Returns
    -------
    finer : Trajectory or None
        It has the same output times, or as many as it reached. None if the run has fewer than two times or the finer
        one cannot start.
    """
    ends: Array = np.asarray(run.dense.times)
    if len(ends) < 2 or len(run.time) < 2:
        return None
    steps = np.abs(np.diff(ends))
    # a step that both runs take is an error that both make
    usual = float(steps.min() if tolerance < SHARPEST else np.median(steps))
    most = MOST_STEPS if run.status is Status.DONE else STOPPED_STEPS
    longest = max(SHORTER * usual, float(steps.mean()) / most)
    options: dict[str, Any] = {"method": run.method, "start": start, "longest": longest}
    options["raise_on_failure"] = False
    if run.status is not Status.DONE:
        options["most_steps"] = int(GIVEN_UP * len(ends)) + 100
    try:
        return integrate(mechanism.system, run.time, tolerance=tolerance, **options)
    except InputError:
        return None
