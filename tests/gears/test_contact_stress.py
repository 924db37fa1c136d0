"""Stress beside contacts that are narrower than the elements: Hertz's below the surface, and that of a fine mesh."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.interpolate import LinearNDInterpolator

from gearfe.gears.contact.panels import EDGES, MIDDLES
from gearfe.gears.gearmesh.fields import bumped, field_recovery, half_plane_stress
from gearfe.gears.gearmesh.sweep import elastic_pair
from tests.makers.gears import pair as gear_pair
from tests.makers.solving import solve_position

PAIR = gear_pair(tip_round=1e-4)


def test_hertz_below_the_surface() -> None:
    """Largest shear 0.300 p0 at 0.786 b, on the surface -p0 along and across (Johnson, *Contact Mechanics*, 4.2 c)."""
    edges = np.sort(np.concatenate([EDGES, MIDDLES]))
    middles = 0.5 * (edges[1:] + edges[:-1])
    z = np.linspace(0.0, 3.0, 601)
    xx, zz, xz = half_plane_stress(np.zeros_like(z), z, edges, np.sqrt(1 - middles**2))
    shear = 0.5 * np.abs(xx - zz)
    assert xz == pytest.approx(np.zeros_like(z), abs=1e-12)
    assert shear.max() == pytest.approx(0.300, abs=1e-3)
    assert z[np.argmax(shear)] == pytest.approx(0.786, abs=0.01)
    assert zz == pytest.approx(-1 / np.sqrt(1 + z**2), abs=3e-3)
    assert xx == pytest.approx(2 * z - (1 + 2 * z**2) / np.sqrt(1 + z**2), abs=3e-3)


def test_panels_are_in_equilibrium() -> None:
    """Divergence of the stresses below two panels, by differences."""
    edges, pressure, h = np.array([-1.0, -0.2, 0.7]), np.array([2.0, 0.5]), 1e-4
    x, z = np.array([-0.8, 0.1, 1.5, -3.0]), np.array([0.3, 0.5, 0.2, 2.0])
    rate = [
        (half_plane_stress(x + dx, z + dz, edges, pressure) - half_plane_stress(x - dx, z - dz, edges, pressure))
        / (2 * h)
        for dx, dz in ((h, 0.0), (0.0, h))
    ]
    assert rate[0][0] + rate[1][2] == pytest.approx(np.zeros(4), abs=1e-6)
    assert rate[0][2] + rate[1][1] == pytest.approx(np.zeros(4), abs=1e-6)


def test_beside_contacts_as_on_a_fine_flank() -> None:
    """Within a millimetre of contacts 0.1 mm wide, a flank of elements 0.28 mm long shows the stresses that Nitsche's
    law has on elements 0.035 mm long, in units of the peak pressure.
    """
    angle, twist = math.radians(5.0), math.radians(0.05)
    found = []
    for law, options in (("half_plane", {}), ("nitsche", {"flank_coarsen": 0.5})):
        elastic = elastic_pair(PAIR, law=law, **options)
        position = solve_position(elastic, angle, twist)
        found.append((elastic, position, field_recovery(elastic)(position)))
    (elastic, position, fields), (_, _, fine) = found
    contacts = position.contacts
    for gear in (0, 1):
        # so far that triangles reach across to the next tooth: places just outside of the fine flank lie in them
        beside = np.abs(fine[gear].points @ [[1], [1j]] - contacts.point).min(axis=1) < 8e-3
        stress = LinearNDInterpolator(fine[gear].points[beside], fine[gear].stress[beside])
        assert len(bumped(elastic.bodies[gear], position, gear)[1]) == len(contacts) == 2
        peak = 2 * contacts.force / (math.pi * contacts.half_width * elastic.width)
        for k in range(2):
            away = np.abs(fields[gear].points @ [1, 1j] - contacts.point[k])
            expected = stress(fields[gear].points)
            near = (away < 1e-3) & np.isfinite(expected).all(axis=1)
            assert (near & (away < 1.2e-4)).sum() >= 3
            off = np.abs(fields[gear].stress - expected)[near].max(axis=1) / peak[k]
            assert math.sqrt(np.mean(off**2)) < 0.02
            assert np.percentile(off, 95) < 0.03


def test_a_bump_has_the_force_that_it_replaces() -> None:
    elastic = elastic_pair(PAIR)
    position = solve_position(elastic, math.radians(5.0), math.radians(0.02))
    for gear, body in enumerate(elastic.bodies):
        loads, local = bumped(body, position, gear)
        assert local
        before, after = (one.force.reshape(len(one.force), -1, 2) for one in (position.loads[gear], loads))
        assert after.sum(axis=1) == pytest.approx(before.sum(axis=1), rel=1e-12)
        x, y = body.flank.points.T
        moments = [(x * f[..., 1] - y * f[..., 0]).sum(axis=1) for f in (before, after)]
        assert moments[1] == pytest.approx(moments[0], rel=2e-4)
