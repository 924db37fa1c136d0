"""The record of a campaign: one line of JSON a case, written as it ends, so that a run can be taken up again."""

from __future__ import annotations

import json
from pathlib import Path

from gearfe import __version__
from gearfe.base.errors import InputError

from .outcome import Outcome


class CampaignRecord:
    """Outcomes of one campaign in a folder.

    The first line says which campaign and seed it is. A last line that was cut short by a killed process is dropped.
    """

    def __init__(self, folder: Path, name: str, seed: int) -> None:
        self.path = folder / f"{name}.jsonl"
        self.rows: dict[int, Outcome] = {}
        head = {"campaign": name, "seed": seed, "version": __version__}
        if self.path.exists():
            self._read(head)
        else:
            self._write(json.dumps(head))

    def _read(self, head: dict[str, object]) -> None:
        text = self.path.read_text(encoding="utf-8")
        whole = text[: text.rfind("\n") + 1]
        if whole != text:
            self.path.write_text(whole, encoding="utf-8")
        lines = whole.splitlines()
        found = json.loads(lines[0]) if lines else head
        for key in ("campaign", "seed", "version"):
            if found.get(key) != head[key]:
                problem = f"holds a campaign with {key} {found.get(key)!r}, not {head[key]!r}"
                raise InputError("--out", str(self.path.parent), problem, "choose another folder, or remove this one")
        if not lines:
            self._write(json.dumps(head))
        for line in lines[1:]:
            row = Outcome.from_plain(json.loads(line))
            self.rows[row.case] = row

    def add(self, row: Outcome) -> None:
        """Append a row."""
        self.rows[row.case] = row
        self._write(json.dumps(row.plain()))

    def _write(self, line: str) -> None:
        with self.path.open("a", encoding="utf-8") as stream:
            stream.write(line + "\n")

    @property
    def outcomes(self) -> list[Outcome]:
        """Rows in the order of their cases."""
        return [self.rows[k] for k in sorted(self.rows)]
