"""How the scripts of the repository run what no user's command is: as the program runs its commands."""

from __future__ import annotations

import sys
from functools import partial
from types import ModuleType

from gearfe.cli.main import INTERRUPTED, answer, run_command


def answered(module: ModuleType, name: str, arguments: list[str] | None = None) -> int:
    """Exit code of a module with ``HELP``, ``add_arguments`` and ``run`` (see `gearfe.cli`), called by `name`."""
    try:
        return answer(
            sys.argv[1:] if arguments is None else arguments, partial(run_command, module, name, module.HELP, "")
        )
    except KeyboardInterrupt:
        print(f"{name}: interrupted", file=sys.stderr)
        return INTERRUPTED
