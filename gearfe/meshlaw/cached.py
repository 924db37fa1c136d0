"""Mesh laws on disk: what solves contacts loads only for a law that was not made before."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from functools import cache
from pathlib import Path

from ..cache import cached_arrays
from ..contact.laws import HalfPlane
from ..contact.model import PairModel
from ..gear.pair import GearPair
from ..progress import stage
from ..stiffness.curve_cache import curve_key
from ..typing import Array
from .law import MeshLaw
from .store import law_arrays, law_of_arrays


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
        from ..stiffness.sweep import elastic_pair
        from .make import mesh_law

        with stage("mesh law"):
            return law_arrays(mesh_law(half_plane_pair(pair, elastic_pair(pair, own)), force))

    recipe = [curve_key(pair, own, {"force": force}), _source()]
    return law_of_arrays(cached_arrays("mesh-law", recipe, made))


@cache
def _source() -> str:
    """Hash of the text of this room."""
    files = sorted(Path(__file__).parent.glob("*.py"))
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()
