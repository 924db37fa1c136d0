"""Mesh laws over the face width in the cache. What solves contacts loads only for a law that was not made before."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...base.cache import cached_arrays, source_hash, versions
from ...base.typing import Array
from ..contact.laws import check_alike
from .job import PACKAGES, StiffnessJob
from .width_job import axial_sense, check_width_job, wide_flanks, wide_mesh
from .width_law import WidthLaw

#: Fields that are arrays.
ARRAYS = ("nodes", "overlaps", "tilts", "touch", "energies")


def width_law_arrays(law: WidthLaw) -> dict[str, Array]:
    """Return a law, without that of its back flanks, as named arrays."""
    numbers = (*law.base_radii, law.width, law.backlash, law.largest_force, law.error, law.rms_error)
    return {**{name: getattr(law, name) for name in ARRAYS}, "numbers": np.array(numbers)}


def width_law_of(arrays: Mapping[str, Array]) -> WidthLaw:
    """Return the law of `width_law_arrays`."""
    pinion, wheel, *numbers = arrays["numbers"].tolist()
    nodes, overlaps, tilts, touch, energies = (np.ascontiguousarray(arrays[name], dtype=float) for name in ARRAYS)
    return WidthLaw(nodes, overlaps, tilts, touch, energies, (pinion, wheel), *numbers)


def width_law_parts(job: StiffnessJob) -> dict[str, Any]:
    """Return all that decides the law of a mesh besides its range: equal parts have equal laws.

    Raises
    ------
    InputError
        For keys of [stiffness] that a load along the width does not take, and teeth that differ.
    """
    check_width_job(job)
    mesh = wide_mesh(job)
    flanks = wide_flanks(job, mesh)
    check_alike(flanks.profiles)
    return {"mesh": mesh, "flanks": flanks, "sense": axial_sense(job)}


def cached_width_law(job: StiffnessJob, force: float, tilt: float) -> WidthLaw:
    """Return the law of a mesh over its face width, from disk where it was made before.

    Parameters
    ----------
    job : StiffnessJob
        Gears, flanks and materials.
    force : float
        Mesh force (N) up to which the law is asked for.
    tilt : float
        Largest tilt (rad) of the gears either way, beside that of the file; 0: they cannot tilt.

    Raises
    ------
    InputError
        For keys of [stiffness] that a load along the width does not take, teeth that differ, and loads out of range.
    """
    recipe = width_law_parts(job)
    mesh, flanks = recipe["mesh"], recipe["flanks"]

    def make() -> dict[str, Array]:
        from ..width import contact_lines, wide_compliance
        from .width_law_make import width_law

        lines = contact_lines(wide_compliance(mesh), flanks)
        return width_law_arrays(width_law(lines, force, tilt, sense=axial_sense(job)))

    code = [source_hash("gears/width", *PACKAGES), versions()]
    return width_law_of(cached_arrays("width-law", {**recipe, "force": force, "tilt": tilt, "code": code}, make))
