"""Equivalent radiated power of bodies whose normal velocity is known."""

import math

import numpy as np
import pytest

from gearfe.errors import InputError
from gearfe.housing.meshes import Tetrahedra
from gearfe.vibration.radiation import instantaneous_power, power_level, radiated_power

from .housing_meshes import box

IMPEDANCE = 1.2041 * 343.21
SIZE = (0.3, 0.2, 0.05)
STEP = 1e-4


def surface(shapes, *, order=2, keep=None, cells=(3, 2, 1)):
    """Surface matrix of a box for nodal fields that are functions of the place, (n, 3) each."""
    nodes, tets = box(cells, SIZE, order=order)
    found = Tetrahedra(nodes, tets).surface([], keep)
    return found.radiation(np.column_stack([shape(nodes).ravel() for shape in shapes]))


def vector(axis, value=1.0):
    return lambda nodes: np.asarray(value(nodes) if callable(value) else value)[..., None] * np.eye(3)[axis] + 0 * nodes


def tones(*parts, n=400, constant=0.0):
    """Rates: whole numbers of periods in n samples."""
    return constant + sum(a * np.cos(2 * math.pi * b * np.arange(n) / n + p) for b, a, p in parts)


def test_a_box_that_moves_to_and_fro():
    """Two faces across the motion move at v along their normals: P = rho c v^2/2 (2 A)."""
    matrix = surface([vector(0), vector(1), vector(2)])
    a, b, c = SIZE
    assert matrix == pytest.approx(np.diag([2 * b * c, 2 * a * c, 2 * a * b]), abs=1e-15)
    rates = np.column_stack([0 * tones((1, 1, 0)), 0 * tones((1, 1, 0)), tones((20, 0.01, 0.4))])
    found = radiated_power(matrix, rates, STEP)
    expected = 0.5 * IMPEDANCE * 0.01**2 * 2 * a * b
    assert found.frequency[20] == pytest.approx(20 / (400 * STEP))
    assert found.power[20] == pytest.approx(expected, rel=1e-12)
    assert np.delete(found.power, 20).max() < 1e-20 * expected
    assert found.mean == pytest.approx(expected, rel=1e-12)
    assert found.level[20] == pytest.approx(10 * math.log10(expected / 1e-12), rel=1e-12)


@pytest.mark.parametrize("order", [1, 2])
def test_a_box_that_breathes(order):
    """v = s x on all faces: only x = a, y = b, z = c move along their normals, by s a, s b, s c."""
    matrix = surface([lambda nodes: nodes], order=order)
    a, b, c = SIZE
    assert matrix[0, 0] == pytest.approx(a * a * b * c + b * b * a * c + c * c * a * b, rel=1e-13)


def test_a_plate_that_bends():
    """Upper side of a plate with w = (x/a)^2 V: integral of w^2 over it is a b V^2/5, within the elements' reach."""
    matrix = surface(
        [vector(2, lambda nodes: (nodes[:, 0] / SIZE[0]) ** 2)], keep=lambda centres: centres[:, 2] > 0.999 * SIZE[2]
    )
    assert matrix[0, 0] == pytest.approx(SIZE[0] * SIZE[1] / 5, rel=1e-12)
    rate = tones((7, 0.03, 0.0))[:, None]
    found = radiated_power(matrix, rate, STEP)
    assert found.power[7] == pytest.approx(0.5 * IMPEDANCE * 0.03**2 * SIZE[0] * SIZE[1] / 5, rel=1e-12)


def test_a_simply_supported_plate_converges():
    """w = sin(pi x/a) sin(pi y/b) on the upper side: a b/4, with errors that fall with the fourth power of the size."""
    errors = []
    for cells in (2, 4, 8):
        shape = vector(2, lambda x: np.sin(math.pi * x[:, 0] / SIZE[0]) * np.sin(math.pi * x[:, 1] / SIZE[1]))
        matrix = surface([shape], keep=lambda centres: centres[:, 2] > 0.999 * SIZE[2], cells=(cells, cells, 1))
        errors.append(abs(matrix[0, 0] / (SIZE[0] * SIZE[1] / 4) - 1))
    assert math.log2(errors[1] / errors[2]) > 3.5
    assert errors[-1] < 1e-3


@pytest.mark.parametrize("n", [300, 301])
def test_lines_sum_to_the_mean_power(n):
    """Parseval, with the constant and the Nyquist line."""
    matrix = surface([vector(0), vector(1), lambda nodes: nodes])
    rates = 0.3 + np.random.default_rng(5).standard_normal((n, 3))
    found = radiated_power(matrix, rates, STEP)
    direct = IMPEDANCE * np.mean([v @ matrix @ v for v in rates])
    assert found.power.sum() == pytest.approx(direct, rel=1e-12)
    assert found.mean == pytest.approx(direct, rel=1e-12)
    assert instantaneous_power(matrix, rates)[7] == pytest.approx(IMPEDANCE * rates[7] @ matrix @ rates[7], rel=1e-12)


def test_motions_in_and_out_of_phase():
    """Rocking about y by opposite ends: two coordinates on one frequency add as fields, not as powers."""
    ends = [vector(2, lambda x: 1 - x[:, 0] / SIZE[0]), vector(2, lambda x: x[:, 0] / SIZE[0])]
    matrix = surface(ends, keep=lambda centres: centres[:, 2] > 0.999 * SIZE[2])
    area = SIZE[0] * SIZE[1]
    for phase, square in ((0.0, 1.0), (math.pi, 1 / 3), (math.pi / 2, 2 / 3)):
        found = radiated_power(matrix, np.column_stack([tones((9, 1, 0)), tones((9, 1, phase))]), STEP)
        assert found.power[9] == pytest.approx(0.5 * IMPEDANCE * square * area, rel=1e-12)


def test_levels():
    """ISO 3744: 1 W is 120 dB, nothing is minus infinity."""
    assert power_level([1.0, 1e-12]) == pytest.approx([120.0, 0.0])
    assert power_level(0.0) == -math.inf


def test_windows_keep_the_line():
    matrix = np.array([[2.0]])
    rate = tones((30, 0.5, 1.0))[:, None]
    for window in ("none", "hann", "flattop"):
        assert radiated_power(matrix, rate, STEP, window=window).power[30] == pytest.approx(
            0.5 * IMPEDANCE * 2.0 * 0.25, rel=1e-12
        )


def test_mistakes():
    for matrix, rate, options, message in (
        (np.zeros((2, 3)), np.zeros((5, 3)), {}, "square"),
        (np.eye(3), np.zeros((5, 2)), {}, "3 coordinates"),
        (np.eye(1), np.zeros((5, 1)), {"length": 6}, "longer than the signal"),
    ):
        with pytest.raises(InputError, match=message):
            radiated_power(matrix, rate, STEP, **options)
