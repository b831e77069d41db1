"""Memory through an address, compiled functions by their address, and room on the stack."""

from typing import Any

from llvmlite import ir
from numba import njit, types
from numba.core.errors import TypingError

from motor_sysid.machine_code import kept
from motor_sysid.physics.vector import intrinsic, WIDTH

LANES = 32
"""Parameter vectors that one block carries, and numbers in a row of its memory."""

compiled: Any = kept(nogil=True, error_model='numpy', _nrt=False)
"""Compile a function that makes no arrays; references to those that it is given do not count."""

inlined: Any = kept(nogil=True, error_model='numpy', _nrt=False, forceinline=True)
"""Compile a function that becomes a part of those that call it."""


@intrinsic
def as_pointer(typingctx, address):  # type: ignore[no-untyped-def]
    """Turn an integer address into a pointer to float64."""
    signature = types.CPointer(types.float64)(types.int64)

    def codegen(context, builder, sig, args):  # type: ignore[no-untyped-def]
        return builder.inttoptr(args[0], context.get_value_type(sig.return_type))

    return signature, codegen


@intrinsic
def data_of(typingctx, array):  # type: ignore[no-untyped-def]
    """Return the pointer to the first number of an array of float64 in one piece."""
    if not isinstance(array, types.Array) or array.layout != 'C' or array.dtype != types.float64:
        raise TypingError(f'only an array of float64 in one piece has a place, not {array}')

    def codegen(context, builder, sig, args):  # type: ignore[no-untyped-def]
        return context.make_array(sig.args[0])(context, builder, args[0]).data

    return types.CPointer(types.float64)(array), codegen


@intrinsic
def behind(typingctx, pointer, count):  # type: ignore[no-untyped-def]
    """Return the pointer to what lies `count` numbers behind."""
    signature = types.CPointer(types.float64)(types.CPointer(types.float64), types.int64)

    def codegen(context, builder, sig, args):  # type: ignore[no-untyped-def]
        return builder.gep(args[0], [args[1]])

    return signature, codegen


@intrinsic
def call_lanes(typingctx, address, base, own, state):  # type: ignore[no-untyped-def]
    """Call ``void(int64, int64, int64)`` at `address`."""
    signature = types.void(types.int64, types.int64, types.int64, types.int64)

    def codegen(context, builder, sig, args):  # type: ignore[no-untyped-def]
        word = ir.IntType(64)
        kind = ir.FunctionType(ir.VoidType(), [word, word, word])
        function = builder.inttoptr(args[0], kind.as_pointer())
        builder.call(function, args[1:])
        return context.get_dummy_value()

    return signature, codegen


@intrinsic
def on_stack(typingctx, count):  # type: ignore[no-untyped-def]
    """Return a pointer to room for `count` float64, until the function that calls this returns.

    Each call takes more of the stack, so not in a loop; and a function that LLVM inlines gives the
    room back where it ends, so not with ``forceinline``.
    """
    signature = types.CPointer(types.float64)(types.int64)

    def codegen(context, builder, sig, args):  # type: ignore[no-untyped-def]
        room = builder.alloca(ir.DoubleType(), args[0])
        room.align = 64
        return room

    return signature, codegen


@njit(inline='always')
def rows(count):  # type: ignore[no-untyped-def]
    """Return a pointer to room for `count` vectors on the stack, not set to anything."""
    return on_stack(count * WIDTH)
