"""Internal gears with face widths: plane limit, identities, convergence."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gearfe import GearPair
from gearfe.base.errors import InputError
from gearfe.gears.contact.half_plane_pair import half_plane_pair
from gearfe.gears.gearmesh.sweep import elastic_pair, sweep_stiffness
from gearfe.gears.width import (
    LeadModification,
    Misalignment,
    WideFlanks,
    WideMesh,
    contact_lines,
    sweep_width,
    wide_compliance,
)
from gearfe.gears.width.lines import solve_position
from tests.gears.test_width import energy
from tests.makers.wide_gears import INTERNAL_WIDTH, internal_lines, internal_pair

TORQUE = 600.0
CROWNED = WideFlanks(leads=(LeadModification(crowning=10e-6), LeadModification()))
TILTED = WideFlanks(misalignment=Misalignment.over_width(20e-6, INTERNAL_WIDTH))


def test_one_function_is_the_plane_law_of_an_internal_pair() -> None:
    """Twists agree within 0.02 %, except at the one position where a tip of the ring begins to carry load."""
    pair = internal_pair()
    compliance = wide_compliance(WideMesh(pair, functions=1, coarsen=1.0, flank_coarsen=4.0))
    for side, known in zip(compliance.sides, half_plane_pair(elastic_pair(pair)).sides, strict=True):
        size = 2 * len(known.stations)
        for step in (1, 2):
            expected = INTERNAL_WIDTH * known.far_field[step]
            assert np.abs(side.influence[step].reshape(size, size) - expected).max() < 1e-10 * np.abs(expected).max()
    angles = (np.arange(12) + 0.5) * pair.mesh_cycle / 12
    plane = sweep_stiffness(pair, torque=300.0, angles=angles, kinematics="small")
    found = sweep_width(contact_lines(compliance), [300.0], angles=angles)
    off = np.sort(np.abs(found.twist[0] / plane.twist - 1.0))
    assert off[-2] < 2e-4
    assert off[-1] < 1e-3


@pytest.mark.parametrize("angle", [0.0, 0.07, 0.19])
def test_torque_is_the_derivative_of_the_energy(angle: float) -> None:
    lines = replace(internal_lines().with_flanks(CROWNED), density=4.0)
    base = solve_position(lines, angle, torque=TORQUE)
    step = 0.01 * base.twist
    before, after = (solve_position(lines, angle, twist=base.twist + way * step) for way in (-1, 1))
    slope = (energy(lines, after) - energy(lines, before)) / (2 * step)
    assert slope == pytest.approx(TORQUE, rel=5e-4)
    assert base.tangent[0, 0] == pytest.approx((after.torque - before.torque) / (2 * step), rel=5e-3)


def test_moments_follow_from_the_energy_and_axial_forces_from_the_helix() -> None:
    """The ring turns with the pinion: moments of one sign, axial forces as in an external pair."""
    lines, angle, step = internal_lines(), 0.1, 2e-3
    found = sweep_width(lines, [TORQUE], angles=[angle])
    twist = found.twist[0, 0]
    pinion, wheel = found.moment[0, 0, :, 2]
    assert wheel == pytest.approx(TORQUE, rel=1e-6)
    ahead, behind = (energy(lines, solve_position(lines, angle + way * step, twist=twist)) for way in (1, -1))
    ratio = lines.compliance.mesh.sections.gear_ratio
    assert wheel / ratio - pinion == pytest.approx((ahead - behind) / (2 * step), rel=0.02, abs=2e-4 * abs(pinion))
    radius = lines.compliance.mesh.gears[1].reference_radius
    assert found.axial_force[0, 0] == pytest.approx(-TORQUE * math.tan(math.radians(12.0)) / radius, rel=1e-9)


@pytest.mark.parametrize("flanks", [WideFlanks(), TILTED], ids=["plain", "tilted"])
def test_hand_mirrored_with_z_is_the_same(flanks: WideFlanks) -> None:
    mirrored = replace(flanks, misalignment=Misalignment(-flanks.misalignment.in_plane))
    angles = np.array([0.0, 0.1])
    one = sweep_width(internal_lines().with_flanks(flanks), [TORQUE], angles=angles)
    other = sweep_width(internal_lines("left").with_flanks(mirrored), [TORQUE], angles=angles)
    np.testing.assert_allclose(one.twist, other.twist, rtol=1e-9)
    np.testing.assert_allclose(one.axial_force, -other.axial_force, rtol=1e-9)


def test_two_more_functions_hardly_change_the_transmission_error() -> None:
    errors = [sweep_width(internal_lines(functions=n), [TORQUE]).transmission_error[0] for n in (6, 8)]
    assert np.ptp(errors[0]) == pytest.approx(np.ptp(errors[1]), rel=0.01)


def test_rigid_helical_flanks_touch_along_the_whole_line() -> None:
    """Under 0.1 N m the transmission error of unmodified flanks is 2 to 6 nm of deflection, 0.01 um at most."""
    found = sweep_width(internal_lines(), [0.1])
    assert (found.status == "converged").all()
    assert (np.abs(found.transmission_error[0] - 5e-9) < 5e-9).all()


def test_a_free_rim_is_refused() -> None:
    pair = internal_pair()
    free = GearPair(pair.pinion, replace(pair.wheel, rim="free"))
    with pytest.raises(InputError, match=r"wheel.rim.*is not held.*bolted"):
        WideMesh(free)
