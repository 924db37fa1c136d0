# mypy: disable-error-code="no-untyped-call"
"""Numba's type of a `gearfe.multibody.compiled.packed.Packed`: how kernels read its members.

A module of its own: code in the cache names its types by the module they are in.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import types
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, lower_getattr_generic, models, register_model
from numba.np import arrayobj

from .packed import SIMD, Members
from .simd_type import SimdType

NUMBERS = {"d": types.float64, "l": types.int64, "L": types.uint64, "D": types.complex128}


class PackedType(types.Type):
    def __init__(self, layout: Members) -> None:
        self.layout = layout
        super().__init__(name=f"Packed({layout})")

    def member(self, name: str) -> tuple[int, Any]:
        """First word and layout of a member."""
        first = 0
        for own, inner in self.layout:
            if own == name:
                return first, inner
            first += size_of(inner)
        raise AttributeError(name)


def size_of(member: Any) -> int:
    """Words of a member."""
    if isinstance(member[0], str):
        return max(1, 1 + int(member[1]))
    return sum(size_of(inner) for _, inner in member)


@register_model(PackedType)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, ir.IntType(64).as_pointer())


def kind_of(inner: Any) -> Any:
    if not isinstance(inner[0], str):
        return PackedType(inner)
    number = SimdType(int(inner[0][1:])) if inner[0].startswith(SIMD) else NUMBERS[inner[0]]
    return number if inner[1] < 0 else types.Array(number, inner[1], "C")


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
    size = word(context.get_abi_sizeof(context.get_value_type(array_type.dtype)))
    strides = [size]
    for length in reversed(shape[1:]):
        strides.insert(0, builder.mul(length, strides[0]))
    data = builder.inttoptr(load(0), context.get_value_type(array_type.dtype).as_pointer())
    arrayobj.populate_array(array, data=data, shape=shape, strides=strides, itemsize=size, meminfo=None)
    return array._getvalue()
