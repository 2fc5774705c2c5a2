"""Calls of generated functions by their addresses, from kernels that every scene shares.

``mbref.taylor.generated`` writes the functions.  Kernels call none while the address is 0.
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
    """Call the function at an address that finds the orders 0 … last of multipliers."""
    return types.void(address, terms, response, left, right, scale, growth, sums, last), _call


@intrinsic
def expand_by_power(typing, address, terms, response, left, right, sums, last):
    """Call the function at an address that finds the orders 0 … last without multipliers."""
    return types.void(address, terms, response, left, right, sums, last), _call


@intrinsic
def violation_by_code(typing, address, terms, phi):
    """Call the function at an address that finds the violations of rows."""
    return types.void(address, terms, phi), _call


@intrinsic
def close_by_code(typing, address, terms, phi, response, change):
    """Call the function at an address that takes violations, or their rates, away."""
    return types.void(address, terms, phi, response, change), _call


@intrinsic
def factorise_by_code(typing, address, terms, tableau, particular, null_space, response, last, row, order):
    """Call the function at an address that finds the pivots and the response."""
    arrays = terms, tableau, particular, null_space, response, last, row, order
    return types.void(address, *arrays), _call


def _call(context, builder, signature, arguments):
    """Call the function at the first argument's address with the data of arrays, and with whole numbers."""
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
