"""Stiffness curves kept on disk: a second run with the same gears, load and mesh sizes reads its curve.

A stored curve is the CSV file of `gearfe.stiffness.curve.StiffnessCurve` (exact in both directions) in the folder of
the mesh cache, named by a hash of all that decides it: the pair, materials, contact law, sizes and positions, the
versions of numpy, scipy and gmsh, and the text of this package's own rooms that compute it.
"""

from __future__ import annotations

import hashlib
import math
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from ..cache import cache_key, kept, source_hash
from ..contact.laws import PairModel
from ..errors import InputError
from ..gear.pair import GearPair
from .curve import StiffnessCurve

#: Rooms and modules whose text decides a curve.
ROOMS = ("elasticity", "contact", "gear", "meshing", "stiffness")


def cached_curve(
    pair: GearPair,
    model: PairModel,
    sweep: dict[str, Any],
    *,
    progress: Any = None,
    estimate_error: bool = False,
) -> StiffnessCurve:
    """Curve of `gearfe.sweep_stiffness`, from disk when it was computed before. Failed curves are not kept.

    Parameters
    ----------
    pair
        The gears, the driver as pinion.
    model
        Of the pair.
    sweep
        Other keyword arguments of `sweep_stiffness`, such as those of `gearfe.stiffness.job.StiffnessJob`.
    progress
        See `sweep_stiffness`.
    estimate_error
        Whether the curve carries an estimate of its error.
    """

    def read(path: Path) -> StiffnessCurve | None:
        found = _stored(path, pair)
        if found is None or (estimate_error and math.isnan(found.worst_error)):
            return None
        return found if estimate_error else replace(found, relative_error=np.zeros(0))

    def make() -> StiffnessCurve:
        from .sweep import sweep_stiffness

        return sweep_stiffness(pair, model, progress=progress, estimate_error=estimate_error, **sweep)

    def write(curve: StiffnessCurve, path: Path) -> None:
        if not curve.failed.any():
            curve.to_csv(path)

    return kept("curve", curve_key(pair, model, sweep), read=read, make=make, write=write, suffix=".csv")


def curve_key(pair: GearPair, model: PairModel, sweep: dict[str, Any]) -> str:
    """Hash (hex) of all that decides a curve."""
    import scipy

    versions = {
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "gearfe": __version__,
        "source": source_hash(*ROOMS),
    }
    kind = type(model.law)
    versions["law"] = f"{kind.__module__}:{kind.__qualname__} {_text_of(kind.__module__)}"
    return cache_key("curve", {"pair": pair, "model": model, "sweep": sweep, "versions": versions})


@cache
def _text_of(module: str) -> str:
    """Hash of the text of a law's module: laws of other packages have no version here."""
    file = getattr(sys.modules.get(module), "__file__", None)
    return "" if file is None else hashlib.sha256(Path(file).read_bytes()).hexdigest()


def _stored(path: Path, pair: GearPair) -> StiffnessCurve | None:
    try:
        curve = StiffnessCurve.from_csv(path)
    except InputError:
        return None
    whole = math.isclose(curve.mesh_cycle, pair.mesh_cycle, rel_tol=1e-12) and not curve.failed.any()
    return curve if whole else None
