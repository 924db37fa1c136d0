"""Two gears with face widths and helices in mesh: what is elastic about them.

**Sections.** A helical gear is its transverse section, turned by :math:`\\kappa z` along the axis, with
:math:`\\kappa = \\tan\\beta_b / r_b`, the mate with the other sign. At z = 0 the pinion's tooth 0 and a space of the
wheel are on the line of centres at pinion angle 0, as the sections in `gearfe.gears.geometry.mesh_geometry`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

from ...base.errors import InputError
from ...fem.plane import Material
from ..contact.laws import STEEL
from ..geometry.gear_data import Web
from ..geometry.mesh_geometry import MeshGeometry
from ..geometry.spur_gear import Gear
from ..geometry.validity import MOST_YIELD

#: Largest base helix angle (rad). Elastic teeth are checked up to 30 degrees at the reference circle.
MOST_HELIX = math.radians(45.0)
#: Functions of the load along the width: so many, and one more for each so many modules. They keep the peak to peak of
#: the transmission error of helical pairs within 1 % of that with two more (docs/face_width.md).
LEAST_FUNCTIONS, MODULES_PER_FUNCTION = 5, 2.5
#: Most functions along the width: a node of the section has three times as many unknowns.
MOST_FUNCTIONS = 40
#: Mesh stiffness per width in units of E': c' of ISO 6336-1, 14 N/(mm um).
USUAL_STIFFNESS = 0.06
#: Common width (modules) below which two gears do not mesh.
LEAST_OVERLAP = 0.05


@dataclass(frozen=True)
class WideMesh:
    """Two gears in mesh with their face widths, as elastic bodies.

    Parameters
    ----------
    sections
        The gears, of which the transverse sections count: helical ones, or their sections as spur gears. A transverse
        contact ratio below 1 is allowed.
    base_helix_angle
        beta_b (rad) of the pinion, > 0 for a right-handed one; the wheel has the other hand. None: that of the gears.
    widths
        Face widths of pinion and wheel (m); None: those of the gears.
    centres
        Axial positions of their middles (m); None: the pinion at 0, the wheel as far from it as the gears are.
    webs
        Webs of pinion and wheel that are narrower than the faces, offsets along z; None: those of the gears.
    materials
        Of pinion and wheel.
    functions
        Number of functions of the load along the common width; None: `LEAST_FUNCTIONS` and one more for each
        `MODULES_PER_FUNCTION` modules of width. 1: plane strain.
    coarsen, flank_coarsen
        Element sizes of the sections in units of those of `gearfe.gears.teeth.tooth_sector.sector_recipes`.

    Raises
    ------
    InputError
        For values out of range, and gears that have no common width.
    """

    sections: MeshGeometry
    base_helix_angle: float = None  # type: ignore[assignment] # a number from `__post_init__` on
    widths: tuple[float, float] | None = None
    centres: tuple[float, float] = None  # type: ignore[assignment] # as above
    webs: tuple[Web | None, Web | None] = None  # type: ignore[assignment] # as above
    materials: tuple[Material, Material] = (STEEL, STEEL)
    functions: int | None = None
    coarsen: float = 2.0
    flank_coarsen: float = 3.0

    def __post_init__(self) -> None:
        pinion = self.sections.pinion
        if self.sections.wheel.rim == "free":
            problem = "is not held: contact over the width takes internal gears that are bolted at the rim"
            raise InputError("wheel.rim", "free", problem, 'give rim = "bolted"')
        angle = -pinion.base_helix_angle if pinion.hand == "left" else pinion.base_helix_angle
        if self.base_helix_angle is None:
            object.__setattr__(self, "base_helix_angle", angle)
        elif pinion.helical and abs(self.base_helix_angle - angle) > 1e-9:
            problem = f"is not that of the gears, {angle:.6g} rad"
            raise InputError("base_helix_angle", self.base_helix_angle, problem, "leave it out")
        if self.centres is None:
            object.__setattr__(self, "centres", (0.0, self.sections.axial_offset))
        if self.webs is None:
            object.__setattr__(self, "webs", tuple(gear.narrow_web for gear in self.gears))
        if not abs(self.base_helix_angle) <= MOST_HELIX:
            problem = f"must be >= -{MOST_HELIX:.4g} and <= {MOST_HELIX:.4g} rad"
            raise InputError("base_helix_angle", self.base_helix_angle, problem, "use a smaller helix angle")
        for width in self.face_widths:
            if not (math.isfinite(width) and width > 0):
                raise InputError("widths", width, "must be finite and > 0 m", "give the face widths")
        for centre in self.centres:
            if not math.isfinite(centre):
                raise InputError("centres", centre, "must be finite", "give the axial positions in m")
        low, high = self.zone
        if not high - low >= LEAST_OVERLAP * self.module:
            problem = f"leaves a common width of {1e3 * (high - low):.4g} mm, must be >= {LEAST_OVERLAP:g} module"
            raise InputError("centres", self.centres, problem, "move the gears towards each other")
        if self.functions is not None and not 1 <= self.functions <= MOST_FUNCTIONS:
            problem = f"must be >= 1 and <= {MOST_FUNCTIONS}"
            raise InputError("functions", self.functions, problem, "leave it out for the usual number")
        if self.count > MOST_FUNCTIONS:
            most = MODULES_PER_FUNCTION * (MOST_FUNCTIONS - LEAST_FUNCTIONS)
            problem = f"must be <= {most:g} modules, {1e3 * most * self.module:.4g} mm, in common"
            raise InputError("widths", self.face_widths, problem, "use narrower gears, or give the number of functions")

    @property
    def gears(self) -> tuple[Gear, Gear]:
        """Sections of pinion and wheel."""
        return self.sections.pinion, self.sections.wheel

    @property
    def module(self) -> float:
        """Module of the pinion (m): of helical gears that of the normal section."""
        return self.sections.pinion.module

    @cached_property
    def face_widths(self) -> tuple[float, float]:
        """Face widths of pinion and wheel (m)."""
        pinion, wheel = self.gears
        return (pinion.face_width, wheel.face_width) if self.widths is None else self.widths

    @cached_property
    def faces(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """First and last z of pinion and wheel (m)."""
        (one, two), (at, mate) = self.face_widths, self.centres
        return (at - 0.5 * one, at + 0.5 * one), (mate - 0.5 * two, mate + 0.5 * two)

    def web_ends(self, gear: int) -> tuple[float, float] | None:
        """First and last z (m) of the web of a gear that is narrower than its face, or None."""
        web, (low, high) = self.webs[gear], self.faces[gear]
        if web is None:
            return None
        middle = 0.5 * (low + high) + web.offset
        return max(low, middle - 0.5 * web.width), min(high, middle + 0.5 * web.width)

    @cached_property
    def zone(self) -> tuple[float, float]:
        """First and last z (m) of the common width, on which flanks can touch."""
        (low, high), (mate_low, mate_high) = self.faces
        return max(low, mate_low), min(high, mate_high)

    @property
    def width(self) -> float:
        """Common width b (m)."""
        return self.zone[1] - self.zone[0]

    @property
    def turns(self) -> tuple[float, float]:
        """kappa of pinion and wheel (rad/m)."""
        slope = math.tan(self.base_helix_angle)
        return slope / self.gears[0].base_radius, -slope / self.gears[1].signed_base_radius

    @property
    def count(self) -> int:
        """Number of functions of the load along the common width."""
        if self.functions is not None:
            return self.functions
        return math.ceil(LEAST_FUNCTIONS + self.width / (MODULES_PER_FUNCTION * self.module))

    @property
    def overlap_ratio(self) -> float:
        """Overlap ratio eps_beta = b tan(beta_b)/p_bt (-)."""
        return self.width * abs(math.tan(self.base_helix_angle)) / self.sections.base_pitch

    @property
    def ratio(self) -> float:
        """Magnitude of the gear ratio |z2/z1| (-): a twist of the wheel is worth so many of the pinion."""
        return abs(self.sections.gear_ratio)

    @property
    def usual_stiffness(self) -> float:
        """Torque per twist (N m/rad) of a usual pair of teeth over the common width."""
        soft = sum(material.contact_compliance("strain") for material in self.materials)
        modulus = 2 * math.cos(self.base_helix_angle) / soft
        return USUAL_STIFFNESS * modulus * self.width * self.sections.wheel.base_radius**2

    @property
    def most_torque(self) -> float:
        """Torque at the wheel (N m) under which the teeth yield by `MOST_YIELD` modules."""
        return MOST_YIELD * self.module * self.usual_stiffness / self.sections.wheel.base_radius

    def check_torque(self, torque: float, name: str) -> None:
        """Raise `InputError`, with the name of the field, for a torque (N m) that bends the teeth too far."""
        if torque > self.most_torque:
            problem = (
                f"must be <= {self.most_torque:.3g} N m: the teeth would deflect by more than {MOST_YIELD:g} modules"
            )
            raise InputError(name, torque, problem, "linear elasticity does not reach so far; give less")
