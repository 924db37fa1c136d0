"""One step by collocation of  M a = f(t, q, v) - G^T lambda,  g(t, q) = 0:  simplified Newton on all stages.

Radau's stages hold the constraints (index 3), Gauss's their rates (index 2: positions would cost its order; Ascher &
Petzold, SIAM J. Numer. Anal. 28 (1991) 1097-1120). Stresses S of stiff links are unknowns beside the coordinates. With
the matrices of one stage and the eigenvalues mu of A^-1 (`collocation`) the changes follow from one system of the size
of the mechanism for each mu,

    [ mu^2/h^2 M - mu/h df/dv - df/dq + d(G^T lambda)/dq    G^T ]
    [ G                                                      0  ].

Stages lie side by side in lanes (`lanes`), and so do these systems: all are evaluated, factorised and solved at once.

The error is that of the stages' polynomials at the step's begin, v - V(0) and M (a - A(0)), filtered by the matrix of
the real eigenvalue (Hairer & Wanner II, Secs. IV.8, VI.1, VII.4). The end is projected onto the constraints of
positions and velocities by the least changes in the mass norm.

The functions that this one calls are compiled loops on a `tape.Program` (`kernel_equations`, `kernel_matrices`,
`kernel_stages`) or NumPy on any `System` (`numpy_equations`); both have these names.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ....typing import Array
from ...compiled.simd import Lanes

if TYPE_CHECKING:
    from .kernel_equations import linearise, stages
    from .kernel_matrices import factorise, solve
    from .kernel_stages import begin, change, defect, end_state, gap_between, keep_path, project
    from .scheme import Scheme

#: Changes relative to the tolerance below which a step counts, and at which Newton's rate is trusted to tell the rest.
SOLVED, TRUSTED_CHANGE, MOST_NEWTON = 1e-3, 0.3, 12


class Stages(NamedTuple):
    """State and unknowns of a step: n coordinates, m rows, k stresses; lanes are s stages, and last the begin."""

    now: Array  # (3,) time at the begin and step (s), change over the limit at which Newton's method ends
    #: (4,) error over the tolerance, gap of the rows between the stages, mean rate of Newton's changes, stages that are
    #: beyond the end of a table
    measures: Array
    q: Array  # (n,) state at the begin
    v: Array
    multipliers: Array  # (m,) first guess
    speeds: Array  # (s + 1, n) of powers of the time since the begin
    limit: Array  # (n,) allowed errors of coordinates
    guess: Lanes  # (s + 1, W) from coefficients of the speeds before to Z
    Z: Lanes  # (n, W) positions less q + c h v
    Q: Lanes  # (n, W) positions, velocities, accelerations
    V: Lanes
    A: Lanes
    L: Lanes  # (m, W) multipliers
    S: Lanes  # (k, W) stresses
    rest: Lanes  # (n, W) what is left of the equations
    gap: Lanes  # (m, W)
    r: Lanes  # (n, W) the same of the systems, then their changes
    g: Lanes  # (m, W)
    dZ: Lanes  # (n, W) changes
    dL: Lanes  # (m, W)
    known: Array  # (inner + 4, n) as `Scheme.path` has them
    qn: Array  # (n,) state at the end
    vn: Array


def collocation_step(eq: Any, w: Stages, tab: Scheme) -> int:
    """One trial step; the number of Newton's iterations, its negative where they did not converge."""
    t = w.now[0]
    h = w.now[1]
    begin(eq, w, tab)
    if not linearise(eq, w, tab.central, t + tab.c[tab.central] * h):
        return 0
    if not factorise(eq, w, tab):
        return 0
    moved = np.inf
    size = np.inf
    started = 0.0
    count = 0
    solved = False
    while count < MOST_NEWTON and not solved:
        count += 1
        stages(eq, w, tab)
        solve(eq, w, tab)
        size = change(eq, w, tab)
        solved = size < w.now[2] or (
            size < TRUSTED_CHANGE and moved < np.inf and size * size / max(moved, 1e-300) < w.now[2]
        )
        if count == 1:
            started = size
        if not size < 2.0 * moved or (size < SOLVED and size > 0.5 * moved):  # not a number, or rounding
            break
        moved = size
    if not (solved or size < SOLVED):
        return -count
    w.measures[0] = defect(eq, w, tab)
    end_state(w, tab)
    project(eq, w, tab)
    keep_path(w)
    w.measures[1] = gap_between(eq, w, tab)
    w.measures[2] = (moved / started) ** (1.0 / (count - 1.0)) if count > 2 and moved > 0.0 else 0.0
    return count


NAMES = {"SOLVED": SOLVED, "TRUSTED_CHANGE": TRUSTED_CHANGE, "MOST_NEWTON": MOST_NEWTON}
