"""Studies that search: closed optima with their tolerances, the best relief for a torque, what cannot be searched."""

from __future__ import annotations

import json
import os
import re
import sqlite3
import subprocess
import sys
import tomllib
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from gearfe.base.tables.jobs import load_job
from gearfe.cli.main import main
from gearfe.study.job import read_study
from tests.makers.studies import BASE, rows_of
from tests.places import GEOMETRY, ROOT

#: (x - 1)^2 + 3 (y - 2)^2 where the third place follows the first: 0 at (1, 2).
STUDY = """
[study]
job = "mechanism"
base = "base.toml"
design = "search"
cases = 160
minimise = ["f"]
[study.parameters]
bodies.a.position_m.0 = { low = -3.0, high = 3.0, tolerance = 0.1, also = ["bodies.b.position_m.0"] }
bodies.a.position_m.1 = { low = -3.0, high = 3.0, tolerance = 0.2 }
[study.outputs]
f = "(x1[0] - 1)**2 + 3*(x2[0] - 2)**2 + (x3[0] - x1[0])**2"
g = "x1[0] + x2[0]"
"""
X, Y = "bodies.a.position_m.0", "bodies.a.position_m.1"


def study_file(folder: Path, *changes: tuple[str, str]) -> str:
    (folder / "base.toml").write_text(BASE)
    text = STUDY
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "study.toml").write_text(text)
    return str(folder / "study.toml")


def ran(path: str, out: Path, *options: str) -> dict:
    assert main(["study", path, "--out", str(out), "--jobs", "1", *options]) == 0
    return json.loads((out / "summary.json").read_text())


def test_a_closed_optimum_and_its_tolerances(tmp_path, capsys) -> None:
    out = tmp_path / "out"
    made = ran(study_file(tmp_path), out)
    assert [made["best"][X], made["best"][Y]] == pytest.approx([1.0, 2.0], abs=0.01)
    f = made["outputs"]["f"]
    assert f["base"] == pytest.approx(1.0 + 3 * 4.0)
    assert f["best"] < 1e-4
    assert [f[side][X] for side in ("less", "more")] == pytest.approx([0.01, 0.01], abs=3e-3)
    assert [f[side][Y] for side in ("less", "more")] == pytest.approx([0.12, 0.12], abs=0.015)
    assert f["within_tolerances"] == pytest.approx([0.0, 0.13], abs=0.02)
    assert made["outputs"]["g"]["within_tolerances"] == pytest.approx([2.7, 3.3], abs=0.02)
    assert made["at_their_ends"] == []
    told = capsys.readouterr().out
    assert re.search(rf"f: .* base 13, .* within the tolerances\n  {X} less by its tolerance 0\.0", told)
    names = {"best.toml", "study.csv", "study.db", "study.json", "study.png", "study_lines.png", "study_tornado.png"}
    assert {path.name for path in out.iterdir()} == names | {"summary.json"}
    row = rows_of(out)[1 + made["best_case"]]
    assert [float(cell) for cell in row[1:4]] == [made["best"][X], made["best"][Y], f["best"]]
    # the job of the best point, whose third place follows the first
    best = tomllib.loads((out / "best.toml").read_text(encoding="utf-8"))
    assert best["bodies"]["b"]["position_m"][0] == made["best"][X]


def test_a_search_goes_on_where_it_was_interrupted(tmp_path) -> None:
    path = study_file(tmp_path)
    whole = ran(path, tmp_path / "whole", "--no-pictures")
    ran(path, tmp_path / "out", "--no-pictures")
    with closing(sqlite3.connect(tmp_path / "out" / "study.db")) as connection, connection:
        connection.execute("DELETE FROM rows WHERE number >= 40 OR number IN (7, 21)")  # came out of order
        connection.execute("PRAGMA user_version = 38")
    again = ran(path, tmp_path / "out", "--no-pictures")
    assert {k: v for k, v in again.items() if not k.startswith(("seconds", "timings"))} == {
        k: v for k, v in whole.items() if not k.startswith(("seconds", "timings"))
    }
    assert rows_of(tmp_path / "out") == rows_of(tmp_path / "whole")


def test_limits_bound_the_best_but_not_what_is_told_of_its_tolerances(tmp_path) -> None:
    """With x + y <= 2: the foot of the perpendicular in the metric of f, (1, 2) - (3, 1)/4, where f is 3/4."""
    path = study_file(tmp_path, ("[study.outputs]", "[study.limits]\ng = { high = 2.0 }\n[study.outputs]"))
    made = ran(path, tmp_path / "out", "--no-pictures")
    assert made["outputs"]["g"]["best"] <= 2.0
    assert made["outputs"]["f"]["best"] == pytest.approx(0.75, abs=0.01)
    assert made["outputs"]["g"]["within_tolerances"][1] > 2.2


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ((("bodies.b.position_m.0", "bodies.b.positon_m.0"),), "did you mean 'position_m'"),
        ((("position_m.1 = { low = -3.0, high = 3.0, tolerance = 0.2 }", "position_m.1 = [1.0, 2.0]"),), "no two ends"),
        ((('minimise = ["f"]', 'minimise = ["f"]\nmaximise = ["g"]'),), "must be one output"),
        ((("tolerance = 0.2", "tolerance = -0.2"),), "must be finite and >= 0"),
        ((("[study.outputs]", "[study.limits]\nf = { high = -1.0 }\n[study.outputs]"),), "within the limits"),
    ],
)
def test_what_cannot_be_searched_is_told(tmp_path, capsys, changes, told) -> None:
    path = study_file(tmp_path, *changes, ("cases = 160", "cases = 8"))
    assert main(["study", path, "--out", str(tmp_path / "out"), "--jobs", "1", "--no-pictures"]) == 2
    assert told in capsys.readouterr().err


def test_a_search_has_no_case_beforehand(tmp_path, capsys) -> None:
    path = study_file(tmp_path)
    assert main(["study", path, "--row", "3", "--write", str(tmp_path / "row.toml")]) == 2
    assert "best.toml" in capsys.readouterr().err
    assert read_study(path).cases == ()


def test_what_was_the_relief_command_names_the_search(tmp_path, capsys) -> None:
    assert main(["relief", "job.toml"]) == 2
    assert "gearfe new relief.toml" in capsys.readouterr().err
    (tmp_path / "job.toml").write_text("[relief]\ntorques_Nm = [100.0]\n")
    assert main(["gear", str(tmp_path / "job.toml")]) == 2
    assert 'design = "search"' in capsys.readouterr().err


def best_relief(tmp_path: Path, **changes: str) -> dict:
    text = (GEOMETRY / "relief.toml").read_text(encoding="utf-8")
    for key, value in changes.items():
        text = re.sub(rf"^{key} = \d+", f"{key} = {value}", text, flags=re.MULTILINE)
    (tmp_path / "relief.toml").write_text(text, encoding="utf-8")
    return ran(str(tmp_path / "relief.toml"), tmp_path / "out", "--no-pictures")


def test_the_shipped_search_finds_a_relief_on_both_gears(tmp_path) -> None:
    made = best_relief(tmp_path, positions="6", cases="40")
    error = made["outputs"]["error_um"]
    assert error["best"] < 0.5 * error["base"]
    assert error["best"] <= min(*error["less"].values(), *error["more"].values())
    table = load_job(tmp_path / "out" / "best.toml", ("microgeometry",), ("pair",))["microgeometry"]
    amount = made["best"]["microgeometry.pinion.tip_relief_um"]
    assert table.pinion.tip_relief_um == table.wheel.tip_relief_um == amount


@pytest.mark.slow
def test_long_relief_designed_for_a_torque(tmp_path) -> None:
    """Two parameters: the error at the torque at least 5 times smaller than without; its least torque within 5 %."""
    error = best_relief(tmp_path)["outputs"]["error_um"]
    assert error["base"] / error["best"] >= 5
    options = ["--torque-range", "60", "140", "33", "--out", str(tmp_path / "map"), "--no-pictures"]
    assert main(["loadmap", str(tmp_path / "out" / "best.toml"), *options]) == 0
    made = json.loads((tmp_path / "map" / "loadmap.json").read_text())["by_torque"]
    least = int(np.argmin(made["transmission_error_peak_to_peak_um"]))
    assert made["torque_Nm"][least] == pytest.approx(100, rel=0.05)


@pytest.mark.parametrize("cases", [24, 60, 100])
def test_a_search_keeps_its_budget(tmp_path, cases) -> None:
    """The points of the tolerances, 4 sides and 4 corners, are among them."""
    made = ran(study_file(tmp_path, ("cases = 160", f"cases = {cases}")), tmp_path / "out", "--no-pictures")
    assert made["cases"] <= cases
    assert made["outputs"]["f"]["best"] < made["outputs"]["f"]["base"]


@pytest.mark.parametrize("share", [1.0, 10.0])
def test_a_search_stops_where_its_tolerances_say_so(tmp_path, share) -> None:
    """The optimum (1, 2) is found within the tolerances, with a small part of the points that are allowed."""
    changes = ("tolerance = 0.1", f"tolerance = {0.1 * share}"), ("tolerance = 0.2", f"tolerance = {0.2 * share}")
    made = ran(study_file(tmp_path, ("cases = 160", "cases = 4000"), *changes), tmp_path / "out", "--no-pictures")
    assert abs(made["best"][X] - 1.0) <= 0.1 * share
    assert abs(made["best"][Y] - 2.0) <= 0.2 * share
    assert made["cases"] < 1000


@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C is sent as a signal")
def test_ctrl_c_prints_the_best_point_and_the_same_command_goes_on(tmp_path) -> None:
    path, out = study_file(tmp_path), tmp_path / "out"
    program = (
        "import os, signal, sys; from gearfe.cli.main import main; from gearfe.study.search import Search\n"
        "solve = Search.solve\n"
        "def stopped(self, points):\n"
        "    found = solve(self, points)\n"
        "    if len(self) > 30: os.kill(os.getpid(), signal.SIGINT)\n"
        "    return found\n"
        "Search.solve = stopped\n"
        "sys.exit(main(sys.argv[1:]))"
    )
    command = ["study", path, "--out", str(out), "--jobs", "1", "--no-pictures"]
    run = subprocess.run(
        [sys.executable, "-c", program, *command], capture_output=True, text=True, check=False,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert run.returncode == 130
    told = re.search(r"best of (\d+) points so far, case (\d+): .*f = (\S+), g = ", run.stderr)
    assert told is not None, run.stderr
    rows = rows_of(out)[1:]
    assert len(rows) == int(told[1]) > 30
    least = min(rows, key=lambda row: float(row[3]))
    assert told[2] == least[0]
    assert float(told[3]) == pytest.approx(float(least[3]), rel=1e-5)
    assert "the same command continues" in run.stderr
    again = ran(path, out, "--no-pictures")
    whole = ran(path, tmp_path / "whole", "--no-pictures")
    assert rows_of(out) == rows_of(tmp_path / "whole")
    assert again["best"] == whole["best"]
