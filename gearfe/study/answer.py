"""What one case of a study gives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Answer:
    """Tables and summary of a job, as its command writes them.

    Attributes
    ----------
    tables
        Name -> column -> values; the first one is the main table.
    summary
        Content of the job's summary.
    problem
        What did not work though the job has an answer: positions that failed, a run that ended early; else empty.
    """

    tables: Mapping[str, Mapping[str, Any]]
    summary: Mapping[str, Any]
    problem: str = ""

    def names(self) -> dict[str, Any]:
        """Everything that an output may name: columns of the main table, tables, summary."""
        main = next(iter(self.tables.values()), {})
        return {**main, **self.tables, "summary": self.summary}
