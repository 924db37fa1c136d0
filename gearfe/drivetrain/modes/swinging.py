"""Coupled modes of a train as fields that swing, for ParaView: the housing, and gears with their shafts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...base.typing import ComplexArray
from ...multibody import constant
from ..gearbox.fields import shown_factor, write_gears, write_housing
from ..train.model import TrainModel
from ..train.response import TrainResponse
from ..train.simulate import response_of
from ..train.states import TrainStates
from .critical import nearest
from .whirl import STRONG, WhirlModes

#: Pictures of one period.
FRAMES = 16


def mesh_modes(modes: WhirlModes, least: float = STRONG) -> list[int]:
    """Return the numbers, from 0, of modes with at least a part of their strain energy in the meshes at the fastest
    speed. If there is none, the mode with the largest part is returned.
    """
    share = modes.mesh_strain[modes.fastest].sum(axis=1)
    return np.flatnonzero(share >= least).tolist() or np.argsort(-share)[:1].tolist()


def swinging(
    model: TrainModel, modes: WhirlModes, numbers: Sequence[int], speed: float, frames: int = FRAMES
) -> TrainResponse:
    """Return a train that does not turn, in one mode after the other, without decay.

    Parameters
    ----------
    model : TrainModel
        The train.
    modes : WhirlModes
        Its modes.
    numbers : sequence of int
        Numbers, from 0, of the modes.
    speed : float
        Of the drive (rad/s); the modes are those of the nearest speed.
    frames : int
        Pictures of a period.

    Returns
    -------
    TrainResponse
        Its `time` is the number of the mode, from 1, and the part of the period. The size of a mode is arbitrary: the
        largest displacement of a housing's node or a gear's tip can be seen.
    """
    row, part = nearest(modes, speed), np.arange(frames) / frames
    time = np.concatenate([mode + 1 + part for mode in numbers])
    turn = np.exp(2j * math.pi * part)[:, None]
    shapes = [_sized(model, modes.shapes[row, mode]) for mode in numbers]
    rates = [2.0 * math.pi * float(modes.frequency[row, mode]) for mode in numbers]
    q, v, a = (
        np.concatenate([((1j * w) ** k * turn * shape).real for shape, w in zip(shapes, rates, strict=True)])
        for k in range(3)
    )
    approach = q @ np.array([line.row for line in model.meshes]).reshape(-1, q.shape[1]).T
    none, loads = np.zeros_like(approach), np.zeros((len(time), len(model.bores), 6))
    still = np.zeros(len(time))
    moved = TrainStates(time, q, v, a, none, approach, none > 0.0, still, none, none, loads)
    return response_of(replace(model, angle=constant(0.0)), moved, "done", float(time[-1]), {})


def write_modes(folder: Path, model: TrainModel, modes: WhirlModes, numbers: Sequence[int], speed: float) -> None:
    """Write ``mode_gears.vtkhdf`` and, of an elastic housing, ``mode_housing.vtkhdf``.

    Parameters
    ----------
    folder : Path
        Folder of the files.
    model, modes, numbers, speed
        See `swinging`.
    """
    made = swinging(model, modes, numbers, speed)
    steps = np.arange(len(made.time))
    write_gears(folder / "mode_gears.vtkhdf", model.train, made, steps)
    if model.train.housing is not None and model.train.housing.has_mesh:
        write_housing(folder / "mode_housing.vtkhdf", model.train.housing, made, steps)


def _sized(model: TrainModel, shape: ComplexArray) -> ComplexArray:
    """A shape whose largest displacement can be seen, real where it is largest."""
    train, pose = model.train, np.zeros((len(model.train.gears), 6), dtype=complex)
    for row, gear in zip(pose, train.gears, strict=True):
        number = train.shaft_number(gear.shaft)
        shaft, base = model.shafts[number], np.array(train.shaft(gear.shaft).point)
        own = shape[model.first[number] : model.first[number] + shaft.size]
        centre = base + (gear.along - float(base @ train.frame[2])) * train.frame[2]
        row[:3] = shaft.point_rows(centre, train.frame, gear.along) @ own
        row[3:] = shaft.turn_rows(gear.along) @ own
    modal = None if train.housing is None else shape[: train.housing.size]
    largest = shape[np.abs(shape).argmax()]
    return np.asarray(shape * shown_factor(train, pose, modal) * (np.abs(largest) / largest))
