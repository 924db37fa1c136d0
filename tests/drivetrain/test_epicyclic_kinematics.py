"""Speeds, torques, assembly and mesh phases of epicyclic trains, against textbook formulas in fractions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.drivetrain.train.kinematics import Kinematics, kinematics
from gearfe.drivetrain.train.layout import LayoutCarrier, LayoutGear, LayoutMesh, TrainLayout
from gearfe.drivetrain.train.planetary import HARMONICS, mesh_families
from gearfe.drivetrain.train.rolling import Rolling, rolling
from gearfe.multibody import constant

MODULE = 2e-3
F = Fraction


class Stage:
    """A layout in the making: shafts by name, gears, and meshes of the first planets, one for each place."""

    def __init__(self) -> None:
        self.shafts: list[str] = []
        self.gears: list[LayoutGear] = []
        self.meshes: list[LayoutMesh] = []
        self.carriers: list[LayoutCarrier] = []

    def shaft(self, *names: str) -> None:
        self.shafts += names

    def gear(self, name: str, shaft: str, teeth: int) -> LayoutGear:
        made = LayoutGear(name, self.shafts.index(shaft), teeth, 0.5 * MODULE * abs(teeth) * math.cos(0.35))
        self.gears.append(made)
        return made

    def mesh(self, one: LayoutGear, two: LayoutGear, carrier: str | None = None, towards: float = 0.0) -> None:
        number = None if carrier is None else self.shafts.index(carrier)
        distance = 0.5 * MODULE * abs(one.teeth + two.teeth)
        self.meshes.append(LayoutMesh(f"{one.name}-{two.name}", one, two, towards, distance, 0.0, None, number))

    def layout(self, driven: str, loads: dict[str, float] | None = None, **guided: Any) -> TrainLayout:
        return TrainLayout(
            tuple(self.shafts), self.shafts.index(driven), constant(100.0), tuple(self.gears), tuple(self.meshes),
            tuple((self.shafts.index(name), constant(torque)) for name, torque in (loads or {}).items()),
            guided=tuple((self.shafts.index(name), F(ratio)) for name, ratio in guided.items()),
            carriers=tuple(self.carriers),
        )  # fmt: skip


def simple(sun: int, planet: int, ring: int, angles: Sequence[float] = (0.0,)) -> Stage:
    """Sun, planets, ring, carrier."""
    made = Stage()
    made.shaft("sun", "ring", "carrier", *(f"planet{k}" for k in range(len(angles))))
    one, two = made.gear("sun", "sun", sun), made.gear("ring", "ring", -ring)
    for k, angle in enumerate(angles):
        p = made.gear(f"planet{k}", f"planet{k}", planet)
        made.mesh(one, p, "carrier", angle)
        made.mesh(p, two, "carrier", angle)
    places = tuple((3 + k, angle) for k, angle in enumerate(angles))
    made.carriers.append(LayoutCarrier("arm", 2, (places,)))
    return made


def spread(count: int) -> list[float]:
    return [2.0 * math.pi * k / count for k in range(count)]


def speed(rolled: Rolling, stage: Stage, name: str) -> Fraction:
    return rolled.ratios[stage.shafts.index(name)]


S, P, R = 18, 12, 42


@pytest.mark.parametrize(
    ("driven", "fixed", "output", "expected"),
    [
        ("sun", "ring", "carrier", F(S, S + R)),
        ("carrier", "ring", "sun", F(S + R, S)),
        ("ring", "sun", "carrier", F(R, S + R)),
        ("carrier", "sun", "ring", F(S + R, R)),
        ("sun", "carrier", "ring", F(-S, R)),
        ("ring", "carrier", "sun", F(-R, S)),
    ],
)
def test_six_arrangements_of_a_simple_stage(driven: str, fixed: str, output: str, expected: Fraction) -> None:
    """Speeds by Willis; torques T_s : T_r : T_c = z_s : z_r : -(z_s + z_r), in fractions."""
    stage = simple(S, P, R)
    rolled = rolling(stage.layout(driven, **{fixed: 0}))
    assert speed(rolled, stage, output) == expected
    torque = {"sun": F(S), "ring": F(R), "carrier": F(-S - R)}
    at_drive, at_hold = rolled.reactions(stage.shafts.index(output))
    assert at_drive == torque[driven] / torque[output]
    assert at_hold == torque[fixed] / torque[output]


def test_the_planet_of_the_shared_case() -> None:
    """18/12/42, ring fixed: carrier 0.3, planet -0.75 times the speed of the sun."""
    stage = simple(S, P, R)
    rolled = rolling(stage.layout("sun", ring=0))
    assert (speed(rolled, stage, "carrier"), speed(rolled, stage, "planet0")) == (F(3, 10), F(-3, 4))


def test_a_differential_adds_its_inputs() -> None:
    """w_c = (z_s w_s + z_r w_r)/(z_s + z_r)."""
    stage = simple(S, P, R)
    rolled = rolling(stage.layout("sun", ring=F(-1, 3)))
    assert speed(rolled, stage, "carrier") == (F(S) + R * F(-1, 3)) / (S + R)


def stepped(z: tuple[int, int, int, int]) -> Stage:
    """Sun a, planet gears b and c on one shaft, ring or sun d."""
    made = Stage()
    made.shaft("a", "carrier", "d", "planet")
    a, b, c, d = (made.gear(n, s, t) for n, s, t in zip("abcd", ("a", "planet", "planet", "d"), z, strict=True))
    made.mesh(a, b, "carrier")
    made.mesh(c, d, "carrier")
    made.carriers.append(LayoutCarrier("arm", 1, (((3, 0.0),),)))
    return made


def test_stepped_planets_with_a_ring_and_with_two_suns() -> None:
    """Basic ratio i0 = -z_b z_d/(z_a z_c), positive with two suns; d fixed: w_a/w_c = 1 - i0 of w_a/w_d."""
    for d in (-73, 33):
        z = (21, 31, 17, d)
        stage = stepped(z)
        rolled = rolling(stage.layout("a", d=0))
        basic = F(z[1] * z[3], z[0] * z[2])  # w_a/w_d with the carrier at rest, signed numbers of teeth
        assert speed(rolled, stage, "carrier") == 1 / (1 - basic)


def test_a_stage_with_pairs_of_planets() -> None:
    """Sun, two planets in mesh with each other, ring: i0 = +z_r/z_s."""
    made = Stage()
    made.shaft("sun", "carrier", "ring", "p", "q")
    sun, p, q, ring = (made.gear(n, n, t) for n, t in (("sun", 24), ("p", 14), ("q", 15), ("ring", -72)))
    for one, two in ((sun, p), (p, q), (q, ring)):
        made.mesh(one, two, "carrier")
    rolled = rolling(made.layout("sun", ring=0))
    assert speed(rolled, made, "carrier") == 1 / (1 - F(72, 24))


def test_wolfrom_and_ravigneaux() -> None:
    """Wolfrom: w_2/w_s = (1 - z_1 p_2/(p_1 z_2)) / (1 + z_1/z_s). Ravigneaux: both suns about one ring."""
    made = Stage()
    made.shaft("sun", "carrier", "ring1", "ring2", "planet")
    sun, p1, p2 = made.gear("sun", "sun", 15), made.gear("p1", "planet", 20), made.gear("p2", "planet", 18)
    one, two = made.gear("ring1", "ring1", -55), made.gear("ring2", "ring2", -53)
    for pair in ((sun, p1), (p1, one), (p2, two)):
        made.mesh(*pair, "carrier")
    assert speed(rolling(made.layout("sun", ring1=0)), made, "ring2") == (1 - F(55 * 18, 20 * 53)) / (1 + F(55, 15))

    box = Stage()
    box.shaft("small", "large", "carrier", "ring", "short", "long")
    small, large, ring = box.gear("s1", "small", 26), box.gear("s2", "large", 30), box.gear("r", "ring", -74)
    short, long = box.gear("p1", "short", 21), box.gear("p2", "long", 22)
    for pair in ((small, short), (short, long), (large, long), (long, ring)):
        box.mesh(*pair, "carrier")
    assert speed(rolling(box.layout("small", carrier=0)), box, "ring") == F(26, 74)
    assert speed(rolling(box.layout("small", large=0)), box, "ring") == F(26, 74) * F(30 + 74, 30 + 26)


def test_two_stages_in_a_row_and_their_reactions() -> None:
    """Carrier of the first stage coupled to the sun of the second: ratios and torques multiply."""
    made = Stage()
    made.shaft("sun", "arm", "ring", "planet", "sun2", "arm2", "ring2", "planet2")
    for tail in ("", "2"):
        sun, p, ring = (made.gear(n + tail, n + tail, t) for n, t in (("sun", S), ("planet", P), ("ring", -R)))
        made.mesh(sun, p, "arm" + tail)
        made.mesh(p, ring, "arm" + tail)
    layout = made.layout("sun", ring=0, ring2=0)
    coupled = TrainLayout(**{**vars(layout), "couplings": ((1, 4),)})
    rolled = rolling(coupled)
    assert speed(rolled, made, "arm2") == F(3, 10) ** 2
    drive, first, second = rolled.reactions(5)
    assert drive == -(F(3, 10) ** 2)
    assert drive + first + second == -1


def steady(stage: Stage, **keys: Any) -> Kinematics:
    return kinematics(stage.layout(**keys))


@pytest.mark.parametrize(("driven", "load"), [("sun", "carrier"), ("carrier", "sun")])
def test_steady_forces_share_alike_and_balance(driven: str, load: str) -> None:
    """Three planets share the torque; forces of both meshes of a planet are equal, whoever drives."""
    stage = simple(S, P, R, spread(3))
    torque = 90.0
    rolled = steady(stage, driven=driven, loads={load: torque}, ring=0)
    arm = 0.5 * MODULE * math.cos(0.35)
    teeth = {"sun": S, "carrier": S + R}[load]
    np.testing.assert_allclose(rolled.steady_forces, torque / (3 * teeth * arm), rtol=1e-12)


def test_planets_that_do_not_assemble_are_refused_with_angles_that_do() -> None:
    """(z_s + z_r)/N must be whole: 20 + 52 = 72 for 5 planets is not; 72/4 and 72/6 are."""
    with pytest.raises(InputError, match=r"carriers\.arm\.planets.*20 \+ 52.*2 or 3 or 4 or 6.*multiples of 5 deg"):
        kinematics(simple(20, 16, 52, spread(5)).layout("sun", ring=0))
    kinematics(simple(20, 16, 52, [0.0, math.radians(75.0), math.radians(180.0)]).layout("sun", ring=0))
    with pytest.raises(InputError, match=r"planet 2 .* 75 or 80 deg from planet 1"):
        kinematics(simple(20, 16, 52, [0.0, math.radians(77.0), math.radians(180.0)]).layout("sun", ring=0))


def test_mesh_phases_are_those_of_parker_and_lin() -> None:
    """Sun-planet mesh n is z_s psi_n/2 pi cycles on from the first one, ring-planet z_r psi_n/2 pi (2004, eq. 3, 4)."""
    stage = simple(20, 16, 52, [0.0, math.radians(75.0), math.radians(180.0)])
    layout = stage.layout("sun", ring=0)
    sun, ring = mesh_families(layout, kinematics(layout).phases)
    for family, teeth in ((sun, 20), (ring, 52)):
        expected = np.array(family.angles) * teeth / (2.0 * math.pi)
        apart = np.array(family.phases)
        both = [np.abs(np.exp(2j * math.pi * apart) - np.exp(2j * math.pi * s * expected)).max() for s in (1, -1)]
        assert min(both) < 1e-9


@pytest.mark.parametrize(
    ("teeth", "count"), [((20, 16, 52), 4), ((21, 15, 51), 4), ((18, 12, 42), 5), ((22, 14, 50), 6)]
)
def test_suppression_is_that_of_the_rule_of_parker(teeth: tuple[int, int, int], count: int) -> None:
    """mod(l z_s, N) = 0: rotational; 1 or N - 1: translational; else planet modes (Parker 2000)."""
    layout = simple(*teeth, spread(count)).layout("sun", ring=0)
    for family in mesh_families(layout, kinematics(layout).phases):
        for harmonic in range(1, HARMONICS + 1):
            left = harmonic * teeth[0] % count
            expected = "rotational" if left == 0 else "translational" if left in (1, count - 1) else "planet"
            assert [kind for kind, value in family.excites(harmonic).items() if value] == [expected]


@pytest.mark.parametrize(
    ("driven", "guided", "text"),
    [
        ("sun", {"ring": 0, "carrier": 0}, r"shaft 'carrier' speed_ratio = 0.*: is fixed, but the drive"),
        ("sun", {}, r"shaft 'ring': turns freely.*fix one more member"),
        ("sun", {"ring": 0, "carrier": F(1, 2)}, r"is guided at 1/2 times"),
    ],
)
def test_stages_that_are_held_too_often_or_not_enough(driven: str, guided: dict[str, Any], text: str) -> None:
    with pytest.raises(InputError, match=text):
        rolling(simple(S, P, R).layout(driven, **guided))


def test_a_locked_stage_turns_as_one() -> None:
    """Ring guided at the speed of the sun: all members turn alike, and no mesh has a frequency."""
    stage = simple(S, P, R, spread(3))
    rolled = steady(stage, driven="sun", ring=1)
    assert set(rolled.ratios) == {F(1)}
    assert set(rolled.cycles) == {F(0)}
    assert rolled.common_turns is None
