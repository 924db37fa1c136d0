"""Elements of a tooth sector: the right way out on every mesh that may be asked for, with the gear's own outline."""

from __future__ import annotations

import numpy as np
import pytest

from gearfe import sweep_stiffness
from gearfe.errors import InputError
from gearfe.meshing import tooth_sector
from gearfe.meshing.curved_triangles import least_jacobian
from gearfe.meshing.recipe import sector_recipes
from gearfe.meshing.tooth_sector import sector_mesh

from .gears import pair

#: Gears whose coarse root edges bulge through the triangles behind them: (teeth, module, pressure angle, rack tip
#: radius, profile shift, bore over pitch diameter, coarsen).
BULGING = [
    (10, 1.3e-3, 20.0, 0.203, 0.499, 0.52, 5.0),
    (146, 1.19e-3, 29.39, 0.111, -0.157, 0.1065, 3.0),
    (81, 1.19e-3, 29.39, 0.111, -0.137, 0.334, 4.8),
]


def bulging(teeth, module, alpha, tip, shift, bore, coarsen):
    form = {"rack_tip_radius": tip, "dedendum": 1.2, "module": module, "pressure_angle": alpha, "bore": bore}
    gears = pair(teeth, 40, pinion={"profile_shift": shift}, **form)
    return gears.pinion, sector_recipes(gears, coarsen=coarsen)[0]


def test_least_jacobian_of_a_bulging_edge():
    """Middle of an edge moved outwards by s: det = 1 + 4 s (xi + eta) - ... is 1 - 4 s at the near corners' side."""
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    middles = np.array([[0.5, 0.0], [0.5, 0.5], [0.0, 0.5]])
    for inwards in (0.0, 0.1, 0.2, 0.24, 0.26):
        points = np.concatenate([corners, middles + np.outer([1.0, 0.0, 0.0], [0.0, inwards])])
        # y = eta + 4 s xi (1 - xi - eta), x = xi: det = dy/deta = 1 - 4 s xi, least where xi = 1
        assert least_jacobian(points, np.arange(6)[None]) == pytest.approx(1 - 4 * inwards, abs=1e-14)


@pytest.mark.parametrize("case", BULGING, ids=lambda case: str(case[0]))
def test_no_element_is_inside_out(case, monkeypatch):
    gear, recipe = bulging(*case)
    mesh = sector_mesh(gear, recipe, cache=False)
    assert least_jacobian(mesh.points, mesh.triangles).min() > 0
    # the recipe as it stands would have some, else this shows nothing
    plain = tooth_sector._filled(gear, recipe)
    assert least_jacobian(plain["points"], plain["triangles"]).min() <= 0
    # the finer outline is the same one: the area between it and a fine mesh's is that of chords of second order
    fine = sector_mesh(gear, recipe.scaled(0.2), cache=False)
    assert area(mesh) == pytest.approx(area(fine), rel=2e-4)
    monkeypatch.setattr(tooth_sector, "MOST_FILLINGS", 1)
    with pytest.raises(InputError, match="inside out"):
        sector_mesh(gear, recipe, cache=False)


def area(mesh):
    """Area (m2) inside the curved outline: Simpson's rule is exact for the parabolas between its nodes."""
    total = 0.0
    for start, middle, end in np.concatenate(list(mesh.boundaries.values())):
        a, m, b = mesh.points[start], mesh.points[middle], mesh.points[end]
        slopes = (4 * m - 3 * a - b, b - a, 3 * b + a - 4 * m)
        total += sum(w * (p[0] * d[1] - p[1] * d[0]) / 12 for w, p, d in zip((1, 4, 1), (a, m, b), slopes, strict=True))
    return abs(total)


def test_flank_coarsen_leaves_the_rest_alone():
    gears = pair(20, 30, tip_round=0.1e-3)
    plain, finer = (sector_recipes(gears, flank_coarsen=f)[0] for f in (1.0, 0.25))
    assert (finer.flank, finer.strip) == pytest.approx((0.25 * plain.flank, 0.25 * plain.strip))
    assert (finer.back, finer.root, finer.body, finer.bore) == (plain.back, plain.root, plain.body, plain.bore)
    one, two = (sector_mesh(gears.pinion, recipe) for recipe in (plain, finer))
    assert len(two.boundaries["flank_left"]) > 3 * len(one.boundaries["flank_left"])
    assert len(two.boundaries["flank_right"]) < 1.3 * len(one.boundaries["flank_right"])


def test_flanks_alone_converge():
    """On one mesh of the bodies the torque nears that of much finer flanks."""
    gears = pair(20, 30, tip_round=0.1e-3)
    angles = np.linspace(0.0, gears.mesh_cycle, 5)[:-1]
    one, two, three, limit = (
        sweep_stiffness(gears, twist=1e-3, angles=angles, flank_coarsen=f, route="direct").torque_wheel
        for f in (8.0, 2.0, 0.5, 0.2)
    )
    off = [np.abs(torque / limit - 1).max() for torque in (one, two, three)]
    assert off[0] > 3 * off[1] > 9 * off[2]
    assert off[2] < 1e-4


@pytest.mark.parametrize(("coarsen", "flank"), [(1.0, 0.09), (0.5, 0.19), (1.0, 11.0), (1.0, float("nan"))])
def test_flank_sizes_out_of_range(coarsen, flank):
    with pytest.raises(InputError, match="flank_coarsen"):
        sweep_stiffness(pair(20, 30), twist=1e-3, angles=[0.0], coarsen=coarsen, flank_coarsen=flank)
