r"""Discretisation error of a solved curve, from coarser gears.

**The half-plane law.** At a given twist the energy of a position is :math:`U = \max_F\,(g\cdot F - \tfrac12 F\,C\,F)`
over the forces, and stationary with their places and normals. The influence function of the coarser gears (other
elements, stations and bumps; wedge and half-plane cancel) changes the compliance between the contacts by
:math:`\delta C`, and with the forces, places, normals and widths moving on at the rates that each solution has, the
torque by

.. math:: \delta T = -\frac{d}{d\varphi}\,\tfrac12\,F(\varphi)\,\delta C(\varphi)\,F(\varphi) .

With sizes larger by the factor c and errors of order p, one position's error is
:math:`d_i = |\delta T_i/T_i|/(c^p-1)`. Alone that is not to be trusted: both meshes often agree by chance. The
errors are alike at all n positions of a sweep, hence

.. math:: e_i = \max\Big(d_i,\; 2\,\big(\tfrac1n\sum_j d_j^2\big)^{1/2}\Big),

twice the standard deviation, which covers 95 % of what is normally distributed (JCGM 100:2008, *Guide to the
expression of uncertainty in measurement*, 6.2.2). p is 1, the lowest order that was measured.

**Laws on the elements** start from the half-plane law's solution :math:`T^{HP}` of the same gears, whose contact is on
no mesh. From the truth they are as far as from that, and that from the truth, at most:

.. math:: e_i = |T_i/T_i^{HP} - 1| + e_i^{HP} .

What a law yields by itself (the overlap of a soft penalty) is in it.

Not in it: the model (plane, no friction, rigid bores, small strain with its first-order correction) and what no
refinement of one mesh family shows: of the half-plane law, the wedge that stands for a sharp tip (0.2 to 0.4 % where
one bears; docs/contact_laws.md). `scripts/measure_curve_accuracy.py` measures over random pairs how often it covers
the true error.
"""

from __future__ import annotations

import numpy as np

from ..contact.compliance import MeshingPair
from ..contact.half_plane_pair import HalfPlanePair, half_plane_pair
from ..contact.half_plane_step import smooth_influence
from ..contact.laws import COARSENING
from ..contact.panels import Couplings, couplings
from ..contact.position import ANGLE_ROUNDING, Positions
from ..typing import Array, ComplexArray
from .positions import HalfPlaneSolver, PositionSolver, at_twists

#: Assumed order of convergence p.
ORDER = 1.0
#: Standard deviations that cover 95 %.
COVERAGE = 2.0
#: Way ahead in twist for the derivative of the energy, as a share of the way in which the forces double.
AHEAD = 1e-4


def curve_error(solver: PositionSolver, coarse: MeshingPair, solved: Positions, *, finite: bool) -> Array:
    """Estimated relative error of n solved positions from the coarser gears `coarse`, shape (n,); not-a-number where
    none converged.
    """
    numbers, made = np.flatnonzero(solved.status == "converged"), np.full(len(solved), np.nan)
    if len(numbers) == 0:
        return made
    own = chosen = solved.take(numbers)
    error = np.zeros(len(numbers))
    if not isinstance(solver, HalfPlaneSolver):
        own = at_twists(solver.half_plane, chosen.pinion_angle, chosen.twist, finite=finite)
        error = np.abs(chosen.torque_wheel / own.torque_wheel - 1)
    single = np.abs(torque_changes(solver.law, half_plane_pair(coarse), own)) / (COARSENING**ORDER - 1)
    error += np.maximum(single, COVERAGE * np.sqrt(np.mean(single**2)))
    # a twist of some bits of the gears' angles is not what the gears are turned by
    made[numbers] = error + ANGLE_ROUNDING * np.abs(chosen.tangent / chosen.torque_wheel)
    return made


def torque_changes(law: HalfPlanePair, other: HalfPlanePair, found: Positions) -> Array:
    """Relative changes of the wheel's torque when the influence function of `law` is that of `other`, shape (n,).

    Parameters
    ----------
    found
        Positions solved with `law`; not-a-number where there is no contact.
    """
    c = found.contacts
    frames = law.teeth.frames(found.pinion_angle[c.position], c.pair, found.twist[c.position])
    normal = c.normal[:, None] * np.exp(-1j * frames)
    couples = couplings(c.position, c.pair, len(found))
    here = c.force, c.arc, normal, 0.25 * c.half_width**2
    total = couples.total(c.force)
    rate = couples.total(np.abs(c.force_rate))
    with np.errstate(divide="ignore", invalid="ignore"):
        by = AHEAD * np.where(rate > 0, total / rate, np.nan)
        b = by[c.position]
        there = (
            c.force + c.force_rate * b,
            c.arc + c.arc_rate * b[:, None],
            normal * np.exp(1j * (c.normal_rate[:, None] - np.array([0.0, 1.0])) * b[:, None]),
            here[3] * np.exp(2 * c.growth * b),
        )
        energies = [_energy(other, couples, *at) - _energy(law, couples, *at) for at in (here, there)]
        return np.asarray((energies[0] - energies[1]) / (by * couples.total(c.torque_wheel)))


def _energy(
    law: HalfPlanePair, couples: Couplings, force: Array, arc: Array, normal: ComplexArray, variance: Array
) -> Array:
    """Energy (J) of the smooth displacements of each position, shape (n,), for forces (N)."""
    T = smooth_influence(law, couples, normal, arc, variance).compliance
    return couples.total(0.5 * force * couples.sums(T * force[couples.second])) / law.width
