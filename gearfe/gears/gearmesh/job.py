"""From a mesh of a job file to the arguments of `gears.gearmesh.sweep.sweep_stiffness`.

Curves are kept on disk: a second run with the same gears, load and mesh sizes reads its curve.

A stored curve is named by a hash of everything that affects it. This is the pair, materials, contact law, sizes and
positions, the versions of numpy, scipy and gmsh, and the source of the packages that compute it.
"""

from __future__ import annotations

import inspect
import math
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.cache import cache_key, cached_arrays, source_hash, versions
from ...base.config import read_toml
from ...base.errors import InputError, given
from ...base.progress import Stopwatch
from ...base.tables.gearbox import NamedMesh, check_alike_along
from ...base.tables.jobs import only_mesh
from ...base.tables.pair import MaterialTable, StiffnessTable
from ...fem.plane import Material
from ..contact.laws import ContactLaw, PairModel, check_alike, check_poisson, check_torque, law_named
from ..geometry.deviation_job import deviations_of
from ..geometry.face import NOMINAL, ToothDeviations
from ..geometry.pair import GearPair, pair_of
from .curve import StiffnessCurve

if TYPE_CHECKING:
    from ...base.tables.loadmap import LoadMapTable
    from ..contact.compliance import MeshingPair
    from .load_map import LoadMap

#: Packages whose text decides a curve.
PACKAGES = ("fem", "fem/meshing", "gears/contact", "gears/geometry", "gears/gearmesh", "gears/teeth")
#: Gives what a function makes, or what was made under that name before.
Keep = Callable[[str, Callable[[], Any]], Any]


@dataclass(frozen=True)
class StiffnessJob:
    """A mesh of a job file: its tables and what they mean in SI.

    Attributes
    ----------
    mesh
        The mesh and its gears as read.
    pair
        The gears, the driver as pinion.
    folder
        Where the files that the tables name are looked for.
    """

    mesh: NamedMesh
    pair: GearPair
    folder: Path = Path()

    @property
    def table(self) -> StiffnessTable:
        """[stiffness] of the mesh, with any overrides."""
        return self.mesh.stiffness

    @property
    def materials(self) -> tuple[Material, Material]:
        """Materials of pinion and wheel."""
        return materials_of(self.mesh)

    @property
    def law(self) -> ContactLaw:
        """Contact law with its parameter."""
        t = self.table
        parameters = dict(t.law_parameters)
        if t.law == "nitsche" and t.nitsche_gamma0 is not None:
            parameters["gamma0"] = t.nitsche_gamma0
        if t.law == "penalty" and t.penalty_stiffness_N_per_mm3 is not None:
            parameters["stiffness"] = 1e9 * t.penalty_stiffness_N_per_mm3
        return law_named(t.law, **parameters)

    @property
    def deviations(self) -> tuple[ToothDeviations, ToothDeviations]:
        """Deviations of the driving flanks of pinion and wheel."""
        return self._flanks() or NOMINAL

    @property
    def back_deviations(self) -> tuple[ToothDeviations, ToothDeviations] | None:
        """Those of the back flanks, of the pair seen from the other side; None for a file without deviations."""
        return self._flanks(back=True)

    def _flanks(self, *, back: bool = False) -> tuple[ToothDeviations, ToothDeviations] | None:
        if not self.mesh.deviates:
            return None
        other = {"left": "right", "right": "left"}[self.mesh.flank]
        return deviations_of(self.mesh, self.pair, self.folder, flank=other if back else None)

    @property
    def tables(self) -> dict[str, Any]:
        """The tables as plain data, for summaries."""
        mesh = asdict(self.mesh)
        gears = {mesh[role]["name"]: mesh.pop(role) for role in ("driver", "driven")}
        stiffness = mesh.pop("stiffness")
        mesh.pop("loads")
        both = self.mesh.gears[::-1] if self.mesh.ring_drives else self.mesh.gears
        roles = {role: gear.name for role, gear in zip(("driver", "driven"), both, strict=True)}
        return {"gears": gears, "mesh": {**mesh, **roles}, "stiffness": stiffness}

    @property
    def model(self) -> PairModel:
        """What `gearfe.gears.gearmesh.sweep.elastic_pair` makes of the gears.

        Raises
        ------
        InputError
            For gears whose load varies along the face width, which `gears.gearmesh.width_job` computes.
        """
        check_alike_along(self.mesh, "the law of plane sections", places=False)
        t = self.table
        for gear, material in zip(self.mesh.gears, self.materials, strict=True):
            check_poisson(material.poisson_ratio, t.plane, f"{gear.material_where}.poisson_ratio")
        sizes = t.coarsen, t.flank_coarsen, t.points_per_edge
        return PairModel(self.materials, t.plane, self.law, *sizes, self.deviations)

    def elastic(self, keep: Keep | None = None, watch: Stopwatch | None = None) -> MeshingPair:
        """The condensed gears, kept without deviations, which cost nothing."""
        from .sweep import elastic_pair

        model = self.model

        def make() -> MeshingPair:
            return elastic_pair(self.pair, replace(model, deviations=NOMINAL), watch=watch, store=keep is None)

        made: MeshingPair = make() if keep is None else keep("elastic", make)
        return replace(made, model=model)

    @property
    def sweep(self) -> dict[str, Any]:
        """Keyword arguments of `gearfe.gears.gearmesh.sweep.sweep_stiffness` beside `model`.

        Raises
        ------
        InputError
            When the job has neither a twist nor a torque, and for teeth that differ.
        """
        check_alike(self.deviations)
        self.check_load()
        t = self.table
        if t.torque_Nm is not None:
            check_torque(self.pair, self.model, t.torque_Nm, "stiffness.torque_Nm")
        return {
            "twist": None if t.twist_deg is None else math.radians(t.twist_deg),
            "torque": t.torque_Nm,
            "angles": np.radians(t.angles_deg(math.degrees(self.pair.mesh_cycle))),
            "kinematics": t.kinematics,
            "twist_from": t.twist_from,
            "solve_all": t.solve_all,
        }

    def check_load(self) -> None:
        """Raise `InputError` when the job has neither a twist nor a torque, or a twist that leaves the tooth."""
        t = self.table
        if t.twist_deg is None and t.torque_Nm is None:
            cure = "add twist_deg, torque_Nm or torque_pinion_Nm to [stiffness], or give --twist-deg or --torque-Nm"
            raise InputError("stiffness.twist_deg", None, "no load: neither twist_deg nor torque_Nm is given", cure)
        if t.twist_deg is not None:
            lost = math.degrees(self.pair.contact_twist) if t.twist_from == "contact" else 0.0
            most = 180.0 / self.pair.wheel.tooth_count - lost
            if not t.twist_deg < most:
                problem = f"must be < {most:.6g} deg, half a pitch of the wheel"
                raise InputError("stiffness.twist_deg", t.twist_deg, problem, "0.01 to 0.5 deg is usual")


def material_of(table: MaterialTable) -> Material:
    """The material that a table describes."""
    return Material(table.youngs_modulus_GPa * 1e9, table.poisson_ratio, density=table.density_kg_per_m3)


def materials_of(mesh: NamedMesh) -> tuple[Material, Material]:
    """Return the materials of driver and driven gear.

    Raises
    ------
    InputError
        For a gear whose material the file does not give.
    """
    for gear in mesh.gears:
        if gear.material is None:
            problem = f"has no stiffness: there is no table [pair] to compute it with, nor a material of {gear.where}"
            cure = "add curve, stiffness_N_per_m or rigid to it, or [pair], or write all gears as [gears.NAME]"
            raise InputError(f"mesh {mesh.name!r}", None, problem, cure)
    one, two = (material_of(given(gear.material, gear.material_where)) for gear in mesh.gears)
    return one, two


def stiffness_job(mesh: NamedMesh, folder: Path = Path(), pair: GearPair | None = None) -> StiffnessJob:
    """The job of a mesh as read; `pair`: its gears, where they were made before.

    Raises
    ------
    InputError
        For gears that cannot run together.
    """
    return StiffnessJob(mesh, pair_of(mesh) if pair is None else pair, folder)


def read_stiffness_job(path: str | Path, mesh: str | None = None) -> StiffnessJob:
    """Read a mesh of a job file, the only one where no name is given; without [stiffness] its defaults hold.

    Raises
    ------
    InputError
        For every mistake in the file, for gears that cannot run together, and a file with several meshes.
    """
    return stiffness_job(only_mesh(read_toml(path), path, mesh), Path(path).parent)


def job_map(job: StiffnessJob, table: LoadMapTable, *, keep: Keep | None = None) -> LoadMap:
    """Return the map of a mesh of a job file: torques and angles of `table`, its model, deviations of its flanks."""
    from .sweep import sweep_loads

    watch = Stopwatch()
    load_map = sweep_loads(
        job.pair,
        table.torques(),
        positions=table.positions,
        mesh_cycles=table.mesh_cycles,
        root_stress=table.root_stress,
        back=job.back_deviations,
        kinematics=job.table.kinematics,
        elastic=job.elastic(keep, watch),
    )
    return replace(load_map, timings={**watch.seconds, **load_map.timings})


def cached_curve(pair: GearPair, model: PairModel, **sweep: Any) -> StiffnessCurve:
    """Curve of `gearfe.sweep_stiffness` with these arguments, from disk when it was computed before."""

    def made() -> dict[str, Any]:
        from .sweep import sweep_stiffness

        curve = sweep_stiffness(pair, model, **sweep)
        return {own.name: np.asarray(getattr(curve, own.name)) for own in fields(curve) if own.name != "timings"}

    found = cached_arrays("curve", curve_key(pair, model, sweep), made)
    return StiffnessCurve(**{name: values if values.ndim else values.item() for name, values in found.items()})


def curve_key(pair: GearPair, model: PairModel, sweep: dict[str, Any]) -> str:
    """Hash (hex) of all that decides a curve."""
    law, text = type(model.law), ""
    with suppress(OSError, TypeError):  # laws of other packages have no version here, those without a file no text
        text = inspect.getsource(sys.modules[law.__module__])
    code = [law.__module__, law.__qualname__, text, source_hash(*PACKAGES), versions()]
    return cache_key("curve", {"pair": pair, "model": model, "sweep": sweep, "code": code})
