"""Line loads along the face width between the points of the contact: convergence, forces, ends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gearfe.gears.width import EndRelief, LeadModification, Misalignment, WideFlanks, sweep_width
from gearfe.gears.width.lines import DENSE
from tests.gears.test_width import EVERY
from tests.makers.wide_gears import helical_lines, internal_lines, spur_lines


def random_flanks(random: np.random.Generator, width: float) -> WideFlanks:
    """Crowning, end reliefs and tilts as users could draw them."""
    lead = LeadModification(
        crowning=random.uniform(-5e-6, 30e-6),
        relief_low=EndRelief(random.uniform(0, 30e-6), width * random.uniform(0.05, 0.4)),
        relief_high=EndRelief(random.uniform(0, 30e-6), width * random.uniform(0.05, 0.4), 2.0),
    )
    tilts = Misalignment.over_width(random.uniform(-60e-6, 60e-6), width, random.uniform(-60e-6, 60e-6))
    return WideFlanks(leads=(lead, LeadModification()), misalignment=tilts)


@pytest.mark.parametrize("gears", [helical_lines, spur_lines, internal_lines], ids=["helical", "spur", "internal"])
def test_the_largest_line_load_does_not_depend_on_the_points(gears):
    """Points four times as many: within 0.5 % at each position, as are both load factors, and at the same place."""
    random = np.random.default_rng(45)
    for _ in range(4):
        lines = gears().with_flanks(random_flanks(random, gears().compliance.mesh.width))
        torque = 10 ** random.uniform(0.7, 2.6)
        one, other = (
            sweep_width(replace(lines, density=share * lines.density), [torque], positions=8) for share in (1.0, 4.0)
        )
        assert one.peak_line_load == pytest.approx(other.peak_line_load, rel=5e-3)
        assert np.abs(one.peak_z - other.peak_z).max() < 0.01 * lines.compliance.mesh.width
        assert one.k_h_beta == pytest.approx(other.k_h_beta, rel=5e-3)
        assert one.k_h_alpha == pytest.approx(other.k_h_alpha, rel=5e-3)


@pytest.mark.parametrize("flanks", EVERY.values(), ids=EVERY)
def test_line_loads_between_the_points_carry_the_same_force(flanks, monkeypatch):
    """Trapezoids over places of each line against the sum over its Gauss points: both converge to one force.

    The errors are those of trapezoids, and of Gauss points that straddle no kink: 0.2 %, and 2e-5 with more of both.
    """
    for share, places, bound in ((1.0, DENSE, 2e-3), (4.0, 16 * DENSE, 2e-5)):
        monkeypatch.setattr("gearfe.gears.width.lines.DENSE", places)
        lines = helical_lines().with_flanks(flanks)
        points = sweep_width(replace(lines, density=share * lines.density), [100.0], positions=3).points
        total = np.bincount(points.position, points.line_load * points.weight)
        line = np.stack([points.position, points.pair])
        for chosen in np.unique(line, axis=1).T:
            on_line = (line == chosen[:, None]).all(axis=0)
            z, load, weight = (values[on_line] for values in (points.z, points.line_load, points.weight))
            assert (np.diff(z) >= 0.0).all()
            assert np.trapezoid(load, z) == pytest.approx(load @ weight, abs=bound * total[chosen[0]])
            carries = weight > 0.0
            between = np.interp(z[carries], z[~carries], load[~carries])
            assert np.abs(between - load[carries]).max() < 10.0 * bound * load.max()
