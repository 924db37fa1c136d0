"""Planar mechanisms do not depend on the units of length, mass and time, and close from poses that are guesses."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.multibody import (
    Body,
    Gravity,
    Hinge,
    Linkage,
    Prescribed,
    Slot,
    System,
    consistent_start,
    integrate,
    smoothed_step,
)
from tests.makers.rigid_cases import G, folding_links

Change = Callable[[Body], Body]
SCALES = [
    (1e-9, 1.0, 1.0), (1e-6, 1.0, 1.0), (1e6, 1.0, 1.0), (1.0, 1e-12, 1.0), (1.0, 1e12, 1.0), (1.0, 1.0, 1e-9),
    (1e-9, 1e-12, 3e-5), (1e6, 1e12, 1e3),
]  # fmt: skip


def scaled(system: System, length: float, mass: float, time: float, change: Change = lambda body: body) -> System:
    """Hinges, slots and gravity with every length, mass and time multiplied; start poses changed by `change`."""

    def p(point):  # type: ignore[no-untyped-def]
        return (point[0] * length, point[1] * length)

    linkage = system.elements[0]
    bodies = tuple(
        replace(b, mass=b.mass * mass, inertia=b.inertia * mass * length**2, centre=p(b.centre), position=p(b.position),
                velocity=(b.velocity[0] * length / time, b.velocity[1] * length / time), rate=b.rate / time)
        for b in map(change, linkage.bodies)
    )  # fmt: skip
    joints = []
    for j in linkage.joints:
        if isinstance(j, Hinge):
            joints.append(replace(j, point_a=p(j.point_a), point_b=p(j.point_b)))
        else:
            joints.append(replace(j, point=p(j.point), origin=p(j.origin)))
    return System([Linkage(bodies, tuple(joints), (Gravity((0.0, -G * length / time**2)),))])


def fourbar() -> System:
    """Three links of 1 kg/m between fixed points 2 m apart."""
    points = np.array([(0.0, 0.0), (0.3, 0.9), (1.7, 1.5), (2.0, 0.0)])
    bodies = []
    for name, a, b in (("a", 0, 1), ("b", 1, 2), ("c", 3, 2)):
        span = points[b] - points[a]
        size = float(np.hypot(*span))
        bodies.append(
            Body(name, size, size**3 / 12, (size / 2, 0.0), tuple(points[a]), float(np.arctan2(span[1], span[0])))
        )
    one, two, three = (2 * b.centre[0] for b in bodies)
    joints = (
        Hinge("a", "ground"),
        Hinge("b", "a", (0.0, 0.0), (one, 0.0)),
        Hinge("c", "ground", (0.0, 0.0), (2.0, 0.0)),
        Hinge("b", "c", (two, 0.0), (three, 0.0), name="last"),
    )
    return System([Linkage(tuple(bodies), joints, (Gravity((0.0, -G)),))])


def light_fourbar() -> System:
    """The middle link has next to no mass."""
    linkage = fourbar().elements[0]
    bodies = tuple(replace(b, mass=1e-12, inertia=1e-12) if b.name == "b" else b for b in linkage.bodies)
    return System([Linkage(bodies, linkage.joints, linkage.forces)])


def slider_crank() -> System:
    return folding_links(0.7, 4.0, rod=2.0)


@pytest.mark.parametrize(
    ("make", "method", "tolerance"),
    [
        (fourbar, "taylor", 1e-9),
        (light_fourbar, "taylor", 1e-9),
        (slider_crank, "taylor", 1e-9),
        (folding_links, "taylor", 1e-9),  # with change points
        (slider_crank, "implicit", 1e-3),
    ],
)
def test_the_motion_does_not_depend_on_the_units(make, method, tolerance):
    system = make()
    end = 3.0 if method == "taylor" else 0.3
    options = {"method": method, "tolerance": tolerance}
    made = integrate(system, [0.0, end], **options)
    assert made.status == 0
    for length, mass, time in SCALES:
        other = scaled(system, length, mass, time)
        run = integrate(other, [0.0, end * time], **options)
        assert run.status == 0
        assert run.statistics["steps"] == made.statistics["steps"]
        np.testing.assert_allclose(run.q[-1] / other.units, made.q[-1] / system.units, atol=1e-2 * tolerance)
        force = mass * length / time**2 * np.where(other.elements[0].assembly.row_holds_length, 1.0, length)
        np.testing.assert_allclose(
            run.multipliers[-1] / force, made.multipliers[-1], rtol=10 * tolerance, atol=10 * tolerance
        )
        if method == "taylor":
            passed = made.statistics["change_points"]
            np.testing.assert_allclose(run.statistics["change_points"] / time, passed, rtol=1e-6)


def far_poses(seed: int) -> Change:
    """Angles off by up to 30 deg, positions by up to 30 %."""
    random = np.random.default_rng(seed)

    def change(body: Body) -> Body:
        x, y = (k * (1.0 + random.uniform(-0.3, 0.3)) for k in body.position)
        return replace(body, position=(x, y), angle=body.angle + math.radians(random.uniform(-30.0, 30.0)))

    return change


@pytest.mark.parametrize("length", [1e-9, 1.0, 1e6])
@pytest.mark.parametrize(
    ("make", "side"),
    [(fourbar, lambda q: math.sin(q[5] - q[8])), (slider_crank, lambda q: math.cos(q[5]))],  # its sign is the branch
)
def test_far_poses_close_on_the_branch_next_to_them(make, side, length):
    exact = consistent_start(make()).q
    for seed in range(20):
        system = scaled(make(), length, 1.0, 1.0, far_poses(seed))
        start = consistent_start(system)
        assert np.abs(system.residual(0.0, start.q)).max() <= 1e-14 * length
        assert side(start.q) * side(exact) > 0.0
        assert np.abs((start.q - exact * np.tile([length, length, 1.0], len(exact) // 3)) / system.units).max() < 0.6


@pytest.mark.parametrize("length", [1e-9, 1.0, 1e6])
def test_what_cannot_close_says_by_how_much_and_where(length):
    """A gap of 1 m between two arms of 1 m that three hinges share in the least-squares sense."""
    bodies = (Body("a", 1.0, 0.1), Body("b", 1.0, 0.1, position=(3.0 * length, 0.0)))
    joints = (
        Hinge("a", "ground", name="left"),
        Hinge("b", "ground", (0.0, 0.0), (3.0 * length, 0.0), name="right"),
        Hinge("a", "b", (length, 0.0), (-length, 0.0), name="gap"),
    )
    much = f"{length / 3:.3g}".replace("+", r"\+")
    size = f"{length:.3g}".replace("+", r"\+")
    text = rf"^hinge (left|right|gap) \(x\).*residual of {much} m \(0.33 of the mechanism's length, {size} m\)"
    with pytest.raises(InputError, match=text):
        consistent_start(System([Linkage(bodies, joints)]))


@pytest.mark.parametrize("time", [1e-9, 1.0, 1e9])
def test_a_row_that_is_dependent_until_the_motion_begins_is_no_redundant_one(time):
    """Two links of equal length, one on the other; the slot is dependent until the crank turns."""
    linkage = folding_links(0.0, 0.0).elements[0]
    rise = Prescribed("crank", "angle", smoothed_step(5.0 * time, 2.0 * time, 0.5))
    start = consistent_start(System([Linkage(linkage.bodies, (*linkage.joints, rise))]))
    assert start.freedoms.redundant == ()


def test_far_from_the_origin_the_rounding_of_coordinates_is_no_gap():
    shift = 1e7
    system = fourbar()
    linkage = system.elements[0]
    bodies = tuple(replace(b, position=(b.position[0] + shift, b.position[1])) for b in linkage.bodies)
    joints = tuple(
        replace(j, point_b=(j.point_b[0] + shift, j.point_b[1])) if j.b == "ground" else j for j in linkage.joints
    )
    start = consistent_start(System([Linkage(bodies, joints)]))
    np.testing.assert_allclose(start.q[2::3], consistent_start(system).q[2::3], atol=1e-7)


def test_slot_of_an_offset_line_scales():
    """A rod on two crossed lines (an elliptic trammel): the centre stays on a circle of half its length."""
    for length in (1e-9, 1.0, 1e6):
        body = Body("rod", 1.0, length**2 / 12, (length / 2, 0.0), (0.3 * length, 0.2 * length), -0.4)
        joints = (
            Slot("rod", "ground", direction=(0.0, 1.0)),
            Slot("rod", "ground", (length, 0.0)),
        )
        q = consistent_start(System([Linkage((body,), joints)])).q
        assert math.hypot(q[0], q[1]) == pytest.approx(length / 2, rel=1e-12)
