"""Picture and animation of gears in their housing, drawn by VTK in a process of its own.

Off-screen drawing crashes the interpreter where a machine lacks the graphics libraries: in a second process that costs a
picture and a message, not the results. The animation is a GIF, put together by Pillow.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arrays import load_arrays, save_arrays
from .files import whole_file

_SECONDS = 300.0
#: Milliseconds a frame.
_FRAME = 80
_WINDOW = (1000, 720)


def draw_scene(path: str | Path, arrays: Mapping[str, NDArray[Any]], title: str) -> str:
    """Draw what `gearfe.train_fields.frames` gives: one step into a ``.png``, several into an animated ``.gif``.

    Returns
    -------
    str
        Empty when it was drawn, else why not.
    """
    with tempfile.TemporaryDirectory() as folder:
        job = Path(folder) / "job.npz"
        save_arrays(job, {**arrays, "title": np.array(title)})
        environment = dict(os.environ)
        if sys.platform.startswith("linux"):
            environment.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
        environment["PYTHONPATH"] = os.pathsep.join(entry or os.getcwd() for entry in sys.path)
        command = [sys.executable, "-m", __name__, str(job), str(path)]
        try:
            done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=_SECONDS, check=False)
        except subprocess.TimeoutExpired:
            return f"drawing took longer than {_SECONDS:g} s"
    if done.returncode != 0:
        last = done.stderr.strip().splitlines()[-1:] or [f"the drawing process ended with code {done.returncode}"]
        return f"{last[0]} (off-screen drawing needs EGL or Mesa: apt-get install libegl1 libgl1)"
    return ""


def _draw(job: Path, target: Path) -> None:
    """Draw what a job file holds; runs in the process of its own."""
    import pyvista

    stored: dict[str, Any] = load_arrays(job)
    count = len(stored["time"])
    window = _WINDOW if count == 1 else (720, 520)
    plotter = pyvista.Plotter(off_screen=True, window_size=list(window), border=False)
    plotter.set_background("white")
    if count == 1:
        plotter.enable_anti_aliasing("ssaa")
    surfaces = []
    bar = {"title_font_size": 15, "label_font_size": 13, "color": "black", "width": 0.36, "height": 0.07, "n_labels": 5}
    if "housing_points" in stored:
        values = stored["housing_values"]
        most = float(np.quantile(np.abs(values), 0.9995)) or 1.0
        housing = pyvista.PolyData(stored["housing_points"][0], _cells(_flat(stored["housing_faces"])))
        housing["normal acceleration (m/s2)"] = values[0]
        near = {"title": "housing: normal acceleration (m/s2)\n", "position_x": 0.06, "position_y": 0.03, "fmt": "%.3g"}
        plotter.add_mesh(
            housing, cmap="RdBu_r", clim=(-most, most), opacity=0.62, smooth_shading=False, scalar_bar_args=bar | near,
            ambient=0.25,
        )  # fmt: skip
        surfaces.append((housing, stored["housing_points"], values, "normal acceleration (m/s2)"))
        edges = housing.extract_feature_edges(feature_angle=35.0)
        plotter.add_mesh(edges, color="#374151", line_width=1.2)
    cells = np.concatenate([_cells(stored["gear_quads"]), _cells(stored["gear_triangles"])])
    gears = pyvista.PolyData(stored["gear_points"][0], cells)
    gears["displacement (mm)"] = stored["gear_values"][0]
    far = {"title": "gears: displacement (mm)\n", "position_x": 0.58, "position_y": 0.03, "fmt": "%.3g"}
    top = float(stored["gear_values"].max()) or 1.0
    plotter.add_mesh(gears, cmap="viridis", clim=(0.0, top), smooth_shading=False, scalar_bar_args=bar | far, ambient=0.2)
    surfaces.append((gears, stored["gear_points"], stored["gear_values"], "displacement (mm)"))
    every = stored["gear_points"][0] if len(surfaces) == 1 else stored["housing_points"][0]
    centre, size = 0.5 * (every.min(axis=0) + every.max(axis=0)), float(np.ptp(every, axis=0).max())
    view = centre + size * np.array([-0.75, -1.15, 1.15])
    plotter.camera_position = [view, centre - size * np.array([0.0, 0.0, 0.06]), (0.0, 0.0, 1.0)]
    plotter.camera.zoom(1.12)
    factor = float(stored["exaggeration"])
    if count == 1:
        _caption(plotter, stored, 0, factor)
        with whole_file(target) as temporary:
            plotter.screenshot(str(temporary))
        plotter.close()
        return
    pictures = []
    for step in range(count):
        for surface, points, values, name in surfaces:
            surface.points = points[step]
            surface[name] = values[step]
        if len(surfaces) == 2:
            edges.points = housing.extract_feature_edges(feature_angle=35.0).points
        _caption(plotter, stored, step, factor)
        plotter.render()
        pictures.append(plotter.screenshot(return_img=True))
    plotter.close()
    _write_gif(target, pictures)


def _caption(plotter: Any, stored: Mapping[str, Any], step: int, factor: float) -> None:
    scale = "" if factor == 1.0 else f", vibration drawn {factor:g} times"
    text = f"{stored['title']}\nt = {1e3 * float(stored['time'][step]):.3f} ms{scale}"
    plotter.add_text(text, font_size=10, color="black", name="caption", position="upper_left")


def _write_gif(target: Path, pictures: list[NDArray[np.uint8]]) -> None:
    """All frames with the palette of the one in the middle."""
    from PIL import Image

    images = [Image.fromarray(picture) for picture in pictures]
    palette = images[len(images) // 2].quantize(200)
    made = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    with whole_file(target) as temporary:
        made[0].save(temporary, save_all=True, append_images=made[1:], duration=_FRAME, loop=0, optimize=False)


def _flat(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """Corner triangles; a face with six nodes becomes four."""
    if faces.shape[1] == 3:
        return faces
    a, b, c, ab, bc, ca = faces.T
    return np.concatenate([np.column_stack(t) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])


def _cells(table: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.column_stack([np.full(len(table), table.shape[1]), table]).ravel()


if __name__ == "__main__":
    _draw(Path(sys.argv[1]), Path(sys.argv[2]))
