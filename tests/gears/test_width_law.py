"""Mesh laws over the face width: slices in closed form, contacts at other places, the plane law as the limit."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.gears.contact.half_plane_pair import half_plane_pair
from gearfe.gears.gearmesh.law_make import mesh_law
from gearfe.gears.gearmesh.sweep import elastic_pair
from gearfe.gears.gearmesh.width_law import WidthLaw
from gearfe.gears.gearmesh.width_law_make import contacts_at, first_contact, width_law
from gearfe.gears.gearmesh.width_law_store import width_law_arrays, width_law_of
from gearfe.gears.width import LeadModification, Misalignment, WideFlanks, WideMesh, contact_lines, wide_compliance
from gearfe.gears.width.lines import solve_position
from tests.makers.wide_gears import SPUR, helical_lines
from tests.makers.width_laws import Slices, sliced_law

#: Crowned, and tilted by 8 um over the width of 20 mm.
FLANKS = WideFlanks(leads=(LeadModification(crowning=6e-6), LeadModification()), misalignment=Misalignment(4e-4))
#: Mesh force (N) and tilt (rad) of the law of the helical pair.
FORCE, TILT = 5000.0, 1e-4


def crowned():  # type: ignore[no-untyped-def]
    return helical_lines().with_flanks(FLANKS)


@lru_cache(maxsize=1)
def computed() -> WidthLaw:
    return width_law(crowned(), FORCE, TILT)


def places(law: WidthLaw, count: int, seed: int = 5) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Random phases, approaches and tilts within the law."""
    rng = np.random.default_rng(seed)
    angle, tilt = rng.uniform(-1.0, 2.0, count) * law.cycle, rng.uniform(law.tilts[0], law.tilts[-1], count)
    return angle, law.first_contact(angle, tilt) + law.reach * rng.uniform(0.1, 1.0, count) ** 2, tilt


def test_force_moments_and_derivatives_belong_to_one_energy():
    law = sliced_law()
    at = places(law, 200)
    found = law(*at)
    jets = {
        "energy": ("moment", "force", "couple"),
        "force": ("cross", "tangent", "by_tilt"),
        "moment": ("bend", "cross", "twist"),
        "couple": ("twist", "by_tilt", "against"),
    }
    steps = 1e-6, 1e-10, 1e-7
    for name, slopes in jets.items():
        for axis, (slope, step) in enumerate(zip(slopes, steps, strict=True)):
            low, high = (
                getattr(law(*(x + way * step * (axis == i) for i, x in enumerate(at))), name) for way in (-1, 1)
            )
            expected = getattr(found, slope)
            off = np.abs((high - low) / (2 * step) - expected)
            # tangents of the moment on the tilt, and bends, jump at the nodes
            assert np.quantile(off, 0.97) < 1e-4 * np.abs(expected).max(), (name, slope)


def test_the_law_of_slices_is_theirs():
    """Force and moments in closed form. Where the contact reaches an end of the width tangents bend: order 1.5."""
    slices = Slices()
    errors = []
    for cells in ((12, 6, 6), (24, 12, 12)):
        law = sliced_law(slices, cells)
        angle, approach, tilt = places(law, 400)
        expected, found = slices(angle, approach, tilt), law(angle, approach, tilt)
        arms = {"force": 1.0, "couple": 0.5 * slices.width, "moment": 0.02}
        part = np.maximum(expected.force, 0.1 * law.largest_force)
        off = [np.abs(getattr(found, name) - getattr(expected, name)) / arm / part for name, arm in arms.items()]
        errors.append(np.sqrt(np.mean(np.square(off), axis=1)))
    assert (errors[1] < 1e-3).all()
    assert (np.log2(errors[0] / errors[1]) > 1.5).all()


def test_nothing_bears_before_the_flanks_touch():
    law = sliced_law()
    angle, _, tilt = places(law, 50)
    apart = law(angle, law.first_contact(angle, tilt) - 1e-9, tilt)
    for values in apart[:-1]:
        assert not values.any()
    beyond = law(angle, law.first_contact(angle, tilt) + 1.01 * law.reach, tilt)
    assert beyond.beyond.all()
    assert law(angle, law.first_contact(angle, 2e-3) + 1e-6, 2e-3).beyond.all()
    assert np.isnan(law([0.1], [math.nan]).force).all()


def test_a_closed_way_gives_no_work():
    """Phase, approach and tilt go round; force and moments do no work (the parts of the ways where they are even)."""
    law = sliced_law()
    s, w = np.polynomial.legendre.leggauss(40)
    ends = np.linspace(0.0, 2.0 * math.pi, 121)
    t = (0.5 * (ends[1:] + ends[:-1])[:, None] + 0.5 * np.diff(ends)[:, None] * s).ravel()
    weight = (0.5 * np.diff(ends)[:, None] * w).ravel()
    angle, tilt, approach = 0.1 + 0.12 * np.cos(t), 9e-4 * np.sin(t), 25e-6 + 20e-6 * np.cos(2.0 * t + 0.3)
    at = law(angle, approach, tilt)
    power = at.moment * -0.12 * np.sin(t) + at.couple * 9e-4 * np.cos(t) + at.force * -40e-6 * np.sin(2.0 * t + 0.3)
    assert abs(power @ weight) < 1e-7 * np.abs(power) @ weight


def test_the_lever_moves_the_place_of_approach_and_moment():
    law, lever = sliced_law(), 3e-3
    angle, approach, tilt = places(law, 50)
    one, other = law(angle, approach, tilt), law.about(lever)(angle, approach + lever * tilt, tilt)
    np.testing.assert_allclose(other.force, one.force, rtol=1e-9)
    np.testing.assert_allclose(other.couple, one.couple - lever * one.force, rtol=0.0, atol=1e-9 * one.force.max())


def test_contacts_at_random_places_are_within_the_stated_error():
    """Phase, approach and tilt at random, solved directly; the stated error is the largest of as many other places."""
    law, lines = computed(), crowned()
    angle, approach, tilt = places(law, 80)
    found = law(angle, approach, tilt)
    contacts = contacts_at(lines, angle, approach, tilt)
    part = np.maximum(contacts.force, 0.1 * law.largest_force)
    off = [found.force - contacts.force, (found.couple - contacts.couple) / (0.5 * law.width)]
    errors = np.abs(off / part).max(axis=0)
    assert law.error < 0.03
    assert np.sqrt(np.mean(errors**2)) < 1.5 * law.rms_error
    assert np.quantile(errors, 0.95) < law.error


def test_approach_under_a_force_is_that_of_the_contact():
    law, lines = computed(), crowned()
    radius = lines.compliance.mesh.sections.wheel.base_radius
    for angle, tilt in ((0.013, 0.0), (0.2, 7e-5)):
        moved = lines.with_flanks(
            WideFlanks(leads=FLANKS.leads, misalignment=Misalignment(FLANKS.misalignment.in_plane + tilt))
        )
        twist = solve_position(moved, angle, torque=0.3 * FORCE * radius).twist
        (delta,) = law.approach([angle], [0.3 * FORCE], [tilt])
        way = delta - first_contact(lines, angle, tilt)[0]
        assert abs(delta - twist * radius) < 3 * law.error * way


def test_spur_gears_alike_along_the_width_have_the_plane_law():
    """One function along the width, no tilt: the law of tooth pairs, to the errors that both state."""
    lines = contact_lines(wide_compliance(WideMesh(SPUR, functions=1, coarsen=1.0, flank_coarsen=4.0)))
    force = 6000.0
    law, plane = width_law(lines, force, 0.0), mesh_law(half_plane_pair(elastic_pair(SPUR)), force)
    rng = np.random.default_rng(2)
    angle = rng.uniform(0.0, law.cycle, 200)
    approach = law.first_contact(angle) + law.reach * rng.uniform(0.2, 0.9, 200) ** 2
    one, other = law(angle, approach), plane(angle, approach)
    part = np.maximum(other.force, 0.1 * force)
    errors = np.abs(one.force - other.force) / part
    # what one function along the width differs from the plane where tips bear: 0.1 % (docs/face_width.md)
    assert errors.max() < law.error + plane.error + 1e-3
    assert np.sqrt(np.mean(errors**2)) < law.rms_error + 1e-3
    loads = np.full(72, 0.3 * force)
    phases = law.cycle * np.arange(72) / 72
    mean = np.mean(law.approach(phases, loads)) / np.mean(plane.approach(phases, loads))
    assert mean == pytest.approx(1.0, abs=1e-3)
    assert law.backlash == pytest.approx(plane.backlash, abs=1e-12)


def test_arrays_keep_the_law():
    law = sliced_law()
    arrays = width_law_arrays(law)
    again = width_law_of(arrays)
    for name, values in width_law_arrays(again).items():
        np.testing.assert_array_equal(values, arrays[name])
    assert again.largest_force == law.largest_force
    assert again.base_radii == law.base_radii


def test_forces_beyond_the_law_are_refused():
    with pytest.raises(InputError, match="make the law for larger torques"):
        sliced_law().approach([0.0], [1e6])
