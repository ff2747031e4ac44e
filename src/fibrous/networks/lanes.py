"""Eight numbers that compiled code treats as one: the same thing computed for eight networks of one topology at a time.

The last axis of an array of lanes has length 8 and is contiguous; `load` and `store` move what stands at the other
indices. A processor's vector unit works on all eight at once, and none of them knows of the others: a NaN stays in its
lane.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, models, overload, register_model

#: Numbers in a vector.
LANES = 8
# Rounding of a product may be left out where a sum follows.
_FLAGS = ("contract",)
_VECTOR = ir.VectorType(ir.DoubleType(), LANES)

# Range of the exponential, ln 2 in two parts, of which the first has zeros for its last bits so that a multiple of it
# is exact, and the terms of its series, of which the next would be less than rounding.
LARGEST_EXPONENT = 708.0
LN_2 = (0.693147180369123816490, 1.90821492927058770002e-10)
TERMS = 13


class LanesType(types.Type):
    """The type of eight numbers in compiled code."""

    def __init__(self) -> None:
        super().__init__(name="Lanes")


_LANES = LanesType()


@register_model(LanesType)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, type_: Any) -> None:
        super().__init__(manager, type_, _VECTOR)


def _as_vector(context: Any, builder: Any, value: Any, type_: Any) -> Any:
    """A vector as it is, a number in all lanes."""
    if isinstance(type_, LanesType):
        return value
    number = context.cast(builder, value, type_, types.float64)
    one = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), number, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(one, one, ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES))


def _pointer(context: Any, builder: Any, array_type: Any, array: Any, index_type: Any, index: Any) -> Any:
    """Where the eight numbers at an index begin, as a pointer to a vector of the array's precision."""
    if array_type.layout != "C" or len(index_type) != array_type.ndim - 1:
        raise TypeError("lanes need a contiguous array and an index for every axis but the last")
    indices = [
        context.cast(builder, one, type_, types.intp)
        for one, type_ in zip(cgutils.unpack_tuple(builder, index), index_type, strict=True)
    ]
    made = context.make_array(array_type)(context, builder, array)
    first = ir.Constant(ir.IntType(64), 0)
    pointer = cgutils.get_item_pointer(context, builder, array_type, made, [*indices, first], wraparound=False)
    return builder.bitcast(pointer, ir.VectorType(context.get_data_type(array_type.dtype), LANES).as_pointer())


@intrinsic
def _load(typing_context: Any, array: Any, index: Any) -> Any:

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        vector = builder.load(_pointer(context, builder, array, values[0], index, values[1]))
        vector.align = array.dtype.bitwidth // 8
        return vector if array.dtype == types.float64 else builder.fpext(vector, _VECTOR)

    return _LANES(array, index), generate


@intrinsic
def _store(typing_context: Any, array: Any, index: Any, value: Any) -> Any:

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        pointer = _pointer(context, builder, array, values[0], index, values[1])
        vector = _as_vector(context, builder, values[2], value)
        if array.dtype != types.float64:
            vector = builder.fptrunc(vector, pointer.type.pointee)
        builder.store(vector, pointer).align = array.dtype.bitwidth // 8
        return context.get_dummy_value()

    return types.void(array, index, value), generate


@intrinsic
def _spread(typing_context: Any, number: Any) -> Any:

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return _as_vector(context, builder, values[0], number)

    return _LANES(number), generate


def _two(emit: Callable[[Any, Any, Any], Any]) -> Any:
    """A compiled function of two vectors, or of a vector and a number."""

    @intrinsic
    def function(typing_context: Any, one: Any, other: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            return emit(
                builder,
                _as_vector(context, builder, values[0], one),
                _as_vector(context, builder, values[1], other),
            )

        return _LANES(one, other), generate

    return function


_add = _two(lambda builder, one, other: builder.fadd(one, other, flags=_FLAGS))
_subtract = _two(lambda builder, one, other: builder.fsub(one, other, flags=_FLAGS))
_multiply = _two(lambda builder, one, other: builder.fmul(one, other, flags=_FLAGS))
_divide = _two(lambda builder, one, other: builder.fdiv(one, other, flags=_FLAGS))
#: The lesser of two in each lane; the second where either is no number.
least = _two(lambda builder, one, other: builder.select(builder.fcmp_ordered("<", one, other), one, other))


def _overload(symbol: Any, vectorized: Any) -> None:
    """Let an operator of compiled code mean a function where one of its operands is a vector."""

    @overload(symbol)
    def choose(one: Any, other: Any) -> Any:
        def implementation(one: Any, other: Any) -> Any:
            return vectorized(one, other)

        return implementation if isinstance(one, LanesType) or isinstance(other, LanesType) else None


for _symbol, _vectorized in (
    (operator.add, _add),
    (operator.sub, _subtract),
    (operator.mul, _multiply),
    (operator.truediv, _divide),
):
    _overload(_symbol, _vectorized)


def _of_llvm(name: str) -> Any:
    """A compiled function of one vector that LLVM knows by name."""

    @intrinsic
    def function(typing_context: Any, one: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            signature_ = ir.FunctionType(_VECTOR, [_VECTOR])
            known = cgutils.get_or_insert_function(builder.module, signature_, f"llvm.{name}.v{LANES}f64")
            return builder.call(known, [values[0]])

        return _LANES(one), generate

    return function


def _constant(number: float) -> Any:
    return ir.Constant(_VECTOR, [number] * LANES)


@intrinsic
def _exponential_less_one(typing_context: Any, one: Any) -> Any:
    """exp(x) − 1 = 2^k (exp(r) − 1) + (2^k − 1) with x = k ln 2 + r, |r| ≤ ln(2)/2; exp(r) − 1 from its Taylor series.

    The mathematical library's function would be called for one number after the other.
    """

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        bits, width = ir.VectorType(ir.IntType(64), LANES), [52] * LANES
        x = values[0]
        for limit, order in ((LARGEST_EXPONENT, "<"), (-LARGEST_EXPONENT, ">")):
            x = builder.select(builder.fcmp_ordered(order, x, _constant(limit)), x, _constant(limit))
        # Added to so large a number, x/ln 2 is rounded to k, which then stands in the last bits.
        shifted = builder.fadd(builder.fmul(x, _constant(1.0 / math.log(2.0))), _constant(1.5 * 2.0**52))
        k = builder.fsub(shifted, _constant(1.5 * 2.0**52))
        for part in LN_2:
            x = builder.fsub(x, builder.fmul(k, _constant(part), flags=_FLAGS), flags=_FLAGS)
        series = _constant(1.0 / math.factorial(TERMS))
        for power in range(TERMS - 1, 0, -1):
            series = builder.fmul(series, x, flags=_FLAGS)
            series = builder.fadd(series, _constant(1.0 / math.factorial(power)), flags=_FLAGS)
        series = builder.fmul(series, x, flags=_FLAGS)
        exponent = builder.shl(builder.bitcast(shifted, bits), ir.Constant(bits, width))
        power_of_two = builder.bitcast(builder.add(exponent, builder.bitcast(_constant(1.0), bits)), _VECTOR)
        less_one = builder.fsub(power_of_two, _constant(1.0))
        return builder.fadd(builder.fmul(power_of_two, series, flags=_FLAGS), less_one, flags=_FLAGS)

    return _LANES(one), generate


@intrinsic
def _choose(typing_context: Any, number: Any, limit: Any, below: Any, otherwise: Any) -> Any:

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        vectors = [
            _as_vector(context, builder, value, type_)
            for value, type_ in zip(values, (number, limit, below, otherwise), strict=True)
        ]
        return builder.select(builder.fcmp_ordered("<", *vectors[:2]), *vectors[2:])

    return _LANES(number, limit, below, otherwise), generate


@intrinsic
def _greatest(typing_context: Any, vector: Any) -> Any:

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        found = builder.extract_element(values[0], ir.Constant(ir.IntType(32), 0))
        for lane in range(1, LANES):
            number = builder.extract_element(values[0], ir.Constant(ir.IntType(32), lane))
            found = builder.select(builder.fcmp_ordered("<", found, number), number, found)
        return found

    return types.float64(vector), generate


#: ``load(array, index)``: the eight numbers at an index, a tuple, of an array of lanes in single or double precision.
load: Any = _load
#: ``store(array, index, value)``: write eight numbers, or one in all lanes, at an index.
store: Any = _store
#: ``spread(number)``: a number in all lanes.
spread: Any = _spread
#: ``exponential_less_one(vector)``; beyond ±`LARGEST_EXPONENT` as at it, where squares leave the range of floats.
exponential_less_one: Any = _exponential_less_one
#: ``choose(number, limit, below, otherwise)``: in each lane `below` where number < limit; vectors or numbers.
choose: Any = _choose
#: ``greatest(vector)``: the greatest number of all lanes, which must not be NaN.
greatest: Any = _greatest
square_root = _of_llvm("sqrt")
magnitude = _of_llvm("fabs")
