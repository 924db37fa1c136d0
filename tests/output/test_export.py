"""Meshes for other programs, read back."""

import re

import meshio
import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.fem.meshing.session import gmsh_session
from gearfe.gears.teeth.tooth_sector import sector_mesh, sector_recipes
from gearfe.gears.teeth.whole_gear import whole_gear
from gearfe.output.exchange.mesh_export import MeshPart, export_mesh
from tests.makers.gears import pair


@pytest.fixture(scope="module")
def parts():
    gears = pair(17, 23, tip_round=0.1e-3)
    made = {}
    for name, gear, recipe, x in zip(
        ("pinion", "wheel"), (gears.pinion, gears.wheel), sector_recipes(gears, coarsen=4.0), (0.0, 50e-3), strict=True
    ):
        whole = whole_gear(sector_mesh(gear, recipe))
        made[name] = MeshPart(whole.points + np.array([x, 0.0]), whole.triangles, whole.boundaries)
    return made


def together(parts):
    first, points, bodies, edges = 0, [], {}, {}
    for name, part in parts.items():
        points.append(part.points)
        bodies[name] = part.triangles + first
        edges |= {f"{name}_{key}": value + first for key, value in part.boundaries.items()}
        first += len(part.points)
    return 1e3 * np.concatenate(points), bodies, edges


def test_msh(tmp_path, parts):
    path = tmp_path / "pair.msh"
    counts = export_mesh(path, parts)
    points, bodies, edges = together(parts)
    assert counts == {name: len(nodes) for name, nodes in {**bodies, **edges}.items()}
    mesh = meshio.read(path)
    np.testing.assert_allclose(mesh.points[:, :2], points, atol=1e-12)
    for name, (tag, dimension) in mesh.field_data.items():
        kind = "triangle6" if dimension == 2 else "line3"
        found = np.concatenate(
            [
                c.data[t == tag]
                for c, t in zip(mesh.cells, mesh.cell_data["gmsh:physical"], strict=True)
                if c.type == kind
            ]
        )
        expected = bodies[name] if dimension == 2 else edges[name][:, [0, 2, 1]]
        np.testing.assert_array_equal(found, expected, err_msg=name)
    assert set(mesh.field_data) == set(counts)


def test_msh_opens_in_gmsh_with_its_names(tmp_path, parts):
    path = tmp_path / "pair.msh"
    counts = export_mesh(path, parts)
    with gmsh_session() as gmsh:
        gmsh.merge(str(path))
        groups = {gmsh.model.getPhysicalName(*group): group for group in gmsh.model.getPhysicalGroups()}
        assert set(groups) == set(counts)
        entity = gmsh.model.getEntitiesForPhysicalGroup(*groups["wheel_bore"])[0]
        kinds, numbers, _ = gmsh.model.mesh.getElements(1, entity)
        assert list(kinds) == [8]  # second-order line
        assert len(numbers[0]) == counts["wheel_bore"]


def test_vtu(tmp_path, parts):
    path = tmp_path / "pair.vtu"
    export_mesh(path, parts)
    points, bodies, edges = together(parts)
    mesh = meshio.read(path)
    np.testing.assert_allclose(mesh.points[:, :2], points, atol=1e-12)
    assert sum(len(c.data) for c in mesh.cells if c.type == "triangle6") == sum(map(len, bodies.values()))
    for name, nodes in edges.items():
        np.testing.assert_array_equal(np.flatnonzero(mesh.point_data[name]), np.unique(nodes))


@pytest.mark.parametrize(("plane", "kind"), [("strain", "CPE6"), ("stress", "CPS6")])
def test_inp(tmp_path, parts, plane, kind):
    path = tmp_path / "pair.inp"
    export_mesh(path, parts, plane=plane)
    points, bodies, edges = together(parts)
    text = path.read_text()
    assert set(re.findall(r"TYPE=(\w+)\n", text)) == {kind, "ELEMENT"}
    assert max(map(len, re.findall(r"[^,\n ]*e[-+]\d\d", text))) <= 20  # what CalculiX reads of a number
    readable = tmp_path / "readable.inp"
    readable.write_text(text.replace("CPS6", "CPE6"))  # meshio knows one of the two
    mesh = meshio.read(readable)
    np.testing.assert_allclose(mesh.points[:, :2], points, atol=1e-12)
    triangles = np.concatenate([c.data for c in mesh.cells])
    np.testing.assert_array_equal(triangles, np.concatenate(list(bodies.values())))
    for name, nodes in edges.items():
        np.testing.assert_array_equal(np.sort(mesh.point_sets[name]), np.unique(nodes))
        rows = re.search(rf"\*SURFACE, NAME=S_{name}, TYPE=ELEMENT\n((?:\d+, S\d\n)+)", text).group(1).splitlines()
        face = {"1": [0, 3, 1], "2": [1, 4, 2], "3": [2, 5, 0]}  # the format's faces of a six-node triangle
        found = [triangles[int(row.split(",")[0]) - 1][face[row[-1]]] for row in rows]
        np.testing.assert_array_equal(np.sort(found, axis=1), np.sort(nodes, axis=1))


def test_one_part(tmp_path, parts):
    counts = export_mesh(tmp_path / "pinion.msh", {"pinion": parts["pinion"]})
    assert set(counts) == {"pinion", *(f"pinion_{b}" for b in ("bore", "root", "flank_right", "flank_left", "tip"))}


def test_unknown_format(tmp_path, parts):
    with pytest.raises(InputError, match=r"must end in one of \.msh, \.vtu, \.inp"):
        export_mesh(tmp_path / "pair.stl", parts)
    assert not list(tmp_path.iterdir())
