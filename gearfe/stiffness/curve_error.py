r"""Discretisation error of a solved curve, from a coarser mesh.

**Laws on the mesh** solve positions again on it. With sizes larger by the factor c and errors of order p, one
position's error would be :math:`d_i = |T_{c,i}/T_i - 1|/(c^p - 1)`. Alone that is not to be trusted: the error swings
about as the edge of the contact slides past the nodes, so coarse and fine mesh often agree by chance. The swing is
alike at all n positions of a sweep, hence

.. math:: e_i = \max\Big(d_i,\; (1 + 1/n)\,\big(\tfrac1n\sum_j d_j^2\big)^{1/2}\Big) + 5\cdot10^{-5} c_0^p,

with the curve's own factor :math:`c_0` on the default sizes. p is 1, the lowest order that was measured (contacts of
about one element's half width; 1.5 to 2 where the mesh sees the contact well). The last term stands for what both
meshes share.

**The half-plane law** needs no second sweep. At a given twist the energy of a position is
:math:`U = \max_F\,(g\cdot F - \tfrac12 F\,C\,F)` over the forces, and stationary with their places and normals. The
influence function of the coarser gears (other elements, stations and bumps; wedge and half-plane cancel) changes the
compliance between the contacts by :math:`\delta C`, and with the forces, places, normals and widths moving on at the
rates that each solution has, the torque by

.. math:: \delta T = -\frac{d}{d\varphi}\,\tfrac12\,F(\varphi)\,\delta C(\varphi)\,F(\varphi) .

Then :math:`d_i = |\delta T_i/T_i|/(c^p-1)`, and

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

from ..contact.compliance import MeshingPair
from ..contact.half_plane_pair import HalfPlanePair, half_plane_pair
from ..contact.half_plane_result import PairContacts
from ..contact.half_plane_step import SIGN, smooth_influence
from ..contact.laws import COARSENING
from ..contact.panels import Couplings, couplings
from ..contact.position import ANGLE_ROUNDING, Positions
from ..typing import Array, BoolArray, ComplexArray, IntArray
from .positions import HalfPlaneSolver, PositionSolver, at_twists, position_solver

#: Assumed order of convergence p, share of the meshes' common error at the default sizes, and largest number of
#: positions solved twice.
ORDER, COMMON, POSITIONS = 1.0, 5e-5, 20
#: Standard deviations that cover 95 %.
COVERAGE = 2.0
#: Way ahead in twist for the derivative of the energy, as a share of the way in which the forces double.
AHEAD = 1e-4


def curve_error(solver: PositionSolver, coarse: MeshingPair, solved: Positions, *, finite: bool) -> Array:
    """Estimated relative error of n solved positions from the coarser gears `coarse`, shape (n,): of all of them by the
    influence function of these, of some by a law on the mesh, which solves them again, resolved there or not.
    """
    elastic, good = solver.elastic, solved.status == "converged"
    numbers = np.flatnonzero(good) if isinstance(solver, HalfPlaneSolver) else solved_twice(good)
    chosen, made = solved.take(numbers), np.full(len(solved), np.nan)
    if isinstance(solver, HalfPlaneSolver):
        found = influence_estimate(torque_changes(solver.law, half_plane_pair(coarse), chosen))
    else:
        again = position_solver(coarse, resolved_only=False)
        there = at_twists(again, chosen.pinion_angle, chosen.twist, None, finite=finite)
        other = np.where(there.status == "converged", there.torque_wheel, np.nan)
        coarsen = elastic.model.coarsen * max(1.0, elastic.model.flank_coarsen)
        found = error_estimate(chosen.torque_wheel, other, coarsen=coarsen)
    # a twist of some bits of the gears' angles is not what the gears are turned by
    made[numbers] = found + ANGLE_ROUNDING * np.abs(chosen.tangent / chosen.torque_wheel)
    return made


def solved_twice(converged: BoolArray) -> IntArray:
    """Positions to solve again, evenly among those that converged: their numbers."""
    good = np.flatnonzero(converged)
    if len(good) == 0:
        return good.astype(np.int64)
    return good[np.unique(np.linspace(0, len(good) - 1, min(len(good), POSITIONS)).round().astype(np.int64))]


def influence_estimate(changes: Array) -> Array:
    """Estimated relative error of m positions of the half-plane law, shape (m,), from the relative `changes` of their
    torques by the influence function of coarser gears.
    """
    single = np.abs(changes) / (COARSENING**ORDER - 1)
    return np.maximum(single, COVERAGE * np.sqrt(np.mean(single**2)) if len(single) else 0.0)


def error_estimate(torque: Array, coarse: Array, *, coarsen: float = 1.0) -> Array:
    """Estimated relative error at the m positions solved twice, shape (m,).

    Parameters
    ----------
    torque, coarse : ndarray, shape (m,)
        Torque of the curve there and on the coarser mesh (N m); not-a-number where that one failed. Such a position
        gets the largest error of the others.
    coarsen
        The curve's own factor on the default element sizes, that of the flanks where it is larger.
    """
    single = np.abs(coarse / torque - 1) / (COARSENING**ORDER - 1)
    known = single[np.isfinite(single)]
    if len(known) == 0:
        return np.full(len(single), np.nan)
    usual = (1 + 1 / len(known)) * np.sqrt(np.mean(known**2))
    relative = np.where(np.isfinite(single), np.maximum(single, usual), max(usual, known.max()))
    return np.asarray(relative + COMMON * coarsen**ORDER)


def torque_changes(law: HalfPlanePair, other: HalfPlanePair, found: Positions) -> Array:
    """Relative changes of the wheel's torque when the influence function of `law` is that of `other`, shape (n,).

    Parameters
    ----------
    found
        Positions solved with `law`; not-a-number where there is no contact.
    """
    c = found.contacts
    assert isinstance(c, PairContacts)
    angle, twist = found.pinion_angle[c.position], found.twist[c.position]
    frames = angle + c.pair * law.pair.mesh_cycle, law.flanks.wheel_frame(angle, c.pair) + twist
    normal = c.normal[:, None] * np.exp(-1j * (np.stack(frames, axis=1) + law.teeth.turn(c.pair)))
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
    law: HalfPlanePair, couples: Couplings, force: Array, arc: Array, normal: ComplexArray, spread: Array
) -> Array:
    """Energy (J) of the smooth displacements of each position, shape (n,), for forces (N)."""
    smooth = smooth_influence(law, normal, arc, couples)
    own = smooth.moved[couples.own, :, 2] * SIGN * force[:, None]
    excess = spread[:, None] - np.einsum("pgk,gk->pg", smooth.values, law.bump_squares)
    wider = ((own * normal.conj()).real * SIGN * excess).sum(axis=1)
    return couples.total(0.5 * force * (couples.times(smooth.compliance, force) + wider)) / law.width
