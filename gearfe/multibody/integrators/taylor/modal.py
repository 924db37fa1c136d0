"""Integrate in modal coordinates: y'' = -omega^2 y - C y' + W^T phi(t, W y, W y').

The only force is a `LocalForce` whose law has a series. The motion is therefore a Taylor series of up to `ORDER` terms,
in a compiled loop.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from ....base.typing import Array
from ...compiled.kernels import Kernels, packed
from ...core.contract import LocalForce, SeriesLaw
from ...core.dense import Dense, within_run
from ...core.elimination import ModalCoordinates, is_linear
from ...core.start import Start
from ...core.steps import Pace, Status, run_in_pieces
from ...core.system import System
from . import kernel_modal

#: Highest order of the series; 24 to 36 cost the same within a tenth.
ORDER = 30
#: Asked tolerance -> that of the terms that a series leaves out: the energy of a free pair of gears then keeps to ten
#: times the tolerance.
SERIES_SHARE = 0.1


def run_modal_taylor(
    modal: ModalCoordinates, start: Start, times: Array, *, tolerance: float, longest: float,
    pace: Pace | None = None,
) -> tuple[Dense, Status, dict[str, Any]]:  # fmt: skip
    """Integrate by Taylor series in modal coordinates, in compiled code.

    Parameters
    ----------
    modal : ModalCoordinates
        Modal coordinates of the system, whose only force has a series.
    start : Start
        Consistent start.
    times : ndarray, shape (t,)
        Output times (s); the run goes from the start to the last.
    tolerance : float
        Of each step, relative to the largest value of each modal coordinate.
    longest : float
        Longest step (s).
    pace : Pace, optional
        Bounds the number of steps and reports it.

    Returns
    -------
    dense : SeriesPieces
        Coordinates over time.
    status : Status
        Why the run ended.
    statistics : dict
        Scheme, steps and orders.
    """
    found = series_force(modal.system)
    assert found is not None  # the caller asks before
    n = modal.T.shape[1]

    local = max(SERIES_SHARE * tolerance, 1e-14)
    run = SeriesRun(modal, *found, local, longest)
    compiling = run.load()
    y0 = np.concatenate(modal.reduce(start.q, start.v))
    ends, states, at_times, status, orders = run.steps(start.time, y0, float(times[-1]), times, pace)
    statistics = {
        "scheme": "Taylor series",
        "steps": len(ends) - 1,
        "orders": orders,
        "compile_seconds": compiling,
        "free_coordinates": n,
    }
    return SeriesPieces(ends, states, times[: len(at_times)], at_times, run), status, statistics


def series_force(system: System) -> tuple[LocalForce, np.ndarray, SeriesLaw] | None:
    """The only force of a system with linear constraints, where it acts, and its series; None where there is none."""
    if not is_linear(system) or len(system.forces) != 1:
        return None
    force, index = system.forces[0]
    if not isinstance(force, LocalForce) or force.series is None:
        return None
    return force, index, force.series


@lru_cache(maxsize=8)
def _kernels(order: Any, discontinuity: Any, helpers: tuple[Any, ...], constants: tuple[Any, ...]) -> Kernels:
    functions = (*kernel_modal.FUNCTIONS, *helpers, order, discontinuity)
    names = {"np": np, "math": math, "LEAST": kernel_modal.LEAST, **dict(constants)}
    alias = {order.__name__: "law_order", discontinuity.__name__: "law_discontinuity"}
    return Kernels(functions, names, ("modal_steps",), alias=alias)


@dataclass(frozen=True, eq=False)
class SeriesRun:
    """Compiled integration of a system by Taylor series, from any state."""

    modal: ModalCoordinates
    force: LocalForce
    index: np.ndarray
    series: SeriesLaw
    tolerance: float
    longest: float

    @property
    def _bound(self) -> Kernels:
        series = self.series
        return _kernels(series.order, series.discontinuity, series.helpers, tuple(sorted(series.names.items())))

    def expand(self, t: float, y: Array, derivative: int) -> Array:
        """Coordinates, velocities or accelerations of the system in the state y at the time t."""
        modal, n = self.modal, len(y) // 2
        if derivative == 2:
            free = modal.constant - modal.eigenvalues * y[:n] - modal.damping @ y[n:]
            return np.asarray(modal.T @ (free + modal.force(t, y[:n], y[n:])))
        return np.asarray(modal.T @ y[n:] if derivative else modal.origin + modal.T @ y[:n])

    def load(self) -> float:
        """Compile the kernels, or load them, by a run of no length; seconds that this took."""
        return self._bound.load(lambda: self.steps(0.0, np.zeros(2 * self.modal.T.shape[1]), 0.0, np.zeros(1)))

    def steps(
        self, t0: float, y0: Array, t1: float, output_times: Array, pace: Pace | None = None,
    ) -> tuple[Array, Array, Array, Status, int]:  # fmt: skip
        """Integrate from a state and keep the states at the asked times.

        Parameters
        ----------
        t0 : float
            Time at the begin (s).
        y0 : ndarray, shape (2 n,)
            Modal coordinates, then velocities there.
        t1 : float
            Time at the end (s).
        output_times : ndarray, shape (a,)
            Asked times in order of travel (s).
        pace : Pace, optional
            Bounds the number of steps and reports it.

        Returns
        -------
        ends : ndarray, shape (steps + 1,)
            Ends of the steps (s).
        states : ndarray, shape (steps + 1, 2 n)
            States there.
        found : ndarray, shape (reached, 2 n)
            States at the asked times that were reached.
        status : Status
            Why the run ended.
        orders : int
            Number of orders computed.
        """
        modal, series = self.modal, self.series
        n = modal.T.shape[1]
        W = np.ascontiguousarray((modal.T[self.index].T @ self.force.W).T)
        offset = np.atleast_1d(modal.origin[self.index] @ self.force.W)
        diagonal = np.diagonal(modal.damping).copy()
        full = not np.array_equal(modal.damping, np.diag(diagonal))
        equations = kernel_modal.Equations(
            modal.eigenvalues, np.ascontiguousarray(modal.damping), diagonal, full, modal.constant, W, offset,
            series.parameters, np.asarray(modal.system.breaks, dtype=float), self.tolerance, self.longest,
        )  # fmt: skip
        memory, pieces = np.zeros((series.rows, ORDER + 1)), np.zeros(series.pieces, dtype=np.int64)
        series.begin(t0, 1.0 if t1 >= t0 else -1.0, W @ y0[:n] + offset, W @ y0[n:], memory, pieces)
        work = kernel_modal.work_space((memory, pieces), y0, len(W))
        found = np.empty((len(output_times), 2 * n))
        rates = np.sqrt(np.abs(modal.eigenvalues).max(initial=0.0)) + np.abs(diagonal).max(initial=0.0)
        now = np.array([t0, t1, 5.0 / max(rates, 1.0 / max(abs(t1 - t0), 1e-300))])
        counts, orders = np.zeros(3, dtype=np.int64), [0]
        ends, states, outputs = [np.array([t0])], [y0[None, :]], np.ascontiguousarray(output_times)
        run, scratch, advance = packed(equations), packed(work), self._bound.compiled.modal_steps

        def fill(room: int) -> tuple[int, float, int]:
            out = kernel_modal.Output(now, counts, outputs, found, np.empty(room), np.empty((room, 2 * n)))
            status, count = advance(run, scratch, packed(out)), int(counts[0])
            orders[0] += int(counts[2])
            ends.append(out.ends[:count])
            states.append(out.states[:count])
            return status, float(now[0]), count

        status, _ = run_in_pieces(fill, t0, room=512, largest=20_000, pace=pace)
        return np.concatenate(ends), np.vstack(states), found[: counts[1]], status, orders[0]


@dataclass(frozen=True)
class SeriesPieces:
    """Evaluate a run by series. States at output times are stored; other times are integrated again from a stored
    step."""

    times: Array
    states: Array
    output_times: Array
    found: Array
    run: SeriesRun

    def state(self, t: Array) -> Array:
        """Integrated state at the times t, (times, 2n)."""
        if np.array_equal(t, self.output_times):
            return self.found
        sign = 1.0 if self.times[-1] >= self.times[0] else -1.0
        order = np.argsort(sign * t, kind="stable")
        first, last = t[order[0]], t[order[-1]]
        k = max(0, int(np.searchsorted(sign * self.times, sign * first, side="right")) - 1)
        out = np.tile(self.states[k], (len(t), 1))
        if last != self.times[k]:
            made = self.run.steps(self.times[k], self.states[k], last, t[order])
            out[order[: len(made[2])]] = made[2]
        return out

    def __call__(self, t: Array, derivative: int = 0) -> Array:
        """Coordinates, velocities or accelerations at the times t."""
        t = within_run(self.times, t)
        return np.array([self.run.expand(ti, yi, derivative) for ti, yi in zip(t, self.state(t), strict=True)])
