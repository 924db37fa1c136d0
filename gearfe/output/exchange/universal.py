"""Read universal files: nodes, modes and functions of modal tests, as text or with binary functions.

A file is a sequence of data sets, each between two lines of -1 and with its number in the first line. The numbers are
15 and 2411 (nodes), 164 (units), 55 (data at nodes, here mode shapes), and 58 (a function; 58b in binary). Sources:
Universal file data sets, Structural Dynamics Research Laboratory, University of Cincinnati (sdrl.uc.edu); binary
functions as of its page on data set 58b.
"""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...base.errors import InputError
from ...base.files import read_bytes
from ...base.typing import Array

#: Numbers as Fortran writes them, which may touch.
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[EeDd][-+]?\d+)?")
#: Types of data by their code: real and complex, of single and of double precision.
_REAL, _COMPLEX, _SINGLE = (2, 4), (5, 6), (2, 5)
#: Analyses whose data are modes: normal ones, complex ones by displacements or by velocities.
NORMAL, MODES = 2, (2, 3, 7)
#: Lines of text before the data of a binary function; the format has 11.
MOST_HEADS = 100
_MARK = b"-1"
_DAMAGED = "the file may be cut short or damaged: write it again"


class DataSet(NamedTuple):
    """Hold a data set: number, lines, position of its first line in the file, bytes of a binary one."""

    number: int
    lines: list[str]
    first: int
    binary: tuple[str, bytes] | None  # order of bytes, data


@dataclass(frozen=True)
class Mode:
    """Data set 55: a mode.

    Attributes
    ----------
    analysis : int
        Kind of analysis, one of `MODES`.
    numbers : ndarray
        Frequency (Hz), modal mass, viscous and hysteretic damping of normal modes; real and imaginary part of the
        eigenvalue (rad/s), of modal A and of modal B of complex ones.
    nodes : tuple of int
        Labels of the nodes.
    values : ndarray, shape (nodes, 3)
        Translations, real or complex.
    """

    analysis: int
    numbers: Array
    nodes: tuple[int, ...]
    values: Any


@dataclass(frozen=True)
class Shapes:
    """Modes of a file with the places of their nodes.

    Attributes
    ----------
    nodes : dict of int to ndarray
        Label -> coordinates (m; the file's unit where it has no data set of units).
    modes : tuple of Mode
    """

    nodes: dict[int, Array]
    modes: tuple[Mode, ...]


@dataclass(frozen=True)
class Function:
    """Data set 58: a function.

    Attributes
    ----------
    kind : int
        Type of function: 1 time response, 2 auto spectrum, 3 cross spectrum, 12 spectrum, ...
    abscissa, ordinates : ndarray
        Values, in the units of the file; the ordinates may be complex.
    """

    kind: int
    abscissa: Array
    ordinates: Any


def read_shapes(path: Path, field: str) -> Shapes:
    """Read the nodes and modes of a file.

    Raises
    ------
    InputError
        For files that cannot be read, and damaged data sets.
    """
    sets = _data_sets(read_bytes(path, field), path.name, field)
    length, modes = 1.0, []
    nodes: dict[int, Array] = {}
    for one in sets:
        try:
            if one.number == 164:
                length = float(_numbers(one.lines[1:])[0])
            elif one.number in (15, 2411):
                nodes |= _nodes(one)
            elif one.number == 55 and (mode := _mode(one)) is not None:
                modes.append(mode)
        except (ValueError, IndexError, OverflowError) as error:
            raise _damaged(one, path.name, field, str(error)) from None
    if not 0.0 < length < np.inf:
        problem = f"has the factor {length:g} from metres to its unit of length (data set 164)"
        raise InputError(field, path.name, problem, "write 1 for metres, 1000 for millimetres")
    return Shapes({label: place / length for label, place in nodes.items()}, tuple(modes))


def read_function(content: bytes, number: int, field: str) -> Function:
    """Read one of the functions of a file.

    Parameters
    ----------
    content : bytes
        The file.
    number : int
        Number of the data set among those of functions, from 1.
    field : str
        Name of the key in messages.

    Raises
    ------
    InputError
        When there is no such data set, or it cannot be read.
    """
    sets = [one for one in _data_sets(content, "", field) if one.number == 58]
    if len(sets) < number:
        cure = "export functions as data sets 58 of a universal file"
        raise InputError(field, number, f"is not there: the file has {len(sets)} data sets 58", cure)
    try:
        return _function(sets[number - 1])
    except (ValueError, IndexError, OverflowError) as error:
        raise _damaged(sets[number - 1], number, field, str(error)) from None


def _damaged(one: DataSet, value: object, field: str, reason: str) -> InputError:
    return InputError(field, value, f"cannot be read as data set {one.number}, line {one.first}: {reason}", _DAMAGED)


def _data_sets(content: bytes, name: str, field: str) -> list[DataSet]:
    """Data sets of a file.

    Raises
    ------
    InputError
        When a data set does not end, or the first line of a binary one is damaged.
    """
    sets: list[DataSet] = []
    at = count = 0

    def line() -> bytes | None:
        nonlocal at, count
        if at >= len(content):
            return None
        end = content.find(b"\n", at)
        end = len(content) if end < 0 else end
        text, at, count = content[at:end], end + 1, count + 1
        return text.strip(b"\r")

    while (text := line()) is not None:
        if text.strip() != _MARK:
            continue
        head = (line() or b"").decode("latin-1").split()
        first, lines, binary, ended = count, [], None, False
        if head and head[0].lower() == "58b":
            try:
                order, kind, heads, size = (int(word) for word in head[1:5])
                if order not in (1, 2) or kind != 2:
                    raise ValueError("its numbers are not those of IEEE 754")
                if not (0 <= heads <= MOST_HEADS and size >= 0):
                    raise ValueError(f"{heads} lines of text and {size} bytes of data")
            except ValueError as error:
                raise InputError(field, name or None, f"line {count}: {' '.join(head)!r}: {error}", _DAMAGED) from None
            lines = [(line() or b"").decode("latin-1") for _ in range(heads)]
            size = _binary_size(content, at, size, lines)
            binary = "<" if order == 1 else ">", content[at : at + size]
            at += size
        while (text := line()) is not None:
            if text.strip() == _MARK:
                ended = True
                break
            lines.append(text.decode("latin-1"))
        number = head[0].lower().rstrip("b") if head else ""
        if not ended:
            problem = f"ends within the data set {number or '(no number)'} of line {first}"
            raise InputError(field, name or None, problem, _DAMAGED)
        if number.isdigit():
            sets.append(DataSet(int(number), lines, first, binary))
    return sets


def _binary_size(content: bytes, begin: int, said: int, lines: list[str]) -> int:
    """Bytes of binary data that begin at a place: as many as the file says, if its end follows there.

    pyuff 2.5 counts the ordinates alone, as if they were real; then the size follows from record 7.
    """
    sizes = [said]
    with suppress(ValueError, IndexError):
        data_type, count, spacing = (int(word) for word in lines[6].split()[:3])
        sizes.append((4 if data_type in _SINGLE else 8) * count * (1 + (data_type in _COMPLEX) + (spacing == 0)))
    ends = (size for size in sizes if size >= 0 and content[begin + size :][:80].split()[:1] == [_MARK])
    return next(ends, said)


def _numbers(lines: list[str]) -> Array:
    """Numbers of lines; ValueError where there is anything else."""
    for text in lines:
        if _NUMBER.sub("", text).strip():
            raise ValueError(f"{text.strip()[:60]!r} is not a row of numbers")
    return np.array([float(word.upper().replace("D", "E")) for text in lines for word in _NUMBER.findall(text)])


def _nodes(one: DataSet) -> dict[int, Array]:
    """Places of nodes: label, two coordinate systems, colour, x, y, z."""
    rows = _numbers(one.lines).reshape(-1, 7)
    return {int(row[0]): row[4:] for row in rows}


def _mode(one: DataSet) -> Mode | None:
    """The mode of a data set 55, None for data of other analyses."""
    lines = one.lines
    analysis, kind, per_node = (int(number) for number in _numbers([lines[5]])[[1, 4, 5]])
    if analysis not in MODES:
        return None
    if kind not in (2, 5) or per_node not in (3, 6):
        raise ValueError(
            f"has {per_node} values of type {kind} for each node: 3 or 6, real (2) or complex (5), are known"
        )
    integers, reals = (int(number) for number in _numbers([lines[6]])[:2])
    at = 6 + -(-(2 + integers) // 8)
    begin = at + -(-reals // 6)
    numbers = _numbers(lines[at:begin])
    if len(numbers) != reals or reals < (4 if analysis == NORMAL else 2):
        raise ValueError(f"has {len(numbers)} numbers of the mode, not {reals}")
    size = per_node * (2 if kind in _COMPLEX else 1)
    rows = 1 + -(-size // 6)
    body = [text for text in lines[begin:] if text.strip()]
    if len(body) % rows:
        raise ValueError(f"has {len(body)} lines of data, which are not {rows} for each node")
    labels = tuple(int(text) for text in body[::rows])
    values = np.array([_numbers(body[i + 1 : i + rows]) for i in range(0, len(body), rows)]).reshape(len(labels), size)
    if kind in _COMPLEX:
        values = values[:, ::2] + 1j * values[:, 1::2]
    return Mode(analysis, numbers, labels, values[:, :3])


def _function(one: DataSet) -> Function:
    """A data set 58.

    Record 6 has the type of function. Record 7 has the type of the ordinates (2, 4 real; 5, 6 complex), their number,
    the spacing (1 even), and start and step of the abscissa. The data follow record 11.
    """
    kind = int(one.lines[5].split()[0])
    words = one.lines[6].split()
    data_type, count, spacing = (int(word) for word in words[:3])
    begin, step = _numbers([" ".join(words[3:5])])
    if data_type not in (*_REAL, *_COMPLEX):
        raise ValueError(f"has ordinates of type {data_type}: 2 and 4 (real), 5 and 6 (complex) are known")
    if one.binary is None:
        data = _numbers(one.lines[11:])
    else:
        order, content = one.binary
        width = 4 if data_type in _SINGLE else 8
        data = np.frombuffer(content[: len(content) // width * width], f"{order}f{width}").astype(float)
    complex_, uneven = data_type in _COMPLEX, spacing == 0
    parts = 1 + complex_ + uneven
    if count < 0 or len(data) < parts * count:
        raise ValueError(f"is cut off: {len(data)} of {parts * count} numbers")
    table = data[: parts * count].reshape(count, parts)
    abscissa = table[:, 0] if uneven else begin + step * np.arange(count)
    ordinates = table[:, int(uneven) :]
    return Function(kind, abscissa, ordinates[:, 0] + 1j * ordinates[:, 1] if complex_ else ordinates[:, 0])
