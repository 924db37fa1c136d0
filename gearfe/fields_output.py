"""Fields of chosen positions of a sweep as files: a VTKHDF series and pictures of the stress in the meshing zone."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .contact.scene import MeshingPair
from .drawing import zone
from .errors import InputError
from .fields import GearField, pair_recovery, straight_triangles
from .gear import GearPair
from .output.figures import stress_figure
from .output.vtkhdf import VtkHdfSeries
from .routes import Router
from .stiffness_curve import StiffnessCurve
from .threads import one_thread

Array = NDArray[Any]


def chosen_positions(curve: StiffnessCurve, angles_deg: Sequence[float] | None) -> NDArray[np.int64]:
    """Numbers of the positions of a curve at given pinion angles (deg), all without them, in the order of the angles.

    Positions without a solution are left out.
    """
    if angles_deg is None:
        found = np.arange(len(curve.pinion_angle))
    else:
        found = np.unique(angle_numbers(np.degrees(curve.pinion_angle), angles_deg))
    found = found[curve.status[found] == "converged"]
    return found[np.argsort(curve.pinion_angle[found], kind="stable")]


def angle_numbers(known_deg: Array, angles_deg: Sequence[float]) -> NDArray[np.int64]:
    """Numbers of given angles among the sweep's angles (deg).

    Raises
    ------
    InputError
        For an angle that is none of them.
    """
    found = []
    for angle in angles_deg:
        nearest = int(np.argmin(np.abs(known_deg - angle)))
        if not abs(known_deg[nearest] - angle) <= 1e-6:
            problem = f"is none of the sweep's angles; the nearest is {known_deg[nearest]:.6g} deg"
            raise InputError("--fields", angle, problem, "choose one of them, or change --angles")
        found.append(nearest)
    return np.array(found, dtype=np.int64)


def write_fields(
    folder: Path,
    pair: GearPair,
    elastic: MeshingPair,
    curve: StiffnessCurve,
    angles_deg: Sequence[float] | None,
    *,
    progress: Callable[[int, int, str], None] | None = None,
) -> list[str]:
    """Write ``fields.vtkhdf`` (time: pinion angle in deg) and pictures; return the files' names.

    Without a single solution nothing is written.

    Parameters
    ----------
    folder
        Where to write.
    angles_deg
        Pinion angles (deg) out of the curve's; None writes all, and the picture of the most stressed one only.
    """
    chosen = chosen_positions(curve, angles_deg)
    if len(chosen) == 0:
        return []
    recovery, router = pair_recovery(elastic), Router(pair, elastic)
    names = ["fields.vtkhdf"]
    worst: tuple[float, int, tuple[GearField, GearField]] | None = None
    with VtkHdfSeries(folder / "fields.vtkhdf") as series, one_thread():
        for done, number in enumerate(chosen, start=1):
            angle, twist = float(curve.pinion_angle[number]), float(curve.twist[number] + curve.lost_motion)
            position = router.solve(np.array([angle]), np.array([twist]), kept=[0])[0]
            fields = recovery.at(position, angle, twist)
            _add(series, math.degrees(angle), fields, first=done == 1)
            if angles_deg is not None:
                names.append(_picture(folder, pair, fields, angle, twist))
            else:
                peak = max(float(f.von_mises.max()) for f in fields)
                if worst is None or peak > worst[0]:
                    worst = (peak, int(number), fields)
            if progress is not None:
                progress(done, len(chosen), "fields")
    if worst is not None:
        number = worst[1]
        twist = float(curve.twist[number] + curve.lost_motion)
        names.append(_picture(folder, pair, worst[2], float(curve.pinion_angle[number]), twist))
    return names


def _add(series: VtkHdfSeries, time: float, fields: tuple[GearField, GearField], *, first: bool) -> None:
    """Both gears as one grid; the elements are stored with the first step only."""
    pinion, wheel = fields
    cells = None
    if first:
        cells = {"triangle6": np.concatenate([pinion.triangles, wheel.triangles + len(pinion.points)])}
    series.add(
        time,
        np.concatenate([f.points for f in fields]),
        cells,
        point_data={
            "displacement_m": np.concatenate([f.displacement for f in fields]).astype(np.float32),
            "von_mises_Pa": np.concatenate([f.von_mises for f in fields]).astype(np.float32),
        },
        cell_data={"gear": np.repeat(np.array([0, 1], dtype=np.uint8), [len(f.triangles) for f in fields])},
    )


def _picture(folder: Path, pair: GearPair, fields: Sequence[GearField], angle: float, twist: float) -> str:
    name = f"stress_{math.degrees(angle):.6g}deg.png"
    parts = [(1e3 * (f.points + f.displacement), straight_triangles(f.triangles), 1e-6 * f.von_mises) for f in fields]
    title = (
        f"Gear pair {pair.pinion.teeth}/{pair.wheel.teeth}, pinion at {math.degrees(angle):.6g}°, "
        f"wheel twisted by {math.degrees(twist):.4g}°, deformation to scale"
    )
    stress_figure(folder / name, title=title, parts=parts, zoom=zone(pair, modules=1.5))
    return name
