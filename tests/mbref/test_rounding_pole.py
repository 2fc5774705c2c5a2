"""Rounding poles of series near singular positions, and their removal."""

import numpy as np
import pytest

from crosscheck.judge.metrics import measure
from crosscheck.judge.truth import truth_for
from mbref.kernels.compilation import INT, entry
from mbref.kernels.layout import OK
from mbref.method import Method
from mbref.scenes import SCENES
from mbref.simulation.simulate import Limits, simulate
from mbref.simulation.start_run import start_run
from mbref.stepping.run import Run
from mbref.taylor.crossing.rounding_pole import remove_pole, time_of_pole
from mbref.taylor.layout import SERIES

ORDER = 22


@entry(INT(SERIES))
def without_pole(memory):
    """Remove the rounding pole from the series in use: OK."""
    distance = time_of_pole(memory)
    if distance != 0.0:
        remove_pole(distance, memory)
    return OK


def with_pole(motion: np.ndarray, gap: float, distance: float) -> Run:
    """A run whose series is a motion of radius 1 and a pole at a distance (s)."""
    method = Method.parse(f"taylor[order={ORDER}]")
    run = start_run(SCENES["four_bar_gravity"](), method, np.array([0.1]), Limits(code="generic"))
    taylor = run.stepper.taylor
    step, past, nz = taylor.step, taylor.series.past, taylor.solver.pivot_columns.size
    orders = np.arange(ORDER + 1)[:, None]
    past[:] = 0.0
    past[: ORDER + 1, :nz] = motion[:, :nz] + gap * np.arange(1, nz + 1) / distance**orders
    taylor.distance.start_pivot, taylor.distance.largest_pivot = abs(distance), 1.0
    step.last_order = step.used_order = ORDER
    without_pole(run.stepper.argument)
    return run


@pytest.mark.parametrize("distance", (0.01, -0.01, 0.03))
def test_a_pole_by_rounding_is_removed(distance):
    """Of a position ahead, with the time to it, and of one behind."""
    motion = np.random.default_rng(5).uniform(0.5, 1.0, (ORDER + 1, 6))
    run = with_pole(motion, 1e-15, distance)
    step, nz = run.stepper.taylor.step, run.stepper.taylor.solver.pivot_columns.size
    assert step.time_to_pole == pytest.approx(distance, rel=1e-6)
    assert 4 <= step.used_order == step.last_order < ORDER
    left = run.stepper.taylor.series.past[: int(step.last_order), :nz] - motion[: int(step.last_order), :nz]
    reached = 4.0 * abs(distance) ** np.arange(
        int(step.last_order)
    )  # of steps four times as long as the distance
    assert np.abs(left * reached[:, None]).max() < 1e-12


@pytest.mark.parametrize("gap", (1e-9, 1e-12, 1e-13))
def test_the_pole_of_a_wider_gap_stays(gap):
    """One wider than rounding explains."""
    motion = np.random.default_rng(5).uniform(0.5, 1.0, (ORDER + 1, 6))
    run = with_pole(motion, gap, 0.01)
    assert run.stepper.taylor.step.time_to_pole == 0.0
    assert run.stepper.taylor.step.used_order == ORDER


@pytest.mark.parametrize("name", ("four_bar_gravity", "five_bar_gravity"))
def test_crossings_take_few_steps(name):
    """As few as the motion itself asks for, and to the tolerance."""
    scene = SCENES[name]()
    times = np.linspace(0.0, scene.duration, 11)
    run = simulate(scene, Method.parse("taylor[order=22]"), times, Limits(rtol=1e-8, code="generic"))
    exact = simulate(scene, Method.parse("taylor[order=26]"), times, Limits(rtol=1e-12, code="generic"))
    assert run.outcome.label == exact.outcome.label == "COMPLETED"
    assert run.cost.steps + run.cost.rejected <= 18
    found, known = (np.array([p.time for p in each.crossings]) for each in (run, exact))
    assert known.size == 3
    assert np.abs(found - known).max() < 1e-8
    assert np.abs(run.position - exact.position).max() < 1e-7


@pytest.mark.parametrize("name", ("four_bar", "five_bar"))
def test_a_driven_singular_position_is_crossed_by_one_high_accuracy_step(name):
    """A predictor step ends where that step begins; samples beside the position are exact."""
    scene = SCENES[name]()
    first = simulate(scene, Method.parse("taylor"), [scene.duration]).crossings[0].time
    times = np.sort(np.append(np.linspace(0.0, scene.duration, 11), first + np.array([-1e-5, 0.0, 1e-5])))
    run = simulate(scene, Method.parse("taylor"), times, Limits(code="generic"))
    assert len(run.crossings) == 4 and run.cost.steps + run.cost.rejected <= 14
    error = measure(scene, run, truth_for(scene))
    assert error["error"] < 1e-12 and error["velocity_error"] < 1e-12, error
