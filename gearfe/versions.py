"""Versions of the program and of what decides its numbers."""

from __future__ import annotations

import functools
import platform
from importlib import metadata

from . import __version__

#: Packages whose versions decide the numbers.
PACKAGES = ("numpy", "scipy", "gmsh")


def versions(packages: tuple[str, ...] = PACKAGES) -> dict[str, str]:
    """Versions of this program, of Python and of packages, by default those that decide the numbers."""
    found = {"gearfe": __version__, "python": platform.python_version()}
    return found | {name: _version(name) for name in packages}


@functools.cache  # looks through all packages
def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "absent"
