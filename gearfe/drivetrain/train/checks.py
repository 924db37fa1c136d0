"""Does a train hold together? Every mistake is named, with the cure; rules on kinematics are in `kinematics`."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from ...base.errors import InputError, unknown_name
from ...base.tables.bearing import check_matrix
from ...gears.gearmesh.curve import StiffnessCurve
from ...gears.gearmesh.law import MeshLaw
from ...gears.gearmesh.periodic import PeriodicInterpolant
from ...gears.gearmesh.width_law import WidthLaw
from ...gears.geometry.gear_data import rounding
from ...gears.geometry.mesh_geometry import ContactModel
from ...gears.geometry.pair import Gear, gear_pair, in_keys
from ...gears.geometry.validity import check_spur
from ..bearings import BallBearing, RollerBearing
from .friction import check_friction
from .gear_train import (
    ALWAYS,
    IN_CONTACT,
    Carrier,
    Drive,
    GearMesh,
    GearTrain,
    Load,
    Machine,
    Shaft,
    ShaftForce,
    ShaftGear,
    common_face,
)
from .statics import check_flanks, check_yields, one_sided

#: Agreement of lengths and angles that count as equal (relative).
SAME = 1e-6
#: Base radii of a wheel that count as equal (relative): tables may hold four digits.
ALIKE = 1e-3
#: Longest stretch without a sample that a curve may have, as a share of its period.
WIDEST_GAP = 0.15
#: Lowest order of a torque: a cycle in a thousand.
LEAST_ORDER = 1e-3


def check_train(train: GearTrain) -> None:
    """Raise `InputError` for the first mistake."""
    check_layout(train)
    check_flanks(train, one_sided(train))
    check_yields(train)


def check_layout(train: GearTrain) -> None:
    """Raise `InputError` for the first mistake but loads that press flanks of which nothing is known."""
    _names("shaft", [s.name for s in train.shafts])
    _names("gear", [g.name for g in train.gears])
    _names("mesh", [m.name for m in train.meshes])
    _check_shafts(train)
    _check_stages(train)
    _check_ends(train)
    for gear in train.gears:
        _known("gear " + repr(gear.name), "shaft", gear.shaft, [s.name for s in train.shafts])
        _check_on_shaft(train, gear)
    for mesh in train.meshes:
        _check_mesh(train, mesh)
    _check_room(train)
    _check_damping(train)
    ratios = train.kinematics.ratios  # which refuses trains that cannot roll or be assembled
    if train.housing is not None:
        for carrier in train.carriers:
            if ratios[train.shaft_number(carrier.shaft)]:
                _check_passes(train, carrier)


def _names(kind: str, names: list[str], *, some: bool = True) -> None:
    if not names and kind != "mesh" and some:
        raise InputError(f"train.{kind}s", None, f"the train has no {kind}", f"add a {kind}")
    twice = sorted({n for n in names if names.count(n) > 1})
    if twice:
        raise InputError(f"{kind} {twice[0]!r}", None, "is named twice", "give each its own name")


def _known(field: str, what: str, name: str, names: Iterable[str]) -> None:
    names = list(names)
    if name not in names:
        made = unknown_name(field, name, names)
        raise InputError(field, None, f"names an unknown {what} {name!r}", made.cure)


def _check_shafts(train: GearTrain) -> None:
    points, a = train.bore_points, train.frame[2]
    taken: dict[str, str] = {}
    for shaft in train.shafts:
        label = f"shaft {shaft.name!r}"
        for key in ("length", "radius", "density", "mass", "polar_inertia", "transverse_inertia"):
            value = getattr(shaft, key)
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise InputError(f"{label} {key}", value, "must be finite and > 0", "give it in SI units")
        if shaft.sections:
            _check_sections(shaft)
        if train.carrier_of(shaft.name) is not None:
            continue
        if not shaft.bores and not train.frames_of(shaft.name):
            cure = (
                "add a bearing, or name the attachments that carry it; only sun, ring and carrier of a stage may float"
            )
            raise InputError(f"{label} bores", None, "no bearing carries the shaft", cure)
        for bore in shaft.bores:
            _known(f"{label} bores", "attachment", bore, points)
            if bore in taken:
                problem = f"holds shaft {taken[bore]!r} and shaft {shaft.name!r}"
                raise InputError(f"attachment {bore!r}", None, problem, "a bore carries one shaft")
            taken[bore] = shaft.name
            _check_bore(train, shaft, bore, a)
    for bearing in train.bearings:
        if bearing.bore not in taken:
            raise unknown_name("bearing", bearing.bore, taken)
        for key in ("stiffness", "damping"):
            _check_yields(f"bearing at {bearing.bore!r} {key}", getattr(bearing, key))
    _check_apart(train)


def _check_stages(train: GearTrain) -> None:
    """Carriers, their planets, and shafts that are fixed or guided fit each other."""
    shafts = [shaft.name for shaft in train.shafts]
    _names("carrier", [carrier.name for carrier in train.carriers], some=False)
    guided = [guide.shaft for guide in train.guides]
    for guide in train.guides:
        label = f"shaft {guide.shaft!r}"
        _known("speed_ratio", "shaft", guide.shaft, shafts)
        if guide.shaft == train.driven.shaft or guided.count(guide.shaft) > 1:
            problem = "is driven and fixed or guided at once" if guided.count(guide.shaft) == 1 else "is guided twice"
            raise InputError(f"{label} speed_ratio", float(guide.ratio), problem, "leave one out")
        for key in ("stiffness", "damping"):
            value = getattr(guide, key)
            if value is not None and not (math.isfinite(value) and (value > 0.0 or (key == "damping" and not value))):
                raise InputError(f"{label} holding {key}", value, "must be finite and > 0", "give it in SI units")
    if not train.carriers:
        return
    carried: dict[str, str] = {}
    for carrier in train.carriers:
        _check_carrier(train, carrier, carried)
    for mesh in train.meshes:
        _check_carried_mesh(train, mesh)
    for shaft in train.shafts:
        frames = train.frames_of(shaft.name)
        if frames and (shaft.sections or not train.hinged(shaft.name)):
            _check_frame(train, shaft, frames)


def _check_carrier(train: GearTrain, carrier: Carrier, carried: dict[str, str]) -> None:
    """A carrier is a shaft, and its planets are shafts off its axis that nothing else carries."""
    label, shafts = f"carrier {carrier.name!r}", [shaft.name for shaft in train.shafts]
    _known(label, "shaft", carrier.shaft, shafts)
    if not carrier.pins:
        raise InputError(label, None, "has no planets", f'give a shaft carrier = "{carrier.name}"')
    for pin in carrier.pins:
        _known(label, "shaft", pin.shaft, shafts)
        shaft = train.shaft(pin.shaft)
        if pin.shaft in carried or pin.shaft == carrier.shaft:
            problem = f"cannot be a planet of {label}: it is {carried.get(pin.shaft, 'the carrier itself')}"
            raise InputError(f"shaft {pin.shaft!r} carrier", carrier.name, problem, "a planet has one carrier")
        carried[pin.shaft] = f"a planet of {label}"
        if shaft.bores:
            problem = f"is a planet of {label}, whose pin carries it, and of bearings: {', '.join(shaft.bores)}"
            raise InputError(f"shaft {pin.shaft!r} bores", None, problem, "leave out its bearings, or its carrier")
        if shaft_distance(train, pin.shaft, carrier.shaft) <= SAME * shaft.length:
            problem = f"lies on the axis of {label}"
            raise InputError(f"shaft {pin.shaft!r}", None, problem, "place it off that axis (x_mm, z_mm)")
        for key in ("stiffness", "damping"):
            values = getattr(pin, key)
            given = np.array(0.0 if values is None else values, dtype=float)
            positive = key == "damping" or values is None or given.max() > 0.0
            if given.shape not in ((), (5,)) or not np.isfinite(given).all() or (given < 0.0).any() or not positive:
                problem = "must be one number, radial and tangential, or five >= 0"
                raise InputError(f"{label} pin {key}", values, problem, "see the documentation of Pin")


def _check_carried_mesh(train: GearTrain, mesh: GearMesh) -> None:
    """The gears of a mesh have axes that one carrier carries, or lie on its axis."""
    ends = [train.gear(name).shaft for name in (mesh.driver, mesh.driven)]
    carriers = [train.carrier_of(shaft) for shaft in ends]
    carrier = carriers[0] or carriers[1]
    if carrier is None:
        return
    label = f"mesh {mesh.name!r}"
    for shaft, own in zip(ends, carriers, strict=True):
        if own is not None and own is not carrier:
            problem = f"joins planets of the carriers {carrier.name!r} and {own.name!r}, which pass each other"
            raise InputError(label, None, problem, "mesh planets of one carrier")
        off = shaft_distance(train, shaft, carrier.shaft)
        if own is None and off > SAME * max(train.shaft(shaft).length, 1e-3):
            problem = f"shaft {shaft!r} is {1e3 * off:.6g} mm off the axis of carrier {carrier.name!r}"
            cure = "move the shaft onto that axis (x_mm, z_mm): its gear meshes with planets that go round it"
            raise InputError(label, None, problem, cure)


def _check_passes(train: GearTrain, carrier: Carrier) -> None:
    """In an elastic housing, shafts of a stage whose carrier turns are held by springs, and dampers are of parts."""
    for shaft in train.shafts:
        if carrier in train.frames_of(shaft.name) and shaft.bores and train.hinged(shaft.name):
            problem = f"is held by a rigid bearing in an elastic housing, and turns there with carrier {carrier.name!r}"
            cure = f"give its bearings a stiffness: {', '.join(shaft.bores)}"
            raise InputError(f"shaft {shaft.name!r} bearings", list(shaft.bores), problem, cure)
    if np.any(train.damping.ratio):
        problem = (
            f"is of modes, and carrier {carrier.name!r} that turns in an elastic housing changes them all the time"
        )
        cure = "leave it out: damp by rayleigh_beta, meshes, bearings and the housing's own damping ratio"
        raise InputError("train damping ratio", train.damping.ratio, problem, cure)


def _check_frame(train: GearTrain, shaft: Shaft, frames: list[Carrier]) -> None:
    """A shaft that moves in the frame of a carrier has bearings that are alike in all directions across the axis."""
    label = f"shaft {shaft.name!r}"
    gears = {gear.name for gear in train.gears if gear.shaft == shaft.name}
    fixed = [m.name for m in train.meshes if gears & {m.driver, m.driven} and train.mesh_carrier(m) is None]
    if len(frames) > 1 or fixed:
        other = f"mesh {fixed[0]!r}, whose axes are fixed" if fixed else f"carrier {frames[1].name!r}"
        problem = f"moves in its bearings with carrier {frames[0].name!r} and with {other}, at different speeds"
        cure = "part it into two shafts on one axis with [couplings.NAME] between them, or hold it in rigid bearings"
        raise InputError(label, None, problem, cure)
    for bearing in train.bearings:
        if bearing.bore not in shaft.bores:
            continue
        if isinstance(bearing.stiffness, BallBearing | RollerBearing):
            problem = f"carries shaft {shaft.name!r} of a planetary stage, whose load goes round with the carrier"
            raise InputError(f"bearing {bearing.bore!r}", None, problem, "give its stiffness, or a rigid bearing")
        for key in ("stiffness_matrix", "damping_matrix"):
            matrix = getattr(bearing, key)
            if not np.allclose(_turned(matrix), matrix, rtol=0.0, atol=SAME * np.abs(matrix).max()):
                problem = f"differs across the axis, and shaft {shaft.name!r} moves in the frame of a carrier"
                cure = "give equal values in both directions across the axis, translations and tilts"
                raise InputError(f"bearing {bearing.bore!r} {key.split('_')[0]}", None, problem, cure)


def _turned(matrix: np.ndarray) -> np.ndarray:
    """Matrix of a bearing (e1, a, e2, tilts about e1 and e2) seen from axes that are turned by 1 rad about a."""
    cosine, sine = math.cos(1.0), math.sin(1.0)
    turn = np.eye(5)
    turn[np.ix_([0, 2], [0, 2])] = turn[np.ix_([3, 4], [3, 4])] = [[cosine, sine], [-sine, cosine]]
    return np.asarray(turn @ matrix @ turn.T)


def _check_yields(label: str, values: Any) -> None:
    """Five numbers >= 0, a symmetric positive semi-definite matrix, or a rolling bearing."""
    if isinstance(values, BallBearing | RollerBearing):
        return
    given = np.array(values, dtype=float)
    if given.shape not in ((5,), (5, 5)) or not np.isfinite(given).all() or (given.ndim == 1 and (given < 0.0).any()):
        problem = "must be five numbers >= 0, three translations and two tilts, or five rows of five"
        raise InputError(label, values, problem, "see the documentation of Bearing")
    if given.ndim == 2:
        check_matrix(label, values)


def _check_apart(train: GearTrain) -> None:
    """No two bearings of a shaft in one place."""
    width = {b.bore: b.stiffness.width for b in train.bearings if isinstance(b.stiffness, BallBearing | RollerBearing)}
    for shaft in train.shafts:
        places = sorted((float(train.bore_points[bore] @ train.frame[2]), bore) for bore in shaft.bores)
        for (low, one), (high, two) in itertools.pairwise(places):
            needed = max(0.5 * (width.get(one, 0.0) + width.get(two, 0.0)), SAME * shaft.length)
            if high - low < needed:
                problem = f"lies {1e3 * (high - low):.6g} mm from bearing {one!r} on shaft {shaft.name!r}: they overlap"
                cure = f"place them at least {1e3 * needed:.6g} mm apart (y_mm), or use one with two rows"
                raise InputError(f"bearing {two!r}", None, problem, cure)


def _check_bore(train: GearTrain, shaft: Shaft, bore: str, a: np.ndarray) -> None:
    arm = train.bore_points[bore] - np.array(shaft.point)
    off = float(np.linalg.norm(arm - (arm @ a) * a))
    if off > SAME * max(shaft.length, 1e-3):
        problem = f"lies {1e3 * off:.6g} mm off the axis of shaft {shaft.name!r}"
        cure = "name the bores on that axis, or move the shaft (x_mm, z_mm): it runs along y"
        raise InputError(f"attachment {bore!r}", None, problem, f"{cure} (housing.mesh.axes turns a mesh)")
    along = float(arm @ a)
    beyond = abs(along) - 0.5 * shaft.length
    if beyond > SAME * shaft.length:
        problem = f"lies {1e3 * beyond:.6g} mm beyond the end of shaft {shaft.name!r}{_reach(train, shaft)}"
        longer = "lengthen the shaft (length_mm)" if not shaft.sections else "add or lengthen a section of the shaft"
        raise InputError(f"attachment {bore!r}", None, problem, f"{longer}, or move it (y_mm)")
    if shaft.sections:
        _check_beside(train, shaft, bore, along)
    if train.housing is not None:
        own = train.housing.attachment_axes[train.housing.attachment_names.index(bore)]
        if abs(abs(float(own @ a)) - 1.0) > SAME:
            problem = "its bore is not parallel to the train's axis"
            raise InputError(f"attachment {bore!r}", list(map(float, own)), problem, "all shafts must be parallel")


def _check_sections(shaft: Shaft) -> None:
    """Sections that can exist, length and radius that are theirs, nothing given that follows from them."""
    label = f"shaft {shaft.name!r}"
    for number, section in enumerate(shaft.sections, start=1):
        fault = section.fault()
        if fault is not None:
            key, value, problem, cure = fault
            raise InputError(f"{label} section {number} {key}", value, problem, cure)
    length = sum(section.length for section in shaft.sections)
    radius = max(0.5 * max(section.outer_start, section.outer_end) for section in shaft.sections)
    for key, needed in (("length", length), ("radius", radius)):
        if abs(getattr(shaft, key) - needed) > SAME * needed:
            problem = f"contradicts the sections, from which follow {needed:.9g} m"
            raise InputError(f"{label} {key}", getattr(shaft, key), problem, "give that of the sections")
    for key in ("mass", "polar_inertia", "transverse_inertia"):
        if getattr(shaft, key) is not None:
            problem = "conflicts with sections, from which it follows together with the gears"
            raise InputError(f"{label} {key}", getattr(shaft, key), problem, "leave one out")
    if not (math.isfinite(shaft.damping_ratio) and 0.0 <= shaft.damping_ratio < 1.0):
        problem = "must be >= 0 and < 1"
        raise InputError(f"{label} damping ratio", shaft.damping_ratio, problem, "0.01 is 1 % of critical damping")
    if not (math.isfinite(shaft.highest_hz) and shaft.highest_hz > 0.0):
        problem = "must be finite and > 0 Hz"
        raise InputError(f"{label} highest frequency", shaft.highest_hz, problem, "give the highest one of interest")


def _check_beside(train: GearTrain, shaft: Shaft, bore: str, along: float) -> None:
    """On an elastic shaft no bearing is within a gear."""
    middle = float(np.array(shaft.point) @ train.frame[2])
    for gear in train.gears:
        reach = 0.5 * gear.gear.face_width
        if gear.shaft == shaft.name and abs(gear.along - middle - along) < reach * (1.0 - SAME):
            low, high = 1e3 * (gear.along - reach), 1e3 * (gear.along + reach)
            problem = (
                f"is at y = {1e3 * (middle + along):.6g} mm, within gear {gear.name!r} from {low:.6g} to {high:.6g} mm"
            )
            raise InputError(f"attachment {bore!r}", None, problem, "move the bearing or the gear along the shaft")


def _reach(train: GearTrain, shaft: Shaft) -> str:
    """Where the sections of a shaft reach, for messages; empty for a rigid one."""
    if not shaft.sections:
        return ""
    middle = float(np.array(shaft.point) @ train.frame[2])
    low, high = 1e3 * (middle - 0.5 * shaft.length), 1e3 * (middle + 0.5 * shaft.length)
    return f", whose sections reach from {low:.6g} to {high:.6g} mm"


def _check_place(train: GearTrain, label: str, end: Drive | Load) -> None:
    """A drive or a load acts on its shaft, and at a place of it that is known where the shaft is elastic."""
    shaft = train.shaft(end.shaft)
    if end.along is None:
        if shaft.sections and end.bore is None and not end.machine:
            problem = f"is open: shaft {shaft.name!r} is elastic, and no attachment says where the torque acts"
            raise InputError(f"{label} place", None, problem, "give y_mm, the place along the shaft")
        return
    middle = float(np.array(shaft.point) @ train.frame[2])
    low, high = middle - 0.5 * shaft.length, middle + 0.5 * shaft.length
    if not (math.isfinite(end.along) and low - SAME * shaft.length <= end.along <= high + SAME * shaft.length):
        problem = f"must be on shaft {shaft.name!r}, from {1e3 * low:.6g} to {1e3 * high:.6g} mm"
        raise InputError(f"{label} y_mm", 1e3 * end.along, problem, "move it, or lengthen the shaft")


def _check_ends(train: GearTrain) -> None:
    _check_driveline(train)
    drive = train.driven
    if drive.stiffness is not None and not (math.isfinite(drive.stiffness) and drive.stiffness > 0.0):
        raise InputError("drive stiffness", drive.stiffness, "must be finite and > 0 N m/rad", "None for a rigid drive")
    if not (math.isfinite(drive.damping) and drive.damping >= 0.0):
        raise InputError("drive damping", drive.damping, "must be finite and >= 0", "negative damping feeds energy in")
    shafts = {s.name: s for s in train.shafts}
    parts: list[tuple[str, Drive | Load]] = [("drive", drive)]
    parts += [(f"load on {x.shaft!r}", x) for x in train.loads]
    for label, part in parts:
        _known(label, "shaft", part.shaft, shafts)
        if part.bore is not None:
            _known(label, "attachment", part.bore, train.bore_points)
            if part.bore not in shafts[part.shaft].bores:
                problem = f"attachment {part.bore!r} does not carry shaft {part.shaft!r}"
                raise InputError(label, part.bore, problem, f"choose one of {', '.join(shafts[part.shaft].bores)}")
        _check_place(train, label, part)
        _check_machine(train, label, part)
    for load in train.loads:
        _check_orders(train, load)
    for number, force in enumerate(train.forces, 1):
        _check_force(train, force, f"force {number} on {force.shaft!r}")
    if not train.meshes and len(train.shafts) > 1:
        raise InputError("train.meshes", None, "no gear is driven: the train has no mesh", "add a mesh")


def _check_force(train: GearTrain, force: ShaftForce, label: str) -> None:
    """A force acts on its shaft, whose motion is not described in a frame that turns."""
    _known(label, "shaft", force.shaft, [shaft.name for shaft in train.shafts])
    if not all(math.isfinite(value) for value in (*force.values, force.along)):
        raise InputError(label, None, "must be finite", "give N, N m and m")
    shaft = train.shaft(force.shaft)
    low, high = (train.shaft_end(shaft.name, side) for side in (-1.0, 1.0))
    if not low - SAME * shaft.length <= force.along <= high + SAME * shaft.length:
        problem = f"must be on shaft {shaft.name!r}, from {1e3 * low:.6g} to {1e3 * high:.6g} mm"
        raise InputError(f"{label} y_mm", 1e3 * force.along, problem, "move it, or lengthen the shaft")
    carrier = train.frame_of(shaft.name)
    if carrier is not None:
        problem = f"runs in the frame of carrier {carrier.name!r}, in which a constant force would turn"
        cure = "put the force on a shaft outside of the planetary stage, joined by a coupling"
        raise InputError(f"{label} shaft", shaft.name, problem, cure)


def _check_machine(train: GearTrain, label: str, end: Drive | Load) -> None:
    """The machine of a drive or a load is of its shaft; a torque that grows with the speed is no load."""
    names = [machine.name for machine in train.machines if machine.shaft == end.shaft]
    if end.machine and end.machine not in names:
        raise unknown_name(f"{label} machine", end.machine, names)
    if not (math.isfinite(end.slope) and end.slope >= 0.0):
        problem = "must be finite and >= 0 N m s/rad: a torque that grows with the speed runs away"
        raise InputError(f"{label} slope", end.slope, problem, "write by how much the torque falls with the speed")
    if end.over_speed is not None and (end.over_speed.function.sines or not math.isfinite(end.over_speed.reference)):
        problem = "must be pieces of polynomials of the speed, with a finite reference"
        raise InputError(f"{label} torque over speed", end.over_speed.reference, problem, "leave sines out")


def _check_machine_place(train: GearTrain, machine: Machine) -> None:
    """A machine is at a place of its shaft, which is known where the shaft is elastic."""
    shaft, label = train.shaft(machine.shaft), f"machine {machine.name!r} y_mm"
    if machine.along is None:
        if shaft.sections:
            problem = f"is required: shaft {shaft.name!r} is elastic"
            raise InputError(label, None, problem, "give the place along the shaft")
        return
    low, high = train.shaft_end(shaft.name, -1.0), train.shaft_end(shaft.name, 1.0)
    if not (math.isfinite(machine.along) and low - SAME * shaft.length <= machine.along <= high + SAME * shaft.length):
        problem = f"must be on shaft {shaft.name!r}, from {1e3 * low:.6g} to {1e3 * high:.6g} mm"
        raise InputError(label, 1e3 * machine.along, problem, "move it, or lengthen the shaft")


def _check_driveline(train: GearTrain) -> None:
    """Machines and couplings have names, shafts, finite values; coupled shafts lie on one axis."""
    shafts = [shaft.name for shaft in train.shafts]
    for kind, items in (("machine", train.machines), ("coupling", train.couplings)):
        names = [item.name for item in items]
        for item in items:
            label = f"{kind} {item.name!r}"
            if names.count(item.name) > 1:
                raise InputError(label, None, "is named twice", "give each its own name")
            for key in ("inertia", "stiffness", "damping"):
                value = getattr(item, key, 1.0)
                if not (math.isfinite(value) and (value > 0.0 or (key == "damping" and value == 0.0))):
                    limit = ">= 0" if key == "damping" else "> 0"
                    raise InputError(f"{label} {key}", value, f"must be finite and {limit}", "give it in SI units")
            for name in (item.shaft,) if isinstance(item, Machine) else item.shafts:
                _known(label, "shaft", name, shafts)
    for machine in train.machines:
        _check_machine_place(train, machine)
    joined: dict[frozenset[str], str] = {}
    for coupling in train.couplings:
        both = frozenset(coupling.shafts)
        if both in joined:
            problem = f"joins the shafts of coupling {joined[both]!r}, too"
            raise InputError(
                f"coupling {coupling.name!r}", list(coupling.shafts), problem, "write one, with both rates"
            )
        joined[both] = coupling.name
        one, two = (train.shaft(name) for name in coupling.shafts)
        label, apart = f"coupling {coupling.name!r}", shaft_distance(train, one.name, two.name)
        if one.name == two.name:
            raise InputError(label, one.name, "names one shaft twice", "a coupling joins two shafts")
        if apart > SAME * max(one.length, two.length):
            problem = f"shafts {one.name!r} and {two.name!r} are {1e3 * apart:.6g} mm apart: must lie on one axis"
            raise InputError(label, None, problem, "move one (x_mm, z_mm), or let gears connect them")
        middles = abs(train.shaft_end(one.name, 0.0) - train.shaft_end(two.name, 0.0))
        common = 0.5 * (one.length + two.length) - middles
        if common > SAME * max(one.length, two.length):
            problem = f"shafts {one.name!r} and {two.name!r} overlap by {1e3 * common:.6g} mm along their axis"
            raise InputError(label, None, problem, "move one along it (y_mm), or shorten it")
    drive = train.driven
    if drive.torque is None:
        if drive.over_speed is not None:
            problem = "is of a drive by torque, and this one has a prescribed speed"
            raise InputError("drive torque over speed", None, problem, "give the steady torque, or leave it out")
        if drive.slope > 0.0:
            problem = "is of a drive by torque, and this one has a prescribed speed"
            raise InputError("drive slope", drive.slope, problem, "give the torque, or leave it out")
        return
    if drive.stiffness is not None:
        problem = "conflicts with a torque: nothing prescribes the rotation behind the coupling"
        raise InputError("drive stiffness", drive.stiffness, problem, "use a machine with a spring, or leave one out")
    if train.damping.alpha > 0.0:
        problem = "would brake the rotation itself of a train that is driven by a torque"
        raise InputError("damping alpha", train.damping.alpha, problem, "use beta or ratio, or prescribe the speed")


def _check_orders(train: GearTrain, load: Load) -> None:
    """The orders of a load are positive, of a mesh that exists, under a drive of one speed."""
    label = f"load on {load.shaft!r} orders"
    if not load.orders:
        if load.mesh:
            raise InputError(f"load on {load.shaft!r} mesh", load.mesh, "is of orders", "add orders, or leave it out")
        return
    if load.mesh:
        _known(label, "mesh", load.mesh, [mesh.name for mesh in train.meshes])
    for order, amplitude, phase in load.orders:
        if not (LEAST_ORDER <= order < math.inf and math.isfinite(amplitude) and math.isfinite(phase)):
            problem = f"must be [order >= {LEAST_ORDER:g}, amplitude, phase], all finite"
            raise InputError(label, [order, amplitude, math.degrees(phase)], problem, "correct it")
    if train.driven.torque is not None:
        problem = "follow a prescribed speed, and the drive is by torque"
        raise InputError(label, None, problem, "write torque_Nm as an expression of time, or prescribe the speed")
    if not train.driven.speed.steady:
        problem = "follow a drive of constant speed only"
        cure = "give the drive a constant speed, or write torque_Nm as an expression of time"
        raise InputError(label, None, problem, cure)


def _check_on_shaft(train: GearTrain, item: ShaftGear) -> None:
    shaft = train.shaft(item.shaft)
    middle = float(np.array(shaft.point) @ train.frame[2])
    reach = abs(item.along - middle) + 0.5 * item.gear.face_width
    if reach > 0.5 * shaft.length * (1 + SAME):
        beyond = 1e3 * (reach - 0.5 * shaft.length)
        problem = f"reaches {beyond:.6g} mm beyond the end of shaft {shaft.name!r}{_reach(train, shaft)}"
        longer = "lengthen the shaft" if not shaft.sections else "add or lengthen a section of the shaft"
        raise InputError(f"gear {item.name!r}", None, problem, f"move the gear, or {longer}")


def _check_mesh(train: GearTrain, mesh: GearMesh) -> None:
    label = f"mesh {mesh.name!r}"
    for name in (mesh.driver, mesh.driven):
        _known(label, "gear", name, [g.name for g in train.gears])
    one, two = train.gear(mesh.driver), train.gear(mesh.driven)
    if one.shaft == two.shaft:
        raise InputError(label, None, f"both gears are on shaft {one.shaft!r}", "mesh gears of two shafts")
    try:
        pair = gear_pair(one.gear, two.gear, mesh.centre_distance)
        if isinstance(mesh.stiffness, MeshLaw):
            check_spur(pair, "a mesh law")
        expected = pair.working_centre_distance
    except InputError as error:
        side, _, name = error.field.rpartition(".")
        error = InputError(name, error.value, error.problem, error.cure)
        raise in_keys(error, f"{label} {side}".rstrip()) from None
    distance = shaft_distance(train, one.shaft, two.shaft)
    if abs(distance - expected) > max(SAME * expected, rounding(one.gear.module)):
        apart = f"shafts {one.shaft!r} and {two.shaft!r} are {1e3 * distance:.9g} mm apart"
        problem = f"{apart}, the gears need {1e3 * expected:.9g} mm"
        cure = "move a shaft, change the gears, or give the gears another centre distance (with backlash)"
        raise InputError(label, None, problem, cure)
    if overlap(one, two) <= 0.0:
        problem = f"the gears do not face each other: {1e3 * -overlap(one, two):.6g} mm lie between them along the axis"
        raise InputError(label, None, problem, "move one along its shaft")
    if not (math.isfinite(mesh.damping) and mesh.damping >= 0.0):
        raise InputError(
            f"{label} damping", mesh.damping, "must be finite and >= 0 N s/m", "negative damping feeds energy in"
        )
    _check_damper(mesh)
    check_friction(label, mesh.friction, isinstance(mesh.stiffness, MeshLaw))
    for gear in (one, two):
        _check_pitch_errors(label, gear, isinstance(mesh.stiffness, MeshLaw))
    check_curve(mesh, one.gear.teeth, two.gear)


def _check_damper(mesh: GearMesh) -> None:
    """The damper of a mesh acts at times that the mesh has."""
    label, acts = f"mesh {mesh.name!r} damping_acts", mesh.damping_acts
    if acts not in (None, ALWAYS, IN_CONTACT):
        raise InputError(label, acts, f"must be {ALWAYS!r} or {IN_CONTACT!r}", "leave it out for the default")
    if acts == IN_CONTACT and not mesh.has_law and mesh.backlash is None:
        problem = (
            "needs teeth that part, and a mesh without a law and without a backlash is a spring that acts both ways"
        )
        raise InputError(label, acts, problem, "give backlash_um, or leave it out: such a damper acts always")
    if mesh.stiffness is None and (acts or mesh.damping):
        problem = "conflicts with a rigid mesh, which has no deflection to damp"
        raise InputError(
            label if acts else label.replace("damping_acts", "damping"), acts or mesh.damping, problem, "leave it out"
        )


def _check_pitch_errors(label: str, gear: ShaftGear, law: bool) -> None:
    """Pitch errors are one a tooth, at meshes that know their tooth pairs."""
    for errors in gear.pitch_errors:
        if errors and not law:
            problem = (
                f"has teeth with pitch errors on gear {gear.name!r}, which curves, laws over the face width and rigid "
                "meshes do not know"
            )
            cure = 'take a mesh law (mesh_model = "potential") of loads alike along the width, or leave them out'
            raise InputError(label, None, problem, cure)
        if len(errors) not in (0, gear.gear.teeth) or not np.isfinite(errors).all():
            problem = f"must be finite, one for each of the {gear.gear.teeth} teeth of gear {gear.name!r}, or none"
            raise InputError("pitch_errors", len(errors), problem, "give as many as the gear has teeth")


def _check_error(mesh: GearMesh, teeth: int) -> None:
    """The transmission error of a mesh covers one pitch of its driver, in finite numbers."""
    error, pitch = mesh.transmission_error, 2.0 * math.pi / teeth
    if mesh.tilting is not None:
        nodes = () if error is None else error.nodes
        for table in (mesh.tilting.lever, mesh.tilting.moment):
            if len(table.nodes) != len(nodes) or not np.allclose(table.nodes, nodes, rtol=0.0, atol=SAME * pitch):
                problem = "must have the phases of the transmission error"
                raise InputError(f"mesh {mesh.name!r} tilting", None, problem, "interpolate both over the same phases")
    if error is None:
        return
    label = f"mesh {mesh.name!r} transmission_error"
    if mesh.stiffness is None or mesh.has_law:
        problem = "conflicts with a rigid mesh or a mesh law, which includes it"
        raise InputError(label, None, problem, "give a stiffness, or leave it out")
    if abs(error.period - pitch) > SAME * pitch or not np.isfinite(error.cubics).all():
        problem = f"has a period of {math.degrees(error.period):.9g} deg, a pitch has {math.degrees(pitch):.9g} deg"
        raise InputError(label, None, problem, "give finite values over one pitch of the driver")


def check_curve(mesh: GearMesh, teeth: int, wheel: Gear) -> None:
    """Check that the curve of a mesh covers one cycle of its driver with positive values, and is that of its wheel."""
    label, curve = f"mesh {mesh.name!r} stiffness", mesh.stiffness
    if isinstance(curve, ContactModel):
        raise InputError(label, None, "is a model that is not computed yet", "call gearfe.compute_meshes(train) first")
    _check_error(mesh, teeth)
    if mesh.backlash is not None and not (math.isfinite(mesh.backlash) and mesh.backlash >= 0.0):
        problem = "must be finite and >= 0 m: less is a wedged mesh, with all flanks loaded without torque"
        raise InputError(
            f"mesh {mesh.name!r} backlash", mesh.backlash, problem, "thin the teeth, or move the shafts apart"
        )
    if curve is None:
        if mesh.backlash is not None:
            problem = "conflicts with a rigid mesh, whose teeth never separate"
            raise InputError(f"mesh {mesh.name!r} backlash", mesh.backlash, problem, "leave one out")
        return
    if isinstance(curve, (int, float)):
        if not (math.isfinite(curve) and curve > 0.0):
            raise InputError(label, curve, "must be finite and > 0 N/m", "or None for a rigid mesh")
        return
    period = (
        curve.period
        if isinstance(curve, PeriodicInterpolant)
        else curve.cycle
        if isinstance(curve, MeshLaw | WidthLaw)
        else curve.mesh_cycle
    )
    expected = 2.0 * math.pi / teeth
    if abs(period - expected) > SAME * expected:
        needs = f"the driver of {teeth} teeth needs {math.degrees(expected):.9g} deg"
        problem = f"has a period of {math.degrees(period):.9g} deg, {needs}"
        raise InputError(label, None, problem, "take the curve of these gears, the driver as pinion")
    if isinstance(curve, MeshLaw | WidthLaw):
        if abs(curve.sides[1].cycle - expected) > SAME * expected:
            problem = f"has a law of the back flanks with a period of {math.degrees(curve.sides[1].cycle):.9g} deg"
            raise InputError(label, None, problem, "take that of the same gears, seen from behind")
        return
    if isinstance(curve, StiffnessCurve) and abs(curve.base_radius - wheel.base_radius) > ALIKE * wheel.base_radius:
        problem = (
            f"belongs to a wheel with a base radius of {1e3 * curve.base_radius:.6g} mm, "
            f"the driven gear has {1e3 * wheel.base_radius:.6g} mm"
        )
        raise InputError(label, None, problem, "take the curve of these gears, the driver as pinion")
    table = mesh.interpolant()
    gaps = np.diff(table.nodes)
    widest = float(gaps.max()) / table.period
    if widest > max(WIDEST_GAP, 1.5 * float(np.median(gaps)) / table.period):
        start = math.degrees(table.nodes[int(gaps.argmax())])
        problem = f"has a gap: no value from {start:.6g} deg on over {360.0 * widest / teeth:.6g} deg"
        raise InputError(label, None, problem, "compute the missing positions of the curve")
    if not table.values.min() > 0.0:
        raise InputError(
            label, float(table.values.min()), "must be > 0 N/m everywhere", "look for positions without contact"
        )


def shaft_distance(train: GearTrain, one: str, two: str) -> float:
    """Distance of two shafts' axes (m)."""
    a = train.frame[2]
    arm = np.array(train.shaft(two).point) - np.array(train.shaft(one).point)
    return float(np.linalg.norm(arm - (arm @ a) * a))


def overlap(one: ShaftGear, two: ShaftGear) -> float:
    """Length along the axis that two gears share (m); negative: the gap between them."""
    low, high = common_face(one, two)
    return high - low


def _check_room(train: GearTrain) -> None:
    """No two gears or shafts in one place, and no gear in another shaft."""
    # ring gears and carriers are cups about other shafts, and not the cylinders that their lengths and radii say
    cups = {gear.shaft for gear in train.gears if gear.gear.teeth < 0}
    for first, second in () if train.carriers else itertools.combinations(train.shafts, 2):
        if not cups & {first.name, second.name}:
            _check_shaft_room(train, first, second)
    meshing = {frozenset((m.driver, m.driven)) for m in train.meshes}
    # rings are hollow, and carriers are cages round the gears: their cylinders are of no form that is known
    rims = {gear.shaft for gear in train.gears if gear.gear.teeth < 0} | {c.shaft for c in train.carriers}
    for i, one in enumerate(train.gears):
        for two in train.gears[i + 1 :]:
            if overlap(one, two) <= SAME * one.gear.face_width or frozenset((one.name, two.name)) in meshing:
                continue
            room = 0.0 if one.shaft == two.shaft else shaft_distance(train, one.shaft, two.shaft)
            if one.shaft != two.shaft and (one.gear.teeth < 0) != (two.gear.teeth < 0):
                ring, other = (one, two) if one.gear.teeth < 0 else (two, one)
                if room + other.gear.tip_radius <= ring.gear.tip_radius:
                    continue  # within the ring
            if one.shaft == two.shaft or room < one.gear.tip_radius + two.gear.tip_radius:
                _check_planets_apart(train, one, two, room)
                problem = f"overlaps gear {two.name!r} over {1e3 * overlap(one, two):.6g} mm along the axis"
                raise InputError(f"gear {one.name!r}", None, problem, "move one along its shaft, or let them mesh")
        for shaft in train.shafts:
            along, half = one.along - float(np.array(shaft.point) @ train.frame[2]), 0.5 * one.gear.face_width
            beside = abs(along) - 0.5 * (shaft.length + one.gear.face_width) >= 0.0
            if shaft.name == one.shaft or beside or shaft.name in rims:
                continue
            radius = shaft.radius_within(along - half, along + half)
            room = shaft_distance(train, one.shaft, shaft.name) - radius
            if one.gear.teeth < 0:
                if one.gear.tip_radius < room + 2.0 * radius:
                    problem = f"its teeth cut into shaft {shaft.name!r}, which runs through it"
                    raise InputError(f"gear {one.name!r}", None, problem, "thinner or shorter shaft, or a larger ring")
                continue
            if one.gear.tip_radius > room:
                problem = f"its tip cuts {1e3 * (one.gear.tip_radius - room):.4g} mm into shaft {shaft.name!r}"
                raise InputError(f"gear {one.name!r}", None, problem, "thinner shaft, smaller gear, or a shorter shaft")


def _check_planets_apart(train: GearTrain, one: ShaftGear, two: ShaftGear, apart: float) -> None:
    """Raise `InputError` for gears that overlap and are those of planets of one carrier."""
    carrier = train.carrier_of(one.shaft)
    if carrier is None or carrier is not train.carrier_of(two.shaft) or one.shaft == two.shaft:
        return
    raise planets_overlap(
        carrier.name, len(carrier.pins), (one.name, two.name), one.gear.tip_radius + two.gear.tip_radius, apart,
        shaft_distance(train, one.shaft, carrier.shaft),
    )  # fmt: skip


def planets_overlap(
    carrier: str, count: int, names: tuple[str, str], needed: float, apart: float, arm: float
) -> InputError:
    """Return the error for planets whose tip circles overlap.

    Parameters
    ----------
    carrier, count
        Name of the carrier, and the number of its planets.
    names
        Of two gears that overlap.
    needed, apart, arm
        Sum of their tip radii, distance of their axes, and that from the axis of the carrier (m).
    """
    problem = (
        f"gear {names[0]!r} overlaps gear {names[1]!r}: axes {1e3 * apart:.6g} mm apart, tip circles need more than "
        f"{1e3 * needed:.6g} mm"
    )
    cure = "use smaller planets"
    if needed < 2.0 * arm:  # else no angle is large enough
        least = 2.0 * math.asin(0.5 * needed / arm)
        most = int(2.0 * math.pi / least * (1.0 - SAME))
        cure = (
            f"place neighbouring planets at least {math.degrees(least) + 5e-4:.3f} deg apart (at most {most} equally "
            f"spaced, as far as tooth numbers allow), or {cure}"
        )
    return InputError(f"carriers.{carrier}", None, f"has {count} planets, and {problem}", cure)


def _check_shaft_room(train: GearTrain, one: Shaft, two: Shaft) -> None:
    """Two shafts are beside each other, one after the other, or one in the bore of the other."""
    apart = shaft_distance(train, one.name, two.name)
    if apart >= one.radius + two.radius:
        return
    middles = [train.shaft_end(shaft.name, 0.0) for shaft in (one, two)]
    for low, high in _shared_pieces(one, two, middles):
        reach = [
            shaft.radius_within(low - middle, high - middle) for shaft, middle in zip((one, two), middles, strict=True)
        ]
        bores = [
            _bore_within(shaft, low - middle, high - middle) for shaft, middle in zip((one, two), middles, strict=True)
        ]
        inside = apart + reach[0] <= bores[1] * (1.0 + SAME) or apart + reach[1] <= bores[0] * (1.0 + SAME)
        if apart >= sum(reach) * (1.0 - SAME) or inside:
            continue
        problem = (
            f"overlaps shaft {two.name!r} over {1e3 * (high - low):.6g} mm along the axis, from y = {1e3 * low:.6g} to "
            f"{1e3 * high:.6g} mm"
        )
        cure = "move one along the axis (y_mm) or aside (x_mm), shorten it, or give the outer one sections with a bore"
        raise InputError(f"shaft {one.name!r}", None, problem, cure)


def _shared_pieces(one: Shaft, two: Shaft, middles: list[float]) -> list[tuple[float, float]]:
    """Ranges along the axis (m) that pieces of two shafts share."""
    ranges, least = [], SAME * max(one.length, two.length)
    for first, second in itertools.product(one.outline, two.outline):
        low, high = (
            max(first[0] + middles[0], second[0] + middles[1]),
            min(first[1] + middles[0], second[1] + middles[1]),
        )
        if high - low > least:
            ranges.append((low, high))
    return ranges


def _bore_within(shaft: Shaft, low: float, high: float) -> float:
    """Least bore radius (m) of a shaft between two places along the axis, from its middle; 0 of a solid one."""
    pieces = zip(shaft.outline, shaft.sections, strict=False)
    found = [0.5 * min(s.inner_start, s.inner_end) for (start, end, *_), s in pieces if start < high and end > low]
    return min(found, default=0.0)


def _check_damping(train: GearTrain) -> None:
    ratios = np.atleast_1d(np.asarray(train.damping.ratio, dtype=float))
    for name, value in (
        ("ratio", ratios.min(initial=0.0)),
        ("alpha", train.damping.alpha),
        ("beta", train.damping.beta),
    ):
        if not (np.isfinite(value) and value >= 0.0):
            raise InputError(
                f"damping {name}", float(value), "must be finite and >= 0", "negative damping feeds energy in"
            )
    if ratios.max(initial=0.0) >= 1.0:
        raise InputError("damping ratio", float(ratios.max()), "must be < 1", "0.01 is 1 % of critical damping")
