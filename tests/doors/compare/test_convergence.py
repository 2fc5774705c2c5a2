"""Orders and Richardson limits of runs made up with a known order, floor and bias; ladders of steps."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from crosscheck.convergence.ladders import MECHANISMS, ROWS, TIME_LIMIT, climb, in_vain, ladder
from crosscheck.convergence.orders import cell, order
from crosscheck.judge.constraints import scene_length
from crosscheck.judge.metrics import error_series
from crosscheck.judge.richardson import limit
from crosscheck.judge.truth import truth_for
from crosscheck.study.grid import Case
from mbref import rotations
from mbref.motions.trajectory import Trajectory
from mbref.scenes import SCENES

TUNED_MUJOCO = next(row for row in ROWS if (row.engine, row.family) == ("mujoco", "tuned"))
BENNETT = next(mechanism for mechanism in MECHANISMS if mechanism.scene == "bennett")


def run(step: float, error: float, seconds: float = 0.1, outcome: str = "COMPLETED", **changes) -> dict:
    """Return the record of a run over 1 s with a step, an error and CPU time."""
    record = {"asked": {"options": {"step": step}}, "outcome": outcome, "t_end": 1.0}
    record["metrics"] = {"error": error, "error_bound": 1e-14}
    return record | {"cost": {"seconds": seconds, "steps": round(1 / step)}} | changes


def runs(power: float, floor: float, count: int = 12) -> list[dict]:
    """Runs at halved steps with the error step**power + floor."""
    return [run(0.1 / 2**k, (0.1 / 2**k) ** power + floor) for k in range(count)]


def test_two_runs_or_errors_that_do_not_fall_have_no_order() -> None:
    """Errors are step⁴ + 1e-9. Twelve runs have an order, the first two alone have none."""
    assert order(runs(4.0, 1e-9)) is not None
    assert order(runs(4.0, 1e-9)[:2]) is None
    assert order([run(0.1 / 2**k, 1e-9) for k in range(5)]) is None


@pytest.mark.parametrize("power", [1.0, 2.0, 4.0])
def test_an_error_at_the_bound_of_the_truth_shows_no_order(power: float) -> None:
    """Three errors are made up with a known order. If the last one equals the bound of the truth's error,
    there is no order; if it is 1 % above the bound, there is one."""
    for bound, is_measured in ((1e-3, False), (0.99e-3, True)):
        last = run(0.025, 1e-3) | {"metrics": {"error": 1e-3, "error_bound": bound}}
        line = [run(0.1 / 2**k, 1e-3 * 2 ** (power * (2 - k))) for k in range(2)]
        assert (order([*line, last]) is not None) is is_measured


def test_cell_shows_the_least_error_and_the_order() -> None:
    """Errors are step^power + floor, with the bound 1e-14 of the truth. ↓: the finest step has the least
    error; <1e-14: the least error is below the bound; ! no run completes; – refused; ○ no record."""
    assert cell(runs(4.0, 3e-12)) == "3e-12 (4.0)"
    assert cell(runs(1.0, 0.0, 6)) == "3e-03 ↓ (1.0)"
    assert cell([*runs(4.0, 0.0, 8), run(1e-4, 2e-15)]) == "<1e-14 (4.0)"
    assert cell([run(0.1, 0.5, outcome="STEP_FAILED")]) == "!"
    assert cell([{"outcome": "REFUSED"}]) == "–" and cell([]) == "○"


def test_last_runs_that_lower_the_least_error_by_less_than_30_percent_are_counted() -> None:
    """`in_vain` counts such runs at the end of a ladder. Runs before the first error below 0.5, and runs with
    as many steps as the run before, do not count."""
    assert in_vain(runs(4.0, 1e-6)[:3]) == 0, "errors fall by over 30 %"
    assert in_vain([run(0.1, 0.5), run(0.05, 0.9), run(0.02, 0.8)]) == 0, "no error is below 0.5"
    found = [run(0.1, 1e-6), run(0.05, 0.8e-6), run(0.02, 0.9e-6)]
    assert in_vain(found) == 2 and in_vain([*found, run(0.01, 1e-9)]) == 0
    assert in_vain([run(0.1, 1e-9)] * 4) == 0, "all runs have ten steps"


def test_steps_of_a_ladder_are_halved_and_divide_the_interval_of_samples() -> None:
    """The ladder of Bennett's linkage in MuJoCo's family "tuned" has more than ten steps. Eleven samples are
    a tenth of the motion apart, which is a multiple of the longest step, and so of all."""
    cases = ladder(TUNED_MUJOCO, BENNETT)
    steps = [case.setting.options["step"] for case in cases]
    assert all(a == 2 * b for a, b in pairwise(steps)) and len(steps) > 10
    assert (BENNETT.end / 10 / steps[0]).is_integer()


def test_a_ladder_ends_where_finer_runs_are_vain_or_would_take_too_long() -> None:
    """Errors 1e4 h⁴ + 1e-10 reach their floor of 1e-10; two runs that do not lower it (`in_vain`) end the
    ladder. A run of 0.75 TIME_LIMIT is the last, since half the step would take 1.5 TIME_LIMIT."""
    cases = ladder(TUNED_MUJOCO, BENNETT)

    def fourth(case: Case) -> dict:
        h = case.setting.options["step"]
        return run(h, 1e4 * h**4 + 1e-10, 1e-5 / h)

    found = climb(cases, fourth)
    assert in_vain(found) == 2 and len(found) < len(cases)
    slow = climb(cases, lambda case: fourth(case) | {"cost": {"seconds": 0.75 * TIME_LIMIT, "steps": 10}})
    assert len(slow) == 1


SCENE = SCENES["spatial_slider_crank_driven"]()
TRUTH = truth_for(SCENE).poses(np.linspace(0, 0.02, 5))


def made(step: float, power: float, bias: float) -> Trajectory:
    """Return a run that is shifted and turned from the truth by bias + 1e-2 · step^power. The run of step 0.1
    has quaternions of opposite sign, which are the same orientations."""
    off = bias + 1e-2 * step**power
    turn = rotations.from_vector([0.0, off / 2, 0.0])
    sign = -1.0 if step == 0.1 else 1.0
    shift = off * scene_length(SCENE) * np.array([1.0, 0.0, 0.0])
    turned = sign * rotations.multiply(turn, TRUTH.orientation)
    return replace(TRUTH, position=TRUTH.position + shift, orientation=turned)


@pytest.mark.parametrize("power, bias", [(1.0, 1e-4), (2.0, 0.0), (2.0, 3e-5), (4.0, 1e-6)])
def test_richardson_limit_finds_the_order_and_bias_put_into_the_runs(power: float, bias: float):
    """Runs at four steps h are off the truth by bias + 1e-2 h^power. Their limit is off by the bias, and the
    finest run (h = 0.1) is off the limit by 1e-2 · 0.1^power. Both hold within 1 %, or 1e-8, since large
    turns are not quite proportional to off; the order is within a thousandth."""
    steps = [0.1, 0.3, 1.0, 0.2]
    found = limit(SCENE, steps, [made(h, power, bias) for h in steps])
    error = error_series(SCENE, found.motion, TRUTH).max()
    assert found.order == pytest.approx(power, rel=1e-3), found.order
    assert found.discretisation == pytest.approx(1e-2 * 0.1**power, rel=1e-2), found.discretisation
    assert error == pytest.approx(bias, rel=1e-2, abs=1e-8), f"limit off by {error:.2e}, bias put in {bias:g}"


STEPS = [1.0, 0.5, 0.25]
WANDERING = [made(h, 1.0, off) for h, off in zip(STEPS, (0.0, 1e-3, -2e-2), strict=True)]


@pytest.mark.parametrize(
    "given",
    [WANDERING, [made(0.5, 1.0, 1e-3)] * 3, [made(h, 1.0, 0.0) for h in STEPS[:2]]],
    ids=["differences that grow", "equal runs", "two runs"],
)
def test_runs_that_follow_no_power_of_the_step_have_no_limit(given):
    """Three runs at halved steps, off the truth by 1e-2 · step, have a limit."""
    assert limit(SCENE, STEPS, [made(h, 1.0, 0.0) for h in STEPS]) is not None
    assert limit(SCENE, STEPS[: len(given)], given) is None
