"""Report of a loaded pair with deviations: tables, printed lines, the summary."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from ..contact.laws import HalfPlane
from ..gear import pitch_errors
from ..gear.deviation import ToothDeviations
from ..gear.deviation_job import GEARS
from ..gear.pair import GearPair
from ..gear.validity import overlap_warnings
from ..stiffness.job import StiffnessJob
from ..tables.microgeometry import MicrogeometryTable
from ..typing import Array
from ..versions import versions
from .loaded_mesh import BACK, LoadedMesh

#: Harmonics of the mesh order in the table by torque.
HARMONICS = 5


def cell_table(made: LoadedMesh) -> dict[str, Array]:
    """A row for each torque and pinion angle."""
    m, n = made.twist.shape
    leading, shares = made.load_share()
    pressure, edge = made.largest_pressure()
    radius = made.pair.wheel.base_radius
    angle = np.tile(made.pinion_angle, m)
    table = {
        "torque_Nm": np.repeat(made.torque, n),
        "pinion_angle_deg": np.degrees(angle),
        "wheel_angle_deg": np.degrees(-angle / made.pair.gear_ratio + made.pair.contact_twist + made.twist.ravel()),
        "twist_deg": np.degrees(made.twist.ravel()),
        "transmission_error_um": 1e6 * made.transmission_error.ravel(),
        "transmission_error_unloaded_um": np.tile(1e6 * made.transmission_error_unloaded, m),
        "torque_pinion_Nm": made.torque_pinion.ravel(),
        "k_tangent_N_per_m": made.tangent.ravel() / radius**2,
        "leading_pair": np.tile(leading, m),
    }
    for j in range(shares.shape[2]):
        table[f"load_share_{j + 1}"] = shares[:, :, j].ravel()
    table |= {"peak_pressure_MPa": 1e-6 * pressure.ravel(), "edge_pressure_MPa": 1e-6 * edge.ravel()}
    if made.twist_unloaded_back is not None and made.back_clearance is not None:
        table["transmission_error_unloaded_back_um"] = np.tile(1e6 * radius * made.twist_unloaded_back, m)
        table["back_clearance_um"] = 1e6 * made.back_clearance.ravel()
    if made.root_stress is not None:
        for g, gear in enumerate(GEARS):
            table[f"root_stress_{gear}_MPa"] = 1e-6 * made.root_stress[:, :, g].ravel()
    return {**table, "beyond_validity": made.beyond_validity.ravel(), "status": made.status.ravel()}


def pair_table(made: LoadedMesh) -> dict[str, Array]:
    """A row for each loaded tooth pair: the pressure along the path of contact."""
    own, pair = made.pairs, made.pair
    return {
        "torque_Nm": made.torque[own.torque],
        "pinion_angle_deg": np.degrees(made.pinion_angle[own.angle]),
        "pinion_tooth": own.pair % pair.pinion.teeth,
        "wheel_tooth": (-1 - own.pair) % pair.wheel.teeth,
        "roll_length_pinion_mm": 1e3 * own.roll[:, 0],
        "roll_length_wheel_mm": 1e3 * own.roll[:, 1],
        "force_N": own.force,
        "load_share": own.share,
        "half_width_um": 1e6 * own.half_width,
        "pressure_MPa": 1e-6 * own.pressure,
        "edge": np.where(own.mark == "", "none", own.mark),
    }


def order_table(made: LoadedMesh) -> dict[str, Array]:
    """Amplitudes of the transmission error by orders of the pinion's turn."""
    order, free = made.spectrum(unloaded=True)
    _, loaded = made.spectrum()
    table = {"order": order, "unloaded_um": 1e6 * free}
    return table | {f"at_{torque:.6g}_Nm_um": 1e6 * row for torque, row in zip(made.torque, loaded, strict=True)}


def torque_table(made: LoadedMesh) -> dict[str, Array]:
    """A row for each torque."""
    error = 1e6 * made.transmission_error
    order, amplitude = made.spectrum()
    pressure, edge = made.largest_pressure()
    table = {
        "torque_Nm": made.torque,
        "transmission_error_mean_um": error.mean(axis=1),
        "transmission_error_peak_to_peak_um": np.ptp(error, axis=1),
    }
    for h in range(1, HARMONICS + 1):
        at = h * made.mesh_cycles
        if at < len(order):
            table[f"mesh_order_{h}_um"] = 1e6 * amplitude[:, at]
    table["k_tangent_mean_N_per_m"] = made.tangent.mean(axis=1) / made.pair.wheel.base_radius**2
    table["peak_pressure_largest_MPa"] = _largest(1e-6 * pressure)
    table["edge_pressure_largest_MPa"] = _largest(1e-6 * edge)
    if made.root_stress is not None:
        for g, gear in enumerate(GEARS):
            table[f"root_stress_largest_{gear}_MPa"] = _largest(1e-6 * made.root_stress[:, :, g])
    table["failed_positions"] = made.failed.sum(axis=1)
    return table


def _largest(values: Array) -> Array:
    made = np.where(np.isfinite(values), values, -np.inf).max(axis=1)
    return np.where(np.isfinite(made), made, np.nan)


def tables(made: LoadedMesh) -> dict[str, Mapping[str, Any]]:
    """All tables of a loaded mesh, the main one first."""
    main, torques, pairs, orders = cell_table(made), torque_table(made), pair_table(made), order_table(made)
    return {"microgeometry": main, "torques": torques, "pairs": pairs, "orders": orders}


def summary(
    job: StiffnessJob,
    table: MicrogeometryTable,
    made: LoadedMesh,
    deviations: tuple[ToothDeviations, ToothDeviations],
    timings: Mapping[str, float],
) -> dict[str, Any]:
    """Content of microgeometry.json."""
    return {
        "job": {**job.tables, "microgeometry": asdict(table)},
        "versions": versions(),
        "mesh_cycles": made.mesh_cycles,
        "transmission_error_unloaded_peak_to_peak_um": 1e6 * float(np.ptp(made.transmission_error_unloaded)),
        "by_torque": {name: values.tolist() for name, values in torque_table(made).items()},
        "pitch": {name: _pitch(one, getattr(job.pair, name)) for name, one in zip(GEARS, deviations, strict=True)},
        "tolerances_um": None
        if table.tolerance_class is None
        else {
            name: pitch_errors.tolerances(getattr(job.pair, name), table.tolerance_class).rounded_um for name in GEARS
        },
        "statuses": made.statuses,
        "timings_s": dict(timings),
    }


def _pitch(own: ToothDeviations, gear: Any) -> dict[str, float]:
    """Largest single pitch deviation and cumulative pitch deviation of the driving flanks."""
    index = np.array(own.turn) * gear.reference_radius
    return {
        "single_pitch_deviation_um": 1e6 * float(np.abs(pitch_errors.single_of(index)).max()),
        "cumulative_pitch_deviation_um": 1e6 * float(np.ptp(index)),
    }


def report_lines(made: LoadedMesh) -> list[str]:
    """Lines to print."""
    m, n = made.twist.shape
    lines = [
        f"{m} torques x {n} positions over {made.span}: "
        + ", ".join(f"{count} {status}" for status, count in made.statuses.items()),
        f"unloaded transmission error {1e6 * np.ptp(made.transmission_error_unloaded):.4g} um peak to peak",
    ]
    table = torque_table(made)
    for i in sorted({0, m // 2, m - 1}):
        if made.failed[i].any():
            lines.append(f"at {made.torque[i]:.4g} N m: {made.failed[i].sum()} of {n} positions have no numbers")
            continue
        line = (
            f"at {made.torque[i]:.4g} N m: transmission error {table['transmission_error_mean_um'][i]:.4g} um with "
            f"{table['transmission_error_peak_to_peak_um'][i]:.3g} um peak to peak, pressure "
            f"{table['peak_pressure_largest_MPa'][i]:.4g} MPa"
        )
        if np.isfinite(table["edge_pressure_largest_MPa"][i]):
            line += f" (beside edges {table['edge_pressure_largest_MPa'][i]:.4g} MPa)"
        if made.root_stress is not None:
            both = ", ".join(f"{table[f'root_stress_largest_{gear}_MPa'][i]:.4g} MPa ({gear})" for gear in GEARS)
            line += f", root stress {both}"
        lines.append(line)
    best = int(np.argmin(np.where(np.isfinite(made.peak_to_peak), made.peak_to_peak, np.inf)))
    if m > 2 and np.isfinite(made.peak_to_peak[best]):
        lines.append(f"least peak-to-peak error: {1e6 * made.peak_to_peak[best]:.3g} um at {made.torque[best]:.4g} N m")
    return lines


def warnings(pair: GearPair, made: LoadedMesh) -> list[str]:
    """Sentences about what deserves a look."""
    said = [*pair.warnings, *overlap_warnings(pair, made.twist, made.beyond_validity)]
    room, jammed = made.back_clearance, made.status == BACK
    if room is not None and jammed.any():
        i, j = np.unravel_index(int(np.nanargmin(room)), room.shape)
        where = f"{made.torque[i]:.4g} N m and {np.degrees(made.pinion_angle[j]):.4g} deg"
        said.append(
            f"{int(jammed.sum())} positions have no numbers, for the back flanks would bear, too: they overlap by up "
            f"to {-1e6 * room[i, j]:.3g} um (at {where}), more material stands out than "
            f"{1e6 * pair.normal_backlash:.3g} um of backlash leave room for; thin the teeth (tooth_thinning_um)"
        )
    lost = made.failed & ~jammed
    if lost.any():
        statuses = ", ".join(
            f"{count} {status}" for status, count in made.statuses.items() if status not in (BACK, "converged")
        )
        cure = "rough flanks may not settle; take smoother ones, or other torques"
        said.append(f"{int(lost.sum())} positions have no numbers ({statuses}): {cure}")
    return said


def law_remarks(job: StiffnessJob) -> list[str]:
    """A line to print where [stiffness] names another law than the one that solves deviations."""
    name = job.law.name
    if name == HalfPlane.name:
        return []
    return [f"contact law: half_plane, as deviations need it; law = {name!r} of [stiffness] is for its curve alone"]
