"""Elastic housings: description or arrays -> mesh -> full model -> reduced body (`gearfe.ModalBody`).

housing = gearfe.housing_from_job("geometry/housing.toml")
body = housing.reduce()
body.save("housing.npz")

``build`` goes from a table to a mesh, ``body`` to the reduced body. The names below load on first use, so that a body
from the cache loads no finite elements.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .attachments import Attachment, Bore, Plane
    from .model import Housing

_PUBLIC = {"Attachment": "attachments", "Bore": "attachments", "Housing": "model", "Plane": "attachments"}

__all__ = ["Attachment", "Bore", "Housing", "Plane"]


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        return getattr(import_module(f".{_PUBLIC[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
