"""Drawing with VTK in a separate process.

Off-screen drawing crashes the interpreter if a machine lacks the graphics libraries. In a second process this costs
only a picture and gives a message.
"""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from ..base.isolation import EMPTY
from ..base.typing import Array, IntArray
from ..output.arrays import save_arrays

#: Why nothing is drawn where the extra is not installed.
MISSING = "pyvista is not installed: pip install 'gearfe[fields]'"


def draw_apart(module: str, pictures: Mapping[str | Path, Mapping[str, Array]], *, seconds: float) -> str:
    """Run ``python -m module JOB PATH JOB PATH ...`` on stored arrays; return an empty text, or what was not drawn.

    The process takes neither modules nor settings from the working folder.

    Parameters
    ----------
    module
        Drawing module; run as a program it takes files of arrays and the picture to write for each.
    pictures
        Path of a picture -> what it shows.
    seconds
        How long all may take.
    """
    if importlib.util.find_spec("pyvista") is None:
        return MISSING
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-P", "-m", module]
        for number, (path, arrays) in enumerate(pictures.items()):
            job = Path(folder) / f"{number}.npz"
            save_arrays(job, arrays)
            command += [str(job), os.path.abspath(path)]
        environment = dict(os.environ)
        if sys.platform.startswith("linux"):
            environment.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
        root = str(Path(__file__).parents[2])  # found last, for a package that the working folder alone holds
        environment["PYTHONPATH"] = os.pathsep.join([*filter(os.path.isabs, sys.path), root])
        try:
            done = subprocess.run(
                command, env=environment, cwd=EMPTY, capture_output=True, text=True, errors="replace", timeout=seconds,
                check=False,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return f"drawing took longer than {seconds:g} s"
    if done.returncode != 0:
        last = done.stderr.strip().splitlines()[-1:] or [f"the drawing process ended with code {done.returncode}"]
        return f"{last[0]} (off-screen drawing needs EGL or Mesa: apt-get install libegl1 libgl1)"
    return ""


def draw_all(draw: Callable[[Path, Path], None]) -> None:
    """Draw each pair of job and picture of the command line: what a drawing module does as a program."""
    paths = [Path(name) for name in sys.argv[1:]]
    for job, target in zip(paths[::2], paths[1::2], strict=True):
        draw(job, target)


def corner_triangles(faces: IntArray) -> IntArray:
    """Corner triangles; a face with six nodes becomes four."""
    if faces.shape[1] == 3:
        return faces
    a, b, c, ab, bc, ca = faces.T
    return np.concatenate([np.column_stack(t) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])


def vtk_cells(table: IntArray) -> IntArray:
    """Cells (m, k) as VTK has them: the number of points before each."""
    return np.column_stack([np.full(len(table), table.shape[1]), table]).ravel()
