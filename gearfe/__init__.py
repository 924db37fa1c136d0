"""gearfe: finite-element gear contact, gear-train vibration and planar mechanisms.

Public names load on first use (PEP 562), so ``import gearfe`` costs milliseconds and a job loads only what it needs.
"""

from importlib import import_module

from .base import drawing
from .version import VERSION as __version__

TYPE_CHECKING = False  # `typing` itself would be a third of the import
if TYPE_CHECKING:  # what type checkers and the API reference see; below, the same names load on first use
    from typing import Any

    from .base.errors import InputError
    from .drivetrain.bearings import BallBearing, RollerBearing
    from .drivetrain.gearbox.mesh_stiffness import compute_meshes
    from .drivetrain.gearbox.rexs_results import rexs_results
    from .drivetrain.housing.build import housing_from_job
    from .drivetrain.housing.model import Housing
    from .drivetrain.modes.whirl import train_modes
    from .drivetrain.runup.run_up import run_up, steady_state
    from .drivetrain.train import Coupling, Machine, TrainModel, TrainResponse, build_train
    from .drivetrain.train.gear_train import Bearing, Damping, Drive, GearMesh, GearTrain, Load, Shaft, ShaftGear
    from .drivetrain.train.simulate import simulate
    from .fem.plane import Material
    from .fem.reduction.modal_body import ModalBody
    from .gears.contact.laws import PairModel
    from .gears.gearmesh.check import StiffnessCheck, check_positions
    from .gears.gearmesh.curve import StiffnessCurve
    from .gears.gearmesh.load_map import LoadMap
    from .gears.gearmesh.sweep import sweep_loads, sweep_stiffness
    from .gears.geometry import Gear, GearPair
    from .gears.rating.rate import Rating, rate
    from .multibody import constant
    from .output.exchange.rexs import RexsJob, read_rexs, rexs_job, write_rexs
    from .study.job import read_study, run_study
    from .study.search import Search

#: Public name -> module that defines it.
_PUBLIC: dict[str, str] = {
    "BallBearing": "drivetrain.bearings",
    "Bearing": "drivetrain.train",
    "Coupling": "drivetrain.train",
    "Damping": "drivetrain.train",
    "Drive": "drivetrain.train",
    "Gear": "gears.geometry",
    "GearMesh": "drivetrain.train",
    "GearPair": "gears.geometry",
    "Housing": "drivetrain.housing.model",
    "InputError": "base.errors",
    "Load": "drivetrain.train",
    "Machine": "drivetrain.train",
    "LoadMap": "gears.gearmesh.load_map",
    "Material": "fem.plane",
    "ModalBody": "fem.reduction.modal_body",
    "PairModel": "gears.contact.laws",
    "Rating": "gears.rating.rate",
    "RexsJob": "output.exchange.rexs",
    "RollerBearing": "drivetrain.bearings",
    "Search": "study.search",
    "Shaft": "drivetrain.train",
    "ShaftGear": "drivetrain.train",
    "StiffnessCheck": "gears.gearmesh.check",
    "StiffnessCurve": "gears.gearmesh.curve",
    "TrainModel": "drivetrain.train",
    "TrainResponse": "drivetrain.train",
    "GearTrain": "drivetrain.train",
    "build_train": "drivetrain.train",
    "compute_meshes": "drivetrain.gearbox.mesh_stiffness",
    "check_positions": "gears.gearmesh.check",
    "constant": "multibody",
    "housing_from_job": "drivetrain.housing.build",
    "rate": "gears.rating.rate",
    "read_rexs": "output.exchange.rexs",
    "read_study": "study.job",
    "rexs_job": "output.exchange.rexs",
    "rexs_results": "drivetrain.gearbox.rexs_results",
    "run_study": "study.job",
    "run_up": "drivetrain.runup.run_up",
    "simulate": "drivetrain.train",
    "steady_state": "drivetrain.runup.run_up",
    "sweep_loads": "gears.gearmesh.sweep",
    "sweep_stiffness": "gears.gearmesh.sweep",
    "train_modes": "drivetrain.modes.whirl",
    "write_rexs": "output.exchange.rexs",
}

# written out for type checkers; a test holds it against the names above
__all__ = [
    "BallBearing",
    "Bearing",
    "Coupling",
    "Damping",
    "Drive",
    "Gear",
    "GearMesh",
    "GearPair",
    "GearTrain",
    "Housing",
    "InputError",
    "Load",
    "LoadMap",
    "Machine",
    "Material",
    "ModalBody",
    "PairModel",
    "Rating",
    "RexsJob",
    "RollerBearing",
    "Search",
    "Shaft",
    "ShaftGear",
    "StiffnessCheck",
    "StiffnessCurve",
    "TrainModel",
    "TrainResponse",
    "__version__",
    "build_train",
    "check_positions",
    "compute_meshes",
    "constant",
    "housing_from_job",
    "rate",
    "read_rexs",
    "read_study",
    "rexs_job",
    "rexs_results",
    "run_study",
    "run_up",
    "simulate",
    "steady_state",
    "sweep_loads",
    "sweep_stiffness",
    "train_modes",
    "write_rexs",
]


def _draw(result: "Any") -> "Any":
    """The picture of a result, whose libraries load when one is drawn."""
    from .figures.results import picture

    return picture(result)


drawing.draw = _draw


def __getattr__(name: str) -> "Any":
    if name in _PUBLIC:
        value = getattr(import_module(f".{_PUBLIC[name]}", __name__), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'gearfe' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*__all__, *(name for name in globals() if name.startswith("__"))])
