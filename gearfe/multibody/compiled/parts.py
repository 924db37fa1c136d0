"""Compiling functions that are only ever parts of others.

Numba optimises and emits every function with all that it calls, and again inside each of its callers. The kernels of
mechanisms took 46 s that way. A part is only translated into LLVM's language here; the entries, which Python calls, are
optimised and emitted once, with all their parts in them.

This rests on numba's custom pipelines (numba manual, "Customizing the compiler") and on two methods of its code library
that are not public. A numba without them compiles as it always does.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import Any


@contextmanager
def uncollected() -> Iterator[None]:
    """Without Python's search for reference cycles, a tenth of the time of a compilation, which makes few."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


@lru_cache(maxsize=1)
def part_options() -> dict[str, Any]:
    """Options of `numba.njit` for a part."""
    try:
        return {"pipeline_class": _part_compiler()}
    except (ImportError, AttributeError, ValueError):
        return {}


def _part_compiler() -> Any:
    """Numba's compiler of functions, except for what happens to LLVM's code."""
    from numba.core.codegen import JITCodeLibrary
    from numba.core.compiler import CompilerBase, DefaultPassBuilder
    from numba.core.compiler_machinery import LoweringPass, register_pass
    from numba.core.typed_passes import NativeLowering

    if not {"_optimize_final_module", "_finalize_final_module"} <= set(dir(JITCodeLibrary)):
        raise AttributeError("JITCodeLibrary")

    class Unemitted:
        """Code generator of a part: what is not emitted has no place for an environment."""

        def __init__(self, codegen: Any) -> None:
            self._codegen = codegen

        def __getattr__(self, name: str) -> Any:
            return getattr(self._codegen, name)

        def set_env(self, name: str, environment: Any) -> None:
            pass

    class PartLibrary(JITCodeLibrary):
        """Code of a part and of the parts in it, as translated."""

        def _optimize_final_module(self) -> None:
            pass

        def _finalize_final_module(self) -> None:
            self._finalize_dynamic_globals()
            self._finalized = True

        @property
        def codegen(self) -> Any:
            return Unemitted(super().codegen)

    @register_pass(mutates_CFG=False, analysis_only=True)
    class OpenPart(LoweringPass):
        """Give the lowering a library for a part to write to."""

        _name = "open_part"

        def __init__(self) -> None:
            LoweringPass.__init__(self)

        def run_pass(self, state: Any) -> bool:
            state.library = PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
            return False

    class PartCompiler(CompilerBase):
        def define_pipelines(self) -> list[Any]:
            manager = DefaultPassBuilder.define_nopython_pipeline(self.state)
            passes = [entry[0] for entry in manager.passes]
            manager.add_pass_after(OpenPart, passes[passes.index(NativeLowering) - 1])
            manager.finalize()
            return [manager]

    return PartCompiler
