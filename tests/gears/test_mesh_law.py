"""The mesh law against contact solutions that it was not made from, and against what a potential must satisfy."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gearfe import Gear, GearPair
from gearfe.base.cache import entries
from gearfe.base.errors import InputError
from gearfe.gears.contact.half_plane import half_plane_pair, solve_half_plane
from gearfe.gears.contact.laws import PairModel, law_named
from gearfe.gears.gearmesh.job import read_stiffness_job
from gearfe.gears.gearmesh.law import MeshLaw
from gearfe.gears.gearmesh.law_fit import touch_cubics
from gearfe.gears.gearmesh.law_make import _nodes as phase_nodes
from gearfe.gears.gearmesh.law_make import coupling_curve, mesh_law, touch_curve
from gearfe.gears.gearmesh.law_store import cached_law, load_law, save_law, write_law_csv
from gearfe.gears.gearmesh.sweep import elastic_pair
from gearfe.gears.geometry.pair import TipRelief
from tests.makers.gears import pair as gear_pair
from tests.makers.mesh_laws import DESIGN, PAIR, STEEL


@pytest.fixture(scope="module")
def solver():
    return half_plane_pair(elastic_pair(PAIR, materials=(STEEL, STEEL), law=law_named("half_plane"), coarsen=2.0))


@pytest.fixture(scope="module")
def law(solver) -> MeshLaw:
    return mesh_law(solver, 5 * DESIGN)


def places(law: MeshLaw, count: int, least: float = 0.3e-6):
    """Random pinion angles and approaches."""
    rng = np.random.default_rng(7)
    angle = rng.uniform(-1.0, 1.0, count)
    depth = np.exp(rng.uniform(math.log(least), math.log(0.95 * law.reach), count))
    return angle, law.first_contact(angle) + depth


def test_law_meets_contact_solutions_that_it_was_not_made_from(law, solver):
    """F within 0.3 % of the design force at most and 0.1 % in nine of ten cases, the tangent within 1 %, M within 0.2 %
    of the torque: both hubs' moments of the contact solution tell it, M = T_1 - T_2 z_1/z_2.
    """
    angle, approach = places(law, 60)
    radius = PAIR.wheel.base_radius
    solved = solve_half_plane(solver, angle, approach / radius + PAIR.contact_twist)
    found = law(angle, approach)
    force = solved.torque_wheel / radius
    usual = force < 2 * DESIGN
    off = np.abs(found.force - force)[usual] / DESIGN
    assert off.max() < 3e-3
    assert np.quantile(off, 0.9) < 1e-3
    heavy = approach - law.first_contact(angle) > 5e-6
    assert np.abs(found.tangent * radius**2 / solved.tangent - 1)[heavy].max() < 1e-2
    moment = solved.torque_pinion - solved.torque_wheel / PAIR.gear_ratio
    assert np.abs(found.moment - moment).max() < 2e-3 * solved.torque_pinion.max()
    assert np.corrcoef(found.moment, moment)[0, 1] > 0.999


def misses(law, solver, solved):
    """Of force and torque, in parts of them or of a tenth of the largest."""
    r1, r2 = law.base_radii
    found = law(solved.pinion_angle, r2 * (solved.twist - PAIR.contact_twist))
    force, moment = solved.torque_wheel / r2, solved.torque_pinion - solved.torque_wheel / PAIR.gear_ratio
    off = np.maximum(np.abs(found.force - force), np.abs(found.moment - moment) / r1)
    return off / np.maximum(force, 0.5 * DESIGN)


def test_error_tells_what_contact_solutions_tell_and_falls_with_the_tolerance(law, solver):
    """At 150 random places 99 % are within the error, which the tolerance bounds: so no number of cells decides."""
    angle, approach = places(law, 150, 1e-6)
    solved = solve_half_plane(solver, angle, approach / PAIR.wheel.base_radius + PAIR.contact_twist)
    worst = []
    for tolerance in (1e-2, 1e-3):
        one = law if tolerance == 1e-3 else mesh_law(solver, 5 * DESIGN, tolerance=tolerance)
        off = misses(one, solver, solved)
        assert 0.0 < one.error <= tolerance
        assert np.quantile(off, 0.99) <= one.error
        worst.append((len(one.nodes), off.max()))
    assert worst[0][0] < worst[1][0]
    assert worst[1][1] < 0.5 * worst[0][1]


def test_pairs_that_touch_together_at_a_single_place_are_coupled_there(solver):
    """The first reach at which pairs two teeth apart touch at once: C is what that place tells; none farther away."""
    cycle = PAIR.mesh_cycle
    phases = cycle * np.linspace(-2.0, 2.0, 33)
    low, high = 1e-6, 600e-6
    while high - low > 1e-9:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if len(coupling_curve(solver, phases, middle)) > 1 else (middle, high)
    two = coupling_curve(solver, phases, high)[1]
    assert len(two.angle) == 5
    there = np.linspace(two.angle[1], two.angle[-2], 50)
    assert two(there) == pytest.approx(two.compliance[2], rel=1e-12)
    assert two(there, 1) == pytest.approx(0.0, abs=1e-20)
    assert 0.0 < two.compliance[2] < coupling_curve(solver, phases, high)[0].compliance.max()
    beyond = two(np.array([two.angle[0] - 0.1, two.angle[-1] + 0.1]))
    assert beyond == pytest.approx(0.0, abs=1e-14 * two.compliance[2])


def test_pairs_that_touch_beyond_the_reach_yield_where_they_are_pressed():
    """Many teeth: at the ends of its tables a pair touches at several times the reach, and no contact solution tells
    what it yields there; a negative compliance would let it bear where it is far from touching.
    """
    form = {"module": 2.5e-3, "pressure_angle": math.radians(20), "face_width": 15e-3}
    pair = GearPair(Gear(29, bore_diameter=12e-3, **form), Gear(59, bore_diameter=12e-3, **form))
    law = mesh_law(half_plane_pair(elastic_pair(pair, law=law_named("half_plane"), coarsen=4.0)), 3000.0)
    assert law.touch[..., 0].max() > 3.0 * law.reach
    z = np.linspace(0.0, 1.0, 5)[:, None] * np.diff(law.nodes)
    for part, width in enumerate(np.diff(law.forces)):
        c = sum(law.energies[:, :, part, a, 2:] * z[:, None, :, None] ** a for a in range(4))
        for f in (0.0, 0.5 * width, width):
            assert (c @ [2.0, 6.0 * f, 12.0 * f**2] > 0.0).all()


def test_force_and_moment_are_the_derivatives_of_the_energy(law):
    angle, approach = places(law, 200)
    found = law(angle, approach)
    turned = (law(angle + 1e-7, approach).energy - law(angle - 1e-7, approach).energy) / 2e-7
    pressed = (law(angle, approach + 1e-10).energy - law(angle, approach - 1e-10).energy) / 2e-10
    stiffer = (law(angle, approach + 1e-10).force - law(angle, approach - 1e-10).force) / 2e-10
    assert turned == pytest.approx(found.moment, abs=1e-7)
    assert pressed == pytest.approx(found.force, rel=1e-6, abs=1e-3)
    assert stiffer == pytest.approx(found.tangent, rel=2e-3)


def test_touch_is_that_of_the_rigid_flanks(law, solver):
    angle = np.linspace(0.0, PAIR.mesh_cycle, 100)
    met = solver.teeth.first_contacts(angle)
    first = np.full(len(angle), np.inf)
    np.minimum.at(first, met.position, PAIR.wheel.base_radius * (met.twist - PAIR.contact_twist))
    assert law.first_contact(angle) == pytest.approx(first, abs=1e-11)


def test_nothing_bears_before_the_touch_and_no_pair_pulls(law):
    angle, approach = places(law, 300)
    apart = law(angle, law.first_contact(angle) - 1e-9)
    assert (apart.force == 0).all()
    assert (apart.moment == 0).all()
    assert (apart.tangent == 0).all()
    assert (law(angle, approach).pair_forces >= 0).all()


def test_a_whole_cycle_later_all_is_the_same(law):
    angle, approach = places(law, 50)
    here, later = law(angle, approach), law(angle + 3 * PAIR.mesh_cycle, approach)
    assert later.force == pytest.approx(here.force, rel=1e-9)
    assert later.moment == pytest.approx(here.moment, rel=1e-6, abs=1e-9)


def test_a_pair_that_stands_back_bears_later(law):
    """A pitch error shifts the touch of one pair; all by the same amount are a larger approach."""
    angle, approach = places(law, 50)
    back = law(angle, approach + 1e-6, np.full((50, law.slots), 1e-6))
    assert back.force == pytest.approx(law(angle, approach).force, rel=1e-8)


def test_approach_carries_the_force(law):
    angle = np.linspace(0.0, PAIR.mesh_cycle, 40)
    for force in (1.0, DESIGN, 4.5 * DESIGN):
        assert law(angle, law.approach(angle, force)).force == pytest.approx(np.full(40, force), rel=1e-9)
    with pytest.raises(InputError, match="larger torques"):
        law.approach(angle, 7 * DESIGN)


def test_a_law_is_made_once(monkeypatch, tmp_path):
    """The second time it comes from disk, the same to the last bit; larger forces are another law."""
    monkeypatch.setenv("GEARFE_CACHE", str(tmp_path))
    model = PairModel(materials=(STEEL, STEEL), coarsen=3.0)

    def laws():
        return {entry.path for entry in entries(tmp_path) if entry.kind == "mesh-law"}

    made = cached_law(PAIR, model, DESIGN)
    assert len(kept := laws()) == 1
    again = cached_law(PAIR, model, DESIGN)
    assert laws() == kept
    assert np.array_equal(again.energies, made.energies)
    assert made.largest_force >= DESIGN
    assert cached_law(PAIR, model, 1.2345 * DESIGN).largest_force > made.largest_force
    assert len(laws()) == 2


def test_files(law, tmp_path):
    save_law(replace(law, back=law.stiffer(0.1)), tmp_path / "law.npz")
    same = load_law(tmp_path / "law.npz")
    angle, approach = places(law, 20)
    assert (same(angle, approach).force == law(angle, approach).force).all()
    assert (same.sides[1](angle, approach).force == law.stiffer(0.1)(angle, approach).force).all()
    write_law_csv(law, tmp_path / "law.csv")
    rows = (tmp_path / "law.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) == 1 + law.slots * (len(law.nodes) - 1)
    assert rows[0].startswith("pair_angle_deg,touch_um,yield_um_at_")
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    with pytest.raises(InputError, match="holds no mesh law"):
        load_law(tmp_path / "other.npz")


def test_a_lightly_loaded_relieved_pair() -> None:
    """Reliefs of 6.4 um on both gears, loads that overlap flanks by 1 to 5 um: pairs that touch late against unmodified
    flanks, but not against each other, bear too; forces within 0.5 % of contact solutions."""
    form = {"module": 4e-3, "width": 39.934e-3, "tip_round": 0.16e-3, "tip_relief": TipRelief(6.4e-6, 3.2e-3, 1.0)}
    pair = half_plane_pair(elastic_pair(gear_pair(40, 32, bore=0.3, **form)))
    force = 5 * 25.19 / pair.pair.wheel.base_radius
    law = mesh_law(pair, force)
    assert law.reach < 6.4e-6
    angles = law.nodes[0] + law.cycle * np.linspace(0.0, 1.0, 301)
    depths = law.reach * np.array([1e-3, 0.03, 0.3, 1.0])
    for depth in depths:
        assert (law(angles, law.first_contact(angles) + depth).force > 0.0).all()
    some = angles[3::17]
    for depth in depths[1:]:
        twist = (law.first_contact(some) + depth) / pair.pair.wheel.base_radius + pair.pair.contact_twist
        true = solve_half_plane(pair, some, twist).torque_wheel / pair.pair.wheel.base_radius
        off = np.abs(law(some, law.first_contact(some) + depth).force - true)
        assert (off / np.maximum(true, 0.1 * force)).max() < 5e-3


#: A light load on a pair whose slopes (`profile_slope_um`) move the kinks of its reliefs off the nodes of the path of
#: contact.
LIGHT = """
[pair]
module_mm = 1.73
pressure_angle_deg = 22.59
face_width_mm = 30.0
addendum = 1.0
dedendum = 1.26
rack_tip_radius = 0.096
wheel = {teeth = 18, bore_diameter_mm = 15.76, profile_shift = -0.0114, tooth_thinning_um = 22.3}

[pair.pinion]
teeth = 76
bore_diameter_mm = 29.22
profile_shift = -0.381
tip_round_mm = 0.098
tip_relief_amount_um = 1.1
tip_relief_length_mm = 0.554
tip_relief_exponent = 2.0

[microgeometry]
torques_Nm = [0.000759]
pinion = {profile_slope_um = 0.186}
wheel = {profile_slope_um = -1.51, tip_relief_um = 5.32, tip_relief_length_mm = 1.19, tip_relief_shape = "arc"}
"""


def test_touch_is_followed_where_pairs_change_under_light_loads(tmp_path) -> None:
    """A light load is carried by a small part of a cell where pairs change: the cubics of t are those of the rigid
    flanks to 1e-3 of the reach wherever a pair can be loaded.
    """
    (tmp_path / "job.toml").write_text(LIGHT, encoding="utf-8")
    pair = half_plane_pair(read_stiffness_job(tmp_path / "job.toml").elastic())
    reach, cycle = 1e-7, pair.pair.mesh_cycle
    nodes, slots = phase_nodes(pair, reach)
    ends = np.append((nodes[:-1] + cycle * np.arange(slots)[:, None]).ravel(), nodes[-1] + (slots - 1) * cycle)
    cubics = touch_cubics(touch_curve(pair, ends))
    angles = np.linspace(nodes[0], nodes[-1], 3001)[:-1]
    phases = (angles + cycle * np.arange(slots)[:, None]).ravel()
    cell = np.searchsorted(ends, phases, side="right") - 1
    touch = np.sum(cubics[cell] * (phases - ends[cell])[:, None] ** np.arange(4), axis=1).reshape(slots, -1)
    true = touch_curve(pair, phases).value.reshape(slots, -1)
    late = np.minimum(touch, true) - true.min(axis=0)
    assert np.abs(touch - true)[late < reach].max() < 1e-3 * reach
