"""Job files: which tables there are, and those that a command reads.

A job file may hold the tables of several jobs: a command reads those it needs by `load_job`. In the others, keys, types
and ranges are checked, so a misspelt key is an error in any table. Rules that join several keys are not checked.
"""

from __future__ import annotations

import importlib
import typing
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..config import build, read_toml
from ..errors import InputError, unknown_key, unknown_name
from .gearbox import Gearbox, NamedMesh, named_gearbox, pair_gearbox
from .loadmap import TORQUES, LoadMapTable
from .names import named_tables
from .pair import LOADS, StiffnessTable

if TYPE_CHECKING:
    from .train import TrainTable

#: Table name in a job file -> "module:class" of the dataclass that describes it. Each module is light (no numpy).
TABLES: dict[str, str] = {
    "pair": "gearfe.base.tables.pair:PairTable",
    "stiffness": "gearfe.base.tables.pair:StiffnessTable",
    "loadmap": "gearfe.base.tables.loadmap:LoadMapTable",
    "microgeometry": "gearfe.base.tables.microgeometry:MicrogeometryTable",
    "rating": "gearfe.base.tables.rating:RatingTable",
    "housing": "gearfe.base.tables.housing:HousingTable",
    "train": "gearfe.base.tables.train:TrainTable",
    "modes": "gearfe.base.tables.modes:ModesTable",
    "runup": "gearfe.base.tables.runup:RunUpTable",
    "spectrum": "gearfe.base.tables.spectrum:SpectrumTable",
    "report": "gearfe.base.tables.report:ReportTable",
    "study": "gearfe.base.tables.study:StudyTable",
}
#: Tables of tables by name, [gears.NAME] and so on -> "module:class" of the dataclass of an entry. Like those above,
#: modules are imported when a file names their table.
NAMED: dict[str, str] = {
    "gears": "gearfe.base.tables.named:NamedGearTable",
    "meshes": "gearfe.base.tables.named:NamedMeshTable",
    "shafts": "gearfe.base.tables.named:NamedShaftTable",
    "bearings": "gearfe.base.tables.named:NamedBearingTable",
    "machines": "gearfe.base.tables.driveline:MachineTable",
    "couplings": "gearfe.base.tables.driveline:CouplingTable",
    "carriers": "gearfe.base.tables.carrier:CarrierTable",
    "materials": "gearfe.base.tables.pair:MaterialTable",
}
#: Tables that were: what became of them, and what to write instead.
REMOVED_TABLES = {
    "relief": (
        "is gone: the best relief is a search of gearfe study",
        'take the table out; [study] with design = "search" varies [microgeometry] (gearfe new relief.toml)',
    ),
}


def load_job(path: str | Path, needed: tuple[str, ...], optional: tuple[str, ...] = ()) -> dict[str, Any]:
    """Read the `needed` (and, where present, `optional`) tables of a job file; check keys and ranges of all others.

    Returns
    -------
    dict
        Table name -> dataclass instance.
    """
    return job_tables(read_toml(path), path, needed, optional)


def job_tables(
    raw: dict[str, Any], path: str | Path, needed: tuple[str, ...], optional: tuple[str, ...] = ()
) -> dict[str, Any]:
    """Return the asked tables of a parsed job, checked.

    Parameters
    ----------
    raw : dict
        The parsed job.
    path : path
        Its file, named in messages.
    needed : tuple of str
        Tables that must be there.
    optional : tuple of str
        Tables that are returned if they are there.

    Raises
    ------
    InputError
        For unknown or missing tables, and for every mistake in a known one.
    """
    for name, table in raw.items():
        if name in REMOVED_TABLES:
            raise InputError(f"[{name}]", None, *REMOVED_TABLES[name])
        if name not in TABLES and name not in NAMED:
            if {"run", "bodies"} <= raw.keys():
                raise InputError("job file", str(path), "describes a mechanism", "run it: gearfe mechanism FILE")
            raise unknown_key("", name, table, [*TABLES, *NAMED], field=f"job file {Path(path).name}")
    _check_shorthand(raw)
    for name in needed:
        if name not in raw:
            cure = f"add a table [{name}] (see gearfe new)"
            raise InputError(f"[{name}]", None, f"is missing in {Path(path).name}", cure)
    built: dict[str, Any] = {}
    for name, table in raw.items():
        asked = name in needed or name in optional
        if name in NAMED:
            found = named_tables(name, table_class(name), table, rules=asked)
        else:
            found = build(table_class(name), table, name, rules=asked)
        if asked:
            built[name] = found
    return built


def _check_shorthand(raw: Mapping[str, Any]) -> None:
    """Raise `InputError` for tables of gears by name beside the shorthand of a pair, and for some without others."""
    named = next((kind for kind in NAMED if kind in raw), None)
    if named is None:
        return
    for name, cure in (
        ("pair", "write its gears and its mesh by name, too (docs/gearbox.md)"),
        ("microgeometry", "write [gears.NAME.microgeometry]; flank and tolerance_class in [meshes.NAME]"),
    ):
        if name in raw:
            raise InputError(f"[{name}]", None, f"conflicts with [{named}.NAME], which is the form with names", cure)
    pairs = (
        ("meshes", "gears"),
        ("gears", "meshes"),
        ("materials", "gears"),
        ("bearings", "shafts"),
        ("machines", "shafts"),
        ("couplings", "shafts"),
        ("carriers", "shafts"),
        ("shafts", "gears"),
    )
    for kind, needs in pairs:
        if kind in raw and needs not in raw:
            raise InputError(f"[{needs}]", None, f"is missing, but required by [{kind}]", f"add [{needs}.NAME]")


def table_class(name: str) -> type:
    """Dataclass that describes the table `name` of a job file, or the entries of a table of tables by name."""
    module, _, cls = {**TABLES, **NAMED}[name].partition(":")
    return typing.cast(type, getattr(importlib.import_module(module), cls))


#: Tables that say what gears and meshes there are.
OF_GEARS = ("pair", "microgeometry", *NAMED)
#: How a command, a study and Python name a mesh.
NAME_ONE = 'name one: --mesh NAME; in [study] mesh = "NAME"'
#: Tables of a gear train's job, beside [train].
OF_TRAINS = (*OF_GEARS, "stiffness", "housing", "spectrum")


def gearbox_of(raw: dict[str, Any], path: str | Path, variant: str | None = None) -> Gearbox:
    """Return the gears and meshes of a parsed job: those of [pair], else those by name, else those of [train].

    Parameters
    ----------
    raw : dict
        The parsed job.
    path : path
        Its file, named in messages.
    variant : str, optional
        Variant of [train] whose keys override [stiffness].

    Raises
    ------
    InputError
        For every mistake in the tables, and a file without gears.
    """
    if "pair" not in raw and "gears" not in raw and "train" in raw:
        box: Gearbox = train_tables(raw, path, variant or "")["gearbox"]
        return box
    needed = ("gears", "meshes") if "gears" in raw or "meshes" in raw else ("pair",)
    tables = job_tables(raw, path, needed, (*OF_GEARS, "stiffness", "loadmap"))
    box = _gearbox(tables)
    return with_loads(box, raw, variant)


def meshes_of(
    raw: dict[str, Any], path: str | Path, name: str | None, variant: str | None = None, field: str = "--mesh"
) -> list[NamedMesh]:
    """Return the meshes that a command computes: that of `name`, or without a name all of `gearbox_of`.

    A file with [pair] and [train] has the mesh of [pair], and by their names those of [train], too.

    Parameters
    ----------
    raw : dict
        The parsed job.
    path : path
        Its file, named in messages.
    name : str, optional
        Name of a mesh.
    variant : str, optional
        Variant of [train] whose keys override [stiffness].
    field : str
        What names the mesh, for messages.

    Raises
    ------
    InputError
        For mistakes in the tables, and an unknown name.
    """
    box = gearbox_of(raw, path, variant)
    if name is None:
        return list(box.meshes.values())
    if name not in box.meshes:
        box = whole_gearbox(raw, path, variant)
    return [box.mesh(name, field)]


def whole_gearbox(raw: dict[str, Any], path: str | Path, variant: str | None = None) -> Gearbox:
    """Return `gearbox_of`, with [pair] and [train] the gears and meshes of both.

    Raises
    ------
    InputError
        For mistakes in the tables.
    """
    box = gearbox_of(raw, path, variant)
    if not ("pair" in raw and "train" in raw):
        return box
    more: Gearbox = train_tables(raw, path, variant or "")["gearbox"]
    return Gearbox({**more.gears, **box.gears}, {**more.meshes, **box.meshes})


def only_mesh(raw: dict[str, Any], path: str | Path, name: str | None = None, field: str = "--mesh") -> NamedMesh:
    """Return the mesh of that name of a parsed job, or the only one that it has.

    Parameters
    ----------
    raw : dict
        The parsed job.
    path : path
        Its file, named in messages.
    name : str, optional
        Name of a mesh.
    field : str
        What names the mesh, for messages.

    Raises
    ------
    InputError
        For mistakes in the tables, and several meshes without a name.
    """
    meshes = meshes_of(raw, path, name, field=field)
    if len(meshes) > 1:
        names = ", ".join(mesh.name for mesh in meshes)
        raise InputError(field, None, f"is not given, and the file has several: {names}", NAME_ONE)
    return meshes[0]


def _gearbox(tables: Mapping[str, Any]) -> Gearbox:
    """Gears and meshes of [pair], or those by name."""
    if "gears" in tables:
        shafts, gears = tables.get("shafts"), tables["gears"]
        carried = {name for name, shaft in (shafts or {}).items() if shaft.carrier is not None}
        planets = [name for name, gear in gears.items() if gear.shaft in carried]
        return named_gearbox(gears, tables["meshes"], tables.get("materials", {}), shafts=shafts, planets=planets)
    return pair_gearbox(tables["pair"], tables.get("microgeometry"))


def with_loads(box: Gearbox, raw: Mapping[str, Any], variant: str | None = None) -> Gearbox:
    """Return the gearbox with [stiffness] and [loadmap] in each mesh, each with the keys that the mesh has instead.

    Without torques in [loadmap] the torque of [stiffness] is taken.
    """

    def loaded(name: str, mesh: NamedMesh) -> NamedMesh:
        stiffness = stiffness_of(raw, variant, name).at_wheel(mesh.ratio)
        loads = _loads_of(raw, name).at_wheel(mesh.ratio)
        given = (loads.torques_Nm, loads.torque_start_Nm, loads.torque_stop_Nm)
        if stiffness.torque_Nm is not None and given == (None, None, None):
            loads = replace(loads, torques_Nm=(stiffness.torque_Nm,))
        return replace(mesh, stiffness=stiffness, loads=loads)

    return replace(box, meshes={name: loaded(name, mesh) for name, mesh in box.meshes.items()})


def _loads_of(raw: Mapping[str, Any], mesh: str) -> LoadMapTable:
    """Torques and angles of a mesh: its own over those of [loadmap], or without that table those of [microgeometry]."""
    own = raw.get("meshes", {}).get(mesh, {}).get("loadmap", {})
    if "loadmap" not in raw and not own and "microgeometry" in raw:
        return build(table_class("microgeometry"), raw["microgeometry"], "microgeometry")
    shared = raw.get("loadmap", {})
    if not own.keys().isdisjoint(TORQUES):
        shared = {key: value for key, value in shared.items() if key not in TORQUES}
    return build(LoadMapTable, {**shared, **own}, f"meshes.{mesh}.loadmap" if own else "loadmap")


def read_train_tables(path: str | Path, variant: str | None = None) -> dict[str, Any]:
    """Tables of a train job by name: ``train`` with the chosen variant (None: that which the file names), and others.

    Raises
    ------
    InputError
        For every mistake in the tables, and an unknown variant.
    """
    return train_tables(read_toml(path), path, variant)


def train_tables(raw: dict[str, Any], path: str | Path, variant: str | None = None) -> dict[str, Any]:
    """The same of tables that are parsed; `path` is named in messages; ``gearbox`` has the gears and meshes."""
    from .train_gearbox import named_train, train_gearbox, with_materials

    raw, tables = planet_tables(raw, path, ("train",), OF_TRAINS)
    table: TrainTable = tables["train"]
    table = table.chosen(table.variant if variant is None else variant)
    if "gears" in tables:
        if "shafts" not in tables:
            raise InputError("[shafts]", None, "is missing: a train has shafts", "add [shafts.NAME]")
        box = _gearbox(tables)
        bearings = tables.get("bearings", {})
        placed = next((name for name, bearing in bearings.items() if bearing.y_mm is not None), None)
        if table.housing == "elastic" and placed is not None:
            problem = "conflicts with an elastic housing, which defines the positions of its bores"
            cure = 'name the bore (attachment) instead, or write housing = "rigid" in [train]'
            raise InputError(f"bearings.{placed}.y_mm", bearings[placed].y_mm, problem, cure)
        parts = {kind: tables.get(kind, {}) for kind in ("machines", "couplings", "carriers")}
        table = named_train(table, tables["meshes"], tables["shafts"], bearings, **parts)
        table = with_materials(table, tables.get("materials", {}), "shafts.{name}")
    else:
        for key in ("shafts", "gears"):
            if not getattr(table, key):
                cure = f"add [[train.{key}]], or [{key}.NAME] for gears by name (docs/gearbox.md)"
                raise InputError(f"train.{key}", None, "is required", cure)
        table = with_materials(table, {}, "train.shafts[{number}]")
        box = train_gearbox(table, tables.get("pair"), tables.get("microgeometry"))
    table.check_models([mesh.where for mesh in box.meshes.values()])
    for number, load in enumerate(table.loads):
        if load.mesh and load.mesh not in box.meshes:
            raise unknown_name(f"train.loads[{number}].mesh", load.mesh, box.meshes)
    tables["gearbox"] = with_loads(box, raw, table.variant)
    tables["stiffness"] = stiffness_of(raw, table.variant)
    if table.housing == "elastic" and "housing" not in tables:
        raise InputError("train.housing", "elastic", "needs a table [housing]", 'add it, or write housing = "rigid"')
    return {**tables, "train": table}


def planet_tables(
    raw: dict[str, Any], path: str | Path, needed: tuple[str, ...], optional: tuple[str, ...] = ()
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return a parsed job with an entry for each planet (`with_planets`), and its tables as `job_tables` does.

    Parameters
    ----------
    raw, path, needed, optional
        See `job_tables`, which raises for the tables as they stand in the file.
    """
    tables = job_tables(raw, path, needed, optional)
    planets = any(shaft.carrier is not None for shaft in tables.get("shafts", {}).values())
    if not planets and not tables.get("carriers"):
        return raw, tables
    from .carrier import with_planets

    raw = with_planets(raw, tables.get("carriers", {}))
    return raw, job_tables(raw, path, needed, optional)


def stiffness_of(raw: Mapping[str, Any], variant: str | None = None, mesh: str | None = None) -> StiffnessTable:
    """Return [stiffness] of the parsed tables with the keys that a mesh and a variant of [train] have instead.

    Parameters
    ----------
    raw : mapping
        The parsed job.
    variant : str, optional
        Name of a variant, whose keys override all.
    mesh : str, optional
        Name of a mesh of [meshes.NAME].

    Raises
    ------
    InputError
        For a variant that the file does not describe, and mistakes in the keys.
    """
    layers = [("stiffness", raw.get("stiffness", {}))]
    if mesh is not None:
        layers.append((f"meshes.{mesh}.stiffness", raw.get("meshes", {}).get(mesh, {}).get("stiffness", {})))
    if variant:
        variants = raw.get("train", {}).get("variants", {})
        if variant not in variants:
            raise unknown_name("variant", variant, variants)
        layers.append((f"train.variants.{variant}.stiffness", variants[variant].get("stiffness", {})))
    keys: dict[str, Any] = {}
    where = "stiffness"
    for name, layer in layers:
        if not layer:
            continue
        if not layer.keys().isdisjoint(LOADS):
            keys = {key: value for key, value in keys.items() if key not in LOADS}
        keys, where = {**keys, **layer}, name
    return build(StiffnessTable, keys, where)
