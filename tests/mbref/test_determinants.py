"""det(G Gᵀ₀) by pivots and motions / by the determinant."""

import numpy as np
import pytest

from mbref.kernels.compilation import INT, entry, kernel
from mbref.kernels.layout import OK
from mbref.method import Method
from mbref.scenes import SCENES
from mbref.simulation.simulate import Limits
from mbref.simulation.start_run import start_run
from mbref.taylor.crossing.determinants import (
    determinant_by_null_vectors,
    log_determinant_at_start,
    log_start_by_null_vector,
    null_vectors_oppose,
    save_start_determinant,
)
from mbref.taylor.layout import SERIES
from mbref.taylor.solver import respond

NEGATIVE, ALIKE = 1, 2
ROUNDING = 1e-9  # of logarithms of determinants


@kernel
def compared(memory):
    """NEGATIVE where the determinant is, ALIKE where pivots and motions tell the same: their sum."""
    respond(memory)
    save_start_determinant(memory)
    negative, size = memory.kernels.determinant(memory.series.terms, memory)
    _, first = memory.kernels.determinant(memory.series.past, memory)
    told, found = determinant_by_null_vectors(memory)
    sizes = abs(found - size) < ROUNDING and abs(log_start_by_null_vector(memory) - first) < ROUNDING
    signs = told == negative and null_vectors_oppose(memory) == negative
    same = log_determinant_at_start(memory) == log_start_by_null_vector(memory)
    return NEGATIVE * negative + ALIKE * (signs and sizes and same)


@entry(INT(SERIES))
def by_chosen(memory):
    """The same, by the rows and variables of the beginning."""
    return compared(memory)


@entry(INT(SERIES))
def by_choosing(memory):
    """The same, by rows and variables that are chosen anew; 0 where there are fewer rows."""
    return compared(memory) if memory.kernels.choose(memory) == memory.partition.rank else 0


@pytest.mark.parametrize("signs", (by_chosen, by_choosing))
@pytest.mark.parametrize("name", ("planar_slider_crank", "spatial_slider_crank_gravity", "four_bar_gravity"))
def test_pivots_and_motions_tell_the_determinant(name, signs):
    """Of the gradient where a motion begins and that at drawn variables."""
    run = start_run(SCENES[name](), Method.parse("taylor"), np.array([0.1]), Limits(code="generic"))
    assert run.stepper.expand() == OK
    taylor, rng, found = run.stepper.taylor, np.random.default_rng(3), set()
    solver, partition, nz = taylor.solver, taylor.partition, taylor.solver.pivot_columns.size
    assert partition.rank == nz - 1 == solver.pivot_rows.size
    taylor.series.past[:], taylor.step.start_partition_id = taylor.series.terms, partition.partition_id
    solver.past[:], solver.past_motion[:] = solver.last, solver.null_space[0, :nz]
    taylor.step.start_parity = partition.parity
    for _ in range(200):
        taylor.series.terms[0, :nz] = rng.normal(size=nz)
        told = int(signs(run.stepper.argument))
        assert told >= ALIKE
        found.add((told - ALIKE, bool(partition.parity)))
    assert {negative for negative, _ in found} == {0, 1}
    assert signs is by_chosen or {odd for _, odd in found} == {0, 1}
