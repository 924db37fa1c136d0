"""Meshes that tests make are kept in an ignored folder of the repository."""

import os
from pathlib import Path

os.environ.setdefault("GEARFE_CACHE", str(Path(__file__).parents[1] / ".test_cache"))
