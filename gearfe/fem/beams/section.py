"""A straight shaft of circular sections with discs on it: what the beam elements are made from."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import accumulate

from ...base.errors import InputError, unknown_name

#: Directions in which a station is loaded: along e1 and e2, about them, along the axis, about the axis.
LOADS = ("radial", "tilt", "axial", "torsion")

#: Part of a shaft's length within which two axial positions are the same.
SAME_PLACE = 1e-9


@dataclass(frozen=True)
class Section:
    """A piece of a shaft: a hollow cylinder, or a cone where its diameters differ.

    Attributes
    ----------
    length
        m.
    outer_start, outer_end, inner_start, inner_end
        Outer and inner diameter at both ends (m); linear between them.
    young, density
        Elastic modulus (Pa), density (kg/m3).
    poisson
        Poisson's ratio.
    """

    length: float
    outer_start: float
    outer_end: float
    inner_start: float = 0.0
    inner_end: float = 0.0
    young: float = 2.06e11
    poisson: float = 0.3
    density: float = 7850.0

    @property
    def shear_modulus(self) -> float:
        """E/(2(1 + nu)) (Pa)."""
        return self.young / (2.0 * (1.0 + self.poisson))

    def fault(self) -> tuple[str, float, str, str] | None:
        """Return name, value, problem and cure of the first value that no section can have, or None."""
        for name in ("length", "outer_start", "outer_end", "young", "density"):
            value = getattr(self, name)
            if not 0.0 < value < math.inf:
                return name, value, "must be > 0 and finite", "give a positive number"
        for end in ("start", "end"):
            name, outer = f"inner_{end}", getattr(self, f"outer_{end}")
            value = getattr(self, name)
            if not 0.0 <= value < outer:
                problem = f"must be >= 0 and below the outer diameter there, {outer:g} m"
                return name, value, problem, "give a smaller bore or a larger shaft"
        if not 0.0 <= self.poisson < 0.5:
            return (
                "poisson",
                self.poisson,
                "must be >= 0 and < 0.5",
                "give Poisson's ratio of the material (steel: 0.3)",
            )
        return None


@dataclass(frozen=True)
class Disc:
    """A rigid body on a shaft, its centre on the axis.

    Attributes
    ----------
    along
        Axial position of its centre (m).
    mass
        kg.
    polar, transverse
        Moments of inertia about the axis and about any transverse line through its centre (kg m2).
    """

    along: float
    mass: float
    polar: float = 0.0
    transverse: float = 0.0


@dataclass(frozen=True)
class Station:
    """A place of a shaft where a gear, a bearing or a coupling acts.

    Attributes
    ----------
    along
        Axial position (m).
    name
        For messages and results.
    loads
        Directions in which forces or moments act there, of `LOADS`; both bending planes go together.
    """

    along: float
    name: str
    loads: tuple[str, ...] = LOADS


@dataclass(frozen=True)
class BeamShaft:
    """A shaft of sections, one after the other, with discs and stations.

    Attributes
    ----------
    start
        Axial position of the first section's first end (m).
    sections, discs, stations
        See `Section`, `Disc`, `Station`; the axial positions of all share one origin.
    name
        For messages.

    Raises
    ------
    InputError
        A section that cannot exist; a disc or station off the shaft; an unknown load; a station's name given twice.
    """

    start: float
    sections: tuple[Section, ...]
    discs: tuple[Disc, ...] = ()
    stations: tuple[Station, ...] = ()
    name: str = "shaft"

    def __post_init__(self) -> None:
        if not self.sections:
            raise InputError(f"{self.name}.sections", None, "has no section", "give at least one")
        if not math.isfinite(self.start):
            raise InputError(
                f"{self.name}.start", self.start, "must be finite", "give the position of the first end (m)"
            )
        for number, section in enumerate(self.sections, 1):
            if (fault := section.fault()) is not None:
                name, value, problem, cure = fault
                raise InputError(f"{self.name}.sections[{number}].{name}", value, problem, cure)
        for number, disc in enumerate(self.discs, 1):
            self._check_place(f"discs[{number}]", disc.along)
            for name in ("mass", "polar", "transverse"):
                value = getattr(disc, name)
                if not 0.0 <= value < math.inf:
                    field = f"{self.name}.discs[{number}].{name}"
                    raise InputError(field, value, "must be >= 0 and finite", "give a mass (kg) or inertia (kg m2)")
        seen = set()
        for station in self.stations:
            self._check_place(f"station {station.name!r}", station.along)
            for load in station.loads:
                if load not in LOADS:
                    raise unknown_name(f"{self.name}.station {station.name!r}.loads", load, LOADS)
            if station.name in seen:
                field = f"{self.name}.stations"
                raise InputError(field, station.name, "is the name of two stations", "give each its own")
            seen.add(station.name)

    @property
    def ends(self) -> tuple[float, ...]:
        """Axial positions of the sections' ends (m), one more than sections."""
        return tuple(accumulate((section.length for section in self.sections), initial=self.start))

    @property
    def end(self) -> float:
        """Axial position of the last end (m)."""
        return self.ends[-1]

    @property
    def length(self) -> float:
        """m."""
        return self.end - self.start

    def covers(self, along: float) -> bool:
        """Return whether an axial position (m) is on the shaft."""
        slack = SAME_PLACE * self.length
        return self.start - slack <= along <= self.end + slack

    def _check_place(self, what: str, along: float) -> None:
        if not self.covers(along):
            problem = f"is not on the shaft, which reaches from {self.start:g} to {self.end:g} m"
            raise InputError(f"{self.name}.{what}", along, problem, "move it, or make a section longer")
