"""The sweep against theory: conventions, invariants, directions. Coarse meshes where the discretisation cancels."""

import math

import numpy as np
import pytest

from gearfe import InputError, Material, sweep_stiffness
from gearfe.gears.gearmesh.positions import PositionSolver
from gearfe.gears.gearmesh.sweep import elastic_pair, sweep_loads
from gearfe.gears.geometry.gear_data import TipRelief
from tests.makers.counting import counted
from tests.makers.gears import pair
from tests.makers.solving import nodal, solve_position

TWIST = math.radians(0.05)
COARSE = 2.0


@pytest.fixture(scope="module")
def gears():
    return pair(tip_round=0.1e-3)


@pytest.fixture(scope="module")
def elastic(gears):
    return elastic_pair(gears, coarsen=COARSE)


def on_the_path(gears, n=7, margin=0.044):
    """Pinion angles at which one or two pairs touch well inside the path of contact."""
    b, d = gears.path["B"].pinion_angle, gears.path["D"].pinion_angle
    single = np.linspace(b + margin, d - margin, n)
    double = np.linspace(d + margin, b + gears.mesh_cycle - margin, n)
    return single, double


def at(gears, angles, elastic=None, **options):
    # small strain, where the invariants hold to rounding; finite strain has its own tests below
    options = {"twist": TWIST, "kinematics": "small"} | options
    if elastic is None:
        options = {"coarsen": COARSE} | options
    return sweep_stiffness(gears, angles=angles, elastic=elastic, **options)


def test_torques_stand_in_the_gear_ratio_on_the_path(gears, elastic):
    """A frictionless force on the line of action has the levers r_b1 and r_b2."""
    for angles in on_the_path(gears):
        curve = at(gears, angles, elastic)
        np.testing.assert_allclose(curve.torque_wheel / curve.torque_pinion, 1.5, rtol=1e-3)
        assert (curve.torque_wheel > 0).all()


def test_single_and_double_contact(gears, elastic):
    single, double = (at(gears, angles, elastic) for angles in on_the_path(gears))
    assert set(single.teeth_in_contact) == {1}
    assert set(double.teeth_in_contact) == {2}
    np.testing.assert_allclose(np.nansum(double.load_share, axis=1), 1.0, rtol=1e-12)
    # the pair on its way out gives load to the one on its way in
    assert (np.diff(double.load_share[:, 0]) < 0).all()
    assert (double.k_mesh.min() > 1.1 * single.k_mesh).all()


def test_what_follows_from_the_torque(gears, elastic):
    curve = at(gears, on_the_path(gears)[0], elastic)
    radius = 75e-3 * math.cos(math.radians(25)) / 2
    np.testing.assert_allclose(curve.twist, TWIST, rtol=1e-14)
    np.testing.assert_allclose(curve.wheel_angle, -curve.pinion_angle / 1.5 + TWIST, rtol=1e-13)
    np.testing.assert_allclose(curve.k_torsional, curve.torque_wheel / TWIST, rtol=1e-14)
    np.testing.assert_allclose(curve.k_mesh, curve.torque_wheel / TWIST / radius**2, rtol=1e-14)
    np.testing.assert_allclose(curve.transmission_error, TWIST * radius, rtol=1e-14)
    # bore reactions of small-strain bodies differ by u x f only
    np.testing.assert_allclose(curve.torque_wheel_reaction, curve.torque_wheel, rtol=1e-3)
    assert (curve.torque_wheel_reaction != curve.torque_wheel).all()


def test_the_hub_torques_are_in_equilibrium(gears):
    """Moments about the origin: T_pinion - a F_y - T_wheel = 0 with F the force on the wheel, and its signs."""
    on_elements = elastic_pair(gears, law="nitsche", coarsen=COARSE)
    for angle in (0.05, 0.2):
        p = solve_position(on_elements, angle, TWIST)
        forces = [(gear, f.sum()) for gear, _, _, f in nodal(on_elements, p, angle, TWIST)]
        on_pinion, on_wheel = (sum(f for of, f in forces if of == gear) for gear in (0, 1))
        assert abs(on_wheel + on_pinion) < 1e-10 * abs(on_wheel)
        # hub moments balance the contact: wheel - T_wheel about c, pinion - T_pinion about the origin
        residual = p.torque_pinion + p.torque_wheel - gears.working_centre_distance * on_wheel.imag
        assert abs(residual) < 1e-8 * p.torque_wheel


def test_tangent_is_the_slope_of_the_torque(gears, elastic):
    angles = np.concatenate(on_the_path(gears, 3))
    low, mid, high = (at(gears, angles, elastic, twist=TWIST * f) for f in (0.98, 1.0, 1.02))
    slope = (high.torque_wheel - low.torque_wheel) / (0.04 * TWIST) / mid.base_radius**2
    np.testing.assert_allclose(mid.k_tangent, slope, rtol=1e-3)
    assert (mid.k_tangent > mid.k_mesh).all()  # contact stiffens with load


def test_every_cycle_is_the_same(gears, elastic):
    angles = np.radians([2.0, 12.0, 20.0, 30.0, 38.0, -16.0])
    curve = at(gears, angles, elastic, solve_all=True)
    for group in ([0, 2, 4, 5], [1, 3]):
        np.testing.assert_allclose(curve.torque_wheel[group], curve.torque_wheel[group[0]], rtol=1e-9)
        np.testing.assert_allclose(
            curve.load_share[group], np.tile(curve.load_share[group[0]], (len(group), 1)), atol=1e-9
        )
    assert list(curve.leading_pair[[0, 2, 4, 5]]) == [0, -1, -2, 1]


def test_repeated_positions_are_solved_once(gears, elastic, monkeypatch):
    solved = []
    solve = PositionSolver.solve

    def counting(self, angles, twists, kept=()):
        solved.extend(angles)
        return solve(self, angles, twists, kept)

    monkeypatch.setattr(PositionSolver, "solve", counting)
    angles = np.radians(np.arange(1.0, 41.0, 3.0))
    folded = at(gears, angles, elastic)
    assert len(solved) == 6  # 1, 4, 7, ... modulo 18 deg
    assert len(folded) == 14
    solved.clear()
    every = at(gears, angles, elastic, solve_all=True)
    assert len(solved) == 14
    np.testing.assert_allclose(folded.torque_wheel, every.torque_wheel, rtol=1e-9)
    np.testing.assert_allclose(folded.wheel_angle, every.wheel_angle, rtol=1e-13)
    np.testing.assert_array_equal(folded.leading_pair, every.leading_pair)
    np.testing.assert_allclose(folded.load_share, every.load_share, atol=1e-9)


def test_swapped_gears_carry_the_same(gears, elastic):
    """From behind (turned by 180 deg) the wheel is the pinion: the same contact, the other hub's torque.

    Exact in small strain; the first-order share of finite strain is that of the force, common to both hubs, which
    leaves out what the energy changes with the phase of the mesh.
    """
    swapped = pair(30, 20, tip_round=0.1e-3)
    angles = np.radians([2.0, 5.0, 9.0, 12.0, 17.0])
    for kinematics, accuracy in (("small", 1e-8), ("finite", 1e-5)):
        one = at(gears, angles, elastic, kinematics=kinematics)
        other = at(swapped, one.wheel_angle + math.pi / 30, twist=1.5 * TWIST, kinematics=kinematics)
        np.testing.assert_allclose(other.torque_wheel, one.torque_pinion, rtol=accuracy)
        np.testing.assert_allclose(other.torque_pinion, one.torque_wheel, rtol=accuracy)


# ---- inputs: exact scalings, then directions ------------------------------------------------------------------------


def test_stiffness_scales_with_modulus_and_width(gears, elastic):
    angles = np.radians([4.0, 13.0])
    one = at(gears, angles, elastic)
    stiff = at(gears, angles, materials=Material(400e9))
    np.testing.assert_allclose(stiff.torque_wheel, 2 * one.torque_wheel, rtol=1e-9)
    np.testing.assert_allclose(stiff.peak_pressure, 2 * one.peak_pressure, rtol=1e-7)
    wide = at(pair(tip_round=0.1e-3, width=30e-3), angles)
    np.testing.assert_allclose(wide.torque_wheel, 3 * one.torque_wheel, rtol=1e-9)


def test_stiffness_does_not_depend_on_size(gears, elastic):
    """Similar gears at the same twist: stresses are the same, so k per face width is."""
    angles = np.radians([4.0, 13.0])
    large = at(pair(module=5e-3, tip_round=0.2e-3), angles)
    np.testing.assert_allclose(large.k_mesh, at(gears, angles, elastic).k_mesh, rtol=2e-3)


def test_two_materials(gears, elastic):
    angles = np.radians([4.0, 13.0])
    steel, soft = Material(), Material(70e9, 0.33)
    both, one, other = (at(gears, angles, materials=m).k_mesh for m in ((soft, soft), (soft, steel), (steel, soft)))
    hard = at(gears, angles, elastic).k_mesh
    for mixed in (one, other):
        assert (both < mixed).all()
        assert (mixed < hard).all()
    # compliances of pinion and wheel are in series where one pair carries; only the contact is not linear
    np.testing.assert_allclose((1 / one + 1 / other)[1], (1 / both + 1 / hard)[1], rtol=3e-3)


#: What is changed -> sign of the change of k, single pair in the middle of its path.
DIRECTIONS = {
    "larger bores": ({"bore": 0.35}, +1),
    "pinion bore only": ({"pinion": {"bore": 0.3}}, +1),
    "deeper roots": ({"dedendum": 1.4, "rack_tip_radius": 0.2}, -1),
    "rounder roots": ({"rack_tip_radius": 0.1}, -1),
    "thinner teeth": ({"tooth_thinning": 0.2e-3}, -1),
    "thicker roots by profile shift": ({"profile_shift": 0.4}, +1),
}


@pytest.mark.parametrize("case", DIRECTIONS)
def test_direction(case, gears, elastic):
    change, sign = DIRECTIONS[case]
    other = pair(**({"tip_round": 0.1e-3} | change))
    load = {"twist": None, "torque": 100.0}

    def middle(one, body):
        """k at the pitch point, where one pair carries."""
        angle = one.path["C"].pinion_angle
        return float(at(one, [angle], body, **load).k_mesh[0])

    change = middle(other, None) / middle(gears, elastic) - 1
    assert sign * change > 2e-3, change


def test_plane_stress_is_softer(gears, elastic):
    """Bending and contact lose the factor 1 - nu^2 = 0.91, shear loses nothing; the rest lies between."""
    angles = np.concatenate(on_the_path(gears, 2))
    ratio = at(gears, angles, plane="stress").k_mesh / at(gears, angles, elastic).k_mesh
    assert (ratio > 0.91).all()
    assert (ratio < 0.98).all()


def test_contact_stiffens_with_load(gears, elastic):
    angles = np.concatenate(on_the_path(gears, 2))
    light, heavy = (at(gears, angles, elastic, twist=math.radians(t)).k_mesh for t in (0.02, 0.1))
    assert (heavy > 1.01 * light).all()


def test_relief_takes_load_off_the_entering_pair(gears, elastic):
    relieved = pair(tip_round=0.1e-3, tip_relief=TipRelief(20e-6, 1.5e-3))
    one, other = at(gears, np.radians([1.0, 8.0]), elastic), at(relieved, np.radians([1.0, 8.0]))
    assert (other.k_mesh < 0.95 * one.k_mesh).all()
    middle = [gears.path["C"].pinion_angle]
    assert at(relieved, middle).k_mesh[0] == pytest.approx(at(gears, middle, elastic).k_mesh[0], rel=3e-3)


# ---- torque mode ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("torque", [5.0, 100.0, 800.0])
def test_torque_mode_gives_its_torque(gears, elastic, torque):
    angles = np.radians([0.5, 4.0, 8.7, 12.0])
    curve = at(gears, angles, elastic, twist=None, torque=torque)
    assert set(curve.status) == {"converged"}
    np.testing.assert_allclose(curve.torque_wheel, torque, rtol=1e-12)
    np.testing.assert_allclose(
        curve.k_mesh * curve.transmission_error * curve.base_radius, curve.torque_wheel, rtol=1e-10
    )
    again = at(gears, angles[1:2], elastic, twist=float(curve.twist[1]))
    assert again.torque_wheel[0] == pytest.approx(torque, rel=1e-7)


def test_more_torque_more_transmission_error(gears, elastic):
    errors = [at(gears, [0.1], elastic, twist=None, torque=t).transmission_error[0] for t in (50.0, 100.0, 200.0)]
    assert errors[0] < errors[1] < errors[2]
    assert errors[2] < 4 * errors[0]  # stiffens


def test_a_torque_beyond_reach_is_flagged(gears, elastic, monkeypatch):
    """Never a guess: a solver that gives up beyond 60 N m leaves that position without numbers."""

    solve = PositionSolver.solve

    def weak(self, angles, twists, kept=()):
        made = solve(self, angles, twists, kept)
        return made.with_status(np.where(made.torque_wheel > 60, "not_converged", made.status))

    monkeypatch.setattr(PositionSolver, "solve", weak)
    fine = at(gears, [0.1], elastic, twist=None, torque=50.0)
    assert fine.torque_wheel[0] == pytest.approx(50.0, rel=1e-7)
    lost = at(gears, [0.1], elastic, twist=None, torque=100.0)
    assert lost.failed.all()
    assert lost.status[0] in ("not_converged", "torque_not_reached")
    for name in (
        "twist",
        "torque_wheel",
        "torque_pinion",
        "k_mesh",
        "k_tangent",
        "transmission_error",
        "peak_pressure",
    ):
        assert np.isnan(getattr(lost, name)).all(), name
    assert np.isnan(lost.wheel_angle).all()
    assert lost.teeth_in_contact[0] == -1


@pytest.mark.parametrize("torque", [5.0, 800.0])
def test_torque_mode_with_finite_strain(gears, elastic, torque):
    angles = np.radians(np.arange(0.0, 18.0, 1.0))
    small, finite = (at(gears, angles, elastic, twist=None, torque=torque, kinematics=k) for k in ("small", "finite"))
    np.testing.assert_allclose(finite.torque_wheel, torque, rtol=1e-9)
    np.testing.assert_allclose(finite.torque_pinion / finite.torque_wheel, small.torque_pinion / torque, rtol=1e-3)
    given = at(gears, angles[5:6], elastic, twist=float(finite.twist[5]), kinematics="finite")
    assert given.torque_wheel[0] == pytest.approx(torque, rel=1e-4)
    # it softens the teeth, more so under load
    assert (finite.twist > small.twist).all()
    assert (finite.twist < 1.02 * small.twist).all()


def test_finite_strain_counts_more_under_load(gears, elastic):
    angles = np.concatenate(on_the_path(gears, 2))

    def share(degrees):
        small, finite = (
            at(gears, angles, elastic, twist=math.radians(degrees), kinematics=k).k_mesh for k in ("small", "finite")
        )
        return 1 - finite / small

    assert (share(0.05) > 0).all()
    assert (share(0.2) > 2 * share(0.05)).all()


# ---- backlash, zero of the twist, failures --------------------------------------------------------------------------


def test_backlash_and_the_zero_of_the_twist():
    loose = pair(tip_round=0.1e-3, centre_distance=62.6e-3)
    lost = loose.contact_twist
    assert lost > 1.2 * TWIST
    body = elastic_pair(loose, coarsen=COARSE)
    angles = on_the_path(loose, 2)[0]
    apart = at(loose, angles, body, twist_from="centred")
    assert set(apart.status) == {"no_contact"}
    assert not apart.failed.any()
    np.testing.assert_array_equal(apart.torque_wheel, 0.0)
    np.testing.assert_array_equal(apart.k_mesh, 0.0)
    np.testing.assert_allclose(apart.transmission_error_unloaded, 0.0, atol=1e-9)
    touching = at(loose, angles, body)
    centred = at(loose, angles, body, twist=TWIST + lost, twist_from="centred")
    np.testing.assert_allclose(touching.torque_wheel, centred.torque_wheel, rtol=1e-12)
    np.testing.assert_allclose(touching.wheel_angle, centred.wheel_angle, rtol=1e-12)
    np.testing.assert_allclose(touching.k_mesh, centred.k_mesh, rtol=1e-12)
    np.testing.assert_allclose(centred.twist, TWIST, rtol=1e-9)
    np.testing.assert_allclose([touching.lost_motion, centred.lost_motion], lost, rtol=1e-12)


@pytest.mark.parametrize("clearance", [{"centre_distance": 62.6e-3}, {"tooth_thinning": 40e-6}])
def test_backlash_is_no_compliance(clearance):
    """The deflection vanishes with the load, and a line contact's tangent lies a little above its secant; with the lost
    motion in it, the deflection stays and the secant falls to a small part of the tangent."""
    loose = pair(tip_round=0.1e-3, **clearance)
    lost = loose.contact_twist * loose.wheel.base_radius
    body, angles = elastic_pair(loose, coarsen=COARSE), on_the_path(loose, 2)[0]
    light, loaded = (at(loose, angles, body, twist=None, torque=torque) for torque in (0.1, 10.0))
    assert (light.transmission_error < 2e-3 * lost).all()
    assert (light.transmission_error > 0).all()
    ratio = loaded.k_tangent / loaded.k_mesh
    assert ((ratio > 1.0) & (ratio < 1.3)).all(), ratio
    of_map = sweep_loads(loose, [5.0, 10.0], angles=angles, elastic=body, kinematics="small")
    np.testing.assert_allclose(of_map.curves[1].k_mesh, loaded.k_mesh, rtol=1e-5)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "neither is given"),
        ({"twist": 1e-3, "torque": 10.0}, "both are given"),
        ({"twist": 0.0}, "twist = 0.0: must be > 0"),
        ({"twist": -1e-3}, "must be > 0"),
        ({"twist": math.nan}, "must be > 0"),
        ({"twist": 0.2}, "half a pitch of the wheel"),
        ({"torque": -5.0}, "torque = -5.0: must be finite and > 0"),
        ({"torque": math.inf}, "must be finite"),
        ({"twist": 1e-3, "angles": []}, "at least one angle"),
        ({"twist": 1e-3, "angles": [math.nan]}, "finite angles"),
        ({"twist": 1e-3, "plane": "strained"}, "strain or stress"),
        ({"twist": 1e-3, "law": "glue"}, "one of half_plane, nitsche, penalty"),
        ({"twist": 1e-3, "twist_from": "here"}, "contact or centred"),
        ({"twist": 1e-3, "coarsen": 0.0}, "coarsen = 0.0: must be >= 0.2"),
    ],
)
def test_mistakes(gears, options, message):
    with pytest.raises(InputError, match=message):
        sweep_stiffness(gears, **options)


# ---- error estimate -------------------------------------------------------------------------------------------------


def test_the_error_estimate_finds_the_error(gears, elastic):
    """Against a mesh twice as fine, over positions with steady contact: above the error, less than ten times it."""
    angles = np.concatenate(on_the_path(gears, 4))
    curve = at(gears, angles, elastic, estimate_error=True, coarsen=COARSE)
    fine = at(gears, angles, coarsen=0.5 * COARSE)
    true = np.median(np.abs(curve.k_mesh / fine.k_mesh - 1))
    assert true < curve.typical_error < 10 * true
    assert curve.worst_error >= curve.typical_error > 0
    assert curve.timings["error estimate"] > 0
    assert np.isfinite(curve.relative_error).all()
    bare = at(gears, angles[:1], elastic)
    assert math.isnan(bare.worst_error)
    assert "k_mesh_relative_error" in curve.columns()
    assert "k_mesh_relative_error" not in bare.columns()


def test_progress_counts_up(gears, elastic):
    with counted() as seen:
        at(gears, np.radians([3.0, 12.0]), elastic)
    assert seen[-1] == (2, 2, "positions")
