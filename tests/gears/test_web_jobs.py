"""Webs in job files: keys and their errors, drawing, solids, meshes in space, masses."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gearfe.base.config import read_toml
from gearfe.base.errors import InputError
from gearfe.base.tables.jobs import whole_gearbox
from gearfe.cli.main import main
from gearfe.drivetrain.train.elements import gear_masses, outline_moments
from gearfe.drivetrain.train.gear_train import ShaftGear
from gearfe.gears.gearmesh.job import stiffness_job
from gearfe.gears.gearmesh.solid_parts import gear_solid, graded_levels
from gearfe.gears.gearmesh.width_job import wide_mesh
from gearfe.gears.geometry.pair import pair_of
from gearfe.gears.teeth.tooth_sector import sector_mesh, sector_recipes
from gearfe.gears.width import WideFlanks

JOB = """
[pair]
module_mm = 2.0
pressure_angle_deg = 20.0
face_width_mm = 12.0

[pair.pinion]
teeth = 18
bore_diameter_mm = 18.0

[pair.wheel]
teeth = 28
bore_diameter_mm = 18.0
web_width_mm = 4.0
web_outer_diameter_mm = 44.0
web_inner_diameter_mm = 26.0
web_offset_mm = 3.0

[stiffness]
torque_Nm = 50.0
coarsen = 1.5
"""
#: Volume that the web leaves empty (m3).
EMPTY = (12e-3 - 4e-3) * math.pi * (22e-3**2 - 13e-3**2)


def written(folder: Path, *changes: tuple[str, str]) -> Path:
    text = JOB
    for before, after in changes:
        assert before in text
        text = text.replace(before, after)
    path = folder / "job.toml"
    path.write_text(text, encoding="utf-8")
    return path


def mesh_in(path: Path):
    (mesh,) = whole_gearbox(read_toml(path), path).meshes.values()
    return mesh


def test_keys_give_the_web_and_let_the_load_vary(tmp_path):
    mesh = mesh_in(written(tmp_path))
    web = pair_of(mesh).wheel.web
    assert (web.width, *web.radii, web.offset) == pytest.approx((4e-3, 22e-3, 13e-3, 3e-3))
    assert mesh.along_width() == ("pair.wheel.web_width_mm", 4.0)
    full = mesh_in(
        written(tmp_path, ("web_width_mm = 4.0", "web_width_mm = 12.0"), ("offset_mm = 3.0", "offset_mm = 0"))
    )
    assert full.along_width() is None


def test_right_flanks_see_the_web_on_the_other_side(tmp_path):
    path = written(tmp_path)
    left = wide_mesh(stiffness_job(mesh_in(path), tmp_path))
    path = written(tmp_path, ("[stiffness]", '[microgeometry]\nflank = "right"\n[stiffness]'))
    right = wide_mesh(stiffness_job(mesh_in(path), tmp_path))
    assert left.web_ends(1) == pytest.approx((1e-3, 5e-3))
    assert right.web_ends(1) == pytest.approx((-5e-3, -1e-3))


@pytest.mark.parametrize(
    ("before", "after", "reason"),
    [
        ("web_width_mm = 4.0\n", "", "web_width_mm is missing"),
        ("web_outer_diameter_mm = 44.0\n", "", "required with web_width_mm"),
        ("web_offset_mm = 3.0", "web_offset_mm = 4.5", "web_offset_mm = 4.5: must be >= -4 mm and <= 4 mm"),
        ("web_width_mm = 4.0", "web_width_mm = 13.0", "must be >= 0.2 mm and <= 12 mm, the face width"),
        ("outer_diameter_mm = 44.0", "outer_diameter_mm = 24.0", "web_outer_diameter_mm = 24.0: must be >= 26.4 mm"),
    ],
)
def test_webs_that_no_gear_has_are_refused(tmp_path, before, after, reason):
    with pytest.raises(InputError) as error:
        pair_of(mesh_in(written(tmp_path, (before, after))))
    assert reason in str(error.value)


def test_wedges_and_solid_leave_out_what_is_empty(tmp_path):
    """The volume of the wheel's mesh in space, and of its solid, is less by the rings beside the web."""
    pyvista = pytest.importorskip("pyvista")
    from gearfe.output.exchange.mesh_export import export_mesh

    volumes = []
    for change in ((), (("web_width_mm = 4.0", "web_width_mm = 12.0"), ("offset_mm = 3.0", "offset_mm = 0"))):
        job = stiffness_job(mesh_in(written(tmp_path, *change)), tmp_path)
        mesh = wide_mesh(job)
        section = sector_mesh(mesh.gears[1], sector_recipes(mesh.sections, coarsen=3.0)[1])
        levels = graded_levels(mesh.faces[1], 4)
        part = gear_solid(section, mesh, WideFlanks(), 1, (0.0, 0.0), levels)
        export_mesh(tmp_path / "wheel.vtu", {"wheel": part})
        grid = pyvista.read(tmp_path / "wheel.vtu")
        sizes = grid.compute_cell_sizes(length=False, area=False)["Volume"][grid.celltypes == 26]
        assert sizes.min() > 0.0
        assert len(np.unique(part.wedges)) == len(part.points)
        for rows in part.boundaries.values():
            assert rows[:, 0].max() < len(part.wedges)
        volumes.append(1e-9 * sizes.sum())
    assert volumes[1] - volumes[0] == pytest.approx(EMPTY / 28, rel=5e-3)


def test_drawing_and_step_have_the_web(tmp_path):
    gmsh = pytest.importorskip("gmsh")
    assert main(["gear", str(written(tmp_path)), "--out", str(tmp_path / "out"), "--export", "wheel.step"]) == 0
    assert (tmp_path / "out" / "gear_pair.png").stat().st_size > 0
    from gearfe.fem.meshing.session import gmsh_session
    from gearfe.gears.teeth.gear_solid import write_solid

    def volume(path: Path) -> float:
        with gmsh_session("volume"):
            gmsh.model.occ.importShapes(str(path))
            gmsh.model.occ.synchronize()
            return sum(gmsh.model.occ.getMass(*solid) for solid in gmsh.model.occ.getEntities(3))

    full = mesh_in(
        written(tmp_path, ("web_width_mm = 4.0", "web_width_mm = 12.0"), ("offset_mm = 3.0", "offset_mm = 0"))
    )
    write_solid(tmp_path / "full.step", pair_of(full).wheel)
    assert volume(tmp_path / "full.step") - volume(tmp_path / "out" / "wheel.step") == pytest.approx(
        1e9 * EMPTY, rel=1e-6
    )


def test_masses_are_those_of_slices(tmp_path):
    """Mass, centre and both moments of inertia, slice by slice along the axis."""
    wheel = pair_of(mesh_in(written(tmp_path))).wheel
    shaft: Any = SimpleNamespace(name="shaft", radius_within=lambda low, high: 5e-3)
    masses = gear_masses(ShaftGear("wheel", "shaft", 0.1, wheel, 7800.0), shaft, 0.0)
    z, dz = np.linspace(-6e-3, 6e-3, 12001)[:-1] + 0.5e-6, 1e-6
    area, second = outline_moments(wheel)
    empty = (z < 1e-3) | (z > 5e-3)
    areas = area - math.pi * 9e-3**2 - empty * math.pi * (22e-3**2 - 13e-3**2)
    polars = second - 0.5 * math.pi * 9e-3**4 - empty * 0.5 * math.pi * (22e-3**4 - 13e-3**4)
    mass, polar = 7800.0 * dz * areas.sum(), 7800.0 * dz * polars.sum()
    centre = 7800.0 * dz * (areas @ z) / mass
    transverse = 0.5 * polar + 7800.0 * dz * (areas @ (z - centre) ** 2)
    assert masses == pytest.approx((mass, polar, transverse, 0.1 + centre), rel=1e-6)


def test_fields_of_webs_are_refused(tmp_path, capsys):
    assert main(["stiffness", str(written(tmp_path)), "--fields", "--out", str(tmp_path / "out")]) == 2
    assert "web_width_mm = 4.0: is not implemented for gears with a web" in capsys.readouterr().err
