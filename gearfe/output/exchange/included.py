"""Lines of a text file with the files that it includes in their places.

Meshes may come from strangers, so an included file must lie in the folder of the named file, or below it. Cycles and
endless expansions are refused.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

from ...base.errors import InputError
from ...base.files import LARGEST, read_text

#: Statements of inclusion that are followed; pre-processors write some tens.
MOST_FILES = 1000
#: Files that include each other in a row.
DEEPEST = 100


class Line(NamedTuple):
    """A line of text, with its file's name and its number there, from 1."""

    text: str
    file: str
    number: int

    @property
    def place(self) -> str:
        """Return the position, for messages."""
        return f"line {self.number} of {self.file}"


def lines_of(text: str, name: str) -> list[Line]:
    """Lines of a text that is the content of the file `name`."""
    return [Line(line, name, number) for number, line in enumerate(text.splitlines(), start=1)]


class Inclusion(NamedTuple):
    """A file that a line includes; whether the line itself is kept before it."""

    name: str
    keep: bool = False


def included_lines(path: Path, field: str, inclusion: Callable[[str], Inclusion | None]) -> Iterator[Line]:
    """Yield the lines of a file, each included file in the place of its statement.

    Parameters
    ----------
    path
        The file.
    field
        Key that named it, for messages.
    inclusion
        The file that a line includes, or None.

    Raises
    ------
    InputError
        When a file is missing, includes itself, lies outside of the folder, or all of them are too large.
    """
    for item in _expanded(path, field, inclusion):
        if isinstance(item, Line):
            yield item


def source_files(path: Path, field: str, inclusion: Callable[[str], Inclusion | None]) -> list[Path]:
    """Return the file and all files that it includes; raises as `included_lines`."""
    return [item for item in _expanded(path, field, inclusion) if isinstance(item, Path)]


def _expanded(path: Path, field: str, inclusion: Callable[[str], Inclusion | None]) -> Iterator[Line | Path]:
    """Yield each file as it is opened, and the lines."""
    root = path.parent.resolve()
    files = size = 0

    def expand(file: Path, above: tuple[Path, ...]) -> Iterator[Line | Path]:
        nonlocal files, size
        files += 1
        text = read_text(file, field, foreign=True)
        size += len(text)
        if files > MOST_FILES or size > LARGEST:
            problem = f"includes more than {MOST_FILES} files or {LARGEST >> 20} MB"
            raise InputError(field, path.name, problem, "write the mesh into one file")
        yield file
        shown = file.name if file == path else str(file.resolve().relative_to(root))
        for number, line in enumerate(text.splitlines(), start=1):
            found = inclusion(line)
            if found is None or found.keep:
                yield Line(line, shown, number)
            if found is not None:
                where = f"line {number} of {shown} includes {found.name!r}"
                below = _found(found.name, file, root, field, where)
                if below in above:
                    raise InputError(field, path.name, f"{where}, which includes itself", "remove that line")
                if len(above) == DEEPEST:
                    problem = f"{where}: more than {DEEPEST} files include each other in a row"
                    raise InputError(field, path.name, problem, "write the mesh into one file")
                yield from expand(below, (*above, below))

    yield from expand(path, (path.resolve(),))


def _found(name: str, including: Path, root: Path, field: str, where: str) -> Path:
    """An included file, looked for beside the including one, then beside the first."""
    if not name or "\0" in name:
        raise InputError(field, root.name, f"{where}: no name of a file", "name a file next to the mesh")
    outside = False
    for folder in (including.parent, root):
        for text in dict.fromkeys((name, name.replace("\\", "/"))):
            try:
                target = (folder / text).resolve()
                there = target.is_file()
            except (OSError, RuntimeError, ValueError):  # longer than a name can be, or a loop of links
                continue
            if target.is_relative_to(root):
                if there:
                    return target
            else:
                outside = True
    if outside:
        cure = "put the file into the folder of the mesh, and name it by a relative path"
        raise InputError(field, including.name, f"{where}, which is outside of the folder of the mesh", cure)
    cure = "put it next to the file that includes it, or write the mesh into one file"
    raise InputError(field, including.name, f"{where}, but there is no such file", cure)
