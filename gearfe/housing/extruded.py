r"""A housing on extruded elements of order 3: what the tetrahedra are judged by.

An element's functions are products, :math:`\phi_{ap} = \varphi_a(x, z)\,\chi_p(y)`, and so its matrices are sums of
products of plane and line integrals,

.. math::
    \int \partial_x\phi\,\partial_z\phi = \int\partial_x\varphi_a\,\partial_z\varphi_b \int\chi_p\chi_q,\qquad
    \int \partial_x\phi\,\partial_y\phi = \int\partial_x\varphi_a\,\varphi_b \int\chi_p\chi_q' ,\ \ldots

Nothing of this is shared with the tetrahedra: neither mesh, nor elements, nor assembly. Frequencies of both come from
above, so the lower one is nearer. Halving the size across the edges lowers those of the shipped housing by another
0.1 to 0.3 %, at the rate :math:`h^{2\alpha}` of the singular edges.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..meshing.extruded_housing import ORDER, Extrusion, Sizes, extruded_housing, triangle_functions
from ..reduction.craig_bampton import reduce_model
from ..reduction.modal_body import ModalBody
from ..tables.housing import HousingTable
from .attachments import bore_attachment, interface_matrix
from .build import bores, foot_nodes, inside_faces, material
from .model import rigid_motions

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Gauss points along a layer: products of two functions of order 3.
_POINTS = 4


class Model(NamedTuple):
    """Assembled matrices."""

    #: (n, 3) m
    nodes: Floats
    #: (3 n, 3 n)
    stiffness: sparse.csr_array
    #: (n, n), one axis
    nodal_mass: sparse.csr_array


def extruded_body(table: HousingTable, sizes: Sizes, *, modes: int | None = None) -> ModalBody:
    """Reduced body of a housing from the extruded mesh: attachments as in the product's own, no faces to draw."""
    mesh = extruded_housing(table, sizes)
    model = assemble(mesh, table)
    nodes = model.nodes
    attachments = [bore_attachment(bore, i + 1, nodes)[0] for i, bore in enumerate(bores(table))]
    held = foot_nodes(table, nodes) if table.feet.fixed else np.zeros(len(nodes), dtype=bool)
    free = ~held
    for attachment in attachments:
        free[attachment.nodes] = False
    internal = (3 * np.flatnonzero(free)[:, None] + np.arange(3)).ravel()
    mass = sparse.kron(model.nodal_mass, sparse.eye_array(3), format="csr")
    given = table.reduction
    found = reduce_model(
        model.stiffness, mass, interface_matrix(attachments, nodes), internal,
        count=given.modes if modes is None else modes, below_hz=given.modes_below_Hz if modes is None else math.inf,
        at_least=given.least_modes, corrections=given.quasi_static_levels, free=not held.any(), solver=given.solver,
    )  # fmt: skip
    motions, count, empty = rigid_motions(nodes), len(attachments), np.zeros((0, 10), dtype=np.int64)
    normal = outer_velocity(mesh, table, [np.flatnonzero(held), *(a.nodes for a in attachments)]) @ found.shapes
    return ModalBody(
        mass=found.mass,
        damping=np.zeros_like(found.mass),
        stiffness=found.stiffness,
        attachment_names=tuple(a.name for a in attachments),
        attachment_points=np.array([a.point for a in attachments]).reshape(count, 3),
        attachment_axes=np.array([a.axis for a in attachments]).reshape(count, 3),
        internal_hz=np.sqrt(np.maximum(found.eigenvalues, 0.0)) / (2.0 * np.pi),
        modes=found.modes,
        nodes=nodes,
        elements=empty,
        shapes=found.shapes,
        faces=empty[:, :6],
        normals=np.zeros_like(nodes),
        radiation=normal.T @ normal,
        momentum=np.asarray((mass @ motions).T @ found.shapes),
        rigid_mass=motions.T @ (mass @ motions),
        tail=found.tail,
        levels=found.levels,
        next_hz=float(np.sqrt(max(found.next_eigenvalue, 0.0)) / (2.0 * np.pi)),
        softening=np.zeros_like(found.mass),
        held=bool(held.any()),
        solver=found.solver,
    )


def assemble(mesh: Extrusion, table: HousingTable) -> Model:
    """Stiffness and consistent mass as sums of (plane matrix) x (line matrix), one term for each set of solid faces."""
    given = material(table)
    plane = _plane_integrals(1e-3 * mesh.points, mesh.triangles)
    count = len(mesh.levels)
    keys: list[Ints] = []
    data: dict[str, list[Floats]] = {}
    sets, which = np.unique(mesh.solid, axis=0, return_inverse=True)
    for number, active in enumerate(sets):
        if not active.any():
            continue
        line = _line_integrals(1e-3 * mesh.levels, np.flatnonzero(which.ravel() == number))
        nodes = mesh.triangles[active]
        rows, columns = np.repeat(nodes, 10, axis=1).ravel(), np.tile(nodes, (1, 10)).ravel()
        pairs, inverse = np.unique(rows * len(mesh.points) + columns, return_inverse=True)
        flat = {
            name: np.bincount(inverse, weights=values[active].ravel(), minlength=len(pairs))
            for name, values in plane.items()
        }
        p, q = np.nonzero(line["touch"] > 0.0)
        first = (pairs // len(mesh.points))[:, None] * count + p
        second = (pairs % len(mesh.points))[:, None] * count + q
        keys.append((first * (len(mesh.points) * count) + second).ravel())
        m, d, k, dt = (line[name][p, q] for name in ("mass", "slope", "stiffness", "slope of the column's"))
        # names: derivative of the row's function, of the column's; y lies between x and z
        for name, values, along in (
            ("xx", flat["xx"], m), ("zz", flat["zz"], m), ("xz", flat["xz"], m), ("zx", flat["zx"], m),
            ("xy", flat["x0"], dt), ("yx", flat["0x"], d), ("zy", flat["z0"], dt), ("yz", flat["0z"], d),
            ("yy", flat["00"], k), ("mass", flat["00"], m),
        ):  # fmt: skip
            data.setdefault(name, []).append(np.asarray(values[:, None] * along, dtype=float).ravel())
    found, place = np.unique(np.concatenate(keys), return_inverse=True)
    size = len(mesh.points) * count
    summed = {name: np.bincount(place, weights=np.concatenate(v), minlength=len(found)) for name, v in data.items()}
    used, rows = np.unique(found // size, return_inverse=True)
    columns = np.searchsorted(used, found % size)
    starts = np.searchsorted(rows, np.arange(len(used) + 1))
    blocks = np.empty((len(found), 3, 3))
    lam, mu = given.lame_lambda, given.shear_modulus
    for i, a in enumerate("xyz"):
        for j, b in enumerate("xyz"):
            blocks[:, i, j] = lam * summed[a + b] + mu * summed[b + a]
        blocks[:, i, i] += mu * (summed["xx"] + summed["yy"] + summed["zz"])
    n = len(used)
    stiffness = sparse.bsr_array((blocks, columns, starts), shape=(3 * n, 3 * n)).tocsr()
    nodal = sparse.csr_array((given.density * summed["mass"], columns, starts), shape=(n, n))
    place_mm = np.column_stack(
        [mesh.points[used // count, 0], mesh.levels[used % count], mesh.points[used // count, 1]]
    )
    return Model(1e-3 * place_mm, stiffness, nodal)


def outer_velocity(mesh: Extrusion, table: HousingTable, without: list[Ints]) -> sparse.csr_array:
    """G with ``|G v|^2`` the integral of the squared normal velocity over the outer surface, v the nodal velocities.

    One row a quadrature point, for faces that do not lie wholly within one of the sets of nodes `without`.
    """
    levels, ends = len(mesh.levels), []
    layers = [ORDER * layer + np.arange(ORDER + 1) for layer in range(len(mesh.solid))]
    above, below = (np.zeros_like(mesh.solid[:1]),) * 2
    tops = mesh.solid & ~np.concatenate([mesh.solid[1:], above])
    bottoms = mesh.solid & ~np.concatenate([below, mesh.solid[:-1]])
    used = np.zeros(len(mesh.points) * levels, dtype=bool)
    for own, solid, top, bottom in zip(layers, mesh.solid, tops, bottoms, strict=True):
        used[mesh.triangles[solid][..., None] * levels + own] = True
        ends += [mesh.triangles[top] * levels + own[-1], mesh.triangles[bottom] * levels + own[0]]
    sides = [
        (edges[..., None] * levels + own).reshape(len(edges), -1)
        for own, solid in zip(layers, mesh.solid, strict=True)
        for edges in [_outline(mesh.triangles[solid])]
    ]
    place = np.column_stack([np.repeat(mesh.points, levels, axis=0), np.tile(mesh.levels, len(mesh.points))])
    place, new = 1e-3 * place[:, [0, 2, 1]], np.cumsum(used) - 1
    parts = []
    for found, quadrature in ((np.concatenate(ends), _end_quadrature), (np.concatenate(sides), _side_quadrature)):
        outer = ~inside_faces(table, place[found].mean(axis=1))
        for nodes in without:
            within = np.zeros(int(new[-1]) + 1, dtype=bool)
            within[nodes] = True
            outer &= ~within[new[found]].all(axis=1)
        faces = found[outer]
        values, areas = quadrature(place[faces])
        scaled = areas / np.sqrt(np.maximum(np.linalg.norm(areas, axis=2), 1e-300))[..., None]
        entries = np.einsum("ap,fpk->fpak", values, scaled)
        columns = np.broadcast_to(3 * new[faces][:, None, :, None] + np.arange(3), entries.shape)
        f, p, a, _ = entries.shape
        starts = np.arange(0, f * p * a * 3 + 1, a * 3)
        shape = (f * p, 3 * (int(new[-1]) + 1))
        parts.append(sparse.csr_array((entries.ravel(), columns.ravel(), starts), shape=shape))
    return sparse.csr_array(sparse.vstack(parts))


def _outline(triangles: Ints) -> Ints:
    """(e, 4) edges of only one of the triangles: ends, then the nodes between."""
    edges = np.concatenate([triangles[:, [0, 1, 3, 4]], triangles[:, [1, 2, 5, 6]], triangles[:, [2, 0, 7, 8]]])
    _, first, times = np.unique(np.sort(edges[:, :2], axis=1), axis=0, return_index=True, return_counts=True)
    return np.asarray(edges[first[times == 1]])


def _end_quadrature(place: Floats) -> tuple[Floats, Floats]:
    """Functions (10, p) and area vectors (f, p, 3) of plane triangles at their points (f, 10, 3)."""
    values, slopes, weights = triangle_functions()
    one, two = (np.einsum("fak,ap->fpk", place, slopes[..., axis]) for axis in range(2))
    return values, np.cross(one, two) * weights[:, None]


def _side_quadrature(place: Floats) -> tuple[Floats, Floats]:
    """The same of faces (f, 16, 3) over an edge, its four nodes in gmsh's order, times four levels."""
    x, w = np.polynomial.legendre.leggauss(ORDER + 1)
    line = _lagrange()
    edge = [line[k] for k in (0, ORDER, 1, 2)]
    along, level = np.array([[one(x) for one in functions] for functions in (edge, line)])
    d_along, d_level = np.array([[one.deriv()(x) for one in functions] for functions in (edge, line)])

    def product(one: Floats, two: Floats) -> Floats:
        return np.einsum("as,bt->abst", one, two).reshape(len(one) * len(two), -1)

    one, two = (
        np.einsum("fak,ap->fpk", place, slopes) for slopes in (product(d_along, level), product(along, d_level))
    )
    return product(along, level), np.cross(one, two) * np.outer(w, w).reshape(-1, 1)


def _plane_integrals(points: Floats, triangles: Ints) -> dict[str, Floats]:
    """(m, 10, 10) integrals over the triangles: ``xz`` of d/dx of the row's function times d/dz of the column's, ..."""
    values, slopes, weights = triangle_functions()
    forward = np.einsum("eak,apm->epkm", points[triangles], slopes, optimize=True)
    det = np.linalg.det(forward)
    inverse = np.linalg.inv(forward)
    gradient = np.einsum("apm,epmk->eapk", slopes, inverse, optimize=True)
    volume = np.abs(det) * weights
    parts = {"x": gradient[..., 0], "z": gradient[..., 1], "0": np.broadcast_to(values, gradient.shape[:3])}
    wanted = ("xx", "zz", "xz", "zx", "x0", "0x", "z0", "0z", "00")
    return {name: np.asarray((parts[name[0]] * volume[:, None]) @ parts[name[1]].transpose(0, 2, 1)) for name in wanted}


def _line_integrals(levels: Floats, layers: Ints) -> dict[str, Floats]:
    """(l, l) integrals over the chosen layers: mass, slope (of the row's function), stiffness; which levels touch."""
    x, w = np.polynomial.legendre.leggauss(_POINTS)
    lagrange = _lagrange()
    values = np.array([one(x) for one in lagrange])
    slopes = np.array([one.deriv()(x) for one in lagrange])
    made = {name: np.zeros((len(levels), len(levels))) for name in ("mass", "slope", "stiffness", "touch")}
    for layer in layers:
        at = slice(ORDER * layer, ORDER * layer + ORDER + 1)
        half = 0.5 * (levels[at][-1] - levels[at][0])
        made["mass"][at, at] += half * (values * w) @ values.T
        made["slope"][at, at] += (slopes * w) @ values.T
        made["stiffness"][at, at] += (slopes * w) @ slopes.T / half
        made["touch"][at, at] = 1.0
    made["slope of the column's"] = made["slope"].T
    return made


def _lagrange() -> list[np.polynomial.Polynomial]:
    """Functions of a line element on -1..1, its nodes equally spaced from end to end."""
    grid = np.linspace(-1.0, 1.0, ORDER + 1)
    made = [np.polynomial.Polynomial.fromroots(np.delete(grid, k)) for k in range(ORDER + 1)]
    return [one / one(grid[k]) for k, one in enumerate(made)]
