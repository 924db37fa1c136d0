r"""Before any contact is solved: what each position starts from, and the twist at which it carries a torque.

Every tooth pair k touches at its own rigid twist :math:`t_k` and yields by

.. math:: y_k = c_k F_k + \sum_l T_{kl} F_l = a_k (t - t_k) \quad\text{or}\quad F_k = 0,

with the teeth's smooth compliance T, the lever :math:`a_k`, and Hertz's approach between half-planes and wedges,

.. math:: c = C\,(\tfrac12 - \ln\tfrac b2) - \sum_i \frac{n W_i n}{E_i'} \ln 2y_i, \qquad b^2 = \frac{2 C F}{\kappa},

at the half width b of the force before (C = 2/pi sum 1/E', relative curvature kappa). Forces expected at a twist, and
twists expected at a torque (Newton's method for t), are good to 1e-3, mostly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..gear.touching import Touching
from ..typing import Array, IntArray
from .half_plane_pair import HalfPlanePair
from .half_plane_step import WINDOW, Setting, State, reference_approach, smooth_influence
from .panels import PANELS, forces_of_overlaps
from .position import of_positions

#: Positions solved side by side.
BATCH = 128
#: Newton steps for the twist; rounds for the forces; sharpest edge (modules) that the curvature of a contact knows.
STEPS, ROUNDS, SHARPEST = 10, 2, 0.02
#: Force per width (N/m) that is none.
TINY = 1e-6


def unloaded(law: HalfPlanePair, numbers: IntArray, twists: Array, found: Touching) -> tuple[Setting, State]:
    """Tooth pairs where their rigid flanks touch, at twists (rad) of their positions, without forces.

    Parameters
    ----------
    numbers : ndarray, shape (m,)
        Of the positions, in rising order.
    twists : ndarray, shape (n,)
        Of all positions that are numbered.
    """
    turn = [
        found.angle + found.pair * law.pair.mesh_cycle + found.turn[:, 0],
        law.flanks.wheel_frame(found.angle, found.pair) + twists[found.position] + found.turn[:, 1],
    ]
    setting = Setting(law, numbers, found, np.exp(1j * np.stack(turn, axis=1)))
    nothing, count = np.zeros(len(found)), len(found)
    return setting, State(
        centre=found.point,
        normal=found.normal,
        arc=law.arc_at(found.flank, found.place),
        ends=law.tables.ends[found.flank],
        force=nothing,
        spread=nothing,
        low=nothing,
        high=nothing,
        bearing=np.zeros((count, PANELS), dtype=bool),
        reach=np.full(count, WINDOW),
    )


@dataclass(frozen=True)
class _Yield:
    """What Hertz's approach of p contacts needs: C (1/Pa), kappa (1/m), n W n/E' (1/Pa) and y (m), shape (p, 2)."""

    compliance: float
    curvature: Array
    along: Array
    distance: Array

    def half_width(self, force: Array) -> Array:
        """b (m) of forces per width (N/m), shape (p,)."""
        return np.asarray(np.sqrt(2 * self.compliance * np.maximum(force, TINY) / self.curvature))

    def at(self, force: Array) -> Array:
        """c (m2/N) at the half width of these forces."""
        b = self.half_width(force)
        wedge = (self.along * np.log(2 * np.maximum(self.distance, b[:, None]))).sum(axis=1)
        return np.asarray(self.compliance * (0.5 - np.log(0.5 * b)) - wedge)


def _yields(setting: Setting, state: State) -> tuple[_Yield, Array]:
    """How contacts yield by themselves, and T by couple."""
    law, normal = setting.law, state.normal[:, None] / setting.turn
    tension, shear = law.wedge
    along = law.inverse_modulus * (tension + (shear * normal.conj() ** 2).real)
    points = setting.tables.at(state.arc[:, :, None])[0][:, :, 0]
    blunt = np.minimum(setting.found.curvature, 1 / (SHARPEST * law.pair.pinion.module))
    T = smooth_influence(law, normal, state.arc, setting.couples).compliance
    return _Yield(law.compliance, blunt, along, np.abs(points - setting.corner)), T


def first_state(law: HalfPlanePair, twists: Array, found: Touching) -> tuple[Setting, State]:
    """What the iteration for all tooth pairs begins with at twists (rad) of the positions."""
    setting, state = unloaded(law, np.unique(found.position), twists, found)
    yields, T = _yields(setting, state)
    overlap = found.arm[:, 1] * (twists[found.position] - found.twist)
    force = np.maximum(overlap, 0.0) / reference_approach(law)
    for _ in range(ROUNDS):
        force = forces_of_overlaps(overlap, yields.at(force), T, setting.couples)
    return setting, replace(state, force=force, spread=0.25 * yields.half_width(force) ** 2)


def expected_twists(law: HalfPlanePair, torques: Array, touching: Touching) -> Array:
    """Twists (rad) at which n positions are expected to carry torques (N m) > 0, shape (n,); infinite where nothing can
    touch.

    Parameters
    ----------
    touching
        What `law.teeth.touching` says of their angles.
    """
    made, touched = np.full(len(torques), np.inf), np.unique(touching.position)
    for start in range(0, len(touched), BATCH):
        chosen = touched[start : start + BATCH]
        made[chosen] = _batch(law, torques[chosen], of_positions(touching, chosen))
    return made


def _batch(law: HalfPlanePair, torques: Array, found: Touching) -> Array:
    count, arm, position = len(torques), found.arm[:, 1], found.position
    touch = np.full(count, np.inf)
    np.minimum.at(touch, position, found.twist)
    setting, state = unloaded(law, np.arange(count), touch, found)
    couples, (yields, T) = setting.couples, _yields(setting, state)
    force = torques[position] / (arm * law.width)
    twist = np.full(count, np.inf)
    alone = touch[position] + force * (yields.at(force) + T[couples.own]) / arm
    np.minimum.at(twist, position, np.maximum(alone, touch[position]))
    for _ in range(STEPS):
        c, overlap = yields.at(force), arm * (twist[position] - found.twist)
        force = forces_of_overlaps(overlap, c, T, couples)
        weight = (force > 0) / c
        rate = couples.solved(weight * arm, couples.diagonal(weight), T)
        torque, slope = (couples.total(one * arm) * law.width for one in (force, rate))
        twist = np.maximum(twist + (torques - torque) / np.maximum(slope, 1e-300), touch + 0.1 * (twist - touch))
    return twist
