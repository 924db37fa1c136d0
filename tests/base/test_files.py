"""CSV files from strangers: ends of lines, columns given twice, cells without end. Sets of files of repeated runs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from gearfe.base.errors import InputError
from gearfe.base.files import read_csv, read_numbers, recorded, whole_set, write_csv, write_json
from gearfe.base.tables.mechanism import ValueTableTable
from gearfe.drivetrain.housing.modal_test import read_modes
from gearfe.mechanisms.tables import read_table


def numbers(path: Path) -> object:
    return read_numbers(path, "f", ("a", "b"))


def cam(path: Path) -> object:
    return read_table("cam", ValueTableTable(file=path.name, x="a", y="b"), path.parent)


READERS: list[Callable[[Path], object]] = [lambda path: read_csv(path, "f"), numbers, cam, read_modes]


@pytest.mark.parametrize("read", READERS)
def test_cells_without_end_are_refused(read: Callable[[Path], object], tmp_path: Path) -> None:
    """Python's reader of CSV files takes cells up to 131072 characters."""
    (tmp_path / "a.csv").write_text("a,b\n1,2\n2," + "3" * 200_000 + "\n")
    with pytest.raises(InputError, match="is no table"):
        read(tmp_path / "a.csv")


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_any_end_of_lines(end: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(end.join(["a,b", "1,2", "3,4", ""]).encode())
    assert read_csv(tmp_path / "a.csv", "f") == {"a": ["1", "3"], "b": ["2", "4"]}
    assert read_numbers(tmp_path / "a.csv", "f", ("b",))["b"].tolist() == [2.0, 4.0]


@pytest.mark.parametrize("read", READERS[:2])
def test_columns_given_twice_are_refused(read: Callable[[Path], object], tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("a,b,a\n1,2,3\n")
    with pytest.raises(InputError, match="two columns a"):
        read(tmp_path / "a.csv")


def run(folder: Path, value: float, seconds: float, *, report: bool = False) -> tuple[str, ...]:
    """Write what a command could write; return the names of the files that it removed."""
    with recorded() as written, whole_set(folder, ("*.csv", "*.png", "*.step")) as made:
        write_csv(made / "curve.csv", {"a": [value, 2.0]})
        write_json(made / "summary.json", {"job": {"x": 1}, "timings_s": {"total": seconds}})
        if report:
            (made / "solid.step").write_text("a solid\n")
            (made / "curve.png").write_text("a picture\n")
    return written[0].removed


def test_a_repeated_run_removes_only_what_no_longer_fits(tmp_path: Path) -> None:
    """Exports and pictures stay if the results are the same; they go, by name, with other results."""
    assert run(tmp_path, 1.0, 3.0, report=True) == ()
    (tmp_path / "report.html").write_text("of the first run\n")
    assert run(tmp_path, 1.0, 4.0) == ()
    assert {"solid.step", "curve.png", "report.html"} <= {path.name for path in tmp_path.iterdir()}
    assert run(tmp_path, 1.5, 4.0) == ("curve.png", "report.html", "solid.step")
    assert {path.name for path in tmp_path.iterdir()} == {"curve.csv", "summary.json"}


def test_a_summary_of_another_job_is_another_result(tmp_path: Path) -> None:
    run(tmp_path, 1.0, 3.0, report=True)
    with recorded() as written, whole_set(tmp_path, ("*.csv", "*.png", "*.step")) as made:
        write_json(made / "summary.json", {"job": {"x": 2}, "timings_s": {"total": 3.0}})
    assert written[0].removed == ("curve.csv", "curve.png", "solid.step")
