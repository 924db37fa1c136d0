r"""Torques over speed of a job's drive and loads, and the operating point at which they count as steady.

Steady forces, rolling bearings, misalignment and modes belong to one speed. With a prescribed speed it is that which
the drive comes to. A drive by torque comes to where its torque and those of the loads balance,

.. math:: F(\Omega) = T_d(\Omega) + \sum_i g_i\,T_i(g_i\Omega) = 0,\qquad F'(\Omega) < 0,

g are the ratios of the loads' shafts. Of several such speeds the one next to the nominal speed is taken, or from rest
the first one in the sense in which the drive starts. Without any it is the nominal speed.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from ...base.tables.train import TrainTable
from ...base.typing import Array
from ...multibody import TimeFunction, constant
from ..train.gear_train import Drive, GearTrain, Load, SpeedCurve
from ..train.kinematics import fastest
from ..train.rolling import rolling
from .timefunctions import speed_function

#: A drive or a load.
End = TypeVar("End", Drive, Load)
#: An expression that does not say so holds up to so many times the speed of its shaft in [train].
RANGE = 5.0
#: Speeds at which a balance of torques is looked for, between each two breaks of the torques.
LOOKS = 200


def with_torques_over_speed(
    train: GearTrain, table: TrainTable, folder: Path, operating_speed: float | None = None
) -> GearTrain:
    """Return the train with the torques over speed of its table.

    Parameters
    ----------
    train : GearTrain
        The train without them.
    table : TrainTable
        [train].
    folder : Path
        Where files lie that it names.
    operating_speed : float, optional
        Of the drive (rad/s), instead of that of the operating point.

    Raises
    ------
    InputError
        For what `.timefunctions.speed_function` refuses.
    """
    tables = [table.drive, *table.loads]
    if train.drive is None or all(end is None or end.torque_over_speed is None for end in tables):
        return train
    ends: list[Drive | Load] = [train.drive, *train.loads]
    wheres = ["train.drive", *(f"train.loads[{i}]" for i in range(len(train.loads)))]
    ratios = [float(ratio) for ratio in rolling(train.layout).ratios]
    known = max(fastest(train.drive.speed), abs(operating_speed or 0.0))
    functions: list[TimeFunction | None] = []
    for given, end, where in zip(tables, ends, wheres, strict=True):
        over = None if given is None else given.torque_over_speed
        largest = RANGE * known * abs(ratios[train.shaft_number(end.shaft)])
        key = f"{where}.torque_over_speed"
        functions.append(None if over is None else speed_function(over, key, folder, largest))
    speed = operating_speed
    if speed is None:
        speed = _final_speed(train.drive)
        if train.drive.torque is not None:
            speed = _balanced(train, functions, ratios, speed)
    curves = [
        None if function is None else SpeedCurve(function, speed * ratios[train.shaft_number(end.shaft)])
        for end, function in zip(ends, functions, strict=True)
    ]
    drive = _with_curve(train.drive, curves[0])
    return replace(train, drive=drive, loads=tuple(map(_with_curve, train.loads, curves[1:])))


def _with_curve(end: End, curve: SpeedCurve | None) -> End:
    """A drive or a load with a torque over speed, whose steady part its torque holds."""
    if curve is None:
        return end
    steady = constant(curve.steady)
    return replace(end, over_speed=curve, torque=steady if end.torque is None else end.torque + steady)


def _final_speed(drive: Drive) -> float:
    """Speed of a drive in the end (rad/s), without oscillating parts."""
    speed = replace(drive.speed, sines=())
    return float(speed(max(speed.breaks, default=0.0)))


def _balanced(train: GearTrain, functions: list[TimeFunction | None], ratios: list[float], nominal: float) -> float:
    """Speed of the drive (rad/s) at which its torque and those of the loads balance; the nominal one without any."""
    ends: list[Drive | Load] = [train.driven, *train.loads]
    terms: list[tuple[float, Callable[[Array], Array]]] = []
    breaks = {0.0, nominal, 2.0 * nominal}
    for end, function in zip(ends, functions, strict=True):
        ratio = ratios[train.shaft_number(end.shaft)]
        terms.append((ratio, _torque(end, function, ratio * nominal)))
        breaks |= set() if function is None or not ratio else {place / ratio for place in function.breaks}
    marks = sorted(breaks)
    reach = max(1.0, *map(abs, marks))
    marks = [-2.0 * reach, *marks, 2.0 * reach]
    places = np.unique(np.concatenate([np.linspace(a, b, LOOKS) for a, b in itertools.pairwise(marks)]))

    def left(speed: Array) -> Array:
        return np.asarray(sum(ratio * torque(ratio * speed) for ratio, torque in terms))

    value = left(places)
    falls = np.flatnonzero((value[:-1] > 0.0) & (value[1:] <= 0.0))
    if not len(falls):
        return nominal
    from scipy.optimize import brentq

    roots = np.array([brentq(lambda x: float(left(np.array(x))), places[i], places[i + 1]) for i in falls])
    if nominal != 0.0:
        return float(roots[np.argmin(np.abs(roots - nominal))])
    ahead = roots[roots * float(left(np.array(0.0))) > 0.0]
    return float(ahead[np.argmin(np.abs(ahead))]) if len(ahead) else nominal


def _torque(end: Drive | Load, function: TimeFunction | None, nominal: float) -> Callable[[Array], Array]:
    """Torque (N m) of a drive or a load in the end over the speed of its shaft (rad/s)."""
    steady = constant(0.0) if end.torque is None else replace(end.torque, sines=())
    level = float(steady(max(steady.breaks, default=0.0)))

    def torque(speed: Array) -> Array:
        over = 0.0 if function is None else function(speed)
        return np.asarray(level + over - end.slope * (speed - nominal))

    return torque


def operating_speed(train: GearTrain) -> float | None:
    """Speed of the drive (rad/s) at which the torques over speed of a train count as steady; None without any."""
    ends: list[Drive | Load] = [train.driven, *train.loads]
    for end in ends:
        if end.over_speed is not None:
            ratio = float(train.kinematics.ratios[train.shaft_number(end.shaft)])
            if ratio:
                return end.over_speed.reference / ratio
    return None
