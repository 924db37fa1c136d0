"""What `pip install gearfe` without extras does: stiffness with fields, mechanisms, a word where VTK is missing."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib

from tests.places import GEOMETRY, ROOT

#: Modules of the extras.
LEFT_OUT = ("pyvista", "vtk", "vtkmodules", "pymetis")
PROGRAM = """
import sys
for name in {left_out!r}:
    sys.modules[name] = None
from gearfe.cli.main import main
from gearfe.figures.offscreen import draw_apart
job, crank, out = sys.argv[1:]
coarse = ["--coarsen", "4", "--angles", "0", "9", "9", "--no-estimate", "--no-pictures"]
assert main(["stiffness", job, "--out", out + "/pair", "--fields", "0", *coarse]) == 0
assert main(["mechanism", crank, "--out", out + "/crank", "--until", "0.05", "--no-pictures"]) == 0
print(draw_apart("gearfe.figures.housing", {{out + "/x.png": {{}}}}, seconds=1.0))
"""


def test_without_the_extras(tmp_path):
    program = PROGRAM.format(left_out=LEFT_OUT)
    jobs = [str(GEOMETRY / name) for name in ("gear_train.toml", "slider_crank.toml")]
    line = [sys.executable, "-c", program, *jobs, str(tmp_path)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(line, capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    assert "pip install 'gearfe[fields]'" in done.stdout
    assert (tmp_path / "pair" / "fields.vtkhdf").exists()
    assert (tmp_path / "crank" / "trajectory.csv").exists()


def test_extras_hold_what_is_left_out():
    with (ROOT / "pyproject.toml").open("rb") as stream:
        project = tomllib.load(stream)["project"]
    core = " ".join(project["dependencies"])
    extras = " ".join(project["optional-dependencies"]["fields"] + project["optional-dependencies"]["fast"])
    for name in ("pyvista", "pymetis"):
        assert name not in core
        assert name in extras
    assert "numba" in core
