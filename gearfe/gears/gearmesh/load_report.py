"""Report of a load map: its tables, the printed lines, the summary."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from ...base.cache import versions
from ...base.errors import given
from ...base.shown import percent
from ...base.tables.loadmap import LoadMapTable
from ...base.typing import Array
from ..geometry import pitch_errors
from ..geometry.derived import derived_geometry
from ..geometry.deviation_job import GEARS
from ..geometry.validity import overlap_warnings
from .curve import EDGES
from .job import StiffnessJob
from .load_map import BACK, LoadMap
from .report import cure_of, largest_pressures, pressure_lines

#: Harmonics of the mesh order in the table by torque.
HARMONICS = 5


def torque_table(made: LoadMap) -> dict[str, list[float]]:
    """One row per torque: means over the positions, transmission error and its mesh orders, largest stresses."""
    error = made.quantity("transmission_error")
    table = {
        "torque_Nm": made.torque,
        "k_mesh_mean_N_per_m": made.quantity("k_mesh").mean(axis=1),
        "k_tangent_mean_N_per_m": made.quantity("k_tangent").mean(axis=1),
        "transmission_error_mean_um": 1e6 * error.mean(axis=1),
        "transmission_error_peak_to_peak_um": 1e6 * made.peak_to_peak,
    }
    if made.mesh_cycles:
        order, amplitude = made.spectrum()
        for h in range(1, HARMONICS + 1):
            if h * made.mesh_cycles < len(order):
                table[f"mesh_order_{h}_um"] = 1e6 * amplitude[:, h * made.mesh_cycles]
    found = [largest_pressures(curve) for curve in made.curves]
    for name, key in (
        ("peak_pressure_largest_MPa", "largest_hertzian_MPa"),
        ("edge_pressure_largest_MPa", "largest_at_edges_MPa"),
        ("positions_with_rounded_edge", "positions_with_a_rounded_edge_bearing"),
        ("positions_with_singular_edge", "positions_with_a_singular_edge_bearing"),
    ):
        table[name] = np.array([one[key] for one in found])
    if made.root is not None:
        for g, gear in enumerate(GEARS):
            table[f"root_stress_largest_{gear}_MPa"] = 1e-6 * made.root.largest[:, :, g].max(axis=1)
    table["failed_positions"] = made.failed.sum(axis=1)
    return {name: values.tolist() for name, values in table.items()}


def pair_table(made: LoadMap) -> dict[str, Array]:
    """A row for each loaded tooth pair: the pressure along the path of contact."""

    def column(name: str) -> Array:
        return np.concatenate([getattr(one, name) for one in made.pairs])

    pair, roll, gears = column("pair"), column("roll"), given(made.pair, "pair")
    return {
        "torque_Nm": np.repeat(made.torque, [len(one.pair) for one in made.pairs]),
        "pinion_angle_deg": np.degrees(made.pinion_angle)[column("position")],
        "pinion_tooth": pair % gears.pinion.teeth,
        "wheel_tooth": (-1 - pair) % gears.wheel.teeth,
        "roll_length_pinion_mm": 1e3 * roll[:, 0],
        "roll_length_wheel_mm": 1e3 * roll[:, 1],
        "force_N": column("force"),
        "load_share": column("share"),
        "half_width_um": 1e6 * column("half_width"),
        "pressure_MPa": 1e-6 * column("pressure"),
        "edge": np.array(EDGES)[column("edge")],
    }


def order_table(made: LoadMap) -> dict[str, Array]:
    """Amplitudes of the transmission error by orders of the pinion's turn."""
    order, free = made.spectrum(unloaded=True)
    _, loaded = made.spectrum()
    table = {"order": order, "unloaded_um": 1e6 * free}
    return table | {f"at_{torque:.6g}_Nm_um": 1e6 * row for torque, row in zip(made.torque, loaded, strict=True)}


def tables(made: LoadMap) -> dict[str, Mapping[str, Any]]:
    """All tables of a computed map, the main one first."""
    torques, pairs, orders = torque_table(made), pair_table(made), order_table(made)
    return {"loadmap": made.columns(), "torques": torques, "pairs": pairs, "orders": orders}


def summary(job: StiffnessJob, table: LoadMapTable, made: LoadMap, timings: Mapping[str, float]) -> dict[str, Any]:
    """Return the content of loadmap.json.

    Parameters
    ----------
    job : StiffnessJob
        The gears and the model.
    table : LoadMapTable
        The keys of the map.
    made : LoadMap
        The map.
    timings : mapping
        Name -> time that a part of the work took (s).
    """
    return {
        "job": {**job.tables, table.NAME: asdict(table)},
        "versions": versions(),
        "derived_geometry": derived_geometry(job.pair),
        "warnings": list(job.pair.warnings),
        "mesh_cycles": made.mesh_cycles,
        "transmission_error_unloaded_peak_to_peak_um": 1e6 * float(np.ptp(made.transmission_error_unloaded)),
        "by_torque": torque_table(made),
        "root_stress_error_estimate": None if made.root is None else _largest(made.root.error),
        **_deviations(job),
        "statuses": made.statuses,
        "timings_s": dict(timings),
    }


def _deviations(job: StiffnessJob) -> dict[str, Any]:
    """Pitch deviations of the driving flanks, and the tolerances of the class, where there is one."""
    if not job.mesh.deviates:
        return {}
    class_, made, allowed = job.mesh.tolerance_class, {}, {}
    for name, own in zip(GEARS, job.deviations, strict=True):
        gear = getattr(job.pair, name)
        index = np.array(own.turn) * gear.reference_radius
        made[name] = {
            "single_pitch_deviation_um": 1e6 * float(np.abs(pitch_errors.single_of(index)).max()),
            "cumulative_pitch_deviation_um": 1e6 * float(np.ptp(index)),
        }
        if class_ is not None:
            allowed[name] = pitch_errors.tolerances(gear, class_).rounded_um
    return {"pitch": made, "tolerances_um": allowed or None}


def _largest(values: Array) -> float:
    return float(np.nanmax(values)) if np.isfinite(values).any() else float("nan")


def report_lines(made: LoadMap) -> list[str]:
    """Lines to print."""
    statuses = ", ".join(f"{n} {status}" for status, n in made.statuses.items())
    unloaded = 1e6 * float(np.ptp(made.transmission_error_unloaded))
    m, n = made.failed.shape
    lines = [f"{m} torques x {n} positions over {made.span}: {statuses}"]
    lines.append(f"unloaded transmission error {unloaded:.4g} um peak to peak")
    for row in sorted({0, m // 2, m - 1}):
        curve = made.curves[row]
        if curve.failed.any():
            lines.append(f"at {made.torque[row]:.4g} N m: {curve.failed.sum()} of {n} positions have no numbers")
            continue
        line = (
            f"at {made.torque[row]:.4g} N m: mean stiffness {1e-6 * curve.k_mesh.mean():.4g} N/um, transmission error "
            f"{1e6 * curve.transmission_error.mean():.4g} um with {1e6 * made.peak_to_peak[row]:.3g} um peak to peak"
        )
        if made.root is not None:
            pinion, wheel = 1e-6 * made.root.largest[row].max(axis=0)
            line += f", root stress {pinion:.4g} MPa (pinion), {wheel:.4g} MPa (wheel)"
        lines += [line, *("  " + one for one in pressure_lines(curve))]
    best = int(np.argmin(np.where(np.isfinite(made.peak_to_peak), made.peak_to_peak, np.inf)))
    if m > 2 and np.isfinite(made.peak_to_peak[best]):
        lines.append(f"least peak-to-peak error: {1e6 * made.peak_to_peak[best]:.3g} um at {made.torque[best]:.4g} N m")
    if made.root is not None:
        lines.append(f"root stress: estimated error at worst {percent(_largest(made.root.error))}")
    return lines


def warnings(job: StiffnessJob, made: LoadMap) -> list[str]:
    """Sentences about what deserves a look."""
    said = list(job.pair.warnings)
    said += overlap_warnings(job.pair, made.quantity("twist"), made.quantity("beyond_validity"))
    room, jammed = made.back_clearance, made.status == BACK
    if room is not None and jammed.any():
        i, j = np.unravel_index(int(np.nanargmin(room)), room.shape)
        where = f"{made.torque[i]:.4g} N m and {np.degrees(made.pinion_angle[j]):.4g} deg"
        said.append(
            f"{int(jammed.sum())} cells have no numbers, for the back flanks would bear, too: they overlap by up to "
            f"{-1e6 * room[i, j]:.3g} um (at {where}), more material stands out than "
            f"{1e6 * job.pair.normal_backlash:.3g} um of backlash leave room for; thin the teeth (tooth_thinning_um)"
        )
    lost = made.failed & ~jammed
    if lost.any():
        rows = np.flatnonzero(lost.any(axis=1))
        torques = ", ".join(f"{made.torque[row]:.4g}" for row in rows[:6]) + (" ..." if len(rows) > 6 else "")
        said.append(
            f"{int(lost.sum())} cells failed and have no numbers, only their status (torques {torques} N m): "
            + cure_of(made.status[lost])
        )
    return said
