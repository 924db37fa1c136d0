"""The command ``modes``: files, options, what a range follows from, studies, mistakes."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from gearfe.cli.main import main
from gearfe.study.job import read_study, run_study
from tests.makers.files import csv_rows
from tests.makers.job_texts import BARE_TRAIN, BORES

BEARINGS = "".join(
    f"[[train.bearings]]\nattachment = {i}\n"
    "stiffness_N_per_m = [5e7, 2e7, 5e7]\ntilt_stiffness_Nm_per_rad = [1e3, 1e3]\n"
    for i in (1, 2, 3, 4)
)
RUNUP = "[runup]\nspeed_start_rad_per_s = -200.0\nspeed_stop_rad_per_s = -900.0\nspeeds = 3\nband_Hz = 4000.0\n"


@pytest.fixture
def job(tmp_path: Path) -> Path:
    path = tmp_path / "job.toml"
    path.write_text(BARE_TRAIN + BORES + BEARINGS)
    return path


def test_tables_picture_and_summary(job: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["modes", str(job), "--out", str(out), "--speeds", "5", "--band-Hz", "20000", "--fields"]) == 0
    names = {path.name for path in out.iterdir()}
    assert names == {"modes.csv", "critical_speeds.csv", "summary.json", "campbell.png", "mode_gears.vtkhdf"}
    rows, summary = csv_rows(out / "modes.csv"), json.loads((out / "summary.json").read_text())
    assert sorted({float(row["speed_rad_per_s"]) for row in rows}) == [-600.0, -450.0, -300.0, -150.0, 0.0]
    for row in rows:
        assert sum(float(value) for name, value in row.items() if name.startswith("share_")) == pytest.approx(1.0)
        assert row["direction"] in {"forward", "backward", "planar", "mixed", "none"}
    assert len(rows) == 5 * len(summary["modes"])
    assert summary["speed_of_the_drive_rad_per_s"] == -300.0
    for margin in summary["nearest_modes"]:
        listed = {mode["name"]: mode for mode in summary["modes"]}
        mode = listed[margin["mode"]]
        ends = sorted((mode["frequency_Hz"], mode["frequency_at_the_fastest_speed_Hz"]))
        assert ends[0] - 1e-6 <= margin["frequency_Hz"] + margin["distance_Hz"] <= ends[1] + 1e-6
    for row in csv_rows(out / "critical_speeds.csv"):
        at = float(row["order"]) * abs(float(row["speed_rad_per_s"])) / (2.0 * math.pi)
        assert float(row["frequency_Hz"]) == pytest.approx(at, rel=1e-9)
    said = capsys.readouterr().out
    assert f"{len(summary['modes'])} modes from 0 to -600 rad/s" in said


def test_the_range_and_the_band_of_a_run_up_serve(job: Path, tmp_path: Path) -> None:
    """Run-up and modes have the same critical speeds: intersections of the same modes and orders."""
    job.write_text(job.read_text() + RUNUP)
    for command, options in (("modes", ["--speeds", "13"]), ("runup", ["--no-stability"])):
        assert main([command, str(job), "--out", str(tmp_path / command), "--no-pictures", *options]) == 0
    one, two = (csv_rows(tmp_path / command / "critical_speeds.csv") for command in ("modes", "runup"))
    assert [row["meets"] for row in one] == [row["meets"] for row in two]
    assert len(one) > 0
    for a, b in zip(one, two, strict=True):
        assert float(a["speed_rad_per_s"]) == pytest.approx(float(b["speed_rad_per_s"]), rel=1e-9)
        assert a["label"] == b["label"]
    frequencies = np.array([float(row["frequency_Hz"]) for row in csv_rows(tmp_path / "modes" / "modes.csv")])
    assert frequencies.min() <= 4000.0


def test_a_band_without_modes_is_an_answer(job: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["modes", str(job), "--out", str(out), "--band-Hz", "1", "--fields"]) == 0
    assert "0 modes" in capsys.readouterr().out
    assert csv_rows(out / "modes.csv") == csv_rows(out / "critical_speeds.csv") == []
    assert (out / "campbell.png").exists()


def test_modes_in_a_study(job: Path, tmp_path: Path) -> None:
    text = job.read_text() + (
        "[modes]\nspeeds = 3\nband_Hz = 20000.0\nspeed_stop_rad_per_s = -800.0\n"
        '[study]\njob = "modes"\ndesign = "factorial"\n'
        "[study.parameters]\ntrain.meshes.0.stiffness_N_per_m = [1e8, 2e8]\n"
        '[study.outputs]\nlowest = "min(frequency_Hz)"\nhighest = "max(frequency_Hz)"\n'
        'same = "summary.modes[0].frequency_Hz"\n'
    )
    job.write_text(text)
    made = run_study(read_study(job), tmp_path, jobs=1)
    assert list(made.cells["status"]) == ["done", "done"]
    lowest, highest = made.output("lowest"), made.output("highest")
    assert highest[1] > 1.01 * highest[0]  # a stiffer mesh; the lowest mode does not close it
    assert lowest == pytest.approx(made.output("same"), rel=1e-3)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--fields", "99"], "is no number of a mode"),
        (["--speed-start-rad-per-s", "100"], "changes sign"),
        (["--speed-stop-rad-per-s", "500"], "back flanks"),
        (["--speed-stop-rad-per-s", "0"], "speed of the drive is 0"),
        (["--speeds", "1"], "--speeds"),
    ],
)
def test_mistakes_are_one_line(job: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], options, words) -> None:
    code = main(["modes", str(job), "--out", str(tmp_path / "out"), "--no-pictures", *options])
    error = capsys.readouterr().err
    assert code == 2
    assert words in error
    assert not (tmp_path / "out").exists() or not list((tmp_path / "out").iterdir())


def test_a_range_that_falls_is_run_from_slow_to_fast(job: Path, tmp_path: Path) -> None:
    """The last speed of the command line is less than the first one of the run-up."""
    job.write_text(job.read_text() + RUNUP)
    assert main(["modes", str(job), "--out", str(tmp_path / "out"), "--no-pictures", "--speed-stop-rpm", "0"]) == 0
    speeds = [float(row["speed_rad_per_s"]) for row in csv_rows(tmp_path / "out" / "modes.csv")]
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert [summary[f"speed_{end}_rad_per_s"] for end in ("start", "stop")] == [0.0, -200.0]
    assert {0.0, -200.0} <= set(speeds)
