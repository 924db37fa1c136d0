"""Allocate state, tables and scratch arrays of a collocation step, and order its unknowns.

The entries of a SIMD vector are the s stages, followed by the start of the step. Those of the factors are the systems
of the step (`kernels`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ....base.typing import Array, IntArray
from ...compiled.simd import SimdArray, simd_zeros
from ...series.ordering import narrow_order
from ...series.tape import Program


class Stages(NamedTuple):
    """State and unknowns of a step: n coordinates, m rows, k stresses; W = s + 1 stages, last the begin."""

    #: (5,) time at the begin and step (s), change over the limit at which Newton's method ends, time for which an error
    #: of the speed lasts (s), 0 where it does not count, and rounding of positions over their limit, where a stiff link
    #: takes it for a force
    now: Array
    #: (4,) error over the tolerance, gap of the rows between the stages, mean rate of Newton's changes, stages that are
    #: beyond the end of a table
    measures: Array
    q: Array  # (n,) state at the begin
    v: Array
    multipliers: Array  # (m,) first guess
    speeds: Array  # (s + 1, n) of powers of the time since the begin
    limit: Array  # (n,) allowed errors of coordinates
    guess: SimdArray  # (s + 1, W) from coefficients of the speeds before to Z
    Z: SimdArray  # (n, W) positions less q + c h v
    Q: SimdArray  # (n, W) positions, velocities, accelerations
    V: SimdArray
    A: SimdArray
    L: SimdArray  # (m, W) multipliers
    S: SimdArray  # (k, W) stresses
    rest: SimdArray  # (n, W) what is left of the equations
    gap: SimdArray  # (m, W)
    r: SimdArray  # (n, W) the same of the systems, then their changes
    g: SimdArray  # (m, W)
    dZ: SimdArray  # (n, W) changes
    dL: SimdArray  # (m, W)
    known: Array  # (inner + 4, n) as `Scheme.path` has them
    qn: Array  # (n,) state at the end
    vn: Array


class Band(NamedTuple):
    """Order of the unknowns and entries of the matrices."""

    place: IntArray  # (N,) of coordinates, then rows, in the matrices; N = n + m
    entry: IntArray  # (e, 2) of the matrices that may be none, except the rows'
    mass: Array  # (e,) of them
    held: IntArray  # (p, 2) of the mass matrix
    masses: Array  # (p,)
    acting: IntArray  # (a,) coordinates that registers depend on
    begin: IntArray  # (N,) first and last rows that a column of the factors may come to
    reach: IntArray  # (N,)
    right: IntArray  # (N,) last column of each row of the matrices


class Scratch(NamedTuple):
    """Work arrays of one state, and the factors of all systems, R = r + 1."""

    q: Array  # (n,)
    v: Array
    s: Array  # (k,) stresses
    L: Array  # (m,) multipliers
    gap: Array  # (m,)
    at: Array  # (1,) time of the factor of the mass matrix
    P: Array  # (z, 3) series of the variables
    R: Array  # (registers, 3)
    TF: Array  # (functions, 4)
    pieces: IntArray  # of the switches
    H: Array  # (z, 1)
    F: Array  # (n,)
    D: Array  # (m, z) rows by variables
    G: Array  # (m, n)
    K: Array  # (n, n) derivatives of the forces, less those of the rows' forces, by coordinates
    C: Array  # (n, n) by velocities
    B: SimdArray  # (2, N, N, 2, R) factors of the step's matrices and of the mass matrix
    over: SimdArray  # (2, N, 2, R)
    scale: SimdArray  # (2, R)
    pivot: IntArray  # (2, N)
    low: IntArray  # (2, N)
    top: IntArray  # (2, N)
    right: IntArray  # (N,)
    x: SimdArray  # (N, 2, R)
    law: Array  # (k, widest) derivatives of the stresses
    slope: Array  # (3, 4)
    by: Array  # (2, 4, 4) tangents of a beam's point by its strains' arguments, and by their rates
    shapes: (
        Array  # (4, widest) of a body in a floating frame: shares of modes, strains, rates of the shares, their forces
    )
    pairs: Array  # (widest, widest) derivatives of these forces by the shares
    drift: Array  # (coordinates,) derivatives of a strain's rate
    blocks: Array  # (strains, coordinates)


class Wide(NamedTuple):
    """Work arrays of all stages."""

    P: SimdArray  # (z, 2, W) variables and rates
    TF: SimdArray  # (functions, 2, W)
    H: SimdArray  # (z, 1, W)
    F: SimdArray  # (n, W)
    shapes: SimdArray  # (2, widest, W)
    blocks: SimdArray  # (strains, coordinates, W)


class Equations(NamedTuple):
    """A system."""

    program: Program
    band: Band
    own: Scratch
    wide: Wide


def work(s: int, n: int, m: int, k: int, known: int) -> Stages:
    """Return the arrays of a step.

    Parameters
    ----------
    s : int
        Number of stages.
    n : int
        Number of coordinates.
    m : int
        Number of rows.
    k : int
        Number of stresses.
    known : int
        Rows of ``Stages.known``, as `Scheme.path` has them.
    """
    plain = [(5,), (4,), (n,), (n,), (m,), (s + 1, n), (n,)]
    W = s + 1
    wide = [(s + 1, W), *[(n, W)] * 4, (m, W), (k, W), *[(n, W), (m, W)] * 3]
    arrays: list[Array] = [np.zeros(shape) for shape in plain]
    arrays += [simd_zeros(*shape) for shape in wide]
    return Stages._make([*arrays, np.zeros((known, n)), np.zeros(n), np.zeros(n)])


def equations(program: Program, band: Band, s: int, stresses: int) -> Equations:
    """Return a program with the order of its unknowns and work arrays.

    Parameters
    ----------
    program : Program
        The system on a tape.
    band : Band
        Order of the unknowns and entries of the matrices.
    s : int
        Number of stages.
    stresses : int
        Number of stresses that are unknowns.
    """
    n, m, z = len(program.mass), len(program.rows.constant), len(program.mass) + len(program.curves.sign)
    N, R = n + m, (s + 1) // 2
    place = program.floats.place
    widest = int(max([4, *place[:, 1], *place[:, 2]]))
    width = int(max([4, *(2 * place[:, 1] + 4)]))

    def whole(*shape: int) -> Any:
        return np.zeros(shape, dtype=np.int64)

    own = Scratch(
        q=np.zeros(n), v=np.zeros(n), s=np.zeros(stresses), L=np.zeros(m), gap=np.zeros(m), at=np.full(1, np.nan),
        P=np.zeros((z, 3)), R=np.zeros((len(program.code.op), 3)), TF=np.zeros((len(program.times.first) - 1, 4)),
        pieces=whole(len(program.switches.register)), H=np.zeros((z, 1)), F=np.zeros(n), D=np.zeros((m, z)),
        G=np.zeros((m, n)), K=np.zeros((n, n)), C=np.zeros((n, n)), B=simd_zeros(2, N, N, 2, R),
        over=simd_zeros(2, N, 2, R), scale=simd_zeros(2, R), pivot=whole(2, N), low=whole(2, N), top=whole(2, N),
        right=whole(N), x=simd_zeros(N, 2, R), law=np.zeros((stresses, width)), slope=np.zeros((3, 4)),
        by=np.zeros((2, 4, 4)), shapes=np.zeros((4, widest)),
        pairs=np.zeros((widest, widest)), drift=np.zeros(width), blocks=np.zeros((widest, width)),
    )  # fmt: skip
    W = s + 1
    wide = Wide(
        P=simd_zeros(z, 2, W), TF=simd_zeros(len(own.TF), 2, W), H=simd_zeros(z, 1, W), F=simd_zeros(n, W),
        shapes=simd_zeros(2, widest, W), blocks=simd_zeros(widest, width, W),
    )  # fmt: skip
    return Equations(program, band, own, wide)


def narrow_band(program: Program) -> Band:
    """Return the nonzero pattern of the matrices, and an order of the unknowns with a narrow band."""
    n, m, held = len(program.mass), len(program.rows.constant), np.argwhere(program.mass != 0.0)

    of = np.append(np.arange(n), program.curves.place[:, 0])  # coordinate of each variable
    rows, code = program.rows, program.code
    filled = np.zeros((n, n), dtype=bool)
    filled[tuple(held.T)] = True
    filled[tuple(program.block.T)] = True
    filled[of[n:], of[n:]] = True
    pairs = of[rows.pair[:, 1:]]
    filled[pairs[:, 0], pairs[:, 1]] = filled[pairs[:, 1], pairs[:, 0]] = True
    for nodes in program.bars.place:
        own = (nodes[:, None] + np.arange(3)).ravel()
        filled[np.ix_(own, own)] = True
    for first, modes in program.floats.place[:, :2]:
        own = first + np.arange(2 * modes + 4)
        filled[np.ix_(own, own)] = True
    acting = np.unique(of[code.variable])
    pushed = np.unique(of[code.push[:, 1]])
    filled[np.ix_(pushed, acting)] = True
    graph = np.zeros((n + m, n + m), dtype=bool)
    graph[:n, :n] = filled | filled.T
    for row, at in ((rows.place[:, 0], of[rows.place[:, 1]]), *((rows.pair[:, 0], p) for p in pairs.T)):
        graph[n + row, at] = graph[at, n + row] = True
    place = np.empty(n + m, dtype=np.int64)
    place[narrow_order(graph)] = np.arange(n + m)
    entries = np.ascontiguousarray(np.argwhere(filled).astype(np.int64))
    graph |= np.eye(n + m, dtype=bool)
    placed = np.zeros_like(graph)
    placed[np.ix_(place, place)] = graph
    last = n + m - 1 - placed[:, ::-1].argmax(axis=1)
    reach = np.maximum.accumulate(last)  # pivots exchange rows up to it
    first = np.searchsorted(np.maximum.accumulate(reach[reach]), np.arange(n + m))
    return Band(
        place, entries, program.mass[tuple(entries.T)], np.ascontiguousarray(held.astype(np.int64)),
        program.mass[tuple(held.T)], acting, first.astype(np.int64), reach.astype(np.int64), last.astype(np.int64),
    )  # fmt: skip
