"""A contact problem of elastic bodies, and where its contact points are: what the monolithic solver works on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..contact.closest import Projection, chains_of, nearest_places, project
from ..contact.flank import edge_shapes, gauss_rule
from ..errors import InputError
from .bodies import Bodies, Value
from .constitution import Constitution, Kinematics, SaintVenantKirchhoff, SmallStrain
from .laws import ContactLaw, side_share
from .segments import Quadrature, segments, whole_edges
from .stress_term import stress_term

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class Surface:
    """Part of a body's outline that may touch another.

    Attributes
    ----------
    part
        Number of the body.
    edges : ndarray, shape (e, 3)
        Nodes of the joined mesh: one chain with the material on its right.
    near : ndarray of bool, shape (e,)
        Edges that get contact points.
    """

    part: int
    edges: IntArray
    near: NDArray[np.bool_]

    @property
    def nodes(self) -> IntArray:
        """Its nodes in turn, shape (2 e + 1,)."""
        return np.append(self.edges[:, :2].ravel(), self.edges[-1, 2])


@dataclass(frozen=True)
class SlaveEdges:
    """Edges that carry contact points, of all surfaces.

    Attributes
    ----------
    nodes : ndarray, shape (k, 3)
    element : ndarray, shape (k,)
        Triangle behind each edge; `start`, `end`, shape (2, k), are the reference coordinates of its ends in it.
    mate : ndarray, shape (k,)
        Chain that its points are projected onto (chains 2 i and 2 i + 1 are the couple i).
    width : ndarray, shape (k,)
        Contact width times the side's share (m).
    size : ndarray, shape (k,)
        Length (m).
    parameter, lam, mu : ndarray, shape (k,)
        The law's gamma (Pa/m), Lame constants (Pa).
    """

    nodes: IntArray
    element: IntArray
    start: Array
    end: Array
    mate: IntArray
    width: Array
    size: Array
    parameter: Array
    lam: Array
    mu: Array


@dataclass(frozen=True)
class Points:
    """Contact points at one state.

    Attributes
    ----------
    edge : ndarray, shape (q,)
        Row of `SlaveEdges`.
    xi : ndarray, shape (q,)
        Place on it, 0 to 1.
    weight : ndarray, shape (q,)
        Undeformed area times the side's share (m2).
    fade : ndarray, shape (q,)
        See `gearfe.contact.scene.Scene`; next to nothing for segments, which end where the mate does.
    """

    edge: IntArray
    xi: Array
    weight: Array
    fade: Array


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
        Body, side and edges of the whole contact surfaces for the stress term of theta = 1 and -1; the facing
        surfaces of the law's sides when left out.
    closing
        Gap (m) below which a point counts as closed before the first step; for bodies that contact alone holds.
    """

    bodies: Bodies
    mesh: Any
    facing: tuple[tuple[Surface, Surface], ...]
    law: ContactLaw
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
        if self.kinematics == "finite" and self.law.theta != 0:
            raise InputError("theta", self.law.theta, "must be 0 with finite strain", "take theta = 0 or small strain")

    @cached_property
    def unknowns(self) -> IntArray:
        """Unknowns of each node, shape (n, 2)."""
        return self.bodies.unknowns

    @cached_property
    def constitution(self) -> Constitution:
        """What the bodies do inside."""
        if self.kinematics == "finite":
            return SaintVenantKirchhoff(self.bodies, self.mesh)
        stiffness = self.bodies.stiffness if self.stiffness is None else self.stiffness
        return SmallStrain(stiffness - stress_term(self) if self.law.theta else stiffness)

    @cached_property
    def chain_nodes(self) -> IntArray:
        """Nodes of all chains, one after the other."""
        return np.concatenate([surface.nodes for couple in self.facing for surface in couple])

    @cached_property
    def counts(self) -> IntArray:
        """Edges of each chain."""
        return np.array([len(surface.edges) for couple in self.facing for surface in couple])

    @cached_property
    def chains(self) -> tuple[slice, ...]:
        """Where the nodes of each chain are in `chain_nodes`."""
        ends = np.cumsum(2 * self.counts + 1)
        return tuple(slice(a, b) for a, b in zip(ends - 2 * self.counts - 1, ends, strict=True))

    @cached_property
    def slaves(self) -> SlaveEdges:
        """Edges that carry contact points."""
        columns: dict[str, list[NDArray[Any]]] = {}
        for couple, surfaces in enumerate(self.facing):
            shares = [side_share(self.law, side) for side in (0, 1)]
            if self.law.sides == "tip":
                shares = [1.0, 0.0] if self._ends_nearer(*surfaces) else [0.0, 1.0]
            for side, (surface, share) in enumerate(zip(surfaces, shares, strict=True)):
                if share == 0 or not surface.near.any():
                    continue
                made = self.edge_data(surface.part, surface.edges)
                made["mate"] = np.full(len(surface.edges), 2 * couple + 1 - side)
                made["width"] = np.full(len(surface.edges), share * self.width)
                for name, value in made.items():
                    columns.setdefault(name, []).append(value[..., surface.near])
        joined: dict[str, Any] = {name: np.concatenate(parts, axis=-1) for name, parts in columns.items()}
        joined["nodes"] = joined["nodes"].T
        return SlaveEdges(**joined)

    def _ends_nearer(self, one: Surface, two: Surface) -> bool:
        """Whether the first surface ends (in a tooth's tip) nearer to where the undeformed bodies overlap."""
        places, left = self.mesh.doflocs.T, []
        for own, mate in ((one, two), (two, one)):
            points, nodes = places[own.nodes[::2]], places[mate.nodes]
            chain = chains_of(nodes, np.array([len(mate.edges)]), np.zeros(len(points), dtype=np.int64))
            inside = np.flatnonzero(project(points, chain, nearest_places(points, nodes)).gap < 0)
            middle = int(inside.mean()) if len(inside) else len(own.edges)
            left.append(float(edge_lengths(places[own.edges], self.points_per_edge)[middle:].sum()))
        return left[0] <= left[1]

    def edge_data(self, part: int, edges: IntArray) -> dict[str, Any]:
        """Geometry and constants of a body's surface edges, edges last."""
        elements = self.mesh.f2t[0, edges[:, 1] - self.mesh.nvertices].astype(np.int64)
        body = self.bodies.parts[part]
        size = edge_lengths(self.mesh.doflocs.T[edges], self.points_per_edge)
        spread = body.thickness / self.width  # a pressure on the width of the contact spreads over the thickness
        lam, mu = (spread * modulus for modulus in body.material.lame(body.plane))
        return {
            "nodes": edges.T,
            "element": elements,
            "start": corner(self.mesh, elements, edges[:, 0]),
            "end": corner(self.mesh, elements, edges[:, 2]),
            "size": size,
            "parameter": self.law.parameter(spread * body.material.youngs_modulus, size),
            "lam": np.full(len(edges), lam),
            "mu": np.full(len(edges), mu),
        }

    def points(self, nodes: Array) -> Points:
        """Contact points when the chains' nodes are at `nodes`, shape (k, 2) (m)."""
        slaves = self.slaves
        if self.quadrature == "points":
            edge, xi, weight = whole_edges(len(slaves.mate), self.points_per_edge)
        else:
            place = np.full((len(self.unknowns), 2), np.nan)
            place[self.chain_nodes] = nodes
            parts = []
            for mate in np.unique(slaves.mate):
                own = np.flatnonzero(slaves.mate == mate)
                at, *rest = segments(place[slaves.nodes[own]], nodes[self.chains[mate]], self.points_per_edge)
                parts.append((own[at], *rest))
            edge, xi, weight = (np.concatenate(columns) for columns in zip(*parts, strict=True))
        _, slopes, _ = edge_shapes(xi)
        slope = np.einsum("qa,qai->qi", slopes, self.mesh.doflocs.T[slaves.nodes[edge]])
        length = np.linalg.norm(slope, axis=1) * weight
        if self.quadrature == "points":
            ends = np.stack([couple[side].edges[-1] for couple in self.facing for side in (0, 1)])
            mate_end = edge_lengths(self.mesh.doflocs.T[ends], self.points_per_edge)
            fade = 0.5 * length / mate_end[slaves.mate[edge]]
        else:
            fade = np.full(len(edge), 1e-12)
        return Points(edge, xi, slaves.width[edge] * length, fade)

    def on_mate(self, projection: Projection) -> tuple[IntArray, Array, Array]:
        """Triangle of each closest point, reference coordinates in it, and dX/dxi of the undeformed edge there."""
        first = self.chain_nodes[projection.edge]
        last = self.chain_nodes[projection.edge + 2]
        middle = self.chain_nodes[projection.edge + 1]
        xi = projection.shapes @ np.array([0.0, 0.5, 1.0])
        elements = self.mesh.f2t[0, middle - self.mesh.nvertices].astype(np.int64)
        start, end = corner(self.mesh, elements, first), corner(self.mesh, elements, last)
        corners = self.mesh.doflocs[:, np.stack([first, middle, last], axis=1)]
        return elements, start + xi * (end - start), np.einsum("na,ina->in", projection.slopes, corners)


def contact_problem(
    bodies: Bodies,
    facing: tuple[tuple[tuple[int, str], tuple[int, str]], ...],
    law: ContactLaw,
    *,
    prescribed: Mapping[tuple[int, str], tuple[Value | None, Value | None]],
    tractions: Mapping[tuple[int, str], tuple[Value, Value]] | None = None,
    **options: Any,
) -> ContactProblem:
    """Contact problem of bodies whose boundaries go by their names.

    Parameters
    ----------
    bodies
        Bodies as they stand, undeformed.
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
    couples = []
    for one, two in facing:
        chains = bodies.chain(*one), bodies.chain(*two)
        surfaces = [Surface(p, c, np.ones(len(c), bool)) for (p, _), c in zip((one, two), chains, strict=True)]
        couples.append((surfaces[0], surfaces[1]))
    fixed, values = bodies.prescribed(prescribed)
    loads = bodies.tractions(tractions or {})
    width = min(part.thickness for part in bodies.parts)
    return ContactProblem(bodies, bodies.mesh, tuple(couples), law, width, fixed, values, loads, **options)


def corner(mesh: Any, elements: IntArray, vertices: IntArray) -> Array:
    """Reference coordinates of vertices in their triangles, shape (2, n)."""
    local = np.argmax(mesh.t[:, elements] == vertices, axis=0)
    return np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])[:, local]


def edge_lengths(corners: Array, count: int) -> Array:
    """Lengths of quadratic edges, shape (e, 3, 2), by the Gauss rule of the contact (m)."""
    xi, weight = gauss_rule(count)
    slopes = edge_shapes(xi)[1]
    return np.asarray(np.linalg.norm(np.einsum("qa,eai->eqi", slopes, corners), axis=-1) @ weight)
