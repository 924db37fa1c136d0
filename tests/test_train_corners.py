"""Corners of a train's forces: where a mesh passes from one cubic of its stiffness curve to the next."""

import numpy as np
import pytest

from gearfe.rigid import constant
from gearfe.rigid.compiled import available
from gearfe.stiffness.periodic import periodic_interpolant
from gearfe.train import build_train, simulate
from gearfe.train.law import NEAR, angle_block, joined, mesh_block, train_corner

from .trains import SHIPPED, curve, train

SPEED = 600.0


def parameters(sense=1.0, ratio=1.0, phase=0.0):
    """One mesh whose curve has nodes at 0, 0.1, 0.25, 0.4, 0.5 rad and the period 0.6 rad."""
    nodes = np.array([0.0, 0.1, 0.25, 0.4, 0.5])
    shape = periodic_interpolant(
        nodes, np.array([1e8, 1.1e8, 0.9e8, 1e8, 1.05e8]), 0.6, widest_gap=0.3, method="linear"
    )
    return joined([angle_block(constant(SPEED).integral(0.0, 0.0)), mesh_block(0, 1, ratio, sense, phase, 1e8, shape)])


@pytest.mark.parametrize(
    ("t", "spin", "rate", "sense", "sign", "way"),
    [
        (1e-4, 0.0, 0.0, 1.0, 1.0, 0.1 - 0.06),  # ahead of the node at 0.1
        (1e-4, 0.02, 0.0, 1.0, 1.0, 0.1 - 0.08),  # the shaft's own rotation counts
        (1e-4, 0.0, 0.0, 1.0, -1.0, 0.06),  # backwards in time: the node at 0
        (1e-4, 0.0, 0.0, -1.0, 1.0, 0.54 - 0.5),  # the other sense: -0.06 is 0.54, down to 0.5
        (0.1 / 600 - 1e-8, 0.0, 0.0, 1.0, 1.0, 0.15 + 6e-6),  # so near a node that it counts as passed
        (1.0009, 0.0, 0.0, 1.0, 1.0, 0.6 - 0.54),  # many turns later: 600.54 rad, to the end of the period
    ],
)
def test_time_to_the_next_corner(t, spin, rate, sense, sign, way):
    u, du = np.array([0.0, spin]), np.array([0.0, rate])
    found = train_corner(t, sign, u, du, parameters(sense=sense))
    assert found * SPEED == pytest.approx(way, rel=1e-6)
    assert NEAR * 0.1 > 6e-6


def test_a_constant_stiffness_has_no_corner():
    assert train_corner(0.1, 1.0, np.zeros(1), np.zeros(1), joined([angle_block(constant(SPEED))])) > 1e299


@pytest.mark.slow
@pytest.mark.skipif(not available(), reason="numba is not installed")
def test_steps_that_end_at_corners_are_fewer_and_better(monkeypatch):
    """A curve of straight lines, with and without its corners told to the integrator."""
    scene = train(SHIPPED, stiffness=lambda z: curve(z, swing=0.2, method="linear", count=12))
    times = np.linspace(0.0, 4e-3, 41)
    told = build_train(scene)
    monkeypatch.setattr("gearfe.train.model.train_corner", None)
    untold = build_train(scene)
    truth = simulate(told, times, tolerance=1e-12).contact_force
    other = simulate(untold, times, tolerance=1e-12).contact_force
    assert np.abs(truth - other).max() < 1e-9 * np.abs(truth).max()
    found = []
    for model in (told, untold):
        made = simulate(model, times, tolerance=1e-6)
        found.append((made.statistics["steps"], np.abs(made.contact_force - truth).max() / np.abs(truth).max()))
    assert found[0][0] < 0.8 * found[1][0]
    assert found[0][1] < 1e-6
