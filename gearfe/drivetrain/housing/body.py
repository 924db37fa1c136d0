"""Reduced body of a ``[housing]`` table, from the cache when it was made before: no mesher, no matrices then."""

from __future__ import annotations

import dataclasses
from contextlib import suppress
from pathlib import Path

import numpy as np

from ...base.cache import cache_key, kept
from ...base.errors import InputError
from ...base.tables.housing import HousingDampingTable, HousingTable
from ...fem.meshing.housing_recipe import RECIPE
from ...fem.reduction.modal_body import FORMAT, ModalBody
from ...version import VERSION


def reduced_housing(table: HousingTable, folder: str | Path = ".") -> ModalBody:
    """Reduced body of a ``[housing]`` table with its damping: from the cache when it was made before.

    A second run then starts neither gmsh nor the finite elements. Files that it names are looked for in `folder`.
    """
    table.check("housing")
    if table.body is not None:
        return damped(_loaded(Path(folder) / table.body), table)
    if table.superelement is not None:
        from .superelement import superelement

        return damped(superelement(table.superelement, folder), table)
    recipe: list[object] = [dataclasses.replace(table, damping=HousingDampingTable()), RECIPE, FORMAT, VERSION]
    if table.mesh.file is not None:
        from ...fem.meshing.mesh_file import source_fingerprint

        recipe.append(source_fingerprint(Path(folder) / table.mesh.file, "housing.mesh"))

    def read(path: Path) -> ModalBody | None:
        with suppress(InputError):
            return ModalBody.load(path)
        return None

    def make() -> ModalBody:
        from .build import housing_from_table, reduced

        return reduced(housing_from_table(table, folder), table.reduction)

    body = kept(
        "body",
        cache_key("body", recipe),
        read=read,
        make=make,
        write=lambda body, path: body.save(path),
    )
    return damped(body, table)


def _loaded(path: Path) -> ModalBody:
    try:
        return ModalBody.load(path)
    except InputError as error:
        cure = "give housing.npz of gearfe housing, in the folder of the job file"
        raise InputError("housing.body", str(path), error.problem, cure) from None


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
    from .build import housing_from_table

    made = housing_from_table(table, folder).attachments
    return {a.name: (float(a.point[0]), float(a.point[1]), float(a.point[2])) for a in made}
