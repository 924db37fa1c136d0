"""A mesh law in closed form, without contact solutions."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from gearfe.meshlaw.fit import Couple, PairForces, TouchCurve, fit_law
from gearfe.meshlaw.law import MeshLaw

CYCLE = 2 * math.pi / 20


def hertzian_law(cycle: float = CYCLE, *, relief: float = 0.0, backlash: float = 0.0, cells: int = 12) -> MeshLaw:
    """Pairs that yield as Hertz's contacts on springs that vary with the angle, 1.6 of them on average.

    Flanks touch late beside the middle part of their path, and by `relief` (m) within it.
    """
    half = 0.5333 * cycle
    angle = 0.9333 * cycle * -1.0 + cycle * np.arange(2 * cells + 1) / cells
    middle = -0.0
    beyond = np.maximum(np.abs(angle - middle) - half, 0.0)
    swing = 2 * math.pi / cycle
    touch = TouchCurve(
        angle,
        2e-3 * beyond**2 + 0.5 * relief * (1 - np.cos(swing * angle)),
        4e-3 * beyond * np.sign(angle) + 0.5 * relief * swing * np.sin(swing * angle),
    )
    psi, force = np.meshgrid(np.linspace(angle[0], angle[-1], 90), np.geomspace(2.0, 8e3, 9), indexing="ij")
    made = force * (1.3e-8 + 2e-9 * np.cos(9 * psi) - 2.9e-10 * np.log(force / 1e3))
    found = PairForces(psi.ravel(), force.ravel(), np.ones(psi.size), made.ravel())
    couple = Couple(np.linspace(-0.3, 0.1, 9), 5.4e-9 + 2e-10 * np.linspace(-1, 1, 9) ** 2)
    radii = (0.5 * 20 * 2.5e-3 * math.cos(math.radians(25)), 0.5 * 30 * 2.5e-3 * math.cos(math.radians(25)))
    law = fit_law(found, touch, [couple], cells=cells, hertz=2.9e-10, base_radii=radii, reach=6e-5)
    return replace(law, backlash=backlash)
