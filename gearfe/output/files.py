"""Files written whole or not at all: a temporary file beside the target, renamed when it is complete."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from ..errors import InputError


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path in the same folder; on success it replaces `path` in one step, on failure it is removed.

    The temporary name keeps the suffix of `path`, because writers choose their format from it.
    """
    target = Path(path)
    handle, name = tempfile.mkstemp(prefix=f".{target.stem}-", suffix=target.suffix, dir=target.parent)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)
        temporary.replace(target)
    except BaseException:
        with suppress(OSError):
            temporary.unlink()
        raise


def output_folder(path: str | Path) -> Path:
    """Make (if needed) and return the output folder.

    Raises
    ------
    InputError
        When it cannot be made or written to.
    """
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError("--out", str(path), f"cannot be written ({reason})", "choose another folder") from None
    return folder


def write_csv(path: str | Path, columns: Mapping[str, Sequence[Any]]) -> None:
    """Write a table: one header line of names with units, then one line per row; floats carry 17 significant digits."""
    names = list(columns)
    data = [list(columns[name]) for name in names]
    rows = [",".join(names)]
    rows += [",".join(_cell(value) for value in row) for row in zip(*data, strict=True)]
    with whole_file(path) as temporary:
        temporary.write_text("\n".join(rows) + "\n", encoding="utf-8")


def write_json(path: str | Path, content: Mapping[str, Any]) -> None:
    """Write a summary file; numpy scalars and arrays become plain numbers and lists, not-a-number becomes null."""
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps(_plain(content), indent=2, allow_nan=False) + "\n", encoding="utf-8")


def _cell(value: Any) -> str:
    if isinstance(value, (str, bool)):
        return str(value)
    return str(int(value)) if _is_integer(value) else f"{float(value):.17g}"


def _is_integer(value: Any) -> bool:
    return isinstance(value, int) or getattr(getattr(value, "dtype", None), "kind", "") in ("i", "u")


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, float) and value != value:  # noqa: PLR0124
        return None
    if isinstance(value, float) and value in (float("inf"), float("-inf")):
        return None
    return value


@contextmanager
def whole_set(folder: Path) -> Iterator[Path]:
    """Yield a temporary folder inside `folder`; its files move to `folder` when all of them are written, else none."""
    with tempfile.TemporaryDirectory(prefix=".writing-", dir=folder) as name:
        made = Path(name)
        yield made
        for path in sorted(made.iterdir()):
            path.replace(folder / path.name)
