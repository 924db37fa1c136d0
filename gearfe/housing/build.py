"""From a ``[housing]`` table to a housing, and to its reduced body through the cache."""

from __future__ import annotations

import dataclasses
from contextlib import suppress
from pathlib import Path

import numpy as np

from .. import __version__
from ..cache import cache_key, kept
from ..config import load_job
from ..errors import InputError
from ..meshing.housing_mesh import RECIPE, bore_ranges, housing_mesh
from ..progress import stage
from ..reduction.modal_body import FORMAT, ModalBody
from ..solid import SolidMaterial
from ..tables.housing import HousingDampingTable, HousingReductionTable, HousingTable
from .attachments import PLACE_TOLERANCE, Bore
from .meshes import Prisms
from .model import Housing
from .own_mesh import fingerprint, own_housing
from .superelement import superelement


def housing_from_job(path: str | Path) -> Housing:
    """Housing of a job file's ``[housing]`` table; gmsh runs unless the mesh is in the cache."""
    return housing_from_table(load_job(path, ("housing",))["housing"], Path(path).parent)


def housing_from_table(table: HousingTable, folder: str | Path = ".") -> Housing:
    """Mesh (from the cache when it is there) with the bores as attachments 1, 2, ... and the feet held.

    Bores are numbered shaft by shaft, the +y wall before the -y wall; those of a mesh file, which is looked for in
    `folder`, as they are listed.
    """
    table.check("housing")
    if table.reduced:
        cure = "take gearfe.housing.build.reduced_housing"
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


def material(table: HousingTable) -> SolidMaterial:
    """The housing's material in SI units."""
    given = table.material
    return SolidMaterial(1e9 * given.youngs_modulus_GPa, given.poisson_ratio, given.density_kg_per_m3)


def bores(table: HousingTable) -> list[Bore]:
    """The bores (SI), in the order of the attachments."""
    found = []
    for shaft in table.shafts:
        for low, high in bore_ranges(table, shaft).values():
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


def reduced_housing(table: HousingTable, folder: str | Path = ".") -> ModalBody:
    """Reduced body of a ``[housing]`` table with its damping: from the cache when it was made before.

    A second run then starts neither gmsh nor the finite elements. Files that it names are looked for in `folder`.
    """
    table.check("housing")
    if table.body is not None:
        return damped(_loaded(Path(folder) / table.body), table)
    if table.superelement is not None:
        return damped(superelement(table.superelement, folder), table)
    recipe: list[object] = [dataclasses.replace(table, damping=HousingDampingTable()), RECIPE, FORMAT, __version__]
    if table.mesh.file is not None:
        recipe.append(fingerprint(Path(folder) / table.mesh.file, "housing.mesh"))

    def read(path: Path) -> ModalBody | None:
        with suppress(InputError):
            return ModalBody.load(path, verify=True)
        return None

    body = kept(
        "body",
        cache_key("body", recipe),
        read=read,
        make=lambda: reduced(housing_from_table(table, folder), table.reduction),
        write=lambda body, path: body.save(path),
    )
    return damped(body, table)


def _loaded(path: Path) -> ModalBody:
    try:
        return ModalBody.load(path, verify=True)
    except InputError as error:
        cure = "give housing.npz of gearfe housing, beside the job file"
        raise InputError("housing.body", str(path), error.problem, cure) from None


def reduced(housing: Housing, table: HousingReductionTable) -> ModalBody:
    """Reduced body with what a ``[housing.reduction]`` table asks for."""
    with stage("reducing the housing"):
        return housing.reduce(
            table.modes,
            below_hz=table.modes_below_Hz,
            least_modes=table.least_modes,
            quasi_static=table.quasi_static_levels,
            solver=table.solver,
        )


def damped(body: ModalBody, table: HousingTable) -> ModalBody:
    """The body with the damping of its ``[housing.damping]`` table."""
    given = table.damping
    ratio = given.ratio if isinstance(given.ratio, float) else np.array(given.ratio or (0.0,))
    return body.with_damping(ratio=ratio, alpha=given.rayleigh_alpha_per_s, beta=given.rayleigh_beta_s)


def bore_points(table: HousingTable, folder: str | Path) -> dict[str, tuple[float, float, float]]:
    """Name -> reference point (m) of the attachments of a mesh file or a reduced body."""
    if table.reduced:
        body = reduced_housing(table, folder)
        rows = zip(body.attachment_names, body.attachment_points, strict=True)
        return {name: (float(x), float(y), float(z)) for name, (x, y, z) in rows}
    made = housing_from_table(table, folder).attachments
    return {a.name: (float(a.point[0]), float(a.point[1]), float(a.point[2])) for a in made}
