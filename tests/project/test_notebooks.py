"""The example notebooks run from top to bottom, from the root of a copy of the repository."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from scripts.build.site_notebooks import outputs, page
from tests.places import DOCS, ROOT

NOTEBOOKS = sorted((DOCS / "notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_runs(path: Path, tmp_path: Path) -> None:
    """In a process of its own, as a notebook has; its page has what the cells show, without names of folders."""
    for folder in ("geometry", "meshes"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    notebook = json.loads(path.read_text(encoding="utf-8"))
    assert notebook["nbformat"] == 4
    assert all(cell.get("outputs", []) == [] for cell in notebook["cells"]), "outputs are left out of the repository"
    shown = outputs(path, tmp_path, root=tmp_path)
    kinds = [kind for cell in shown for kind, _ in cell]
    assert kinds.count("png") >= 3
    assert len(kinds) > kinds.count("png")
    text = page(path, shown)
    assert text.count("![output of the cell]") == kinds.count("png")
    assert str(tmp_path) not in text
    assert str(ROOT) not in text


def test_an_error_of_a_cell_ends_the_build(tmp_path: Path) -> None:
    cells = [{"cell_type": "code", "source": ["1 / 0"]}]
    (tmp_path / "wrong.ipynb").write_text(json.dumps({"cells": cells}), encoding="utf-8")
    with pytest.raises(RuntimeError, match=r"(?s)wrong\.ipynb.*ZeroDivisionError"):
        outputs(tmp_path / "wrong.ipynb", tmp_path)


def test_a_cell_without_code_shows_nothing(tmp_path: Path) -> None:
    cells = [{"cell_type": "code", "source": source} for source in ([], ["# a remark"], ["1 + 1"])]
    (tmp_path / "sparse.ipynb").write_text(json.dumps({"cells": cells}), encoding="utf-8")
    assert outputs(tmp_path / "sparse.ipynb", tmp_path, root=tmp_path) == [[], [], [("text", "2")]]


def test_there_are_two() -> None:
    assert len(NOTEBOOKS) >= 2
