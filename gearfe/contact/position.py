"""A solved position: its torques, its tangent, and what recovering fields needs."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .half_plane_result import PairContacts
from .scene import Window

Array = NDArray[Any]


@dataclass(frozen=True)
class PointPressures:
    """Pressures at the contact points of a law on the mesh.

    Attributes
    ----------
    owner, facing : ndarray, shape (q,)
        Window that each point is on, and the one that it faces, by their places among the position's windows.
    place : ndarray, shape (q,)
        Closest place on that window: edge number plus position in the edge.
    pressure : ndarray, shape (q,)
        Pa.
    """

    owner: NDArray[np.int64]
    facing: NDArray[np.int64]
    place: Array
    pressure: Array


@dataclass(frozen=True)
class Position:
    """Solution of one position.

    Attributes
    ----------
    status
        ``converged``, ``no_contact`` (the undeformed gears are clear of each other), ``under_resolved`` (elements too
        coarse for the contact) or ``not_converged``. Torques are 0 without contact, not-a-number when not solved.
    torque_wheel, torque_pinion
        Moments that the hubs need, energy-conjugate: sum of (x - c) x f over the current places (N m).
    torque_wheel_reaction
        Moment of the reactions at the wheel's bore: sum of (x - u - c) x f (N m).
    tangent
        d torque_wheel / d twist (N m/rad).
    pair_numbers : tuple of int
        Pair k joins pinion tooth k and wheel tooth -1 - k.
    pair_torques : ndarray
        Share of each pair in `torque_wheel` (N m).
    pair_widths : ndarray
        Half width of each pair's contact by the second moment of its pressure (m), see `gearfe.contact.half_width`.
    peak_pressure
        Largest pressure at a contact point (Pa): it oscillates with the mesh, and a sharp edge gives it no bound.
    iterations
        Newton steps.
    windows : tuple of Window
        Pieces of flank under load.
    forces, force_rate : ndarray, shape (2n,)
        Forces on their nodes in tooth axes (N) and their derivatives with respect to the twist (N/rad), for recovering
        fields; None without a solution.
    points
        Pressures at the contact points of a law on the mesh; None for other laws.
    contacts
        Loaded tooth pairs of the half-plane law with their panels; None for other laws.
    """

    status: str
    torque_wheel: float
    torque_pinion: float
    torque_wheel_reaction: float
    tangent: float
    pair_numbers: tuple[int, ...]
    pair_torques: Array
    peak_pressure: float
    iterations: int
    pair_widths: Array = field(default_factory=lambda: np.zeros(0))
    windows: tuple[Window, ...] = ()
    forces: Array | None = None
    force_rate: Array | None = None
    points: PointPressures | None = None
    contacts: PairContacts | None = None


def unsolved(status: str, iterations: int = 0) -> Position:
    """A position without a solution: torques are 0 without contact, not-a-number otherwise."""
    nothing = 0.0 if status == "no_contact" else float("nan")
    return Position(status, nothing, nothing, nothing, nothing, (), np.zeros(0), nothing, iterations)
