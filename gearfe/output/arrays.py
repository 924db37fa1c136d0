"""Named arrays in one ``.npz`` file, written and read whole."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..typing import Array
from .files import whole_file


def save_arrays(path: str | Path, arrays: Mapping[str, Array]) -> None:
    """Write arrays (no object arrays) to one uncompressed ``.npz`` file."""
    target = Path(path)
    with whole_file(target) as temporary, temporary.open("wb") as stream:
        np.savez(stream, allow_pickle=False, **arrays)


def load_arrays(path: str | Path) -> dict[str, Array]:
    """Read a file of `save_arrays`; its checksums are verified.

    Raises
    ------
    InputError
        When the file is missing, damaged, or not such a file.
    """
    try:
        with Path(path).open("rb") as stream, np.load(stream, allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
    except FileNotFoundError:
        raise InputError("file", str(path), "there is no such file", "check the path") from None
    except (OSError, ValueError, TypeError, AttributeError, zipfile.BadZipFile, EOFError) as error:
        raise InputError("file", str(path), f"cannot be read ({error})", "make it anew") from error
