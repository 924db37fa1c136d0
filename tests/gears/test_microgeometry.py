"""Rigid and loaded pairs with deviations against closed forms, elements on relieved meshes, and each other."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gearfe import InputError
from gearfe.base.config import build
from gearfe.base.tables.microgeometry import MicrogeometryTable
from gearfe.fem.plane import Material
from gearfe.gears.contact.half_plane import half_plane_pair, solve_half_plane
from gearfe.gears.contact.laws import Nitsche
from gearfe.gears.contact.whole_gears.pair import ElasticGear, WholePair
from gearfe.gears.contact.whole_gears.position import solve_position
from gearfe.gears.gearmesh.curve import BACK
from gearfe.gears.gearmesh.load_map import LoadMap
from gearfe.gears.gearmesh.sweep import elastic_pair, sweep_loads, sweep_stiffness
from gearfe.gears.geometry import pitch_errors
from gearfe.gears.geometry.deviation_job import deviations_of, pitch_errors_of
from gearfe.gears.geometry.face import NOMINAL, ToothDeviations
from gearfe.gears.geometry.modifications import FlankModification, Relief, Waviness, tooth_deviations
from gearfe.gears.geometry.pair import GearPair, TipRelief
from gearfe.gears.teeth.tooth_sector import sector_mesh, sector_recipes
from tests.makers.gears import pair as gear_pair
from tests.makers.gears import uneven

PAIR = gear_pair(tip_round=1e-4)
PINION, WHEEL = PAIR.pinion, PAIR.wheel


@pytest.fixture(scope="module")
def elastic():
    return elastic_pair(PAIR)


def loads(elastic, torques, deviations=NOMINAL, **options) -> LoadMap:
    """The map of elastic gears with deviations, small strain."""
    return sweep_loads(elastic.gears, torques, elastic=elastic.deviated(deviations), kinematics="small", **options)


def test_a_pitch_error_sine_is_the_unloaded_error(elastic) -> None:
    """On the path the wheel leads by F_j cos(alpha) of the tooth that touches: to 1e-12 m."""
    index = pitch_errors.sine(20, 20e-6, 0.3)
    bad = half_plane_pair(elastic).deviated((ToothDeviations(turn=pitch_errors.turns(PINION, index)), NOMINAL[1]))
    assert bad.mesh_cycles == 60
    angles = np.arange(60 * 8) * PAIR.mesh_cycle / 8
    found = bad.teeth.first_contacts(angles)
    first = np.full(len(angles), np.inf)
    np.minimum.at(first, found.position, found.twist)
    leads = found.take(np.flatnonzero(found.twist == first[found.position]))
    on = ((leads.place > 0.02) & (leads.place < 0.98)).all(axis=1)
    assert on.mean() > 0.7
    error = (leads.twist - PAIR.contact_twist)[on] * WHEEL.base_radius
    assert error == pytest.approx(-index[leads.pair[on] % 20] * math.cos(PINION.pressure_angle), abs=1e-12)


def test_a_pitch_error_sine_under_load_stays_within_that_of_its_pairs(elastic) -> None:
    """Turning every tooth that bears by the largest or the least of their turns brackets the loaded error."""
    index = pitch_errors.sine(20, 20e-6, 0.3)
    bad = ToothDeviations(turn=pitch_errors.turns(PINION, index)), NOMINAL[1]
    angles = np.arange(60) * PAIR.mesh_cycle / 3
    plain, made = (loads(elastic, [100.0], one, angles=angles) for one in (NOMINAL, bad))
    assert made.statuses == {"converged": 60}
    change = made.curves[0].transmission_error - plain.curves[0].transmission_error
    moved = -index * math.cos(PINION.pressure_angle)
    for i in range(60):
        pairs = {int(k) for one in (plain, made) for k in one.pairs[0].pair[one.pairs[0].position == i]}
        of_pairs = [moved[k % 20] for k in pairs]
        assert min(of_pairs) - 2e-8 <= change[i] <= max(of_pairs) + 2e-8
    assert np.ptp(change) > 1.5 * 20e-6 * math.cos(PINION.pressure_angle)


def test_eleven_waves_round_the_pinion_are_order_eleven(elastic) -> None:
    """At light load the amplitude of the wave along the normal, within 1 %; nothing else beside mesh orders."""
    wave = tooth_deviations(PINION, FlankModification(waviness=(Waviness(1e-6, 11, 0.4),)))
    made = loads(elastic, [2.0], (wave, NOMINAL[1]), positions=8)
    order, amplitude = made.spectrum()
    _, unloaded = made.spectrum(unloaded=True)
    at = int(np.searchsorted(order, 11))
    assert order[at] == pytest.approx(11)
    assert amplitude[0, at] == pytest.approx(1e-6, rel=0.01)
    assert unloaded[at] == pytest.approx(1e-6, rel=0.01)
    others = np.isclose(order % 20, 0) | (np.abs(order - 11) < 1e-9)
    assert amplitude[0][~others].max() < 0.02e-6


def test_gears_exchanged(elastic) -> None:
    """Seen from the wheel: its torque is the pinion's and the contact forces are the same."""
    rng = np.random.default_rng(7)
    index = [2e-6 * rng.standard_normal(z) for z in (20, 30)]
    relief = [
        FlankModification(tip_relief=Relief(8e-6, g.profile.tip_roll - 2e-3, "parabolic")) for g in (PINION, WHEEL)
    ]
    turns = [pitch_errors.turns(g, i) for g, i in zip((PINION, WHEEL), index, strict=True)]
    here = half_plane_pair(elastic).deviated(
        tuple(tooth_deviations(g, r, t) for g, r, t in zip((PINION, WHEEL), relief, turns, strict=True))
    )
    other_pair = GearPair(WHEEL, PINION)
    # the wheel's tooth -1, between the centres with the pinion's tooth 0, is its tooth 0 as a pinion
    as_pinion = tooth_deviations(WHEEL, relief[1], np.roll(turns[1], 1))
    as_wheel = tooth_deviations(PINION, relief[0], np.roll(turns[0], -1))
    there = half_plane_pair(elastic_pair(other_pair)).deviated((as_pinion, as_wheel))
    angles, twist = np.linspace(0, 3, 12), np.full(12, math.radians(0.05))
    one = solve_half_plane(here, angles, twist)
    turned = -angles / PAIR.gear_ratio - math.pi / 30 + twist
    # the wheel at this angle of the pinion that is nominal there, and the twist from it
    nominal = -turned / other_pair.gear_ratio + math.pi / 20 * 1
    behind = np.angle(np.exp(1j * 20 * (angles - nominal))) / 20
    other = solve_half_plane(there, turned, behind)
    assert other.torque_wheel == pytest.approx(one.torque_pinion, rel=1e-4)
    assert other.torque_pinion == pytest.approx(one.torque_wheel, rel=1e-4)


def test_relief_as_a_gap_against_elements_on_relieved_meshes(elastic) -> None:
    """Linear relief in the mesh, by Nitsche's law with flanks of 0.035 mm: 0.05 um of error, 0.2 % of stiffness."""
    amount, length, torque = 15e-6, 2.7e-3, 100.0
    relieved = gear_pair(tip_round=1e-4, tip_relief=TipRelief(amount, length))
    angles = (np.arange(6) + 0.37) * PAIR.mesh_cycle / 6
    reference = sweep_stiffness(relieved, torque=torque, angles=angles, law="nitsche", kinematics="small", coarsen=0.5)
    own = [FlankModification(tip_relief=Relief(amount, g.profile.tip_roll - length)) for g in (PINION, WHEEL)]
    deviations = tuple(tooth_deviations(g, m) for g, m in zip((PINION, WHEEL), own, strict=True))
    (made,) = loads(elastic, [torque], deviations, angles=angles).curves
    assert made.transmission_error == pytest.approx(reference.transmission_error, abs=0.05e-6)
    assert made.k_torsional == pytest.approx(reference.k_torsional, rel=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("at", [0.1, 0.6])
def test_relief_as_a_gap_against_whole_gears_with_relieved_meshes(elastic, at: float) -> None:
    """All unknowns at once, flanks of 0.07 mm, one or two tooth pairs: 0.05 um of error, 0.2 % of stiffness."""
    amount, length, torque, angle = 15e-6, 2.7e-3, 100.0, at * PAIR.mesh_cycle
    own = [FlankModification(tip_relief=Relief(amount, g.profile.tip_roll - length)) for g in (PINION, WHEEL)]
    deviations = tuple(tooth_deviations(g, m) for g, m in zip((PINION, WHEEL), own, strict=True))
    (made,) = loads(elastic, [torque], deviations, angles=[angle]).curves
    relieved = gear_pair(tip_round=1e-4, tip_relief=TipRelief(amount, length))
    bodies = [
        ElasticGear(sector_mesh(gear, recipe, cache=False), Material(), "strain", gear.face_width)
        for gear, recipe in zip((relieved.pinion, relieved.wheel), sector_recipes(relieved), strict=True)
    ]
    whole = WholePair(*bodies, relieved.working_centre_distance, relieved.pinion.face_width)
    found = solve_position(whole, Nitsche(), angle, PAIR.contact_twist + float(made.twist[0]))
    assert found.status == "converged"
    assert found.torque_wheel == pytest.approx(torque, rel=2e-3)
    missed = (found.torque_wheel - torque) / float(made.k_tangent[0] * WHEEL.base_radius)
    assert abs(missed) < 0.05e-6


def test_torques_are_carried(elastic) -> None:
    """The twists are those of the torque search of the stiffness curve, and the pairs' shares and forces add up."""
    angles = (np.arange(10) + 0.2) * PAIR.mesh_cycle / 10
    made = loads(elastic, [20.0, 150.0], angles=angles)
    for i, torque in enumerate((20.0, 150.0)):
        curve, own = sweep_stiffness(PAIR, torque=torque, angles=angles, kinematics="small"), made.pairs[i]
        assert made.curves[i].twist == pytest.approx(curve.twist, rel=2e-6)
        assert made.curves[i].torque_pinion == pytest.approx(curve.torque_pinion, rel=2e-5)
        assert made.curves[i].k_tangent == pytest.approx(curve.k_tangent, rel=1e-3)
        assert np.bincount(own.position, own.share) == pytest.approx(1.0)
        # force times base radius is the torque, on the path
        assert np.bincount(own.position, own.force * WHEEL.base_radius) == pytest.approx(np.full(10, torque), rel=5e-3)
        # on the path the roll lengths of both gears add up to the distance of the tangent points
        assert own.roll[own.edge == 0].sum(axis=1) == pytest.approx(PAIR.tangent_length, abs=0.1e-3)


def test_a_pair_that_never_bears_is_told(elastic) -> None:
    index = np.zeros(20)
    index[4] = -160e-6
    bad = ToothDeviations(turn=pitch_errors.turns(PINION, index)), NOMINAL[1]
    with pytest.raises(InputError, match="pinion tooth 4 on wheel tooth 5") as told:
        loads(elastic, [10.0], bad, positions=6, mesh_cycles=40)
    least = float(str(told.value).split("about ")[1].split(" ")[0])
    assert 40 < least < 200
    assert loads(elastic, [4 * least], bad, positions=6, mesh_cycles=40).statuses == {"converged": 240}


@pytest.mark.parametrize("flank", ["left", "right"])
def test_the_room_behind_the_teeth(flank) -> None:
    """Unloaded, the clearance of a whole set of rigid teeth is the backlash plus what both flanks lack where they
    touch; a tooth that stands bodily off its place leaves it as it is where it touches on both sides.
    """
    pair = gear_pair(tip_round=1e-4, tooth_thinning=40e-6)
    backlash, cosine = pair.normal_backlash, math.cos(pair.pinion.pressure_angle)
    assert backlash > 60e-6
    elastic = elastic_pair(pair, coarsen=3.0)

    def room(left: dict, right: dict, angles) -> tuple[np.ndarray, np.ndarray]:
        table = uneven(
            build(MicrogeometryTable, {"flank": flank, "pinion": {"left": left, "right": right}}, "microgeometry")
        )
        other = {"left": "right", "right": "left"}[flank]
        own, back = (deviations_of(table, pair, flank=side) for side in (flank, other))
        made = loads(elastic, [30.0], own, angles=angles, back=back)
        unloaded = backlash + made.transmission_error_unloaded + made.transmission_error_unloaded_back
        yields = made.curves[0].transmission_error - made.transmission_error_unloaded
        assert made.back_clearance[0] == pytest.approx(unloaded + yields)
        return unloaded, made.pinion_angle

    angles = (np.arange(6) + 0.3) * pair.mesh_cycle / 6
    assert room({}, {}, angles)[0] == pytest.approx(np.full(6, backlash), rel=1e-9)
    # the same index deviation of all teeth is a thicker tooth
    assert room({"pitch_um": [5.0] * 20}, {"pitch_um": [3.0] * 20}, angles)[0] == pytest.approx(
        np.full(6, backlash - 8e-6 * cosine), rel=1e-9
    )
    index = 4.0 * np.sin(2 * np.pi * np.arange(20) / 20)
    middle = 2 * np.pi * np.arange(0, 20, 3) / 20 * (1 if flank == "right" else -1)  # a tooth between the centres
    bodily = room({"pitch_um": index.tolist()}, {"pitch_um": (-index).tolist()}, middle)[0]
    assert np.abs(bodily - backlash).max() < 8e-6 * math.sin(2 * np.pi / 20) + 1e-9
    thick = room({"pitch_um": index.tolist()}, {"pitch_um": index.tolist()}, middle)[0]
    assert np.ptp(thick) > 10e-6


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("gear", "teeth"), [("pinion", 23), ("wheel", 41)])
def test_a_displaced_tooth_is_no_thicker(gear: str, teeth: int, sign: float) -> None:
    """One tooth off its place by p: where it touches on one side, the room behind shrinks by p cos(alpha), once.

    Out on the driving side, it leads there and its back flank is behind those of other pairs; into its place on the
    driving side, it does so on the back. A tooth thicker by p on both sides would take twice that.
    """
    form = {"module": 3e-3, "pressure_angle": 20.0, "width": 20e-3, "tooth_thinning": 100e-6, "tip_round": 1e-4}
    pair = gear_pair(23, 41, **form, pinion={"profile_shift": 0.2}, wheel={"profile_shift": -0.1})
    backlash = pair.normal_backlash
    assert backlash == pytest.approx(200e-6 * math.cos(math.radians(20.0)), rel=1e-3)
    deviations = [sign * 12.0] + [0.0] * (teeth - 1)
    elastic = elastic_pair(pair, coarsen=4.0)
    rooms = {}
    for name, table in {
        "tooth": {"pitch_um": deviations},
        "flanks": {"left": {"pitch_um": deviations}, "right": {"pitch_um": [-p for p in deviations]}},
        "thick": {side: {"pitch_um": [12.0] + [0.0] * (teeth - 1)} for side in ("left", "right")},
    }.items():
        job = uneven(build(MicrogeometryTable, {gear: table}, "microgeometry"))
        own, back = (deviations_of(job, pair, flank=side) for side in ("left", "right"))
        angles = pair.mesh_cycle * np.arange(-20, 21) / 10.0
        rooms[name] = loads(elastic, [0.001], own, angles=angles, back=back).back_clearance[0]
    moved = 12e-6 * math.cos(math.radians(20.0))
    assert rooms["tooth"].min() == pytest.approx(backlash - moved, abs=2e-9)
    assert rooms["tooth"].max() == pytest.approx(backlash, abs=2e-9)
    assert rooms["flanks"] == pytest.approx(rooms["tooth"], abs=1e-12)
    assert rooms["thick"].min() == pytest.approx(backlash - 2 * moved, abs=2e-9)


def test_one_tooth_with_another_back_flank_bears_once_in_a_turn(elastic) -> None:
    """Driving flanks that are alike repeat after one mesh cycle, the room behind the teeth after the full period."""
    table = uneven(build(MicrogeometryTable, {"pinion": {"right": {"pitch_um": [12.0] + [0.0] * 19}}}, "microgeometry"))
    own, back = (deviations_of(table, PAIR, flank=side) for side in ("left", "right"))
    angles = PAIR.mesh_cycle * np.arange(-8.0, 33.0) / 4.0
    made = loads(elastic, [0.001], own, angles=angles, back=back)
    behind = made.transmission_error_unloaded_back
    late = np.abs(behind + 12e-6 * math.cos(PAIR.pinion.pressure_angle)) < 1e-9
    assert late.any()
    turns = np.abs(angles[late]) * PAIR.pinion.teeth / (2 * math.pi)  # of the tooth from the line of centres (pitches)
    assert turns.max() < 1.2
    assert np.abs(behind[~late]).max() < 12e-6
    assert np.abs(behind[angles > 2 * PAIR.mesh_cycle]).max() < 1e-9
    assert made.back_clearance[0] == pytest.approx(PAIR.normal_backlash + behind, abs=2e-7)
    whole = loads(elastic, [0.001], own, positions=2, back=back)
    assert whole.mesh_cycles == 60


def test_python_gets_the_back_flanks_of_displaced_teeth() -> None:
    """Turns of the back flanks, in the order of the pair seen from behind, are those of a job file."""
    pair = gear_pair()
    lists = {"pinion": np.sin(np.arange(20.0)), "wheel": np.cos(np.arange(30.0))}
    keys = {name: {"pitch_um": values.tolist()} for name, values in lists.items()}
    table = uneven(build(MicrogeometryTable, keys, "microgeometry"))
    own, back = (deviations_of(table, pair, flank=side) for side in ("left", "right"))
    for number in (0, 1):
        assert pitch_errors.back_turns(own[number].turn, wheel=number == 1) == pytest.approx(back[number].turn)
        assert pitch_errors.seen_from_behind(
            pitch_errors.seen_from_behind(own[number].turn, wheel=number == 1), wheel=number == 1
        ) == pytest.approx(own[number].turn)


def test_run_out_is_a_gear_off_its_axis() -> None:
    """Both flanks of all teeth moved by one vector: where they then cross the reference circle, from the involutes."""
    gear = gear_pair(23, 41, pinion={"profile_shift": 0.3, "tooth_thinning": 50e-6}).pinion
    off, direction = 5e-6, math.radians(40.0)
    alpha, tau, radius = gear.pressure_angle, gear.half_thickness_angle, gear.reference_radius
    tooth = 2 * math.pi * np.arange(23) / 23
    phase = math.pi - direction + tau - alpha
    made = pitch_errors.run_out(gear, off / math.cos(alpha), phase)
    roll = math.tan(alpha) + np.array([-0.02, 0.0, 0.02])  # about the reference circle
    for side, found in zip((1.0, -1.0), made, strict=True):
        start = tooth[:, None] + side * (tau + math.tan(alpha) - alpha)
        normal = np.exp(1j * (start - side * roll))  # from the base circle's centre to where its tangent leaves it
        flank = gear.base_radius * normal * (1 + 1j * side * roll) + off * np.exp(1j * direction)
        crossing = [np.interp(radius, abs(points), np.unwrap(np.angle(points))) for points in flank]
        plain = [
            np.interp(radius, abs(points), np.unwrap(np.angle(points)))
            for points in flank - off * np.exp(1j * direction)
        ]
        moved = side * radius * (np.array(crossing) - np.array(plain))
        assert found == pytest.approx(moved, abs=0.02 * off)
    job = uneven(build(MicrogeometryTable, {"pinion": {"run_out_um": 8.0, "run_out_phase_deg": 25.0}}, "microgeometry"))
    pair = gear_pair()
    turns = [1e-6 * np.array(errors) for errors in pitch_errors_of(job.driver, pair.pinion)]
    cosine = math.cos(pair.pinion.pressure_angle)
    expected = pitch_errors.run_out(pair.pinion, 8.0, math.radians(25.0))
    assert 1e12 * turns[0] == pytest.approx(cosine * expected[0])
    assert 1e12 * turns[1] == pytest.approx(cosine * expected[1])


def test_pitch_deviations_by_single_ones_and_by_class() -> None:
    """Single pitches that add up, and a drawn class, displace teeth, too; a list of one side is of its flanks."""
    gear = gear_pair().pinion
    single = np.sin(np.arange(20.0))
    single -= single.mean()
    keys = [{"single_pitch_um": single.tolist()}, {"pitch_class": 6}]
    for given in keys:
        table = uneven(build(MicrogeometryTable, {"pinion": given}, "microgeometry"))
        left, right = pitch_errors_of(table.driver, gear)
        assert np.ptp(left) > 1e-6
        assert left == pytest.approx([-e for e in right])
    table = uneven(
        build(MicrogeometryTable, {"pinion": keys[0] | {"right": {"pitch_um": [3.0] * 20}}}, "microgeometry")
    )
    left, right = pitch_errors_of(table.driver, gear)
    cosine = math.cos(gear.pressure_angle)
    assert np.diff(left) == pytest.approx(1e-6 * cosine * single[1:])
    assert right == pytest.approx([3e-6 * cosine] * 20)


def test_gears_that_jam_have_no_numbers() -> None:
    """Teeth thicker than the space by 11 um: until the driving flanks yield by that, the back flanks would bear."""
    pair = gear_pair(tip_round=1e-4, tooth_thinning=5e-6)
    cosine = math.cos(pair.pinion.pressure_angle)
    thick = 1e-6 * 10.0 * cosine
    elastic = elastic_pair(pair, coarsen=3.0)
    sides = {side: {"pitch_um": [10.0] * 20} for side in ("left", "right")}
    table = uneven(build(MicrogeometryTable, {"pinion": sides}, "microgeometry"))
    own, back = (deviations_of(table, pair, flank=side) for side in ("left", "right"))
    angles = (np.arange(5) + 0.3) * pair.mesh_cycle / 5
    free = loads(elastic, [5.0, 250.0], own, angles=angles)
    yields = free.quantity("transmission_error") - free.transmission_error_unloaded
    room = pair.normal_backlash - 2 * thick + yields
    assert (room[0] < 0).all()
    assert (room[1] > 0).all()
    made = loads(elastic, [5.0, 250.0], own, angles=angles, back=back)
    assert made.statuses == {BACK: 5, "converged": 5}
    assert np.isnan(made.curves[0].twist).all()
    assert made.back_clearance == pytest.approx(room)
    assert (made.curves[1].twist == free.curves[1].twist).all()
    assert len(made.pairs[0].force) == 0
    assert len(made.pairs[1].force) == len(free.pairs[1].force)
