"""Where things that are computed once stay: meshes, curves, reduced housings, compiled kernels."""

from __future__ import annotations

import os
import sys
from pathlib import Path

#: Environment variable that names the folder; ``off`` keeps nothing.
CACHE_VARIABLE = "GEARFE_CACHE"


def named_folder() -> str:
    """What the user says about the folder: its path, ``off``, or nothing."""
    named = os.environ.get(CACHE_VARIABLE, "").strip()
    return "off" if named.lower() == "off" else named


def cache_folder() -> Path | None:
    """``$GEARFE_CACHE``, else the user's cache folder of this platform; ``None`` when off."""
    named = named_folder()
    if named == "off":
        return None
    if named:
        return Path(named).expanduser()
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "gearfe"
