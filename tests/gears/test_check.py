"""Positions of a curve solved again on whole gears: `gearfe stiffness --check` and `gearfe.check_positions`."""

from __future__ import annotations

import csv
import math
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from gearfe import Gear, GearPair, check_positions, sweep_stiffness
from gearfe.base.errors import InputError
from gearfe.cli.main import main
from gearfe.gears.contact.laws import Penalty
from gearfe.gears.contact.whole_gears import newton

JOB = """
[pair]
module_mm = 2.5
pressure_angle_deg = 25.0
face_width_mm = 10.0
tip_round_mm = 0.1
[pair.pinion]
teeth = 10
bore_diameter_mm = 8.75
[pair.wheel]
teeth = 13
bore_diameter_mm = 11.375
[stiffness]
twist_deg = 0.4
angle_start_deg = 4.0
angle_step_deg = 4.0
angle_stop_deg = 12.0
law = "nitsche"
kinematics = "small"
coarsen = 5.0
flank_coarsen = 0.6
"""
FORM = {"module": 2.5e-3, "pressure_angle": math.radians(25), "face_width": 10e-3, "tip_round": 0.1e-3}
PAIR = GearPair(Gear(10, bore_diameter=8.75e-3, **FORM), Gear(13, bore_diameter=11.375e-3, **FORM))
ANGLES = np.radians([4.0, 8.0, 12.0])
NITSCHE = {"law": "nitsche", "coarsen": 5.0, "flank_coarsen": 0.6}
#: Both solve the same equations to a relative 1e-10 of forces; of the torque that is a few times as much.
SOLVERS = 1e-7


def checked(tmp_path, *options: str, job: str = JOB) -> tuple[int, list[dict[str, str]]]:
    """Exit code of the command, and the rows of its check."""
    path = tmp_path / "job.toml"
    path.write_text(job)
    code = main(["stiffness", str(path), "--out", str(tmp_path), "--no-estimate", "--no-pictures", *options])
    table = tmp_path / "stiffness_check.csv"
    return code, list(csv.DictReader(table.open(newline=""))) if table.exists() else []


def test_the_command_prints_and_writes_both_results(tmp_path, capsys) -> None:
    code, rows = checked(tmp_path, "--check", "3", "1")
    printed = capsys.readouterr().out
    curve = list(csv.DictReader((tmp_path / "stiffness.csv").open(newline="")))
    assert code == 0
    assert [(row["row"], row["pinion_angle_deg"]) for row in rows] == [("3", "12"), ("1", "4")]
    for row in rows:
        assert row["status"] == row["whole_gears_status"] == "converged"
        position = curve[int(row["row"]) - 1]
        for column in ("pinion_angle_deg", "twist_deg", "torque_wheel_Nm", "k_mesh_N_per_m", "contact_law"):
            assert row[column] == position[column]
        for column in ("torque_wheel_Nm", "k_mesh_N_per_m"):
            assert float(row[f"whole_gears_{column}"]) == pytest.approx(float(row[column]), rel=SOLVERS)
        assert abs(float(row["relative_difference"])) < SOLVERS
        assert f"position {row['row']} ({row['pinion_angle_deg']} deg): {float(row['torque_wheel_Nm']):.10g}" in printed
    assert printed.count("; difference ") == 2
    assert "within 1e-7" in printed


def test_a_run_without_check_leaves_no_old_table(tmp_path) -> None:
    (tmp_path / "stiffness_check.csv").write_text("row\n1\n")
    assert checked(tmp_path, "--law", "half_plane") == (0, [])


def test_half_plane_is_checked_by_nitsche_on_its_elements(tmp_path, capsys) -> None:
    """The whole gears carry the torque of Nitsche's curve, not that of the half-plane law; which is near."""
    code, rows = checked(tmp_path, "--law", "half_plane", "--check", "2")
    assert code == 0
    assert rows[0]["contact_law"].startswith("half_plane")
    assert rows[0]["whole_gears_contact_law"].startswith("nitsche")
    nitsche = sweep_stiffness(PAIR, twist=math.radians(0.4), angles=ANGLES, **NITSCHE, kinematics="small")
    assert float(rows[0]["whole_gears_torque_wheel_Nm"]) == pytest.approx(nitsche.torque_wheel[1], rel=SOLVERS)
    assert float(rows[0]["relative_difference"]) != 0.0
    assert "within 0.2 % on smooth flanks" in capsys.readouterr().out


def test_a_searched_torque_is_checked_at_its_twist() -> None:
    options = {"law": Penalty(1e15), "coarsen": 5.0, "flank_coarsen": 0.6, "kinematics": "small"}
    curve = sweep_stiffness(PAIR, torque=300.0, angles=ANGLES, **options)
    check = check_positions(curve, PAIR, [2], **options)
    assert check.whole_torque_wheel == pytest.approx(300.0, rel=SOLVERS)
    assert not check.failed.any()
    assert "1 solved" in repr(check)


def test_finite_strain_of_first_order_against_the_whole() -> None:
    """The curve leaves out what is of second order, and all sectors but the neighbours of loaded teeth."""
    curve = sweep_stiffness(PAIR, twist=math.radians(0.4), angles=ANGLES, **NITSCHE)
    small = sweep_stiffness(PAIR, twist=math.radians(0.4), angles=ANGLES, **NITSCHE, kinematics="small")
    check = check_positions(curve, PAIR, [2], **NITSCHE)
    share = abs(small.torque_wheel[1] / check.whole_torque_wheel[0] - 1)
    assert abs(check.relative_difference[0]) < 5e-4 < share


def test_positions_without_contact_or_twist() -> None:
    options = NITSCHE | {"kinematics": "small"}
    curve = sweep_stiffness(PAIR, twist=math.radians(0.4), angles=ANGLES, **options)
    apart = replace(curve, twist=np.array([-1e-3, np.nan, 0.1]), torque_wheel=np.array([0.0, np.nan, 1.0]))
    check = check_positions(apart, PAIR, [1, 2], **options)
    assert check.whole_status.tolist() == ["no_contact", "twist_unknown"]
    assert check.failed.tolist() == [False, True]
    assert check.relative_difference[0] == check.whole_k_mesh[0] == 0.0
    assert np.isnan(check.relative_difference[1])


def test_a_position_that_does_not_converge_keeps_its_status(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.setattr(newton, "MAX_ITERATIONS", 1)
    code, rows = checked(tmp_path, "--check", "2")
    assert code == 1
    assert rows[0]["status"] == "converged"
    assert rows[0]["whole_gears_status"] == "not_converged"
    assert rows[0]["whole_gears_torque_wheel_Nm"] == rows[0]["relative_difference"] == "nan"
    said = capsys.readouterr()
    assert "whole gears not_converged" in said.out
    assert "no solution on whole gears, only a status, of position 2" in said.err


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (["0"], "--check = 0: must be a whole number >= 1 and <= 3"),
        (["-1"], "--check = -1: must be a whole number >= 1 and <= 3"),
        (["4"], "--check = 4: must be a whole number >= 1 and <= 3"),
        (["2", "1", "2"], "--check = 2: is given twice"),
        (["1.5"], "1.5"),
    ],
)
def test_rows_that_the_table_does_not_have(tmp_path, capsys, rows: list[str], message: str) -> None:
    code, table = checked(tmp_path, "--check", *rows)
    assert (code, table) == (2, [])
    assert message in capsys.readouterr().err
    assert not (tmp_path / "stiffness.csv").exists()


def test_no_row_and_rows_of_another_kind() -> None:
    curve = sweep_stiffness(PAIR, twist=math.radians(0.4), angles=ANGLES, coarsen=5)
    for rows in ([], [True], ["1"], [1.0]):
        with pytest.raises(InputError, match="rows"):
            check_positions(curve, PAIR, rows, coarsen=5)


def test_deviations_of_micrometres_have_no_mesh(tmp_path, capsys) -> None:
    relief = "[microgeometry.pinion]\ntip_relief_um = 10.0\ntip_relief_length_mm = 1.0\n"
    job = JOB.replace('law = "nitsche"\n', "") + relief
    code, _ = checked(tmp_path, "--check", "1", job=job)
    assert code == 2
    assert "which have no deviations of micrometres" in capsys.readouterr().err


def test_whole_gears_load_nothing_that_they_check() -> None:
    """Whatever they import, directly or not: neither condensed gears nor the solvers on them."""
    contact = ["compliance", "elements", "element_batch", "half_plane", "half_plane_pair", "half_plane_step"]
    contact += ["panels", "position", "zones", "flank_compliance"]
    names = ["gearfe.fem.multifrontal", "gearfe.gears.gearmesh", *(f"gearfe.gears.contact.{name}" for name in contact)]
    code = f"import gearfe.gears.contact.whole_gears.position, sys; print([n for n in {names} if n in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"
