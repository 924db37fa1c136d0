"""Studies of run-ups: rows are those of the command with the same keys."""

from __future__ import annotations

import csv
import json
import math

from gearfe.cli.main import main
from gearfe.study.job import read_study, run_study
from tests.makers.job_texts import SMALL_TRAIN

STUDY = """
[runup]
speed_start_rad_per_s = 500.0
speed_stop_rad_per_s = 700.0
speeds = 5
[study]
job = "runup"
design = "factorial"
[study.parameters]
train.damping.ratio = [0.01, 0.05]
runup.speed_stop_rad_per_s = [700.0]
[study.outputs]
factor = "max(dynamic_factor_1)"
first = "summary.largest_dynamic_factor[0].value"
order = "max(orders.contact_force_1_N[orders.speed_rad_per_s == 500])"
modes = "count(modes.mode)"
where = "critical_speeds.speed_rad_per_s[0]"
"""


def test_a_run_up_in_a_study(tmp_path):
    rows = "\n".join(f"{18.0 * i / 12},{1e8 * (1 + 0.1 * math.cos(2 * math.pi * i / 12))}" for i in range(12))
    (tmp_path / "k.csv").write_text("pinion_angle_deg,k_mesh_N_per_m\n" + rows + "\n")
    job = tmp_path / "study.toml"
    job.write_text(SMALL_TRAIN.replace("stiffness_N_per_m = 1e8", 'curve = "k.csv"') + STUDY)
    made = run_study(read_study(job), tmp_path, jobs=1)
    assert list(made.cells["status"]) == ["done", "done"]
    out = tmp_path / "out"
    keys = ["--set", "train.damping.ratio=0.05"]
    assert main(["runup", str(job), "--out", str(out), "--no-pictures", *keys]) == 0
    table = list(csv.DictReader((out / "runup.csv").open(newline="")))
    orders = list(csv.DictReader((out / "orders.csv").open(newline="")))
    assert made.output("factor")[1] == max(float(row["dynamic_factor_1"]) for row in table)
    told = json.loads((out / "summary.json").read_text())
    assert made.output("first")[1] == told["largest_dynamic_factor"][0]["value"]
    at = [float(row["contact_force_1_N"]) for row in orders if float(row["speed_rad_per_s"]) == 500.0]
    assert made.output("order")[1] == max(at)
    assert made.output("factor")[0] != made.output("factor")[1]
