"""Positions where several rows become singular at once: on the true branch, with every passage counted.

The N-four-bar is benchmark A02 of the multibody benchmark library (lim.ii.udc.es/mbsbenchmark): N + 1 bars of 1 m and
1 kg on the ground, N couplers of the same kind, gravity; the bars stand upright and the couplers start with 1 m/s. All
loops move alike, so the motion is that of one parallelogram: ((N+1)/3 + N) theta'' = -((N+1)/2 + N) g cos(theta).
"""

from __future__ import annotations

from dataclasses import replace
from math import acos, atan2, cos, hypot, pi, sin

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gearfe.multibody import Body, Forced, Gravity, Hinge, Linkage, Start, System, consistent_start, integrate
from tests.makers.rigid_cases import G, folding_angle, folding_links, total_energy


def n_four_bar(count: int) -> System:
    """Bars 0 to count, then the couplers."""
    bars = [Body(f"b{i}", 1.0, 1 / 12, (0.5, 0.0), (float(i), 0.0), pi / 2, (0.0, 0.0), -1.0) for i in range(count + 1)]
    couplers = [Body(f"c{i}", 1.0, 1 / 12, (0.5, 0.0), (float(i), 1.0), 0.0, (1.0, 0.0)) for i in range(count)]
    joints = [Hinge(f"b{i}", "ground", (0.0, 0.0), (float(i), 0.0)) for i in range(count + 1)]
    for i in range(count):
        joints += [Hinge(f"c{i}", f"b{i + k}", (float(k), 0.0), (1.0, 0.0)) for k in range(2)]
    return System([Linkage((*bars, *couplers), tuple(joints), (Gravity((0.0, -G)),))])


def n_four_bar_angle(count: int, times: np.ndarray) -> np.ndarray:
    """Angle of the bars, from one parallelogram."""
    pull = ((count + 1) / 2 + count) * G / ((count + 1) / 3 + count)
    made = solve_ivp(
        lambda _t, y: [y[1], -pull * cos(y[0])], (times[0], times[-1]), [pi / 2, -1.0], "DOP853", t_eval=times,
        rtol=1e-13, atol=1e-13,
    )  # fmt: skip
    return made.y[0]


def crossings(angle: np.ndarray) -> int:
    """How often the angle passes a multiple of pi."""
    return int(np.abs(np.diff(np.floor(angle / pi))).sum())


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_n_four_bar(count, tolerance):
    check_n_four_bar(count, tolerance, 3.0)


@pytest.mark.slow
@pytest.mark.parametrize("count", range(1, 41))
def test_n_four_bar_over_20_seconds(count):
    for tolerance in (1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13):
        check_n_four_bar(count, tolerance, 20.0)


def check_n_four_bar(count: int, tolerance: float, end: float) -> None:
    times = np.linspace(0.0, end, 1001)
    made = integrate(n_four_bar(count), times, tolerance=tolerance, method="taylor")
    exact = n_four_bar_angle(count, times)
    assert made.message == "done"
    assert len(made.statistics["change_points"]) == crossings(exact) > 0
    assert np.abs(made.q[:, 2 : 3 * (count + 1) : 3] - exact[:, None]).max() <= max(30 * tolerance, 1e-9)
    assert np.abs(made.q[:, 3 * (count + 1) + 2 :: 3]).max() <= 1e-10


def peaucellier(phi: float, rate: float) -> tuple[System, Start]:
    """Arms of 2 m, rhombus of 0.8 m, crank of 1 m about a point 1 m away: its point Q on a circle through O."""
    arm, side, crank = 2.0, 0.8, 1.0
    Q = np.array([crank + crank * cos(phi), crank * sin(phi)])
    reach = hypot(*Q)
    half, turn = acos((arm**2 + reach**2 - side**2) / (2 * arm * reach)), atan2(Q[1], Q[0])
    A, B = (arm * np.array([cos(turn + s * half), sin(turn + s * half)]) for s in (1, -1))
    points = {"O": np.zeros(2), "A": A, "B": B, "P": A + B - Q, "Q": Q, "C": np.array([crank, 0.0])}
    bars = [(a + b, points[a], points[b] - points[a]) for a, b in ("OA", "OB", "AP", "BP", "AQ", "BQ", "CQ")]
    bodies = tuple(
        Body(name, hypot(*v), hypot(*v) ** 3 / 12, (hypot(*v) / 2, 0.0), tuple(at), atan2(v[1], v[0]))
        for name, at, v in bars
    )
    length = {name: hypot(*v) for name, _, v in bars}

    def hinge(one: str, other: str, point: str) -> Hinge:
        ends = [(0.0 if bar[0] == point else length[bar], 0.0) for bar in (one, other) if bar != "ground"]
        return Hinge(one, other, ends[0], tuple(points[point]) if other == "ground" else ends[1])

    pairs = ("OA ground O", "OB ground O", "CQ ground C", "AP OA A", "AQ OA A", "BP OB B", "BQ OB B", "AP BP P",
             "AQ CQ Q", "BQ CQ Q")  # fmt: skip
    joints = tuple(hinge(*pair.split()) for pair in pairs)
    system = System([Linkage(bodies, joints, (Gravity((0.0, -G)),))])
    turn_crank = Forced("rate", rate, lambda _q: 0.0, lambda _q: np.eye(21)[20])
    return system, consistent_start(system, velocities=[turn_crank])


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9, 1e-12])
def test_peaucellier_straight_line(tolerance):
    """P draws a line; both loops of the rhombus have a change point where A and B, or P and Q, fall together."""
    system, start = peaucellier(0.3, 3.0)
    made = integrate(system, np.linspace(0.0, 5.0, 5001), tolerance=tolerance, start=start)
    assert made.message == "done"
    angle = made.q[:, 2::3]
    P = 2.0 * np.cos(angle[:, 0]) + 0.8 * np.cos(angle[:, 2])
    assert np.abs(P - (2.0**2 - 0.8**2) / 2.0).max() <= max(30 * tolerance, 1e-10)  # (OA^2 - AQ^2) / diameter
    together = crossings((angle[:, 0] - angle[:, 1]) / 2) + crossings((angle[:, 2] - angle[:, 4]) / 2)
    assert len(made.statistics["change_points"]) == together > 5
    assert np.ptp(total_energy(made)) <= max(300 * tolerance, 1e-9)


def two_linkages(apart: float) -> System:
    """Two uncoupled linkages with change points in one linkage, the second one `apart` (rad) ahead."""
    one, other = (folding_links(angle, 3.0).elements[0] for angle in (1.0, 1.0 + apart))
    name = {"crank": "crank2", "rod": "rod2"}
    bodies = one.bodies + tuple(replace(b, name=name[b.name]) for b in other.bodies)
    joints = one.joints
    for joint in other.joints:
        keys = {k: name[getattr(joint, k)] for k in ("a", "b", "body") if getattr(joint, k, "") in name}
        joints += (replace(joint, **keys),)
    return System([Linkage(bodies, joints, one.forces)])


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9])
@pytest.mark.parametrize("apart", [0.1, 0.0159, 1e-3, 1e-4])
def test_folds_soon_after_one_another(apart, tolerance):
    times = np.linspace(0.0, 2.0, 21)
    made = integrate(two_linkages(apart), times, tolerance=tolerance)
    exact = np.column_stack([folding_angle(a, 3.0, times) for a in (1.0, 1.0 + apart)])
    fine = np.linspace(0.0, 2.0, 2001)
    expected = sum(crossings(folding_angle(a, 3.0, fine) - pi / 2) for a in (1.0, 1.0 + apart))
    assert made.message == "done"
    assert np.abs(made.q[:, [2, 8]] - exact).max() <= 3 * tolerance
    assert len(made.statistics["change_points"]) == expected
