"""The commands stiffness, gear and mesh, as a user runs them; coarse meshes."""

import json
import math
import os
import re
import subprocess
import sys

import numpy as np
import pytest

from gearfe import StiffnessCurve
from gearfe.cli.main import main
from gearfe.gears.contact.elements import solve_elements
from tests.makers.files import csv_rows
from tests.places import EXAMPLES, GEOMETRY, ROOT

JOB = GEOMETRY / "gear_train.toml"
QUICK = ("--coarsen", "3", "--no-estimate", "--law", "half_plane")


def rows(folder):
    return csv_rows(folder / "stiffness.csv")


def job_with(tmp_path, **changes):
    """The shipped job with lines of [stiffness] replaced (None takes a line out)."""
    text = JOB.read_text()
    head, _, table = text.partition("\n[stiffness]\n")
    table = table.partition("\n[")[0]  # the tables of other jobs are left out
    lines = [line for line in table.splitlines() if line.partition("=")[0].strip() not in changes]
    lines += [f"{key} = {value}" for key, value in changes.items() if value is not None]
    path = tmp_path / "job.toml"
    path.write_text(head + "\n[stiffness]\n" + "\n".join(lines) + "\n")
    return path


def only_stages(told: str) -> bool:
    """Whether there is nothing but what the run was doing."""
    return all(re.match(r"gearfe: \d+ s: ", line) for line in told.splitlines())


def test_the_whole_command(tmp_path, capsys):
    out = tmp_path / "new" / "folder"
    code = main(
        ["stiffness", str(JOB), "--out", str(out), "--twist-deg", "0.05", "--coarsen", "3", "--law", "half_plane"]
    )
    said = capsys.readouterr()
    assert code == 0
    assert sorted(p.name for p in out.iterdir()) == ["stiffness.csv", "stiffness.png", "summary.json"]
    table = rows(out)
    assert [float(r["pinion_angle_deg"]) for r in table] == list(range(1, 41))
    assert {r["twist_deg"] for r in table} == {"0.05"}
    assert (out / "stiffness.png").read_bytes().startswith(b"\x89PNG")
    summary = json.loads((out / "summary.json").read_text())
    assert summary["statuses"] == {"converged": 40}
    assert summary["job"]["stiffness"]["twist_deg"] == 0.05
    assert summary["job"]["gears"]["pinion"]["teeth"] == 20
    assert summary["derived_geometry"]["contact_ratio"] == pytest.approx(1.442, abs=5e-4)
    assert summary["iso_6336"]["c_prime_N_per_mm_um"] == pytest.approx(13.1, abs=0.05)
    assert summary["iso_6336"]["c_gamma_N_per_mm_um"] == pytest.approx(17.4, abs=0.05)
    assert summary["error_estimate"]["worst_relative"] >= summary["error_estimate"]["typical_relative"] > 0
    assert {"meshes", "condensation", "positions", "error estimate", "picture", "total"} <= set(summary["timings_s"])
    assert "numpy" in summary["versions"]
    for part in ("40 converged", "ISO 6336", "discretisation error", "N/um"):
        assert part in said.out
    assert only_stages(said.err)


def test_options_override_the_file(tmp_path):
    options = ["--torque-Nm", "400", "--angles", "0", "4.5", "9", "--law", "penalty", "--plane", "stress"]
    assert main(["stiffness", str(JOB), "--out", str(tmp_path), *QUICK, *options]) == 0
    table = rows(tmp_path)
    assert [float(r["pinion_angle_deg"]) for r in table] == [0, 4.5, 9]
    np.testing.assert_allclose([float(r["torque_wheel_Nm"]) for r in table], 400, rtol=1e-10)
    job = json.loads((tmp_path / "summary.json").read_text())["job"]["stiffness"]
    assert (job["law"], job["plane"], job["twist_deg"], job["torque_Nm"]) == ("penalty", "stress", None, 400)
    main(["stiffness", str(JOB), "--out", str(tmp_path / "b"), *QUICK, *options[:-1], "strain"])
    assert float(rows(tmp_path / "b")[1]["k_mesh_N_per_m"]) > 1.02 * float(table[1]["k_mesh_N_per_m"])


def test_fields(tmp_path):
    import h5py

    options = ["--twist-deg", "0.1", "--angles", "2", "1", "5", "--fields", "2", "5", *QUICK]
    assert main(["stiffness", str(JOB), "--out", str(tmp_path), *options]) == 0
    names = sorted(p.name for p in tmp_path.iterdir())
    assert names == [
        "fields.vtkhdf",
        "pressure.csv",
        "pressure.png",
        "stiffness.csv",
        "stiffness.png",
        "stress_2deg.png",
        "stress_5deg.png",
        "summary.json",
    ]
    with h5py.File(tmp_path / "fields.vtkhdf") as file:
        assert list(file["VTKHDF/Steps/Values"]) == pytest.approx([2.0, 5.0])
        count = int(file["VTKHDF/NumberOfPoints"][0])
        points = file["VTKHDF/Points"][...]
        assert len(points) == 2 * count
        # between the steps the pinion turns by 3 deg and the wheel, about its own centre, by -2 deg
        first, second = points[:count, :2], points[count:, :2]
        pinion = np.linalg.norm(first, axis=1) < 20e-3
        turned = np.angle((second @ [1, 1j])[pinion] / (first @ [1, 1j])[pinion])
        np.testing.assert_allclose(turned, math.radians(3), atol=1e-9)
        wheel = np.linalg.norm(first - [62.5e-3, 0], axis=1) < 30e-3
        turned = np.angle(((second - [62.5e-3, 0]) @ [1, 1j])[wheel] / ((first - [62.5e-3, 0]) @ [1, 1j])[wheel])
        np.testing.assert_allclose(turned, -math.radians(2), atol=1e-9)
        assert np.abs(file["VTKHDF/PointData/displacement_m"][...]).max() < 1e-4
    code = main(["stiffness", str(JOB), "--out", str(tmp_path / "b"), *options[:6], "--fields", *QUICK])
    assert code == 0
    assert len(list((tmp_path / "b").glob("stress_*deg.png"))) == 1


def test_animation(tmp_path, capsys):
    from PIL import Image

    options = ["--twist-deg", "0.1", "--angles", "0", "3", "17", "--animation", "2", *QUICK, "--no-pictures"]
    assert main(["stiffness", str(JOB), "--out", str(tmp_path), *options]) == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["stiffness.csv", "stress.gif", "summary.json"]
    with Image.open(tmp_path / "stress.gif") as made:
        assert made.n_frames == 2
    assert main(["stiffness", str(JOB), "--out", str(tmp_path / "b"), "--animation", "1"]) == 2
    assert "--animation" in capsys.readouterr().err
    assert not (tmp_path / "b").exists()


def test_fields_open_in_vtk(tmp_path):
    options = ["--twist-deg", "0.1", "--angles", "2", "3", "5", "--fields", "all", "--coarsen", "4", "--no-estimate"]
    assert main(["stiffness", str(JOB), "--out", str(tmp_path), *options]) == 0
    code = """
import sys
from vtkmodules.vtkIOHDF import vtkHDFReader
reader = vtkHDFReader(); reader.SetFileName(sys.argv[1]); reader.UpdateInformation()
assert reader.GetNumberOfSteps() == 2
for step in range(2):
    reader.SetStep(step); reader.Update(); grid = reader.GetOutput()
    assert abs(reader.GetTimeValue() - (2.0, 5.0)[step]) < 1e-9, reader.GetTimeValue()
    assert grid.GetCellType(0) == 22 and grid.GetNumberOfPoints() > 1000
    assert grid.GetPointData().GetArray("von_mises_Pa").GetRange()[1] > 1e7
"""
    subprocess.run([sys.executable, "-c", code, str(tmp_path / "fields.vtkhdf")], check=True)


def test_a_failed_position_is_told_and_in_the_table(tmp_path, capsys, monkeypatch):
    def weak(pair, first):
        made = solve_elements(pair, first)
        bad = np.abs(made.pinion_angle - math.radians(4)) < 1e-9
        return made.with_status(np.where(bad, "not_converged", made.status))

    monkeypatch.setattr("gearfe.gears.gearmesh.positions.solve_elements", weak)
    code = main(["stiffness", str(JOB), "--out", str(tmp_path), "--twist-deg", "0.3", *QUICK, "--law", "nitsche"])
    assert code == 1
    said = capsys.readouterr()
    assert "3 positions failed" in said.err  # 4, 22 and 40 deg
    failed = [r for r in rows(tmp_path) if r["status"] != "converged"]
    assert [r["pinion_angle_deg"] for r in failed] == ["4", "22", "40"]
    for row in failed:
        for name in ("torque_wheel_Nm", "torque_pinion_Nm", "k_mesh_N_per_m", "peak_pressure_MPa", "teeth_in_contact"):
            assert math.isnan(float(row[name])), name
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["statuses"] == {"converged": 37, "not_converged": 3}
    assert summary["failed_pinion_angles_deg"] == pytest.approx([4, 22, 40])
    curve = StiffnessCurve.from_csv(tmp_path / "stiffness.csv")
    assert curve.failed.sum() == 3
    assert np.isfinite(curve.interpolate(math.radians(4)).value)


def test_the_load_of_a_variant_of_the_train(tmp_path, capsys):
    """The published one of the shipped job: 0.5 degrees by Nitsche's law, as with these options."""
    options = ["--coarsen", "3", "--angles", "2", "6", "14", "--no-estimate", "--no-pictures"]
    assert main(["stiffness", str(JOB), "--out", str(tmp_path / "a"), "--variant", "undamped_springs", *options]) == 0
    given = ["--twist-deg", "0.5", "--law", "nitsche"]
    assert main(["stiffness", str(JOB), "--out", str(tmp_path / "b"), *given, *options]) == 0
    assert (tmp_path / "a" / "stiffness.csv").read_text() == (tmp_path / "b" / "stiffness.csv").read_text()
    assert {(r["law"], r["twist_deg"]) for r in rows(tmp_path / "a")} == {("nitsche", "0.5")}
    job = json.loads((tmp_path / "a" / "summary.json").read_text())["job"]["stiffness"]
    assert (job["twist_deg"], job["torque_Nm"], job["law"]) == (0.5, None, "nitsche")
    capsys.readouterr()
    assert main(["stiffness", str(JOB), "--variant", "undamped_spring"]) == 2
    assert "unknown name 'undamped_spring'" in (said := capsys.readouterr().err)
    assert "did you mean 'undamped_springs'" in said


def test_a_position_without_contact_is_told(tmp_path, capsys):
    job = tmp_path / "job.toml"
    job.write_text(JOB.read_text().replace("\n[pair]\n", "\n[pair]\ncentre_distance_mm = 62.6\n"))
    options = ["--twist-deg", "0.02", "--twist-from", "centred", "--angles", "3", "1", "4", *QUICK]
    assert main(["stiffness", str(job), "--out", str(tmp_path), *options]) == 0
    assert "2 positions have no contact" in capsys.readouterr().err
    assert main(["stiffness", str(job), "--out", str(tmp_path), *options, "--twist-from", "contact"]) == 0
    assert "warning" not in capsys.readouterr().err


# ---- bad input ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"torque_Nm": None}, "no load: neither twist_deg nor torque_Nm"),
        ({"twist_deg": 0.5}, "conflicts with twist_deg"),
        ({"twist_deg": -0.5}, "stiffness.twist_deg = -0.5: must be finite and > 0"),
        ({"twist_deg": "true"}, "must be a number"),
        ({"twsit_deg": 0.5}, "did you mean 'twist_deg'?"),
        ({"law": '"nitshe"'}, "must be one of half_plane, nitsche, penalty"),
        ({"plane": '"strained"'}, "must be one of strain, stress"),
        ({"angle_step_deg": 0.0}, "angle_step_deg = 0.0: must be finite and > 0"),
        ({"angle_stop_deg": -3.0}, "must be >= angle_start_deg = 1"),
        ({"angle_step_deg": 1e-6}, "more than 100000 positions"),
        ({"angle_step_deg": 1e-6, "angle_stop_deg": None}, "angle_step_deg = 1e-06: makes more than 100000 positions"),
        ({"coarsen": 50.0}, "coarsen = 50.0: must be finite and >= 0.2 and <= 5"),
        ({"interpolation": '"spline"'}, "must be one of cubic, linear"),
        ({"torque_Nm": None, "twist_deg": 8.0}, "half a pitch of the wheel"),
    ],
)
def test_mistakes_in_the_file(tmp_path, capsys, changes, message):
    job = job_with(tmp_path, **changes)
    assert main(["stiffness", str(job), "--out", str(tmp_path / "out"), *QUICK]) == 2
    error = capsys.readouterr().err
    assert error.startswith("gearfe: error: ")
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists() or not list((tmp_path / "out").iterdir())


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--twist-deg", "0"], "--twist-deg = 0.0: must be finite and > 0"),
        (["--torque-Nm", "-1"], "--torque-Nm = -1.0"),
        (["--law", "glue"], "--law = 'glue': must be one of half_plane, nitsche, penalty"),
        (["--angles", "5", "1", "2"], "must be >= angle_start_deg = 5"),
        (["--angles", "0", "-1", "2"], "START STEP STOP = -1.0"),
        (["--fields", "x"], "'x': is no value of --fields"),
        (["--fields", "all", "2"], "must be 'all' or pinion angles"),
        (["--angles", "1", "1", "3", "--fields", "9.5"], "outside of the computed pinion angles"),
    ],
)
def test_mistakes_in_the_options(tmp_path, capsys, options, message):
    assert (
        main(["stiffness", str(JOB), "--out", str(tmp_path / "out"), *options, "--coarsen", "4", "--no-estimate"]) == 2
    )
    assert message in capsys.readouterr().err
    assert not list((tmp_path / "out").glob("*"))


def test_both_loads_as_options(capsys):
    assert main(["stiffness", str(JOB), "--twist-deg", "1", "--torque-Nm", "1"]) == 2
    assert "--torque-Nm: not allowed with argument --twist-deg" in capsys.readouterr().err


def test_missing_file_and_missing_table(tmp_path, capsys):
    assert main(["stiffness", str(tmp_path / "no.toml")]) == 2
    assert "there is no such file" in capsys.readouterr().err
    (tmp_path / "empty.toml").write_text("")
    assert main(["gear", str(tmp_path / "empty.toml")]) == 2
    assert "[pair]: is missing" in capsys.readouterr().err


def test_a_folder_that_cannot_be_made(tmp_path, capsys):
    (tmp_path / "file").write_text("here")
    code = main(["stiffness", str(JOB), "--out", str(tmp_path / "file" / "out"), *QUICK])
    assert code == 2
    assert "--out" in capsys.readouterr().err


@pytest.mark.parametrize("problem", [KeyboardInterrupt, OSError])
def test_interrupted_output_leaves_nothing(tmp_path, monkeypatch, problem):
    """The picture is the last but one file: when it fails, the finished table does not appear either."""

    def fails(*args, **kwargs):
        raise problem(28, "No space left on device") if problem is OSError else problem

    monkeypatch.setattr("gearfe.figures.stiffness.save", fails)
    code = main(["stiffness", str(JOB), "--out", str(tmp_path), "--twist-deg", "0.05", *QUICK])
    assert code == {KeyboardInterrupt: 130, OSError: 2}[problem]
    assert not list(tmp_path.iterdir())


# ---- other commands -------------------------------------------------------------------------------------------------


def test_gear(tmp_path, capsys):
    assert main(["gear", str(JOB), "--out", str(tmp_path), "--angle-deg", "7"]) == 0
    said = capsys.readouterr().out
    for part in ("contact_ratio", "1.44", "centre_distance_mm", "62.5", "base_diameter_mm"):
        assert part in said
    files = ["gear_pair.json", "gear_pair.png", "gearbox.json", "gearbox.png"]
    assert sorted(p.name for p in tmp_path.iterdir()) == files
    geometry = json.loads((tmp_path / "gear_pair.json").read_text())
    assert geometry["pinion"]["base_diameter_mm"] == pytest.approx(50 * math.cos(math.radians(25)))
    assert geometry["path_of_contact"]["C"]["pinion_roll_mm"] == pytest.approx(25 * math.sin(math.radians(25)))


@pytest.mark.parametrize("suffix", ["msh", "vtu", "inp"])
def test_mesh(tmp_path, capsys, suffix):
    path = tmp_path / f"gears.{suffix}"
    assert main(["mesh", str(JOB), "--out", str(path), "--coarsen", "4", "--sector"]) == 0
    assert "wheel_flank_left" in capsys.readouterr().out
    assert path.stat().st_size > 10_000


def test_mesh_into_a_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["mesh", str(JOB), "--out", ".", "--coarsen", "4", "--sector", "--no-pictures"]) == 0
    assert (tmp_path / "gears.msh").stat().st_size > 10_000


def test_mesh_mistakes(tmp_path, capsys):
    assert main(["mesh", str(JOB), "--out", str(tmp_path / "gears.step")]) == 2
    assert "must end in one of .msh, .vtu, .inp" in capsys.readouterr().err
    assert main(["mesh", str(JOB), "--out", str(tmp_path / "gears.msh"), "--coarsen", "0"]) == 2


def test_as_a_process(tmp_path):
    command = [
        sys.executable,
        "-m",
        "gearfe",
        "stiffness",
        str(JOB),
        "--out",
        str(tmp_path),
        "--twist-deg",
        "0.05",
        *QUICK,
    ]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env=os.environ, check=False)
    assert done.returncode == 0, done.stderr
    assert only_stages(done.stderr)
    assert len(rows(tmp_path)) == 40


def test_the_script(tmp_path):
    script = [sys.executable, str(EXAMPLES / "stiffness_sweep.py")]
    job = job_with(tmp_path, torque_Nm=None, twist_deg=0.3, coarsen=3, angle_stop_deg=4)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [*script, str(job), str(tmp_path / "k.csv")], capture_output=True, text=True, env=environment, check=False
    )
    assert done.returncode == 0, done.stderr
    curve = StiffnessCurve.from_csv(tmp_path / "k.csv")
    assert list(np.round(np.degrees(curve.pinion_angle), 9)) == [1, 2, 3, 4]


def test_the_estimate_reaches_beyond_the_coarsest_mesh(tmp_path, capsys):
    options = ("--twist-deg", "0.5", "--angles", "2", "6", "8", "--coarsen", "4.5", "--no-pictures")
    assert main(["stiffness", str(JOB), "--out", str(tmp_path), *options]) == 0
    assert "discretisation error" in capsys.readouterr().out


def test_fields_in_any_order_and_beside_failures(tmp_path, capsys, monkeypatch):
    """Angles are sorted; one without a solution is left out of the series, and the table has its status."""

    def one_fails(pair, first):
        made = solve_elements(pair, first)
        bad = np.isclose(np.degrees(made.pinion_angle), 6.0)
        return made.with_status(np.where(bad, "not_converged", made.status))

    monkeypatch.setattr("gearfe.gears.gearmesh.positions.solve_elements", one_fails)
    options = ("--twist-deg", "0.3", "--angles", "3", "3", "9", "--fields", "9", "6", "3")
    assert main(["stiffness", str(JOB), "--out", str(tmp_path), *QUICK, "--law", "nitsche", *options]) == 1
    assert [r["status"] for r in rows(tmp_path)] == ["converged", "not_converged", "converged"]
    assert {p.name for p in tmp_path.glob("stress_*.png")} == {"stress_3deg.png", "stress_9deg.png"}
    assert main(["stiffness", str(JOB), "--out", str(tmp_path), *QUICK, *options[:6], "--fields", "12.5"]) == 2
    assert "outside of the computed pinion angles; the nearest is 9 deg" in capsys.readouterr().err
    assert main(["stiffness", str(JOB), "--out", str(tmp_path), *QUICK, *options[:6], "--fields", "5.3"]) == 0
    assert "nearest computed pinion angle, 6 deg" in capsys.readouterr().err
    assert (tmp_path / "stress_6deg.png").is_file()


def test_torque_transmission_error_and_both_stiffnesses_are_printed(tmp_path, capsys):
    """Under a torque; numbers are those of the table: T/(twist r_b^2) and its slope, and twist times r_b."""
    options = ("--torque-pinion-Nm", "60", "--no-pictures")
    assert main(["stiffness", str(JOB), "--out", str(tmp_path), *QUICK, *options]) == 0
    said = capsys.readouterr().out
    assert "torque: 90 N m at the wheel, 60 N m at the pinion\n" in said
    curve, told = (
        StiffnessCurve.from_csv(tmp_path / "stiffness.csv"),
        json.loads((tmp_path / "summary.json").read_text()),
    )
    error = 1e6 * curve.base_radius * curve.twist
    assert told["transmission_error"]["peak_to_peak_um"] == pytest.approx(np.ptp(error), rel=1e-9)
    assert f"transmission error: mean {error.mean():.4g}, peak to peak {np.ptp(error):.3g} um\n" in said
    for name, key, values in (
        ("secant", "mesh_stiffness", 90.0 / curve.twist / curve.base_radius**2),
        ("tangent", "tangent_stiffness", curve.k_tangent),
    ):
        assert told[key]["mean_N_per_m"] == pytest.approx(values.mean(), rel=0.02)
        assert f"mesh stiffness, {name}: mean {1e-6 * told[key]['mean_N_per_m']:.4g}, smallest" in said


def test_load_and_pressure_are_told(tmp_path, capsys):
    """At 0.5 deg the torque is beyond what the steel bears, and tip rounds bear at pair changes."""
    options = ("--twist-deg", "0.5", "--angles", "0", "3", "15", "--no-pictures")
    assert main(["stiffness", str(JOB), "--out", str(tmp_path), *QUICK, *options]) == 0
    said = capsys.readouterr().out
    assert "torque at the wheel: mean" in said
    assert "transmission error" not in said  # it is the given twist
    assert "above 1500 MPa, the allowable stress number sigma_Hlim of case-hardened steel" in said
    assert "a tip round carries load" in said
    told = json.loads((tmp_path / "summary.json").read_text())
    curve = StiffnessCurve.from_csv(tmp_path / "stiffness.csv")
    torque = told["load"]["torque_wheel_Nm"]
    assert torque["largest"] == pytest.approx(curve.torque_wheel.max(), rel=1e-12)
    assert told["contact_pressure"]["largest_hertzian_MPa"] == pytest.approx(1e-6 * np.nanmax(curve.peak_pressure))
    assert told["contact_pressure"]["positions_with_a_rounded_edge_bearing"] == (curve.edge == "rounded").sum() > 0
    light = ("--twist-deg", "0.01", "--angles", "12", "1", "14", "--no-pictures")
    assert main(["stiffness", str(JOB), "--out", str(tmp_path), *QUICK, *light]) == 0
    assert "case-hardened" not in capsys.readouterr().out
