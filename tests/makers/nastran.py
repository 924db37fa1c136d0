"""Writers of Nastran's matrix files, from the description of the formats: OUTPUT4 and OUTPUT2."""

from __future__ import annotations

import struct
from collections.abc import Iterator

import numpy as np


def strings(column: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
    """First row and values of each run of numbers that are not zero."""
    places = np.flatnonzero(column)
    for run in np.split(places, np.flatnonzero(np.diff(places) > 1) + 1):
        if len(run):
            yield int(run[0]) + 1, column[run]


def lines(values: np.ndarray) -> str:
    """Numbers as the format 1P,3E23.16 writes them."""
    text = [f"{value:23.16E}" for value in values]
    return "".join("".join(text[i : i + 3]) + "\n" for i in range(0, len(text), 3))


def output4_text(matrices: dict[str, np.ndarray], layout: str) -> str:
    """Double precision; `layout` is ``full`` columns, ``packed`` heads of strings, or ``wide`` ones of two words."""
    made = ""
    for name, A in matrices.items():
        n, m = A.shape
        made += f"{m:8d}{-n if layout == 'wide' else n:8d}{2:8d}{2:8d}{name:<8}1P,3E23.16\n"
        for j, column in enumerate(A.T):
            runs = list(strings(column))
            if layout == "full" and runs:
                first, last = runs[0][0], runs[-1][0] + len(runs[-1][1]) - 1
                made += f"{j + 1:8d}{first:8d}{last - first + 1:8d}\n" + lines(column[first - 1 : last])
            elif runs:
                heads = 2 if layout == "wide" else 1
                words = sum(heads + 2 * len(run) for _, run in runs)
                made += f"{j + 1:8d}{0:8d}{words:8d}\n"
                for row, run in runs:
                    length = 2 * len(run) + 1
                    made += f"{length:8d}{row:8d}\n" if heads == 2 else f"{65536 * length + row:8d}\n"
                    made += lines(run)
        made += f"{m + 1:8d}{1:8d}{1:8d}\n" + lines(np.ones(1))
    return made


def fortran(records: list[bytes], order: str) -> bytes:
    return b"".join(struct.pack(f"{order}i", len(one)) + one + struct.pack(f"{order}i", len(one)) for one in records)


def output4_binary(matrices: dict[str, np.ndarray], layout: str, order: str = "<") -> bytes:
    records = []
    for name, A in matrices.items():
        n, m = A.shape
        records.append(struct.pack(f"{order}4i8s", m, -n if layout == "wide" else n, 2, 2, name.ljust(8).encode()))
        for j, column in enumerate(A.T):
            if layout == "full":
                records.append(struct.pack(f"{order}3i{n}d", j + 1, 1, 2 * n, *column))
                continue
            data = b""
            for row, run in strings(column):
                length = 2 * len(run) + 1
                head = (length, row) if layout == "wide" else (65536 * length + row,)
                data += struct.pack(f"{order}{len(head)}i{len(run)}d", *head, *run)
            records.append(struct.pack(f"{order}3i", j + 1, 0, len(data) // 4) + data)
        records.append(struct.pack(f"{order}3id", m + 1, 1, 2, 1.0))
    return fortran(records, order)


class Output2:
    """Records of an OUTPUT2 file, of words of four or eight bytes, double precision."""

    def __init__(self, order: str = "<", size: int = 4) -> None:
        self.order, self.size, self.records = order, size, []
        for word, data in ((3, self.ints(6, 27, 26)), (7, self.text("NASTRAN FORT TAPE ID CODE - ", 7))):
            self.put(word, data)
        self.put(2, self.text("XXXXXXXX", 2))
        self.keys(-1, 0)

    def ints(self, *values: int) -> bytes:
        return struct.pack(f"{self.order}{len(values)}{'i' if self.size == 4 else 'q'}", *values)

    def text(self, name: str, words: int = 2) -> bytes:
        return b"".join(name[4 * i : 4 * i + 4].ljust(4).encode() + b" " * (self.size - 4) for i in range(words))

    def keys(self, *values: int) -> None:
        self.records += [self.ints(value) for value in values]

    def put(self, count: int, data: bytes) -> None:
        self.keys(count)
        self.records.append(data)

    def begin(self, name: str, *trailer: int) -> None:
        self.put(2, self.text(name))
        self.keys(-1)
        self.put(7, self.ints(*trailer))
        self.keys(-2, 1, 0)
        self.put(2, self.text(name))

    def matrix(self, name: str, A: np.ndarray) -> None:
        n, m = A.shape
        self.begin(name, 101, m, n, 6, 2, 0, 0)
        for j, column in enumerate(A.T):
            self.keys(-3 - j, 1, 1)
            for row, run in strings(column):
                self.put(len(run) * 8 // self.size, self.ints(row) + struct.pack(f"{self.order}{len(run)}d", *run))
        self.keys(-3 - m, 1, 0, 0)

    def pool(self, matrices: dict[str, np.ndarray], labels: list[tuple[int, int]]) -> None:
        """DMIG entries, the lower half of symmetric matrices, in one record of two pieces."""
        self.begin("MATPOOL", 101, 32768, 0, 0, 0, 0, 0)
        data = self.ints(114, 1, 120)
        for name, A in matrices.items():
            data += self.text(name) + self.ints(0, 6, 2, 2, 0, 0, len(A))
            for j, column in enumerate(labels):
                data += self.ints(*column)
                for i in range(j, len(A)):
                    data += self.ints(*labels[i]) + struct.pack(f"{self.order}d", A[i, j])
                data += self.ints(-1, -1)
            data += self.ints(-1, -1)
        cut = len(data) // self.size // 2
        self.keys(-3, 1, 0)
        for piece in (data[: cut * self.size], data[cut * self.size :]):
            self.put(len(piece) // self.size, piece)
        self.keys(-4, 1, 0, 0)

    def bytes(self) -> bytes:
        return fortran([*self.records, self.ints(0)], self.order)
