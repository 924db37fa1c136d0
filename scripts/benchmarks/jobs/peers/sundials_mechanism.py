"""CVODE and IDA (SUNDIALS through scikit-sundae) on the compiled equations of a mechanism.

CVODE takes the index-1 form in absolute angles, IDA the stabilised index-2 form. What they do that the toolkit does
not: any differential (-algebraic) equation, sensitivities, events.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..timing import measured
from .mechanism_equations import angles_of, equations
from .process import serve


def answer(task: dict[str, Any]) -> dict[str, Any]:
    """Integrate and measure; making the solver counts."""
    from sksundae.cvode import CVODE
    from sksundae.ida import IDA

    start, rhs, residual, rows = equations(task["mechanism"])
    times, tolerance = np.array(task["times"]), task["tolerance"]
    n = start.size
    common = {"rtol": tolerance, "atol": 1e-2 * tolerance, "max_num_steps": 1_000_000}
    rhs(0.0, start, np.empty(n))
    slope = np.empty(n)
    rhs(0.0, start, slope)

    if task["method"] == "IDA":
        y0 = np.concatenate([start, np.zeros(2 * rows)])
        yp0 = np.concatenate([slope, np.zeros(2 * rows)])
        y0[n : n + rows] = _multipliers(residual, y0, yp0, n, rows)
        residual(0.0, y0, yp0, np.empty(y0.size))
        # multipliers are left out of the error test by a loose tolerance, as SUNDIALS' manual advises for index 2
        atol = np.concatenate([np.full(n, 1e-2 * tolerance), np.full(2 * rows, 1e10)])
        common["atol"] = atol

        def run() -> Any:
            return IDA(residual, algebraic_idx=list(range(n, n + 2 * rows)), **common).solve(times, y0, yp0)

    else:
        method = task["method"].split("-")[1]

        def run() -> Any:
            return CVODE(rhs, method=method, **common).solve(times, start)

    made, cost = measured(run, runs=3, most_s=20.0)
    states = np.asarray(made.y)
    return {
        "angles": angles_of(task["mechanism"], states),
        **cost.columns,
        "steps": int(np.max(made.nfev)),
        "status": str(made.message),
    }


def _multipliers(residual: Any, y0: np.ndarray, yp0: np.ndarray, n: int, rows: int) -> np.ndarray:
    """Multipliers that balance the start: the residual is linear in them."""
    half = n // 2
    base = np.empty(y0.size)
    residual(0.0, y0, yp0, base)
    columns = []
    for r in range(rows):
        y = y0.copy()
        y[n + r] = 1.0
        out = np.empty(y0.size)
        residual(0.0, y, yp0, out)
        columns.append((out - base)[half:n])
    return np.linalg.lstsq(np.array(columns).T, -base[half:n], rcond=None)[0]


if __name__ == "__main__":
    serve(answer)
