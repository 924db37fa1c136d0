"""Stored stiffness curves: read instead of computed, and never for other gears, loads or sizes."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gearfe.contact.laws import HalfPlane, Nitsche, PairModel, Penalty
from gearfe.elasticity import Material
from gearfe.stiffness.curve_cache import cached_curve, curve_key

from .gears import pair

STEEL = Material(200e9, 0.3, density=7850.0)
MODEL = PairModel((STEEL, STEEL), "strain", Nitsche(1.0), coarsen=1.5)
SWEEP = {"twist": 1e-3, "angles": np.radians([0.0, 6.0, 12.0]), "kinematics": "small"}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("GEARFE_CACHE", str(tmp_path))
    return tmp_path


def mark(folder):
    """Another number of iterations in every stored curve: what shows it was read, not computed."""
    for path in folder.glob("curve-*.csv"):
        head, *rows = [line.split(",") for line in path.read_text().splitlines()]
        for row in rows:
            row[head.index("iterations")] = "77"
        path.write_text("\n".join(map(",".join, [head, *rows])) + "\n")


def test_the_second_time_nothing_is_computed(folder):
    gears = pair(20, 30)
    first = cached_curve(gears, MODEL, SWEEP)
    assert len(list(folder.glob("curve-*.csv"))) == 1
    mark(folder)
    second = cached_curve(gears, MODEL, SWEEP)
    assert second.iterations.tolist() == [77] * 3
    for name in ("k_mesh", "torque_wheel", "pinion_angle", "twist", "load_share"):
        np.testing.assert_array_equal(getattr(second, name), getattr(first, name))
    assert 77 not in cached_curve(gears, MODEL, SWEEP | {"twist": 1.1e-3}).iterations


def test_everything_that_decides_a_curve_is_in_its_key():
    gears = pair(20, 30)
    other = replace(STEEL, youngs_modulus=210e9)
    keys = [
        curve_key(gears, MODEL, SWEEP),
        curve_key(pair(20, 31), MODEL, SWEEP),
        curve_key(pair(20, 30, centre_distance=62.51e-3), MODEL, SWEEP),
        curve_key(pair(20, 30, tip_round=1e-5), MODEL, SWEEP),
        curve_key(gears, MODEL.changed(materials=(STEEL, other)), SWEEP),
        curve_key(gears, MODEL.changed(plane="stress"), SWEEP),
        curve_key(gears, MODEL.changed(law=Nitsche(2.0)), SWEEP),
        curve_key(gears, MODEL.changed(law=Penalty()), SWEEP),
        curve_key(gears, MODEL.changed(coarsen=3.0), SWEEP),
        curve_key(gears, MODEL, SWEEP | {"twist": np.nextafter(1e-3, 1)}),
        curve_key(gears, MODEL, SWEEP | {"angles": np.radians([0.0, 6.0, 12.5])}),
        curve_key(gears, MODEL, SWEEP | {"kinematics": "finite"}),
    ]
    assert len(set(keys)) == len(keys)
    named, given = MODEL.changed(law="half_plane"), MODEL.changed(law=HalfPlane())
    assert curve_key(gears, named, SWEEP) == curve_key(gears, given, SWEEP) not in keys
    assert curve_key(pair(20, 30), replace(MODEL), dict(SWEEP)) == keys[0]


def test_a_damaged_file_is_made_anew(folder):
    gears = pair(20, 30)
    first = cached_curve(gears, MODEL, SWEEP)
    (path,) = folder.glob("curve-*.csv")
    path.write_text(path.read_text()[:300])
    again = cached_curve(gears, MODEL, SWEEP)
    np.testing.assert_array_equal(again.k_mesh, first.k_mesh)
    assert path.read_text().count("\n") == 4


def test_without_a_cache(monkeypatch):
    monkeypatch.setenv("GEARFE_CACHE", "off")
    assert len(cached_curve(pair(20, 30), MODEL, SWEEP)) == 3


def test_the_estimate_of_a_stored_curve_is_kept(folder):
    gears = pair(20, 30)
    bare = cached_curve(gears, MODEL, SWEEP)
    assert math.isnan(bare.worst_error)
    first = cached_curve(gears, MODEL, SWEEP, estimate_error=True)  # asked for later: made, and kept
    assert first.worst_error > 0.0
    mark(folder)
    second = cached_curve(gears, MODEL, SWEEP, estimate_error=True)
    assert second.iterations.tolist() == [77] * 3
    np.testing.assert_array_equal(second.relative_error, first.relative_error)
    np.testing.assert_array_equal(second.k_mesh, first.k_mesh)
    assert math.isnan(cached_curve(gears, MODEL, SWEEP).worst_error)
