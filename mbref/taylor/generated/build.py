"""Generated functions of a scene: the orders of its series, the linear system and the corrections."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Any

from llvmlite import ir

from mbref.kernels.compilation import CACHE, PLAIN
from mbref.kernels.machine_code import Code, NoGeneratedCode, code_at, processor
from mbref.taylor.generated import corrections, elimination, multiplier_orders, orders, power_orders
from mbref.taylor.generated.corrections import Correction
from mbref.taylor.generated.driven_orders import DrivenOrders
from mbref.taylor.generated.elimination import ResponseCode, RowResponseCode
from mbref.taylor.generated.instructions import Instructions
from mbref.taylor.generated.multiplier_orders import MultiplierOrders
from mbref.taylor.generated.power_orders import PowerOrders
from mbref.taylor.layout import TaylorMemory
from mbref.taylor.loads import varies
from mbref.taylor.simd import WIDTH

EXPAND_CODE, POWER_CODE, FACTORISE_CODE = "expand", "expand_by_power", "factorise"
MOST_VECTORS = 2_000  # products of vectors that LLVM compiles in a second


def put_code(taylor: TaylorMemory) -> Code:
    """Write the addresses of a scene's functions into memory; they are valid while the code returned lives.

    Raises NoGeneratedCode if the functions would be too long, or without the JIT.
    """
    names = names_of_functions(taylor)
    code = code_of(taylor, names)
    addresses: Any = taylor.code
    addresses.rank = rank_of_rows(taylor)
    for name in names:
        addresses[name] = code.address(name)
    return code


def code_of(taylor: TaylorMemory, names: Sequence[str]) -> Code:
    """Return the code of functions of a scene, made or loaded; raises NoGeneratedCode."""
    coordinates = taylor.polynomials.torsions, taylor.polynomials.slides
    if any((each.row >= 0).any() for each in coordinates):
        raise NoGeneratedCode("the rows of couplings of angles or of powers are no products of series")
    if PLAIN:
        raise NoGeneratedCode("without the JIT there is no machine code")
    lanes = taylor.series.terms.shape[1]
    if (length := lanes * lanes // WIDTH) > MOST_VECTORS:
        raise NoGeneratedCode(
            f"an order of its series takes {length} products of vectors, more than {MOST_VECTORS}"
        )
    return code_at(CACHE / "scenes" / f"{_key(taylor, names)}.code", lambda: write_code(taylor, names))


def names_of_functions(taylor: TaylorMemory) -> tuple[str, ...]:
    """Return the names of a scene's functions: loads that vary are no sums of products of series, and
    elimination of many rows is left to the kernels' loops."""
    is_constant = not varies(taylor.polynomials)
    rank, nr, nz = rank_of_rows(taylor), taylor.solver.pivot_rows.size, taylor.solver.pivot_columns.size
    is_short = (rank * rank + nr * nz) * taylor.series.terms.shape[1] // WIDTH <= MOST_VECTORS
    by_power = power_orders.serves(taylor)
    names = {EXPAND_CODE: is_constant, POWER_CODE: is_constant and by_power, FACTORISE_CODE: is_short}
    return *(name for name, served in names.items() if served), *corrections.POINTERS


def rank_of_rows(taylor: TaylorMemory) -> int:
    """Return the rank of the rows for which the degrees of freedom equal those at the start."""
    return taylor.solver.pivot_columns.size - int(taylor.options.start_freedoms)


def _key(taylor: TaylorMemory, names: Sequence[str]) -> str:
    """Return a digest of all that the code depends on."""
    polynomials, solver = taylor.polynomials, taylor.solver
    digest = hashlib.sha256(f"{names} {rank_of_rows(taylor)} {processor()}".encode())
    arrays = (
        *polynomials.products,
        *polynomials.inertia,
        *polynomials.rows,
        solver.linear,
        solver.pivot_columns,
    )
    every = (*arrays, polynomials.given.driver)
    digest.update(b"".join(part for a in every for part in (str(a.shape).encode(), a.tobytes())))
    return digest.hexdigest()[:32]


def write_code(taylor: TaylorMemory, names: Sequence[str]) -> str:
    """Return LLVM IR of the functions whose addresses ``SceneCode`` has."""
    module = ir.Module()
    if EXPAND_CODE in names:
        write = Instructions(module, EXPAND_CODE, multiplier_orders.POINTERS, counts=orders.ORDER_ARGUMENTS)
        is_driven = rank_of_rows(taylor) == taylor.solver.pivot_columns.size
        (DrivenOrders if is_driven else MultiplierOrders)(taylor, write).put()
        write.end()
    if POWER_CODE in names:
        write = Instructions(module, POWER_CODE, power_orders.POINTERS, counts=orders.ORDER_ARGUMENTS)
        PowerOrders(taylor, write).put()
        write.end()
    if FACTORISE_CODE in names:
        write = Instructions(module, FACTORISE_CODE, *elimination.POINTERS)
        kind = RowResponseCode if POWER_CODE in names else ResponseCode
        kind(taylor, rank_of_rows(taylor), write).put()
        write.end()
    for name, pointers in corrections.POINTERS.items():
        write = Instructions(module, name, pointers)
        getattr(Correction(taylor, write), name)()
        write.end()
    return str(module)
