r"""Critical speeds: where orders meet modes, and which order and mode make a peak of the dynamic factor.

An order :math:`n` (cycles in a turn of the drive) and a mode of the natural frequency :math:`f(\Omega)` meet at the
speed at which :math:`n\,\Omega/2\pi = f(\Omega)`. The table, the Campbell diagram and the peaks have the same meetings:
the first two those within the run-up's range, band and `multiples`; a peak may have others, too, and names one that
lies within `NEAR` of its speed, or none.

The order of a peak is the one whose force grew most from the valleys beside it: the loudest order is often loud at all
speeds, without a resonance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ...base.typing import Array
from .columns import largest_force
from .modes import CoupledModes, coupled_modes, modes_below
from .orders import OrderCut, multiples_of, orders
from .results import SteadyState
from .run_up import RunUp

#: Speeds of the Campbell diagram.
CAMPBELL = 7
#: Peaks of the dynamic factor that rise by this part of it over the valleys beside them are critical speeds.
RISE = 0.03
#: A mode belongs to a peak where its meeting with the order lies within this part of the peak's speed: damping of some
#: per cent, steps of the speed and teeth that begin to part move a peak by so much.
NEAR = 0.03
#: Orders that grew less than this part of the one that grew most do not make a peak.
GREW = 0.5
#: Multiples of the mesh frequencies that are searched for the order of a peak, at most.
MOST_MULTIPLES = 50


@dataclass(frozen=True)
class Crossing:
    """An order that meets a mode: a critical speed.

    Attributes
    ----------
    speed
        Of the drive (rad/s).
    frequency
        Hz.
    mode
        Number of the mode, from 0.
    cut
        The order.
    """

    speed: float
    frequency: float
    mode: int
    cut: OrderCut


@dataclass(frozen=True, eq=False)
class CriticalSpeeds:
    """Where orders meet modes.

    Attributes
    ----------
    modes
        Up to the band of the run-up.
    met
        Meetings within the range of speeds, the band, and so many multiples of each mesh frequency as the job asks for,
        by speed.
    cuts
        Orders that may make a peak: those of orders.csv and farther multiples of the meshes' frequencies.
    wider_modes, wider
        Modes and meetings of `cuts` that peaks may have: also beyond the band and the ends of the range.
    """

    modes: CoupledModes
    met: list[Crossing]
    cuts: list[OrderCut]
    wider_modes: CoupledModes
    wider: list[Crossing]


def critical_speeds(run: RunUp, multiples: int) -> CriticalSpeeds:
    """Find where orders meet modes; `multiples` of each mesh frequency are shown."""
    speeds, meshes = np.linspace(run.speeds[0], run.speeds[-1], CAMPBELL), range(len(run.train.model.meshes))
    highest = (1.0 + NEAR) * max(run.band_hz, *(float(state.frequency.max()) for state in run.states))
    cuts = {cut.waves: cut for cut in orders(run, multiples)}
    for mesh in meshes:
        once = float(run.train.model.kinematics.cycles[mesh]) * float(np.abs(run.speeds).min()) / (2.0 * math.pi)
        most = min(MOST_MULTIPLES, math.ceil(highest / once))
        for cut in multiples_of(run, mesh, most)[multiples:]:
            known = cuts.get(cut.waves)
            cuts[cut.waves] = cut if known is None else known._replace(names=(*known.names, *cut.names))
    searched, shown = list(cuts.values()), [cut for mesh in meshes for cut in multiples_of(run, mesh, multiples)]
    wider = coupled_modes(run.train, speeds, highest)
    modes = modes_below(run.train, wider, run.band_hz)
    return CriticalSpeeds(modes, crossings(modes, shown), searched, wider, crossings(wider, searched, beyond=NEAR))


def crossings(modes: CoupledModes, cuts: Sequence[OrderCut], beyond: float = 0.0) -> list[Crossing]:
    """Where orders meet modes, by speed.

    Parameters
    ----------
    beyond
        How far beyond the ends of the speeds, in parts of them: natural frequencies are taken as at the ends there.
    """
    sense = math.copysign(1.0, float(modes.speeds[0]))
    speeds, frequency = np.abs(modes.speeds), modes.frequency
    if beyond > 0.0:
        outward = math.copysign(beyond, speeds[-1] - speeds[0])
        speeds = np.array([(1.0 - outward) * speeds[0], *speeds, (1.0 + outward) * speeds[-1]])
        frequency = np.vstack([frequency[:1], frequency, frequency[-1:]])
    found = []
    for cut in cuts:
        off = frequency - (cut.order * speeds / (2.0 * math.pi))[:, None]
        for k, mode in np.argwhere((off[:-1] >= 0.0) != (off[1:] >= 0.0)):
            part = off[k, mode] / (off[k, mode] - off[k + 1, mode])
            speed = float(speeds[k] + part * (speeds[k + 1] - speeds[k]))
            found.append(Crossing(sense * speed, cut.order * speed / (2.0 * math.pi), int(mode), cut))
    return sorted(found, key=lambda c: abs(c.speed))


def peaks_of(run: RunUp, critical: CriticalSpeeds) -> list[dict[str, Any]]:
    """Peaks of the dynamic factors over the speed, highest first, each with the order that makes it and the mode that
    this meets within `NEAR`: of the larger one of the motions that a slow run-up and a slow run-down meet.
    """
    both = list(zip(run.sweep(), run.sweep(up=False), strict=True))
    found = []
    for mesh, line in enumerate(run.train.model.meshes):
        steady = abs(float(run.train.steady[mesh]))
        swept = [max(two, key=partial(largest_force, mesh=mesh)) for two in both]
        values = np.array([largest_force(s, mesh) for s in swept]) / max(steady, 1e-300)
        for at, low, high in _tops(values):
            state = swept[at]
            made = {"speed_rad_per_s": state.speed, "mesh": line.name, "dynamic_factor": float(values[at])}
            found.append({**made, **_cause(critical, mesh, state, (swept[low], swept[high]))})
    return sorted(found, key=lambda x: -float(x["dynamic_factor"]))


def _cause(
    critical: CriticalSpeeds, mesh: int, state: SteadyState, valleys: tuple[SteadyState, SteadyState]
) -> dict[str, Any]:
    """Entries of the order that makes a peak and of the mode that it meets; None where no mode is near."""
    sizes = [(np.abs(s.lines(s.force[:, mesh])), s.numbers) for s in (state, *valleys)]

    def grew(cut: OrderCut) -> float:
        here, *beside = (float(size[k[cut.waves]]) if cut.waves in k else 0.0 for size, k in sizes)
        return here - max(beside)

    growing = sorted((cut for cut in critical.cuts if cut.waves in state.numbers), key=grew, reverse=True)
    order, crossing = growing[0], None
    for cut in (x for x in growing if grew(x) >= GREW * grew(order)):
        near = [c for c in critical.wider if c.cut is cut and abs(c.speed - state.speed) <= NEAR * abs(state.speed)]
        if near:
            order, crossing = cut, max(near, key=partial(_answer, critical.wider_modes, mesh, state))
            break
    found: dict[str, Any] = {
        "order": " = ".join(order.names),
        "frequency_Hz": float(state.frequency[state.numbers[order.waves]]),
        "mode": None, "mode_frequency_Hz": None, "damping_ratio": None, "critical_speed_rad_per_s": None,
        "searched_within": NEAR,
    }  # fmt: skip
    if crossing is None:
        return found
    modes, mode = critical.wider_modes, crossing.mode
    row = _row(modes, state)
    beyond = mode >= len(critical.modes.names)
    return found | {
        "mode": modes.names[mode] + (", above band_Hz" if beyond else ""),
        "mode_frequency_Hz": float(modes.frequency[row, mode]),
        "damping_ratio": float(modes.damping_ratio[row, mode]),
        "critical_speed_rad_per_s": crossing.speed,
    }


def _row(modes: CoupledModes, state: SteadyState) -> int:
    """Number of the speed of the modes that is nearest to a state's."""
    return int(np.argmin(np.abs(modes.speeds - state.speed)))


def _answer(modes: CoupledModes, mesh: int, state: SteadyState, crossing: Crossing) -> float:
    """How much a mode answers to a force in a mesh: its share of strain there, times its resonance at the order's
    frequency in the state.
    """
    row, mode = _row(modes, state), crossing.mode
    ratio = crossing.cut.order * abs(state.speed) / (2.0 * math.pi) / modes.frequency[row, mode]
    return float(modes.strain[mode, mesh] / abs(1.0 - ratio**2 + 2j * modes.damping_ratio[row, mode] * ratio))


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
