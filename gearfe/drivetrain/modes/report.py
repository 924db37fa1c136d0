"""Tables and summary of the modes of a train."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..train.model import TrainModel
from .critical import Campbell, nearest
from .job import ModesResult
from .orders import TrainOrder
from .whirl import WhirlModes

#: Modes of elastic shafts are kept up to so many times the highest frequency of interest (docs/beams.md).
KEPT = 1.5


def tables(found: Campbell) -> dict[str, dict[str, Any]]:
    """Return the columns of modes.csv and critical_speeds.csv by the names of their files."""
    return {"modes": found.modes.columns(), "critical_speeds": found.columns()}


def summary(result: ModesResult) -> dict[str, Any]:
    """What summary.json says of the modes."""
    modes = result.campbell.modes
    return {
        "speed_start_rad_per_s": float(modes.speeds[0]),
        "speed_stop_rad_per_s": float(modes.speeds[-1]),
        "speeds": len(modes.speeds),
        "free_motions": modes.free,
        "modes": mode_entries(modes),
        "orders": [{"name": order.name, "order": order.order} for order in result.campbell.orders],
        "critical_speeds": [
            {
                "speed_rad_per_s": c.speed, "frequency_Hz": c.frequency, "order": c.cut.name, "mode": c.mode + 1,
                "label": modes.labels[nearest(modes, c.speed)][c.mode], "excited": result.campbell.excited(c),
            }
            for c in result.campbell.met
        ],
        "speed_of_the_drive_rad_per_s": result.speed,
        "nearest_modes": [_margin(result.campbell, order, result.speed) for order in result.campbell.orders],
    }  # fmt: skip


def warnings(result: ModesResult) -> list[str]:
    """Sentences about what a reader must know."""
    band = result.campbell.band_hz
    few = [
        f"shaft {shaft.name}: its own modes are kept up to {shaft.highest_hz:g} Hz, and the band ends at {band:g} Hz: "
        f"modes may be missing there; give highest_frequency_Hz = {KEPT * band:g}"
        for shaft in result.model.train.shafts
        if shaft.sections and shaft.highest_hz < KEPT * band
    ]
    return [*result.model.mesh_notes, *result.model.operating.warnings, *frozen_carriers(result.model), *few]


def frozen_carriers(model: TrainModel) -> list[str]:
    """Return a sentence about modes of trains whose carriers turn in an elastic housing."""
    names = [c.name for c in model.train.carriers if model.train.shaft_number(c.shaft) in model.turned_carriers]
    if not names:
        return []
    return [
        f"modes are those with carrier {' and '.join(names)} at its start position: in an elastic housing they change "
        "as it turns, and hold where it turns slowly against their frequencies"
    ]


def mode_entries(modes: WhirlModes) -> list[dict[str, Any]]:
    """Entries of the modes: what each is at the fastest speed, and its frequency and damping at the slowest one."""
    row = modes.fastest
    first = int(np.argmin(np.abs(modes.speeds)))
    return [
        {
            "name": name,
            "label": modes.labels[row][n],
            "direction": modes.direction[row][n],
            "frequency_Hz": float(modes.frequency[first, n]),
            "frequency_at_the_fastest_speed_Hz": float(modes.frequency[row, n]),
            "damping_ratio": float(modes.damping_ratio[first, n]),
        }
        for n, name in enumerate(modes.names)
    ]


def _margin(found: Campbell, order: TrainOrder, speed: float) -> dict[str, Any]:
    """The mode that lies nearest to an order at a speed (rad/s), and how far away it is."""
    modes, at = found.modes, order.frequency(speed)
    made: dict[str, Any] = {"order": order.name, "frequency_Hz": at, "mode": None, "distance_Hz": None}
    frequencies = modes.at(speed)
    if frequencies is None or not np.isfinite(frequencies).any():
        return made
    n = int(np.nanargmin(np.abs(frequencies - at)))
    return made | {"mode": modes.names[n], "distance_Hz": float(frequencies[n] - at)}
