r"""Operating point of a train with rolling bearings: where its steady torques put its shafts.

The coordinates q that the constraints allow minimise the energy

.. math:: \tfrac12\,q^T K q + \sum_b V_b(R_b q) - f^T q ,

K is the stiffness of housing, shafts and meshes (mean stiffness, along the flanks that the loads press). :math:`V_b` is
the energy of a rolling bearing under the motion :math:`R_b q` of its shaft against its bore, and f are the torques of
the loads at their end. The energy is convex; Newton's method finds its minimum. There every bearing has its load and
its tangent stiffness, which is that of the linear train from then on. In planetary stages K and f have the centrifugal
forces of the planets. Weights, other effects of speed, and friction are left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array
from ..bearings import BallBearing, BearingState, RollerBearing, deflected
from ..bearings.equilibrium import MOST
from ..bearings.minimum import least_energy
from .gear_train import GearTrain, as_matrix

#: Approach of a rolling element over its diameter at which the stiffness is taken that makes coordinates comparable.
TYPICAL = 1e-3


@dataclass(frozen=True, eq=False)
class OperatingPoint:
    """Rolling bearings of a train under its steady torques.

    Attributes
    ----------
    bearings
        Bore -> state of its bearing, in the directions of the train.
    geometry
        Bore -> the bearing.
    steps
        Newton steps that it took.
    residual
        Unbalanced load in parts of the loads.
    coordinates : ndarray, shape (n,)
        Coordinates of the system there.
    """

    bearings: Mapping[str, BearingState] = field(default_factory=dict)
    geometry: Mapping[str, BallBearing | RollerBearing] = field(default_factory=dict)
    steps: int = 0
    residual: float = 0.0
    coordinates: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def warnings(self) -> list[str]:
        """A sentence for each bearing that does not support its shaft."""
        return [
            f"bearing {name}: {state.loaded} of {self.geometry[name].count} rolling elements are loaded, so it does "
            "not support its shaft; preload it, reduce its clearance, or turn the direction that it carries"
            for name, state in self.bearings.items()
            if state.unloaded
        ]


def with_pressed_bearings(train: GearTrain) -> GearTrain:
    """The train with its rolling bearings replaced by the stiffness of an axially and radially pressed one."""
    bearings = tuple(
        replace(item, stiffness=as_matrix(_pressed(item.stiffness)))
        if isinstance(item.stiffness, BallBearing | RollerBearing)
        else item
        for item in train.bearings
    )
    return replace(train, bearings=bearings)


def with_operating_stiffness(train: GearTrain, point: OperatingPoint) -> GearTrain:
    """The train with the stiffness that its rolling bearings have at an operating point."""
    bearings = tuple(
        replace(item, stiffness=as_matrix(point.bearings[item.bore].stiffness)) if item.bore in point.bearings else item
        for item in train.bearings
    )
    return replace(train, bearings=bearings)


def rolling_bearings(train: GearTrain) -> dict[str, BallBearing | RollerBearing]:
    """Bore -> rolling bearing."""
    return {b.bore: b.stiffness for b in train.bearings if isinstance(b.stiffness, BallBearing | RollerBearing)}


def operating_point(
    bearings: Mapping[str, BallBearing | RollerBearing],
    motions: Mapping[str, Array],
    stiffness: Array,
    allowed: Array,
    force: Array,
) -> OperatingPoint:
    """Return where the energy of a train with rolling bearings is least.

    Parameters
    ----------
    bearings
        Bore -> rolling bearing.
    motions : mapping of ndarray, shape (5, n)
        Bore -> motion of the shaft against it for unit coordinates.
    stiffness : ndarray, shape (n, n)
        Of all other parts.
    allowed : ndarray, shape (n, m)
        Motions that the constraints allow.
    force : ndarray, shape (n,)
        Of the loads on the coordinates.

    Raises
    ------
    InputError
        For loads that the bearings cannot carry.
    """
    rows = {name: motions[name] @ allowed for name in bearings}
    rest, push = allowed.T @ stiffness @ allowed, allowed.T @ force
    pressed = rest + sum(rows[name].T @ _pressed(item) @ rows[name] for name, item in bearings.items())
    values, modes = np.linalg.eigh(pressed)
    values = np.maximum(values, 1e-12 * values[-1])
    pushes = [push, *(rows[name].T @ deflected(item, np.zeros(5)).load for name, item in bearings.items())]
    size = max(float(np.abs(modes.T @ one / np.sqrt(values)).max()) for one in pushes) or 1.0

    def energy(x: Array) -> tuple[float, Array, Array]:
        y = modes @ x
        gradient = rest @ y
        total, second = 0.5 * float(y @ gradient) - float(push @ y), rest.copy()
        gradient -= push
        for name, item in bearings.items():
            state = deflected(item, rows[name] @ y)
            total += state.energy
            gradient += rows[name].T @ state.load
            second += rows[name].T @ state.stiffness @ rows[name]
        return total, modes.T @ gradient, modes.T @ second @ modes

    found = least_energy(energy, np.zeros(len(values)), 1.0 / np.sqrt(values), size)
    y = modes @ found.place
    states = {name: deflected(item, rows[name] @ y) for name, item in bearings.items()}
    for name, item in bearings.items():
        moved = float(np.abs(states[name].displacement[:3]).max()) / item.diameter
        if states[name].astray or moved > MOST:
            problem = "cannot carry its load: its rings slide or tilt apart"
            cure = (
                "a single row with a contact angle carries one way along the axis (carries), and rollers without "
                "axial_stiffness_N_per_m none: turn it, add a row, or hold the shaft by another bearing"
            )
            raise InputError(f"bearing {name!r}", None, problem, cure)
    if not found.converged:
        problem = f"have no equilibrium after {found.steps} steps: {found.residual:.3g} of the load is unbalanced"
        raise InputError("bearings", None, problem, "see that the bearings of every shaft hold it in all directions")
    return OperatingPoint(states, dict(bearings), found.steps, found.residual, allowed @ y)


def _pressed(bearing: BallBearing | RollerBearing) -> Array:
    """Stiffness of a bearing whose elements are all pressed alike."""
    free = replace(bearing, clearance=-2.0 * TYPICAL * bearing.diameter, preload=TYPICAL * bearing.diameter)
    return deflected(free, np.zeros(5)).stiffness
