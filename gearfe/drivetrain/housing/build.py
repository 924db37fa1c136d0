"""From a ``[housing]`` table to a housing with its mesh, and to its reduction."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...base.errors import InputError
from ...base.progress import stage
from ...base.tables.housing import HousingReductionTable, HousingTable
from ...base.tables.jobs import load_job
from ...fem.bodies.meshes import Prisms
from ...fem.meshing.housing_mesh import housing_mesh
from ...fem.plane import Material
from ...fem.reduction.modal_body import ModalBody
from .attachments import PLACE_TOLERANCE, Bore
from .model import Housing
from .own_mesh import own_housing


def housing_from_job(path: str | Path) -> Housing:
    """Housing of a job file's ``[housing]`` table; gmsh runs unless the mesh is in the cache."""
    return housing_from_table(load_job(path, ("housing",))["housing"], Path(path).parent)


def housing_from_table(table: HousingTable, folder: str | Path = ".") -> Housing:
    """Mesh (from the cache when it is there) with the bores as attachments 1, 2, ... and the feet held.

    Bores are numbered shaft by shaft, the +y wall before the -y wall. Those of a mesh file (searched for in `folder`)
    are numbered as listed.
    """
    table.check("housing")
    if table.reduced:
        cure = "take gearfe.drivetrain.housing.body.reduced_housing"
        raise InputError("housing", None, "is reduced: it has no mesh any more", cure)
    if table.mesh.file is not None:
        return own_housing(table, Path(folder), material(table))
    mesh = Prisms(housing_mesh(table))
    return Housing.of_mesh(
        mesh,
        bores(table),
        np.flatnonzero(foot_nodes(table, mesh.nodes) & table.feet.fixed),
        material=material(table),
        outer=lambda centres: ~inside_faces(table, centres),
    )


def material(table: HousingTable) -> Material:
    """The housing's material in SI units."""
    given = table.material
    return Material(1e9 * given.youngs_modulus_GPa, given.poisson_ratio, given.density_kg_per_m3)


def bores(table: HousingTable) -> list[Bore]:
    """The bores (SI), in the order of the attachments."""
    found = []
    for shaft in table.shafts:
        for low, high in table.bore_ranges(shaft):
            point = (1e-3 * shaft.x_mm, 0.0, 1e-3 * shaft.z_mm)
            along = (1e-3 * low, 1e-3 * high)
            found.append(Bore(point, (0.0, 1.0, 0.0), 1e-3 * shaft.bore_radius_mm, along))
    return found


def foot_nodes(table: HousingTable, nodes: np.ndarray) -> np.ndarray:
    """(n,) mask of the nodes on the bottoms of the feet."""
    x, z = 1e3 * nodes[:, 0], 1e3 * nodes[:, 2]
    slack = 1e3 * PLACE_TOLERANCE * float(np.ptp(nodes, axis=0).max())
    bottom = table.wall_z_mm[0] - table.base_thickness_mm
    outboard = (x <= table.wall_x_mm[0] + slack) | (x >= table.wall_x_mm[1] - slack)
    return np.asarray((np.abs(z - bottom) <= slack) & outboard)


def inside_faces(table: HousingTable, centres: np.ndarray) -> np.ndarray:
    """(f,) whether faces with these centres (m) bound the inner space between walls, base, end walls and cover."""
    (x0, x1), (z0, z1), half = table.wall_x_mm, table.wall_z_mm, 0.5 * table.inner_gap_mm
    first, last = table.end_wall_thickness_mm
    slack = 1e-6 * (x1 - x0)
    low = np.array([x0 + first, -half, z0]) - slack
    high = np.array([x1 - last, half, z1]) + slack
    place = 1e3 * centres
    return np.asarray(np.all((place >= low) & (place <= high), axis=1))


def reduced(housing: Housing, table: HousingReductionTable) -> ModalBody:
    """Reduced body by a ``[housing.reduction]`` table."""
    with stage("reducing the housing"):
        return housing.reduce(
            table.modes,
            below_hz=table.modes_below_Hz,
            least_modes=table.least_modes,
            quasi_static=table.quasi_static_levels,
        )
