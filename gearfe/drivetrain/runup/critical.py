r"""Critical speeds of a run-up, and which order and mode make a peak of the dynamic factor.

The table, the Campbell diagram and the peaks take the intersections of `gearfe.drivetrain.modes.critical`: the first
two those within the run-up's range, its band, and the multiples asked for. A peak may have any order of its motion,
and a mode above the band. It names an intersection within `NEAR` of its speed, or none.

The order of a peak is the one whose force grew most from the valleys next to it. The loudest order is often loud at
all speeds, without a resonance.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ...base.typing import Array
from ..modes.critical import Campbell, Crossing, campbell, crossings, nearest
from ..modes.orders import train_orders
from ..modes.whirl import WhirlModes, train_modes
from .columns import largest_force
from .orders import OrderCut, named_orders
from .results import SteadyState
from .run_up import RunUp

#: Speeds at which modes are computed; between them frequencies are cubics.
SPEEDS = 13
#: Peaks of the dynamic factor that rise by this part of it over the valleys beside them are critical speeds.
RISE = 0.03
#: A mode belongs to a peak where its meeting with the order lies within this part of the peak's speed: damping of some
#: per cent, steps of the speed and teeth that begin to part move a peak by so much.
NEAR = 0.03
#: Orders that grew less than this part of the one that grew most do not make a peak.
GREW = 0.5


@dataclass(frozen=True, eq=False)
class CriticalSpeeds:
    """Modes of a run-up, and where orders meet them.

    Attributes
    ----------
    campbell
        Modes up to the band, orders of meshes and shafts, and where they meet, within the range of speeds.
    every
        Modes that the motions' lines reach, which peaks may name.
    """

    campbell: Campbell
    every: WhirlModes


def critical_speeds(run: RunUp, multiples: int, shaft_multiples: int = 2) -> CriticalSpeeds:
    """Find where orders meet modes.

    Parameters
    ----------
    run : RunUp
        The run-up.
    multiples, shaft_multiples : int
        Highest multiples of each mesh frequency and of the turns of each shaft in the table and the diagram.
    """
    model = run.train.model
    speeds = np.linspace(run.speeds[0], run.speeds[-1], SPEEDS) if len(run.speeds) > 1 else run.speeds
    highest = (1.0 + NEAR) * max(run.band_hz, *(float(state.frequency.max()) for state in run.states))
    every = train_modes(model, speeds, highest)
    inside = every.inside(run.band_hz)  # first, so that a mode has one number
    every = every.select(np.concatenate([inside, np.setdiff1d(np.arange(every.frequency.shape[1]), inside)]))
    orders = train_orders(model, multiples, shaft_multiples)
    return CriticalSpeeds(campbell(every, orders, run.band_hz), every)


def peaks_of(run: RunUp, critical: CriticalSpeeds) -> list[dict[str, Any]]:
    """Return the peaks of the dynamic factors over the speed, highest first. Each has the order that causes it, and the
    mode that this order meets within `NEAR`. Of the motions that a slow run-up and a slow run-down meet, the larger one
    counts.
    """
    both = list(zip(run.sweep(), run.sweep(up=False), strict=True))
    named, found = named_orders(run), []
    for mesh, line in enumerate(run.train.model.meshes):
        steady = abs(float(run.train.steady[mesh]))
        swept = [max(two, key=partial(largest_force, mesh=mesh)) for two in both]
        values = np.array([largest_force(s, mesh) for s in swept]) / max(steady, 1e-300)
        for at, low, high in _tops(values):
            state = swept[at]
            made = {"speed_rad_per_s": state.speed, "mesh": line.name, "dynamic_factor": float(values[at])}
            found.append({**made, **_cause(critical, named, mesh, state, (swept[low], swept[high]))})
    return sorted(found, key=lambda x: -float(x["dynamic_factor"]))


def _cause(
    critical: CriticalSpeeds, named: Callable[[tuple[int, ...]], OrderCut], mesh: int, state: SteadyState,
    valleys: tuple[SteadyState, SteadyState],
) -> dict[str, Any]:  # fmt: skip
    """Entries of the order that makes a peak and of the mode that it meets; None where no mode is near.

    Parameters
    ----------
    critical : CriticalSpeeds
        Modes.
    named : callable
        Order of a line by its numbers k.
    mesh : int
        Number of the mesh.
    state : SteadyState
        The peak.
    valleys : pair of SteadyState
        The valleys beside it.
    """
    heights = [np.abs(s.lines(s.force[:, mesh])) for s in (state, *valleys)]
    grew: dict[tuple[int, ...], float] = {}
    for waves, number in state.numbers.items():
        beside = [h[s.numbers[waves]] for h, s in zip(heights[1:], valleys, strict=True) if waves in s.numbers]
        grew[waves] = float(heights[0][number] - max(beside, default=0.0)) if number else 0.0  # 0 is the constant
    most = max(grew.values())
    growing = [waves for waves in sorted(grew, key=lambda k: -grew[k]) if grew[waves] >= GREW * most]
    order, crossing = named(growing[0]), None
    for cut in map(named, growing):
        met = crossings(critical.every, [cut], beyond=NEAR)
        near = [c for c in met if abs(c.speed - state.speed) <= NEAR * abs(state.speed)]
        if near:
            order, crossing = cut, max(near, key=partial(_answer, critical.every, mesh, state))
            break
    frequency = float(state.frequency[state.numbers[order.waves]])
    found: dict[str, Any] = {
        "order": " = ".join(order.names),
        "frequency_Hz": frequency,
        "mode": None, "mode_frequency_Hz": None, "mode_distance_Hz": None, "damping_ratio": None,
        "critical_speed_rad_per_s": None,
        "searched_within": NEAR,
    }  # fmt: skip
    if crossing is None:
        return found
    modes, mode = critical.every, crossing.mode
    row = nearest(modes, state.speed)
    frequencies = modes.at(state.speed)
    there = float(modes.frequency[row, mode] if frequencies is None else frequencies[mode])
    beyond = mode >= critical.campbell.modes.frequency.shape[1]
    return found | {
        "mode": modes.names[mode] + (", above band_Hz" if beyond else ""),
        "mode_frequency_Hz": there,
        "mode_distance_Hz": frequency - there,
        "damping_ratio": float(modes.damping_ratio[row, mode]),
        "critical_speed_rad_per_s": crossing.speed,
    }


def _answer(modes: WhirlModes, mesh: int, state: SteadyState, crossing: Crossing[OrderCut]) -> float:
    """How much a mode answers to a force in a mesh: its share of strain there, times its resonance at the order's
    frequency in the state.
    """
    row, mode = nearest(modes, state.speed), crossing.mode
    ratio = crossing.cut.order * abs(state.speed) / (2.0 * math.pi) / modes.frequency[row, mode]
    share, damping = modes.mesh_strain[row, mode, mesh], modes.damping_ratio[row, mode]
    return float(share / abs(1.0 - ratio**2 + 2j * damping * ratio))


def _tops(values: Array) -> list[tuple[int, int, int]]:
    """Places of local maxima that rise over both valleys beside them, and the places of these."""
    found = []
    for at in range(1, len(values) - 1):
        if not values[at - 1] <= values[at] > values[at + 1]:
            continue
        before, after = values[:at][::-1], values[at + 1 :]
        ends = [
            int(np.argmax(part > values[at])) if (part > values[at]).any() else len(part) for part in (before, after)
        ]
        low, high = at - 1 - int(before[: ends[0]].argmin()), at + 1 + int(after[: ends[1]].argmin())
        if values[at] - max(values[low], values[high]) > RISE * values[at]:
            found.append((at, low, high))
    return found
