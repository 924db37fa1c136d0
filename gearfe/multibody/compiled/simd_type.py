# mypy: disable-error-code="no-untyped-call,no-untyped-def,misc"
"""Numba's type of a row of `gearfe.multibody.compiled.simd.SimdArray`: a vector of the processor.

Sine and cosine follow from their series about the nearest multiple of pi, whose terms beyond degree 22 are below 1e-17.
The multiple is subtracted in two parts, the first exactly by fused multiplication (Muller et al., Handbook of
Floating-Point Arithmetic, Birkhaeuser 2018, Sec. 10.2).
"""

from __future__ import annotations

import math
import operator
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.typeconv import Conversion
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import lower_builtin, lower_cast, models, register_model
from numba.np import arrayobj

from .simd import flat, halves, highest, total

DOUBLE, WORD, INDEX = ir.DoubleType(), ir.IntType(64), ir.IntType(32)
#: pi in two parts.
PI, PI_REST = math.pi, 1.2246467991473532e-16
#: Terms of both series.
TERMS = 12


class SimdType(types.Type):
    def __init__(self, width: int) -> None:
        self.width = width
        super().__init__(name=f"Simd({width})")

    def unify(self, context: Any, other: Any) -> Any:  # noqa: ARG002
        return self if isinstance(other, types.Number) else None

    def can_convert_from(self, context: Any, other: Any) -> Any:  # noqa: ARG002
        return Conversion.safe if isinstance(other, types.Number) else None


@register_model(SimdType)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, ir.VectorType(DOUBLE, kind.width))


def _spread(builder: Any, value: Any, width: int) -> Any:
    """A number in all entries."""
    vector = ir.VectorType(DOUBLE, width)
    one = builder.insert_element(ir.Constant(vector, ir.Undefined), value, INDEX(0))
    return builder.shuffle_vector(one, ir.Constant(vector, ir.Undefined), _mask([0] * width))


def _mask(places: Any) -> Any:
    return ir.Constant(ir.VectorType(INDEX, len(places)), [INDEX(k) for k in places])


def _number(value: float, width: int) -> Any:
    return ir.Constant(ir.VectorType(DOUBLE, width), [DOUBLE(value)] * width)


def _call(builder: Any, name: str, *args: Any) -> Any:
    """An operation of LLVM on vectors of one type."""
    kind = args[0].type
    made = ir.FunctionType(kind, [kind] * len(args))
    function = cgutils.get_or_insert_function(builder.module, made, f"llvm.{name}.v{kind.count}f64")
    return builder.call(function, args)


@lower_cast(types.Number, SimdType)
def _cast(context: Any, builder: Any, source: Any, target: Any, value: Any) -> Any:
    return _spread(builder, context.cast(builder, value, source, types.float64), target.width)


def _series(builder: Any, x: Any, odd: bool) -> Any:
    """Sine (odd) or cosine."""
    width = x.type.count
    turns = _call(builder, "rint", builder.fmul(x, _number(1.0 / math.pi, width)))
    less = builder.fneg(turns)
    r = _call(builder, "fma", less, _number(PI, width), x)
    r = _call(builder, "fma", less, _number(PI_REST, width), r)
    half = builder.fmul(turns, _number(0.5, width))
    off = _call(builder, "fabs", builder.fsub(half, _call(builder, "rint", half)))  # 1/2 for odd multiples
    sign = _call(builder, "fma", off, _number(-4.0, width), _number(1.0, width))
    square = builder.fmul(r, r)
    value = _number(0.0, width)
    for k in range(TERMS - 1, -1, -1):
        value = _call(builder, "fma", value, square, _number((-1.0) ** k / math.factorial(2 * k + odd), width))
    return builder.fmul(builder.fmul(sign, r) if odd else sign, value)


def _reduced(builder: Any, x: Any, join: Any) -> Any:
    """One number of all entries, by halves."""
    while x.type.count > 1:
        half = x.type.count // 2
        none = ir.Constant(x.type, ir.Undefined)
        low, high = (builder.shuffle_vector(x, none, _mask(range(k, k + half))) for k in (0, half))
        x = join(low, high)
    return builder.extract_element(x, INDEX(0))


def _teach(key: Any, template: Any) -> None:
    """Make the template the types of a function. (As a decorator it asks ufuncs for a module: NumPy 2.1 and later.)"""
    infer_global(key, types.Function(type(template.__name__, (template,), {"key": key})))


def _operation(key: Any, count: int, result: Any, make: Any) -> None:
    """Register a function of vectors with numba. Some arguments, but not all, may be numbers; `result` gives its
    type."""

    class Template(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            kinds = [a for a in args if isinstance(a, SimdType)]
            if kws or len(args) != count or not kinds or not all(isinstance(a, SimdType | types.Number) for a in args):
                return None
            return signature(result(kinds[0]), *[kinds[0]] * count)

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:  # noqa: ARG001
        return make(builder, *args)

    _teach(key, Template)
    lower_builtin(key, *[SimdType] * count)(lower)


def _same(kind: Any) -> Any:
    return kind


def _number_type(kind: Any) -> Any:  # noqa: ARG001
    return types.float64


def _larger(builder: Any, x: Any, y: Any) -> Any:
    """NaN where one is. (LLVM's own maximum cannot be lowered for x86 before version 18.)"""
    first = builder.or_(builder.fcmp_unordered("uno", x, x), builder.fcmp_ordered(">", x, y))
    return builder.select(first, x, y)


for _key, _name in (("add", "fadd"), ("sub", "fsub"), ("mul", "fmul"), ("truediv", "fdiv")):
    for _form in (_key, f"i{_key}"):
        _operation(getattr(operator, _form), 2, _same, lambda builder, x, y, name=_name: getattr(builder, name)(x, y))
_operation(operator.neg, 1, _same, lambda builder, x: builder.fneg(x))
_operation(abs, 1, _same, lambda builder, x: _call(builder, "fabs", x))
_operation(np.sin, 1, _same, lambda builder, x: _series(builder, x, True))
_operation(np.cos, 1, _same, lambda builder, x: _series(builder, x, False))
_operation(np.maximum, 2, _same, _larger)
_operation(total, 1, _number_type, lambda builder, x: _reduced(builder, x, builder.fadd))
_operation(highest, 1, _number_type, lambda builder, x: _reduced(builder, x, lambda *two: _larger(builder, *two)))


def _seen_as(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    """The same memory with more axes behind."""
    source, target = sig.args[0], sig.return_type
    old = arrayobj.make_array(source)(context, builder, args[0])
    new = arrayobj.make_array(target)(context, builder)
    inner = context.get_abi_sizeof(context.get_value_type(target.dtype))
    shape = cgutils.unpack_tuple(builder, old.shape)
    strides = cgutils.unpack_tuple(builder, old.strides)
    data = builder.bitcast(old.data, context.get_value_type(target.dtype).as_pointer())
    arrayobj.populate_array(
        new, data=data, shape=[*shape, WORD(8 * source.dtype.width // inner)], strides=[*strides, WORD(inner)],
        itemsize=WORD(inner), meminfo=None,
    )  # fmt: skip
    return new._getvalue()


def _view(key: Any, kind_of: Any) -> None:
    """Teach numba a function that sees the memory of SIMD vectors otherwise."""

    class Template(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            if kws or not isinstance(args[0], types.Array) or not isinstance(args[0].dtype, SimdType):
                return None
            return signature(types.Array(kind_of(args[0].dtype), args[0].ndim + 1, "C"), args[0])

    _teach(key, Template)
    lower_builtin(key, types.Array)(_seen_as)


_view(flat, _number_type)
_view(halves, lambda kind: SimdType(kind.width // 2))
