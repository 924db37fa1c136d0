# ruff: noqa: RUF009 - `quantity` makes dataclass fields
"""Tables of a mechanism file: bodies, joints, forces, start, outputs, run. See docs/mechanisms.md."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, ClassVar

from ..config import Removed, build, quantity, read_toml
from ..errors import InputError, shown, unknown_name
from .beam import BeamTable, check_on_axis
from .jobs import TABLES
from .joint_coordinates import LinksTable, with_links
from .kinds import FORCES, GONE_METHODS, JOINTS, MOTIONS, UNIT_OF, Kind
from .parameters import with_parameters
from .plate import PlateTable

Pair = tuple[float, float]


def _by_coordinate(key: str, names: tuple[str, ...]) -> Removed:
    """Return the entry of `Removed` for a key whose unit depended on what it is of."""

    def cure(value: Any) -> str:
        *others, last = (f"{name} = {shown(value)}" for name in names)
        return f"write {', '.join(others)} or {last}"

    return f"has other names, one for each unit of {key}", cure


@dataclass(frozen=True)
class BodyTable:
    """[bodies.NAME]"""

    mass_kg: float | None = quantity(
        None, low=0.0, doc="mass in kg, >= 0; 0 where the joints hold the body to others with mass"
    )
    inertia_kg_m2: float | None = quantity(
        None, low=0.0, doc="moment of inertia about the mass centre in kg m2, >= 0, likewise"
    )
    centre_m: Pair = quantity((0.0, 0.0), doc="mass centre in the body's frame, [x, y] in m")
    position_m: Pair = quantity((0.0, 0.0), doc="start position of the frame's origin, [x, y] in m")
    angle_deg: float | None = quantity(None, doc="start angle in degrees (or give angle_rad)")
    angle_rad: float | None = quantity(None, doc="start angle in rad (or give angle_deg)")
    velocity_m_per_s: Pair = quantity((0.0, 0.0), doc="start velocity of the frame's origin, [x, y] in m/s")
    rate_rad_per_s: float = quantity(0.0, doc="start angular velocity in rad/s")
    points_m: dict[str, Pair] = quantity(dict, doc="named points in the body's frame, [x, y] in m")
    flexible: bool | None = quantity(None, doc="false takes a link with beam or plate as rigid (default: flexible)")
    beam: BeamTable | None = quantity(None, doc="beam of a flexible link, instead of mass, inertia and centre")
    plate: PlateTable | None = quantity(None, doc="plane finite elements of a flexible link, likewise")

    @property
    def shape(self) -> str | None:
        """Source of its mass: "beam" or "plate"; None for a rigid body."""
        return "beam" if self.beam is not None else "plate" if self.plate is not None else None

    @property
    def bends(self) -> bool:
        """Return whether it is a flexible link."""
        return self.shape is not None and self.flexible is not False

    @property
    def all_points(self) -> dict[str, Pair]:
        """Named points, the centres of interfaces among them."""
        if self.plate is None:
            return self.points_m
        return {**{name: interface.centre for name, interface in self.plate.interfaces.items()}, **self.points_m}

    def check(self, where: str) -> None:
        """Mass, beam or plate, at most one of the two angles, points of a beam beside its axis."""
        if self.beam is not None and self.plate is not None:
            raise InputError(where, None, "has a beam and a plate", "keep one of them")
        if self.shape is None:
            for key, unit in (("mass_kg", "kg"), ("inertia_kg_m2", "kg m2")):
                if getattr(self, key) is None:
                    raise InputError(f"{where}.{key}", None, "is required", f"give it in {unit}, or a beam or plate")
            if self.flexible:
                cure = f"add a table [{where}.beam] with length_m, section, youngs_modulus_GPa, density_kg_per_m3"
                raise InputError(f"{where}.flexible", True, "needs a beam or a plate", cure)
        else:
            for key in ("mass_kg", "inertia_kg_m2", "centre_m"):
                if getattr(self, key) not in (None, (0.0, 0.0)):
                    problem = f"follows from the {self.shape}'s shape and density"
                    raise InputError(f"{where}.{key}", getattr(self, key), problem, f"remove it, or the {self.shape}")
        if self.beam is not None:
            for name, (x, _) in self.points_m.items():
                check_on_axis(self.beam, x, f"{where}.points_m.{name}")
        if self.plate is not None:
            for name in self.points_m:
                if name in self.plate.interfaces:
                    raise InputError(f"{where}.points_m.{name}", None, "is the name of an interface", "rename it")
        if self.angle_deg is not None and self.angle_rad is not None:
            raise InputError(where, None, "has angle_deg and angle_rad", "keep one of them")


@dataclass(frozen=True)
class GroundTable:
    """[ground]"""

    points_m: dict[str, Pair] = quantity(dict, doc="named points at rest, [x, y] in m")


@dataclass(frozen=True)
class FunctionTable:
    """A function of time: terms that add up."""

    constant: float = quantity(0.0, doc="constant part")
    polynomial: tuple[float, ...] = quantity((), doc="coefficients of powers of (t - origin_s), lowest first")
    origin_s: float = quantity(0.0, doc="origin of the polynomial in s")
    step: float | None = quantity(None, doc="height of a smoothed step 10x^3 - 15x^4 + 6x^5")
    step_centre_s: float = quantity(0.0, doc="time at the middle of the step in s")
    step_width_s: float | None = quantity(None, above=0.0, doc="duration of the step (s)")
    sine: float | None = quantity(None, doc="amplitude of a sine term")
    frequency_hz: float | None = quantity(None, low=0.0, doc="frequency of the sine in Hz")
    phase_deg: float = quantity(0.0, doc="phase of the sine in degrees")
    table: str | None = quantity(None, doc="name of a table in [tables], over the time in s")

    def check(self, where: str) -> None:
        """A step has its width and a sine its frequency; no key of a term that is not there."""
        for term, key, cure in (
            ("step", "step_width_s", "give its duration in s"),
            ("sine", "frequency_hz", "give it in Hz"),
        ):
            if getattr(self, term) is not None and getattr(self, key) is None:
                raise InputError(f"{where}.{key}", None, f"is required with a {term}", cure)
        terms = {"polynomial": ("origin_s",), "step": ("step_centre_s", "step_width_s")}
        for term, keys in {**terms, "sine": ("frequency_hz", "phase_deg")}.items():
            for key in keys:
                if getattr(self, term) in (None, ()) and getattr(self, key) not in (None, 0.0):
                    problem = f"says nothing without {term}"
                    raise InputError(f"{where}.{key}", getattr(self, key), problem, f"add {term}, or remove it")


#: A number, a function of time, or an expression: of the time for motions and lengths, for loads of the state, too.
Function = float | FunctionTable | str


@dataclass(frozen=True)
class ValueTableTable:
    """[tables.NAME]: a function for expressions, from two columns of a CSV file."""

    file: str = quantity(doc="CSV file with a header, next to the mechanism file")
    x: str = quantity(doc="column of the argument, rising")
    y: str = quantity(doc="column of the value")
    interpolation: str = quantity(
        "cubic",
        choices=("cubic", "linear", "periodic"),
        doc="monotone cubics, straight lines, or a periodic spline with steady curvature",
    )


@dataclass(frozen=True)
class JointTable:
    """[joints.NAME]; which keys belong to which type is in `JOINTS`."""

    type: str = quantity(choices=tuple(JOINTS), doc='type of joint; required without at_m, with it "hinge" by default')
    body: str = quantity(doc="body that the joint holds; required without at_m")
    at_m: Pair | None = quantity(
        None, doc="position at the start, [x, y] in m, instead of body, to and points: hinge, slot or prismatic"
    )
    links: tuple[str, ...] = quantity(
        (), doc="with at_m: the links that it joins, or one of which it is a point; lengths and start poses follow"
    )
    to: str = quantity("ground", doc="the other body, or 'ground'")
    point: str | Pair | None = quantity(None, doc="point of the body: a name or [x, y] in m")
    to_point: str | Pair | None = quantity(None, doc="point of the other body: a name or [x, y] in m")
    direction: Pair | None = quantity(None, doc="direction of the line in the other body's frame, [x, y]")
    angle_deg: float | None = quantity(None, doc="angle of body minus 'to' that a prismatic joint keeps, in degrees")
    length_m: Function | None = quantity(
        None,
        above=0.0,
        doc="distance that a distance joint keeps in m, or a function of time (default: at start)",
    )
    ratio: float | None = quantity(
        None, doc="turns of 'to' per turn of the body: -z/z_to of external gears, z/z_to of a ring"
    )
    radius_m: float | None = quantity(
        None, doc="radius of the body's pulley or wheel, or of a rack's pinion 'to', in m"
    )
    to_radius_m: float | None = quantity(None, above=0.0, doc="radius of the pulley of 'to' in m")
    carrier: str | None = quantity(
        None, doc="body on which gears, pulleys, rack and pinion turn or slide (default: by the hinges)"
    )
    crossed: bool = quantity(False, doc="a crossed belt: the pulleys turn in opposite senses")
    coordinate: str | None = quantity(
        None, choices=("angle", "rate", "x", "y"), doc="prescribed coordinate, or the one that follows a cam"
    )
    profile: str | None = quantity(None, doc="table of a cam's lift in m (or rad) over its angle in rad")
    motion_rad: Function | None = quantity(
        None, doc="motion of an angle (rad): a number, a function of time, or an expression of it"
    )
    motion_rad_per_s: Function | None = quantity(None, doc="motion of a rate (rad/s), likewise; motion_rpm in 1/min")
    motion_m: Function | None = quantity(None, doc="motion of x or y (m), likewise")

    #: Removed keys, see `gearfe.base.config.build`.
    REMOVED: ClassVar[dict[str, Removed]] = {"motion": _by_coordinate("motion", MOTIONS)}

    def check(self, where: str) -> None:
        """Only the keys of this type and of its coordinate."""
        _check_keys(self, where, JOINTS[self.type], f"a {self.type} joint")
        if self.type == "prescribed":
            wanted = f"motion_{UNIT_OF[str(self.coordinate)]}"
            _check_units(self, where, dict.fromkeys(MOTIONS, wanted))
            if getattr(self, wanted) is None:
                cure = f"add {wanted}, a number, a function of time, or an expression of it"
                raise InputError(f"{where}.{wanted}", None, f"is required with coordinate = {self.coordinate!r}", cure)
        if self.direction is not None and self.direction == (0.0, 0.0):
            raise InputError(f"{where}.direction", [0.0, 0.0], "must not be zero", "give the direction of the line")
        if self.body == self.to:
            raise InputError(f"{where}.to", self.to, "joins a body to itself", "name another body or 'ground'")


@dataclass(frozen=True)
class ForceTable:
    """[forces.NAME]; which keys belong to which type is in `FORCES`."""

    type: str = quantity(choices=tuple(FORCES), doc="type of force")
    body: str | None = quantity(None, doc="body on which it acts")
    to: str = quantity("ground", doc="the other body, or 'ground', that carries the reaction")
    point: str | Pair | None = quantity(None, doc="point of the body: a name or [x, y] in m")
    to_point: str | Pair | None = quantity(None, doc="point of the other body: a name or [x, y] in m")
    acceleration_m_per_s2: Pair | None = quantity(None, doc="gravity [x, y] in m/s2")
    stiffness_N_per_m: float | None = quantity(None, low=0.0, doc="stiffness (N/m), >= 0 (default: 0)")
    stiffness_Nm_per_rad: float | None = quantity(
        None, low=0.0, doc="stiffness on an angle (N m/rad), >= 0 (default: 0)"
    )
    damping_N_s_per_m: float | None = quantity(None, low=0.0, doc="damping (N s/m), >= 0 (default: 0)")
    damping_Nm_s_per_rad: float | None = quantity(None, low=0.0, doc="damping on an angle (N m s/rad), >= 0")
    free_length_m: float = quantity(0.0, low=0.0, doc="length of the spring without force (m)")
    tension_N: str | None = quantity(None, doc="further tension of a spring in N, by length and length_rate (m, m/s)")
    coordinate: str | None = quantity(None, choices=("angle", "x", "y"), doc="coordinate that the spring acts on")
    reference_m: float | None = quantity(None, doc="x or y at which the spring is free, in m (default: 0)")
    reference_rad: float | None = quantity(None, doc="angle at which the spring is free, in rad (default: 0)")
    rate_rad_per_s: float | None = quantity(
        None, doc="rate of a rotating frame about the ground's origin in rad/s; rate_rpm in 1/min"
    )
    x_N: Function | None = quantity(None, doc="force in x in N: a number, a function of time, or an expression")
    y_N: Function | None = quantity(None, doc="force in y in N: a number, a function of time, or an expression")
    moment_N_m: Function | None = quantity(None, doc="moment in N m: a number, a function of time, or an expression")

    #: Removed keys, see `gearfe.base.config.build`.
    REMOVED: ClassVar[dict[str, Removed]] = {
        "stiffness": _by_coordinate("stiffness", ("stiffness_N_per_m", "stiffness_Nm_per_rad")),
        "damping": _by_coordinate("damping", ("damping_N_s_per_m", "damping_Nm_s_per_rad")),
        "reference": _by_coordinate("reference", ("reference_m", "reference_rad")),
    }

    def check(self, where: str) -> None:
        """Only the keys of this type and of its coordinate."""
        _check_keys(self, where, FORCES[self.type], f"a force of type {self.type}")
        if self.type == "coordinate_spring":
            way = ("N_per_m", "N_s_per_m", "m"), ("Nm_per_rad", "Nm_s_per_rad", "rad")
            of, other = way[::-1] if self.coordinate == "angle" else way
            names = ("stiffness", "damping", "reference")
            pairs = zip(names, other, of, strict=True)
            _check_units(self, where, {f"{name}_{wrong}": f"{name}_{right}" for name, wrong, right in pairs})
        if self.type == "force" and self.x_N is None and self.y_N is None:
            raise InputError(where, None, "has no force", "give x_N or y_N")
        if self.body is not None and self.body == self.to:
            raise InputError(f"{where}.to", self.to, "joins a body to itself", "name another body or 'ground'")


@dataclass(frozen=True)
class StartTable:
    """[start]: expressions that must hold at the start; the rest is made consistent."""

    positions: dict[str, float] = quantity(dict, doc="expression = value in rad or m")
    velocities: dict[str, float] = quantity(dict, doc="expression = value in rad/s or m/s")


@dataclass(frozen=True)
class OutputTable:
    """[[outputs]]: a column of trajectory.csv."""

    name: str = quantity(doc="column name with its unit, such as crank_angle_rad")
    value: str = quantity(doc="arithmetic expression over quantities of the mechanism")
    wrap: float | None = quantity(None, above=0.0, doc='period to wrap to ("2*pi" for an angle)')

    def check(self, where: str) -> None:
        """A name that fits a CSV header."""
        if not self.name or any(ch in self.name for ch in ',"\n '):
            raise InputError(f"{where}.name", self.name, "must be a word without spaces or commas", "rename the column")


@dataclass(frozen=True)
class PathTable:
    """[[paths]]: a point whose path is drawn."""

    body: str = quantity(doc="body of the point")
    point: str | Pair = quantity(doc="name of the point, or [x, y] in the body's frame in m")


@dataclass(frozen=True)
class RunTable:
    """[run]"""

    end_s: float = quantity(above=0.0, doc="end of the run (s)")
    step_s: float = quantity(above=0.0, doc="distance of the output times (s)")
    tolerance: float | None = quantity(
        None,
        low=1e-13,
        high=0.1,
        doc="accuracy relative to 1 rad and the mechanism's size (default: 1e-9, with flexible links 1e-5)",
    )
    method: str = quantity(
        "auto",
        choices=("auto", "taylor", "implicit", "symplectic"),
        gone=GONE_METHODS,
        doc="integrator (auto: taylor or implicit by a rule; symplectic: keeps the energy)",
    )
    analysis: str = quantity(
        "transient",
        choices=("transient", "equilibrium", "modes", "inverse"),
        doc="motion, state of rest, vibrations about it, or forces of a prescribed motion",
    )
    modes: int = quantity(10, low=1, high=1000, doc="number of modes")
    reactions: bool = quantity(False, doc="write reactions.csv")
    sensitivities: tuple[str, ...] = quantity(
        (), doc="keys of the file, such as bodies.rod.mass_kg, by which the slopes of all outputs are written"
    )
    picture_s: float | None = quantity(None, low=0.0, doc="time of the picture in s (default: the end)")
    frames: int = quantity(100, low=2, high=10000, doc="frames of the animation")

    def check(self, where: str) -> None:
        """A sane number of rows."""
        if self.end_s > 5e6 * self.step_s:  # no division: it may overflow
            raise InputError(f"{where}.step_s", self.step_s, "gives more than five million rows", "take a longer step")


@dataclass(frozen=True)
class FigureTable:
    """[figure]: curves over time, with markers from a reference table."""

    curves: tuple[str, ...] = quantity((), doc="names of outputs to draw (default: all)")
    reference: str | None = quantity(
        None, doc="CSV file with a column t or time_s (s) and reference columns, next to the job file"
    )
    reference_columns: dict[str, str] = quantity(dict, doc="output name = column of the reference file")
    every: int = quantity(10, low=1, doc="draw each so manyth reference point")
    colour: str | None = quantity(
        None,
        choices=("displacement", "velocity"),
        doc="colours of the picture: the distance of each point from the start, or its speed, with arrows",
    )
    magnification: float = quantity(1.0, low=0.0, doc="factor of the deflections of flexible links in pictures")

    def check(self, where: str) -> None:
        """Markers have a file and columns."""
        if self.reference is None and self.reference_columns:
            raise InputError(f"{where}.reference_columns", None, "says nothing without reference", "name the CSV file")
        if self.reference is not None and not self.reference_columns:
            problem, cure = "draws nothing without reference_columns", 'write { OUTPUT = "COLUMN" }'
            raise InputError(f"{where}.reference", self.reference, problem, cure)
        for name in self.reference_columns:
            if self.curves and name not in self.curves:
                raise unknown_name(f"{where}.reference_columns", name, self.curves)


@dataclass(frozen=True)
class MechanismFile:
    """A whole mechanism file."""

    run: RunTable = quantity(doc="the run")
    bodies: dict[str, BodyTable] = quantity(doc="moving bodies by name")
    parameters: dict[str, float] = quantity(
        dict, doc="numbers by name, or expressions of those above; other keys and expressions may use them"
    )
    links: LinksTable = quantity(LinksTable, doc="links that joints with at_m define")
    ground: GroundTable = quantity(GroundTable, doc="points at rest")
    joints: dict[str, JointTable] = quantity(dict, doc="joints by name")
    forces: dict[str, ForceTable] = quantity(dict, doc="forces by name")
    start: StartTable = quantity(StartTable, doc="start values that must hold")
    tables: dict[str, ValueTableTable] = quantity(dict, doc="functions for expressions by name")
    outputs: tuple[OutputTable, ...] = quantity((), doc="columns of trajectory.csv")
    paths: tuple[PathTable, ...] = quantity((), doc="points whose paths are drawn")
    figure: FigureTable = quantity(FigureTable, doc="figure over time")
    title: str = quantity("", doc="title of the mechanism")

    def check(self, where: str) -> None:  # noqa: ARG002
        """Names that joints, forces and paths use exist."""
        known = {*self.bodies, "ground"}
        if "ground" in self.bodies:
            raise InputError("bodies.ground", None, "is the name of the ground", "rename the body")
        named: dict[str, Iterable[str]] = {
            "bodies": self.bodies,
            "joints": self.joints,
            "forces": self.forces,
            "tables": self.tables,
        }
        named["ground.points_m"] = self.ground.points_m
        named |= {f"bodies.{name}.points_m": body.all_points for name, body in self.bodies.items()}
        for kind, names in named.items():
            for name in names:
                if not name.isidentifier():
                    problem = "must be a word of letters, digits and _ (it is used in expressions and columns)"
                    raise InputError(kind, name, problem, "rename it")
        known |= {f"{name}.{point}" for name, body in self.bodies.items() if body.shape for point in body.all_points}
        for name in self.joints:
            if name in known:
                raise InputError("joints", name, "is the name of a body, too", "rename the joint")
        for kind in ("joints", "forces"):
            for name, part in getattr(self, kind).items():
                for key in ("body", "to", "carrier"):
                    value = getattr(part, key, None)
                    if value is not None and value not in known:
                        raise unknown_name(f"{kind}.{name}.{key}", value, known)
                for key, body, point in (("point", part.body, part.point), ("to_point", part.to, part.to_point)):
                    if body is None or point is None:
                        continue
                    label = f"{kind}.{name}.{key}"
                    if "." in body:
                        raise InputError(label, point, f"has a point already: {body!r}", "give the point once")
                    link = self.bodies.get(body)
                    if link is not None and link.beam is not None and isinstance(point, tuple):
                        check_on_axis(link.beam, point[0], label)
        for i, path in enumerate(self.paths):
            if path.body not in self.bodies:
                raise unknown_name(f"paths[{i}].body", path.body, self.bodies)
            link = self.bodies.get(path.body)
            if isinstance(path.point, tuple) and link is not None and link.bends:
                cure = "give it a name in points_m"
                raise InputError(f"paths[{i}].point", path.point, "is no named point of the flexible link", cure)


def read_mechanism_file(path: str | Path) -> MechanismFile:
    """Read the tables of a mechanism file.

    Raises
    ------
    InputError
        For every mistake in them.
    """
    raw = read_toml(path)
    others = [name for name in raw if name in TABLES]
    if others and "bodies" not in raw and "joints" not in raw:
        cure = "run it with another command, or begin with gearfe new mechanism"
        raise InputError("mechanism file", str(path), f"has no bodies but a table [{others[0]}]", cure)
    return mechanism_tables(raw)


def mechanism_tables(raw: Mapping[str, Any]) -> MechanismFile:
    """Return the tables of a parsed mechanism file.

    Expressions, also of parameters, are evaluated; links whose joints have positions become bodies.

    Raises
    ------
    InputError
        For every mistake in them.
    """
    raw = with_parameters(MechanismFile, raw)
    return build(MechanismFile, with_links(raw), "")


def _check_units(table: JointTable | ForceTable, where: str, wanted: Mapping[str, str]) -> None:
    """Raise `InputError` for a key with another unit than its coordinate has; `wanted`: key -> the one to write."""
    for key, right in wanted.items():
        if key != right and getattr(table, key) is not None:
            problem = f"has another unit than coordinate = {table.coordinate!r}"
            value = getattr(table, key)
            written = value if isinstance(value, float | str) else None
            raise InputError(f"{where}.{key}", written, problem, f"write {right}, or another coordinate")


def _check_keys(table: JointTable | ForceTable, where: str, kind: Kind, what: str) -> None:
    """No keys of other types, and all that this one needs."""
    docs = {spec.name: spec.metadata.get("doc", "") for spec in fields(table)}
    own = "remove it; its keys are " + ", ".join(name for name in docs if name in kind.fields)
    for spec in fields(table):
        if spec.name not in kind.fields and spec.name != "type" and getattr(table, spec.name) != spec.default:
            raise InputError(f"{where}.{spec.name}", None, f"does not belong to type {table.type!r}", own)
    for key, other in kind.needs.items():
        if getattr(table, key) not in (None, 0.0) and getattr(table, other) is None:
            problem = f"says nothing without {other}"
            raise InputError(f"{where}.{key}", getattr(table, key), problem, f"add {other}, or remove it")
    for key in kind.required:
        if getattr(table, key) is None:
            raise InputError(f"{where}.{key}", None, f"is required by {what}", f"add it: {docs[key]}")
