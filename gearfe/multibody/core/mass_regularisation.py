"""Links that are light beside what the joints make them carry.

All solvers of the core eliminate accelerations with the inverse masses: S = G M^-1 G^T. A coupler with almost no mass
fills S with large numbers. They cancel in the pivots of the heavy links, which loses all digits of these. The
elimination may use any mass, if the force is changed accordingly: with an added mass D on a few coordinates

    (M + D) a + G^T lambda = f + D a

and D a is found exactly (`System.acceleration`, `recurrences`). The effective mass of a link is the mass that resists a
force on it. It is twice the least kinetic energy of all motions in which the link has speed 1. An added mass up to that
changes no energy of the mechanism by more than a small factor, so D a is computed without loss. A pendulum that is
truly light keeps its mass.
"""

from __future__ import annotations

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array
from .system import System

#: Effective mass over own mass from which on a link counts as light: less costs no more than 4 of the 16 digits.
LIGHT = 1e4
#: Share of the largest mass below which an effective mass is rounding (square of that of the singular values).
LEAST = 1e-24
#: Share of the effective mass at the start from which on a link carries next to nothing.
LOOSE = 1e-6
#: Singular values of constraint gradients below this share of the largest count as zero.
RANK = 1e-11
#: Share below which a singular value may vanish along the motion: a passing singular position.
PASSING = 1e-6


def free_motions(G: Array) -> Array:
    """Orthonormal columns that span the motions u with G u = 0; G in rows and coordinates that compare."""
    if len(G) == 0:
        return np.eye(G.shape[1])
    _, sizes, right = np.linalg.svd(G, full_matrices=True)
    return right[int((sizes > RANK * sizes.max(initial=0.0)).sum()) :].T


def added_masses(system: System, time: float, q: Array, v: Array, active: np.ndarray) -> Array:
    """Return the mass by which the elimination raises the coordinates of light links.

    Parameters
    ----------
    system : System
        The system.
    time : float
        Time of the state (s).
    q, v : ndarray, shape (size,)
        Coordinates and velocities that meet the constraints.
    active : ndarray of bool, shape (rows,)
        Constraints that are not redundant.

    Returns
    -------
    added_mass : ndarray, shape (size,)
        Mass (kg) or moment of inertia (kg m2); 0 for links that are not light.

    Raises
    ------
    InputError
        For a link without mass that nothing with mass holds: its acceleration is undetermined.
    """
    added_mass = np.zeros(system.size)
    bodies, own = _own_masses(system)
    if own.size == 0 or 0.0 < own.max() <= LIGHT * own.min():
        return added_mass
    G = _gradients_ahead(system, time, q, v, active)
    if own.min() == 0.0:
        _check_determined(system, G)
    effective = _effective_mass(system, G)
    light = effective[:, None] > LIGHT * own
    added_mass[bodies] = np.where(light, effective[:, None] - own, 0.0) / system.units[bodies] ** 2
    return added_mass


def loose_link(system: System, times: Array, q: Array, v: Array, active: np.ndarray, added_mass: Array) -> str | None:
    """Return the name of the light link that carries next to nothing in the last finite state.

    Parameters
    ----------
    system : System
        The system.
    times : ndarray, shape (n,)
        Times of the states (s).
    q, v : ndarray, shape (n, size)
        Coordinates and velocities.
    active : ndarray of bool, shape (rows,)
        Rows that are not redundant.
    added_mass : ndarray, shape (size,) or (0,)
        Masses by which the elimination raises light links, from `added_masses`.

    Returns
    -------
    name : str or None
        None if no state is finite, no link is light, or all of them carry mass.
    """
    finite = np.flatnonzero(np.isfinite(q).all(axis=1) & np.isfinite(v).all(axis=1))
    if not added_mass.any() or not len(finite):
        return None
    at = finite[-1]
    bodies, _ = _own_masses(system)
    share = _effective_mass(system, _gradients_ahead(system, times[at], q[at], v[at], active))[:, None]
    raised = (added_mass * system.units**2)[bodies]
    shares = np.where(raised > 0.0, share / np.where(raised > 0.0, raised, 1.0), np.inf).min(axis=1)
    names = [name for element in system.elements for name in element.planar_bodies]
    return names[int(shares.argmin())] if shares.min() < LOOSE else None


def _own_masses(system: System) -> tuple[np.ndarray, Array]:
    """Coordinates of the planar bodies and their masses in units that compare, both of shape (bodies, 3)."""
    numbers = [np.zeros(0, dtype=int), *(system.coordinates(e) for e in system.elements if e.planar_bodies)]
    bodies = np.concatenate(numbers).reshape(-1, 3)
    return bodies, (np.diagonal(system.mass) * system.units**2)[bodies]


def _effective_mass(system: System, G: Array) -> Array:
    """Mass that every planar body carries (units that compare), at most the largest own one; 0 where it is rounding."""
    bodies, own = _own_masses(system)
    free = free_motions(G)
    effective = np.full(len(bodies), own.max() or 1.0)
    if free.shape[1]:
        triangle = np.linalg.qr(system.mass_root * system.units @ free)[1]
        answers = np.linalg.lstsq(triangle.T, free[bodies.ravel()].T, rcond=0.0)[0].T.reshape(len(bodies), 3, -1)
        with np.errstate(divide="ignore"):
            effective = np.minimum(effective, 1.0 / np.linalg.norm(answers, 2, axis=(1, 2)) ** 2)
    return np.where(effective < LEAST * own.max(), 0.0, effective)


def _gradients_ahead(system: System, time: float, q: Array, v: Array, active: np.ndarray) -> Array:
    """G in units; where rows lose their gradient at the start only, the motion gives the rows that hold it."""

    def gradients(at: Array) -> Array:
        return system.jacobian(time, at)[active] * system.units / system.row_units[active, None]

    G = gradients(q)
    speed = np.abs(v / system.units).max(initial=0.0)
    if len(G) == 0 or speed == 0.0:
        return G
    left, sizes, _ = np.linalg.svd(G)
    lost = left[:, np.append(sizes, np.zeros(len(G) - len(sizes))) < PASSING * sizes.max()]
    step = 1e-5 / speed * v
    return np.vstack([G, lost.T @ (gradients(q + step) - gradients(q - step)) / 2e-5])


def _check_determined(system: System, G: Array) -> None:
    """Every motion moves some mass; otherwise the link that moves most of what does not is named."""
    held = np.diagonal(system.mass) > 0.0
    rest = free_motions(np.vstack([G, np.eye(system.size)[held]]))
    if rest.shape[1] == 0:
        return
    bodies, masses = _own_masses(system)
    names = [name for element in system.elements for name in element.planar_bodies]
    moved = int(np.abs(rest).max(axis=1)[bodies].max(axis=1).argmax())
    key = "mass" if masses[moved, 0] == 0.0 else "inertia"
    problem = "leaves its motion undetermined: it can move while nothing with mass does"
    cure = "give it mass and inertia, or joints that hold it to links with mass"
    raise InputError(f"body {names[moved]!r} {key}", 0.0, problem, cure)
