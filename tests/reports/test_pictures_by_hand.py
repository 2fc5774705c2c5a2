"""Pictures of a report on plain records / sizes, places, curves and marks worked out by hand."""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
from types import SimpleNamespace

import numpy as np
import pytest
from test_figures_by_hand import SCENE, group, moving, plain

from crosscheck.paper.runs import Label
from mbref.trajectory import Trajectory
from reports import engine_looks, figures, ladders, mechanisms, places, speed_figure
from reports.runs import Run, SceneRuns
from reports.sections import mechanism, paper_figures, paper_teaching, speed

SPEEDS = (1.0, 1.0, 1.0)


def test_places_of_plain_names_are_the_names_and_others_have_a_number():
    run = Run({"key": "0123456789abcdef"})
    assert places.of_run(run) == "k-0123456789ab"
    assert places.of_family("four_bar", ("a", "x")) == "r-four_bar-a-x"
    assert places.of_cell("four_bar", ("a", "x")) == "c-four_bar-a-x"
    first, second = (places.of_family("s", ("a", family)) for family in ("x+y", "x y"))
    assert second == "r-s-a-x-y" and re.fullmatch(r"r-s-a-x-y-[0-9a-f]{8}", first)
    assert places.of_family("s", ("a", "x-y")) not in (first, second)
    assert re.fullmatch(r"r-s-a-y-[0-9a-f]{8}", places.of_family("s", ("a", "+y+"))), "no dash at the ends"


RECORDS = (  # errors 1e-12 to 1, times 0.01 to 100 s: twelve decades and four
    plain("a", "x", 1.0, 0.01, step=0.1),
    plain("a", "x", 1e-6, 1.0, step=0.01),
    plain("a", "defaults", 1e-12, 100.0, step=0.001),
    plain("b", "y", 1e-3, 10.0, step=0.1),
    plain("b", "y", None, 10.0, "NOT_CONVERGED", 0.25, step=0.2),
)


def element(records=RECORDS) -> ET.Element:
    return ET.fromstring(speed_figure.speed_svg(group(records), "what it shows"))


def test_marks_of_the_speed_figure():
    """An error of 1e-6 is in the middle of 1e-12 to 1; a time of 1 s in the middle of 0.01 to 100 s."""
    svg = element()
    assert svg.get("height") == "446" and svg.find("desc").text == "what it shows"
    assert svg.find("title").text == "Time of stepping against the largest error on block"
    inner = svg.find("svg")
    assert (inner.get("y"), inner.get("height")) == ("26", "380")
    found = {}
    for curve in inner.findall("g"):
        spots = [(a.find("svg").get("x"), a.find("svg").get("y")) for a in curve.findall("a")]
        lines = [[line.get(k) for k in ("x1", "y1", "x2", "y2")] for line in curve.findall("line")]
        found[curve.get("data-engine"), curve.get("data-family")] = (spots, lines, curve.get("class"))
    tone = engine_looks.TONES - 1
    assert found == {
        ("a", "x"): (
            [("100.00%", "380.0"), ("50.00%", "190.0")],
            [["100.00%", "380.0", "50.00%", "190.0"]],
            f"tone{tone} ",
        ),
        ("a", "defaults"): ([("0.00%", "0.0")], [], f"tone{tone} hollow"),
        ("b", "y"): ([("75.00%", "95.0")], [], f"tone{tone} "),
    }


def test_curves_of_an_engine_have_their_dashes_in_turn():
    pairs = [plain(e, f, 10.0**-k, 1.0 + k, step=0.1**k) for e, f in ("ax", "ay", "az", "bx") for k in (1, 2)]
    dashes = [line.get("stroke-dasharray") for line in element(tuple(pairs)).iter("line") if line.get("x1")]
    assert dashes == ["", "6 4", "2 4", ""], "the first curve of an engine is not dashed"


def test_a_mark_has_the_numbers_of_its_run():
    [mark] = [a for a in element().iter("a") if a.get("data-error") == "0.001"]
    assert mark.get("href") == f"#{places.of_run(Run(RECORDS[3]))}"
    assert mark.find("title").text == "b, y, step=0.1: error 1.00e-03, 10 s, 10 steps"
    data = {k: mark.get(f"data-{k}") for k in ("seconds", "setting", "steps", "outcome")}
    assert data == {"seconds": "10", "setting": "step=0.1", "steps": "10", "outcome": "COMPLETED"}
    assert mark.find("svg/circle").get("r") == "12"
    assert mark.find("svg/path").get("d") == engine_looks.MARKS[-1]


def test_zones_and_ticks_of_the_speed_figure():
    """The axis has 12 decades: 4 are right (to 1e-8), 6 inaccurate (to 1e-2), 2 wrong and without label."""
    inner = element().find("svg")
    zones = [(z.get("class"), z.get("x"), z.get("width")) for z in inner.findall("rect")]
    assert zones == [
        ("zone right", "0.00%", "33.33%"),
        ("zone inaccurate", "33.33%", "50.00%"),
        ("zone wrong", "83.33%", "16.67%"),
    ]
    texts = [(t.get("x"), t.get("y"), t.text) for t in inner.findall("text")]
    assert texts[:2] == [("16.67%", "-9", "right"), ("58.33%", "-9", "inaccurate")]
    assert texts[2:7] == [
        ("-9", "384.0", "10 ms"),
        ("-9", "289.0", "100 ms"),
        ("-9", "194.0", "1 s"),
        ("-9", "99.0", "10 s"),
        ("-9", "4.0", "100 s"),
    ]
    assert [t for *_, t in texts[7:]] == ["10⁻¹²", "10⁻¹⁰", "10⁻⁸", "10⁻⁶", "10⁻⁴", "10⁻²", "10⁰"]
    assert [x for x, *_ in texts[7:9]] == ["0.00%", "16.67%"] and {y for _, y, _ in texts[7:]} == {"400"}
    grid = [(line.get("y1"), line.get("x2")) for line in inner.findall("line")]
    assert grid == [(f"{y:.1f}", "100%") for y in (380, 285, 190, 95, 0)] + [("380", "100%")]
    assert [list(speed_figure._ticks(0, n)) for n in (1, 7, 8)] == [[0, 1], [*range(8)], [0, 2, 4, 6, 8]]


def test_zones_that_reach_the_end_of_the_axis_and_narrow_ones():
    """The axis ends at 1e-7: half of it is right, half inaccurate, and none wrong. A zone has its name if it
    is wider than 18 %."""
    inner = element((plain("a", "x", 1e-9, 1.0, step=0.1), plain("a", "x", 1e-7, 2.0, step=0.2))).find("svg")
    zones = [(z.get("class"), z.get("x"), z.get("width")) for z in inner.findall("rect")]
    assert zones == [("zone right", "0.00%", "50.00%"), ("zone inaccurate", "50.00%", "50.00%")]
    places_ = {1e-9: 0.0, 1e-8: 18.0, 1e-2: 36.5}
    axes = SimpleNamespace(x0=-9, x=places_.__getitem__)
    shown = [
        re.sub("<text.*>(.*)</text>", r"\1", line) for line in speed_figure._zones(axes) if "<text" in line
    ]
    assert shown == ["inaccurate", "wrong"]
    axes.x = {1e-9: 0.0, 1e-8: 0.5, 1e-2: 100.0}.__getitem__
    assert sum('width="0.50%"' in line for line in speed_figure._zones(axes)) == 1, "however narrow"
    axes.x = {1e-9: 0.0, 1e-8: 0.0, 1e-2: 100.0}.__getitem__
    assert [line.count("inaccurate") for line in speed_figure._zones(axes)] == [1, 1]


def test_one_value_spans_a_decade():
    assert speed_figure._decades([1e-3]) == (-3, -2) and speed_figure._decades([2e-3, 0.5]) == (-3, 0)
    [mark] = element((plain("a", "x", 1e-3, 1.0, step=0.1),)).iter("a")
    assert (mark.find("svg").get("x"), mark.find("svg").get("y")) == ("0.00%", "380.0")


def test_switches_of_engines():
    tone = engine_looks.TONES - 1
    look = (tone, engine_looks.MARKS[tone])
    assert speed_figure.toggles(group(RECORDS)) == [("a", *look, ["x", "defaults"]), ("b", *look, ["y"])]


def violated(times, values, **metrics: float) -> Run:
    record = {**plain("a", "x", metrics.pop("error", 1e-3), 1.0), "times": times, "violation": values}
    return Run({**record, "metrics": {**record["metrics"], **metrics}})


def growing(power: float) -> Run:
    times = np.linspace(0.0, 2.0, 21)
    return violated(times.tolist(), (1e-6 * times**power).tolist())


def test_growth_of_a_violation_over_time():
    runs = {"1e-6": growing(2.0), "1e-9": growing(1.0)}
    drawing = paper_teaching.plot_growth(runs)
    [axes] = drawing.axes
    first, second = axes.lines
    assert drawing.get_size_inches().tolist() == [7.2, 3.8]
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("t (s)", "violation of positions")
    assert first.get_xydata()[0] == pytest.approx([0.1, 1e-8]) and len(first.get_xydata()) == 20
    assert [line.get_label() for line in (first, second)] == ["rtol 1e-6", "rtol 1e-9"]
    assert [line.get_color() for line in (first, second)] == list(figures.COLOURS[:2])
    assert first.get_linestyle() != second.get_linestyle()
    assert paper_teaching.exponent(runs["1e-6"]) == pytest.approx(2.0)
    rounding = violated([0.0, 1.0, 2.0], [0.0, 1e-16, 2e-16])
    assert math.isnan(paper_teaching.exponent(rounding)) and math.isnan(
        paper_teaching.exponent(violated([0.0, 0.01], [0.0, 1.0]))
    )
    assert paper_teaching._growth_caption(runs).startswith(
        "Figure 2's procedure: violation of the positions by LM2 without stabilisation, over the tolerance. "
        "It grows about as t^1.5; after 2 s: 4.0e-06 at rtol 1e-6, 2.0e-06 at rtol 1e-9."
    )
    assert ". It is of rounding; " in paper_teaching._growth_caption({"1e-6": rounding})


def test_runs_of_one_part_by_their_variants():
    records = {
        Label("growth", "LM2", "x", "1e-6"): growing(1.0).record,
        Label("gain", "LM2", "x", "5"): growing(2.0).record,
        Label("gain", "LM2", "x", "10"): growing(3.0).record,
    }
    found = paper_teaching._varied(records, "gain")
    assert list(found) == ["5", "10"] and found["10"].record["violation"] == growing(3.0).record["violation"]


def test_violation_and_error_over_the_gain():
    """α = 0 stands at a third of the smallest gain; a violation of zero at 1e-17."""
    errors = {"0": (1e-3, 1e-4), "5": (0.0, 1e-5), "10": (1e-9, 1e-6)}
    runs = {a: violated([0.0], [0.0], violation_position=v, error=e) for a, (v, e) in errors.items()}
    drawing = paper_teaching.plot_gains(runs)
    [axes] = drawing.axes
    violation, error = axes.lines
    assert drawing.get_size_inches().tolist() == [7.2, 3.4]
    assert violation.get_xdata().tolist() == error.get_xdata().tolist() == [5 / 3, 5.0, 10.0]
    assert violation.get_ydata().tolist() == [1e-3, 1e-17, 1e-9]
    assert error.get_ydata().tolist() == [1e-4, 1e-5, 1e-6]
    assert [line.get_marker() for line in (violation, error)] == ["o", "s"]
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    assert [line.get_label() for line in axes.lines] == ["violation", "error"]
    table = paper_teaching._gains(runs)
    assert "least here with α = β = 5;" in table.caption and table.right == {0, 1, 2, 3, 4}
    assert table.rows[2] == ("10", "1.0e-09", "–", "1.0e-06", "10", "2 s")


def test_violations_over_time():
    runs = {"one": violated([0.0, 0.5], [1e-3, 1e-2]), "two": violated([0.0, 1.0], [0.0, 1.0])}
    drawing = paper_teaching.plot_violations(runs)
    [axes] = drawing.axes
    assert [line.get_xydata().tolist() for line in axes.lines] == [
        [[0.0, 1e-3], [0.5, 1e-2]],
        [[0.0, 1e-17], [1.0, 1.0]],
    ]
    assert drawing.get_size_inches().tolist() == [7.2, 3.8] and axes.get_yscale() == "log"
    assert [line.get_label() for line in axes.lines] == ["one", "two"]
    row = paper_teaching._remedies(runs).rows[0]
    assert row == ("one", "–", "–", "1.0e-03", "10", "1e+03", "20 s"), "1 s for 10 steps over 1 s"


def test_sizes_of_other_figures():
    """Sizes in inches: wide enough for a page, and no higher than wide."""
    runs = [moving("a", "x", SPEEDS)]
    drawn = {
        "rates": paper_figures.plot_rates({"x": runs[0]}),
        "speed": speed.plot(group(RECORDS), speed.failed(group(RECORDS).runs)),
    }
    sizes = {name: figure.get_size_inches().tolist() for name, figure in drawn.items()}
    assert sizes == {"rates": [7.2, 3.6], "speed": [7.6, 4.8]}
    _, panels = figures.canvas(rows=3)
    panels[0].set_xlim(0, 7)
    assert panels[2].get_xlim() == (0, 7), "panels have one axis of time"
    tops = [axes.get_subplotspec().rowspan.start for axes in panels]
    assert tops == [0, 1, 2]


def test_the_most_accurate_motion_is_shown():
    worse = moving("a", "x", SPEEDS, asked={"options": {}}, metrics={"error": 1e-2, "error_bound": 0.0})
    better = moving("b", "y", SPEEDS, asked={"options": {}}, metrics={"error": 1e-5, "error_bound": 0.0})
    early = moving("c", "z", SPEEDS, metrics={"error": 1e-9, "error_bound": 0.0}, outcome="STEP_FAILED")
    nothing = {"times": [], "bodies": {"b": {k: [] for k in worse.record["bodies"]["b"]}}}
    lost = Run({**moving("d", "w", SPEEDS).record, **nothing})
    assert mechanism._most_accurate(SceneRuns(SCENE, [worse, better, early, lost])).label == "b y"
    assert mechanism._most_accurate(SceneRuns(SCENE, [early, lost])).label == "c z"
    assert mechanism._most_accurate(SceneRuns(SCENE, [lost])) is None
    *_, text = mechanism.render(SceneRuns(SCENE, [lost]))
    assert text.text == "No run reached a sample, so there is no motion to show."
    *_, figure = mechanism.render(SceneRuns(SCENE, [worse, better]))
    assert figure.caption.startswith(
        "Poses of b y (no settings; error 1.00e-05) from t = 0 s to 1 s, the last"
    )
    assert figure.name == "block-mechanism"


def test_counts_of_a_free_block():
    table = mechanism._counts(SceneRuns(SCENE, []))
    assert dict(zip(table.header, table.rows[0], strict=True)) == {
        "Coordinates": "6",
        "Rows": "0",
        "Rank": "0",
        "Redundant rows": "0",
        "Degrees of freedom": "6",
    }
    assert table.right == {0, 1, 2, 3, 4}


def cubic(times: np.ndarray) -> Trajectory:
    """A body on x = t³."""
    still = np.zeros((len(times), 1, 3))
    position, velocity = still.copy(), still.copy()
    position[:, 0, 0], velocity[:, 0, 0] = times**3, 3 * times**2
    turn = np.tile([1.0, 0.0, 0.0, 0.0], (len(times), 1, 1))
    return Trajectory("s", "e", "1", "m", {}, times, ("b",), position, turn, velocity, still)


def test_path_between_samples_is_cubic():
    points = mechanisms.path(cubic(np.array([0.0, 1.0, 2.0])), 0)
    assert points.shape == (36, 3)
    assert points[:, 0] == pytest.approx(np.linspace(0.0, 2.0, 36) ** 3, abs=1e-14)
    assert mechanisms.path(cubic(np.array([1.0])), 0).tolist() == [[1.0, 0.0, 0.0]]
    assert mechanisms.path(cubic(np.array([0.0, 1.0])), 0).shape == (24, 3), "two samples suffice"


def test_poses_are_thin_and_pale_before_the_last():
    layers = mechanisms._poses(cubic(np.linspace(0.0, 1.0, 21)), 5, 4.0)
    assert [layer.motion.times.tolist() for layer in layers] == [[0.0], [0.25], [0.5], [0.75], [1.0]]
    assert [layer.look.thickness for layer in layers] == [2.0, 2.0, 2.0, 2.0, 4.0]
    assert [layer.look.opacity for layer in layers[:4]] == pytest.approx([0.15, 0.23, 0.31, 0.39])
    assert [len(layer.more) for layer in layers] == [0, 0, 0, 0, 2], "signs and names at the last pose"
    assert len(mechanisms._poses(cubic(np.array([0.0, 1.0])), 5, 4.0)) == 2


def test_samples_of_a_motion():
    motion = cubic(np.array([0.0, 1.0, 2.0]))
    assert mechanisms.sample(motion, 1).position[:, 0, 0].tolist() == [1.0]
    assert mechanisms.sample(motion, slice(1, None)).times.tolist() == [1.0, 2.0]
    record = moving("a", "x", SPEEDS).record
    record["bodies"]["b"]["position"] = [[0.0, 0.0, float(k)] for k in range(3)]
    shown = mechanisms.motion_of(SCENE, record)
    assert shown.position[:, 0, 2].tolist() == [0.0, 1.0, 2.0] and not shown.velocity.any()


def test_ladders_are_kept_in_a_folder_that_does_not_exist_yet(tmp_path):
    def record(scene: str, family: str) -> dict:
        made = {name: name for name in (*ladders.KEPT, *ladders.ORIGIN)}
        named = {"scene": scene, "family": family, "key": scene + family, "bodies": [1]}
        return {**made, **named, "engine": "e"}

    source = tmp_path / "source"
    source.mkdir()
    lines = [record("b", "x"), record("a", "y"), record("a", "x")]
    (source / ladders.FILE).write_text("".join(ladders.strict_json(line) + "\n" for line in lines))
    for _ in range(2):
        ladders.keep(source, tmp_path / "new" / "place")
    kept = list(ladders.looked_at(tmp_path / "new" / "place" / ladders.FILE).values())
    assert [r["key"] for r in kept] == ["ax", "ay", "bx"] and "bodies" not in kept[0]
