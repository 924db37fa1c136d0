"""Mesh files that gmsh reads: its own (.msh), I-DEAS' universal files (.unv), Salome's (.med), Medit's (.mesh).

Files may come from strangers, but gmsh trusts all files. It runs any file that looks like a script of its language,
whatever the ending. It also merges the options next to a file (``FILE.opt``, which is a script, too). So the file's
first line is checked, and gmsh sees a copy alone in a folder. Damaged files can crash it (24 of 250 .unv files with
random faults). A separate process therefore reads them and returns arrays.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import numpy as np

from ...base.errors import InputError
from ...base.typing import IntArray
from ...output.exchange.source_mesh import SourceMesh
from .session import gmsh_session

ENDINGS = (".msh", ".unv", ".med", ".mesh")
#: What a file of each kind begins with; first words of scripts of gmsh's language are none of these.
_HEADS = {
    ".msh": (b"$MeshFormat", b"$NOD", b"$Comments"),
    ".med": (b"\x89HDF\r\n\x1a\n",),
    ".unv": (b"-1",),
    ".mesh": (b"MeshVersionFormatted", b"#"),
}
#: meshio's names of gmsh's elements by their types.
KINDS = {
    **{1: "line", 8: "line3", 15: "vertex", 2: "triangle", 9: "triangle6", 3: "quad", 16: "quad8", 10: "quad9"},
    **{4: "tetra", 11: "tetra10", 5: "hexahedron", 17: "hexahedron20", 12: "hexahedron27"},
    **{6: "wedge", 18: "wedge15", 13: "wedge18", 7: "pyramid", 19: "pyramid13", 14: "pyramid14"},
    **{21: "triangle10", 29: "tetra20", 26: "line4", 36: "quad16"},
}
#: Address space of the reading process (bytes): its libraries, and times the size of the file.
_LIBRARIES, _TIMES = 3 << 30, 100
#: What editors put before the first word: blanks, the mark of UTF-8. With either, gmsh takes a .msh for a script.
_BLANKS, _MARK = b" \t\r\n", b"\xef\xbb\xbf"
#: Exit code for a message on the standard error, in contrast to a crash.
_REFUSED = 3


def read_by_gmsh(path: Path, field: str) -> SourceMesh:
    """Mesh of a file as gmsh reads it.

    Raises
    ------
    InputError
        When the file is none of its kind, is damaged, or has no elements.
    """
    ending = path.suffix.lower()
    with path.open("rb") as stream:
        head = stream.read(4096)
    before = len(head) - len(head.removeprefix(_MARK).lstrip(_BLANKS)) if ending == ".msh" else 0
    if not head[before:].lstrip(_BLANKS).startswith(_HEADS[ending]):
        names = " or ".join(repr(one.decode("latin-1")) for one in _HEADS[ending])
        problem = f"is no {ending} file: it begins with {head[:20]!r}, not with {names}"
        raise InputError(field, path.name, problem, "export the mesh again; scripts and CAD models are no meshes")
    with tempfile.TemporaryDirectory(prefix="gearfe-") as folder:
        alone, arrays = Path(folder) / f"mesh{ending}", Path(folder) / "arrays.npz"
        with path.open("rb") as source, alone.open("wb") as copy:
            source.seek(before)
            shutil.copyfileobj(source, copy)
        command = "import sys; sys.path[:0] = sys.argv[1:2]; from gearfe.fem.meshing.gmsh_file import main; main()"
        run = subprocess.run(
            [sys.executable, "-P", "-c", command, str(Path(__file__).parents[3]), str(alone), str(arrays)],
            capture_output=True,
            text=True,
            errors="replace",
            check=False,
            cwd=folder,  # empty: nothing in it can be imported
        )
        if run.returncode == _REFUSED:
            reason = (run.stderr.strip().splitlines() or ["no reason"])[-1].replace(str(alone), path.name)
            raise InputError(field, path.name, f"cannot be read by gmsh ({reason[:200]})", _CURE)
        if run.returncode != 0 or not arrays.exists():
            raise InputError(field, path.name, "is damaged: gmsh crashes when it reads the file", _CURE)
        return _loaded(arrays, path, field)


_CURE = "the file may be cut short or damaged: export it again"


def _loaded(arrays: Path, path: Path, field: str) -> SourceMesh:
    try:
        with np.load(arrays, allow_pickle=False) as stored:
            names = [str(name) for name in stored["names"]]
            cells = {key.removeprefix("cells "): stored[key] for key in stored.files if key.startswith("cells ")}
            groups = {name: stored[f"group {i}"] for i, name in enumerate(names)}
            unknown = stored["unknown"]
            points = stored["points"]
    except (OSError, ValueError, KeyError, zipfile.BadZipFile):
        raise InputError(field, path.name, "is damaged: gmsh stops when it reads the file", _CURE) from None
    if len(unknown):
        problem = f"has elements of gmsh's type {int(unknown[0])}, which are not supported"
        raise InputError(field, path.name, problem, "mesh with elements of the first or second order")
    if not cells:
        raise InputError(field, path.name, "has no elements", _CURE)
    return SourceMesh(points, cells, groups)


def main() -> None:
    """Read the mesh ``sys.argv[2]`` and write its arrays to ``sys.argv[3]``: the process of `read_by_gmsh`."""
    source, target = sys.argv[2:4]
    try:
        import resource

        limit = _LIBRARIES + _TIMES * Path(source).stat().st_size
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    except (ImportError, ValueError, OSError):
        pass  # Windows has no limits
    try:
        np.savez(target, **_arrays(source))  # type: ignore[arg-type]
    except Exception as error:
        print(" ".join(str(error).split()) or type(error).__name__, file=sys.stderr)
        sys.exit(_REFUSED)


def _arrays(source: str) -> dict[str, IntArray]:
    """Arrays of a mesh; where it names no groups, numbers of its entities are the groups."""
    with gmsh_session("mesh") as gmsh:
        gmsh.merge(source)
        mesh = gmsh.model.mesh
        tags, points, _ = mesh.getNodes()
        order = np.argsort(tags)
        tags = tags[order].astype(np.int64)

        def rows(nodes: IntArray) -> IntArray:
            place = np.searchsorted(tags, nodes.astype(np.int64))
            found = np.minimum(place, len(tags) - 1)
            return np.where(tags[found] == nodes.astype(np.int64), found, -1)

        result = {"points": points.reshape(-1, 3)[order], "unknown": np.zeros(0, dtype=np.int64)}
        kinds, numbers, members = mesh.getElements()
        for kind, own, nodes in zip(kinds, numbers, members, strict=True):
            count = mesh.getElementProperties(kind)[3]
            if kind not in KINDS:
                result["unknown"] = np.append(result["unknown"], kind)
                continue
            cells = rows(nodes).reshape(-1, count)
            # an element that belongs to two groups stands twice in old files
            _, first = np.unique(own, return_index=True)
            _, alone = np.unique(np.sort(cells[np.sort(first)], axis=1), axis=0, return_index=True)
            result[f"cells {KINDS[kind]}"] = cells[np.sort(first)][np.sort(alone)]
        groups: dict[str, list[IntArray]] = {}
        for dimension, tag in gmsh.model.getPhysicalGroups():
            nodes = mesh.getNodesForPhysicalGroup(dimension, tag)[0]
            groups.setdefault(gmsh.model.getPhysicalName(dimension, tag).strip() or str(tag), []).append(nodes)
        for dimension, tag in () if groups else [*gmsh.model.getEntities(2), *gmsh.model.getEntities(3)]:
            parts = mesh.getElements(dimension, tag)[2]
            if str(tag) not in groups and len(parts):  # surfaces before volumes of the same number
                groups[str(tag)] = [np.concatenate(parts)]
        result["names"] = np.array(list(groups), dtype=np.str_)
        for i, parts in enumerate(groups.values()):
            result[f"group {i}"] = np.unique(rows(np.concatenate(parts)))
        return result
