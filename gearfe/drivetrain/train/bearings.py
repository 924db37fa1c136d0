r"""Forces and moments of the bearings: what each shaft does to the bores that carry it.

Of a hinge they are its multipliers, :math:`G^T\lambda = f - C\dot q - K q - M\ddot q`, of bearing springs
:math:`k x + c\dot x` of the shaft's motion x against the bore; in a frame that turns with :math:`\Omega` the rate is
:math:`\dot x + \Omega J x`, J a quarter turn. In a rigid housing statics do not tell how the hinges of
a shaft share its load. Then moments are as small as can be, so two bores carry a shaft like simple supports, and of the
forces that are left open those of least squares are taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from ...base.typing import Array, ComplexArray
from ...fem.reduction.modal_body import ModalBody
from ...multibody import System
from .elements import bore_rows
from .gear_train import GearTrain
from .mesh_element import Shafts

#: What a moment counts beside a force (1/m) where shares are open: so much that it is taken only where it must be.
MOMENT = 1e6
#: Quarter turn about the axis of a motion along e1, a, e2 and tilts about e1, e2: rate of a unit rotation.
QUARTER = np.zeros((5, 5))
QUARTER[[0, 3], [2, 4]], QUARTER[[2, 4], [0, 3]] = -1.0, 1.0
Values = TypeVar("Values", Array, ComplexArray)


@dataclass(frozen=True, eq=False)
class BearingLoads:
    """Loads on the bores as linear functions of the motion.

    Attributes
    ----------
    of_forces, of_places, of_rates, of_accelerations : (size, 6 bores)
        Of the train's forces on the coordinates, the coordinates and their rates.
    of_still_places, of_still_rates : (size, 6 bores)
        Of the bores' own motion in bearings whose shaft is in a frame that turns.
    of_carried_places : (size, 6 bores)
        Of the coordinates times the speed of the drive: what dampers feel because the frame carries the shaft round.
    """

    of_forces: Array
    of_places: Array
    of_rates: Array
    of_accelerations: Array
    of_still_places: Array
    of_still_rates: Array
    of_carried_places: Array

    def __call__(self, q: Values, v: Values, a: Values, acting: Values, speed: Array | float) -> Values:
        """Force (N) and moment (N m) on each bore about its reference point, along x, y, z; shape (n, bores, 6).

        Bearings of shafts in frames that turn, in an elastic housing, have it where these are as at the start.

        Parameters
        ----------
        q, v, a : (n, size)
            Coordinates, rates, second rates.
        acting : (n, size)
            Forces of the train on the coordinates, those of `TrainForces`.
        speed : float or (n,)
            Of the drive (rad/s).
        """
        turning, still = self.parts(q, v, a, acting, speed)
        return turning + still

    def parts(self, q: Values, v: Values, a: Values, acting: Values, speed: Array | float) -> tuple[Values, Values]:
        """Return the loads in two parts: along axes of the frames of the shafts, and along fixed axes.

        Parameters
        ----------
        q, v, a, acting, speed
            As of a call.

        Returns
        -------
        turning, still : (n, bores, 6)
        """
        found = acting @ self.of_forces + q @ self.of_places + v @ self.of_rates + a @ self.of_accelerations
        found += np.reshape(speed, (-1, 1)) * (q @ self.of_carried_places)
        still = q @ self.of_still_places + v @ self.of_still_rates
        return found.reshape(len(found), -1, 6), still.reshape(len(found), -1, 6)


def bearing_loads(
    train: GearTrain, system: System, shafts: Shafts, bores: tuple[str, ...], *, shared: bool, turns: Sequence[float]
) -> BearingLoads:
    """Loads on the bores that carry shafts.

    Parameters
    ----------
    train, system, shafts
        The train, its system, and the shafts in this.
    bores
        Names of the bores, in the order of the results.
    shared
        Whether statics leave open how the hinges of a shaft share its load.
    turns
        For each shaft the speed of the frame in which it is described, in parts of that of the drive.
    """
    e1, e2, axis = train.frame
    to_global = np.zeros((5, 6))
    to_global[:3, :3], to_global[3, 3:], to_global[4, 3:] = np.array([e1, axis, e2]), e1, e2
    G = system.jacobian(0.0, np.zeros(system.size))
    ends = np.cumsum([0, *(element.rows for element, _ in system.joints)])
    first = {element.name: int(row) for (element, _), row in zip(system.joints, ends, strict=False)}
    counts = np.ones(len(G))
    if shared:
        for name, row in first.items():
            if name.startswith("hinge "):
                counts[row + 3 : row + 5] = MOMENT
    multipliers = np.linalg.pinv(G / counts[:, None]) / counts
    springs = {bearing.bore: bearing for bearing in train.bearings}
    parts = [np.zeros((system.size, 6 * len(bores))) for _ in range(6)]
    for number, bore in enumerate(bores):
        at = slice(6 * number, 6 * number + 6)
        if bore not in springs:
            row = first[f"hinge {bore}"]
            parts[0][:, at] = multipliers[:, row : row + 5] @ to_global
            continue
        shaft = next(i for i, shaft in enumerate(train.shafts) if bore in shaft.bores)
        of_shaft, of_bore = motion_parts(train, shafts, shaft, bore)
        stiffness = springs[bore].stiffness_matrix
        damping = springs[bore].damping_matrix + train.damping.beta * stiffness
        for first_part, rows in ((1, of_shaft), (3 if turns[shaft] else 1, -of_bore)):
            for part, matrix in enumerate((stiffness, damping), start=first_part):
                parts[part][:, at] += rows.T @ (matrix @ to_global)
        parts[5][:, at] = turns[shaft] * (QUARTER @ of_shaft).T @ (damping @ to_global)
    hinges, places, rates, still_places, still_rates, carried_places = parts
    return BearingLoads(
        hinges, places - system.stiffness.T @ hinges, rates - system.damping.T @ hinges, -system.mass.T @ hinges,
        still_places, still_rates, carried_places,
    )  # fmt: skip


def shaft_motion(train: GearTrain, shafts: Shafts, bore: str) -> Array:
    """Motion of a shaft against its bore for unit coordinates of the system, (5, size); see `bore_rows`."""
    of_shaft, of_bore = motion_parts(
        train, shafts, next(i for i, shaft in enumerate(train.shafts) if bore in shaft.bores), bore
    )
    return of_shaft - of_bore


def motion_parts(train: GearTrain, shafts: Shafts, number: int, bore: str) -> tuple[Array, Array]:
    """Return the motion of a shaft at a bore, and that of the bore, for unit coordinates of the system.

    Parameters
    ----------
    train, shafts
        The train, and its shafts in the system.
    number
        Of the shaft.
    bore
        Its name.

    Returns
    -------
    of_shaft, of_bore : ndarray, shape (5, size)
        See `bore_rows`.
    """
    selector = None if train.housing is None else np.eye(train.housing.size)[:, train.housing.attachment(bore)]
    local = bore_rows(shafts.bodies[number], train.bore_points[bore], train.frame, selector)
    own, of_bore = shafts.bodies[number].size, np.zeros((5, shafts.size))
    of_bore[:, : local.shape[1] - own] = -local[:, own:]
    return shafts.whole(number, local[:, :own]), of_bore


def bore_motion(housing: ModalBody | None, bores: tuple[str, ...], size: int) -> Array:
    """Displacement and rotation of each bore along x, y, z for unit coordinates, (6 bores, size); 0 if rigid."""
    rows = np.zeros((6 * len(bores), size))
    if housing is not None:
        for number, bore in enumerate(bores):
            selector = np.eye(housing.size)[housing.attachment(bore)]
            rows[6 * number : 6 * number + 6, : housing.size] = selector
    return rows
