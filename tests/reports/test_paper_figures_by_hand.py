"""The figures of the paper's section on plain runs / lines, marks, captions and poses worked out by hand."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from test_figures_by_hand import SCENE, moving, plain

from crosscheck.paper.runs import ALPHAS, Label
from mbref.trajectory import Outcome
from reports import figures, mechanisms
from reports.blocks import Figure
from reports.runs import Run
from reports.sections import paper_figures, paper_methods

STOPPED = {"outcome": "STEP_FAILED"}
SPEEDS = (1.0, 1.0, 1.0)


def violated(times: list[float], values: list[float], outcome: str = "COMPLETED", **changes) -> Run:
    made = plain("a", "x", 1e-3, 1.0, outcome, times[-1])
    run = moving("a", "x", (0.0,) * len(times)).record
    return Run({**run, **made, "times": times, "violation": values, **changes})


def points(drawing) -> list[list[list[float]]]:
    [axes] = drawing.axes
    return [line.get_xydata().tolist() for line in axes.lines]


def test_ends_of_runs_in_a_caption():
    runs = {"one": moving("a", "x", SPEEDS), "two": moving("a", "x", (1.0, 1.0), **STOPPED)}
    letter = Outcome.STEP_FAILED.letter
    assert paper_figures._ended(runs) == f"one to the end, two to 0.5 s ({letter})"
    figure = paper_figures._poses(7, SCENE, runs, "The block")
    assert figure.name == "paper-figure-7"
    assert figure.caption == (
        "Figure 7. The block: poses from the start, light, to the last sample before the end, dark; "
        f"one to the end, two to 0.5 s ({letter}). Steps end at samples, so that the end may differ from the "
        "tables'."
    )
    assert paper_figures._only({"one": 1, "two": 2, "three": 3}, ("three", "one")) == {"three": 3, "one": 1}


def test_poses_of_a_span_of_time(monkeypatch):
    """Samples at 0, 0.5, 1, 1.5 and 2 s; both ends of a span belong to it."""
    run = moving("a", "x", (0.0, 1.0, 0.0, 1.0, 0.0))
    whole = paper_figures.plot_poses(SCENE, {"x": run}, None)
    part = paper_figures.plot_poses(SCENE, {"x": run}, (0.5, 1.5))
    rough = paper_figures.plot_poses(SCENE, {"x": run, "y": run}, (0.6, 1.4))
    assert "to 2 s" in whole and "to 1.5 s" in part and rough.count("to 1 s") == 2
    monkeypatch.setattr(mechanisms, "poses_side_by_side", lambda scene, shown, number: (scene, shown, number))
    scene, shown, number = paper_figures.plot_poses(SCENE, {"x": run}, (0.5, 1.5))
    assert (scene, list(shown), number) == (SCENE, ["x"], 12)
    assert shown["x"][1].times.tolist() == [0.5, 1.0, 1.5]
    opacities = [len(re.findall(r'opacity="0\.\d+"', text)) for text in (whole, part)]
    assert opacities[0] > opacities[1] > 0, "five poses and three"


def test_violations_with_the_times_of_singular_positions():
    """The crank turns at 124.8 rad/s from π/2: θ₂ = 0 after 12.6 ms, −π after 37.8 ms."""
    runs = {
        "one": violated([0.0, 0.01, 0.04], [1e-9, 0.0, 1e-3]),
        "two": violated([0.0, 0.01, 0.02], [1e-9, 1e-5, 1e-2], "STEP_FAILED"),
    }
    drawing = paper_figures.plot_violations(runs)
    one, two, end, first, second = points(drawing)
    assert one == [[0.0, 1e-9], [0.01, 1e-17], [0.04, 1e-3]] and two == [
        [0.0, 1e-9],
        [0.01, 1e-5],
        [0.02, 1e-2],
    ]
    assert end == [[0.02, 1e-2]], "the end of a run that fails"
    crossings = [math.pi / 2 / 124.8, 3 * math.pi / 2 / 124.8]
    assert [first[0][0], second[0][0]] == pytest.approx(crossings)
    [axes] = drawing.axes
    looks = [(line.get_color(), line.get_linestyle(), line.get_marker()) for line in axes.lines[:3]]
    assert looks[0][:2] == (figures.COLOURS[0], "-") and looks[1][:2] == (figures.COLOURS[1], "--")
    assert looks[2][0] == figures.COLOURS[1] and looks[2][2] == figures.FAILED
    assert axes.lines[2].get_markersize() == 8
    assert {(line.get_linewidth(), line.get_zorder()) for line in axes.lines[3:]} == {(0.8, 0)}
    assert [line.get_label() for line in axes.lines[:2]] == ["one", "two"]
    assert axes.get_yscale() == "log" and drawing.get_size_inches().tolist() == [7.2, 3.4]
    late = paper_figures.plot_violations({"one": violated([0.0, 0.0121], [1e-9, 1e-9])})
    assert len(points(late)) == 2, "a crossing is shown up to 1.05 times the last time"
    assert len(points(paper_figures.plot_violations({"one": violated([0.0, 0.0119], [1e-9, 1e-9])}))) == 1
    assert len(points(paper_figures.plot_violations({"one": violated([0.0, 1.0], [1e-9, 1e-9])}))) == 10
    figure = paper_figures._violations(5, runs, "without partitioning")
    assert figure.name == "paper-figure-5" and figure.caption == (
        "Figure 5. The largest violation of a constraint of the four-bar from θ₂ = π/2, MPI without "
        "partitioning; at most: one 1.0e-03, two 1.0e-02. Dashed: θ₂ = kπ."
    )


def turning(rates: tuple[float, ...], **changes) -> Run:
    """A run whose first body turns about z at these rates, with an acceleration of three times the rate."""
    run = moving("a", "x", (0.0,) * len(rates), **changes)
    body = dict(run.record["bodies"]["b"])
    body["angular_velocity"] = [[0.0, 0.1, rate] for rate in rates]
    body["acceleration"] = [[0.0] * 3 for _ in rates]
    body["angular_acceleration"] = [[4 * rate, 0.0, 3 * rate] for rate in rates]
    return Run({**run.record, "bodies": {"b": body}})


def test_angular_velocity_of_the_crank():
    runs = {"one": turning((1.0, -2.0, 3.0)), "two": turning((1.0, 5.0), **STOPPED)}
    drawing = paper_figures.plot_rates(runs)
    one, two, end = points(drawing)
    assert one == [[0.0, 1.0], [0.5, -2.0], [1.0, 3.0]] and two == [[0.0, 1.0], [0.5, 5.0]]
    assert end == [[0.5, 5.0]]
    [axes] = drawing.axes
    assert [line.get_linewidth() for line in axes.lines[:2]] == pytest.approx([2.4, 1.8])
    assert axes.lines[2].get_marker() == figures.FAILED
    assert axes.lines[2].get_color() == axes.lines[1].get_color() == figures.COLOURS[1]
    assert axes.lines[2].get_markersize() == 8 and axes.get_yscale() == "linear"
    caption = paper_figures._rates(11, runs, "the block").caption
    ended = f"one to the end, two to 0.5 s ({Outcome.STEP_FAILED.letter})"
    assert caption == f"Figure 11. Angular velocity of the crank, the block; {ended}."


def test_angular_acceleration_of_the_crank():
    """Components of 3 and 4 times the rate: five times the rate; zero stands at 1e-17."""
    runs = {"one": turning((2.0, 0.0, -10.0))}
    [line] = points(drawing := paper_figures.plot_accelerations(runs))
    assert line == [[0.0, 10.0], [0.5, 1e-17], [1.0, 50.0]]
    [axes] = drawing.axes
    assert axes.get_yscale() == "log" and drawing.get_size_inches().tolist() == [7.2, 3.4]
    assert axes.lines[0].get_linewidth() == 1 and axes.lines[0].get_color() == figures.COLOURS[0]
    figure = paper_figures._accelerations(13, runs)
    assert figure.caption.endswith("up to 50; one to the end.") and figure.name == "paper-figure-13"
    assert f"as near as samples every {1e3 * paper_figures.FINE[1]:g} ms come" in figure.caption


def test_singular_values_over_a_revolution():
    drawing = paper_methods.plot_values([math.pi / 2, 0.0], [(0.0, 0.25), (0.5, 0.75)])
    smallest, following = points(drawing)
    assert smallest == [[0.5, 1e-17], [0.0, 0.5]] and following == [[0.5, 0.25], [0.0, 0.75]]
    [axes] = drawing.axes
    assert [line.get_label() for line in axes.lines] == ["smallest", "next"]
    assert [line.get_color() for line in axes.lines] == list(figures.COLOURS[:2])
    assert axes.get_ylim() == (1e-4, 2) and axes.xaxis_inverted() and axes.get_yscale() == "log"
    assert drawing.get_size_inches().tolist() == [7.2, 3.4]


def test_errors_over_the_penalty():
    values = [10.0**-k for k in range(len(ALPHAS))]
    drawing = paper_methods.plot_digits({"ALF": values, "ALF, dual": [0.0] * len(ALPHAS)})
    first, second = points(drawing)
    assert first == [list(point) for point in zip(ALPHAS, values, strict=True)]
    assert second == [[alpha, 1e-17] for alpha in ALPHAS]
    [axes] = drawing.axes
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    assert [line.get_marker() for line in axes.lines] == list(figures.MARKERS[:2])
    assert [line.get_color() for line in axes.lines] == list(figures.COLOURS[:2])
    assert [line.get_label() for line in axes.lines] == ["ALF", "ALF, dual"]
    assert drawing.get_size_inches().tolist() == [7.2, 3.4]


def test_a_run_without_accelerations_has_no_digits():
    motion = moving("a", "x", (1.0,)).trajectory
    assert paper_methods._accelerations(motion).shape == (0,)
    assert paper_methods._accelerations(turning((1.0,)).trajectory).shape == (2, 1, 1, 3)
    assert paper_methods._accelerations(turning(()).trajectory).shape == (0,)
    for name in ("acceleration", "angular_acceleration"):
        half = replace(turning((1.0,)).trajectory, **{name: None})
        assert paper_methods._accelerations(half).shape == (0,), name
    assert np.array_equal(paper_methods._accelerations(turning((2.0,)).trajectory)[1, 0, 0], [8, 0, 6])


def test_the_paper_s_figures_in_its_order():
    """Each figure shows its own methods, of its own mechanism and part; variants are left out."""
    runs = iter(range(1, 99))

    def labelled(part: str, column: str, *rows: str) -> dict[Label, dict[str, Any]]:
        made = {Label(part, row, column): turning((1.0, 0.5 + next(runs))).record for row in rows}
        return {k: r | {"violation": [1e-9, 1e-3 * k.row.count("S")]} for k, r in made.items()}

    plain = ("ALF", "MPI (GS)", "MPI (SVD)")
    held = tuple(f"{row} + CP" for row in plain)
    branches = ("MPI (GS)", "MPI (GS) + B", paper_figures.TRUE_BRANCH)
    records = {
        **labelled("figures", paper_figures.HALF, *plain, "MPI (GS) + B", *held),
        **labelled("figures", paper_figures.FIVE_BAR, *plain, *held),
        **labelled("dynamic", paper_figures.HEAVY, *branches, *plain),
        **labelled("dynamic", paper_figures.UNEQUAL, *held, *plain),
        **labelled("dynamic", paper_figures.SPATIAL_DYNAMIC, *plain, *held),
        paper_figures.PEAKS: turning((1.0, 40.0)).record,
        Label("figures", "ALF", paper_figures.HALF, "another tolerance"): turning((1.0, -7.0)).record,
    }
    first, *blocks = paper_figures.render(records)
    assert first.text == "Figures 4 to 8: kinematic analysis"
    made = {block.name.removeprefix("paper-figure-"): block for block in blocks if isinstance(block, Figure)}
    assert list(made) == ["4", "5", "6", "8", "11", "12", "13", "14", "15", "16"]
    assert blocks[4].text == "Figures 11 to 16: dynamic analysis, 100 N m on the crank"
    shown = {
        "4": ("ALF", "MPI (GS)", "MPI (SVD)", "MPI (GS) + B"),
        "5": ("MPI (GS)", "MPI (SVD)"),
        "6": ("MPI (GS) + CP", "MPI (SVD) + CP"),
        "8": ("MPI (GS)", "MPI (SVD)", "MPI (SVD) + CP"),
        "11": branches,
        "12": branches[:2],
        "14": held,
        "15": plain,
        "16": held,
    }
    for name, rows in shown.items():
        if name in ("5", "6"):
            assert (
                "at most: " + ", ".join(f"{row} {1e-3 * row.count('S'):.1e}" for row in rows)
                in made[name].caption
            )
        else:
            assert made[name].caption.count("to the end") == len(rows), name
            assert ", ".join(f"{row} to the end" for row in rows) in made[name].caption, name
    assert "up to 200;" in made["13"].caption, "five times 40"
    assert "without partitioning" in made["5"].caption and "with partitioning" in made["6"].caption
    rates = {name: points(made[name].draw())[0][1][1] for name in ("11", "14", "15", "16")}
    expected = {
        "11": records[Label("dynamic", branches[0], paper_figures.HEAVY)],
        "14": records[Label("dynamic", held[0], paper_figures.UNEQUAL)],
        "15": records[Label("dynamic", plain[0], paper_figures.SPATIAL_DYNAMIC)],
        "16": records[Label("dynamic", held[0], paper_figures.SPATIAL_DYNAMIC)],
    }
    drawn = {name: figure.draw for name, figure in made.items()}
    assert {name: draw.func.__name__ for name, draw in drawn.items()} == {
        **dict.fromkeys(("4", "8", "12"), "plot_poses"),
        **dict.fromkeys(("5", "6"), "plot_violations"),
        **dict.fromkeys(("11", "14", "15", "16"), "plot_rates"),
        "13": "plot_accelerations",
    }
    spans = {
        name: (draw.args[0].name, draw.args[2]) for name, draw in drawn.items() if name in ("4", "8", "12")
    }
    assert spans == {
        "4": ("four_bar", None),
        "8": ("five_bar", None),
        "12": ("planar_slider_crank_heavy", (3.4, 4.8)),
    }
    assert {name: list(drawn[name].args[1]) for name in spans} == {name: list(shown[name]) for name in spans}
    assert rates == {n: r["bodies"]["b"]["angular_velocity"][1][2] for n, r in expected.items()}
