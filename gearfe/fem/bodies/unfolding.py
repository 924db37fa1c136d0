r"""Unfold curved tetrahedra: midside nodes on the true surface can turn thin elements below it inside out.

The displacement d from straight edges to curved ones is continued into the body as that of an elastic solid whose
surface is displaced by d (Persson, Peraire, AIAA paper 2009-949). Inner nodes near the folded elements follow the
surface, which does not change. Midside nodes of elements that are still folded are drawn back towards straight edges,
no further than needed. Only this changes the shape of the body; the change is returned.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...base.typing import Array, BoolArray, IntArray
from ..plane import Material
from ..reduction.sparse_solver import factorize
from ..solid import CURVED_DEGREE, EDGES, assemble, curved_elements, jacobian_determinants, maps, shape_functions
from .mesh_checks import boundary_faces

#: Least volume ratio at a quadrature point of an element that was folded, in that of its straight form.
LEAST = 0.05
#: Layers of elements round folded ones whose inner nodes follow the surface.
LAYERS = 2
#: Factor on the distances from straight edges in each trial; after `TRIALS` of them the edges count as straight.
BACK, TRIALS = 0.95, 120


class Unfolded(NamedTuple):
    """Nodes after `unfolded`."""

    nodes: Array
    #: Elements that were folded.
    folded: int
    #: Nodes of the surface that were moved, the largest distance (m) of them, and what that adds to the volume (m3).
    moved: int
    farthest: float
    volume: float


def unfolded(nodes: Array, tets: IntArray) -> Unfolded:
    """Move as few nodes of folded second-order tetrahedra as little as it takes to unfold them.

    An element counts as folded when its volume ratio at a quadrature point is not positive.

    Parameters
    ----------
    nodes : (n, 3)
        Coordinates (m).
    tets : (m, 4) or (m, 10)
        Elements whose straight forms have positive volumes, midside nodes in the order of `gearfe.fem.solid.EDGES`.
    """
    folded = _folded(nodes, tets)
    if not folded.any():
        return Unfolded(nodes, 0, 0, 0.0, 0.0)
    surface = np.zeros(len(nodes), dtype=bool)
    surface[boundary_faces(tets)] = True
    found = _drawn_back(_followed(nodes, tets, folded, surface), tets)
    distance = np.linalg.norm(found - nodes, axis=1)[surface]
    shape_changed = bool(distance.any())
    added = _volume(found, tets) - _volume(nodes, tets) if shape_changed else 0.0
    return Unfolded(found, int(folded.sum()), int(np.count_nonzero(distance)), float(distance.max()), added)


def _folded(nodes: Array, tets: IntArray) -> BoolArray:
    folded = np.zeros(len(tets), dtype=bool)
    curved = np.flatnonzero(curved_elements(nodes, tets))
    folded[curved] = jacobian_determinants(nodes, tets[curved]).min(axis=1, initial=np.inf) <= 0.0
    return folded


def _followed(nodes: Array, tets: IntArray, folded: BoolArray, surface: BoolArray) -> Array:
    """Nodes after those inside the body, near folded elements, have followed the curved surface."""
    near = folded
    for _ in range(LAYERS):
        reached = np.zeros(len(nodes), dtype=bool)
        reached[tets[near]] = True
        near = np.asarray(reached[tets].any(axis=1))
    free = np.zeros(len(nodes), dtype=bool)
    free[tets[near]] = True
    free[tets[~near]] = False
    free &= ~surface
    if not free.any():
        return nodes
    used, patch = np.unique(tets[near], return_inverse=True)
    straight = _straight(nodes, tets)[used]
    moves = free[used]
    rows, others = ((3 * np.flatnonzero(mask)[:, None] + np.arange(3)).ravel() for mask in (moves, ~moves))
    stiffness = assemble(straight, patch.reshape(-1, tets.shape[1]), Material()).stiffness.tocsr()[rows]
    given = (nodes[used] - straight)[~moves].ravel()
    inside = -factorize(stiffness[:, rows]).solve((stiffness[:, others] @ given)[:, None])
    found = nodes.copy()
    found[used[moves]] = straight[moves] + inside.reshape(-1, 3)
    return found


def _drawn_back(nodes: Array, tets: IntArray) -> Array:
    """Nodes with the midside nodes of elements that are still folded, or nearly so, nearer to straight edges."""
    straight, part = _straight(nodes, tets), np.ones((len(nodes), 1))
    least = LEAST * jacobian_determinants(nodes, tets[:, :4])[:, 0]
    suspects = _folded(nodes, tets)
    for trial in range(TRIALS):
        place = straight + part * (nodes - straight)
        chosen = np.flatnonzero(suspects)
        thin = chosen[jacobian_determinants(place, tets[chosen]).min(axis=1) < least[chosen]]
        if not len(thin):
            break
        middles = np.unique(tets[thin, 4:])
        part[middles] *= BACK if trial < TRIALS - 1 else 0.0
        touched = np.zeros(len(nodes), dtype=bool)
        touched[middles] = True
        suspects = touched[tets].any(axis=1) & curved_elements(nodes, tets)
    return np.asarray(straight + part * (nodes - straight))


def _straight(nodes: Array, tets: IntArray) -> Array:
    """Nodes with midside nodes in the middles of their edges."""
    straight = nodes.copy()
    straight[tets[:, 4:]] = 0.5 * (nodes[tets[:, EDGES[:, 0]]] + nodes[tets[:, EDGES[:, 1]]])
    return straight


def _volume(nodes: Array, tets: IntArray) -> float:
    """Volume that the curved surface encloses (m3)."""
    rule = shape_functions(tets.shape[1], CURVED_DEGREE)
    return float((maps(nodes, tets, rule.slopes)[0] @ rule.weights).sum())
