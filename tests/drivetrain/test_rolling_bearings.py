"""Rolling bearings against published values, closed forms, and the energy that their forces come from."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from gearfe.base.errors import InputError
from gearfe.drivetrain.bearings import BallBearing, RollerBearing, Row, carrying, deflected
from gearfe.drivetrain.bearings.hertz import LINE_CONSTANT, axis_ratio, point_constant

#: Steel of the published example, (Pa, 1).
STEEL = 210e9, 0.3
#: Deep-groove ball bearing of the examples in github.com/minzhun/ISO16281, whose values are those of the program MASTA.
DEEP = BallBearing(7, 11.5e-3, 43.5e-3, ball=STEEL, ring=STEEL)
#: 218 angular-contact, 209 deep-groove and 209 cylindrical roller bearing, Harris and Kotzalas, tables of ch. 2 and 7.
ANGULAR = BallBearing(16, 22.23e-3, 125.3e-3, math.radians(40.0), inner_osculation=0.5232, outer_osculation=0.5232)
GROOVE = BallBearing(9, 12.7e-3, 65e-3, inner_osculation=0.52, outer_osculation=0.52)
ROLLER = RollerBearing(14, 10e-3, 65e-3, length=9.6e-3, profile="straight")
#: Of no published one.
TAPERED = RollerBearing(17, 8e-3, 40e-3, math.radians(14.0), length=12e-3, preload=4e-6)
PAIR = replace(ANGULAR, preload=3e-6, rows=(Row(-12e-3, -1), Row(12e-3, 1)))
ALL: dict[str, BallBearing | RollerBearing] = {
    "deep": DEEP,
    "angular": ANGULAR,
    "roller": ROLLER,
    "tapered": TAPERED,
    "pair": PAIR,
}


@pytest.mark.parametrize(
    ("clearance_um", "load", "component", "moved_um"),
    [
        (0.0, (1000.0, 0.0), 0, 15.1101),
        (0.0, (0.0, 1000.0), 1, 133.5381),
        (10.0, (1000.0, 0.0), 0, 21.223),
        (10.0, (0.0, 1000.0), 1, 149.1717),
        (10.0, (1000.0, 1000.0), 0, 19.5923),
        (10.0, (1000.0, 1000.0), 1, 146.4603),
    ],
)
def test_displacements_of_a_ball_bearing_are_those_of_masta(
    clearance_um: float, load: tuple[float, float], component: int, moved_um: float
) -> None:
    # its arm of the tilt is half the pitch diameter, here it is the groove's radius: 1 % of the tilt's part
    bound = 1e-4 if 0.0 in load else 1e-3
    state = carrying(replace(DEEP, clearance=1e-6 * clearance_um), np.array([*load, 0.0, 0.0, 0.0]))
    assert state.displacement[component] == pytest.approx(1e-6 * moved_um, rel=bound)


def test_tilt_under_a_moment_is_that_of_masta() -> None:
    state = carrying(DEEP, np.array([0.0, 0.0, 0.0, 0.0, 1.0]))
    radius = 0.5 * 43.5 + 0.02 * 11.5  # of the inner groove's centre (mm)
    assert state.displacement[4] == pytest.approx(3.6957e-3, rel=1.5 * (radius / 21.75 - 1.0))


@pytest.mark.parametrize(("exponent", "table"), [(1.5, 4.37), (10.0 / 9.0, 4.08)])
def test_the_largest_load_of_an_element_is_that_of_sjovall(exponent: float, table: float) -> None:
    # Qmax = 4.37 Fr/Z and 4.08 Fr/Z without clearance, NSK technical report E728g, eq. (4) and (5)
    integral = quad(lambda x: math.cos(x) ** exponent * math.cos(x), -math.pi / 2, math.pi / 2)[0] / (2.0 * math.pi)
    bearing = replace(GROOVE, elements=400) if exponent == 1.5 else replace(ROLLER, elements=400)
    load = 1000.0
    state = carrying(bearing, np.array([load, 0.0, 0.0, 0.0, 0.0]))
    factor = state.element_loads.max() * bearing.elements / load
    assert factor == pytest.approx(1.0 / integral, rel=2e-3)
    assert factor == pytest.approx(table, abs=0.015)


@pytest.mark.parametrize(("bearing", "factor"), [(ANGULAR, 1.216), (replace(TAPERED, profile="straight"), 1.260)])
def test_half_loaded_rows_carry_the_axial_load_of_sjovall(bearing: BallBearing | RollerBearing, factor: float) -> None:
    # Fa = 1.216 Fr tan(alpha) of points and 1.260 of lines where half of the elements are loaded, NSK E728g
    tangent = math.tan(bearing.contact_angle)
    many = replace(bearing, elements=400, preload=0.0)
    state = deflected(many, 1e-8 * np.eye(5)[0])
    exponent = 1.5 if isinstance(bearing, BallBearing) else 10.0 / 9.0
    axial, radial = (quad(lambda x, n=n: math.cos(x) ** n, 0.0, math.pi / 2)[0] for n in (exponent, exponent + 1.0))
    ratio = state.load[1] / (state.load[0] * tangent)
    assert ratio == pytest.approx(axial / radial, rel=1e-4)
    assert ratio == pytest.approx(factor, rel=2e-3)  # lines there have the exponent 1.1
    assert state.loaded == pytest.approx(200, abs=2)


def test_the_209_ball_bearing_of_harris() -> None:
    # Harris and Kotzalas, Essential Concepts, ch. 7: delta = 4.36e-4 Q^(2/3)/D^(1/3) (N, mm), from charts for steel
    state = carrying(GROOVE, np.array([8900.0, 0.0, 0.0, 0.0, 0.0]))
    largest = state.element_loads.max()
    assert largest == pytest.approx(4.37 * 8900.0 / 9.0, rel=5e-3)
    assert state.displacement[0] == pytest.approx(4.36e-7 * largest ** (2 / 3) / 12.7 ** (1 / 3), rel=0.05)


def test_a_thrust_load_turns_the_contact_angle_as_in_closed_form() -> None:
    # Fa/(Z k A^1.5) = sin(a) (cos(a0)/cos(a) - 1)^1.5, Harris and Kotzalas, eq. 7.33
    thrust, free = 17_800.0, ANGULAR.contact_angle
    distance = 0.0464 * 22.23e-3
    unit = 16 * ANGULAR.constant * distance**1.5

    def missing(angle: float) -> float:
        return unit * math.sin(angle) * (math.cos(free) / math.cos(angle) - 1.0) ** 1.5 - thrust

    angle = brentq(missing, free, free + 0.2, xtol=1e-14)
    state = carrying(ANGULAR, np.array([0.0, thrust, 0.0, 0.0, 0.0]))
    assert state.displacement[1] == pytest.approx(distance * math.sin(angle - free) / math.cos(angle), rel=1e-9)
    np.testing.assert_allclose(state.element_loads, thrust / (16 * math.sin(angle)), rtol=1e-9)
    # the chart there gives 41.6 degrees
    assert math.degrees(angle) == pytest.approx(41.6, abs=0.15)


def test_rollers_follow_the_line_contact_of_iso_16281() -> None:
    # the load along one of the rollers of a bearing with so much clearance that it alone is loaded
    loose = replace(ROLLER, clearance=1e-3)
    state = carrying(loose, np.array([2000.0, 0.0, 0.0, 0.0, 0.0]))
    approach = state.displacement[0] - 0.5e-3
    assert state.loaded == 1
    assert 35948.0 * 9.6 ** (8 / 9) * (1e3 * approach) ** (10 / 9) == pytest.approx(2000.0, rel=1e-9)
    # Palmgren's line is a fit to the same kind of measurements, 7.68e-5 Q^0.9/L^0.8 mm of both raceways
    assert 1e3 * approach == pytest.approx(7.68e-5 * 2000.0**0.9 / 9.6**0.8, rel=0.04)


def test_a_tilted_roller_has_the_moment_of_its_line() -> None:
    # all of the straight roller at 0 degrees touches: moment from the integral of c (d + tilt t)^(10/9) t
    single = replace(ROLLER, elements=3, clearance=1e-3)
    approach, tilt, length = 20e-6, 3e-3, 9.6e-3
    state = deflected(single, np.array([0.5e-3 + approach, 0.0, 0.0, 0.0, tilt]))
    unit = LINE_CONSTANT * length ** (8 / 9) / length
    ends = -0.5 * length, 0.5 * length
    force = quad(lambda t: unit * (approach + tilt * t) ** (10 / 9), *ends)[0]
    moment = quad(lambda t: unit * (approach + tilt * t) ** (10 / 9) * t, *ends)[0]
    assert state.load[0] == pytest.approx(force, rel=1e-3)
    assert state.load[4] == pytest.approx(moment, rel=3e-3)  # 30 slices: 1 - 1/30^2 of the second moment


def test_hertz_of_two_spheres() -> None:
    # delta^3 = 9 Q^2/(16 R E'^2), K. L. Johnson, Contact Mechanics, eq. 4.23
    radius, modulus = 0.02, 1.2e11
    assert point_constant(2.0 / radius, 0.0, modulus) == pytest.approx(4.0 / 3.0 * modulus * radius**0.5, rel=1e-12)
    assert axis_ratio(1e-12) == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize("quotient", [1.5, 4.0, 10.0])
def test_axis_ratio_of_brewe_and_hamrock(quotient: float) -> None:
    # 1.0339 (Ry/Rx)^0.636 within 3 %, D. Brewe and B. Hamrock, J. Lubr. Technol. 99 (1977) 485
    ratio = axis_ratio((quotient - 1.0) / (quotient + 1.0))
    assert ratio == pytest.approx(1.0339 * quotient**0.636, rel=0.03)


@pytest.mark.parametrize("name", ALL)
def test_load_and_stiffness_are_derivatives_of_the_energy(name: str) -> None:
    bearing = ALL[name]
    u = np.array([7e-6, 5e-6, -4e-6, 2e-4, -3e-4])
    step = np.array([1e-9, 1e-9, 1e-9, 1e-8, 1e-8])
    state = deflected(bearing, u)
    assert state.loaded > 2
    for i in range(5):
        up, down = (deflected(bearing, u + sign * step * np.eye(5)[i]) for sign in (1.0, -1.0))
        assert (up.energy - down.energy) / (2.0 * step[i]) == pytest.approx(state.load[i], rel=2e-6)
        slope = (up.load - down.load) / (2.0 * step[i])
        # 0 where a slice of a roller comes into contact within the step
        np.testing.assert_allclose(slope, state.stiffness[i], rtol=2e-5, atol=2e-5 * np.abs(state.stiffness[i]).max())
    np.testing.assert_array_equal(state.stiffness, state.stiffness.T)
    assert np.linalg.eigvalsh(state.stiffness)[0] >= -1e-9 * np.linalg.eigvalsh(state.stiffness)[-1]


@pytest.mark.parametrize("name", ALL)
def test_a_bearing_turned_by_a_pitch_is_the_same(name: str) -> None:
    bearing = ALL[name]
    angle = 2.0 * math.pi / bearing.elements
    c, s = math.cos(angle), math.sin(angle)
    turn = np.eye(5)
    turn[np.ix_([0, 2], [0, 2])] = turn[np.ix_([3, 4], [3, 4])] = [[c, -s], [s, c]]
    u = np.array([7e-6, 5e-6, -4e-6, 2e-4, -3e-4])
    here, there = deflected(bearing, u), deflected(bearing, turn @ u)
    np.testing.assert_allclose(there.load, turn @ here.load, rtol=1e-9, atol=1e-9 * np.abs(here.load).max())
    scale = np.abs(here.stiffness).max()
    np.testing.assert_allclose(there.stiffness, turn @ here.stiffness @ turn.T, rtol=1e-9, atol=1e-9 * scale)


@pytest.mark.parametrize("name", ALL)
def test_the_equilibrium_carries_its_load(name: str) -> None:
    load = np.array([900.0, 1200.0, -400.0, 1.0, 2.0])
    bearing = ALL[name] if name != "roller" else replace(ROLLER, axial_stiffness=1e8)
    state = carrying(bearing, load)
    np.testing.assert_allclose(state.load, load, rtol=1e-7, atol=1e-6)


def test_rows_add_up_about_the_reference_point() -> None:
    u = np.array([2e-6, 1e-6, -3e-6, 1e-5, 2e-5])
    total, stiffness = np.zeros(5), np.zeros((5, 5))
    for row in PAIR.rows:
        single = replace(PAIR, rows=(replace(row, offset=0.0),))
        carry = np.eye(5)  # motion at the row's own middle
        carry[0, 4], carry[2, 3] = row.offset, -row.offset
        state = deflected(single, carry @ u)
        total += carry.T @ state.load
        stiffness += carry.T @ state.stiffness @ carry
    state = deflected(PAIR, u)
    np.testing.assert_allclose(state.load, total, rtol=1e-9, atol=1e-9 * np.abs(total).max())
    np.testing.assert_allclose(state.stiffness, stiffness, rtol=1e-9, atol=1e-9 * np.abs(stiffness).max())


def test_senses_mirror_each_other() -> None:
    mirror = np.diag([1.0, -1.0, 1.0, -1.0, -1.0])
    u = np.array([2e-6, 6e-6, -3e-6, 1e-5, 2e-5])
    here, there = deflected(TAPERED, u), deflected(replace(TAPERED, rows=(Row(0.0, -1),)), mirror @ u)
    np.testing.assert_allclose(there.load, mirror @ here.load, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("bearing", "load"),
    [
        (replace(ANGULAR, rows=(Row(0.0, -1),)), (0.0, 500.0, 0.0, 0.0, 0.0)),
        (ROLLER, (500.0, 10.0, 0.0, 0.0, 0.0)),
        (TAPERED, (500.0, -1.0, 0.0, 0.0, 0.0)),
    ],
)
def test_loads_that_a_bearing_cannot_carry_are_refused(
    bearing: BallBearing | RollerBearing, load: tuple[float, ...]
) -> None:
    with pytest.raises(InputError, match="cannot be carried"):
        carrying(bearing, np.array(load))


def test_a_bearing_within_its_clearance_is_unloaded() -> None:
    loose = replace(GROOVE, clearance=20e-6)
    assert deflected(loose, np.array([9e-6, 0.0, 0.0, 0.0, 0.0])).unloaded
    assert deflected(loose, np.array([9e-6, 0.0, 0.0, 0.0, 0.0])).loaded == 0
    state = deflected(replace(GROOVE, clearance=-4e-6), np.zeros(5))
    assert state.loaded == 9
    assert not state.unloaded
