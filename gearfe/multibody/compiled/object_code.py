"""Machine code of kernels: made by numba once, kept as an object file, linked into later processes by LLVM alone.

Numba's own cache of compiled code needs all of numba to be read: 0.6 s of imports and tables of types in every process.
An entry takes the addresses of blocks (`multibody.compiled.packed`) and returns an integer. Its code is a C function of
pointers. llvmlite links its object file in milliseconds after 0.04 s of import. Numba's functions put two pointers
before the arguments, to the result and to an exception, and return a status (numba/core/callconv.py).
"""

from __future__ import annotations

import ctypes
import hashlib
import json
import os
import sys
import tempfile
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...base.isolation import load

if TYPE_CHECKING:
    from .packed import Layout, Packed

#: What linked code needs as long as the process runs, and one link at a time.
_ENGINES: list[Any] = []
_LINKING = threading.Lock()
#: Bytes of the digest before the content of a file: machine code that was cut short would end the process.
DIGEST = hashlib.sha256().digest_size


@dataclass(frozen=True)
class ObjectCode:
    """An object file, the name of its function, and the functions of others that it calls."""

    code: bytes
    name: str
    calls: tuple[str, ...]


class _Call:
    """A call of compiled code. It owns its blocks: compiled code knows addresses alone, which keep nothing alive."""

    def __init__(self, function: Callable[..., int], blocks: tuple[Packed, ...]) -> None:
        self._function, self._blocks = function, blocks
        self._addresses = [block.address for block in blocks]

    def __call__(self) -> int:
        return self._function(*self._addresses)


@dataclass(eq=False)
class Entry:
    """A compiled function of blocks that returns an integer; compiled or read for each layout of its blocks.

    Parameters
    ----------
    name : str
        Its name in the cache.
    folder : Path or None
        Where its code is kept.
    make : callable
        Compiles it for the layouts of its blocks.
    """

    name: str
    folder: Path | None
    make: Callable[[tuple[Layout, ...]], ObjectCode]

    def __post_init__(self) -> None:
        self._linked: dict[tuple[Layout, ...], Callable[..., int]] = {}

    def __call__(self, *blocks: Packed) -> int:
        return self.on(*blocks)()

    def on(self, *blocks: Packed) -> Callable[[], int]:
        """The function of these blocks, for many calls; it keeps the blocks, whose memory the compiled code reads."""
        layouts = tuple(block.layout for block in blocks)
        if layouts not in self._linked:
            with _LINKING:
                if layouts not in self._linked:  # another thread was not first
                    self._linked[layouts] = self._link(layouts)
        return _Call(self._linked[layouts], blocks)

    def _link(self, layouts: tuple[Layout, ...]) -> Callable[..., int]:
        path = None if self.folder is None else self.folder / f"{self.name}-{_digest(repr(layouts).encode())[:16]}.o"
        kept = None if path is None else read(path)
        found = kept or self.make(layouts)
        if path is not None and kept is None:
            write(path, found)
        # PYFUNCTYPE: callers share work space and count on a call that is not interrupted by another thread's.
        call = ctypes.PYFUNCTYPE(ctypes.c_int32, *[ctypes.c_void_p] * (2 + len(layouts)))(link(found))

        def function(*addresses: int) -> int:
            result, exception = ctypes.c_int64(), ctypes.c_void_p()
            status = call(ctypes.addressof(result), ctypes.addressof(exception), *addresses)
            if status != 0:
                raise RuntimeError(f"{self.name}: the compiled code ended with status {status}")
            return result.value

        return function


def import_numba() -> Any:
    """Import numba without the settings that a working folder holds for it (``.numba_config.yaml``).

    Numba reads them again before each compilation, from a file of the name set here.
    """
    if "numba" not in sys.modules:
        load("numba")
        load("numba.core.config")._config_fname = os.devnull  # type: ignore[attr-defined]
        load("numba.core.registry")
    return sys.modules["numba"]


def link(code: ObjectCode) -> int:
    """Address of a function whose object file becomes part of this process."""
    from llvmlite import binding

    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    machine = binding.Target.from_default_triple().create_target_machine(jit=True)
    engine = binding.create_mcjit_compiler(binding.parse_assembly(""), machine)  # opens the process's own symbols
    if any(binding.address_of_symbol(name) is None for name in code.calls):
        # brings functions that are neither in the process nor in its libraries
        import_numba().core.registry.cpu_target.target_context.refresh()
    engine.add_object_file(binding.ObjectFileRef.from_data(code.code))
    engine.finalize_object()
    _ENGINES.append(engine)
    address = int(engine.get_function_address(code.name))
    if not address:
        raise RuntimeError(f"{code.name} is not in its object file")
    return address


def read(path: Path) -> ObjectCode | None:
    """Code that was kept; None where there is none, or not all of it."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    if content[:DIGEST] != hashlib.sha256(content[DIGEST:]).digest():
        return None
    head, _, code = content[DIGEST:].partition(b"\n")
    name, calls = json.loads(head)
    return ObjectCode(code, name, tuple(calls))


def write(path: Path, code: ObjectCode) -> None:
    """Keep code, whole or not at all; a folder that cannot be written costs only the keeping."""
    content = json.dumps([code.name, code.calls]).encode() + b"\n" + code.code
    with suppress(OSError):
        with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
            file.write(hashlib.sha256(content).digest() + content)
        try:
            os.replace(file.name, path)
        except OSError:  # Windows, while another program reads the old one
            os.unlink(file.name)


def _digest(text: bytes) -> str:
    return hashlib.sha256(text).hexdigest()
