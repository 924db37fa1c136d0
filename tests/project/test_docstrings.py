"""Public functions with four or more parameters name every one of them in a numpy-style Parameters section."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.places import ROOT

PACKAGE = ROOT / "gearfe"
#: Functions with fewer parameters may describe them in a sentence.
MANY = 4
FILES = sorted(PACKAGE.rglob("*.py"))


def public_functions(body: list[ast.stmt], owner: str = "") -> Iterator[tuple[str, ast.FunctionDef]]:
    """Functions and methods of public classes, with their dotted names."""
    for item in body:
        if isinstance(item, ast.ClassDef) and not item.name.startswith("_"):
            yield from public_functions(item.body, f"{item.name}.")
        elif isinstance(item, ast.FunctionDef) and not item.name.startswith("_"):
            yield owner + item.name, item


def parameters(function: ast.FunctionDef) -> list[str]:
    """Names of all parameters, without the object or class of a method."""
    given = function.args
    extra = [argument for argument in (given.vararg, given.kwarg) if argument is not None]
    names = [argument.arg for argument in (*given.posonlyargs, *given.args, *given.kwonlyargs, *extra)]
    return [name for name in names if name not in ("self", "cls")]


def described(docstring: str) -> list[str]:
    """Names in the Parameters section of a docstring; none without the section."""
    sections = re.split(r"^([A-Z][A-Za-z ]+)\n-{3,}\n", inspect.cleandoc(docstring), flags=re.MULTILINE)
    text = dict(zip(sections[1::2], sections[2::2], strict=True)).get("Parameters", "")
    heads = (line.partition(" : ")[0] for line in text.splitlines() if line and not line.startswith(" "))
    return [name.strip().lstrip("*") for head in heads for name in head.split(",")]


def missing(file: Path) -> dict[str, list[str]]:
    """Function -> parameters that its docstring does not describe."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    found = {}
    for name, function in public_functions(tree.body):
        names = parameters(function)
        known = described(ast.get_docstring(function) or "")
        absent = [parameter for parameter in names if parameter not in known]
        if len(names) >= MANY and absent:
            found[name] = absent
    return found


@pytest.mark.parametrize("file", FILES, ids=[file.relative_to(PACKAGE).as_posix() for file in FILES])
def test_sections_name_every_parameter(file: Path) -> None:
    assert missing(file) == {}


def test_the_package_is_found() -> None:
    assert {"base", "cli", "fem", "gears", "multibody"} < {file.relative_to(PACKAGE).parts[0] for file in FILES}


@pytest.mark.parametrize(
    ("docstring", "names"),
    [
        ("Do it.", []),
        ("Do it.\n\nParameters\n----------\na, b : float\n    Sizes (m).\nc\n    Name.\n\nReturns\n-------\nd : int",
         ["a", "b", "c"]),
        ("Do it.\n\nReturns\n-------\na : float", []),
    ],
)  # fmt: skip
def test_sections_are_read(docstring: str, names: list[str]) -> None:
    assert described(docstring) == names


def test_a_parameter_without_description_is_found(tmp_path: Path) -> None:
    head = (
        "def f(a, b, *, c, d):\n    '''Do it.\n\n    Parameters\n    ----------\n    a, b : float\n        Sizes (m).\n"
    )
    file = tmp_path / "module.py"
    file.write_text(f"{head}    d : int\n        Number.\n    '''\n")
    assert missing(file) == {"f": ["c"]}
