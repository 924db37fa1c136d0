r"""What another influence function would make of solved positions, without solving them again.

At a given twist the energy of a position is :math:`U = \max_F\,(g\cdot F - \tfrac12 F\,C\,F)` over the forces, and
stationary with their places and normals. A small change :math:`\delta C` of the compliance between the contacts
therefore changes it by :math:`-\tfrac12 F\,\delta C\,F` with the forces as they are, and the torque, its derivative
with the twist :math:`\varphi`, by

.. math:: \delta T = -\frac{d}{d\varphi}\,\tfrac12\,F(\varphi)\,\delta C(\varphi)\,F(\varphi),

where forces, places, normals and widths move on with the rates that each solution has. The second influence function
is that of coarser meshes of the gears (other elements, stations and bumps); wedge and half-plane are the same in both
and cancel.
"""

from __future__ import annotations

import numpy as np

from ..typing import Array, ComplexArray
from .half_plane_pair import HalfPlanePair
from .half_plane_result import PairContacts
from .half_plane_step import SIGN, smooth_influence
from .panels import Couplings, couplings
from .position import Positions

#: Way ahead in twist for the derivative, as a share of the way in which the forces double.
AHEAD = 1e-4


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
