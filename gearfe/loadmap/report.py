"""Report of a load map: the table by torque, the printed lines, the summary, the figure."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from ..gear.derived import derived_geometry
from ..gear.deviation_job import GEARS
from ..gear.validity import overlap_warnings
from ..stiffness.contact_pressure import largest_pressures
from ..stiffness.job import StiffnessJob
from ..stiffness.report import cure_of, pressure_lines
from ..tables.loadmap import LoadMapTable
from ..typing import Array
from ..versions import versions
from .load_map import LoadMap


def torque_table(made: LoadMap) -> dict[str, list[float]]:
    """One row per torque: means over the positions, peak-to-peak transmission error, largest stresses."""
    error = made.quantity("transmission_error")
    table = {
        "torque_Nm": made.torque,
        "k_mesh_mean_N_per_m": made.quantity("k_mesh").mean(axis=1),
        "k_tangent_mean_N_per_m": made.quantity("k_tangent").mean(axis=1),
        "transmission_error_mean_um": 1e6 * error.mean(axis=1),
        "transmission_error_peak_to_peak_um": 1e6 * made.peak_to_peak,
    }
    found = [largest_pressures(curve) for curve in made.curves]
    for name, key in (("peak_pressure_largest_MPa", "path"), ("edge_pressure_largest_MPa", "edge")):
        table[name] = 1e-6 * np.array([one[key] for one in found])
    for name in ("rounded", "singular"):
        table[f"positions_with_{name}_edge"] = np.array([one[name] for one in found])
    if made.root is not None:
        for g, gear in enumerate(GEARS):
            table[f"root_stress_largest_{gear}_MPa"] = 1e-6 * made.root.largest[:, :, g].max(axis=1)
    table["failed_positions"] = made.failed.sum(axis=1)
    return {name: values.tolist() for name, values in table.items()}


def tables(made: LoadMap) -> dict[str, Mapping[str, Any]]:
    """All tables of a map, the main one first."""
    return {"loadmap": made.columns(), "torques": torque_table(made)}


def summary(job: StiffnessJob, table: LoadMapTable, made: LoadMap, timings: Mapping[str, float]) -> dict[str, Any]:
    """Content of loadmap.json."""
    return {
        "job": {**job.tables, "loadmap": asdict(table)},
        "versions": versions(),
        "derived_geometry": derived_geometry(job.pair),
        "warnings": list(job.pair.warnings),
        "by_torque": torque_table(made),
        "root_stress_error_estimate": None if made.root is None else _largest(made.root.error),
        "statuses": dict(Counter(map(str, made.status.ravel()))),
        "timings_s": dict(timings),
    }


def _largest(values: Array) -> float:
    return float(np.nanmax(values)) if np.isfinite(values).any() else float("nan")


def report_lines(made: LoadMap) -> list[str]:
    """Lines to print."""
    count = Counter(map(str, made.status.ravel()))
    statuses = ", ".join(f"{n} {status}" for status, n in count.items())
    lines = [f"{len(made.torque)} torques x {len(made.pinion_angle)} positions: {statuses}"]
    for row in sorted({0, len(made.torque) // 2, len(made.torque) - 1}):
        curve = made.curves[row]
        line = (
            f"at {made.torque[row]:.4g} N m: mean stiffness {1e-6 * curve.k_mesh.mean():.4g} N/um, transmission error "
            f"{1e6 * curve.transmission_error.mean():.4g} um with {1e6 * made.peak_to_peak[row]:.3g} um peak to peak"
        )
        if made.root is not None:
            pinion, wheel = 1e-6 * made.root.largest[row].max(axis=0)
            line += f", root stress {pinion:.4g} MPa (pinion), {wheel:.4g} MPa (wheel)"
        lines += [line, *("  " + one for one in pressure_lines(curve))]
    if made.root is not None:
        lines.append(f"root stress: estimated error at worst {100 * _largest(made.root.error):.2g} %")
    return lines


def warnings(job: StiffnessJob, made: LoadMap) -> list[str]:
    """Sentences about what deserves a look."""
    said = list(job.pair.warnings)
    said += overlap_warnings(job.pair, made.quantity("twist"), made.quantity("beyond_validity"))
    if made.failed.any():
        rows = np.flatnonzero(made.failed.any(axis=1))
        torques = ", ".join(f"{made.torque[row]:.4g}" for row in rows[:6]) + (" ..." if len(rows) > 6 else "")
        said.append(
            f"{int(made.failed.sum())} cells failed and have no numbers, only their status (torques {torques} N m): "
            + cure_of(made.status[made.failed])
        )
    return said
