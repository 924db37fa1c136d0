"""Report of a stiffness curve or a load map: summary, tables, printed lines, warnings."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.cache import versions
from ...base.errors import InputError, given
from ...base.shown import percent
from ...base.tables.loadmap import LoadMapTable
from ...base.tables.pair import DEFAULT_LAW
from ...base.typing import Array
from ..contact.laws import COARSENING
from ..geometry import pitch_errors
from ..geometry.derived import derived_geometry
from ..geometry.deviation_job import GEARS
from ..geometry.modifications import CHECKED, ends_of
from ..geometry.pair import GearPair
from ..geometry.tolerances import tolerances
from ..geometry.validity import overlap_warnings
from ..rating.stiffness import LIGHT, iso_values
from .bodies import body_bending, body_twist, contact_zone
from .curve import BACK, EDGES, StiffnessCurve
from .job import StiffnessJob
from .load_map import LoadMap
from .positions import ORDER

#: Harmonics of the mesh order in the table by torque.
HARMONICS = 5
#: Allowable contact stress of case-hardened steel for unlimited life (MPa): ISO 6336-5, material quality MQ.
ALLOWABLE_MPA = 1500.0
#: Line load (N/mm) that the stiffness of ISO 6336-1 is taken at below it, where that would fall to nothing.
LEAST_LINE_LOAD = 1e-3


def _levels(values: Array, unit: str = "") -> dict[str, float]:
    """Mean, least and largest of some values; `unit` ends their names."""
    found = {"mean": values.mean(), "least": values.min(), "largest": values.max()}
    return {name + unit: float(value) for name, value in found.items()}


def cycle_statistics(curve: StiffnessCurve, method: str, quantity: str = "k_mesh") -> dict[str, float] | None:
    """Mean, least and largest stiffness over one mesh cycle (N/m), or None where the curve does not cover it.

    Parameters
    ----------
    curve : StiffnessCurve
        The curve.
    method : str
        Interpolation between its positions.
    quantity : str
        ``k_mesh`` (secant) or ``k_tangent``.
    """
    try:
        interpolant = curve.interpolant(quantity, method=method)
    except InputError:
        return None
    return _levels(interpolant(np.arange(2000) * curve.mesh_cycle / 2000).value, "_N_per_m")


def error_levels(job: StiffnessJob, curve: StiffnessCurve) -> dict[str, float] | None:
    """Mean and peak-to-peak transmission error (um) under a torque; None if the curve does not cover the mesh cycle."""
    if job.table.torque_Nm is None or cycle_statistics(curve, "linear") is None:
        return None
    error = 1e6 * curve.transmission_error[np.isfinite(curve.transmission_error)]
    return {"mean_um": float(error.mean()), "peak_to_peak_um": float(np.ptp(error))}


def largest_pressures(curve: StiffnessCurve) -> dict[str, Any]:
    """Largest pressures of a curve's positions, with the error of the first, and how many an edge bears at."""
    path, edge = curve.peak_pressure, curve.edge_pressure
    at = int(np.nanargmax(path)) if np.isfinite(path).any() else None
    return {
        "largest_hertzian_MPa": math.nan if at is None else 1e-6 * float(path[at]),
        "its_relative_error": math.nan if at is None else float(curve.peak_pressure_error[at]),
        "largest_at_edges_MPa": 1e-6 * float(np.nanmax(edge)) if np.isfinite(edge).any() else math.nan,
        **{f"positions_with_a_{kind}_edge_bearing": int((curve.edge == kind).sum()) for kind in EDGES[1:]},
    }


def _head(job: StiffnessJob, tables: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return what the summaries of curves and maps begin with; `tables`: of the job, beside those of the model."""
    return {
        "job": {**job.tables, **(tables or {})},
        "versions": versions(),
        "derived_geometry": derived_geometry(job.pair),
        "warnings": list(job.pair.warnings),
    }


def against_iso(job: StiffnessJob, torque: float, mean: float | None) -> dict[str, float]:
    """Return c' and c_gamma of ISO 6336-1, and a mean stiffness against it with the shares of the gear bodies.

    Parameters
    ----------
    job : StiffnessJob
        The gears.
    torque : float
        Mean torque at the wheel (N m); NaN counts as a load above 100 N/mm.
    mean : float, optional
        Mean stiffness over a mesh cycle (N/m), or None where it is not known.
    """
    one, two = job.materials
    line_load = 1e-3 * torque / (job.pair.wheel.reference_radius * job.pair.common_width)
    known = {"line_load_N_per_mm": line_load} if math.isfinite(line_load) else {}
    load = max(line_load, LEAST_LINE_LOAD) if known else LIGHT
    iso = iso_values(job.pair, one.youngs_modulus, two.youngs_modulus, line_load=load) | known
    if mean is None:
        return iso
    bodies, zone = list(zip((job.pair.pinion, job.pair.wheel), job.materials, strict=True)), contact_zone(job.pair)
    twist = sum(body_twist(gear, material) for gear, material in bodies)
    bending = sum(body_bending(gear, material, zone) for gear, material in bodies)
    left = 1.0 / mean - twist - bending
    return iso | {
        "mean_over_c_gamma": mean / iso["c_gamma_times_width_N_per_m"],
        "share_of_body_twist": twist * mean,
        "share_of_body_bending": bending * mean,
        "mean_with_stiff_bodies_N_per_m": 1.0 / left if left > 0.0 else math.nan,
    }


def against_iso_lines(iso: Mapping[str, float], kind: str) -> list[str]:
    """Return the lines about the level of a mean stiffness, secant or tangent, against that of the standard.

    `iso` is from `against_iso`.
    """
    at = f" at {iso['line_load_N_per_mm']:.3g} N/mm" if "line_load_N_per_mm" in iso else ""
    lines = [
        f"ISO 6336-1 method B{at}, for comparison: c' = {iso['c_prime_N_per_mm_um']:.3g}, "
        f"c_gamma = {iso['c_gamma_N_per_mm_um']:.3g} N/(mm um); times face width: "
        f"c_gamma b = {1e-6 * iso['c_gamma_times_width_N_per_m']:.4g} N/um"
    ]
    twist, bending = (iso.get(f"share_of_body_{part}", math.nan) for part in ("twist", "bending"))
    if math.isfinite(twist):
        off = iso["mean_over_c_gamma"] - 1.0
        shares = f"torsion of the gear bodies between bore and root is {percent(twist)} of the flexibility"
        if bending > 0.0:
            shares += f", their bending by the axial force {percent(bending)}"
        lines.append(
            f"the mean {kind} stiffness is {percent(abs(off))} {'below' if off < 0.0 else 'above'} c_gamma b; "
            f"{shares}, without {'both' if bending > 0.0 else 'it'} the stiffness would be "
            f"{1e-6 * iso['mean_with_stiff_bodies_N_per_m']:.4g} N/um"
        )
    return lines


def torque_text(torque: float, pair: GearPair) -> str:
    """A torque at the wheel (N m) and that at the pinion in words, without friction."""
    return f"{torque:.4g} N m at the wheel, {torque / abs(pair.gear_ratio):.4g} N m at the pinion"


def summary(job: StiffnessJob, curve: StiffnessCurve, timings: Mapping[str, float]) -> dict[str, Any]:
    """Return the content of summary.json; stages that follow may still come to the timings."""
    table = job.table
    torque, lost = curve.torque_wheel[~curve.failed], math.degrees(curve.lost_motion)
    twist = error = None
    if table.twist_deg is not None:
        inside = lost if table.twist_from == "centred" else 0.0
        twist = {
            "twist_deg": table.twist_deg,
            "counted_from": table.twist_from,
            "lost_motion_in_it_deg": inside,
            "deflection_deg": table.twist_deg - inside,
        }
    if math.isfinite(curve.worst_error):
        known = np.isfinite(curve.relative_error)
        error = {
            "typical_relative": curve.typical_error,
            "worst_relative": curve.worst_error,
            "mesh_coarsening": COARSENING,
            "assumed_order": ORDER,
            "pinion_angle_deg": np.degrees(curve.pinion_angle[known]),
            "relative": curve.relative_error[known],
        }
    levels = cycle_statistics(curve, table.interpolation)
    mean_torque = float(torque.mean()) if len(torque) else math.nan
    return {
        **_head(job),
        "iso_6336": against_iso(job, mean_torque, None if levels is None else levels["mean_N_per_m"]),
        "mesh_stiffness": levels,
        "tangent_stiffness": cycle_statistics(curve, table.interpolation, "k_tangent"),
        "transmission_error": error_levels(job, curve),
        "error_estimate": error,
        "load": {
            "torque_wheel_Nm": _levels(torque) if len(torque) else None,
            "lost_motion_deg": lost,
            "prescribed_twist": twist,
        },
        "contact_pressure": {**largest_pressures(curve), "usual_steel_MPa": ALLOWABLE_MPA},
        "contact_law": curve.contact_law,
        "statuses": curve.statuses,
        "failed_pinion_angles_deg": np.degrees(curve.pinion_angle[curve.failed]),
        "positions_beyond_validity": int(np.count_nonzero(curve.beyond_validity == 1)),
        "timings_s": timings,
    }


def map_summary(
    job: StiffnessJob, table: LoadMapTable, load_map: LoadMap, timings: Mapping[str, float]
) -> dict[str, Any]:
    """Return the content of loadmap.json.

    Parameters
    ----------
    job : StiffnessJob
        The gears and the model.
    table : LoadMapTable
        The keys of the map.
    load_map : LoadMap
        The map.
    timings : mapping
        Name -> time that a part of the work took (s).
    """
    return {
        **_head(job, {table.NAME: asdict(table)}),
        "mesh_cycles": load_map.mesh_cycles,
        "transmission_error_unloaded_peak_to_peak_um": 1e6 * float(np.ptp(load_map.transmission_error_unloaded)),
        "by_torque": torque_table(load_map),
        "root_stress_error_estimate": None if load_map.root is None else _largest(load_map.root.error),
        **_deviations(job),
        "statuses": load_map.cells.statuses,
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
            allowed[name] = tolerances(gear, class_).rounded_um
    return {"pitch": made, "tolerances_um": allowed or None}


def _largest(values: Array) -> float:
    return float(np.nanmax(values)) if np.isfinite(values).any() else float("nan")


def torque_table(load_map: LoadMap) -> dict[str, list[float]]:
    """One row per torque: means over the positions, transmission error and its mesh orders, largest stresses."""
    error = load_map.quantity("transmission_error")
    table = {
        "torque_Nm": load_map.torque,
        "k_mesh_mean_N_per_m": load_map.quantity("k_mesh").mean(axis=1),
        "k_tangent_mean_N_per_m": load_map.quantity("k_tangent").mean(axis=1),
        "transmission_error_mean_um": 1e6 * error.mean(axis=1),
        "transmission_error_peak_to_peak_um": 1e6 * load_map.peak_to_peak,
    }
    if load_map.mesh_cycles:
        order, amplitude = load_map.spectrum()
        for h in range(1, HARMONICS + 1):
            if h * load_map.mesh_cycles < len(order):
                table[f"mesh_order_{h}_um"] = 1e6 * amplitude[:, h * load_map.mesh_cycles]
    largest = [largest_pressures(curve) for curve in load_map.curves]
    for name, key in (
        ("peak_pressure_largest_MPa", "largest_hertzian_MPa"),
        ("edge_pressure_largest_MPa", "largest_at_edges_MPa"),
        ("positions_with_rounded_edge", "positions_with_a_rounded_edge_bearing"),
        ("positions_with_singular_edge", "positions_with_a_singular_edge_bearing"),
    ):
        table[name] = np.array([pressures[key] for pressures in largest])
    if load_map.root is not None:
        for g, gear in enumerate(GEARS):
            table[f"root_stress_largest_{gear}_MPa"] = 1e-6 * load_map.root.largest[:, :, g].max(axis=1)
    table["failed_positions"] = load_map.failed.sum(axis=1)
    return {name: values.tolist() for name, values in table.items()}


def pair_table(load_map: LoadMap) -> dict[str, Array]:
    """A row for each loaded tooth pair: the pressure along the path of contact."""
    loads, gears = given(load_map.loads, "loads"), given(load_map.pair, "pair")
    level, angle = np.divmod(loads.position, load_map.shape[1])
    return {
        "torque_Nm": load_map.torque[level],
        "pinion_angle_deg": np.degrees(load_map.pinion_angle)[angle],
        "pinion_tooth": loads.pair % gears.pinion.teeth,
        "wheel_tooth": (-1 - loads.pair) % gears.wheel.tooth_count,
        "roll_length_pinion_mm": 1e3 * loads.roll[:, 0],
        "roll_length_wheel_mm": 1e3 * loads.roll[:, 1],
        "force_N": loads.force,
        "load_share": loads.share,
        "half_width_um": 1e6 * loads.half_width,
        "pressure_MPa": 1e-6 * loads.pressure,
        "edge": np.array(EDGES)[loads.edge],
    }


def order_table(load_map: LoadMap) -> dict[str, Array]:
    """Amplitudes of the transmission error by orders of the pinion's turn."""
    order, free = load_map.spectrum(unloaded=True)
    _, loaded = load_map.spectrum()
    table = {"order": order, "unloaded_um": 1e6 * free}
    return table | {f"at_{torque:.6g}_Nm_um": 1e6 * row for torque, row in zip(load_map.torque, loaded, strict=True)}


def map_tables(load_map: LoadMap) -> dict[str, Mapping[str, Any]]:
    """All tables of a computed map, the main one first."""
    torques, pairs, orders = torque_table(load_map), pair_table(load_map), order_table(load_map)
    return {"loadmap": load_map.columns(), "torques": torques, "pairs": pairs, "orders": orders}


def deviation_lines(job: StiffnessJob) -> list[str]:
    """A line about the deviations of the flanks, where there are any."""
    if not job.mesh.deviates:
        return []
    most = []
    for gear, own in zip((job.pair.pinion, job.pair.wheel), job.model.deviations, strict=True):
        roll = np.linspace(*ends_of(gear), CHECKED)
        most.append(max(0.0 if one is None else float(np.abs(one.at(roll)[0]).max()) for one in own.profiles))
    if not any(most):
        return []
    both = " and ".join(f"{1e6 * size:.3g} um ({gear.name})" for size, gear in zip(most, job.mesh.gears, strict=True))
    shorthand = job.mesh.driver.microgeometry_where.startswith("microgeometry")
    table = "[microgeometry]" if shorthand else "[gears.NAME.microgeometry]"
    return [f"flanks with the deviations of {table}, up to {both}"]


def _statuses(curve: StiffnessCurve) -> str:
    """Return how many positions have which status, in words."""
    return ", ".join(f"{count} {status}" for status, count in curve.statuses.items())


def report_lines(job: StiffnessJob, curve: StiffnessCurve, found: Mapping[str, Any]) -> list[str]:
    """Return the lines to print about a curve; `found` is the `summary`."""
    lines = [f"{len(curve)} positions: {_statuses(curve)}"]
    if curve.contact_law:
        lines.append(f"contact law: {curve.contact_law}")
    lines += deviation_lines(job)
    given = found["load"]["prescribed_twist"]
    if given is not None and given["lost_motion_in_it_deg"]:
        lines.append(
            f"twist {given['twist_deg']:.6g} deg from the centred position: {given['lost_motion_in_it_deg']:.6g} deg "
            f"of half backlash (j_bn/(2 r_b)) and {given['deflection_deg']:.6g} deg of deflection"
        )
    torque, error = found["load"]["torque_wheel_Nm"], found["transmission_error"]
    if job.table.torque_Nm is not None:
        lines.append(f"torque: {torque_text(job.table.torque_Nm, job.pair)}")
    elif torque is not None:
        lines.append(_levels_line("torque at the wheel", torque, 1.0, "N m"))
    if error is not None:
        mean, swing = error["mean_um"], error["peak_to_peak_um"]
        lines.append(f"transmission error: mean {mean:.4g}, peak to peak {swing:.3g} um")
    for name, levels in (("secant", found["mesh_stiffness"]), ("tangent", found["tangent_stiffness"])):
        if levels is not None:
            lines.append(_levels_line(f"mesh stiffness, {name}", levels, 1e-6, "N/um"))
    lines += against_iso_lines(found["iso_6336"], "secant")
    lines += pressure_lines(curve)
    if found["error_estimate"] is not None:
        against = "" if job.law.name == DEFAULT_LAW else "the half-plane law and "
        lines.append(
            f"discretisation error of the stiffness: median {percent(curve.typical_error)}, at most "
            f"{percent(curve.worst_error)}, estimated by comparison with {against}meshes {COARSENING:g} times coarser"
        )
    return lines


def _levels_line(name: str, levels: Mapping[str, float], factor: float, unit: str) -> str:
    """Mean, smallest and largest value of a quantity in words."""
    mean, least, largest = (factor * level for level in levels.values())
    return f"{name}: mean {mean:.4g}, smallest {least:.4g}, largest {largest:.4g} {unit}"


def map_lines(load_map: LoadMap) -> list[str]:
    """Return the lines to print about a map."""
    unloaded = round(1e6 * float(np.ptp(load_map.transmission_error_unloaded)), 6)
    (m, n), swing = load_map.shape, load_map.peak_to_peak
    lines = [f"{m} torques x {n} positions over {load_map.span}: {_statuses(load_map.cells)}"]
    lines.append(f"unloaded transmission error {unloaded:.4g} um peak to peak")
    for row in sorted({0, m // 2, m - 1}):
        curve = load_map.curves[row]
        if curve.failed.any():
            lines.append(f"at {load_map.torque[row]:.4g} N m: {curve.failed.sum()} of {n} positions have no numbers")
            continue
        line = load_line(
            load_map.torque[row],
            (1e6 * curve.transmission_error.mean(), 1e6 * swing[row]),
            (1e-6 * curve.k_mesh.mean(), 1e-6 * curve.k_tangent.mean()),
        )
        if load_map.root is not None:
            pinion, wheel = 1e-6 * load_map.root.largest[row].max(axis=0)
            line += f"; root stress {pinion:.4g} MPa (pinion), {wheel:.4g} MPa (wheel)"
        lines += [line, *("  " + pressure for pressure in pressure_lines(curve))]
    best = int(np.argmin(np.where(np.isfinite(swing), swing, np.inf)))
    if m > 2 and np.isfinite(swing[best]):
        smallest = f"{1e6 * swing[best]:.3g} um at {load_map.torque[best]:.4g} N m"
        lines.append(f"smallest peak-to-peak transmission error: {smallest}")
    if load_map.root is not None:
        lines.append(f"root stress: estimated error at most {percent(_largest(load_map.root.error))}")
    return lines


def load_line(torque: float, error_um: tuple[float, float], stiffness: tuple[float, float]) -> str:
    """Return the line of a map about one load.

    Parameters
    ----------
    torque : float
        At the wheel (N m).
    error_um : (float, float)
        Mean and peak-to-peak transmission error (um).
    stiffness : (float, float)
        Mean secant and tangent stiffness (N/um).
    """
    return (
        f"at {torque:.4g} N m: transmission error mean {error_um[0]:.4g}, peak to peak {error_um[1]:.3g} um; mean mesh "
        f"stiffness {stiffness[0]:.4g} N/um (secant), {stiffness[1]:.4g} N/um (tangent)"
    )


#: Which edge carries load, and the theory of the pressure there.
EDGE_WORDS = {
    "singular": (
        "a sharp tip edge, or the start of a linear relief,",
        "in theory the pressure there has no limit: add a tip round or a longer, parabolic relief",
    ),
    "rounded": ("a tip round", "the pressure there depends on its radius"),
}


def pressure_lines(curve: StiffnessCurve) -> list[str]:
    """Lines about the contact pressure: on smooth flanks, apart from it at edges, and whether steel bears it."""
    found, lines = largest_pressures(curve), []
    if found["largest_hertzian_MPa"] > 0:
        line = f"Hertzian pressure on the flanks: largest {found['largest_hertzian_MPa']:.4g} MPa"
        off = percent(abs(found["its_relative_error"]))
        line += f" (the computed contact width differs by {off} from Hertz's)"
        if found["largest_hertzian_MPa"] > ALLOWABLE_MPA:
            line += (
                f", above {ALLOWABLE_MPA:.0f} MPa, the allowable stress number sigma_Hlim of case-hardened steel "
                "(ISO 6336-5, MQ); the model stays linear elastic"
            )
        lines.append(line)
    for kind, (edge, why) in EDGE_WORDS.items():
        count = found[f"positions_with_a_{kind}_edge_bearing"]
        if count:
            largest = 1e-6 * np.nanmax(curve.edge_pressure[curve.edge == kind])
            lines.append(
                f"at {count} position{'s' if count > 1 else ''} {edge} carries load; {why}; comparative pressure up to "
                f"{largest:.4g} MPa (column edge_pressure_MPa)"
            )
    return lines


def cure_of(statuses: NDArray[np.str_]) -> str:
    """What to do about failed positions of these statuses."""
    if "under_resolved" not in statuses:
        return "use another load (far below a millinewton, places of flanks are lost in rounding) or another coarsen"
    return (
        'where under_resolved, contacts are narrower than the elements of the flanks: law = "half_plane" answers every '
        "load, a finer flank (flank_coarsen below 1) resolves lighter ones"
    )


def warnings(job: StiffnessJob, result: StiffnessCurve | LoadMap) -> list[str]:
    """Return sentences about the results of a curve or a map that need attention."""
    load_map = result if isinstance(result, LoadMap) else None
    curve = result if isinstance(result, StiffnessCurve) else result.cells
    sentences = list(job.pair.warnings)
    apart = int(np.count_nonzero(curve.status == "no_contact"))
    if apart:
        sentence = f"{apart} positions have no contact: the twist does not take up backlash and relief there"
        centred = job.table.twist_from == "centred"
        cure = ' (twist_from = "contact" counts it from where the flanks touch)' if centred else ""
        sentences.append(sentence + cure)
    sentences += overlap_warnings(job.pair, curve.twist, curve.beyond_validity)
    jammed = curve.status == BACK
    if jammed.any() and load_map is not None:
        sentences.append(_jam(job, load_map, int(jammed.sum())))
    failed = np.flatnonzero(curve.failed & ~jammed)
    if len(failed):
        where = f"pinion angle {_some(np.degrees(curve.pinion_angle[failed]), '.6g')} deg"
        if load_map is not None:
            where = f"torque {_some(load_map.torque[failed // load_map.shape[1]], '.4g')} N m; {where}"
        sentences.append(
            f"{len(failed)} positions failed and have no numbers, only their status ({where}): "
            + cure_of(curve.status[failed])
        )
    return sentences


def _some(values: Array, form: str) -> str:
    """Return the first of some values as text, each once."""
    distinct = list(dict.fromkeys(f"{value:{form}}" for value in values))
    return ", ".join(distinct[:8]) + (" ..." if len(distinct) > 8 else "")


def _jam(job: StiffnessJob, load_map: LoadMap, count: int) -> str:
    """Return the sentence about so many cells whose back flanks would be loaded."""
    clearance = given(load_map.back_clearance, "back_clearance")
    i, j = np.unravel_index(int(np.nanargmin(clearance)), clearance.shape)
    where = f"{load_map.torque[i]:.4g} N m and {np.degrees(load_map.pinion_angle[j]):.4g} deg"
    return (
        f"{count} positions have no numbers, because the back flanks would be loaded, too: they overlap by up to "
        f"{-1e6 * clearance[i, j]:.3g} um (at {where}), more material stands out than "
        f"{1e6 * job.pair.base_backlash:.3g} um of backlash leave room for; thin the teeth (tooth_thinning_um)"
    )
