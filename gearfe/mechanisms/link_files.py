"""Files of a mechanism's flexible links: tables, and moving meshes with stress."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..base.files import csv_table
from ..base.progress import stage
from ..base.typing import Array
from ..multibody import Trajectory
from ..output.exchange.vtkhdf import VtkHdfSeries
from .model import Mechanism
from .plates import PlateLink, von_mises_of

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
    by_part = link.nodal_stresses(stress)
    return {
        "von_mises_Pa": von_mises_of(by_part),
        "stress_xx_Pa": by_part[:, 0],
        "stress_yy_Pa": by_part[:, 1],
        "stress_xy_Pa": by_part[:, 2],
        "displacement_x_m": moved.real,
        "displacement_y_m": moved.imag,
    }
