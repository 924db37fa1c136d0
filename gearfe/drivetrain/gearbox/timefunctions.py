"""From functions of time and of speed in a job file to those that the integrators take: pieces of polynomials, sines.

An expression becomes pieces of polynomials of degree `DEGREE` through Chebyshev's points (Trefethen, Approximation
Theory and Approximation Practice, 2nd ed. 2020, chapters 2 and 8). Pieces are halved until each has the accuracy
`CLOSE`. At a kink, where halving would not end, the error stays within `KINK` of the largest value.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.polynomial import chebyshev

from ...base.errors import InputError
from ...base.expressions import Names, compute, parse
from ...base.files import read_numbers
from ...base.tables.timefunction import SpeedFunctionTable, TrainFunctionTable, check_rising
from ...base.typing import Array
from ...multibody import TimeFunction, constant, sine, smoothed_step

#: Degree of a piece, its error in parts of the largest value, the same at kinks, halvings, and pieces at most.
DEGREE, CLOSE, KINK, HALVINGS, PIECES = 12, 1e-11, 1e-6, 22, 4000


def time_function(value: float | TrainFunctionTable, where: str, folder: Path, end: float) -> TimeFunction:
    """The function of time that a key describes.

    Parameters
    ----------
    value
        A number, or the table of the function.
    where
        Name of the key, for messages.
    folder
        Where files lie that it names.
    end
        Of the run (s): an expression is known up to there.

    Raises
    ------
    InputError
        Files that cannot be read, times that do not rise, expressions that are none or jump.
    """
    if not isinstance(value, TrainFunctionTable):
        return constant(value)
    made = constant(value.constant)
    if value.points_ms:
        made = made + _through(np.array(value.points_ms), value.interpolation)
    if value.csv is not None:
        made = made + _through(_table(value.csv, f"{where}.csv", folder), value.interpolation)
    for one in value.steps:
        made = made + smoothed_step(1e-3 * one.centre_ms, 1e-3 * one.width_ms, one.height)
    for wave in value.sines:
        made = made + sine(wave.amplitude, 2.0 * math.pi * wave.frequency_Hz, math.radians(wave.phase_deg))
    if value.expression is not None:
        made = made + _of_expression(value.expression, f"{where}.expression", end)
    return made


def speed_function(table: SpeedFunctionTable, where: str, folder: Path, largest: float) -> TimeFunction:
    """Return the torque over speed that a table describes, constant beyond its ends.

    Parameters
    ----------
    table : SpeedFunctionTable
        The table.
    where : str
        Name of the key, for messages.
    folder : Path
        Where files lie that it names.
    largest : float
        Speed (rad/s) up to which an expression that does not say so holds, both ways; 0: unknown.

    Raises
    ------
    InputError
        Files that cannot be read, speeds that do not rise, expressions that are none, jump or have no value.
    """
    if table.expression is None:
        if table.csv is None:
            return _within(np.array(table.points_rad_per_s_Nm), table.interpolation)
        columns = read_numbers(folder / table.csv, f"{where}.csv", ("speed_rad_per_s", "torque_Nm"))
        points = np.column_stack([columns["speed_rad_per_s"], columns["torque_Nm"]])
        check_rising(f"{where}.csv speed_rad_per_s", tuple(points[:, 0].tolist()), "rad/s")
        return _within(points, table.interpolation)
    end = table.largest_speed_rad_per_s or largest
    if not end > 0.0:
        problem = "is required: [train] does not say how fast the shaft turns"
        raise InputError(f"{where}.largest_speed_rad_per_s", None, problem, "give the largest speed that it may reach")
    text, key = table.expression, f"{where}.expression"
    tree = parse(text, key, Names(("speed",)))

    def at(place: Array) -> Array:
        with np.errstate(all="ignore"):
            speed = place - end
            found = np.asarray(compute(tree, {("speed", None): speed}), dtype=float)
        value = np.broadcast_to(found, place.shape)
        if not np.isfinite(value).all():
            bad = float(speed[~np.isfinite(value)][0])
            problem = f"has no value at {bad:.6g} rad/s"
            cure = "change it, as 2*M*s*k/(s*s + k*k) for 2*M/(s/k + k/s), or lower largest_speed_rad_per_s"
            raise InputError(key, text, problem, cure)
        return value

    fit = fitted(at, 2.0 * end, key, text, unit="rad/s", shift=end)
    ends = at(np.array([0.0, 2.0 * end]))
    starts = (-math.inf, -end, *(start - end for start in fit.starts[1:]), end)
    origins = (-end, *(origin - end for origin in fit.origins), end)
    return TimeFunction(starts, origins, ((float(ends[0]),), *fit.coefficients, (float(ends[1]),)))


def _within(points: Array, interpolation: str) -> TimeFunction:
    """Through points (n, 2) of speeds (rad/s) and torques (N m), which hold below the first and above the last."""
    if len(points) == 1:
        return constant(float(points[0, 1]))
    pieces = _pieces(points[:, 0], points[:, 1], interpolation)
    speed = tuple(points[:, 0].tolist())
    return TimeFunction(
        (-math.inf, *speed), (speed[0], *speed), ((float(points[0, 1]),), *pieces, (float(points[-1, 1]),))
    )


def _pieces(place: Array, value: Array, interpolation: str) -> list[tuple[float, ...]]:
    """Polynomials between points, each about the first of its two: straight lines, or monotone cubics."""
    if interpolation == "cubic" and len(place) > 2:
        from scipy.interpolate import PchipInterpolator

        pieces = PchipInterpolator(place, value).c[::-1].T
    else:
        pieces = np.column_stack([value[:-1], np.diff(value) / np.diff(place)])
    return [tuple(float(c) for c in row) for row in pieces]


def _through(points: Array, interpolation: str) -> TimeFunction:
    """Through points (n, 2) of times (ms) and values, which hold before the first and after the last."""
    time, value = 1e-3 * points[:, 0], points[:, 1]
    if len(time) == 1:
        return constant(float(value[0]))
    starts = [*time.tolist()]
    rows = [*_pieces(time, value, interpolation), (float(value[-1]),)]
    if starts[0] <= 0.0:
        starts[0] = -math.inf  # the run begins at 0
        return TimeFunction(tuple(starts), tuple(time.tolist()), tuple(rows))
    first = float(time[0])
    return TimeFunction((-math.inf, *starts), (first, *time.tolist()), ((float(value[0]),), *rows))


def _table(name: str, where: str, folder: Path) -> Array:
    """Points of a CSV file with the columns time_ms and value, (n, 2)."""
    columns = read_numbers(folder / name, where, ("time_ms", "value"))
    points = np.column_stack([columns["time_ms"], columns["value"]])
    check_rising(f"{where} time_ms", tuple(points[:, 0].tolist()))
    return points


def _of_expression(text: str, where: str, end: float) -> TimeFunction:
    """Pieces of polynomials that are the expression of `time` from 0 to the end."""
    tree = parse(text, where, Names(("time",)))

    def at(time: Array) -> Array:
        value = np.broadcast_to(np.asarray(compute(tree, {("time", None): time}), dtype=float), time.shape)
        if not np.isfinite(value).all():
            bad = float(time[~np.isfinite(value)][0])
            raise InputError(where, text, f"has no value at {1e3 * bad:.6g} ms", "change it, or end the run before")
        return value

    return fitted(at, end, where, text)


def fitted(
    at: Callable[[Array], Array], end: float, where: str, text: str, *, unit: str = "ms", shift: float = 0.0
) -> TimeFunction:
    """Fit pieces of polynomials to a function from 0 to the end; see the module.

    Parameters
    ----------
    at : callable
        Function of an array of times (s).
    end : float
        End of the run (s).
    where : str
        Name of the key in messages.
    text : str
        Its value in messages.
    unit : str
        Of places in messages: ms of times in s, or that of the places.
    shift : float
        What 0 stands for less, in messages.

    Raises
    ------
    InputError
        For functions that jump, and those that would need more than `PIECES`.
    """
    u = np.cos(math.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1))
    to_powers = np.stack([_padded(chebyshev.cheb2poly(row)) for row in np.eye(DEGREE + 1)], axis=1)
    fit = to_powers @ np.linalg.inv(chebyshev.chebvander(u, DEGREE))
    between = np.linspace(-1.0, 1.0, 3 * DEGREE)
    largest = float(np.abs(at(np.linspace(0.0, end, 1001))).max()) or 1.0
    pieces: list[tuple[float, float, tuple[float, ...]]] = []  # begin, middle, coefficients
    left = [(0.0, end, 0)]
    while left:
        begin, stop, halved = left.pop()
        middle, half = 0.5 * (begin + stop), 0.5 * (stop - begin)
        power = fit @ at(middle + half * u)
        power[np.abs(power) < 0.1 * CLOSE * largest] = 0.0
        value = at(middle + half * between)
        off = float(np.abs(np.polynomial.polynomial.polyval(between, power) - value).max())
        if off > (CLOSE if halved < HALVINGS else KINK) * max(largest, float(np.abs(value).max())):
            if halved == HALVINGS:
                place = 1e3 * middle if unit == "ms" else middle - shift
                cure = "let it change over some time, as smoothed steps do" if unit == "ms" else "write a steep ramp"
                raise InputError(where, text, f"jumps at {place:.6g} {unit}", cure)
            if len(pieces) + len(left) > PIECES:
                problem = f"needs more than {PIECES} pieces of polynomials"
                cure = "write slower changes" + ("; fast sines belong into sines" if unit == "ms" else "")
                raise InputError(where, text, problem, cure)
            left += [(middle, stop, halved + 1), (begin, middle, halved + 1)]
            continue
        last = int(np.flatnonzero(power).max(initial=0))
        pieces.append((begin, middle, tuple((power[: last + 1] / half ** np.arange(last + 1)).tolist())))
    starts = (-math.inf, *(begin for begin, _, _ in pieces[1:]))
    return TimeFunction(starts, tuple(m for _, m, _ in pieces), tuple(row for _, _, row in pieces))


def _padded(row: Array) -> Array:
    return np.pad(row, (0, DEGREE + 1 - len(row)))
