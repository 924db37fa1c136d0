"""The elastic slider crank of the IVP test set, with its own rod, built from the core's parts in Python.

The rod of the source is a floating frame with two sine modes across and a quadratic element along the axis: a point at
s has the place x0 + s a + sum_k N_k(s) p_k with a the unit vector along the rod, p_1, p_2 = q_1, q_2 across and
p_3, p_4 = q_3, q_4 along it. Written in x0, a and p_k the mass and stiffness are constant, and what makes the vectors a
frame are constraints; the kinetic energy is the source's to the last term.

Data (tests/data/elastic_slider_crank.json): problem "crank" (Simeon) of the test set for initial value problems, with
the published state at 0.1 s, recomputed independently of this project (see the file).
"""

from __future__ import annotations

import json

import numpy as np

from gearfe.multibody import Element, ModalBlocks, QuadraticJoint, System, consistent_start, integrate, polynomial
from tests.places import DATA

PROBLEM = json.loads((DATA / "elastic_slider_crank.json").read_text())
SI = PROBLEM["data_SI"]
L1, L2, PI = SI["l1"], SI["l2"], SI["pi"]
FM = SI["rho"] * SI["b"] * SI["h"] * L2
FK = SI["E"] * SI["b"] * SI["h"] / L2


def rod_blocks() -> tuple[np.ndarray, np.ndarray]:
    """Mass and stiffness of (x0, a, p1, p2, p3, p4), two components each."""
    m, first = SI["m2"], L2 / 2.0
    mass = np.zeros((6, 6))
    mass[0, 0], mass[0, 1] = m, m * first
    mass[1, 1] = SI["J2_about_crank_pin"]
    rest, spread = np.array([2 / PI, 0.0, 2 / 3, 1 / 6]), np.array([1 / PI, -1 / (2 * PI), 1 / 3, 1 / 6])
    mass[0, 2:], mass[1, 2:] = FM * rest, FM * L2 * spread
    mass[2, 2] = mass[3, 3] = 0.5 * FM
    mass[2, 4], mass[2, 5], mass[3, 5] = FM * 16 / PI**3, -FM * (8 / PI**3 - 1 / PI), -FM / (2 * PI)
    mass[4, 4], mass[4, 5], mass[5, 5] = 8 * FM, FM, 2 * FM
    mass = mass + np.triu(mass, 1).T
    slim = (SI["h"] / L2) ** 2
    stiffness = np.zeros((6, 6))
    stiffness[2, 2], stiffness[3, 3] = FK * PI**4 / 24 * slim, FK * PI**4 * 2 / 3 * slim
    stiffness[4:, 4:] = FK * np.array([[16 / 3, -8 / 3], [-8 / 3, 7 / 3]])
    return np.kron(mass, np.eye(2)), np.kron(stiffness, np.eye(2))


def frame(rod: Element) -> QuadraticJoint:
    """Crank pin, slider, frame of the rod, drive; variables phi1, x3, x0, a, p_k, cos phi1, sin phi1."""
    linear, constant = np.zeros((10, 16)), np.zeros(10)
    linear[:2, 2:4] = np.eye(2)  # x0 = l1 (cos phi1, sin phi1)
    linear[:2, 14:] = -L1 * np.eye(2)
    linear[2, 1] = linear[9, 0] = 1.0  # (x3, 0) = x0 + l2 a + p4
    linear[2:4, 2:4] = linear[2:4, 12:14] = -np.eye(2)
    linear[2:4, 4:6] = -L2 * np.eye(2)
    products = [(4, 4, 4, 0.5), (4, 5, 5, 0.5)]  # a . a = 1
    constant[4] = -0.5
    for k in range(4):  # p_1, p_2 across, p_3, p_4 along
        across = [(5 + k, 6 + 2 * k, 4, 1.0), (5 + k, 7 + 2 * k, 5, 1.0)]
        along = [(5 + k, 7 + 2 * k, 4, 1.0), (5 + k, 6 + 2 * k, 5, -1.0)]
        products += across if k < 2 else along
    return QuadraticJoint((rod,), linear, products, constant, (0,), {9: polynomial((0.0, 150.0))}, name="frame")


def state(p, q):  # type: ignore[no-untyped-def]
    """(phi1, x3, x0, a, p_k) from the source's coordinates (phi1, phi2, x3) and q."""
    a = np.array([np.cos(p[1]), np.sin(p[1])])
    n = np.array([-a[1], a[0]])
    pin = L1 * np.array([np.cos(p[0]), np.sin(p[0])])
    return np.concatenate([[p[0], p[2]], pin, a, q[0] * n, q[1] * n, q[2] * a, q[3] * a])


def rates(p, q, v, qd):  # type: ignore[no-untyped-def]
    """Derivative of `state` along the velocities."""
    a = np.array([np.cos(p[1]), np.sin(p[1])])
    n, w = np.array([-a[1], a[0]]), v[1]
    pin = L1 * v[0] * np.array([-np.sin(p[0]), np.cos(p[0])])
    across = [qd[k] * n - q[k] * w * a for k in (0, 1)]
    along = [qd[k] * a + q[k] * w * n for k in (2, 3)]
    return np.concatenate([[v[0], v[2]], pin, w * n, *across, *along])


class Sized(ModalBlocks):
    """The blocks with sizes of their coordinates, so that the tolerance holds for elastic ones, too."""

    def units(self):  # type: ignore[no-untyped-def]
        return np.array([1.0, 1.0, *4 * [1.0], *4 * [1e-4], *4 * [1e-5]]), np.ones(0)


def crank() -> tuple[System, Element, QuadraticJoint, np.ndarray]:
    """The system, its parts, and the source's start."""
    mass, stiffness = np.zeros((2, 14, 14))
    mass[0, 0], mass[1, 1] = SI["J1_about_bearing"], SI["m3"]
    mass[2:, 2:], stiffness[2:, 2:] = rod_blocks()
    begin = PROBLEM["start"]
    first = state(begin["p"], begin["q"]), rates(begin["p"], begin["q"], begin["v"], begin["qd"])
    body = Sized(mass, np.zeros((14, 14)), stiffness, "crank, rod and slider", *first)
    joint = frame(body)
    return System([body, joint]), body, joint, first[0]


def test_state_at_the_end_and_forces() -> None:
    system, _, _, first = crank()
    end = PROBLEM["at_0.1_s"]
    start = consistent_start(system)
    assert np.abs(start.q - first).max() < 1e-8
    run = integrate(system, [0.0, 0.1], start=start, method="taylor", tolerance=1e-8)
    q = run.q[-1]
    a, p = q[4:6], q[6:].reshape(4, 2)
    n = np.array([-a[1], a[0]])
    found = [q[0], np.arctan2(a[1], a[0]), q[1]]
    np.testing.assert_allclose(found, end["p"], atol=1e-9)
    elastic = [p[0] @ n, p[1] @ n, p[2] @ a, p[3] @ a]
    np.testing.assert_allclose(elastic, end["q"], atol=1e-12)
    # forces of the source: on the slider across and along the guide, and the moment of the drive
    x, y, drive = (run.multipliers[-1][k] for k in (2, 3, 9))
    np.testing.assert_allclose(np.abs([y, x, drive]), np.abs(end["lambda"]), rtol=1e-6)


def test_derivatives_of_quadratic_rows_are_those_of_their_values() -> None:
    """By central differences, which are exact for the quadratic part; G' v and d(G^T lambda)/dq from G."""
    _, _, joint, _ = crank()
    rng = np.random.default_rng(1)
    q, v, multipliers, h = rng.standard_normal(14), rng.standard_normal(14), rng.standard_normal(10), 1e-5

    def slope(f, along):  # type: ignore[no-untyped-def]
        return (f(q + h * along) - f(q - h * along)) / (2 * h)

    units = np.eye(14)
    G = np.column_stack([slope(lambda x: joint.residual(0.3, x), e) for e in units])
    np.testing.assert_allclose(joint.jacobian(0.3, q), G, atol=1e-9)
    np.testing.assert_allclose(
        joint.velocity_terms(0.3, q, v), slope(lambda x: joint.jacobian(0.3, x), v) @ v, atol=1e-9
    )
    bend = np.column_stack([slope(lambda x: joint.jacobian(0.3, x).T @ multipliers, e) for e in units])
    np.testing.assert_allclose(joint.curvature(q, multipliers), bend, atol=1e-9)
    assert joint.rate(0.3, q)[9] == -150.0
