"""Consistent start and freedoms: projection onto the constraints, forced values, redundant and
passing-singular rows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..errors import InputError
from .contract import Array
from .system import System

#: A row is dependent on earlier ones when this share of its gradient is left (noise of redundant rows: up to 3e-9).
DEPENDENT = 1e-7


@dataclass(frozen=True)
class Forced:
    """A start value that must hold: ``value(q) = target`` for positions, ``gradient(q) . v = target`` for
    velocities."""

    label: str
    target: float
    value: Callable[[Array], float]
    gradient: Callable[[Array], Array]


@dataclass(frozen=True)
class Freedoms:
    """Count of coordinates and constraints, and the rows that add nothing.

    `redundant` rows depend on the others in every position near the start, `passing` ones only at the start itself.
    """

    coordinates: int
    constraints: int
    redundant: tuple[int, ...] = ()
    passing: tuple[int, ...] = ()

    @property
    def net(self) -> int:
        """Net freedom: coordinates less independent constraints."""
        return self.coordinates - self.constraints + len(self.redundant)


@dataclass(frozen=True)
class Start:
    """A consistent state: time, coordinates, velocities, freedoms; `active` marks the rows that are not redundant."""

    time: float
    q: Array
    v: Array
    freedoms: Freedoms
    active: np.ndarray = field(repr=False)


def consistent_start(
    system: System,
    time: float = 0.0,
    *,
    q: Array | None = None,
    v: Array | None = None,
    positions: Sequence[Forced] = (),
    velocities: Sequence[Forced] = (),
) -> Start:
    """Nearest state (in the mass norm) to (q, v) that meets the constraints and the forced values.

    Raises
    ------
    InputError
        When a loop cannot close, or forced values contradict the constraints; the message names them.
    """
    q = np.array(system.start_q if q is None else q, dtype=float)
    v = np.array(system.start_v if v is None else v, dtype=float)
    q = _positions(system, time, q, positions)
    v = _velocities(system, time, q, v, velocities)
    freedoms = count_freedoms(system, time, q)
    active = np.ones(system.rows, dtype=bool)
    active[list(freedoms.redundant)] = False
    return Start(float(time), q, v, freedoms, active)


def count_freedoms(system: System, time: float, q: Array, seed: int = 5) -> Freedoms:
    """Redundant rows: dependent at the start and at neighbours on the constraint manifold."""
    here = dependent_rows(system, time, q)
    if not here:
        return Freedoms(system.size, system.rows)
    random = np.random.default_rng(seed)
    fewest = here
    G = system.jacobian(time, q)
    _, sizes, right = np.linalg.svd(G, full_matrices=True)
    rank = int((sizes > 1e-9 * sizes.max(initial=0.0)).sum())
    free = right[rank:].T
    moving = bool(np.any(system.rate(time + 0.037, q)) or np.any(system.rate(time, q)))
    tried = 0
    for size in (0.1, 0.03, 0.01, 0.1, 0.03):
        step = free @ random.standard_normal(free.shape[1])
        length = np.abs(step).max(initial=0.0)
        near = q + (size / length * step if length > 0 else 0.0)
        at = time + (size * random.uniform(0.3, 1.0) if moving else 0.0)
        found, residual = close(system, at, near, ())
        if residual > 1e-11 or np.abs(found - q).max(initial=0.0) < 1e-3 * size:
            continue
        tried += 1
        there = dependent_rows(system, at, found)
        if len(there) < len(fewest):
            fewest = there
        if tried == 3 or not fewest:
            break
    passing = tuple(r for r in here if r not in fewest)
    return Freedoms(system.size, system.rows, tuple(fewest), passing[: len(here) - len(fewest)])


def dependent_rows(system: System, time: float, q: Array) -> list[int]:
    """Rows of G that depend on the ones before them, in the metric of the mass matrix."""
    if system.rows == 0:
        return []
    G = system.jacobian(time, q)
    if system.diagonal_mass:
        B = G * np.sqrt(np.diagonal(system.inverse_mass))
    else:
        B = G @ np.linalg.cholesky(system.inverse_mass)
    lengths = np.sqrt((B * B).sum(axis=1))
    lengths[lengths == 0.0] = 1.0
    B = B / lengths[:, None]
    try:
        if (np.diagonal(np.linalg.cholesky(B @ B.T)) > 1e-4).all():
            return []
    except np.linalg.LinAlgError:
        pass
    basis = np.zeros((0, B.shape[1]))
    found = []
    for r, row in enumerate(B):
        rest = row - basis.T @ (basis @ row)
        rest -= basis.T @ (basis @ rest)
        size = float(np.linalg.norm(rest))
        if size < DEPENDENT:
            found.append(r)
        else:
            basis = np.vstack([basis, rest / size])
    return found


def close(system: System, time: float, q: Array, forced: Sequence[Forced]) -> tuple[Array, float]:
    """Newton onto g = 0 and the forced values by least changes; the best state and its largest residual."""

    def rest(state: Array) -> Array:
        return np.concatenate([system.residual(time, state), [f.value(state) - f.target for f in forced]])

    best, gap = q.copy(), rest(q)
    for _ in range(80):
        size = float(np.abs(gap).max(initial=0.0))
        if size < 1e-15:
            break
        G = np.vstack([system.jacobian(time, best), *(f.gradient(best)[None, :] for f in forced)])
        change = least_change(system, G, gap)
        length = float(np.abs(change).max(initial=0.0))
        factor = min(1.0, 0.5 / length) if length > 0 else 1.0
        for _ in range(12):
            trial = best - factor * change
            new = rest(trial)
            if np.abs(new).max() < size:
                break
            factor *= 0.5
        else:
            break
        best, gap = trial, new
        if np.abs(gap).max() > 0.5 * size and size < 1e-13:
            break
    return best, float(np.abs(gap).max(initial=0.0))


def least_change(system: System, G: Array, right: Array) -> Array:
    """The change of least mass norm with G change = right, in the least-squares sense where G has lost rank.

    Not-a-number where the rows or the right side are not finite: the callers look at what comes back.
    """
    if not (np.isfinite(G).all() and np.isfinite(right).all()):
        return np.full(system.size, np.nan)
    if system.diagonal_mass:
        root = np.sqrt(np.diagonal(system.inverse_mass))
        return root * np.linalg.lstsq(G * root, right, rcond=1e-11)[0]
    root = np.linalg.cholesky(system.inverse_mass)
    return root @ np.linalg.lstsq(G @ root, right, rcond=1e-11)[0]


def _positions(system: System, time: float, q: Array, forced: Sequence[Forced]) -> Array:
    if system.rows == 0 and not forced:
        return q
    found, residual = close(system, time, q, forced)
    if residual <= 1e-10:
        return found
    names = system.row_names()
    gap = np.abs(system.residual(time, found))
    worst = names[int(gap.argmax())] if len(gap) else ""
    if forced:
        free, alone = close(system, time, q, ())
        if alone <= 1e-10:
            off = max(forced, key=lambda f: abs(f.value(free) - f.target))
            other = _at_odds(system, time, q, forced, off)
            against = worst if other is None else f"start value {other.label} = {other.target:g}"
            problem = f"contradicts {against}: a residual of {residual:.3g} is left"
            raise InputError(f"start value {off.label}", off.target, problem, "force another value, or leave it free")
    cure = "check lengths and start poses: the nearest closed position was searched from them"
    raise InputError(worst, None, f"the loop cannot close: a residual of {residual:.3g} (m or rad) is left", cure)


def _at_odds(system: System, time: float, q: Array, forced: Sequence[Forced], blamed: Forced) -> Forced | None:
    """The other forced value that `blamed` contradicts: without it the rest can be met, and `blamed` alone, too."""
    if len(forced) < 2 or close(system, time, q, [blamed])[1] > 1e-10:
        return None
    others = [f for f in forced if f is not blamed]
    return next((o for o in others if close(system, time, q, [f for f in forced if f is not o])[1] <= 1e-10), None)


def _velocities(system: System, time: float, q: Array, v: Array, forced: Sequence[Forced]) -> Array:
    G = system.jacobian(time, q)
    rate = -system.rate(time, q)
    if system.rows == 0 and not forced:
        return v
    if forced:
        rows = np.vstack([G, *(f.gradient(q)[None, :] for f in forced)])
        right = np.concatenate([rate, [f.target for f in forced]])
    else:
        rows, right = G, rate
    made = v - least_change(system, rows, rows @ v - right)
    if not np.isfinite(made).all():
        cure = "look for start values, speeds and forced velocities that are too large"
        raise InputError("start velocities", None, "are not finite numbers once they meet the constraints", cure)
    gap = np.abs(rows @ made - right)
    scale = max(1.0, float(np.abs(right).max(initial=0.0)))
    if gap.max(initial=0.0) > 1e-8 * scale:
        names = [*system.row_names(), *(f"start velocity {f.label}" for f in forced)]
        left = np.linalg.svd(rows.T)[2][-1] if len(rows) > 1 else np.ones(1)
        part = int(np.abs(left[: system.rows]).argmax()) if system.rows else 0
        worst = names[int(gap.argmax())]
        if forced:
            off = max(range(len(forced)), key=lambda k: abs(left[system.rows + k]))
            blame = forced[off]
            weights = np.abs(left)
            weights[system.rows + off] = 0.0
            weights[: system.rows] *= 1.0 - 1e-6  # another forced value before a joint, where both are as much to blame
            second = int(weights.argmax()) if weights.any() else part
            against = names[second]
            if second >= system.rows:
                against += f" = {forced[second - system.rows].target:g}"
            problem = f"contradicts {against} (residual {gap.max():.3g})"
            raise InputError(f"start velocity {blame.label}", blame.target, problem, "force another value")
        raise InputError(worst, None, f"velocities cannot meet it (residual {gap.max():.3g})", "check the motion")
    return made
