"""Search for the cheapest setting, of models of runs with known cost and error, against one by hand."""

from collections.abc import Callable
from dataclasses import asdict
from typing import Any, NamedTuple

import numpy as np
import pytest

from crosscheck.cli.options import length
from crosscheck.engine import Setting
from crosscheck.study.grid import Case, key
from crosscheck.study.search.cheapest import by_closure, tuned
from crosscheck.study.search.neighbours import STEP, longest_step, within, work
from mbref import rotations
from mbref.motions.trajectory import Cost
from mbref.scene import Body, Scene
from tests.helpers.fake_engines import FAKES

BLOCK = Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0))
FOUND_TO = 1.15  # factor to which the search finds the longest step that is accurate enough
SCENE = Scene(name="block", body=(BLOCK,), duration=1.0)


class Family(NamedTuple):
    """A run with step h has the error factor · h^order, takes cost / h seconds, fails above ``longest``."""

    order: float
    factor: float = 1.0
    cost: float = 1e-3
    longest: float = 1.0


class Modelled:
    """A model of an engine's runs, with 1 / h right-hand sides; ``asked`` has family and step of each run.
    ``changed`` gets each record and returns the one that the run has instead."""

    def __init__(self, changed: Callable[[dict], dict] = dict, **families: Family) -> None:
        self.changed, self.families, self.asked = changed, families, []

    def __call__(self, cases: list[Case]) -> list[dict[str, Any]]:
        return [self.changed(self.record(case)) for case in cases]

    def record(self, case: Case) -> dict[str, Any]:
        order, factor, cost, longest = self.families[case.setting.family]
        h = case.setting.options["step"]
        self.asked.append((case.setting.family, h))
        return {
            "key": key(case),
            "family": case.setting.family,
            "outcome": "COMPLETED" if h <= longest else "NOT_FINITE",
            "t_end": 1.0,
            "metrics": {"error": factor * h**order, "error_bound": 1e-14},
            "cost": {"seconds": cost / h, "rhs": round(1 / h)},
        }

    def cases(self, *steps: float) -> list[Case]:
        times = np.array([0.0, 1.0])
        settings = [Setting(family, {"step": h}) for family in self.families for h in steps]
        return [Case(SCENE, times, f"{FAKES}:FAKE", setting) for setting in settings]


def found(engine: Modelled, level: float, *steps: float, ours: tuple[str, ...] = ()) -> dict[str, float]:
    done = tuned(engine.cases(*steps), level, engine, ours)
    return {r["family"]: c.setting.options["step"] for c, r in zip(done.cases, done.reached, strict=True)}


@pytest.mark.parametrize("level", [1e-2, 3e-4, 1e-6])
def test_cheapest_step_is_found_inside_and_beyond_the_grid_of_steps(level):
    """An error of h⁴ reaches the level at h = level^¼, found from below to a factor of 1.15 (FOUND_TO); one
    grid of steps is finer, the other has coarser and finer ones."""
    best = level**0.25
    for steps in ((0.01, 0.003, 0.001), (0.9, 0.3, 0.1, 0.03, 0.01)):
        step = found(Modelled(rk4=Family(order=4.0)), level, *steps)["rk4"]
        assert best / FOUND_TO < step <= best, (level, steps, step, best)


def test_cheapest_setting_is_no_more_accurate_than_needed():
    """The error h⁴ is to be below 1e-3. The setting found has the least work of all runs within it, its error
    exceeds a tenth of this, and the finest step of the grid, 0.001, is not run."""
    engine = Modelled(rk4=Family(order=4.0))
    done = tuned(engine.cases(0.1, 0.01, 0.001), 1e-3, engine)
    [cheapest] = done.reached
    assert cheapest["metrics"]["error"] > 1e-4, cheapest
    good = [r["cost"]["rhs"] for r in done.records if r["metrics"]["error"] <= 1e-3]
    assert cheapest["cost"]["rhs"] == min(good)
    assert 0.001 not in [h for _, h in engine.asked]


def test_cheapest_step_is_below_the_one_at_which_runs_fail():
    """Any step that runs is accurate: the answer is the largest that runs, 0.05."""
    step = found(Modelled(soft=Family(order=1.0, factor=1e-9, longest=0.05)), 1e-3, 0.004, 0.002)["soft"]
    assert 0.05 / FOUND_TO < step <= 0.05, step


def test_no_coarser_step_is_tried_that_costs_as_much():
    """Steps longer than 0.1 cost as much as 0.1, as where samples bound the step: after the grid's two
    settings no coarser one is tried, and the answer has the work of 0.1, 10 right-hand sides."""
    least = {"seconds": 1e-2, "rhs": 10}
    engine = Modelled(
        lambda record: record | {"cost": {name: max(record["cost"][name], least[name]) for name in least}},
        f=Family(order=4.0, factor=1e-12),
    )
    done = tuned(engine.cases(0.1, 0.05), 1e-3, engine)
    assert len(done.records) == 2 and work(done.reached[0]) == 10, done.records


def test_family_more_expensive_than_the_cheapest_is_abandoned():
    """After its coarsest run, of 10 s, which the cheap family undercuts, it is not run at finer steps."""
    engine = Modelled(cheap=Family(order=4.0), expensive=Family(order=1.0, cost=1.0))
    assert list(found(engine, 1e-6, 0.1, 0.01, 0.001)) == ["cheap"]
    assert [h for family, h in engine.asked if family == "expensive"] == [0.1], engine.asked


@pytest.mark.parametrize(("seconds", "steps"), [(0.19, [0.1, 0.05]), (0.2, [0.1])])
def test_inaccurate_family_is_abandoned_once_its_run_costs_twice_the_cheapest(seconds, steps):
    """At h = 0.1 "cheap" has the error h² = 0.01, as wanted, and runs for 0.1 s; "other" has an error of 4 h²
    and needs h = 0.05, which is tried only if its run at h = 0.1 took less than 0.2 s."""
    other = Family(order=2.0, factor=4.0, cost=0.1 * seconds)
    engine = Modelled(cheap=Family(order=2.0, cost=0.01), other=other)
    found(engine, 1.001e-2, 0.1, 0.05)
    assert [h for family, h in engine.asked if family == "other"][:2] == steps, engine.asked


def test_cheap_integrator_of_crosscheck_does_not_end_the_search_of_engine_families():
    """Family "ours" costs 1e-6 of "own"; both are tuned. "slower" costs more than "own" and is abandoned. The
    error h² of "own" reaches 1e-4 at h = 1e-2."""
    theirs = {"own": Family(order=2.0, cost=1.0), "slower": Family(order=1.0, cost=1.0)}
    engine = Modelled(ours=Family(order=8.0, cost=1e-6), **theirs)
    both = found(engine, 1e-4, 0.1, 0.01, 0.001, 0.0001, ours=("ours",))
    assert list(both) == ["ours", "own"], both
    assert 1e-2 / FOUND_TO < both["own"] <= 1e-2


def test_family_that_timed_out_is_abandoned():
    """The first run times out, and no other run is made."""
    engine = Modelled(lambda record: record | {"outcome": "TIMED_OUT"}, slow=Family(order=4.0, cost=1.0))
    assert not found(engine, 1e-9, 0.1, 0.01) and len(engine.asked) == 1, engine.asked


@pytest.mark.parametrize(("bound", "settings"), [(2e-9, 0), (1e-11, 1)])
def test_no_setting_reaches_an_error_below_the_truth_s_bound(bound, settings):
    """A truth known to 2e-9 cannot show an error below 1e-10, and one known to 1e-11 can."""
    known = {"metrics": {"error": 1e-15, "error_bound": bound}}
    engine = Modelled(lambda record: record | known, f=Family(order=4.0))
    assert len(tuned(engine.cases(0.001, 0.0005), 1e-10, engine).reached) == settings


def test_steps_are_limited_by_the_longest_interval_between_samples():
    """Steps end at samples: with samples at 0.1, 0.3 and 0.4 s, longer steps run as 0.2 s. ``within`` leaves
    these out; a step of the longest interval is in their place, with beta ~ 1 / step."""
    assert longest_step([0.1, 0.3, 0.4]) == pytest.approx(0.2, rel=1e-14)
    assert longest_step([0.5]) == 0.5
    steps = [Setting("f", {"step": h, "beta": 0.2 / h}) for h in (0.4, 0.1, 0.025)]
    assert within(steps, 0.2) == [Setting("f", {"step": 0.2, "beta": 1.0}), *steps[1:]]
    assert within(steps, 0.1) == steps[1:] and within(steps, 0.4) == steps
    assert within(steps, 0.05) == [Setting("f", {"step": 0.05, "beta": 4.0}), steps[2]]
    assert within(steps, 0.02) == [Setting("f", {"step": 0.02, "beta": 8.0})]
    loose = [Setting("f", {"rtol": r}) for r in (0.1, 0.01)]
    assert within(loose, 1e-3) == loose


def test_settings_of_steps_longer_than_the_samples_allow_are_not_chosen():
    """Samples are 0.1 s apart, so that longer steps run as 0.1 s. The error h² is zero by chance for settings
    of steps near 0.5 s: these are not run, and the answer is √1e-3 s."""

    def bounded(record):
        step = record["metrics"]["error"] ** 0.5
        error = 0.0 if 0.45 < step < 0.55 else min(step, 0.1) ** 2
        return record | {"metrics": {"error": error, "error_bound": 1e-14}}

    engine = Modelled(bounded, f=Family(order=2.0))
    times = np.linspace(0.0, 1.0, 11)
    done = tuned([case._replace(times=times) for case in engine.cases(0.5, 0.05, 0.01)], 1e-3, engine)
    [cheapest] = done.cases
    assert 1e-3**0.5 / FOUND_TO < cheapest.setting.options[STEP] <= 1e-3**0.5
    assert max(h for _, h in engine.asked) == 0.1


def test_cheapest_step_by_closure_gap_counts_distances_and_no_angles():
    """The block is h² m off: 1 mm at √1e-3 s; it is also tilted by 0.5 rad, which does not count."""
    weld = {"name": "A", "type": "fixed", "bodies": ["ground", "b"], "anchor": [2.0, 0.0, 0.0]}
    scene = SCENE.with_(joint=[weld])
    tilt = rotations.from_vector(np.array([0.5, 0.0, 0.0])).tolist()
    rates = {"velocity": [[0.0] * 3] * 2, "angular_velocity": [[0.0] * 3] * 2}
    known = {"engine": "fake", "version": "1", "method": "", "settings": {}, "message": "", "reactions": {}}

    def with_states(record):
        place = [[0.0, record["metrics"]["error"], 0.0]] * 2
        bodies = {"b": {"position": place, "orientation": [tilt] * 2, **rates}}
        cost = asdict(Cost(1.0)) | record["cost"]
        return record | known | {"times": [0.0, 1.0], "bodies": bodies, "cost": cost}

    engine, wanted = Modelled(with_states, rk2=Family(order=2.0)), by_closure(1e-3, scene)
    done = tuned(engine.cases(0.1, 0.01, 0.001), wanted.level, engine, measure=wanted.measure)
    [cheapest] = done.cases
    best = 1e-3**0.5
    assert best / FOUND_TO < cheapest.setting.options["step"] <= best
    assert wanted.name == "a closure gap of 1 mm" and wanted.text(done.reached[0]).endswith(" mm")


@pytest.mark.parametrize(("text", "metres"), [("1mm", 1e-3), ("0.5 in", 0.0127), ("2e-4", 2e-4)])
def test_length_option_takes_a_unit_and_means_metres_without(text, metres):
    """1 in = 25.4 mm."""
    assert length(text) == pytest.approx(metres, rel=1e-15)  # four roundings
