"""Records of truths / references and closed forms that end early, or at their start, worked out by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from crosscheck.judge.reference.reference import NoReference, Reference
from crosscheck.judge.truth import NoSolution
from crosscheck.study import truths
from mbref.scene import Body, Scene
from mbref.trajectory import Trajectory

SCENE = Scene(
    name="s",
    body=(Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0)),),
    duration=2.0,
)


def part(times: list[float], bound: float, both: list[bool]) -> Reference:
    k = len(times)
    vectors = [np.zeros((k, 1, 3)) for _ in range(5)]
    turned = np.tile([1.0, 0.0, 0.0, 0.0], (k, 1, 1))
    bounds = np.linspace(bound / 2, bound, k)
    return Reference(
        np.array(times), vectors[0], turned, *vectors[1:], bound=bounds, both=np.array(both), seconds=3.0
    )


def known(monkeypatch: pytest.MonkeyPatch, found: Reference | NoReference, given: float = 20.0) -> dict:
    monkeypatch.setattr(truths, "closed_form", lambda scene: None)
    monkeypatch.setattr(truths, "reference", lambda scene, times, seconds: found)
    return dict(truths.known_at(SCENE, np.array([0.0, 1.0, 2.0]), given))


def test_a_reference_to_the_end(monkeypatch):
    """The largest of its bounds, and no reason."""
    found = known(monkeypatch, part([0.0, 1.0, 2.0], 4e-13, [True, True, True]))
    motion = found.pop("motion")
    assert found == {
        "kind": "reference",
        "bound": 4e-13,
        "both": True,
        "reason": "",
        "until": 2.0,
        "seconds": 3.0,
    }
    assert motion["times"][0] == 0.0 and list(motion["bodies"]) == ["b"]


def test_a_reference_that_ends_early_and_one_of_a_single_formulation(monkeypatch):
    ended = NoReference("the time is over, at t = 1 s", 1.0, part([0.0, 1.0], 1e-12, [True, False]))
    found = known(monkeypatch, ended)
    assert (found["kind"], found["until"], found["both"]) == ("reference", 1.0, False)
    assert found["reason"] == "the time is over, at t = 1 s" and found["bound"] == 1e-12


@pytest.mark.parametrize("times", [[], [0.0]])
def test_a_reference_of_the_start_alone_is_none(monkeypatch, times):
    nothing = part(times, 1e-14, [True] * len(times))
    assert known(monkeypatch, NoReference("singular", 0.0, nothing)) == {
        "kind": "",
        "bound": None,
        "reason": "singular",
        "until": 0.0,
        "both": False,
        "motion": None,
    }


def test_no_time_no_reference(monkeypatch):
    found = known(monkeypatch, part([0.0, 2.0], 1e-13, [True, True]), given=0.0)
    assert (found["kind"], found["reason"]) == ("", "no reference was requested")


class Family:
    """A closed form of a body that turns about z at 6.99 rad/s, known up to a time."""

    name, accuracy = "turning", 1e-12

    def __init__(self, until: float):
        self.until = until

    def poses(self, times: np.ndarray) -> Trajectory:
        if times.max(initial=0.0) > self.until:
            raise NoSolution("it locks", self.until)
        k = len(times)
        spin = np.zeros((k, 1, 3))
        spin[..., 2] = 6.99
        still = np.zeros((k, 1, 3))
        turned = np.array([[[math.cos(3.495 * t), 0.0, 0.0, math.sin(3.495 * t)]] for t in times]).reshape(
            k, 1, 4
        )
        return Trajectory("s", "truth", "", "", {}, times, ("b",), still, turned, still, spin)


@pytest.mark.parametrize(("until", "end", "reason"), [(9.0, 2.0, ""), (1.0, 1.0, "it locks")])
def test_a_closed_form_as_far_as_it_is_known(until, end, reason):
    found = truths._of_family(SCENE, Family(until), np.array([0.0, 0.5, 1.0, 1.5, 2.0]))
    assert (found["kind"], found["bound"], found["until"], found["both"]) == ("turning", 1e-12, end, True)
    assert reason in found["reason"] and bool(reason) == bool(found["reason"])


def test_a_closed_form_of_the_start_alone_is_none():
    found = truths._of_family(SCENE, Family(0.0), np.array([0.0, 1.0]))
    assert found["kind"] == "" and "it locks" in found["reason"]


def test_frames_cover_the_motion_until_a_body_turns_too_far():
    """90 steps of 0.35 rad are 31.5 rad: at 6.99 rad/s until 4.5 s, at a tenth of it all."""
    times = np.linspace(0.0, 9.0, 901)
    fast = Family(9.0).poses(times)
    chosen = truths.shown(fast)
    assert (chosen[0], times[chosen[-1]], len(chosen)) == (0, pytest.approx(4.5), 91)
    slow = replace(fast, angular_velocity=fast.angular_velocity / 10)
    assert truths.shown(slow)[-1] == 900 and len(truths.shown(slow)) == 91
    few = Family(9.0).poses(times[:4])
    assert truths.shown(few).tolist() == [0, 1, 2, 3]
