"""Order cuts of a run-up: multiples of the mesh frequencies, and their combinations, over the speed."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..train.response import XYZ
from .run_up import RunUp

#: Multiples of mesh frequencies in combinations that have names, in all.
COMBINED = 5
#: Orders nearer to each other, relatively, are one.
ROUND_OFF = 1e-9
#: Frequencies that are added: multiples and names.
Parts = Sequence[tuple[int, str]]


class OrderCut(NamedTuple):
    """A harmonic that is a multiple of a mesh frequency, or a combination of those of meshes of different phases."""

    waves: tuple[int, ...]  # k
    order: float  # of the drive's turns
    names: tuple[str, ...]  # such as "2 x mesh 1", "1 x mesh 1 + 1 x mesh 2"
    mesh: int | None  # the first of which it is a multiple; None for a combination
    multiple: int | None = None  # of that mesh's frequency


def multiples_of(run: RunUp, mesh: int, multiples: int) -> list[OrderCut]:
    """The first multiples of a mesh frequency."""
    cycles, waves = float(run.train.model.kinematics.cycles[mesh]), np.array(run.train.system.orders[mesh])
    return [
        OrderCut(tuple((a * waves).tolist()), a * cycles, (f"{a} x mesh {mesh + 1}",), mesh, a)
        for a in range(1, multiples + 1)
    ]


def named_orders(run: RunUp) -> Callable[[tuple[int, ...]], OrderCut]:
    """Return what gives a line of the motions its order and its names, by its numbers k.

    Names are multiples of the mesh frequencies or combinations of them, else orders of loads and multiples of the turns
    of shafts; any other line is named by its order.
    """
    model, system = run.train.model, run.train.system
    combined = {cut.waves: cut for cut in orders(run, COMBINED)}
    loads = [(order, load) for load in model.train.loads for order, *_ in load.orders]
    of_loads = [
        (float(cycles), f"{order:g} x load on {load.shaft}")
        for (order, load), cycles in zip(loads, model.orders, strict=True)
    ]

    def named(waves: tuple[int, ...]) -> OrderCut:
        order = float(np.sum(np.array(waves) / np.array(system.turns)))
        times = sorted(
            (a, mesh) for mesh, once in enumerate(system.orders)
            if (a := max(waves) // max(once)) and tuple(a * k for k in once) == waves
        )  # fmt: skip
        if times:
            (multiple, first), *_ = times
            return OrderCut(waves, order, tuple(f"{a} x mesh {mesh + 1}" for a, mesh in times), first, multiple)
        if waves in combined:
            return combined[waves]
        names = [name for cycles, name in of_loads if abs(cycles - order) <= ROUND_OFF * order]
        for ratio, shaft in zip(model.kinematics.ratios, model.train.shafts, strict=True):
            turns = order / abs(float(ratio)) if ratio else 0.0
            if ratio and abs(turns - round(turns)) <= ROUND_OFF * turns:
                names.append(f"{round(turns)} x shaft {shaft.name}")
        return OrderCut(waves, order, tuple(names) or (f"order {order:.6g}",), None)

    return named


def orders(run: RunUp, multiples: int) -> list[OrderCut]:
    """Multiples of the mesh frequencies and their combinations, of so many multiples in all, by rising frequency."""
    system = run.train.system
    ways: list[list[tuple[int, int]]] = [[(0, 0)] for _ in system.turns]
    for mesh, cycles in enumerate(system.orders):
        ways[int(np.argmax(cycles))] += [(sign * a, mesh) for a in range(1, multiples + 1) for sign in (1, -1)]
    found: dict[tuple[int, ...], list[tuple[int, Parts, int | None]]] = {}
    for taken in itertools.product(*ways):
        parts = [(a, mesh) for a, mesh in taken if a]
        waves = np.sum([a * np.array(system.orders[mesh]) for a, mesh in parts], axis=0, dtype=int)
        size = sum(abs(a) for a, _ in parts)
        if parts and size <= multiples and waves @ (1.0 / np.array(system.turns)) > 0.0:
            alone = parts[0][1] if len(parts) == 1 else None
            named = [(a, f"mesh {mesh + 1}") for a, mesh in parts]
            found.setdefault(tuple(waves.tolist()), []).append((size, named, alone))
    made, of_meshes = list[OrderCut](), dict[tuple[int, ...], Parts]()
    for k, met in found.items():
        rising = sorted(met, key=lambda x: x[0])
        order = float(np.sum(np.array(k) / np.array(system.turns)))
        made.append(OrderCut(k, order, tuple(_combined(parts) for _, parts, _ in rising), rising[0][2]))
        of_meshes[k] = rising[0][1]
    return sorted([*made, *_sidebands(run, of_meshes)], key=lambda cut: cut.order)


def _sidebands(run: RunUp, of_meshes: Mapping[tuple[int, ...], Parts]) -> list[OrderCut]:
    """Return the sidebands of orders, and orders of the carriers alone: up to as many rotations as it has planets.

    A difference of mesh frequencies may be slower than the carrier. Its sideband then has the opposite sign: a line of
    the order n - c < 0 is one of c - n.
    """
    turns, passes = np.array(run.train.system.turns), run.train.passes
    made = list[OrderCut]()
    for shifts in itertools.product(*(range(-planets, planets + 1) for _, planets in passes.values())):
        waves = np.zeros(len(turns), dtype=int)
        waves[list(passes)] = shifts
        carriers = [(k, name) for k, (name, _) in zip(shifts, passes.values(), strict=True) if k]
        none: tuple[tuple[int, ...], int, Parts] = (0,) * len(turns), 1, []
        around = [none] + [(k, sign, parts) for k, parts in of_meshes.items() for sign in (1, -1)]
        for k, sign, parts in around if carriers else ():
            summed = sign * np.array(k) + waves
            order = float(np.sum(summed / turns))
            if order > 0.0:
                name = _combined([*((sign * a, name) for a, name in parts), *carriers])
                made.append(OrderCut(tuple(summed.tolist()), order, (name,), None))
    return made


def _combined(parts: Parts) -> str:
    """``2 x mesh 1 - 1 x mesh 2``; what is added stands first."""
    said = ""
    for a, name in sorted(parts, key=lambda part: part[0] < 0):
        said += (" - " if a < 0 else " + " if said else "") + f"{abs(a)} x {name}"
    return said


def order_columns(run: RunUp, multiples: int) -> dict[str, Any]:
    """Columns of orders.csv: each order of each steady state with the amplitudes of all signals."""
    states, model = run.states, run.train.model
    spectra = [(np.abs(s.lines(s.force)), np.abs(s.lines(s.transmission_error))) for s in states]
    rows = [
        (cut, i, k) for cut in orders(run, multiples) for i, s in enumerate(states)
        if (k := s.numbers.get(cut.waves)) is not None
    ]  # fmt: skip
    made: dict[str, Any] = {
        "order": np.array([states[i].order[k] for _, i, k in rows]),
        "meets": [" = ".join(cut.names) for cut, _, _ in rows],
        "speed_rad_per_s": np.array([states[i].speed for _, i, _ in rows]),
        "branch": np.array([states[i].branch for _, i, _ in rows], dtype=int),
        "frequency_Hz": np.array([states[i].frequency[k] for _, i, k in rows]),
    }
    forces, errors = (np.array([spectra[i][which][k] for _, i, k in rows]) for which in (0, 1))
    moved = np.abs([states[i].acceleration[k] for _, i, k in rows])
    made |= {f"contact_force_{i + 1}_N": forces[:, i] for i in range(len(model.meshes))}
    made |= {f"transmission_error_{i + 1}_um": 1e6 * errors[:, i] for i in range(len(model.meshes))}
    made |= {f"acceleration_{name}_m_per_s2": moved[:, j] for j, name in enumerate(model.bores)}
    loads = np.abs([states[i].bearing[k] for _, i, k in rows]).reshape(len(rows), -1, 6)
    for j, name in enumerate(model.bores):
        made |= {f"bearing_force_{name}_{x}_N": loads[:, j, n] for n, x in enumerate(XYZ)}
    if model.train.housing is not None:
        power = [states[i].power for _, i, _ in rows]
        made["radiated_power_W"] = np.array([p[k] for p, (_, _, k) in zip(power, rows, strict=True) if p is not None])
    return made
