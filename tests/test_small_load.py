"""Loads below what the mesh resolves: the route against theory and finer meshes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gearfe import Material, StiffnessCurve, sweep_stiffness
from gearfe.contact.hertz import half_width
from gearfe.contact.laws import Nitsche
from gearfe.gear.spur_gear import TipRelief
from gearfe.gear.touching import Flanks
from gearfe.stiffness import small_load
from gearfe.stiffness.fields import pair_recovery
from gearfe.stiffness.routes import RESOLVED, Router
from gearfe.stiffness.small_balance import balance
from gearfe.stiffness.sweep import elastic_pair

from .gears import pair

COARSE = 2.0


# ---- the route against theory ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def gears():
    return pair(tip_round=0.1e-3)


@pytest.fixture(scope="module")
def elastic(gears):
    return elastic_pair(gears, coarsen=COARSE)


@pytest.fixture(scope="module")
def middle(gears):
    """A pinion angle with one pair on its path."""
    return gears.path["C"].pinion_angle + 0.02


def forces(router, angle, twists):
    return [balance(router.reference(angle, float(t)), float(t)) for t in twists]


def test_compliance_falls_with_the_logarithm_of_the_load():
    """Two materials, two face widths, plane stress: delta/F changes by ln(F)/(pi E* w), 1/(E* w) the sum of the two."""
    one, two = Material(200e9, 0.3), Material(70e9, 0.34)
    gears = pair(pinion={"width": 10e-3}, wheel={"width": 14e-3})
    body = elastic_pair(gears, (one, two), plane="stress", coarsen=COARSE)
    router, angle = Router(gears, body, "hertz"), gears.path["C"].pinion_angle
    twists = np.radians([1e-6, 1e-5, 1e-4])
    found = forces(router, angle, twists)
    radius = gears.wheel.base_radius
    compliance = [radius * t / f.force.max() for t, f in zip(twists, found, strict=True)]
    each = 1 / (200e9 * 10e-3) + 1 / (70e9 * 14e-3)
    for a, b in ((0, 1), (1, 2)):
        expected = math.log(found[b].force.max() / found[a].force.max()) * each / math.pi
        assert compliance[a] - compliance[b] == pytest.approx(expected, rel=2e-3)


def test_peak_pressure_is_hertz(gears, elastic, middle):
    router = Router(gears, elastic, "hertz")
    (p,) = router.solve(np.array([middle]), np.radians([1e-3]))
    force = p.torque_wheel / gears.wheel.base_radius
    s1 = gears.pinion_roll_at(middle + p.pair_numbers[0] * gears.mesh_cycle)
    rho = s1 * (gears.tangent_length - s1) / gears.tangent_length
    modulus = 1 / (2 * (1 - 0.3**2) / 200e9)
    b = float(half_width(force / 10e-3, modulus, rho))
    assert p.peak_pressure == pytest.approx(2 * force / 10e-3 / (math.pi * b), rel=2e-3)


def test_it_depends_neither_on_the_mesh_nor_on_the_reference(gears, elastic, middle, monkeypatch):
    angles, twists = np.array([middle, 0.1]), np.radians([1e-3, 1e-3])

    def stiffness(body):
        return np.array([p.torque_wheel for p in Router(gears, body, "hertz").solve(angles, twists)])

    one = stiffness(elastic)
    np.testing.assert_allclose(stiffness(elastic_pair(gears)), one, rtol=8e-4)
    monkeypatch.setattr(small_load, "REFERENCE_ELEMENTS", 3.0)
    np.testing.assert_allclose(stiffness(elastic), one, rtol=8e-4)


@pytest.mark.parametrize("form", [{}, {"tip_round": 0.1e-3}, {"tip_relief": TipRelief(15e-6, 1.5e-3, 1.0)}])
def test_torques_tangent_and_equilibrium(form):
    """Levers r_b1, r_b2 on the path; the tangent is the derivative, wherever the pairs bear."""
    gears = pair(**form)
    router = Router(gears, elastic_pair(gears, coarsen=COARSE), "hertz")
    angles = np.linspace(0, 1, 13)[:-1] * gears.mesh_cycle
    touch = router.touching_twists(angles)
    for degrees in (1e-5, 0.01):
        add = math.radians(degrees)
        low, mid, high = (router.solve(angles, touch + f * add) for f in (0.9999, 1.0, 1.0001))
        assert {p.status for p in mid} == {"converged"}
        slope = np.array([(h.torque_wheel - m.torque_wheel) / (2e-4 * add) for h, m in zip(high, low, strict=True)])
        np.testing.assert_allclose([p.tangent for p in mid], slope, rtol=3e-3)
        ratio = np.array([p.torque_wheel / p.torque_pinion for p in mid]) / gears.gear_ratio
        assert np.median(np.abs(ratio - 1)) < 2e-4
        for p in mid:
            assert p.torque_wheel == pytest.approx(p.pair_torques.sum(), rel=1e-12)


def test_every_load_has_an_answer():
    """Six decades of twist over a mesh cycle with sharp tips: converged, and k rises with the load."""
    gears = pair(17, 23, pressure_angle=20.0, profile_shift=0.2)
    router = Router(gears, elastic_pair(gears, coarsen=3.0))
    angles = np.linspace(0, 1, 10)[:-1] * gears.mesh_cycle
    degrees = np.geomspace(1e-6, 0.3, 8)
    before = np.zeros(len(angles))
    for value in degrees:
        found = router.solve(angles, np.full(len(angles), math.radians(value)))
        assert {p.status for p in found} == {"converged"}
        k = np.array([p.torque_wheel for p in found]) / value
        assert (k > before).all()
        before = k
        if value < 1e-3:
            assert {p.route for p in found} == {"hertz"}
    assert "direct" in {p.route for p in found}


def test_backlash_that_is_not_taken_up_is_no_contact():
    gears = pair(centre_distance=62.6e-3)
    body = elastic_pair(gears, coarsen=3.0)
    for share, status in ((1 - 1e-9, "no_contact"), (1 + 1e-9, "converged")):
        twist = share * gears.contact_twist
        curve = sweep_stiffness(gears, twist=twist, angles=[0.1, 0.2], elastic=body, twist_from="centred")
        assert set(curve.status) == {status}
        assert (curve.torque_wheel > 0).all() == (status == "converged")


# ---- the route against the mesh -------------------------------------------------------------------------------------


def test_against_a_finer_mesh(gears, elastic):
    """From a 0.14 mm flank: 0.1 % on the path, 0.3 % at pair changes, of a mesh with 0.042 mm."""
    angles = np.radians([0.2, 4.0, 8.0, 8.6, 13.0, 17.5])
    fine = Router(gears, elastic_pair(gears, coarsen=0.6), "direct")
    small = Router(gears, elastic, "hertz")
    for degrees in (0.02, 0.01):
        twists = np.full(len(angles), math.radians(degrees))
        one = np.array([p.torque_wheel for p in small.solve(angles, twists)])
        other = np.array([p.torque_wheel for p in fine.solve(angles, twists)])
        error = np.abs(one / other - 1)
        assert error[[1, 4]].max() < 1e-3
        assert error.max() < 3e-3


def test_the_edge_of_an_undercut_against_a_finer_mesh():
    """14 teeth at 20 deg: the involute starts with an edge, on and beside which the wheel's flank bears.

    A law that lets the contact run on below the edge, or pushes along the involute's normal, is 0.5 to 3 % off.
    """
    gears = pair(14, 40, pressure_angle=20.0)
    assert gears.pinion.undercut
    angles = np.array([0.0, 1.0, 1.75, 2.0, 36.0, 38.0]) / 40 * gears.mesh_cycle
    found = Flanks(gears).touching(angles)
    assert (found.place[:, 0] == 0.0).sum() >= 3
    small, fine = Router(gears, elastic_pair(gears), "hertz"), Router(gears, elastic_pair(gears, coarsen=0.5), "direct")
    for degrees in (0.02, 0.04):
        twists = np.full(len(angles), math.radians(degrees))
        one, other = (np.array([p.torque_wheel for p in r.solve(angles, twists)]) for r in (small, fine))
        np.testing.assert_allclose(one, other, rtol=1.5e-3)


def test_unequal_face_widths():
    """The mesh's answer and the small-load law meet: the load of the common width spreads in the wider body."""
    gears = pair(tip_round=0.1e-3, wheel={"width": 25e-3})
    body = elastic_pair(gears)
    angles, twists = np.radians([4.0, 13.0]), np.radians([0.03, 0.03])
    one, other = (
        np.array([p.torque_wheel for p in Router(gears, body, route).solve(angles, twists)])
        for route in ("hertz", "direct")
    )
    np.testing.assert_allclose(one, other, rtol=1.2e-3)


def test_the_switch_is_smooth(gears, elastic, middle):
    """k over the twist through the blended range: residual from a cubic in ln(twist) below 0.05 %."""
    twists = np.radians(np.geomspace(0.01, 0.2, 47))
    router = Router(gears, elastic)
    found = router.solve(np.full(len(twists), middle), twists)
    routes = [p.route for p in found]
    assert [routes[0], routes[-1]] == ["hertz", "direct"]
    assert "blend" in routes
    k, x = np.array([p.torque_wheel for p in found]) / twists, np.log(twists)
    for i in range(4, len(k) - 4):
        part = slice(i - 4, i + 5)
        fitted = np.polyval(np.polyfit(x[part] - x[i], k[part], 3), 0.0)
        assert abs(k[i] / fitted - 1) < 5e-4
    assert RESOLVED[0] < RESOLVED[1]


# ---- through the sweep ----------------------------------------------------------------------------------------------


def test_the_curve_says_which_way_it_went(gears, elastic, tmp_path):
    curve = sweep_stiffness(gears, twist=math.radians(1e-3), angles=[0.1, 0.2], elastic=elastic)
    assert list(curve.route) == ["hertz", "hertz"]
    curve.to_csv(tmp_path / "k.csv")
    assert list(StiffnessCurve.from_csv(tmp_path / "k.csv").route) == ["hertz", "hertz"]
    forced = sweep_stiffness(gears, twist=math.radians(0.3), angles=[0.1], elastic=elastic, route="direct")
    assert list(forced.route) == ["direct"]


def test_torque_mode_at_small_loads(gears, elastic):
    for torque in (1e-4, 1.0):
        curve = sweep_stiffness(gears, torque=torque, angles=[0.02, 0.2], elastic=elastic)
        assert set(curve.status) == {"converged"}
        np.testing.assert_allclose(curve.torque_wheel, torque, rtol=1e-9)
        again = sweep_stiffness(gears, twist=float(curve.twist[1]), angles=[0.2], elastic=elastic)
        assert again.torque_wheel[0] == pytest.approx(torque, rel=1e-4)


def test_finite_strain_is_a_share_that_falls_with_the_load(gears, elastic):
    """The effect is of second order in the load: its share of the torque is proportional to the twist."""

    def share(degrees):
        small, finite = (
            sweep_stiffness(gears, twist=math.radians(degrees), angles=[0.2], elastic=elastic, kinematics=k)
            for k in ("small", "finite")
        )
        assert list(finite.route) == ["hertz"]
        return float(1 - finite.k_mesh[0] / small.k_mesh[0])

    assert share(0.01) > 0
    assert share(0.01) / share(0.005) == pytest.approx(2.0, rel=0.05)


@pytest.mark.parametrize(("law", "accuracy"), [("penalty", 1e-9), (Nitsche(theta=-1), 2e-3)])
def test_it_does_not_depend_on_the_contact_law(gears, elastic, law, accuracy):
    """The law of small loads asks none of the mesh's contact laws; finite strain goes with each.

    Gears made for theta = -1 have the law's own terms in their compliance, which vanish with the mesh.
    """
    options = {"twist": math.radians(1e-3), "angles": [0.1]}
    one = sweep_stiffness(gears, elastic=elastic, **options)
    other = sweep_stiffness(gears, law=law, coarsen=COARSE, **options)
    assert list(other.route) == ["hertz"]
    assert other.k_mesh[0] == pytest.approx(one.k_mesh[0], rel=accuracy)


def test_fields_of_a_small_load(gears, elastic, middle):
    """Forces of the reference pressures: the hub feels the torque, and displacements away from the contact are those of
    the force."""
    router = Router(gears, elastic)
    twist = math.radians(2e-3)
    (p,) = router.solve(np.array([middle]), np.array([twist]), kept=[0])
    assert p.route == "hertz"
    force = np.matmul(p.scene.rotation, p.forces.reshape(-1, 2, 1))[:, :, 0]
    # the forces keep their directions in the teeth's axes, which turn by the twist
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1.5 * twist * np.abs(force).sum())
    arm = p.scene.points - p.scene.wheel_centre
    moment = -(arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0])[p.scene.of_wheel].sum()
    assert moment == pytest.approx(p.torque_wheel, rel=1e-3)
    _, wheel = pair_recovery(elastic).at(p, middle, twist)
    # teeth give way by less than the gears are twisted, and by more than nothing
    size = np.linalg.norm(wheel.displacement, axis=1).max()
    assert 0.1 < size / (gears.wheel.base_radius * twist) < 1.0


@pytest.mark.slow
@pytest.mark.parametrize("case", range(6))
def test_random_pairs_against_fine_meshes(case):
    """Any legal pair, two materials and face widths: the default mesh by the default route against coarsen = 0.4."""
    rng = np.random.default_rng(case)
    form = [{"profile_shift": float(rng.uniform(0.0, 0.4)), "width": float(rng.uniform(8e-3, 25e-3))} for _ in range(2)]
    form[case % 2]["tip_round"] = 0.1e-3
    form[(case // 2) % 2]["tip_relief"] = TipRelief(float(rng.uniform(5e-6, 25e-6)), 1.6e-3, float(rng.choice([1, 2])))
    alpha = float(rng.choice([17.5, 20.0, 25.0]))
    gears = pair(
        int(rng.integers(14, 30)), int(rng.integers(24, 60)), pressure_angle=alpha, pinion=form[0], wheel=form[1]
    )
    materials = Material(206e9, 0.3), Material(float(rng.choice([70e9, 110e9, 206e9])), 0.3)
    body, fine = (elastic_pair(gears, materials, coarsen=c) for c in (1.0, 0.4))
    angles = np.sort(rng.uniform(0, 1, 8)) * gears.mesh_cycle
    auto, mesh = Router(gears, body), Router(gears, fine, "direct")
    for degrees in (0.05, 0.02, 0.01, 0.005):
        twists = np.full(len(angles), math.radians(degrees) * 30 / gears.wheel.teeth + gears.contact_twist)
        one = np.array([p.torque_wheel for p in auto.solve(angles, twists)])
        other = np.array([p.torque_wheel for p in mesh.solve(angles, twists)])
        error = np.abs(one / other - 1)
        assert np.median(error) < 1e-3
        assert error.max() < 4e-3  # the finer mesh misses sharp corners by 0.1 % itself
