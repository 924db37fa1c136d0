r"""Parametric instability of a train without damping, over speed and load.

Under a constant force a mesh changes its stiffness with the phase. Small motions beside this slow path feel

.. math:: \ddot y + \Lambda y = P\,A(t)\,P^T y + \Omega\,G\dot y

with the tangents A of the meshes under their steady forces. Where a multiplier of the common period T has a modulus
above 1, vibration grows by :math:`e^{\sigma t}`, :math:`\sigma = \ln|\mu|/T`. Damping of this size (1/s) prevents the
growth.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...base.errors import InputError
from ...base.progress import count, one_thread
from ...base.typing import Array, ComplexArray
from ..train.forces import CurveFlank, WidthFlank
from .balance import Changes, changes
from .condensed import CondensedTrain
from .stability import LONGEST, around, kicks, steps_of, strengths, window

#: Modes whose stiffness the meshes change by more than this part are integrated.
REACHED = 1e-3


@dataclass(frozen=True, eq=False)
class InstabilityMap:
    """Largest multipliers without damping.

    Attributes
    ----------
    speeds : (n,), loads : (m,)
        Of the drive (rad/s); factors on all loads of the train.
    multiplier : (m, n)
        The largest, complex.
    growth : (m, n)
        sigma (1/s).
    """

    speeds: Array
    loads: Array
    multiplier: ComplexArray
    growth: Array


def instability_map(
    train: CondensedTrain, speeds: Sequence[float] | Array, loads: Sequence[float] | Array,
) -> InstabilityMap:  # fmt: skip
    """Growth without damping over speeds (rad/s) and factors on the loads.

    Raises
    ------
    InputError
        For factors that are not positive, meshes that carry no force, and those that share no period within `LONGEST`.
    """
    requested, factors = np.asarray(speeds, dtype=float), np.asarray(loads, dtype=float)
    if not (factors > 0.0).all():
        raise InputError("instability_loads", factors.tolist(), "must be > 0", "without a load no flank is in contact")
    if (train.steady <= 0.0).any():
        problem = "carries no force on its driving flanks, so its stiffness under load is open"
        name = train.model.meshes[int(np.argmin(train.steady))].name
        raise InputError(f"mesh {name!r}", None, problem, "give the train a load that presses them")
    made = np.zeros((len(factors), len(requested)), dtype=complex)
    system, span = train.system, window(train.system)
    if span.half is not None:
        problem = f"are asked for, but the meshes share no period of up to {LONGEST} mesh cycles"
        raise InputError("instability_loads", factors.tolist(), problem, "leave them out")
    coarse, slowest = kicks(system, span.turns, steps_of(span)), float(np.abs(requested).min())
    with one_thread():
        for i, factor in enumerate(factors):
            kept = strengths(system.linear, _tangents(train, coarse, float(factor))) > REACHED
            steps = steps_of(span, system.linear.squares[kept], slowest)
            by = _tangents(train, kicks(system, span.turns, steps), float(factor))
            for j, speed in enumerate(requested):
                made[i, j] = around(system, float(speed), by, kept, span, damped=False)[0]
                count(i * len(requested) + j + 1, made.size, "speeds")
    periods = 2.0 * math.pi * span.turns / np.abs(requested)
    return InstabilityMap(requested, factors, made, np.log(np.abs(made)) / periods)


def _tangents(train: CondensedTrain, theta: Array, factor: float) -> Changes:
    """Derivatives of the forces where each mesh carries its steady force times a factor, without motion."""
    u = np.tile(train.system.linear.rest(), (len(theta), 1))
    for numbers, steady in zip(train.flanks_of_mesh, train.steady, strict=True):
        flank, (along, turn, tilt) = train.forces.flanks[numbers[0]], train.forces.freedoms[numbers[0], :3]
        phase = flank.sense * (flank.ratio * (theta @ train.forces.turns[numbers[0]]) + u[:, turn]) + flank.phase
        tilts = u[:, tilt] if flank.tilt >= 0 else np.zeros(())
        if isinstance(flank, WidthFlank):
            u[:, along] = flank.gap + flank.law.approach(phase, factor * steady, tilts)
        elif isinstance(flank, CurveFlank):
            u[:, along] = factor * steady / flank.curve(phase).value - flank.beyond_touch(phase, np.zeros(()), tilts)
        else:
            u[:, along] = flank.gap + flank.law.approach(phase, factor * steady)
    entries, size = train.forces(theta, 1.0, u, np.zeros_like(u)).entries, train.system.linear.size
    springs = train.system.turned_entries(theta, 0.0)  # dampers have derivatives with the rates only, at this speed
    return changes([*entries, *springs], size, len(theta)).of_freedoms(size)
