"""`gearfe cache --compile`: after it no shipped job compiles anything."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.places import GEOMETRY


def gearfe(cache: Path, *arguments: str) -> None:
    environment = {**os.environ, "GEARFE_CACHE": str(cache)}
    subprocess.run([sys.executable, "-m", "gearfe", *arguments], env=environment, check=True, capture_output=True)


def kernels(cache: Path) -> set[Path]:
    return {path.relative_to(cache) for path in cache.glob("kernels-*/*")}


@pytest.mark.slow
def test_nothing_is_compiled_after_it(tmp_path: Path) -> None:
    cache, out = tmp_path / "cache", str(tmp_path / "out")
    gearfe(cache, "cache", "--compile")
    made = kernels(cache)
    assert len(made) >= 4
    short = ("--no-pictures", "--out", out)
    for name in ("andrews", "slider_crank", "elastic_slider_crank", "elastic_coupler"):
        gearfe(cache, "mechanism", str(GEOMETRY / f"{name}.toml"), "--no-estimate", *short)
    for name in ("helical", "planetary"):
        gearfe(cache, "vibration", str(GEOMETRY / f"{name}.toml"), "--set", "train.duration_ms=2", *short)
    rigid = ("--set", "train.housing=rigid", "--set", "train.duration_ms=0.1")
    gearfe(cache, "vibration", str(GEOMETRY / "gear_train.toml"), *rigid, "--no-estimate", "--no-floquet", *short)
    assert kernels(cache) == made
