r"""From a mesh of a job file to the arguments of `gearfe.gears.width`: gears whose load varies along the face width.

Job files count y along the axes, towards the viewer who sees the left flanks drive. Where the right ones drive, the
pair is seen from the other side, whose axial coordinate z is -y: ends and slopes change places, hands do not.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.cache import cache_key
from ...base.errors import InputError
from ...base.progress import Stopwatch
from ...base.tables.gearbox import TILTS
from ...base.tables.microgeometry import ALONG_WIDTH, FlankTable
from ...base.tables.pair import StiffnessTable
from ...base.typing import Array, IntArray
from ..contact.laws import COARSENING, check_poisson
from ..geometry.deviation_job import FlankOf, deviations_of
from ..geometry.face import NOMINAL
from ..geometry.modifications import ends_of
from ..geometry.pair import Gear
from ..width import (
    ContactLines,
    EndRelief,
    LeadModification,
    Misalignment,
    WideFlanks,
    WideMesh,
    WidthSweep,
    contact_lines,
    sweep_width,
    wide_compliance,
)
from ..width.flanks import Topography
from .job import Keep, StiffnessJob
from .positions import ORDER
from .topography import measured_topography

if TYPE_CHECKING:
    from ...base.tables.loadmap import LoadMapTable

#: Element sizes of `gearfe.gears.width` in those of plane sections; coarsen and flank_coarsen multiply them.
SECTION_COARSEN, FLANK_COARSEN = 2.0, 3.0
#: Largest gap (modules) of modifications along the width and of tilts. The flanks are displaced to first order, and
#: laws of contact hold for overlaps of 0.12 modules.
MOST_GAP = 0.1
#: Exponents of the shapes of an end relief.
EXPONENTS = {"linear": 1.0, "parabolic": 2.0}
#: Keys of [stiffness] that the load along the width has no use for, so that they have their defaults.
PLANE_KEYS = (
    *("law", "law_parameters", "plane", "points_per_edge", "nitsche_gamma0", "penalty_stiffness_N_per_mm3"),
    *("twist_from", "solve_all", "interpolation"),
)


@dataclass(frozen=True)
class FlankTopography:
    """What lead modifications do not hold: bias, and reliefs of corners.

    Parameters
    ----------
    rolls
        Roll lengths of form and tip circle (m).
    face
        First and last z of the gear (m).
    bias
        Helix slope at the tip circle less that at the form circle, over the face width (m), towards larger z.
    corners
        Amount, length along z and along the roll (m), and whether it is at the tip, and at the end of larger z.
    """

    rolls: tuple[float, float]
    face: tuple[float, float]
    bias: float
    corners: tuple[tuple[float, float, float, bool, bool], ...]
    alike = True

    @property
    def kinks(self) -> Array:
        """Lines a z + b s = c over z and roll length s (m) where reliefs of corners begin, shape (corners, 3)."""
        (form, tip), (low, high) = self.rolls, self.face
        lines = [
            (
                -1.0 / length if at_high else 1.0 / length,
                -1.0 / height if at_tip else 1.0 / height,
                1.0 - (high / length if at_high else -low / length) - (tip / height if at_tip else -form / height),
            )
            for _, length, height, at_tip, at_high in self.corners
        ]
        return np.reshape(lines, (-1, 3))

    def __call__(self, roll: Array, z: Array, tooth: IntArray) -> Array:  # noqa: ARG002 - alike on all teeth
        """Material (m, > 0: more) at roll lengths (m) and axial coordinates (m)."""
        (form, tip), (low, high) = self.rolls, self.face
        along = (z - 0.5 * (low + high)) / (high - low)
        added = self.bias * along * (roll - 0.5 * (form + tip)) / (tip - form)
        for amount, length, height, at_tip, at_high in self.corners:
            from_end, from_edge = high - z if at_high else z - low, tip - roll if at_tip else roll - form
            added = added - amount * np.clip(1.0 - from_end / length - from_edge / height, 0.0, 1.0)
        return np.asarray(added)


def axial_sense(job: StiffnessJob) -> float:
    """z of the solver over y of the job file: -1 where the right flanks drive."""
    return -1.0 if job.mesh.flank == "right" else 1.0


def check_width_job(job: StiffnessJob) -> None:
    """Raise `InputError` for keys of [stiffness] that a load along the face width does not take."""
    check_width_table(job.table, job.mesh.along_width())
    for gear, material in zip(job.mesh.gears, job.materials, strict=True):
        check_poisson(material.poisson_ratio, "strain", f"{gear.material_where}.poisson_ratio")


def check_width_table(table: StiffnessTable, cause: tuple[str, Any] | None) -> None:
    """Raise `InputError` for keys with values that a load along the face width does not take.

    Parameters
    ----------
    table : StiffnessTable
        [stiffness].
    cause
        Key and value that let the load vary along the face width, for the message.
    """
    default = StiffnessTable()
    for key in PLANE_KEYS:
        value = getattr(table, key)
        if value != getattr(default, key):
            problem = f"is for loads alike along the face width, which {cause[0] if cause else 'this one'} makes vary"
            raise InputError(f"stiffness.{key}", value, problem, "leave it out: teeth are in three dimensions here")


def wide_mesh(job: StiffnessJob) -> WideMesh:
    """Return the gears of a job with their face widths, places and hands.

    Raises
    ------
    InputError
        For gears that have no common width, and a ring that is not held.
    """
    sense = axial_sense(job)
    places = [1e-3 * sense * gear.y_mm for gear in job.mesh.gears]
    given = [gear.narrow_web for gear in (job.pair.pinion, job.pair.wheel)]
    webs = [None if web is None else replace(web, offset=sense * web.offset) for web in given]
    try:
        return WideMesh(
            job.pair,
            centres=(places[0], places[1]),
            webs=(webs[0], webs[1]),
            materials=job.materials,
            coarsen=SECTION_COARSEN * job.table.coarsen,
            flank_coarsen=FLANK_COARSEN * job.table.flank_coarsen,
        )
    except InputError as error:
        if error.field == "centres":
            gear = job.mesh.driven
            raise InputError(f"{gear.where}.y_mm", gear.y_mm, error.problem, error.cure) from None
        if error.field == "widths":
            gear = min(job.mesh.gears, key=lambda gear: gear.form["face_width_mm"])
            where, width = gear.written("face_width_mm"), gear.form["face_width_mm"]
            raise InputError(f"{where}.face_width_mm", width, error.problem, "use a narrower gear") from None
        if error.field == "wheel.rim":
            raise InputError(f"{job.mesh.driven.where}.rim", error.value, error.problem, error.cure) from None
        raise


def wide_flanks(job: StiffnessJob, mesh: WideMesh) -> WideFlanks:
    """Return the driving flanks with their modifications, and the tilt of the axes."""
    sense, profiles = axial_sense(job), NOMINAL
    leads = [LeadModification(), LeadModification()]
    topographies: list[Topography | None] = [None, None]
    if job.mesh.deviates:
        profiles = deviations_of(job.mesh, job.pair, job.folder)
        for g, face in enumerate(mesh.faces):
            flank = FlankOf(job.mesh, job.pair, g, job.mesh.flank, job.folder)
            leads[g] = lead_modification(flank.own, sense)
            topographies[g] = _topography(flank, face, sense)
            _check_lengths(flank)
    for key in TILTS:
        if abs(1e-6 * getattr(job.mesh, key)) > MOST_GAP * job.pair.pinion.module:
            where = job.mesh.tilts_where
            raise InputError(f"{where}.{key}", getattr(job.mesh, key), _too_large(job.pair.pinion), "is it in um?")
    over = 1e-6 * sense / mesh.width
    tilt = Misalignment(over * job.mesh.misalignment_um, abs(over) * job.mesh.misalignment_across_um)
    flanks = WideFlanks(profiles, (leads[0], leads[1]), (topographies[0], topographies[1]), tilt)
    _check_gap(job, mesh, flanks)
    return flanks


def material_along(flank: FlankOf, face: tuple[float, float], roll: Array, y: Array) -> Array:
    """Return the material (m) of a flank's modifications along the width.

    Parameters
    ----------
    flank : FlankOf
        The flank of the job file.
    face : pair of float
        First and last y of the gear (m).
    roll, y : ndarray
        Roll lengths and places along the axes (m), of one shape.
    """
    added = lead_modification(flank.own, 1.0).material(y, face)
    topography = _topography(flank, face, 1.0)
    return added if topography is None else added + topography(roll, y, np.zeros(y.shape, dtype=np.int64))


def _check_lengths(flank: FlankOf) -> None:
    """Raise `InputError` for reliefs of ends and corners that are longer than the flank."""
    width, (form, tip) = 1e3 * flank.gear.face_width, (1e3 * end for end in ends_of(flank.gear))
    own = flank.own
    given: list[tuple[str, float | None, float]] = [
        ("end_relief_low_length_mm", own.end_relief_low_length_mm, width),
        ("end_relief_high_length_mm", own.end_relief_high_length_mm, width),
    ]
    for i, relief in enumerate(own.triangular_reliefs):
        given.append((f"triangular_reliefs[{i}].width_mm", relief.width_mm, width))
        given.append((f"triangular_reliefs[{i}].roll_length_mm", relief.roll_length_mm, abs(tip - form)))
    for key, value, most in given:
        if value is not None and value > most:
            what = "roll length of the flank" if "roll" in key else "face width"
            raise InputError(f"{flank.where}.{key}", value, f"must be <= {most:.6g} mm, the {what}", "give less")


def _check_gap(job: StiffnessJob, mesh: WideMesh, flanks: WideFlanks) -> None:
    """Raise `InputError` for a gap of both flanks and tilts that is no microgeometry, of its largest key."""
    z = np.linspace(*mesh.zone, 33)
    rolls = [np.array(ends_of(gear)) for gear in (job.pair.pinion, job.pair.wheel)]
    gap = flanks.misalignment.in_plane * (z - 0.5 * sum(mesh.zone))
    for g, face in enumerate(mesh.faces):
        # the form of one flank meets the tip of the other
        roll, at = (grid.ravel() for grid in np.meshgrid(rolls[g][:: 1 - 2 * g], z, indexing="ij"))
        material = flanks.leads[g].material(at, face)
        topography = flanks.topographies[g]
        if topography is not None:
            material = material + topography(roll, at, np.zeros(len(at), dtype=np.int64))
        gap = gap + material.reshape(2, len(z))
    if np.abs(gap).max() <= MOST_GAP * job.pair.pinion.module:
        return
    amounts: dict[str, float] = {f"{job.mesh.tilts_where}.{key}": getattr(job.mesh, key) for key in TILTS}
    for g in range(2 if job.mesh.deviates else 0):
        flank = FlankOf(job.mesh, job.pair, g, job.mesh.flank, job.folder)
        for key in ALONG_WIDTH:
            if key not in ("triangular_reliefs", "topography_csv"):
                amounts[f"{flank.where}.{key}"] = getattr(flank.own, key) or 0.0
        for i, relief in enumerate(flank.own.triangular_reliefs):
            amounts[f"{flank.where}.triangular_reliefs[{i}].amount_um"] = relief.amount_um
    key = max(amounts, key=lambda name: abs(amounts[name]))
    raise InputError(key, amounts[key], _too_large(job.pair.pinion), "use less modification and tilt")


def _too_large(gear: Gear) -> str:
    most = 1e6 * MOST_GAP * gear.module
    return f"leaves the range of microgeometry: gaps along the width must be <= {most:.4g} um, {MOST_GAP:g} module"


def lead_modification(table: FlankTable, sense: float) -> LeadModification:
    """Return the lead modification of a flank's table; `sense`: z over y."""
    exponent = EXPONENTS[table.end_relief_shape]
    reliefs = []
    for end in ("low", "high"):
        amount, length = getattr(table, f"end_relief_{end}_um"), getattr(table, f"end_relief_{end}_length_mm")
        reliefs.append(EndRelief(1e-6 * amount, 1e-3 * length, exponent) if amount else None)
    low, high = reliefs if sense > 0.0 else reliefs[::-1]
    return LeadModification(1e-6 * table.helix_crowning_um, 1e-6 * sense * table.helix_slope_um, low, high)


@dataclass(frozen=True)
class SumOfTopographies:
    """Material of several topographies of one flank."""

    parts: tuple[Topography, ...]

    @property
    def alike(self) -> bool:
        """Whether all teeth are alike."""
        return all(getattr(part, "alike", False) for part in self.parts)

    @property
    def kinks(self) -> Array:
        """Lines over z and roll length where one of them has kinks, shape (lines, 3)."""
        return np.concatenate([getattr(part, "kinks", np.zeros((0, 3))) for part in self.parts])

    def __call__(self, roll: Array, z: Array, tooth: IntArray) -> Array:
        """Material (m) at roll lengths and axial coordinates (m) of teeth."""
        return np.asarray(sum(part(roll, z, tooth) for part in self.parts))


def _topography(flank: FlankOf, face: tuple[float, float], sense: float) -> Topography | None:
    """Material of a flank that lead modifications do not hold, as z of the solver counts, or None."""
    most = MOST_GAP * flank.gear.module
    designed = _designed(flank.own, flank.gear, face, sense)
    parts = [part for part in (designed, measured_topography(flank, face, sense, most)) if part is not None]
    return SumOfTopographies(tuple(parts)) if len(parts) > 1 else next(iter(parts), None)


def _designed(table: FlankTable, gear: Gear, face: tuple[float, float], sense: float) -> FlankTopography | None:
    if not table.bias_um and not any(relief.amount_um for relief in table.triangular_reliefs):
        return None
    corners = tuple(
        (
            1e-6 * relief.amount_um,
            1e-3 * relief.width_mm,
            1e-3 * relief.roll_length_mm,
            relief.corner.startswith("tip"),
            relief.corner.endswith("high") == (sense > 0.0),
        )
        for relief in table.triangular_reliefs
    )
    return FlankTopography(ends_of(gear), face, 1e-6 * sense * table.bias_um, corners)


def job_lines(job: StiffnessJob, *, keep: Keep | None = None, watch: Stopwatch | None = None) -> ContactLines:
    """Return the lines of contact of a job; the elastic gears are kept, which flanks and loads do not change, and the
    laws of the last profiles.

    Parameters
    ----------
    job : StiffnessJob
        The gears and the model.
    keep
        Gives what a function makes, or what was made under that name before.
    watch
        Takes the time of the stages.
    """
    mesh = wide_mesh(job)
    flanks = wide_flanks(job, mesh)
    watch = watch or Stopwatch()

    def make() -> Any:
        return wide_compliance(mesh, watch=watch)

    compliance = make() if keep is None else keep("wide", make)
    with watch.stage("lines of contact"):
        if keep is None:
            return contact_lines(compliance, flanks)
        last: dict[str, ContactLines] = keep("lines", dict)
        profiles = cache_key("profiles", flanks.profiles)
        if profiles not in last:
            last.clear()
            last[profiles] = contact_lines(compliance, flanks)
        return last[profiles].with_flanks(flanks)


def stiffness_sweep(job: StiffnessJob, lines: ContactLines, watch: Stopwatch | None = None) -> WidthSweep:
    """Return the sweep of [stiffness]: one torque, or one twist, over its angles."""
    return _at_angles(job, lines, stiffness_angles(job), watch)


def position_sweep(job: StiffnessJob, lines: ContactLines, angle: float) -> WidthSweep:
    """Return the contact at one pinion angle (rad) under the load of [stiffness]."""
    return _at_angles(job, lines, np.array([angle]), None)


def _at_angles(job: StiffnessJob, lines: ContactLines, angles: Array, watch: Stopwatch | None) -> WidthSweep:
    t = job.table
    load: dict[str, Any] = {"torques": t.torque_Nm} if t.twist_deg is None else {"twists": math.radians(t.twist_deg)}
    try:
        return sweep_width(lines, **load, angles=angles, watch=watch)
    except InputError as error:
        if error.field == "twists":
            raise InputError("stiffness.twist_deg", t.twist_deg, error.problem, error.cure) from None
        raise


def job_sweep(
    job: StiffnessJob, lines: ContactLines, table: LoadMapTable | None, watch: Stopwatch | None = None
) -> WidthSweep:
    """Return the sweep of a load map's table, or of [stiffness] where it is None.

    Parameters
    ----------
    job : StiffnessJob
        Gears and model.
    lines : ContactLines
        Their lines of contact.
    table : LoadMapTable or None
        Torques and positions of a load map.
    watch : Stopwatch, optional
        Takes the time of the stages.
    """
    return stiffness_sweep(job, lines, watch) if table is None else map_sweep(job, lines, table, watch)


def stiffness_angles(job: StiffnessJob) -> Array:
    """Return the pinion angles of [stiffness] (rad)."""
    return np.radians(job.table.angles_deg(math.degrees(job.pair.mesh_cycle)))


def map_angles(job: StiffnessJob, table: LoadMapTable) -> Array:
    """Return the pinion angles of [loadmap] (rad)."""
    return np.arange(table.positions * (table.mesh_cycles or 1)) * job.pair.mesh_cycle / table.positions


def estimated_errors(
    job: StiffnessJob,
    lines: ContactLines,
    sweep: WidthSweep,
    table: LoadMapTable | None,
    watch: Stopwatch,
    solve: Callable[[ContactLines], WidthSweep] | None = None,
) -> dict[str, list[float]] | dict[str, float]:
    """Return relative errors of the headline numbers of a sweep: for each load of a map, or of the one of [stiffness].

    They are the differences by points doubled, by two more functions along the width, and by coarser sections. Those of
    sections `COARSENING` times coarser count over what the order of convergence makes of them.

    Parameters
    ----------
    job : StiffnessJob
        The gears and the model.
    lines : ContactLines
        Their lines of contact.
    sweep : WidthSweep
        The results.
    table : LoadMapTable, optional
        Of the load map, see `job_sweep`.
    watch
        Takes the time.
    solve : callable, optional
        Gives the sweep of other lines of contact where `job_sweep` does not: of gears that their shafts tilt.
    """
    mesh, flanks = lines.compliance.mesh, lines.flanks
    numbers = headline_numbers(sweep)
    found = {name: np.zeros(len(sweep.status)) for name in numbers}
    meshes = (
        (mesh, 1.0),
        (replace(mesh, functions=mesh.count + 2), 1.0),
        (replace(mesh, functions=mesh.count, coarsen=COARSENING * mesh.coarsen), COARSENING**ORDER - 1.0),
    )
    for variant, share in meshes:
        with watch.stage("error estimate"):
            if variant is mesh:
                changed = replace(lines, density=2.0 * lines.density)
            else:
                changed = contact_lines(wide_compliance(variant), flanks)
            other = headline_numbers(job_sweep(job, changed, table) if solve is None else solve(changed))
        for name, value in numbers.items():
            with np.errstate(invalid="ignore", divide="ignore"):
                found[name] += np.where(value != 0.0, np.abs(other[name] - value) / share / np.abs(value), np.nan)
    if table is None:
        return {name: float(errors[0]) for name, errors in found.items()}
    return {name: errors.tolist() for name, errors in found.items()}


def headline_numbers(sweep: WidthSweep) -> dict[str, Array]:
    """Return the headline numbers of each load of a sweep, in SI units; NaN where no position is solved."""
    error, peak = sweep.transmission_error, sweep.peak_line_load

    def of_solved(values: Array, what: Callable[..., Array]) -> Array:
        return np.array([what(row) if np.isfinite(row).any() else np.nan for row in values])

    return {
        "transmission_error_mean": of_solved(error, np.nanmean),
        "transmission_error_peak_to_peak": of_solved(error, lambda row: np.nanmax(row) - np.nanmin(row)),
        "k_mesh_mean": of_solved(sweep.secant, np.nanmean),
        "k_tangent_mean": of_solved(sweep.stiffness, np.nanmean),
        "largest_line_load": of_solved(peak, np.nanmax),
        "K_H_beta": sweep.k_h_beta,
        "K_H_alpha": sweep.k_h_alpha,
    }


def check_stiffness_job(job: StiffnessJob) -> None:
    """Raise `InputError` for what [stiffness] says of the load, and keys that a load along the width does not take."""
    job.check_load()
    check_width_job(job)
    if job.table.torque_Nm is not None:
        wide_mesh(job).check_torque(job.table.torque_Nm, "stiffness.torque_Nm")


def check_map_job(job: StiffnessJob, table: LoadMapTable) -> None:
    """Raise `InputError` for torques out of range, and keys that a load along the width does not take."""
    check_width_job(job)
    for torque in table.torques():
        wide_mesh(job).check_torque(torque, f"{table.NAME}.torques_Nm")
    alike = all(flank.alike for flank in deviations_of(job.mesh, job.pair, job.folder))
    if table.mesh_cycles is None and not (alike and wide_flanks(job, wide_mesh(job)).alike):
        problem = "is required where teeth differ and the load varies along the face width"
        raise InputError(f"{table.NAME}.mesh_cycles", None, problem, "give the mesh cycles to compute")


def map_sweep(
    job: StiffnessJob, lines: ContactLines, table: LoadMapTable, watch: Stopwatch | None = None
) -> WidthSweep:
    """Return the sweep of [loadmap]: its torques over its mesh cycles.

    Parameters
    ----------
    job : StiffnessJob
        The gears and the model.
    lines : ContactLines
        Their lines of contact.
    table : LoadMapTable
        Torques and positions.
    watch
        Takes the time of the stages.
    """
    return sweep_width(lines, table.torques(), angles=map_angles(job, table), watch=watch)
