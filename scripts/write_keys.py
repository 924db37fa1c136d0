#!/usr/bin/env python3
"""Write docs/keys.md, the reference page of all keys of the job files, from the tables' own descriptions."""

from __future__ import annotations

from pathlib import Path

from gearfe.tables.reference import reference_page

PAGE = Path(__file__).resolve().parents[1] / "docs" / "keys.md"

if __name__ == "__main__":
    PAGE.write_text(reference_page(), encoding="utf-8")
    print(f"written: {PAGE}")
