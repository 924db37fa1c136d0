"""Pictures of a stiffness curve, and of the pressures along the flanks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.errors import InputError
from ..base.typing import Array, IntArray
from ..gears.gearmesh.curve import StiffnessCurve
from ..gears.gearmesh.job import StiffnessJob
from ..gears.gearmesh.periodic import distinct_phases
from ..gears.geometry.derived import single_pair_stretches
from ..gears.geometry.pair import GearPair
from .style import BLUE, GREEN, GREY, ORANGE, RED, headed, new_figure, save, shades, some_of, tidy

if TYPE_CHECKING:
    from ..gears.gearmesh.fields import FlankPressure

#: Positions in the picture of the pressures at most.
MOST_LINES = 12


def stiffness_figure(path: str | Path, job: StiffnessJob, curve: StiffnessCurve, found: Mapping[str, Any]) -> None:
    """Draw secant stiffness, transmission error and load shares over two mesh cycles of the pinion angle.

    Levels of the summary are drawn with them. The transmission error is left out if the load is a given twist.

    Parameters
    ----------
    path : path
        The picture.
    job : StiffnessJob
        The gears and the table.
    curve : StiffnessCurve
        The curve.
    found : mapping
        The summary.
    """
    table, pair, cycle = job.table, job.pair, curve.mesh_cycle
    wrapped, source = distinct_phases(curve.pinion_angle, cycle)
    first = np.unique(source, return_index=True)[1]
    angles = np.concatenate([wrapped, wrapped + cycle, [2 * cycle] if len(wrapped) and wrapped[0] == 0 else []])
    pick = np.concatenate([first, first, first[:1] if len(angles) % 2 else []]).astype(int)
    solved, line = curve.k_mesh[pick], (angles, curve.k_mesh[pick])
    with suppress(InputError):  # positions that do not cover the cycle are joined by straight lines
        fine = np.linspace(0.0, 2 * cycle, 1201)
        line = fine, curve.interpolant(method=table.interpolation)(fine).value
    shares, error = _shares(curve, angles, pick), found["transmission_error"]
    heights = (2.6, *((1.0,) if error is not None else ()), *((1.0,) if shares else ()))
    figure = new_figure(9.0, 1.8 + sum(heights))
    grid = figure.add_gridspec(len(heights), 1, height_ratios=heights)
    upper = axes = figure.add_subplot(grid[0])
    tidy(axes)
    for number, ends in enumerate(np.degrees(single_pair_stretches(pair, 0.0, 2 * cycle))):
        axes.axvspan(*ends, color="#f3f4f6", zorder=0, label=None if number else "one pair in contact (rigid teeth)")
    low, high = 1e-6 * np.nanmin(solved, initial=np.inf), 1e-6 * np.nanmax(solved, initial=-np.inf)
    levels = {"ISO 6336 cγ b": 1e-6 * found["iso_6336"]["c_gamma_times_width_N_per_m"]}
    if found["mesh_stiffness"] is not None:
        levels = {"mean over the cycle": 1e-6 * found["mesh_stiffness"]["mean_N_per_m"], **levels}
    for (label, level), dashes in zip(levels.items(), ((6, 3), (2, 2)), strict=False):
        if low - (high - low) <= level <= high + (high - low):
            axes.axhline(level, color=GREY, linewidth=1.1, dashes=dashes, label=f"{label}: {level:.4g} N/µm")
        else:
            axes.plot([], [], " ", label=f"{label}: {level:.4g} N/µm (off the scale)")
    axes.plot(np.degrees(line[0]), 1e-6 * line[1], color=BLUE, linewidth=2.0, label="k (secant), interpolated")
    look = {"markersize": 4.5, "markerfacecolor": "white"}
    axes.plot(np.degrees(angles), 1e-6 * solved, "o", color=BLUE, label="solved positions", **look)
    failed = np.degrees(angles[curve.failed[pick]])
    if len(failed):
        bottom = axes.get_ylim()[0]
        axes.plot(failed, np.full(len(failed), bottom), "x", color=RED, clip_on=False, label="failed positions")
    axes.set_ylabel("mesh stiffness k  (N/µm)")
    load = f"wheel torque {table.torque_Nm:g} N m" if table.twist_deg is None else _twist(table.twist_deg, curve)
    teeth = f"Gear pair {pair.pinion.teeth}/{pair.wheel.teeth}"
    axes.set_title(f"{teeth}, {load}, plane {table.plane}, law {table.law}", fontsize=11, loc="left")
    axes.set_xlim(*np.degrees(line[0][[0, -1]]))
    axes.margins(y=0.12)
    figure.legend(fontsize=8.5, loc="outside lower center", ncols=3, frameon=False)
    if error is not None:
        axes.tick_params(labelbottom=False)
        axes = figure.add_subplot(grid[1], sharex=upper)
        tidy(axes)
        axes.plot(np.degrees(angles), 1e6 * curve.transmission_error[pick], ".-", color=BLUE, linewidth=1.4)
        axes.set_ylabel("transmission\nerror (µm)")
        axes.set_title(f"peak to peak {error['peak_to_peak_um']:.3g} µm", fontsize=8.5, loc="right")
        axes.margins(y=0.15)
    if shares:
        axes.tick_params(labelbottom=False)
        axes = lower = figure.add_subplot(grid[-1], sharex=upper)
        tidy(lower)
        angles_deg = np.degrees(angles)
        for number, (pair_number, angle, share) in enumerate(shares):
            color = (BLUE, ORANGE, GREEN)[number % 3]
            lower.plot(angle, share, ".-", color=color, linewidth=1.4, markersize=4)
            top = int(np.nanargmax(share))
            place = (angle[top], share[top])
            side = "left" if angle[top] <= angles_deg[0] else "right" if angle[top] >= angles_deg[-1] else "center"
            where = {"xytext": (3 if side == "left" else 0, 4), "textcoords": "offset points", "ha": side}
            lower.annotate(f"pair {pair_number}", place, color=color, fontsize=8, **where)
        lower.set_ylim(-0.03, 1.22)
        lower.set_yticks([0.0, 0.5, 1.0])
        lower.set_ylabel("load share (–)")
    axes.set_xlabel("pinion angle (deg)")
    save(figure, path)


def _twist(twist_deg: float, curve: StiffnessCurve) -> str:
    """A twist, and the torques that it takes."""
    torques = curve.torque_wheel[np.isfinite(curve.torque_wheel)]
    load_text = f" (wheel torque {torques.min():.4g} to {torques.max():.4g} N m)" if len(torques) else ""
    return f"twist {twist_deg:g}°{load_text}"


def _shares(curve: StiffnessCurve, angles: Array, pick: IntArray) -> list[tuple[int, Array, Array]]:
    """For each tooth pair its number and its share of the load against the pinion angle (deg), while it is in contact.

    Pairs are numbered as in the column ``leading_pair``.
    """
    moved = np.round((angles - curve.pinion_angle[pick]) / curve.mesh_cycle)
    leading = curve.leading_pair[pick] - moved
    columns = np.arange(curve.load_share.shape[1])
    number = leading[:, None] - columns
    share = curve.load_share[pick]
    found = []
    for pair in np.unique(number[(share > 0) & np.isfinite(number)])[::-1]:
        mine = np.where(number == pair, share, 0.0).sum(axis=1)
        mine[~np.isfinite(leading)] = np.nan
        carries = np.flatnonzero(mine > 0)
        stretch = slice(max(0, carries[0] - 1), carries[-1] + 2)
        found.append((int(pair), np.degrees(angles[stretch]), mine[stretch]))
    return found


def pressure_figure(path: str | Path, pair: GearPair, pressures: Sequence[tuple[float, list[FlankPressure]]]) -> None:
    """Pressure against the diameter, coloured by the pinion angle: points, and Hertz's ellipses beside them.

    Parameters
    ----------
    pressures
        For each position its pinion angle (deg) and the pressures along its flanks.
    """
    pick = some_of(len(pressures), MOST_LINES)
    lines = [(pressures[i][0], flank) for i in pick for flank in pressures[i][1] if len(flank.shown)]
    angles = [angle for angle, _ in lines] or [0.0]
    several = max(angles) > min(angles)
    shade, scale = shades(min(angles), max(angles) if several else min(angles) + 1.0)
    figure = new_figure(10.5, 4.2)
    both: Any = figure.subplots(1, 2, sharey=True)
    for axes, name in zip(both, ("pinion", "wheel"), strict=True):
        tidy(axes)
        axes.set_title(name, loc="left", fontsize=10)
        axes.set_xlabel("diameter (mm)")
    for angle, flank in lines:
        color = shade(angle)
        for run in _contacts(flank):
            diameter, pressure = 2e3 * flank.radius[run], 1e-6 * flank.pressure[run]
            both[flank.gear].plot(diameter, pressure, ".", markersize=3.0, color=color)
            both[flank.gear].plot(*ellipse(diameter, pressure), linewidth=1.3, color=color)
    both[0].set_ylim(bottom=0.0)  # shared, and only now that both are drawn
    both[0].set_ylabel("contact pressure (MPa)")
    teeth = f"Gear pair {pair.pinion.teeth}/{pair.wheel.teeth}"
    title = f"{teeth}, pressure along the flanks (points; lines: ellipses of the same force and width)"
    headed(figure, title + ("" if several else f" at {angles[0]:g}°"))
    if several:
        bar = figure.colorbar(scale, ax=list(both), pad=0.015, aspect=30)
        bar.set_label("pinion angle (deg)")
    save(figure, path, dpi=120)


def _contacts(flank: FlankPressure) -> list[IntArray]:
    """Points with pressure, those without a gap between them together, from the root to the tip."""
    order = np.argsort(flank.radius, kind="stable")
    carries = order[flank.pressure[order] > 0.0]
    gaps = np.flatnonzero(np.diff(np.flatnonzero(flank.pressure[order] > 0.0)) > 2) + 1
    return [run for run in np.split(carries, gaps) if len(run) > 3]


def ellipse(place: Array, pressure: Array) -> tuple[Array, Array]:
    """Hertz's semi-ellipse with the force and the second moment of a pressure at rising places, as points of a line.

    With the mean m and the variance v of the positions weighted by p it reaches from m - b to m + b, b = 2 sqrt(v). Its
    peak is 2 int p / (pi b) (Johnson, *Contact Mechanics*, 1985, eqs. 4.43 to 4.45).
    """
    load = pressure * np.gradient(place)
    force = load.sum()
    mean = (load * place).sum() / force
    half = 2.0 * np.sqrt((load * (place - mean) ** 2).sum() / force)
    angle = np.linspace(0.0, np.pi, 61)
    return mean - half * np.cos(angle), 2.0 * force / (np.pi * half) * np.sin(angle)
