"""What is reported of the rolling bearings of a train at its operating point, in the directions of the job file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...base.typing import Array
from ..train.operating import OperatingPoint
from .rolling import SIGNS

#: Components of a load or a displacement in job files.
FORCES, MOMENTS = ("x", "y", "z"), ("x", "z")
#: Name of the table.
FILE = "bearing_stiffness.csv"


def bearing_summary(point: OperatingPoint) -> dict[str, dict[str, Any]]:
    """Bearing -> load, displacement, loaded elements and stiffness matrix, of rolling bearings."""
    summary: dict[str, dict[str, Any]] = {}
    for name, state in point.bearings.items():
        load, moved = SIGNS * state.load, SIGNS * state.displacement
        summary[name] = {
            "force_N": load[:3],
            "moment_Nm": load[3:],
            "displacement_um": 1e6 * moved[:3],
            "tilt_mrad": 1e3 * moved[3:],
            "elements": point.geometry[name].count,
            "loaded_elements": state.loaded,
            "largest_element_load_N": float(state.element_loads.max(initial=0.0)),
            **stiffness_blocks(np.outer(SIGNS, SIGNS) * state.stiffness),
        }
    return summary


def stiffness_blocks(stiffness: Array) -> dict[str, Array]:
    """Blocks of a stiffness (5, 5) by their units: forces and moments by displacements and tilts; it is symmetric."""
    return {
        "force_by_displacement_N_per_m": stiffness[:3, :3],
        "force_by_tilt_N_per_rad": stiffness[:3, 3:],
        "moment_by_displacement_Nm_per_m": stiffness[3:, :3],
        "moment_by_tilt_Nm_per_rad": stiffness[3:, 3:],
    }


def _whole(row: Mapping[str, Any]) -> Array:
    """Stiffness (5, 5) of its blocks."""
    names = list(stiffness_blocks(np.zeros((5, 5))))
    return np.block([[np.asarray(row[name]) for name in names[:2]], [np.asarray(row[name]) for name in names[2:]]])


def bearing_columns(summary: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Columns of ``bearing_stiffness.csv``, a row a bearing."""
    rows = list(summary.values())
    columns: dict[str, Any] = {"bearing": list(summary)}
    for key, axes, unit in (
        ("force", FORCES, "N"), ("moment", MOMENTS, "Nm"), ("displacement", FORCES, "um"), ("tilt", MOMENTS, "mrad"),
    ):  # fmt: skip
        columns |= {f"{key}_{axis}_{unit}": [row[f"{key}_{unit}"][i] for row in rows] for i, axis in enumerate(axes)}
    for key in ("elements", "loaded_elements", "largest_element_load_N"):
        columns[key] = [row[key] for row in rows]
    freedoms = [*FORCES, *(f"tilt_{axis}" for axis in MOMENTS)]
    for i, one in enumerate(freedoms):
        for j, two in enumerate(freedoms[i:], start=i):
            unit = ("N_per_m", "N_per_rad", "Nm_per_rad")[(i > 2) + (j > 2)]
            columns[f"stiffness_{one}_{two}_{unit}"] = [float(_whole(row)[i, j]) for row in rows]
    return columns


def bearing_lines(summary: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Lines for the terminal: load, loaded elements and diagonal stiffness of each rolling bearing."""
    lines = []
    for name, row in summary.items():
        force = ", ".join(f"{x:.4g}" for x in row["force_N"])
        diagonal = np.diag(_whole(row))
        straight, tilting = (", ".join(f"{x:.3g}" for x in part) for part in (1e-6 * diagonal[:3], diagonal[3:]))
        lines.append(
            f"bearing {name}: carries {force} N, {row['loaded_elements']} of {row['elements']} elements loaded; "
            f"stiffness along x, y, z {straight} N/um, for tilt about x, z {tilting} N m/rad"
        )
    return lines
