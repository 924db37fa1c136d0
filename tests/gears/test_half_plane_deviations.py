"""Deviations in the half-plane law: reliefs and layers that other geometries have exactly."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gearfe.gears.contact.half_plane import half_plane_pair, solve_half_plane
from gearfe.gears.gearmesh.sweep import elastic_pair
from gearfe.gears.geometry.deviation import Deviation
from gearfe.gears.geometry.face import ToothDeviations, face_of
from gearfe.gears.geometry.first_contact import Faces
from gearfe.gears.geometry.pair import TipRelief
from tests.makers.gears import pair as gear_pair
from tests.makers.half_plane_pairs import PAIRS, angles_of, law_of


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
        found = half_plane_pair(elastic).deviated((deviations[0], deviations[1]))
        without = half_plane_pair(elastic)
        expected = half_plane_pair(elastic_pair(relieved, law="half_plane"))
        angles = angles_of(plain, 16)
        touch = [law.teeth.first_contacts(angles).twist for law in (found, expected)]
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
    law = half_plane_pair(elastic).deviated((layer, ToothDeviations()))
    angles = angles_of(pair, 7)
    found, expected = law.teeth.first_contacts(angles), plain.teeth.first_contacts(angles)
    on_path = ((expected.place > 0.05) & (expected.place < 0.95)).all(axis=1)
    assert on_path.sum() >= 7
    earlier = height / pair.wheel.base_radius
    assert (expected.twist - found.twist)[on_path] == pytest.approx(earlier, rel=1e-6)
    # and so it carries there what the plain pair does at a larger twist
    twist = math.radians(0.05)
    one = solve_half_plane(law, angles, twist)
    two = solve_half_plane(half_plane_pair(elastic), angles, twist + earlier)
    assert one.torque_wheel == pytest.approx(two.torque_wheel, rel=2e-3)


def test_heights_are_those_of_the_flank_across_the_begin_of_a_relief() -> None:
    """A linear relief has a kink; wherever it stands under the contact, heights belong to the arcs they are told of."""
    pair = PAIRS["rounded"]
    flank = face_of(pair.pinion).flank
    kink = flank.start + 0.55 * (flank.end - flank.start)
    relief = ToothDeviations((Deviation.straight([flank.start, kink, flank.end], [0.0, 0.0, -30e-6]),))
    law = half_plane_pair(elastic_pair(pair, law="half_plane")).deviated((relief, ToothDeviations()))
    tables = law.tables.of(np.array([[0, 1]]))
    low, high = tables.low[0, 0, 0], tables.high[0, 0, 0]
    arcs = np.linspace(low + 0.2 * (high - low), high - 0.2 * (high - low), 4001)
    bends = np.abs(np.diff(tables.at(np.stack([arcs, arcs])[None])[1][0, 0]))
    middle = arcs[np.argmax(bends)]  # where the tangent turns most: the kink
    moved = 0
    for shift in -1.4e-4 + np.linspace(-3e-7, 3e-7, 61):  # a place of x stands at the kink
        start = np.array([[middle + shift, 0.5 * (tables.low[0, 1, 0] + tables.high[0, 1, 0])]])
        point, along = tables.at(start[:, :, None])
        way = along[:, :, 0] / np.abs(along[:, :, 0]) * np.array([1.0, -1.0])
        turn = -1j / way * np.exp(0.05j)  # along the tangent but for 3 deg, so that Newton has a way to go
        faces = Faces(turn, -point[:, :, 0] * turn, np.zeros((1, 2)), start)
        found, heights, points = faces.heights(tables, np.linspace(-1.5e-4, 1.5e-4, 31)[None])
        exact = tables.at(found)[0]
        moved += int((found[0, 0] > middle).any() and (found[0, 0] < middle).any())
        np.testing.assert_allclose(points, exact, rtol=0, atol=1e-16)
        seen = (exact - point) * turn[:, :, None]
        np.testing.assert_allclose(heights, seen.real, rtol=0, atol=1e-15)
        np.testing.assert_allclose(-seen.imag[0, 0], np.linspace(-1.5e-4, 1.5e-4, 31), rtol=0, atol=3e-9)
    assert moved > 30
