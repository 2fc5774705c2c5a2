"""Corrected initial positions and decisions of structures / linear rows and answers worked out by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest

from mbref.equations import initial_state, reduction
from mbref.equations.active_coordinates import RandomStates
from mbref.equations.initial_state import Alike
from mbref.equations.reduction import Answers, Reduction, StructuralDecisions, _of_rounds
from mbref.scene import SceneError


# --- positions of linear rows -----------------------------------------------------------------------------
def alike(
    targets: Any, constant: float = 0.0, slope: float = 2.0, lengths: Any = None
) -> tuple[Alike, list[Any]]:
    """Scenes of one body with the rows slope (x - x₀) and y - y₀ + constant, and the places that were asked.

    A constant cannot be removed, since the second row then has no entry.
    """
    goals = np.array(targets, dtype=float)
    asked: list[Any] = []
    dense = np.zeros((2, 6))
    dense[0, 0], dense[1, 1] = slope, 0.0 if constant else 1.0

    def terms(places: np.ndarray, q: np.ndarray, v: np.ndarray) -> Any:
        asked.append(places.tolist())
        assert v.shape == (len(q), 6) and not v.any()
        goal = goals[places]
        second = np.full(len(q), constant) if constant else q[:, 1] - goal[:, 1]
        phi = np.column_stack([slope * (q[:, 0] - goal[:, 0]), second])
        return SimpleNamespace(
            phi=phi, blocks=np.zeros((len(q), 2, 12)), nu=np.zeros((len(q), 2)), jacobian=None
        )

    structure = SimpleNamespace(dense=lambda blocks: np.tile(dense, (len(blocks), 1, 1)))
    of: Any = SimpleNamespace(n=6, m=2, nb=1, row_joint=("first", "second"), structure=structure)
    count = len(goals)
    poses = np.tile([0.0, 0, 0, 1, 0, 0, 0], (count, 1))
    sizes = np.ones(count) if lengths is None else np.array(lengths)
    body: Any = SimpleNamespace(velocity=None, angular_velocity=None)
    made = Alike(of, poses, np.ones((count, 6)), sizes, [[body]] * count, terms, lambda k: of)
    return made, asked


def test_scenes_are_corrected_together_until_each_is_met():
    """The second scene needs no correction, the third is left since it is too far off."""
    scenes, asked = alike([(0.5, -0.25), (0.0, 0.0), (0.0, 3.0)])
    q, before, terms = initial_state._solved(scenes, scenes.poses, np.array([1.0, 1.0, 2.9]))
    assert q[:, :2].tolist() == [[0.5, -0.25], [0.0, 0.0], [0.0, 0.0]]
    assert before.tolist() == [[-1.0, 0.25], [0.0, 0.0], [0.0, -3.0]]
    assert terms.phi.tolist() == [[0.0, 0.0], [0.0, 0.0], [0.0, -3.0]]
    assert asked == [[0, 1, 2], [0], [0, 1, 2]] and scenes.poses[0, 0] == 0.0


def test_nothing_is_corrected_where_all_is_met():
    scenes, asked = alike([(0.0, 0.9e-14), (0.0, 0.0)])
    q, before, _ = initial_state._solved(scenes, scenes.poses, np.ones(2))
    assert asked == [[0, 1]] and not q[:, :2].any() and before[0, 1] == -0.9e-14
    far, asked = alike([(0.0, 1.0)])
    initial_state._solved(far, far.poses, np.ones(1))
    assert asked == [[0], [0], [0]], "a violation of just the largest size is corrected"
    initial_state._solved(far, far.poses, np.full(1, 0.99))
    assert len(asked) == 4, "a larger one is not"


@pytest.mark.parametrize(("moved", "tries"), [(1e-15, 2), (0.9e-15, 1)])
def test_positions_that_do_not_move_any_more(monkeypatch, moved, tries):
    """A scene whose change is less than 1e-15 is not tried again, whatever is left of its violation."""
    scenes, asked = alike([(0.0, 0.0)], constant=0.01)
    changes = iter([moved, 0.0, 0.0])
    monkeypatch.setattr(initial_state, "MOST_ITERATIONS", 2)

    def change(scenes: Any, places: Any, blocks: Any, rhs: Any) -> np.ndarray:
        assert np.abs(rhs - [0.0, -0.01]).max(initial=0.0) < 1e-14
        return np.full((len(places), 6), next(changes) if len(places) else 0.0)

    monkeypatch.setattr(initial_state, "_least_changes", change)
    initial_state._solved(scenes, scenes.poses, np.ones(1))
    assert [len(places) for places in asked[1:-1]] == [1] * (tries - 1) + [0]


def test_faults_of_positions_name_the_worst_row():
    """The limit is 5 % of 1 m or of a longer scene."""
    scenes, _ = alike([(0.0, 0.06), (0.0, 0.04), (0.0, 0.06), (0.031, 0.06)], lengths=[1.0, 1.0, 2.0, 0.1])
    q, first, faults, _ = initial_state._corrected(scenes, scenes.poses)
    assert sorted(faults) == [0, 3] and first == pytest.approx([0.06, 0.04, 0.06, 0.062])
    assert q[:, 1] == pytest.approx([0.0, 0.04, 0.06, 0.0])
    says = "positions given to bodies violate it by"
    assert f"joint[second]: {says} 0.06 m or rad" in str(faults[0])
    assert f"joint[first]: {says} 0.062 m or rad" in str(faults[3])


def test_positions_that_cannot_be_corrected():
    scenes, _ = alike([(0.02, 0.0)], constant=0.01)
    _, first, faults, _ = initial_state._corrected(scenes, scenes.poses)
    assert first[0] == pytest.approx(0.04)
    assert "joint[second]: no nearby positions satisfy it; 0.01 m or rad remain" in str(faults[0])
    scenes, _ = alike([(0.02, 0.0)], constant=0.9e-10)
    assert initial_state._corrected(scenes, scenes.poses)[2] == {}


def test_starts_at_rest_of_several_scenes():
    scenes, _ = alike([(0.01, 0.0), (9.0, 0.0)])
    good, bad = initial_state.consistent_starts(scenes)
    assert isinstance(good, initial_state.Start) and isinstance(bad, SceneError)
    assert good.q[0] == pytest.approx(0.01) and good.position_violation == pytest.approx(0.02)
    assert not good.v.any() and good.velocity_violation == 0.0 and not good.follows_branch


# --- decisions on structures ------------------------------------------------------------------------------
def test_answers_hold_where_one_state_of_a_round_has_them():
    """Two scenes, two rounds of two states, three properties."""
    found = np.zeros((2, 4, 3), dtype=bool)
    found[0, 0, 0] = found[0, 3, 1] = found[1, 2, 2] = True
    rounds = _of_rounds(found, 2)
    assert rounds.shape == (2, 2, 3) and rounds.sum() == 3
    assert rounds[0, 0, 0] and rounds[0, 1, 1] and rounds[1, 1, 2]
    assert _of_rounds(np.zeros((2, 0, 3), dtype=bool), 0).shape == (2, 0, 3)


def decisions() -> StructuralDecisions:
    made = object.__new__(StructuralDecisions)
    made._states = RandomStates(np.array([0.0, 0.25, 0.5]), np.zeros((3, 6)), np.arange(18.0).reshape(3, 6))
    made._states.displacement[1, 1] = 2.0
    return made


def test_states_about_the_starts_of_scenes():
    q = np.array([[1.0, 2, 3, 1, 0, 0, 0], [4.0, 5, 6, 0, 1, 0, 0]])
    v = np.array([[9.0] * 6, [8.0] * 6])
    part, places, velocities = decisions().states(q, v)
    assert part.tolist() == [0.0, 0.25, 0.5] and places.shape == (2, 3, 7) and velocities.shape == (2, 3, 6)
    for k in range(2):
        moved = q[k].copy()
        moved[1] += 2.0
        assert places[k].tolist() == [q[k].tolist(), moved.tolist(), q[k].tolist()]
        assert velocities[k].tolist() == [v[k].tolist(), [*range(6, 12)], [*range(12, 18)]]
    assert q[0].tolist() == [1.0, 2, 3, 1, 0, 0, 0]


@pytest.mark.parametrize("over_time", [None, "factor"])
def test_scenes_that_agree_with_the_first(monkeypatch, over_time):
    """Scene 1 has another decisive answer; scenes 2 and 3 act differently, of which 2 reaches the same."""
    made = decisions()
    first = Answers(
        np.array([[True, False]]), np.zeros((1, 1, 1, 12), bool), np.array([[[True, False, False]]])
    )
    made._found, made._reached = first, [b"same"]
    acting = np.repeat(first.acting, 4, axis=0)
    acting[2, 0, 1] = acting[3, 0, 2] = acting[1, 0, 2] = True
    decisive = np.array([[True, False], [True, True], [True, False], [True, False]])
    monkeypatch.setattr(
        StructuralDecisions, "_reach", lambda self, model, acting: [b"same" if acting[0, 1] else b"other"]
    )
    of: Any = SimpleNamespace(
        scene=SimpleNamespace(load=[SimpleNamespace(over_time=None), SimpleNamespace(over_time=over_time)])
    )
    found = made._agree(of, Answers(decisive, np.zeros((4, 1, 1, 12), bool), acting))
    assert found.tolist() == ([True, False, True, False] if over_time is None else [False] * 4)


class Kept(NamedTuple):
    kind: np.ndarray
    points: np.ndarray


@pytest.mark.parametrize("axis", [0, 1])
def test_primitives_without_an_entry_are_left_out(monkeypatch, axis):
    monkeypatch.setattr(reduction, "Primitives", Kept)

    class Data(NamedTuple):
        primitives: Kept
        other: int

    kind, points = np.arange(3), np.arange(6.0).reshape(3, 2)
    if axis:
        kind, points = np.stack([kind, kind]), np.stack([points, points + 10])
    data: Any = Data(Kept(kind, points), 5)
    of: Any = SimpleNamespace()
    found: Any = Reduction(np.array([0, 2]), of, of, of).scene(data, axis)
    assert found.other == 5
    assert found.primitives.kind.tolist() == ([[0, 2]] * 2 if axis else [0, 2])
    wanted = points[:, [0, 2]] if axis else points[[0, 2]]
    assert found.primitives.points.tolist() == wanted.tolist()
    every: Any = Reduction(np.array([0, 1, 2]), of, of, of).scene(data, axis)
    assert every.primitives is data.primitives
