r"""Describe an elastic body by a few constant matrices, with the reconstruction of its full field.

The coordinates are ``q = [attachments | internal]``. Each attachment has six: the displacement of its reference point
(m) along x, y, z and its small rotation about x, y, z (rad), in the frame of the body. Internal coordinates have unit
modal mass (m kg^1/2). In that frame

.. math::
    M\ddot q + C\dot q + K q = f, \qquad u(x) = \mathrm{shapes}(x)\,q ,

with the forces (N) and moments (N m) ``f`` on the attachments, zero for the internal coordinates. Loading and using a
saved body needs numpy and scipy only.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import InputError, unknown_name
from ...base.shown import Shown
from ...base.typing import Array, IntArray
from ...output.arrays import load_arrays, save_arrays

#: Written to files; a file of another format is refused with a message.
FORMAT = 5


@dataclass(frozen=True, eq=False, repr=False)
class Reduction:
    """Reduced matrices over ``[attachments (6 each) | internal]``, N coordinates, and the way back.

    Attributes
    ----------
    mass, stiffness : (N, N)
        M, K (SI); the internal part has unit mass and diagonal stiffness, and no stiffness couples it to the
        attachments.
    shapes : (3 n, N)
        Nodal displacement for unit coordinates, rows ``3 node + axis``.
    internal_hz : (N - 6 a,)
        Frequencies with the attachments held (Hz), ascending: modes first, then those of the correction vectors.
    modes
        How many of the internal coordinates are modes.
    truncation, corrections, next_hz
        Matrix S, levels of corrections and frequency of the error bound in `fem.reduction.craig_bampton`. The frequency
        is infinite where no mode is left out, and 0 where nothing is known of those that were.
    """

    mass: Array
    stiffness: Array
    shapes: Array
    internal_hz: Array
    modes: int
    truncation: Array
    corrections: int
    next_hz: float


@dataclass(frozen=True, eq=False, repr=False)
class ModalBody(Reduction, Shown):
    """A reduced elastic body in its place: a `Reduction` with damping, attachments and mesh.

    Attributes
    ----------
    damping : (N, N)
        C (SI).
    attachment_names
        One name for each attachment.
    attachment_points : (a, 3)
        Reference points (m), on the bores' axes.
    attachment_axes : (a, 3)
        Unit vectors along the bores' axes.
    nodes : (n, 3)
        Mesh nodes (m).
    elements : (m, 4), (m, 10) or (m, 6)
        Cells to show: tetrahedra, or linear wedges between the nodes of extruded elements.
    faces : (f, 3) or (f, 6)
        Triangles of the outer surface, anticlockwise from outside, midside nodes last.
    normals : (n, 3)
        Outward unit normals of the outer surface at its nodes, zero elsewhere.
    radiation : (N, N)
        Surface matrix: ``qdot^T radiation qdot`` is the integral of the squared normal velocity over the outer surface
        (m4/s2).
    momentum : (6, N)
        Linear (kg m/s) and angular momentum about the frame's origin (kg m2/s) for unit coordinate rates.
    rigid_mass : (6, 6)
        Mass, static moments and inertia about the origin: kinetic energy of rigid translations and rotations.
    softening : (N, N)
        Estimate of how much too stiff the mesh makes the body, a quadratic form like the stiffness (see
        `gearfe.fem.bodies.mesh_error`); all zero where it was not estimated.
    held
        Whether a part of the body is fixed to the frame; a free body has six rigid-body modes.
    notes
        Remarks on the reduction, for the user.
    added_kg
        Mass that was added by moving nodes of folded elements (kg). Unless it is zero, the body has another shape than
        its mesh, and frequencies may err to either side.
    """

    damping: Array
    attachment_names: tuple[str, ...]
    attachment_points: Array
    attachment_axes: Array
    nodes: Array
    elements: IntArray
    faces: IntArray
    normals: Array
    radiation: Array
    momentum: Array
    rigid_mass: Array
    softening: Array
    held: bool
    notes: tuple[str, ...] = ()
    added_kg: float = 0.0

    @property
    def size(self) -> int:
        """Number of coordinates N."""
        return len(self.mass)

    @property
    def has_mesh(self) -> bool:
        """Return whether the body has elements and a radiating surface, not only points."""
        return len(self.elements) > 0

    @property
    def cells(self) -> dict[str, IntArray]:
        """The elements by their name in `gearfe.output.exchange.vtkhdf`."""
        return {{4: "tetra", 6: "wedge", 10: "tetra10"}[self.elements.shape[1]]: self.elements}

    @property
    def highest_hz(self) -> float:
        """Frequency of the highest mode that was kept (Hz), up to which errors can be estimated; 0 without modes."""
        return float(self.internal_hz[self.modes - 1]) if self.modes else 0.0

    @cached_property
    def coupled(self) -> CoupledModes:
        """Modes of the body with its attachments free to move, bores rigid."""
        inverse = np.linalg.inv(np.linalg.cholesky(self.mass))  # M = L L^T; SciPy would take longer to load
        values, vectors = np.linalg.eigh(inverse @ self.stiffness @ inverse.T)
        vectors = inverse.T @ vectors
        if not self.held:
            values[:6] = np.where(np.abs(values[:6]) < 1e-6 * abs(values[min(6, len(values) - 1)]), 0.0, values[:6])
        return CoupledModes(np.sqrt(np.maximum(values, 0.0)) / (2.0 * math.pi), vectors)

    def attachment(self, name: str) -> slice:
        """Slice of the six coordinates of an attachment."""
        if name not in self.attachment_names:
            raise unknown_name("attachment", name, self.attachment_names)
        first = 6 * self.attachment_names.index(name)
        return slice(first, first + 6)

    def facts(self) -> dict[str, str]:
        """Mass, attachments, coordinates and first frequencies."""
        rigid, mass = self.coupled.frequencies_hz, self.rigid_mass[0, 0]
        first = ", ".join(f"{f:.1f}" for f in rigid[rigid > 0.0][:3])
        return {
            "mass": f"{mass:.4g} kg" if math.isfinite(mass) else "not known",
            "held": "yes" if self.held else "no: free",
            "attachments": ", ".join(self.attachment_names),
            "coordinates": f"{len(self.mass)}, {self.modes} of them modes",
            "frequencies": f"{first}, ... Hz",
            "mesh": f"{len(self.nodes)} nodes" if len(self.elements) else "none",
        }

    def reconstruct(self, q: Array) -> Array:
        """Nodal field of coordinates: displacement from q, velocity from its rate, acceleration from its second rate.

        Parameters
        ----------
        q : (N,) or (steps, N)

        Returns
        -------
        ndarray, shape (n, 3) or (steps, n, 3)
        """
        q = np.asarray(q, dtype=float)
        if q.shape[-1] != self.size:
            raise InputError("q", q.shape, f"must have {self.size} coordinates in its last axis", "")
        field = self.shapes @ q if q.ndim == 1 else (self.shapes @ q.T).T
        return np.asarray(field.reshape(*q.shape[:-1], len(self.nodes), 3))

    def normal_component(self, q: Array) -> Array:
        """Nodal field's component along the outward normal: (n,) or (steps, n), zero off the outer surface."""
        return np.asarray(np.einsum("...nk,nk->...n", self.reconstruct(q), self.normals))

    def with_damping(self, *, ratio: float | Array | None = None, alpha: float = 0.0, beta: float = 0.0) -> ModalBody:
        """The same body with another damping block.

        Parameters
        ----------
        ratio
            Modal damping ratio for all modes of the body with free attachments, or one a mode (the last one holds for
            all above). Rigid-body modes stay undamped.
        alpha, beta
            Rayleigh damping ``alpha M + beta K`` (1/s, s), added to it.
        """
        damping = alpha * self.mass + beta * self.stiffness
        given = np.atleast_1d(np.asarray(0.0 if ratio is None else ratio, dtype=float))
        for field, value in (("ratio", float(np.min(given))), ("alpha", alpha), ("beta", beta)):
            if not value >= 0.0:
                raise InputError(f"damping {field}", value, "must be >= 0", "negative damping feeds energy in")
        if np.any(given > 0.0):
            omega = 2.0 * math.pi * self.coupled.frequencies_hz
            per_mode = np.append(given, np.full(max(0, self.size - len(given)), given[-1]))[: self.size]
            weighted = self.mass @ self.coupled.vectors
            damping = damping + (weighted * (2.0 * per_mode * omega)) @ weighted.T
        return dataclasses.replace(self, damping=0.5 * (damping + damping.T))

    def softened(self, part: float | Array = 1.0) -> ModalBody:
        r"""The body as soft as the estimate of the mesh's error allows, or a `part` of the way there.

        L are the squares of the circular frequencies of the modes with free attachments, and S is the softening. The
        stiffness L becomes ``L^(1/2) (1 + P)^-1 L^(1/2)`` with P = E^(1/2) part E^(1/2) and E = L^(-1/2) S L^(-1/2).
        That is L - part S where it is small, and never negative. A `part` may be given for each mode, N of them: parts
        that add up to one then share the softening out. Rigid-body motions stay free, the damping stays.
        """
        eigenvalues = (2.0 * math.pi * self.coupled.frequencies_hz) ** 2
        elastic = eigenvalues > 0.0
        vectors, root = self.coupled.vectors[:, elastic], np.sqrt(eigenvalues[elastic])
        values, axes = np.linalg.eigh((vectors.T @ self.softening @ vectors) / np.outer(root, root))
        half = (axes * np.sqrt(np.maximum(values, 0.0))) @ axes.T
        lost = (half * np.broadcast_to(part, elastic.shape)[elastic]) @ half
        stiffness = np.linalg.inv(np.eye(len(root)) + lost) * np.outer(root, root)
        weighted = self.mass @ vectors
        softening = weighted @ stiffness @ weighted.T
        return dataclasses.replace(self, stiffness=0.5 * (softening + softening.T))

    def save(self, path: str | Path) -> None:
        """Write one file with everything; `load` gives an equal body back."""
        values = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}
        save_arrays(path, {"format": np.array(FORMAT)} | {name: np.asarray(value) for name, value in values.items()})

    @classmethod
    def load(cls, path: str | Path) -> ModalBody:
        """Read a saved body; its large matrix stays on disk until it is used.

        Raises
        ------
        InputError
            When the file is missing, damaged, or of another format.
        """
        stored = load_arrays(path)
        values: dict[str, Any] = {}
        if not np.array_equal(stored.get("format", np.array(-1)), FORMAT):
            raise InputError("reduced model", str(path), "was written by another version", "make it again")
        for field in dataclasses.fields(cls):
            if field.name not in stored:
                raise InputError("reduced model", str(path), f"has no entry {field.name!r}", "make it again")
            value = stored[field.name]
            if field.type in ("int", "float", "bool", "str"):
                values[field.name] = value.item()
            else:
                values[field.name] = tuple(value.tolist()) if field.type == "tuple[str, ...]" else value
        _check_consistent(values, path)
        return cls(**values)


def _check_consistent(values: dict[str, Any], path: str | Path) -> None:
    """Raise `InputError` where the entries of a file do not fit each other: no program of this project wrote them."""

    def refuse(name: str, problem: str) -> InputError:
        return InputError("reduced model", str(path), f"its entry {name!r} {problem}", "make it again")

    for name, value in values.items():
        if isinstance(value, np.ndarray) and value.dtype.kind not in "fiu":
            raise refuse(name, "is no array of numbers")
    size, points = len(np.atleast_1d(values["mass"])), len(np.atleast_1d(values["nodes"]))
    count = len(values["attachment_names"])
    square = ("mass", "stiffness", "damping", "radiation", "softening")
    shapes: dict[str, tuple[int, ...]] = dict.fromkeys(square, (size, size))
    shapes |= {"shapes": (3 * points, size), "nodes": (points, 3), "normals": (points, 3)}
    shapes |= {"attachment_points": (count, 3), "attachment_axes": (count, 3), "internal_hz": (size - 6 * count,)}
    shapes |= {"momentum": (6, size), "rigid_mass": (6, 6)}
    for name, shape in shapes.items():
        if values[name].shape != shape:
            raise refuse(name, f"has the shape {values[name].shape}, not {shape}")
    for name in ("mass", "stiffness", "damping", "nodes", "attachment_points", "attachment_axes"):
        if not np.isfinite(values[name]).all():
            raise refuse(name, "holds a number that is not finite")
    for name, widths in (("elements", (4, 6, 10)), ("faces", (3, 6))):
        cells = values[name]
        whole = cells.dtype.kind in "iu" and cells.ndim == 2 and cells.shape[1] in widths
        if not whole or (cells.size and not (cells.min() >= 0 and cells.max() < points)):
            raise refuse(name, "does not fit the nodes")
    if not 0 <= values["modes"] <= size - 6 * count:
        raise refuse("modes", f"is {values['modes']}")


@dataclass(frozen=True, eq=False)
class CoupledModes:
    """Modes of a body whose attachments are free to move.

    Attributes
    ----------
    frequencies_hz : (N,)
        Natural frequencies (Hz), ascending; zero for rigid-body modes.
    vectors : (N, N)
        Mode shapes in the body's coordinates, one a column, of unit modal mass.
    """

    frequencies_hz: Array
    vectors: Array
