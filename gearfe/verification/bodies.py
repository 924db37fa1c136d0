"""Elastic bodies of second-order triangles in one scikit-fem mesh: blocks, rings, cylinders or whole gears."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..contact.flank import edge_shapes, gauss_rule
from ..elasticity import Material, Plane, stiffness_form, triangle_rule
from ..errors import InputError, unknown_name

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
#: A prescribed displacement (m) or traction (Pa): a number, or a function of places, shape (n, 2), with values (n,).
Value = float | Callable[[Array], Array]


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
        Named outline edges (start, middle, end node), in any order and direction.
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
        """Edges called `name`, in one chain with the material on its right, shape (k, 3)."""
        if name not in self.boundaries:
            raise unknown_name("boundary", name, self.boundaries)
        return ordered_chain(name, np.asarray(self.boundaries[name]), self.triangles)


def ordered_chain(name: str, edges: IntArray, triangles: IntArray) -> IntArray:
    """Boundary edges turned so that the material is on their right, and put one after the other."""
    start_of = {int(m): int(a) for k in range(3) for a, m in zip(triangles[:, k], triangles[:, 3 + k], strict=True)}
    # counter-clockwise triangles have the material on the left of their edges
    turned = [
        (b, m, a) if start_of[int(m)] == int(a) else (a, m, b) for a, m, b in edges.tolist()
    ]  # start, middle, end
    follower = {edge[0]: edge for edge in turned}
    first = set(follower) - {edge[2] for edge in turned}
    if len(first) != 1 or len(follower) != len(turned):
        raise InputError("boundary", name, "its edges must form one open chain", "name each piece of outline apart")
    chain = [follower[first.pop()]]
    while chain[-1][2] in follower:
        chain.append(follower[chain[-1][2]])
    if len(chain) != len(turned):
        raise InputError("boundary", name, "its edges must form one open chain", "name each piece of outline apart")
    return np.array(chain, dtype=np.int64)


@dataclass(frozen=True)
class Bodies:
    """Bodies joined in one scikit-fem mesh.

    Parameters
    ----------
    parts
        Bodies; they share no nodes.
    """

    parts: tuple[ElasticBody, ...]

    @cached_property
    def mesh(self) -> Any:
        """All bodies, their triangles one body after the other."""
        from skfem import MeshTri2

        first = np.cumsum([0, *(len(part.points) for part in self.parts)])
        triangles = np.concatenate([part.triangles + n for part, n in zip(self.parts, first, strict=False)])
        points = np.concatenate([part.points for part in self.parts])
        return MeshTri2(np.ascontiguousarray(points.T), np.ascontiguousarray(triangles.T))

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
    def elements(self) -> tuple[IntArray, ...]:
        """Triangles of each body."""
        ends = np.cumsum([0, *(len(part.triangles) for part in self.parts)])
        return tuple(np.arange(a, b) for a, b in itertools.pairwise(ends))

    @cached_property
    def unknowns(self) -> IntArray:
        """Unknowns of each node of the scikit-fem mesh (in its numbering), shape (n, 2)."""
        dofs = vector_basis(self.mesh, elements=np.arange(1)).dofs
        return np.concatenate([dofs.nodal_dofs.T, dofs.facet_dofs.T]).astype(np.int64)

    @cached_property
    def stiffness(self) -> Any:
        """Small-strain stiffness of all bodies from the scikit-fem form, sparse (N/m)."""
        parts = [
            stiffness_form(part.material, part.plane, part.thickness).assemble(basis)
            for part, basis in zip(self.parts, self.bases(self.mesh), strict=True)
        ]
        return sum(parts[1:], parts[0])

    def bases(self, mesh: Any) -> list[Any]:
        """Quadrature of degree 4 on each body; `mesh` is the joined mesh or a turned copy of it."""
        r, s, weights = triangle_rule()
        rule = (np.stack([r, s]), weights)
        return [vector_basis(mesh, elements=elements, quadrature=rule) for elements in self.elements]

    def chain(self, part: int, name: str) -> IntArray:
        """`ElasticBody.boundary` in the joined mesh's nodes."""
        return self.node_of[part][self.parts[part].boundary(name)]

    def prescribed(self, conditions: Mapping[tuple[int, str], tuple[Value | None, Value | None]]) -> tuple[Any, Any]:
        """Unknowns and values of prescribed displacements, by (body, boundary); None leaves a component free."""
        values: dict[int, float] = {}
        for (part, name), components in conditions.items():
            nodes = np.unique(self._edges(part, name))
            places = self.mesh.doflocs.T[nodes]
            for axis, value in enumerate(components):
                if value is not None:
                    at = value(places) if callable(value) else np.full(len(nodes), value)
                    values.update(zip(self.unknowns[nodes, axis].tolist(), at.tolist(), strict=True))
        return np.array(list(values), dtype=np.int64), np.array(list(values.values()))

    def tractions(self, loads: Mapping[tuple[int, str], tuple[Value, Value]]) -> Array:
        """Nodal forces (N) of tractions (Pa) on boundaries, in global axes."""
        forces = np.zeros(self.unknowns.size)
        xi, weight = gauss_rule(6)
        shapes, slopes, _ = edge_shapes(xi)
        for (part, name), components in loads.items():
            edges = self._edges(part, name)
            corners = self.mesh.doflocs.T[edges]
            where = np.einsum("qa,eai->eqi", shapes, corners)
            length = np.linalg.norm(np.einsum("qa,eai->eqi", slopes, corners), axis=-1) * weight
            for axis, value in enumerate(components):
                at = value(where.reshape(-1, 2)).reshape(length.shape) if callable(value) else value
                nodal = self.parts[part].thickness * np.einsum("eq,qa->ea", length * at, shapes)
                np.add.at(forces, self.unknowns[edges, axis], nodal)
        return forces

    def _edges(self, part: int, name: str) -> IntArray:
        if name not in self.parts[part].boundaries:
            raise unknown_name("boundary", name, self.parts[part].boundaries)
        return self.node_of[part][np.asarray(self.parts[part].boundaries[name])]

    def moved(self, places: Array) -> Any:
        """The joined mesh with its nodes at `places`, shape (2, n) (m)."""
        return replace(self.mesh, doflocs=places)


def vector_basis(mesh: Any, *, elements: IntArray, **options: Any) -> Any:
    """Second-order displacements on some triangles."""
    from skfem import CellBasis, ElementTriP2, ElementVector

    return CellBasis(mesh, ElementVector(ElementTriP2()), elements=elements, disable_doflocs=True, **options)


def point_basis(mesh: Any, elements: IntArray, local: Array, weights: Array) -> Any:
    """Displacements at given points, one a row: integrals over it are sums with `weights`.

    Parameters
    ----------
    elements : ndarray, shape (n,)
        Triangle of each point; repeats are welcome.
    local : ndarray, shape (2, n)
        Reference coordinates in it.
    weights : ndarray, shape (n,)
        What the integrals use as dx (m2).
    """
    area = np.abs(mesh.mapping().detDF(local[:, :, None], tind=elements))
    return vector_basis(mesh, elements=elements, quadrature=(local[:, :, None], weights[:, None] / area))
