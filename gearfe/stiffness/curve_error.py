r"""Discretisation error of a solved curve, from the same positions solved again on a coarser mesh.

With sizes larger by the factor c and errors of order p, one position's error would be :math:`d_i = |T_{c,i}/T_i - 1|
/(c^p - 1)`. Alone that is not to be trusted: the error swings about as the edge of the contact slides past the nodes,
so coarse and fine mesh often agree by chance. The swing is alike at all n positions of a sweep, hence

.. math:: e_i = \max\Big(d_i,\; (1 + 1/n)\,\big(\tfrac1n\sum_j d_j^2\big)^{1/2}\Big) + 5\cdot10^{-5} c_0^p,

with the curve's own factor :math:`c_0` on the default sizes. p is 1, the lowest order that was measured (contacts of
about one element's half width; 1.5 to 2 where the mesh sees the contact well). The last term stands for what both
meshes share.

The half-plane law is solved twice in the same way, with influence functions from two meshes; what they share (bumps,
panels, half-planes and wedges) is `HALF_PLANE`, by what bears besides smooth flanks.

Not in it: the model (plane, no friction, rigid bores, small strain with its first-order correction) and what no
refinement of one mesh family shows. `scripts/measure_curve_accuracy.py` measures over random pairs how often it covers
the true error.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..contact.laws import ContactLaw, HalfPlane
from .curve import ErrorEstimate

Array = NDArray[Any]

#: Coarsening c, assumed order of convergence p, share of the meshes' common error at the default sizes, and largest
#: number of positions solved twice.
COARSENING, ORDER, COMMON, POSITIONS = 1.6, 1.0, 5e-5, 20
#: Relative error of the half-plane law that no mesh shows: on smooth flanks, at rounded and at sharp edges (as in
#: `contact_pressure.EDGES`); with it the estimates cover 95 % of random pairs (docs/contact_laws.md).
HALF_PLANE = (1e-4, 2e-4, 1.5e-3)


def solved_twice(converged: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Positions to solve again, evenly among those that converged: their numbers."""
    good = np.flatnonzero(converged)
    if len(good) == 0:
        return good.astype(np.int64)
    return good[np.unique(np.linspace(0, len(good) - 1, min(len(good), POSITIONS)).round().astype(np.int64))]


def unseen_error(law: ContactLaw, edge: Array) -> Array:
    """Relative error of a law that no refinement of the mesh shows, shape (n,).

    Parameters
    ----------
    edge : ndarray, shape (n,)
        What bears besides smooth flanks: the place in `contact_pressure.EDGES`.
    """
    return np.array(HALF_PLANE)[edge.astype(np.int64)] if isinstance(law, HalfPlane) else np.zeros(len(edge))


def error_estimate(
    angles: Array, torque: Array, coarse: Array, *, coarsen: float = 1.0, unseen: Array | float = 0.0
) -> ErrorEstimate:
    """Estimated relative error at the positions solved twice.

    Parameters
    ----------
    angles : ndarray, shape (m,)
        Pinion angles (rad).
    torque, coarse : ndarray, shape (m,)
        Torque of the curve there and on the coarser mesh (N m); not-a-number where that one failed. Such a position
        gets the largest error of the others.
    coarsen
        The curve's own factor on the default element sizes, that of the flanks where it is larger.
    unseen : ndarray, shape (m,)
        What no mesh shows: `unseen_error`, and the rounding of the gears' angles.
    """
    single = np.abs(coarse / torque - 1) / (COARSENING**ORDER - 1)
    known = np.isfinite(single)
    relative = np.full(len(single), np.nan)
    if known.any():
        count = int(known.sum())
        usual = (1 + 1 / count) * float(np.sqrt(np.mean(single[known] ** 2)))
        relative = np.where(known, np.maximum(single, usual), max(usual, float(single[known].max())))
        relative = relative + COMMON * coarsen**ORDER + unseen
    return ErrorEstimate(angles, relative, COARSENING, ORDER)
