"""A gear pair with one degree of freedom and backlash, integrated by itself: Runge-Kutta of order 4, touches located.

    m x'' = F(t) - k(phase) g(x) - damper,     g(x) = x, 0 or x + j on the driving flanks, between, on the back flanks

The driver turns as prescribed, the driven gear on stiff axes. Nothing here comes from `drivetrain.train` but the curve.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class GearOscillator:
    """m (kg), damping (N s/m), backlash j (m), load F over time (N), k (N/m) over the driver's phase (rad), which turns
    with `speed` (rad/s); `in_contact`: the damper acts only while teeth bear."""

    mass: float
    damping: float
    backlash: float
    load: Callable[[float], float]
    curve: object
    speed: float
    phase: float
    in_contact: bool

    def stiffness(self, phase: float) -> float:
        nodes, cubics = self.curve.nodes, self.curve.cubics  # type: ignore[attr-defined]
        place = nodes[0] + (phase - nodes[0]) % self.curve.period  # type: ignore[attr-defined]
        cell = min(bisect_right(nodes, place) - 1, len(cubics) - 1)
        c, x = cubics[cell], place - nodes[cell]
        return float(c[0] + x * (c[1] + x * (c[2] + x * c[3])))

    def acceleration(self, t: float, x: float, v: float, side: int) -> float:
        force = 0.0 if self.in_contact and not side else self.damping * v
        if side:
            turned = self.speed * t + self.phase
            force += self.stiffness(turned if side > 0 else -turned) * (x if side > 0 else x + self.backlash)
        return (self.load(t) - force) / self.mass

    def step(self, t: float, y: tuple[float, float], h: float, side: int) -> tuple[float, float]:
        x, v = y
        a1 = self.acceleration(t, x, v, side)
        a2 = self.acceleration(t + h / 2, x + h / 2 * v, v + h / 2 * a1, side)
        a3 = self.acceleration(t + h / 2, x + h / 2 * v + h * h / 4 * a1, v + h / 2 * a2, side)
        a4 = self.acceleration(t + h, x + h * v + h * h / 2 * a2, v + h * a3, side)
        return x + h * v + h * h / 6 * (a1 + a2 + a3), v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)

    def run(
        self, end: float, h: float, y: tuple[float, float] = (0.0, 0.0), begin: float = 0.0, side: int = 1
    ) -> np.ndarray:
        """Rows (t, x, v, side) from the beginning to the end by steps h, shorter ones at the touches."""
        t, rows = begin, [(begin, *y, side)]
        steps = round((end - begin) / h)
        for number in range(1, steps + 1):
            goal = begin + (end - begin) * number / steps
            while t < goal:
                d = goal - t
                new = self.step(t, y, d, side)
                gaps = {1: ((0.0, -1, 0),), 0: ((0.0, 1, 1), (-self.backlash, -1, -1)), -1: ((-self.backlash, 1, 0),)}
                passed = [gap for gap in gaps[side] if gap[1] * (new[0] - gap[0]) > 0.0]
                if passed:
                    low, high = 0.0, d
                    for _ in range(60):
                        d = 0.5 * (low + high)
                        new = self.step(t, y, d, side)
                        low, high = (low, d) if passed[0][1] * (new[0] - passed[0][0]) > 0.0 else (d, high)
                    side, new = passed[0][2], (passed[0][0], new[1])
                    t, y = t + d, new
                    continue
                t, y = goal, new
            rows.append((t, *y, side))
        return np.array(rows)

    def periodic(self, period: float, h: float, y: np.ndarray, side: int = 1) -> np.ndarray:
        """Start of a periodic motion by shooting."""
        for _ in range(15):
            gap, map_ = self.around(period, h, y, side)
            if np.abs(gap * [1.0, period]).max() < 1e-12:
                return y
            y = y - np.linalg.solve(map_ - np.eye(2), gap)
        raise AssertionError("no periodic motion by shooting")

    def around(self, period: float, h: float, y: np.ndarray, side: int = 1) -> tuple[np.ndarray, np.ndarray]:
        """What a state misses after a period, and the map of small disturbances over it, by differences."""
        ends = [self.run(period, h, tuple(y), side=side)[-1, 1:3]]
        moves = (1e-9, 1e-9 * 2 * math.pi / period)
        columns = []
        for i, move in enumerate(moves):
            pair = []
            for sign in (1.0, -1.0):
                there = y.copy()
                there[i] += sign * move
                pair.append(self.run(period, h, tuple(there), side=side)[-1, 1:3])
            columns.append((pair[0] - pair[1]) / (2 * move))
        return ends[0] - y, np.array(columns).T
