"""What the pages of the documentation show."""

from __future__ import annotations

import re
from pathlib import Path

BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)


def blocks(page: Path, kind: str) -> list[str]:
    return [text for name, text in BLOCK.findall(page.read_text(encoding="utf-8")) if name == kind]


def command_lines(page: Path) -> list[str]:
    text = page.read_text(encoding="utf-8")
    shown = [line for block in blocks(page, "") for line in block.splitlines()]
    quoted = re.findall(r"`(gearfe \w[^`]*)`", text)
    lines = [line.partition(" #")[0].strip().removeprefix(".venv/bin/") for line in [*shown, *quoted]]
    return [
        line for line in lines if line.startswith("gearfe ") and len(line.split()) > 2 and not set("$[") & set(line)
    ]
