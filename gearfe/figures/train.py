"""Pictures of a gear train's response: curves against the drive's rotation, fields."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..base.typing import Array, IntArray
from ..drivetrain.gearbox.fields import frames
from ..drivetrain.train.gear_train import GearTrain
from ..drivetrain.train.planetary import mesh_families
from ..drivetrain.train.response import TrainResponse
from ..drivetrain.train.statics import static_errors
from ..drivetrain.vibration.analysis import Analysed
from ..drivetrain.vibration.follow import Followed
from ..drivetrain.vibration.report import attachment_acceleration
from ..drivetrain.vibration.spectra import TrainSpectra
from .spectra import draw_measured, draw_power, draw_spectrogram, draw_spectrum, draw_tracks
from .style import BLUE, COLOURS, CYCLE, GREY, RED, fixed, panel, save
from .train_scene import draw_scene

#: First and last place of stretches.
Spans = Sequence[tuple[float, float]]


@dataclass(frozen=True)
class TrainPictures:
    """Pictures of a run, as `gearfe.drivetrain.vibration.files.write_run` takes them.

    Attributes
    ----------
    title
        Of all.
    band
        Frequencies (Hz) from and to which spectra are drawn; None: from 0 to where large lines end.
    most
        End of the colours of the housing's acceleration (m/s2), see `gearfe.figures.train_scene.draw_scene`.
    """

    title: str
    band: tuple[float, float] | None = None
    most: float | None = None

    def curves(self, folder: Path, train: GearTrain, made: Followed, spectra: TrainSpectra, attachment: str) -> None:
        """Draw ``response.png``, ``spectrum.png``, and, where they apply, transmission errors and radiated power.

        Parameters
        ----------
        folder : Path
            Folder of the pictures.
        train : GearTrain
            The train.
        made : Followed
            The run with its curves.
        spectra : TrainSpectra
            Its spectra.
        attachment : str
            Attachment whose acceleration is drawn.
        """
        response = made.curves
        _draw_response(folder / "response.png", response, attachment, self.title, made.mean_force)
        if is_long(response):
            zoom = last_part(response)
            ends = f"{1e3 * zoom.time[0]:.5g} to {1e3 * zoom.time[-1]:.5g} ms"
            _draw_response(folder / "response_zoom.png", zoom, attachment, f"{self.title}; {ends}", made.mean_force)
        if train.drive is not None and any(mesh.stiffness is not None for mesh in train.meshes):
            _draw_transmission(folder / "transmission_error.png", train, response, self.title)
        if train.carriers:
            _draw_load_shares(folder / "load_share.png", train, response, self.title)
        draw_spectrum(folder / "spectrum.png", response, spectra, attachment, self.title, self.band)
        if spectra.power is not None:
            draw_power(folder / "radiated_power.png", response, spectra, spectra.power, self.title, self.band)

    def analysis(self, folder: Path, made: Analysed, spectra: TrainSpectra | None, attachment: str) -> None:
        """Draw ``spectrogram.png``, ``order_tracks.png`` and ``measured.png``, those that have data.

        Parameters
        ----------
        folder : Path
            Folder of the pictures.
        made : Analysed
            The analyses.
        spectra : TrainSpectra or None
            Computed spectra, with which measured ones are compared.
        attachment : str
            Attachment whose acceleration is drawn.
        """
        if made.falls:
            draw_spectrogram(folder / "spectrogram.png", made, attachment, self.title, self.band)
        if made.tracks is not None:
            draw_tracks(folder / "order_tracks.png", made, made.tracks, attachment, self.title)
        if made.measured:
            draw_measured(folder / "measured.png", made, spectra, self.title, self.band)

    def fields(self, path: Path, train: GearTrain, response: TrainResponse, steps: IntArray) -> str:
        """Draw the fields at some output times; return an empty text, or why nothing was drawn.

        Parameters
        ----------
        path : Path
            The file.
        train : GearTrain
            The train.
        response : TrainResponse
            Its motion.
        steps : ndarray of int
            Numbers of the output steps.
        """
        return draw_scene(path, frames(train, response, steps), self.title, self.most)


#: Points of a curve over time that are drawn as a line; of more, the band between least and largest of neighbours is.
TRACED = 3000
#: Periods of the slowest mesh from which on a response is long, and those that the picture of its last part shows.
LONG, ZOOMED = 60.0, 6.0


def is_long(response: TrainResponse) -> bool:
    """Whether single periods of the meshes cannot be told apart in a picture of the whole response."""
    slowest = float(np.min(np.abs(response.mesh_frequencies_Hz), initial=np.inf))
    return bool(np.isfinite(slowest) and (response.time[-1] - response.time[0]) * slowest > LONG)


def last_part(response: TrainResponse) -> TrainResponse:
    """The last periods of the slowest mesh of a response."""
    slowest = float(np.abs(response.mesh_frequencies_Hz).min())
    first = int(np.searchsorted(response.time, response.time[-1] - ZOOMED / slowest))
    first, count = min(first, len(response.time) - 2), len(response.time)
    cut: dict[str, Any] = {
        field.name: values[first:]
        for field in fields(response)
        if isinstance(values := getattr(response, field.name), np.ndarray) and values.shape[:1] == (count,)
    }
    return replace(response, **cut)


def envelope(x: Array, y: Array, most: int = TRACED // 4) -> tuple[Array, Array, Array]:
    """Return the middles of groups of neighbouring samples, and the least and largest value of each group."""
    group = -(-len(x) // most)
    starts = np.arange(0, len(x), group)
    low, high = np.minimum.reduceat(y, starts), np.maximum.reduceat(y, starts)
    after = np.append(y[starts[1:]], y[-1])
    ends = np.minimum(starts + group, len(x)) - 1
    return 0.5 * (x[starts] + x[ends]), np.minimum(low, after), np.maximum(high, after)


def _trace(axes: Any, x: Array, y: Array, colour: str, name: str | None = None) -> None:
    """Draw a curve, or where it has more points than can be seen, the band that holds it."""
    if len(x) <= TRACED:
        axes.plot(x, y, color=colour, linewidth=1.2, label=name)
        return
    middle, low, high = envelope(x, y)
    axes.fill_between(middle, low, high, color=colour, alpha=0.6, linewidth=0.3, label=name)


def _draw_response(path: Path, response: TrainResponse, attachment: str, title: str, mean: Array) -> None:
    """Contact forces, speeds, angular accelerations, and the acceleration at an attachment over the drive's rotation.

    Shafts that turn against the drive are drawn with their sign reversed. `mean`: of each contact force (N).
    """
    sense = float(np.sign(response.drive_angle[-1])) or 1.0
    signs = np.where(np.sign(response.speed.mean(axis=0)) * sense < 0.0, -1.0, 1.0)
    drive = sense if len(signs) else 1.0
    labels = [
        f'"{n}"' if s > 0.0 else f'"{n}" (sign reversed)' for n, s in zip(response.shaft_names, signs, strict=True)
    ]
    means = [f", mean {m / 1e3:.4g} kN" if np.isfinite(m) else "" for m in mean]
    names = [f"mesh {i + 1}{text}" for i, text in enumerate(means)]
    angle, forces = np.degrees(response.drive_angle) * drive, 1e-3 * response.contact_force.T
    speeds, accelerations = (response.speed * signs).T, (response.acceleration * signs).T
    scale, unit = (1e-3, "1000") if np.abs(accelerations).max(initial=0.0) < 1e6 else (1e-6, "10⁶")
    figure = fixed(11.5, 7.6)
    long = "; bands: least to largest value of neighbours" if len(angle) > TRACED else ""
    figure.suptitle(title + long, fontsize=12, x=0.012, y=0.985, ha="left")
    grid = figure.add_gridspec(2, 2, left=0.062, right=0.985, top=0.905, bottom=0.068, hspace=0.3, wspace=0.16)
    axes = [panel(figure.add_subplot(grid[0, 0]), "contact force  (kN)", "a", "contact forces")]
    for colour, name, values, level in zip(CYCLE, names, forces, mean, strict=False):
        _trace(axes[0], angle, values, colour, name)
        if np.isfinite(level):
            axes[0].axhline(1e-3 * level, color=colour, linewidth=0.9, dashes=(6, 4))
    _bars(axes[0], _apart(response, drive))
    axes[0].legend(fontsize=8.5, frameon=False, ncols=2, loc="upper left", bbox_to_anchor=(0.0, 1.0))
    top, low = float(forces.max()), min(0.0, float(forces.min()))
    axes[0].set_ylim(low - 0.04 * (top - low), top + 0.22 * (top - low))
    rows = grid[0, 1].subgridspec(len(speeds), 1, hspace=0.35)
    for number, (colour, label, values) in enumerate(zip(CYCLE, labels, speeds, strict=False)):
        part = figure.add_subplot(rows[number])
        panel(part, "", "b" if number == 0 else "", "shaft speeds" if number == 0 else "")
        _trace(part, angle, values, colour)
        half = max(0.55 * float(np.ptp(values)), 2e-3 * float(np.abs(values).max()), 1e-9)
        middle = 0.5 * float(values.max() + values.min())
        part.set_ylim(middle - 1.15 * half, middle + 1.15 * half)
        part.yaxis.get_major_formatter().set_useOffset(False)
        part.text(1.0, 1.02, label, transform=part.transAxes, fontsize=8.5, color=colour, ha="right", va="bottom")
        if number == len(speeds) // 2:
            part.set_ylabel("speed  (rad/s)")
        axes.append(part)
    turning = panel(
        figure.add_subplot(grid[1, 0]), f"angular acceleration  ({unit} rad/s²)", "c", "angular accelerations"
    )
    for colour, label, values in zip(CYCLE, labels, scale * accelerations, strict=False):
        _trace(turning, angle, values, colour, label)
    turning.legend(fontsize=8.5, frameon=False, ncols=max(1, min(4, len(accelerations))), loc="upper right")
    turning.margins(y=0.14)
    normal = panel(
        figure.add_subplot(grid[1, 1]), "acceleration  (m/s²)", "d", f"normal acceleration at attachment {attachment}"
    )
    _trace(normal, angle, attachment_acceleration(response, attachment), BLUE)
    normal.axhline(0.0, color=GREY, linewidth=0.8)
    axes += [turning, normal]
    for part in axes:
        _span(part, angle)
    for part in axes[1:-3]:
        part.tick_params(labelbottom=False)
    for part in (axes[0], axes[-3], turning, normal):
        part.set_xlabel("rotation of the drive  (deg)")
    save(figure, path)


def _draw_transmission(path: Path, train: GearTrain, response: TrainResponse, title: str) -> None:
    """Dynamic beside static transmission error over the drive's rotation, a panel for each mesh that yields."""
    sense = float(np.sign(response.drive_angle[-1])) or 1.0
    angle, static = np.degrees(response.drive_angle) * sense, static_errors(train, response.drive_angle)
    apart = _apart(response, sense)
    elastic = [i for i, mesh in enumerate(train.meshes) if mesh.stiffness is not None]
    tall = 1.3 + 2.7 * len(elastic)
    figure = fixed(11.5, tall)
    head = f"Transmission error along the line of action\n{title}"
    figure.suptitle(head, fontsize=12, x=0.012, y=0.985, ha="left")
    room = {"top": 1.0 - 0.75 / tall, "bottom": 0.55 / tall, "hspace": 0.32}
    grid = figure.add_gridspec(len(elastic), 1, left=0.062, right=0.985, **room)
    for number, (colour, i) in enumerate(zip(CYCLE, elastic, strict=False)):
        name, still = f"mesh {i + 1}, {response.mesh_names[i]}", static[i]
        axes = panel(figure.add_subplot(grid[number]), "approach  (µm)", "abcdefgh"[number % 8], name)
        moving = 1e6 * response.transmission_error[:, i]
        axes.plot(angle, moving, color=colour, linewidth=1.2, label="dynamic")
        if still is not None:
            axes.plot(angle, 1e6 * still, color="#111827", linewidth=1.0, dashes=(4, 2), label="static")
        low, high = axes.get_ylim()
        axes.set_ylim(low, high + 0.15 * (high - low))
        _bars(axes, [apart[i]])
        axes.legend(fontsize=8.5, frameon=False, ncols=3, loc="upper right")
        _span(axes, angle)
    axes.set_xlabel("rotation of the drive  (deg)")
    save(figure, path)


def _draw_load_shares(path: Path, train: GearTrain, response: TrainResponse, title: str) -> None:
    """Draw the force of each planet mesh over the mean of its kind, over the rotation of the carrier."""
    rolled = train.kinematics
    families = [family for family in mesh_families(train.layout, rolled.phases) if len(family.meshes) > 1]
    late = response.time >= min(response.load_end_s, 0.5 * float(response.time[-1]))
    figure = fixed(11.5, 1.3 + 2.7 * max(1, len(families)))
    head = f"Load sharing of planets: mesh force over the mean of all planets\n{title}"
    figure.suptitle(head, fontsize=12, x=0.012, y=0.985, ha="left")
    tall = 1.3 + 2.7 * max(1, len(families))
    room = {"top": 1.0 - 0.75 / tall, "bottom": 0.55 / tall, "hspace": 0.32}
    grid = figure.add_gridspec(max(1, len(families)), 1, left=0.062, right=0.985, **room)
    for number, family in enumerate(families):
        carrier = next(carrier.shaft for carrier in train.carriers if carrier.name == family.carrier)
        ratio = abs(float(rolled.ratios[train.shaft_number(carrier)])) or 1.0
        angle = ratio * np.abs(np.degrees(response.drive_angle[late]))
        name = f"{family.names[0]}-{family.names[1]} and those like it"
        axes = panel(figure.add_subplot(grid[number]), "share  (-)", "abcdefgh"[number % 8], name)
        shares = response.load_shares(family.meshes)[late]
        for colour, mesh, share in zip(CYCLE, family.meshes, shares.T, strict=False):
            label = f"{response.mesh_names[mesh]}: {share.min():.4g} to {share.max():.4g}"
            axes.plot(angle, share, color=colour, linewidth=1.1, label=label)
        low, high = axes.get_ylim()
        axes.set_ylim(low, high + 0.2 * (high - low))
        axes.legend(fontsize=8.5, frameon=False, ncols=3, loc="upper right")
        _span(axes, angle)
        axes.set_xlabel("rotation of the carrier  (deg)")
    save(figure, path)


def _apart(response: TrainResponse, sense: float) -> list[Spans]:
    """Return rotations of the drive (deg) between which the teeth of each mesh are apart.

    Where curves are the extremes of parts of the run, all of a part in which they are once. Before the load
    comes teeth only just touch: that is not drawn.
    """
    angle = np.degrees(response.drive_angle) * sense
    lost = response.statistics.get("contacts_lost", [None] * len(response.mesh_names))
    found: list[Spans] = []
    loaded = response.time[:-1] >= response.load_end_s
    for number, apart in zip(lost, response.apart.T, strict=True):
        open_ = (
            np.concatenate([[False], (apart[:-1] > 0) & loaded, [False]])
            if number is not None
            else np.zeros(2, dtype=bool)
        )
        turns = np.flatnonzero(np.diff(open_.astype(np.int8)))
        found.append([(float(angle[a]), float(angle[b])) for a, b in turns.reshape(-1, 2)])
    return found


def _bars(axes: Any, apart: Sequence[Spans]) -> None:
    """Bars at the lower edge, one row a mesh, where its teeth are apart."""
    shown = [i for i, spans in enumerate(apart) if spans]
    for row, i in enumerate(shown):
        spans = [(first, last - first) for first, last in apart[i]]
        colour = COLOURS[i % len(COLOURS)] if len(apart) > 1 else RED
        place = (0.012 + 0.03 * row, 0.022)
        label = "teeth apart" if row == 0 else None
        axes.broken_barh(spans, place, transform=axes.get_xaxis_transform(), color=colour, linewidth=0, label=label)


def _span(axes: Any, angle: Array) -> None:
    axes.set_xlim(float(angle[0]), float(angle[-1]) if angle[-1] > angle[0] else float(angle[0]) + 1.0)
