"""Known parts of references / which requests they answer, and what is returned of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from crosscheck.judge.arithmetic import EXTENDED
from crosscheck.judge.reference import reference, taylor, tree
from crosscheck.judge.reference.reference import NoReference, Reference, _Kept, _load
from mbref.scene import Body, Scene

SCENE = Scene(
    name="s",
    body=(Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(1.0, 0.0, 0.0)),),
    duration=2.0,
)
TIMES = np.array([0.0, 0.5, 0.75])


def kept(reason: str = "it locks", seconds: float = 5.0) -> _Kept:
    """A motion that is known at three times; its first coordinates are 1, 2 and 3 m."""
    place = np.array([[[1.0, 0.0, 0.0]], [[2.0, 0.0, 0.0]], [[3.0, 0.0, 0.0]]])
    turn = np.tile([1.0, 0.0, 0.0, 0.0], (3, 1, 1))
    arrays: dict[str, Any] = {name: 10 * place for name in reference.FIELDS}
    arrays |= {"position": place, "orientation": turn}
    bound, both = np.array([1e-14, 1e-12, 1e-10]), np.array([True, True, False])
    return _Kept(Reference(times=TIMES, **arrays, bound=bound, both=both, seconds=0.25), reason, seconds)


@pytest.mark.parametrize(
    ("times", "seconds", "reason", "is_answered"),
    [
        ([0.5, 0.0], 99.0, "", True),
        ([0.25], 1.0, "it locks", False),
        ([0.75, 0.8], 5.0, "it locks", True),
        ([0.8], 4.0, "it locks", True),
        ([0.8], 5.1, "it locks", False),
        ([0.8], 5.0, "", False),
        ([0.25, 0.8], 5.0, "it locks", False),
    ],
)
def test_requests_that_the_known_part_answers(times, seconds, reason, is_answered):
    """Later times are answered by the reason of the end, if no more time is allowed than then."""
    assert bool(kept(reason).answers(np.array(times), seconds)) is is_answered
    assert kept().until() == 0.75


def test_a_reference_has_the_times_that_are_asked_for_in_order(monkeypatch):
    asked: list[Any] = []
    monkeypatch.setattr(
        reference, "_known", lambda scene, wanted, seconds: asked.append((wanted.tolist(), seconds)) or kept()
    )
    found = reference.reference(SCENE, (0.75, 0.0, 0.75), 7.0)
    assert isinstance(found, Reference) and asked == [([0.0, 0.75], 7.0)]
    assert found.times.tolist() == [0.0, 0.75] and found.position[:, 0, 0].tolist() == [1.0, 3.0]
    assert found.bound.tolist() == [1e-14, 1e-10] and found.both.tolist() == [True, False]
    assert found.seconds == 0.25
    ended = reference.reference(SCENE, (0.0, 0.5, 1.0))
    assert isinstance(ended, NoReference) and (ended.reason, ended.until) == ("it locks", 0.75)
    assert ended.part.times.tolist() == [0.0, 0.5] and asked[-1][1] == reference.SECONDS


def test_a_motion_without_a_sample_answers_nothing():
    """The start itself is missing, and it is not after the last known time."""
    none = _Kept(kept().samples.at(np.zeros(0)), "it locks", 5.0)
    assert none.until() == 0.0 and not none.answers(np.zeros(1), 1.0) and none.answers(np.array([0.5]), 1.0)


def test_a_known_part_is_computed_once_and_stored(monkeypatch, tmp_path: Path):
    """More times are computed together with the stored ones."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    runs: list[Any] = []
    monkeypatch.setattr(reference, "runs", lambda scene, times, seconds: runs.append((times, seconds)) or ())
    monkeypatch.setattr(
        reference, "judged", lambda scene, times: (kept().samples, "it locks") if scene is SCENE else None
    )
    assert _load(SCENE) is None
    first = reference._known(SCENE, TIMES[:2], 3.0)
    again = reference._known(SCENE, TIMES[:1], 9.0)
    assert len(runs) == 1 and runs[0][0].tolist() == [0.0, 0.5] and runs[0][1] == 3.0
    assert (first.seconds, again.seconds, again.reason) == (3.0, 3.0, "it locks")
    assert (again.samples.position == first.samples.position).all() and again.samples.seconds == 0.25
    reference._known(SCENE, np.array([0.25]), 3.0)
    assert len(runs) == 2 and runs[1][0].tolist() == [0.0, 0.25, 0.5, 0.75]


def test_second_runs_differ_from_the_first_ones():
    """Another order, fewer points and other rows; within 20 s, of which each run of A has two fifths."""
    assert reference.SECONDS == 20.0 and reference.SHARE == 0.4
    assert reference.SECOND_RUN_ORDER == 24 != taylor.ORDER == 28
    assert reference.SECOND_RUN_NODES == 1.8 < tree.NODES_PER_DIGIT == 2.1 and reference.SECOND_RUN_SEED == 1
    assert 32 * EXTENDED.eps == reference.CONSISTENT
