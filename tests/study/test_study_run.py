"""Studies: the same rows wherever cases run, nothing lost, jobs of every kind, the command."""

from __future__ import annotations

import csv
import json
import math
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gearfe.base.config import read_toml
from gearfe.base.errors import InputError, MissingLibraryError
from gearfe.base.files import output_folder
from gearfe.base.tables.text import toml_document
from gearfe.cli.main import main
from gearfe.study.case import DIED, Row, Task, solve_case
from gearfe.study.job import read_study, run_study
from tests.makers.counting import counted
from tests.makers.studies import rows_of, solved_before, stored_rows, written
from tests.places import GEOMETRY, ROOT

# --------------------------------------------------------------------------------------------- running, going on


def test_rows_do_not_depend_on_where_cases_run(tmp_path):
    study = read_study(written(tmp_path, cases=24))
    for name in ("one", "processes", "threads"):
        (tmp_path / name).mkdir()
    run_study(study, tmp_path / "one", jobs=1)
    run_study(study, tmp_path / "processes", jobs=2)
    with ThreadPoolExecutor(3) as executor:
        run_study(study, tmp_path / "threads", executor=executor)
    assert len(rows_of(tmp_path / "one")) == 25
    assert rows_of(tmp_path / "one") == rows_of(tmp_path / "processes") == rows_of(tmp_path / "threads")


def test_an_interrupted_study_goes_on(tmp_path, monkeypatch):
    """After a kill: rows that came out of order, cases missing, no table."""
    study = read_study(written(tmp_path))
    for name in ("whole", "killed"):
        (tmp_path / name).mkdir()
    run_study(study, tmp_path / "whole", jobs=1)
    solved_before(study, tmp_path / "killed", (4, 1))
    solved: list[int] = []

    def solve(task: Task, number: int, *more: Any) -> Row:
        solved.append(number)
        return solve_case(task, number, *more)

    monkeypatch.setattr("gearfe.study.run.solve_case", solve)
    with counted() as told:
        run_study(study, tmp_path / "killed", jobs=1)
    assert rows_of(tmp_path / "killed") == rows_of(tmp_path / "whole")
    assert solved == [0, 2, 3, 5, 6, 7]
    assert told[-1] == (8, 8, "cases")


def test_another_study_does_not_go_on_here(tmp_path):
    run_study(read_study(written(tmp_path)), tmp_path, jobs=1)
    with pytest.raises(InputError, match=r"study.cases differs.*--restart"):
        run_study(read_study(written(tmp_path, cases=9)), tmp_path, jobs=1)
    study = read_study(written(tmp_path))
    base = {**study.task.raw, "title": "another"}
    with pytest.raises(InputError, match=r"base.title differs"):
        run_study(replace(study, task=replace(study.task, raw=base)), tmp_path, jobs=1)
    run_study(read_study(written(tmp_path, cases=9)), tmp_path, jobs=1, restart=True)
    assert len(rows_of(tmp_path)) == 10


def test_a_driver_that_is_killed_loses_nothing(tmp_path):
    path = written(tmp_path, cases=700)
    command = [sys.executable, "-m", "gearfe", "study", str(path), "--out", str(tmp_path / "out"), "--no-pictures"]
    run = subprocess.Popen([*command, "--jobs", "1"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    table = tmp_path / "out" / "study.csv"
    limit = time.monotonic() + 300.0
    while not (table.exists() and table.stat().st_size > 2000) and time.monotonic() < limit:
        time.sleep(0.01)
    run.send_signal(signal.SIGKILL)
    assert run.wait() == -signal.SIGKILL
    before = {row[0]: row for row in stored_rows(tmp_path / "out")}
    exported = rows_of(tmp_path / "out")[1:]  # whole, though some moments old
    assert all(before[row[0]] == row for row in exported)
    assert 10 < len(before) < 700
    study = read_study(path)
    some = replace(study, cases=study.cases[:5])
    assert set(before) <= {str(n) for n in range(700)}
    for number in list(before)[:5]:
        assert some.evaluate(dict(zip(study.task.names, study.cases[int(number)], strict=True)))["y"] == float(
            before[number][4]
        )
    assert main(["study", str(path), "--out", str(tmp_path / "out"), "--no-pictures", "--jobs", "1"]) == 0
    after = {row[0]: row for row in rows_of(tmp_path / "out")[1:]}
    assert len(after) == 700
    assert all(after[number] == row for number, row in before.items())


def test_a_worker_that_dies_is_replaced(tmp_path):
    """Case 13 ends its process; in a program of its own, as users have it."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.makers.deadly", str(written(tmp_path))], capture_output=True, text=True,
        check=True, cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    rows = json.loads(done.stdout)
    assert sorted(case for case, _, _ in rows) == list(range(20))
    assert [case for case, status, _ in rows if status == DIED] == [13]
    assert all(value == math.sin(case) for case, _, value in rows if case != 13)


def test_a_script_that_starts_a_study_wherever_it_is_read_is_told(tmp_path):
    """Processes read the script again, and would start the study, too."""
    script = tmp_path / "script.py"
    written(tmp_path)
    script.write_text("from gearfe import read_study, run_study\nrun_study(read_study('study.toml'), 'out', jobs=2)\n")
    done = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, check=False, cwd=tmp_path, timeout=120.0,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert done.returncode != 0
    assert "jobs = 2: makes processes that end as they begin" in done.stderr
    script.write_text(script.read_text().replace("run_study(read", "if __name__ == '__main__': run_study(read"))
    subprocess.run([sys.executable, str(script)], check=True, cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)})
    assert len(rows_of(tmp_path / "out")) == 9


def test_workers_end_with_their_driver(tmp_path):
    path = written(tmp_path, cases=100000)
    command = [sys.executable, "-m", "gearfe", "study", str(path), "--out", str(tmp_path / "out"), "--jobs", "2"]
    run = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    table = tmp_path / "out" / "study.csv"
    limit = time.monotonic() + 300.0
    while not (table.exists() and table.stat().st_size > 2000) and time.monotonic() < limit:
        time.sleep(0.02)
    run.kill()
    assert run.stdout is not None
    run.communicate(timeout=20.0)  # ends when the last process that holds the pipe does


def test_cases_without_an_answer_are_rows(tmp_path):
    path = written(tmp_path)
    text = path.read_text().replace("bodies.a.position_m.1 = {", "bodies.a.mass_kg = {")  # negative in half the cases
    path.write_text(text)
    made = run_study(read_study(path), tmp_path, jobs=1)
    bad = [i for i, status in enumerate(made.cells["status"]) if status == "invalid"]
    masses = np.array([float(cell) for cell in made.cells["bodies.a.mass_kg"]])
    assert bad == np.flatnonzero(masses <= 0.0).tolist() != []
    assert all("bodies.a.mass_kg" in made.cells["message"][i] for i in bad)
    assert np.isnan(made.output("y")[bad]).all()


def test_a_hopeless_study_stops_and_keeps_its_rows(tmp_path):
    path = written(tmp_path, cases=500)
    ends = "{ low = -3.141592653589793, high = 3.141592653589793 }"
    bad = path.read_text().replace(f"position_m.1 = {ends}", "mass_kg = { low = -3.0, high = -1.0 }")
    path.write_text(bad)
    with pytest.raises(InputError, match=r"first 50 cases have no answer.*mass_kg"):
        run_study(read_study(path), tmp_path, jobs=1)
    assert len(rows_of(tmp_path)) == 51


def test_outputs_that_the_job_does_not_give_are_told_before_any_case(tmp_path):
    path = written(tmp_path)
    path.write_text(path.read_text().replace("sin(x1[0])", "sin(x1[0]) + energy.totl_J[0]"))
    with pytest.raises(InputError, match="did you mean 'total_J'"):
        run_study(read_study(path), tmp_path, jobs=1)
    assert not (tmp_path / "study.csv").exists()


# ------------------------------------------------------------------------------------------------ jobs and command


def test_gears_and_their_microgeometry(tmp_path):
    """A stiffness study gives what the sweep gives; cases that share gears have the digits of cases that do not."""
    from gearfe.base.tables.jobs import only_mesh
    from gearfe.gears.gearmesh.job import stiffness_job
    from gearfe.gears.gearmesh.sweep import sweep_stiffness

    job = "[pair]\npressure_angle_deg = 20.0\nface_width_mm = 10.0\n"
    job += "[pair.pinion]\nteeth = 22\npitch_diameter_mm = 44.0\nbore_diameter_mm = 10.0\n"
    job += "[pair.wheel]\nteeth = 33\npitch_diameter_mm = 66.0\nbore_diameter_mm = 15.0\n"
    job += '[stiffness]\ntorque_Nm = 60.0\nlaw = "half_plane"\nangle_step_deg = 4.0\n[microgeometry]\n'
    (tmp_path / "study.toml").write_text(
        job + '[study]\njob = "stiffness"\ndesign = "factorial"\n'
        "[study.parameters]\npair.pinion.profile_shift = [0.0, 0.1]\n"
        "microgeometry.pinion.profile_crowning_um = [0.0, 4.0]\n"
        '[study.outputs]\nk = "mean(k_mesh_N_per_m)"\n'
    )
    study = read_study(tmp_path / "study.toml")
    made = run_study(study, tmp_path, jobs=1)
    for case, k in zip(study.cases, made.output("k"), strict=True):
        raw = study.task.tables(case)
        one = stiffness_job(only_mesh(raw, "job"))
        pair = one.pair
        assert sweep_stiffness(pair, one.model, **one.sweep).k_mesh.mean() == pytest.approx(k, rel=1e-12)
    assert len(set(made.output("k"))) == 4


def test_a_train_in_a_rigid_housing(tmp_path):
    """The rows are those of the command with the same keys."""
    raw = read_toml(GEOMETRY / "gear_train.toml")
    raw["train"] |= {"housing": "rigid", "duration_ms": 0.7, "method": "taylor"}
    for name in ("variant", "variants"):
        raw["train"].pop(name)
    raw["train"]["curves"] = {"mesh_model": "variable_stiffness", "load": "stiffness"}
    raw["stiffness"] = {"twist_deg": 0.05, "law": "half_plane", "coarsen": 2.0, "angle_step_deg": 3.0}
    raw["study"] = {
        "job": "vibration", "design": "factorial", "parameters": {"train.drive.speed_rad_per_s": [300.0, 500.0]},
        "outputs": {"force": "max(contact_force_1_N)", "last": "contact_force_2_N[20]"},
    }  # fmt: skip
    (tmp_path / "study.toml").write_text(toml_document(raw))
    made = run_study(read_study(tmp_path / "study.toml"), tmp_path, jobs=1)
    command = ["vibration", str(tmp_path / "study.toml"), "--out", str(tmp_path / "out"), "--no-pictures"]
    assert main([*command, "--no-floquet", "--no-estimate", "--set", "train.drive.speed_rad_per_s=500"]) == 0
    with (tmp_path / "out" / "response.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert made.output("force")[1] == max(float(row["contact_force_1_N"]) for row in rows)
    assert made.output("last")[1] == float(rows[20]["contact_force_2_N"])
    raw["train"] |= {"duration_ms": 0.035, "step_us": 35.0}  # too short for a spectrum
    raw["study"]["outputs"] = {"force": "max(contact_force_1_N)"}
    (tmp_path / "study.toml").write_text(toml_document(raw))
    short = run_study(read_study(tmp_path / "study.toml"), tmp_path, jobs=1, restart=True)
    assert list(short.cells["status"]) == ["done", "done"]


def test_command_leaves_tables_and_pictures(tmp_path, capsys):
    path = written(tmp_path, cases=16)
    text = path.read_text() + 'x = "x1[0]"\n[study.limits]\ny = { low = 0.0 }\n'
    path.write_text(text.replace("seed = 3", 'seed = 3\nminimise = ["y"]\nmaximise = ["x"]'))
    assert main(["study", str(path), "--out", str(tmp_path / "out"), "--jobs", "1"]) == 0
    told = capsys.readouterr().out
    names = {
        "study.csv",
        "study.db",
        "study.json",
        "study.png",
        "study_lines.png",
        "study_pareto.png",
        "study_tornado.png",
    }
    assert {p.name for p in (tmp_path / "out").iterdir()} == names | {"summary.json"}
    assert "16 cases: 16 done" in told
    assert "within its limits" in told
    assert "Pareto set" in told
    assert main(["study", str(path), "--row", "5", "--write", str(tmp_path / "five.toml")]) == 0
    study = read_study(path)
    assert read_toml(tmp_path / "five.toml") == study.task.tables(study.cases[5])


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--jobs", "0"], "--jobs"),
        (["--row", "5"], "--write"),
        (["--row", "99", "--write", "x.toml"], "must be >= 0 and <= 7"),
    ],
)
def test_command_names_mistakes(tmp_path, capsys, arguments, told):
    assert main(["study", str(written(tmp_path)), "--out", str(tmp_path / "out"), *arguments]) == 2
    assert told in capsys.readouterr().err


@pytest.mark.skipif(sys.platform == "win32", reason="limits of a process are POSIX")
def test_a_full_disk_stops_and_keeps_all_rows(tmp_path):
    """A file may not grow beyond 8 kB: rows stop there, and go on when there is room."""
    path = written(tmp_path, cases=300)
    solved_before(read_study(path), output_folder(tmp_path / "out"), range(20))
    program = (
        "import resource, signal, sys; from gearfe.cli.main import main; "
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN); "
        "resource.setrlimit(resource.RLIMIT_FSIZE, (8192, 8192)); sys.exit(main(sys.argv[1:]))"
    )
    command = ["study", str(path), "--out", str(tmp_path / "out"), "--jobs", "1", "--no-pictures"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", program, *command], capture_output=True, text=True, env=environment, check=False
    )
    assert done.returncode == 2
    assert "study.db': cannot be written (disk I/O error); finished rows are kept" in done.stderr
    before = stored_rows(tmp_path / "out")
    assert 10 < len(before) < 300
    assert main(command) == 0
    after = rows_of(tmp_path / "out")
    assert len(after) == 301
    assert all(row in after for row in before)


def test_rows_for_other_programs(tmp_path):
    pandas, parquet = pytest.importorskip("pandas"), pytest.importorskip("pyarrow.parquet")
    path = written(tmp_path)
    assert main(["study", str(path), "--out", str(tmp_path / "out"), "--jobs", "1", "--no-pictures", "--parquet"]) == 0
    made = run_study(read_study(path), tmp_path / "out", jobs=1)
    frame = made.to_pandas()
    pandas.testing.assert_frame_equal(frame, parquet.read_table(tmp_path / "out" / "study.parquet").to_pandas())
    assert frame["y"].to_numpy() == pytest.approx(made.output("y"), abs=0.0)
    assert set(frame["status"]) == {"done"}
    xarray = pytest.importorskip("xarray")
    assert isinstance(made.to_xarray(), xarray.Dataset)


@pytest.mark.parametrize(
    ("library", "call"), [("pandas", "to_pandas"), ("xarray", "to_xarray"), ("pyarrow", "to_parquet")]
)
def test_a_library_that_is_missing_is_named(tmp_path, monkeypatch, library, call):
    made = run_study(read_study(written(tmp_path)), tmp_path, jobs=1)
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(MissingLibraryError, match=r"gearfe\[study\]"):
        getattr(made, call)(*([tmp_path / "x"] if call == "to_parquet" else []))
