"""Report of gears whose load varies along the face width: tables, summary, printed lines, warnings.

Places along the axes and axial forces count along y of the job file (`.width_job`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...base.cache import versions
from ...base.shown import percent
from ...base.typing import Array
from ...output.exchange.vtkhdf import write_vtkhdf
from ..geometry.derived import derived_geometry
from ..geometry.deviation_job import GEARS
from ..geometry.gear_data import rounding
from ..width import WideMesh, WidthSweep
from ..width.sweep import mean_line_load
from .job import StiffnessJob
from .report import against_iso, against_iso_lines, load_line
from .width_job import axial_sense
from .width_root import WideRoots, roots_along, roots_of_cells

#: Places of the contact pattern along the profile and along the width.
PATTERN = 61, 61
#: Widest gap (share of its side) that the pattern bridges between points of neighbouring positions.
BRIDGED = 0.2
#: Headline numbers with an estimated error (`.width_job.headline_numbers`) in words.
ERROR_WORDS = {
    "transmission_error_mean": "transmission error, mean",
    "transmission_error_peak_to_peak": "peak to peak",
    "k_mesh_mean": "secant stiffness",
    "k_tangent_mean": "tangent stiffness",
    "largest_line_load": "largest line load",
    "K_H_beta": "K_Hbeta",
    "K_H_alpha": "K_Halpha",
}


@dataclass(frozen=True)
class FlankLoad:
    """Largest line load over a mesh cycle at places of the pinion's flank, the contact pattern.

    Attributes
    ----------
    torque
        Mean torque at the wheel (N m).
    roll, y : ndarray, shapes (r,), (c,)
        Roll lengths on the pinion and places along the axes (m).
    line_load : ndarray, shape (r, c)
        N/m; NaN where nothing bears.
    mean : ndarray, shape (c,)
        Load per width of all tooth pairs at `y`, the mean of the positions (N/m).
    """

    torque: float
    roll: Array
    y: Array
    line_load: Array
    mean: Array


def sweep_columns(
    job: StiffnessJob, mesh: WideMesh, sweep: WidthSweep, roots: WideRoots | None = None
) -> dict[str, Any]:
    """Return the table of all positions, one row each, load by load.

    Parameters
    ----------
    job : StiffnessJob
        Gears and model.
    mesh : WideMesh
        The gears with their face widths.
    sweep : WidthSweep
        The contact.
    roots : WideRoots, optional
        Root stress over the width.
    """
    sense, radius = axial_sense(job), job.pair.wheel.base_radius
    moments = _tilting_moments(mesh, sweep, sense)
    loads, positions = sweep.status.shape

    def flat(values: Array) -> Array:
        return np.asarray(values).reshape(loads * positions)

    teeth = flat(sweep.peak_pair)
    bears = teeth >= 0
    return {
        "pinion_angle_deg": np.tile(np.degrees(sweep.angle), loads),
        "torque_wheel_Nm": flat(sweep.torque),
        "twist_deg": np.degrees(flat(sweep.twist)),
        "transmission_error_um": 1e6 * flat(sweep.transmission_error),
        "k_mesh_N_per_m": flat(sweep.secant) / radius**2,
        "k_tangent_N_per_m": flat(sweep.stiffness) / radius**2,
        "axial_force_wheel_N": sense * flat(sweep.axial_force),
        **{name: flat(values) for name, values in moments.items()},
        "peak_line_load_N_per_mm": 1e-3 * flat(sweep.peak_line_load),
        "peak_y_mm": 1e3 * sense * flat(sweep.peak_z),
        "peak_roll_length_pinion_mm": 1e3 * flat(sweep.peak_roll[..., 0]),
        "peak_roll_length_wheel_mm": 1e3 * flat(sweep.peak_roll[..., 1]),
        "peak_pinion_tooth": np.where(bears, teeth % job.pair.pinion.teeth, -1),
        **({} if roots is None else _root_cells(roots, sense, (loads, positions))),
        "status": flat(sweep.status),
    }


def _root_cells(roots: WideRoots, sense: float, shape: tuple[int, int]) -> dict[str, Array]:
    """Largest root stress of each position, its place and estimated relative error."""
    found, columns = roots_of_cells(roots, shape), {}
    for g, gear in enumerate(GEARS):
        columns[f"root_stress_{gear}_MPa"] = 1e-6 * found.stress[:, :, g].ravel()
        columns[f"root_y_{gear}_mm"] = 1e3 * sense * found.z[:, :, g].ravel()
        columns[f"root_diameter_{gear}_mm"] = 2e3 * found.radius[:, :, g].ravel()
        columns[f"root_stress_error_{gear}"] = found.error[:, :, g].ravel()
    return columns


def root_columns(job: StiffnessJob, sweep: WidthSweep, roots: WideRoots) -> dict[str, Any]:
    """Return root stresses over the width: a row for each load, gear and place, the largest over the mesh cycle."""
    sense, (stress, radius, row) = axial_sense(job), roots_along(roots, len(sweep.status))
    loads, _, places = stress.shape
    torque = np.array(_mean(sweep.torque))
    y = np.broadcast_to(1e3 * sense * roots.z, stress.shape)
    angle = np.degrees(np.where(row >= 0, sweep.angle[roots.position[row]], np.nan))
    order = slice(None, None, 1 if sense > 0 else -1)
    columns = {"y_mm": y, "root_stress_MPa": 1e-6 * stress, "root_diameter_mm": 2e3 * radius, "pinion_angle_deg": angle}
    return {
        "torque_wheel_Nm": np.repeat(torque, 2 * places),
        "gear": np.tile(np.repeat(GEARS, places), loads),
        **{name: values[:, :, order].ravel() for name, values in columns.items()},
    }


def _tilting_moments(mesh: WideMesh, sweep: WidthSweep, sense: float) -> dict[str, Array]:
    """Tilting moments (N m) of the contact on both gears about the middles of their widths."""
    found = {}
    for g, gear in enumerate(GEARS):
        # the moment about z = 0, less that of the force at the gear's middle
        sign = 1.0 if g == 1 else -1.0
        z, force = mesh.centres[g], sign * sweep.force
        about_centres = sweep.moment[:, :, g, 0] + z * force[..., 1]
        across = sweep.moment[:, :, g, 1] - z * force[..., 0]
        found[f"tilting_moment_{gear}_about_centre_line_Nm"] = about_centres
        found[f"tilting_moment_{gear}_across_Nm"] = sense * across
    return found


def load_columns(job: StiffnessJob, sweep: WidthSweep) -> dict[str, Any]:
    """Return the load over the flanks: a row for each loaded point of each line of contact."""
    points, sense, pair = sweep.points, axial_sense(job), job.pair
    return {
        "torque_wheel_Nm": sweep.torque[points.load, points.position],
        "pinion_angle_deg": np.degrees(sweep.angle)[points.position],
        "pinion_tooth": points.pair % pair.pinion.teeth,
        "wheel_tooth": (-1 - points.pair) % pair.wheel.teeth,
        "roll_length_pinion_mm": 1e3 * points.roll[:, 0],
        "roll_length_wheel_mm": 1e3 * points.roll[:, 1],
        "y_mm": 1e3 * sense * points.z,
        "length_mm": 1e3 * points.weight,
        "line_load_N_per_mm": 1e-3 * points.line_load,
        "hertzian_pressure_MPa": 1e-6 * hertzian_pressures(job, points.roll, points.line_load),
    }


def hertzian_pressures(job: StiffnessJob, roll: Array, line_load: Array) -> Array:
    r"""Largest pressures (Pa) of Hertz's line contact under line loads (N/m); NaN beyond the path of contact.

    :math:`p^2 = f \cos\beta_b/(\pi \varrho_t \sum 1/E')` with :math:`\varrho_t = s_1 s_2/(s_1 + s_2)`: the force per
    length of the line of contact is that per width in the transverse section. The normal radius is
    :math:`\varrho_t/\cos\beta_b`. Modifications of the profile do not count.

    Parameters
    ----------
    job : StiffnessJob
        The gears.
    roll : ndarray, shape (p, 2)
        Roll lengths on pinion and wheel (m).
    line_load : ndarray, shape (p,)
        In the transverse section (N/m).
    """
    start, end = job.pair.path_limits()
    soft = sum((1.0 - m.poisson_ratio**2) / m.youngs_modulus for m in job.materials)
    cosine = math.cos(job.pair.pinion.base_helix_angle)
    rounded = rounding(job.pair.pinion.module)
    inside = (roll[:, 0] > start - rounded) & (roll[:, 0] < end + rounded)
    inside &= (roll * [1, job.pair.sign] > 0.0).all(axis=1)
    product = np.where(inside, roll[:, 0] * roll[:, 1], 1.0)
    radius = product / np.where(inside, roll.sum(axis=1), 1.0)
    return np.where(inside, np.sqrt(line_load * cosine / (math.pi * radius * soft)), np.nan)


def flank_loads(job: StiffnessJob, mesh: WideMesh, sweep: WidthSweep) -> list[FlankLoad]:
    """Return the contact pattern at each load."""
    from scipy.interpolate import LinearNDInterpolator
    from scipy.spatial import QhullError

    points, sense = sweep.points, axial_sense(job)
    z = np.linspace(*mesh.zone, PATTERN[1])
    found = []
    for load in range(len(sweep.status)):
        there = np.flatnonzero(points.load == load)
        roll, at, value = points.roll[there, 0], points.z[there], points.line_load[there]
        rolls = np.linspace(roll.min(), roll.max(), PATTERN[0]) if len(there) else np.zeros(PATTERN[0])
        pattern = np.full(PATTERN, np.nan)
        if len(there) > 2 and np.ptp(roll) > 0:
            scale = np.array([np.ptp(roll), mesh.width])
            try:
                surface = LinearNDInterpolator(np.column_stack([roll, at]) / scale, value)
            except QhullError:  # all points on one line
                surface = None
            if surface is not None:
                grid = np.stack(np.meshgrid(rolls / scale[0], z / scale[1], indexing="ij"), axis=-1)
                pattern = _bridged(surface, grid)
        mean = mean_line_load(points, load, z, int((sweep.status[load] == "converged").sum()))
        torque = float(np.nanmean(sweep.torque[load])) if np.isfinite(sweep.torque[load]).any() else math.nan
        order = slice(None, None, 1 if sense > 0 else -1)
        found.append(FlankLoad(torque, rolls, (sense * z)[order], pattern[:, order], mean[order]))
    return found


def _bridged(surface: Any, grid: Array) -> Array:
    """Values of a triangulated surface, none within triangles that bridge wide gaps."""
    made = np.asarray(surface(grid))
    triangles = surface.tri.find_simplex(grid)
    corners = surface.tri.points[surface.tri.simplices]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    return np.where((triangles >= 0) & (longest[triangles] < BRIDGED), made, np.nan)


def pattern_columns(flanks: list[FlankLoad]) -> dict[str, Any]:
    """Return the contact patterns: a row for each place of each load."""
    rows: dict[str, list[Array]] = {
        name: [] for name in ("torque_wheel_Nm", "roll_length_pinion_mm", "y_mm", "largest_line_load_N_per_mm")
    }
    for flank in flanks:
        roll, y = np.meshgrid(flank.roll, flank.y, indexing="ij")
        values = (np.full(roll.size, flank.torque), 1e3 * roll.ravel(), 1e3 * y.ravel(), 1e-3 * flank.line_load.ravel())
        for column, value in zip(rows.values(), values, strict=True):
            column.append(value)
    return {name: np.concatenate(values) for name, values in rows.items()}


def load_table(
    job: StiffnessJob, mesh: WideMesh, sweep: WidthSweep, roots: WideRoots | None = None
) -> dict[str, list[float]]:
    """Return a row per load: means over the positions, load factors, the largest line load and root stresses.

    Parameters
    ----------
    job : StiffnessJob
        Gears and model.
    mesh : WideMesh
        The gears with their face widths.
    sweep : WidthSweep
        The contact.
    roots : WideRoots, optional
        Root stress over the width.
    """
    columns = sweep_columns(job, mesh, sweep, roots)
    loads = len(sweep.status)
    by_load = {name: np.asarray(values).reshape(loads, -1) for name, values in columns.items()}
    error, peak = by_load["transmission_error_um"], by_load["peak_line_load_N_per_mm"]
    with np.errstate(all="ignore"):
        most = np.array([int(np.nanargmax(row)) if np.isfinite(row).any() else 0 for row in peak])
    row = np.arange(loads)
    pressures = load_columns(job, sweep)["hertzian_pressure_MPa"]
    largest = [np.nanmax(pressures[sweep.points.load == i], initial=0.0) for i in row]
    return {
        "torque_wheel_Nm": _mean(by_load["torque_wheel_Nm"]),
        "transmission_error_mean_um": _mean(error),
        "transmission_error_peak_to_peak_um": (np.nanmax(error, axis=1) - np.nanmin(error, axis=1)).tolist(),
        "k_mesh_mean_N_per_m": _mean(by_load["k_mesh_N_per_m"]),
        "k_tangent_mean_N_per_m": _mean(by_load["k_tangent_N_per_m"]),
        "K_H_beta": sweep.k_h_beta.tolist(),
        "K_H_alpha": sweep.k_h_alpha.tolist(),
        "largest_line_load_N_per_mm": peak[row, most].tolist(),
        "largest_line_load_y_mm": by_load["peak_y_mm"][row, most].tolist(),
        "largest_line_load_roll_length_pinion_mm": by_load["peak_roll_length_pinion_mm"][row, most].tolist(),
        "largest_line_load_pinion_angle_deg": by_load["pinion_angle_deg"][row, most].tolist(),
        "largest_hertzian_pressure_MPa": np.array(largest).tolist(),
        "axial_force_wheel_mean_N": _mean(by_load["axial_force_wheel_N"]),
        **{
            f"{name.removesuffix('_Nm')}_mean_Nm": _mean(values)
            for name, values in by_load.items()
            if name.startswith("tilting_moment")
        },
        **({} if roots is None else _largest_roots(by_load)),
        "failed_positions": (sweep.status != "converged").sum(axis=1).tolist(),
    }


def _largest_roots(by_load: Mapping[str, Array]) -> dict[str, list[float]]:
    """Largest root stress of each load and gear, its places, pinion angle and estimated relative error."""
    found: dict[str, list[float]] = {}
    for gear in GEARS:
        stress = np.nan_to_num(np.asarray(by_load[f"root_stress_{gear}_MPa"], dtype=float), nan=-np.inf)
        row, most = np.arange(len(stress)), np.argmax(stress, axis=1)
        for name, column in (
            ("largest_root_stress_{}_MPa", "root_stress_{}_MPa"),
            ("largest_root_stress_{}_y_mm", "root_y_{}_mm"),
            ("largest_root_stress_{}_diameter_mm", "root_diameter_{}_mm"),
            ("largest_root_stress_{}_pinion_angle_deg", "pinion_angle_deg"),
            ("largest_root_stress_{}_error_estimate", "root_stress_error_{}"),
        ):
            found[name.format(gear)] = np.asarray(by_load[column.format(gear)])[row, most].tolist()
    return found


def _mean(values: Array) -> list[float]:
    values = np.asarray(values, dtype=float)
    return [float(np.nanmean(row)) if np.isfinite(row).any() else math.nan for row in values]


def width_summary(
    job: StiffnessJob,
    mesh: WideMesh,
    sweep: WidthSweep,
    timings: Mapping[str, float],
    *,
    errors: Mapping[str, float | list[float]] | None = None,
    roots: WideRoots | None = None,
    **tables: Any,
) -> dict[str, Any]:
    """Return the content of summary.json or loadmap.json.

    Parameters
    ----------
    job : StiffnessJob
        The gears and the model.
    mesh : WideMesh
        The gears with their face widths.
    sweep : WidthSweep
        The results.
    timings : mapping
        Name -> time that a part of the work took (s).
    errors : mapping, optional
        Estimated relative errors, see `.width_job.estimated_errors`.
    roots : WideRoots, optional
        Root stresses.
    tables
        Of the job, beside those of the model.
    """
    by_torque = load_table(job, mesh, sweep, roots)
    largest = int(np.argmax(np.nan_to_num(by_torque["torque_wheel_Nm"])))
    torque, stiffness = (by_torque[name][largest] for name in ("torque_wheel_Nm", "k_tangent_mean_N_per_m"))
    statuses, counts = np.unique(sweep.status, return_counts=True)
    cause = job.mesh.along_width()
    directions = np.array([1.0, axial_sense(job), 1.0])  # of twist and tilts, from the solver's z to y
    along_y = np.outer(directions, directions)
    return {
        "job": {**job.tables, **tables},
        "versions": versions(),
        "derived_geometry": derived_geometry(job.pair),
        "warnings": list(job.pair.warnings),
        "iso_6336": against_iso(job, torque, stiffness if math.isfinite(stiffness) else None),
        "along_the_width": {
            "because_of": cause[0] if cause else None,
            "common_face_width_mm": 1e3 * mesh.width,
            "functions": mesh.count,
            "kinematics": "small",
        },
        "by_torque": by_torque,
        "error_estimate": None if errors is None else dict(errors),
        "mean_tangent_twist_and_tilts_Nm_per_rad": (np.nanmean(sweep.tangent, axis=1) * along_y).tolist(),
        "statuses": dict(zip(statuses.tolist(), counts.tolist(), strict=True)),
        "timings_s": timings,
    }


def write_flank(path: Path, job: StiffnessJob, flank: FlankLoad) -> None:
    """Write the contact pattern on the pinion's flank of tooth 0 at pinion angle 0, in space (m), for ParaView."""
    pinion, sense = job.pair.pinion, axial_sense(job)
    section = pinion.profile.flank.at(flank.roll)
    turned = section[:, None] * np.exp(1j * pinion.twist_rate * sense * flank.y)
    y = np.broadcast_to(flank.y, turned.shape)
    points = np.stack([turned.real, sense * turned.imag, y], axis=-1).reshape(-1, 3)
    rows, columns = flank.line_load.shape
    number = np.arange(rows * columns).reshape(rows, columns)
    quads = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1).reshape(-1, 4)
    loads = np.nan_to_num(1e-3 * flank.line_load).ravel()
    roll = np.repeat(1e3 * flank.roll, columns)
    write_vtkhdf(path, points, {"quad": quads}, point_data={"line_load_N_per_mm": loads, "roll_length_mm": roll})


def width_lines(found: Mapping[str, Any]) -> list[str]:
    """Return the lines to print; `found` is the `width_summary`."""
    table, along = found["by_torque"], found["along_the_width"]
    statuses = ", ".join(f"{count} {status}" for status, count in found["statuses"].items())
    lines = [
        f"{sum(found['statuses'].values())} positions: {statuses}",
        f"load along the face width, by {along['because_of']}: {along['common_face_width_mm']:.6g} mm in common, "
        f"{along['functions']} shape functions of the load along it, small strain",
    ]
    for i, torque in enumerate(table["torque_wheel_Nm"]):
        lines += [
            load_line(
                torque,
                (table["transmission_error_mean_um"][i], table["transmission_error_peak_to_peak_um"][i]),
                (1e-6 * table["k_mesh_mean_N_per_m"][i], 1e-6 * table["k_tangent_mean_N_per_m"][i]),
            ),
            f"  K_Hbeta {table['K_H_beta'][i]:.4g}, K_Halpha {table['K_H_alpha'][i]:.4g}; largest line load "
            f"{table['largest_line_load_N_per_mm'][i]:.4g} N/mm at y {table['largest_line_load_y_mm'][i]:.4g} mm, roll "
            f"length {table['largest_line_load_roll_length_pinion_mm'][i]:.4g} mm of the pinion; Hertzian pressure "
            f"{table['largest_hertzian_pressure_MPa'][i]:.4g} MPa",
            f"  axial force on the wheel {table['axial_force_wheel_mean_N'][i]:.4g} N; tilting moments about the line "
            f"of centres {table['tilting_moment_pinion_about_centre_line_mean_Nm'][i]:.4g} N m (pinion), "
            f"{table['tilting_moment_wheel_about_centre_line_mean_Nm'][i]:.4g} N m (wheel)",
        ]
        if f"largest_root_stress_{GEARS[0]}_MPa" in table:
            stresses = (
                f"{gear} {table[f'largest_root_stress_{gear}_MPa'][i]:.4g} MPa at y "
                f"{table[f'largest_root_stress_{gear}_y_mm'][i]:.4g} mm (error "
                f"{percent(table[f'largest_root_stress_{gear}_error_estimate'][i])})"
                for gear in GEARS
            )
            lines.append(f"  largest root stress: {', '.join(stresses)}")
        if found["error_estimate"] is not None:
            of_load = {name: float(np.atleast_1d(values)[i]) for name, values in found["error_estimate"].items()}
            errors = ", ".join(f"{ERROR_WORDS[name]} {percent(value)}" for name, value in of_load.items())
            lines.append(f"  estimated errors: {errors}")
    return lines + against_iso_lines(found["iso_6336"], "tangent")


def width_warnings(job: StiffnessJob, mesh: WideMesh, sweep: WidthSweep) -> list[str]:
    """Return sentences about the results that need attention."""
    sentences = list(job.pair.warnings)
    failed = np.argwhere(sweep.status != "converged")
    if len(failed):
        angles = ", ".join(f"{angle:.6g}" for angle in np.degrees(sweep.angle)[np.unique(failed[:, 1])[:8]])
        sentences.append(f"{len(failed)} positions have no numbers, only their status (pinion angle {angles} deg)")
    ends = [end for g, face in enumerate(mesh.faces) for end in _inner_ends(face, mesh.faces[1 - g])]
    if ends:
        sentences.append(
            f"{'both ends' if len(ends) > 1 else 'one end'} of the narrower gear may carry load on the wider mate: the "
            "pressure at a sharp end is not computed, the line load is valid"
        )
    return sentences


def _inner_ends(face: tuple[float, float], mate: tuple[float, float]) -> list[float]:
    """Ends of a face that lie inside of that of the mate (m)."""
    apart = 1e-9
    return [end for end in face if mate[0] + apart < end < mate[1] - apart]
