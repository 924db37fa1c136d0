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


def sentences(page: Path) -> list[str]:
    """Sentences of the paragraphs and list items of a page, without code, equations, tables and headings."""
    text = re.sub(r"^(```|\$\$).*?^\1$", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    text = re.sub(r"^ *(?:[-*]|\d+\.) ", "\n", text, flags=re.MULTILINE)
    found: list[str] = []
    for paragraph in re.split(r"\n\s*\n", text):
        lines = [line.strip() for line in paragraph.splitlines() if line[:1] not in "|#<!:"]
        plain = re.sub(r"`[^`]*`", "Code", " ".join(lines))
        plain = re.sub(r"\$[^$]*\$", "x", re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", plain))
        found += re.split(r"(?<=[.!?]) +(?=[A-Z0-9*(])", plain)
    return [sentence for sentence in found if len(sentence.split()) > 1]
