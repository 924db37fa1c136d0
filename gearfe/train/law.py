r"""All forces of a train as one law that can be compiled: blocks of numbers say what acts along which directions.

The train's motion is split into rolling and a small rest, rotation of a shaft :math:`= g\,\psi(t) + u`: psi is the
drive's angle, g the shaft's ratio to it, u a coordinate. The parameters are

    [number of blocks | offset of each | blocks]

and each block is ``[kind, own numbers ...]``; a function of time is ``[pieces p, coefficients c, sines s | starts (p) |
origins (p) | polynomials (p c) | sines (3 s)]``. The kinds, with the numbers of the directions they use:

- ``ANGLE``: psi(t), for the blocks after it. ``[function of time]``.
- ``MESH``: force along the approach d: :math:`-(k(\varphi) - k_0)\,u_d`, :math:`\varphi = s(g\psi + u_r) + \varphi_0`,
  r the rest of the driver's rotation. The part with the mean :math:`k_0` stands in the system's stiffness.
  ``[d, r, g, s, phi0, k0, n, nodes (n+1), cubics (4 n)]``.
- ``GYRO``: moments :math:`-J_p\Omega\,(\dot u_{d+1}, -\dot u_d)`, :math:`\Omega = g\dot\psi + \dot u_{d+2}`, on the
  tilts d, d + 1 of a shaft with the spin d + 2. ``[d, g, J_p]``.
- ``TORQUE``: a function of time along d. ``[d, function of time]``.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..rigid.timefunctions import TimeFunction
from ..stiffness.periodic import PeriodicInterpolant

Array = NDArray[np.float64]
ANGLE, MESH, GYRO, TORQUE = 0.0, 1.0, 2.0, 3.0


def train_law(t, u, du, parameters, out):  # type: ignore[no-untyped-def]
    """Forces along all directions into `out`; see the module's docstring. Plain Python and compiled alike."""
    angle = 0.0
    rate = 0.0
    for i in range(out.shape[0]):
        out[i] = 0.0
    for block in range(int(parameters[0])):
        o = int(parameters[1 + block])
        kind = parameters[o]
        if kind == 1.0:
            d = int(parameters[o + 1])
            phase = parameters[o + 4] * (parameters[o + 3] * angle + u[int(parameters[o + 2])]) + parameters[o + 5]
            n = int(parameters[o + 7])
            first = o + 8
            begin = parameters[first]
            period = parameters[first + n] - begin
            place = phase - math.floor((phase - begin) / period) * period
            low = 0
            high = n
            while high - low > 1:
                middle = (low + high) // 2
                if parameters[first + middle] <= place:
                    low = middle
                else:
                    high = middle
            x = place - parameters[first + low]
            c = first + n + 1 + 4 * low
            k = parameters[c] + x * (parameters[c + 1] + x * (parameters[c + 2] + x * parameters[c + 3]))
            out[d] -= (k - parameters[o + 6]) * u[d]
        elif kind == 2.0:
            d = int(parameters[o + 1])
            momentum = parameters[o + 3] * (parameters[o + 2] * rate + du[d + 2])
            out[d] -= momentum * du[d + 1]
            out[d + 1] += momentum * du[d]
        else:
            value, slope = time_function(t, parameters, o + 1 if kind == 0.0 else o + 2)
            if kind == 0.0:
                angle = value
                rate = slope
            else:
                out[int(parameters[o + 1])] += value


def time_function(t, parameters, at):  # type: ignore[no-untyped-def]
    """Value and slope of the function of time whose numbers begin at `at`."""
    pieces = int(parameters[at])
    width = int(parameters[at + 1])
    sines = int(parameters[at + 2])
    at += 3
    i = pieces - 1
    while i > 0 and parameters[at + i] > t:
        i -= 1
    x = t - parameters[at + pieces + i]
    row = at + 2 * pieces + i * width
    value = 0.0
    slope = 0.0
    for j in range(width - 1, -1, -1):
        slope = slope * x + value
        value = value * x + parameters[row + j]
    row = at + 2 * pieces + pieces * width
    for j in range(sines):
        turn = parameters[row + 3 * j + 1] * t + parameters[row + 3 * j + 2]
        value += parameters[row + 3 * j] * math.sin(turn)
        slope += parameters[row + 3 * j] * parameters[row + 3 * j + 1] * math.cos(turn)
    return value, slope


def python_law(parameters: Array, size: int):  # type: ignore[no-untyped-def]
    """The same law as a function ``(t, u, du) -> (size,)`` for the core's plain and implicit routes."""

    def law(t: float, u: Array, du: Array) -> Array:
        out = np.zeros(size)
        train_law(t, u, du, parameters, out)
        return out

    return law


def joined(blocks: list[Array]) -> Array:
    """Parameters of the whole law."""
    sizes = [len(b) for b in blocks]
    offsets = 1 + len(blocks) + np.concatenate([[0], np.cumsum(sizes)[:-1]])
    return np.concatenate([[len(blocks)], offsets, *blocks])


def angle_block(angle: TimeFunction) -> Array:
    """The drive's angle (rad)."""
    return np.concatenate([[ANGLE], _function(angle)])


def torque_block(direction: int, torque: TimeFunction) -> Array:
    """Torque (N m) along a direction."""
    return np.concatenate([[TORQUE, direction], _function(torque)])


def gyro_block(direction: int, ratio: float, polar: float) -> Array:
    """Gyroscopic moments on the tilts `direction` and the one after it."""
    return np.array([GYRO, direction, ratio, polar])


def mesh_block(
    direction: int, driver: int, ratio: float, sense: float, phase: float, mean: float, curve: PeriodicInterpolant
) -> Array:
    """Changing part of a mesh's stiffness: cubics ``c0 + c1 x + c2 x2 + c3 x3`` from each node of the curve."""
    h = np.diff(curve.nodes)
    low, high = curve.values[:-1], curve.values[1:]
    secant = (high - low) / h
    if curve.method == "linear":
        cubics = np.stack([low, secant, 0 * h, 0 * h], axis=1)
    else:
        a, b = curve.slopes[:-1], curve.slopes[1:]
        cubics = np.stack([low, a, (3 * secant - 2 * a - b) / h, (a + b - 2 * secant) / h**2], axis=1)
    head = [MESH, direction, driver, ratio, sense, phase, mean, len(h)]
    return np.concatenate([head, curve.nodes, cubics.ravel()])


def _function(function: TimeFunction) -> Array:
    pieces, sines = len(function.starts), len(function.sines)
    width = max(len(row) for row in function.coefficients)
    rows = np.zeros((pieces, width))
    for i, row in enumerate(function.coefficients):
        rows[i, : len(row)] = row
    starts = np.maximum(np.array(function.starts, dtype=float), -1e300)
    waves = np.array(function.sines, dtype=float).ravel()
    return np.concatenate([[pieces, width, sines], starts, function.origins, rows.ravel(), waves])


def derivative(function: TimeFunction) -> TimeFunction:
    """d/dt of a function of time, away from its breaks."""
    rows = tuple(tuple(j * c for j, c in enumerate(row))[1:] or (0.0,) for row in function.coefficients)
    sines = tuple((a * w, w, p + math.pi / 2) for a, w, p in function.sines)
    return TimeFunction(function.starts, function.origins, rows, sines)
