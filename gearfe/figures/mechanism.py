"""Pictures of planar mechanisms: curves over time, a picture with paths, an animation (GIF, written by Pillow)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..mechanisms.model import Mechanism
from ..mechanisms.results import Results, reference_table
from ..output.files import whole_file
from ..progress import count, stage
from ..rigid import Trajectory
from ..rigid.modes import Modes
from .style import fixed, new_figure, save_fixed


@stage("pictures")
def draw_figures(folder: Path, mechanism: Mechanism, results: Results) -> None:
    """curves.png (outputs over time, with reference markers where the file names a table) and picture.png."""
    trajectory = results.trajectory
    if len(trajectory.time) > 1:
        _curves(folder / "curves.png", mechanism, results)
    asked = mechanism.file.run.picture_s
    time = trajectory.time[-1] if asked is None else min(asked, trajectory.time[-1])
    figure = fixed(7, 6)
    axes = figure.add_axes((0.12, 0.09, 0.85, 0.84))
    _paths(axes, mechanism, trajectory.q)
    q = trajectory.dense(np.array([time]))
    _draw(axes, mechanism, q)
    _frame(axes, mechanism, trajectory.q)
    axes.set_title(f"{mechanism.file.title or 'mechanism'} at {time:g} s")
    save_fixed(figure, folder / "picture.png")
    if mechanism.links:
        _links(folder / "links.png", mechanism, results)


def draw_modes(folder: Path, mechanism: Mechanism, q: np.ndarray, modes: Modes) -> None:
    """modes.png: the first six shapes, 15 % of the mechanism's length at the largest, over the state of rest."""
    count = min(6, len(modes.rates))
    columns = min(3, count)
    figure = new_figure(4 * columns, 3.4 * -(-count // columns))
    axes = figure.subplots(-(-count // columns), columns)
    size = 0.15 * mechanism.planar.assembly.length / mechanism.system.units
    for k, ax in enumerate(np.ravel(axes)):
        if k >= count:
            ax.axis("off")
            continue
        shape = modes.shapes[k].real / np.abs(modes.shapes[k].real / mechanism.system.units).max()
        moved = q + size * shape
        _draw(ax, mechanism, q[None, :], alpha=0.25)
        ax.set_prop_cycle(None)
        _draw(ax, mechanism, moved[None, :])
        _frame(ax, mechanism, np.stack([q, moved, q - size * shape]))
        ax.set_aspect("equal", adjustable="datalim")
        ax.set_title(f"{k + 1}: {modes.frequencies[k]:.4g} Hz", fontsize=9)
    save_fixed(figure, folder / "modes.png")


@stage("animation")
def draw_animation(folder: Path, mechanism: Mechanism, trajectory: Trajectory) -> None:
    """animation.gif with the number of frames that the file asks for."""
    from matplotlib.animation import PillowWriter

    frames = mechanism.file.run.frames
    times = np.linspace(trajectory.time[0], trajectory.time[-1], frames)
    states = trajectory.dense(times)
    figure = fixed(4.8, 4.2)
    figure.set_dpi(80)
    axes = figure.add_axes((0.16, 0.12, 0.8, 0.8))
    writer = PillowWriter(fps=25)
    with whole_file(folder / "animation.gif") as temporary, writer.saving(figure, str(temporary), dpi=80):
        for done, (time, q) in enumerate(zip(times, states, strict=True)):
            count(done, len(times), "frames")
            axes.clear()
            _paths(axes, mechanism, trajectory.q)
            _draw(axes, mechanism, q[None, :])
            _frame(axes, mechanism, trajectory.q)
            axes.set_title(f"{time:.4g} s", fontsize=9)
            writer.grab_frame()


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
        axes.plot(time, results.outputs[name], lw=1.2)
        column = table.reference_columns.get(name)
        if reference is not None and column is not None:
            period = next(o.wrap for o in mechanism.file.outputs if o.name == name)
            value = reference[column] if period is None else np.mod(reference[column], period)
            axes.plot(reference["t"][:: table.every], value[:: table.every], "o", ms=3, mfc="none", label="reference")
            if not shown:
                axes.legend(loc="upper right", fontsize=8)
            shown = True
        axes.set_ylabel(name, fontsize=8)
        axes.grid(alpha=0.3)
    all_axes[-1, 0].set_xlabel("time in s")
    save_fixed(figure, path)


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
            axes, values, ("deflection in mm", "axial force in N", "bending moment in N m"), strict=True
        ):
            ax.fill_between(s, value.min(axis=0), value.max(axis=0), alpha=0.25, label="over the run")
            ax.plot(s, value[-1], lw=1.4, label=f"at {results.trajectory.time[-1]:.4g} s")
            ax.set_title(f"{name}: {label}", fontsize=9)
            ax.grid(alpha=0.3)
        axes[0].legend(fontsize=7)
    for ax in rows[-1]:
        ax.set_xlabel("s in m")
    save_fixed(figure, path)


def _points(mechanism: Mechanism) -> list[tuple[int, list[tuple[float, float]]]]:
    """Body number and the named points of each body, relative to the mass centre."""
    return [
        (mechanism.scene.body_index[name], [mechanism.point(f"{name}.{p}")[1] for p in table.points_m])
        for name, table in mechanism.file.bodies.items()
        if name not in mechanism.links
    ]


def _place(q: np.ndarray, body: int, point: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    c, s = np.cos(q[:, 3 * body + 2]), np.sin(q[:, 3 * body + 2])
    x, y = point
    return q[:, 3 * body] + c * x - s * y, q[:, 3 * body + 1] + s * x + c * y


def _paths(axes: Any, mechanism: Mechanism, q: np.ndarray) -> None:
    for path in mechanism.file.paths:
        body = mechanism.scene.body_index[path.body]
        if body == len(mechanism.scene.bodies):
            continue
        if isinstance(path.point, str):
            label = f"{path.body}.{path.point}"
            body, point = mechanism.point(label)
        else:
            label = f"{path.body} {path.point}"
            centre = mechanism.file.bodies[path.body].centre_m
            point = (path.point[0] - centre[0], path.point[1] - centre[1])
        axes.plot(*_place(q, body, point), lw=0.7, alpha=0.6, label=label)


def _draw(axes: Any, mechanism: Mechanism, q: np.ndarray, alpha: float = 1.0) -> None:
    """Bodies as outlines of their points, mass centres, points at rest."""
    for body, points in _points(mechanism):
        ends = np.array([[float(a[0]) for a in _place(q, body, p)] for p in points]).reshape(-1, 2)
        centre = np.array([float(a[0]) for a in _place(q, body, (0.0, 0.0))])
        if len(ends) == 1:
            ends = np.vstack([ends, centre])
        loop = ends if len(ends) < 3 else np.vstack([ends, ends[:1]])
        (line,) = axes.plot(loop[:, 0], loop[:, 1], "-o", lw=2, ms=3.5, alpha=alpha)
        axes.plot(*centre, "+", color=line.get_color(), ms=8, alpha=alpha)
    magnification = mechanism.file.figure.magnification
    for link in mechanism.links.values():
        shape = link.exaggerated(q, link.smooth, magnification)[0]
        nodes = link.exaggerated(q, link.beam.link.ends, magnification)[0]
        (line,) = axes.plot(*shape.T, lw=2, alpha=alpha)
        axes.plot(*nodes.T, "o", ms=3, color=line.get_color(), alpha=alpha)
    if mechanism.links and magnification != 1.0:
        axes.text(0.01, 0.01, f"deflections x {magnification:g}", transform=axes.transAxes, fontsize=8)
    for x, y in mechanism.file.ground.points_m.values():
        axes.plot(x, y, "k^", ms=6, mfc="none")


def _frame(axes: Any, mechanism: Mechanism, q: np.ndarray) -> None:
    x: list[float] = []
    y: list[float] = []
    for body, points in _points(mechanism):
        for point in [*points, (0.0, 0.0)]:
            a, b = _place(q, body, point)
            x += [a.min(), a.max()]
            y += [b.min(), b.max()]
    for link in mechanism.links.values():
        shapes = link.exaggerated(q, link.beam.link.ends, mechanism.file.figure.magnification)
        x += [shapes[:, :, 0].min(), shapes[:, :, 0].max()]
        y += [shapes[:, :, 1].min(), shapes[:, :, 1].max()]
    ground = mechanism.file.ground.points_m.values()
    x += [place[0] for place in ground]
    y += [place[1] for place in ground]
    pad = 0.06 * max(max(x) - min(x), max(y) - min(y), 1e-9)
    axes.set_xlim(min(x) - pad, max(x) + pad)
    axes.set_ylim(min(y) - pad, max(y) + pad)
    axes.set_aspect("equal")
    axes.grid(alpha=0.3)
    axes.set_xlabel("x in m")
    axes.set_ylabel("y in m")
