"""The source archive holds what builds the wheel: `python -m build` makes the wheel of it."""

from __future__ import annotations

import subprocess
import sys
import tarfile
import tomllib
from pathlib import Path

import pytest

from tests.places import ROOT


def test_the_archive_holds_what_builds_the_wheel(tmp_path: Path) -> None:
    """It leaves out files that .gitignore matches, so no pattern of it may match a folder of sources."""
    pytest.importorskip("hatchling", reason="pip install 'gearfe[dev]'")
    line = [sys.executable, "-m", "hatchling", "build", "--target", "sdist", "--directory", str(tmp_path)]
    subprocess.run(line, cwd=ROOT, check=True, capture_output=True)
    with tarfile.open(next(tmp_path.glob("*.tar.gz"))) as archive:
        held = {name.partition("/")[2] for name in archive.getnames()}
    hatch = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["hatch"]
    assert hatch["metadata"]["hooks"]["custom"]["path"] in held
    assert set(hatch["build"]["targets"]["wheel"]["force-include"]) <= held
    for folder in hatch["build"]["targets"]["wheel"]["packages"] + ["scripts"]:
        sources = {str(path.relative_to(ROOT)) for path in (ROOT / folder).rglob("*.py")}
        assert sources <= held
