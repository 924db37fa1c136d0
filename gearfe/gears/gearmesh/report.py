"""What the stiffness command tells: the printed lines and the summary."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.cache import versions
from ...base.errors import InputError
from ...base.shown import percent
from ...base.tables.pair import DEFAULT_LAW
from ...base.typing import Array
from ..contact.laws import COARSENING
from ..geometry.derived import derived_geometry, iso_values
from ..geometry.deviation_job import GEARS
from ..geometry.modifications import CHECKED, ends_of
from ..geometry.validity import overlap_warnings
from .curve import EDGES, StiffnessCurve
from .job import StiffnessJob
from .positions import ORDER

#: Allowable contact stress of case-hardened steel for unlimited life (MPa): ISO 6336-5, material quality MQ.
ALLOWABLE_MPA = 1500.0


def _levels(values: Array, unit: str = "") -> dict[str, float]:
    """Mean, least and largest of some values; `unit` ends their names."""
    found = {"mean": values.mean(), "least": values.min(), "largest": values.max()}
    return {name + unit: float(value) for name, value in found.items()}


def cycle_statistics(curve: StiffnessCurve, method: str) -> dict[str, float] | None:
    """Mean, least and largest stiffness over one mesh cycle (N/m), or None where the curve does not cover it."""
    try:
        interpolant = curve.interpolant(method=method)
    except InputError:
        return None
    return _levels(interpolant(np.arange(2000) * curve.mesh_cycle / 2000).value, "_N_per_m")


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


def summary(job: StiffnessJob, curve: StiffnessCurve, timings: Mapping[str, float]) -> dict[str, Any]:
    """Content of summary.json; stages that follow may still come to the timings."""
    table, moduli = job.table, [material.youngs_modulus for material in job.materials]
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
    return {
        "job": job.tables,
        "versions": versions(),
        "derived_geometry": derived_geometry(job.pair),
        "warnings": list(job.pair.warnings),
        "iso_6336": iso_values(job.pair, moduli[0], moduli[1]),
        "mesh_stiffness": cycle_statistics(curve, table.interpolation),
        "error_estimate": error,
        "load": {
            "torque_wheel_Nm": _levels(torque) if len(torque) else None,
            "lost_motion_deg": lost,
            "prescribed_twist": twist,
        },
        "contact_pressure": {**largest_pressures(curve), "usual_steel_MPa": ALLOWABLE_MPA},
        "contact_law": curve.contact_law,
        "statuses": dict(Counter(map(str, curve.status))),
        "failed_pinion_angles_deg": np.degrees(curve.pinion_angle[curve.failed]),
        "positions_beyond_validity": int(np.count_nonzero(curve.beyond_validity == 1)),
        "timings_s": timings,
    }


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
    both = " and ".join(f"{1e6 * size:.3g} um ({name})" for size, name in zip(most, GEARS, strict=True))
    return [f"flanks with the deviations of [microgeometry], up to {both}"]


def report_lines(job: StiffnessJob, curve: StiffnessCurve, found: Mapping[str, Any]) -> list[str]:
    """Lines to print; `found` is the `summary`."""
    statuses = ", ".join(f"{n} {status}" for status, n in found["statuses"].items())
    lines = [f"{len(curve)} positions: {statuses}"]
    if curve.contact_law:
        lines.append(f"contact law: {curve.contact_law}")
    lines += deviation_lines(job)
    given, iso = found["load"]["prescribed_twist"], found["iso_6336"]
    if given is not None and given["lost_motion_in_it_deg"]:
        lines.append(
            f"twist {given['twist_deg']:.6g} deg from the centred position: {given['lost_motion_in_it_deg']:.6g} deg "
            f"of lost motion (half the backlash) and {given['deflection_deg']:.6g} deg of deflection"
        )
    for name, levels, factor, unit in (
        ("torque at the wheel", found["load"]["torque_wheel_Nm"], 1.0, "N m"),
        ("mesh stiffness", found["mesh_stiffness"], 1e-6, "N/um"),
    ):
        if levels is not None:
            mean, least, largest = (factor * level for level in levels.values())
            lines.append(f"{name}: mean {mean:.4g}, least {least:.4g}, largest {largest:.4g} {unit}")
    lines.append(
        f"ISO 6336 method B, for comparison: c' = {iso['c_prime_N_per_mm_um']:.3g}, "
        f"c_gamma = {iso['c_gamma_N_per_mm_um']:.3g} N/(mm um); "
        f"c_gamma times width = {1e-6 * iso['c_gamma_times_width_N_per_m']:.4g} N/um"
    )
    lines += pressure_lines(curve)
    if found["error_estimate"] is not None:
        against = "" if job.law.name == DEFAULT_LAW else "the half-plane law and "
        lines.append(
            f"discretisation error, estimated by {against}meshes {COARSENING:g} times coarser (order {ORDER:g} "
            f"assumed): typically {percent(curve.typical_error)}, at worst {percent(curve.worst_error)}"
        )
    return lines


#: What bears at an edge, and why the pressure there is a figure to compare with alone.
EDGE_WORDS = {
    "singular": (
        "a sharp edge or the kink of a linear relief",
        "the pressure of linear elasticity is singular there",
    ),
    "rounded": ("a rounded edge", "the radius of the tip round decides the pressure there"),
}


def pressure_lines(curve: StiffnessCurve) -> list[str]:
    """Lines about the contact pressure: on smooth flanks, apart from it at edges, and whether steel bears it."""
    found, lines = largest_pressures(curve), []
    if found["largest_hertzian_MPa"] > 0:
        line = f"Hertzian pressure on the flanks: largest {found['largest_hertzian_MPa']:.4g} MPa"
        line += f" (the computed contact is {percent(found['its_relative_error'])} off Hertz's)"
        if found["largest_hertzian_MPa"] > ALLOWABLE_MPA:
            line += (
                f", beyond the {ALLOWABLE_MPA:.0f} MPa that case-hardened steel bears for long (ISO 6336-5): "
                "linear elasticity goes on where the steel would not"
            )
        lines.append(line)
    for kind, (edge, why) in EDGE_WORDS.items():
        count = found[f"positions_with_a_{kind}_edge_bearing"]
        if count:
            largest = 1e-6 * np.nanmax(curve.edge_pressure[curve.edge == kind])
            lines.append(
                f"{count} position{'s' if count > 1 else ''} with {edge} bearing: {why}; blunted by a "
                f"hundredth of a module, up to {largest:.4g} MPa (column edge_pressure_MPa)"
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


def warnings(job: StiffnessJob, curve: StiffnessCurve) -> list[str]:
    """Sentences about what deserves a look."""
    said = list(job.pair.warnings)
    apart = int(np.count_nonzero(curve.status == "no_contact"))
    if apart:
        sentence = f"{apart} positions have no contact: the twist does not take up backlash and relief there"
        centred = job.table.twist_from == "centred"
        cure = ' (twist_from = "contact" counts it from where the flanks touch)' if centred else ""
        said.append(sentence + cure)
    said += overlap_warnings(job.pair, curve.twist, curve.beyond_validity)
    if curve.failed.any():
        angles = ", ".join(f"{a:.6g}" for a in np.degrees(curve.pinion_angle[curve.failed])[:8])
        more = " ..." if curve.failed.sum() > 8 else ""
        said.append(
            f"{int(curve.failed.sum())} positions failed and have no numbers, only their status (pinion angle {angles}"
            f"{more} deg): {cure_of(curve.status[curve.failed])}"
        )
    return said
