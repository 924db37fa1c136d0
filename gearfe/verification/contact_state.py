r"""Contact of a `ContactProblem` at one displacement: closest points, pressures, forces and their tangent.

All integrals are sums over the contact points, each a scikit-fem element of its own (`bodies.point_basis`), once on the
slave's side and once at the closest points of the mate.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix, diags

from ..contact.closest import Projection, chains_of, nearest_places, project, unreached
from ..contact.flank import edge_shapes
from .bodies import point_basis
from .problem import ContactProblem, Points

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ContactState:
    """Contact at the displacement u.

    Attributes
    ----------
    u : ndarray
        Displacements of all unknowns (m).
    points, projection
        Contact points and their closest points.
    slave, mate
        scikit-fem bases at both.
    fields
        Numbers at the points by name, as the forms use them.
    pressure : ndarray, shape (q,)
        Pa.
    contact : ndarray
        Nodal forces of the pressures (N); `stress_loads` are those of (theta/gamma) p sigma_n(v).
    multipliers : ndarray, shape (m,)
        Pressures at the vertices (Pa) of a law on a multiplier space; else none.
    """

    u: Array
    points: Points
    projection: Projection
    slave: Any
    mate: Any
    fields: dict[str, Any]
    pressure: Array
    contact: Array
    stress_loads: Array
    multipliers: Array

    @property
    def forces(self) -> Array:
        """Nodal forces of the contact (N)."""
        return self.contact + self.stress_loads


def contact_at(
    problem: ContactProblem,
    u: Array,
    before: ContactState | None = None,
    multipliers: Array | None = None,
    closing: float = 0.0,
) -> ContactState:
    """Closest points, pressures and contact forces at the displacement u; `before` is a state near by."""
    from skfem import DiscreteField, LinearForm, asm
    from skfem.helpers import dot

    nodes = (problem.mesh.doflocs.T + u[problem.unknowns])[problem.chain_nodes]
    fixed_points = problem.quadrature == "points" and before is not None
    if fixed_points:
        assert before is not None
        points, slave, place = before.points, before.slave, before.projection.place
        fields = {name: before.fields[name] for name in CONSTANT}
    else:
        points = problem.points(nodes)
        slave, fields = _slave_side(problem, points)
        place = np.empty(len(points.edge))
    moved = slave.interpolate(u)
    where = (slave.global_coordinates() + moved)[:, :, 0].T
    mate_of = problem.slaves.mate[points.edge]
    if not fixed_points:
        for k in np.unique(mate_of):
            own = mate_of == k
            place[own] = nearest_places(where[own], nodes[problem.chains[k]])
    projection = project(where, chains_of(nodes, problem.counts, mate_of, points.fade), place)
    elements, local, tangent = problem.on_mate(projection)
    mate = point_basis(problem.mesh, elements, local, points.weight)
    share = np.clip(0.5 + (problem.counts[mate_of] - projection.place) / (2 * points.fade), 0.0, 1.0)
    numbers = {
        "g": projection.gap,
        "n": projection.normal.T,
        "a": projection.tangent.T,
        "undeformed_a": tangent,
        "kappa": projection.curvature,
        "m": np.einsum("ni,ni->n", projection.tangent, projection.tangent),
        "share": share,
        "share_slope": np.where((share > 0) & (share < 1), -0.5 / points.fade, 0.0),
    }
    fields = fields | {name: DiscreteField(value[..., None]) for name, value in numbers.items()} | {"state": moved}
    reached = ~unreached(projection.gap)
    if problem.law.name != "exact":
        multipliers = np.zeros(0)
        pressure = -problem.slaves.parameter[points.edge] * projection.gap
        if problem.law.uses_stress:
            pressure = pressure - problem.constitution.normal_stress(moved, fields)[:, 0]
        active = reached & ((pressure > 0) | (projection.gap < closing))
    else:
        hats, _ = hat_functions(problem, points)
        multipliers = np.zeros(hats.shape[1]) if multipliers is None else multipliers
        pressure, active = hats @ multipliers, np.zeros(len(reached), dtype=bool)
    pressure = np.where(reached & (active | (problem.law.name == "exact")), pressure, 0.0)
    fields |= {"p": DiscreteField(pressure[:, None]), "active": DiscreteField(active.astype(float)[:, None])}

    @LinearForm
    def push(v: Any, w: Any) -> Any:
        return w.share * w.p * dot(w.n, jump(v, w.idx[0]))

    stress_loads = np.zeros(len(u))
    if problem.law.theta:
        rate = problem.constitution.normal_stress_rate
        form = LinearForm(lambda v, w: w.share * w.p * w.theta_by_gamma * rate(v, w))
        stress_loads = asm(form, slave, **fields)
    return ContactState(
        u=u,
        points=points,
        projection=projection,
        slave=slave,
        mate=mate,
        fields=fields,
        pressure=pressure,
        contact=asm(push, [slave, mate], **fields),
        stress_loads=stress_loads,
        multipliers=multipliers,
    )


#: Fields that depend on the points alone.
CONSTANT = ("slave_normal", "lam", "mu", "gamma", "theta_by_gamma")


def _slave_side(problem: ContactProblem, points: Points) -> tuple[Any, dict[str, Any]]:
    """Basis at the contact points and the fields that go with them."""
    from skfem import DiscreteField

    slaves, edge = problem.slaves, points.edge
    local = slaves.start[:, edge] + points.xi * (slaves.end - slaves.start)[:, edge]
    _, slopes, _ = edge_shapes(points.xi)
    slope = np.einsum("qa,qai->iq", slopes, problem.mesh.doflocs.T[slaves.nodes[edge]])
    gamma = slaves.parameter[edge]
    numbers = {
        "slave_normal": np.stack([-slope[1], slope[0]]) / np.linalg.norm(slope, axis=0),
        "lam": slaves.lam[edge],
        "mu": slaves.mu[edge],
        "gamma": gamma,
        "theta_by_gamma": problem.law.theta / gamma,
    }
    fields = {name: DiscreteField(value[..., None]) for name, value in numbers.items()}
    return point_basis(problem.mesh, slaves.element[edge], local, points.weight), fields


def jump(v: Any, side: int) -> Any:
    """[v]: v at the slave point (side 0), -v at the closest point of the mate (side 1)."""
    return v if side == 0 else -v


def _tilt(v: Any, side: int, w: Any) -> Any:
    """N = n . dv/dxi on the mate."""
    from skfem.helpers import dot, grad, mul

    return dot(w.n, mul(grad(v), w.undeformed_a)) if side == 1 else 0.0 * w.g


def _slide(v: Any, side: int, w: Any) -> Any:
    """Variation of the closest point's xi."""
    from skfem.helpers import dot

    return (dot(w.a, jump(v, side)) + w.g * _tilt(v, side, w)) / (w.m - w.g * w.kappa)


def _opening(v: Any, side: int, w: Any) -> Any:
    """Variation of the gap."""
    from skfem.helpers import dot

    return dot(w.n, jump(v, side)) - dot(w.n, w.a) * _slide(v, side, w)


def contact_tangent(problem: ContactProblem, state: ContactState) -> csr_matrix:
    """Minus the derivative of the contact forces, sparse (N/m); of a multiplier law that at given multipliers."""
    p, f, w = state.projection, state.fields, state.points.weight
    share, active, pressure = (np.asarray(f[name])[:, 0] for name in ("share", "active", "p"))
    metric = np.asarray(f["m"])[:, 0]
    virtual, opening = contact_rows(state)
    tilt, slide = _rows(state, _tilt), _rows(state, _slide)
    relief = diags(np.asarray(f["gamma"])[:, 0]) @ opening
    tested = virtual
    if problem.law.uses_stress:
        stress = _rows(state, lambda v, _, w: problem.constitution.normal_stress_rate(v, w), one_sided=True)
        relief = relief + stress
        if problem.law.theta:
            tested = virtual + diags(np.asarray(f["theta_by_gamma"])[:, 0]) @ stress
    opposed = diags(w * share * active) @ relief
    cut = w * np.asarray(f["share_slope"])[:, 0] * pressure
    if cut.any():
        opposed = opposed - diags(cut) @ slide
    load = w * share * pressure
    bent = load * (1 - p.gap * p.curvature / metric)
    turning = tilt.T @ (diags(load * p.gap / metric) @ tilt - diags(bent) @ slide)
    turning = turning - slide.T @ (diags(bent) @ tilt + diags(bent * p.curvature) @ slide)
    return tested.T @ opposed - turning


def hat_functions(problem: ContactProblem, points: Points) -> tuple[csr_matrix, Array]:
    """Values of the multiplier space's functions at the points, shape (q, m), and the law's parameter of each (Pa/m).

    Hats on half edges, one for each node (`gearfe.verification.laws`). A node that two couples share counts once for
    each.
    """
    slaves = problem.slaves
    keys = slaves.mate[:, None] * len(problem.unknowns) + slaves.nodes
    _, number = np.unique(keys, return_inverse=True)
    number = number.reshape(keys.shape)
    late = (points.xi > 0.5).astype(np.int64)
    along = 2 * points.xi - late
    columns = number[points.edge[:, None], np.stack([late, late + 1], axis=1)]
    rows = np.repeat(np.arange(len(late)), 2)
    shape = (len(late), int(number.max()) + 1)
    parameter = np.zeros(shape[1])
    np.maximum.at(parameter, number, slaves.parameter[:, None])
    values = np.stack([1 - along, along], axis=1)
    return coo_matrix((values.ravel(), (rows, columns.ravel())), shape=shape).tocsr(), parameter


def contact_rows(state: ContactState) -> tuple[csr_matrix, csr_matrix]:
    """n . [v] and the gap's variation at every point, shape (q, unknowns)."""
    from skfem.helpers import dot

    virtual = _rows(state, lambda v, side, w: dot(w.n, jump(v, side)))
    return virtual, _rows(state, _opening)


def _rows(state: ContactState, value: Any, *, one_sided: bool = False) -> csr_matrix:
    """A quantity linear in v at every point: element vectors of one-point elements, divided by their areas.

    `value(v, side, w)` is the integrand; with `one_sided` it lives on the slave's side only.
    """
    from skfem import LinearForm

    total: Any = 0
    for side, basis in ((0, state.slave), (1, state.mate)):
        if side == 1 and one_sided:
            continue
        local = LinearForm(lambda v, w, side=side: value(v, side, w)).elemental(basis, **state.fields)
        dofs = basis.element_dofs  # (functions, points); the element vectors are stored function by function
        entries = local.data.reshape(dofs.shape) / state.points.weight
        points = np.broadcast_to(np.arange(dofs.shape[1]), dofs.shape)
        shape = (dofs.shape[1], len(state.u))
        total = total + coo_matrix((entries.ravel(), (points.ravel(), dofs.ravel())), shape=shape).tocsr()
    return total
