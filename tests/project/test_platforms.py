"""Windows and macOS, as far as Linux can tell: what only POSIX has, encodings, a terminal without Unicode."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.places import ROOT

SOURCES = sorted([*(ROOT / "gearfe").rglob("*.py"), *(ROOT / "scripts").glob("*/*.py")])
#: Modules, and names of `os` and `signal`, that Windows does not have (Python's library reference, "Availability").
POSIX_MODULES = {"fcntl", "resource", "pwd", "grp", "termios", "tty", "pty", "syslog", "posix"}
POSIX_NAMES = {
    *("fork", "forkpty", "getuid", "geteuid", "getgid", "setsid", "setpgid", "getpgid", "killpg", "nice", "mkfifo"),
    *("chown", "lchown", "wait", "waitid", "sched_getaffinity", "sysconf", "statvfs", "getloadavg", "uname"),
    *("SIGPIPE", "SIGKILL", "SIGHUP", "SIGALRM", "SIGUSR1", "SIGUSR2", "SIGCHLD", "alarm", "setitimer", "pause"),
}
#: Measures memory on Linux alone, for the pages.
LINUX_ONLY = {"measure_driver.py"}


def calls(tree: ast.AST) -> Iterator[tuple[ast.Call, str, set[str]]]:
    """Calls with the last part of their name and their keywords."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            yield node, name, {str(k.arg) for k in node.keywords}


def mode(call: ast.Call) -> str:
    """Mode of an `open`, of `Path.open` or of a temporary file: the first short text among its arguments."""
    given = [*call.args, *(k.value for k in call.keywords if k.arg == "mode")]
    texts = [a.value for a in given if isinstance(a, ast.Constant) and isinstance(a.value, str)]
    return next((text for text in texts if len(text) < 4), "r")


@pytest.fixture(scope="module")
def trees() -> dict[Path, ast.AST]:
    return {path: ast.parse(path.read_text(encoding="utf-8")) for path in SOURCES}


def test_text_has_an_encoding_and_paths_are_of_no_system(trees: dict[Path, ast.AST]) -> None:
    """Windows takes its code page where none is named; bytes and archives have none."""
    assert len(trees) > 300
    for tree in trees.values():
        check_calls(tree)
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                assert not node.value.startswith(("/dev/", "/tmp/", "C:\\")), node.value


WATCHED = {"open", "NamedTemporaryFile", "fdopen", "read_text", "write_text", "writer", "DictWriter", "rename"}
WATCHED |= {"ProcessPoolExecutor", "Process", "Pool"}


def check_calls(tree: ast.AST) -> None:
    for call, name, keywords in calls(tree):
        if name not in WATCHED:
            continue
        source = ast.unparse(call)
        if name in ("open", "NamedTemporaryFile", "fdopen") and not source.startswith(("os.open", "archive.open")):
            default = "w+b" if name == "NamedTemporaryFile" and mode(call) == "r" else mode(call)
            assert "b" in default or "encoding" in keywords, source
        if name in ("read_text", "write_text") and isinstance(call.func, ast.Attribute):
            assert "encoding" in keywords, source
        if name == "write_text" or (name == "open" and mode(call)[0] in "wax" and "b" not in mode(call)):
            assert "newline" in keywords, f"{source}: other ends of line on Windows"
        if name in ("writer", "DictWriter") and "csv" in source:
            assert "lineterminator" in keywords, f"{source}: two ends of line on Windows"
        if name in ("ProcessPoolExecutor", "Process", "Pool"):
            assert "spawn" in source or "Executor" not in name, f"{source}: forks on Linux alone"
        if name == "rename":
            raise AssertionError(f"{source}: refuses a target that is there on Windows; use replace")


def test_what_only_posix_has_is_asked_for_first(trees: dict[Path, ast.AST]) -> None:
    """Imports of such modules stand in a `try`, such names behind `hasattr` or in a `try`."""
    for path, tree in trees.items():
        if path.name not in LINUX_ONLY:
            check_names(tree, path.read_text(encoding="utf-8"))


def check_names(tree: ast.AST, text: str) -> None:
    tried = {id(inner) for node in ast.walk(tree) if isinstance(node, ast.Try) for inner in ast.walk(node)}
    for node in ast.walk(tree):
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            names = {alias.name for alias in node.names} | {getattr(node, "module", None) or ""}
            assert not names & POSIX_MODULES or id(node) in tried, ast.unparse(node)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in ("os", "signal"):
            guarded = f'hasattr({node.value.id}, "{node.attr}")' in text
            assert node.attr not in POSIX_NAMES or guarded or id(node) in tried, ast.unparse(node)


#: The commands, with what Windows lacks taken away once Python's own modules and the libraries are loaded.
WINDOWS = """
import concurrent.futures.process, ctypes, h5py, meshio, multiprocessing.connection, os, pathlib, signal
import matplotlib.backends.backend_agg, matplotlib.font_manager, matplotlib.pyplot, skfem, scipy.io
import scipy.interpolate, scipy.sparse, scipy.sparse.linalg
import scipy.linalg, scipy.optimize, scipy.signal, scipy.stats, subprocess, sys, tempfile, gmsh, numpy, types
import threadpoolctl, numba.core.registry
taken = set()
def locking(handle, mode, size):  # as the library reference has it: an OSError where the bytes are locked
    place = os.fstat(handle).st_ino
    if mode != 2 or place in taken:
        raise PermissionError(13, "Permission denied")
    taken.add(place)
sys.modules["msvcrt"] = types.SimpleNamespace(LK_NBLCK=2, locking=locking)
threadpoolctl.sys = types.SimpleNamespace(**vars(sys))  # it would look for libraries of Windows
sys.platform = "win32"
for name in ("fcntl", "resource", "pwd", "grp", "termios"):
    sys.modules[name] = None
for module, names in ((os, ("getuid", "fork", "sched_getaffinity")), (signal, ("SIGPIPE", "SIGKILL", "SIGHUP"))):
    for name in names:
        if hasattr(module, name):
            delattr(module, name)
from gearfe.cli.main import main
from tests.multibody.test_kernel_compiling import hits
job, crank, study, kernels = sys.argv[1:]
assert main(["new", "stiffness", job]) == 0
assert main(["stiffness", job, "--coarsen", "4", "--angles", "0", "9", "9", "--no-estimate", "--report"]) == 0
assert hits()[1] == 5  # compiles a small kernel and keeps it
os.environ["GEARFE_CACHE"] = kernels  # the large ones are those of other tests
assert main(["new", "mechanism", crank]) == 0
assert main(["mechanism", crank, "--until", "0.05", "--format", "mat,h5"]) == 0
assert main(["study", study, "--out", "aus/study", "--jobs", "1"]) == 0
del os.environ["GEARFE_CACHE"]
assert main(["cache"]) == 0
os.remove("aus/study/study.csv")  # its lock is still there in this process: a second writer
assert main(["study", study, "--out", "aus/study", "--jobs", "1"]) == 2
"""


def test_commands_without_what_windows_lacks(tmp_path: Path) -> None:
    """In a folder with blanks and letters that the terminal does not have; the locale is C, not UTF-8."""
    from tests.makers.studies import written

    folder = tmp_path / "prüfstand β 1"
    folder.mkdir()
    written(folder, cases=4)
    settings = {"PYTHONIOENCODING": "cp1252", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "LC_ALL": "C"}
    settings |= {"LOCALAPPDATA": str(tmp_path / "AppData"), "PYTHONPATH": str(ROOT)}
    environment = {key: value for key, value in os.environ.items() if key not in ("GEARFE_CACHE", "XDG_CACHE_HOME")}
    line = [sys.executable, "-c", WINDOWS, "getriebe ψ.toml", "kurbel.toml", "study.toml", os.environ["GEARFE_CACHE"]]
    done = subprocess.run(line, cwd=folder, env={**environment, **settings}, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode("cp1252", "replace")
    assert b"is being written by another study" in done.stderr
    assert b"getriebe \\u" in done.stdout  # the letter that is not there
    assert (folder / "out" / "getriebe ψ" / "stiffness" / "report.html").exists()
    assert list((tmp_path / "AppData" / "gearfe").glob("kernels-*/fill_out-*.o"))
    assert list((tmp_path / "AppData" / "gearfe").glob("tooth-sector-*.npz"))
    table = (folder / "out" / "getriebe ψ" / "stiffness" / "stiffness.csv").read_bytes()
    assert b"\r" not in table


def test_a_case_that_is_written_on_another_drive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No path leads from one drive of Windows to another: files beside the job are then named from the root."""
    from gearfe.study.case import job_beside

    def another_drive(path: str, start: str) -> str:
        raise ValueError(f"path is on mount {path!r}, start on mount {start!r}")

    (tmp_path / "curve.csv").write_text("x\n", encoding="utf-8")
    raw = {"train": {"meshes": [{"curve": "curve.csv", "mesh_model": "variable_stiffness"}]}}
    monkeypatch.setattr(os.path, "relpath", another_drive)
    (mesh,) = job_beside(raw, tmp_path, tmp_path / "elsewhere")["train"]["meshes"]
    assert mesh == {"curve": (tmp_path / "curve.csv").resolve().as_posix(), "mesh_model": "variable_stiffness"}
