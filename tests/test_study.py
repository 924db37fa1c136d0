"""Studies: designs, expressions, statistics against theory; the same rows wherever cases run; nothing lost."""

from __future__ import annotations

import csv
import itertools
import math
import os
import signal
import subprocess
import sys
import time
import tomllib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import norm, qmc, sobol_indices, truncnorm

from gearfe.cli import main
from gearfe.config import build, read_toml, set_key
from gearfe.errors import InputError
from gearfe.study.answer import Answer
from gearfe.study.case import DIED, Task
from gearfe.study.design import saltelli, study_cases
from gearfe.study.expressions import parse, value_of
from gearfe.study.job import read_study, run_study
from gearfe.study.parameters import read_parameters
from gearfe.study.run import side_by_side
from gearfe.study.statistics import pareto_set, proportion, spread
from gearfe.tables.study import StudyTable
from gearfe.tables.text import toml_document

JOBS = Path(__file__).parents[1] / "geometry"

#: Two free bodies at rest, whose places are the outputs: a job of two milliseconds.
BASE = """
[run]
end_s = 1e-3
step_s = 1e-3
method = "explicit"
[bodies.a]
mass_kg = 1.0
inertia_kg_m2 = 1.0
position_m = [0.0, 0.0]
[bodies.b]
mass_kg = 1.0
inertia_kg_m2 = 1.0
position_m = [0.0, 0.0]
[[outputs]]
name = "x1"
value = "x(a)"
[[outputs]]
name = "x2"
value = "y(a)"
[[outputs]]
name = "x3"
value = "x(b)"
"""
ISHIGAMI = """
[study]
job = "mechanism"
base = "base.toml"
design = "{design}"
cases = {cases}
seed = 3
[study.parameters]
bodies.a.position_m.0 = {{ low = -3.141592653589793, high = 3.141592653589793 }}
bodies.a.position_m.1 = {{ low = -3.141592653589793, high = 3.141592653589793 }}
bodies.b.position_m.0 = {{ low = -3.141592653589793, high = 3.141592653589793 }}
[study.outputs]
y = "sin(x1[0]) + 7*sin(x2[0])**2 + 0.1*x3[0]**4*sin(x1[0])"
"""


def written(folder: Path, design: str = "sobol", cases: int = 8, **more: str) -> Path:
    """A study of Ishigami's function beside its base job."""
    (folder / "base.toml").write_text(BASE)
    text = ISHIGAMI.format(design=design, cases=cases)
    for old, new in more.items():
        text = text.replace(old.replace("__", " = "), new)
    (folder / "study.toml").write_text(text)
    return folder / "study.toml"


def rows_of(folder: Path) -> list[list[str]]:
    """Rows of study.csv without the seconds."""
    with (folder / "study.csv").open(newline="") as stream:
        return [row[:-1] for row in csv.reader(stream)]


# ------------------------------------------------------------------------------------------ parameters and designs


def test_distributions_have_their_quantiles():
    given = {
        "pair.addendum": {"low": 0.9, "high": 1.1},
        "pair.dedendum": {"mean": 1.25, "deviation": 0.05},
        "pair.tip_round_mm": {"mean": 0.1, "deviation": 0.05, "low": 0.0, "high": 0.2},
        "pair.pinion.teeth": {"low": 18, "high": 20},
        "stiffness.plane": ["strain", "stress"],
    }
    even, normal, cut, whole, listed = read_parameters(given, "stiffness")
    share = np.array([0.05, 0.3, 0.5, 0.95])
    np.testing.assert_allclose(even.at(share), 0.9 + 0.2 * share)
    np.testing.assert_allclose(normal.at(share), norm(1.25, 0.05).ppf(share))
    np.testing.assert_allclose(cut.at(share), truncnorm(-2.0, 2.0, 0.1, 0.05).ppf(share))
    assert whole.at(np.array([0.0, 0.34, 0.99])) == [18, 19, 20]
    assert all(isinstance(value, int) for value in whole.at(share))
    assert listed.at(np.array([0.1, 0.9])) == ["strain", "stress"]


def test_names_may_be_tables_within_tables_or_quoted():
    nested = read_parameters({"pair": {"pinion": {"profile_shift": {"low": 0.0, "high": 0.3}}}}, "stiffness")
    quoted = read_parameters({"pair.pinion.profile_shift": {"low": 0.0, "high": 0.3}}, "stiffness")
    assert nested == quoted


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"pair.pinion.teth": [20]}, "did you mean 'teeth'"),
        ({"pear.pinion.teeth": [20]}, "did you mean 'pair'"),
        ({"pair.pinion": [20]}, "is a table, not a key"),
        ({"pair.addendum": []}, "is empty"),
        ({"pair.addendum": 1.0}, "must be a list of values or a distribution"),
        ({"pair.addendum": {"low": 1.0, "hgih": 2.0}}, "did you mean 'high'"),
        ({"pair.addendum": {"low": 2.0, "high": 1.0}}, "must be > low"),
        ({"pair.addendum": {"mean": 2.0}}, "is required beside mean"),
        ({"pair.pinion.teeth": {"low": 18.2, "high": 18.8}}, "holds no whole number"),
        ({"stiffness.plane": {"low": 0, "high": 1}}, "is no number"),
        ({"train.meshes.first.backlash_um": [1.0]}, "an entry has a number"),
    ],
)
def test_wrong_parameters_are_named(given, told):
    with pytest.raises(InputError, match=told):
        read_parameters(given, "stiffness")


def table(**keys) -> StudyTable:
    given = {"job": "stiffness", "outputs": {"k": "mean(k_mesh_N_per_m)"}, **keys}
    return build(StudyTable, given, "study")


def test_designs_are_those_of_their_seed(tmp_path):
    keys = {"pair.addendum": {"low": 0.9, "high": 1.1}, "pair.pinion.teeth": {"low": 18, "high": 40}}
    for design in ("latin_hypercube", "sobol", "saltelli"):
        made = [
            study_cases(table(design=design, cases=16, seed=seed, parameters=keys), tmp_path)[1] for seed in (1, 1, 2)
        ]
        assert made[0] == made[1] != made[2]
    one = [case[0] for case in study_cases(table(cases=50, parameters=keys), tmp_path)[1]]
    assert sorted(int((value - 0.9) / 0.2 * 50) for value in one) == list(range(50))  # one in each of 50 equal parts


def test_factorial_is_all_combinations(tmp_path):
    keys = {
        "pair.addendum": {"low": 0.9, "high": 1.1, "count": 3},
        "pair.pinion.teeth": {"low": 18, "high": 20},
        "stiffness.plane": ["strain", "stress"],
    }
    cases = study_cases(table(design="factorial", parameters=keys), tmp_path)[1]
    assert cases == list(itertools.product([0.9, 1.0, 1.1], [18, 19, 20], ["strain", "stress"]))
    with pytest.raises(InputError, match="no levels"):
        study_cases(table(design="factorial", parameters={"pair.addendum": {"low": 0.9, "high": 1.1}}), tmp_path)


def test_rows_come_from_a_table(tmp_path):
    (tmp_path / "rows.csv").write_text(
        "pair.pinion.teeth,pair.addendum,stiffness.plane\n20,1.0,strain\n21,1.1,stress\n"
    )
    parameters, cases = study_cases(table(design="rows", rows_csv="rows.csv"), tmp_path)
    assert [one.name for one in parameters] == ["pair.pinion.teeth", "pair.addendum", "stiffness.plane"]
    assert cases == [(20, 1.0, "strain"), (21, 1.1, "stress")]
    assert isinstance(cases[0][0], int)


def test_a_key_is_set_where_it_stands():
    raw = {"train": {"meshes": [{"driver": "a"}, {"driver": "b"}]}}
    set_key(raw, "train.meshes.1.backlash_um", 20.0, "x")
    set_key(raw, "pair.pinion.teeth", 21, "x")
    assert raw == {
        "train": {"meshes": [{"driver": "a"}, {"driver": "b", "backlash_um": 20.0}]},
        "pair": {"pinion": {"teeth": 21}},
    }
    with pytest.raises(InputError, match="has 2 entries"):
        set_key(raw, "train.meshes.2.backlash_um", 20.0, "x")


@pytest.mark.parametrize("name", ["gear_train.toml", "microgeometry.toml", "andrews.toml", "slider_crank.toml"])
def test_a_job_that_is_written_reads_the_same(name):
    raw = read_toml(JOBS / name)
    assert tomllib.loads(toml_document(raw)) == raw


# ----------------------------------------------------------------------------------------------------- expressions


ANSWER = Answer(
    {"cells": {"torque_Nm": [50.0, 100.0, 100.0], "te_um": ["1.5", "nan", "4"], "status": ["ok", "no", "ok"]},
     "orders": {"order": [0, 1], "at_50_um": np.array([3.0, 0.5])}},
    {"mesh": {"mean": 7.0}, "by": [1.0, 2.0], "none": None},
)  # fmt: skip


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("ptp(te_um)", 2.5),  # the gap is left out
        ("mean(te_um[torque_Nm == 50]) - 1", 0.5),
        ("max(cells.te_um[(torque_Nm > 60) & (status == 'ok')])", 4.0),
        ("orders.at_50_um[orders.order == 1]", 0.5),
        ("summary.mesh.mean**2 / summary['by'][1]", 24.5),
        ("interp(75, [50, 100][0] if False else torque_Nm, torque_Nm)", None),
        ("count(te_um > 2)", 1.0),
        ("rms(orders.at_50_um)", math.sqrt((9.0 + 0.25) / 2)),
        ("-abs(-summary.by[0])", -1.0),
    ],
)
def test_outputs_are_arithmetic_on_tables(text, value):
    if value is None:
        with pytest.raises(InputError, match="does not know"):
            value_of(parse(text, "y"), ANSWER, "y")
    else:
        assert value_of(parse(text, "y"), ANSWER, "y") == pytest.approx(value)
    assert math.isnan(value_of(parse("summary.none", "y"), ANSWER, "y"))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("te_mu", "did you mean 'te_um'"),
        ("summary.mash.mean", "did you mean 'mesh'"),
        ("te_um", "gives 3 values"),
        ("maen(te_um)", "did you mean 'mean'"),
        ("__import__('os')", "unknown name"),
        ("te_um.__class__", "has nothing below it"),
        ("(lambda: 1)()", "does not know"),
        ("mean(", "cannot be read"),
        ("summary.by[7]", "has no value"),
    ],
)
def test_what_is_no_output_is_named(text, told):
    with pytest.raises(InputError, match=told):
        value_of(parse(text, "y"), ANSWER, "y")


# ------------------------------------------------------------------------------------------------------ statistics


def test_intervals_of_shares_and_quantiles():
    # none of n: upper end 1 - (alpha/2)^(1/n), closed form of Clopper and Pearson
    none = proportion(0, 30)
    assert none["interval"] == pytest.approx([0.0, 1.0 - 0.025 ** (1.0 / 30)])
    rng = np.random.default_rng(5)
    held = 0
    for _ in range(300):
        low, high = spread(rng.standard_normal(80))["quantiles"]["50 %"]["interval"]
        held += low <= 0.0 <= high
    assert held >= 0.95 * 300 - 3 * math.sqrt(300 * 0.95 * 0.05)  # three deviations of the binomial count


def test_pareto_set_is_that_of_the_definition():
    values = np.random.default_rng(2).integers(0, 6, (60, 3)).astype(float)
    values[7] = np.inf
    beaten = [
        any((b <= a).all() and (b < a).any() for b in values) for a in values
    ]  # fmt: skip
    expected = [i for i, lost in enumerate(beaten) if not lost and i != 7]
    assert pareto_set(values).tolist() == expected


def ishigami(x1, x2, x3):
    return np.sin(x1) + 7.0 * np.sin(x2) ** 2 + 0.1 * x3**4 * np.sin(x1)


def test_ishigami_through_the_whole_machinery(tmp_path):
    """The study's indices are those of the function at the study's points."""
    study = read_study(written(tmp_path, "saltelli", 64))
    found = run_study(study, tmp_path, jobs=1).summary()["outputs"]["y"]["sobol"]
    y = ishigami(*np.array(study.cases).T)
    parts = {"f_A": y[None, :64], "f_B": y[None, 64:128], "f_AB": y[128:].reshape(3, 1, 64)}
    direct = sobol_indices(func=parts, n=64)
    np.testing.assert_allclose(list(found["first_order"].values()), direct.first_order.ravel(), rtol=1e-12)
    np.testing.assert_allclose(list(found["total_order"].values()), direct.total_order.ravel(), rtol=1e-12)


def test_points_for_the_indices_give_those_of_theory():
    """Ishigami's function for a = 7, b = 0.1 (Saltelli et al., Global Sensitivity Analysis, 2008, section 4.6)."""
    n = 1 << 14
    shares = saltelli(qmc.Sobol(6, rng=np.random.default_rng(3)).random_base2(14))
    y = ishigami(*((2.0 * shares - 1.0) * math.pi).T)
    parts = {"f_A": y[None, :n], "f_B": y[None, n : 2 * n], "f_AB": y[2 * n :].reshape(3, 1, n)}
    found = sobol_indices(func=parts, n=n)
    a, b, pi4 = 7.0, 0.1, math.pi**4
    v1, v2, v13 = 0.5 * (1 + b * pi4 / 5) ** 2, a**2 / 8, b**2 * pi4**2 * (1 / 18 - 1 / 50)
    v = v1 + v2 + v13
    np.testing.assert_allclose(found.first_order.ravel(), [v1 / v, v2 / v, 0.0], atol=0.01)
    np.testing.assert_allclose(found.total_order.ravel(), [(v1 + v13) / v, v2 / v, v13 / v], atol=0.01)


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


def test_an_interrupted_study_goes_on(tmp_path):
    """After a kill: rows that came out of order, a last line that is cut, cases missing."""
    study = read_study(written(tmp_path))
    run_study(study, tmp_path, jobs=1)
    whole = rows_of(tmp_path)
    lines = (tmp_path / "study.csv").read_text().splitlines(keepends=True)
    kept = [lines[0], lines[5], lines[2], lines[7][:20]]
    (tmp_path / "study.csv").write_text("".join(kept))
    told = []
    run_study(study, tmp_path, jobs=1, progress=lambda done, total, _: told.append((done, total)))
    assert rows_of(tmp_path) == whole
    assert told == [(n, 8) for n in range(3, 9)]  # two were there


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
    limit = time.monotonic() + 60.0
    while not (table.exists() and table.stat().st_size > 2000) and time.monotonic() < limit:
        time.sleep(0.01)
    run.send_signal(signal.SIGKILL)
    assert run.wait() == -signal.SIGKILL
    before = {row[0]: row for row in rows_of(tmp_path / "out")[1:-1]}  # the last one may be cut
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


@dataclass(frozen=True)
class Deadly(Task):
    """A base job that kills the process that solves case 13."""

    def tables(self, values):
        if values[0] == 13.0:
            os._exit(1)
        return super().tables(values)


def test_a_worker_that_dies_is_replaced(tmp_path):
    study = read_study(written(tmp_path))
    task = Deadly(**{**vars(study.task), "names": ("bodies.a.position_m.0",)})
    cases = [(n, (float(n),)) for n in range(20)]
    rows = [row for group in side_by_side(task, cases, 2) for row in group]
    assert sorted(row.case for row in rows) == list(range(20))
    assert [row.case for row in rows if row.status == DIED] == [13]
    assert all(row.outputs == (math.sin(float(row.case)),) or row.case == 13 for row in rows)


def test_cases_without_an_answer_are_rows(tmp_path):
    path = written(tmp_path)
    text = path.read_text().replace("bodies.a.position_m.1 = {", "bodies.a.mass_kg = {")  # negative in half the cases
    path.write_text(text)
    made = run_study(read_study(path), tmp_path, jobs=1)
    bad = [i for i, status in enumerate(made.columns["status"]) if status == "invalid"]
    masses = np.array([float(cell) for cell in made.columns["bodies.a.mass_kg"]])
    assert bad == np.flatnonzero(masses <= 0.0).tolist() != []
    assert all("bodies.a.mass_kg" in made.columns["message"][i] for i in bad)
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
    from gearfe.config import job_tables
    from gearfe.gear.pair import GearPair
    from gearfe.stiffness.job import StiffnessJob
    from gearfe.stiffness.sweep import sweep_stiffness

    job = "[pair]\npressure_angle_deg = 20.0\nface_width_mm = 10.0\n"
    job += "[pair.pinion]\nteeth = 22\npitch_diameter_mm = 44.0\nbore_diameter_mm = 10.0\n"
    job += "[pair.wheel]\nteeth = 33\npitch_diameter_mm = 66.0\nbore_diameter_mm = 15.0\n"
    job += '[stiffness]\ntorque_Nm = 60.0\nlaw = "half_plane"\nangle_step_deg = 4.0\n[microgeometry]\n'
    (tmp_path / "study.toml").write_text(
        job + '[study]\njob = "stiffness"\ndesign = "factorial"\n'
        "[study.parameters]\npair.pinion.profile_shift = [0.0, 0.1]\n"
        "microgeometry.pinion.crowning_um = [0.0, 4.0]\n"
        '[study.outputs]\nk = "mean(k_mesh_N_per_m)"\n'
    )
    study = read_study(tmp_path / "study.toml")
    made = run_study(study, tmp_path, jobs=1)
    for case, k in zip(study.cases, made.output("k"), strict=True):
        raw = study.task.tables(case)
        tables = job_tables(raw, "job", ("pair", "stiffness", "microgeometry"))
        pair = GearPair.from_table(tables["pair"])
        one = StiffnessJob(tables["pair"], tables["stiffness"], pair, tables["microgeometry"])
        assert sweep_stiffness(pair, **one.model, **one.sweep).k_mesh.mean() == pytest.approx(k, rel=1e-12)
    assert len(set(made.output("k"))) == 4


def test_a_train_in_a_rigid_housing(tmp_path):
    """The rows are those of the command with the same keys."""
    raw = read_toml(JOBS / "gear_train.toml")
    raw["train"] |= {"housing": "rigid", "duration_ms": 0.7, "method": "explicit"}
    for name in ("variant", "variants"):
        raw["train"].pop(name)
    raw["train"]["curves"] = {"law": "curve", "load": "stiffness"}
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


def test_command_leaves_tables_and_pictures(tmp_path, capsys):
    path = written(tmp_path, cases=16)
    text = path.read_text() + 'x = "x1[0]"\n[study.limits]\ny = { low = 0.0 }\n'
    path.write_text(text.replace("seed = 3", 'seed = 3\nminimise = ["y"]\nmaximise = ["x"]'))
    assert main(["study", str(path), "--out", str(tmp_path / "out"), "--jobs", "1"]) == 0
    told = capsys.readouterr().out
    names = {"study.csv", "study.json", "study.png", "study_lines.png", "study_pareto.png", "study_tornado.png"}
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


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"outputs": {}}, "is empty"),
        ({"outputs": {"a b": "1"}}, "must be a word"),
        ({"limits": {"q": {"low": 1.0}}}, "unknown name 'q'"),
        ({"limits": {"k": {}}}, "give low, high or both"),
        ({"minimise": ["k"], "maximise": ["k"]}, "stands in minimise, too"),
        ({"design": "rows"}, "is required"),
        ({"design": "rows", "rows_csv": "a.csv", "parameters": {"a": [1]}}, "columns are the parameters"),
        ({"rows_csv": "a.csv"}, "stands beside design"),
        ({"parameters": {}}, "is empty"),
        ({"design": "saltelli", "cases": 12}, "power of 2"),
        ({"job": "stifness"}, "did you mean 'stiffness'"),
    ],
)
def test_wrong_tables_are_named(keys, told, tmp_path):
    with pytest.raises(InputError, match=told):
        study_cases(table(**{"parameters": {"pair.addendum": {"low": 0.9, "high": 1.1}}, **keys}), tmp_path)
