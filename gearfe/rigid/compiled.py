"""Binding of the kernels: compiled by numba with a cache of their own, or left as plain Python where that is quicker.

The kernel modules hold plain functions that call one another by name. `bind` puts them into one namespace, either as
compiled functions or as they are, so one text serves both. Compiled code (`gearfe.rigid.native`) is kept in the cache
folder (`gearfe.cache`) below a hash of all that it was made from and for: no stale code after an upgrade, one form for
all installations of the same sources, nothing written beside the installed package.
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
from functools import cached_property, lru_cache
from pathlib import Path
from types import FunctionType, SimpleNamespace
from typing import TYPE_CHECKING, Any

from .. import cache
from ..environment import named_folder, without_numba
from ..progress import stage
from .native import Entry, ObjectCode, import_numba
from .parts import part_options, uncollected

if TYPE_CHECKING:
    from .packed import Layout


#: Seconds of loading kernels of an earlier run (measured).
LOAD_SECONDS = 0.05


def available() -> bool:
    """Whether numba can be imported (it is not imported here)."""
    return not without_numba() and _installed()


@lru_cache(maxsize=1)
def _installed() -> bool:
    return importlib.util.find_spec("numba") is not None


def cache_folder(functions: Iterable[Callable[..., Any]]) -> Path | None:
    """Writable folder for the compiled forms of `functions`; ``None`` without one.

    Where the user names no folder and has none that can be written, a temporary one of this user serves.
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
    """Where the compiled forms of `functions` may be, best first; they need not exist."""
    options = tuple(f"{k}={v}" for k, v in sorted(os.environ.items()) if k.startswith("NUMBA_"))
    for root in _roots():
        yield root / ("kernels-" + _key(str(root), tuple(functions), options))


@lru_cache(maxsize=64)
def _key(root: str, functions: tuple[Callable[..., Any], ...], options: tuple[str, ...]) -> str:
    """What decides compiled code, as a name; neither sources nor the machine change while a program runs."""
    key = "\n".join((root, *_made_by(), *options, _text(functions)))
    return hashlib.sha256(key.encode()).hexdigest()[:16]


def _text(functions: Iterable[Callable[..., Any]]) -> str:
    """Names of the functions, and the modules that hold them."""
    functions = tuple(functions)
    files = dict.fromkeys(f.__code__.co_filename for f in functions if isinstance(f, FunctionType))
    names = [f"# {f.__module__}.{f.__qualname__}" for f in functions]
    return "\n".join([*names, *(Path(file).read_text(encoding="utf-8") for file in files)])


def _roots() -> list[Path]:
    """Folders that may hold the cache, best first."""
    first = cache.cache_folder()
    if named_folder():
        return [] if first is None else [first.absolute()]
    user = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
    temporary = Path(tempfile.gettempdir()) / f"gearfe-{user}"
    return [temporary] if first is None else [first.absolute(), temporary]


def _made_by() -> Iterator[str]:
    """What decides compiled code beside its source: Python, the compiler, the processor."""
    yield sys.version
    for maker in ("compiled.py", "native.py", "packed.py", "packed_type.py", "lanes.py", "lanes_type.py", "parts.py"):
        yield Path(__file__).with_name(maker).read_text(encoding="utf-8")
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
    """Whether a compiled form of the function named `entry` waits in the cache, for this machine and these sources."""
    folder = next((f for f in _folders(functions) if f.is_dir()), None)
    return folder is not None and any(folder.glob(f"{entry}-*.o"))


def bind(
    functions: Iterable[Callable[..., Any]],
    names: Mapping[str, Any],
    *,
    compiled: bool,
    entries: tuple[str, ...] = (),
    inline: tuple[str, ...] = (),
    alias: Mapping[str, str] | None = None,
) -> SimpleNamespace:
    """The `functions` in one namespace in which they see each other; compiled, the entries alone.

    Parameters
    ----------
    functions
        Plain functions that call each other by name.
    names
        Modules and constants that they use.
    compiled
        Compile with numba; otherwise plain Python.
    entries
        Names of the functions that are called from Python. They take named tuples, compiled their blocks
        (`gearfe.rigid.packed.Packed`), and return an integer.
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
    if not compiled:
        return SimpleNamespace(**{f.__name__: scope[f.__name__] for f in functions})
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
    """The kernels of a loop, bound plain or compiled where they are first wanted.

    Parameters
    ----------
    functions, names, entries, inline, alias
        See `bind`.
    making
        Seconds that compiling them takes (measured).
    """

    functions: tuple[Callable[..., Any], ...]
    names: Mapping[str, Any]
    entries: tuple[str, ...]
    inline: tuple[str, ...] = ()
    alias: Mapping[str, str] | None = None
    making: float = 10.0
    loaded: bool = False  # whether the compiled ones are in this process

    @cached_property
    def plain(self) -> SimpleNamespace:
        """As they are."""
        return bind(self.functions, self.names, compiled=False, alias=self.alias)

    @cached_property
    def compiled(self) -> SimpleNamespace:
        """Their entries, compiled or from the cache at their first call."""
        return bind(
            self.functions, self.names, compiled=True, entries=self.entries, inline=self.inline, alias=self.alias
        )

    @property
    def ready(self) -> bool:
        """Whether compiled ones are loaded already or wait in the cache."""
        return self.loaded or (available() and is_cached(self.functions, self.entries[0]))

    @property
    def seconds(self) -> float:
        """What there is to pay before the first compiled step."""
        return 0.0 if self.loaded else LOAD_SECONDS if self.ready else self.making

    def load(self, run: Callable[[], object]) -> float:
        """Compile them, or load them, by a run of no length; seconds that this took."""
        if self.loaded:
            return 0.0
        began = time.perf_counter()
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
