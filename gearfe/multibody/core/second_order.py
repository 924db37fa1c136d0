"""Degrees of freedom that the gradients of the constraints leave, and the constraints hold all the same.

    W^T G = 0,    G V = 0,    g'' = G a + H(v, v) + ...

W: dependent rows, V: motions that the gradients leave free, H: second derivatives of g. Where the rank of G stays the
same along a motion with the velocity v, the derivative of w^T G u = 0 along it says

    w^T H(v, u) = 0    for all w in W, u in V

so every true velocity lies in the common kernel of the forms V^T (w^T H) V. A platform that two straight-line linkages
lift at both ends is the example: heights that differ by d stretch it by d^2 alone. In rows that are redundant all
forms vanish.
"""

from __future__ import annotations

import numpy as np

from ...base.typing import Array
from .system import System

#: Singular values of the gradients below this share of the largest count as zero: a gap of 1e-10, which closed
#: positions may have, leaves its square root where the gap is of second order.
SINGULAR = 1e-5
#: Forms below this, in units of coordinates and rows, are rounding.
ROUNDING = 1e-6
#: Steps towards a motion of second order: double roots halve their distance in each.
STEPS = 40
#: Largest second derivative of a dependent row along a motion of unit length that counts as allowed.
ALLOWED = 1e-9


def hidden_freedoms(system: System, time: float, q: Array) -> tuple[int, int]:
    """Degrees of freedom that the gradients leave in a closed position, and how many of them the constraints hold."""
    free, forms = _forms(system, time, q)
    count = free.shape[1]
    sizes = np.linalg.svd(forms.reshape(-1, count), compute_uv=False) if forms.size else np.zeros(0)
    return count, int((sizes > ROUNDING).sum())


def motions_of_second_order(system: System, time: float, q: Array, count: int) -> list[Array]:
    """Return random motions that the constraints allow to second order.

    In a position where branches meet, each branch has one of these directions. Gauss-Newton steps on the unit sphere of
    the motions that the gradients leave free solve w^T H(v, v) = 0.

    Parameters
    ----------
    system : System
        The system.
    time : float
        Time (s).
    q : ndarray, shape (size,)
        Coordinates that meet the constraints.
    count : int
        Largest number of motions.

    Returns
    -------
    motions : list of ndarray, shape (size,)
        In coordinates that compare, the largest component 1; zero if the gradients leave nothing free, fewer or none if
        the forms let nothing move.
    """
    free, forms = _forms(system, time, q)
    if not free.shape[1]:
        return [np.zeros(system.size)] * count
    random = np.random.default_rng(5)
    motions: list[Array] = []
    for _ in range(8 * count):
        y = random.standard_normal((free.shape[1],))
        for _ in range(STEPS if forms.size else 0):
            y = np.asarray(y / np.linalg.norm(y))
            turned = forms @ y
            across = turned - np.outer(turned @ y, y)  # a step along y changes no direction
            y = y - np.linalg.lstsq(2.0 * across, turned @ y, rcond=1e-8)[0]
        y = np.asarray(y / np.linalg.norm(y))
        if np.abs(forms @ y @ y).max(initial=0.0) <= ALLOWED:
            v = free @ y
            motions.append(v / np.abs(v).max())
        if len(motions) == count:
            break
    return motions


def _forms(system: System, time: float, q: Array) -> tuple[Array, Array]:
    """Return the motions V that the gradients leave free, shape (size, f), and V^T (w^T H) V of dependent rows.

    Motions are in scaled coordinates; the second array has the shape (w, f, f)."""
    G = system.jacobian(time, q) * system.units / system.row_units[:, None]
    left, sizes, right = np.linalg.svd(G, full_matrices=True)
    rank = int((sizes > SINGULAR * sizes.max(initial=0.0)).sum())
    free = right[rank:].T
    dependent = left[:, rank:].T / system.row_units
    moves = system.units[:, None] * free
    forms = [moves.T @ system.curvature(time, q, row) @ moves for row in dependent]
    return free, np.array(forms).reshape(len(dependent), free.shape[1], free.shape[1])
