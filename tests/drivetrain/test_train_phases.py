"""Phases of meshes are geometry: teeth drawn at the places found touch on their driving flanks, and only there."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from matplotlib.path import Path as Outline

from gearfe.base.errors import InputError
from gearfe.drivetrain.train import Drive, GearMesh, GearTrain, Load, Shaft, ShaftGear, build_train, simulate
from gearfe.gears.geometry.derived import gear_outline
from gearfe.multibody import constant
from tests.makers.trains import MODULE, changed, curve, gear

Place = tuple[float, float]


def placed(
    teeth: list[int], places: list[Place], pairs: list[tuple[int, int]], *, speed: float = 600.0, driven: int = 0,
    distances: tuple[float | None, ...] = (), stiffness: object = curve, load: float | None = None,
) -> GearTrain:  # fmt: skip
    """One gear a shaft at (x, z), meshes between the pairs, the last shaft of the last pair braked with 100 N m."""
    names = [f"s{i}" for i in range(len(teeth))]
    shafts = tuple(
        Shaft(n, (x, 0.0, z), 0.09, 0.008, (n + "+", n + "-")) for n, (x, z) in zip(names, places, strict=True)
    )
    gears = tuple(ShaftGear(f"g{i}", n, 0.0, gear(z)) for i, (n, z) in enumerate(zip(names, teeth, strict=True)))
    apart = distances or (None,) * len(pairs)
    meshes = tuple(
        GearMesh(f"g{i}", f"g{j}", stiffness(teeth[i]), centre_distance=a)  # type: ignore[operator]
        for (i, j), a in zip(pairs, apart, strict=True)
    )
    bores = {n + s: (x, y, z) for n, (x, z) in zip(names, places, strict=True) for s, y in (("+", 0.04), ("-", -0.04))}
    drive = Drive(names[driven], names[driven] + "+", constant(speed))
    gear_train = GearTrain(shafts, gears, meshes, drive, rigid_bores=bores)
    ratios = build_train(gear_train).ratios
    brake = -100.0 * math.copysign(1.0, ratios[pairs[-1][1]] * speed) if load is None else load
    return changed(gear_train, loads=(Load(names[pairs[-1][1]], None, constant(brake)),))


def apart(one: int, two: int, more: float = 0.0) -> float:
    return 0.5 * MODULE * (one + two) + more


def meets(gear_train: GearTrain, number: int, turned: float) -> bool:
    """Whether the teeth of a mesh overlap with the driver turned by so much in its driving sense."""
    senses, angles = gear_train.kinematics.senses, gear_train.kinematics.angles
    mesh = gear_train.meshes[number]
    items = [gear_train.gear(name) for name in (mesh.driver, mesh.driven)]
    centres = [1e3 * gear_train.frame[:2] @ np.array(gear_train.shaft(item.shaft).point) for item in items]
    sectors = []
    for item, more, own, other in zip(items, (senses[number] * turned, 0.0), centres, centres[::-1], strict=True):
        # the drawing has a tooth on its first axis at angle 0
        points = gear_outline(item.gear, angles[item.name] + more, (0.0, 0.0), per_segment=100)[:-1]
        away = np.angle(points[:, 0] + 1j * points[:, 1]) - math.atan2(*(other - own)[::-1])
        away = np.angle(np.exp(1j * away))
        near = np.flatnonzero(np.abs(away) < 4.0 * math.pi / item.gear.teeth)
        near = near[np.argsort(away[near])]
        sectors.append((own + points[near], np.vstack([own, own + points[near]])))
    (one, first), (two, second) = sectors
    return bool(Outline(first).contains_points(two).any() or Outline(second).contains_points(one).any())


@pytest.mark.parametrize("speed", [600.0, -600.0])
@pytest.mark.parametrize("turn_deg", [0.0, 37.0, 180.0])
@pytest.mark.parametrize("middle", [30, 23])
def test_drawn_teeth_touch_on_their_driving_flanks(speed: float, turn_deg: float, middle: int) -> None:
    """Driver, idler, driven gear on a bent line, with backlash: a micrometre further overlaps, back again does not."""
    more = 1e-4
    first, second = apart(20, middle, more), apart(middle, 24, more)
    a, b = math.radians(turn_deg), math.radians(turn_deg + 75.0)
    places = [(0.0, 0.0), (first * math.cos(a), first * math.sin(a))]
    places.append((places[1][0] + second * math.cos(b), places[1][1] + second * math.sin(b)))
    gear_train = placed([20, middle, 24], places, [(0, 1), (1, 2)], speed=speed, distances=(first, second))
    for number, mesh in enumerate(gear_train.meshes):
        micrometre = 1e-6 / gear_train.gear(mesh.driver).gear.base_radius
        assert meets(gear_train, number, micrometre)
        assert not meets(gear_train, number, -micrometre)


@pytest.mark.parametrize(("teeth", "degrees"), [(30, 6.0), (25, 7.2), (20, 9.0), (31, 0.0)])
def test_the_phase_behind_an_idler_in_line(teeth: int, degrees: float) -> None:
    """Half a turn round the idler is z/2 teeth; with the space that the first mesh needs, an even z makes half a pitch.

    An idler of odd z has a tooth facing the second gear when a space faces the first.
    """
    one, two = apart(20, teeth), apart(20, teeth) + apart(teeth, 28)
    gear_train = placed([20, teeth, 28], [(0.0, 0.0), (one, 0.0), (two, 0.0)], [(0, 1), (1, 2)])
    expected = degrees if teeth % 2 == 0 else 0.0
    assert np.degrees([line.phase for line in build_train(gear_train).meshes]) == pytest.approx(
        [0.0, expected], abs=1e-9
    )


def in_line(**changes: float) -> GearTrain:
    gear_train = placed([20, 30, 20], [(0.0, 0.0), (0.0625, 0.0), (0.125, 0.0)], [(0, 1), (1, 2)])
    meshes = list(gear_train.meshes)
    for key, phase in changes.items():
        meshes[int(key[-1])] = dataclasses.replace(meshes[int(key[-1])], phase=math.radians(phase))
    return changed(gear_train, meshes=tuple(meshes))


def test_a_given_phase_turns_all_gears_that_hang_together() -> None:
    """The other mesh follows through the teeth of the idler: by 20/30 of the driver's angle, the other way."""
    found = [
        np.degrees([line.phase for line in build_train(s).meshes]) for s in (in_line(mesh1=6.0), in_line(mesh1=10.0))
    ]
    assert found[0] == pytest.approx([0.0, 6.0], abs=1e-9)
    # idler and driver turn oppositely, each counted in its own driving sense: 4 deg more there are 6 deg more here
    assert found[1] == pytest.approx([6.0, 10.0], abs=1e-9)
    times = np.linspace(0.0, 2e-3, 21)
    one, two = (simulate(build_train(s), times).contact_force for s in (in_line(), in_line(mesh0=0.0, mesh1=18.0)))
    assert one == pytest.approx(two, rel=1e-12)


def test_a_phase_against_the_teeth_of_a_shared_gear() -> None:
    with pytest.raises(InputError, match=r"mesh 'g1-g2' phase_deg = 0.*which make it 6 deg.*write 6 "):
        build_train(in_line(mesh0=0.0, mesh1=0.0))


def test_gears_on_one_shaft_are_keyed_freely() -> None:
    """Without a shared gear every mesh starts at 0 or where it is told, whatever the others do."""
    from tests.makers.trains import SHIPPED, train

    gear_train = train(SHIPPED, stiffness=curve)
    assert [line.phase for line in build_train(gear_train).meshes] == [0.0, 0.0]
    keyed = (gear_train.meshes[0], dataclasses.replace(gear_train.meshes[1], phase=0.1))
    assert [line.phase for line in build_train(changed(gear_train, meshes=keyed)).meshes] == pytest.approx([0.0, 0.1])


def rhombus(degrees: float) -> GearTrain:
    """Two idlers between the first and the last gear, all of 20 teeth."""
    side, angle = apart(20, 20), math.radians(degrees)
    ends = [(side, 0.0), (side * math.cos(angle), side * math.sin(angle))]
    places = [(0.0, 0.0), *ends, (ends[0][0] + ends[1][0], ends[1][1])]
    return placed([20] * 4, places, [(0, 1), (0, 2), (1, 3), (2, 3)])


def test_a_closed_chain_assembles_where_its_angle_fits_the_teeth() -> None:
    """Both ways round agree when 4 z angle is a whole number of turns: every 4.5 deg for z = 20.

    At 80 deg, 4 x 20 x 80 deg is 80 deg short of 18 turns: 80/20 = 4 deg of a gear.
    """
    forces = simulate(build_train(rhombus(90.0)), np.linspace(0.0, 1e-3, 5)).contact_force
    assert forces[:, 0] == pytest.approx(forces[:, 1], rel=1e-6, abs=1e-6)  # a right angle is five teeth: equal sides
    phases = [line.phase for line in build_train(rhombus(81.0)).meshes]
    assert np.degrees(phases[:2]) == pytest.approx([0.0, 9.0], abs=1e-9)  # four teeth and a half
    with pytest.raises(
        InputError, match=r"closes a chain of gears that cannot be assembled.*gear 'g2' is 4 deg \(0\.2222 of"
    ):
        rhombus(80.0)
    rhombus(76.5)


def test_driver_and_driven_exchange_their_roles() -> None:
    """The same train driven from its other end: curves count from the teeth of the gears that now drive."""
    places = [(0.0, 0.0), (0.0, apart(20, 30)), (apart(30, 27), apart(20, 30))]
    back = placed([20, 30, 27], places, [(2, 1), (1, 0)], driven=2)
    for number in range(2):
        assert [line.phase for line in build_train(back).meshes][number] >= 0.0
        assert meets(back, number, 1e-4)
    angles = back.kinematics.angles
    towards = math.atan2(*(back.frame[:2] @ np.array([0.0, 0.0, -apart(20, 30)]))[::-1])
    left = math.remainder(angles["g1"] - towards, 2 * math.pi / 30) * build_train(back).meshes[1].sense
    assert math.remainder(left - build_train(back).meshes[1].phase, 2 * math.pi / 30) == pytest.approx(0.0, abs=1e-12)
