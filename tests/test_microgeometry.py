"""Rigid and loaded pairs with deviations against closed forms, elements on relieved meshes, and each other."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gearfe import InputError
from gearfe.config import build
from gearfe.contact.half_plane import half_plane_pair, solve_half_plane
from gearfe.elasticity import Material
from gearfe.gear import pitch_errors
from gearfe.gear.deviation import NOMINAL, ToothDeviations
from gearfe.gear.deviation_job import deviations_of
from gearfe.gear.modifications import FlankModification, Relief, Waviness, tooth_deviations
from gearfe.gear.pair import GearPair, TipRelief
from gearfe.meshing.tooth_sector import sector_mesh, sector_recipes
from gearfe.microgeometry.loaded_mesh import BACK, full_period
from gearfe.microgeometry.solve import load_mesh
from gearfe.stiffness.sweep import elastic_pair, sweep_stiffness
from gearfe.tables.microgeometry import MicrogeometryTable

from .gears import pair as gear_pair
from .verification.laws import Nitsche
from .verification.monolithic import solve_monolithic
from .verification.whole_pair import ElasticGear, WholePair

PAIR = gear_pair(tip_round=1e-4)
PINION, WHEEL = PAIR.pinion, PAIR.wheel


@pytest.fixture(scope="module")
def law():
    return half_plane_pair(elastic_pair(PAIR))


def test_a_pitch_error_sine_is_the_unloaded_error(law) -> None:
    """On the path the wheel leads by F_j cos(alpha) of the tooth that touches: to 1e-12 m."""
    index = pitch_errors.sine(20, 20e-6, 0.3)
    bad = law.deviated((ToothDeviations(turn=pitch_errors.turns(PINION, index)), NOMINAL[1]))
    assert full_period(PAIR) == 60
    angles = np.arange(60 * 8) * PAIR.mesh_cycle / 8
    found = bad.teeth.touching(angles)
    first = np.full(len(angles), np.inf)
    np.minimum.at(first, found.position, found.twist)
    leads = found.take(np.flatnonzero(found.twist == first[found.position]))
    on = ((leads.place > 0.02) & (leads.place < 0.98)).all(axis=1)
    assert on.mean() > 0.7
    error = (leads.twist - PAIR.contact_twist)[on] * WHEEL.base_radius
    assert error == pytest.approx(-index[leads.pair[on] % 20] * math.cos(PINION.pressure_angle), abs=1e-12)


def test_a_pitch_error_sine_under_load_stays_within_that_of_its_pairs(law) -> None:
    """Turning every tooth that bears by the largest or the least of their turns brackets the loaded error."""
    index = pitch_errors.sine(20, 20e-6, 0.3)
    bad = law.deviated((ToothDeviations(turn=pitch_errors.turns(PINION, index)), NOMINAL[1]))
    angles = np.arange(60) * PAIR.mesh_cycle / 3
    plain, made = (load_mesh(one, [100.0], angles=angles) for one in (law, bad))
    assert made.statuses == {"converged": 60}
    change = (made.transmission_error - plain.transmission_error)[0]
    moved = -index * math.cos(PINION.pressure_angle)
    for i in range(60):
        pairs = {int(k) for one in (plain, made) for k in one.pairs.pair[one.pairs.angle == i]}
        of_pairs = [moved[k % 20] for k in pairs]
        assert min(of_pairs) - 2e-8 <= change[i] <= max(of_pairs) + 2e-8
    assert np.ptp(change) > 1.5 * 20e-6 * math.cos(PINION.pressure_angle)


def test_eleven_waves_round_the_pinion_are_order_eleven(law) -> None:
    """At light load the amplitude of the wave along the normal, within 1 %; nothing else beside mesh orders."""
    wave = tooth_deviations(PINION, FlankModification(waviness=(Waviness(1e-6, 11, 0.4),)))
    made = load_mesh(law.deviated((wave, NOMINAL[1])), [2.0], positions=8)
    order, amplitude = made.spectrum()
    _, unloaded = made.spectrum(unloaded=True)
    at = int(np.searchsorted(order, 11))
    assert order[at] == pytest.approx(11)
    assert amplitude[0, at] == pytest.approx(1e-6, rel=0.01)
    assert unloaded[at] == pytest.approx(1e-6, rel=0.01)
    others = np.isclose(order % 20, 0) | (np.abs(order - 11) < 1e-9)
    assert amplitude[0][~others].max() < 0.02e-6


def test_gears_exchanged(law) -> None:
    """Seen from the wheel: its torque is the pinion's and the contact forces are the same."""
    rng = np.random.default_rng(7)
    index = [2e-6 * rng.standard_normal(z) for z in (20, 30)]
    relief = [
        FlankModification(tip_relief=Relief(8e-6, g.profile.tip_roll - 2e-3, "parabolic")) for g in (PINION, WHEEL)
    ]
    turns = [pitch_errors.turns(g, i) for g, i in zip((PINION, WHEEL), index, strict=True)]
    here = law.deviated(
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


def test_relief_as_a_gap_against_elements_on_relieved_meshes(law) -> None:
    """Linear relief in the mesh, by Nitsche's law with flanks of 0.035 mm: 0.05 um of error, 0.2 % of stiffness."""
    amount, length, torque = 15e-6, 2.7e-3, 100.0
    relieved = gear_pair(tip_round=1e-4, tip_relief=TipRelief(amount, length))
    angles = (np.arange(6) + 0.37) * PAIR.mesh_cycle / 6
    reference = sweep_stiffness(relieved, torque=torque, angles=angles, law="nitsche", kinematics="small", coarsen=0.5)
    own = [FlankModification(tip_relief=Relief(amount, g.profile.tip_roll - length)) for g in (PINION, WHEEL)]
    made = load_mesh(
        law.deviated(tuple(tooth_deviations(g, m) for g, m in zip((PINION, WHEEL), own, strict=True))),
        [torque],
        angles=angles,
    )
    assert made.transmission_error[0] == pytest.approx(reference.transmission_error, abs=0.05e-6)
    assert torque / made.twist[0] == pytest.approx(reference.k_torsional, rel=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("at", [0.1, 0.6])
def test_relief_as_a_gap_against_whole_gears_with_relieved_meshes(law, at: float) -> None:
    """All unknowns at once, flanks of 0.07 mm, one or two tooth pairs: 0.05 um of error, 0.2 % of stiffness."""
    amount, length, torque, angle = 15e-6, 2.7e-3, 100.0, at * PAIR.mesh_cycle
    own = [FlankModification(tip_relief=Relief(amount, g.profile.tip_roll - length)) for g in (PINION, WHEEL)]
    deviated = law.deviated(tuple(tooth_deviations(g, m) for g, m in zip((PINION, WHEEL), own, strict=True)))
    made = load_mesh(deviated, [torque], angles=[angle])
    relieved = gear_pair(tip_round=1e-4, tip_relief=TipRelief(amount, length))
    bodies = [
        ElasticGear(sector_mesh(gear, recipe, cache=False), Material(), "strain", gear.face_width)
        for gear, recipe in zip((relieved.pinion, relieved.wheel), sector_recipes(relieved), strict=True)
    ]
    whole = WholePair(*bodies, relieved.working_centre_distance, relieved.pinion.face_width)
    found = solve_monolithic(whole, Nitsche(), angle, PAIR.contact_twist + float(made.twist[0, 0]))
    assert found.status == "converged"
    assert found.torque_wheel == pytest.approx(torque, rel=2e-3)
    missed = (found.torque_wheel - torque) / float(made.tangent[0, 0]) * WHEEL.base_radius
    assert abs(missed) < 0.05e-6


def test_torques_are_carried(law) -> None:
    """The twists are those of the torque search of the stiffness curve, and the pairs' shares and forces add up."""
    angles = (np.arange(10) + 0.2) * PAIR.mesh_cycle / 10
    made = load_mesh(law, [20.0, 150.0], angles=angles)
    for i, torque in enumerate((20.0, 150.0)):
        curve = sweep_stiffness(PAIR, torque=torque, angles=angles, kinematics="small")
        assert made.twist[i] == pytest.approx(curve.twist, rel=2e-6)
        assert made.torque_pinion[i] == pytest.approx(curve.torque_pinion, rel=2e-5)
        assert made.tangent[i] / WHEEL.base_radius**2 == pytest.approx(curve.k_tangent, rel=1e-3)
    leading, shares = made.load_share()
    assert shares.sum(axis=2) == pytest.approx(1.0)
    assert leading.shape == (10,)
    # force times base radius is the torque, on the path
    total = np.zeros((2, 10))
    np.add.at(total, (made.pairs.torque, made.pairs.angle), made.pairs.force * WHEEL.base_radius)
    assert total == pytest.approx(np.repeat([[20.0], [150.0]], 10, axis=1), rel=5e-3)


def test_a_pair_that_never_bears_is_told(law) -> None:
    index = np.zeros(20)
    index[4] = -160e-6
    bad = law.deviated((ToothDeviations(turn=pitch_errors.turns(PINION, index)), NOMINAL[1]))
    with pytest.raises(InputError, match="pinion tooth 4 on wheel tooth 5") as told:
        load_mesh(bad, [10.0], positions=6, mesh_cycles=40)
    least = float(str(told.value).split("about ")[1].split(" ")[0])
    assert 40 < least < 200
    assert load_mesh(bad, [4 * least], positions=6, mesh_cycles=40).statuses == {"converged": 240}


@pytest.mark.parametrize("torques", [[], [0.0], [-1.0], [math.nan], [50.0, 1e6]])
def test_torques_out_of_range(law, torques) -> None:
    with pytest.raises(InputError, match="torques"):
        load_mesh(law, torques)


@pytest.mark.parametrize("flank", ["left", "right"])
def test_the_room_behind_the_teeth(flank) -> None:
    """Unloaded, the clearance of a whole set of rigid teeth is the backlash plus what both flanks lack where they
    touch; a tooth that stands bodily off its place leaves it as it is where it touches on both sides.
    """
    pair = gear_pair(tip_round=1e-4, tooth_thinning=40e-6)
    backlash, cosine = pair.normal_backlash, math.cos(pair.pinion.pressure_angle)
    assert backlash > 60e-6
    law = half_plane_pair(elastic_pair(pair, coarsen=3.0))

    def room(left: dict, right: dict, angles) -> tuple[np.ndarray, np.ndarray]:
        table = build(MicrogeometryTable, {"flank": flank, "pinion": {"left": left, "right": right}}, "microgeometry")
        other = {"left": "right", "right": "left"}[flank]
        own, back = (deviations_of(table, pair, flank=side) for side in (flank, other))
        made = load_mesh(law.deviated(own), [30.0], angles=angles, back=back)
        unloaded = backlash + pair.wheel.base_radius * (made.twist_unloaded + made.twist_unloaded_back)
        yields = made.transmission_error[0] - made.transmission_error_unloaded
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


def test_gears_that_jam_have_no_numbers() -> None:
    """Teeth thicker than the space by 11 um: until the driving flanks yield by that, the back flanks would bear."""
    pair = gear_pair(tip_round=1e-4, tooth_thinning=5e-6)
    cosine = math.cos(pair.pinion.pressure_angle)
    thick = 1e-6 * 10.0 * cosine
    law = half_plane_pair(elastic_pair(pair, coarsen=3.0))
    table = build(MicrogeometryTable, {"pinion": {"pitch_um": [10.0] * 20}}, "microgeometry")
    own, back = (deviations_of(table, pair, flank=side) for side in ("left", "right"))
    angles = (np.arange(5) + 0.3) * pair.mesh_cycle / 5
    free = load_mesh(law.deviated(own), [5.0, 250.0], angles=angles)
    yields = free.transmission_error - free.transmission_error_unloaded
    room = pair.normal_backlash - 2 * thick + yields
    assert (room[0] < 0).all()
    assert (room[1] > 0).all()
    made = load_mesh(law.deviated(own), [5.0, 250.0], angles=angles, back=back)
    assert made.statuses == {BACK: 5, "converged": 5}
    assert np.isnan(made.twist[0]).all()
    assert made.back_clearance == pytest.approx(room)
    assert (made.twist[1] == free.twist[1]).all()
    assert set(made.pairs.torque) == {1}
    assert len(made.pairs.force) == (free.pairs.torque == 1).sum()
