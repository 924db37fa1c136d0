"""Meshes kept on disk: a second run with the same geometry and recipe reads arrays and never starts gmsh.

A stored mesh is one ``.npz`` file, named by a hash of everything that decides it: the geometry and the recipe as plain
data, and gmsh's version (meshes differ between versions). Files are written whole under a temporary name and renamed,
so two processes that make the same mesh at the same time do no harm; a file that cannot be read, is cut short or
belongs to another key is ignored and written anew.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..cache import cache_folder
from ..output.files import whole_file
from ..typing import Array
from .session import gmsh_version

Arrays = dict[str, Array]


def cache_key(kind: str, recipe: object) -> str:
    """Hash (hex) of a mesh's kind, recipe and gmsh's version.

    Parameters
    ----------
    kind
        What sort of mesh, for example ``housing``.
    recipe
        All that decides the mesh, as plain data: frozen dataclasses, mappings, sequences, arrays, numbers, texts. Put a
        recipe number in it and raise that number whenever the meshing code changes. Floats enter with all their digits.
    """
    content = {"kind": kind, "recipe": _plain(recipe), "gmsh": gmsh_version()}
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def cached_arrays(kind: str, recipe: object, make: Callable[[], Arrays], folder: Path | None = None) -> Arrays:
    """Arrays of the mesh that `recipe` describes, from disk when they are there, else made and stored.

    A folder that cannot be written to costs only the storing.

    Parameters
    ----------
    kind, recipe
        See `cache_key`.
    make
        Makes the mesh: no arguments, returns name -> array (no object arrays).
    folder
        Folder to use instead of `cache_folder()`.
    """
    folder = cache_folder() if folder is None else folder
    if folder is None:
        return make()
    key = cache_key(kind, recipe)
    path = folder / f"{kind}-{key[:32]}.npz"
    found = _read(path, key)
    if found is not None:
        return found
    arrays = make()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as temporary:
            np.savez(temporary, _key=np.array(key), **arrays)  # type: ignore[arg-type]
    except OSError:
        pass
    return arrays


def _read(path: Path, key: str) -> Arrays | None:
    """Stored arrays, or ``None`` when there are none to trust (the zip container's checksums are verified)."""
    try:
        with np.load(path, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None
    if str(arrays.pop("_key", "")) != key:
        return None
    return arrays


def _plain(value: Any) -> Any:
    """`value` as JSON data in which equal geometry gives equal text."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {f.name: _plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
        return {"__class__": type(value).__name__, **fields}
    if isinstance(value, Mapping):
        return {str(name): _plain(item) for name, item in value.items()}
    if isinstance(value, np.ndarray):
        return [str(value.dtype), list(value.shape), hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()]
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if value is not None and not isinstance(value, (bool, int, str, float)):
        raise TypeError(f"a mesh recipe is plain data, not {type(value).__name__}")
    return value.hex() if isinstance(value, float) else value
