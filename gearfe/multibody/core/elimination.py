"""Systems whose constraints are linear and constant: minimal coordinates in which mass is 1 and stiffness diagonal.

    q = q_p + T y,     T^T M T = 1,     T^T K T = diag(omega^2),     G T = 0

so that y'' = -omega^2 y - T^T C T y' + T^T f with the remaining forces f: hinges of a gear train cost nothing
afterwards.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...base.typing import Array
from .contract import Element, LocalForce, ModalBlocks
from .start import Start
from .system import System

#: Entries of the damping beside the diagonal that are smaller than this part of the largest one are round-off:
#: proportional damping stays diagonal, and costs nothing.
ROUND_OFF = 1e-14


@dataclass(frozen=True)
class ModalCoordinates:
    """Modal coordinates of a system: minimal ones in which mass and stiffness are diagonal.

    Parameters
    ----------
    T : ndarray, shape (size, free)
        Columns that the constraints leave free.
    origin : ndarray, shape (size,)
        A state on the constraints.
    eigenvalues : ndarray, shape (free,)
        omega^2 (rad2/s2).
    damping : ndarray, shape (free, free)
        T^T C T.
    constant : ndarray, shape (free,)
        T^T of the constant force -K q_p.
    """

    system: System
    T: Array
    origin: Array
    eigenvalues: Array
    damping: Array
    constant: Array

    def reduce(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Modal coordinates and velocities of a state on the constraints."""
        back = self.T.T @ self.system.mass
        return back @ (q - self.origin), back @ v

    def force(self, t: float, y: Array, dy: Array) -> Array:
        """T^T f of everything but the constant blocks."""
        if not self.system.forces:
            return np.zeros(self.T.shape[1])
        q, v = self.origin + self.T @ y, self.T @ dy
        total = np.zeros(self.system.size)
        for element, index in self.system.forces:
            np.add.at(total, index, element.force(t, q[index], v[index]))
        return self.T.T @ total


def is_linear(system: System) -> bool:
    """Return whether every joint is linear with constant coefficients."""
    return all(e.constant_jacobian for e, _ in system.joints)


def modal_coordinates(system: System) -> ModalCoordinates:
    """Modal coordinates of a system whose joints are all linear and constant; redundant rows do no harm."""
    return system.once("modal coordinates", lambda: _modal_coordinates(system))


def _modal_coordinates(system: System) -> ModalCoordinates:
    root = np.linalg.cholesky(system.inverse_mass)  # root root^T = M^-1
    zero = np.zeros(system.size)
    G = system.jacobian(0.0, zero)
    g = system.residual(0.0, zero)
    if len(G):
        _, sizes, right = np.linalg.svd(G @ root, full_matrices=True)
        rank = int((sizes > 1e-10 * sizes.max(initial=0.0)).sum())
        origin = -root @ np.linalg.lstsq(G @ root, g, rcond=1e-12)[0]
        T = root @ right[rank:].T
    else:
        origin, T = zero, root
    eigenvalues, turn = np.linalg.eigh(T.T @ system.stiffness @ T)
    T = T @ turn
    damping = T.T @ system.damping @ T
    least = ROUND_OFF * float(np.abs(damping).max(initial=0.0))
    damping = np.where((np.abs(damping) > least) | np.eye(len(damping), dtype=bool), damping, 0.0)
    return ModalCoordinates(system, T, origin, eigenvalues, damping, -T.T @ (system.stiffness @ origin))


def in_modes(modal: ModalCoordinates, start: Start) -> tuple[System, Start]:
    """The system in its minimal coordinates, which no joint holds, and its start there."""
    body = ModalBlocks(np.eye(len(modal.eigenvalues)), modal.damping, np.diag(modal.eigenvalues))
    elements: list[Element] = [body]
    for force, index in modal.system.forces:
        assert isinstance(force, LocalForce)
        offset, numbers = modal.origin[index] @ force.W, force.piece_numbers
        law = _shifted(force.law, offset)
        pieces = None if numbers is None else _shifted(numbers, offset)
        directions = modal.T[index].T @ force.W
        elements.append(LocalForce((body,), directions, law, breaks=force.breaks, piece_numbers=pieces))
    elements.append(LocalForce((body,), modal.constant[:, None], lambda *_: np.ones(1)))
    q, v = modal.reduce(start.q, start.v)
    return System(elements), replace(start, q=q, v=v, active=np.zeros(0, dtype=bool), added_mass=np.zeros(0))


def _shifted(law: Callable[..., Any], offset: Array) -> Callable[..., Any]:
    """A law of (t, u, u') at u + offset."""

    def moved(t: float | Array, u: Array, du: Array) -> Any:
        return np.asarray(law(t, u + offset, du))

    return moved
