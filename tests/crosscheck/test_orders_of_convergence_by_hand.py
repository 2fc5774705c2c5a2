"""Orders of convergence / runs on paper whose errors, times and steps equal the limits."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from crosscheck.convergence import document, ladders
from crosscheck.convergence.ladders import LOWER, Row, climb, fineness, in_vain, ladder
from crosscheck.engine import Setting
from crosscheck.judge.tolerances import FALSE_SUCCESS
from crosscheck.study.grid import Case
from mbref.scene import Body, Scene

SCENE = Scene(name="s", body=(Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0)),))


def run(error: float, steps: int = 1, **more: Any) -> dict[str, Any]:
    made = {
        "outcome": "COMPLETED",
        "t_end": 2.0,
        "metrics": {"error": error, "error_bound": 1e-14},
        "cost": {"seconds": 1.0, "steps": steps},
        "asked": {"options": {"step": 0.5}},
        "engine": "e",
        "family": "f",
        "scene": "s",
        "version": "1",
    }
    return {**made, **more}


def case(**options: Any) -> Case:
    return Case(SCENE, np.array([0.0, 1.0]), "e", Setting("f", options))


# --- runs in vain -------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("errors", "wanted"),
    [
        ([1e-6, LOWER * 1e-6], 0),
        ([1e-6, 0.701 * 1e-6], 1),
        ([FALSE_SUCCESS, FALSE_SUCCESS], 1),
        ([1.01 * FALSE_SUCCESS] * 2, 0),
        ([1e-6, 1e-6, 1e-6], 2),
        ([1e-6, 1e-6, 1e-9], 0),
        ([1e-6, 2e-6, 0.9e-6, 0.65e-6], 3),
        ([1e-15, 0.0], 1),
        ([1e-6, math.inf], 1),
    ],
)
def test_runs_without_a_lower_error(errors, wanted):
    """An error of seven tenths of the least one is lower; below the truth's bound no error is."""
    assert in_vain([run(e, steps=k + 1) for k, e in enumerate(errors)]) == wanted


def test_runs_with_as_many_steps_do_not_count():
    assert in_vain([run(1e-6, 3), run(1e-6, 3), run(1e-6, 4), run(1e-6, 4)]) == 1
    failed = run(1e-9, 5, outcome="STEP_FAILED")
    assert in_vain([run(1e-6, 3), failed, failed | {"cost": {"steps": 6}}]) == 2, "a failure lowers nothing"
    assert in_vain([run(1e-6, 0)]) == 0


@pytest.mark.parametrize(("seconds", "count"), [(1.0, 3), (1.01, 2)])
def test_a_run_of_just_the_time_limit_is_made(seconds, count):
    """Half of the step takes twice the time: 0.5 s, 1 s and 2 s, with a limit of 2 s."""
    cases = [case(step=0.5 / 2**k) for k in range(5)]

    def made(case: Case) -> dict[str, Any]:
        h = case.setting.options["step"]
        cost = {"seconds": 0.25 * seconds / h, "steps": round(1 / h)}
        return run(h**4, asked={"options": {"step": h}}, cost=cost)

    assert len(climb(cases, made)) == count
    assert len(climb(cases, made, 100.0)) == 5 and len(climb(cases, lambda case: run(1e-6, 7))) == 2


def test_the_ladder_ends_after_two_runs_in_vain():
    steps = iter(range(1, 9))
    assert len(climb([case(rtol=10.0**-k) for k in range(8)], lambda case: run(1e-6, next(steps)))) == 3


@pytest.mark.parametrize(
    ("record", "wanted"),
    [
        (run(0.5), 2.0),
        (run(0.5, outcome="TIMED_OUT"), math.inf),
        (run(0.5, outcome="STEP_FAILED"), 0.0),
        (run(0.5, asked={"options": {"rtol": 1e-3}}), 4.0),
    ],
)
def test_time_that_a_finer_run_would_take(record, wanted):
    """A quarter of a second after half of a second; tolerances do not change the time."""
    assert ladders._would_take(case(step=0.25), record) == wanted
    assert ladders._would_take(case(rtol=1e-9), run(0.5, asked={"options": {"rtol": 1.0}})) == 1.0


def made_ladder(monkeypatch: pytest.MonkeyPatch, end: float, **options: Any) -> list[Any]:
    asked: list[Any] = []

    def default_cases(scene: Scene, engines: Any, families: Any, times: Any, limit: float) -> Any:
        asked.append((engines, families, times.tolist(), limit))
        return ([case(**options), case(other=1)] if options else []), []

    monkeypatch.setattr(ladders, "default_cases", default_cases)
    mechanism = type("Mechanism", (), {"make": lambda self: SCENE, "end": end})()
    found = ladder(Row("e", "f", "method"), mechanism)
    assert asked == [(["e"], ["f"], np.linspace(0.0, end, 11).tolist(), 120.0)]
    return found


@pytest.mark.parametrize(("step", "first"), [(0.125, 0.125), (0.126, 0.125), (0.124, 0.0625), (9.0, 0.125)])
def test_halved_steps_from_the_interval_of_the_samples(monkeypatch, step, first):
    """Samples are 0.125 s apart; the first step is at most the family's own."""
    found = made_ladder(monkeypatch, 1.25, step=step, beta=2.0)
    assert [c.setting.options["step"] for c in found] == [first / 2**k for k in range(16)]
    assert {c.setting.options["beta"] for c in found} == {2.0} and {c.setting.family for c in found} == {"f"}


@pytest.mark.parametrize("name", ["rtol", "accuracy"])
def test_tenths_of_a_tolerance(monkeypatch, name):
    found = made_ladder(monkeypatch, 1.0, **{name: 0.5, "step": 0.1})
    wanted = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13]
    assert [c.setting.options[name] for c in found] == wanted
    assert made_ladder(monkeypatch, 1.0) == [], "the engine refuses the mechanism"


def test_fineness_and_points():
    assert fineness({"asked": {"options": {"rtol": 1e-3, "step": 0.5}}}) == 0.5
    assert fineness({"asked": {"options": {"accuracy": 1e-4}}}) == 1e-4 and fineness({"asked": {}}) == 0.0
    assert ladders.point(run(1.26e-5)) == "0.5: 1.3e-05"
    assert ladders.point(run(0.5, outcome="STEP_FAILED")) == "0.5: step failed at 2 s"
    assert Row("e", "f", "m").time_limit == 2.0 and Row("e", "f", "m").name == "e, f"
    slow = {(row.engine, row.family) for row in ladders.ROWS if row.time_limit == 10.0}
    assert slow == {("newton", "dvi, moreau"), ("newton", "dvi"), ("newton", "defaults")}
    assert {row.time_limit for row in ladders.ROWS} == {2.0, 10.0}


# --- cells --------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("error", "bound", "text"),
    [
        (1e-14, 1e-14, "1e-14"),
        (0.9e-14, 1e-14, "<1e-14"),
        (1.1e-14, 1e-14, "1e-14 ↓"),
        (3e-9, 1e-14, "3e-09 ↓"),
    ],
)
def test_a_least_error_at_the_bound_of_the_truth(error, bound, text):
    assert document.cell([run(error, metrics={"error": error, "error_bound": bound})]) == text


def test_the_least_of_the_completed_runs():
    failed = run(1e-12, outcome="STEP_FAILED")
    assert document.cell([run(1e-3), failed, run(2e-5, 2), run(1e-4, 3)]) == "2e-05 ↓"
    assert document.cell([run(1e-3), *(run(1e-3, k) for k in (2, 3))]) == "1e-03", "two runs in vain"
    assert document.cell([failed]) == "!" and document.cell([{"outcome": "REFUSED"}]) == "–"


def halved(errors: list[float]) -> list[dict[str, Any]]:
    return [run(e, 2**k, asked={"options": {"step": 2.0**-k}}) for k, e in enumerate(errors)]


def test_the_order_of_three_steps_above_the_floor():
    """Errors at three times a floor do not count; of equal steps the least error does."""
    assert document.order(halved([1e-2, 1e-2 / 16, 1e-2 / 256])) == pytest.approx(4.0)
    assert document.order(halved([1e-2, 1e-2 / 16])) is None
    floor = 1e-6
    lost = halved([4096 * floor, 256 * floor, 16 * floor, floor, floor, floor])
    assert in_vain(lost) >= ladders.VAIN and document.order(lost) == pytest.approx(4.0)
    near = halved([256 * floor, 16 * floor, 3 * floor, floor, floor, floor])
    assert document.order(near) is None, "the third is three times the floor"
    twice = [*halved([1e-2, 1e-2 / 16, 1e-2 / 256]), run(9.0, 1, asked={"options": {"step": 1.0}})]
    assert document.order(twice) == pytest.approx(4.0)


@pytest.mark.parametrize(
    ("options", "steps", "wanted"), [({"step": 0.125}, 4, 0.125), ({}, 4, 0.5), ({}, 1, 2.0), ({}, 0, 2.0)]
)
def test_the_step_or_the_mean_step(options, steps, wanted):
    assert document.step(run(0.5, steps, asked={"options": options})) == wanted


def test_lines_of_runs():
    assert document._runs([]) == "not measured"
    refused = {"outcome": "REFUSED", "message": "no loop", "owner": "engine"}
    assert document._runs([refused]) == "refused: no loop (engine)"
    assert document._runs([run(1e-3), run(1e-6)]) == "0.5: 1.0e-03; 0.5: 1.0e-06"


def test_rows_that_were_measured(monkeypatch):
    """Coarse to fine for each mechanism; rows without records are left out."""
    mechanisms = [type("M", (), {"heading": name.upper(), "scene": name})() for name in "st"]
    rows = (Row("e", "f", "method"), Row("e", "g", "other"))
    monkeypatch.setattr(document, "MECHANISMS", mechanisms)
    monkeypatch.setattr(document, "ROWS", rows)
    fine, coarse = (run(1e-3, asked={"options": {"step": h}}) for h in (0.1, 0.2))
    others = run(1e-3, engine="x"), run(1e-3, scene="u")
    assert document.table([fine, coarse, *others]) == {rows[0]: {"S": [coarse, fine], "T": []}}
    assert document._anchor(Row("e", "f, g", "m")) == "e--f--g"
