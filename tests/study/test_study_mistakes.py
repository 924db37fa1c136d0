"""Studies by the command: each mistake is told before cases run, and kills at random moments lose nothing."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
import typing
from contextlib import suppress
from pathlib import Path

import pytest

from gearfe.base.cache import versions
from gearfe.base.config import _convert, fields_of, read_toml, type_hints
from gearfe.base.errors import InputError
from gearfe.base.files import output_folder
from gearfe.base.tables.jobs import TABLES, job_tables, table_class
from gearfe.base.tables.mechanism import MechanismFile
from gearfe.cli.main import main
from gearfe.study.job import read_study, run_study
from gearfe.study.journal import Journal
from gearfe.study.run import serially
from tests.makers.studies import rows_of, stored_rows, written

#: Numbers that no key can have -> how a message shows them, and their largest size.
HUGE = {
    2**63: ("9.223e+18", "9.22e+18"),
    -(10**400): ("-1.000e+400", "9.22e+18"),
    1e80: ("1e+80", "1e+75"),
    math.inf: ("inf", "1e+75"),
    math.nan: ("nan", "1e+75"),
}
PLACE = "bodies.a.position_m.0 = {"
OUTPUT = 'y = "'


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (PLACE, "bodies.a.postion_m.0 = {", "did you mean 'position_m'"),
        (
            PLACE,
            f"parameters.radius = [1.0]\n{PLACE}",
            "study.parameters.parameters: unknown name 'radius'; known names: none",
        ),
        (PLACE, "bodies.c.mass_kg = [1]\nbodies.a.position_m.0 = {", "unknown name 'c'; known names: a, b"),
        (PLACE, '"bodies.a.position_m.1" = [0.0]\nbodies.a.position_m.0 = {', "occurs twice"),
        (PLACE, "bodies.a.position_m = [0.0]\nbodies.a.position_m.0 = {", "TOML"),
        (PLACE, "bodies.a.position_m.7 = {", "has 2 entries, 0 to 1"),
        ("bodies.b.position_m.0 = {", "bodies.b = {", "is a table, not a key"),
        ("low = -3.14", "low = 4.0, hgih = -3.14", "did you mean 'high'"),
        ("{ low = -3.141592653589793", "{ low = 3.2", "must be > low"),
        (OUTPUT, 'y = "xx1 + ', "did you mean 'x1'"),
        (OUTPUT, 'y = "summary.energy_drft_J + ', "did you mean 'energy_drift_J'"),
        (OUTPUT, 'y = "x1 + ', "gives 2 values"),
        (OUTPUT, 'y = "open(0) + ', "unknown name 'open'"),
        ("[study.outputs]", "[study.limits.z]\nlow = 1.0\n[study.outputs]", "unknown name 'z'"),
        ('"mechanism"', '"mechnism"', "did you mean 'mechanism'"),
        ('"sobol"', '"sobl"', "did you mean 'sobol'"),
        ("cases = 8", "cases = 0", "must be finite and >= 1"),
        ("cases = 8", "cases = 8\ncores = 2", "unknown name 'cores'"),
        ("seed = 3", f"seed = {2**63}", "study.seed = 9.223e+18: must be finite and >= 0 and of a size up to 9.22e+18"),
        ("seed = 3", f"seed = {10**400}", "study.seed = 1.000e+400: must be finite and >= 0"),
        *(
            (
                PLACE,
                f"bodies.a.mass_kg = [1.0, {value}]\n{PLACE}",
                f"mass_kg = {shown}: must be finite, of a size up to {most}",
            )
            for value, (shown, most) in HUGE.items()
        ),
        (PLACE, f"bodies.a.mass_kg = {{ low = 1, high = {10**400} }}\n{PLACE}", "high = 1.000e+400: must be finite"),
        (PLACE, f"bodies.a.mass_kg = {{ mean = nan, standard_deviation = 1 }}\n{PLACE}", "mean = nan: must be finite"),
        ('"base.toml"', '"bse.toml"', "there is no such file"),
        ('design = "sobol"', 'design = "rows"\nrows_csv = "rows.csv"', "columns are the parameters"),
    ],
)
def test_mistakes_are_told_before_cases_run(tmp_path, capsys, old, new, told):
    path = written(tmp_path)
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new, 1))
    assert main(["study", str(path), "--out", str(tmp_path / "out"), "--jobs", "1", "--no-pictures"]) == 2
    error = capsys.readouterr().err
    assert told in error
    assert "Traceback" not in error
    assert not (tmp_path / "out" / "study.csv").exists()


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ("bodies.a.mass_kg\n1.0\nheavy\n", "heavy"),
        ("bodies.a.mas_kg\n1.0\n", "did you mean 'mass_kg'"),
        ("bodies.a.mass_kg\n", "no rows"),
        ("bodies.a.mass_kg\nnan\n", "must be finite"),
        ("bodies.a.mass_kg\n1e400\n", "rows.csv, row 1, bodies.a.mass_kg = inf: must be finite, of a size up to 1e+75"),
        (None, "there is no such file"),
    ],
)
def test_a_wrong_table_of_rows_is_told(tmp_path, capsys, content, told):
    path = written(tmp_path)
    head, _, outputs = path.read_text().partition("[study.parameters]")
    text = head.replace('"sobol"', '"rows"\nrows_csv = "rows.csv"') + outputs[outputs.index("[study.outputs]") :]
    path.write_text(text)
    if content is not None:
        (tmp_path / "rows.csv").write_text(content)
    code = main(["study", str(path), "--out", str(tmp_path / "out"), "--jobs", "1", "--no-pictures"])
    error = capsys.readouterr().err
    assert code == (1 if content and "heavy" in content else 2)  # a row with a cell that is no number has no answer
    assert told in error


def test_a_folder_of_another_study_is_refused(tmp_path, capsys):
    out = ["--out", str(tmp_path / "out"), "--jobs", "1", "--no-pictures"]
    path = written(tmp_path)
    assert main(["study", str(path), *out]) == 0
    before = rows_of(tmp_path / "out")
    base = tmp_path / "base.toml"
    base.write_text(base.read_text().replace("mass_kg = 1.0", "mass_kg = 2.0"))
    assert main(["study", str(path), *out]) == 2
    assert "base.bodies.a.mass_kg differs; choose another --out, or give --restart" in capsys.readouterr().err
    assert rows_of(tmp_path / "out") == before
    assert main(["study", str(path), *out, "--restart"]) == 0
    (tmp_path / "out" / "study.json").unlink()  # an export
    assert main(["study", str(path), *out]) == 0
    (tmp_path / "out" / "study.db").unlink()  # as a folder of an earlier version
    before = (tmp_path / "out" / "study.csv").read_bytes()
    assert main(["study", str(path), *out]) == 2
    assert "holds a study.csv without its study.db" in capsys.readouterr().err
    assert (tmp_path / "out" / "study.csv").read_bytes() == before


def test_a_file_that_the_job_names_is_a_part_of_the_study(tmp_path, capsys):
    """Another content under the same name would make other rows."""
    pitch, path = tmp_path / "pitch.csv", tmp_path / "study.toml"
    pitch.write_text("tooth,pitch_um\n" + "".join(f"{n},{n % 3}\n" for n in range(20)))
    text = "[pair]\nmodule_mm = 2.0\npressure_angle_deg = 20.0\nface_width_mm = 10.0\n"
    text += "[pair.pinion]\nteeth = 20\nbore_diameter_mm = 8.0\n[pair.wheel]\nteeth = 31\nbore_diameter_mm = 15.0\n"
    text += "[microgeometry]\ntorques_Nm = [40.0]\npositions = 3\nmesh_cycles = 1\n"
    text += '[study]\njob = "loadmap"\ndesign = "factorial"\n[study.parameters]\n'
    text += 'microgeometry.pinion.pitch_csv = ["pitch.csv"]\n[study.outputs]\nx = "mean(k_tangent_N_per_m)"\n'
    path.write_text(text)
    command = ["study", str(path), "--out", str(tmp_path / "out"), "--jobs", "1", "--no-pictures"]
    assert main(command) == 0
    assert main(command) == 0
    pitch.write_text(pitch.read_text().replace("1,1\n", "1,2\n", 1))
    assert main(command) == 2
    assert "files.pitch.csv differs" in capsys.readouterr().err


def test_texts_of_a_job_need_not_be_names_of_files(tmp_path):
    """An expression longer than any file's name."""
    path, base = written(tmp_path, cases=2), tmp_path / "base.toml"
    base.write_text(base.read_text().replace('"x(a)"', '"x(a)' + " + 0.0" * 60 + '"'))
    made = run_study(read_study(path), tmp_path / "out", jobs=1)
    assert list(made.cells["status"]) == ["done", "done"]


@pytest.mark.skipif(sys.platform == "win32", reason="locks of a folder are POSIX")
def test_a_folder_has_one_writer(tmp_path, capsys):
    path, out = written(tmp_path, cases=100_000), tmp_path / "out"
    command = ["study", str(path), "--out", str(out), "--jobs", "1", "--no-pictures"]
    first = subprocess.Popen([sys.executable, "-m", "gearfe", *command], stdout=subprocess.DEVNULL)
    limit = time.monotonic() + 300.0
    while not ((out / "study.csv").exists() and len(rows_of(out)) > 5) and time.monotonic() < limit:
        time.sleep(0.02)
    for more in ([], ["--restart"]):
        assert main([*command, *more]) == 2
        assert "is being written by another study" in capsys.readouterr().err
    first.kill()
    first.wait()
    assert len(rows_of(out)) > 5
    path.write_text(path.read_text().replace("100000", "10"))
    assert main([*command, "--restart"]) == 0  # free again
    assert len(rows_of(out)) == 11


def test_gears_that_cannot_be_are_rows_and_stop_a_study(tmp_path, capsys):
    """Teeth from 4 to 8: those below 8 are refused; with none above, the study stops after 50."""
    text = "[pair]\nmodule_mm = 2.0\npressure_angle_deg = 20.0\nface_width_mm = 10.0\n"
    text += "[pair.pinion]\nteeth = 20\nbore_diameter_mm = 8.0\n[pair.wheel]\nteeth = 31\nbore_diameter_mm = 15.0\n"
    text += (
        '[stiffness]\ntorque_Nm = 40.0\ncoarsen = 3.0\nangle_step_deg = 9.0\n[study]\njob = "stiffness"\ncases = 60\n'
    )
    text += '[study.outputs]\nk = "mean(k_mesh_N_per_m)"\n[study.parameters]\n'
    path = tmp_path / "study.toml"
    path.write_text(text + "pair.pinion.teeth = { low = 3, high = 7 }\n")
    command = ["study", str(path), "--out", str(tmp_path / "out"), "--jobs", "1", "--no-pictures"]
    assert main(command) == 2
    assert "the first 50 cases have no answer" in capsys.readouterr().err
    assert [row[3] for row in rows_of(tmp_path / "out")[1:]] == ["invalid"] * 50
    path.write_text(text.replace("cases = 60", 'design = "factorial"') + "pair.pinion.teeth = [7, 20]\n")
    assert main([*command, "--restart"]) == 1
    assert "1 of 2 cases are not solved wholly; case 0: pair.pinion.teeth = 7: must be" in capsys.readouterr().err


def test_a_case_that_is_written_elsewhere_finds_its_files(tmp_path):
    text = "[pair]\nmodule_mm = 2.0\npressure_angle_deg = 20.0\nface_width_mm = 10.0\n"
    text += "[pair.pinion]\nteeth = 20\nbore_diameter_mm = 8.0\n[pair.wheel]\nteeth = 31\nbore_diameter_mm = 15.0\n"
    text += '[microgeometry]\ntorques_Nm = [40.0]\n[microgeometry.pinion]\npitch_csv = "pitch.csv"\n'
    (tmp_path / "pair.toml").write_text(text)
    (tmp_path / "pitch.csv").write_text("tooth,pitch_um\n" + "".join(f"{n},{n % 3}\n" for n in range(1, 21)))
    (tmp_path / "study.toml").write_text(
        '[study]\njob = "loadmap"\nbase = "pair.toml"\n[study.parameters]\n'
        'microgeometry.wheel.profile_slope_um = [1.0, 2.0]\n[study.outputs]\nx = "1"\n'
    )
    (tmp_path / "far" / "away").mkdir(parents=True)
    case = tmp_path / "far" / "away" / "one.toml"
    assert main(["study", str(tmp_path / "study.toml"), "--row", "1", "--write", str(case)]) == 0
    made = read_toml(case)["microgeometry"]["pinion"]["pitch_csv"]
    assert (case.parent / made).resolve() == tmp_path / "pitch.csv"
    assert not Path(made).is_absolute()
    job_tables(read_toml(case), case, ("pair", "microgeometry"))


def test_versions_stand_with_the_rows_that_they_made(tmp_path):
    study = read_study(written(tmp_path))
    run_study(study, tmp_path / "out", jobs=1)
    head = json.loads((tmp_path / "out" / "study.json").read_text())
    assert [v["rows_before"] for v in head["versions"]] == [0]
    run_study(study, tmp_path / "out", jobs=1)
    assert json.loads((tmp_path / "out" / "study.json").read_text()) == head
    shutil.rmtree(tmp_path / "out")
    older = {**versions(), "numpy": "0.1"}  # as if another one had begun
    names = study.task.names, tuple(study.table.outputs)
    with Journal(output_folder(tmp_path / "out"), study.head, older, *names, cases=study.cases) as journal:
        for rows in serially(study.task, list(enumerate(study.cases))):
            journal.append(rows, study.cases)
    run_study(study, tmp_path / "out", jobs=1)
    assert [v["rows_before"] for v in json.loads((tmp_path / "out" / "study.json").read_text())["versions"]] == [0, 8]


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="finds the workers in /proc")
def test_twenty_kills_at_random_moments_lose_nothing(tmp_path):
    """Driver or a worker, by turns of a seed: rows that stood stay as they were; the rest is done, each case once."""
    dice, path = random.Random(7), written(tmp_path, cases=3000)
    command = [sys.executable, "-m", "gearfe", "study", str(path), "--out", str(tmp_path / "out"), "--no-pictures"]
    table, kept, kills = tmp_path / "out" / "study.db", {}, {"driver": 0, "worker": 0}
    while sum(kills.values()) < 20:
        run = subprocess.Popen([*command, "--jobs", "2"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        whom = dice.choice(list(kills))
        size = table.stat().st_size if table.exists() else 0
        while run.poll() is None and whom == "worker" and not (table.exists() and table.stat().st_size > size):
            time.sleep(0.01)
        time.sleep(dice.uniform(0.0, 3.0 if whom == "driver" else 0.2))
        victims = [run.pid] if whom == "driver" else _workers(run.pid)
        if run.poll() is None and victims:
            _kill(dice.choice(victims))
            kills[whom] += 1
            time.sleep(0.3)
        if whom == "worker" and run.poll() is None:
            _kill(run.pid)  # goes on in another driver, with what the replaced worker did
        run.wait()
        rows = {row[0]: row for row in stored_rows(tmp_path / "out")} if table.exists() else {}
        for number, row in kept.items():
            assert rows[number] == row
        kept = {n: row for n, row in rows.items() if row[5] == ""}
        if len(kept) == 3000:
            break
    assert sum(kills.values()) == 20, "the study ended before"
    assert min(kills.values()) > 3
    assert subprocess.run([*command, "--jobs", "2"], capture_output=True, check=False).returncode == 0
    rows = rows_of(tmp_path / "out")[1:]
    assert [row[0] for row in rows] == [str(n) for n in range(3000)]
    for row in rows:
        x1, x2, x3, y = map(float, row[1:5])
        assert y == pytest.approx(
            math.sin(x1) + 7 * math.sin(x2) ** 2 + 0.1 * x3**4 * math.sin(x1), rel=1e-12, abs=1e-12
        )
        assert row[5] == "done"


def _workers(driver: int) -> list[int]:
    """Processes of a driver that solve cases: multiprocessing's helper for resources is none."""
    try:
        found = [int(pid) for pid in Path(f"/proc/{driver}/task/{driver}/children").read_text().split()]
        return [pid for pid in found if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()]
    except (OSError, ValueError):
        return []


def _kill(pid: int) -> None:
    with suppress(ProcessLookupError):
        os.kill(pid, signal.SIGKILL)


@pytest.mark.parametrize("key", ["teeth", "pitch_seed"])
@pytest.mark.parametrize(
    ("spec", "told"),
    [
        ("[20, 99999999999999999999]", "= 1.000e+20: must be finite, of a size up to 9.22e+18"),
        ("{ low = 1, high = 1e30 }", "high = 1e+30: must be of a size up to 9.01e+15, for the key takes whole numbers"),
        ("{ mean = -1e17, standard_deviation = 2.0 }", "mean = -1e+17: must be of a size up to 9.01e+15"),
        ("{ mean = 1.0, standard_deviation = 1e17 }", "standard_deviation = 1e+17: must be of a size up to 9.01e+15"),
        ("{ low = 1, high = 1e15 }", "combinations, more than 10000000"),
    ],
)
def test_whole_numbers_of_a_study_have_64_bits(tmp_path, key, spec, told):
    name = {"teeth": "pair.pinion.teeth", "pitch_seed": "microgeometry.pinion.pitch_seed"}[key]
    path = tmp_path / "study.toml"
    path.write_text(
        "[pair]\nmodule_mm = 2.0\npressure_angle_deg = 20.0\nface_width_mm = 10.0\n"
        "[pair.pinion]\nteeth = 20\nbore_diameter_mm = 8.0\n[pair.wheel]\nteeth = 31\nbore_diameter_mm = 15.0\n"
        '[study]\njob = "loadmap"\ndesign = "factorial"\n[study.outputs]\nx = "1"\n'
        f"[study.parameters]\n{name} = {spec}\n"
    )
    with pytest.raises(InputError, match=re.escape(told)):
        read_study(path)


def _whole_keys():
    """Every key of every job table that takes whole numbers: its table, name and field."""
    seen, tables = set(), [*map(table_class, TABLES), MechanismFile]
    while tables:
        table = tables.pop()
        if table in seen:
            continue
        seen.add(table)
        for name, hint in type_hints(table).items():
            inside = [hint]
            while inside:
                option = inside.pop()
                inside += typing.get_args(option)
                if dataclasses.is_dataclass(option):
                    tables.append(option)
                elif option is int:
                    yield table, name
    assert len(seen) > 20


@pytest.mark.parametrize(("table", "name"), sorted(set(_whole_keys()), key=str))
@pytest.mark.parametrize("value", [2**63, -(2**63), 10**19, 10**400])
def test_whole_numbers_of_all_tables_have_64_bits(table, name, value):
    field = fields_of(table)[name]
    hint = type_hints(table)[name]
    written = value
    while typing.get_origin(hint) in (tuple, dict):  # a list of them, say
        written = [written] if typing.get_origin(hint) is tuple else {"a": written}
        hint = typing.get_args(hint)[-1 if typing.get_origin(hint) is dict else 0]
    with pytest.raises(InputError, match="must") as caught:
        _convert(type_hints(table)[name], written, name, field.metadata)
    assert len(str(caught.value)) < 600
