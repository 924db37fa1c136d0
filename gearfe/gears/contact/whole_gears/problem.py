"""A contact problem of elastic bodies, and where its contact points are."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from ....base.errors import InputError
from ....base.typing import Array, ComplexArray, IntArray
from ..flank import project
from ..laws import ElementLaw, carrying
from .bodies import Bodies, edge_lengths, edge_points, edge_tangents
from .constitution import Kinematics, SaintVenantKirchhoff, SmallStrain
from .segments import Quadrature, segments, whole_edges


def nearest_places(points: ComplexArray, chain: ComplexArray) -> Array:
    """Return starting places on a chain of 2 e + 1 nodes: the nearest node of each point, shape (n,)."""
    nearest = np.empty(len(points))
    for first in range(0, len(points), 256):  # blocks that stay in the cache
        block = slice(first, first + 256)
        nearest[block] = 0.5 * np.argmin(np.abs(points[block, None] - chain), axis=1)
    return nearest


@dataclass(frozen=True)
class Surface:
    """Part of a body's outline that may touch another.

    Attributes
    ----------
    part
        Number of the body.
    edges : ndarray, shape (e, 3)
        Nodes of the joined mesh: one chain with the material on its right.
    near : ndarray of int
        Edges that may get contact points.
    """

    part: int
    edges: IntArray
    near: IntArray

    @property
    def nodes(self) -> IntArray:
        """Nodes one after the other, shape (2 e + 1,)."""
        return np.append(self.edges[:, :2].ravel(), self.edges[-1, 2])


@dataclass(frozen=True)
class Points:
    """Contact points at one state.

    Attributes
    ----------
    edges : ndarray, shape (q, 3)
        Nodes of each point's edge.
    xi : ndarray, shape (q,)
        Place on it, 0 to 1.
    weight : ndarray, shape (q,)
        Undeformed area times the share of the integral that its surface takes (m2).
    stretch : ndarray, shape (q,)
        Length of surface of each point (m).
    mate : ndarray, shape (q,)
        Chain that it is projected onto (chains 2 i and 2 i + 1 are the couple i).
    gamma, lam, mu : ndarray, shape (q,)
        Parameter of the law (Pa/m), Lame constants (Pa).
    """

    edges: IntArray
    xi: Array
    weight: Array
    stretch: Array
    mate: IntArray
    gamma: Array
    lam: Array
    mu: Array


@dataclass(frozen=True)
class ContactProblem:
    """Bodies, supports, loads and the surfaces that face each other.

    Attributes
    ----------
    bodies
        Bodies.
    mesh
        Their joined mesh, undeformed, in its present places.
    facing
        Couples of surfaces.
    law
        Contact law; its side ``pinion`` is the first surface of each couple.
    width
        Of the contact (m).
    fixed, values : ndarray, shape (f,)
        Prescribed unknowns and their displacements (m).
    loads : ndarray
        Nodal forces (N), shape (unknowns,).
    points_per_edge
        Gauss points on each edge or segment.
    quadrature
        ``points`` or ``segments``.
    kinematics
        ``small`` or ``finite``: strain of the bodies.
    stiffness
        Small-strain stiffness in the places of the mesh (N/m); assembled when left out.
    remainder
        Stiffness of parts that are condensed onto nodes of the mesh, at small strain (N/m, sparse); left out if there
        are none.
    """

    bodies: Bodies
    mesh: Any
    facing: tuple[tuple[Surface, Surface], ...]
    law: ElementLaw
    width: float
    fixed: IntArray
    values: Array
    loads: Array
    points_per_edge: int = 4
    quadrature: Quadrature = "points"
    kinematics: Kinematics = "small"
    stiffness: Any = None
    remainder: Any = None

    def __post_init__(self) -> None:
        for name, allowed in (("quadrature", ("points", "segments")), ("kinematics", ("small", "finite"))):
            if getattr(self, name) not in allowed:
                raise InputError(name, getattr(self, name), "must be one of " + ", ".join(allowed))

    @cached_property
    def unknowns(self) -> IntArray:
        """Unknowns of each node, shape (n, 2)."""
        return self.bodies.unknowns

    @cached_property
    def constitution(self) -> SmallStrain | SaintVenantKirchhoff:
        """Internal forces of the bodies."""
        remainder = csr_matrix((self.unknowns.size,) * 2) if self.remainder is None else self.remainder
        if self.kinematics == "finite":
            return SaintVenantKirchhoff(self.bodies, self.mesh, remainder)
        return SmallStrain((self.bodies.stiffness if self.stiffness is None else self.stiffness) + remainder)

    @cached_property
    def chain_nodes(self) -> IntArray:
        """Nodes of all chains, one after the other."""
        return np.concatenate([surface.nodes for couple in self.facing for surface in couple])

    @cached_property
    def counts(self) -> IntArray:
        """Edges of each chain."""
        return np.array([len(surface.edges) for couple in self.facing for surface in couple])

    @cached_property
    def carriers(self) -> list[tuple[Surface, Surface, int, float]]:
        """Surfaces with contact points: each with its mate, the number of the mate's chain and its share (0.5 or 1)."""
        carriers = []
        for couple, pair in enumerate(self.facing):
            sides = carrying(self.law, self._to_ends(*pair)[None])[0]
            share = 1.0 / float(sides.sum())
            carriers += [(pair[k], pair[1 - k], 2 * couple + 1 - k, share) for k in (0, 1) if sides[k]]
        return carriers

    def _to_ends(self, first: Surface, second: Surface) -> Array:
        """Return the lengths (m) of both surfaces from where the undeformed bodies overlap to their ends (tips)."""
        lengths = []
        for surface, mate in ((first, second), (second, first)):
            inside = np.flatnonzero(self.node_gaps(surface, mate)[::2] < 0)
            middle = int(inside.mean()) if len(inside) else len(surface.edges)
            lengths.append(edge_lengths(self.mesh.doflocs.T[surface.edges], self.points_per_edge)[middle:].sum())
        return np.array(lengths)

    def node_gaps(self, surface: Surface, mate: Surface) -> Array:
        """Return the gaps (m) of the nodes of a surface to its mate, undeformed."""
        points, nodes = ([1, 1j] @ self.mesh.doflocs[:, side.nodes] for side in (surface, mate))
        chain = np.array([len(mate.edges)]), np.zeros(len(points), dtype=np.int64)
        return project(points, nodes, *chain, nearest_places(points, nodes)).gap

    def points(self, places: Array) -> Points:
        """Return the contact points when the nodes are at `places`, shape (n, 2) (m)."""
        groups = []
        for surface, mate, chain, share in self.carriers:
            if self.quadrature == "points":
                rule = whole_edges(surface.near, self.points_per_edge)
            else:
                rule = segments(surface.near, places[surface.edges], places[mate.nodes], self.points_per_edge)
            groups.append(vars(self._points(surface, chain, share, *rule)))
        return Points(**{name: np.concatenate([group[name] for group in groups]) for name in groups[0]})

    def _points(self, surface: Surface, mate: int, share: float, edge: IntArray, xi: Array, weight: Array) -> Points:
        """Return points at xi of some of the edges of a surface, each with the part `weight` of its edge."""
        body, edges = self.bodies.parts[surface.part], surface.edges
        spread = body.thickness / self.width  # a pressure on the width of the contact spreads over the thickness
        sizes = edge_lengths(self.mesh.doflocs.T[edges], self.points_per_edge)
        gamma = self.law.parameter(spread * body.material.youngs_modulus, sizes)[edge]
        lam, mu = (np.full(len(edge), spread * modulus) for modulus in body.material.lame(body.plane))
        stretch = weight * np.linalg.norm(edge_tangents(self.mesh, edges[edge], xi), axis=0)
        return Points(edges[edge], xi, share * self.width * stretch, stretch, np.full(len(edge), mate), gamma, lam, mu)

    def at(self, points: Points) -> tuple[Any, dict[str, Array]]:
        """Return the scikit-fem basis at the points, with outward normals and Lame constants as the forms take them."""
        tangent = edge_tangents(self.mesh, points.edges, points.xi)
        n0 = np.stack([-tangent[1], tangent[0]]) / np.linalg.norm(tangent, axis=0)
        fields = {"n0": n0[:, :, None], "lam": points.lam[:, None], "mu": points.mu[:, None]}
        return edge_points(self.mesh, points.edges, points.xi, points.weight), fields

    def end_weighting(self, points: Points) -> Array:
        """Return the distance from the mate's sharp end (edges) within which a point counts in part.

        Half its stretch of surface; next to nothing for segments, which end where the mate does.
        """
        if self.quadrature == "segments":
            return np.full(len(points.xi), 1e-12)
        ends = np.stack([surface.edges[-1] for couple in self.facing for surface in couple])
        last = edge_lengths(self.mesh.doflocs.T[ends], self.points_per_edge)
        return 0.5 * points.stretch / last[points.mate]
