"""Flexible links: geometrically exact (Reissner) planar beams whose nodes are bodies of the linkage.

A section at the arc length s of the straight, unloaded axis has the place r(s) = (x, y) and the angle theta(s). With
t = (cos theta, sin theta) and n a quarter turn ahead, the strains of axis, shear and bending, and the energy, are

    Gamma = r' . t - 1,   gamma = r' . n,   kappa = theta',
    U = 1/2 int EA Gamma^2 + GA_s gamma^2 + EI kappa^2 ds

for displacements and rotations of any size (Reissner, ZAMP 23 (1972) 795-804; Simo & Vu-Quoc, J. Appl. Mech. 53 (1986)
849-863). x, y and theta are interpolated by cubics, so the mass matrix is constant. Integrals use three Gauss points
per element, with which thin beams do not lock. Damping is Kelvin's and Voigt's: every strain e counts as e + tau e'.

Every node is a body without mass of its own; what mass it has is in the mass matrix of the beam. Joints and forces of
the linkage so hold at any node. At a Gauss point z = (x', y', theta, theta') = P q is linear in the coordinates. Forces
are -P^T s(P q, P q'), tangents P^T k P, with the law of one point in closed form.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...base.typing import Array, IntArray
from ..core.contract import Element
from .beam_link import NODES, BeamLink
from .linkage import Linkage
from .turning import field_and_rate

if TYPE_CHECKING:
    from ..series.tape import Tape

#: Gauss points of an element on -1..1 with their weights.
GAUSS, WEIGHTS = np.polynomial.legendre.leggauss(3)


class Strains(NamedTuple):
    """Strains at points of the axis and what belongs to them, in the order axial, shear, bending."""

    value: Array  # (points, 3)
    slope: Array  # (points, 3, 4) by z = (x', y', theta, theta')
    bend: Array  # (points, 3, 4, 4) second derivatives


class Beam(Element):
    """Mass, elasticity, damping and weight of a flexible link on the bodies of a linkage that are its nodes.

    Parameters
    ----------
    linkage : Linkage
        Has the link's `BeamLink.nodes` among its bodies.
    link : BeamLink
        What it is.
    """

    stiff = True

    def __init__(self, linkage: Linkage, link: BeamLink) -> None:
        self.link, self.name, self.touches = link, f"flexible link {link.name!r}", (linkage,)
        self.places: IntArray = np.array([3 * linkage.body_index[n] + k for n in link.node_names for k in range(3)])
        self._size = linkage.size
        shear = link.young_modulus / (2.0 * (1.0 + link.poisson_ratio)) * link.section.shear_factor
        area, second = link.section.area, link.section.second_moment
        self.stiffness = np.array([link.young_modulus * area, shear * area, link.young_modulus * second])
        half = 0.5 * np.diff(link.ends)
        #: Arc lengths of the Gauss points (m).
        self.points = (0.5 * (link.ends[:-1] + link.ends[1:])[:, None] + half[:, None] * GAUSS).ravel()
        self.weights = (half[:, None] * WEIGHTS).ravel()
        N, D = self.shapes(self.points)
        self._to_points = _gather(N, D)  # P, shape (points, 4, 3 nodes)
        own = self._own_mass()
        self._mass = np.zeros((self._size, self._size))
        self._mass[np.ix_(self.places, self.places)] = own
        field, self._rate = field_and_rate(linkage)
        self._weight = own @ np.tile([*field, 0.0], len(link.stations))

    def shapes(self, s: Array) -> tuple[Array, Array]:
        """Shape functions and their derivatives by the arc length at the places s; shapes (places, nodes)."""
        ends = self.link.ends
        element = np.clip(np.searchsorted(ends, s, side="right") - 1, 0, len(ends) - 2)
        half = 0.5 * np.diff(ends)[element]
        local = (s - 0.5 * (ends[element] + ends[element + 1])) / half
        N, D = np.zeros((2, len(s), len(self.link.stations)))
        for j, polynomial in enumerate(_LAGRANGE):
            N[np.arange(len(s)), 3 * element + j] = polynomial(local)
            D[np.arange(len(s)), 3 * element + j] = polynomial.deriv()(local) / half
        return N, D

    def _own_mass(self) -> Array:
        """rho A int N N^T for x and y, rho I for theta: the integrals of sixth degree are exact."""
        points, weights = np.polynomial.legendre.leggauss(4)
        half = 0.5 * np.diff(self.link.ends)
        at = (0.5 * (self.link.ends[:-1] + self.link.ends[1:])[:, None] + half[:, None] * points).ravel()
        N = self.shapes(at)[0]
        shared = self.link.density * (N.T * (half[:, None] * weights).ravel()) @ N
        section = self.link.section
        return np.kron(shared, np.diag([section.area, section.area, section.second_moment]))

    def shared_mass(self) -> Array:
        """Mass on the coordinates of the linkage, constant."""
        return self._mass

    def blocks(self) -> tuple[Array, Array] | None:
        """Centrifugal and Coriolis forces of a turning frame."""
        if not self._rate:
            return None
        along, ahead = np.diag([1.0, 1.0, 0.0]), np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
        nodes = np.eye(self._size // 3)
        damping, stiffness = -2.0 * self._rate * np.kron(nodes, ahead), -(self._rate**2) * np.kron(nodes, along)
        return self._mass @ damping, self._mass @ stiffness

    def strains(self, z: Array) -> Strains:
        """Strains at points with z = (x', y', theta, theta'), shape (points, 4)."""
        dx, dy, c, s = z[:, 0], z[:, 1], np.cos(z[:, 2]), np.sin(z[:, 2])
        stretch, shear = c * dx + s * dy, c * dy - s * dx
        slope, bend = np.zeros((len(z), 3, 4)), np.zeros((len(z), 3, 4, 4))
        slope[:, 0, 0] = slope[:, 1, 1] = c
        slope[:, 0, 1], slope[:, 1, 0] = s, -s
        slope[:, 0, 2], slope[:, 1, 2], slope[:, 2, 3] = shear, -stretch, 1.0
        bend[:, 0, 0, 2], bend[:, 0, 1, 2], bend[:, 0, 2, 2] = -s, c, -stretch
        bend[:, 1, 0, 2], bend[:, 1, 1, 2], bend[:, 1, 2, 2] = -c, -s, -shear
        bend[:, :2, 2, :2] = bend[:, :2, :2, 2]
        return Strains(np.stack([stretch - 1.0, shear, z[:, 3]], axis=1), slope, bend)

    def force(self, t: float, q: Array, v: Array) -> Array:  # noqa: ARG002
        """Forces of the strains and their rates, and the weight."""
        z, dz = self._at_points(q), self._at_points(v)
        e = self.strains(z)
        stress = self._stress(e, dz)
        return self._force(np.einsum("pi,pij->pj", stress, e.slope))

    def force_jacobian(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:  # noqa: ARG002
        """Return the derivatives of the force by q and v."""
        tangent = self.tangent(q, v, self.stress(q, v))
        return tangent.by_q, tangent.by_v

    def tangent(self, q: Array, v: Array, stress: Array) -> Tangent:
        """Derivatives of the forces about a state, for stresses of their own, shape (points, 3)."""
        z, dz = self._at_points(q), self._at_points(v)
        e, tau = self.strains(z), self.link.damping
        law = self.stiffness[:, None] * e.slope
        weighted = self.weights[:, None, None] * e.slope.transpose(0, 2, 1)
        by_q = weighted @ (law + tau * self.stiffness[:, None] * np.einsum("pijk,pk->pij", e.bend, dz))
        by_q += np.einsum("pi,pijk->pjk", stress * self.weights[:, None], e.bend)
        return Tangent(self, law, self._spread(-by_q), self._spread(-tau * (weighted @ law)))

    def write(self, tape: Tape, places: IntArray) -> bool:
        """Write points and weight on a tape."""
        own = places[self.places]
        tape.constant[own] += self._weight
        N, D = self.shapes(self.points)
        nodes = 3 * np.repeat(np.arange(len(self.link.ends) - 1), len(GAUSS))[:, None] + np.arange(4)
        shape, slope = (np.take_along_axis(values, nodes, axis=1) for values in (N, D))
        tape.bars(own[3 * nodes], shape, slope, self.weights, self.stiffness, self.link.damping)
        return True

    def stress(self, q: Array, v: Array) -> Array:
        """Axial force (N), shear force (N) and bending moment (N m) at the Gauss points, shape (points, 3)."""
        z, dz = self._at_points(q), self._at_points(v)
        return self._stress(self.strains(z), dz)

    @cached_property
    def _to_nodes(self) -> Array:
        """Values at the nodes of the parabolas through those at the Gauss points; means where elements meet."""
        count, n = len(self.link.ends) - 1, len(self.link.stations)
        inside = np.array([[p(x) for p in _lagrange(GAUSS)] for x in NODES])
        out, shares = np.zeros((n, 3 * count)), np.zeros(n)
        for e in range(count):
            out[3 * e : 3 * e + 4, 3 * e : 3 * e + 3] += inside
            shares[3 * e : 3 * e + 4] += 1.0
        return out / shares[:, None]

    def at_nodes(self, stress: Array) -> Array:
        """Axial force (N), shear force (N), bending moment (N m) at the nodes from those at the Gauss points.

        Shapes (times, nodes, 3) and (times, points, 3). Where two elements meet the mean of both: the axial force of a
        point that carries a load lies between those of its sides.
        """
        return np.einsum("np,tpk->tnk", self._to_nodes, stress)

    def potential(self, q: Array) -> Array:
        """Elastic energy and that of the weight (J) in states (..., n)."""
        return np.asarray(self.elastic_energy(q) - q[..., self.places] @ self._weight)

    def elastic_energy(self, q: Array) -> Array:
        """1/2 int EA Gamma^2 + GA gamma^2 + EI kappa^2 ds (J) in states (..., n)."""
        e = self.strains(self._at_points(q)).value
        return 0.5 * (e**2 @ self.stiffness).reshape(*q.shape[:-1], -1) @ self.weights

    def loss(self, q: Array, v: Array) -> Array:
        """Power that damping takes (W) in states (..., n)."""
        rates = np.einsum("pij,pj->pi", self.strains(self._at_points(q)).slope, self._at_points(v))
        return self.link.damping * (rates**2 @ self.stiffness).reshape(*q.shape[:-1], -1) @ self.weights

    def _stress(self, e: Strains, dz: Array) -> Array:
        rates = np.einsum("pij,pj->pi", e.slope, dz) if self.link.damping else 0.0
        return (e.value + self.link.damping * rates) * self.stiffness

    def _force(self, pull: Array) -> Array:
        """Weight less P^T of the pull (points, 4) of the stresses."""
        out = np.zeros(self._size)
        weighted = (pull * self.weights[:, None]).ravel()
        out[self.places] = self._weight - weighted @ self._to_points.reshape(-1, len(self.places))
        return out

    def _at_points(self, q: Array) -> Array:
        return (q[..., self.places] @ self._to_points.reshape(-1, len(self.places)).T).reshape(-1, 4)

    def _spread(self, blocks: Array) -> Array:
        """P^T blocks P on the coordinates of the linkage."""
        P = self._to_points
        n = len(self.places)
        out = np.zeros((self._size, self._size))
        out[np.ix_(self.places, self.places)] = P.reshape(-1, n).T @ (blocks @ P).reshape(-1, n)
        return out


@dataclass(frozen=True)
class Tangent:
    """Forces of a beam whose stresses S are unknowns of their own, for Newton's method with one matrix.

    S and the coordinates are found together from f = -B(q)^T S and C e(q) - S = 0, linearised as f' and C B about one
    state. With B from one state, and the stress of a wrong strain instead of S, the matrix would only hold for
    rotations without axial strain. In a thin link these are thousandths of a degree. (Mixed integration points:
    Magisano, Leonetti & Garcea, Int. J. Numer. Meth. Engng 109 (2017) 1237-1262.)
    """

    beam: Beam
    law: Array  # C B, shape (points, 3, 4)
    by_q: Array
    by_v: Array

    def force(self, q: Array, v: Array, stress: Array) -> tuple[Array, Array]:
        """The force that Newton's method sees, and what the stress lacks, C e(q) - S."""
        beam = self.beam
        dz = beam._at_points(v)
        e = beam.strains(beam._at_points(q))
        gap = beam._stress(e, dz) - stress
        pull = np.einsum("pi,pij->pj", stress, e.slope) + np.einsum("pi,pij->pj", gap / beam.stiffness, self.law)
        return beam._force(pull), gap

    def change(self, q: Array, v: Array) -> Array:
        """Change of the stress with changes of coordinates and velocities."""
        beam = self.beam
        moved = beam._at_points(q + beam.link.damping * v)
        return np.einsum("pij,pj->pi", self.law, moved)


def _gather(N: Array, D: Array) -> Array:
    """Return P from (x, y, theta) of the nodes to (x', y', theta, theta') at the points, shape (points, 4, 3 nodes)."""
    P = np.zeros((len(N), 4, N.shape[1], 3))
    P[:, 0, :, 0] = P[:, 1, :, 1] = P[:, 3, :, 2] = D
    P[:, 2, :, 2] = N
    return P.reshape(len(N), 4, -1)


def _lagrange(nodes: Array) -> list[np.polynomial.Polynomial]:
    """Polynomials that are 1 at one node and 0 at the others."""
    polynomials = []
    for j, own in enumerate(nodes):
        others = np.delete(nodes, j)
        polynomials.append(np.polynomial.Polynomial.fromroots(others) / float(np.prod(own - others)))
    return polynomials


_LAGRANGE = _lagrange(NODES)
