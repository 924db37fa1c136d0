"""Forms in which the results of a run are kept and told: formats, report, JSON, quiet and verbose, completion."""

from __future__ import annotations

import csv
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import loadmat

from gearfe.base.files import write_csv
from gearfe.cli import COMMANDS
from gearfe.cli.main import main
from gearfe.output.exchange.tables import read_csv, write_tables
from tests.places import GEOMETRY

JOB = str(GEOMETRY / "gear_train.toml")
COARSE = ["--coarsen", "4", "--angles", "0", "3", "9", "--no-estimate"]


def told(capsys: pytest.CaptureFixture[str], *line: str) -> tuple[str, str]:
    assert main(list(line)) == 0
    found = capsys.readouterr()
    return found.out, found.err


def test_formats_hold_the_numbers_of_the_tables(tmp_path, capsys):
    """Each format, read by its own reader, against the CSV file, which has every digit."""
    pyuff = pytest.importorskip("pyuff", reason="pip install 'gearfe[exchange]'")
    line = ["stiffness", JOB, "--out", str(tmp_path), *COARSE, "--no-pictures", "--format", "npz,h5,mat,uff"]
    out, _ = told(capsys, *line)
    assert "also written: tables.h5, tables.mat, tables.npz, tables.uff" in out
    table = read_csv(tmp_path / "stiffness.csv")
    numbers = {name: values for name, values in table.items() if values.dtype.kind == "f"}
    assert len(table["pinion_angle_deg"]) == 4
    with np.load(tmp_path / "tables.npz") as npz, h5py.File(tmp_path / "tables.h5") as h5:
        mat = loadmat(tmp_path / "tables.mat", simplify_cells=True)["stiffness"]
        for name, values in numbers.items():
            for found in (npz[f"stiffness/{name}"], h5[f"stiffness/{name}"][()], mat[name]):
                np.testing.assert_array_equal(found, values, err_msg=name)
        assert list(h5["stiffness/status"].asstr()[()]) == list(mat["status"]) == list(table["status"])
    first, *made = pyuff.UFF(str(tmp_path / "tables.uff")).read_sets()
    assert (first["type"], first["length"], first["force"]) == (164, 1.0, 1.0)  # all values are in SI units
    sets = {one["id1"].strip(): one for one in made}
    rest = {n: v for n, v in numbers.items() if n != "pinion_angle_deg" and np.isfinite(v).sum() > 1}
    si = {"_um": ("_m", 1e-6), "_mm": ("_m", 1e-3), "_MPa": ("_Pa", 1e6), "_deg": ("_rad", np.pi / 180.0)}
    named = {}
    for name, values in rest.items():
        end, factor = next(((new, f) for old, (new, f) in si.items() if name.endswith(old)), ("", 1.0))
        named[name.rpartition("_")[0] + end if end else name] = (name, factor * values)
    assert sets.keys() == named.keys()
    for si_name, (name, values) in named.items():
        np.testing.assert_allclose(sets[si_name]["data"], values[np.isfinite(values)], rtol=1e-15)
        x = np.radians(table["pinion_angle_deg"][np.isfinite(values)])
        np.testing.assert_allclose(sets[si_name]["x"], x, rtol=1e-9, atol=1e-9 * x.max(), err_msg=name)


def test_comments_above_the_header_are_skipped(tmp_path):
    """The shipped reference of Andrews' mechanism begins with one."""
    table = read_csv(GEOMETRY / "andrews_reference.csv")
    assert list(table)[:2] == ["t", "beta"]
    assert table["t"][-1] == 0.03
    (tmp_path / "words.csv").write_text("name,x\n#1,2.0\n", encoding="utf-8")
    assert read_csv(tmp_path / "words.csv")["name"].tolist() == ["#1"]


#: Column -> specific data type, exponents of length and force, unit: Universal File Format, data set 58, addendum A.
KINDS = {
    "transmission_error_1_um": (8, 1, 0, "m"),
    "speed_out_rad_per_s": (11, 0, 0, "rad/s"),
    "case_acceleration_m_per_s2": (12, 1, 0, "m/s^2"),
    "contact_force_1_N": (9, 0, 1, "N"),
    "drive_torque_Nm": (9, 1, 1, "N m"),
    "peak_pressure_MPa": (15, -2, 1, "Pa"),
    "load_share_1": (0, 0, 0, "NONE"),
}


def test_universal_files_say_kind_and_unit(tmp_path):
    pyuff = pytest.importorskip("pyuff", reason="pip install 'gearfe[exchange]'")
    columns = {"frequency_Hz": np.arange(4.0), **{name: np.arange(4.0) + 1.0 for name in KINDS}}
    write_tables(tmp_path, {"spectrum": columns}, ("uff",))
    _, *sets = pyuff.UFF(str(tmp_path / "tables.uff")).read_sets()
    for made, (name, (kind, length, force, unit)) in zip(sets, KINDS.items(), strict=True):
        assert made["abscissa_spec_data_type"] == 18, name
        assert made["ordinate_spec_data_type"] == kind, name
        assert (made["ordinate_len_unit_exp"], made["ordinate_force_unit_exp"]) == (length, force), name
        assert made["ordinate_axis_units_lab"].strip() == unit, name
    assert [made["id2"].strip() for made in sets][:2] == ["transmission error of mesh 1", 'speed of shaft "out"']


def test_universal_files_leave_out_gaps_and_know_time_and_acceleration(tmp_path):
    pyuff = pytest.importorskip("pyuff", reason="pip install 'gearfe[exchange]'")
    time = np.cumsum(np.linspace(1e-5, 3e-5, 7)) + 1e-9  # uneven: no six digits tell its steps
    signal = np.array([1.0, np.nan, 3e-7, 4.0, 5.0, np.nan, 7.0])
    write_csv(tmp_path / "response.csv", {"time_s": time, "case_acceleration_m_per_s2": signal})
    write_tables(tmp_path, {"response": read_csv(tmp_path / "response.csv")}, ("uff",))
    _, made = pyuff.UFF(str(tmp_path / "tables.uff")).read_sets()
    np.testing.assert_array_equal(made["x"], time[np.isfinite(signal)])
    np.testing.assert_array_equal(made["data"], signal[np.isfinite(signal)])
    assert (made["func_type"], made["abscissa_spec_data_type"], made["ordinate_spec_data_type"]) == (1, 17, 12)


def test_texts_with_commas_and_quotes_stand_in_one_cell(tmp_path):
    """RFC 4180, read by Python's own reader and by ours; names of modes and expressions have commas."""
    texts = ["mode 1: 99 % in housing, moving", 'a "quoted" one', "plain", ""]
    write_csv(tmp_path / "t.csv", {"max(a, b)": [1.0, 2.0, 3.0, 4.0], "name": texts})
    with (tmp_path / "t.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.reader(stream))
    assert rows == [["max(a, b)", "name"], *([f"{k + 1}", text] for k, text in enumerate(texts))]
    assert read_csv(tmp_path / "t.csv")["name"].tolist() == texts


def test_long_names_stay_apart_in_matlab(tmp_path):
    names = [f"attachment_{'x' * 70}_{k}" for k in (1, 2)]
    columns = {name: np.array([float(k)]) for k, name in enumerate(names)}
    write_tables(tmp_path, {"modes 2": columns, "1st": columns}, ("mat",))
    made = loadmat(tmp_path / "tables.mat", simplify_cells=True)
    assert sorted(made["modes_2"].values()) == sorted(made["x_1st"].values()) == [0.0, 1.0]


def test_the_report_holds_the_run_and_opens_offline(tmp_path, capsys):
    line = ["stiffness", JOB, "--out", str(tmp_path), *COARSE, "--set", "pair.face_width_mm=12", "--report"]
    out, _ = told(capsys, *line)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "also written: report.html" in out
    assert page.count("<img") == 2  # the gears, the curve
    assert not re.search(r"(?:src|href)=\"(?!data:|#)", page)
    first = out.splitlines()[0]
    for part in (first, "pair.face_width_mm=12", "[pair.pinion]", "k_mesh_N_per_m", "numpy", "python"):
        assert part in page, part
    # a later run that asks for no report leaves no old one beside its tables
    told(capsys, "stiffness", JOB, "--out", str(tmp_path), *COARSE, "--no-pictures")
    assert not (tmp_path / "report.html").exists()


def test_json_alone(tmp_path, capsys):
    out, _ = told(capsys, "stiffness", JOB, "--out", str(tmp_path), *COARSE, "--no-pictures", "--json")
    made = json.loads(out)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert made["exit_code"] == 0
    assert made["files"] == ["stiffness.csv", "summary.json"]
    assert summary.items() <= made.items()


def test_a_mechanism_without_a_folder_goes_to_out(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    told(capsys, "new", "mechanism", "crank.toml")
    out, _ = told(capsys, "mechanism", "crank.toml", "--until", "0.1", "--no-pictures", "--no-estimate", "--json")
    assert Path(json.loads(out)["folder"]) == Path("out/crank/mechanism")
    assert (tmp_path / "out/crank/mechanism/trajectory.csv").exists()


def test_a_quiet_mechanism_says_that_its_run_stopped(tmp_path, capsys):
    told(capsys, "new", "mechanism", str(tmp_path / "crank.toml"))
    text = (tmp_path / "crank.toml").read_text(encoding="utf-8")
    load = '\n[forces.pole]\ntype = "moment"\nbody = "crank"\nmoment_N_m = "1/(time - 0.01)"\n'
    (tmp_path / "crank.toml").write_text(text + load, encoding="utf-8")
    line = [
        "mechanism",
        str(tmp_path / "crank.toml"),
        "--out",
        str(tmp_path),
        "--until",
        "0.1",
        "--no-pictures",
        "--no-estimate",
    ]
    assert main([*line, "-q"]) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert "the run stopped at 0.0" in err
    assert "division by zero" in err


def test_quiet_and_verbose(tmp_path, capsys):
    line = ["gear", JOB, "--out", str(tmp_path)]
    assert told(capsys, *line, "-q") == ("", "")
    out, err = told(capsys, *line, "-v")
    assert "centre_distance_mm" in out
    assert "drawing" in err
    assert main([*line, "-q", "-v"]) == 2


def test_a_format_that_is_none(tmp_path, capsys):
    assert main(["gear", JOB, "--out", str(tmp_path), "--format", "xlsx"]) == 2
    assert "csv, npz, h5, mat, uff" in capsys.readouterr().err


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash")
def test_bash_completes(tmp_path, capsys):
    out, _ = told(capsys, "completion", "bash")
    (tmp_path / "gearfe").write_text(out)

    def completed(*words: str) -> list[str]:
        ask = f'COMP_WORDS=({" ".join(words)} "$1"); COMP_CWORD={len(words)}; _gearfe; echo "${{COMPREPLY[*]}}"'
        program = f"complete() {{ :; }}; . {tmp_path / 'gearfe'}; set -- '{{}}'; {ask}"
        last, program = words[-1], program.replace(f"({' '.join(words)} ", f"({' '.join(words[:-1])} ")
        program = program.replace(f"COMP_CWORD={len(words)}", f"COMP_CWORD={len(words) - 1}").replace("{}", last)
        return subprocess.run(["bash", "-c", program], capture_output=True, text=True, check=True).stdout.split()

    assert set(completed("gearfe", "st")) == {"stiffness", "study"}
    assert completed("gearfe", "stiffness", "--pla") == ["--plane"]
    assert completed("gearfe", "stiffness", "--plane", "str") == ["strain", "stress"]
    assert completed("gearfe", "stiffness", "job") == []  # files: the shell's own way


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_other_shells_are_answered(shell, capsys):
    out, _ = told(capsys, "completion", shell)
    assert all(name in out for name in COMMANDS)
    assert main(["completion", "tcsh"]) == 2
    assert sys.stdout is not None
