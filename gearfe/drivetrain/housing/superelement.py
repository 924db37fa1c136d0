r"""A housing from the matrices of another program: stiffness and mass over attachments and internal coordinates.

With the attachments' six coordinates :math:`q_b` each and whatever the program put inside, :math:`q_i`, the modes with
the attachments held, :math:`K_{ii}\Phi = M_{ii}\Phi\Lambda`, and the constraint modes :math:`\Psi = -K_{ii}^{-1}K_{ib}`
change the coordinates to those of `gearfe.ModalBody`. All are kept, so frequencies and response stay those of the
matrices.

The files are of any format that `output.exchange.matrix_file` reads.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from ...base.errors import InputError
from ...base.tables.housing import FORCES, UNITS, AttachmentTable, SuperelementTable
from ...base.typing import Array, IntArray
from ...fem.reduction.modal_body import ModalBody
from ...output.exchange.matrix_entries import shown
from ...output.exchange.matrix_file import Matrix, read_matrix
from .attachments import rigid_motions

#: Parts of the largest entry up to which matrices are symmetric; energy, against the largest, that is none; masses,
#: relative to each other, that are the same in all directions.
SYMMETRIC, NO_ENERGY, SAME_MASS = 1e-6, 1e-7, 1e-3
#: Part of the largest square of a period below which a coordinate has no mass.
MASSLESS = 1e-12
#: Bounds on the root of rotational over translational stiffness, a length, in parts of the span of the attachments; a
#: unit of mm instead of m makes a thousand.
LENGTHS = (1 / 300, 100.0)
#: Numbers that no stiffness or mass has in any unit.
TINY, HUGE = 1e-30, 1e30
#: What rounding to the four digits of short fields may add to the bound on an entry by the diagonal.
ROUNDED = 0.01
#: Eigenvalue of a matrix of unit diagonal that is singular; highest frequency of no housing (Hz).
NO_MASS, LEAST_HZ = 1e-13, 0.01
NO_ESTIMATE = "matrices of another program: the error of their mesh and reduction is unknown"
MOTIONS = ("x", "y", "z", "rotation about x", "rotation about y", "rotation about z")


def superelement(table: SuperelementTable, folder: str | Path) -> ModalBody:
    """The body of a [housing.superelement] table; files are looked for in `folder`.

    Raises
    ------
    InputError
        For files that cannot be read, matrices that are none of an elastic body, and points that do not fit them.
    """
    field = "housing.superelement"
    K, M = (
        _read(Path(folder) / getattr(table, name), f"{field}.{name}", initial)
        for name, initial in (("stiffness", "K"), ("mass", "M"))
    )
    M = _with_rows_of(K, M)
    if K.values.shape != M.values.shape or K.labels != M.labels:
        problem = f"has {len(M.values)} coordinates, the stiffness {len(K.values)}"
        if len(K.values) == len(M.values):
            problem = "has other nodes and degrees of freedom than the stiffness"
        raise InputError(f"{field}.mass", table.mass, problem, "write both of the same superelement")
    if not K.values.any():
        raise InputError(f"{field}.stiffness", table.stiffness, "has only zeros", "name the file of the stiffness")
    for matrix, key, name in ((K, "stiffness", table.stiffness), (M, "mass", table.mass)):
        _check_symmetric(matrix.values, f"{field}.{key}", name)
        _check_entries(matrix, f"{field}.{key}", name)
    rows = [_rows(one, i, K, field) for i, one in enumerate(table.attachments)]
    bound = np.concatenate(rows)
    twice = np.flatnonzero(np.bincount(bound) > 1)
    if len(twice):
        problem = f"row {int(twice[0]) + 1} belongs to two attachments, or is twice in one"
        raise InputError(f"{field}.attachments", None, problem, "each coordinate is one row")
    order = np.concatenate([bound, np.setdiff1d(np.arange(len(K.values)), bound)])
    # one energy in J: lengths in m, forces in N, angles in rad; internal coordinates may have any unit
    force, length = FORCES[table.unit], UNITS[table.unit]
    scale = np.concatenate([np.tile([1 / length] * 3 + [1.0] * 3, len(rows)), np.ones(len(K.values) - len(bound))])
    k, m = (
        force * length * np.outer(scale, scale) * 0.5 * (one.values + one.values.T)[np.ix_(order, order)]
        for one in (K, M)
    )
    points = 1e-3 * np.array([one.point_mm for one in table.attachments])
    return _body(k, m, points, table, field)


def _read(path: Path, field: str, initial: str) -> Matrix:
    """A matrix of a file, if its numbers can be those of an elastic body."""
    matrix = read_matrix(path, field, initial)
    largest = np.abs(matrix.values).max()
    if largest > 0.0 and not TINY < largest < HUGE:
        problem = f"has {largest:.3g} as its largest number, which no elastic body has in any unit"
        raise InputError(field, path.name, problem, "the file may be damaged: write it again")
    return matrix


def _with_rows_of(stiffness: Matrix, mass: Matrix) -> Matrix:
    """The mass with zeros where its file leaves out freedoms that have none."""
    if not mass.labels or not set(mass.labels) < set(stiffness.labels):
        return mass
    place = [stiffness.labels.index(label) for label in mass.labels]
    values = np.zeros_like(stiffness.values)
    values[np.ix_(place, place)] = mass.values
    return Matrix(values, stiffness.labels)


def _check_symmetric(values: Array, field: str, name: str) -> None:
    off = np.abs(values - values.T)
    i, j = np.unravel_index(int(off.argmax()), off.shape)
    if off[i, j] > SYMMETRIC * np.abs(values).max():
        problem = (
            f"is not symmetric: entry ({i + 1}, {j + 1}) is {values[i, j]:.6g}, ({j + 1}, {i + 1}) {values[j, i]:.6g}"
        )
        raise InputError(field, name, problem, "bring stiffness and mass of an elastic body without damping or spin")


def _check_entries(matrix: Matrix, field: str, name: str) -> None:
    """Refuse entries that no positive matrix has, as lost and damaged rows leave them.

    A positive semidefinite matrix has no negative number on its diagonal, and ``a_ij**2 <= a_ii * a_jj`` elsewhere.
    """
    values, diagonal = matrix.values, np.diag(matrix.values)

    def named(i: int) -> str:
        return f"{i + 1} ({shown(matrix.labels[i])})" if matrix.labels else str(i + 1)

    cure = "a row or a number of the file is lost or damaged, or its sign is wrong: write it again"
    i = int(diagonal.argmin())
    if diagonal[i] < 0.0:
        raise InputError(field, name, f"is not positive: row {named(i)} has {diagonal[i]:.6g} on its diagonal", cure)
    root = np.sqrt(diagonal)
    slack = SYMMETRIC * root.max() * np.minimum.outer(root, root)
    excess = np.abs(values) - (1.0 + ROUNDED) * np.outer(root, root) - slack
    np.fill_diagonal(excess, 0.0)
    i, j = (int(k) for k in np.unravel_index(int(excess.argmax()), excess.shape))
    if excess[i, j] > 0.0:
        problem = (
            f"is not positive: the entry of rows {named(i)} and {named(j)} is {values[i, j]:.6g}, larger than the root "
            f"of the product of {diagonal[i]:.6g} and {diagonal[j]:.6g} on the diagonal"
        )
        raise InputError(field, name, problem, cure)


def _rows(one: AttachmentTable, i: int, matrix: Matrix, field: str) -> IntArray:
    """Rows of an attachment's six coordinates, from 0."""
    where, count = f"{field}.attachments[{i}]", len(matrix.values)
    if one.node is not None:
        if not matrix.labels:
            raise InputError(
                f"{where}.node", one.node, "cannot be used: Matrix Market files name no nodes", "give rows"
            )
        try:
            return np.array([matrix.labels.index((one.node, freedom)) for freedom in range(1, 7)])
        except ValueError:
            known = ", ".join(str(node) for node in sorted({node for node, _ in matrix.labels})[:20])
            problem = f"does not have its six degrees of freedom 1 to 6 in the matrices, whose nodes are {known}"
            raise InputError(
                f"{where}.node", one.node, problem, "retain all six degrees of freedom of the node"
            ) from None
    rows = np.array(one.rows if one.rows is not None else range(6 * i + 1, 6 * i + 7)) - 1
    if rows.min() < 0 or rows.max() >= count:
        given = list(one.rows) if one.rows is not None else None
        problem = f"must be rows 1 to {count} of the matrices: {[int(row) + 1 for row in rows]}"
        raise InputError(f"{where}.rows", given, problem, "six rows an attachment: u_x, u_y, u_z, and rotations")
    return rows


def rigid_shapes(points: Array) -> Array:
    """Coordinates of the attachments in unit translations and rotations about the origin, shape (6 a, 6)."""
    turned = np.tile(np.eye(3, 6, 3), (len(points), 1, 1))
    return np.concatenate([rigid_motions(points).reshape(-1, 3, 6), turned], axis=1).reshape(-1, 6)


def _body(k: Array, m: Array, points: Array, table: SuperelementTable, field: str) -> ModalBody:
    from scipy.linalg import eigh

    b, size = 6 * len(points), len(k)
    stiff, heavy = k[b:, b:], m[b:, b:]
    root = np.sqrt(np.diag(stiff))
    if size > b and not ((root > 0.0).all() and np.linalg.eigvalsh(stiff / np.outer(root, root))[0] > NO_MASS):
        problem = "is not positive definite with the attachments held: a part inside can move freely"
        raise InputError(f"{field}.stiffness", table.stiffness, problem, "are these the attachments' rows?")
    periods, modes = eigh(heavy, stiff) if size > b else (np.zeros(0), np.zeros((0, 0)))
    if len(periods) and periods[0] < -SYMMETRIC * periods[-1]:
        raise InputError(f"{field}.mass", table.mass, "is not positive: a motion has negative energy", "check its sign")
    kept = np.flatnonzero(periods > MASSLESS * periods.max(initial=0.0))[::-1]
    eigenvalues, modes = 1.0 / periods[kept], modes[:, kept] / np.sqrt(periods[kept])
    static = -np.linalg.solve(stiff, k[b:, :b]) if size > b else np.zeros((0, b))
    change = np.block([[np.eye(b), np.zeros((b, len(kept)))], [static, modes]])
    K, M = (0.5 * (made + made.T) for made in (change.T @ one @ change for one in (k, m)))
    K[:b, b:], K[b:, :b], K[b:, b:], M[b:, b:] = 0.0, 0.0, np.diag(eigenvalues), np.eye(len(kept))
    rigid = np.vstack([rigid_shapes(points), np.zeros((len(kept), 6))])
    free = _is_free(K[:b, :b], rigid[:b], points, table, field)
    momentum, whole = np.full((6, len(K)), math.nan), np.full((6, 6), math.nan)
    if free:
        momentum, whole = rigid.T @ M, rigid.T @ M @ rigid
        masses = np.diag(whole)[:3]
        if not np.ptp(masses) <= SAME_MASS * masses.max():
            listed = ", ".join(f"{mass:.6g}" for mass in masses)
            problem = f"differs by direction: {listed} kg along x, y, z"
            raise InputError(f"{field}.mass", table.mass, problem, "check the order of rows and the unit")
    _check_mass(K, M, table, field)
    a = len(points)
    shapes = np.zeros((3 * a, len(K)))
    for i in range(a):
        shapes[3 * i : 3 * i + 3, 6 * i : 6 * i + 3] = np.eye(3)
    axes = np.array([one.direction for one in table.attachments], dtype=float)
    return ModalBody(
        mass=M,
        damping=np.zeros_like(M),
        stiffness=K,
        attachment_names=tuple(one.name or str(i + 1) for i, one in enumerate(table.attachments)),
        attachment_points=points,
        attachment_axes=axes / np.linalg.norm(axes, axis=1, keepdims=True),
        internal_hz=np.sqrt(eigenvalues) / (2 * math.pi),
        modes=len(kept),
        nodes=points,
        elements=np.zeros((0, 4), dtype=np.int64),
        shapes=shapes,
        faces=np.zeros((0, 3), dtype=np.int64),
        normals=np.zeros((a, 3)),
        radiation=np.zeros_like(M),
        momentum=momentum,
        rigid_mass=whole,
        truncation=np.zeros((b, b)),
        corrections=0,
        next_hz=0.0,  # what was left out is unknown
        softening=np.zeros_like(M),
        held=not free,
        notes=(NO_ESTIMATE,),
    )


def _is_free(stiffness: Array, rigid: Array, points: Array, table: SuperelementTable, field: str) -> bool:
    """Whether the body has its six rigid motions; False where it is held.

    Raises
    ------
    InputError
        Where it is neither, or the points and units do not fit the matrices.
    """
    size = float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0
    scale = np.tile([1.0] * 3 + [1 / size] * 3, len(points))
    values = np.linalg.eigvalsh(stiffness * np.outer(scale, scale))
    if values[0] < -NO_ENERGY * values[-1]:
        problem = "is not positive: a motion of the attachments gives energy"
        raise InputError(f"{field}.stiffness", table.stiffness, problem, "check its sign")
    idle = int((values < NO_ENERGY * values[-1]).sum())
    if idle == 0:
        _check_length(stiffness, points, table, field)
        return False
    energy = np.einsum("ik,ij,jk->k", rigid, stiffness, rigid)
    costs = energy * np.array([1.0] * 3 + [1 / size**2] * 3) > NO_ENERGY * values[-1] * len(points)
    if idle == 6 and not costs.any():
        return True
    if idle == 6:
        listed = ", ".join(name for name, one in zip(MOTIONS, costs, strict=True) if one)
        problem = f"the matrices have six motions without energy, but these cost some: {listed}"
        cure = "check point_mm, the unit, and the order of rows (u_x, u_y, u_z, rotations in rad about x, y, z)"
        raise InputError(f"{field}.attachments", None, problem, cure)
    problem = f"has {idle} motions of the attachments without energy: a free body has 6, a held one none"
    raise InputError(
        f"{field}.stiffness",
        table.stiffness,
        problem,
        "check the unit, and that all six coordinates of each attachment are there, in the order given by rows",
    )


def _check_mass(stiffness: Array, mass: Array, table: SuperelementTable, field: str) -> None:
    from scipy.linalg import eigh

    cure = "are stiffness and mass exchanged, is all mass there?"
    diagonal = np.diag(mass)
    own = np.linalg.eigvalsh(mass / np.sqrt(np.outer(diagonal, diagonal))) if (diagonal > 0.0).all() else np.zeros(1)
    if not own[0] > NO_MASS:
        problem = "is not positive: an attachment can move without mass, or gives energy"
        raise InputError(f"{field}.mass", table.mass, problem, cure)
    highest = math.sqrt(max(float(eigh(stiffness, mass, eigvals_only=True)[-1]), 0.0)) / (2 * math.pi)
    if highest < LEAST_HZ:
        problem = f"gives no natural frequency above {highest:.2g} Hz with this stiffness"
        raise InputError(f"{field}.mass", table.mass, problem, cure)


def _check_length(stiffness: Array, points: Array, table: SuperelementTable, field: str) -> None:
    """Refuse a held body whose unit cannot be: it has no rigid motion by which points and matrices were compared."""
    span = float(np.linalg.norm(np.ptp(points, axis=0)))
    diagonal = np.diag(stiffness).reshape(-1, 6)
    length = math.sqrt(diagonal[:, 3:].sum() / diagonal[:, :3].sum())
    if span and not LENGTHS[0] * span < length < LENGTHS[1] * span:
        problem = (
            f"rotational by translational stiffness of the attachments is that of a length of {1e3 * length:.3g} mm, "
            f"their points lie within {1e3 * span:.3g} mm"
        )
        raise InputError(f"{field}.unit", table.unit, problem, f"one of {', '.join(FORCES)}: that of the matrices")
