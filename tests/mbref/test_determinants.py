"""The sign of det(G Gᵀ₀) by pivots and motions / by the determinant."""

import numpy as np
import pytest

from mbref.kernels.compilation import INT, entry
from mbref.kernels.layout import OK
from mbref.method import Method
from mbref.scenes import SCENES
from mbref.simulation.simulate import Limits
from mbref.taylor.crossing import motions_oppose, overlap, remember_gradient
from mbref.taylor.layout import SERIES
from mbref.taylor.run import TaylorRun
from mbref.taylor.solver import respond

NEGATIVE, ALIKE = 1, 2


@entry(INT(SERIES))
def signs(memory):
    """NEGATIVE where the determinant is, ALIKE where pivots and motions tell the same: their sum."""
    respond(memory)
    remember_gradient(memory)
    negative, _ = overlap(memory.series.terms, memory)
    return NEGATIVE * negative + ALIKE * (motions_oppose(memory) == negative)


@pytest.mark.parametrize("name", ("spatial_slider_crank_gravity", "four_bar_gravity"))
def test_pivots_and_motions_tell_the_sign_of_the_determinant(name):
    """Of the gradient where a motion begins and that at drawn variables, by the same rows and variables."""
    run = TaylorRun(SCENES[name](), Method.parse("taylor"), np.array([0.1]), Limits(code="generic"))
    assert run.expand() == OK
    taylor, rng, found = run.taylor, np.random.default_rng(3), set()
    solver, progress, nz = taylor.solver, taylor.progress, taylor.solver.order.size
    assert progress.rank == nz - 1
    taylor.series.past[:], progress.past_choice = taylor.series.terms, progress.choice
    solver.past[:], solver.past_motion[:] = solver.last, solver.null_space[0, :nz]
    for _ in range(200):
        taylor.series.terms[0, :nz] = rng.normal(size=nz)
        told = int(signs(run.packed_series.argument))
        assert told >= ALIKE
        along = solver.null_space[0, :nz] @ solver.past_motion
        found.add((told - ALIKE, bool(along < 0.0)))
    assert found == {(negative, turned) for negative in (0, 1) for turned in (False, True)}
