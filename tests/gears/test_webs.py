"""Gears whose rim stands on a web that is narrower than the face."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.gears.geometry.gear_data import Web
from gearfe.gears.geometry.mesh_geometry import MeshGeometry
from gearfe.gears.geometry.spur_gear import Gear
from gearfe.gears.teeth.tooth_sector import sector_mesh, sector_recipes, web_triangles
from gearfe.gears.width import WideMesh, contact_lines, sweep_width, wide_compliance

MODULE, WIDTH = 2e-3, 12e-3
WEB = Web(4e-3, 44e-3, 26e-3, offset=3e-3)


def mesh_of(web, helix=0.0):
    """Two gears with a web on the wheel, few functions and coarse sections; a helix angle (rad) of the pinion."""
    c = math.cos(helix)
    module, angle = MODULE / c, math.atan(math.tan(math.radians(20.0)) / c)
    form = {"addendum": c, "dedendum": 1.25 * c, "rack_tip_radius": 0.3 * c}
    gears = [
        Gear(z, module, angle, WIDTH, bore, **form, web=own) for z, bore, own in ((18, 18e-3, None), (28, 18e-3, web))
    ]
    base = math.atan(math.tan(helix) * math.cos(angle))
    return WideMesh(MeshGeometry(gears[0], gears[1]), base, functions=5, coarsen=3.0)


@cache
def swept(web, helix=0.0):
    """A few positions at 50 N m."""
    lines = contact_lines(wide_compliance(mesh_of(web, helix)))
    cycle = lines.compliance.mesh.sections.mesh_cycle
    return sweep_width(lines, [50.0], angles=[0.1 * cycle, 0.6 * cycle])


def influence(web):
    """Influences of the wheel's flank."""
    return wide_compliance(mesh_of(web)).sides[1].influence


def test_web_as_wide_as_the_face_is_a_full_body():
    assert np.array_equal(influence(Web(WIDTH, 44e-3, 26e-3)), influence(None))


def test_nearly_full_web_is_nearly_a_full_body():
    """Grooves of 0.01 of the width on either side, on sections that differ by the edges along the circles."""
    full, other = influence(None), influence(Web(0.98 * WIDTH, 44e-3, 26e-3))
    assert np.abs(other - full).max() < 0.01 * np.abs(full).max()


@pytest.mark.parametrize("helix", [0.0, pytest.param(math.radians(12.0), marks=pytest.mark.slow)])
def test_mirrored_web_mirrors_the_load(helix):
    """With the hand of the helix; twists are the same."""
    one, other = swept(WEB, helix), swept(replace(WEB, offset=-WEB.offset), -helix)
    assert (one.status == "converged").all()
    assert np.abs(one.twist / other.twist - 1.0).max() < 1e-9
    assert other.k_h_beta == pytest.approx(one.k_h_beta, rel=1e-9)
    # points of both by position, pair and place
    at, mirrored = one.points, other.points
    order, back = np.lexsort((at.z, at.pair, at.position)), np.lexsort((-mirrored.z, mirrored.pair, mirrored.position))
    assert np.abs(at.z[order] + mirrored.z[back]).max() < 1e-9 * WIDTH
    assert np.abs(at.line_load[order] - mirrored.line_load[back]).max() < 1e-9 * at.line_load.max()


def test_off_centre_web_moves_the_load_towards_it():
    """The rim is stiffest above its web, so that the load gathers there; a centred web lets both ends yield alike."""
    full, centred, off = (swept(web) for web in (None, replace(WEB, offset=0.0), WEB))
    assert full.twist.mean() < centred.twist.mean() < off.twist.mean()
    assert off.k_h_beta[0] > 1.05 * full.k_h_beta[0]

    def centre(sweep):
        points = sweep.points
        force = points.line_load * points.weight
        return force @ points.z / force.sum()

    assert abs(centre(full)) < 1e-9 * WIDTH
    assert abs(centre(centred)) < 1e-9 * WIDTH
    assert centre(off) > 0.01 * WIDTH


def test_sections_have_edges_along_the_circles_of_the_web():
    mesh = mesh_of(WEB)
    wheel = mesh.gears[1]
    sector = sector_mesh(wheel, sector_recipes(mesh.sections, coarsen=3.0)[1], cache=False)
    web = web_triangles(sector.points, sector.triangles, WEB)
    corners = sector.points[sector.triangles[:, [0, 3, 1, 4, 2, 5]]]
    x, y = corners.transpose(2, 0, 1)
    # twice the polygon's area; the bulges of the arcs beyond their three nodes are of fourth order
    area = 0.5 * (x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1)[web].sum()
    radii = WEB.radii
    assert area == pytest.approx(math.pi * (radii[0] ** 2 - radii[1] ** 2) / wheel.teeth, rel=1e-3)
    assert not web.all()


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"width": 13e-3, "offset": 0.0}, "web.width"),
        ({"width": -1e-3}, "web.width"),
        ({"offset": 4.1e-3}, "web.offset"),
        ({"outer_diameter": 52e-3}, "web.outer_diameter"),
        ({"outer_diameter": 25e-3}, "web.outer_diameter"),
        ({"inner_diameter": 17e-3}, "web.inner_diameter"),
    ],
)
def test_webs_outside_of_the_body_are_refused(change, field):
    with pytest.raises(InputError) as error:
        mesh_of(replace(WEB, **change))
    assert error.value.field == field
