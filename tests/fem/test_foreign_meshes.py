"""Meshes as other programs write them: the same body from every legal form, and refusals that name what is wrong."""

from __future__ import annotations

import itertools
import os
from pathlib import Path

import meshio
import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.fem.meshing.mesh_file import MeshFile, read_mesh_file, source_fingerprint
from gearfe.fem.meshing.session import gmsh_session
from tests.makers.files import damaged
from tests.makers.housing_meshes import box

SIZE = (0.03, 0.02, 0.04)


@pytest.fixture(scope="module")
def plain() -> tuple[np.ndarray, np.ndarray]:
    """Nodes (mm) and tetrahedra of a box in which no two directions are alike."""
    nodes, tets = box((2, 1, 2), SIZE)
    return 1e3 * nodes, tets


def rows(numbers: object, width: int = 8) -> str:
    cells = [str(int(n)) for n in numbers]  # type: ignore[attr-defined]
    return "".join(", ".join(cells[i : i + width]) + ",\n" for i in range(0, len(cells), width)).rstrip(",\n") + "\n"


def node_lines(nodes: np.ndarray, chosen: object = None, first: int = 1) -> str:
    return "".join(
        f"{i + first}, {x:.12g}, {y:.12g}, {z:.12g}\n"
        for i, (x, y, z) in enumerate(nodes)
        if chosen is None or i in chosen
    )  # type: ignore[operator]


def tet_lines(tets: np.ndarray, first: int = 1) -> str:
    return "".join(f"{e + 1}, " + ", ".join(str(n + first) for n in tet) + "\n" for e, tet in enumerate(tets))


def top(nodes: np.ndarray) -> list[int]:
    """Numbers from 1 of the nodes on the upper face."""
    return [int(i) + 1 for i in np.flatnonzero(nodes[:, 2] > 1e3 * SIZE[2] - 1e-6)]


def read(folder: Path, text: str, name: str = "a.inp") -> MeshFile:
    (folder / name).write_text(text)
    return read_mesh_file(folder / name, "housing.mesh", 1.0)


def same(mesh: MeshFile, plain: tuple[np.ndarray, np.ndarray], group: str = "top") -> None:
    """Same elements at the same places, and the upper face as the group."""
    nodes, tets = plain
    assert mesh.tets.shape == tets.shape
    order = np.lexsort(np.round(mesh.nodes[mesh.tets].mean(axis=1), 6).T)
    wanted = np.lexsort(np.round(nodes[tets].mean(axis=1), 6).T)
    np.testing.assert_allclose(mesh.nodes[mesh.tets[order]], nodes[tets[wanted]], atol=1e-9)
    at = mesh.nodes[mesh.group(group, "group")]
    on = nodes[np.array(top(nodes)) - 1]
    np.testing.assert_allclose(at[np.lexsort(np.round(at, 6).T)], on[np.lexsort(np.round(on, 6).T)], atol=1e-9)


def test_sets_of_abaqus(plain, tmp_path) -> None:
    """All ways to write a node set give the same nodes; keywords in any case, lines that go on, comments, headings."""
    nodes, tets = plain
    on = top(nodes)
    head = f"*Heading\n any text, 1, 2\n** comment\n*node\n{node_lines(nodes)}"
    head += f"*ELEMENT, TYPE=c3d10,\n elset=Eall\n{tet_lines(tets)}"
    half = len(on) // 2
    above = [e + 1 for e, tet in enumerate(tets) if set(tet[:4] + 1) & set(on)]
    cases = {
        "list": f"*nset, nset=TOP\n{rows(on)}",
        "twice": f"*NSET, NSET=top\n{rows(on[:half])}*NSET, NSET=top\n{rows(on[half:])}",
        "of sets": f"*NSET, NSET=a\n{rows(on[:half])}*NSET, NSET=b\n{rows(on[half:])}*NSET, NSET=top\na, b\n",
        "generated": "*NSET, NSET=top, GENERATE\n" + "".join(f"{n}, {n}, 1\n" for n in on),
        "a range of more": f"*NSET, NSET=top, GENERATE\n{max(on)}, 9999, 9000\n*NSET, NSET=top\n{rows(on)}",
        "quoted": f'*NSET, NSET="top", UNSORTED, INTERNAL\n{rows(on)}',
        "beside a set of elements": f"*ELSET, ELSET=top\n{rows(above)}*NSET, NSET=top\n{rows(on)}",
        "before its nodes": f"*NSET, NSET=top\n{rows(on)}",
    }
    for name, text in cases.items():
        whole = text + head if name == "before its nodes" else head + text
        same(read(tmp_path, whole), plain, "top")
    faces = {"S1": {0, 1, 2}, "S2": {0, 1, 3}, "S3": {1, 2, 3}, "S4": {0, 2, 3}}
    text = "*SURFACE, TYPE=ELEMENT, NAME=top\n"
    for e, tet in enumerate(tets):
        text += "".join(f"{e + 1}, {s}\n" for s, corners in faces.items() if set(tet[list(corners)] + 1) <= set(on))
    same(read(tmp_path, head + text), plain)
    mesh = read(tmp_path, head + "*NSET, NSET=all, ELSET=EALL\n*ELSET, ELSET=some, GENERATE\n1, 3, 2\n")
    assert len(mesh.groups["all"]) == len(nodes)
    assert set(mesh.groups["some"]) == set(tets[[0, 2]].ravel())


def test_several_node_blocks_with_sets(plain, tmp_path) -> None:
    nodes, tets = plain
    on = {n - 1 for n in top(nodes)}
    rest = set(range(len(nodes))) - on
    text = f"*NODE, NSET=rest\n{node_lines(nodes, rest)}*NODE, NSET=top\n{node_lines(nodes, on)}"
    same(read(tmp_path, f"{text}*ELEMENT, TYPE=C3D10\n{tet_lines(tets)}"), plain)


def test_cylindrical_coordinates_and_systems(plain, tmp_path) -> None:
    """The nodes written in a cylindrical system that is itself turned and moved."""
    nodes, tets = plain
    axes, origin = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]).T, np.array([5.0, -3.0, 2.0])
    a, b = origin + axes[:, 0], origin + axes[:, 1]
    local = (nodes - origin) @ axes
    polar = np.column_stack([np.hypot(*local[:, :2].T), np.degrees(np.arctan2(local[:, 1], local[:, 0])), local[:, 2]])
    text = f"*SYSTEM\n{rows_of(origin)}, {rows_of(a)}\n{rows_of(b)}\n*NODE, SYSTEM=C\n{node_lines(polar)}*SYSTEM\n"
    same(read(tmp_path, f"{text}*ELEMENT, TYPE=C3D10\n{tet_lines(tets)}*NSET, NSET=top\n{rows(top(nodes))}"), plain)


def rows_of(point: np.ndarray) -> str:
    return ", ".join(f"{x:.15g}" for x in point)


def part(nodes: np.ndarray, tets: np.ndarray, name: str = "P", sets: str = "") -> str:
    return f"*PART, NAME={name}\n*NODE\n{node_lines(nodes)}*ELEMENT, TYPE=C3D10\n{tet_lines(tets)}{sets}*END PART\n"


@pytest.mark.parametrize("where", ["part", "assembly", "qualified", "independent"])
def test_an_instance_is_moved_then_turned(where, plain, tmp_path) -> None:
    """By hand: a quarter turn about the line x = 10, y = 5, along z, after a shift of (1, 2, 3)."""
    nodes, tets = plain
    shift = np.array([1.0, 2.0, 3.0])
    turned = nodes + shift
    turned = np.column_stack([10 - (turned[:, 1] - 5), 5 + (turned[:, 0] - 10), turned[:, 2]])
    on = top(nodes)
    inside = f"*NSET, NSET=top\n{rows(on)}"
    mesh_of_it = f"*NODE\n{node_lines(nodes)}*ELEMENT, TYPE=C3D10\n{tet_lines(tets)}"
    placed = "1., 2., 3.\n10., 5., 0., 10., 5., 7., 90.\n"
    text = (
        "*PART, NAME=P\n*END PART\n"
        if where == "independent"
        else part(nodes, tets, sets=inside if where == "part" else "")
    )
    own = mesh_of_it if where == "independent" else ""
    text += f"*ASSEMBLY, NAME=A\n*INSTANCE, NAME=P-1, PART=p\n{placed}{own}*END INSTANCE\n"
    text += {
        "part": "",
        "assembly": f"*NSET, NSET=top, INSTANCE=p-1\n{rows(on)}",
        "qualified": "*NSET, NSET=top\n" + "".join(f"P-1.{n}\n" for n in on),
        "independent": f"*NSET, NSET=top, INSTANCE=P-1\n{rows(on)}",
    }[where]
    mesh = read(tmp_path, text + "*END ASSEMBLY\n*STEP\n*STATIC\n*END STEP\n")
    wanted = turned[tets]
    np.testing.assert_allclose(mesh.nodes[mesh.tets], wanted, atol=1e-9)
    np.testing.assert_allclose(mesh.nodes[mesh.group("top", "g")], turned[np.array(on) - 1], atol=1e-9)


def test_instances_that_share_no_nodes_are_refused_by_name(plain, tmp_path) -> None:
    text = part(*plain) + "*ASSEMBLY, NAME=A\n"
    text += "".join(f"*INSTANCE, NAME=I{i}, PART=P\n{100 * i}.,0.,0.\n*END INSTANCE\n" for i in (1, 2))
    with pytest.raises(InputError, match=r"the instances I1 \(24 elements\), I2 \(24 elements\) share no nodes.*merge"):
        read(tmp_path, text + "*END ASSEMBLY\n")
    # elements of the assembly may join them
    nodes, tets = plain
    joined = part(nodes, tets[:-1]) + "*ASSEMBLY, NAME=A\n*INSTANCE, NAME=I1, PART=P\n*END INSTANCE\n"
    last = ", ".join(f"I1.{n + 1}" for n in tets[-1])
    mesh = read(
        tmp_path,
        f"{joined}*ELEMENT, TYPE=C3D10\n1, {last}\n*NSET, NSET=top, INSTANCE=I1\n{rows(top(nodes))}*END ASSEMBLY\n",
    )
    same(mesh, plain)


def test_other_meshes_of_an_assembly_do_not_matter(plain, tmp_path) -> None:
    """A reference point, and a rigid surface, beside the one body."""
    nodes, tets = plain
    text = part(nodes, tets) + "*PART, NAME=R\n*NODE\n1, 0., 0., 500.\n2, 1., 0., 500.\n3, 0., 1., 500.\n"
    text += "*ELEMENT, TYPE=R3D3\n1, 1, 2, 3\n*END PART\n*ASSEMBLY, NAME=A\n"
    text += (
        "*INSTANCE, NAME=R1, PART=R\n*END INSTANCE\n*INSTANCE, NAME=P1, PART=P\n*END INSTANCE\n*NODE\n1, 9., 9., 9.\n"
    )
    same(read(tmp_path, f"{text}*NSET, NSET=top, INSTANCE=P1\n{rows(top(nodes))}*END ASSEMBLY\n"), plain)


def test_includes(plain, tmp_path) -> None:
    """Beside the including file, in a folder below, of a file that includes another, and the data of a card."""
    nodes, tets = plain
    (tmp_path / "parts" / "deep").mkdir(parents=True)
    (tmp_path / "parts" / "nodes.inc").write_text("*NODE\n*INCLUDE, INPUT=deep/rows.inc\n")
    (tmp_path / "parts" / "deep" / "rows.inc").write_text(node_lines(nodes))
    (tmp_path / "elements.txt").write_text(tet_lines(tets))
    text = '*INCLUDE, INPUT="parts\\nodes.inc"\n*ELEMENT, TYPE=C3D10, INPUT=elements.txt\n*NSET, NSET=top\n'
    same(read(tmp_path, f"*AMPLITUDE, INPUT=none.csv\n{text}{rows(top(nodes))}"), plain)
    before = source_fingerprint(tmp_path / "a.inp", "mesh")
    (tmp_path / "parts" / "deep" / "rows.inc").write_text(node_lines(1.5 * nodes))
    assert source_fingerprint(tmp_path / "a.inp", "mesh") != before


@pytest.mark.parametrize(
    ("ending", "statement", "told"),
    [
        (ending, template.format(name), told)
        for ending, template in (("inp", "*INCLUDE, INPUT={}"), ("bdf", "INCLUDE '{}'"))
        for name, told in (
            ("a." + ending, "which includes itself"),
            ("b.inc", "line 1 of b.inc includes .*which includes itself"),
            ("none.inc", "there is no such file"),
            ("../secret.inc", "outside of the folder"),
            ("/etc/hostname", "outside of the folder"),
            ("link.inc", "outside of the folder"),
            (".", "there is no such file"),
        )
    ],
)
def test_includes_that_are_refused(ending, statement, told, tmp_path) -> None:
    folder = tmp_path / "job"
    folder.mkdir()
    (tmp_path / "secret.inc").write_text("*NODE\n")
    (folder / "link.inc").symlink_to(tmp_path / "secret.inc")
    (folder / "b.inc").write_text(statement.replace("b.inc", "a." + ending) + "\n")
    with pytest.raises(InputError, match=told):
        read(folder, statement + "\n", f"a.{ending}")


def test_includes_a_thousand_deep_are_refused(tmp_path) -> None:
    for i in range(990):
        (tmp_path / f"n{i}.inc").write_text(f"*INCLUDE, INPUT=n{i + 1}.inc\n")
    with pytest.raises(InputError, match="more than 100 files include each other in a row"):
        read(tmp_path, "*INCLUDE, INPUT=n0.inc\n")


CARDS = {
    **dict.fromkeys(
        ("*NGEN", "*NFILL", "*NCOPY, CHANGE NUMBER=100, OLD SET=a, SHIFT", "*ELGEN", "*ELCOPY"), "write all"
    ),
    **dict.fromkeys(("*TIE, NAME=t", "*Embedded Element"), "merge the meshes"),
    **dict.fromkeys(
        ("*MPC", "*Equation", "*RIGID BODY, REF NODE=1, NSET=a", "*COUPLING", "*KINEMATIC COUPLING"), "delete"
    ),
    **dict.fromkeys(("*MASS, ELSET=a", "*SPRING", "*Shell Section, elset=a", "*BEAM SECTION"), "delete"),
    "*PARAMETER": "write numbers",
    "*NODES": r"did you mean \*NODE",
    "*ELEMENTS, TYPE=C3D10": r"did you mean \*ELEMENT",
    "*ELEMENT, TYPE=MASS\n1, 1": "elements of type MASS are not supported",
    "*ADJUST, NODE SET=a": r"\*ADJUST makes or moves nodes",
    "*FOUNDATION\na, F1, 5.": r"\*FOUNDATION adds mass or stiffness",
    "*ELEMENT, TYPE=B31\n1, 1, 2": "elements of type B31 are not supported",
    "*NODE, SYSTEM=S": "system 'S'",
    "*NODE\n1, 5., 5., 5.": "node 1 is defined twice",
    "*ELEMENT, TYPE=C3D10\n1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 1": "element 1 is defined twice",
    "*ELEMENT, TYPE=C3D10\n99, 1, 2, 3, 4, 5, 6": "the element 99 has 6 of its 10 nodes",
    "*ELEMENT, TYPE=C3D4\n99, 1, 2, 3, 4, 5, 6": "the element 99 of type C3D4 must have 4 nodes",
    "*ELEMENT, TYPE=C3D4\n99, 1, 2, 3, 9999": "element 99 has the node '9999', which is not defined",
    "*NODE\n999, 1., x, 3.": "is no node",
    "*NSET, NSET=a\n1, nobody": "names 'nobody', which is neither a number nor a set",
    "*NSET, NSET=a\nb\n*NSET, NSET=b\na": "contains itself",
    "*NSET, NSET=a, GENERATE\n1, 5, 0": "is no range",
    "*NSET, NSET=a, INSTANCE=I\n1": "there is no instance 'I'",
    "*NSET\n1": "has no NSET=",
    "*INSTANCE, NAME=I, PART=P": "there is no part 'P'",
    "*PART, NAME=P\n*END PART\n*INSTANCE, NAME=I, PART=P": "the instance I does not end",
    "*ELEMENT, TYPE=C3D10,": "the file ends",
}


@pytest.mark.parametrize("card", CARDS)
def test_cards_that_are_refused_by_name(card, plain, tmp_path) -> None:
    nodes, tets = plain
    head = f"*NODE\n{node_lines(nodes)}*ELEMENT, TYPE=C3D10\n{tet_lines(tets)}"
    with pytest.raises(InputError, match=CARDS[card]):
        read(tmp_path, head + card + "\n")


def test_numbers_of_sets_that_are_not_there_are_reported(plain, tmp_path) -> None:
    nodes, tets = plain
    text = (
        f"*NODE\n{node_lines(nodes)}*ELEMENT, TYPE=C3D10\n{tet_lines(tets)}*NSET, NSET=top\n{rows([*top(nodes), 7777])}"
    )
    mesh = read(tmp_path, text)
    same(mesh, plain)
    assert "set top lists 1 numbers that the file does not define" in mesh.notes[0]


# ---- gmsh ----


def by_gmsh(folder: Path, version: float, **options: float) -> MeshFile:
    with gmsh_session("box") as gmsh:
        gmsh.model.occ.addBox(0, 0, 0, 3, 2, 1)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(2, [1], 7, "low x")
        gmsh.model.addPhysicalGroup(2, [1, 3], 8, "both")
        gmsh.model.addPhysicalGroup(3, [1], 9, "body")
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(2)
        if options.pop("sparse", 0):
            tags = gmsh.model.mesh.getNodes()[0]
            gmsh.model.mesh.renumberNodes(tags, 3 * tags + 1000)
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        for key, value in options.items():
            gmsh.option.setNumber(f"Mesh.{key}", value)
        gmsh.write(str(folder / "a.msh"))
        for key in options:
            gmsh.option.setNumber(f"Mesh.{key}", 0)
    return read_mesh_file(folder / "a.msh", "mesh", 1.0)


@pytest.mark.parametrize("version", [2.2, 4.0, 4.1])
def test_all_forms_of_gmsh_files(version, tmp_path) -> None:
    base = by_gmsh(tmp_path, 4.1)
    centres = np.sort(base.nodes[base.tets].mean(axis=1), axis=0)
    forms = [
        {},
        {"SaveAll": 1},
        {"SaveParametric": 1},
        {"sparse": 1},
        *([{"Binary": 1, "SaveAll": 1}] if version != 4.0 else []),
    ]
    for options in forms:
        mesh = by_gmsh(tmp_path, version, **options)
        assert mesh.tets.shape == base.tets.shape, options
        np.testing.assert_allclose(np.sort(mesh.nodes[mesh.tets].mean(axis=1), axis=0), centres, atol=1e-9)
        if version == 2.2 and "SaveAll" in options:  # gmsh then writes no groups into the old format
            continue
        at = mesh.nodes[mesh.group("low x", "g")]
        assert np.ptp(at, axis=0) == pytest.approx([0.0, 2.0, 1.0])
        assert len(mesh.group("body", "g")) == len(np.unique(mesh.tets))
        assert np.ptp(mesh.nodes[mesh.group("both", "g")], axis=0) == pytest.approx([3.0, 2.0, 1.0])


BEFORE = {"blank line": b"\n", "mark of UTF-8": b"\xef\xbb\xbf", "comments": b"$Comments\nby hand\n$EndComments\n"}


@pytest.mark.parametrize("before", BEFORE)
def test_what_may_stand_before_a_gmsh_file(before, tmp_path) -> None:
    """With a blank line or a mark before it, gmsh itself takes the file for a script."""
    base = by_gmsh(tmp_path, 4.1)
    path = tmp_path / "a.msh"
    path.write_bytes(BEFORE[before] + path.read_bytes())
    mesh = read_mesh_file(path, "mesh", 1.0)
    np.testing.assert_array_equal(mesh.nodes[mesh.tets], base.nodes[base.tets])
    assert mesh.groups.keys() == base.groups.keys()


SCRIPT = 'SystemCall "touch {0}";\n'


@pytest.mark.parametrize("ending", ["msh", "unv", "med", "mesh"])
@pytest.mark.parametrize("before", ["", "// ", "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n", "\n$Comments\n", "    -1\n"])
def test_no_mesh_file_runs_code(ending, before, tmp_path) -> None:
    """gmsh runs scripts of its language whatever the ending is."""
    mark = tmp_path / "ran"
    (tmp_path / f"a.{ending}").write_text(before + SCRIPT.format(mark))
    with pytest.raises(InputError, match=f"a.{ending}"):
        read_mesh_file(tmp_path / f"a.{ending}", "mesh", 1.0)
    assert not mark.exists()


@pytest.mark.parametrize("ending", ["msh", "unv", "med", "mesh"])
def test_nothing_beside_a_mesh_file_runs(ending, tmp_path, monkeypatch) -> None:
    """gmsh merges FILE.opt, a script; Python imports from the working folder."""
    mark = tmp_path / "ran"
    with gmsh_session("box") as gmsh:
        gmsh.model.occ.addBox(0, 0, 0, 3, 2, 1)
        gmsh.model.occ.synchronize()
        gmsh.model.mesh.generate(3)
        gmsh.write(str(tmp_path / f"a.{ending}"))
    for name in (f"a.{ending}.opt", ".gmshrc", "gmshrc", ".gmsh-options"):
        (tmp_path / name).write_text(SCRIPT.format(mark))
    for name in ("numpy", "gmsh", "sitecustomize", "resource"):
        (tmp_path / f"{name}.py").write_text(f"open({str(mark)!r}, 'w').close()\n")
    monkeypatch.chdir(tmp_path)
    assert read_mesh_file(Path(f"a.{ending}"), "mesh", 1.0).tets.shape[1] == 4
    assert not mark.exists()


# ---- Nastran ----


def bulk(nodes: np.ndarray, tets: np.ndarray, systems: str = "", own: str = "") -> str:
    grids = "".join(f"GRID,{i + 1},{own},{x!r},{y!r},{z!r}\n" for i, (x, y, z) in enumerate(nodes.tolist()))
    cells = "".join(
        f"CTETRA,{e + 1},1,{','.join(str(n + 1) for n in tet[:6])}\n,{','.join(str(n + 1) for n in tet[6:])}\n"
        for e, tet in enumerate(tets)
    )
    return f"BEGIN BULK\n{systems}{grids}{cells}ENDDATA\nGRID,9999,,x\n"


@pytest.mark.parametrize("kind", ["R", "C", "S"])
@pytest.mark.parametrize("how", ["CORD2", "chain", "CORD1", "GRDSET"])
def test_coordinate_systems_of_nastran(kind, how, plain, tmp_path) -> None:
    """Nodes in rectangular, cylindrical and spherical systems, turned, one in another, by points and by nodes."""
    nodes, tets = plain
    frame = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    frame *= np.sign(np.linalg.det(frame))
    origin = np.array([7.0, -11.0, 13.0])
    x, y, z = ((nodes - origin) @ frame).T
    if kind == "C":
        local = np.column_stack([np.hypot(x, y), np.degrees(np.arctan2(y, x)), z])
    elif kind == "S":
        r = np.sqrt(x**2 + y**2 + z**2)
        local = np.column_stack([r, np.degrees(np.arccos(z / r)), np.degrees(np.arctan2(y, x))])
    else:
        local = np.column_stack([x, y, z])
    a, b, c = origin, origin + 2 * frame[:, 2], origin + 3 * frame[:, 0] + frame[:, 2]

    def cord2(number: int, letter: str, points: list[np.ndarray], within: str = "") -> str:
        cells = [f"{v!r}" for v in np.concatenate(points).tolist()]
        return f"CORD2{letter},{number},{within},{','.join(cells[:6])}\n,{','.join(cells[6:])}\n"

    systems, own = cord2(5, kind, [a, b, c]), "5"
    if how == "GRDSET":
        systems, own = systems + "GRDSET,,5\n", ""
    elif how == "chain":  # in a cylindrical system that is moved along z
        inner = [np.array([np.hypot(*p[:2]), np.degrees(np.arctan2(p[1], p[0])), p[2] - 50]) for p in (a, b, c)]
        outer = cord2(4, "C", [np.array([0.0, 0, 50]), np.array([0.0, 0, 60]), np.array([1.0, 0, 50])])
        systems = cord2(5, kind, inner, "4") + outer
    elif how == "CORD1":
        points = [f"GRID,{900 + i},,{','.join(f'{v!r}' for v in p.tolist())}\n" for i, p in enumerate((a, b, c))]
        systems = "".join(points) + f"CORD1{kind},5,900,901,902\n"
    mesh = read(tmp_path, bulk(local, tets, systems, own), "a.bdf")
    np.testing.assert_allclose(mesh.nodes[mesh.tets], nodes[tets], atol=1e-9)


def test_bulk_data_that_includes(plain, tmp_path) -> None:
    nodes, tets = plain
    grids, cells = bulk(nodes, tets).split("CTETRA", 1)
    (tmp_path / "grids.bdf").write_text(grids.removeprefix("BEGIN BULK\n"))
    (tmp_path / "cells.bdf").write_text("CTETRA" + cells.split("ENDDATA")[0])
    mesh = read(tmp_path, "SOL 103\nBEGIN BULK\nINCLUDE 'grids.bdf'\ninclude cells.bdf\nENDDATA\n", "a.bdf")
    np.testing.assert_allclose(mesh.nodes[mesh.tets], nodes[tets], atol=1e-12)


def test_fields_beside_their_columns(plain, tmp_path) -> None:
    """A continuation whose fields all stand one column too far right: read, and reported."""
    nodes, tets = plain
    system = "CORD2R         7              0.      0.    100.      0.      0.    200.\n"
    text = bulk(nodes - [0, 0, 100], tets, system + "+            100.      0.    100.\n", "7")
    mesh = read(tmp_path, text, "a.bdf")
    np.testing.assert_allclose(mesh.nodes[mesh.tets], nodes[tets], atol=1e-9)
    assert "line 3 of a.bdf: the fields are off their columns" in mesh.notes[0]


ENTRIES = {
    **dict.fromkeys(("RBE2,9,1,123456,2,3", "RBE3,9,,1,123", "MPC,1,1,1,1.,2,1,-1.", "RBAR,9,1,2"), "ties nodes"),
    **dict.fromkeys(("CONM2,9,1,,2.", "CELAS2,9,1.,1,1", "PSHELL,1,1,2.", "PBAR,1,1,2.", "CBUSH,9,1,1,2"), "adds mass"),
    "CORD2R,5,,0.,0.,0.,0.,0.,1.\n,0.,0.,2.\nGRID,77,5,1.,1.,1.": "lie in a line",
    "CORD2R,5,6,0.,0.,0.,0.,0.,1.\n,1.,0.,2.\nCORD2R,6,5,0.,0.,0.,0.,0.,1.\n,1.,0.,2.\nGRID,77,5,1.,1.,1.": "by itself",
    "CORD1R,5,1,2,8888\nGRID,77,5,1.,1.,1.": "there is no node 8888",
    "GRID,1,,9.,9.,9.": "node 1 is defined twice",
    "CTETRA,1,1,2,3,4,5": "element 1 is defined twice",
    "CTETRA,99,1,1,2,3,8888": "has the node 8888, which no GRID entry defines",
    "BEGIN SUPER=1": "begins a superelement",
}


@pytest.mark.parametrize("entry", ENTRIES)
def test_entries_that_are_refused_by_name(entry, plain, tmp_path) -> None:
    with pytest.raises(InputError, match=ENTRIES[entry]):
        read(tmp_path, bulk(*plain).split("ENDDATA")[0] + entry + "\n", "a.bdf")


# ---- files that are damaged ----


@pytest.mark.parametrize("codec", ["utf-8", "latin-1", "cp1252"])
@pytest.mark.parametrize("ending", ["inp", "bdf"])
def test_comments_in_any_encoding(codec, ending, plain, tmp_path) -> None:
    """Pre-processors write comments, and names of sets, in the encoding of their system."""
    nodes, tets = plain
    text = f"** Geh\u00e4use\n*NODE\n{node_lines(nodes)}*ELEMENT, TYPE=C3D10\n{tet_lines(tets)}"
    text += f"*NSET, NSET=F\u00fc\u00dfe\n{rows(top(nodes))}"
    path = tmp_path / f"a.{ending}"
    path.write_bytes((text if ending == "inp" else "$ Geh\u00e4use\n" + bulk(nodes, tets, "", "")).encode(codec))
    mesh = read_mesh_file(path, "mesh", 1.0)
    if ending == "inp":
        same(mesh, plain, "F\u00fc\u00dfe")
    assert mesh.tets.shape == tets.shape


def test_numbers_of_physical_groups_that_meshio_converts(plain, tmp_path) -> None:
    """gmsh's physical groups become cell data of that name; its numbers of surfaces are no groups."""
    nodes, tets = plain
    half = np.where(nodes[tets].mean(axis=1)[:, 0] < 15.0, 1, 2)
    other = np.ones(len(tets), dtype=int)
    data = {"gmsh:physical": [half], "gmsh:geometrical": [other]}
    meshio.write(tmp_path / "a.vtu", meshio.Mesh(nodes, [("tetra10", tets)], cell_data=data))
    groups = read_mesh_file(tmp_path / "a.vtu", "mesh", 1.0).groups
    assert groups.keys() == {"1", "2"}
    np.testing.assert_array_equal(groups["2"], np.unique(tets[half == 2]))


def test_marks_are_0_and_1_in_all_blocks_of_a_file(plain, tmp_path) -> None:
    """An array of numbers that are 1 in one block only is no group."""
    nodes, tets = plain
    cells = [("triangle6", tets[:3, [0, 1, 2, 4, 5, 6]]), ("tetra10", tets)]
    numbers = [np.array([1, 2, 3]), np.ones(len(tets), dtype=int)]
    marks = [np.array([1, 0, 1]), np.zeros(len(tets), dtype=int)]
    meshio.write(tmp_path / "a.vtu", meshio.Mesh(nodes, cells, cell_data={"part": numbers, "wall": marks}))
    groups = read_mesh_file(tmp_path / "a.vtu", "mesh", 1.0).groups
    assert groups.keys() == {"wall"}
    np.testing.assert_array_equal(groups["wall"], np.unique(cells[0][1][[0, 2]]))


def test_no_bare_word_of_a_library(plain, tmp_path) -> None:
    """Mixed XDMF of the second order is beyond meshio, which raises KeyError(36)."""
    nodes, tets = plain
    cells = [("triangle6", tets[:3, [0, 1, 2, 4, 5, 6]]), ("tetra10", tets)]
    meshio.write(tmp_path / "a.xdmf", meshio.Mesh(nodes, cells), data_format="XML")
    with pytest.raises(InputError, match=r"cannot be read as a \.xdmf file \(it has .* that meshio does not know\)"):
        read_mesh_file(tmp_path / "a.xdmf", "mesh", 1.0)


def test_a_node_number_beyond_the_nodes(tmp_path) -> None:
    text = "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\n"
    text += "POINTS 4 double\n0 0 0\n50 0 0\n0 50 0\n0 0 {}\nCELLS 1 5\n4 0 1 2 {}\nCELL_TYPES 1\n10\n"
    with pytest.raises(InputError, match=r"element 1 of kind tetra names the node 99 .* has 4 nodes"):
        read(tmp_path, text.format(50, 99), "a.vtk")
    with pytest.raises(InputError, match=r"node 4 .* not a finite number"):
        read(tmp_path, text.format("nan", 3), "a.vtk")


def test_xdmf_takes_numbers_from_its_folder_only(plain, tmp_path) -> None:
    nodes, tets = plain
    (tmp_path / "job").mkdir()
    here = Path.cwd()
    os.chdir(tmp_path / "job")  # meshio writes the numbers into the working folder
    try:
        meshio.write("a.xdmf", meshio.Mesh(nodes, [("tetra10", tets)]))
    finally:
        os.chdir(here)
    path = tmp_path / "job" / "a.xdmf"
    assert read_mesh_file(path, "mesh", 1.0).tets.shape == tets.shape
    before = source_fingerprint(path, "mesh")
    (tmp_path / "job" / "a.h5").rename(tmp_path / "a.h5")
    assert source_fingerprint(path, "mesh") != before
    path.write_text(path.read_text().replace("a.h5", "../a.h5"))
    with pytest.raises(InputError, match="outside of the folder"):
        read_mesh_file(path, "mesh", 1.0)


@pytest.mark.parametrize("ending", ["inp", "bdf", "vtk", "vtu", "msh", "unv", "med", "mesh"])
def test_damaged_files_are_refused_in_words(ending, plain, tmp_path) -> None:
    """Random faults give a mesh or an `InputError`, never anything else; a process for each where gmsh reads."""
    nodes, tets = plain
    path = tmp_path / f"a.{ending}"
    if ending == "inp":
        sets = f"*NSET, NSET=top\n{rows(top(nodes))}*SURFACE, NAME=s\n1, S1\n"
        path.write_text(
            part(nodes, tets, sets=sets)
            + "*ASSEMBLY\n*INSTANCE, NAME=I, PART=P\n1.,2.,3.\n0,0,0,0,0,1,30\n*END INSTANCE\n*END ASSEMBLY\n"
        )
    elif ending == "bdf":
        path.write_text(bulk(nodes, tets, "CORD2R,5,,0.,0.,0.,0.,0.,1.\n,1.,0.,1.\n", "5"))
    elif ending.startswith("vt"):
        marks = {"top": np.isin(np.arange(len(nodes)) + 1, top(nodes)).astype(np.int64)}
        meshio.write(path, meshio.Mesh(nodes, [("tetra10", tets)], point_data=marks))
    else:
        with gmsh_session("box") as gmsh:
            gmsh.model.occ.addBox(0, 0, 0, 3, 2, 1)
            gmsh.model.occ.synchronize()
            gmsh.option.setNumber("Mesh.MeshSizeMin", 2)
            gmsh.model.mesh.generate(3)
            gmsh.write(str(path))
            gmsh.option.setNumber("Mesh.MeshSizeMin", 0)
    content = path.read_bytes()
    rng = np.random.default_rng(40)
    refused = 0
    for _ in itertools.repeat(None, 200 if ending in ("inp", "bdf", "vtk", "vtu") else 4):
        path.write_bytes(damaged(content, rng))
        try:
            read_mesh_file(path, "mesh", 1.0)
        except InputError:
            refused += 1
    assert refused > 0
