"""Every key of [pair] and [stiffness] that can change the curve does change it: none is read and then forgotten."""

import re
from dataclasses import fields, replace

import numpy as np
import pytest

from gearfe.base.config import build
from gearfe.base.errors import InputError
from gearfe.base.tables.gearbox import pair_gearbox
from gearfe.base.tables.pair import PairTable, StiffnessTable
from gearfe.gears.gearmesh.job import StiffnessJob, stiffness_job
from gearfe.gears.gearmesh.positions import twists_for_torque
from gearfe.gears.gearmesh.sweep import sweep_stiffness
from gearfe.gears.rating.stiffness import iso_values
from tests.makers.solving import given_positions

#: A pair in which every feature is on, so that each change is a small step from it.
BASE = {
    "pressure_angle_deg": 22.0,
    "face_width_mm": 10.0,
    "module_mm": 2.5,
    "addendum": 1.0,
    "dedendum": 1.25,
    "rack_tip_radius": 0.25,
    "profile_shift": 0.1,
    "tip_shortening": 0.02,
    "tip_round_mm": 0.1,
    "tip_relief_amount_um": 8.0,
    "tip_relief_length_mm": 2.0,
    "tip_relief_exponent": 1.5,
    "tooth_thinning_um": 10.0,
    "centre_distance_mm": 63.05,
    "pinion": {"teeth": 20, "bore_diameter_mm": 12.0},
    "wheel": {"teeth": 30, "bore_diameter_mm": 18.0},
    "material": {"youngs_modulus_GPa": 200.0, "poisson_ratio": 0.3},
}
SWEEP = {
    "torque_Nm": 150.0,
    "law": "penalty",
    "coarsen": 3.0,
    "angle_start_deg": 1.0,
    "angle_step_deg": 3.5,
}

PAIR_CHANGES = {
    "pressure_angle_deg": 22.5,
    "face_width_mm": 11.0,
    "addendum": 1.03,
    "dedendum": 1.3,
    "rack_tip_radius": 0.2,
    "profile_shift": 0.08,
    "tip_shortening": 0.06,
    "tip_round_mm": 0.2,
    "tip_relief_amount_um": 10.0,
    "tip_relief_length_mm": 2.5,
    "tip_relief_exponent": 1.0,
    "tooth_thinning_um": 20.0,
    "centre_distance_mm": 63.08,
    "module_mm": None,  # given as pitch diameters, the wrong key for both would fail
    "pinion.bore_diameter_mm": 15.0,
    "wheel.bore_diameter_mm": 22.0,
    "wheel.teeth": 29,
    "pinion.profile_shift": 0.13,
    "wheel.tip_relief_amount_um": 12.0,
    "material.youngs_modulus_GPa": 210.0,
    "material.poisson_ratio": 0.27,
    "wheel.material": {"youngs_modulus_GPa": 180.0},
}
SWEEP_CHANGES = {
    "torque_Nm": 170.0,
    "plane": "stress",
    "law": "nitsche",
    "kinematics": "small",
    "penalty_stiffness_N_per_mm3": 1e7,
    "coarsen": 2.5,
    "flank_coarsen": 0.8,
    "points_per_edge": 3,
    "angle_start_deg": 1.2,
}


def job_of(table: PairTable, stiffness: StiffnessTable) -> StiffnessJob:
    (mesh,) = pair_gearbox(table).meshes.values()
    return stiffness_job(replace(mesh, stiffness=stiffness))


def curve(pair_changes=None, sweep_changes=None):
    data = {key: dict(value) if isinstance(value, dict) else value for key, value in BASE.items()}
    for key, value in (pair_changes or {}).items():
        table, _, name = key.rpartition(".")
        (data[table] if table else data)[name] = value
    if data["module_mm"] is None:
        del data["module_mm"]
        data["pinion"]["pitch_diameter_mm"], data["wheel"]["pitch_diameter_mm"] = 50.02, 75.03
    table = build(PairTable, data, "pair")
    job = job_of(table, build(StiffnessTable, SWEEP | (sweep_changes or {}), "stiffness"))
    found = sweep_stiffness(job.pair, job.model, **job.sweep)
    assert set(found.status) == {"converged"}
    return found


@pytest.fixture(scope="module")
def base():
    return curve()


@pytest.mark.parametrize("key", PAIR_CHANGES)
def test_each_key_of_the_pair_counts(key, base):
    changed = curve({key: PAIR_CHANGES[key]})
    assert len(changed) == len(base)
    assert np.abs(changed.k_mesh / base.k_mesh - 1).max() > 1e-4


@pytest.mark.parametrize("key", SWEEP_CHANGES)
def test_each_key_of_the_sweep_counts(key, base):
    changed = curve(None, {key: SWEEP_CHANGES[key]})
    assert np.abs(changed.k_mesh / base.k_mesh - 1).max() > 1e-6


def test_every_key_is_in_this_file():
    given = {key.rpartition(".")[2] for key in (*PAIR_CHANGES, *BASE)}
    per_gear = {"material", "pinion", "wheel", "teeth", "bore_diameter_mm", "pitch_diameter_mm", "density_kg_per_m3"}
    along_width = {"helix_angle_deg", "misalignment_um", "misalignment_across_um"}  # tests/gears/test_width_job.py
    assert set(PairTable.__dataclass_fields__) <= given | per_gear | along_width
    elsewhere = {"twist_deg", "twist_from", "nitsche_gamma0", "law_parameters", "solve_all", "interpolation"}
    elsewhere |= {"angle_stop_deg", "angle_step_deg", "torque_pinion_Nm"}
    assert {field.name for field in fields(StiffnessTable)} <= {*SWEEP_CHANGES, *elsewhere}


def test_a_torque_beyond_small_strain_names_its_key():
    """From where the mean stiffness of ISO 6336, of E' = E/(1 - nu^2), yields by 0.25 modules; and from Python."""
    pair = build(PairTable, {**BASE, "pinion": {**BASE["pinion"], "face_width_mm": 20.0}}, "pair")
    job = job_of(pair, StiffnessTable(torque_Nm=1e6))
    strain = 200e9 / (1 - 0.3**2)  # of the wheel; the pinion, twice as wide as the contact, is twice as stiff
    level = iso_values(job.pair, 2 * strain, strain)["c_gamma_times_width_N_per_m"]
    most = f"must be <= {level * 0.25 * 2.5e-3 * job.pair.wheel.base_radius:.3g} N m"
    with pytest.raises(InputError, match=f"stiffness.torque_Nm = 1000000.0: {re.escape(most)}.*0.25 modules"):
        _ = job.sweep
    with pytest.raises(InputError, match=f"^torque = 1000000.0: {re.escape(most)}"):
        sweep_stiffness(job.pair, job.model, torque=1e6)


def test_a_torque_in_a_jump_is_given_up_soon():
    """A corner that snaps on: below a twist of 1 mrad the torque is 1e6 times it, above 0.2 % more."""
    asked = []

    def solve(numbers, twists):
        asked.extend(twists)
        torque = 1e6 * twists * np.where(twists > 1e-3, 1.002, 1.0)
        return replace(given_positions(twists), torque_wheel=torque, tangent=torque / twists)

    for goal, status in ((1001.0, "torque_not_reached"), (999.0, "converged"), (1003.0, "converged")):
        asked.clear()
        first = solve(np.zeros(1, dtype=int), np.array([0.7e-3]))
        found = twists_for_torque(solve, first, np.array([goal]), first_contact=np.zeros(1), most=0.1)
        assert list(found.status) == [status]
        assert len(asked) <= 15
