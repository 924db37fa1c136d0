"""Elastic housings: description or arrays -> mesh -> full model -> reduced body (`gearfe.ModalBody`).

housing = gearfe.housing_from_job("geometry/housing.toml")
body = housing.reduce()
body.save("housing.npz")
"""

from .attachments import Attachment, Bore, Plane
from .model import Housing

__all__ = ["Attachment", "Bore", "Housing", "Plane"]
