"""Multipliers of statically determined rows, which ``static_constraints`` eliminates."""

from __future__ import annotations

from mbref.kernels.compilation import inlined


@inlined
def add_static_multipliers(static, system):
    """Compute the multipliers of statically determined rows, which balance the forces on columns without
    acceleration."""
    blocks, multipliers, force = system.blocks.reshape(-1), system.multipliers, system.force
    width = system.blocks.shape[1]
    start, entry, column, first, other = (
        static.start, static.entry, static.column, static.other_start, static.other,
    )  # fmt: skip
    for k in range(static.row.shape[0]):
        value, square = 0.0, 0.0
        for p in range(start[k], start[k + 1]):
            balance, own = force[column[p]], blocks[entry[p]]
            for o in range(first[p], first[p + 1]):
                balance -= blocks[other[o]] * multipliers[other[o] // width]
            value += own * balance
            square += own * own
        multipliers[static.row[k]] = value / square
