"""Singular positions: random starts stay on their branch; redundant constraints are told from passing ones."""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gearfe.base.errors import InputError
from gearfe.multibody import (
    Body,
    Forced,
    Gravity,
    Hinge,
    Linkage,
    Prescribed,
    Start,
    Status,
    System,
    consistent_start,
    integrate,
    polynomial,
)
from gearfe.multibody.core.system import least_norm_solution
from tests.makers.rigid_cases import G, folding_angle, folding_links, total_energy


def random_starts(count: int, seed: int = 11) -> list[tuple[float, float]]:
    """Starts that pass the change point with at least 0.5 rad/s."""
    random = np.random.default_rng(seed)
    found: list[tuple[float, float]] = []
    while len(found) < count:
        theta, omega = random.uniform(0, 2 * pi), random.uniform(-6, 6)
        energy = (1 / 3 + sin(theta) ** 2) * omega**2 + G * sin(theta)
        if (energy - G) / (4 / 3) > 0.25:
            found.append((theta, omega))
    return found


@pytest.mark.parametrize(("theta", "omega"), random_starts(6))
def test_random_starts(theta, omega):
    times = np.linspace(0.0, 4.0, 81)
    made = integrate(folding_links(theta, omega), times, tolerance=1e-9)
    assert made.status == 0
    assert np.abs(made.q[:, 2] - folding_angle(theta, omega, times)).max() <= 1e-8
    assert np.abs(made.q[:, 2] + made.q[:, 5]).max() <= 1e-9


@pytest.mark.parametrize("tolerance", [1e-4, 1e-7, 1e-13])
def test_no_wrong_branch_at_any_tolerance(tolerance):
    for theta, omega in random_starts(3, seed=5):
        made = integrate(folding_links(theta, omega), [0.0, 3.0], tolerance=tolerance)
        assert made.status == 0
        assert abs(made.q[-1, 2] + made.q[-1, 5]) <= 10 * tolerance


@pytest.mark.parametrize("distance", [0.0, 1e-12, 1e-8, -1e-6, 1e-4, -1e-3, 1e-2])
@pytest.mark.parametrize("side", [1, -1])
def test_starts_on_and_beside_the_fold(distance, side):
    theta, omega = side * pi / 2 + distance, 2.0
    times = np.linspace(0.0, 2.0, 21)
    made = integrate(folding_links(theta, omega), times, tolerance=1e-9)
    assert made.status == 0
    assert np.abs(made.q[:, 2] - folding_angle(theta, omega, times)).max() <= 1e-8


def test_near_miss_is_no_fold():
    """A rod 0.1 % longer than the crank: no change point, the rod swings through; energy and loop hold."""
    times = np.linspace(0.0, 1.5, 31)
    made = integrate(folding_links(pi / 4, 3.0, rod=1.001), times, tolerance=1e-10)
    assert made.status == 0
    assert len(made.statistics["change_points"]) == 0
    assert np.ptp(total_energy(made)) <= 1e-8
    assert np.abs(np.sin(made.q[:, 2]) + 1.001 * np.sin(made.q[:, 5])).max() <= 1e-10


def parallel_cranks(count: int, angle: float = 0.4, rate: float = 3.0) -> System:
    """A coupler on `count` equal parallel cranks: every crank after the second adds one redundant constraint."""
    bodies = [Body(f"c{i}", 1.0, 1 / 12, (0.5, 0.0), (float(i), 0.0), angle, (0.0, 0.0), rate) for i in range(count)]
    speed = (-sin(angle) * rate, cos(angle) * rate)
    bodies.append(Body("coupler", 2.0, 0.5, (1.0, 0.0), (cos(angle), sin(angle)), 0.0, speed, 0.0))
    joints = [Hinge(f"c{i}", "ground", (0.0, 0.0), (float(i), 0.0)) for i in range(count)]
    joints += [Hinge(f"c{i}", "coupler", (1.0, 0.0), (float(i), 0.0)) for i in range(count)]
    return System([Linkage(tuple(bodies), tuple(joints), (Gravity((0.0, -G)),))])


def test_redundant_constraint_is_found_and_harmless():
    """Three parallel cranks: one redundant row, and the exact motion (3 m l^2/3 + M l^2) a = -(3 m/2 + M) g l cos."""
    system = parallel_cranks(3)
    start = consistent_start(system)
    assert len(start.freedoms.redundant) == 1
    assert start.freedoms.passing == ()
    assert start.freedoms.net == 1
    times = np.linspace(0.0, 1.0, 11)
    made = integrate(system, times, tolerance=1e-10, start=start)
    exact = solve_ivp(
        lambda _t, y: [y[1], -(1.5 + 2.0) * G * np.cos(y[0]) / (1.0 + 2.0)],
        (0.0, 1.0), [0.4, 3.0], "DOP853", t_eval=times, rtol=1e-13, atol=1e-13,
    )  # fmt: skip
    assert np.abs(made.q[:, 2] - exact.y[0]).max() <= 1e-9


def test_passing_singularity_at_the_start_is_not_called_redundant():
    start = consistent_start(folding_links(pi / 2, 2.0))
    assert start.freedoms.redundant == ()
    assert len(start.freedoms.passing) == 1
    assert start.freedoms.net == 1


def test_two_folds_at_the_same_moment():
    """Two uncoupled linkages in one linkage that pass change points together."""
    one = folding_links(1.0, 3.0).elements[0]
    rename = {"crank": "crank2", "rod": "rod2"}
    from dataclasses import replace

    bodies = one.bodies + tuple(replace(b, name=rename[b.name]) for b in one.bodies)
    joints = one.joints
    for joint in one.joints:
        keys = {k: rename[getattr(joint, k)] for k in ("a", "b", "body") if getattr(joint, k, "") in rename}
        joints += (replace(joint, **keys),)
    system = System([Linkage(bodies, joints, one.forces)])
    times = np.linspace(0.0, 2.0, 21)
    made = integrate(system, times, tolerance=1e-9)
    assert made.status == 0
    exact = folding_angle(1.0, 3.0, times)
    assert np.abs(made.q[:, [2, 8]] - exact[:, None]).max() <= 1e-8


def test_start_at_rest_on_the_fold_selects_no_branch():
    """The status says so, and the start is returned."""
    made = integrate(folding_links(pi / 2, 0.0), [0.0, 1.0], raise_on_failure=False)
    assert made.status is Status.NO_BRANCH
    assert made.reached == 0.0
    assert made.q.shape == (1, 6)
    assert made.q[0, 2] == pytest.approx(pi / 2)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-9, 1e-11, 1e-12])
@pytest.mark.parametrize("count", [2, 3, 5])
def test_parallel_cranks_turn_through_their_folds(count, tolerance):
    """(count m/3 + M) l a = -(count m/2 + M) g cos; the coupler keeps its angle, also past the flat positions."""
    random = np.random.default_rng(3)
    times = np.linspace(0.0, 3.0, 31)
    for _ in range(2):
        angle, rate = random.uniform(0, 2 * pi), random.choice([-1, 1]) * random.uniform(7, 9)
        made = integrate(parallel_cranks(count, angle, rate), times, tolerance=tolerance)
        pull = (count / 2 + 2.0) * G / (count / 3 + 2.0)
        exact = solve_ivp(
            lambda _t, y, pull=pull: [y[1], -pull * cos(y[0])],
            (0.0, 3.0), [angle, rate], "DOP853", t_eval=times, rtol=1e-13, atol=1e-13,
        ).y[0]  # fmt: skip
        assert made.status == 0
        flat = np.abs(np.diff(np.floor(exact / pi))).sum()
        assert len(made.statistics["change_points"]) == flat > 0
        assert np.abs(made.q[:, 3 * count + 2]).max() <= max(10 * tolerance, 1e-10)
        assert np.abs(made.q[:, 2] - exact).max() <= max(100 * tolerance, 1e-9)


class FourBar:
    """Crank a, coupler b, rocker c, ground d with a + d = b + c: flat when the crank points away, theta = pi.

    With L the distance of the hinges A and D, (b + c)^2 - L^2 = 4 a d cos^2(theta/2): the height of B over AD changes
    its sign with cos(theta/2) on a branch that passes the flat position smoothly.
    """

    masses = (1.0, 1.3, 0.8)

    def __init__(self, a: float, b: float, c: float, d: float) -> None:
        self.sides = a, b, c, d

    def points(self, theta):  # type: ignore[no-untyped-def]
        """A and B, also for complex theta."""
        a, b, c, d = self.sides
        A = np.array([a * np.cos(theta), a * np.sin(theta)])
        to = np.array([d - A[0], -A[1]])
        square = to[0] ** 2 + to[1] ** 2
        length = np.sqrt(square)
        along = (square + b * b - c * c) / (2 * length)
        other = np.sqrt(square - (b - c) ** 2)
        if d - a == abs(b - c):  # flat at theta = 0 as well: square - (b - c)^2 = 4 a d sin^2(theta/2)
            other = 2 * np.sqrt(a * d) * np.sin(theta / 2)
        height = np.sqrt(a * d) * np.cos(theta / 2) * other / length
        return A, A + (along * to + height * np.array([-to[1], to[0]])) / length

    def inertia_and_height(self, theta: float) -> tuple[float, float]:
        """I of the kinetic energy I theta'^2 / 2, and the sum of m y."""
        D = np.array([self.sides[3], 0.0])
        A, B = self.points(theta + 1e-30j)
        inertia, height = 0.0, 0.0
        for mass, p, q in zip(self.masses, (0 * A, A, D + 0 * A), (A, B, B), strict=True):
            middle, along = (p + q) / 2, q - p
            inertia += mass * (middle.imag @ middle.imag + along.imag @ along.imag / 12) * 1e60
            height += mass * middle[1].real
        return inertia, height

    def start(self, theta: float, rate: float) -> tuple[System, Start]:
        """Three uniform rods, hinged."""
        a, b, c, d = self.sides
        A, B = self.points(theta)
        angles = theta, np.arctan2(B[1] - A[1], B[0] - A[0]), np.arctan2(B[1], B[0] - d)
        rods = zip("abc", self.masses, (a, b, c), angles, ((0.0, 0.0), tuple(A), (d, 0.0)), strict=True)
        bodies = tuple(Body(n, m, m * r * r / 12, (r / 2, 0.0), place, angle) for n, m, r, angle, place in rods)
        joints = (Hinge("a", "ground"), Hinge("b", "a", (0.0, 0.0), (a, 0.0)),
                  Hinge("c", "ground", (0.0, 0.0), (d, 0.0)), Hinge("b", "c", (b, 0.0), (c, 0.0)))  # fmt: skip
        system = System([Linkage(bodies, joints, (Gravity((0.0, -G)),))])
        turn = Forced("rate", rate, lambda _q: 0.0, lambda _q: np.eye(9)[2])
        return system, consistent_start(system, velocities=[turn])


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-9, 1e-11, 1e-12])
@pytest.mark.parametrize("sides", [(1.0, 2.0, 2.0, 3.0), (1.0, 1.7, 2.3, 3.0), (1.0, 3.0, 1.0, 3.0)])
def test_four_bars_pass_their_flat_position(sides, tolerance):
    """Random starts that turn over: theta' = sqrt(2 (E - V) / I) of the closed-form branch, by scipy."""
    bar = FourBar(*sides)
    highest = max(bar.inertia_and_height(x)[1] for x in np.linspace(0, 4 * pi, 400))
    random = np.random.default_rng(1)
    times = np.linspace(0.0, 2.0, 21)
    for _ in range(2):
        theta, sign = random.uniform(0.3, 2.8), random.choice([-1, 1])
        inertia, height = bar.inertia_and_height(theta)
        energy = G * highest + random.uniform(10, 30)
        system, start = bar.start(theta, sign * np.sqrt(2 * (energy - G * height) / inertia))

        def rate(_t, y, sign=sign, energy=energy):  # type: ignore[no-untyped-def]
            inertia, height = bar.inertia_and_height(y[0])
            return [sign * np.sqrt(2 * (energy - G * height) / inertia)]

        exact = solve_ivp(rate, (0.0, 2.0), [theta], "DOP853", t_eval=times, rtol=1e-13, atol=1e-13).y[0]
        made = integrate(system, times, tolerance=tolerance, start=start)
        assert made.status == 0
        turns = np.floor((exact - pi) / (2 * pi))
        assert len(made.statistics["change_points"]) >= np.ptp(turns) > 0
        coupler = np.array([B - A for A, B in map(bar.points, exact)])
        pointed = sides[1] * np.column_stack([np.cos(made.q[:, 5]), np.sin(made.q[:, 5])])
        assert np.abs(made.q[:, 2] - exact).max() <= max(100 * tolerance, 1e-9)
        assert np.abs(pointed - coupler).max() <= max(300 * tolerance, 3e-9)


def test_prescribed_motions_that_contradict_each_other_later():
    """Both hold x = 0 at the start; the second moves away by t^2 / 2: no status "done"."""
    body = Body("a", 1.0, 0.1)
    motions = (Prescribed("a", "x", polynomial((0.0,))), Prescribed("a", "x", polynomial((0.0, 0.0, 0.5))))
    system = System([Linkage((body,), motions, ())])
    try:
        made = integrate(system, [0.0, 1.0], raise_on_failure=False)
    except InputError:
        return
    assert made.status is Status.REDUNDANT_NOT_MET


@pytest.mark.parametrize("method", ["taylor", "implicit"])
def test_a_state_that_overflows_ends_the_run_with_its_status(method: str) -> None:
    """Joints that stand twice ask for least squares, which LAPACK refuses for infinite numbers: 1e150^2 overflows."""
    rod = Body("rod", 1.0, 0.1, (0.4, 0.0))
    spun = Prescribed("rod", "angle", polynomial((0.0, 0.0, 1e150)))
    system = System([Linkage((rod,), (Hinge("rod", "ground"), Hinge("rod", "ground"), spun), ())])
    options = {"method": method, "tolerance": 1e-3, "raise_on_failure": False}
    made = integrate(system, np.linspace(0.0, 10.0, 11), **options)
    assert made.status in (Status.STEP_TOO_SMALL, Status.NOT_SOLVED, Status.NOT_FINITE)
    assert np.isfinite(made.q).all()
    assert made.reached < 10.0
    assert np.isnan(least_norm_solution(np.array([[1.0, np.inf], [0.0, 1.0]]), np.ones(2), 1e-12)).all()
