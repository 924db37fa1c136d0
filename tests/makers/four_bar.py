"""A four-bar linkage and its closure in closed form."""

from __future__ import annotations

from math import atan2, cos, hypot, sin

import numpy as np

from gearfe.multibody import Body, Gravity, Hinge, Linkage, System
from tests.makers.rigid_cases import G

CRANK, COUPLER, ROCKER, GROUND = 0.4, 1.1, 0.8, 1.0


M1, M3 = 1.3, 0.9


PHI, RATE = 0.6, 5.0


def unit(angle: float) -> np.ndarray:
    return np.array([cos(angle), sin(angle)])


def normal(angle: float) -> np.ndarray:
    return np.array([-sin(angle), cos(angle)])


def closure(phi: float) -> tuple[float, float, np.ndarray, np.ndarray]:
    """Angles of coupler and rocker, and their first and second derivatives by the crank's angle."""
    way = np.array([GROUND, 0.0]) - CRANK * unit(phi)
    far = hypot(*way)
    coupler = atan2(way[1], way[0]) + np.arccos((COUPLER**2 + far**2 - ROCKER**2) / (2 * COUPLER * far))
    end = COUPLER * unit(coupler) - way
    rocker = atan2(end[1], end[0])
    A = np.column_stack([COUPLER * normal(coupler), -ROCKER * normal(rocker)])
    first = np.linalg.solve(A, -CRANK * normal(phi))
    bend = CRANK * unit(phi) + COUPLER * unit(coupler) * first[0] ** 2 - ROCKER * unit(rocker) * first[1] ** 2
    return coupler, rocker, first, np.linalg.solve(A, bend)


def four_bar(mass: float, share: float) -> System:
    """Crank, coupler of this mass and share of inertia, rocker."""
    coupler, rocker, first, _ = closure(PHI)
    bodies = (
        Body("crank", M1, M1 * CRANK**2 / 12, (CRANK / 2, 0.0), angle=PHI, rate=RATE),
        Body("coupler", mass, share * COUPLER**2 / 12, (COUPLER / 2, 0.0), tuple(CRANK * unit(PHI)), coupler,
             tuple(RATE * CRANK * normal(PHI)), first[0] * RATE),
        Body("rocker", M3, M3 * ROCKER**2 / 12, (ROCKER / 2, 0.0), (GROUND, 0.0), rocker, rate=first[1] * RATE),
    )  # fmt: skip
    joints = (
        Hinge("crank", "ground", name="O"),
        Hinge("coupler", "crank", (0.0, 0.0), (CRANK, 0.0), name="A"),
        Hinge("rocker", "ground", (0.0, 0.0), (GROUND, 0.0), name="C"),
        Hinge("coupler", "rocker", (COUPLER, 0.0), (ROCKER, 0.0), name="B"),
    )
    return System([Linkage(bodies, joints, (Gravity((0.0, -G)),))])
