"""The pages' promises: Python blocks run, tables are TOML, command lines are understood, the reference is complete."""

from __future__ import annotations

import importlib
import os
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

import gearfe
from gearfe import Material, build_train
from gearfe.base.errors import InputError
from gearfe.cli import COMMANDS
from gearfe.cli.arguments import command_module, parser_of
from tests.makers import gears, trains
from tests.makers.pages import blocks, command_lines
from tests.places import DOCS, GEOMETRY, ROOT

PAGES = sorted([*DOCS.rglob("*.md"), ROOT / "README.md"])
#: Pages whose Python runs, block by block.
RUN = (
    "beams.md",
    "bearings.md",
    "campbell.md",
    "check.md",
    "compare.md",
    "exchange.md",
    "face_width.md",
    "fields.md",
    "housing.md",
    "housing_mesh.md",
    "howto.md",
    "loadmap.md",
)
RUN += (
    "mesh_law.md",
    "mechanisms_python.md",
    "microgeometry.md",
    "published.md",
    "rating.md",
    "rexs.md",
    "runup.md",
    "shafts.md",
)
RUN += ("start.md",)
#: What pages and the jobs that they name do in a minute: fewer cases, rounds and positions here.
SHORTER = {
    "cases = 128": "cases = 8",
    "positions = 12": "positions = 4",
    "range(10)": "range(2)",
    "range(8)": "range(2)",
    "jobs=2": "jobs=1",
}
PLACES = {"angles": np.zeros(3), "approaches": np.full(3, 1e-5)}


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


def known() -> dict[str, object]:
    """What pages take as known: the README's pair, a train."""
    steel = Material(200e9, 0.3)
    return {"pair": gears.pair(), "steel": steel, "model": build_train(trains.train([(20, 30)])), **PLACES}


@pytest.mark.parametrize("page", RUN)
def test_python_runs(page: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for folder in ("geometry", "meshes"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    monkeypatch.chdir(tmp_path)
    names = known()
    (tmp_path / "rod.toml").write_text(blocks(DOCS / "mechanisms.md", "toml")[0], encoding="utf-8")
    for text in blocks(DOCS / page, "python"):
        exec(compile(text, page, "exec"), names)
    if page == "mechanisms_python.md":  # a load that is written and one that is called
        np.testing.assert_allclose(names["written"].q, names["called"].q, atol=1e-8)


def shorter(text: str) -> str:
    for long, short in SHORTER.items():
        text = text.replace(long, short)
    return text


def test_python_of_studies_runs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """All blocks except the search: `test_study_search` runs that one and holds its result against a grid."""
    pytest.importorskip("optuna")
    pytest.importorskip("xarray")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "geometry").mkdir()
    for name in ("relief_study.toml", "relief_search.toml"):
        text = (GEOMETRY / name).read_text(encoding="utf-8")
        (tmp_path / "geometry" / name).write_text(shorter(text), encoding="utf-8")
    names = known()
    code = [text for text in blocks(DOCS / "study.md", "python") if "evolve" not in text]
    assert set(SHORTER) == {long for long in SHORTER if long in "".join(code) + "cases = 128 positions = 12"}
    for text in code:
        exec(compile(shorter(text), "study.md", "exec"), names)


def test_no_page_is_left_out() -> None:
    """README.md and clusters.md have tests of their own."""
    assert {page.name for page in PAGES if blocks(page, "python")} == {*RUN, "study.md", "clusters.md", "README.md"}


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_python_imports_what_there_is(page: Path) -> None:
    """All blocks are Python, and what they import of this package is there."""
    for text in blocks(page, "python"):
        compile(text, str(page), "exec")
        for line in re.findall(r"^from gearfe[\w.]* import [\w, ]+$", text, re.MULTILINE):
            exec(line)


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_tables_are_toml(page: Path) -> None:
    for text in blocks(page, "toml"):
        tomllib.loads(text)


def test_commands_are_understood() -> None:
    """Their options are known, and the shipped jobs that they name exist."""
    seen = 0
    for page in PAGES:
        for line in command_lines(page):
            _, command, *rest = shlex.split(line)
            parser = parser_of(command_module(command), f"gearfe {command}", *COMMANDS[command])
            try:
                parsed = parser.parse_args(rest)
            except InputError as error:
                if "required" not in str(error):  # a line that shows one option of a command
                    raise AssertionError(f"{page.name}: {line}: {error}") from error
                continue
            seen += 1
            for value in vars(parsed).values():
                if isinstance(value, str) and value.startswith(("geometry/", "meshes/")):
                    assert (ROOT / value).exists(), line
    assert seen > 20


def test_every_file_of_paraview_has_a_line_of_pyvista() -> None:
    """Files that the program or a page names by a text; `waves` is that of an example in a docstring."""
    sources = [*(ROOT / "gearfe").rglob("*.py"), *DOCS.glob("*.md")]
    text = "\n".join(path.read_text(encoding="utf-8") for path in sources)
    named = set(re.findall(r"[\"`](\w+)\.vtkhdf[\"`]", text)) - {"waves"}
    rows = [line for line in (DOCS / "exchange.md").read_text(encoding="utf-8").splitlines() if "pv.read(" in line]
    told = {name for row in rows for name in re.findall(r"`(\w+)\.vtkhdf`", row.split("|")[1])}
    assert {"stiffness_flank", "loadmap_flank"} <= told  # whose names the program puts together
    assert named <= told


def test_the_reference_has_every_public_name() -> None:
    page = (DOCS / "api.md").read_text(encoding="utf-8")
    told = re.findall(r"^::: ([\w.]+)$", page, re.MULTILINE)
    assert {f"gearfe.{name}" for name in gearfe.__all__ if not name.startswith("__")} <= set(told)
    for name in told:
        module, _, last = name.rpartition(".")
        assert getattr(importlib.import_module(module), last).__doc__, name


def test_types_of_public_names_are_those_of_their_modules() -> None:
    """What a type checker is told is what loads."""
    text = (ROOT / "gearfe" / "__init__.py").read_text(encoding="utf-8").partition("\n__all__")[0]
    named = set()
    for module, names in re.findall(r"^    from \.([\w.]+) import ([\w, ]+)$", text, re.MULTILINE):
        for name in names.split(","):
            found = getattr(importlib.import_module(f"gearfe.{module}"), name.strip())
            assert found is getattr(gearfe, name.strip()), name
            named.add(name.strip())
    assert named == set(gearfe._PUBLIC)
    assert sorted(gearfe.__all__) == sorted(["__version__", *gearfe._PUBLIC])


def test_the_site_builds(tmp_path: Path) -> None:
    """Strictly: a dead link, a missing page or anchor, a name that the reference cannot find ends it."""
    pytest.importorskip("mkdocs", reason="pip install 'gearfe[docs]'")
    line = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--site-dir", str(tmp_path)]
    environment = {**os.environ, "SITE_NOTEBOOKS": "off"}  # tests/project/test_notebooks.py runs them
    done = subprocess.run(line, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "sweep_stiffness" in (tmp_path / "notebooks" / "gear_pair.html").read_text(encoding="utf-8")
    assert 'href="notebooks/gearbox.html"' in (tmp_path / "howto.html").read_text(encoding="utf-8")
    page = (tmp_path / "api.html").read_text(encoding="utf-8")
    assert 'id="gearfe.GearPair"' in page
    assert "centre_distance" in page
    pages = [(path, path.read_text(encoding="utf-8")) for path in tmp_path.rglob("*.html")]
    fetched = r"<(?:script|link|img)[^>]*(?:src|href)=\"?https?://"
    assert not [path.name for path, text in pages if re.search(fetched, text)]  # it opens offline
    for name, least in (("theory", 20), ("mesh_law", 6)):  # equations are MathML, none is left as LaTeX
        text = (tmp_path / f"{name}.html").read_text(encoding="utf-8")
        assert text.count("<math") >= least
        assert not re.findall(r"arithmatex|\\(?:frac|qquad|sum|partial)\b", text)
