"""What the reports of transients and of run-ups share."""

from __future__ import annotations

from collections.abc import Sequence

from ...base.errors import unknown_name
from ..train.gear_train import GearTrain


def attachment_to_draw(names: Sequence[str], chosen: str | None, train: GearTrain) -> str:
    """Name of the attachment in the pictures: the chosen one, else the bore that carries the load's reaction."""
    if chosen is not None and chosen not in names:
        raise unknown_name("--attachment", chosen, names)
    loaded = next((load.bore for load in train.loads if load.bore is not None), None)
    return chosen or (loaded if loaded is not None and loaded in names else names[-1])
