"""Elastic bodies of second-order triangles in one scikit-fem mesh."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from skfem import BilinearForm, CellBasis, ElementTriP2, ElementVector, MeshTri2
from skfem.helpers import ddot, eye, sym_grad, trace

from ....base.typing import Array, IntArray
from ....fem.plane import Material, Plane
from ..flank import edge_shapes, gauss_rule

#: Degree of the polynomials that the quadrature of a triangle integrates: the energy of a quadratic displacement's
#: finite strain is of degree 4, and the condensed gears take the same rule.
DEGREE = 4


def stiffness_form(material: Material, plane: Plane, thickness: float) -> Any:
    """Return the scikit-fem bilinear form w int sigma(u) : eps(v)."""
    lam, mu = material.lame(plane)

    def sigma(u: Any) -> Any:
        return lam * eye(trace(sym_grad(u)), 2) + 2 * mu * sym_grad(u)

    return BilinearForm(lambda u, v, _: thickness * ddot(sigma(u), sym_grad(v)))


@dataclass(frozen=True)
class ElasticBody:
    """One elastic body.

    Attributes
    ----------
    points : ndarray, shape (n, 2)
        Nodes (m).
    triangles : ndarray, shape (m, 6)
        Corner nodes counter-clockwise, then the nodes in the middle of edges 01, 12, 20.
    boundaries : dict of str to ndarray, shape (k, 3)
        Named outline edges: start, middle, end node.
    material, plane
        Elastic constants, and ``strain`` or ``stress``.
    thickness
        Out of the plane (m).
    """

    points: Array
    triangles: IntArray
    boundaries: Mapping[str, IntArray]
    material: Material
    plane: Plane = "strain"
    thickness: float = field(default=1.0, kw_only=True)


@dataclass(frozen=True)
class Bodies:
    """Bodies joined in one scikit-fem mesh; they share no nodes."""

    parts: tuple[ElasticBody, ...]

    @cached_property
    def mesh(self) -> Any:
        """All bodies, their triangles one body after the other."""
        first = np.cumsum([0, *(len(part.points) for part in self.parts)])
        triangles = np.concatenate([part.triangles + n for part, n in zip(self.parts, first, strict=False)])
        points = np.concatenate([part.points for part in self.parts])
        return MeshTri2(np.ascontiguousarray(points.T), np.ascontiguousarray(triangles.T))

    @cached_property
    def elements(self) -> tuple[IntArray, ...]:
        """Triangles of each body."""
        ends = np.cumsum([0, *(len(part.triangles) for part in self.parts)])
        return tuple(np.arange(a, b) for a, b in itertools.pairwise(ends))

    @cached_property
    def node_of(self) -> tuple[IntArray, ...]:
        """scikit-fem's number of each body's nodes."""
        numbers = []
        for part, elements in zip(self.parts, self.elements, strict=True):
            number = np.empty(len(part.points), dtype=np.int64)
            number[part.triangles] = self.mesh.dofs.element_dofs.T[elements]
            numbers.append(number)
        return tuple(numbers)

    @cached_property
    def unknowns(self) -> IntArray:
        """Unknowns of each node of the scikit-fem mesh (in its numbering), shape (n, 2)."""
        dofs = displacements(self.mesh, np.arange(1)).dofs
        return np.concatenate([dofs.nodal_dofs.T, dofs.facet_dofs.T]).astype(np.int64)

    @cached_property
    def stiffness(self) -> Any:
        """Small-strain stiffness of all bodies, sparse (N/m)."""
        return sum(
            stiffness_form(part.material, part.plane, part.thickness).assemble(basis)
            for part, basis in zip(self.parts, self.bases(self.mesh), strict=True)
        )

    def bases(self, mesh: Any) -> list[Any]:
        """Return the scikit-fem basis of each body; `mesh` is the joined mesh or a turned copy of it."""
        return [displacements(mesh, elements, intorder=DEGREE) for elements in self.elements]

    def moved(self, places: Array) -> Any:
        """Return the joined mesh with its nodes at `places`, shape (2, n) (m)."""
        return replace(self.mesh, doflocs=places)


def displacements(mesh: Any, elements: IntArray, **quadrature: Any) -> Any:
    """Return the scikit-fem basis of second-order displacements on some triangles."""
    element = ElementVector(ElementTriP2())
    return CellBasis(mesh, element, elements=elements, disable_doflocs=True, **quadrature)


def edge_points(mesh: Any, edges: IntArray, xi: Array, area: Array) -> Any:
    """Return the scikit-fem basis of displacements at points of edges, each an element of its own.

    Parameters
    ----------
    mesh
        Mesh of the bodies.
    edges : ndarray, shape (n, 3)
        Edge of each point.
    xi : ndarray, shape (n,)
        Place on it, 0 to 1.
    area : ndarray, shape (n,)
        Area that the integrals take as dx (m2).
    """
    elements = mesh.f2t[0, edges[:, 1] - mesh.nvertices].astype(np.int64)
    corners = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    start, end = (corners[:, np.argmax(mesh.t[:, elements] == edges[:, k], axis=0)] for k in (0, 2))
    local = (start + xi * (end - start))[:, :, None]
    weight = area[:, None] / np.abs(mesh.mapping().detDF(local, tind=elements))
    return displacements(mesh, elements, quadrature=(local, weight))


def edge_tangents(mesh: Any, edges: IntArray, xi: Array) -> Array:
    """Return dX/dxi (m) at points of edges, shape (2, n)."""
    return np.asarray(np.einsum("na,ina->in", edge_shapes(xi)[1], mesh.doflocs[:, edges]))


def edge_lengths(corners: Array, count: int) -> Array:
    """Return lengths of quadratic edges, shape (e, 3, 2), by a Gauss rule of `count` points (m)."""
    xi, weight = gauss_rule(count)
    return np.asarray(np.linalg.norm(edge_shapes(xi)[1] @ corners, axis=-1) @ weight)
