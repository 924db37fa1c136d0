"""The constants whose sensitivity the verification page lists exist, with the values that it prints."""

from __future__ import annotations

import importlib
import re

import pytest

from scripts.benchmarks.measure_constants import CONSTANTS
from scripts.benchmarks.measure_package_constants import PARTS, sources
from tests.places import DOCS

PAGE = DOCS / "development/verification.md"
#: Rows "| `module.NAME`, `OTHER`; `module.NAME` | values | ..." of the page's tables of constants.
ROWS = [cells for line in PAGE.read_text(encoding="utf-8").splitlines() if re.search(r"^\| `[a-z_.]+\.[A-Z_]+`", line)
        if (cells := line.strip("| ").split(" | "))]  # fmt: skip


def named(cell: str) -> list[tuple[str, str]]:
    """(module, constant) of a row's first cell; a module stands for the constants after it, too."""
    pairs, module = [], ""
    for name in re.findall(r"`([^`]+)`", cell):
        path, _, constant = name.rpartition(".")
        if path:
            module = path if "." in path or not module else f"{module.rpartition('.')[0]}.{path}"
        pairs.append((module, constant))
    return pairs


def test_the_page_has_its_tables() -> None:
    assert len(ROWS) > 20


@pytest.mark.parametrize("cells", ROWS, ids=[cells[0].replace("`", "") for cells in ROWS])
def test_constants_have_the_printed_values(cells: list[str]) -> None:
    printed = [float(number) for number in re.findall(r"[\d.]+(?:e-?\d+)?", cells[1])]
    found = [getattr(importlib.import_module(f"gearfe.{module}"), name) for module, name in named(cells[0])]
    assert printed == pytest.approx(found, rel=1e-12)


@pytest.mark.parametrize(("module", "name"), [(module, name) for module, names in CONSTANTS.items() for name in names])
def test_measured_constants_exist(module: str, name: str) -> None:
    assert hasattr(importlib.import_module(f"gearfe.{module}"), name)


@pytest.mark.parametrize("part", PARTS)
def test_measured_packages_exist(part: str) -> None:
    assert all(path.is_file() for path in sources(part))
