"""Mesh stiffness of a gear pair: the sweep over rotations, curve, error estimate, fields.

``sweep`` is the front door; ``positions`` and ``position_solver`` solve; ``curve`` is the result and needs no finite
elements; ``job`` and ``report`` belong to the command. The names below load on first use, so that reading a curve does
not load the solver.
"""

from importlib import import_module
from typing import Any

_PUBLIC = {"StiffnessCurve": "curve", "elastic_pair": "sweep", "sweep_stiffness": "sweep"}

__all__ = ["StiffnessCurve", "elastic_pair", "sweep_stiffness"]


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        return getattr(import_module(f".{_PUBLIC[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
