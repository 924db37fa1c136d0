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
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from gearfe.rigid import Element, ModalBlocks, System, consistent_start, integrate

DATA = json.loads((Path(__file__).parent / "data" / "elastic_slider_crank.json").read_text())
SI = DATA["data_SI"]
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


#: Rows of the pin, of the slider, and of the drive, by columns (phi1, x3, x0, a, p_k).
CONSTANT = np.zeros((10, 14))
CONSTANT[:2, 2:4] = np.eye(2)
CONSTANT[2, 1] = CONSTANT[9, 0] = 1.0
CONSTANT[2:4, 2:4] = CONSTANT[2:4, 12:14] = -np.eye(2)
CONSTANT[2:4, 4:6] = -L2 * np.eye(2)


@dataclass(frozen=True, eq=False)
class Frame(Element):
    """Crank pin, frame of the rod, slider, drive; coordinates phi1, x3, then those of the rod."""

    touches: tuple[Element, ...] = field()
    name: str = "frame"
    rows = 10

    def _parts(self, q):  # type: ignore[no-untyped-def]
        """a, the vector across it, p_k."""
        a, p = q[4:6], q[6:].reshape(4, 2)
        n = np.array([-a[1], a[0]])
        return a, n, p

    def residual(self, t, q):  # type: ignore[no-untyped-def]
        a, n, p = self._parts(q)
        pin = q[2:4] - L1 * np.array([np.cos(q[0]), np.sin(q[0])])
        tip = q[2:4] + L2 * a + p[3]
        slider = np.array([q[1] - tip[0], -tip[1]])
        frame = [0.5 * (a @ a - 1.0), p[0] @ a, p[1] @ a, p[2] @ n, p[3] @ n]
        return np.concatenate([pin, slider, frame, [q[0] - 150.0 * t]])

    def rate(self, t, q):  # type: ignore[no-untyped-def]
        return np.append(np.zeros(9), -150.0)

    def jacobian(self, t, q):  # type: ignore[no-untyped-def]
        a, n, p = self._parts(q)
        G = CONSTANT.copy()
        G[:2, 0] = L1 * np.sin(q[0]), -L1 * np.cos(q[0])
        G[4, 4:6] = a
        for k, along in enumerate((a, a, n, n)):
            G[5 + k, 6 + 2 * k : 8 + 2 * k] = along
            G[5 + k, 4:6] = p[k] if k < 2 else (p[k][1], -p[k][0])
        return G

    def velocity_terms(self, t, q, v):  # type: ignore[no-untyped-def]
        out = np.zeros(10)
        out[:2] = L1 * v[0] ** 2 * np.array([np.cos(q[0]), np.sin(q[0])])
        out[4:9] = self.jacobian(t, v)[4:9, 4:] @ v[4:]  # these rows are quadratic: G(v) v
        return out


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


def test_state_at_the_end_and_forces() -> None:
    mass, stiffness = np.zeros((2, 14, 14))
    mass[0, 0], mass[1, 1] = SI["J1_about_bearing"], SI["m3"]
    mass[2:, 2:], stiffness[2:, 2:] = rod_blocks()
    begin, end = DATA["start"], DATA["at_0.1_s"]
    first = state(begin["p"], begin["q"]), rates(begin["p"], begin["q"], begin["v"], begin["qd"])
    body = Sized(mass, np.zeros((14, 14)), stiffness, "crank, rod and slider", *first)
    system = System([body, Frame((body,))])
    start = consistent_start(system)
    assert np.abs(start.q - first[0]).max() < 1e-8
    run = integrate(system, [0.0, 0.1], start=start, method="explicit", tolerance=1e-8)
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
