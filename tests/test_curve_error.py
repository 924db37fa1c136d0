"""Default accuracy at the cause: face widths, and the error estimate that stands beside a curve."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gearfe import sweep_stiffness
from gearfe.contact.laws import Nitsche, Penalty
from gearfe.elasticity import Material
from gearfe.stiffness.curve_error import (
    COARSENING,
    COMMON,
    ORDER,
    error_estimate,
    solved_twice,
)
from gearfe.stiffness.sweep import elastic_pair

from . import gears
from .solving import solve_positions

SHARP = gears.pair(20, 30, bore=0.35)


# ---- unlike face widths ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("law", [Nitsche(), Penalty()])
def test_a_wider_gear_is_one_of_the_common_width_and_a_higher_modulus(law):
    """Plane elasticity: only E times width counts, so 27 mm at 200 GPa is 9 mm at 600 GPa, whatever the contact law."""
    angles, twist = np.radians([4.0, 13.0]), math.radians(0.05)
    wide = gears.pair(20, 30, bore=0.35, width=9e-3, pinion={"width": 27e-3})
    same = gears.pair(20, 30, bore=0.35, width=9e-3)
    given = {"law": law, "coarsen": 2.0}
    one = elastic_pair(wide, materials=(Material(200e9, 0.3), Material(110e9, 0.3)), **given)
    other = elastic_pair(same, materials=(Material(600e9, 0.3), Material(110e9, 0.3)), **given)
    made = [solve_positions(elastic, angles, twist) for elastic in (one, other)]
    found = [[p.torque_wheel for p in positions] for positions in made]
    np.testing.assert_allclose(found[0], found[1], rtol=1e-8)


# ---- the estimate ----------------------------------------------------------------------------------------------------


def test_one_position_that_agrees_by_chance_is_not_believed():
    fine = np.full(10, 100.0)
    coarse = fine * (1 + 1e-3 * np.array([1, -1, 0, 1, -1, 1, -1, 1, -1, 1]))
    assert error_estimate(fine, coarse).min() > 0.9e-3


def test_a_position_that_failed_on_the_coarse_mesh_gets_the_largest_error():
    fine = np.full(4, 100.0)
    estimate = error_estimate(fine, np.array([100.1, np.nan, 101.0, 100.2]))
    assert estimate[1] == estimate[2] == estimate.max()
    assert np.isnan(error_estimate(fine[:2], np.full(2, np.nan))).all()


def test_the_estimate_is_exact_plus_what_meshes_share_for_an_error_of_its_order():
    """T(h) = T (1 + C h^p) at every position: d is the fine mesh's error, up to its own square."""
    size, count = 0.3, 20
    true = 0.01 * size**ORDER
    fine, coarse = 1 + true, 1 + 0.01 * (COARSENING * size) ** ORDER
    found = error_estimate(np.full(count, fine), np.full(count, coarse), coarsen=size)
    expected = (1 + 1 / count) * true / fine + COMMON * size**ORDER
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_positions_solved_twice_have_converged_and_span_the_sweep():
    converged = np.arange(100) % 3 != 0
    chosen = solved_twice(converged)
    assert len(chosen) == 20
    assert converged[chosen].all()
    assert (chosen[0], chosen[-1]) == (1, 98)
    assert len(solved_twice(np.zeros(3, dtype=bool))) == 0


@pytest.mark.parametrize("twist_deg", [0.06, pytest.param(0.2, marks=pytest.mark.slow)])
def test_the_estimate_covers_the_true_error(twist_deg):
    """Coarse settings against a mesh 2.5 times as fine, pair changes included: nearly all, within ten in the median."""
    pair = gears.pair(17, 25, pressure_angle=20.0, pinion={"profile_shift": 0.3, "tip_round": 0.1e-3, "width": 14e-3})
    given = {"twist": math.radians(twist_deg), "kinematics": "small"}
    curve = sweep_stiffness(pair, law="nitsche", coarsen=1.5, estimate_error=True, **given)
    fine = sweep_stiffness(pair, law="nitsche", coarsen=0.6, **given)
    true = np.abs(curve.k_mesh / fine.k_mesh - 1)
    assert (curve.relative_error >= true).sum() >= 19
    assert np.median(curve.relative_error / true) < 10
    assert curve.worst_error > curve.relative_error.max()  # one of many covered at 95 % each is off further


def test_finer_settings_are_estimated_finer():
    given = {"twist": math.radians(0.05), "kinematics": "small", "estimate_error": True, "law": "nitsche"}
    angles = np.radians([3.0, 5.0, 12.0, 14.0])
    coarse, fine = (sweep_stiffness(SHARP, angles=angles, coarsen=c, **given) for c in (2.0, 1.0))
    assert fine.typical_error < coarse.typical_error / 1.5
