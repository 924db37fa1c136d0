"""Explicit integration of order 8 in minimal (modal) coordinates: y'' = -omega^2 y - C y' + W^T phi(t, W y, W y').

With forces that are all `LocalForce` with one ``compiled_law`` the whole loop is compiled; otherwise each
stage calls Python.
"""

from __future__ import annotations

from functools import lru_cache
from types import SimpleNamespace
from typing import Any

import numpy as np

from . import compiled, kernel_modal
from .contract import Array, LocalForce
from .elimination import Minimal
from .explicit import Pieces, first_step, step_through, tableau
from .start import Start


def run_minimal(  # type: ignore[no-untyped-def]
    core: Minimal, start: Start, times: Array, *, tolerance: float, longest: float, most: int, jit: bool = True
):
    """Integrate a system in minimal coordinates; returns (dense output, status, statistics)."""
    n = core.T.shape[1]
    y0 = np.concatenate(core.reduce(start.q, start.v))

    def acceleration(t: float, y: Array) -> Array:
        stiff = core.constant - core.squares * y[:n] - core.damping @ y[n:]
        return stiff + core.force(t, y[:n], y[n:])

    def rhs(t: float, y: Array) -> Array:
        return np.concatenate([y[n:], acceleration(t, y)])

    def expand(t: float, y: Array) -> tuple[Array, Array, Array]:
        return core.origin + core.T @ y[:n], core.T @ y[n:], core.T @ acceleration(t, y)

    laws = _compiled_laws(core) if jit else None
    if laws is None:
        made = step_through(
            rhs, lambda _, y: y, start.time, y0, times[-1], core.system.breaks, tolerance, longest, most
        )
    else:
        made = _compiled_steps(core, laws, start.time, y0, float(times[-1]), tolerance, longest, most, rhs)
    ends, states, polynomials, status, evaluations = made
    statistics: dict[str, Any] = {
        "steps": len(polynomials),
        "evaluations": evaluations,
        "free_coordinates": n,
        "backend": "plain" if laws is None else "compiled",
    }
    return Pieces(ends, states, polynomials, expand), status, statistics


def _compiled_laws(core: Minimal) -> list[tuple[LocalForce, np.ndarray]] | None:
    forces = core.system.forces
    if not compiled.available() or not forces:
        return None
    found = [(e, i) for e, i in forces if isinstance(e, LocalForce) and e.compiled_law is not None]
    if len(found) != len(forces) or len({e.compiled_law for e, _ in found}) != 1:
        return None
    return found


@lru_cache(maxsize=8)
def _kernels(law: Any, corner: Any, helpers: tuple[Any, ...]) -> SimpleNamespace:
    corner = corner or kernel_modal.no_corner
    functions = (*kernel_modal.FUNCTIONS, *helpers, law, corner)
    names = {"np": np, "math": kernel_modal.math, **law.__globals__}
    alias = {law.__name__: "law", corner.__name__: "corner"}
    return compiled.bind(functions, names, compiled=True, entries=("modal_steps",), alias=alias)


def _compiled_steps(core, laws, t0, y0, t1, tolerance, longest, most, rhs):  # type: ignore[no-untyped-def]
    tab = tableau()
    n = core.T.shape[1]
    directions = [(core.T[index].T @ e.W, core.origin[index] @ e.W) for e, index in laws]
    W = np.ascontiguousarray(np.hstack([d[0] for d in directions]).T)
    offset = np.concatenate([np.atleast_1d(d[1]) for d in directions])
    first = np.cumsum([0, *(e.W.shape[1] for e, _ in laws)]).astype(np.int64)
    widest = max(np.size(e.parameters) for e, _ in laws)
    parameters = np.zeros((len(laws), max(1, widest)))
    for i, (e, _) in enumerate(laws):
        parameters[i, : np.size(e.parameters)] = e.parameters
    diagonal = np.diagonal(core.damping).copy()
    full = not np.array_equal(core.damping, np.diag(diagonal))
    h0 = first_step(y0, rhs(t0, y0), abs(t1 - t0))
    force = laws[0][0]
    kernels = _kernels(force.compiled_law, force.compiled_corner, force.compiled_helpers)
    room = 256
    ends, states = [np.array([t0])], [y0[None, :]]
    polynomials: list[Array] = []
    t, y, h, status, evaluations = t0, y0.copy(), h0, 2, 0
    scale = np.abs(y0)
    breaks = core.system.breaks
    while status == 2 and sum(map(len, polynomials)) < most:
        room = min(room, most - sum(map(len, polynomials)))
        T, Y, P = np.empty(room), np.empty((room, 2 * n)), np.empty((room, 7, 2 * n))
        status, count, t, h, calls = kernels.modal_steps(
            core.squares, core.damping, diagonal, full, core.constant, W, offset, first, parameters, tab.A,
            tab.C, tab.E3, tab.E5, tab.D, t, t1, y, h, scale, breaks, tolerance, longest, T, Y, P,
        )  # fmt: skip
        evaluations += calls
        ends.append(T[:count])
        states.append(Y[:count])
        polynomials.append(P[:count])
        room = min(4 * room, 20_000)
    return np.concatenate(ends), np.vstack(states), np.vstack(polynomials), status, evaluations
