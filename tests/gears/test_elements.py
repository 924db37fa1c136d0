"""Nitsche and penalty on the mesh against theory: equilibrium, derivatives, limits of the laws, refinement, Hertz."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gearfe.gears.contact.compliance import MeshingPair, finite_strain_shares, gear_body
from gearfe.gears.contact.elements import solve_elements
from gearfe.gears.contact.half_plane import half_plane_pair, solve_half_plane
from gearfe.gears.contact.laws import ContactLaw, Nitsche, PairModel, Penalty
from gearfe.gears.contact.position import Positions
from gearfe.gears.gearmesh.positions import position_solver
from gearfe.gears.gearmesh.sweep import elastic_pair
from tests.makers.contact_cases import IRON, STEEL, WIDTH, condensed, gears, meshes
from tests.makers.solving import nodal, peak_pressure, solve_position, solve_positions

TWIST = math.radians(0.05)
#: Pinion angles of the 20/30 pair (deg) with one and with two tooth pairs, away from the changes.
ON_PATH = np.radians([1.0, 3.0, 5.0, 7.0, 12.0, 14.0, 16.0])


def solve_one(pair: MeshingPair, angle: float, twist: float) -> Positions:
    found = solve_positions(pair, [angle], twist)[0]
    assert found.status == "converged"
    return found


def torques(coarsen: float, law: ContactLaw) -> np.ndarray:
    found = solve_positions(condensed("reference", coarsen, "strain", law), ON_PATH, TWIST)
    assert all(p.status == "converged" for p in found)
    return np.array([p.torque_wheel for p in found])


# ---- balance and derivatives ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("law", [Nitsche(), Nitsche(2.0, sides="pinion"), Penalty(), Penalty(sides="both")])
@pytest.mark.parametrize(("name", "degrees", "twist"), [("reference", 9.0, 0.05), ("modified", 13.75, 0.3)])
def test_forces_and_torques_are_in_equilibrium(law: ContactLaw, name: str, degrees: float, twist: float) -> None:
    """Both resultants cancel; so do the moments, T_wheel + T_pinion = a F_y, about current places."""
    pair, place = condensed(name, 2.0, "strain", law), (math.radians(degrees), math.radians(twist))
    found = solve_one(pair, *place)
    parts = list(nodal(pair, found, *place))
    force = np.array([f.sum() for *_, f in parts])
    on_wheel = sum(f for (gear, *_), f in zip(parts, force, strict=True) if gear == 1)
    assert abs(force.sum()) < 1e-12 * abs(on_wheel)
    assert found.torque_wheel + found.torque_pinion == pytest.approx(pair.wheel_centre * on_wheel.imag, rel=1e-8)
    assert found.contacts.torque_wheel.sum() == pytest.approx(found.torque_wheel, rel=1e-12)
    reaction = -sum(((x - pair.wheel_centre).conj() * f).imag.sum() for gear, _, x, f in parts if gear == 1)
    assert found.torque_wheel_reaction == pytest.approx(reaction, rel=1e-12)
    assert found.torque_wheel_reaction == pytest.approx(found.torque_wheel, rel=2e-3)


@pytest.mark.parametrize("degrees", [4.0, 14.0])
def test_on_the_path_the_torques_are_in_the_ratio_of_the_teeth(degrees: float) -> None:
    pair = condensed("reference", 1.0, "strain", Nitsche())
    found = solve_one(pair, math.radians(degrees), TWIST)
    assert found.torque_wheel / found.torque_pinion == pytest.approx(1.5, rel=5e-4)


@pytest.mark.parametrize("law", [Nitsche(), Penalty(), Penalty(1e15)], ids=["nitsche", "penalty", "soft penalty"])
@pytest.mark.parametrize(
    ("name", "degrees", "twist"),
    [("reference", 4.0, 0.05), ("reference", 14.0, 0.3), ("reference", 9.0, 0.05), ("modified", 20.0, 0.05)],
)
def test_tangent_and_rates_are_derivatives(law: ContactLaw, name: str, degrees: float, twist: float) -> None:
    """Differences of whole solutions: the torque's, and the forces' by their moments about the wheel's centre."""
    pair, angle, at = condensed(name, 2.0, "strain", law), math.radians(degrees), math.radians(twist)
    step = 1e-4 * at
    before, here, after = (solve_one(pair, angle, at + s * step) for s in (-1, 0, 1))
    slope = (after.torque_wheel - before.torque_wheel) / (2 * step)
    assert here.tangent == pytest.approx(slope, rel=5e-4)
    rates = replace(here, loads=tuple(replace(one, force=one.rate) for one in here.loads))
    by_rates = -sum(
        ((x - pair.wheel_centre).conj() * f).imag.sum() for gear, _, x, f in nodal(pair, rates, angle, at) if gear == 1
    )
    slope = (after.torque_wheel_reaction - before.torque_wheel_reaction) / (2 * step)
    assert by_rates == pytest.approx(slope, rel=5e-4)


def test_company_does_not_matter() -> None:
    """A position alone, among others, in another order: the same numbers."""
    pair = condensed("sharp", 2.0, "strain", Nitsche())
    angles = (np.arange(9) + 0.37) * pair.gears.mesh_cycle / 9
    together = solve_positions(pair, angles, TWIST)
    backwards = solve_positions(pair, angles[::-1], TWIST).take(slice(None, None, -1))
    alone = [solve_positions(pair, angles[i : i + 1], TWIST)[0] for i in range(0, 9, 4)]
    for one, other in [
        *zip(together, backwards, strict=True),
        *zip(together.take(slice(None, None, 4)), alone, strict=True),
    ]:
        assert one.status == other.status == "converged"
        for quantity in ("torque_wheel", "torque_pinion", "torque_wheel_reaction"):
            assert getattr(one, quantity) == pytest.approx(getattr(other, quantity), rel=1e-8), quantity
        assert one.tangent == pytest.approx(other.tangent, rel=1e-5)


@pytest.mark.parametrize("law", [Nitsche(), Penalty()], ids=["nitsche", "penalty"])
def test_where_it_starts_does_not_matter(law: ContactLaw) -> None:
    """From loads half as large, moved along both flanks by two edges away from each other: the same solution."""
    pair, angles, twists = (
        condensed("modified", 2.0, "strain", law),
        np.radians([2.0, 9.0, 20.0]),
        np.full(3, 3 * TWIST),
    )
    start = position_solver(pair).half_plane.solve(angles, twists, kept=np.arange(3))
    off = tuple(replace(one, force=0.5 * np.roll(one.force, 8, axis=1)) for one in start.loads)
    one, other = (solve_elements(pair, first) for first in (start, replace(start, loads=off)))
    for a, b in zip(one, other, strict=True):
        assert a.status == b.status == "converged"
        assert a.torque_wheel == pytest.approx(b.torque_wheel, rel=1e-8)


@pytest.mark.parametrize("law", [Nitsche(), Penalty()], ids=["nitsche", "penalty"])
def test_sharp_tips_dig_in_over_a_mesh_cycle(law: ContactLaw) -> None:
    """0.08 modules: every position converges, the cycle closes, and the half-plane law is near."""
    name = "reference"
    pair, angles = condensed(name, 1.5, "strain", law), np.linspace(0, gears(name).mesh_cycle, 12)
    twist = 0.08 * gears(name).wheel.module / gears(name).wheel.base_radius
    found = solve_positions(pair, angles, twist)
    assert {p.status for p in found} == {"converged"}
    made = np.array([p.torque_wheel for p in found])
    assert made[-1] == pytest.approx(made[0], rel=1e-7)
    other = solve_half_plane(half_plane_pair(pair), angles, twist).torque_wheel
    assert np.abs(made / other - 1).max() < 6e-3


# ---- the laws' limits ------------------------------------------------------------------------------------------------


def test_penalty_tends_to_the_stiff_limit_with_the_inverse_of_its_stiffness_and_that_is_nitsches() -> None:
    def torque(law: ContactLaw) -> float:
        return solve_one(condensed("reference", 1.0, "strain", law), math.radians(14.0), TWIST).torque_wheel

    limit, stiffness = torque(Penalty(1e18)), np.array([1e14, 3e14, 1e15, 3e15, 1e16])
    softness = limit / np.array([torque(Penalty(s)) for s in stiffness]) - 1
    slopes = np.diff(np.log(softness)) / np.diff(np.log(stiffness))
    assert slopes[-2:] == pytest.approx([-1.0, -1.0], abs=0.12)
    assert limit == pytest.approx(torque(Nitsche()), rel=3e-4)


def test_torque_converges_under_refinement_with_more_than_first_order() -> None:
    fine = torques(1.0, Nitsche())
    sizes = np.array([8.0, 4.0, 2.0])
    errors = [float(np.sqrt(np.mean((torques(size, Nitsche()) / fine - 1) ** 2))) for size in sizes]
    assert np.polyfit(np.log(sizes), np.log(errors), 1)[0] > 1.2
    assert errors[-1] < 2e-3


@pytest.mark.parametrize("law", [Nitsche, Penalty])
def test_which_side_is_integrated_does_not_matter(law) -> None:
    reference = torques(1.0, Nitsche())
    for sides in ("both", "pinion", "wheel"):
        np.testing.assert_allclose(torques(1.0, law(sides=sides)), reference, rtol=8e-4)


@pytest.mark.parametrize("law", [Nitsche(), Penalty(1e16)])
@pytest.mark.parametrize("degrees", [13.0, 14.0, 15.0])
def test_peak_pressure_is_hertzs(law: ContactLaw, degrees: float) -> None:
    """p0 = sqrt(F E*/(pi rho w)), 1/rho = 1/s1 + 1/s2 with the roll lengths s at the contact (Johnson, ch. 4)."""
    pair, place = gears("reference"), math.radians(degrees)
    found = solve_one(condensed("reference", 1.0, "strain", law), place, math.radians(0.1))
    assert len(found.contacts.pair) == 1
    roll = pair.pinion_roll_at(place + found.contacts.pair[0] * pair.mesh_cycle)
    radius = 1 / (1 / roll + 1 / (pair.tangent_length - roll))
    modulus = 1 / (STEEL.contact_compliance("strain") + IRON.contact_compliance("strain"))
    force = found.torque_wheel / pair.wheel.base_radius
    assert peak_pressure(found) == pytest.approx(math.sqrt(force * modulus / (math.pi * radius * WIDTH)), rel=0.02)


# ---- sharp corners ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("law", [Nitsche(), Penalty()], ids=["nitsche", "penalty"])
@pytest.mark.parametrize(("degrees", "stiffness"), [(17.0, 1.5259e8), (10.0, 1.3837e8)])
def test_where_a_sharp_corner_bears_calculix_agrees(law: ContactLaw, degrees: float, stiffness: float) -> None:
    """CalculiX 2.20, surface to surface, NLGEOM, corner strips of 0.01 mm: see docs/development/verification.md."""
    pair = gears("reference")
    elastic = [gear_body(mesh, STEEL, "strain", WIDTH) for mesh in meshes("reference", 1.0)]
    both = MeshingPair(pair, elastic[0], elastic[1], PairModel(law=law))
    found = solve_one(both, math.radians(degrees), TWIST)
    share = float(finite_strain_shares(both, solve_positions(both, [math.radians(degrees)], TWIST))[0])
    k_mesh = found.torque_wheel * (1 + share) / TWIST / pair.wheel.base_radius**2
    assert k_mesh == pytest.approx(stiffness, rel=4e-3)


@pytest.mark.parametrize(("degrees", "corner_of"), [(17.0, "wheel"), (10.0, "pinion")])
def test_a_sharp_corner_pushes_along_the_normal_of_the_flank_it_bears_on(degrees: float, corner_of) -> None:
    """Frictionless: the force on an involute passes its base circle, wherever a corner touches it."""
    gear_pair, angle = gears("reference"), math.radians(degrees)
    pair = condensed("reference", 1.0, "strain", Nitsche(sides=corner_of))
    found = solve_one(pair, angle, TWIST)
    assert len(found.contacts.pair) == 2
    smooth = 0 if corner_of == "wheel" else 1
    number = found.contacts.pair[
        int(np.argmin(found.contacts.torque_wheel))
    ]  # the pair that comes or goes bears on a corner
    tooth = number if smooth == 0 else -1 - number
    ((points, force),) = (
        (x - smooth * pair.wheel_centre, f)
        for gear, number, x, f in nodal(pair, found, angle, TWIST)
        if (gear, number) == (smooth, tooth)
    )
    lever = abs((points.conj() * force).imag.sum()) / abs(force.sum())
    # the loaded tooth leans by some hundredths of a degree and its flank is dented
    assert lever == pytest.approx((gear_pair.pinion, gear_pair.wheel)[smooth].base_radius, rel=3e-3)


def test_a_sharp_corner_on_a_fine_mesh_converges() -> None:
    """The finer the mesh, the higher the pressure beside a corner: here a third of the modulus, and the faces turn."""
    elastic = elastic_pair(gears("reference"), law="nitsche", coarsen=0.7, flank_coarsen=0.5)
    found = solve_position(elastic, math.radians(10.0), math.radians(0.5))
    assert found.status == "converged"
    assert peak_pressure(found) > 0.3 * elastic.pinion.material.youngs_modulus
    other = solve_half_plane(half_plane_pair(elastic), math.radians(10.0), math.radians(0.5)).torque_wheel[0]
    assert found.torque_wheel == pytest.approx(other, rel=3e-3)
