"""Read matrices from files of Nastran: OUTPUT4, text or binary, and OUTPUT2.

OUTPUT4: each matrix has a line (columns, rows, form, type, name, format), then its columns (number, first row, words of
data, data). The last column has no meaning. If the first row is 0, the data are strings of neighbouring rows, each
after its length and first row. These are packed into one word, or into two words if the number of rows is negative.

OUTPUT2: Fortran records, each after the number of its words. A matrix is a name, a trailer (file, columns, rows, form,
type, ...), and for each column records of first row and values. Tables of the kind MATPOOL hold DMIG entries (EXTSEOUT
with DMIGOP2).

Sources: MSC Nastran DMAP Programmer's Guide, modules OUTPUT2, OUTPUT4; data block MATPOOL.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...base.errors import InputError
from ...base.files import read_bytes
from ...base.typing import Array
from .matrix_entries import Entries
from .nastran_cards import number

#: Matrices by name: values, or single entries with node and degree of freedom.
Matrices = dict[str, Array | Entries]
DMIG = (114, 1, 120)  # what the DMIG entries of a MATPOOL begin with
#: Types: real, and those of double precision, which take two words of four bytes; 3 and 4 are complex.
REAL, DOUBLE = (1, 2), (2, 4)
PACKED = 65536
#: Numbers of a matrix beside stiffness and mass, such as the rows for recovery: 2 GB.
MOST_ENTRIES = 2**28
#: Numbers in a line, and characters of a number, up to which a format is one: writers use 3 to 5 and 16 to 26.
WIDEST = 1000


def read_nastran(path: Path, field: str) -> Matrices:
    """All real matrices of a file .op2 or .op4.

    Raises
    ------
    InputError
        When there is no such file, or it is not of its kind.
    """
    kind, read = ("OUTPUT2", output2) if path.suffix.lower() == ".op2" else ("OUTPUT4", output4)
    content = read_bytes(path, field, 8 * MOST_ENTRIES)
    try:
        return read(content)
    except (ValueError, IndexError, StopIteration, OverflowError, RuntimeError):
        cure = "the file may be cut short or damaged: write it again; a punch file of DMIG entries will do as well"
        raise InputError(field, path.name, f"cannot be read as {kind}", cure) from None


@dataclass(frozen=True)
class Words:
    """Hold byte order (``<`` or ``>``) and bytes per word (4 or 8) of a binary file."""

    order: str
    size: int

    def __post_init__(self) -> None:
        """Raise ValueError for words that no file has."""
        if self.size not in (4, 8):
            raise ValueError(f"words of {self.size} bytes")

    def integers(self, data: bytes) -> list[int]:
        whole = data[: len(data) // self.size * self.size]
        return [int(one) for one in np.frombuffer(whole, f"{self.order}i{self.size}")]

    def reals(self, data: bytes, kind: int) -> Array:
        """Values of a type 1 to 4."""
        size = 8 if kind in DOUBLE else self.size
        return np.frombuffer(data, f"{self.order}f{size}").astype(float)

    def words(self, kind: int) -> int:
        """Words of a real number."""
        return 2 if kind in DOUBLE and self.size == 4 else 1

    def text(self, data: bytes) -> str:
        """A name: four letters a word, blanks where there is room for eight."""
        letters = b"".join(data[i : i + 4] for i in range(0, len(data), self.size))
        return letters.decode("ascii").strip().upper()


def _zeros(rows: int, columns: int) -> Array:
    """Zeros of a matrix; ValueError for sizes that only damaged files name."""
    if rows < 0 or columns < 0 or rows * columns > MOST_ENTRIES:
        raise ValueError(f"a matrix of {rows} x {columns}")
    return np.zeros((rows, columns))


def _fortran(data: bytes) -> tuple[str, list[bytes]]:
    """Order of bytes, and the records of a sequential unformatted file."""
    if not data:
        raise ValueError("no records")
    order = "<" if int.from_bytes(data[:4], "little") < PACKED else ">"
    records, at = [], 0
    while at < len(data):
        (length,) = np.frombuffer(data[at : at + 4], f"{order}i4")
        end = at + 4 + int(length)
        if length < 0 or data[end : end + 4] != data[at : at + 4]:
            raise ValueError("no Fortran record")
        records.append(data[at + 4 : end])
        at = end + 4
    return order, records


def output2(data: bytes) -> Matrices:
    """Matrices of an OUTPUT2 file, and those of DMIG entries in it."""
    order, found = _fortran(data)
    words = Words(order, len(found[0]))
    records = iter([*found, b"\0" * words.size])  # a file may end without its key of zero
    made: Matrices = {}

    def key() -> int:
        (value,) = words.integers(next(records, b""))
        return value

    count = key()
    if count == 3:  # date and label of the file
        while count:
            if count > 0:
                next(records)
            count = key()
        count = key()
    while count > 0:
        name = words.text(next(records))
        key(), key()
        trailer = words.integers(next(records))
        pieces = list(_logical_records(key, records))
        if any(column for column, _ in pieces):
            _, columns, rows, _, kind = trailer[:5]
            if kind in REAL:
                made[name] = _columns_of(words, pieces, (rows, columns), kind)
        else:
            made |= _pool(words, [b"".join(parts) for _, parts in pieces])
        count = key()
    return made


def _logical_records(key: Callable[[], int], records: Iterator[bytes]) -> Iterator[tuple[int, list[bytes]]]:
    """Logical records of a data block: whether each is a matrix column, and its pieces."""
    key()
    while True:
        key()
        column, count = key(), key()
        if count == 0:
            return
        pieces = []
        while count > 0:
            pieces.append(next(records))
            count = key()
        yield column, pieces


def _columns_of(words: Words, pieces: list[tuple[int, list[bytes]]], shape: tuple[int, int], kind: int) -> Array:
    values = _zeros(*shape)
    columns = [parts for column, parts in pieces if column]
    for j, parts in enumerate(columns):
        for part in parts:
            row = words.integers(part[: words.size])[0] - 1
            string = words.reals(part[words.size :], kind)
            values[row : row + len(string), j] = string
    return values


def _pool(words: Words, records: list[bytes]) -> dict[str, Entries]:
    """Matrices of DMIG entries: name, form, type; columns of node, degree of freedom, rows of these with values."""
    made: dict[str, Entries] = {}
    for record in records:
        size, whole = words.size, words.integers(record)
        if tuple(whole[:3]) != DMIG:  # another table's
            continue
        at = 3
        while at < len(whole):
            name, kind = words.text(record[at * size : (at + 2) * size]), whole[at + 4]
            width = words.words(kind) * (1 if kind in REAL else 2)
            entries: Entries = {}
            at += 9
            while whole[at] != -1:
                column = (whole[at], whole[at + 1])
                at += 2
                while whole[at] != -1:
                    value = words.reals(record[(at + 2) * size : (at + 2 + width) * size], kind)[0]
                    entries[(whole[at], whole[at + 1]), column] = float(value)
                    at += 2 + width
                at += 2
            at += 2
            if kind in REAL:
                made[name] = entries
    return made


def output4(data: bytes) -> Matrices:
    """Matrices of an OUTPUT4 file."""
    if re.match(rb"[ \d-]{8}", data[:8]):
        return _output4_text(data.decode("ascii").splitlines())
    order, records = _fortran(data)
    made: Matrices = {}
    at = 0
    while at < len(records):
        words = Words(order, len(records[at]) // 6)  # four integers, and a name of two words
        columns, rows, _, kind = words.integers(records[at][: 4 * words.size])
        name = words.text(records[at][4 * words.size :])
        values = _zeros(abs(rows), columns)
        at += 1
        while True:
            number_, row, length = words.integers(records[at][: 3 * words.size])
            rest = records[at][3 * words.size : (3 + length) * words.size]
            at += 1
            if number_ > columns:
                break
            if kind in REAL:
                _binary_column(values[:, number_ - 1], rest, row, words, kind, rows < 0)
        if kind in REAL:
            made[name] = values
    return made


def _binary_column(column: Array, rest: bytes, row: int, words: Words, kind: int, two: bool) -> None:
    """Fill a column from its data: one string from `row` on, or several with their own heads if `row` is 0."""
    at = 0
    while at < len(rest):
        if row:
            if len(rest) % words.size:
                raise ValueError(f"a column of {len(rest)} bytes")
            head, length, first = 0, len(rest) // words.size, row
        else:
            head, length, first = _head(words.integers(rest[at : at + (1 + two) * words.size]))
        start = at + head * words.size
        string = words.reals(rest[start : start + length * words.size], kind)
        column[first - 1 : first - 1 + len(string)] = string
        at = start + length * words.size


def _head(numbers: list[int]) -> tuple[int, int, int]:
    """Words of a string's head, of its data, and its first row: two words, or one that packs both."""
    length, row = numbers if len(numbers) == 2 else divmod(numbers[0], PACKED)
    if length < 1 or row < 1:
        raise ValueError(f"a string of {length} words from row {row}")
    return len(numbers), length - 1, row


def _output4_text(lines: list[str]) -> Matrices:
    made: Matrices = {}
    at = 0

    def integers(line: str, count: int) -> list[int]:
        return [int(line[8 * i : 8 * i + 8]) for i in range(count)]

    while at < len(lines):
        columns, rows, _, kind = integers(lines[at], 4)
        name, form = lines[at][32:40].strip().upper(), re.search(r"(\d+)[ED](\d+)", lines[at][40:])
        per_line, width = (int(form[1]), int(form[2])) if form else (5, 16)
        if not (0 < per_line <= WIDEST and 0 < width <= WIDEST):
            raise ValueError(f"{per_line} numbers of {width} characters in a line")
        per_number = 2 if kind in DOUBLE else 1
        values = _zeros(abs(rows), columns)
        at += 1
        while True:
            j, row, left = integers(lines[at], 3)
            at += 1
            if j > columns:
                at += 1
                break
            while left > 0:
                if row:
                    head, count, first = 0, left, row
                    length = left
                else:
                    head, length, first = _head([int(one) for one in lines[at].split()])
                    at, count = at + 1, length // per_number
                end = at + -(-count // per_line)
                digits = "".join(line.ljust(width * per_line)[: width * per_line] for line in lines[at:end])
                numbers = [number(digits[width * i : width * (i + 1)].strip()) for i in range(count)]
                if kind in REAL:
                    values[first - 1 : first - 1 + count, j - 1] = numbers
                at, left = end, left - head - length
        if kind in REAL:
            made[name] = values
    return made
