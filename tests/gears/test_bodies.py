"""Flexibility of gear bodies: closed forms of discs, and what finite elements add for a smaller bore."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gearfe import Gear, GearPair
from gearfe.fem.plane import Material
from gearfe.gears.gearmesh.bodies import body_bending, body_twist, contact_zone, edge_deflections
from gearfe.gears.width import WideFlanks, WideMesh, contact_lines, sweep_width, wide_compliance

STEEL = Material(206e9, 0.3, 7850.0)


@pytest.mark.parametrize(("clamped", "edge"), [(8e-3, 38e-3), (20e-3, 66e-3), (60e-3, 45e-3)])
@pytest.mark.parametrize("thickness", [2e-3, 11e-3])
def test_even_force_on_the_edge_of_a_plate(clamped: float, edge: float, thickness: float) -> None:
    """Timoshenko and Woinowsky-Krieger, art. 16 and 17: (r phi')' - phi/r = Q r/D, and the shear force by itself."""
    G, nu = 206e9 / 2.6, 0.3
    D = 206e9 * thickness**3 / 12.0 / (1.0 - nu**2)
    sign = math.copysign(1.0, edge - clamped)
    c = sign / (4.0 * math.pi * D)  # slope: c r ln r + A r + B/r; clamped, and no moment at the edge
    matrix = [[clamped, 1.0 / clamped], [1.0 + nu, (nu - 1.0) / edge**2]]
    A, B = np.linalg.solve(
        matrix, [-c * clamped * math.log(clamped), -c * (math.log(edge) + 1.0 + nu * math.log(edge))]
    )

    def below(r: float) -> float:
        return c * r**2 * (0.5 * math.log(r) - 0.25) + 0.5 * A * r**2 + B * math.log(r)

    bending = -(below(edge) - below(clamped))
    shear = abs(math.log(edge / clamped)) / (2.0 * math.pi * 5.0 / 6.0 * G * thickness)
    assert edge_deflections(clamped, edge, thickness, STEEL)[0] == pytest.approx(abs(bending) + shear, rel=1e-6)


def test_tilt_of_a_nearly_rigid_ring() -> None:
    """Far harmonics of a long plate are those of its edge alone: they do not depend on the clamped circle."""
    near, far = (edge_deflections(clamped, 40e-3, 5e-3, STEEL) for clamped in (20e-3, 10e-3))
    assert near[12:] == pytest.approx(far[12:], rel=1e-3)
    assert far[1] > 1.5 * near[1]


@pytest.mark.slow
def test_a_smaller_bore_of_a_helical_wheel_adds_twist_and_bending() -> None:
    """Finite elements over the width against the closed forms; without the bending they are far off."""
    angles: Any = {"pressure_angle": math.radians(20.0), "helix_angle": math.radians(30.0)}
    pinion = Gear(20, 2e-3, face_width=8e-3, bore_diameter=20e-3, hand="right", **angles)
    wheel = replace(pinion, teeth=40, hand="left", bore_diameter=54e-3)
    whole, bodies, twist = [], [], []
    for bore in (54e-3, 18e-3):
        pair = GearPair(pinion, replace(wheel, bore_diameter=bore))
        mesh = WideMesh(pair, functions=4, materials=(STEEL, STEEL))
        sweep = sweep_width(contact_lines(wide_compliance(mesh), WideFlanks()), [50.0], positions=6)
        whole.append(wheel.base_radius**2 / float(sweep.tangent[0, :, 0, 0].mean()))
        twist.append(body_twist(pair.wheel, STEEL))
        bodies.append(twist[-1] + body_bending(pair.wheel, STEEL, contact_zone(pair)))
    added = whole[1] - whole[0]
    assert bodies[1] - bodies[0] == pytest.approx(added, rel=0.1)
    assert twist[1] - twist[0] < 0.5 * added
