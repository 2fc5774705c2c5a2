"""Calls of C functions by their address from code that numba compiles.

An address is an argument, so that compiled code contains no address of this process and can be cached.
Without compilation (NUMBA_DISABLE_JIT) ctypes makes the calls. Functions for C code are always compiled.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import cfunc, config, types
from numba.extending import intrinsic

POINTER, REAL = ctypes.c_void_p, ctypes.c_double
INTEGER = ir.IntType(types.intp.bitwidth)
RATES = ctypes.CFUNCTYPE(ctypes.c_int32, POINTER, REAL, POINTER, POINTER)
"""int rates(void *context, double t, double *y, double *rates): 0, or why there are none at y"""


def c_function(signature: Any) -> Callable[[Callable[..., Any]], Any]:
    """Return a decorator that compiles a function for C code, which calls it by its field ``address``.

    NUMBA_DISABLE_JIT does not hold for it: numba could not compile the functions that it calls.
    """

    def compiled(function: Callable[..., Any]) -> Any:
        before, config.DISABLE_JIT = config.DISABLE_JIT, 0
        try:
            return cfunc(signature, cache=True)(function)
        finally:
            config.DISABLE_JIT = before

    return compiled


def _called(context: Any, builder: Any, address: Any, result: Any, arguments: list[Any]) -> Any:
    """Emit the LLVM call of the function at an integer address, with integers passed as pointers."""
    kinds = [argument.type for argument in arguments]
    pointer = ir.PointerType(ir.FunctionType(result, kinds))
    return builder.call(builder.inttoptr(address, pointer), arguments)


@intrinsic
def _rates_of(typing: Any, address: Any, context: Any, t: Any, y: Any, rates: Any) -> Any:
    """Call a function of type RATES at an address."""

    def code(target: Any, builder: Any, signature: Any, arguments: list[Any]) -> Any:
        return _called(target, builder, arguments[0], ir.IntType(32), arguments[1:])

    return types.int32(types.intp, types.intp, types.float64, types.intp, types.intp), code


def _void(*kinds: Any) -> tuple[Any, Any]:
    """Return signature and code of the call of a C function at an address, which returns nothing."""

    def code(target: Any, builder: Any, signature: Any, arguments: list[Any]) -> Any:
        _called(target, builder, arguments[0], ir.VoidType(), arguments[1:])
        return target.get_dummy_value()

    return types.void(types.intp, *kinds), code


@intrinsic
def call_with_two(typing: Any, address: Any, first: Any, second: Any) -> Any:
    """Call ``void function(void *first, void *second)`` at an address."""
    return _void(types.intp, types.intp)


@intrinsic
def call_with_three(typing: Any, address: Any, first: Any, second: Any, third: Any) -> Any:
    """Call ``void function(void *first, void *second, void *third)`` at an address."""
    return _void(types.intp, types.intp, types.intp)


@intrinsic
def call_with_three_and_real(
    typing: Any, address: Any, first: Any, second: Any, third: Any, real: Any
) -> Any:
    """Call ``void function(void *first, void *second, void *third, double real)`` at an address."""
    return _void(types.intp, types.intp, types.intp, types.float64)


def _pointer(kind: Any) -> tuple[Any, Any]:
    """Return signature and code of the conversion of an integer address to a pointer."""

    def code(target: Any, builder: Any, signature: Any, arguments: list[Any]) -> Any:
        return builder.inttoptr(arguments[0], target.get_value_type(signature.return_type))

    return types.CPointer(kind)(types.intp), code


@intrinsic
def small_integers(typing: Any, address: Any) -> Any:
    """Return the pointer to 32-bit integers at an integer address."""
    return _pointer(types.int32)


@intrinsic
def reals(typing: Any, address: Any) -> Any:
    """Return the pointer to doubles at an integer address."""
    return _pointer(types.float64)


@intrinsic
def integers(typing: Any, address: Any) -> Any:
    """Return the pointer to 64-bit integers at an integer address."""
    return _pointer(types.intp)


def _plain_rates_of(address: int, context: int, t: float, y: int, rates: int) -> int:
    return int(RATES(address)(context, t, y, rates))


rates_of = _plain_rates_of if config.DISABLE_JIT else _rates_of
