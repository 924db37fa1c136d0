r"""Harmonics that carriers couple in an elastic housing: the linear part of a train with turning carriers.

The bearings between shafts in the frame of a carrier, turned by :math:`\vartheta`, and bores that stand still are
springs with the forces

.. math:: f = \big[(\cos\vartheta - 1)\,P + \sin\vartheta\,Q\big]\,u

beside what the constant part has, that at :math:`\vartheta = 0` (`gearfe.drivetrain.train.forces.Turned`). They are
periodic with the rotation of the carrier, so each harmonic :math:`U_n` (n counts these rotations, mesh cycles are the
same) is coupled with its neighbours,

.. math:: F_n = -P U_n + \tfrac12(P - iQ)\,U_{n-1} + \tfrac12(P + iQ)\,U_{n+1} .

A damper acts in the axes of the housing. On the bore its force is the rate of a spring's force, so these rows have the
factor :math:`i\omega_n` of the force. On the shaft it has the rate of the bore, so these rows have the factor
:math:`i\omega_{n \pm 1}` of the motion. With the motion G that the constant part has without these forces,
:math:`U = G + H F`: Hill's method for an inhomogeneous system with periodic coefficients (Nayfeh & Mook, Nonlinear
Oscillations, Sec. 5.2). The equations are linear, with a block for each harmonic and its neighbours, and are solved at
once. What the rest of the balance sees is linear.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.typing import Array, BoolArray, ComplexArray, IntArray


@dataclass(frozen=True, eq=False)
class TurnedSpring:
    """A `train.forces.Turned` spring or damper at the freedoms.

    Parameters
    ----------
    freedoms : (4,)
        Numbers of those of its two directions that stand still, and of the two that turn.
    factors : (4,)
        Motion along its directions for unit motion of the freedoms.
    of_rates
        Whether it is a damper.
    phase
        Number of the phase that is the carrier's rotation.
    sense
        +1 or -1: the frame turns about the train's axis with this phase, or against it.
    """

    freedoms: IntArray
    factors: Array
    of_rates: bool
    phase: int
    sense: float

    def entries(self, theta: Array, rates: Array, size: int) -> list[tuple[IntArray, IntArray, Array]]:
        """Return derivatives of its forces with the motion.

        Parameters
        ----------
        theta : ndarray, shape (S, n)
            Phases (rad).
        rates : ndarray, shape (n,)
            Their rates (rad/s).
        size : int
            Number of freedoms: from there on columns count their rates.

        Returns
        -------
        entries : list of tuples
            Numbers of forces and of motions, and derivatives (S, entries).
        """
        turned = self.sense * theta[:, self.phase]
        cosine, sine = np.cos(turned), np.sin(turned)
        less = cosine - 1.0
        values = np.column_stack([less, -sine, sine, less, less, sine, -sine, less])
        rows, columns, scale = self.freedoms[ROWS], self.freedoms[COLUMNS], self.factors[ROWS] * self.factors[COLUMNS]
        entries = [(rows, columns + size * self.of_rates, values * scale)]
        if self.of_rates:  # on the bore, the rate of the rotation times the displacement
            speed = self.sense * float(rates[self.phase])
            values = speed * np.column_stack([-sine, -cosine, cosine, -sine])
            entries.append((rows[:4], columns[:4], values * scale[:4]))
        return entries

    def matrices(self, size: int) -> tuple[Array, Array]:
        """Return P and Q (size, size) along the phase; rates are left out."""
        cosine, sine = np.zeros((size, size)), np.zeros((size, size))
        rows, columns = self.freedoms[ROWS], self.freedoms[COLUMNS]
        values = self.factors[ROWS] * self.factors[COLUMNS]
        np.add.at(cosine, (rows, columns), values * OF_COSINE)
        np.add.at(sine, (rows, columns), values * OF_SINE * self.sense)
        return cosine, sine


#: Entries of a spring: numbers of force and motion among its four directions, and factors of cosine and sine.
ROWS, COLUMNS = np.array([0, 0, 1, 1, 2, 2, 3, 3]), np.array([2, 3, 2, 3, 0, 1, 0, 1])
OF_COSINE, OF_SINE = np.array([1, 0, 0, 1, 1, 0, 0, 1]), np.array([0, -1, 1, 0, 0, 1, -1, 0])


@dataclass(frozen=True, eq=False)
class Coupling:
    """Equations of the freedoms of turned springs at the harmonics 0 to K.

    Attributes
    ----------
    freedoms : (t,)
        Numbers of the freedoms.
    harmonic : (N,)
        Harmonic of each block: all of them, and of those without mesh cycles their conjugates, too.
    conjugate : (N,)
        Which blocks have the conjugate amplitudes.
    factor : (N,)
        Amplitude of a block over that of its harmonic: two-sided ones are half.
    way : (K + 1, m, t)
        Flexibility: motion for forces along the freedoms.
    forces : sparse (N t, N t)
        Motion to forces.
    solve
        Motion without the springs to motion.
    """

    freedoms: IntArray
    harmonic: IntArray
    conjugate: BoolArray
    factor: Array
    way: ComplexArray
    forces: Any
    solve: Any

    def __call__(self, places: ComplexArray) -> ComplexArray:
        """Motion (K + 1, m) with the springs, for that without them."""
        count, t = len(self.way), len(self.freedoms)
        inner = places[:, self.freedoms][self.harmonic] * self.factor[:, None]
        inner[self.conjugate] = inner[self.conjugate].conj()
        forces = (self.forces @ self.solve(inner.ravel())).reshape(-1, t)[:count]
        turned = self.conjugate[:count]
        forces[turned] = forces[turned].conj()
        return np.asarray(places + (self.way @ (forces / self.factor[:count, None])[..., None])[..., 0])


def coupling(
    springs: Sequence[TurnedSpring], waves: IntArray, carriers: int, omega: Array, flexibility: ComplexArray
) -> Coupling:
    """Set up the equations of turned springs.

    Parameters
    ----------
    springs : sequence of TurnedSpring
        The springs and dampers.
    waves : ndarray, shape (K + 1, n)
        Numbers k of the harmonics.
    carriers : int
        So many of the last phases are rotations of carriers.
    omega : ndarray, shape (K + 1,)
        Angular frequencies (rad/s).
    flexibility : ndarray of complex, shape (K + 1, m, m)
        H at the harmonics, of the constant part.
    """
    from scipy.sparse import csc_array  # only trains with an elastic housing and turning carriers need it
    from scipy.sparse.linalg import splu

    freedoms = np.unique(np.concatenate([spring.freedoms for spring in springs]))
    t, meshes = len(freedoms), waves.shape[1] - carriers
    of_meshes = waves[:, :meshes]
    first = of_meshes[np.arange(len(waves)), (of_meshes != 0).argmax(axis=1)] if meshes else np.zeros(len(waves))
    conjugate = first < 0
    both = np.flatnonzero(~of_meshes.any(axis=1))[1:]  # without mesh cycles: n and -n belong to the same equations
    harmonic = np.concatenate([np.arange(len(waves)), both])
    conjugate = np.concatenate([conjugate, np.ones(len(both), dtype=bool)])
    signs = np.where(conjugate, -1, 1)
    vectors, frequency = signs[:, None] * waves[harmonic], signs * omega[harmonic]
    number = {tuple(vector): n for n, vector in enumerate(vectors.tolist())}
    own = flexibility[:, freedoms[:, None], freedoms][harmonic]
    own[conjugate] = own[conjugate].conj()
    # by phase: of springs, and of dampers on bores (rates of forces) and on shafts (of rates)
    parts: dict[tuple[int, str], tuple[Array, Array]] = {}
    for spring in springs:
        local = np.searchsorted(freedoms, spring.freedoms)
        matrices = TurnedSpring(local, spring.factors, spring.of_rates, spring.phase, spring.sense).matrices(t)
        groups = {"bore": local[:2], "shaft": local[2:]} if spring.of_rates else {"spring": local}
        for group, among in groups.items():
            totals = parts.setdefault((spring.phase, group), (np.zeros((t, t)), np.zeros((t, t))))
            for total, of_spring in zip(totals, matrices, strict=True):
                total[among] += of_spring[among]
    rows, columns, blocks = list[IntArray](), list[IntArray](), list[ComplexArray]()
    for (phase, group), (P, Q) in parts.items():
        for step, block in ((0, -P), (-1, 0.5 * (P - 1j * Q)), (1, 0.5 * (P + 1j * Q))):
            other = vectors.copy()
            other[:, phase] += step
            met = [(n, number[key]) for n, key in enumerate(map(tuple, other.tolist())) if key in number]
            row, column = np.array(met, dtype=np.int64).reshape(-1, 2).T
            rates = {"bore": 1j * frequency[row], "shaft": 1j * frequency[column]}.get(group, np.ones(len(row)))
            rows.append(row)
            columns.append(column)
            blocks.append(np.asarray(rates[:, None, None] * block, dtype=complex))
    row, column, block = np.concatenate(rows), np.concatenate(columns), np.concatenate(blocks)

    def matrix(values: ComplexArray) -> Any:
        at = np.arange(t)
        i = np.broadcast_to(row[:, None, None] * t + at[:, None], values.shape)
        j = np.broadcast_to(column[:, None, None] * t + at, values.shape)
        return csc_array((values.ravel(), (i.ravel(), j.ravel())), shape=(len(harmonic) * t,) * 2)

    forces = matrix(block)
    whole = matrix(-(own[row] @ block))
    whole.setdiag(whole.diagonal() + 1.0)
    factor = np.where(harmonic == 0, 1.0, 0.5)
    way = np.ascontiguousarray(flexibility[:, :, freedoms])
    return Coupling(freedoms, harmonic, conjugate, factor, way, forces, splu(whole.tocsc()).solve)
