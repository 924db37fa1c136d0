"""What the ``gearfe`` program does: finds the command, runs it, turns user mistakes into one line and a code of 2."""

from __future__ import annotations

import importlib
import io
import os
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, TextIO

from .. import __version__
from ..errors import InputError, MissingLibraryError, NotFiniteWarning, unknown_name
from . import COMMANDS

TYPE_CHECKING = False  # the program's help and version need neither argparse nor tables
if TYPE_CHECKING:
    from .arguments import CommandParser

USAGE = "gearfe COMMAND ... ('gearfe COMMAND --help' tells a command's options)"


#: Commands that were, and where they went.
MOVED = {
    "microgeometry": "it is a load map of the same job file: gearfe loadmap, which takes [microgeometry]",
    "relief": "the best relief is a search of gearfe study: gearfe new relief.toml, gearfe study relief.toml",
    "benchmark": "in a copy of the repository: python scripts/benchmark.py",
    "stress": "in a copy of the repository: python scripts/stress.py",
}

#: Exit code where the reader of the output went away, as the shell's other tools give it (128 + SIGPIPE).
CLOSED = 141


def answer(arguments: list[str], run: Callable[[list[str]], int] | None = None) -> int:
    """Run one command, or `run`; return its exit code: that of `gearfe.cli.main`."""
    if isinstance(sys.stdout, io.TextIOWrapper):  # a code page that lacks a letter of a name; stderr does so by itself
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        code = _answered(arguments, run or _run)
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
    """Run, and report mistakes in one line."""
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
    print(f"gearfe: {message}", file=sys.stderr)
    return code


def _run(arguments: list[str]) -> int:
    if not arguments or arguments[0] in ("-h", "--help"):
        print(f"usage: {USAGE}\n")
        for name, (summary, _) in COMMANDS.items():
            print(f"  {name:<13} {summary}")
        return 0
    if arguments[0] in ("-V", "--version"):
        print(f"gearfe {__version__}")
        return 0
    if arguments[0] in MOVED:
        raise InputError("command", None, f"unknown name {arguments[0]!r}", MOVED[arguments[0]])
    if arguments[0] not in COMMANDS:
        raise unknown_name("command", arguments[0], COMMANDS)
    return run_command(command_module(arguments[0]), f"gearfe {arguments[0]}", *COMMANDS[arguments[0]], arguments[1:])


def run_command(module: Any, name: str, summary: str, example: str, arguments: list[str]) -> int:
    """Run a command module (its contract is in `gearfe.commands`), called by `name`, with these arguments."""
    from .arguments import with_changes
    from .common import run_and_keep, with_folder

    parser = parser_of(module, name, summary, example)
    parsed = with_folder(with_changes(parser.parse_args(arguments)))
    with _tables_watched() as messages:
        code = run_and_keep(module.run, parsed, [*name.split()[1:], *arguments])
        return code or int(bool(messages))


def parser_of(module: Any, name: str, summary: str, example: str) -> CommandParser:
    """Parser of a command module, called by `name`, with the options that all commands have."""
    from .arguments import CommandParser
    from .common import add_verbosity

    parser = CommandParser(prog=name, description=summary, example=example)
    module.add_arguments(parser)
    add_verbosity(parser)
    return parser


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


def _drop_output() -> None:
    """Send what is left in the buffers nowhere: the interpreter would complain of it at its end."""
    with suppress(OSError, ValueError, AttributeError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError):
                stream.flush()
                continue
            os.dup2(nowhere, stream.fileno())


def command_module(name: str) -> Any:
    """Module of a command (its contract is in `gearfe.commands`)."""
    return importlib.import_module(f".{name}", __package__)
