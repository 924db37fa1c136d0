"""The vibration command: columns, options, mistakes, the shipped job."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys

import numpy as np
import pytest

from gearfe.cli.main import main
from tests.makers.job_texts import SMALL_TRAIN
from tests.makers.train_responses import COLUMNS, table
from tests.places import EXAMPLES, GEOMETRY, ROOT

JOB = GEOMETRY / "gear_train.toml"


@pytest.fixture
def job(tmp_path):
    path = tmp_path / "job.toml"
    path.write_text(SMALL_TRAIN)
    return path


def test_a_rigid_train(job, tmp_path, capsys):
    """Two shafts, constant stiffness: the contact force is torque over base radius once the load stands."""
    out = tmp_path / "out"
    assert main(["vibration", str(job), "--out", str(out)]) == 0
    said = capsys.readouterr()
    for part in ("mesh 1 (pinion-wheel): 1909.9 Hz", "resolution 500 Hz", "transient: done", "mean contact force"):
        assert part in said.out
    assert sorted(p.name for p in out.iterdir()) == [
        "bearings.csv", "response.csv", "response.png", "spectrum.csv", "spectrum.png", "summary.json",
        "transmission_error.png",
    ]  # fmt: skip
    names, values = table(out / "response.csv")
    assert names[:4] == ["time_s", "drive_angle_deg", "contact_force_1_N", "speed_one_rad_per_s"]
    assert names[4:7] == ["speed_two_rad_per_s", *(f"acceleration_{n}_rad_per_s2" for n in ("one", "two"))]
    assert names[7:11] == [f"attachment_{n}_acceleration_m_per_s2" for n in "abcd"]
    by_name = dict(zip(names, values.T, strict=True))
    assert by_name["drive_angle_deg"] == pytest.approx(np.degrees(600.0 * by_name["time_s"]), rel=1e-9)
    assert by_name["speed_two_rad_per_s"].mean() == pytest.approx(-400.0, rel=1e-3)
    summary = json.loads((out / "summary.json").read_text())
    force = 75.0 / (37.5e-3 * math.cos(math.radians(25.0)))
    assert summary["mean_contact_forces_N"][0] == pytest.approx(force, rel=5e-3)
    assert summary["housing"] == "rigid"
    assert summary["mesh_phases_deg"] == {"pinion-wheel": 0.0}
    assert {"curves", "transient", "pictures", "total"} <= set(summary["timings_s"])


def test_a_rigid_train_loads_no_finite_elements(job, tmp_path):
    code = f"""
import sys
from gearfe.cli.main import main
assert main(["vibration", {str(job)!r}, "--out", {str(tmp_path / "out")!r}, "--no-pictures"]) == 0
loaded = {{name.partition(".")[0] for name in sys.modules}}
assert not loaded & {{"gmsh", "meshio", "skfem", "pyvista", "vtk", "matplotlib"}}, loaded
"""
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True, env=os.environ, capture_output=True)


def test_a_curve_from_a_file(job, tmp_path):
    curve = tmp_path / "k.csv"
    angle = np.arange(0.0, 18.0, 1.5)
    rows = [f"{x},{1e8 * (1 + 0.05 * math.cos(math.radians(20 * x)))},18" for x in angle]
    curve.write_text("\n".join(["pinion_angle_deg,k_mesh_N_per_m,mesh_cycle_deg", *rows]) + "\n")
    assert main(["vibration", str(job), "--out", str(tmp_path), "--curve", str(curve), "--no-pictures"]) == 0
    low, high = json.loads((tmp_path / "summary.json").read_text())["mesh_stiffness_N_per_m"]["pinion-wheel"]
    assert (low, high) == pytest.approx((0.95e8, 1.05e8), rel=1e-9)


def test_a_mesh_law_with_friction(job, tmp_path, capsys):
    """75 N m at 400 rad/s leave the mesh: what comes in is that and the loss, in table, summary and on the terminal."""
    text = SMALL_TRAIN.replace(
        "stiffness_N_per_m = 1e8\ndamping_N_s_per_m = 2000.0", "friction = 0.05\nmesh_model_torque_Nm = 200.0"
    )
    job.write_text(text + "[train.damping]\nratio = 0.05\n")
    out = tmp_path / "out"
    assert main(["vibration", str(job), "--out", str(out), "--no-estimate"]) == 0
    said = capsys.readouterr().out
    assert "mesh 1 (pinion-wheel): friction 0.05, loss " in said
    names, values = table(out / "response.csv")
    by_name = dict(zip(names, values.T, strict=True))
    assert (by_name["friction_power_1_W"] >= 0.0).all()
    friction = json.loads((out / "summary.json").read_text())["friction"]
    assert friction["coefficients"] == [0.05]
    (power,), (loss,), (efficiency,) = (friction[k] for k in ("mean_mesh_power_W", "mean_loss_W", "efficiency"))
    assert power - loss == pytest.approx(75.0 * 400.0, rel=0.01)
    assert efficiency == pytest.approx(1.0 - loss / power)
    # half-half sharing on the path, Niemann and Winter: H_V = .1566 here; the law shares the load a little otherwise
    assert 1.0 - efficiency == pytest.approx(0.05 * 0.1566, rel=0.06)
    assert (out / "transmission_error.png").read_bytes().startswith(b"\x89PNG")


def test_teeth_that_part_are_told(job, tmp_path, capsys):
    """Contacts lost, share of the time and K_v of the summary are those of the table, whose damper acts when teeth are
    apart, too; the flanks that bear are named.
    """
    text = SMALL_TRAIN.replace("2000.0", "100.0\nbacklash_um = 30.0").replace("= 75.0", "= 20.0")
    job.write_text(text.replace("speed_rad_per_s = 600.0", 'speed_rad_per_s = "600 + 20*sin(9000*time)"'))
    out = tmp_path / "out"
    assert main(["vibration", str(job), "--out", str(out), "--no-estimate"]) == 0
    names, values = table(out / "response.csv")
    by_name = dict(zip(names, values.T, strict=True))
    force, time = by_name["contact_force_1_N"], by_name["time_s"]
    error = by_name["transmission_error_1_um"]
    apart = (error <= 0.0) & (error >= -30.0)
    contact = json.loads((out / "summary.json").read_text())["contact"]
    lost = int((apart[1:] & ~apart[:-1]).sum())
    assert lost > 2
    assert contact["contacts_lost"] == [lost]
    assert contact["share_without_contact"][0] == pytest.approx(np.trapezoid(1.0 * apart, time) / time[-1], abs=0.03)
    steady = 20.0 / (37.5e-3 * math.cos(math.radians(25.0)))
    assert contact["dynamic_factors"][0] == pytest.approx(np.abs(force).max() / steady, rel=1e-9)
    assert contact["flanks"] == ["both flanks, 30 um of normal backlash"]
    job.write_text(
        SMALL_TRAIN.replace("stiffness_N_per_m = 1e8", "mesh_model_torque_Nm = 200.0").replace("= 75.0", "= 0.0")
    )
    assert main(["vibration", str(job), "--out", str(out), "--no-estimate", "--no-pictures"]) == 0
    assert "no load keeps the teeth of mesh pinion-wheel in contact" in capsys.readouterr().err
    (flanks,) = json.loads((out / "summary.json").read_text())["contact"]["flanks"]
    assert flanks.startswith("driving flanks only: the gears have no backlash")


def test_window_and_record(job, tmp_path):
    options = ["--window", "hann", "--spectrum-from-ms", "1", "--spectrum-ms", "0.8", "--no-pictures"]
    assert main(["vibration", str(job), "--out", str(tmp_path), *options]) == 0
    spectrum = json.loads((tmp_path / "summary.json").read_text())["spectrum"]
    assert (spectrum["window"], spectrum["samples"]) == ("hann", 40)
    assert spectrum["start_s"] == pytest.approx(1e-3)
    names, values = table(tmp_path / "spectrum.csv")
    _, response = table(tmp_path / "response.csv")
    taken = response[50:90, 2]
    window = 1 - np.cos(2 * math.pi * np.arange(40) / 40)
    expected = np.abs(np.fft.rfft(window * taken)) * 2 / 40
    assert values[1:-1, names.index("contact_force_1_N")] == pytest.approx(expected[1:-1], rel=1e-9)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--spectrum-ms", "3"], "the window is longer than the signal"),
        (["--window", "hanning"], "must be one of none, hann"),
        (["--attachment", "e"], "unknown name 'e'"),
        (["--picture-ms", "9", "--fields"], "--picture-ms = 9.0: lies outside of the run"),
        (["--tolerance", "0"], "--tolerance = 0.0"),
        (["--curve", "no.csv"], "no.csv"),
        (["--curve", "a.csv", "b.csv"], "2 files for 1 meshes"),
        (["--variant", "quiet"], "unknown name 'quiet'"),
    ],
)
def test_mistakes_in_the_options(job, tmp_path, capsys, options, message):
    out = tmp_path / "out"
    assert main(["vibration", str(job), "--out", str(out), *options]) == 2
    error = capsys.readouterr().err
    assert error.startswith("gearfe: error: ")
    assert message in error
    assert not list(out.glob("*"))


def test_unknown_keys_and_missing_tables(job, tmp_path, capsys):
    job.write_text(SMALL_TRAIN.replace("duration_ms", "duraton_ms"))
    assert main(["vibration", str(job), "--out", str(tmp_path / "out")]) == 2
    assert "did you mean 'duration_ms'?" in capsys.readouterr().err
    job.write_text(SMALL_TRAIN.partition("[train]")[0])
    assert main(["vibration", str(job), "--out", str(tmp_path / "out")]) == 2
    assert "[train]: is missing" in capsys.readouterr().err


def test_the_script(job, tmp_path):
    script = [sys.executable, str(EXAMPLES / "housing_vibration.py"), str(job), str(tmp_path / "out")]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(script, capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    assert "mean contact force pinion-wheel: 22" in done.stdout
    assert main(["vibration", str(job), "--out", str(tmp_path), "--no-pictures"]) == 0
    for name in ("response.csv", "spectrum.csv"):
        assert (tmp_path / "out" / name).read_text() == (tmp_path / name).read_text()


@pytest.mark.slow
@pytest.mark.parametrize("variant", ["standard", "undamped_springs", "operating"])
def test_the_shipped_job(tmp_path, capsys, variant):
    """All variants, whole chain; the second run is made from the caches and says the same."""
    outs = [tmp_path / name for name in ("first", "second")]
    for out in outs:
        assert main(["vibration", str(JOB), "--out", str(out), "--variant", variant]) == 0
    assert (outs[0] / "response.csv").read_text() == (outs[1] / "response.csv").read_text()
    names, values = table(outs[0] / "response.csv")
    assert names[: len(COLUMNS)] == COLUMNS
    assert values.shape[0] == 201
    assert values[0, 4:7] == pytest.approx([600.0, -400.0, 800.0 / 3.0], rel=1e-12)
    summary = json.loads((outs[0] / "summary.json").read_text())
    ratio = summary["mean_contact_forces_N"][1] / summary["mean_contact_forces_N"][0]
    assert ratio == pytest.approx(1.5, rel=5e-3)
    assert summary["spectrum"]["resolution_Hz"] == pytest.approx(142.857, abs=1e-3)
    assert set(summary["dominant_lines"]) >= set(COLUMNS[2:])
    if variant == "standard":  # what users of the published model expect: lines near 550 and 2000 Hz, within a bin
        lines = summary["dominant_lines"]["attachment_5_acceleration_m_per_s2"]
        assert [line["frequency_Hz"] for line in lines[:2]] == pytest.approx([550.0, 2000.0], abs=145.0)
        assert np.ptp(values[60:, 6]) > np.ptp(values[60:, 5])  # the output swings more than the intermediate shaft


@pytest.mark.slow
def test_the_shipped_fields(tmp_path):
    import h5py

    assert main(["vibration", str(JOB), "--out", str(tmp_path), "--fields", "--no-animation"]) == 0
    with h5py.File(tmp_path / "gears.vtkhdf") as gears, h5py.File(tmp_path / "housing.vtkhdf") as housing:
        times = [list(file["VTKHDF/Steps/Values"]) for file in (gears, housing)]
        assert times[0] == times[1]
        assert min(abs(t - 4.55e-3) for t in times[0]) < 1e-9
        assert set(housing["VTKHDF/PointData"]) == {"displacement_m", "normal_acceleration_m_per_s2"}
    assert (tmp_path / "fields.png").read_bytes().startswith(b"\x89PNG")
