"""Computed values next to those that a rating takes: stiffness, pressure, root stress, load factor of the width.

Loads are nominal, those of the rating without its factors K. If one pair of teeth carries the whole load, the
standard's stress at B, C and D still contains Z_eps for the other pair. The computed pressure does not. Root stresses
are the largest at positions with one loaded pair, next to sigma_F0 with the load at the outer point of single pair
contact.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ...base.errors import given
from ...base.shown import percent
from ..contact.laws import PairModel, check_torque
from ..rating.rate import Rating
from ..width import sweep_width
from .job import StiffnessJob
from .load_map import LoadMap
from .sweep import sweep_loads
from .width_job import check_width_job, job_lines
from .width_report import hertzian_pressures
from .width_root import roots_of_cells, wide_roots

#: Names of the rows of face load factor and dynamic factor.
FACE_LOAD, DYNAMIC = "K_Hbeta", "K_v"
#: Positions in a mesh cycle, and in the stretch with one pair in contact.
POSITIONS, SINGLE = 24, 9


@dataclass(frozen=True)
class Compared:
    """A value of the standard and the computed one, with its estimated relative error where there is one."""

    name: str
    unit: str
    standard: float
    computed: float
    meaning: str
    error: float | None = None
    remark: str = ""

    @property
    def difference(self) -> float:
        """Computed over standard less 1 (-)."""
        return self.computed / self.standard - 1.0

    def row(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {**asdict(self), "difference": self.difference}


def compared(job: StiffnessJob, rating: Rating) -> list[Compared]:
    """Compute a rated mesh by finite elements under its nominal load.

    Parameters
    ----------
    job : StiffnessJob
        The mesh.
    rating : Rating
        Its rating.

    Returns
    -------
    rows : list of Compared
        Stiffness, pressure and root stress; of gears whose load varies along the width K_Hbeta, too.

    Raises
    ------
    InputError
        For a torque out of range, and what the computation refuses.
    """
    torque = 0.5 * rating.general.F_t_N * job.pair.wheel.pitch_diameter
    check_torque(job.pair, PairModel(job.materials), torque, "rating.torque_driver_Nm")
    return _of_width(job, rating, torque) if job.mesh.along_width() else _of_sections(job, rating, torque)


def _of_width(job: StiffnessJob, rating: Rating, torque: float) -> list[Compared]:
    """Stiffness and load factor of gears whose load varies along the face width."""
    check_width_job(job)
    general, flank = rating.general, rating.flank
    # the load factor is of the mean load F_m of the standard; all else of the nominal load
    lines = job_lines(job)
    sweep = sweep_width(lines, [torque, torque * general.K_A * general.K_gamma * general.K_v])
    mean = float(np.nanmean(sweep.stiffness[0]))
    stiffness = mean / job.pair.wheel.base_radius**2 / job.pair.common_width
    rows = [
        Compared(
            "c_gamma", "N/(mm um)", general.c_gamma_alpha_N_per_mm_um, 1e-9 * stiffness, "mean stiffness of the mesh"
        ),
        Compared(
            FACE_LOAD,
            "-",
            general.K_Hbeta,
            float(sweep.k_h_beta[1]),
            "face load factor; computed: of the modifications and tilts of the file under F_m",
        ),
    ]
    nominal = sweep.points.load == 0
    pressure = hertzian_pressures(job, sweep.points.roll, sweep.points.line_load)[nominal]
    if np.isfinite(pressure).any():
        spread = math.sqrt(general.K_Hbeta * general.K_Halpha)
        standard = max(flank.Z_BD) * flank.sigma_H0_MPa * spread
        meaning = "largest contact stress, with K_Hbeta and K_Halpha; computed over the flanks, without edges"
        rows.append(Compared("largest pressure", "MPa", standard, 1e-6 * float(np.nanmax(pressure)), meaning))
    roots = wide_roots(lines, sweep)
    cells = roots_of_cells(roots, sweep.status.shape)
    stress = cells.stress[0]
    ends = float(roots.z.min(axis=1).max()), float(roots.z.max(axis=1).min())
    for i, name in enumerate(rating.names):
        largest = stress[:, rating.of_pair[i]]
        if np.isfinite(largest).any():
            standard = rating.root.sigma_F0_MPa[i] * general.K_Fbeta * general.K_Falpha
            meaning = "largest root stress, with K_Fbeta and K_Falpha; computed over width and mesh cycle"
            at = int(np.nanargmax(largest))
            error, place = (float(values[0, at, rating.of_pair[i]]) for values in (cells.error, cells.z))
            remark = ""
            if min(place - ends[0], ends[1] - place) < job.pair.pinion.module:
                remark = (
                    f"largest at y = {1e3 * place:.4g} mm, at the end of the face width: a loaded edge there gives a "
                    "local stress, which is not the bending stress of ISO 6336-3"
                )
            largest_MPa = 1e-6 * float(largest[at])
            rows.append(Compared(f"root stress {name}", "MPa", standard, largest_MPa, meaning, error, remark))
    return [row for row in rows if math.isfinite(row.computed)]


def _of_sections(job: StiffnessJob, rating: Rating, torque: float) -> list[Compared]:
    """Stiffness, pressure at B, C and D and root stresses of plane sections."""
    pair = job.pair
    points = {name: pair.path[name] for name in ("B", "C", "D")}
    low, high = points["B"].pinion_angle, points["D"].pinion_angle
    cycle = np.arange(POSITIONS) * pair.mesh_cycle / POSITIONS
    angles = np.concatenate([cycle, np.linspace(low, high, SINGLE), [point.pinion_angle for point in points.values()]])
    load_map = sweep_loads(
        pair, [torque], angles=angles, root_stress=True, kinematics=job.table.kinematics, elastic=job.elastic()
    )
    single = _single(load_map)
    tangent, width, general = load_map.quantity("k_tangent")[0], pair.common_width, rating.general
    rows = []
    if single.any():
        rows.append(
            Compared(
                "c_prime",
                "N/(mm um)",
                general.c_prime_N_per_mm_um,
                1e-9 * float(np.nanmax(tangent[single])) / width,
                "largest stiffness of one pair of teeth",
            )
        )
    mean = 1e-9 * float(np.nanmean(tangent[:POSITIONS])) / width
    rows.append(Compared("c_gamma", "N/(mm um)", general.c_gamma_alpha_N_per_mm_um, mean, "mean stiffness of the mesh"))
    # the pinion of the pair has its inner point of single pair contact at B; two pairs: M is of other points
    inner = {("B", "D")[of_pair]: M for of_pair, M in zip(rating.of_pair, rating.flank.M, strict=True)}
    for at, (name, point) in enumerate(points.items()):
        if name in inner and not single.any():
            continue
        found, share = _pressure(load_map, POSITIONS + SINGLE + at, point.pinion_roll)
        standard = rating.flank.sigma_H0_MPa * inner.get(name, 1.0)
        meaning = f"nominal contact stress; computed where this pair carries {share:.3g} of the load"
        rows.append(Compared(f"pressure at {name}", "MPa", standard, 1e-6 * found, meaning))
    root = load_map.root
    if root is not None and single.any():
        for i, name in enumerate(rating.names):
            largest = 1e-6 * float(np.nanmax(root.largest[0, single, rating.of_pair[i]]))
            rows.append(
                Compared(f"root stress {name}", "MPa", rating.root.sigma_F0_MPa[i], largest, "nominal root stress")
            )
    sliding = _loss(load_map)
    rows.append(Compared("H_V", "-", rating.loss.H_V, sliding, "loss factor, computed with the load shares"))
    return [row for row in rows if math.isfinite(row.computed)]


def _loss(load_map: LoadMap) -> float:
    """H_V of the computed loads: mean of the forces times sliding speeds over the power, for a friction of 1."""
    (pairs,), mesh = load_map.pairs, given(load_map.pair, "pair")
    here = pairs.position < POSITIONS
    way = np.abs(pairs.roll[here, 0] - mesh.path["C"].pinion_roll)
    at_edges = max(abs(mesh.path[end].pinion_roll - mesh.path["C"].pinion_roll) for end in ("A", "E"))
    way = np.where(np.isfinite(way), way, at_edges)
    speed = way * (1.0 + 1.0 / mesh.gear_ratio) / mesh.pinion.base_radius
    return float(np.sum(pairs.share[here] * speed)) / POSITIONS


def _single(load_map: LoadMap) -> Any:
    """Whether one pair of teeth alone carries load at each position."""
    (pairs,) = load_map.pairs
    return np.bincount(pairs.position, minlength=load_map.shape[1]) == 1


def _pressure(load_map: LoadMap, position: int, roll: float) -> tuple[float, float]:
    """Pressure (Pa) and load share of the pair of teeth that touch nearest to a roll length (m) on the pinion."""
    (pairs,) = load_map.pairs
    here = np.flatnonzero((pairs.position == position) & np.isfinite(pairs.roll[:, 0]))
    if not len(here):
        return math.nan, math.nan
    nearest = here[np.argmin(np.abs(pairs.roll[here, 0] - roll))]
    return float(pairs.pressure[nearest]), float(pairs.share[nearest])


def compared_lines(rows: list[Compared]) -> list[str]:
    """Lines to print."""
    lines = [f"  {'nominal load':<26}{'ISO 6336':>12}{'computed':>12}{'difference':>12}"]
    for row in rows:
        unit = "" if row.unit == "-" else f" {row.unit}"
        lines.append(
            f"  {row.name + unit:<26}{row.standard:>12.5g}{row.computed:>12.5g}{100.0 * row.difference:>+11.1f} %"
            + ("" if row.error is None else f"  (estimated error {percent(row.error)})")
        )
        if row.remark:
            lines.append(f"    {row.remark}")
    return lines
