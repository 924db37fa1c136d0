"""Deviations of micrometres: their pieces, pitch errors and different teeth, unloaded and under load."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gearfe import InputError
from gearfe.gears.contact.half_plane import half_plane_pair, solve_half_plane
from gearfe.gears.gearmesh.sweep import elastic_pair
from gearfe.gears.geometry.deviation import Deviation, total
from gearfe.gears.geometry.face import NOMINAL, ToothDeviations, face_of
from gearfe.gears.geometry.first_contact import ToothFlanks, first_contact_curve
from tests.makers.gears import gear as single_gear
from tests.makers.gears import pair as gear_pair

PAIR = gear_pair(tip_round=1e-4)
S = np.linspace(4e-3, 18e-3, 200)


def layer(height: float) -> Deviation:
    return Deviation.straight([0.0, 30e-3], [height, height])


@pytest.fixture(scope="module")
def law():
    return half_plane_pair(elastic_pair(PAIR))


# ---- one deviation -------------------------------------------------------------------------------------------------


def test_straight_lines_keep_their_kinks() -> None:
    chart = Deviation.straight([5e-3, 10e-3, 15e-3], [0.0, 0.0, -20e-6])
    height, slope = chart.at(S)
    assert height == pytest.approx(np.interp(S, [5e-3, 10e-3, 15e-3], [0, 0, -20e-6]), abs=1e-18)
    assert slope == pytest.approx(np.where((S >= 10e-3) & (S <= 15e-3), -4e-3, 0), abs=1e-15)
    assert chart.kinks == (10e-3, 15e-3)
    assert chart.most == 20e-6


def test_a_sum_is_exact() -> None:
    wave = Deviation.sampled(lambda s: (1e-6 * np.sin(900 * s), 9e-4 * np.cos(900 * s)), np.linspace(3e-3, 20e-3, 90))
    parts = [Deviation.straight([5e-3, 10e-3, 15e-3], [0, 3e-6, -20e-6]), wave, layer(2e-6)]
    made = total(parts)
    assert made is not None
    for i in (0, 1):
        assert made.at(S)[i] == pytest.approx(sum(part.at(S)[i] for part in parts), abs=1e-16)
    assert made.kinks == (3e-3, 5e-3, 10e-3, 15e-3, 20e-3)  # the wave starts and ends with a slope
    assert total([]) is None


def test_measured_points_do_not_ring_beside_a_kink() -> None:
    """A linear relief measured every h: within the bound of the docstring, exact points, no overshoot."""
    change, kink = 0.02, 10e-3
    for h in (0.1e-3, 0.05e-3):
        roll = np.arange(5e-3, 15e-3, h)
        true = lambda s: -change * np.maximum(0, s - kink)  # noqa: E731
        measured = Deviation.through(roll, true(roll))
        s = np.linspace(roll[0], roll[-1], 20001)
        off = np.abs(measured.at(s)[0] - true(s))
        assert off.max() <= 4 / 27 * change * h + 1e-12
        assert off[np.abs(s - kink) > 2 * h].max() < 1e-15
        assert measured.at(s)[0].max() == 0.0


@pytest.mark.parametrize("roll", [[1.0], [1.0, 1.0], [2.0, 1.0], [1.0, math.nan]])
def test_points_that_make_no_curve(roll: list[float]) -> None:
    with pytest.raises(InputError, match="points"):
        Deviation.through(roll, [0.0] * len(roll))


# ---- teeth ---------------------------------------------------------------------------------------------------------


def test_lists_of_the_wrong_length() -> None:
    with pytest.raises(InputError, match="each of the 20 teeth"):
        ToothFlanks(PAIR, (ToothDeviations(turn=(0.0,) * 19), NOMINAL[1]))
    with pytest.raises(InputError, match="profiles"):
        ToothDeviations(profile=(1,))


def test_a_turned_tooth_is_an_even_layer(law) -> None:
    """Tooth 3 of the pinion and tooth 7 of the wheel turned by h/r_b: on involutes that is a layer h on these teeth."""
    h, teeth = 3e-6, (3, 7)
    turned, layered = [], []
    for gear, tooth in zip((PAIR.pinion, PAIR.wheel), teeth, strict=True):
        on = np.arange(gear.teeth) == tooth
        turned.append(ToothDeviations(turn=tuple(on * h / gear.base_radius)))
        layered.append(ToothDeviations((None, layer(h)), profile=tuple(on.astype(int))))
    angles = np.linspace(-4, 4, 60) * PAIR.mesh_cycle + 0.1  # both teeth come by
    one, other = law.deviated(tuple(turned)), law.deviated(tuple(layered))
    found, expected = one.teeth.first_contacts(angles), other.teeth.first_contacts(angles)
    plain = law.teeth.first_contacts(angles)
    path = ((plain.place > 0.02) & (plain.place < 0.98)).all(axis=1)
    assert found.twist[path] == pytest.approx(expected.twist[path], abs=1e-10 / PAIR.wheel.base_radius)
    touched = (plain.twist - found.twist)[path] * PAIR.wheel.base_radius
    with_turn = np.stack([plain.pair % 20 == 3, (-1 - plain.pair) % 30 == 7])[:, path].sum(axis=0)
    assert touched == pytest.approx(h * with_turn, abs=1e-10)
    assert set(with_turn) == {0, 1}
    torque = [solve_half_plane(law_, angles, math.radians(0.03)).torque_wheel for law_ in (one, other, law)]
    assert torque[0] == pytest.approx(torque[1], rel=2e-4)
    assert np.abs(torque[0] / torque[2] - 1).max() > 0.02


def test_all_teeth_turned_are_gears_turned(law) -> None:
    """By e_1 and e_2: the same as at the pinion angle + e_1 and the twist + e_2 + e_1 z1/z2."""
    e1, e2 = 2e-4, -1e-4
    angles, twist = np.array([0.02, 0.11, 0.2]), math.radians(0.04)
    found = solve_half_plane(
        law.deviated((ToothDeviations(turn=(e1,) * 20), ToothDeviations(turn=(e2,)))), angles, twist
    )
    expected = solve_half_plane(law, angles + e1, twist + e2 + e1 / PAIR.gear_ratio)
    assert found.torque_wheel == pytest.approx(expected.torque_wheel, rel=1e-6)


def test_torque_is_the_slope_of_the_energy_with_errors_on_every_tooth(law) -> None:
    rng = np.random.default_rng(4)
    made = []
    for gear in (PAIR.pinion, PAIR.wheel):
        waves = [
            Deviation.sampled(lambda s, p=p: (1e-6 * np.sin(600 * s + p), 6e-4 * np.cos(600 * s + p)), S)
            for p in rng.uniform(0, 6, 3)
        ]
        turn = rng.normal(0, 3e-6, gear.teeth) / gear.base_radius
        made.append(ToothDeviations(tuple(waves), tuple(rng.integers(0, 3, gear.teeth)), tuple(turn)))
    bad = law.deviated(tuple(made))
    angles, twist, step = np.linspace(0, 2, 12), math.radians(0.05), 1e-6
    here, less, more = (solve_half_plane(bad, angles, twist + d) for d in (0.0, -step, step))
    assert set(here.status) == {"converged"}
    assert (more.energy - less.energy) / (2 * step) == pytest.approx(here.torque_wheel, rel=2e-5)
    assert (more.torque_wheel - less.torque_wheel) / (2 * step) == pytest.approx(here.tangent, rel=2e-3)


def test_the_full_period_comes_again(law) -> None:
    """After the least common multiple of the teeth every tooth meets its mate again; before it does not."""
    bad = law.deviated(
        (ToothDeviations(turn=tuple(1e-4 * np.arange(20) / 20)), ToothDeviations(turn=tuple([1e-5] + [0] * 29)))
    )
    angles = np.array([0.03, 0.2])
    touch = [bad.teeth.first_contacts(angles + n * PAIR.mesh_cycle) for n in (0, 60, 20)]
    assert touch[0].twist == pytest.approx(touch[1].twist, abs=1e-14)
    assert np.abs(touch[0].twist - touch[2].twist).max() > 9e-6


def test_the_curve_of_one_pair() -> None:
    """On the path flat at the lost motion, shifted by mesh cycles from pair to pair, and by its pitch errors."""
    cycle = PAIR.mesh_cycle
    start, end = (PAIR.pinion_angle_at(s) for s in PAIR.path_limits())
    on = np.linspace(start + 0.01, end - 0.01, 20)
    assert first_contact_curve(PAIR, on) == pytest.approx(PAIR.contact_twist, abs=1e-14)
    angles = np.linspace(start - 0.15, end + 0.15, 41)
    assert first_contact_curve(PAIR, angles) == pytest.approx(
        first_contact_curve(PAIR, angles + 3 * cycle, number=-3), abs=1e-13
    )
    assert np.isinf(first_contact_curve(PAIR, np.array([math.pi])))
    turn = tuple(1e-4 * (np.arange(20) == 17))
    shifted = first_contact_curve(PAIR, on + 3 * cycle, number=-3, deviations=(ToothDeviations(turn=turn), NOMINAL[1]))
    assert PAIR.contact_twist - shifted[:-2] == pytest.approx(1e-4 / PAIR.gear_ratio, rel=1e-9)


def test_an_undercut_root_follows_the_involute() -> None:
    """A relieved root leaves no step at the edge of an undercut: the flank is one curve, radii are found on it."""
    pinion = single_gear(13, pressure_angle=20.0, profile_shift=-0.283, tip_round=1e-4)
    flank = face_of(pinion).flank
    relief = Deviation.straight([flank.start, 0.5 * (flank.start + flank.end), flank.end], [-27e-6, 0.0, 0.0])
    face = face_of(pinion, relief)
    assert face.undercut
    steps = [np.diff(one.points(np.array([-1e-9, 0.0])))[0] for one in (face_of(pinion), face)]
    assert abs(steps[1] - steps[0]) < 1e-9
    u = np.linspace(-0.45, -0.05, 50)
    assert face.at_radius(np.abs(face.points(u))) == pytest.approx(u, abs=1e-6)
