"""Whether compiled kernels are at hand, and what they cost beside plain Python."""

from __future__ import annotations

from . import compiled, taylor

#: Measured (processor seconds): compiling the kernels, loading those of an earlier run; and how many times
#: as fast as plain steps compiled ones are (170 with one body, 200 with seven).
COMPILE_SECONDS, LOAD_SECONDS = 15.0, 0.05
#: Seconds of compiling the kernels of general systems.
GENERAL_SECONDS = 10.0
COMPILED_FASTER = 180.0

_SPENT = [0.0]


def compiled_is_ready() -> bool:
    """Whether compiled kernels are loaded already or wait in the cache."""
    if not compiled.available():
        return False
    return taylor.kernels_loaded() or compiled.is_cached(taylor.FUNCTIONS, "integrate_series")


def loading_seconds() -> float:
    """Seconds before the first compiled step."""
    if taylor.kernels_loaded():
        return 0.0
    return LOAD_SECONDS if compiled_is_ready() else COMPILE_SECONDS


def plain_seconds_spent() -> float:
    """What plain steps have cost in this process: from the price of the kernels on, these would have paid."""
    return _SPENT[0]


def spend_plain_seconds(seconds: float) -> None:
    """Add to them."""
    _SPENT[0] += seconds
