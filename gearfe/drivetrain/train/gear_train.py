"""What a gear train is made of: plain descriptions in SI units, checked by `gearfe.drivetrain.train.checks`.

All shafts are parallel to one unit vector `axis`; angles, speeds and torques count positive about it (right-hand rule).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ...base.errors import InputError
from ...base.shown import Facts
from ...base.typing import Array
from ...fem.reduction.modal_body import ModalBody
from ...gears.gearmesh.curve import StiffnessCurve
from ...gears.gearmesh.law import MeshLaw
from ...gears.gearmesh.mesh_table import Tilting
from ...gears.gearmesh.periodic import PeriodicInterpolant
from ...gears.gearmesh.width_law import WidthLaw
from ...gears.geometry.mesh_geometry import ContactModel
from ...gears.geometry.pair import Gear, MeshGeometry
from ...multibody.series.timefunctions import TimeFunction, constant
from ..bearings import BallBearing, RollerBearing
from .friction import Lubrication
from .kinematics import Kinematics, kinematics
from .layout import LayoutCarrier, LayoutGear, LayoutMesh, PitchErrors, TrainLayout

if TYPE_CHECKING:
    from ...fem.beams import Section

Vector = tuple[float, float, float]
Five = tuple[float, float, float, float, float]
Matrix = tuple[Five, Five, Five, Five, Five]
#: Frequency (Hz) up to which own modes of elastic shafts are kept unless it is given.
HIGHEST_HZ = 10e3
#: When the damper of a mesh acts.
ALWAYS, IN_CONTACT = "always", "in_contact"


#: Overlap of two parts of a shaft that is rounding, over its length: a gear may end at a shoulder.
ROUNDING = 1e-9


@dataclass(frozen=True)
class Shaft:
    """A round shaft, rigid or elastic; its gears become part of it.

    Parameters
    ----------
    name
        How other parts call it.
    point
        Middle of the shaft at the start (m).
    length, radius
        Of the cylinder (m); of a shaft with sections the sum of their lengths and the largest radius.
    bores
        Names of the attachments (bores) that carry it; two hinges are usual. A planet has none, for a pin carries it.
        A sun, ring or carrier without any floats: its middle is held along the axis and against tilts, as by the teeth
        of a coupling, and moves freely across the axis.
    density
        kg/m3.
    initial_speed
        Spin at the start (rad/s); None: rolling with the drive.
    mass, polar_inertia, transverse_inertia
        Of shaft and gears together (kg, kg m2 about the mass centre), where they are known better than from the
        geometry; of a rigid shaft.
    sections
        `gearfe.fem.beams.Section` of an elastic shaft, one after the other along the axis; empty: rigid. They have the
        densities.
    highest_hz
        Own modes of an elastic shaft are kept up to this frequency (Hz).
    elements
        Number of beam elements; None: as many as that frequency needs.
    damping_ratio
        Of the own modes of an elastic shaft.
    """

    name: str
    point: Vector
    length: float
    radius: float
    bores: tuple[str, ...]
    density: float = 7850.0
    initial_speed: float | None = None
    mass: float | None = None
    polar_inertia: float | None = None
    transverse_inertia: float | None = None
    sections: tuple[Section, ...] = ()
    highest_hz: float = HIGHEST_HZ
    elements: int | None = None
    damping_ratio: float = 0.0

    @property
    def outline(self) -> tuple[tuple[float, float, float, float], ...]:
        """Its pieces: ends along the axis from its middle, and the outer radii there (m)."""
        if not self.sections:
            return ((-0.5 * self.length, 0.5 * self.length, self.radius, self.radius),)
        ends = list(itertools.accumulate((s.length for s in self.sections), initial=-0.5 * self.length))
        return tuple(
            (low, high, 0.5 * s.outer_start, 0.5 * s.outer_end)
            for low, high, s in zip(ends[:-1], ends[1:], self.sections, strict=True)
        )

    def radius_within(self, low: float, high: float) -> float:
        """Largest outer radius (m) between two places along the axis, from its middle; 0 where they lie beside it."""
        most, touching = 0.0, ROUNDING * self.length
        for start, end, first, last in self.outline:
            inside = np.clip([low, high], start, end)
            if inside[1] - inside[0] > touching or (low == high and start <= low <= end):
                most = max(most, *(first + (last - first) * (inside - start) / (end - start)))
        return float(most)


@dataclass(frozen=True)
class ShaftGear:
    """A gear fixed on a shaft.

    Parameters
    ----------
    along
        Coordinate of its middle plane along the train's axis (m).
    gear
        Teeth and sizes.
    density
        kg/m3.
    pitch_errors : (left, right), each a tuple of z numbers, or empty
        How much earlier the flanks of each tooth touch along the line of action (m): index deviations times the cosine
        of the pressure angle. A displaced tooth has opposite values on its two sides. Teeth count about the axis of the
        train, from the one that stands at the gear's angle in `train.kinematics.Kinematics`. Left flanks drive where
        the driver turns about the axis. For meshes with a law.
    """

    name: str
    shaft: str
    along: float
    gear: Gear
    density: float = 7850.0
    pitch_errors: PitchErrors = ((), ())


@dataclass(frozen=True)
class GearMesh:
    """Two gears in mesh.

    Parameters
    ----------
    driver, driven
        Names of gears. Of an internal gear that drives, a train makes `driven`, with `ring_drives`.
    stiffness
        A mesh law (also one over the face width), a curve over the driver's rotation (of an internal pair that of the
        external gear, whichever drives), its interpolant (N/m over rad), a constant (N/m; along the line of action, of
        helical gears in the transverse section), the model from which `gearfe.compute_meshes` computes the law
        (materials of driver and driven gear, element sizes), or None for the ideal rigid mesh: a constraint whose
        multiplier is the contact force.
    phase
        Angle of the gear that drives (rad), counted in its driving sense, at which it starts; 0: one of its teeth is on
        the line of centres. None: from the teeth of the connected gears, the first of whose meshes has 0; see
        `gearfe.drivetrain.train.phases`.
    damping
        N s/m along the line of action; with a law that damps in contact only, at the force of steady running.
    damping_acts
        ``always``, or ``in_contact``: only while teeth are in contact. None: in contact with a law, else always. The
        part of `Damping.beta` acts alike.
    interpolation
        ``cubic`` (monotone) or ``linear``, for a curve.
    centre_distance
        Working centre distance of the gears (m); None: the one without backlash.
    backlash
        Backlash (m) along the line of action, of helical gears in the transverse section. None: with a law that of the
        gears, or no back flanks where they have none; with a curve or a constant a spring that acts both ways.
    friction
        Coefficient of friction, or what it follows from; for meshes with a law. See `gearfe.drivetrain.train.friction`.
    name
        Name in results; empty: ``driver-driven``.
    transmission_error
        Unloaded static transmission error e over the driver's rotation (m over rad), of one pitch. It is the approach
        at which the flanks touch, positive where the driven gear stays behind. For meshes with a curve or a constant.
    tilting
        How the driving flanks act along the face width; beside a transmission error on the same phases. None: in the
        middle of the common width, without a stiffness against tilting.
    moments
        Whether the tilting moments of the mesh force act on the shafts where the mesh has no `tilting`. Elastic shafts
        need them for their bending.
    ring_drives
        Whether the internal gear, `driven`, drives.
    """

    driver: str
    driven: str
    stiffness: MeshLaw | WidthLaw | StiffnessCurve | PeriodicInterpolant | ContactModel | float | None
    phase: float | None = None
    damping: float = 0.0
    interpolation: str = "cubic"
    centre_distance: float | None = None
    backlash: float | None = None
    friction: float | Lubrication = 0.0
    damping_acts: str | None = None
    name: str = ""
    transmission_error: PeriodicInterpolant | None = None
    tilting: Tilting | None = None
    moments: bool = False
    ring_drives: bool = False

    def __post_init__(self) -> None:
        if not self.name:
            object.__setattr__(self, "name", f"{self.driver}-{self.driven}")

    @property
    def back_error(self) -> PeriodicInterpolant | None:
        """Transmission error of the back flanks over their own phase, which runs backwards.

        Given data are of a tooth position, whose error has the other sign on back flanks. Data of flanks along the face
        width are those of the mirrored position.
        """
        error = self.transmission_error
        return error if error is None or self.tilting is not None else error.reversed()

    @property
    def damps_in_contact(self) -> bool:
        """Whether its damper acts only while teeth are in contact."""
        if self.damping_acts is None:
            return self.has_law
        return self.damping_acts == IN_CONTACT

    @property
    def has_law(self) -> bool:
        """Whether it has a mesh law, of loads that are alike along the face width or not."""
        return isinstance(self.stiffness, MeshLaw | WidthLaw)

    @property
    def acts_along_width(self) -> bool:
        """Whether tilts of its gears change its forces, and moments act on them."""
        return self.tilting is not None or isinstance(self.stiffness, WidthLaw)

    def interpolant(self) -> PeriodicInterpolant:
        """Stiffness over the driver's rotation, of a mesh without a law; a constant becomes a flat curve."""
        curve = self.stiffness
        if isinstance(curve, StiffnessCurve):
            try:
                return curve.interpolant("k_mesh", method=self.interpolation)
            except InputError as error:
                raise InputError(f"mesh {self.name!r} stiffness", error.value, error.problem, error.cure) from None
        if isinstance(curve, float | int):
            flat = np.array([[float(curve), 0.0, 0.0, 0.0]])
            return PeriodicInterpolant(2 * math.pi, np.array([0.0, 2 * math.pi]), flat)
        if not isinstance(curve, PeriodicInterpolant):
            raise InputError(f"mesh {self.name!r} stiffness", None, "is no curve", "ask its law, or give it a curve")
        return curve


@dataclass(frozen=True)
class Bearing:
    """Springs and dampers between a shaft and a bore instead of a hinge, or a rolling bearing.

    Directions are the first transverse direction e1, the axis, the second transverse direction e2 (N/m, N s/m), and
    tilts about e1 and e2 (N m/rad, N m s/rad). For shafts along y these are x, y, -z and tilts about x and -z.

    Parameters
    ----------
    bore
        Name of the attachment.
    stiffness : five numbers, five rows of five, or BallBearing or RollerBearing
        Diagonal, symmetric matrix, or a rolling bearing, whose stiffness is that at the operating point of the train.
    damping : five numbers, or five rows of five
        Diagonal, or symmetric matrix.
    """

    bore: str
    stiffness: Five | Matrix | BallBearing | RollerBearing
    damping: Five | Matrix = (0.0, 0.0, 0.0, 0.0, 0.0)

    @property
    def stiffness_matrix(self) -> Array:
        """Stiffness of a bearing whose operating point is known, shape (5, 5)."""
        if isinstance(self.stiffness, BallBearing | RollerBearing):
            raise InputError(
                f"bearing at {self.bore!r}", None, "has no stiffness before its load is known", "build_train"
            )
        return _matrix(self.stiffness)

    @property
    def damping_matrix(self) -> Array:
        """Damping, shape (5, 5)."""
        return _matrix(self.damping)


def as_matrix(values: Array) -> Matrix:
    """Return a (5, 5) array as rows of a `Bearing`."""
    a, b, c, d, e = (_five(row) for row in values)
    return a, b, c, d, e


def _five(values: Array) -> Five:
    """Return five numbers of an array."""
    a, b, c, d, e = map(float, values)
    return a, b, c, d, e


def _matrix(values: Five | Matrix) -> Array:
    """A matrix, or that of a diagonal."""
    given = np.array(values, dtype=float)
    return np.diag(given) if given.ndim == 1 else given


@dataclass(frozen=True)
class Machine:
    """A motor or a driven machine: an inertia on a torsional spring at a shaft.

    Parameters
    ----------
    name, shaft
        Its name, and the shaft that it is coupled to.
    inertia
        About the axis (kg m2).
    stiffness, damping
        Of the spring between machine and shaft (N m/rad, N m s/rad).
    initial_speed
        At the start (rad/s); None: rolling with the drive.
    along
        Coordinate along the train's axis (m) of the section of an elastic shaft that it turns; None: the middle.
    """

    name: str
    shaft: str
    inertia: float
    stiffness: float
    damping: float = 0.0
    initial_speed: float | None = None
    along: float | None = None


@dataclass(frozen=True)
class Coupling:
    """A torsional spring between two shafts on one axis, which rotate together.

    Parameters
    ----------
    name, shafts
        Its name, and the names of the shafts.
    stiffness, damping
        N m/rad, N m s/rad.
    """

    name: str
    shafts: tuple[str, str]
    stiffness: float
    damping: float = 0.0


@dataclass(frozen=True)
class SpeedCurve:
    """Torque over speed, of a motor or a load.

    Parameters
    ----------
    function
        Torque (N m) by pieces of polynomials, without sines, of the speed (rad/s) where a `TimeFunction` has the time.
    reference
        Speed (rad/s) whose torque counts as the steady one; `torque` beside the curve holds it already.
    """

    function: TimeFunction
    reference: float

    @property
    def steady(self) -> float:
        """Torque at the reference (N m)."""
        return float(self.function(self.reference))

    @property
    def change(self) -> TimeFunction:
        """Torque over speed, less the steady one."""
        return self.function + constant(-self.steady)

    @property
    def slope(self) -> float:
        """Decrease of the torque per speed at the reference (N m s/rad)."""
        return -float(self.function(self.reference, 1))


@dataclass(frozen=True)
class Drive:
    """Rotation of a shaft relative to one of its bores as a function of time, or a torque on it.

    Parameters
    ----------
    shaft, bore
        Names; `bore` None: against the ground.
    speed
        Relative speed (rad/s); the rotation is its integral from time 0. With a torque the nominal speed, about which
        the train moves freely.
    stiffness, damping
        Of an elastic coupling between the prescribed rotation and the shaft (N m/rad, N m s/rad); None: rigid.
    along
        Coordinate along the train's axis (m) of the section of the shaft that it drives; None: that of the bore.
    machine
        Name of the machine of the shaft that is driven; empty: the shaft itself.
    torque
        Over time (N m), instead of a prescribed rotation.
    slope
        Decrease of the torque per speed above the nominal speed (N m s/rad).
    over_speed
        Further torque over the true speed; `torque` holds its steady part.
    """

    shaft: str
    bore: str | None
    speed: TimeFunction
    stiffness: float | None = None
    damping: float = 0.0
    along: float | None = None
    machine: str = ""
    torque: TimeFunction | None = None
    slope: float = 0.0
    over_speed: SpeedCurve | None = None


@dataclass(frozen=True)
class Load:
    """Torque on a shaft (N m), and its reaction on a bore; `bore` None: it reacts outside of the train.

    Parameters
    ----------
    shaft, bore
        Names.
    torque
        Over time.
    orders
        Sines ``amplitude sin(order angle + phase)`` beside it: order, amplitude (N m), phase (rad).
    mesh
        Mesh of the orders. Its angle grows by 2 pi a pitch from where a driver's tooth stands on the line of centres.
        Empty: the angle is the rotation of the shaft.
    along
        Coordinate along the train's axis (m) of the section of the shaft on which it acts; None: that of the bore.
    machine
        Name of the machine of the shaft on which the torque acts; empty: the shaft itself.
    slope
        Decrease of the torque per speed above the kinematic speed, that of rolling with the drive (N m s/rad).
    over_speed
        Further torque over the true speed; `torque` holds its steady part.
    """

    shaft: str
    bore: str | None
    torque: TimeFunction
    orders: tuple[tuple[float, float, float], ...] = ()
    mesh: str = ""
    along: float | None = None
    machine: str = ""
    slope: float = 0.0
    over_speed: SpeedCurve | None = None


@dataclass(frozen=True)
class ShaftForce:
    """Force and moment on a shaft, whose directions do not turn with it.

    Parameters
    ----------
    shaft
        Name.
    along
        Coordinate along the train's axis (m) of the section of the shaft on which they act.
    values
        Force along x, y, z (N) and moment about them (N m); that about the axis is 0, for torques are `Load`.
    over
        Factor over time.
    """

    shaft: str
    along: float
    values: tuple[float, float, float, float, float, float]
    over: TimeFunction


@dataclass(frozen=True)
class Damping:
    """Damping of the whole coupled system, beside that of housing, bearings and meshes.

    Parameters
    ----------
    ratio
        Modal damping ratio of the modes of the coupled system (mean mesh stiffnesses). It is one number, or one for
        each mode from the lowest up; the last one holds for all above.
    alpha, beta
        Rayleigh damping ``alpha M + beta K`` (1/s, s) of all bodies, bearings and meshes, for motion beside the
        rolling.
    gyroscopic
        Whether the shafts' gyroscopic moments act (they do no work; off for comparison only).
    """

    ratio: float | tuple[float, ...] = 0.0
    alpha: float = 0.0
    beta: float = 0.0
    gyroscopic: bool = True


@dataclass(frozen=True)
class Pin:
    """A planet on its carrier: springs between its shaft and the carrier, or a hinge.

    Parameters
    ----------
    shaft
        Name of the planet's shaft.
    stiffness
        Radial and tangential (N/m, one number; the other motions are held), or five: radial, along the axis, tangential
        (N/m), and two tilts (N m/rad). None: a hinge.
    damping
        Of these springs (N s/m, N m s/rad): radial and tangential, or five.
    error
        Radial and tangential error of the pin's place on the carrier (m).
    """

    shaft: str
    stiffness: float | Five | None = None
    damping: float | Five = 0.0
    error: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class Carrier:
    """A shaft that carries planets round its axis.

    Parameters
    ----------
    name, shaft
        Its name, and that of its shaft.
    pins
        One for each planet. Planets with equal gears that mesh with the same central gears are one set, numbered in the
        order of their pins. Planets that mesh with each other do so by equal numbers.
    """

    name: str
    shaft: str
    pins: tuple[Pin, ...]


@dataclass(frozen=True)
class Guide:
    """A shaft whose rotation is prescribed beside that of the drive.

    Parameters
    ----------
    shaft
        Its name.
    ratio
        Its speed over that of the drive; 0: it is fixed.
    stiffness, damping
        Of a torsional spring between the prescribed rotation and the shaft (N m/rad, N m s/rad); None: rigid.
    """

    shaft: str
    ratio: Fraction = Fraction(0)
    stiffness: float | None = None
    damping: float = 0.0


@dataclass(frozen=True, eq=False, repr=False)
class GearTrain(Facts):
    """A whole gear train.

    Parameters
    ----------
    shafts, gears, meshes, drive, loads
        The train.
    housing
        Reduced elastic housing, whose attachments are the bores; None: a rigid one with the bores `rigid_bores`.
    rigid_bores
        Name -> point on the bore's axis (m), for a rigid housing.
    bearings
        For bores whose shaft is not held by a hinge.
    damping
        Of the coupled system.
    axis
        Direction of all shafts.
    machines, couplings
        Inertias at the shafts, and torsional springs between shafts on one axis.
    carriers, guides
        Carriers of planetary stages, and shafts that are fixed or guided.
    forces
        Forces and moments on the shafts from outside, other than torques.
    """

    shafts: tuple[Shaft, ...]
    gears: tuple[ShaftGear, ...]
    meshes: tuple[GearMesh, ...]
    drive: Drive | None
    loads: tuple[Load, ...] = ()
    housing: ModalBody | None = None
    rigid_bores: dict[str, Vector] = field(default_factory=dict)
    bearings: tuple[Bearing, ...] = ()
    damping: Damping = Damping()
    axis: Vector = (0.0, 1.0, 0.0)
    machines: tuple[Machine, ...] = ()
    couplings: tuple[Coupling, ...] = ()
    carriers: tuple[Carrier, ...] = ()
    guides: tuple[Guide, ...] = ()
    forces: tuple[ShaftForce, ...] = ()

    def __post_init__(self) -> None:
        internal = {gear.name for gear in self.gears if gear.gear.internal}
        meshes = tuple(
            replace(mesh, driver=mesh.driven, driven=mesh.driver, ring_drives=True)
            if mesh.driver in internal and mesh.driven not in internal
            else mesh
            for mesh in self.meshes
        )
        object.__setattr__(self, "meshes", meshes)

    def facts(self) -> dict[str, str]:
        """Shafts, gears, meshes, drive, loads, housing."""
        housing, drive = self.housing, self.drive
        rigid = f"rigid, {len(self.rigid_bores)} bores"
        return {
            "shafts": ", ".join(shaft.name for shaft in self.shafts),
            "gears": ", ".join(f"{one.name} on {one.shaft}" for one in self.gears) or "none",
            "meshes": ", ".join(one.name for one in self.meshes) or "none",
            "drive": "none" if drive is None else f"{drive.shaft}, against {drive.bore or 'the ground'}",
            "loads": ", ".join(one.shaft for one in self.loads) or "none",
            "housing": rigid if housing is None else f"elastic, {len(housing.attachment_names)} bores",
        }

    @property
    def driven(self) -> Drive:
        """The drive, of a train that has one.

        Raises
        ------
        InputError
            For a train without.
        """
        if self.drive is None:
            problem = "nothing holds the train: no shaft is driven, so any torque would spin it up without end"
            raise InputError(
                "train.drive", None, problem, "prescribe the speed of one shaft relative to one of its bores"
            )
        return self.drive

    @property
    def layout(self) -> TrainLayout:
        """What the kinematics follow from, as values."""
        gears = {gear.name: self._layout_gear(gear) for gear in self.gears}
        loads = tuple((self.shaft_number(load.shaft), load.torque) for load in self.loads)
        meshes = tuple(self._layout_mesh(mesh, gears[mesh.driver], gears[mesh.driven]) for mesh in self.meshes)
        names, driven = tuple(shaft.name for shaft in self.shafts), self.shaft_number(self.driven.shaft)
        coupled = tuple(
            (self.shaft_number(one), self.shaft_number(two)) for one, two in (c.shafts for c in self.couplings)
        )
        guided = tuple((self.shaft_number(guide.shaft), guide.ratio) for guide in self.guides)
        return TrainLayout(
            names, driven, self.driven.speed, tuple(gears.values()), meshes, loads, coupled, guided,
            tuple(map(self._layout_carrier, self.carriers)),
        )  # fmt: skip

    def _layout_carrier(self, carrier: Carrier) -> LayoutCarrier:
        sets: dict[tuple[object, ...], list[tuple[int, float]]] = {}
        carried = {pin.shaft for pin in carrier.pins}
        for pin in carrier.pins:
            gears = [gear for gear in self.gears if gear.shaft == pin.shaft]
            names = {gear.name for gear in gears}
            ends = [{mesh.driver, mesh.driven} for mesh in self.meshes]
            mates = {name for both in ends if both & names for name in both - names}
            central = sorted(name for name in mates if self.gear(name).shaft not in carried)
            alike = (*((gear.gear.teeth, gear.along) for gear in gears), *central)
            sets.setdefault(alike, []).append((self.shaft_number(pin.shaft), self.pin_angle(carrier, pin)))
        return LayoutCarrier(carrier.name, self.shaft_number(carrier.shaft), tuple(map(tuple, sets.values())))

    def pin_arm(self, carrier: Carrier, pin: Pin) -> Array:
        """Vector across the axis from that of a carrier to that of a planet at the start, along e1 and e2 (m)."""
        arm = np.array(self.shaft(pin.shaft).point) - np.array(self.shaft(carrier.shaft).point)
        return np.asarray(self.frame[:2] @ arm)

    def pin_angle(self, carrier: Carrier, pin: Pin) -> float:
        """Place of a planet about the axis of its carrier at the start (rad), from the first direction e1."""
        arm = self.pin_arm(carrier, pin)
        return math.atan2(arm[1], arm[0])

    def carrier_of(self, shaft: str) -> Carrier | None:
        """Carrier that carries a shaft as a planet, or None."""
        return next((c for c in self.carriers if any(pin.shaft == shaft for pin in c.pins)), None)

    def mesh_carrier(self, mesh: GearMesh) -> Carrier | None:
        """Carrier of the planet of a mesh; None where both axes are fixed."""
        return self.carrier_of(self.gear(mesh.driver).shaft) or self.carrier_of(self.gear(mesh.driven).shaft)

    def frame_of(self, shaft: str) -> Carrier | None:
        """Carrier in whose frame, which turns with it, the motion of a shaft is described; None: it does not turn.

        It is that of its planets, their carrier, and the gears that these mesh with. A shaft in hinges, which does not
        move across the axis, may turn in several frames: it counts as one that stands still.
        """
        carriers = self.frames_of(shaft)
        return carriers[0] if carriers and not self.between_frames(shaft) else None

    def between_frames(self, shaft: str) -> bool:
        """Whether a shaft has gears in the frames of several carriers, or in one and on fixed axes."""
        gears, carriers = {gear.name for gear in self.gears if gear.shaft == shaft}, self.frames_of(shaft)
        fixed = (self.mesh_carrier(m) is None for m in self.meshes if gears & {m.driver, m.driven})
        return len(carriers) > 1 or (bool(carriers) and any(fixed))

    def hinged(self, shaft: str) -> bool:
        """Whether a hinge holds a shaft."""
        springs = {bearing.bore for bearing in self.bearings}
        return any(bore not in springs for bore in self.shaft(shaft).bores)

    def floats(self, shaft: str) -> bool:
        """Whether a sun, ring or carrier has no bearings: meshes or pins alone hold it across its axis."""
        return not self.shaft(shaft).bores and self.carrier_of(shaft) is None

    def frames_of(self, shaft: str) -> list[Carrier]:
        """Carriers in whose frames loads act on a shaft."""
        own = self.carrier_of(shaft)
        if own is not None:
            return [own]
        gears = {gear.name for gear in self.gears if gear.shaft == shaft}
        meshes = [self.mesh_carrier(mesh) for mesh in self.meshes if gears & {mesh.driver, mesh.driven}]
        return [c for c in self.carriers if c.shaft == shaft or any(mesh is c for mesh in meshes)]

    def _layout_gear(self, item: ShaftGear) -> LayoutGear:
        gear, errors = item.gear, _tuples(item.pitch_errors)
        return LayoutGear(item.name, self.shaft_number(item.shaft), gear.teeth, gear.base_radius, errors)

    def _layout_mesh(self, mesh: GearMesh, driver: LayoutGear, driven: LayoutGear) -> LayoutMesh:
        one, two = self.gear(mesh.driver), self.gear(mesh.driven)
        arm = self.frame[:2] @ (np.array(self.shaft(two.shaft).point) - np.array(self.shaft(one.shaft).point))
        # teeth that jam by rounding have no backlash, and those that jam by more are refused elsewhere
        twist = max(0.0, MeshGeometry(one.gear, two.gear, mesh.centre_distance).contact_twist)
        if driver.teeth * driven.teeth < 0:
            arm = -arm  # the pitch point lies beyond the driver, seen from the axis of the ring
        towards, distance = math.atan2(arm[1], arm[0]), float(np.linalg.norm(arm))
        carrier = self.mesh_carrier(mesh)
        number = None if carrier is None else self.shaft_number(carrier.shaft)
        return LayoutMesh(mesh.name, driver, driven, towards, distance, twist, mesh.phase, number, mesh.ring_drives)

    @cached_property
    def kinematics(self) -> Kinematics:
        """Ratios, senses, phases and steady forces; trains of equal layout share them.

        Raises
        ------
        InputError
            For a train without a drive, and for what `gearfe.drivetrain.train.kinematics.kinematics` refuses.
        """
        return kinematics(self.layout)

    @property
    def bore_points(self) -> dict[str, Array]:
        """Name -> reference point of each bore (m)."""
        if self.housing is None:
            return {name: np.array(point, dtype=float) for name, point in self.rigid_bores.items()}
        return dict(zip(self.housing.attachment_names, self.housing.attachment_points, strict=True))

    @property
    def frame(self) -> Array:
        """Rows e1, e2, a: a right-handed frame, the axis last, e1 nearest to a coordinate direction; shape (3, 3)."""
        a = np.array(self.axis, dtype=float) / np.linalg.norm(self.axis)
        e1 = np.array([1.0, 0.0, 0.0]) if abs(a[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
        e1 = e1 - (e1 @ a) * a
        e1 = e1 / np.linalg.norm(e1)
        return np.array([e1, np.cross(a, e1), a])

    def shaft_ends(self, name: str) -> list[tuple[str, Drive | Load]]:
        """Drive and loads of a shaft, with their names in messages."""
        ends: list[tuple[str, Drive | Load]] = [] if self.drive is None else [("drive", self.drive)]
        ends += [(f"load {number}", load) for number, load in enumerate(self.loads, start=1)]
        return [(label, end) for label, end in ends if end.shaft == name]

    def place(self, end: Drive | Load) -> float:
        """Coordinate along the axis (m) at which a drive or a load acts on its shaft.

        Where it is not given it is that of its bore, without one of the shaft's first bore, of a planet its middle.
        """
        if end.along is not None:
            return end.along
        bores = [end.bore] if end.bore else self.shaft(end.shaft).bores
        if not bores:  # a planet
            return self.shaft_end(end.shaft, 0.0)
        return float(self.bore_points[bores[0]] @ self.frame[2])

    def machine_number(self, name: str) -> int:
        """Number of the machine of that name."""
        return next(i for i, machine in enumerate(self.machines) if machine.name == name)

    def inertia_of_machines(self, shaft: str) -> float:
        """Inertia of all machines of a shaft (kg m2)."""
        return sum(machine.inertia for machine in self.machines if machine.shaft == shaft)

    def shaft_end(self, name: str, towards: float) -> float:
        """Coordinate along the axis (m) of the end of a shaft on one side (+ or -); of its middle for 0."""
        shaft = self.shaft(name)
        return float(np.dot(shaft.point, self.frame[2])) + float(np.sign(towards)) * 0.5 * shaft.length

    def shaft_number(self, name: str) -> int:
        """Number of the shaft of that name."""
        return next(i for i, shaft in enumerate(self.shafts) if shaft.name == name)

    def shaft(self, name: str) -> Shaft:
        """The shaft of that name."""
        return self.shafts[self.shaft_number(name)]

    def gear(self, name: str) -> ShaftGear:
        """The gear of that name."""
        return next(g for g in self.gears if g.name == name)


def _tuples(errors: PitchErrors) -> PitchErrors:
    """Pitch errors as values, whatever sequences they are."""
    left, right = (tuple(float(error) for error in side) for side in errors)
    return left, right


def common_face(one: ShaftGear, two: ShaftGear) -> tuple[float, float]:
    """Coordinates along the axis (m) between which two gears face each other; where they do not, the second is less."""
    low = max(gear.along - 0.5 * gear.gear.face_width for gear in (one, two))
    high = min(gear.along + 0.5 * gear.gear.face_width for gear in (one, two))
    return low, high
