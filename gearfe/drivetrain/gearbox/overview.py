"""Tables at the head of a report: speeds and torques of the meshes, their safety factors, forces of the bearings."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...base.tables.jobs import train_tables, whole_gearbox
from ...base.tables.train import TrainTable
from ...output.exchange.rexs.results import gear_data
from ...output.report_page import Sheet
from .rexs_results import rexs_results

#: Turns per minute of one radian per second.
RPM = 30.0 / math.pi


def overview_sheets(job: str | Path, raw: Mapping[str, Any]) -> list[Sheet]:
    """Return tables of the loads of a job in steady running; none for jobs without gears by name.

    Parameters
    ----------
    job
        The job file.
    raw
        Its parsed tables.

    Raises
    ------
    InputError
        For mistakes in the gears and meshes of the job.
    """
    if "train" not in raw:
        return []
    known = rexs_results(job)
    values = {(item.table, item.name, item.attribute): item.value for item in known.results}
    meshes = {
        name: (mesh.driver.name, mesh.driven.name) for name, mesh in whole_gearbox(dict(raw), str(job)).meshes.items()
    }
    sheets = [_meshes(meshes, raw.get("rating", {}).get("edition", 2019), values)]
    if any(item.table == "bearings" for item in known.results):  # a rating that fails leaves the statics
        sheets.append(_bearings(train_tables(dict(raw), str(job))["train"], values))
    notes = Sheet("", (), (), "; ".join(known.notes))
    return [sheet for sheet in sheets if sheet.rows] + ([notes] if known.notes else [])


def _meshes(meshes: Mapping[str, tuple[str, str]], edition: int, values: Mapping[tuple[str, str, str], Any]) -> Sheet:
    """A row for each gear in each mesh."""
    rows = []
    for name, gears in meshes.items():
        force = values.get(("meshes", name, "nominal_tangential_force_at_reference_diameter"), math.nan)
        for gear in gears:
            of_gear = {key: value for (_, where, key), value in values.items() if where == gear_data(name, gear)}
            cells = (
                RPM * values.get(("gears", gear, "rotational_speed"), math.nan),
                of_gear.get("torque", math.nan),
                1e-3 * of_gear.get("power_for_rotational_speed", math.nan),
                force,
                of_gear.get(f"safety_factor_pitting_iso_6336_{edition}", math.nan),
                of_gear.get(f"safety_factor_tooth_root_iso_6336_{edition}", math.nan),
            )
            rows.append([f"{name}: {gear}", *map(_text, cells)])
    head = ["mesh: gear", "speed (1/min)", "torque on it (N m)", "power into it (kW)", "F_t (N)", "S_H", "S_F"]
    note = "without losses; power is > 0 where the mesh drives the gear"
    rows = [row for row in rows if row[1] != "-"]
    if all(cell == "-" for row in rows for cell in row[-2:]):  # not rated
        return Sheet("Loads in steady running", head[:-2], [row[:-2] for row in rows], note)
    note += f"; S_H, S_F: ISO 6336:{edition}, method B"
    return Sheet("Loads in steady running", head, rows, note)


def _bearings(train: TrainTable, values: Mapping[tuple[str, str, str], Any]) -> Sheet:
    """A row for each bearing."""
    given = {str(bearing.attachment): bearing for bearing in train.bearings}
    rows = []
    for shaft in train.shafts:
        speed = RPM * values.get(("shafts", shaft.name, "rotational_speed"), math.nan)
        for name in map(str, shaft.attachments):
            u, v, w = (
                values.get(("bearings", name, f"force_acting_on_outer_component_{axis}"), math.nan) for axis in "uvw"
            )
            bearing = given.get(name)
            kind = "rigid" if bearing is None else (bearing.type or "springs").replace("_", " ")
            rows.append([name, shaft.name, kind, _text(speed), _text(math.hypot(v, w)), _text(u)])
    head = ("bearing", "shaft", "kind", "speed (1/min)", "radial force (N)", "axial force (N)")
    note = "of the shaft on the bearing; housing rigid, mean mesh stiffness of ISO 6336-1, without weights"
    return Sheet("Bearing forces in steady running", head, [row for row in rows if row[-1] != "-"], note)


def _text(value: float) -> str:
    if not math.isfinite(value):
        return "-"
    return "0" if abs(value) < 1e-6 else f"{value:.5g}"
