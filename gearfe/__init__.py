"""gearfe: finite-element gear contact, gear-train vibration and planar mechanisms.

Public names load on first use (PEP 562), so ``import gearfe`` costs milliseconds and a job loads only what it needs.
"""

from importlib import import_module

from . import drawing
from .version import VERSION as __version__

TYPE_CHECKING = False  # `typing` itself would be a third of the import
if TYPE_CHECKING:  # what type checkers and the API reference see; below, the same names load on first use
    from typing import Any

    from .elasticity import Material
    from .errors import InputError
    from .gear import Gear, GearPair
    from .housing.build import housing_from_job
    from .housing.model import Housing
    from .loadmap.load_map import LoadMap
    from .loadmap.sweep import sweep_loads
    from .reduction.modal_body import ModalBody
    from .runup.run_up import run_up, steady_state
    from .stiffness.check import StiffnessCheck, check_positions
    from .stiffness.curve import StiffnessCurve
    from .stiffness.sweep import sweep_stiffness
    from .study.job import read_study, run_study
    from .study.search import Search
    from .train import GearTrain, TrainModel, TrainResponse, build_train
    from .train.simulate import simulate

#: Public name -> module that defines it.
_PUBLIC: dict[str, str] = {
    "Gear": "gear",
    "GearPair": "gear",
    "Housing": "housing.model",
    "InputError": "errors",
    "LoadMap": "loadmap.load_map",
    "Material": "elasticity",
    "ModalBody": "reduction.modal_body",
    "Search": "study.search",
    "StiffnessCheck": "stiffness.check",
    "StiffnessCurve": "stiffness.curve",
    "TrainModel": "train",
    "TrainResponse": "train",
    "GearTrain": "train",
    "build_train": "train",
    "check_positions": "stiffness.check",
    "housing_from_job": "housing.build",
    "read_study": "study.job",
    "run_study": "study.job",
    "run_up": "runup.run_up",
    "simulate": "train",
    "steady_state": "runup.run_up",
    "sweep_loads": "loadmap.sweep",
    "sweep_stiffness": "stiffness.sweep",
}

# written out for type checkers; a test holds it against the names above
__all__ = [
    "Gear",
    "GearPair",
    "GearTrain",
    "Housing",
    "InputError",
    "LoadMap",
    "Material",
    "ModalBody",
    "Search",
    "StiffnessCheck",
    "StiffnessCurve",
    "TrainModel",
    "TrainResponse",
    "__version__",
    "build_train",
    "check_positions",
    "housing_from_job",
    "read_study",
    "run_study",
    "run_up",
    "simulate",
    "steady_state",
    "sweep_loads",
    "sweep_stiffness",
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
    return sorted([*globals(), *_PUBLIC])
