"""Keep computed objects on disk: meshes, condensed gears, curves, laws, reduced housings, compiled kernels.

An entry is a file named by its kind and a hash of everything that decides it: geometry, sizes, versions as plain data.
Entries are written completely under a temporary name and renamed, so two processes may write the same entry. An entry
that cannot be read, is truncated or belongs to another key is ignored and written again. A folder that cannot be
written to costs only the keeping. Entries that were not used for the longest time go when all together exceed a limit.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import json
import os
import platform
import shutil
import sys
import zipfile
from collections.abc import Callable, Mapping
from contextlib import suppress
from importlib import metadata
from pathlib import Path
from typing import Any, TypeVar

from ..version import VERSION
from .environment import limit, named_folder, user_folder
from .files import whole_file

T = TypeVar("T")

#: Packages whose versions decide the numbers.
PACKAGES = ("numpy", "scipy", "gmsh")
#: Share of the largest size of all entries that is left after the oldest went.
KEPT_SHARE = 0.8
#: One new entry in so many looks at the size of all: a look costs milliseconds.
LOOK = 16
#: Arrays larger than this share of the limit are not kept: they would push out everything else.
LARGEST_SHARE = 0.1


def cache_folder() -> Path | None:
    """Return ``$GEARFE_CACHE``, else the user's cache folder of this platform; ``None`` when off, or without a home.

    Raises
    ------
    InputError
        See `gearfe.base.environment.named_folder`.
    """
    named = named_folder()
    if named == "off":
        return None
    if named:
        return Path(named)
    try:
        home = Path.home()
    except RuntimeError:  # a user without one
        return None
    if sys.platform == "win32":
        base = Path(user_folder("LOCALAPPDATA") or home / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = home / "Library" / "Caches"
    else:
        base = Path(user_folder("XDG_CACHE_HOME") or home / ".cache")
    return base / "gearfe"


def kept(
    kind: str,
    key: str,
    *,
    read: Callable[[Path], T | None],
    make: Callable[[], T],
    write: Callable[[T, Path], None],
    folder: Path | None = None,
) -> T:
    """Return what is kept under a key, or make and keep it.

    Parameters
    ----------
    kind, key
        Of the entry, see `cache_key`.
    read
        Reads a file; None for one that is not to be trusted.
    make : callable
        Makes the data if no file can be trusted.
    write
        Writes one; a thing that is not to be kept is not written.
    folder
        Folder to use instead of `cache_folder()`.
    """
    folder = cache_folder() if folder is None else folder
    if folder is None:
        return make()
    path = folder / f"{kind}-{key[:32]}.npz"
    entry = read(path) if path.exists() else None
    if entry is not None:
        with suppress(OSError):
            os.utime(path)  # used now
        return entry
    value = make()
    # who was first wins, so that two processes that make the same continue with the same digits
    entry = read(path) if path.exists() else None
    if entry is not None:
        return entry
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        write(value, path)
        if int(key[:8], 16) % LOOK == 0:
            trim(folder, limit())
    return value


def cached_arrays(
    kind: str, recipe: object, make: Callable[[], dict[str, Any]], folder: Path | None = None
) -> dict[str, Any]:
    """Return the arrays that a recipe describes, from disk if they are there, or make and keep them.

    Parameters
    ----------
    kind : str
        Kind of the entry, the first part of its file name.
    recipe : object
        Everything that decides the arrays, see `cache_key`.
    make : callable
        Makes the arrays by name. They are not kept if they exceed `LARGEST_SHARE` of the cache's limit.
    folder : Path, optional
        Folder of the cache; the user's by default.
    """
    import numpy as np

    key = cache_key(kind, recipe)

    def read(path: Path) -> dict[str, Any] | None:
        try:  # the checksums of the zip container are verified
            with np.load(path, allow_pickle=False) as stored:
                arrays = {name: stored[name] for name in stored.files}
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
            return None
        return arrays if str(arrays.pop("_key", "")) == key else None

    def write(arrays: dict[str, Any], path: Path) -> None:
        if sum(np.asarray(values).nbytes for values in arrays.values()) > LARGEST_SHARE * limit():
            return
        with whole_file(path) as temporary:
            np.savez(temporary, _key=np.array(key), **arrays)

    return kept(kind, key, read=read, make=make, write=write, folder=folder)


def cache_key(kind: str, recipe: object) -> str:
    """Hash (hex) of a kind, a recipe and gmsh's version, for meshes differ between versions.

    Parameters
    ----------
    kind
        What sort of thing, for example ``housing``.
    recipe
        All that decides it, as plain data: frozen dataclasses, mappings, sequences, arrays, numbers, texts. Put a
        recipe number in it and raise that number whenever the code changes. Floats enter with all their digits.
    """
    content = {"kind": kind, "recipe": _plain(recipe), "gmsh": versions(("gmsh",))["gmsh"]}
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def versions(packages: tuple[str, ...] = PACKAGES) -> dict[str, str]:
    """Versions of this program, of Python and of packages, by default those that decide the numbers."""
    found = {"gearfe": VERSION, "python": platform.python_version()}
    return found | {name: _version(name) for name in packages}


@functools.cache  # looks through all packages
def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "absent"


@functools.cache
def source_hash(*names: str) -> str:
    """Hash (hex) of the text of packages and modules in ``gearfe``, by path: their results depend on it."""
    text, package = hashlib.sha256(), Path(__file__).parents[1]
    for name in names:
        for file in sorted((package / name).glob("*.py")) or [package / f"{name}.py"]:
            text.update(file.name.encode() + file.read_bytes())
    return text.hexdigest()


def _plain(value: Any) -> Any:
    """`value` as JSON data in which equal geometry gives equal text."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {f.name: _plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
        return {"__class__": type(value).__name__, **fields}
    if isinstance(value, Mapping):
        return {str(name): _plain(item) for name, item in value.items()}
    if hasattr(value, "tobytes"):  # an array, or one of its numbers
        if not value.shape:
            return _plain(value.item())
        import numpy as np

        return [str(value.dtype), list(value.shape), hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()]
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if value is not None and not isinstance(value, (bool, int, str, float)):
        raise TypeError(f"a recipe is plain data, not {type(value).__name__}")
    return value.hex() if isinstance(value, float) else value


@dataclasses.dataclass(frozen=True)
class Entry:
    """A file, or a folder of compiled code.

    Attributes
    ----------
    path
        Where it is.
    kind
        What sort of thing.
    size
        Bytes.
    used
        When it was made or last read (s since 1970).
    """

    path: Path
    kind: str
    size: int
    used: float


def entries(folder: Path) -> list[Entry]:
    """All entries, the one used last at the end; other files of the folder are none of ours."""
    entries_of_kind = []
    for path in folder.iterdir() if folder.is_dir() else ():
        kind, _, rest = path.name.rpartition("-")
        if not kind or not rest[:16].isalnum() or len(rest) < 16:
            continue
        with suppress(OSError):
            files = [p.stat() for p in path.rglob("*") if p.is_file()] if path.is_dir() else [path.stat()]
            if files:
                size, used = sum(s.st_size for s in files), max(s.st_mtime for s in files)
                entries_of_kind.append(Entry(path, kind, size, used))
    return sorted(entries_of_kind, key=lambda entry: entry.used)


def trim(folder: Path, size: int) -> list[Entry]:
    """Remove the entries not used for the longest time where all exceed `size` (bytes); what was removed."""
    there = entries(folder)
    total = sum(entry.size for entry in there)
    if total <= size:
        return []
    gone = []
    for entry in there:
        if total <= KEPT_SHARE * size:
            break
        if remove(entry):
            gone.append(entry)
            total -= entry.size
    return gone


def remove(entry: Entry) -> bool:
    """Remove an entry; False where that is not allowed."""
    try:
        if entry.path.is_dir():
            shutil.rmtree(entry.path)
        else:
            entry.path.unlink()
    except OSError:
        return False
    return True
