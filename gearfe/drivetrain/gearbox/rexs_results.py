"""What gearfe computes of a job and REXS has attributes for: geometry, statics, ratings, curves of stiffness.

Geometry and statics are always computed: speeds, torques, tooth forces and bearing forces. The latter use the mesh
stiffness of ISO 6336-1 in a rigid housing. A rating is made where the job has [rating]. Curves of stiffness are read
from the folders of `gearfe stiffness`.

u, v, w of REXS are y, z, x of a job.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...base.config import read_toml
from ...base.errors import InputError
from ...base.tables.gearbox import NamedMesh
from ...base.tables.jobs import job_tables, train_tables, whole_gearbox
from ...base.typing import Array
from ...gears.geometry.derived import derived_geometry
from ...gears.geometry.pair import GearPair, pair_of
from ...gears.geometry.validity import tip_clearance
from ...gears.rating.rate import Rating, rate_mesh
from ...output.exchange.rexs.results import GEAR_DATA, Result, gear_data
from ...output.results import Results, kinds_of, read_all
from ..train import build_train
from ..train.gear_train import as_matrix
from ..train.kinematics import drive_sense, fastest
from ..train.misalignment import pressed_direction, static_bearing_loads, static_mesh_forces, static_state
from ..train.model import TrainModel
from .job import TrainJob, train_job
from .mesh_loads import mesh_loads, with_train
from .rolling import SIGNS
from .springs_train import springs_train

#: Axes of REXS -> number of that of the job.
AXES = {"u": 1, "v": 2, "w": 0}
#: Freedoms of a bearing (x, y, z, tilts about x and z) by the names of REXS.
FREEDOMS = {"u": 1, "v": 2, "w": 0, "rot_v": 4, "rot_w": 3}
#: Value of a rating -> attribute of a stage without its edition, and unit.
OF_STAGE = {
    "K_A": ("application_factor", "none"),
    "K_gamma": ("mesh_load_factor", "none"),
    "K_v": ("dynamic_factor", "none"),
    "K_Hbeta": ("face_load_factor_contact_stress", "none"),
    "K_Fbeta": ("face_load_factor_root_stress", "none"),
    "K_Halpha": ("transverse_load_factor_contact_stress", "none"),
    "K_Falpha": ("transverse_load_factor_root_stress", "none"),
    "N": ("resonance_ratio", "none"),
    "m_red_kg_per_mm": ("reduced_gear_pair_mass", "kg / mm"),
    "c_prime_N_per_mm_um": ("single_stiffness", "N / (mm mum)"),
    "c_gamma_alpha_N_per_mm_um": ("mean_mesh_stiffness_for_transverse_load", "N / (mm mum)"),
    "c_gamma_beta_N_per_mm_um": ("mean_mesh_stiffness_for_face_load", "N / (mm mum)"),
    "f_pb_um": ("transverse_base_pitch_deviation", "um"),
    "y_p_um": ("running_in_allowance_pitch_deviation", "um"),
    "F_betay_um": ("effective_equivalent_misalignment", "um"),
    "Z_H": ("zone_factor_pitting", "none"),
    "Z_E": ("elasticity_factor_pitting", "(N / mm^2)^0.5"),
    "Z_eps": ("contact_ratio_factor_pitting", "none"),
    "Z_beta": ("helix_angle_factor_pitting", "none"),
    "Z_L": ("lubricant_factor_pitting", "none"),
    "Z_v": ("velocity_factor_pitting", "none"),
    "Z_R": ("roughness_factor_pitting", "none"),
    "sigma_H0_MPa": ("nominal_contact_stress", "MPa"),
    "f_eps": ("load_distribution_influence_factor_tooth_root", "none"),
    "Y_beta": ("helix_angle_factor_tooth_root", "none"),
    "Y_DT": ("deep_tooth_factor", "none"),
}
#: Value of a rating, one for each gear -> attribute of the gear in the stage without its edition, and unit.
OF_GEAR_DATA = {
    "Z_BD": ("tooth_contact_factor_pitting", "none"),
    "sigma_H_MPa": ("contact_stress", "MPa"),
    "sigma_HP_MPa": ("permissible_contact_stress", "MPa"),
    "Z_NT": ("life_factor_pitting", "none"),
    "Z_X": ("size_factor_pitting", "none"),
    "S_H": ("safety_factor_pitting", "none"),
    "h_Fe_mm": ("bending_moment_arm_tooth_root_stress", "mm"),
    "alpha_Fen_deg": ("load_direction_angle_bending_moment", "deg"),
    "s_Fn_mm": ("tooth_root_chord_critical_section", "mm"),
    "rho_F_mm": ("tooth_root_radius_critical_section", "mm"),
    "Y_F": ("form_factor_tooth_root", "none"),
    "Y_S": ("stress_correction_factor_tooth_root", "none"),
    "Y_NT": ("life_factor_tooth_root", "none"),
    "Y_delta_rel_T": ("relative_notch_sensitivity_factor_tooth_root", "none"),
    "sigma_F0_MPa": ("nominal_tooth_root_stress", "MPa"),
    "sigma_F_MPa": ("tooth_root_stress", "MPa"),
    "sigma_FP_MPa": ("permissible_tooth_root_stress", "MPa"),
    "S_F": ("safety_factor_tooth_root", "none"),
}
#: The same of the gear itself.
OF_GEAR = {
    "Y_R_rel_T": ("relative_surface_factor_tooth_root", "none"),
    "Y_B": ("rim_thickness_factor_tooth_root", "none"),
    "Y_X": ("size_factor_tooth_root", "none"),
}


@dataclass(frozen=True)
class RexsResults:
    """Results of a job, and what is not among them.

    Attributes
    ----------
    results
        For `gearfe.write_rexs`.
    notes
        A sentence for each part that could not be computed.
    """

    results: tuple[Result, ...]
    notes: tuple[str, ...] = ()


def rexs_results(job: str | Path | Mapping[str, Any], folder: str | Path | None = None) -> RexsResults:
    """Return those results of a job for which REXS has attributes.

    Parameters
    ----------
    job
        Job file, or its parsed tables.
    folder
        Folder of the results of its commands, as ``out/box``; None: only what is computed at once.

    Raises
    ------
    InputError
        For mistakes in the gears and meshes of the job.
    """
    path = "job" if isinstance(job, Mapping) else str(job)
    raw = dict(job) if isinstance(job, Mapping) else read_toml(job)
    box = whole_gearbox(raw, path)
    pairs = {name: pair_of(mesh) for name, mesh in box.meshes.items()}
    found: list[Result] = []
    notes: list[str] = []
    for name, mesh in box.meshes.items():
        found += _geometry(mesh, pairs[name])
    train = None
    if "train" in raw:
        try:
            train = train_job(path, train_tables(raw, path))
            found += _of_first_planets(_statics(train), raw)
        except InputError as error:
            notes.append(f"no statics of the train in the REXS file: {error}")
    if "rating" in raw:
        table = job_tables(raw, path, ("rating",))["rating"]
        for name, mesh in box.meshes.items():
            try:
                keys, names = table, (mesh.driver.name, mesh.driven.name)
                if train is not None:
                    keys = with_train(table, train, name, names, mesh.stiffness.torque_Nm is not None)
                found += _rated(rate_mesh(mesh, keys, box.gears, box.meshes, pairs[name]), name)
            except InputError as error:
                notes.append(f"no rating of mesh {name} in the REXS file: {error}")
    if folder is not None:
        changed = 0.0 if isinstance(job, Mapping) else Path(job).stat().st_mtime
        for name, mesh in box.meshes.items():
            for run in _stiffness_runs(Path(folder), name, len(box.meshes) == 1):
                if run.path.stat().st_mtime < changed:
                    notes.append(f"no stiffness of mesh {name} in the REXS file: the job file changed after {run.path}")
                    continue
                found += _computed(run, mesh)
    return RexsResults(tuple(found), tuple(notes))


def _of_first_planets(results: Iterable[Result], raw: Mapping[str, Any]) -> Iterator[Result]:
    """Give results of the first planet (``NAME_1``) the name under which the job describes all planets."""
    known = {(table, name) for table in ("gears", "meshes", "shafts", "bearings") for name in raw.get(table, {})}

    def named(table: str, name: str) -> str:
        first = name.removesuffix("_1")
        return first if (table, name) not in known and (table, first) in known else name

    for result in results:
        if result.table == GEAR_DATA:
            mesh, gear = result.name.split("/")
            yield replace(result, name=gear_data(named("meshes", mesh), named("gears", gear)))
        else:
            yield replace(result, name=named(result.table, result.name))


# --- geometry -------------------------------------------------------------------------------------------------------


def _geometry(mesh: NamedMesh, pair: GearPair) -> Iterator[Result]:
    """Geometry of a mesh and its gears (ISO 21771)."""
    facts = derived_geometry(pair)
    stage = {
        "gear_ratio": (pair.gear_ratio, "none"),
        "common_face_width": (1e3 * pair.common_width, "mm"),
        "radial_contact_ratio": (pair.contact_ratio, "none"),
        "overlap_contact_ratio": (pair.overlap_ratio, "none"),
        "total_contact_ratio": (pair.contact_ratio + pair.overlap_ratio, "none"),
        "length_of_path_of_contact": (facts["path_length_mm"], "mm"),
        "sum_of_addendum_modification_coefficients": (pair.pinion.profile_shift + pair.wheel.profile_shift, "none"),
        "normal_base_pitch": (facts["base_pitch_mm"] * math.cos(pair.pinion.base_helix_angle), "mm"),
    }
    for point, at in pair.path.items():
        both = at.pinion_roll + at.wheel_roll
        if both:
            radius = 1e3 * at.pinion_roll * at.wheel_roll / both
            stage[f"transverse_radius_of_relative_curvature_at_point_{point.lower()}"] = radius, "mm"
    for attribute, (value, unit) in stage.items():
        yield Result("meshes", mesh.name, attribute, float(value), unit, loaded=False)
    mates = (
        (mesh.driver.name, "pinion", pair.pinion, pair.wheel),
        (mesh.driven.name, "wheel", pair.wheel, pair.pinion),
    )
    for name, side, gear, mate in mates:
        of_gear = facts[side]
        for attribute, value, unit in (
            ("reference_diameter_cylindrical_gear", abs(of_gear["pitch_diameter_mm"]), "mm"),
            ("base_diameter", abs(of_gear["base_diameter_mm"]), "mm"),
            ("tip_diameter", abs(of_gear["tip_diameter_mm"]), "mm"),
            ("root_diameter", abs(of_gear["root_diameter_mm"]), "mm"),
            ("root_form_diameter", abs(of_gear["form_diameter_mm"]), "mm"),
            ("tip_form_diameter", abs(of_gear["active_tip_diameter_mm"]), "mm"),
            ("transverse_module", 1e3 * gear.transverse_module, "mm"),
            ("virtual_number_of_teeth", abs(gear.virtual_teeth), "none"),
            ("normal_tip_thickness", of_gear["tip_thickness_mm"] * math.cos(gear.helix_angle), "mm"),
        ):
            yield Result("gears", name, attribute, float(value), unit, loaded=False)
        for attribute, value, unit in (
            ("pitch_diameter", abs(of_gear["working_pitch_diameter_mm"]), "mm"),
            ("active_root_diameter", abs(of_gear["active_root_diameter_mm"]), "mm"),
            ("active_tip_diameter", abs(of_gear["active_tip_diameter_mm"]), "mm"),
            ("tip_clearance", 1e3 * tip_clearance(pair, gear, mate), "mm"),
            ("operating_pressure_angle_in_the_transverse_section", facts["working_pressure_angle_deg"], "deg"),
        ):
            yield Result(GEAR_DATA, gear_data(mesh.name, name), attribute, float(value), unit, loaded=False)
        points = {point: at.pinion_roll if side == "pinion" else at.wheel_roll for point, at in pair.path.items()}
        for point, roll in points.items():
            attribute = f"transverse_radius_of_curvature_at_point_{point.lower()}"
            where = gear_data(mesh.name, name)
            yield Result(GEAR_DATA, where, attribute, abs(1e3 * float(roll)), "mm", loaded=False)


# --- statics --------------------------------------------------------------------------------------------------------


def _along(stem: str, vector: Array, unit: str) -> Iterator[tuple[str, float, str]]:
    """Attributes of the parts of a vector along x, y, z of the job."""
    for axis, number in AXES.items():
        yield stem.format(axis), float(vector[number]), unit


def _statics(job: TrainJob) -> Iterator[Result]:
    """Speeds, torques, tooth forces and forces of the bearings in steady running."""
    rigid = job.rigid_train
    rolled, layout = rigid.kinematics, rigid.layout
    speed = drive_sense(layout.speed) * fastest(layout.speed)
    speeds = {shaft.name: speed * float(ratio) for shaft, ratio in zip(rigid.shafts, rolled.ratios, strict=True)}
    for shaft, value in speeds.items():
        yield Result("shafts", shaft, "rotational_speed", value, "rad / s")
        yield Result("shafts", shaft, "defines_speed", shaft == rigid.driven.shaft)
    for gear in rigid.gears:
        yield Result("gears", gear.name, "rotational_speed", speeds[gear.shaft], "rad / s")
    model = build_train(springs_train(job))
    q = static_state(model)
    carried = rolled.steady_forces if q is None else static_mesh_forces(model, q)
    loads = mesh_loads(rigid)
    pushes: dict[str, list[Array]] = {}
    turns: dict[str, float] = {}
    for number, line in enumerate(model.meshes):
        nominal, force = float(rolled.steady_forces[number]), float(carried[number])
        flank = math.copysign(1.0, nominal)
        push = flank * force * (pressed_direction(model, number) + flank * line.axial * model.train.frame[2])
        driver, driven = (model.train.gear(name) for name in (line.given.driver, line.given.driven))
        alike = -1.0 if driver.gear.internal or driven.gear.internal else 1.0
        turn = rolled.senses[number] * force
        torques = {driver: -turn * driver.gear.base_radius, driven: -alike * turn * driven.gear.base_radius}
        load = loads[line.name]
        pitch = math.cos(driver.gear.transverse_pressure_angle)
        of_mesh = {
            "nominal_tangential_force_at_base_diameter": (abs(nominal), "N"),
            "nominal_tangential_force_at_reference_diameter": (abs(nominal) * pitch, "N"),
            "tangential_velocity_at_reference_diameter": (
                math.pi / 30.0 * load.speed * abs((driver, driven)[load.drives].gear.reference_radius), "m / s"
            ),
        }  # fmt: skip
        for attribute, (value, unit) in of_mesh.items():
            yield Result("meshes", line.name, attribute, value, unit)
        for (gear, torque), sign in zip(torques.items(), (-1.0, 1.0), strict=True):
            where = gear_data(line.name, gear.name)
            yield Result(GEAR_DATA, where, "torque", torque, "N m")
            power = torque * speeds[gear.shaft]
            yield Result(GEAR_DATA, where, "power_for_rotational_speed", power, "W")
            for attribute, value, unit in _along("total_tooth_force_{}_direction", sign * push, "N"):
                yield Result(GEAR_DATA, where, attribute, value, unit)
            pushes.setdefault(gear.name, []).append(sign * push)
            turns[gear.name] = turns.get(gear.name, 0.0) + torque
    for name, forces in pushes.items():
        for attribute, value, unit in _along("force_acting_on_shaft_{}", np.sum(forces, axis=0), "N"):
            yield Result("gears", name, attribute, value, unit)
        yield Result("gears", name, "torque_acting_on_shaft_u", turns[name], "N m")
    if q is not None:
        yield from _bearings(model, q)


def _bearings(model: TrainModel, q: Array) -> Iterator[Result]:
    """Forces of all bearings; of rolling bearings their displacements and their stiffness, too."""
    for name, load in static_bearing_loads(model, q).items():
        values: list[tuple[str, float, str]] = []
        for side, sign in (("inner", -1.0), ("outer", 1.0)):
            values += _along(f"force_acting_on_{side}_component_{{}}", sign * load[:3], "N")
            torques = _along(f"torque_acting_on_{side}_component_{{}}", sign * load[3:], "N m")
            values += [item for item in torques if not item[0].endswith("_u")]
        values += [("axial_force", float(load[1]), "N"), ("radial_force_in_v", float(load[2]), "N"),
                   ("radial_force_in_w", float(load[0]), "N")]  # fmt: skip
        state = model.operating.bearings.get(name)
        if state is not None:
            moved = SIGNS * state.displacement
            values += [("axial_deflection", float(moved[1]), "m"), ("radial_deflection_in_v", float(moved[2]), "m"),
                       ("radial_deflection_in_w", float(moved[0]), "m")]  # fmt: skip
            values += _stiffness(np.outer(SIGNS, SIGNS) * np.array(as_matrix(state.stiffness)))
        for attribute, value, unit in values:
            yield Result("bearings", name, attribute, value, unit)


def _stiffness(matrix: Array) -> Iterator[tuple[str, float, str]]:
    """Attributes of a stiffness (5, 5) along x, y, z and for tilts about x and z."""
    for row, i in FREEDOMS.items():
        push = f"m_{row[-1]}" if i > 2 else f"f_{row}"
        for column, j in FREEDOMS.items():
            moved = column if j > 2 else f"d_{column}"
            unit = ("N / m", "N / rad", "N", "N m / rad")[2 * (i > 2) + (j > 2)]
            yield f"operating_point_stiffness_{push}_{moved}", float(matrix[i, j]), unit


# --- ratings and computed stiffness ---------------------------------------------------------------------------------


def _rated(rating: Rating, mesh: str) -> Iterator[Result]:
    """Values of a rating."""
    values: dict[str, Any] = {entry.name: entry.value for entry in rating.entries()}
    end = f"iso_6336_{rating.edition}"
    for key, (stem, unit) in OF_STAGE.items():
        if isinstance(values.get(key), float):
            yield Result("meshes", mesh, f"{stem}_{end}", values[key], unit)
    yield Result("meshes", mesh, f"work_hardening_factor_pitting_{end}", float(max(rating.flank.Z_W)), "none")
    force, velocity = rating.general.F_t_N, rating.general.v_m_per_s
    yield Result("meshes", mesh, "nominal_tangential_force_at_reference_diameter", force, "N")
    yield Result("meshes", mesh, "tangential_velocity_at_reference_diameter", velocity, "m / s")
    for i, name in enumerate(rating.names):
        where = gear_data(mesh, name)
        for key, (stem, unit) in OF_GEAR_DATA.items():
            yield Result(GEAR_DATA, where, f"{stem}_{end}", float(values[key][i]), unit)
        yield Result(GEAR_DATA, where, "number_of_load_cycles", float(rating.flank.N_L[i]), "none")
        for key, (stem, unit) in OF_GEAR.items():
            yield Result("gears", name, f"{stem}_{end}", float(values[key][i]), unit)


def _stiffness_runs(folder: Path, mesh: str, single: bool) -> list[Results]:
    """Results of the last `gearfe stiffness` of a mesh, in its own folder of results or where ``--out`` put them."""
    tops = folder / "stiffness", folder
    places = [place for top in tops for place in (top / mesh, *([top] if single else []))]
    place = next((place for place in places if place.is_dir() and kinds_of(place)), None)
    return [] if place is None else [run for run in read_all(place, "results") if run.kind.name == "stiffness"]


def _computed(run: Results, mesh: NamedMesh) -> Iterator[Result]:
    """Stiffness over the mesh cycle, and the face load factor under the largest torque."""
    table = run.main
    column = next((name for name in ("k_mesh_N_per_m", "k_tangent_N_per_m") if name in table), None)
    if column is None or "pinion_angle_deg" not in table:
        return
    solved = np.isfinite(table[column])
    angle, stiffness = table["pinion_angle_deg"][solved], table[column][solved]
    if not len(angle):
        return
    yield Result("meshes", mesh.name, "meshing_stiffness_characteristic", stiffness.tolist(), "N / m")
    ratio = -mesh.driver.teeth / mesh.driven.teeth
    for gear, turned in ((mesh.driver, angle), (mesh.driven, ratio * angle)):
        where = gear_data(mesh.name, gear.name)
        yield Result(GEAR_DATA, where, "rotational_meshing_position", turned.tolist(), "deg")
    by_torque = run.summary.get("by_torque")
    factors: Sequence[Any] = by_torque.get("K_H_beta", ()) if isinstance(by_torque, Mapping) else ()
    if factors and isinstance(factors[-1], float):
        yield Result("meshes", mesh.name, "face_load_factor_contact_stress", factors[-1])
