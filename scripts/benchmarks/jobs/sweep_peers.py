"""One contact position by other programs on a mesh with our flanks: sharp 20/30 pair, 4 deg, 0.05 deg of twist.

Each program is held against itself on its finest mesh (``error``), because they do not solve quite the same equations:
GetFEM and CalculiX take finite strain in full, this program its first-order effect on the torque (``off_converged``
is the
difference from this program's converged value). The other programs' sweep is 40 times their position: they offer
nothing
that one position could leave to the next but a start.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import lru_cache, partial
from typing import Any

from gearfe.gears.gearmesh.sweep import sweep_stiffness

from .peers.process import missing
from .record import Record, Table
from .subject import reference_pair
from .sweep_study import QUICK_REFERENCE, REFERENCE
from .timing import measured

ANGLE, TWIST = math.radians(4.0), math.radians(0.05)
SIZES, QUICK_SIZES = (2.8, 2.0, 1.4), (6.0,)
OUR_SIZES = (2.8, 2.0, 1.4, 1.0, 0.7)
POSITIONS = 40


def run_peers(record: Record) -> None:
    """Rows of this program, CalculiX and GetFEM."""
    table = record.table("sweep_peers", "program", "coarsen")
    ours(record, table)
    for name, make in (("calculix", _calculix), ("getfem", _getfem)):
        why = missing(name)
        if why:
            record.say(f"  left out: {why}")
            continue
        for coarsen in QUICK_SIZES if record.quick else SIZES:
            key = {"program": name, "coarsen": coarsen}
            record.row(table, key, partial(_compared, make, coarsen, record.quick))


def ours(record: Record, table: Table) -> None:
    """One position from gears to torque (meshes from the cache, as the others get them), and a sweep of 40."""
    pair = reference_pair()

    def make(coarsen: float) -> Mapping[str, Any]:
        count = 1 if record.quick else POSITIONS
        angles = [ANGLE + pair.mesh_cycle * k / count for k in range(count)]
        curve, one = measured(lambda: sweep_stiffness(pair, twist=TWIST, angles=[ANGLE], coarsen=coarsen), runs=2)
        _, all_ = measured(lambda: sweep_stiffness(pair, twist=TWIST, angles=angles, coarsen=coarsen), runs=2)
        found = {"k_mesh_N_per_m": float(curve.k_mesh[0]), **one.columns, "sweep_cpu_s": all_.cpu_s}
        return _with_difference(found, record.quick)

    for coarsen in QUICK_SIZES if record.quick else OUR_SIZES:
        record.row(table, {"program": "gearfe", "coarsen": coarsen}, partial(make, coarsen))


@lru_cache(maxsize=2)
def converged(quick: bool) -> float:
    """This program's converged k (N/m)."""
    coarsen = QUICK_REFERENCE if quick else REFERENCE
    return float(sweep_stiffness(reference_pair(), twist=TWIST, angles=[ANGLE], coarsen=coarsen).k_mesh[0])


def _with_difference(found: Mapping[str, Any], quick: bool) -> Mapping[str, Any]:
    return {**found, "off_converged": found["k_mesh_N_per_m"] / converged(quick) - 1.0}


def _compared(make: Callable[[float], Mapping[str, Any]], coarsen: float, quick: bool) -> Mapping[str, Any]:
    return _with_difference(make(coarsen), quick)


def own_errors(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows with ``error``: the difference from the finest row of the same program (this program: from its limit).

    Of another program's finest row no error is known: not-a-number, so that nothing is compared with it.
    """
    made = []
    for row in rows:
        own = [r for r in rows if r["program"] == row["program"]]
        finest = min(own, key=lambda r: r["coarsen"])
        known = row is not finest
        error = abs(row["k_mesh_N_per_m"] / finest["k_mesh_N_per_m"] - 1.0) if known else float("nan")
        made.append({**row, "error": abs(row["off_converged"]) if row["program"] == "gearfe" else error})
    return made


def _calculix(coarsen: float) -> Mapping[str, Any]:
    from .peers.calculix import contact_torque
    from .peers.contact_mesh import contact_task

    task = contact_task(reference_pair(), ANGLE, TWIST, coarsen)
    torque, spent = contact_torque(task)
    return _columns(torque, task, spent, spent.cpu_s, spent.wall_s)


def _getfem(coarsen: float) -> Mapping[str, Any]:
    from .peers.contact_mesh import contact_task
    from .peers.getfem_contact import contact_torque

    task = contact_task(reference_pair(), ANGLE, TWIST, coarsen)
    torque, told, spent = contact_torque(task)
    return _columns(torque, task, spent, told["cpu_s"], told["wall_s"])


def _columns(torque: float, task: Any, spent: Any, cpu: float, wall: float) -> dict[str, Any]:
    return {
        "unknowns": task.unknowns,
        "k_mesh_N_per_m": torque / task.twist / task.base_radius**2,
        "cpu_s": cpu,
        "cpu_median_s": cpu,
        "wall_s": wall,
        "wall_median_s": wall,
        "peak_MB": spent.peak_MB,
        "runs": 1,
        "sweep_cpu_s": POSITIONS * cpu,
    }
