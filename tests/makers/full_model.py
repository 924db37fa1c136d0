"""The full model of a body over [attachments | internal unknowns]: the truth that a reduction is held against."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse

from gearfe.base.errors import InputError
from gearfe.base.progress import one_thread
from gearfe.base.typing import Array
from gearfe.drivetrain.housing.model import Housing
from gearfe.fem.reduction.craig_bampton import rigid_shift
from gearfe.fem.reduction.lanczos import lowest_modes
from gearfe.fem.reduction.sparse_solver import factorize


@dataclass(frozen=True, eq=False)
class FullModel:
    """Sparse matrices over ``[attachments (6 each) | internal unknowns]``.

    Attributes
    ----------
    mass, stiffness : (N, N) sparse
        M (kg), K (N/m).
    transform : (3 n, N) sparse
        Nodal displacement for unit unknowns.
    interfaces
        Number of attachment coordinates, which come first.
    held
        Whether a part of the body is fixed.
    """

    mass: Any
    stiffness: Any
    transform: Any
    interfaces: int
    held: bool

    @one_thread()
    def static(self, loads: Array) -> Array:
        """Displacement (N,) or (N, k) under loads on the attachments (6 a,) or (6 a, k), with one refinement step."""
        if not self.held:
            raise InputError("fixed", None, "a free housing has no static response", "hold a part of it")
        loads = np.asarray(loads, dtype=float)
        force = np.zeros((self.mass.shape[0], *loads.shape[1:]))
        force[: self.interfaces] = loads
        factor = factorize(self.stiffness)
        found = factor.solve(force)
        return found + factor.solve(force - self.stiffness @ found)

    @one_thread()
    def frequencies_hz(self, count: int = 20) -> Array:
        """Lowest natural frequencies (Hz) with the attachments free to move, rigid-body modes (zero) included."""
        shift = 0.0 if self.held else rigid_shift(self.stiffness, self.mass)
        factor = factorize(self.stiffness + shift * self.mass if shift else self.stiffness)
        values = lowest_modes(factor.solve, self.mass, count=count, shift=shift).eigenvalues
        if shift:
            values = np.where(np.abs(values) < 1e-3 * shift, 0.0, values)
        return np.asarray(np.sqrt(np.maximum(values, 0.0)) / (2.0 * math.pi))

    def reconstruct(self, q: Array) -> Array:
        """Nodal field (n, 3) of unknowns (N,)."""
        return np.asarray((self.transform @ q).reshape(-1, 3))


def full_model(housing: Housing) -> FullModel:
    """The body of a housing over [attachments | all internal unknowns]."""
    parts = housing.partition(housing.matrices())
    k, m = (
        sparse.csr_array(sparse.block_array([[bb, ib.T], [ib, ii]]))
        for bb, ib, ii in ((parts.k_bb, parts.k_ib, parts.k_ii), (parts.m_bb, parts.m_ib, parts.m_ii))
    )
    count, rows = len(parts.internal), len(parts.boundary)
    unit = sparse.csc_array((np.ones(count), (parts.internal, np.arange(count))), shape=(rows, count))
    transform = sparse.hstack([sparse.csc_array(parts.boundary), unit], format="csc")
    return FullModel(m, k, transform, parts.boundary.shape[1], len(housing.fixed) > 0)
