"""Tables of the accuracy page: which columns of which CSV file are shown, and how numbers are written."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from .record import Row

Show = Callable[[Any], str]


def digits(value: Any) -> str:
    """Three digits, plain where that is short."""
    if isinstance(value, str):
        return value
    if value is None or not math.isfinite(value):
        return "-"
    if isinstance(value, int) or (float(value).is_integer() and abs(value) < 1e6):
        return str(int(value))
    return f"{value:.3g}" if 1e-3 <= abs(value) < 1e5 else f"{value:.1e}"


def percent(value: Any) -> str:
    """Percent with two digits."""
    return "-" if not isinstance(value, (int, float)) or not math.isfinite(value) else f"{100.0 * value:.2g} %"


def milliseconds(value: Any) -> str:
    """Seconds as ms."""
    return "-" if not isinstance(value, (int, float)) or not math.isfinite(value) else f"{1e3 * value:.3g}"


@dataclass(frozen=True)
class Section:
    """A part of the page.

    Attributes
    ----------
    table
        Name of the CSV file without suffix.
    title, text
        Heading and what to know.
    columns
        Column -> (heading, how it is written).
    command
        Job of the benchmark that made it.
    """

    table: str
    title: str
    text: str
    columns: Mapping[str, tuple[str, Show]]
    command: str
    prepare: Callable[[list[Row]], list[Row]] = field(default=lambda rows: rows)


def markdown(columns: Mapping[str, tuple[str, Show]], rows: Sequence[Row]) -> list[str]:
    """A Markdown table; columns without any value are left out."""
    kept = {n: c for n, c in columns.items() if any(n in r and c[1](r[n]) not in ("-", "") for r in rows)}
    lines = ["| " + " | ".join(head for head, _ in kept.values()) + " |", "|" + "---|" * len(kept)]
    for row in rows:
        lines.append("| " + " | ".join(show(row.get(name, math.nan)) for name, (_, show) in kept.items()) + " |")
    return lines


def _own_errors(rows: list[Row]) -> list[Row]:
    from .sweep_peers import own_errors

    return own_errors(rows)


def _frequency_errors(rows: list[Row]) -> list[Row]:
    from .housing_study import frequency_errors

    return [{**r, "error": e} for r, e in zip(rows, frequency_errors(rows), strict=True)]


COST: dict[str, tuple[str, Show]] = {
    "cpu_s": ("CPU min (s)", digits),
    "cpu_median_s": ("median", digits),
    "wall_s": ("wall (s)", digits),
    "peak_MB": ("peak memory (MB)", digits),
    "runs": ("runs", digits),
}
PLAIN: Show = str

SECTIONS: tuple[Section, ...] = (
    Section(
        "references",
        "Against references",
        "Largest difference from every reference, with the target. Differences of stiffness, frequencies and "
        "pressures are relative.",
        {
            "what": ("quantity", PLAIN),
            "reference": ("reference", PLAIN),
            "values": ("values", digits),
            "difference": ("difference", digits),
            "promised": ("target", digits),
            "note": ("note", PLAIN),
        },
        "references",
    ),
    Section(
        "sweep_sizes",
        "Mesh stiffness: element size and law",
        "Shipped pair, 40 positions at 0.05 deg, against the converged curve (`nitsche` at `coarsen` 0.35). Meshes "
        "come from the cache; the seconds of the mesher are in a separate column.",
        {
            "law": ("law", PLAIN),
            "coarsen": ("`coarsen`", digits),
            "flank_mm": ("flank element (mm)", digits),
            "error_on_path": ("error on the path", percent),
            "error": ("error at worst", percent),
            **COST,
            "meshing_cpu_s": ("meshing, first time (s)", digits),
        },
        "sweep",
    ),
    Section(
        "sweep_peers",
        "Mesh stiffness: other programs",
        "Sharp 20/30 pair at 4 deg and 0.05 deg of twist, on meshes with the same flanks (other programs: three "
        "fine teeth per gear, the others coarse). Times are for one position with its set-up, and for a sweep of "
        "40 (other programs: 40 positions). Errors of other programs are from their own finest mesh, those of "
        "gearfe from its converged value. The last column is the distance of all of them from the converged value "
        "of gearfe. CalculiX and GetFEM include complete finite strain and allow any geometry, friction and "
        "plasticity. gearfe includes finite strain to first order, frictionless, for spur gears.",
        {
            "program": ("program", PLAIN),
            "coarsen": ("`coarsen`", digits),
            "unknowns": ("unknowns", digits),
            "k_mesh_N_per_m": ("k_mesh (N/m)", lambda v: f"{v:.5g}"),
            "error": ("error", percent),
            "cpu_s": ("one position, CPU (s)", digits),
            "wall_s": ("wall (s)", digits),
            "sweep_cpu_s": ("sweep of 40, CPU (s)", digits),
            "peak_MB": ("peak memory (MB)", digits),
            "off_converged": ("from ours", percent),
        },
        "sweep",
        _own_errors,
    ),
    Section(
        "sweep_verification",
        "Mesh stiffness: whole gears",
        "One position at small strain, on gears condensed to their flanks and on whole gears with all unknowns at "
        "once (`gearfe.gears.contact.whole_gears`), with the same elements.",
        {
            "model": ("model", PLAIN),
            "coarsen": ("`coarsen`", digits),
            "error": ("error", percent),
            "setup_cpu_s": ("set-up, CPU (s)", digits),
            "position_cpu_s": ("a position, CPU (s)", digits),
        },
        "sweep",
    ),
    Section(
        "sweep_stages",
        "Mesh stiffness: stages",
        "Default sweep of 40 positions, meshes from the cache.",
        {"stage": ("stage", PLAIN), "wall_s": ("wall (s)", digits)},
        "sweep",
    ),
    Section(
        "sweep_positions",
        "Mesh stiffness: number of positions",
        "Distinct positions in one mesh cycle, without set-up.",
        {
            "positions": ("positions", digits),
            **COST,
            "ms_each": ("ms each", digits),
            "not_converged": ("not converged", digits),
        },
        "sweep",
    ),
    Section(
        "sweep_twists",
        "Mesh stiffness: load",
        "Default settings (the half-plane law), 18 positions. Errors are against the same law at `coarsen` 0.35. "
        "Another column is the difference from Nitsche's law on that mesh, if its elements resolve the contact.",
        {
            "twist_deg": ("twist (deg)", digits),
            "error_on_path": ("error on the path", percent),
            "error": ("error at worst", percent),
            "from_elements": ("from finite-element contact", percent),
            "resolved": ("resolved there", digits),
            "not_converged": ("not converged", digits),
            "iterations": ("iterations", digits),
            "cpu_s": ("CPU min (s)", digits),
            "wall_s": ("wall (s)", digits),
        },
        "sweep",
    ),
    Section(
        "sweep_kinematics",
        "Mesh stiffness: small and finite strain",
        "Cost and effect of first-order finite strain.",
        {
            "kinematics": ("kinematics", PLAIN),
            "twist_deg": ("twist (deg)", digits),
            "smallest_change": ("change from", percent),
            "largest_change": ("to", percent),
            **COST,
        },
        "sweep",
    ),
    Section(
        "mechanism_tolerance",
        "Mechanisms: integrators, tolerances and other programs",
        "Largest error of all angles over the run against binary128; milliseconds of CPU after a first call, with "
        "outputs at the times of the reference. For exudyn the tolerance is the step relative to the run. CVODE "
        "and scipy integrate the index-1 equations in seven absolute angles (two for the slider crank), compiled "
        "by numba, and IDA the stabilised index-2 equations. These are simpler than the general bodies and joints "
        "of gearfe. On the slider crank they leave the branch at the fold. They integrate any differential "
        "equation, exudyn any multibody system.",
        {
            "mechanism": ("mechanism", PLAIN),
            "program": ("program", PLAIN),
            "method": ("method", PLAIN),
            "tolerance": ("tolerance", digits),
            "error": ("error (rad)", digits),
            "cpu_s": ("CPU min (ms)", milliseconds),
            "cpu_median_s": ("median (ms)", milliseconds),
            "wall_s": ("wall (ms)", milliseconds),
            "runs": ("runs", digits),
            "status": ("status", lambda v: v[:60] if isinstance(v, str) else ""),
        },
        "mechanism",
    ),
    Section(
        "mechanism_flexible",
        "Mechanisms with a flexible link: tolerances, and exudyn's cables",
        "Largest differences from exudyn's extrapolated references (tests/data). They include exudyn's own errors "
        "of elements, and the shear and rotary inertia that its cables lack. Position of the slider or tip (m) or "
        "of the crank (rad); deflection in the middle relative to its largest. CPU seconds after a first call.",
        {
            "mechanism": ("mechanism", PLAIN),
            "program": ("program", PLAIN),
            "setting": ("setting", PLAIN),
            "steps": ("steps", digits),
            "position_error": ("position off by", digits),
            "deflection_error": ("deflection off by", percent),
            "cpu_s": ("CPU min (s)", digits),
        },
        "mechanism",
    ),
    Section(
        "mechanism_starts",
        "Mechanisms: slider crank from random starts",
        "On the true branch, at least 0.5 rad/s at the fold, 0..10 s at tolerance 1e-9, against the exact equation.",
        {
            "starts": ("starts", digits),
            "median_ms": ("median (ms)", digits),
            "largest_ms": ("largest (ms)", digits),
            "largest_error": ("largest error (rad)", digits),
            "wrong_branch": ("wrong branch", digits),
        },
        "mechanism",
    ),
    Section(
        "mechanism_chains",
        "Mechanisms: number of bodies",
        "Hanging chains, 1 s at 1e-9.",
        {
            "bodies": ("bodies", digits),
            "steps": ("steps", digits),
            **COST,
            "us_a_step": ("microseconds a step", digits),
        },
        "mechanism",
    ),
    Section(
        "mechanism_calls",
        "Mechanisms: first call and later ones",
        "Andrews' mechanism at 1e-9 in a fresh process.",
        {
            "state": ("state", PLAIN),
            "first_call_cpu_s": ("first call, CPU (s)", digits),
            "later_call_cpu_s": ("later call, CPU (s)", digits),
        },
        "mechanism",
    ),
    Section(
        "housing_sizes",
        "Housing: mesh",
        "From mesh to reduced body (40 modes, one level of corrections, assembly included). Largest error of the "
        "first 20 frequencies against the thinnest elements (last row), and largest estimated error. Times are "
        "without mesher and estimate.",
        {
            "size_mm": ("size (mm)", digits),
            "unknowns": ("unknowns", digits),
            "error": ("error", percent),
            "told": ("estimated error", percent),
            **COST,
        },
        "housing",
        _frequency_errors,
    ),
    Section(
        "housing_peers",
        "Housing: other programs on the same mesh",
        "40 modes with clamped bores on the stored mesh. exudyn gets the matrices of gearfe and adds constraint "
        "modes. CalculiX reads the mesh and computes modes only (its error is against the 4-point mass it uses).",
        {
            "program": ("program", PLAIN),
            "what": ("task", PLAIN),
            "unknowns": ("unknowns", digits),
            "error": ("error", digits),
            **COST,
        },
        "housing",
    ),
    Section(
        "housing_reductions",
        "Housing: modes and quasi-static corrections",
        "Acceleration below 5 kHz under a ramp of 1 ms on bore 5, reduced against full model, same steps, rms.",
        {
            "modes": ("modes", digits),
            "levels": ("levels", digits),
            "coordinates": ("coordinates", digits),
            "error": ("error at bore 5", digits),
            "largest_error": ("at the worst coordinate", digits),
            "cpu_s": ("reduction, CPU (s)", digits),
        },
        "housing",
    ),
    Section(
        "transient_tolerance",
        "Gear train: integrators, tolerances and other programs",
        "7 ms of the shipped train. Largest error of all contact forces and accelerations, each relative to its "
        "maximum, from a run at 1e-12. Variant parting: a resonance, teeth apart for a sixth of the time; scipy "
        "restarts at each contact. The other programs get the same right-hand side in the same modal coordinates, "
        "compiled. They run only the damped variants. Trials on the undamped one, on a busy machine, were: scipy "
        "DOP853 1.3e-4 in 0.66 s, LSODA 4.0e-3 in 0.21 s, CVODE 5.8e-5 in 7.1 s; gearfe 1.2e-6 in 0.018 s.",
        {
            "variant": ("variant", PLAIN),
            "program": ("program", PLAIN),
            "method": ("method", PLAIN),
            "tolerance": ("tolerance", digits),
            "unknowns": ("unknowns", digits),
            "error": ("error", digits),
            "force_error": ("of the contact forces", digits),
            "cpu_s": ("CPU min (ms)", milliseconds),
            "cpu_median_s": ("median (ms)", milliseconds),
            "wall_s": ("wall (ms)", milliseconds),
            "steps": ("steps", digits),
            "status": ("status", lambda v: v[:60] if isinstance(v, str) else ""),
        },
        "transient",
    ),
    Section(
        "transient_modes",
        "Gear train: modes of the housing",
        "Operating variant, against 160 modes: largest error of the contact forces, and rms error of the spectra "
        "of the attachments' accelerations. They are sampled every 2.5 us and compared below 5 kHz and below 14 "
        "kHz, half the sampling frequency of the shipped job.",
        {
            "modes": ("modes", digits),
            "unknowns": ("unknowns", digits),
            "force_error": ("contact forces", digits),
            "acceleration_error": ("accelerations below 5 kHz", digits),
            "wide_error": ("below 14 kHz", digits),
            "cpu_s": ("CPU min (ms)", milliseconds),
        },
        "transient",
    ),
    Section(
        "runup_peers",
        "Gear train: steady running",
        "One speed of the shipped train in steady running. The error is the largest of the contact forces over a "
        "period, against a transient of 0.8 s at 1e-10. gearfe uses harmonic balance from rest, or takes one of 201 "
        "speeds of a run-up. The other programs integrate the same right-hand side, compiled, from rest over the "
        "span; their last period is compared.",
        {
            "variant": ("variant", PLAIN),
            "speed": ("speed (rad/s)", digits),
            "program": ("program", PLAIN),
            "method": ("method", PLAIN),
            "tolerance": ("tolerance", digits),
            "span_s": ("span (s)", digits),
            "error": ("error", digits),
            "cpu_s": ("CPU min (ms)", milliseconds),
            "cpu_median_s": ("median (ms)", milliseconds),
            "status": ("status", lambda v: v[:60] if isinstance(v, str) else ""),
        },
        "runup",
    ),
    Section(
        "cold",
        "Whole commands",
        "Total time of a command: fresh processes, one thread, the smallest of three runs. The cache holds "
        "compiled kernels, meshes, curves and housings, or only kernels, or nothing (then the kernels are compiled "
        "as well). Where measured, an earlier state is given for comparison.",
        {
            "what": ("command", PLAIN),
            "cached": ("in the cache", PLAIN),
            "cpu_s": ("CPU (s)", digits),
            "peak_MB": ("peak of memory (MB)", digits),
            "before_cpu_s": ("before, CPU (s)", digits),
            "ratio": ("ratio", digits),
        },
        "cold",
    ),
    Section(
        "skipped",
        "What is skipped",
        "Processor seconds with the omission and without it. The result is the same "
        "(`tests/project/test_skipped.py` also proves that the omitted part is not used).",
        {
            "what": ("task", PLAIN),
            "skipped_s": ("skipped (s)", digits),
            "not_skipped_s": ("not skipped (s)", digits),
            "times": ("times", digits),
            "note": ("note", PLAIN),
        },
        "skipped",
    ),
)
