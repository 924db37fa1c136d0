"""The search for the twist that carries a load, on load curves whose inverse is known."""

import numpy as np
import pytest

from gearfe.gears.gearmesh.load_search import Response, newton_twist, search_load

FIRST = np.array([0.0, 1e-5, -2e-5])


def power_law(exponent, tangent_factor=1.0):
    """T = 1e6 delta^exponent beyond the first contact."""

    def evaluate(numbers, twists):
        delta = twists - FIRST[numbers]
        return Response(1e6 * delta**exponent, tangent_factor * 1e6 * exponent * delta ** (exponent - 1))

    return evaluate


def searched(evaluate, goal, guess, **options):
    options = {"most": 1.0, "near": 1e-4, "rounding": 0.0, "evaluations": 40} | options
    every = np.arange(len(goal))
    return search_load(evaluate, guess, evaluate(every, guess), goal, first_contact=FIRST, **options)


@pytest.mark.parametrize("exponent", [1.0, 1.1, 1.5])
def test_a_power_law_is_met_in_one_step(exponent):
    """ln(delta) is straight over ln(T), so Newton's step there is exact."""
    goal, counts = np.array([1e-3, 10.0, 400.0]), []

    def evaluate(numbers, twists):
        counts.append(len(numbers))
        return power_law(exponent)(numbers, twists)

    twist, _, missed = searched(evaluate, goal, FIRST + 1e-3)
    np.testing.assert_allclose(twist - FIRST, (goal / 1e6) ** (1 / exponent), rtol=1e-8)
    assert len(missed) == 0
    assert counts == [3, 3]


def test_wrong_tangents_end_in_halved_intervals():
    """Tangents a hundred times too small make steps that leave the interval."""
    goal = np.array([1e-3, 10.0, 400.0])
    evaluate = power_law(1.1, tangent_factor=0.01)
    twist, response, missed = searched(evaluate, goal, FIRST + 1e-6)
    assert len(missed) == 0
    np.testing.assert_allclose(response.load, goal, rtol=1e-4)
    np.testing.assert_allclose(twist - FIRST, (goal / 1e6) ** (1 / 1.1), rtol=1e-4)


def test_a_load_out_of_reach_is_missed_and_a_failed_cell_is_not():
    goal = np.array([10.0, 1e9, 10.0])

    def evaluate(numbers, twists):
        load, tangent = power_law(1.0)(numbers, twists)
        failed = numbers == 2
        return Response(np.where(failed, np.nan, load), np.where(failed, np.nan, tangent))

    twist, response, missed = searched(evaluate, goal, FIRST + 1e-6, most=0.01)
    assert missed.tolist() == [1]
    assert twist[1] <= 0.01
    assert response.load[0] == pytest.approx(10.0, rel=1e-4)
    assert np.isnan(response.load[2])


def test_the_last_step_errs_by_the_square_of_the_miss():
    def exact(delta):
        return 1e6 * delta * (1 + 300 * delta)

    goal = exact(2e-3)
    errors = []
    for miss in (1e-2, 1e-3):
        delta = np.array([2e-3 * (1 + miss)])
        response = Response(exact(delta), 1e6 * (1 + 600 * delta))
        errors.append(abs(newton_twist(delta, np.zeros(1), response, np.array([goal]))[0] / 2e-3 - 1))
    assert np.log10(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)
