"""Define the table ``[housing]``: a parametric gearbox housing, a mesh, or a reduced body.

The parametric housing has two bored walls on a base plate with four feet.

All lengths in millimetres, in one frame: shafts run along y, z points up, the gap between the walls is centred on
y = 0.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from dataclasses import dataclass
from typing import ClassVar

from ..config import quantity
from ..errors import InputError


@dataclass(frozen=True)
class ShaftAxisTable:
    """One shaft axis, parallel to y, and its bores in the walls."""

    x_mm: float = quantity(doc="x of the shaft axis (mm)")
    z_mm: float = quantity(0.0, doc="z of the shaft axis (mm)")
    bore_radius_mm: float = quantity(10.0, low=0.01, doc="radius of the bores (mm)")
    boss_radius_mm: float = quantity(15.0, above=0.0, doc="outer radius of the bosses around the bores (mm)")
    boss_height_mm: float = quantity(10.0, low=0.0, doc="height of the bosses above the outer wall faces (mm)")
    walls: str = quantity(
        "both", choices=("both", "plus", "minus"), doc="walls that are bored: both, plus (+y), minus (-y)"
    )

    def check(self, where: str) -> None:
        """A boss is wider than its bore."""
        if self.boss_height_mm > 0.0 and self.boss_radius_mm <= self.bore_radius_mm:
            problem = f"must be larger than the bore radius {self.bore_radius_mm:g}"
            raise InputError(f"{where}.boss_radius_mm", self.boss_radius_mm, problem, "or set boss_height_mm = 0")


@dataclass(frozen=True)
class FeetTable:
    """Four feet outboard of the ends of the base plate; their bottoms lie in its bottom plane."""

    length_x_mm: float = quantity(30.0, above=0.0, doc="length of a foot along x, outboard of the wall ends (mm)")
    width_y_mm: float = quantity(22.0, above=0.0, doc="width of a foot along y (mm)")
    height_mm: float = quantity(15.0, above=0.0, doc="height of a foot above the bottom plane (mm)")
    inset_y_mm: float = quantity(0.0, low=0.0, doc="distance of a foot's outer side from the outer wall face (mm)")
    fixed: bool = quantity(True, doc="whether the bottoms of the feet are held; false gives a free housing")


#: Poisson's ratios (-) for which the mesh's error estimate holds. Tetrahedra lock near 0.5: errors against
#: finer elements that do not (Taylor-Hood) were 0.81 of the estimate at 0.49, 0.98 at 0.495, 1.32 at 0.499; against a
#: finer mesh 0.25 of it at -0.99.
POISSON_RATIOS = (-0.99, 0.49)
#: Speeds sqrt(E/rho) (m/s) of waves along bars: rubber has about 30, steel 5000, beryllium 13,000, diamond 18,000.
BAR_SPEEDS = (20.0, 20_000.0)


@dataclass(frozen=True)
class HousingMaterialTable:
    """The housing's material."""

    youngs_modulus_GPa: float = quantity(200.0, low=1e-9, high=2000.0, doc="Young's modulus (GPa)")
    poisson_ratio: float = quantity(0.3, above=-1.0, below=0.5, doc="Poisson's ratio")
    density_kg_per_m3: float = quantity(7850.0, low=1e-9, high=1e9, doc="density (kg/m3)")

    def check(self, where: str) -> None:
        """Raise `InputError` for a Poisson's ratio that locks, and a modulus and a density that no solid has."""
        low, high = POISSON_RATIOS
        if not low <= self.poisson_ratio <= high:
            problem = f"must be {low:g} to {high:g}: beyond, elements lock, and the mesh's error estimate does not hold"
            cure = (
                f"give {high:g} for a material that keeps its volume" if self.poisson_ratio > high else "0.3 is usual"
            )
            raise InputError(f"{where}.poisson_ratio", self.poisson_ratio, problem, cure)
        speed = math.sqrt(1e9 * self.youngs_modulus_GPa / self.density_kg_per_m3)
        if not BAR_SPEEDS[0] <= speed <= BAR_SPEEDS[1]:
            problem = (
                f"and youngs_modulus_GPa = {self.youngs_modulus_GPa:g} give waves of {speed:.3g} m/s along a bar: "
                f"must be {BAR_SPEEDS[0]:g} to {BAR_SPEEDS[1]:g}"
            )
            cure = "one of them has another unit: steel has 7850 kg/m3 and 200 GPa, aluminium 2700 and 70"
            raise InputError(f"{where}.density_kg_per_m3", self.density_kg_per_m3, problem, cure)


@dataclass(frozen=True)
class HousingMeshTable:
    """Size of the elements, or a mesh of the user's own."""

    #: ``mesh = "box.msh"`` is ``mesh = { file = "box.msh" }``.
    SHORT: ClassVar[str] = "file"

    size_mm: float = quantity(
        4.5,
        above=0.0,
        doc="thickness of the elements at inner edges, where it decides the error; others follow (mm); of a CAD file "
        "the largest edge",
    )
    file: str | None = quantity(
        None, doc="mesh file: .msh, .vtu, .inp, .bdf, .med, ... (or .step), next to the job file"
    )
    unit: str = quantity("mm", choices=("mm", "cm", "m", "in"), doc="unit of the coordinates in that file")
    axes: tuple[str, str, str] = quantity(
        ("x", "y", "z"),
        choices=("x", "y", "z", "-x", "-y", "-z"),
        doc="axes of the file that become x, y and z: shafts run along y. All other keys are in the new axes",
    )
    origin_mm: tuple[float, float, float] = quantity(
        (0.0, 0.0, 0.0), doc="point of the file, in its axes, that becomes the origin (mm)"
    )
    inner_box_mm: tuple[tuple[float, float, float], tuple[float, float, float]] | None = quantity(
        None, doc="lowest and highest corner of a box (mm) in which faces bound the inside: they radiate no sound"
    )
    refine_to_unknowns: int | None = quantity(
        None,
        low=1000,
        high=2_000_000,
        doc="refine the file's tetrahedra where their error is largest, up to about this number of unknowns "
        "(three per node); left out: no refinement",
    )

    def check(self, where: str) -> None:
        """Raise `InputError` for axes that are no rotation, and for a refinement of what is no file."""
        if self.refine_to_unknowns is not None and self.file is None:
            problem = "refines a mesh of the user's own; the housing of walls and feet is meshed by size"
            raise InputError(f"{where}.refine_to_unknowns", self.refine_to_unknowns, problem, "take a smaller size_mm")
        names = "".join(self.axes)
        letters = names.replace("-", "")
        even = letters in ("xyz", "yzx", "zxy")
        if sorted(letters) != ["x", "y", "z"] or even != (names.count("-") % 2 == 0):
            problem = "must name x, y and z once each, and be right-handed"
            cure = 'shafts along z: ["x", "z", "-y"]; along x: ["-y", "x", "z"]'
            raise InputError(f"{where}.axes", list(self.axes), problem, cure)


#: Lengths in m.
UNITS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 25.4e-3}


@dataclass(frozen=True)
class MeshBoreTable:
    """A bore of a mesh file: a cylinder, or a group."""

    name: str | None = quantity(None, doc="of the attachment, by default its number from 1 on")
    group: str | None = quantity(None, doc="named group of its nodes or faces in the mesh, or point_mm and radius_mm")
    point_mm: tuple[float, float, float] | None = quantity(
        None, doc="a point on the axis (mm); with group: its reference point; the group then need not be a cylinder"
    )
    direction: tuple[float, float, float] = quantity((0.0, 1.0, 0.0), doc="along the axis, of any length")
    radius_mm: float | None = quantity(None, above=0.0, doc="radius (mm)")
    range_mm: tuple[float, float] | None = quantity(
        None, doc="begin and end along the axis, from point_mm on (mm); left out: all that the mesh has"
    )

    def check(self, where: str) -> None:
        """Raise `InputError` for a bore that is defined by no key, or by two."""
        if self.group is None and (self.point_mm is None or self.radius_mm is None):
            key = "point_mm" if self.point_mm is None else "radius_mm"
            raise InputError(
                f"{where}.{key}", None, "is required without a group", "give point_mm and radius_mm, or group"
            )
        for key in ("radius_mm", "range_mm"):
            if self.group is not None and getattr(self, key) is not None:
                problem = "conflicts with group, whose nodes define it"
                raise InputError(f"{where}.{key}", getattr(self, key), problem, "leave one of them out")
        if not any(self.direction):
            raise InputError(f"{where}.direction", list(self.direction), "must not be zero", "give the axis")


#: Forces in N, of the systems of units N, m, kg; N, mm, t; ...
FORCES = {"mm": 1.0, "m": 1.0, "in": 4.4482216152605}


@dataclass(frozen=True)
class AttachmentTable:
    """An attachment of a superelement: a point with six coordinates."""

    name: str | None = quantity(None, doc="by default its number from 1 on")
    point_mm: tuple[float, float, float] = quantity(doc="its point (mm)")
    direction: tuple[float, float, float] = quantity((0.0, 1.0, 0.0), doc="axis of the bore, of any length")
    rows: tuple[int, int, int, int, int, int] | None = quantity(
        None,
        low=1,
        doc="rows of u_x, u_y, u_z and the rotations in the matrices, from 1 on; left out: six by six in order",
    )
    node: int | None = quantity(None, doc="or its node, in matrices of Abaqus or DMIG")

    def check(self, where: str) -> None:
        """Raise `InputError` for keys that contradict each other."""
        if self.rows is not None and self.node is not None:
            raise InputError(f"{where}.node", self.node, "conflicts with rows", "leave one of them out")
        if not any(self.direction):
            raise InputError(f"{where}.direction", list(self.direction), "must not be zero", "give the axis")


@dataclass(frozen=True)
class SuperelementTable:
    """Matrices of another program instead of a mesh."""

    stiffness: str = quantity(
        doc="file of the stiffness: Matrix Market, matrices or substructure of Abaqus, DMIG, OUTPUT2 or OUTPUT4"
    )
    mass: str = quantity(doc="file of the mass matrix")
    unit: str = quantity(
        "m", choices=("m", "mm", "in"), doc="of these matrices: m (N, m, kg), mm (N, mm, t) or in (lbf, in, s)"
    )
    attachments: tuple[AttachmentTable, ...] = quantity(doc="its attachments")

    def check(self, where: str) -> None:
        """Raise `InputError` for a superelement without attachments."""
        if not self.attachments:
            raise InputError(f"{where}.attachments", [], "is empty", f"add [[{where}.attachments]]")


@dataclass(frozen=True)
class HeldTable:
    """Nodes of a mesh of the user's own that are held: a group, or those on a plane."""

    group: str | None = quantity(None, doc="named group of nodes or faces in the mesh, or point_mm")
    point_mm: tuple[float, float, float] | None = quantity(None, doc="a point on the plane (mm)")
    normal: tuple[float, float, float] = quantity((0.0, 0.0, 1.0), doc="normal of the plane, of any length")

    def check(self, where: str) -> None:
        """Raise `InputError` unless exactly one of both is given."""
        if (self.group is None) == (self.point_mm is None):
            problem = "must be given, or point_mm" if self.group is None else "conflicts with point_mm"
            raise InputError(f"{where}.group", self.group, problem, "give one of them")
        if not any(self.normal):
            raise InputError(f"{where}.normal", list(self.normal), "must not be zero", "give the normal of the plane")


#: Elements beyond which a mesh is taken for a mistake.
MOST_ELEMENTS = 100_000


@dataclass(frozen=True)
class HousingReductionTable:
    """Modes that the reduced model keeps."""

    REMOVED: ClassVar[dict[str, tuple[str, str]]] = {"solver": ("is gone: there is one solver", "leave it out")}

    modes: int | None = quantity(
        None,
        low=0,
        high=2000,
        doc="number of modes with the bores held, whatever modes_below_Hz and least_modes say; left out: by these",
    )
    modes_below_Hz: float = quantity(
        10000.0, above=0.0, doc="highest frequency of the modes kept (Hz), where modes is left out"
    )
    least_modes: int = quantity(
        40, low=0, high=2000, doc="modes kept at least when they are chosen by frequency, where modes is left out"
    )
    quasi_static_levels: int = quantity(1, low=0, high=6, doc="levels of quasi-static corrections; 0 for none")
    band_Hz: float = quantity(5000.0, above=0.0, doc="highest frequency of interest, for the error estimate (Hz)")


@dataclass(frozen=True)
class HousingDampingTable:
    """Damping of the housing; all zero by default."""

    ratio: float | tuple[float, ...] = quantity(0.0, low=0.0, below=1.0, doc="modal damping ratio, one or one a mode")
    rayleigh_alpha_per_s: float = quantity(0.0, low=0.0, doc="Rayleigh damping: factor of the mass (1/s)")
    rayleigh_beta_s: float = quantity(0.0, low=0.0, doc="Rayleigh damping: factor of the stiffness (s)")


@dataclass(frozen=True)
class HousingTable:
    """The whole ``[housing]`` table."""

    wall_x_mm: tuple[float, float] = quantity((-45.0, 180.0), doc="ends of the walls along x (mm)")
    wall_z_mm: tuple[float, float] = quantity((-72.0, 25.0), doc="bottom and top of the walls (mm)")
    inner_gap_mm: float = quantity(50.0, above=0.0, doc="gap between the walls, centred on y = 0 (mm)")
    wall_thickness_mm: tuple[float, float] = quantity((6.0, 4.5), above=0.0, doc="thickness of the +y and -y wall (mm)")
    base_thickness_mm: float = quantity(18.0, above=0.0, doc="thickness of the base plate under the walls (mm)")
    end_wall_thickness_mm: tuple[float, float] = quantity(
        (0.0, 0.0), low=0.0, doc="thickness of the end walls at low and high x, 0 for none (mm)"
    )
    cover_thickness_mm: float = quantity(0.0, low=0.0, doc="thickness of the cover on the walls, 0 for none (mm)")
    shafts: tuple[ShaftAxisTable, ...] = quantity(
        (ShaftAxisTable(x_mm=0.0), ShaftAxisTable(x_mm=62.5), ShaftAxisTable(x_mm=125.0)), doc="[[housing.shafts]]"
    )
    feet: FeetTable = quantity(FeetTable, doc="[housing.feet]")  # noqa: RUF009
    material: HousingMaterialTable = quantity(HousingMaterialTable, doc="[housing.material]")  # noqa: RUF009
    mesh: HousingMeshTable = quantity(HousingMeshTable, doc="[housing.mesh]")  # noqa: RUF009
    reduction: HousingReductionTable = quantity(HousingReductionTable, doc="[housing.reduction]")  # noqa: RUF009
    damping: HousingDampingTable = quantity(HousingDampingTable, doc="[housing.damping]")  # noqa: RUF009
    bores: tuple[MeshBoreTable, ...] = quantity((), doc="[[housing.bores]]: bores of a mesh of the user's own")
    held: tuple[HeldTable, ...] = quantity((), doc="[[housing.held]]: held faces of such a mesh; none: a free body")
    body: str | None = quantity(None, doc="reduced body (housing.npz of gearfe housing) instead of mesh or parameters")

    superelement: SuperelementTable | None = quantity(  # noqa: RUF009
        None, doc="matrices of another program instead of mesh or parameters"
    )

    def check(self, where: str) -> None:
        """Rules that join several dimensions: everything lies where it can be joined to the rest."""
        if self.reduced or self.mesh.file is not None:
            self._check_own(where)
            return
        for key in ("bores", "held"):
            if getattr(self, key):
                cure = 'add mesh = "FILE", or take shafts and feet of the parametric housing'
                raise InputError(f"{where}.{key}", None, "belongs to a mesh of the user's own", cure)
        for name, (low, high) in (("wall_x_mm", self.wall_x_mm), ("wall_z_mm", self.wall_z_mm)):
            if low >= high:
                raise InputError(f"{where}.{name}", [low, high], "must be [low, high] with low < high", "swap them")
        if sum(self.end_wall_thickness_mm) >= self.wall_x_mm[1] - self.wall_x_mm[0]:
            problem = "the end walls fill the whole length between the wall ends"
            raise InputError(
                f"{where}.end_wall_thickness_mm", list(self.end_wall_thickness_mm), problem, "thinner ones"
            )
        self._check_feet(f"{where}.feet")
        for number, shaft in enumerate(self.shafts):
            self._check_shaft(shaft, f"{where}.shafts[{number}]")
        for first, second in itertools.combinations(self.shafts, 2):
            _check_apart(first, second, where)
        self._check_size(f"{where}.mesh")

    def bore_ranges(self, shaft: ShaftAxisTable) -> list[tuple[float, float]]:
        """Range along y (mm) of each bore of a shaft axis, boss included: +y wall, then -y wall."""
        half, (plus, minus) = 0.5 * self.inner_gap_mm, (t + shaft.boss_height_mm for t in self.wall_thickness_mm)
        ranges = {"plus": (half, half + plus), "minus": (-half - minus, -half)}
        return [ends for wall, ends in ranges.items() if shaft.walls in ("both", wall)]

    @property
    def reduced(self) -> bool:
        """Return whether the body comes reduced, without a mesh."""
        return self.body is not None or self.superelement is not None

    def _check_own(self, where: str) -> None:
        """Raise `InputError` for keys that conflict with a mesh file or a reduced body."""
        taken = {"mesh", "bores", "held", "material", "reduction", "damping"}
        source = "mesh"
        if self.reduced:
            source = "superelement" if self.body is None else "body"
            taken = {source, "reduction", "damping"}
            if dataclasses.replace(self.reduction, band_Hz=0.0) != HousingReductionTable(band_Hz=0.0):
                problem = "a reduced body has its modes"
                raise InputError(f"{where}.reduction", None, problem, "leave all but band_Hz out, or reduce the mesh")
        for field in dataclasses.fields(self):
            default = field.default_factory() if callable(field.default_factory) else field.default
            if field.name not in taken and getattr(self, field.name) != default:
                problem = f"conflicts with {source}, which defines it"
                raise InputError(f"{where}.{field.name}", None, problem, "leave one of them out")
        if not self.reduced and not self.bores:
            raise InputError(f"{where}.bores", None, "is required with a mesh", "add [[housing.bores]]")

    def _check_size(self, where: str) -> None:
        """A size that makes more elements than any machine here holds is a slip of the unit."""
        length, height = (b - a for a, b in (self.wall_x_mm, self.wall_z_mm))
        depth, feet = self.inner_gap_mm + sum(self.wall_thickness_mm), self.feet
        height += self.base_thickness_mm + self.cover_thickness_mm
        depth += 2.0 * max((shaft.boss_height_mm for shaft in self.shafts), default=0.0)
        area = length * height + 2.0 * feet.length_x_mm * feet.height_mm
        # triangles with sides of five sizes in the plane at most, layers of seven along y
        least = (area * depth / (0.5 * 25.0 * 7.0 * MOST_ELEMENTS)) ** (1.0 / 3.0)
        least = max(least, (area / (0.5 * 25.0 * MOST_ELEMENTS)) ** 0.5)
        if not self.mesh.size_mm >= least:
            problem = f"makes more than {MOST_ELEMENTS} elements of this housing"
            problem += f": must be >= {least:.3g}" if math.isfinite(least) else ""
            cure = f"choose a larger size (mm); feet ({feet.length_x_mm:g} mm long) and bosses count"
            raise InputError(f"{where}.size_mm", self.mesh.size_mm, problem, cure)

    def _check_feet(self, where: str) -> None:
        feet, depth = self.feet, self.inner_gap_mm + sum(self.wall_thickness_mm)
        if feet.height_mm > self.base_thickness_mm:
            problem = f"the feet reach above the base plate, which is {self.base_thickness_mm:g} mm thick"
            raise InputError(f"{where}.height_mm", feet.height_mm, problem, "lower feet or a thicker base")
        if feet.inset_y_mm >= depth:
            problem = f"the feet lie outside the base, which is {depth:g} mm wide"
            raise InputError(f"{where}.inset_y_mm", feet.inset_y_mm, problem, "choose a smaller inset")
        if 2.0 * (feet.inset_y_mm + feet.width_y_mm) > depth:
            problem = f"two feet side by side (with their insets) are wider than the base, {depth:g} mm: they overlap"
            raise InputError(f"{where}.width_y_mm", feet.width_y_mm, problem, "narrower feet or a smaller inset")

    def _check_shaft(self, shaft: ShaftAxisTable, where: str) -> None:
        (x0, x1), (z0, z1), r = self.wall_x_mm, self.wall_z_mm, shaft.bore_radius_mm
        x0, x1 = x0 + self.end_wall_thickness_mm[0], x1 - self.end_wall_thickness_mm[1]
        place = f"bore of radius {r:g} mm at x = {shaft.x_mm:g}, z = {shaft.z_mm:g}"
        cure = f"its centre must lie within x {x0 + r:g}..{x1 - r:g} and z {z0 + r:g}..{z1 - r:g} mm"
        if not (x0 - r < shaft.x_mm < x1 + r and z0 - r < shaft.z_mm < z1 + r):
            raise InputError(where, None, f"{place} misses every wall", cure)
        if not (x0 + r < shaft.x_mm < x1 - r and z0 + r < shaft.z_mm < z1 - r):
            raise InputError(where, None, f"{place} cuts the edge of the walls or an end wall", cure)


def _check_apart(first: ShaftAxisTable, second: ShaftAxisTable, where: str) -> None:
    distance = ((first.x_mm - second.x_mm) ** 2 + (first.z_mm - second.z_mm) ** 2) ** 0.5
    shared = "both" in (first.walls, second.walls) or first.walls == second.walls
    if shared and distance <= first.bore_radius_mm + second.bore_radius_mm:
        problem = (
            f"the bores at x = {first.x_mm:g} and x = {second.x_mm:g} mm overlap: their axes are {distance:g} mm apart"
        )
        cure = f"keep more than {first.bore_radius_mm + second.bore_radius_mm:g} mm between them"
        raise InputError(f"{where}.shafts", None, problem, cure)
