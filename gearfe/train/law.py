r"""All forces of a train as one law that can be compiled: which one is read from the parameters.

Every block of parameters begins with a function of time (pieces of polynomials plus sines),

    [kind, pieces p, coefficients c, sines s, offset o | starts (p) | origins (p) | polynomials (p c) | sines (3 s) | ...]

and holds the kind's own numbers from `o` on. The train's motion is split into rolling and a small rest, rotation of a shaft
:math:`= g\,\psi(t) + u`: :math:`\psi` is the drive's angle (the function of time), g the shaft's ratio to it, u a coordinate.

- ``MESH``: ``u = (approach, rest of the driver's rotation)``; force along the approach
  :math:`-(k(\varphi) - k_0)\,u_0`, :math:`\varphi = s(g\psi + u_1) + \varphi_0`. The part with the mean :math:`k_0` is constant
  and stands in the system's stiffness. Own numbers: ``[g, s, phi0, k0, n, nodes (n+1), cubics (4 n)]``.
- ``GYRO``: ``u = (tilt 1, tilt 2, rest of the spin)``; moments :math:`-J_p\Omega\,(\dot u_1, -\dot u_0)` with
  :math:`\Omega = g\dot\psi + \dot u_2`. Own numbers: ``[g, J_p]``.
- ``TIME``: force equal to the function of time along one direction.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..periodic import PeriodicInterpolant
from ..rigid.timefunctions import TimeFunction

Array = NDArray[np.float64]
MESH, GYRO, TIME = 0.0, 1.0, 2.0


def train_law(t, u, du, parameters, out):  # type: ignore[no-untyped-def]
    """Force of one element into `out`; see the module's docstring. Plain Python and compiled alike."""
    kind = parameters[0]
    pieces = int(parameters[1])
    width = int(parameters[2])
    sines = int(parameters[3])
    o = int(parameters[4])
    i = pieces - 1
    while i > 0 and parameters[5 + i] > t:
        i -= 1
    x = t - parameters[5 + pieces + i]
    at = 5 + 2 * pieces + i * width
    value = 0.0
    slope = 0.0
    for j in range(width - 1, -1, -1):
        slope = slope * x + value
        value = value * x + parameters[at + j]
    at = 5 + 2 * pieces + pieces * width
    for j in range(sines):
        angle = parameters[at + 3 * j + 1] * t + parameters[at + 3 * j + 2]
        value += parameters[at + 3 * j] * math.sin(angle)
        slope += parameters[at + 3 * j] * parameters[at + 3 * j + 1] * math.cos(angle)
    if kind == 2.0:
        out[0] = value
    elif kind == 1.0:
        momentum = parameters[o + 1] * (parameters[o] * slope + du[2])
        out[0] = -momentum * du[1]
        out[1] = momentum * du[0]
        out[2] = 0.0
    else:
        phase = parameters[o + 1] * (parameters[o] * value + u[1]) + parameters[o + 2]
        n = int(parameters[o + 4])
        first = o + 5
        begin = parameters[first]
        period = parameters[first + n] - begin
        turns = math.floor((phase - begin) / period)
        place = min(max(phase - turns * period, begin), parameters[first + n])
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
        out[0] = -(k - parameters[o + 3]) * u[0]
        out[1] = 0.0


def packed(kind: float, function: TimeFunction, own: Array | None = None) -> Array:
    """Parameters of an element: its function of time, then its own numbers."""
    pieces, sines = len(function.starts), len(function.sines)
    width = max(len(row) for row in function.coefficients)
    rows = np.zeros((pieces, width))
    for i, row in enumerate(function.coefficients):
        rows[i, : len(row)] = row
    head = [kind, pieces, width, sines, 5 + 2 * pieces + pieces * width + 3 * sines]
    starts = np.maximum(np.array(function.starts, dtype=float), -1e300)
    tail = np.zeros(0) if own is None else own
    return np.concatenate(
        [head, starts, function.origins, rows.ravel(), np.array(function.sines, dtype=float).ravel(), tail]
    )


def mesh_numbers(ratio: float, sense: float, phase: float, mean: float, curve: PeriodicInterpolant) -> Array:
    """Own numbers of a mesh: the periodic curve as cubics ``c0 + c1 x + c2 x2 + c3 x3`` from each node."""
    h = np.diff(curve.nodes)
    low, high = curve.values[:-1], curve.values[1:]
    secant = (high - low) / h
    if curve.method == "linear":
        cubics = np.stack([low, secant, 0 * h, 0 * h], axis=1)
    else:
        a, b = curve.slopes[:-1], curve.slopes[1:]
        cubics = np.stack([low, a, (3 * secant - 2 * a - b) / h, (a + b - 2 * secant) / h**2], axis=1)
    return np.concatenate([[ratio, sense, phase, mean, len(h)], curve.nodes, cubics.ravel()])


def python_law(parameters: Array, size: int):  # type: ignore[no-untyped-def]
    """The same law as a function ``(t, u, du) -> (size,)`` for the core's plain and implicit routes."""

    def law(t: float, u: Array, du: Array) -> Array:
        out = np.zeros(size)
        train_law(t, u, du, parameters, out)
        return out

    return law


def derivative(function: TimeFunction) -> TimeFunction:
    """d/dt of a function of time, away from its breaks."""
    rows = tuple(tuple(j * c for j, c in enumerate(row))[1:] or (0.0,) for row in function.coefficients)
    sines = tuple((a * w, w, p + math.pi / 2) for a, w, p in function.sines)
    return TimeFunction(function.starts, function.origins, rows, sines)
