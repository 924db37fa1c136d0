"""Elements of a tooth sector: the right way out on every mesh that may be asked for, with the gear's own outline."""

from __future__ import annotations

import numpy as np
import pytest

from gearfe import sweep_stiffness
from gearfe.base.errors import InputError
from gearfe.cli.main import main
from gearfe.fem.plane import least_jacobian
from gearfe.gears.gearmesh.sweep import sweep_loads
from gearfe.gears.teeth import tooth_sector
from gearfe.gears.teeth.tooth_sector import sector_mesh, sector_recipes
from tests.makers.gears import pair
from tests.places import GEOMETRY

JOB = GEOMETRY / "gear_train.toml"

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
    """Middle of one edge moved into the triangle by s: y = eta + 4 s xi (1 - xi - eta), least det where xi = 1."""
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    middles = np.array([[0.5, 0.0], [0.5, 0.5], [0.0, 0.5]])
    for inwards in (0.0, 0.1, 0.2, 0.24, 0.26):
        points = np.concatenate([corners, middles + np.outer([1.0, 0.0, 0.0], [0.0, inwards])])
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
    """On one mesh of the bodies the torque nears that of much finer flanks: ten times finer, an order of accuracy. At
    the coarsest the contacts are as wide as an element, and the error swings with the nodes (that step alone is 2.4 to
    3.6 with 24 to 72 edges round the bore)."""
    gears = pair(20, 30, tip_round=0.1e-3)
    angles = np.linspace(0.0, gears.mesh_cycle, 5)[:-1]
    given = {"twist": 4e-3, "angles": angles, "law": "nitsche"}
    one, two, three, limit = (
        sweep_stiffness(gears, flank_coarsen=f, **given).torque_wheel for f in (6.0, 2.0, 0.6, 0.2)
    )
    off = [np.abs(torque / limit - 1).max() for torque in (one, two, three)]
    assert off[0] > off[1] > 3 * off[2]
    assert off[0] > 10 * off[2]
    assert off[2] < 1e-4


@pytest.mark.parametrize(("coarsen", "flank"), [(1.0, 0.09), (0.5, 0.19), (1.0, 11.0), (1.0, float("nan"))])
def test_flank_sizes_out_of_range(coarsen, flank):
    with pytest.raises(InputError, match="flank_coarsen"):
        sweep_stiffness(pair(20, 30), twist=1e-3, angles=[0.0], coarsen=coarsen, flank_coarsen=flank)


@pytest.mark.parametrize("s", [0.15, 0.24, 0.3, -0.3])
def test_an_element_with_two_bent_edges(s):
    """x = xi + 4 s eta (1 - xi - eta), y = eta + 4 s xi (1 - xi - eta): det is a quadratic with its least inside."""
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    bent = np.array([[0.5, s], [0.5, 0.5], [s, 0.5]])
    xi = np.linspace(0.0, 1.0, 201)
    x, y = np.meshgrid(xi, xi)
    det = (1 - 4 * s * y) * (1 - 4 * s * x) - 16 * s**2 * (1 - x - 2 * y) * (1 - 2 * x - y)
    det = det[x + y <= 1 + 1e-12]
    found = least_jacobian(np.concatenate([corners, bent]), np.arange(6)[None])
    assert found == pytest.approx(det.min(), abs=0.02)
    backwards = least_jacobian(np.concatenate([corners, bent]), np.array([[0, 2, 1, 5, 4, 3]]))
    assert backwards == pytest.approx(-det.max(), abs=0.02)
    flat = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [0.5, 0.0], [1.5, 0.0], [1.0, 0.0]])
    assert not least_jacobian(flat, np.arange(6)[None]) > 0


def test_flank_coarsen_reaches_load_maps_and_mesh_files(tmp_path, capsys):
    gears = pair(20, 30, tip_round=0.1e-3)
    one, two = (sweep_loads(gears, [100.0], angles=[0.1], law="nitsche", flank_coarsen=f) for f in (0.5, 1.0))
    assert one.curves[0].k_mesh != pytest.approx(two.curves[0].k_mesh, rel=1e-6)
    job = tmp_path / "job.toml"
    text = JOB.read_text().replace("\n[stiffness]\n", "\n[stiffness]\nflank_coarsen = 0.5\n")
    assert text != JOB.read_text()
    nodes = []
    for content in (JOB.read_text(), text):
        job.write_text(content)
        assert main(["mesh", str(job), "--out", str(tmp_path / "mesh.vtu"), "--gear", "pinion", "--sector"]) == 0
        nodes.append(int(capsys.readouterr().out.split(" nodes")[0].rsplit(" ", 1)[-1]))
    assert nodes[1] > 1.5 * nodes[0]
    job.write_text(text.replace("= 0.5", "= 0.1"))
    assert main(["mesh", str(job), "--out", str(tmp_path / "mesh.vtu"), "--coarsen", "0.5"]) == 2
    assert "flank_coarsen" in capsys.readouterr().err
