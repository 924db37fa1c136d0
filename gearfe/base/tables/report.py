"""Table ``[report]``: what stands at the head of a report."""

from __future__ import annotations

from dataclasses import dataclass

from ..config import quantity


@dataclass(frozen=True)
class ReportTable:
    """Heading of a report."""

    title: str = quantity("", doc="title; left out: command and job file")
    author: str = quantity("", doc="author")
    remark: str = quantity("", doc="remark under the heading")
    date: str = quantity("", doc="date under the heading; left out: that of the results")
