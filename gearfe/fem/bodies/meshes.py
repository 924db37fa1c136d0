r"""The two kinds of meshes of solid bodies: tetrahedra that anyone brought, and extruded elements.

Both have nodes, cells to show, matrices, an outer surface, and an estimate of the discretisation error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from ...base.typing import Array, BoolArray, IntArray
from ..meshing.housing_mesh import REVERSED, Extrusion
from ..plane import Material
from ..prisms import ORDER, assemble_prisms, lagrange, triangle_rule
from ..solid import SolidMatrices, assemble
from .mesh_checks import boundary_faces
from .mesh_error import energy_lost, energy_lost_by_element
from .prism_error import prism_energy_lost
from .surface import FaceFunctions, Surface, normal_velocity, triangle_functions

#: Which faces are outside, from their centres (f, 3) in m.
Outer = Callable[[Array], BoolArray]

#: Triangles between the ten nodes of one, in its own sense.
_SPLIT = np.array([[0, 3, 8], [3, 4, 9], [4, 1, 5], [8, 9, 7], [9, 5, 6], [7, 6, 2], [3, 9, 8], [4, 5, 9], [9, 6, 7]])


@dataclass(frozen=True, eq=False)
class Tetrahedra:
    """Tetrahedra of first or second order.

    Attributes
    ----------
    nodes : (n, 3)
        Coordinates (m).
    cells : (m, 4) or (m, 10)
        Elements, midside nodes in the order of `gearfe.fem.solid.EDGES`.
    """

    nodes: Array
    cells: IntArray

    @property
    def corners(self) -> BoolArray:
        """(n,) whether a node is a corner of an element."""
        found = np.zeros(len(self.nodes), dtype=bool)
        found[self.cells[:, :4]] = True
        return found

    def assemble(self, material: Material) -> SolidMatrices:
        """Stiffness and mass."""
        return assemble(self.nodes, self.cells, material)

    def surface(self, without: list[IntArray], outer: Outer | None = None) -> Surface:
        """Surface without faces that lie wholly within one of the sets of nodes, or are not `outer`."""
        faces = boundary_faces(self.cells)
        faces = faces[_chosen(self.nodes, faces, faces[:, :3], without, outer)]
        return Surface(faces, normal_velocity(triangle_functions(faces.shape[1]), self.nodes, faces))

    def energy_lost(self, material: Material, fields: Array, eigenvalues: Array, rigid: list[IntArray]) -> Array:
        """Estimate the energy that the mesh keeps fields from giving up.

        Parameters
        ----------
        material, fields, eigenvalues, rigid
            See `gearfe.fem.bodies.mesh_error.energy_lost`.
        """
        return energy_lost(self.nodes, self.cells, material, fields, eigenvalues, rigid)

    def energy_lost_by_element(
        self, material: Material, fields: Array, eigenvalues: Array, rigid: list[IntArray]
    ) -> Array:
        """Estimate that energy for each field alone, element by element.

        Parameters
        ----------
        material, fields, eigenvalues, rigid
            See `gearfe.fem.bodies.mesh_error.energy_lost_by_element`.
        """
        return energy_lost_by_element(self.nodes, self.cells, material, fields, eigenvalues, rigid)


@dataclass(frozen=True, eq=False)
class Prisms:
    """Extruded elements of order 3, 40 nodes each; see `gearfe.fem.prisms`."""

    extrusion: Extrusion

    @cached_property
    def used(self) -> IntArray:
        """(n,) number ``point * levels + level`` of each node."""
        return np.unique(self._numbers)

    @cached_property
    def nodes(self) -> Array:
        """(n, 3) coordinates (m)."""
        return self._places(self.used)

    @property
    def corners(self) -> None:
        """None: all nodes lie on the true cylinders."""
        return None

    @cached_property
    def cells(self) -> IntArray:
        """(m, 6) linear wedges between the nodes, 27 an element: what is shown."""
        low, high = self._numbers[:, _SPLIT, :-1], self._numbers[:, _SPLIT, 1:]
        wedges = np.concatenate([low, high], axis=2)  # (elements, 9, 6, 3 layers)
        return self._renumbered(wedges.transpose(0, 1, 3, 2).reshape(-1, 6))

    def assemble(self, material: Material) -> SolidMatrices:
        """Stiffness and mass."""
        return assemble_prisms(*self.extrusion, material)

    def surface(self, without: list[IntArray], outer: Outer | None = None) -> Surface:
        """Surface without faces that lie wholly within one of the sets of nodes, or are not `outer`."""
        mesh, levels, ends, sides = self.extrusion, len(self.extrusion.levels), [], []
        none = np.zeros_like(mesh.solid[:1])
        tops = mesh.solid & ~np.concatenate([mesh.solid[1:], none])
        bottoms = mesh.solid & ~np.concatenate([none, mesh.solid[:-1]])
        for layer, (solid, top, bottom) in enumerate(zip(mesh.solid, tops, bottoms, strict=True)):
            own = ORDER * layer + np.arange(ORDER + 1)
            # anticlockwise in (x, z) is clockwise seen from +y
            ends += [mesh.triangles[top][:, REVERSED] * levels + own[-1], mesh.triangles[bottom] * levels + own[0]]
            edges = _outline(mesh.triangles[solid])
            sides.append((edges[..., None] * levels + own).reshape(len(edges), -1))
        triangles, velocities = [], []
        for numbers, split, functions in (
            (np.concatenate(ends), _SPLIT, FaceFunctions(*triangle_rule()[1:])),
            (np.concatenate(sides), _side_split(), _side_functions()),
        ):
            faces = self._renumbered(numbers)
            faces = faces[_chosen(self.nodes, faces, faces, without, outer)]
            triangles.append(faces[:, split].reshape(-1, 3))
            velocities.append(normal_velocity(functions, self.nodes, faces))
        return Surface(np.concatenate(triangles), sparse.csr_array(sparse.vstack(velocities)))

    def energy_lost(self, material: Material, fields: Array, eigenvalues: Array, rigid: list[IntArray]) -> Array:
        """Estimate the energy that the mesh keeps fields from giving up.

        Parameters
        ----------
        material, fields, eigenvalues, rigid
            See `gearfe.fem.bodies.prism_error.prism_energy_lost`.
        """
        return prism_energy_lost(self.extrusion, self.used, material, fields, eigenvalues, rigid)

    @cached_property
    def _numbers(self) -> IntArray:
        """(elements, 10, 4) numbers of their nodes."""
        mesh = self.extrusion
        layer, triangle = np.nonzero(mesh.solid)
        level = ORDER * layer[:, None, None] + np.arange(ORDER + 1)
        return np.asarray(mesh.triangles[triangle][:, :, None] * len(mesh.levels) + level)

    def _renumbered(self, numbers: IntArray) -> IntArray:
        return np.searchsorted(self.used, numbers)

    def _places(self, numbers: IntArray) -> Array:
        mesh, levels = self.extrusion, len(self.extrusion.levels)
        x, z = mesh.points[numbers // levels].T
        return np.column_stack([x, mesh.levels[numbers % levels], z])


def _chosen(
    nodes: Array, faces: IntArray, corners: IntArray, without: list[IntArray], outer: Outer | None
) -> BoolArray:
    """Return (f,) whether faces lie in no set of nodes and are outer ones by the mean of their `corners`."""
    keep = np.ones(len(faces), dtype=bool) if outer is None else outer(nodes[corners].mean(axis=1))
    keep = np.asarray(keep, dtype=bool)
    for chosen in without:
        flags = np.zeros(len(nodes), dtype=bool)
        flags[chosen] = True
        keep &= ~flags[faces].all(axis=1)
    return keep


def _outline(triangles: IntArray) -> IntArray:
    """(e, 4) edges of only one of the triangles, in its sense: ends, then the nodes between."""
    edges = np.concatenate([triangles[:, [0, 1, 3, 4]], triangles[:, [1, 2, 5, 6]], triangles[:, [2, 0, 7, 8]]])
    _, first, times = np.unique(np.sort(edges[:, :2], axis=1), axis=0, return_index=True, return_counts=True)
    return np.asarray(edges[first[times == 1]])


def _side_split() -> IntArray:
    """(18, 3) triangles between the sixteen nodes of a side: an edge's four (ends first) times four levels."""
    along = np.array([0, 2, 3, 1])
    made = []
    for i in range(ORDER):
        for j in range(ORDER):
            a, b = along[i] * (ORDER + 1) + j, along[i + 1] * (ORDER + 1) + j
            made += [[a, a + 1, b + 1], [a, b + 1, b]]
    return np.array(made)


def _side_functions() -> FaceFunctions:
    """Functions of a face over an edge, its four nodes ends first, times four levels."""
    x, w = np.polynomial.legendre.leggauss(ORDER + 1)
    line = lagrange()
    edge = [line[k] for k in (0, ORDER, 1, 2)]
    along, level = np.array([[one(x) for one in functions] for functions in (edge, line)])
    d_along, d_level = np.array([[one.deriv()(x) for one in functions] for functions in (edge, line)])

    def product(one: Array, two: Array) -> Array:
        return np.einsum("as,bt->abst", one, two).reshape(len(one) * len(two), -1)

    slopes = np.stack([product(along, d_level), product(d_along, level)], axis=-1)
    return FaceFunctions(product(along, level), slopes, np.outer(w, w).ravel())
