"""A contact problem of elastic bodies, and where its contact points are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from gearfe.contact.flank import project
from gearfe.contact.laws import ElementLaw
from gearfe.errors import InputError
from gearfe.typing import Array, ComplexArray, IntArray

from .bodies import Bodies, Value, edge_lengths, edge_points, edge_tangents
from .constitution import Kinematics, SaintVenantKirchhoff, SmallStrain, linear_stress_rate
from .forms import stress_term
from .laws import shares_of, theta_of
from .segments import Quadrature, segments, whole_edges


def nearest_places(points: ComplexArray, chain: ComplexArray) -> Array:
    """Starting places on a chain of 2 e + 1 nodes: the nearest node of each point, shape (n,)."""
    nearest = np.empty(len(points))
    for first in range(0, len(points), 256):  # blocks that stay in the cache
        part = slice(first, first + 256)
        nearest[part] = 0.5 * np.argmin(np.abs(points[part, None] - chain), axis=1)
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
        """Its nodes in turn, shape (2 e + 1,)."""
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
        Undeformed area times the side's share (m2).
    stretch : ndarray, shape (q,)
        Length of the surface that a point stands for (m).
    mate : ndarray, shape (q,)
        Chain that it is projected onto (chains 2 i and 2 i + 1 are the couple i).
    gamma, lam, mu : ndarray, shape (q,)
        The law's parameter (Pa/m), Lame constants (Pa).
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
        Their joined mesh in its present places, undeformed.
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
        Small-strain stiffness in the mesh's places (N/m); assembled when left out.
    skins
        Body, side and edges of the contact surfaces of theta's stress term; the facing surfaces when left out.
    closing
        Gap (m) below which a point counts as closed before the first step; for bodies that contact alone holds.
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
    skins: tuple[tuple[int, int, IntArray], ...] | None = None
    closing: float = 0.0

    def __post_init__(self) -> None:
        for name, allowed in (("quadrature", ("points", "segments")), ("kinematics", ("small", "finite"))):
            if getattr(self, name) not in allowed:
                raise InputError(name, getattr(self, name), "must be one of " + ", ".join(allowed))
        theta = theta_of(self.law)
        if self.kinematics == "finite" and theta != 0:
            raise InputError("theta", theta, "must be 0 with finite strain", "take theta = 0 or small strain")

    @cached_property
    def unknowns(self) -> IntArray:
        """Unknowns of each node, shape (n, 2)."""
        return self.bodies.unknowns

    @cached_property
    def constitution(self) -> SmallStrain | SaintVenantKirchhoff:
        """What the bodies do inside, theta's stress term included."""
        if self.kinematics == "finite":
            return SaintVenantKirchhoff(self.bodies, self.mesh)
        stiffness = self.bodies.stiffness if self.stiffness is None else self.stiffness
        skins = self.skins or [(s.part, k, s.edges) for couple in self.facing for k, s in enumerate(couple)]
        theta, shares = theta_of(self.law), shares_of(self.law, np.zeros((1, 2)))[0]
        for part, side, edges in skins:
            if theta and shares[side] > 0:
                every = whole_edges(np.arange(len(edges)), self.points_per_edge)
                points = self._points(part, edges, 0, shares[side], *every)
                basis, surface = self.at(points)
                fields = {"stress_rate": linear_stress_rate(**surface), "gamma": points.gamma[:, None]}
                stiffness = stiffness - stress_term.assemble(basis, theta=theta, **fields)
        return SmallStrain(stiffness)

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
        """Surfaces that carry contact points, with mate, number of the mate's chain and share of the pressure."""
        made = []
        for couple, pair in enumerate(self.facing):
            shares = shares_of(self.law, self._to_ends(*pair)[None])[0]
            made += [(pair[k], pair[1 - k], 2 * couple + 1 - k, shares[k]) for k in (0, 1) if shares[k] > 0]
        return made

    def _to_ends(self, one: Surface, two: Surface) -> Array:
        """How far (m) the surfaces go on to their ends (teeth's tips) from where the undeformed bodies overlap."""
        left = []
        for own, mate in ((one, two), (two, one)):
            inside = np.flatnonzero(self.node_gaps(own, mate)[::2] < 0)
            middle = int(inside.mean()) if len(inside) else len(own.edges)
            left.append(edge_lengths(self.mesh.doflocs.T[own.edges], self.points_per_edge)[middle:].sum())
        return np.array(left)

    def node_gaps(self, own: Surface, mate: Surface) -> Array:
        """Gaps (m) of a surface's nodes to its mate, undeformed."""
        points, nodes = ([1, 1j] @ self.mesh.doflocs[:, surface.nodes] for surface in (own, mate))
        chain = np.array([len(mate.edges)]), np.zeros(len(points), dtype=np.int64)
        return project(points, nodes, *chain, nearest_places(points, nodes)).gap

    def points(self, places: Array) -> Points:
        """Contact points when the nodes are at `places`, shape (n, 2) (m)."""
        made = []
        for own, mate, chain, share in self.carriers:
            if self.quadrature == "points":
                rule = whole_edges(own.near, self.points_per_edge)
            else:
                rule = segments(own.near, places[own.edges], places[mate.nodes], self.points_per_edge)
            made.append(vars(self._points(own.part, own.edges, chain, share, *rule)))
        return Points(**{name: np.concatenate([part[name] for part in made]) for name in made[0]})

    def _points(
        self, part: int, edges: IntArray, mate: int, share: float, edge: IntArray, xi: Array, weight: Array
    ) -> Points:
        """Points at xi of some of the `edges` of a body that stand for the parts `weight` of them."""
        body = self.bodies.parts[part]
        spread = body.thickness / self.width  # a pressure on the width of the contact spreads over the thickness
        sizes = edge_lengths(self.mesh.doflocs.T[edges], self.points_per_edge)
        gamma = self.law.parameter(spread * body.material.youngs_modulus, sizes)[edge]
        lam, mu = (np.full(len(edge), spread * modulus) for modulus in body.material.lame(body.plane))
        stretch = weight * np.linalg.norm(edge_tangents(self.mesh, edges[edge], xi), axis=0)
        return Points(edges[edge], xi, share * self.width * stretch, stretch, np.full(len(edge), mate), gamma, lam, mu)

    def at(self, points: Points) -> tuple[Any, dict[str, Array]]:
        """scikit-fem basis at the points, and outward normal and Lame constants there as the forms take them."""
        tangent = edge_tangents(self.mesh, points.edges, points.xi)
        n0 = np.stack([-tangent[1], tangent[0]]) / np.linalg.norm(tangent, axis=0)
        fields = {"n0": n0[:, :, None], "lam": points.lam[:, None], "mu": points.mu[:, None]}
        return edge_points(self.mesh, points.edges, points.xi, points.weight), fields

    def end_weighting(self, points: Points) -> Array:
        """Distance from the mate's sharp end (edges) within which a point counts in part: half its stretch of surface.

        Next to nothing for segments, which end where the mate does.
        """
        if self.quadrature == "segments":
            return np.full(len(points.xi), 1e-12)
        ends = np.stack([surface.edges[-1] for couple in self.facing for surface in couple])
        last = edge_lengths(self.mesh.doflocs.T[ends], self.points_per_edge)
        return 0.5 * points.stretch / last[points.mate]


def contact_problem(
    bodies: Bodies,
    facing: tuple[tuple[tuple[int, str], tuple[int, str]], ...],
    law: ElementLaw,
    *,
    prescribed: Mapping[tuple[int, str], tuple[Value | None, Value | None]],
    tractions: Mapping[tuple[int, str], tuple[Value, Value]] | None = None,
    **options: Any,
) -> ContactProblem:
    """Contact problem of bodies that stand undeformed.

    Parameters
    ----------
    facing
        Couples of boundaries, each (number of the body, name).
    law
        Contact law; its side ``pinion`` is the first of each couple.
    prescribed
        Displacements (m) by (body, boundary); None leaves a component free.
    tractions
        Tractions (Pa) by (body, boundary).
    options
        `points_per_edge`, `quadrature`, `kinematics`, `closing` of `ContactProblem`.
    """

    def surface(part: int, name: str) -> Surface:
        edges = bodies.chain(part, name)
        return Surface(part, edges, np.arange(len(edges)))

    couples = tuple((surface(*one), surface(*two)) for one, two in facing)
    fixed, values = bodies.prescribed(prescribed)
    loads = bodies.tractions(tractions or {})
    width = min(part.thickness for part in bodies.parts)
    return ContactProblem(bodies, bodies.mesh, couples, law, width, fixed, values, loads, **options)
