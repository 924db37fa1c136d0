"""[bodies.NAME.beam]: section, material and elements of a flexible link."""

from __future__ import annotations

from dataclasses import dataclass

from ..config import quantity
from ..errors import InputError

#: Ways to give a section: keys that must stand together.
SECTIONS = (("width_m", "height_m"), ("diameter_m",), ("area_m2", "second_moment_m4"))


@dataclass(frozen=True)
class BeamTable:
    """[bodies.NAME.beam]"""

    length_m: float = quantity(above=0.0, doc="length of the axis, which is the x axis of the frame from 0, in m")
    width_m: float | None = quantity(None, above=0.0, doc="width of a rectangle, out of the plane, in m")
    height_m: float | None = quantity(None, above=0.0, doc="height of a rectangle, in the plane, in m")
    diameter_m: float | None = quantity(None, above=0.0, doc="diameter of a round section in m")
    inner_diameter_m: float = quantity(0.0, low=0.0, doc="inner diameter of a tube in m")
    area_m2: float | None = quantity(None, above=0.0, doc="area of any section in m2")
    second_moment_m4: float | None = quantity(None, above=0.0, doc="second moment of area in m4")
    edge_m: float | None = quantity(
        None, above=0.0, doc="distance of the outer fibre of any section from the axis in m"
    )
    youngs_modulus_GPa: float = quantity(above=0.0, doc="Young's modulus (GPa)")
    poisson_ratio: float = quantity(0.3, above=-1.0, high=0.5, doc="Poisson's ratio, for shear")
    density_kg_per_m3: float = quantity(above=0.0, doc="density (kg/m3)")
    damping_s: float = quantity(
        0.0, low=0.0, doc="Kelvin-Voigt time: a strain's rate times this counts as strain, in s"
    )
    elements: int = quantity(4, low=1, high=200, doc="elements; there is at least one between two points")
    frame: str = quantity(
        "chord", choices=("chord", "start"), doc="frame of deflections: through both ends, or clamped"
    )

    def check(self, where: str) -> None:
        """One section, whole."""
        given = [keys for keys in SECTIONS if any(getattr(self, key) is not None for key in keys)]
        ways = "width_m and height_m, diameter_m, or area_m2 and second_moment_m4"
        if not given:
            raise InputError(where, None, "has no section", f"give {ways}")
        if len(given) > 1:
            raise InputError(where, None, f"has two sections: {given[0][0]} and {given[1][0]}", f"give one of {ways}")
        for key in given[0]:
            if getattr(self, key) is None:
                raise InputError(f"{where}.{key}", None, f"is required with {given[0][0]}", "add it")
        for key, of in (("inner_diameter_m", "diameter_m"), ("edge_m", "area_m2")):
            if getattr(self, key) and getattr(self, of) is None:
                raise InputError(f"{where}.{key}", getattr(self, key), f"belongs to a section with {of}", "remove it")
        if self.diameter_m is not None and self.inner_diameter_m >= self.diameter_m:
            problem = f"must be below diameter_m = {self.diameter_m:g}"
            raise InputError(f"{where}.inner_diameter_m", self.inner_diameter_m, problem, "give the bore of the tube")


def check_on_axis(beam: BeamTable, x: float, label: str) -> None:
    """A point of the link lies on its axis, or beside it."""
    if not -1e-9 * beam.length_m <= x <= (1.0 + 1e-9) * beam.length_m:
        problem = f"lies outside of the link: its x must be from 0 to length_m = {beam.length_m:g}"
        raise InputError(label, x, problem, "move it onto the link, or make the link longer")
