"""Elastic shafts, misaligned gears and torques over speed in the reports of transients and of run-ups."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..train.misalignment import PARTS, MeshMisalignment, misalignments
from ..train.model import TrainModel
from .over_speed import operating_speed

#: Tilts and displacements (rad, m) below which nothing yields: a rigid train in hinges of a rigid housing.
STILL = 1e-12
#: Misalignments (um) below which only rounding is left.
ROUND_OFF = 1e-6


def shaft_entries(model: TrainModel) -> dict[str, Any]:
    """Entries of the summary: elastic shafts, and the misalignment of each mesh where something yields."""
    shafts = zip(model.train.shafts, model.shafts, strict=True)
    entries = {shaft.name: facts for shaft, body in shafts if (facts := body.elastic_facts())}
    meshes = {
        tilted.mesh: {
            "mesh_force_N": tilted.force,
            "common_face_width_mm": 1e3 * tilted.width,
            "f_sh_um": 1e6 * tilted.f_sh,
            **{f"f_sh_by_{part}_um": 1e6 * x * tilted.width for part, x in _parts(tilted.in_plane_parts)},
            "tilt_in_plane_urad": 1e6 * tilted.in_plane,
            "tilt_across_urad": 1e6 * tilted.across,
            "across_um": 1e6 * tilted.across * tilted.width,
            "apart_um": 1e6 * tilted.apart,
        }
        for tilted in yielding(model)
    }
    found = {"elastic_shafts": entries, "misalignment": meshes, "operating_point": _operating_point(model)}
    return {name: entry for name, entry in found.items() if entry}


def _operating_point(model: TrainModel) -> dict[str, Any]:
    """Speed of the drive, and the torques over speed there; empty for a train without any."""
    train, speed = model.train, operating_speed(model.train)
    if speed is None:
        return {}
    torques = {"drive": train.driven.over_speed} | {
        f"load_{number}": load.over_speed for number, load in enumerate(train.loads, start=1)
    }
    known = {name: over for name, over in torques.items() if over is not None}
    return {
        "drive_speed_rad_per_s": speed,
        "torques_over_speed_Nm": {name: over.steady for name, over in known.items()},
        "torque_slopes_Nm_s_per_rad": {name: over.slope for name, over in known.items()},
    }


def yielding(model: TrainModel) -> tuple[MeshMisalignment, ...]:
    """Misalignment of each mesh; none in a train where nothing yields."""
    tilted = misalignments(model)
    most = max((max(abs(x.in_plane), abs(x.across), abs(x.apart)) for x in tilted), default=0.0)
    return tilted if most > STILL else ()


def misalignment_columns(tilted: tuple[MeshMisalignment, ...]) -> dict[str, Any]:
    """Columns of misalignment.csv, a row for each mesh."""
    width = np.array([x.width for x in tilted])
    columns: dict[str, Any] = {
        "mesh": [x.mesh for x in tilted],
        "mesh_force_N": np.array([x.force for x in tilted]),
        "common_face_width_mm": 1e3 * width,
    }
    for name, factor, whole, parts in (
        ("f_sh", 1e6 * width, [x.in_plane for x in tilted], [x.in_plane_parts for x in tilted]),
        ("across", 1e6 * width, [x.across for x in tilted], [x.across_parts for x in tilted]),
        ("apart", np.full(len(width), 1e6), [x.apart for x in tilted], [x.apart_parts for x in tilted]),
    ):
        columns[f"{name}_um"] = factor * np.array(whole)
        columns |= {f"{name}_by_{part}_um": factor * values for part, values in _parts(np.array(parts).T)}
    columns["tilt_in_plane_urad"] = 1e6 * np.array([x.in_plane for x in tilted])
    columns["tilt_across_urad"] = 1e6 * np.array([x.across for x in tilted])
    for gear in ("driver", "driven"):
        tilts = 1e6 * np.array([getattr(x, f"{gear}_tilt") for x in tilted])
        columns |= {f"tilt_{gear}_about_{axis}_urad": tilts[:, k] for k, axis in enumerate("xyz")}
    return columns


def shaft_lines(summary: Mapping[str, Any]) -> list[str]:
    """Lines for the terminal from the entries of the summary."""
    lines = []
    for name, shaft in summary.get("elastic_shafts", {}).items():
        frequencies = ", ".join(f"{frequency:.0f}" for frequency in shaft["own_frequencies_Hz"][:4])
        modes = f"no free mode below {shaft['highest_frequency_Hz']:.0f} Hz"
        if frequencies:
            modes = f"free modes {frequencies} Hz, errors up to {shaft['largest_frequency_error']:.1g}"
        lines.append(
            f"shaft {name}: elastic, {shaft['elements']} elements, {shaft['coordinates']} coordinates; {modes}"
        )
    if point := summary.get("operating_point"):
        torques = ", ".join(f"{name} {torque:.4g} N m" for name, torque in point["torques_over_speed_Nm"].items())
        lines.append(
            f"operating point: drive at {point['drive_speed_rad_per_s']:.6g} rad/s; torque over speed {torques}"
        )
    for name, mesh in summary.get("misalignment", {}).items():
        parts = ", ".join(f"{part} {_shown(mesh[f'f_sh_by_{part}_um'])}" for part in PARTS)
        lines.append(
            f"mesh {name}: misalignment in the plane of action, f_sh: "
            f"{_shown(mesh['f_sh_um'])} um over {mesh['common_face_width_mm']:.4g} mm "
            f"({parts}), across the plane of action {_shown(mesh['across_um'])} um"
        )
    return lines


def _shown(value: float) -> str:
    """A misalignment (um); round-off is 0."""
    return f"{value if abs(value) >= ROUND_OFF else 0.0:.3g}"


def _parts(values: Any) -> zip[tuple[str, Any]]:
    return zip(PARTS, values, strict=True)
