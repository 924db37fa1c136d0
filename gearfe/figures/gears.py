"""Pictures of a gear pair in mesh, and of its meshes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.typing import Array
from ..gears.geometry.derived import gear_outline, path_place, zone
from ..gears.geometry.gear_data import Web
from ..gears.geometry.pair import GearPair
from ..gears.geometry.spur_gear import Gear
from .style import BLUE, GREEN, GREY, ORANGE, RED, new_figure, save

if TYPE_CHECKING:
    from ..output.exchange.mesh_export import MeshPart

PINION_FILL, WHEEL_FILL = "#dbe7f3", "#f3e6d8"


def pair_picture(pair: GearPair, pinion_angle: float = 0.0, notes: str = "") -> Any:
    """Meshed pair: the whole gears, and the meshing zone with line of action and path of contact.

    Helical gears also along y, with the helices of their teeth; the other views are of the middle section.

    Parameters
    ----------
    pinion_angle
        rad.
    notes
        Text below the enlarged zone, for the derived geometry.
    """
    outlines = [
        gear_outline(pair.pinion, pinion_angle, (0.0, 0.0)),
        gear_outline(pair.wheel, pair.wheel_angle_at(pinion_angle) + pair.wheel_phase, (pair.wheel_centre, 0.0)),
    ]
    colours = [(PINION_FILL, BLUE), (WHEEL_FILL, ORANGE)]
    if pair.internal:  # what the ring leaves free lies over its rim, the pinion over that
        outlines, colours = outlines[::-1], [("white", ORANGE), (PINION_FILL, BLUE)]
    line_of_action = np.array([path_place(pair, 0.0), path_place(pair, pair.tangent_length)])
    whole, near, beside = _panels(pair)
    figure = near.figure
    styles = {
        "pitch": (GREY, (0, (7, 2, 1.5, 2)), 0.9, "working pitch circles"),
        "base": (GREEN, (0, (4, 3)), 0.9, "base circles"),
        "tip": ("#9ca3af", (0, (1, 2)), 0.8, "tip circles"),
    }
    angle = np.linspace(0, 2 * np.pi, 721)
    for axes in (whole, near):
        if pair.internal:
            _fill_rim(axes, pair)
        for outline, (fill, edge) in zip(outlines, colours, strict=True):
            axes.fill(outline[:, 0], outline[:, 1], facecolor=fill, edgecolor=edge, linewidth=1.1)
        named = set()
        for kind, x, radius in _circles(pair):
            if kind == "bore":
                axes.fill(
                    x + radius * np.cos(angle), radius * np.sin(angle), facecolor="white", edgecolor="#374151", lw=1
                )
                continue
            color, dash, width, label = styles[kind]
            axes.plot(
                x + radius * np.cos(angle),
                radius * np.sin(angle),
                color=color,
                linestyle=dash,
                linewidth=width,
                label=None if kind in named else label,
            )
            named.add(kind)
        axes.plot(line_of_action[:, 0], line_of_action[:, 1], color=RED, linewidth=1.0, label="line of action")
        axes.set_aspect("equal")
        axes.set_xlabel("x (mm)")
    whole.set_ylabel("y (mm)")
    for x in (0.0, 1e3 * pair.wheel_centre):
        whole.plot(x, 0.0, "+", color="#374151", markersize=9)
    x, y, half = zone(pair)
    whole.add_patch(_rectangle(x, y, half))
    teeth = f"Gear pair {pair.pinion.teeth}/{pair.wheel.teeth}"
    whole.set_title(f"{teeth}, pinion angle {math.degrees(pinion_angle):g}°", loc="left", fontsize=11)
    path_points = {name: path_place(pair, point.pinion_roll) for name, point in pair.path.items()}
    marks = np.array(list(path_points.values()))
    near.plot(marks[:, 0], marks[:, 1], color=RED, linewidth=2.4, label="path of contact A–E")
    near.plot(marks[:, 0], marks[:, 1], "o", color=RED, markersize=4)
    near_by = 0.06 * half  # letters of points closer than this go to both sides of the line
    for number, (letter, (px, py)) in enumerate(path_points.items()):
        close = any(math.dist((px, py), after) < near_by for after in marks[number + 1 : number + 2])
        side = {"xytext": (-7, -6), "ha": "right", "va": "top"} if close else {"xytext": (6, 5)}
        near.annotate(letter, (px, py), textcoords="offset points", color=RED, weight="bold", fontsize=10, **side)
    near.set_xlim(x - half, x + half)
    near.set_ylim(y - half, y + half)
    near.set_title("meshing zone", loc="left", fontsize=11)
    near.legend(fontsize=8, loc="upper right", framealpha=0.95)
    if beside is not None:
        _draw_helices(beside, pair, pinion_angle)
    if notes:
        near.text(
            0.015,
            0.015,
            notes,
            transform=near.transAxes,
            fontsize=8,
            va="bottom",
            family="monospace",
            bbox={"facecolor": "white", "alpha": 0.9, "edgecolor": "#d1d5db"},
        )
    return figure


def _panels(pair: GearPair) -> tuple[Any, Any, Any]:
    """Axes of the whole gears, of the meshing zone, and of the view along y of helical gears and webs (else None)."""
    if not (pair.pinion.helical or any(gear.narrow_web for gear in (pair.pinion, pair.wheel))):
        return *new_figure(12.5, 6.4).subplots(1, 2, width_ratios=(1.0, 1.0)), None
    figure = new_figure(12.5, 7.0)
    grid = figure.add_gridspec(2, 2, height_ratios=(3.0, 1.0))
    whole = figure.add_subplot(grid[0, 0])
    return whole, figure.add_subplot(grid[:, 1]), figure.add_subplot(grid[1, 0], sharex=whole)


def _draw_helices(axes: Any, pair: GearPair, pinion_angle: float) -> None:
    """Draw both gears seen along +y: the middles of their tips on the visible part of the tip cylinders.

    Hidden edges of webs are dashed.
    """
    wheel_angle = pair.wheel_angle_at(pinion_angle) + pair.wheel_phase
    placed = [
        (pair.pinion, pinion_angle, 0.0, 0.0, BLUE),
        (pair.wheel, wheel_angle, pair.wheel_centre, 1e3 * pair.axial_offset, ORANGE),
    ]
    fills = [PINION_FILL, WHEEL_FILL]
    if pair.internal:  # the pinion lies in front of the ring, as if this were cut open
        placed, fills = placed[::-1], fills[::-1]
    for (gear, angle, x, middle, colour), fill in zip(placed, fills, strict=True):
        half, radius = 0.5e3 * gear.face_width, 1e3 * (gear.held_radius if gear.internal else gear.tip_radius)
        corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * (radius, half) + (1e3 * x, middle)
        axes.fill(corners[:, 0], corners[:, 1], facecolor=fill, edgecolor=colour, linewidth=1.1)
        z = middle + np.linspace(-half, half, 41)
        for tooth in range(0 if gear.internal else gear.teeth):
            turned = angle + 2 * np.pi * tooth / gear.teeth + 1e-3 * gear.twist_rate * z
            seen = np.where(np.sin(turned) < 0.0, 1e3 * x + radius * np.cos(turned), np.nan)
            axes.plot(seen, z, color=colour, linewidth=0.8)
        if gear.narrow_web is not None:
            _draw_web(axes, gear, gear.narrow_web, (1e3 * x, middle), half)
    helix = f"{math.degrees(pair.pinion.helix_angle):g}°, pinion {pair.pinion.hand}, wheel {pair.wheel.hand}"
    axes.set_title(f"along y: helix angle {helix}" if pair.pinion.helical else "along y", loc="left", fontsize=11)
    axes.set_aspect("equal")
    axes.set_xlabel("x (mm)")
    axes.set_ylabel("z (mm)")


def _draw_web(axes: Any, gear: Gear, web: Web, place: tuple[float, float], half: float) -> None:
    """Draw the empty rings on both sides of a web, dashed; place and half of the face width in mm."""
    outer, inner = 1e3 * web.radii[0], 1e3 * max(gear.held_radius, *web.radii[1:])
    low, high = 1e3 * (web.offset - 0.5 * web.width), 1e3 * (web.offset + 0.5 * web.width)
    for side in (-1, 1):
        for end, start in ((-half, low), (half, high)):
            x = place[0] + side * np.array([inner, outer, outer, inner])
            y = place[1] + np.array([end, end, start, start])
            axes.fill(x, y, facecolor="white", alpha=0.45, zorder=3)
            axes.plot(x[[0, 3, 2, 1]], y[[0, 3, 2, 1]], color="#374151", linestyle=(0, (3, 2)), lw=0.9, zorder=4)


def _circles(pair: GearPair) -> list[tuple[str, float, float]]:
    """Kind, x of the centre and radius (mm) of the circles of both gears."""
    found = []
    gears = (
        (pair.pinion, 0.0, pair.pinion_working_radius),
        (pair.wheel, pair.wheel_centre, pair.wheel_working_radius),
    )
    for gear, x, pitch in gears:
        radii = {} if gear.internal else {"bore": gear.held_radius}
        radii |= {"pitch": pitch, "base": gear.base_radius, "tip": gear.tip_radius}
        found += [(kind, 1e3 * x, 1e3 * radius) for kind, radius in radii.items()]
    return found


def _fill_rim(axes: Any, pair: GearPair) -> None:
    """Fill the outer circle of an internal gear."""
    angle, radius = np.linspace(0, 2 * np.pi, 721), 1e3 * pair.wheel.held_radius
    x, y = 1e3 * pair.wheel_centre + radius * np.cos(angle), radius * np.sin(angle)
    axes.fill(x, y, facecolor=WHEEL_FILL, edgecolor=ORANGE, linewidth=1.1)


def _rectangle(x: float, y: float, half: float) -> Any:
    from matplotlib.patches import Rectangle

    return Rectangle((x - half, y - half), 2 * half, 2 * half, fill=False, edgecolor="#374151", linewidth=0.9)


#: Elements beyond which the edges inside of the whole gears would be a grey area: their outlines are drawn there.
MOST = 40000


def mesh_figure(path: str | Path, parts: Mapping[str, MeshPart], pair: GearPair | None) -> None:
    """The whole meshes, and beside them the meshing zone of `pair`, if it is given; contact boundaries in red."""
    both = pair is not None
    figure = new_figure(12.5 if both else 7.0, 6.4)
    views = list(np.atleast_1d(figure.subplots(1, 2 if both else 1)))
    for number, axes in enumerate(views):
        for (name, part), colour in zip(parts.items(), (BLUE, ORANGE), strict=False):
            _draw(axes, part, colour, 0.25 if number == 0 else 0.6, name, zoomed=number > 0)
        axes.set_aspect("equal")
        axes.set_xlabel("x (mm)")
        axes.autoscale_view()
    views[0].set_ylabel("y (mm)")
    elements = sum(len(part.triangles) for part in parts.values())
    views[0].set_title(f"{elements} triangles of second order", loc="left", fontsize=11)
    if pair is not None:
        x, y, half = zone(pair)
        views[1].set_xlim(x - half, x + half)
        views[1].set_ylim(y - half, y + half)
        views[1].set_title("meshing zone", loc="left", fontsize=11)
    handles, labels = views[-1].get_legend_handles_labels()
    entries = dict(zip(labels, handles, strict=True))
    views[-1].legend(entries.values(), entries.keys(), loc="upper right", fontsize=9, framealpha=0.9)
    save(figure, path)


def _draw(axes: Any, part: MeshPart, colour: str, width: float, name: str, *, zoomed: bool) -> None:
    from matplotlib.collections import LineCollection

    points = 1e3 * part.points
    if zoomed or len(part.triangles) <= MOST:
        axes.add_collection(LineCollection(list(_edges(points, part.triangles)), colors=GREY, linewidths=width))
    around = np.concatenate([edges for key, edges in part.boundaries.items() if key != "contact"])
    axes.add_collection(LineCollection(list(points[around]), colors=colour, linewidths=1.0, label=name))
    if "contact" in part.boundaries:
        red = LineCollection(
            list(points[part.boundaries["contact"]]), colors=RED, linewidths=1.6, label="contact boundary"
        )
        axes.add_collection(red)


def _edges(points: Array, triangles: Any) -> Array:
    """Curved edges of the triangles as three points each, shape (e, 3, 2), each edge once."""
    sides = triangles[:, [[0, 3, 1], [1, 4, 2], [2, 5, 0]]].reshape(-1, 3)
    _, once = np.unique(sides[:, 1], return_index=True)
    made: Array = points[sides[once]]
    return made
