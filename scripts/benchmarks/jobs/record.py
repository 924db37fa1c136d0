"""Tables of measured rows in a folder: every finished row is on disk, whole, and is not measured again.

A table is one CSV file, rewritten in one step after each new row. Rows belong to a state of the program: when the
sources, the versions, the machine or the settings differ from what `run.json` tells, the tables are begun anew.
"""

from __future__ import annotations

import csv
import hashlib
import json
import os
import platform
import re
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any

from gearfe import __version__
from gearfe.base.files import output_folder, write_csv, write_json
from tests.places import ROOT

#: Packages whose versions are recorded.
PACKAGES = (
    "numpy", "scipy", "numba", "scikit-fem", "gmsh", "pymetis", "exudyn", "scikit-sundae",
)  # fmt: skip
#: Programs that are no packages: what tells their version, and where it stands in the answer.
PROGRAMS = {
    "CalculiX": (("ccx", "-v"), r"Version ([\d.]+)"),
    "GetFEM": (("dpkg-query", "-W", "-f=${Version}", "python3-getfem"), r"^([\d.]+)"),
}
#: What does not change a result: the commands of the package, and these modules of the benchmark.
UNMEASURED = ("command.py", "page.py", "pictures.py", "tables.py")
Row = dict[str, Any]


def told(text: str) -> None:
    """Print at once, also into a file that someone watches."""
    print(text, flush=True)


@dataclass
class Table:
    """Rows of one CSV file; `key` names the columns that tell rows apart."""

    path: Path
    key: tuple[str, ...]
    rows: list[Row] = field(default_factory=list)

    def __post_init__(self) -> None:
        if self.path.exists():
            self.rows = read_rows(self.path)

    def find(self, key: Mapping[str, Any]) -> Row | None:
        """The finished row of that key."""
        wanted = {name: _text(key[name]) for name in self.key}
        return next((r for r in self.rows if all(_text(r[n]) == t for n, t in wanted.items())), None)

    def add(self, row: Row) -> None:
        """Put a row on disk."""
        self.rows.append(row)
        names = list(dict.fromkeys(name for r in self.rows for name in r))
        write_csv(self.path, {name: [_cell(r.get(name, float("nan"))) for r in self.rows] for name in names})


@dataclass
class Record:
    """A results folder and how it is filled.

    Parameters
    ----------
    folder
        Where tables and pictures go.
    quick
        Small settings: a smoke run that proves that everything works, not how fast.
    peers
        Whether other programs run too.
    against
        Commit that whole commands are compared with; empty for none.
    """

    folder: Path
    quick: bool = False
    peers: bool = True
    against: str = ""
    say: Callable[[str], None] = told
    failures: list[str] = field(default_factory=list)

    def table(self, name: str, *key: str) -> Table:
        """Table `name`.csv, its rows told apart by the columns `key`."""
        return Table(self.folder / f"{name}.csv", key)

    def row(self, table: Table, key: Mapping[str, Any], make: Callable[[], Mapping[str, Any]]) -> Row | None:
        """The row of `key`: from the file, or made, told and kept. A row that fails is told, and None."""
        known = table.find(key)
        if known is not None:
            return known
        begin = time.perf_counter()
        try:
            made = {**key, **make()}
        except Exception as error:  # one row must not end a run of half an hour
            self.failures.append(f"{table.path.stem} {dict(key)}: {type(error).__name__}: {error}")
            self.say(f"  {table.path.stem}: {_line(key)} FAILED: {type(error).__name__}: {error}")
            if os.environ.get("GEARFE_BENCHMARK_TRACE"):
                traceback.print_exc()
            return None
        table.add(made)
        self.say(f"  {table.path.stem}: {_line(made)}  [{time.perf_counter() - begin:.1f} s]")
        return made


def open_record(
    out: str | Path,
    *,
    quick: bool = False,
    peers: bool = True,
    against: str = "",
    say: Callable[[str], None] = told,
) -> Record:
    """The record in folder `out`; rows of another program, machine or setting are removed first, and this is said."""
    folder = output_folder(out)
    state = {
        "quick": quick,
        "against": against,
        "machine": machine(),
        "versions": versions(),
        "sources": sources_hash(),
    }
    path = folder / "run.json"
    if path.exists():
        before = json.loads(path.read_text(encoding="utf-8"))
        changed = [name for name in state if before.get(name) != json.loads(json.dumps(state[name]))]
        if changed:
            say(f"the results in {folder} were made with other {' and '.join(changed)}: begun anew")
            for old in folder.glob("*.csv"):
                if "_outcomes" not in old.name:
                    old.unlink()
    write_json(path, state)
    return Record(folder, quick, peers, against, say)


def machine() -> dict[str, Any]:
    """Processor, cores and memory (as far as the system tells)."""
    name = platform.processor() or platform.machine()
    memory = float("nan")
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
        name = next(x.split(":", 1)[1].strip() for x in text.splitlines() if x.startswith("model name"))
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    except (OSError, StopIteration, ValueError, AttributeError):
        pass
    return {
        "processor": name,
        "cores": os.cpu_count(),
        "memory_GiB": None if memory != memory else round(memory, 1),  # noqa: PLR0124
        "system": f"{platform.system()} {platform.machine()}",
    }


def versions() -> dict[str, str]:
    """Versions of Python, this package and what it stands on."""
    found = {"python": platform.python_version(), "gearfe": __version__}
    for name in PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "missing"
    return found | {name: _program(command, pattern) for name, (command, pattern) in PROGRAMS.items()}


def _program(command: tuple[str, ...], pattern: str) -> str:
    """Version that a program tells, ``missing`` when there is none."""
    try:
        done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=60)
    except (OSError, subprocess.TimeoutExpired):
        return "missing"
    told = re.search(pattern, done.stdout)
    return told.group(1) if told else "missing"


def sources_hash() -> str:
    """Hash of the sources, of the package and of the benchmark, that can change a result."""
    benchmark = Path(__file__).resolve().parent
    total = hashlib.sha256(sys.version.encode())
    for root in (ROOT / "gearfe", benchmark):
        for path in sorted(root.rglob("*.py")):
            if path.relative_to(root).parts[0] not in UNMEASURED:
                total.update(path.read_bytes())
    return total.hexdigest()[:16]


def read_rows(path: Path) -> list[Row]:
    """Rows of a CSV file, numbers as numbers."""
    with path.open(newline="", encoding="utf-8") as stream:
        return [{name: _value(text) for name, text in row.items()} for row in csv.DictReader(stream)]


def _value(text: str) -> Any:
    try:
        return int(text)
    except ValueError:
        try:
            return float(text)
        except ValueError:
            return text


def _cell(value: Any) -> Any:
    return " ".join(value.replace(",", ";").split()) if isinstance(value, str) else value


def _text(value: Any) -> str:
    return str(_cell(value)) if isinstance(value, str) else f"{float(value):.12g}"


def _line(row: Mapping[str, Any]) -> str:
    return "  ".join(f"{n} {v:.4g}" if isinstance(v, float) else f"{n} {v}" for n, v in row.items() if v == v)  # noqa: PLR0124
