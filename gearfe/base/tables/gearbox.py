"""Gears and meshes by name, with all their keys: the one form of what a job file says about them.

A file has [gears.NAME] and [meshes.NAME], or the shorthand of a pair ([pair], [microgeometry]), or the lists of a train
([[train.gears]], [[train.meshes]]). `named_gearbox`, `pair_gearbox` and `gearfe.base.tables.train_gearbox` turn them
into a `Gearbox`. The code below them does not depend on the form of the file, except for the names of keys in messages.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from ..errors import InputError, unknown_name
from .loadmap import LoadMapTable
from .microgeometry import FlankTable, GearMicrogeometryTable, MicrogeometryTable
from .pair import (
    FROM_DISTANCE,
    ROUNDING_MM,
    SAME,
    SIGNED,
    WEB_KEYS,
    GearBodyTable,
    GearTable,
    MaterialTable,
    PairTable,
    StiffnessTable,
    ToothFormTable,
    common_module_mm,
    magnitude,
    module_mm_of,
    tooth_form,
    transverse_teeth,
)

if TYPE_CHECKING:
    from .named import NamedGearTable, NamedMeshTable

#: Where a value comes from that no table gives.
DEFAULT = "default"
#: Keys of a gear's drawing, beside the tooth form.
DRAWN = ("pitch_diameter_mm", "tip_diameter_mm", "root_diameter_mm", "span_mm", "span_teeth")
#: Keys of the tooth form that gears in mesh have in common, and what messages call them.
SHARED = (("module_mm", "modules"), ("pressure_angle_deg", "pressure angles"), ("helix_angle_deg", "helix angles"))
#: Keys of a mesh that tilt its axes.
TILTS = ("misalignment_um", "misalignment_across_um")
#: Key of a mesh that lets the shafts of the train tilt its axes.
FROM_SHAFTS = "misalignment_from_shafts"
#: Hand of a gear's mate.
OPPOSITE = {"right": "left", "left": "right"}
#: Bore of a gear whose entry in [[train.gears]] gives none, times the pitch diameter.
BORE = 0.2
#: Gears of a pair.
PINION, WHEEL = "pinion", "wheel"


@dataclass(frozen=True)
class NamedGear:
    """A gear with all its keys, whatever tables they stand in.

    Attributes
    ----------
    name
        Of the gear.
    where
        Its table, for messages.
    teeth
        Number of teeth.
    form
        Keys of the tooth form, module_mm and bore_diameter_mm, defaults filled in.
    drawn
        Keys of its drawing that are given, see `DRAWN`.
    material
        Its material; None: not known, which a mesh that is computed refuses.
    material_where, density_where, microgeometry_where
        Tables of these; that of the density is empty where the gear's own key gives it.
    density_kg_per_m3
        Of its body.
    places
        Key -> another table that gives it, or `DEFAULT`.
    microgeometry
        Deviations of its flanks, or None.
    shaft, y_mm
        Shaft that carries it, and the place of its middle plane; an empty name: on none.
    like
        Tables that a gear of a train takes all of its teeth from; empty: none.
    shift_from
        Mesh whose centre distance its profile shift follows from; empty: the file gives the number.
    """

    name: str
    where: str
    teeth: int
    form: Mapping[str, Any]
    drawn: Mapping[str, Any]
    material: MaterialTable | None
    material_where: str
    density_kg_per_m3: float
    density_where: str
    places: Mapping[str, str] = field(default_factory=dict)
    microgeometry: GearMicrogeometryTable | None = None
    microgeometry_where: str = ""
    shaft: str = ""
    y_mm: float = 0.0
    like: str = ""
    shift_from: str = ""

    @property
    def internal(self) -> bool:
        """Return whether it is an internal gear."""
        return self.teeth < 0

    @property
    def has_web(self) -> bool:
        """Return whether its rim stands on a web that is narrower than the face."""
        return bool(self.form.get("web_width_mm", math.inf) < self.form["face_width_mm"])

    def written(self, key: str) -> str:
        """Table that a key of the gear stands in; an empty text for one that the file does not give."""
        if key in self.drawn:
            return self.where
        place = self.places.get(key, self.where)
        return "" if place == DEFAULT or self.form.get(key) is None else place


@dataclass(frozen=True)
class NamedMesh:
    """Two gears in mesh with all that decides their contact.

    Attributes
    ----------
    name, where
        Of the mesh, and its table, for messages.
    driver, driven
        The gears, of an internal pair the external gear first: the pinion and the wheel of contact laws and results.
    centre_distance_mm, centre_distance_where
        Centre distance, None: without backlash; and the table that it stands in, or would.
    flank
        Driving flanks of both gears, ``left`` or ``right``, outside of trains, whose senses of rotation say it.
    tolerance_class
        Class of ISO 1328-1 in the picture of the flanks, or None.
    stiffness
        [stiffness], with the keys that this mesh and the variant have instead.
    loads
        [loadmap] alike.
    misalignment_um, misalignment_across_um
        Tilts of the axes over the common face width, in and across the plane of action.
    misalignment_from_shafts
        Whether the shafts of the train tilt the gears, too.
    ring_drives
        Whether the internal gear, `driven`, drives.
    """

    name: str
    where: str
    driver: NamedGear
    driven: NamedGear
    centre_distance_mm: float | None
    centre_distance_where: str
    flank: str = "left"
    tolerance_class: int | None = None
    stiffness: StiffnessTable = field(default_factory=StiffnessTable)
    loads: LoadMapTable = field(default_factory=LoadMapTable)
    misalignment_um: float = 0.0
    misalignment_across_um: float = 0.0
    misalignment_from_shafts: bool = False
    ring_drives: bool = False

    @property
    def gears(self) -> tuple[NamedGear, NamedGear]:
        """Driver and driven gear, of an internal pair the external gear first."""
        return self.driver, self.driven

    @property
    def described(self) -> str:
        """Sentence without a full stop that says which gear drives the other."""
        one, two = self.gears[::-1] if self.ring_drives else self.gears
        return f"mesh {self.name}: {one.name} drives {two.name}"

    @property
    def ratio(self) -> float:
        """Teeth of the driven gear over those of the driver."""
        return abs(self.driven.teeth / self.driver.teeth)

    @property
    def deviates(self) -> bool:
        """Return whether the file has deviations of the flanks."""
        return any(gear.microgeometry is not None for gear in self.gears)

    @property
    def tilts_where(self) -> str:
        """Table of its misalignment, for messages; a mesh of [[train.meshes]] has that of [pair]."""
        return "pair" if self.where.startswith("train.") else self.where

    def along_width(self, sides: Iterable[str] = (), *, places: bool = True) -> tuple[str, Any] | None:
        """Return the first key, and its value, by which the load varies along the face width; None: it does not.

        Parameters
        ----------
        sides
            Flanks whose modifications count, ``left`` and ``right``; none: the driving ones.
        places
            Whether places of the gears along the axis and tilts by the shafts count: a train has both itself.
        """
        bodies = [(gear, "helix_angle_deg") for gear in self.gears if gear.form["helix_angle_deg"]]
        bodies += [(gear, "web_width_mm") for gear in self.gears if gear.has_web]
        for gear, key in bodies[:1]:
            return f"{gear.written(key)}.{key}", gear.form[key]
        for gear in self.gears if self.deviates else ():
            for side in tuple(sides) or (self.flank,):
                flank = FlankTable() if gear.microgeometry is None else gear.microgeometry.flank(side)
                if key := flank.along_width():
                    return f"{gear.microgeometry_where}.{key}", getattr(flank, key)
        for key in TILTS:
            if getattr(self, key):
                return f"{self.tilts_where}.{key}", getattr(self, key)
        if places and self.misalignment_from_shafts:
            return f"{self.where}.{FROM_SHAFTS}", True
        if places and self.driven.y_mm != self.driver.y_mm:
            return f"{self.driven.where}.y_mm", self.driven.y_mm
        return None


@dataclass(frozen=True)
class Gearbox:
    """Gears and meshes of a file, by name."""

    gears: Mapping[str, NamedGear]
    meshes: Mapping[str, NamedMesh]

    def mesh(self, name: str, field_: str = "--mesh") -> NamedMesh:
        """Return the mesh of that name.

        Raises
        ------
        InputError
            When there is none, with the names that there are; `field_` names what asked.
        """
        if name not in self.meshes:
            raise unknown_name(field_, name, self.meshes)
        return self.meshes[name]


def mesh_name(driver: str, driven: str) -> str:
    """Name of a mesh that its table does not name."""
    return f"{driver}-{driven}"


def shift_by_distance(gear: NamedGear, mate: NamedGear, distance_mm: float, where: str) -> float:
    """Return the profile shift of a gear that runs with its mate at a centre distance (mm) without backlash.

    inv(alpha_wt) = inv(alpha_t) + 2 (x_1 + x_2) tan(alpha_n)/(z_1 + z_2), cos(alpha_wt) = a_0 cos(alpha_t)/a.

    Parameters
    ----------
    gear, mate : NamedGear
        The gears; the profile shift of the mate is a number.
    distance_mm : float
        Centre distance.
    where : str
        Its key, for messages.

    Raises
    ------
    InputError
        For a distance that no pressure angle belongs to.
    """
    # with signs: negative for an internal pair
    teeth, normal = gear.teeth + mate.teeth, math.radians(gear.form["pressure_angle_deg"])
    helix = math.radians(gear.form["helix_angle_deg"])
    angle = math.atan(math.tan(normal) / math.cos(helix)) if helix else normal
    lowest = 0.5 * abs(teeth) * gear.form["module_mm"] * math.cos(angle) / math.cos(helix)
    if distance_mm <= lowest:
        problem = f"leaves no working pressure angle: must be > {lowest:.9g} mm"
        raise InputError(where, distance_mm, problem, "use a larger centre distance")
    working = math.acos(lowest / distance_mm)
    involutes = (math.tan(working) - working) - (math.tan(angle) - angle)
    return teeth * involutes / (2.0 * math.tan(normal)) - float(mate.form["profile_shift"])


def _shift_in(mesh: NamedMesh, name: str) -> float:
    """Profile shift of the gear of that name by the centre distance of a mesh and the mate's number."""
    gear, mate = (mesh.driver, mesh.driven) if mesh.driver.name == name else (mesh.driven, mesh.driver)
    where = f"{mesh.centre_distance_where}.centre_distance_mm"
    return shift_by_distance(gear, mate, mesh.centre_distance_mm or 0.0, where)


def _with_shifts(box: Gearbox) -> Gearbox:
    """The gearbox with numbers for profile shifts that follow from a centre distance, mesh by mesh."""
    gears, meshes = dict(box.gears), dict(box.meshes)
    left = [name for name, gear in gears.items() if gear.form["profile_shift"] == FROM_DISTANCE]
    while left:
        found = [
            (name, mesh)
            for name in left
            for mesh in meshes.values()
            if name in (mesh.driver.name, mesh.driven.name) and mesh.centre_distance_mm is not None
            if (mesh.driven if mesh.driver.name == name else mesh.driver).name not in left
        ]
        if not found:
            problem = "needs a mesh with centre_distance_mm and with a gear whose profile shift is a number"
            where = gears[left[0]].written("profile_shift")
            cure = "add the centre distance, or write a number"
            raise InputError(f"{where}.profile_shift", FROM_DISTANCE, problem, cure)
        name = found[0][0]
        left.remove(name)
        shifts = {mesh.name: _shift_in(mesh, name) for other, mesh in found if other == name}
        (first, shift), gear = next(iter(shifts.items())), gears[name]
        for second, contrary in shifts.items():
            if abs(contrary - shift) * gear.form["module_mm"] > ROUNDING_MM:
                problem = f"is {shift:.6g} by mesh {first!r}, but {contrary:.6g} by mesh {second!r}"
                cure = "write a number (the larger centre distance then has backlash), or correct one centre distance"
                raise InputError(f"{gear.written('profile_shift')}.profile_shift", FROM_DISTANCE, problem, cure)
        gears[name] = replace(gear, form={**gear.form, "profile_shift": shift}, shift_from=first)
        meshes = {key: _with_gears(mesh, gears) for key, mesh in meshes.items()}
    return Gearbox(gears, meshes)


def with_hands(box: Gearbox) -> Gearbox:
    """The gearbox with hands of all helices, right for the first driver where none is written.

    Hands are opposite in a mesh of external gears, the same in that of an internal gear.

    Raises
    ------
    InputError
        For the hand of a spur gear, and hands of mates that do not fit.
    """
    hands: dict[str, str] = {}
    for name, gear in box.gears.items():
        if not gear.written("helix_hand"):
            continue
        hands[name] = gear.form["helix_hand"]
        if not gear.form["helix_angle_deg"]:
            cure = "leave it out, or add helix_angle_deg"
            raise InputError(f"{gear.where}.helix_hand", hands[name], "is of a gear without helix angle", cure)
    meshes = [mesh for mesh in box.meshes.values() if mesh.driver.form["helix_angle_deg"]]
    while meshes:
        known = next((mesh for mesh in meshes if any(gear.name in hands for gear in mesh.gears)), None)
        if known is None:
            known = meshes[0]
            hands[known.driver.name] = "right"
        meshes.remove(known)
        one, two = known.gears if known.driver.name in hands else known.gears[::-1]
        internal = one.internal or two.internal
        fitting = hands[one.name] if internal else OPPOSITE[hands[one.name]]
        hand = hands.setdefault(two.name, fitting)
        if hand != fitting:
            wrong, right = (two, one) if two.written("helix_hand") else (one, two)
            problem = f"is that of gear {right.name!r} in mesh {known.name!r}, too: must be {OPPOSITE[hand]}"
            cure = "the hands of external gears in mesh are opposite: write the other one, or leave it out"
            if internal:
                problem = f"is not that of gear {right.name!r} in mesh {known.name!r}: must be {OPPOSITE[hand]}"
                cure = "an internal gear has the hand of its mate: write the other one, or leave it out"
            raise InputError(f"{wrong.where}.helix_hand", hand, problem, cure)
    gears = {
        name: replace(gear, form={**gear.form, "helix_hand": hands.get(name, "right")})
        for name, gear in box.gears.items()
    }
    return Gearbox(gears, {name: _with_gears(mesh, gears) for name, mesh in box.meshes.items()})


def _with_gears(mesh: NamedMesh, gears: Mapping[str, NamedGear]) -> NamedMesh:
    """The mesh with the gears of its names."""
    return replace(mesh, driver=gears[mesh.driver.name], driven=gears[mesh.driven.name])


def check_alike_along(
    mesh: NamedMesh,
    what: str,
    *,
    sides: Iterable[str] = (),
    places: bool = True,
    cure: str = "leave it out; gearfe stiffness and gearfe loadmap take it",
) -> None:
    """Raise `InputError` for a mesh whose load varies along the face width; see `NamedMesh.along_width`.

    Parameters
    ----------
    mesh : NamedMesh
        The mesh.
    what : str
        What takes only gears that are alike along the face width, for the message.
    sides, places
        What counts.
    cure
        What to do, for the message.
    """
    found = mesh.along_width(sides, places=places)
    if found is not None:
        key, value = found
        problem = f"makes the load vary along the face width: {what} takes spur gears alike along it only"
        raise InputError(key, None if isinstance(value, tuple) else value, problem, cure)


# --- [gears.NAME], [meshes.NAME] ------------------------------------------------------------------------------------


def named_gearbox(
    gears: Mapping[str, NamedGearTable],
    meshes: Mapping[str, NamedMeshTable],
    materials: Mapping[str, MaterialTable],
    *,
    shafts: Iterable[str] | None = None,
    planets: Collection[str] = (),
) -> Gearbox:
    """Return the gears and meshes of [gears.NAME] and [meshes.NAME], with the keys of [stiffness] left out.

    Parameters
    ----------
    gears, meshes, materials
        The tables by name.
    shafts : iterable of str, optional
        Names of the shafts, if the file has any: then every gear is on one.
    planets : collection of str
        Gears that the file has once for several planets: NAME_1, NAME_2, ... Messages have its table, [gears.NAME].

    Raises
    ------
    InputError
        For materials, gears and shafts that do not exist, gears that mesh with themselves or on one shaft, modules and
        pressure angles that differ.
    """
    known = None if shafts is None else list(shafts)
    written = {name: name.rpartition("_")[0] if name in planets else name for name in gears}
    gear_of = {name: _named_gear(name, written[name], table, materials, known) for name, table in gears.items()}
    for mates in _meshing(meshes.values()):
        tables = {name: gears[name] for name in gears if name in mates}
        helix_deg = next((table.helix_angle_deg for table in tables.values() if table.helix_angle_deg), 0.0)
        common = common_module_mm(tables.values(), helix_deg)
        for name, table in tables.items():
            module = module_mm_of(table, table.module_mm, common, gear_of[name].form["helix_angle_deg"])
            gear_of[name] = replace(gear_of[name], form={**gear_of[name].form, "module_mm": module})
    mesh_of = {}
    for name, entry in meshes.items():
        once = name.rpartition("_")[0] if {entry.driver, entry.driven} & set(planets) else name
        mesh_of[name] = _named_mesh(name, once, entry, gear_of)
    twins: dict[frozenset[str], str] = {}
    for name, mesh in mesh_of.items():
        both = frozenset((mesh.driver.name, mesh.driven.name))
        if both in twins:
            problem = f"has the gears of [meshes.{twins[both]}], too"
            raise InputError(f"meshes.{name}", None, problem, "two gears have one mesh: leave one out")
        twins[both] = name
    return _with_shifts(with_hands(Gearbox(gear_of, mesh_of)))


def _meshing(meshes: Iterable[NamedMeshTable]) -> list[set[str]]:
    """Names of gears that mesh with each other, directly or by others."""
    groups: list[set[str]] = []
    for mesh in meshes:
        joined = {mesh.driver, mesh.driven}
        apart = [group for group in groups if not group & joined]
        groups = [*apart, joined.union(*(group for group in groups if group & joined))]
    return groups


def _named_gear(
    name: str, written: str, table: NamedGearTable, materials: Mapping[str, MaterialTable], shafts: list[str] | None
) -> NamedGear:
    where = f"gears.{written}"
    material, material_where = MaterialTable(), DEFAULT
    if isinstance(table.material, MaterialTable):
        material, material_where = table.material, f"{where}.material"
    elif table.material is not None:
        if table.material not in materials:
            raise unknown_name(f"{where}.material", table.material, materials)
        material, material_where = materials[table.material], f"materials.{table.material}"
    if shafts is None and table.shaft is not None:
        raise InputError(
            f"{where}.shaft", table.shaft, "is no shaft of this file", "add [shafts.NAME], or leave it out"
        )
    if shafts is not None:
        if table.shaft is None:
            raise InputError(
                f"{where}.shaft", None, "is required: the gear is on no shaft", f"add shaft = {_or(shafts)}"
            )
        if table.shaft not in shafts:
            raise unknown_name(f"{where}.shaft", table.shaft, shafts)
    form, places = tooth_form_of(table, None, "")
    return NamedGear(
        name,
        where,
        table.teeth,
        form,
        _drawn(table),
        material,
        material_where,
        material.density_kg_per_m3,
        material_where,
        places,
        table.microgeometry,
        f"{where}.microgeometry",
        table.shaft or "",
        table.y_mm or 0.0,
    )


def _or(names: Iterable[str]) -> str:
    return " or ".join(f'"{name}"' for name in names)


def _named_mesh(name: str, written: str, table: NamedMeshTable, gears: Mapping[str, NamedGear]) -> NamedMesh:
    where = f"meshes.{written}"
    for key in ("driver", "driven"):
        if getattr(table, key) not in gears:
            raise unknown_name(f"{where}.{key}", getattr(table, key), gears)
    if table.driver == table.driven:
        raise InputError(f"{where}.driven", table.driven, "is the driver, too", "a gear meshes with another gear")
    one, two = gears[table.driver], gears[table.driven]
    if one.shaft and one.shaft == two.shaft:
        problem = f"is on shaft {two.shaft!r} with the driver {one.name!r}"
        raise InputError(f"{where}.driven", two.name, problem, "mesh gears of two shafts")
    for key, what in SHARED:
        a, b = one.form[key], two.form[key]
        if abs(a - b) > SAME * abs(a):
            given = "pitch_diameter_mm" if key == "module_mm" and "pitch_diameter_mm" in two.drawn else key
            problem = f"makes {what} of {a:.9g} and {b:.9g} in mesh {name!r}: must be that of gear {one.name!r}"
            value = two.drawn.get(given, b)
            raise InputError(f"{two.where}.{given}", value, problem, f"gears in mesh have equal {what}")
    tilts = {key: getattr(table, key) for key in (*TILTS, FROM_SHAFTS)}
    distance = magnitude(table.centre_distance_mm, one.internal or two.internal, where)
    (driver, driven), ring_drives = external_first(one, two)
    return NamedMesh(
        name,
        where,
        driver,
        driven,
        distance,
        where,
        table.flank,
        table.tolerance_class,
        ring_drives=ring_drives,
        **tilts,
    )


def external_first(driver: NamedGear, driven: NamedGear) -> tuple[tuple[NamedGear, NamedGear], bool]:
    """Return driver and driven gear, an internal gear last, and whether that exchanges them: the internal gear drives.

    Contact laws take the external gear as pinion.
    """
    if driver.internal and not driven.internal:
        return (driven, driver), True
    return (driver, driven), False


def tooth_form_of(
    table: ToothFormTable, shared: ToothFormTable | None, shared_where: str
) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the keys of a gear's tooth form with module and bore, and the sources of those it inherits."""
    tables = (table,) if shared is None else (table, shared)
    module = next((t.module_mm for t in tables if t.module_mm is not None), None)
    form: dict[str, Any] = {"module_mm": module, **tooth_form(*tables)}
    places: dict[str, str] = {}
    for key, value in form.items():
        if getattr(table, key) is not None:
            continue
        if shared is not None and getattr(shared, key) is not None:
            places[key] = shared_where
        elif value is not None:
            places[key] = DEFAULT
    if isinstance(table, GearBodyTable):
        form["helix_hand"] = table.helix_hand
        if table.helix_hand is None:
            places["helix_hand"] = DEFAULT
        if table.pitch_diameter_mm is not None:
            form["module_mm"] = abs(table.pitch_diameter_mm) / transverse_teeth(table.teeth, form["helix_angle_deg"])
            places.pop("module_mm", None)
        if table.internal:
            ring = {
                "rim_diameter_mm": table.size("rim_diameter_mm"),
                "form_diameter_mm": table.size("form_diameter_mm"),
            }
            form |= ring | {key: getattr(table, key) for key in ("rim", "cutter_teeth", "cutter_shift")}
        else:
            form["bore_diameter_mm"] = table.bore_diameter_mm
            form |= {key: getattr(table, key) for key in WEB_KEYS if getattr(table, key) is not None}
    return form, places


def _drawn(table: GearBodyTable) -> dict[str, Any]:
    drawn = {key: getattr(table, key) for key in DRAWN if getattr(table, key) is not None}
    for key in SIGNED:
        if key in drawn:  # magnitudes, except of the span, which is negative there
            drawn[key] = -abs(drawn[key]) if table.internal and key == "span_mm" else abs(drawn[key])
    return drawn


# --- [pair] ---------------------------------------------------------------------------------------------------------


def pair_gearbox(pair: PairTable, microgeometry: MicrogeometryTable | None = None) -> Gearbox:
    """Return the two gears of [pair], pinion and wheel, and their mesh."""
    gears = {side: _pair_gear(pair, side, microgeometry) for side in (PINION, WHEEL)}
    name = mesh_name(PINION, WHEEL)
    distance = magnitude(pair.centre_distance_mm, pair.pinion.internal or pair.wheel.internal, "pair")
    tilts = {key: getattr(pair, key) for key in TILTS}
    mesh = NamedMesh(name, "pair", gears[PINION], gears[WHEEL], distance, "pair", **tilts)
    if microgeometry is not None:
        mesh = replace(mesh, flank=microgeometry.flank, tolerance_class=microgeometry.tolerance_class)
    return _with_shifts(with_hands(Gearbox(gears, {name: mesh})))


def _pair_gear(pair: PairTable, side: str, microgeometry: MicrogeometryTable | None) -> NamedGear:
    table: GearTable = getattr(pair, side)
    form, places = tooth_form_of(table, pair, "pair")
    form["module_mm"] = pair.module_mm_of(side)
    material, where = pair.material, "pair.material"
    if table.material is not None:
        material, where = table.material, f"pair.{side}.material"
    uneven = None if microgeometry is None else getattr(microgeometry, side)
    return NamedGear(
        side,
        f"pair.{side}",
        table.teeth,
        form,
        _drawn(table),
        material,
        where,
        material.density_kg_per_m3,
        where,
        places,
        uneven,
        f"microgeometry.{side}",
        y_mm=table.y_mm,
    )
