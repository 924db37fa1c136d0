"""From the tables of a job file to a gear train: ``[train]`` with its gears and meshes, ``[stiffness]``, ``[housing]``.

job = read_train_job("geometry/gear_train.toml", variant="operating")
model = build_train(job_train(job, train_curves(job), train_body(job)))
response = simulate(model, job.times, tolerance=job.table.tolerance)
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.errors import InputError, given
from ...base.tables.carrier import PINS, TrainCarrierTable
from ...base.tables.gearbox import Gearbox, NamedMesh
from ...base.tables.housing import HousingTable
from ...base.tables.jobs import read_train_tables
from ...base.tables.pair import MaterialTable, StiffnessTable
from ...base.tables.spectrum import SpectrumTable
from ...base.tables.timefunction import TrainFunctionTable
from ...base.tables.train import (
    POTENTIAL,
    ShaftSectionTable,
    TrainMeshTable,
    TrainShaftTable,
    TrainTable,
)
from ...base.typing import Array
from ...gears.gearmesh.curve import StiffnessCurve
from ...gears.gearmesh.law import MeshLaw
from ...gears.gearmesh.mesh_table import MeshTable
from ...gears.gearmesh.width_law import WidthLaw
from ...gears.geometry.deviation_job import pitch_errors_of
from ...gears.geometry.pair import Gear, gear_of, gear_pair, pair_of
from ...multibody import TimeFunction, smoothed_step
from ..housing.body import bore_points, reduced_housing
from ..train.checks import check_flanks, check_layout
from ..train.friction import Lubrication
from ..train.gear_train import (
    Carrier,
    Coupling,
    Damping,
    Drive,
    GearMesh,
    GearTrain,
    Guide,
    Load,
    Machine,
    Pin,
    Shaft,
    ShaftForce,
    ShaftGear,
)
from .over_speed import with_torques_over_speed
from .rolling import bearing_of
from .timefunctions import time_function

if TYPE_CHECKING:
    from ...fem.beams import Section
    from ...fem.reduction.modal_body import ModalBody

#: Radii that differ by no more are equal (relative).
ROUNDING = 1e-6
Stiffness = MeshLaw | WidthLaw | StiffnessCurve | MeshTable | float | None


@dataclass(frozen=True, eq=False)
class TrainJob:
    """A train job as read.

    Attributes
    ----------
    path
        The job file; curves that it names lie beside it.
    table
        [train], with the chosen variant's curves and damping.
    stiffness
        [stiffness], with the keys that the variant has instead.
    gearbox
        Gears and meshes by name; the meshes are in the order of those of `table`.
    housing
        [housing], None where the file has none.
    spectrum
        [spectrum], with its defaults where the file has none.
    operating_speed
        Of the drive (rad/s), at which torques over speed count as steady; None: see `.over_speed`.
    """

    path: Path
    table: TrainTable
    gearbox: Gearbox
    stiffness: StiffnessTable
    housing: HousingTable | None
    spectrum: SpectrumTable = field(default_factory=SpectrumTable)
    operating_speed: float | None = None

    @property
    def meshes(self) -> tuple[NamedMesh, ...]:
        """The meshes, in the order of those of the train."""
        return tuple(self.gearbox.meshes.values())

    @cached_property
    def gears(self) -> dict[str, Gear]:
        """The gears by name, all of which can run in their meshes.

        Raises
        ------
        InputError
            For gears that cannot be made, and gears that cannot run together.
        """
        made: dict[str, Gear] = {}
        for mesh in self.meshes:
            pair = pair_of(mesh)
            made |= {mesh.driver.name: pair.pinion, mesh.driven.name: pair.given_wheel}
        return made | {name: gear_of(named) for name, named in self.gearbox.gears.items() if name not in made}

    @cached_property
    def rigid_train(self) -> GearTrain:
        """The train with rigid meshes that rub nothing, in a rigid housing: enough for kinematics and statics.

        Raises
        ------
        InputError
            For mistakes in the train, and loads that press flanks of which nothing is known.
        """
        train = with_torques_over_speed(_rigid_train(self), self.table, self.path.parent, self.operating_speed)
        _check_rigid(self, train)
        return train

    @property
    def times(self) -> Array:
        """Output times (s), from 0 to the end, the end included where the steps meet it."""
        step = 1e-6 * self.table.step_us
        count = int(1e-3 * self.table.duration_ms / step * (1 + 1e-12) + 1e-9)
        return np.asarray(step * np.arange(count + 1), dtype=float)


def read_train_job(path: str | Path, variant: str | None = None) -> TrainJob:
    """Read a job file; `variant` None takes the one that the file names.

    Raises
    ------
    InputError
        For every mistake in the file, and an unknown variant.
    """
    return train_job(path, read_train_tables(path, variant))


def train_job(path: str | Path, tables: Mapping[str, Any]) -> TrainJob:
    """The job of tables that are read; curves that they name lie beside `path`."""
    housing, spectrum = tables.get("housing"), tables.get("spectrum", SpectrumTable())
    return TrainJob(Path(path), tables["train"], tables["gearbox"], tables["stiffness"], housing, spectrum)


def train_body(job: TrainJob) -> ModalBody | None:
    """Reduced housing of the job, from the cache when it was made before; None for a rigid one."""
    if job.table.housing == "rigid":
        return None
    return reduced_housing(given(job.housing, "housing"), job.path.parent)


def job_train(job: TrainJob, curves: Sequence[Stiffness] | None = None, body: ModalBody | None = None) -> GearTrain:
    """The train of a job with the stiffness of each mesh and its reduced housing; without `curves` its rigid train.

    Raises
    ------
    InputError
        For what `TrainJob.rigid_train` refuses, and pitch errors that cannot be read.
    """
    train = job.rigid_train
    if curves is not None:
        rows = zip(train.meshes, job.table.meshes, curves, strict=True)
        meshes = tuple(replace(mesh, **_given(curve), friction=_friction(table)) for mesh, table, curve in rows)
        named = job.gearbox.gears
        gears = tuple(
            replace(gear, pitch_errors=pitch_errors_of(named[gear.name], gear.gear, job.path.parent))
            for gear in train.gears
        )
        train = replace(train, gears=gears, meshes=meshes)
    return train if body is None else replace(train, housing=body, rigid_bores={})


def _rigid_train(job: TrainJob) -> GearTrain:
    t = job.table
    shafts = tuple(shaft_of(s) for s in t.shafts)
    gears = tuple(
        ShaftGear(name, g.shaft, 1e-3 * g.y_mm, job.gears[name], g.density_kg_per_m3)
        for name, g in job.gearbox.gears.items()
    )
    meshes = tuple(_mesh(job, m, named) for m, named in zip(t.meshes, job.meshes, strict=True))
    drive = None
    if t.drive is not None:
        ramp = (t.drive.ramp_centre_ms, t.drive.ramp_width_ms)
        speed = _over_time(job, t.drive.speed_rad_per_s, *ramp, "train.drive.speed_rad_per_s")
        torque = None
        if t.drive.by_torque:
            torque = _over_time(job, t.drive.torque_Nm or 0.0, 0.0, None, "train.drive.torque_Nm")
        bore = None if t.drive.attachment is None else str(t.drive.attachment)
        coupling = (t.drive.stiffness_Nm_per_rad, t.drive.damping_Nm_s_per_rad)
        slope = t.drive.torque_slope_Nm_s_per_rad
        drive = Drive(
            t.drive.shaft,
            bore,
            speed,
            *coupling,
            _metres(t.drive.y_mm),
            machine=t.drive.machine,
            torque=torque,
            slope=slope,
        )
    loads = tuple(
        Load(
            x.shaft,
            None if x.attachment is None else str(x.attachment),
            _over_time(job, x.torque_Nm or 0.0, x.ramp_centre_ms, x.ramp_width_ms, f"train.loads[{i}].torque_Nm"),
            tuple((order, amplitude, math.radians(phase)) for order, amplitude, phase in x.orders_Nm_deg),
            x.mesh,
            _metres(x.y_mm),
            x.machine,
            x.torque_slope_Nm_s_per_rad,
        )
        for i, x in enumerate(t.loads)
    )
    forces = tuple(
        ShaftForce(
            x.shaft,
            1e-3 * x.y_mm,
            x.values,
            _over_time(job, 1.0, x.ramp_centre_ms, x.ramp_width_ms, f"train.forces[{i}]"),
        )
        for i, x in enumerate(t.forces)
    )
    damping = Damping(t.damping.ratio, t.damping.rayleigh_alpha_per_s, t.damping.rayleigh_beta_s, t.damping.gyroscopic)
    bearings = tuple(bearing_of(str(b.attachment), b) for b in t.bearings)
    return GearTrain(
        shafts, gears, meshes, drive, loads, None, _rigid_bores(job), bearings, damping,
        carriers=tuple(_carrier(carrier, t) for carrier in t.carriers),
        guides=tuple(
            Guide(s.name, s.guided, s.holding_stiffness_Nm_per_rad, s.holding_damping_Nm_s_per_rad)
            for s in t.shafts
            if s.guided is not None
        ),
        machines=tuple(
            Machine(
                m.name, m.shaft, m.inertia_kg_m2, m.stiffness_Nm_per_rad, m.damping_Nm_s_per_rad,
                m.initial_speed_rad_per_s, _metres(m.y_mm),
            )
            for m in t.machines
        ),
        couplings=tuple(
            Coupling(c.name, c.shafts, c.stiffness_Nm_per_rad, c.damping_Nm_s_per_rad) for c in t.couplings
        ),
        forces=forces,
    )  # fmt: skip


def _carrier(table: TrainCarrierTable, train: TrainTable) -> Carrier:
    """A carrier with the pins of all shafts that name it."""
    planets = [shaft.name for shaft in train.shafts if shaft.carrier == table.name]
    springs, dampers = (table.springs(key) for key in PINS)
    pins = []
    for number, name in enumerate(planets):
        errors = (table.pin_radial_errors_um, table.pin_tangential_errors_um)
        radial, tangential = (1e-6 * values[number % len(values)] if values else 0.0 for values in errors)
        pins.append(Pin(name, springs, 0.0 if dampers is None else dampers, (radial, tangential)))
    return Carrier(table.name, table.shaft, tuple(pins))


def _metres(length_mm: float | None) -> float | None:
    return None if length_mm is None else 1e-3 * length_mm


def shaft_of(table: TrainShaftTable) -> Shaft:
    """Shaft of a table whose materials are known."""
    material = MaterialTable() if table.material is None else table.material
    assert isinstance(material, MaterialTable)
    density = material.density_kg_per_m3 if table.density_kg_per_m3 is None else table.density_kg_per_m3
    elastic: dict[str, Any] = {}
    if table.sections:
        steel = replace(material, density_kg_per_m3=density)
        elastic = {"sections": tuple(_section(section, steel) for section in table.sections)}
        elastic |= {"elements": table.elements, "damping_ratio": table.damping_ratio}
        if table.highest_frequency_Hz is not None:
            elastic["highest_hz"] = table.highest_frequency_Hz
    return Shaft(
        table.name,
        (1e-3 * table.x_mm, 1e-3 * table.y_mm, 1e-3 * table.z_mm),
        1e-3 * table.whole_length_mm,
        1e-3 * table.largest_radius_mm,
        tuple(str(a) for a in table.attachments),
        density,
        table.initial_speed_rad_per_s,
        table.mass_kg,
        table.polar_inertia_kg_m2,
        table.transverse_inertia_kg_m2,
        **elastic,
    )


def _section(table: ShaftSectionTable, shaft: MaterialTable) -> Section:
    from ...fem.beams import Section

    material = shaft if table.material is None else table.material
    assert isinstance(material, MaterialTable)
    (outer_start, outer_end), (inner_start, inner_end) = table.outer_mm, table.inner_mm
    return Section(
        1e-3 * table.length_mm, 1e-3 * outer_start, 1e-3 * outer_end, 1e-3 * inner_start, 1e-3 * inner_end,
        young=1e9 * material.youngs_modulus_GPa, poisson=material.poisson_ratio, density=material.density_kg_per_m3,
    )  # fmt: skip


def _check_rigid(job: TrainJob, train: GearTrain) -> None:
    meshes = tuple(replace(mesh, backlash=None, damping=0.0, damping_acts=None) for mesh in train.meshes)
    check_layout(replace(train, meshes=meshes))
    _check_bores(job, train)
    check_flanks(train, np.array([not back_flanks(job, train, i) for i in range(len(meshes))], dtype=bool))


def _check_bores(job: TrainJob, train: GearTrain) -> None:
    """Raise `InputError` for a section that is wider than the bore of [housing] that it is in."""
    if job.housing is None or job.table.rigid_bores:
        return
    spaces = bore_spaces(job.housing)
    for shaft in (shaft for shaft in train.shafts if shaft.sections):
        for bore in (bore for bore in shaft.bores if bore in spaces):
            radius, low, high = spaces[bore]
            widest = shaft.radius_within(low - shaft.point[1], high - shaft.point[1])
            if widest > radius * (1.0 + ROUNDING):
                problem = (
                    f"is wider than attachment {bore!r} from y = {1e3 * low:.6g} to {1e3 * high:.6g} mm: must be <= "
                    f"{2e3 * radius:.6g} mm there"
                )
                cure = "give the section a smaller diameter, or [housing] a wider bore (bore_radius_mm)"
                raise InputError(f"shaft {shaft.name!r} outer_diameter_mm", 2e3 * widest, problem, cure)


def bore_spaces(table: HousingTable) -> dict[str, tuple[float, float, float]]:
    """Name -> radius and ends along y (m) of the bores whose radii a [housing] table has."""
    if table.reduced:
        return {}
    if table.mesh.file is None:
        ranges = [(shaft.bore_radius_mm, *ends) for shaft in table.shafts for ends in table.bore_ranges(shaft)]
        return {
            str(number): (1e-3 * radius, 1e-3 * low, 1e-3 * high)
            for number, (radius, low, high) in enumerate(ranges, 1)
        }
    spaces = {}
    for number, bore in enumerate(table.bores, start=1):
        if bore.radius_mm is not None and bore.point_mm is not None:
            ends = (0.0, 0.0) if bore.range_mm is None else bore.range_mm
            low, high = sorted(bore.point_mm[1] + math.copysign(end, end * bore.direction[1]) for end in ends)
            spaces[bore.name or str(number)] = 1e-3 * bore.radius_mm, 1e-3 * low, 1e-3 * high
    return spaces


def back_flanks(job: TrainJob, train: GearTrain, number: int) -> bool:
    """Whether a mesh has back flanks: behind its given backlash, or with a mesh law behind that of its gears."""
    table, mesh = job.table.meshes[number], train.meshes[number]
    if table.backlash_um is not None:
        return True
    if job.table.model_of(table) != POTENTIAL:
        return False
    pair = gear_pair(train.gear(mesh.driver).gear, train.gear(mesh.driven).gear, mesh.centre_distance)
    return pair.base_backlash > 0.0


def _mesh(job: TrainJob, table: TrainMeshTable, named: NamedMesh) -> GearMesh:
    distance = named.centre_distance_mm
    normal = math.cos(job.gears[table.driver].base_helix_angle)
    return GearMesh(
        named.driver.name,
        named.driven.name,
        None,
        None if table.phase_deg is None else math.radians(table.phase_deg),
        table.damping_N_s_per_m,
        job.table.curves.interpolation,
        None if distance is None else 1e-3 * distance,
        None if table.backlash_um is None else 1e-6 * table.backlash_um / normal,
        damping_acts=table.damping_acts,
        name=named.name,
        ring_drives=named.ring_drives,
    )


def _given(curve: Stiffness) -> dict[str, Any]:
    """Fields of a mesh that its stiffness gives."""
    if isinstance(curve, MeshTable):
        errors = {"transmission_error": curve.transmission_error, "tilting": curve.tilting}
        return {"stiffness": curve.stiffness, **errors}
    return {"stiffness": curve}


def _friction(table: TrainMeshTable) -> float | Lubrication:
    if table.oil_viscosity_mPa_s is None or table.roughness_um is None:
        return table.friction or 0.0
    factor = 1.0 if table.oil_factor is None else table.oil_factor
    return Lubrication(1e-3 * table.oil_viscosity_mPa_s, 1e-6 * table.roughness_um, factor)


def _over_time(
    job: TrainJob, value: float | TrainFunctionTable, centre_ms: float, width_ms: float | None, where: str
) -> TimeFunction:
    """A number with its ramp, or a function of time."""
    if width_ms is None or isinstance(value, TrainFunctionTable):
        return time_function(value, where, job.path.parent, float(job.times[-1]))
    return smoothed_step(1e-3 * centre_ms, 1e-3 * width_ms, value)


def _rigid_bores(job: TrainJob) -> dict[str, tuple[float, float, float]]:
    """Bores of a rigid housing: those of the table, else the places of [housing]'s bores."""
    found = {str(b.attachment): (1e-3 * b.x_mm, 1e-3 * b.y_mm, 1e-3 * b.z_mm) for b in job.table.rigid_bores}
    if found:
        return found
    if job.housing is None:
        problem = "are not given: neither [[train.rigid_bores]] nor [housing] gives the positions of the bores"
        raise InputError("train.rigid_bores", None, problem, "add one entry for each attachment")
    return bore_places(job.housing, job.path.parent)


def bore_places(table: HousingTable, folder: Path = Path()) -> dict[str, tuple[float, float, float]]:
    """Name -> reference point (m) of the bores of a [housing] table: their middles, numbered as attachments.

    Files that the table names are looked for in `folder`.
    """
    if table.reduced or table.mesh.file is not None:
        return bore_points(table, folder)
    ranges = [(shaft, *ends) for shaft in table.shafts for ends in table.bore_ranges(shaft)]
    return {
        str(number): (1e-3 * shaft.x_mm, 0.5e-3 * (low + high), 1e-3 * shaft.z_mm)
        for number, (shaft, low, high) in enumerate(ranges, start=1)
    }
