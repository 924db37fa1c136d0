"""What a load map tells of a cell beforehand: its twist, and its share of finite strain."""

from __future__ import annotations

import numpy as np

from ..contact.compliance import MeshingPair
from ..contact.finite_strain import finite_strain_shares, interpolated_shares
from ..contact.position import Positions
from ..typing import Array, IntArray

#: p: the share of finite strain of a single pair of teeth grows about like this power of its load.
SHARE_POWER = 0.75
#: Angles on which the share of finite strain is evaluated at a torque, and the error of it that is left.
SHARE_ANGLES, SHARE_ERROR = 24, 5e-5


def strain_load(found: Positions) -> Array:
    """T^p sum s^(1 + p) of the torques that the pairs of positions carry, shape (n,); 0 without contact."""
    position, torque = found.contacts.position, np.maximum(found.contacts.torque_wheel, 0.0)
    power, whole = (np.bincount(position, values, len(found)) for values in (torque ** (1 + SHARE_POWER), torque))
    return np.divide(power, whole, out=np.zeros(len(found)), where=whole > 0)


def hermite(t: Array, value: Array, slope: Array) -> Array:
    """Cubic at 0 <= t <= 1 through two values with their slopes times the interval, both of shape (2, ...)."""
    low, high, rise = slope[0], slope[1], value[1] - value[0]
    return np.asarray(value[0] + t * (low + t * (3 * rise - 2 * low - high + t * (low + high - 2 * rise))))


def between(known: Array, goals: Array) -> tuple[IntArray, Array]:
    """Of rising torques the ones on either side of others, shape (2, m), and where these lie in ln T, shape (m, 1)."""
    high = np.clip(np.searchsorted(known, goals), 1, len(known) - 1)
    pair = np.stack([high - 1, high])
    x = np.log(known[pair])
    return pair, ((np.log(goals) - x[0]) / (x[1] - x[0]))[:, None]


def predicted(known: Positions, goals: Array, touching: Array, others: Array) -> tuple[Array, Array]:
    """Twists (rad) at which cells carry their torque, and their `strain_load`.

    Parameters
    ----------
    known
        Cells at the torques `goals`, shape (m,), and n angles, torque by torque.
    touching
        Twists, shape (n,), at which the rigid flanks touch (rad).
    others : ndarray, shape (k,)
        Torques of the other cells between them (N m).

    Returns
    -------
    ndarray, ndarray, shape (k n,)
        Not-a-number beside a cell without a solution.
    """
    shape = len(goals), len(touching)
    pair, t = between(goals, others)
    delta = known.twist.reshape(shape) - touching
    with np.errstate(invalid="ignore", divide="ignore"):
        steep = (known.torque_wheel / known.tangent).reshape(shape) / delta
        interval = np.log(goals[pair[1]] / goals[pair[0]])[:, None]
        twist = touching + np.exp(hermite(t, np.log(delta)[pair], steep[pair] * interval))
    each = strain_load(known).reshape(shape) / goals[:, None] ** SHARE_POWER
    carried = ((1 - t) * each[pair[0]] + t * each[pair[1]]) * others[:, None] ** SHARE_POWER
    return twist.ravel(), carried.ravel()


class StrainShares:
    """Shares of finite strain in the cells of a map, c = kappa times `strain_load`; each learns its kappa when it is
    first asked for.

    Parameters
    ----------
    elastic
        The gears.
    angles, goals
        Pinion angles (rad) and rising torques (N m) of the map.
    known
        Numbers of the torques that are asked for before all others.
    """

    def __init__(self, elastic: MeshingPair, angles: Array, goals: Array, known: IntArray) -> None:
        self._elastic, self._angles, self._goals, self._known = elastic, angles, goals, known
        self._kappa = np.full((len(goals), len(angles)), np.nan)
        self._pairs = np.zeros(self._kappa.shape, dtype=np.int64)

    def expected(self, rows: IntArray, carried: Array) -> Array:
        """Before cells of the torques `rows` are solved, from their `strain_load`."""
        return np.nan_to_num(self._between(rows)[0].ravel() * carried)

    def at(self, rows: IntArray, found: Positions) -> Array:
        """Of all solved cells of the torques `rows`, shape (cells,)."""
        carried = strain_load(found)
        if np.isnan(self._kappa[rows]).any():
            count = np.bincount(found.contacts.position, minlength=len(found))
            self._pairs[rows] = count.reshape(len(rows), -1)
            learn = self._first if rows is self._known else self._other
            self._kappa[rows] = np.nan_to_num(learn(rows, found, carried))
        return self._kappa[rows].ravel() * carried

    def _direct(self, found: Positions, carried: Array, cells: IntArray) -> Array:
        shares = finite_strain_shares(self._elastic, found.take(cells))
        return np.divide(shares, carried[cells], out=np.full(len(cells), np.nan), where=carried[cells] > 0)

    def _first(self, rows: IntArray, found: Positions, carried: Array) -> Array:
        """At some angles of each torque, linear between them."""
        angles, cycle = self._angles, self._elastic.pitch_angle
        order = np.argsort(np.mod(angles, cycle), kind="stable")
        places = np.unique(np.linspace(0, len(order) - 1, min(SHARE_ANGLES, len(order))).round().astype(np.int64))
        at = order[places]
        kappa = self._direct(found, carried, (np.arange(len(rows))[:, None] * len(angles) + at).ravel())
        return np.stack([interpolated_shares(angles, angles[at], k, cycle) for k in kappa.reshape(len(rows), -1)])

    def _between(self, rows: IntArray) -> tuple[Array, Array, IntArray]:
        """From the known torques on either side: kappa, its change from one to the other, and their loaded pairs."""
        pair, t = between(self._goals[self._known], self._goals[rows])
        low, high = self._kappa[self._known][pair]
        return (1 - t) * low + t * high, high - low, self._pairs[self._known][pair]

    def _other(self, rows: IntArray, found: Positions, carried: Array) -> Array:
        """Between the known torques, directly where that may be off."""
        kappa, change, pairs = self._between(rows)
        differ = (pairs != self._pairs[rows]).any(axis=0)
        doubt = np.flatnonzero(differ.ravel() | (0.5 * np.abs(change).ravel() * carried > SHARE_ERROR))
        made = kappa.ravel()
        made[doubt] = self._direct(found, carried, doubt)
        return made.reshape(kappa.shape)
