"""Refinement of a mesh of tetrahedra where it errs: solve, estimate, mark, bisect, until there are enough unknowns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...base.errors import InputError
from ...base.progress import stage
from ...base.typing import Array
from ...fem.bodies.bisection import Bisected, bisected
from ...fem.bodies.meshes import Outer, Tetrahedra
from ...fem.bodies.unfolding import unfolded
from .model import Housing

#: Part of the estimated error whose elements are refined in a round (Doerfler, SIAM J. Numer. Anal. 33, 1996).
BULK = 0.5
#: Modes whose errors are looked at, beside the static fields of the attachments.
MODES = 20


def refined(housing: Housing, unknowns: int, outer: Outer | None = None) -> Housing:
    """The housing on a mesh with up to so many unknowns, finer where the energy of its modes and static fields errs.

    Nodes of attachments and held nodes stay the same, and new nodes between them belong to them. The shape of the body
    is that of the given mesh.

    Parameters
    ----------
    housing
        On quadratic tetrahedra.
    unknowns
        The most that the mesh may have, three a node.
    outer
        As `Housing.from_arrays` takes it.

    Raises
    ------
    InputError
        For other elements, and where the mesh has as many unknowns already.
    """
    mesh = housing.mesh
    if not isinstance(mesh, Tetrahedra) or mesh.cells.shape[1] != 10:
        cure = "export the mesh with midside nodes (10 nodes an element)"
        raise InputError("refine_to_unknowns", unknowns, "refines tetrahedra of the second order only", cure)
    if housing.unknowns >= unknowns:
        cure = "give more, or leave the key out"
        raise InputError("refine_to_unknowns", unknowns, f"the mesh has {housing.unknowns} unknowns already", cure)
    first, rounds, room = housing.unknowns, 0, True
    while room:
        with stage(f"refining the housing's mesh, {housing.unknowns} of {unknowns} unknowns"):
            found, room = _round(housing, mesh, unknowns)
        if found is not None:
            shape = unfolded(found.nodes, found.tets)
            mesh = replace(mesh, nodes=shape.nodes, cells=found.tets)
            added = housing.added_kg + housing.material.density * shape.volume
            housing, rounds = replace(_on(housing, mesh, found, outer), added_kg=added), rounds + 1
            housing = replace(housing, notes=(*housing.notes, *housing.unfolding_notes(shape)))
    times = f"{rounds} round{'s' * (rounds != 1)}"
    note = f"the mesh was refined from {first} to {housing.unknowns} unknowns in {times}, where it erred most"
    return replace(housing, notes=(*housing.notes, note))


def _round(housing: Housing, mesh: Tetrahedra, unknowns: int) -> tuple[Bisected | None, bool]:
    """A finer mesh, and whether all elements that should be refined were: fewer are when they would be too many."""
    nodes = np.arange(len(mesh.nodes))
    members = np.array([np.isin(nodes, chosen) for chosen in housing.rigid_nodes])
    error = _relative_errors(housing, mesh)
    order = np.argsort(error)[::-1]
    count = int(np.searchsorted(np.cumsum(error[order]), BULK * error.sum())) + 1

    def finer(count: int) -> Bisected:
        return bisected(mesh.nodes, mesh.cells, order[:count], members)

    found = finer(count)
    if 3 * len(found.nodes) <= unknowns:
        return found, True
    fits, few, many = None, 0, count
    while many - few > max(1, few // 8):
        middle = (few + many) // 2
        found = finer(middle)
        if 3 * len(found.nodes) <= unknowns:
            fits, few = found, middle
        else:
            many = middle
    return fits, False


def _relative_errors(housing: Housing, mesh: Tetrahedra) -> Array:
    """(m,) part of each element in the error: energies lost over energies, all fields alike."""
    body = housing.reduce(MODES, quasi_static=0, estimate=False)
    fields, eigenvalues = housing.moved_fields(body)
    energies = np.einsum("ik,ij,jk->k", fields, body.stiffness, fields)
    lost = mesh.energy_lost_by_element(housing.material, body.shapes @ fields, eigenvalues, housing.rigid_nodes)
    bears = energies > 1e-9 * energies.max()  # rigid motions do not
    return np.asarray((lost[:, bears] / energies[bears]).sum(axis=1))


def _on(housing: Housing, mesh: Tetrahedra, found: Bisected, outer: Outer | None) -> Housing:
    """The housing on the finer mesh."""
    fixed, *attached = (np.flatnonzero(row) for row in found.members)
    attachments = [replace(one, nodes=nodes) for one, nodes in zip(housing.attachments, attached, strict=True)]
    made = Housing.of_mesh(mesh, (), fixed, material=housing.material, attachments=attachments, outer=outer)
    original = np.concatenate([housing.original, np.full(len(found.nodes) - len(housing.nodes), -1)])
    return replace(made, original=original, notes=housing.notes)
