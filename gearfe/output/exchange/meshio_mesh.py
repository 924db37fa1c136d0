"""Mesh files that meshio reads: VTK's (.vtk, .vtu) and XDMF, whose groups are arrays of marks, and rarer formats.

gmsh reads neither .vtu nor XDMF, and drops the arrays of a .vtk; for all other common formats there are readers that
know more.
"""

from __future__ import annotations

import contextlib
import io
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array, IntArray
from .source_mesh import SourceMesh

#: Arrays of whole numbers by which formats number groups without a name.
NUMBERED = ("medit:ref", "nastran:ref", "ref", "cell_tags", "point_tags", "avsucd:material", "gmsh:physical")
#: Arrays of numbers that name no groups.
OTHER_NUMBERS = ("gmsh:geometrical", "gmsh:dim_tags")


def read_by_meshio(path: Path, field: str) -> SourceMesh:
    """Mesh of a file as meshio reads it.

    Raises
    ------
    InputError
        When meshio does not know the format, or the file is none of it.
    """
    import meshio

    heavy_files(path, field)
    printed = io.StringIO()
    try:  # meshio prints what it tried, and ends the process when nothing helps
        with (
            contextlib.redirect_stdout(printed),
            contextlib.redirect_stderr(printed),
            warnings.catch_warnings(),
            np.errstate(all="ignore"),
        ):
            warnings.simplefilter("ignore")
            mesh = meshio.read(path)
            cells: dict[str, list[IntArray]] = {}
            for block in mesh.cells:
                cells.setdefault(block.type, []).append(_numbers(block.data))
            groups: dict[str, list[IntArray]] = {}
            for name, nodes in _groups(mesh):
                groups.setdefault(name, []).append(_numbers(nodes).ravel())
            return SourceMesh(
                np.asarray(mesh.points, dtype=float),
                {kind: np.concatenate(blocks) for kind, blocks in cells.items()},
                {name: np.unique(np.concatenate(parts)) for name, parts in groups.items()},
            )
    except (Exception, SystemExit) as error:
        if path.suffix.lower() not in meshio.extension_to_filetypes:
            cure = "export .vtu, .msh, .inp, .bdf, .med or .unv, or the CAD model as .step"
            raise InputError(field, path.name, "has an ending that is not known", cure) from None
        lines = [line.strip() for line in [*printed.getvalue().splitlines(), str(error)] if line.strip()]
        # a number or the name of an exception, as meshio prints where it meets an unknown kind, explains nothing
        reason = next((line for line in lines if "Couldn't read" not in line and len(line.split()) > 1), "")
        reason = reason or "it has a form, or a kind of element, that meshio does not know"
        problem = f"cannot be read as a {path.suffix} file ({reason[:200]})"
        others = [name for name in (".vtu", ".msh", ".inp", ".bdf") if name != path.suffix.lower()]
        cure = f"the file may be cut short or damaged: export it again, or as {', '.join(others)}"
        if path.suffix.lower() == ".dat":
            cure = "name bulk data of Nastran .bdf, and input files of Abaqus or CalculiX .inp"
        raise InputError(field, path.name, problem, cure) from None


def heavy_files(path: Path, field: str) -> list[Path]:
    """Files that an XDMF file names for its numbers.

    Raises
    ------
    InputError
        When one lies outside of the folder of the file.
    """
    if path.suffix.lower() not in (".xdmf", ".xmf"):
        return []
    try:
        items = [item for item in ElementTree.parse(path).iter("DataItem") if (item.get("Format") or "XML") != "XML"]
    except (ElementTree.ParseError, OSError, ValueError, LookupError):
        return []  # its reader says what is wrong
    root, found = path.parent.resolve(), []
    for name in dict.fromkeys((item.text or "").strip().split(":")[0].strip() for item in items):
        try:
            target = (root / name).resolve()
        except (OSError, RuntimeError, ValueError):
            target = Path("/")
        if not target.is_relative_to(root):
            problem = f"takes its numbers from {name!r}, which is outside of the folder of the mesh"
            raise InputError(field, path.name, problem, "put both files into one folder")
        if target.is_file():
            found.append(target)
    return found


def _numbers(values: Any) -> IntArray:
    """Whole numbers of an array; ValueError for any others."""
    array = np.asarray(values)
    whole = array.astype(np.int64)
    if array.dtype.kind not in "iu" and not np.array_equal(whole, array):
        raise ValueError("node numbers are not whole numbers")
    return whole


def _groups(mesh: Any) -> Iterator[tuple[str, IntArray]]:
    """Names and nodes of all groups of a mesh, one by one; a name may come several times."""
    yield from (mesh.point_sets or {}).items()
    for name, parts in (mesh.cell_sets or {}).items():
        for block, rows in zip(mesh.cells, parts, strict=False):
            if rows is not None and len(rows):
                yield name, block.data[np.asarray(rows, dtype=np.int64)]
    names: dict[int, list[str]] = {int(np.ravel(tag)[0]): [] for tag in mesh.field_data.values()}  # by name
    for tags in (getattr(mesh, "cell_tags", None), getattr(mesh, "point_tags", None)):
        for tag, own in (tags or {}).items():
            names.setdefault(int(tag), []).extend(own)
    for key, blocks in mesh.cell_data.items():
        if len({np.asarray(values).shape[1:] for values in blocks}) != 1:
            continue
        begins = np.cumsum([0, *(len(block.data) for block in mesh.cells)])
        for name, rows in _rows(key, np.concatenate(blocks), names):
            for block, begin, end in zip(mesh.cells, begins, begins[1:], strict=False):
                inside = rows[(rows >= begin) & (rows < end)] - begin
                if len(inside):
                    yield name, block.data[inside]
    for key, values in mesh.point_data.items():
        yield from _rows(key, np.asarray(values), names)


def _rows(key: str, values: Array, names: dict[int, list[str]]) -> Iterator[tuple[str, IntArray]]:
    """Return the groups of one array: its numbers if they are groups, or its name for marks of 0 and 1."""
    if values.ndim != 1 or key in OTHER_NUMBERS:
        return
    if key in NUMBERED:
        for number in np.unique(values[values != 0]):
            rows = np.flatnonzero(values == number)
            for name in names.get(int(number), [str(int(number))]):
                yield name, rows
    elif np.isin(values, (0, 1)).all() and values.any():
        yield key, np.flatnonzero(values)
