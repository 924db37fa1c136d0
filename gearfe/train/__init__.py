"""Gear trains: rigid shafts with gears in an elastic or rigid housing, on the rigid core.

The path of a job: `gearfe.vibration.job` reads the tables and makes a `TrainScene`; `build_train` turns it into a
`TrainModel` (a `gearfe.rigid` system with its hinges eliminated); `simulate` integrates it and returns a
`TrainResponse`.
"""

from .model import TrainModel, build_train
from .response import TrainResponse
from .scene import Bearing, Damping, Drive, GearMesh, Load, Shaft, ShaftGear, TrainScene
from .simulate import simulate

__all__ = [
    "Bearing",
    "Damping",
    "Drive",
    "GearMesh",
    "Load",
    "Shaft",
    "ShaftGear",
    "TrainModel",
    "TrainResponse",
    "TrainScene",
    "build_train",
    "simulate",
]
