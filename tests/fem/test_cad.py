"""CAD files: ten solids of gmsh's own kernel at five sizes each, and messages where algorithms fail."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.fem.bodies.mesh_checks import checked_mesh
from gearfe.fem.meshing import cad
from gearfe.fem.meshing.cad import ALGORITHMS, mesh_cad_file
from gearfe.fem.meshing.session import gmsh_session
from gearfe.fem.solid import jacobian_determinants, maps, shape_functions

SIZES = (40.0, 25.0, 15.0, 10.0, 7.0)


def box_with_bores(occ: Any) -> None:
    box = occ.addBox(0, 0, 0, 120, 60, 40)
    occ.cut([(3, box)], [(3, occ.addCylinder(x, 0, 20, 0, 60, 0, 12)) for x in (30, 80)])


def thin_tray(occ: Any) -> None:
    occ.cut([(3, occ.addBox(0, 0, 0, 150, 60, 100))], [(3, occ.addBox(3, 3, 3, 144, 54, 100))])


def closed_shell(occ: Any) -> None:
    outer, inner = occ.addBox(0, 0, 0, 150, 60, 100), occ.addBox(4, 4, 4, 142, 52, 92)
    bores = [(3, occ.addCylinder(x, -1, 50, 0, 62, 0, 10)) for x in (40, 100)]
    occ.cut([(3, outer)], [(3, inner), *bores])


def ribbed_wall(occ: Any) -> None:
    ribs = [(3, occ.addBox(x, 8, 0, 5, 20, 80)) for x in (20, 60, 95)]
    boss = (3, occ.addCylinder(60, 8, 40, 0, 12, 0, 18))
    whole, _ = occ.fuse([(3, occ.addBox(0, 0, 0, 120, 8, 80))], [*ribs, boss])
    occ.cut(whole, [(3, occ.addCylinder(60, -1, 40, 0, 40, 0, 10))])


def filleted_block(occ: Any) -> None:
    block = occ.addBox(0, 0, 0, 80, 50, 30)
    occ.synchronize()
    edges = occ.getEntities(1)
    occ.fillet([block], [tag for _, tag in edges], [10.0])


def bored_cone(occ: Any) -> None:
    occ.cut([(3, occ.addCone(0, 0, 0, 0, 0, 60, 40, 20))], [(3, occ.addCylinder(0, 0, -1, 0, 0, 70, 10))])


def crossed_cylinders(occ: Any) -> None:
    whole, _ = occ.fuse(
        [(3, occ.addCylinder(0, 0, 0, 0, 100, 0, 30))], [(3, occ.addCylinder(-50, 50, 0, 100, 0, 0, 20))]
    )
    occ.cut(whole, [(3, occ.addCylinder(0, -1, 0, 0, 102, 0, 18))])


def flange(occ: Any) -> None:
    whole, _ = occ.fuse([(3, occ.addCylinder(0, 0, 0, 0, 10, 0, 60))], [(3, occ.addCylinder(0, 10, 0, 0, 40, 0, 25))])
    places = [(45 * math.cos(k * math.pi / 3), 45 * math.sin(k * math.pi / 3)) for k in range(6)]
    holes = [(3, occ.addCylinder(x, -1, z, 0, 12, 0, 5)) for x, z in places]
    occ.cut(whole, [*holes, (3, occ.addCylinder(0, -1, 0, 0, 60, 0, 15))])


def spherical_pocket(occ: Any) -> None:
    tools = [(3, occ.addSphere(40, 40, 50, 30)), (3, occ.addCylinder(40, 40, -1, 0, 0, 30, 8))]
    occ.cut([(3, occ.addBox(0, 0, 0, 80, 80, 50))], tools)


def two_walls(occ: Any) -> None:
    """Base, two walls, bosses and bores: the housing of the shipped job."""
    walls = [(3, occ.addBox(-45, y, -72, 225, width, 97)) for y, width in ((25, 6), (-29.5, 4.5))]
    ends = [(x, y, length) for x in (0, 62.5, 125) for y, length in ((25, 16), (-25, -14.5))]
    bosses = [(3, occ.addCylinder(x, y, 0, 0, length, 0, 15)) for x, y, length in ends]
    whole, _ = occ.fuse([(3, occ.addBox(-45, -31, -90, 225, 62, 18))], [*walls, *bosses])
    occ.cut(whole, [(3, occ.addCylinder(x, -60, 0, 0, 120, 0, 10)) for x in (0, 62.5, 125)])


SOLIDS: tuple[Callable[[Any], None], ...] = (
    box_with_bores,
    thin_tray,
    closed_shell,
    ribbed_wall,
    filleted_block,
    bored_cone,
    crossed_cylinders,
    flange,
    spherical_pocket,
    two_walls,
)
QUICK = [(box_with_bores, 40.0), (filleted_block, 25.0), (bored_cone, 15.0), (thin_tray, 25.0)]


def written(make: Callable[[Any], None], path: Path) -> float:
    """Write a solid as STEP; its volume (mm3)."""
    with gmsh_session("solid") as gmsh:
        make(gmsh.model.occ)
        gmsh.model.occ.synchronize()
        ((_, solid),) = gmsh.model.getEntities(3)
        gmsh.write(str(path))
        return float(gmsh.model.occ.getMass(3, solid))


def check_meshed(make: Callable[[Any], None], size: float, folder: Path) -> None:
    """A mesh that passes the checks of housings and has the solid's volume, curved faces being 12 edges a circle."""
    volume = written(make, folder / "solid.step")
    mesh = mesh_cad_file(folder / "solid.step", "housing.mesh", size)
    checked = checked_mesh(mesh.nodes, mesh.tets)
    rule = shape_functions(10, 5)
    found = float((maps(checked.nodes, checked.tets, rule.slopes)[0] @ rule.weights).sum())
    # a parabola through three points of an arc of 30 deg is off it by less than 1e-4 of the radius
    assert found == pytest.approx(volume, rel=2e-3)
    assert mesh.groups
    assert jacobian_determinants(checked.nodes, checked.tets[:, :4]).min() > 0.0


@pytest.mark.parametrize(("make", "size"), QUICK)
def test_solids_are_meshed(make: Callable[[Any], None], size: float, tmp_path: Path) -> None:
    check_meshed(make, size, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("make", SOLIDS)
def test_ten_solids_are_meshed_at_five_sizes(make: Callable[[Any], None], size: float, tmp_path: Path) -> None:
    check_meshed(make, size, tmp_path)


@pytest.mark.parametrize("working", [5, 1])
def test_another_surface_algorithm_is_taken_and_named(
    working: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written(box_with_bores, tmp_path / "solid.step")
    meshed_by = cad._meshed_by
    broken = list(ALGORITHMS)[: list(ALGORITHMS).index(working)]

    def some_fail(gmsh: Any, algorithm: int) -> str | None:
        return "overlapping facets" if algorithm in broken else meshed_by(gmsh, algorithm)

    monkeypatch.setattr(cad, "_meshed_by", some_fail)
    (note,) = mesh_cad_file(tmp_path / "solid.step", "housing.mesh", 40.0).notes
    assert f"algorithm {ALGORITHMS[working]}" in note
    assert all(f"{ALGORITHMS[number]}: overlapping facets" in note for number in broken)


def sliver(occ: Any) -> None:
    """A cylinder with a bore that leaves 0.01 mm of wall: facets of both faces cross with every algorithm."""
    whole, bore = occ.addCylinder(0, 0, 0, 0, 0, 30, 20), occ.addCylinder(0, 9.99, -1, 0, 0, 32, 10)
    occ.cut([(3, whole)], [(3, bore)])


@pytest.mark.parametrize("working", [5, 1])
def test_another_algorithm_meshes_after_facets_that_really_crossed(
    working: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After such an error gmsh meshes no volume in that session: the next algorithm must have one of its own."""
    written(box_with_bores, tmp_path / "solid.step")
    meshed_by = cad._meshed_by
    broken = list(ALGORITHMS)[: list(ALGORITHMS).index(working)]

    def cross(gmsh: Any, algorithm: int) -> str | None:
        if algorithm not in broken:
            return meshed_by(gmsh, algorithm)
        gmsh.model.add("sliver")
        sliver(gmsh.model.occ)
        gmsh.model.occ.synchronize()
        problem = meshed_by(gmsh, algorithm)
        assert problem is not None
        assert "intersect" in problem
        gmsh.model.remove()
        gmsh.model.setCurrent("housing")
        return problem

    monkeypatch.setattr(cad, "_meshed_by", cross)
    mesh = mesh_cad_file(tmp_path / "solid.step", "housing.mesh", 40.0)
    assert len(mesh.tets) > 0
    assert "intersect" in mesh.notes[0]


def test_each_algorithm_is_tried_on_facets_that_cross(tmp_path: Path) -> None:
    with gmsh_session("solid") as gmsh:
        sliver(gmsh.model.occ)
        gmsh.model.occ.synchronize()
        gmsh.write(str(tmp_path / "solid.step"))
    with pytest.raises(InputError) as caught:
        mesh_cad_file(tmp_path / "solid.step", "housing.mesh", 8.0)
    assert caught.value.problem.count("intersect") == len(ALGORITHMS)


def test_a_solid_that_no_algorithm_meshes_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written(box_with_bores, tmp_path / "solid.step")
    monkeypatch.setattr(cad, "_meshed_by", lambda _, algorithm: f"facets of {algorithm} overlap")
    with pytest.raises(InputError, match=r"facets of 6 overlap.*facets of 1 overlap.*another size_mm \(28, 20, 14\)"):
        mesh_cad_file(tmp_path / "solid.step", "housing.mesh", 40.0)


def test_algorithms_give_meshes_of_their_own(tmp_path: Path) -> None:
    """Nothing of a failed trial is left behind: the nodes are those of a session that begins with the second one."""
    written(closed_shell, tmp_path / "solid.step")
    counts = []
    for trials in ([5], [6, 5]):
        with gmsh_session("solid") as gmsh:
            gmsh.model.occ.importShapes(str(tmp_path / "solid.step"))
            gmsh.model.occ.synchronize()
            gmsh.option.setNumber("Mesh.MeshSizeMax", 40.0)
            assert [cad._meshed_by(gmsh, number) for number in trials][-1] is None
            counts.append(np.sort(gmsh.model.mesh.getNodes()[1]).sum())
    assert counts[0] == pytest.approx(counts[1], rel=1e-9)
