r"""Mesh law with a potential: each tooth pair a compliance, neighbouring pairs coupled.

With the pinion angle :math:`\varphi`, the approach :math:`\delta` of the gears along the line of action and
:math:`\psi_k = \varphi + 2\pi k/z_1` of tooth pair k, the elastic energy is

.. math::
    W(\varphi, \delta) = \max_{F_k \ge 0} \sum_k \big[F_k\,(\delta - t(\psi_k)) - \Phi(\psi_k, F_k)\big]
    - \sum_{k<l} C_{l-k}(\psi_k)\,F_k F_l ,

t is the approach at which the rigid flanks of a pair touch; it contains transmission error and reliefs. :math:`\Phi` is
the pair's complementary energy, and C the compliance of the gear bodies that pairs share. Where the maximum lies,

.. math::
    t(\psi_k) + \Lambda(\psi_k, F_k) + \sum_{l \ne k} C_{|k-l|} F_l = \delta,\qquad
    \Lambda = \partial\Phi/\partial F

for the loaded pairs, and the derivatives of W need none of :math:`F_k`:

.. math::
    F = \frac{\partial W}{\partial\delta} = \sum_k F_k,\qquad
    M = \frac{\partial W}{\partial\varphi} = -\sum_k\big[F_k t'(\psi_k) + \Phi_\psi(\psi_k, F_k)\big]
    - \sum_{k<l} C_{l-k}' F_k F_l,

.. math::
    \frac{\partial F}{\partial\delta} = 1^T J^{-1} 1,\quad J = \mathrm{diag}(\Lambda_F) + C .

On the driver acts the torque :math:`-r_{b1} F - M`, on the driven gear :math:`r_{b2} F`. :math:`\Phi` is a polynomial
on each cell of phase and pair force, so the law has Taylor series. It consists of cubic splines over the phase, and is
of degree 4 over the force (:math:`\Lambda` is cubic, with continuous slope).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...base.typing import Array, BoolArray, IntArray
from ...multibody.compiled.packed import Packed
from . import law_kernel
from .load_search import Response, approach_of_force

#: Approach (m) at which flanks touch that do not meet at all.
NO_CONTACT = 1.0
#: Places in each cell, in parts of its width, at which matrices are looked at.
SAMPLES = np.linspace(0.0, 1.0, 5)


class MeshForces(NamedTuple):
    """The law at n places.

    Attributes
    ----------
    force : ndarray, shape (n,)
        F (N), along the line of action; NaN where angle or approach are not finite.
    moment : ndarray, shape (n,)
        M (N m), derivative of the energy with the pinion angle.
    tangent : ndarray, shape (n,)
        dF/d approach (N/m).
    cross : ndarray, shape (n,)
        dF/d angle (N/rad), and dM/d approach.
    bend : ndarray, shape (n,)
        dM/d angle (N m/rad).
    energy : ndarray, shape (n,)
        W (J).
    beyond : ndarray of bool, shape (n,)
        Farther than the law is known.
    pair_forces : ndarray, shape (n, slots)
        F_k (N); slot s holds the pair of psi between s and s + 1 mesh cycles from the law's first node.
    pair_slopes : ndarray, shape (2, n, slots)
        Their derivatives with approach and angle.
    """

    force: Array
    moment: Array
    tangent: Array
    cross: Array
    bend: Array
    energy: Array
    beyond: BoolArray
    pair_forces: Array
    pair_slopes: Array


@dataclass(frozen=True, eq=False)
class MeshLaw:
    """Law of a gear pair's driving flanks; s slots for tooth pairs, n cells of the phase, m of the pair force.

    Parameters
    ----------
    nodes : ndarray, shape (n + 1,)
        Pinion angles (rad) between which the law is a polynomial; the last is the first plus a mesh cycle.
    forces : ndarray, shape (m + 1,)
        Pair forces (N) between which the law is a polynomial, from 0.
    touch : ndarray, shape (s, n, 4)
        Coefficients of t over the angle from the cell's first node (m, m/rad, ...).
    energies : ndarray, shape (s, n, m, 4, 5)
        Coefficients of the complementary energy over that angle and the force from the cell's first one (J, ...).
    coupling : ndarray, shape (s - 1, s - 1, n, 4)
        Coefficients of C over that angle for pairs one, two, ... teeth apart, by the slot of the lower pair (m/N, ...).
    base_radii
        Of pinion and wheel (m).
    backlash
        Normal backlash of the pair's geometry (m).
    reach
        Approach beyond the first contact (m) up to which the law is known.
    error
        Estimate of the relative error of its forces; NaN where there is none.
    back
        Law of the back flanks, of the pair seen from behind; None: they are the mirror image of the driving ones.
    """

    nodes: Array
    forces: Array
    touch: Array
    energies: Array
    coupling: Array
    base_radii: tuple[float, float]
    backlash: float
    reach: float
    error: float = math.nan
    back: MeshLaw | None = None

    def stiffer(self, part: float) -> MeshLaw:
        """All forces larger by a part of themselves at the same approach."""
        factor = 1.0 + part
        return replace(
            self,
            forces=factor * self.forces,
            energies=self.energies * factor ** (1.0 - np.arange(5)),
            coupling=self.coupling / factor,
            back=None if self.back is None else self.back.stiffer(part),
        )

    @property
    def sides(self) -> tuple[MeshLaw, MeshLaw]:
        """Of the driving flanks, and of the back flanks at the mirrored phase."""
        return self, self.back or self

    @property
    def cycle(self) -> float:
        """Pinion angle from one tooth to the next (rad)."""
        return float(self.nodes[-1] - self.nodes[0])

    @property
    def slots(self) -> int:
        """Most tooth pairs that are looked at."""
        return len(self.touch)

    @cached_property
    def largest_force(self) -> float:
        """Mesh force (N) up to which the law is known at every phase."""
        angles = self.nodes[0] + self.cycle * np.linspace(0.0, 1.0, 10 * len(self.nodes))
        return 0.999 * float(self.most(angles).min())

    def most(self, angles: ArrayLike, shifts: ArrayLike = 0.0) -> Array:
        """Mesh force (N) up to which the law is known at pinion angles (n,); `shifts` as in `__call__`."""
        return self(angles, self.first_contact(angles, shifts) + self.reach, shifts).force

    @cached_property
    def convex(self) -> bool:
        """Whether J is positive definite at all forces of the law, so that pair forces are unique."""
        z = SAMPLES[:, None] * np.diff(self.nodes)
        f = SAMPLES[:, None] * np.diff(self.forces)
        rises = np.stack([0 * f, 0 * f, 2.0 + 0 * f, 6.0 * f, 12.0 * f**2])
        slope = np.einsum("snmab,azn,bfm->snmzf", self.energies, z ** np.arange(4)[:, None, None], rises)
        return bool(slope.min() > indefinite(self.coupling, np.diff(self.nodes)))

    def locate(self, angles: Array) -> tuple[IntArray, IntArray, Array]:
        """Mesh cycle, cell and angle beyond its first node (rad)."""
        turn = np.floor((angles - self.nodes[0]) / self.cycle)
        rest = angles - turn * self.cycle
        cell = np.clip(np.searchsorted(self.nodes, rest, side="right") - 1, 0, len(self.nodes) - 2)
        return turn.astype(np.int64), cell, rest - self.nodes[cell]

    def pair_phases(self, angles: ArrayLike) -> Array:
        """psi_k (rad) of the pairs in the slots at pinion angles (n,), shape (n, slots)."""
        angle = np.asarray(angles, dtype=float)
        made: Array = angle[:, None] + self.cycle * (np.arange(self.slots) - self.locate(angle)[0][:, None])
        return made

    def pair_numbers(self, angles: ArrayLike) -> IntArray:
        """Numbers k of the tooth pairs in the slots at pinion angles (n,), shape (n, slots)."""
        return np.asarray(np.arange(self.slots) - self.locate(np.asarray(angles, dtype=float))[0][:, None])

    def first_contact(self, angles: ArrayLike, shifts: ArrayLike = 0.0) -> Array:
        """Approach (m) at which the first pair touches; `shifts` as in `__call__`."""
        first: Array = self.pair_touches(angles, shifts).min(axis=1)
        return first

    def pair_touches(self, angles: ArrayLike, shifts: ArrayLike = 0.0) -> Array:
        """Approaches (m) at which the pairs in the slots touch at pinion angles (n,), shape (n, slots)."""
        _, cell, z = self.locate(np.asarray(angles, dtype=float))
        touch: Array = _powers(self.touch[:, cell], z[None])[0].T + np.asarray(shifts, dtype=float)
        return touch

    def __call__(
        self, angles: ArrayLike, approaches: ArrayLike, shifts: ArrayLike = 0.0, begin: Array | None = None
    ) -> MeshForces:
        """Forces at pinion angles (rad) and approaches (m), both of shape (n,).

        Parameters
        ----------
        shifts : array_like, shape (n, slots)
            Further approach (m) at which each pair touches, such as its pitch error.
        begin : ndarray, shape (n, slots)
            Initial pair forces (N), replaced by those that are found.
        """
        places = np.empty((2, max(np.size(angles), np.size(approaches))))
        places[0], places[1] = angles, approaches
        later = np.empty((places.shape[1], self.slots))
        later[...] = shifts
        pairs = np.zeros_like(later) if begin is None else begin
        out, slopes = law_kernel.evaluate(_tables(self), places[0], places[1], later, pairs)
        force, moment, tangent, cross, bend, energy, beyond = out.T
        return MeshForces(force, moment, tangent, cross, bend, energy, beyond > 0.0, pairs, slopes)

    def approach(self, angles: ArrayLike, forces: ArrayLike, shifts: ArrayLike = 0.0) -> Array:
        """Approach (m) that makes a mesh force (N): static transmission error under load; `shifts` as in `__call__`.

        Raises
        ------
        InputError
            For a force beyond what the law is known for.
        """
        angle, force = np.broadcast_arrays(
            np.atleast_1d(np.asarray(angles, dtype=float)), np.asarray(forces, dtype=float)
        )
        later = np.broadcast_to(np.asarray(shifts, dtype=float), (len(angle), self.slots))

        def evaluate(numbers: IntArray, approaches: Array) -> Response:
            forces = self(angle[numbers], approaches, later[numbers])
            return Response(forces.force, forces.tangent)

        most = self.most(angle, later)
        return approach_of_force(evaluate, force, self.first_contact(angle, later), most, self.reach)


def indefinite(coupling: Array, widths: Array) -> float:
    """Largest -lambda (m/N), lambda the least eigenvalue of the matrices C, whose diagonal is zero, at all phases.

    Where every dLambda/dF is larger, J = diag(dLambda/dF) + C is positive definite.

    Parameters
    ----------
    coupling : ndarray, shape (s - 1, s - 1, n, 4)
        As in `MeshLaw`.
    widths : ndarray, shape (n,)
        Of the cells of the phase (rad).
    """
    slots, z = coupling.shape[1] + 1, SAMPLES[:, None] * widths
    values = np.einsum("klna,azn->znkl", coupling, z ** np.arange(4)[:, None, None])
    C = np.zeros((*z.shape, slots, slots))
    for apart in range(1, slots):
        for low in range(slots - apart):
            C[..., low, low + apart] = C[..., low + apart, low] = values[..., apart - 1, low]
    return -float(np.linalg.eigvalsh(C)[..., 0].min())


@lru_cache(maxsize=64)
def _tables(law: MeshLaw) -> law_kernel.LawTables | Packed:
    """What the kernel gets of a law."""
    energies = law.energies.swapaxes(3, 4)
    found = (law.nodes, law.forces, law.touch, energies, law.coupling)
    nodes, forces, touch, energies, coupling = (np.ascontiguousarray(x, dtype=float) for x in found)
    return law_kernel.packed_tables(law_kernel.LawTables(nodes, forces, touch, energies, coupling, law.reach))


def _powers(c: Array, z: Array) -> tuple[Array, Array]:
    """Value and slope of cubics at z."""
    value = c[..., 0] + z * (c[..., 1] + z * (c[..., 2] + z * c[..., 3]))
    return value, c[..., 1] + z * (2 * c[..., 2] + 3 * z * c[..., 3])


class Laws(NamedTuple):
    """l mesh laws, filled up to the largest, for compiled recurrences: see `MeshLaw`."""

    cells: IntArray  # (l,) cells of the phase
    parts: IntArray  # (l,) cells of the pair force
    nodes: Array  # (l, n + 1)
    forces: Array  # (l, m + 1)
    touch: Array  # (l, s, n, 4)
    energies: Array  # (l, s, n, m, 5, 4)
    coupling: Array  # (l, s s, n, 4) lower slot times s plus upper slot


def stacked_laws(laws: Sequence[MeshLaw]) -> Laws:
    """Arrays of mesh laws, side by side."""
    count, sizes = len(laws), [(law.slots, len(law.nodes) - 1, len(law.forces) - 1) for law in laws]
    slots, cells, parts = (max((size[i] for size in sizes), default=1) for i in range(3))
    made = Laws(
        np.array([size[1] for size in sizes], dtype=np.int64),
        np.array([size[2] for size in sizes], dtype=np.int64),
        np.zeros((count, cells + 1)),
        np.zeros((count, parts + 1)),
        np.zeros((count, slots, cells, 4)),
        np.zeros((count, slots, cells, parts, 5, 4)),
        np.zeros((count, slots * slots, cells, 4)),
    )
    made.touch[..., 0] = NO_CONTACT
    for i, (law, (s, n, m)) in enumerate(zip(laws, sizes, strict=True)):
        made.nodes[i, : n + 1], made.forces[i, : m + 1] = law.nodes, law.forces
        made.touch[i, :s, :n], made.energies[i, :s, :n, :m] = law.touch, law.energies.swapaxes(3, 4)
        for low in range(s - 1):
            for up in range(low + 1, s):
                made.coupling[i, low * slots + up, :n] = law.coupling[up - low - 1, low]
    return made
