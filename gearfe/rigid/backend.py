"""Whether compiled kernels are at hand, and how much plain Python a one-off run may spend before compiling pays."""

from __future__ import annotations

from . import compiled, taylor
from .system import System

#: Measured: CPU seconds to compile the kernels, to load numba with the cached ones, and of a plain step with n bodies.
COMPILE_SECONDS = 50.0
LOAD_SECONDS = 0.4
STEP_SECONDS = (1.2e-3, 0.9e-3)


def compiled_is_ready() -> bool:
    """Whether compiled kernels are loaded already or wait in the cache."""
    if not compiled.available():
        return False
    return taylor.kernels_loaded() or compiled.is_cached(taylor.FUNCTIONS, "integrate_series")


def affordable_steps(system: System) -> int:
    """Plain steps that take about as long as compiling (or loading) the kernels; without numba there is no limit."""
    if not compiled.available():
        return 1_000_000
    bodies = system.size // 3
    price = LOAD_SECONDS if compiled_is_ready() else COMPILE_SECONDS
    return int(price / (STEP_SECONDS[0] + STEP_SECONDS[1] * bodies))
