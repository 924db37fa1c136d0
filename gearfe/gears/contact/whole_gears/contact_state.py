"""Contact of a `ContactProblem` at one displacement: pairs of points, their pressures and forces."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from skfem import DiscreteField

from ....base.typing import Array, ComplexArray, IntArray
from ..flank import Projection, project
from . import forms
from .bodies import edge_points, edge_tangents
from .problem import ContactProblem, Points, nearest_places

#: Factors that make complex numbers x + i y of components (x, y).
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
        Pressure (Pa), and the part of the stretch of surface of each point that faces the mate.
    on : ndarray of int, shape (k,)
        Points under pressure.
    pairs, fields
        scikit-fem basis of these with their closest points, and the fields that `.forms` takes there.
    forces : ndarray
        Nodal forces of the contact (N).
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
    forces: Array

    def tangent(self) -> csr_matrix:
        """Return the derivative of the forces, sparse (N/m).

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


def contact_at(problem: ContactProblem, u: Array, closing: float = 0.0) -> ContactState:
    """Return the contact at the displacement u (m).

    Parameters
    ----------
    problem
        Bodies and the surfaces that face each other.
    u : ndarray
        Displacements of all unknowns (m).
    closing
        Gap (m) below which a point counts as closed: for bodies that contact alone holds, before the first step.
    """
    law, places = problem.law, problem.mesh.doflocs.T + u[problem.unknowns]
    points = problem.points(places)
    slave, surface = problem.at(points)
    displacement, end_weighting = slave.interpolate(u), problem.end_weighting(points)
    where = (slave.global_coordinates() + displacement)[:, :, 0].T
    closest = _closest(problem, places[problem.chain_nodes], where, points.mate, end_weighting)
    normal, tangent = _components(closest.normal), _components(closest.tangent)
    over = (problem.counts[points.mate] - closest.place) / (2 * end_weighting)
    share = np.where(closest.reached, np.clip(0.5 + over, 0.0, 1.0), 0.0)
    stress, rate = problem.constitution.surface_stress(np.asarray(displacement.grad), normal[:, :, None], **surface)
    trial = forms.trial_pressure(closest.gap, stress[:, 0], points.gamma, law.uses_stress)
    active = closest.reached & ((trial > 0) | (closest.gap < closing))
    pressure, on = np.where(active, trial, 0.0), np.flatnonzero(active)
    mate = problem.chain_nodes[closest.edge[on, None] + np.arange(3)]
    mate_xi = closest.shapes[on] @ [0.0, 0.5, 1.0]
    slave_on = edge_points(problem.mesh, points.edges[on], points.xi[on], points.weight[on])
    pairs = slave_on @ edge_points(problem.mesh, mate, mate_xi, points.weight[on])
    at_points = {
        "g": closest.gap,
        "n": normal,
        "a": tangent,
        "kappa": closest.curvature,
        "gamma": points.gamma,
        "p": pressure,
        "active": active.astype(float),
        "share": share,
        "share_rate": np.where((share > 0) & (share < 1), -0.5 / end_weighting, 0.0),
    }
    fields: dict[str, Any] = {name: value[..., on, None] for name, value in at_points.items()}
    fields["X_xi"] = edge_tangents(problem.mesh, mate, mate_xi)[:, :, None]
    fields |= {"stress_rate": rate[:, :, on], "s": float(law.uses_stress)}
    forces = forms.pressure_work.assemble(pairs, **fields)
    return ContactState(u, points, closest, slave, pressure, share, on, pairs, fields, forces)


def _closest(problem: ContactProblem, nodes: Array, where: Array, mate: IntArray, end_weighting: Array) -> Projection:
    """Return closest points of points at `where` on the chains with these nodes."""
    start, slave, master = np.empty(len(where)), where @ PLANE, nodes @ PLANE
    for k, chain in enumerate(np.split(master, np.cumsum(2 * problem.counts + 1)[:-1])):
        start[mate == k] = nearest_places(slave[mate == k], chain)
    return project(slave, master, problem.counts, mate, start, end_weighting)


def _components(vectors: ComplexArray) -> Array:
    """Return the components of complex vectors, shape (2, q)."""
    return np.stack([vectors.real, vectors.imag])
