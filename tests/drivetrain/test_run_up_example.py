"""The shipped train run up through its resonance by the page's command, beside harmonic balance at steady speeds."""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest

from gearfe.cli.main import main
from tests.makers.files import csv_rows
from tests.makers.pages import command_lines
from tests.places import DOCS, GEOMETRY

#: Multiples of the first shaft's turns: once each mesh.
MESHES = {"contact_force_1_N": 20.0, "contact_force_2_N": 40.0 / 3.0}
Rows = Sequence[Mapping[str, str]]


def cut(rows: Rows, order: float, column: str) -> tuple[np.ndarray, np.ndarray]:
    """Speeds, rising, and amplitudes of an order."""
    of = [row for row in rows if float(row["order"]) == pytest.approx(order, abs=1e-6)]
    made = np.array(sorted((float(row["speed_rad_per_s"]), float(row[column])) for row in of))
    return made[:, 0], made[:, 1]


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Files of the page's command."""
    page = DOCS / "spectra.md"
    (line,) = [line for line in command_lines(page) if "2000*time" in line]
    out = tmp_path_factory.mktemp("run_up")
    _, *words = shlex.split(line)
    words[words.index("geometry/gear_train.toml")] = str(GEOMETRY / "gear_train.toml")
    words[words.index("--out") + 1] = str(out / "run_up")
    assert main(words) == 0
    return out


@pytest.mark.slow
def test_files_and_the_speed(folder: Path) -> None:
    made = {path.name for path in (folder / "run_up").iterdir()}
    assert made >= {f"{name}.{kind}" for name in ("spectrogram", "order_tracks") for kind in ("csv", "png")}
    tracks = csv_rows(folder / "run_up" / "order_tracks.csv")
    for row in tracks:
        assert float(row["speed_rad_per_s"]) == pytest.approx(300.0 + 2000.0 * float(row["time_s"]), rel=0.01)
    summary = json.loads((folder / "run_up" / "summary.json").read_text())
    assert summary["status"] == "done"
    assert summary["contact"]["contacts_lost"][0] > 0


@pytest.mark.slow
def test_between_resonances_orders_are_those_of_steady_motions(folder: Path) -> None:
    """Another method (harmonic balance in place of a transient) within 2 %; in the resonance the run-up lags behind."""
    speeds = {"speed_start_rad_per_s": 400.0, "speed_stop_rad_per_s": 720.0, "speeds": 65}
    keys = [word for name, value in speeds.items() for word in ("--set", f"runup.{name}={value}")]
    job, out = str(GEOMETRY / "gear_train.toml"), folder / "steady"
    assert main(["runup", job, *keys, "--no-pictures", "--no-stability", "--out", str(out)]) == 0
    tracks, steady = csv_rows(folder / "run_up" / "order_tracks.csv"), csv_rows(out / "orders.csv")
    for column, order in MESHES.items():
        (speed, height), known = cut(tracks, order, column), cut(steady, order, column)
        calm = (speed > 405.0) & (speed < 650.0)
        assert calm.sum() > 20
        np.testing.assert_allclose(height[calm], np.interp(speed[calm], *known), rtol=0.02)
    speed, height = cut(tracks, 20.0, "contact_force_1_N")
    known = cut(steady, 20.0, "contact_force_1_N")
    late, there = speed[height.argmax()], known[0][known[1].argmax()]
    assert 10.0 < late - there < 60.0
    assert 20.0 * there / (2.0 * math.pi) == pytest.approx(2213.0, rel=0.03)  # the mode that the first mesh meets
