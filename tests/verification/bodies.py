"""Elastic bodies of second-order triangles in one scikit-fem mesh: blocks, rings, cylinders or whole gears."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from skfem import BilinearForm, CellBasis, ElementTriP2, ElementVector, MeshTri2
from skfem.helpers import ddot, eye, sym_grad, trace

from gearfe.contact.flank import edge_shapes, gauss_rule
from gearfe.elasticity import Material, Plane, triangle_rule
from gearfe.errors import InputError, unknown_name
from gearfe.typing import Array, IntArray

#: A prescribed displacement (m) or traction (Pa): a number, or a function of places, shape (n, 2), with values (n,).
Value = float | Callable[[Array], Array]


def stiffness_form(material: Material, plane: Plane, thickness: float) -> Any:
    """scikit-fem bilinear form w int sigma(u) : eps(v)."""
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
        Named outline edges (start, middle, end node); those in contact one after the other.
    thickness
        Out of the plane (m).
    """

    points: Array
    triangles: IntArray
    boundaries: Mapping[str, IntArray]
    material: Material
    plane: Plane = "strain"
    thickness: float = field(default=1.0, kw_only=True)

    def boundary(self, name: str) -> IntArray:
        """Edges called `name`, shape (k, 3)."""
        if name not in self.boundaries:
            raise unknown_name("boundary", name, self.boundaries)
        return np.asarray(self.boundaries[name], dtype=np.int64)

    def chain(self, name: str) -> IntArray:
        """The same as one open chain with the material on its right."""
        edges = self.boundary(name)
        if (edges[:-1, 2] != edges[1:, 0]).any() or edges[0, 0] == edges[-1, 2]:
            raise InputError("boundary", name, "its edges must form one open chain", "name each piece of outline apart")
        # counter-clockwise triangles have the material on the left of their edges
        element, side = np.argwhere(self.triangles[:, 3:] == edges[0, 1])[0]
        return edges[::-1, ::-1] if self.triangles[element, side] == edges[0, 0] else edges


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
        """Quadrature of degree 4 on each body; `mesh` is the joined mesh or a turned copy of it."""
        r, s, weights = triangle_rule()
        return [displacements(mesh, elements, (np.stack([r, s]), weights)) for elements in self.elements]

    def chain(self, part: int, name: str) -> IntArray:
        """`ElasticBody.chain` in the joined mesh's nodes."""
        return self.node_of[part][self.parts[part].chain(name)]

    def prescribed(
        self, conditions: Mapping[tuple[int, str], tuple[Value | None, Value | None]]
    ) -> tuple[IntArray, Array]:
        """Unknowns and values of prescribed displacements, by (body, boundary); None leaves a component free."""
        values: dict[int, float] = {}
        for edges, _, axis, value in self._by_component(conditions):
            nodes = np.unique(edges)
            at = np.broadcast_to(value(self.mesh.doflocs.T[nodes]) if callable(value) else value, len(nodes))
            values.update(zip(self.unknowns[nodes, axis].tolist(), at.tolist(), strict=True))
        return np.array(list(values), dtype=np.int64), np.array(list(values.values()))

    def tractions(self, loads: Mapping[tuple[int, str], tuple[Value, Value]]) -> Array:
        """Nodal forces (N) of tractions (Pa) on boundaries, in global axes."""
        forces = np.zeros(self.unknowns.size)
        xi, weight = gauss_rule(6)
        shapes, slopes, _ = edge_shapes(xi)
        for edges, part, axis, value in self._by_component(loads):
            corners = self.mesh.doflocs.T[edges]
            where = shapes @ corners
            at = value(where.reshape(-1, 2)).reshape(where.shape[:2]) if callable(value) else value
            load = part.thickness * at * weight * np.linalg.norm(slopes @ corners, axis=-1)
            np.add.at(forces, self.unknowns[edges, axis], load @ shapes)
        return forces

    def moved(self, places: Array) -> Any:
        """The joined mesh with its nodes at `places`, shape (2, n) (m)."""
        return replace(self.mesh, doflocs=places)

    def _by_component(self, given: Mapping[tuple[int, str], Any]) -> Iterator[tuple[IntArray, ElasticBody, int, Value]]:
        for (part, name), components in given.items():
            edges = self.node_of[part][self.parts[part].boundary(name)]
            yield from ((edges, self.parts[part], k, value) for k, value in enumerate(components) if value is not None)


def displacements(mesh: Any, elements: IntArray, quadrature: Any = None) -> Any:
    """scikit-fem basis of second-order displacements on some triangles."""
    element = ElementVector(ElementTriP2())
    return CellBasis(mesh, element, elements=elements, quadrature=quadrature, disable_doflocs=True)


def edge_points(mesh: Any, edges: IntArray, xi: Array, area: Array) -> Any:
    """scikit-fem basis of displacements at points of edges, each an element of its own.

    Parameters
    ----------
    edges : ndarray, shape (n, 3)
        Edge of each point.
    xi : ndarray, shape (n,)
        Place on it, 0 to 1.
    area : ndarray, shape (n,)
        What the integrals use as dx (m2).
    """
    elements = mesh.f2t[0, edges[:, 1] - mesh.nvertices].astype(np.int64)
    corners = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    start, end = (corners[:, np.argmax(mesh.t[:, elements] == edges[:, k], axis=0)] for k in (0, 2))
    local = (start + xi * (end - start))[:, :, None]
    return displacements(mesh, elements, (local, area[:, None] / np.abs(mesh.mapping().detDF(local, tind=elements))))


def edge_tangents(mesh: Any, edges: IntArray, xi: Array) -> Array:
    """dX/dxi (m) at points of edges, shape (2, n)."""
    return np.asarray(np.einsum("na,ina->in", edge_shapes(xi)[1], mesh.doflocs[:, edges]))


def edge_lengths(corners: Array, count: int) -> Array:
    """Lengths of quadratic edges, shape (e, 3, 2), by a Gauss rule of `count` points (m)."""
    xi, weight = gauss_rule(count)
    return np.asarray(np.linalg.norm(edge_shapes(xi)[1] @ corners, axis=-1) @ weight)
