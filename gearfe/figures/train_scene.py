"""Picture and animation of gears in their housing, drawn by VTK in a separate process.

Off-screen drawing crashes the interpreter if a machine lacks the graphics libraries. In a second process this costs
only a picture and gives a message. The animation is a GIF, put together by Pillow.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.files import whole_file
from ..base.typing import Array, IntArray
from ..output.arrays import load_arrays
from .offscreen import corner_triangles, draw_all, draw_apart, vtk_cells
from .style import write_film

_SECONDS = 300.0
#: Milliseconds a frame.
_FRAME = 80
#: Parts of the window's half width and half height that the body fills: texts stand above, bars below.
_ACROSS, _TOP, _LOW = 0.93, 0.83, -0.70
#: Pixels of a still (before it is reduced) and of a film.
_STILL, _FILM = (2000, 1440), (720, 520)


def draw_scene(path: str | Path, arrays: Mapping[str, Array], title: str, most: float | None = None) -> str:
    """Draw one step into a ``.png``, or several into an animated ``.gif``.

    Parameters
    ----------
    path : path
        The picture or film.
    arrays : mapping
        Surfaces and colours, of `gearfe.drivetrain.gearbox.fields.frames`.
    title : str
        Heading.
    most
        End of the housing's colours (m/s2); by default what 97 % of its values are below.

    Returns
    -------
    str
        Empty when it was drawn, else why not.
    """
    chosen = {} if most is None else {"range": np.array(most)}
    return draw_apart(__name__, {path: {**arrays, **chosen, "title": np.array(title)}}, seconds=_SECONDS)


def _draw(job: Path, target: Path) -> None:
    """Draw the content of a job file; runs in the separate process."""
    import pyvista

    stored: dict[str, Any] = load_arrays(job)
    count = len(stored["time"])
    # a still is drawn twice as large and reduced: smooth edges without a filter that upsets translucent surfaces
    plotter = pyvista.Plotter(off_screen=True, window_size=list(_STILL if count == 1 else _FILM), border=False)
    plotter.set_background("white")
    large = 2 if count == 1 else 1
    bar = {"title_font_size": 15 * large, "label_font_size": 13 * large, "color": "black", "width": 0.36, "n_labels": 5}
    bar |= {"height": 0.055, "position_y": 0.02, "fmt": "%.3g"}
    surfaces = []
    if "housing_points" in stored:
        values, name = stored["housing_values"], "normal acceleration (m/s2)"
        most = float(np.quantile(np.abs(values[values != 0.0]), 0.97)) if values.any() else 1.0
        most = float(stored.get("range", _round(most)))
        faces = corner_triangles(stored["housing_faces"]) if count == 1 else stored["housing_faces"][:, :3]
        housing = pyvista.PolyData(stored["housing_points"][0], vtk_cells(faces))
        housing[name] = values[0]
        outline = pyvista.PolyData(stored["housing_points"][0], lines=vtk_cells(sharp_edges(housing.points, faces)))
        near = bar | {"title": "housing: normal acceleration (m/s²)\n", "position_x": 0.06}
        look = {"cmap": "RdBu_r", "clim": (-most, most), "opacity": 0.62, "ambient": 0.3, "scalar_bar_args": near}
        plotter.add_mesh(housing, smooth_shading=False, **look)
        plotter.add_mesh(outline, color="#374151", line_width=1.3 * large)
        surfaces += [(housing, stored["housing_points"], values, name), (outline, stored["housing_points"], None, "")]
    cells = np.concatenate([vtk_cells(stored["gear_quads"]), vtk_cells(stored["gear_triangles"])])
    values, name = stored["gear_values"], "vibration (um)"
    gears = pyvista.PolyData(stored["gear_points"][0], cells)
    gears[name] = values[0]
    far = bar | {"title": "gears: vibration without rolling (µm)\n", "position_x": 0.58}
    look = {
        "cmap": "viridis",
        "clim": (0.0, _round(float(values.max()) or 1.0)),
        "ambient": 0.2,
        "scalar_bar_args": far,
    }
    plotter.add_mesh(gears, smooth_shading=False, **look)
    surfaces.append((gears, stored["gear_points"], values, name))
    _aim(plotter, surfaces[0][1][0])
    pictures = []
    for step in range(count):
        for surface, points, values, name in surfaces if step else ():
            surface.points = points[step]
            if values is not None:
                surface[name] = values[step]
        _caption(plotter, stored, step, 8 * large)
        plotter.render()
        pictures.append(plotter.screenshot(return_img=True))
    plotter.close()
    _write(target, pictures)


def _round(value: float) -> float:
    """The next round number of two digits at most, whose quarters are short."""
    power = 10.0 ** math.floor(math.log10(value))
    return power * next(step for step in (1.0, 1.2, 1.6, 2.0, 2.4, 3.2, 4.0, 6.0, 8.0, 10.0) if value <= step * power)


def _aim(plotter: Any, points: Array) -> None:
    """Look from the front, above and left, from where the body fills the window between the texts and the bars."""
    back = np.array([-0.8, -1.25, 1.25]) / np.linalg.norm([-0.8, -1.25, 1.25])
    right = np.cross([0.0, 0.0, 1.0], back) / np.linalg.norm(back[:2])
    upward = np.cross(back, right)
    middle, size = 0.5 * (points.min(axis=0) + points.max(axis=0)), float(np.ptp(points, axis=0).max())
    arms = (points - middle).astype(float)
    half = math.tan(math.radians(0.5 * plotter.camera.view_angle))
    wide = half * plotter.window_size[0] / plotter.window_size[1]
    for distance in size * 1.03 ** np.arange(200):
        depth = np.maximum(distance - arms @ back, 1e-3 * size)
        across, along = arms @ right / depth, arms @ upward / depth
        if np.ptp(across) < 2.0 * _ACROSS * wide and np.ptp(along) < (_TOP - _LOW) * half:
            break
    aside = 0.5 * (across.min() + across.max())
    above = 0.5 * (along.min() + along.max()) - 0.5 * (_TOP + _LOW) * half
    focus = middle + distance * (aside * right + above * upward)
    plotter.camera_position = [focus + distance * back, focus, (0.0, 0.0, 1.0)]


def sharp_edges(points: Array, triangles: IntArray) -> IntArray:
    """(k, 2) edges at which two triangles meet at more than 35 deg, and edges of one triangle only."""
    a, b, c = (points[triangles[:, i]].astype(float) for i in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    owner = np.tile(np.arange(len(triangles)), 3)
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    edges, owner = edges[order], owner[order]
    twin = np.flatnonzero((edges[1:] == edges[:-1]).all(axis=1))
    bent = (normal[owner[twin]] * normal[owner[twin + 1]]).sum(axis=1) < np.cos(np.radians(35.0))
    alone = np.ones(len(edges), dtype=bool)
    alone[twin] = alone[twin + 1] = False
    return np.concatenate([edges[twin[bent]], edges[alone]])


def _caption(plotter: Any, stored: Mapping[str, Any], step: int, size: int) -> None:
    factor = float(stored["exaggeration"])
    scale = "" if factor == 1.0 else f", vibration drawn {factor:g} times"
    text = f"{stored['title']}\nt = {1e3 * float(stored['time'][step]):.3f} ms{scale}"
    plotter.add_text(
        text.replace("−", "-"), position=(0.02, 0.93), viewport=True, font_size=size, color="black", name="caption"
    )


def _write(target: Path, pictures: list[NDArray[np.uint8]]) -> None:
    """One picture at half its size, several as a film with one palette."""
    from PIL import Image

    if len(pictures) == 1:
        small = Image.fromarray(pictures[0]).resize((_STILL[0] // 2, _STILL[1] // 2), Image.Resampling.LANCZOS)
        with whole_file(target) as temporary:
            small.save(temporary)
        return
    some = np.concatenate(pictures[:: max(1, len(pictures) // 5)])
    palette = Image.fromarray(some).quantize(255, method=Image.Quantize.MAXCOVERAGE)
    write_film(target, pictures, palette, ms=_FRAME, dither=True)


if __name__ == "__main__":
    draw_all(_draw)
