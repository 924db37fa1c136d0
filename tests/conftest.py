"""Meshes that tests make are kept in the repository's (ignored) mesh cache."""

import os
from pathlib import Path

os.environ.setdefault("GEARFE_CACHE", str(Path(__file__).parents[1] / "meshes" / "cache"))
