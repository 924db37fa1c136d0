"""Binding of the kernels: compiled by numba, with a cache of their own.

The kernel modules hold plain functions that call one another by name. `bind` puts them into one namespace and compiles
those that Python calls. With `NUMBA_DISABLE_JIT=1` in the environment, numba's own switch for debugging, they stay
Python functions: a debugger steps through them, some hundred times slower.

Compiled code (`multibody.compiled.object_code`) is kept in the cache folder (`gearfe.base.cache`) under a hash of its
sources, the compiler and the processor. No code is stale after an upgrade, all installations of the same sources share
one form, and nothing is written to the installed package.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import platform
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from functools import cached_property, lru_cache, partial
from pathlib import Path
from types import FunctionType, SimpleNamespace
from typing import Any

from ...base import cache
from ...base.environment import interpreted, named_folder
from ...base.progress import announce, stage
from .object_code import Entry, ObjectCode, import_numba
from .packed import Layout, Packed
from .parts import part_options, uncollected

COMPILING = "compiling the kernels, once for this version: about a quarter of a minute (gearfe cache --compile)"


class Interpreted:
    """A kernel left as a Python function, called as a compiled one: with the named tuples of `packed`."""

    def __init__(self, function: Callable[..., int]) -> None:
        self.function = function

    def __call__(self, *named: Any) -> int:
        return self.function(*named)

    def on(self, *named: Any) -> Callable[[], int]:
        """The function of these arguments, for many calls."""
        return partial(self.function, *named)


def packed(named: Any) -> Any:
    """A named tuple as kernels get it: as one block, or itself where they are interpreted."""
    return named if interpreted() else Packed(named)


def cache_folder(functions: Iterable[Callable[..., Any]]) -> Path | None:
    """Writable folder for the compiled forms of `functions`; ``None`` without one.

    Falls back to a temporary folder of the user if no cache folder is named or writable.
    """
    for folder in _folders(functions):
        try:
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            if hasattr(os, "getuid") and folder.stat().st_uid != os.getuid():
                continue
            with tempfile.TemporaryFile(dir=folder):
                return folder
        except OSError:
            continue
    return None


def _folders(functions: Iterable[Callable[..., Any]]) -> Iterator[Path]:
    """Return the possible folders of the compiled forms of `functions`, best first; they need not exist."""
    options = tuple(f"{k}={v}" for k, v in sorted(os.environ.items()) if k.startswith("NUMBA_"))
    name = "kernels-" + _key(tuple(functions), options)
    for root in _roots():
        yield root / name


@lru_cache(maxsize=64)
def _key(functions: tuple[Callable[..., Any], ...], options: tuple[str, ...]) -> str:
    """Return the key of compiled code, as a name; sources and machine do not change while a program runs."""
    key = "\n".join((*_made_by(), *options, _text(functions)))
    return hashlib.sha256(os.fsencode(key)).hexdigest()[:16]  # variables may have values that are no text


def _text(functions: Iterable[Callable[..., Any]]) -> str:
    """Names of the functions, the modules that hold them, and the constants that are compiled in from other modules."""
    functions = tuple(functions)
    files = dict.fromkeys(f.__code__.co_filename for f in functions if isinstance(f, FunctionType))
    names = [f"# {f.__module__}.{f.__qualname__}" for f in functions]
    return "\n".join([*names, *_constants(functions), *(Path(file).read_text(encoding="utf-8") for file in files)])


def _constants(functions: Iterable[Callable[..., Any]]) -> Iterator[str]:
    """Return the global numbers, texts, arrays and enumerations that the functions use, with their values."""
    for f in functions:
        used = f.__code__.co_names if isinstance(f, FunctionType) else ()
        for name in used:
            value: Any = f.__globals__.get(name)
            if isinstance(value, type) and issubclass(value, Enum):
                value = [(member.name, member.value) for member in value]
            elif hasattr(value, "tobytes"):
                value = value.dtype.str, value.shape, value.tobytes()
            elif not _plain(value):
                continue
            yield f"# {f.__qualname__}: {name} = {value!r}"


def _plain(value: Any) -> bool:
    """Whether a value is a number, a text or a tuple of such, whose text is the same in every process."""
    return isinstance(value, int | float | complex | str) or (isinstance(value, tuple) and all(map(_plain, value)))


def _roots() -> list[Path]:
    """Folders that may hold the cache, best first."""
    first = cache.cache_folder()
    if named_folder():
        return [] if first is None else [first.absolute()]
    user = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
    temporary = Path(tempfile.gettempdir()) / f"gearfe-{user}"
    return [temporary] if first is None else [first.absolute(), temporary]


def _made_by() -> Iterator[str]:
    """Return the versions that determine compiled code besides its source: Python, compiler, processor."""
    yield sys.version
    for maker in sorted(Path(__file__).parent.glob("*.py")):
        yield maker.read_text(encoding="utf-8")
    for name in ("numba", "llvmlite"):
        found = importlib.util.find_spec(name)
        place = Path(found.origin).parent / "_version.py" if found is not None and found.origin else None
        yield place.read_text(encoding="utf-8") if place is not None and place.exists() else ""
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
    """Return whether the cache holds a compiled form of `entry` for this machine and these sources."""
    folder = next((f for f in _folders(functions) if f.is_dir()), None)
    return folder is not None and any(folder.glob(f"{entry}-*.o"))


def bind(
    functions: Iterable[Callable[..., Any]],
    names: Mapping[str, Any],
    *,
    entries: tuple[str, ...] = (),
    inline: tuple[str, ...] = (),
    alias: Mapping[str, str] | None = None,
) -> SimpleNamespace:
    """The `functions` in one namespace in which they see each other: the entries compiled, or all as they are.

    Parameters
    ----------
    functions
        Plain functions that call each other by name.
    names
        Modules and constants that they use.
    entries
        Names of the functions that are compiled to be called from Python. They take what `packed` makes of named tuples
        and return an integer. Without any, all functions are left as they are.
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
    for name, other in (alias or {}).items():
        scope[other] = scope[name]
    if not entries:
        return SimpleNamespace(**{f.__name__: scope[f.__name__] for f in functions})
    if interpreted():
        return SimpleNamespace(**{name: Interpreted(scope[name]) for name in entries})
    parts = [f.__name__ for f in functions if f.__name__ not in entries]
    folder = cache_folder(functions)

    @lru_cache(maxsize=1)
    def translated() -> None:
        for name in parts:
            scope[name] = _part(scope[name], name in inline)
        for name, other in (alias or {}).items():
            scope[other] = scope[name]

    def made(name: str) -> Entry:
        def make(layouts: tuple[Layout, ...]) -> ObjectCode:
            translated()
            return _entry(scope[name], layouts)

        return Entry(name, folder, make)

    return SimpleNamespace(**{name: made(name) for name in entries})


@dataclass(eq=False)
class Kernels:
    """The kernels of a loop, bound where they are first wanted.

    Parameters
    ----------
    functions, names, entries, inline, alias
        See `bind`.
    """

    functions: tuple[Callable[..., Any], ...]
    names: Mapping[str, Any]
    entries: tuple[str, ...]
    inline: tuple[str, ...] = ()
    alias: Mapping[str, str] | None = None
    loaded: bool = False  # whether the compiled ones are in this process

    @cached_property
    def python(self) -> SimpleNamespace:
        """All functions as Python, for those that are called a few times in a run."""
        return bind(self.functions, self.names, alias=self.alias)

    @cached_property
    def compiled(self) -> SimpleNamespace:
        """Return the entries of the kernels, compiled or from the cache at their first call."""
        return bind(self.functions, self.names, entries=self.entries, inline=self.inline, alias=self.alias)

    @property
    def ready(self) -> bool:
        """Return whether compiled kernels are loaded or in the cache."""
        return self.loaded or interpreted() or is_cached(self.functions, self.entries[0])

    def load(self, run: Callable[[], object]) -> float:
        """Compile them, or load them, by a run of no length; seconds that this took."""
        if self.loaded:
            return 0.0
        began = time.perf_counter()
        if not self.ready:
            announce(COMPILING)
        with stage("compiling the kernels", apart=True), uncollected():
            run()
        self.loaded = True
        return time.perf_counter() - began


#: Without numba's reference counts, so kernels allocate nothing: they compile and run a sixth faster.
OPTIONS: dict[str, Any] = {
    "fastmath": {"contract", "reassoc", "nsz"}, "error_model": "numpy", "_nrt": False,
    "no_cpython_wrapper": True, "no_cfunc_wrapper": True,
}  # fmt: skip


def _part(function: FunctionType, inline: bool) -> Any:
    """A function that entries contain; it is translated when they are."""
    numba = import_numba()
    made = numba.njit(function, forceinline=inline, **part_options(), **OPTIONS)
    template = made.get_call_template

    def of_any_number(args: Any, kws: Any) -> Any:
        """Not once more for each number that stands in a call."""
        return template(tuple(map(numba.types.unliteral, args)), kws)

    made.get_call_template = of_any_number
    return made


def _entry(function: FunctionType, layouts: tuple[Layout, ...]) -> ObjectCode:
    """Machine code of a function of blocks: the object file that numba's own cache would keep."""
    numba = import_numba()
    from llvmlite import binding

    from .packed_type import PackedType

    blocks = tuple(map(PackedType, layouts))
    made = numba.njit(function, **OPTIONS)
    made.compile(blocks)
    result = made.overloads[blocks]
    _, _, (code, _) = result.library.serialize_using_object_code()
    module = binding.parse_bitcode(result.library.serialize_using_bitcode()[2])
    calls = [f.name for f in module.functions if f.is_declaration and not f.name.startswith("llvm.")]
    return ObjectCode(code, result.fndesc.llvm_func_name, tuple(calls))
