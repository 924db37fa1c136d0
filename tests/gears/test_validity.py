"""What the elastic pair is meant for: loads beyond it are flagged in tables and told."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from gearfe import StiffnessCurve, sweep_stiffness
from gearfe.cli.main import main
from gearfe.gears.gearmesh.sweep import sweep_loads
from gearfe.gears.geometry.validity import MOST_OVERLAP
from tests.makers.gears import pair as gear_pair
from tests.places import GEOMETRY

JOB = GEOMETRY / "gear_train.toml"
PAIR = gear_pair(tip_round=1e-4)
ANGLES = PAIR.mesh_cycle * np.array([0.1, 0.6])


def twist_of(overlap: float) -> float:
    """Twist (rad) at which rigid flanks overlap by so many modules along the line of action: r_b twist/m."""
    return overlap * PAIR.pinion.module / PAIR.wheel.base_radius


def test_positions_beyond_are_flagged_in_the_table(tmp_path: Path) -> None:
    for overlap, flag in ((0.98 * MOST_OVERLAP, 0), (1.02 * MOST_OVERLAP, 1)):
        curve = sweep_stiffness(PAIR, twist=twist_of(overlap), angles=ANGLES, coarsen=2.0)
        assert not curve.failed.any()
        assert curve.beyond_validity.tolist() == [flag, flag]
        curve.to_csv(tmp_path / "k.csv")
        assert StiffnessCurve.from_csv(tmp_path / "k.csv").beyond_validity.tolist() == [flag, flag]


def test_backlash_is_no_overlap() -> None:
    """It is taken up before the flanks touch."""
    loose = gear_pair(tip_round=1e-4, centre_distance=63.3e-3)
    lost = loose.contact_twist * loose.wheel.base_radius / loose.pinion.module
    assert lost > MOST_OVERLAP
    given = {"twist": loose.contact_twist + twist_of(0.05), "twist_from": "centred", "coarsen": 2.0}
    assert sweep_stiffness(loose, angles=ANGLES, **given).beyond_validity.tolist() == [0, 0]


def test_tables_of_others_do_not_say(tmp_path: Path) -> None:
    (tmp_path / "k.csv").write_text("pinion_angle_deg,k_mesh_N_per_m\n0,1e8\n9,1.2e8\n")
    curve = StiffnessCurve.from_csv(tmp_path / "k.csv", mesh_cycle=np.radians(18.0), base_radius=0.03)
    assert curve.beyond_validity.tolist() == [-1, -1]
    curve.to_csv(tmp_path / "again.csv")
    assert StiffnessCurve.from_csv(tmp_path / "again.csv").beyond_validity.tolist() == [-1, -1]


def test_the_command_tells_why(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--law", "half_plane", "--coarsen", "2", "--angles", "2", "6", "8", "--no-pictures", "--no-estimate"]
    assert main(["stiffness", str(JOB), "--out", str(tmp_path), "--twist-deg", "0.6", *options]) == 0
    said = capsys.readouterr().err
    assert "2 positions are beyond validity" in said
    assert "the flanks overlap by up to 0.142 modules, beyond the 0.12" in said
    assert json.loads((tmp_path / "summary.json").read_text())["positions_beyond_validity"] == 2
    assert main(["stiffness", str(JOB), "--out", str(tmp_path), "--twist-deg", "0.5", *options]) == 0
    assert "validity" not in capsys.readouterr().err


def test_load_maps_flag_their_heavy_torques() -> None:
    mapped = sweep_loads(PAIR, [100.0, 2600.0], angles=ANGLES, coarsen=2.0)
    assert mapped.quantity("beyond_validity").tolist() == [[0, 0], [1, 1]]
