"""The series of a train's forces: tables for `train.series`, and on which cells the flanks are at a start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...base.typing import Array, IntArray
from ...gears.gearmesh.law import stacked_laws
from ...gears.gearmesh.periodic import PeriodicInterpolant, curve_arrays
from ...gears.gearmesh.width_law import stacked_width_laws
from ...multibody import SeriesLaw
from ...multibody.series.timefunctions import time_arrays
from . import discontinuities, friction, series
from .discontinuities import SAME
from .forces import CurveFlank, Flank, LawFlank, TrainForces, WidthFlank
from .friction import UNKNOWN, Sliding
from .series import Flanks, Gyros, Places, Program, Slides, Speeds, Turneds

#: In place of the friction of flanks without any.
SMOOTH = Sliding(0.0, 1.0, 0, 0, 0.0, 0.0, 0.0, 0.0)
#: Columns of whole numbers.
WHOLE = ("direction", "turn", "across", "spin", "tilt")


def train_program(forces: TrainForces) -> tuple[Program, int, int]:
    """Program of a train's forces, the rows of its memory, and how many whole numbers it keeps."""
    distinct = list({id(f.law): f.law for f in forces.flanks if isinstance(f, LawFlank)}.values())
    laws, order = stacked_laws(distinct), [id(law) for law in distinct]
    slots = laws.touch.shape[1]
    over_width = list({id(f.law): f.law for f in forces.flanks if isinstance(f, WidthFlank)}.values())
    wide_order = [id(law) for law in over_width]
    rows, pieces = 1 + len(forces.torques) + series.PER_GYRO * len(forces.gyros), 0
    places, shifts, watches = [], [], []
    curves: list[PeriodicInterpolant] = []
    errors: list[PeriodicInterpolant] = []
    levers: list[PeriodicInterpolant] = []
    moments: list[PeriodicInterpolant] = []
    for number, flank in enumerate(forces.flanks):
        watches += _watches(number, flank, rows, slots)
        if isinstance(flank, CurveFlank):
            places.append((len(curves), 0, rows, pieces))
            shifts.append(np.zeros(1))
            curves.append(flank.curve)
            none = replace(flank.curve, cubics=np.zeros_like(flank.curve.cubics))
            errors.append(flank.error or none)
            levers.append(none if flank.tilting is None else flank.tilting.lever)
            moments.append(none if flank.tilting is None else flank.tilting.moment)
            rows, pieces = rows + series.PER_CURVE, pieces + series.PER_FLANK
        elif isinstance(flank, WidthFlank):
            places.append((-2, wide_order.index(id(flank.law)), rows, pieces))
            shifts.append(np.zeros(1))
            rows, pieces = rows + series.PER_WIDE, pieces + series.PER_WIDE_FLANK
        else:
            places.append((-1, order.index(id(flank.law)), rows, pieces))
            shifts.append(flank.shifts)
            rows += series.SLOTS + series.PER_SLOT * slots + series.PER_COUPLE * (slots * (slots - 1) // 2)
            pieces += series.PER_FLANK + 2 * slots
    turned = Turneds(
        np.array([spring.still for spring in forces.turned], dtype=np.int64),
        np.array([spring.turning for spring in forces.turned], dtype=np.int64),
        np.array([spring.ratio for spring in forces.turned], dtype=float),
        np.array([spring.of_rates for spring in forces.turned], dtype=np.int64),
        (rows + series.PER_TURNED * np.arange(len(forces.turned))).astype(np.int64),
    )
    rows += series.PER_TURNED * len(forces.turned)
    speeds, more, rows, pieces = _speeds(forces, rows, pieces)
    watches += more
    curve, law, row, piece = np.array(places, dtype=np.int64).reshape(-1, 4).T.copy()
    program = Program(
        time_arrays([forces.angle, *(torque for _, torque in forces.torques)]),
        np.array([direction for direction, _ in forces.torques], dtype=np.int64),
        _columns(Gyros, forces.gyros),
        turned,
        _columns(Flanks, forces.flanks),
        _columns(Slides, [flank.sliding or SMOOTH for flank in forces.flanks]),
        Places(curve, law, row, piece, np.cumsum([0, *map(len, shifts)]), np.concatenate([np.zeros(0), *shifts])),
        np.array(watches, dtype=np.int64).reshape(-1, 4),
        curve_arrays(curves),
        curve_arrays(errors).cubics,
        curve_arrays(levers).cubics,
        curve_arrays(moments).cubics,
        laws,
        stacked_width_laws(over_width),
        speeds,
    )
    return program, rows, pieces


def _speeds(forces: TrainForces, rows: int, pieces: int) -> tuple[Speeds, list[tuple[int, int, int, int]], int, int]:
    """Tables of the torques over speed, what ends a step by them, and the rows and whole numbers with theirs."""
    torques = forces.speed_torques
    tables, count = time_arrays([over.function for over in torques]), len(torques)
    width = tables.factor.shape[1]
    row = rows + width * np.arange(count)
    speeds = Speeds(
        np.array([over.direction for over in torques], dtype=np.int64),
        np.array([over.ratio for over in torques], dtype=float),
        np.array([over.damping for over in torques], dtype=float),
        tables.first,
        tables.start,
        tables.origin,
        tables.factor,
        np.array([SAME * max(1.0, *map(abs, (1.0, *over.function.breaks))) for over in torques], dtype=float),
        row.astype(np.int64),
        (pieces + np.arange(count)).astype(np.int64),
    )
    watches = [
        (series.SPEEDING, number, int(row[number]) + series.PLACE, 0)
        for number, over in enumerate(torques)
        if over.function.breaks
    ]
    return speeds, watches, rows + width * count, pieces + count


def _watches(number: int, flank: Flank, row: int, slots: int) -> list[tuple[int, int, int, int]]:
    """What ends a step by a flank; its phase is the last, for pairs go on to other slots with it."""
    if isinstance(flank, CurveFlank):
        phase = (series.PHASE, number, row + series.Z, 0)
        return [phase, (series.TOUCH, number, row + series.DELTA, 0)] if flank.parts else [phase]
    if isinstance(flank, WidthFlank):
        ends = [(series.OVERLAP, number, row + series.WIDE_X, 0)]
        ends += (
            [(series.TILTED, number, row + series.WIDE_TILT, 0)] if flank.tilt >= 0 and len(flank.law.tilts) > 1 else []
        )
        ends += [(series.PULL, number, row + series.WIDE_DAMPED, 0)] if flank.damping > 0.0 else []
        return [*ends, (series.PHASE, number, row + series.Z, 0)]
    own = [(slot, row + series.SLOTS + series.PER_SLOT * slot) for slot in range(slots)]
    made = [(series.PAIR, number, pair, slot) for slot, pair in own]
    if flank.damping > 0.0:
        made.append((series.PULL, number, row + series.DAMPED, 0))
    if flank.sliding is not None:
        made += [(series.SLIDE, number, pair + series.SPEED, slot) for slot, pair in own]
    return [*made, (series.PHASE, number, row + series.Z, 0)]


def _columns(kind: Any, items: Sequence[Any]) -> Any:
    """Arrays of what the items have under the names of a named tuple."""
    types = {name: np.int64 if name in WHOLE else float for name in kind._fields}
    return kind(*(np.array([getattr(one, name) for one in items], dtype=made) for name, made in types.items()))


def ahead_of(nodes: Array, phase: float, speed: float) -> tuple[int, int]:
    """Cycle and cell that a phase is in, at a node those that lie ahead."""
    cells, period = len(nodes) - 1, nodes[-1] - nodes[0]
    turn = int(np.floor((phase - nodes[0]) / period))
    place = phase - turn * period
    cell = min(max(int(np.searchsorted(nodes, place, side="right")) - 1, 0), cells - 1)
    width = nodes[cell + 1] - nodes[cell]
    if speed > 0.0 and nodes[cell + 1] - place < SAME * width:
        cell += 1
    elif speed < 0.0 and place - nodes[cell] < SAME * width:
        cell -= 1
    return turn + cell // cells, cell % cells


def train_series(forces: TrainForces) -> SeriesLaw:
    """The series of a train's forces."""
    program, rows, pieces = train_program(forces)

    def begin(t: float, sign: float, u: Array, du: Array, memory: Array, pieces: IntArray) -> None:
        """Cells of all flanks, at a node the one that lies ahead, and the pair forces there; not compiled."""
        angle, rate = float(forces.angle(t)), float(forces.angle(t, 1))
        for over, at in zip(forces.speed_torques, program.speeds.piece, strict=True):
            speed = over.ratio * rate + du[over.direction]
            pieces[at] = np.searchsorted(over.function.starts, speed, side="right") - 1
        slots = program.laws.touch.shape[1]
        for flank, at, row in zip(forces.flanks, program.places.piece, program.places.row, strict=True):
            phase, approach = flank.phase_and_approach(np.array([angle]), u[None])
            speed = sign * flank.sense * (flank.ratio * rate + du[flank.turn])
            if isinstance(flank, CurveFlank):
                pieces[at : at + 2] = ahead_of(flank.curve.nodes, float(phase[0]), speed)
                bears = approach[0] > 0.0 or (approach[0] == 0.0 and sign * du[flank.direction] > 0.0)
                pieces[at + 2] = 0 if bears or not flank.parts else -1
                continue
            if isinstance(flank, WidthFlank):
                pieces[at : at + 2] = ahead_of(flank.law.nodes, float(phase[0]), speed)
                pieces[at + 2] = 0 if 1.0 + flank.damping * du[flank.direction] > 0.0 else -1
                tilts = np.broadcast_to(flank.tilt_of(u[None]), phase.shape)
                _, part, side = flank.law.cells(phase, approach, tilts)
                pieces[at + series.PER_FLANK] = part[0] if approach[0] > 0.0 else -1
                pieces[at + series.PER_FLANK + 1] = side[0]
                continue
            turn, cell = ahead_of(flank.law.nodes, float(phase[0]), speed)
            pieces[at : at + 3] = turn, cell, 0 if 1.0 + flank.damping * du[flank.direction] > 0.0 else -1
            force, own = np.zeros(slots), at + series.PER_FLANK
            made = flank.law(phase, approach, flank.shifts_at(phase)).pair_forces[0]
            shift = turn - int(flank.law.locate(phase)[0][0])  # a node at which a cycle ends lies behind
            for slot in range(flank.law.slots):
                if 0 <= slot + shift < slots:
                    force[slot + shift] = made[slot]
            part = np.minimum(np.searchsorted(flank.law.forces, force, side="right") - 1, len(flank.law.forces) - 2)
            pieces[own : own + slots] = np.where(force > 0.0, part, -1)
            pieces[own + slots : own + 2 * slots] = UNKNOWN
            memory[row + series.BEFORE, :slots] = force

    constants: dict[str, float] = {}
    for module in (series, discontinuities, friction):
        found = {name: value for name, value in vars(module).items() if name.isupper()}
        constants |= {name: value for name, value in found.items() if isinstance(value, int | float)}
    helpers = (*series.FUNCTIONS, *discontinuities.FUNCTIONS)
    return SeriesLaw(
        begin, series.train_order, discontinuities.train_discontinuity, helpers, program, rows, pieces, constants
    )
