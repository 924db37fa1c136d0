"""A picture of a whole gearbox: along the axes of its shafts, and from the side."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..drivetrain.gearbox.layout import GearboxLayout, PlacedShaft
from .style import COLOURS, GREY, RED, headed, new_figure

#: Colours of shafts; red is what does not fit.
_SHAFTS = tuple(colour for colour in COLOURS if colour != RED)
_AROUND = np.linspace(0.0, 2.0 * np.pi, 361)


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


def _along_the_axes(axes: Any, layout: GearboxLayout, colours: dict[str, str]) -> None:
    """View along y: x to the right, z up."""
    for gear in layout.gears:
        centre, colour = (gear.centre[0], gear.centre[2]), colours[gear.shaft]
        _circle(axes, centre, gear.tip_radius, color=colour, linewidth=1.3)
        _circle(axes, centre, gear.reference_radius, color=colour, linewidth=0.8, linestyle=(0, (7, 2, 1.5, 2)))
        _circle(axes, centre, gear.bore_radius, color=colour, linewidth=0.7)
    for shaft in layout.shafts:
        x, _, z = shaft.centre
        angle = {"color": colours[shaft.name], "alpha": 0.25}
        axes.fill(1e3 * (x + shaft.radius * np.cos(_AROUND)), 1e3 * (z + shaft.radius * np.sin(_AROUND)), **angle)
        names = "\n".join(f"{gear.name} ({gear.teeth})" for gear in layout.gears if gear.shaft == shaft.name)
        top = max((gear.tip_radius for gear in layout.gears if gear.shaft == shaft.name), default=shaft.radius)
        text = f"{shaft.name}\n{names}"
        axes.annotate(text, (1e3 * x, 1e3 * (z + top)), xytext=(0, 4), textcoords="offset points", ha="center",
                      va="bottom", fontsize=8, color=colours[shaft.name])  # fmt: skip
    low = min(gear.centre[2] - gear.tip_radius for gear in layout.gears)
    high = max(gear.centre[2] + gear.tip_radius for gear in layout.gears)
    height = high - low
    for number, mesh in enumerate(layout.meshes):
        one, two = layout.gear(mesh.driver).centre, layout.gear(mesh.driven).centre
        colour = GREY if mesh.fits else RED
        axes.plot([1e3 * one[0], 1e3 * two[0]], [1e3 * one[2], 1e3 * two[2]], color=colour, linewidth=1.0, marker="+")
        text = f"{mesh.name}: a = {1e3 * mesh.shaft_distance:.6g} mm"
        if not mesh.fits:
            text += f" (gears: {1e3 * mesh.centre_distance:.6g} mm)"
        middle = (500.0 * (one[0] + two[0]), 500.0 * (one[2] + two[2]))
        below = (middle[0], 1e3 * (low - (0.04 + 0.06 * (number % 2)) * height))
        axes.annotate(text, middle, xytext=below, ha="center", va="top", fontsize=8, color=colour,
                      arrowprops={"arrowstyle": "-", "color": colour, "linewidth": 0.5})  # fmt: skip
    axes.set_aspect("equal")
    axes.margins(0.08)
    most = max(sum(gear.shaft == shaft.name for gear in layout.gears) for shaft in layout.shafts)
    axes.set_ylim(1e3 * (low - 0.2 * height), 1e3 * (high + 0.08 * (most + 1) * height))
    axes.set_xlabel("x (mm)")
    axes.set_ylabel("z (mm)")


def _from_the_side(axes: Any, layout: GearboxLayout, colours: dict[str, str], across: int) -> None:
    """View across the axes: y to the right, x or z (0 or 2) up."""
    wrong = {name for mesh in layout.meshes if mesh.overlap <= 0.0 for name in (mesh.driver, mesh.driven)}
    for shaft in layout.shafts:
        _shaft(axes, shaft, colours[shaft.name], across)
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


def _shaft(axes: Any, shaft: PlacedShaft, colour: str, across: int) -> None:
    y, at = shaft.centre[1], shaft.centre[across]
    axes.plot(*_rectangle(y, at, shaft.length, shaft.radius), color=colour, linewidth=1.0)
    ends = 1e3 * np.array([y - 0.55 * shaft.length, y + 0.55 * shaft.length])
    axes.plot(ends, 2 * [1e3 * at], color=colour, linewidth=0.7, linestyle=(0, (7, 2, 1.5, 2)))
    axes.annotate(shaft.name, (ends[1], 1e3 * at), xytext=(3, 0), textcoords="offset points", va="center", fontsize=8,
                  color=colour)  # fmt: skip
    for name, place in shaft.bearings:
        for sign in (-1.0, 1.0):
            axes.plot([1e3 * place], [1e3 * (at + 1.25 * sign * shaft.radius)], marker="s", color=colour, markersize=5)
        text = {"xytext": (0, -6), "textcoords": "offset points", "ha": "center", "va": "top", "fontsize": 7}
        axes.annotate(name, (1e3 * place, 1e3 * (at - 1.25 * shaft.radius)), color=colour, **text)


def _rectangle(y: float, at: float, width: float, half_height: float) -> tuple[list[float], list[float]]:
    low, high = 1e3 * (y - 0.5 * width), 1e3 * (y + 0.5 * width)
    bottom, top = 1e3 * (at - half_height), 1e3 * (at + half_height)
    return [low, high, high, low, low], [bottom, bottom, top, top, bottom]
