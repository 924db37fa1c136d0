"""A reduced plane part and its interfaces: what `gearfe.fem.reduction.plate` makes and the cache keeps."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ...base.typing import Array, IntArray


class Interface(NamedTuple):
    """Nodes that move as one, and the place about which (m)."""

    centre: Array
    nodes: IntArray


@dataclass(frozen=True, eq=False)
class Plate:
    """A reduced plane part and the way back to its mesh.

    N = (1, Z, phi_1 ... phi_r), with Z the points in the frame as complex numbers and phi the modes. For shares eta of
    the modes the strain, in an orthonormal basis of its energy, is e = L eta + 1/2 Q(eta, eta).

    Attributes
    ----------
    mass_matrix : ndarray of complex, shape (r + 2, r + 2)
        Integrals of conj(N_j) N_k over the mass; kg, kg m, kg m2.
    linear, quadratic : ndarray, shapes (s, r), (s, r, r)
        L and Q.
    centres : ndarray of complex, shape (i,)
        Interfaces in the frame (m).
    shifts, turns : ndarray of complex, shape (i, r)
        Motion there by the modes: a point Z moves by shift (m) + turn (Z - centre), turn = growth + i angle.
    size : float
        Largest extent of the part (m); modes are of that size where they are largest.
    points : ndarray of complex, shape (n,)
        Nodes in the frame (m).
    triangles : ndarray, shape (m, 6)
    modes : ndarray of complex, shape (n, r)
        Displacements of the nodes by the modes.
    stresses : ndarray, shape (n, 3, s)
        Stresses xx, yy, xy at the nodes (Pa) by the stresses of the core: means over the elements that meet there.
    mass, centre, inertia
        Of the rigid part (kg, m, kg m2 about the centre).
    frequencies : ndarray
        Of the modes' own space with the first interface held, linear (Hz).
    """

    mass_matrix: np.ndarray = field(repr=False)
    linear: Array = field(repr=False)
    quadratic: Array = field(repr=False)
    centres: np.ndarray = field(repr=False)
    shifts: np.ndarray = field(repr=False)
    turns: np.ndarray = field(repr=False)
    size: float
    points: np.ndarray = field(repr=False)
    triangles: IntArray = field(repr=False)
    modes: np.ndarray = field(repr=False)
    stresses: Array = field(repr=False)
    mass: float
    centre: complex
    inertia: float
    frequencies: Array = field(repr=False)
