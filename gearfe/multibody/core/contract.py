"""The component contract: what a body, a joint or a force provides, and what the integrators make of it.

A system is a list of elements. Element i owns `size` coordinates of the state q (a slice of it) and may look
at those of
other elements, named in `touches`. Every method gets the *local* coordinates: its own first, then those of the touched
elements in that order, k numbers in all. The equations of motion are

    M q'' = f(t, q, q') - G(t, q)^T lambda,        g(t, q) = 0,        G = dg/dq

1. A body (size > 0) MUST provide ``mass()``: its constant, symmetric positive definite mass matrix (size, size).
   Inertia that depends on velocity (gyroscopic terms) is a force.
2. A force MUST provide ``force(t, q, v)``: generalised forces on the local coordinates, shape (k,). An applied force
   and its reaction on a touched body are both entries of this one vector.
3. A joint (rows > 0) MUST provide ``residual(t, q)`` (rows,), ``jacobian(t, q)`` (rows, k), and
   ``velocity_terms(t, q, v)`` (rows,). The last is the part of g'' without accelerations: g'' = G a + velocity_terms.
   It MUST provide ``rate(t, q)`` (rows,), the partial derivative of g with respect to time, if that is not zero.
   Positions enter g, never velocities; a prescribed rate is integrated to a prescribed position.
4. ``start()`` gives start coordinates and velocities of the own coordinates (zeros by default).

It MAY provide

5. ``blocks()``: constant (C, K), both (k, k), with the force ``-C v - K q`` on the local coordinates: an elastic body
   in modal coordinates. ``force`` then holds only what is left. Absent: no linear part.
6. ``force_jacobian(t, q, v)``: (df/dq, df/dv) of ``force``, both (k, k). Absent: finite differences, one call per
   coordinate, in the implicit integrator only.
7. ``constant_jacobian = True`` if g is linear in q with constant coefficients and no time. Such rows are eliminated at
   set-up by `gearfe.multibody.core.elimination` for integrators that profit. Absent: treated as any constraint.
8. ``algebraic = True``: planar bodies under loads that do not depend on the state, and rows without profiles; and
   ``steady_forces = True``: its forces depend on no coordinate or velocity.
9. ``potential(q)``: its potential energy in local coordinates (..., k). Absent: zero. (The kinetic one is 1/2 v M v.)
10. Being a `LocalForce`: a force along few directions, ``f = W phi(t, W^T q, W^T v)``, with a law that can be compiled.
    Absent: the force is called as it is; collocation then calls Python in every stage.
11. ``units()``: sizes of the own coordinates and of the rows that count as much as 1 rad, so that bounds do not depend
    on the unit of length. Absent: ones.
12. ``shared_mass()``: constant mass on the local coordinates (k, k), for what gives mass to the coordinates of others:
    a beam whose nodes are bodies of a linkage. Absent: none.
13. ``stiff = True``: its fast motions leave steps of series next to no length; ``method="auto"`` then is the implicit
    method. Absent: not stiff.
14. ``write(tape, places)``: its rows and forces on a `multibody.series.tape.Tape`, `places` being the numbers of the
    local coordinates; False where they cannot be written. Rows are quadratic in coordinates, cosines and sines. The
    Taylor method then runs any system compiled. Not needed by what has neither rows nor ``force``. A
    `gearfe.multibody.core.tape_evaluation.TapeElement` has the rows of 3. from it.
15. ``pieced = True`` and ``pieces(t, q, v)``: whole numbers, shape (..., s) at times (...), that change where its force
    has a kink, a jump or a pole; -1 where it has no value. Steps of the implicit method end there. Absent: smooth.
16. ``has_knots = True`` and ``knots(q)``: whole numbers, shape (..., s) in states (..., k), that change where the third
    derivative of a row jumps (knots of a cam's profile). Steps of the implicit method end there. Absent: smooth.
17. ``breaks``: times at which a force or joint is not smooth. Steps of all integrators end there. Absent: none.
18. Names and places for messages and tables: ``coordinate_names``, ``row_names``, ``row_joint`` (number of the joint of
    each row), ``joint_places`` (of each joint: body -> point at which its force acts), ``turns`` (own coordinates that
    are angles), ``planar_bodies`` (names of bodies with the coordinates x, y, angle, in order), ``gap_text``. Absent:
    numbers.
19. ``load_problem``, ``load_pole``, ``pole_between``: which force has no value, or grows beyond all bounds, at given
    states. Integrators ask after a step has failed. Absent: empty strings. ``load_values``: names and values of loads
    that depend on the state; the cause of a stopped run is sought among them. Absent: no loads.

An element has no state of its own that changes during a run: integrators call it at trial points in any order.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.typing import Array, IntArray

if TYPE_CHECKING:
    from ..series.tape import Tape


class Element:
    """Base of all components: no coordinates, no force, no rows. See the module's docstring for the contract."""

    size: int = 0
    rows: int = 0
    name: str = ""
    touches: tuple[Element, ...] = ()
    constant_jacobian: bool = False
    stiff: bool = False
    algebraic: bool = False
    steady_forces: bool = False
    coordinate_names: tuple[str, ...] = ()
    turns: tuple[int, ...] = ()
    planar_bodies: tuple[str, ...] = ()
    row_names: tuple[str, ...] = ()
    row_joint: tuple[int, ...] = ()
    joint_places: tuple[dict[str, tuple[float, float]], ...] = ()

    def mass(self) -> Array:
        """Mass matrix of the own coordinates."""
        return np.eye(self.size)

    def start(self) -> tuple[Array, Array]:
        """Start coordinates and velocities of the own coordinates."""
        return np.zeros(self.size), np.zeros(self.size)

    def blocks(self) -> tuple[Array, Array] | None:
        """Constant damping and stiffness on the local coordinates."""
        return None

    def shared_mass(self) -> Array | None:
        """Constant mass on the local coordinates."""
        return None

    def rate(self, t: float, q: Array) -> Array:  # noqa: ARG002
        """Partial derivative of the residual with respect to time."""
        return np.zeros(self.rows)

    def velocity_terms(self, t: float, q: Array, v: Array) -> Array:  # noqa: ARG002
        """Second time derivative of the residual without its acceleration part."""
        return np.zeros(self.rows)

    def units(self) -> tuple[Array, Array]:
        """Sizes of the own coordinates and of the rows that bounds are relative to."""
        return np.ones(self.size), np.ones(self.rows)

    def numbered(self, pattern: str, count: int) -> list[str]:
        """Names with numbers, for elements that name nothing themselves."""
        label = self.name or type(self).__name__
        return [pattern.format(label, k) for k in range(count)]

    def gap_text(self, gaps: Array, row: int) -> str:
        """The size of the gap (rows,) at a row, for messages."""
        return f"{gaps[row]:.3g}"

    def load_problem(self, t: float, q: Array, v: Array) -> str:  # noqa: ARG002
        """Why its force has no value at a state, or an empty string."""
        return ""

    def load_pole(self, t: float, q: Array, v: Array) -> str:  # noqa: ARG002
        """Return the name of the force that is unbounded at a state, or an empty string."""
        return ""

    def pole_between(self, before: tuple[float, Array, Array], after: tuple[float, Array, Array]) -> str:  # noqa: ARG002
        """Return the name of the force with a pole between two states (t, q, v), or an empty string."""
        return ""

    def load_values(self, t: float, q: Array, v: Array) -> list[tuple[str, float]]:  # noqa: ARG002
        """Loads that depend on the state, named with the bodies that they act on, and their values (N, N m)."""
        return []


@dataclass(frozen=True, eq=False)
class ModalBlocks(Element):
    """A body given by constant matrices: coordinates eta with M eta'' + C eta' + K eta = forces.

    Parameters
    ----------
    M, C, K : ndarray, shape (r, r)
        Mass, damping and stiffness (any consistent units).
    """

    M: Array
    C: Array
    K: Array
    name: str = "modal body"
    q0: Array | None = None
    v0: Array | None = None

    @property
    def size(self) -> int:  # type: ignore[override]
        """Number of coordinates."""
        return len(self.M)

    def mass(self) -> Array:
        """M."""
        return self.M

    def start(self) -> tuple[Array, Array]:
        """Start state, zero when not given."""
        zero = np.zeros(len(self.M))
        return (zero if self.q0 is None else self.q0), (zero if self.v0 is None else self.v0)

    def blocks(self) -> tuple[Array, Array]:
        """(C, K)."""
        return self.C, self.K


@dataclass(frozen=True, eq=False)
class LinearJoint(Element):
    """Constant linear constraints ``A q = b`` on the coordinates of the touched elements; A has the shape (rows, k)."""

    touches: tuple[Element, ...] = field()
    A: Array = field()
    b: Array = field()
    name: str = "linear joint"
    constant_jacobian: bool = True

    @property
    def rows(self) -> int:  # type: ignore[override]
        """Number of constraints."""
        return len(self.A)

    def residual(self, t: float, q: Array) -> Array:  # noqa: ARG002
        """A q - b."""
        return self.A @ q - self.b

    def jacobian(self, t: float, q: Array) -> Array:  # noqa: ARG002
        """A."""
        return self.A

    def write(self, tape: Tape, places: IntArray) -> bool:
        """A q - b."""
        for row, value in zip(self.A, self.b, strict=True):
            tape.row({int(i): float(f) for i, f in zip(places, row, strict=True) if f}, constant=-float(value))
        return True


@dataclass(frozen=True, eq=False)
class SeriesLaw:
    """A law phi(t, u, u') of p directions by the orders of its Taylor series: module-level functions for numba.

    Time is t + s x, s the trial step; ``u[k, j]`` is order j of direction k over x. The law keeps its own series in
    ``memory[row, order]``, from order to order of one step. In ``pieces`` it keeps whole numbers for the whole run: the
    smooth pieces on which it is.

    Parameters
    ----------
    begin
        ``begin(t, sign, u, du, memory, pieces)`` sets the pieces at the start, and what the memory holds from one step
        to the next. u, du are values and rates; sign is the direction of time. Called from Python.
    order
        ``order(j, t, s, u, parameters, memory, pieces, out)``: order j of the forces into ``out[k]``, from orders up to
        j of u and up to j + 1 for u'.
    discontinuity
        ``discontinuity(last, limit, parameters, memory, pieces, ahead)``: where x, up to `limit`, leaves a
        smooth piece, 2 when it does not; the pieces then continue to the next. With `ahead` from orders 0 and 1 a
        little past that place, for the length of the step; pieces stay.
    helpers
        Functions that they call by name.
    parameters
        What they get: an array, or named tuples of arrays.
    rows, pieces
        Number of series in the memory, and of whole numbers.
    names
        Constants that the functions use.
    """

    begin: Callable[..., None]
    order: Callable[..., None]
    discontinuity: Callable[..., float]
    helpers: tuple[Callable[..., object], ...]
    parameters: Any
    rows: int
    pieces: int
    names: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class LocalForce(Element):
    """Force along few directions: ``f = W law(t, W^T q, W^T v)``, the law being any callable of state and time.

    Parameters
    ----------
    touches
        Elements whose coordinates the directions are written in.
    W : ndarray, shape (k, p)
        Directions on the local coordinates.
    law
        ``law(t, u, du) -> (p,)`` with u = W^T q, du = W^T v: any callable of state and time.
    series
        The same law by the orders of its Taylor series. When the only force of a linear system has one, the whole
        integration runs compiled.
    breaks
        Times (s) at which the law is not smooth.
    piece_numbers
        ``(t, u, du)`` -> whole numbers, shape (..., s) at times (...), that change where the law has a kink or a
        jump; None: it is smooth.
    """

    touches: tuple[Element, ...] = field()
    W: Array = field()
    law: Callable[[float, Array, Array], Array] = field()
    series: SeriesLaw | None = None
    breaks: tuple[float, ...] = ()
    piece_numbers: Callable[[float | Array, Array, Array], IntArray] | None = None
    name: str = "local force"

    @property
    def pieced(self) -> bool:
        """Return whether the law has kinks or jumps."""
        return self.piece_numbers is not None

    def pieces(self, t: float | Array, q: Array, v: Array) -> IntArray:
        """Numbers of the smooth pieces that the law is on, shape (..., s)."""
        assert self.piece_numbers is not None
        return self.piece_numbers(t, q @ self.W, v @ self.W)

    def force(self, t: float, q: Array, v: Array) -> Array:
        """W law."""
        return self.W @ np.atleast_1d(self.law(t, self.W.T @ q, self.W.T @ v))

    def force_jacobian(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """W (d law / du) W^T and the same for u': differences along the directions alone."""
        u, du = self.W.T @ q, self.W.T @ v
        here = np.atleast_1d(self.law(t, u, du))
        by = np.zeros((2, len(u), len(u)))
        for j in range(len(u)):
            for part, state in enumerate((u, du)):
                moved = state.copy()
                moved[j] += 1e-6 * max(1.0, abs(state[j]))
                there = np.atleast_1d(self.law(t, moved, du) if part == 0 else self.law(t, u, moved))
                by[part][:, j] = (there - here) / (moved[j] - state[j])
        return self.W @ by[0] @ self.W.T, self.W @ by[1] @ self.W.T
