"""Named arrays in one ``.npz`` file, written whole; large ones are mapped from disk on reading, not copied."""

from __future__ import annotations

import struct
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy

from ..base.errors import InputError
from ..base.files import whole_file
from ..base.typing import Array

#: Arrays of more bytes than this are mapped.
LARGE = 1 << 20


def save_arrays(path: str | Path, arrays: Mapping[str, Array]) -> None:
    """Write arrays (no object arrays) to one uncompressed ``.npz`` file."""
    target = Path(path)
    with whole_file(target) as temporary, temporary.open("wb") as stream:
        np.savez(stream, allow_pickle=False, **arrays)


def load_arrays(path: str | Path) -> dict[str, Array]:
    """Read a file of `save_arrays`; arrays above `LARGE` bytes are read-only views of the file.

    All of the file is held against its checksums.

    Raises
    ------
    InputError
        When the file is missing, damaged, or not such a file.
    """
    path = Path(path)
    try:
        with zipfile.ZipFile(path) as archive, path.open("rb") as stream:
            if archive.testzip() is not None:
                raise ValueError("checksum error")
            size = path.stat().st_size
            found = {}
            for member in archive.infolist():
                name = member.filename.removesuffix(".npy")
                if member.file_size > LARGE and member.compress_type == zipfile.ZIP_STORED:
                    found[name] = _mapped(path, stream, member, size)
                else:
                    with archive.open(member) as entry:
                        found[name] = npy.read_array(entry, allow_pickle=False)
            return found
    except FileNotFoundError:
        raise InputError("file", str(path), "there is no such file", "check the path") from None
    except (OSError, ValueError, zipfile.BadZipFile, EOFError, struct.error) as error:
        raise InputError("file", str(path), f"cannot be read ({error})", "make it again") from error


def _mapped(path: Path, stream: Any, member: zipfile.ZipInfo, size: int) -> Array:
    """Array of an uncompressed member, mapped from its place in the file."""
    stream.seek(member.header_offset)
    header = stream.read(30)
    if len(header) < 30 or header[:4] != b"PK\x03\x04":
        raise ValueError(f"entry {member.filename} is damaged")
    name_length, extra_length = struct.unpack("<HH", header[26:30])
    stream.seek(member.header_offset + 30 + name_length + extra_length)
    version = npy.read_magic(stream)
    read_header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, fortran, dtype = read_header(stream)
    start = stream.tell()
    if dtype.hasobject or start + dtype.itemsize * int(np.prod(shape)) > size:
        raise ValueError(f"entry {member.filename} is damaged")
    mapped = np.memmap(path, dtype=dtype, mode="r", offset=start, shape=shape, order="F" if fortran else "C")
    return np.asarray(mapped)
