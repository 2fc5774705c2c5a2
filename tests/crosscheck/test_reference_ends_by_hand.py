"""Ends of the judge's computations / motions that end, samples at the ends of steps, and bounds."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.judge.arithmetic import DOUBLE
from crosscheck.judge.reference import (
    bound,
    expansion,
    isostatic,
    panels,
    stiff_panels,
    taylor,
    tree,
)
from crosscheck.judge.reference.motion import OVER
from crosscheck.judge.reference.panels import Panels
from crosscheck.judge.reference.stiff_panels import StiffPanels
from crosscheck.judge.reference.taylor import Stepper, natural_motion
from crosscheck.judge.reference.tree import _Run, tree_motion
from crosscheck.judge.small_motions import equations, equilibria
from crosscheck.judge.truth import picard
from mbref.scene import Body, Moment, Revolute, Scene

TURNING = Body(
    name="b",
    mass=2.0,
    inertia=(1.0, 1.0, 1.0),
    position=(3.0, 0.0, 0.0),
    velocity=(1.0, 0.0, 0.0),
    angular_velocity=(0.0, 0.0, 2.0),
)
FREE = Scene(name="free", body=(TURNING,), gravity=(0.0, -10.0, 0.0))
HINGE = Revolute(name="A", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
TIMES = np.array([0.0, 0.25, 0.5])


def by_a(scene: Scene, times: np.ndarray, **more: Any) -> Any:
    return natural_motion(scene, times, DOUBLE, order=12, **more)


def by_b(scene: Scene, times: np.ndarray, **more: Any) -> Any:
    return tree_motion(scene, times, DOUBLE, **{"seconds": np.inf, **more})


@pytest.mark.parametrize(("moved", "name"), [(by_a, "A"), (by_b, "B")])
def test_a_body_that_falls_and_turns(moved, name):
    """x = 3 + t, y = -5 t²; an angle 2 t about z."""
    seen: list[float] = []
    found = moved(FREE, TIMES, progress=seen.append)
    place = np.stack([3 + TIMES, -5 * TIMES**2, 0 * TIMES], axis=1)
    assert found.position[:, 0] == pytest.approx(place) and found.times.tolist() == TIMES.tolist()
    assert found.velocity[:, 0, 1] == pytest.approx(-10 * TIMES)
    assert found.acceleration[:, 0] == pytest.approx(np.tile([0.0, -10.0, 0.0], (3, 1)))
    angles = 2 * np.arctan2(found.orientation[:, 0, 3], found.orientation[:, 0, 0])
    assert angles == pytest.approx(2 * TIMES)
    assert found.angular_velocity[:, 0, 2] == pytest.approx([2.0] * 3)
    assert (found.reached, found.reason, found.crossings, found.formulation) == (0.5, "", (), name)
    assert found.steps == len(seen) > 0 and seen[-1] >= 0.5 and found.seconds > 0.0
    assert found.contradiction == (0.0 if name == "B" else pytest.approx(0.0, abs=1e-14))


@pytest.mark.parametrize("moved", [by_a, by_b])
def test_a_motion_without_time_ends_at_once(moved):
    found = moved(FREE, TIMES, seconds=-1.0)
    assert (found.reason, found.reached, found.steps) == (OVER, 0.0, 0)
    assert found.position.shape == (0, 1, 3) and found.times.shape == (0,)
    nothing = moved(FREE, np.zeros(0))
    assert (nothing.reason, nothing.reached, nothing.position.shape) == ("", 0.0, (0, 1, 3))


def test_a_motion_whose_steps_end_has_reached_a_time(monkeypatch):
    """The third step cannot be made; the second one ends at 0.5 s."""
    steps = iter([0.25, 0.25])
    before = Stepper._step

    def step(self: Stepper, most: float, left: float) -> Any:
        try:
            return before(self, most, left)[0], next(steps)
        except StopIteration:
            raise taylor.Ended("no further") from None

    monkeypatch.setattr(Stepper, "_step", step)
    found = by_a(FREE, np.array([0.25, 0.5, 0.75]))
    assert (found.reason, found.reached, found.steps) == ("no further", 0.5, 2)
    assert found.times.tolist() == [0.25, 0.5] and found.position[:, 0, 0] == pytest.approx([3.25, 3.5])


@pytest.mark.parametrize(
    ("left", "counts", "steps"),
    [(9.0, [1, 2], [(1.5, 9.0), (0.5, 8.5)]), (0.5, [0, 2], [(0.5, 0.5), (0.5, 98.5)])],
)
def test_a_sample_at_the_end_of_a_step_belongs_to_it(monkeypatch, left, counts, steps):
    """Steps of 0.5 s; at the end of a piece of a function of time the sample belongs to the next piece."""
    made = object.__new__(Stepper)
    number = SimpleNamespace(number=float, settled=lambda x: x)
    made.of, made._x, made.t, made.steps = SimpleNamespace(arithmetic=number, scene=None), None, 0.0, 0
    yielded, seen = [], []
    made._choice = lambda x, t: (None, 0)
    made._sharp = lambda x, t: 1.0
    made._refuse_undetermined = made._start = lambda: None
    made._refuse_singular_start = lambda series, d: None
    asked: list[Any] = []
    made._step = lambda *most: asked.append(most) or (SimpleNamespace(x=np.ones((9, 1))), 0.5)

    def advance(expansion_: Any, series: np.ndarray, h: float) -> None:
        made.t, made.steps = made.t + h, made.steps + 1

    made._advance = advance
    monkeypatch.setattr(taylor, "Series", lambda x: SimpleNamespace(terms=lambda h: 3))
    monkeypatch.setattr(taylor, "next_end", lambda scene, t: left if t < left else 99.0)
    for _ in made.samples([0.5, 0.75], lambda t: seen.append(len(yielded))):
        yielded.append(made.t)
    assert seen == counts and asked == steps, "twice the time to the last sample, and the time in the piece"


# --- bounds -----------------------------------------------------------------------------------------------
def test_bounds_and_rounding_to_their_last_digits():
    found = bound.bounds(np.array([1e-16, 3e-15, 1e-15, 2e-3]))
    assert found == pytest.approx([1e-14, 3e-14, 3e-14, 2e-2], rel=1e-9, abs=0.0)
    far = SimpleNamespace(position=np.array([[[3.0, 0.0, 4.0], [1.0, 0.0, 0.0]], [[0.1, 0.0, 0.0]] * 2]))
    eps = np.finfo(float).eps / bound.scene_length(FREE)
    assert bound.rounding(FREE, far) == pytest.approx([5 * eps, 0.1 * eps], rel=1e-9, abs=0.0)


def test_differences_below_one_unit():
    """1e-13 m over the scene's length, and no angle; two samples of three are common."""
    still = np.tile([1.0, 0.0, 0.0, 0.0], (3, 2, 1))
    one = SimpleNamespace(times=np.arange(3.0), position=np.zeros((3, 2, 3)), orientation=still)
    two = SimpleNamespace(times=np.arange(2.0), position=np.zeros((2, 2, 3)), orientation=still[:2])
    two.position[1, 1, 2] = 1e-13
    length = bound.scene_length(FREE)
    found = bound.differences(FREE, one, two)
    assert found == pytest.approx([0.0, 1e-13 / length], rel=1e-9, abs=0.0)
    turned = np.array([[[math.cos(1e-9), 0.0, math.sin(1e-9), 0.0]]])
    assert bound._angles(still[:1, :1], turned)[0] == pytest.approx([2e-9], rel=1e-6, abs=0.0)


# --- interruptions ----------------------------------------------------------------------------------------
class Stopped(Exception):
    """The computation asks whether its time is up."""


DOOR = FREE.with_(
    body=(TURNING.model_copy(update={"velocity": None, "angular_velocity": None}),),
    joint=(HINGE, HINGE.model_copy(update={"name": "B", "anchor": (0.0, 0.0, 1.0)})),
    load=(Moment(body="b", moment=(0.0, 0.0, 1.0)),),
)
PANELS = Panels(DOUBLE, 8)


class Still:
    light = 0

    def light_rates(self, y: np.ndarray) -> np.ndarray:
        return y[:, :0]

    def other_rates(self, t: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return 0 * y, np.ones(len(y))

    def in_doubles(self) -> Still:
        return self


def of_stiff_panel() -> Any:
    solver = StiffPanels(PANELS)
    solver._factorised = lambda *_: None
    solver._solved = lambda factors, residual: residual
    return solver.panel(Still(), 0.0, 1.0, np.ones((8, 1)))


def of_balance(**parts: Any) -> Any:
    return SimpleNamespace(
        equations=SimpleNamespace(nv=1, closed=lambda t, y: y, gap=lambda t, y: 0.0),
        now=np.zeros(1),
        sizes=np.ones(1),
        unbalanced=lambda y: np.zeros(1),
        **parts,
    )


ASKED = {
    "an order of a series": (expansion, lambda: by_a(FREE, TIMES)),
    "conditioning": (taylor, lambda: Stepper._sharp(object.__new__(Stepper), None, 0.0)),
    "a panel": (panels, lambda: PANELS.panel(Still(), 0.0, 1.0, np.ones((8, 1)))),
    "a stiff panel": (stiff_panels, of_stiff_panel),
    "rates of many states": (
        stiff_panels,
        lambda: stiff_panels._rates(Still(), np.zeros(2), np.ones((1, 2, 1))),
    ),
    "a start": (tree, lambda: _Run.through(object.__new__(_Run), lambda t: None)),
    "weaker joints": (isostatic, lambda: isostatic.isostatic(DOOR)),
    "a panel of a truth": (picard, lambda: picard.Solution(lambda y: y, np.ones(1), 0.1)._sweep(0.1)),
    "a random start": (
        equilibria,
        lambda: list(equilibria._starts(of_balance(), np.zeros(1), 2)),
    ),
    "a start along the constraints": (
        equilibria,
        lambda: list(equilibria._along(of_balance(), np.zeros(1), np.ones(1))),
    ),
    "a step to a balance": (equilibria, lambda: equilibria._settled(of_balance(), np.zeros(1), 1.0)),
    "a closing of loops": (equations, lambda: equations.Balance.closed(of_balance(), np.zeros(1))),
}


@pytest.mark.parametrize("name", ASKED)
def test_long_computations_ask_for_the_limit_of_time(monkeypatch, name):
    module, work = ASKED[name]

    def ask() -> None:
        raise Stopped

    monkeypatch.setattr(module, "ask", ask)
    with pytest.raises(Stopped):
        work()


@pytest.mark.parametrize("module", [taylor, tree])
def test_each_step_of_a_motion_asks_for_the_limit_of_time(monkeypatch, module):
    """Two questions at most come before the first step."""
    left = iter([None] * 2)

    def ask() -> None:
        if next(left, "no") == "no":
            raise Stopped

    monkeypatch.setattr(module, "ask", ask)
    monkeypatch.setattr(Stepper, "_sharp", lambda self, x, t: 1.0)
    moved = by_a if module is taylor else by_b
    with pytest.raises(Stopped):
        moved(FREE, np.array([0.0, 50.0]))
