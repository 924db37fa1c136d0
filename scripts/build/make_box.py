"""Mesh of the example box in meshes/: how a housing with named groups is made with gmsh. Lengths in mm.

python scripts/build/make_box.py [FOLDER]    writes box.msh (gmsh) and box.inp (Abaqus, CalculiX), else into meshes/
"""

from __future__ import annotations

import sys
from pathlib import Path

import meshio
import numpy as np

from gearfe.fem.meshing.session import gmsh_session

#: Outer box, its walls and its base, pads under its corners.
LOW, HIGH, WALL, BASE = (-38.0, -35.0, -52.0), (113.0, 35.0, 42.0), 8.0, 10.0
PAD = (26.0, 20.0, 8.0)
#: Shaft axes along y (x, z), radius of the bores, and the bores' names at +y and -y.
AXES, RADIUS = {("1", "2"): (0.0, 0.0), ("3", "4"): (62.5, 0.0)}, 10.0
SIZE, ROUND = 20.0, 10


def write_box(folder: Path) -> None:
    """Mesh the box with tetrahedra of the second order; surfaces are named as `gearfe` asks for them."""
    with gmsh_session("box") as gmsh:
        occ = gmsh.model.occ
        size = [b - a for a, b in zip(LOW, HIGH, strict=True)]
        outer = occ.addBox(*LOW, *size)
        inner = occ.addBox(LOW[0] + WALL, LOW[1] + WALL, LOW[2] + BASE, size[0] - 2 * WALL, size[1] - 2 * WALL, size[2])
        cuts = [(3, inner)]
        for x, z in AXES.values():
            cuts.append((3, occ.addCylinder(x, LOW[1] - 1, z, 0, size[1] + 2, 0, RADIUS)))
        pads = [
            (3, occ.addBox(x, y, LOW[2] - PAD[2], *PAD))
            for x in (LOW[0], HIGH[0] - PAD[0])
            for y in (LOW[1], HIGH[1] - PAD[1])
        ]
        body, _ = occ.fuse([(3, outer)], pads)
        occ.cut(body, cuts)
        occ.synchronize()
        groups: dict[str, list[int]] = {}
        for _, tag in gmsh.model.getEntities(2):
            x0, y0, _, x1, y1, z1 = gmsh.model.getBoundingBox(2, tag)
            if z1 < LOW[2] - PAD[2] + 1:
                groups.setdefault("feet", []).append(tag)
            if gmsh.model.getType(2, tag) == "Cylinder":
                for names, (x, _) in AXES.items():
                    if x0 < x < x1:
                        groups.setdefault(f"bore_{names[0 if y0 + y1 > 0 else 1]}", []).append(tag)
        for name, tags in groups.items():
            gmsh.model.addPhysicalGroup(2, tags, name=name)
        gmsh.model.addPhysicalGroup(3, [tag for _, tag in gmsh.model.getEntities(3)], name="box")
        gmsh.option.setNumber("Mesh.MeshSizeMax", SIZE)
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", ROUND)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(2)
        gmsh.option.setNumber("Mesh.Binary", 1)
        gmsh.write(str(folder / "box.msh"))
    mesh = meshio.read(folder / "box.msh")
    sets = {
        name: np.unique(np.concatenate([b.data[r].ravel() for b, r in zip(mesh.cells, rows, strict=True) if len(r)]))
        for name, rows in mesh.cell_sets.items()
        if name in groups
    }
    tets = np.concatenate([block.data for block in mesh.cells if block.type == "tetra10"])
    made = meshio.Mesh(mesh.points, [("tetra10", tets)], point_sets=sets)
    meshio.write(folder / "box.inp", made, float_fmt=".12g")
    text = (folder / "box.inp").read_text(encoding="utf-8")
    text = text.replace("C3D10MH", "C3D10")  # the same nodes; every solver knows this name
    (folder / "box.inp").write_text(text, encoding="utf-8", newline="\n")


if __name__ == "__main__":
    write_box(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parents[2] / "meshes")
