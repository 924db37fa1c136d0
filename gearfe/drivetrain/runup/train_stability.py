"""Stability of the steady motion of a train at the speed and under the loads that a transient has in the end."""

from __future__ import annotations

import numpy as np

from ...base.errors import InputError
from ...base.progress import one_thread
from ..gearbox.stability import Stability
from ..train.model import TrainModel

#: Errors of the motion, in parts of the approach under the steady force, and of the multipliers' moduli.
MOTION, MODULUS = 1e-4, 1e-6


def train_stability(model: TrainModel) -> Stability:
    """Floquet multipliers of a train's steady motion, or the reason for none."""
    note = why_not(model)
    if note:
        return Stability(note=note)
    from .condensed import condense
    from .run_up import steady_state
    from .stability import multipliers

    try:
        state = steady_state(model, model.steady_speed, tolerance=MOTION, stability=False)
        with one_thread():
            found = multipliers(condense(model).system, state.orbit, MODULUS)
    except InputError as error:
        return Stability(note=str(error))
    if not np.isfinite(found).all():
        return Stability(note="the multipliers do not decide: the phases of the meshes repeat too late")
    return Stability(found, state.span)


def why_not(model: TrainModel) -> str:
    """Why a train has no multipliers, or nothing."""
    drive = model.train.driven
    reasons = (
        (
            bool(model.forces.turned),
            "a carrier turns in an elastic housing: `gearfe runup` has the multipliers of its motions",
        ),
        (drive.torque is not None, "the drive is by torque, so no speed is held; `gearfe runup` prescribes it"),
        (not drive.speed.ends or model.steady_speed == 0.0, "the drive has no steady speed"),
        (
            not all(load.torque.ends for load in model.train.loads),
            "a load changes all the time: no motion repeats with the meshes",
        ),
        (not len(model.modal.eigenvalues), "nothing can vibrate: rigid meshes in a rigid housing follow the drive"),
        (
            any(not (line.rigid or line.pulls) for line in model.meshes),
            "not computed, because teeth may separate and several steady motions may exist; `gearfe runup` computes "
            "each with its multipliers",
        ),
    )
    return next((note for there, note in reasons if there), "")
