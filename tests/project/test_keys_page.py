"""The reference page of keys says what the tables say, and names every key."""

from __future__ import annotations

import dataclasses
import re
import runpy

import pytest

from gearfe.base.tables.jobs import NAMED, TABLES, table_class
from gearfe.base.tables.pair import GearBodyTable, ToothFormTable
from gearfe.base.tables.train import TrainMeshTable
from tests.places import DOCS, ROOT

PAGE = DOCS / "keys.md"


def test_the_page_is_that_of_the_tables() -> None:
    made = runpy.run_path(str(ROOT / "scripts/build/write_keys.py"))["reference_page"]()
    assert PAGE.read_text(encoding="utf-8") == made, "run python scripts/build/write_keys.py"


def section(name: str) -> str:
    """Section of a table, with those whose keys it has, too."""
    text = PAGE.read_text(encoding="utf-8")
    begin = re.search(rf"^###? `?\[*{re.escape(name)}\]*`?$", text, re.MULTILINE)
    assert begin is not None, name
    depth = text[begin.start() :].index(" ")
    found = re.compile(rf"^#{{2,{depth}}} ", re.MULTILINE).search(text, begin.end())
    own = text[begin.start() : None if found is None else found.start()]
    return own + "".join(map(section, shared(own)))


def shared(text: str) -> list[str]:
    """Names of tables whose keys a section has, too."""
    return [one or other for one, other in re.findall(r"All keys of (?:\[(.*?)\]\(|`\[(.*?)\]`)", text)]


@pytest.mark.parametrize("name", [*TABLES, *(f"{kind}.NAME" for kind in NAMED)])
def test_every_key_has_a_row_or_a_section(name: str) -> None:
    text, table = section(name), table_class(name.partition(".")[0])
    page, owners = PAGE.read_text(encoding="utf-8"), (name, *shared(text))
    for field in dataclasses.fields(table):
        below = any(f"[{owner}.{field.name}" in page for owner in owners)
        assert f"`{field.name}`" in text or below, field.name


def test_keys_that_tables_share_stand_once() -> None:
    """The keys of a tooth form stood in [pair] and in [pair.pinion]."""
    text = PAGE.read_text(encoding="utf-8")
    for table in (ToothFormTable, GearBodyTable, TrainMeshTable):
        keys = {field.name: field.metadata["doc"] for field in dataclasses.fields(table)}
        assert {key: text.count(f"| {doc} |") for key, doc in keys.items()} == dict.fromkeys(keys, 1)
