"""Housings from mesh files: the same body from every format, bores by groups and by axes, mistakes, reduced bodies."""

from __future__ import annotations

import dataclasses
import json
import math
import shutil
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest

from gearfe.base.config import build
from gearfe.base.errors import InputError
from gearfe.base.tables.housing import HousingTable
from gearfe.cli.main import main
from gearfe.drivetrain.gearbox.job import bore_places, job_train, read_train_job, train_body
from gearfe.drivetrain.gearbox.mesh_stiffness import train_curves
from gearfe.drivetrain.housing.attachments import Bore
from gearfe.drivetrain.housing.body import reduced_housing
from gearfe.drivetrain.housing.build import housing_from_job, housing_from_table
from gearfe.drivetrain.housing.model import Housing
from gearfe.drivetrain.housing.own_mesh import fitted_cylinder
from gearfe.drivetrain.train import build_train
from gearfe.fem.meshing.mesh_file import read_mesh_file
from gearfe.fem.meshing.session import gmsh_session
from tests.places import MESHES

pytestmark = pytest.mark.usefixtures("own_cache")

BORES = [{"group": f"bore_{i}"} for i in (1, 2, 3, 4)]
#: The reference points that scripts/build/make_box.py builds: middles of walls 8 mm thick.
POINTS = [(0.0, 31.0, 0.0), (0.0, -31.0, 0.0), (62.5, 31.0, 0.0), (62.5, -31.0, 0.0)]


def table(**keys: Any) -> HousingTable:
    return build(HousingTable, {"mesh": "box.msh", "bores": BORES, "held": [{"group": "feet"}], **keys}, "housing")


@pytest.fixture(scope="module")
def box() -> Housing:
    return housing_from_table(table(), MESHES)


@pytest.fixture(scope="module")
def formats(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The box as other programs write it; groups are marks, sets, or numbers."""
    folder = tmp_path_factory.mktemp("formats")
    found = read_mesh_file(MESHES / "box.msh", "mesh", 1.0)
    names = ["feet", *(b["group"] for b in BORES)]
    points, cells = found.nodes, [("tetra10", found.tets)]
    marks = {name: np.isin(np.arange(len(points)), found.groups[name]).astype(np.int64) for name in names}
    meshio.write(folder / "box.vtu", meshio.Mesh(points, cells, point_data=marks))
    meshio.write(folder / "metres.vtu", meshio.Mesh(1e-3 * points, cells, point_data=marks))
    meshio.write(folder / "old.msh", meshio.read(MESHES / "box.msh"), file_format="gmsh22")
    shutil.copy(MESHES / "box.inp", folder)
    with gmsh_session("formats") as gmsh:
        gmsh.open(str(MESHES / "box.msh"))
        for name in ("box.unv", "box.med", "bulk.bdf"):
            gmsh.write(str(folder / name))
    (folder / "box.bdf").write_text("SOL 103\nBEGIN BULK\n" + (folder / "bulk.bdf").read_text())
    return folder


def same(one: Housing, other: Housing) -> None:
    """Equal bodies, whatever the order of nodes and elements in the files: mass, held nodes, attachments."""

    def places(housing: Housing, numbers: np.ndarray) -> np.ndarray:
        at = np.round(1e3 * housing.nodes[numbers], 6) + 0.0
        return at[np.lexsort(at.T)]

    assert len(one.nodes) == len(other.nodes)
    assert one.mesh.cells.shape == other.mesh.cells.shape
    assert other.mass_kg == pytest.approx(one.mass_kg, rel=1e-9)
    np.testing.assert_allclose(places(other, other.fixed), places(one, one.fixed), atol=2e-6)
    assert [a.name for a in other.attachments] == [a.name for a in one.attachments]
    for mine, yours in zip(one.attachments, other.attachments, strict=True):
        np.testing.assert_allclose(yours.point, mine.point, atol=1e-9)
        np.testing.assert_allclose(yours.axis, mine.axis, atol=1e-9)
        np.testing.assert_allclose(places(other, yours.nodes), places(one, mine.nodes), atol=2e-6)


def test_the_shipped_box(box) -> None:
    """Volume and places as scripts/build/make_box.py builds them."""
    volume = 151 * 70 * 94 - 135 * 54 * 84 + 4 * 26 * 20 * 8 - 4 * math.pi * 100 * 8
    assert box.mass_kg == pytest.approx(7850e-9 * volume, rel=1e-3)
    for made, point in zip(box.attachments, POINTS, strict=True):
        np.testing.assert_allclose(1e3 * made.point, point, atol=1e-6)
        np.testing.assert_allclose(made.axis, [0, 1, 0], atol=1e-9)
    assert box.nodes[box.fixed, 2] == pytest.approx(np.full(len(box.fixed), -0.060))
    assert any("151 x 70 x 102 mm" in note for note in box.notes)


@pytest.mark.parametrize(
    "mesh", ["box.inp", "box.vtu", {"file": "metres.vtu", "unit": "m"}, "old.msh", "box.unv", "box.med"]
)
def test_formats(mesh, box, formats) -> None:
    same(box, housing_from_table(table(mesh=mesh), formats))


def test_an_instance_of_a_part(box, tmp_path) -> None:
    """The shipped file of Abaqus as a part that its instance moves and turns back: mass, frequencies, bores."""
    mesh = read_mesh_file(MESHES / "box.msh", "mesh", 1.0)
    away = np.column_stack([-mesh.nodes[:, 1], mesh.nodes[:, 0], mesh.nodes[:, 2]]) - [100.0, 0.0, 0.0]
    rows = [f"{i + 1}, {x!r}, {y!r}, {z!r}" for i, (x, y, z) in enumerate(away.tolist())]
    text = ["*PART, NAME=Box", "*NODE", *rows, "*ELEMENT, TYPE=C3D10"]
    text += [", ".join(str(n) for n in (e + 1, *(tet + 1))) for e, tet in enumerate(mesh.tets)]
    text += ["*END PART", "*ASSEMBLY, NAME=A", "*INSTANCE, NAME=Box-1, PART=Box", "100., 0., 0."]
    text += ["0., 0., 0., 0., 0., 1., -90.", "*END INSTANCE"]
    for name in ("feet", *(b["group"] for b in BORES)):
        numbers = np.intersect1d(mesh.groups[name], mesh.tets) + 1
        text += [f"*NSET, NSET={name}, INSTANCE=Box-1", *(str(n) for n in numbers)]
    (tmp_path / "box.inp").write_text("\n".join([*text, "*END ASSEMBLY", ""]))
    other = housing_from_table(table(mesh="box.inp"), tmp_path)
    same(box, other)
    one, two = (h.reduce(6, quasi_static=0, estimate=False).coupled.frequencies_hz[:6] for h in (box, other))
    assert two == pytest.approx(one, rel=1e-8)


@pytest.mark.parametrize(
    ("ending", "group"),
    [("inp", "Surface1"), ("bdf", "1"), ("med", None), ("mesh", "1"), ("unv", None), ("vtk", None), ("msh", None)],
)
def test_what_gmsh_writes(ending, group, tmp_path) -> None:
    """As a user's first export comes, without groups of his own: triangles beside the tetrahedra, no BEGIN BULK, ..."""
    with gmsh_session("box") as gmsh:
        gmsh.model.occ.addBox(0, 0, 0, 3, 2, 1)
        gmsh.model.occ.synchronize()
        gmsh.option.setNumber("Mesh.SaveAll", 1)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(2)
        gmsh.write(str(tmp_path / f"box.{ending}"))
    mesh = read_mesh_file(tmp_path / f"box.{ending}", "housing.mesh", 1.0)
    assert mesh.tets.shape[1] == 10
    assert np.ptp(mesh.nodes[mesh.tets].reshape(-1, 3), axis=0) == pytest.approx([3.0, 2.0, 1.0])
    if group is not None:
        on = mesh.nodes[mesh.group(group, "group")]
        assert np.ptp(on, axis=0)[1:] == pytest.approx([2.0, 1.0])


def test_nastran_groups_are_numbers_of_properties(box, formats) -> None:
    """Coordinates of a file with fields of eight characters are rounded to some um; bores are groups by number."""
    found = read_mesh_file(formats / "box.bdf", "mesh", 1.0)
    assert found.tets.shape == box.mesh.cells.shape
    bores = [name for name, nodes in found.groups.items() if len(nodes) == len(box.attachments[0].nodes)]
    made = housing_from_table(table(mesh="box.bdf", bores=[{"group": name} for name in bores], held=[]), formats)
    assert made.mass_kg == pytest.approx(box.mass_kg, rel=1e-5)
    points = sorted(tuple(np.round(1e3 * a.point, 2) + 0.0) for a in made.attachments)
    assert points == sorted(POINTS)


def test_frequencies_of_both_shipped_files(box) -> None:
    other = housing_from_table(table(mesh="box.inp"), MESHES)
    one, two = (h.reduce(6, quasi_static=0, estimate=False).coupled.frequencies_hz[:6] for h in (box, other))
    assert two == pytest.approx(one, rel=1e-8)


def test_bores_by_axis_and_held_planes(box) -> None:
    """By axis, radius and range, by Python's Bore, and by groups: the same."""
    rows = [
        {"point_mm": [x, 0, 0], "direction": [0, 2, 0], "radius_mm": 10.0, "range_mm": [y - 4, y + 4]}
        for x, y, _ in POINTS
    ]
    same(box, housing_from_table(table(bores=rows, held=[{"point_mm": [0, 0, -60]}]), MESHES))
    found = read_mesh_file(MESHES / "box.msh", "mesh", 1.0)
    bores = [Bore((1e-3 * x, 0, 0), (0, 1, 0), 0.01, (1e-3 * y - 4e-3, 1e-3 * y + 4e-3)) for x, y, _ in POINTS]
    same(box, Housing.from_arrays(1e-3 * found.nodes, found.tets, bores, ((0, 0, -0.06), (0, 0, 1))))
    named = housing_from_table(
        table(bores=[{"name": "flange", "group": "feet", "point_mm": [37, 0, -60]}], held=[]), MESHES
    )
    assert [a.name for a in named.attachments] == ["flange"]
    assert named.attachments[0].point == pytest.approx([0.037, 0, -0.06])
    assert len(named.fixed) == 0


def test_faces_of_the_inside_do_not_radiate(box) -> None:
    inner = {"file": "box.msh", "inner_box_mm": [[-30, -27, -42], [105, 27, 42]]}
    made = housing_from_table(table(mesh=inner), MESHES)
    centres = 1e3 * made.nodes[made.surface.faces[:, :3]].mean(axis=1)
    inside = (
        (np.abs(centres[:, 1]) < 27.1) & (centres[:, 2] > -42.1) & (centres[:, 0] > -30.1) & (centres[:, 0] < 105.1)
    )
    assert not (inside & (centres[:, 2] < 41.9)).any()
    assert len(made.surface.faces) < len(box.surface.faces)


@pytest.mark.parametrize("seed", range(6))
def test_cylinders_are_found(seed) -> None:
    """Any axis, a third of the round at least, rings or long tubes: to rounding."""
    rng = np.random.default_rng(seed)
    frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    radius, length = 10 ** rng.uniform(-3, 0), 10 ** rng.uniform(-3, 0)
    angle = rng.uniform(0, rng.uniform(2.1, 6.28), 60)
    local = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), rng.uniform(0, length, 60)])
    centre = rng.normal(size=3)
    point, axis, found, off = fitted_cylinder(centre + local @ frame)
    assert found == pytest.approx(radius, rel=1e-7)
    assert off < 1e-8 * max(radius, length)
    assert abs(axis @ frame[2]) == pytest.approx(1.0, abs=1e-12)
    assert np.linalg.norm(np.cross(point - centre, axis)) < 1e-7 * max(radius, length)


@pytest.mark.parametrize(
    ("axes", "turned"),
    [
        (["x", "z", "-y"], lambda x, y, z: (x, -z, y)),  # shafts along z in the file
        (["-y", "x", "z"], lambda x, y, z: (y, -x, z)),  # along x
    ],
)
def test_a_file_in_other_axes(box, axes, turned, tmp_path) -> None:
    """The box as a program with other axes and another origin writes it: the same body."""
    found, shift = read_mesh_file(MESHES / "box.msh", "mesh", 1.0), np.array([100.0, -20.0, 7.0])
    names = ["feet", *(b["group"] for b in BORES)]
    marks = {name: np.isin(np.arange(len(found.nodes)), found.groups[name]).astype(np.int64) for name in names}
    points = np.column_stack(turned(*found.nodes.T)) + shift
    meshio.write(tmp_path / "turned.vtu", meshio.Mesh(points, [("tetra10", found.tets)], point_data=marks))
    mesh = {"file": "turned.vtu", "axes": axes, "origin_mm": shift.tolist()}
    same(housing_from_table(table(mesh=mesh), tmp_path), box)


def test_groups_without_names_are_told_with_their_places(formats) -> None:
    with pytest.raises(InputError, match=r"it has: .*\d+ \(about 62\.5, 31, 0 mm\)"):
        housing_from_table(table(mesh="box.bdf"), formats)


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"mesh": "none.msh"}, r"housing\.mesh = '.*none\.msh': there is no such file"),
        ({"mesh": "box.xyz"}, "ending that is not known"),
        ({"mesh": "bad.vtk"}, r"bad\.vtk.*cannot be read as a \.vtk file"),
        ({"mesh": "bad.msh"}, r"bad\.msh.: is no \.msh file: it begins with .*not with .\$MeshFormat"),
        ({"mesh": "surface.stl"}, "is a surface, which has no tetrahedra; mesh its inside"),
        ({"mesh": "shell.vtu"}, "has no tetrahedra, but 1 triangle; mesh its inside"),
        ({"mesh": "broken.unv"}, r"broken\.unv.*is no \.unv file"),
        ({"mesh": "bricks.vtu"}, "must have tetrahedra of one order only, but it has 1 hexahedron"),
        ({"bores": [{"group": "bore_5"}]}, r"bores\[0\]\.group = 'bore_5': there is no such group.*feet.*bore_"),
        ({"bores": [{"group": "feet"}]}, r"bores\[0\]\.group = 'feet': .*are no cylinder: they lie in a plane"),
        ({"bores": [{"point_mm": [0, 0, 0], "radius_mm": 5}]}, r"bores\[0\] = '1': no node lies within"),
        (
            {"bores": [{"point_mm": [0, 0, 0], "radius_mm": 10, "range_mm": [100, 120]}]},
            "from 100 to 120 mm along the axis, counted from its point: .* between -35 and 35 mm",
        ),
        ({"held": [{"point_mm": [0, 0, -61]}]}, r"held\[0\] = \[0\.0, 0\.0, -61\.0\]: no node lies on this plane"),
        ({"held": [{"group": "foot"}]}, r"held\[0\]\.group = 'foot': there is no such group.*feet"),
        (
            {"mesh": {"file": "box.msh", "unit": "m"}},
            r"mesh\.unit = 'm': the mesh is 1\.51e\+05 x .* 2 mm to 50 m; write mesh = \{ file = \.\.\., unit",
        ),
        ({"bores": [*BORES, {"group": "bore_1"}]}, "box.msh.*overlaps attachment '1'"),
    ],
)
def test_mistakes_in_files(keys, told, tmp_path) -> None:
    shutil.copy(MESHES / "box.msh", tmp_path)
    for name in ("box.xyz", "bad.vtk", "bad.msh", "broken.unv", "surface.stl"):
        (tmp_path / name).write_text("nothing\n")
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
    meshio.write(tmp_path / "shell.vtu", meshio.Mesh(corners[:3], [("triangle", [[0, 1, 2]])]))
    meshio.write(tmp_path / "bricks.vtu", meshio.Mesh(corners, [("hexahedron", [list(range(8))])]))
    with pytest.raises(InputError, match=told):
        housing_from_table(table(**keys), tmp_path)


#: Four corners and six midside nodes, reals as Nastran's programs write them, properties told and left blank.
BULK = """SOL 103
CEND
BEGIN BULK
$ comment
GRID           1               0     0.0      0.
GRID*                  2                            2.+1               0       $ 20
*                -1.5-13
grid,3,,.0,2.0D1,0.0
GRID,4,0,-0,0,2.E+1
GRID           5             10.       0       0
GRID           6            1.+1    1.+1       0
GRID           7               0    1.+1       0
GRID           8               0       0    1.+1
GRID           9            1.+1       0    1.+1
GRID          10               0    1.+1    1.+1
CTETRA         7{:>8}       1       2       3       4       5       6+A
+A             7       8       9      10
CTRIA6,20,5,1,2,3,5,6,7
ENDDATA
"""


@pytest.mark.parametrize(("property_number", "groups"), [("", {"5"}), ("12", {"5", "12"})])
def test_numbers_and_properties_of_nastran(property_number, groups, tmp_path) -> None:
    """gmsh reads 2.+1 as 2, and takes the first node for a property that is left blank."""
    (tmp_path / "one.bdf").write_text(BULK.format(property_number))
    mesh = read_mesh_file(tmp_path / "one.bdf", "housing.mesh", 1.0)
    corners = np.array([[0, 0, 0], [20, 0, 0], [0, 20, 0], [0, 0, 20.0]])
    middles = [(corners[a] + corners[b]) / 2 for a, b in ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))]
    np.testing.assert_allclose(mesh.nodes[mesh.tets[0]], [*corners, *middles], atol=1e-12)
    assert set(mesh.groups) == groups
    np.testing.assert_array_equal(np.sort(mesh.groups["5"]), [0, 1, 2, 4, 5, 6])


def test_meshio_writes_nastran(tmp_path) -> None:
    """Its elements have no property."""
    found = read_mesh_file(MESHES / "box.msh", "mesh", 1.0)
    points = found.nodes.round(4)
    meshio.write(tmp_path / "box.bdf", meshio.Mesh(points, [("tetra10", found.tets)]))
    mesh = read_mesh_file(tmp_path / "box.bdf", "mesh", 1.0)
    np.testing.assert_allclose(mesh.nodes[mesh.tets], points[found.tets], atol=1e-12)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            "GRID,1,,0.,0.,0.\nGRID,2,5,1.,0.,0.\n",
            "line 2 of a.bdf: there is no coordinate system 5; the file defines: none",
        ),
        ("GRID,1,,0.,0.,x\n", r"the entry GRID \(line 1 of a.bdf\) cannot be read: .*; correct that line"),
        ("GRID,1,,0.,0.,0.\nCTETRA,1,1,1,1,1\n", r"the entry CTETRA \(line 2 of a.bdf\) cannot be read"),
        ("GRID,1,,0.,0.,0.\nCTETRA,1,1,1,2,3,4\n", "has the node 2, which no GRID entry defines"),
        ("GRID,1,,0.,0.,0.\nCHEXA,1,1,1,1,1,1,1,1,\n,1,1\n", "tetrahedra of one order only, but it has 1 hexahedron"),
        ("INCLUDE 'a.bdf'\n", "line 1 of a.bdf includes .a.bdf., which includes itself; remove that line"),
        ("hello\n", r"has no nodes \(GRID\); is the file whole"),
    ],
)
def test_mistakes_in_bulk_data(text, told, tmp_path) -> None:
    (tmp_path / "a.bdf").write_text(text)
    with pytest.raises(InputError, match=told):
        read_mesh_file(tmp_path / "a.bdf", "housing.mesh", 1.0)


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"mesh": "a.msh", "bores": BORES, "inner_gap_mm": 40.0}, "inner_gap_mm: conflicts with mesh"),
        ({"mesh": "a.msh"}, r"bores: is required with a mesh"),
        ({"bores": BORES}, "belongs to a mesh of the user's own"),
        ({"mesh": "a.msh", "bores": [{"name": "1"}]}, r"bores\[0\]\.point_mm: is required without a group"),
        ({"mesh": "a.msh", "bores": [{"group": "b", "radius_mm": 3.0}]}, "conflicts with group"),
        ({"mesh": "a.msh", "bores": BORES, "held": [{}]}, r"held\[0\]\.group: must be given, or point_mm"),
        ({"body": "a.npz", "mesh": "a.msh"}, "mesh: conflicts with body"),
        ({"body": "a.npz", "reduction": {"modes": 4}}, "reduction: a reduced body has its modes"),
        ({"mesh": {"file": "a.msh", "unit": "ft"}, "bores": BORES}, "must be one of mm, cm, m, in"),
        ({"mesh": {"file": "a.msh", "axes": ["x", "z", "y"]}, "bores": BORES}, r'right-handed; shafts along z: \["x"'),
        ({"mesh": {"file": "a.msh", "axes": ["x", "x", "z"]}, "bores": BORES}, "must name x, y and z once each"),
    ],
)
def test_mistakes_in_the_table(keys, told) -> None:
    with pytest.raises(InputError, match=told):
        build(HousingTable, keys, "housing")


def test_a_cad_file_is_meshed(tmp_path) -> None:
    """A plate of 40 x 30 x 6 mm with a hole, as STEP: its volume, and the hole as a bore."""
    with gmsh_session("plate") as gmsh:
        plate = gmsh.model.occ.addBox(0, 0, 0, 40, 30, 6)
        gmsh.model.occ.cut([(3, plate)], [(3, gmsh.model.occ.addCylinder(20, 15, 0, 0, 0, 6, 5))])
        gmsh.model.occ.synchronize()
        gmsh.write(str(tmp_path / "plate.step"))
    hole = {"point_mm": [20, 15, 0], "direction": [0, 0, 1], "radius_mm": 5.0}
    made = housing_from_table(table(mesh={"file": "plate.step", "size_mm": 8.0}, bores=[hole], held=[]), tmp_path)
    assert made.mass_kg == pytest.approx(7850e-9 * (40 * 30 - math.pi * 25) * 6, rel=2e-3)
    assert 1e3 * made.attachments[0].point == pytest.approx([20, 15, 3], abs=1e-6)


def test_commands_with_mesh_and_with_body(tmp_path, capsys) -> None:
    """gearfe housing on the shipped example, then on the reduced body that it left; trains in both are the same."""
    for name in ("box.msh", "box.toml"):
        shutil.copy(MESHES / name, tmp_path)
    text = (tmp_path / "box.toml").read_text()
    text = text.replace("[housing.reduction]", "[housing.reduction]\nleast_modes = 6").replace("10000.0", "4000.0")
    text = text.replace('driven = "wheel"', 'driven = "wheel"\nstiffness_N_per_m = 1e8')
    (tmp_path / "box.toml").write_text(text)
    own = tmp_path / "body.toml"
    own.write_text('[housing]\nbody = "first/housing.npz"\n' + text[text.index("[pair]") :])
    found = {}
    for name, job in {"first": tmp_path / "box.toml", "second": own}.items():
        assert main(["housing", str(job), "--out", str(tmp_path / name), "--modes", "5", "--no-pictures"]) == 0
        summary = json.loads((tmp_path / name / "summary.json").read_text())
        train = read_train_job(job)
        model = build_train(job_train(train, train_curves(train), train_body(train)))
        found[name] = summary["frequencies_free_attachments_Hz"], model.coupled_frequencies_hz.tolist()
        assert bore_places(train.housing, tmp_path)["3"] == pytest.approx((0.0625, 0.031, 0))
    assert found["first"] == found["second"]
    assert "the mesh is 151 x 70 x 102 mm" in capsys.readouterr().out
    assert housing_from_job(tmp_path / "box.toml").attachments[2].name == "3"
    with pytest.raises(InputError, match="is reduced"):
        housing_from_job(own)
    with pytest.raises(InputError, match=r"housing\.body = .*none\.npz"):
        reduced_housing(dataclasses.replace(train.housing, body="none.npz"), tmp_path)


def test_another_mesh_of_the_same_name_is_another_body(tmp_path) -> None:
    """The cache knows a file by its content."""
    shutil.copy(MESHES / "box.msh", tmp_path)
    quick = table(reduction={"modes": 2, "quasi_static_levels": 0})
    first = reduced_housing(quick, tmp_path)
    mesh = meshio.read(MESHES / "box.msh")
    mesh.points[:, 2] *= 1.02
    meshio.write(tmp_path / "box.msh", mesh, file_format="gmsh22")
    quick = dataclasses.replace(
        quick,
        bores=quick.bores[:0]
        + build(
            HousingTable,
            {"mesh": "a", "bores": [{"group": f"bore_{i}", "point_mm": [0, 0, 0]} for i in (1, 2, 3, 4)]},
            "housing",
        ).bores,
    )
    assert reduced_housing(quick, tmp_path).rigid_mass[0, 0] == pytest.approx(1.02 * first.rigid_mass[0, 0], rel=1e-9)
