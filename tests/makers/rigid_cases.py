"""Mechanisms and exact solutions that the tests of the rigid core share. Nothing here comes from the core itself."""

from __future__ import annotations

from math import cos, pi, sin
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from gearfe.multibody import Body, Gravity, Hinge, Linkage, Slot, Start, System, consistent_start
from tests.places import DATA

G = 9.81


def reference(name: str) -> np.ndarray:
    """Table of tests/data (see its first line for where it is from)."""
    return np.genfromtxt(DATA / name, delimiter=",", names=True, skip_header=1)


def folding_links(theta: float = pi / 4, omega: float = 4 / (2 * sin(pi / 4)), rod: float = 1.0) -> System:
    """Crank and rod of 1 kg, the rod's end on the x axis, on the branch theta2 = -theta1 when both are 1 m long."""
    other = -theta if rod == 1.0 else -np.arcsin(sin(theta) / rod)
    rate = -cos(theta) * omega / (rod * cos(other)) if rod != 1.0 else -omega
    bodies = (
        Body("crank", 1.0, 1 / 12, (0.5, 0.0), (0.0, 0.0), theta, (0.0, 0.0), omega),
        Body("rod", 1.0, rod**2 / 12, (rod / 2, 0.0), (cos(theta), sin(theta)), other,
             (-sin(theta) * omega, cos(theta) * omega), rate),
    )  # fmt: skip
    joints = (
        Hinge("crank", "ground", name="O"),
        Hinge("crank", "rod", (1.0, 0.0), (0.0, 0.0), name="A"),
        Slot("rod", "ground", (rod, 0.0), name="B"),
    )
    return System([Linkage(bodies, joints, (Gravity((0.0, -G)),))])


def folding_angle(theta: float, omega: float, times: np.ndarray) -> np.ndarray:
    """Crank angle from (2/3 + 2 sin^2) theta'' + 2 sin cos theta'^2 + g cos = 0 (scipy, 3e-14)."""

    def rhs(_t: float, y: np.ndarray) -> list[float]:
        s, c = sin(y[0]), cos(y[0])
        return [y[1], -(2 * s * c * y[1] ** 2 + G * c) / (2 / 3 + 2 * s * s)]

    made = solve_ivp(rhs, (times[0], times[-1]), [theta, omega], "DOP853", t_eval=times, rtol=3e-14, atol=1e-14)
    return made.y[0]


def by_scipy(
    system: System, times: np.ndarray, start: Start | None = None, **options: Any
) -> tuple[np.ndarray, np.ndarray]:
    """(q, v) at the times by SciPy's Runge-Kutta of order 8 on a = M^-1 (f - G^T lambda), evaluated in NumPy.

    Independent of all integrators and kernels: only values of the elements' forces, rows and gradients enter.
    """
    begin = consistent_start(system, float(times[0])) if start is None else start
    n = system.size

    def rhs(t: float, y: np.ndarray) -> np.ndarray:
        return np.concatenate([y[n:], system.acceleration(t, y[:n], y[n:], begin.active, begin.added_mass)[0]])

    y0 = np.concatenate([begin.q, begin.v])
    options = {"rtol": 1e-12, "atol": 1e-12, **options}
    y = solve_ivp(rhs, (times[0], times[-1]), y0, "DOP853", t_eval=times, **options).y.T
    return y[:, :n], y[:, n:]


def pendulum(angle: float = 1.0, length: float = 0.8, rate: float = 0.0) -> System:
    """Uniform rod of 2 kg hinged at its end."""
    body = Body("rod", 2.0, 2.0 * length**2 / 12, (length / 2, 0.0), (0.0, 0.0), angle, (0.0, 0.0), rate)
    return System([Linkage((body,), (Hinge("rod", "ground"),), (Gravity((0.0, -G)),))])


def chain(count: int, seed: int = 1) -> System:
    """Hanging chain of uniform rods with random start angles and masses."""
    random = np.random.default_rng(seed)
    bodies, joints = [], []
    x = y = 0.0
    before, end = "ground", (0.0, 0.0)
    for i in range(count):
        length, mass, angle = random.uniform(0.3, 1.0), random.uniform(0.5, 2.0), random.uniform(-1.0, 1.0)
        bodies.append(Body(f"b{i}", mass, mass * length**2 / 12, (length / 2, 0.0), (x, y), angle))
        joints.append(Hinge(f"b{i}", before, (0.0, 0.0), end))
        before, end = f"b{i}", (length, 0.0)
        x, y = x + length * cos(angle), y + length * sin(angle)
    return System([Linkage(tuple(bodies), tuple(joints), (Gravity((0.0, -G)),))])


def total_energy(trajectory) -> np.ndarray:  # type: ignore[no-untyped-def]
    """Kinetic plus potential energy at the output times."""
    return np.sum(trajectory.system.energy(trajectory.q, trajectory.v), axis=0)


def residuals(trajectory) -> tuple[float, float]:  # type: ignore[no-untyped-def]
    """Largest residual of position and of velocity constraints."""
    system = trajectory.system
    place = [np.abs(system.residual(t, q)).max() for t, q in zip(trajectory.time, trajectory.q, strict=True)]
    rate = [
        np.abs(system.jacobian(t, q) @ v + system.rate(t, q)).max()
        for t, q, v in zip(trajectory.time, trajectory.q, trajectory.v, strict=True)
    ]
    return max(place), max(rate)


def seven_angles(q: np.ndarray) -> np.ndarray:
    """The angles of the literature from the seven absolute ones."""
    a = q[:, 2::3]
    return np.stack([a[:, 0], a[:, 1] - a[:, 0], a[:, 2], a[:, 3] - a[:, 4], a[:, 4], a[:, 5] - a[:, 6], a[:, 6]], 1)
