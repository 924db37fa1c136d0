"""Files of a mechanism's flexible links: links.csv, and links.vtkhdf with stress."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..files import csv_table
from ..output.vtkhdf import VtkHdfSeries
from ..progress import stage
from ..rigid import Trajectory
from ..typing import Array
from .model import Mechanism

#: Names of the forces at the nodes, in their order.
FORCES = ("axial_force_N", "shear_force_N", "bending_moment_N_m")


@stage("flexible links")
def write_links(folder: Path, mechanism: Mechanism, trajectory: Trajectory) -> None:
    """links.csv and links.vtkhdf: shape, forces and edge stress of every node at the times of the frames."""
    times = frame_times(mechanism, trajectory)
    q = trajectory.dense(times)
    forces = {n: link.beam.at_nodes(trajectory.stress_at(link.beam, times)) for n, link in mechanism.links.items()}
    with csv_table(folder / "links.csv") as table:
        for i, time in enumerate(times):
            for name, link in mechanism.links.items():
                count = len(link.beam.link.stations)
                columns: dict[str, Any] = {
                    "time_s": np.full(count, time),
                    "link": [name] * count,
                    "s_m": link.beam.link.stations,
                }
                at, offset = link.places(q[i : i + 1])[0], link.offsets(q[i : i + 1])[0]
                columns |= {"x_m": at[:, 0], "y_m": at[:, 1], "angle_rad": at[:, 2]}
                columns |= {"stretch_m": offset[:, 0], "deflection_m": offset[:, 1]}
                columns |= {key: forces[name][i, :, k] for k, key in enumerate(FORCES)}
                if link.beam.link.section.edge is not None:
                    columns["edge_stress_Pa"] = link.edge_stress(forces[name][i], name)
                else:
                    columns["edge_stress_Pa"] = np.full(count, np.nan)
                table.write(columns)
    with VtkHdfSeries(folder / "links.vtkhdf") as series:
        for i, time in enumerate(times):
            points, cells, data = [], [], []
            start = 0
            for name, link in mechanism.links.items():
                sides, values = _strip(link, q[i : i + 1], forces[name][i])
                n = len(sides) // 2
                one = start + np.arange(n - 1)
                cells.append(np.stack([one, one + 1, one + 1 + n, one + n], axis=1))
                points.append(sides)
                data.append(values)
                start += len(sides)
            joined = np.concatenate(data)
            fields = {
                "stress_Pa": joined[:, 0],
                "axial_force_N": joined[:, 1],
                "bending_moment_N_m": joined[:, 2],
                "deflection_m": joined[:, 3],
            }
            grid = {"quad": np.concatenate(cells)} if i == 0 else None
            series.add(float(time), np.concatenate(points), grid, point_data=fields)


def frame_times(mechanism: Mechanism, trajectory: Trajectory) -> Array:
    """Times of the frames; the one of a state of rest."""
    if len(trajectory.time) == 1:
        return np.asarray(trajectory.time, dtype=float)
    return np.linspace(trajectory.time[0], trajectory.time[-1], mechanism.file.run.frames)


def _strip(link: Any, q: Array, forces: Array) -> tuple[Array, Array]:
    """Both edges of a link (2 nodes, 2), and at them stress along the axis, axial force, moment and deflection."""
    section, at = link.beam.link.section, link.places(q)[0]
    edge = section.edge if section.edge is not None else float(np.sqrt(3.0 * section.second_moment / section.area))
    across = edge * np.stack([-np.sin(at[:, 2]), np.cos(at[:, 2])], axis=1)
    deflection = link.offsets(q)[0, :, 1]
    sides, values = [], []
    for sign in (-1.0, 1.0):
        stress = forces[:, 0] / section.area - sign * forces[:, 2] * edge / section.second_moment
        sides.append(at[:, :2] + sign * across)
        values.append(np.stack([stress, forces[:, 0], forces[:, 2], deflection], axis=1))
    return np.concatenate(sides), np.concatenate(values)
