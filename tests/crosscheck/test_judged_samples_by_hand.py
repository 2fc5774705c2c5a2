"""Judged samples of references, varied rows and starts of searches / draws and numbers worked out by hand."""

from __future__ import annotations

import math
from importlib import import_module
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.judge.arithmetic import DOUBLE
from crosscheck.judge.reference.taylor import PREFERENCE, Stepper
from crosscheck.judge.small_motions import equilibria
from crosscheck.judge.small_motions.equations import NotSteady
from mbref.scene import SceneError

reference = import_module("crosscheck.judge.reference.reference")
EPS = np.finfo(float).eps


# --- samples of two formulations --------------------------------------------------------------------------
def motion(count: int, seconds: float, reason: str = "", reached: float = 9.0) -> Any:
    """A motion whose arrays have another number at each sample, half a second apart."""
    arrays = {
        name: np.arange(3.0 * count).reshape(count, 1, 3) + 100 * k for k, name in enumerate(reference.FIELDS)
    }
    return SimpleNamespace(
        times=0.5 * np.arange(count), seconds=seconds, reason=reason, reached=reached, **arrays
    )


def judged(monkeypatch: Any, one: Any, second: Any, other: Any, *apart: list[float], count: int = 4) -> Any:
    """The judgement at some times; the differences to the second run and to the other motion are given."""
    found = iter(apart)

    def differences(scene: Any, a: Any, b: Any) -> np.ndarray:
        assert scene is None and a is one and b is not one
        return np.array(next(found))

    monkeypatch.setattr(reference, "differences", differences)
    monkeypatch.setattr(reference, "rounding", lambda scene, a: np.full(len(a.times), 2e-14))
    return reference.judged(None, 0.5 * np.arange(count), one, second, other)


def test_the_larger_difference_of_two_motions_bounds_the_error(monkeypatch):
    """Ten times the largest difference until then; the other formulation ends after two samples."""
    one = motion(4, 1.0)
    found, reason = judged(
        monkeypatch,
        one,
        motion(4, 2.0),
        motion(2, 4.0, "singular"),
        [1e-15, 1e-12, 3e-12, 2e-12],
        [5e-14, 2e-13],
    )
    assert found.bound == pytest.approx([5e-13, 1e-11, 3e-11, 3e-11], rel=1e-9, abs=0.0) and reason == ""
    assert found.both.tolist() == [True, True, False, False] and found.seconds == 7.0
    assert found.times.tolist() == [0.0, 0.5, 1.0, 1.5]
    for name in reference.FIELDS:
        assert (getattr(found, name) == getattr(one, name)).all(), name
    small, _ = judged(monkeypatch, one, motion(4, 1.0), motion(4, 1.0), [0.0] * 4, [1e-16] * 4)
    assert small.bound == pytest.approx([2e-14] * 4, rel=1e-9, abs=0.0), "the rounding of the positions"


def test_a_reference_ends_where_motions_part(monkeypatch):
    """A bound of 1e-6 is useful, a larger one is not."""
    found, reason = judged(
        monkeypatch, motion(4, 1.0), motion(4, 2.0), motion(4, 4.0), [0.0, 1e-9, 1e-7, 3e-7], [1e-8] * 4
    )
    assert reason == "independent motions of it differ by 3e-07 at t = 1.5 s"
    assert len(found.times) == len(found.position) == len(found.both) == 3
    assert found.bound == pytest.approx([1e-7, 1e-7, 1e-6])


@pytest.mark.parametrize(
    ("counts", "says"),
    [
        ((3, 3, 3), "the first ends, at t = 1.25 s"),
        ((4, 3, 2), "the second ends, at t = 1.375 s"),
        ((3, 2, 2), "the first ends, at t = 1.25 s"),
        ((4, 4, 2), ""),
        ((4, 2, 4), ""),
    ],
)
def test_the_reason_for_which_a_reference_ends(monkeypatch, counts, says):
    """The longer of the second run and of the other formulation counts."""
    one, second = (
        motion(counts[0], 1.0, "the first ends", 1.25),
        motion(counts[1], 1.0, "the second ends", 1.375),
    )
    other = motion(counts[2], 1.0, "the other ends", 1.0)
    found, reason = judged(monkeypatch, one, second, other, [1e-15] * counts[1], [1e-15] * counts[2])
    assert reason == says and len(found.times) == max(counts[1:])


# --- rows of the second run -------------------------------------------------------------------------------
@pytest.mark.parametrize(("seed", "displaced"), [(1, 1e-3), (5, 0.5)])
def test_second_runs_displace_joints_and_prefer_other_rows(seed, displaced):
    """Rows from the thirteenth on are preferred; the largest coordinate, 4, scales the displacement."""
    asked: list[str] = []
    c = np.arange(17.0)
    made: Any = object.__new__(Stepper)
    made._x = np.array([[1.0, -4.0, 2.0]] * 3)
    made.of = SimpleNamespace(
        count=7, c=c, nb=2, arithmetic=DOUBLE, take_right_angles=lambda: asked.append("right")
    )
    weights = made._varied(seed, displaced)
    draws = np.random.default_rng(seed)
    moved = 2 * draws.random(5) - 1
    assert c == pytest.approx(
        np.arange(17.0) + np.concatenate([np.zeros(12), displaced * 4.0 * moved]), rel=1e-14
    )
    assert weights == pytest.approx(1 + 0.2 * draws.random(7)) and asked == ["right"] and PREFERENCE == 0.2
    again = c.copy()
    assert made._varied(0, displaced).tolist() == [1.0] * 7 and (c == again).all() and asked == ["right"]


# --- starts of a search -----------------------------------------------------------------------------------
def balance(**parts: Any) -> Any:
    """Equations of three joint rates whose poses move as they are asked to."""
    made = {
        "equations": SimpleNamespace(nv=3),
        "sizes": np.array([1.0, 2.0, 0.5]),
        "moved": lambda y, step: y[None] + step,
        "closed": lambda y: y,
        "steady": lambda y: y,
        **parts,
    }
    return SimpleNamespace(**made)


def test_random_starts_of_a_search(monkeypatch):
    """Displacements up to 3 and up to half a radian or length in turn, in all directions."""
    ways: list[np.ndarray] = []
    monkeypatch.setattr(
        equilibria, "_along", lambda balance, y, direction: iter([ways.append(direction) or y + direction])
    )
    first = np.array([5.0, 6.0, 7.0])
    found = list(equilibria._starts(balance(), first, 5))
    draws = 2 * np.random.default_rng(20).random((5, 3)) - 1
    assert ways == [pytest.approx(draws[0]), pytest.approx(-draws[0])]
    wanted = [first, first + draws[0], first - draws[0]]
    wanted += [
        first + size * np.array([1.0, 2.0, 0.5]) * draw
        for size, draw in zip((3, 0.5, 3, 0.5), draws[1:], strict=True)
    ]
    assert np.array(found) == pytest.approx(np.array(wanted))
    assert [y.tolist() for y in equilibria._starts(balance(), first, 1)] == [first.tolist()]

    def closed(y: np.ndarray) -> np.ndarray:
        if y[0] < first[0]:
            raise NotSteady("open")
        return y

    fewer = list(equilibria._starts(balance(closed=closed), first, 5))
    assert np.array(fewer) == pytest.approx(np.array([*wanted[:3], *(y for y in wanted[3:] if y[0] >= 5.0)]))


def test_starts_along_the_constraints():
    """Six strides of 0.4 along the direction that a row q₀ = const allows, in units of lengths."""
    rows = balance(at=lambda y: y, basis=lambda at: np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 0.5]]))
    y = np.array([1.0, 2.0, 3.0])
    found = list(equilibria._along(rows, y, np.array([9.0, 0.6, 0.8])))
    steps = np.arange(1, 7)[:, None] * 0.4 * np.array([0.0, 0.6 * 2.0, 0.8 * 0.5])
    assert np.array(found) == pytest.approx(y + steps)
    assert np.array(list(equilibria._along(rows, y, np.array([7.0, 15.0, 20.0])))) == pytest.approx(
        np.array(found)
    )
    still = list(equilibria._along(rows, y, np.array([9.0, 0.0, 0.0])))
    assert np.array(still) == pytest.approx(np.tile(y, (6, 1))), "a direction that the rows forbid"
    left = iter([None, None])

    def closed(y: np.ndarray) -> np.ndarray:
        if next(left, "end") == "end":
            raise NotSteady("open")
        return y

    assert (
        len(list(equilibria._along(SimpleNamespace(**{**vars(rows), "closed": closed}), y, np.ones(3)))) == 2
    )


def test_the_scale_of_forces_at_some_poses():
    """Forces times sizes: 3 · 2 at the first pose, 8 · 0.5 at the second."""
    made = balance(at=lambda y: y, forces=lambda at: at)
    poses = [np.array([1.0, -3.0, 2.0]), np.array([-2.0, 1.0, 8.0])]
    assert equilibria._scale(made, poses) == 6.0 and equilibria._scale(made, poses[1:]) == 4.0
    assert equilibria._scale(made, []) == 0.0


# --- searches ---------------------------------------------------------------------------------------------
class Hill:
    """One coordinate with the unbalanced force k (y - 1); steps are asked of it."""

    arithmetic = DOUBLE
    sizes = np.ones(1)

    def __init__(self, k: float = 2.0, force: Any = None) -> None:
        self.k, self.steps, self.force = k, [], force or (lambda y: k * (y - 1.0))

    def unbalanced(self, y: np.ndarray) -> np.ndarray:
        return np.asarray(self.force(y), dtype=float)

    def at(self, y: np.ndarray) -> np.ndarray:
        return y[0]

    def forces(self, at: np.ndarray) -> np.ndarray:
        return np.array([self.unbalanced(at)])

    def basis(self, at: np.ndarray) -> np.ndarray:
        return np.eye(1)

    def stiffness(self, y: np.ndarray, basis: np.ndarray, h: float, order: int = 8) -> np.ndarray:
        self.asked = h, order
        return np.array([[-self.k]])

    def moved(self, y: np.ndarray, step: np.ndarray) -> np.ndarray:
        self.steps.append(float(step[0, 0]))
        return y[None] + step

    def closed(self, y: np.ndarray) -> np.ndarray:
        return y

    steady = closed


def test_newton_steps_to_a_balance():
    """From 1.3 one step of -0.3; from 2 the longest step of 0.4 twice, then the rest."""
    near, far = Hill(), Hill()
    assert equilibria._settled(near, np.array([1.3]), 1.0) == pytest.approx([1.0])
    assert near.steps == pytest.approx([-0.3]) and near.asked == (pytest.approx(2e-4), 2)
    assert equilibria._settled(far, np.array([2.0]), 1.0) == pytest.approx([1.0])
    assert far.steps == pytest.approx([-0.4, -0.4, -0.2])
    there = Hill()
    assert (
        equilibria._settled(there, np.array([1.0 + 4e-11]), 1.0) == pytest.approx([1.0]) and not there.steps
    )
    assert equilibria._settled(Hill(), np.array([1.0 + 6e-11]), 1.0) is not None
    assert Hill().steps == []


def test_the_limit_of_a_balance_is_relative_to_the_scale():
    """A force of 1e-10 of the scale is balanced; a force above is not."""
    exact = Hill(force=lambda y: np.array([2e-10]))
    assert equilibria._settled(exact, np.array([7.0]), 2.0).tolist() == [7.0] and not exact.steps
    above = Hill(force=lambda y: np.array([2.1e-10]))
    assert equilibria._settled(above, np.array([7.0]), 2.0) is None and above.steps


def test_a_search_without_a_better_pose_ends_by_its_damping():
    """Damping 0, 1e-3, 1e-2 to 1e6: steps f / k / (1 + damping), with ten times the damping each time."""
    made = Hill(k=2.0, force=lambda y: np.array([0.2]))
    assert equilibria._settled(made, np.array([0.0]), 1.0) is None
    damping = [0.0, *(10.0**k for k in range(-3, 7))]
    assert made.steps == pytest.approx([-0.1 / (1 + d) for d in damping])


def test_damping_becomes_less_after_a_better_pose():
    """The first step is too long; after the second one, with a damping of 1e-3, it is 1e-4."""
    sizes = iter([0.2, 0.3, 0.1, 0.05, 0.0])
    made = Hill(k=1.0, force=lambda y: np.array([next(sizes)]))
    assert equilibria._settled(made, np.array([0.0]), 1.0) is not None
    assert made.steps == pytest.approx([-0.2, -0.2 / 1.001, -0.1 / 1.0001, -0.05 / 1.00001])


def test_a_vanishing_stiffness_follows_the_force():
    for force in (0.5, -5.0):
        flat = Hill(k=0.0, force=lambda y, force=force: np.array([force]) if y[0] == 0.0 else np.zeros(1))
        assert equilibria._settled(flat, np.array([0.0]), 1.0) == pytest.approx([math.copysign(0.4, force)])
        assert flat.steps == pytest.approx([math.copysign(0.4, force)]), "the longest step, along the force"


def test_a_step_along_one_of_two_freedoms():
    """The force and the step have one part that is zero; a step of (0.3, 0.4) is the longest one."""

    class Plane(Hill):
        def basis(self, at: np.ndarray) -> np.ndarray:
            return np.eye(2)

        def stiffness(self, y: np.ndarray, basis: np.ndarray, h: float, order: int = 8) -> np.ndarray:
            return np.diag([-2.0, -4.0])

        def moved(self, y: np.ndarray, step: np.ndarray) -> np.ndarray:
            self.steps.append(step[0].tolist())
            return y[None] + step

    made = Plane(force=lambda y: np.array([2.0, 4.0]) * (y - 1.0))
    assert equilibria._settled(made, np.array([1.2, 1.0]), 1.0) == pytest.approx([1.0, 1.0])
    assert np.array(made.steps) == pytest.approx(np.array([[-0.2, 0.0]]))
    made.steps.clear()
    equilibria._settled(made, np.array([4.0, 5.0]), 1.0)
    assert made.steps[0] == pytest.approx([-0.24, -0.32])


@pytest.mark.parametrize("error", [NotSteady("open"), np.linalg.LinAlgError()])
def test_a_step_without_a_pose_is_damped(error):
    class Broken(Hill):
        def steady(self, y: np.ndarray) -> np.ndarray:
            if len(self.steps) == 1:
                raise error
            return y

    made = Broken(k=1.0)
    made.force = lambda y: y - 1.0
    assert equilibria._settled(made, np.array([1.2]), 1.0) == pytest.approx([1.0])
    assert made.steps[:2] == pytest.approx([-0.2, -0.2 / 1.001])


def test_another_number_of_freedoms_is_no_better_pose():
    made = Hill(k=1.0)
    made.force = lambda y: np.array([0.3]) if not made.steps else np.zeros(2)
    assert equilibria._settled(made, np.array([0.0]), 1.0) is None and len(made.steps) == 11


def test_sixty_steps_at_most():
    """The force becomes one percent less at each step."""
    sizes = iter(0.3 * 0.99**k for k in range(200))
    made = Hill(k=1.0, force=lambda y: np.array([next(sizes)]))
    assert equilibria._settled(made, np.array([0.0]), 1.0) is None and len(made.steps) == 60


# --- all poses of a scene ---------------------------------------------------------------------------------
def searched(monkeypatch: Any, poses: list[float], freedoms: int = 1) -> list[Any]:
    """Stand-ins for a search: a start settles at its whole part, -1 is unsettled, 3 is not steady."""
    asked: list[Any] = []

    def start() -> np.ndarray:
        if not poses:
            raise NotSteady("the loops do not close")
        return np.array([poses[0]])

    def made(scene: Any, motion: Any) -> Any:
        asked.append((scene.name, motion))
        return SimpleNamespace(start=start, at=lambda y: y, basis=lambda at: np.zeros((2, freedoms)))

    def starts(quick: Any, first: np.ndarray, count: int) -> Any:
        asked.append((quick, first.tolist(), count))
        return iter([np.array([pose]) for pose in poses])

    monkeypatch.setattr(equilibria, "turning", lambda scene: "motion")
    monkeypatch.setattr(equilibria, "Balance", made)
    monkeypatch.setattr(equilibria, "in_doubles", lambda balance: "quick")
    monkeypatch.setattr(equilibria, "_starts", starts)
    monkeypatch.setattr(equilibria, "_scale", lambda quick, poses: len(poses) if quick == "quick" else None)
    monkeypatch.setattr(
        equilibria,
        "_settled",
        lambda quick, pose, scale: None if pose[0] < 0 else asked.append(scale) or int(pose[0]),
    )
    monkeypatch.setattr(equilibria, "_is_same", lambda quick, settled, other: settled == other[0])
    monkeypatch.setattr(
        equilibria,
        "_steady",
        lambda balance, settled, scale: (settled, scale) if settled != 3 and balance != "quick" else None,
    )
    return asked


def test_each_steady_pose_is_found_once(monkeypatch):
    """The first start is the scene's own; others are left at a known pose, without an end or unsteady."""
    asked = searched(monkeypatch, [2.5, 1.25, -1.0, 2.0, 3.5, 4.0, 1.0])
    scene: Any = SimpleNamespace(name="s")
    assert equilibria.steady_poses(scene) == [(2, 7), (1, 7), (4, 7)]
    assert asked[:2] == [("s", "motion"), ("quick", [2.5], 16)] and asked[2:] == [7] * 6
    equilibria.steady_poses(scene, 3)
    assert asked[9] == ("quick", [2.5], 3)


def test_scenes_without_a_steady_pose(monkeypatch):
    searched(monkeypatch, [])
    with pytest.raises(SceneError, match="s: the loops do not close"):
        equilibria.steady_poses(SimpleNamespace(name="s"))
    searched(monkeypatch, [1.0], freedoms=0)
    with pytest.raises(SceneError, match="the mechanism has no degree of freedom, so it rests at any load"):
        equilibria.steady_poses(SimpleNamespace(name="s"))


# --- refined poses ----------------------------------------------------------------------------------------
def refined(monkeypatch: Any, **parts: Any) -> Any:
    """The refinement of a pose whose force is halved by each of its steps, and its decisions."""
    made = SimpleNamespace(
        arithmetic=DOUBLE, motion=SimpleNamespace(rate=0.0), steps=[], scene=None, asked=[], sure=0.5
    )
    small = SimpleNamespace(eigenvalues=lambda: np.array([1j, 4.0]))
    coarse = SimpleNamespace(eigenvalues=lambda: np.array([1j, 4.0 + 8e-3]))
    hill = Hill(k=1.0, force=lambda y: np.array([y[0] / 2]))
    for name in ("at", "forces", "basis", "moved"):
        setattr(made, name, getattr(hill, name))
    made.closed = made.steady = lambda y: y
    made.steps = hill.steps
    made.stiffness = lambda y, basis, h: made.asked.append(h) or np.array([[-1.0]])
    made.small = lambda y, h=equilibria.STEP: (
        made.asked.append(("small", h)) or (small if h == equilibria.STEP else coarse)
    )
    made.conditioning = lambda y: made.sure
    made.poses = lambda y: ("position", "orientation")
    made.__dict__.update(parts)
    monkeypatch.setattr(equilibria, "_is_assembled", lambda balance, y: True)
    return made


def test_a_pose_is_refined_by_whole_newton_steps(monkeypatch):
    """Each step takes half of the coordinate away; six steps at most, or until 1e-15 of the scale."""
    made = refined(monkeypatch)
    found = equilibria._steady(made, np.array([0.64]), 1.0)
    assert found is not None and found.state == pytest.approx([0.01]) and len(made.steps) == 6
    assert (found.position, found.orientation, found.balance) == ("position", "orientation", made)
    assert found.uncertainty == pytest.approx(2e-3) and found.eigenvalues.tolist() == [1j, 4.0]
    assert made.asked == [0.02] * 6 + [("small", 0.02), ("small", 0.04)]
    made = refined(monkeypatch)
    assert equilibria._steady(made, np.array([4e-15]), 1.0).state == pytest.approx([2e-15], abs=1e-20)
    assert len(made.steps) == 1, "a force of 1e-15 is balanced"
    made = refined(monkeypatch, small=lambda y, h=0.02: SimpleNamespace(eigenvalues=lambda: np.zeros(2)))
    assert equilibria._steady(made, np.zeros(1), 1.0).uncertainty == 4e-16


def test_poses_that_are_no_steady_poses(monkeypatch):
    """Singular ones, with a conditioning below a thousandth, and ones that change with the rotation."""
    assert equilibria._steady(refined(monkeypatch, sure=1e-3), np.zeros(1), 1.0) is not None
    assert equilibria._steady(refined(monkeypatch, sure=0.99e-3), np.zeros(1), 1.0) is None
    for stays in (True, False):
        monkeypatch.setattr(
            equilibria,
            "_stays",
            lambda made, y, small, stays=stays: stays and len(y) == 1 and len(small.eigenvalues()) == 2,
        )
        turning = refined(monkeypatch, motion=SimpleNamespace(rate=2.0))
        assert (equilibria._steady(turning, np.zeros(1), 1.0) is not None) is stays
        assert equilibria._steady(refined(monkeypatch), np.zeros(1), 1.0) is not None, "at rest"
    made = refined(monkeypatch)
    monkeypatch.setattr(equilibria, "_is_assembled", lambda balance, y: False)
    assert equilibria._steady(made, np.zeros(1), 1.0) is None


@pytest.mark.parametrize(("gap", "is_assembled"), [(0.9e-8, True), (1e-8, False), (math.inf, False)])
def test_joints_hold_at_assembled_poses(monkeypatch, gap, is_assembled):
    rows = {"A": np.array([0.0, -gap]), "B": np.zeros(0), "C": np.array([1e-9, 0.0])}
    monkeypatch.setattr(
        equilibria, "closure", lambda scene, t, p, q: rows if (t, p, q) == (0.0, 1, 2) else {}
    )
    made = SimpleNamespace(scene=None, poses=lambda y: (1, 2))
    assert equilibria._is_assembled(made, np.zeros(1)) is is_assembled
    rows.clear()
    assert equilibria._is_assembled(made, np.zeros(1))


@pytest.mark.parametrize(
    ("shift", "angle", "is_same"),
    [(1.9e-6, 0.0, True), (2.1e-6, 0.0, False), (0.0, 0.9e-6, True), (0.0, 1.1e-6, False)],
)
def test_poses_that_count_as_one(monkeypatch, shift, angle, is_same):
    """Up to a millionth of the length of 2 m, or of a radian; the second body is moved."""
    monkeypatch.setattr(equilibria, "scene_length", lambda scene: 2.0)
    still = np.tile([1.0, 0.0, 0.0, 0.0], (2, 1))
    position, orientation = np.zeros((2, 3)), still.copy()
    position[1, 2], orientation[1] = shift, [math.cos(angle / 2), 0.0, math.sin(angle / 2), 0.0]
    made = SimpleNamespace(scene=None, poses=lambda pose: (position, orientation))
    other: Any = SimpleNamespace(position=np.zeros((2, 3)), orientation=still)
    assert equilibria._is_same(made, np.zeros(1), other) is is_same
