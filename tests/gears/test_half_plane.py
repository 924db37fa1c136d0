"""The half-plane law: identities of an equilibrium, Hertz's contact, and the finite elements it stands in for."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gearfe.fem.plane import Material
from gearfe.gears.contact.half_plane import NEAR, first_state, half_plane_pair, solve_half_plane
from gearfe.gears.contact.half_plane_step import change, step
from gearfe.gears.gearmesh.sweep import elastic_pair
from gearfe.gears.geometry.pair import GearPair
from tests.makers.gears import gear
from tests.makers.gears import pair as gear_pair
from tests.makers.half_plane_pairs import KINKED, PAIRS, angles_of, law_of, reached_marks
from tests.makers.solving import solve_positions

# ---- identities ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["rounded", "sharp", "shifted"])
@pytest.mark.parametrize("degrees", [0.005, 0.05, 0.4])
def test_torque_is_the_derivative_of_the_energy(name: str, degrees: float) -> None:
    """T = dU/dtwist: centre and normal of each contact make the energy stationary, and windows hold all pressure."""
    law, twist, share = law_of(name), math.radians(degrees), 0.01
    angles = angles_of(law.pair, 12)
    low, middle, high = (solve_half_plane(law, angles, twist * f) for f in (1 - share, 1.0, 1 + share))
    rate = (high.energy - low.energy) / (2 * share * twist)
    assert np.abs(rate / middle.torque_wheel - 1).max() < 4e-4
    slope = (high.torque_wheel - low.torque_wheel) / (2 * share * twist)
    # within the range of the differences pairs come and go at one or two angles
    assert np.median(np.abs(middle.tangent / slope - 1)) < 1e-3


@pytest.mark.parametrize(("name", "bound"), [("kinked", 3e-4), ("undercut", 1e-3)])
def test_torque_is_the_derivative_of_the_energy_beside_kinks(name: str, bound: float) -> None:
    """Wherever the start of a steep relief or the edge of an undercut (its tips are sharp) stands among the panels."""
    pair = KINKED[name]
    law = half_plane_pair(elastic_pair(pair))
    angles, twist = angles_of(pair, 60), 0.02 * pair.pinion.module / pair.wheel.base_radius
    low, middle, high = (solve_half_plane(law, angles, twist * f) for f in (1 - 1e-4, 1.0, 1 + 1e-4))
    assert {"kinked": "relief", "undercut": "undercut"}[name] in reached_marks(law, middle.contacts)
    rate = (high.energy - low.energy) / (2e-4 * twist)
    assert np.abs(rate / middle.torque_wheel - 1).max() < bound


@pytest.mark.parametrize("name", ["rounded", "sharp", "shifted"])
@pytest.mark.parametrize("degrees", [0.01, 0.3])
def test_gears_exchanged(name: str, degrees: float) -> None:
    """Pinion and wheel change their names: turned by half a turn, the same pair, with the torques exchanged."""
    pair, twist = PAIRS[name], math.radians(degrees)
    elastic = elastic_pair(pair, law="penalty", flank_coarsen=4.0)
    other = GearPair(pair.wheel, pair.pinion, pair.centre_distance)
    there = half_plane_pair(elastic_pair(other, law="penalty", flank_coarsen=4.0))
    here = half_plane_pair(elastic)
    angles = angles_of(pair, 8)
    one = solve_half_plane(here, angles, twist)
    # the wheel, at -angle/i + twist, becomes a pinion that stands pi/z further, as a tooth faces its space
    turned = -angles * pair.pinion.teeth / pair.wheel.teeth + twist + math.pi / pair.wheel.teeth
    two = solve_half_plane(there, turned, twist * pair.wheel.teeth / pair.pinion.teeth)
    assert two.torque_pinion == pytest.approx(one.torque_wheel, rel=1e-7)
    assert two.torque_wheel == pytest.approx(one.torque_pinion, rel=1e-7)
    assert two.energy == pytest.approx(one.energy, rel=1e-7)


def test_a_mesh_cycle_on_all_is_the_same_and_batches_do_not_matter() -> None:
    law, twist = law_of("rounded"), math.radians(0.1)
    angles = angles_of(law.pair, 6)
    here = solve_half_plane(law, angles, twist)
    there = solve_half_plane(law, angles + 3 * law.pair.mesh_cycle, twist)
    assert there.torque_wheel == pytest.approx(here.torque_wheel, rel=1e-9)
    assert (there.contacts.pair == here.contacts.pair - 3).all()
    alone = [solve_half_plane(law, angle, twist).torque_wheel[0] for angle in angles]
    assert alone == pytest.approx(here.torque_wheel, rel=1e-11)


def test_moments_are_those_of_the_forces() -> None:
    """The hubs hold the moment of the contact forces: T_1 + T_2 = a F_y, and shares add up."""
    law = law_of("shifted")
    found = solve_half_plane(law, angles_of(law.pair, 10), math.radians(0.2))
    c = found.contacts
    across = np.bincount(c.position, c.force * c.normal.imag, len(found))
    balance = found.torque_pinion + found.torque_wheel - law.pair.working_centre_distance * across
    assert np.abs(balance).max() < 1e-9 * found.torque_wheel.max()
    assert np.bincount(c.position, c.torque_wheel, len(found)) == pytest.approx(found.torque_wheel, rel=1e-12)
    assert (c.pressure * c.width).sum(axis=1) * law.width == pytest.approx(c.force, rel=1e-12)


# ---- Hertz ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["rounded", "shifted"])
@pytest.mark.parametrize("degrees", [0.0005, 0.005])
def test_hertz_at_the_pitch_point(name: str, degrees: float) -> None:
    """Light load at the pitch point: half width and peak pressure are Hertz's for the involutes' curvatures."""
    law = law_of(name)
    pair = law.pair
    # where the pitch point is contacted: the pinion's flank meets it at the roll length r_b tan(working angle)
    roll = pair.pinion.base_radius * math.tan(pair.working_pressure_angle)
    angles = np.linspace(0, pair.mesh_cycle, 400, endpoint=False)
    first_contact = law.teeth.first_contacts(angles)
    face = law.sides[0].face
    u = (roll - face.flank.start) / (face.flank.end - face.flank.start)
    angle = first_contact.angle[np.argmin(np.abs(first_contact.place[:, 0] - u))]
    contacts = solve_half_plane(law, angle, math.radians(degrees)).contacts
    k = int(np.argmin(np.abs(law.sides[0].face.parameter_at(contacts.arc[:, 0]) - u)))
    one, two = (one.base_radius * math.tan(pair.working_pressure_angle) for one in (pair.pinion, pair.wheel))
    radius = one * two / (one + two)
    steel = Material()
    modulus = 0.5 * steel.youngs_modulus / (1 - steel.poisson_ratio**2)
    line = contacts.force[k] / law.width
    b = math.sqrt(4 * line * radius / (math.pi * modulus))
    assert contacts.half_width[k] == pytest.approx(b, rel=5e-3)
    assert contacts.pressure[k].max() == pytest.approx(2 * line / (math.pi * b), rel=5e-3)
    assert reached_marks(law, contacts)[k] == ""


# ---- finite elements -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("degrees", [0.002, 0.05, 0.5])
def test_independent_of_the_flank_mesh(degrees: float) -> None:
    """A flank of 35 elements serves as well as one of 140: the contact is not on the mesh."""
    angles, twist = angles_of(PAIRS["rounded"], 9), math.radians(degrees)
    coarse, fine = (solve_half_plane(law_of("rounded", c), angles, twist) for c in (4.0, 1.0))
    assert np.abs(coarse.torque_wheel / fine.torque_wheel - 1).max() < 3e-4


def test_nitsche_where_its_elements_see_the_contact() -> None:
    angles, twist = angles_of(PAIRS["rounded"], 4), math.radians(0.5)
    reference = solve_positions(elastic_pair(PAIRS["rounded"], law="nitsche"), angles, twist)
    found = solve_half_plane(law_of("rounded"), angles, twist)
    expected = np.array([p.torque_wheel for p in reference])
    assert np.abs(found.torque_wheel / expected - 1).max() < 1e-3
    pinion = np.array([p.torque_pinion for p in reference])
    assert np.abs(found.torque_pinion / pinion - 1).max() < 1e-3
    reaction = np.array([p.torque_wheel_reaction for p in reference])
    assert np.abs(found.torque_wheel_reaction / reaction - 1).max() < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [0.05, 0.5])
def test_nitsche_refined(degrees: float) -> None:
    """Nitsche's law on elements less than half as large, also near the changes of the pairs."""
    angles, twist = angles_of(PAIRS["rounded"], 12), math.radians(degrees)
    reference = solve_positions(elastic_pair(PAIRS["rounded"], law="nitsche", coarsen=0.45), angles, twist)
    expected = np.array([p.torque_wheel for p in reference])
    found = solve_half_plane(law_of("rounded"), angles, twist).torque_wheel
    assert np.abs(found / expected - 1).max() < 6e-4


# ---- smoothness and statuses ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["rounded", "sharp"])
def test_no_kinks_in_the_angle(name: str) -> None:
    """Fourth differences of the torque within the stretch of one pair in contact are rounding and panels, no kinks."""
    law, twist = law_of(name), math.radians(0.05)
    angles = np.linspace(0, law.pair.mesh_cycle, 240, endpoint=False)
    found = solve_half_plane(law, angles, twist)
    c = found.contacts
    single = np.bincount(c.position, minlength=240) == 1
    single &= ~np.isin(np.arange(240), c.position[reached_marks(law, c) != ""])
    kinks = np.abs(np.convolve(found.torque_wheel, [1, -4, 6, -4, 1], mode="valid")) / 16 / found.torque_wheel[2:-2]
    inner = np.convolve(single, np.ones(13), mode="valid") == 13
    assert inner.sum() > 40
    assert kinks[4:-4][inner].max() < 4e-5


def test_marks_are_told() -> None:
    """At the ends of the path the pressure reaches the sharp tip or the round, in the middle nothing."""
    for name, mark in (("sharp", "tip"), ("rounded", "round")):
        law = law_of(name)
        contacts = solve_half_plane(law, angles_of(law.pair, 30), math.radians(0.2)).contacts
        u = np.stack([law.sides[g].face.parameter_at(contacts.arc[:, g]) for g in (0, 1)], axis=1)
        marks, ends = reached_marks(law, contacts), np.abs(u - 1.0).min(axis=1) < 1e-6
        assert set(marks) == {"", mark}
        if name == "sharp":
            assert (marks[ends] == mark).all()
        middle = (u > 0.4).all(axis=1) & (u < 0.7).all(axis=1)
        assert middle.any()
        assert (marks[middle] == "").all()


def test_no_contact_and_no_position() -> None:
    """Backlash that is not taken up: zero torque, no contacts; an empty list of positions is answered likewise."""
    pair = gear_pair(tip_round=1e-4, tooth_thinning=50e-6)
    law = half_plane_pair(elastic_pair(pair, law="penalty", flank_coarsen=4.0, coarsen=1.5))
    found = solve_half_plane(law, angles_of(pair, 3), [0.9 * pair.contact_twist, 1.2 * pair.contact_twist, -1e-3])
    assert found.status.tolist() == ["no_contact", "converged", "no_contact"]
    assert found.torque_wheel[[0, 2]].tolist() == [0.0, 0.0]
    assert set(found.contacts.position) == {1}


@pytest.mark.slow
def test_one_gear_softer_and_wider() -> None:
    """A wheel of aluminium, 14 mm wide, against 10 mm of steel: Nitsche's law agrees."""
    pair = GearPair(gear(20, tip_round=1e-4), gear(30, tip_round=1e-4, width=14e-3))
    metals = (Material(), Material(70e9, 0.34))
    angles, twist = angles_of(pair, 3), math.radians(0.5)
    reference = solve_positions(elastic_pair(pair, materials=metals, law="nitsche", coarsen=1.5), angles, twist)
    law = half_plane_pair(elastic_pair(pair, materials=metals, law="penalty", flank_coarsen=4.0))
    expected = np.array([p.torque_wheel for p in reference])
    assert np.abs(solve_half_plane(law, angles, twist).torque_wheel / expected - 1).max() < 1.5e-3


def test_no_jump_at_the_last_station() -> None:
    """A contact between the last station and the tip: influence and its derivatives go on without a jump, and every
    position around there has its equilibrium."""
    pair = gear_pair(bore=0.35)
    law = half_plane_pair(elastic_pair(pair, law="half_plane", flank_coarsen=4.0))
    for end in (0, -1):
        at = np.array([[side.stations[end] for side in law.sides]])
        inside, outside = law.shapes.at(at - 1e-12), law.shapes.at(at + 1e-12)
        most = np.abs(inside).max(axis=-1, keepdims=True)  # of values, slopes and curvatures
        assert (np.abs(inside - outside) < 1e-6 * most).all()
    angles = 1e-3 + (195 + np.linspace(-3, 3, 25)) * pair.mesh_cycle / 400
    for degrees in (0.2, 0.4, 0.6):
        found = solve_half_plane(law, angles, math.radians(degrees))
        assert set(found.status) == {"converged"}
        assert found.iterations.max() < 15


def test_forces_that_stand_still_by_chance_are_no_solution() -> None:
    """Places and widths count too: the first step moves the contacts by micrometres."""
    law, twist = law_of("rounded"), np.array([math.radians(0.05)])
    setting, state = first_state(law, twist, law.teeth.first_contacts(np.array([0.1])).take([0]))
    made = step(setting, state)
    assert np.abs(made.place).max() > 1e-6
    still = replace(state, force=made.next.force)
    assert change(setting, still, made.next, made.place).min() > NEAR


def test_an_undercuts_edge_on_a_nearly_flat_mate() -> None:
    """Steps that go to and fro are damped. Nitsche's law on a fine flank agrees."""
    sharp = gear_pair(12, 51, module=1.5e-3, pressure_angle=20.0, width=6e-3, bore=0.25)
    law = half_plane_pair(elastic_pair(sharp, law="half_plane"))
    assert law.teeth.faces[0].undercut
    angles = np.linspace(0, sharp.mesh_cycle, 80, endpoint=False)
    for module_share in (0.002, 0.008, 0.03):
        found = solve_half_plane(law, angles, module_share * sharp.wheel.module / sharp.wheel.base_radius)
        assert set(found.status) == {"converged"}
        assert "undercut" in reached_marks(law, found.contacts)
    reference = solve_positions(elastic_pair(sharp, law="nitsche"), angles[::8], found.twist[0])
    assert found.torque_wheel[::8] == pytest.approx([p.torque_wheel for p in reference], rel=2e-3)


def test_windows_hold_the_pressure_beside_edges() -> None:
    """A sharp tip that bears makes a wider contact than Hertz's: no pressure ends where its window does."""
    pair = gear_pair(bore=0.35)
    law = half_plane_pair(elastic_pair(pair, law="half_plane"))
    found = solve_half_plane(law, np.radians([0.0, 9.5, 12.0, 16.0]), math.radians(0.5))
    assert set(found.status) == {"converged"}
    c = found.contacts
    at_tip = np.stack([c.panel_arc[:, g] > law.teeth.faces[g].arc[-1] - 2 * c.width for g in (0, 1)]).any(axis=0)
    cut = (c.pressure[:, [0, -1]] > 0) & ~at_tip[:, [0, -1]]
    assert not cut.any()


@pytest.mark.parametrize("rim", [0.25, 0.5])
def test_bores_beside_the_roots(rim: float) -> None:
    """Where the teeth alone yield, T is below zero: forces to begin with had left tooth pairs out, silently. Rims
    thinner than the edges of their bores are long were 0.6 % too stiff.
    """
    thick = gear_pair(20, 30, tip_round=1e-4)
    pair = GearPair(
        *(replace(g, bore_diameter=2 * (g.root_radius - rim * g.module)) for g in (thick.pinion, thick.wheel))
    )
    angles, twist = angles_of(pair, 10), 0.05 * pair.pinion.module / pair.wheel.base_radius
    reference = solve_positions(elastic_pair(pair, law="nitsche"), angles, twist)
    found = solve_half_plane(half_plane_pair(elastic_pair(pair)), angles, twist)
    assert found.torque_wheel == pytest.approx([p.torque_wheel for p in reference], rel=2e-3)
    finer = solve_half_plane(half_plane_pair(elastic_pair(pair, coarsen=0.5)), angles, twist)
    assert found.torque_wheel == pytest.approx(finer.torque_wheel, rel=2e-3)


@pytest.mark.parametrize("factor", [0.01, 100.0])
def test_gears_of_another_size(factor: float) -> None:
    """Plane elasticity has no length: at the same twist torques grow with the square of the size, at the same width."""
    form = {"bore": 0.35, "width": 10e-3}
    one, other = (gear_pair(module=m, tip_round=0.04 * m, **form) for m in (2.5e-3, factor * 2.5e-3))
    angles, twist = angles_of(one, 8), math.radians(0.3)
    small, large = (solve_half_plane(half_plane_pair(elastic_pair(p)), angles, twist) for p in (one, other))
    assert large.torque_wheel == pytest.approx(factor**2 * small.torque_wheel, rel=2e-5)
