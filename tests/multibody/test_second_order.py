"""Constraints that are singular in every position are refused at the start; true redundancy is counted truly."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.multibody import (
    Body,
    Gravity,
    Hinge,
    Linkage,
    Prescribed,
    Prismatic,
    Slot,
    System,
    consistent_start,
    count_freedoms,
    polynomial,
)
from gearfe.multibody.planar.joints import Joint


def system(bodies: list[Body], joints: list[Joint]) -> System:
    return System([Linkage(tuple(bodies), tuple(joints), (Gravity((0.0, -9.81)),))])


def lift(name: str, x: float, crank: float, angle: float) -> tuple[list[Body], list[Joint]]:
    """A Scott-Russell linkage: the end T of its bar moves along the vertical line through its bearing at x."""
    c, s = crank * math.cos(angle), crank * math.sin(angle)
    bodies = [
        Body(f"crank_{name}", 1.0, 0.1, (0.5 * crank, 0.0), (x, 0.0), angle),
        Body(f"bar_{name}", 2.0, 0.6, (crank, 0.0), (x + 2 * c, 0.0), math.atan2(s, -c)),
    ]
    joints: list[Joint] = [
        Hinge(f"crank_{name}", "ground", (0.0, 0.0), (x, 0.0), name=f"O_{name}"),
        Hinge(f"bar_{name}", f"crank_{name}", (crank, 0.0), (crank, 0.0), name=f"M_{name}"),
        Slot(f"bar_{name}", "ground", (0.0, 0.0), (x, 0.0), name=f"S_{name}"),
    ]
    return bodies, joints


def lifted(ends: int, *, slots: bool = False, driven: bool = False, cranks: tuple[float, ...] = (1.0, 1.3, 0.9)):  # type: ignore[no-untyped-def]
    """Platforms from lift to lift, all at the height 1.5 m."""
    bodies: list[Body] = []
    joints: list[Joint] = []
    for k in range(ends):
        more = lift(str(k), 1.7 * k, cranks[k], math.asin(0.75 / cranks[k]))
        bodies, joints = bodies + more[0], joints + more[1]
    for k in range(ends - 1):
        bodies.append(Body(f"deck{k}", 5.0, 1.0, (0.8, 0.1), (1.7 * k, 1.5)))
        top = (2 * cranks[k], 0.0), (2 * cranks[k + 1], 0.0)
        joints.append(Hinge(f"deck{k}", f"bar_{k}", (0.0, 0.0), top[0], name=f"L{k}"))
        if slots:
            joints.append(Slot(f"bar_{k + 1}", f"deck{k}", top[1], (1.7, 0.0), name=f"R{k}"))
        else:
            joints.append(Hinge(f"deck{k}", f"bar_{k + 1}", (1.7, 0.0), top[1], name=f"R{k}"))
    if driven:
        joints.append(Prescribed("crank_0", "angle", polynomial((math.asin(0.75 / cranks[0]), 0.5))))
    return system(bodies, joints)


@pytest.mark.parametrize(("ends", "driven"), [(2, False), (2, True), (3, False)])
def test_platforms_between_straight_line_linkages(ends: int, driven: bool) -> None:
    """Heights that differ stretch a platform to second order: one freedom for all lifts, less the drive."""
    made = lifted(ends, driven=driven)
    freedoms = count_freedoms(made, 0.0, made.start_q)
    assert (freedoms.net, freedoms.hidden) == (1 - driven, ends - 1)
    text = f"gradients leave {ends - driven} free, the joints {1 - driven}"
    with pytest.raises(InputError, match=rf"hinge R0 .*holds only to second order, in every position: {text}"):
        consistent_start(made)


def test_with_slots_the_platforms_move() -> None:
    freedoms = consistent_start(lifted(3, slots=True)).freedoms
    assert (freedoms.net, freedoms.hidden, freedoms.redundant, freedoms.passing) == (3, 0, (), ())


@pytest.mark.parametrize("turn", [0.0, 0.7, 2.1])
@pytest.mark.parametrize("off", [0.0, 1e-3, 0.2])
def test_a_bar_between_parallel_slots(turn: float, off: float) -> None:
    """Its ends are as far apart as the slots: it cannot turn, though the gradients allow it; from poses beside it."""
    c, s = math.cos(turn), math.sin(turn)
    bar = Body("bar", 1.0, 0.3, (0.7, 0.1), (0.1 * off, 0.3), turn + off)
    joints: list[Joint] = [
        Slot("bar", "ground", (x, 0.0), (x * c, x * s), (-s, c), name=f"end{k}") for k, x in enumerate((0.0, 1.3))
    ]
    with pytest.raises(InputError, match="gradients leave 2 free, the joints 1"):
        consistent_start(system([bar], joints))


def test_bars_in_line_that_nothing_can_move() -> None:
    bodies = [Body("a", 1.0, 0.1), Body("b", 1.0, 0.1, position=(1.0, 0.0))]
    joints: list[Joint] = [
        Hinge("a", "ground"),
        Hinge("a", "b", (1.0, 0.0)),
        Hinge("b", "ground", (0.6, 0.0), (1.6, 0.0), name="end"),
    ]
    with pytest.raises(InputError, match="gradients leave 1 free, the joints 0"):
        consistent_start(system(bodies, joints))


@pytest.mark.parametrize("count", [3, 4, 6])
@pytest.mark.parametrize("angle", [0.4, 0.0, 1e-7, math.pi])
def test_cranks_beyond_two_are_redundant(count: int, angle: float) -> None:
    """A coupler on parallel cranks: one freedom, all but two cranks redundant, also where all lie flat."""
    c, s = math.cos(angle), math.sin(angle)
    bodies = [Body(f"c{k}", 1.0, 0.1, (0.5, 0.0), (0.8 * k, 0.0), angle, (0.0, 0.0), 2.0) for k in range(count)]
    bodies.append(Body("coupler", 2.0, 0.5, (0.3, 0.0), (c, s), 0.0, (-2.0 * s, 2.0 * c)))
    joints: list[Joint] = [Hinge(f"c{k}", "ground", (0.0, 0.0), (0.8 * k, 0.0)) for k in range(count)]
    joints += [Hinge("coupler", f"c{k}", (0.8 * k, 0.0), (1.0, 0.0)) for k in range(count)]
    freedoms = consistent_start(system(bodies, joints)).freedoms
    assert freedoms.net == 1
    assert len(freedoms.redundant) == count - 2
    assert freedoms.hidden == 0


def test_two_guides_of_one_slider_are_redundant() -> None:
    """Four rows, of which two are redundant: one freedom; also with a slot beside them."""
    slider = Body("slider", 1.0, 0.1, (0.1, 0.1), (0.2, 0.3), 0.5)
    along = (math.cos(0.5), math.sin(0.5))
    joints: list[Joint] = [
        Prismatic("slider", "ground", at, (0.2 + along[0] * at[0], 0.3 + along[1] * at[0]), along, name=f"g{k}")
        for k, at in enumerate(((0.0, 0.0), (0.4, 0.0)))
    ]
    joints.append(Slot("slider", "ground", (0.7, 0.0), (0.2, 0.3), along))
    freedoms = consistent_start(system([slider], joints)).freedoms
    assert (freedoms.net, len(freedoms.redundant), freedoms.hidden) == (1, 3, 0)


@pytest.mark.parametrize("distance", [0.0, 1e-9, 1e-6, -1e-5, 1e-3])
def test_folds_that_are_passed_are_no_such_position(distance: float) -> None:
    """Crank and rod of one length: at the fold two branches meet, and each moves on."""
    angle = math.pi / 2 + distance
    bodies = [
        Body("crank", 1.0, 0.1, (0.5, 0.0), angle=angle, rate=2.0),
        Body(
            "rod", 1.0, 0.1, (0.5, 0.0), (math.cos(angle), math.sin(angle)), -angle, (-2.0 * math.sin(angle), 0.0), -2.0
        ),
    ]
    joints: list[Joint] = [Hinge("crank", "ground"), Hinge("rod", "crank", (0.0, 0.0), (1.0, 0.0))]
    joints.append(Slot("rod", "ground", (1.0, 0.0)))
    freedoms = consistent_start(system(bodies, joints)).freedoms
    assert (freedoms.net, freedoms.hidden, freedoms.redundant) == (1, 0, ())
    assert np.isin(len(freedoms.passing), (0, 1))
