# mypy: ignore-errors
"""Taylor series of the applied forces: springs along a line, linear springs, loads, moments."""

from __future__ import annotations

import numpy as np

from .kernel_planes import AS, BS, CS, EF, EI, EL, EX, EY, LINEAR, LOAD, SN, SPRING


def spring_orders(forces, QS, bs, es, j):
    """Order j of the span D, length L and 1/L of every spring."""
    for k in range(es.shape[2]):
        a = forces.ints[k, 1]
        b = forces.ints[k, 2]
        p = forces.reals[k]
        es[EX, j, k] = (
            QS[j, 3 * b]
            - QS[j, 3 * a]
            + bs[CS, j, b] * p[2]
            - bs[SN, j, b] * p[3]
            - bs[CS, j, a] * p[0]
            + bs[SN, j, a] * p[1]
        )
        es[EY, j, k] = (
            QS[j, 3 * b + 1] - QS[j, 3 * a + 1] + bs[SN, j, b] * p[2] + bs[CS, j, b] * p[3]
            - bs[SN, j, a] * p[0] - bs[CS, j, a] * p[1]
        )  # fmt: skip
        square = 0.0
        for i in range(j + 1):
            square += es[EX, i, k] * es[EX, j - i, k] + es[EY, i, k] * es[EY, j - i, k]
        if j == 0:
            es[EL, 0, k] = np.sqrt(square)
            # with neither free length nor damping the force is linear in the span: the points may coincide
            linear = p[5] == 0.0 and p[6] == 0.0
            es[EI, 0, k] = 0.0 if linear else 1.0 / es[EL, 0, k]
        else:
            for i in range(1, j):
                square -= es[EL, i, k] * es[EL, j - i, k]
            es[EL, j, k] = 0.5 * square * es[EI, 0, k]
            inverse = 0.0
            for i in range(1, j + 1):
                inverse += es[EL, i, k] * es[EI, j - i, k]
            es[EI, j, k] = -inverse * es[EI, 0, k]


def force_orders(forces, QS, TF, bs, es, k, at, F):
    """Order k of all applied forces: F gets what does not turn with a body, A and B (at row `at`) what does."""
    for i in range(F.shape[0]):
        F[i] = forces.weight[i] if k == 0 else 0.0
    for b in range(bs.shape[2]):
        bs[AS, at, b] = 0.0
        bs[BS, at, b] = 0.0
    for e in range(forces.ints.shape[0]):
        kind = forces.ints[e, 0]
        a = forces.ints[e, 1]
        b = forces.ints[e, 2]
        first = forces.reals[e, 0]
        second = forces.reals[e, 1]
        if kind == SPRING:
            fx, fy = spring_force(forces, es, k, e)
            F[3 * a] += fx
            F[3 * a + 1] += fy
            F[3 * b] -= fx
            F[3 * b + 1] -= fy
            bs[AS, at, a] -= first * fx + second * fy
            bs[BS, at, a] += first * fy - second * fx
            bs[AS, at, b] += forces.reals[e, 2] * fx + forces.reals[e, 3] * fy
            bs[BS, at, b] -= forces.reals[e, 2] * fy - forces.reals[e, 3] * fx
        elif kind == LINEAR:
            value = -first * (QS[k, a] - QS[k, b]) - second * (k + 1) * (QS[k + 1, a] - QS[k + 1, b])
            if k == 0:
                value += first * forces.reals[e, 2]
            F[a] += value
            F[b] -= value
        elif kind == LOAD:
            fx = TF[forces.ints[e, 3], k]
            fy = TF[forces.ints[e, 4], k]
            F[3 * a] += fx
            F[3 * a + 1] += fy
            bs[AS, at, a] -= first * fx + second * fy
            bs[BS, at, a] += first * fy - second * fx
        else:
            value = TF[forces.ints[e, 3], k]
            F[3 * a + 2] += value
            F[3 * b + 2] -= value


def spring_force(forces, es, k, e):
    """Order k of the force of spring e on its first point: (k_s (L - L0) + c L') / L times the span."""
    stiffness = forces.reals[e, 4]
    damping = forces.reals[e, 5]
    value = -stiffness * forces.reals[e, 6] * es[EI, k, e]
    if k == 0:
        value += stiffness
    if damping != 0.0:
        for i in range(k + 1):
            value += damping * (i + 1) * es[EL, i + 1, e] * es[EI, k - i, e]
    es[EF, k, e] = value
    fx = 0.0
    fy = 0.0
    for i in range(k + 1):
        fx += es[EF, i, e] * es[EX, k - i, e]
        fy += es[EF, i, e] * es[EY, k - i, e]
    return fx, fy


FUNCTIONS = (spring_orders, force_orders, spring_force)
