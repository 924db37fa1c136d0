"""Load maps: against positions solved directly at a torque, as files, from the command line."""

import csv
import itertools
import json
import math

import numpy as np
import pytest

from gearfe import LoadMap, sweep_loads, sweep_stiffness
from gearfe.base.config import read_toml
from gearfe.base.errors import InputError
from gearfe.base.tables.jobs import load_job, whole_gearbox, with_loads
from gearfe.cli.main import main
from gearfe.drivetrain.gearbox.job import read_train_job
from gearfe.drivetrain.gearbox.mesh_stiffness import train_curves
from gearfe.gears.gearmesh.job import read_stiffness_job
from gearfe.gears.gearmesh.load_map import RootMap
from gearfe.gears.gearmesh.sweep import elastic_pair
from tests.makers.gears import pair
from tests.makers.job_texts import BARE_TRAIN, BORES
from tests.places import GEOMETRY

JOB = GEOMETRY / "gear_train.toml"
ANGLES = np.radians(np.arange(6) * 3.0)


@pytest.fixture(scope="module")
def gears():
    return pair(20, 30, tip_round=0.1e-3)


@pytest.fixture(scope="module")
def elastic(gears):
    return elastic_pair(gears, coarsen=3.0)


@pytest.fixture(scope="module")
def made(gears, elastic):
    return sweep_loads(gears, np.geomspace(60.0, 180.0, 6), angles=ANGLES, elastic=elastic, root_stress=True)


@pytest.mark.parametrize("kinematics", [pytest.param("small", marks=pytest.mark.slow), "finite"])
def test_cells_are_what_sweeps_at_their_twists_find(gears, elastic, made, kinematics):
    """The closing step, and that the share of finite strain grows as the torque does, may miss it by 1e-5 at most."""
    mapped = made
    if kinematics == "small":
        mapped = sweep_loads(gears, made.torque, angles=ANGLES, elastic=elastic, kinematics="small")
    assert (mapped.status == "converged").all()
    for row, i in itertools.product((1, 4), range(len(ANGLES))):
        curve, twist = mapped.curves[row], float(mapped.curves[row].twist[i])
        direct = sweep_stiffness(gears, twist=twist, angles=ANGLES[[i]], elastic=elastic, kinematics=kinematics)
        for name in ("torque_wheel", "k_mesh", "torque_pinion", "wheel_angle", "leading_pair"):
            assert getattr(curve, name)[i] == pytest.approx(getattr(direct, name)[0], rel=1e-5, abs=1e-12), name
        shares = direct.load_share[0]
        np.testing.assert_allclose(curve.load_share[i, : len(shares)], shares, atol=1e-5)
        assert curve.k_tangent[i] == pytest.approx(direct.k_tangent[0], rel=1e-4)
        assert curve.peak_pressure[i] == pytest.approx(direct.peak_pressure[0], rel=1e-4, nan_ok=True)


def test_tables_come_back(made, tmp_path):
    made.to_csv(tmp_path / "map.csv")
    again = LoadMap.from_csv(tmp_path / "map.csv")
    again.to_csv(tmp_path / "again.csv")
    assert (tmp_path / "again.csv").read_bytes() == (tmp_path / "map.csv").read_bytes()
    digits = 5e-15 * 1.1  # a rounding to 15 digits
    np.testing.assert_allclose(again.torque, made.torque, rtol=digits)
    np.testing.assert_array_equal(again.status, made.status)
    for name in ("pinion_angle", "twist", "k_mesh", "k_tangent", "peak_pressure", "leading_pair"):
        np.testing.assert_allclose(again.quantity(name), made.quantity(name), rtol=digits)
    np.testing.assert_allclose(again.root.stress, made.root.stress, rtol=digits)
    np.testing.assert_allclose(again.root.diameter, made.root.diameter, rtol=digits)
    with open(tmp_path / "map.csv") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 36
    assert all(abs(sum(float(r[k]) for k in r if k.startswith("load_share")) - 1) < 1e-9 for r in rows)
    text = (tmp_path / "map.csv").read_text().splitlines()
    (tmp_path / "short.csv").write_text("\n".join(text[:-1]) + "\n")
    with pytest.raises(InputError, match="same number of angles"):
        LoadMap.from_csv(tmp_path / "short.csv")
    made.curves[0].to_csv(tmp_path / "curve.csv")
    with pytest.raises(InputError, match="no column torque_Nm"):
        LoadMap.from_csv(tmp_path / "curve.csv")


def test_root_stress_of_a_cell_is_the_largest_of_its_teeth(made):
    assert isinstance(made.root, RootMap)
    stress = made.root.stress
    assert stress.shape == (6, 6, 2, 2)
    np.testing.assert_array_equal(made.root.largest, np.nanmax(stress, axis=3))
    # a tooth carries tension at its root exactly where its pair carries load
    np.testing.assert_array_equal(np.isfinite(stress[:, :, 0]), made.quantity("load_share") > 0)
    assert (stress[np.isfinite(stress)] > 0).all()


def test_stiffness_rises_with_the_torque_and_errors_with_it(made):
    assert (np.diff(made.quantity("k_mesh"), axis=0) > 0).all()
    assert (np.diff(made.peak_to_peak) > 0).all()


def test_a_torque_out_of_reach_is_a_status(gears, elastic):
    mapped = sweep_loads(gears, [100.0, 1e6], angles=ANGLES[:1], elastic=elastic, root_stress=False)
    assert mapped.status[0, 0] == "converged"
    assert mapped.failed[1, 0]
    assert np.isnan(mapped.curves[1].k_mesh[0])


@pytest.mark.parametrize("torques", [[], [0.0], [-1.0, 5.0], [math.nan]])
def test_torques_that_are_none(gears, elastic, torques):
    with pytest.raises(InputError, match="torques"):
        sweep_loads(gears, torques, elastic=elastic)


# ---- the gear train --------------------------------------------------------------------------------------------------


def test_a_train_names_what_stands_for_a_load_map(tmp_path):
    (tmp_path / "job.toml").write_text(BARE_TRAIN.replace("stiffness_N_per_m = 2e8", 'load_map = "map.csv"') + BORES)
    with pytest.raises(InputError, match=r"load_map = 'map.csv': is gone.*mesh_model = \"variable_stiffness\".*curve"):
        read_train_job(tmp_path / "job.toml")


def test_backlash_and_law_of_the_job_reach_maps_and_trains(tmp_path):
    """A pair with backlash: k of the map and of the train's own curve is that of a sweep, by the job's law."""
    text = JOB.read_text().replace("\n[pair]\n", "\n[pair]\ncentre_distance_mm = 62.6\n")
    text = text.replace("\n[stiffness]\n", '\n[stiffness]\ncoarsen = 3.0\nkinematics = "small"\n')
    text = text.replace("x_mm = 62.5\n", "x_mm = 62.6\n").replace("x_mm = 125.0\n", "x_mm = 125.2\n")
    text = text.replace("positions = 36", "positions = 8")
    (tmp_path / "job.toml").write_text(text)
    job = read_train_job(tmp_path / "job.toml", "operating")
    curves = train_curves(job)
    for curve, torque in zip(curves, (100.0 / 1.5, 100.0), strict=True):
        assert set(curve.law) == {"half_plane"}
        np.testing.assert_allclose(curve.torque_wheel, torque, rtol=1e-7)
        # half the backlash is 43 um, a tooth pair yields by some 20: with it in, k is a third
        assert (curve.k_tangent / curve.k_mesh < 1.3).all()
        assert curve.lost_motion > 0
    options = ["--torques-Nm", "66.66666666666667", "100", "--positions", "8", "--no-pictures"]
    assert main(["loadmap", str(tmp_path / "job.toml"), "--out", str(tmp_path / "out"), *options]) == 0
    mapped = LoadMap.from_csv(tmp_path / "out" / "loadmap.csv")
    assert set(mapped.quantity("law").ravel()) == {"half_plane"}
    for of_map, of_train in zip(mapped.curves, curves, strict=True):
        np.testing.assert_allclose(of_map.k_mesh, of_train.k_mesh, rtol=1e-4)


# ---- the command -----------------------------------------------------------------------------------------------------


def test_the_command(tmp_path, capsys):
    out = tmp_path / "out"
    options = [
        "--torque-range",
        "50",
        "200",
        "4",
        "--spacing",
        "log",
        "--positions",
        "4",
        "--coarsen",
        "4",
        "--law",
        "half_plane",
    ]
    assert main(["loadmap", str(JOB), "--out", str(out), "--root-stress", *options]) == 0
    said = capsys.readouterr().out
    assert "4 torques x 4 positions over 1 mesh cycle: 16 converged" in said
    assert "root stress" in said
    assert sorted(p.name for p in out.iterdir()) == [
        "loadmap.csv",
        "loadmap.json",
        "loadmap.png",
        "loadmap_load.png",
        "loadmap_orders.csv",
        "loadmap_pairs.csv",
        "loadmap_torques.csv",
    ]
    mapped = LoadMap.from_csv(out / "loadmap.csv")
    np.testing.assert_allclose(mapped.torque, np.geomspace(50, 200, 4), rtol=1e-12)
    np.testing.assert_allclose(np.degrees(mapped.pinion_angle), [0, 4.5, 9, 13.5])
    with open(out / "loadmap_torques.csv") as stream:
        rows = list(csv.DictReader(stream))
    te = 1e6 * mapped.quantity("transmission_error")
    found = [float(r["transmission_error_peak_to_peak_um"]) for r in rows]
    np.testing.assert_allclose(found, te.max(axis=1) - te.min(axis=1), rtol=1e-12)
    summary = json.loads((out / "loadmap.json").read_text())
    assert summary["statuses"] == {"converged": 16}
    assert summary["job"]["loadmap"]["torque_count"] == 4
    assert 0 < summary["root_stress_error_estimate"] < 0.02
    assert (out / "loadmap.png").read_bytes().startswith(b"\x89PNG")


def test_steel_bears_the_loads_of_the_shipped_job():
    """sigma_Hlim = 1500 and sigma_FE = 2 sigma_Flim = 1000 N/mm2: case-hardened steel, ISO 6336-5, grade MQ."""
    tables = load_job(JOB, ("pair", "stiffness", "loadmap", "train"))
    largest = tables["loadmap"].torque_stop_Nm
    assert tables["stiffness"].torque_Nm == -tables["train"].loads[0].torque_Nm <= largest
    job = read_stiffness_job(JOB)
    made = sweep_loads(job.pair, [largest], job.model, coarsen=2.0, root_stress=True)
    assert 500e6 < np.nanmax(made.curves[0].peak_pressure) < 1500e6
    assert 100e6 < made.root.largest.max() < 1000e6


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--torques-Nm", "-5"], "--torques-Nm"),
        (["--torque-range", "100", "50", "5"], "must be > torque_start_Nm"),
        (["--torque-range", "10", "50", "2.5"], "whole number"),
        (["--torque-range", "10", "50", "1"], "--torque-range"),
        (["--positions", "0"], "--positions"),
        (["--spacing", "cubic"], "even, log"),
        (["--law", "glue"], "--law"),
    ],
)
def test_mistakes_are_named(tmp_path, capsys, options, said):
    assert main(["loadmap", str(JOB), "--out", str(tmp_path / "out"), *options]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_the_torque_of_stiffness_is_that_of_a_map_without_one(tmp_path):
    text = JOB.read_text().partition("\n[stiffness]\n")[0] + "\n[stiffness]\ntorque_pinion_Nm = 20.0\n"
    for more, torques in (
        ("", [30.0]),
        ("\n[loadmap]\ntorque_start_Nm = 5.0\ntorque_stop_Nm = 10.0\ntorque_count = 2\n", [5.0, 10.0]),
    ):
        (tmp_path / "job.toml").write_text(text + more)
        raw = read_toml(tmp_path / "job.toml")
        (mesh,) = with_loads(whole_gearbox(raw, tmp_path / "job.toml"), raw).meshes.values()
        assert mesh.loads.torques() == pytest.approx(torques)


def test_torques_must_be_given(tmp_path, capsys):
    head = JOB.read_text().partition("\n[stiffness]\n")[0]
    (tmp_path / "job.toml").write_text(head)
    assert main(["loadmap", str(tmp_path / "job.toml"), "--out", str(tmp_path / "out")]) == 2
    assert "no torques are given" in capsys.readouterr().err
    (tmp_path / "job.toml").write_text(head + "\n[loadmap]\ntorques_Nm = [10.0]\ntorque_stop_Nm = 20.0\n")
    assert main(["loadmap", str(tmp_path / "job.toml"), "--out", str(tmp_path / "out")]) == 2
    assert "conflicts with torques_Nm" in capsys.readouterr().err
