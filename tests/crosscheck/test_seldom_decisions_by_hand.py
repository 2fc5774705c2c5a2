"""Decisions that few runs come to / numbers exactly at a limit, short steps, motors of the second joint."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.engines.compiled import dop853
from crosscheck.judge import gauss_motion
from crosscheck.judge.arithmetic import DOUBLE
from crosscheck.judge.reference import certify, start_velocities, taylor
from crosscheck.judge.truth.one_dof import _fits
from crosscheck.small_motions import records
from mbref.scene import Body, Scene

BLOCK = Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0))
SCENE = Scene(name="s", body=(BLOCK,), duration=1.0)


@pytest.mark.parametrize("spare", [6, 12])
def test_formulations_that_agree_exactly_to_the_digits(monkeypatch, spare):
    """The second attempt has 12 spare digits; rates agree to SAFETY times their largest difference."""
    moving = SimpleNamespace(velocity=np.array([1.0]), angular_velocity=np.array([2.0]))
    other = SimpleNamespace(velocity=np.array([1.5]), angular_velocity=np.array([2.25]))
    apart = {6: 1e-3 if spare == 6 else 2e-3, 12: 1e-3}
    asked: list[int] = []

    def motions(scene: Scene, times: Any, digits: int, more: int, shown: Any) -> Any:
        asked.append(more)
        return "moved", moving, other

    monkeypatch.setattr(certify, "_motions", motions)
    monkeypatch.setattr(certify, "SAFETY", 1.0)
    monkeypatch.setattr(certify, "differences", lambda *_: np.array([0.0, apart[asked[-1]]]))
    monkeypatch.setattr(certify, "_apart", lambda a, b: float(np.abs(a - b).max()))
    monkeypatch.setattr(certify, "_table", lambda scene, *parts: {"parts": parts})
    nothing: Any = None
    found = certify._agreed(SCENE, np.zeros(1), 3, nothing)["parts"]
    assert found == ("moved", moving, 3, (1e-3, 0.5)) and asked == ([6] if spare == 6 else [6, 12])
    apart.update({6: 2e-3, 12: 2e-3})
    with pytest.raises(certify.NotCertified, match=r"^s: the formulations agree to 2e-03 only$"):
        certify._agreed(SCENE, np.zeros(1), 3, nothing)


@pytest.mark.parametrize("part", ["position", "rotation"])
def test_a_path_that_is_not_finite_is_no_path(part):
    def poses(turned: Any) -> Any:
        place, turn = np.zeros((len(turned), 1, 3)), np.tile(np.eye(3), (len(turned), 1, 1, 1))
        {"position": place, "rotation": turn}[part][-1] = np.nan
        return SimpleNamespace(position=place, rotation=turn)

    asked: Any = SimpleNamespace(poses=poses)
    assert _fits(SCENE, asked) is False


@pytest.mark.parametrize(
    ("time", "start", "count", "ends"),
    [(0.0, 1e-7, 30, False), (0.0, 1.2e-12, 2, True), (2.0, 2.4e-9, 2, True), (2.0, 2.4e-9, 1, False)],
)
def test_a_step_before_a_singular_position_is_shortened(time, start, count, ends):
    """By 0.8 each time, to 1e-9 of the time that has passed, which counts as at least 1 ms."""
    ahead = iter([*[0.1] * (count - 1), 0.9])
    asked: Any = SimpleNamespace(
        t=time, _x=None, _conditioning=[1.0], _sharp=lambda x, t: 1.0, _ahead=lambda x, series, h: next(ahead)
    )
    series: Any = None
    if ends:
        with pytest.raises(taylor.Ended):
            taylor.Stepper._shortened(asked, np.zeros(1), series, start, 0.1)
    else:
        found = taylor.Stepper._shortened(asked, np.zeros(1), series, start, 0.1)
        assert found == pytest.approx(start * 0.8**count, rel=1e-12)


def test_every_motion_is_free_without_rows():
    found = start_velocities.null_space(DOUBLE, np.zeros((2, 3)))
    assert found.shape == (3, 3) and np.abs(found.T @ found) == pytest.approx(np.eye(3))


def test_a_search_has_the_given_number_of_starts(monkeypatch):
    asked: list[Any] = []
    monkeypatch.setattr(records, "steady_poses", lambda *given: asked.append(given) or [])
    monkeypatch.setattr(records, "search", asked.append)
    said: list[str] = []
    assert records.measured(SCENE, (), (), 7, said.append) == [] and asked == [(SCENE, 7), SCENE]
    assert said == ["the judge's search", "mbref's search"]


def test_an_integration_that_ends_early_is_an_error(monkeypatch):
    ended = SimpleNamespace(success=False, message="the step is too small", y=np.zeros((13, 1)))
    monkeypatch.setattr(gauss_motion, "solve_ivp", lambda *_, **__: ended)
    with pytest.raises(RuntimeError, match=r"^s: the step is too small$"):
        gauss_motion._samples(SCENE, np.array([0.5]), np.zeros(13), 1e-10, 0)


@pytest.mark.parametrize("ratio", [-1.0, 0.5])
def test_the_best_step_is_made_again_where_one_succeeds(monkeypatch, ratio):
    asked: list[float] = []
    monkeypatch.setattr(dop853, "attempt", lambda system, h, memory: asked.append(h) or ratio)
    memory: Any = SimpleNamespace(counts=np.zeros(8))
    best = dop853.jump(SimpleNamespace(shortest=1e-3), 1.0, memory)
    assert memory.counts[dop853.REJECTED] == dop853.JUMPS
    if ratio < 0:
        assert best == 0.0 and len(asked) == dop853.JUMPS
    else:
        assert best == 1e-3 and len(asked) == dop853.JUMPS + 1 and asked[-1] == best


@pytest.mark.parametrize(("place", "least", "found"), [(0.8, 0.0, 0.8), (0.8, 0.2, 0.0), (5.0, 0.0, 0.0)])
def test_the_place_of_a_singular_position_after_equal_values(place, least, found):
    """The conditioning is 0.5 at first, and then the distance from the place, if that is within the step."""
    asked: Any = SimpleNamespace(
        _tolerance=1e-16,
        _conditioning=[1.0],
        _ahead=lambda x, series, h: max(least, min(0.5, abs(h - place))),
    )
    series: Any = SimpleNamespace(reach=lambda tolerance: 1.2)
    assert taylor.Stepper._crossing(asked, np.zeros(1), series, 1.0) == pytest.approx(found, abs=1e-3)
