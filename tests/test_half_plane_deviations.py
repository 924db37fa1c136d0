"""Deviations in the half-plane law: reliefs and layers that other geometries have exactly."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gearfe.contact.half_plane import half_plane_pair, solve_half_plane
from gearfe.gear.deviation import Deviation, ToothDeviations
from gearfe.gear.pair import TipRelief
from gearfe.gear.touching import face_of
from gearfe.stiffness.sweep import elastic_pair

from .gears import pair as gear_pair
from .half_plane_pairs import PAIRS, angles_of, law_of


def test_relief_as_a_deviation() -> None:
    """Parabolic tip relief of 10 um over 1.2 mm of roll, in the geometry and its mesh, or in the curves alone."""
    relief = TipRelief(10e-6, 1.2e-3, 2.0)
    for form in ({}, {"tip_round": 5e-5}):
        plain, relieved = gear_pair(**form), gear_pair(tip_relief=relief, **form)
        deviations = []
        for one in (relieved.pinion, relieved.wheel):
            flank = face_of(one).flank
            roll = np.linspace(flank.start, flank.end, 400)
            deviations.append(ToothDeviations((Deviation.sampled(flank.relief, roll).scaled(-1.0),)))
        elastic = elastic_pair(plain, law="half_plane")
        found = half_plane_pair(plain, elastic, deviations=(deviations[0], deviations[1]))
        without = half_plane_pair(plain, elastic)
        expected = half_plane_pair(relieved, elastic_pair(relieved, law="half_plane"))
        angles = angles_of(plain, 16)
        touch = [law.flanks.touching(angles).twist for law in (found, expected)]
        assert touch[0] == pytest.approx(touch[1], abs=2e-8 if form else 1e-9)
        for degrees in (0.02, 0.2):
            one, two, three = (
                solve_half_plane(law, angles, math.radians(degrees)) for law in (found, expected, without)
            )
            assert set(one.status) == {"converged"}
            assert np.abs(one.torque_wheel / two.torque_wheel - 1).max() < 3e-4
            assert np.abs(three.torque_wheel / two.torque_wheel - 1).max() > 0.03


def test_an_even_deviation_turns_the_wheel() -> None:
    """A layer h on an involute is the involute turned by h/r_b: on the path the pair touches h/r_b2 earlier."""
    pair, height = PAIRS["rounded"], 5e-6
    flank = face_of(pair.pinion).flank
    layer = ToothDeviations((Deviation.straight([flank.start, flank.end], [height, height]),))
    plain = law_of("rounded")
    elastic = elastic_pair(pair, law="half_plane")
    law = half_plane_pair(pair, elastic, deviations=(layer, ToothDeviations()))
    angles = angles_of(pair, 7)
    found, expected = law.flanks.touching(angles), plain.flanks.touching(angles)
    on_path = ((expected.place > 0.05) & (expected.place < 0.95)).all(axis=1)
    assert on_path.sum() >= 7
    earlier = height / pair.wheel.base_radius
    assert (expected.twist - found.twist)[on_path] == pytest.approx(earlier, rel=1e-6)
    # and so it carries there what the plain pair does at a larger twist
    twist = math.radians(0.05)
    one = solve_half_plane(law, angles, twist)
    two = solve_half_plane(half_plane_pair(pair, elastic), angles, twist + earlier)
    assert one.torque_wheel == pytest.approx(two.torque_wheel, rel=2e-3)
