"""Calls of generated functions by their addresses, from kernels that all scenes share.

``mbref.taylor.generated`` writes the functions. Kernels call no function whose address is 0.
"""

from __future__ import annotations

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

DOUBLES, INTEGER = ir.DoubleType().as_pointer(), ir.IntType(64)
INTEGERS = INTEGER.as_pointer()


def function_type(doubles: int, integers: int = 0, counts: int = 0) -> ir.FunctionType:
    """Return the LLVM type ``void(double*…, int64*…, int64…)`` with these numbers of arguments."""
    return ir.FunctionType(ir.VoidType(), [DOUBLES] * doubles + [INTEGERS] * integers + [INTEGER] * counts)


@intrinsic
def expand_by_code(typing, address, terms, response, left, right, scale, growth, sums, last):
    """Call the generated function that computes the orders 0 … last with multipliers."""
    return types.void(address, terms, response, left, right, scale, growth, sums, last), _call


@intrinsic
def expand_by_power(typing, address, terms, response, left, right, sums, last):
    """Call the generated function that computes the orders 0 … last without multipliers."""
    return types.void(address, terms, response, left, right, sums, last), _call


@intrinsic
def violation_by_code(typing, address, terms, phi):
    """Call the generated function that computes the violations of rows."""
    return types.void(address, terms, phi), _call


@intrinsic
def close_by_code(typing, address, terms, phi, response, change):
    """Call the generated function that removes violations, or their rates."""
    return types.void(address, terms, phi, response, change), _call


@intrinsic
def factorise_by_code(typing, address, terms, tableau, particular, null_space, response, last, row, order):
    """Call the generated function that computes the pivots and the response."""
    arrays = terms, tableau, particular, null_space, response, last, row, order
    return types.void(address, *arrays), _call


def _call(context, builder, signature, arguments):
    """Emit a call of the function at the address in the first argument, with the data pointers of arrays and
    with integers."""
    kinds, values = signature.args[1:], arguments[1:]
    arrays = [kind for kind in kinds if isinstance(kind, types.Array)]
    whole = sum(isinstance(array.dtype, types.Integer) for array in arrays)
    kind = function_type(len(arrays) - whole, whole, len(kinds) - len(arrays))
    data = [
        context.make_array(array)(context, builder, value).data
        for array, value in zip(arrays, values, strict=False)
    ]
    builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), [*data, *values[len(arrays) :]])
    return context.get_dummy_value()
