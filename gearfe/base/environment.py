"""Environment variables that the program reads, checked before it works; light, for the program looks at each start."""

from __future__ import annotations

import math
import os

from .errors import InputError

#: Folder of what is kept on disk (``off`` keeps nothing), and the largest size of all entries (MB).
CACHE_VARIABLE, LIMIT_VARIABLE = "GEARFE_CACHE", "GEARFE_CACHE_LIMIT_MB"
#: Numba's own switch: 1 leaves the kernels of mechanisms and trains as Python functions, for debugging.
NUMBA_VARIABLE = "NUMBA_DISABLE_JIT"
#: Numba's number of threads, which it refuses with a traceback where it is not > 0.
THREADS_VARIABLE = "NUMBA_NUM_THREADS"
#: Digits of a number of threads; the largest machines have some thousand.
MOST_DIGITS = 5
#: The switch that this program had before.
GONE_VARIABLE = "GEARFE_NO_NUMBA"
#: Largest size of all entries where none is given (bytes), and largest one that can be given (MB).
LIMIT, MOST_MB = 10**9, 1e12


def named_folder() -> str:
    """Return the folder that the user names for what is kept: an absolute path, ``off``, or nothing.

    Code is kept there, too, so it does not depend on the working folder.

    Raises
    ------
    InputError
        For a relative path, a file, and the home of an unknown user.
    """
    named = os.environ.get(CACHE_VARIABLE, "").strip()
    if not named or named.lower() == "off":
        return named.lower()
    path, cure = os.path.expanduser(named), "give the full path of a folder, or off, or leave it out"
    if path.startswith("~"):
        raise InputError(CACHE_VARIABLE, named, "names the home folder of a user that is unknown here", cure)
    if not os.path.isabs(path):
        raise InputError(CACHE_VARIABLE, named, "must be an absolute path", cure)
    if os.path.isfile(path):
        raise InputError(CACHE_VARIABLE, named, "is a file", cure)
    return path


def limit() -> int:
    """Return the largest size of all entries (bytes).

    Raises
    ------
    InputError
        For what is no number from 0 on.
    """
    text = os.environ.get(LIMIT_VARIABLE, "").strip()
    try:
        size = float(text) if text else 1e-6 * LIMIT
    except ValueError:
        size = math.nan
    if not 0.0 <= size <= MOST_MB:
        problem = f"must be a number >= 0 and <= {MOST_MB:g}"
        raise InputError(LIMIT_VARIABLE, text, problem, "give megabytes, or leave it out for 1000")
    return round(1e6 * size)


def interpreted() -> bool:
    """Return whether numba's switch `NUMBA_DISABLE_JIT` leaves the kernels as Python functions.

    Raises
    ------
    InputError
        For a value that is neither 0 nor 1, and for the switch that this one replaces.
    """
    if os.environ.get(GONE_VARIABLE, "").strip() not in ("", "0"):
        cure = f"remove it, or set {NUMBA_VARIABLE}=1 to debug kernels"
        raise InputError(GONE_VARIABLE, os.environ[GONE_VARIABLE], "was removed: numba is always there", cure)
    text = os.environ.get(NUMBA_VARIABLE, "").strip()
    if text not in ("", "0", "1"):
        raise InputError(
            NUMBA_VARIABLE, text, "must be 0 or 1", "1 leaves the kernels as Python functions, for debugging"
        )
    return text == "1"


def check_threads() -> None:
    """Raise `InputError` where numba's number of threads is no whole number > 0; left empty, numba chooses it."""
    text = os.environ.get(THREADS_VARIABLE, "")
    if not text.strip():
        os.environ.pop(THREADS_VARIABLE, None)  # numba takes an empty text for a mistake
        return
    digits = text.strip().lstrip("0")
    if not (digits.isascii() and digits.isdecimal() and len(digits) <= MOST_DIGITS):
        raise InputError(
            THREADS_VARIABLE,
            text,
            f"must be a whole number > 0 of up to {MOST_DIGITS} digits",
            "leave it out: numba counts the processors",
        )


def user_folder(variable: str) -> str:
    """Folder that a variable of the system names; empty where it names none by its full path (XDG base directories)."""
    named = os.environ.get(variable, "")
    return named if os.path.isabs(named) else ""


def check() -> None:
    """Raise `InputError` for a variable of this program whose value is wrong."""
    named_folder()
    limit()
    interpreted()
    check_threads()
