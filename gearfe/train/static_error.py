"""Static transmission error: the approach of a mesh that carries its steady force while the gears roll slowly."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..meshlaw.law import MeshLaw
from ..typing import Array
from .checks import interpolant
from .gear_train import GearMesh, GearTrain
from .kinematics import driving_senses, rolling, steady_forces
from .phases import pair_shifts, tooth_places


def static_errors(train: GearTrain, angle: Array) -> tuple[Array | None, ...]:
    """Approach of each mesh (m) at rotations of the drive (rad), bodies rolling rigidly; None where nothing yields.

    A force that presses the back flanks makes the mirrored approach behind the backlash. None also where a force is
    beyond what a law is known for, or presses flanks of which nothing is known.
    """
    senses = driving_senses(train)
    places, ratios = tooth_places(train, senses), rolling(train).ratios
    shafts = [shaft.name for shaft in train.shafts]
    made: list[Array | None] = []
    for mesh, sense, phase, force in zip(
        train.meshes, senses, places.phases, steady_forces(train).tolist(), strict=True
    ):
        ratio = float(ratios[shafts.index(train.gear(mesh.driver).shaft)])
        shifts = pair_shifts(train, mesh, sense, places)
        made.append(_approach(mesh, force, sense * ratio * angle + phase, shifts))
    return tuple(made)


def _approach(mesh: GearMesh, force: float, phase: Array, shifts: tuple[Array, Array]) -> Array | None:
    law, gap = mesh.stiffness, mesh.backlash
    if law is None:
        return None
    if isinstance(law, MeshLaw):
        gap = law.backlash or None if gap is None else gap
        if force < 0.0 and gap is None:
            return None
        side = 0 if force >= 0.0 else 1
        acting, own = law.sides[side], shifts[side]

        def late(x: Array) -> Array:
            return np.asarray(own[acting.pair_numbers(x) % len(own)])

        place = phase if force >= 0.0 else -phase
        if (abs(force) > acting.most(place, late(place))).any():
            return None
        return _side(lambda x: acting.approach(x, abs(force), late(x)), phase, force, gap)
    curve = interpolant(mesh)
    if gap is None:  # a spring that acts both ways
        return force / np.asarray(curve(phase).value)
    return _side(lambda x: abs(force) / np.asarray(curve(x).value), phase, force, gap)


def _side(approach: Callable[[Array], Array], phase: Array, force: float, gap: float | None) -> Array:
    """The approach of the flanks that the force presses."""
    return approach(phase) if force >= 0.0 or gap is None else -gap - approach(-phase)
