"""Rows of IDA, loops of derived equations, recorded steps and comparisons of records / worked out by hand."""

from __future__ import annotations

import contextlib
import gc
import importlib
import os
import sys
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import crosscheck.cli
from crosscheck.cli import closed_loops, commands, comparison, convergence
from crosscheck.engines import warp_graphs
from crosscheck.engines.spanning_tree import GROUND_LINK, Link, spanning_tree
from crosscheck.engines.sundials import ida
from crosscheck.engines.symbolic import frames
from crosscheck.engines.symbolic.equations import TreeEquations
from crosscheck.engines.tree_reactions import _force_on_end
from mbref import rotations
from mbref.scene import Body, Scene
from mbref.trajectory import Outcome


# --- rows of IDA ------------------------------------------------------------------------------------------
def test_the_joint_that_is_furthest_off_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """A quarter of the length may be lost, or of 1 m where it is shorter."""
    monkeypatch.setattr(ida, "LOST", 0.25)
    run: Any = object.__new__(ida.Run)
    residuals = np.zeros((1, 3))
    state = SimpleNamespace(frames=lambda: "frames")
    constraints = SimpleNamespace(levels=lambda t, f: residuals, joint=[0, 1, 1])
    run.equations, run.y = SimpleNamespace(constraints=constraints, state=lambda y: state), None
    run.scene = SimpleNamespace(joint=[SimpleNamespace(name="A"), SimpleNamespace(name="B")])
    for length, limit in ((0.5, 0.25), (4.0, 1.0)):
        run.length = length
        for off, says in (
            ((-limit, 0.1, limit), None),
            ((-1.5 * limit, 0.1, 0.2), "joint 'A' is off by {:.3g} at 0.5 s"),
            ((0.1, 0.2, -1.5 * limit), "joint 'B' is off by {:.3g} at 0.5 s"),
        ):
            residuals[0] = off
            if says is None:
                run._nothing_lost(0.5)
                continue
            with pytest.raises(ida.Failed) as caught:
                run._nothing_lost(0.5)
            assert str(caught.value) == says.format(1.5 * limit)
            assert (caught.value.outcome, caught.value.t) == (Outcome.VIOLATION, 0.5)
    residuals = np.zeros((1, 0))
    run._nothing_lost(0.5)


@pytest.mark.parametrize(("small", "rank"), [(0.5, 1), (0.51, 2)])
def test_the_rank_of_rows_is_relative_to_the_largest_pivot(
    small: float, rank: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An eighth of the largest pivot, 4."""
    monkeypatch.setattr(ida, "RANK", 0.125)
    monkeypatch.setattr(ida, "_pivots", lambda rows: (np.array([4.0, small]), np.array([1, 0])))
    run: Any = object.__new__(ida.Run)
    state = SimpleNamespace(frames=lambda: "frames")
    constraints = SimpleNamespace(jacobian=lambda t, f: np.eye(2, 6))
    run.equations = SimpleNamespace(constraints=constraints, state=lambda y: state, nb=1, rows=[])
    run.length, run.y, run.rank = 2.0, None, 0
    assert run._choose(0.0) is True and run.rank == rank
    assert run.equations.rows.tolist() == ([1] if rank == 1 else [0, 1])


# --- loops of derived equations ---------------------------------------------------------------------------
def test_a_loop_pulls_at_its_second_link_about_the_world() -> None:
    """A force on the first link is the opposite one on the second; the ground has no frame."""
    at = [
        SimpleNamespace(origin=np.array([1.0, 0.0, 0.0]), arm=lambda anchor: anchor * 2),
        SimpleNamespace(origin=np.array([0.0, 5.0, 0.0]), arm=lambda anchor: anchor * 3),
    ]
    made: Any = object.__new__(TreeEquations)
    anchor, force = np.array([0.0, 1.0, 2.0]), np.array([7.0, 8.0, 9.0])
    closures = [
        SimpleNamespace(links=links, anchor=anchor) for links in ((0, 1), (1, GROUND_LINK), (GROUND_LINK, 1))
    ]
    made.tree = SimpleNamespace(closures=closures)
    first, second, third = made._closing(at, np.array([force, 2 * force, 3 * force]))
    for found, pull, place in (
        (first, -force, [1.0, 2.0, 4.0]),
        (second, -2 * force, [0.0, 8.0, 6.0]),
        (third, 3 * force, [0.0, 8.0, 6.0]),
    ):
        assert found.tolist() == [*pull, *np.cross(place, pull)]


def test_a_vector_product_and_a_turn_of_numbers() -> None:
    a, b = np.array([1.0, -2.0, 5.0]), np.array([0.5, 7.0, -3.0])
    assert frames.cross(a, b) == pytest.approx(np.cross(a, b))
    axis = np.array([2.0, -3.0, 6.0]) / 7
    arithmetic: Any = SimpleNamespace(sin=np.sin, cos=np.cos)
    wanted = rotations.to_matrix(rotations.from_vector(0.8 * axis))
    assert np.asarray(frames.turn(axis, 0.8, arithmetic), float) == pytest.approx(wanted)


# --- rods and free links ----------------------------------------------------------------------------------
def test_links_of_free_bodies_belong_to_no_joint() -> None:
    body = Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(1.0, 2.0, 3.0))
    [link] = spanning_tree(Scene(name="s", body=(body,))).links
    assert (link.body, link.joint, link.parent, link.kind) == (0, -1, GROUND_LINK, "free")
    assert link.ghost is False and link.ends == () and link.anchor.tolist() == [1.0, 2.0, 3.0]
    assert [m.axis.tolist() for m in link.mobilities] == [[0.0, 0.0, 0.0]]
    bare = Link(0, np.ones(3), 1.0, np.zeros(3), np.eye(3))
    assert bare.anchor.tolist() == [0.0, 0.0, 0.0] and bare.joint == -1 and bare.axes.shape == (0, 3)


def test_the_half_mass_of_the_rod_with_the_same_ends() -> None:
    """Of three rods with a common end, the second one joins both anchors; its half mass is 2 kg."""
    ends = [((1.0, 0, 0), (5.0, 0, 0)), ((0.0, 0, 0), (5.0, 0, 0)), ((0.0, 0, 0), (6.0, 0, 0))]
    rods = [
        SimpleNamespace(ends=((0, np.array(a)), (1, np.array(b))), mass=mass)
        for (a, b), mass in zip(ends, (1.0, 4.0, 9.0), strict=True)
    ]
    tree: Any = SimpleNamespace(links=[SimpleNamespace(ends=()), *rods])
    joint: Any = SimpleNamespace(anchors=ends[1])
    scene: Any = SimpleNamespace(gravity=(0.0, 0.0, -10.0))
    motion: Any = None
    assert _force_on_end(scene, tree, motion, GROUND_LINK, joint).tolist() == [0.0, 0.0, 20.0]


# --- recorded steps of Warp -------------------------------------------------------------------------------
def test_a_step_is_recorded_once_and_replayed(monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[Any] = []

    class Capture:
        graph = "graph"

        def __enter__(self) -> Any:
            done.append("begin")
            return self

        def __exit__(self, *error: object) -> None:
            done.append("end")

    def capture(device: str) -> Capture:
        done.append(device)
        return Capture()

    library = SimpleNamespace(ScopedCapture=capture, capture_launch=done.append)
    monkeypatch.setitem(sys.modules, "warp", library)
    again = warp_graphs.recorded(lambda: done.append("step"))
    assert done == ["cpu", "begin", "step", "end"]
    again()
    again()
    assert done[4:] == ["graph", "graph"]


# --- command lines ----------------------------------------------------------------------------------------
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


@pytest.mark.parametrize("collects", [True, False])
def test_the_command_line_has_one_thread_and_collects_as_before(
    collects: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Numbers of threads that the user sets stay."""
    for name in THREADS:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv(THREADS[1], "3")
    before = gc.isenabled()
    try:
        (gc.enable if collects else gc.disable)()
        importlib.reload(crosscheck.cli)
        assert gc.isenabled() is collects
    finally:
        (gc.enable if before else gc.disable)()
    assert [os.environ[name] for name in THREADS] == ["1", "3", "1"]


def test_measurements_of_closed_loops_are_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Any) -> None:
    """The progress bar counts the cases; the page and its path are told."""
    said: list[Any] = []

    @contextlib.contextmanager
    def progress(what: str, count: int) -> Any:
        said.append((what, count))
        yield "progress"

    monkeypatch.setattr(closed_loops, "progress_of", progress)
    monkeypatch.setattr(closed_loops.records, "cases", lambda *given: said.append(given) or ([1, 2], ["u"]))
    monkeypatch.setattr(closed_loops.records, "measure", lambda *given: said.append(given))
    monkeypatch.setattr(closed_loops.request, "find_engines", lambda names, tell: said.append(names) or names)
    for engine, wanted in ((None, ["all"]), (["dart"], ["dart"])):
        said.clear()
        arguments: Any = SimpleNamespace(engine=engine, family="f")
        closed_loops._measure(arguments, "path")  # type: ignore[arg-type]
        assert said == [
            wanted,
            (wanted, "f", "path"),
            ("measuring", 2),
            ([1, 2], ["u"], "path", "progress"),
        ]
    page = tmp_path / "page.md"
    for module in (closed_loops, convergence):
        said.clear()
        monkeypatch.setattr(module, "notice", said.append)
        monkeypatch.setattr(module, "console", lambda: SimpleNamespace(print=lambda *given, **named: None))
        monkeypatch.setattr(module.document, "page", lambda found: "text")
    monkeypatch.setattr(closed_loops.records, "read", lambda path: [])
    monkeypatch.setattr(convergence, "read", lambda path: [])
    for command in (closed_loops.closed_loops, convergence.convergence):
        said.clear()
        given: Any = SimpleNamespace(records="r", run=False, page=str(page), engine=None)
        assert command(given) == 0 and said == [f"written: {page}"] and page.read_text() == "text"


def test_looks_of_cells_of_closed_loops() -> None:
    """By the sign at the start of a cell; others are dim."""
    texts = {"✓ 1e-9": "green", "≈ 1e-4": "yellow", "✗ 0.5": "bold red", "! lost": "magenta", "–": "dim"}
    cells = {t: SimpleNamespace(best=lambda t=t: t, defaults=lambda t=t: None) for t in texts}
    made: Any = {"engine": cells}
    before = closed_loops.shown
    try:
        closed_loops.shown = lambda record: record  # type: ignore[assignment]
        table = closed_loops._table(made, True)
    finally:
        closed_loops.shown = before
    row = [next(iter(column.cells)) for column in table.columns]
    assert row[0] == "engine" and {str(cell): str(cell.style) for cell in row[1:]} == texts  # type: ignore[union-attr]


def test_random_mechanisms_and_findings_by_their_arguments(monkeypatch: pytest.MonkeyPatch) -> None:
    from crosscheck.cli import findings
    from crosscheck.conformance import deep

    said: list[Any] = []
    monkeypatch.setattr(findings, "show", lambda console, names, recheck: said.append((names, recheck)))
    assert commands._findings(SimpleNamespace(name=["a"], recheck=True)) == 0  # type: ignore[arg-type]
    assert said == [(["a"], True)]

    @contextlib.contextmanager
    def counted(what: str, count: int) -> Any:
        said.append((what, count))
        yield "advance"

    found = SimpleNamespace(conforms=False, to_record=lambda: {"a": 1})
    monkeypatch.setattr(commands, "counted", counted)
    monkeypatch.setattr(commands, "standard_output_kept", contextlib.nullcontext)
    monkeypatch.setattr(commands.request, "find_engines", lambda names, tell: said.append(names))
    monkeypatch.setattr(deep, "examined", lambda *given: said.append(given) or found)
    arguments: Any = SimpleNamespace(
        mechanisms=3, first_seed=7, family="f", beside=("mujoco=tuned",), records="r", json=True
    )
    said.clear()
    assert commands._verify_random("dart", arguments) == 1
    plan = deep.Plan("dart", 3, 7, "f", ("mujoco=tuned",))
    assert said == [["mujoco"], ("verifying, at most", 3 * deep.MOST), (plan, "r", "advance")]


# --- comparisons of records -------------------------------------------------------------------------------
@dataclass(frozen=True)
class Group:
    """A scene with the record of its truth."""

    scene: Any
    truth: dict[str, Any]
    records: tuple[str, ...] = ("record",)
    differences: dict[str, str] = field(default_factory=dict)


@pytest.mark.parametrize("kind", ["reference", ""])
def test_engines_are_blamed_where_the_truth_is_known(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Forces are compared, too, there; otherwise the first difference alone is told."""
    given: list[Any] = []
    scene = SimpleNamespace(name="s")
    group = Group(scene, {"kind": kind})
    monkeypatch.setattr(comparison, "judged", lambda *parts: given.append(parts) or [group])
    monkeypatch.setattr(
        comparison, "model_differences", lambda *parts: given.append(parts) or {"a": "a differs"}
    )
    monkeypatch.setattr(
        comparison, "force_differences", lambda *parts: given.append(parts) or {"b": "b differs"}
    )
    gates = [{"scene": "s", "n": 1}, {"scene": "t", "n": 2}]
    found: Any = SimpleNamespace(scenes="scenes", truths="truths", records="records", identities=gates)
    [made] = comparison.comparisons(found, {"s": "s.toml"}, 7.0)
    assert given[:2] == [("scenes", "truths", "records"), (scene, gates[:1], 7.0, ("record",))]
    assert made.path == "s.toml" and made.difference == "a differs"
    if kind:
        assert made.judged.differences == {"a": "a differs", "b": "b differs"}
        assert given[2:] == [(scene, ("record",))] and made._unlike is None
    else:
        assert made.judged.differences == {} and len(given) == 2 and made._unlike == "a differs"
