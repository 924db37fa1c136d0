"""Contact patch tests: a uniform pressure through an interface whose meshes do not match, flat and curved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from gearfe.fem.plane import Material
from gearfe.gears.contact.laws import ElementLaw, Nitsche, Penalty
from gearfe.gears.contact.whole_gears.bodies import Bodies
from gearfe.gears.contact.whole_gears.newton import ContactSolution
from gearfe.gears.contact.whole_gears.problem import ContactProblem
from tests.makers.contact_problems import HARD, HEIGHTS, PRESS, PRESSURE, SOFT, contact_problem, solved, two_blocks
from tests.makers.structured import quarter_ring

Array = NDArray[np.float64]

#: Nitsche's law, unbiased and one-sided.
NITSCHE = [Nitsche(), Nitsche(sides="pinion"), Nitsche(sides="wheel")]
PRESSED = [*NITSCHE, Penalty(1e14), Penalty(1e15, sides="wheel")]
#: Gap (m) between the blocks that counts as closed before the first step.
CLOSING = 1e-6


def name_of(law: ElementLaw) -> str:
    return f"{law.name}, {law.sides}"


# ---- flat: two blocks between smooth rigid walls -------------------------------------------------------------------


def confined_modulus(material: Material) -> float:
    """lam + 2 mu: stress over strain without lateral strain."""
    lam, mu = material.lame("strain")
    return lam + 2 * mu


def patch_errors(problem: ContactProblem, solution: ContactSolution, pressure: float) -> tuple[float, float]:
    """Largest errors of the displacement and of the stress at the quadrature points, relative to the largest exact
    values, sigma_yy = -p everywhere and sigma_xx = lam/(lam + 2 mu) sigma_yy; overlap p/gamma with penalty."""
    strains = [-pressure / confined_modulus(material) for material in (SOFT, HARD)]
    y = problem.mesh.doflocs[1]
    exact = np.zeros_like(y)
    upper, lower = problem.bodies.node_of
    overlap = pressure / problem.law.parameter(1.0, np.ones(1))[0] if problem.law.name == "penalty" else 0.0
    exact[lower] = strains[1] * (y[lower] + HEIGHTS[1])
    exact[upper] = strains[1] * HEIGHTS[1] - overlap + strains[0] * y[upper]
    u = solution.u[problem.unknowns]
    displacement = max(np.abs(u[:, 0]).max(), np.abs(u[:, 1] - exact).max()) / np.abs(exact).max()
    worst = 0.0
    for material, basis in zip((SOFT, HARD), problem.bodies.bases(problem.mesh), strict=True):
        lam, mu = material.lame("strain")
        h = np.asarray(basis.interpolate(solution.u).grad)
        trace = lam * (h[0, 0] + h[1, 1])
        expected = (-pressure * lam / (lam + 2 * mu), -pressure, 0.0)
        found = (trace + 2 * mu * h[0, 0], trace + 2 * mu * h[1, 1], mu * (h[0, 1] + h[1, 0]))
        worst = max(worst, *(float(np.abs(a - b).max()) for a, b in zip(found, expected, strict=True)))
    return displacement, worst / pressure


@pytest.mark.parametrize("law", PRESSED, ids=name_of)
def test_flat_interface_is_exact_with_segments(law: ElementLaw) -> None:
    problem = two_blocks(law, "segments", load=PRESS)
    solution = solved(problem, closing=CLOSING, tolerance=1e-12)
    assert solution.status == "converged"
    assert max(patch_errors(problem, solution, PRESSURE)) < 1e-10


@pytest.mark.parametrize("law", PRESSED, ids=name_of)
def test_flat_interface_is_exact_when_the_top_is_moved(law: ElementLaw) -> None:
    """Moved by that of the pressure in series: both blocks, and the overlap of penalty."""
    compliance = sum(h / confined_modulus(m) for h, m in zip(HEIGHTS, (SOFT, HARD), strict=True))
    gamma = law.parameter(1.0, np.ones(3))[0]
    total = PRESSURE * (compliance + (1 / gamma if law.name == "penalty" else 0.0))
    problem = two_blocks(law, "segments", load={"prescribed": {(0, "top"): (None, -total)}})
    solution = solved(problem, closing=CLOSING, tolerance=1e-12)
    assert solution.status == "converged"
    assert max(patch_errors(problem, solution, PRESSURE)) < 1e-10


@pytest.mark.parametrize("law", [Penalty(1e14), *NITSCHE], ids=name_of)
def test_plain_points_fail_on_the_flat_interface(law: ElementLaw) -> None:
    """What the segments are for: with a Gauss rule on whole edges stresses are off by a per cent and more."""
    problem = two_blocks(law, "points", load=PRESS)
    solution = solved(problem, closing=CLOSING)
    assert solution.status == "converged"
    assert patch_errors(problem, solution, PRESSURE)[1] > 0.01


@pytest.mark.parametrize("law", [Penalty(1e14), Nitsche(), Nitsche(sides="wheel")], ids=name_of)
def test_flat_interface_is_exact_at_finite_strain(law: ElementLaw) -> None:
    """Confined Saint Venant-Kirchhoff blocks at 2 GPa: F = diag(1, f) with p = -(lam + 2 mu) f (f^2 - 1)/2."""
    pressure = 2e9
    problem = two_blocks(law, "segments", load={"tractions": {(0, "top"): (0.0, -pressure)}}, kinematics="finite")
    solution = solved(problem, closing=CLOSING, tolerance=1e-12)
    assert solution.status == "converged"
    stretches = []
    for material in (SOFT, HARD):
        roots = np.roots([0.5, 0.0, -0.5, pressure / confined_modulus(material)])
        stretches.append(float(max(roots[np.isreal(roots)].real)))
    y = problem.mesh.doflocs[1]
    upper, lower = problem.bodies.node_of
    overlap = pressure / problem.law.parameter(1.0, np.ones(1))[0] if law.name == "penalty" else 0.0
    exact = np.zeros_like(y)
    exact[lower] = (stretches[1] - 1) * (y[lower] + HEIGHTS[1])
    exact[upper] = (stretches[1] - 1) * HEIGHTS[1] - overlap + (stretches[0] - 1) * y[upper]
    found = solution.u[problem.unknowns]
    assert stretches[0] < 0.98  # the small-strain solution would be off by 2 % of the strain
    np.testing.assert_allclose(found[:, 1], exact, rtol=0, atol=1e-10 * np.abs(exact).max())
    np.testing.assert_allclose(solution.state.pressure, pressure, rtol=1e-10)


# ---- curved: a ring under pressure inside another, Lame's solution -------------------------------------------------

INNER, MIDDLE, OUTER = 0.5, 1.0, 1.5  # m
INSIDE = 2e8  # Pa; the interface carries about half of it


@dataclass(frozen=True)
class RingError:
    """Relative errors in the energy norm and of the pressure in the interface's L2 norm."""

    energy: float
    pressure: float


def lame_constants(material: Material, a: float, b: float, inside: float, outside: float) -> Array:
    """u_r = A r + B/r of a ring a < r < b under two pressures (Timoshenko & Goodier, sec. 28)."""
    lam, mu = material.lame("strain")
    rows = [[2 * (lam + mu), -2 * mu / r**2] for r in (a, b)]
    return np.linalg.solve(rows, [-inside, -outside])


def lame_rings() -> tuple[float, list[Array]]:
    """Pressure between the rings, and both rings' constants."""

    def misfit(q: float) -> float:
        one = lame_constants(SOFT, INNER, MIDDLE, INSIDE, q)
        two = lame_constants(HARD, MIDDLE, OUTER, q, 0.0)
        return float((one - two) @ [MIDDLE, 1 / MIDDLE])

    q = misfit(0.0) / (misfit(0.0) - misfit(1.0))  # linear in q
    return q, [lame_constants(SOFT, INNER, MIDDLE, INSIDE, q), lame_constants(HARD, MIDDLE, OUTER, q, 0.0)]


def ring_error(n: int, law: ElementLaw, quadrature: str) -> RingError:
    """Quarter rings of 2 n and 3 n cells round the interface."""
    bodies = Bodies((quarter_ring(INNER, MIDDLE, n, 2 * n, SOFT), quarter_ring(MIDDLE, OUTER, n, 3 * n, HARD)))
    symmetry = {(k, "bottom"): (None, 0.0) for k in (0, 1)} | {(k, "top"): (0.0, None) for k in (0, 1)}

    def push(axis: int) -> object:
        return lambda x: INSIDE * x[:, axis] / np.hypot(*x.T)

    problem = contact_problem(
        bodies,
        (((0, "right"), (1, "left")),),
        law,
        prescribed=symmetry,  # type: ignore[arg-type]
        tractions={(0, "left"): (push(0), push(1))},  # type: ignore[dict-item]
        quadrature=quadrature,
    )
    solution = solved(problem, closing=1e-3, tolerance=1e-9)
    assert solution.status == "converged"
    q, constants = lame_rings()
    error = total = 0.0
    for material, (_, b), (a, _), basis in zip(
        (SOFT, HARD), constants, constants, bodies.bases(bodies.mesh), strict=True
    ):
        lam, mu = material.lame("strain")
        h = np.asarray(basis.interpolate(solution.u).grad)
        x = np.asarray(basis.global_coordinates())
        r = np.hypot(*x)
        radial = np.einsum("i...,j...->ij...", x / r, x / r)
        unit = np.eye(2)[:, :, None, None]
        exact = a * unit + b / r**2 * (unit - 2 * radial)
        for strain, factor in ((0.5 * (h + h.swapaxes(0, 1)) - exact, 1), (exact, 0)):
            energy = lam * (strain[0, 0] + strain[1, 1]) ** 2 + 2 * mu * (strain**2).sum(axis=(0, 1))
            value = float((energy * basis.dx).sum())
            error, total = (error + value, total) if factor else (error, total + value)
    weight = solution.state.points.weight
    off = solution.state.pressure / q - 1
    return RingError(np.sqrt(error / total), np.sqrt(weight @ off**2 / weight.sum()))


@pytest.mark.parametrize(
    ("law", "pressure_rate"),
    [
        (Nitsche(), 2.8),
        (Nitsche(sides="pinion"), 2.8),
        # rings have no tips that would choose a side
        pytest.param(Penalty(sides="pinion"), 2.8, marks=pytest.mark.slow),
        pytest.param(Penalty(sides="wheel"), 2.8, marks=pytest.mark.slow),
    ],
    ids=lambda value: name_of(value) if hasattr(value, "name") else "",
)
def test_curved_interface_converges_at_the_rate_of_its_geometry(law: ElementLaw, pressure_rate: float) -> None:
    """Quadratic edges keep to the circle within O(h^4), which gamma of order E/h turns into pressures: O(h^3). The
    energy norm falls with h^2, as second-order triangles do without contact. Lame's field is the exact solution of the
    problem as it is solved, small strain with contact in the current configuration: everything moves radially."""
    levels = (4, 8) if law.name == "nitsche" else (8, 16)  # a stiff law needs the edges closer to the circle
    coarse, fine = (ring_error(n, law, "segments") for n in levels)
    assert np.log2(coarse.energy / fine.energy) > 1.9
    assert np.log2(coarse.pressure / fine.pressure) > pressure_rate
    assert fine.energy < 2.5e-3


def test_plain_points_do_not_converge_on_the_curved_interface() -> None:
    coarse, fine = (ring_error(n, Nitsche(), "points") for n in (4, 8))
    assert np.log2(coarse.pressure / fine.pressure) < 0.5
    assert fine.pressure > 0.02
