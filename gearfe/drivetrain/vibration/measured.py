"""Measured accelerations: spectra of CSV files and universal files (data set 58), to compare with computed ones."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...base.errors import InputError, unknown_name
from ...base.files import read_bytes, read_numbers
from ...base.spectrum import amplitude_spectrum, uniform_step
from ...base.tables.spectrum import MeasuredTable
from ...base.typing import Array
from ...output.exchange.universal import read_function
from ..gearbox.job import TrainJob

VALUE = "acceleration_m_per_s2"


@dataclass(frozen=True, eq=False)
class Measured:
    """A measured spectrum: amplitudes (m/s2) of lines over the frequency (Hz), at an attachment."""

    name: str
    attachment: str
    frequency: Array
    amplitude: Array


def read_measured(job: TrainJob) -> tuple[Measured, ...]:
    """Measured spectra of a job's [spectrum], from files beside it.

    Raises
    ------
    InputError
        Attachments that the train does not have; files that cannot be read.
    """
    known = [str(a) for shaft in job.table.shafts for a in shaft.attachments]
    made = []
    for i, one in enumerate(job.spectrum.measured):
        where = f"spectrum.measured[{i}]"
        if str(one.attachment) not in known:
            raise unknown_name(f"{where}.attachment", str(one.attachment), known)
        abscissa, values, over_time = _read(one, f"{where}.file", job.path.parent)
        if over_time:
            spectrum = amplitude_spectrum(values, uniform_step(abscissa), window=job.spectrum.window)
            abscissa, values = spectrum.frequency, spectrum.amplitude
        made.append(Measured(one.name, str(one.attachment), abscissa, np.abs(values)))
    return tuple(made)


def _read(one: MeasuredTable, where: str, folder: Path) -> tuple[Array, Array, bool]:
    """Abscissa, accelerations, and whether they are over the time."""
    if Path(one.file).suffix.lower() in (".uff", ".unv", ".uf58"):
        return read_universal(read_bytes(folder / one.file, where), one.number, where)
    columns = read_numbers(folder / one.file, where, (VALUE,), ("time_s", "frequency_Hz"))
    over = next((name for name in ("time_s", "frequency_Hz") if name in columns), None)
    if over is None:
        cure = f"its first line names the columns: time_s (or frequency_Hz) and {VALUE}"
        raise InputError(where, one.file, "has no column time_s or frequency_Hz", cure)
    return _checked(columns[over], columns[VALUE], over == "time_s", where)


def _checked(x: Array, y: Array, over_time: bool, where: str) -> tuple[Array, Array, bool]:
    if len(x) < 4 or not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise InputError(where, len(x), "must hold four finite rows at least", "give a longer record")
    if not (np.diff(x) > 0.0).all():
        raise InputError(where, None, "must have a rising first column", "sort the rows")
    if not over_time and x[0] < 0.0:
        raise InputError(where, float(x[0]), "holds frequencies below 0", "give a one-sided spectrum")
    return x, y, over_time


#: Types of functions over the time, of amplitudes, and of mean squares.
TIME, AMPLITUDES, SQUARES = (1,), (12,), (2, 3)


def read_universal(content: bytes, number: int, where: str) -> tuple[Array, Array, bool]:
    """Abscissa, accelerations (m/s2; amplitudes of complex ones) of a function, and whether it is over the time.

    Raises
    ------
    InputError
        When the universal file has no such function, or one of another kind.
    """
    function = read_function(content, number, where)
    if function.kind not in (*TIME, *AMPLITUDES, *SQUARES):
        problem = f"has function type {function.kind}: 1 (time response), 12 (spectrum), 2 and 3 (power) are known"
        raise InputError(where, number, problem, "export an acceleration over time or frequency")
    y = function.ordinates
    values = np.hypot(y.real, y.imag) if np.iscomplexobj(y) else y
    if function.kind in SQUARES:
        values = math.sqrt(2.0) * np.sqrt(np.abs(values))
    return _checked(function.abscissa, values, function.kind in TIME, where)
