"""Root stress over the face width: the plane limit, the formula of the surface, symmetry, and what files it leaves."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from gearfe.cli.main import main
from gearfe.fem.extruded import lobatto_functions_at
from gearfe.gears.contact.flank import edge_shapes
from gearfe.gears.gearmesh.root_stress import GAUSS
from gearfe.gears.gearmesh.sweep import sweep_loads
from gearfe.gears.gearmesh.width_root import FilletMesh, FilletSystem, roots_of_cells, wide_roots
from gearfe.gears.width import (
    LeadModification,
    Misalignment,
    WideFlanks,
    WideMesh,
    contact_lines,
    sweep_width,
    wide_compliance,
)
from gearfe.gears.width.compliance import AxialSystem
from gearfe.output.exchange.tables import read_csv
from tests.makers.job_texts import pair_job
from tests.makers.wide_gears import SPUR, spur_lines


def test_one_function_leaves_the_root_stress_of_the_plane() -> None:
    """Largest stresses within three times what both estimate (their order of convergence is two)."""
    lines = contact_lines(wide_compliance(WideMesh(SPUR, functions=1, coarsen=1.0, flank_coarsen=4.0)))
    angles = np.arange(6) * SPUR.mesh_cycle / 6
    sweep = sweep_width(lines, [100.0], angles=angles)
    found = roots_of_cells(wide_roots(lines, sweep), (1, 6))
    plane = sweep_loads(SPUR, torques=[100.0], angles=angles, kinematics="small", root_stress=True).root
    assert plane is not None
    assert found.stress == pytest.approx(plane.largest, rel=0.005)
    assert np.median(np.abs(found.stress / plane.largest - 1.0)) < 0.002
    assert 2.0 * found.radius == pytest.approx(plane.diameter, rel=0.005)
    assert found.error.max() < 0.02


def surface_in_space() -> tuple[FilletMesh, np.ndarray, np.ndarray]:
    """A surface on a helix, displaced by u_i = G_ij X_j + S_ijk X_j X_k/2 in space, with G and S."""
    random, turn, order = np.random.default_rng(45), 12.0, 12
    linear, square = 1e-3 * random.normal(size=(3, 3)), 0.1 * random.normal(size=(3, 3, 3))
    square = square + square.swapaxes(1, 2)
    z, t = np.linspace(-4e-3, 4e-3, 5), np.linspace(0.0, 1.0, 9)
    curve = np.stack([0.02 + 2e-3 * t**2, 3e-3 * t - 1e-3 * t**2], axis=1)
    edges = np.arange(0, 8, 2)[:, None] + np.arange(3)
    inner = np.sort(np.real(np.polynomial.legendre.Legendre.basis(order).deriv().roots()))
    functions = lobatto_functions_at([z[0], z[-1]], [order], z)
    unknowns = np.zeros((len(curve), 3, order + 1))
    for p, at in enumerate(z[-1] * np.concatenate([[-1.0], inner, [1.0]])):
        rotation = turned(turn * at)
        place = np.column_stack([curve, np.full(len(curve), at)]) @ rotation.T
        moved = place @ linear.T + 0.5 * np.einsum("ijk,nj,nk->ni", square, place, place)
        unknowns[:, :, p] = moved @ rotation
    axial = AxialSystem((functions, functions), (functions, functions), slice(0, 1))
    system = FilletSystem(axial, unknowns.reshape(1, len(curve), -1, 1, 1, 1))
    return FilletMesh(edges, curve[edges], z, (0,), (system,), turn, (2.2e11, 0.3)), linear, square


def turned(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def test_stress_is_that_of_the_strain_in_the_surface() -> None:
    """Second route: the gradient of a displacement in space, projected on the tangent plane of the helical surface."""
    mesh, linear, square = surface_in_space()
    shapes, slopes, _ = edge_shapes(GAUSS)
    along = np.einsum("qa,eai->eqi", slopes, mesh.corners)
    speed = np.linalg.norm(along, axis=-1)
    found = mesh._tension([(0, np.ones((1, 1, 1)))], along / speed[..., None], speed)
    section, tangent = np.einsum("qa,eai->eqi", shapes, mesh.corners), along / speed[..., None]
    stiff, nu = mesh.moduli
    for e, q, i in np.ndindex(found.shape):
        rotation, (x, y) = turned(mesh.turn * mesh.z[i]), section[e, q]
        place = rotation @ [x, y, mesh.z[i]]
        t = rotation @ [*tangent[e, q], 0.0]
        h = rotation @ [-mesh.turn * y, mesh.turn * x, 1.0]
        b = h - (h @ t) * t
        b /= np.linalg.norm(b)
        gradient = linear + np.einsum("ijk,k->ij", square, place)
        strain = 0.5 * (gradient + gradient.T)
        tt, bb, tb = t @ strain @ t, b @ strain @ b, t @ strain @ b
        stresses = stiff * np.array([[tt + nu * bb, (1 - nu) * tb], [(1 - nu) * tb, bb + nu * tt]])
        # nodes of edges lie on the displacement, quadratic along them: what is left is their interpolation
        assert found[e, q, i] == pytest.approx(np.linalg.eigvalsh(stresses)[1], rel=2e-3, abs=2e-3 * stiff * 1e-3)


def test_crowned_and_tilted_teeth_are_stressed_where_they_bear() -> None:
    """Symmetric loads leave symmetric stresses; crowning raises the middle, a tilt the end that it loads."""
    crowned = WideFlanks(leads=(LeadModification(crowning=10e-6), LeadModification()))
    tilted = WideFlanks(misalignment=Misalignment.over_width(20e-6, 10e-3))
    angle = [SPUR.path["C"].pinion_angle]
    found = {}
    for name, flanks in {"plain": WideFlanks(), "crowned": crowned, "tilted": tilted}.items():
        lines = spur_lines(functions=5).with_flanks(flanks)
        roots = wide_roots(lines, sweep_width(lines, [100.0], angles=angle))
        found[name] = roots.stress[0]
        assert roots.error.max() < 0.03
    for name in ("plain", "crowned"):
        assert found[name] == pytest.approx(found[name][:, ::-1], rel=1e-6)
    assert (found["crowned"].max(axis=1) > found["plain"].max(axis=1)).all()
    assert (np.argmax(found["tilted"], axis=1) > 20).all()
    # the mean over the width belongs to the mean load, which is the same
    for name in ("crowned", "tilted"):
        assert found[name].mean(axis=1) == pytest.approx(found["plain"].mean(axis=1), rel=0.02)


def test_load_maps_take_root_stress_over_the_width(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "job.toml"
    path.write_text(pair_job())
    line = ["loadmap", str(path), "--out", str(tmp_path / "out"), "--torques-Nm", "20", "50", "--positions", "2"]
    sets = ["--set", "pair.misalignment_um=8", "--set", "stiffness.coarsen=2.0"]
    assert main([*line, "--root-stress", *sets]) == 0
    out = tmp_path / "out"
    assert (out / "loadmap_root.png").exists()
    table = json.loads((out / "loadmap.json").read_text())["by_torque"]
    columns, rows = read_csv(out / "loadmap_root.csv"), read_csv(out / "loadmap.csv")
    for gear in ("pinion", "wheel"):
        largest = table[f"largest_root_stress_{gear}_MPa"]
        chosen = np.array([name == gear for name in columns["gear"]])
        stress = np.array(columns["root_stress_MPa"], dtype=float)[chosen]
        assert max(largest) == pytest.approx(stress.max(), rel=1e-12)
        assert max(largest) == pytest.approx(np.max(rows[f"root_stress_{gear}_MPa"]), rel=1e-12)
        assert max(table[f"largest_root_stress_{gear}_y_mm"]) > 0.0
    assert "largest root stress: pinion" in capsys.readouterr().out
