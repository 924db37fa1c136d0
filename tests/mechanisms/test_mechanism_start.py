"""Starts of runs: that of the file is the default in Python, and a motion that contradicts the drawing is reported."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

from gearfe.cli.main import main
from gearfe.mechanisms import evaluate, load_mechanism
from gearfe.mechanisms.job import run_mechanism
from gearfe.mechanisms.results import reference_differences
from gearfe.mechanisms.start_moves import contradictions, moved_line
from gearfe.multibody import integrate
from tests.places import GEOMETRY

#: Position of the crank pin: the crank is drawn at atan2(0.2, 0.1) rad.
PIN = (0.1, 0.2)
FOUR_BAR = f"""
run = {{ end_s = 0.02, step_s = 0.01 }}
links = {{ mass_per_length_kg_per_m = 2.0 }}
[joints]
O = {{ at_m = [0.0, 0.0], links = ["ground", "crank"] }}
A = {{ at_m = {list(PIN)}, links = ["crank", "coupler"] }}
B = {{ at_m = [0.7, 0.5], links = ["coupler", "rocker"] }}
C = {{ at_m = [0.8, 0.0], links = ["rocker", "ground"] }}
drive = {{ type = "prescribed", body = "crank", coordinate = "angle", motion_rad = "MOTION" }}
"""


def four_bar(folder: Path, motion: str) -> Path:
    path = folder / "fourbar.toml"
    path.write_text(FOUR_BAR.replace("MOTION", motion), encoding="utf-8")
    return path


def test_a_run_without_start_begins_as_the_file_says() -> None:
    """[start] of the shipped slider crank: v_B = -4 m/s. At rest it would be 0."""
    crank = load_mechanism(GEOMETRY / "slider_crank.toml")
    times = np.linspace(0.0, 1.0, 51)
    run = integrate(crank.system, times, tolerance=1e-10)
    outputs = evaluate(crank, run).outputs
    assert outputs["v_B_m_per_s"][0] == pytest.approx(-4.0, abs=1e-12)
    np.testing.assert_array_equal(run.q, integrate(crank.system, times, tolerance=1e-10, start=crank.start()).q)
    assert reference_differences(crank, run)["crank_angle_rad"] < 1e-9  # against a solution in quadruple precision


def test_a_run_of_flexible_links_begins_as_the_file_says() -> None:
    mechanism = load_mechanism(GEOMETRY / "elastic_slider_crank.toml")
    run = integrate(mechanism.system, [0.0, 1e-4], tolerance=1e-5)
    np.testing.assert_array_equal(run.start.v, mechanism.start().v)


@pytest.mark.parametrize("turns", [1, -2])
def test_whole_turns_do_not_contradict_the_drawing(tmp_path: Path, turns: int) -> None:
    drawn = math.atan2(PIN[1], PIN[0])
    mechanism = load_mechanism(four_bar(tmp_path, f"{drawn + 2.0 * math.pi * turns!r} + 2*pi*time"))
    start = mechanism.start()
    assert start.q[2] == pytest.approx(mechanism.system.start_q[2] + 2.0 * math.pi * turns)
    assert contradictions(mechanism, start) == []
    assert moved_line(mechanism, start) == ""


def test_a_motion_that_contradicts_the_drawing_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    drawn = math.atan2(PIN[1], PIN[0])
    path = four_bar(tmp_path, "2*pi*time")
    assert main(["mechanism", str(path), "--out", str(tmp_path / "run"), "--no-pictures"]) == 0
    said = capsys.readouterr().err
    found = re.search(r"warning: joints\.drive\.motion_rad = '2\*pi\*time': is (\S+) rad at the start", said)
    assert found is not None
    assert float(found[1]) == 0.0
    assert f"give {drawn:.6g} rad" in said
    assert f"moves crank by {math.hypot(*PIN) * math.sin(drawn / 2):.3g} m" in said  # its centre, half of a chord
    assert f"add {drawn:.6g} to the motion" in said
    summary = json.loads((tmp_path / "run" / "summary.json").read_text(encoding="utf-8"))
    assert summary["largest_move_to_the_start"]["rotation_rad"] == pytest.approx(-drawn, abs=1e-9)
    assert len(summary["warnings"]) == 1


@pytest.mark.parametrize("motion", ["atan2(2, 1) + 2*pi*time", "1.107 + 2*pi*time"])
def test_a_motion_that_begins_as_drawn_is_not(motion: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The second one is rounded to three digits after the point."""
    path = four_bar(tmp_path, motion)
    assert main(["mechanism", str(path), "--out", str(tmp_path / "run"), "--no-pictures"]) == 0
    said = capsys.readouterr()
    assert "warning" not in said.err
    assert "Closing the joints" not in said.out


def test_rough_start_poses_are_reported_with_the_run(tmp_path: Path) -> None:
    """Start poses are guesses, so there is no warning: a line gives the largest displacement."""
    text = (GEOMETRY / "slider_crank.toml").read_text(encoding="utf-8")
    text = re.sub(r"(?s)\[start\.positions\]\n[^[]*", "", text).replace("angle_deg = -45.0", "angle_deg = -30.0")
    path = tmp_path / "rough.toml"
    path.write_text(re.sub(r"(?s)\[figure\].*", "", text), encoding="utf-8")
    outcome = run_mechanism(load_mechanism(path), tmp_path / "out", until=0.01, estimate=False)
    assert re.search(r"^Closing the joints moves (rod|crank) by \S+ m and rotates it by \S+ deg", outcome.text)
    assert outcome.summary["warnings"] == []


def test_the_reference_is_compared_with_the_run(tmp_path: Path) -> None:
    """Differences are those of the table at common times; a wrapped output is compared within a turn."""
    andrews = load_mechanism(GEOMETRY / "andrews.toml")
    outcome = run_mechanism(andrews, tmp_path, estimate=False)
    found = outcome.summary["reference_differences"]
    assert set(found) == set(andrews.file.figure.reference_columns)
    assert 0.0 < max(found.values()) < 1e-9
    assert "largest differences from the reference: beta_wrapped_rad " in outcome.text
    loose = run_mechanism(andrews, tmp_path, estimate=False, tolerance=1e-5)
    assert loose.summary["reference_differences"]["beta_wrapped_rad"] > found["beta_wrapped_rad"]


@pytest.mark.parametrize("analysis", ["equilibrium", "modes"])
def test_analyses_keep_each_others_files(analysis: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = FOUR_BAR[: FOUR_BAR.index("drive")] + '[forces.g]\ntype = "gravity"\nacceleration_m_per_s2 = [0.0, -9.81]\n'
    Path("four.toml").write_text(text, encoding="utf-8")
    assert main(["mechanism", "four.toml", "--no-pictures"]) == 0
    kept = {path.name for path in Path("out/four/mechanism").iterdir()}
    assert main(["mechanism", "four.toml", "--no-pictures", "--analysis", analysis]) == 0
    assert {path.name for path in Path("out/four/mechanism").iterdir()} == kept
    assert Path(f"out/four/{analysis}/bodies.csv").exists()


def test_numbers_are_expressions_without_parameters(tmp_path: Path) -> None:
    path = four_bar(tmp_path, "atan2(2, 1) + 2*pi*time")
    output = '[[outputs]]\nname = "crank_rad"\nvalue = "angle(crank)"\nwrap = "2*pi"\n'
    path.write_text(path.read_text(encoding="utf-8") + output, encoding="utf-8")
    assert load_mechanism(path).file.outputs[0].wrap == 2 * math.pi
