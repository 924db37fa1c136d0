"""Convert a REXS model to a job file with the names of the model, and a list of all its values.

The order is materials, shafts, gears, meshes, bearings, couplings. From these follow the speeds and torques of all
shafts (`balance`), and from them drive, loads and the load of each mesh. Parts that a job cannot have are comments with
the reason. A file that gearfe wrote has attributes ``custom_gearfe_...`` for data without an attribute of REXS.
"""

from __future__ import annotations

import itertools
import json
import math
import textwrap
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ....base.config import build
from ....base.errors import InputError, unknown_name
from ....base.tables.gearbox import Gearbox
from ....base.tables.jobs import NAMED, TABLES, gearbox_of, table_class
from ....base.tables.text import table_text, toml_document
from . import parts, planets, rated
from .balance import Row, speeds_of, torques_of
from .ledger import DEFAULTED, DERIVED, IGNORED, KINDS, READ, Entry, lines_of, plain
from .model import Attribute, Component, LoadCase, Model
from .rated import dynamic_viscosity
from .read import read_rexs
from .reading import Reading
from .schema import CUSTOM, OWN

#: Attributes of files that this program wrote: keys of an entry, and the other tables of the job.
OWN_KEYS, OWN_TABLES, OWN_NAME = f"{OWN}keys", f"{OWN}tables", f"{OWN}name"
#: Largest text of these (characters).
LONGEST = 2**20
#: Attributes of an oil that its viscosity in a mesh follows from.
OIL = ("viscosity_at_40_degree_celsius", "viscosity_at_100_degree_celsius", "density_at_15_degree_celsius")
#: Damping of a train (s) that REXS does not give, factor of the stiffness.
RAYLEIGH_BETA_S = 2e-6
#: Output steps in a period of the fastest mesh, and periods of the slowest one in a transient.
STEPS, PERIODS = 24, 4
#: Speeds of a run-up over the speed of the model, and their number.
RUNUP, SPEEDS = (0.2, 1.2), 60


@dataclass(frozen=True)
class RexsJob:
    """A job from a REXS model, with the lists of used, derived, defaulted and ignored values.

    Attributes
    ----------
    model
        The model.
    tables
        Tables of the job file.
    labels
        (table, name) -> component of the model that the entry is.
    left
        (table, name) -> entry and the reason why a job of today cannot have it: comments of the file.
    entries
        What was read, derived, defaulted and ignored.
    """

    model: Model
    tables: Mapping[str, Any]
    labels: Mapping[tuple[str, str], str]
    left: Mapping[tuple[str, str], tuple[Mapping[str, Any], str]]
    entries: tuple[Entry, ...] = field(repr=False)

    def count(self, kind: str) -> int:
        """Return the number of values that were ``read``, ``derived``, ``defaulted`` or ``ignored``."""
        return sum(entry.kind == kind for entry in self.entries)

    def lines(self, kind: str) -> list[str]:
        """Return the list of one kind, alike values of several components on one line."""
        return lines_of(self.entries, kind)

    def text(self, source: str = "") -> str:
        """Return the commented job file; `source` names the model in its first line."""
        return _text(self, source)


def rexs_job(source: str | Path | Model, *, load_case: int | None = None) -> RexsJob:
    """Return the job of a REXS file or model.

    Parameters
    ----------
    source
        File of REXS 1.0 to 2.0 (.rexs, .rexsj, .rexsz), or what `read_rexs` returned.
    load_case
        Number of a load case whose loads and speeds hold; left out: those of the components, or the first load case.

    Raises
    ------
    InputError
        For files that are no sound REXS, and load cases that do not exist.
    """
    model = source if isinstance(source, Model) else read_rexs(source)
    model, cases = _in_case(model, load_case)
    reading = Reading(model)
    for note in model.notes:
        what, _, rule = note.partition(": ")
        reading.note(IGNORED, None, what, "", rule)
    material = parts.materials(reading)
    shafts, left_shafts = parts.shafts(reading, material)
    gears = parts.gears(reading, material, shafts)
    bearings, left_bearings = parts.bearings(reading)
    couplings, held, left_couplings = parts.couplings(reading)
    meshes = _meshes(reading, gears, shafts)
    tables: dict[str, Any] = {
        "materials": material,
        "gears": gears,
        "meshes": meshes,
        "shafts": shafts,
        "bearings": bearings,
        "machines": parts.masses(reading, shafts),
        "couplings": couplings,
    }
    left: dict[tuple[str, str], tuple[Mapping[str, Any], str]] = {}
    for kind, reasons in (("shafts", left_shafts), ("bearings", left_bearings), ("couplings", left_couplings)):
        left |= {(kind, name): ({}, reason) for name, reason in reasons.items()}
    left |= {("couplings", name): ({}, f"holds {shaft} on the housing") for name, shaft in held.items()}
    planets.place_coupled(reading, tables)
    _friction(reading, tables)
    _loads(reading, tables, held, cases)
    planets.planetary(reading, tables, held, left)
    _forces_in_stages(reading, tables)
    for (kind, name), (_, reason) in left.items():
        reading.entries.append(Entry(IGNORED, kind, reading.numbers.get((kind, name), 0), name, "", plain(reason)))
    _own(reading, tables)
    _refuse(reading, tables, left)
    _models(reading, tables)
    if not any(unit.attributes.get(OWN_TABLES) for unit in model.of_kind("gear_unit")):
        rating = rated.rating(reading, tables)
        tables |= {"rating": rating} if rating else {}
    reading.leftovers(_why)
    labels = {
        (kind, name): model.components[number].label
        for (kind, name), number in reading.numbers.items()
        if name in tables.get(kind, {})
    }
    tables = {name: table for name, table in tables.items() if table or name not in NAMED}
    return RexsJob(model, tables, labels, left, tuple(reading.entries))


# --- load cases -----------------------------------------------------------------------------------------------------


def _in_case(model: Model, chosen: int | None) -> tuple[Model, list[LoadCase]]:
    """Return the model with the attributes of a load case instead of those of its components, and all cases."""
    cases = [case for spectrum in model.spectra for case in spectrum.cases]
    numbers = [case.number for case in cases]
    if chosen is not None and chosen not in numbers:
        raise unknown_name("load case", str(chosen), map(str, numbers))
    if not cases:
        return model, []
    case = cases[0 if chosen is None else numbers.index(chosen)]
    components = dict(model.components)
    for part in case.components:
        old = components[part.number]
        attributes = {**old.attributes, **part.attributes}
        components[part.number] = Component(old.number, old.kind, old.name, attributes)
    notes = [f"load case {case.number}: its loads and speeds hold in the job"]
    notes += [f"load case {number}: only its torques, as loads of [meshes.NAME.loadmap]"
              for number in numbers if number != case.number]  # fmt: skip
    notes += [f"accumulation of load spectrum {item.number}: results of {len(item.accumulation)} components"
              for item in model.spectra if item.accumulation]  # fmt: skip
    changed = Model(
        model.version, model.application, model.date, components, model.relations, model.spectra,
        (*model.notes, *notes),
    )  # fmt: skip
    return changed, cases


# --- meshes ---------------------------------------------------------------------------------------------------------


def _meshes(
    reading: Reading, gears: dict[str, dict[str, Any]], shafts: dict[str, dict[str, Any]]
) -> dict[str, dict[str, Any]]:
    """Return [meshes.NAME]; driver and driven as gear_1 and gear_2 until `_loads` knows better."""
    tables: dict[str, dict[str, Any]] = {}
    for item in reading.model.of_kind("cylindrical_stage"):
        relation = next(reading.model.joined("stage", "stage", item.number), None)
        pair = [] if relation is None else [relation.roles.get("gear_1"), relation.roles.get("gear_2")]
        names = [reading.names.get(number, "") for number in pair if number is not None]
        if relation is None or len(names) != 2 or any(name not in gears for name in names):
            reading.ignored(item, "stage", "does not join two gears with teeth")
            continue
        reading.relations.add(relation.number)
        name = reading.name(item)
        key = f"meshes.{name}"
        for part in pair:
            for other in reading.model.joined("stage_gear_data", "stage", item.number):
                if other.roles.get("gear") == part:
                    reading.relations.add(other.number)
        entry: dict[str, Any] = {"driver": names[0], "driven": names[1]}
        distance = reading.number(item, "center_distance", "mm", f"{key}.centre_distance_mm")
        width = reading.number(item, "common_face_width", "mm")
        for gear in names:
            if width is not None and "face_width_mm" not in gears[gear]:
                gears[gear]["face_width_mm"] = width
                reading.derived(item, "common_face_width", f"gears.{gear}.face_width_mm", "the gear gives none")
        axes = [gears[gear].get("shaft") for gear in names]
        known = all(reading.numbers.get(("shafts", shaft or ""), 0) in reading.frames for shaft in axes)
        apart = _apart(axes, shafts) if known else 0.0
        if distance is None and apart:
            distance = float(f"{apart:.12g}")
            reading.derived(item, "support_vector of the shafts", f"{key}.centre_distance_mm", "distance of the axes")
        elif distance is not None and apart and abs(abs(distance) - apart) > 1e-3:
            rule = f"{abs(distance):.9g} mm, but the axes are {apart:.9g} mm apart: correct one"
            reading.note(DERIVED, item, "center_distance", f"{key}.centre_distance_mm", rule)
        if distance is not None:
            internal = gears[names[0]]["teeth"] * gears[names[1]]["teeth"] < 0
            entry["centre_distance_mm"] = -abs(distance) if internal else abs(distance)
        _shifts(reading, item, names, gears, distance)
        tables[name] = entry
    _place_shafts(reading, tables, gears, shafts)
    for name, entry in gears.items():
        entry.setdefault("profile_shift", 0.0)
        if entry["profile_shift"] == 0.0 and not any(
            note.key == f"gears.{name}.profile_shift" for note in reading.entries
        ):
            reading.defaulted(None, f"gears.{name}.profile_shift", "0")
    return tables


def _place_shafts(
    reading: Reading,
    meshes: Mapping[str, Mapping[str, Any]],
    gears: Mapping[str, Mapping[str, Any]],
    shafts: dict[str, dict[str, Any]],
) -> None:
    """Place shafts without a position next to those that they mesh with: at the centre distance and angle of the file.

    ``rotating_angle_around_neg_u_axis`` is the angle of the line of centres from w towards v (the published examples).
    """
    placed = {name for name in shafts if reading.numbers["shafts", name] in reading.frames}
    if len(placed) == len(shafts) or not shafts:
        return
    placed = placed or {next(iter(shafts))}
    waiting = list(meshes)
    while waiting:
        ready = [name for name in waiting if _shaft(gears, meshes[name], "driver") in placed
                 or _shaft(gears, meshes[name], "driven") in placed]  # fmt: skip
        if not ready:
            return
        name = ready[0]
        waiting.remove(name)
        one, two = (_shaft(gears, meshes[name], role) for role in ("driver", "driven"))
        stage = reading.part("meshes", name)
        angle = math.radians(reading.number(stage, "rotating_angle_around_neg_u_axis", "deg") or 0.0)
        distance = abs(meshes[name].get("centre_distance_mm", 0.0))
        for known, new, sign in ((one, two, 1.0), (two, one, -1.0)):
            if known in placed and new in shafts and new not in placed:
                shafts[new]["x_mm"] = shafts[known]["x_mm"] + sign * distance * math.cos(angle)
                shafts[new]["z_mm"] = shafts[known]["z_mm"] + sign * distance * math.sin(angle)
                placed.add(new)
                rule = f"at the centre distance of {name} from {known}"
                reading.derived(stage, "center_distance", f"shafts.{new}.x_mm, z_mm", rule)


def _shaft(gears: Mapping[str, Mapping[str, Any]], mesh: Mapping[str, Any], role: str) -> str:
    return str(gears[mesh[role]].get("shaft", ""))


def _apart(names: list[str | None], shafts: dict[str, dict[str, Any]]) -> float:
    one, two = (shafts.get(name or "") for name in names)
    return 0.0 if one is None or two is None else math.hypot(two["x_mm"] - one["x_mm"], two["z_mm"] - one["z_mm"])


def _shifts(
    reading: Reading, stage: Component, names: list[str], gears: dict[str, dict[str, Any]], distance: float | None
) -> None:
    """A profile shift that the file leaves out follows from the centre distance, if the mate has one."""
    missing = [name for name in names if "profile_shift" not in gears[name]]
    if not missing or distance is None:
        return
    if len(missing) == 2:
        gears[missing[0]]["profile_shift"] = 0.0
        reading.defaulted(None, f"gears.{missing[0]}.profile_shift", "0: the file gives none for either gear")
    gears[missing[-1]]["profile_shift"] = "from centre distance"
    reading.derived(stage, "center_distance", f"gears.{missing[-1]}.profile_shift", "no backlash at that distance")


def _friction(reading: Reading, tables: dict[str, Any]) -> None:
    """Viscosity of the oil in each mesh, where lubricant, its temperature and the roughness of the flanks are known."""
    casing = next(iter(reading.model.of_kind("gear_casing")), None)
    temperature = reading.number(casing, "temperature_lubricant", "C")
    for name, entry in tables["meshes"].items():
        stage = reading.part("meshes", name)
        oils = reading.parts(stage, "reference", "origin", "referenced", "lubricant")
        if not oils and casing is not None:
            oils = reading.parts(casing, "reference", "origin", "referenced", "lubricant")
        if not oils:
            continue
        oil, key = oils[0], f"meshes.{name}.oil_viscosity_mPa_s"
        values = [reading.number(oil, f"viscosity_at_{at}_degree_celsius", "mm^2 / s") for at in (40, 100)]
        density = reading.number(oil, "density_at_15_degree_celsius", "kg / m^3")
        of_oil = ", ".join(attribute for attribute in OIL if reading.attribute(oil, attribute) is not None)
        gears = [reading.part("gears", entry[role]) for role in ("driver", "driven")]
        rough = [reading.number(gear, "arithmetic_mean_roughness_flank_iso_4287_1997", "um") for gear in gears]
        if None in (*values, density, temperature):
            rule = "needs viscosities at 40 and 100 C, density and temperature_lubricant of the casing"
            reading.ignored(oil, of_oil or "viscosity", rule)
            continue
        viscosity = dynamic_viscosity(values[0] or 0.0, values[1] or 0.0, density or 0.0, temperature or 0.0)
        if viscosity is None:
            rule = (
                f"out of range at {temperature:g} C: must be 0.5 < viscosity at 100 C < viscosity at 40 C < 1e6 mm2/s, "
                "density > 0, -50 < temperature < 300 C"
            )
            reading.ignored(oil, of_oil, rule)
            continue
        if None in rough:
            rule = (
                f"{viscosity:.4g} mPa s at {temperature:g} C: friction needs the roughness of the flanks (roughness_um)"
            )
            reading.ignored(oil, of_oil, rule)
            continue
        rule = "Ubbelohde-Walther between 40 and 100 C (ASTM D341), density falling by 0.65 kg/m3 a degree"
        reading.derived(oil, "viscosity_at_40_degree_celsius", key, rule)
        entry["oil_viscosity_mPa_s"] = float(f"{viscosity:.6g}")
        entry["roughness_um"] = 0.5 * ((rough[0] or 0.0) + (rough[1] or 0.0))
        for gear in gears:
            rule = "mean of both gears"
            where = f"meshes.{name}.roughness_um"
            reading.derived(gear, "arithmetic_mean_roughness_flank_iso_4287_1997", where, rule)


# --- speeds and torques ---------------------------------------------------------------------------------------------


@dataclass
class _External:
    """A load on a shaft."""

    component: Component
    shaft: str
    y_mm: float | None
    torque: float | None
    force: Mapping[str, float]


def _rows(reading: Reading, tables: dict[str, Any]) -> list[Row]:
    """Constraints of all meshes and couplings; meshes of a planetary stage turn with its carrier."""
    carriers = _carriers(reading)
    gears, rows = tables["gears"], []
    for name, entry in tables["meshes"].items():
        one, two = (gears[entry[role]] for role in ("driver", "driven"))
        if (
            "shaft" not in one
            or "shaft" not in two
            or one["shaft"] not in tables["shafts"]
            or (two["shaft"] not in tables["shafts"])
        ):
            continue
        factors = {one["shaft"]: float(one["teeth"]), two["shaft"]: float(two["teeth"])}
        carrier = carriers.get(reading.numbers["meshes", name])
        if carrier is not None:
            factors[carrier] = factors.get(carrier, 0.0) - one["teeth"] - two["teeth"]
        rows.append(Row(name, factors))
    for name, entry in tables["couplings"].items():
        rows.append(Row(name, {entry["shafts"][0]: 1.0, entry["shafts"][1]: -1.0}))
    for shafts in _carrier_shafts(reading).values():
        rows += [Row(f"{one} {two}", {one: 1.0, two: -1.0}) for one, two in itertools.pairwise(shafts)]
    return rows


def _carrier_shafts(reading: Reading) -> dict[int, list[str]]:
    """Planetary stage -> shafts that turn with its carrier."""
    found = {}
    for stage in reading.model.of_kind("planetary_stage"):
        items = reading.parts(stage, "planet_carrier_shaft", "planetary_stage", "shaft", "shaft")
        found[stage.number] = [reading.name(item) for item in items]
    return found


def _carriers(reading: Reading) -> dict[int, str]:
    """Cylindrical stage of a planetary stage -> shaft of its carrier."""
    shafts = _carrier_shafts(reading)
    found = {}
    for stage in reading.model.of_kind("planetary_stage"):
        for item in reading.parts(stage, "assembly", "assembly", "part", "cylindrical_stage"):
            if shafts.get(stage.number):
                found[item.number] = shafts[stage.number][0]
    return found


def _loads(reading: Reading, tables: dict[str, Any], held: dict[str, str], cases: list[LoadCase]) -> None:
    """Drive, loads and the load of each mesh."""
    shafts = list(tables["shafts"])
    rows = _rows(reading, tables)
    known = dict.fromkeys((name for name in held.values() if name in tables["shafts"]), 0.0)
    given: list[str] = []
    for item in reading.model.of_kind("shaft"):
        speed, name = reading.number(item, "rotational_speed", "rad / s"), reading.names[item.number]
        defines = reading.flag(item, "defines_speed")
        if speed is None or name not in tables["shafts"]:
            continue
        if defines is False or (defines is None and given):
            reading.ignored(item, "rotational_speed", "follows from the shaft that defines the speed")
            continue
        known[name] = parts.sense(reading, item) * speed
        given.append(name)
    speeds = speeds_of(shafts, rows, known)
    externals = [_external(reading, item, tables, speeds) for item in reading.model.of_kind("external_load")]
    loads = [item for item in externals if item is not None]
    torques, shares = _balance(shafts, rows, loads, held)
    _mesh_loads(reading, tables, rows, shares, speeds)
    _other_cases(reading, tables, rows, held, loads, cases)
    if not given:
        if tables["shafts"]:
            reading.defaulted(None, "train", "no shaft defines a speed: no drive, hence no [train]")
        return
    _train(reading, tables, given, speeds, loads, torques)


def _external(reading: Reading, item: Component, tables: dict[str, Any], speeds: dict[str, float]) -> _External | None:
    """Torque of an external load, by itself or by its power."""
    shaft = parts.shaft_of(reading, item)
    if shaft is None or reading.name(shaft) not in tables["shafts"]:
        reading.ignored(item, "external_load", "on no shaft of the job")
        return None
    name = reading.name(shaft)
    direction = parts.sense(reading, shaft)
    torque = reading.number(item, "torque_around_u_axis", "N m", "train.drive, loads")
    power = reading.number(item, "power", "W")
    if torque is None and power is not None and speeds.get(name):
        torque = abs(power / speeds[name]) * math.copysign(1.0, power * speeds[name]) * direction
        reading.derived(item, "power", "train.loads.torque_Nm", "P/omega")
    elif torque is None and power is not None:
        reading.ignored(item, "power", "the speed of its shaft does not follow from the file")
    reading.flag(item, "defines_torque")
    transmits = reading.flag(item, "transmits_torque")
    y = parts.along(reading, item, shaft)
    force = _force(reading, item, shaft, y)
    if torque is None and power is None and force and not transmits:
        torque = 0.0  # a force alone balances no torques
    return _External(item, name, y, None if torque is None else direction * torque, force)


def _force(reading: Reading, item: Component, shaft: Component, y: float | None) -> dict[str, float]:
    """Keys of [[train.forces]] of an external load: its force, and its moment across the shaft, in axes of the job."""
    axes, frame = reading.axes, reading.frames.get(shaft.number)
    entry: dict[str, float] = {}
    for names, unit, keys in (
        (("force_u_direction", "force_v_direction", "force_w_direction"), "N", ("force_x_N", "force_y_N", "force_z_N")),
        (("", "torque_around_v_axis", "torque_around_w_axis"), "N m", ("moment_x_Nm", "", "moment_z_Nm")),
    ):
        values = [(reading.number(item, name, unit) if name else None) or 0.0 for name in names]
        if not any(values):
            continue
        given = [name for name, value in zip(names, values, strict=True) if value]
        if y is None:
            for name in given:
                reading.ignored(item, name, "its place on the shaft is not known")
            continue
        local = (values[0], values[1], values[2])
        turned = (values[2], values[0], values[1]) if frame is None else axes.of(frame.direction(local))
        entry |= {key: value for key, value in zip(keys, turned, strict=True) if key and value}
        for name in given:
            reading.derived(item, name, "train.forces", "in the directions of the job")
    return entry


def _balance(
    shafts: list[str], rows: list[Row], loads: list[_External], held: Mapping[str, str]
) -> tuple[dict[str, float], dict[str, float]]:
    """Torques on shafts (N m), known and unknown ones, and the multipliers of the meshes."""
    known: dict[str, float] = {}
    for load in loads:
        if load.torque is not None:
            known[load.shaft] = known.get(load.shaft, 0.0) + load.torque
    unknown = [load.shaft for load in loads if load.torque is None]
    unknown += [name for name in held.values() if name in shafts]
    if not known:
        return {}, {}
    torques, shares = torques_of(shafts, rows, known, list(dict.fromkeys(unknown)))
    return {**known, **torques}, shares


def _mesh_loads(
    reading: Reading,
    tables: dict[str, Any],
    rows: list[Row],
    shares: dict[str, float],
    speeds: dict[str, float],
) -> None:
    """Driver and driven gear, load and driving flank of each mesh."""
    carriers = _carriers(reading)
    for row in rows:
        if row.name not in tables["meshes"]:
            continue
        entry, gears = tables["meshes"][row.name], tables["gears"]
        names = [entry["driver"], entry["driven"]]
        share = shares.get(row.name)
        relative = _relative(tables, names[0], carriers.get(reading.numbers["meshes", row.name]), speeds)
        driving = [_driving(reading, row.name, name) for name in names]
        power = None if share is None or relative is None else share * gears[names[0]]["teeth"] * relative
        if power is not None and abs(power) > 0.0:
            # power into the first gear from the mesh: positive, it is driven
            turned, rule = power > 0.0, "power flows from the driver to the driven gear"
        else:
            turned, rule = driving == [False, True], "is_driving_gear, or else gear_1 drives"
        if turned:
            names.reverse()
        entry["driver"], entry["driven"] = names
        reading.derived(reading.part("meshes", row.name), "stage relation",
                        f"meshes.{row.name}.driver", rule)  # fmt: skip
        if not share:
            continue
        pinion, wheel = names[::-1] if gears[names[0]]["teeth"] < 0 else names
        torque = float(f"{abs(share * gears[wheel]['teeth']):.9g}")
        if torque <= 0.0:
            continue
        entry["stiffness"] = {"torque_Nm": torque}
        stage = reading.part("meshes", row.name)
        rule = "balance of the torques on all shafts, without losses"
        reading.derived(stage, "external_load", f"meshes.{row.name}.stiffness.torque_Nm", rule)
        # the pinion is pushed back by the mesh: counter-clockwise from larger y its left flanks drive
        push = -share * gears[pinion]["teeth"]
        if push < 0.0:
            entry["flank"] = "right"
        reading.derived(
            stage, "external_load", f"meshes.{row.name}.flank", "left where the torque on the pinion is > 0"
        )


def _relative(tables: dict[str, Any], gear: str, carrier: str | None, speeds: dict[str, float]) -> float | None:
    """Speed of a gear against the carrier of its axis (rad/s)."""
    shaft = tables["gears"][gear].get("shaft")
    if shaft not in speeds or (carrier is not None and carrier not in speeds):
        return None
    return speeds[shaft] - (0.0 if carrier is None else speeds[carrier])


def _driving(reading: Reading, stage: str, gear: str) -> bool | None:
    """Return whether the data of a gear in its stage say that it drives."""
    for relation in reading.model.joined("stage_gear_data", "stage", reading.numbers["meshes", stage]):
        if relation.roles.get("gear") == reading.numbers["gears", gear] and "stage_gear_data" in relation.roles:
            return reading.flag(reading.model.components[relation.roles["stage_gear_data"]], "is_driving_gear")
    return None


def _other_cases(
    reading: Reading,
    tables: dict[str, Any],
    rows: list[Row],
    held: dict[str, str],
    loads: list[_External],
    cases: list[LoadCase],
) -> None:
    """Loads of a load map: the torque of each mesh in all load cases."""
    found: dict[str, set[float]] = {}
    for case in cases:
        torques = {part.number: part.attributes.get("torque_around_u_axis") for part in case.components}
        there = []
        for load in loads:
            given: Attribute | None = torques.get(load.component.number)
            torque = load.torque
            if given is not None and given.value is not None:
                shaft = parts.shaft_of(reading, load.component)
                torque = given.number("N m") * (1.0 if shaft is None else parts.sense(reading, shaft))
            there.append(replace(load, torque=torque))
        _, shares = _balance(list(tables["shafts"]), rows, there, held)
        for name, share in shares.items():
            if name in tables["meshes"] and share:
                both = [tables["gears"][tables["meshes"][name][role]]["teeth"] for role in ("driver", "driven")]
                teeth = min(both) if min(both) < 0 else both[1]
                found.setdefault(name, set()).add(float(f"{abs(share * teeth):.9g}"))
    for name, values in found.items():
        if len(values) > 1:
            tables["meshes"][name]["loadmap"] = {"torques_Nm": sorted(values)}
            reading.derived(None, "load cases", f"meshes.{name}.loadmap.torques_Nm", "balance of each load case")


def _train(
    reading: Reading,
    tables: dict[str, Any],
    given: list[str],
    speeds: dict[str, float],
    loads: list[_External],
    torques: dict[str, float],
) -> None:
    """[train] and [runup]."""
    powers = {load.shaft: torques.get(load.shaft, 0.0) * speeds.get(load.shaft, 0.0) for load in loads}
    driven = (
        max(powers, key=lambda name: powers[name], default=given[0])
        if any(power > 0.0 for power in powers.values())
        else given[0]
    )
    if driven not in speeds:
        reading.defaulted(None, "train", f"the speed of {driven} does not follow from those given: no [train]")
        return
    elastic = "sections" in tables["shafts"][driven]
    drive: dict[str, Any] = {"shaft": driven, "speed_rad_per_s": speeds[driven]}
    place = next((load.y_mm for load in loads if load.shaft == driven and load.y_mm is not None), None)
    shaft = reading.part("shafts", driven)
    if driven in given:
        reading.note(READ, shaft, "rotational_speed", "train.drive.speed_rad_per_s")
    else:
        reading.derived(shaft, "rotational_speed", "train.drive.speed_rad_per_s", "kinematics: power enters here")
    if elastic:
        if place is None:
            place = tables["shafts"][driven]["y_mm"]
            reading.defaulted(None, "train.drive.y_mm", "the middle of the shaft")
        drive["y_mm"] = place
    entries: list[dict[str, Any]] = []
    forces: list[dict[str, Any]] = []
    for load in loads:
        torque = torques.get(load.shaft) if load.torque is None else load.torque
        if load.force:
            forces.append({"shaft": load.shaft, "y_mm": load.y_mm, **load.force})
        if load.shaft == driven:
            continue
        if not torque and load.force:
            continue
        if torque is None:
            reading.ignored(load.component, "torque", "no torque, and the others do not settle it")
            continue
        entry: dict[str, Any] = {"shaft": load.shaft, "torque_Nm": torque}
        if load.torque is None:
            rule = "balance of the torques on all shafts, without losses"
            reading.derived(load.component, "external_load", "train.loads.torque_Nm", rule)
        if "sections" in tables["shafts"][load.shaft] and load.y_mm is not None:
            entry["y_mm"] = load.y_mm
        entries.append(entry)
    train: dict[str, Any] = {"housing": "rigid", "drive": drive, "loads": entries}
    if forces:
        train["forces"] = forces
    reading.defaulted(None, "train.housing", "rigid: the file has no body of the casing")
    frequencies = []
    for name, mesh in tables["meshes"].items():
        speed = _relative(tables, mesh["driver"], _carriers(reading).get(reading.numbers["meshes", name]), speeds)
        if speed:
            frequencies.append(abs(speed * tables["gears"][mesh["driver"]]["teeth"]) / (2.0 * math.pi))
    if frequencies:
        duration = float(f"{1e3 * PERIODS / min(frequencies):.3g}")
        train["step_us"] = float(f"{1e6 / (STEPS * max(frequencies)):.3g}")
        train["duration_ms"] = duration
        reading.defaulted(None, "train.step_us", f"{STEPS} steps in a period of the fastest mesh")
        reading.defaulted(None, "train.duration_ms", f"{PERIODS} periods of the slowest mesh")
        for entry in (*entries, *forces):
            entry["ramp_centre_ms"], entry["ramp_width_ms"] = 0.1 * duration, 0.2 * duration
        reading.defaulted(None, "train.loads.ramp_width_ms", "a fifth of the duration")
    train["damping"] = {"rayleigh_beta_s": RAYLEIGH_BETA_S}
    reading.defaulted(None, "train.damping.rayleigh_beta_s", f"{RAYLEIGH_BETA_S:g}: REXS has no damping")
    tables["train"] = train
    low, high = (float(f"{share * speeds[driven]:.4g}") for share in RUNUP)
    tables["runup"] = {"speed_start_rad_per_s": low, "speed_stop_rad_per_s": high, "speeds": SPEEDS}
    reading.defaulted(None, "runup", f"{RUNUP[0]:g} to {RUNUP[1]:g} times the speed of the model")


def _forces_in_stages(reading: Reading, tables: dict[str, Any]) -> None:
    """Leave out forces on shafts of planetary stages, in whose turning frames they would turn."""
    train, shafts, gears = tables.get("train", {}), tables["shafts"], tables["gears"]
    turning = {name for name, shaft in shafts.items() if shaft.get("carrier")}
    meshes = [[gears[mesh[role]].get("shaft") for role in ("driver", "driven")] for mesh in tables["meshes"].values()]
    turning |= {name for pair in meshes if turning & set(pair) for name in pair}
    turning |= {carrier.get("shaft") for carrier in tables.get(planets.CARRIERS, {}).values()}
    kept = [force for force in train.get("forces", []) if force["shaft"] not in turning]
    for force in train.get("forces", []):
        if force not in kept:
            text = ", ".join(f"{key} = {value:.6g}" for key, value in force.items() if key.endswith(("_N", "_Nm")))
            rule = f"{text}: a job has forces on shafts outside of planetary stages only"
            reading.note(IGNORED, reading.part("shafts", force["shaft"]), "force of external_load", "", rule)
    if kept:
        train["forces"] = kept
    else:
        train.pop("forces", None)


# --- what this program wrote, and what it cannot take ----------------------------------------------------------------


def _own(reading: Reading, tables: dict[str, Any]) -> None:
    """Take keys that a file of this program holds beside the attributes of REXS."""
    for component in reading.model.components.values():
        keys = _toml(reading, component, OWN_KEYS)
        if keys is None:
            continue
        kind, name = str(keys.get("table", "")), reading.name(component)
        if kind not in NAMED:
            raise unknown_name(f"table in {OWN_KEYS} of {component.label}", kind, NAMED)
        given, kept = keys.get("keys", {}), keys.get("kept", [])
        if not isinstance(given, dict) or not isinstance(kept, list):
            where = f"{OWN_KEYS} of {component.label}"
            raise InputError(where, None, "must have a table keys and a list kept", "write the file again")
        entry = tables.setdefault(kind, {}).setdefault(name, {})
        tables[kind][name] = {key: entry[key] for key in kept if isinstance(key, str) and key in entry} | given
        reading.note(READ, component, OWN_KEYS, f"{kind}.{name}")
    for component in reading.model.of_kind("gear_unit"):
        found = _toml(reading, component, OWN_TABLES)
        if found is None:
            continue
        for name, table in found.items():
            where = f"{OWN_TABLES} of {component.label}"
            if name not in TABLES and name not in NAMED:
                raise unknown_name(where, name, (*TABLES, *NAMED))
            if not isinstance(table, dict) or (name in NAMED and tables.get(name)):
                raise InputError(f"{where}, {name}", None, "must be a separate table", "write the file again")
            if name in TABLES:
                build(table_class(name), table, name, rules=False)
        for name in [name for name in tables if name not in NAMED]:
            del tables[name]
        tables |= found
        reading.note(READ, component, OWN_TABLES, ", ".join(found))


def _toml(reading: Reading, component: Component, name: str) -> dict[str, Any] | None:
    text = reading.text(component, name)
    if not text:
        return None
    where = f"{name} of {component.label}"
    if len(text) > LONGEST:
        raise InputError(where, text, f"has more than {LONGEST} characters", "write the file again")
    try:
        return tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError, ValueError) as error:
        raise InputError(where, text, f"is not valid TOML ({str(error)[:100]})", "write the file again") from None


def _refuse(
    reading: Reading, tables: dict[str, Any], left: dict[tuple[str, str], tuple[Mapping[str, Any], str]]
) -> None:
    """Move entries that no job can have to the comments, and what depends on them, with the reason."""

    def leave(kind: str, name: str, reason: str) -> None:
        entry = tables[kind].pop(name)
        left[kind, name] = (entry, reason)
        number = reading.numbers.get((kind, name), 0)
        of = reading.model.components[number].kind if number else kind
        reading.entries.append(Entry(IGNORED, of, number, f"[{kind}.{name}]", "", plain(reason)))

    for kind in NAMED:
        for name, entry in list(tables.get(kind, {}).items()):
            try:
                build(table_class(kind), entry, f"{kind}.{name}")
            except InputError as error:
                leave(kind, name, str(error))
    for name, gear in list(tables.get("gears", {}).items()):
        if gear.get("shaft") is not None and gear["shaft"] not in tables.get("shafts", {}):
            leave("gears", name, f"shaft {gear['shaft']} is not in the job")
    for name, mesh in list(tables.get("meshes", {}).items()):
        lost = [gear for gear in (mesh["driver"], mesh["driven"]) if gear not in tables["gears"]]
        if lost:
            leave("meshes", name, f"gear {lost[0]} is not in the job")
    for kind in ("bearings", "machines"):
        for name, entry in list(tables.get(kind, {}).items()):
            if entry["shaft"] not in tables["shafts"]:
                leave(kind, name, f"shaft {entry['shaft']} is not in the job")
    for name, entry in list(tables.get("couplings", {}).items()):
        lost = [shaft for shaft in entry["shafts"] if shaft not in tables["shafts"]]
        if lost:
            leave("couplings", name, f"shaft {lost[0]} is not in the job")
    used = {mesh[role] for mesh in tables.get("meshes", {}).values() for role in ("driver", "driven")}
    for name in [name for name in tables.get("gears", {}) if name not in used]:
        leave("gears", name, "meshes with no gear of the job")
    if any(unit.attributes.get(OWN_TABLES) for unit in reading.model.of_kind("gear_unit")):
        return  # a job of this program, whole as it is
    reason = _without_train(reading, tables, left)
    if not reason:
        for name in _idle(tables):
            leave("shafts", name, "no bearing between it and the housing carries it, and no gear is on it")
        return
    # gears and meshes alone: shafts would be a train
    for name, gear in tables.get("gears", {}).items():
        if gear.pop("shaft", None) is not None:
            rule = f"only its position along the axis, because there is no train: {reason}"
            reading.derived(reading.part("gears", name), "assembly", f"gears.{name}.shaft", rule)
    for kind in ("shafts", "bearings", "machines", "couplings", planets.CARRIERS):
        for name in list(tables.get(kind, {})):
            leave(kind, name, f"there is no train: {reason}")
    for table in ("train", "runup"):
        if table in tables:
            left[table, ""] = (tables.pop(table), reason)
            reading.entries.append(Entry(IGNORED, "", 0, f"[{table}]", "", plain(reason)))


def _idle(tables: Mapping[str, Any]) -> list[str]:
    """Names of shafts that neither bearings carry nor gears are on."""
    busy = {entry["shaft"] for kind in ("bearings", "gears") for entry in tables.get(kind, {}).values()}
    busy |= {name for name, entry in tables.get("shafts", {}).items() if entry.get("attachments")}
    busy |= {shaft for entry in tables.get("couplings", {}).values() for shaft in entry["shafts"]}
    return [name for name in tables.get("shafts", {}) if name not in busy]


def _models(reading: Reading, tables: dict[str, Any]) -> None:
    """Springs instead of potentials in meshes whose load varies along the face width, if the file chooses nothing."""
    if not tables.get("meshes"):
        return
    try:
        box = gearbox_of({name: tables[name] for name in NAMED if tables.get(name)}, "REXS")
    except InputError as error:
        reading.note(IGNORED, None, "the gears and meshes together", "", str(error))
        return
    _ring_tips(reading, tables, box)
    for name, mesh in box.meshes.items():
        entry = tables["meshes"][name]
        varies = mesh.along_width(("left", "right"))
        if varies is None or "mesh_model" in entry or reading.part("meshes", name).attributes.get(OWN_KEYS):
            continue
        entry["mesh_model"] = "variable_stiffness"
        rule = f"variable_stiffness: {varies[0]} makes the load vary along the face width"
        reading.defaulted(reading.part("meshes", name), f"meshes.{name}.mesh_model", rule)
        for key in [key for key in ("oil_viscosity_mPa_s", "roughness_um") if key in entry]:
            del entry[key]
            rule = "friction is of meshes with a potential: its load varies along the face width"
            reading.ignored(reading.part("meshes", name), key, rule)


def _ring_tips(reading: Reading, tables: dict[str, Any], box: Gearbox) -> None:
    """Return the addendum of rings without tip diameter: 1, or the largest on the involutes of their mates.

    The roll length at the tip of a ring, minus a sin(alpha_wt), is that of the mate at this point. It must not be less
    than that of the mate's form circle, r sin(alpha_t) - (h_fP - rho_fP (1 - sin(alpha_n)) - x) m_n/sin(alpha_t) (ISO
    21771).
    """
    for name, ring in box.gears.items():
        entry = tables["gears"][name]
        if (
            ring.teeth > 0
            or reading.part("gears", name).attributes.get(OWN_KEYS)
            or ({"addendum", "tip_diameter_mm", "tip_shortening"} & entry.keys())
        ):
            continue
        module, most = ring.form["module_mm"], 1.0
        for mesh in box.meshes.values():
            mate = mesh.driver if mesh.driven.name == name else mesh.driven if mesh.driver.name == name else None
            if mate is None or mesh.centre_distance_mm is None or mate.teeth < 0:
                continue
            normal, helix = (math.radians(ring.form[key]) for key in ("pressure_angle_deg", "helix_angle_deg"))
            angle = math.atan(math.tan(normal) / math.cos(helix))
            radii = [0.5 * abs(gear.teeth) * module / math.cos(helix) for gear in (ring, mate)]
            bases = [radius * math.cos(angle) for radius in radii]
            depth = mate.form["dedendum"] - mate.form["rack_tip_radius"] * (1.0 - math.sin(normal))
            form = radii[1] * math.sin(angle) - (depth - mate.form["profile_shift"]) * module / math.sin(angle)
            between = abs(mesh.centre_distance_mm) ** 2 - (bases[0] - bases[1]) ** 2
            if between <= 0.0:
                continue
            least = math.hypot(bases[0], math.sqrt(between) + max(form, 0.0))
            most = min(most, (radii[0] - least) / module - ring.form["profile_shift"])
        rule = "1, of ISO 53"
        if most < 1.0:
            entry["addendum"] = math.floor(20.0 * most) / 20.0
            rule = "the next twentieth that keeps its tips on the involutes of its mates; 1, of ISO 53, would not"
        reading.defaulted(reading.part("gears", name), f"gears.{name}.addendum", rule)


def _without_train(
    reading: Reading, tables: dict[str, Any], left: Mapping[tuple[str, str], tuple[Mapping[str, Any], str]]
) -> str:
    """Why the parts of the job are no train; empty: they are one."""
    lost = [name for kind, name in left if kind == "meshes"]
    if lost:
        return f"mesh {lost[0]} is missing, so the power does not flow"
    if not tables.get("meshes"):
        return "there are no meshes"
    others = reading.model.of_kind("bevel_stage", "worm_stage", "involute_spline_connection")
    if others:
        return f"power goes through {others[0].label}, which a job has not"
    carried = {entry["shaft"] for entry in tables.get("bearings", {}).values()}
    carried |= {name for name, e in tables.get("shafts", {}).items() if e.get("attachments") or e.get("carrier")}
    for name, gear in tables.get("gears", {}).items():
        if "shaft" not in gear:
            return f"gear {name} is on no shaft"
        if gear["shaft"] not in carried:
            return f"no bearing between it and the housing carries shaft {gear['shaft']}"
    return ""


def _why(component: Component, name: str, value: Any) -> str:
    """Why an attribute has no place in a job."""
    if value is None:
        return "has no value"
    attribute = component.attributes[name]
    if name.startswith(CUSTOM):
        return "of another program"
    if not attribute.known:
        return "no attribute of this component in REXS 2.0"
    return "no key of a job follows from it"


# --- text -----------------------------------------------------------------------------------------------------------

#: Widest line of a job file.
WIDTH = 118


def _text(job: RexsJob, source: str) -> str:
    counts = ", ".join(f"{job.count(kind)} {kind}" for kind in KINDS)
    program = f", written by {job.model.application}" if job.model.application else ""
    head = [
        f"Gearbox from {Path(source).name or 'a REXS model'} (REXS {job.model.version}{program}).",
        "Look at it: gearfe gear FILE. Its meshes: gearfe stiffness FILE. Its train: gearfe modes FILE, gearfe "
        "vibration FILE, gearfe runup FILE. Its load capacity: gearfe rating FILE.",
        "y runs along u of the gear unit, z along v, x along w; speeds and torques count positive about +y.",
        f"Values of the model: {counts}. The complete list is at the end.",
    ]
    blocks = ["".join(_comment(line) for line in head)]
    for kind, table in job.tables.items():
        if kind in NAMED:
            for name, entry in table.items():
                label = job.labels.get((kind, name), "")
                remark = _comment(f"REXS: {label}") if label else ""
                notes = "".join(_comment(f"{line}") for line in _notes(job, f"{kind}.{name}"))
                blocks.append(remark + notes + _table(table_class(kind), entry, f"{kind}.{_key(name)}"))
        elif kind in TABLES:
            notes = "".join(_comment(line) for line in _notes(job, kind))
            blocks.append(notes + _table(table_class(kind), table, kind))
        else:
            blocks.append(f"[{kind}]\n{toml_document(table, kind)}")
    text = "\n".join(block.rstrip("\n") + "\n" for block in blocks)
    if job.left:
        text += "\n" + _comment("Not supported in a job:")
        for (kind, name), (entry, reason) in job.left.items():
            text += "#\n" + _comment(f"{kind} {name}: {plain(reason)}")
            if entry:
                header = f"{kind}.{_key(name)}" if name else kind
                text += "".join(f"## {line}".rstrip() + "\n" for line in _document(entry, header).splitlines() if line)
    text += "\n" + _comment("--- What became of each value of the model ---")
    for kind in KINDS:
        text += "#\n" + _comment(f"{kind}:")
        text += "".join(_comment(f"  {line}") for line in job.lines(kind)) or _comment("  nothing")
    return text


def _table(cls: type, entry: Mapping[str, Any], header: str) -> str:
    """Text of a table with its explanations; without them where they would lose something."""
    text = table_text(cls, entry, header, brief=True)
    place: Any = tomllib.loads(text)
    for part in _parts(header):
        place = place.get(part, {})
    return text if place == entry and text.strip() else _document(entry, header)


def _parts(header: str) -> list[str]:
    """Parts of a dotted name."""
    names, place = [], tomllib.loads(f"[{header}]")
    while place:
        name, place = next(iter(place.items()))
        names.append(name)
    return names


def _document(entry: Mapping[str, Any], header: str) -> str:
    return f"[{header}]\n{toml_document(entry, header)}"


def _key(name: str) -> str:
    return name if name.isascii() else json.dumps(name, ensure_ascii=False)


def _notes(job: RexsJob, prefix: str) -> list[str]:
    """Derived and defaulted keys of an entry, for the comments above it."""
    lines = []
    for entry in job.entries:
        if entry.kind in (DERIVED, DEFAULTED) and (entry.key == prefix or entry.key.startswith(f"{prefix}.")):
            key = entry.key.removeprefix(f"{prefix}.")
            source = f" ({entry.attribute})" if entry.attribute else ""
            lines.append(f"{entry.kind}: {key}{source}: {entry.rule}")
    return list(dict.fromkeys(lines))


def _comment(text: str) -> str:
    """A text of one paragraph as comment lines, whatever it holds."""
    shown = one_line(text)
    return textwrap.fill(shown, WIDTH, initial_indent="# ", subsequent_indent="#   ", break_on_hyphens=False) + "\n"


def one_line(text: str) -> str:
    """Return a text on one line, without characters that cannot be shown."""
    indent = len(text) - len(text.lstrip(" "))
    return " " * indent + "".join(letter if letter.isprintable() else " " for letter in " ".join(text.split()))
