"""Commands are run here, with the options that they share: what is printed, and in which forms results are kept."""

from __future__ import annotations

import argparse
import importlib
import io
import json
import shlex
import sys
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TextIO

from ..config import JobFile
from ..errors import InputError, MissingLibraryError, NotFiniteWarning
from ..progress import shown
from .arguments import CommandParser, with_changes

#: Formats of ``--format`` beside CSV; their writers are in `gearfe.output.formats`.
FORMATS = ("npz", "h5", "mat", "uff")
REPORT = "report.html"


def add_folder(parser: argparse.ArgumentParser) -> None:
    """``--out``, and how the results in that folder are kept and printed."""
    command = parser.prog.split()[-1]
    parser.add_argument("--out", metavar="DIR", default=None, help=f"output folder (default: out/JOB/{command})")
    parser.set_defaults(folder_of=command)
    parser.add_argument(
        "--format",
        metavar="NAME",
        default="csv",
        help=f"tables also as tables.NAME: {', '.join(FORMATS)}, or several, as mat,h5 (default: csv alone)",
    )
    parser.add_argument(
        "--report", action="store_true", help=f"pictures, figures, tables and job in one page, {REPORT}"
    )
    add_json(parser)
    add_pictures(parser)


def add_pictures(parser: argparse.ArgumentParser) -> None:
    """``--no-pictures``."""
    parser.add_argument("--no-pictures", action="store_true", help="leave out the pictures")


def add_json(parser: argparse.ArgumentParser) -> None:
    """``--json``: the summary in the output folder, or what a command that has none leaves in ``args.summary``."""
    parser.add_argument("--json", action="store_true", help="print the summary as JSON, and nothing else")


def command_module(name: str) -> Any:
    """Module of a command (its contract is in `gearfe.commands`)."""
    return importlib.import_module(f".{name}", __package__)


def parser_of(module: Any, name: str, summary: str, example: str) -> CommandParser:
    """Parser of a command module, called by `name`, with the options that all commands have."""
    parser = CommandParser(prog=name, description=summary, example=example)
    module.add_arguments(parser)
    _add_verbosity(parser)
    return parser


def run_command(module: Any, name: str, summary: str, example: str, arguments: list[str]) -> int:
    """Run a command module (its contract is in `gearfe.commands`), called by `name`, with these arguments."""
    parser = parser_of(module, name, summary, example)
    parsed = _with_folder(with_changes(parser.parse_args(arguments)))
    with _tables_watched() as messages:
        code = _run_and_keep(module.run, parsed, [*name.split()[1:], *arguments])
        return code or int(bool(messages))


@contextmanager
def _tables_watched() -> Iterator[list[str]]:
    """Print what the writer of tables warns of, and yield these sentences: such a table is no success."""
    messages: list[str] = []
    with warnings.catch_warnings():
        other = warnings.showwarning

        def show(
            message: Warning | str,
            category: type[Warning],
            filename: str,
            lineno: int,
            file: TextIO | None = None,
            line: str | None = None,
        ) -> None:
            if not issubclass(category, NotFiniteWarning):
                other(message, category, filename, lineno, file, line)
                return
            messages.append(str(message))
            print(f"gearfe: warning: {message}", file=sys.stderr)

        warnings.simplefilter("always", NotFiniteWarning)
        warnings.showwarning = show
        yield messages


def _add_verbosity(parser: argparse.ArgumentParser) -> None:
    """``-q`` and ``-v``."""
    group = parser.add_mutually_exclusive_group()
    group.add_argument("-q", "--quiet", action="store_true", help="print warnings and errors only")
    group.add_argument("-v", "--verbose", action="store_true", help="tell each stage of the work as it begins")


def _with_folder(parsed: argparse.Namespace) -> argparse.Namespace:
    """The arguments, their ``--out`` by default ``out/JOB/COMMAND``: no command writes over another's summary."""
    if getattr(parsed, "folder_of", None) and parsed.out is None:
        job = next(value for value in vars(parsed).values() if isinstance(value, JobFile))
        parsed.out = str(Path("out") / Path(job).stem / parsed.folder_of)
    return parsed


def _run_and_keep(run: Callable[[argparse.Namespace], int], parsed: argparse.Namespace, line: list[str]) -> int:
    """Run a command, print as its options say, and keep the results in the requested forms."""
    formats = _formats(getattr(parsed, "format", "csv"))
    as_json, report = getattr(parsed, "json", False), getattr(parsed, "report", False)
    if not (formats or as_json or report or parsed.quiet):
        with shown(verbose=parsed.verbose):
            return int(run(parsed))

    from ..files import recorded

    said = io.StringIO()
    with redirect_stdout(_Both(said, None if parsed.quiet or as_json else sys.stdout)):
        with recorded() as folders, shown(io.StringIO() if parsed.quiet else None, verbose=parsed.verbose):
            code = int(run(parsed))
        for folder, names in folders:
            kept = _keep(folder, names, formats, parsed, said.getvalue(), line if report else None)
            if kept:
                print(f"also written: {', '.join(kept)}")
    if as_json:
        entries = getattr(parsed, "summary", {})
        if folders and not entries:
            entries = {"folder": str(folders[-1][0]), **_summary(*folders[-1])}
        print(json.dumps({"exit_code": code, **entries}, indent=2))
    return code


def print_results(
    lines: Iterable[str], folder: Path, names: Iterable[str], seconds: Mapping[str, float], warnings: Iterable[str]
) -> None:
    """Print what a command found, the names of its files, the seconds of its stages; warnings to standard error."""
    for line in lines:
        print(line)
    print(f"written to {folder}: " + ", ".join(names))
    if seconds:
        print("seconds: " + ", ".join(f"{name} {value:.2f}" for name, value in seconds.items()))
    for sentence in warnings:
        print(f"gearfe: warning: {sentence}", file=sys.stderr)


class _Both(io.TextIOBase):
    """Text for a buffer and, where there is one, another stream."""

    def __init__(self, kept: io.StringIO, shown_on: TextIO | None) -> None:
        self._kept, self._shown = kept, shown_on

    def write(self, text: str) -> int:
        """Write to both."""
        if self._shown is not None:
            self._shown.write(text)
        return self._kept.write(text)

    def flush(self) -> None:
        """Flush what is seen."""
        if self._shown is not None:
            self._shown.flush()


def _formats(text: str) -> tuple[str, ...]:
    """Formats beside CSV that a value of ``--format`` names."""
    names = [name.strip() for name in text.split(",")]
    for name in names:
        if name not in ("csv", *FORMATS):
            raise InputError("--format", text, "must name formats of " + ", ".join(("csv", *FORMATS)), "as mat,h5")
    if "uff" in names and find_spec("pyuff") is None:  # refused before the work, not after it
        raise MissingLibraryError("universal files need pyuff: pip install 'gearfe[exchange]'")
    return tuple(dict.fromkeys(name for name in names if name != "csv"))


def _keep(
    folder: Path,
    names: list[str],
    formats: tuple[str, ...],
    parsed: argparse.Namespace,
    said: str,
    line: list[str] | None,
) -> list[str]:
    """Write the tables in other formats and the report; those of an earlier run that this one does not replace go."""
    if not formats and line is None:
        return []
    from ..files import whole_set
    from ..output.formats import read_csv, write_tables
    from ..output.report_page import PICTURES, Report, report_page

    tables = {Path(name).stem: read_csv(folder / name) for name in names if name.endswith(".csv")}
    with whole_set(folder) as made:
        if formats and tables:
            write_tables(made, tables, formats)
        if line is not None:
            job = next((value for value in vars(parsed).values() if isinstance(value, JobFile)), None)
            page = Report(
                title=f"gearfe {line[0]}" + ("" if job is None else f": {Path(job).name}"),
                command=shlex.join(["gearfe", *line]),
                said=said,
                summary=_summary(folder, names),
                tables=tables,
                pictures=[folder / name for name in names if Path(name).suffix in PICTURES],
                job=("", "") if job is None else (str(job), Path(job).read_text(encoding="utf-8-sig")),
            )
            text = report_page(page, time.strftime("%Y-%m-%d %H:%M"))
            (made / REPORT).write_text(text, encoding="utf-8", errors="backslashreplace", newline="\n")
        return sorted(path.name for path in made.iterdir())


def _summary(folder: Path, names: list[str]) -> dict[str, Any]:
    """What the run left as JSON: its summary, or the one file that it wrote."""
    found = [name for name in names if name.endswith(".json")]
    chosen = "summary.json" if "summary.json" in found else next(iter(found), None)
    made: dict[str, Any] = {"files": names}
    return made if chosen is None else {**made, **json.loads((folder / chosen).read_text(encoding="utf-8"))}
