"""The program at the shell: bad files, options before the job, closed pipes; each mistake is told in a line."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

from gearfe.base.errors import InputError, NotFiniteWarning, shown
from gearfe.base.files import csv_table, write_csv
from gearfe.base.tables.examples import job_file
from gearfe.base.tables.housing import HousingMeshTable
from gearfe.cli.arguments import CommandParser
from gearfe.cli.housing import cure_of_error
from gearfe.cli.main import CLOSED, main
from tests.places import GEOMETRY, MESHES

JOB = GEOMETRY / "gear_train.toml"
#: Every command that reads a job file, with what it needs besides.
READERS = {
    "stiffness": (),
    "loadmap": (),
    "gear": (),
    "mesh": ("--out", "x.msh"),
    "housing": (),
    "vibration": (),
    "mechanism": ("--out", "x"),
}
#: Text of a job file -> part of the message; all of it is wrong for every command.
WRONG = {
    "no_toml": ("[pair\n", "not valid TOML"),
    "no_table": ("[pear]\nteeth = 3\n", "unknown name 'pear'"),
    "no_number": ("[pair]\nmodule_mm = 'two'\n[bodies.a]\nmass_kg = 'two'\n", ""),
    "empty": ("", ""),
}


def ran(code: str, *arguments: str) -> None:
    line = [sys.executable, "-c", code, *arguments]
    made = subprocess.run(line, check=False, capture_output=True, text=True, timeout=120)
    assert made.returncode == 0, made.stderr


def test_a_bad_file_is_answered_before_the_libraries_load(tmp_path):
    """One process for all commands: nothing heavy may be there at the end."""
    for name, (text, _) in WRONG.items():
        (tmp_path / f"{name}.toml").write_text(text)
    code = (
        "import sys\nfrom gearfe.cli.main import main\n"
        f"for command, options in {READERS!r}.items():\n"
        f"    for name in {list(WRONG)!r}:\n"
        "        assert main([command, f'{sys.argv[1]}/{name}.toml', *options]) == 2, (command, name)\n"
        "heavy = {'numpy', 'scipy', 'skfem', 'gmsh', 'numba', 'matplotlib', 'h5py'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    ran(code, str(tmp_path))


def test_gears_that_cannot_run_together_are_told_before_scipy_loads(tmp_path):
    text = job_file("stiffness")
    assert "centre_distance_mm = 82.5" in text
    text = text.replace("centre_distance_mm = 82.5", "centre_distance_mm = 92.0")
    (tmp_path / "job.toml").write_text(text)
    code = (
        "import sys\nfrom gearfe.cli.main import main\n"
        "for line in (['stiffness'], ['loadmap', '--torques-Nm', '5'], ['gear'], ['mesh', '--out', 'x.msh']):\n"
        "    assert main([*line, sys.argv[1] + '/job.toml']) == 2, line\n"
        "heavy = {'scipy', 'skfem', 'gmsh', 'numba', 'matplotlib', 'h5py'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    ran(code, str(tmp_path))


#: Ctrl-C as a module is looked for, and in a text that is executed to make a class.
FOUND = """
class Finder:
    def find_spec(self, name, *rest):
        if name == 'gearfe.{}':
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Finder())
"""
EXECUTED = """
import dataclasses
def interrupted(*rest, **options):
    exec('os.kill(os.getpid(), signal.SIGINT); x = 1')
dataclasses._create_fn = interrupted
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("when", [FOUND.format("cli.arguments"), FOUND.format("base.config"), EXECUTED])
def test_an_interruption_while_the_program_loads_is_told_as_later(when: str) -> None:
    # a shell's job in the background ignores interruptions, and so would what it starts
    listening = "import os, signal, sys\nsignal.signal(signal.SIGINT, signal.default_int_handler)"
    code = f"{listening}\n{when}\nfrom gearfe.cli.main import main\nsys.exit(main(['stiffness', 'job.toml']))"
    made = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True, timeout=120)
    assert (made.returncode, made.stderr) == (130, "gearfe: interrupted\n")


def test_every_table_with_infinite_numbers_is_told(tmp_path, capsys, monkeypatch):
    """The room that writes tables looks, whatever the command; where a table may have gaps, these are no numbers."""
    values = {"place": ["a", "b", "c"], "size_mm": np.array([1.0, np.inf, np.nan]), "count": np.arange(3)}
    with pytest.warns(NotFiniteWarning, match=r"t\.csv: column size_mm: 2 of 3 .* the first in row 2"):
        write_csv(tmp_path / "t.csv", values, gaps=False)

    def written_in_pieces() -> None:
        with csv_table(tmp_path / "t.csv") as table:
            table.write(values)
            table.write(values)

    with pytest.warns(NotFiniteWarning, match="2 of 6 .* the first in row 2"):
        written_in_pieces()
    monkeypatch.setattr("gearfe.cli.gear.run", lambda _: len(write_csv(tmp_path / "t.csv", values)) - 1)
    for _ in range(2):  # Python tells a warning once
        assert main(["gear", str(JOB)]) == 1
        assert capsys.readouterr().err.startswith(
            "gearfe: warning: t.csv: column size_mm: 1 of 3 values are not finite"
        )


@pytest.mark.parametrize("command", READERS)
@pytest.mark.parametrize("name", WRONG)
def test_wrong_files(tmp_path, capsys, command, name):
    text, message = WRONG[name]
    (tmp_path / "job.toml").write_text(text)
    assert main([command, str(tmp_path / "job.toml"), *READERS[command]]) == 2
    told = capsys.readouterr().err
    assert told.startswith("gearfe: error: ")
    assert message in told
    assert len(told.splitlines()) == 1
    assert len(told) < 400


@pytest.mark.parametrize(
    ("raw", "message"),
    [
        ("# é\n[pair]".encode("utf-16"), "is written in UTF-16; save it as UTF-8"),
        ("[pair]".encode("utf-32"), "is written in UTF-32"),
        ("[pair]".encode("utf-16-le"), "is no text"),
        ("a = 1\n# 20 °C\n".encode("latin-1"), "it seems, Latin-1: line 2 has '°' as byte 0xb0"),
        ("# 20 µm – fine\n".encode("cp1252"), "it seems, Windows-1252: line 1 has 'µ'"),
        (b"\x7fELF\x00\x80", "is no text"),
        (b"a = " + b"9" * 5000, "whole number with thousands of digits"),
        (b"a = " + b"[" * 5000, "not valid TOML"),
    ],
)
def test_encodings_are_named(tmp_path, capsys, raw, message):
    (tmp_path / "job.toml").write_bytes(raw)
    assert main(["gear", str(tmp_path / "job.toml")]) == 2
    assert message in capsys.readouterr().err


def test_a_byte_order_mark_is_no_mistake(tmp_path):
    (tmp_path / "job.toml").write_bytes(b"\xef\xbb\xbf" + JOB.read_bytes())
    assert main(["gear", str(tmp_path / "job.toml"), "--out", str(tmp_path / "out")]) == 0


def test_folders_and_files_that_cannot_be_read(tmp_path, capsys):
    assert main(["gear", str(tmp_path)]) == 2
    assert "is a folder, not a file" in capsys.readouterr().err
    assert main(["gear", "no\0file"]) == 2
    assert main(["gear", str(tmp_path / ("long" * 100))]) == 2
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (12, "12"),
        (10**400, "1.000e+400"),
        (-(2 * 10**5000), "-2.000e+5000"),
        (16**9000, "e+10837"),
        ([10**30] * 50, "1.000e+30, 1.000e+30, ..."),
        ("x" * 9000, "..."),
        ({str(i): i for i in range(99)}, "..."),
    ],
    ids=range(7),
)
def test_values_in_messages_are_short(value, text):
    assert text in shown(value)
    assert len(str(InputError("pair.teeth", value, "is wrong"))) < 200


def parser() -> CommandParser:
    made = CommandParser(prog="gearfe try")
    made.add_argument("job")
    made.add_argument("--fields", nargs="*", type=float)
    made.add_argument("--animate", nargs="?", type=int, const=40)
    made.add_argument("--torques", nargs="+", type=float)
    made.add_argument("--curve", nargs="+")
    made.add_argument("--angles", nargs=3, type=float)
    made.add_argument("--solve", action="store_true")
    return made


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("--fields J", {"fields": []}),
        ("--fields 1 -2 J", {"fields": [1.0, -2.0]}),
        ("--fields 1 J --solve", {"fields": [1.0], "solve": True}),
        ("--animate J", {"animate": 40}),
        ("--animate 7 J", {"animate": 7}),
        ("--torques 1 2 J", {"torques": [1.0, 2.0]}),
        ("--curve a.csv J", {"curve": ["a.csv"]}),
        ("--curve a.csv b.csv J --animate 3", {"curve": ["a.csv", "b.csv"], "animate": 3}),
        ("J --curve a.csv b.csv", {"curve": ["a.csv", "b.csv"]}),
        ("--angles -1 1 5 J", {"angles": [-1.0, 1.0, 5.0]}),
        ("--fields=3 J", {"fields": [3.0]}),
        ("--fields -- J", {"fields": []}),
        ("--solve J --fields", {"solve": True, "fields": []}),
    ],
)
def test_options_with_many_values_leave_the_job(words, expected):
    """The job may stand anywhere; what argparse makes of the same words with the job in front is the reference."""
    made = vars(parser().parse_args(words.split()))
    assert made == {**vars(parser().parse_args(["J"])), **expected}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("", "required: job"),
        ("--fields", "required: job"),
        ("--torques J", "invalid float value: 'J'"),
        ("J K", "'K': is one argument too many"),
        ("J --fields x", "'x': is no value of --fields"),
        ("J --fiels 3", "unknown name '--fiels'; did you mean '--fields'"),
        ("J --angles 1 2", "expected 3 arguments"),
    ],
)
def test_mistakes_of_the_command_line(words, message):
    with pytest.raises(InputError, match=message):
        parser().parse_args(words.split())


@pytest.mark.parametrize("arguments", [["--help"], ["stiffness", "--help"], ["gear", str(JOB)], ["gear", "no.toml"]])
def test_a_closed_pipe_is_no_traceback(tmp_path, arguments):
    read, write = os.pipe()
    os.close(read)
    line = [sys.executable, "-m", "gearfe", *arguments, *(["--out", str(tmp_path)] if arguments[0] == "gear" else [])]
    code = subprocess.run(line, check=False, stdout=write, stderr=subprocess.PIPE, text=True, timeout=120)
    os.close(write)
    assert "Traceback" not in code.stderr
    assert "Exception ignored" not in code.stderr
    assert code.returncode == (2 if "no.toml" in arguments else CLOSED)


def test_any_key_of_a_job_can_be_set(tmp_path):
    changes = ["--set", "pair.pinion.teeth=21", "--set", "pair.pinion.pitch_diameter_mm = 52.5"]
    assert main(["gear", str(JOB), "--out", str(tmp_path / "set"), *changes]) == 0
    text = (
        JOB.read_text()
        .replace("teeth = 20", "teeth = 21")
        .replace("pitch_diameter_mm = 50.0", "pitch_diameter_mm = 52.5")
    )
    (tmp_path / "job.toml").write_text(text)
    assert main(["gear", str(tmp_path / "job.toml"), "--out", str(tmp_path / "file")]) == 0
    by_set, by_file = ((tmp_path / name / "gear_pair.json").read_text() for name in ("set", "file"))
    assert by_set == by_file
    assert "52.5" in by_set


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("pair.pinion.teth=21", "did you mean 'teeth'"),
        ("pear.pinion.teeth=21", "unknown name 'pear'"),
        ("pair.pinion.teeth=many", "must be a number"),
        ("pair.pinion.teeth", "must be a key and its value"),
        ("pair.pinion.teeth.x=1", "teeth is the value 20 in the job, not a table; name that key"),
        ("train.meshes.9.backlash_um=1", "has 2 entries in the job"),
    ],
)
def test_a_wrong_change_is_named(tmp_path, capsys, change, message):
    assert main(["gear", str(JOB), "--out", str(tmp_path / "out"), "--set", change]) == 2
    assert message in capsys.readouterr().err


def test_no_pictures_means_none_with_fields_either(tmp_path):
    options = ["--angles", "0", "9", "9", "--no-estimate", "--no-pictures", "--coarsen", "4"]
    for fields in (["0"], ["all"]):
        assert main(["stiffness", str(JOB), "--out", str(tmp_path), *options, "--fields", *fields]) == 0
        names = {path.name for path in tmp_path.iterdir()}
        assert names == {"fields.vtkhdf", "pressure.csv", "stiffness.csv", "summary.json"}


def test_a_large_estimated_error_of_a_housing_comes_with_its_cure(tmp_path, capsys):
    """The mesh of the example is coarse: tens of per cent at least."""
    box = MESHES / "box.toml"
    assert main(["housing", str(box), "--out", str(tmp_path), "--no-pictures", "--modes", "2"]) == 0
    said = capsys.readouterr().out
    assert 'mesh = { file = "box.msh", refine_to_unknowns = ' in said
    assert "e+0" not in said
    own, parametric = HousingMeshTable(file="solid.step"), HousingMeshTable(size_mm=9.0)
    assert "smaller size_mm, or refine" in cure_of_error(own, 3000, by_reduction=False)
    assert "size_mm in [housing.mesh] (now 9)" in cure_of_error(parametric, 3000, by_reduction=False)
    assert "modes_below_Hz" in cure_of_error(own, 3000, by_reduction=True)
