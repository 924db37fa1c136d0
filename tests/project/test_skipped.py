"""What is skipped is not touched, and the result is the same without it (positions that repeat: test_stiffness.py)."""

import dataclasses
import math
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest

from gearfe import sweep_stiffness
from gearfe.cli.main import main
from gearfe.drivetrain.housing.model import Housing
from gearfe.drivetrain.train import build_train, simulate
from gearfe.gears.gearmesh.sweep import elastic_pair
from tests.makers.gears import pair
from tests.makers.housing_meshes import box
from tests.makers.solving import solve_position
from tests.makers.trains import SHIPPED, frame_body, train
from tests.makers.trains import elastic as in_frame
from tests.places import GEOMETRY, ROOT

TWIST = math.radians(0.1)
COARSE = 3.0


@pytest.fixture(scope="module")
def gears():
    return pair(tip_round=1e-4)


@pytest.fixture(scope="module")
def elastic(gears):
    return elastic_pair(gears, law="nitsche", coarsen=COARSE)


def touched(*args, **options):
    raise AssertionError("touched")


def loaded_after(code, **environment):
    """Modules in a fresh interpreter that has run `code`, and what it printed."""
    code += "\nimport sys; print('LOADED', *sorted(sys.modules))"
    env = {**os.environ, **environment}
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True, env=env)
    said, _, names = done.stdout.rpartition("LOADED")
    return set(names.split()), said


def test_one_sector_instead_of_the_gears(gears, monkeypatch):
    """The whole gear is never built; that both routes agree is shown by tests/gears/test_contact_routes.py."""
    # the modules that use it first: they must not meet the stand-in when they are imported
    for room in ("gears.gearmesh.fields", "gears.teeth.whole_gear"):
        monkeypatch.setattr(f"gearfe.{room}.whole_gear", touched)
    elastic = elastic_pair(gears, coarsen=COARSE)
    curve = sweep_stiffness(gears, twist=TWIST, angles=[0.0, 0.1], elastic=elastic)
    assert not curve.failed.any()
    for body in elastic.bodies:  # what was meshed is one tooth
        angles = np.arctan2(body.mesh.points[:, 1], body.mesh.points[:, 0])
        assert np.ptp(angles) < 2.0 * 2.0 * math.pi / body.teeth


def test_neighbour_teeth_only(gears, elastic):
    """A position looks at the pairs of teeth that can touch, and they carry the whole torque."""
    for angle in np.radians([0.0, 4.0, 12.0]):
        position = solve_position(elastic, float(angle), TWIST)
        assert position.status == "converged"
        assert len(position.contacts.pair) <= 4 < gears.pinion.teeth
        assert position.contacts.torque_wheel.sum() == pytest.approx(position.torque_wheel, rel=1e-9)


def test_fields_only_where_asked(tmp_path):
    job = str(GEOMETRY / "gear_train.toml")
    plain = ["stiffness", job, "--twist-deg", "0.1", "--angles", "2", "3", "5", "--coarsen", "4"]
    plain += ["--no-estimate", "--no-pictures"]
    code = f"from gearfe.cli.main import main; assert main({[*plain, '--out', str(tmp_path / 'a')]!r}) == 0"
    loaded, _ = loaded_after(code)
    room = {"gearfe.gears.gearmesh.fields", "gearfe.gears.gearmesh.fields_output", "gearfe.output.exchange.vtkhdf"}
    assert not loaded & {*room, "h5py", "pyvista", "matplotlib"}
    assert sorted(p.name for p in (tmp_path / "a").iterdir()) == ["stiffness.csv", "summary.json"]
    assert main([*plain, "--out", str(tmp_path / "b"), "--fields", "5"]) == 0
    assert (tmp_path / "b" / "fields.vtkhdf").exists()
    assert (tmp_path / "a" / "stiffness.csv").read_text() == (tmp_path / "b" / "stiffness.csv").read_text()


RIGID = """
from scripts.benchmarks.jobs.subject import train_model, train_times
from gearfe.drivetrain.train import simulate
made = simulate(train_model("undamped_springs", quick=True), train_times(True))
print(made.contact_force[-1, 0])
"""


def test_a_rigid_housing_loads_no_finite_elements():
    """In a rigid housing the springs alone decide: their mean in the end is torque over base radius."""
    loaded, _ = loaded_after(RIGID)
    heavy = {
        "skfem",
        "gmsh",
        "meshio",
        "gearfe.drivetrain.housing.model",
        "gearfe.fem.solid",
        "gearfe.fem.reduction.craig_bampton",
        "gearfe.fem.reduction.lanczos",
    }
    assert not loaded & heavy
    # the same train in a frame that is a million times stiffer than it could be

    gear_train = train(SHIPPED)
    body = frame_body(gear_train)
    stiff = dataclasses.replace(body, stiffness=1e6 * body.stiffness)
    times = np.linspace(0.0, 1e-3, 11)
    rigid = simulate(build_train(gear_train), times, tolerance=1e-6)
    frame = build_train(dataclasses.replace(in_frame(gear_train), housing=stiff))
    held = simulate(frame, times, tolerance=1e-4, method="implicit")
    size = np.abs(rigid.contact_force).max()
    assert np.abs(held.contact_force - rigid.contact_force).max() < 2e-3 * size


def test_modes_above_the_band_are_not_sought(monkeypatch):
    """Asked for the modes below a frequency, those far above are not computed, and the ones below are the same."""
    nodes, tets = box((12, 2, 2), (0.24, 0.02, 0.02))
    housing = Housing.from_arrays(nodes, tets, fixed=((0, 0, 0), (1, 0, 0)))
    few = housing.reduce(None, below_hz=3000.0, least_modes=1)
    many = housing.reduce(40)
    assert few.modes < 10 < many.modes
    assert few.internal_hz[: few.modes].max() <= 3000.0 < many.internal_hz[few.modes]
    np.testing.assert_allclose(few.internal_hz[: few.modes], many.internal_hz[: few.modes], rtol=1e-8)


def test_cached_meshes_start_no_mesher(tmp_path):
    """Nor do they load it; the second mesh is the first one."""
    sector = f"""
from gearfe.gears.teeth.tooth_sector import sector_recipes
from gearfe.gears.teeth.tooth_sector import sector_mesh
from scripts.benchmarks.jobs.subject import shipped_pair
pair = shipped_pair()
made = sector_mesh(pair.pinion, sector_recipes(pair, coarsen={COARSE})[0])
print(hash((made.points.tobytes(), made.triangles.tobytes())))
"""
    (first, made), (again, same) = (loaded_after(sector, GEARFE_CACHE=str(tmp_path), PYTHONHASHSEED="0") for _ in "12")
    assert "gmsh" in first
    assert "gmsh" not in again
    assert made == same


def test_a_cached_reduced_housing_loads_no_finite_elements(tmp_path):
    table = """
from dataclasses import replace
from scripts.benchmarks.jobs.subject import shipped_housing
from gearfe.drivetrain.housing.body import reduced_housing
table = shipped_housing()
small = replace(table, mesh=replace(table.mesh, size_mm=40.0), reduction=replace(table.reduction, modes=5))
print(repr(reduced_housing(small).coupled.frequencies_hz[:8].tolist()))
"""
    first, made = loaded_after(table, GEARFE_CACHE=str(tmp_path))
    assert "gmsh" in first
    second, read = loaded_after(table, GEARFE_CACHE=str(tmp_path))
    assert not second & {"gmsh", "skfem", "meshio"}
    assert made == read


def test_a_mechanism_loads_no_finite_elements_and_no_compiler(tmp_path):
    """Kernels in the cache are linked without numba; the result is the reference's."""
    out = tmp_path / "out"
    job = str(GEOMETRY / "andrews.toml")
    code = (
        "from gearfe.mechanisms import load_mechanism\nfrom gearfe.mechanisms.job import run_mechanism\n"
        f"made = run_mechanism(load_mechanism({job!r}), {str(out)!r}, tolerance=1e-8)\n"
        "assert made.complete"
    )
    loaded_after(code)  # compiles the kernels where they are not in the cache
    shutil.rmtree(out)
    loaded, _ = loaded_after(code)
    assert not loaded & {"numba", "skfem", "gmsh", "meshio", "pyvista", "matplotlib", "h5py"}
    assert not list(out.glob("*.png"))
    table = np.genfromtxt(out / "trajectory.csv", delimiter=",", names=True)
    truth = np.genfromtxt(ROOT / "tests" / "data" / "andrews_reference.csv", delimiter=",", names=True, skip_header=1)
    at = np.searchsorted(table["time_s"], truth["t"] - 1e-9)
    assert np.abs(table["beta_rad"][at] - truth["beta"]).max() < 1e-7


def test_help_of_the_benchmark_loads_no_numerics():
    loaded, _ = loaded_after("from gearfe.cli.main import main; main(['--help'])")
    assert not loaded & {"numpy", "scipy", "matplotlib", "exudyn", "scripts.benchmarks"}
