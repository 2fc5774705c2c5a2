"""The default method is the faster one of two, and moves large mechanisms as closed forms and as `taylor`."""

import numpy as np
import pytest

from crosscheck import measure
from crosscheck.judge.truth import closed_form
from mbref import Limits, simulate
from mbref.method import default_method
from mbref.scene import Driver
from mbref.scenes import find_scene

SPARSE = "alf-dual+projection/dop853"


@pytest.mark.parametrize(
    ("name", "method"),
    [
        ("four_bar_chain[12]", "taylor"),
        ("four_bar_chain[40]", SPARSE),
        ("slider_crank_chain[33]", "taylor"),  # cranks on one shaft and sliders share orientations
        ("slider_crank_chain[100]", SPARSE),
        ("lattice[6,6]", SPARSE),
        ("sarrus_stack[10]", "taylor"),  # spatial loops with redundant rows make sparse matrices expensive
        ("strandbeest[30]", SPARSE),
    ],
)
def test_default_is_sparse_matrices_for_large_mechanisms_of_small_loops_and_taylor_otherwise(name, method):
    """The table has the faster method of each family of scenes at this size, by `benchmarks/growth.py`; the
    page docs/growth.md has its measurements at similar sizes."""
    assert default_method(find_scene(name)) == method


def test_mechanism_with_a_massless_link_or_a_driver_moves_by_taylor_by_default():
    """The other default, alf-dual, solves no massless links and ends at dead positions of drivers."""
    scene = find_scene("strandbeest[6]")
    assert default_method(scene).startswith("alf-dual")
    link = scene.body[1].model_copy(update={"mass": 0.0, "inertia": (0.0, 0.0, 0.0)})
    assert default_method(scene.with_(body=(scene.body[0], link, *scene.body[2:]))) == "taylor"
    turning = Driver(joint="O", polynomial=(0.0, 4.0))
    assert default_method(scene.with_(driver=(turning,))) == "taylor"


@pytest.mark.parametrize("branches", [{}, {1: 1}])
def test_default_crosses_the_singular_position_of_14_loops_as_their_closed_form(branches):
    """All loops are flat at once. Their closed form follows branch 1, also if branch 1 is chosen at the first
    crossing; another branch is off by centimetres."""
    scene, times = find_scene("four_bar_chain[14]"), np.array([0.5, 1.0])
    run = simulate(scene, times=times, limits=Limits(rtol=1e-9, branches=branches))
    assert run.outcome.name == "COMPLETED", run.message
    assert len(run.crossings) == 1
    truth = closed_form(scene).poses(times).position
    assert np.abs(run.position - truth).max() < 1e-6  # m; a thousand tolerances of the steps


BOTH = (SPARSE, "taylor")
RTOL = 1e-8
CLOSE = 10 * RTOL  # m, in mechanisms of 10 to 40 m


@pytest.mark.parametrize("name", ["sarrus_stack[12]", "sarrus_stack[30]"])
def test_sparse_matrices_and_taylor_series_move_a_stack_of_spatial_loops_alike(name):
    """A stack has no closed form: SPARSE and taylor share neither equations nor integrator. The judge finds
    the violation of constraints (of the length, or rad) and the drift of energy (of the largest energy)."""
    scene, times = find_scene(name), [0.0, 0.05]
    runs = [simulate(scene, method, times, Limits(rtol=RTOL)) for method in BOTH]
    assert [run.outcome.name for run in runs] == ["COMPLETED"] * 2, [run.message for run in runs]
    assert np.abs(runs[0].position - runs[1].position).max() < CLOSE
    found = [measure(scene, run) for run in runs]
    assert all(max(each["violation_position"], each["energy_error"]) < RTOL for each in found), found
