"""gearfe: finite-element gear contact, gear-train vibration and planar mechanisms.

Public names load on first use (PEP 562), so ``import gearfe`` costs milliseconds and a job loads only what it needs.
"""

from __future__ import annotations

from importlib import import_module

TYPE_CHECKING = False  # `typing` itself would be a third of the import
if TYPE_CHECKING:
    from typing import Any

__version__ = "0.1.0"

#: Public name -> module that defines it.
_PUBLIC: dict[str, str] = {
    "Gear": "gear",
    "GearPair": "gear",
    "Housing": "housing",
    "InputError": "errors",
    "LoadMap": "loadmap.load_map",
    "LoadedMesh": "microgeometry.loaded_mesh",
    "Material": "elasticity",
    "ModalBody": "reduction.modal_body",
    "Search": "study.search",
    "StiffnessCurve": "stiffness",
    "TrainModel": "train",
    "TrainResponse": "train",
    "TrainScene": "train",
    "build_train": "train",
    "housing_from_job": "housing.build",
    "load_mesh": "microgeometry.solve",
    "read_study": "study.job",
    "optimise_relief": "microgeometry.relief",
    "run_study": "study.job",
    "run_up": "runup.run_up",
    "simulate": "train",
    "steady_state": "runup.run_up",
    "sweep_loads": "loadmap.sweep",
    "sweep_stiffness": "stiffness",
}

__all__ = ["__version__", *sorted(_PUBLIC)]  # noqa: PLE0604


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        value = getattr(import_module(f".{_PUBLIC[name]}", __name__), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'gearfe' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *_PUBLIC])
