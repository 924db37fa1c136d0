"""A system of elements: slices of the state, and the sums of their mass, forces and constraints."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from functools import cached_property
from threading import RLock
from typing import Any, TypeVar

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array, IntArray
from ..series.tape import Program, Tape
from .contract import Element
from .tape_evaluation import TapeElement

T = TypeVar("T")
_MAKING = RLock()


class System:
    """Elements that share one state q of `size` coordinates, under `rows` constraints.

    Parameters
    ----------
    elements
        Bodies, joints and forces that follow the contract in `gearfe.multibody.core.contract`; bodies before those that
        touch them.
    """

    def __init__(self, elements: Sequence[Element]) -> None:
        self.elements = tuple(elements)
        self._known: dict[Hashable, Any] = {}
        #: Returns the `Start` at a time (s) of runs without another one, as a mechanism file has it; None: the start
        #: poses of the elements, made consistent.
        self.start_rule: Callable[[float], Any] | None = None
        if not any(e.size for e in self.elements):
            raise InputError("elements", None, "nothing can move", "give the system at least one body")
        place: dict[int, np.ndarray] = {}
        total = 0
        for element in self.elements:
            place[id(element)] = np.arange(total, total + element.size)
            total += element.size
        self.size = total
        self.index: list[np.ndarray] = []
        for element in self.elements:
            for other in element.touches:
                if id(other) not in place:
                    name = element.name or type(element).__name__
                    cure = "list every touched element in the system"
                    raise InputError(f"element {name!r}", None, "touches an element that is not in the system", cure)
            self.index.append(np.concatenate([place[id(e)] for e in (element, *element.touches)]).astype(int))
        self.forces = [(e, i) for e, i in zip(self.elements, self.index, strict=True) if hasattr(e, "force")]
        #: Forces whose stresses the implicit method takes as unknowns.
        self.stressed: list[tuple[Any, np.ndarray]] = [(e, i) for e, i in self.forces if hasattr(e, "tangent")]
        self._others = [(e, i) for e, i in self.forces if not hasattr(e, "tangent")]
        self.joints = [(e, i) for e, i in zip(self.elements, self.index, strict=True) if e.rows]
        self.rows = sum(e.rows for e, _ in self.joints)
        self.mass = np.zeros((total, total))
        self.damping = np.zeros((total, total))
        self.stiffness = np.zeros((total, total))
        for element, index in zip(self.elements, self.index, strict=True):
            own = place[id(element)]
            if element.size:
                self.mass[np.ix_(own, own)] += element.mass()
            shared = element.shared_mass()
            if shared is not None:
                self.mass[np.ix_(index, index)] += shared
            blocks = element.blocks()
            if blocks is not None:
                self.damping[np.ix_(index, index)] += blocks[0]
                self.stiffness[np.ix_(index, index)] += blocks[1]
        self.linear = bool(self.damping.any() or self.stiffness.any())
        diagonal = np.diagonal(self.mass)
        self.diagonal_mass = bool(np.array_equal(self.mass, np.diag(diagonal)))
        starts = [e.start() for e in self.elements]
        self.start_q = np.concatenate([s[0] for s in starts]) if starts else np.zeros(0)
        self.start_v = np.concatenate([s[1] for s in starts]) if starts else np.zeros(0)
        sizes = [e.units() for e in self.elements]
        #: Sizes of the coordinates and of the rows: divided by them, lengths and angles compare.
        self.units = np.concatenate([s[0] for s in sizes])
        self.row_units = np.concatenate([s[1] for s in sizes])
        #: Which coordinates are angles of bodies.
        self.turns = np.zeros(total, dtype=bool)
        for element in self.elements:
            self.turns[place[id(element)][list(element.turns)]] = True
        breaks = [getattr(e, "breaks", ()) for e in self.elements]
        self.breaks = np.unique(np.concatenate([np.asarray(b, dtype=float) for b in breaks])) if breaks else np.zeros(0)

    def once(self, key: Hashable, make: Callable[[], T]) -> T:
        """Data that follow from the system alone, made when they are first asked for; safe between threads.

        Integrators keep constant tables with the system by this. What changes during a run does not belong here.

        Parameters
        ----------
        key : hashable
            Name of the data, with what else they depend on.
        make : callable
            Makes them.
        """
        with _MAKING:
            if key not in self._known:
                self._known[key] = make()
            known: T = self._known[key]
            return known

    @cached_property
    def inverse_mass(self) -> Array:
        """M^-1, shape (size, size); infinite for links without mass."""
        return self.inverse_of(np.zeros(0))

    def inverse_of(self, added_mass: Array) -> Array:
        """(M + D)^-1 with D = diag(added_mass); no entries mean none."""
        mass = self.mass + np.diag(added_mass) if added_mass.any() else self.mass
        if not self.diagonal_mass:
            return np.asarray(np.linalg.inv(mass), dtype=float)
        with np.errstate(divide="ignore"):
            return np.diag(1.0 / np.diagonal(mass))

    @cached_property
    def mass_root(self) -> Array:
        """R with R^T R = M, shape (size, size)."""
        held = np.diagonal(self.mass) > 0.0
        root = np.zeros_like(self.mass)
        part = self.mass[np.ix_(held, held)]
        root[np.ix_(held, held)] = np.sqrt(part) if self.diagonal_mass else np.linalg.cholesky(part).T
        return root

    @property
    def algebraic(self) -> bool:
        """Return whether all elements are algebraic (`gearfe.multibody.core.contract`)."""
        return all(element.algebraic for element in self.elements)

    def coordinates(self, element: Element) -> np.ndarray:
        """Numbers of the coordinates that `element` owns."""
        return self.index[self.elements.index(element)][: element.size]

    def force(self, t: float | Array, q: Array, v: Array, *, stressed: bool = True) -> Array:
        """Return all applied forces, those of constant stiffness and damping included.

        Parameters
        ----------
        t : float or ndarray, shape (...)
            Times (s).
        q, v : ndarray, shape (..., size)
            Coordinates and velocities.
        stressed : bool
            Whether elements whose stresses the implicit method takes as unknowns are included.

        Returns
        -------
        force : ndarray, shape (..., size)
            Along the coordinates (N, N m).
        """
        total = -(v @ self.damping.T + q @ self.stiffness.T) if self.linear else np.zeros(q.shape)
        for element, index in self.forces if stressed else self._others:
            places: Any = (..., index)  # may repeat
            np.add.at(total, places, in_states(element, element.force, t, q[..., index], v[..., index]))
        return total

    def force_jacobian(self, t: float, q: Array, v: Array, *, stressed: bool = True) -> tuple[Array, Array]:
        """Return the derivatives of the forces, by finite differences for elements without their own.

        Parameters
        ----------
        t : float
            Time (s).
        q, v : ndarray, shape (size,)
            Coordinates and velocities.
        stressed : bool
            Whether elements whose stresses the implicit method takes as unknowns are included.

        Returns
        -------
        by_q, by_v : ndarray, shape (size, size)
            df/dq and df/dv.
        """
        by_q, by_v = -self.stiffness, -self.damping  # new arrays
        for element, index in self.forces if stressed else self._others:
            local = _element_jacobian(element, t, q[index], v[index])
            by_q, by_v = by_q.copy(), by_v.copy()
            np.add.at(by_q, np.ix_(index, index), local[0])
            np.add.at(by_v, np.ix_(index, index), local[1])
        return by_q, by_v

    def load_problem(self, t: float, q: Array, v: Array) -> str:
        """Return which load has no value at a state, and why, or an empty string."""
        return next(filter(None, (e.load_problem(t, q[i], v[i]) for e, i in self.forces)), "")

    def load_pole(self, t: float, q: Array, v: Array) -> str:
        """Return which load grows beyond all bounds at a state, or an empty string."""
        return next(filter(None, (e.load_pole(t, q[i], v[i]) for e, i in self.forces)), "")

    def pole_between(self, before: tuple[float, Array, Array], after: tuple[float, Array, Array]) -> str:
        """Return which load has a pole between two states (t, q, v), or an empty string."""
        for element, index in self.forces:
            states = ((t, q[index], v[index]) for t, q, v in (before, after))
            if pole := element.pole_between(*states):
                return pole
        return ""

    def load_values(self, t: float, q: Array, v: Array) -> list[tuple[str, float]]:
        """Return loads that depend on the state, the bodies they act on, and their values (N, N m)."""
        return [load for element, index in self.forces for load in element.load_values(t, q[index], v[index])]

    @cached_property
    def pieced(self) -> bool:
        """Return whether forces may have kinks."""
        return any(getattr(element, "pieced", False) for element in self.elements)

    def pieces(self, t: float | Array, q: Array, v: Array) -> IntArray:
        """Numbers of the smooth pieces that the forces are on at times (...), shape (..., s); -1 without a value."""
        parts = [(e, i) for e, i in zip(self.elements, self.index, strict=True) if getattr(e, "pieced", False)]
        piece_numbers = [e.pieces(t, q[..., i], v[..., i]) for e, i in parts]  # type: ignore[attr-defined]
        return np.concatenate([np.zeros((*np.shape(t), 0), dtype=np.int64), *piece_numbers], axis=-1)

    @cached_property
    def has_knots(self) -> bool:
        """Return whether rows follow profiles with knots."""
        return any(getattr(element, "has_knots", False) for element in self.elements)

    def knots(self, q: Array) -> IntArray:
        """Pieces of the profiles that rows are on in states (..., size), shape (..., profiles)."""
        parts = [(e, i) for e, i in zip(self.elements, self.index, strict=True) if getattr(e, "has_knots", False)]
        return np.concatenate([e.knots(q[..., i]) for e, i in parts], axis=-1)  # type: ignore[attr-defined]

    def residual(self, t: float | Array, q: Array) -> Array:
        """g, shape (..., rows)."""
        return self._stack("residual", t, q)

    def rate(self, t: float | Array, q: Array) -> Array:
        """Partial time derivative of g, shape (..., rows)."""
        return self._stack("rate", t, q)

    def velocity_terms(self, t: float, q: Array, v: Array) -> Array:
        """g'' without its acceleration part."""
        parts = [e.velocity_terms(t, q[i], v[i]) for e, i in self.joints]
        return np.concatenate(parts) if parts else np.zeros(0)

    def jacobian(self, t: float | Array, q: Array) -> Array:
        """G, shape (..., rows, size)."""
        full = np.zeros((*q.shape[:-1], self.rows, self.size))
        at = 0
        for element, index in self.joints:
            own: Any = element
            full[..., at : at + element.rows, index] += in_states(element, own.jacobian, t, q[..., index])
            at += element.rows
        return full

    def curvature(self, t: float, q: Array, multipliers: Array) -> Array:
        """d(G^T lambda)/dq at fixed lambda; central differences for elements that do not provide theirs."""
        full = np.zeros((self.size, self.size))
        at = 0
        for element, index in self.joints:
            part = multipliers[at : at + element.rows]
            at += element.rows
            if element.constant_jacobian or not part.any():
                continue
            own: Any = element
            if hasattr(own, "curvature"):
                full[np.ix_(index, index)] += own.curvature(q[index], part)
                continue

            def pull(x: Array, own: Any = own, part: Array = part) -> Array:
                return np.asarray(own.jacobian(t, x).T @ part)

            full[np.ix_(index, index)] += differences(pull, q[index])
        return full

    @cached_property
    def program(self) -> Program | None:
        """The system on a tape; None where an element cannot be written."""
        tape = Tape(self.size)
        for element, places in zip(self.elements, self.index, strict=True):
            own: Any = element
            if hasattr(own, "write"):
                if not own.write(tape, places):
                    return None
            elif element.rows or hasattr(element, "force"):
                return None
        return tape.program(self.mass, self.damping, self.stiffness, self.units)

    @property
    def series(self) -> Program | None:
        """The same where it is one of registers and rows alone, which have Taylor series."""
        made = self.program
        return None if made is None or len(made.bars.place) or len(made.floats.place) else made

    def coordinate_names(self) -> list[str]:
        """Names of all coordinates: body and coordinate with its unit, or element and number."""
        return [name for e in self.elements for name in e.coordinate_names or e.numbered("{}_{}", e.size)]

    def row_names(self) -> list[str]:
        """Return a description of each constraint, for messages."""
        return [name for e, _ in self.joints for name in e.row_names or e.numbered("{} ({})", e.rows)]

    def acceleration(
        self, t: float, q: Array, v: Array, active: np.ndarray | None = None, added_mass: Array | None = None
    ) -> tuple[Array, Array]:
        """Return accelerations and multipliers at a consistent state.

        From M a + G^T lambda = f and G a = -(velocity terms).

        Parameters
        ----------
        t : float
            Time (s).
        q, v : ndarray, shape (size,)
            Coordinates and velocities that meet the constraints.
        active : ndarray of bool, shape (rows,), optional
            Constraints that are not redundant, all by default; the others have no multipliers.
        added_mass : ndarray, shape (size,), optional
            Mass by which the elimination raises light links, that of the start (`multibody.core.mass_regularisation`).

        Returns
        -------
        a : ndarray, shape (size,)
            Accelerations.
        multipliers : ndarray, shape (rows,)
            Constraint forces lambda; 0 for rows that are not active.
        """
        f = self.force(t, q, v)
        extra = np.zeros(self.size) if added_mass is None or not added_mass.any() else added_mass
        inverse = self.inverse_of(extra) if extra.any() else self.inverse_mass
        if self.rows == 0:
            return inverse @ f, np.zeros(0)
        keep = np.ones(self.rows, dtype=bool) if active is None else active
        G = self.jacobian(t, q)[keep]
        light = np.flatnonzero(extra)
        free = f[:, None]
        if light.size:  # and the answers to units of the light accelerations
            free = np.column_stack([f, np.diag(extra)[:, light]])
        right = G @ (inverse @ free)
        right[:, 0] += self.velocity_terms(t, q, v)[keep]
        pulls = solve_semidefinite(G @ inverse @ G.T, right)
        made, shares = own_motion(inverse @ (free - G.T @ pulls), light)
        multipliers = np.zeros(self.rows)
        multipliers[keep] = pulls @ shares
        return made, multipliers

    def energy(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Kinetic and potential energy (J) in states (..., size)."""
        kinetic = 0.5 * ((v @ self.mass) * v).sum(axis=-1)
        potential = 0.5 * ((q @ self.stiffness) * q).sum(axis=-1)
        for element, index in zip(self.elements, self.index, strict=True):
            own = getattr(element, "potential", None)
            if own is not None:
                potential = potential + own(q[..., index])
        return kinetic, potential

    def _stack(self, name: str, t: float | Array, q: Array) -> Array:
        parts = [in_states(e, getattr(e, name), t, q[..., i]) for e, i in self.joints]
        return np.concatenate(parts, axis=-1) if parts else np.zeros((*q.shape[:-1], 0))


def in_states(element: Element, function: Any, t: float | Array, *states: Array) -> Array:
    """Evaluate a function of an element in one state, or in those at several times.

    Parameters
    ----------
    element : Element
        The element; one that is written on a tape takes all times at once.
    function : callable
        ``function(t, *states)``.
    t : float or ndarray, shape (n,)
        Times (s).
    *states : ndarray, shape (size,) or (n, size)
        Coordinates, or coordinates and velocities.
    """
    if np.ndim(t) == 0 or isinstance(element, TapeElement):
        return np.asarray(function(t, *states), dtype=float)
    return np.array([function(*state) for state in zip(np.asarray(t), *states, strict=True)])


def own_motion(answers: Array, light: np.ndarray) -> tuple[Array, Array]:
    """Motion with the own masses, and the shares of the answers in it, from answers with added masses.

    `answers`, shape (size, 1 + k), hold the motion that the forces give, and those for a unit of each `light`
    coordinate.
    """
    if not len(light):
        return answers[:, 0], np.ones(1)
    shares = np.append(1.0, np.linalg.solve(np.eye(len(light)) - answers[light, 1:], answers[light, 0]))
    return answers @ shares, shares


def solve_semidefinite(S: Array, right: Array) -> Array:
    """Solution of S x = right; the one of least norm where S has lost rank."""
    if len(S) == 0:
        return np.zeros_like(right)
    return (
        np.asarray(np.linalg.solve(S, right), dtype=float) if regular(S, 1e-7) else least_norm_solution(S, right, 1e-12)
    )


def regular(S: Array, least: float) -> bool:
    """Return whether the pivots of all matrices S (..., m, m) are above the share `least` of their diagonals' roots."""
    try:
        pivots = np.diagonal(np.linalg.cholesky(S), axis1=-2, axis2=-1)
    except np.linalg.LinAlgError:
        return False
    return bool((pivots > least * np.sqrt(np.abs(np.diagonal(S, axis1=-2, axis2=-1)))).all())


def least_norm_solution(S: Array, right: Array, least: float) -> Array:
    """Solve S x = right with least norm in rows of equal size. Singular values below the share `least` are zero.

    NaN where S or `right` is not finite: the integrators then tell the state, LAPACK would raise.
    """
    if not (np.isfinite(S).all() and np.isfinite(right).all()):
        return np.full(right.shape, np.nan)
    scale = np.sqrt(np.abs(np.diagonal(S)))
    scale[scale == 0.0] = 1.0
    x = np.linalg.lstsq(S / np.outer(scale, scale), (right.T / scale).T, rcond=least)[0]
    return np.asarray((x.T / scale).T, dtype=float)


def _element_jacobian(element: Element, t: float, q: Array, v: Array) -> tuple[Array, Array]:
    """Return (df/dq, df/dv) of one element, by central differences if it has none."""
    jacobian: Any = getattr(element, "force_jacobian", None)
    if jacobian is not None:
        return jacobian(t, q, v)
    force: Any = element.force  # type: ignore[attr-defined]
    return differences(lambda x: force(t, x, v), q), differences(lambda x: force(t, q, x), v)


def differences(function: Callable[[Array], Array], x: Array) -> Array:
    """Derivatives of a function (k,) of the vector x, shape (k, n), by central differences."""
    steps = 1e-6 * np.diag(np.maximum(1.0, np.abs(x)))
    columns = [(function(x + step) - function(x - step)) / (2 * step.max()) for step in steps]
    return np.array(columns, dtype=float).T
