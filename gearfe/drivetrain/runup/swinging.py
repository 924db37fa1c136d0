"""Coupled modes of a train as fields that swing, for ParaView: the housing, and gears with their shafts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...base.typing import Array
from ...multibody import constant
from ..gearbox.fields import write_gears, write_housing
from ..train.model import TrainModel
from ..train.response import TrainResponse
from ..train.simulate import response_of
from ..train.states import TrainStates
from .modes import CoupledModes

#: Pictures of one period.
FRAMES = 16
#: Largest displacement, in parts of the size of the train.
SHOWN = 0.02


def mesh_modes(modes: CoupledModes, meshes: int, least: float) -> list[int]:
    """Numbers, from 0, of modes with at least a part of their strain energy in the meshes; the first of all where none
    has.
    """
    share = modes.strain[:, :meshes].sum(axis=1)
    return np.flatnonzero(share >= least).tolist() or [int(share.argmax())]


def swinging(model: TrainModel, modes: Sequence[int], frames: int = FRAMES) -> TrainResponse:
    """A train that does not turn, in one mode after the other, without damping and gyroscopic moments.

    Its `time` is the number of the mode, from 1, and the part of the period; the amplitude of a mode is arbitrary: the
    largest displacement of a housing's node or a gear's tip is `SHOWN` of the train's size.
    """
    part = np.arange(frames) / frames
    time = np.concatenate([mode + 1 + part for mode in modes])
    angle = 2.0 * math.pi * part[:, None]
    shapes = [_sized(model, model.modal.T[:, mode]) for mode in modes]
    rates = [math.sqrt(max(float(model.modal.eigenvalues[mode]), 0.0)) for mode in modes]
    q = np.concatenate([np.cos(angle) * shape for shape in shapes])
    v = np.concatenate([-rate * np.sin(angle) * shape for rate, shape in zip(rates, shapes, strict=True)])
    a = np.concatenate([-(rate**2) * np.cos(angle) * shape for rate, shape in zip(rates, shapes, strict=True)])
    approach = q @ np.array([line.row for line in model.meshes]).T
    none, loads = np.zeros_like(approach), np.zeros((len(time), len(model.bores), 6))
    moved = TrainStates(
        time,
        q,
        v,
        a,
        none,
        approach,
        none > 0.0,
        np.zeros(len(time)),
        none,
        none,
        loads,
    )
    return response_of(replace(model, angle=constant(0.0)), moved, "done", float(time[-1]), {})


def write_modes(folder: Path, model: TrainModel, modes: Sequence[int]) -> None:
    """``mode_gears.vtkhdf`` and, of an elastic housing, ``mode_housing.vtkhdf``."""
    made = swinging(model, modes)
    steps = np.arange(len(made.time))
    write_gears(folder / "mode_gears.vtkhdf", model.train, made, steps)
    if model.train.housing is not None and model.train.housing.has_mesh:
        write_housing(folder / "mode_housing.vtkhdf", model.train.housing, made, steps)


def _sized(model: TrainModel, shape: Array) -> Array:
    """A shape whose largest displacement can be seen."""
    train, body = model.train, model.train.housing
    most, places = 0.0, [np.array([train.shaft(gear.shaft).point for gear in train.gears])]
    for gear in train.gears:
        number = train.shaft_number(gear.shaft)
        shaft, base = model.shafts[number], np.array(train.shaft(gear.shaft).point)
        own = shape[model.first[number] : model.first[number] + shaft.size]
        centre = base + (gear.along - float(base @ train.frame[2])) * train.frame[2]
        moves = shaft.point_rows(centre, train.frame, gear.along) @ own
        turns = shaft.turn_rows(gear.along) @ own
        most = max(most, float(np.linalg.norm(moves) + gear.gear.tip_radius * np.linalg.norm(turns)))
    if body is not None and body.has_mesh:
        most = max(most, float(np.abs(body.reconstruct(shape[None, : body.size])).max()))
        places.append(body.nodes)
    size = float(np.ptp(np.concatenate(places), axis=0).max()) + 2.0 * max(g.gear.tip_radius for g in train.gears)
    return np.asarray(shape * (SHOWN * size / most))
