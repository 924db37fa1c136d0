"""Condensed gears in the cache: read instead of computed, for the same gear alone; plane ones by commands only."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from gearfe.fem.plane import Material
from gearfe.gears.contact.compliance import gear_body, stored_gear_body
from gearfe.gears.contact.laws import PairModel
from gearfe.gears.gearmesh.sweep import elastic_pair, sweep_stiffness
from gearfe.gears.geometry.face import NOMINAL
from gearfe.gears.geometry.modifications import FlankModification, tooth_deviations
from gearfe.gears.teeth.tooth_sector import SectorMesh, sector_mesh, sector_recipes
from gearfe.gears.width import WideMesh, wide_compliance
from gearfe.gears.width.pair_law import PairLaw, pair_law
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


def test_stored_gears_and_laws_over_the_width_are_the_computed_ones(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mesh = WideMesh(GEARS, functions=2, coarsen=4.0)
    computed = wide_compliance(mesh)
    law = pair_law(computed, NOMINAL)
    monkeypatch.setattr("gearfe.gears.width.compliance.condense_extruded", None)
    monkeypatch.setattr("gearfe.gears.width.pair_law.solve_half_plane", None)
    stored = wide_compliance(mesh)
    again = pair_law(stored, NOMINAL)
    for one, other in zip(computed.sides, stored.sides, strict=True):
        np.testing.assert_array_equal(one.influence, other.influence)
        np.testing.assert_array_equal(one.local.far_field[0], other.local.far_field[0])
    for entry in fields(PairLaw):
        np.testing.assert_array_equal(getattr(law, entry.name), getattr(again, entry.name))
    monkeypatch.setenv("GEARFE_CACHE", "off")
    with pytest.raises(TypeError):
        wide_compliance(mesh)


def test_everything_that_decides_a_gear_over_the_width_is_in_its_key(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mesh, steel = WideMesh(GEARS, functions=2, coarsen=4.0), Material(206e9, 0.3)
    wide_compliance(mesh)
    monkeypatch.setattr("gearfe.gears.width.compliance.condense_extruded", None)
    for changed, whole in (
        (mesh, False),
        (replace(mesh, functions=3), True),
        (replace(mesh, coarsen=4.1), True),
        (replace(mesh, flank_coarsen=3.1), True),
        (replace(mesh, base_helix_angle=0.1), True),
        (replace(mesh, widths=(10e-3, 11e-3)), True),
        (replace(mesh, centres=(0.0, 1e-3)), True),
        (replace(mesh, materials=(steel, STEEL)), True),
    ):
        with pytest.raises(TypeError):
            wide_compliance(changed, whole=whole)


def test_profiles_decide_a_stored_law(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compliance = wide_compliance(WideMesh(GEARS, functions=1, coarsen=4.0))
    pair_law(compliance, NOMINAL)
    monkeypatch.setattr("gearfe.gears.width.pair_law.solve_half_plane", None)
    relieved = tooth_deviations(GEARS.pinion, FlankModification(crowning=5e-6)), NOMINAL[1]
    with pytest.raises(TypeError):
        pair_law(compliance, relieved)
