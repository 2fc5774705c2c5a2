"""Runs by series in Python: order of calls, memory and departures / worked out by hand."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest

from mbref.equations.branches import SMOOTH, Passed
from mbref.kernels.layout import NOT_CONVERGED, OK, SINGULAR_AHEAD
from mbref.stepping.loop import DONE, PAUSED, STEP_TOO_SMALL, UNDECIDED
from mbref.taylor import batch_equations, layout, polynomials, series_memory, stepper
from mbref.taylor.crossing import departure
from mbref.taylor.crossing.departure import Departure
from mbref.taylor.crossing.thresholds import DEPARTURE_PIVOT, START_ERROR
from mbref.taylor.expressions import ONE
from mbref.taylor.forms import Forms
from mbref.taylor.numbers import BatchNumber, ManyScenes, OneScene
from mbref.taylor.stepper import SeriesStepper


# --- the loop over calls ------------------------------------------------------------------------------------
def passed(time: float = 1.0, taken: int = SMOOTH) -> Passed:
    return Passed(time, np.zeros(7), np.zeros(6), taken)


def made(**changes: Any) -> Any:
    """A stepper of a run of 2 s with 3 crossings so far, without memory of a series."""
    found = SeriesStepper.__new__(SeriesStepper)
    counts = SimpleNamespace(steps=40, crossings=0)
    state = SimpleNamespace(coordinates=np.arange(7.0), velocities=np.arange(6.0))
    found.run = SimpleNamespace(  # type: ignore[assignment]
        crossings=[passed(), passed(), passed()],
        times=np.array([0.0, 0.5, 2.0]),
        making=0.0,
        limits=SimpleNamespace(branches={3: SMOOTH, 4: 2}, most_steps=100),
        model=SimpleNamespace(n=4),
        start=SimpleNamespace(q=np.arange(7.0)),
        memory=SimpleNamespace(
            loop=SimpleNamespace(clock=SimpleNamespace(time=0.5)),
            equations=SimpleNamespace(system=SimpleNamespace(counts=counts)),
            state=state,
            active=SimpleNamespace(velocities=np.array([1, 3])),
            previous=SimpleNamespace(coordinates=np.zeros(7)),
        ),
    )
    found.taylor = SimpleNamespace(progress=SimpleNamespace(end=0.0, recorded=0, is_clear=0))
    found.argument, found._calls, found._sampling = "argument", 0, 0.0
    found._way, found._fits_no_branch, found._wants_code, found.follows_drivers = None, False, True, False
    for name, value in changes.items():
        setattr(found, name, value)
    return found


def noting(calls: list[Any], name: str, *answers: Any) -> Callable[..., Any]:
    """A function that notes its name and arguments, and gives one answer after the other."""
    left = list(answers)

    def function(*given: Any, **named: Any) -> Any:
        calls.append((name, *given, *named.values()))
        return left.pop(0) if len(left) > 1 else left[0]

    return function


def test_a_run_to_its_end(monkeypatch):
    """A pause, a singular position, a branch that is left, a pause that fails to be completed by the pace."""
    found, calls, seen = made(), [], []
    found._leave_start = noting(calls, "start", PAUSED)
    found.take_steps = noting(calls, "steps", PAUSED, SINGULAR_AHEAD, PAUSED, DONE)
    found.recorded = noting(calls, "recorded", [])
    found._leaves_branch = noting(calls, "leaves", False, True)
    found._begin_again = noting(calls, "again", PAUSED)
    found._cross, found._take_branch = noting(calls, "cross", 11), noting(calls, "branch", 12)
    found._complete_samples = noting(calls, "samples", PAUSED, DONE)
    found._pace = SimpleNamespace(judge=lambda status: calls.append(("pace", status)) or status)
    found._generate_where_it_pays = noting(calls, "code", None)
    monkeypatch.setattr(stepper.time, "process_time", iter([10.0, 17.0]).__next__)
    found.run.making, found._sampling = 1.0, 2.0
    assert found.advance(seen.append) == (DONE, 5.0)
    once = [("pace", PAUSED), ("code",)]
    assert calls == [
        ("start",),
        *[("steps",), ("recorded",), ("leaves",), ("samples", PAUSED, True), *once],
        *[("steps",), ("recorded",), ("cross",), ("again", 11), *once],
        *[("steps",), ("recorded",), ("leaves",), ("branch",), ("again", 12), *once],
        *[("steps",), ("recorded",), ("samples", DONE, False)],
    ]
    assert seen == [0.5] * 4


def test_a_run_that_fails_is_not_continued(monkeypatch):
    found, calls = made(), []
    found._leave_start, found.take_steps = (
        noting(calls, "start", PAUSED),
        noting(calls, "steps", STEP_TOO_SMALL),
    )
    found.recorded, found._leaves_branch = (lambda: [passed()]), (lambda: False)
    found._complete_samples = noting(calls, "samples", STEP_TOO_SMALL)
    found._pace = SimpleNamespace(judge=lambda status: status)
    assert found.advance(None)[0] == STEP_TOO_SMALL and len(found.run.crossings) == 5
    assert calls == [
        ("start",),
        ("steps",),
        ("samples", STEP_TOO_SMALL, False),
        ("samples", STEP_TOO_SMALL, False),
    ]
    undecided, seen = made(), []
    undecided._leave_start, undecided.recorded = (lambda: UNDECIDED), list
    undecided._complete_samples = lambda status, go_on: status
    assert undecided.advance(seen.append)[0] == UNDECIDED and not seen


def test_one_call_of_a_run_in_a_batch(monkeypatch):
    found, calls = made(), []
    found.take_steps, found.recorded = noting(calls, "steps", DONE), lambda: [passed(9.0)]
    found._status_with_samples = noting(calls, "samples", 77)
    monkeypatch.setattr(stepper.time, "process_time", iter([10.0, 17.0]).__next__)
    assert found.advance_once() == (77, 7.0) and calls == [("steps",), ("samples", DONE, False)]
    assert found.run.crossings[-1].time == 9.0


@pytest.mark.parametrize("follows", [True, False])
def test_calls_of_kernels_are_counted(monkeypatch, follows):
    found, calls = made(follows_drivers=follows), []
    monkeypatch.setattr(stepper, "follow_drivers", noting(calls, "drivers", 5))
    monkeypatch.setattr(stepper, "advance_series", noting(calls, "series", 5))
    assert not found.was_short and found.take_steps() == 5 and found.was_short
    assert calls == [("drivers" if follows else "series", "argument")]
    found.take_steps()
    assert not found.was_short


def test_samples_are_completed_and_their_time_is_taken(monkeypatch):
    """A failed sample ends the run, but an undecided motion stays undecided."""
    found, calls = made(_sampling=1.0), []
    monkeypatch.setattr(stepper, "complete_samples", noting(calls, "samples", OK, 44, 44))
    monkeypatch.setattr(stepper.time, "process_time", iter([10.0, 13.0, 13.0, 13.0, 13.0, 13.0]).__next__)
    assert found._complete_samples(PAUSED, go_on=True) == PAUSED and found._sampling == 4.0
    assert found._complete_samples(PAUSED, go_on=False) == 44
    assert found._complete_samples(UNDECIDED, go_on=False) == UNDECIDED
    assert calls == [("samples", 1, "argument"), *[("samples", 0, "argument")] * 2]


@pytest.mark.parametrize(
    ("status", "expanded", "expected"),
    [(PAUSED, OK, PAUSED), (PAUSED, NOT_CONVERGED, UNDECIDED), (DONE, NOT_CONVERGED, DONE)],
)
def test_a_series_begins_again_after_a_crossing(monkeypatch, status, expanded, expected):
    found, calls = made(), []
    found._complete_samples = lambda status, go_on: calls.append(go_on) or status
    monkeypatch.setattr(stepper, "enter_series", noting(calls, "enter", expanded))
    assert found._begin_again(status) == expected and calls[0] is False
    assert calls[1:] == ([("enter", "argument")] if status == PAUSED else [])
    assert found.taylor.progress.end == (2.0 if status == PAUSED else 0.0)


def test_branches_that_are_asked():
    found = made()
    assert [found._asked(k) for k in (1, 3, 4)] == [SMOOTH, SMOOTH, 2] and not found._leaves_branch()
    found.run.crossings.append(passed())
    assert found._leaves_branch()
    found.run.crossings[-1] = passed(taken=2)
    assert not found._leaves_branch()
    found.run.crossings.clear()
    assert found._leaves_branch() is False


def test_recorded_crossings_are_copied_once():
    found = made()
    found.taylor.progress.recorded = 2
    found.taylor.crossings = (
        np.array([1.0, 2.0, 9.0]),
        np.arange(21.0).reshape(3, 7),
        np.arange(18.0).reshape(3, 6),
    )
    first, second = found.recorded()
    assert (first.time, second.time, first.taken, second.taken) == (1.0, 2.0, SMOOTH, SMOOTH)
    assert second.coordinates.tolist() == list(range(7, 14)) and second.velocities.tolist() == list(
        range(6, 12)
    )
    found.taylor.crossings[1][:] = 0.0
    assert second.coordinates[0] == 7.0 and found.taylor.progress.recorded == 0 and found.recorded() == []


def test_crossings_of_a_step_up_to_the_branch_that_is_asked():
    """The fourth crossing is left along branch 2; the fifth is then not passed."""
    found = made()
    found.recorded = lambda: [passed(1.0), passed(2.0)]
    crossed: list[Passed] = []
    branch = found._record(crossed)
    assert branch is crossed[-1] and len(crossed) == 1 and (branch.time, branch.taken) == (1.0, 2)
    found.run.crossings.pop()
    smooth: list[Passed] = []
    assert found._record(smooth).time == 2.0 and [one.taken for one in smooth] == [SMOOTH, 2]
    found.recorded = list
    assert found._record(smooth) is None and len(smooth) == 2


def crossing(
    monkeypatch: pytest.MonkeyPatch, branches: list[Any], clear: list[int], ends: int = PAUSED
) -> Any:
    """A stepper beside a singular position, whose steps pass these branches and are clear at the end."""
    found, calls = made(), []
    left = list(branches)

    def record(crossed: list[Passed]) -> Any:
        branch = left.pop(0)
        crossed.append(passed(taken=5))
        found.taylor.progress.is_clear = clear[len(branches) - len(left) - 1]
        return branch

    found._record = record
    found._departure = SimpleNamespace(
        along_branch=noting(calls, "along", PAUSED), from_start=noting(calls, "from", 8)
    )
    monkeypatch.setattr(stepper, "continue_crossing", noting(calls, "go on", PAUSED))
    monkeypatch.setattr(stepper, "end_crossing", lambda status, _: calls.append(("end", status)) or ends)
    monkeypatch.setattr(stepper, "begin_crossing", noting(calls, "begin", OK))
    monkeypatch.setattr(stepper, "cross_position", noting(calls, "cross", PAUSED))
    found.calls = calls
    return found


def test_steps_until_no_singular_position_is_near(monkeypatch):
    found = crossing(monkeypatch, [None, None], [0, 1])
    assert found._cross() == PAUSED and found._calls == 1
    assert found.calls == [("cross", "argument"), ("go on", "argument"), ("end", PAUSED)]
    assert len(found.run.crossings) == 5
    ended = crossing(monkeypatch, [None], [0])
    assert ended._until_clear(DONE, []) == PAUSED and ended.calls == [("end", DONE)]


def test_a_crossing_that_ends_undecided_is_not_counted(monkeypatch):
    found = crossing(monkeypatch, [None], [1], UNDECIDED)
    assert found._until_clear(PAUSED, []) == UNDECIDED and len(found.run.crossings) == 3
    failed = crossing(monkeypatch, [], [])
    assert failed._until_clear(STEP_TOO_SMALL, [passed()]) == PAUSED and failed.calls == [
        ("end", STEP_TOO_SMALL)
    ]


def test_a_branch_inside_a_crossing_is_taken(monkeypatch):
    branch = passed(taken=2)
    found = crossing(monkeypatch, [branch, None], [0, 1])
    assert found._until_clear(PAUSED, []) == PAUSED
    assert found.calls == [("along", branch), ("end", PAUSED)]
    assert found.run.memory.equations.system.counts.crossings == 4


def test_the_last_crossing_is_left_along_another_branch(monkeypatch):
    found = crossing(monkeypatch, [None], [1])
    found.run.crossings.append(passed(7.0))
    assert found._take_branch() == PAUSED
    (begin, along, end), taken = found.calls, found.run.crossings
    assert (begin, along[0], end) == (("begin", "argument"), "along", ("end", PAUSED))
    assert (along[1].time, along[1].taken) == (7.0, 2) and [one.taken for one in taken] == [1, 1, 1, 2, 5]


@pytest.mark.parametrize(("fits", "expected"), [(False, PAUSED), (True, UNDECIDED)])
def test_a_regular_start_is_not_left(fits, expected):
    assert made(_fits_no_branch=fits)._leave_start() == expected


def test_a_singular_start_is_left_by_a_departure(monkeypatch):
    found = crossing(monkeypatch, [None], [1])
    found._way, found._begin_again = "way", lambda status: ("again", status)
    assert found._leave_start() == ("again", PAUSED) and found._calls == 1
    assert found.calls == [("begin", "argument"), ("from", "way"), ("end", 8)]


@pytest.mark.parametrize(
    ("steps", "time", "most", "ahead"), [(40, 0.5, 1000, 120.0), (40, 0.5, 100, 60), (40, 2.0, 1000, 0.0)]
)
def test_steps_ahead(steps, time, most, ahead):
    """In proportion to the time, or up to the limit."""
    found = made()
    found.run.memory.loop.clock.time, found.run.limits.most_steps = time, most
    found.run.memory.equations.system.counts.steps = steps
    assert found._steps_ahead() == ahead


def test_velocities_that_can_move():
    assert made()._moving.tolist() == [False, True, False, True]


def test_options_of_a_run_by_series(monkeypatch):
    found, written = made(), []
    monkeypatch.setattr(stepper, "write_record", lambda *given: written.append(given))
    found.taylor.mode, found.taylor.options = SimpleNamespace(), "options"
    found._options = layout.SeriesOptions(regular_tolerance=1e-7, regular_order=12)
    found._put_options()
    assert written == [("options", found._options)] and found.taylor.progress.end == 2.0
    assert vars(found.taylor.mode) == {"kind": 0, "tolerance": 1e-7, "order": 12}
    assert found.run.memory.previous.coordinates.tolist() == list(range(7))


def test_a_run_begins_again_with_its_equations(monkeypatch):
    found, calls = made(), []
    found._pooled = SimpleNamespace(restore=lambda: calls.append("restore"))
    found.geometry, found.polynomials = "geometry", "polynomials"
    found._put_options, found._decide_rank = noting(calls, "options", None), noting(calls, "rank", None)
    monkeypatch.setattr(stepper, "put_equations", lambda *given: calls.append(given))
    found.begin_again()
    assert calls == ["restore", (found.taylor, "geometry", "polynomials"), ("options",), ("rank",)]


def test_numbers_that_differ_between_scenes(monkeypatch):
    """The distance of a start from its series is of each scene's length, at least of one metre."""
    found, asked = made(follows_drivers=True), []
    found.taylor.options = "options"
    monkeypatch.setattr(
        stepper, "equations_of_all", lambda *given: asked.append(given) or ([("a", "b")], [0])
    )
    packs = SimpleNamespace(length=np.array([0.5, 3.0]))
    varied, alike = found.parameters(packs, "q", [0, 1])
    (target, distances, name), other = varied
    assert (target, name, other, alike) == ("options", "start_distance", ("a", "b"), [0])
    assert distances.tolist() == [START_ERROR, 3 * START_ERROR]
    [(given, q, places, moving, driven, taylor)] = asked
    assert (given, q, places, driven, taylor) == (
        packs,
        "q",
        [0, 1],
        True,
        found.taylor,
    ) and moving.sum() == 2


def test_states_along_a_series_are_copies(monkeypatch):
    found, calls = made(), []
    monkeypatch.setattr(stepper, "put_state_along", lambda *given: calls.append(given))
    q, v = found._state_at(0.25)
    found.run.memory.state.coordinates[:] = found.run.memory.state.velocities[:] = -1.0
    assert calls == [(0.25, "argument")] and q.tolist() == list(range(7)) and v.tolist() == list(range(6))


# --- departures ---------------------------------------------------------------------------------------------
def leaving(status: int = OK) -> Any:
    """A departure of two bodies of lengths 2 m and 0.5 m."""
    settings = SimpleNamespace(rank_tolerance=1e-7)
    counts = SimpleNamespace(crossings=6)
    run = SimpleNamespace(
        model=SimpleNamespace(data=SimpleNamespace(lengths=np.array([2.0, 0.5]))),
        memory=SimpleNamespace(
            loop=SimpleNamespace(clock=SimpleNamespace(time=0.0, sample=3)),
            equations=SimpleNamespace(
                system=SimpleNamespace(settings=settings, counts=counts), angles=np.array([0.3])
            ),
            state=SimpleNamespace(coordinates=np.arange(14.0), velocities=np.arange(12.0)),
        ),
    )
    saved = SimpleNamespace(
        instant=SimpleNamespace(), coordinates=np.zeros(14), velocities=np.zeros(12), angles=np.zeros(1)
    )
    taylor = SimpleNamespace(
        progress=SimpleNamespace(clearance=9.0, is_clear=9, entry_pivot=9.0),
        step=SimpleNamespace(start_pivot=9.0),
        solver=SimpleNamespace(last=np.array([-0.4, 0.2, 1e-3])),
        partition=SimpleNamespace(rank=2),
        crossing_start=saved,
    )
    return Departure(run, taylor, lambda: status, lambda h: (np.zeros(14), np.zeros(12)))  # type: ignore[arg-type]


def test_the_largest_rate_of_a_body_is_over_its_length():
    v = np.array([1.0, -4.0, 0, 0.5, 0, 0, 0, 0, 0.75, 0, -1.0, 0])
    assert leaving()._largest_rate(v) == 2.0
    v[8] = -1.5
    assert leaving()._largest_rate(v) == 3.0
    v[10] = -3.5
    assert leaving()._largest_rate(v) == 3.5


@pytest.mark.parametrize("status", [OK, NOT_CONVERGED])
def test_a_departure_begins_beside_a_crossing(status):
    """The rank tolerance is another one while the state is corrected."""
    found, during = leaving(), []
    settings = found._run.memory.equations.system.settings
    found._least_pivot_at = lambda q, crossing: ("pivot", q, crossing)
    found._corrected = lambda *given: during.append((settings.rank_tolerance, given)) or status
    start = passed(2.0)
    moved = ("q", "v")
    assert found._come_from(start, "velocities", 0.25, moved) == (PAUSED if status == OK else status)
    assert during == [(("pivot", "q", start.coordinates), (start, "velocities", 0.25, moved))]
    assert settings.rank_tolerance == 1e-7 and found._run.memory.loop.clock.time == 2.25
    progress, saved = found._taylor.progress, found._taylor.crossing_start
    if status == OK:
        assert (progress.clearance, progress.is_clear, found._taylor.step.start_pivot) == (0.0, 0, 0.0)
        assert progress.entry_pivot == 0.2
        assert vars(saved.instant) == {"time": 2.25, "sample": 3, "crossings": 6}
        assert saved.coordinates.tolist() == list(range(14)) and saved.velocities.tolist() == list(range(12))
        assert saved.angles.tolist() == [0.3]
        found._taylor.partition.rank = 0
        found._come_from(start, "velocities", 0.25, moved)
        assert progress.entry_pivot == 1.0
    else:
        assert progress.clearance == 9.0 and not saved.coordinates.any()


@pytest.mark.parametrize(
    ("place", "moved", "distance"),
    [(0, 4.0, 2.0), (7, -4.0, 8.0), (3, 5.0, 5.0), (11, -6.0, 6.0), (0, 0.0, 0.0)],
)
def test_the_pivot_beside_a_crossing_is_relative_to_the_distance(monkeypatch, place, moved, distance):
    """Displacements over the lengths of the bodies, or rotations; at least the tolerance of the run."""
    found, apart = leaving(), np.zeros(12)
    apart[place] = moved
    monkeypatch.setattr(departure, "displacement", lambda q, crossing: apart)
    expected = max(1e-7, DEPARTURE_PIVOT * distance)
    assert found._least_pivot_at(np.zeros(14), np.zeros(14)) == pytest.approx(expected, rel=1e-15)


def test_a_sample_has_multipliers_that_balance_its_forces():
    """Two equal rows along x share a force of 6 N - 2 kg · 1 m/s²; y has no row."""
    found = leaving()
    run = found._run
    run.times = np.array([0.0, 0.5])
    asked: list[Any] = []
    terms = SimpleNamespace(
        force=np.array([6.0, 9.0]), mass=np.array([2.0, 3.0]), jacobian=np.array([[1.0, 0.0], [1.0, 0.0]])
    )
    run.model.terms = lambda *given: asked.append(given) or terms
    run.memory.loop.samples = SimpleNamespace(
        **{name: np.zeros((2, 2)) for name in ("coordinates", "velocities", "accelerations", "multipliers")}
    )
    found._put_sample(1, np.array([1.0, 2.0]), np.array([3.0, 4.0]), np.array([1.0, 5.0]))
    samples = run.memory.loop.samples
    assert samples.coordinates[1].tolist() == [1.0, 2.0] and samples.velocities[1].tolist() == [3.0, 4.0]
    assert samples.accelerations[1].tolist() == [1.0, 5.0] and asked[0][0] == 0.5
    assert samples.multipliers[1] == pytest.approx([2.0, 2.0]) and not samples.multipliers[0].any()


# --- memory -------------------------------------------------------------------------------------------------
def test_numbers_of_new_memory_are_zero_or_one():
    """Only a new step has a pivot of one and approaches, and the largest pivot so far is a tenth."""
    records = (layout.SeriesOptions, layout.Mode, layout.Partition, layout.Step, layout.Progress)
    records += (layout.SceneCode, layout.Instant)
    found = {(of.__name__, name): value for of in records for name, value in of()._asdict().items() if value}
    assert found == {
        ("Step", "start_pivot"): 1.0,
        ("Step", "approaching"): 1,
        ("Progress", "largest_pivot"): 0.1,
    }


def allocated(monkeypatch: pytest.MonkeyPatch, sizes: dict[str, int]) -> tuple[Any, Any]:
    series = SimpleNamespace(
        **{name: np.zeros((sizes["orders"], sizes["lanes"])) for name in ("scale", "growth")},
        variable=np.zeros(sizes["lanes"]),
    )
    kept: dict[str, Any] = {}

    def allocate(schema: Any, given: Any, **parts: Any) -> Any:
        assert given == sizes
        kept.update(parts)
        return series if schema is layout.Series else "memory"

    monkeypatch.setattr(series_memory, "allocate", allocate)
    monkeypatch.setattr(series_memory, "copied", lambda part: ("copy", part))
    monkeypatch.setattr(series_memory, "CALLED", [SimpleNamespace(pointer=k) for k in range(20)])
    run: Any = SimpleNamespace(memory="run", limits=SimpleNamespace(branches={2: SMOOTH, 3: 2, 5: 4}))
    geometry: Any = SimpleNamespace(pose_maps="maps")
    assert series_memory._allocate(run, geometry, "polynomials", sizes) == "memory"  # type: ignore[arg-type]
    return series, kept


def test_scales_of_new_memory(monkeypatch):
    """Order k of the sums is over (k + 1) (k + 2) for variables, and multipliers grow by it."""
    series, kept = allocated(monkeypatch, {"orders": 4, "nz": 2, "nr": 3, "lanes": 8})
    grown = np.array([2.0, 6.0, 12.0, 20.0])
    assert series.scale[:, :2].T.tolist() == [(-1 / grown).tolist()] * 2
    assert (series.scale[:, 2:5] == -1.0).all() and not series.scale[:, 5:].any()
    assert (series.growth[:, :2] == 1.0).all() and (series.growth[:, 5:] == 1.0).all()
    assert series.growth[:, 2:5].T.tolist() == [grown.tolist()] * 3
    assert series.variable.tolist() == [1.0, 1.0, *[0.0] * 6]
    assert kept["branch_switches"].tolist() == [3, 5] and kept["run"] == "run"
    assert kept["pose_maps"] == ("copy", "maps") and kept["polynomials"] == ("copy", "polynomials")
    assert kept["kernels"].balance == 0 and kept["kernels"].step == 19


def test_sizes_of_new_memory(monkeypatch):
    """Three variables, a function and four rows need 8 lanes; nine equations would need 16."""
    asked: list[Any] = []

    def acquire(key: Any, make: Any, pooled: Any) -> Any:
        asked.append((key, pooled))
        return SimpleNamespace(values=make())

    monkeypatch.setattr(series_memory, "acquire", acquire)
    monkeypatch.setattr(series_memory, "_allocate", lambda *given: given[-1])
    monkeypatch.setattr(series_memory, "shapes_of", lambda parts: ("shapes", parts))
    monkeypatch.setattr(series_memory, "put_equations", lambda *given: asked.append(given))
    natural = SimpleNamespace(kept=[0, 1, 2], given={7: 1}, rows=[0] * 4)
    geometry: Any = SimpleNamespace(natural=natural, pose_maps="maps", tableau="tableau")
    found = SimpleNamespace(
        products=SimpleNamespace(left=np.zeros(24)),
        rows=SimpleNamespace(row=np.zeros(10)),
        springs=SimpleNamespace(natural=np.zeros(2)),
        torsions=SimpleNamespace(slot=np.zeros(5)),
        slides=SimpleNamespace(function=np.zeros(6)),
        timed=SimpleNamespace(function=np.zeros(9)),
    )
    run: Any = SimpleNamespace(
        times=np.zeros(11),
        model=SimpleNamespace(sizes={"nb": 1}),
        limits=SimpleNamespace(branches={}),
        pooled="pool",
    )
    sizes = series_memory.acquire_memory(run, geometry, found, 20).values  # type: ignore[arg-type]
    assert sizes == {
        **{
            "orders": 21,
            "nz": 3,
            "ng": 1,
            "nr": 4,
            "lanes": 8,
            "slots": 24,
            "twofold": 10,
            "kept": 16,
            "k": 11,
        },
        **{"springs": 2, "torsions": 5, "slides": 6, "timed": 9, "nb": 1},
    }
    (key, pooled), put = asked
    assert key[0] is layout.TaylorMemory and key[-2] == ("shapes", (found, "maps", "tableau"))
    assert pooled == "pool" and key[-1] == {} and put == (sizes, geometry, found)
    natural.kept, natural.given = list(range(5)), {}
    assert series_memory.acquire_memory(run, geometry, found, 20).values["lanes"] == 16  # type: ignore[arg-type]
    natural.kept, natural.rows = [], []
    assert series_memory.acquire_memory(run, geometry, found, 20).values["lanes"] == 8  # type: ignore[arg-type]


# --- equations as arrays ------------------------------------------------------------------------------------
class Natural:
    """Variables 4 and 2 are kept; variable 1 is 2 x4 + 3; one body at (x1, x2, 0.5) whose axes are simple."""

    nb, length, kept, numbers, centres = 1, 2.0, (4, 2), OneScene(), ((1, 2, 3),)
    given: ClassVar[dict[int, tuple[int, int]]] = {8: (3, 0), 9: (3, 1)}

    @staticmethod
    def eliminate(expression: dict[int, float]) -> dict[int, float]:
        found: dict[int, float] = {}
        known = {1: {4: 2.0, ONE: 3.0}, 3: {ONE: 0.5}}
        for variable, factor in expression.items():
            for v, c in known.get(variable, {variable: 1.0}).items():
                found[v] = found.get(v, 0.0) + factor * c
        return found

    @staticmethod
    def direction(body: int, axis: np.ndarray) -> Any:
        """Axis k has the components (x4, x2, k + 10 body)."""
        k = int(np.argmax(axis))
        return {4: 1.0 + k}, {2: 1.0 - k}, {ONE: float(k)}


def test_expressions_as_constants_and_rows():
    forms = Forms(Natural())  # type: ignore[arg-type]
    constant, matrix = forms([{2: 5.0, ONE: 1.0}, {1: 1.0}, {}])
    assert constant.tolist() == [1.0, 3.0, 0.0] and matrix.tolist() == [[0.0, 5.0], [2.0, 0.0], [0.0, 0.0]]
    assert forms.variables([2, 1])[1].tolist() == [[0.0, 1.0], [2.0, 0.0]]
    assert forms.centres.tolist() == [[[2.0, 0.0], [0.0, 1.0], [0.0, 0.0]]]
    constant, axes = forms.of_axes(0)
    assert constant.tolist() == [0, 0, 0, 0, 0, 1, 0, 0, 2]
    assert axes.tolist() == [[1, 0], [0, 1], [0, 0], [2, 0], [0, 0], [0, 0], [3, 0], [0, -1], [0, 0]]


def test_the_mass_matrix_in_units_of_length():
    """3 kg at (2 z0, z1); ∫ x² dm along an axis is half the trace minus the moment, in units of 4 m²."""
    forms = Forms(Natural())  # type: ignore[arg-type]
    bodies: Any = SimpleNamespace(mass=np.array([3.0]), inertia=np.array([[5.0, 4.0, 3.0]]))
    along = (6.0 - np.array([5.0, 4.0, 3.0])) / 4
    expected = np.diag([3.0 * 4 + along @ [1, 4, 9], 3.0 * 1 + along @ [1, 0, 1]])
    assert forms.mass(bodies).tolist() == expected.tolist()


def test_inertia_forces_and_moments_as_arrays(monkeypatch):
    force, linear = np.array([1.0, 2.0]), np.array([[0.0, 0.5], [0.25, 0.0]])
    monkeypatch.setattr(polynomials, "constant_forces", lambda *_: (force, linear))
    mass = np.array([[2.0, 0.0], [0.0, 3.0]])
    of = SimpleNamespace(numbers=OneScene())
    forms: Any = SimpleNamespace(d=2, of=of, mass=lambda bodies: mass)
    data = SimpleNamespace(bodies=SimpleNamespace(mass=np.ones(1)))
    found = polynomials._inertia(SimpleNamespace(data=data), forms, 8)  # type: ignore[arg-type]
    assert (
        found.mass[:, :2].tolist() == mass.tolist()
        and not found.mass[:, 2:].any()
        and found.mass.shape == (2, 8)
    )
    assert found.coupled.tolist() == [0, 1] and found.first.tolist() == [0, 1, 2]
    assert found.force.tolist() == [1.0, 2.0, *[0.0] * 6] and found.start.tolist() == [0, 8]
    assert found.source.tolist() == [1, *[0] * 7] and found.weight.tolist() == [0.5, 0.25, *[0.0] * 6]


def test_poses_and_prescribed_functions_as_arrays():
    """Positions are 2 m times the variables; the rotation matrix stands by rows, its columns are the axes."""
    natural: Any = Natural()
    poses = polynomials._poses(natural, Forms(natural))
    assert poses.constant.tolist() == [6.0, 0.0, 1.0, *[0.0] * 6, 0.0, 1.0, 2.0]
    dense = np.zeros((12, 2))
    for p in range(12):
        for e in range(poses.start[p], poses.start[p + 1]):
            dense[p, poses.variable[e]] = poses.weight[e]
    assert dense[:3].tolist() == [[4.0, 0.0], [0.0, 2.0], [0.0, 0.0]]
    assert dense[3:].tolist() == [[1, 0], [2, 0], [3, 0], [0, 1], [0, 0], [0, -1], [0, 0], [0, 0], [0, 0]]
    given = polynomials._given(natural)
    assert [column.tolist() for column in given] == [[3, 3], [0, 1], [2.0, 1.0]]


def test_rows_as_arrays():
    """½ x² - 2 x y + 3 y + 4: each product stands twice; the function 8 is no variable of the tableau."""
    row = {(0, 0): 0.5, (0, 1): -2.0, (ONE, 1): 3.0, (ONE, 8): 7.0, (0, 8): 6.0, (ONE, ONE): 4.0}
    of: Any = SimpleNamespace(rows=[{(ONE, 0): 9.0}, row], kept=[0, 1], numbers=OneScene(), driven=False)
    lane = {0: 0, 1: 1, 8: 4}
    rows = polynomials._rows(of, lane, 8)
    assert rows.constant.tolist() == [0, 0, 0, 4.0, 0, 0, 0, 0]
    assert list(zip(*(c.tolist() for c in rows[:4]), strict=True)) == [
        *[(1, 0, 0, 0.5)] * 2,
        (1, 0, 1, -2.0),
        (1, 1, 0, -2.0),
        (1, 0, 4, 6.0),
        (1, 4, 0, 6.0),
    ]
    assert list(zip(*(c.tolist() for c in rows[4:7]), strict=True)) == [(0, 0, 9.0), (1, 1, 3.0), (1, 4, 7.0)]
    linear, place = polynomials._tableau(rows, 2, 2, 8)
    assert linear.tolist() == [[9, 0, 1, 0, 0, 0, 0, 0], [0, 3, 0, 1, 0, 0, 0, 0], [0] * 8]
    assert place.tolist() == [8, 8, 8, 9, 8, 16]


@pytest.mark.parametrize("driven", [False, True])
def test_products_of_rows_and_of_their_forces(driven):
    """½ x² and -2 x y in lane 2: their forces are λ x on x, and -2 λ y on x, -2 λ x on y, unless driven."""
    of: Any = SimpleNamespace(rows=[{(0, 0): 0.5, (0, 1): -2.0, (ONE, 1): 3.0}], kept=[0, 1], driven=driven)
    left, right, weight, start = polynomials._products(of, {0: 0, 1: 1}, 8)
    found = {(c % 8, int(left[c]), int(right[c]), float(weight[c])) for c in range(left.size) if weight[c]}
    forces = set() if driven else {(0, 2, 0, 1.0), (0, 2, 1, -2.0), (1, 2, 0, -2.0)}
    assert found == {(2, 0, 0, 0.5), (2, 0, 1, -2.0)} | forces and start.tolist() == [0, 16]


# --- equations of a batch -----------------------------------------------------------------------------------
def test_values_of_all_scenes():
    batch = ManyScenes(2)
    number = BatchNumber(np.array([1.0, 2.0]), batch)
    values = batch_equations._values_of_all
    assert values(np.zeros(2), np.array([number, 3.0], dtype=object), batch).tolist() == [
        [1.0, 3.0],
        [2.0, 3.0],
    ]
    assert values(np.zeros(2), np.array([4.0, 5.0]), batch).tolist() == [[4.0, 5.0]]
    many = np.array([[1.0, 2.0], [3.0, 4.0]])
    assert values(np.zeros(2), many, batch) is many and values(np.zeros(3), many, batch) is None
    assert values(np.zeros(3), np.zeros(2), batch) is None
    indices = np.array([1, 2])
    assert values(indices, indices.copy(), batch).tolist() == [[1, 2]]
    assert values(indices, indices[::-1], batch) is None


# --- geometries ---------------------------------------------------------------------------------------------
def test_tables_of_a_geometry(monkeypatch):
    """Lanes of two variables, three rows and two functions; tables of scenes without loads are made once."""
    calls: list[Any] = []

    def table(name: str) -> Callable[..., Any]:
        return lambda *given: calls.append((name, *given)) or f"{name} {len(calls)}"

    parts = ("_rows", "_products", "_poses", "_given", "_tableau", "_inertia", "coupled_angles")
    for name in (*parts, "springs_of", "torsions_of", "slides_of", "timed_forces"):
        monkeypatch.setattr(polynomials, name, table(name))
    monkeypatch.setattr(polynomials, "Forms", lambda of: "forms")
    monkeypatch.setattr(polynomials, "Polynomials", lambda **tables: tables)
    monkeypatch.setattr(polynomials, "padded_size", lambda size: 10 * size)
    vectors = SimpleNamespace(pose_maps=lambda kept: ("maps", kept))
    of: Any = SimpleNamespace(
        kept=[6, 4], rows=["row"] * 3, given={8: (3, 0), 9: (3, 1)}, direction_vectors=vectors
    )
    found = polynomials.Geometry(of)
    lanes = {6: 0, 4: 1, 8: 5, 9: 6}
    made = [
        ("_rows", of, lanes, 70),
        ("_products", of, lanes, 70),
        ("_poses", of, "forms"),
        ("_given", of),
        ("_tableau", "_rows 1", 2, 3, 70),
        ("coupled_angles", "forms"),
    ]
    assert calls == made and found.natural is of and found.pose_maps == ("maps", [6, 4])
    assert found.tableau == "_tableau 5"

    def model(loads: int) -> Any:
        return SimpleNamespace(data=SimpleNamespace(loads=SimpleNamespace(kind=np.zeros(loads))))

    several, none = model(2), model(0)
    first = found.polynomials(several)
    loads = several.data.loads
    assert calls[6:] == [
        ("_inertia", several, "forms", 70),
        ("springs_of", loads, "forms"),
        ("torsions_of", loads, "forms", "coupled_angles 6"),
        ("slides_of", loads, "forms"),
        ("timed_forces", loads, "forms"),
    ]
    assert first == {
        **{"rows": "_rows 1", "products": "_products 2", "inertia": "_inertia 7", "poses": "_poses 3"},
        **{"given": "_given 4", "springs": "springs_of 8", "torsions": "torsions_of 9"},
        **{"slides": "slides_of 10", "timed": "timed_forces 11"},
    }
    assert found.polynomials(several)["springs"] == "springs_of 13"
    assert [found.polynomials(none)["springs"] for _ in range(2)] == ["springs_of 18"] * 2
    assert found.polynomials(several)["springs"] == "springs_of 24"
    assert found.polynomials(none)["timed"] == "timed_forces 21"
    of.kept = of.rows = ()
    of.given = {}
    polynomials.Geometry(of)
    assert calls[-6] == ("_rows", of, {}, 10), "at least one lane"


def test_tables_without_entries():
    of: Any = SimpleNamespace(rows=[], kept=[], numbers=OneScene(), given={}, length=2.0)
    assert [column.size for column in polynomials._rows(of, {}, 8)] == [0, 0, 0, 0, 0, 0, 0, 8]
    assert [column.size for column in polynomials._given(of)] == [0, 0, 0]
    assert [column.size for column in polynomials.products_of_lanes([])] == [0, 0, 0, 1]


def test_the_mass_matrices_of_two_scenes():
    """Masses and moments of two scenes of one body: the first axis counts the scenes."""
    forms = Forms(Natural())  # type: ignore[arg-type]
    mass, inertia = np.array([[3.0], [2.0]]), np.array([[[5.0, 4.0, 3.0]], [[1.0, 1.5, 2.0]]])
    bodies: Any = SimpleNamespace(mass=mass, inertia=inertia)
    alone = [SimpleNamespace(mass=mass[k], inertia=inertia[k]) for k in range(2)]
    found = forms.mass(bodies)
    assert found.shape == (2, 2, 2)
    assert found.tolist() == [forms.mass(each).tolist() for each in alone]  # type: ignore[arg-type]
