"""Stiffness curves kept on disk: a second run with the same gears, load and mesh sizes reads its curve.

A stored curve is named by a hash of all that decides it: the pair, materials, contact law, sizes and positions, the
versions of numpy, scipy and gmsh, and the text of this package's own rooms that compute it.
"""

from __future__ import annotations

import inspect
import sys
from contextlib import suppress
from dataclasses import fields
from typing import Any

import numpy as np

from ..cache import cache_key, cached_arrays, source_hash
from ..contact.laws import PairModel
from ..gear.pair import GearPair
from ..versions import versions
from .curve import StiffnessCurve

#: Rooms and modules whose text decides a curve.
ROOMS = ("elasticity", "contact", "gear", "meshing", "stiffness")


def cached_curve(pair: GearPair, model: PairModel, **sweep: Any) -> StiffnessCurve:
    """Curve of `gearfe.sweep_stiffness` with these arguments, from disk when it was computed before."""

    def made() -> dict[str, Any]:
        from .sweep import sweep_stiffness

        curve = sweep_stiffness(pair, model, **sweep)
        return {own.name: np.asarray(getattr(curve, own.name)) for own in fields(curve) if own.name != "timings"}

    found = cached_arrays("curve", curve_key(pair, model, sweep), made)
    return StiffnessCurve(**{name: values if values.ndim else values.item() for name, values in found.items()})


def curve_key(pair: GearPair, model: PairModel, sweep: dict[str, Any]) -> str:
    """Hash (hex) of all that decides a curve."""
    law, text = type(model.law), ""
    with suppress(OSError, TypeError):  # laws of other packages have no version here, those without a file no text
        text = inspect.getsource(sys.modules[law.__module__])
    code = [law.__module__, law.__qualname__, text, source_hash(*ROOMS), versions()]
    return cache_key("curve", {"pair": pair, "model": model, "sweep": sweep, "code": code})
