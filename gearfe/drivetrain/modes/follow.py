"""Modes followed over the speed by their shapes.

A mode continues in the one with the most similar state; the most similar pairs come first. Similarity is the square of
their product, a modal assurance criterion in the energy of the train (Allemang 2003). Where a mode that matters keeps
less than `ALIKE` of itself, the step is halved, up to `HALVINGS` times. Modes that cross keep their shapes. Modes that
repel each other within less than the smallest step count as crossing: what the train does there is that of a crossing.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from ...base.typing import Array, ComplexArray, IntArray
from .turning import Poles, TurningTrain

#: Least square of the product of a mode with the one that it goes on in.
ALIKE = 0.6
#: How often a step is halved.
HALVINGS = 6


@dataclass(frozen=True, eq=False)
class Tracks:
    """Modes at s speeds, k of them; NaN where a mode does not swing.

    Attributes
    ----------
    values, slopes : (s, k)
        Eigenvalues (1/s), and their derivatives with the speed of the drive.
    vectors : (s, 2n, k)
        States of unit length.
    """

    values: ComplexArray
    slopes: ComplexArray
    vectors: ComplexArray

    def of(self, modes: Array) -> Tracks:
        """Those of some numbers."""
        return Tracks(self.values[:, modes], self.slopes[:, modes], self.vectors[:, :, modes])


def follow_modes(train: TurningTrain, speeds: Array, highest_hz: float) -> Tracks:
    """Follow the modes from the slowest speed to the fastest.

    Parameters
    ----------
    train : TurningTrain
        The train.
    speeds : ndarray, shape (s,)
        Of the drive (rad/s), rising or falling in size.
    highest_hz : float
        Highest frequency: modes that lie below it at some speed are returned.

    Returns
    -------
    Tracks
        Sorted by the frequency at the slowest speed.
    """
    rising = np.argsort(np.abs(speeds), kind="stable")
    steps = [train.poles(float(speeds[rising[0]]))]
    for one, two in itertools.pairwise(rising):
        steps.append(_follow_step(train, steps[-1], (float(speeds[one]), float(speeds[two])), highest_hz, HALVINGS))
    count, back = len(steps[-1].values), np.argsort(rising)
    made = Tracks(*(np.array([_padded(x, count) for x in values])[back] for values in _columns(steps)))
    with np.errstate(invalid="ignore"):
        frequency = np.abs(made.values) / (2.0 * math.pi)
    first = frequency[rising[0]]
    inside = np.flatnonzero((np.where(np.isnan(frequency), np.inf, frequency) <= highest_hz).any(axis=0))
    return made.of(inside[np.argsort(np.where(np.isnan(first), np.inf, first)[inside], kind="stable")])


def _columns(steps: list[Poles]) -> tuple[list[ComplexArray], ...]:
    return [s.values for s in steps], [s.slopes for s in steps], [s.vectors for s in steps]


def _padded(values: ComplexArray, count: int) -> ComplexArray:
    """Values (..., k) with NaN up to so many columns."""
    more = [(0, 0)] * (values.ndim - 1) + [(0, count - values.shape[-1])]
    return np.pad(values, more, constant_values=np.nan)


def _follow_step(
    train: TurningTrain, before: Poles, speeds: tuple[float, float], highest_hz: float, halvings: int
) -> Poles:
    """Modes at the second of two speeds in the order of those at the first; new ones come last."""
    after = train.poles(speeds[1])
    alike = np.abs(np.nan_to_num(before.vectors).conj().T @ after.vectors) ** 2
    tracks, numbers = _assigned(alike)
    size = np.minimum(np.abs(before.values[tracks]), np.abs(after.values[numbers]))
    matters = size <= 2.0 * math.pi * highest_hz  # not of one that does not swing at the first speed
    if halvings and (alike[tracks, numbers][matters] < ALIKE).any():
        middle = 0.5 * (speeds[0] + speeds[1])
        half = _follow_step(train, before, (speeds[0], middle), highest_hz, halvings - 1)
        return _follow_step(train, half, (middle, speeds[1]), highest_hz, halvings - 1)
    new = np.setdiff1d(np.arange(len(after.values)), numbers)
    place = np.full(len(before.values) + len(new), -1)
    place[tracks] = numbers
    place[len(before.values) :] = new
    values, slopes, vectors = (
        np.where(place < 0, np.nan, x[..., place]) for x in (after.values, after.slopes, after.vectors)
    )
    return Poles(values, vectors, slopes)


def _assigned(alike: Array) -> tuple[IntArray, IntArray]:
    """Pairs of rows and columns, each once: those that are each other's largest first, then those of what is left."""
    left, rows, columns = alike.copy(), list[IntArray](), list[IntArray]()
    for _ in range(min(alike.shape)):
        best, back = left.argmax(axis=1), left.argmax(axis=0)
        mutual = np.flatnonzero((back[best] == np.arange(len(best))) & (left.max(axis=1) >= 0.0))
        if not len(mutual):
            break
        rows.append(mutual)
        columns.append(best[mutual])
        left[mutual], left[:, best[mutual]] = -1.0, -1.0
    none = [np.zeros(0, dtype=np.int64)]
    return np.concatenate(rows or none), np.concatenate(columns or none)
