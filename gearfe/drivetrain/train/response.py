"""Response of a gear train: contact forces, speeds, accelerations and the way back to the housing's field."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.shown import ShownTable
from ...base.typing import Array, BoolArray, IntArray

if TYPE_CHECKING:
    from .shaft_sections import ShaftSections

#: What has a row for each output time.
SAMPLED = (
    "time",
    "drive_angle",
    "contact_force",
    "transmission_error",
    "apart",
    "drive_torque",
    "mesh_power",
    "friction_power",
    "speed",
    "speed_absolute",
    "acceleration",
    "acceleration_absolute",
    "attachment_acceleration",
    "gear_pose",
    "section_coordinates",
    "modal",
    "modal_velocity",
    "modal_acceleration",
    "rotation",
    "bearing_load",
    "bore_acceleration",
    "machine_speed",
    "spring_torque",
)
#: Directions of forces and motions in names of columns.
XYZ = ("x", "y", "z")


@dataclass(frozen=True, eq=False, repr=False)
class TrainResponse(ShownTable):
    """Response of a gear train at n output times; SI units.

    Attributes
    ----------
    time : (n,)
        Times up to the time reached (s).
    drive_angle : (n,)
        Prescribed rotation of the drive (rad), the integral of its speed, positive about the axis of the train. The
        driving shaft turns with it where the drive is rigid; behind an elastic coupling it has its own `rotation`.
    mesh_names : tuple of m names
        Gear meshes, ``driver-driven``.
    drive_torque : (n,)
        Torque of the drive on its shaft (N m), about the axis.
    contact_force : (n, m)
        Force of each mesh along its line of action (N). Positive forces press the driving flanks together, negative
        ones the back flanks (or they pull, where a spring acts both ways).
    transmission_error : (n, m)
        Approach of both gears along the line of action (m), by turns, tilts and displacements: the dynamic transmission
        error. 0 where unmodified driving flanks touch.
    apart : (n, m)
        Whether the teeth of each mesh are apart.
    mesh_power, friction_power : (n, m)
        What the driver of each mesh gives to it, without what its elastic energy takes and returns, and what friction
        takes of it (W).
    shaft_names : tuple of s names
    speed, speed_absolute : (n, s)
        Spin of each shaft about the axis (rad/s): relative to its first bore, as a hinge measures it, and absolute.
    acceleration, acceleration_absolute : (n, s)
        Their time derivatives (rad/s2).
    attachment_names : tuple of b names
        Bores that carry a shaft, in the housing's order.
    attachment_acceleration : (n, b)
        Acceleration along the shaft axis at each bore's reference point (m/s2).
    gear_names : tuple of g names
    gear_pose : (n, g, 6)
        Displacement of each gear's centre (m) and its rotation (rad) about x, y, z. The part about the axis of the
        train is the whole rotation since the start; the others are small.
    gear_centres : (g, 3)
        Where the gears' centres are at rest (m).
    section_coordinates : (n, c) or None
        Coordinates of the shafts with cross-sections; None without any.
    sections : ShaftSections or None
        Their cross-sections, with the motion for these coordinates.
    modal, modal_velocity, modal_acceleration : (n, N) or None
        Coordinates of the reduced housing and their rates; None for a rigid housing.
    mesh_frequencies_Hz : (m,)
        Tooth-mesh frequencies at the drive's nominal speed.
    shaft_frequencies_Hz : (s,)
        Turns per second of the shafts at that speed.
    common_period_s : float or None
        Shortest time after which all meshes are in phase again; None when there is none within reason.
    coupled_frequencies_Hz : (c,)
        Natural frequencies of the whole system with the mean mesh stiffnesses, without damping and gyroscopic terms.
    status : str
        ``done``, ``diverged``, or what stopped the integration.
    time_reached : float
        Time up to which the results hold (s).
    load_end_s : float
        Time at which all ramps of loads, of forces on shafts and of the drive have ended (s).
    statistics, estimates : mapping
        ``steps``, ``method``, ``scheme``, ``seconds``, ``compile_seconds``, ``free_coordinates``,
        ``redundant_constraints`` (names),
        ``smallest_contact_force_N``; for each mesh ``friction_coefficients``,
        ``contacts_lost``, ``contacts_regained``, ``share_without_contact``
        and ``longest_without_contact_s`` (None for meshes that do not part); error estimates
        (``integration``, ``reduction``).
    warnings : tuple of str
    rotation : (n, s)
        Rotation of each shaft since the start (rad), against the bore that `speed` is measured against.
    bearing_load : (n, b, 6)
        Force (N) and moment (N m) of the shaft on each bore about its reference point, along x, y, z, without the
        reactions of drive and loads about the axis.
    bore_acceleration : (n, b, 6)
        Acceleration of each bore's reference point (m/s2) and angular acceleration (rad/s2), along x, y, z; 0 in a
        rigid housing.
    machine_speed : (n, machines)
        Speed of each machine (rad/s).
    spring_torque : (n, machines and couplings)
        Torque of a machine's spring on its shaft, or of a coupling on its second shaft (N m).
    machine_names, coupling_names
        Of the train.
    shared_meshes
        Numbers of the meshes among which planets share a load, a tuple for each kind.
    carrier_frequencies_Hz
        Turns of each carrier in a second.
    """

    time: Array
    drive_angle: Array
    mesh_names: tuple[str, ...]
    contact_force: Array
    transmission_error: Array
    apart: BoolArray
    drive_torque: Array
    mesh_power: Array
    friction_power: Array
    shaft_names: tuple[str, ...]
    speed: Array
    speed_absolute: Array
    acceleration: Array
    acceleration_absolute: Array
    attachment_names: tuple[str, ...]
    attachment_acceleration: Array
    gear_names: tuple[str, ...]
    gear_pose: Array
    gear_centres: Array
    modal: Array | None
    modal_velocity: Array | None
    modal_acceleration: Array | None
    mesh_frequencies_Hz: Array
    shaft_frequencies_Hz: Array
    common_period_s: float | None
    coupled_frequencies_Hz: Array
    status: str
    time_reached: float
    load_end_s: float
    statistics: Mapping[str, Any] = field(default_factory=dict)
    estimates: Mapping[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    rotation: Array | None = None
    bearing_load: Array | None = None
    bore_acceleration: Array | None = None
    section_coordinates: Array | None = None
    sections: ShaftSections | None = None
    machine_speed: Array | None = None
    spring_torque: Array | None = None
    machine_names: tuple[str, ...] = ()
    coupling_names: tuple[str, ...] = ()
    shared_meshes: tuple[tuple[int, ...], ...] = ()
    carrier_frequencies_Hz: Mapping[str, float] = field(default_factory=dict)

    AXES = ("time_s",)

    def facts(self) -> dict[str, str]:
        """How far the run came, and its largest numbers."""
        entries = {
            "status": f"{self.status} at {1e3 * self.time_reached:.4g} ms, {len(self.time)} times",
            "shafts": ", ".join(self.shaft_names),
            "attachments": ", ".join(self.attachment_names),
        }
        for name, force in zip(self.mesh_names, self.contact_force.T, strict=True):
            entries[f"mesh {name}"] = f"{force.min():.4g} to {force.max():.4g} N" if len(force) else "no times"
        return entries

    def columns(self) -> dict[str, Array]:
        """Forces, speeds, accelerations and transmission errors over time, each with its unit."""
        made = {"time_s": self.time, "drive_angle_deg": np.degrees(self.drive_angle)}
        for i in range(len(self.mesh_names)):
            made[f"contact_force_{i + 1}_N"] = self.contact_force[:, i]
        shafts = list(enumerate(self.shaft_names))
        made |= {f"speed_{name}_rad_per_s": self.speed[:, i] for i, name in shafts}
        made |= {f"acceleration_{name}_rad_per_s2": self.acceleration[:, i] for i, name in shafts}
        for i, name in enumerate(self.attachment_names):
            made[f"attachment_{name}_acceleration_m_per_s2"] = self.attachment_acceleration[:, i]
        made |= {f"speed_absolute_{name}_rad_per_s": self.speed_absolute[:, i] for i, name in shafts}
        made |= {f"acceleration_absolute_{name}_rad_per_s2": self.acceleration_absolute[:, i] for i, name in shafts}
        for i in range(len(self.mesh_names)):
            made[f"transmission_error_{i + 1}_um"] = 1e6 * self.transmission_error[:, i]
        for i, coefficient in enumerate(self.statistics.get("friction_coefficients", ())):
            if coefficient > 0.0:
                made[f"mesh_power_{i + 1}_W"] = self.mesh_power[:, i]
                made[f"friction_power_{i + 1}_W"] = self.friction_power[:, i]
        made["drive_torque_Nm"] = self.drive_torque
        if self.rotation is not None:
            made |= {f"rotation_{name}_deg": np.degrees(self.rotation[:, i]) for i, name in shafts}
        if self.machine_speed is not None and self.spring_torque is not None:
            speeds = enumerate(self.machine_names)
            made |= {f"machine_{name}_speed_rad_per_s": self.machine_speed[:, i] for i, name in speeds}
            springs = (f"machine_{name}" for name in self.machine_names), (f"coupling_{n}" for n in self.coupling_names)
            made |= {f"{name}_torque_Nm": self.spring_torque[:, i] for i, name in enumerate(chain(*springs))}
        for meshes in self.shared_meshes:
            made |= {f"load_share_{i + 1}": share for i, share in zip(meshes, self.load_shares(meshes).T, strict=True)}
        return made

    def load_shares(self, meshes: tuple[int, ...]) -> Array:
        """Force of each of n meshes over the mean of them, (times, n); 0 where none of them has a force."""
        force = self.contact_force[:, list(meshes)]
        mean = force.mean(axis=1, keepdims=True)
        return np.asarray(np.divide(force, mean, out=np.zeros_like(force), where=mean != 0.0))

    def bearing_forces(self) -> dict[str, Array]:
        """Force of the shaft on each bore over time, its components as columns."""
        if self.bearing_load is None:
            return {}
        return {
            f"bearing_{name}_force_{x}_N": self.bearing_load[:, i, k]
            for i, name in enumerate(self.attachment_names) for k, x in enumerate(XYZ)
        }  # fmt: skip

    def bearing_columns(self) -> dict[str, Array]:
        """Columns of bearings.csv: forces and moments on the bores, and all their accelerations."""
        made = {"time_s": self.time, **self.bearing_forces()}
        for i, name in enumerate(self.attachment_names):
            for k, x in enumerate(XYZ):
                if self.bearing_load is not None:
                    made[f"bearing_{name}_moment_{x}_Nm"] = self.bearing_load[:, i, 3 + k]
        for i, name in enumerate(self.attachment_names):
            for k, x in enumerate(XYZ):
                if self.bore_acceleration is not None:
                    made[f"attachment_{name}_acceleration_{x}_m_per_s2"] = self.bore_acceleration[:, i, k]
                    made[f"attachment_{name}_angular_acceleration_{x}_rad_per_s2"] = self.bore_acceleration[:, i, 3 + k]
        return made

    def every(self, count: int, first: int = 0) -> TrainResponse:
        """The response at each `count`-th of its times from number `first` on."""
        return self._at(slice(first, None, count))

    def at(self, rows: Sequence[int] | IntArray) -> TrainResponse:
        """The response at some of its times."""
        return self._at(np.asarray(rows, dtype=np.int64))

    def _at(self, rows: Any) -> TrainResponse:
        values = {name: getattr(self, name) for name in SAMPLED}
        return replace(self, **{name: v[rows] for name, v in values.items() if v is not None})


def joined(pieces: Sequence[TrainResponse]) -> TrainResponse:
    """One response of pieces that follow each other; what is no sample is that of the last one."""
    last = pieces[-1]
    if len(pieces) == 1:
        return last
    held = [name for name in SAMPLED if getattr(last, name) is not None]
    whole: dict[str, Any] = {name: np.concatenate([getattr(piece, name) for piece in pieces]) for name in held}
    return replace(last, **whole)
