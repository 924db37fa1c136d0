"""Named arrays behind one pointer, for compiled kernels.

Numba hands a named tuple of arrays to a function as all its addresses, lengths and strides: some 500 numbers a call for
the tables and the work space of a mechanism, which the compiler then carries through every function. Here they lie in
one block of 8-byte words, and a kernel gets the block's address. In kernels a `Packed` reads like the named tuple it
was made from.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

#: Types of elements: float64, int64, uint64.
ELEMENTS = "dlL"
#: Each member: type and number of axes of an array ("d", 2), a number ("d", -1), or the members of a named tuple.
Layout = tuple[tuple[str, Any], ...]


class Packed:
    """A named tuple of C-contiguous float64 and int64 arrays, floats, and of such tuples, as one block of words.

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
        self._numba_type_ = packed_type(_lay_out(named, words))
        self._held = named, np.array(words, dtype=np.int64)
        self.address = _address(self._held[1])


def _lay_out(named: Any, words: list[int]) -> Layout:
    """Layout of a named tuple; its words join `words`."""
    members: list[tuple[str, Any]] = []
    for name, value in zip(named._fields, named, strict=True):
        if isinstance(value, np.ndarray):
            kind = value.dtype.char
            if kind not in ELEMENTS or not value.flags.c_contiguous:
                raise TypeError(f"{name}: {value.dtype} array, C-contiguous: {value.flags.c_contiguous}")
            words.append(_address(value))
            words.extend(value.shape)
            members.append((name, (kind, value.ndim)))
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


def _size(member: Any) -> int:
    """Words of a member."""
    if isinstance(member[0], str):
        return max(1, 1 + int(member[1]))
    return sum(_size(inner) for _, inner in member)


@lru_cache
def packed_type(layout: Layout) -> Any:
    """Numba's type of such a block."""
    return _taught()(layout)


@lru_cache(maxsize=1)
def _taught() -> Any:
    """Class of the types, which numba has been taught."""
    from llvmlite import ir
    from numba.core import types
    from numba.core.typing.templates import AttributeTemplate
    from numba.extending import (
        NativeValue,
        infer_getattr,
        lower_getattr_generic,
        models,
        register_model,
        unbox,
    )
    from numba.np import arrayobj

    numbers = {"d": types.float64, "l": types.int64, "L": types.uint64}

    class PackedType(types.Type):
        def __init__(self, layout: Layout) -> None:
            self.layout = layout
            super().__init__(name=f"Packed({layout})")

        def member(self, name: str) -> tuple[int, Any]:
            """First word and layout of a member."""
            first = 0
            for own, inner in self.layout:
                if own == name:
                    return first, inner
                first += _size(inner)
            raise AttributeError(name)

    @register_model(PackedType)
    class _Model(models.PrimitiveModel):
        def __init__(self, manager: Any, kind: Any) -> None:
            super().__init__(manager, kind, ir.IntType(64).as_pointer())

    def kind_of(inner: Any) -> Any:
        if not isinstance(inner[0], str):
            return PackedType(inner)
        return numbers[inner[0]] if inner[1] < 0 else types.Array(numbers[inner[0]], inner[1], "C")

    @infer_getattr
    class _Members(AttributeTemplate):
        key = PackedType

        def generic_resolve(self, kind: Any, name: str) -> Any:
            return kind_of(kind.member(name)[1]) if name in dict(kind.layout) else None

    @lower_getattr_generic(PackedType)
    def _get(context: Any, builder: Any, kind: Any, block: Any, name: str) -> Any:
        first, inner = kind.member(name)
        word = ir.IntType(64)

        def place(k: int) -> Any:
            return builder.gep(block, [word(first + k)], inbounds=True)

        def load(k: int, as_float: bool = False) -> Any:
            where = builder.bitcast(place(k), ir.DoubleType().as_pointer()) if as_float else place(k)
            read = builder.load(where)
            read.set_metadata("invariant.load", builder.module.add_metadata([]))
            return read

        if not isinstance(inner[0], str):
            return place(0)
        if inner[1] < 0:
            return load(0, inner[0] == "d")
        array_type = kind_of(inner)
        array = arrayobj.make_array(array_type)(context, builder)
        shape = [load(1 + axis) for axis in range(inner[1])]
        strides = [word(8)]
        for length in reversed(shape[1:]):
            strides.insert(0, builder.mul(length, strides[0]))
        data = builder.inttoptr(load(0), context.get_value_type(array_type.dtype).as_pointer())
        arrayobj.populate_array(array, data=data, shape=shape, strides=strides, itemsize=word(8), meminfo=None)
        return array._getvalue()

    @unbox(PackedType)
    def _unbox(_: Any, value: Any, c: Any) -> Any:
        number = c.pyapi.object_getattr_string(value, "address")
        address = c.pyapi.long_as_longlong(number)
        c.pyapi.decref(number)
        return NativeValue(c.builder.inttoptr(address, ir.IntType(64).as_pointer()))

    return PackedType
