"""Consistent start and degrees of freedom: projection onto the constraints, forced values, redundant and
passing-singular rows."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array
from .mass_regularisation import RANK, added_masses, free_motions
from .second_order import SINGULAR, hidden_freedoms, motions_of_second_order
from .system import System

#: A row is dependent on earlier ones when this share of its gradient is left (noise of redundant rows: up to 3e-9).
DEPENDENT = 1e-7
#: Largest turn of a body in one step towards a closed position (rad), and most of these steps.
TURN, MOST_STEPS = 0.3, 200
#: Gaps of closed loops, relative to the mechanism's length or 1 rad.
CLOSED = 1e-10


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
    `hidden` degrees of freedom exist in the gradients only: rows `barely` hold them to second order, everywhere.
    """

    coordinates: int
    constraints: int
    redundant: tuple[int, ...] = ()
    passing: tuple[int, ...] = ()
    hidden: int = 0
    barely: tuple[int, ...] = ()

    @property
    def net(self) -> int:
        """Net degree of freedom: coordinates less independent constraints."""
        return self.coordinates - self.constraints + len(self.redundant) - self.hidden


@dataclass(frozen=True, eq=False)
class Start:
    """A consistent state: time, coordinates, velocities, degrees of freedom; `active` marks the independent rows.

    `added_mass`, shape (size,) or (0,), is the mass by which the elimination raises light links
    (`multibody.core.mass_regularisation`).
    """

    time: float
    q: Array
    v: Array
    freedoms: Freedoms
    active: np.ndarray = field(repr=False)
    added_mass: Array = field(default_factory=lambda: np.zeros(0), repr=False)


def consistent_start(
    system: System,
    time: float = 0.0,
    *,
    q: Array | None = None,
    v: Array | None = None,
    positions: Sequence[Forced] = (),
    velocities: Sequence[Forced] = (),
) -> Start:
    """Return a state near (q, v) that meets the constraints and the forced values.

    The coordinates are guesses: they close on the branch next to them (`close`). Velocities change least in the mass
    norm.

    Parameters
    ----------
    system : System
        The system.
    time : float
        Time of the start (s).
    q, v : ndarray, shape (size,), optional
        Coordinates and velocities; those of the elements by default.
    positions, velocities : sequence of Forced
        Values that must hold.

    Raises
    ------
    InputError
        If a loop cannot close, forced values contradict the constraints, or constraints are singular in every position;
        the message names them.
    """
    q = np.array(system.start_q if q is None else q, dtype=float)
    v = np.array(system.start_v if v is None else v, dtype=float)
    q = _positions(system, time, q, positions)
    v = _velocities(system, time, q, v, velocities)
    freedoms = count_freedoms(system, time, q)
    if freedoms.hidden:
        names = " and ".join(system.row_names()[r] for r in freedoms.barely)
        problem = (
            f"holds only to second order, in every position: gradients leave {freedoms.net + freedoms.hidden} free, the"
            f" joints {freedoms.net}, so motion and forces across it are undetermined"
        )
        raise InputError(names, None, problem, "leave that direction free: a slot instead of a hinge, or a joint less")
    active = np.ones(system.rows, dtype=bool)
    active[list(freedoms.redundant)] = False
    return Start(float(time), q, v, freedoms, active, added_masses(system, time, q, v, active))


def count_freedoms(system: System, time: float, q: Array) -> Freedoms:
    """Find redundant rows, dependent at the start and at its neighbours, and hidden degrees of freedom."""
    dependent = _dependent_rows(system, time, q)
    if not dependent and _regular(system, time, q):
        return Freedoms(system.size, system.rows)
    random = np.random.default_rng(5)
    fewest = dependent
    hidden: list[int] = []
    place, tried = (time, q), 0
    motions = motions_of_second_order(system, time, q, 5)
    for size, motion in zip((0.1, 0.03, 0.01, 0.1, 0.03), motions, strict=False):
        near = q + size * system.units * motion
        at = time + _time_of_change(system, time, q, size * random.uniform(0.3, 1.0))
        found, gap = close(system, at, near, ())
        if not closes(system, found, gap) or np.abs((found - q) / system.units).max(initial=0.0) < 1e-3 * size:
            continue
        tried += 1
        place = at, found
        there = _dependent_rows(system, at, found)
        hidden.append(hidden_freedoms(system, at, found)[1])
        if len(there) < len(fewest):
            fewest = there
        if tried == 3 or (not fewest and not hidden[-1]):
            break
    if not motions:
        hidden = [hidden_freedoms(system, time, q)[0]]
    if min(hidden, default=0):
        barely = tuple(_dependent_rows(system, *place, share=np.sqrt(SINGULAR)))
        return Freedoms(system.size, system.rows - len(barely), (), (), min(hidden), barely)
    passing = tuple(r for r in dependent if r not in fewest)
    return Freedoms(system.size, system.rows, tuple(fewest), passing[: len(dependent) - len(fewest)])


def _regular(system: System, time: float, q: Array) -> bool:
    """Return whether no singular value of the gradients is nearly zero."""
    if system.rows == 0:
        return True
    B = _comparable_rows(system, time, q)
    if _independent(B):
        return True
    sizes = np.linalg.svd(B, compute_uv=False)
    return bool(len(B) <= B.shape[1] and sizes.min() > SINGULAR * sizes.max())


def _time_of_change(system: System, time: float, q: Array, size: float) -> float:
    """Return the time until prescribed motions change a row by `size` of its unit, or most; 0 without motion."""
    here, most, found = system.residual(time, q), 0.0, 0.0
    for step in 2.0 ** np.arange(-60.0, 40.0):
        change = float((np.abs(system.residual(time + step, q) - here) / system.row_units).max(initial=0.0))
        if change > most:
            most, found = change, float(step)
        if change >= size:
            break
    return found


def _comparable_rows(system: System, time: float, q: Array) -> Array:
    """Rows of G of length 1, in coordinates that compare."""
    B = system.jacobian(time, q) * system.units / system.row_units[:, None]
    lengths = np.sqrt((B * B).sum(axis=1))
    lengths[lengths == 0.0] = 1.0
    return np.asarray(B / lengths[:, None])


def _independent(B: Array) -> bool:
    """Return whether rows are clearly independent."""
    try:
        return bool((np.diagonal(np.linalg.cholesky(B @ B.T)) > 1e-4).all())
    except np.linalg.LinAlgError:
        return False


def _dependent_rows(system: System, time: float, q: Array, share: float = DEPENDENT) -> list[int]:
    """Return the rows of G of which the rows before leave less than `share`, in coordinates and rows that compare."""
    if system.rows == 0:
        return []
    B = _comparable_rows(system, time, q)
    if share == DEPENDENT and _independent(B):
        return []
    basis = np.zeros((0, B.shape[1]))
    dependent = []
    for r, row in enumerate(B):
        left = row - basis.T @ (basis @ row)
        left -= basis.T @ (basis @ left)
        size = float(np.linalg.norm(left))
        if size < share:
            dependent.append(r)
        else:
            basis = np.vstack([basis, left / size])
    return dependent


def close(system: System, time: float, q: Array, forced: Sequence[Forced]) -> tuple[Array, Array]:
    """Find the closed position nearest to a guess, or the position of least gap.

    Gauss-Newton with least changes in coordinates divided by their units. Levenberg's damping limits the rotation of a
    body in one step to `TURN`, which keeps the branch of the guess. It also makes every step reduce the gaps.

    Parameters
    ----------
    system : System
        The system.
    time : float
        Time (s).
    q : ndarray, shape (size,)
        Guess of the coordinates.
    forced : sequence of Forced
        Values that must hold, too.

    Returns
    -------
    q : ndarray, shape (size,)
        Coordinates.
    gap : ndarray, shape (rows + forced,)
        Sizes of the gaps of all rows and forced values, in their units.
    """
    sizes = np.concatenate([system.row_units, [_forced_unit(system, f, q) for f in forced]])

    def gaps(state: Array) -> Array:
        return np.concatenate([system.residual(time, state), [f.value(state) - f.target for f in forced]]) / sizes

    best, gap = q.copy(), gaps(q)
    size, damping = float(np.linalg.norm(gap)), 0.0
    for _ in range(MOST_STEPS):
        if not 1e-15 < size < math.inf:
            break
        G = np.vstack([system.jacobian(time, best), *(f.gradient(best)[None, :] for f in forced)])
        G = G * system.units / sizes[:, None]
        if not np.isfinite(G).all():
            break
        left, values, right = np.linalg.svd(G, full_matrices=False)
        largest = float(values.max(initial=0.0))
        part, kept = left.T @ gap, values > RANK * largest
        if size > 1e-9 and np.linalg.norm(part[kept]) < 1e-7 * size:  # no change of the coordinates lessens the gaps
            break
        while damping <= 1e3 * largest:
            change = (part * np.where(kept, values / (values**2 + damping**2 + (values == 0.0)), 0.0)) @ right
            turn = float(np.abs(change[system.turns]).max(initial=0.0))
            if turn <= 1.01 * TURN:
                trial = best - system.units * change
                trial_gap = gaps(trial)
                reached = float(np.linalg.norm(trial_gap))
                if reached < size:
                    break
                damping = max(4.0 * damping, 1e-3 * largest)
            else:
                damping = max(damping * min(turn / TURN, 4.0), 1e-3 * largest)
        else:
            break
        before, best, gap, size = size, trial, trial_gap, reached
        damping = 0.0 if damping < 1e-2 * largest else 0.25 * damping
        if size > 0.5 * before and size < 1e-13:
            break
    return best, np.abs(gap)


def _forced_unit(system: System, forced: Forced, q: Array) -> float:
    """Return the change of a forced value when the coordinates change by their units."""
    change = float(np.abs(forced.gradient(q) * system.units).max(initial=0.0))
    return change if change > 0.0 else max(abs(forced.value(q)), abs(forced.target)) or 1.0


def closes(system: System, q: Array, gap: Array) -> bool:
    """Return whether gaps (in units of the rows) are only rounding, also for coordinates far from the origin."""
    far = float(np.abs(q / system.units).max(initial=0.0))
    return bool(gap.max(initial=0.0) <= CLOSED + 8 * np.finfo(float).eps * far)


def least_change(system: System, G: Array, right: Array, sizes: Array) -> Array:
    """Return the change of least mass norm with G change = right.

    It is that of least squares if G has lost rank. Links may be without mass.

    Parameters
    ----------
    system : System
        The system, for its masses and units.
    G : ndarray, shape (k, size)
        Gradients.
    right : ndarray, shape (k,)
        Right-hand side.
    sizes : ndarray, shape (k,)
        Units by which the rows are divided.

    Returns
    -------
    change : ndarray, shape (size,)
        NaN if the rows or the right-hand side are not finite.
    """
    if not (np.isfinite(G).all() and np.isfinite(right).all()):
        return np.full(system.size, np.nan)
    G, right = G * system.units / sizes[:, None], right / sizes
    some = np.linalg.lstsq(G, right, rcond=RANK)[0]
    free = free_motions(G)
    root = system.mass_root * system.units
    return system.units * (some - free @ np.linalg.lstsq(root @ free, root @ some, rcond=None)[0])


def on_constraints(system: System, t: float, q: Array, v: Array, active: np.ndarray) -> tuple[Array, Array]:
    """Move a state onto g = 0 and G v = -dg/dt by the least changes in the mass norm.

    Parameters
    ----------
    system : System
        The system.
    t : float
        Time (s).
    q, v : ndarray, shape (size,)
        Coordinates and velocities next to the constraints.
    active : ndarray of bool, shape (rows,)
        Constraints that are not redundant; the others follow by themselves.

    Returns
    -------
    q, v : ndarray, shape (size,)
        Coordinates and velocities on the constraints.
    """
    if system.rows == 0:
        return q, v
    sizes = system.row_units[active]
    for _ in range(5):
        gap = system.residual(t, q)[active]
        if np.abs(gap / sizes).max(initial=0.0) < 1e-14:
            break
        q = q - least_change(system, system.jacobian(t, q)[active], gap, sizes)
    G = system.jacobian(t, q)[active]
    return q, v - least_change(system, G, G @ v + system.rate(t, q)[active], sizes)


def _positions(system: System, time: float, q: Array, forced: Sequence[Forced]) -> Array:
    if system.rows == 0 and not forced:
        return q
    found, gap = _assemble_near(system, time, q, forced)
    if closes(system, found, gap):
        return found
    name, much = _worst_gap(system, time, found)
    if forced:
        free, alone = _assemble_near(system, time, q, ())
        if closes(system, free, alone):
            sizes = [_forced_unit(system, f, q) for f in forced]
            off = max(range(len(forced)), key=lambda k: abs(forced[k].value(free) - forced[k].target) / sizes[k])
            other = _at_odds(system, time, q, forced, forced[off])
            against = name if other is None else f"start value {other.label} = {other.target:g}"
            problem = f"contradicts {against}: a residual of {float(gap.max()):.3g} of its size is left"
            label = f"start value {forced[off].label}"
            raise InputError(label, forced[off].target, problem, "force another value, or leave it free")
    cure = "check lengths and start poses: the nearest closed position was searched from them"
    raise InputError(name, None, f"the loop cannot close: a residual of {much} is left", cure)


def _assemble_near(system: System, time: float, q: Array, forced: Sequence[Forced]) -> tuple[Array, Array]:
    """Return the result of `close`, or the nearest position that closes from guesses near q."""
    found, gap = close(system, time, q, forced)
    if closes(system, found, gap) or not np.isfinite(gap).all():
        return found, gap
    turns = np.flatnonzero(system.turns)
    random = np.random.default_rng(3)
    nearest = math.inf
    for size in np.repeat([0.1, 0.3, 0.6], 4 if len(turns) else 0):
        guess = q.copy()
        guess[turns] += size * random.standard_normal(len(turns))
        other, rest = close(system, time, guess, forced)
        far = float(np.linalg.norm((other - q) / system.units))
        if closes(system, other, rest) and far < nearest:
            found, gap, nearest = other, rest, far
    return found, gap


def _worst_gap(system: System, time: float, q: Array) -> tuple[str, str]:
    """Row with the largest gap, and this gap in words: in its unit and against the mechanism's length."""
    gap = np.abs(system.residual(time, q))
    if not len(gap):
        return "", "nothing"
    worst = int((gap / system.row_units).argmax())
    first = 0
    for element, _ in system.joints:
        if worst < first + element.rows:
            own = gap[first : first + element.rows]
            return system.row_names()[worst], element.gap_text(own, worst - first)
        first += element.rows
    raise IndexError(worst)


def _at_odds(system: System, time: float, q: Array, forced: Sequence[Forced], blamed: Forced) -> Forced | None:
    """The other forced value that `blamed` contradicts: without it the rest can be met, and `blamed` alone, too."""

    def met(some: Sequence[Forced]) -> bool:
        return closes(system, *_assemble_near(system, time, q, some))

    if len(forced) < 2 or not met([blamed]):
        return None
    others = [f for f in forced if f is not blamed]
    return next((o for o in others if met([f for f in forced if f is not o])), None)


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
    sizes = np.concatenate([system.row_units, [_forced_unit(system, f, q) for f in forced]])
    projected = v - least_change(system, rows, rows @ v - right, sizes)
    if not np.isfinite(projected).all():
        cure = "look for start values, speeds and forced velocities that are too large"
        raise InputError("start velocities", None, "are not finite numbers once they meet the constraints", cure)
    gap = np.abs(rows @ projected - right) / sizes
    scale = max(float(np.abs(x).max(initial=0.0)) for x in (right / sizes, v / system.units, projected / system.units))
    if gap.max(initial=0.0) > 1e-8 * scale:
        names = [*system.row_names(), *(f"start velocity {f.label}" for f in forced)]
        share = np.linalg.svd((rows * system.units / sizes[:, None]).T)[2][-1] if len(rows) > 1 else np.ones(1)
        part = int(np.abs(share[: system.rows]).argmax()) if system.rows else 0
        worst = names[int(gap.argmax())]
        much = f"residual {float(gap.max() * sizes[gap.argmax()]):.3g}"
        if forced:
            off = max(range(len(forced)), key=lambda k: abs(share[system.rows + k]))
            blame = forced[off]
            weights = np.abs(share)
            weights[system.rows + off] = 0.0
            weights[: system.rows] *= 1.0 - 1e-6  # another forced value before a joint, where both are as much to blame
            second = int(weights.argmax()) if weights.any() else part
            against = names[second]
            if second >= system.rows:
                against += f" = {forced[second - system.rows].target:g}"
            problem = f"contradicts {against} ({much})"
            raise InputError(f"start velocity {blame.label}", blame.target, problem, "force another value")
        raise InputError(worst, None, f"velocities cannot meet it ({much})", "check the motion")
    return projected
