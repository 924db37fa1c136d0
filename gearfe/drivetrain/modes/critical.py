r"""Critical speeds: where the frequency of an order is that of a mode, :math:`n\,\Omega/2\pi = f(\Omega)`.

Between the speeds with known modes the frequencies are cubics with the values and slopes there (Hermite). An
intersection is a root of its cubic. Whatever names critical speeds takes these same intersections.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from ...base.typing import Array
from .energies import HOUSING
from .orders import TrainOrder
from .whirl import STRONG, WhirlModes

#: Turns per minute of 1 rad/s.
RPM = 30.0 / math.pi
#: Halvings of the interval of a root: to round-off.
HALVED = 53


class HasOrder(Protocol):
    """What has an order: cycles in a turn of the drive."""

    @property
    def order(self) -> float:
        """Cycles in a turn of the drive."""


Cut = TypeVar("Cut", bound=HasOrder)


@dataclass(frozen=True)
class Crossing(Generic[Cut]):
    """An order that meets a mode: a critical speed.

    Attributes
    ----------
    speed
        Of the drive (rad/s).
    frequency
        Hz.
    mode
        Number of the mode, from 0.
    cut
        The order.
    """

    speed: float
    frequency: float
    mode: int
    cut: Cut


def crossings(modes: WhirlModes, cuts: Sequence[Cut], beyond: float = 0.0) -> list[Crossing[Cut]]:
    """Where orders meet modes, by speed.

    Parameters
    ----------
    modes : WhirlModes
        The modes.
    cuts : sequence
        Orders: cycles in a turn of the drive as `order`.
    beyond : float
        How far beyond the ends of the speeds, in parts of them: frequencies go on with their slopes there.
    """
    rising = np.argsort(np.abs(modes.speeds))
    sense = math.copysign(1.0, float(modes.speeds[rising[-1]]))
    speeds, frequency = np.abs(modes.speeds)[rising], modes.frequency[rising]
    slope = sense * modes.slope[rising]
    if beyond > 0.0:
        ends = np.array([(1.0 - beyond) * speeds[0], (1.0 + beyond) * speeds[-1]])
        outer = [frequency[k] + slope[k] * (end - speeds[k]) for k, end in zip((0, -1), ends, strict=True)]
        kept = slice(0 if ends[0] < speeds[0] else 1, None)
        speeds = np.concatenate([ends[:1], speeds, ends[1:]])[kept]
        frequency = np.vstack([outer[0], frequency, outer[1]])[kept]
        slope = np.vstack([slope[:1], slope, slope[-1:]])[kept]
    found = []
    step = np.diff(speeds)
    for cut in cuts:
        per_speed = cut.order / (2.0 * math.pi)
        off, rate = frequency - per_speed * speeds[:, None], slope - per_speed
        with np.errstate(invalid="ignore"):
            turns = (off[:-1] * rate[:-1] < 0.0) & (off[1:] * rate[1:] > 0.0)  # a cubic that may come to zero between
            meets = (off[:-1] * off[1:] <= 0.0) | turns
        for k, mode in np.argwhere(meets & np.isfinite(off[:-1] * off[1:])).tolist():
            slopes = step[k] * rate[k : k + 2, mode]
            for part in _roots(off[k : k + 2, mode], slopes, last=k == len(step) - 1):
                speed = float(speeds[k] + part * step[k])
                found.append(Crossing(sense * speed, per_speed * speed, mode, cut))
    return sorted((c for c in found if c.speed != 0.0), key=lambda c: abs(c.speed))


def _roots(values: Array, slopes: Array, *, last: bool) -> list[float]:
    """Roots in [0, 1) of the cubic with the values and slopes at 0 and 1; at the last step 1 counts, too."""
    (a, b), (da, db) = values.tolist(), slopes.tolist()
    cubic = da + db - 2.0 * (b - a), 3.0 * (b - a) - 2.0 * da - db, da, a
    turns = _quadratic_roots(3.0 * cubic[0], 2.0 * cubic[1], cubic[2])
    nodes = [0.0, *sorted(x for x in turns if 0.0 < x < 1.0), 1.0]

    def height(x: float) -> float:
        return ((cubic[0] * x + cubic[1]) * x + cubic[2]) * x + cubic[3]

    heights = [a, *(height(x) for x in nodes[1:-1]), b]
    found = [x for x, value in zip(nodes, heights, strict=True) if value == 0.0 and (x < 1.0 or last)]
    for k in range(len(nodes) - 1):
        if heights[k] * heights[k + 1] < 0.0:
            low, high = nodes[k], nodes[k + 1]
            for _ in range(HALVED):
                middle = 0.5 * (low + high)
                low, high = (low, middle) if heights[k] * height(middle) <= 0.0 else (middle, high)
            found.append(0.5 * (low + high))
    return sorted(found)


def _quadratic_roots(a: float, b: float, c: float) -> list[float]:
    """Real roots of a x^2 + b x + c, where they are finite."""
    square = b * b - 4.0 * a * c
    if square < 0.0:
        return []
    q = -0.5 * (b + math.copysign(math.sqrt(square), b))
    return [x / y for x, y in ((q, a), (c, q)) if y != 0.0]


@dataclass(frozen=True, eq=False)
class Campbell:
    """Modes of a train over the speed, and where orders meet them.

    Attributes
    ----------
    modes
        The modes.
    orders
        Orders of meshes and shafts.
    met
        Critical speeds, by size.
    band_hz
        Upper end of the band (Hz).
    """

    modes: WhirlModes
    orders: list[TrainOrder]
    met: list[Crossing[TrainOrder]]
    band_hz: float

    def excited(self, crossing: Crossing[TrainOrder]) -> bool:
        """Whether an order reaches a mode: a mesh that strains in it, or a shaft that moves by itself in it."""
        modes, mode, order = self.modes, crossing.mode, crossing.cut
        row = nearest(modes, crossing.speed)
        if order.meshes and modes.mesh_strain[row, mode, list(order.meshes)].max() >= STRONG:
            return True
        return bool(order.shafts) and modes.kinds[row][mode] != HOUSING

    def columns(self) -> dict[str, Any]:
        """The table critical_speeds.csv: where an order meets a mode, with the mode's shares of energy there."""
        modes, met = self.modes, self.met
        rows = [nearest(modes, c.speed) for c in met]
        mode = np.array([c.mode for c in met], dtype=int)
        at = np.array(rows, dtype=int), mode
        made: dict[str, Any] = {
            "speed_rad_per_s": np.array([c.speed for c in met]),
            "speed_rpm": RPM * np.array([c.speed for c in met]),
            "frequency_Hz": np.array([c.frequency for c in met]),
            "order": np.array([c.cut.order for c in met]),
            "meets": [c.cut.name for c in met],
            "mode": mode + 1,
            "damping_ratio": modes.damping_ratio[at],
            "excited": np.array([self.excited(c) for c in met], dtype=int),
            "direction": [modes.direction[row][c.mode] for row, c in zip(rows, met, strict=True)],
            "label": [modes.labels[row][c.mode] for row, c in zip(rows, met, strict=True)],
        }
        shares = modes.shares[at]
        return made | {f"share_{'_'.join(p).strip('_')}": shares[:, i] for i, p in enumerate(modes.parts)}


def campbell(modes: WhirlModes, orders: list[TrainOrder], band_hz: float) -> Campbell:
    """Find where orders meet modes below a frequency (Hz)."""
    modes = modes.below(band_hz)
    met = [c for c in crossings(modes, orders) if c.frequency <= band_hz]
    return Campbell(modes, orders, met, band_hz)


def nearest(modes: WhirlModes, speed: float) -> int:
    """Number of the speed of the modes that is nearest to one (rad/s)."""
    return int(np.argmin(np.abs(modes.speeds - speed)))
