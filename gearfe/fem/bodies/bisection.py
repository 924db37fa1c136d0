r"""Local refinement of quadratic tetrahedra by longest-edge bisection.

An element is cut through the middle of its longest marked edge and the two opposite corners until none of its edges is
marked (Rivara, Int. J. Numer. Meth. Eng. 20, 1984; Plaza, Carey, Appl. Numer. Math. 32, 2000). Edges are cut in one
order for all elements, longer ones first, so that the two elements at a face cut it alike. Whatever element has a
marked edge has its longest one marked: angles stay bounded below, however often a mesh is refined.

The new corner is the midside node that stands there. New midside nodes lie where the quadratic map of the element puts
them, so the body does not change. Every field of the old elements is also one of the new elements, so frequencies can
only fall.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...base.typing import Array, BoolArray, IntArray
from ..solid import EDGES, FACES

#: Number of the edge between two corners.
_EDGE = np.zeros((4, 4), dtype=np.int64)
for _number, (_one, _two) in enumerate(EDGES):
    _EDGE[_one, _two] = _EDGE[_two, _one] = _number
#: The two corners that an edge lacks.
_OTHERS = np.array([sorted({0, 1, 2, 3} - {int(one), int(two)}) for one, two in EDGES])
#: Edges of each face.
_FACE_EDGES = FACES[:, 3:] - 4
#: Quadratic functions at a quarter of an edge a-b: of a, b, its middle (the rest is not needed).
_QUARTER = np.array([3.0, -1.0, 6.0, 0.0, 0.0]) / 8.0
#: The same on a face a-b-c, in the middle between c and the middle of a-b: of a, b, middles of a-b, a-c, b-c.
_WITHIN = np.array([-1.0, -1.0, 2.0, 4.0, 4.0]) / 8.0


class Bisected(NamedTuple):
    """A refined mesh; the nodes of the old one come first."""

    nodes: Array
    tets: IntArray
    #: whether each node belongs to each of the sets (k, n)
    members: BoolArray


def bisected(nodes: Array, tets: IntArray, chosen: IntArray, members: BoolArray) -> Bisected:
    """Cut all six edges of the chosen elements, and of others what keeps the mesh conforming.

    Parameters
    ----------
    nodes : (n, 3)
        Coordinates (m).
    tets : (m, 10)
        Quadratic tetrahedra.
    chosen : (c,)
        Elements to refine: each becomes eight or more.
    members : (k, n)
        Which nodes belong to k sets. A new node belongs to a set when all nodes between which it lies do.
    """
    keys = _edge_keys(tets)
    edges, place = np.unique(keys, return_inverse=True)
    place = place.reshape(keys.shape)
    order = _ranks(nodes, edges)
    marked = np.zeros(len(edges), dtype=bool)
    marked[place[chosen]] = True
    _close(marked, order, place)
    cut, rank = edges[marked], order[marked]
    made = _Made(nodes, members)
    done = []
    while len(tets):
        keys = _edge_keys(tets)
        at = np.minimum(np.searchsorted(cut, keys), len(cut) - 1)
        ranks = np.where(cut[at] == keys, rank[at], -1)
        longest = ranks.argmax(axis=1)
        whole = ranks.max(axis=1) < 0
        done.append(tets[whole])
        tets = made.halves(tets[~whole], longest[~whole])
    return Bisected(made.nodes, np.concatenate(done), made.members)


class _Middle(NamedTuple):
    """Midside nodes to a corner (m,), between nodes (m, 5) by the values (5,) of their quadratic functions."""

    corner: IntArray
    parents: IntArray
    weights: Array


class _Made:
    """Hold the nodes of a mesh during refinement; added ones by the corners between which they lie."""

    def __init__(self, nodes: Array, members: BoolArray) -> None:
        self.nodes, self.members = nodes, members
        self._keys, self._numbers = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)

    def halves(self, tets: IntArray, edge: IntArray) -> IntArray:
        """(2 m, 10) halves of elements cut at one edge each."""
        row = np.arange(len(tets))
        (a, b), (c, d) = EDGES[edge].T, _OTHERS[edge].T
        one, two, new = tets[row, a], tets[row, b], tets[row, 4 + edge]

        def toward(end: IntArray, other: IntArray) -> _Middle:
            return _Middle(end, np.column_stack([end, other, new, new, new]), _QUARTER)

        def within(top: IntArray) -> _Middle:
            sides = [tets[row, 4 + _EDGE[end, top]] for end in (a, b)]
            return _Middle(tets[row, top], np.column_stack([one, two, new, *sides]), _WITHIN)

        to_a, to_b, to_c, to_d = self._between(new, [toward(one, two), toward(two, one), within(c), within(d)])
        halves = []
        for end, own in ((b, to_a), (a, to_b)):  # the corner at `end` becomes the middle of the edge
            half = tets.copy()
            half[row, end] = new
            half[row, 4 + edge] = own
            half[row, 4 + _EDGE[end, c]] = to_c
            half[row, 4 + _EDGE[end, d]] = to_d
            halves.append(half)
        return np.concatenate(halves)

    def _between(self, new: IntArray, middles: list[_Middle]) -> IntArray:
        """(4, m) numbers of the midside nodes between `new` and corners, made where they are not there."""
        keys = np.concatenate([_pair_keys(new, one.corner) for one in middles])
        parents = np.concatenate([one.parents for one in middles])
        weights = np.repeat([one.weights for one in middles], len(new), axis=0)
        found, first = np.unique(keys, return_index=True)
        fresh = first[~np.isin(found, self._keys)]
        places = np.einsum("nwx,nw->nx", self.nodes[parents[fresh]], weights[fresh])
        self._keys = np.concatenate([self._keys, keys[fresh]])
        self._numbers = np.concatenate([self._numbers, len(self.nodes) + np.arange(len(fresh))])
        self.members = np.hstack([self.members, self.members[:, parents[fresh]].all(axis=2)])
        self.nodes = np.vstack([self.nodes, places])
        order = np.argsort(self._keys)
        self._keys, self._numbers = self._keys[order], self._numbers[order]
        return np.asarray(self._numbers[np.searchsorted(self._keys, keys)].reshape(len(middles), -1))


def _close(marked: BoolArray, order: IntArray, place: IntArray) -> None:
    """Mark the longest edge of every element, and of every face, that has a marked one."""
    groups = [place, *(place[:, face] for face in _FACE_EDGES)]
    longest = [group[np.arange(len(group)), order[group].argmax(axis=1)] for group in groups]
    before = -1
    while before != marked.sum():
        before = marked.sum()
        for group, most in zip(groups, longest, strict=True):
            marked[most[marked[group].any(axis=1)]] = True


def _ranks(nodes: Array, edges: IntArray) -> IntArray:
    """(e,) place of each edge in the order of lengths; equal lengths in the order of numbers."""
    low, high = edges >> 32, edges & 0xFFFFFFFF
    length = np.linalg.norm(nodes[high] - nodes[low], axis=1)
    ranks = np.empty(len(edges), dtype=np.int64)
    ranks[np.lexsort((edges, length))] = np.arange(len(edges))
    return ranks


def _edge_keys(tets: IntArray) -> IntArray:
    """(m, 6) one number an edge."""
    return _pair_keys(tets[:, EDGES[:, 0]], tets[:, EDGES[:, 1]])


def _pair_keys(one: IntArray, two: IntArray) -> IntArray:
    return np.asarray(np.minimum(one, two) << 32 | np.maximum(one, two))
