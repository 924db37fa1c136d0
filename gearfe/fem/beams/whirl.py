r"""Whirl frequencies of a rotor on isotropic springs, with all coordinates of its beams.

With the complex deflection ``z = u_1 + i u_2`` of both planes, ``z = phi e^{i w t}`` turns at w, forward where w has
the sign of the spin. The quadratic problem

.. math:: (w^2 M - w\,\Omega\,\Gamma - K)\,\phi = 0

is real and symmetric. In the modes at rest (unit mass, squares ``Lambda``) it is the eigenvalue problem of one
symmetric matrix, whose eigenvalues are the whirl frequencies of both senses:

.. math::
    \begin{pmatrix} 0 & \Lambda^{1/2} \\ \Lambda^{1/2} & \Omega\,\Phi^T\Gamma\Phi \end{pmatrix}
    \begin{pmatrix} a \\ b \end{pmatrix} = w \begin{pmatrix} a \\ b \end{pmatrix} .
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from ...base.errors import InputError
from ...base.progress import one_thread
from ...base.typing import Array
from .elements import beam_matrices, divide
from .modes import ROUNDING
from .section import BeamShaft, Station


@dataclass(frozen=True)
class Support:
    """An isotropic spring between a rotor and the ground.

    Attributes
    ----------
    along
        Axial position (m).
    radial
        N/m.
    tilt
        N m/rad.
    """

    along: float
    radial: float
    tilt: float = 0.0


@one_thread()
def whirl_frequencies(
    shaft: BeamShaft,
    supports: Sequence[Support],
    speeds: Sequence[float] | Array,
    highest_hz: float,
    *,
    tolerance: float = 1e-7,
) -> tuple[Array, ...]:
    """Return the whirl frequencies of a rotor on springs at several speeds.

    Parameters
    ----------
    shaft : BeamShaft
        The rotor.
    supports : sequence of Support
        Its springs; they must hold it.
    speeds : sequence of float
        Spins about the axis (rad/s).
    highest_hz : float
        Highest frequency wanted (Hz).
    tolerance : float
        Error of the wave number at that frequency, as a part of it.

    Returns
    -------
    frequencies : tuple of ndarray
        For each speed the whirl frequencies up to the highest (Hz), ascending by magnitude; negative ones turn
        against the positive sense of the axis.

    Raises
    ------
    InputError
        A support off the shaft; supports that leave the rotor free; values out of range, see `divide`.
    """
    stations = tuple(Station(s.along, f"support {number}", ()) for number, s in enumerate(supports, 1))
    held = BeamShaft(shaft.start, shaft.sections, shaft.discs, stations, shaft.name)
    division = divide(held, highest_hz, tolerance)
    family = beam_matrices(held, division).bending
    own = slice(0, family.own)
    stiffness, mass, polar = family.stiffness[own, own], family.mass[own, own], family.polar[own, own]
    tilted = False
    for support in supports:
        node = division.node(support.along)
        stiffness[2 * node, 2 * node] += support.radial
        stiffness[2 * node + 1, 2 * node + 1] += support.tilt
        tilted |= support.tilt > 0.0
    places = {division.node(s.along) for s in supports if s.radial > 0.0}
    if not places or (len(places) < 2 and not tilted):
        raise InputError("supports", None, "leave the rotor free", "give two radial springs, or one and a tilt spring")
    # eigenvalues of the inverse: low frequencies keep all digits
    factor = linalg.cholesky(stiffness, lower=True)
    half = linalg.solve_triangular(factor, mass, lower=True)
    inverse = linalg.solve_triangular(factor, half.T, lower=True)
    inverse = 0.5 * (inverse + inverse.T)
    values, turned = linalg.eigh(inverse, subset_by_value=(ROUNDING * np.trace(inverse), np.inf))
    modes = linalg.solve_triangular(factor, turned / np.sqrt(values), lower=True, trans="T")
    count = len(values)
    matrix = np.zeros((2 * count, 2 * count))
    matrix[:count, count:] = matrix[count:, :count] = np.diag(1.0 / np.sqrt(values))
    gyroscopic = modes.T @ polar @ modes
    frequencies = []
    for speed in speeds:
        matrix[count:, count:] = speed * gyroscopic
        w = linalg.eigh(matrix, eigvals_only=True) / (2.0 * np.pi)
        w = w[np.abs(w) <= highest_hz]
        frequencies.append(w[np.argsort(np.abs(w))])
    return tuple(frequencies)
