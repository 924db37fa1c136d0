#!/usr/bin/env python3
"""Ratings next to published ones: each printed value, the value found and their difference.

    python scripts/benchmarks/measure_rating.py

Prints the table of docs/development/verification.md, in Markdown.
"""

from __future__ import annotations

from typing import Any

from gearfe import rate
from tests.makers import rated

#: Title, gears, table and printed values of each published rating.
CASES: tuple[tuple[str, Any, dict[str, Any], dict[str, str]], ...] = (
    ("spur stage", rated.spur_stage, rated.SPUR, rated.SPUR_PRINTED),
    ("helical stage", rated.helical_stage, rated.HELICAL, rated.HELICAL_PRINTED | rated.HELICAL_LOOSE),
    (
        "helical stage, scuffing",
        rated.helical_stage,
        rated.HELICAL | rated.HELICAL_OIL,
        rated.HELICAL_SCUFFING | rated.HELICAL_SCUFFING_LOOSE,
    ),
    (
        "helical stage, R_a1 R_a2 and B_M 13.795",
        rated.helical_stage,
        rated.helical_flash(),
        rated.HELICAL_FLASH_PRINTED,
    ),
    ("planet and ring", rated.spur_ring, rated.SPUR_RING, rated.SPUR_RING_PRINTED),
    ("planet and ring, first stage", rated.first_ring, rated.FIRST_RING, rated.FIRST_RING_PRINTED),
    ("FZG C14", rated.fzg_c14, rated.FZG_C14, rated.FZG_C14_PRINTED | rated.FZG_C14_LOOSE),
    ("FZG C40", rated.fzg_c40, rated.FZG_C40, rated.FZG_C40_PRINTED | rated.FZG_C40_LOOSE),
    ("polymer pair", rated.polymer_pair, rated.POLYMER, rated.POLYMER_PRINTED),
    ("example 1", rated.example_1, rated.EXAMPLE_1, rated.EXAMPLE_PRINTED),
)


def rows() -> list[str]:
    """Rows of the table: case, value, printed, found, difference in units of the last printed digit."""
    made = []
    for title, gears, table, printed in CASES:
        values = {entry.name: entry.value for entry in rate(gears(), table).entries()}
        for name, text in printed.items():
            value = values[name] if isinstance(values[name], tuple) else (values[name],)
            words = text.split()
            digits = [len(word.partition(".")[2]) for word in words]
            found = " / ".join(f"{v:.{d + 1}f}" for v, d in zip(value, digits, strict=True))
            off = [(v - float(w)) * 10**d for v, w, d in zip(value, words, digits, strict=True)]
            units = " / ".join(f"{o:+.1f}" for o in off)
            made.append(f"| {title} | {name} | {' / '.join(words)} | {found} | {units} |")
    return made


if __name__ == "__main__":
    print("| rating | value | printed | computed | difference (last digit) |")
    print("|---|---|---|---|---|")
    print("\n".join(rows()))
