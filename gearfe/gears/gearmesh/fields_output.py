"""Fields of chosen positions of a sweep as files: a VTKHDF series, and the pressures along the flanks."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import InputError
from ...base.files import write_csv
from ...base.progress import announce, count, one_thread
from ...base.typing import Array, IntArray
from ...output.exchange.vtkhdf import VtkHdfSeries
from ..contact.compliance import MeshingPair
from ..contact.position import Positions
from ..geometry.deviation_job import GEARS
from ..geometry.pair import GearPair
from ..width import ContactLines, WidthSweep
from .curve import StiffnessCurve
from .fields import FlankPressure, GearField, flank_pressures, solved_fields
from .job import StiffnessJob
from .width_fields import SectionField, SolidField, solid_fields
from .width_job import axial_sense


def chosen_positions(curve: StiffnessCurve, angles_deg: Sequence[float] | None) -> IntArray:
    """Numbers of the positions of a curve at given pinion angles (deg), all without them, in the order of the angles.

    Positions without a solution are left out.
    """
    if angles_deg is None:
        found = np.arange(len(curve.pinion_angle))
    else:
        found = np.unique(angle_numbers(np.degrees(curve.pinion_angle), angles_deg))
    found = found[curve.status[found] == "converged"]
    return found[np.argsort(curve.pinion_angle[found], kind="stable")]


def angle_numbers(known_deg: Array, angles_deg: Sequence[float]) -> IntArray:
    """Numbers of the computed angles (deg) that are nearest to given ones.

    Raises
    ------
    InputError
        For an angle that is farther from all of them than one step.
    """
    found = np.abs(known_deg - np.reshape(angles_deg, (-1, 1))).argmin(axis=1)
    step = np.diff(np.sort(known_deg)).max(initial=1e-6)
    for angle, nearest in zip(angles_deg, known_deg[found], strict=True):
        if not abs(nearest - angle) <= step + 1e-6:
            problem = f"is outside of the computed pinion angles; the nearest is {nearest:.6g} deg"
            raise InputError("--fields", angle, problem, "choose an angle within them, or change --angles")
    return found


def announce_nearest(known_deg: Array, angles_deg: Sequence[float]) -> None:
    """Print which computed angle (deg) stands for each of the given ones that is none itself.

    Raises
    ------
    InputError
        See `angle_numbers`.
    """
    nearest = known_deg[angle_numbers(known_deg, angles_deg)]
    for angle, taken in zip(angles_deg, nearest, strict=True):
        if abs(taken - angle) > 1e-6:
            announce(f"--fields {angle:g}: fields of the nearest computed pinion angle, {taken:.6g} deg")


def write_fields(
    folder: Path,
    elastic: MeshingPair,
    curve: StiffnessCurve,
    angles_deg: Sequence[float] | None,
    *,
    draw: Callable[[Positions, tuple[GearField, GearField]], None] | None,
) -> list[tuple[float, list[FlankPressure]]]:
    """Write ``fields.vtkhdf`` (time: pinion angle in deg) and ``pressure.csv``.

    Without a single solution nothing is written.

    Parameters
    ----------
    folder
        Where to write.
    elastic : MeshingPair
        The condensed gears.
    curve : StiffnessCurve
        Solved positions.
    angles_deg
        Pinion angles (deg) out of the curve's; None writes all.
    draw
        Called with the chosen positions and their fields; of all positions with the most stressed one alone.

    Returns
    -------
    list of (float, list of FlankPressure)
        Pinion angles (deg), and the pressures along the flanks.
    """
    chosen = chosen_positions(curve, angles_deg)
    if len(chosen) == 0:
        return []
    peak, worst = -math.inf, None
    pressures: list[tuple[float, list[FlankPressure]]] = []
    with VtkHdfSeries(folder / "fields.vtkhdf") as series, one_thread():
        places = curve.pinion_angle[chosen], curve.twist[chosen] + curve.lost_motion
        for done, (position, fields) in enumerate(solved_fields(elastic, *places), start=1):
            angle = math.degrees(position.pinion_angle)
            pressures.append((angle, flank_pressures(elastic, position)))
            _add(series, angle, fields, first=done == 1)
            most = max(float(field.von_mises.max()) for field in fields)
            if angles_deg is not None:
                if draw is not None:
                    draw(position, fields)
            elif most > peak:
                peak, worst = most, (position, fields)
            count(done, len(chosen), "fields")
    if worst is not None and draw is not None:
        draw(*worst)
    write_csv(folder / "pressure.csv", pressure_table(elastic.gears, pressures))
    return pressures


def fields_size(elastic: MeshingPair, positions: int) -> int:
    """Bytes of ``fields.vtkhdf`` with so many positions, without headers and the rounding of its arrays to whole MB.

    A position has three coordinates of 8 bytes and eight values of 4 bytes at each node, and a byte for each element.
    The elements themselves (six numbers of 8 bytes, an offset and a kind) are stored once.
    """
    nodes = sum(body.teeth * (len(body.mesh.points) - len(body.mesh.cut_left)) for body in elastic.bodies)
    elements = sum(body.teeth * len(body.mesh.triangles) for body in elastic.bodies)
    return positions * (56 * nodes + elements) + 57 * elements


def size_note(elastic: MeshingPair, known_deg: Array, angles_deg: Sequence[float] | None) -> str:
    """How large the fields become, and what makes them smaller."""
    count = len(known_deg) if angles_deg is None else len(angles_deg)
    text = f"fields of {count} position{'s' if count > 1 else ''} take {fields_size(elastic, count) / 1e6:.3g} MB"
    cycle = np.degrees(2.0 * math.pi / elastic.bodies[0].teeth)
    first = int((known_deg < known_deg[0] + cycle * (1.0 - 1e-9)).sum())
    if angles_deg is not None or count == 1:
        return text
    if first == count:
        few = known_deg[[0, count // 2]]
        return f"{text}; fewer: --fields " + " ".join(f"{angle:.6g}" for angle in few)
    less = fields_size(elastic, first) / 1e6
    return (
        f"{text}; less: --fields {known_deg[0]:.6g} ... {known_deg[first - 1]:.6g}, the {first} angles of one mesh "
        f"cycle, take {less:.3g} MB, a single angle {fields_size(elastic, 1) / 1e6:.3g} MB"
    )


def write_solid_fields(
    folder: Path,
    job: StiffnessJob,
    lines: ContactLines,
    sweep: WidthSweep,
    angles_deg: Sequence[float] | None,
    *,
    draw: Callable[[tuple[int, int], tuple[SectionField, SectionField]], None] | None,
) -> None:
    """Write ``fields.vtkhdf`` of gears with face widths, in space (time: pinion angle in deg).

    The axes are those of the job file: its third coordinate is y along the axes. Without a single solution nothing is
    written.

    Parameters
    ----------
    folder
        Where to write.
    job : StiffnessJob
        Gears and model.
    lines : ContactLines
        Their lines of contact.
    sweep : WidthSweep
        Solved positions of one load.
    angles_deg
        Pinion angles (deg) out of the sweep's; None writes all.
    draw
        Called with each position and the sections of both gears nearest to the largest line load; of all positions
        with the most stressed one alone.
    """
    known = np.degrees(sweep.angle)
    numbers = np.arange(len(known)) if angles_deg is None else np.unique(angle_numbers(known, angles_deg))
    numbers = numbers[sweep.status[0, numbers] == "converged"]
    if len(numbers) == 0:
        return
    ordered = numbers[np.argsort(known[numbers], kind="stable")]
    peak, worst = -math.inf, None
    with VtkHdfSeries(folder / "fields.vtkhdf") as series:
        cells = [(0, int(number)) for number in ordered]
        for done, (cell, fields) in enumerate(solid_fields(lines, sweep, cells), start=1):
            if done == 1 and len(cells) > 1:
                nodes = sum(field.pressure.size for field in fields)
                announce(f"fields of {len(cells)} positions take {len(cells) * 56 * nodes / 1e6:.3g} MB and more")
            seen = fields if axial_sense(job) > 0.0 else (fields[0].mirrored(), fields[1].mirrored())
            _add_solids(series, float(known[cell[1]]), seen, first=done == 1)
            most = max(float(field.von_mises.max()) for field in seen)
            if draw is not None and (angles_deg is not None or most > peak):
                at = axial_sense(job) * sweep.peak_z[cell]
                pinion, wheel = (field.section(int(np.abs(field.z - at).argmin())) for field in seen)
                if angles_deg is not None:
                    draw(cell, (pinion, wheel))
                else:
                    peak, worst = most, (cell, (pinion, wheel))
            count(done, len(cells), "fields")
    if worst is not None and draw is not None:
        draw(*worst)


def _add_solids(series: VtkHdfSeries, time: float, fields: tuple[SolidField, SolidField], *, first: bool) -> None:
    """Both gears in space as one grid; the elements are stored with the first step only."""
    pinion, wheel = fields
    cells = {"wedge18": np.concatenate([pinion.wedges, wheel.wedges + pinion.pressure.size])} if first else None

    def both(values: Sequence[Array]) -> Array:
        flat = [value.reshape(-1, *value.shape[2:]) for value in values]
        return np.concatenate(flat).astype(np.float32)

    principal = [field.principal for field in fields]
    series.add(
        time,
        np.concatenate([field.points.reshape(-1, 3) for field in fields]),
        cells,
        point_data={
            "displacement_m": both([field.displacement for field in fields]),
            "von_mises_Pa": both([field.von_mises for field in fields]),
            **{f"principal_{i + 1}_Pa": both([values[..., i] for values in principal]) for i in range(3)},
            "contact_pressure_Pa": both([field.pressure for field in fields]),
        },
        cell_data={"gear": np.repeat(np.array([0, 1], dtype=np.uint8), [len(field.wedges) for field in fields])},
    )


def _add(series: VtkHdfSeries, time: float, fields: tuple[GearField, GearField], *, first: bool) -> None:
    """Both gears as one grid; the elements are stored with the first step only."""
    pinion, wheel = fields
    cells = None
    if first:
        cells = {"triangle6": np.concatenate([pinion.triangles, wheel.triangles + len(pinion.points)])}

    def both(values: Sequence[Array]) -> Array:
        return np.concatenate(values).astype(np.float32)

    principal = [f.principal for f in fields]
    series.add(
        time,
        np.concatenate([f.points for f in fields]),
        cells,
        point_data={
            "displacement_m": both([f.displacement for f in fields]),
            "von_mises_Pa": both([f.von_mises for f in fields]),
            **{f"principal_{i + 1}_Pa": both([p[i] for p in principal]) for i in range(3)},
            "contact_pressure_Pa": both([f.pressure for f in fields]),
        },
        cell_data={"gear": np.repeat(np.array([0, 1], dtype=np.uint8), [len(f.triangles) for f in fields])},
    )


def pressure_table(pair: GearPair, pressures: Sequence[tuple[float, list[FlankPressure]]]) -> dict[str, list[Any]]:
    """Columns of pressure.csv: every contact point that carries pressure, and its neighbours on either side.

    Parameters
    ----------
    pressures
        For each position its pinion angle (deg) and the pressures along its flanks.
    """
    names = ("pinion_angle_deg", "gear", "pair", "tooth", "diameter_mm", "roll_length_mm", "pressure_MPa")
    columns: dict[str, list[Any]] = {name: [] for name in names}
    for angle, flanks in pressures:
        for one in flanks:
            gear = (pair.pinion, pair.wheel)[one.gear]
            for k in one.shown:
                above = one.radius[k] > gear.base_radius
                row = (angle, GEARS[one.gear], one.pair, one.tooth % gear.tooth_count, 2e3 * one.radius[k])
                roll = 1e3 * gear.roll_length(float(one.radius[k])) if above else math.nan
                for name, value in zip(names, (*row, roll, 1e-6 * one.pressure[k]), strict=True):
                    columns[name].append(value)
    return columns
