"""Two rigid gears roll on each other: no overlap without load, contact on the line of action, overlap when pressed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.gears.geometry.curves import coordinates
from gearfe.gears.geometry.pair import Gear, GearPair, MeshGeometry, TipRelief
from gearfe.gears.geometry.validity import tip_penetration

NM = 1e-12  # 1e-9 mm (m)


def pair(z1=20, z2=30, degrees=20.0, module=2.5e-3, pinion=None, wheel=None, distance=None, **both):
    both.setdefault("rack_tip_radius", 0.3 if degrees < 26 else 0.1)
    made = [
        Gear(z, module, math.radians(degrees), 10e-3, 0.2 * z * module, **{**both, **(own or {})})
        for z, own in ((z1, pinion), (z2, wheel))
    ]
    return GearPair(*made, distance)


PAIRS = {
    "20/30": pair(),
    "25 deg, rounded": pair(degrees=25.0, tip_round=0.1e-3),
    "more teeth on the pinion": pair(41, 23),
    "8/150": pair(8, 150, pinion={"profile_shift": 0.55, "tip_shortening": 0.1}),
    "8/150, 30 deg, undercut": pair(8, 150, 30.0),
    "14.5 deg": pair(34, 150, 14.5),
    "30 deg": pair(20, 20, 30.0),
    "undercut": pair(12, 40),
    "shifts": pair(12, 24, pinion={"profile_shift": 0.6, "tip_shortening": 0.1}, wheel={"profile_shift": 0.36}),
    "equal and opposite shifts": pair(15, 30, pinion={"profile_shift": 0.3}, wheel={"profile_shift": -0.3}),
    "thinned": pair(tooth_thinning=60e-6),
    "wider centre distance": pair(distance=62.9e-3),
    "relief and round": pair(tip_relief=TipRelief(20e-6, 1.5e-3, 1.5), tip_round=0.2e-3),
}
each_pair = pytest.mark.parametrize("mesh", PAIRS.values(), ids=PAIRS.keys())


def turned(points, angle, centre=0.0):
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([centre + points[:, 0] * c - points[:, 1] * s, points[:, 0] * s + points[:, 1] * c], axis=1)


def half_angle_at(gear, radius):
    """Polar angle of the left profile at given radii, by bisection on the exact curves; below the root circle pi/z."""
    angle = np.full(radius.shape, math.pi / gear.teeth)
    angle[radius > gear.tip_radius] = -math.inf
    for segment in gear.profile.segments:
        inner, outer = np.hypot(*segment.start), np.hypot(*segment.end)
        here = (radius >= inner) & (radius <= outer) & (outer > inner)
        low, high = np.zeros(here.sum()), np.ones(here.sum())
        for _ in range(60):
            middle = 0.5 * (low + high)
            above = np.hypot(*segment.points(middle).T) > radius[here]
            low, high = np.where(above, low, middle), np.where(above, middle, high)
        x, y = segment.points(low).T
        angle[here] = np.arctan2(y, x)
    return angle


def outline(gear, neighbours):
    """Points of several whole teeth, both sides."""
    half = gear.profile.polyline(50)
    tooth = np.concatenate([half, half * [1.0, -1.0]])
    return np.concatenate([turned(tooth, 2 * math.pi * k / gear.teeth) for k in range(-neighbours, neighbours + 1)])


def overlap(mesh, pinion_angle, twist):
    """Largest arc (m) by which a wheel point lies inside a pinion tooth; negative: the smallest gap."""
    wheel, pinion = mesh.wheel, mesh.pinion
    wheel_angle = mesh.wheel_phase + mesh.wheel_angle_at(pinion_angle, twist)
    pitch = 2 * math.pi / wheel.teeth
    wheel_angle += pitch * round((math.pi - wheel_angle) / pitch)
    placed = turned(outline(wheel, 2), wheel_angle, mesh.working_centre_distance)
    own = turned(placed, -pinion_angle)
    radius, angle = np.hypot(*own.T), np.arctan2(own[:, 1], own[:, 0])
    near = (radius <= pinion.tip_radius) & (radius >= pinion.root_radius)
    pitch = 2 * math.pi / pinion.teeth
    angle = np.abs(angle - pitch * np.round(angle / pitch))
    assert radius.min() > pinion.root_radius
    return float(((half_angle_at(pinion, radius[near]) - angle[near]) * radius[near]).max())


@each_pair
def test_rigid_gears_do_not_overlap_at_any_rotation(mesh):
    for pinion_angle in np.linspace(-0.5, 0.5, 15) * mesh.mesh_cycle:
        for side in (-1.0, 0.0, 1.0):  # right flanks touching, teeth centred in the spaces, left flanks touching
            assert overlap(mesh, pinion_angle, side * mesh.contact_twist) < NM


@each_pair
def test_rigid_gears_overlap_when_turned_slightly(mesh):
    for pinion_angle in np.linspace(-0.5, 0.5, 5) * mesh.mesh_cycle:
        for side in (-1.0, 1.0):
            press = side * (mesh.contact_twist + 1e-3)
            assert overlap(mesh, pinion_angle, press) > 0.2e-3 * mesh.wheel.base_radius


@each_pair
def test_flanks_touch_on_the_line_of_action(mesh):
    """Pinion and wheel flank points with roll lengths s1 + s2 = a sin(alpha_w) coincide, with opposite normals."""
    start, end = mesh.path_limits(relieved=True)
    for s1 in np.linspace(start, end, 12):
        angle = mesh.pinion_angle_at(s1)
        at1, at2 = np.array([s1]), np.array([mesh.tangent_length - s1])
        one, two = mesh.pinion.profile.flank, mesh.wheel.profile.flank
        turn = mesh.wheel_phase + mesh.wheel_angle_at(angle, mesh.contact_twist)
        # pinion tooth 0 meets the wheel tooth above it, which is one of those one pitch apart
        turn += 2 * math.pi / mesh.wheel.teeth * np.arange(-2, 3)
        point1, normal1 = (
            turned(coordinates(one.at(at1)), angle)[0],
            turned(coordinates(one.normal_at(at1)), angle)[0],
        )
        points2 = [turned(coordinates(two.at(at2)), t, mesh.working_centre_distance)[0] for t in turn]
        nearest = int(np.argmin([np.hypot(*(p - point1)) for p in points2]))
        np.testing.assert_allclose(points2[nearest], point1, atol=NM)
        np.testing.assert_allclose(turned(coordinates(two.normal_at(at2)), turn[nearest])[0], -normal1, atol=1e-12)
        # on the line through the pitch point, at the working pressure angle: the driving flank pushes upwards
        assert normal1 == pytest.approx([math.sin(mesh.working_pressure_angle), math.cos(mesh.working_pressure_angle)])
        from_pitch_point = point1 - [mesh.pinion_working_radius, 0.0]
        assert abs(from_pitch_point[0] * normal1[1] - from_pitch_point[1] * normal1[0]) < NM
        assert mesh.pinion_roll_at(angle) == pytest.approx(s1, abs=NM)


@each_pair
def test_positive_twist_presses_the_left_flanks(mesh):
    """A wheel point of the line of action moves against the pinion's normal when the wheel turns counter-clockwise."""
    angle = mesh.path["C"].pinion_angle
    s1 = np.array([mesh.path["C"].pinion_roll])
    point = turned(coordinates(mesh.pinion.profile.flank.at(s1)), angle)[0]
    normal = turned(coordinates(mesh.pinion.profile.flank.normal_at(s1)), angle)[0]
    arm = point - [mesh.working_centre_distance, 0.0]
    velocity = np.array([-arm[1], arm[0]])
    assert velocity @ normal == pytest.approx(-mesh.wheel.base_radius)


def test_tip_penetration_agrees_with_a_shortened_root():
    """Gears that run get 0; with the axes 0.3 m too close, tips cut by that less the 0.25 m clearance, at least."""
    mesh = pair(40, 60, degrees=20.0, tooth_thinning=0.6e-3)
    a = mesh.working_centre_distance
    assert tip_penetration(mesh.pinion, mesh.wheel, a, mesh.contact_twist) == 0.0
    depth = tip_penetration(mesh.pinion, mesh.wheel, a - 0.3 * 2.5e-3, 0.0)
    assert depth == pytest.approx(0.05 * 2.5e-3, rel=0.02)


@pytest.mark.parametrize("wheel_teeth", [30, 150])
def test_a_tip_that_cuts_an_undercut_root_is_refused(wheel_teeth):
    """The large round of the pinion's rack leaves material where the wheel's long tip wants to pass."""
    pinion = Gear(10, 2.5e-3, math.radians(20), 10e-3, 5e-3, rack_tip_radius=0.47)
    wheel = Gear(wheel_teeth, 2.5e-3, math.radians(20), 10e-3, 5e-3, addendum=1.15)
    unchecked = MeshGeometry(pinion, wheel)
    cuts = [overlap(unchecked, x * unchecked.mesh_cycle, 0.0) for x in np.linspace(-1.5, 1.5, 61)]
    assert max(cuts) > 20e-6
    with pytest.raises(InputError, match=r"tip cut .* into the pinion's root"):
        GearPair(pinion, wheel)
