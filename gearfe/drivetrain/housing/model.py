"""A housing: mesh, material, attachments and held nodes; from a job file or from anyone's arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...base.errors import InputError
from ...base.progress import stage
from ...base.shown import Facts, percent
from ...base.tables.housing import POISSON_RATIOS
from ...base.typing import Array, IntArray
from ...fem.bodies.mesh_checks import checked_mesh
from ...fem.bodies.meshes import Outer, Prisms, Tetrahedra
from ...fem.bodies.surface import Surface, nodal_normals
from ...fem.bodies.unfolding import Unfolded, unfolded
from ...fem.plane import Material
from ...fem.reduction.craig_bampton import Partition, partition, reduce_model
from ...fem.reduction.modal_body import ModalBody
from ...fem.solid import SolidMatrices
from .attachments import (
    Attachment,
    Bore,
    Plane,
    bore_attachment,
    check_attachments,
    interface_matrix,
    plane_nodes,
    rigid_motions,
)

#: Said whenever linear tetrahedra are chosen.
LINEAR_NOTE = (
    "linear tetrahedra are far too stiff: natural frequencies 15-45 % too high at usual sizes; take second-order ones"
)
FREE_NOTE = "nothing is fixed: the housing is free and has six rigid-body modes"
STEEL = Material()
#: Largest part of the mass (-) by which unfolding may change it: beyond, frequencies are those of another body.
MOST_ADDED = 0.05
#: Most modes that are sought by frequency, as `modes` allows.
MOST_MODES = 2000
#: Part of the largest energy below which a field is contained in the others.
DEPENDENT = 1e-10
#: Part of the square of the highest frequency below which a mode is a rigid motion.
ROUNDING = 1e-6


@dataclass(frozen=True, eq=False, repr=False)
class Housing(Facts):
    """An elastic body with rigid attachments.

    Attributes
    ----------
    mesh
        Nodes and elements.
    attachments
        Rigid attachments; their order is that of the coordinates of the reduced body.
    fixed : (k,)
        Numbers of the held nodes; none for a free body.
    material
        Of the whole body.
    surface
        Outer surface: what radiates sound.
    original : (n,)
        Number that each node had in the arrays that were given.
    notes
        Remarks for the user.
    added_kg
        Mass that was added by moving nodes of folded elements (kg); zero where the body has the shape of its mesh.
    """

    mesh: Tetrahedra | Prisms
    attachments: tuple[Attachment, ...]
    fixed: IntArray
    material: Material
    surface: Surface
    original: IntArray
    notes: tuple[str, ...] = ()
    added_kg: float = 0.0

    def facts(self) -> dict[str, str]:
        """Size, attachments, mass."""
        return {
            "unknowns": str(self.unknowns),
            "attachments": ", ".join(one.name for one in self.attachments) or "none",
            "held nodes": str(len(self.fixed)),
            "mass": f"{self.mass_kg:.4g} kg",
        }

    @classmethod
    def from_arrays(
        cls,
        nodes: Any,
        tets: Any,
        bores: Sequence[Bore | Sequence[Any]] = (),
        fixed: Any = None,
        *,
        material: Material = STEEL,
        attachments: Sequence[Attachment] = (),
        outer: Outer | None = None,
    ) -> Housing:
        """Housing from a mesh of any origin (gmsh, meshio, arrays).

        Parameters
        ----------
        nodes : (n, 3)
            Coordinates (m).
        tets : (m, 4) or (m, 10)
            Node numbers from 0; midside nodes in VTK's or gmsh's order.
        bores
            `Bore` objects or tuples ``(axis point, axis direction, radius, (begin, end) along the axis from that
            point)`` in metres. Each becomes an attachment; its nodes are those at or inside the radius.
        fixed
            Held nodes: a `Plane`, a pair (point, normal), node numbers, or a mask of n flags; ``None`` for a free body.
        material
            Steel by default.
        attachments
            Further attachments with node numbers of their own, after the bores.
        outer
            Selects the outer surface, which radiates sound and is shown, from the surface without bores and held faces.
            It is a function of the faces' centres (f, 3) (m) that returns f flags. By default all of it.

        Raises
        ------
        InputError
            Names what is wrong with the mesh, a bore, an attachment or the held nodes.
        """
        mesh = checked_mesh(nodes, tets)
        shape = unfolded(mesh.nodes, mesh.tets)
        new_number = np.full(len(np.asarray(nodes)), -1)
        new_number[mesh.original] = np.arange(len(mesh.original))
        made = [
            replace(given, nodes=_renumbered(f"attachment {given.name!r}", given.nodes, new_number))
            for given in attachments
        ]
        housing = cls.of_mesh(
            Tetrahedra(shape.nodes, mesh.tets),
            bores,
            _fixed_nodes(fixed, shape.nodes, new_number),
            material=material,
            attachments=made,
            outer=outer,
        )
        linear = [LINEAR_NOTE] if mesh.tets.shape[1] == 4 else []
        notes = (*mesh.notes, *housing.unfolding_notes(shape), *linear, *housing.notes)
        return replace(housing, original=mesh.original, notes=notes, added_kg=material.density * shape.volume)

    @classmethod
    def of_mesh(
        cls,
        mesh: Tetrahedra | Prisms,
        bores: Sequence[Bore | Sequence[Any]],
        fixed: IntArray,
        *,
        material: Material = STEEL,
        attachments: Sequence[Attachment] = (),
        outer: Outer | None = None,
    ) -> Housing:
        """Return a housing from a mesh that is in order, see `from_arrays`.

        Parameters
        ----------
        mesh : Tetrahedra or Prisms
            The mesh (m).
        bores : sequence
            Bores, or what `Bore` takes.
        fixed : ndarray of int
            Numbers of the nodes that are held.
        material : Material
            Elasticity and density.
        attachments : sequence of Attachment
            Further interfaces.
        outer : Outer, optional
            Which part of the surface is outside and radiates.

        Raises
        ------
        InputError
            For a Poisson ratio beyond the elements' range, and attachments that do not fit the mesh.
        """
        low, high = POISSON_RATIOS
        if not low <= material.poisson_ratio <= high:
            problem = f"must be {low:g} to {high:g}: beyond, elements lock, and the mesh's error estimate does not hold"
            raise InputError("material.poisson_ratio", material.poisson_ratio, problem, f"give {high:g} at most")
        made: list[Attachment] = []
        notes: list[str] = []
        for number, bore in enumerate(bores, start=1):
            attachment, remarks = bore_attachment(bore, number, mesh.nodes, mesh.corners)
            made.append(attachment)
            notes += remarks
        made += attachments
        check_attachments(made, fixed, mesh.nodes)
        return cls(
            mesh=mesh,
            attachments=tuple(made),
            fixed=fixed,
            material=material,
            surface=mesh.surface([fixed, *(a.nodes for a in made)], outer),
            original=np.arange(len(mesh.nodes)),
            notes=(*notes, *([FREE_NOTE] if len(fixed) == 0 else [])),
        )

    @property
    def nodes(self) -> Array:
        """(n, 3) coordinates (m)."""
        return self.mesh.nodes

    def matrices(self) -> SolidMatrices:
        """Nodal stiffness and mass, assembled at each call: they are large and used briefly."""
        with stage("assembling"):
            return self.mesh.assemble(self.material)

    @cached_property
    def internal(self) -> IntArray:
        """Rows that are neither held nor in an attachment, ``3 node + axis``."""
        free = np.ones(len(self.nodes), dtype=bool)
        free[self.fixed] = False
        for attachment in self.attachments:
            free[attachment.nodes] = False
        return np.asarray((3 * np.flatnonzero(free)[:, None] + np.arange(3)).ravel())

    @property
    def unknowns(self) -> int:
        """Three for each node."""
        return 3 * len(self.nodes)

    @property
    def mass_kg(self) -> float:
        """Mass (kg)."""
        return float(self.matrices().nodal_mass.sum())

    def unfolding_notes(self, shape: Unfolded) -> tuple[str, ...]:
        """Return what was moved to unfold elements, and the mass that it adds.

        Raises
        ------
        InputError
            Where the mass changes by more than `MOST_ADDED`: that is another body.
        """
        if not shape.folded:
            return ()
        note = f"curved edges folded {shape.folded} elements; inner nodes beside them were moved"
        if not shape.moved:
            return (f"{note}; the surface and the mass stay what they are",)
        added, mass = self.material.density * shape.volume, self.mass_kg
        share = added / (mass - added)
        if abs(share) > MOST_ADDED:
            problem = (
                f"curved edges folded {shape.folded} elements, and straightening them changes the mass by "
                f"{'+' if share > 0.0 else ''}{percent(share)}, more than {100.0 * MOST_ADDED:g} %"
            )
            cure = (
                "mesh the curved walls with smaller elements, let the mesher keep them from folding (gmsh: "
                "Mesh.HighOrderOptimize), or with straight edges (gmsh: Mesh.SecondOrderLinear)"
            )
            raise InputError("housing.mesh", None, problem, cure)
        return (
            f"{note}, and {shape.moved} midside nodes of the surface by up to {1e3 * shape.farthest:.2g} mm: the mass "
            f"changes by {added:+.2g} kg ({percent(share)}), which no error estimate covers",
        )

    def reduce(
        self,
        modes: int | None = None,
        *,
        below_hz: float = 10_000.0,
        least_modes: int = 40,
        quasi_static: int = 1,
        estimate: bool = True,
    ) -> ModalBody:
        """Reduced body: constraint modes, modes with the attachments held, quasi-static corrections.

        Parameters
        ----------
        modes
            Their number; ``None`` for all below `below_hz`, but no fewer than `least_modes`.
        below_hz
            Highest frequency of the modes (Hz). Twice the highest frequency of interest is a good choice.
        least_modes
            See `modes`.
        quasi_static
            Levels of correction vectors; 0 for none.
        estimate
            Whether the body carries an estimate of the mesh's error (`ModalBody.softening`).
        """
        matrices, motions = self.matrices(), rigid_motions(self.nodes)
        if modes is None:
            self._check_frequency(below_hz, float(matrices.nodal_mass.sum()))
        parts = self.partition(matrices)
        momenta = (matrices.nodal_mass @ motions.reshape(len(self.nodes), -1)).reshape(motions.shape)
        del matrices  # a quarter of the peak of memory
        found = reduce_model(
            parts,
            count=modes,
            below_hz=below_hz if modes is None else np.inf,
            at_least=least_modes,
            at_most=MOST_MODES,
            corrections=quasi_static,
            free=len(self.fixed) == 0,
        )
        del parts
        if len(found.mass) == 0:
            raise InputError("modes", modes, "leaves no coordinate: there is no attachment either", "keep a mode")
        count = len(self.attachments)
        body = ModalBody(
            **vars(found),
            damping=np.zeros_like(found.mass),
            attachment_names=tuple(a.name for a in self.attachments),
            attachment_points=np.array([a.point for a in self.attachments]).reshape(count, 3),
            attachment_axes=np.array([a.axis for a in self.attachments]).reshape(count, 3),
            nodes=self.nodes,
            elements=self.mesh.cells,
            faces=self.surface.faces,
            normals=nodal_normals(self.nodes, self.surface.faces),
            radiation=self.surface.radiation(found.shapes),
            momentum=momenta.T @ found.shapes,
            rigid_mass=motions.T @ momenta,
            softening=np.zeros_like(found.mass),
            held=len(self.fixed) > 0,
            notes=self.notes,
            added_kg=self.added_kg,
        )
        return self.with_estimate(body) if estimate else body

    def _check_frequency(self, below_hz: float, mass_kg: float) -> None:
        """Raise `InputError` where more modes lie below a frequency than can be found, before any is sought.

        Weyl's law counts ``V 4 pi/3 f^3 (1/c_l^3 + 2/c_t^3)`` modes of an elastic body below f, with the speeds of its
        waves c_l and c_t. Thin bodies have more (Courant, Hilbert, Methods of Mathematical Physics I, ch. VI.4).
        """
        lam, mu = self.material.lame()
        density = self.material.density
        slow, fast = np.sqrt(mu / density), np.sqrt((lam + 2.0 * mu) / density)
        per_cube = mass_kg / density * 4.0 * np.pi / 3.0 * (1.0 / fast**3 + 2.0 / slow**3)
        most = min(MOST_MODES, len(self.internal) // 2)
        if per_cube * below_hz**3 > most:
            highest = float(np.cbrt(most / per_cube))
            problem = (
                f"about {per_cube * below_hz**3:.2g} modes of this body or more lie below it; {most} can be found "
                f"({len(self.internal)} free unknowns), up to about {highest:.2g} Hz (shear waves of {slow:.3g} m/s)"
            )
            cure = "give twice the highest frequency of interest, or modes; check modulus, density and unit of the mesh"
            raise InputError("housing.reduction.modes_below_Hz", below_hz, problem, cure)

    @property
    def rigid_nodes(self) -> list[IntArray]:
        """Sets of nodes that are held or move as a rigid thing."""
        return [self.fixed, *(attachment.nodes for attachment in self.attachments)]

    def moved_fields(self, body: ModalBody) -> tuple[Array, Array]:
        """Fields in which forces on the attachments move the reduced body, by the mode acceleration method.

        Returns
        -------
        fields : (N, k)
            Its constraint modes, and the modes with free attachments up to the highest frequency of the modes kept.
        eigenvalues : (k,)
            Squares of their circular frequencies (rad^2/s^2), 0 of constraint modes.
        """
        kept = body.coupled.frequencies_hz <= body.highest_hz
        static = np.eye(body.size, 6 * len(self.attachments))
        eigenvalues = (2.0 * np.pi * body.coupled.frequencies_hz[kept]) ** 2
        fields = np.hstack([static, body.coupled.vectors[:, kept]])
        return fields, np.concatenate([np.zeros(static.shape[1]), eigenvalues])

    def with_estimate(self, body: ModalBody) -> ModalBody:
        """The reduced body with an estimate of the mesh's error, for frequencies up to the highest mode kept.

        What else there is in the body than `moved_fields` counts as without error.
        """
        fields, eigenvalues = self.moved_fields(body)
        with stage("estimating the mesh's error"):
            lost = self.mesh.energy_lost(self.material, body.shapes @ fields, eigenvalues, self.rigid_nodes)
        # weights of the fields in any motion, orthogonal in energy to the rest; a free body's energy needs some mass
        highest = (2.0 * np.pi * body.highest_hz) ** 2
        slow = np.min(eigenvalues[eigenvalues > ROUNDING * highest], initial=highest)  # rigid motions are round-off
        metric = body.stiffness + (body.mass * slow if len(self.fixed) == 0 else 0.0)
        share = np.linalg.pinv(fields.T @ metric @ fields, rcond=DEPENDENT, hermitian=True) @ (fields.T @ metric)
        return replace(body, softening=np.asarray(share.T @ lost @ share))

    def partition(self, matrices: SolidMatrices) -> Partition:
        """The matrices over the attachments' coordinates and the internal unknowns."""
        interface = interface_matrix(self.attachments, self.nodes)
        return partition(matrices.stiffness, matrices.mass, interface, self.internal)


def _fixed_nodes(fixed: Any, nodes: Array, new_number: IntArray) -> IntArray:
    """Held nodes from a plane, a pair (point, normal), node numbers or a mask."""
    if fixed is None:
        return np.zeros(0, dtype=np.int64)
    if isinstance(fixed, Plane):
        return plane_nodes(fixed, nodes)
    given = np.asarray(fixed)
    if given.shape == (2, 3):
        return plane_nodes(Plane(tuple(given[0]), tuple(given[1])), nodes)
    return _renumbered("fixed", given, new_number)


def _renumbered(field: str, chosen: Any, new_number: IntArray) -> IntArray:
    """Node numbers of the given mesh (or a mask) as numbers of the checked one."""
    given = np.asarray(chosen)
    n = len(new_number)
    if given.dtype == bool:
        if given.shape != (n,):
            raise InputError(field, given.shape, f"a mask must have one flag for each of the {n} nodes", "")
        given = np.flatnonzero(given)
    if given.ndim != 1 or (len(given) and given.dtype.kind not in "iu"):
        problem = "must be node numbers, a mask, a Plane or a pair (point, normal)"
        raise InputError(field, None, problem, "see Housing.from_arrays")
    if len(given) and (given.min() < 0 or given.max() >= n):
        raise InputError(field, [int(given.min()), int(given.max())], f"node numbers lie in 0..{n - 1}", "")
    found = np.unique(new_number[given.astype(np.int64)])
    found = found[found >= 0]
    if not len(found):
        raise InputError(field, None, "names no node that belongs to an element", "give nodes, or None for none")
    return np.asarray(found)
