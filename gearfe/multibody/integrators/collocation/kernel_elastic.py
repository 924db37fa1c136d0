"""Forces and tangents of beams (`beam.Beam`) and of bodies in floating frames (`floating.Floating`), compiled.

Stresses S of all of them stand in one row of unknowns; ``law`` holds the derivatives of each by what its strain is made
of. A stage's force is that of S and, through `law`, of what S lacks; S then becomes the stress of the strains.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ....typing import Array
from ...compiled.simd import Lanes

if TYPE_CHECKING:
    from ...series.tape import Bars, Floats
    from .kernel_equations import Scratch


def bar_strains(bars: Bars, p: int, q: Array) -> Any:
    """(x', y', theta, theta') at a point, of one state or of all stages."""
    dx = 0.0 * q[0]
    dy = 0.0 * q[0]
    turn = 0.0 * q[0]
    bend = 0.0 * q[0]
    for k in range(4):
        at = bars.place[p, k]
        dx += bars.slope[p, k] * q[at]
        dy += bars.slope[p, k] * q[at + 1]
        turn += bars.shape[p, k] * q[at + 2]
        bend += bars.slope[p, k] * q[at + 2]
    return dx, dy, turn, bend


def add_bars(bars: Bars, q: Lanes, v: Lanes, S: Lanes, law: Array, F: Lanes) -> None:
    """Add the forces of all beams at all stages, and replace the stresses by those of the strains.

    Parameters
    ----------
    bars : Bars
        Gauss points of the beams.
    q, v : SIMD, shape (n, W)
        Coordinates and velocities.
    S : SIMD, shape (k, W)
        Stresses: axial force (N), shear force (N), bending moment (N m) of each point; changed.
    law : ndarray, shape (k, widest)
        Derivatives of the stresses by x', y', theta, theta', as `add_bar_tangents` left them.
    F : SIMD, shape (n, W)
        Forces on the coordinates (N, N m); changed.
    """
    for p in range(bars.place.shape[0]):
        dx, dy, angle, curl = bar_strains(bars, p, q)
        c = np.cos(angle)
        s = np.sin(angle)
        stretch = c * dx + s * dy
        shear = c * dy - s * dx
        axial = stretch - 1.0
        across = 1.0 * shear
        bend = 1.0 * curl
        if bars.damping[p] > 0.0:
            x, y, turn, curling = bar_strains(bars, p, v)
            axial += bars.damping[p] * (c * x + s * y + shear * turn)
            across += bars.damping[p] * (c * y - s * x - stretch * turn)
            bend += bars.damping[p] * curling
        at = bars.stress[p]
        one = 1.0 * S[at]
        two = 1.0 * S[at + 1]
        three = 1.0 * S[at + 2]
        lack = axial - one * (1.0 / bars.stiffness[p, 0])
        skew = across - two * (1.0 / bars.stiffness[p, 1])
        more = bend - three * (1.0 / bars.stiffness[p, 2])
        S[at] = axial * bars.stiffness[p, 0]
        S[at + 1] = across * bars.stiffness[p, 1]
        S[at + 2] = bend * bars.stiffness[p, 2]
        x = c * one - s * two + lack * law[at, 0] + skew * law[at + 1, 0]
        y = s * one + c * two + lack * law[at, 1] + skew * law[at + 1, 1]
        moment = shear * one - stretch * two + lack * law[at, 2] + skew * law[at + 1, 2]
        moment *= bars.weight[p]
        couple = three + more * law[at + 2, 3]
        for k in range(4):
            j = bars.place[p, k]
            slope = bars.weight[p] * bars.slope[p, k]
            F[j] -= slope * x
            F[j + 1] -= slope * y
            F[j + 2] -= bars.shape[p, k] * moment + slope * couple


def add_bar_tangents(bars: Bars, q: Array, v: Array, S: Array, own: Scratch, K: Array, C: Array) -> None:
    """Add the derivatives of the beams' forces by coordinates and velocities, in one state.

    Parameters
    ----------
    bars : Bars
        Gauss points of the beams.
    q, v : ndarray, shape (n,)
        Coordinates and velocities.
    S : ndarray, shape (k,)
        Stresses.
    own : Scratch
        Work arrays; ``own.law`` becomes the derivatives of the stresses by x', y', theta, theta'.
    K, C : ndarray, shape (n, n)
        dF/dq and dF/dv; changed.
    """
    slope, by, rate, law = own.slope, own.by[0], own.by[1], own.law
    for p in range(bars.place.shape[0]):
        dx, dy, angle, _ = bar_strains(bars, p, q)
        d = bar_strains(bars, p, v)
        c = math.cos(angle)
        s = math.sin(angle)
        stretch = c * dx + s * dy
        shear = c * dy - s * dx
        for i in range(3):
            for j in range(4):
                slope[i, j] = 0.0
        slope[0, 0] = c
        slope[0, 1] = s
        slope[0, 2] = shear
        slope[1, 0] = -s
        slope[1, 1] = c
        slope[1, 2] = -stretch
        slope[2, 3] = 1.0
        at = bars.stress[p]
        tau = bars.damping[p]
        weight = bars.weight[p]
        for i in range(3):
            for j in range(4):
                law[at + i, j] = bars.stiffness[p, i] * slope[i, j]
        for a in range(4):
            for b in range(4):
                value = 0.0
                for i in range(3):
                    value += slope[i, a] * law[at + i, b]
                by[a, b] = -weight * value
                rate[a, b] = -tau * weight * value
        one = weight * S[at]
        two = weight * S[at + 1]
        by[0, 2] += one * s + two * c
        by[2, 0] += one * s + two * c
        by[1, 2] += two * s - one * c
        by[2, 1] += two * s - one * c
        by[2, 2] += one * stretch + two * shear
        if tau > 0.0:  # drift of the strains' rates with the state
            for a in range(3):
                first = tau * weight * law[at, a]
                second = tau * weight * law[at + 1, a]
                by[a, 0] += first * s * d[2] + second * c * d[2]
                by[a, 1] += second * s * d[2] - first * c * d[2]
                by[a, 2] -= first * (c * d[1] - s * d[0] - stretch * d[2])
                by[a, 2] += second * (c * d[0] + s * d[1] + shear * d[2])
        for k in range(4):
            i = bars.place[p, k]
            for n in range(4):
                j = bars.place[p, n]
                inner = bars.slope[p, k] * bars.slope[p, n]
                mixed = bars.slope[p, k] * bars.shape[p, n]
                other = bars.shape[p, k] * bars.slope[p, n]
                both = bars.shape[p, k] * bars.shape[p, n]
                for a in range(2):
                    for b in range(2):
                        K[i + a, j + b] += inner * by[a, b]
                        C[i + a, j + b] += inner * rate[a, b]
                    K[i + a, j + 2] += mixed * by[a, 2] + inner * by[a, 3]
                    C[i + a, j + 2] += mixed * rate[a, 2] + inner * rate[a, 3]
                    K[i + 2, j + a] += other * by[2, a] + inner * by[3, a]
                    C[i + 2, j + a] += other * rate[2, a] + inner * rate[3, a]
                K[i + 2, j + 2] += both * by[2, 2] + other * by[2, 3] + mixed * by[3, 2] + inner * by[3, 3]
                C[i + 2, j + 2] += both * rate[2, 2] + other * rate[2, 3] + mixed * rate[3, 2] + inner * rate[3, 3]


def bar_changes(bars: Bars, dq: Lanes, dv: Lanes, law: Array, S: Lanes) -> None:
    """Add the changes of the beams' stresses with those of coordinates and velocities.

    Parameters
    ----------
    bars : Bars
        Gauss points of the beams.
    dq, dv : SIMD, shape (n, W)
        Changes of coordinates and velocities.
    law : ndarray, shape (k, widest)
        Derivatives of the stresses, see `add_bar_tangents`.
    S : SIMD, shape (k, W)
        Stresses; changed.
    """
    for p in range(bars.place.shape[0]):
        x, y, turn, bend = bar_strains(bars, p, dq)
        if bars.damping[p] > 0.0:
            a, b, c, d = bar_strains(bars, p, dv)
            x += bars.damping[p] * a
            y += bars.damping[p] * b
            turn += bars.damping[p] * c
            bend += bars.damping[p] * d
        for i in range(3):
            at = bars.stress[p] + i
            S[at] += law[at, 0] * x + law[at, 1] * y + law[at, 2] * turn + law[at, 3] * bend


def _float_slopes(floats: Floats, b: int, q: Array, shapes: Array, blocks: Array) -> None:
    """Write the strains of a body in a floating frame, and their derivatives by the coordinates.

    The derivatives go to blocks (s, size), the shares eta of the modes to shapes[0], the strains (L + Q eta / 2) eta to
    shapes[1].
    """
    first, r, size = floats.place[b, 0], floats.place[b, 1], 2 * floats.place[b, 1] + 4
    eta, e = shapes[0], shapes[1]
    for k in range(r):
        p = first + 4 + 2 * k
        eta[k] = q[p] * q[first + 2] + q[p + 1] * q[first + 3]
    for s in range(floats.place[b, 2]):
        e[s] = 0.0
        for j in range(size):
            blocks[s, j] = 0.0
        for k in range(r):
            bent = 0.0 * eta[k]
            at = floats.place[b, 4] + (s * r + k) * r
            for m in range(r):
                bent += floats.quadratic[at + m] * eta[m]
            linear = floats.linear[floats.place[b, 3] + s * r + k]
            e[s] += (linear + 0.5 * bent) * eta[k]
            by = linear + bent
            p = first + 4 + 2 * k
            blocks[s, 2] += by * q[p]
            blocks[s, 3] += by * q[p + 1]
            blocks[s, 4 + 2 * k] = by * q[first + 2]
            blocks[s, 5 + 2 * k] = by * q[first + 3]


def add_floats(
    floats: Floats, q: Lanes, v: Lanes, S: Lanes, law: Array, shapes: Lanes, blocks: Lanes, F: Lanes
) -> None:
    """Add the forces of bodies in floating frames at all stages, and replace the stresses by those of the strains.

    Parameters
    ----------
    floats : Floats
        The bodies.
    q, v : SIMD, shape (n, W)
        Coordinates and velocities.
    S : SIMD, shape (k, W)
        Stresses in the basis of strain energy (J^0.5); changed.
    law : ndarray, shape (k, widest)
        Derivatives of the stresses by the body's coordinates, as `add_float_tangents` left them.
    shapes : SIMD, shape (2, widest, W)
        Scratch: shares of the modes, and strains.
    blocks : SIMD, shape (strains, coordinates, W)
        Scratch: derivatives of the strains.
    F : SIMD, shape (n, W)
        Forces on the coordinates; changed.
    """
    for b in range(floats.place.shape[0]):
        _float_slopes(floats, b, q, shapes, blocks)
        first, size, at = floats.place[b, 0], 2 * floats.place[b, 1] + 4, floats.place[b, 5]
        for s in range(floats.place[b, 2]):
            stress = 1.0 * shapes[1, s]
            if floats.damping[b] > 0.0:
                for j in range(size):
                    stress += floats.damping[b] * blocks[s, j] * v[first + j]
            lack = stress - S[at + s]
            for j in range(size):
                F[first + j] -= S[at + s] * blocks[s, j] + lack * law[at + s, j]
            S[at + s] = stress


def add_float_tangents(floats: Floats, q: Array, v: Array, S: Array, own: Scratch, K: Array, C: Array) -> None:
    """Add the derivatives of these bodies' forces by coordinates and velocities, in one state.

    Parameters
    ----------
    floats : Floats
        Bodies in floating frames.
    q, v : ndarray, shape (n,)
        Coordinates and velocities.
    S : ndarray, shape (k,)
        Stresses.
    own : Scratch
        Work arrays; ``own.law`` becomes the derivatives of the stresses by the body's coordinates.
    K, C : ndarray, shape (n, n)
        dF/dq and dF/dv; changed.
    """
    for b in range(floats.place.shape[0]):
        _float_slopes(floats, b, q, own.shapes, own.blocks)
        first, r, strains = floats.place[b, 0], floats.place[b, 1], floats.place[b, 2]
        at = floats.place[b, 5]
        size = 2 * r + 4
        tau = floats.damping[b]
        eta, swing, pull, pairs, drift = own.shapes[0], own.shapes[2], own.shapes[3], own.pairs, own.drift
        for k in range(r):  # rates of the shares
            p = first + 4 + 2 * k
            swing[k] = v[p] * q[first + 2] + v[p + 1] * q[first + 3] + q[p] * v[first + 2] + q[p + 1] * v[first + 3]
        for k in range(r):
            pull[k] = 0.0
            for m in range(r):
                pairs[k, m] = 0.0
        for s in range(strains):
            stress = S[at + s]
            for j in range(size):
                own.law[at + s, j] = own.blocks[s, j]
                drift[j] = 0.0
            for k in range(r):
                place = floats.place[b, 4] + (s * r + k) * r
                bent = floats.linear[floats.place[b, 3] + s * r + k]
                speed = 0.0
                for m in range(r):
                    value = floats.quadratic[place + m]
                    bent += value * eta[m]
                    speed += value * swing[m]
                    pairs[k, m] += stress * value
                pull[k] += stress * bent
                for c in range(2):  # of the strains' rates with the state
                    p = 4 + 2 * k + c
                    drift[p] = speed * q[first + 2 + c] + bent * v[first + 2 + c]
                    drift[2 + c] += speed * q[first + p] + bent * v[first + p]
            for i in range(size):
                value = own.blocks[s, i]
                for j in range(size):
                    K[first + i, first + j] -= value * (own.blocks[s, j] + tau * drift[j])
                    C[first + i, first + j] -= tau * value * own.blocks[s, j]
        for k in range(r):
            for m in range(r):
                _add_share_product(first, k, m, q, -pairs[k, m], K)
            for c in range(2):
                p = first + 4 + 2 * k + c
                K[p, first + 2 + c] -= pull[k]
                K[first + 2 + c, p] -= pull[k]


def _add_share_product(first: int, k: int, m: int, q: Array, factor: float, K: Array) -> None:
    """Add factor (d eta_k / dq)^T (d eta_m / dq) to K."""
    for c in range(2):
        one = first + 4 + 2 * k + c
        for e in range(2):
            two = first + 4 + 2 * m + e
            K[one, two] += factor * q[first + 2 + c] * q[first + 2 + e]
            K[one, first + 2 + e] += factor * q[first + 2 + c] * q[two]
            K[first + 2 + c, two] += factor * q[one] * q[first + 2 + e]
            K[first + 2 + c, first + 2 + e] += factor * q[one] * q[two]


def float_changes(floats: Floats, dq: Lanes, dv: Lanes, law: Array, S: Lanes) -> None:
    """Add the changes of the bodies' stresses with those of coordinates and velocities.

    Parameters
    ----------
    floats : Floats
        Bodies in floating frames.
    dq, dv : SIMD, shape (n, W)
        Changes of coordinates and velocities.
    law : ndarray, shape (k, widest)
        Derivatives of the stresses, see `add_float_tangents`.
    S : SIMD, shape (k, W)
        Stresses; changed.
    """
    for b in range(floats.place.shape[0]):
        first, at = floats.place[b, 0], floats.place[b, 5]
        for s in range(floats.place[b, 2]):
            for j in range(2 * floats.place[b, 1] + 4):
                S[at + s] += law[at + s, j] * (dq[first + j] + floats.damping[b] * dv[first + j])


FUNCTIONS = (
    bar_strains, add_bars, add_bar_tangents, bar_changes, _float_slopes, add_floats, _add_share_product,
    add_float_tangents, float_changes,
)  # fmt: skip
