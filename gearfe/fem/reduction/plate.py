r"""Condense a plane part of finite elements to the interfaces of its joints and a few modes (Craig & Bampton).

Plane stress, second-order triangles. The nodes of an interface move as one, u = d + f i (Z - Z_i). With the first
interface held the modes are

1. the static shapes of unit displacements and turns of the other interfaces (Craig & Bampton, AIAA J. 6 (1968)),
2. the lowest vibrations with all interfaces held,
3. the static responses to the inertia loads of a moving frame: acceleration, rotation and angular acceleration (loads
   rho N, N = 1, i, Z, iZ). With them a steady rotation stretches the body as its full mesh would be stretched.
4. static derivatives: the displacement of the mesh, beyond the sum, when two of these act at once. This is K^-1 times
   the quadratic part of the forces. A bent bar becomes shorter; without static derivatives the modes would stretch it
   (Idelsohn & Cardona, Comput. Methods Appl. Mech. Eng. 49 (1985) 253-279; Wu & Tiso, Multibody Syst. Dyn. 36 (2016)
   405-425). To this order, interfaces that rotate by f displace their nodes by (i f - f^2/2) (Z - Z_i).

Strains are Green-Lagrange strains. The energy is that of St. Venant and Kirchhoff, quadratic in the strains and exact
in the modes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, eigsh, splu

from ...base.typing import Array, IntArray
from ..plane import Material, elasticity, physical_gradients, triangle_rule
from .plate_data import Interface, Plate

#: Share of its own energy below which a shape counts as made of others; of the largest derivative, for derivatives.
DEPENDENT, SMALL = 1e-6, 3e-2
#: Share of the mass of a mode's vector that is added to it: across the frame, where it cannot move by itself, a vector
#: may move just what that of another mode moves along it (in slender parts both are functions of one coordinate), and
#: their difference is without mass.
MASSLESS = 1e-8
#: Share of the largest singular value below which a combination of strains is rounding.
ROUNDING = 1e-9


class _Elements(NamedTuple):
    """Operators of the mesh: rows are quadrature points."""

    gradient: sparse.csr_matrix  # H = (u_x,x  u_x,y  u_y,x  u_y,y) of every point by the displacements, (4 q, 2 n)
    values: sparse.csr_matrix  # (q, n)
    weight: Array  # (q,) volume of each point (m3)
    law: Array  # (3, 3) plane stress

    def strains(self, one: Array, two: Array | None = None) -> Array:
        """Linear strain of the gradients (q, 4), or sym(H_1^T H_2) of two; (q, 3) with twice the shear."""
        if two is None:
            return np.stack([one[:, 0], one[:, 3], one[:, 1] + one[:, 2]], axis=1)
        a, b = one.reshape(-1, 2, 2), two.reshape(-1, 2, 2)
        product = np.einsum("pki,pkj->pij", a, b)
        return np.stack([product[:, 0, 0], product[:, 1, 1], product[:, 0, 1] + product[:, 1, 0]], axis=1)

    def turned(self, gradient: Array, stress: Array) -> Array:
        """H S of every point as rows like those of gradients, S given as (xx, yy, xy)."""
        tensor = stress[:, [0, 2, 2, 1]].reshape(-1, 2, 2)
        return (gradient.reshape(-1, 2, 2) @ tensor).reshape(-1, 4)


def reduce_plate(
    points: Array, triangles: IntArray, thickness: float, material: Material, interfaces: list[Interface],
    count: int,
) -> Plate:  # fmt: skip
    """Condense a plane-stress mesh to its interfaces and a few modes, see the module's docstring.

    Parameters
    ----------
    points : ndarray, shape (n, 2)
        Nodes (m).
    triangles : ndarray of int, shape (m, 6)
        Nodes of the second-order triangles: corners, then mid-sides.
    thickness : float
        Thickness (m).
    material : Material
        Elasticity and density.
    interfaces : list of Interface
        Rigid sets of nodes; the frame goes with the first.
    count : int
        Number of vibrations with all interfaces held that are kept.

    References
    ----------
    R. R. Craig, M. C. C. Bampton, Coupling of substructures for dynamic analyses, AIAA J. 6 (1968).
    """
    elements = _operators(points, triangles, thickness, material)
    n, Z = len(points), points[:, 0] + 1j * points[:, 1]
    volume = sparse.diags(elements.weight)
    density = material.density
    M = density * elements.values.T @ volume @ elements.values  # by complex displacements
    first = sparse.csr_matrix(np.array([[1.0, 0, 0, 0], [0, 0, 0, 1.0], [0, 1.0, 1.0, 0]]))
    linear = sparse.kron(sparse.identity(len(elements.weight)), first).tocsr() @ elements.gradient
    stiff = linear.T @ sparse.kron(volume, sparse.csr_matrix(elements.law)) @ linear
    held = np.zeros(n, dtype=bool)
    for interface in interfaces:
        held[interface.nodes] = True
    free = np.flatnonzero(np.repeat(~held, 2))
    inner = splu(stiff[free][:, free].tocsc())

    def answer(load: Array) -> Array:
        """Displacements (2 n, k) under loads, all interfaces held."""
        out = np.zeros((2 * n, load.shape[1]))
        out[free] = inner.solve(np.ascontiguousarray(load[free]))
        return out

    static = _static_shapes(Z, interfaces[1:], n)
    if len(interfaces) > 1:
        static -= answer(stiff @ static)
    mass = sparse.kron(M, sparse.identity(2)).tocsr()
    free_mass = mass[free][:, free]
    inverse = LinearOperator(free_mass.shape, matvec=inner.solve)
    start = np.ones(len(free))
    _, lowest = eigsh(stiff[free][:, free], count, free_mass, sigma=0.0, which="LM", OPinv=inverse, v0=start)
    vibrations = np.zeros((2 * n, count))
    vibrations[free] = lowest
    loads = _real(np.stack([np.ones(n), 1j * np.ones(n), Z, 1j * Z], axis=1))
    bent = np.hstack([static, _independent(np.hstack([vibrations, answer(mass @ loads)]), stiff)])
    omega, shapes = _principal(bent, stiff, mass)
    more, widths = _derivatives(elements, shapes, interfaces, Z)
    more = widths + answer(more - stiff @ widths)
    more = _independent(more, stiff, shapes, SMALL)
    omega, shapes = _principal(np.hstack([shapes, more]), stiff, mass)
    size = float(np.hypot(*np.ptp(points, axis=0)))
    shapes *= size / np.abs(_complex(shapes)).max(axis=0)
    modes = _complex(shapes)
    basis = np.column_stack([np.ones(n), Z, modes])
    matrix = basis.conj().T @ (M @ basis)
    matrix[2:, 2:] += np.diag(MASSLESS * matrix.diagonal()[2:])
    total, moment = float(matrix[0, 0].real), matrix[0, 1]
    centre = complex(moment / total)
    e, recovery = _strain_basis(elements, shapes)
    r = shapes.shape[1]
    means = [_mean(modes, interface, Z) for interface in interfaces]
    return Plate(
        mass_matrix=0.5 * (matrix + matrix.conj().T),
        linear=e[:, :r],
        quadratic=_symmetric(e[:, r:], r),
        centres=np.array([complex(*interface.centre) for interface in interfaces]),
        shifts=np.array([shift for shift, _ in means]),
        turns=np.array([turn for _, turn in means]),
        size=size,
        points=Z,
        triangles=triangles,
        modes=modes,
        stresses=_at_nodes(triangles, recovery, n),
        mass=total,
        centre=centre,
        inertia=float(matrix[1, 1].real) - total * abs(centre) ** 2,
        frequencies=omega / (2 * np.pi),
    )


def _operators(points: Array, triangles: IntArray, thickness: float, material: Material) -> _Elements:
    _, _, weights, values, slopes = triangle_rule()
    gradients, determinant = physical_gradients(points[triangles], slopes)
    m, q = determinant.shape
    n = len(points)
    row = np.arange(m * q).reshape(m, q)
    nodes = np.broadcast_to(triangles[:, None, :], (m, q, 6))
    at = np.broadcast_to(row[:, :, None], (m, q, 6))
    shape = np.broadcast_to(values, (m, q, 6))
    N = sparse.csr_matrix((shape.ravel(), (at.ravel(), nodes.ravel())), shape=(m * q, n))
    parts = [(gradients[..., j], 4 * at + 2 * c + j, 2 * nodes + c) for c in (0, 1) for j in (0, 1)]
    data, rows, columns = (np.concatenate([part[k].ravel() for part in parts]) for k in range(3))
    H = sparse.csr_matrix((data, (rows, columns)), shape=(4 * m * q, 2 * n))
    return _Elements(H, N, (thickness * determinant * weights).ravel(), elasticity(material, "stress"))


def _real(shapes: np.ndarray) -> Array:
    """Complex displacements (n, k) as (2 n, k), x and y in turn."""
    return np.stack([shapes.real, shapes.imag], axis=1).reshape(2 * len(shapes), shapes.shape[1])


def _complex(shapes: Array) -> np.ndarray:
    return shapes[0::2] + 1j * shapes[1::2]


def _static_shapes(Z: np.ndarray, interfaces: list[Interface], n: int) -> Array:
    """Unit displacements and turns of the interfaces, nothing else moving; (2 n, 3 interfaces)."""
    out = np.zeros((n, 3 * len(interfaces)), dtype=complex)
    for k, (centre, nodes) in enumerate(interfaces):
        out[nodes, 3 * k], out[nodes, 3 * k + 1] = 1.0, 1j
        out[nodes, 3 * k + 2] = 1j * (Z[nodes] - complex(*centre))
    return _real(out)


def _mean(modes: np.ndarray, interface: Interface, Z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return displacement d of an interface's centre, growth and rotation w = g + i f, by the modes: u = d + w arm."""
    arm = Z[interface.nodes] - complex(*interface.centre)
    basis = np.stack([np.ones(len(arm)), arm], axis=1)
    shift, turn = np.linalg.lstsq(basis, modes[interface.nodes], rcond=None)[0]
    return shift, turn


def _independent(shapes: Array, stiff: sparse.spmatrix, known: Array | None = None, least: float = DEPENDENT) -> Array:
    """Shapes of unit energy that span the given ones, without `known` ones; those of little energy are left out.

    Against `known` the shapes are taken with the energies they have, else with unit energies.
    """
    if known is None:
        shapes = shapes / np.sqrt((shapes * (stiff @ shapes)).sum(axis=0))
    else:
        shapes = shapes - known @ np.linalg.solve(known.T @ (stiff @ known), known.T @ (stiff @ shapes))
    gram = shapes.T @ (stiff @ shapes)
    energy, turn = np.linalg.eigh(0.5 * (gram + gram.T))
    kept = energy > least**2 * energy[-1] if known is not None else energy > least * energy[-1]
    return shapes @ (turn[:, kept] / np.sqrt(energy[kept]))[:, ::-1]


def _principal(shapes: Array, stiff: sparse.spmatrix, mass: sparse.spmatrix) -> tuple[Array, Array]:
    """Angular frequencies (rising) and shapes of unit energy in the space of the shapes."""
    K, M = shapes.T @ (stiff @ shapes), shapes.T @ (mass @ shapes)
    root = np.linalg.inv(np.linalg.cholesky(0.5 * (K + K.T)))
    inverse, turn = np.linalg.eigh(root @ M @ root.T)
    return 1.0 / np.sqrt(inverse[::-1]), shapes @ (root.T @ turn)[:, ::-1]


def _derivatives(made: _Elements, shapes: Array, interfaces: list[Interface], Z: np.ndarray) -> tuple[Array, Array]:
    """Quadratic parts of the forces of all pairs of shapes, with the opposite sign, and of the interfaces' motion.

    An interface that turns by f moves its nodes by (i f - f^2/2) (Z - Z_i). Both (2 n, r (r + 1)/2). The shapes come
    with unit energy, so that the soft ones are large and their pairs count most.
    """
    H = (made.gradient @ shapes).reshape(len(made.weight), 4, -1)
    r = shapes.shape[1]
    modes = _complex(shapes)
    stress = [made.strains(H[:, :, k]) @ made.law for k in range(r)]
    turns = [_mean(modes, interface, Z)[1].imag for interface in interfaces]
    loads, widths = [], []
    for i in range(r):
        for j in range(i, r):
            tension = 0.5 * made.strains(H[:, :, i], H[:, :, j]) @ made.law
            both = made.turned(H[:, :, i], stress[j]) + made.turned(H[:, :, j], stress[i])
            flow = tension[:, [0, 2, 2, 1]] + 0.5 * both
            loads.append(-(made.gradient.T @ (flow * made.weight[:, None]).ravel()))
            width = np.zeros(len(Z), dtype=complex)
            for interface, turn in zip(interfaces, turns, strict=True):
                arm = Z[interface.nodes] - complex(*interface.centre)
                width[interface.nodes] = -0.5 * turn[i] * turn[j] * arm
            widths.append(width)
    return np.array(loads).T, _real(np.array(widths).T)


def _strain_basis(made: _Elements, shapes: Array) -> tuple[Array, Array]:
    """Return columns (L, pairs i <= j of Q) in an orthonormal basis of strain energy, and its stresses at the points.

    Shapes (s, r + r (r + 1)/2) and (q, 3, s).
    """
    H = (made.gradient @ shapes).reshape(len(made.weight), 4, -1)
    r = shapes.shape[1]
    columns = [made.strains(H[:, :, k]) for k in range(r)]
    columns += [made.strains(H[:, :, i], H[:, :, j]) for i in range(r) for j in range(i, r)]
    root = np.linalg.cholesky(made.law).T
    weight = np.sqrt(made.weight)
    weighted = np.stack([(weight[:, None] * (c @ root.T)).ravel() for c in columns], axis=1)
    scale = np.linalg.norm(weighted, axis=0)
    left, sizes, right = np.linalg.svd(weighted / scale, full_matrices=False)
    kept = sizes > ROUNDING * sizes[0]
    e = sizes[kept, None] * right[kept] * scale
    recovery = (left[:, kept].reshape(len(weight), 3, -1).transpose(0, 2, 1) @ root).transpose(0, 2, 1)
    return e, recovery / weight[:, None, None]


def _symmetric(pairs: Array, r: int) -> Array:
    """Return Q from its pairs, shape (s, r, r). With twice the shear, sym(H_i^T H_j) is d2 E / d eta_i d eta_j."""
    out = np.zeros((len(pairs), r, r))
    one, two = np.triu_indices(r)
    out[:, one, two] = out[:, two, one] = pairs
    return out


def _at_nodes(triangles: IntArray, recovery: Array, n: int) -> Array:
    """Stresses at the nodes: the linear field through those at an element's points, means over the elements."""
    r, s, *_ = triangle_rule()
    fit = np.linalg.pinv(np.stack([np.ones_like(r), r, s], axis=1))
    corners = np.array([[0.0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]])
    spread = np.column_stack([np.ones(6), corners]) @ fit  # (6, q)
    m = len(triangles)
    at = np.einsum("aq,mqcs->macs", spread, recovery.reshape(m, len(r), 3, -1))
    out = np.zeros((n, *at.shape[2:]))
    np.add.at(out, triangles, at)
    return out / np.bincount(triangles.ravel(), minlength=n)[:, None, None]
