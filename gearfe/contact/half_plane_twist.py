r"""The twist at which each position carries a torque, expected without solving any contact: good to 1e-3, mostly.

Every tooth pair k touches at its own rigid twist :math:`t_k` and yields by

.. math:: y_k = c_k F_k + \sum_l T_{kl} F_l = a_k (t - t_k) \quad\text{or}\quad F_k = 0,

with the teeth's smooth compliance T, the lever :math:`a_k`, and Hertz's approach between half-planes and wedges,

.. math:: c = C\,(\tfrac12 - \ln\tfrac b2) - \sum_i \frac{n W_i n}{E_i'} \ln 2y_i, \qquad b^2 = \frac{2 C F}{\kappa},

at the half width b of the force before (C = 2/pi sum 1/E', relative curvature kappa). Newton's method for t.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..gear.touching import Touching
from ..typing import Array
from .half_plane import BATCH, unloaded_state
from .half_plane_step import HalfPlanePair, smooth_influence
from .panels import couplings

#: Steps; sharpest edge (modules) that the curvature of a contact knows.
STEPS, SHARPEST = 10, 0.02
#: Force per width (N/m) that is none.
TINY = 1e-6


def expected_twists(law: HalfPlanePair, torques: Array, touching: Touching) -> Array:
    """Twists (rad) at which n positions are expected to carry torques (N m) > 0, shape (n,).

    Parameters
    ----------
    touching
        What `law.teeth.touching` says of their angles.
    """
    made = np.full(len(torques), np.nan)
    for start in range(0, len(torques), BATCH):
        part = slice(start, start + BATCH)
        rows = slice(*np.searchsorted(touching.position, [start, start + BATCH]))
        made[part] = _batch(law, torques[part], touching.take(rows), start)
    return made


def _batch(law: HalfPlanePair, torques: Array, found: Touching, start: int) -> Array:
    position = found.position - start
    count, width, C = len(torques), law.width, law.compliance
    touch = np.full(count, np.inf)
    np.minimum.at(touch, position, found.twist)
    if not np.isfinite(touch).all():
        return np.where(np.isfinite(touch), np.nan, touch)
    couples = couplings(position, found.pair, count)
    state = unloaded_state(law, touch, replace(found, position=position))
    T, arm = smooth_influence(law, state.seen, state.arc, couples).compliance, found.arm[:, 1]
    kappa = np.minimum(found.curvature, 1 / (SHARPEST * law.pair.pinion.module))
    tension, shear = law.wedge
    along = law.inverse_modulus * (tension + (shear * state.seen.conj() ** 2).real)
    points = law.tables.of(state.flank).at(state.arc[:, :, None])[0][:, :, 0]
    y = np.abs(points - law.corner[state.flank])
    own = T[couples.own]
    force = torques[position] / (arm * width)
    twist = touch.copy()
    for step in range(STEPS):
        b = np.sqrt(2 * C * np.maximum(force, TINY) / kappa)
        c = C * (0.5 - np.log(0.5 * b)) - (along * np.log(2 * np.maximum(y, b[:, None]))).sum(axis=1)
        if step == 0:  # one pair alone
            alone = touch[position] + force * (c + own) / arm
            least = np.full(count, np.inf)
            np.minimum.at(least, position, np.maximum(alone, touch[position]))
            twist = least
        overlap = arm * (twist[position] - found.twist)
        on = overlap > 0
        for _ in range(couples.slots + 1):
            weight = np.where(on, 1 / c, 0.0)
            force = couples.solved(weight * overlap, couples.diagonal(weight), T)
            if (force >= 0).all():
                break
            on = on & (force > 0)
        rate = couples.solved(weight * arm, couples.diagonal(weight), T)
        torque, slope = (couples.total(one * arm) * width for one in (force, rate))
        twist = np.maximum(twist + (torques - torque) / np.maximum(slope, 1e-300), touch + 0.1 * (twist - touch))
        force = np.maximum(force, 0.0)
    return twist
