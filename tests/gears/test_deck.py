"""Meshes with fine teeth where they mesh, and the deck that CalculiX runs, against this program's torque."""

from __future__ import annotations

import math
import re
import shutil
import subprocess
from pathlib import Path

import meshio
import numpy as np
import pytest

from gearfe.cli.main import main
from gearfe.gears.teeth.tooth_sector import sector_recipes
from gearfe.gears.teeth.whole_gear import mixed_gear, teeth_near
from gearfe.output.exchange.calculix_deck import deck_torque
from tests.makers.gears import pair
from tests.makers.job_texts import pair_job

COARSE = ["--coarsen", "4"]


def signed_area(points: np.ndarray, triangles: np.ndarray) -> float:
    """Area of curved triangles of second order, by Gauss' theorem over their parabolic sides."""
    total = 0.0
    for a, m, b in ((0, 3, 1), (1, 4, 2), (2, 5, 0)):
        pa, pm, pb = (points[triangles[:, k]] for k in (a, m, b))

        def cross(u: np.ndarray, v: np.ndarray) -> np.ndarray:
            return u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]

        total += float(np.sum(4 * cross(pa, pm) + 4 * cross(pm, pb) - cross(pa, pb)) / 6.0)
    return total


def test_fine_and_coarse_teeth_are_one_gear():
    gears = pair(17, 23, tip_round=0.1e-3)
    recipe = sector_recipes(gears, coarsen=2.0)[0]
    few, all_ = (mixed_gear(gears.pinion, recipe, fine) for fine in ({0, 16}, range(17)))
    assert len(few.triangles) < 0.5 * len(all_.triangles)
    assert signed_area(few.points, few.triangles) == pytest.approx(signed_area(all_.points, all_.triangles), rel=1e-6)
    assert set(few.boundaries) == {"bore", "root", "flank_right", "flank_left", "tip", "contact"}
    # every edge has two triangles but those of the outline
    sides = np.bincount(few.triangles[:, 3:].ravel(), minlength=len(few.points))
    outline = np.concatenate([edges for name, edges in few.boundaries.items() if name != "contact"])
    assert set(np.flatnonzero(sides == 1)) == set(outline[:, 1])
    angle = np.degrees(np.arctan2(*few.points[few.boundaries["contact"][:, 1]].T[::-1]))
    assert (np.abs(angle + 180.0 / 17) < 540.0 / 17).all()  # of teeth 0 and 16


def test_teeth_in_mesh_are_those_nearest_to_the_mate():
    gear = pair(20, 30).pinion
    assert teeth_near(gear, 0.0, 0.0, 3) == {19, 0, 1}
    assert teeth_near(gear, math.radians(20.0), 0.0, 1) == {19}
    assert teeth_near(gear, math.radians(90.0), math.pi, 1) == {5}


def write_job(folder: Path) -> str:
    (folder / "pair.toml").write_text(pair_job())
    return str(folder / "pair.toml")


@pytest.mark.parametrize(("angle", "touching"), [("0", 2), ("-13", 2), ("-4", 1), ("4", 2), ("133", 2)])
def test_fine_teeth_are_those_that_touch(tmp_path, angle, touching):
    """As many as the path of contact has there: A is -17.5, B -10.0, D 0.5, E 8.0 deg; at 0 a pair is 0.5 deg off A."""
    out = tmp_path / "gears.msh"
    line = [
        "mesh",
        write_job(tmp_path),
        "--out",
        str(out),
        "--teeth",
        str(touching),
        "--angle-deg",
        angle,
        "--no-pictures",
    ]
    assert main(line) == 0
    mesh = meshio.read(out)
    contact = [
        np.unique(
            np.concatenate(
                [
                    c.data[mesh.cell_data["gmsh:physical"][k] == mesh.field_data[f"{name}_contact"][0]].ravel()
                    for k, c in enumerate(mesh.cells)
                    if c.type == "line3"
                ]
            )
        )
        for name in ("pinion", "wheel")
    ]
    pinion, wheel = (mesh.points[nodes, :2] for nodes in contact)
    near = np.linalg.norm(pinion[:, None] - wheel, axis=2).min(axis=1) < 0.03
    places = np.sort(pinion[near][:, 1])
    assert 1 + np.sum(np.diff(places) > 2.0) == touching


def test_the_command_names_contact_boundaries_and_draws(tmp_path, capsys):
    job = write_job(tmp_path)
    out = tmp_path / "gears.msh"
    assert main(["mesh", job, "--out", str(out), "--teeth", "2", "--angle-deg", "5", *COARSE]) == 0
    told = dict(re.findall(r"^  (\w+) +(\d+)$", capsys.readouterr().out, re.MULTILINE))
    assert int(told["pinion_contact"]) < int(told["pinion_flank_left"])
    assert {"wheel_contact", "wheel_bore"} <= set(meshio.read(out).field_data)
    assert out.with_suffix(".png").stat().st_size > 20000
    for wrong in (["--teeth", "0"], ["--teeth", "2", "--sector"], ["--deck"]):
        assert main(["mesh", job, "--out", str(out), *wrong]) == 2
    line = ["mesh", job, "--out", str(tmp_path / "pair.inp"), "--deck", "--teeth", "1", *COARSE]
    assert main(line) == 2  # two pairs bear at 0 deg
    assert "give 2 or more" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")
def test_calculix_runs_the_deck_and_finds_the_torque(tmp_path, capsys):
    """Another program, another contact, finite strain: the torque within 1 % on a coarse mesh (0.02 % at coarsen 2)."""
    job = write_job(tmp_path)
    changes = ["pair.pinion.teeth=14", "pair.wheel.teeth=14", "pair.pinion.pitch_diameter_mm=35"]
    changes += ["pair.wheel.pitch_diameter_mm=35", "pair.wheel.bore_diameter_mm=10"]
    line = ["mesh", job, "--out", str(tmp_path / "pair.inp"), "--deck", "--teeth", "2", "--coarsen", "5"]
    assert main([*line, "--angle-deg", "4", "--no-pictures", *(w for c in changes for w in ("--set", c))]) == 0
    out = capsys.readouterr().out
    torque = float(re.search(r"by gearfe: (\S+) N m", out).group(1))
    twist = float(re.search(r"twist of the wheel: (\S+) rad", out).group(1))
    deck = tmp_path / "pair.inp"
    deck.write_text(deck.read_text().replace("\n0.05, 1.\n", "\n1., 1.\n"))  # coarse flanks need no small increments
    subprocess.run(["ccx", "pair"], cwd=tmp_path, capture_output=True, check=False, timeout=300)
    assert deck_torque(deck, 35e-3, twist) == pytest.approx(torque, rel=0.01)
