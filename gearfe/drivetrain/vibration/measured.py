"""Measured accelerations: CSV files and universal files (data set 58), as spectra to stand beside computed ones."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...base.errors import InputError, unknown_name
from ...base.files import read_numbers, read_text
from ...base.spectrum import amplitude_spectrum, uniform_step
from ...base.tables.spectrum import MeasuredTable
from ...base.typing import Array
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
        return read_universal(read_text(folder / one.file, where, foreign=True), one.number, where)
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


#: Of data set 58: function types over the time, of amplitudes, and of mean squares; numbers as Fortran writes them.
TIME, AMPLITUDES, SQUARES = (1,), (12,), (2, 3)
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[EeDd][-+]?\d+)?")


def read_universal(text: str, number: int, where: str) -> tuple[Array, Array, bool]:
    """Data set 58 of a universal file: abscissa, ordinates (m/s2; sizes of complex ones), whether over the time.

    Record 6 has the function type (1 time response, 12 spectrum), record 7 the ordinates' type (2, 4 real; 5, 6
    complex), their number, the spacing (1 even), the abscissa's begin and step; the data follow record 11. (Universal
    file data sets, number 58, SDRC/University of Cincinnati, sdrl.uc.edu.)

    Raises
    ------
    InputError
        When there is no such set, or it is binary, cut off or of another kind.
    """
    lines = text.splitlines()
    marks = [i for i, line in enumerate(lines) if line.strip() == "-1"]
    sets = [lines[a + 1 : b] for a, b in zip(marks[::2], marks[1::2], strict=False)]
    found = [one for one in sets if one and one[0].split()[:1] in (["58"], ["58b"])]
    cure = "export it as a universal file with an ASCII data set 58"
    if len(found) < number:
        raise InputError(where, number, f"is not there: the file has {len(found)} data sets 58", cure)
    rows = found[number - 1][1:]
    if found[number - 1][0].split()[0] != "58":
        raise InputError(where, number, "is a binary data set", cure)
    try:
        function = int(rows[5].split()[0])
        kind, count, spacing = (int(cell) for cell in rows[6].split()[:3])
        begin, step = (float(cell) for cell in rows[6].split()[3:5])
        data = np.array([float(cell.replace("D", "E")) for row in rows[11:] for cell in _NUMBER.findall(row)])
    except (IndexError, ValueError):
        raise InputError(where, number, "cannot be read as data set 58", cure) from None
    if function not in (*TIME, *AMPLITUDES, *SQUARES) or kind not in (2, 4, 5, 6):
        problem = f"has function type {function}: 1 (time response), 12 (spectrum), 2 and 3 (power) are known"
        raise InputError(where, number, problem, cure)
    parts = (2 if kind in (5, 6) else 1) + (1 if spacing == 0 else 0)
    if len(data) < parts * count:
        raise InputError(where, number, f"is cut off: {len(data)} of {parts * count} numbers", cure)
    table = data[: parts * count].reshape(count, parts)
    x = table[:, 0] if spacing == 0 else begin + step * np.arange(count)
    y = table[:, 1 if spacing == 0 else 0 :]
    values = y[:, 0] if y.shape[1] == 1 else np.hypot(y[:, 0], y[:, 1])
    if function in SQUARES:
        values = math.sqrt(2.0) * np.sqrt(np.abs(values))
    return _checked(x, values, function in TIME, where)
