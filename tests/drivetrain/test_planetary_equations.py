"""Planetary stages against the published equations of motion, written down a second time, for any number of planets."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from scipy.linalg import eig, eigvals

from gearfe.base.typing import Array
from gearfe.drivetrain.modes.whirl import train_modes
from gearfe.drivetrain.train import Damping, Drive, build_train
from gearfe.multibody import constant
from tests.makers.planetary import ALPHA, LIN_PARKER, SPEED, TORQUE, stage

MESH, BEARING, RING = 5e8, 1e8, 1e9
HIGHEST = 2e4


def matrices(angles: Sequence[float]) -> tuple[Array, Array, Array]:
    """Return mass (kg), Coriolis (kg, per carrier speed) and stiffness (N/m) matrices of a planar stage.

    J. Lin and R. G. Parker, J. Vib. Acoust. 121 (1999) 316, eqs. 1 to 4 and appendix: x, y and u = r theta of carrier,
    ring and sun, then radial, tangential and u of each planet, all in axes that turn with the carrier.
    """
    size = 9 + 3 * len(angles)
    mass, stiffness, coriolis = np.zeros((size, size)), np.zeros((size, size)), np.zeros((size, size))

    def spring(value: float, gradient: dict[int, float]) -> None:
        row = np.zeros(size)
        for index, share in gradient.items():
            row[index] = share
        stiffness[:] += value * np.outer(row, row)

    kinds = ["carrier", "ring", "sun", *["planet"] * len(angles)]
    for body, kind in enumerate(kinds):
        m, inertia = LIN_PARKER[kind]
        mass[3 * body : 3 * body + 3, 3 * body : 3 * body + 3] = np.diag([m, m, inertia])
        coriolis[3 * body, 3 * body + 1], coriolis[3 * body + 1, 3 * body] = -2.0 * m, 2.0 * m
        if kind != "planet":
            spring(BEARING, {3 * body: 1.0})
            spring(BEARING, {3 * body + 1: 1.0})
    spring(RING, {5: 1.0})
    sa, ca = math.sin(ALPHA), math.cos(ALPHA)
    for n, angle in enumerate(angles):
        radial, tangential, turn = range(9 + 3 * n, 12 + 3 * n)
        s, c = math.sin(angle), math.cos(angle)
        spring(BEARING, {0: c, 1: s, radial: -1.0})
        spring(BEARING, {0: -s, 1: c, 2: 1.0, tangential: -1.0})
        at_sun, at_ring = angle - ALPHA, angle + ALPHA
        spring(MESH, {6: -math.sin(at_sun), 7: math.cos(at_sun), 8: 1.0, radial: -sa, tangential: -ca, turn: 1.0})
        spring(MESH, {3: -math.sin(at_ring), 4: math.cos(at_ring), 5: 1.0, radial: sa, tangential: -ca, turn: -1.0})
    return mass, coriolis, stiffness


def published(angles: Sequence[float], speed: float = 0.0) -> Array:
    r"""Return rising natural frequencies (Hz) without the free one, at a speed of the carrier (rad/s).

    In axes that turn with the carrier's arm by theta beside the mean motion, the kinetic energy of a planet at
    (r + zeta, eta - r theta) has the centrifugal part m Omega^2 (zeta^2 + (eta - u_c)^2)/2. Its Coriolis part is the
    published one. So a rotation of the whole stage stays free at any speed. Without u_c, as published, rotational modes
    differ by m Omega^2/k, here 1e-4.
    """
    mass, coriolis, stiffness = matrices(angles)
    if speed == 0.0:
        values = np.sqrt(np.abs(eigvals(stiffness, mass).real))
    else:
        size = len(mass)
        centripetal = stiffness.copy()
        for body in range(size // 3):  # a planet moves along its way round by more than the carrier's arm
            first, second = np.eye(size)[3 * body], np.eye(size)[3 * body + 1] - (body > 2) * np.eye(size)[2]
            moved = np.outer(first, first) + np.outer(second, second)
            centripetal -= speed**2 * mass[3 * body, 3 * body] * moved
        first_order = np.block([[np.zeros_like(mass), np.eye(size)], [-centripetal, -speed * coriolis]])
        rates = eig(first_order, np.block([[np.eye(size), 0 * mass], [0 * mass, mass]]), right=False)
        values = rates.imag[rates.imag > 0.0]
    found = np.sort(values) / (2.0 * math.pi)
    return np.asarray(found[(found > 1.0) & (found < HIGHEST)])


#: Teeth of sun and planet, and places of the planets in pitches of sun + ring.
STAGES = {
    "three": ((30, 36), [0, 44, 88]),
    "three unequal": ((30, 36), [0, 40, 90]),
    "four": ((30, 36), [0, 33, 66, 99]),
    "four, opposite in pairs": ((30, 36), [0, 28, 66, 94]),
    "five": ((30, 25), [0, 22, 44, 66, 88]),
    "six": ((36, 24), [0, 20, 40, 60, 80, 100]),
    "six, opposite in pairs": ((36, 24), [0, 19, 41, 60, 79, 101]),
}


@pytest.mark.parametrize("name", STAGES)
def test_natural_frequencies_are_those_of_the_published_equations(name: str) -> None:
    teeth, places = STAGES[name]
    angles = [2.0 * math.pi * place / (2 * (teeth[0] + teeth[1])) for place in places]
    drive = Drive("sun", "sun", constant(SPEED), torque=constant(TORQUE))
    train = stage(len(places), teeth, angles=angles, drive=drive, damping=Damping(gyroscopic=False))
    found = train_modes(build_train(train), [0.0], HIGHEST)
    expected = published(angles)
    assert found.free == 1
    np.testing.assert_allclose(found.frequency[0], expected, rtol=1e-9)


@pytest.mark.parametrize("name", ["three unequal", "four", "six, opposite in pairs"])
def test_whirl_frequencies_at_speed_are_those_of_the_published_equations(name: str) -> None:
    """With Coriolis and centrifugal forces; the carrier turns at 7 to 9 % of the lowest frequency."""
    teeth, places = STAGES[name]
    angles = [2.0 * math.pi * place / (2 * (teeth[0] + teeth[1])) for place in places]
    drive = Drive("sun", "sun", constant(SPEED), torque=constant(TORQUE))
    model = build_train(stage(len(places), teeth, angles=angles, drive=drive, damping=Damping(gyroscopic=False)))
    speed = 1500.0
    found = train_modes(model, [speed], HIGHEST)
    expected = published(angles, speed * float(model.kinematics.ratios[2]))
    np.testing.assert_allclose(found.frequency[0], expected, rtol=1e-6)
