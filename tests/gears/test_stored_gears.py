"""Condensed gears in the cache: read instead of computed, for the same gear alone, and by commands only."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gearfe.fem.plane import Material
from gearfe.gears.contact.compliance import gear_body, stored_gear_body
from gearfe.gears.contact.laws import PairModel
from gearfe.gears.gearmesh.sweep import elastic_pair, sweep_stiffness
from gearfe.gears.teeth.tooth_sector import SectorMesh, sector_mesh, sector_recipes
from tests.makers.gears import pair

STEEL = Material(200e9, 0.3, density=7850.0)
GEARS = pair(20, 30)
COARSE = 2.0


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("GEARFE_CACHE", str(tmp_path))
    return tmp_path


def meshed() -> SectorMesh:
    return sector_mesh(GEARS.pinion, sector_recipes(GEARS, coarsen=COARSE)[0])


def test_a_stored_gear_is_the_computed_one(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh, options = meshed(), {"width": 8e-3, "points_per_edge": 3}
    made = gear_body(mesh, STEEL, "strain", 0.01, **options)
    first = stored_gear_body(mesh, STEEL, "strain", 0.01, **options)
    monkeypatch.setattr("gearfe.gears.contact.compliance.gear_body", None)
    second = stored_gear_body(mesh, STEEL, "strain", 0.01, **options)
    assert len(list(folder.glob("condensed-gear-*"))) == 1
    sides = np.random.default_rng(2).standard_normal((len(made.condensed.schur), 2))
    for stored in (first, second):
        for name in ("own", "interface", "coupling", "stress_own", "stress_interface"):
            np.testing.assert_array_equal(getattr(stored, name), getattr(made, name))
        np.testing.assert_array_equal(stored.condensed.recover(sides), made.condensed.recover(sides))
        np.testing.assert_array_equal(stored.flank.points, made.flank.points)
        assert (stored.width, stored.thickness, stored.plane) == (made.width, made.thickness, made.plane)


def test_everything_that_decides_a_gear_is_in_its_key(folder: Path) -> None:
    mesh = meshed()
    moved = replace(mesh, points=mesh.points * (1.0 + 1e-12))
    for changed, material, plane, thickness, options in (
        (mesh, STEEL, "strain", 0.01, {}),
        (moved, STEEL, "strain", 0.01, {}),
        (mesh, Material(210e9, 0.3), "strain", 0.01, {}),
        (mesh, STEEL, "stress", 0.01, {}),
        (mesh, STEEL, "strain", 0.02, {}),
        (mesh, STEEL, "strain", 0.01, {"width": 8e-3}),
        (mesh, STEEL, "strain", 0.01, {"with_stress": False}),
        (mesh, STEEL, "strain", 0.01, {"points_per_edge": 3}),
    ):
        stored_gear_body(changed, material, plane, thickness, **options)  # type: ignore[arg-type]
    assert len(list(folder.glob("condensed-gear-*"))) == 8


def test_curves_of_stored_gears_are_the_same(folder: Path) -> None:
    model = PairModel((STEEL, STEEL), "strain", coarsen=COARSE)
    curves = [
        sweep_stiffness(
            GEARS, torque=100.0, angles=np.radians([0.0, 5.0]), elastic=elastic_pair(GEARS, model, store=store)
        )
        for store in (False, True, True)
    ]
    assert len(list(folder.glob("condensed-gear-*"))) == 2
    for curve in curves[1:]:
        np.testing.assert_array_equal(curve.k_mesh, curves[0].k_mesh)
