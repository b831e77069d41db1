"""Eight numbers that are one value in compiled code: what a step computes with at a time.

Loops over lanes are at the mercy of the compiler, which has to prove that no two arrays overlap
and else computes lane by lane.  A `vector` is one value from the outset: its sums are sums of
eight numbers on any machine, in one instruction where it has such, in two or four where not.

In compiled code vectors, numbers and comparisons mix as arrays of numpy do.  Laws of effects know
nothing of it: the functions that they are written in (`abs`, `np.minimum`, ...) take vectors, too.
"""

# mypy: disable-error-code="no-untyped-def, no-untyped-call, misc"

from collections.abc import Callable
import math
import operator
from typing import Any

from llvmlite import ir
from numba import njit, types
from numba.core.cgutils import get_or_insert_function
from numba.core.errors import TypingError
from numba.core.typeconv.castgraph import Conversion
import numba.extending
from numba.extending import lower_cast, models, overload, register_model
import numpy as np

WIDTH = 8
"""Numbers in a vector."""

_PRODUCTS = 8
"""Largest power that is taken as a product."""

intrinsic: Any = numba.extending.intrinsic
"""What makes code of the compiler's own; its types say that a call takes a context."""

_DOUBLES = ir.VectorType(ir.DoubleType(), WIDTH)
_BITS = ir.VectorType(ir.IntType(1), WIDTH)
_WORD = ir.IntType(32)


class _Vector(types.Type):
    """Type of eight numbers; numbers become vectors where a variable is both."""

    def __init__(self) -> None:
        super().__init__(name='vector')

    def can_convert_from(self, typingctx, other):
        return Conversion.safe if isinstance(other, types.Number) else None

    def unify(self, typingctx, other):
        return self if isinstance(other, types.Number) else None


class _Mask(types.Type):
    """Type of what a comparison of vectors gives."""

    def __init__(self) -> None:
        super().__init__(name='vector mask')


vector, mask = _Vector(), _Mask()


@register_model(_Vector)
class _VectorModel(models.PrimitiveModel):
    def __init__(self, dmm, fe_type):
        super().__init__(dmm, fe_type, _DOUBLES)


@register_model(_Mask)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, dmm, fe_type):
        super().__init__(dmm, fe_type, _BITS)


def _spread(builder, value):
    """Return a vector of one number."""
    one = builder.insert_element(ir.Constant(_DOUBLES, ir.Undefined), value, _WORD(0))
    none = ir.Constant(ir.VectorType(_WORD, WIDTH), [0] * WIDTH)
    return builder.shuffle_vector(one, ir.Constant(_DOUBLES, ir.Undefined), none)


@lower_cast(types.Number, _Vector)
def _number_to_vector(context, builder, fromty, toty, value):
    return _spread(builder, context.cast(builder, value, fromty, types.float64))


@intrinsic
def spread(typingctx, number):
    """Return a vector of one number, or the vector itself."""
    if not isinstance(number, types.Number | _Vector):
        raise TypingError(f'a vector is made of a number, not of {number}')

    def codegen(context, builder, sig, args):
        if sig.args[0] == vector:
            return args[0]
        return _spread(builder, context.cast(builder, args[0], sig.args[0], types.float64))

    return vector(number), codegen


def _place(context, builder, sig, args):
    place = builder.gep(args[0], [args[1]])
    return builder.bitcast(place, _DOUBLES.as_pointer())


@intrinsic
def get(typingctx, pointer, at):
    """Return the vector in memory at ``pointer[at]`` and behind."""

    def codegen(context, builder, sig, args):
        return builder.load(_place(context, builder, sig, args), align=8)

    return vector(types.CPointer(types.float64), types.int64), codegen


@intrinsic
def put(typingctx, pointer, at, value):
    """Write a vector to ``pointer[at]`` and behind."""

    def codegen(context, builder, sig, args):
        builder.store(args[2], _place(context, builder, sig, args), align=8)
        return context.get_dummy_value()

    return types.void(types.CPointer(types.float64), types.int64, vector), codegen


@intrinsic
def element(typingctx, values, k):
    """Return number `k` of a vector."""

    def codegen(context, builder, sig, args):
        return builder.extract_element(args[0], builder.trunc(args[1], _WORD))

    return types.float64(vector, types.int64), codegen


@intrinsic
def with_element(typingctx, values, k, number):
    """Return a vector with another number `k`."""

    def codegen(context, builder, sig, args):
        return builder.insert_element(args[0], args[2], builder.trunc(args[1], _WORD))

    return vector(vector, types.int64, types.float64), codegen


@intrinsic
def _select(typingctx, which, yes, no):
    def codegen(context, builder, sig, args):
        return builder.select(*args)

    return vector(mask, vector, vector), codegen


@njit(inline='always')
def where(which, yes, no):
    """Return one value where a comparison holds and another where it does not."""
    return _select(which, spread(yes), spread(no))


@intrinsic
def some(typingctx, which):
    """Tell whether a comparison holds anywhere."""

    def codegen(context, builder, sig, args):
        byte = builder.bitcast(args[0], ir.IntType(WIDTH))
        return builder.icmp_unsigned('!=', byte, ir.IntType(WIDTH)(0))

    return types.boolean(mask), codegen


def _operation(make, result):
    """Return an intrinsic of vectors: what `make` builds of them."""

    @intrinsic
    def operation(typingctx, a, b):
        def codegen(context, builder, sig, args):
            return make(builder, *args)

        return result(a, b), codegen

    return operation


def _function(name):
    """Return an intrinsic that LLVM has for vectors."""

    @intrinsic
    def operation(typingctx, x):
        def codegen(context, builder, sig, args):
            kind = ir.FunctionType(_DOUBLES, [_DOUBLES])
            called = get_or_insert_function(builder.module, kind, f'{name}.v{WIDTH}f64')
            return builder.call(called, args)

        return vector(vector), codegen

    return operation


def _is(*kinds):
    """Whether among vectors and numbers there is a vector."""
    fits = all(isinstance(k, _Vector | types.Number) for k in kinds)
    return fits and any(isinstance(k, _Vector) for k in kinds)


def _binary(function, operation):
    @overload(function)
    def made(a, b):
        if _is(a, b):
            return lambda a, b: operation(spread(a), spread(b))
        return None


for _function_, _make in {
    operator.add: lambda builder, a, b: builder.fadd(a, b),
    operator.sub: lambda builder, a, b: builder.fsub(a, b),
    operator.mul: lambda builder, a, b: builder.fmul(a, b),
    operator.truediv: lambda builder, a, b: builder.fdiv(a, b),
}.items():
    _binary(_function_, _operation(_make, vector))
    _binary(getattr(operator, f'i{_function_.__name__}'), _operation(_make, vector))


def _compared(sign):
    how = 'fcmp_unordered' if sign == '!=' else 'fcmp_ordered'
    return _operation(lambda builder, a, b: getattr(builder, how)(sign, a, b), mask)


for _name, _sign in {'lt': '<', 'le': '<=', 'gt': '>', 'ge': '>=', 'eq': '==', 'ne': '!='}.items():
    _binary(getattr(operator, _name), _compared(_sign))


def _joins(function, make):
    joined = _operation(make, mask)

    @overload(function)
    def both(a, b):
        if isinstance(a, _Mask) and isinstance(b, _Mask):
            return lambda a, b: joined(a, b)
        return None


_joins(operator.eq, lambda builder, a, b: builder.icmp_unsigned('==', a, b))
_joins(operator.and_, lambda builder, a, b: builder.and_(a, b))
_joins(operator.or_, lambda builder, a, b: builder.or_(a, b))


@overload(operator.mul)
def _mask_times(a, b):
    """Take a comparison for one or zero."""
    if isinstance(a, _Mask) and isinstance(b, _Vector | types.Number):
        return lambda a, b: where(a, b, 0.0)
    if isinstance(b, _Mask) and isinstance(a, _Vector | types.Number):
        return lambda a, b: where(b, a, 0.0)
    return None


@overload(operator.neg)
def _negative(x):
    if isinstance(x, _Vector):
        return lambda x: -0.0 - x
    return None


@overload(min)
def _min(a, b):
    if _is(a, b):
        return lambda a, b: where(b < a, b, a)
    return None


@overload(max)
def _max(a, b):
    if _is(a, b):
        return lambda a, b: where(b > a, b, a)
    return None


@overload(np.minimum)
def _minimum(a, b):
    if _is(a, b):
        return lambda a, b: where((a < b) | (a != a), a, b)
    return None


@overload(np.maximum)
def _maximum(a, b):
    if _is(a, b):
        return lambda a, b: where((a > b) | (a != a), a, b)
    return None


@overload(np.sign)
def _sign_of(x):
    if isinstance(x, _Vector):
        return lambda x: where(x > 0.0, 1.0, where(x < 0.0, -1.0, x))
    return None


@overload(np.where)
def _np_where(which, yes, no):
    if isinstance(which, _Mask):
        return lambda which, yes, no: where(which, yes, no)
    return None


def _unary(functions, name):
    operation = _function(name)
    for function in functions:
        @overload(function)
        def made(x):
            if isinstance(x, _Vector):
                return lambda x: operation(x)
            return None


_unary((abs, np.abs, np.fabs, math.fabs), 'llvm.fabs')
_unary((np.sqrt, math.sqrt), 'llvm.sqrt')
_unary((np.floor,), 'llvm.floor')
_unary((np.ceil,), 'llvm.ceil')


def _one_by_one(function: Callable[[float], float]) -> None:
    """Let a function of a number take vectors, too, one number after the other."""

    @overload(function)
    def made(x):
        if not isinstance(x, _Vector):
            return None

        def each(x):
            for k in range(WIDTH):
                x = with_element(x, k, function(element(x, k)))
            return x

        return each


for _of_one in (
    np.exp, np.expm1, np.log, np.log1p, np.sin, np.cos, np.tan, np.arctan, np.sinh, np.cosh,
    np.tanh, np.cbrt, math.exp, math.expm1, math.log, math.log1p, math.sin, math.cos, math.tan,
    math.atan, math.sinh, math.cosh, math.tanh,
):  # fmt: skip
    _one_by_one(_of_one)


def _two_by_two(function):
    """Let a function of two numbers take vectors, too."""

    @overload(function)
    def made(a, b):
        if not _is(a, b):
            return None

        def each(a, b):
            left, right = spread(a), spread(b)
            for k in range(WIDTH):
                left = with_element(left, k, function(element(left, k), element(right, k)))
            return left

        return each


for _of_two in (np.power, np.hypot, np.arctan2, math.hypot, math.atan2, math.pow):
    _two_by_two(_of_two)


def _power(a, b):
    """Small whole powers are products."""
    if not _is(a, b):
        return None
    if not isinstance(b, types.IntegerLiteral) or not 0 < b.literal_value <= _PRODUCTS:
        return lambda a, b: np.power(spread(a), spread(b))
    times = b.literal_value - 1

    def product(a, b):
        result = a
        for _ in range(times):
            result = result * a
        return result

    return product


for _raised in (operator.pow, operator.ipow):
    overload(_raised, prefer_literal=True)(_power)
