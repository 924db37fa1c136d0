"""``gearfe housing``: what it prints, what it writes, what it says to bad input."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gearfe.cli.main import main
from gearfe.fem.reduction.modal_body import ModalBody
from gearfe.figures.housing import draw_bodies, picture_of_bodies

JOB = """
[housing]
[housing.mesh]
size_mm = 20.0
[housing.reduction]
modes = 10
"""


#: Columns of modes.csv: error of a frequency, and what it is the sum of.
PARTS = ("error_estimate", "mesh_error_estimate", "reduction_error_bound")


@pytest.fixture
def job(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("GEARFE_CACHE", str(tmp_path / "cache"))
    path = tmp_path / "job.toml"
    path.write_text(JOB)
    return path


def test_command_writes_its_files(job: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["housing", str(job), "--out", str(out), "--modes", "8"]) == 0
    printed = capsys.readouterr().out
    for word in ("mass            4.14", "bore 6", "mesh", "estimated error", "10 modes"):
        assert word in printed, word
    for name in ("modes.csv", "modes.vtkhdf", "housing.npz", "summary.json", "housing.png", "modes.png"):
        assert (out / name).stat().st_size > 500, name
    with (out / "modes.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    body = ModalBody.load(out / "housing.npz")
    assert [int(row["number"]) for row in rows] == list(range(1, 9))
    np.testing.assert_allclose(
        [float(row["frequency_Hz"]) for row in rows], body.coupled.frequencies_hz[:8], rtol=1e-12
    )
    # one estimate for each frequency, the sum of its parts
    parts = [[float(row[f"{part}_percent"]) for row in rows] for part in PARTS]
    np.testing.assert_allclose(parts[0], np.add(parts[1], parts[2]), rtol=1e-12)
    assert np.all(np.array(parts[0]) > 0.5)  # coarse elements and sharp edges
    # effective masses of all modes together are the mass that is not held
    masses = (body.momentum[:3] @ body.coupled.vectors) ** 2
    np.testing.assert_allclose([float(row["effective_mass_y_kg"]) for row in rows], masses[1, :8], rtol=1e-9)
    assert np.all(masses.sum(axis=1) < body.rigid_mass[0, 0])
    assert np.all(masses.sum(axis=1) > 0.8 * body.rigid_mass[0, 0])
    summary = json.loads((out / "summary.json").read_text())
    assert summary["mass_kg"] == pytest.approx(body.rigid_mass[0, 0])
    assert len(summary["attachments"]) == 6
    np.testing.assert_allclose(100.0 * np.array(summary["frequency_error_estimates"]), parts[0], rtol=1e-12)
    assert summary["response_error_estimate"] > summary["mesh_response_error_estimate"] > 0.0
    # a second run needs no mesher
    code = (
        "import sys\n"
        "from gearfe.cli.main import main\n"
        "assert main(sys.argv[1:]) == 0\n"
        "assert not {'gmsh', 'meshio'} & set(sys.modules)\n"
    )
    line = ["housing", str(job), "--out", str(tmp_path / "again"), "--modes", "8", "--no-pictures"]
    done = subprocess.run([sys.executable, "-c", code, *line], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "again" / "modes.csv").read_bytes() == (out / "modes.csv").read_bytes()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[housing]\nwall_thickness_mm = [-1.0, 4.0]\n", "wall_thickness_mm"),
        ("[housing]\nwals = 1\n", "unknown name 'wals'"),
        ("[housing]\n[[housing.shafts]]\nx_mm = 500.0\n", "misses every wall"),
        ("[pair]\n", "[housing]"),
    ],
)
def test_bad_jobs(job: Path, tmp_path: Path, text: str, message: str, capsys: pytest.CaptureFixture[str]) -> None:
    job.write_text(text)
    if text.startswith("[pair]"):
        job.write_text("")
    assert main(["housing", str(job), "--out", str(tmp_path / "out")]) == 2
    assert message in capsys.readouterr().err


def test_a_picture_that_cannot_be_drawn_costs_a_message(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "pyvista.py").write_text("raise ImportError('no graphics here')")
    monkeypatch.syspath_prepend(str(tmp_path))
    points, faces = np.eye(3), np.array([[0, 1, 2]])
    said = draw_bodies({tmp_path / "x.png": picture_of_bodies(points, faces, np.zeros((1, 3, 3)), ["x"])})
    assert "no graphics here" in said
    assert "libegl1" in said
    assert not (tmp_path / "x.png").exists()
