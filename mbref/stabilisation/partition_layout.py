"""Options and memory of coordinate partitioning."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from mbref.kernels.named_memory import Indices, Matrix, Vector, opener


class Options(NamedTuple):
    """Relative pivot of Φ_u below which a new partition is chosen."""

    kept: float = 0.6


class CoordinatePartition(NamedTuple):
    """Numbers of dependent coordinates and rates; smallest pivot of Φ_u relative to its largest, at the last
    state, and its largest value since the partition was chosen. With rows between velocities, the logarithm
    of the product of all pivots takes its place."""

    rank: int = 0
    pivot: float = 0.0
    largest_pivot: float = 0.0
    rate_rank: int = 0


class Scratch(NamedTuple):
    """Memory of the Jacobian by Euler parameters, the factor of its dependent columns, and the partition."""

    jacobian: Annotated[Matrix, "m + nb", "7*nb"]  # [Φ_r Φ_p; 0 2pᵀ]
    dependent: Annotated[Matrix, "7*nb", "7*nb"]  # Φ_u of the active rows, factored
    residual: Annotated[Vector, "7*nb"]
    row_scale: Annotated[Vector, "m + nb"]  # factors on rows and columns of both matrices
    column_scale: Annotated[Vector, "7*nb"]
    row_order: Annotated[Indices, "m + nb"]  # active rows first
    column_order: Annotated[Indices, "7*nb"]  # dependent coordinates first
    exchanges: Annotated[Indices, "7*nb"]  # column exchanges of the factorisation
    last_row_order: Annotated[Indices, "m + nb"]
    last_column_order: Annotated[Indices, "7*nb"]
    # of rates, in scenes with rows between velocities alone
    dependent_rates: Annotated[Matrix, "rate_columns", "rate_columns"]
    rate_row_order: Annotated[Indices, "rate_rows"]
    rate_column_order: Annotated[Indices, "rate_columns"]
    rate_exchanges: Annotated[Indices, "rate_columns"]
    last_rate_row_order: Annotated[Indices, "rate_rows"]
    last_rate_column_order: Annotated[Indices, "rate_columns"]
    partition: CoordinatePartition


options_of, scratch_of = opener(Options), opener(Scratch)
