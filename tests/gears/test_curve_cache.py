"""Stored stiffness curves: read instead of computed, and never for other gears, loads or sizes."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest

from gearfe.fem.plane import Material
from gearfe.gears.contact.laws import HalfPlane, Nitsche, PairModel, Penalty
from gearfe.gears.gearmesh.job import cached_curve, curve_key
from tests.makers.gears import pair

STEEL = Material(200e9, 0.3, density=7850.0)
MODEL = PairModel((STEEL, STEEL), "strain", Nitsche(1.0), coarsen=1.5)
SWEEP = {"twist": 1e-3, "angles": np.radians([0.0, 6.0, 12.0]), "kinematics": "small"}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("GEARFE_CACHE", str(tmp_path))
    return tmp_path


def test_the_second_time_nothing_is_computed(folder, monkeypatch):
    gears = pair(20, 30)
    first = cached_curve(gears, MODEL, estimate_error=True, **SWEEP)
    assert len(list(folder.glob("curve-*"))) == 1
    assert first.worst_error > 0.0
    assert math.isnan(cached_curve(gears, MODEL, **SWEEP).worst_error)
    assert cached_curve(gears, MODEL, **SWEEP | {"twist": 1.1e-3}).k_mesh[0] != first.k_mesh[0]
    monkeypatch.setattr("gearfe.gears.gearmesh.sweep.sweep_stiffness", None)
    second = cached_curve(gears, MODEL, estimate_error=True, **SWEEP)
    for field in fields(first):
        if field.name != "timings":
            ours, theirs = getattr(second, field.name), getattr(first, field.name)
            np.testing.assert_array_equal(ours, theirs)
            assert type(ours) is type(theirs)


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
    first = cached_curve(gears, MODEL, **SWEEP)
    (path,) = folder.glob("curve-*")
    whole = path.read_bytes()
    path.write_bytes(whole[:300])
    np.testing.assert_array_equal(cached_curve(gears, MODEL, **SWEEP).k_mesh, first.k_mesh)
    assert len(path.read_bytes()) == len(whole)


def test_without_a_cache(monkeypatch):
    monkeypatch.setenv("GEARFE_CACHE", "off")
    assert len(cached_curve(pair(20, 30), MODEL, **SWEEP)) == 3
