"""Files that tests write, read and damage."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np


def mechanism_file(folder: Path, text: str) -> Path:
    path = folder / "mechanism.toml"
    path.write_text(text, encoding="utf-8")
    return path


def job_file(folder: Path, text: str) -> Path:
    path = folder / "job.toml"
    path.write_text(text, encoding="utf-8")
    return path


def csv_rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def damaged(content: bytes, rng: np.random.Generator) -> bytes:
    """One random fault: cut short, bytes changed or lost, a line lost or doubled, a word replaced."""
    kind = rng.integers(5)
    if kind == 0:
        return content[: rng.integers(len(content))]
    if kind == 1:
        changed = bytearray(content)
        for place in rng.integers(len(content), size=rng.integers(1, 6)):
            changed[place] = rng.integers(256)
        return bytes(changed)
    if kind == 2:
        start = int(rng.integers(len(content)))
        return content[:start] + content[start + int(rng.integers(1, 64)) :]
    lines = content.split(b"\n")
    at = int(rng.integers(len(lines)))
    if kind == 3:
        lines[at : at + 1] = [[], [lines[at]] * 2][rng.integers(2)]
        return b"\n".join(lines)
    words = [b"-1", b"0", b"999999", b"99999999999999999999", b"nan", b"inf", b"1e400", b"x", b""]
    cells = lines[at].split(b"," if b"," in lines[at] else b" ")
    cells[rng.integers(len(cells))] = words[rng.integers(len(words))]
    lines[at] = (b"," if b"," in lines[at] else b" ").join(cells)
    return b"\n".join(lines)
