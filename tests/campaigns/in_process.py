"""A mutated job through the program in this process, watched by an audit hook."""

from __future__ import annotations

import contextlib
import importlib
import io
import os
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gearfe.base.cache import cache_folder

from .campaign import Case
from .outcome import Check, Finding
from .worker import OverTime

#: Events of PEP 578 that change files: their arguments hold paths.
WRITING = ("os.remove", "os.rename", "os.mkdir", "os.rmdir", "os.link", "os.symlink", "os.truncate", "os.chmod")
STARTING = ("subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "os.fork", "socket.connect")
#: Words that only the mutated files hold: code that has them came from there.
MARK = "CANARY"


@dataclass
class Watch:
    """What happened while it was on.

    Attributes
    ----------
    inside
        Folders that may be written to.
    outside, started, run
        Files written elsewhere, programs started, and code compiled from the file.
    """

    inside: tuple[str, ...] = ()
    on: bool = False
    outside: list[str] = field(default_factory=list)
    started: list[str] = field(default_factory=list)
    run: list[str] = field(default_factory=list)

    def __call__(self, event: str, arguments: tuple[Any, ...]) -> None:
        """The hook; it cannot be taken off again, so it is off outside of cases."""
        if not self.on:
            return
        if event == "open":
            path, mode, flags = arguments
            writes = (isinstance(mode, str) and any(c in mode for c in "wax+")) or bool(
                isinstance(flags, int) and flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC)
            )
            if writes:
                self._check(path)
        elif event in WRITING:
            for path in arguments[:2]:
                self._check(path)
        elif event in STARTING and "'uname'" not in repr(arguments)[:40]:  # Python's own, for the name of the platform
            self.started.append(f"{event} {arguments[:1]!r}"[:200])
        elif event == "compile" and MARK in repr(arguments[0])[:10_000]:
            self.run.append(repr(arguments[0])[:200])

    def _check(self, path: Any) -> None:
        if not isinstance(path, (str, bytes, os.PathLike)):
            return
        text = os.path.abspath(os.fsdecode(path))
        if text != os.devnull and not text.startswith(self.inside):
            self.outside.append(text)


_WATCH = Watch()
_INSTALLED: list[bool] = []


def mutated_run(case: Case, folder: Path) -> Finding:
    """Exit code and messages of the program, and what the hook saw."""
    if not _INSTALLED:
        sys.addaudithook(_WATCH)
        _INSTALLED.append(True)
    main = importlib.import_module("gearfe.cli.main").main  # the program as a user meets it
    job = case.write(folder)
    given = [str(a) for a in case.data["arguments"]]
    out = folder / "out"
    command = [given[0], str(job), "--out", str(out), *given[1:]]
    said, told = io.StringIO(), io.StringIO()
    caches = tuple(
        str(Path(p).resolve())
        for p in (
            tempfile.gettempdir(),
            sys.prefix,
            Path.home() / ".cache",
            Path.home() / ".config",
            cache_folder() or sys.prefix,
        )
    )
    _WATCH.inside = (str(folder), *_bytecode(), *caches[1:], *_own_temporary(caches[0]))
    _WATCH.outside, _WATCH.started, _WATCH.run = [], [], []
    before, here = set(os.listdir(folder)), Path.cwd()
    os.chdir(folder)  # what a job writes to a relative place shows
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(told):
            _WATCH.on = True
            try:
                code = main(command)
            except SystemExit as error:  # argparse
                code = error.code if isinstance(error.code, int) else 1
            except OverTime:
                return Finding("limit", "asks for more than the time limit", _disk(out, folder, before), {})
            finally:
                _WATCH.on = False
    finally:
        os.chdir(here)
    reason = (told.getvalue().strip().splitlines() or said.getvalue().strip().splitlines() or [""])[0]
    checks = [*_disk(out, folder, before), *_seen()]
    checks.append(Check("exit code", float(code not in (0, 1, 2)), 0.5))
    checks.append(Check("traceback shown", float("Traceback" in told.getvalue()), 0.5))
    checks.append(Check("refused without reason", float(code == 2 and len(reason) < 20), 0.5))
    outcome = {0: "done", 1: "stopped", 2: "refused"}.get(code, "done")
    return Finding(outcome, "" if code == 0 else reason[:300], checks, {"base": case.data["base"], "code": code})


def _seen() -> list[Check]:
    """What the audit hook found; the first of each goes into the check's name."""
    found = {"outside": _WATCH.outside, "started": _WATCH.started, "code run": _WATCH.run}
    return [Check(f"{name} {seen[0]}" if seen else name, float(len(seen)), 0.5) for name, seen in found.items()]


def _disk(out: Path, folder: Path, before: set[str]) -> list[Check]:
    """Files beside the output folder, and unfinished ones within it."""
    beside = set(os.listdir(folder)) - before - {"out"}
    left = [p.name for p in out.rglob(".*")] if out.exists() else []
    return [Check("beside the output", float(len(beside)), 0.5), Check("left unfinished", float(len(left)), 0.5)]


def _bytecode() -> tuple[str, ...]:
    """Folders in which the interpreter keeps compiled modules: beside the sources."""
    return tuple(
        str(Path(module.__file__).parent) for module in (importlib.import_module("gearfe"), os) if module.__file__
    )


def _own_temporary(folder: str) -> tuple[str, ...]:
    """Names below the temporary folder that Python's tempfile and plotting libraries use."""
    return tuple(os.path.join(folder, name) for name in ("tmp", "matplotlib", "gearfe-", "numba"))
