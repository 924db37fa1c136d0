r"""Discretisation error of a solved curve, from a coarser mesh.

**Laws on the mesh** solve positions again on it. With sizes larger by the factor c and errors of order p, one
position's error would be :math:`d_i = |T_{c,i}/T_i - 1|/(c^p - 1)`. Alone that is not to be trusted: the error swings
about as the edge of the contact slides past the nodes, so coarse and fine mesh often agree by chance. The swing is
alike at all n positions of a sweep, hence

.. math:: e_i = \max\Big(d_i,\; (1 + 1/n)\,\big(\tfrac1n\sum_j d_j^2\big)^{1/2}\Big) + 5\cdot10^{-5} c_0^p,

with the curve's own factor :math:`c_0` on the default sizes. p is 1, the lowest order that was measured (contacts of
about one element's half width; 1.5 to 2 where the mesh sees the contact well). The last term stands for what both
meshes share.

**The half-plane law** needs no second sweep. The influence function of the coarser gears changes the energy, and with
it the torque, of each position by :math:`\delta T` (`gearfe.contact.influence_error`), so that
:math:`d_i = |\delta T_i/T_i|/(c^p-1)`, and

.. math:: e_i = \max\Big(d_i,\; 2\,\big(\tfrac1n\sum_j d_j^2\big)^{1/2}\Big),

twice the standard deviation, which covers 95 % of what is normally distributed (JCGM 100:2008, *Guide to the
expression of uncertainty in measurement*, 6.2.2).

Not in it: the model (plane, no friction, rigid bores, small strain with its first-order correction) and what no
refinement of one mesh family shows: of the half-plane law, the wedge that stands for a sharp tip (0.2 to 0.4 % where
one bears; docs/contact_laws.md). `scripts/measure_curve_accuracy.py` measures over random pairs how often it covers
the true error.
"""

from __future__ import annotations

import numpy as np

from ..typing import Array, BoolArray, IntArray
from .curve import ErrorEstimate

#: Coarsening c, assumed order of convergence p, share of the meshes' common error at the default sizes, and largest
#: number of positions solved twice.
COARSENING, ORDER, COMMON, POSITIONS = 1.6, 1.0, 5e-5, 20
#: Standard deviations that cover 95 %.
COVERAGE = 2.0


def solved_twice(converged: BoolArray) -> IntArray:
    """Positions to solve again, evenly among those that converged: their numbers."""
    good = np.flatnonzero(converged)
    if len(good) == 0:
        return good.astype(np.int64)
    return good[np.unique(np.linspace(0, len(good) - 1, min(len(good), POSITIONS)).round().astype(np.int64))]


def influence_estimate(angles: Array, changes: Array, *, unseen: Array | float = 0.0) -> ErrorEstimate:
    """Estimated relative error of positions of the half-plane law.

    Parameters
    ----------
    angles, changes : ndarray, shape (m,)
        Pinion angles (rad), and the relative changes of the torque by the influence function of coarser gears.
    unseen
        What no mesh shows: the rounding of the gears' angles.
    """
    single = np.abs(changes) / (COARSENING**ORDER - 1)
    usual = COVERAGE * float(np.sqrt(np.mean(single**2))) if len(single) else 0.0
    return ErrorEstimate(angles, np.maximum(single, usual) + unseen, COARSENING, ORDER)


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
        What no mesh shows: the rounding of the gears' angles.
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
