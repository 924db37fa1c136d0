"""Elastic housing: mesh, reduction, size and sparse solver against error and time; other programs on the same mesh.

Frequencies are those with rigid bores that are free to move. Errors of the mesh are taken against elements that are
much thinner across the re-entrant edges, where the slow error is made. Errors of the reduction are taken against the
full model under a ramp on bore 5.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache, partial
from typing import Any

import numpy as np

from gearfe.drivetrain.housing.model import Housing
from tests.makers.full_model import full_model
from tests.makers.housing_meshes import reference_housing
from tests.makers.newmark import below, newmark, smooth_ramp

from .peers.process import missing, run_python
from .record import Record
from .subject import housing_of
from .timing import measured

#: Thicknesses of the elements at inner edges (mm), coarse to fine; the last one is the truth of all others.
SIZES, QUICK_SIZES = (12.0, 6.0, 4.5, 3.0, 2.0, 1.2), (40.0, 24.0)
#: (modes, correction levels) of the reduction.
REDUCTIONS = (
    (10, 0),
    (20, 0),
    (40, 0),
    (80, 0),
    (160, 0),
    (10, 1),
    (20, 1),
    (40, 1),
    (60, 1),
    (80, 1),
    (20, 2),
    (40, 2),
)
QUICK_REDUCTIONS = ((10, 0), (10, 1))
FREQUENCIES = 20
BETA = 1.6e-6  # Rayleigh damping (s)


def run_housing(record: Record) -> None:
    """All tables of the housing."""
    if record.peers:
        others(record)
    reductions(record)
    sizes(record)


def fresh(housing: Housing) -> Housing:
    """The same housing with nothing assembled yet."""
    from dataclasses import replace

    return replace(housing)


def reduced(housing: Housing, modes: int = 40, levels: int = 1) -> Any:
    """Assembly and reduction, nothing kept from before; the estimate of the mesh's error apart."""
    return fresh(housing).reduce(modes, quasi_static=levels, estimate=False)


def sizes(record: Record) -> None:
    """Mesh to reduced model (40 modes, one level): seconds against unknowns, frequencies and their estimated errors."""
    from gearfe.fem.reduction.error import mesh_error

    table = record.table("housing_sizes", "size_mm")

    def make(size: float) -> Mapping[str, Any]:
        housing = housing_of(size, small=record.quick)
        body, cost = measured(lambda: reduced(housing), runs=1 if record.quick else 2, most_s=12.0)
        told = float(mesh_error(housing.with_estimate(body), 1.0).frequency_errors[:FREQUENCIES].max())
        found = {f"f{k + 1}_Hz": float(f) for k, f in enumerate(body.coupled.frequencies_hz[:FREQUENCIES])}
        return {"unknowns": housing.unknowns, **cost.columns, "told": told, **found}

    for size in QUICK_SIZES if record.quick else SIZES:
        record.row(table, {"size_mm": size}, partial(make, size))


def frequency_errors(rows: list[dict[str, Any]]) -> list[float]:
    """Largest relative error of the frequencies of each row against the finest elements."""
    finest = max(rows, key=lambda r: r["unknowns"])
    names = [f"f{k + 1}_Hz" for k in range(FREQUENCIES)]
    return [max(abs(r[n] / finest[n] - 1.0) for n in names) for r in rows]


def reductions(record: Record) -> None:
    """Modes and correction levels against the response of the full model, below 5 kHz, at bore 5 along the shaft."""
    table = record.table("housing_reductions", "modes", "levels")
    size = QUICK_SIZES[0] if record.quick else 9.0
    step, steps = 10e-6, 100 if record.quick else 700
    rows, loaded = (12, 7) if record.quick else (36, 25)  # all bores; along the shaft at the last one, at bore 5

    @lru_cache(maxsize=1)
    def truth() -> tuple[Housing, Any]:
        housing = housing_of(size, small=record.quick)
        full = full_model(housing)
        return housing, newmark(
            full.mass, BETA * full.stiffness, full.stiffness, load, step=step, steps=steps, watch=range(rows)
        )

    def load(time: float) -> np.ndarray:
        force = np.zeros(rows)
        force[loaded] = 100.0 * smooth_ramp(time, 1e-3)
        return force

    def make(modes: int, levels: int) -> Mapping[str, Any]:
        housing, right = truth()
        body, cost = measured(lambda: reduced(housing, modes, levels), runs=1 if record.quick else 2, most_s=5.0)
        small = newmark(
            body.mass, BETA * body.stiffness, body.stiffness, load, step=step, steps=steps, watch=range(rows)
        )
        found = []
        for row in range(rows):
            a, b = (below(signal.acceleration[:, row], step, 5000.0) for signal in (right, small))
            found.append(float(np.sqrt(np.mean((a - b) ** 2) / np.mean(a**2))))
        return {"coordinates": body.size, "error": found[loaded], "largest_error": max(found), **cost.columns}

    for modes, levels in QUICK_REDUCTIONS if record.quick else REDUCTIONS:
        record.row(table, {"modes": modes, "levels": levels}, partial(make, modes, levels))


def others(record: Record) -> None:
    """Mesh to 40 modes with clamped bores on the stored mesh: this program, CalculiX, exudyn.

    The truth is this program's full model solved to rounding with the same mass (4-point for CalculiX, exact for the
    others).
    """
    table = record.table("housing_peers", "program", "what")
    count = 10 if record.quick else 40

    @lru_cache(maxsize=2)
    def exact(mass: str) -> np.ndarray:
        body = _body(reference_or_small(record, mass), count + 10)
        return np.asarray(body.internal_hz[:count])

    def ours() -> Mapping[str, Any]:
        housing = reference_or_small(record, "exact")
        body, cost = measured(lambda: reduced(housing, count, 1), runs=1 if record.quick else 3)
        error = float(np.max(np.abs(body.internal_hz[:count] / exact("exact") - 1.0)))
        return {"unknowns": housing.unknowns, "error": error, **cost.columns}

    def calculix() -> Mapping[str, Any]:
        from .peers.calculix import clamped_modes

        housing = reference_or_small(record, "4-point")
        found, spent = clamped_modes(housing, count)
        error = float(np.max(np.abs(found / exact("4-point") - 1.0)))
        used = {"cpu_s": spent.cpu_s, "wall_s": spent.wall_s, "peak_MB": spent.peak_MB, "runs": 1}
        return {"unknowns": housing.unknowns, "error": error, **used}

    def exudyn() -> Mapping[str, Any]:
        answer = run_python("exudyn_housing", {"quick": record.quick, "modes": count}, limit=400.0)
        found = np.array(answer.pop("frequencies_hz"))
        error = float(np.max(np.abs(found / exact("exact") - 1.0)))
        return {"unknowns": reference_or_small(record, "exact").unknowns, "error": error, **answer}

    record.row(table, {"program": "gearfe", "what": "modes, constraint modes, corrections, assembly included"}, ours)
    for name, what, make in (
        ("calculix", "modes only, assembly included", calculix),
        ("exudyn", "modes and constraint modes, matrices given", exudyn),
    ):
        why = missing(name)
        if why:
            record.say(f"  left out: {why}")
        else:
            record.row(table, {"program": name, "what": what}, make)


def reference_or_small(record: Record, mass: str) -> Housing:
    """The stored mesh, or a coarse one of the shipped housing for a smoke run."""
    return small_housing() if record.quick else reference_housing(four_point=mass == "4-point")


def small_housing() -> Housing:
    """The reference's own elements without their midside nodes, for a smoke run."""
    whole = reference_housing(four_point=True)
    return Housing.from_arrays(
        whole.nodes, whole.mesh.cells[:, :4], attachments=whole.attachments, fixed=whole.fixed, material=whole.material
    )


def _body(housing: Housing, modes: int) -> Any:
    return housing.reduce(modes, quasi_static=1)
