"""Folders of the repository that tests read."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
GEOMETRY = ROOT / "geometry"
MESHES = ROOT / "meshes"
DOCS = ROOT / "docs"
DATA = ROOT / "tests" / "data"
EXAMPLES = ROOT / "scripts" / "examples"
KEPT = ROOT / "tests" / "campaigns" / "kept"
