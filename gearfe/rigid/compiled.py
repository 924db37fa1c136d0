"""Binding of the kernels: compiled by numba with a cache of their own, or left as plain Python where that is quicker.

The kernel modules hold plain functions that call one another by name. `bind` puts them into one namespace, either as
compiled functions or as they are, so one text serves both. Compiled code is kept in the cache folder
(`gearfe.cache`) below a hash of all that it was made from and for: no stale code after an upgrade, one form for all
installations of the same sources, nothing written beside the installed package.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import platform
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from types import FunctionType, SimpleNamespace
from typing import Any

from .. import cache
from .parts import part_options

#: One text of all sources in the folder of compiled code: numba files compiled code under the path of its source.
SOURCE = "kernels.py"


def available() -> bool:
    """Whether numba can be imported (it is not imported here)."""
    return os.environ.get("GEARFE_NO_NUMBA", "") in ("", "0") and importlib.util.find_spec("numba") is not None


def cache_folder(functions: Iterable[Callable[..., Any]]) -> Path | None:
    """Writable folder for the compiled forms of `functions`; ``None`` without one.

    Where the user names no folder and has none that can be written, a temporary one of this user serves.
    """
    text = _text(functions)
    for root in _roots():
        key = "\n".join((str(root), *_made_by(), text))
        folder = root / ("kernels-" + hashlib.sha256(key.encode()).hexdigest()[:16])
        try:
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            if hasattr(os, "getuid") and folder.stat().st_uid != os.getuid():
                continue
            with tempfile.TemporaryFile(dir=folder):
                return folder
        except OSError:
            continue
    return None


def _text(functions: Iterable[Callable[..., Any]]) -> str:
    """Names of the functions, and the modules that hold them."""
    functions = tuple(functions)
    files = dict.fromkeys(f.__code__.co_filename for f in functions if isinstance(f, FunctionType))
    names = [f"# {f.__module__}.{f.__qualname__}" for f in functions]
    return "\n".join([*names, *(Path(file).read_text(encoding="utf-8") for file in files)])


def _roots() -> list[Path]:
    """Folders that may hold the cache, best first."""
    try:
        first = cache.cache_folder()
    except RuntimeError:  # a user without a home
        first = None
    if cache.named_folder():
        return [] if first is None else [first.absolute()]
    user = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
    temporary = Path(tempfile.gettempdir()) / f"gearfe-{user}"
    return [temporary] if first is None else [first.absolute(), temporary]


def _made_by() -> Iterator[str]:
    """What decides compiled code beside its source: Python, the compiler, the processor."""
    yield sys.version
    for maker in ("compiled.py", "packed.py", "packed_type.py", "parts.py"):
        yield Path(__file__).with_name(maker).read_text(encoding="utf-8")
    for name in ("numba", "llvmlite"):
        found = importlib.util.find_spec(name)
        place = Path(found.origin).parent / "_version.py" if found is not None and found.origin else None
        yield place.read_text(encoding="utf-8") if place is not None and place.exists() else ""
    yield from (f"{k}={v}" for k, v in sorted(os.environ.items()) if k.startswith("NUMBA_"))
    yield f"{platform.system()} {platform.machine()} {os.environ.get('PROCESSOR_IDENTIFIER', '')}"
    try:
        with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as lines:
            for line in lines:
                if line.startswith(("model name", "flags", "Features", "CPU part")):
                    yield line
                if not line.strip():  # the first processor stands for all
                    break
    except OSError:  # not Linux
        return


def is_cached(functions: Iterable[Callable[..., Any]], entry: str) -> bool:
    """Whether a compiled form of the function named `entry` waits in the cache, for this machine and these sources."""
    folder = cache_folder(functions)
    return folder is not None and any(folder.rglob(f"*.{entry}-*.nbc"))


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
    """Only the entries get Python wrappers and a place in the cache: the others end up inside them.

    Without numba's reference counts, so kernels allocate nothing: they compile and run a sixth faster.
    """
    import numba

    folder = cache_folder(functions)
    source = None if folder is None else _source(folder, functions)
    before = numba.config.CACHE_DIR
    common = {"fastmath": {"contract", "reassoc", "nsz"}, "error_model": "numpy", "_nrt": False}
    try:
        numba.config.CACHE_DIR = str(folder or "")
        for function in functions:
            name = function.__name__
            made = scope[name]
            made.__module__ = function.__module__
            if name in entries:
                if source is not None:
                    made.__code__ = made.__code__.replace(co_filename=str(source))
                scope[name] = numba.njit(made, cache=source is not None, no_cfunc_wrapper=True, **common)
            else:
                inlined = {"forceinline": name in inline}
                scope[name] = numba.njit(
                    made, no_cpython_wrapper=True, no_cfunc_wrapper=True, **inlined, **part_options(), **common
                )
    finally:
        numba.config.CACHE_DIR = before


def _source(folder: Path, functions: tuple[Callable[..., Any], ...]) -> Path | None:
    """File with the text of the functions in their folder; None where it cannot be written."""
    path = folder / SOURCE
    try:
        if not path.exists():
            with tempfile.NamedTemporaryFile("w", dir=folder, encoding="utf-8", delete=False) as file:
                file.write(_text(functions))
            os.replace(file.name, path)
    except OSError:
        return None
    return path
