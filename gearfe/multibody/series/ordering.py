"""Elimination order of the constraint rows and the symbolic factorisation of S = G M^-1 G^T = L D L^T.

Two rows couple in S when they share a moving body. The order is minimum degree on the graph of the joints (George &
Liu, SIAM Review 31 (1989)). Chains and trees have no fill-in, so the cost of a factorisation is proportional to the
number of joints.
"""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...base.typing import IntArray


class Factor(NamedTuple):
    """Every index that the numeric factorisation needs, for m rows."""

    start: IntArray  # (m + 1,) columns of the factor L
    row: NDArray[np.uint64]  # (nnz,) row number of each entry
    column: NDArray[np.uint64]  # (nnz,) and its column (unsigned: compiled code need not ask for negative numbers)
    update_start: IntArray  # (m + 1,)
    update: IntArray  # (u, 3) target, entry, entry of L


def symbolic_factor(m: int, coupled: Iterable[tuple[int, int]]) -> tuple[Factor, Callable[[int, int], int]]:
    """Hold the symbolic factor of m rows and the positions of entries (r, s) of S.

    A diagonal entry has the position r, another one m + its number.

    Parameters
    ----------
    m
        Number of rows.
    coupled
        Entries (r, s), r >= s, of S.
    """
    below: list[set[int]] = [set() for _ in range(m)]
    for r, s in coupled:
        if r > s:
            below[s].add(r)
    for j in range(m):  # fill: the first row below the diagonal inherits the rest of the column
        if below[j]:
            first = min(below[j])
            below[first].update(i for i in below[j] if i > first)
    start = np.zeros(m + 1, dtype=np.int64)
    start[1:] = np.cumsum([len(b) for b in below])
    columns = [sorted(b) for b in below]
    place = {(i, j): int(start[j]) + k for j, column in enumerate(columns) for k, i in enumerate(column)}

    def target(r: int, s: int) -> int:
        return r if r == s else m + place[(max(r, s), min(r, s))]

    update, update_start = [], [0]
    for j, column in enumerate(columns):
        first = int(start[j])
        for b, k in enumerate(column):
            update += [(target(i, k), first + a, first + b) for a, i in enumerate(column) if i >= k]
        update_start.append(len(update))
    factor = Factor(
        start,
        np.array([i for column in columns for i in column], dtype=np.uint64),
        np.array([j for j, column in enumerate(columns) for _ in column], dtype=np.uint64),
        np.array(update_start, dtype=np.int64),
        np.array(update, dtype=np.int64).reshape(-1, 3),
    )
    return factor, target


def elimination_order(rows: list[tuple[int, tuple[int, ...]]], n_bodies: int) -> list[int]:
    """Order of rows given as (joint, bodies); body `n_bodies` is the ground and couples nothing.

    Joint by joint, always next the joint with the fewest neighbours left.
    """
    members: dict[int, list[int]] = defaultdict(list)
    on_body: dict[int, set[int]] = defaultdict(set)
    for i, (joint, bodies) in enumerate(rows):
        members[joint].append(i)
        for body in bodies:
            if body != n_bodies:
                on_body[body].add(joint)
    near: dict[int, set[int]] = {joint: set() for joint in members}
    for joints in on_body.values():
        for joint in joints:
            near[joint] |= joints - {joint}
    heap = [(len(near[joint]), joint) for joint in members]
    heapq.heapify(heap)
    order: list[int] = []
    done: set[int] = set()
    while heap:
        degree, joint = heapq.heappop(heap)
        if joint in done or degree != len(near[joint]):
            continue
        done.add(joint)
        order += members[joint]
        ring = near.pop(joint)
        for other in ring:
            near[other] |= ring
            near[other] -= {other, joint}
            heapq.heappush(heap, (len(near[other]), other))
    return order


def narrow_order(graph: NDArray[np.bool_]) -> list[int]:
    """Order of the unknowns of a symmetric pattern in which entries lie near the diagonal.

    Reverse Cuthill-McKee from an unknown at the rim (George & Liu, Computer Solution of Large Sparse Positive Definite
    Systems, Prentice-Hall 1981, ch. 4).
    """
    degree = graph.sum(axis=1).tolist()
    near = [sorted(np.flatnonzero(row).tolist(), key=degree.__getitem__) for row in graph]
    left = set(range(len(graph)))
    order: list[int] = []

    def walk(first: int) -> list[int]:
        found, queue = {first}, [first]
        for i in queue:
            new = [j for j in near[i] if j not in found]
            found.update(new)
            queue += new
        return queue

    while left:
        begin = min(left, key=degree.__getitem__)
        for _ in range(3):  # the last one reached lies at the rim
            begin = walk(begin)[-1]
        part = walk(begin)
        order += part
        left -= set(part)
    return order[::-1]
