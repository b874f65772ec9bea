"""Call a compiled program by its address from inside numba code."""

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic


def _caller(count):
    """An intrinsic that calls the function at an address with `count` 64-bit arguments (pointers or integers)."""

    def typed(typingctx, address, arguments):
        signature = types.void(types.intp, types.UniTuple(types.intp, count))

        def codegen(context, builder, signature, args):
            i64 = ir.IntType(64)
            function = ir.FunctionType(ir.VoidType(), [i64] * count)
            pointer = builder.inttoptr(args[0], function.as_pointer())
            builder.call(pointer, cgutils.unpack_tuple(builder, args[1], count))
            return context.get_dummy_value()

        return signature, codegen

    return intrinsic(typed)


call_value = _caller(4)
"""call_value(address, (x, u, c, y)): the `value` function of `llvm_ir`; arguments are addresses of arrays."""
call_tangent = _caller(8)
"""call_tangent(address, (x, u, c, y, S, dS, columns, column_of)): the `tangent` function of `llvm_ir`."""
