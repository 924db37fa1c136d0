"""What the vibration command tells: columns of its tables, means, dominant lines, the summary."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..spectrum import (
    OrderLine,
    Spectrum,
    aliasing_warning,
    amplitude_spectrum,
    nearest_line,
    order_lines,
    peaks,
    uniform_step,
)
from ..stiffness.curve import StiffnessCurve
from ..train.response import TrainResponse
from ..train.scene import TrainScene
from .radiation import RadiatedPower, instantaneous_power, radiated_power

Array = NDArray[np.float64]

#: Columns of response.csv that are no signals of the spectrum.
NO_SIGNALS = ("time_s", "drive_angle_deg", "instantaneous_radiated_power_W")
#: Lines that the summary names for each signal.
NAMED = 5
#: Lines smaller than this part of the largest one are round-off.
LEAST = 1e-6


@dataclass(frozen=True, eq=False)
class TrainSpectra:
    """Spectra of all signals over one record.

    Attributes
    ----------
    names
        Signals, as in response.csv.
    spectrum
        One column a signal.
    power
        Equivalent radiated power; None for a rigid housing.
    start, step
        Time of the first sample and between samples (s).
    """

    names: tuple[str, ...]
    spectrum: Spectrum
    power: RadiatedPower | None
    start: float
    step: float

    def amplitude(self, name: str) -> Array:
        """(m,) amplitudes of a signal."""
        return self.spectrum.amplitude[:, self.names.index(name)]

    def columns(self) -> dict[str, Array]:
        """Columns of spectrum.csv."""
        amplitude = self.spectrum.amplitude
        made = {"frequency_Hz": self.spectrum.frequency}
        made |= {name: amplitude[:, i] for i, name in enumerate(self.names)}
        if self.power is not None:
            made |= {"radiated_power_W": self.power.power, "radiated_power_level_dB": self.power.level}
        return made


def response_columns(response: TrainResponse, radiation: Array | None = None) -> dict[str, Array]:
    """Columns of response.csv; `radiation` is the housing's surface matrix."""
    made = {"time_s": response.time, "drive_angle_deg": np.degrees(response.drive_angle)}
    for i in range(len(response.mesh_names)):
        made[f"contact_force_{i + 1}_N"] = response.contact_force[:, i]
    shafts = list(enumerate(response.shaft_names))
    made |= {f"speed_{name}_rad_per_s": response.speed[:, i] for i, name in shafts}
    made |= {f"acceleration_{name}_rad_per_s2": response.acceleration[:, i] for i, name in shafts}
    for i, name in enumerate(response.attachment_names):
        made[f"attachment_{name}_acceleration_m_per_s2"] = response.attachment_acceleration[:, i]
    made |= {f"speed_absolute_{name}_rad_per_s": response.speed_absolute[:, i] for i, name in shafts}
    made |= {f"acceleration_absolute_{name}_rad_per_s2": response.acceleration_absolute[:, i] for i, name in shafts}
    if radiation is not None and response.modal_velocity is not None:
        made["instantaneous_radiated_power_W"] = instantaneous_power(radiation, response.modal_velocity)
    return made


def spectra(
    response: TrainResponse,
    radiation: Array | None = None,
    *,
    window: str = "none",
    start: float = 0.0,
    length: float | None = None,
) -> TrainSpectra:
    """Spectra of all signals of a response.

    The record holds its first sample and not its last: n steps are n samples, as a period that repeats has them, so
    7 ms in 200 steps give lines 1/(7 ms) apart.

    Parameters
    ----------
    window
        See `gearfe.spectrum.WINDOWS`.
    start, length
        Begin and duration of the record (s); by default all of it.

    Raises
    ------
    InputError
        A record that is longer than the response or has fewer than two samples.
    """
    step = uniform_step(response.time)
    first, count = record(response.time, start, length)
    columns = {n: v for n, v in response_columns(response).items() if n not in NO_SIGNALS}
    options: dict[str, Any] = {"window": window, "start": first, "length": count}
    spectrum = amplitude_spectrum(np.column_stack(list(columns.values())), step, **options)
    power = None
    if radiation is not None and response.modal_velocity is not None:
        power = radiated_power(radiation, response.modal_velocity, step, **options)
    return TrainSpectra(tuple(columns), spectrum, power, float(response.time[first]), step)


def record(time: Array, start: float = 0.0, length: float | None = None) -> tuple[int, int]:
    """First sample and number of samples of the record of a spectrum; see `spectra`."""
    step = uniform_step(time)
    available = len(time) - 1
    first = round((start - float(time[0])) / step)
    if not 0 <= first <= available - 2:
        problem = f"must leave two samples at least of {time[0]:g}..{time[-1]:g} s"
        raise InputError("spectrum start", start, problem, "begin earlier")
    count = available - first if length is None else round(length / step)
    if count > available - first:
        problem = f"the window is longer than the signal, which has {(available - first) * step:g} s from its start"
        raise InputError("window length", length, problem, "shorten the window or compute for longer")
    if count < 2:
        raise InputError("window length", length, f"is less than two steps of {step:g} s", "lengthen the window")
    return first, count


def mean_over_periods(time: Array, values: Array, begin: float, period: float | None) -> tuple[Array, int]:
    """Mean over the last whole periods after `begin`, and how many these are.

    The integral is that of a cubic spline through the samples, so its ends need not lie on them. Without a whole period
    (or without any) the mean is that of all times after `begin`, and the number 0.

    Parameters
    ----------
    time : (n,)
    values : (n, k)
    begin
        Where the start-up ends (s).
    period
        Common period (s) or None.
    """
    from scipy.interpolate import CubicSpline

    end = float(time[-1])
    count = 0 if not period else int((end - begin) / period * (1.0 + 1e-12))
    low = end - count * period if count and period else min(begin, float(time[-2]))
    return np.asarray(CubicSpline(time, values).integrate(max(low, float(time[0])), end)) / (end - low), count


def fundamentals(response: TrainResponse) -> dict[str, float]:
    """Mesh 1, mesh 2, ... -> frequency (Hz)."""
    return {f"mesh {i + 1}": float(f) for i, f in enumerate(response.mesh_frequencies_Hz)}


def lines_of(response: TrainResponse, highest: float) -> tuple[OrderLine, ...]:
    """Multiples of the mesh frequencies up to `highest` (Hz)."""
    return order_lines(fundamentals(response), highest)


def dominant(spectra: TrainSpectra, response: TrainResponse, name: str, count: int = NAMED) -> list[dict[str, Any]]:
    """Largest lines of a signal, each with the multiple of a mesh frequency within one bin of it, if there is one."""
    spectrum = spectra.spectrum
    lines = lines_of(response, spectrum.nyquist)
    drive = float(abs(response.shaft_frequencies_Hz[0]))
    found = []
    for peak in peaks(spectrum.frequency, spectra.amplitude(name), count, above=LEAST):
        line = nearest_line(peak.frequency, lines, spectrum.resolution)
        found.append(
            {
                "frequency_Hz": peak.frequency,
                "amplitude": peak.amplitude,
                "order_of_first_shaft": peak.frequency / drive if drive > 0.0 else None,
                "near": None if line is None else f"{line.name} x {line.order}",
            }
        )
    return found


def train_summary(
    response: TrainResponse, made: TrainSpectra | None, timings: Mapping[str, float], **further: Any
) -> dict[str, Any]:
    """Content of summary.json; `further` entries are put after the status."""
    period, floquet = response.common_period_s, response.floquet
    summary: dict[str, Any] = {
        "status": response.status,
        "time_reached_s": response.time_reached,
        **further,
        "warnings": all_warnings(response, made),
        "shafts": list(response.shaft_names),
        "meshes": list(response.mesh_names),
        "shaft_frequencies_Hz": response.shaft_frequencies_Hz,
        "mesh_frequencies_Hz": response.mesh_frequencies_Hz,
        "common_period_s": period,
        "coupled_frequencies_Hz": response.coupled_frequencies_Hz,
        "floquet": {
            "largest_multiplier": None if floquet is None else float(np.abs(floquet).max()),
            "multipliers_abs": None if floquet is None else np.abs(floquet)[:12],
            "note": response.floquet_note,
        },
    }
    if len(response.time) >= 4:
        loaded = response.time >= response.load_end_s
        force, count = mean_over_periods(response.time, response.contact_force, response.load_end_s, period)
        summary |= {
            "mean_contact_forces_N": force,
            "mean_over_common_periods": count,
            "smallest_contact_forces_N": response.contact_force.min(axis=0),
            "smallest_contact_forces_under_load_N": response.contact_force[loaded if loaded.any() else ...].min(axis=0),
            "largest_contact_forces_N": response.contact_force.max(axis=0),
            "peak_attachment_accelerations_m_per_s2": dict(
                zip(response.attachment_names, np.abs(response.attachment_acceleration).max(axis=0), strict=True)
            ),
        }
        if len(force) and force[0] != 0.0:
            summary["contact_force_ratios_to_first"] = force / force[0]
    if made is not None:
        spectrum = made.spectrum
        summary["spectrum"] = {
            "window": spectrum.window,
            "samples": spectrum.samples,
            "start_s": made.start,
            "resolution_Hz": spectrum.resolution,
            "nyquist_Hz": spectrum.nyquist,
        }
        summary["dominant_lines"] = {n: dominant(made, response, n) for n in made.names if "absolute" not in n}
        if made.power is not None:
            found = peaks(made.power.frequency, made.power.power, NAMED)
            summary["radiated_power"] = {
                "mean_W": made.power.mean,
                "mean_level_dB": made.power.mean_level,
                "largest_lines": [
                    {"frequency_Hz": p.frequency, "power_W": p.amplitude, "level_dB": made.power.level[p.bin]}
                    for p in found
                ],
            }
    summary |= {
        "integration": dict(response.statistics),
        "error_estimates": dict(response.estimates),
        "timings_s": dict(timings),
    }
    return summary


def stiffness_ranges(scene: TrainScene) -> dict[str, tuple[float | None, float | None]]:
    """Mesh -> smallest and largest stiffness (N/m); None for a rigid mesh."""
    found: dict[str, tuple[float | None, float | None]] = {}
    for mesh in scene.meshes:
        given = mesh.stiffness
        if given is None or isinstance(given, float | int):
            found[mesh.name] = (given, given)
        else:
            values = given.k_mesh if isinstance(given, StiffnessCurve) else given.values
            found[mesh.name] = (float(np.nanmin(values)), float(np.nanmax(values)))
    return found


def all_warnings(response: TrainResponse, made: TrainSpectra | None) -> list[str]:
    """Warnings of the response, and of modes that the output step folds into the spectrum."""
    said = list(response.warnings)
    if made is None:
        return said
    folded = aliasing_warning(response.coupled_frequencies_Hz, made.step, response.estimates.get("folding"))
    return [*said, folded] if folded else said
