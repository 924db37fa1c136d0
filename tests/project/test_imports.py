"""What each job loads: heavy libraries only where they are needed."""

import os
import subprocess
import sys

import pytest

from tests.places import ROOT

HEAVY = ("gmsh", "meshio", "skfem", "matplotlib", "pyvista", "vtk", "h5py")


def loaded_after(code):
    """Names of top-level modules in a fresh interpreter that has run `code`."""
    code += "\nimport sys; print('LOADED', *sorted({name.partition('.')[0] for name in sys.modules}))"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True, env=os.environ
    )
    return set(done.stdout.rpartition("LOADED")[2].split())


SWEEP = """
from gearfe import sweep_stiffness
from gearfe.gears.gearmesh.job import read_stiffness_job
job = read_stiffness_job("geometry/gear_train.toml")
curve = sweep_stiffness(job.pair, twist=1e-3, angles=[0.05], coarsen=4.0, estimate_error=True, store=True)
assert not curve.failed.any()
curve.interpolant
"""


def test_import_loads_nothing_heavy():
    loaded = loaded_after("import gearfe")
    assert not loaded & {*HEAVY, "numpy", "scipy"}


def test_help_loads_no_numerics():
    assert not loaded_after("from gearfe.cli.main import main; main(['--help'])") & {*HEAVY, "numpy", "scipy"}


def test_a_sweep_on_stored_gears_loads_no_mesher_no_finite_elements_and_no_plots():
    assert "skfem" in loaded_after("from gearfe.fem.plane import triangle_shapes as t; t(0.2, 0.3)")
    loaded_after(SWEEP)  # makes the meshes, and condenses the gears of the curve and of its estimate
    loaded = loaded_after(SWEEP)
    assert not loaded & {*HEAVY}
    assert "numpy" in loaded


@pytest.mark.parametrize("program", [False, True])
def test_only_the_program_leaves_out_the_property_lists_of_matplotlib(program):
    start = "from gearfe.base.isolation import leave_working_folder as leave; leave()\n" if program else ""
    code = "import gearfe.figures\nfrom matplotlib.lines import Line2D\nprint('linestyle' in str(Line2D.set.__doc__))"
    done = subprocess.run([sys.executable, "-c", start + code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.split() == [str(not program)]
