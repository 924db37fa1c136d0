"""Integrate by Taylor series: expand, choose the step, find its end, project onto the constraints.

A step ends at a singular position instead of crossing it, and where a switch leaves its piece.

Read from the bottom up. `integrate_series` is the loop, `land` finds the end of a step, `project` puts it onto the
constraints. `next_singular` and `locate` look for singular positions.

The step length follows from the last two coefficients (Jorba & Zou, Exp. Math. 14 (2005) 99-117): |q_N| h^N <=
tolerance, in units of the coordinates. Forces within the step are checked against their series.

At a singular position that is passed, a combination z^T g of the constraints loses its gradient, G^T z = 0. The
gradient passes through zero there: B = d(G^T z)/dt != 0. Two branches cross. The motion continues on the one that its
velocity selects. The condition z^T G v = 0 keeps the position on it, z^T g'' = 0 the velocity; both are linear in the
direction B. All rows that become singular at the same time take part, of any number of loops.

A series that starts at the distance d from a singular position amplifies round-off by (h/d)^N beyond it, so no step
crosses one. The step ends there, and the next one is expanded there with the bordered equations of
`series.recurrences`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ....base.typing import Array, IntArray
from ...core.steps import Status
from ...series.recurrences import (
    OUTSIDE,
    accelerations,
    add_regularisation,
    add_transposed,
    border_solve,
    constrained,
    copy,
    curve_forces,
    expand,
    factorise,
    fill,
    gradient_rates,
    gradients,
    horner,
    inner,
    is_pole,
    largest,
    leaves,
    margin,
    next_piece,
    rates,
    regularisation_responses,
    residuals,
    small_solve,
    solve,
    tape_order,
    time_series,
    times_gradients,
    variables,
)

if TYPE_CHECKING:
    from ...series.row_tables import Equations
    from ...series.work_space import Border, Run, Work

DONE, STEP_TOO_SMALL, MOST_STEPS = int(Status.DONE), int(Status.STEP_TOO_SMALL), int(Status.MOST_STEPS)
NO_BRANCH, NOT_FINITE, SINGULAR_START = int(Status.NO_BRANCH), int(Status.NOT_FINITE), int(Status.SINGULAR_START)
#: State of a run: time, singular rows there, time to the next singular position, 1 once begun, last step, row of the
#: next singular position (-1 for none).
TIME, SINGULAR, AHEAD, BEGUN, LAST_STEP, ROW = range(6)
#: Angle (rad) that bodies turn against each other between two looks for singular positions.
FAR = 0.5
#: Most changes of pieces at one time.
MOST_CHANGES = 50
#: Places within a step at which forces are compared with their series; rounding of what they find; share of a step that
#: is tried after one that was off.
LOOKS_WITHIN, ROUNDING, SHORTER = 4, 1e-11, 0.6
#: Pivot of S relative to its diagonal below which a singular position is looked for.
NEAR = 0.3
#: Pivot (square of a distance in rad) of other rows at the singular position of one row below which they are tried
#: together with it.
TOGETHER = 1e-6
#: Pivot of another row at the singular position of one row below which it passes with it (eps^(2/3): at the distance d
#: between two, rounding leaves eps / d^2 of the velocities, more than taking both for one does).
SAME = 4e-11


def series_step(last: float, before: float, run: Run) -> float:
    """Longest step on which the last term and the one before, as coefficients, stay below the tolerance."""
    step = np.inf
    if last > 0.0:
        step = min(step, (run.tolerance / last) ** (1.0 / run.order))
    if before > 0.0:
        step = min(step, (run.tolerance / before) ** (1.0 / (run.order - 1)))
    return step


def next_goal(breaks: Array, t: float, end: float, sign: float) -> float:
    """Return the first break after a time, or the end of the run (s).

    Parameters
    ----------
    breaks : ndarray, shape (b,)
        Times at which steps end, rising (s).
    t : float
        Time (s).
    end : float
        End of the run (s).
    sign : float
        1 forwards in time, -1 backwards.
    """
    count = breaks.shape[0]
    rounding = 1e-13 * max(abs(t), abs(end - t))
    low = 0
    high = count
    while low < high:
        middle = (low + high) // 2
        if sign * (breaks[middle if sign > 0.0 else count - 1 - middle] - t) <= rounding:
            low = middle + 1
        else:
            high = middle
    if low < count:
        found = breaks[low if sign > 0.0 else count - 1 - low]
        if sign * (end - found) > 0.0:
            return found
    return end


def even_step(size: float, remains: float) -> float:
    """A step of at most this size towards a goal: no short one is left before it."""
    if size >= remains:
        return remains
    return 0.5 * remains if size > 0.5 * remains else size


class Samples(NamedTuple):
    """Requested output times of a run, and the values there."""

    ends: Array  # (pieces + 1,) of the steps (s)
    coefficients: Array  # (pieces, orders, c)
    sign: float  # of time
    times: Array  # (t,) in order of travel (s)
    derivative: int
    out: Array  # (t, c) coordinates, or that derivative of them


def sample(samples: Samples) -> int:
    """Coordinates or a derivative of them from the series of the steps; returns 0."""
    T, C, sign, times, derivative, out = (
        samples.ends, samples.coefficients, samples.sign, samples.times, samples.derivative, samples.out,
    )  # fmt: skip
    piece = 0
    last = C.shape[0] - 1
    for i in range(times.shape[0]):
        while piece < last and sign * (times[i] - T[piece + 1]) > 0.0:
            piece += 1
        while piece > 0 and sign * (times[i] - T[piece]) < 0.0:
            piece -= 1
        h = times[i] - T[piece]
        for c in range(out.shape[1]):
            out[i, c] = 0.0
        for j in range(C.shape[1] - 1, derivative - 1, -1):
            factor = 1.0
            for d in range(derivative):
                factor *= j - d
            for c in range(out.shape[1]):
                out[i, c] = out[i, c] * h + factor * C[piece, j, c]
    return 0


def evaluate(Z: Array, order: int, h: float, q: Array, v: Array) -> None:
    """Write the state of a series at t0 + h.

    Parameters
    ----------
    Z : ndarray, shape (variables, orders)
        Series of the variables, coordinates first.
    order : int
        Highest order that counts.
    h : float
        Time from the expansion (s).
    q, v : ndarray, shape (n,)
        Coordinates and velocities; written.
    """
    for i in range(q.shape[0]):
        value = Z[i, order]
        rate = 0.0
        for j in range(order - 1, -1, -1):
            rate = rate * h + value
            value = value * h + Z[i, j]
        q[i] = value
        v[i] = rate


def factor_at(tb: Equations, w: Work, q: Array) -> tuple[float, int]:
    """w.G, w.val, w.diag at the coordinates q; the least pivot ratio and its row."""
    gradients(tb, w, q)
    return factorise(tb, w, w.base, 0.0)


def project(tb: Equations, w: Work, run: Run, t: float, q: Array, v: Array) -> tuple[float, float]:
    """Move a state onto g = 0 and G v = df/dt by the smallest change in the mass norm.

    Parameters
    ----------
    tb : Equations
        The system.
    w : Work
        Scratch arrays; ``w.G``, ``w.val``, ``w.diag`` then belong to the new state.
    run : Run
        What holds for the whole run.
    t : float
        Time (s).
    q, v : ndarray, shape (n,)
        Coordinates and velocities; changed.

    Returns
    -------
    first : float
        First change of the coordinates in their units; infinite if the projection does not converge.
    least : float
        Least pivot ratio.
    """
    rows = tb.program.rows
    time_series(tb.program.times, t, run.sign > 0.0, 3, w.TF)
    first = 0.0
    for sweep in range(8):
        least, _ = factor_at(tb, w, q)
        residuals(tb, w, w.mu)
        change = least_change(tb, w, q)
        if sweep == 0:
            first = change
        if change < 1e-9 or not np.isfinite(change):  # the next change would be its square
            break
    if first > 0.0:
        least, _ = factor_at(tb, w, q)
    for _ in range(2):
        times_gradients(tb, w.G, v, w.mu)
        for r in range(w.mu.shape[0]):
            if rows.motion[r] >= 0:
                w.mu[r] -= w.TF[rows.motion[r], 1]
        faster = least_change(tb, w, v)
    if change >= 1e-9 or not np.isfinite(change + faster):
        first = np.inf
    return first, least


def least_change(tb: Equations, w: Work, x: Array) -> float:
    """x -= M^-1 G^T S^-1 w.mu: the smallest change (in the mass norm) that lowers G x by w.mu. Returns its largest
    entry, in units of the coordinates; infinity where it is no number."""
    for r in range(w.mu.shape[0]):
        if w.base[r] != 0:
            w.mu[r] = 0.0
    solve(tb, w.val, w.mu)
    fill(w.F, 0.0)
    add_transposed(tb, w.G, w.mu, 1.0, w.F)
    biggest = 0.0
    total = 0.0
    accelerations(tb, w.F, w.u)
    for i in range(x.shape[0]):
        x[i] -= w.u[i]
        total += abs(w.u[i])  # unlike a maximum, a sum keeps what is not a number
        biggest = max(biggest, abs(w.u[i]) / tb.program.unit[i])
    return biggest if np.isfinite(total) else np.inf


def regular_parts(tb: Equations, w: Work, row: int) -> None:
    """w.mu := S^-1 S e_row over the rows that are not skipped: how they make up the gradient of `row`."""
    row_gradient(tb, w, row)
    accelerations(tb, w.u, w.F)
    times_gradients(tb, w.G, w.F, w.mu)
    for r in range(w.mu.shape[0]):
        if w.skip[r] != 0:
            w.mu[r] = 0.0
    solve(tb, w.val, w.mu)


def row_gradient(tb: Equations, w: Work, r: int) -> None:
    """w.u := the gradient of row r."""
    fill(w.u, 0.0)
    for e in range(tb.gradient.first[r], tb.gradient.first[r + 1]):
        w.u[tb.gradient.column[e]] = w.G[e]


def row_square(tb: Equations, w: Work, r: int) -> float:
    """Square of the gradient of row r in the norm of the inverse masses; it is in w.u."""
    row_gradient(tb, w, r)
    return inner(tb, w.u, w.u)


def next_singular(tb: Equations, w: Work, run: Run, v: Array, low: float, high: float) -> tuple[float, int]:
    """Estimate the first singular position from here within low < sign tau < high.

    It is judged from all small pivots. For each such row z = S^-1 e_row, p = G^T z. The vector is orthogonal to the
    gradients of all other rows, so only the part of B = dG^T/dt z across them changes it. This is the part of B
    orthogonal to all rows, plus the part along p. If the row is to become singular, most of that part is along p.

    Parameters
    ----------
    tb : Equations
        The system.
    w : Work
        Gradients and factor at the state.
    run : Run
        What holds for the whole run.
    v : ndarray, shape (n,)
        Velocities there.
    low, high : float
        Bounds of the time in the direction of travel (s).

    Returns
    -------
    tau : float
        Time from here (s); infinite for none.
    row : int
        Row that passes, -1 for none.
    """
    z, sign = w.rhs, run.sign
    m = w.mu.shape[0]
    found = np.inf
    first = -1
    moving = False
    for row in range(m):
        if w.base[row] != 0 or NEAR * w.val[row] * w.diag[row] <= 1.0:
            continue
        if not moving:
            gradient_rates(tb, w, v)
            moving = True
        fill(w.mu, 0.0)
        w.mu[row] = 1.0
        solve(tb, w.val, w.mu)
        for r in range(m):
            z[r] = w.mu[r] / w.mu[row] if r != row else 1.0
        fill(w.F, 0.0)
        add_transposed(tb, w.G, z, 1.0, w.F)
        fill(w.u, 0.0)
        add_transposed(tb, w.dG, z, 1.0, w.u)
        pp = inner(tb, w.F, w.F)
        pb = inner(tb, w.F, w.u)
        if pp <= 0.0 or pb == 0.0:
            continue
        tau = -pp / pb
        if not (low < sign * tau < high and sign * tau < sign * found):
            continue
        accelerations(tb, w.u, w.F)
        times_gradients(tb, w.G, w.F, w.mu)
        for r in range(m):
            if w.base[r] != 0:  # redundant rows take no part
                w.mu[r] = 0.0
        solve(tb, w.val, w.mu)
        add_transposed(tb, w.G, w.mu, -1.0, w.u)
        if pb * pb > pp * inner(tb, w.u, w.u):
            found = tau
            first = row
    return found, first


def singular_frame(tb: Equations, w: Work, q: Array, v: Array, bound: float) -> int:
    """Set up the bordered system of the singular rows: Z, B and p = G^T Z in w.border.

    The rows with w.skip = 2 are left out of the factor, and rows with pivots below `bound` join them.

    Parameters
    ----------
    tb : Equations
        The system.
    w : Work
        Scratch arrays; gradients, factor and border change.
    q, v : ndarray, shape (n,)
        Coordinates and velocities.
    bound : float
        Pivot ratio below which a row joins.

    Returns
    -------
    count : int
        Number of singular rows; 0 if the bordered system is singular, too.
    """
    border = w.border
    m = w.mu.shape[0]
    gradients(tb, w, q)
    gradient_rates(tb, w, v)
    factorise(tb, w, w.skip, bound)
    count = 0
    for row in range(m):
        if w.skip[row] != 2:
            continue
        if count == border.drop.shape[0]:
            return 0
        p = count
        border.drop[p] = row
        count += 1
        regular_parts(tb, w, row)
        for r in range(m):
            border.Z[p, r] = -w.mu[r]
        border.Z[p, row] = 1.0
        fill(border.P[p], 0.0)
        add_transposed(tb, w.G, border.Z[p], 1.0, border.P[p])
        fill(border.B[p], 0.0)
        add_transposed(tb, w.dG, border.Z[p], 1.0, border.B[p])
        accelerations(tb, border.B[p], w.F)
        times_gradients(tb, w.G, w.F, w.mu)
        for r in range(m):
            border.E[p, r] = w.mu[r] if w.skip[r] == 0 else 0.0
            border.Y[p, r] = border.E[p, r]
        solve(tb, w.val, border.Y[p])
    for p in range(count):
        for k in range(p + 1):
            value = inner(tb, border.B[p], border.B[k])
            for r in range(m):
                value -= border.Y[p, r] * border.E[k, r]
            border.schur[p, k] = value
            border.schur[k, p] = value
    return count if border_share(tb, border, count) > 1e-8 else 0


def border_share(tb: Equations, border: Border, count: int) -> float:
    """Return the least share of a direction B outside the regular rows and other directions (pivots of L D L^T)."""
    L = border.small
    least = 1.0
    for p in range(count):
        for k in range(p + 1):
            L[p, k] = border.schur[p, k]
            for i in range(k):
                L[p, k] -= L[p, i] * L[k, i] * L[i, i]
            if k < p:
                L[p, k] /= L[k, k]
        plain = inner(tb, border.B[p], border.B[p])
        share = L[p, p] / plain if plain > 0.0 else 0.0
        if not share > 1e-30:
            return 0.0
        least = min(least, share)
    return least


def border_change(tb: Equations, w: Work, count: int, x: Array) -> float:
    """Lower [G_reg; B] x by (w.mu, border.nu) with the smallest change of x in the mass norm.

    Parameters
    ----------
    tb : Equations
        The system.
    w : Work
        Factor, border and right-hand sides; changed.
    count : int
        Number of singular rows.
    x : ndarray, shape (n,)
        Coordinates or velocities; changed.

    Returns
    -------
    largest : float
        Largest entry of the change, in units of the coordinates.
    """
    border = w.border
    for r in range(w.mu.shape[0]):
        if w.skip[r] != 0:
            w.mu[r] = 0.0
    border_solve(tb, w.val, border, w.mu, count)
    fill(w.F, 0.0)
    add_transposed(tb, w.G, w.mu, 1.0, w.F)
    for p in range(count):
        for i in range(x.shape[0]):
            w.F[i] += border.B[p, i] * border.nu[p]
    accelerations(tb, w.F, w.u)
    biggest = 0.0
    for i in range(x.shape[0]):
        x[i] -= w.u[i]
        biggest = max(biggest, abs(w.u[i]) / tb.program.unit[i])
    return biggest


def combination(border: Border, p: int, values: Array) -> float:
    """z_p . values."""
    total = 0.0
    for r in range(values.shape[0]):
        total += border.Z[p, r] * values[r]
    return total


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

    Newton on: regular rows of g = 0, z^T G v = 0, and time such that B . G^T z = 0. It is a true crossing if z^T g
    vanishes there, too. A near miss (rod a little longer than the crank) has a residual and is integrated as usual. All
    rows that become singular at the same time take part. These are the rows with pivots below `TOGETHER` near the
    singular position of the first one. Rows that keep a gradient there are excluded.

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
    """Replace rows without gradient by redundant rows that have one here; return the number of singular rows left.

    Which row of a dependent set may be left out changes along the motion. An example is three parallel cranks without
    the x-row of one. The remaining rows lose rank where the end of that crank moves along x, although the mechanism is
    regular there.
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
    """Return whether z^T g vanishes, so that two branches cross, for all singular rows."""
    border = w.border
    residuals(tb, w, w.mu)
    for p in range(count):
        scale = 0.0
        for r in range(w.mu.shape[0]):
            scale = max(scale, abs(border.Z[p, r]) * tb.program.rows.unit[r])
        if abs(combination(border, p, w.mu)) > 1e-10 * scale:
            return False
    return True


def step_length(tb: Equations, w: Work, run: Run) -> float:
    """Longest step whose last two terms stay below the tolerance, also those of what switches."""
    Z, R, order, unit = w.Z, w.R, run.order, tb.program.unit
    last = 0.0
    before = 0.0
    both = 0.0
    for i in range(unit.shape[0]):
        one, two = abs(Z[i, order]) / unit[i], abs(Z[i, order - 1]) / unit[i]
        both += one + two  # unlike a maximum, a sum keeps what is not a number
        last = max(last, one)
        before = max(before, two)
    step = min(series_step(last, before, run), run.longest, abs(run.end - run.begin))
    for s in range(w.pieces.shape[0]):
        r = tb.program.switches.register[s]
        for _ in range(200):
            bound = run.tolerance * max(abs(R[r, 0]), abs(R[r, 1]) * step, abs(R[r, 2]) * step**2)
            if max(abs(R[r, order - 1]) * step ** (order - 1), abs(R[r, order - 2]) * step ** (order - 2)) <= bound:
                break
            step *= 0.9
    return step if np.isfinite(both) else 0.0


def clear_series(w: Work) -> None:
    """Series that holds position and velocity only."""
    for i in range(w.q.shape[0]):
        fill(w.Z[i], 0.0)
        w.Z[i, 0] = w.q[i]
        w.Z[i, 1] = w.v[i]


def _singular_behind(tb: Equations, w: Work, run: Run, t: float, ahead: float, where: int) -> tuple[int, float]:
    """Find the singular position just behind a start: (singular rows, time from the start to it)."""
    copy(w.base, w.skip)
    expand(tb, w, run, t, 0)
    if abs(ahead) > step_length(tb, w, run):
        return 0, 0.0
    count, found = locate(tb, w, run, t, ahead, abs(ahead), where)
    if count > 0 and run.sign * found > 0.0:
        count = 0
    return count, found


def begin(tb: Equations, w: Work, run: Run, t: float) -> tuple[int, float, float, int, int]:
    """Find a consistent start next to a singular position; the state is then in w.q, w.v.

    Parameters
    ----------
    tb : Equations
        The system.
    w : Work
        State of the start in ``w.q``, ``w.v``; changed.
    run : Run
        What holds for the whole run.
    t : float
        Time of the start (s).

    Returns
    -------
    singular : int
        Number of rows that are singular there.
    shift : float
        Time from t to the state (s).
    ahead : float
        Time to the singular position ahead (s); infinite for none.
    row : int
        Row that passes there, -1 for none.
    status : int
        `DONE`, or `NO_BRANCH` if the velocity selects no branch.
    """
    while True:
        least, where = factor_at(tb, w, w.q)
        if least >= 1e-10:
            break
        speed = 1e-300
        for i in range(w.v.shape[0]):
            speed = max(speed, abs(w.v[i]) / tb.program.unit[i])
        clear_series(w)
        count, found = locate(tb, w, run, t, 0.0, 1e-3 / speed, where)
        if count == 0:
            return 0, 0.0, np.inf, -1, NO_BRANCH
        count = exchange(tb, w, count)
        if count > 0:
            copy(w.qn, w.q)
            copy(w.vn, w.v)
            return count, found, np.inf, -1, DONE
    project(tb, w, run, t, w.q, w.v)
    ahead, where = next_singular(tb, w, run, w.v, -np.inf, np.inf)
    if where >= 0 and run.sign * ahead < 0.0:
        count, found = _singular_behind(tb, w, run, t, ahead, where)
        if count > 0:
            copy(w.qn, w.q)
            copy(w.vn, w.v)
            return count, found, np.inf, -1, DONE
        project(tb, w, run, t, w.q, w.v)
        ahead, where = np.inf, -1
    return 0, 0.0, ahead, where, DONE


def turned(tb: Equations, w: Work) -> float:
    """Largest angle by which two bodies (or a body and the ground) turn against each other from w.Z to w.qn."""
    most = 0.0
    least = 0.0
    curves = tb.program.curves
    for f in range(curves.sign.shape[0]):
        i = curves.place[f, 0]
        most = max(most, w.qn[i] - w.Z[i, 0])
        least = min(least, w.qn[i] - w.Z[i, 0])
    return most - least


def _singular_within(tb: Equations, w: Work, run: Run, h: float, low: float, high: float) -> tuple[float, int]:
    """Find the first singular position of the series within low < sign tau < high: (time, row).

    It is searched from several places inside the step. The row is -1 if there is none.
    """
    evaluate(w.Z, run.order, h, w.qn, w.vn)
    looks = int(np.ceil(turned(tb, w) / FAR))
    for k in range(1, looks):
        place = h * k / looks
        evaluate(w.Z, run.order, place, w.qn, w.vn)
        factor_at(tb, w, w.qn)
        spacing = abs(h) / looks
        first = max(-spacing, low - run.sign * place)
        tau, row = next_singular(tb, w, run, w.vn, first, min(spacing, high - run.sign * place))
        if row >= 0:
            return place + tau, row
    return np.inf, -1


def _land(tb: Equations, w: Work, run: Run, state: Array, h: float, close: float) -> tuple[float, int, float, int, int]:
    """End a step of at most |h|: (step, singular rows there, time to the next ones, their row, status).

    The state there is in w.qn, w.vn.

    A step ends on a singular position within `close` (0.7 of the last step) even if |h| is shorter. So close to it, |h|
    is determined by round-off in the last coefficients, not by the motion.
    """
    t, ahead, row, sign = state[TIME], state[AHEAD], int(state[ROW]), run.sign
    base = w.base
    passed = 0.0  # up to there none is left to find
    for _ in range(40 + 4 * base.shape[0]):
        lowest = max(passed, 1e-3 * abs(h)) if state[SINGULAR] > 0.0 else passed
        near = max(1.3 * abs(h), close)
        guess, where = _singular_within(tb, w, run, h, lowest, near)
        evaluate(w.Z, run.order, h, w.qn, w.vn)
        first, least = project(tb, w, run, t + h, w.qn, w.vn)
        tau, after = next_singular(tb, w, run, w.vn, lowest - abs(h), np.inf)
        if where < 0 and after >= 0:
            guess = h + tau
            where = after
        if (where < 0 or sign * guess >= near) and row >= 0 and lowest < sign * ahead < near:
            guess = ahead
            where = row
        if where >= 0 and base[where] == 0 and lowest < sign * guess < near:
            reach = 0.5 * max(abs(h), abs(guess))
            count, found = locate(tb, w, run, t, guess, reach, where)
            if count > 0 and lowest < sign * found:
                if sign * found <= max(1.000001 * abs(h), close):
                    count = exchange(tb, w, count)
                    if count == 0:  # it was one of the chosen rows only: look again
                        continue
                    tau, after = next_singular(tb, w, run, w.vn, 0.0, np.inf)
                    return found, count, tau, after, DONE
                h = 0.6 * found
                evaluate(w.Z, run.order, h, w.qn, w.vn)
                first, least = project(tb, w, run, t + h, w.qn, w.vn)
                if first < 1e3 * run.tolerance + 1e-10:
                    return h, 0, found - h, where, DONE
                continue
            passed = 1.01 * abs(guess)  # none, or the one at the beginning of the step
            continue
        if first < 1e3 * run.tolerance + 1e-10 and least > 1e-12:
            return h, 0, tau, after, DONE
        h = 0.7 * h
    return h, 0, np.inf, -1, STEP_TOO_SMALL


def _defect(tb: Equations, w: Work, run: Run, t: float, h: float, singular: int) -> float:
    """Return the largest error of the series within the step h by the forces there, in units of the coordinates.

    A series does not contain changes that are below the rounding of its terms. For example, the series of tanh about
    100 is the constant 1, but tanh is not. The factor is that at the end of the step, with `singular` rows.
    """
    program = tb.program
    P, F, code, switches = w.P, w.F, program.code, program.switches
    n = w.q.shape[0]
    if tb.mass.light.shape[0] > 0:
        regularisation_responses(tb, singular, w)
    speed = 1e-300
    for i in range(n):
        speed = max(speed, abs(w.v[i]) / program.unit[i])
    lasting = max(abs(h), min(1.0 / speed, abs(run.end - run.begin)))  # time in which an error of the speed displaces
    most = 0.0
    for look in range(LOOKS_WITHIN):
        place = h * (look + 1) / LOOKS_WITHIN
        evaluate(w.Z, run.order, place, w.dq, w.dv)
        variables(tb, w, w.dq)
        rates(tb, w, w.dv)
        ends = look == LOOKS_WITHIN - 1
        time_series(program.times, t + place, run.sign < 0.0 if ends else run.sign > 0.0, 1, w.TF)
        tape_order(program, P, w.R0, w.TF, w.pieces, 0)
        for s in range(w.pieces.shape[0]):
            r = switches.register[s]
            if margin(switches, s, w.pieces[s], w.R0[r, 0]) < -OUTSIDE * largest(w.R, r, run.order - 1, h):
                return np.inf
        for i in range(w.H0.shape[0]):
            w.H0[i, 0] = 0.0
        for c in range(code.checked.shape[0]):
            p = code.checked[c]
            r = code.push[p, 0]
            w.H0[code.push[p, 1], 0] += code.share[p] * (w.R0[r, 0] - horner(w.R, r, run.order - 1, place))
        for i in range(n):
            F[i] = w.H0[i, 0]
        curve_forces(program, P, w.H0, 0, F)
        accelerations(tb, F, w.u)
        times_gradients(tb, w.G, w.u, w.mu)
        for r in range(w.mu.shape[0]):
            if w.skip[r] != 0:
                w.mu[r] = 0.0
        for p in range(singular):
            w.border.nu[p] = 0.0
            for i in range(n):
                w.border.nu[p] += w.border.B[p, i] * w.u[i]
        constrained(tb, singular, w, w.mu, w.u, w.a)
        if tb.mass.light.shape[0] > 0:
            add_regularisation(tb, singular, w, w.mu, w.a)
        for i in range(n):
            off = abs(w.a[i] * h) * lasting / program.unit[i]
            most = max(most, off) if np.isfinite(off) else np.inf
    return most


class Output(NamedTuple):
    """Output arrays of a run, and its current position."""

    state: Array  # (6,) time, singular rows, time to the singular position ahead ..., see above
    times: Array  # (room + 1,) ends of the steps (s)
    coefficients: Array  # (room, order + 1, n) of their series
    singular: IntArray  # (room,) number of singular rows at the start of each
    made: IntArray  # (1,) number of steps


def integrate_series(tb: Equations, w: Work, run: Run, out: Output) -> int:
    """Integrate from (w.q, w.v) to run.end, or until the output is full.

    Parameters
    ----------
    tb : Equations
        The system.
    w : Work
        State and scratch arrays; call again with the same ones to continue.
    run : Run
        What holds for the whole run.
    out : Output
        Steps and their series, and the state of the run.

    Returns
    -------
    status : int
        Of `Status`; SINGULAR_START asks for `begin` (rare, so it stays in Python) before the next call.
    """
    state, T, C, singular = out.state, out.times, out.coefficients, out.singular
    sign, pieces, switches, order = run.sign, w.pieces, tb.program.switches, run.order
    t = state[TIME]
    status = DONE
    count = 0
    changes = 0
    out.made[0] = 0
    bound = 2.0 * order**2 * run.tolerance + ROUNDING
    if state[BEGUN] == 0.0:
        copy(w.q, w.qn)
        copy(w.v, w.vn)
        copy(w.base, w.skip)
        first, least = project(tb, w, run, t, w.q, w.v)
        if least < 1e-6 or not np.isfinite(first):
            copy(w.qn, w.q)
            copy(w.vn, w.v)
            return SINGULAR_START
        state[AHEAD], state[ROW] = next_singular(tb, w, run, w.v, 0.0, np.inf)
        state[BEGUN] = 1.0
    T[0] = t
    while status == DONE and sign * (run.end - t) > 0.0:
        if count >= singular.shape[0]:
            status = MOST_STEPS
            break
        rows = int(state[SINGULAR])
        expand(tb, w, run, t, rows)
        size = step_length(tb, w, run)
        if not size > 1e-14 * max(abs(t), abs(run.end - run.begin)):
            status = STEP_TOO_SMALL
            break
        goal = next_goal(run.breaks, t, run.end, sign)
        remains = sign * (goal - t)
        size = even_step(size, remains)
        h, where = leaves(tb.program, w.R, pieces, order - 1, sign * size)
        if where >= 0 and is_pole(switches, w.R, where, order - 1, h, size):
            status = NOT_FINITE
            break
        if h == 0.0:
            changes += 1
            other = next_piece(switches, where, pieces[where], w.R[switches.register[where], 0])
            if other == pieces[where] or changes > MOST_CHANGES:
                status = NOT_FINITE
                break
            pieces[where] = other
            continue
        close = min(0.7 * state[LAST_STEP], remains)
        rows_there, ahead, row, off = 0, np.inf, -1, np.inf
        for _ in range(60):
            limit = h
            if where >= 0:
                close = min(close, abs(h))
            h, rows_there, ahead, row, status = _land(tb, w, run, state, limit, close)
            if status != DONE:
                break
            if rows_there == 0:
                copy(w.base, w.skip)
            if h != limit:
                where = -1
            if tb.program.code.checked.shape[0] == 0:
                off = 0.0
                break
            off = _defect(tb, w, run, t, h, rows_there)
            if off < bound:
                break
            h *= SHORTER
            close = 0.0
            where = -1
        if status == DONE and not off < bound:
            status = STEP_TOO_SMALL
        if status != DONE:
            break
        for k in range(order + 1):
            for i in range(C.shape[2]):
                C[count, k, i] = w.Z[i, k]
        singular[count] = rows
        changes = 0
        if where >= 0:
            r = switches.register[where]
            other = next_piece(switches, where, pieces[where], horner(w.R, r, order - 1, h))
            if other == pieces[where]:
                status = NOT_FINITE
            else:
                pieces[where] = other
        t = goal if h == sign * remains else t + h
        count += 1
        T[count] = t
        copy(w.qn, w.q)
        copy(w.vn, w.v)
        state[TIME] = t
        state[SINGULAR] = rows_there
        state[AHEAD] = ahead
        state[LAST_STEP] = abs(h)
        state[ROW] = row
    for i in range(w.q.shape[0]):
        if not (np.isfinite(w.q[i]) and np.isfinite(w.v[i])):
            status = NOT_FINITE
    out.made[0] = count
    return status


#: Functions of the loop; of starts beside a singular position, which stay in Python.
FUNCTIONS = (
    series_step, next_goal, even_step, sample,
    evaluate, factor_at, project, least_change, regular_parts, row_gradient, row_square, next_singular,
    singular_frame, border_share, border_change, combination,
    moved_state, time_to_singular, locate, _meet, _converge, _add_rates, _split, exchange, passes,
    step_length, turned, _singular_within, _land, _defect, integrate_series,
)  # fmt: skip
STARTERS = (clear_series, _singular_behind, begin)
NAMES = {
    "DONE": DONE, "STEP_TOO_SMALL": STEP_TOO_SMALL, "MOST_STEPS": MOST_STEPS, "NO_BRANCH": NO_BRANCH,
    "NOT_FINITE": NOT_FINITE, "SINGULAR_START": SINGULAR_START, "TIME": TIME, "SINGULAR": SINGULAR, "AHEAD": AHEAD,
    "BEGUN": BEGUN, "LAST_STEP": LAST_STEP, "ROW": ROW, "FAR": FAR, "MOST_CHANGES": MOST_CHANGES,
    "LOOKS_WITHIN": LOOKS_WITHIN, "ROUNDING": ROUNDING, "SHORTER": SHORTER,
    "NEAR": NEAR, "TOGETHER": TOGETHER, "SAME": SAME,
}  # fmt: skip
