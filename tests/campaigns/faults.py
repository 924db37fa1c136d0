"""The program as a process of its own, and what may happen to it: killed, a full or read-only disk, a closed folder,
a shared cache."""

from __future__ import annotations

import contextlib
import csv
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from tests.places import ROOT

from .campaign import Case
from .outcome import Check, Finding

#: Seconds that a quick job may take here.
LONGEST = 120.0


def command(case: Case, job: Path, out: str) -> list[str]:
    """The program, its command, the job, the folder, options."""
    given = [str(a) for a in case.data["arguments"]]
    return [sys.executable, "-m", "gearfe", given[0], str(job), "--out", out, *given[1:]]


def environment(folder: Path, **more: str) -> dict[str, str]:
    """Environment with a cache of its own and the package that runs here."""
    package = str(ROOT)
    path = os.pathsep.join([package, *filter(None, [os.environ.get("PYTHONPATH")])])
    return {**os.environ, "PYTHONPATH": path, "GEARFE_CACHE": str(folder / "cache"), "OMP_NUM_THREADS": "1", **more}


@cache
def usual_seconds(base: str, key: tuple[str, ...]) -> float:
    """How long a job takes when nothing happens (measured once a process)."""
    import tempfile

    from .mutations import base_jobs

    with tempfile.TemporaryDirectory(prefix="gearfe-stress-") as name:
        folder = Path(name)
        (folder / "job.toml").write_text(base_jobs()[base].text, encoding="utf-8")
        case = Case(0, "", {}, "", {"arguments": list(key)})
        begin = time.monotonic()
        run = command(case, folder / "job.toml", str(folder / "out"))
        subprocess.run(run, env=environment(folder), capture_output=True, timeout=LONGEST, check=False)
        return time.monotonic() - begin


def killed_run(case: Case, folder: Path) -> Finding:
    """Run, kill at a random moment, look at the files, run again."""
    job, out = case.write(folder), folder / "out"
    usual = usual_seconds(str(case.data["base"]), tuple(str(a) for a in case.data["arguments"]))
    begin = time.monotonic()
    process = subprocess.Popen(
        command(case, job, str(out)),
        env=environment(folder),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(timeout=float(case.data["share"]) * usual)
    alive = process.poll() is None
    if alive:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    after = time.monotonic() - begin
    checks = [whole_files(out)]
    again = subprocess.run(
        command(case, job, str(out)),
        env=environment(folder),
        capture_output=True,
        text=True,
        timeout=LONGEST,
        check=False,
    )
    checks.append(Check("second run fails", float(again.returncode), 0.5))
    checks.append(whole_files(out))
    measures = {"base": case.data["base"], "killed_after_s": round(after, 3), "was_running": alive}
    return Finding("done", "", checks, measures)


def whole_files(out: Path) -> Check:
    """Visible files that cannot be read to their end."""
    torn = []
    for path in sorted(out.glob("*")) if out.exists() else []:
        if path.name.startswith("."):
            continue
        try:
            _read(path)
        except (ValueError, OSError, csv.Error) as error:
            torn.append(f"{path.name} ({error})")
    return Check(f"torn {torn[0]}" if torn else "torn", float(len(torn)), 0.5)


def _read(path: Path) -> None:
    if path.suffix == ".csv":
        text = path.read_text(encoding="utf-8")
        rows = list(csv.reader(text.splitlines()))
        if not text.endswith("\n") or len({len(row) for row in rows}) != 1:
            raise ValueError("cut short")
    elif path.suffix == ".json":
        json.loads(path.read_text(encoding="utf-8"))
    elif path.suffix == ".png" and not path.read_bytes().endswith(b"IEND\xaeB`\x82"):
        raise ValueError("cut short")


def full_run(case: Case, folder: Path) -> Finding:
    """No file may grow beyond some bytes: writing fails as it does on a full disk."""
    import resource

    size = int(case.data["bytes"])

    def limited() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # an error instead of a signal, as a full disk gives
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    out = folder / "out"
    made = subprocess.run(
        command(case, case.write(folder), str(out)), env=environment(folder), capture_output=True, text=True,
        timeout=LONGEST, preexec_fn=limited, check=False,
    )  # fmt: skip
    return _refused(case, made, out, {"bytes": size}, may_succeed=True)


@contextlib.contextmanager
def mounted(folder: Path, options: str) -> Iterator[str]:
    """A small file system in memory at `folder` while it lasts; yields why not, or nothing."""
    folder.mkdir()
    if sys.platform != "linux" or os.geteuid() != 0:
        yield "mounting needs Linux and the rights of root"
        return
    given = ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(folder)]
    try:
        made = subprocess.run(given, capture_output=True, text=True, timeout=LONGEST, check=False)
        refusal = made.stderr.strip() or f"mount ended with {made.returncode}" if made.returncode else ""
    except OSError as error:
        refusal = str(error)
    try:
        yield refusal
    finally:
        if not refusal:
            subprocess.run(["umount", "--lazy", str(folder)], timeout=LONGEST, check=True)


def disk_run(case: Case, folder: Path) -> Finding:
    """A disk of 4 to 32 KiB, often too small for the tables; every other one holds the cache, too."""
    job, disk = case.write(folder), folder / "disk"
    size = 4096 * (1 + int(case.data["choice"]) // 2 % 8)
    with mounted(disk, f"size={size}") as refusal:
        if refusal:
            return Finding("stopped", f"not tried: {refusal}")
        more = {"GEARFE_CACHE": str(disk / "cache")} if int(case.data["choice"]) % 2 else {}
        made = subprocess.run(
            command(case, job, str(disk / "out")), env=environment(folder, **more), capture_output=True, text=True,
            timeout=LONGEST, check=False,
        )  # fmt: skip
        found = _refused(case, made, disk / "out", {"bytes": size}, may_succeed=True)
        part = [p.name for p in (disk / "out").glob("*")] if made.returncode == 2 else []
    return replace(found, checks=[*found.checks, Check(f"part of the files {part[:1]}", float(len(part)), 0.5)])


def read_only_run(case: Case, folder: Path) -> Finding:
    """A disk that may be read only: refused with a reason."""
    job, disk = case.write(folder), folder / "disk"
    with mounted(disk, "size=64k,ro") as refusal:
        if refusal:
            return Finding("stopped", f"not tried: {refusal}")
        place = str(disk / "out" if int(case.data["choice"]) % 2 else disk)
        made = subprocess.run(
            command(case, job, place), env=environment(folder), capture_output=True, text=True, timeout=LONGEST,
            check=False,
        )  # fmt: skip
        return _refused(case, made, disk, {"place": "read-only disk"}, may_succeed=False)


def closed_run(case: Case, folder: Path) -> Finding:
    """A folder that cannot be made or written to."""
    places: list[str] = [str(folder / "file" / "out"), str(folder / "file"), "/proc/out", "/dev/null/out", "/dev/full"]
    places += [str(folder / ("x" * 300)), "/proc/self/fd", "/sys/kernel/out", "a\x00b"]
    (folder / "file").write_text("no folder\n", encoding="utf-8")
    place = places[int(case.data["choice"]) % len(places)]
    if "\x00" in place:  # no process can be given that: the library is asked
        from gearfe.base.errors import InputError
        from gearfe.base.files import output_folder

        try:
            output_folder(place)
        except InputError as error:
            return Finding("refused", str(error), (), {"place": repr(place)})
        return Finding("done", "", [Check("wrote to a name that cannot be", 1.0, 0.5)], {"place": repr(place)})
    made = subprocess.run(
        command(case, case.write(folder), place), env=environment(folder), capture_output=True, text=True,
        timeout=LONGEST, check=False,
    )  # fmt: skip
    return _refused(case, made, folder / "out", {"place": place}, may_succeed=False)


def _refused(case: Case, made: Any, out: Path, measures: dict[str, Any], *, may_succeed: bool) -> Finding:
    """Exit code 2 and one line that says why; no traceback, no torn file."""
    lines = made.stderr.strip().splitlines()
    allowed = (0, 2) if may_succeed else (2,)
    checks = [
        Check("exit code", float(made.returncode not in allowed), 0.5),
        Check("traceback shown", float("Traceback" in made.stderr), 0.5),
        Check("no reason", float(made.returncode == 2 and not lines), 0.5),
        whole_files(out),
    ]
    reason = lines[-1][:300] if lines else ""
    return Finding(
        "done" if made.returncode == 0 else "refused", reason, checks, {"base": case.data["base"], **measures}
    )


def shared_run(case: Case, folder: Path) -> Finding:
    """Two processes, one empty cache, the same job: both succeed with the same tables."""
    job, outs = case.write(folder), (folder / "one", folder / "two")
    both = [
        subprocess.Popen(
            command(case, job, str(out)), env=environment(folder), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
            text=True,
        )
        for out in outs
    ]  # fmt: skip
    told = [process.communicate(timeout=LONGEST)[1] for process in both]
    tables = [{p.name: p.read_bytes() for p in sorted(out.glob("*.csv"))} for out in outs]
    checks = [
        Check("a process fails", float(sum(process.returncode != 0 for process in both)), 0.5),
        Check("tables differ", float(tables[0] != tables[1] or not tables[0]), 0.5),
        whole_files(outs[0]),
        whole_files(outs[1]),
    ]
    return Finding("done", " ".join(t.strip() for t in told)[:300], checks, {"base": case.data["base"]})
