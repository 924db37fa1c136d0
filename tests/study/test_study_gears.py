"""Studies of gears: load maps wherever they run, what cases share, cases alone, error estimates, the page's outputs."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import pytest

from gearfe.base.config import read_toml
from gearfe.base.tables.jobs import only_mesh
from gearfe.base.tables.text import toml_document
from gearfe.cli.main import main
from gearfe.gears.gearmesh import sweep
from gearfe.gears.gearmesh.job import stiffness_job
from gearfe.study.design import study_cases
from gearfe.study.job import read_study, run_study
from tests.makers.files import csv_rows
from tests.makers.studies import rows_of
from tests.places import DOCS, GEOMETRY

PAGE = (DOCS / "study.md").read_text(encoding="utf-8")
PAIR = """
[pair]
module_mm = 2.0
pressure_angle_deg = 20.0
face_width_mm = 10.0
[pair.pinion]
teeth = 22
bore_diameter_mm = 10.0
[pair.wheel]
teeth = 33
bore_diameter_mm = 15.0
[microgeometry]
"""
LOADMAP = """
[loadmap]
torques_Nm = [30.0, 60.0]
positions = 6
[study]
job = "loadmap"
design = "factorial"
[study.parameters]
microgeometry.pinion.profile_crowning_um = [0.0, 4.0]
pair.pinion.profile_shift = [0.0, 0.1]
[study.outputs]
peak_to_peak_um = "torques.transmission_error_peak_to_peak_um[torques.torque_Nm == 60]"
stiffness = "mean(k_mesh_N_per_m)"
least = "min(k_mesh_N_per_m)"
"""


@pytest.fixture
def study(tmp_path: Path):
    (tmp_path / "study.toml").write_text(PAIR + LOADMAP)
    return read_study(tmp_path / "study.toml")


def test_load_maps_are_the_same_on_processes_and_alone(study, tmp_path):
    """Bit for bit; a case that is written out gives the digits of its row by the job's own command."""
    made = run_study(study, tmp_path / "one", jobs=1)
    run_study(study, tmp_path / "two", jobs=2)
    assert rows_of(tmp_path / "one") == rows_of(tmp_path / "two")
    assert len(set(made.output("least"))) == 4
    case = tmp_path / "three.toml"
    assert main(["study", str(study.path), "--row", "3", "--write", str(case)]) == 0
    assert main(["loadmap", str(case), "--out", str(tmp_path / "alone"), "--no-pictures"]) == 0
    least = min(float(row["k_mesh_N_per_m"]) for row in csv_rows(tmp_path / "alone" / "loadmap.csv"))
    told = [row for row in csv_rows(tmp_path / "alone" / "loadmap_torques.csv") if float(row["torque_Nm"]) == 60.0]
    assert made.output("least")[3] == least
    assert made.output("peak_to_peak_um")[3] == float(told[0]["transmission_error_peak_to_peak_um"])


def test_gears_are_condensed_once_for_the_cases_that_share_them(tmp_path, monkeypatch):
    """Cases alternate between two pairs, and run one pair after the other."""
    (tmp_path / "study.toml").write_text((PAIR + LOADMAP).replace("face_width_mm = 10.0", "face_width_mm = 11.0"))
    study = read_study(tmp_path / "study.toml")
    condensed, elastic_pair = [], sweep.elastic_pair
    monkeypatch.setattr(sweep, "elastic_pair", lambda *a, **more: condensed.append(a) or elastic_pair(*a, **more))
    assert [case[1] for case in study.cases] == [0.0, 0.1, 0.0, 0.1]
    run_study(study, tmp_path / "out", jobs=1)
    assert [pair.pinion.profile_shift for pair, *_ in condensed] == [0.0, 0.1]


def test_error_estimates_are_outputs(tmp_path):
    job = '[stiffness]\ntorque_Nm = 60.0\nlaw = "half_plane"\nangle_step_deg = 4.0\n'
    text = PAIR + job + '[study]\njob = "stiffness"\ndesign = "factorial"\nestimate = true\n'
    text += "[study.parameters]\npair.pinion.profile_shift = [0.1]\n"
    text += '[study.outputs]\nworst = "summary.error_estimate.worst_relative"\n'
    (tmp_path / "study.toml").write_text(text)
    study = read_study(tmp_path / "study.toml")
    made = run_study(study, tmp_path / "out", jobs=1)
    one = stiffness_job(only_mesh(study.task.tables(study.cases[0]), "job"))
    pair = one.pair
    curve = sweep.sweep_stiffness(pair, one.model, estimate_error=True, **one.sweep)
    assert made.output("worst")[0] == pytest.approx(curve.worst_error, rel=1e-12)
    assert made.output("worst")[0] > 0.0


def test_the_page_runs_a_study_from_python(study, tmp_path, monkeypatch):
    """On fewer cases; its first lines are those of the shipped file."""
    monkeypatch.chdir(tmp_path)
    few = read_study(GEOMETRY / "relief_study.toml")
    fewer = replace(few.table, cases=8)
    few = replace(few, table=fewer, cases=study_cases(fewer, GEOMETRY, few.task.raw)[1])
    block = next(b for b in re.findall(r"```python\n(.*?)```", PAGE, re.S) if "run_study(study" in b)
    block = "\n".join(line for line in block.splitlines() if not line.startswith(("study =", "made.to_")))
    names: dict = {"study": few}
    exec(compile(block.replace("jobs=2", "jobs=1"), "page", "exec"), names)
    assert names["made"].output("peak_to_peak_um").shape == (8,)
    assert (tmp_path / "out" / "relief_study" / "study.csv").is_file()


@pytest.mark.slow
def test_the_page_s_outputs_have_values(tmp_path):
    """Of the shipped train over 1.4 ms and at three speeds; the run-up's factor and rms are columns of its table."""
    rows = re.findall(r"^\| .* \| `(vibration|runup)` \| `(.*)` \|$", PAGE, re.M)
    assert len(rows) == 5
    raw = read_toml(GEOMETRY / "gear_train.toml")
    raw["train"]["duration_ms"] = 1.4
    raw["runup"] = {"speed_start_rad_per_s": 560.0, "speed_stop_rad_per_s": 600.0, "speeds": 3}
    for kind in ("vibration", "runup"):
        outputs = {f"y{i}": text for i, (of, text) in enumerate(rows) if of == kind}
        job = {"job": kind, "parameters": {"train.damping.ratio": [0.02]}, "outputs": outputs}
        (tmp_path / "study.toml").write_text(toml_document({**raw, "study": job}))
        for value in read_study(tmp_path / "study.toml").evaluate({}).values():
            assert math.isfinite(value)
            assert value > 0.0
