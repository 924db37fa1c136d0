"""Draw spectra of a gear train, with labels that do not overlap.

The spectra are the acceleration at an attachment, radiated power, short-time spectra, orders over the speed, and
measured ones.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..base.errors import given
from ..base.octaves import ThirdOctaves, decibels
from ..base.spectrum import nearest_line, peaks
from ..base.typing import Array
from ..drivetrain.gearbox.radiation import RadiatedPower
from ..drivetrain.train.response import TrainResponse
from ..drivetrain.vibration.analysis import Analysed
from ..drivetrain.vibration.report import lines_of, settled
from ..drivetrain.vibration.short_time import OrderTracks
from ..drivetrain.vibration.spectra import TrainSpectra
from .style import (
    BLUE,
    COLOURS,
    GREEN,
    GREY,
    ORANGE,
    RANGE_DB,
    RED,
    Band,
    bars,
    fixed,
    headed,
    level,
    new_figure,
    panel,
    save,
    single,
    tidy,
)

#: Lines that a picture shows at most: more than it has columns of pixels.
_DRAWN = 2000
#: Lines that are named in the picture of a spectrum, and the least amplitude of such a line in parts of the largest.
_NAMED, _LEAST = 5, 0.2
#: Lines this near to a larger one that is named (relative) belong to the same resonance and have no name.
_BESIDE = 0.02
#: End of the frequency axis: this multiple of the highest mesh frequency, unless larger lines lie above it.
_MESH_MULTIPLES = 4.2
#: Numbers of multiples: height of a row (points), and where they stand left of their lines, in parts of the axis.
ROW, MARGIN = 8.5, 0.015
#: Lines of the meshes.
_DASHES = ((0, (6, 3)), (0, (2, 2)), (0, (6, 2, 2, 2)))


class Drawn(NamedTuple):
    """A signal that a picture shows."""

    name: str
    what: str  # in headings
    unit: str
    micro: str  # unit of levels


def drawn_signal(names: Sequence[str], attachment: str, moves: Callable[[str], bool]) -> Drawn:
    """Acceleration at an attachment; in a housing that does not move, the contact force of the first mesh.

    `moves` says of the name of a signal whether it has lines beside its mean.
    """
    name, force = f"attachment_{attachment}_acceleration_m_per_s2", "contact_force_1_N"
    if force in names and not moves(name):
        return Drawn(force, "contact force of mesh 1", "N", "µN")
    return Drawn(name, f"normal acceleration at attachment {attachment}", "m/s²", "µm/s²")


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]


def draw_spectrum(
    path: Path, response: TrainResponse, made: TrainSpectra, attachment: str, title: str, band: Band = None
) -> None:
    """Draw the amplitude spectrum of the acceleration at an attachment, its largest lines named, see `drawn_signal`.

    Parameters
    ----------
    path : Path
        The picture.
    response : TrainResponse
        The motion, whose frequencies name lines.
    made : TrainSpectra
        Its spectra.
    attachment : str
        The attachment.
    title : str
        Second line of the heading.
    band : (float, float), optional
        Lowest and highest frequency drawn (Hz).
    """
    spectrum = made.spectrum
    signal = drawn_signal(made.names, attachment, lambda name: bool(made.amplitude(name)[1:].any()))
    beside = spectrum.frequency > 0.0  # a force has a mean, which is none of its lines
    unit, scale = ("kN", 1e-3) if signal.unit == "N" else (signal.unit, 1.0)
    amplitude = _inside(spectrum.frequency, scale * made.amplitude(signal.name) * beside, band)
    lines = lines_of(response, float(spectrum.frequency[-1]))
    named: list[tuple[float, float, str]] = []
    for peak in peaks(spectrum.frequency, amplitude, 4 * _NAMED, above=_LEAST):
        if len(named) == _NAMED or any(abs(1e-3 * peak.frequency / f - 1.0) < _BESIDE for f, _, _ in named):
            continue
        line = nearest_line(peak.frequency, lines, 0.51 * spectrum.resolution)
        what = "" if line is None else f"\n{line.name} × {line.order}"
        named.append((1e-3 * peak.frequency, peak.amplitude, f"{peak.frequency:.0f} Hz: {peak.amplitude:.3g}{what}"))
    window = "no window" if spectrum.window == "none" else f"window: {spectrum.window}"
    lowest, highest = _ends(response, made, [f for f, _, _ in named], band)
    frequency, amplitude = largest_lines(1e-3 * spectrum.frequency, amplitude, highest)
    figure = fixed(10.5, 4.9)
    head = f"{_capital(signal.what)}\n{title}"
    axes = _frequency_axes(figure, head, response, made, (lowest, highest))
    _note(figure, f"resolution {spectrum.resolution:.1f} Hz, {window}")
    axes.vlines(frequency, 0.0, amplitude, color=BLUE, linewidth=2.2)
    axes.plot(frequency, amplitude, "o", color=BLUE, markersize=3.4, markerfacecolor="white")
    shown = (frequency <= highest) & (frequency > lowest)
    top = float(amplitude[shown].max(initial=0.0)) or 1.0
    axes.set_ylim(0.0, (1.3 + 0.06 * len({line.name for line in lines})) * top)  # rows of numbers are above the names
    label_lines(axes, named, frequency[shown], amplitude[shown], fontsize=8.5)
    axes.set_ylabel(f"amplitude  ({unit})")
    save(figure, path)


def draw_power(
    path: Path, response: TrainResponse, made: TrainSpectra, power: RadiatedPower, title: str, band: Band = None
) -> None:
    """Draw the level of the equivalent radiated power of each line; the housing is elastic.

    Parameters
    ----------
    path : Path
        The picture.
    response : TrainResponse
        The motion, whose frequencies name lines.
    made : TrainSpectra
        Its spectra.
    power : RadiatedPower
        Power of the lines.
    title : str
        Second line of the heading.
    band : (float, float), optional
        Lowest and highest frequency drawn (Hz).
    """
    found = peaks(power.frequency, _inside(power.frequency, power.power, band), 3)
    lowest, highest = _ends(response, made, [1e-3 * p.frequency for p in found], band)
    frequency, loud = largest_lines(1e-3 * power.frequency, power.level, highest)
    octaves = given(made.octaves, "octaves")
    figure = fixed(14.0, 4.8)
    axes = _frequency_axes(
        figure, f"Equivalent radiated power of the housing\n{title}", response, made, (lowest, highest), width=0.52
    )
    weighted = float(decibels(octaves.weighted.sum()))
    _note(
        figure,
        f"mean power {power.mean_level:.1f} dB, A-weighted {weighted:.1f} dB(A); "
        f"resolution {made.spectrum.resolution:.1f} Hz",
    )
    shown = (frequency <= highest) & (frequency > lowest) & np.isfinite(loud)
    top = float(loud[shown].max(initial=-300.0)) if shown.any() else 0.0
    bottom = max(top - 60.0, float(loud[shown].min(initial=300.0)) - 3.0) if shown.any() else -10.0
    width = 0.72 * float(np.median(np.diff(frequency)))
    bars(axes, frequency[shown], loud[shown], width, bottom, BLUE)
    axes.set_ylim(bottom, top + 0.18 * (top - bottom) + 1.0)
    axes.set_ylabel("radiated power level  (dB re 1e-12 W)")
    _draw_octaves(figure.add_axes((0.655, 0.175, 0.335, 0.615)), octaves)
    save(figure, path)


def _draw_octaves(axes: Any, octaves: ThirdOctaves) -> None:
    """Levels in third octaves, plain and A-weighted; bands without a line are empty."""
    panel(axes, "level  (dB re 1e-12 W)", "", "")
    plain, weighted = decibels(octaves.power), decibels(octaves.weighted)
    top = float(np.nanmax(np.append(plain, -300.0)))
    bottom, places = top - 60.0, np.arange(len(plain))
    for values, colour, aside, name in ((plain, BLUE, -0.2, "plain"), (weighted, ORANGE, 0.2, "A-weighted")):
        bars(axes, places + aside, np.maximum(values, bottom), 0.4, bottom, colour, name)
    axes.set_ylim(bottom, top + 9.0)
    axes.set_xlim(-0.7, max(len(plain), 1) - 0.3)
    axes.set_xticks(places, octaves.names)
    axes.tick_params(axis="x", labelrotation=60, labelsize=8)
    axes.set_xlabel("third octave  (Hz)")
    axes.set_title("third octaves (IEC 61260-1), A-weighting by IEC 61672-1", fontsize=9, loc="left")
    axes.legend(fontsize=8.5, frameon=False, ncols=2, loc="upper left")


def _frequency_axes(
    figure: Any,
    title: str,
    response: TrainResponse,
    made: TrainSpectra,
    ends: tuple[float, float],
    *,
    width: float = 0.925,
) -> Any:
    """Axes between two frequencies (kHz) with the meshes' lines and multiples, and orders on top.

    Orders are those of the first shaft that turns. The numbers of each mesh's multiples form a row of their own.
    `width` is that of the axes, in parts of the figure's.
    """
    axes = figure.add_axes((0.062, 0.175, width, 0.615))
    panel(axes, "", "", "")
    head, _, below = title.partition("\n")
    figure.text(0.062, 0.945, head, fontsize=11)
    figure.text(0.062, 0.9, below, fontsize=8.5, color="#374151")
    axes.set_xlim(*ends)
    axes.set_xlabel("frequency  (kHz)")
    first = {f"mesh {i + 1}": f for i, f in enumerate(response.mesh_frequencies_Hz)}
    lines = lines_of(response, float(made.spectrum.frequency[-1]))
    groups = {name: f"{name}: {first[name]:.1f} Hz and its multiples" for name in sorted({line.name for line in lines})}
    named: set[str] = set()
    for line in sorted(lines, key=lambda line: (groups[line.name], str(line.order), line.frequency)):
        place = 1e-3 * line.frequency
        if not ends[0] <= place <= ends[1]:
            continue
        number = list(groups).index(line.name)
        colour, dash = (ORANGE, GREEN, RED, GREY)[number % 4], _DASHES[number % len(_DASHES)]
        label = None if line.name in named else groups[line.name]
        named.add(line.name)
        axes.axvline(place, color=colour, linewidth=1.0, linestyle=dash, zorder=1, label=label)
        last = place > ends[1] - MARGIN * (ends[1] - ends[0])
        axes.annotate(
            str(line.order),
            (place, 1.0),
            (-1.5 if last else 1.5, -3 - ROW * number),
            xycoords=("data", "axes fraction"),
            textcoords="offset points",
            fontsize=7.5,
            color=colour,
            ha="right" if last else "left",
            va="top",
        )
    if named:
        figure.legend(fontsize=8.5, loc="lower center", ncols=4, frameon=False)
    turning = np.flatnonzero(response.shaft_frequencies_Hz)
    if len(turning) and settled(response):
        name, turns = response.shaft_names[turning[0]], 1e-3 * float(abs(response.shaft_frequencies_Hz[turning[0]]))
        above = axes.twiny()
        above.spines[["left", "right", "bottom"]].set_visible(False)
        above.set_xlim(ends[0] / turns, ends[1] / turns)
        above.set_xlabel(f'order of shaft "{name}"', fontsize=9)
        above.tick_params(labelsize=8.5)
    return axes


def _note(figure: Any, note: str) -> None:
    """Small text above: resolution, window, mean."""
    figure.text(0.987, 0.945, note, fontsize=8.5, color="#374151", ha="right")


def largest_lines(frequency: Array, value: Array, highest: float) -> tuple[Array, Array]:
    """Return lines up to `highest`. If they are too many to be drawn, the largest of each group is returned.

    A group stands at the middle of its frequencies, the constant by itself.
    """
    count = int(np.searchsorted(frequency, highest, side="right"))
    group = -(-(count - 1) // _DRAWN)
    if group <= 1:
        return frequency[:count], value[:count]
    starts = np.arange(1, count, group)
    ends = np.append(starts[1:], count)
    middle = 0.5 * (frequency[starts] + frequency[ends - 1])
    return np.append(frequency[0], middle), np.append(value[0], np.maximum.reduceat(value[:count], starts))


def _inside(frequency: Array, values: Array, band: Band) -> Array:
    """Values of a spectrum, 0 outside of a band (Hz)."""
    return values if band is None else np.where((frequency >= band[0]) & (frequency <= band[1]), values, 0.0)


def _ends(response: TrainResponse, made: TrainSpectra, lines: list[float], band: Band) -> tuple[float, float]:
    """Ends of the frequency axis (kHz)."""
    if band is not None:
        return 1e-3 * band[0], 1e-3 * band[1]
    top = 1e-3 * float(made.spectrum.frequency[-1])
    meshes = 1e-3 * float(np.max(np.abs(response.mesh_frequencies_Hz), initial=0.0))
    return 0.0, min(top, max([_MESH_MULTIPLES * meshes, *(1.08 * f for f in lines)]) or top)


def draw_spectrogram(path: Path, made: Analysed, attachment: str, title: str, band: Band = None) -> None:
    """Draw the acceleration at an attachment over time and frequency, and its average next to it.

    Parameters
    ----------
    path : Path
        The picture.
    made : Analysed
        The analyses.
    attachment : str
        The attachment.
    title : str
        Second line of the heading.
    band : (float, float), optional
        Lowest and highest frequency drawn (Hz).
    """
    falls = dict(zip(made.names, made.falls, strict=True))
    signal = drawn_signal(made.names, attachment, lambda name: bool(falls[name].amplitude[:, 1:].any()))
    fall, average = falls[signal.name], made.average[:, made.names.index(signal.name)]
    loud = level(fall.amplitude)
    low, high = band or (0.0, float(fall.frequency[-1]))
    seen = (fall.frequency > 0.0) & (fall.frequency >= low) & (fall.frequency <= high)
    top = float(loud[:, seen].max(initial=-300.0))
    figure = new_figure(11.5, 5.6)
    axes, side = figure.subplots(1, 2, sharey=True, width_ratios=(4.0, 1.0))
    headed(figure, f"{_capital(signal.what)} over short times\n{title}")
    shown = axes.pcolormesh(
        1e3 * fall.time, 1e-3 * fall.frequency, loud.T,
        cmap="magma_r", vmin=top - RANGE_DB, vmax=top, shading="nearest", rasterized=True,
    )  # fmt: skip
    axes.set_xlabel("time  (ms)")
    axes.set_ylabel("frequency  (kHz)")
    axes.set_ylim(1e-3 * low, 1e-3 * high)
    bar = figure.colorbar(shown, ax=axes, pad=0.01)
    bar.set_label(f"level  (dB re 1 {signal.micro})")
    tidy(side)
    side.plot(level(average)[1:], 1e-3 * fall.frequency[1:], color=BLUE, linewidth=1.0)
    side.set_xlim(top - RANGE_DB, top + 3.0)
    side.set_xlabel("level  (dB)")
    side.set_title(f"mean of {made.parts} parts\nfrom {1e3 * made.start:.4g} ms on", fontsize=9)
    save(figure, path)


def draw_tracks(path: Path, made: Analysed, tracks: OrderTracks, attachment: str, title: str) -> None:
    """Draw the amplitudes of orders at an attachment over speed, or over time if the speed turns.

    Parameters
    ----------
    path : Path
        The picture.
    made : Analysed
        The analyses.
    tracks : OrderTracks
        Amplitudes of the orders.
    attachment : str
        The attachment.
    title : str
        Second line of the heading.
    """
    sizes = dict(zip(made.names, np.abs(tracks.amplitude).transpose(2, 0, 1), strict=True))
    signal = drawn_signal(made.names, attachment, lambda name: bool((sizes[name] > 0.0).any()))
    values = sizes[signal.name]
    change = np.diff(tracks.speed)
    over_speed = len(change) > 0 and bool((change > 0.0).all() or (change < 0.0).all())
    place = tracks.speed if over_speed else 1e3 * tracks.time
    figure, axes = single(10.5, 5.4, f"Orders of the {signal.what}\n{title}")
    for i, order in enumerate(tracks.orders):
        axes.plot(
            place, values[:, i], color=COLOURS[i % len(COLOURS)], linewidth=1.4, label=_named(order, made.mesh_orders)
        )
    if np.isfinite(values).any() and np.nanmax(values) > 0.0:
        axes.set_yscale("log")
        axes.set_ylim(bottom=max(0.7 * float(np.nanmin(values)), 1e-4 * float(np.nanmax(values))))
    axes.set_xlabel("speed of the first shaft that turns  (rad/s)" if over_speed else "time  (ms)")
    axes.set_ylabel(f"amplitude  ({signal.unit})")
    axes.legend(fontsize=8.5, frameon=False, ncols=2)
    save(figure, path)


def draw_measured(path: Path, made: Analysed, spectra: TrainSpectra | None, title: str, band: Band = None) -> None:
    """Draw measured spectra over the computed one, a panel for each attachment.

    Parameters
    ----------
    path : Path
        The picture.
    made : Analysed
        The analyses, with the measured spectra.
    spectra : TrainSpectra or None
        Computed spectra.
    title : str
        Second line of the heading.
    band : (float, float), optional
        Lowest and highest frequency drawn (Hz).
    """
    places = list(dict.fromkeys(one.attachment for one in made.measured))
    figure = new_figure(10.5, 1.4 + 3.2 * len(places))
    panels: Any = figure.subplots(len(places), 1, squeeze=False)[:, 0]
    headed(figure, f"Measured and computed normal accelerations\n{title}")
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


def _named(order: float, meshes: Array) -> str:
    for i, mesh in enumerate(meshes):
        multiple = order / mesh
        if abs(multiple - round(multiple)) < 1e-6 * multiple and round(multiple) >= 1:
            return f"{order:.5g}: {round(multiple)} × mesh {i + 1}"
    return f"{order:.5g}"


#: Places that are tried: sideways in parts of a text's width, upwards in its heights.
SIDEWAYS, UPWARDS = (0.0, -0.55, 0.55, -1.0, 1.0, -1.5, 1.5), (0.0, 0.35, 0.7, 1.05, 1.4, 2.1, 2.8, 3.5)
#: Room between texts, and between a text and its point (points of 1/72 inch).
ROOM, ABOVE = 1.5, 5.0


class _Box(NamedTuple):
    left: float
    low: float
    right: float
    high: float

    def meets(self, other: _Box) -> bool:
        return self.left < other.right and other.left < self.right and self.low < other.high and other.low < self.high


def label_lines(axes: Any, labels: Sequence[tuple[float, float, str]], x: Array, y: Array, **look: Any) -> None:
    """Label vertical lines from 0 to (x, y), each at the nearest free position, if there is one.

    Parameters
    ----------
    axes : Axes
        With their final limits.
    labels : sequence of (float, float, str)
        (x, y, text), the most important first.
    x, y : ndarray, shape (n,)
        Tips of all lines, which no label covers.
    **look
        Look of the labels, as of `Axes.text`.
    """
    renderer = axes.figure.canvas.get_renderer()
    scale = axes.figure.dpi / 72.0
    frame = axes.get_window_extent(renderer)
    tips = axes.transData.transform(np.column_stack([x, y]))
    taken: list[_Box] = []
    for at_x, at_y, text in labels:
        note = axes.text(at_x, at_y, text, ha="center", va="bottom", parse_math=False, **look)
        size = note.get_window_extent(renderer)
        note.remove()
        width, height = size.width + 2.0 * ROOM * scale, size.height + 2.0 * ROOM * scale
        tip = axes.transData.transform((at_x, at_y))
        places = sorted(product(SIDEWAYS, UPWARDS), key=lambda place: math.hypot(place[0] * width, place[1] * height))
        for aside, above in places:
            middle = float(np.clip(tip[0] + aside * width, frame.x0 + 0.5 * width, frame.x1 - 0.5 * width))
            low = tip[1] + ABOVE * scale + above * height
            box = _Box(middle - 0.5 * width, low, middle + 0.5 * width, low + height)
            free = box.high < frame.y1 and not any(box.meets(other) for other in taken)
            if free and not np.any((tips[:, 0] > box.left) & (tips[:, 0] < box.right) & (tips[:, 1] > box.low)):
                taken.append(box)
                far = abs(middle - tip[0]) > 0.5 * width or low - tip[1] > 2.0 * ABOVE * scale
                axes.annotate(
                    text, (at_x, at_y), axes.transData.inverted().transform((middle, low)), ha="center", va="bottom",
                    arrowprops={"arrowstyle": "-", "color": GREY, "linewidth": 0.6, "shrinkB": 3.0} if far else None,
                    bbox={"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 0.6}, **look,
                )  # fmt: skip
                break
