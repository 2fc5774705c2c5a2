"""Decisions of a run by series at its start, in its steps and at singular positions / by hand, interpreted.

``test_thresholds.py`` runs this file in a process whose kernels are interpreted, so that nothing is compiled.
"""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref.kernels.compilation import PLAIN

if not PLAIN:
    pytest.skip("kernels are interpreted by test_thresholds.py", allow_module_level=True)

from mbref.kernels.layout import NOT_CONVERGED, OK, SINGULAR, SINGULAR_AHEAD
from mbref.stepping.loop import DONE, PAUSED, STEP_TOO_SMALL, TOO_MANY_STEPS, UNDECIDED
from mbref.taylor import advance, partition, sample_completion, stepping
from mbref.taylor.crossing import detection, location, long_crossing, short_crossing, start, uniqueness
from mbref.taylor.mode import PREDICTOR, REGULAR


class Patched:
    """Functions of a module that give values and note their calls, and the arguments of the last one."""

    def __init__(self, patch: pytest.MonkeyPatch, module: Any, **values: Any) -> None:
        self.calls: list[str] = []
        self.given: dict[str, tuple[Any, ...]] = {}
        for name, value in values.items():
            patch.setattr(module, name, self._stub(name, value))

    def _stub(self, name: str, value: Any) -> Any:
        def stub(*given: Any) -> Any:
            assert isinstance(given[-1], SimpleNamespace), f"memory is the last argument of {name}"
            self.calls.append(name)
            self.given[name] = given
            return value

        return stub


# --- start ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("status", "nearly", "hides", "rests", "misses", "turned", "expected"),
    [
        (OK, 0, False, False, False, False, OK),
        (OK, 0, True, False, False, False, OK),
        (OK, 1, True, False, False, False, UNDECIDED),
        (OK, 1, False, False, False, False, OK),
        (SINGULAR, 1, False, False, False, False, UNDECIDED),
        (SINGULAR, 0, False, False, False, False, SINGULAR),
        (NOT_CONVERGED, 1, True, False, True, True, NOT_CONVERGED),
        (OK, 0, False, True, True, False, UNDECIDED),
        (OK, 0, False, True, False, True, UNDECIDED),
        (SINGULAR, 0, False, True, True, True, SINGULAR),
    ],
)
def test_starts_whose_motion_rounding_hides(
    monkeypatch, status, nearly, hides, rests, misses, turned, expected
):
    Patched(monkeypatch, start, hides_rank=hides, rests_near=rests, misses_state=misses, is_turned=turned)
    settings = SimpleNamespace(nearly_dependent=nearly)
    memory = SimpleNamespace(
        run=SimpleNamespace(equations=SimpleNamespace(system=SimpleNamespace(settings=settings))),
        progress=SimpleNamespace(rests_near="before"),
    )
    assert start.judge_start.function(status, memory) == expected
    hidden = nearly and (status == SINGULAR or (status == OK and hides))
    assert memory.progress.rests_near == ("before" if hidden else rests)


@pytest.mark.parametrize(
    ("free", "started", "speed", "part", "hidden"),
    [
        (1, 1, 0.0, 1.0, False),
        (1, 1, 0.0, 0.99, True),
        (1, 1, 2.0, 1.0, False),
        (1, 1, 2.0, 0.99, True),
        (0, 0, 2.0, 0.5, False),
        (0, 1, 2.0, 2.0, True),
        (1, 0, 2.0, 2.0, True),
    ],
)
def test_a_rank_that_rounding_hides(monkeypatch, free, started, speed, part, hidden):
    """Motions in rest and in motion resolve different pivots."""
    least = part * (start.MIN_PIVOT_RESOLVED if speed else start.MIN_PIVOT_FREE)
    Patched(monkeypatch, start, freedoms=free, least_pivot=least)
    state = SimpleNamespace(velocities=np.array([0.0, -speed]))
    memory = SimpleNamespace(
        run=SimpleNamespace(state=state), options=SimpleNamespace(start_freedoms=started)
    )
    assert start.hides_rank(memory) is hidden


@pytest.mark.parametrize(
    ("free", "speed", "part", "near"),
    [(1, 0.0, 0.99, True), (1, 0.0, 1.0, False), (0, 0.0, 0.99, False), (1, 1.0, 0.99, False)],
)
def test_a_motion_from_rest_near_a_singular_position(monkeypatch, free, speed, part, near):
    Patched(monkeypatch, start, freedoms=free, least_pivot=part * start.REST_PIVOT)
    memory = SimpleNamespace(run=SimpleNamespace(state=SimpleNamespace(velocities=np.array([0.0, speed]))))
    assert start.rests_near(memory) is near


@pytest.mark.parametrize(
    ("rests", "pivot", "correction", "turned", "after"),
    [
        (True, 0.81, 1.01, True, True),
        (True, 0.81, 1.0, False, True),
        (True, 0.81, math.nan, True, True),
        (False, 0.81, 1.01, False, False),
        (True, 1.0, 9.0, False, False),
    ],
)
def test_rounding_that_turns_a_motion_from_rest(monkeypatch, rests, pivot, correction, turned, after):
    """Pivots relative to REST_PIVOT, corrections to REST_TURN times the root of the pivot."""
    Patched(monkeypatch, start, least_pivot=pivot * start.REST_PIVOT)
    size = correction * start.REST_TURN * math.sqrt(pivot * start.REST_PIVOT)
    memory = SimpleNamespace(
        progress=SimpleNamespace(rests_near=rests), step=SimpleNamespace(correction=size)
    )
    assert bool(start.is_turned(memory)) is turned and bool(memory.progress.rests_near) is after


@pytest.mark.parametrize(
    ("moved", "changed", "free", "misses"),
    [
        (0.5, 0.0, 1, False),
        (-0.51, 0.0, 1, True),
        (0.0, -1.0, 1, False),
        (0.0, -1.01, 1, True),
        (0.0, 1.0, 0, False),
        (0.0, 1.01, 0, True),
    ],
)
def test_a_series_that_misses_its_start(monkeypatch, moved, changed, free, misses):
    """Distances up to 0.5, changes relative to the largest velocity, 4, and the allowed error."""
    allowed = start.START_ERROR if free else start.START_ERROR_DRIVEN
    q, v = np.array([1.0, -2.0]), np.array([0.0, -4.0])
    state = SimpleNamespace(coordinates=q.copy(), velocities=v.copy())
    before = SimpleNamespace(coordinates=np.zeros(2), velocities=np.zeros(2))
    memory = SimpleNamespace(
        run=SimpleNamespace(state=state, previous=before),
        series=SimpleNamespace(terms="terms"),
        options=SimpleNamespace(start_distance=0.5),
    )

    def copied(source: Any, target: Any) -> None:
        target.coordinates[:], target.velocities[:] = source.coordinates, source.velocities

    def put(series: Any, memory: Any) -> None:
        assert series == "terms"
        state.coordinates[1] += moved
        state.velocities[0] += 4.0 * allowed * changed

    monkeypatch.setattr(start, "copy_state", copied)
    monkeypatch.setattr(start, "put_terms", put)
    Patched(monkeypatch, start, freedoms=free)
    assert bool(start.misses_state(memory)) is misses
    assert state.coordinates.tolist() == q.tolist() and state.velocities.tolist() == v.tolist()


# --- many steps in one call -------------------------------------------------------------------------------
def run_of_steps(**changes: Any) -> Any:
    """A run at 1 s whose steps take 0.5 s, to its end at 3 s."""
    given = {"statuses": [], "most": 99, "call": 99, "begun": 1, "recorded": 0, "full": False, **changes}
    clock, counts = SimpleNamespace(time=1.0), SimpleNamespace(steps=0, crossings=2)
    memory = SimpleNamespace(
        run=SimpleNamespace(
            loop=SimpleNamespace(clock=clock),
            equations=SimpleNamespace(system=SimpleNamespace(counts=counts)),
            control=SimpleNamespace(steps_per_call=given["call"], most_steps=given["most"]),
        ),
        progress=SimpleNamespace(begun=given["begun"], end=3.0, recorded=given["recorded"]),
        series=SimpleNamespace(past="past"),
    )
    left = list(given["statuses"])

    def step(memory: Any) -> int:
        counts.steps += 1
        status = left.pop(0) if left else OK
        clock.time += 0.5 * (status == OK)
        return status

    memory.kernels = SimpleNamespace(step=step, begin=lambda memory: given.get("begin", OK))
    return memory


@pytest.mark.parametrize(
    ("changes", "crosses", "switches", "status", "steps", "calls"),
    [
        ({}, False, False, DONE, 4, []),
        ({"call": 3}, False, False, PAUSED, 3, []),
        ({"most": 2}, False, False, TOO_MANY_STEPS, 2, []),
        ({"statuses": [OK, STEP_TOO_SMALL]}, True, False, STEP_TOO_SMALL, 2, ["put_terms", "put_angles"]),
        ({"statuses": [SINGULAR_AHEAD]}, False, False, SINGULAR_AHEAD, 1, ["put_terms", "put_angles"]),
        ({"statuses": [SINGULAR_AHEAD]}, True, False, DONE, 5, []),
        ({"recorded": 1}, False, True, PAUSED, 1, []),
        ({"recorded": 0}, False, True, DONE, 4, []),
        ({"recorded": 1}, False, False, DONE, 4, []),
        ({"full": True}, False, False, PAUSED, 1, []),
        ({"begun": 0, "begin": SINGULAR}, False, False, SINGULAR, 0, []),
    ],
)
def test_steps_of_a_call(monkeypatch, changes, crosses, switches, status, steps, calls):
    memory, asked = run_of_steps(**changes), []
    monkeypatch.setattr(advance, "cross_briefly", lambda memory: crosses)
    monkeypatch.setattr(advance, "switches_branch", lambda crossing, memory: switches and crossing == 2)
    monkeypatch.setattr(advance, "is_full", lambda memory: changes.get("full", False))
    monkeypatch.setattr(advance, "put_terms", lambda *given: asked.append(("put_terms", *given[:-1])))
    monkeypatch.setattr(advance, "put_angles", lambda *given: asked.append(("put_angles", *given[:-1])))
    assert advance.advance_series.function(memory) == status
    assert memory.run.equations.system.counts.steps == steps
    assert asked == ([("put_terms", "past"), ("put_angles", 0.0)] if calls else [])


def test_a_series_begins_once():
    memory, begun = run_of_steps(begun=0), []
    memory.kernels.begin = lambda memory: begun.append(1) or SINGULAR
    assert stepping.begin_once(memory) == SINGULAR and stepping.begin_once(memory) == OK
    assert begun == [1] and memory.progress.begun == 1
    assert advance.enter_series.function(memory) == SINGULAR and begun == [1, 1]


# --- one step ---------------------------------------------------------------------------------------------
def with_memory(function: Any, memory: Any) -> Any:
    """Return a function whose last argument must be memory."""

    def call(*given: Any) -> Any:
        assert given[-1] is memory
        return function(*given)

    return call


def one_step(monkeypatch: pytest.MonkeyPatch, **changes: Any) -> tuple[int, list[float], Any, list[str]]:
    """Take a step from 2 s, whose longest length is 0.4 s; return status, attempts, memory and calls."""
    given: dict[str, Any] = {
        "expand": [],
        "judge": [],
        "crossed": 0,
        "pole": 0.0,
        "accurate": False,
        "turns": False,
        "lengths": [(0.4, 0.4), (0.3, 0.3)],
        "smallest": 1e-3,
        **changes,
    }
    calls: list[str] = []
    tried: list[float] = []
    lengths = list(given["lengths"])
    clock, counts = SimpleNamespace(time=2.0, attempt_end=0.0), SimpleNamespace(rejected=0, crossings=5)
    memory = SimpleNamespace(
        run=SimpleNamespace(
            loop=SimpleNamespace(clock=clock),
            equations=SimpleNamespace(system=SimpleNamespace(counts=counts)),
            control=SimpleNamespace(smallest_step=given["smallest"]),
        ),
        step=SimpleNamespace(
            start_violation=9.0, time_to_pole=given["pole"], crossed=given["crossed"], time_to_crossing=0.0
        ),
        kernels=SimpleNamespace(
            multipliers=lambda memory: calls.append("multipliers"),
            save_series=lambda memory: calls.append("save_series"),
            return_to_start=lambda memory: calls.append("return"),
        ),
    )

    def expand(h: float, last: Any, memory: Any) -> int:
        assert last is ((h, end) == (0.4, 7.0))
        tried.append(round(h, 12))
        return given["expand"].pop(0) if given["expand"] else OK

    def judge(h: float, last: Any, memory: Any) -> int:
        assert (h, last) == (pytest.approx(tried[-1]), (h, end) == (0.4, 7.0))
        return given["judge"].pop(0) if given["judge"] else OK

    end = 7.0
    replace = {
        "end_of_step": lambda memory: 7.0,
        "save_start": lambda memory: calls.append("save_start"),
        "first_lengths": lambda left, memory: lengths.pop(0) if left == 5.0 else None,
        "turns_back_in": lambda h, memory: given["turns"] and h == 0.4,
        "is_accurate": lambda memory: given["accurate"],
        "is_last": lambda h, stop, memory: (h, stop) == (0.4, 7.0),
        "expand_at": expand,
        "judge_step": judge,
        "time_to_singular_position": lambda h, memory: 10.0 * h,
        "next_length": lambda h, regular, memory: 0.5 * h,
        "end_step": lambda h, stop, memory: calls.append(f"end_step {h:g} {stop:g}"),
        "put_angles": lambda h, memory: calls.append(f"put_angles {h:g}"),
        "count_crossings": lambda h, memory: 2 if h == tried[-1] else 99,
        "begin_pieces": lambda stop, memory: 77,
    }
    for name, value in replace.items():
        monkeypatch.setattr(stepping, name, with_memory(value, memory))
    status = stepping.take_step.function(memory)
    assert memory.step.start_violation == 0.0 and calls[0] == "save_start"
    return status, tried, memory, calls[1:]


def test_a_step_that_is_taken(monkeypatch):
    status, tried, memory, calls = one_step(monkeypatch)
    assert (status, tried) == (77, [0.4]) and calls == ["end_step 0.4 7", "put_angles 0.4"]
    counts = memory.run.equations.system.counts
    assert (counts.rejected, counts.crossings) == (0, 5)
    _, _, memory, _ = one_step(monkeypatch, crossed=1)
    assert memory.run.equations.system.counts.crossings == 7


def test_a_motion_that_turns_back_needs_its_multipliers(monkeypatch):
    _, tried, _, calls = one_step(monkeypatch, turns=True)
    assert tried == [0.3] and calls[:2] == ["multipliers", "save_series"]


def test_a_regular_step_towards_a_rounding_pole_is_refused(monkeypatch):
    status, tried, memory, _ = one_step(monkeypatch, pole=0.2)
    assert (status, tried) == (SINGULAR_AHEAD, []) and memory.run.loop.clock.attempt_end == 2.4
    for pole, accurate in ((0.2, True), (0.4, False), (0.0, False), (-0.1, False)):
        assert one_step(monkeypatch, pole=pole, accurate=accurate)[0] == 77


def test_attempts_that_fail(monkeypatch):
    status, tried, memory, calls = one_step(monkeypatch, expand=[SINGULAR], judge=[STEP_TOO_SMALL])
    assert (status, tried) == (77, [0.4, 0.2, 0.1]) and calls[:2] == ["return", "return"]
    assert memory.run.equations.system.counts.rejected == 2
    status, tried, _, _ = one_step(monkeypatch, judge=[STEP_TOO_SMALL] * 9, smallest=0.1)
    assert (status, tried) == (STEP_TOO_SMALL, [0.4, 0.2, 0.1])
    status, tried, _, _ = one_step(monkeypatch, expand=[NOT_CONVERGED] * 9, smallest=0.3)
    assert (status, tried) == (NOT_CONVERGED, [0.4])


@pytest.mark.parametrize("judged", [SINGULAR_AHEAD, UNDECIDED])
def test_attempts_that_meet_a_singular_position(monkeypatch, judged):
    status, _, memory, _ = one_step(monkeypatch, judge=[judged])
    assert status == judged and memory.run.loop.clock.attempt_end == 2.4
    assert memory.step.time_to_crossing == pytest.approx(4.0)


def test_attempts_that_are_longer_than_a_regular_step(monkeypatch):
    """They have to cross; undecided ones are shortened."""
    longer = {"lengths": [(0.1, 0.4)]}
    assert one_step(monkeypatch, **longer)[1] == [0.4, 0.2, 0.1]
    assert one_step(monkeypatch, **longer, crossed=1)[1] == [0.4]
    status, tried, _, _ = one_step(monkeypatch, **longer, judge=[UNDECIDED])
    assert status == 77 and tried == [0.4, 0.2, 0.1]
    assert one_step(monkeypatch, **longer, judge=[UNDECIDED], crossed=1)[0] == UNDECIDED


@pytest.mark.parametrize(
    ("crossed", "pivot", "h", "used", "expected", "order"),
    [
        (1, 0.4, 0.5, 20, 1.0, 11),
        (0, 0.9, 0.5, 20, 1.0, 11),
        (0, 1.0, 0.5, 20, 0.3, 20),
        (1, 0.4, 0.3, 20, 0.7, 20),
        (1, 0.4, 0.5, 11, 0.3, 20),
    ],
)
def test_the_length_of_the_next_attempt(monkeypatch, crossed, pivot, h, used, expected, order):
    """Pivots relative to the fraction of the start's, lengths to OVERSHOOT times 0.8 s, 0.3 s and 0.3 s."""
    Patched(monkeypatch, stepping, least_pivot=pivot * stepping.MIN_PIVOT_RATIO * 2.0)
    Patched(monkeypatch, stepping, time_to_singular_position=0.8)
    asked: list[float] = []
    monkeypatch.setattr(stepping, "order_of_least_term", lambda h, memory: asked.append(h) or 11)
    step = SimpleNamespace(used_order=used, last_order=20, crossed=crossed, start_pivot=2.0)
    found = stepping.next_length(h, 0.3, SimpleNamespace(step=step))
    scale = {1.0: stepping.OVERSHOOT * 0.8, 0.3: 0.3, 0.7: 0.7 * 0.3}[expected]
    assert found == pytest.approx(scale) and step.used_order == order
    assert asked == ([pytest.approx(scale)] if order == 11 else [])


@pytest.mark.parametrize(
    ("accurate", "far", "size", "loose"),
    [(False, True, 1.0, 1.0), (False, False, 1.0, 1.0), (True, True, 1e24, 1e4), (True, False, 1e24, None)],
)
@pytest.mark.parametrize(("last", "orders"), [(6, (5, 6, 7)), (9, (8, 9))])
@pytest.mark.parametrize("speed", [3.0, 0.5])
def test_the_longest_step_by_its_terms_and_their_rates(
    monkeypatch, accurate, far, size, loose, last, orders, speed
):
    """Orders up to 9, of which one beyond the last is evaluated; the last one counts most.

    High-accuracy steps near a singular position have no limit of rates.
    """
    sizes = {k: size * 0.5**k for k in range(2, 10)} | {1: speed}
    memory = SimpleNamespace(
        step=SimpleNamespace(
            start_pivot=(1.0 if far else 0.99) * stepping.CROSSING_START * 2.0, last_order=last
        ),
        mode=SimpleNamespace(order=9),
        progress=SimpleNamespace(largest_pivot=2.0),
        run=SimpleNamespace(
            control=SimpleNamespace(largest_step=99.0, first_step=0.0),
            equations=SimpleNamespace(system=SimpleNamespace(counts=SimpleNamespace(steps=0))),
        ),
    )
    monkeypatch.setattr(stepping, "largest_used", lambda k, memory: sizes[k])
    Patched(monkeypatch, stepping, is_accurate=accurate, time_to_no_length=math.inf)
    of_terms = min((1e-8 / sizes[k]) ** (1 / k) for k in orders)
    rates = 1e-8 * max(1.0, speed)
    of_rates = min((rates * (loose or 1.0) / (k * sizes[k])) ** (1 / (k - 1)) for k in orders)
    expected = of_rates if loose else of_terms
    assert of_rates < 0.97 * of_terms and expected < 99.0
    assert stepping.longest_step(1e-8, memory) == pytest.approx(expected, rel=1e-12)


def test_the_longest_step_is_limited(monkeypatch):
    """By the options of a run, and where a spring has no length; terms that vanish allow any step."""
    counts, control = SimpleNamespace(steps=0), SimpleNamespace(largest_step=0.5, first_step=0.125)
    memory = SimpleNamespace(
        step=SimpleNamespace(start_pivot=0.0, last_order=6),
        mode=SimpleNamespace(order=9),
        progress=SimpleNamespace(largest_pivot=2.0),
        run=SimpleNamespace(
            control=control, equations=SimpleNamespace(system=SimpleNamespace(counts=counts))
        ),
    )
    Patched(monkeypatch, stepping, largest_used=0.0, is_accurate=False, time_to_no_length=9.0)
    assert stepping.longest_step(1e-8, memory) == 0.125
    for first, steps in ((0.0, 0), (0.125, 1), (0.75, 0)):
        control.first_step, counts.steps = first, steps
        assert stepping.longest_step(1e-8, memory) == pytest.approx(0.5)
    Patched(monkeypatch, stepping, time_to_no_length=0.2)
    assert stepping.longest_step(1e-8, memory) == pytest.approx(0.2 * stepping.OVERSHOOT)


def test_the_smallest_term_of_a_series(monkeypatch):
    sizes = {2: 4.0, 3: 2.0, 4: 8.0, 5: 1e-9}
    monkeypatch.setattr(stepping, "largest_used", lambda k, memory: sizes[k])
    memory = SimpleNamespace(step=SimpleNamespace(last_order=5))
    assert stepping.order_of_least_term(0.5, memory) == 3  # 1, 0.25, 0.5
    assert stepping.order_of_least_term(0.1, memory) == 4 and stepping.order_of_least_term(3.0, memory) == 2
    memory.step.last_order = 6
    assert stepping.order_of_least_term(0.5, memory) == 5


def test_the_end_of_a_step_and_its_samples(monkeypatch):
    kept: list[float] = []
    clock, counts = SimpleNamespace(time=2.0, sample=1, length=0.0), SimpleNamespace(steps=3)
    loop = SimpleNamespace(clock=clock, times=np.array([1.0, 2.25, 2.5, 3.0]))
    memory = SimpleNamespace(
        run=SimpleNamespace(loop=loop, equations=SimpleNamespace(system=SimpleNamespace(counts=counts))),
        progress=SimpleNamespace(end=3.0),
    )

    def keep(h: float, memory: Any) -> None:
        kept.append(h)
        clock.sample += 1

    monkeypatch.setattr(stepping, "keep_sample", keep)
    stepping.end_step(0.5, 3.0, memory)
    assert kept == [0.25, 0.5] and (clock.time, clock.length, counts.steps) == (2.5, 0.5, 4)
    stepping.end_step(0.7, 3.0, memory)
    assert kept[2:] == [0.5] and (clock.time, clock.length) == (3.0, 0.7) and clock.sample == 4
    clock.time = 2.5
    for h, stop, last in ((0.5, 3.0, True), (0.6, 3.0, True), (0.4, 3.0, False), (0.5, 2.9, False)):
        assert stepping.is_last(h, stop, memory) is last
    memory.kernels = SimpleNamespace(expand=lambda t, memory: ("expanded", t))
    assert stepping.begin_pieces(2.5, memory) == ("expanded", 2.5)
    assert stepping.begin_pieces(2.6, memory) == OK
    memory.progress.end = 2.5
    assert stepping.begin_pieces(2.5, memory) == OK


def test_the_error_of_accelerations(monkeypatch):
    """The second order of the new series is half of an acceleration."""
    memory = SimpleNamespace(
        state=np.array([[0.0] * 3, [0.0] * 3, [1.0, -8.0, 99.0]]),
        series=SimpleNamespace(terms=np.array([[0.0] * 3, [0.0] * 3, [0.75, -4.5, 0.0]])),
        solver=SimpleNamespace(pivot_columns=np.zeros(2)),
    )
    assert stepping.error_of_motion(0.5, memory) == (0.25, 2.0)
    assert stepping.error_of_motion(0.25, memory) == (0.0625, 1.0)


# --- short crossings --------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("switched", "before", "crossings", "pair"),
    [
        ((4,), 2, 4, True),
        ((3,), 2, 4, True),
        ((5,), 2, 4, False),
        ((3,), 2, 3, False),
        ((2,), 2, 4, False),
        ((4,), 2, 5, True),
    ],
)
def test_branches_that_are_requested_at_two_crossings_of_a_step(switched, before, crossings, pair):
    system = SimpleNamespace(counts=SimpleNamespace(crossings=crossings))
    memory = SimpleNamespace(
        branch_switches=np.array(switched), run=SimpleNamespace(equations=SimpleNamespace(system=system))
    )
    assert short_crossing.switches_branch_in_pair(before, memory) is pair
    assert short_crossing.switches_branch(switched[0], memory)
    assert not short_crossing.switches_branch(switched[0] + 9, memory)


@pytest.mark.parametrize(("recorded", "full"), [(0, False), (2, False), (3, True)])
def test_room_for_two_more_crossings(recorded, full):
    memory = SimpleNamespace(
        progress=SimpleNamespace(recorded=recorded), crossings=SimpleNamespace(time=np.zeros(4))
    )
    assert short_crossing.is_full(memory) is full


@pytest.mark.parametrize(
    ("free", "undriven", "full", "status", "time", "judged", "steps", "crosses"),
    [
        (1, True, False, OK, 1.0, None, True, True),
        (2, True, False, OK, 1.0, None, True, None),
        (1, False, False, OK, 1.0, None, True, None),
        (0, False, False, OK, 1.0, None, True, True),
        (1, True, True, OK, 1.0, None, True, None),
        (1, True, False, SINGULAR, 1.0, None, True, False),
        (1, True, False, OK, 1.0, None, False, False),
        (1, True, False, OK, 0.0, UNDECIDED, True, False),
        (1, True, False, SINGULAR, 0.0, OK, True, True),
    ],
)
def test_short_crossings_that_are_tried(
    monkeypatch, free, undriven, full, status, time, judged, steps, crosses
):
    """None where a crossing is not tried; a crossing that fails leaves clock and counts as they were."""
    clock = SimpleNamespace(time=time, sample=3, attempt_end=2.5)
    counts = SimpleNamespace(steps=7, crossings=1)
    memory = SimpleNamespace(
        run=SimpleNamespace(
            loop=SimpleNamespace(clock=clock),
            equations=SimpleNamespace(system=SimpleNamespace(counts=counts)),
        ),
        series=SimpleNamespace(past="past"),
        angles="angles",
        step_start="start",
        step=SimpleNamespace(start_pivot=0.3),
        kernels=SimpleNamespace(
            return_to_start=lambda memory: events.append("return"),
            expand=lambda t, memory: events.append(("expand", t)) or status,
            judge_start=lambda found, memory: events.append(("judge", found)) or judged,
        ),
    )
    events: list[Any] = []

    def take(memory: Any) -> bool:
        clock.time, clock.sample, clock.attempt_end, counts.steps, counts.crossings = 9.0, 9, 9.0, 9, 9
        return steps

    Patched(monkeypatch, short_crossing, freedoms=free, is_undriven=undriven, is_full=full)
    for name in ("put_angles", "save_variables", "set_high_accuracy", "set_regular", "restore_step_start"):
        monkeypatch.setattr(
            short_crossing, name, lambda *given, name=name: events.append((name, *given[:-1])) or None
        )
    monkeypatch.setattr(short_crossing, "take_crossing_steps", take)
    assert short_crossing.cross_briefly(memory) is bool(crosses)
    if crosses is None:
        assert events == []
        return
    begins = [("put_angles", 0.0), ("save_variables", "past", "angles"), "return", ("set_high_accuracy",)]
    assert events[:5] == [*begins, ("expand", time)] and memory.step.start_pivot == 1.0
    assert (("judge", status) in events) == (time == 0.0) and ("set_regular",) in events
    assert (("restore_step_start",) in events) is not crosses
    left = clock.time, clock.sample, clock.attempt_end, counts.steps, counts.crossings
    assert left == ((9.0, 9, 9.0, 9, 9) if crosses else (time, 3, 2.5, 7, 1))


def crossing_steps(monkeypatch: pytest.MonkeyPatch, **changes: Any) -> tuple[bool, Any, list[Any]]:
    """Steps of 0.5 s from 1 s, the second of which crosses; energies 4 before, 2 in it and 1 after."""
    given: dict[str, Any] = {"free": 1, "statuses": [], "end": 9.0, "bounded": True, "pair": False, **changes}
    clock, counts = SimpleNamespace(time=1.0, length=0.5), SimpleNamespace(crossings=3, steps=0)
    delays: list[Any] = []
    energies = iter(given.get("energies", [4.0, 4.0, 4.0, 2.0, 1.0]))

    def step(memory: Any) -> int:
        counts.steps += 1
        clock.time += 0.5
        counts.crossings += counts.steps == given.get("crosses", 2)
        return given["statuses"].pop(0) if given["statuses"] else OK

    memory = SimpleNamespace(
        run=SimpleNamespace(
            loop=SimpleNamespace(clock=clock),
            equations=SimpleNamespace(system=SimpleNamespace(counts=counts)),
        ),
        progress=SimpleNamespace(end=given["end"], entry_pivot=0.0, leaving=5),
        series=SimpleNamespace(terms="terms"),
        kernels=SimpleNamespace(step=step, record=lambda memory: delays.append("recorded")),
    )
    Patched(monkeypatch, short_crossing, freedoms=given["free"], least_pivot=0.125)
    monkeypatch.setattr(
        short_crossing, "kinetic_energy", lambda terms, memory: next(energies) if terms == "terms" else None
    )
    monkeypatch.setattr(short_crossing, "energy_in_middle", lambda memory: next(energies))
    monkeypatch.setattr(
        short_crossing,
        "keeps_moving",
        lambda least, first, memory: delays.append((least, first)) or given.get("moves", True),
    )
    monkeypatch.setattr(
        short_crossing, "is_bounded", lambda delay, memory: delays.append(delay) or given["bounded"]
    )
    monkeypatch.setattr(
        short_crossing, "switches_branch_in_pair", lambda before, memory: given["pair"] and before == 3
    )
    return short_crossing.take_crossing_steps(memory), memory, delays


def test_steps_of_a_short_crossing(monkeypatch):
    """The integral of v₀² / v² by Simpson's rule: 0.5 (1 + 4 + 1) / 6 + 0.5 (1 + 4 · 2 + 4) / 6."""
    crossed, memory, delays = crossing_steps(monkeypatch)
    assert crossed and memory.progress.leaving and memory.progress.entry_pivot == 0.125
    assert delays == [(4.0, 4.0), (1.0, 4.0), pytest.approx(0.5 + 0.5 * 13 / 6), "recorded"]
    crossed, memory, delays = crossing_steps(monkeypatch, bounded=False)
    assert not crossed and not memory.progress.leaving and delays[-1] != "recorded"
    assert not crossing_steps(monkeypatch, pair=True)[0]
    crossed, _, delays = crossing_steps(monkeypatch, free=0, bounded=False)
    assert crossed and delays == ["recorded"], "drivers determine the motion"
    assert not crossing_steps(monkeypatch, moves=False)[0]
    assert not crossing_steps(monkeypatch, statuses=[OK, STEP_TOO_SMALL])[0]
    assert not crossing_steps(monkeypatch, end=1.5)[0] and crossing_steps(monkeypatch, end=1.6)[0]
    assert not crossing_steps(monkeypatch, crosses=99, energies=[1.0] * 99)[0]


# --- perturbed runs ---------------------------------------------------------------------------------------
def perturbed(monkeypatch: pytest.MonkeyPatch, places: float, rates: float, **changes: Any) -> bool:
    """A perturbed run that ends so far from the run, in an entry that counts; the largest rate is 3."""
    given: dict[str, Any] = {"rtol": 1e-5, "reaches": True, "more": 0, **changes}
    counts = SimpleNamespace(crossings=4)
    run = SimpleNamespace(
        loop=SimpleNamespace(clock=SimpleNamespace(time=2.5)),
        equations=SimpleNamespace(system=SimpleNamespace(counts=counts)),
    )
    terms = np.array([[1.0, 0.0, 0.0], [0.0, 3.0, 0.0]])
    memory = SimpleNamespace(
        run=run,
        crossing_end=np.zeros((2, 3)),
        series=SimpleNamespace(terms=terms),
        solver=SimpleNamespace(pivot_columns=np.zeros(2)),
    )

    def again(change: float, until: float, memory: Any) -> bool:
        assert change == max(given["rtol"], uniqueness.MIN_CHANGE) and until == 2.5
        terms[0, 1] -= places
        terms[1, 0] += rates
        terms[:, 2] += 99.0
        counts.crossings += given["more"]
        return given["reaches"]

    monkeypatch.setattr(uniqueness, "run_perturbed", again)
    monkeypatch.setattr(
        uniqueness, "largest_coefficient", lambda end, order, count: np.abs(end[order, :count]).max()
    )
    return bool(uniqueness.perturbed_run_agrees(given["rtol"], memory))


def test_perturbed_runs_that_agree(monkeypatch):
    near = min(uniqueness.MAX_GAIN * 1e-5, uniqueness.MAX_APART)
    of_rates = uniqueness.RATE_FACTOR * near * 3.0
    assert perturbed(monkeypatch, near, of_rates)
    assert not perturbed(monkeypatch, 1.01 * near, 0.0) and not perturbed(monkeypatch, 0.0, 1.01 * of_rates)
    assert not perturbed(monkeypatch, 0.0, 0.0, reaches=False)
    strict = uniqueness.STRICTER
    assert perturbed(monkeypatch, 0.99 * strict * near, 0.99 * strict * of_rates, more=1)
    assert not perturbed(monkeypatch, 1.01 * strict * near, 0.0, more=1)
    assert perturbed(monkeypatch, uniqueness.MAX_APART, 0.0, rtol=1.0)
    assert not perturbed(monkeypatch, 1.01 * uniqueness.MAX_APART, 0.0, rtol=1.0)
    least = uniqueness.MAX_GAIN * uniqueness.MIN_CHANGE
    assert perturbed(monkeypatch, 0.99 * least, 0.0, rtol=1e-15)
    assert not perturbed(monkeypatch, 1.01 * least, 0.0, rtol=1e-15)


@pytest.mark.parametrize(
    ("begin", "statuses", "most", "steps", "reaches"),
    [
        (OK, [], 99, 3, True),
        (SINGULAR, [], 99, 0, False),
        (OK, [OK, SINGULAR], 99, 2, False),
        (OK, [], 2, 2, False),
        (OK, [], 3, 3, True),
    ],
)
def test_a_perturbed_run_begins_with_larger_velocities(monkeypatch, begin, statuses, most, steps, reaches):
    """Steps of 0.5 s from 1 s to 2.5 s."""
    clock, counts, left = SimpleNamespace(time=1.0, sample=0), SimpleNamespace(steps=0), list(statuses)
    run = SimpleNamespace(
        loop=SimpleNamespace(clock=clock, times=np.zeros(7)),
        equations=SimpleNamespace(system=SimpleNamespace(counts=counts)),
        state=SimpleNamespace(velocities=np.array([2.0, -4.0])),
        control=SimpleNamespace(most_steps=most),
    )

    def step(memory: Any) -> int:
        counts.steps += 1
        clock.time += 0.5
        return left.pop(0) if left else OK

    memory = SimpleNamespace(
        run=run,
        crossing_start="start",
        progress=SimpleNamespace(end=0.0),
        kernels=SimpleNamespace(begin=lambda memory: begin, step=step),
    )
    restored: list[Any] = []
    monkeypatch.setattr(uniqueness, "restore_state", lambda saved, run: restored.append(saved))
    assert bool(uniqueness.run_perturbed(0.25, 2.5, memory)) is reaches
    assert run.state.velocities.tolist() == [2.5, -5.0] and restored == ["start"]
    assert clock.sample == 7 and memory.progress.end == 2.5 and counts.steps == steps


# --- long crossings ---------------------------------------------------------------------------------------
def test_a_long_crossing_begins_with_accurate_steps_of_lower_order(monkeypatch):
    saved: list[Any] = []
    monkeypatch.setattr(long_crossing, "set_high_accuracy", lambda memory: saved.append("accurate"))
    monkeypatch.setattr(long_crossing, "save_state", lambda run, target: saved.append((run, target)))
    for order, expected in ((30, long_crossing.LONG_CROSSING_ORDER), (4, 4)):
        memory = SimpleNamespace(
            mode=SimpleNamespace(order=order),
            step=SimpleNamespace(start_pivot=0.25),
            progress=SimpleNamespace(clearance=5.0, is_clear=1),
            run="run",
            crossing_start="start",
        )
        saved.clear()
        assert long_crossing.begin_crossing.function(memory) == OK
        assert memory.mode.order == expected and memory.step.start_pivot == 1.0
        assert (memory.progress.clearance, memory.progress.is_clear) == (0.0, 0)
        assert saved == ["accurate", ("run", "start")]


@pytest.mark.parametrize(("status", "expected"), [(OK, PAUSED), (SINGULAR, SINGULAR)])
def test_the_first_position_ahead_is_crossed(monkeypatch, status, expected):
    begun: list[str] = []
    memory = SimpleNamespace(
        kernels=SimpleNamespace(begin=lambda memory: status), progress=SimpleNamespace(entry_pivot=0.0)
    )
    monkeypatch.setattr(long_crossing, "start_crossing", lambda memory: begun.append("start"))
    monkeypatch.setattr(long_crossing, "step_until_clear", lambda memory: PAUSED)
    Patched(monkeypatch, long_crossing, least_pivot=0.0625)
    assert long_crossing.cross_position.function(memory) == expected and begun == ["start"]
    assert memory.progress.entry_pivot == 0.0625
    assert long_crossing.continue_crossing.function(memory) == PAUSED


def test_a_step_of_a_crossing_that_fails(monkeypatch):
    put: list[Any] = []
    counts = SimpleNamespace(steps=0, crossings=0)
    memory = SimpleNamespace(
        run=SimpleNamespace(
            loop=SimpleNamespace(clock=SimpleNamespace(time=1.0)),
            equations=SimpleNamespace(system=SimpleNamespace(counts=counts)),
            control=SimpleNamespace(most_steps=3),
        ),
        progress=SimpleNamespace(end=1.0, is_clear=0),
        series=SimpleNamespace(past="past", terms="terms"),
        kernels=SimpleNamespace(step=lambda memory: STEP_TOO_SMALL, record=lambda memory: None),
    )
    monkeypatch.setattr(long_crossing, "put_terms", lambda series, memory: put.append(series))
    monkeypatch.setattr(long_crossing, "judge_clearance", lambda memory: put.append("clear"))
    assert long_crossing.step_until_clear(memory) == STEP_TOO_SMALL and put == ["past"]
    memory.kernels.step = lambda memory: OK
    assert long_crossing.step_until_clear(memory) == DONE and put == ["past", "terms"]
    memory.progress.end, memory.progress.is_clear = 1.5, 1
    assert long_crossing.step_until_clear(memory) == PAUSED and put[2:] == ["terms", "clear"]
    monkeypatch.setattr(long_crossing, "save_series", lambda memory: put.append("saved"))
    monkeypatch.setattr(long_crossing, "put_state_at", lambda h, memory: put.append(h))
    assert long_crossing.put_state_along.function(0.25, memory) == OK and put[4:] == ["saved", 0.25]


# --- detection --------------------------------------------------------------------------------------------
def test_the_time_to_a_singular_position(monkeypatch):
    """A pivot of 3 that falls to 1 in 0.5 s vanishes at 0.75 s; across, at 0.375 s."""
    Patched(monkeypatch, detection, least_pivot=1.0)
    memory = SimpleNamespace(step=SimpleNamespace(start_pivot=3.0, crossed=0))
    assert detection.time_to_singular_position(0.5, memory) == pytest.approx(0.75)
    memory.step.crossed = 1
    assert detection.time_to_singular_position(0.5, memory) == pytest.approx(0.375)


@pytest.mark.parametrize(
    ("chosen", "last", "replaced", "keeps", "changes"),
    [
        (4, [1.0, -2.0], 0.5, True, False),
        (4, [1.0, 2.0], 0.5, False, True),
        (4, [0.0, -2.0], 0.5, False, True),
        (5, [1.0, -2.0], 0.5, False, False),
        (5, [1.0, -2.0], -math.inf, False, True),
        (5, [1.0, -2.0], 0.0, False, False),
    ],
)
def test_signs_of_pivots_at_both_ends_of_a_step(monkeypatch, chosen, last, replaced, keeps, changes):
    memory = SimpleNamespace(
        solver=SimpleNamespace(last=np.array([*last, 9.0]), past=np.array([3.0, -4.0, -9.0])),
        partition=SimpleNamespace(partition_id=chosen, rank=2),
        step=SimpleNamespace(start_partition_id=4),
    )
    Patched(monkeypatch, detection, replaced_pivot=replaced)
    assert detection.keeps_signs(memory) is keeps and bool(detection.changes_signs(memory)) is changes


@pytest.mark.parametrize(
    ("before", "pivot", "crossed", "leaving", "approaching", "leaves"),
    [
        (0.5, 0.4, 0, 1, True, True),
        (0.4, 0.4, 0, 1, True, True),
        (0.3, 0.4, 0, 1, False, True),
        (0.5, 0.4, 1, 1, False, True),
        (0.5, 0.4, 0, 0, True, False),
        (0.5, 9.0, 0, 1, False, False),
    ],
)
def test_pivots_that_fall_towards_a_singular_position(
    monkeypatch, before, pivot, crossed, leaving, approaching, leaves
):
    memory = SimpleNamespace(
        step=SimpleNamespace(start_pivot=before, crossed=crossed, approaching=None),
        progress=SimpleNamespace(leaving=leaving, largest_pivot=0.8 / detection.PIVOT_AHEAD),
    )
    monkeypatch.setattr(
        detection, "save_start_pivots", lambda memory: setattr(memory.step, "start_pivot", pivot)
    )
    detection.save_pivots(memory)
    assert bool(memory.step.approaching) is approaching and bool(memory.progress.leaving) is leaves


@pytest.mark.parametrize(
    ("pivot", "leaving", "start_pivot", "ends"),
    [(0.99, 0, 0.5, True), (1.0, 0, 0.5, False), (0.99, 1, 0.5, False), (0.99, 1, 0.99, True)],
)
def test_a_step_that_ends_near_a_singular_position(pivot, leaving, start_pivot, ends):
    scale = detection.PIVOT_AHEAD * 2.0
    memory = SimpleNamespace(
        progress=SimpleNamespace(leaving=leaving, largest_pivot=2.0),
        step=SimpleNamespace(start_pivot=start_pivot * scale),
    )
    assert detection.ends_near_singular(pivot * scale, memory) is ends


def contains(monkeypatch: pytest.MonkeyPatch, **changes: Any) -> bool:
    """Whether a step with pivots of 0.3 and 0.2 at its ends that moves far contains a singular position."""
    given: dict[str, Any] = {
        "moved": 1e3,
        "keeps": False,
        "replaced": -math.inf,
        "sign": False,
        "changes": False,
        "inside": False,
        "near": True,
        "kind": REGULAR,
        "turns": False,
        "dips": True,
        **changes,
    }
    memory = SimpleNamespace(
        step=SimpleNamespace(start_pivot=0.3),
        mode=SimpleNamespace(kind=given["kind"]),
        series=SimpleNamespace(terms="terms"),
    )
    parts: list[int] = []
    monkeypatch.setattr(
        detection,
        "determinant_changes_sign",
        lambda h, count, memory: parts.append(count) or given["sign"],
    )
    made = Patched(
        monkeypatch,
        detection,
        distance_moved=given["moved"],
        keeps_signs=given["keeps"],
        replaced_pivot=given["replaced"],
        changes_signs=given["changes"],
        vanishes_inside=given["inside"],
        is_near_singular=given["near"],
        turns_back=given["turns"],
        dips_to_zero=given["dips"],
    )
    found = detection.contains_singular_position.function(0.5, 0.2, memory)
    expected = min(int(given["moved"] / detection.PART_LENGTH) + 1, detection.MAX_PARTS)
    assert parts in ([], [expected])
    wanted = {
        **dict.fromkeys(("distance_moved", "vanishes_inside"), (0.5, memory)),
        **dict.fromkeys(("keeps_signs", "replaced_pivot", "changes_signs"), (memory,)),
        **{
            "is_near_singular": (0.2, memory),
            "dips_to_zero": (0.5, 0.2, memory),
            "turns_back": ("terms", memory),
        },
    }
    assert all(arguments == wanted[name] for name, arguments in made.given.items())
    return bool(found)


def test_steps_that_contain_a_singular_position(monkeypatch):
    monkeypatch.setattr(detection, "PIVOT_SLOPE", 0.25)
    assert contains(monkeypatch, moved=2.0, keeps=True, sign=True), "0.3 + 0.2 is not more than 0.25 · 2"
    assert contains(monkeypatch, moved=2.0, replaced=0.2, sign=True)
    short = {"moved": 1.96}
    longer = {"moved": 2.04}
    assert contains(monkeypatch) and not contains(monkeypatch, dips=False)
    assert not contains(monkeypatch, **short, keeps=True, sign=True)
    assert contains(monkeypatch, **longer, keeps=True, sign=True)
    assert contains(monkeypatch, **short, sign=True) and not contains(monkeypatch, **short)
    assert not contains(monkeypatch, replaced=1e4 * detection.PIVOT_SLOPE, sign=True)
    assert contains(monkeypatch, changes=True, inside=True, dips=False)
    assert not contains(monkeypatch, changes=False, inside=True, dips=False)
    assert not contains(monkeypatch, changes=True, inside=False, dips=False)
    assert not contains(monkeypatch, keeps=True, near=False) and contains(monkeypatch, keeps=True, near=True)
    assert contains(monkeypatch, keeps=False, near=False)
    assert not contains(monkeypatch, turns=True) and contains(monkeypatch, turns=True, kind=PREDICTOR)


def parabola(
    monkeypatch: pytest.MonkeyPatch, module: Any, lowest: float, negative: float = -1.0
) -> list[float]:
    """A logarithm of the determinant with a minimum at a time; NEGATIVE nearer than a distance."""
    asked: list[float] = []

    def logarithm(t: float, memory: Any) -> float:
        asked.append(t)
        return location.NEGATIVE if abs(t - lowest) < negative else (t - lowest) ** 2

    monkeypatch.setattr(module, "logarithm_at", logarithm)
    return asked


def test_the_logarithm_of_a_negative_determinant(monkeypatch):
    """It is less than every other one; the golden section is (√5 - 1) / 2."""
    assert pytest.approx((math.sqrt(5.0) - 1.0) / 2.0, rel=1e-15) == location.GOLDEN
    made, times = SimpleNamespace(state="state", kernels=SimpleNamespace()), []
    monkeypatch.setattr(location, "evaluate_series", lambda h, memory: times.append((h, memory)))
    for negative, expected in ((False, 0.25), (True, -1e300)):
        made.kernels.determinant = lambda y, memory, negative=negative: (
            (negative, 0.25) if (y, memory) == ("state", made) else None
        )
        assert location.logarithm_at(0.5, made) == expected
        at = location.value_at(0.5, 0.75, made)
        assert at == pytest.approx((-1.0 if negative else 1.0) * math.exp(-0.5))
    assert times == [(0.5, made)] * 4


def test_the_smallest_determinant_by_golden_section(monkeypatch):
    for lowest in (0.7, 1.9):
        parabola(monkeypatch, location, lowest)
        assert location.time_of_minimum(2.0, 40, None) == pytest.approx(lowest, abs=1e-6)
        asked = parabola(monkeypatch, location, lowest)
        location.time_of_minimum(2.0, 3, None)
        assert len(asked) == 5 and asked[:2] == pytest.approx(
            [2 * (1 - location.GOLDEN), 2 * location.GOLDEN]
        )
    for lowest, expected in ((0.8, 2 * (1 - location.GOLDEN)), (1.2, 2 * location.GOLDEN)):
        parabola(monkeypatch, location, lowest, 0.05)
        assert location.time_of_minimum(2.0, 40, None) == pytest.approx(expected)


# --- pivots -----------------------------------------------------------------------------------------------
def test_numbers_of_a_partition():
    solver = SimpleNamespace(
        last=np.array([0.5, -0.25, 9.0]),
        past=np.zeros(3),
        pivot_columns=np.zeros(3, dtype=int),
        null_space=np.array([[1.0, 2.0, 3.0, 4.0], [5.0] * 4]),
        past_motion=np.zeros(3),
    )
    memory = SimpleNamespace(
        solver=solver,
        partition=SimpleNamespace(rank=2, partition_id=6, parity=1, replaced_pivot=0.125),
        step=SimpleNamespace(start_partition_id=5, start_parity=0, start_pivot=0.0),
        progress=SimpleNamespace(largest_pivot=0.2),
        run=SimpleNamespace(equations=SimpleNamespace(piece=np.zeros(0))),
    )
    assert partition.freedoms(memory) == 1 and partition.is_undriven(memory)
    assert partition.least_pivot(memory) == 0.25 and partition.replaced_pivot(memory) == 0.125
    memory.partition.partition_id = 7
    assert partition.replaced_pivot(memory) == -math.inf
    solver.past[:] = [1.0, -1.0, -1.0]
    partition.save_replaced_pivot(memory)
    assert memory.partition.replaced_pivot == 0.25
    solver.past[0] = -1.0
    partition.save_replaced_pivot(memory)
    assert memory.partition.replaced_pivot == -math.inf
    partition.save_start_pivots(memory)
    assert solver.past.tolist() == solver.last.tolist() and solver.past_motion.tolist() == [1.0, 2.0, 3.0]
    assert (memory.step.start_partition_id, memory.step.start_parity, memory.step.start_pivot) == (7, 1, 0.25)
    assert memory.progress.largest_pivot == 0.25
    memory.progress.largest_pivot = 0.75
    partition.save_start_pivots(memory)
    assert memory.progress.largest_pivot == 0.75
    memory.partition.rank, memory.run.equations.piece = 0, np.zeros(2)
    assert partition.least_pivot(memory) == 1.0 and not partition.is_undriven(memory)
    work = np.array([[2.0, 4.0, 6.0], [1.0, 1.0, 1.0], [0.0, 5.0, 7.0]])
    partition.eliminate_below(work, np.array([1, 0, 2]), np.array([2, 0, 1]), 0)
    assert work.tolist() == [[-4.0, -2.0, 0.0], [1.0, 1.0, 1.0], [-7.0, -2.0, 0.0]]


# --- samples ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("completed", "go_on", "status", "events"),
    [
        (4, True, OK, []),
        (5, True, OK, []),
        (2, True, OK, ["state", "variables", ("until", 4), "restored", "series"]),
        (2, False, OK, ["state", "variables", ("until", 4), "restored"]),
        (2, True, SINGULAR, ["state", "variables", ("until", 4)]),
    ],
)
def test_samples_are_completed_and_the_run_goes_on(monkeypatch, completed, go_on, status, events):
    found: list[Any] = []
    memory = SimpleNamespace(
        run=SimpleNamespace(loop=SimpleNamespace(clock=SimpleNamespace(sample=4))),
        progress=SimpleNamespace(completed=completed),
        before_samples="before",
        series=SimpleNamespace(terms="terms"),
        angles="angles",
        series_start="start",
    )
    module = sample_completion
    monkeypatch.setattr(module, "save_state", lambda run, target: found.append("state"))
    monkeypatch.setattr(module, "save_variables", lambda *given: found.append("variables"))
    monkeypatch.setattr(module, "complete_until", lambda end, memory: found.append(("until", end)) or status)
    monkeypatch.setattr(module, "restore_state", lambda source, run: found.append("restored"))
    monkeypatch.setattr(module, "return_to_series", lambda memory: found.append("series"))
    assert module.complete_samples.function(go_on, memory) == (OK if completed >= 4 else status)
    assert found == events


def test_samples_are_expanded_to_second_order(monkeypatch):
    """The second of three samples fails."""
    clock, seen = SimpleNamespace(sample=9, time=0.0), []

    def sample(memory: Any) -> int:
        seen.append((clock.sample, clock.time, mode.order, mode.tolerance))
        clock.sample += len(seen) < 2
        return OK if len(seen) < 2 else SINGULAR

    mode = SimpleNamespace(order=20, tolerance=1e-9)
    memory = SimpleNamespace(
        run=SimpleNamespace(
            loop=SimpleNamespace(clock=clock, times=np.array([0.0, 0.5, 1.5, 2.0])), equations=None
        ),
        progress=SimpleNamespace(completed=1),
        mode=mode,
        options=SimpleNamespace(accurate_tolerance=1e-13),
        kernels=SimpleNamespace(sample=sample),
    )
    pieces: list[float] = []
    monkeypatch.setattr(sample_completion, "select_pieces", lambda t, equations: pieces.append(t))
    assert sample_completion.complete_until(4, memory) == SINGULAR
    assert seen == [(1, 0.5, 2, 1e-13), (2, 1.5, 2, 1e-13)] and memory.progress.completed == 2
    assert (mode.order, mode.tolerance) == (20, 1e-9) and pieces == [0.5, 1.5]


def test_multipliers_balance_the_forces(monkeypatch):
    """Forces of 6 and 8 N on masses of 2 and 3 kg with accelerations of 1 and -2 m/s²."""
    system = SimpleNamespace(
        counts=SimpleNamespace(evaluations=4),
        force=np.array([6.0, 8.0]),
        mass=np.array([2.0, 3.0]),
        acceleration=np.array([1.0, -2.0]),
        blocks=np.ones((1, 4)),
        multipliers="multipliers",
    )
    equations = SimpleNamespace(system=system, scene=SimpleNamespace(metric_root="root"))
    state = SimpleNamespace(coordinates="q", velocities="v")
    memory = SimpleNamespace(run=SimpleNamespace(equations=equations, factor="factor", state=state))
    found: list[Any] = []
    module = sample_completion
    monkeypatch.setattr(module, "evaluate", lambda *given: found.append(given))
    monkeypatch.setattr(
        module,
        "regularised_factor",
        lambda factor, blocks, root, alpha: (
            (factor, blocks.shape, root) == ("factor", (4,), "root") and positive
        ),
    )
    monkeypatch.setattr(
        module, "find_least_multipliers", lambda factor, force, into: found.append((force.tolist(), into))
    )
    positive = True
    assert module.balance_forces.function(0.5, memory) == OK and system.counts.evaluations == 5
    assert found == [(0.5, "q", "v", equations), ([4.0, 14.0], "multipliers")]
    positive = False
    assert module.balance_forces.function(0.5, memory) == SINGULAR
