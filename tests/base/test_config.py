"""Job files are read strictly: every mistake is an error that names the key and what would be right."""

from __future__ import annotations

import pickle
import subprocess
import sys
from dataclasses import dataclass

import pytest

from gearfe.base.config import build, quantity, read_toml
from gearfe.base.errors import InputError
from gearfe.base.files import read_csv, read_numbers
from gearfe.base.tables.jobs import load_job
from gearfe.base.tables.pair import MaterialTable


@dataclass(frozen=True)
class Inner:
    depth_mm: float = quantity(1.0, doc="depth (mm)", above=0.0)


@dataclass(frozen=True)
class Table:
    count: int = quantity(doc="how many", low=1, high=9)
    ratio: float = quantity(0.5, doc="a ratio (-)", low=0.0, below=1.0)
    on: bool = quantity(False, doc="a switch")
    law: str = quantity("penalty", doc="a law", choices=("penalty", "nitsche"))
    limit: float | None = quantity(None, doc="a limit (N)")
    steps: tuple[float, ...] = quantity((), doc="steps (deg)")
    box: tuple[float, float] | None = quantity(None, doc="a box (mm)")
    inner: Inner = quantity(Inner, doc="an inner table")  # noqa: RUF009
    named: dict[str, float] = quantity(dict, doc="named values")  # noqa: RUF009

    def check(self, where):
        if self.limit is not None and self.limit < self.count:
            raise InputError(f"{where}.limit", self.limit, "is below count", "raise it")


def test_defaults_and_conversions():
    made = build(Table, {"count": 3, "ratio": 0, "steps": [1, 2.5], "box": [1, 2], "inner": {}, "named": {"a": 1}}, "t")
    assert made == Table(count=3, ratio=0.0, steps=(1.0, 2.5), box=(1.0, 2.0), inner=Inner(), named={"a": 1.0})
    assert isinstance(made.ratio, float)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({}, "t.count: is required.*how many"),
        ({"count": 1, "rati": 0.1}, "unknown name 'rati'; did you mean 'ratio'"),
        ({"count": 1, "zzz": 0.1}, "known names: .*count"),
        ({"count": 0}, "t.count = 0: must be finite and >= 1 and <= 9"),
        ({"count": 10}, "<= 9"),
        ({"count": 1.0}, "whole number"),
        ({"count": True}, "must be a number"),
        ({"count": 1, "ratio": 10**400}, "must be finite and >= 0 and < 1"),
        ({"count": 1, "ratio": 1.0}, "< 1"),
        ({"count": 1, "ratio": float("nan")}, "finite"),
        ({"count": 1, "ratio": float("inf")}, "finite"),
        ({"count": 1, "ratio": "0.5"}, "must be a number"),
        ({"count": 1, "on": 1}, "true or false"),
        ({"count": 1, "law": "glue"}, "must be one of penalty, nitsche"),
        ({"count": 1, "law": 3}, "text in quotes"),
        ({"count": 1, "steps": 3.0}, "must be a list"),
        ({"count": 1, "steps": [1.0, "x"]}, r"t.steps\[1\]"),
        ({"count": 1, "box": [1.0]}, "2 entries"),
        ({"count": 1, "inner": 3}, r"t.inner = 3: must be a table"),
        ({"count": 1, "inner": {"depth_mm": 0}}, "t.inner.depth_mm.*> 0"),
        ({"count": 1, "named": {"a": "b"}}, "t.named.a"),
        ({"count": 1, "named": 1}, "must be a table"),
        ({"count": 5, "limit": 2.0}, "t.limit = 2.0: is below count; raise it"),
        ([1], "must be a table"),
    ],
)
def test_mistakes_are_named(table, message):
    with pytest.raises(InputError, match=message):
        build(Table, table, "t")


def test_job_files(tmp_path):
    job = tmp_path / "job.toml"
    with pytest.raises(InputError, match="there is no such file"):
        read_toml(job)
    with pytest.raises(InputError, match="is a folder"):
        read_toml(tmp_path)
    job.write_text("[pair\n")
    with pytest.raises(InputError, match="not valid TOML"):
        read_toml(job)
    job.write_text("[pear]\n")
    with pytest.raises(InputError, match="did you mean 'pair'"):
        load_job(job, ())
    job.write_text("")
    with pytest.raises(InputError, match=r"\[pair\]: is missing in job.toml"):
        load_job(job, ("pair",))


def test_a_misspelt_key_of_another_job_is_an_error_too(tmp_path):
    job = tmp_path / "job.toml"
    job.write_text("[pair]\nmodul_mm = 2\n")
    with pytest.raises(InputError, match="did you mean 'module_mm'"):
        load_job(job, ())


def test_rules_of_another_job_are_left_to_its_command(tmp_path):
    """A load map that is not finished hinders no other command, but a value out of its range does."""
    job = tmp_path / "job.toml"
    job.write_text("[loadmap]\ntorques_Nm = [10.0]\ntorque_start_Nm = 5.0\n", encoding="utf-8")
    assert load_job(job, ()) == {}
    with pytest.raises(InputError, match=r"loadmap.torque_start_Nm = 5.0: conflicts with torques_Nm"):
        load_job(job, ("loadmap",))
    job.write_text("[loadmap]\ntorques_Nm = 10.0\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"loadmap.torques_Nm = 10.0: must be a list"):
        load_job(job, ())


def test_rules_of_tables_within_tables_are_checked():
    @dataclass(frozen=True)
    class Outer:
        parts: tuple[Table, ...] = quantity((), doc="parts")
        one: dict[str, Table] = quantity(dict, doc="by name")  # noqa: RUF009

    broken = {"count": 3, "limit": 2.0}
    with pytest.raises(InputError, match=r"outer.parts\[1\].limit = 2.0: is below count"):
        build(Outer, {"parts": [{"count": 1}, broken]}, "outer")
    with pytest.raises(InputError, match=r"outer.one.a.limit = 2.0: is below count"):
        build(Outer, {"one": {"a": broken}}, "outer")


@pytest.mark.parametrize("text", ["time_s;torque_Nm\r\n0;1,5\r\n1;2\r\n", "\ufefftime_s\ttorque_Nm\n0\t1.5\n"])
def test_tables_of_other_countries_are_told(tmp_path, text):
    path = tmp_path / "table.csv"
    path.write_text(text, encoding="utf-8", newline="")
    for read in (lambda: read_csv(path, "table"), lambda: read_numbers(path, "table", ["time_s"])):
        with pytest.raises(InputError, match=r"other marks than commas.*write commas between cells"):
            read()


def test_errors_survive_another_process():
    error = InputError("pair.teeth", 4, "must be >= 5", "use more teeth")
    assert str(pickle.loads(pickle.dumps(error))) == str(error) == "pair.teeth = 4: must be >= 5; use more teeth"


def test_gears_load_no_finite_element_or_plotting_library():
    code = (
        "import sys, gearfe.gears.geometry.pair, gearfe.gears.geometry.derived, gearfe.base.tables.pair\n"
        "bad = {'scipy', 'skfem', 'gmsh', 'meshio', 'matplotlib', 'pyvista', 'h5py'} & set(sys.modules)\n"
        "assert not bad, bad\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


@pytest.mark.parametrize("key", ["youngs_modulus_GPa", "density_kg_per_m3"])
@pytest.mark.parametrize("number", [10**400, -(10**400)])
def test_materials_with_whole_numbers_beyond_floats_are_refused(key, number):
    """Keys whose cure tries other units: a whole number of 400 digits is no float."""
    with pytest.raises(InputError, match=f"t.{key} = .*must be finite"):
        build(MaterialTable, {key: number}, "t")
