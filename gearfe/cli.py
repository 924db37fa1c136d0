"""The ``gearfe`` program: finds the command, runs it, turns user mistakes into one line and an exit code of 2."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence

from . import __version__
from .commands import COMMANDS
from .errors import InputError, MissingLibraryError, unknown_name

USAGE = "gearfe COMMAND ... ('gearfe COMMAND --help' tells a command's options)"


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; return its exit code: 0 done, 1 done with failures, 2 bad input, 130 interrupted."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    if not arguments or arguments[0] in ("-h", "--help"):
        print(f"usage: {USAGE}\n")
        for name in COMMANDS:
            print(f"  {name:<12} {_module(name).HELP}")
        return 0
    if arguments[0] in ("-V", "--version"):
        print(f"gearfe {__version__}")
        return 0
    try:
        if arguments[0] not in COMMANDS:
            raise unknown_name("command", arguments[0], COMMANDS)
        module = _module(arguments[0])
        parser = argparse.ArgumentParser(prog=f"gearfe {arguments[0]}", description=module.HELP)
        module.add_arguments(parser)
        return int(module.run(parser.parse_args(arguments[1:])))
    except (InputError, MissingLibraryError) as error:
        print(f"gearfe: error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("gearfe: interrupted", file=sys.stderr)
        return 130
    except OSError as error:
        print(
            f"gearfe: error: {error.filename or 'a file cannot be written or read'}: {error.strerror or error}",
            file=sys.stderr,
        )
        return 2


def _module(name: str):  # type: ignore[no-untyped-def]
    return importlib.import_module(f".commands.{COMMANDS[name]}", __package__)


if __name__ == "__main__":
    sys.exit(main())
