"""Gears with face widths: plane limit, identities, 3D contact of another program, helical pairs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.base.typing import Array
from gearfe.gears.contact.half_plane_pair import half_plane_pair
from gearfe.gears.gearmesh.sweep import elastic_pair, sweep_stiffness
from gearfe.gears.gearmesh.topography import MeasuredTopography
from gearfe.gears.gearmesh.width_job import FlankTopography
from gearfe.gears.geometry.face import NOMINAL, ToothDeviations
from gearfe.gears.geometry.pair import GearPair
from gearfe.gears.width import (
    EndRelief,
    LeadModification,
    Misalignment,
    WideFlanks,
    WideMesh,
    contact_lines,
    sweep_width,
    wide_compliance,
)
from gearfe.gears.width.lines import (
    AT_END,
    _softer_ends,
    look_at,
    own_twists,
    rows_at,
    solve_position,
    solve_positions,
)
from tests.makers.half_plane_pairs import KINKED, PAIRS
from tests.makers.wide_gears import SPUR, helical_lines, helical_mesh, spur_lines

CROWNED = WideFlanks(leads=(LeadModification(crowning=10e-6), LeadModification()))
TILTED = WideFlanks(misalignment=Misalignment.over_width(20e-6, 10e-3))
#: Linear end reliefs of both gears, parabolic ones with a tilt, reliefs of two corners, a measured grid with a ridge.
RELIEVED = WideFlanks(
    leads=(
        LeadModification(relief_low=EndRelief(20e-6, 3e-3), relief_high=EndRelief(20e-6, 3e-3)),
        LeadModification(relief_low=EndRelief(10e-6, 2e-3), relief_high=EndRelief(10e-6, 2e-3)),
    )
)
PARABOLIC = WideFlanks(
    leads=(LeadModification(relief_high=EndRelief(20e-6, 5e-3, 2.0)), LeadModification()),
    misalignment=Misalignment.over_width(20e-6, 20e-3),
)
CORNERS = WideFlanks(
    topographies=(
        FlankTopography((2e-3, 14e-3), (-10e-3, 10e-3), 0.0, ((30e-6, 8e-3, 8e-3, True, True),)),
        FlankTopography((10e-3, 23e-3), (-10e-3, 10e-3), 5e-6, ((20e-6, 6e-3, 6e-3, False, False),)),
    )
)
RIDGE = WideFlanks(
    topographies=(
        MeasuredTopography(
            np.array([3e-3, 11e-3]), np.array([-8e-3, 1e-3, 9e-3]), 1e-6 * np.array([[[0, 14, 2], [-2, 14, 0]]]),
            np.zeros(23, dtype=np.int64),
        ),
        None,
    )
)  # fmt: skip
EVERY = {
    "plain": WideFlanks(), "crowned": CROWNED, "tilted": TILTED, "relieved": RELIEVED, "parabolic": PARABOLIC,
    "corners": CORNERS, "ridge": RIDGE,
}  # fmt: skip


def test_influence_of_one_function_is_that_of_plane_strain():
    compliance = wide_compliance(WideMesh(SPUR, functions=1, coarsen=1.0, flank_coarsen=4.0))
    plane = half_plane_pair(elastic_pair(SPUR)).sides
    for side, known in zip(compliance.sides, plane, strict=True):
        size = 2 * len(known.stations)
        for step in (1, 2):
            expected = SPUR.pinion.face_width * known.far_field[step]
            assert np.abs(side.influence[step].reshape(size, size) - expected).max() < 1e-10 * np.abs(expected).max()
        expected = known.far_field[0]
        assert np.abs(side.local.far_field[0] - expected).max() < 1e-10 * np.abs(expected).max()


def off_plane_law(pair: GearPair, torque: float) -> tuple[Array, Array]:
    """Relative difference of the twist with one function from that of the plane law, and loaded pairs, 24 angles."""
    lines = contact_lines(wide_compliance(WideMesh(pair, functions=1, coarsen=1.0, flank_coarsen=4.0)))
    angles = (np.arange(24) + 0.5) * pair.mesh_cycle / 24
    plane = sweep_stiffness(pair, torque=torque, angles=angles, kinematics="small")
    found = sweep_width(lines, [torque], angles=angles)
    at, pairs = found.points.position, found.points.pair
    loaded = np.array([len(np.unique(pairs[at == number])) for number in range(24)])
    return np.abs(found.twist[0] / plane.twist - 1), loaded


@pytest.mark.parametrize("name", [*PAIRS, "kinked"])
def test_one_function_carries_the_torque_of_the_plane_law(name):
    """Within 0.02 %, also where tips or kinks carry load; 0.03 % at single positions."""
    off, _ = off_plane_law((PAIRS | KINKED)[name], 100.0)
    assert off.max() < 3e-4
    assert np.quantile(off, 0.95) < 2e-4


@pytest.mark.parametrize("name", ["rounded", "sharp"])
def test_a_pair_alone_has_the_twist_of_the_plane_law_under_heavy_load(name):
    """The tables come from the plane law of one pair: only their interpolation is left, 1e-4."""
    off, loaded = off_plane_law(PAIRS[name], 400.0)
    alone = loaded == 1
    assert alone.any()
    assert off[alone].max() < 1e-4


def test_an_edge_that_takes_over_the_contact_is_a_mark_of_the_tables():
    """The arm jumps where the undercut's edge takes over from the wheel's tip; tables without a mark err by 0.14 %."""
    pair = KINKED["undercut"]
    law = contact_lines(wide_compliance(WideMesh(pair, functions=1, coarsen=1.0, flank_coarsen=4.0))).law
    jump = int(np.argmax(np.abs(np.diff(law.arm))))
    assert abs(law.arm[jump + 1] - law.arm[jump]) > 0.05 * pair.wheel.base_radius
    assert law.angle[jump + 1] - law.angle[jump] < 1e-5 * pair.mesh_cycle
    assert np.abs(law.marks - law.angle[jump]).min() < 1e-5 * pair.mesh_cycle
    off, _ = off_plane_law(pair, 100.0)
    assert off.max() < 4e-4


def test_loads_beyond_usual_ones_are_within_the_tables():
    """1,850 N/mm on a module of 1.5 mm, with a loaded edge of an undercut: neighbours err by 0.03 % per 100 N m."""
    off, _ = off_plane_law(KINKED["undercut"], 400.0)
    assert off.max() < 2e-3


def test_influence_is_symmetric_and_positive():
    for side in helical_lines().compliance.sides:
        size = math.prod(side.influence.shape[1:4])
        own = side.influence[0].reshape(size, size)
        assert np.abs(own - own.T).max() < 1e-10 * np.abs(own).max()


def test_parity_splits_spur_gears_into_the_same_influence():
    mesh = WideMesh(SPUR, functions=4, coarsen=3.0)
    split = wide_compliance(mesh)
    whole = wide_compliance(replace(mesh, base_helix_angle=1e-12))
    for one, other in zip(split.sides, whole.sides, strict=True):
        assert np.abs(one.influence - other.influence).max() < 1e-8 * np.abs(other.influence).max()


@pytest.mark.parametrize("flanks", [WideFlanks(), TILTED, CROWNED], ids=["plain", "tilted", "crowned"])
def test_more_functions_hardly_change_spur_gears(flanks):
    """Even load: 0.02 % of the transmission error; uneven: 0.1 %."""
    twists = [solve_position(spur_lines(functions=n).with_flanks(flanks), 0.02, torque=100.0).twist for n in (7, 9)]
    assert abs(twists[0] / twists[1] - 1) < (2e-4 if flanks == WideFlanks() else 1e-3)


#: Prototype's page "The face width", section 3: CalculiX 2.20, surface to surface, one sector of each gear with the
#: cuts held, pitch point, flank elements 0.045 mm: ends of the layers from the middle, or from the loaded end (mm), and
#: their loads (N/mm); torque at the twist (rad) that was given. The page does not print the twists: they are those that
#: the prototype, on coarse sections, finds at 100 N m.
CALCULIX = {
    "plain": (WideFlanks(), 3.6928e-4, [0, 1.35, 2.65, 3.65, 4.35, 4.75, 5],
              [296.8, 293.1, 299.0, 298.5, 290.5, 261.7], 100.04),
    "crowned": (CROWNED, 4.6320e-4, [0, 1.35, 2.65, 3.65, 4.35, 4.75, 5],
                [432.9, 370.2, 269.8, 156.5, 67.7, 12.0], 100.31),
    "tilted": (TILTED, 6.5853e-4 - 10e-6 / SPUR.wheel.base_radius, [5, 4.6, 3.7, 2, 0, -2, -3.7, -4.6, -5],
               [579.7, 559.4, 465.1, 351.1, 230.1, 120.0, 50.8, 13.5], 100.10),
}  # fmt: skip


@pytest.mark.parametrize("case", CALCULIX)
def test_load_over_the_width_is_that_of_a_3d_contact_of_calculix(case):
    flanks, twist, ends, expected, torque = CALCULIX[case]
    lines = spur_lines(whole=False, density=4.5).with_flanks(flanks)
    solution = solve_position(lines, SPUR.path["C"].pinion_angle, twist=twist)
    assert solution.converged
    assert solution.torque == pytest.approx(torque, rel=5e-3)
    points = solution.points
    load = 1e-3 * solution.moment / (points.weight * points.rows.arm)
    for low, high, known in zip(ends[:-1], ends[1:], expected, strict=True):
        at = 1e-3 * np.linspace(low, high, 400)
        mean = np.interp(at, points.z, load).mean()
        loaded_end = case == "tilted" and max(low, high) > 4.8
        assert abs(mean - known) < (0.04 if loaded_end else 0.02) * max(expected)


def test_free_ends_yield_more_under_narrow_pressures():
    """Law of the corner at the very end, A nu2/(1 - nu2) ln(a/b) of both half-planes; nothing in the middle."""
    lines = spur_lines()
    middle, end = 0.0, lines.compliance.mesh.faces[0][1]
    rows = rows_at(lines.law, np.full(2, SPUR.path["C"].pinion_angle))
    added = _softer_ends(lines, np.array([middle, end]), rows)
    assert np.abs(added[0]).max() < 0.01 * added[1].max()
    soft = sum(side.local.inverse_modulus for side in lines.compliance.sides)
    bump = lines.compliance.sides[0].usual_bump
    grows = AT_END[0.3][0] * 0.3**2 / (1 - 0.3**2)
    narrow = lines.law.forces < 1e5  # contacts narrower than bumps
    radius = rows.roll[1].prod() / rows.roll[1].sum()
    half = np.sqrt(4 / math.pi * soft * radius * lines.law.forces[narrow])
    expected = 2 / math.pi * soft * grows * np.log(bump / half)
    assert added[1][narrow] == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("flanks", EVERY.values(), ids=EVERY)
def test_points_doubled_hardly_change_the_transmission_error(flanks):
    """Peak to peak within 0.3 %: lines are divided at kinks of the gap, and where their load ends."""
    lines = helical_lines().with_flanks(flanks)
    found = [sweep_width(replace(lines, density=share * lines.density), [100.0]) for share in (1.0, 2.0)]
    error, doubled = (sweep.transmission_error[0] for sweep in found)
    assert np.ptp(error) == pytest.approx(np.ptp(doubled), rel=3e-3)
    assert np.abs(error - doubled).max() < 1e-3 * np.ptp(doubled)


@pytest.mark.parametrize("flanks", EVERY.values(), ids=EVERY)
def test_a_position_among_others_is_that_alone(flanks):
    """Points of positions side by side are padded to one number: nothing of the others may enter."""
    lines = helical_lines().with_flanks(flanks)
    angles = lines.compliance.mesh.sections.mesh_cycle * np.linspace(-1.0, 1.0, 7)
    torques = 100.0 * 2.0 ** -np.arange(7)
    for name, loads in (("torque", torques), ("twist", np.linspace(0.0, 5e-4, 7))):
        together = solve_positions(lines, angles, **{name: loads})
        assert len({len(one.points) for one in together}) > 2
        for angle, load, one in zip(angles, loads, together, strict=True):
            alone = solve_position(lines, angle, **{name: load})
            assert one.converged
            assert alone.converged
            assert (one.steps, one.placings) == (alone.steps, alone.placings)
            assert one.twist == pytest.approx(alone.twist, rel=1e-12)
            assert one.moment == pytest.approx(alone.moment, rel=1e-9)
            assert one.tangent == pytest.approx(alone.tangent, rel=1e-9, abs=1e-9 * np.abs(alone.tangent).max())


def test_kinks_of_both_gears_may_be_at_one_place():
    """Linear end reliefs of both gears over one length are one of the sum on one gear."""

    def lead(amount: float) -> LeadModification:
        return LeadModification(relief_low=EndRelief(amount, 3e-3), relief_high=EndRelief(amount, 3e-3))

    twists = []
    for leads in ((lead(12e-6), lead(8e-6)), (lead(20e-6), LeadModification())):
        found = sweep_width(helical_lines().with_flanks(WideFlanks(leads=leads)), [100.0], positions=5)
        assert (found.status == "converged").all()
        twists.append(found.twist)
    assert twists[0] == pytest.approx(twists[1], rel=1e-9)


def test_pairs_with_an_unloaded_one_between_them_are_coupled():
    """The influence between the outer two of three pairs hardly depends on whether the middle one is loaded."""
    lines = helical_lines()

    def without_one(roll, z, tooth):
        return np.where(tooth == 1, -1e-3, 0.0) + 0.0 * (roll + z)

    blocks = []
    cycle = lines.compliance.mesh.sections.mesh_cycle
    for flanks in (WideFlanks(), WideFlanks(topographies=(without_one, None))):
        points = solve_position(lines.with_flanks(flanks), -1.1 * cycle, torque=200.0).points
        blocks.append(points.influence[np.ix_(points.pair == 2, points.pair == 0)])
        assert (points.pair == 1).any() == (flanks.topographies[0] is None)
    assert blocks[1].mean() == pytest.approx(blocks[0].mean(), rel=0.2)


@pytest.mark.parametrize("flanks", [RELIEVED, CORNERS, RIDGE], ids=["relieved", "corners", "ridge"])
def test_lines_are_divided_where_the_material_has_kinks(flanks):
    """Each slope of the material that jumps along a line does so at a kink: seen from differences 2 um apart."""
    lines, step = helical_lines().with_flanks(flanks), 2e-6
    mesh, angle = lines.compliance.mesh, 0.1
    looks, jumps = look_at(lines, angle), 0
    for k in np.unique(looks.pair).tolist():
        on_line = looks.pair == k
        z = np.arange(looks.z[on_line][0], looks.z[on_line][-1], step)
        roll = rows_at(lines.law, angle + mesh.turns[0] * z + k * mesh.sections.mesh_cycle).roll
        material = [flanks.material(g, roll[:, g], z, np.full(len(z), (k, -1 - k)[g]), mesh.faces[g]) for g in (0, 1)]
        slopes = np.diff(material, axis=1) / step
        at = z[1:-1][np.abs(np.diff(slopes, axis=1)).max(axis=0) > 1e-4]
        apart = np.abs(at[:, None] - looks.z[on_line & looks.kink])
        jumps += len(at)
        assert len(at) == 0 or apart.min(axis=1).max() < 2 * step
    assert jumps > 3


@pytest.mark.parametrize("flanks", [WideFlanks(), TILTED], ids=["plain", "tilted"])
def test_hand_mirrored_with_z_is_the_same(flanks):
    mirrored = replace(flanks, misalignment=Misalignment(-flanks.misalignment.in_plane))
    angles = np.array([0.0, 0.1])
    one = sweep_width(helical_lines().with_flanks(flanks), [100.0], angles=angles)
    other = sweep_width(helical_lines(-1.0).with_flanks(mirrored), [100.0], angles=angles)
    assert np.allclose(one.twist, other.twist, rtol=1e-9, atol=0)
    assert np.allclose(one.axial_force, -other.axial_force, rtol=1e-9, atol=0)


@pytest.mark.parametrize("flanks", [WideFlanks(), CROWNED, TILTED], ids=["plain", "crowned", "tilted"])
def test_exchanged_gears_are_the_same(flanks, monkeypatch):
    """Seen from behind the line of centres, in one position of both gears: the wheel is turned by the twist."""
    monkeypatch.setattr("gearfe.gears.width.lines.ENDS_PLACED", 1e-8)
    exchanged = WideFlanks(leads=flanks.leads[::-1], misalignment=flanks.misalignment)
    lines, other = helical_lines().with_flanks(flanks), helical_lines(swapped=True).with_flanks(exchanged)
    sections = lines.compliance.mesh.sections
    ratio, turned = sections.gear_ratio, math.pi / sections.wheel.teeth
    angles = np.array([0.02, 0.11, 0.2])
    twists = sweep_width(lines, [100.0], angles=angles).twist[0]
    for angle, twist in zip(angles, twists, strict=True):
        one = sweep_width(lines, twists=[twist], angles=[angle])
        two = sweep_width(other, twists=[twist * ratio], angles=[turned - angle / ratio + twist])
        assert -two.force[0, 0, :2] == pytest.approx(-one.force[0, 0, :2], rel=1e-7)
        for moment, mate in zip(two.moment[0, 0], one.moment[0, 0, ::-1], strict=True):
            assert moment[2] == pytest.approx(mate[2], rel=1e-7)
        # lines end where their load does, and points move with it: the force of each pair, and its lever along z
        for power in (0, 1):
            shares = []
            for p, way in ((one.points, 1), (two.points, -1)):
                each = p.line_load * p.weight * p.z**power
                shares.append([each[p.pair == k].sum() for k in sorted(set(p.pair.tolist()), key=lambda k: way * k)])
            assert shares[1] == pytest.approx(shares[0], abs=1e-6 * np.abs(shares[0]).sum())


def energy(lines, solution):
    """Elastic energy (J) of a position."""
    points, moment = solution.points, solution.moment
    x, w = np.polynomial.legendre.leggauss(24)
    x, w = 0.5 * (x + 1), 0.5 * w
    per_width = moment / points.weight
    complementary = sum(b * own_twists(lines.law, points.rows, a * per_width)[0] for a, b in zip(x, w, strict=True))
    own = own_twists(lines.law, points.rows, per_width)[0] - complementary
    return float(own @ moment + 0.5 * moment @ points.influence @ moment)


@pytest.mark.parametrize("angle", [0.0, 0.07, 0.19])
def test_torque_is_the_derivative_of_the_energy(angle):
    lines = replace(helical_lines().with_flanks(CROWNED), density=4.0)  # points are placed anew at each twist
    base = solve_position(lines, angle, torque=100.0)
    step = 0.01 * base.twist
    before, after = (solve_position(lines, angle, twist=base.twist + way * step) for way in (-1, 1))
    slope = (energy(lines, after) - energy(lines, before)) / (2 * step)
    assert slope == pytest.approx(100.0, rel=5e-4)
    assert base.tangent[0, 0] == pytest.approx((after.torque - before.torque) / (2 * step), rel=5e-3)


def test_tangent_of_the_tilts_is_the_derivative_of_the_torque():
    lines, angle = helical_lines(), 0.1
    base = solve_position(lines, angle, torque=100.0)
    step = 1e-6
    torques = [
        solve_position(
            lines.with_flanks(WideFlanks(misalignment=Misalignment(*(way * step * np.eye(2)[axis])))),
            angle, twist=base.twist,
        ).torque
        for axis in (0, 1) for way in (-1, 1)
    ]  # fmt: skip
    found = np.diff(np.reshape(torques, (2, 2)), axis=1)[:, 0] / (2 * step)
    assert found == pytest.approx(base.tangent[0, 1:], rel=0.02, abs=1e-3 * abs(base.tangent[0, 0]))
    assert np.allclose(base.tangent, base.tangent.T)


def test_moments_follow_from_the_energy_where_a_tip_carries_load():
    """Wheel: derivative with the twist, 1e-4 off without the turning of the force; both: that with the pinion angle."""
    lines, step, twist = spur_lines(functions=1), 1e-3, 2.5e-3
    angle = lines.law.path[1] + 0.05 * SPUR.mesh_cycle

    def stored(at: float, turned: float) -> float:
        return energy(lines, solve_position(lines, at, twist=turned))

    found = sweep_width(lines, twists=[twist], angles=[angle])
    pinion, wheel = found.moment[0, 0, :, 2]
    by_twist = (stored(angle, 1.01 * twist) - stored(angle, 0.99 * twist)) / (0.02 * twist)
    assert found.torque[0, 0] == pytest.approx(-wheel, rel=1e-6)
    assert found.torque[0, 0] == pytest.approx(by_twist, rel=5e-5)
    by_angle = (stored(angle + step, twist) - stored(angle - step, twist)) / (2 * step)
    assert wheel / SPUR.gear_ratio - pinion == pytest.approx(by_angle, rel=0.01)


def test_axial_force_follows_from_the_helix():
    """F_a = 2 T tan(beta)/d on the wheel; a right-handed driver that turns counter-clockwise is pushed back."""
    found = sweep_width(helical_lines(), [100.0], angles=[0.0])
    wheel = helical_mesh().sections.wheel
    expected = 100.0 * math.tan(math.radians(15.0)) / wheel.reference_radius
    assert abs(found.axial_force[0, 0]) == pytest.approx(expected, rel=1e-9)
    assert found.moment[0, 0, 1, 2] == pytest.approx(-100.0, rel=1e-6)


def test_narrow_gear_on_a_wide_mate_bears_on_the_common_width():
    mesh = WideMesh(SPUR, widths=(10e-3, 14e-3), centres=(0.0, 1e-3), functions=5, coarsen=3.0)
    assert mesh.zone == pytest.approx((-5e-3, 5e-3))
    wide = sweep_width(contact_lines(wide_compliance(mesh)), [100.0], angles=[0.0])
    equal = sweep_width(
        contact_lines(wide_compliance(replace(mesh, widths=(10e-3, 10e-3), centres=(0.0, 0.0)))), [100.0], angles=[0.0]
    )
    assert 10 / 14 < wide.twist[0, 0] / equal.twist[0, 0] < 1.0


def test_pitch_error_of_one_tooth_moves_its_line():
    error = 5e-6 / SPUR.pinion.base_radius
    turns = tuple(error if k == 0 else 0.0 for k in range(20))
    flanks = WideFlanks(profiles=(ToothDeviations(turn=turns), NOMINAL[1]))
    lines = spur_lines().with_flanks(flanks)
    middle = 0.5 * (SPUR.path["B"].pinion_angle + SPUR.path["D"].pinion_angle)
    found = sweep_width(lines, [100.0], angles=[middle, middle + SPUR.mesh_cycle])
    shift = (found.transmission_error[0, 1] - found.transmission_error[0, 0]) * 1e6
    assert shift == pytest.approx(5.0, abs=0.05)
    with pytest.raises(InputError, match="angles"):
        sweep_width(lines, [100.0])


@pytest.mark.parametrize("seed", range(6))
def test_random_flanks_converge_with_closed_gaps(seed):
    random = np.random.default_rng(4500 + seed)
    lead = LeadModification(
        crowning=random.uniform(-5e-6, 30e-6),
        relief_low=EndRelief(random.uniform(0, 30e-6), random.uniform(1e-3, 4e-3)),
        relief_high=EndRelief(random.uniform(0, 30e-6), random.uniform(1e-3, 4e-3), 2.0),
    )
    flanks = WideFlanks(leads=(lead, LeadModification()), misalignment=Misalignment.over_width(
        random.uniform(-60e-6, 60e-6), 20e-3))  # fmt: skip
    lines = helical_lines().with_flanks(flanks)
    torque, angle = 10 ** random.uniform(0, 2.7), random.uniform(0, 0.27)
    solution = solve_position(lines, angle, torque=torque)
    assert solution.converged
    assert solution.torque == pytest.approx(torque, rel=1e-8)
    points = solution.points
    own = own_twists(lines.law, points.rows, solution.moment / points.weight)[0]
    gap = (points.touch + own + points.influence @ solution.moment - solution.twist) * points.rows.arm
    assert np.abs(gap[solution.moment > 0]).max() < 1e-9
    assert gap.min() > -1e-9


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"base_helix_angle": 1.0}, "base_helix_angle"),
        ({"widths": (0.0, 1e-2)}, "widths"),
        ({"centres": (0.0, 1.0)}, "centres"),
        ({"functions": 0}, "functions"),
        ({"widths": (1.0, 1.0)}, "widths"),
    ],
)
def test_mistakes_in_a_mesh_are_reported(change, field):
    with pytest.raises(InputError) as error:
        WideMesh(SPUR, **change)
    assert error.value.field == field


def test_mistakes_in_loads_are_reported():
    lines = spur_lines()
    for arguments in (
        {},
        {"torques": [1.0], "twists": [1.0]},
        {"torques": [-1.0]},
        {"torques": [1.0], "angles": [math.nan]},
    ):
        with pytest.raises(InputError):
            sweep_width(lines, **arguments)


def test_gears_that_do_not_reach_each_other_have_no_contact():
    found = sweep_width(spur_lines(), twists=[-1e-3], angles=[0.0])
    assert found.status[0, 0] == "no_contact"


@pytest.mark.parametrize(
    "flanks", [WideFlanks(), WideFlanks(leads=(LeadModification(crowning=10e-6), LeadModification()))]
)
def test_one_loaded_pair_shares_nothing(flanks):
    """K_Halpha is 1 by its definition where a single pair of spur teeth bears; K_Hbeta is that of its points."""
    lines = spur_lines().with_flanks(flanks)
    pitch = lines.compliance.mesh.sections.mesh_cycle
    angles = np.linspace(0.0, pitch, 24, endpoint=False)
    sweep = sweep_width(lines, [60.0], angles=angles)
    alone = [i for i in range(24) if len(np.unique(sweep.points.pair[sweep.points.position == i])) == 1]
    assert alone
    one = sweep_width(lines, [60.0], angles=angles[alone[:1]])
    assert one.k_h_alpha[0] == pytest.approx(1.0, abs=0.01)
    load, weight = one.points.line_load, one.points.weight
    assert one.k_h_beta[0] == pytest.approx(load.max() * lines.compliance.mesh.width / (load @ weight), rel=0.02)


def test_tilts_open_gaps_as_displacements_of_the_wheel_do():
    """A wheel moved by u leaves the flanks u.n farther apart: levers against n = forward (e + i ...), q = i e."""
    lines = spur_lines()
    turn = lines.law.forward
    seen = np.exp(1j * np.array([-0.3, 0.0, 0.2]))  # normals beside that on the path
    rows = type("Rows", (), {"normal": seen * turn})()
    z = sum(lines.compliance.mesh.zone) / 2 + np.full(3, 2e-3)
    in_plane, across = lines.levers(z, rows).T
    moved = {"closing": -turn, "left": 1j * turn}  # displacement of the wheel per tilt and z
    assert in_plane == pytest.approx([-2e-3 * (np.conj(n) * moved["closing"]).real for n in seen * turn])
    assert across == pytest.approx([-2e-3 * (np.conj(n) * moved["left"]).real for n in seen * turn])
