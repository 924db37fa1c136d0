"""What a user waits for: whole commands in fresh processes, with caches as a user finds them.

Each case runs in a folder of its own with a cache folder of its own; processor seconds and the peak of memory are those
that the system tells of the process. Before a run, the caches are emptied down to what the case says is there. With
another state of the repository to compare with, both run in turns.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from tests.places import GEOMETRY, ROOT

from .record import Record

#: Bytes in the unit of the system's peak of memory.
PEAK_UNIT = 1 if sys.platform == "darwin" else 1024


@dataclass(frozen=True)
class Case:
    """A command; `kept` of the caches is there when it starts: "all", "kernels" or "nothing"."""

    what: str
    arguments: tuple[str, ...]
    kept: str = "all"
    returns: int = 0

    @property
    def command(self) -> tuple[str, ...]:
        """Words after the interpreter."""
        out = () if self.arguments[0] in ("--help", "cache") else ("--out", "out")
        return ("-m", "gearfe.cli.main", *self.arguments, *out)


TRAIN, ANDREWS, SLIDER = (str(GEOMETRY / f"{name}.toml") for name in ("gear_train", "andrews", "slider_crank"))
#: Single mechanisms are over before compiling pays; who runs more of them compiles once.
COMPILE = Case("kernels", ("cache", "--compile"))
CURVE = ("stiffness", TRAIN, "--twist-deg", "0.05")
CASES = (
    Case("gearfe --help", ("--help",)),
    Case("an error in a job file", ("stiffness", TRAIN, "--set", "pair.pinion.teeth=2"), returns=2),
    Case("gearfe stiffness", CURVE),
    Case("gearfe stiffness", CURVE, "nothing"),
    Case("gearfe vibration", ("vibration", TRAIN)),
    Case("gearfe vibration", ("vibration", TRAIN), "kernels"),
    Case("gearfe vibration", ("vibration", TRAIN), "nothing"),
    Case("gearfe mechanism, Andrews", ("mechanism", ANDREWS)),
    Case("gearfe mechanism, Andrews, no pictures", ("mechanism", ANDREWS, "--no-pictures")),
    Case("gearfe mechanism, Andrews, no pictures", ("mechanism", ANDREWS, "--no-pictures"), "nothing"),
    Case("gearfe mechanism, slider crank", ("mechanism", SLIDER)),
)


def run_cold(record: Record) -> None:
    """The table of whole commands, beside another state of the repository where one is asked for."""
    table = record.table("cold", "what", "cached")
    with _trees(record.against) as trees:
        for case in CASES[:2] if record.quick else CASES:
            key = {"what": case.what, "cached": case.kept}
            record.row(table, key, partial(_measured, case, trees, 1 if record.quick else 3))


@contextmanager
def _trees(against: str) -> Iterator[dict[str, Path]]:
    """Folders with the package: this one, and a copy of another commit."""
    if not against:
        yield {"": ROOT}
        return
    with tempfile.TemporaryDirectory() as name:
        other = Path(name) / "before"
        subprocess.run(["git", "-C", str(ROOT), "worktree", "add", "--detach", str(other), against], check=True)
        try:
            yield {"": ROOT, "before_": other}
        finally:
            subprocess.run(["git", "-C", str(ROOT), "worktree", "remove", "--force", str(other)], check=True)


def _measured(case: Case, trees: Mapping[str, Path], runs: int) -> Mapping[str, Any]:
    found: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as name:
        folders = {prefix: Path(name) / (prefix or "now") for prefix in trees}
        for prefix, tree in trees.items():
            folders[prefix].mkdir()
            if case.arguments[0] == "mechanism":
                _run(COMPILE, tree, folders[prefix])
            _run(case, tree, folders[prefix])  # fills the caches, and Python's own of compiled sources
        for _ in range(runs):
            for prefix, tree in trees.items():
                _empty(folders[prefix] / "cache", case.kept)
                seconds, peak = _run(case, tree, folders[prefix])
                found[f"{prefix}cpu_s"] = min(found.get(f"{prefix}cpu_s", seconds), seconds)
                found[f"{prefix}peak_MB"] = max(found.get(f"{prefix}peak_MB", 0.0), peak)
    if "before_cpu_s" in found:
        found["ratio"] = found["cpu_s"] / found["before_cpu_s"]
    return found


def _empty(cache: Path, kept: str) -> None:
    """Leave of the caches what is kept."""
    if kept == "all" or not cache.exists():
        return
    for path in cache.iterdir():
        if kept == "kernels" and path.name.startswith("kernels-"):
            continue
        shutil.rmtree(path) if path.is_dir() else path.unlink()


def _run(case: Case, tree: Path, folder: Path) -> tuple[float, float]:
    """Processor seconds and the peak of memory (MB) of one run.

    Raises
    ------
    RuntimeError
        For a command that ends otherwise than it should.
    """
    own = {"GEARFE_CACHE": str(folder / "cache"), "PYTHONPATH": str(tree), "OMP_NUM_THREADS": "1"}
    own |= {"OPENBLAS_NUM_THREADS": "1", "PYTHONPYCACHEPREFIX": str(folder / "sources")}
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"} | own
    words = [sys.executable, *case.command]
    with (folder / "told").open("wb") as told, (folder / "said").open("wb") as said:
        process = subprocess.Popen(
            words, cwd=folder, env=environment, stdin=subprocess.DEVNULL, stdout=told, stderr=said
        )
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != case.returns:
        last = (folder / "said").read_text(encoding="utf-8", errors="replace").strip().splitlines()[-1:]
        raise RuntimeError(f"{' '.join(words)} ended with {process.returncode}: {' '.join(last)}")
    return used.ru_utime + used.ru_stime, used.ru_maxrss * PEAK_UNIT / 1e6
