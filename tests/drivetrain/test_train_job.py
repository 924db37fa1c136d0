"""From job files to trains: the shipped file, its variants, and mistakes in the tables."""

from __future__ import annotations

import dataclasses
import math
import re
from pathlib import Path

import numpy as np
import pytest

from gearfe.base.config import build
from gearfe.base.errors import InputError
from gearfe.base.tables.jobs import load_job
from gearfe.base.tables.pair import PairTable, StiffnessTable
from gearfe.base.tables.train import TrainCurvesTable, TrainGearTable
from gearfe.base.tables.train_gearbox import train_gearbox
from gearfe.drivetrain.gearbox.job import bore_places, job_train, read_train_job
from gearfe.drivetrain.gearbox.mesh_stiffness import train_curves
from gearfe.drivetrain.train import build_train, simulate
from gearfe.gears.gearmesh.curve import StiffnessCurve
from gearfe.gears.geometry.pair import GearPair, gear_of
from tests.makers.files import job_file
from tests.makers.job_texts import BARE_TRAIN, BORES
from tests.places import GEOMETRY

SHIPPED = GEOMETRY / "gear_train.toml"


def test_the_shipped_job_is_what_it_says() -> None:
    job = read_train_job(SHIPPED)
    assert job.table.variant == "standard"
    assert len(job.times) == 201
    assert job.times[-1] == pytest.approx(7e-3)
    train = job_train(job)
    assert train.kinematics.steady_forces == pytest.approx(
        [1961.56, 2942.34], rel=1e-5
    )  # 100 N m/33.987 mm, and 2/3 of it
    assert [g.along for g in train.gears] == [0.010, 0.010, -0.002, -0.002]
    model = build_train(train)
    assert model.kinematics.common_turns == pytest.approx(0.15)
    assert simulate(model, job.times).speed[0] == pytest.approx([600.0, -400.0, 266.6667], rel=1e-6)


def test_variants_differ_in_curves_and_damping() -> None:
    names = (None, "undamped_springs", "operating")
    standard, undamped, operating = (read_train_job(SHIPPED, name).table for name in names)
    assert (standard.curves, standard.damping.ratio) == (TrainCurvesTable(), 0.0)  # mesh laws are the default
    models = [table.curves.mesh_model for table in (standard, undamped, operating)]
    assert models == ["potential", "variable_stiffness", "variable_stiffness"]
    assert math.pi * 2000.0 * standard.damping.rayleigh_beta_s == pytest.approx(0.01, rel=0.01)  # 1 % at 2 kHz
    assert (undamped.curves.interpolation, undamped.curves.load, undamped.damping.ratio) == ("linear", "stiffness", 0.0)
    assert (operating.curves.interpolation, operating.curves.load, operating.damping.ratio) == ("cubic", "torque", 0.01)
    with pytest.raises(InputError, match="did you mean 'undamped_springs'"):
        read_train_job(SHIPPED, "undamped_spring")
    with pytest.raises(InputError, match="did you mean 'undamped_springs'"):  # its former name
        read_train_job(SHIPPED, "tutorial")


def test_the_other_commands_read_the_same_file() -> None:
    tables = load_job(SHIPPED, ("pair", "stiffness", "housing", "train"))
    alone = load_job(GEOMETRY / "housing.toml", ("housing",))
    assert dataclasses.replace(tables["housing"], reduction=alone["housing"].reduction) == alone["housing"]
    places = bore_places(tables["housing"])
    assert places["1"] == pytest.approx((0.0, 0.033, 0.0))
    assert places["6"] == pytest.approx((0.125, -0.03225, 0.0))


def test_a_train_with_its_own_gears_runs(tmp_path: Path) -> None:
    job = read_train_job(job_file(tmp_path, BARE_TRAIN + BORES))
    model = build_train(job_train(job, train_curves(job), None))
    response = simulate(model, job.times, tolerance=job.table.tolerance)
    assert response.status == "done"
    # driven by -300 rad/s, the second shaft turns with +200 and is braked by -30 N m
    assert response.speed[0] == pytest.approx([-300.0, 200.0])
    assert response.contact_force[-1, 0] == pytest.approx(30.0 / (0.027 * math.cos(math.radians(20.0))), rel=0.2)


def test_a_gear_of_its_own_with_the_keys_of_a_pair_is_the_pairs(tmp_path: Path) -> None:
    """Tip relief, too: it was taken for a key and left out of the gear."""
    form = {"module_mm": 2.5, "pressure_angle_deg": 25.0, "face_width_mm": 10.0, "tip_round_mm": 0.1}
    form |= {"tip_relief_amount_um": 12.0, "tip_relief_length_mm": 2.0, "tip_relief_exponent": 2.0}
    gears = {"pinion": {"teeth": 20, "bore_diameter_mm": 10.0}, "wheel": {"teeth": 30, "bore_diameter_mm": 15.0}}
    expected = GearPair.from_table(build(PairTable, {**form, **gears}, "pair")).pinion
    job = read_train_job(job_file(tmp_path, BARE_TRAIN + BORES))
    keys = {**form, **gears["pinion"], "name": "in", "shaft": "in", "y_mm": 0.0}
    own = build(TrainGearTable, keys, "gear")
    table = dataclasses.replace(job.table, gears=(own,), meshes=())
    assert gear_of(train_gearbox(table, None).gears["in"]) == expected


def test_files_for_curves(tmp_path: Path) -> None:
    angles = np.arange(20.0)
    rows = "\n".join(f"{a},{1.5e8 + 1e7 * math.cos(math.radians(18 * a))}" for a in angles)
    (tmp_path / "k.csv").write_text("pinion_angle_deg,k_mesh_N_per_m\n" + rows + "\n")
    text = BARE_TRAIN.replace("stiffness_N_per_m = 2e8", 'curve = "k.csv"') + BORES
    (found,) = train_curves(read_train_job(job_file(tmp_path, text)))
    assert isinstance(found, StiffnessCurve)
    assert found.mesh_cycle == pytest.approx(2 * math.pi / 18)  # the driver's
    job = read_train_job(job_file(tmp_path, BARE_TRAIN + BORES))
    assert isinstance(train_curves(job, [tmp_path / "k.csv"])[0], StiffnessCurve)
    with pytest.raises(InputError, match="2 files for 1 meshes"):
        train_curves(job, [tmp_path / "k.csv"] * 2)
    with pytest.raises(InputError, match=r"no such|cannot be read"):
        train_curves(job, [tmp_path / "none.csv"])


def built(path: Path) -> None:
    job = read_train_job(path)
    build_train(job_train(job, train_curves(job), None))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("x_mm = 45.0\nlength", "x_mm = 46.0\nlength", "off the axis|46 mm apart"),
        ('shaft = "out"\ny_mm', 'shaft = "oat"\ny_mm', "gears\\[1\\].shaft: unknown name 'oat'; did you mean 'out'"),
        ("teeth = 27", "tooth = 27", "did you mean 'teeth'"),
        ("module_mm = 2.0", "", "module_mm.*is required"),
        ("teeth = 27", "teeth = 27\ntip_relief_amount_um = 9.0", "gears\\[1\\].tip_relief_length_mm: is required"),
        ("teeth = 27", "teeth = 27\ntip_round_mm = 5.0", "gears\\[1\\].tip_round_mm = 5.0: "),
        ("stiffness_N_per_m = 2e8", "", "has no stiffness: there is no table"),
        ("stiffness_N_per_m = 2e8", "stiffness_N_per_m = 2e8\nrigid = true", "conflicts with"),
        ("ratio = 0.05", "ratio = -0.05", "must be finite and >= 0"),
        ("step_us = 100.0", "step_us = 3000.0", "is longer than duration_ms"),
        ('housing = "rigid"', 'housing = "elastic"', "needs a table \\[housing\\]"),
        ("attachments = [3, 4]", "attachments = [3, 5]", "unknown attachment '5'"),
        ("teeth = 27\n", 'gear = "wheel"\n', "conflicts with gear"),
        (
            "stiffness_N_per_m = 2e8",
            "[train.curves]\nload = 'torque'",
            "curves.load = 'torque': is of stiffness curves",
        ),
        ("stiffness_N_per_m = 2e8", "[train.curves]\npositions = 36", "curves.positions = 36: is of stiffness curves"),
        ("2e8", "2e8\nfriction = 0.6", "friction = 0.6: must be"),
        ("2e8", "2e8\nfriction = 0.06", "needs a mesh law"),
        ("2e8", "2e8\nmesh_model = 'potential'", "contradicts stiffness_N_per_m"),
        ("stiffness_N_per_m = 2e8", "curve = 'k.csv'\nmesh_model = 'mean_stiffness'", "mesh_model.* contradicts curve"),
        ("2e8", "2e8\nbacklash_um = -1.0", "wedged mesh"),
        (
            "stiffness_N_per_m = 2e8",
            "friction = 0.06\n[train.curves]\nmesh_model = 'variable_stiffness'",
            "needs a mesh law, but",
        ),
        ("stiffness_N_per_m = 2e8", "roughness_um = 0.5", "oil_viscosity_mPa_s: is required with roughness_um"),
        (
            "stiffness_N_per_m = 2e8",
            "oil_viscosity_mPa_s = 20.0\nroughness_um = 0.5\nfriction = 0.05",
            "conflicts with friction = 0.05",
        ),
    ],
)
def test_mistakes_in_a_file(tmp_path: Path, old: str, new: str, words: str) -> None:
    assert old in BARE_TRAIN
    path = job_file(tmp_path, BARE_TRAIN.replace(old, new, 1) + BORES)
    with pytest.raises(InputError, match=words):
        built(path)


MODELS = 'write mesh_model = "potential" or "variable_stiffness" or "mean_stiffness"'


@pytest.mark.parametrize("where", ["train.curves", "train.variants.V.curves", "train.meshes[0]"])
@pytest.mark.parametrize(
    ("line", "cure"),
    [
        ("law = 'map'", 'write mesh_model = "potential"'),
        ("law = 'curve'", 'write mesh_model = "variable_stiffness"'),
        ("law = 'linear'", 'write mesh_model = "mean_stiffness"'),
        ("law = 'nitsche'", MODELS),
        ("law = 1", MODELS),
        ("mesh_model = 'map'", 'write mesh_model = "potential"'),
        ("mesh_model = 'curve'", 'write mesh_model = "variable_stiffness"'),
        ("mesh_model = 'linear'", 'write mesh_model = "mean_stiffness"'),
        ("mesh_model = 'potentail'", "did you mean 'potential'"),
    ],
)
def test_removed_keys_and_values_of_mesh_models_name_the_new_line(
    tmp_path: Path, where: str, line: str, cure: str
) -> None:
    """The contact law is the only thing that `law` names; a mesh of a train has a model."""
    in_mesh = where == "train.meshes[0]"
    text = BARE_TRAIN.replace("= 2e8", f"= 2e8\n{line}") if in_mesh else f"{BARE_TRAIN}{BORES}[{where}]\n{line}\n"
    key = line.partition(" ")[0]
    with pytest.raises(InputError, match=re.escape(f"{where}.{key} = ") + ".*" + re.escape(cure)):
        read_train_job(job_file(tmp_path, text))


def test_the_removed_key_of_the_largest_torque_names_the_new_line(tmp_path: Path) -> None:
    text = BARE_TRAIN.replace("stiffness_N_per_m = 2e8", "law_torque_Nm = 450.5") + BORES
    with pytest.raises(InputError, match=r"meshes\[0\].law_torque_Nm = 450.5.*write mesh_model_torque_Nm = 450.5"):
        read_train_job(job_file(tmp_path, text))


def test_keys_of_a_variant_win_over_those_of_the_stiffness_table(tmp_path: Path) -> None:
    """The others are shared, and a load of either kind is instead of the shared one."""
    shared = "[stiffness]\ntorque_Nm = 20.0\ncoarsen = 2.0\nlaw = 'penalty'\n"
    own = "[train.variants.A.stiffness]\ntwist_deg = 0.3\nlaw = 'half_plane'\n[train.variants.B.curves]\n"
    path = job_file(tmp_path, shared + BARE_TRAIN + BORES + own)
    found = {name: read_train_job(path, name).stiffness for name in ("", "A", "B")}
    assert found[""] == found["B"] == StiffnessTable(torque_Nm=20.0, coarsen=2.0, law="penalty")
    assert found["A"] == StiffnessTable(twist_deg=0.3, coarsen=2.0, law="half_plane")
    with pytest.raises(InputError, match=r"train.variants.A.stiffness.coarsen = 9.0: must be finite and >= 0.2"):
        read_train_job(job_file(tmp_path, BARE_TRAIN + BORES + "[train.variants.A.stiffness]\ncoarsen = 9.0\n"))
    both = "[train.variants.A.stiffness]\ntwist_deg = 0.3\ntorque_Nm = 1.0\n"
    with pytest.raises(InputError, match=r"train.variants.A.stiffness.torque_Nm = 1.0: conflicts with twist_deg"):
        read_train_job(job_file(tmp_path, BARE_TRAIN + BORES + both))


def test_the_undamped_springs_have_the_published_load_by_nitsche() -> None:
    """0.5 degrees; the curve's positions and the gears are shared with [stiffness], whose law is the default."""
    shared, undamped = (read_train_job(SHIPPED, name).stiffness for name in ("", "undamped_springs"))
    assert (shared.torque_Nm, shared.twist_deg, shared.law) == (100.0, None, "half_plane")
    assert undamped == dataclasses.replace(shared, torque_Nm=None, twist_deg=0.5, law="nitsche")


def test_missing_bores_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"neither .*rigid_bores.* nor"):
        built(job_file(tmp_path, BARE_TRAIN))
