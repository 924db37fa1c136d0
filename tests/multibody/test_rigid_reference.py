"""The two benchmark mechanisms against solutions in 18 digits, energies, residuals, reversal, error against
tolerance."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from gearfe.mechanisms import load_mechanism
from gearfe.multibody import consistent_start, integrate
from tests.makers.four_bar import four_bar
from tests.makers.rigid_cases import (
    by_scipy,
    chain,
    folding_links,
    pendulum,
    reference,
    residuals,
    seven_angles,
    total_energy,
)
from tests.places import GEOMETRY

NAMES = ("beta", "Theta", "gamma", "Phi", "delta", "Omega", "epsilon")


@pytest.fixture(scope="module")
def andrews():
    mechanism = load_mechanism(GEOMETRY / "andrews.toml")
    table = reference("andrews_reference.csv")
    return mechanism.system, mechanism.start(), table["t"], np.stack([table[n] for n in NAMES], 1)


@pytest.mark.parametrize(("tolerance", "allowed"), [(1e-4, 1e-4), (1e-6, 1e-6), (1e-9, 1e-9), (1e-12, 1e-12)])
def test_andrews_angles(andrews, tolerance, allowed):
    """Seven angles over 0..0.03 s against binary128 extrapolation (issue: 1e-9 and 1e-12)."""
    system, start, times, truth = andrews
    made = integrate(system, times, tolerance=tolerance, start=start)
    assert made.status == 0
    assert np.abs(seven_angles(made.q) - truth).max() <= allowed


def test_andrews_rates_energy_and_residuals(andrews):
    system, start, times, _ = andrews
    table = reference("andrews_reference.csv")
    made = integrate(system, times, tolerance=1e-11, start=start)
    rates = np.stack([table["d" + n] for n in NAMES], 1)
    assert np.abs(seven_angles(made.v) - rates).max() <= 1e-9 * np.abs(rates).max()
    work = 0.033 * (made.q[:, 2] - made.q[0, 2])
    total = total_energy(made) - work
    assert np.ptp(total) <= 1e-10 * np.abs(work).max()
    place, rate = residuals(made)
    assert place <= 1e-13
    assert rate <= 1e-9


def test_andrews_backwards(andrews):
    """Run to the end, then back to the start."""
    system, start, times, _ = andrews
    there = integrate(system, [0.0, times[-1]], tolerance=1e-12, start=start)
    end = consistent_start(system, times[-1], q=there.q[-1], v=there.v[-1])
    back = integrate(system, [times[-1], 0.0], tolerance=1e-12, start=end)
    assert back.status == 0
    assert np.abs(back.q[-1] - there.q[0]).max() <= 1e-10


def test_folding_links_against_the_reference():
    table = reference("slider_crank_reference.csv")
    system = folding_links()
    made = integrate(system, table["t"], tolerance=1e-9)
    assert made.status == 0
    assert np.abs(made.q[:, 2] - table["theta"]).max() <= 1e-8
    omega, alpha = made.v[:, 2], made.a[:, 2]
    a_x = -np.sin(table["theta"]) * alpha - np.cos(table["theta"]) * omega**2
    assert np.abs(omega - table["omega"]).max() <= 1e-7
    assert np.abs(a_x - table["axA"]).max() <= 1e-6
    assert np.ptp(total_energy(made)) <= 1e-8
    assert len(made.statistics["change_points"]) == 11  # the reference passes +-90 degrees eleven times


def test_error_follows_the_tolerance(andrews):
    """Error <= max(10 tolerance, 5e-13), the constants that docs/mechanisms.md publishes; tightening costs no digit."""
    system, start, times, truth = andrews
    before = np.inf
    for tolerance in 10.0 ** -np.arange(3, 13):
        made = integrate(system, times, tolerance=float(tolerance), start=start)
        error = np.abs(seven_angles(made.q) - truth).max()
        assert error <= max(10 * tolerance, 5e-13)
        assert error <= 10 * max(before, 5e-13)
        before = error


def test_compiled_kernels_agree_with_scipy_on_the_equations_of_motion(andrews):
    """Coordinates and rates; SciPy's own error after 16 rad of the crank is some 1e-10 at its tolerance of 1e-13."""
    system, start, times, _ = andrews
    made = integrate(system, times, tolerance=1e-12, start=start)
    q, v = by_scipy(system, times, start, rtol=1e-13, atol=1e-14)
    assert np.abs(made.q - q).max() <= 1e-9
    assert np.abs(made.v - v).max() <= 1e-9 * np.abs(v).max()


@pytest.mark.parametrize("method", ["taylor", "implicit", "symplectic"])
@pytest.mark.parametrize(
    "make", [pendulum, partial(chain, 4), partial(folding_links, rod=1.3), partial(four_bar, 0.5, 0.5)]
)
def test_every_method_meets_the_equations_of_motion(make, method):
    """M a + G^T lambda = f and G a = -gamma at all output times, evaluated in NumPy; and SciPy's motion."""
    system, times = make(), np.linspace(0.0, 0.5, 11)
    made = integrate(system, times, method=method, tolerance=1e-9)
    q, v = by_scipy(system, times)
    assert np.abs(made.q - q).max() <= 1e-6
    assert np.abs(made.v - v).max() <= 1e-5
    for t, q, v, a, pull in zip(times, made.q, made.v, made.a, made.multipliers, strict=True):
        G, f = system.jacobian(t, q), system.force(t, q, v)
        assert np.abs(system.mass @ a + G.T @ pull - f).max() <= 1e-4 * max(1.0, np.abs(f).max())
        assert np.abs(G @ a + system.velocity_terms(t, q, v)).max() <= 1e-4 * max(1.0, np.abs(a).max())


@pytest.mark.slow
def test_a_thousand_seconds_of_folding_links():
    """Energy and the phase after 565 turns; the period by the trapezoidal rule, which is exact for periodic
    functions."""
    theta, omega = np.pi / 4, 4 / (2 * np.sin(np.pi / 4))
    energy = (1 / 3 + np.sin(theta) ** 2) * omega**2 + 9.81 * np.sin(theta)
    x = 2 * np.pi * np.arange(4096) / 4096 + theta
    speed = np.sqrt((energy - 9.81 * np.sin(x)) / (1 / 3 + np.sin(x) ** 2))
    period = 2 * np.pi * np.mean(1 / speed)
    turns = 564
    made = integrate(folding_links(), [0.0, turns * period], tolerance=1e-12)
    assert made.status == 0
    assert abs(made.q[-1, 2] - theta - 2 * np.pi * turns) <= 1e-7
    assert np.ptp(total_energy(made)) <= 1e-10 * energy
