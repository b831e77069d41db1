"""Memory through an address, compiled functions by their address, and arrays on the stack."""

from llvmlite import ir
from numba import carray, njit, types  # type: ignore[attr-defined]
from numba.extending import intrinsic

LANES = 32
"""Parameter vectors that one block carries: enough for the compiler to keep the loop rolled."""


@intrinsic
def as_pointer(typingctx, address):  # type: ignore[no-untyped-def]
    """Turn an integer address into a pointer to float64."""
    signature = types.CPointer(types.float64)(types.int64)

    def codegen(context, builder, sig, args):  # type: ignore[no-untyped-def]
        return builder.inttoptr(args[0], context.get_value_type(sig.return_type))

    return signature, codegen


@intrinsic
def call_lane(typingctx, address, base, own, state, wide):  # type: ignore[no-untyped-def]
    """Call ``void(int64, int64, int64, int64)`` at `address`."""
    signature = types.void(types.int64, types.int64, types.int64, types.int64, types.int64)

    def codegen(context, builder, sig, args):  # type: ignore[no-untyped-def]
        word = ir.IntType(64)
        kind = ir.FunctionType(ir.VoidType(), [word, word, word, word])
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
def new_rows(count):  # type: ignore[no-untyped-def]
    """Return an array (count, 32) on the stack, not set to anything.

    The compiler sees that no other array overlaps it.  Where it does not, every loop over lanes
    begins with the question whether arrays do: most of the instructions of a step were of that.
    """
    return carray(on_stack(count * LANES), (count, LANES))  # type: ignore[call-arg]


@njit(inline='always')
def new_row():  # type: ignore[no-untyped-def]
    """Return an array (32,) on the stack, not set to anything."""
    return carray(on_stack(LANES), LANES)  # type: ignore[call-arg]
