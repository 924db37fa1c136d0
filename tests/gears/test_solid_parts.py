"""Meshes in space of gears whose load varies along the width: geometry, modifications, files, and a run of CalculiX."""

from __future__ import annotations

import math
import re
import shutil
import subprocess
from pathlib import Path

import meshio
import numpy as np
import pytest

from gearfe.base.tables.examples import job_file
from gearfe.cli.main import main
from gearfe.gears.gearmesh.solid_parts import gear_solid, graded_levels
from gearfe.gears.geometry.modifications import ends_of
from gearfe.gears.teeth.tooth_sector import sector_mesh, sector_recipes
from gearfe.gears.width import LeadModification, Misalignment, WideFlanks, WideMesh
from gearfe.output.exchange.calculix_deck import deck_torque
from gearfe.output.exchange.mesh_export import SolidPart, boundary_elements, export_mesh
from tests.makers.wide_gears import HELICAL_JOB, SPUR, helical_mesh


def sector_solid(mesh: WideMesh, flanks: WideFlanks, gear: int, layers: int = 4) -> SolidPart:
    recipe = sector_recipes(mesh.sections, coarsen=3.0, flank_coarsen=2.0)[gear]
    sector = sector_mesh(mesh.gears[gear], recipe)
    return gear_solid(sector, mesh, flanks, gear, (0.1, 0.0), graded_levels(mesh.faces[gear], layers))


def test_wedges_fill_the_helical_tooth(tmp_path: Path) -> None:
    """Positive volumes whose sum is section times width; flank nodes lie on the helicoid: one section turns to all."""
    pyvista = pytest.importorskip("pyvista")
    mesh = helical_mesh()
    part = sector_solid(mesh, WideFlanks(), 0, layers=8)
    export_mesh(tmp_path / "tooth.vtu", {"pinion": part})
    grid = pyvista.read(tmp_path / "tooth.vtu")
    sizes = grid.compute_cell_sizes(length=False, area=False)["Volume"][grid.celltypes == 26]
    assert sizes.min() > 0.0
    turned = (part.points[:, 0] + 1j * part.points[:, 1]) * np.exp(-1j * mesh.turns[0] * part.points[:, 2])
    section = sector_mesh(mesh.gears[0], sector_recipes(mesh.sections, coarsen=3.0, flank_coarsen=2.0)[0])
    known = (section.points @ [1, 1j]) * np.exp(0.1j)
    assert np.abs(turned[:, None] - known).min(axis=1).max() < 1e-12
    a, b, c = (section.points[section.triangles[:, k]] @ [1, 1j] for k in range(3))
    area = 0.5 * ((b - a).conj() * (c - a)).imag.sum()
    assert sizes.sum() == pytest.approx(1e9 * area * 20e-3, rel=5e-3)  # curved edges


def test_nodes_have_the_modifications_and_the_tilt() -> None:
    """Crowning by -C_beta (2 y/b)^2 along the flank's normal, none on the other flank; the wheel's sections shift."""
    mesh = WideMesh(SPUR, functions=5)
    crowned = WideFlanks(leads=(LeadModification(crowning=10e-6), LeadModification()))
    plain, changed = (sector_solid(mesh, flanks, 0) for flanks in (WideFlanks(), crowned))
    moved = np.linalg.norm(changed.points - plain.points, axis=1)
    flank, back = (np.unique(boundary_elements(plain, name)[1]) for name in ("contact", "flank_right"))
    expected = 10e-6 * (2 * plain.points[flank, 2] / 10e-3) ** 2
    radius = np.hypot(*plain.points[flank, :2].T)
    working = radius > math.hypot(SPUR.pinion.base_radius, ends_of(SPUR.pinion)[0])
    assert moved[flank][working] == pytest.approx(expected[working], abs=1e-12)
    assert moved[back].max() == 0.0
    # material is taken off: towards the tooth's centre line
    middle = np.exp(0.1j)
    off = ((changed.points - plain.points) @ [1, 1j, 0]) / middle
    assert off[flank].imag.max() <= 1e-15
    tilt = WideFlanks(misalignment=Misalignment.over_width(20e-6, 10e-3))
    shift = sector_solid(mesh, tilt, 1).points - sector_solid(mesh, WideFlanks(), 1).points
    forward = np.exp(1j * (0.5 * math.pi - SPUR.working_pressure_angle))
    z = sector_solid(mesh, WideFlanks(), 1).points[:, 2]
    assert shift @ [1, 1j, 0] == pytest.approx(-2e-3 * z * forward, abs=1e-15)  # the gap closes towards larger z


LAYERS = ["--layers", "2", "--coarsen", "4", "--no-pictures"]


def write_job(folder: Path) -> str:
    (folder / "pair.toml").write_text(HELICAL_JOB)
    return str(folder / "pair.toml")


@pytest.mark.parametrize("suffix", ["msh", "vtu"])
def test_the_command_writes_gears_in_space(tmp_path: Path, suffix: str, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / f"gears.{suffix}"
    assert main(["mesh", write_job(tmp_path), "--out", str(out), "--sector", *LAYERS]) == 0
    groups = dict(re.findall(r"^  (\w+) +(\d+)$", capsys.readouterr().out, re.MULTILINE))
    mesh = meshio.read(out)
    wedges = sum(len(block.data) for block in mesh.cells if block.type == "wedge15")
    assert wedges == int(groups["pinion"]) + int(groups["wheel"])
    assert np.ptp(mesh.points[:, 2]) == pytest.approx(5.0, rel=1e-9)
    if suffix == "msh":
        assert {"pinion", "wheel_contact"} <= set(mesh.field_data)


def test_layers_and_teeth_are_checked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    job = write_job(tmp_path)
    (tmp_path / "plane.toml").write_text(job_file("stiffness"))
    assert main(["mesh", str(tmp_path / "plane.toml"), "--layers", "3"]) == 2
    assert "--layers = 3: is for gears whose load varies" in capsys.readouterr().err
    line = ["mesh", job, "--out", str(tmp_path / "pair.inp"), "--deck", "--teeth", "1", "--angle-deg", "12", *LAYERS]
    assert main(line) == 2
    assert "--teeth = 1: leaves loaded tooth pairs" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")
def test_calculix_comes_closer_to_the_torque_on_finer_flanks(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Another program, contact in space: elements of twice and once the contact's width are too stiff, by first order.

    On halved elements the difference is halved, or less (docs/development/contact.md).
    """
    excess = []
    for flank_coarsen in (1.0, 0.5):
        folder = tmp_path / str(flank_coarsen)
        folder.mkdir()
        job = Path(write_job(folder))
        job.write_text(job.read_text() + f"flank_coarsen = {flank_coarsen}\n")
        deck = folder / "pair.inp"
        assert main(["mesh", str(job), "--out", str(deck), "--deck", *LAYERS]) == 0
        out = capsys.readouterr().out
        torque = float(re.search(r"by gearfe: (\S+) N m", out).group(1))
        twist = float(re.search(r"twist of the wheel: (\S+) rad", out).group(1))
        centre = float(re.search(r"centre of the wheel x = (\S+) mm", deck.read_text()).group(1))
        deck.write_text(deck.read_text().replace("\n0.05, 1.\n", "\n0.5, 1.\n"))
        subprocess.run(["ccx", "pair"], cwd=folder, capture_output=True, check=False, timeout=900)
        excess.append(deck_torque(deck, 1e-3 * centre, twist) / torque - 1.0)
    assert 0.0 < excess[1] < 0.6 * excess[0]
