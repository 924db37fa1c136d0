"""Comparisons of results: errors of differences against the truth of finer meshes, files, mistakes."""

from __future__ import annotations

import csv
import json
import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gearfe import StiffnessCurve, sweep_stiffness
from gearfe.base.errors import InputError
from gearfe.base.files import write_csv, write_json
from gearfe.cli.main import main
from gearfe.output.differences import Comparison, Row, compared, comparison_lines, difference_error
from gearfe.output.results import KINDS, read_all, read_results, short_names
from gearfe.output.run_numbers import Number
from tests.makers import gears


def curve(torque: float, coarsen: float, **options: Any) -> StiffnessCurve:
    return sweep_stiffness(gears.pair(), torque=torque, coarsen=coarsen, **options)


def kept(folder: Path, made: StiffnessCurve) -> Path:
    """Folder with the table of a curve."""
    folder.mkdir()
    made.to_csv(folder / "stiffness.csv")
    return folder


def rows_of(*paths: Path) -> dict[str, Row]:
    results = [read_results(path, "run", f"{number}") for number, path in enumerate(paths)]
    return {row.name: row for row in compared(results).rows}


# ---- errors of differences -------------------------------------------------------------------------------------------


def test_the_error_of_a_difference_covers_that_of_finer_meshes_and_is_no_sum(tmp_path: Path) -> None:
    """Two torques on coarse meshes, against the same on meshes six times finer."""
    runs = [kept(tmp_path / f"{torque}", curve(torque, 2.0, estimate_error=True)) for torque in (100, 130)]
    fine = [kept(tmp_path / f"fine {torque}", curve(torque, 0.33)) for torque in (100, 130)]
    rows, truth = rows_of(*runs), rows_of(*fine)
    for name in ("mean mesh stiffness", "transmission error, mean", "transmission error, peak to peak"):
        row = rows[name]
        off = abs(row.differences[0] - truth[name].differences[0])
        assert off <= row.difference_errors[0], name
        assert abs(row.values[0] - truth[name].values[0]) <= row.errors[0], name
        assert row.difference_errors[0] < 0.5 * sum(row.errors), name
    assert rows["mean mesh stiffness"].difference_errors[0] < 0.2 * sum(rows["mean mesh stiffness"].errors)


def test_the_same_run_twice_differs_by_nothing(tmp_path: Path) -> None:
    folder = kept(tmp_path / "a", curve(100.0, 3.0, estimate_error=True))
    for row in rows_of(folder, folder).values():
        assert row.differences == (0.0,)
        assert row.difference_errors[0] == 0.0 or "pressure" in row.name  # pressures have no estimate


def test_the_parts_of_the_error() -> None:
    """Common sources by their changes, by the larger size without them; other sources by the sum; unknown stays."""
    one = Number("n", "N", 10.0, {"mesh": 3.0, "integration": 0.5}, {"mesh": np.array([3.0, -1.0])})
    two = Number("n", "N", 12.0, {"mesh": 4.0, "integration": 0.25}, {"mesh": np.array([4.0, -2.5])})
    assert difference_error(one, two, {"mesh"}) == pytest.approx(1.5 + 0.75)
    assert difference_error(one, two, set()) == pytest.approx(7.0 + 0.75)
    old = Number("n", "N", 12.0, {"mesh": 4.0, "integration": 0.25})  # a file without signed changes
    assert difference_error(one, old, {"mesh"}) == pytest.approx(4.0 + 0.75)
    assert np.isnan(difference_error(one, Number("n", "N", 12.0), {"mesh"}))
    assert np.isnan(difference_error(one, Number("n", "N", 12.0, {"mesh": np.nan}), {"mesh"}))


def response(folder: Path, unknowns: int, force: float, changes: list[list[float]], frequency: float = 500.0) -> Path:
    """Folder of a vibration whose mean force is known to some error of the housing's mesh."""
    folder.mkdir()
    time = np.linspace(0.0, 1.0, 9)
    write_csv(folder / "response.csv", {"time_s": time, "contact_force_1_N": force + np.sin(time)})
    size = [max(abs(row[0]) for row in changes)]
    summary = {
        "status": "done", "meshes": ["in-out"], "mean_contact_forces_N": [force],
        "housing": {"mass_kg": 4.0, "coordinates": 12, "modes": 6, "unknowns": unknowns},
        "headline_error_parts": {"mesh": {"mean_contact_forces_N": size}},
        "headline_error_changes": {"mesh": [{"mean_contact_forces_N": row} for row in changes]},
        "dominant_lines": {
            "contact_force_1_N": [
                {"frequency_Hz": frequency, "amplitude": 0.1 * force, "near": "mesh 1 x 1", "error_estimate": 0.2,
                 "error_parts": {"mesh": 0.2}, "error_changes": {"mesh": [0.2, -0.1]}},
                {"frequency_Hz": frequency + 7.0, "amplitude": 0.05, "near": None, "error_estimate": 0.2},
            ]
        },
    }  # fmt: skip
    write_json(folder / "summary.json", summary)
    return folder


def test_a_housing_in_common_counts_once_and_another_one_twice(tmp_path: Path) -> None:
    one = response(tmp_path / "a", 900, 100.0, [[2.0], [-1.0]])
    two = response(tmp_path / "b", 900, 110.0, [[2.5], [-1.5]], frequency=520.0)
    other = response(tmp_path / "c", 1100, 110.0, [[2.5], [-1.5]])
    rows = rows_of(one, two, other)
    row = rows["mean contact force of in-out"]
    assert row.differences == (10.0, 10.0)
    assert row.difference_errors == pytest.approx((0.5, 4.5))
    line = rows["contact force of mesh 1, line mesh 1 x 1"]  # the same multiple at another speed
    assert line.differences == pytest.approx((1.0, 1.0))
    assert line.difference_errors == pytest.approx((0.0, 0.4))
    notes = compared([read_results(path, "run") for path in (one, two, other)]).notes
    assert "b and a share the errors of: housing" in notes
    assert "c and a share no source of error: errors are added" in notes
    assert any("527 Hz" in note for note in notes)  # a line that the others do not have


# ---- files -----------------------------------------------------------------------------------------------------------


def test_the_command_writes_table_summary_and_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    paths = [
        kept(tmp_path / name, curve(torque, 3.0, estimate_error=True))
        for name, torque in (("x", 50), ("y", 80), ("z", 90))
    ]
    out = tmp_path / "out"
    assert main(["compare", *map(str, paths), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "mean mesh stiffness: " in said
    assert "run y minus run x: +" in said
    assert sorted(path.name for path in out.iterdir()) == ["compare.csv", "compare.json", "compare.png"]
    with (out / "compare.csv").open(encoding="utf-8", newline="") as stream:
        table = list(csv.DictReader(stream))
    mean = next(row for row in table if row["quantity"] == "mean mesh stiffness")
    assert mean["unit"] == "N/µm"
    assert float(mean["z - x"]) == pytest.approx(float(mean["z"]) - float(mean["x"]))
    assert 0.0 < float(mean["error of z - x"]) < float(mean["error of x"])
    summary = json.loads((out / "compare.json").read_text(encoding="utf-8"))
    assert [run["kind"] for run in summary["runs"]] == ["stiffness"] * 3
    # a copy of a table serves as well as its folder
    copy = tmp_path / "copy of x.csv"
    copy.write_bytes((paths[0] / "stiffness.csv").read_bytes())
    assert main(["compare", str(paths[1]), str(copy), "--out", str(out), "--names", "new", "old", "--no-pictures"]) == 0
    assert "run old minus run new: -" in capsys.readouterr().out
    assert not (out / "compare.png").exists()


def test_folders_of_one_name_are_told_apart(tmp_path: Path) -> None:
    for name in ("one/stiffness", "two/stiffness"):
        (tmp_path / name).mkdir(parents=True)
    paths = [str(tmp_path / name) for name in ("one/stiffness", "two/stiffness")]
    assert short_names(paths) == ["one/stiffness", "two/stiffness"]
    assert short_names([paths[0], paths[0]]) == ["stiffness (1)", "stiffness (2)"]


# ---- mistakes --------------------------------------------------------------------------------------------------------


def test_mistakes_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one = kept(tmp_path / "a", curve(50.0, 4.0))
    two = response(tmp_path / "b", 900, 100.0, [[2.0], [-1.0]])
    (tmp_path / "empty").mkdir()
    damaged = kept(tmp_path / "damaged", curve(50.0, 4.0))
    (damaged / "summary.json").write_text('{"status": ', encoding="utf-8")
    text = (one / "stiffness.csv").read_text(encoding="utf-8")
    other = tmp_path / "in other units.csv"
    other.write_text(text.replace("k_mesh_N_per_m,", "k_mesh_N_per_um,"), encoding="utf-8")
    for paths, part in (
        ([one, two], "compare runs of one command"),
        ([one, other], "in N/µm, and"),
        ([one, tmp_path / "none"], "does not exist"),
        ([one, tmp_path / "empty"], "holds no results"),
        ([one, tmp_path], "name one of its folders"),
        ([one, damaged], "is no summary"),
        ([one], "two or three"),
        ([one, one, one, one], "two or three"),
        ([one, one, "--names", "x", "x"], "must differ"),
        ([one, one, "--names", "x"], "must be 2 names"),
        ([one, one, "--names", "unit", "x"], "two columns of the table the head 'unit'"),
        ([one, one, "--names", "x", "quantity"], "the head 'quantity'"),
        ([one, one, one, "--names", "a", "b", "b - a"], "the head 'b - a'"),
        ([one, one, "--names", "a", "error of a"], "the head 'error of a'"),
    ):
        assert main(["compare", *map(str, paths), "--out", str(tmp_path / "out")]) == 2, part
        assert part in capsys.readouterr().err
    write_csv(tmp_path / "other.csv", {"x": [1.0], "y": [2.0]})
    with pytest.raises(InputError, match="is no main table"):
        read_results(tmp_path / "other.csv", "run 1")


def test_runs_without_a_common_quantity_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two mechanisms with outputs of different names."""
    for name, column in (("a", "crank_angle_rad"), ("b", "slider_force_N")):
        (tmp_path / name).mkdir()
        write_csv(tmp_path / name / "trajectory.csv", {"time_s": [0.0, 1.0], column: [1.0, 2.0]})
    line = ["compare", str(tmp_path / "a"), str(tmp_path / "b"), "--out", str(tmp_path / "out")]
    assert main(line) == 2
    message = capsys.readouterr().err
    assert "no quantity in common" in message
    assert "a has crank angle" in message
    assert "b has slider force" in message
    assert not (tmp_path / "out" / "compare.csv").exists()


# ---- ratings ---------------------------------------------------------------------------------------------------------


def rating(folder: Path, gears: tuple[str, str], safety: tuple[float, float]) -> Path:
    """Folder of a rating with one number of each gear and one of the mesh."""
    folder.mkdir()
    columns = {
        "group": ["flank", "influence"], "name": ["S_H", "K_v"], "gear_1": [safety[0], 1.1], "gear_2": [safety[1], 1.1],
        "unit": ["-", "-"], "formula": ["ISO 6336-2", "ISO 6336-1"], "meaning": ["safety factor", "dynamic factor"],
    }  # fmt: skip
    write_csv(folder / "rating.csv", columns)
    write_json(folder / "rating.json", {"gears": {"gear_1": gears[0], "gear_2": gears[1]}})
    return folder


def test_ratings_of_gears_with_other_names_or_equal_values_keep_their_safety_factors(tmp_path: Path) -> None:
    one = rating(tmp_path / "a", ("pinion", "wheel"), (1.2, 1.3))
    two = rating(tmp_path / "b", ("sun", "planet"), (1.5, 1.5))
    rows = rows_of(one, two)
    assert list(rows) == ["S_H, safety factor (gear 1)", "S_H, safety factor (gear 2)", "K_v, dynamic factor"]
    assert [row.differences[0] for row in rows.values()] == pytest.approx([0.3, 0.2, 0.0])
    notes = compared([read_results(path, "run") for path in (one, two)]).notes
    assert "b: gear 1 is sun, gear 2 planet" in notes


def test_a_folder_with_several_kinds_is_compared_in_the_kind_that_all_have(tmp_path: Path) -> None:
    """A rating next to a vibration, against a rating alone; what is left out is named."""
    one = response(tmp_path / "a", 900, 100.0, [[2.0], [-1.0]])
    inside = rating(tmp_path / "of a", ("pinion", "wheel"), (1.2, 1.3))
    for path in inside.iterdir():
        path.rename(one / path.name)
    two = rating(tmp_path / "b", ("pinion", "wheel"), (1.5, 1.6))
    line = ["compare", str(one), str(two), "--out", str(tmp_path / "out"), "--no-pictures"]
    assert main(line) == 0
    made = json.loads((tmp_path / "out" / "compare.json").read_text(encoding="utf-8"))
    assert {run["kind"] for run in made["runs"]} == {"rating"}
    assert "a: response.csv is left out" in made["notes"]


def test_a_summary_belongs_to_the_newest_of_several_tables(tmp_path: Path) -> None:
    """A vibration and a mechanism both have a summary.json."""
    folder = response(tmp_path / "a", 900, 100.0, [[2.0], [-1.0]])
    write_csv(folder / "trajectory.csv", {"time_s": [0.0, 1.0], "x_m": [1.0, 2.0]})
    os.utime(folder / "trajectory.csv", (1e9, 1e9))
    summaries = {one.kind.name: bool(one.summary) for one in read_all(folder, "run")}
    assert summaries == {"vibration": True, "mechanism": False}


def test_a_printed_line_names_the_runs_and_the_unit() -> None:
    row = Row("mean mesh stiffness", "N/µm", (106.68, 107.27), (0.078, 0.08), (0.5854,), (0.013,))
    runs = [SimpleNamespace(name=name, path=f"{name}/stiffness.csv", kind=KINDS[1]) for name in ("100", "120")]
    (_, line) = comparison_lines(Comparison(tuple(runs), (row,), (), ()))  # type: ignore[arg-type]
    first, second = line.split("; ")
    assert first == "mean mesh stiffness: run 100: 106.68 ± 0.078 N/µm"
    assert second == "run 120 minus run 100: +0.5854 ± 0.013 N/µm (+0.549 %)"
