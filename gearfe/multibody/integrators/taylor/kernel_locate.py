"""Finding a passing singular position: the rows that pass together, its moment, the state there (in w.qn, w.vn).

The conditions are in `kernel_singular`. All rows that pass at the same moment take part, however many loops fold.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ....typing import Array
from ...series.recurrences import (
    add_transposed,
    copy,
    fill,
    inner,
    residuals,
    small_solve,
    time_series,
    times_gradients,
)
from .kernel_singular import TOGETHER, border_change, combination, evaluate, regular_parts, row_square, singular_frame

if TYPE_CHECKING:
    from ...series.row_tables import Equations
    from ...series.work_space import Run, Work

#: Pivot of another row at the singular position of one row below which it passes with it (eps^(2/3): at the distance d
#: between two, rounding leaves eps / d^2 of the velocities, more than taking both for one does).
SAME = 4e-11


def moved_state(w: Work, run: Run, h: float) -> None:
    """State of the series at h with the corrections w.dq, w.dv."""
    evaluate(w.Z, run.order, h, w.qn, w.vn)
    for i in range(w.qn.shape[0]):
        w.qn[i] += w.dq[i]
        w.vn[i] += w.dv[i]


def time_to_singular(tb: Equations, w: Work, p: int) -> float:
    """Time from here to the moment at which P_p vanishes along B_p."""
    return -inner(tb, w.border.P[p], w.border.B[p]) / w.border.schur[p, p]


def locate(tb: Equations, w: Work, run: Run, t: float, guess: float, reach: float, where: int) -> tuple[int, float]:
    """Find the passing singular position near a guess, and the rows that pass together there.

    Newton on: regular rows of g = 0, z^T G v = 0, and time such that B . G^T z = 0. It is a true crossing when z^T g
    vanishes there too; a near miss (rod a little longer than the crank) leaves a residual and is integrated as usual.
    All rows that pass at the same moment take part: those with pivots below `TOGETHER` near the singular position of
    the first one, less those that keep a gradient where the others have none.

    Parameters
    ----------
    tb : Equations
        The system.
    w : Work
        Series about the time t in ``w.Z``; the state found is in ``w.qn``, ``w.vn``, the rows have ``w.skip`` = 2.
    run : Run
        What holds for the whole run.
    t : float
        Time of the expansion (s).
    guess : float
        Guess of the time from there (s).
    reach : float
        Largest distance from the guess (s).
    where : int
        Row that passes.

    Returns
    -------
    count : int
        Number of rows that pass; 0 if there is no such position.
    h : float
        Time of the position from the expansion (s).
    """
    count, h = _meet(tb, w, run, guess, reach, where)
    for _ in range(count):
        count, h = _converge(tb, w, run, t, h, guess, reach)
        if count == 0 or not _split(tb, w, count, where):
            break
    if count == 0 or not passes(tb, w, count):
        return 0, h
    return count, h


def _meet(tb: Equations, w: Work, run: Run, guess: float, reach: float, where: int) -> tuple[int, float]:
    """Return the number of rows (w.skip = 2) that pass with the row `where`, and its time along the series."""
    h = guess
    for _ in range(30):
        copy(w.base, w.skip)
        w.skip[where] = 2
        evaluate(w.Z, run.order, h, w.qn, w.vn)
        count = singular_frame(tb, w, w.qn, w.vn, TOGETHER)
        move = np.inf
        for p in range(count):
            if w.border.drop[p] == where:
                move = time_to_singular(tb, w, p)
        if not abs(h + move - guess) <= reach:
            return 0, h
        if abs(move) < 1e-4 * reach:
            left = 0
            for p in range(count):
                if abs(time_to_singular(tb, w, p) - move) > 0.5 * reach:
                    w.skip[w.border.drop[p]] = 0
                else:
                    left += 1
            return left, h + move
        h += move
    return 0, h


def _converge(tb: Equations, w: Work, run: Run, t: float, h: float, guess: float, reach: float) -> tuple[int, float]:
    """Converge to the singular position of the rows with w.skip = 2 from the time h: Newton of `locate`."""
    border, q, v = w.border, w.qn, w.vn
    n = q.shape[0]
    fill(w.dq, 0.0)
    fill(w.dv, 0.0)
    for _ in range(30):
        moved_state(w, run, h)
        count = singular_frame(tb, w, q, v, 0.0)
        if count == 0:
            return 0, h
        move = 0.0
        for p in range(count):
            move += time_to_singular(tb, w, p) / count
        # position: g_reg and z^T (G v - df/dt)
        time_series(tb.program.times, t + h, run.sign > 0.0, 3, w.TF)
        times_gradients(tb, w.G, v, w.mu)
        _add_rates(tb, w, 1, -1.0, w.mu)
        for p in range(count):
            border.nu[p] = combination(border, p, w.mu)
        residuals(tb, w, w.mu)
        copy(q, w.work)
        change = border_change(tb, w, count, q)
        for i in range(n):
            w.dq[i] += q[i] - w.work[i]
        # velocity: G_reg v - df/dt and half of z^T g'' (linear in v along B)
        times_gradients(tb, w.dG, v, w.mu)
        _add_rates(tb, w, 2, -2.0, w.mu)
        for p in range(count):
            border.nu[p] = 0.5 * combination(border, p, w.mu)
        times_gradients(tb, w.G, v, w.mu)
        _add_rates(tb, w, 1, -1.0, w.mu)
        copy(v, w.work)
        border_change(tb, w, count, v)
        for i in range(n):
            w.dv[i] += v[i] - w.work[i]
        h += move
        if abs(h - guess) > reach or not np.isfinite(h) or not np.isfinite(change):
            return 0, h
        if abs(move) < 1e-10 * reach and change < 1e-10:  # the next change would be its square
            moved_state(w, run, h)
            return singular_frame(tb, w, q, v, 0.0), h
    return 0, h


def _add_rates(tb: Equations, w: Work, order: int, factor: float, out: Array) -> None:
    """Add `factor` times the coefficient `order` of every row's time function to `out`."""
    motion = tb.program.rows.motion
    for r in range(out.shape[0]):
        if motion[r] >= 0:
            out[r] += factor * w.TF[motion[r], order]


def _split(tb: Equations, w: Work, count: int, where: int) -> bool:
    """Keep only rows that pass with the row `where` (w.skip = 2); return whether any row was released."""
    border = w.border
    worst = 0.0
    own = 0.0
    for p in range(count):
        size = row_square(tb, w, border.drop[p])
        worst = max(worst, inner(tb, border.P[p], border.P[p]) / size)
        border.nu[p] = time_to_singular(tb, w, p)
        if border.drop[p] == where:
            own = border.nu[p]
    if worst < SAME:
        return False
    far = 0.0
    for p in range(count):
        far = max(far, abs(border.nu[p] - own))
    kept = 0
    for p in range(count):
        if abs(border.nu[p] - own) > 0.5 * far:
            w.skip[border.drop[p]] = 0
        else:
            kept += 1
    return kept < count


def exchange(tb: Equations, w: Work, count: int) -> int:
    """Number of singular rows that are left when every redundant row that has a gradient of its own here takes the
    place of a row that lost its.

    Which row of a dependent set may be left out changes along the motion: without the x-row of one of three parallel
    cranks, what is left loses rank where that crank's end moves along x, though the mechanism is regular there.
    """
    border = w.border
    for row in range(w.base.shape[0]):
        if w.base[row] == 0 or count == 0:
            continue
        regular_parts(tb, w, row)
        for r in range(w.mu.shape[0]):
            w.mu[r] = -w.mu[r]
        w.mu[row] = 1.0
        fill(w.F, 0.0)
        add_transposed(tb, w.G, w.mu, 1.0, w.F)
        if inner(tb, w.F, w.F) < TOGETHER * row_square(tb, w, row):
            continue
        for p in range(count):
            border.nu[p] = inner(tb, border.B[p], w.F)
        small_solve(border.schur, count, border.nu, border.small)
        most = 0
        for p in range(1, count):
            if border.nu[p] ** 2 * border.schur[p, p] > border.nu[most] ** 2 * border.schur[most, most]:
                most = p
        w.base[row] = 0
        w.base[border.drop[most]] = 1
        w.skip[row] = 0
        w.skip[border.drop[most]] = 1
        count = singular_frame(tb, w, w.qn, w.vn, 0.0)
    return count


def passes(tb: Equations, w: Work, count: int) -> bool:
    """Whether z^T g vanishes, so that two branches cross, for all singular rows."""
    border = w.border
    residuals(tb, w, w.mu)
    for p in range(count):
        scale = 0.0
        for r in range(w.mu.shape[0]):
            scale = max(scale, abs(border.Z[p, r]) * tb.program.rows.unit[r])
        if abs(combination(border, p, w.mu)) > 1e-10 * scale:
            return False
    return True


FUNCTIONS = (moved_state, time_to_singular, locate, _meet, _converge, _add_rates, _split, exchange, passes)
NAMES = {"SAME": SAME}
