r"""Operating deflection shapes: how gears and housing move together at one line of the spectrum of a transient.

For N samples of a record at the step h with the window w, whose mean is :math:`\bar w`, line k of the accelerations
has the complex amplitude

.. math::
    \hat a_k = \frac{2}{N\bar w}\sum_{n=0}^{N-1} w_n\,\frac{x_{n+1} - 2x_n + x_{n-1}}{h^2}\,e^{-2\pi i k n / N} ,
    \qquad \hat x_k = -\Big(\frac{h}{2\sin(\pi k/N)}\Big)^2\hat a_k .

The motion follows from its accelerations, as in a measurement. The static deflection under the loads is a thousand
times the vibration, and would leak into all lines of a record that does not repeat. x are the housing's coordinates,
those of elastic shafts, and the gears' motion beside rolling. All samples of the run count, so nothing from above the
spectrum is folded in.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import InputError
from ...base.spectrum import WINDOWS, uniform_step, window_at
from ...base.typing import Array, ComplexArray
from ..gearbox.fields import shown_factor, write_gears, write_housing
from ..train.gear_train import GearTrain
from ..train.response import TrainResponse
from .spectra import record

#: Pictures of one period.
FRAMES = 16
#: All that is written.
FILES = ("deflection_gears.vtkhdf", "deflection_housing.vtkhdf")


@dataclass(frozen=True, eq=False)
class Deflection:
    """Motion at a line.

    Attributes
    ----------
    asked, frequency
        Hz: of the user, and of the line nearest to it.
    pose : (gears, 6)
        Complex amplitudes of each gear's displacement (m) and rotation beside rolling (rad), along x, y, z.
    modal : (N,) or None
        Of the housing's coordinates; None for a rigid one.
    sections : (c,) or None
        Of the coordinates of elastic shafts; None without any.
    """

    asked: float
    frequency: float
    pose: ComplexArray
    modal: ComplexArray | None
    sections: ComplexArray | None = None


class DeflectionRecord:
    """Operating deflection shapes of a response that arrives piece by piece.

    Parameters
    ----------
    train
        The train.
    times : (n,)
        Output times (s), equally spaced.
    every
        Samples of the response in an output step.
    frequencies
        Hz; each takes the nearest line of the spectrum.
    window, start, length
        Of the spectrum's record, see `gearfe.drivetrain.vibration.spectra.TrainRecord`.

    Raises
    ------
    InputError
        For a frequency without a line.
    """

    def __init__(
        self, train: GearTrain, times: Array, every: int, frequencies: Sequence[float], *, window: str = "none",
        start: float = 0.0, length: float | None = None,
    ) -> None:  # fmt: skip
        first, count = record(times, start, length)
        self._train, self._asked, self._window = train, tuple(frequencies), window
        self._first, self._count = first * every, count * every
        self._lines = nearest_lines(frequencies, count, uniform_step(times))
        self._hertz = self._lines / (count * uniform_step(times))
        self._step = uniform_step(times) / every
        self._arrived = 0
        self._before = np.zeros((0, 0))  # the last two samples
        self._sum: ComplexArray | None = None
        self._widths: tuple[int, ...] = ()

    def add(self, piece: TrainResponse) -> None:
        """Take the samples that follow those taken before."""
        if not len(piece.time):
            return
        parts = _motion(self._train, piece)
        values = np.hstack([part for part in parts if part is not None])
        self._widths = tuple(0 if part is None else part.shape[1] for part in parts)
        if self._arrived:
            values = np.vstack([self._before, values])
        number = self._arrived - len(self._before) - self._first + np.arange(len(values))
        self._arrived += len(piece.time)
        self._before = values[-2:]
        if len(values) < 3:
            return
        change, middle = (values[2:] - 2.0 * values[1:-1] + values[:-2]) / self._step**2, number[1:-1]
        if number[0] == 0 and self._first == 0:  # nothing comes before the first sample of the run
            change, middle = np.vstack([change[:1], change]), number[:-1]
        inside = (middle >= 0) & (middle < self._count)
        place = middle[inside] / self._count
        weights = window_at(self._window, place) * np.exp(-2j * math.pi * np.outer(self._lines, place))
        self._sum = weights @ change[inside] + (0.0 if self._sum is None else self._sum)

    def deflections(self) -> tuple[Deflection, ...]:
        """The shapes, when all samples have arrived; none where the run ended before that."""
        if self._sum is None or self._arrived <= self._first + self._count:
            return ()
        per_change = -((0.5 * self._step / np.sin(math.pi * self._lines / self._count)) ** 2)
        amplitudes = self._sum * (2.0 / (self._count * WINDOWS[self._window][0])) * per_change[:, None]
        ends = np.cumsum(self._widths)[:-1]
        return tuple(
            Deflection(asked, float(hertz), pose.reshape(-1, 6), *(part if len(part) else None for part in parts))
            for asked, hertz, row in zip(self._asked, self._hertz, amplitudes, strict=True)
            for pose, *parts in [np.split(row, ends)]
        )


def nearest_lines(frequencies: Sequence[float], count: int, step: float) -> Array:
    """Numbers of the spectrum's lines that are nearest to frequencies (Hz), of a record of samples at a step (s).

    Raises
    ------
    InputError
        For a frequency that is not above zero or beyond the last line.
    """
    resolution = 1.0 / (count * step)
    for frequency in frequencies:
        if not 0.5 * resolution <= frequency <= (count // 2 + 0.5) * resolution:
            problem = f"is outside the lines of the spectrum, {resolution:.6g} to {count // 2 * resolution:.6g} Hz"
            raise InputError("--deflection-Hz", frequency, problem, "choose one of them, or a longer record")
    return np.round(np.asarray(frequencies, dtype=float) / resolution)


def write_deflections(folder: Path, train: GearTrain, response: TrainResponse, found: Sequence[Deflection]) -> None:
    """Write ``deflection_gears.vtkhdf`` and, of an elastic housing, ``deflection_housing.vtkhdf``.

    The time is the number of the shape, from 1, and the part of its period. Displacements are enlarged by
    `enlargement`, accelerations are those of the enlarged motion.

    Parameters
    ----------
    folder : Path
        Folder of the files.
    train : GearTrain
        The train.
    response : TrainResponse
        The response of the run, or a piece of it.
    found : sequence of Deflection
        The shapes.
    """
    part = np.arange(FRAMES) / FRAMES
    turn = np.exp(2j * math.pi * part)[:, None]
    time = np.concatenate([number + 1 + part for number in range(len(found))])
    factors = [enlargement(train, shape) for shape in found]
    both = list(zip(found, factors, strict=True))
    pose = np.concatenate([(turn * factor * shape.pose.ravel()).real for shape, factor in both])
    moved: dict[str, Any] = {"gear_pose": pose.reshape(len(time), -1, 6)}
    if found[0].sections is not None:
        bent = [turn * factor * shape.sections for shape, factor in both if shape.sections is not None]
        moved["section_coordinates"] = np.concatenate([x.real for x in bent])
    if found[0].modal is not None:
        modal = [turn * factor * shape.modal for shape, factor in both if shape.modal is not None]
        rates = [2.0 * math.pi * shape.frequency for shape in found]
        moved["modal"] = np.concatenate([x.real for x in modal])
        moved["modal_acceleration"] = np.concatenate([-(w**2) * x.real for x, w in zip(modal, rates, strict=True)])
    swinging = replace(response, time=time, drive_angle=np.zeros(len(time)), **moved)
    steps = np.arange(len(time))
    write_gears(folder / FILES[0], train, swinging, steps)
    if train.housing is not None and train.housing.has_mesh:
        write_housing(folder / FILES[1], train.housing, swinging, steps)


def enlargement(train: GearTrain, shape: Deflection) -> float:
    """Factor by which a shape is drawn."""
    return shown_factor(train, shape.pose, shape.modal)


def deflection_entries(train: GearTrain, found: Sequence[Deflection]) -> list[dict[str, float]]:
    """Entries of the summary."""
    return [
        {"asked_Hz": shape.asked, "frequency_Hz": shape.frequency, "enlarged_by": enlargement(train, shape)}
        for shape in found
    ]


def _motion(train: GearTrain, response: TrainResponse) -> tuple[Array, Array | None, Array | None]:
    """Motion of the gears beside rolling (n, 6 gears), coordinates of the housing and of elastic shafts (n, ...)."""
    pose = response.gear_pose.copy()
    for number, gear in enumerate(train.gears):
        ratio = float(train.kinematics.ratios[train.shaft_number(gear.shaft)])
        pose[:, number, 3:] -= np.outer(ratio * response.drive_angle, train.frame[2])
    return pose.reshape(len(pose), -1), response.modal, response.section_coordinates
