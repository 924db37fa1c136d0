"""Reports: what stands in the page, that strangers' texts stay texts, and that nothing is fetched."""

from __future__ import annotations

import hashlib
import math
import os
import re
import shutil
import tomllib
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.base.files import write_csv, write_json
from gearfe.base.tables.examples import job_file
from gearfe.cli.main import main
from gearfe.drivetrain.gearbox.overview import overview_sheets
from gearfe.output.report_sheets import joined, run_of
from gearfe.output.results import kinds_of, read_all
from gearfe.output.run_curves import PANELS
from tests.places import GEOMETRY

HOSTILE = '<script>alert(1)</script><img src="http://example.org/x.png" onerror="x()">'
COARSE = ["--coarsen", "4", "--angles", "0", "3", "15"]


class Page(HTMLParser):
    """Tags, attributes and text of a page outside of what is folded."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.links: list[str] = []
        self.printed = ""
        self._folded = 0
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self._folded += tag == "details"
        self.links += [value or "" for name, value in attrs if name in ("src", "href") or name.startswith("on")]

    def handle_endtag(self, tag: str) -> None:
        self._folded -= tag == "details"

    def handle_data(self, data: str) -> None:
        self.printed += "" if self._folded else data + " "


def page_of(path: Path) -> Page:
    return Page(path.read_text(encoding="utf-8"))


def job(folder: Path, **keys: str) -> Path:
    """The shipped job with a table [report]."""
    path = folder / "box.toml"
    table = "".join(f"{key} = '''{value}'''\n" for key, value in keys.items())
    path.write_text(
        (GEOMETRY / "gear_train.toml").read_text(encoding="utf-8") + f"\n[report]\n{table}", encoding="utf-8"
    )
    return path


def test_a_stiffness_report(tmp_path: Path) -> None:
    """Heading from the job and the options, gears, results with errors, provenance; texts of strangers stay texts."""
    path = job(tmp_path, title=f"Title {HOSTILE}", remark=HOSTILE, author="nobody")
    line = ["stiffness", str(path), "--out", str(tmp_path / "out"), *COARSE, "--report", "--author", f"A & B {HOSTILE}"]
    assert main([*line, "--report-date", "2026-01-02"]) == 0
    page = page_of(tmp_path / "out" / "report.html")
    assert "script" not in page.tags
    assert all(link.startswith("data:image/") for link in page.links)
    assert page.tags.count("img") == 2
    for part in (
        f"Title {HOSTILE}", f"A & B {HOSTILE}", "2026-01-02", "number of teeth", "Young's modulus (GPa)",
        "contact ratio",
        "mean mesh stiffness", "±", "N/µm", "transmission error, peak to peak", "largest Hertzian pressure",
        hashlib.sha256(path.read_text(encoding="utf-8").encode()).hexdigest(), "gearfe 0.1",
    ):  # fmt: skip
        assert part in page.printed, part
    text = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "@page" in text
    assert not re.search(r"url\(|@import|<link|<iframe", text)


def test_a_report_of_all_results_of_a_job(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Runs in folders below, each with its table over load or speed; those older than the job are named."""
    path = job(tmp_path, title="The box")
    out = tmp_path / "results"
    assert main(["stiffness", str(path), "--out", str(out / "stiffness"), *COARSE, "--no-pictures"]) == 0
    speed = np.array([100.0, 200.0, 300.0])
    (out / "runup").mkdir()
    write_csv(
        out / "runup" / "runup.csv", {"speed_rad_per_s": speed, "branch": [0, 0, 0], "dynamic_factor_1": 1e-2 * speed}
    )
    peak = {
        "speed_rad_per_s": 200.0,
        "mesh": "m",
        "dynamic_factor": 2.0,
        "order": "1 x mesh 1",
        "frequency_Hz": 640.0,
        "mode": HOSTILE,
    }
    write_json(out / "runup" / "summary.json", {"peaks": [peak], "largest_error_estimate": 1e-3})
    (out / "loadmap").mkdir()
    write_csv(out / "loadmap" / "loadmap.csv", {"torque_Nm": [50.0, 80.0], "pinion_angle_deg": [0.0, 0.0]})
    table = {
        "torque_Nm": [50.0, 80.0],
        "transmission_error_peak_to_peak_um": [3.25, 4.5],
        "root_stress_largest_pinion_MPa": [137.0, 211.0],
    }
    write_json(out / "loadmap" / "loadmap.json", {"by_torque": table, "root_stress_error_estimate": 0.003})
    os.utime(out / "loadmap" / "loadmap.csv", (1e9, 1e9))
    capsys.readouterr()
    assert main(["report", str(path), "--results", str(out)]) == 0
    said = capsys.readouterr()
    assert "3 runs: loadmap, stiffness, runup" in said.out
    assert "loadmap is older than the last change of box.toml" in said.err
    page = page_of(out / "report.html")
    for part in (
        "The box",
        "Results over the load",
        "root stress, pinion (MPa)",
        "137",
        "root stress: error at worst 0.3 %",
    ):
        assert part in page.printed, part
    for part in (
        "Results over the speed",
        "dynamic factor of mesh 1",
        HOSTILE,
        "640 Hz",
        "0.1 %",
        "Load map (loadmap)",
    ):
        assert part in page.printed, part
    assert "script" not in page.tags


def test_a_report_of_a_folder_with_several_kinds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A load map and a run-up in one folder are both in the page."""
    path = job(tmp_path)
    out = tmp_path / "results"
    out.mkdir()
    write_csv(out / "runup.csv", {"speed_rad_per_s": [100.0, 200.0], "branch": [0, 0], "dynamic_factor_1": [1.0, 2.0]})
    write_csv(out / "loadmap.csv", {"torque_Nm": [50.0, 80.0], "pinion_angle_deg": [0.0, 0.0]})
    assert main(["report", str(path), "--results", str(out)]) == 0
    assert "2 runs: results (loadmap), results (runup)" in capsys.readouterr().out
    page = page_of(out / "report.html")
    assert "Load map (results)" in page.printed
    assert "Run-up (results)" in page.printed


@pytest.mark.parametrize("option", ["--author", "--remark", "--report-title", "--report-date"])
def test_a_heading_without_a_report(option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = ["rating", str(GEOMETRY / "fzg_c.toml"), "--out", str(tmp_path / "out"), "--no-pictures"]
    assert main([*line, option, "2026-01-02"]) == 2
    assert f"{option} = '2026-01-02': has no effect without --report" in capsys.readouterr().err


def test_mistakes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = job(tmp_path)
    assert main(["report", str(path), "--results", str(tmp_path)]) == 2
    assert "run gearfe stiffness box.toml first" in capsys.readouterr().err
    broken = tmp_path / "broken.toml"
    shutil.copy(path, broken)
    broken.write_text(broken.read_text(encoding="utf-8") + "autor = 'x'\n", encoding="utf-8")
    assert main(["gear", str(broken), "--out", str(tmp_path / "g")]) == 2
    assert "author" in capsys.readouterr().err  # the nearest key


def test_a_report_of_a_command_without_results_to_compare(tmp_path: Path) -> None:
    """Its picture of the gears is on the page, once, and what it printed, as there is no table of results."""
    line = ["gear", str(GEOMETRY / "fzg_c.toml"), "--out", str(tmp_path), "--report"]
    assert main(line) == 0
    page = page_of(tmp_path / "report.html")
    assert page.tags.count("img") == 1
    assert "gear_pair.png" in page.printed
    assert "working_pitch_diameter_mm" in page.printed


def test_a_report_without_gears(tmp_path: Path) -> None:
    line = ["mechanism", str(GEOMETRY / "slider_crank.toml"), "--until", "0.1", "--out", str(tmp_path), "--no-pictures"]
    assert main([*line, "--report", "--remark", "short run"]) == 0
    page = page_of(tmp_path / "report.html")
    assert "crank angle, at the end" in page.printed
    assert "short run" in page.printed
    assert "Gears" not in page.printed


def gearbox(folder: Path) -> Path:
    """The gearbox that `gearfe new` writes, with a rating."""
    path = folder / "box.toml"
    path.write_text(job_file("gearbox") + "\n[rating]\nhardness = 700.0\nquality = 6\n", encoding="utf-8")
    return path


def test_a_report_begins_with_the_loads_of_the_gearbox(tmp_path: Path) -> None:
    """Torques and speeds by the tooth numbers 23/... from 145 N m at the output, and forces of all bearings."""
    path = gearbox(tmp_path)
    raw = tomllib.loads(path.read_text(encoding="utf-8"))
    meshes, bearings = overview_sheets(path, raw)
    rows = {row[0]: row for row in meshes.rows}
    assert float(rows["second: output_wheel"][2]) == 145.0
    ratio = 1.0
    for mesh in raw["meshes"].values():
        ratio *= raw["gears"][mesh["driven"]]["teeth"] / raw["gears"][mesh["driver"]]["teeth"]
    assert float(rows["first: input_pinion"][2]) == pytest.approx(-145.0 / ratio, rel=1e-4)
    assert all(float(row[5]) > 0.5 and float(row[6]) > 0.5 for row in meshes.rows)
    assert [row[0] for row in bearings.rows] == list(raw["bearings"])
    # the input's bearings balance the force of its gear, F_t/cos(alpha_wt) across the axis
    of_input = sum(float(row[4]) for row in bearings.rows if row[1] == "input")
    assert of_input == pytest.approx(float(rows["first: input_pinion"][4]) / math.cos(math.radians(20.0)), rel=0.02)


def test_a_gearbox_that_is_not_rated_has_no_empty_columns(tmp_path: Path) -> None:
    path = tmp_path / "box.toml"
    path.write_text(job_file("gearbox"), encoding="utf-8")
    meshes = overview_sheets(path, tomllib.loads(path.read_text(encoding="utf-8")))[0]
    assert not {"S_H", "S_F"} & set(meshes.head)
    assert all(len(row) == len(meshes.head) and "-" not in row for row in meshes.rows)
    assert "S_H" not in meshes.note


def test_forces_of_bearings_do_not_need_the_rating(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object) -> None:
        raise InputError("rating", None, "fails", "none")

    monkeypatch.setattr("gearfe.drivetrain.gearbox.rexs_results.rate_mesh", fails)
    path = gearbox(tmp_path)
    raw = tomllib.loads(path.read_text(encoding="utf-8"))
    titles = [sheet.title for sheet in overview_sheets(path, raw)]
    assert titles == ["Loads in steady running", "Bearing forces in steady running", ""]


def test_meshes_of_a_gearbox_share_one_table(tmp_path: Path) -> None:
    """Ratings of two meshes are columns, those of run-ups rows; each gear has one column of data."""
    path = gearbox(tmp_path)
    out = tmp_path / "out"
    assert main(["rating", str(path), "--out", str(out / "rating"), "--no-pictures"]) == 0
    assert main(["report", str(path), "--results", str(out)]) == 0
    page = page_of(out / "report.html")
    assert page.printed.count("Load capacity by ISO 6336:2019") == 1
    assert page.printed.count("number of teeth") == 1
    raw = tomllib.loads(path.read_text(encoding="utf-8"))
    runs = {
        run.name: run_of(run) for mesh in raw["meshes"] for run in read_all(out / "rating" / mesh, "--results", mesh)
    }
    basis, sheet = joined("Rating", runs).sheets
    assert len(basis.head) == len(sheet.head)
    gears = [gear for mesh in raw["meshes"].values() for gear in (mesh["driver"], mesh["driven"])]
    assert list(sheet.head) == ["", *gears, "unit"]
    for number, run in enumerate(runs.values()):
        row = next(row for row in run.sheets[-1].rows if row[0].startswith("S_H"))
        both = next(row for row in sheet.rows if row[0].startswith("S_H"))
        assert both[1 + 2 * number : 3 + 2 * number] == row[1:3]


def test_contact_forces_are_a_row_for_each_mesh(tmp_path: Path) -> None:
    write_csv(tmp_path / "response.csv", {"time_s": [0.0, 1.0], "contact_force_1": [1.0, 2.0]})
    summary = {
        "meshes": ["first", "second"],
        "mean_contact_forces_N": [10.0, 20.0],
        "largest_contact_forces_N": [11.0, 21.0],
        "peak_attachment_accelerations_m_per_s2": {"a": 0.0, "b": 2.0},
    }
    write_json(tmp_path / "summary.json", summary)
    (run,) = read_all(tmp_path, "results")
    forces, others, _ = run_of(run).sheets
    assert [list(row) for row in forces.rows] == [
        ["first", "10 ± ?", "-", "11 ± ?"],
        ["second", "20 ± ?", "-", "21 ± ?"],
    ]
    assert [row[0] for row in others.rows] == ['largest acceleration at attachment "b"']  # of a rigid housing all are 0


def test_values_of_modes_that_are_null_are_left_out(tmp_path: Path) -> None:
    """Modes keep their numbers, and an unknown damping is no 0."""
    write_csv(tmp_path / "critical_speeds.csv", {"meets": np.ones(1), "mode": np.ones(1), "excited": np.ones(1)})
    modes = [
        {"name": "1", "frequency_Hz": None, "damping_ratio": None},
        {"name": "2", "frequency_Hz": 0, "damping_ratio": 0.0},
        {"name": "3", "frequency_Hz": 7.5, "damping_ratio": 0.02},
    ]  # fmt: skip
    critical = [{"excited": True, "speed_rad_per_s": speed, "order": "1", "mode": "3"} for speed in (None, 30.0, 21.0)]
    summary = {"modes": modes, "critical_speeds": critical, "speed_of_the_drive_rad_per_s": 20.0}
    write_json(tmp_path / "summary.json", summary)
    (run,) = read_all(tmp_path, "results")
    frequencies, speeds = run_of(run).sheets
    assert [row[3] for row in frequencies.rows] == ["-", "0", "2"]
    assert [row[0] for row in speeds.rows] == ["21", "30"]
    (panel,) = PANELS["modes"]([run])
    assert panel.lines[0].x.tolist() == [2.0, 3.0]


def test_modes_are_in_the_report_of_a_job(tmp_path: Path) -> None:
    """Natural frequencies and critical speeds of gearfe modes; in a run-up they are a part of it."""
    path = gearbox(tmp_path)
    out = tmp_path / "out"
    for command in (["modes"], ["rating"], ["gear"]):
        assert main([*command, str(path), "--out", str(out / command[0]), "--no-pictures"]) == 0
    assert [kind.name for kind in kinds_of(out / "modes")] == ["modes"]
    assert main(["report", str(path), "--results", str(out)]) == 0
    page = page_of(out / "report.html")
    for part in (
        "Loads in steady running", "Bearing forces in steady running", "Natural frequencies", "Critical speeds",
        "S_H", "number of teeth",
    ):  # fmt: skip
        assert part in page.printed, part
    (out / "modes" / "runup.csv").write_text("speed_rad_per_s,branch\n", encoding="utf-8")
    assert [kind.name for kind in kinds_of(out / "modes")] == ["runup"]


def test_modes_of_two_jobs_are_compared(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = gearbox(tmp_path)
    for name, stiff in (("a", "1e8"), ("b", "2e8")):
        line = ["modes", str(path), "--out", str(tmp_path / name), "--no-pictures"]
        assert main([*line, "--set", f"bearings.A.stiffness_N_per_m=[{stiff}, 0.0, {stiff}]"]) == 0
    capsys.readouterr()
    assert main(["compare", str(tmp_path / "a"), str(tmp_path / "b"), "--out", str(tmp_path / "c")]) == 0
    assert "natural frequency" in capsys.readouterr().out
