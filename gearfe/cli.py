"""The ``gearfe`` program: finds the command and runs it, turns user mistakes into one line and a code of 2.

It listens to Ctrl-C from its first lines on; what takes time is imported after that, and help and version need nothing.
"""

from __future__ import annotations

import io
import os
import sys

TYPE_CHECKING = False  # `typing` itself would be a third of the program's start
if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from types import FrameType

USAGE = "gearfe COMMAND ... ('gearfe COMMAND --help' tells a command's options)"

#: Commands that were, and where they went.
MOVED = {
    "microgeometry": "it is a load map of the same job file: gearfe loadmap, which takes [microgeometry]",
    "relief": "the best relief is a search of gearfe study: gearfe new relief.toml, gearfe study relief.toml",
    "benchmark": "in a copy of the repository: python scripts/benchmark.py",
    "stress": "in a copy of the repository: python scripts/stress.py",
}

#: Exit codes as shells give them (128 + signal): of an interrupted program (SIGINT), and where the reader of the output
#: went away (SIGPIPE).
INTERRUPTED, CLOSED = 130, 141


class Interrupted(KeyboardInterrupt):
    """Ctrl-C.

    Not KeyboardInterrupt itself: where that one leaves source text that is executed, and standard modules make their
    classes so, CPython ends the process by the signal, whatever handles it later (``run_eval_code_obj``).
    """


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; return its exit code.

    0 done, 1 done with failures, 2 bad input, 130 interrupted, 141 the reader of the output closed it.
    """
    listening = False
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
    """Exit code of `run` with these arguments; mistakes are told in one line."""
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
    from .errors import InputError, MissingLibraryError

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
    """Help, version, or the command that the first argument names."""
    from . import __version__
    from .commands import COMMANDS
    from .errors import InputError, unknown_name

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
    from .commands.common import command_module, run_command

    return run_command(command_module(arguments[0]), f"gearfe {arguments[0]}", *COMMANDS[arguments[0]], arguments[1:])


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
