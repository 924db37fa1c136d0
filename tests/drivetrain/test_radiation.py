"""Equivalent radiated power of bodies whose normal velocity is known."""

import math

import numpy as np
import pytest

from gearfe.drivetrain.gearbox.radiation import RadiatedPower, instantaneous_power, power_level
from gearfe.drivetrain.vibration.spectra import spectra
from gearfe.fem.bodies.meshes import Tetrahedra
from tests.makers.housing_meshes import box
from tests.makers.train_responses import COUNT, STEP, made_up, tone

IMPEDANCE = 1.2041 * 343.21
SIZE = (0.3, 0.2, 0.05)
TIME = STEP * np.arange(COUNT)


def surface(shapes, *, order=2, keep=None, cells=(3, 2, 1)):
    """Surface matrix of a box for nodal fields that are functions of the place, (n, 3) each."""
    nodes, tets = box(cells, SIZE, order=order)
    found = Tetrahedra(nodes, tets).surface([], keep)
    return found.radiation(np.column_stack([shape(nodes).ravel() for shape in shapes]))


def vector(axis, value=1.0):
    return lambda nodes: np.asarray(value(nodes) if callable(value) else value)[..., None] * np.eye(3)[axis] + 0 * nodes


def radiated(matrix, *rates) -> RadiatedPower:
    """Power of a train's housing whose coordinates have these rates."""
    v = np.column_stack(rates)
    power = spectra(made_up(modal=0 * v, modal_velocity=v, modal_acceleration=0 * v), matrix).power
    assert power is not None
    return power


def test_a_box_that_moves_to_and_fro():
    """Two faces across the motion move at v along their normals: P = rho c v^2/2 (2 A)."""
    matrix = surface([vector(0), vector(1), vector(2)])
    a, b, c = SIZE
    assert matrix == pytest.approx(np.diag([2 * b * c, 2 * a * c, 2 * a * b]), abs=1e-15)
    found = radiated(matrix, 0 * TIME, 0 * TIME, tone(TIME, 20, 0.01, 0.4))
    expected = 0.5 * IMPEDANCE * 0.01**2 * 2 * a * b
    assert found.frequency[20] == pytest.approx(20 / (200 * STEP))
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
    found = radiated(matrix, tone(TIME, 7, 0.03))
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


def test_lines_sum_to_the_mean_power():
    """Parseval, with the constant and the Nyquist line, of a motion that repeats."""
    matrix = surface([vector(0), vector(1), lambda nodes: nodes])
    rates = 0.3 + np.random.default_rng(5).standard_normal((COUNT, 3))
    rates[-1] = rates[0]
    found = radiated(matrix, *rates.T)
    direct = IMPEDANCE * np.mean([v @ matrix @ v for v in rates[:-1]])
    assert found.power.sum() == pytest.approx(direct, rel=1e-12)
    assert found.mean == pytest.approx(direct, rel=1e-12)
    assert instantaneous_power(matrix, rates)[7] == pytest.approx(IMPEDANCE * rates[7] @ matrix @ rates[7], rel=1e-12)


def test_motions_in_and_out_of_phase():
    """Rocking about y by opposite ends: two coordinates on one frequency add as fields, not as powers."""
    ends = [vector(2, lambda x: 1 - x[:, 0] / SIZE[0]), vector(2, lambda x: x[:, 0] / SIZE[0])]
    matrix = surface(ends, keep=lambda centres: centres[:, 2] > 0.999 * SIZE[2])
    area = SIZE[0] * SIZE[1]
    for phase, square in ((0.0, 1.0), (math.pi, 1 / 3), (math.pi / 2, 2 / 3)):
        found = radiated(matrix, tone(TIME, 9, 1.0), tone(TIME, 9, 1.0, phase))
        assert found.power[9] == pytest.approx(0.5 * IMPEDANCE * square * area, rel=1e-12)


def test_levels():
    """ISO 3744: 1 W is 120 dB, nothing is minus infinity."""
    assert power_level([1.0, 1e-12]) == pytest.approx([120.0, 0.0])
    assert power_level(0.0) == -math.inf
