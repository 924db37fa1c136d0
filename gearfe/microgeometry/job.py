"""Which model solves deviations of every tooth: that of [stiffness], by the half-plane law."""

from __future__ import annotations

from typing import Any

from ..contact.laws import HalfPlane
from ..stiffness.job import StiffnessJob


def checked_model(job: StiffnessJob) -> dict[str, Any]:
    """Arguments of `gearfe.stiffness.sweep.elastic_pair`: the half-plane law, whatever [stiffness] takes for its curve.

    Only that law knows deviations that no mesh has.
    """
    return {**job.model, "law": HalfPlane()}


def law_remarks(job: StiffnessJob) -> list[str]:
    """A line to print where [stiffness] names another law than the one that solves here."""
    name = job.model["law"].name
    if name == HalfPlane.name:
        return []
    return [f"contact law: half_plane, as deviations need it; law = {name!r} of [stiffness] is for its curve alone"]
