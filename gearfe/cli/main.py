"""Run a command of the ``gearfe`` program and print its results. User errors give one line and exit code 2.

It listens to Ctrl-C from its first lines on; what takes time is imported after that, and help and version need nothing.
"""

from __future__ import annotations

import io
import os
import sys

from ..base.isolation import leave_working_folder

TYPE_CHECKING = False  # `typing` itself would be a third of the program's start
if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Sequence
    from pathlib import Path
    from types import FrameType
    from typing import Any, TextIO

    from ..base.files import Written

USAGE = "gearfe COMMAND ... ('gearfe COMMAND --help' lists the options of a command)"

#: Commands that were, and where they went.
MOVED = {
    "microgeometry": "it is a load map of the same job file: gearfe loadmap, which takes [microgeometry]",
    "relief": "the best relief is a search of gearfe study: gearfe new relief.toml, gearfe study relief.toml",
    "benchmark": "in a copy of the repository: python scripts/benchmarks/benchmark.py",
    "stress": "in a copy of the repository: python scripts/benchmarks/stress.py",
}

#: Exit codes as shells give them (128 + signal): of an interrupted program (SIGINT), and where the reader of the output
#: went away (SIGPIPE).
INTERRUPTED, CLOSED = 130, 141


class Interrupted(KeyboardInterrupt):
    """Ctrl-C.

    KeyboardInterrupt itself is not raised. Standard modules execute source text to make their classes. If
    KeyboardInterrupt leaves such text, CPython ends the process by the signal, whatever handles it later
    (``run_eval_code_obj``).
    """


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; return its exit code.

    0 done, 1 done with failures, 2 bad input, 130 interrupted, 141 the reader of the output closed it.
    """
    listening = False
    if argv is None:
        leave_working_folder()
    try:
        import signal

        # who has put another handler there, or none, wants it so
        listening = signal.getsignal(signal.SIGINT) is signal.default_int_handler and _listen()
        return answer(list(sys.argv[1:] if argv is None else argv), _run)
    except KeyboardInterrupt:
        print("gearfe: interrupted", file=sys.stderr)
        return INTERRUPTED
    finally:
        if listening:
            signal.signal(signal.SIGINT, signal.default_int_handler)


def _listen() -> bool:
    """Whether Ctrl-C raises `Interrupted` from now on; only the main thread may ask for that."""
    import signal

    try:
        signal.signal(signal.SIGINT, _interrupt)
    except ValueError:
        return False
    return True


def _interrupt(number: int, frame: FrameType | None) -> None:  # noqa: ARG001 - as handlers are called
    raise Interrupted


def answer(arguments: list[str], run: Callable[[list[str]], int]) -> int:
    """Exit code of `run` with these arguments; mistakes are reported in one line."""
    from contextlib import suppress

    if isinstance(sys.stdout, io.TextIOWrapper):  # a code page that lacks a letter of a name; stderr does so by itself
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        code = _answered(arguments, run)
        for stream in (sys.stdout, sys.stderr):
            if stream is not None:
                stream.flush()
    except BrokenPipeError:
        code = CLOSED
    except OSError as error:  # the output itself: a full disk
        code = 2
        with suppress(OSError):
            print(f"gearfe: error: the output cannot be written: {error.strerror or error}", file=sys.stderr)
    else:
        return code
    _drop_output()
    return code


def _answered(arguments: list[str], run: Callable[[list[str]], int]) -> int:
    from ..base.errors import InputError, MissingLibraryError, cut

    try:
        return run(arguments)
    except BrokenPipeError:
        raise
    except SystemExit as leave:  # argparse has printed the help
        return int(leave.code or 0)
    except (InputError, MissingLibraryError) as error:
        message, code = f"error: {error}", 2
    except MemoryError:
        message, code = "error: not enough memory for this job; coarser meshes or fewer outputs need less", 2
    except OSError as error:
        place = error.filename or "a file cannot be written or read"
        message, code = f"error: {place}: {error.strerror or error}", 2
    print(f"gearfe: {cut(message)}", file=sys.stderr)
    return code


def _run(arguments: list[str]) -> int:
    """Help, version, or the command that the first argument names."""
    from .. import __version__
    from ..base.errors import InputError, unknown_name
    from . import COMMANDS

    if arguments[:1] == ["help"]:
        arguments = [*arguments[1:2], "--help"]
    if not arguments or arguments[0] in ("-h", "--help"):
        print(f"usage: {USAGE}\n")
        for name, (summary, _) in COMMANDS.items():
            print(f"  {name:<13} {summary}")
        print("\nStart with a commented job file: gearfe new stiffness pair.toml. Version: gearfe --version.")
        return 0
    if arguments[0] in ("-V", "--version"):
        print(f"gearfe {__version__}")
        return 0
    if arguments[0] in MOVED:
        raise InputError("command", None, f"unknown name {arguments[0]!r}", MOVED[arguments[0]])
    if arguments[0] not in COMMANDS:
        raise unknown_name("command", arguments[0], COMMANDS)
    from .arguments import command_module

    return run_command(command_module(arguments[0]), f"gearfe {arguments[0]}", *COMMANDS[arguments[0]], arguments[1:])


def run_command(module: Any, name: str, summary: str, example: str, arguments: list[str]) -> int:
    """Run a command module with arguments; return the exit code.

    Parameters
    ----------
    module : module
        Command module, see `gearfe.cli`.
    name : str
        Words by which the command is called.
    summary : str
        One line of help.
    example : str
        An example call.
    arguments : list of str
        The command line after the name.
    """
    import warnings

    from ..base import environment
    from .arguments import completed, parser_of

    environment.check()
    parsed = completed(parser_of(module, name, summary, example).parse_args(arguments))
    with warnings.catch_warnings():
        messages = _watch_tables()
        code = _run_and_keep(module.run, parsed, [*name.split()[1:], *arguments])
        return code or int(bool(messages))


def _watch_tables() -> list[str]:
    """Print from now on what the writer of tables warns of, which is no success; the list gets these sentences."""
    import warnings

    from ..base.errors import NotFiniteWarning, UnitWarning

    messages: list[str] = []
    other = warnings.showwarning

    def show(message: Warning | str, category: type[Warning], *place: Any, **options: Any) -> None:
        if not issubclass(category, NotFiniteWarning):
            other(message, category, *place, **options)
            return
        messages.append(str(message))
        print(f"gearfe: warning: {message}", file=sys.stderr)

    warnings.simplefilter("always", NotFiniteWarning)
    warnings.simplefilter("ignore", UnitWarning)  # said by the names of the job's keys
    warnings.showwarning = show
    return messages


def _doubt(parsed: argparse.Namespace) -> None:
    """Print values of the job that seem to be in another unit, because the run may fail for them."""
    from contextlib import suppress

    from ..base.config import read_toml
    from ..base.errors import InputError
    from ..base.suspects import suspects
    from .arguments import job_of

    job = job_of(parsed)
    if job is None:
        return
    with suppress(InputError):  # the command reports what is wrong with the file
        for sentence in suspects(read_toml(job)):
            print(f"gearfe: warning: {sentence}", file=sys.stderr, flush=True)


def _run_and_keep(run: Callable[[argparse.Namespace], int], parsed: argparse.Namespace, line: list[str]) -> int:
    """Run a command, print as its options say, and keep the results in the requested forms."""
    from ..base.progress import shown

    _doubt(parsed)

    as_json, report = getattr(parsed, "json", False), getattr(parsed, "report", False)
    from ..base.files import recorded

    if not (parsed.format or as_json or report or parsed.quiet):
        with recorded() as folders, shown(verbose=parsed.verbose):
            code = int(run(parsed))
        _print_removed(folders)
        return code

    import json
    from contextlib import redirect_stdout

    said = io.StringIO()
    with redirect_stdout(_Both(said, None if parsed.quiet or as_json else sys.stdout)):
        with recorded() as folders, shown(io.StringIO() if parsed.quiet else None, verbose=parsed.verbose):
            code = int(run(parsed))
        for written in folders:
            kept = _keep(written.folder, list(written.names), parsed, said.getvalue(), line if report else None)
            if kept:
                print(f"also written: {', '.join(kept)}")
        _print_removed(folders)
    if as_json:
        entries = getattr(parsed, "summary", {})
        if folders and not entries:
            found = [{"folder": str(one.folder), **_summary(one.folder, list(one.names))} for one in folders]
            of_meshes = len(found) > 1 and hasattr(parsed, "mesh")  # one folder for each mesh
            entries = {"results": found} if of_meshes else found[-1]
        print(json.dumps({"exit_code": code, **entries}, indent=2))
    return code


def _print_removed(folders: Sequence[Written]) -> None:
    """Print which files of an earlier run were removed, because the results are others now."""
    for written in folders:
        names = [name for name in written.removed if not (written.folder / name).exists()]
        if names:
            print(f"removed from {written.folder} (of an earlier run with other results): {', '.join(names)}")


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


def _keep(folder: Path, names: list[str], parsed: argparse.Namespace, said: str, line: list[str] | None) -> list[str]:
    """Write the tables in other formats and the report; remove those of an earlier run that are not replaced."""
    if not parsed.format and line is None:
        return []
    import shlex
    from pathlib import Path

    from ..base.files import whole_set
    from ..output.exchange.tables import read_csv, write_tables

    tables = {Path(name).stem: read_csv(folder / name) for name in names if name.endswith(".csv")}
    with whole_set(folder) as made:
        if parsed.format and tables:
            write_tables(made, tables, parsed.format)
        if line is not None:
            from ..base.config import read_toml
            from ..output.report_page import PICTURES, Run
            from ..output.report_sheets import date_of, run_of
            from ..output.results import KINDS, read_results
            from .arguments import job_of
            from .reporting import heading_of, write_report

            job, command = job_of(parsed), shlex.join(["gearfe", *line])
            raw = {} if job is None else read_toml(job)
            # the folder may hold results of other commands
            table = next((kind.table for kind in KINDS if kind.table in names), None)
            if table is not None:
                run = run_of(read_results(folder / table, "--out"), command=command, said=said)
            else:
                pictures = {name: folder / name for name in names if Path(name).suffix in PICTURES}
                run = Run(
                    f"gearfe {line[0]}",
                    command,
                    said,
                    summary=_summary(folder, names),
                    tables=tables,
                    pictures=pictures,
                )
            title = f"gearfe {line[0]}" + ("" if job is None else f": {Path(job).name}")
            date = date_of(folder / names[0]) if names else ""
            write_report(made, heading_of(parsed, raw, title, date), [run], raw, None if job is None else str(job))
        return sorted(path.name for path in made.iterdir())


def _summary(folder: Path, names: list[str]) -> dict[str, Any]:
    """What the run left as JSON: its summary, or the one file that it wrote."""
    import json

    found = [name for name in names if name.endswith(".json")]
    chosen = "summary.json" if "summary.json" in found else next(iter(found), None)
    made: dict[str, Any] = {"files": names}
    return made if chosen is None else {**made, **json.loads((folder / chosen).read_text(encoding="utf-8"))}


def _drop_output() -> None:
    """Send what is left in the buffers nowhere: the interpreter would complain of it at its end."""
    from contextlib import suppress

    with suppress(OSError, ValueError, AttributeError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError):
                stream.flush()
                continue
            os.dup2(nowhere, stream.fileno())


if __name__ == "__main__":
    sys.exit(main())
