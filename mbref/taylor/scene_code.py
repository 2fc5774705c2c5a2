"""Machine code of a scene's own: of the orders of its series, and of the linear system that gives them."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from mbref.kernels.compilation import CACHE, PLAIN
from mbref.kernels.machine_code import Code, code_at, processor
from mbref.specialised import Untraceable
from mbref.taylor import correction_code, elimination_code, multiplier_code, orders_code, power_code
from mbref.taylor.correction_code import Correction
from mbref.taylor.driven_code import DrivenOrders
from mbref.taylor.elimination_code import Elimination, EliminationOfRows
from mbref.taylor.instructions import Instructions, function_type
from mbref.taylor.lanes import LANES
from mbref.taylor.layout import TaylorMemory
from mbref.taylor.multiplier_code import MultiplierOrders
from mbref.taylor.power_code import PowerOrders

EXPAND, POWER, FACTORISE = "expand", "expand_by_power", "factorise"
NAMES = EXPAND, POWER, FACTORISE, *correction_code.POINTERS
MOST_BLOCKS = 2_000  # products of blocks that LLVM compiles in a second


def code_of(taylor: TaylorMemory, names: Sequence[str]) -> Code:
    """The code of a scene's functions for a rank of its rows, made or loaded.

    Raises Untraceable where the code would be long, or there is no JIT.
    """
    if PLAIN:
        raise Untraceable("without the JIT there is no machine code")
    lanes = taylor.series.terms.shape[1]
    if (length := lanes * lanes // LANES) > MOST_BLOCKS:
        raise Untraceable(
            f"an order of its series takes {length} products of blocks, more than {MOST_BLOCKS}"
        )
    return code_at(CACHE / "scenes" / f"{_key(taylor, names)}.code", lambda: write_code(taylor, names))


def functions_of(taylor: TaylorMemory) -> tuple[str, ...]:
    """The names of a scene's functions: loads of springs are no sums of products of series, and elimination
    of many rows is left to the kernels' loops."""
    springs = taylor.polynomials.springs.damping.size + taylor.polynomials.torsions.damping.size
    rank, nr, nz = rank_of(taylor), taylor.solver.row.size, taylor.solver.order.size
    is_short = (rank * rank + nr * nz) * taylor.series.terms.shape[1] // LANES <= MOST_BLOCKS
    by_power = power_code.serves(taylor)
    names = {EXPAND: not springs, POWER: not springs and by_power, FACTORISE: is_short}
    return *(name for name, served in names.items() if served), *correction_code.POINTERS


def rank_of(taylor: TaylorMemory) -> int:
    """The rank of the rows where all of the start's freedoms are left."""
    return taylor.solver.order.size - int(taylor.progress.freedoms)


def _key(taylor: TaylorMemory, names: Sequence[str]) -> str:
    """A digest of all that the code depends on."""
    polynomials, solver = taylor.polynomials, taylor.solver
    digest = hashlib.sha256(f"{names} {rank_of(taylor)} {processor()}".encode())
    arrays = *polynomials.products, *polynomials.inertia, *polynomials.rows, solver.linear, solver.order
    every = (*arrays, polynomials.given.driver)
    digest.update(b"".join(part for a in every for part in (str(a.shape).encode(), a.tobytes())))
    return digest.hexdigest()[:32]


def write_code(taylor: TaylorMemory, names: Sequence[str]) -> str:
    """LLVM IR of the functions whose addresses ``SceneCode`` has."""
    module = ir.Module()
    if EXPAND in names:
        write = Instructions(module, EXPAND, multiplier_code.POINTERS, counts=orders_code.COUNTS)
        orders = DrivenOrders if rank_of(taylor) == taylor.solver.order.size else MultiplierOrders
        orders(taylor, write).put()
        write.end()
    if POWER in names:
        write = Instructions(module, POWER, power_code.POINTERS, counts=orders_code.COUNTS)
        PowerOrders(taylor, write).put()
        write.end()
    if FACTORISE in names:
        write = Instructions(module, FACTORISE, *elimination_code.POINTERS)
        elimination = EliminationOfRows if POWER in names else Elimination
        elimination(taylor, rank_of(taylor), write).put()
        write.end()
    for name, pointers in correction_code.POINTERS.items():
        write = Instructions(module, name, pointers)
        getattr(Correction(taylor, write), name)()
        write.end()
    return str(module)


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
