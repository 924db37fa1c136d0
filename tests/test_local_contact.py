"""One contact under a load, against Johnson's formulas; where rigid flanks touch, against the geometry."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gearfe.contact.hertz import Edge, LocalContact, wedge_factor
from gearfe.gear.pair import GearPair
from gearfe.gear.spur_gear import TipRelief
from gearfe.gear.touching import Flanks, face_of
from gearfe.stiffness.local_gap import local_contact
from gearfe.stiffness.sweep import elastic_pair

from .gears import pair

E_STAR, RHO = 1.1e11, 4e-3


def local(gap, *, edges=(), low=-1e-3, high=1e-3, smooth=0.0, radius=RHO):
    """Local contact with a gap function, solved numerically (`smooth` = 0 tells of something unsmooth at the point)."""
    side = np.geomspace(1e-9, 1e-3, 400)
    x = np.concatenate([-side[::-1], [0.0], side])
    x = x[(x >= low) & (x <= high)]
    return LocalContact(E_STAR, radius, x, gap(x), tuple(edges), smooth)


# ---- the contact itself ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("load", [1.0, 1e3, 1e5])
def test_numerical_contact_of_parabolas_is_hertz(load):
    """Johnson, eq. 4.43 to 4.45: b^2 = 4 P R/(pi E*), p0 = 2 P/(pi b)."""
    found = local(lambda x: x**2 / (2 * RHO)).under(load)
    exact = local(lambda x: x**2 / (2 * RHO), smooth=math.inf).under(load)
    b = math.sqrt(4 * load * RHO / (math.pi * E_STAR))
    assert found.width == pytest.approx(b, rel=0.02)
    assert found.pressure == pytest.approx(2 * load / (math.pi * b), rel=0.01)
    assert found.approach == pytest.approx(exact.approach, rel=1e-3)
    assert found.rate == pytest.approx(exact.rate, rel=1e-3)
    assert abs(found.moment) < 1e-3 * load * b


def test_the_approach_of_hertz_is_the_log_law():
    """For two loads C P cancels: lambda_2/P_2 - lambda_1/P_1 = ln(P_1/P_2)/(pi E*)."""
    law = local(lambda x: x**2 / (2 * RHO), smooth=math.inf)
    one, other = law.under(1e2), law.under(1e4)
    difference = other.approach / 1e4 - one.approach / 1e2
    assert difference == pytest.approx(-math.log(100) / (math.pi * E_STAR), rel=1e-12)


def test_numerical_contact_of_a_blunt_wedge():
    """Johnson, eq. 5.4: a ridge of slope t carries P = E* t a, with the pressure E* t/pi arcosh(a/x)."""
    slope, load = 0.02, 1e4
    found = local(lambda x: slope * np.abs(x)).under(load)
    assert found.width == pytest.approx(load / (E_STAR * slope), rel=0.03)


def test_contact_under_an_edge_grows_with_the_load():
    """Without a length in the gap a contact at an edge is similar to itself: its width is proportional to the load."""
    edge = Edge(0.0, (wedge_factor(math.radians(125)) - 2 / math.pi) / (2 * E_STAR))
    law = local(lambda x: -0.03 * x, edges=[edge], high=0.0)
    one, other = law.under(1e2), law.under(1e4)
    assert other.width / one.width == pytest.approx(100, rel=0.02)
    # and the approach per load falls with its logarithm, by the wedge's and the half plane's compliance together
    expected = -math.log(100) * (2 / (math.pi * E_STAR) + edge.factor)
    assert other.approach / 1e4 - one.approach / 1e2 == pytest.approx(expected, rel=2e-3)
    assert not one.smooth


@pytest.mark.parametrize("place", [0.0, 2e-5, 2e-4])
def test_rates_are_derivatives(place):
    edge = Edge(place, 3e-12)
    law = local(lambda x: x**2 / (2 * RHO), edges=[edge], high=place)
    low, mid, high = (law.under(p) for p in (0.999e4, 1e4, 1.001e4))
    assert mid.rate == pytest.approx((high.approach - low.approach) / 20, rel=2e-3)
    assert mid.moment_rate == pytest.approx((high.moment - low.moment) / 20, rel=0.05, abs=1e-7)


def test_wedge_factor():
    assert wedge_factor(math.pi) == pytest.approx(2 / math.pi, rel=1e-12)
    # a right angle, load at 45 deg to its middle: Michell's two terms (Timoshenko & Goodier, art. 38)
    alpha = math.pi / 4
    assert wedge_factor(math.pi / 2) == pytest.approx(0.5 / (alpha + 0.5) + 0.5 / (alpha - 0.5), rel=1e-12)
    # and along its middle: the mate's face is turned by 45 deg from the wedge's
    assert wedge_factor(math.pi / 2, math.pi / 4) == pytest.approx(1 / (alpha + 0.5), rel=1e-12)


def test_mean_displacement_under_an_ellipse():
    """Against a double sum of -2/(pi E*) ln|x - s| over equal loads at the ellipse's quantiles."""
    law = local(lambda x: x**2)
    t = (np.arange(4000) + 0.5) / 4000
    angle = np.linspace(0, math.pi, 200001)
    quantile = np.interp(t, (angle - np.sin(angle) * np.cos(angle)) / math.pi, -np.cos(angle))
    x = 1e-4 + 3e-4 * quantile
    apart = np.abs(x[:, None] - x)
    np.fill_diagonal(apart, np.exp(-1.5) * np.gradient(x))
    expected = -2 / (math.pi * E_STAR) * np.log(apart).mean()
    assert law.elliptic_mean(-2e-4, 4e-4) == pytest.approx(expected, rel=1e-3)


def test_the_width_of_a_numerical_contact_is_smooth_in_the_load():
    """b ~ sqrt P on a parabola: the rate of change holds from step to step, though panels join one by one."""
    found = local(lambda x: x**2 / (2 * RHO))
    loads = 1e3 * np.exp(np.linspace(0.0, 0.2, 81))
    widths = np.array([found.under(load).width for load in loads])
    np.testing.assert_allclose(widths, np.sqrt(4 * loads * RHO / (math.pi * E_STAR)), rtol=4e-3)
    assert (np.diff(np.log(widths)) > 0).all()


def test_a_contact_that_does_not_reach_the_round_is_hertz():
    """Just below a tip round: the approach under a light load is that of the involutes, not of the round."""
    gears = pair(20, 30, pinion={"tip_round": 0.1e-3})
    flanks, elastic = Flanks(gears), elastic_pair(gears, coarsen=4.0)
    touching = flanks.touching(np.linspace(0.0, gears.mesh_cycle, 4000))
    below = (1.0 - touching.place[:, 0]) * float(flanks.pinion.speeds(np.array(1.0)))
    k = int(np.argmin(np.where(below > 1e-7, below, np.inf)))
    contact = local_contact(gears, elastic, flanks, touching, k, 1e-4)
    assert 1e-7 < contact.smooth < 2e-5
    width = 0.2 * contact.smooth
    load = math.pi * contact.modulus * width**2 * touching.curvature[k] / 4  # Johnson, eq. 4.43
    found = contact.under(load)
    assert found.width == pytest.approx(width, rel=1e-3)
    assert found.approach == pytest.approx(contact._numerical(load).approach, rel=1e-3)


def test_turn_under_an_ellipse():
    """Far from the edge the face turns by factor/(2 d) per force, at the edge by the inverse of the length: it has no
    other. Towards the edge of either body, of the other not at all.
    """
    edge = Edge(1.0, 3e-12, 1)
    assert local(lambda x: x**2, edges=[edge]).elliptic_turn(-1e-3, 1e-3) == pytest.approx((0.0, -1.5e-12), rel=1e-5)
    law = local(lambda x: x**2, edges=[Edge(0.0, 3e-12, 0), edge])
    near, far = (law.elliptic_turn(-length, 0.0)[0] for length in (1e-5, 2e-5))
    assert near == pytest.approx(2 * far, rel=1e-9)
    # against the definition: mean slope, weighed as a moment, of the displacement under the pressure
    x = -1e-5 * (1 - np.cos(math.pi * (np.arange(4000) + 0.5) / 4000)) / 2
    weight = np.sqrt(np.maximum(0.0, 1 - (1 + x / 5e-6) ** 2)) * np.gradient(x)
    weight = weight / weight.sum()
    sunk = -3e-12 * np.log(-x[:, None] - x) @ weight
    # what sinks in lies against the normal, for body 0, along the tangent of which x runs
    assert near == pytest.approx(float((weight * (x + 5e-6) * 4 / 5e-6**2) @ -sunk), rel=1e-3)


# ---- where the rigid flanks touch -----------------------------------------------------------------------------------


@pytest.mark.parametrize("form", [{}, {"tip_round": 0.1e-3}, {"centre_distance": 62.6e-3}])
def test_involutes_touch_on_the_line_of_action(form):
    """Law of gearing: every pair on the path touches at once, forces have the base circles as levers."""
    gears = pair(**form)
    angles = np.linspace(0, 1, 9) * gears.mesh_cycle
    found = Flanks(gears).touching(angles)
    start, end = gears.path_limits()
    roll = np.array([gears.pinion_roll_at(a) for a in found.angle + found.pair * gears.mesh_cycle])
    on = (roll > start + 1e-5) & (roll < end - 1e-5)
    assert on.sum() >= 9
    np.testing.assert_allclose(found.twist[on], gears.contact_twist, rtol=0, atol=2e-15)
    np.testing.assert_allclose(found.arm[on, 0], gears.pinion.base_radius, rtol=1e-7)
    np.testing.assert_allclose(found.arm[on, 1], gears.wheel.base_radius, rtol=1e-7)
    assert (found.twist[~on] > gears.contact_twist - 1e-15).all()


@pytest.mark.parametrize("u", [0.3, 0.9995, 1.0 - 1e-9, 1.0, 1.0 + 1e-9, 1.0005, 1.01, 1.7])
def test_places_beside_a_contact_lie_where_they_are_asked_for(u):
    """Chords of short ways along the flank and into its tip round, whose parameter runs at another speed."""
    face = face_of(pair(20, 30, pinion={"tip_round": 0.1e-3}).pinion)
    x = np.concatenate([-np.geomspace(1e-5, 1e-9, 30), np.geomspace(1e-9, 1e-5, 30)])
    chord = np.abs(face.points(face.moved(u, x)) - face.points(np.array(u)))
    np.testing.assert_allclose(chord, np.abs(x), rtol=5e-3, atol=1e-17)
    assert (np.diff(face.moved(u, x)) > 0).all()


def test_at_the_kink_of_a_linear_relief_the_mate_gives_the_normal():
    """Both gears see the same first touch and the same normal; the kink lies there over a stretch of pinion angles."""
    gears = pair(24, 31, wheel={"tip_relief": TipRelief(40e-6, 1.2e-3, 1.0)})
    mirrored = GearPair(gears.wheel, gears.pinion, gears.centre_distance)
    mark, seen = Flanks(gears).wheel.relief_start, 0
    for angle in np.linspace(0.0, gears.mesh_cycle, 40):
        one = Flanks(gears).touching(np.array([angle]))
        for k in np.flatnonzero(np.abs(one.place[:, 1] - mark) < 1e-9):
            seen += 1
            turned = -(angle / gears.gear_ratio) + one.twist[k] + math.pi / gears.wheel.teeth
            other = Flanks(mirrored).touching(np.array([turned]))
            j = int(np.argmin(np.abs(other.place[:, 0] - mark) + np.abs(other.place[:, 1] - one.place[k, 0])))
            np.testing.assert_allclose(other.place[j], one.place[k, ::-1], atol=1e-8)
            # half a turn about the middle of the centres: what pushes the wheel here pushes the pinion there
            np.testing.assert_allclose(other.normal[j], one.normal[k], atol=1e-7)
            np.testing.assert_allclose(other.arm[j], one.arm[k, ::-1], atol=1e-9)
    assert seen >= 3


@pytest.mark.parametrize("u", [1e-6, 0.4, 0.9, 0.999995, 1.0 - 2e-9, 1.0])
def test_curvature_of_an_involute_up_to_its_round(u):
    """The radius of curvature is the roll length (ISO 21771), also within a difference's step of the round."""
    face = face_of(pair(20, 30, pinion={"tip_round": 0.1e-3}).pinion)
    assert face.curvature(u, math.inf) * face.flank.roll(u) == pytest.approx(1.0, rel=1e-4)


@pytest.mark.parametrize("exponent", [1.0, 1.0 + 1e-12, 1.001, 1.03, 1.5])
def test_the_normal_is_that_of_both_faces(exponent):
    """Also where a relief starts with a kink, or so quickly that the place is not known well enough for a normal."""
    flanks = Flanks(pair(24, 31, pinion={"tip_relief": TipRelief(40e-6, 1.2e-3, exponent)}))
    touching = flanks.touching(np.linspace(0.0, flanks.pair.mesh_cycle, 60))
    mate = touching.place[:, 1]
    turn = np.exp(1j * (flanks.wheel_frame(touching.angle, touching.pair) + touching.twist))
    apart = np.abs(np.angle(touching.normal / (-flanks.wheel.normals(mate) * turn)))
    inner = (mate > 1e-6) & (mate < flanks.wheel.end - 1e-6)
    assert inner.sum() > 60
    assert apart[inner].max() < 1e-6
