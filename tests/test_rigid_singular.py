"""Singular positions: random starts stay on their branch; redundant constraints are told from passing ones."""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
import pytest

from gearfe.rigid import Body, Gravity, Hinge, PlanarScene, Scene, System, consistent_start, integrate

from .rigid_cases import G, folding_angle, folding_links, total_energy


def random_starts(count: int, seed: int = 11) -> list[tuple[float, float]]:
    """Starts that pass the fold with at least 0.5 rad/s."""
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
    made = integrate(folding_links(theta, omega), times, tolerance=1e-9, backend="plain")
    assert made.status == 0
    assert np.abs(made.q[:, 2] - folding_angle(theta, omega, times)).max() <= 1e-8
    assert np.abs(made.q[:, 2] + made.q[:, 5]).max() <= 1e-9


@pytest.mark.parametrize("tolerance", [1e-4, 1e-7, 1e-13])
def test_no_wrong_branch_at_any_tolerance(tolerance):
    for theta, omega in random_starts(3, seed=5):
        made = integrate(folding_links(theta, omega), [0.0, 3.0], tolerance=tolerance, backend="plain")
        assert made.status == 0
        assert abs(made.q[-1, 2] + made.q[-1, 5]) <= 10 * tolerance


@pytest.mark.parametrize("distance", [0.0, 1e-12, 1e-8, -1e-6, 1e-4, -1e-3, 1e-2])
@pytest.mark.parametrize("side", [1, -1])
def test_starts_on_and_beside_the_fold(distance, side):
    theta, omega = side * pi / 2 + distance, 2.0
    times = np.linspace(0.0, 2.0, 21)
    made = integrate(folding_links(theta, omega), times, tolerance=1e-9, backend="plain")
    assert made.status == 0
    assert np.abs(made.q[:, 2] - folding_angle(theta, omega, times)).max() <= 1e-8


def test_near_miss_is_no_fold():
    """A rod 0.1 % longer than the crank: no fold, the rod swings through; energy holds and the loop stays closed."""
    made = integrate(folding_links(pi / 4, 3.0, rod=1.001), np.linspace(0.0, 1.5, 31), tolerance=1e-10, backend="plain")
    assert made.status == 0
    assert len(made.statistics["singular_passages"]) == 0
    assert np.ptp(total_energy(made)) <= 1e-8
    assert np.abs(np.sin(made.q[:, 2]) + 1.001 * np.sin(made.q[:, 5])).max() <= 1e-10


def parallel_cranks(count: int, angle: float = 0.4, rate: float = 3.0) -> System:
    """A coupler on `count` equal parallel cranks: every crank after the second adds one redundant constraint."""
    bodies = [Body(f"c{i}", 1.0, 1 / 12, (0.5, 0.0), (float(i), 0.0), angle, (0.0, 0.0), rate) for i in range(count)]
    speed = (-sin(angle) * rate, cos(angle) * rate)
    bodies.append(Body("coupler", 2.0, 0.5, (1.0, 0.0), (cos(angle), sin(angle)), 0.0, speed, 0.0))
    joints = [Hinge(f"c{i}", "ground", (0.0, 0.0), (float(i), 0.0)) for i in range(count)]
    joints += [Hinge(f"c{i}", "coupler", (1.0, 0.0), (float(i), 0.0)) for i in range(count)]
    return System([PlanarScene(Scene(tuple(bodies), tuple(joints), (Gravity((0.0, -G)),)))])


def test_redundant_constraint_is_found_and_harmless():
    """Three parallel cranks: one redundant row, and the exact motion (3 m l^2/3 + M l^2) a = -(3 m/2 + M) g l cos."""
    system = parallel_cranks(3)
    start = consistent_start(system)
    assert len(start.freedoms.redundant) == 1
    assert start.freedoms.passing == ()
    assert start.freedoms.net == 1
    times = np.linspace(0.0, 1.0, 11)
    made = integrate(system, times, tolerance=1e-10, start=start, backend="plain")
    from scipy.integrate import solve_ivp

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
    """Two uncoupled linkages in one scene that fold together."""
    one = folding_links(1.0, 3.0).planar.scene
    rename = {"crank": "crank2", "rod": "rod2"}
    from dataclasses import replace

    bodies = one.bodies + tuple(replace(b, name=rename[b.name]) for b in one.bodies)
    joints = one.joints
    for joint in one.joints:
        keys = {k: rename[getattr(joint, k)] for k in ("a", "b", "body") if getattr(joint, k, "") in rename}
        joints += (replace(joint, **keys),)
    system = System([PlanarScene(Scene(bodies, joints, one.forces))])
    times = np.linspace(0.0, 2.0, 21)
    made = integrate(system, times, tolerance=1e-9, backend="plain")
    assert made.status == 0
    exact = folding_angle(1.0, 3.0, times)
    assert np.abs(made.q[:, [2, 8]] - exact[:, None]).max() <= 1e-8
