r"""Arcs of a gear with all their unknowns; the sectors of its other teeth condensed onto the two faces between.

A sector without loads has the stiffness :math:`S = K_{BB} - K_{BI} K_{II}^{-1} K_{IB}` on its cut faces B (static
condensation). Two rows of sectors a and b share a face m, which is eliminated next,

.. math::
    S = \begin{pmatrix} a_{11} & 0 \\ 0 & b_{22} \end{pmatrix} - \begin{pmatrix} a_{12} \\ b_{21} \end{pmatrix}
    (a_{22} + b_{11})^{-1} \begin{pmatrix} a_{21} & b_{12} \end{pmatrix} .

A row of n equal sectors takes about :math:`\log_2 n` such steps (Thomas, *Int. J. Numer. Meth. Eng.* 14, 1979, on
rotationally periodic structures). At small strain the result is that of the whole gear, to rounding.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from ....base.typing import Array, IntArray
from ....fem.plane import Material, Plane
from ...teeth.tooth_sector import SectorMesh
from ...teeth.whole_gear import WholeGear, gear_arc
from .bodies import Bodies, ElasticBody


@dataclass(frozen=True)
class ElasticGear:
    """Sector mesh, material, plane state and face width (m) of a gear."""

    mesh: SectorMesh
    material: Material
    plane: Plane
    thickness: float

    def body(self, part: WholeGear | SectorMesh) -> ElasticBody:
        """Return a mesh of this gear, or of a part of it, as an elastic body."""
        return ElasticBody(
            part.points, part.triangles, part.boundaries, self.material, self.plane, thickness=self.thickness
        )

    @property
    def faces(self) -> tuple[IntArray, IntArray]:
        """Nodes of both cut faces of a sector that are not held, equal numbers at equal radii."""
        return self.mesh.cut_right[:-1], self.mesh.cut_left[:-1]  # the last one lies on the bore or rim

    @cached_property
    def sector_stiffness(self) -> Array:
        """Stiffness of one sector on its right and left cut face, in the axes of its tooth (N/m)."""
        bodies = Bodies((self.body(self.mesh),))
        number, size = bodies.unknowns[bodies.node_of[0]], bodies.unknowns.size
        outside = number[np.concatenate(self.faces)].ravel()
        inside = np.setdiff1d(np.arange(size), np.concatenate([outside, number[np.unique(self.mesh.held)].ravel()]))
        stiffness = csc_matrix(bodies.stiffness)
        across = stiffness[inside][:, outside].toarray()
        factor = splu(stiffness[inside][:, inside], permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
        return np.asarray(stiffness[outside][:, outside].toarray() - across.T @ factor.solve(across))

    def row_stiffness(self, count: int) -> Array:
        """Return the stiffness of `count` neighbouring sectors on the outer faces of the first and the last (N/m).

        It is in the axes of the first tooth.
        """
        if count == 1:
            return self.sector_stiffness
        half = count // 2
        stiffness = self._joined(self.row_stiffness(half), self.row_stiffness(half), half)
        return self._joined(stiffness, self.sector_stiffness, 2 * half) if count % 2 else stiffness

    def _joined(self, first: Array, second: Array, count: int) -> Array:
        """Return the stiffness of a row of `count` sectors and of a second row behind it, without their common face."""
        face = len(first) // 2
        turn = np.kron(np.eye(face), rotation(count * self.mesh.pitch))
        second = turn @ second @ turn.T
        outer, shared = slice(face), slice(face, None)
        to_shared = np.concatenate([first[outer, shared], second[shared, outer]])
        ends = np.zeros((2 * face, 2 * face))
        ends[outer, outer], ends[shared, shared] = first[outer, outer], second[shared, shared]
        stiffness = ends - to_shared @ cho_solve(cho_factor(first[shared, shared] + second[outer, outer]), to_shared.T)
        return np.asarray(0.5 * (stiffness + stiffness.T))


@dataclass(frozen=True)
class GearArc:
    """Neighbouring sectors of a gear, and the boundary stiffness of the others.

    Attributes
    ----------
    mesh
        Sectors from `first` on in the axes of that tooth.
    first
        Number of the first tooth.
    angle
        From the axes of tooth 0 to those of the first tooth (rad).
    nodes : ndarray, shape (n,)
        Nodes of the two outer faces; none if the arc is the whole gear.
    remainder : ndarray, shape (2 n, 2 n)
        Stiffness of the other sectors on these nodes (N/m).
    """

    mesh: WholeGear
    first: int
    angle: float
    nodes: IntArray
    remainder: Array


def arc_of(gear: ElasticGear, first: int, count: int) -> GearArc:
    """Return `count` sectors of a gear from tooth `first` on; all of its teeth for any larger count."""
    sector = gear.mesh
    count = min(count, sector.teeth)
    mesh = gear_arc(sector, count)
    nodes, stiffness = np.zeros(0, dtype=np.int64), np.zeros((0, 0))
    if count < sector.teeth:
        right, left = gear.faces
        # the sectors outside begin where the arc ends, and end where it begins
        nodes = np.concatenate([mesh.numbers[-1][left], mesh.numbers[0][right]])
        turn = np.kron(np.eye(len(nodes)), rotation(count * sector.pitch))
        stiffness = turn @ gear.row_stiffness(sector.teeth - count) @ turn.T
    return GearArc(mesh, first, first * sector.pitch, nodes, stiffness)


def rotation(angle: float) -> Array:
    """Return the matrix that turns vectors by an angle (rad)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])
