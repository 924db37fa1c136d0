"""The documents' promises: the example of the README runs, the page on stiffness names every column and option."""

import argparse
import re
import runpy

import numpy as np
import pytest

from gearfe.cli import stiffness
from gearfe.gears.gearmesh.curve import COLUMNS
from tests.places import DOCS, ROOT

README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGE = (DOCS / "stiffness.md").read_text(encoding="utf-8")


def test_the_example_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    example = re.search(r"```python\n(.*?)```", README, re.S).group(1)
    names = {}
    exec(compile(example, "README.md", "exec"), names)
    assert 0.9e8 < names["k"] < 1.3e8
    np.testing.assert_allclose(names["same"].k_mesh, names["curve"].k_mesh, rtol=1e-14)


def test_every_column_is_there():
    for column in COLUMNS.values():
        assert f"`{column.name}`" in PAGE, column.name


def test_every_option_is_there():
    parser = argparse.ArgumentParser()
    stiffness.add_arguments(parser)
    for action in parser._actions:
        for option in action.option_strings:
            if option.startswith("--") and option != "--help" and action.help != argparse.SUPPRESS:
                assert option in PAGE, option


def test_scripts_pages_and_pictures_exist():
    for name in re.findall(r"(?:bash |\]\()((?:scripts|docs)/[\w./]+)", README):
        assert (ROOT / name).exists(), name
    for page in DOCS.rglob("*.md"):
        for name in re.findall(r"\]\(([\w./]+\.(?:md|png))", page.read_text(encoding="utf-8")):
            assert (page.parent / name).exists(), (page.name, name)


def test_an_index_of_packages_finds_links_and_pictures(monkeypatch):
    pytest.importorskip("hatchling", reason="pip install 'gearfe[dev]'")
    hook = runpy.run_path(str(ROOT / "scripts/build" / "package_metadata.py"))["Addresses"](str(ROOT), {})
    metadata = {}
    monkeypatch.delenv("GEARFE_URL", raising=False)
    hook.update(metadata)
    assert metadata == {"readme": {"content-type": "text/markdown", "text": README}}
    monkeypatch.setenv("GEARFE_URL", "https://example.org/gearfe/")
    hook.update(metadata)
    assert metadata["urls"]["Source"] == "https://example.org/gearfe"
    text = metadata["readme"]["text"]
    links = re.findall(r"\]\(([^)]*)\)", text)
    assert "https://example.org/gearfe/raw/HEAD/docs/stiffness.png" in links
    for link in links:
        kind, _, name = link.removeprefix("https://example.org/gearfe/").partition("/HEAD/")
        assert kind == ("raw" if name.endswith(".png") else "blob"), link
        assert (ROOT / name.partition("#")[0]).is_file(), link
    assert re.sub(r"https://example.org/gearfe/(raw|blob)/HEAD/", "", text) == README
