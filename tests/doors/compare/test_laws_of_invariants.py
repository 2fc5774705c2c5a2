"""Invariants: the power of a law from records, the sign of an energy's trend, and cells of runs that fail."""

import numpy as np
import pytest

from crosscheck.conformance import suite, trial
from crosscheck.conformance.mechanisms.invariant import resized
from crosscheck.conformance.mechanisms.specimens import Specimen, specimens
from crosscheck.conformance.runners import InProcess
from crosscheck.engine import Setting, engine
from crosscheck.invariants.experiments import EXPERIMENTS, four_bar, times_of
from crosscheck.invariants.laws import COLUMNS, cell
from crosscheck.invariants.records import Row, made
from crosscheck.judge.metrics import error_series
from tests.helpers.falling_engine import Falling
from tests.helpers.low_order_engines import euler, low_order, symplectic_euler

STEPS = COLUMNS[-1]  # the column of errors at the finest step


def run(x: float, value: float | None, outcome: str = "COMPLETED") -> dict:
    """Return the record of a run with the step x (s) and its error."""
    values = {STEPS.value: value}
    return {"experiment": STEPS.experiment, "x": x, "values": values, "outcome": outcome, "message": ""}


@pytest.mark.parametrize("power", [-2.0, -0.5, 0.0, 1.0, 3.0])
def test_power_of_a_law_is_found_whatever_its_sign(power: float) -> None:
    """Errors are 2e-3 (h / 1 ms)ᵖ at five steps h. The cell shows the one of the finest step, 1 ms, and p."""
    line = [run(x, 2e-3 * (x / 1e-3) ** power) for x in np.geomspace(0.1, 1e-3, 5)]
    assert cell(line, STEPS) == f"2e-03 ({power:.1f})"


def test_cell_names_rounding_failures_and_refusals() -> None:
    """Two values give no power; values below 1e-12 are rounding. Signs: ! no run completes, – refused, ○ no
    record."""
    assert cell([run(0.1, 3e-3), run(0.01, 2e-3)], STEPS) == "2e-03"
    assert cell([run(0.1, 1e-9), run(0.01, 1e-14), run(0.001, None, "TIMED_OUT")], STEPS) == "<1e-12"
    assert cell([run(0.1, None, "NOT_FINITE")], STEPS) == "!"
    assert cell([run(0.0, None, "REFUSED")], STEPS) == "–" and cell([], STEPS) == "○"


@pytest.mark.parametrize(("step", "status"), [(euler, suite.FAIL), (symplectic_euler, suite.PASS)])
def test_explicit_euler_feeds_energy_into_a_tumbling_body_and_symplectic_euler_does_not(step, status):
    """Both are of order 1, with energy errors of equal size and opposite sign; the check "passive" of the
    suite allows no gain. Settings of 10 and 20 steps over the duration suffice to show it."""
    body = next(each.scene for each in specimens() if each.scene.name == "tumbling body")
    bench = trial.set_up(InProcess(low_order(step, parts=(10, 20))), Specimen(body, keeps="energy"))
    assert suite.verdict_on("passive", bench).status == status


def test_similar_copy_takes_as_many_steps_although_the_engine_rounds_their_number_up():
    crank = next(each.scene for each in specimens() if each.scene.name == "whirling crank")
    bench = trial.set_up(InProcess(low_order(euler, parts=(50, 100))), Specimen(crank, keeps="energy"))
    assert suite.verdict_on("similar", bench).status == suite.PASS


class Jointless(Falling):
    """Maps no joints, and has no settings for a mechanism that it refuses."""

    def settings(self, scene):
        raise ValueError(f"{scene.name} is refused")


JOINTLESS = Jointless()


def test_a_refused_mechanism_is_recorded_without_its_settings():
    """All experiments are about mechanisms with joints, so that each has one record with the reason."""
    row = Row(f"{__name__}:JOINTLESS", "best")
    assert [record["outcome"] for each in EXPERIMENTS for record in made(row, each)] == ["REFUSED"] * 6


def test_an_error_of_cg_depends_on_tolerance_times_the_square_of_the_size():
    """MuJoCo's tolerance of hinges has the unit rad²/s⁴, and accelerations fall as 1 / size, so that the size
    and the tolerance of a similar motion that is off by as much are (1, ε) and (s, ε / s²)."""
    offs = []
    for size, tolerance in ((1.0, 1e-6), (10.0, 1e-8), (10.0, 1e-6)):
        scene, step = resized(four_bar(), size), {"step": 1e-3 * size**0.5}
        ways = ({}, {"solver": "CG", "tolerance": tolerance})
        runs = [engine("mujoco").run(scene, times_of(scene), Setting("stock", step | way)) for way in ways]
        offs.append(error_series(scene, *runs).max())
    assert offs[1] == pytest.approx(offs[0], rel=1e-3) and offs[2] > 3 * offs[0] > 1e-4, offs
