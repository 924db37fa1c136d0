"""Report of a vibration run: means, dominant lines, the summary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...base.errors import given
from ...base.spectrum import OrderLine, nearest_line, order_lines, peaks
from ...base.typing import Array
from ...gears.gearmesh.curve import StiffnessCurve
from ...gears.gearmesh.law import MeshLaw
from ...gears.gearmesh.width_law import WidthLaw
from ..gearbox.radiation import power_level
from ..gearbox.stability import Stability
from ..train.gear_train import GearTrain
from ..train.mesh_element import LEAST_REFERENCE, PHASES
from ..train.response import TrainResponse
from .errors import with_error
from .follow import Followed
from .spectra import TrainSpectra

#: Lines that the summary names for each signal.
NAMED = 5
#: Multiples of the turns of a carrier by which sidebands are named.
SIDES = 6
#: Lines smaller than this part of the largest one are round-off.
LEAST = 1e-6
#: Error estimate over amplitude above which a printed line has a question mark.
UNCERTAIN = 0.5


def fundamentals(response: TrainResponse) -> dict[str, float]:
    """Mesh 1, mesh 2, ... -> frequency (Hz)."""
    return {f"mesh {i + 1}": float(f) for i, f in enumerate(response.mesh_frequencies_Hz)}


def settled(response: TrainResponse) -> bool:
    """Whether the drive turns at one speed in the second half of the run: else a spectrum has no lines of orders."""
    half = len(response.time) // 2
    turn, step = np.diff(response.drive_angle[half:]), np.diff(response.time[half:])
    rate = turn[step > 0.0] / step[step > 0.0]  # the last part of an envelope may be one sample, twice
    return bool(np.ptp(rate) <= 1e-6 * np.abs(rate).max()) if len(rate) else True


def lines_of(response: TrainResponse, highest: float) -> tuple[OrderLine, ...]:
    """Multiples of the mesh frequencies up to `highest` (Hz); none of a speed that changes."""
    return order_lines(fundamentals(response), highest) if settled(response) else ()


def dominant(spectra: TrainSpectra, response: TrainResponse, name: str) -> list[dict[str, Any]]:
    """Largest lines of a signal, each with the multiple of a mesh frequency within one bin of it, or its sideband."""
    spectrum = spectra.spectrum
    lines = lines_of(response, float(spectrum.frequency[-1]))
    turning = np.abs(response.shaft_frequencies_Hz[np.flatnonzero(response.shaft_frequencies_Hz)])
    drive = float(turning[0]) if len(turning) and settled(response) else 0.0
    found = []
    for peak in peaks(spectrum.frequency, spectra.amplitude(name), NAMED, above=LEAST):
        line = nearest_line(peak.frequency, lines, spectrum.resolution)
        found.append(
            {
                "frequency_Hz": peak.frequency,
                "amplitude": peak.amplitude,
                "order_of_first_shaft": peak.frequency / drive if drive > 0.0 else None,
                "near": sideband(peak.frequency, lines, response, spectrum.resolution)
                if line is None
                else f"{line.name} x {line.order}",
            }
        )
    return found


def line_texts(lines: Sequence[Mapping[str, Any]]) -> str:
    """Return the printed form of dominant lines: frequency, amplitude, error estimate, and harmonic or sideband.

    Parameters
    ----------
    lines : sequence of mappings
        Dominant lines of the summary. A line whose error estimate exceeds `UNCERTAIN` times its amplitude gets a
        question mark.
    """
    texts, doubted = [], False
    for line in lines:
        error, amplitude, near = line.get("error_estimate"), line["amplitude"], line.get("near")
        doubtful = error is not None and np.isfinite(error) and error > UNCERTAIN * amplitude
        mark, order = "?" if doubtful else "", f" ({near})" if near else ""
        texts.append(f"{line['frequency_Hz']:.0f} Hz {amplitude:.3g}{mark}{with_error(error)}{order}")
        doubted = doubted or doubtful
    return ", ".join(texts) + ("; ?: error estimate above half of the value" if doubted else "")


def sideband(frequency: float, lines: Sequence[OrderLine], response: TrainResponse, resolution: float) -> str | None:
    """Name the sideband of a planetary stage at a frequency: a multiple of a mesh, less or more turns of a carrier.

    Parameters
    ----------
    frequency : float
        Hz.
    lines : sequence of OrderLine
        Multiples of the mesh frequencies.
    response : TrainResponse
        The motion.
    resolution : float
        Of the spectrum (Hz). Sidebands that are nearer to each other than that have no names.

    Returns
    -------
    name
        As ``mesh 1 x 2 + 1 x carrier arm``; None: no sideband.
    """
    for name, turns in response.carrier_frequencies_Hz.items():
        for times in range(1, SIDES + 1):
            for sign, text in ((-1.0, "-"), (1.0, "+")):
                shifted = frequency - sign * times * turns
                line = nearest_line(abs(shifted), lines, 0.51 * resolution) if turns > resolution else None
                if line is not None and shifted > 0.0:
                    return f"{line.name} x {line.order} {text} {times} x carrier {name}"
                if line is not None:  # the carrier rotates faster than the gears mesh
                    return f"{times} x carrier {name} - {line.name} x {line.order}"
    return None


def train_summary(
    followed: Followed, timings: Mapping[str, float], stability: Stability | None = None, **further: Any
) -> dict[str, Any]:
    """Return the content of summary.json.

    Parameters
    ----------
    followed : Followed
        The run.
    timings : mapping
        Name -> time that a part of the work took (s).
    stability : Stability, optional
        Floquet multipliers with a note and warnings.
    **further
        Entries that are put after the status.
    """
    response, made = followed.response, followed.spectra
    period, stability = response.common_period_s, stability or Stability()
    floquet = stability.multipliers
    summary: dict[str, Any] = {
        "status": response.status,
        "time_reached_s": response.time_reached,
        **further,
        "warnings": [*response.warnings, *stability.warnings],
        "shafts": list(response.shaft_names),
        "meshes": list(response.mesh_names),
        "shaft_frequencies_Hz": response.shaft_frequencies_Hz,
        "mesh_frequencies_Hz": response.mesh_frequencies_Hz,
        "common_period_s": period,
        "coupled_frequencies_Hz": response.coupled_frequencies_Hz,
        "floquet": {
            "largest_multiplier": None if floquet is None else float(np.abs(floquet).max()),
            "multipliers_abs": None if floquet is None else np.abs(floquet)[:12],
            "note": stability.note,
        },
    }
    if followed.outputs >= 2:
        force = followed.mean_force
        summary |= {
            "mean_contact_forces_N": force,
            "mean_over_common_periods": followed.periods,
            "smallest_contact_forces_N": followed.least_force,
            "smallest_contact_forces_under_load_N": followed.least_loaded_force,
            "largest_contact_forces_N": followed.largest_force,
            "peak_attachment_accelerations_m_per_s2": dict(
                zip(response.attachment_names, followed.peak_acceleration, strict=True)
            ),
            "start_attachment_accelerations_m_per_s2": dict(
                zip(response.attachment_names, followed.start_acceleration, strict=True)
            ),
            "response_band_limited": False,
        }
        if len(force) and force[0] != 0.0:
            summary["contact_force_ratios_to_first"] = force / force[0]
        summary["contact"] = contact_summary(followed)
        if any(response.statistics.get("friction_coefficients", ())):
            summary["friction"] = friction_summary(followed)
    if made is not None:
        spectrum = made.spectrum
        summary["spectrum"] = {
            "window": spectrum.window,
            "samples": spectrum.samples,
            "start_s": made.start,
            "resolution_Hz": spectrum.resolution,
            "highest_Hz": spectrum.frequency[-1],
            "motion_sampled_every_us": 1e6 * made.step / made.every,
        }
        summary["dominant_lines"] = {
            n: dominant(made, response, n)
            for n in made.names
            if _named(n) or (response.carrier_frequencies_Hz and n.startswith("bearing_"))
        }
        if made.power is not None:
            found = peaks(made.power.frequency, made.power.power, NAMED)
            summary["radiated_power"] = {
                "mean_W": made.power.mean,
                "mean_level_dB": made.power.mean_level,
                "mean_below_highest_Hz_W": made.power.power.sum() / spectrum.noise_bandwidth,
                "a_weighted_level_dBA": float(power_level(given(made.octaves, "octaves").weighted.sum())),
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


def _named(signal: str) -> bool:
    """Whether the summary names the largest lines of a signal of any train; spectrum.csv has those of all."""
    return "absolute" not in signal and not signal.startswith("bearing_")


def contact_summary(followed: Followed) -> dict[str, Any]:
    """For each mesh which flanks bear, when they part, and the largest force over the steady one (K_v)."""
    statistics = followed.response.statistics
    steady = np.abs(np.asarray(statistics.get("steady_forces_N", np.zeros(len(followed.largest_force))), dtype=float))
    largest = np.maximum(np.abs(followed.largest_force), np.abs(followed.least_force))
    factors = [float(most / one) if one > 0.0 else None for most, one in zip(largest, steady, strict=True)]
    names = ("flanks", "contacts_lost", "contacts_regained", "share_without_contact", "longest_without_contact_s")
    shared = {name: statistics[name] for name in names if name in statistics}
    return {**shared, "dynamic_factors": factors}


def friction_summary(followed: Followed) -> dict[str, Any]:
    """Coefficients of friction, and mean powers and efficiency of the meshes over the times of the mean forces.

    The efficiency is what leaves a mesh over what enters it, 1 - loss/power where its driver drives. 0 where friction
    takes all; None where nothing enters.
    """
    power, loss = followed.mean_power, followed.mean_loss
    entering = np.where(power > 0.0, power, loss - power)
    efficiency = [max(0.0, 1.0 - b / a) if a > 0.0 else None for a, b in zip(entering, loss, strict=True)]
    return {
        "coefficients": followed.response.statistics["friction_coefficients"],
        "mean_mesh_power_W": power,
        "mean_loss_W": loss,
        "mean_loss_of_all_meshes_W": float(loss.sum()),
        "efficiency": efficiency,
    }


def stiffness_ranges(train: GearTrain) -> dict[str, tuple[float | None, float | None]]:
    """Mesh -> smallest and largest stiffness (N/m), of a mesh law its tangent under the steady force; None for a rigid
    mesh.
    """
    found: dict[str, tuple[float | None, float | None]] = {}
    for mesh, steady in zip(train.meshes, train.kinematics.steady_forces, strict=True):
        given = mesh.stiffness
        if given is None or isinstance(given, float | int):
            found[mesh.name] = (given, given)
        elif isinstance(given, MeshLaw | WidthLaw):
            force = max(abs(float(steady)), LEAST_REFERENCE * given.largest_force)
            angles = given.nodes[0] + given.cycle * np.linspace(0.0, 1.0, PHASES)
            tangent = given(angles, given.approach(angles, force)).tangent
            found[mesh.name] = (float(tangent.min()), float(tangent.max()))
        else:
            values = given.k_mesh if isinstance(given, StiffnessCurve) else mesh.interpolant().values
            found[mesh.name] = (float(np.nanmin(values)), float(np.nanmax(values)))
    return found


def attachment_acceleration(response: TrainResponse, attachment: str) -> Array:
    """Normal acceleration at an attachment (m/s2), shape (n,)."""
    return np.asarray(response.attachment_acceleration[:, response.attachment_names.index(attachment)])
