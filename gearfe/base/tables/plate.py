# ruff: noqa: RUF009 - `quantity` makes dataclass fields
"""[bodies.NAME.plate]: a flexible link of plane finite elements, with the interfaces at which joints hold it."""

from __future__ import annotations

from dataclasses import dataclass

from ..config import quantity
from ..errors import InputError

Pair = tuple[float, float]


@dataclass(frozen=True)
class InterfaceTable:
    """[bodies.NAME.plate.interfaces.NAME]"""

    centre_m: Pair | None = quantity(None, doc="centre of a round hole, [x, y] in m")
    radius_m: float | None = quantity(None, above=0.0, doc="its radius in m; an outline gets the hole")
    edge_m: tuple[Pair, Pair] | None = quantity(
        None, doc="instead of a hole: a straight part of the edge, given by its two ends"
    )

    def check(self, where: str) -> None:
        """A hole, or an edge."""
        hole = [key for key in ("centre_m", "radius_m") if getattr(self, key) is not None]
        if self.edge_m is not None and hole:
            raise InputError(f"{where}.{hole[0]}", None, "belongs to a hole, but edge_m is given, too", "keep one")
        if self.edge_m is None and len(hole) < 2:
            missing = "centre_m" if "centre_m" not in hole else "radius_m"
            raise InputError(f"{where}.{missing}", None, "is required", "give centre_m and radius_m, or edge_m")
        if self.edge_m is not None and self.edge_m[0] == self.edge_m[1]:
            raise InputError(f"{where}.edge_m", list(self.edge_m[0]), "has no length", "give two different ends")

    @property
    def centre(self) -> Pair:
        """Place of the point of this name (m)."""
        if self.edge_m is not None:
            (a, b), (c, d) = self.edge_m
            return 0.5 * (a + c), 0.5 * (b + d)
        return self.centre_m or (0.0, 0.0)


@dataclass(frozen=True)
class PlateTable:
    """[bodies.NAME.plate]"""

    interfaces: dict[str, InterfaceTable] = quantity(doc="where joints and forces hold; the frame goes with the first")
    thickness_m: float = quantity(above=0.0, doc="thickness out of the plane in m")
    youngs_modulus_GPa: float = quantity(above=0.0, doc="Young's modulus (GPa)")
    density_kg_per_m3: float = quantity(above=0.0, doc="density (kg/m3)")
    poisson_ratio: float = quantity(0.3, above=-1.0, below=0.5, doc="Poisson's ratio (plane stress)")
    damping_s: float = quantity(
        0.0, low=0.0, doc="Kelvin-Voigt time: a strain's rate times this counts as strain, in s"
    )
    outline_m: tuple[Pair, ...] | None = quantity(None, doc="corners of the part in its frame, [[x, y], ...] in m")
    holes_m: tuple[tuple[float, float, float], ...] = quantity(
        (), doc="further round holes, [[x, y, radius], ...] in m"
    )
    mesh: str | None = quantity(None, doc="instead of an outline: a file of triangles, next to the mechanism file")
    mesh_unit_m: float = quantity(1.0, above=0.0, doc="length of the mesh file's unit in m: 0.001 for mm")
    element_size_m: float | None = quantity(
        None, above=0.0, doc="edge of the elements of an outline in m (default: area / perimeter)"
    )
    modes: int = quantity(4, low=1, high=40, doc="vibrations with the interfaces held, in addition to static shapes")
    frame: str = quantity(
        "chord", choices=("chord", "start"), doc="frame of deflections: through the first two interfaces, or the first"
    )

    def check(self, where: str) -> None:
        """An outline or a mesh; at least one interface."""
        if (self.outline_m is None) == (self.mesh is None):
            problem = "has no shape" if self.mesh is None else "has two shapes: outline_m and mesh"
            raise InputError(where, None, problem, "give outline_m, or mesh")
        for key in ("holes_m", "element_size_m"):
            if self.mesh is not None and getattr(self, key):
                raise InputError(f"{where}.{key}", None, "belongs to an outline, but mesh is given", "remove it")
        if self.mesh is None and self.mesh_unit_m != 1.0:
            raise InputError(f"{where}.mesh_unit_m", self.mesh_unit_m, "belongs to a mesh", "remove it")
        if not self.interfaces:
            raise InputError(f"{where}.interfaces", None, "there is none", "name at least one place that joints hold")
