"""Keep code and settings that lie in the working folder out of the program, its libraries and its child processes.

A job is often run in the folder in which it arrived, beside files of strangers. Python imports modules from there in
three cases. ``python -m`` and ``python -c`` put the working folder first on the path of modules. A relative or empty
entry of ``PYTHONPATH`` refers to it. Child processes repeat both (multiprocessing starts them by ``python -c``).
Libraries read settings there: matplotlib ``matplotlibrc``, numba ``.numba_config.yaml``, ezdxf ``ezdxf.ini``.

The program cannot protect modules that Python loads before its first line. These are some modules of the standard
library for ``python -m gearfe``, and ``encodings`` and ``sitecustomize`` with a relative ``PYTHONPATH``. Without such
an entry, the program ``gearfe`` and ``python -P -m gearfe`` have no such gap.

This module and the package's first lines import nothing that is not loaded already, not even ``__future__``.
"""

import os
import sys

TYPE_CHECKING = False  # `typing` itself would be a third of the program's start
if TYPE_CHECKING:
    from types import ModuleType
    from typing import Self

#: A folder of this package without modules, in which libraries load and child processes start.
EMPTY = os.path.join(os.path.dirname(os.path.abspath(__file__)), "settings")


def leave_working_folder(*, module: bool = False) -> None:
    """Take the working folder off the path of modules, and users' settings off the pictures; for the program alone.

    A folder that an absolute entry of ``PYTHONPATH`` or an installed package names stays.

    Parameters
    ----------
    module
        Whether ``python -m`` runs the program, which puts the working folder first.
    """
    if module and not sys.flags.safe_path:
        del sys.path[0]
    relative: set[str] = set()
    if not sys.flags.ignore_environment:
        entries = (os.environ.get("PYTHONPATH") or os.sep).split(os.pathsep)
        relative = {os.path.abspath(entry) for entry in entries if not os.path.isabs(entry)}
    sys.path[:] = [entry for entry in sys.path if os.path.isabs(entry) and entry not in relative]
    os.environ["MATPLOTLIBRC"] = os.path.join(EMPTY, "matplotlibrc.program")
    os.environ["MPLBACKEND"] = "agg"


class away:
    """Context in which the working folder of this process is `EMPTY`.

    All threads of a process share its working folder, so the context holds imports and starts of processes only.
    """

    def __enter__(self) -> "Self":
        try:
            self._before = os.getcwd()
        except OSError:  # it was removed: nothing is found there
            self._before = ""
        os.chdir(EMPTY)
        return self

    def __exit__(self, *_: object) -> None:
        if self._before:
            os.chdir(self._before)


def load(name: str) -> "ModuleType":
    """Import a library that reads settings from the working folder, without these.

    Raises
    ------
    ImportError
        Where it is not installed.
    """
    from importlib import import_module

    with away():
        return import_module(name)
