"""Decisions of steps that follow drivers, run interpreted by ``test_thresholds.py``."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from mbref.kernels.compilation import PLAIN
from mbref.kernels.layout import NOT_CONVERGED, OK, SINGULAR_AHEAD
from mbref.stepping.loop import DONE, PAUSED, STEP_TOO_SMALL, TOO_MANY_STEPS, UNDECIDED
from mbref.taylor import driven

pytestmark = pytest.mark.skipif(not PLAIN, reason="kernels are interpreted by test_thresholds.py")


class Stubs:
    """Functions of ``driven`` in place of the real ones, whose calls are noted."""

    def __init__(self, patch: pytest.MonkeyPatch, **values: object) -> None:
        self.calls: list[tuple[Any, ...]] = []
        for name, value in values.items():
            patch.setattr(driven, name, self.stub(name, value))

    def stub(self, name: str, value: Any) -> Any:
        answers = iter(value) if isinstance(value, list) else None

        def call(*arguments: Any) -> Any:
            assert isinstance(arguments[-1], SimpleNamespace), f"memory is the last argument of {name}"
            self.calls.append((name, *arguments[:-1]))
            return value if answers is None else next(answers)

        return call


def series(**numbers: Any) -> Any:
    """Memory of a run at 0.2 s that ends at 1 s; the pivot is 0.4 at the start of a step."""
    step = {"start_pivot": 0.4, "crossed": 0, "violation": 0.0, "time_to_crossing": 0.0, "used_order": 0}
    return SimpleNamespace(
        step=SimpleNamespace(**{**step, **numbers}),
        progress=SimpleNamespace(largest_pivot=0.5, end=1.0, entry_pivot=0.0, recorded=0),
        mode=SimpleNamespace(order=8, tolerance=1e-9),
        options=SimpleNamespace(accurate_order=16),
        kernels=SimpleNamespace(),
        run=SimpleNamespace(
            loop=SimpleNamespace(clock=SimpleNamespace(time=0.2, length=0.1)),
            control=SimpleNamespace(
                smallest_step=0.01, largest_step=10.0, first_step=0.0, steps_per_call=3, most_steps=10
            ),
            equations=SimpleNamespace(system=SimpleNamespace(counts=SimpleNamespace(steps=4, rejected=0))),
        ),
    )


COMMON = {"save_start": None, "end_of_step": 1.0, "end_step": None, "begin_pieces": OK, "is_last": False}


def take(monkeypatch: pytest.MonkeyPatch, memory: Any, **values: object) -> tuple[int, list[tuple[Any, ...]]]:
    stubs = Stubs(monkeypatch, **{**COMMON, "least_pivot": 0.3, "start_accurate_steps": "accurate", **values})
    memory.kernels.return_to_start = lambda memory: stubs.calls.append(("return",))
    return driven.take_predictor_step(memory), stubs.calls


def test_a_predictor_step_is_as_long_as_the_series_allows(monkeypatch):
    memory = series()
    status, calls = take(monkeypatch, memory, longest_predictor_step=0.3, attempt_predictor_step=OK)
    assert status == OK and calls[-4:] == [
        ("is_last", 0.3, 1.0),
        ("attempt_predictor_step", 0.3, False),
        ("end_step", 0.3, 1.0),
        ("begin_pieces", 1.0),
    ]
    _, calls = take(
        monkeypatch, series(start_pivot=0.3), longest_predictor_step=5.0, attempt_predictor_step=OK
    )
    assert ("is_last", pytest.approx(0.8), 1.0) in calls, "what is left of the run"


def test_a_step_to_where_the_pivots_vanish_is_accurate(monkeypatch):
    """They fall by 1 / s: a step of more than 0.4 s comes to zero."""
    for h, expected in ((0.39, "taken"), (0.41, "accurate")):
        status, calls = take(
            monkeypatch, series(), longest_predictor_step=h, attempt_predictor_step=OK, begin_pieces="taken"
        )
        assert status == expected
    assert calls[-1][0] == "start_accurate_steps" and calls[-1][1:] == (pytest.approx(0.4), 1.0)


def test_a_refused_step_is_shortened_until_the_shortest(monkeypatch):
    memory = series()
    status, calls = take(
        monkeypatch,
        memory,
        longest_predictor_step=0.3,
        attempt_predictor_step=[NOT_CONVERGED, STEP_TOO_SMALL, OK],
    )
    tried = [call[1] for call in calls if call[0] == "attempt_predictor_step"]
    assert status == OK and memory.run.equations.system.counts.rejected == 2
    assert tried == pytest.approx([0.3, 0.3 * 0.7, 0.3 * 0.7**2])
    assert calls.count(("return",)) == 2
    memory.run.control.smallest_step = 0.3
    status, calls = take(
        monkeypatch, memory, longest_predictor_step=0.3, attempt_predictor_step=NOT_CONVERGED
    )
    assert status == NOT_CONVERGED and calls[-1] == ("return",)


def test_a_step_into_a_singular_position_starts_accurate_steps(monkeypatch):
    status, calls = take(
        monkeypatch,
        series(),
        longest_predictor_step=0.3,
        attempt_predictor_step=SINGULAR_AHEAD,
        time_to_singular_position=0.25,
    )
    assert status == "accurate" and calls[-2:] == [
        ("time_to_singular_position", 0.3),
        ("start_accurate_steps", 0.25, 1.0),
    ]


@pytest.mark.parametrize(
    ("near", "first", "steps", "sizes", "h", "order"),
    [
        (False, 0.0, 4, {7: 1e-7, 8: 1e-8}, None, 8),
        (False, 0.02, 0, {7: 1e-7, 8: 1e-8}, 0.02, 8),
        (False, 0.02, 1, {7: 1e-7, 8: 1e-8}, None, 8),
        (False, 0.0, 4, {7: 0.0, 8: 0.0, 1: 1.0}, 10.0, 8),
        (True, 0.0, 4, {3: 1e-9, 4: 1e-9, 5: 1.0, 6: 1.0, 7: 1.0, 8: 1.0}, None, 4),
        (False, 0.0, 4, {3: 1e-9, 4: 1e-9, 5: 1.0, 6: 1.0, 7: 1.0, 8: 1.0}, None, 8),
    ],
)
def test_the_longest_step_by_the_last_two_terms(monkeypatch, near, first, steps, sizes, h, order):
    """(tolerance / size)^(1/k) of both; near a singular position fewer terms may allow more."""
    monkeypatch.setattr(driven, "largest_used", lambda k, memory: sizes.get(k, 0.0))
    memory = series(start_pivot=(0.99 if near else 1.01) * 0.3 * 0.5)
    memory.run.control.first_step, memory.run.equations.system.counts.steps = first, steps
    expected = min((3e-7 / sizes[k]) ** (1 / k) for k in (order - 1, order)) if h is None else h
    assert driven.longest_predictor_step(memory) == pytest.approx(expected)
    assert memory.step.used_order == order


@pytest.mark.parametrize(
    ("crossed", "near", "off", "violation", "expected"),
    [
        (0, False, 1.0, 1.0, OK),
        (1, False, 1.0, 1.0, SINGULAR_AHEAD),
        (0, True, 1.0, 1.0, SINGULAR_AHEAD),
        (0, False, 1.01, 1.0, STEP_TOO_SMALL),
        (0, False, math.nan, 1.0, STEP_TOO_SMALL),
        (0, False, 1.0, 1.01, STEP_TOO_SMALL),
    ],
)
def test_a_predictor_step_is_judged(monkeypatch, crossed, near, off, violation, expected):
    """Errors and violations relative to their limits."""
    limit = 30.0 * 64 * 3e-7
    memory = series(violation=violation * 100.0 * 3e-7)
    detected = []
    memory.kernels.detect = lambda h, pivot, memory: detected.append((h, pivot)) or crossed
    stubs = Stubs(
        monkeypatch,
        expand_at=OK,
        least_pivot=0.3,
        ends_near_singular=near,
        error_of_motion=(off * limit, 0.0),
    )
    assert driven.attempt_predictor_step(0.1, True, memory) == expected
    assert stubs.calls[0] == ("expand_at", 0.1, True) and detected == [(0.1, 0.3)]
    assert memory.step.crossed == crossed
    Stubs(monkeypatch, expand_at=NOT_CONVERGED)
    assert driven.attempt_predictor_step(0.1, True, memory) == NOT_CONVERGED


@pytest.mark.parametrize(("expansion", "expected"), [(OK, SINGULAR_AHEAD), (NOT_CONVERGED, NOT_CONVERGED)])
@pytest.mark.parametrize(
    ("before", "attempt", "ahead", "returns"),
    [
        (0.0, OK, 0.5, 1),
        (0.3, OK, 0.2, 1),
        (0.3, NOT_CONVERGED, 0.5, 2),
        (0.8, OK, 0.5, 1),
        (0.79, OK, -0.29, 1),
    ],
)
def test_accurate_steps_begin_at_the_distance_that_one_step_crosses(
    monkeypatch, before, attempt, ahead, returns, expansion, expected
):
    memory = series(crossed=1)
    stubs = Stubs(
        monkeypatch,
        length_before=before,
        attempt_predictor_step=attempt,
        end_step=None,
        set_high_accuracy=None,
    )
    memory.kernels.return_to_start = lambda memory: stubs.calls.append(("return",))
    memory.kernels.expand = lambda t, memory: stubs.calls.append(("expand", t)) or expansion
    assert driven.start_accurate_steps(0.5, 1.0, memory) == expected
    assert memory.step.time_to_crossing == pytest.approx(ahead) and memory.step.crossed == 0
    assert stubs.calls.count(("return",)) == returns
    assert stubs.calls[-2:] == [("set_high_accuracy",), ("expand", 0.2)]
    is_tried = 0.0 < before < 0.8
    assert (("attempt_predictor_step", before, True) in stubs.calls) is is_tried
    assert (("end_step", before, 1.0) in stubs.calls) is (is_tried and attempt == OK)


def test_the_distance_from_which_one_step_crosses(monkeypatch):
    stubs = Stubs(monkeypatch, longest_step=2.0)
    share = 0.6 * 2.0
    least = 0.25 * 2.0
    assert driven.length_before(share + 1.001 * least, series()) == pytest.approx(1.001 * least)
    assert driven.length_before(share + 0.999 * least, series()) == 0.0
    assert stubs.calls[0] == ("longest_step", pytest.approx(1e-13**0.5, rel=1e-9)), "half of the order"


@pytest.mark.parametrize(
    ("step", "crossed", "pivot", "expected", "predicts"),
    [
        (NOT_CONVERGED, 0, 9.0, UNDECIDED, False),
        (OK, 0, 0.39, OK, False),
        (OK, 0, 0.4, OK, True),
        (OK, 1, 0.39, OK, True),
        (OK, 1, 0.0, OK, False),
    ],
)
def test_accurate_steps_end_behind_the_singular_position(
    monkeypatch, step, crossed, pivot, expected, predicts
):
    memory = series(crossed=crossed)
    stubs = Stubs(monkeypatch, least_pivot=pivot, set_predictor=None)
    memory.kernels.step = lambda memory: step
    memory.kernels.record = lambda memory: stubs.calls.append(("record",))
    assert driven.take_accurate_step(memory) == expected
    assert (("set_predictor",) in stubs.calls) is predicts
    assert (("record",) in stubs.calls) is (crossed == 1 and step == OK)
    assert (memory.step.crossed, memory.step.start_pivot) == ((0, 0.0) if predicts else (crossed, 0.4))


def follow(monkeypatch: pytest.MonkeyPatch, memory: Any, **values: object) -> tuple[int, list[str]]:
    common = {
        "begin_once": OK,
        "least_pivot": 0.3,
        "set_predictor": None,
        "is_accurate": False,
        "is_full": False,
    }
    steps = {"take_predictor_step": OK, "take_accurate_step": OK, "put_terms": None}
    stubs = Stubs(monkeypatch, **{**common, **steps, **values})
    memory.series = SimpleNamespace(past="past")
    status = driven.follow_drivers.function(memory)
    assert all(given == ["past"] for name, *given in stubs.calls if name == "put_terms")
    return status, [name for name, *_ in stubs.calls]


def test_many_steps_in_one_call(monkeypatch):
    memory = series()
    status, calls = follow(monkeypatch, memory)
    assert status == PAUSED and calls.count("take_predictor_step") == 3 and "set_predictor" not in calls
    status, calls = follow(monkeypatch, memory, is_accurate=True)
    assert calls.count("take_accurate_step") == 3 and "take_predictor_step" not in calls
    assert follow(monkeypatch, memory, is_full=True)[1].count("take_predictor_step") == 1
    assert follow(monkeypatch, memory, take_predictor_step=SINGULAR_AHEAD)[0] == PAUSED
    status, calls = follow(monkeypatch, memory, take_predictor_step=NOT_CONVERGED)
    assert status == NOT_CONVERGED and calls[-1] == "put_terms"
    assert follow(monkeypatch, memory, begin_once=NOT_CONVERGED) == (NOT_CONVERGED, ["begin_once"])
    memory.run.loop.clock.time = 1.0
    assert follow(monkeypatch, memory)[0] == DONE
    memory.run.equations.system.counts.steps = 10
    assert follow(monkeypatch, memory)[0] == TOO_MANY_STEPS
    memory.run.equations.system.counts.steps = 0
    assert "set_predictor" in follow(monkeypatch, memory)[1] and memory.progress.entry_pivot == 0.3
