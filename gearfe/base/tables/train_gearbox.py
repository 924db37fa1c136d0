"""Trains: shafts, bearings and the rest of [train] from their own tables, and gears from the lists of [train].

`named_train` and `with_materials` complete [train] from [shafts.NAME], [bearings.NAME], ... and [materials.NAME];
`train_gearbox` makes the `Gearbox` of [[train.gears]] and [[train.meshes]].
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

from ..errors import InputError, unknown_name
from .bearing import BearingTable
from .carrier import CarrierTable, TrainCarrierTable
from .driveline import CouplingTable, MachineTable, TrainCouplingTable, TrainMachineTable
from .gearbox import (
    BORE,
    DEFAULT,
    PINION,
    TILTS,
    WHEEL,
    Gearbox,
    NamedGear,
    NamedMesh,
    external_first,
    mesh_name,
    pair_gearbox,
    tooth_form_of,
    with_hands,
)
from .microgeometry import MicrogeometryTable
from .named import NamedBearingTable, NamedMeshTable, NamedShaftTable
from .pair import FROM_DISTANCE, REQUIRED, MaterialTable, PairTable, magnitude, transverse_teeth
from .train import TrainBearingTable, TrainGearTable, TrainRigidBoreTable, TrainShaftTable, TrainTable


def named_train(
    table: TrainTable,
    meshes: Mapping[str, NamedMeshTable],
    shafts: Mapping[str, NamedShaftTable],
    bearings: Mapping[str, NamedBearingTable],
    machines: Mapping[str, MachineTable] | None = None,
    couplings: Mapping[str, CouplingTable] | None = None,
    carriers: Mapping[str, CarrierTable] | None = None,
) -> TrainTable:
    """Return [train] with the shafts, meshes, bearings, machines, couplings and carriers of their own tables.

    Parameters
    ----------
    table : TrainTable
        [train], without lists of these.
    meshes, shafts, bearings, machines, couplings, carriers
        The tables by name, with an entry for each planet.

    Raises
    ------
    InputError
        For lists of [train] together with these tables, and for names that do not exist.
    """
    for key in ("shafts", "gears", "meshes", "bearings", "machines", "couplings", "carriers"):
        if getattr(table, key):
            problem = f"conflicts with [{'shafts' if key == 'gears' else key}.NAME]"
            raise InputError(f"[[train.{key}]]", None, problem, f"write all {key} as [{key}.NAME], or all as lists")
    held: dict[str, tuple[str, str]] = {}  # bore -> bearing and shaft
    for name, bearing in bearings.items():
        where = f"bearings.{name}"
        if bearing.shaft not in shafts:
            raise unknown_name(f"{where}.shaft", bearing.shaft, shafts)
        bore = _bore(name, bearing)
        if bore in held:
            problem = f"is that of [bearings.{held[bore][0]}], too"
            raise InputError(f"{where}.attachment", bore, problem, "a bore has one bearing")
        held[bore] = name, bearing.shaft
    carried = {
        name: (*(_bore(b, bearing) for b, bearing in bearings.items() if bearing.shaft == name), *shaft.attachments)
        for name, shaft in shafts.items()
    }
    for name, bores in carried.items():
        if shafts[name].carrier is not None:
            if bores:
                held_by = ", ".join(map(str, bores))
                problem = f"is a planet of carrier {shafts[name].carrier!r}, and bearings carry it: {held_by}"
                raise InputError(f"shafts.{name}", None, problem, "leave out its bearings, or its carrier")
        elif not bores and not carriers:  # a member of a stage may float: the train knows which ones are
            cure = f'add [bearings.NAME] with shaft = "{name}", or attachments = ["1", "2"]'
            raise InputError(f"shafts.{name}.attachments", None, "no bearing carries the shaft", cure)
    rows = tuple(
        TrainShaftTable(
            name=name, **{f.name: getattr(shaft, f.name) for f in fields(shaft) if f.name != "attachments"},
            attachments=tuple(map(str, carried[name])),
        )
        for name, shaft in shafts.items()
    )  # fmt: skip
    springs = tuple(
        TrainBearingTable(
            attachment=_bore(name, bearing), **{f.name: getattr(bearing, f.name) for f in fields(BearingTable)}
        )
        for name, bearing in bearings.items()
        if not bearing.hinge
    )
    places = tuple(
        TrainRigidBoreTable(
            attachment=_bore(name, b), x_mm=shafts[b.shaft].x_mm, y_mm=b.y_mm, z_mm=shafts[b.shaft].z_mm
        )
        for name, b in bearings.items()
        if b.y_mm is not None
    )
    if places and table.rigid_bores:
        problem = "conflicts with [bearings.NAME] with y_mm"
        raise InputError("[[train.rigid_bores]]", None, problem, "leave the list out, or y_mm of the bearings")
    if places and len(places) < len(bearings):
        lacking = next(name for name, b in bearings.items() if b.y_mm is None)
        raise InputError(f"bearings.{lacking}.y_mm", None, "is required: other bearings have one", "give all, or none")
    expanded = replace(
        table, shafts=rows, meshes=tuple(meshes.values()), bearings=springs,
        machines=_named_rows(TrainMachineTable, machines or {}),
        couplings=_named_rows(TrainCouplingTable, couplings or {}),
        carriers=tuple(
            TrainCarrierTable(
                name=name, **{f.name: getattr(carrier, f.name) for f in fields(TrainCarrierTable) if f.name != "name"}
            )
            for name, carrier in (carriers or {}).items()
        ),
    )  # fmt: skip
    expanded.check_driveline("machines.{name}", "couplings.{name}")
    expanded = replace(expanded, rigid_bores=places or table.rigid_bores)
    ends: list[tuple[str, Any]] = [] if expanded.drive is None else [("train.drive", expanded.drive)]
    ends += [(f"train.loads[{i}]", load) for i, load in enumerate(expanded.loads)]
    for where, end in ends:
        if end.shaft not in shafts:
            raise unknown_name(f"{where}.shaft", end.shaft, shafts)
        own = [name for name, bearing in bearings.items() if bearing.shaft == end.shaft]
        if end.attachment is not None and str(end.attachment) not in (*own, *map(str, carried[end.shaft])):
            raise unknown_name(f"{where}.attachment", str(end.attachment), own or map(str, carried[end.shaft]))

    def at_bore(end: Any) -> Any:
        name = str(end.attachment)
        return replace(end, attachment=_bore(name, bearings[name])) if name in bearings else end

    drive = None if expanded.drive is None else at_bore(expanded.drive)
    return replace(expanded, drive=drive, loads=tuple(map(at_bore, expanded.loads)))


def with_materials(table: TrainTable, materials: Mapping[str, MaterialTable], where: str) -> TrainTable:
    """Return [train] with the materials of its shafts and their sections, where these name one.

    Parameters
    ----------
    table : TrainTable
        [train].
    materials : mapping
        The materials by name.
    where : str
        Pattern of a shaft's name in messages, with its number and its name.

    Raises
    ------
    InputError
        For a material that does not exist.
    """

    def known(part: Any, place: str) -> Any:
        if not isinstance(part.material, str):
            return part
        if not materials:
            problem = "names a material, and this file has none"
            cure = (
                "write its constants, material = { youngs_modulus_GPa = 200.0 }, or add [materials.NAME] beside [gears]"
            )
            raise InputError(f"{place}.material", part.material, problem, cure)
        if part.material not in materials:
            raise unknown_name(f"{place}.material", part.material, materials)
        return replace(part, material=materials[part.material])

    shafts = []
    for number, shaft in enumerate(table.shafts):
        place = where.format(number=number, name=shaft.name)
        sections = tuple(known(part, f"{place}.sections[{i}]") for i, part in enumerate(shaft.sections))
        shafts.append(replace(known(shaft, place), sections=sections))
    return replace(table, shafts=tuple(shafts))


def _named_rows(row: type, tables: Mapping[str, Any]) -> tuple[Any, ...]:
    """Entries of a list from tables by name."""
    return tuple(
        row(name=name, **{f.name: getattr(table, f.name) for f in fields(table)}) for name, table in tables.items()
    )


def _bore(name: str, bearing: NamedBearingTable) -> str:
    return name if bearing.attachment is None else str(bearing.attachment)


# --- [[train.gears]], [[train.meshes]] ------------------------------------------------------------------------------


def train_gearbox(
    table: TrainTable, pair: PairTable | None, microgeometry: MicrogeometryTable | None = None
) -> Gearbox:
    """Return the gears and meshes of the lists of [train], which take what they lack from [pair].

    Raises
    ------
    InputError
        For gears of a [pair] that is not there, and required keys that neither gives.
    """
    shared = None if pair is None else pair_gearbox(pair, microgeometry)
    gears = {gear.name: _train_gear(gear, f"train.gears[{i}]", pair, shared) for i, gear in enumerate(table.gears)}
    sides = {gear.name: gear.gear for gear in table.gears}
    meshes: dict[str, NamedMesh] = {}
    for i, mesh in enumerate(table.meshes):
        name, where = mesh_name(mesh.driver, mesh.driven), f"train.meshes[{i}]"
        internal = any(gears[gear].internal for gear in (mesh.driver, mesh.driven))
        distance, distance_where = magnitude(mesh.centre_distance_mm, internal, where), where
        of_pair = {sides[mesh.driver], sides[mesh.driven]} == {PINION, WHEEL}
        if distance is None and of_pair and pair is not None and pair.centre_distance_mm is not None:
            distance, distance_where = abs(pair.centre_distance_mm), "pair"
        tilts: dict[str, Any] = {key: getattr(pair, key) if of_pair else 0.0 for key in TILTS}
        if name in meshes:
            raise InputError(where, None, f"has the gears of another mesh, {name!r}", "two gears have one mesh")
        both, ring_drives = external_first(gears[mesh.driver], gears[mesh.driven])
        meshes[name] = NamedMesh(name, where, *both, distance, distance_where, ring_drives=ring_drives, **tilts)
    return with_hands(Gearbox(gears, meshes))


def _train_gear(table: TrainGearTable, where: str, pair: PairTable | None, shared: Gearbox | None) -> NamedGear:
    if table.gear:
        if shared is None:
            cure = "add it, or give teeth, module_mm, ..."
            raise InputError(f"{where}.gear", table.gear, "needs a table [pair]", cure)
        like = f"[pair.{table.gear}] and [pair]"
        gear = replace(shared.gears[table.gear], name=table.name, shaft=table.shaft, y_mm=table.y_mm, like=like)
    else:
        form, places = tooth_form_of(table, pair, "pair")
        for key in ("module_mm", *REQUIRED):
            if form[key] is None:
                raise InputError(f"{where}.{key}", None, "is required", "add it here, or to a table [pair]")
        if form["profile_shift"] == FROM_DISTANCE:
            problem = "follows from a centre distance in [pair], for a gear of [pair] alone"
            raise InputError(f"{where}.profile_shift", None, problem, "write the number here")
        teeth = table.teeth or 0
        bore = table.bore_diameter_mm
        if bore is None:
            diameter = form["module_mm"] * transverse_teeth(teeth, form["helix_angle_deg"])
            bore, places["bore_diameter_mm"] = BORE * diameter, DEFAULT
        form["bore_diameter_mm"] = bore
        form["helix_hand"] = table.helix_hand
        if table.helix_hand is None:
            places["helix_hand"] = DEFAULT
        material, material_where = (None, DEFAULT) if pair is None else (pair.material, "pair.material")
        density = MaterialTable().density_kg_per_m3 if material is None else material.density_kg_per_m3
        gear = NamedGear(
            table.name,
            where,
            teeth,
            form,
            {},
            material,
            material_where,
            density,
            material_where,
            places,
            shaft=table.shaft,
            y_mm=table.y_mm,
        )
    if table.density_kg_per_m3 is None:
        return gear
    return replace(gear, density_kg_per_m3=table.density_kg_per_m3, density_where="")
