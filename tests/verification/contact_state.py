"""Contact of a `ContactProblem` at one displacement: pairs of points, their pressures and forces."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from skfem import DiscreteField

from gearfe.contact.flank import Projection, project
from gearfe.typing import Array, ComplexArray, IntArray

from . import forms
from .bodies import edge_points, edge_tangents
from .laws import theta_of
from .problem import ContactProblem, Points, nearest_places

PLANE = np.array([1.0, 1.0j])


@dataclass(frozen=True)
class ContactState:
    """Contact at the displacement u.

    Attributes
    ----------
    u : ndarray
        Displacements of all unknowns (m).
    points, projection
        Contact points and their closest points.
    slave
        scikit-fem basis at the contact points.
    pressure, share : ndarray, shape (q,)
        Pressure (Pa), and the part of each point's stretch of surface that faces the mate.
    on : ndarray of int, shape (k,)
        Points that act: all that face the mate with the exact law, else those under pressure.
    pairs, fields
        scikit-fem basis of these with their closest points, and what `tests.verification.forms` takes there.
    contact, stress_loads : ndarray
        Nodal forces (N) of p n . [v] and of theta/gamma p sigma_n(v).
    multipliers : ndarray, shape (m,)
        lambda of the exact law (Pa); else none.
    """

    u: Array
    points: Points
    projection: Projection
    slave: Any
    pressure: Array
    share: Array
    on: IntArray
    pairs: Any
    fields: dict[str, Any]
    contact: Array
    stress_loads: Array
    multipliers: Array

    @property
    def forces(self) -> Array:
        """Nodal forces of the contact (N)."""
        return self.contact + self.stress_loads

    def tangent(self) -> csr_matrix:
        """Their derivative, sparse (N/m); with the exact law at given multipliers.

        The form takes all 24 x 24 functions of the pairs in one call; `BilinearForm.assemble` would call it for each.
        """
        basis, dofs = self.pairs.basis, self.pairs.element_dofs
        values = [np.stack([both[k] for both in basis], axis=1) for k in (0, 1)]
        grads = [np.stack([both[k].grad for both in basis], axis=2) for k in (0, 1)]
        trial = (DiscreteField(v[:, :, None], g[:, :, :, None]) for v, g in zip(values, grads, strict=True))
        test = (DiscreteField(v[:, None], g[:, :, None]) for v, g in zip(values, grads, strict=True))
        density = forms.contact_tangent.form(*trial, *test, SimpleNamespace(**self.fields))
        entries = np.sum(density * self.pairs.dx, axis=-1)
        columns, rows = np.broadcast_arrays(dofs[:, None], dofs[None])
        return coo_matrix((entries.ravel(), (rows.ravel(), columns.ravel())), (len(self.u), len(self.u))).tocsr()

    def rows(self, form: Any) -> csr_matrix:
        """A linear form point by point, shape (q, unknowns)."""
        dofs = self.pairs.element_dofs  # (functions, points), as the element vectors are stored
        entries = form.elemental(self.pairs, **self.fields).data
        points = np.broadcast_to(self.on, dofs.shape)
        return coo_matrix((entries, (points.ravel(), dofs.ravel())), (len(self.pressure), len(self.u))).tocsr()


def contact_at(
    problem: ContactProblem, u: Array, multipliers: Array | None = None, closing: float = 0.0
) -> ContactState:
    """Contact at the displacement u.

    Parameters
    ----------
    multipliers
        Those of the exact law; nothing without them.
    closing
        Gap (m) below which a point counts as closed.
    """
    law, places = problem.law, problem.mesh.doflocs.T + u[problem.unknowns]
    points = problem.points(places)
    slave, surface = problem.at(points)
    moved, end_weighting = slave.interpolate(u), problem.end_weighting(points)
    where = (slave.global_coordinates() + moved)[:, :, 0].T
    found = _closest(problem, places[problem.chain_nodes], where, points.mate, end_weighting)
    reached, normal, tangent = found.reached, _plane(found.normal), _plane(found.tangent)
    over = (problem.counts[points.mate] - found.place) / (2 * end_weighting)
    share = np.where(reached, np.clip(0.5 + over, 0.0, 1.0), 0.0)
    stress, rate = problem.constitution.surface_stress(np.asarray(moved.grad), normal[:, :, None], **surface)
    if law.name == "exact":
        basis, _ = multiplier_basis(points)
        multipliers = np.zeros(basis.shape[1]) if multipliers is None else multipliers
        pressure, active = np.where(reached, basis @ multipliers, 0.0), np.zeros(len(where), dtype=bool)
        on = np.flatnonzero(reached)
    else:
        multipliers = np.zeros(0)
        trial = forms.trial_pressure(found.gap, stress[:, 0], points.gamma, law.uses_stress)
        active = reached & ((trial > 0) | (found.gap < closing))
        pressure, on = np.where(active, trial, 0.0), np.flatnonzero(active)
    mate = problem.chain_nodes[found.edge[on, None] + np.arange(3)]
    mate_xi = found.shapes[on] @ [0.0, 0.5, 1.0]
    own = edge_points(problem.mesh, points.edges[on], points.xi[on], points.weight[on])
    pairs = own @ edge_points(problem.mesh, mate, mate_xi, points.weight[on])
    at_points = {
        "g": found.gap,
        "n": normal,
        "a": tangent,
        "kappa": found.curvature,
        "gamma": points.gamma,
        "p": pressure,
        "active": active.astype(float),
        "share": share,
        "share_rate": np.where((share > 0) & (share < 1), -0.5 / end_weighting, 0.0),
    }
    fields: dict[str, Any] = {name: value[..., on, None] for name, value in at_points.items()}
    fields["X_xi"] = edge_tangents(problem.mesh, mate, mate_xi)[:, :, None]
    fields |= {"stress_rate": rate[:, :, on], "s": float(law.uses_stress), "theta": float(theta_of(law))}
    contact, stress_loads = (f.assemble(pairs, **fields) for f in (forms.pressure_work, forms.stress_work))
    return ContactState(u, points, found, slave, pressure, share, on, pairs, fields, contact, stress_loads, multipliers)


def _closest(problem: ContactProblem, nodes: Array, where: Array, mate: IntArray, end_weighting: Array) -> Projection:
    """Closest points of points at `where` on the chains with these nodes."""
    start, slave, master = np.empty(len(where)), where @ PLANE, nodes @ PLANE
    for k, chain in enumerate(np.split(master, np.cumsum(2 * problem.counts + 1)[:-1])):
        start[mate == k] = nearest_places(slave[mate == k], chain)
    return project(slave, master, problem.counts, mate, start, end_weighting)


def _plane(vectors: ComplexArray) -> Array:
    """Components, shape (2, q)."""
    return np.stack([vectors.real, vectors.imag])


def multiplier_basis(points: Points) -> tuple[csr_matrix, Array]:
    """Values of the multiplier functions at the points, shape (q, m), and the law's parameter of each (Pa/m).

    A node that two couples share counts once for each.
    """
    keys = points.mate[:, None] * (points.edges.max() + 1) + points.edges
    kinds, number = np.unique(keys, return_inverse=True)
    number = number.reshape(keys.shape)
    late = (points.xi > 0.5).astype(np.int64)[:, None]
    columns = np.take_along_axis(number, late + np.arange(2), axis=1)
    along = 2 * points.xi - late[:, 0]
    values, rows = np.stack([1 - along, along], axis=1), np.repeat(np.arange(len(along)), 2)
    parameter = np.zeros(len(kinds))
    np.maximum.at(parameter, number, points.gamma[:, None])
    return coo_matrix((values.ravel(), (rows, columns.ravel())), (len(along), len(kinds))).tocsr(), parameter
