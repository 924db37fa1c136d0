"""Harmonics that a turning carrier couples, against a closed form in complex coordinates."""

from __future__ import annotations

import numpy as np
import pytest

from gearfe.drivetrain.runup import torus
from gearfe.drivetrain.runup.coupling import TurnedSpring, coupling

MASS, BORE_MASS, SPRING, GROUND, DAMPER, FORCE = 2.0, 5.0, 3e6, 4e6, 40.0, 7.0
MESH, CARRIER = 900.0, 130.0  # rad/s


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_mass_in_a_turning_frame_on_a_bore_alike_in_all_directions(sense: float) -> None:
    r"""With z in the frame and Z the bore, :math:`Z = e^{i\Omega t}\zeta` makes all constant.

    .. math:: m(\ddot z + 2i\Omega\dot z - \Omega^2 z) = f + k(\zeta - z), \qquad
        M(\ddot\zeta + 2i\Omega\dot\zeta - \Omega^2\zeta) = -K\zeta + k(z - \zeta)

    A damper in the axes of the housing adds :math:`-c(\dot x - \dot Z)` to these forces, x the mass in these axes, so
    the spring becomes :math:`k + i(\omega + \Omega)c`. Of this the constant part has :math:`c\Omega` across z.
    """
    speed = sense * CARRIER
    phases = torus.Phases.of((1.0, MESH / CARRIER), (1,))
    count = torus.count_below(phases, 3.0)
    waves = torus.harmonics(phases, count).waves
    omega = waves @ np.array([MESH, CARRIER])
    spring, damper = (
        value * np.block([[np.eye(2), -np.eye(2)], [-np.eye(2), np.eye(2)]]) for value in (SPRING, DAMPER)
    )
    mass = np.diag([BORE_MASS, BORE_MASS, MASS, MASS])
    stiffness = spring + np.diag([GROUND, GROUND, -MASS * speed**2, -MASS * speed**2])
    stiffness[2, 3], stiffness[3, 2] = -DAMPER * speed, DAMPER * speed
    coriolis = np.zeros((4, 4))
    coriolis[2, 3], coriolis[3, 2] = -2.0 * MASS * speed, 2.0 * MASS * speed
    H = np.linalg.inv(stiffness + 1j * omega[:, None, None] * (damper + coriolis) - omega[:, None, None] ** 2 * mass)
    springs = [
        TurnedSpring(np.arange(4), np.array([1.0, 1.0, value, value]), rates, 1, sense)
        for value, rates in ((SPRING, False), (DAMPER, True))
    ]
    # the factors make the last two directions the motion of the shaft times the constant
    number = {tuple(k): n for n, k in enumerate(waves.tolist())}
    free = np.zeros((len(waves), 4), dtype=complex)
    free[number[1, 0]] = H[number[1, 0]] @ np.array([0.0, 0.0, FORCE, 0.0])
    found = coupling(springs, waves, 1, omega, H)(free)

    def answer(w: float) -> complex:
        """Frequency response of z to a force at w in the frame."""
        fixed = w + speed
        bearing = SPRING + 1j * fixed * DAMPER
        return 1.0 / (bearing - MASS * fixed**2 - bearing**2 / (bearing + GROUND - BORE_MASS * fixed**2))

    one, two = found[number[1, 0], 2:]
    assert 0.5 * (one + 1j * two) == pytest.approx(0.5 * FORCE * answer(MESH), rel=1e-10)
    assert 0.5 * np.conj(one - 1j * two) == pytest.approx(0.5 * FORCE * answer(-MESH), rel=1e-10)
    beside = [number[1, 1], number[1, -1]]
    others = np.delete(found, [number[1, 0], *beside], axis=0)
    assert np.abs(others).max() < 1e-12 * np.abs(found).max()
