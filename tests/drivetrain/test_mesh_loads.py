"""Loads of meshes in steady running, as ratings take them."""

from __future__ import annotations

import dataclasses

from gearfe.drivetrain.gearbox.mesh_loads import mesh_loads
from gearfe.drivetrain.train import Load
from gearfe.multibody import constant
from tests.makers.helical_trains import helical_chain


def test_an_idler_is_loaded_on_both_flanks() -> None:
    first, second = mesh_loads(helical_chain(0.0, idler=True)).values()
    assert first.both_flanks == (False, True)
    assert second.both_flanks == (True, False)


def test_a_mesh_that_carries_nothing_is_loaded_on_no_flank() -> None:
    """The load is on the middle shaft: the mesh beyond idles, and its gears have no alternating stress from it."""
    train = helical_chain(0.0, idler=True)
    train = dataclasses.replace(train, loads=(Load("s1", "s1 high", constant(60.0)),))
    first, second = mesh_loads(train).values()
    assert first.torque > 0.0
    assert second.torque == 0.0
    assert first.both_flanks == second.both_flanks == (False, False)
