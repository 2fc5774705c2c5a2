"""Conformance suite: engines of order 1 and 2 conform with right equations, and fail with wrong ones."""

from dataclasses import replace

import pytest

from crosscheck.conformance import suite
from crosscheck.conformance.mechanisms.specimens import specimens
from crosscheck.conformance.runners import InProcess
from tests.helpers.low_order_engines import FAULTS, Step, euler, low_order, midpoint, symplectic_euler

# without changed scenes, whose runs take most of the time
SPECIMENS = {each.scene.name: replace(each, related=False) for each in specimens()}
SHOWN_ON = {  # a scene of the suite on which each fault shows
    **{"gravity has the other sign": "pendulum", "gravity acts twice": "pendulum"},
    **{"a moment acts twice": "moment load", "a spring has half its stiffness": "several springs"},
    **{"gyroscopic moments are forgotten": "tumbling body", "armature is ignored": "armature pendulum"},
}
RUNS = sorted(set(SHOWN_ON.values()) - {"armature pendulum"})  # the engine without a fault refuses armatures


def failures(step: Step, scenes: list[str], fault: str = "") -> list[str]:
    """Return the checks that fail, in this process."""
    found = suite.held_against(InProcess(low_order(step, fault)), [SPECIMENS[name] for name in scenes])
    failed = [v for v in found.verdicts if v.status == "fail"]
    return [f"{v.scene} {v.property} {v.measured} {v.allowed} {v.reason}" for v in failed]


@pytest.mark.slow
@pytest.mark.parametrize("step", [euler, symplectic_euler, midpoint])
@pytest.mark.parametrize("scene", RUNS)
def test_engine_of_low_order_with_right_equations_violates_no_check(step: Step, scene: str):
    """Euler's methods have order 1, the midpoint method 2. Errors of their steps are no faults."""
    assert failures(step, [scene]) == []


@pytest.mark.slow
@pytest.mark.parametrize("step", [euler, symplectic_euler, midpoint])
@pytest.mark.parametrize("fault", FAULTS)
def test_fault_in_an_engine_of_low_order_violates_a_check_on_the_scene_that_shows_it(step: Step, fault: str):
    """A fault in the equations does not pass as an error of the steps. SHOWN_ON names the scenes."""
    assert failures(step, [SHOWN_ON[fault]], fault)


@pytest.mark.parametrize("step", [euler, midpoint])
def test_free_fall_by_steps_of_low_order_violates_a_check_only_with_twice_the_gravity(step: Step):
    """Errors of the steps of Euler's and of the midpoint method are no faults; twice the gravity is one."""
    assert failures(step, ["free_fall"]) == []
    assert failures(step, ["free_fall"], "gravity acts twice")
