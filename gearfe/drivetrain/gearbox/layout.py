"""Where the gears, shafts and bearings of a job file are: to be looked at before anything is computed.

Shafts that are not where the gears need them are what it shows. Planets of a carrier that overlap are refused.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...base.tables.carrier import TrainCarrierTable
from ...base.tables.gearbox import Gearbox
from ...base.tables.jobs import OF_GEARS, gearbox_of, planet_tables, train_tables
from ...base.tables.train import TrainTable
from ...base.tables.train_gearbox import named_train, with_materials
from ...gears.geometry.pair import gear_of, pair_of
from ..train.checks import planets_overlap
from .job import bore_places, shaft_of

#: Distances that differ by no more agree (m).
CLOSE = 1e-6


@dataclass(frozen=True)
class PlacedGear:
    """A gear: name, shaft, centre (x, y, z), radii of tip circle, reference circle, bore or rim, width; m."""

    name: str
    shaft: str
    centre: tuple[float, float, float]
    tip_radius: float
    reference_radius: float
    bore_radius: float
    width: float
    teeth: int


@dataclass(frozen=True)
class PlacedShaft:
    """A shaft: name, its middle (x, y, z), length, radius, y of its bearings by name, and its outline; m.

    The outline has for each piece the ends along the axis from the middle, and the outer radii there.
    """

    name: str
    centre: tuple[float, float, float]
    length: float
    radius: float
    bearings: tuple[tuple[str, float], ...]
    outline: tuple[tuple[float, float, float, float], ...]


@dataclass(frozen=True)
class PlacedMesh:
    """Two gears in mesh.

    Attributes
    ----------
    name, driver, driven
        Names of the mesh and of its gears, the one that drives first.
    shaft_distance
        Distance of the axes of their shafts (m).
    centre_distance
        What the gears need (m).
    overlap
        Width along which they face each other (m); negative: the gap between them.
    """

    name: str
    driver: str
    driven: str
    shaft_distance: float
    centre_distance: float
    overlap: float

    @property
    def fits(self) -> bool:
        """Whether the shafts are where the gears need them."""
        return abs(self.shaft_distance - self.centre_distance) <= CLOSE and self.overlap > 0.0

    def line(self) -> str:
        """One line about it."""
        distance = f"shafts {1e3 * self.shaft_distance:.6g} mm apart"
        if abs(self.shaft_distance - self.centre_distance) > CLOSE:
            distance += f", but the gears need {1e3 * self.centre_distance:.6g} mm"
        facing = f"{1e3 * self.overlap:.4g} mm of width"
        if self.overlap <= 0.0:
            facing = f"{-1e3 * self.overlap:.4g} mm between them along the axis, so they do not meet"
        return f"mesh {self.name}: {self.driver} drives {self.driven}, {distance}; {facing}"


@dataclass(frozen=True)
class GearboxLayout:
    """Gears, shafts and meshes of a gearbox in their places."""

    gears: tuple[PlacedGear, ...]
    shafts: tuple[PlacedShaft, ...]
    meshes: tuple[PlacedMesh, ...]

    def gear(self, name: str) -> PlacedGear:
        """The gear of that name."""
        return next(gear for gear in self.gears if gear.name == name)

    def overlapping(self) -> Iterator[tuple[PlacedGear, PlacedGear, float, float]]:
        """Yield couples of gears that are not in mesh and whose tip circles overlap: by how much, over which width (m).

        Gears on one shaft and rings are left out.
        """
        meshing = {frozenset((mesh.driver, mesh.driven)) for mesh in self.meshes}
        for one, two in itertools.combinations(self.gears, 2):
            facing = 0.5 * (one.width + two.width) - abs(one.centre[1] - two.centre[1])
            if one.teeth < 0 or two.teeth < 0 or one.shaft == two.shaft or facing <= CLOSE:
                continue
            apart = math.hypot(two.centre[0] - one.centre[0], two.centre[2] - one.centre[2])
            common = one.tip_radius + two.tip_radius - apart
            if common > CLOSE and frozenset((one.name, two.name)) not in meshing:
                yield one, two, common, facing

    def collisions(self) -> list[str]:
        """Return a line for each couple of gears that overlap."""
        return [
            f"gears {one.name} and {two.name} overlap by {1e3 * common:.4g} mm over {1e3 * facing:.4g} mm of "
            "width: move their shafts apart, or one gear along its shaft"
            for one, two, common, facing in self.overlapping()
        ]


def gearbox_layout(raw: dict[str, Any], path: str | Path) -> GearboxLayout | None:
    """Return where the parts of a parsed job are; None for a job without shafts.

    Raises
    ------
    InputError
        For mistakes in the tables, gears that cannot run together, and planets of a carrier that overlap.
    """
    tables: dict[str, Any]
    if "train" in raw:
        tables = train_tables(raw, path, "")
        box, table = tables["gearbox"], tables["train"]
    elif "shafts" in raw:
        raw, tables = planet_tables(raw, path, ("gears", "meshes", "shafts"), (*OF_GEARS, "housing"))
        box = gearbox_of(raw, path)
        bearings, carriers = tables.get("bearings", {}), tables.get("carriers", {})
        table = named_train(TrainTable(), tables["meshes"], tables["shafts"], bearings, carriers=carriers)
        table = with_materials(table, tables.get("materials", {}), "shafts.{name}")
    else:
        return None
    bores = {str(bore.attachment): 1e-3 * bore.y_mm for bore in table.rigid_bores}
    housing = tables.get("housing")
    if not bores and housing is not None and not housing.reduced and housing.mesh.file is None:
        bores = {name: point[1] for name, point in bore_places(housing, Path(path).parent).items()}
    shafts = tuple(
        PlacedShaft(
            s.name,
            (1e-3 * s.x_mm, 1e-3 * s.y_mm, 1e-3 * s.z_mm),
            1e-3 * s.whole_length_mm,
            1e-3 * s.largest_radius_mm,
            tuple((str(a), bores[str(a)]) for a in s.attachments if str(a) in bores),
            shaft_of(s).outline,
        )
        for s in table.shafts
    )
    layout = _placed(box, shafts)
    for carrier in table.carriers:
        _check_planets(layout, carrier, {s.name for s in table.shafts if s.carrier == carrier.name})
    return layout


def _check_planets(layout: GearboxLayout, carrier: TrainCarrierTable, planets: set[str]) -> None:
    """Raise `InputError` for planets of a carrier that overlap, as a train does."""
    places = {shaft.name: shaft.centre for shaft in layout.shafts}
    for one, two, common, _ in layout.overlapping():
        if {one.shaft, two.shaft} <= planets:
            needed, (x, _, z) = one.tip_radius + two.tip_radius, places[carrier.shaft]
            arm = math.hypot(one.centre[0] - x, one.centre[2] - z)
            raise planets_overlap(carrier.name, len(planets), (one.name, two.name), needed, needed - common, arm)


def _placed(box: Gearbox, shafts: tuple[PlacedShaft, ...]) -> GearboxLayout:
    places = {shaft.name: shaft.centre for shaft in shafts}
    pairs = {name: pair_of(mesh) for name, mesh in box.meshes.items()}
    made = {mesh.driver.name: pairs[name].pinion for name, mesh in box.meshes.items()}
    made |= {mesh.driven.name: pairs[name].wheel for name, mesh in box.meshes.items()}
    gears: dict[str, PlacedGear] = {}
    for name, named in box.gears.items():
        gear = made[name] if name in made else gear_of(named)
        x, _, z = places[named.shaft]
        held = (gear.rim_diameter or 0.0) if gear.internal else gear.bore_diameter
        centre, radius = (x, 1e-3 * named.y_mm, z), 0.5 * held
        radii = gear.tip_radius, gear.reference_radius, radius
        gears[name] = PlacedGear(name, named.shaft, centre, *radii, gear.face_width, gear.teeth)
    meshes = []
    for name, mesh in box.meshes.items():
        one, two = gears[mesh.driver.name], gears[mesh.driven.name]
        apart = math.hypot(two.centre[0] - one.centre[0], two.centre[2] - one.centre[2])
        ends = [(gear.centre[1] - 0.5 * gear.width, gear.centre[1] + 0.5 * gear.width) for gear in (one, two)]
        overlap = min(high for _, high in ends) - max(low for low, _ in ends)
        names = (two.name, one.name) if mesh.ring_drives else (one.name, two.name)
        meshes.append(PlacedMesh(name, *names, apart, pairs[name].working_centre_distance, overlap))
    return GearboxLayout(tuple(gears.values()), shafts, tuple(meshes))
