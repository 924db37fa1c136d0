"""Floquet multipliers of periodic motions: Mathieu's borders, direct integration, the trains' own multipliers."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import mathieu_a, mathieu_b

from gearfe.base.errors import InputError
from gearfe.drivetrain.runup.balance import Oscillator, settled, solve
from gearfe.drivetrain.runup.condensed import condense
from gearfe.drivetrain.runup.instability import instability_map
from gearfe.drivetrain.runup.linear import Linear
from gearfe.drivetrain.runup.run_up import run_up, steady_state
from gearfe.drivetrain.runup.stability import STABLE, kind_of, multipliers
from gearfe.drivetrain.runup.train_stability import train_stability
from gearfe.drivetrain.train import build_train
from tests.makers.oscillators import duffing, meshing, monodromy, pushes, response_curve, settled_at, start_of
from tests.makers.trains import curve as stiffness_curve
from tests.makers.trains import loaded, smooth


def smooth_of(teeth, swing):  # type: ignore[no-untyped-def]
    return stiffness_curve(teeth, mean=1e8, swing=swing)


@pytest.mark.parametrize("border", [mathieu_a, mathieu_b])
def test_the_borders_of_mathieus_equation(border):
    """``x'' + (1 + e cos wt) x``: a = 4/w^2, q = 2e/w^2; the first tongue lies between a_1 and b_1."""
    e = 0.3
    edge = brentq(lambda w: border(1, 2 * e / w**2) - 4 / w**2, 1.5, 2.5)
    system = meshing(e, 0.0, 1.0, gap=0.0).oscillator
    sides = [multipliers(system, settled_at(system, edge * (1 + s * 2e-4), 1e-8)) for s in (-1, 1)]
    stable, unstable = sorted(sides, key=lambda x: abs(x[0]))
    assert abs(stable[0]) == pytest.approx(1.0, abs=1e-5)
    assert abs(unstable[0]) > 1.003
    assert kind_of(stable, unstable) == "period doubling"


def test_multipliers_of_oscillators_by_direct_integration():
    for system, speeds, parts in (
        (duffing(0.05, 0.03, 0.2), np.arange(0.8, 1.3, 0.05), False),
        (meshing(0.1, 0.03, 1.0), np.arange(0.85, 1.0, 0.03), True),
    ):
        made = response_curve(system.oscillator, speeds, 1e-4 if parts else 1e-7, highest=20.0)
        for orbit in made.orbits[::3]:
            exact = np.linalg.eigvals(monodromy(system, orbit.speed, start_of(orbit), parts=parts))
            mine = multipliers(system.oscillator, orbit)
            assert np.sort(np.abs(mine)) == pytest.approx(np.sort(np.abs(exact)), rel=1e-2 if parts else 1e-4)


@pytest.mark.parametrize("turns_in_a_step", [1.0, 1.5, 2.0])
def test_a_mode_far_above_the_mesh_frequency_follows_slow_changes(turns_in_a_step):
    """Slow changes of the stiffness leave |mu| = exp(-c T/2), the decay of the free mode (adiabatic invariance).

    Steps of a 64th of the period, in which the mode makes half-turns, would drive it.
    """
    system, speed = meshing(0.1, 5e-4, 1.0, gap=0.0).oscillator, 1.0 / (64 * turns_in_a_step)
    found = np.abs(multipliers(system, settled_at(system, speed, 1e-6)))
    decay = 0.5 * float(system.linear.damping[0, 0])
    np.testing.assert_allclose(found, math.exp(-decay * 2.0 * math.pi / speed), rtol=1e-3)


def test_branches_between_turning_points_are_unstable():
    system = duffing(0.05, 0.03, 0.2)
    made = response_curve(system.oscillator, np.arange(0.8, 1.4, 0.02))
    for orbit, branch in zip(made.orbits, made.branch, strict=True):
        largest = abs(multipliers(system.oscillator, orbit)[0])
        if math.isnan(orbit.error):  # next to a turning point
            assert largest == pytest.approx(1.0, abs=0.1)
        else:
            assert (largest <= STABLE) == (branch != 1)


def test_a_sum_resonance_of_two_modes():
    """Two modes that a periodic stiffness joins at the sum of their frequencies: complex multipliers grow."""
    squares, places, e = np.array([1.0, 2.3**2]), np.array([[1.0], [1.5]]), 0.5
    damping = np.diag([0.01, 0.02])

    def forces(theta, speed, u, du):  # type: ignore[no-untyped-def]
        k = e * np.cos(theta[:, 0])
        return pushes(-k * u[:, 0], -k)

    system = Oscillator(Linear(squares, damping, places, np.zeros(2)), forces, (1.0,), np.ones(1))
    speed = 3.3
    orbit = settled(system, *solve(system, speed, np.zeros((9, 1), dtype=complex), 1e-6), 1e-6)

    def rhs(t, y):  # type: ignore[no-untyped-def]
        push = -e * math.cos(speed * t) * (places[:, 0] @ y[:2])
        return [*y[2:], *(places[:, 0] * push - squares * y[:2] - damping @ y[2:])]

    period = 2 * math.pi / speed
    columns = [solve_ivp(rhs, (0, period), x, "DOP853", rtol=1e-11, atol=1e-13).y[:, -1] for x in np.eye(4)]
    exact = np.linalg.eigvals(np.array(columns).T)
    mine = multipliers(system, orbit)
    assert abs(mine[0]) > 1.01
    assert np.sort(np.abs(mine)) == pytest.approx(np.sort(np.abs(exact)), rel=1e-5)
    assert kind_of(mine, mine) == "Neimark-Sacker"


def test_modes_that_the_mesh_reaches_little_are_left_to_themselves():
    model = build_train(loaded([(20, 30)], smooth, ratio=0.02))
    state, exact = steady_state(model, 600.0), train_stability(model)
    assert np.abs(state.multipliers[:10]) == pytest.approx(np.abs(exact.multipliers[:10]), rel=1e-3)
    assert state.stable


def test_constant_stiffness_leaves_the_modes_to_themselves():
    """No mode is changed over the period: all multipliers are exp(-zeta omega T)."""
    model = build_train(loaded([(20, 30)], lambda teeth: smooth_of(teeth, 0.0), ratio=0.02, flexible=False))
    state = steady_state(model, 600.0)
    period = 2 * math.pi / (20 * 600.0)
    decays = np.exp(-0.02 * 2 * math.pi * model.coupled_frequencies_hz * period)
    assert np.abs(state.multipliers).max() == pytest.approx(decays.max(), rel=1e-9)


def test_an_undamped_train_is_unstable_at_twice_its_frequency():
    """Parametric resonance of a pair in a rigid housing: mesh frequency twice the natural frequency."""
    model = build_train(loaded([(20, 30)], smooth, ratio=1e-3, flexible=False))
    natural = 2 * math.pi * model.coupled_frequencies_hz[-1]
    twice = 2.0 * natural / 20.0
    run = run_up(model, twice * np.linspace(0.9, 1.1, 9))
    middle = next(s for s in run.states if s.speed == pytest.approx(twice))
    assert not middle.stable
    assert run.states[0].stable
    kinds = {b.kind for b in run.bifurcations}
    assert kinds == {"period doubling"}


def test_the_map_without_damping_has_mathieus_tongue():
    """A pair in a rigid housing, k (1 + e cos): unstable between the speeds of the characteristic values alone."""
    model = build_train(loaded([(20, 30)], lambda teeth: smooth_of(teeth, 0.1), flexible=False))
    train = condense(model)
    stiffness, inertia = 1e8, model.shafts[1].rotor.polar
    radius = abs(float(model.meshes[0].row[model.first[1] + 5]))
    natural = radius * math.sqrt(stiffness / inertia)
    edges = [
        brentq(lambda w, border=border: border(1, 2 * 0.1 / w**2) - 4 / w**2, 1.8, 2.2) * natural / 20.0
        for border in (mathieu_a, mathieu_b)
    ]
    low, high = sorted(edges)
    speeds = [0.998 * low, 1.002 * low, 0.5 * (low + high), 0.998 * high, 1.002 * high]
    made = instability_map(train, speeds, [0.5, 1.0])
    assert (np.abs(made.multiplier) > 1.0 + 1e-3).tolist() == [[False, True, True, True, False]] * 2
    with pytest.raises(InputError, match="must be > 0"):
        instability_map(train, speeds, [0.0])
