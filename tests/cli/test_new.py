"""Job files that ``gearfe new`` writes: they run as they are, and every optional key in them is a key."""

import json
import re
import tomllib
from dataclasses import fields
from pathlib import Path

import pytest

from gearfe.base.config import build, quantity
from gearfe.base.tables.examples import JOBS, RUN_BY, job_file
from gearfe.base.tables.jobs import TABLES, load_job, read_train_tables, table_class
from gearfe.base.tables.mechanism import BodyTable, MechanismFile, RunTable, read_mechanism_file
from gearfe.base.tables.microgeometry import GearMicrogeometryTable
from gearfe.base.tables.text import table_text
from gearfe.base.tables.train import TrainShaftTable
from gearfe.cli.main import main
from tests.places import GEOMETRY, MESHES, ROOT

SHIPPED = sorted(GEOMETRY.glob("*.toml"))


@pytest.mark.parametrize("kind", JOBS)
def test_the_file_is_read_without_a_mistake(tmp_path, capsys, kind):
    path = tmp_path / "job.toml"
    assert main(["new", kind, str(path)]) == 0
    assert f"gearfe {RUN_BY.get(kind, kind)} {path}" in capsys.readouterr().out
    if kind == "mechanism":
        build(MechanismFile, tomllib.loads(path.read_text()), "")
    else:
        assert set(load_job(path, tuple(JOBS[kind][1]))) == set(JOBS[kind][1])
    assert max(len(line) for line in path.read_text().splitlines()) <= 120


def read(text: str, folder: Path):
    """Tables of a job, as a command reads them."""
    (folder / "job.toml").write_text(text, encoding="utf-8")
    if "[bodies." in text:
        return read_mechanism_file(folder / "job.toml")
    return load_job(folder / "job.toml", (), tuple(TABLES))


@pytest.mark.parametrize("source", [*JOBS, *SHIPPED], ids=lambda source: getattr(source, "name", source))
def test_every_optional_key_can_be_switched_on(tmp_path, source):
    """Taking the # off a key, one at a time and all together, leaves valid TOML and the same job."""
    text = source.read_text(encoding="utf-8") if isinstance(source, Path) else job_file(source)
    lines = text.splitlines()
    commented = [number for number, line in enumerate(lines) if re.match(r"#\s*[\w.\"]+\s*=", line)]
    plain = read(text, tmp_path)
    for chosen in [*([number] for number in commented), commented]:
        changed = [line.lstrip("# ") if number in chosen else line for number, line in enumerate(lines)]
        assert tomllib.loads("\n".join(changed)) != tomllib.loads(text) or not chosen, chosen
        assert read("\n".join(changed), tmp_path) == plain, [lines[number] for number in chosen]
    assert len(commented) >= 3 or isinstance(source, Path)


def test_a_gearbox_runs_with_the_tables_at_its_end(tmp_path, capsys):
    """Without their ##: an elastic input shaft, a motor shaft on ball bearings behind a clutch, a motor and a fan."""
    text = re.sub(r"^## ?", "", job_file("gearbox"), flags=re.MULTILINE)
    for old, new in (
        ("duration_ms = 10.0", "duration_ms = 0.2"),
        ('mesh_model = "potential"', 'mesh_model = "mean_stiffness"'),
        ('driver = "input_pinion"', 'stiffness_N_per_m = 3e8\ndriver = "input_pinion"'),
        ('driver = "output_pinion"', 'stiffness_N_per_m = 3e8\ndriver = "output_pinion"'),
    ):
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    (tmp_path / "job.toml").write_text(text)
    assert main(["vibration", str(tmp_path / "job.toml"), "--out", str(tmp_path / "out"), "--no-pictures"]) == 0
    printed = capsys.readouterr().out
    for part in ("shaft input: elastic", "shaft motor_shaft: elastic", "bearing M1", "operating point: drive at 150"):
        assert part in printed, part
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert set(summary["elastic_shafts"]) == {"input", "motor_shaft"}
    assert set(summary["bearings"]) == {"M1", "M2"}
    with (tmp_path / "out" / "response.csv").open() as stream:
        header = stream.readline()
    assert {"machine_motor_speed_rad_per_s", "machine_fan_torque_Nm", "coupling_clutch_torque_Nm"} <= set(
        header.strip().split(",")
    )


@pytest.mark.parametrize("kind", JOBS)
def test_every_key_of_the_tables_is_named(kind):
    """A key without a default is told as one that is not set."""
    text = job_file(kind)
    inside = {
        "mechanism": [RunTable, BodyTable],
        "loadmap": [GearMicrogeometryTable],
        "vibration": [TrainShaftTable],
    }
    for table in [*(table_class(name) for name in JOBS[kind][1] if name), *inside.get(kind, [])]:
        for field in fields(table):
            assert re.search(rf"\b{field.name}\b( =| \(not set\):|\]|\.)", text), field.name


def test_every_line_tells_its_unit_or_meaning():
    for line in job_file("vibration").splitlines():
        if "=" in line and not line.startswith("# ") and len(line) <= 110:
            assert "#" in line, line


def test_the_stiffness_job_runs(tmp_path):
    path = tmp_path / "job.toml"
    assert main(["new", "stiffness", str(path)]) == 0
    options = ["--angles", "1", "8", "17", "--coarsen", "3", "--no-estimate", "--no-pictures"]
    assert main(["stiffness", str(path), "--out", str(tmp_path / "out"), *options]) == 0
    assert (tmp_path / "out" / "stiffness.csv").exists()


def test_the_mechanism_job_runs(tmp_path):
    path = tmp_path / "job.toml"
    assert main(["new", "mechanism", str(path)]) == 0
    assert main(["mechanism", str(path), "--out", str(tmp_path / "out"), "--until", "0.2", "--no-pictures"]) == 0
    assert (tmp_path / "out" / "trajectory.csv").exists()


def test_mistakes(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["new", "vibrations"]) == 2
    assert "did you mean 'vibration'?" in capsys.readouterr().err
    assert main(["new", "stiffness"]) == 0
    assert (tmp_path / "stiffness.toml").exists()
    (tmp_path / "stiffness.toml").write_text("mine")
    assert main(["new", "stiffness"]) == 2
    assert "exists" in capsys.readouterr().err
    assert (tmp_path / "stiffness.toml").read_text() == "mine"
    assert main(["new", "stiffness", "--force"]) == 0
    assert main(["new", "stiffness", "no/such/folder/job.toml"]) == 2


def test_kinds_of_keys():
    """Texts, flags, lists, tables in a line, numbers, nested tables, lists of tables, named tables."""
    from dataclasses import dataclass

    @dataclass(frozen=True)
    class Inner:
        a: float = quantity(1.0, doc="first (m)")
        b: str | None = quantity(None, doc="second", choices=("x", "y"))

    @dataclass(frozen=True)
    class Outer:
        flag: bool = quantity(True, doc="a flag")
        pair: tuple[float, float] = quantity((0.0, 1.0), doc="two")
        names: dict[str, float] = quantity(dict, doc="numbers by name")  # noqa: RUF009
        one: Inner = quantity(Inner, doc="the one")  # noqa: RUF009
        many: tuple[Inner, ...] = quantity((), doc="[[outer.many]]")
        named: dict[str, Inner] = quantity(dict, doc="[outer.named.NAME]")  # noqa: RUF009

    globals()["Inner"] = Inner
    example = {
        "pair": [2.0, 3.5],
        "names": {"angle(x)": -1.0},
        "one": {"b": 'say "x"'},
        "many": [{"a": 2.0}, {"b": "y"}],
        "named": {"left arm": {"a": 1e-9}},
    }
    text = table_text(Outer, example, "outer")
    assert tomllib.loads(text) == {"outer": example}
    assert "# flag = true " in text
    assert "# first (m)" in text


def test_shipped_jobs_come_with_their_files(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["new", "--list"]) == 0
    told = capsys.readouterr().out
    assert all(name in told for name in ("stiffness", "andrews.toml", "box.toml"))
    assert main(["new", "andrews.toml"]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"andrews.toml", "andrews_reference.csv"}
    assert "gearfe mechanism andrews.toml" in capsys.readouterr().out
    for name in ("andrews.toml", "andrews_reference.csv"):
        assert (tmp_path / name).read_bytes() == (GEOMETRY / name).read_bytes()
    assert main(["new", "andrews.toml", "same.toml"]) == 0  # the table beside it is the same
    (tmp_path / "andrews_reference.csv").write_text("mine")
    assert main(["new", "andrews.toml", "mine.toml"]) == 2  # now it would be replaced
    assert "andrews_reference.csv" in capsys.readouterr().err
    assert not (tmp_path / "mine.toml").exists()
    # a name that ends another one is not named by it
    assert main(["new", "elastic_slider_crank.toml"]) == main(["new", "slider_crank.toml"]) == 0
    assert main(["new", "andrew.toml"]) == 2
    assert "did you mean 'andrews.toml'" in capsys.readouterr().err


@pytest.mark.parametrize("path", [*SHIPPED, MESHES / "box.toml"], ids=lambda path: path.stem)
def test_shipped_trains_are_read(path):
    """All rules of their tables hold, of each variant."""
    tables = tomllib.loads(path.read_text(encoding="utf-8"))
    if "train" not in tables:
        pytest.skip("no train")
    for variant in (None, *tables["train"].get("variants", {})):
        assert read_train_tables(path, variant)["train"].shafts


def test_every_shipped_file_is_in_the_wheel():
    with (ROOT / "pyproject.toml").open("rb") as stream:
        held = tomllib.load(stream)["tool"]["hatch"]["build"]["targets"]["wheel"]["force-include"]
    suffixes = {".toml", ".csv", ".msh", ".inp"}
    there = {
        f"{folder}/{p.name}"
        for folder in ("geometry", "meshes")
        for p in (ROOT / folder).iterdir()
        if p.suffix in suffixes
    }
    assert set(held) == there
    assert all(place == f"gearfe/examples/{Path(name).name}" for name, place in held.items())
