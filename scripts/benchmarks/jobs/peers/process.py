"""A peer's run: its own process, one thread, a time limit; processor and wall seconds and memory of all of it."""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.places import ROOT

#: Where the package lies, for the processes that import it.
#: Seconds after which a peer's run is given up.
TIME_LIMIT = 400.0
#: Python that Debian's GetFEM packages belong to.
SYSTEM_PYTHON = "/usr/bin/python3"
#: One thread, for all programs alike.
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "CCX_NPROC_RESULTS"), "1")


class PeerError(RuntimeError):
    """A peer did not deliver."""


@dataclass(frozen=True)
class Spent:
    """What a process used: processor and wall time (s), peak memory (MB), and what it printed."""

    cpu_s: float
    wall_s: float
    peak_MB: float
    text: str


def missing(name: str) -> str:
    """Why the peer `name` cannot run here; empty when it can."""
    packages = {"exudyn": "exudyn", "sundials": "sksundae"}
    if name in packages:
        found = importlib.util.find_spec(packages[name]) is not None
        return "" if found else f"{name}: the package {packages[name]} is not installed (pip install 'gearfe[peers]')"
    if name == "calculix":
        return "" if shutil.which("ccx") else "CalculiX: no program ccx on the path (Debian: apt install calculix-ccx)"
    if name == "getfem":
        return "" if system_python_has("getfem") else "GetFEM: not there (Debian: apt install python3-getfem)"
    return ""


def system_python_has(module: str) -> bool:
    """Whether the system's Python can import a module."""
    if not Path(SYSTEM_PYTHON).exists():
        return False
    code = f"import importlib.util as u, sys; sys.exit(u.find_spec({module!r}) is None)"
    return subprocess.run([SYSTEM_PYTHON, "-c", code], check=False, capture_output=True).returncode == 0


def run_process(command: Sequence[str], folder: Path, *, limit: float = TIME_LIMIT) -> Spent:
    """Run a command in `folder` to its end.

    Raises
    ------
    PeerError
        When it takes longer than `limit` (s) or ends with an error.
    """
    environment = {**os.environ, **ONE_THREAD, "PYTHONPATH": f"{ROOT}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"}
    with (folder / "output.txt").open("w+", encoding="utf-8", errors="replace") as output:
        begin = time.perf_counter()
        process = subprocess.Popen(command, cwd=folder, stdout=output, stderr=subprocess.STDOUT, env=environment)
        try:
            used = _wait(process, limit)
        except BaseException:
            process.kill()
            process.wait()
            raise
        wall = time.perf_counter() - begin
        output.seek(0)
        text = output.read()
    if process.returncode:
        last = " ".join(text.strip().splitlines()[-3:])
        raise PeerError(f"{Path(command[0]).name} ended with code {process.returncode}: {last[-300:]}")
    return Spent(used.ru_utime + used.ru_stime, wall, 1.024e-3 * used.ru_maxrss, text)


def _wait(process: subprocess.Popen[bytes], limit: float) -> Any:
    """Wait for a process and return its resource usage (POSIX)."""
    end = time.monotonic() + limit
    while True:
        number, status, used = os.wait4(process.pid, os.WNOHANG)
        if number:
            process.returncode = os.waitstatus_to_exitcode(status)
            return used
        if time.monotonic() > end:
            raise PeerError(f"gave up after {limit:g} s")
        time.sleep(0.005)


def run_python(module: str, task: Mapping[str, Any], *, limit: float = TIME_LIMIT) -> dict[str, Any]:
    """Run ``python -m scripts.benchmarks.jobs.peers.MODULE task.json answer.json`` and return the answer.

    The peer measures itself, so that starting Python and importing packages do not count against it; ``process`` in the
    answer tells the whole process.
    """
    with tempfile.TemporaryDirectory(prefix="gearfe-peer-") as name:
        folder = Path(name)
        (folder / "task.json").write_text(json.dumps(task), encoding="utf-8")
        spent = run_process(
            [sys.executable, "-m", f"scripts.benchmarks.jobs.peers.{module}", "task.json", "answer.json"],
            folder,
            limit=limit,
        )
        answer: dict[str, Any] = json.loads((folder / "answer.json").read_text(encoding="utf-8"))
    return {**answer, "process_cpu_s": spent.cpu_s, "peak_MB": spent.peak_MB}


def serve(answer: Any) -> None:
    """Main of a peer's module: ``answer(task)`` gives what goes back."""
    task = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    Path(sys.argv[2]).write_text(json.dumps(answer(task)), encoding="utf-8")
