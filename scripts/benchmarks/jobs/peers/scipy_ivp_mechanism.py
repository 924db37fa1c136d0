"""scipy's integrators on the compiled equations of a mechanism (index 1, absolute angles).

What they do that the toolkit does not: any differential equation.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from ..timing import measured
from .mechanism_equations import angles_of, equations
from .process import serve


def answer(task: dict[str, Any]) -> dict[str, Any]:
    """Integrate and measure."""
    start, rhs, _, _ = equations(task["mechanism"])
    times, tolerance = np.array(task["times"]), task["tolerance"]
    work = np.empty_like(start)

    def right(t: float, y: np.ndarray) -> np.ndarray:
        rhs(t, y, work)
        return work.copy()

    right(0.0, start)  # compiles

    def run() -> Any:
        span = (times[0], times[-1])
        return solve_ivp(
            right, span, start, task["method"], t_eval=times, rtol=max(tolerance, 3e-14), atol=1e-2 * tolerance
        )

    made, cost = measured(run, runs=3, most_s=20.0)
    return {
        "angles": angles_of(task["mechanism"], made.y.T),
        **cost.columns,
        "steps": made.nfev,
        "status": made.message,
    }


if __name__ == "__main__":
    serve(answer)
