"""The example notebooks run from top to bottom, from the root of a copy of the repository."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.places import DOCS, ROOT

NOTEBOOKS = sorted((DOCS / "notebooks").glob("*.ipynb"))


#: Runs the code cells of a notebook and prints the types of what it shows.
RUN = """
import ast, json, sys
names, shown = {}, []
for number, cell in enumerate(json.load(open(sys.argv[1], encoding="utf-8"))["cells"]):
    if cell["cell_type"] != "code":
        continue
    tree = ast.parse("".join(cell["source"]))
    last = ast.Expression(tree.body.pop().value) if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, f"cell {number}", "exec"), names)
    if last is not None:  # what the notebook shows
        value = eval(compile(last, f"cell {number}", "eval"), names)
        if value is not None:
            shown.append(type(value).__name__)
print(json.dumps(shown))
"""


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_runs(path: Path, tmp_path: Path) -> None:
    """In a process of its own, as a notebook has."""
    for folder in ("geometry", "meshes"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    notebook = json.loads(path.read_text(encoding="utf-8"))
    assert notebook["nbformat"] == 4
    assert all(cell.get("outputs", []) == [] for cell in notebook["cells"]), "outputs are left out of the repository"
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "MPLBACKEND": "agg"}
    done = subprocess.run(
        [sys.executable, "-c", RUN, str(path)],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    shown = json.loads(done.stdout.splitlines()[-1])
    assert shown.count("Figure") >= 3
    assert len(shown) > shown.count("Figure")


def test_there_are_two() -> None:
    assert len(NOTEBOOKS) >= 2
