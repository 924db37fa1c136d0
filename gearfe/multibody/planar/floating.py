r"""Elastic bodies in a floating frame, written in vectors: large rotations are exact, the mass matrix is constant.

With points of the plane as complex numbers, a point Z of the body stands at

    r(Z) = x + Z a + sum_k phi_k(Z) p_k,        a = exp(i theta),   p_k = eta_k a,

x the place of the frame's origin, phi_k the modes (displacements in the frame) and eta_k their shares. r is linear in
the vectors (x, a, p), so the mass matrix is constant: the integrals of rho conj(N_j) N_k, N = (1, Z, phi). Constraint
rows that are quadratic in the vectors make them a frame: |a| = 1 and p_k parallel to a (`frame_joint`). Further
quadratic rows hold bodies of a linkage at the interfaces; joints of the linkage act on these bodies.

The strain of Green and Lagrange is quadratic in the displacement. In an orthonormal basis of strain energy it is

    e = L eta + 1/2 Q(eta, eta),        U = 1/2 e . e                                                   (J)

so geometric (centrifugal) stiffening is in the energy, as far as the modes can follow. Damping is Kelvin's and
Voigt's: e counts as e + tau e'. (Shabana, Dynamics of Multibody Systems, ch. 5; the vectors are those of natural
coordinates: Garcia de Jalon & Bayo, Kinematic and Dynamic Simulation of Multibody Systems, Springer 1994.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ...base.typing import Array, IntArray
from ..core.contract import Element
from .linkage import Linkage
from .quadratic import QuadraticJoint
from .turning import field_and_rate

if TYPE_CHECKING:
    from ..series.tape import Tape


@dataclass(frozen=True, eq=False)
class FloatingBody:
    """A reduced elastic body as plain data; the frame goes with the first interface, where all modes vanish.

    Attributes
    ----------
    mass : ndarray of complex, shape (r + 2, r + 2)
        Integrals of conj(N_j) N_k over the mass, N = (1, Z, phi_1 ... phi_r); kg, kg m, kg m2.
    linear, quadratic : ndarray, shapes (s, r), (s, r, r)
        L and Q.
    centres : ndarray of complex, shape (i,)
        Interfaces in the frame (m).
    shifts, turns : ndarray of complex, shape (i, r)
        Motion there by the modes: a point Z moves by shift (m) + turn (Z - centre), turn = growth + i angle.
    damping : float
        tau (s).
    size : float
        The body's extent (m), for units. Modes are of that size where they are largest.
    """

    mass: np.ndarray = field(repr=False)
    linear: Array = field(repr=False)
    quadratic: Array = field(repr=False)
    centres: np.ndarray
    shifts: np.ndarray = field(repr=False)
    turns: np.ndarray = field(repr=False)
    damping: float
    size: float

    @property
    def modes(self) -> int:
        """r."""
        return len(self.mass) - 2


class Floating(Element):
    """Mass, elasticity, damping and weight of an elastic body; coordinates (x, a, p_1 ... p_r), two each.

    Parameters
    ----------
    body : FloatingBody
        What it is.
    linkage : Linkage
        Its gravity and turning frame hold here, too.
    pose, speed : (float, float, float)
        Start of the frame: x, y (m), angle; and how fast they change.
    """

    stiff = True

    def __init__(
        self, body: FloatingBody, linkage: Linkage, name: str, pose: Sequence[float], speed: Sequence[float]
    ) -> None:
        self.body, self.name, self.size = body, name, 2 * len(body.mass)
        self.pose, self.speed = tuple(pose), tuple(speed)
        real, imaginary = np.real(body.mass), np.imag(body.mass)
        self._mass = np.kron(real, np.eye(2)) + np.kron(imaginary, np.array([[0.0, -1.0], [1.0, 0.0]]))
        acceleration, self._rate = field_and_rate(linkage)
        self._weight = self._mass[:, :2] @ acceleration

    def mass(self) -> Array:
        """Constant."""
        return self._mass

    def blocks(self) -> tuple[Array, Array] | None:
        """Centrifugal and Coriolis forces of a turning frame."""
        if not self._rate:
            return None
        ahead = np.kron(np.eye(len(self.body.mass)), np.array([[0.0, 1.0], [-1.0, 0.0]]))
        return -2.0 * self._rate * self._mass @ ahead, -(self._rate**2) * self._mass

    def start(self) -> tuple[Array, Array]:
        """Undeformed."""
        return self.moving(self.pose, self.speed)

    def moving(self, pose: Sequence[float], speed: Sequence[float]) -> tuple[Array, Array]:
        """Coordinates and velocities of the undeformed body with its frame at a pose (x, y, angle)."""
        q, v = np.zeros((2, self.size))
        c, s = np.cos(pose[2]), np.sin(pose[2])
        q[:4], v[:4] = (*pose[:2], c, s), (*speed[:2], -s * speed[2], c * speed[2])
        return q, v

    def units(self) -> tuple[Array, Array]:
        """The body's extent where a coordinate is a length."""
        sizes = np.ones(self.size)
        sizes[:2] = self.body.size
        return sizes, np.ones(0)

    # ------------------------------------------------------------------------------------------------------------
    def shares(self, q: Array) -> Array:
        """eta, shape (..., r)."""
        vectors = q[..., 2:].reshape(*q.shape[:-1], -1, 2)
        return np.asarray(np.einsum("...kc,...c->...k", vectors[..., 1:, :], vectors[..., 0, :]))

    def _share_rates(self, q: Array, v: Array) -> Array:
        """d eta / dt, shape (..., r)."""
        vectors, rates = (x[..., 2:].reshape(*x.shape[:-1], -1, 2) for x in (q, v))
        turning = np.einsum("...kc,...c->...k", vectors[..., 1:, :], rates[..., 0, :])
        return np.asarray(turning + np.einsum("...kc,...c->...k", rates[..., 1:, :], vectors[..., 0, :]))

    def _slope(self, q: Array) -> Array:
        """d eta / d q, shape (r, size)."""
        r = self.body.modes
        out = np.zeros((r, self.size))
        out[:, 2:4] = q[4:].reshape(r, 2)
        own = np.arange(r)
        out[own, 4 + 2 * own], out[own, 5 + 2 * own] = q[2], q[3]
        return out

    def _strains(self, q: Array) -> tuple[Array, Array]:
        """e, shape (s,), and its derivatives by q, shape (s, size)."""
        eta = self.shares(q)
        bent = self.body.quadratic @ eta
        return (self.body.linear + 0.5 * bent) @ eta, (self.body.linear + bent) @ self._slope(q)

    def write(self, tape: Tape, places: IntArray) -> bool:
        """Write strains and weight on a tape."""
        tape.constant[places] += self._weight
        tape.floating(int(places[0]), self.body.linear, self.body.quadratic, self.body.damping)
        return True

    def stress(self, q: Array, v: Array) -> Array:
        """e + tau e', shape (s,)."""
        e, slope = self._strains(q)
        return e + self.body.damping * (slope @ v)

    def force(self, t: float, q: Array, v: Array) -> Array:  # noqa: ARG002
        """Forces of the strains and their rates, and the weight."""
        e, slope = self._strains(q)
        return self._weight - (e + self.body.damping * (slope @ v)) @ slope

    def force_jacobian(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:  # noqa: ARG002
        """Return the derivatives of the force by q and v."""
        tangent = self.tangent(q, v, self.stress(q, v))
        return tangent.by_q, tangent.by_v

    def tangent(self, q: Array, v: Array, stress: Array) -> Tangent:
        """Derivatives of the forces about a state, for stresses of their own, shape (s,)."""
        _, slope = self._strains(q)
        tau = self.body.damping
        by_v = -tau * slope.T @ slope
        by_q = -slope.T @ slope - self._bend(q, stress)
        if tau:
            by_q -= tau * slope.T @ self._drift(q, v)
        return Tangent(self, slope, by_q, by_v)

    def _bend(self, q: Array, stress: Array) -> Array:
        """sum_s stress_s d2 e_s / dq2."""
        eta, slope = self.shares(q), self._slope(q)
        pull = np.tensordot(stress, self.body.quadratic, 1)
        full = slope.T @ pull @ slope
        by_share = stress @ self.body.linear + pull @ eta  # eta_k = p_k . a
        own = np.arange(self.body.modes)
        for c in (0, 1):
            full[4 + 2 * own + c, 2 + c] += by_share
            full[2 + c, 4 + 2 * own + c] += by_share
        return np.asarray(full, dtype=float)

    def _drift(self, q: Array, v: Array) -> Array:
        """d (de/dq v) / dq, shape (s, size)."""
        slope, swing = self._slope(q), self._slope(v)  # the slope of the shares is linear in q
        bent = self.body.quadratic @ self.shares(q)
        return np.asarray(self.body.quadratic @ (slope @ v) @ slope + (self.body.linear + bent) @ swing, dtype=float)

    def potential(self, q: Array) -> Array:
        """Elastic energy and that of the weight (J) in states (..., size)."""
        return np.asarray(self.elastic_energy(q) - q @ self._weight)

    def _products(self, one: Array, two: Array) -> Array:
        """Q(one, two) of shares (..., r), shape (..., s), as one matrix product."""
        pairs = (one[..., :, None] * two[..., None, :]).reshape(*one.shape[:-1], -1)
        return np.asarray(pairs @ self.body.quadratic.reshape(len(self.body.quadratic), -1).T)

    def elastic_energy(self, q: Array) -> Array:
        """1/2 e . e (J) in states (..., size)."""
        eta = self.shares(q)
        strains = eta @ self.body.linear.T + 0.5 * self._products(eta, eta)
        return np.asarray(0.5 * (strains**2).sum(axis=-1))

    def loss(self, q: Array, v: Array) -> Array:
        """Power that damping takes (W) in states (..., size)."""
        eta, rates = self.shares(q), self._share_rates(q, v)
        strains = rates @ self.body.linear.T + self._products(eta, rates)
        return np.asarray(self.body.damping * (strains**2).sum(axis=-1))


@dataclass(frozen=True)
class Tangent:
    """Forces of an elastic body whose stresses are unknowns of their own, as those of a beam (`beam.Tangent`)."""

    element: Floating
    law: Array  # de/dq, shape (s, size)
    by_q: Array
    by_v: Array

    def force(self, q: Array, v: Array, stress: Array) -> tuple[Array, Array]:
        """The force that Newton's method sees, and what the stress lacks, e + tau e' - S."""
        e, slope = self.element._strains(q)
        gap = e + self.element.body.damping * (slope @ v) - stress
        return self.element._weight - stress @ slope - gap @ self.law, gap

    def change(self, q: Array, v: Array) -> Array:
        """Change of the stress with changes of coordinates and velocities."""
        return np.asarray(self.law @ (q + self.element.body.damping * v), dtype=float)


def frame_joint(element: Floating, linkage: Linkage, names: Sequence[str]) -> QuadraticJoint:
    """Rows that make the vectors a frame and hold bodies of the linkage at the interfaces, in their order.

    With the interface at Z, its displacement d and its turn w, both by the modes, and the pose (x_i, theta_i):

        x + Z a + sum d_k p_k = x_i,    (a + sum w_k p_k) x exp(i theta_i) = 0,    p_k x a = 0
    """
    body = element.body
    r, n = body.modes, element.size
    places = [3 * linkage.body_index[name] for name in names]
    angles = tuple(n + place + 2 for place in places)
    z = n + linkage.size + 2 * len(names)
    linear, sizes = np.zeros((3 * len(names) + 1 + r, z)), np.ones(3 * len(names) + 1 + r)
    products: list[tuple[int, int, int, float]] = []
    for i, place in enumerate(places):
        for k, factor in ((0, 1.0), (1, body.centres[i]), *((2 + k, d) for k, d in enumerate(body.shifts[i]))):
            _add(linear, 3 * i, 2 * k, complex(factor))
        linear[3 * i, n + place] = linear[3 * i + 1, n + place + 1] = -1.0
        sizes[3 * i : 3 * i + 2] = body.size
        cosine = n + linkage.size + 2 * i
        row = 3 * i + 2
        for at, w in ((2, 1.0), *((4 + 2 * k, w) for k, w in enumerate(body.turns[i]))):
            g, f = complex(w).real, complex(w).imag  # p x (c, s), and (i p) x (c, s) = -(p . (c, s))
            products += [(row, at, cosine + 1, g), (row, at + 1, cosine, -g)]
            products += [(row, at, cosine, -f), (row, at + 1, cosine + 1, -f)]
    first = 3 * len(names)
    constant = np.zeros(len(linear))
    products += [(first, 2, 2, 0.5), (first, 3, 3, 0.5)]
    constant[first] = -0.5
    for k in range(r):
        products += [(first + 1 + k, 4 + 2 * k, 3, 1.0), (first + 1 + k, 5 + 2 * k, 2, -1.0)]
    return QuadraticJoint(
        (element, linkage),
        linear,
        tuple(p for p in products if p[3]),
        constant,
        angles,
        sizes=sizes,
        name=f"{element.name}: frame",
    )


def _add(linear: Array, row: int, column: int, factor: complex) -> None:
    """factor times a vector, both complex, into two rows."""
    a, b = factor.real, factor.imag
    linear[row : row + 2, column : column + 2] += np.array([[a, -b], [b, a]])
