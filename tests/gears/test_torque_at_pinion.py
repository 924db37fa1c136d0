"""A load as the torque at the pinion: in files, as options, in load maps and trains."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from gearfe.base.config import JobFile, read_toml
from gearfe.base.errors import InputError
from gearfe.base.tables.jobs import meshes_of
from gearfe.cli.main import main
from tests.places import GEOMETRY

JOB = str(GEOMETRY / "gear_train.toml")
COARSE = ["--coarsen", "4", "--angles", "0", "4", "8", "--no-estimate", "--no-pictures"]


def torque_of(*changes: str) -> float | None:
    path = JobFile(JOB, changes)
    (mesh,) = meshes_of(read_toml(path), path, None)
    return mesh.stiffness.torque_Nm


def test_times_the_ratio_it_is_the_torque_at_the_wheel(tmp_path: Path) -> None:
    """20 and 30 teeth: 60 N m at the pinion are 90 at the wheel, whose hub then needs 90 and the pinion's about 60."""
    assert main(["stiffness", JOB, "--torque-pinion-Nm", "60", "--out", str(tmp_path / "a"), *COARSE]) == 0
    assert main(["stiffness", JOB, "--torque-Nm", "90", "--out", str(tmp_path / "b"), *COARSE]) == 0
    table = (tmp_path / "a" / "stiffness.csv").read_text(encoding="utf-8")
    assert table == (tmp_path / "b" / "stiffness.csv").read_text(encoding="utf-8")
    load = json.loads((tmp_path / "a" / "summary.json").read_text(encoding="utf-8"))["load"]
    assert load["torque_wheel_Nm"]["mean"] == pytest.approx(90.0)
    torques = [float(row.split(",")[4]) for row in table.splitlines()[1:]]
    assert torques[1:] == pytest.approx([60.0] * 2, rel=2e-3)  # at 0 deg a tip round bears, off the line of action


def test_in_the_file() -> None:
    text = read_toml(JOB)["stiffness"]
    assert "torque_pinion_Nm" not in text
    assert torque_of() == text["torque_Nm"]
    with pytest.raises(InputError, match="conflicts with torque_Nm"):
        torque_of("stiffness.torque_pinion_Nm=60")
    with pytest.raises(InputError, match="must be finite and > 0"):
        torque_of("stiffness={torque_pinion_Nm=-60}")
    assert torque_of("stiffness={torque_pinion_Nm=60}") == pytest.approx(90.0)


def test_in_load_maps(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = ["loadmap", JOB, "--positions", "2", "--coarsen", "4", "--no-pictures", "--out", str(tmp_path)]
    assert main([*line, "--torques-pinion-Nm", "20", "40"]) == 0
    table = json.loads((tmp_path / "loadmap.json").read_text(encoding="utf-8"))["by_torque"]
    assert table["torque_Nm"] == pytest.approx([30.0, 60.0])
    path = JobFile(JOB, ["loadmap={torques_pinion_Nm=[20,40]}"])
    (mesh,) = meshes_of(read_toml(path), path, None)
    assert mesh.loads.torques() == pytest.approx([30.0, 60.0])
    assert main([*line, "--set", "loadmap={torques_pinion_Nm=[20],torques_Nm=[30]}"]) == 2
    assert "conflicts with torques_Nm" in capsys.readouterr().err
