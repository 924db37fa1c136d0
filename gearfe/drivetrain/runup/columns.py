"""The table of steady states over the speed: a row for each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...base.typing import Array
from ..gearbox.radiation import power_level
from ..modes.critical import RPM
from ..train.response import XYZ
from .condensed import CondensedTrain
from .results import SteadyState


def runup_columns(train: CondensedTrain, states: Sequence[SteadyState], band_hz: float) -> dict[str, Any]:
    """Columns of runup.csv: a row for each steady state, along the curve."""
    model = train.model
    made: dict[str, Any] = {
        "speed_rad_per_s": np.array([s.speed for s in states]),
        "speed_rpm": RPM * np.array([s.speed for s in states]),
        "branch": np.array([s.branch for s in states], dtype=int),
        **stability_columns(states),
        "error_estimate": np.array([s.error for s in states]),
        "beyond_mesh_law": np.array([s.beyond for s in states], dtype=int),
    }
    for i in range(len(model.meshes)):
        force = [s.force[:, i] for s in states]
        error = np.array([np.ptp(s.transmission_error[:, i]) for s in states])
        made |= {
            f"mean_force_{i + 1}_N": np.array([f.mean() for f in force]),
            f"peak_to_peak_force_{i + 1}_N": np.array([np.ptp(f) for f in force]),
            f"least_force_{i + 1}_N": np.array([f.min() for f in force]),
            f"dynamic_factor_{i + 1}": dynamic_factors(train, states, i),
            f"share_without_contact_{i + 1}": np.array([s.apart[i] for s in states]),
            f"peak_to_peak_transmission_error_{i + 1}_um": 1e6 * error,
        }
    rms = np.array([s.rms(band_hz) for s in states]).reshape(len(states), -1)
    for j, name in enumerate(model.bores):
        made[f"acceleration_rms_{name}_m_per_s2"] = rms[:, j]
    made |= bearing_means(model.bores, states, band_hz)
    if all(s.power is not None for s in states):
        made["radiated_power_level_dB"] = np.array([power_level(power_in_band(s, band_hz)) for s in states])
    return made


def bearing_means(bores: Sequence[str], states: Sequence[SteadyState], band_hz: float) -> dict[str, Array]:
    """Mean force of the shaft on each bore, and the rms of what swings about it up to the band."""
    made: dict[str, Array] = {}
    for j, name in enumerate(bores):
        for k, x in enumerate(XYZ):
            lines = [s.bearing[:, j, k] for s in states]
            inside = [(s.frequency > 0.0) & (s.frequency <= band_hz) for s in states]
            made[f"mean_bearing_force_{name}_{x}_N"] = np.array([one[0].real for one in lines])
            made[f"bearing_force_rms_{name}_{x}_N"] = np.array(
                [math.sqrt(0.5 * float((np.abs(one[i]) ** 2).sum())) for one, i in zip(lines, inside, strict=True)]
            )
    return made


def stability_columns(states: Sequence[SteadyState]) -> dict[str, Array]:
    """Columns of the largest multiplier; none without multipliers, NaN where stability is undecided."""
    if any(s.multipliers is None for s in states):
        return {}
    largest = np.array([s.multipliers[0] for s in states if s.multipliers is not None])
    return {
        "stable": [math.nan if s.stable is None else int(s.stable) for s in states],
        "growth_per_s": np.array([s.growth for s in states]),
        "largest_multiplier": np.abs(largest),
        "largest_multiplier_angle_deg": np.degrees(np.abs(np.angle(largest))),
        "multiplier_over_s": np.array([s.span for s in states]),
    }


def dynamic_factors(train: CondensedTrain, states: Sequence[SteadyState], mesh: int) -> Array:
    """Largest size of a mesh's force over the steady one, of all states."""
    steady = abs(float(train.steady[mesh]))
    largest = np.array([largest_force(s, mesh) for s in states])
    return np.asarray(largest / steady) if steady > 0.0 else np.full(len(largest), np.nan)


def power_in_band(state: SteadyState, band_hz: float) -> float:
    """Equivalent radiated power up to a frequency (W)."""
    assert state.power is not None
    return float(state.power[(state.frequency > 0.0) & (state.frequency <= band_hz)].sum())


def largest_force(state: SteadyState, mesh: int) -> float:
    """Largest size of a mesh's force (N)."""
    return float(np.abs(state.force[:, mesh]).max())
