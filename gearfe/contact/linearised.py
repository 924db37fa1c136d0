"""The contact of one position, linearised: rows and factorised matrix of the points or multipliers that are active."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgetrf, dgetrs

from .closest import Projection
from .exact_rows import exact_rows, sparse_rows, turning_stiffness
from .scene import Scene

Array = NDArray[Any]
IntArray = NDArray[Any]


@dataclass(frozen=True)
class Linearised:
    """The active pressures or multipliers at one state, on the 2t unknowns of the nodes that they touch.

    Attributes
    ----------
    unknowns : ndarray, shape (2t,)
    gap, opening : ndarray, shape (a,); ndarray or sparse, shape (a, 2t)
        g and dg/du of the active unknowns; integrals over the hats for multipliers.
    weighted : ndarray, shape (2t, a)
        G^T W: forces for the active unknowns.
    parameter : ndarray, shape (a,)
        gamma; 1 for multipliers.
    response : ndarray, shape (a, 2t)
        gamma dg/du C + S.
    stiffness : sparse, shape (2t, 2t)
        H: how the contact forces turn and move with the touched nodes (N/m).
    turning
        Factors of 1 - H C.
    flex : ndarray, shape (2t, a), or None
        Displacements for the stress loads of the active unknowns, S^T theta W/gamma.
    relief : ndarray, shape (a,)
        theta W/gamma: stress loads for the active unknowns (m3/Pa).
    """

    unknowns: IntArray
    gap: Array
    opening: Any
    weighted: Array
    parameter: Array
    compliance: Array
    response: Array
    stiffness: Any
    turning: Any
    factor: Any
    flex: Array | None = None
    relief: Array = field(default_factory=lambda: np.zeros(0))

    def solve(self, right: Array, offset: Array) -> tuple[Array, Array]:
        """Active unknowns p and forces f on the touched nodes, shape (2t,), with

        p + R f = right (and what stress loads add) for f = G^T W p + H (C f + S^T z + offset).
        """
        bent = dgetrs(*self.turning, self.stiffness @ offset, trans=1)[0]
        solved = dgetrs(*self.factor, right - self.response @ bent, trans=1)[0]
        loads = self.weighted @ solved
        if self.flex is not None:
            loads += self.stiffness @ (self.flex @ solved)
        return solved, dgetrs(*self.turning, loads, trans=1)[0] + bent

    def moved(self, solved: Array, forces: Array) -> Array:
        """Displacements of the touched nodes for forces on them, shape (2t,), and active unknowns, shape (a,)."""
        found = self.compliance @ forces
        return found if self.flex is None else found + self.flex @ solved


def linearise(scene: Scene, projection: Projection, active: IntArray, pressure: Array, placed: Array) -> Linearised:
    """Rows and factorised matrix of the active unknowns.

    Parameters
    ----------
    active : ndarray
        Numbers of the active points, or of the active hats where the scene has them.
    pressure : ndarray, shape (q,)
        At the contact points (Pa).
    placed : ndarray, shape (n, 2)
        Places of the nodes (m).
    """
    hats = scene.hats
    points = active
    if hats is not None:
        held = np.zeros(hats.count, dtype=bool)
        held[active] = True
        points = np.flatnonzero(held[hats.numbers].any(axis=1) & (scene.facing(projection) > 0))
    chosen = projection.take(points)
    edges = scene.counts[scene.mate[points]]
    rows = exact_rows(chosen, edges, placed, scene.slave_nodes[points], scene.slave_shapes[points], scene.rotation)
    touched = np.zeros(len(scene.points), dtype=bool)
    touched[rows.nodes] = True
    nodes = np.flatnonzero(touched)
    place = np.empty(len(touched), dtype=np.int64)
    place[nodes] = np.arange(len(nodes))
    columns, count = (2 * place[rows.nodes][:, None] + np.arange(2)[:, None]).reshape(20, -1), 2 * len(nodes)
    normal, slide, turn, lift = (x.reshape(20, -1) for x in (rows.normal, rows.slide, rows.turn, rows.lift))
    opened = normal - rows.steep * slide
    opening: Any = sparse_rows(opened, columns, count)
    unknowns = np.empty(2 * len(nodes), dtype=np.int64)
    unknowns[::2], unknowns[1::2] = 2 * nodes, 2 * nodes + 1
    areas, gamma = scene.areas(projection.place)[points], scene.parameter[points]
    across = (areas > 0) & (areas < scene.weight[points])
    shrink = np.where(across, -scene.weight[points] / (2 * scene.fade[points]), 0.0)
    compliance = scene.compliance.take(unknowns, axis=0).take(unknowns, axis=1)
    weighted = np.ascontiguousarray(sparse_rows(areas * normal, columns, count).toarray().T)
    stiffness = turning_stiffness(
        normal, slide, turn, lift, metric=rows.metric, bow=rows.bow, gap=chosen.gap,
        loads=areas * pressure[points], cut=shrink * pressure[points], columns=columns, count=count,
    )  # fmt: skip
    # transposed matrices are what LAPACK sees in C order: factorise those, solve transposed, and nothing is copied
    turning = dgetrf((np.eye(len(unknowns)) - stiffness @ compliance).T)[:2]
    gap, flex, relief = chosen.gap, None, np.zeros(0)
    if hats is not None:
        values = hats.matrix(active, points)
        weighted = weighted @ values
        opening = values.T @ sparse_rows(areas * opened + shrink * gap * slide, columns, count).toarray()
        gap, gamma = values.T @ (areas * gap), np.ones(len(active))
        response = opening @ compliance
        matrix = response @ dgetrs(*turning, weighted, trans=1)[0]
    else:
        response = sparse_rows(gamma * opened, columns, count) @ compliance
        if len(scene.stress):
            stress = scene.stress.take(active, axis=0).take(unknowns, axis=1)
            response += stress
        unit = weighted
        if scene.theta:
            relief = scene.theta * areas / gamma
            flex = stress.T * relief
            unit = weighted + stiffness @ flex
        matrix = response @ dgetrs(*turning, unit, trans=1)[0]
        if scene.theta:
            matrix += gamma[:, None] * (opening @ flex)
            matrix += scene.stress_stress.take(active, axis=0).take(active, axis=1) * relief
        matrix.flat[:: len(matrix) + 1] += 1.0
    return Linearised(
        unknowns=unknowns,
        gap=gap,
        opening=opening,
        weighted=weighted,
        parameter=gamma,
        compliance=compliance,
        response=response,
        stiffness=stiffness,
        turning=turning,
        factor=dgetrf(matrix.T, overwrite_a=1)[:2],
        flex=flex,
        relief=relief,
    )
