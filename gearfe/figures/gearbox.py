"""A picture of a whole gearbox: along the axes of its shafts, and from the side."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..drivetrain.gearbox.layout import GearboxLayout, PlacedMesh, PlacedShaft
from .style import COLOURS, GREY, RED, headed, new_figure

#: Colours of shafts; red is what does not fit.
_SHAFTS = tuple(colour for colour in COLOURS if colour != RED)
_AROUND = np.linspace(0.0, 2.0 * np.pi, 361)
#: Size of names, and width of one of their letters (points).
_FONT, _LETTER = 8, 4.8
#: Width of the view along the axes (points), about.
_PANEL = 340.0


def gearbox_picture(layout: GearboxLayout, title: str = "") -> Any:
    """Two views: circles of gears and shafts with centre distances, and the shafts from the side with their bearings.

    The side view shows x over y, or z over y where the shafts lie further apart in z. Red are distances of shafts that
    the gears do not fit, and gears that do not face each other.
    """
    figure = new_figure(14.0, 7.0)
    along, side = figure.subplots(1, 2, width_ratios=(1.15, 1.0))
    colours = {shaft.name: _SHAFTS[i % len(_SHAFTS)] for i, shaft in enumerate(layout.shafts)}
    spread = [np.ptp([shaft.centre[k] for shaft in layout.shafts]) for k in (0, 2)]
    _along_the_axes(along, layout, colours)
    _from_the_side(side, layout, colours, 0 if spread[0] >= spread[1] else 2)
    headed(figure, title or "Gearbox: along the axes (tip and reference circles, bores), and from the side")
    return figure


def _circle(axes: Any, centre: tuple[float, float], radius: float, **style: Any) -> None:
    axes.plot(1e3 * (centre[0] + radius * np.cos(_AROUND)), 1e3 * (centre[1] + radius * np.sin(_AROUND)), **style)


@dataclass(frozen=True)
class _Box:
    """A text of estimated size (m): its middle, half its width and half its height."""

    x: float
    z: float
    width: float
    height: float

    def distance(self, x: float, z: float) -> float:
        """Distance of a point from the box (m)."""
        return math.hypot(max(abs(x - self.x) - self.width, 0.0), max(abs(z - self.z) - self.height, 0.0))

    def covers(self, other: _Box) -> bool:
        """Whether two texts overlap."""
        wide, high = self.width + other.width, self.height + other.height
        return abs(self.x - other.x) < wide and abs(self.z - other.z) < high


def _middle(layout: GearboxLayout, mesh: PlacedMesh) -> tuple[float, float]:
    """Middle of a line of centres: x, z (m)."""
    one, two = layout.gear(mesh.driver).centre, layout.gear(mesh.driven).centre
    return 0.5 * (one[0] + two[0]), 0.5 * (one[2] + two[2])


def _free_box(
    layout: GearboxLayout, shaft: PlacedShaft, lines: Sequence[str], point: float, boxes: Sequence[_Box]
) -> _Box:
    """Return the position of a shaft's text next to its gears where it overlaps the fewest others.

    Parameters
    ----------
    layout : GearboxLayout
        The gearbox.
    shaft : PlacedShaft
        The shaft.
    lines : sequence of str
        Lines of the text.
    point : float
        Size of a point of the picture (m).
    boxes : sequence of _Box
        The texts that stand already.
    """
    width, height = 0.5 * _LETTER * max(map(len, lines)) * point, 0.65 * _FONT * len(lines) * point
    radii = [gear.tip_radius for gear in layout.gears if gear.shaft == shaft.name]
    reach, (x, _, z) = max(radii, default=shaft.radius) + 4.0 * point, shaft.centre
    up, across = reach + height, reach + width
    others = [gear for gear in layout.gears if gear.shaft != shaft.name]

    middles = [_middle(layout, mesh) for mesh in layout.meshes]  # lines to the distances go down from here

    def covered(box: _Box) -> float:
        """Return the depth (m) by which the text overlaps gears, plus its height for each text or line."""
        on_gears = sum(max(gear.tip_radius - box.distance(gear.centre[0], gear.centre[2]), 0.0) for gear in others)
        on_lines = sum(abs(box.x - middle) < box.width and box.z - box.height < top for middle, top in middles)
        return on_gears + 2.0 * box.height * (on_lines + sum(map(box.covers, boxes)))

    places = ((x, z + up), (x, z - up), (x - across, z), (x + across, z))
    return min((_Box(*place, width, height) for place in places), key=covered)


def _along_the_axes(axes: Any, layout: GearboxLayout, colours: dict[str, str]) -> None:
    """View along y: x to the right, z up."""
    for gear in layout.gears:
        centre, colour = (gear.centre[0], gear.centre[2]), colours[gear.shaft]
        _circle(axes, centre, gear.tip_radius, color=colour, linewidth=1.3)
        _circle(axes, centre, gear.reference_radius, color=colour, linewidth=0.8, linestyle=(0, (7, 2, 1.5, 2)))
        _circle(axes, centre, gear.bore_radius, color=colour, linewidth=0.7)
    left = min(gear.centre[0] - gear.tip_radius for gear in layout.gears)
    right = max(gear.centre[0] + gear.tip_radius for gear in layout.gears)
    low = min(gear.centre[2] - gear.tip_radius for gear in layout.gears)
    high = max(gear.centre[2] + gear.tip_radius for gear in layout.gears)
    point = 1.2 * max(right - left, high - low) / _PANEL  # m
    boxes: list[_Box] = []
    for shaft in layout.shafts:
        x, _, z = shaft.centre
        angle = {"color": colours[shaft.name], "alpha": 0.25}
        if not any(gear.teeth < 0 for gear in layout.gears if gear.shaft == shaft.name):  # a ring has no shaft inside
            axes.fill(1e3 * (x + shaft.radius * np.cos(_AROUND)), 1e3 * (z + shaft.radius * np.sin(_AROUND)), **angle)
        lines = [shaft.name, *(f"{gear.name} ({gear.teeth})" for gear in layout.gears if gear.shaft == shaft.name)]
        box = _free_box(layout, shaft, lines, point, boxes)
        boxes.append(box)
        axes.text(1e3 * box.x, 1e3 * box.z, "\n".join(lines), ha="center", va="center", fontsize=_FONT,
                  color=colours[shaft.name])  # fmt: skip
    low, high = min([low, *(box.z - box.height for box in boxes)]), max([high, *(box.z + box.height for box in boxes)])
    left, right = (
        min([left, *(box.x - box.width for box in boxes)]),
        max([right, *(box.x + box.width for box in boxes)]),
    )
    row, ends = 1.6 * _FONT * point, list[float]()  # height of a row of distances (m), right end of the last in each
    middles = [_middle(layout, mesh)[0] for mesh in layout.meshes]
    for mesh in (layout.meshes[i] for i in np.argsort(middles, kind="stable")):
        one, two = layout.gear(mesh.driver).centre, layout.gear(mesh.driven).centre
        colour = GREY if mesh.fits else RED
        axes.plot([1e3 * one[0], 1e3 * two[0]], [1e3 * one[2], 1e3 * two[2]], color=colour, linewidth=1.0, marker="+")
        text = f"{mesh.name}: a = {1e3 * mesh.shaft_distance:.6g} mm"
        if not mesh.fits:
            text += f" (gears: {1e3 * mesh.centre_distance:.6g} mm)"
        x, z = _middle(layout, mesh)
        half = 0.5 * _LETTER * (len(text) + 2) * point
        number = next((i for i, end in enumerate(ends) if end < x - half), len(ends))
        ends[number : number + 1] = [x + half]
        left, right = min(left, x - half), max(right, x + half)
        below = (1e3 * x, 1e3 * (low - (0.5 + number) * row))
        axes.annotate(text, (1e3 * x, 1e3 * z), xytext=below, ha="center", va="top", fontsize=_FONT, color=colour,
                      arrowprops={"arrowstyle": "-", "color": colour, "linewidth": 0.5})  # fmt: skip
    axes.set_aspect("equal")
    axes.set_xlim(1e3 * (left - row), 1e3 * (right + row))
    axes.set_ylim(1e3 * (low - (1.5 + len(ends)) * row), 1e3 * (high + row))
    axes.set_xlabel("x (mm)")
    axes.set_ylabel("z (mm)")


def _from_the_side(axes: Any, layout: GearboxLayout, colours: dict[str, str], across: int) -> None:
    """View across the axes: y to the right, x or z (0 or 2) up."""
    wrong = {name for mesh in layout.meshes if mesh.overlap <= 0.0 for name in (mesh.driver, mesh.driven)}
    places = [1e3 * shaft.centre[across] for shaft in layout.shafts]
    line = 9.0 * 1.2 * max(np.ptp(places) + 2e3 * max(gear.tip_radius for gear in layout.gears), 1.0) / _PANEL  # mm
    for number, shaft in enumerate(layout.shafts):
        lower = sum(abs(place - places[number]) < line for place in places[:number])  # shafts one behind the other
        _shaft(axes, shaft, colours[shaft.name], across, lower)
    for gear in layout.gears:
        y, at, colour = gear.centre[1], gear.centre[across], RED if gear.name in wrong else colours[gear.shaft]
        corners = _rectangle(y, at, gear.width, gear.tip_radius)
        axes.fill(*corners, facecolor=colour, edgecolor=colour, alpha=0.25)
        axes.plot(*corners, color=colour, linewidth=1.2)
        axes.annotate(gear.name, (1e3 * y, 1e3 * (at + gear.tip_radius)), xytext=(0, 2), textcoords="offset points",
                      ha="center", va="bottom", fontsize=8, color=colour)  # fmt: skip
    axes.set_aspect("equal")
    axes.margins(0.12, 0.06)
    axes.set_xlabel("y (mm)")
    axes.set_ylabel(f"{'xyz'[across]} (mm)")


def _shaft(axes: Any, shaft: PlacedShaft, colour: str, across: int, lower: int) -> None:
    """A shaft with its bearings; its names stand so many lines lower."""
    y, at = shaft.centre[1], shaft.centre[across]
    for low, high, first, last in shaft.outline:
        along = 1e3 * (y + np.array([low, high, high, low, low]))
        axes.plot(along, 1e3 * (at + np.array([-first, -last, last, first, -first])), color=colour, linewidth=1.0)
    ends = 1e3 * np.array([y - 0.55 * shaft.length, y + 0.55 * shaft.length])
    axes.plot(ends, 2 * [1e3 * at], color=colour, linewidth=0.7, linestyle=(0, (7, 2, 1.5, 2)))
    text = {"textcoords": "offset points", "va": "center", "fontsize": _FONT, "color": colour}
    axes.annotate(shaft.name, (ends[1], 1e3 * at), xytext=(3, -10 * lower), **text)
    for name, place in shaft.bearings:
        for sign in (-1.0, 1.0):
            axes.plot([1e3 * place], [1e3 * (at + 1.25 * sign * shaft.radius)], marker="s", color=colour, markersize=5)
        text = {
            "xytext": (0, -6 - 9 * lower),
            "textcoords": "offset points",
            "ha": "center",
            "va": "top",
            "fontsize": 7,
        }
        axes.annotate(name, (1e3 * place, 1e3 * (at - 1.25 * shaft.radius)), color=colour, **text)


def _rectangle(y: float, at: float, width: float, half_height: float) -> tuple[list[float], list[float]]:
    low, high = 1e3 * (y - 0.5 * width), 1e3 * (y + 0.5 * width)
    bottom, top = 1e3 * (at - half_height), 1e3 * (at + half_height)
    return [low, high, high, low, low], [bottom, bottom, top, top, bottom]
