"""The reference page of keys says what the tables say, and names every key."""

from __future__ import annotations

import dataclasses
import runpy

import pytest

from gearfe.base.tables.jobs import TABLES, table_class
from tests.places import DOCS, ROOT

PAGE = DOCS / "keys.md"


def test_the_page_is_that_of_the_tables() -> None:
    made = runpy.run_path(str(ROOT / "scripts/build/write_keys.py"))["reference_page"]()
    assert PAGE.read_text(encoding="utf-8") == made, "run python scripts/build/write_keys.py"


@pytest.mark.parametrize("name", list(TABLES))
def test_every_key_has_a_row_or_a_section(name: str) -> None:
    text = PAGE.read_text(encoding="utf-8")
    begin = text.index(f"## `[{name}]`")
    section = text[begin : text.find("\n## ", begin)]
    for field in dataclasses.fields(table_class(name)):
        assert f"`{field.name}`" in section or f"[{name}.{field.name}" in section
