r"""Hertz' line contact under refinement: two elastic bodies, the upper one with the parabolic outline y = x^2/2R.

Both bodies are cut out of Hertz' problem: along the cuts they get the displacements of its exact solution, so the
finite domain costs nothing and stresses can be compared everywhere. What is left of Hertz' assumptions (bodies as
half-planes, undeformed places) is of the order a/R = 1e-5 here.

The exact solution in y < 0, with sigma_yy = -p0 sqrt(1 - x^2/a^2) and no shear on y = 0, from Westergaard's function
(Johnson, *Contact Mechanics*, 1985, sec. 4.2 for p0 and a; Sadd, *Elasticity*, sec. 10.6 for the functions):

.. math::
    Z = -\frac{p_0}{a}\left(\sqrt{a^2 - z^2} - i z\right), \quad
    \sigma_{xx} = \Re Z - y\,\Im Z', \quad \sigma_{yy} = \Re Z + y\,\Im Z', \quad \sigma_{xy} = -y\,\Re Z',

    2\mu u_x = (1 - 2\nu)\,\Re\hat Z - y\,\Im Z, \quad 2\mu u_y = 2(1 - \nu)\,\Im\hat Z - y\,\Re Z, \quad \hat Z' = Z.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from gearfe.fem.plane import Material
from gearfe.gears.contact.laws import ElementLaw, Nitsche, Penalty
from gearfe.gears.contact.whole_gears.bodies import Bodies, ElasticBody
from gearfe.gears.contact.whole_gears.problem import ContactProblem
from tests.makers.contact_problems import contact_problem, solved
from tests.makers.structured import mapped_grid

Array = NDArray[np.float64]

UPPER, LOWER = Material(110e9, 0.26), Material(200e9, 0.30)
HALF_WIDTH, RADIUS = 1.0, 1e5
MODULUS = 1 / (UPPER.contact_compliance("strain") + LOWER.contact_compliance("strain"))
#: a^2 = 4 F R/(pi E* w), p0 = E* a/2R.
PEAK = MODULUS * HALF_WIDTH / (2 * RADIUS)
#: Size of both bodies, and of the part with the fine elements; the contact ends inside an edge on every mesh.
SIZE, FINE = 3.0, 1.37


def exact(material: Material, x: Array, y: Array) -> tuple[Array, Array]:
    """Displacements (u_x, u_y) and stresses (xx, yy, xy) of the lower body at y <= 0."""
    a, nu, mu = HALF_WIDTH, material.poisson_ratio, material.shear_modulus
    y = np.minimum(y, -1e-30)  # the lower side of the cuts along y = 0
    z = x + 1j * y
    root = np.sqrt(a * a - z * z)
    f, slope = -PEAK / a * (root - 1j * z), PEAK / a * (z / root + 1j)
    integral = -PEAK / a * 0.5 * (z * root + a * a * np.arcsin(z / a) - 1j * z * z)
    u = np.stack([(1 - 2 * nu) * integral.real - y * f.imag, 2 * (1 - nu) * integral.imag - y * f.real]) / (2 * mu)
    return u, np.stack([f.real - y * slope.imag, f.real + y * slope.imag, -y * slope.real])


def hertz_problem(n: int, law: ElementLaw, quadrature: str) -> ContactProblem:
    """Right halves of both bodies; the meshes' edges along the contact are in the ratio 2 to 3."""

    def spaced(k: int, fine: float, share: int) -> Array:
        return np.concatenate([np.linspace(0, fine, share * k + 1), np.linspace(fine, SIZE, k + 1)[1:]])

    def body(k: int, side: int, material: Material) -> ElasticBody:
        columns, rows = spaced(k, FINE, 3), spaced(k, 0.25 * SIZE, 2)
        if side == 1:
            return mapped_grid(columns, -rows[::-1], lambda s, t: (s, t), material)
        return mapped_grid(columns, rows, lambda s, t: (s, t + s * s / (2 * RADIUS) * (1 - t / SIZE)), material)

    bodies = Bodies((body(2 * n, 0, UPPER), body(3 * n, 1, LOWER)))

    def field(part: int, axis: int) -> object:
        material, mirror = ((UPPER, -1.0), (LOWER, 1.0))[part]
        return lambda x: (mirror if axis == 1 else 1.0) * exact(material, x[:, 0], mirror * x[:, 1])[0][axis]

    cuts = [(0, "right"), (0, "top"), (1, "right"), (1, "bottom")]
    held = {cut: (field(cut[0], 0), field(cut[0], 1)) for cut in cuts}
    return contact_problem(
        bodies,
        (((0, "bottom"), (1, "top")),),
        law,
        prescribed={(0, "left"): (0.0, None), (1, "left"): (0.0, None)} | held,  # type: ignore[arg-type]
        quadrature=quadrature,
    )


@dataclass(frozen=True)
class HertzError:
    """Relative errors: energy norm, largest pressure, half width a = 2 sqrt(int p x^2 / int p), last loaded point."""

    energy: float
    peak: float
    width: float
    outermost: float


@cache
def hertz_error(n: int, law: ElementLaw, quadrature: str) -> HertzError:
    problem = hertz_problem(n, law, quadrature)
    solution = solved(problem, closing=0.5 * HALF_WIDTH**2 / (2 * RADIUS), tolerance=1e-9)
    assert solution.status == "converged"
    error = total = 0.0
    for part, basis in enumerate(problem.bodies.bases(problem.mesh)):
        material = problem.bodies.parts[part].material
        lam, mu = material.lame("strain")
        h = np.asarray(basis.interpolate(solution.u).grad)
        x, y = np.asarray(basis.global_coordinates())
        trace = lam * (h[0, 0] + h[1, 1])
        found = np.stack([trace + 2 * mu * h[0, 0], trace + 2 * mu * h[1, 1], mu * (h[0, 1] + h[1, 0])])
        mirror = (-1.0, 1.0)[part]
        _, expected = exact(material, x, mirror * y)
        expected[2] *= mirror
        error += float((_energy(material, found - expected) * basis.dx).sum())
        total += float((_energy(material, expected) * basis.dx).sum())
    state = solution.state
    place = np.asarray(state.slave.global_coordinates())[0, :, 0]
    load = state.points.weight * state.pressure
    width = 2 * np.sqrt((load @ place**2) / load.sum())
    return HertzError(
        energy=np.sqrt(error / total),
        peak=abs(state.pressure.max() / PEAK - 1),
        width=abs(width / HALF_WIDTH - 1),
        outermost=abs(place[state.pressure > 0].max() / HALF_WIDTH - 1),
    )


def _energy(material: Material, s: Array) -> Array:
    """sigma : C^-1 : sigma in plane strain."""
    nu = material.poisson_ratio
    return ((1 - nu) * (s[0] ** 2 + s[1] ** 2) - 2 * nu * s[0] * s[1] + 2 * s[2] ** 2) / (2 * material.shear_modulus)


def test_the_exact_solution_is_one() -> None:
    """Its stresses are those of its displacements, in equilibrium, and its pressure carries the load of Hertz."""
    x, y, step = np.array([0.3, 0.9, 1.6]), np.array([-0.2, -0.5, -0.9]), 1e-5
    lam, mu = LOWER.lame("strain")

    def slopes(k: int) -> tuple[Array, Array]:
        dx = (exact(LOWER, x + step, y)[k] - exact(LOWER, x - step, y)[k]) / (2 * step)
        return dx, (exact(LOWER, x, y + step)[k] - exact(LOWER, x, y - step)[k]) / (2 * step)

    of_x, of_y = slopes(0)
    trace = lam * (of_x[0] + of_y[1])
    made = np.stack([trace + 2 * mu * of_x[0], trace + 2 * mu * of_y[1], mu * (of_x[1] + of_y[0])])
    np.testing.assert_allclose(made, exact(LOWER, x, y)[1], atol=1e-7 * PEAK)
    stress_x, stress_y = slopes(1)
    np.testing.assert_allclose(stress_x[0] + stress_y[2], 0, atol=1e-7 * PEAK)
    np.testing.assert_allclose(stress_x[2] + stress_y[1], 0, atol=1e-7 * PEAK)
    surface = np.array([0.0, 0.5, 0.99, 1.5])
    pressure = -exact(LOWER, surface, np.zeros(4))[1][1]
    np.testing.assert_allclose(pressure, PEAK * np.sqrt(np.maximum(0, 1 - surface**2)), atol=1e-7 * PEAK)


def scaled_penalty(n: int) -> Penalty:
    """Parameter of order E/h^2: its overlap then falls with h^2. With E/h peak pressure and width have rate 1 only, a
    fixed parameter stops at a plateau."""
    return Penalty(30 * UPPER.youngs_modulus * n**2 / HALF_WIDTH)


@pytest.mark.parametrize(("law", "levels"), [(Nitsche(), (1, 2)), (None, (1, 2))], ids=["nitsche", "penalty"])
def test_rates_under_refinement(law: ElementLaw | None, levels: tuple[int, ...]) -> None:
    rates, beyond = refined(law, levels)
    assert (rates > LEAST_RATES).all()
    assert (beyond < 0).all()


FINER = [Nitsche(), Nitsche(sides="pinion"), None]


@pytest.mark.slow
@pytest.mark.parametrize("law", FINER, ids=lambda law: "penalty" if law is None else law.sides)
def test_rates_under_more_refinement(law: ElementLaw | None) -> None:
    rates, beyond = refined(law, (1, 2, 4))
    assert (rates > LEAST_RATES).all()
    assert (beyond < 0).all()


#: Energy norm 1.5 (the pressure ends like a square root, so u is in H^(5/2)), peak pressure and half width 1.
LEAST_RATES = np.array([1.5, 1.0, 1.0])


def refined(law: ElementLaw | None, levels: tuple[int, ...]) -> tuple[Array, Array]:
    """Rates of energy norm, peak pressure and half width; how far contact ends beyond one edge of the coarser side."""
    errors = [hertz_error(n, law or scaled_penalty(n), "segments") for n in levels]
    span = np.log2(levels[-1] / levels[0])
    ends = [(getattr(errors[0], name), getattr(errors[-1], name)) for name in ("energy", "peak", "width")]
    rates = np.array([np.log2(first / last) / span for first, last in ends])
    return rates, np.array([error.outermost - FINE / (6 * n) for n, error in zip(levels, errors, strict=True)])


def test_plain_points_keep_an_error_of_the_pressure() -> None:
    """Where the edges of the two bodies do not match, the peak pressure stays some 6 % off (energy norm: rate 1)."""
    errors = [hertz_error(n, Nitsche(), "points") for n in (1, 2)]
    assert errors[1].peak > 0.9 * errors[0].peak
    assert errors[1].peak > 0.02
