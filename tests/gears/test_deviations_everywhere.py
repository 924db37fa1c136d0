"""One [microgeometry] table for every command: curves, maps, trains take the same deviations."""

from __future__ import annotations

import csv
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gearfe import InputError
from gearfe.cli.main import main
from gearfe.drivetrain.gearbox.job import job_train, read_train_job
from gearfe.drivetrain.gearbox.mesh_stiffness import train_curves
from gearfe.drivetrain.train.statics import static_errors
from gearfe.gears.contact.half_plane import half_plane_pair
from gearfe.gears.gearmesh.law_make import mesh_law
from gearfe.gears.gearmesh.sweep import elastic_pair, sweep_loads, sweep_stiffness
from gearfe.gears.geometry import pitch_errors
from gearfe.gears.geometry.deviation_job import deviations_of
from gearfe.gears.geometry.face import NOMINAL
from gearfe.gears.geometry.modifications import FlankModification, Relief, tooth_deviations
from gearfe.multibody import constant
from tests.makers.gears import pair as gear_pair
from tests.makers.job_texts import BARE_TRAIN, BORES

PAIR = gear_pair(tip_round=1e-4)

JOB = """
[pair]
pressure_angle_deg = 25.0
face_width_mm = 10.0
tip_round_mm = 0.1
pinion = { teeth = 20, pitch_diameter_mm = 50.0, bore_diameter_mm = 10.0 }
wheel = { teeth = 30, pitch_diameter_mm = 75.0, bore_diameter_mm = 15.0 }
[stiffness]
torque_Nm = 80.0
angle_step_deg = 3.0
kinematics = "small"
coarsen = 2.0
[loadmap]
torques_Nm = [80.0]
positions = 6
[microgeometry]
torques_Nm = [80.0]
positions = 6
[microgeometry.pinion]
tip_relief_um = 12.0
tip_relief_length_mm = 3.0
profile_slope_um = 4.0
waviness = [{ amplitude_um = 1.0, waves = 40 }]
[microgeometry.wheel]
profile_crowning_um = 5.0
root_relief_um = 6.0
root_relief_length_mm = 2.0
root_relief_shape = "parabolic"
"""


def columns(path: Path) -> dict[str, np.ndarray]:
    with path.open() as stream:
        rows = list(csv.DictReader(stream))
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def test_every_command_takes_the_same_deviations(tmp_path, capsys) -> None:
    """Twist, its unloaded part, load shares and pressures of the curve are those of the map."""
    job = tmp_path / "job.toml"
    job.write_text(JOB)
    for command in ("stiffness", "loadmap"):
        assert main([command, str(job), "--out", str(tmp_path / command), "--no-pictures"]) == 0
    # -12 + 2 um at the pinion's tip, a wave of 1 um besides; -5 - 6 um at the wheel's form circle
    told = re.findall(r"up to ([0-9.]+) um \(pinion\) and ([0-9.]+) um \(wheel\)", capsys.readouterr().out)
    assert len(told) == 2
    assert float(told[0][0]) == pytest.approx(10, abs=1)
    assert float(told[0][1]) == pytest.approx(11)
    one, own = (columns(tmp_path / c / f"{c}.csv") for c in ("stiffness", "loadmap"))
    for name in ("twist_deg", "transmission_error_unloaded_um", "load_share_1"):
        expected = own[name].astype(float)
        close = 3e-4 if name == "load_share_1" else 1e-5  # shares are of a torque that a map accepts within 3e-4
        assert one[name].astype(float) == pytest.approx(expected, rel=close, abs=1e-9), name
    assert np.ptp(own["transmission_error_unloaded_um"].astype(float)) > 1.0
    pressure, others = (t["peak_pressure_MPa"].astype(float) for t in (own, one))
    both = np.isfinite(pressure) & (one["edge"] == "none")
    assert both.sum() >= 3
    assert others[both] == pytest.approx(pressure[both], rel=1e-3)


def test_a_mesh_law_has_the_transmission_error_of_its_flanks() -> None:
    """Approach under a force against contact solutions at that torque; a kink is a corner of the law."""
    start = PAIR.pinion.profile.tip_roll - 2.5e-3
    relieved = tooth_deviations(PAIR.pinion, FlankModification(tip_relief=Relief(15e-6, start)))
    elastic = elastic_pair(PAIR, deviations=(relieved, NOMINAL[1]), coarsen=2.0)
    made = mesh_law(half_plane_pair(elastic), 2000.0)
    torque, radius = 60.0, PAIR.wheel.base_radius
    (found,) = sweep_loads(PAIR, [torque], positions=40, elastic=elastic, kinematics="small").curves
    expected = found.transmission_error
    assert np.ptp(expected) > 2e-6
    approach = made.approach(found.pinion_angle, np.full(40, torque / radius))
    assert approach == pytest.approx(expected, abs=0.02e-6)
    kink = PAIR.pinion_angle_at(start)
    away = np.mod(made.nodes - kink + 0.5 * made.cycle, made.cycle) - 0.5 * made.cycle
    assert np.abs(away).min() < 1e-12


def test_material_that_stands_out_leaves_the_stiffness(tmp_path) -> None:
    """All teeth 15 um thicker: at any load, light ones too, the same stiffness, and a transmission error less by it."""
    thick = tooth_deviations(PAIR.pinion, FlankModification(), pitch_errors.turns(PAIR.pinion, np.full(20, 15e-6)))
    angles = np.linspace(0, 0.25, 7)
    elastic = elastic_pair(PAIR, coarsen=2.0)
    out = replace(elastic, model=elastic.model.changed(deviations=(thick, NOMINAL[1])))
    for torque in (1.0, 80.0):
        plain, made = (
            sweep_stiffness(PAIR, torque=torque, angles=at, elastic=one, kinematics="small")
            for one, at in ((elastic, angles + 15e-6 / PAIR.pinion.reference_radius), (out, angles))
        )
        assert made.k_mesh == pytest.approx(plain.k_mesh, rel=1e-6)
        moved = 15e-6 * math.cos(PAIR.pinion.pressure_angle)
        assert made.transmission_error == pytest.approx(plain.transmission_error - moved, abs=1e-11)
    found = sweep_loads(PAIR, [20.0, 80.0], angles=angles, elastic=out, kinematics="small")
    assert found.curves[1].k_mesh == pytest.approx(made.k_mesh, rel=1e-9)


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ("run_out_um = 3.0", "pinion.*stand unevenly.*gearfe loadmap takes them"),
        ("waviness = [{ amplitude_um = 1.0, waves = 11 }]", "pinion.*different flanks"),
    ],
)
def test_teeth_that_differ_have_no_curve(keys, told, tmp_path, capsys) -> None:
    job = tmp_path / "job.toml"
    text = JOB.replace("waviness = [{ amplitude_um = 1.0, waves = 40 }]", keys)
    job.write_text(text)
    assert main(["stiffness", str(job), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert re.search(told, error)
    assert not (tmp_path / "out").exists()


def test_laws_on_meshes_have_no_deviations(tmp_path) -> None:
    relieved = tooth_deviations(PAIR.pinion, FlankModification(crowning=5e-6))
    with pytest.raises(InputError, match='law = "half_plane"'):
        sweep_stiffness(PAIR, torque=50.0, law="nitsche", deviations=(relieved, NOMINAL[1]), coarsen=3.0)
    with pytest.raises(InputError, match='law = "half_plane"'):
        sweep_loads(PAIR, [50.0], law="penalty", deviations=(relieved, NOMINAL[1]), coarsen=3.0)


def train_text(more: str, **curves: str) -> str:
    pair = JOB.split("[stiffness]", maxsplit=1)[0]
    text = BARE_TRAIN.replace("stiffness_N_per_m = 2e8", "")
    for name, gear, rest in (("a", "pinion", 18), ("b", "wheel", 27)):
        form = f"teeth = {rest}\nmodule_mm = 2.0\npressure_angle_deg = 20.0\nface_width_mm = 12.0\n"
        text = text.replace(form, f'gear = "{gear}"\n', 1)
        assert name in text
    text = text.replace("x_mm = 45.0", "x_mm = 62.5")
    table = "[train.curves]\n" + "".join(f"{key} = {value}\n" for key, value in curves.items())
    stiffness = '[stiffness]\nkinematics = "small"\ncoarsen = 2.0\n'
    return pair + stiffness + text + BORES.replace("45.0", "62.5") + table + more


def test_a_train_takes_the_flanks_that_drive(tmp_path) -> None:
    """The drive turns against the axis, so the right flanks bear: relief on the left ones changes nothing."""
    relief = "[microgeometry.pinion.{}]\ntip_relief_um = 20.0\ntip_relief_length_mm = 3.0\n"
    curves = {"mesh_model": '"variable_stiffness"', "load": '"torque"', "positions": "8"}
    found = {}
    for side in ("none", "left", "right"):
        job = tmp_path / f"{side}.toml"
        job.write_text(train_text("" if side == "none" else relief.format(side), **curves))
        found[side] = train_curves(read_train_job(job))[0]
    assert found["left"].twist == pytest.approx(found["none"].twist, rel=1e-12)
    torque = float(found["right"].torque_wheel[0])
    gear = PAIR.pinion
    own = tooth_deviations(gear, FlankModification(tip_relief=Relief(20e-6, gear.profile.tip_roll - 3e-3)))
    (expected,) = sweep_loads(
        PAIR, [torque], positions=8, kinematics="small", coarsen=2.0, deviations=(own, NOMINAL[1])
    ).curves
    assert found["right"].twist == pytest.approx(expected.twist, rel=1e-5)
    assert np.abs(found["right"].twist / found["none"].twist - 1).max() > 0.1
    assert math.isclose(found["right"].mesh_cycle, PAIR.mesh_cycle)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_train_takes_the_pitch_errors_of_its_teeth(sign, tmp_path) -> None:
    """Static error of the train over the full period, as the contact solutions of the same tables have it."""
    rng, torque = np.random.default_rng(3), 30.0
    lists = ""
    for name, teeth in (("pinion", 20), ("wheel", 30)):
        for side in ("left", "right"):
            values = ", ".join(f"{x:.3f}" for x in rng.uniform(-6.0, 6.0, teeth))
            lists += f"[microgeometry.{name}.{side}]\npitch_um = [{values}]\n"
    text = train_text(lists, mesh_model='"potential"').replace("= -300.0", f"= {sign * 300.0}")
    path = tmp_path / "job.toml"
    path.write_text(text.replace("torque_Nm = -30.0", f"torque_Nm = {sign * torque}"))
    job = read_train_job(path)
    train = job_train(job, train_curves(job))
    side = "left" if sign > 0 else "right"
    own = deviations_of(job.meshes[0], PAIR, tmp_path, flank=side)
    (found,) = sweep_loads(PAIR, [torque], positions=5, kinematics="small", coarsen=2.0, deviations=own).curves
    assert len(found.pinion_angle) == 5 * 60
    (static,) = static_errors(train, sign * found.pinion_angle)
    expected = found.transmission_error
    assert np.ptp(expected) > 8e-6
    # an error turns its tooth by up to 2.4e-4 rad, too, which a shift of its first contact leaves out: it shows where
    # a tooth comes in ahead of its path by its tip, and t is steep
    off = np.abs(static - expected)
    assert np.quantile(off, 0.95) < 0.05e-6
    assert off.max() < 0.2e-6


def test_pitch_errors_of_a_train_displace_its_teeth(tmp_path) -> None:
    """Back flanks touch as much later as driving ones touch earlier; in the mesh, too, for pairs of such teeth."""
    values = [round(5.0 * math.sin(j), 3) for j in range(20)]
    path = tmp_path / "job.toml"
    text = train_text(f"[microgeometry.pinion]\npitch_um = {values}\n", mesh_model='"potential"')
    path.write_text(text.replace("tip_round_mm = 0.1", "tip_round_mm = 0.1\ntooth_thinning_um = 50.0"))
    train = job_train(read_train_job(path), (2e8,))
    left, right = next(g.pitch_errors for g in train.gears if g.gear.teeth == 20)
    assert left == pytest.approx(1e-6 * math.cos(PAIR.pinion.pressure_angle) * np.array(values))
    assert right == pytest.approx(-np.array(left))
    ((driving, back),) = train.kinematics.shifts
    assert len(driving) == len(back) == 60
    assert np.sort(back) == pytest.approx(np.sort(-driving))
    assert np.ptp(driving) > 9e-6


def test_back_flanks_have_their_own_microgeometry(tmp_path) -> None:
    """Loads of both signs against contact solutions: relief on the left flanks, crowning on the right ones."""
    torque, thin = 30.0, "tip_round_mm = 0.1\ntooth_thinning_um = 50.0"
    sides = "[microgeometry.pinion.left]\ntip_relief_um = 8.0\ntip_relief_length_mm = 3.0\n"
    text = train_text(sides + "[microgeometry.wheel.right]\nprofile_crowning_um = 5.0\n", mesh_model='"potential"')
    path = tmp_path / "job.toml"
    path.write_text(text.replace("tip_round_mm = 0.1", thin))
    job = read_train_job(path)
    train = job_train(job, train_curves(job))
    pair = replace(
        PAIR, pinion=replace(PAIR.pinion, tooth_thinning=50e-6), wheel=replace(PAIR.wheel, tooth_thinning=50e-6)
    )
    elastic = elastic_pair(pair, coarsen=2.0)
    for load, side, sign in ((-torque, "right", 1.0), (torque, "left", -1.0)):  # drive and so load turn against y
        (one,) = train.loads
        own = elastic.deviated(deviations_of(job.meshes[0], pair, tmp_path, flank=side))
        (found,) = sweep_loads(pair, [torque], positions=12, elastic=own, kinematics="small").curves
        now = replace(train, loads=(replace(one, torque=constant(load)),))
        (static,) = static_errors(now, -sign * found.pinion_angle)
        expected = found.transmission_error
        assert np.ptp(expected) > 1e-6
        assert static == pytest.approx(expected if sign > 0.0 else -pair.normal_backlash - expected, abs=0.05e-6)


@pytest.mark.parametrize(
    ("more", "model", "told"),
    [
        ("[microgeometry.pinion]\npitch_class = 7\n", "variable_stiffness", 'stand unevenly.*mesh_model = "potential"'),
        ("[microgeometry.pinion]\npitch_um = [1.0, 2.0]\n", "potential", "one entry for each of the 20 teeth"),
        (
            "[microgeometry.pinion.left]\nprofile_crowning_um = 5.0\n",
            "variable_stiffness",
            "left and right flanks differ",
        ),
    ],
)
def test_what_a_train_refuses(more, model, told, tmp_path) -> None:
    job = tmp_path / "job.toml"
    text = train_text(more, mesh_model=f'"{model}"')
    job.write_text(text.replace("[[train.meshes]]", "[[train.meshes]]\nbacklash_um = 20.0"))
    with pytest.raises(InputError, match=told):
        train_curves(read_train_job(job))
