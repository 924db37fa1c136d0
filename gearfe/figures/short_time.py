"""Pictures of what goes on over a run: spectra over short times, orders over the speed, measured spectra."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from ..typing import Array
from ..vibration.analysis import Analysed
from ..vibration.short_time import OrderTracks
from ..vibration.spectra import TrainSpectra
from .style import BLUE, COLOURS, ORANGE, new_figure, save, tidy

#: Reference of the levels of accelerations (m/s2), ISO 1683, and how far below the largest one a level is drawn (dB).
REFERENCE, RANGE_DB = 1e-6, 70.0
#: Frequencies (Hz) from and to which is drawn; None: all.
Band = tuple[float, float] | None


def draw_spectrogram(path: Path, made: Analysed, attachment: str, title: str, band: Band = None) -> None:
    """Acceleration at an attachment over time and frequency, and its average beside."""
    name = f"attachment_{attachment}_acceleration_m_per_s2"
    fall, average = made.falls[made.names.index(name)], made.average[:, made.names.index(name)]
    level = _level(fall.amplitude)
    low, high = band or (0.0, float(fall.frequency[-1]))
    seen = (fall.frequency > 0.0) & (fall.frequency >= low) & (fall.frequency <= high)
    top = float(level[:, seen].max(initial=-300.0))
    figure = new_figure(11.5, 5.6)
    axes, side = figure.subplots(1, 2, sharey=True, width_ratios=(4.0, 1.0))
    figure.suptitle(
        f"Normal acceleration at attachment {attachment} over short times\n{title}", fontsize=11, x=0.01, ha="left"
    )
    shown = axes.pcolormesh(
        1e3 * fall.time, 1e-3 * fall.frequency, level.T,
        cmap="magma_r", vmin=top - RANGE_DB, vmax=top, shading="nearest", rasterized=True,
    )  # fmt: skip
    axes.set_xlabel("time  (ms)")
    axes.set_ylabel("frequency  (kHz)")
    axes.set_ylim(1e-3 * low, 1e-3 * high)
    bar = figure.colorbar(shown, ax=axes, pad=0.01)
    bar.set_label("level  (dB re 1 µm/s²)")
    tidy(side)
    side.plot(_level(average)[1:], 1e-3 * fall.frequency[1:], color=BLUE, linewidth=1.0)
    side.set_xlim(top - RANGE_DB, top + 3.0)
    side.set_xlabel("level  (dB)")
    side.set_title(f"mean of {made.parts} parts\nfrom {1e3 * made.start:.4g} ms on", fontsize=9)
    save(figure, path)


def draw_tracks(path: Path, made: Analysed, tracks: OrderTracks, attachment: str, title: str) -> None:
    """Amplitudes of the orders at an attachment, over the speed where it goes one way, else over the time."""
    values = np.abs(tracks.amplitude[:, :, made.names.index(f"attachment_{attachment}_acceleration_m_per_s2")])
    change = np.diff(tracks.speed)
    over_speed = len(change) > 0 and bool((change > 0.0).all() or (change < 0.0).all())
    place = tracks.speed if over_speed else 1e3 * tracks.time
    figure = new_figure(10.5, 5.4)
    axes = figure.add_subplot()
    tidy(axes)
    axes.set_title(f"Orders of the normal acceleration at attachment {attachment}\n{title}", fontsize=11, loc="left")
    for i, order in enumerate(tracks.orders):
        axes.plot(
            place, values[:, i], color=COLOURS[i % len(COLOURS)], linewidth=1.4, label=_named(order, made.mesh_orders)
        )
    if np.isfinite(values).any() and np.nanmax(values) > 0.0:
        axes.set_yscale("log")
        axes.set_ylim(bottom=max(0.7 * float(np.nanmin(values)), 1e-4 * float(np.nanmax(values))))
    axes.set_xlabel("speed of the first shaft  (rad/s)" if over_speed else "time  (ms)")
    axes.set_ylabel("amplitude  (m/s²)")
    axes.legend(fontsize=8.5, frameon=False, ncols=2)
    save(figure, path)


def draw_measured(path: Path, made: Analysed, spectra: TrainSpectra | None, title: str, band: Band = None) -> None:
    """Measured spectra over the computed one, a panel for each attachment."""
    places = list(dict.fromkeys(one.attachment for one in made.measured))
    figure = new_figure(10.5, 1.4 + 3.2 * len(places))
    panels: Any = figure.subplots(len(places), 1, squeeze=False)[:, 0]
    figure.suptitle(f"Measured and computed normal accelerations\n{title}", fontsize=11, x=0.01, ha="left")
    for axes, place in zip(panels, places, strict=True):
        tidy(axes)
        if spectra is not None:
            computed = spectra.amplitude(f"attachment_{place}_acceleration_m_per_s2")
            axes.plot(1e-3 * spectra.spectrum.frequency[1:], computed[1:], color=BLUE, linewidth=1.2, label="computed")
        for colour, one in zip(
            (ORANGE, *COLOURS[2:]), (m for m in made.measured if m.attachment == place), strict=False
        ):
            lines = one.frequency > 0.0
            axes.plot(1e-3 * one.frequency[lines], one.amplitude[lines], color=colour, linewidth=1.0, label=one.name)
        axes.set_yscale("log")
        axes.set_ylabel("amplitude  (m/s²)")
        axes.set_title(f"attachment {place}", fontsize=10, loc="left")
        axes.legend(fontsize=8.5, frameon=False, ncols=3)
        if band is not None:
            axes.set_xlim(1e-3 * band[0], 1e-3 * band[1])
    panels[-1].set_xlabel("frequency  (kHz)")
    save(figure, path)


def _level(amplitude: Array) -> Array:
    """Level of the rms of sines of these amplitudes (dB)."""
    return np.asarray(20.0 * np.log10(np.maximum(np.abs(amplitude), 1e-12) / math.sqrt(2.0) / REFERENCE))


def _named(order: float, meshes: Array) -> str:
    for i, mesh in enumerate(meshes):
        multiple = order / mesh
        if abs(multiple - round(multiple)) < 1e-6 * multiple and round(multiple) >= 1:
            return f"{order:.5g}: {round(multiple)} × mesh {i + 1}"
    return f"{order:.5g}"
