"""How far a run is from the exact motion, estimated from a second run with finer steps.

With an error that falls with the tolerance, the difference of both runs is the error of the coarser one up to the share
of the finer one, 1/`SHARPER`. The second run's steps are also shorter than the first one's, so that where the tolerance
is at its limit already the difference shows what rounding does. A factor of `SAFETY` stands for what both share.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..errors import InputError
from ..progress import stage
from ..rigid import Start, Trajectory, integrate
from ..rigid.contract import Array
from .model import Mechanism
from .results import Results, evaluate

#: The second run's tolerance is that much smaller, its longest step that share of the first one's.
SHARPER, SHORTER, SAFETY = 30.0, 0.6, 2.0
LEAST_TOLERANCE = 1e-13


@dataclass(frozen=True)
class TrajectoryError:
    """Estimated errors of a run.

    Attributes
    ----------
    coordinates
        Of the worst coordinate, over the run (m or rad); not-a-number when the second run failed.
    outputs
        Of each output of the file, over the run, in its own unit.
    tolerance
        Of the second run.
    """

    coordinates: float
    outputs: Mapping[str, float] = field(default_factory=dict)
    tolerance: float = math.nan


@stage("error estimate by a finer run")
def trajectory_error(mechanism: Mechanism, start: Start, results: Results, tolerance: float) -> TrajectoryError:
    """Run again, finer, and compare at the output times."""
    made = results.trajectory
    finer = finer_run(mechanism, start, made, tolerance)
    used = max(tolerance / SHARPER, LEAST_TOLERANCE)
    if finer is None or len(finer.time) < len(made.time):
        return TrajectoryError(math.nan, dict.fromkeys(results.outputs, math.nan), used)
    with np.errstate(over="ignore", invalid="ignore"):
        other = evaluate(mechanism, finer)
        outputs = {}
        for table in mechanism.file.outputs:
            off = np.abs(results.outputs[table.name] - other.outputs[table.name])
            if table.wrap is not None:
                off = np.minimum(off, table.wrap - off)
            outputs[table.name] = SAFETY * float(off.max(initial=0.0))
        return TrajectoryError(SAFETY * float(np.abs(made.q - finer.q).max(initial=0.0)), outputs, used)


def finer_run(mechanism: Mechanism, start: Start, made: Trajectory, tolerance: float) -> Trajectory | None:
    """The same run with a smaller tolerance and shorter steps; None where it cannot be made."""
    ends: Array = np.asarray(made.dense.times)
    if len(ends) < 2 or len(made.time) < 2:
        return None
    longest = SHORTER * float(np.abs(np.diff(ends)).max())
    backend = "compiled" if made.statistics.get("backend") == "compiled" else "plain"
    options: dict[str, Any] = {"method": made.method, "backend": backend, "start": start, "longest": longest}
    options["raise_on_failure"] = False
    try:
        return integrate(mechanism.system, made.time, tolerance=max(tolerance / SHARPER, LEAST_TOLERANCE), **options)
    except InputError:
        return None
