# mypy: ignore-errors
r"""Equations of the two mechanisms for general-purpose integrators, in absolute angles, compiled by numba.

Andrews' mechanism: seven angles, six closure equations (Hairer & Wanner II, Sec. VII.7). A mass centre is
:math:`x_b = x_0 + \sum_k R(a_k) v_{bk}`, so that

.. math::
    M a'' = f(a, a') - G^T \lambda,\qquad G a'' = \gamma(a, a')

with M block-diagonal (only neighbouring angles couple); ``S = G M^-1 G^T`` (6 x 6) is solved by Cholesky. The slider
crank: two angles, one closure equation. Nothing here comes from `gearfe.multibody`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from types import FunctionType
from typing import Any

import numpy as np

MASS = np.array([0.04325, 0.00365, 0.02373, 0.00706, 0.07050, 0.00706, 0.05498])
INERTIA = np.array([2.194e-6, 4.410e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5])
A, B, C = (-0.06934, -0.00227), (-0.03635, 0.03273), (0.014, 0.072)
D_, DA, E, EA, RR, RA = 0.028, 0.0115, 0.02, 0.01421, 0.007, 0.00092
SS, SA, SB, SC, SD = 0.035, 0.01874, 0.01043, 0.018, 0.02
ZT, TA, TB, U, UA, UB, ZF, FA = 0.04, 0.02308, 0.00916, 0.04, 0.01228, 0.00449, 0.02, 0.01421
STIFFNESS, FREE_LENGTH, MOMENT = 4530.0, 0.07785, 0.033
#: Start: absolute angles of beta, Theta, ... (issue of the mechanism; published start).
START = (
    -0.0617138900142764496, 0.0, 0.455279819163070380, 0.222668390165885885, 0.487364979543842550,
    -0.222668390165885885, 1.23054744454982120,
)  # fmt: skip
#: Coupled bodies: body, carrying angle, its arm; own angle, its arm (arms as vectors in the links' frames).
PAIRS = ((1, 0, (RR, 0.0), 1, (-DA, 0.0)), (3, 4, (ZT, 0.0), 3, (0.0, EA - E)), (5, 6, (0.0, -U), 5, (ZF - FA, 0.0)))
_DIAGONAL = INERTIA + np.array(
    [
        MASS[0] * RA**2 + MASS[1] * RR**2,
        MASS[1] * DA**2,
        MASS[2] * (SA**2 + SB**2),
        MASS[3] * (E - EA) ** 2,
        MASS[4] * (TA**2 + TB**2) + MASS[3] * ZT**2,
        MASS[5] * (ZF - FA) ** 2,
        MASS[6] * (UA**2 + UB**2) + MASS[5] * U**2,
    ]
)
#: m v_i . v_j and m v_i x v_j of the pairs (angles 0-1, 4-3, 6-5).
_DOT = np.array([MASS[b] * (v[0] * w[0] + v[1] * w[1]) for b, _, v, _, w in PAIRS])
_CROSS = np.array([MASS[b] * (v[0] * w[1] - v[1] * w[0]) for b, _, v, _, w in PAIRS])


def andrews_start() -> np.ndarray:
    """Seven absolute angles, seven rates."""
    b, t, g, p, d, o, e = START
    return np.array([b, b + t, g, p + d, d, o + e, e, *np.zeros(7)])


def published_angles(a: np.ndarray) -> np.ndarray:
    """(n, 7) angles of the literature from (n, 7) absolute ones."""
    columns = [a[:, 0], a[:, 1] - a[:, 0], a[:, 2], a[:, 3] - a[:, 4], a[:, 4], a[:, 5] - a[:, 6], a[:, 6]]
    return np.stack(columns, axis=1)


def _turned(x, y, c, s):
    return x * c - y * s, x * s + y * c


def andrews_terms(q, v, G, gamma, f):
    """Closure gradient G (6, 7), gamma (6,), forces f (7,); returns the three couplings of M."""
    c0, s0, c1, s1 = math.cos(q[0]), math.sin(q[0]), math.cos(q[1]), math.sin(q[1])
    c2, s2, c3, s3 = math.cos(q[2]), math.sin(q[2]), math.cos(q[3]), math.sin(q[3])
    c4, s4, c5, s5 = math.cos(q[4]), math.sin(q[4]), math.cos(q[5]), math.sin(q[5])
    c6, s6 = math.cos(q[6]), math.sin(q[6])
    # E by the crank, less E by body 3, by 4 and 5, by 6 and 7
    ax = -RR * c0 * v[0] ** 2 + D_ * c1 * v[1] ** 2  # second derivative without a''
    ay = -RR * s0 * v[0] ** 2 + D_ * s1 * v[1] ** 2
    for r in range(3):
        G[2 * r, 0] = -RR * s0
        G[2 * r + 1, 0] = RR * c0
        G[2 * r, 1] = D_ * s1
        G[2 * r + 1, 1] = -D_ * c1
    G[0, 2] = -SS * c2
    G[1, 2] = -SS * s2
    gamma[0] = -(ax + SS * s2 * v[2] ** 2)
    gamma[1] = -(ay - SS * c2 * v[2] ** 2)
    G[2, 3] = -E * c3
    G[3, 3] = -E * s3
    G[2, 4] = ZT * s4
    G[3, 4] = -ZT * c4
    gamma[2] = -(ax + E * s3 * v[3] ** 2 + ZT * c4 * v[4] ** 2)
    gamma[3] = -(ay - E * c3 * v[3] ** 2 + ZT * s4 * v[4] ** 2)
    G[4, 5] = ZF * s5
    G[5, 5] = -ZF * c5
    G[4, 6] = -U * c6
    G[5, 6] = -U * s6
    gamma[4] = -(ax + ZF * c5 * v[5] ** 2 + U * s6 * v[6] ** 2)
    gamma[5] = -(ay + ZF * s5 * v[5] ** 2 - U * c6 * v[6] ** 2)
    # spring from C to D on body 3
    rx, ry = _turned(SD, -SC, c2, s2)
    lx, ly = B[0] + rx - C[0], B[1] + ry - C[1]
    length = math.sqrt(lx * lx + ly * ly)
    pull = -STIFFNESS * (length - FREE_LENGTH) / length
    f[0], f[1], f[3], f[4], f[5], f[6] = MOMENT, 0.0, 0.0, 0.0, 0.0, 0.0
    f[2] = pull * (-ry * lx + rx * ly)
    # R(a)'v . R(b)'w = v.w cos(b - a) - v x w sin(b - a)
    k0 = _DOT[0] * math.cos(q[1] - q[0]) - _CROSS[0] * math.sin(q[1] - q[0])
    k1 = _DOT[1] * math.cos(q[3] - q[4]) - _CROSS[1] * math.sin(q[3] - q[4])
    k2 = _DOT[2] * math.cos(q[5] - q[6]) - _CROSS[2] * math.sin(q[5] - q[6])
    # -R(a)'v . (-R(b) w b'^2): turning forces of the pairs
    n0 = _DOT[0] * math.sin(q[1] - q[0]) + _CROSS[0] * math.cos(q[1] - q[0])
    n1 = _DOT[1] * math.sin(q[3] - q[4]) + _CROSS[1] * math.cos(q[3] - q[4])
    n2 = _DOT[2] * math.sin(q[5] - q[6]) + _CROSS[2] * math.cos(q[5] - q[6])
    f[0] += n0 * v[1] ** 2
    f[1] -= n0 * v[0] ** 2
    f[4] += n1 * v[3] ** 2
    f[3] -= n1 * v[4] ** 2
    f[6] += n2 * v[5] ** 2
    f[5] -= n2 * v[6] ** 2
    return k0, k1, k2


def _inverse_mass(k, i, j, x):
    """x <- block of M^-1 x for the coupled angles i and j."""
    det = _DIAGONAL[i] * _DIAGONAL[j] - k * k
    a, b = x[i], x[j]
    x[i] = (_DIAGONAL[j] * a - k * b) / det
    x[j] = (_DIAGONAL[i] * b - k * a) / det


def andrews_rhs(t, y, dy):
    """dy of y = (angles, rates): index-1 form."""
    G, gamma, f = np.zeros((6, 7)), np.empty(6), np.empty(7)
    k0, k1, k2 = andrews_terms(y[:7], y[7:], G, gamma, f)
    W = np.empty((6, 7))  # rows M^-1 G^T
    for r in range(7):
        row = f if r == 6 else W[r]
        if r < 6:
            for k in range(7):
                row[k] = G[r, k]
        _inverse_mass(k0, 0, 1, row)
        _inverse_mass(k1, 4, 3, row)
        _inverse_mass(k2, 6, 5, row)
        row[2] /= _DIAGONAL[2]
    S, b = np.empty((6, 6)), np.empty(6)
    for r in range(6):
        for k in range(r + 1):
            total = 0.0
            for m in range(7):
                total += G[r, m] * W[k, m]
            S[r, k] = total
        total = -gamma[r]
        for m in range(7):
            total += G[r, m] * f[m]
        b[r] = total
    _cholesky_solve(S, b)
    for m in range(7):
        total = f[m]
        for r in range(6):
            total -= W[r, m] * b[r]
        dy[m] = y[7 + m]
        dy[7 + m] = total


def _cholesky_solve(S, b):
    """b <- S^-1 b, the lower triangle of S given; S is overwritten."""
    n = b.shape[0]
    for j in range(n):
        total = S[j, j]
        for k in range(j):
            total -= S[j, k] * S[j, k]
        S[j, j] = math.sqrt(total)
        for i in range(j + 1, n):
            total = S[i, j]
            for k in range(j):
                total -= S[i, k] * S[j, k]
            S[i, j] = total / S[j, j]
    for i in range(n):
        total = b[i]
        for k in range(i):
            total -= S[i, k] * b[k]
        b[i] = total / S[i, i]
    for i in range(n - 1, -1, -1):
        total = b[i]
        for k in range(i + 1, n):
            total -= S[k, i] * b[k]
        b[i] = total / S[i, i]


def andrews_residual(t, y, dy, out):
    """Stabilised index-2 form (Gear, Gupta, Leimkuhler): y = (angles, rates, lambda, mu)."""
    G, gamma, f = np.zeros((6, 7)), np.empty(6), np.empty(7)
    k0, k1, k2 = andrews_terms(y[:7], y[7:14], G, gamma, f)
    couple = ((0, 1, k0), (4, 3, k1), (6, 5, k2))
    for m in range(7):
        out[m] = dy[m] - y[7 + m]
        out[7 + m] = _DIAGONAL[m] * dy[7 + m] - f[m]
        for r in range(6):
            out[m] += G[r, m] * y[20 + r]
            out[7 + m] += G[r, m] * y[14 + r]
    for i, j, k in couple:
        out[7 + i] += k * dy[7 + j]
        out[7 + j] += k * dy[7 + i]
    q = y
    ex = RR * math.cos(q[0]) - D_ * math.cos(q[1])
    ey = RR * math.sin(q[0]) - D_ * math.sin(q[1])
    out[14] = ex - (B[0] + SS * math.sin(q[2]))
    out[15] = ey - (B[1] - SS * math.cos(q[2]))
    out[16] = ex - (A[0] + ZT * math.cos(q[4]) + E * math.sin(q[3]))
    out[17] = ey - (A[1] + ZT * math.sin(q[4]) - E * math.cos(q[3]))
    out[18] = ex - (A[0] + U * math.sin(q[6]) + ZF * math.cos(q[5]))
    out[19] = ey - (A[1] - U * math.cos(q[6]) + ZF * math.sin(q[5]))
    for r in range(6):
        total = 0.0
        for m in range(7):
            total += G[r, m] * y[7 + m]
        out[20 + r] = total


def slider_crank_start() -> np.ndarray:
    """Crank and rod angle, their rates: the slider moves at -4 m/s."""
    rate = 4.0 / (2.0 * math.sin(math.pi / 4.0))
    return np.array([math.pi / 4.0, -math.pi / 4.0, rate, -rate])


def slider_crank_rhs(t, y, dy):
    """dy of y = (two angles, two rates): index-1 form of rods of 1 m and 1 kg, sin a + sin b = 0."""
    ca, cb, sa, sb = math.cos(y[0]), math.cos(y[1]), math.sin(y[0]), math.sin(y[1])
    k, n = 0.5 * math.cos(y[1] - y[0]), 0.5 * math.sin(y[1] - y[0])
    m1, m2 = 4.0 / 3.0, 1.0 / 3.0
    f1 = -1.5 * 9.81 * ca + n * y[3] ** 2
    f2 = -0.5 * 9.81 * cb - n * y[2] ** 2
    det = m1 * m2 - k * k
    w1, w2 = (m2 * ca - k * cb) / det, (m1 * cb - k * ca) / det
    g1, g2 = (m2 * f1 - k * f2) / det, (m1 * f2 - k * f1) / det
    gamma = sa * y[2] ** 2 + sb * y[3] ** 2
    push = (ca * g1 + cb * g2 - gamma) / (ca * w1 + cb * w2)
    dy[0], dy[1] = y[2], y[3]
    dy[2], dy[3] = g1 - w1 * push, g2 - w2 * push


def slider_crank_residual(t, y, dy, out):
    """Stabilised index-2 form: y = (two angles, two rates, lambda, mu)."""
    ca, cb = math.cos(y[0]), math.cos(y[1])
    k, n = 0.5 * math.cos(y[1] - y[0]), 0.5 * math.sin(y[1] - y[0])
    out[0] = dy[0] - y[2] + ca * y[5]
    out[1] = dy[1] - y[3] + cb * y[5]
    out[2] = 4.0 / 3.0 * dy[2] + k * dy[3] + 1.5 * 9.81 * ca - n * y[3] ** 2 + ca * y[4]
    out[3] = 1.0 / 3.0 * dy[3] + k * dy[2] + 0.5 * 9.81 * cb + n * y[2] ** 2 + cb * y[4]
    out[4] = math.sin(y[0]) + math.sin(y[1])
    out[5] = ca * y[2] + cb * y[3]


FUNCTIONS = (
    _turned, andrews_terms, _inverse_mass, _cholesky_solve, andrews_rhs, andrews_residual, slider_crank_rhs,
    slider_crank_residual,
)  # fmt: skip


def equations(name: str, *, jit: bool = True) -> tuple[np.ndarray, Callable[..., Any], Callable[..., Any], int]:
    """Start (angles, rates), right-hand side, residual, number of closure equations; compiled, or as they stand."""
    constants = {k: v for k, v in globals().items() if k.isupper() or k in ("_DIAGONAL", "_DOT", "_CROSS", "D_")}
    entries = (f"{name}_rhs", f"{name}_residual")
    functions = FUNCTIONS if name == "andrews" else FUNCTIONS[-2:]
    made = _bound(functions, {"np": np, "math": math, **constants}, jit=jit)
    start, rows = (andrews_start(), 6) if name == "andrews" else (slider_crank_start(), 1)
    return start, made[entries[0]], made[entries[1]], rows


def _bound(functions: tuple[Any, ...], names: dict[str, Any], *, jit: bool) -> dict[str, Any]:
    """Functions that see each other and `names`, as they stand or compiled as numba does it by default."""
    scope: dict[str, Any] = {"__builtins__": __builtins__, **names}
    for function in functions:
        made = FunctionType(function.__code__, scope, function.__name__, function.__defaults__)
        scope[function.__name__] = made
    if jit:
        import numba

        for function in functions:
            name = function.__name__
            scope[name] = numba.njit(scope[name], fastmath={"contract", "reassoc", "nsz"}, error_model="numpy")
    return scope


def angles_of(name: str, states: np.ndarray) -> list[Any]:
    """What the study compares: the seven angles, or the crank's."""
    found = published_angles(states[:, :7]) if name == "andrews" else states[:, 0]
    return list(found.tolist())
