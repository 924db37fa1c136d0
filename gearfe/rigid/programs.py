"""Systems on a tape, where all their elements can be written on one."""

from __future__ import annotations

from typing import Any

import numpy as np

from .system import System
from .tape import Program, Tape


def tape_program(system: System) -> Program | None:
    """The system on a tape; None where an element has no series."""
    program = written(system)
    return None if program is None or len(program.bars.place) or len(program.floats.place) else program


def written(system: System) -> Program | None:
    """The system on a tape; None where an element cannot be written."""
    known: dict[str, Program | None] = system.__dict__
    if "_program" not in known:
        known["_program"] = _program(system)
    return known["_program"]


def _program(system: System) -> Program | None:
    tape = Tape(system.size)
    for element, places in zip(system.elements, system.index, strict=True):
        write: Any = getattr(element, "write", None)
        if write is None:
            if element.rows or hasattr(element, "force"):
                return None
        elif not write(tape, places):
            return None
    return tape.program(system.mass, system.damping, system.stiffness, system.units)


def without_redundant(program: Program, active: np.ndarray) -> Program:
    """Without the rows that are redundant."""
    if active.all():
        return program
    rows, number = program.rows, np.cumsum(active) - 1
    held, pairs = active[rows.place[:, 0]], active[rows.pair[:, 0]]
    place, pair = rows.place[held], rows.pair[pairs]
    place[:, 0], pair[:, 0] = number[place[:, 0]], number[pair[:, 0]]
    kept = rows._replace(
        place=place, factor=rows.factor[held], pair=pair, weight=rows.weight[pairs],
        constant=rows.constant[active], motion=rows.motion[active], unit=rows.unit[active],
    )  # fmt: skip
    return program._replace(rows=kept)
