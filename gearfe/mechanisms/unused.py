"""Find keys of a mechanism file without effect. They get remarks, because runs with other options may need them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from ..base.config import fields_of
from ..base.tables.mechanism import FigureTable, MechanismFile, RunTable


def unused(file: MechanismFile) -> list[str]:
    """Return sentences about keys that have no effect in the analysis that the file asks for."""
    analysis, flexible = file.run.analysis, any(body.bends for body in file.bodies.values())
    remarks = []
    if analysis != "modes" and _given(file.run, "modes"):
        remarks.append(f'run.modes = {file.run.modes} has no effect: it belongs to analysis = "modes"')
    if analysis != "transient":
        keys = ("method", "tolerance") if analysis == "inverse" else ("method", "tolerance", "picture_s", "frames")
        remarks += [f"run.{key} has no effect: analysis is {analysis}" for key in keys if _given(file.run, key)]
    elif file.run.picture_s is not None and file.run.picture_s > file.run.end_s:
        remarks.append(f"run.picture_s = {file.run.picture_s:g} is after the end of the run: the picture shows the end")
    if file.figure.reference is None and _given(file.figure, "every"):
        remarks.append("figure.every has no effect: it belongs to a reference")
    if not flexible and _given(file.figure, "magnification"):
        remarks.append("figure.magnification has no effect: no link is flexible")
    texts = [text for key, part in vars(file).items() if key != "title" for text in _texts(part)]
    words = {word for text in texts for word in re.findall(r"\w+", text)}
    remarks += [f"tables.{name} has no effect: nothing names it" for name in file.tables if name not in words]
    return remarks


def _given(table: RunTable | FigureTable, key: str) -> bool:
    """Return whether a key differs from its default."""
    return bool(getattr(table, key) != fields_of(type(table))[key].default)


def _texts(part: Any) -> Iterator[str]:
    """Texts that a part of the file holds: expressions and names, not those that define them."""
    if isinstance(part, str):
        yield part
    elif isinstance(part, dict):
        for key, item in part.items():
            yield from (key,) if isinstance(item, float) else ()  # expressions of [start]
            yield from _texts(item)
    elif isinstance(part, tuple):
        for item in part:
            yield from _texts(item)
    elif hasattr(part, "__dataclass_fields__"):
        for item in vars(part).values():
            yield from _texts(item)
