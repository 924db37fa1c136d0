"""Binding of the kernels: compiled by numba with a cache of their own, or left as plain Python where that is quicker.

The kernel modules hold plain functions that call one another by name. `bind` puts them into one namespace, either as
compiled functions or as they are, so one text serves both. Compiled code is cached below
the user's cache folder under a hash of all kernel sources: no stale code after an upgrade, nothing written beside the
installed package, and a read-only home only costs the compilation again.
"""

from __future__ import annotations

import hashlib
import importlib.util
import inspect
import os
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from types import FunctionType, SimpleNamespace
from typing import Any


def available() -> bool:
    """Whether numba can be imported (it is not imported here)."""
    return os.environ.get("GEARFE_NO_NUMBA", "") in ("", "0") and importlib.util.find_spec("numba") is not None


def cache_folder(functions: Iterable[Callable[..., Any]]) -> Path | None:
    """Writable folder for the compiled forms of `functions`, named by a hash of their sources; ``None`` without one."""
    text = sys.version + Path(__file__).read_text() + "".join(inspect.getsource(f) for f in functions)
    name = "kernels-" + hashlib.sha256(text.encode()).hexdigest()[:16]
    base = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    user = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
    for root in (Path(base) / "gearfe", Path(tempfile.gettempdir()) / f"gearfe-{user}"):
        try:
            (root / name).mkdir(parents=True, exist_ok=True, mode=0o700)
            if hasattr(os, "getuid") and (root / name).stat().st_uid != os.getuid():
                continue
            with tempfile.TemporaryFile(dir=root / name):
                return root / name
        except OSError:
            continue
    return None


def is_cached(functions: Iterable[Callable[..., Any]], entry: str) -> bool:
    """Whether a compiled form of the function named `entry` waits in the cache."""
    folder = cache_folder(functions)
    return folder is not None and any(folder.rglob(f"*.{entry}-*.nbi"))


def bind(
    functions: Iterable[Callable[..., Any]],
    names: Mapping[str, Any],
    *,
    compiled: bool,
    entries: tuple[str, ...] = (),
    inline: tuple[str, ...] = (),
    alias: Mapping[str, str] | None = None,
) -> SimpleNamespace:
    """One namespace in which the `functions` see each other.

    Parameters
    ----------
    functions
        Plain functions that call each other by name.
    names
        Modules and constants that they use.
    compiled
        Compile with numba; otherwise plain Python.
    entries
        Names of the functions that are called from Python.
    inline
        Names of the functions that are copied into their callers: the small hot ones. A call costs compiled code some
        hundred nanoseconds here, for the reference counts of the many arrays it hands over.
    alias
        Further names: function -> the name under which others call it.
    """
    functions = tuple(functions)
    scope: dict[str, Any] = {"__builtins__": __builtins__, "__name__": __name__, **names}
    for function in functions:
        assert isinstance(function, FunctionType)
        scope[function.__name__] = FunctionType(function.__code__, scope, function.__name__, function.__defaults__)
    if compiled:
        _compile(functions, scope, entries, inline)
    for name, other in (alias or {}).items():
        scope[other] = scope[name]
    return SimpleNamespace(**{f.__name__: scope[f.__name__] for f in functions})


def _compile(
    functions: tuple[Callable[..., Any], ...], scope: dict[str, Any], entries: tuple[str, ...], inline: tuple[str, ...]
) -> None:
    """Only the entries get Python wrappers and a place in the cache: the others end up inside them."""
    import numba
    folder = cache_folder(functions)
    before = numba.config.CACHE_DIR
    common = {"fastmath": {"contract", "reassoc", "nsz"}, "error_model": "numpy"}
    try:
        numba.config.CACHE_DIR = str(folder or "")
        for function in functions:
            name = function.__name__
            made = scope[name]
            made.__module__ = function.__module__
            if name in entries:
                scope[name] = numba.njit(made, cache=folder is not None, no_cfunc_wrapper=True, **common)
            else:
                scope[name] = numba.njit(made, no_cpython_wrapper=True, no_cfunc_wrapper=True, forceinline=name in inline, **common)
    finally:
        numba.config.CACHE_DIR = before
