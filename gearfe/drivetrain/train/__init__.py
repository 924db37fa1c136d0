"""Gear trains: rigid or elastic shafts with gears in an elastic or rigid housing, on the rigid core.

The path of a job: `drivetrain.gearbox.job` reads the tables and makes a `GearTrain`. `build_train` turns it into a
`TrainModel` (a `gearfe.multibody` system with its hinges eliminated). `simulate` integrates it and returns a
`TrainResponse`.
"""

from .gear_train import (
    Bearing,
    Carrier,
    Coupling,
    Damping,
    Drive,
    GearMesh,
    GearTrain,
    Guide,
    Load,
    Machine,
    Pin,
    Shaft,
    ShaftForce,
    ShaftGear,
    SpeedCurve,
)
from .model import TrainModel, build_train
from .response import TrainResponse
from .simulate import simulate

__all__ = [
    "Bearing",
    "Carrier",
    "Coupling",
    "Damping",
    "Drive",
    "GearMesh",
    "GearTrain",
    "Guide",
    "Load",
    "Machine",
    "Pin",
    "Shaft",
    "ShaftForce",
    "ShaftGear",
    "SpeedCurve",
    "TrainModel",
    "TrainResponse",
    "build_train",
    "simulate",
]
