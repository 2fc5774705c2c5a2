"""Batches of scenes in the memory of one run / with stand-ins of runs, by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref.ensembles import batch, simulate_all
from mbref.ensembles.batch import Batch
from mbref.ensembles.simulate_all import Ended
from mbref.equations.initial_state import LARGE
from mbref.simulation.comparison import DROPS
from mbref.stepping.loop import DONE, UNDECIDED
from mbref.stepping.run import NEARLY


# --- many scenes --------------------------------------------------------------------------------------------
@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Runs of ten scenes, 0 to 9, of which some cannot begin."""
    scenes: Any = list(range(10))
    made: Any = simulate_all._Runs(scenes, "method", "times", "limits")  # type: ignore[arg-type]
    made.bad, made.released, made.led = set(), [], []

    def begun(scene: int, *arguments: Any) -> Any:
        assert arguments == ("method", "times", "limits")
        if scene in made.bad:
            raise ValueError(scene)
        return SimpleNamespace(scene=scene, release=lambda: made.released.append(scene))

    monkeypatch.setattr(simulate_all, "checked_run", begun)
    monkeypatch.setattr(simulate_all, "finish_run", lambda run: f"led {run.scene}")
    monkeypatch.setattr(simulate_all, "simulate", lambda *given: f"alone {begun(*given).scene}")
    monkeypatch.setattr(simulate_all, "may_lead", lambda run: run.scene != 1)
    return made


def test_runs_one_by_one(runs):
    runs.bad = {2}
    runs.alone([1, 2, 3])
    assert runs.ended.alone == {1: "alone 1", 3: "alone 3"}
    assert list(runs.ended.errors) == [2] and runs.ended.error.args == (2,)


def test_the_error_of_the_first_scene():
    one, other = ValueError(1), ValueError(2)
    assert Ended().error is None and Ended(errors={3: other, 1: one}).error is one


@pytest.mark.parametrize(
    ("completed", "left", "alone"),
    [
        ([0, 1, 2, 3], [], []),
        ([0, 2], [6, 8], []),
        ([3], [], [5, 6, 7]),
        ([], [], [5, 6, 7, 8]),
    ],
)
def test_scenes_that_a_batch_leaves(runs, monkeypatch, completed, left, alone):
    """A further batch follows if at least half of the scenes completed; otherwise single runs."""
    result = SimpleNamespace(places=completed)

    def run_batch(run: Any, scenes: Any) -> Any:
        assert run.scene == 0 and scenes == [5, 6, 7, 8]
        return result

    monkeypatch.setattr(simulate_all, "run_batch", run_batch)
    assert runs._led(SimpleNamespace(scene=0), [5, 6, 7, 8]) == left
    assert runs.ended.batches == [([5, 6, 7, 8], result)] and list(runs.ended.alone) == alone


def test_scenes_that_are_not_led(runs, monkeypatch):
    def singular(run: Any, scenes: Any) -> Any:
        raise np.linalg.LinAlgError

    monkeypatch.setattr(simulate_all, "run_batch", singular)
    assert runs._led(SimpleNamespace(scene=0), []) == []
    assert runs._led(SimpleNamespace(scene=1), [5, 6]) == [5, 6] and not runs.ended.alone
    assert runs._led(SimpleNamespace(scene=0), [5, 6]) == [] and list(runs.ended.alone) == [5, 6]
    assert not runs.ended.batches


def test_scenes_of_one_structure(runs, monkeypatch):
    """The first scene that can begin leads; memory is released after each batch."""
    runs.bad = {4, 7}
    monkeypatch.setattr(runs, "_led", lambda run, places: runs.led.append((run.scene, places)) or places[1:])
    runs.in_batches([4, 5, 6, 7, 8])
    assert runs.led == [(5, [6, 7, 8]), (8, [])] and runs.released == [5, 8]
    assert runs.ended.alone == {5: "led 5", 8: "led 8"} and sorted(runs.ended.errors) == [4, 7]


def test_motions_of_single_runs_and_of_batches():
    def motions(scenes: Any) -> Any:
        assert scenes == ["c", "a"]
        return iter([(1, "motion of a"), (0, "motion of c")])

    ended = Ended(alone={1: "motion of b"}, batches=[([2, 0], SimpleNamespace(motions=motions))])  # type: ignore
    assert list(ended.motions(["a", "b", "c"])) == [  # type: ignore[list-item]
        (1, "motion of b"),
        (0, "motion of a"),
        (2, "motion of c"),
    ]


@pytest.mark.parametrize(
    ("series", "tolerance", "branches", "leads"),
    [
        (True, DROPS, (), True),
        (True, math.nextafter(DROPS, 1.0), (), False),
        (False, DROPS, (), False),
        (True, DROPS, ((1, 2),), False),
    ],
)
def test_methods_and_limits_that_make_batches(series, tolerance, branches, leads):
    of: Any = SimpleNamespace(is_series=series)
    limits: Any = SimpleNamespace(rank_tolerance=tolerance, branches=branches)
    assert simulate_all._can_lead(of, limits) == leads


def test_all_runs_by_structure_and_their_time(monkeypatch):
    """Scenes of one letter have one structure; 12 s to 15.5 s on the clock."""
    clock, made = iter([12.0, 15.5]), list[Any]()
    monkeypatch.setattr(simulate_all, "time", SimpleNamespace(perf_counter=lambda: next(clock)))
    monkeypatch.setattr(simulate_all, "shape_of", lambda scene: scene[0])
    monkeypatch.setattr(simulate_all, "_can_lead", lambda of, limits: limits == "lead")
    for name in ("alone", "in_batches"):
        monkeypatch.setattr(
            simulate_all._Runs, name, lambda self, places, name=name: made.append((name, places))
        )
    scenes: Any = ["a1", "b1", "a2"]
    of: Any = "method"
    monkeypatch.setattr(simulate_all.Method, "parse", lambda text: of)
    assert simulate_all.run_all(scenes, of, np.zeros(1), "lead").seconds == 3.5  # type: ignore[arg-type]
    clock = iter([0.0, 0.0])
    simulate_all.run_all(scenes, of, np.zeros(1), "no")  # type: ignore[arg-type]
    assert made == [("in_batches", [0, 2]), ("in_batches", [1]), ("alone", [0, 2]), ("alone", [1])]


# --- one batch ----------------------------------------------------------------------------------------------
BELOW = math.nextafter(NEARLY, 0.0)


@pytest.mark.parametrize(
    ("given", "leads"),
    [
        ({}, True),
        ({"reduction": None}, False),
        ({"m": LARGE + 1}, False),
        ({"least": BELOW}, False),
        ({"sample": 2}, False),
        ({"short": False}, False),
        ({"rest": True}, False),
        ({"motion": True}, False),
    ],
)
def test_runs_that_may_lead(monkeypatch, given, leads):
    facts: Any = {"reduction": 1, "m": LARGE, "least": NEARLY, "sample": 3, "short": True}
    facts |= {"rest": False, "motion": False, **given}
    monkeypatch.setattr(batch, "_stepper", lambda run: SimpleNamespace(was_short=facts["short"]))
    monkeypatch.setattr(batch, "begins_at_rest", lambda run: facts["rest"])
    monkeypatch.setattr(batch, "begins_in_motion", lambda run: facts["motion"])
    run: Any = SimpleNamespace(
        reduction=facts["reduction"],
        model=SimpleNamespace(m=facts["m"]),
        ranks=SimpleNamespace(least=facts["least"]),
        memory=SimpleNamespace(loop=SimpleNamespace(clock=SimpleNamespace(sample=facts["sample"]))),
        times=np.zeros(3),
    )
    assert batch.may_lead(run) is leads


def test_scenes_of_a_batch_that_complete(monkeypatch):
    """Scene 3 is undecided, and scene 4 passes two positions."""
    made: Any = Batch.__new__(Batch)
    ends = {1: (DONE, 0.5), 3: (UNDECIDED, 0.25), 4: (DONE, 2.0)}
    written: list[int] = []
    made._run, made._fit, made._seconds, made._crossings = (
        SimpleNamespace(crossings=["old"]),
        [1, 3, 4],
        np.zeros(5),
        {},
    )

    def advance() -> tuple[int, float]:
        assert made._run.crossings == []
        made._run.crossings = ["first", "second"] if written[-1] == 4 else []
        return ends[written[-1]]

    kept: list[int] = []
    made._parameters = SimpleNamespace(write=written.append)
    made._stepper = SimpleNamespace(advance_once=advance)
    made._candidates = SimpleNamespace(packs=SimpleNamespace(scenes="abcde"))
    monkeypatch.setattr(made, "_keep", kept.append)
    monkeypatch.setattr(batch, "lazy_crossings", lambda scene, passed: (scene, passed))
    assert made.run() == [1, 4] and written == [1, 3, 4] and kept == [1, 4]
    assert made._seconds.tolist() == [0.0, 0.5, 0.0, 0.25, 2.0]
    assert made._crossings == {4: ("e", ["first", "second"])}


@pytest.mark.parametrize("turns", [True, False])
def test_the_result_of_a_batch(monkeypatch, turns):
    """Two of three scenes of one body, in four samples and two rows, took 5 s of which 3 s were steps."""
    made: Any = Batch.__new__(Batch)
    numbers = np.arange(3 * 4 * 21.0).reshape(3, 4, 21)
    made._samples = [numbers[..., :7], numbers[..., 7:13], numbers[..., 13:19], numbers[..., 19:]]
    made._seconds, made._crossings = np.array([1.0, 50.0, 2.0]), {2: "ab"}
    made._counts = np.arange(18).reshape(3, 6)
    model, scene = SimpleNamespace(nb=1), SimpleNamespace(body=["b"])
    made._run = SimpleNamespace(model=model, times=np.arange(4.0), scene=scene)
    packs = SimpleNamespace(principal=np.arange(12.0).reshape(3, 1, 4), turns_frames=turns)
    made._candidates = SimpleNamespace(packs=packs, starts="xyz", ranks="uvw")
    seen: list[Any] = []
    monkeypatch.setattr(batch, "motion_of", lambda *given: seen.append(given) or {"poses": 1})
    monkeypatch.setattr(batch, "report_of", lambda *given: given)
    monkeypatch.setattr(batch, "facts_of", lambda run: {"facts": run.times})
    found = made.result([0, 2], 5.0)
    q, v, a, principal, count = seen[0]
    assert q[:, :, 0].tolist() == numbers[[0, 2], :, :7].tolist() and q.shape == (2, 4, 1, 7)
    assert v[:, :, 0].tolist() == numbers[[0, 2], :, 7:13].tolist() and v.shape == (2, 4, 1, 6)
    assert a[:, :, 0].tolist() == numbers[[0, 2], :, 13:19].tolist() and count == 1
    assert (principal.tolist() == [[[[0, 1, 2, 3]]], [[[8, 9, 10, 11]]]]) if turns else principal is None
    assert found.places == [0, 2] and found.coordinates is q and found.poses == {"poses": 1}
    assert found.multipliers.tolist() == numbers[[0, 2], :, 19:].tolist()
    assert found.counts.tolist() == [[0, 1, 2, 3, 4, 5], [12, 13, 14, 15, 16, 17]]
    assert found.seconds == [1.0, 2.0] and found.built == 1.0 and found.times is made._run.times
    assert found.messages == [("x", "u", 0), ("z", "w", 2)] and found.crossings == [(), "ab"]
    assert found.facts == {"facts": made._run.times}
    assert made.result([], 5.0).built == 5.0


def test_the_time_of_a_batch(monkeypatch):
    """10 s to 13.5 s of CPU time, with the search for candidates."""
    clock = iter([10.0, 13.5])

    class Made:
        def __init__(self, *given: Any) -> None:
            self.given = given

        def run(self) -> list[int]:
            return [0, 2]

        def result(self, places: list[int], seconds: float) -> Any:
            return places, seconds, self.given

    monkeypatch.setattr(batch, "time", SimpleNamespace(process_time=lambda: next(clock)))
    monkeypatch.setattr(batch, "candidates_of", lambda run, scenes: ("candidates", run, scenes))
    monkeypatch.setattr(batch, "Batch", Made)
    run: Any = "run"
    scenes: Any = ["a", "b"]
    assert batch.run_batch(run, scenes) == ([0, 2], 3.5, ("run", ("candidates", "run", ["a", "b"])))
