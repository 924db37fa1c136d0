"""Two whole gears as one scikit-fem mesh, and the contact points between them, for the verification route."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..elasticity import Material, Plane, stiffness_form, triangle_rule
from ..meshing.tooth_sector import SectorMesh
from ..meshing.whole_gear import WholeGear, whole_gear
from .closest import Projection, chains_of, nearest_places, project
from .flank import gauss_rule
from .laws import ContactLaw

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class ElasticGear:
    """Sector mesh, material, plane state and face width (m) of a gear."""

    mesh: SectorMesh
    material: Material
    plane: Plane
    thickness: float


@dataclass(frozen=True)
class WholePair:
    """Two whole elastic gears in mesh.

    Parameters
    ----------
    pinion, wheel
        Gears.
    centre_distance
        a (m).
    width
        Common face width (m).
    points_per_edge
        Gauss points on each contact edge.
    """

    pinion: ElasticGear
    wheel: ElasticGear
    centre_distance: float
    width: float
    points_per_edge: int = 4

    @cached_property
    def gears(self) -> tuple[WholeGear, WholeGear]:
        """Whole meshes of pinion and wheel."""
        return whole_gear(self.pinion.mesh), whole_gear(self.wheel.mesh)

    @cached_property
    def hub_mesh(self) -> Any:
        """Both gears in one scikit-fem mesh, each in its hub's frame."""
        from skfem import MeshTri2

        one, two = self.gears
        triangles = np.concatenate([one.triangles, two.triangles + len(one.points)])
        points = np.concatenate([one.points, two.points])
        return MeshTri2(np.ascontiguousarray(points.T), np.ascontiguousarray(triangles.T))

    @cached_property
    def node_of(self) -> tuple[IntArray, IntArray]:
        """scikit-fem's number of each gear's nodes."""
        one, two = self.gears
        number = np.empty(len(one.points) + len(two.points), dtype=np.int64)
        of_element = self.hub_mesh.dofs.element_dofs.T
        first = len(one.triangles)
        number[one.triangles] = of_element[:first]
        number[two.triangles + len(one.points)] = of_element[first:]
        return number[: len(one.points)], number[len(one.points) :]

    @cached_property
    def unknowns(self) -> IntArray:
        """Unknowns of each node of the scikit-fem mesh (in its numbering), shape (n, 2)."""
        dofs = vector_basis(self.hub_mesh, elements=np.arange(1)).dofs
        return np.concatenate([dofs.nodal_dofs.T, dofs.facet_dofs.T]).astype(np.int64)

    @cached_property
    def hub_stiffness(self) -> Any:
        """Stiffness of both gears in their hubs' frames, from the scikit-fem form (N/m)."""
        r, s, weights = triangle_rule()
        count, parts = len(self.gears[0].triangles), []
        for gear, own in ((self.pinion, slice(0, count)), (self.wheel, slice(count, None))):
            elements = np.arange(self.hub_mesh.nelements)[own]
            basis = vector_basis(self.hub_mesh, elements=elements, quadrature=(np.stack([r, s]), weights))
            parts.append(stiffness_form(gear.material, gear.plane, gear.thickness).assemble(basis))
        return parts[0] + parts[1]

    def angles(self, pinion_angle: float, twist: float) -> tuple[float, float]:
        """Angles of both gears' tooth 0 (rad): the wheel's stands half a pitch above the line of centres at 0."""
        z1, z2 = self.pinion.mesh.teeth, self.wheel.mesh.teeth
        return pinion_angle, twist - pinion_angle * z1 / z2 + np.pi + np.pi / z2

    def _turns(self, pinion_angle: float, twist: float) -> Array:
        """Rotation matrix of each node, shape (n, 2, 2)."""
        turns = np.empty((len(self.unknowns), 2, 2))
        for nodes, angle in zip(self.node_of, self.angles(pinion_angle, twist), strict=True):
            c, s = np.cos(angle), np.sin(angle)
            turns[nodes] = [[c, -s], [s, c]]
        return turns

    def mesh_at(self, pinion_angle: float, twist: float) -> Any:
        """Both gears in their present places."""
        places = np.einsum("nij,jn->in", self._turns(pinion_angle, twist), self.hub_mesh.doflocs)
        places[0, self.node_of[1]] += self.centre_distance
        return replace(self.hub_mesh, doflocs=places)

    def stiffness_at(self, pinion_angle: float, twist: float) -> Any:
        """Stiffness in global axes (N/m)."""
        from scipy.sparse import coo_matrix

        rows = np.broadcast_to(self.unknowns[:, :, None], (len(self.unknowns), 2, 2))
        columns = rows.transpose(0, 2, 1)
        turn = coo_matrix((self._turns(pinion_angle, twist).ravel(), (rows.ravel(), columns.ravel()))).tocsr()
        return turn @ self.hub_stiffness @ turn.T


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


@dataclass(frozen=True)
class ContactPoints:
    """Contact points of one position, with the chains of flank edges that they are projected onto.

    Attributes
    ----------
    mesh
        Both gears in their present places.
    unknowns, of_wheel, fixed
        Unknowns of each node, whether it belongs to the wheel, unknowns at the bores.
    slave
        scikit-fem basis on the contact points.
    weight : ndarray, shape (q,)
        Area (m2).
    parameter, stress_share : ndarray, shape (q,)
        The law's gamma (Pa/m) and s.
    fields
        Normal of the undeformed flank and Lame constants at the points.
    mate : ndarray, shape (q,)
        Chain that each point is projected onto.
    chain_nodes
        Nodes of all chains, one after the other; `chains` are the slices and `counts` the numbers of edges.
    chain_edges, facets
        First chain node of each edge, and its facet in the mesh.
    fade : ndarray, shape (q,)
        See `gearfe.contact.scene.Scene`.
    rigid_overlap
        Whether the undeformed flanks overlap at any of their nodes.
    """

    mesh: Any
    unknowns: IntArray
    of_wheel: NDArray[np.bool_]
    fixed: IntArray
    wheel_centre: Array
    slave: Any
    weight: Array
    parameter: Array
    stress_share: Array
    fields: dict[str, Any]
    mate: IntArray
    chain_nodes: IntArray
    chains: tuple[slice, ...]
    counts: IntArray
    fade: Array
    rigid_overlap: bool

    def on_mate(self, projection: Projection) -> tuple[IntArray, Array, Array]:
        """Triangle of each closest point, reference coordinates in it, and dX/dxi of the undeformed edge there."""
        first = self.chain_nodes[projection.edge]
        last = self.chain_nodes[projection.edge + 2]
        middle = self.chain_nodes[projection.edge + 1]
        xi = projection.shapes @ np.array([0.0, 0.5, 1.0])
        facet = middle - self.mesh.nvertices
        elements = self.mesh.f2t[0, facet].astype(np.int64)
        start, end = _corner(self.mesh, elements, first), _corner(self.mesh, elements, last)
        corners = self.mesh.doflocs[:, np.stack([first, middle, last], axis=1)]
        return elements, start + xi * (end - start), np.einsum("na,ina->in", projection.slopes, corners)

    def share(self, place: Array) -> Array:
        """Part of each point's stretch of surface that lies before the end of the mate's flank."""
        return np.clip(0.5 + (self.counts[self.mate] - place) / (2 * self.fade), 0.0, 1.0)


def _corner(mesh: Any, elements: IntArray, vertices: IntArray) -> Array:
    """Reference coordinates of vertices in their triangles, shape (2, n)."""
    local = np.argmax(mesh.t[:, elements] == vertices, axis=0)
    return np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])[:, local]


def contact_points(pair: WholePair, law: ContactLaw, pinion_angle: float, twist: float) -> ContactPoints | None:
    """Contact points of all flanks that come near each other, or None when none do."""
    from skfem import DiscreteField

    mesh = pair.mesh_at(pinion_angle, twist)
    places = mesh.doflocs.T
    mapping = mesh.mapping()
    bodies = (pair.pinion, pair.wheel)
    flanks = _facing(pair, places, pinion_angle, twist)
    if not flanks:
        return None
    chain_nodes = np.concatenate([np.append(edges[:, :2].ravel(), edges[-1, 2]) for _, edges in flanks])
    counts = np.array([len(edges) for _, edges in flanks])
    ends = np.cumsum(2 * counts + 1)
    chains = tuple(slice(a, b) for a, b in zip(ends - 2 * counts - 1, ends, strict=True))
    xi, gauss = gauss_rule(pair.points_per_edge)
    columns: dict[str, list[NDArray[Any]]] = {}
    for number, (gear, edges) in enumerate(flanks):
        mate = number + 1 if gear == 0 else number - 1
        if law.sides != "both" and (law.sides == "pinion") != (gear == 0):
            continue
        facets = edges[:, 1] - mesh.nvertices
        elements = mesh.f2t[0, facets].astype(np.int64)
        start, end = (_corner(mesh, elements, mesh.facets[k, facets])[:, :, None] for k in (0, 1))
        local = start + xi * (end - start)
        length = mapping.detDG(xi[None], find=facets) * gauss
        normal = mapping.normals(local, elements, facets, mesh.t2f)
        near = _distance(mapping.G(xi[None], find=facets), places[chain_nodes[chains[mate]]])
        material = bodies[gear].material
        size = length.sum(axis=1)
        lam, mu = material.lame(bodies[gear].plane)
        mate_end = places[flanks[mate][1][-1]]
        shape = length.shape
        made = {
            "elements": np.broadcast_to(elements[:, None], shape),
            "local": local,
            "weight": (0.5 if law.sides == "both" else 1.0) * pair.width * length,
            "fade": 0.5 * length / _length(mate_end, pair.points_per_edge),
            "parameter": np.broadcast_to(law.parameter(material.youngs_modulus, size)[:, None], shape),
            "slave_normal": normal,
            "lam": np.full(shape, lam),
            "mu": np.full(shape, mu),
            "mate": np.full(shape, mate),
        }
        chosen = near < 2 * abs(twist) * np.linalg.norm(places - [pair.centre_distance, 0], axis=1).max() + size.max()
        for name, value in made.items():
            columns.setdefault(name, []).append(value[..., chosen])
    joined: dict[str, Any] = {name: np.concatenate(parts, axis=-1) for name, parts in columns.items()}
    if joined["mate"].size == 0:
        return None
    fields = {name: DiscreteField(joined.pop(name)[..., None]) for name in ("slave_normal", "lam", "mu")}
    of_wheel = np.zeros(len(places), dtype=bool)
    of_wheel[pair.node_of[1]] = True
    bores = [number[np.unique(gear.boundaries["bore"])] for number, gear in zip(pair.node_of, pair.gears, strict=True)]
    elements, local = joined.pop("elements"), joined.pop("local")
    return ContactPoints(
        mesh=mesh,
        unknowns=pair.unknowns,
        of_wheel=of_wheel,
        fixed=pair.unknowns[np.concatenate(bores)].ravel(),
        wheel_centre=np.array([pair.centre_distance, 0.0]),
        slave=point_basis(mesh, elements, local, joined["weight"]),
        stress_share=np.full(len(elements), float(law.uses_stress)),
        fields=fields,
        chain_nodes=chain_nodes,
        chains=chains,
        counts=counts,
        rigid_overlap=_overlap(places, flanks),
        **joined,
    )


def _facing(pair: WholePair, places: Array, pinion_angle: float, twist: float) -> list[tuple[int, IntArray]]:
    """Flanks that may touch, the pinion's and the wheel's of each tooth pair: gear and contact edges (mesh nodes)."""
    z1, z2 = pair.pinion.mesh.teeth, pair.wheel.mesh.teeth
    central = round(-pinion_angle * z1 / (2 * np.pi))
    found: list[tuple[int, IntArray]] = []
    for k in range(central - 3, central + 4):
        edges1 = pair.node_of[0][pair.gears[0].contact[k % z1]]
        edges2 = pair.node_of[1][pair.gears[1].contact[(-1 - k) % z2]]
        reach = 2 * abs(twist) * pair.centre_distance + np.linalg.norm(np.ptp(places[edges1], axis=1), axis=-1).max()
        if _distance(places[edges1[:, 1]].T[:, None], places[edges2.ravel()]).min() < reach:
            found += [(0, edges1), (1, edges2)]
    return found


def _distance(points: Array, nodes: Array) -> Array:
    """Distance to the nearest of `nodes`, shape (k, 2), of points, shape (2, a, b)."""
    apart = points[:, :, :, None] - nodes.T[:, None, None, :]
    return np.sqrt(np.min(apart[0] ** 2 + apart[1] ** 2, axis=-1))


def _length(corners: Array, count: int) -> float:
    """Length of a quadratic edge by the Gauss rule of the contact (m)."""
    xi, weight = gauss_rule(count)
    slopes = np.stack([4 * xi - 3, 4 - 8 * xi, 4 * xi - 1], axis=-1)
    return float(np.linalg.norm(slopes @ corners, axis=1) @ weight)


def _overlap(places: Array, flanks: list[tuple[int, IntArray]]) -> bool:
    for (_, edges1), (_, edges2) in zip(flanks[::2], flanks[1::2], strict=True):
        points = places[np.unique(edges1)]
        nodes = places[np.append(edges2[:, :2].ravel(), edges2[-1, 2])]
        chain = chains_of(nodes, np.array([len(edges2)]), np.zeros(len(points), dtype=np.int64))
        if (project(points, chain, nearest_places(points, nodes)).gap < 0).any():
            return True
    return False
