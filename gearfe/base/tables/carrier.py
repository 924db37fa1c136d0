"""Carriers of planetary stages: [carriers.NAME], and the planets that a file writes once for all places."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..config import quantity
from ..errors import InputError
from .bearing import Two, in_two

#: Most planets of a set: more do not fit round a sun.
MOST_PLANETS = 24
#: Kinds of tables by name of which each planet has its own entry.
OF_PLANETS = ("shafts", "gears", "meshes")
#: Keys of springs and dampers of a pin along its axes -> for tilt.
PINS = {
    "pin_stiffness_N_per_m": "pin_tilt_stiffness_Nm_per_rad",
    "pin_damping_N_s_per_m": "pin_tilt_damping_Nm_s_per_rad",
}


@dataclass(frozen=True)
class _Pins:
    """The carrier and its pins."""

    shaft: str = quantity(doc="name of the shaft that is the carrier")
    pin_stiffness_N_per_m: float | tuple[float, ...] | None = quantity(
        None,
        doc="of each pin, radial and tangential (N/m), the other motions being held; or three numbers: radial, along "
        "y, tangential (N/m); left out: rigid pins",
    )
    pin_tilt_stiffness_Nm_per_rad: Two | None = quantity(  # noqa: RUF009
        None, low=0.0, doc="with three numbers: of two tilts (N m/rad); left out: 0, it tilts freely"
    )
    pin_damping_N_s_per_m: float | tuple[float, ...] = quantity(
        0.0, doc="of those springs (N s/m), one number or three as of the stiffness"
    )
    pin_tilt_damping_Nm_s_per_rad: Two | None = quantity(  # noqa: RUF009
        None, low=0.0, doc="with three numbers: of two tilts (N m s/rad)"
    )
    pin_radial_errors_um: tuple[float, ...] = quantity(
        (), doc="how much farther from the axis of the carrier each pin is than it should be (um); left out: 0"
    )
    pin_tangential_errors_um: tuple[float, ...] = quantity(
        (), doc="how much farther about +y each pin is than it should be (um); left out: 0"
    )

    def check(self, where: str) -> None:
        """Springs of pins are one number > 0 or three, dampers >= 0 alike; tilts belong to three."""
        for key, tilt in PINS.items():
            least = key == "pin_stiffness_N_per_m"
            value, tilts = getattr(self, key), getattr(self, tilt)
            numbers = value if isinstance(value, tuple) else (0.0 if value is None else value,)
            written = list(value) if isinstance(value, tuple) else value
            if len(numbers) == 5:
                raise InputError(f"{where}.{key}", written, "has two numbers for tilts", in_two(written, key, tilt))
            wrong = len(numbers) not in (1, 3) or not all(math.isfinite(x) and x >= 0.0 for x in numbers)
            if wrong or (least and value is not None and max(numbers) <= 0.0):
                problem = f"must be one number {'>' if least else '>='} 0, or three >= 0"
                cure = f"one: radial and tangential; three: radial, along y, tangential, with {tilt}"
                raise InputError(f"{where}.{key}", written, problem, cure)
            if tilts is not None and len(numbers) == 1:
                problem = f"needs three numbers of {key}: with one, pins do not tilt"
                raise InputError(f"{where}.{tilt}", list(tilts), problem, f"write {key} = [radial, y, tangential]")
            if not least and any((*numbers, *(tilts or ()))) and self.pin_stiffness_N_per_m is None:
                problem = "is of pins with a stiffness, and these are rigid"
                cure = "add pin_stiffness_N_per_m, or leave it out"
                raise InputError(f"{where}.{key}", written, problem, cure)

    def springs(self, key: str) -> Any:
        """Stiffness or damping of a pin: one number for two directions, five, or None.

        Parameters
        ----------
        key : str
            One of `PINS`.
        """
        value = getattr(self, key)
        if not isinstance(value, tuple):
            return value
        return value[0] if len(value) == 1 else (*value, *(getattr(self, PINS[key]) or (0.0, 0.0)))


@dataclass(frozen=True)
class CarrierTable(_Pins):
    """A carrier: the shaft that it is, its planets, and their pins. A shaft is a planet by carrier = "NAME"."""

    planets: int | None = quantity(
        None, low=1, high=MOST_PLANETS, doc="number of planets with equal spacing, or give planet_angles_deg"
    )
    planet_angles_deg: tuple[float, ...] = quantity(
        (), doc="angle of each planet (deg, about +y, from the position of its shaft), instead of their number"
    )

    @property
    def angles_deg(self) -> tuple[float, ...]:
        """Angle of each planet from the position that its shaft has in the file."""
        count = self.planets or 0
        return self.planet_angles_deg or tuple(360.0 * k / count for k in range(count))

    def check(self, where: str) -> None:
        """Planets of a possible number, at different positions; errors for each pin."""
        super().check(where)
        angles, cure = self.planet_angles_deg, "write planets = 3, or the angle of each in planet_angles_deg"
        if self.planets is None and not angles:
            raise InputError(f"{where}.planets", None, "is required", cure)
        if self.planets is not None and angles:
            raise InputError(f"{where}.planets", self.planets, "conflicts with planet_angles_deg", "leave one out")
        count = len(self.angles_deg)
        if count > MOST_PLANETS:
            problem = f"must be 1 to {MOST_PLANETS} planets"
            raise InputError(f"{where}.planet_angles_deg", list(angles), problem, "leave some out")
        turned = {angle % 360.0 for angle in angles}
        if len(turned) < len(angles):
            problem = "must be angles (deg), each once"
            cure = "give each planet a different position"
            raise InputError(f"{where}.planet_angles_deg", list(angles), problem, cure)
        for key in ("pin_radial_errors_um", "pin_tangential_errors_um"):
            errors = getattr(self, key)
            if errors and len(errors) != count:
                problem = f"has {len(errors)} values for {count} planets"
                raise InputError(f"{where}.{key}", list(errors), problem, "give one for each planet, or leave it out")


@dataclass(frozen=True)
class _Named:
    """Name of an entry of a list."""

    name: str = quantity(doc="name, by which the shafts of its planets call it (carrier)")


@dataclass(frozen=True)
class TrainCarrierTable(_Pins, _Named):
    """A carrier in a list; each of its planets is a shaft of the list with carrier = its name."""


def with_planets(raw: Mapping[str, Any], carriers: Mapping[str, CarrierTable]) -> dict[str, Any]:
    """Return a parsed job in which each planet has its own shaft, gears and meshes: NAME_1, NAME_2, ...

    A shaft with a carrier, the gears on it and their meshes are written once. The first planet has the position in the
    file, the others are rotated about the axis of the carrier. Planets that mesh with each other have one number.

    Parameters
    ----------
    raw : mapping
        The parsed job, whose tables have been checked.
    carriers : mapping
        Its tables [carriers.NAME].

    Raises
    ------
    InputError
        For carriers and shafts that do not exist, carriers without planets, and names that two entries would have.
    """
    shafts: Mapping[str, Any] = raw.get("shafts", {})
    planets = {name: entry["carrier"] for name, entry in shafts.items() if "carrier" in entry}
    for name, carrier in planets.items():
        if carrier not in carriers:
            problem = "is no carrier of this file"
            known = " or ".join(f'"{other}"' for other in carriers)
            cure = f"write {known}, or leave it out" if known else f"add [carriers.{carrier}], or leave it out"
            raise InputError(f"shafts.{name}.carrier", carrier, problem, cure)
    for name, table in carriers.items():
        if table.shaft not in shafts:
            problem, cure = "is no shaft of this file", f"write one of {', '.join(shafts)}"
            raise InputError(f"carriers.{name}.shaft", table.shaft, problem, cure)
        if table.shaft in planets:
            problem = "is a planet itself"
            raise InputError(f"carriers.{name}.shaft", table.shaft, problem, "the carrier is a shaft in bearings")
        if name not in planets.values():
            problem, cure = "carries nothing", f'write carrier = "{name}" in the shaft of its planets'
            raise InputError(f"[carriers.{name}]", None, problem, cure)
    expanded = dict(raw)
    gears: Mapping[str, Any] = raw.get("gears", {})
    of_gear = {name: planets[entry["shaft"]] for name, entry in gears.items() if entry.get("shaft") in planets}
    expanded["shafts"] = _each(shafts, planets, carriers, "shafts", lambda entry, k, name: _place(
        entry, shafts[carriers[name].shaft], carriers[name].angles_deg[k]))  # fmt: skip
    expanded["gears"] = _each(gears, of_gear, carriers, "gears", lambda entry, k, _: {
        **entry, "shaft": f"{entry['shaft']}_{k + 1}"})  # fmt: skip
    meshes: Mapping[str, Any] = raw.get("meshes", {})
    of_mesh = {
        name: next(of_gear[entry[key]] for key in ("driver", "driven") if entry[key] in of_gear)
        for name, entry in meshes.items()
        if {entry.get("driver"), entry.get("driven")} & of_gear.keys()
    }
    # a phase is that of the first planet: the teeth of sun and ring then place those of the others
    expanded["meshes"] = _each(meshes, of_mesh, carriers, "meshes", lambda entry, k, _: {
        **{key: value for key, value in entry.items() if key != "phase_deg" or not k},
        **{key: f"{entry[key]}_{k + 1}" for key in ("driver", "driven") if entry[key] in of_gear},
    })  # fmt: skip
    return {name: table for name, table in expanded.items() if name in raw}


def _each(
    entries: Mapping[str, Any],
    repeated: Mapping[str, str],
    carriers: Mapping[str, CarrierTable],
    kind: str,
    change: Any,
) -> dict[str, Any]:
    """Entries of a table of tables, those that are repeated once for each planet of their carrier."""
    made: dict[str, Any] = {}
    for name, entry in entries.items():
        if name not in repeated:
            copies = {name: entry}
        else:
            count = len(carriers[repeated[name]].angles_deg)
            copies = {f"{name}_{k + 1}": change(copy.deepcopy(entry), k, repeated[name]) for k in range(count)}
        for one, table in copies.items():
            if one in made or (one != name and one in entries):
                problem = f"is the name of a planet's own entry, made of [{kind}.{name}]"
                raise InputError(f"name in [{kind}]", one, problem, "rename it")
            made[one] = table
    return made


def _place(entry: dict[str, Any], carrier: Mapping[str, Any], angle_deg: float) -> dict[str, Any]:
    """A planet's shaft, turned about +y around the axis of its carrier."""
    x, z = float(carrier["x_mm"]), float(carrier.get("z_mm", 0.0))
    along, up = float(entry["x_mm"]) - x, z - float(entry.get("z_mm", 0.0))  # along e1 = +x and e2 = -z
    turns = round(angle_deg / 90.0)
    exact = abs(angle_deg - 90.0 * turns) < 1e-12
    cosine, sine = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    if exact:
        cosine, sine = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[turns % 4]
    entry["x_mm"] = x + cosine * along - sine * up
    entry["z_mm"] = z - (sine * along + cosine * up)
    return entry
