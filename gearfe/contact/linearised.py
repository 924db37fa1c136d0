"""The contact of one position, linearised: rows and factorised matrix of the points or multipliers that are active."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgetrf, dgetrs

from .closest import Projection, gap_rows
from .scene import Scene

Array = NDArray[Any]
IntArray = NDArray[Any]


@dataclass(frozen=True)
class Linearised:
    """The active pressures or multipliers at one state, on the 2t unknowns of the nodes that they touch.

    Attributes
    ----------
    unknowns : ndarray, shape (2t,)
    gap, opening : ndarray, shape (a,) and (a, 2t)
        g and dg/du of the active unknowns; integrals over the hats for multipliers.
    weighted : ndarray, shape (2t, a)
        G^T W: forces for the active unknowns.
    parameter : ndarray, shape (a,)
        gamma; 1 for multipliers.
    response : ndarray, shape (a, 2t)
        gamma dg/du C + S.
    normal, tilt, slide, projection, loads
        Rows G, N and delta xi (`closest.Rows`), projection and loads (N) of the points behind the active unknowns.
    cut : ndarray
        Change of each of these points' loads per unit of the foot point, where its stretch lies across a sharp end (N).
    flex : ndarray, shape (2t, a), or None
        Displacements for the stress loads of the active unknowns, S^T theta W/gamma.
    relief : ndarray, shape (a,)
        theta W/gamma: stress loads for the active unknowns (m3/Pa).
    """

    unknowns: IntArray
    gap: Array
    opening: Array
    weighted: Array
    parameter: Array
    compliance: Array
    response: Array
    factor: Any
    normal: Array
    tilt: Array
    slide: Array
    projection: Projection
    loads: Array
    cut: Array
    flex: Array | None = None
    relief: Array = field(default_factory=lambda: np.zeros(0))

    def solve(self, right: Array) -> Array:
        """Active unknowns for a right-hand side."""
        return dgetrs(*self.factor, right, trans=1)[0]

    def moved(self, solved: Array, forces: Array) -> Array:
        """Displacements of the touched nodes for forces on them, shape (2t,), and active unknowns, shape (a,)."""
        found = self.compliance @ forces
        return found if self.flex is None else found + self.flex @ solved

    def bending(self, change: Array) -> Array:
        """H change: how the contact forces turn and move when the touched nodes move by `change`, shape (2t,)."""
        p = self.projection
        metric = p.tangent[:, 0] ** 2 + p.tangent[:, 1] ** 2
        tilt, slide = self.tilt @ change, self.slide @ change
        share = 1 - p.gap * p.curvature / metric
        to_slide = -share * (tilt + p.curvature * slide)
        to_tilt = -share * slide + p.gap / metric * tilt
        bent = (self.loads * to_slide) @ self.slide + (self.loads * to_tilt) @ self.tilt
        return bent + (self.cut * slide) @ self.normal if self.cut.any() else bent


def linearise(scene: Scene, projection: Projection, active: IntArray, pressure: Array) -> Linearised:
    """Rows and factorised matrix of the active unknowns.

    Parameters
    ----------
    active : ndarray
        Numbers of the active points, or of the active hats where the scene has them.
    pressure : ndarray, shape (q,)
        At the contact points (Pa).
    """
    hats = scene.hats
    points = active
    if hats is not None:
        held = np.zeros(hats.count, dtype=bool)
        held[active] = True
        points = np.flatnonzero(held[hats.numbers].any(axis=1) & (scene.facing(projection) > 0))
    chosen = projection.take(points)
    rows = gap_rows(chosen, scene.slave_nodes[points], scene.slave_shapes[points], scene.rotation)
    touched = np.zeros(len(scene.points), dtype=bool)
    touched[rows.nodes] = True
    nodes = np.flatnonzero(touched)
    place = np.empty(len(touched), dtype=np.int64)
    place[nodes] = np.arange(len(nodes))
    # the two edges of a point belong to different teeth: no slot of the dense rows is met twice
    slot = np.arange(len(points))[:, None] * len(nodes) + place[rows.nodes]
    spread = np.zeros((3, len(points) * len(nodes), 2))
    spread[0, slot], spread[1, slot], spread[2, slot] = rows.normal, rows.tilt, rows.slide
    normal, tilt, slide = spread.reshape(3, len(points), 2 * len(nodes))
    steep = chosen.normal[:, 0] * chosen.tangent[:, 0] + chosen.normal[:, 1] * chosen.tangent[:, 1]
    opening = normal - steep[:, None] * slide
    unknowns = np.empty(2 * len(nodes), dtype=np.int64)
    unknowns[::2], unknowns[1::2] = 2 * nodes, 2 * nodes + 1
    areas, gamma = scene.areas(projection.place)[points], scene.parameter[points]
    across = (areas > 0) & (areas < scene.weight[points])
    shrink = np.where(across, -scene.weight[points] / (2 * scene.fade[points]), 0.0)
    compliance = scene.compliance.take(unknowns, axis=0).take(unknowns, axis=1)
    weighted = np.ascontiguousarray((normal * areas[:, None]).T)
    gap, flex, relief = chosen.gap, None, np.zeros(0)
    if hats is not None:
        values = hats.matrix(active, points)
        weighted = weighted @ values
        opening = values.T @ (areas[:, None] * opening + (shrink * gap)[:, None] * slide)
        gap, gamma = values.T @ (areas * gap), np.ones(len(active))
        response = opening @ compliance
        matrix = response @ weighted
    else:
        response = (gamma[:, None] * opening) @ compliance
        if len(scene.stress):
            stress = scene.stress.take(active, axis=0).take(unknowns, axis=1)
            response += stress
        matrix = response @ weighted
        if scene.theta:
            relief = scene.theta * areas / gamma
            flex = stress.T * relief
            matrix += gamma[:, None] * (opening @ flex)
            matrix += scene.stress_stress.take(active, axis=0).take(active, axis=1) * relief
        matrix.flat[:: len(matrix) + 1] += 1.0
    # the transposed matrix is what LAPACK sees in C order: factorise that, solve transposed, and nothing is copied
    factor = dgetrf(matrix.T, overwrite_a=1)[:2]
    return Linearised(
        unknowns=unknowns,
        gap=gap,
        opening=opening,
        weighted=weighted,
        parameter=gamma,
        compliance=compliance,
        response=response,
        factor=factor,
        flex=flex,
        relief=relief,
        normal=normal,
        tilt=tilt,
        slide=slide,
        projection=chosen,
        loads=areas * pressure[points],
        cut=shrink * pressure[points],
    )
