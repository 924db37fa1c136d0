"""Pictures of a housing and of its modes, drawn by VTK in a separate process.

Off-screen drawing crashes the interpreter if a machine lacks the graphics libraries. In a second process this costs
only a picture and gives a message.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.files import whole_file
from ..base.typing import Array, IntArray
from ..output.arrays import load_arrays
from .offscreen import corner_triangles, draw_all, draw_apart, vtk_cells
from .style import new_figure, save

if TYPE_CHECKING:
    from ..drivetrain.housing.modal_test import Comparison

#: Largest displacement in a picture of a mode, in parts of the body's size.
EXAGGERATION = 0.06
#: Pixels of pictures of one body; each of several has 520 x 400.
SIZES = {1: (900, 700)}
#: How much of the light a body takes away whose bores are shown: those behind are to be seen.
OPACITY = 0.5
#: How much nearer the camera is than where the sphere round the body fits.
ZOOM = 1.15
_SECONDS = 120.0


def picture_of_bodies(
    points: Array,
    faces: IntArray,
    fields: Array,
    titles: Sequence[str],
    *,
    marked: Mapping[str, IntArray] | None = None,
    labels: Mapping[str, Array] | None = None,
) -> dict[str, Array]:
    """What `draw_bodies` draws: deformed surfaces side by side.

    Parameters
    ----------
    points : (n, 3)
        Coordinates (m).
    faces : (f, 3) or (f, 6)
        Triangles of the surface.
    fields : (k, n, 3)
        Displacements, one picture each, scaled to be seen; a field of zeros draws the body as it is.
    titles
        One a picture.
    marked
        Colour -> numbers of points to mark with it.
    labels
        Name -> place (m), for the attachments.
    """
    used, renumbered = np.unique(faces, return_inverse=True)
    named = {} if labels is None else dict(labels)
    return {
        "points": points[used],
        "faces": renumbered.reshape(faces.shape),
        "fields": fields[:, used],
        "titles": np.array(list(titles)),
        "colours": np.array(list(marked or {})),
        **{f"marked {colour}": points[numbers] for colour, numbers in (marked or {}).items()},
        "names": np.array(list(named)),
        "places": np.array(list(named.values())).reshape(-1, 3),
    }


def draw_bodies(pictures: Mapping[str | Path, Mapping[str, Array]]) -> str:
    """Write pictures (``.png``) of `picture_of_bodies`; return an empty text, or why there are none."""
    return draw_apart(__name__, pictures, seconds=_SECONDS)


def _draw(job: Path, target: Path) -> None:
    """Draw the content of a job file; runs in the separate process."""
    import pyvista

    stored: dict[str, Any] = load_arrays(job)
    points, faces, fields = stored["points"], stored["faces"], stored["fields"]
    cells = vtk_cells(corner_triangles(faces))
    size = float(np.ptp(points, axis=0).max())
    columns = min(3, len(fields))
    rows = math.ceil(len(fields) / columns)
    plotter = pyvista.Plotter(
        off_screen=True, shape=(rows, columns), window_size=SIZES.get(len(fields), (520 * columns, 400 * rows)),
        border=False,
    )  # fmt: skip
    plotter.set_background("white")
    for number, (field, title) in enumerate(zip(fields, stored["titles"], strict=True)):
        plotter.subplot(number // columns, number % columns)
        magnitude = np.linalg.norm(field, axis=1)
        most = float(magnitude.max())
        moved = points + field * (EXAGGERATION * size / most) if most > 0.0 else points
        surface = pyvista.PolyData(moved, cells)
        if most > 0.0:
            surface["displacement / largest"] = magnitude / most
            bar = {"title_font_size": 13, "label_font_size": 11, "color": "black", "n_labels": 2, "fmt": "%.1f"}
            bar |= {"width": 0.4, "height": 0.06, "position_x": 0.55, "position_y": 0.02}
            plotter.add_mesh(
                surface, scalars="displacement / largest", cmap="viridis", clim=(0.0, 1.0), show_scalar_bar=number == 0,
                scalar_bar_args=bar, smooth_shading=False, ambient=0.35, diffuse=0.75,
            )  # fmt: skip
            rest = pyvista.PolyData(points, cells).extract_feature_edges(feature_angle=30.0)
            plotter.add_mesh(rest, color="dimgray", line_width=1.0, opacity=0.7)
        else:
            look = {"color": "#c9d3e0", "ambient": 0.35, "diffuse": 0.75, "opacity": OPACITY}
            plotter.add_mesh(surface, smooth_shading=False, **look)
            edges = surface.extract_feature_edges(feature_angle=30.0)
            plotter.add_mesh(edges, color="black", line_width=1.5)
            for colour in stored["colours"]:
                if len(marked := stored[f"marked {colour}"]):
                    plotter.add_points(marked, color=str(colour), point_size=5, render_points_as_spheres=True)
            if len(stored["names"]):
                plotter.add_point_labels(
                    stored["places"], [str(name) for name in stored["names"]], font_size=16, bold=True,
                    text_color="crimson", shape_color="white", shape_opacity=0.85, show_points=False,
                    always_visible=True,
                )  # fmt: skip
        plotter.add_text(str(title), position=(0.02, 0.95), viewport=True, font_size=7, color="black")
        centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
        plotter.camera_position = [centre + size * np.array([0.75, 1.25, 0.75]), centre, (0.0, 0.0, 1.0)]
        plotter.reset_camera()  # the whole body, long or compact
        plotter.camera.zoom(ZOOM)
    with whole_file(target) as temporary:
        plotter.screenshot(str(temporary))
    plotter.close()


def mac_figure(path: str | Path, made: Comparison, name: str) -> None:
    """A table of squares, test modes upwards, those of the housing to the right; partners are framed.

    Parameters
    ----------
    name
        What the test is called.
    """
    rows, count = made.mac.shape
    figure = new_figure(max(6.0, 2.2 + 0.52 * count), max(4.0, 1.9 + 0.42 * rows))
    axes = figure.subplots()
    image = axes.pcolormesh(np.arange(count + 1), np.arange(rows + 1), made.mac, cmap="Blues", vmin=0.0, vmax=1.0)
    for i, j in np.argwhere(made.mac >= 0.1):
        value = made.mac[i, j]
        axes.text(
            j + 0.5,
            i + 0.5,
            f"{value:.2f}",
            ha="center",
            va="center",
            fontsize=8,
            color="white" if value > 0.6 else "k",
        )
    for i, j in enumerate(made.pairs):
        if j >= 0:
            axes.plot([j, j + 1, j + 1, j, j], [i, i, i + 1, i + 1, i], color="#d9730d", linewidth=1.4)
    axes.set_xticks(np.arange(count) + 0.5, [f"{f:.0f}" for f in made.frequencies], rotation=90, fontsize=8)
    axes.set_yticks(np.arange(rows) + 0.5, [f"{f:.0f}" for f in made.test.frequencies], fontsize=8)
    axes.set_xlabel("housing: frequency (Hz)")
    axes.set_ylabel(f"{name}: frequency (Hz)")
    axes.set_title("Modal assurance criterion", loc="left", fontsize=11)
    figure.colorbar(image, ax=axes, pad=0.02, label="MAC (-)")
    save(figure, path)


if __name__ == "__main__":
    draw_all(_draw)
