"""Pictures of planar mechanisms: curves over time, a picture with paths, an animation (GIF, written by Pillow)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from ..base.files import whole_file
from ..base.progress import count, stage
from ..base.quantities import label as axis_label
from ..base.typing import Array
from ..mechanisms.model import Mechanism
from ..mechanisms.results import Results, evaluate, reference_table
from ..multibody import Trajectory
from ..multibody.core.modes import Modes
from .mechanism_field import draw_field
from .mechanism_scene import MOST_NAMES, draw_paths, draw_state, drawn_states, frame
from .style import BLUE, COLOURS, ORANGE, fixed, new_figure, save, tidy

#: Times at which curves are drawn at least: four for each pixel of their width.
LEAST_TIMES = 2000
#: Larger values leave a gap: the ticks of an axis that holds them overflow.
LARGEST_DRAWN = 1e300


@stage("pictures")
def draw_figures(folder: Path, mechanism: Mechanism, results: Results) -> None:
    """curves.png (outputs over time, with reference markers where the file names a table), energy.png, picture.png."""
    trajectory = results.trajectory
    smooth = _between(mechanism, results) if len(trajectory.time) > 1 else results
    if len(trajectory.time) > 1:
        _curves(folder / "curves.png", mechanism, smooth)
        _energy(folder / "energy.png", smooth)
    picture_time = mechanism.file.run.picture_s
    time = trajectory.time[-1] if picture_time is None else min(picture_time, trajectory.time[-1])
    figure = new_figure(7, 6)
    axes = figure.subplots()
    states = drawn_states(mechanism, trajectory)
    draw_paths(axes, mechanism, states)
    frame(axes, mechanism, states)
    width, height = np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())
    names = len(mechanism.file.bodies) <= MOST_NAMES
    if mechanism.file.figure.colour is not None and len(trajectory.time) > 1:
        figure.set_size_inches(8, float(np.clip(5.7 * height / width, 2.6, 8.0)) + 0.9)
        draw_field(axes, mechanism, trajectory, float(time), names=names)
    else:
        figure.set_size_inches(7, float(np.clip(6.1 * height / width, 2.2, 8.0)) + 0.9)
        draw_state(axes, mechanism, trajectory.dense(np.array([time])), names=names)
    axes.set_title(f"{mechanism.file.title or 'mechanism'} at {time:g} s", fontsize=11, loc="left")
    save(figure, folder / "picture.png")
    if mechanism.links:
        _links(folder / "links.png", mechanism, smooth)
    if mechanism.plates:
        _plates(folder / "plates.png", mechanism, results)


def draw_modes(folder: Path, mechanism: Mechanism, q: np.ndarray, modes: Modes) -> None:
    """Draw modes.png: the first six shapes over the state of rest.

    Shapes are drawn with 15 % of the mechanism's length at the largest.

    Parameters
    ----------
    folder : Path
        Folder of the picture.
    mechanism : Mechanism
        The mechanism.
    q : ndarray, shape (size,)
        Coordinates at rest.
    modes : Modes
        Vibrations about it.
    """
    count = min(6, len(modes.rates))
    columns = min(3, count)
    figure = new_figure(4 * columns, 3.4 * -(-count // columns))
    axes = figure.subplots(-(-count // columns), columns)
    size = 0.15 * mechanism.linkage.assembly.length / mechanism.system.units
    for k, ax in enumerate(np.ravel(axes)):
        if k >= count:
            ax.axis("off")
            continue
        shape = modes.shapes[k].real / np.abs(modes.shapes[k].real / mechanism.system.units).max()
        moved = q + size * shape
        draw_state(ax, mechanism, q[None, :], alpha=0.25)
        draw_state(ax, mechanism, moved[None, :])
        frame(ax, mechanism, np.stack([q, moved, q - size * shape]))
        ax.set_title(f"{k + 1}: {modes.frequencies[k]:.4g} Hz", fontsize=9)
    save(figure, folder / "modes.png")


@stage("animation")
def draw_animation(folder: Path, mechanism: Mechanism, trajectory: Trajectory) -> None:
    """animation.gif with the number of frames of the file."""
    from matplotlib.animation import PillowWriter

    frames = mechanism.file.run.frames
    times = np.linspace(trajectory.time[0], trajectory.time[-1], frames)
    states = trajectory.dense(times)
    path = drawn_states(mechanism, trajectory)
    figure = fixed(4.8, 4.2)
    figure.set_dpi(80)
    axes = figure.add_axes((0.16, 0.12, 0.8, 0.8))
    frame(axes, mechanism, path)
    height = float(np.clip(4.0 * np.ptp(axes.get_ylim()) / np.ptp(axes.get_xlim()), 1.2, 4.0))
    figure.set_size_inches(4.8, height + 0.8)
    axes.set_position((0.14, 0.5 / (height + 0.8), 0.84, height / (height + 0.8)))
    writer = PillowWriter(fps=25)
    with whole_file(folder / "animation.gif") as temporary, writer.saving(figure, str(temporary), dpi=80):
        for done, (time, q) in enumerate(zip(times, states, strict=True)):
            count(done, len(times), "frames")
            axes.clear()
            draw_paths(axes, mechanism, path)
            draw_state(axes, mechanism, q[None, :])
            frame(axes, mechanism, path)
            axes.set_title(f"{time:.4g} s", fontsize=9)
            writer.grab_frame()


def _between(mechanism: Mechanism, results: Results) -> Results:
    """Results that curves are drawn from: at the output times, and where these are few at times between them.

    Links of finite elements are left at the output times: their stresses at all these times take too much memory.
    """
    trajectory = results.trajectory
    time, steps = trajectory.time, trajectory.dense.times
    if len(time) >= LEAST_TIMES or len(steps) < 2 or mechanism.plates:
        return results
    begin, end = sorted((time[0], time[-1]))
    inside = steps[(steps > begin) & (steps < end)]
    inside = inside[:: 1 + len(inside) // LEAST_TIMES]
    times = np.unique(np.concatenate([time, inside, np.linspace(begin, end, LEAST_TIMES)]))
    return evaluate(mechanism, replace(trajectory, time=times if time[-1] >= time[0] else times[::-1]))


def _broken(values: Array, period: float | None) -> Array:
    """Leave out the first value of each new turn of a wrapped angle, so that no line joins both ends."""
    if period is None:
        return values
    turns = np.abs(np.diff(values, prepend=values[:1])) > 0.5 * period
    return np.where(turns, np.nan, values)


def _curves(path: Path, mechanism: Mechanism, results: Results) -> None:
    table = mechanism.file.figure
    names = table.curves or tuple(results.outputs)
    if not names:
        return
    time = results.trajectory.time
    reference = reference_table(mechanism)
    height = 1.2 + 1.7 * len(names)
    figure = fixed(8, height)
    room = {"left": 0.13, "right": 0.98, "top": 1.0 - 0.15 / height, "bottom": 0.55 / height, "hspace": 0.12}
    all_axes = figure.subplots(len(names), 1, sharex=True, squeeze=False, gridspec_kw=room)
    shown = False
    for axes, name in zip(all_axes[:, 0], names, strict=True):
        period = next(o.wrap for o in mechanism.file.outputs if o.name == name)
        value = _broken(results.outputs[name], period)
        drawn = np.where(np.abs(value) < LARGEST_DRAWN, value, np.nan)
        axes.plot(time, drawn, lw=1.2, color=BLUE)
        column = table.reference_columns.get(name)
        if reference is not None and column is not None:
            value = reference[column] if period is None else np.mod(reference[column], period)
            axes.plot(
                reference["t"][:: table.every],
                value[:: table.every],
                "o",
                ms=3,
                mfc="none",
                color=ORANGE,
                label="reference",
            )
            if not shown:
                axes.legend(loc="upper right", fontsize=8)
            shown = True
        axes.set_ylabel(axis_label(name).replace(" (", "\n("), fontsize=8)
        tidy(axes)
    all_axes[-1, 0].set_xlabel("time (s)")
    figure.align_ylabels(all_axes[:, 0])
    save(figure, path)


def _energy(path: Path, results: Results) -> None:
    """Energies over time, and below how far their balance, which is constant, moves."""
    time = results.trajectory.time
    figure = new_figure(8, 4.6)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2.4, 1.0))
    names = {"kinetic_J": "kinetic", "potential_J": "potential", "elastic_J": "of it elastic", "work_J": "work put in"}
    for number, (key, label) in enumerate(names.items()):
        if key in results.energy and np.any(results.energy[key]):
            upper.plot(time, results.energy[key], lw=1.3, color=COLOURS[number], label=label)
    total = results.energy["total_J"]
    upper.plot(time, total, lw=1.1, color="black", dashes=(5, 3), label="kinetic + potential − work")
    lower.plot(time, total - total[0], lw=1.1, color="black")
    tidy(upper)
    tidy(lower)
    upper.set_ylabel("energy (J)")
    lower.set_ylabel("drift (J)")
    lower.set_xlabel("time (s)")
    figure.legend(loc="outside upper center", ncols=5, fontsize=8.5, frameon=False)
    save(figure, path)


def _links(path: Path, mechanism: Mechanism, results: Results) -> None:
    """links.png: axial force and bending moment along every link, the range over the run and the last time."""
    count = len(mechanism.links)
    figure = new_figure(11, 1.0 + 2.2 * count)
    rows = figure.subplots(count, 3, squeeze=False)
    for axes, (name, link) in zip(rows, mechanism.links.items(), strict=True):
        s = link.beam.link.stations
        values = [1e3 * link.offsets(results.trajectory.q)[:, :, 1]]
        values += [results.sections[name][:, :, k] for k in (0, 2)]
        for ax, value, label in zip(
            axes, values, ("deflection (mm)", "axial force (N)", "bending moment (N m)"), strict=True
        ):
            ax.fill_between(s, value.min(axis=0), value.max(axis=0), color=BLUE, alpha=0.25, label="over the run")
            ax.plot(s, value[-1], color=BLUE, lw=1.4, label=f"at {results.trajectory.time[-1]:.4g} s")
            ax.set_title(f"{name}: {label}", fontsize=9, loc="left")
            tidy(ax)
        axes[0].legend(fontsize=7)
    for ax in rows[-1]:
        ax.set_xlabel("s (m)")
    save(figure, path)


def _plates(path: Path, mechanism: Mechanism, results: Results) -> None:
    """plates.png: von Mises' stress of every link of finite elements when it is largest, in the link's own frame."""
    count = len(mechanism.plates)
    shapes = [
        np.ptp([link.part.plate.points.real, link.part.plate.points.imag], axis=1) for link in mechanism.plates.values()
    ]
    heights = [float(np.clip(8.0 * y / x, 1.2, 7.0)) for x, y in shapes]
    figure = new_figure(9, sum(heights) + 0.8 * count)
    rows = figure.subplots(count, 1, squeeze=False, height_ratios=heights)[:, 0]
    for axes, (name, link) in zip(rows, mechanism.plates.items(), strict=True):
        when = int(link.largest_von_mises(results.sections[name]).argmax())
        stress = link.von_mises(results.sections[name][when])
        factor = mechanism.file.figure.magnification
        moved = factor * link.displacements(results.trajectory.q[when : when + 1])[0]
        places = link.part.plate.points + moved
        t = link.part.plate.triangles
        small = np.concatenate([t[:, [0, 3, 5]], t[:, [3, 1, 4]], t[:, [5, 4, 2]], t[:, [3, 4, 5]]])
        drawn = axes.tripcolor(places.real, places.imag, small, 1e-6 * stress, shading="gouraud", cmap="viridis")
        axes.set_aspect("equal")
        figure.colorbar(drawn, ax=axes, label="von Mises (MPa)", shrink=0.9)
        note = "" if factor == 1.0 else f", displacements x {factor:g}"
        time = results.trajectory.time[when]
        axes.set_title(f"{name} at {time:.4g} s, when its stress is largest{note}", fontsize=9, loc="left")
        axes.set_xlabel("x (m)")
        axes.set_ylabel("y (m)")
    save(figure, path)
