"""Mesh stiffness: time against error of element sizes and laws; whole gears; stages, positions, loads.

Errors are those of k_mesh against a converged run: the same positions on a far finer mesh (``REFERENCE``), by Nitsche's
law. Where its elements do not resolve the contact, the half-plane law on that mesh is what there is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import lru_cache, partial
from typing import Any

import numpy as np

from gearfe.base.tables.pair import DEFAULT_LAW, LAWS
from gearfe.gears.contact.laws import DEFAULT_MODEL
from gearfe.gears.gearmesh.curve import StiffnessCurve
from gearfe.gears.gearmesh.sweep import elastic_pair, sweep_stiffness
from gearfe.gears.geometry.pair import GearPair
from gearfe.gears.teeth.tooth_sector import sector_mesh, sector_recipes

from .record import Record
from .subject import off_changes, shipped_pair
from .timing import measured

#: `coarsen` of the converged run, and the sizes that are measured.
REFERENCE, QUICK_REFERENCE = 0.35, 1.4
SIZES, QUICK_SIZES = (2.8, 2.0, 1.4, 1.0, 0.7, 0.5), (2.8, 2.0)
#: Numbers of distinct positions in one mesh cycle.
POSITIONS, QUICK_POSITIONS = (18, 40, 400, 4000), (3, 6)
#: Twists (deg).
TWISTS, QUICK_TWISTS = (1e-3, 2e-3, 5e-3, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5), (0.05, 0.2)
#: `coarsen` and positions of the whole gears; their time is that of so few positions.
WHOLE_SIZES, QUICK_WHOLE_SIZES = (2.8, 2.0), ()
WHOLE_ANGLES = (4.0,)
TWIST = math.radians(0.05)


def run_sweep(record: Record) -> None:
    """All tables of the sweep."""
    sizes(record)
    verification(record)
    stages(record)
    positions(record)
    twists(record)
    kinematics(record)
    if record.peers:
        from .sweep_peers import run_peers

        run_peers(record)


def angles(record: Record) -> np.ndarray:
    """The 40 positions of the shipped job, 1..40 deg (rad)."""
    return np.radians(np.array([4.0, 9.0, 12.0]) if record.quick else np.arange(1.0, 41.0))


@lru_cache(maxsize=32)
def converged(quick: bool, twist: float, finite: bool, at: tuple[float, ...], law: str = "nitsche") -> StiffnessCurve:
    """The converged curve at the pinion angles `at` (rad)."""
    return sweep_stiffness(
        shipped_pair(),
        twist=twist,
        angles=np.array(at),
        law=law,
        coarsen=QUICK_REFERENCE if quick else REFERENCE,
        kinematics="finite" if finite else "small",
    )


def errors(pair: GearPair, curve: StiffnessCurve, truth: StiffnessCurve) -> dict[str, Any]:
    """Largest relative errors on the path and anywhere (-), and positions that did not converge."""
    off = np.abs(curve.k_mesh / truth.k_mesh - 1.0)
    path = off_changes(pair, curve.pinion_angle, math.radians(1.6))
    return {
        "error": _largest(off),
        "error_on_path": _largest(off[path]),
        "not_converged": int(np.sum(np.asarray(curve.status) != "converged")),
    }


def _largest(values: np.ndarray) -> float:
    known = values[np.isfinite(values)]
    return float(known.max()) if known.size else float("nan")


def sizes(record: Record) -> None:
    """Element size x contact law, 40 positions, 0.05 deg; meshes from the cache, the mesher's seconds beside."""
    table, pair, at = record.table("sweep_sizes", "law", "coarsen"), shipped_pair(), angles(record)

    def make(law: str, coarsen: float) -> Mapping[str, Any]:
        factor = DEFAULT_MODEL.changed(law=law, coarsen=coarsen).mesh_flank_coarsen
        recipes = sector_recipes(pair, coarsen=coarsen, flank_coarsen=factor)

        def mesh() -> None:
            for gear, recipe in zip((pair.pinion, pair.wheel), recipes, strict=True):
                sector_mesh(gear, recipe, cache=False)

        def sweep() -> StiffnessCurve:
            return sweep_stiffness(pair, twist=TWIST, angles=at, law=law, coarsen=coarsen)

        sweep()  # fills the mesh cache
        curve, cost = measured(sweep, runs=1 if record.quick else 3)
        _, mesher = measured(mesh, runs=1 if record.quick else 3)
        flank = 1e3 * recipes[0].flank
        found = errors(pair, curve, converged(record.quick, TWIST, True, tuple(at)))
        return {"flank_mm": flank, "positions": len(at), **found, **cost.columns, "meshing_cpu_s": mesher.cpu_s}

    for law in LAWS:
        for coarsen in QUICK_SIZES if record.quick else SIZES:
            record.row(table, {"law": law, "coarsen": coarsen}, partial(make, law, coarsen))


def verification(record: Record) -> None:
    """Condensed gears against whole gears, small strain: a position each, set-up and solution apart."""
    table, pair = record.table("sweep_verification", "model", "coarsen"), shipped_pair()
    at = tuple(np.radians(WHOLE_ANGLES[:1] if record.quick else WHOLE_ANGLES))

    def condensed(law: str, coarsen: float) -> Mapping[str, Any]:
        elastic, setup = measured(lambda: elastic_pair(pair, law=law, coarsen=coarsen), runs=1)
        curve, cost = measured(
            lambda: sweep_stiffness(pair, twist=TWIST, angles=at, kinematics="small", elastic=elastic), runs=1
        )
        found = errors(pair, curve, converged(record.quick, TWIST, False, at))
        return {"error": found["error"], "setup_cpu_s": setup.cpu_s, "position_cpu_s": cost.cpu_s / len(at)}

    def whole(coarsen: float) -> Mapping[str, Any]:
        from gearfe.gears.contact.laws import Nitsche
        from gearfe.gears.contact.whole_gears.position import solve_position

        gears, setup = measured(lambda: assembled_pair(pair, coarsen), runs=1)
        solved, cost = measured(lambda: [solve_position(gears, Nitsche(), a, TWIST) for a in at], runs=1)
        torque = np.array([position.torque_wheel for position in solved])
        truth = converged(record.quick, TWIST, False, at)
        error = float(np.max(np.abs(torque / truth.torque_wheel - 1.0)))
        return {"error": error, "setup_cpu_s": setup.cpu_s, "position_cpu_s": cost.cpu_s / len(at)}

    models: dict[str, Callable[[float], Mapping[str, Any]]] = {
        f"condensed gears, {law}": partial(condensed, law) for law in ("half_plane", "nitsche")
    }
    for coarsen in QUICK_WHOLE_SIZES if record.quick else WHOLE_SIZES:
        for name, make in {**models, "whole gears, nitsche": whole}.items():
            record.row(table, {"model": name, "coarsen": coarsen}, partial(make, coarsen))


def assembled_pair(pair: GearPair, coarsen: float) -> Any:
    """Both whole gears (plane strain, steel)."""
    from gearfe.gears.contact.laws import Nitsche, PairModel
    from gearfe.gears.contact.whole_gears.pair import whole_pair

    return whole_pair(pair, PairModel(law=Nitsche(), coarsen=coarsen))


def stages(record: Record) -> None:
    """Where the time of a default sweep goes."""
    table, pair, at = record.table("sweep_stages", "stage"), shipped_pair(), angles(record)
    coarsen = QUICK_SIZES[0] if record.quick else 1.0
    names = ("meshes", "condensation", "unloaded flanks", "positions")
    if all(table.find({"stage": name}) for name in names):
        return
    best: dict[str, float] = {}
    for _ in range(1 if record.quick else 5):
        curve = sweep_stiffness(pair, twist=TWIST, angles=at, coarsen=coarsen)
        for name, seconds in curve.timings.items():
            best[name] = min(seconds, best.get(name, math.inf))
    for name in names:
        record.row(table, {"stage": name}, partial(dict, wall_s=best.get(name, 0.0)))


def positions(record: Record) -> None:
    """Seconds against the number of distinct positions in one mesh cycle, with their exponent."""
    table, pair = record.table("sweep_positions", "positions"), shipped_pair()
    elastic = None
    for count in QUICK_POSITIONS if record.quick else POSITIONS:
        if table.find({"positions": count}) is not None:
            continue
        elastic = elastic or elastic_pair(pair, coarsen=QUICK_SIZES[0] if record.quick else 1.0)
        at = pair.mesh_cycle * np.arange(count) / count

        def make(at: np.ndarray = at, elastic: Any = elastic) -> Mapping[str, Any]:
            curve, cost = measured(
                lambda: sweep_stiffness(pair, twist=TWIST, angles=at, elastic=elastic), runs=3, most_s=10.0
            )
            lost = int(np.sum(np.asarray(curve.status) != "converged"))
            return {**cost.columns, "ms_each": 1e3 * cost.cpu_s / len(at), "not_converged": lost}

        record.row(table, {"positions": count}, make)


def twists(record: Record) -> None:
    """Time and error of the default settings from small to large loads, 18 positions."""
    table, pair = record.table("sweep_twists", "twist_deg"), shipped_pair()
    at = np.radians([4.0, 12.0]) if record.quick else np.radians(np.arange(18.0))
    coarsen = QUICK_SIZES[1] if record.quick else 1.0

    def make(twist: float) -> Mapping[str, Any]:
        curve, cost = measured(
            lambda: sweep_stiffness(pair, twist=twist, angles=at, coarsen=coarsen), runs=1 if record.quick else 2
        )
        found = errors(pair, curve, converged(record.quick, twist, True, tuple(at), DEFAULT_LAW))
        elements = np.abs(curve.k_mesh / converged(record.quick, twist, True, tuple(at)).k_mesh - 1.0)
        found |= {"resolved": int(np.isfinite(elements).sum()), "from_elements": _largest(elements)}
        return {**found, **cost.columns, "iterations": float(np.mean(curve.iterations))}

    for twist in QUICK_TWISTS if record.quick else TWISTS:
        record.row(table, {"twist_deg": twist}, partial(make, math.radians(twist)))


def kinematics(record: Record) -> None:
    """Small strain against the first-order effect of finite strain: cost, and what it changes."""
    table, pair, at = record.table("sweep_kinematics", "kinematics", "twist_deg"), shipped_pair(), angles(record)
    coarsen = QUICK_SIZES[1] if record.quick else 1.0
    base: dict[float, StiffnessCurve] = {}

    def make(name: Any, twist: float) -> Mapping[str, Any]:
        curve, cost = measured(
            lambda: sweep_stiffness(pair, twist=twist, angles=at, coarsen=coarsen, kinematics=name),
            runs=1 if record.quick else 3,
        )
        if name == "small":
            base[twist] = curve
        elif twist not in base:
            base[twist] = sweep_stiffness(pair, twist=twist, angles=at, coarsen=coarsen, kinematics="small")
        change = curve.k_mesh / base[twist].k_mesh - 1.0
        return {"smallest_change": float(np.nanmin(change)), "largest_change": float(np.nanmax(change)), **cost.columns}

    for twist in (0.05,) if record.quick else (0.05, 0.5):
        for name in ("small", "finite"):
            key = {"kinematics": name, "twist_deg": twist}
            record.row(table, key, partial(make, name, math.radians(twist)))
