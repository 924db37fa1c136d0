"""Deviations from job files, and the microgeometry command with its page."""

from __future__ import annotations

import csv
import json
import math
import re
from dataclasses import fields, replace

import numpy as np
import pytest

from gearfe import InputError
from gearfe.base.config import build
from gearfe.base.tables.gearbox import NamedMesh
from gearfe.base.tables.microgeometry import GearMicrogeometryTable, MicrogeometryTable, WavinessTable
from gearfe.cli.main import main
from gearfe.gears.geometry.deviation_job import active_rolls, deviations_of
from tests.makers.gears import pair as gear_pair
from tests.makers.gears import uneven
from tests.places import DOCS

PAIR = gear_pair(tip_round=1e-4)
PINION = PAIR.pinion
LOW, HIGH = PINION.form_roll, PINION.profile.tip_roll


def table(**pinion) -> NamedMesh:
    return uneven(build(MicrogeometryTable, {"torques_Nm": [50.0], "pinion": pinion}, "microgeometry"))


def test_measured_teeth_and_sides(tmp_path) -> None:
    """A file of all teeth; the right flanks come in the order of the pair seen from the other side."""
    low, high = (1e3 * s for s in active_rolls(PAIR)[0])
    rows = ["tooth,roll_length_mm,deviation_um"]
    rows += [f"{t},{s},{t}" for t in range(20) for s in (low - 0.1, 10, high + 0.1)]
    (tmp_path / "teeth.csv").write_text("\n".join(rows))
    (tmp_path / "pitch.csv").write_text("tooth,pitch_um\n" + "\n".join(f"{t},{0.5 * t}" for t in range(20)))
    made = table(measured_csv="teeth.csv", right={"pitch_csv": "pitch.csv"})
    left = deviations_of(made, PAIR, tmp_path)[0]
    right = deviations_of(replace(made, flank="right"), PAIR, tmp_path)[0]
    at = np.array(10e-3)
    order = np.arange(20)
    assert [float(left.profiles[left.profile[t]].at(at)[0]) for t in order] == pytest.approx(1e-6 * order)
    assert [float(right.profiles[right.profile[t]].at(at)[0]) for t in order] == pytest.approx(1e-6 * (-order % 20))
    assert left.alike is False
    assert set(left.turn) == {0.0}
    assert right.turn == pytest.approx(0.5e-6 * (-order % 20) / PINION.reference_radius)


def test_a_k_chart_and_a_relief_are_the_same() -> None:
    one = deviations_of(table(tip_relief_um=20.0, tip_relief_length_mm=3.0), PAIR)[0].profiles[0]
    points = [[0.0, 0.0], [1e3 * (HIGH - 3e-3), 0.0], [1e3 * HIGH, -20.0]]
    other = deviations_of(table(points_mm_um=points), PAIR)[0].profiles[0]
    diameter = 2e3 * math.hypot(PINION.base_radius, HIGH - 3e-3)
    third = deviations_of(table(tip_relief_um=20.0, tip_relief_start_diameter_mm=diameter), PAIR)[0].profiles[0]
    ends = {"tip_relief_um": 10.0, "tip_relief_length_mm": 3.0}  # half of it at half of its length
    middle = 2e3 * math.hypot(PINION.base_radius, HIGH - 1.5e-3)
    fourth = deviations_of(table(**ends, tip_relief_end_diameter_mm=middle), PAIR)[0].profiles[0]
    s = np.linspace(LOW, HIGH, 99)
    assert one.at(s)[0] == pytest.approx(fourth.at(s)[0], abs=1e-15)
    assert one.at(s)[0] == pytest.approx(other.at(s)[0], abs=1e-15)
    assert one.at(s)[0] == pytest.approx(third.at(s)[0], abs=1e-15)


@pytest.mark.parametrize(
    ("pinion", "told"),
    [
        ({"tip_relief_um": 5.0}, r"tip_relief_length_mm: is required"),
        ({"tip_relief_length_mm": 2.0}, r"tip_relief_um: is required"),
        (
            {"tip_relief_um": 5.0, "tip_relief_length_mm": 20.0},
            r"tip_relief_length_mm = 20.*off the active flank: must be > 0.* mm",
        ),
        ({"tip_relief_um": 5.0, "tip_relief_length_mm": 2.0, "tip_relief_start_mm": 9.0}, "conflicts with"),
        ({"tip_relief_um": 5.0, "tip_relief_end_mm": 14.0, "tip_relief_end_diameter_mm": 54.0}, "conflicts with"),
        ({"crowning_um": 3.0}, r"pinion.crowning_um = 3.0: has another name.*; write profile_crowning_um"),
        ({"slope_um": 3.0}, r"pinion.slope_um = 3.0: has another name.*; write profile_slope_um"),
        ({"left": {"slope_um": 3.0}}, r"pinion.left.slope_um = 3.0: .*write profile_slope_um"),
        ({"points_mm_um": [[6.0, 0.0], [9.0, 1.0]]}, r"points_mm_um: covers 6 to 9 mm.*must cover"),
        ({"points_mm_um": [[9.0, 0.0], [9.0, 1.0]]}, "rising"),
        ({"pitch_um": [1.0, 2.0]}, r"pinion.pitch_um = \[1.0, 2.0\]: must have one entry for each.* 20 teeth, has 2"),
        ({"single_pitch_um": [1.0, 2.0]}, r"pinion.single_pitch_um: must add up to 0.*the sum is 3 um"),
        ({"pitch_um": [0.0, 900.0] * 10}, r"pinion.pitch_um: span 900 um: must be finite and within 250 um"),
        ({"run_out_um": 900.0}, r"pinion.run_out_um: span 1800 um"),
        ({"pitch_um": [1.0], "pitch_class": 5}, "conflicts with pitch_um"),
        ({"pitch_class": 12}, "<= 11"),
        ({"measured_csv": "none.csv"}, "there is no such file"),
        (
            {"profile_crowning_um": 300.0, "profile_slope_um": 2.0},
            r"pinion.profile_crowning_um = 300.0: .*by 30[01].* um.*0.05 module",
        ),
        (
            {"tip_relief_um": 1800.0, "tip_relief_length_mm": 3.0, "profile_crowning_um": 4.0},
            r"pinion.tip_relief_um = 1800.0: makes the flank too steep: a slope of 0.6\d*, must be <= 0.2",
        ),
        (
            {"waviness": [{"amplitude_um": 1.0, "waves": 20}, {"amplitude_um": 90.0, "waves": 400}]},
            r"pinion.waviness\[1\].amplitude_um = 90.0: makes the flank too steep",
        ),
        (
            {"points_mm_um": [[0.0, 0.0], [10.0, 0.0], [10.1, 40.0], [30.0, 0.0]]},
            r"pinion.points_mm_um: makes the flank too steep",
        ),
        ({"tip_releif_um": 1.0}, "tip_relief_um"),
    ],
)
def test_mistakes_in_the_table(pinion, told, tmp_path) -> None:
    with pytest.raises(InputError, match=told):
        deviations_of(table(**pinion), PAIR, tmp_path)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("roll_length_mm,deviation_um\n5,0\n8,1", "must cover"),
        ("roll_length_mm\n5", "no column deviation_um"),
        ("deviation_um\n5", "neither of the columns"),
        ("roll_length_mm,deviation_um\n5,a", "row 1 must have 2 numbers"),
        ("roll_length_mm,deviation_um,colour\n5,1,2", "unknown name"),
        ("tooth,roll_length_mm,deviation_um\n0,5,0\n0,16,0", "teeth 0 to 19"),
        ("diameter_mm,deviation_um\n30,0\n54,1", "diameter_mm = 30.*no involute there"),
        ("diameter_mm,deviation_um\n-48,0\n-54,1", "diameter_mm = -48.*no involute there"),
        ("", "no column"),
    ],
)
def test_mistakes_in_measured_files(text, told, tmp_path) -> None:
    (tmp_path / "m.csv").write_text(text)
    with pytest.raises(InputError, match=told):
        deviations_of(table(measured_csv="m.csv"), PAIR, tmp_path)


JOB = """
[pair]
pressure_angle_deg = 25.0
face_width_mm = 10.0
tip_round_mm = 0.1
pinion = { teeth = 20, pitch_diameter_mm = 50.0, bore_diameter_mm = 10.0 }
wheel = { teeth = 30, pitch_diameter_mm = 75.0, bore_diameter_mm = 15.0 }
[microgeometry]
torques_Nm = [50.0, 100.0]
positions = 6
mesh_cycles = 2
tolerance_class = 6
root_stress = true
[microgeometry.pinion]
tip_relief_um = 10.0
tip_relief_length_mm = 3.0
run_out_um = 3.0
[microgeometry.wheel.left]
profile_crowning_um = 2.0
"""


def test_the_command(tmp_path, capsys) -> None:
    job = tmp_path / "job.toml"
    job.write_text(JOB)
    assert main(["loadmap", str(job), "--out", str(tmp_path / "out")]) == 0
    told = capsys.readouterr().out
    assert "2 torques x 12 positions over 2 mesh cycles: 24 converged" in told
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {
        *(f"loadmap{part}.csv" for part in ("", "_torques", "_pairs", "_orders")),
        "loadmap.png", "loadmap_load.png", "loadmap_flanks.png", "loadmap.json",
    }  # fmt: skip
    with (tmp_path / "out" / "loadmap.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 24
    assert all(float(row["load_share_1"]) + float(row["load_share_2"]) == pytest.approx(1) for row in rows)
    assert all(float(row["root_stress_pinion_MPa"]) > 20 for row in rows)
    content = json.loads((tmp_path / "out" / "loadmap.json").read_text())
    out = ["--out", str(tmp_path / "more")]
    options = ["--torques-Nm", "70", "--positions", "4", "--mesh-cycles", "1", "--no-pictures"]
    options += ["--set", "microgeometry.flank=right"]
    assert main(["loadmap", str(job), *out, *options]) == 0
    assert "1 torques x 4 positions over 1 mesh cycle: 4 converged" in capsys.readouterr().out
    assert not list((tmp_path / "more").glob("*.png"))
    assert content["pitch"]["pinion"]["cumulative_pitch_deviation_um"] == pytest.approx(6.0, rel=1e-3)


def test_what_was_the_microgeometry_command_names_the_load_map(capsys) -> None:
    assert main(["microgeometry", "job.toml"]) == 2
    assert "gearfe loadmap" in capsys.readouterr().err
    assert main(["loadmap", "job.toml", "--flank", "right"]) == 2
    assert "--set microgeometry.flank=right" in capsys.readouterr().err


def test_the_command_tells_a_mistake_in_one_line(tmp_path, capsys) -> None:
    job = tmp_path / "job.toml"
    job.write_text(JOB.replace("tip_relief_um = 10.0", "tip_relief_um = 300.0"))
    assert main(["loadmap", str(job), "--out", str(tmp_path / "out")]) == 2
    told = capsys.readouterr().err
    assert "microgeometry.pinion" in told
    assert told.count("\n") == 1
    assert not (tmp_path / "out").exists()


PAGE = (DOCS / "microgeometry.md").read_text(encoding="utf-8")


def test_the_page_names_every_key() -> None:
    tables = (MicrogeometryTable, GearMicrogeometryTable, WavinessTable)
    for name in {f.name for table in tables for f in fields(table)}:
        assert f"`{name}`" in PAGE, name


def test_the_example_of_the_page_runs() -> None:
    names: dict = {}
    exec(compile(re.search(r"```python\n(.*?)```", PAGE, re.S).group(1), "microgeometry.md", "exec"), names)
    assert len(names["peaks"]) == 2
