"""Taylor series of the index-3 equations of a linkage about one point.

With q(t) = sum_j q_j (t - t0)^j and the multipliers likewise, order k of the motion and order k + 2 of the
constraints read

    M (k+2)(k+1) q_{k+2} + G_0^T lambda_k = f_k - sum_{i>=1} G_i^T lambda_{k-i},       G_0 q_{k+2} = -r_{k+2}

with r the part of the constraint that lower orders fix. One factorisation of S = G_0 M^-1 G_0^T serves all
orders. Sines and
cosines follow from s' = c theta', c' = -s theta' (Barrio, Appl. Math. Comput. 163 (2005) 525); every force that acts at
a point of a body enters through two sums A, B with the torque s A + c B, so the price does not depend on the joints.

At a passing singular position some rows Z^T G_0 vanish while B = Z^T dG/dt does not. There order k + 3 of Z^T g
fixes q_{k+2} along B, and the multipliers have a simple pole: lambda = (Z nu_0)/t + ... . Both conditions
together give the
bordered system with the rows B; multipliers are then stored one order up ("shift").

Light links: where the joints make a link carry far more than its own mass, M^-1 of the link hides the heavy ones in S.
The elimination then uses N = M + D with the excess D on these few coordinates c, and

    N q + G^T lambda = f + D q,    q = q_N + sum_c X_c q_c,    X_c = D_c times the answer of N to a unit force on c

is solved exactly: (1 - X) q_c = (q_N)_c once per order. No 1/m of a light link appears, so it may be without mass.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..typing import Array
from .kernel_forces import add_arms, add_force, force_orders, spring_orders
from .kernel_names import AS, BS, CS, DT, EW, EX, EY, KC, KS, SN, VX, VY
from .kernel_rows import add_transposed, fill, solve, time_series, times_gradients, trigonometry

if TYPE_CHECKING:
    from .kernel_steps import Run
    from .ordering import Factor
    from .tables import Forms, Tables, Vectors
    from .taylor import Border, Work


def angle_orders(bs: Array, j: int, known: int) -> None:
    """Orders j of sine and cosine from the orders of theta below `known`: what theta_j itself adds comes later."""
    for b in range(bs.shape[2]):
        sine = 0.0
        cosine = 0.0
        for i in range(1, known):
            sine += bs[DT, i, b] * bs[CS, j - i, b]
            cosine -= bs[DT, i, b] * bs[SN, j - i, b]
        bs[SN, j, b] = sine / j
        bs[CS, j, b] = cosine / j


def vector_orders(vectors: Vectors, QS: Array, bs: Array, vs: Array, j: int, first: int) -> None:
    """Orders j of the vectors from number `first` on, from the orders j of q, sine and cosine."""
    for k in range(first, vs.shape[2]):
        x = 0.0
        y = 0.0
        for side in range(2):
            b = vectors.bodies[k, side]
            px = vectors.end[k, side, EX]
            py = vectors.end[k, side, EY]
            x += vectors.end[k, side, EW] * QS[j, 3 * b] + bs[CS, j, b] * px - bs[SN, j, b] * py
            y += vectors.end[k, side, EW] * QS[j, 3 * b + 1] + bs[SN, j, b] * px + bs[CS, j, b] * py
        vs[VX, j, k] = x
        vs[VY, j, k] = y


def row_orders(forms: Forms, TF: Array, bs: Array, vs: Array, j: int, out: Array) -> None:
    """Order j >= 2 of every constraint without the part of q_j."""
    for r in range(out.shape[0]):
        value = 0.0
        if forms.motion[r] >= 0:
            value = -TF[forms.motion[r], j]
        for side in range(2):
            b = forms.bodies[r, side]
            value += forms.factor[r, side, KC] * bs[CS, j, b] + forms.factor[r, side, KS] * bs[SN, j, b]
        out[r] = value
    for p in range(forms.product.shape[0]):
        one = forms.product[p, 1]
        two = forms.product[p, 2]
        value = 0.0
        for i in range(j + 1):
            value += vs[VX, i, one] * vs[VX, j - i, two] + vs[VY, i, one] * vs[VY, j - i, two]
        out[forms.product[p, 0]] += value


def product_forces(forms: Forms, vectors: Vectors, LM: Array, bs: Array, vs: Array, at: int, F: Array) -> None:
    """Known part of order `at` of the forces of constraints with products, from the multipliers below that order."""
    for p in range(forms.product.shape[0]):
        r = forms.product[p, 0]
        for one in range(2):
            k = forms.product[p, 2 - one]
            fx = 0.0
            fy = 0.0
            for i in range(1, at + 1):
                fx += vs[VX, i, k] * LM[at - i, r]
                fy += vs[VY, i, k] * LM[at - i, r]
            add_force(vectors, bs, at, forms.product[p, 1 + one], -fx, -fy, F)


def add_multipliers(forms: Forms, vectors: Vectors, LM: Array, bs: Array, vs: Array, at: int, values: Array) -> None:
    """Multipliers `values` (one per constraint) join order `at`: what turns with a body goes into A, B."""
    for r in range(values.shape[0]):
        value = values[r]
        LM[at, r] += value
        for side in range(2):
            b = forms.bodies[r, side]
            bs[AS, at, b] += forms.factor[r, side, KC] * value
            bs[BS, at, b] -= forms.factor[r, side, KS] * value
    add_product_multipliers(forms, vectors, bs, vs, at, 0, values)


def add_product_multipliers(
    forms: Forms, vectors: Vectors, bs: Array, vs: Array, at: int, i: int, values: Array
) -> None:
    """Order `at` of the force of every product gains order i of its vectors times its multiplier."""
    for p in range(forms.product.shape[0]):
        value = values[forms.product[p, 0]]
        for one in range(2):
            k = forms.product[p, 2 - one]
            add_arms(vectors, bs, at, forms.product[p, 1 + one], -vs[VX, i, k] * value, -vs[VY, i, k] * value)


def torque_orders(bs: Array, at: int, F: Array) -> None:
    """F gains order `at` of s A + c B for every body."""
    for b in range(bs.shape[2]):
        torque = 0.0
        for i in range(at + 1):
            torque += bs[SN, i, b] * bs[AS, at - i, b] + bs[CS, i, b] * bs[BS, at - i, b]
        F[3 * b + 2] += torque


def finish_order(tb: Tables, w: Work, j: int) -> None:
    """Everything that follows from q_j: sine, cosine, vectors, springs."""
    bs = w.bs
    for b in range(bs.shape[2]):
        theta = w.QS[j, 3 * b + 2]
        bs[DT, j, b] = j * theta
        bs[SN, j, b] += bs[CS, 0, b] * theta
        bs[CS, j, b] -= bs[SN, 0, b] * theta
    vector_orders(tb.vectors, w.QS, bs, w.vs, j, 0)
    spring_orders(tb.forces, w.vs, w.ss, j)


def expand(tb: Tables, w: Work, run: Run, t: float, singular: int) -> None:
    """Fill w.QS[2..order] from w.QS[0], w.QS[1]; w.G, w.val hold gradients and factor there, w.border singular rows.

    `singular` is their number: 0 at a regular position.
    """
    order = run.order
    forms, vectors, mass = tb.forms, tb.vectors, tb.mass
    bs, vs, border = w.bs, w.vs, w.border
    QS, TF, LM, G, skip = w.QS, w.TF, w.LM, w.G, w.skip
    mu, rhs, F, u = w.mu, w.rhs, w.F, w.u
    springs = w.ss.shape[2]
    shift = 1 if singular > 0 else 0
    time_series(tb.times, t, run.sign > 0.0, order + 2, TF)
    start_series(tb, w, order)
    if tb.light.shape[0] > 0:
        carry_responses(tb, singular, w)
    for k in range(order - 1):
        j = k + 2
        at = k + shift
        alpha = float(j * (j - 1))
        share = 1.0 / alpha
        force_orders(tb, w, k, at, F)
        product_forces(forms, vectors, LM, bs, vs, at, F)
        torque_orders(bs, at, F)
        angle_orders(bs, j, j)
        vector_orders(vectors, QS, bs, vs, j, springs)
        row_orders(forms, TF, bs, vs, j, rhs)
        for i in range(F.shape[0]):
            u[i] = F[i] * mass[i] * share
        if singular > 0:
            border_rows(tb, w, j, singular)
        times_gradients(forms, G, u, mu)
        for r in range(mu.shape[0]):
            mu[r] = mu[r] + rhs[r] if skip[r] == 0 else 0.0
        constrained(tb, singular, w, mu, u, QS[j])
        if tb.light.shape[0] > 0:
            add_carried(tb, singular, w, mu, QS[j])
        for r in range(mu.shape[0]):
            mu[r] *= alpha
        add_multipliers(forms, vectors, LM, bs, vs, at, mu)
        if singular > 0:  # the multipliers Z nu belong one order below the regular ones
            for r in range(mu.shape[0]):
                mu[r] = 0.0
                for p in range(singular):
                    mu[r] += alpha * border.Z[p, r] * border.nu[p]
            add_multipliers(forms, vectors, LM, bs, vs, at - 1, mu)
            add_product_multipliers(forms, vectors, bs, vs, at, 1, mu)
        finish_order(tb, w, j)


def constrained(tb: Tables, singular: int, w: Work, mu: Array, u: Array, q: Array) -> None:
    """q := the motion that a free motion u becomes under the constraints; mu (and border.nu): gaps in, multipliers
    out."""
    border, F = w.border, w.F
    if singular > 0:
        border_solve(tb.plan, w.val, border, mu, singular)
    else:
        solve(tb.plan, w.val, mu)
    fill(F, 0.0)
    add_transposed(tb.forms, w.G, mu, 1.0, F)
    for p in range(singular):
        for i in range(F.shape[0]):
            F[i] += border.B[p, i] * border.nu[p]
    for i in range(F.shape[0]):
        q[i] = u[i] - F[i] * tb.mass[i]


def carry_responses(tb: Tables, singular: int, w: Work) -> None:
    """w.carry: what a unit of every light coordinate adds to coordinates (X) and multipliers (Y, W); 1 - X = L U.

    D (1 - X) is symmetric and positive definite, so it needs no pivots.
    """
    carry, light, border, u = w.carry, tb.light, w.border, w.u
    k = light.shape[0]
    for c in range(k):
        at = light[c]
        fill(u, 0.0)
        u[at] = tb.excess[c] * tb.mass[at]
        times_gradients(tb.forms, w.G, u, carry.Y[c])
        for r in range(carry.Y.shape[1]):
            if w.skip[r] != 0:
                carry.Y[c, r] = 0.0
        for p in range(singular):
            border.nu[p] = border.B[p, at] * u[at]
        constrained(tb, singular, w, carry.Y[c], u, carry.X[c])
        for p in range(singular):
            carry.W[c, p] = border.nu[p]
    lu = carry.lu
    for e in range(k):
        for c in range(k):
            lu[e, c] = (1.0 if e == c else 0.0) - carry.X[c, light[e]]
            for i in range(min(e, c)):
                lu[e, c] -= lu[e, i] * lu[i, c]
            if c < e:
                lu[e, c] /= lu[c, c]


def add_carried(tb: Tables, singular: int, w: Work, mu: Array, q: Array) -> None:
    """Motion q and multipliers mu (and border.nu) of the masses N become those of the masses M."""
    carry, light = w.carry, tb.light
    lu, own = carry.lu, carry.own
    k = light.shape[0]
    for e in range(k):
        own[e] = q[light[e]]
        for c in range(e):
            own[e] -= lu[e, c] * own[c]
    for e in range(k - 1, -1, -1):
        for c in range(e + 1, k):
            own[e] -= lu[e, c] * own[c]
        own[e] /= lu[e, e]
    for c in range(k):
        value = own[c]
        for i in range(q.shape[0]):
            q[i] += carry.X[c, i] * value
        for r in range(mu.shape[0]):
            mu[r] += carry.Y[c, r] * value
        for p in range(singular):
            w.border.nu[p] += carry.W[c, p] * value


def start_series(tb: Tables, w: Work, order: int) -> None:
    """Orders 0 and 1 from position and velocity; all others zero."""
    QS, bs = w.QS, w.bs
    for j in range(2, order + 2):
        fill(QS[j], 0.0)
    for j in range(order + 2):
        fill(w.LM[j], 0.0)
    trigonometry(QS[0], bs[CS, 0], bs[SN, 0])
    fill(bs[DT, 0], 0.0)
    fill(bs[SN, 1], 0.0)
    fill(bs[CS, 1], 0.0)
    fill(bs[AS, 0], 0.0)
    fill(bs[BS, 0], 0.0)
    vector_orders(tb.vectors, QS, bs, w.vs, 0, 0)
    spring_orders(tb.forces, w.vs, w.ss, 0)
    finish_order(tb, w, 1)


def border_rows(tb: Tables, w: Work, j: int, singular: int) -> None:
    """Order j + 1 of Z^T g with q_j and q_{j+1} left out: border.nu; the part of q_j is B q_j."""
    border, bs, work, u = w.border, w.bs, w.mu, w.u
    angle_orders(bs, j + 1, j)
    vector_orders(tb.vectors, w.QS, bs, w.vs, j + 1, w.ss.shape[2])
    row_orders(tb.forms, w.TF, bs, w.vs, j + 1, work)
    for p in range(singular):
        value = 0.0
        for r in range(work.shape[0]):
            value += border.Z[p, r] * work[r]
        for i in range(u.shape[0]):
            value += border.B[p, i] * u[i]
        border.nu[p] = value


def border_solve(plan: Factor, val: Array, border: Border, mu: Array, singular: int) -> None:
    """Bordered solve: in come the regular right-hand side in mu and the one of the rows B in nu; out the
    multipliers."""
    for p in range(singular):
        for r in range(mu.shape[0]):
            border.nu[p] -= border.Y[p, r] * mu[r]
    small_solve(border.schur, singular, border.nu, border.small)
    solve(plan, val, mu)
    for p in range(singular):
        for r in range(mu.shape[0]):
            mu[r] -= border.Y[p, r] * border.nu[p]


def small_solve(matrix: Array, size: int, x: Array, work: Array) -> None:
    """x := matrix^-1 x by Gaussian elimination with row pivots (a few unknowns)."""
    for i in range(size):
        for j in range(size):
            work[i, j] = matrix[i, j]
    for i in range(size):
        best = i
        for k in range(i + 1, size):
            if abs(work[k, i]) > abs(work[best, i]):
                best = k
        if best != i:
            for j in range(size):
                keep = work[i, j]
                work[i, j] = work[best, j]
                work[best, j] = keep
            keep = x[i]
            x[i] = x[best]
            x[best] = keep
        for k in range(i + 1, size):
            factor = work[k, i] / work[i, i]
            x[k] -= factor * x[i]
            for j in range(i, size):
                work[k, j] -= factor * work[i, j]
    for i in range(size - 1, -1, -1):
        for j in range(i + 1, size):
            x[i] -= work[i, j] * x[j]
        x[i] /= work[i, i]


FUNCTIONS = (
    angle_orders,
    vector_orders,
    row_orders,
    product_forces,
    add_multipliers,
    add_product_multipliers,
    torque_orders,
    finish_order,
    expand,
    constrained,
    carry_responses,
    add_carried,
    start_series,
    border_rows,
    border_solve,
    small_solve,
)
