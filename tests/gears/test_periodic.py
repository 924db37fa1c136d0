"""Periodic interpolation: exact where it must be, monotone, smooth, with its rate, and honest about gaps."""

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from gearfe.base.errors import InputError
from gearfe.gears.gearmesh.periodic import METHODS, periodic_interpolant

PERIOD = 0.31


def smooth(x):
    w = 2 * np.pi / PERIOD
    return 3 + np.sin(w * x + 0.4) + 0.3 * np.cos(2 * w * x)


@pytest.mark.parametrize("method", METHODS)
def test_constant_is_exact(method):
    curve = periodic_interpolant(np.linspace(0, PERIOD, 7)[:-1], np.full(6, 4.25), PERIOD, method=method)
    value, slope = curve(np.linspace(-1, 1, 50))
    np.testing.assert_array_equal(value, 4.25)
    np.testing.assert_array_equal(slope, 0.0)


def test_linear_is_exact_on_a_saw():
    nodes = np.array([0.0, 0.1, 0.16, 0.21, 0.26]) * PERIOD / 0.31
    values = np.array([1.0, 2.0, -1.0, 0.5, 0.7])
    curve = periodic_interpolant(nodes, values, PERIOD, method="linear", widest_gap=0.4)
    x = np.linspace(-2 * PERIOD, 2 * PERIOD, 777)
    np.testing.assert_allclose(curve(x).value, np.interp(x, nodes, values, period=PERIOD), atol=1e-12)
    assert curve(0.05 * PERIOD / 0.31).slope == pytest.approx((2.0 - 1.0) / (0.1 * PERIOD / 0.31))


def test_cubic_is_exact_on_a_straight_stretch():
    """Where three secants in a row agree, the monotone cubic is the straight line."""
    nodes = np.arange(10) * PERIOD / 10
    values = np.concatenate([2.0 + 5.0 * nodes[:6], [0.0, -1.0, 0.5, 1.0]])
    curve = periodic_interpolant(nodes, values, PERIOD)
    x = np.linspace(nodes[1], nodes[4], 30)
    np.testing.assert_allclose(curve(x).value, 2.0 + 5.0 * x, rtol=1e-13)
    np.testing.assert_allclose(curve(x).slope, 5.0, rtol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_cubic_equals_another_program_inside_the_cycle(seed):
    rng = np.random.default_rng(seed)
    nodes = np.sort(rng.uniform(0, PERIOD, 12)) * 0.999
    values = rng.uniform(-1, 1, 12)
    curve = periodic_interpolant(nodes, values, PERIOD, widest_gap=1.0)
    wrapped = np.concatenate([nodes - PERIOD, nodes, nodes + PERIOD])
    other = PchipInterpolator(wrapped, np.tile(values, 3))
    x = np.linspace(0, PERIOD, 400)
    np.testing.assert_allclose(curve(x).value, other(x), atol=1e-13)
    np.testing.assert_allclose(curve(x).slope, other.derivative()(x), atol=1e-10)


@pytest.mark.parametrize("method", METHODS)
def test_nodes_periods_slopes_and_no_overshoot(method):
    rng = np.random.default_rng(1)
    nodes = np.sort(rng.uniform(0, PERIOD, 15))
    values = rng.uniform(1, 2, 15)
    curve = periodic_interpolant(nodes, values, PERIOD, method=method)
    np.testing.assert_allclose(curve(nodes + 3 * PERIOD).value, values, rtol=1e-12)
    x = np.linspace(0, PERIOD, 999)
    y = curve(x).value
    np.testing.assert_allclose(curve(x - 5 * PERIOD).value, y, atol=1e-10)
    assert y.min() >= values.min() - 1e-14
    assert y.max() <= values.max() + 1e-14
    away = np.abs(x[:, None] - nodes).min(axis=1) > 1e-6
    step = 1e-7 * PERIOD
    rise = (curve(x + step).value - curve(x - step).value) / (2 * step)
    np.testing.assert_allclose(curve(x).slope[away], rise[away], atol=1e-4 * np.abs(rise).max())


@pytest.mark.parametrize("method", METHODS)
def test_rate(method):
    """Errors fall with the square of the step (at extrema, where the monotone cubic flattens, not faster)."""
    x = np.linspace(0, PERIOD, 5000)
    errors = []
    counts = np.array([20, 40, 80, 160])
    for n in counts:
        nodes = np.arange(n) * PERIOD / n
        errors.append(
            np.abs(periodic_interpolant(nodes, smooth(nodes), PERIOD, method=method)(x).value - smooth(x)).max()
        )
    assert np.polyfit(np.log(counts), np.log(errors), 1)[0] < -1.8


def test_what_fails_is_left_out():
    nodes = np.arange(20) * PERIOD / 20
    values = smooth(nodes)
    values[7] = np.nan
    curve = periodic_interpolant(nodes, values, PERIOD)
    assert len(curve.nodes) == len(nodes)  # one less, and the first again at the end of the period
    assert np.abs(curve.nodes - nodes[7]).min() > 1e-3
    assert np.isfinite(curve(np.linspace(0, 1, 300)).value).all()


def test_a_repeated_phase_counts_once():
    nodes = np.concatenate([np.arange(10), [3, 13, 23 - 1e-13]]) * PERIOD / 10
    values = np.concatenate([np.arange(10.0), [3.01, 3.02, 2.99]])
    curve = periodic_interpolant(nodes, values, PERIOD)
    np.testing.assert_allclose(curve(nodes[:10]).value, np.arange(10.0), atol=1e-12)


def test_a_sample_just_below_a_whole_period_is_one_at_zero():
    curve = periodic_interpolant(
        [3 * PERIOD - 1e-16, 0.2 * PERIOD, 0.4 * PERIOD, 0.6 * PERIOD, 0.8 * PERIOD], range(5), PERIOD
    )
    assert float(curve(0.0).value) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("values", [[1.0, 2.0, 3.0], [np.nan] * 3])
def test_an_uncovered_cycle_is_refused(values):
    with pytest.raises(InputError, match="does not cover the mesh cycle"):
        periodic_interpolant(np.array([0.0, 0.1, 0.2]) * PERIOD, values, PERIOD)


def test_unknown_method():
    with pytest.raises(InputError, match="cubic, linear"):
        periodic_interpolant([0.0], [1.0], PERIOD, method="quintic")


def _two_cycles(step: float) -> tuple[np.ndarray, np.ndarray]:
    """A peaky periodic function at steps over two periods and a bit, with places that do not repeat."""
    phase = np.arange(0.0, 2.1, step) * PERIOD
    turned = 2 * np.pi * phase / PERIOD
    return phase, 1e8 * (1.5 + np.tanh(8 * np.sin(turned)) + 0.1 * np.cos(3 * turned))


@pytest.mark.parametrize("step", [1 / 12, 1 / 36, 0.0713, 0.019])
def test_a_table_of_several_cycles_agrees_with_itself(step) -> None:
    phase, values = _two_cycles(step)
    rng = np.random.default_rng(1)
    periodic_interpolant(phase, values * (1 + 1e-3 * rng.uniform(-1, 1, len(values))), PERIOD)
    rounded = np.radians(np.round(np.degrees(phase), 3))
    periodic_interpolant(rounded, values, PERIOD)
    order = rng.permutation(len(phase))
    moved = periodic_interpolant(phase[order] - 3 * PERIOD, values[order], PERIOD)
    places = np.linspace(0.0, PERIOD, 31)
    whole = periodic_interpolant(phase, values, PERIOD)
    assert moved(places).value == pytest.approx(whole(places).value, rel=1e-6)


@pytest.mark.parametrize("step", [1 / 12, 1 / 36, 0.0713, 0.019])
@pytest.mark.parametrize("where", ["later", "earlier", "shifted"])
def test_a_table_that_contradicts_itself_is_refused(step, where) -> None:
    phase, values = _two_cycles(step)
    row = int(1.3 / step)  # in the second cycle
    if where == "shifted":
        phase, row = phase - 5.4 * PERIOD, int(1.7 / step)
    elif where == "earlier":
        phase, values = phase[::-1], values[::-1]
        row = len(phase) - 1 - int(0.27 / step)
    values[row] *= 1.3
    with pytest.raises(InputError, match=rf"contradicts itself: .*row {row + 1} \(") as told:
        periodic_interpolant(phase, values, PERIOD)
    assert str(told.value).count("row ") == 2


def test_one_angle_with_two_values_is_refused() -> None:
    phase = np.append(np.arange(12) / 12, 0.25) * PERIOD
    values = np.append(np.full(12, 2.0), 3.0)
    with pytest.raises(InputError, match=r"row 4 \(.*: 2\) against row 13 \(.*: 3\)"):
        periodic_interpolant(phase, values, PERIOD)
