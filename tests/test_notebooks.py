"""The example notebooks run from top to bottom, from the root of a copy of the repository."""

from __future__ import annotations

import ast
import json
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_runs(path: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for folder in ("geometry", "meshes"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    monkeypatch.chdir(tmp_path)
    notebook = json.loads(path.read_text(encoding="utf-8"))
    assert notebook["nbformat"] == 4
    names: dict[str, object] = {}
    shown = []
    for number, cell in enumerate(notebook["cells"]):
        assert cell.get("outputs", []) == [], "outputs are left out of the repository"
        if cell["cell_type"] != "code":
            continue
        tree = ast.parse("".join(cell["source"]))
        last = ast.Expression(tree.body.pop().value) if isinstance(tree.body[-1], ast.Expr) else None
        exec(compile(tree, f"{path.name}, cell {number}", "exec"), names)
        if last is not None:  # what the notebook shows
            value = eval(compile(last, f"{path.name}, cell {number}", "eval"), names)
            if value is not None:
                shown.append(type(value).__name__)
    assert shown.count("Figure") >= 3
    assert len(shown) > shown.count("Figure")


def test_there_are_two() -> None:
    assert len(NOTEBOOKS) >= 2
