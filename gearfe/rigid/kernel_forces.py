"""Taylor series of the applied forces: tensions of springs along vectors, forces along forms, weight."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..typing import Array
from .kernel_names import (
    AS,
    BS,
    CS,
    DAMPING,
    EW,
    EX,
    EY,
    FREE_LENGTH,
    INVERSE,
    KC,
    KS,
    KT,
    KX,
    KY,
    LENGTH,
    PULL,
    SN,
    STIFFNESS,
    VX,
    VY,
)

if TYPE_CHECKING:
    from .tables import Forces, Forms, Tables, Vectors
    from .taylor import Work


def spring_orders(forces: Forces, vs: Array, ss: Array, j: int) -> None:
    """Order j of the length L and of 1/L of every spring."""
    for k in range(ss.shape[2]):
        square = 0.0
        for i in range(j + 1):
            square += vs[VX, i, k] * vs[VX, j - i, k] + vs[VY, i, k] * vs[VY, j - i, k]
        if j == 0:
            ss[LENGTH, 0, k] = np.sqrt(square)
            # with neither free length nor damping the force is linear in the span: the points may coincide
            linear = forces.spring[k, DAMPING] == 0.0 and forces.spring[k, FREE_LENGTH] == 0.0
            ss[INVERSE, 0, k] = 0.0 if linear else 1.0 / ss[LENGTH, 0, k]
        else:
            for i in range(1, j):
                square -= ss[LENGTH, i, k] * ss[LENGTH, j - i, k]
            ss[LENGTH, j, k] = 0.5 * square * ss[INVERSE, 0, k]
            inverse = 0.0
            for i in range(1, j + 1):
                inverse += ss[LENGTH, i, k] * ss[INVERSE, j - i, k]
            ss[INVERSE, j, k] = -inverse * ss[INVERSE, 0, k]


def force_orders(tb: Tables, w: Work, k: int, at: int, F: Array) -> None:
    """Order k of all applied forces: F gets what does not turn with a body, A and B (at row `at`) what does."""
    forms, forces, bs, QS = tb.forms, tb.forces, w.bs, w.QS
    for i in range(F.shape[0]):
        F[i] = forces.weight[i] if k == 0 else 0.0
    for b in range(bs.shape[2]):
        bs[AS, at, b] = 0.0
        bs[BS, at, b] = 0.0
    for e in range(forces.spring.shape[0]):
        fx, fy = spring_force(forces, w.vs, w.ss, k, e)
        add_force(tb.vectors, bs, at, e, -fx, -fy, F)
    m = w.mu.shape[0]
    for e in range(forces.along.shape[0]):
        r = m + e
        value = 0.0
        if forms.motion[r] >= 0:
            value = w.TF[forms.motion[r], k]
        if forces.along[e, STIFFNESS] != 0.0:
            value -= forces.along[e, STIFFNESS] * form_order(forms, QS, bs, r, k)
        if forces.along[e, DAMPING] != 0.0:
            value -= forces.along[e, DAMPING] * (k + 1) * form_order(forms, QS, bs, r, k + 1)
        for side in range(2):
            b = forms.bodies[r, side]
            F[3 * b] += forms.factor[r, side, KX] * value
            F[3 * b + 1] += forms.factor[r, side, KY] * value
            F[3 * b + 2] += forms.factor[r, side, KT] * value
            bs[AS, at, b] -= forms.factor[r, side, KC] * value
            bs[BS, at, b] += forms.factor[r, side, KS] * value


def form_order(forms: Forms, QS: Array, bs: Array, r: int, j: int) -> float:
    """Order j of the affine form r."""
    value = forms.constant[r] if j == 0 else 0.0
    for side in range(2):
        b = forms.bodies[r, side]
        value += forms.factor[r, side, KX] * QS[j, 3 * b] + forms.factor[r, side, KY] * QS[j, 3 * b + 1]
        value += forms.factor[r, side, KT] * QS[j, 3 * b + 2]
        value += forms.factor[r, side, KC] * bs[CS, j, b] + forms.factor[r, side, KS] * bs[SN, j, b]
    return value


def add_force(vectors: Vectors, bs: Array, at: int, k: int, fx: float, fy: float, F: Array) -> None:
    """The generalised force of (fx, fy) on the vector k: F gets what does not turn with a body, A and B what does."""
    for side in range(2):
        b = vectors.bodies[k, side]
        F[3 * b] += vectors.end[k, side, EW] * fx
        F[3 * b + 1] += vectors.end[k, side, EW] * fy
    add_arms(vectors, bs, at, k, fx, fy)


def add_arms(vectors: Vectors, bs: Array, at: int, k: int, fx: float, fy: float) -> None:
    """The torques of (fx, fy) on the vector k join the sums A and B."""
    for side in range(2):
        b = vectors.bodies[k, side]
        x = vectors.end[k, side, EX]
        y = vectors.end[k, side, EY]
        bs[AS, at, b] -= x * fx + y * fy
        bs[BS, at, b] += x * fy - y * fx


def spring_force(forces: Forces, vs: Array, ss: Array, k: int, e: int) -> tuple[float, float]:
    """Order k of the force of spring e on its first point: (k_s (L - L0) + c L') / L times the span."""
    stiffness = forces.spring[e, STIFFNESS]
    damping = forces.spring[e, DAMPING]
    value = -stiffness * forces.spring[e, FREE_LENGTH] * ss[INVERSE, k, e]
    if k == 0:
        value += stiffness
    if damping != 0.0:
        for i in range(k + 1):
            value += damping * (i + 1) * ss[LENGTH, i + 1, e] * ss[INVERSE, k - i, e]
    ss[PULL, k, e] = value
    fx = 0.0
    fy = 0.0
    for i in range(k + 1):
        fx += ss[PULL, i, e] * vs[VX, k - i, e]
        fy += ss[PULL, i, e] * vs[VY, k - i, e]
    return fx, fy


FUNCTIONS = (spring_orders, force_orders, form_order, add_force, add_arms, spring_force)
