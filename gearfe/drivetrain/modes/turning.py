r"""Eigenvalue problem of a train that turns at a steady speed.

.. math::
    \ddot y + D\dot y + \Lambda y = \Omega\,G\dot y, \qquad
    \frac{d}{dt}\begin{pmatrix} w\\ \dot y\end{pmatrix} =
    \begin{pmatrix} 0 & \Lambda^{1/2}\\ -\Lambda^{1/2} & \Omega G - D\end{pmatrix}
    \begin{pmatrix} w\\ \dot y\end{pmatrix}, \qquad w = \Lambda^{1/2}y

y are the modal coordinates of unit mass of the train at rest, with the mean stiffness of its meshes. G has the
gyroscopic moments for unit speed of the drive. Carriers add :math:`\Omega^2 S y` on the right, the centrifugal forces
of their frames, and :math:`\Omega N y`, the forces of dampers in fixed axes on motions in the turning frames. G then
contains the Coriolis forces. The squared length of a state is twice its energy. Without damping and carriers the matrix
is skew: modes of one speed are orthogonal in energy, and :math:`d\lambda/d\Omega = x^H B x` with
:math:`B = diag(0, G)`.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...base.typing import Array, ComplexArray
from ..train.model import TrainModel

#: Squares of frequencies below this part of the largest are round-off: such a motion is free.
ROUND_OFF = 1e-12
#: Eigenvalues nearer to each other, in parts of their size, are one: round-off of the eigenvalues of such matrices.
EQUAL = 1e-9


class Poles(NamedTuple):
    """Modes that swing at one speed, k of them."""

    values: ComplexArray  # (k,) 1/s, imaginary parts > 0
    vectors: ComplexArray  # (2n, k) states of unit length
    slopes: ComplexArray  # (k,) derivative of the values with the speed of the drive


@dataclass(frozen=True, eq=False)
class TurningTrain:
    """A train at steady speeds in n modal coordinates.

    Attributes
    ----------
    squares : (n,)
        Squares of the natural frequencies at rest (rad2/s2).
    damping, gyroscopic, stiffening, circulating : (n, n)
        D (1/s), G and N for unit speed of the drive, and S for its square.
    kinds : (n, n)
        A weight of the kinetic energies of the parts, different for each. Of modes that agree in all speeds, those that
        belong to different parts are taken.
    """

    squares: Array
    damping: Array
    gyroscopic: Array
    stiffening: Array
    circulating: Array
    kinds: Array

    @cached_property
    def rates(self) -> Array:
        """(n,) natural frequencies at rest (rad/s); 0 of free motions."""
        least = ROUND_OFF * float(self.squares.max(initial=0.0))
        return np.sqrt(np.where(self.squares > least, self.squares, 0.0))

    @property
    def free(self) -> int:
        """Number of motions that nothing holds."""
        return int((self.rates == 0.0).sum())

    def poles(self, speed: float) -> Poles:
        """Modes at a speed of the drive (rad/s)."""
        n, stiff = len(self.rates), np.diag(self.rates)
        below = -stiff
        carried = speed**2 * self.stiffening + speed * self.circulating
        if carried.any():
            below = below + carried @ np.linalg.pinv(stiff)
        A = np.block([[np.zeros((n, n)), stiff], [below, speed * self.gyroscopic - self.damping]])
        values, vectors = np.linalg.eig(A)
        least = np.sqrt(ROUND_OFF) * float(self.rates.max(initial=0.0))
        chosen = np.flatnonzero(values.imag > least)
        chosen = chosen[np.argsort(values.imag[chosen], kind="stable")]
        values, vectors = values[chosen].astype(complex), vectors[:, chosen].astype(complex)
        vectors = self._separated(values, vectors / np.linalg.norm(vectors, axis=0))
        rates = vectors[n:]
        return Poles(values, vectors, (rates.conj() * (self.gyroscopic @ rates)).sum(axis=0))

    def coordinates(self, values: ComplexArray, vectors: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Modal coordinates and their rates, (n, k) each, of states (2n, k) with the eigenvalues (k,)."""
        n = len(self.rates)
        rate = vectors[n:]
        return rate / np.where(values == 0.0, 1.0, values), rate

    def _separated(self, values: ComplexArray, vectors: ComplexArray) -> ComplexArray:
        """Vectors of equal eigenvalues as those that the modes have as the speed changes, orthogonal to each other."""
        for together in _clusters(values):
            basis = np.linalg.qr(vectors[:, together])[0]
            vectors[:, together] = self._split(basis, [-1j * self.gyroscopic, self.kinds])
        return vectors

    def _split(self, basis: ComplexArray, weights: list[ComplexArray]) -> ComplexArray:
        """Columns that diagonalise the first Hermitian weight of rates; those that it leaves equal, the next one."""
        if not weights or basis.shape[1] == 1:
            return basis
        rates = basis[len(self.rates) :]
        sizes, turn = np.linalg.eigh(rates.conj().T @ weights[0] @ rates)
        basis = basis @ turn
        scale = float(np.abs(np.linalg.norm(weights[0], 2)))
        ends = np.flatnonzero(np.diff(sizes, prepend=-np.inf, append=np.inf) > EQUAL * max(scale, 1e-300))
        parts = [self._split(basis[:, a:b], weights[1:]) for a, b in itertools.pairwise(ends)]
        return np.hstack(parts)


def turning_train(model: TrainModel, kinds: Array) -> TurningTrain:
    """The eigenvalue problem of a train: dampers that act in contact act, since teeth bear in steady running.

    Parameters
    ----------
    model : TrainModel
        The train.
    kinds : ndarray, shape (n, n)
        See `TurningTrain`.
    """
    modal, damping = model.modal, model.modal.damping.copy()
    for line in model.meshes:
        if line.in_contact:  # its Rayleigh part is in the constant damping already
            along = modal.T.T @ line.row
            damping += line.given.damping * np.outer(along, along)
    turning = model.spinning if model.forces.turned else model.turning
    parts = turning.gyroscopic, turning.stiffening, turning.circulating
    gyroscopic, stiffening, circulating = (modal.T.T @ part @ modal.T for part in parts)
    return TurningTrain(modal.eigenvalues, damping, gyroscopic, stiffening, circulating, kinds)


def _clusters(values: ComplexArray) -> list[slice]:
    """Groups of eigenvalues, sorted by their imaginary parts, that are equal except for round-off."""
    if not len(values):
        return []
    near = EQUAL * np.abs(values) + np.finfo(float).eps * 1e2 * np.abs(values).max()
    apart = np.abs(np.diff(values)) > near[1:]
    ends = [0, *(np.flatnonzero(apart) + 1).tolist(), len(values)]
    return [slice(a, b) for a, b in itertools.pairwise(ends) if b - a > 1]
