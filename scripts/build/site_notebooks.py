"""Notebooks as pages of the documentation site, with what their cells print and show.

`mkdocs.yml` names this file as a hook. Each build runs the notebooks from the root of the repository, so outputs are
those of the sources. ``SITE_NOTEBOOKS=off`` leaves the cells without outputs.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
#: Runs the code cells of a notebook; prints for each a list of [kind, content]: "text", "html", or "png", a file.
RUN = """
import ast, contextlib, io, json, sys
names, cells, folder = {"__name__": "__main__"}, [], sys.argv[2]
for number, cell in enumerate(json.load(open(sys.argv[1], encoding="utf-8"))["cells"]):
    outputs = []
    if cell["cell_type"] == "code":
        tree = ast.parse("".join(cell["source"]))
        last = ast.Expression(tree.body.pop().value) if tree.body and isinstance(tree.body[-1], ast.Expr) else None
        printed, value = io.StringIO(), None
        with contextlib.redirect_stdout(printed):
            exec(compile(tree, f"cell {number}", "exec"), names)
            if last is not None:
                value = eval(compile(last, f"cell {number}", "eval"), names)
        if printed.getvalue():
            outputs.append(["text", printed.getvalue()])
        if hasattr(value, "savefig"):
            value.savefig(f"{folder}/{number}.png", dpi=110, bbox_inches="tight")
            outputs.append(["png", f"{number}.png"])
        elif hasattr(value, "_repr_html_"):
            outputs.append(["html", value._repr_html_()])
        elif value is not None:
            outputs.append(["text", repr(value)])
    cells.append(outputs)
print(json.dumps(cells))
"""


def outputs(notebook: Path, folder: Path, *, root: Path = ROOT) -> list[list[tuple[str, str]]]:
    """Run a notebook; what each of its cells prints and shows.

    Parameters
    ----------
    notebook : Path
        The notebook, without outputs.
    folder : Path
        Where its pictures are written.
    root : Path
        Working folder of the cells.

    Raises
    ------
    RuntimeError
        If a cell ends in an error; the message has its traceback.
    """
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "MPLBACKEND": "agg"}
    line = [sys.executable, "-c", RUN, str(notebook), str(folder)]
    done = subprocess.run(line, cwd=root, env=environment, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"{notebook.name}: {done.stderr}")
    shown = json.loads(done.stdout.splitlines()[-1].replace(f"{root}{os.sep}", ""))  # no page names a machine's folders
    return [[(kind, content) for kind, content in cell] for cell in shown]


def page(notebook: Path, shown: list[list[tuple[str, str]]]) -> str:
    """Markdown of a notebook with the outputs of its cells; pictures are next to it as NAME_3.png."""
    parts = []
    for cell, made in zip(json.loads(notebook.read_text(encoding="utf-8"))["cells"], shown, strict=True):
        source = "".join(cell["source"])
        parts.append(f"```python\n{source}\n```" if cell["cell_type"] == "code" else source)
        for kind, content in made:
            if kind == "png":
                parts.append(f"![output of the cell]({notebook.stem}_{content})")
            else:
                parts.append(content if kind == "html" else f"```text\n{content.rstrip()}\n```")
    return "\n\n".join([*parts, f"[Download the notebook]({notebook.name})", ""])


def on_files(files: Any, *, config: Any) -> Any:
    """Add a page for each notebook; mkdocs calls it."""
    from mkdocs.structure.files import File

    for file in [file for file in files if file.src_uri.endswith(".ipynb")]:
        notebook, at = Path(file.abs_src_path), file.src_uri.removesuffix(".ipynb")
        with tempfile.TemporaryDirectory() as folder:
            if os.environ.get("SITE_NOTEBOOKS", "") == "off":
                shown: list[list[tuple[str, str]]] = [
                    [] for _ in json.loads(notebook.read_text(encoding="utf-8"))["cells"]
                ]
            else:
                shown = outputs(notebook, Path(folder))
            files.append(File.generated(config, f"{at}.md", content=page(notebook, shown)))
            for picture in Path(folder).glob("*.png"):
                files.append(File.generated(config, f"{at}_{picture.name}", content=picture.read_bytes()))
    return files


def on_page_markdown(markdown: str, *, page: Any, **_: Any) -> str:
    """Lead links to notebooks, which GitHub shows, to their pages; mkdocs calls it."""
    if page.file.src_uri.startswith("notebooks/"):
        return markdown
    return markdown.replace(".ipynb)", ".md)")
