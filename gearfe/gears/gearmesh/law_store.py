"""Mesh laws as files: NPZ, exact in both directions, CSV to look at, and the cache.

What solves contacts loads only for a law that was not made before.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...base.cache import cached_arrays
from ...base.errors import InputError
from ...base.files import write_csv
from ...base.progress import stage
from ...base.typing import Array
from ...output.arrays import load_arrays, save_arrays
from ..contact.laws import HalfPlane, PairModel
from ..geometry.pair import GearPair
from .job import curve_key
from .law import NO_CONTACT, MeshLaw

#: Fields that are arrays, with the number of their axes.
ARRAYS = {"nodes": 1, "forces": 1, "touch": 3, "energies": 5, "coupling": 4}


def law_arrays(law: MeshLaw) -> dict[str, Array]:
    """A law as named arrays, those of a separate law of the back flanks beginning with ``back_``."""
    numbers = np.array([*law.base_radii, law.backlash, law.reach, law.error])
    made = {**{name: getattr(law, name) for name in ARRAYS}, "numbers": numbers}
    behind = {} if law.back is None else law_arrays(law.back)
    return {**made, **{f"back_{name}": values for name, values in behind.items()}}


def law_of_arrays(arrays: Mapping[str, Array]) -> MeshLaw:
    """The law of `law_arrays`."""
    pinion, wheel, backlash, reach, error = arrays["numbers"].tolist()
    nodes, forces, touch, energies, coupling = (np.ascontiguousarray(arrays[name], dtype=float) for name in ARRAYS)
    behind = {name.removeprefix("back_"): values for name, values in arrays.items() if name.startswith("back_")}
    back = law_of_arrays(behind) if behind else None
    return MeshLaw(nodes, forces, touch, energies, coupling, (pinion, wheel), backlash, reach, error, back)


def save_law(law: MeshLaw, path: str | Path) -> None:
    """Write a law (NPZ)."""
    save_arrays(path, law_arrays(law))


def load_law(path: str | Path) -> MeshLaw:
    """Read a law.

    Raises
    ------
    InputError
        For a file that is not there, or holds no mesh law, or one whose pair forces are not unique.
    """
    found = load_arrays(path)
    missing = [name for name, axes in ARRAYS.items() if name not in found or found[name].ndim != axes]
    if missing or "numbers" not in found or found["numbers"].shape != (5,):
        problem = "holds no mesh law" + (f": no array {missing[0]!r} of {ARRAYS[missing[0]]} axes" if missing else "")
        raise InputError("mesh law", str(path), problem, "write it with gearfe.gears.gearmesh.law_store.save_law")
    law = law_of_arrays(found)
    if not all(side.convex for side in law.sides):
        problem = (
            "holds a mesh law whose pair forces are not unique: compliances of pairs rise too little with the force"
        )
        raise InputError("mesh law", str(path), problem, "make it again with gearfe.gears.gearmesh.law_make.mesh_law")
    return law


def write_law_csv(law: MeshLaw, path: str | Path) -> None:
    """A row for each node of the angle of a pair's own tooth: rigid touch, and what the pair yields to each force."""
    touch, angle = law.touch[:, :, 0].ravel(), law.nodes[:-1] + law.cycle * np.arange(law.slots)[:, None]
    columns = {
        "pair_angle_deg": np.degrees(angle).ravel(),
        "touch_um": np.where(touch < NO_CONTACT, 1e6 * touch, math.nan),
    }
    for part, (low, high) in enumerate(itertools.pairwise(law.forces[:-1])):
        c = law.energies[:, :, part, 0].reshape(-1, 5)
        columns[f"yield_um_at_{high:.6g}_N"] = 1e6 * (c[:, 1:] * np.arange(1, 5)) @ (high - low) ** np.arange(4)
    write_csv(path, columns)


def cached_law(pair: GearPair, model: PairModel, force: float) -> MeshLaw:
    """Law of a pair for mesh forces up to `force` (N), from disk when it was made before.

    Parameters
    ----------
    model
        Of the pair; the contact law is the half-plane law in any case.
    """
    own = replace(model, law=HalfPlane())

    def made() -> dict[str, Array]:
        from ..contact.half_plane import half_plane_pair
        from .law_make import mesh_law
        from .sweep import elastic_pair

        with stage("mesh law"):
            return law_arrays(mesh_law(half_plane_pair(elastic_pair(pair, own)), force))

    return law_of_arrays(cached_arrays("mesh-law", curve_key(pair, own, {"force": force}), made))
