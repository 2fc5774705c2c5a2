"""The section on reactions / comparisons and motions made up, so that each cell is known."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from test_figures_by_hand import plain

from crosscheck.judge.joint_reactions import Comparison, Reaction
from mbref.scene import Body, Revolute, Scene
from reports.blocks import Heading, Table, Text
from reports.runs import Run, SceneRuns
from reports.sections import reactions

BODY = Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0))
FIRST = Revolute(name="A", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
SECOND = FIRST.model_copy(update={"name": "B", "anchor": (0.0, 0.0, 1.0)})
SCENE = Scene(name="block", body=(BODY,), joint=(FIRST, SECOND), duration=1.0)


def run(
    engine: str, family: str, error: float | None, outcome: str = "COMPLETED", reacts: bool = True
) -> Run:
    record = plain(engine, family, error, 1.0, outcome)
    return Run({**record, "reactions": {"A": [1.0]} if reacts else {}})


def test_the_run_of_least_error_that_has_reactions() -> None:
    runs = [
        run("a", "x", 0.5),
        run("a", "y", 0.25),
        run("a", "z", None),
        run("b", "x", 0.5),
        run("b", "y", 0.1, reacts=False),
        run("c", "x", 0.1, "STEP_FAILED"),
        run("d", "x", None),
    ]
    found = reactions._best(SceneRuns(SCENE, runs))
    assert {engine: of.curve[1] for engine, of in found.items()} == {"a": "y", "b": "x", "d": "x"}


def test_rows_of_joints_and_of_bodies() -> None:
    """Smaller differences than 1e-11 are rounding."""
    one = Comparison({"A": Reaction(2, 0.5, 9.0), "B": Reaction(1, 1e-12, 9.0)}, 0.25)
    other = Comparison({"A": Reaction(2, 0.0, 9.0), "B": Reaction(1, 0.125, 9.0)}, 2e-13)
    assert reactions._rows(SCENE, {"a": one, "b": other}) == [
        ("A", "2", "5.0e-01", "0"),
        ("B", "1", "< 1e-11", "1.2e-01"),
        ("on a body", "0", "2.5e-01", "< 1e-11"),
    ]


def motion(*times: float, acceleration: Any = 0.0) -> Any:
    return SimpleNamespace(times=np.array(times), acceleration=acceleration)


@pytest.mark.parametrize(
    ("sizes", "rows"),
    [
        (
            {"A": {"a": 3.14159, "b": 1.9e-9}, "B": {"a": 2.1e-9, "b": 0.0}},
            [("A", "3.142", "0"), ("B", "2.1e-09", "0")],
        ),
        ({"A": {"a": 1e-10, "b": 0.0}}, None),
        ({}, []),
    ],
)
def test_components_that_redundancy_leaves_open(
    sizes: Any, rows: list[Any] | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At the middle of the shortest run; sizes below 1e-11 of the largest reaction, 200 N, are none."""
    asked: list[Any] = []
    monkeypatch.setattr(reactions, "side_by_side", lambda scene, runs, sample: asked.append(sample) or sizes)
    largest = {7: 200.0, 4: 50.0}
    monkeypatch.setattr(reactions, "largest_reaction", lambda scene, run: largest[len(run.times)])
    runs = {"a": motion(0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5), "b": motion(0.0, 0.3, 0.6, 0.9)}
    found = reactions._choices(SCENE, runs)
    assert asked == [2]
    if rows is None:
        assert found == [
            Text("At t = 0.5 s the components that redundancy leaves undetermined are 0 in every engine.")
        ]
        return
    if not rows:
        assert found == []
        return
    [table] = found
    assert (
        isinstance(table, Table) and list(table.rows) == rows and tuple(table.header) == ("Joint", "a", "b")
    )
    assert table.caption.startswith("The engine's choice: size (N) at t = 0.5 s of the components")
    assert table.right == {1, 2}


def test_rows_of_one_engine() -> None:
    """The joints in the scene's order, then what a body gets in all."""
    found = Comparison({"A": Reaction(2, 0.5, 0.25), "B": Reaction(0, 0.125, 0.0)}, 0.75)
    assert reactions._rows(SCENE, {"a": found}) == [
        ("A", "2", "5.0e-01"),
        ("B", "0", "1.2e-01"),
        ("on a body", "0", "7.5e-01"),
    ]


def section(monkeypatch: pytest.MonkeyPatch, exact: Any, scene: Scene = SCENE) -> tuple[list[Any], list[Any]]:
    """The section on two runs with equal samples and one with others, and the exact motions solved."""
    solved: list[Any] = []
    monkeypatch.setattr(
        reactions, "with_exact_reactions", lambda s, e: solved.append(e) or f"true {len(solved)}"
    )
    same = Comparison({"A": Reaction(1, 0.5, 0.0), "B": Reaction(1, 0.5, 0.0)}, 0.5)
    compared: list[Any] = []
    monkeypatch.setattr(reactions, "compare", lambda s, true, run: compared.append((true, run)) or same)
    monkeypatch.setattr(reactions, "absurd", lambda s, run, true: ["too large"] if run is runs["b"] else [])
    monkeypatch.setattr(reactions, "_choices", lambda s, given: [Text(f"choices {s.name} {list(given)}")])
    runs: dict[str, Any] = {"a": motion(0.0, 1.0), "b": motion(0.0, 1.0), "c": motion(0.0, 0.5)}
    best = {engine: SimpleNamespace(trajectory=run) for engine, run in runs.items()}
    monkeypatch.setattr(reactions, "_best", lambda scene_runs: best)
    group: Any = SimpleNamespace(scene=scene, exact=exact)
    blocks = reactions.render(group)
    assert [true for true, _ in compared] == (["true 1", "true 1", "true 2"] if compared else [])
    return blocks, solved


def test_exact_reactions_are_found_once_for_equal_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    blocks, solved = section(monkeypatch, lambda times: motion(*times))
    heading, table, sentence, choices = blocks
    assert heading == Heading("Joint reactions") and len(solved) == 2
    assert tuple(table.header) == ("Joint", "Open", "a", "b", "c") and table.right == {1, 2, 3, 4}
    assert sentence == Text("too large.") and choices == Text("choices block ['a', 'b', 'c']")


def test_no_section_without_a_motion_or_masses(monkeypatch: pytest.MonkeyPatch) -> None:
    assert section(monkeypatch, lambda times: None) == ([], [])
    assert section(monkeypatch, lambda times: motion(*times, acceleration=None)) == ([], [])
    bare = SCENE.with_(body=(BODY.model_copy(update={"mass": None, "inertia": None}),))
    assert section(monkeypatch, lambda times: motion(*times), bare) == ([], [])
