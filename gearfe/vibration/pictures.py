"""From the response of a train to the arguments of `gearfe.figures.train`: units, signs, labels, marks."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import unknown_name
from ..figures.train import Mark, Spans, power_figure, response_figure, spectrum_figure, transmission_figure
from ..spectrum import nearest_line, peaks
from ..train.response import TrainResponse
from ..train.scene import TrainScene
from ..train.static_error import static_errors
from .report import lines_of
from .spectra import TrainSpectra

#: Lines that a picture shows at most: more than it has columns of pixels.
_DRAWN = 2000
#: Lines that are named in the picture of a spectrum, and the least amplitude of such a line in parts of the largest.
_NAMED, _LEAST = 5, 0.2
#: End of the frequency axis: this multiple of the highest mesh frequency, unless larger lines lie above it.
_MESH_MULTIPLES = 4.2


def draw_response(path: Path, response: TrainResponse, attachment: str, title: str, mean: np.ndarray) -> None:
    """Contact forces, speeds, angular accelerations, and the acceleration at an attachment over the drive's rotation.

    Shafts that turn against the drive are drawn with their sign reversed. `mean`: of each contact force (N).
    """
    sense = float(np.sign(response.drive_angle[-1])) or 1.0
    signs = np.where(np.sign(response.speed.mean(axis=0)) * sense < 0.0, -1.0, 1.0)
    drive = sense if len(signs) else 1.0
    labels = [n if s > 0.0 else f"{n} (sign reversed)" for n, s in zip(response.shaft_names, signs, strict=True)]
    told = [f", mean {m / 1e3:.4g} kN" if np.isfinite(m) else "" for m in mean]
    names = [f"mesh {i + 1}{text}" for i, text in enumerate(told)]
    means = {name: m / 1e3 for name, m in zip(names, mean, strict=True) if np.isfinite(m)}
    response_figure(
        path,
        title=title,
        angle=np.degrees(response.drive_angle) * drive,
        forces=dict(zip(names, 1e-3 * response.contact_force.T, strict=True)),
        speeds=dict(zip(labels, (response.speed * signs).T, strict=True)),
        accelerations=dict(zip(labels, 1e-3 * (response.acceleration * signs).T, strict=True)),
        attachment=(f"normal acceleration at attachment {attachment}", _acceleration(response, attachment)),
        means=means,
        apart=dict(zip(names, _apart(response, drive), strict=True)),
    )


def draw_transmission(path: Path, scene: TrainScene, response: TrainResponse, title: str) -> None:
    """Dynamic and static transmission error of the meshes that yield."""
    sense = float(np.sign(response.drive_angle[-1])) or 1.0
    static = static_errors(scene, response.drive_angle)
    apart = _apart(response, sense)
    names = [f"mesh {i + 1}, {name}" for i, name in enumerate(response.mesh_names)]
    elastic = [i for i, mesh in enumerate(scene.meshes) if mesh.stiffness is not None]
    transmission_figure(
        path,
        title=f"Transmission error along the line of action\n{title}",
        angle=np.degrees(response.drive_angle) * sense,
        dynamic={names[i]: 1e6 * response.transmission_error[:, i] for i in elastic},
        static={names[i]: 1e6 * one for i in elastic if (one := static[i]) is not None},
        apart={names[i]: apart[i] for i in elastic},
    )


def _apart(response: TrainResponse, sense: float) -> list[Spans]:
    """Rotations of the drive (deg) between which the teeth of each mesh are apart; none for meshes that do not part.

    Where curves are the extremes of parts of the run, all of a part in which the least force is 0. Before the load
    comes teeth only just touch: that is not told.
    """
    angle = np.degrees(response.drive_angle) * sense
    lost = response.statistics.get("contacts_lost", [None] * len(response.mesh_names))
    found: list[Spans] = []
    loaded = response.time[:-1] >= response.load_end_s
    for number, force in zip(lost, response.contact_force.T, strict=True):
        open_ = (
            np.concatenate([[False], (force[:-1] == 0.0) & loaded, [False]])
            if number is not None
            else np.zeros(2, dtype=bool)
        )
        turns = np.flatnonzero(np.diff(open_.astype(np.int8)))
        found.append([(float(angle[a]), float(angle[b])) for a, b in turns.reshape(-1, 2)])
    return found


def draw_spectrum(path: Path, response: TrainResponse, made: TrainSpectra, attachment: str, title: str) -> None:
    """Amplitude spectrum of the acceleration at an attachment."""
    name, spectrum = f"attachment_{attachment}_acceleration_m_per_s2", made.spectrum
    amplitude = made.amplitude(name)
    lines = lines_of(response, float(spectrum.frequency[-1]))
    named = []
    for peak in peaks(spectrum.frequency, amplitude, _NAMED, above=_LEAST):
        line = nearest_line(peak.frequency, lines, 0.51 * spectrum.resolution)
        what = "" if line is None else f"\n{line.name} × {line.order}"
        named.append((1e-3 * peak.frequency, peak.amplitude, f"{peak.frequency:.0f} Hz: {peak.amplitude:.3g}{what}"))
    window = "no window" if spectrum.window == "none" else f"window: {spectrum.window}"
    highest = _highest(response, made, [f for f, _, _ in named])
    frequency, amplitude = _largest(1e-3 * spectrum.frequency, amplitude, highest)
    spectrum_figure(
        path,
        title=f"Normal acceleration at attachment {attachment}\n{title}",
        frequency=frequency,
        amplitude=amplitude,
        quantity="amplitude  (m/s²)",
        peaks=named,
        marks=_marks(response, made),
        shaft=_first_shaft(response),
        note=f"resolution {spectrum.resolution:.1f} Hz, {window}",
        highest=highest,
    )


def draw_power(path: Path, response: TrainResponse, made: TrainSpectra, title: str) -> None:
    """Level of the equivalent radiated power; the housing is elastic."""
    assert made.power is not None
    found = peaks(made.power.frequency, made.power.power, 3)
    highest = _highest(response, made, [1e-3 * p.frequency for p in found])
    frequency, level = _largest(1e-3 * made.power.frequency, made.power.level, highest)
    power_figure(
        path,
        title=f"Equivalent radiated power of the housing\n{title}",
        frequency=frequency,
        level=level,
        marks=_marks(response, made),
        shaft=_first_shaft(response),
        note=f"mean power {made.power.mean_level:.1f} dB, resolution {made.spectrum.resolution:.1f} Hz",
        highest=highest,
    )


def _largest(frequency: np.ndarray, value: np.ndarray, highest: float) -> tuple[np.ndarray, np.ndarray]:
    """Lines up to `highest`; of so many that they would lie on each other the largest of each group of neighbours.

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


def attachment_to_draw(response: TrainResponse, asked: str | None, loaded: str | None) -> str:
    """Name of the attachment in the pictures: the asked one, else the bore that carries the load's reaction."""
    names = response.attachment_names
    if asked is not None and asked not in names:
        raise unknown_name("--attachment", asked, names)
    if asked is not None:
        return asked
    return loaded if loaded is not None and loaded in names else names[-1]


def _acceleration(response: TrainResponse, attachment: str) -> np.ndarray:
    return np.asarray(response.attachment_acceleration[:, response.attachment_names.index(attachment)])


def _first_shaft(response: TrainResponse) -> tuple[str, float]:
    return response.shaft_names[0], 1e-3 * float(abs(response.shaft_frequencies_Hz[0]))


def _highest(response: TrainResponse, made: TrainSpectra, lines: list[float]) -> float:
    """End of the frequency axis (kHz)."""
    top = 1e-3 * float(made.spectrum.frequency[-1])
    meshes = 1e-3 * float(np.max(np.abs(response.mesh_frequencies_Hz), initial=0.0))
    return min(top, max([_MESH_MULTIPLES * meshes, *(1.08 * f for f in lines)]) or top)


def _marks(response: TrainResponse, made: TrainSpectra) -> list[Mark]:
    first = {f"mesh {i + 1}": f for i, f in enumerate(response.mesh_frequencies_Hz)}
    return [
        Mark(f"{line.name}: {first[line.name]:.1f} Hz and its multiples", str(line.order), 1e-3 * line.frequency)
        for line in lines_of(response, float(made.spectrum.frequency[-1]))
    ]
