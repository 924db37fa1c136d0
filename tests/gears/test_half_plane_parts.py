"""Parts of the half-plane law: exact flanks, logarithms, panels."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import CubicSpline

from gearfe.gears.contact.flank_compliance import cubic_spline
from gearfe.gears.contact.panels import (
    ELLIPSE_W,
    ELLIPSE_X,
    MIDDLES,
    WIDTHS,
    couplings,
    first_guess,
    influence,
    mean_log,
    unilateral,
    wedge_tensor,
)
from gearfe.gears.geometry.face import face_of
from tests.makers.half_plane_pairs import PAIRS


@pytest.mark.parametrize("name", PAIRS)
def test_curve_is_the_exact_flank(name: str) -> None:
    """Points of the table lie on the exact curve, and arc lengths are its own."""
    for one in (PAIRS[name].pinion, PAIRS[name].wheel):
        face = face_of(one)
        u = np.sort(np.random.default_rng(1).uniform(0, face.end, 200))
        exact = np.array([quad(lambda v, c=face: float(c.speeds(np.array(v))), 0, x, points=[1.0])[0] for x in u[:20]])
        s = np.interp(u, face.knots, face.arc)
        for _ in range(3):  # the table is linear in u between its knots, the points are not
            point, tangent = face.at(s)
            s = s + ((face.points(u) - point) * tangent.conj()).real
        assert np.abs(face.at(s)[0] - face.points(u)).max() < 2e-12
        assert np.abs(np.abs(face.at(s)[1]) - 1).max() < 1e-6
        assert s[:20] == pytest.approx(exact, abs=1e-11)


@pytest.mark.parametrize("count", [2, 3, 4, 5, 40])
def test_splines_are_those_of_scipy(count: int) -> None:
    """Coefficients of the splines of unit vectors, at uneven stations (m), against SciPy's."""
    at = 1e-3 * np.random.default_rng(count).uniform(0.2, 1.0, count).cumsum()
    theirs = np.moveaxis(CubicSpline(at, np.eye(count)).c[::-1], 0, -1)
    scale = np.abs(theirs).max(axis=(0, 1)) + np.ptp(at) ** -np.arange(4.0)
    assert (np.abs(cubic_spline(at) - theirs).max(axis=(0, 1)) <= 1e-12 * scale).all()


def test_a_half_plane_is_a_wedge_of_two_right_angles() -> None:
    assert wedge_tensor(math.pi / 2) == pytest.approx([0, 0], abs=1e-15)


@pytest.mark.parametrize("x", [0.0, 0.3, -0.9, 1.0, 2.5])
def test_mean_of_a_logarithm_under_an_ellipse(x: float) -> None:
    a = 1.7
    density = lambda s: 2 / (math.pi * a) * math.sqrt(1 - (s / a) ** 2)  # noqa: E731
    exact = quad(lambda s: density(s) * math.log(abs(a * x - s)), -a, a, points=[np.clip(a * x, -a, a)], limit=200)[0]
    assert mean_log(np.array(a * x), np.array(a)) == pytest.approx(exact, abs=1e-7)
    assert pytest.approx(1 / 8, rel=1e-12) == ELLIPSE_W @ ELLIPSE_X**4


def test_panels_give_hertz() -> None:
    """Parabolic gap x^2/(2 R): b^2 = 4 F R/(pi E*), p = 2 F/(pi b) (Johnson, *Contact Mechanics*, 4.2)."""
    radius, modulus, force = 0.02, 1.1e11, 2e5
    b = math.sqrt(4 * force * radius / (math.pi * modulus))
    half = np.array([1.2 * b])
    compliance = 2 / (math.pi * modulus)
    x = half[:, None] * MIDDLES
    deep = compliance * force * (0.5 - math.log(b / 2))  # approach of the centre, which makes the force F
    gap = x**2 / (2 * radius) - deep
    width = half[:, None] * WIDTHS
    one, nothing = couplings(np.zeros(1, int), np.zeros(1, int), 1), np.zeros(1)
    pressure, _, settled = unilateral(one, influence(half, compliance), nothing, width, gap, first_guess(gap))
    assert settled.all()
    assert (pressure * width).sum() == pytest.approx(force, rel=1e-3)
    inside = np.abs(x[0]) < 0.9 * b
    ellipse = 2 * force / (math.pi * b) * np.sqrt(1 - (x[0][inside] / b) ** 2)
    assert pressure[0][inside] == pytest.approx(ellipse, rel=5e-3)
    assert 2 * math.sqrt((pressure * width * x**2).sum() / force) == pytest.approx(b, rel=3e-3)


def test_panels_of_tooth_pairs_that_feel_each_others_forces() -> None:
    """Pressures of three contacts, two of them of one tooth pair, against the equations of all panels at once:
    p >= 0, g + K p >= 0, p (g + K p) = 0, with what forces do (T) in K.
    """
    draw = np.random.default_rng(3)
    couples = couplings(np.zeros(3, int), np.array([0, 0, 1]), 1)
    half, T = np.array([1e-4, 2e-4, 3e-4]), draw.uniform(0.5, 1.5, (3, 3))
    x = half[:, None] * MIDDLES + np.array([[0.0], [4e-4], [0.0]])
    width, gap = half[:, None] * WIDTHS, 30 * x**2 / half[:, None] - 2e-4 * np.arange(1, 4)[:, None]
    blocks = np.zeros((5, len(MIDDLES), len(MIDDLES)))  # couples 00 01 10 11 22
    blocks[couples.beside.own] = influence(half, 1.0)
    for couple, (i, j) in ((1, (0, 1)), (2, (1, 0))):
        blocks[couple] = -np.log(np.abs(x[i][:, None] - x[j])) * width[j]
    K = (T + T.T)[:, None, :, None] * np.broadcast_to(width, (3, len(MIDDLES), *width.shape))
    for block, i, j in zip(blocks, couples.beside.first, couples.beside.second, strict=True):
        K[i, :, j] += block
    T = (T + T.T)[couples.first, couples.second]
    p, approach, settled = unilateral(couples, blocks, T, width, gap, first_guess(gap))
    assert settled.all()
    assert approach == pytest.approx(np.einsum("ikjl,jl->ik", K, p), rel=1e-10)
    closed = p > 0
    assert 0 < closed.sum() < closed.size
    assert (p >= 0).all()
    assert np.abs((gap + approach)[closed]).max() < 1e-10 * np.abs(gap).max()
    assert (gap + approach)[~closed].min() > 0
