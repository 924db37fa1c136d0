"""Files of a mechanism's links of finite elements: plates.csv, and plates.vtkhdf with displacement and stress."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..files import csv_table
from ..output.vtkhdf import VtkHdfSeries
from ..progress import stage
from ..rigid import Trajectory
from .link_files import frame_times
from .model import Mechanism
from .plates import PlateLink


@stage("elastic links")
def write_plates(folder: Path, mechanism: Mechanism, trajectory: Trajectory) -> None:
    """plates.csv: the named points of every link; plates.vtkhdf: the moving meshes; at the times of the frames."""
    times = frame_times(mechanism, trajectory)
    q = trajectory.dense(times)
    stresses = {name: trajectory.stress_at(link.element, times) for name, link in mechanism.plates.items()}
    with csv_table(folder / "plates.csv") as table:
        for name, link in mechanism.plates.items():
            for point in link.points:
                values = mechanism.values({(kind, f"{name}.{point}") for kind in ("x", "y", "angle")}, q)
                columns: dict[str, Any] = {
                    "time_s": times,
                    "link": [name] * len(times),
                    "point": [point] * len(times),
                }
                for kind, column in (("x", "x_m"), ("y", "y_m"), ("angle", "angle_rad")):
                    columns[column] = values[kind, f"{name}.{point}"]
                offset = link.offset(q, point, name)
                columns |= {"stretch_m": offset.real, "deflection_m": offset.imag}
                table.write(columns)
    links = list(mechanism.plates.values())
    starts = np.cumsum([0, *(link.mesh[0] for link in links)])
    cells = np.concatenate([s + link.part.plate.triangles for s, link in zip(starts[:-1], links, strict=True)])
    with VtkHdfSeries(folder / "plates.vtkhdf") as series:
        for i, time in enumerate(times):
            state = q[i : i + 1]
            places = np.concatenate([link.places(state)[0] for link in links])
            fields = [_fields(link, state, stresses[name][i]) for name, link in mechanism.plates.items()]
            joined = {key: np.concatenate([part[key] for part in fields]) for key in fields[0]}
            grid = {"triangle6": cells} if i == 0 else None
            series.add(float(time), np.stack([places.real, places.imag], axis=1), grid, point_data=joined)


def _fields(link: PlateLink, q: Any, stress: Any) -> dict[str, Any]:
    """Stresses and displacements at the nodes, in the axes of the link's own frame."""
    moved = link.displacements(q)[0]
    by_part = link.part.plate.stresses @ stress
    return {
        "von_mises_Pa": link.von_mises(stress),
        "stress_xx_Pa": by_part[:, 0],
        "stress_yy_Pa": by_part[:, 1],
        "stress_xy_Pa": by_part[:, 2],
        "displacement_x_m": moved.real,
        "displacement_y_m": moved.imag,
    }
