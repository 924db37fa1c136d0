"""The contact solver against theory: equilibrium, derivatives, limits of the laws, refinement, Hertz."""

import math

import numpy as np
import pytest

from gearfe.contact.compliance import gear_body
from gearfe.contact.finite_strain import finite_strain_shares
from gearfe.contact.laws import ContactLaw, Nitsche, Penalty
from gearfe.contact.scene import MeshingPair
from gearfe.contact.solver import Position, solve_position, solve_positions

from .contact_cases import IRON, STEEL, WIDTH, condensed, gears, meshes

TWIST = math.radians(0.05)
#: Pinion angles of the 20/30 pair (deg) with one and with two tooth pairs, away from the changes.
ON_PATH = np.radians([1.0, 3.0, 5.0, 7.0, 12.0, 14.0, 16.0])


def _torques(coarsen: float, law: ContactLaw) -> np.ndarray:
    found = solve_positions(condensed("reference", coarsen, "strain", law), ON_PATH, TWIST)
    assert all(p.status == "converged" for p in found)
    return np.array([p.torque_wheel for p in found])


@pytest.mark.parametrize("law", [Nitsche(), Nitsche(sides="pinion"), Penalty()])
@pytest.mark.parametrize(("name", "angle", "twist"), [("reference", 9.0, 0.05), ("modified", 13.75, 0.3)])
def test_forces_and_torques_are_in_equilibrium(law: ContactLaw, name: str, angle: float, twist: float) -> None:
    """Both resultants cancel; so do the moments, T_wheel + T_pinion = a F_y, about current places."""
    pair = condensed(name, 2.0, "strain", law)
    found: Position = solve_position(pair, math.radians(angle), math.radians(twist))
    assert found.scene is not None
    assert found.forces is not None
    force = np.einsum("nij,nj->ni", found.scene.rotation, found.forces.reshape(-1, 2))
    on_wheel = force[found.scene.of_wheel].sum(axis=0)
    size = float(np.linalg.norm(on_wheel))
    assert np.linalg.norm(force.sum(axis=0)) < 1e-12 * size
    lever = pair.centre_distance * on_wheel[1]
    assert found.torque_wheel + found.torque_pinion == pytest.approx(lever, rel=1e-8)
    assert found.pair_torques.sum() == pytest.approx(found.torque_wheel, rel=1e-12)
    assert found.torque_wheel_reaction == pytest.approx(found.torque_wheel, rel=2e-3)


@pytest.mark.parametrize("angle", [4.0, 14.0])
def test_on_the_path_the_torques_are_in_the_ratio_of_the_teeth(angle: float) -> None:
    found = solve_position(condensed("reference", 1.0, "strain", Nitsche()), math.radians(angle), TWIST)
    assert found.torque_wheel / found.torque_pinion == pytest.approx(1.5, rel=5e-4)


@pytest.mark.parametrize(
    ("law", "name", "angle", "tolerance"),
    [
        # what is left out: products of n.a (kinks between edges), and the fading at a sharp end (reference, 9 deg)
        (Nitsche(), "reference", 4.0, 1e-4),
        (Nitsche(), "reference", 14.0, 1e-4),
        (Nitsche(), "reference", 9.0, 2e-3),
        (Nitsche(), "modified", 20.0, 1e-5),
        (Penalty(1e15), "reference", 4.0, 1e-4),
        (Penalty(1e15), "modified", 20.0, 1e-5),
    ],
)
def test_tangent_is_the_derivative_of_the_torque(law: ContactLaw, name: str, angle: float, tolerance: float) -> None:
    pair, step = condensed(name, 2.0, "strain", law), 1e-4 * TWIST
    after, here, before = (
        solve_position(pair, math.radians(angle), TWIST + s * step, tolerance=1e-12) for s in (1, 0, -1)
    )
    difference = (after.torque_wheel - before.torque_wheel) / (2 * step)
    assert here.tangent == pytest.approx(difference, rel=tolerance)


def test_penalty_tends_to_the_stiff_limit_with_the_inverse_of_its_stiffness_and_that_is_nitsches() -> None:
    place = math.radians(14.0), TWIST
    limit = solve_position(condensed("reference", 1.0, "strain", Penalty(1e18)), *place).torque_wheel
    stiffness = np.array([1e14, 3e14, 1e15, 3e15, 1e16])
    torques = [
        solve_position(condensed("reference", 1.0, "strain", Penalty(s)), *place).torque_wheel for s in stiffness
    ]
    softness = limit / np.array(torques) - 1
    slopes = np.diff(np.log(softness)) / np.diff(np.log(stiffness))
    assert slopes[-2:] == pytest.approx([-1.0, -1.0], abs=0.12)
    nitsche = solve_position(condensed("reference", 1.0, "strain", Nitsche()), *place).torque_wheel
    assert limit == pytest.approx(nitsche, rel=3e-4)


def test_torque_converges_under_refinement_with_more_than_first_order() -> None:
    fine = _torques(1.0, Nitsche())
    sizes = np.array([8.0, 4.0, 2.0])
    errors = [float(np.sqrt(np.mean((_torques(size, Nitsche()) / fine - 1) ** 2))) for size in sizes]
    assert np.polyfit(np.log(sizes), np.log(errors), 1)[0] > 1.2
    assert errors[-1] < 2e-3


@pytest.mark.parametrize("law", [Nitsche, Penalty])
def test_which_side_is_integrated_does_not_matter(law) -> None:
    reference = _torques(1.0, Nitsche())
    for sides in ("both", "pinion", "wheel"):
        np.testing.assert_allclose(_torques(1.0, law(sides=sides)), reference, rtol=8e-4)


@pytest.mark.parametrize("law", [Nitsche(), Penalty(1e16)])
@pytest.mark.parametrize("angle", [13.0, 14.0, 15.0])
def test_peak_pressure_is_hertzs(law: ContactLaw, angle: float) -> None:
    """p0 = sqrt(F E*/(pi rho w)), 1/rho = 1/s1 + 1/s2 with the roll lengths s at the contact (Johnson, ch. 4)."""
    pair, place = gears("reference"), math.radians(angle)
    found = solve_position(condensed("reference", 1.0, "strain", law), place, math.radians(0.1))
    assert len(found.pair_numbers) == 1
    roll = pair.pinion_roll_at(place + found.pair_numbers[0] * pair.mesh_cycle)
    radius = 1 / (1 / roll + 1 / (pair.tangent_length - roll))
    modulus = 1 / (STEEL.contact_compliance("strain") + IRON.contact_compliance("strain"))
    force = found.torque_wheel / pair.wheel.base_radius
    assert found.peak_pressure == pytest.approx(math.sqrt(force * modulus / (math.pi * radius * WIDTH)), rel=0.02)


@pytest.mark.parametrize(("angle", "stiffness", "tolerance"), [(17.0, 1.5259e8, 2e-3), (10.0, 1.3837e8, 4e-3)])
def test_where_a_sharp_corner_bears_calculix_agrees(angle: float, stiffness: float, tolerance: float) -> None:
    """CalculiX 2.20, surface to surface, NLGEOM, corner strips of 0.01 mm: see docs/verification.md."""
    pair = gears("reference")
    elastic = [gear_body(mesh, STEEL, "strain", WIDTH) for mesh in meshes("reference", 1.0)]
    both = MeshingPair(elastic[0], elastic[1], pair.working_centre_distance, WIDTH, Nitsche())
    found = solve_position(both, math.radians(angle), TWIST)
    share = float(finite_strain_shares(both, [found])[0])
    k_mesh = found.torque_wheel * (1 + share) / TWIST / pair.wheel.base_radius**2
    assert k_mesh == pytest.approx(stiffness, rel=tolerance)
