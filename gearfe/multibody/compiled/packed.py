"""Named arrays behind one pointer, for compiled kernels.

Numba passes a named tuple of arrays to a function as all its addresses, lengths and strides. For the tables and the
work space of a mechanism these are some 500 numbers per call, which the compiler carries through every function. Here
they lie in one block of 8-byte words, and a kernel gets the block's address. In kernels a `Packed` reads like the named
tuple it was made from.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .simd import SimdArray

#: Each member: type and number of axes of an array ("d", 2), of one of SIMD vectors without theirs ("v8", 1), a number
#: ("d", -1), or the members of a named tuple.
Members = tuple[tuple[str, Any], ...]
#: Types of elements: float64, int64, uint64, complex128.
ELEMENTS = "dlLD"
#: Before the width in the type of an element of a `SimdArray`.
SIMD = "v"


class Layout(tuple[tuple[str, Any], ...]):
    """Members of a block. Entries look for their code by it at every call, so it is hashed once."""

    def __hash__(self) -> int:
        if "known" not in self.__dict__:
            self.known = super().__hash__()
        return self.known


class Packed:
    """A named tuple of C-contiguous arrays of those types, floats, and of such tuples, as one block of words.

    Parameters
    ----------
    named : NamedTuple
        The arrays stay where they are: what kernels write is seen in them.

    Raises
    ------
    TypeError
        A member is something else.
    """

    def __init__(self, named: Any) -> None:
        words: list[int] = []
        self.layout = Layout(_lay_out(named, words))
        self._held = named, np.array(words, dtype=np.int64)
        self.address = _address(self._held[1])


def _lay_out(named: Any, words: list[int]) -> Members:
    """Layout of a named tuple; its words join `words`."""
    members: list[tuple[str, Any]] = []
    for name, value in zip(named._fields, named, strict=True):
        if isinstance(value, np.ndarray):
            kind = value.dtype.char
            if kind not in ELEMENTS or not value.flags.c_contiguous:
                raise TypeError(f"{name}: {value.dtype} array, C-contiguous: {value.flags.c_contiguous}")
            words.append(_address(value))
            shape = value.shape
            if isinstance(value, SimdArray):
                kind, shape = f"{SIMD}{shape[-1]}", shape[:-1]
            words.extend(shape)
            members.append((name, (kind, len(shape))))
        elif isinstance(value, tuple):
            members.append((name, _lay_out(value, words)))
        elif isinstance(value, int):
            words.append(value)
            members.append((name, ("l", -1)))
        else:
            words.append(int(np.float64(value).view(np.int64)))
            members.append((name, ("d", -1)))
    return tuple(members)


def _address(array: np.ndarray) -> int:
    return int(array.__array_interface__["data"][0])
