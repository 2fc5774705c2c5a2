"""Sections of a report on eight plain records / every number and sentence worked out by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mbref.scene import Body, Revolute, Scene
from mbref.trajectory import Outcome, Trajectory
from reports.blocks import Figure, Matrix, Plot, Table, Text
from reports.runs import Run, SceneRuns
from reports.sections import (
    accelerations,
    energy,
    least_errors,
    outcomes,
    paper_figures,
    speed,
    summary,
    verdict,
    violation,
)

BLOCK = Body(name="b", mass=2.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0), velocity=(1.0, 0.0, 0.0))
SCENE = Scene(name="block", body=(BLOCK,), gravity=(0.0, 0.0, 0.0), duration=1.0)


def plain(
    engine: str,
    family: str,
    error: float | None,
    seconds: float,
    outcome: str = "COMPLETED",
    t_end: float = 1.0,
    bound: float = 1e-14,
    **settings: float,
) -> dict[str, Any]:
    """The record of a run without its motion."""
    return {
        "scene": "block",
        "engine": engine,
        "version": "1",
        "family": family,
        "outcome": outcome,
        "t_end": t_end,
        "times": [0.0, t_end],
        "message": f"{outcome} at {t_end}" if outcome == "NOT_CONVERGED" else "",
        "settings": settings,
        "time_limit": 20.0,
        "cost": {"seconds": seconds, "steps": 10, "rhs": 40},
        "asked": {"engine": engine, "options": settings},
        "metrics": {"error": error, "error_bound": bound},
        "key": f"{engine}{family}{seconds}",
    }


RECORDS = (
    plain("a", "x", 2e-2, 0.5, rtol=1e-3),
    plain("a", "x", 2e-3, 2.0, rtol=1e-5),
    plain("a", "x", 9e-8, 8.0, rtol=1e-9),
    plain("b", "y", 1e-3, 1.0, step=0.1),
    plain("b", "y", 1e-7, 4.0, step=0.01),
    plain("b", "y", None, 3.0, "NOT_CONVERGED", 0.25, step=0.001),
    plain("b", "y", None, 0.1, "NOT_CONVERGED", 0.125, step=0.0001),
    plain("c", "z", None, 20.0, "TIMED_OUT", 0.5, step=0.1),
)


def group(records: tuple[dict[str, Any], ...] = RECORDS, scene: Scene = SCENE) -> SceneRuns:
    return SceneRuns(scene, [Run(record) for record in records])


def of(kind: type, blocks: list[Any]) -> Any:
    [found] = [block for block in blocks if isinstance(block, kind)]
    return found


def test_summary():
    """On a's line from (2 s, 2e-3) to (8 s, 9e-8), 1e-3 lies at 2 · 4^0.0693 = 2.20 s and 1e-6 at 5.73 s; on
    b's from (1 s, 1e-3) to (4 s, 1e-7), 1e-6 lies at 4^0.75 = 2.83 s."""
    blocks = summary.render([group()])
    assert of(Text, blocks).text == (
        "Scenes: 1; runs: 8, in engines: 3; completed: 5. Under an error level stands the time to reach it, "
        "read off the family's curve of time against error, as a multiple of the fastest; an en dash: not "
        "reached. False successes: 1 of the completed runs have an error above 1e-2. Completed runs with a "
        "relative tolerance: 3; of these, with an error above 100 times their tolerance: 1."
    )
    table = of(Table, blocks)
    assert table.caption == "To t = 1 s. Fastest: at 1e-3 b y (1 s), at 1e-6 b y (2.83 s), at 1e-9 none."
    assert table.header[3:9] == ("Least error", "Its settings", "Its time", "At 1e-3", "At 1e-6", "At 1e-9")
    late = "NOT_CONVERGED from 0.125 s"
    bad = "1 with error above 1e-2, 1 with error above 100 rtol"
    assert [tuple(row) for row in table.rows] == [
        ("b", "y", "2 of 4", "1.00e-07", "step=0.01", "4 s", "1.0", "1.0", "–", late),
        ("a", "x", "3 of 3", "9.00e-08", "rtol=1e-09", "8 s", "2.2", "2.0", "–", bad),
        ("c", "z", "0 of 1", "–", "–", "–", "–", "–", "–", "TIMED_OUT from 0.5 s"),
    ]
    assert table.right == {2, 3, 5, 6, 7, 8} and "Error" not in table.header[:2]


def test_families_that_reach_no_middle_level_are_ordered_by_their_errors():
    rough = (plain("a", "x", 1e-4, 1.0, step=0.1), plain("b", "y", 1e-5, 9.0, step=0.1))
    table = of(Table, summary.render([group(rough)]))
    assert [row[0] for row in table.rows] == ["b", "a"]
    assert table.caption.endswith("at 1e-3 a x (1 s), at 1e-6 none, at 1e-9 none.")


def test_caption_and_key_of_the_speed_plot():
    blocks = speed.render(group())
    plot = of(Plot, blocks)
    asked = (
        "5 of 8 runs completed. The least error is 9.00e-08 (a x, 8 s); the least time 500 ms (a x, error "
        "2.00e-02). 1 completed with an error above 1e-2: wrong, although reported as a success."
    )
    assert plot.caption.endswith(f"call an engine without Python. {asked}"), plot.caption
    assert plot.figure.name == "block-speed"
    assert plot.figure.caption == plot.caption + (
        " Failed runs are in the strip on the right at the time they took, or at its lower end if that is "
        "less than the time of any completed run; the key lists the reasons."
    )
    assert [tuple(row) for row in of(Table, blocks).rows] == [
        ("1", "b", "y", "2", "NOT_CONVERGED", "0.125 … 0.25", "NOT_CONVERGED at 0.125"),
        ("2", "c", "z", "1", "TIMED_OUT", "0.5", Outcome.TIMED_OUT.sentence),
    ]
    main, strip = speed.plot(group(), speed.failed(group().runs)).axes
    assert [line.get_xydata().tolist() for line in strip.lines] == [
        [[0.25, 3.0], [0.25, 0.5]],
        [[0.75, 20.0]],
    ], "no mark is below the quickest completed run, 0.5 s"
    assert [(t.get_text(), *t.xy) for t in strip.texts] == [("1", 0.25, 3.0), ("2", 0.75, 20.0)]
    assert sorted(line.get_label() for line in main.lines) == ["a x", "b y"]


def test_a_speed_plot_without_failures_and_with_an_error_below_the_bound():
    blocks = speed.render(group((plain("a", "x", 1e-9, 1.0, bound=1e-7, step=0.1),)))
    plot = of(Plot, blocks)
    assert plot.caption.endswith(
        "1 of 1 runs completed. The least error is < 1e-07 (a x, 1 s); the least time 1 s (a x, error < "
        "1e-07). An error below the bound on the truth's own error is drawn at that bound."
    )
    assert plot.figure.caption == plot.caption and not [b for b in blocks if isinstance(b, Table)]


def test_no_error_no_speed_plot():
    blocks = speed.render(group((plain("a", "x", None, 1.0, step=0.1),)))
    assert of(Text, blocks).text == ("No run has an error to plot: this scene has no truth to compare with.")


def test_outcomes():
    table = of(Table, outcomes.render(group()))
    assert table.caption == "All 8 runs: outcome, end time, and error up to the end." and table.folded
    rows = [tuple(row) for row in table.rows]
    assert rows[0] == ("a", "x", "rtol=0.001", "COMPLETED", "1", "2.00e-02", "500 ms", "10", "40", "")
    assert rows[6][2:] == (
        "step=0.0001",
        "NOT_CONVERGED (b)",
        "0.125",
        "–",
        "100 ms",
        "10",
        "40",
        "NOT_CONVERGED at 0.125",
    )
    assert rows[7][2:7] == ("step=0.1", "TIMED_OUT", "0.5", "–", "20 s")
    assert [cell.href[:3] for cell in (row[2] for row in table.rows)] == ["#k-"] * 8
    assert table.right == {4, 5, 6, 7, 8}


def test_matrix_of_scenes_and_engines():
    matrix = of(Matrix, verdict.render([group()]))
    cells = {name: [(v.family, v.grade, v.lines) for v in row] for name, row in matrix.cells["block"].items()}
    assert cells == {
        "a": [("x", "inaccurate", ["9.00e-08", "8 s"])],
        "b": [("y", "inaccurate", ["1.00e-07", "4 s", "2 of 4 failed"])],
        "c": [("z", "failed", ["timed out"])],
    }
    assert matrix.caption.startswith("= right: error up to 1e-8; ≈ inaccurate: up to 1e-2; ≠ wrong: above")


def test_defaults_stand_below_a_better_family():
    records = (
        plain("a", "defaults", 0.5, 1.0, step=0.1),
        plain("a", "x", 1e-9, 2.0, step=0.1),
        plain("a", "w", 1e-3, 1.0, step=0.1),
    )
    matrix = of(Matrix, verdict.render([group(records)]))
    [shown] = matrix.cells["block"].values()
    assert [(v.family, v.grade) for v in shown] == [("x", "right"), ("defaults", "wrong")]


def moving(engine: str, family: str, speeds: tuple[float, ...], **changes: Any) -> Run:
    """A run of the block along x at given speeds (m/s) at times 0, 0.5 and 1 s."""
    k = len(speeds)
    still = np.zeros((k, 1, 3))
    velocity = still.copy()
    velocity[:, 0, 0] = speeds
    run = Trajectory(
        "block",
        engine,
        "1",
        family,
        {},
        np.linspace(0.0, 0.5 * (k - 1), k),
        ("b",),
        still,
        np.tile([1.0, 0.0, 0.0, 0.0], (k, 1, 1)),
        velocity,
        still,
        t_end=0.5 * (k - 1),
    )
    more = {"scene": "block", "family": family, "metrics": {"error": 1e-3, "error_bound": 1e-14}}
    return Run({**run.to_record(), **more, **changes})


def test_energy_drift_of_the_most_accurate_runs():
    """2 kg at 1 m/s have 1 J; at 1.1 m/s 1.21 J: 0.21 J of the largest energy seen are 0.174."""
    worse = {"metrics": {"error": 1e-2, "error_bound": 1e-14}}
    runs = [
        moving("a", "x", (1.0, 1.0, 1.0)),
        moving("b", "y", (1.0, 1.1, 1.0)),
        moving("b", "y", (1.0, 9.0, 1.0), **worse),
        moving("c", "z", (1.0,)),
    ]
    figure = of(Figure, energy.render(SceneRuns(SCENE, runs)))
    assert figure.name == "block-energy"
    assert figure.caption == (
        "Energy gained less the work of loads and drivers, as a fraction of the largest energy seen, in the "
        "most accurate run of every family; zero is exact. The least maximum is 0 (a x), the greatest "
        "1.7e-01 (b y)."
    )
    lines = {line.get_label(): line.get_ydata().tolist() for line in figure.draw().axes[0].lines}
    assert lines == {"a x": [1e-17] * 3, "b y": pytest.approx([1e-17, 0.21 / 1.21, 1e-17])}


def test_no_second_sample_no_picture():
    runs = [moving("c", "z", (1.0,))]
    assert of(Text, energy.render(SceneRuns(SCENE, runs))).text == energy.NO_BALANCE
    assert of(Text, violation.render(SceneRuns(SCENE, runs))).text == "No run reached a second sample."


def test_violations_over_the_length_of_the_scene():
    """A hinge 4 m away that the block leaves by 8 mm, at 0.2 m/s: 2e-3 and 5e-2 of the length."""
    hinge = Revolute(name="A", bodies=("ground", "b"), anchor=(4.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    scene = SCENE.with_(joint=(hinge,), body=(BLOCK.model_copy(update={"velocity": None}),))
    still, off = moving("a", "x", (0.0, 0.0, 0.0)), moving("b", "y", (0.0, 0.2, 0.0))
    bodies = {name: dict(body) for name, body in off.record["bodies"].items()}
    bodies["b"]["position"] = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.008], [0.0, 0.0, 0.0]]
    figure = of(Figure, violation.render(SceneRuns(scene, [still, Run({**off.record, "bodies": bodies})])))
    assert "At position level the least maximum is 0 (a x), the greatest 2.0e-03 (b y)." in figure.caption
    places, rates = figure.draw().axes
    assert places.lines[1].get_ydata() == pytest.approx([1e-17, 2e-3, 1e-17])
    assert rates.lines[1].get_ydata() == pytest.approx([1e-17, 5e-2, 1e-17])


def test_least_errors():
    first, second = (block for block in least_errors.render([group()]) if isinstance(block, Table))
    assert first.caption == "0 of 3 pairs of scene and engine are within 1e-8 of the truth."
    assert [first.header[k] for k in sorted(first.right)] == ["Least error", "Time (s)", "Families"]
    assert [tuple(row) for row in first.rows] == [
        ("block", "a", "x", "rtol=1e-09", "9.00e-08", "8", "0 of 1"),
        ("block", "b", "y", "step=0.01", "1.00e-07", "4", "0 of 1"),
        ("block", "c", "z", "step=0.1", "timed out", "20", "0 of 1"),
    ]
    assert [tuple(row) for row in second.rows] == [
        ("block", "a", "", "x 9.00e-08"),
        ("block", "b", "", "y 1.00e-07"),
        ("block", "c", "", "z timed out"),
    ]


def test_initial_accelerations_of_a_body_at_rest():
    """Where the true accelerations are zero, differences are not over their size."""
    still = np.zeros((3, 1, 3))
    run = moving("a", "x", (1.0, 1.0, 1.0))
    bodies = {"b": {**run.record["bodies"]["b"], "acceleration": still[:, 0].tolist()}}
    bodies["b"]["angular_acceleration"] = [[0.0, 0.0, 0.25]] * 3
    table = of(Table, accelerations.render(SceneRuns(SCENE, [Run({**run.record, "bodies": bodies})])))
    [(engine, family, off)] = table.rows
    assert (engine, family) == ("a", "x") and float(off) > 0


def test_the_crank_s_component_about_its_axis_of_a_run_with_and_without_samples():
    turning = np.array([[[0.0, -3.0, 1.0]], [[0.0, 2.0, 1.0]]])
    assert paper_figures._along_axis(turning).tolist() == [-3.0, 2.0]
    assert paper_figures._along_axis(np.zeros((0, 1, 3))).shape == (0,), "a run without a sample"
