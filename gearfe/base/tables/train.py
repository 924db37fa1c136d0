"""Table ``[train]``: shafts, gears, meshes, drive and loads of a gear train, and how it is simulated.

All shafts run along y, in the frame of the housing. Lengths in millimetres; speeds and torques count positive about +y.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import ClassVar

from ..config import Removed, quantity, renamed
from ..errors import InputError, unknown_name
from .bearing import MATRIX, BearingTable
from .carrier import TrainCarrierTable
from .driveline import TrainCouplingTable, TrainMachineTable
from .kinds import GONE_METHODS
from .pair import FROM_DISTANCE, HANDS, MaterialTable, StiffnessTable, ToothFormTable
from .timefunction import SpeedFunctionTable, TrainFunctionTable

#: Lengths that count as equal (relative).
SAME_LENGTH = 1e-6
#: What a mesh is made of unless its stiffness is given.
POTENTIAL, VARIABLE, MEAN = MESH_MODELS = ("potential", "variable_stiffness", "mean_stiffness")
#: Former name of a mesh model -> its name.
FORMER_MODELS = {"map": POTENTIAL, "curve": VARIABLE, "linear": MEAN}
#: Former name of a mesh model -> what to write instead.
GONE_MODELS = {former: f'write mesh_model = "{name}"' for former, name in FORMER_MODELS.items()}


def _mesh_model_for(law: object) -> str:
    """Return the line that replaces the removed key ``law`` of a mesh or of the curves."""
    names = " or ".join(f'"{name}"' for name in MESH_MODELS)
    return GONE_MODELS.get(str(law), f"write mesh_model = {names}")


#: Why meshes and curves have no key ``law``.
LAW_REMOVED: Removed = (
    "names the contact law, a key of [stiffness]; what a mesh is made of is its model",
    _mesh_model_for,
)


@dataclass(frozen=True)
class _Named:
    """Name of an entry of a list."""

    name: str = quantity(doc="name of the shaft, used in the names of columns")


@dataclass(frozen=True)
class ShaftSectionTable:
    """Define a section of an elastic shaft: a solid or hollow cylinder, or a cone."""

    length_mm: float = quantity(above=0.0, doc="length (mm); the first section begins at the end of lowest y")
    outer_diameter_mm: float | None = quantity(None, above=0.0, doc="outer diameter (mm)")
    outer_diameter_start_mm: float | None = quantity(
        None, above=0.0, doc="of a cone: outer diameter at its end of lower y (mm), instead"
    )
    outer_diameter_end_mm: float | None = quantity(None, above=0.0, doc="and at its end of higher y (mm)")
    inner_diameter_mm: float | None = quantity(None, low=0.0, doc="bore (mm); left out: 0, a solid section")
    inner_diameter_start_mm: float | None = quantity(
        None, low=0.0, doc="of a conical bore: its diameter at the end of lower y (mm), instead"
    )
    inner_diameter_end_mm: float | None = quantity(None, low=0.0, doc="and at the end of higher y (mm)")
    material: str | MaterialTable | None = quantity(  # noqa: RUF009
        None, doc="its material, as that of the shaft; left out: that of the shaft"
    )

    @property
    def outer_mm(self) -> tuple[float, float]:
        """Outer diameters at both ends (mm)."""
        return self._ends("outer_diameter")

    @property
    def inner_mm(self) -> tuple[float, float]:
        """Inner diameters at both ends (mm)."""
        return self._ends("inner_diameter")

    def _ends(self, name: str) -> tuple[float, float]:
        uniform, start, end = (getattr(self, f"{name}{part}_mm") for part in ("", "_start", "_end"))
        return (start or 0.0, end or 0.0) if uniform is None else (uniform, uniform)

    def check(self, where: str) -> None:
        """One diameter, or one at each end; a bore inside of the section."""
        for name in ("outer_diameter", "inner_diameter"):
            uniform, start, end = (getattr(self, f"{name}{part}_mm") for part in ("", "_start", "_end"))
            if uniform is not None and (start is not None or end is not None):
                key, value = (f"{name}_start_mm", start) if start is not None else (f"{name}_end_mm", end)
                raise InputError(f"{where}.{key}", value, f"conflicts with {name}_mm", "leave one out")
            if (start is None) != (end is None):
                lacking, given = ("start", "end") if start is None else ("end", "start")
                problem = f"is required with {name}_{given}_mm"
                raise InputError(f"{where}.{name}_{lacking}_mm", None, problem, f"add it, or write {name}_mm alone")
        if self.outer_diameter_mm is None and self.outer_diameter_start_mm is None:
            raise InputError(f"{where}.outer_diameter_mm", None, "is required", "add it (outer diameter, mm)")
        for part, inner, outer in zip(("_start", "_end"), self.inner_mm, self.outer_mm, strict=True):
            if inner >= outer:
                key = "inner_diameter_mm" if self.inner_diameter_mm is not None else f"inner_diameter{part}_mm"
                problem = f"must be less than the outer diameter there, {outer:g} mm"
                raise InputError(f"{where}.{key}", inner, problem, "give a smaller bore, or a thicker section")


@dataclass(frozen=True)
class ShaftTable:
    """A round shaft along y: rigid, or elastic where it has sections."""

    x_mm: float = quantity(doc="x of the axis (mm)")
    z_mm: float = quantity(0.0, doc="z of the axis (mm)")
    y_mm: float = quantity(0.0, doc="y of the middle of the shaft (mm)")
    length_mm: float | None = quantity(
        None, above=0.0, doc="length (mm), required without sections; with them the sum of theirs"
    )
    radius_mm: float | None = quantity(
        None, above=0.0, doc="radius (mm), required without sections; with them the largest of theirs"
    )
    density_kg_per_m3: float | None = quantity(
        None, above=0.0, doc="density (kg/m3); left out: that of the material, or of steel, 7850"
    )
    initial_speed_rad_per_s: float | None = quantity(
        None, doc="spin at the start (rad/s); left out: rolling with the drive"
    )
    mass_kg: float | None = quantity(None, above=0.0, doc="mass with gears (kg); left out: from the geometry")
    polar_inertia_kg_m2: float | None = quantity(
        None, above=0.0, doc="inertia about the axis with gears; left out: computed"
    )
    transverse_inertia_kg_m2: float | None = quantity(
        None, above=0.0, doc="inertia about a transverse line through the mass centre, with gears; left out: computed"
    )
    material: str | MaterialTable | None = quantity(  # noqa: RUF009
        None, doc="name of a material of [materials.NAME], or a table of its constants; left out: steel"
    )
    sections: tuple[ShaftSectionTable, ...] = quantity(
        (), doc="pieces of an elastic shaft, one after the other along +y; left out: the shaft is rigid"
    )
    highest_frequency_Hz: float | None = quantity(
        None, above=0.0, doc="of an elastic shaft: its own modes are kept up to here (Hz); left out: 10000"
    )
    elements: int | None = quantity(
        None, low=1, high=500, doc="of an elastic shaft: beam elements; left out: as that frequency needs"
    )
    damping_ratio: float = quantity(
        0.0,
        low=0.0,
        below=1.0,
        doc="of an elastic shaft: damping ratio of its modes, in addition to [train.damping]",
    )

    carrier: str | None = quantity(
        None, doc="name of the carrier (of [carriers.NAME]) of which it is a planet; left out: bearings carry it"
    )
    speed_ratio: float | str | None = quantity(
        None,
        doc='speed over that of the drive, which prescribes the rotation: a number or a fraction as "-1/3"; 0: '
        "fixed; left out: it follows from gears and couplings",
    )
    holding_stiffness_Nm_per_rad: float | None = quantity(
        None, above=0.0, doc="of a torsional spring to that rotation (N m/rad); left out: rigid"
    )
    holding_damping_Nm_s_per_rad: float = quantity(0.0, low=0.0, doc="of the parallel damper (N m s/rad)")

    @property
    def guided(self) -> Fraction | None:
        """Prescribed speed over that of the drive."""
        return None if self.speed_ratio is None else Fraction(str(self.speed_ratio))

    @property
    def whole_length_mm(self) -> float:
        """Length (mm), that of the sections where it has some."""
        return self.length_mm or sum(section.length_mm for section in self.sections)

    @property
    def largest_radius_mm(self) -> float:
        """Radius (mm), the largest of the sections where it has some."""
        return self.radius_mm or max(0.5 * max(section.outer_mm) for section in self.sections)

    def check(self, where: str) -> None:
        """Without sections length and radius are required; with them all follows from them."""
        self._check_guided(where)
        if self.material is not None and self.density_kg_per_m3 is not None:
            problem = "conflicts with material, which has a density"
            raise InputError(f"{where}.density_kg_per_m3", self.density_kg_per_m3, problem, "leave one out")
        if not self.sections:
            for key, what in (("length_mm", "length (mm)"), ("radius_mm", "radius (mm)")):
                if getattr(self, key) is None:
                    raise InputError(f"{where}.{key}", None, "is required", f"add it ({what})")
            for key in ("highest_frequency_Hz", "elements", "damping_ratio"):
                if getattr(self, key):
                    problem = "is of an elastic shaft, and this one has no sections: it is rigid"
                    raise InputError(f"{where}.{key}", getattr(self, key), problem, "add sections, or leave it out")
            return
        length = sum(section.length_mm for section in self.sections)
        radius = max(0.5 * max(section.outer_mm) for section in self.sections)
        for key, value, what in (
            ("length_mm", length, "sum of their lengths"),
            ("radius_mm", radius, "largest radius"),
        ):
            given = getattr(self, key)
            if given is not None and abs(given - value) > SAME_LENGTH * value:
                problem = f"contradicts the sections: the {what} is {value:.9g} mm"
                raise InputError(f"{where}.{key}", given, problem, "leave it out, or change a section")
        for key in ("mass_kg", "polar_inertia_kg_m2", "transverse_inertia_kg_m2"):
            if getattr(self, key) is not None:
                problem = "conflicts with sections, from which it follows together with the gears"
                raise InputError(
                    f"{where}.{key}", getattr(self, key), problem, "leave it out, or leave the sections out"
                )

    def _check_guided(self, where: str) -> None:
        """A prescribed rotation is a fraction, of a shaft that is no planet; springs and dampers are of one."""
        try:
            _ = self.guided
        except (ValueError, ZeroDivisionError):
            cure = 'write 0 for a fixed shaft, else a number or a fraction as "-1/3"'
            raise InputError(f"{where}.speed_ratio", self.speed_ratio, "is no number", cure) from None
        for key in ("holding_stiffness_Nm_per_rad", "holding_damping_Nm_s_per_rad"):
            needed = "speed_ratio" if self.speed_ratio is None else "holding_stiffness_Nm_per_rad"
            if getattr(self, key) and (self.speed_ratio is None or self.holding_stiffness_Nm_per_rad is None):
                problem = f"is of a shaft with {needed}"
                raise InputError(f"{where}.{key}", getattr(self, key), problem, f"add {needed}, or leave it out")
        if self.carrier is not None and self.speed_ratio is not None:
            problem = "is of a planet, whose rotation follows from its meshes"
            raise InputError(f"{where}.speed_ratio", self.speed_ratio, problem, "fix the sun, the ring or the carrier")


@dataclass(frozen=True)
class TrainShaftTable(ShaftTable, _Named):
    """A shaft with its name and the attachments (bores) that carry it."""

    attachments: tuple[int | str, ...] = quantity(doc='attachments that carry it, as ["1", "2"]')


@dataclass(frozen=True)
class TrainGearTable(ToothFormTable):
    """Define a gear on a shaft: one of [pair], or one with its own teeth. Missing keys come from [pair]."""

    name: str = quantity(doc="name of the gear")
    shaft: str = quantity(doc="shaft that carries it")
    y_mm: float = quantity(doc="y of its middle plane (mm)")
    gear: str = quantity("", choices=("pinion", "wheel", ""), doc="pinion or wheel of [pair]; left out: give teeth")
    teeth: int | None = quantity(None, low=8, doc="number of teeth of an external gear, for a gear of its own")
    helix_hand: str | None = quantity(
        None, doc="hand of its helix; left out: opposite to that of the mate", choices=HANDS
    )
    bore_diameter_mm: float | None = quantity(None, above=0.0, doc="bore (mm); left out: 0.2 times the pitch diameter")
    density_kg_per_m3: float | None = quantity(
        None, above=0.0, doc="density (kg/m3); left out: of [pair.material], or steel"
    )

    def check(self, where: str) -> None:
        """Either a gear of [pair] or one with its own teeth."""
        own = [
            key
            for key in (*ToothFormTable.__dataclass_fields__, "teeth", "helix_hand", "bore_diameter_mm")
            if getattr(self, key) is not None
        ]
        if self.gear and own:
            raise InputError(
                f"{where}.{own[0]}", getattr(self, own[0]), f"conflicts with gear = {self.gear!r}", "leave one out"
            )
        if self.profile_shift == FROM_DISTANCE:
            problem = "is for a gear of [pair] with centre_distance_mm there"
            raise InputError(f"{where}.profile_shift", FROM_DISTANCE, problem, "write the number")
        if not self.gear and self.teeth is None:
            raise InputError(
                f"{where}.teeth", None, "is required", 'give the number of teeth, or gear = "pinion" or "wheel"'
            )


@dataclass(frozen=True)
class TrainMeshTable:
    """Two gears in mesh. What it is made of is computed with [stiffness] unless one of the keys below gives it."""

    driver: str = quantity(doc="name of the driving gear")
    driven: str = quantity(doc="name of the driven gear")
    phase_deg: float | None = quantity(
        None,
        doc="rotation of the driver at the start, in its driving sense, from a tooth on the line of centres (deg; "
        "helical gears: section y = 0); left out: 0, or by the teeth if a gear has two meshes",
    )
    damping_N_s_per_m: float = quantity(0.0, low=0.0, doc="damping along the line of action (N s/m)")
    damping_acts: str | None = quantity(
        None,
        choices=("always", "in_contact"),
        doc="when damper and rayleigh_beta_s of the mesh act: always, or in_contact (with a potential in "
        "proportion to the force); left out: in_contact with a potential, always with a stiffness",
    )
    centre_distance_mm: float | None = quantity(
        None,
        doc="working centre distance (mm), with or without the minus sign of an internal pair; left out: no backlash",
    )
    mesh_model: str | None = quantity(
        None,
        choices=MESH_MODELS,
        gone=GONE_MODELS,
        doc="potential: mesh law with transmission error and separation; variable_stiffness: k(phi) delta; "
        "mean_stiffness: the mean of k over the mesh cycle; left out: that of [train.curves]",
    )
    mesh_model_torque_Nm: float | None = quantity(
        None,
        above=0.0,
        doc="largest torque at the driven gear that the potential is made for; left out: 5 times the steady one",
    )
    mesh_model_tilt_um: float | None = quantity(
        None,
        above=0.0,
        high=500.0,
        doc="largest tilt in the plane of action (um over the common face width) of a potential over the width; "
        "left out: twice the tilt by shafts and bearings under the larger of mesh_model_torque_Nm and the "
        "steady torque",
    )
    backlash_um: float | None = quantity(
        None,
        doc="normal backlash (um); left out: with a potential that of the gears (0: no back flanks), with a "
        "stiffness a spring that acts in both directions",
    )
    friction: float | None = quantity(
        None,
        low=0.0,
        high=0.5,
        doc="coefficient of friction of the teeth, with a potential; left out: none, or by the oil",
    )
    oil_viscosity_mPa_s: float | None = quantity(
        None, above=0.0, doc="viscosity of the oil: mean coefficient of friction by Schlenk (ISO/TR 14179-2), instead"
    )
    roughness_um: float | None = quantity(None, above=0.0, doc="mean Ra of both gears' flanks, for that")
    oil_factor: float | None = quantity(None, above=0.0, doc="X_L for that; left out: 1, mineral oil")
    curve: str | None = quantity(None, doc="CSV file with pinion_angle_deg and k_mesh_N_per_m, next to the job file")
    mesh_table: str | None = quantity(
        None,
        doc="CSV file next to the job file: stiffness and static transmission error over a pitch; columns: "
        "docs/train.md",
    )
    stiffness_N_per_m: float | None = quantity(
        None, above=0.0, doc="constant stiffness (N/m), dF/d approach in the transverse section"
    )
    rigid: bool = quantity(False, doc="true: an ideal rigid mesh, a constraint")

    #: Removed keys, see `gearfe.base.config.build`.
    REMOVED: ClassVar[dict[str, Removed]] = {
        "load_map": (
            "is gone: trains solve the contacts of their meshes themselves",
            'leave it out (mesh_model = "variable_stiffness": the curve at the mesh\'s torque), or give a file of '
            "gearfe stiffness: curve",
        ),
        "law": LAW_REMOVED,
        "law_torque_Nm": ("has another name", lambda torque: f"write mesh_model_torque_Nm = {torque}"),
    }

    def check(self, where: str) -> None:
        """At most one source of the stiffness."""
        given = [
            k for k in ("curve", "mesh_table", "stiffness_N_per_m", "rigid") if getattr(self, k) not in (None, False)
        ]
        if len(given) > 1:
            raise InputError(
                f"{where}.{given[1]}", getattr(self, given[1]), f"conflicts with {given[0]}", "leave one out"
            )
        if given and self.mesh_model is not None and (given[0], self.mesh_model) != ("curve", VARIABLE):
            cure = f"leave mesh_model out, or leave {given[0]} out: a mesh model is computed from contact solutions"
            raise InputError(f"{where}.mesh_model", self.mesh_model, f"contradicts {given[0]}", cure)
        oil = [k for k in ("oil_viscosity_mPa_s", "roughness_um", "oil_factor") if getattr(self, k) is not None]
        if oil and self.friction is not None:
            problem = f"conflicts with friction = {self.friction:g}"
            raise InputError(f"{where}.{oil[0]}", getattr(self, oil[0]), problem, "give the coefficient or the oil")
        for key in ("oil_viscosity_mPa_s", "roughness_um"):
            if oil and getattr(self, key) is None:
                raise InputError(f"{where}.{key}", None, f"is required with {oil[0]}", "add it")
        if (oil or self.friction) and (given or self.mesh_model in (VARIABLE, MEAN)):
            key = oil[0] if oil else "friction"
            problem = "needs a mesh law: a stiffness does not say how tooth pairs share the load"
            cure = 'write mesh_model = "potential", or leave friction out'
            raise InputError(f"{where}.{key}", getattr(self, key), problem, cure)
        for key in ("mesh_model_torque_Nm", "mesh_model_tilt_um"):
            if getattr(self, key) is not None and (given or self.mesh_model in (VARIABLE, MEAN)):
                problem = "says how far a mesh law is known, and this mesh has none"
                cure = 'write mesh_model = "potential", or leave it out'
                raise InputError(f"{where}.{key}", getattr(self, key), problem, cure)
        if self.backlash_um is not None and self.backlash_um < 0.0:
            problem = "must be >= 0 um: less is a wedged mesh, with all flanks loaded without torque"
            raise InputError(
                f"{where}.backlash_um", self.backlash_um, problem, "thin the teeth, or move the shafts apart"
            )
        if self.backlash_um is not None and self.rigid:
            problem = "conflicts with rigid = true: rigid teeth never separate"
            raise InputError(f"{where}.backlash_um", self.backlash_um, problem, "leave one out")
        for key in ("damping_N_s_per_m", "damping_acts"):
            if getattr(self, key) and self.rigid:
                problem = "conflicts with rigid = true: a rigid mesh has no deflection to damp"
                raise InputError(f"{where}.{key}", getattr(self, key), problem, "leave one out")


@dataclass(frozen=True)
class TrainDriveTable:
    """Rotation of a shaft relative to one of its bores, prescribed, or a torque on it."""

    shaft: str = quantity(doc="shaft that is driven")
    attachment: int | str | None = quantity(
        None,
        doc="bore that it turns against and reacts on; left out: the ground",
    )
    y_mm: float | None = quantity(
        None, doc="place on an elastic shaft where it is driven (mm); left out: that of the bore"
    )
    machine: str = quantity("", doc="machine of that shaft which is driven; left out: the shaft itself")
    speed_rad_per_s: float | TrainFunctionTable = quantity(  # noqa: RUF009
        doc="about +y (rad/s), or a function of time; with torque_Nm: the nominal speed"
    )
    torque_Nm: float | TrainFunctionTable | None = quantity(  # noqa: RUF009
        None, doc="torque about +y (N m), or a function of time; left out: the speed is prescribed"
    )
    torque_over_speed: SpeedFunctionTable | None = quantity(  # noqa: RUF009
        None,
        doc="torque about +y over the true speed of shaft or machine (N m over rad/s), with or without torque_Nm",
    )
    torque_slope_Nm_s_per_rad: float = quantity(
        0.0, low=0.0, doc="by how much that torque falls with the speed beyond speed_rad_per_s (N m s/rad)"
    )
    ramp_centre_ms: float = quantity(0.0, doc="middle of the smoothed step from rest to the speed (ms)")
    ramp_width_ms: float | None = quantity(None, above=0.0, doc="duration of that step (ms); left out: constant speed")
    stiffness_Nm_per_rad: float | None = quantity(
        None, above=0.0, doc="of an elastic coupling (N m/rad); left out: rigid"
    )
    damping_Nm_s_per_rad: float = quantity(0.0, low=0.0, doc="of that coupling (N m s/rad)")

    @property
    def by_torque(self) -> bool:
        """Return whether a torque drives and the speed is free."""
        return self.torque_Nm is not None or self.torque_over_speed is not None

    def check(self, where: str) -> None:
        """A ramp is of a number; a torque leaves the speed free; a machine has its own place."""
        _check_place(where, self.machine, self.y_mm)
        _check_ramp(where, "speed_rad_per_s", self.speed_rad_per_s, self.ramp_centre_ms, self.ramp_width_ms)
        if not self.by_torque and self.torque_slope_Nm_s_per_rad:
            problem = "is of a torque, and none is given"
            key = "torque_slope_Nm_s_per_rad"
            raise InputError(
                f"{where}.{key}", self.torque_slope_Nm_s_per_rad, problem, "add torque_Nm, or leave it out"
            )
        for key in ("stiffness_Nm_per_rad", "damping_Nm_s_per_rad"):
            if self.by_torque and getattr(self, key):
                given = "torque_over_speed" if self.torque_Nm is None else "torque_Nm"
                problem = f"conflicts with {given}: nothing prescribes the rotation behind the coupling"
                cure = "use a machine with a spring ([machines.NAME]), or leave one out"
                raise InputError(f"{where}.{key}", getattr(self, key), problem, cure)


@dataclass(frozen=True)
class TrainLoadTable:
    """Torque on a shaft and its reaction on a bore."""

    #: Removed keys, see `gearfe.base.config.build`.
    REMOVED: ClassVar[dict[str, Removed]] = {"orders": renamed("orders_Nm_deg")}

    shaft: str = quantity(doc="shaft that is loaded")
    machine: str = quantity("", doc="machine of that shaft on which the torque acts; left out: the shaft itself")
    attachment: int | str | None = quantity(None, doc="bore on which the torque reacts; left out: outside of the train")
    y_mm: float | None = quantity(
        None, doc="place on an elastic shaft where the torque acts (mm); left out: that of the bore"
    )
    torque_slope_Nm_s_per_rad: float = quantity(
        0.0, low=0.0, doc="by how much the torque falls with the speed beyond the nominal one (N m s/rad)"
    )
    torque_Nm: float | TrainFunctionTable | None = quantity(  # noqa: RUF009
        None, doc="torque about +y on the shaft (N m), or a function of time"
    )
    torque_over_speed: SpeedFunctionTable | None = quantity(  # noqa: RUF009
        None,
        doc="torque about +y over the true speed of shaft or machine (N m over rad/s), with or without torque_Nm",
    )
    orders_Nm_deg: tuple[tuple[float, float, float], ...] = quantity(
        (), doc="additional sines that follow the speed: list of [order, amplitude (N m), phase (deg)]"
    )
    mesh: str = quantity(
        "",
        doc="mesh of the orders, by its name (of [[train.meshes]]: driver-driven): order 1 is its frequency; left out: "
        "turns of the shaft",
    )
    ramp_centre_ms: float = quantity(0.0, doc="middle of the smoothed step from 0 to the torque (ms)")
    ramp_width_ms: float | None = quantity(None, above=0.0, doc="duration of that step (ms); left out: constant torque")

    def check(self, where: str) -> None:
        """A ramp is of a number, a mesh of orders; a machine has its own place."""
        _check_place(where, self.machine, self.y_mm)
        if self.torque_Nm is None and self.torque_over_speed is None:
            raise InputError(f"{where}.torque_Nm", None, "is required", "add it, or torque_over_speed")
        if self.torque_Nm is None and self.ramp_width_ms is not None:
            problem = "is of torque_Nm, and there is none: a torque over speed has no ramp"
            raise InputError(f"{where}.ramp_width_ms", self.ramp_width_ms, problem, "leave it out, or add torque_Nm")
        _check_ramp(where, "torque_Nm", self.torque_Nm, self.ramp_centre_ms, self.ramp_width_ms)
        if self.mesh and not self.orders_Nm_deg:
            problem = "is the mesh of orders, and there are none"
            raise InputError(f"{where}.mesh", self.mesh, problem, "add orders_Nm_deg, or leave it out")


@dataclass(frozen=True)
class TrainForceTable:
    """Define a constant force and moment on a shaft: belt pull, weight of an overhung part, force of a pump."""

    shaft: str = quantity(doc="shaft that is loaded")
    y_mm: float = quantity(doc="place along the axis where force and moment act (mm)")
    force_x_N: float = quantity(0.0, doc="force across the shaft along x (N)")
    force_y_N: float = quantity(0.0, doc="force along the shaft (N)")
    force_z_N: float = quantity(0.0, doc="force across the shaft along z (N)")
    moment_x_Nm: float = quantity(0.0, doc="bending moment about x (N m)")
    moment_z_Nm: float = quantity(0.0, doc="bending moment about z (N m)")
    ramp_centre_ms: float = quantity(0.0, doc="middle of the smoothed step from 0 to the force (ms)")
    ramp_width_ms: float | None = quantity(None, above=0.0, doc="duration of that step (ms); left out: constant force")

    @property
    def values(self) -> tuple[float, float, float, float, float, float]:
        """Force along x, y, z (N) and moment about them (N m)."""
        return self.force_x_N, self.force_y_N, self.force_z_N, self.moment_x_Nm, 0.0, self.moment_z_Nm

    def check(self, where: str) -> None:
        """A force is not zero; the middle of a ramp is that of one with a width."""
        _check_ramp(where, "force_x_N", self.force_x_N, self.ramp_centre_ms, self.ramp_width_ms)
        if not any(self.values):
            problem = "is required: force and moment are zero"
            raise InputError(f"{where}.force_x_N", None, problem, "add force_x_N, force_y_N, force_z_N or a moment")


def _check_place(where: str, machine: str, y_mm: float | None) -> None:
    if machine and y_mm is not None:
        problem = "conflicts with machine, which has its own position"
        raise InputError(f"{where}.y_mm", y_mm, problem, f"give y_mm of the machine {machine!r}, or leave machine out")


def _check_ramp(
    where: str, key: str, value: float | TrainFunctionTable | None, centre: float, width: float | None
) -> None:
    if centre and width is None:
        problem = "is the middle of a ramp, which has no width"
        raise InputError(f"{where}.ramp_centre_ms", centre, problem, "add ramp_width_ms, or leave it out")
    if isinstance(value, TrainFunctionTable) and width is not None:
        problem = f"conflicts with a function of time in {key}"
        raise InputError(f"{where}.ramp_width_ms", width, problem, "write the ramp in steps of the function")


def value_text(value: float | TrainFunctionTable | None, unit: str) -> str:
    """A number with its unit, or that it changes."""
    return f"{value:g} {unit}" if isinstance(value, float | int) else "changing"


@dataclass(frozen=True)
class _Bore:
    """The bore of a bearing."""

    attachment: int | str = quantity(doc="bore")


@dataclass(frozen=True)
class TrainBearingTable(BearingTable, _Bore):
    """Springs between a shaft and a bore instead of a hinge, or a rolling bearing."""

    def check(self, where: str) -> None:
        """Without a stiffness there would be no entry."""
        super().check(where)
        if self.hinge:
            cure = f"give it, or {MATRIX}, or type; without an entry the bearing is rigid"
            raise InputError(f"{where}.stiffness_N_per_m", None, "is required", cure)


@dataclass(frozen=True)
class TrainRigidBoreTable:
    """A bore of a rigid housing, for trains without a table [housing]."""

    attachment: int | str = quantity(doc="name of the bore")
    x_mm: float = quantity(doc="x of its axis (mm)")
    y_mm: float = quantity(doc="y of its reference point (mm)")
    z_mm: float = quantity(0.0, doc="z of its axis (mm)")


@dataclass(frozen=True)
class TrainCurvesTable:
    """Models of computed meshes: mesh laws, or stiffness curves with their computation and interpolation."""

    mesh_model: str = quantity(
        POTENTIAL,
        choices=MESH_MODELS,
        gone=GONE_MODELS,
        doc="of computed meshes",
    )
    load: str | None = quantity(
        None,
        choices=("stiffness", "torque"),
        doc="load of curves: stiffness (load and angles of [stiffness]) or the torque of each mesh; left out: "
        "stiffness, or the torque of the mesh if its load varies along the face width",
    )
    positions: int | None = quantity(
        None, low=8, high=10_000, doc='positions in one mesh cycle, for load = "torque"; left out: 36'
    )
    interpolation: str = quantity(
        "cubic", choices=("cubic", "linear"), doc="between the positions: cubic (monotone) or linear"
    )

    #: Removed keys, see `gearfe.base.config.build`.
    REMOVED: ClassVar[dict[str, Removed]] = {"law": LAW_REMOVED}


@dataclass(frozen=True)
class TrainDampingTable:
    """Damping of the whole coupled system, beside [housing.damping], bearings and meshes."""

    ratio: float | tuple[float, ...] = quantity(0.0, low=0.0, below=1.0, doc="modal damping ratio, one or one a mode")
    rayleigh_alpha_per_s: float = quantity(0.0, low=0.0, doc="Rayleigh damping: factor of the mass (1/s)")
    rayleigh_beta_s: float = quantity(0.0, low=0.0, doc="Rayleigh damping: factor of the stiffness (s)")
    gyroscopic: bool = quantity(True, doc="false: leave the gyroscopic moments out, for comparison")


@dataclass(frozen=True)
class TrainVariantTable:
    """A named alternative to [train.curves] and [train.damping]; keys of its `stiffness` override [stiffness]."""

    curves: TrainCurvesTable = quantity(TrainCurvesTable, doc="[train.variants.NAME.curves]")  # noqa: RUF009
    damping: TrainDampingTable = quantity(TrainDampingTable, doc="[train.variants.NAME.damping]")  # noqa: RUF009
    stiffness: StiffnessTable | None = quantity(None, doc="keys that override those of [stiffness]")  # noqa: RUF009


@dataclass(frozen=True)
class TrainTable:
    """The whole ``[train]`` table."""

    housing: str = quantity("elastic", choices=("elastic", "rigid"), doc="elastic ([housing]) or rigid")
    duration_ms: float = quantity(7.0, above=0.0, doc="end of the simulation (ms)")
    step_us: float = quantity(35.0, above=0.0, doc="step of the output (us); spectra end at half its frequency")
    tolerance: float = quantity(1e-6, low=1e-12, high=0.1, doc="relative tolerance of the integration")
    method: str = quantity(
        "auto",
        choices=("auto", "taylor", "implicit"),
        gone=GONE_METHODS,
        doc="integrator (auto: taylor or implicit by a rule)",
    )
    shafts: tuple[TrainShaftTable, ...] = quantity((), doc="[[train.shafts]]; or [shafts.NAME]")
    gears: tuple[TrainGearTable, ...] = quantity((), doc="[[train.gears]]; or [gears.NAME]")
    meshes: tuple[TrainMeshTable, ...] = quantity((), doc="[[train.meshes]]; or [meshes.NAME]")
    drive: TrainDriveTable | None = quantity(None, doc="[train.drive]")  # noqa: RUF009
    loads: tuple[TrainLoadTable, ...] = quantity((), doc="[[train.loads]]")
    forces: tuple[TrainForceTable, ...] = quantity((), doc="[[train.forces]]")
    bearings: tuple[TrainBearingTable, ...] = quantity((), doc="[[train.bearings]]; or [bearings.NAME]")
    rigid_bores: tuple[TrainRigidBoreTable, ...] = quantity((), doc="[[train.rigid_bores]]")
    machines: tuple[TrainMachineTable, ...] = quantity((), doc="[[train.machines]]; or [machines.NAME]")
    couplings: tuple[TrainCouplingTable, ...] = quantity((), doc="[[train.couplings]]; or [couplings.NAME]")
    carriers: tuple[TrainCarrierTable, ...] = quantity((), doc="[[train.carriers]]; or [carriers.NAME]")
    curves: TrainCurvesTable = quantity(TrainCurvesTable, doc="[train.curves]")  # noqa: RUF009
    damping: TrainDampingTable = quantity(TrainDampingTable, doc="[train.damping]")  # noqa: RUF009
    variant: str = quantity("", doc="variant that is simulated if none is requested; left out: none")
    variants: dict[str, TrainVariantTable] = quantity(dict, doc="[train.variants.NAME]")  # noqa: RUF009

    def check(self, where: str) -> None:
        """Rules that join several keys."""
        if self.step_us * 1e-3 > self.duration_ms * (1 + 1e-12):
            problem = f"is longer than duration_ms = {self.duration_ms:g}"
            raise InputError(f"{where}.step_us", self.step_us, problem, "use a smaller step")
        if self.duration_ms > 5e6 * (self.step_us * 1e-3):  # no division: the step may round to zero
            raise InputError(f"{where}.step_us", self.step_us, "makes more than 5 million outputs", "use a larger step")
        if self.variant:
            self.chosen(self.variant)
        if self.shafts or self.gears or self.meshes:
            self._check_names(where)
            self.check_driveline(f"{where}.machines[{{number}}]", f"{where}.couplings[{{number}}]")

    def check_driveline(self, machine_where: str, coupling_where: str) -> None:
        """Raise `InputError` for shafts and machines that do not exist, and names that are used twice.

        `machine_where` and `coupling_where` are patterns of the names of their tables in messages.
        """
        shafts = [shaft.name for shaft in self.shafts]
        machines = [(row.name, machine_where, "shaft", (row.shaft,)) for row in self.machines]
        couplings = [(row.name, coupling_where, "shafts", row.shafts) for row in self.couplings]
        for rows in (machines, couplings):
            for number, (name, pattern, key, used) in enumerate(rows):
                place = pattern.format(number=number, name=name)
                if name in [row[0] for row in rows[:number]]:
                    raise InputError(f"{place}.name", name, "is used twice", "give each its own name")
                for shaft in used:
                    if shaft not in shafts:
                        raise unknown_name(f"{place}.{key}", shaft, shafts)
        ends: list[tuple[str, TrainDriveTable | TrainLoadTable]] = []
        ends += [] if self.drive is None else [("train.drive", self.drive)]
        ends += [(f"train.loads[{number}]", load) for number, load in enumerate(self.loads)]
        for place, end in ends:
            names = [machine.name for machine in self.machines if machine.shaft == end.shaft]
            if end.machine and end.machine not in names:
                raise unknown_name(f"{place}.machine", end.machine, names)

    def model_of(self, mesh: TrainMeshTable) -> str:
        """Return the mesh model of a mesh, an empty text for one whose stiffness is given."""
        if mesh.curve or mesh.mesh_table or mesh.stiffness_N_per_m or mesh.rigid:
            return ""
        return mesh.mesh_model or self.curves.mesh_model

    def check_models(self, wheres: Sequence[str]) -> None:
        """Raise `InputError` for keys of stiffness curves where all meshes have mesh laws, and friction without one.

        `wheres` are the names of the meshes' tables in messages.
        """
        computed = {self.model_of(mesh) for mesh in self.meshes} - {""}
        for key in ("load", "positions"):
            value = getattr(self.curves, key)
            if value is not None and computed == {POTENTIAL}:
                cure = 'leave it out, or write mesh_model = "variable_stiffness" beside it for k(phi) delta'
                problem = (
                    'is of stiffness curves, but the meshes have mesh laws (mesh_model = "potential", the default)'
                )
                raise InputError(f"train.curves.{key}", value, problem, cure)
        for where, mesh in zip(wheres, self.meshes, strict=True):
            if (mesh.friction or mesh.roughness_um) and self.model_of(mesh) != POTENTIAL:
                problem = f"needs a mesh law, but mesh_model = {self.curves.mesh_model!r} in train.curves"
                cure = 'write mesh_model = "potential" in the mesh'
                raise InputError(f"{where}.friction", mesh.friction, problem, cure)

    def _check_names(self, where: str) -> None:
        """Names of shafts and gears are unique, and references to them exist."""
        names: dict[str, list[str]] = {}
        for kind, rows in (("shafts", self.shafts), ("gears", self.gears)):
            known = names[kind] = [row.name for row in rows]
            for i, name in enumerate(known):
                if name in known[:i]:
                    raise InputError(f"{where}.{kind}[{i}].name", name, "is used twice", "give each its own name")
        used = [(f"gears[{i}].shaft", gear.shaft, "shafts") for i, gear in enumerate(self.gears)]
        for i, mesh in enumerate(self.meshes):
            used += [(f"meshes[{i}].{key}", getattr(mesh, key), "gears") for key in ("driver", "driven")]
        used += [] if self.drive is None else [("drive.shaft", self.drive.shaft, "shafts")]
        used += [(f"loads[{i}].shaft", load.shaft, "shafts") for i, load in enumerate(self.loads)]
        for key, name, kind in used:
            if name not in names[kind]:
                raise unknown_name(f"{where}.{key}", name, names[kind])

    def chosen(self, name: str) -> TrainTable:
        """The table with the curves and damping of a variant; an empty name leaves it as it stands."""
        if not name:
            return self
        if name not in self.variants:
            raise unknown_name("variant", name, self.variants)
        return replace(self, curves=self.variants[name].curves, damping=self.variants[name].damping, variant=name)
