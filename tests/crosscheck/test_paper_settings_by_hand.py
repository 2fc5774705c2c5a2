"""Settings and labels of the paper's runs, and the page of findings / numbers and names by hand."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.engine import Setting
from crosscheck.findings import document, finding
from crosscheck.findings.finding import Finding
from crosscheck.paper import cells, illustration, runs, settings, singular, store
from crosscheck.paper.cells import Cell, Match
from crosscheck.paper.runs import FREE, HEAVY, SPATIAL_DYNAMIC, UNEQUAL, Label
from crosscheck.paper.settings import BASE, Variant
from mbref.records import append, stored
from mbref.scene import Body, Distance, Revolute, Scene
from mbref.trajectory import Outcome


# --- settings ---------------------------------------------------------------------------------------------
def test_numbers_that_the_table_of_settings_states():
    """The names of the settings state the numbers that the runs take."""
    limits = settings.LIMITS
    for stated in ("rtol", "largest_step", "largest_turn", "violation", "rank_tolerance", "compared"):
        assert f"{stated} = {limits[stated]}" in settings.REASONS, stated
    assert limits["compared"] is False and limits["most_steps"] == 1_000_000
    assert f"smallest_step = forced_step = {limits['smallest_step']}" in settings.REASONS
    assert limits["forced_step"] == limits["smallest_step"] == 3e-6
    assert "data errors 1e-11 m" in settings.REASONS and settings.SIZE == 1e-11
    assert settings.ALF == {"alpha": 1e4, "epsilon": 1e-11, "iterations": 20, "omega": 10, "mu": 1}
    assert "ALF α = 1e4, ε = 1e-11, ω = 10, μ = 1, 20 iterations" in settings.REASONS
    texts = " ".join(settings.REASONS.values())
    assert "random between 1e-05 and 0.0001 s" in texts and "among seeds 0 to 19 (0 to 7 for" in texts
    assert "a flywheel of 30 kg m² on" in texts and settings.END == 20.0
    assert f"first step {settings.first_step(0):.2e} s" in settings.REASONS


def test_random_first_steps_and_displacements():
    """A first step is 10 to the power of a number between -5 and -4; a displacement is a part of its size."""
    for seed in (0, 3):
        share = np.random.default_rng([seed, 1]).random()
        assert settings.first_step(seed) == pytest.approx(10 ** (share - 5))
    hinges = tuple(
        Revolute(name=name, bodies=("ground", "b"), anchor=(x, 2.0, 3.0), axis=(0.0, 0.0, 1.0))
        for name, x in (("A", 1.0), ("B", 5.0))
    )
    block = Body(name="b", mass=2.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0))
    scene = Scene(name="s", body=(block,), joint=hinges)
    moved = settings.imprecise(scene, 0.25, 7)
    shares = 2 * np.random.default_rng(7).random((2, 3)) - 1
    expected = np.array([[1.0, 2.0, 3.0], [5.0, 2.0, 3.0]]) + 0.25 * shares
    assert np.array([joint.anchor for joint in moved.joint]) == pytest.approx(expected)
    bare = settings.kinematic(scene).body[0]
    assert bare.mass is bare.inertia is None
    rod = Distance(name="rod", bodies=("ground", "b"), anchors=((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)))
    with pytest.raises(ValueError, match="'rod': a distance joint has two anchors"):
        settings._anchor(rod)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_disc_on_the_crank(axis):
    """A disc of 8 kg m² about its axis has 4 kg m² about its diameters."""
    block = Body(name="b", mass=2.0, inertia=(1.0, 2.0, 3.0), position=(0.0, 0.0, 0.0))
    scene = Scene(name="s", body=(block, block.model_copy(update={"name": "c"})))
    made = settings.heavy_crank(scene, axis, 8.0)
    inertia = [1.0 + 4.0, 2.0 + 4.0, 3.0 + 4.0]
    inertia[axis] += 4.0
    assert list(made.body[0].inertia) == inertia and made.body[1:] == scene.body[1:]
    assert (made.name, made.duration) == ("s_flywheel", 20.0)


def test_settings_that_a_sweep_varies():
    varied = {v.name: (dict(v.limits), v.size, v.seed, v.integrator, dict(v.alf)) for v in settings.SWEEP}
    plain = {}, 1e-11, 0, "adams", {}

    def of(**changes: Any) -> Any:
        names = ("limits", "size", "seed", "integrator", "alf")
        return tuple(changes.get(name, value) for name, value in zip(names, plain, strict=True))

    assert varied == {
        "rtol 1e-5": of(limits={"rtol": 1e-5}),
        "violation 3e-2": of(limits={"violation": 3e-2}),
        "first step 1e-4": of(limits={"first_step": 1e-4}),
        "smallest step 1e-6": of(limits={"smallest_step": 1e-6, "forced_step": 1e-6}),
        "smallest step 1e-5": of(limits={"smallest_step": 1e-5, "forced_step": 1e-5}),
        "no forced step": of(limits={"smallest_step": 0.0, "forced_step": 0.0}),
        "rank 1e-4": of(limits={"rank_tolerance": 1e-4}),
        "no data errors": of(size=0.0),
        "data errors 1e-8 m": of(size=1e-8),
        "integrator dop853": of(integrator="dop853"),
        "α = 1e3": of(alf={"alpha": 1e3}),
        "α = 1e6": of(alf={"alpha": 1e6}),
        "ε = 1e-6": of(alf={"epsilon": 1e-6}),
        "100 iterations": of(alf={"iterations": 100}),
    }
    assert [(v.name, v.seed, v.size) for v in settings.DRAWN] == [
        (f"seed {k}", k, 1e-11) for k in range(1, 20)
    ]
    sized = [(f"1e-{n} m, seed {k}", float(f"1e-{n}"), k) for n in ("13", "12", "11", "10") for k in range(8)]
    sized += [(f"1e-0{n} m, seed {k}", float(f"1e-{n}"), k) for n in (9, 8) for k in range(8)]
    assert [(v.name, v.size, v.seed) for v in settings.SIZED] == sized
    assert settings.STRICT.limits == {"rtol": 1e-9, "violation": 1.6e-5}
    assert settings.TIGHT.limits == {"rtol": 1e-9} and settings.TIGHT.name == "rtol 1e-9"


def test_options_and_names_of_methods():
    variant = Variant("v", {"rtol": 1e-3}, seed=2, alf={"mu": 3}, integrator="rk4")
    options = variant.options()
    assert options["rtol"] == 1e-3 and options["first_step"] == settings.first_step(2)
    assert options["violation"] == 3e-3 and set(options) == {*settings.LIMITS, "first_step"}
    alf = "alf[alpha=10000,epsilon=1e-11,iterations=20,omega=10,mu={}]"
    assert settings.method("ALF + CP", variant) == f"{alf.format(3)}+partitioning/rk4"
    assert settings.method("ALF") == f"{alf.format(1)}+none/adams"
    assert settings.method("MPI (GS) + B") == "mpi-gs+baumgarte/adams"
    assert settings.method("LM1") == "lm1+none/adams" and settings.method("MPI (SVD)") == "mpi-svd+none/adams"


def test_scenes_of_the_columns():
    thetas = {name: theta for name, (_, theta) in settings.LINKAGES.items()}
    assert thetas == {
        "θ₂ = nπ": math.pi,
        "θ₂ = π/4": math.pi / 4,
        "θ₂ = π/2": math.pi / 2,
        "five-bar": math.pi / 2,
    }
    names = {column: settings.column_scene(column).name for column in (*thetas, cells.SPATIAL)}
    assert names == {
        "θ₂ = nπ": "four_bar_straight",
        "θ₂ = π/4": "four_bar_quarter",
        "θ₂ = π/2": "four_bar",
        "five-bar": "five_bar",
        cells.SPATIAL: "spatial_slider_crank_driven",
    }
    first, second = (settings.column_scene("five-bar", Variant(size=0.0, seed=k)) for k in (0, 1))
    assert first == second, "without errors the seed has no influence"


# --- runs -------------------------------------------------------------------------------------------------
@pytest.fixture
def named(monkeypatch) -> None:
    """Names stand in for the scenes."""
    monkeypatch.setattr(settings, "column_scene", lambda column, variant=BASE: (column, variant))
    monkeypatch.setattr(runs, "dynamic_scene", lambda column: ("dynamic", column))
    monkeypatch.setattr(runs, "digits_scene", lambda: "digits")


def every(step: float, count: int) -> Any:
    """Times from zero on, at equal steps (s)."""
    return pytest.approx(step * np.arange(count))


def places(found: Iterable[Label]) -> list[tuple[str, str, str]]:
    return [(label.row, label.column, label.variant) for label in found]


def test_runs_of_the_tables_and_their_draws(named):
    tables = runs.tables()
    assert places(tables) == [(c.row, c.column, BASE.name) for c in cells.CELLS]
    assert [label.part for label in tables] == ["I"] * 33 + ["II"] * 11 + ["III"] * 11
    case = tables[Label("II", "MPI (GS)", "five-bar")]
    assert case.scene == ("five-bar", BASE) and case.times == every(0.2, 101)
    assert case.engine == "mbref" and case.setting == Setting("mpi-gs+none/adams", BASE.options())
    counts = {(c.table, c.row): runs.draws(c) for c in cells.CELLS if c.table != "I"}
    assert {row for (table, row), n in counts.items() if table == "II" and n == 1} == {
        "LM2",
        "LM2 + B",
        "LM2 + CP",
    }
    assert counts["II", "MPI (SVD) + CP"] == counts["II", "MPI (GS) + CP"] == 8
    assert counts["II", "ALF"] == counts["II", "MPI (GS)"] == 20
    assert {row: n for (table, row), n in counts.items() if table == "III" and n > 1} == dict.fromkeys(
        FREE, 8
    )
    drawn = [label for label in runs.drawn() if (label.row, label.column) == ("MPI (GS)", cells.SPATIAL)]
    assert [label.variant for label in drawn] == [f"seed {k}" for k in range(1, 8)]
    assert {label.part for label in runs.drawn()} == {"drawn"}
    whole = [("ALF", "five-bar", f"seed {k}") for k in range(1, 20)]
    assert [place for place in places(runs.drawn()) if place[:2] == ("ALF", "five-bar")] == whole


def test_runs_of_the_studies(named):
    """Options of ALF are varied in ALF's rows alone."""
    sweep = runs.sweep()
    alf = {label.row for label in sweep if label.variant == "α = 1e3"}
    others = {label.row for label in sweep if label.variant == "rtol 1e-5"}
    assert alf == {"ALF", "ALF + CP"} and others == {
        *alf,
        "MPI (SVD)",
        "MPI (SVD) + B",
        "MPI (SVD) + CP",
        "MPI (GS)",
        "MPI (GS) + B",
    }
    assert ("MPI (SVD) + CP", "θ₂ = π/2", "rtol 1e-5") not in places(sweep), "the paper's run completes"
    sized = runs.sized()
    assert len(sized) == 3 * 4 * 48 and {tuple(case.times) for case in sized.values()} == {(0.12,)}
    assert {label.row for label in sized} == {"MPI (SVD)", "ALF", "ALF + CP"}
    strict = runs.strict()
    rows = {f"{row}{b}" for row in FREE for b in ("", " + B")}
    assert {label.row for label in strict} == rows and len(strict) == 6
    assert {case.setting.options["violation"] for case in strict.values()} == {1.6e-5}
    cranks = runs.settings_of_cranks()
    assert len(cranks) == 8 + 8 + 2 + 1 and list(cranks)[-1] == Label(
        "dynamic", "MPI (SVD)", UNEQUAL, "rank 1e-4"
    )
    assert cranks[list(cranks)[-1]].scene == ("dynamic", UNEQUAL)
    assert {label.row for label in cranks if label.variant == "α = 1e6"} == {"ALF", "ALF + CP"}


def test_runs_of_the_figures(named):
    found = runs.figures()
    assert [label.row for label in found if label.column == "five-bar"] == list(runs.FIGURES["five-bar"])
    assert {label.part for label in found} == {"figures"} and len(found) == 9
    assert all(case.times == every(0.002, 61) for case in found.values())
    dynamic = runs.dynamic()
    columns = [label.column for label in dynamic]
    assert [columns.count(c) for c in (HEAVY, UNEQUAL, SPATIAL_DYNAMIC)] == [8 + 2, 6, 9]
    assert dynamic[runs.PEAKS].times == every(0.01, 2001)
    smooth = dynamic[Label("dynamic", "taylor", HEAVY)]
    assert smooth.setting == Setting("taylor", {"rtol": 1e-9}) and smooth.times == every(0.1, 201)
    assert smooth.scene == ("dynamic", HEAVY) and smooth.engine == "mbref"


def test_runs_over_tolerances_and_penalties(named):
    kept = runs.kept()
    names = ["none", *(f"partitioning[kept={s}]" for s in ("0.6", "0.3", "0.1", "0.03"))]
    tolerances = ("1e-06", "1e-07", "1e-08", "1e-09")
    assert places(kept) == [(n, SPATIAL_DYNAMIC, f"rtol {rtol}") for rtol in tolerances for n in names]
    case = kept[Label("kept", names[1], SPATIAL_DYNAMIC, "rtol 1e-08")]
    assert case.setting.family == "lm2+partitioning[kept=0.6]/adams" and case.setting.options["rtol"] == 1e-8
    digits = runs.digits()
    assert len(digits) == 1 + 2 * 11 and {tuple(case.times) for case in digits.values()} == {(0.0,)}
    dual = digits[Label("digits", "alf-dual", "1e+12")]
    assert dual.setting.family == "alf-dual[alpha=1e+12,epsilon=1e-14,iterations=100]+none"
    assert digits[Label("digits", "mpi-svd", "")].setting.family == "mpi-svd+none"
    assert {label.column for label in digits} - {""} == {f"{10.0**k:g}" for k in range(2, 13)}
    assert {len(case.times) for case in kept.values()} == {201}
    gains = [float(label.variant) for label in runs.gains()]
    assert all(case.times == every(0.02, 101) for case in (*runs.gains().values(), *runs.growth().values()))
    assert gains == [0, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000]
    assert (
        runs.gains()[Label("gain", "LM2 + B", SPATIAL_DYNAMIC, "5")].setting.family
        == "lm2+baumgarte[5,5]/adams"
    )
    assert [float(label.variant) for label in runs.growth()] == [1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9]


def test_timed_runs_and_pairs(named, monkeypatch):
    timed = runs.timed()
    assert timed[Label("timed", "LM2", cells.SPATIAL)].times == every(0.2, 6)
    ends = {
        column: {case.times[-1] for label, case in timed.items() if label.column == column}
        for column in (cells.SPATIAL, SPATIAL_DYNAMIC)
    }
    assert ends == {cells.SPATIAL: {1.0}, SPATIAL_DYNAMIC: {20.0}} and {label.part for label in timed} == {
        "timed"
    }
    assert [label.row for label in timed] == [*cells.COUNTS_III, *cells.COUNTS_IV]
    parts = {"formulation": ["lm1", "alf"], "stabilisation": ["none", "projection"]}
    monkeypatch.setattr(runs, "engine", lambda name: SimpleNamespace(family_parts=lambda: parts))
    pairs = runs.pairs()
    assert [(label.row, label.column) for label in pairs] == [
        ("lm1", "none"),
        ("lm1", "projection"),
        ("alf", "none"),
        ("alf", "projection"),
    ]
    assert [case.setting.family.partition("+")[2] for case in pairs.values()] == [
        "none/adams",
        "projection/adams",
    ] * 2
    assert all(case.scene == (cells.SPATIAL, BASE) and len(case.times) == 101 for case in pairs.values())


def test_all_runs_and_their_order(named, monkeypatch):
    parts = [label.part for label in runs.cases()]
    assert list(dict.fromkeys(parts)) == [
        *(
            "I",
            "II",
            "III",
            "drawn",
            "strict",
            "figures",
            "dynamic",
            "peaks",
            "kept",
            "tight",
            "growth",
            "gain",
        )
    ]
    nothing = SimpleNamespace(family_parts=lambda: {"formulation": ["lm1"], "stabilisation": ["none"]})
    monkeypatch.setattr(runs, "engine", lambda name: nothing)
    assert list(dict.fromkeys(label.part for label in runs.studies())) == [
        "sweep",
        "sized",
        "dynamic",
        "pairs",
        "digits",
    ]


def test_failed_runs_are_repeated_with_a_sample_before_their_end(named):
    """Runs that end before the first sample, at 0.2 s, have a sample at 95 % of their time."""
    ends = {0: ("VIOLATION", 0.1), 1: ("VIOLATION", 0.2), 2: ("VIOLATION", 0.0), 3: ("COMPLETED", 0.1)}
    records = {
        Label(c.table, c.row, c.column): dict(
            zip(("outcome", "t_end"), ends.get(k, ("COMPLETED", 20.0)), strict=True)
        )
        for k, c in enumerate(cells.CELLS)
    }
    [(label, case)] = runs.follow_ups(records).items()
    first = cells.CELLS[0]
    assert label == Label("error", first.row, first.column)
    assert list(case.times) == [pytest.approx(0.095)] and case.scene == (first.column, BASE)


def test_scenes_of_the_dynamic_analysis():
    inertia = {}
    for column in (UNEQUAL, SPATIAL_DYNAMIC):
        made = runs.dynamic_scene(column)
        plain = runs.SCENES["planar_slider_crank" if column == UNEQUAL else "spatial_slider_crank"]()
        inertia[column] = np.subtract(made.body[0].inertia, plain.body[0].inertia)
    assert inertia[SPATIAL_DYNAMIC] == pytest.approx([15.0, 30.0, 15.0])
    half = settings.FLYWHEEL / 2
    assert inertia[UNEQUAL] == pytest.approx([half, half, 2 * half])
    assert runs.dynamic_scene(HEAVY).name == "planar_slider_crank_heavy"
    assert runs.teaching_scene().name == "spatial_slider_crank_flywheel"
    assert runs.digits_scene().name == "spatial_slider_crank_gravity"


def test_labels_as_text_and_records_by_cell():
    assert str(Label("II", "LM2", "x")) == "Table II, LM2, x" and str(Label("IV", "LM2", "x")) == "IV, LM2, x"
    assert str(Label("sweep", "", "x", "v")) == "sweep, x, v"
    labels = [
        Label("I", "ALF", "x"),
        Label("I", "ALF", "x", "v"),
        Label("II", "ALF", "x", "w"),
        Label("sweep", "ALF", "x", "s"),
        Label("I", "ALF", "y", "t"),
        Label("I", "LM2", "x", "u"),
    ]
    records: Any = {label: k for k, label in enumerate(labels)}
    cell = Cell("I", "ALF", "x", None, "")
    assert runs.found(records, cell, ("tables",)) == {BASE.name: 0, "v": 1}
    assert runs.found(records, cell, ("sweep",)) == {"s": 3}
    assert runs.has(records, "sweep") and not runs.has(records, "drawn")


def test_cells_and_the_outcomes_that_match_them():
    assert (
        str(Cell("I", "r", "c", 0.0126, "b")) == "0.0126 s b" and str(Cell("I", "r", "c", None, "")) == "20 s"
    )
    assert cells._cell("I", "r", "c", "0.5d") == Cell("I", "r", "c", 0.5, "d")
    assert cells._cell("I", "r", "c", "20") == Cell("I", "r", "c", None, "")
    at_start = Cell("I", "r", "c", 0.0, "c")
    found = [cells.match(at_start, Outcome.VIOLATION, t) for t in (0.002, 0.0021)]
    assert found == [Match.SAME, Match.OTHER_TIME]
    lasting = Cell("I", "r", "c", None, "")
    ends = [cells.match(lasting, outcome, 20.0) for outcome in (Outcome.COMPLETED, Outcome.VIOLATION)]
    assert ends == [Match.SAME, Match.DIFFERENT]
    assert cells.match(at_start, Outcome.COMPLETED, 0.0) is Match.DIFFERENT
    early = [cells.match(Cell("I", "r", "c", 1.0, "c"), Outcome.VIOLATION, t) for t in (0.9981, 0.9979)]
    assert early == [Match.SAME, Match.OTHER_TIME]


def test_records_without_the_key_of_a_label(tmp_path):
    append(tmp_path / store.FILE, {"key": "k"})
    (tmp_path / store.INDEX).write_text(
        '{"[\\"I\\", \\"r\\", \\"c\\"]": "k", "[\\"I\\", \\"r\\", \\"d\\"]": "x"}'
    )
    assert store.indexed(tmp_path) == {Label("I", "r", "c"): {"key": "k"}}
    assert store._short([1.23456789, [0.000123456789]]) == [1.23457, [0.000123457]]


# --- singular positions -----------------------------------------------------------------------------------
def test_the_last_time_belongs_to_the_crossings():
    """From θ₂ = π at the start, 0 and -π follow after π/124.8 and 2π/124.8 s, far beyond 1000 of them."""
    first = math.pi / 124.8
    assert singular.crossings(math.pi, first) == [(0.0, 1), (first, 0)]
    assert singular.crossings(math.pi, np.nextafter(first, 0.0)) == [(0.0, 1)]
    assert singular.crossings(1.0, 0.0) == [], "the first one lies ahead"
    assert len(singular.crossings(math.pi, 1200.5 * first)) == 1201


def test_singular_values_are_of_rows_of_unit_length(monkeypatch):
    """Angular columns are over the scene's length of 2 m: a row (3, 8) becomes (3, 4) / 5."""
    body = Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0))
    scene = Scene(name="s", body=(body,))
    row = np.array([[3.0, 0.0, 0.0, 8.0, 0.0, 0.0], [0.0, 0.0, 7.0, 0.0, 0.0, 0.0]])
    still = SimpleNamespace(
        times=np.array([0.0, 1.0]), position=np.zeros((2, 1, 3)), orientation=np.zeros((2, 1, 4))
    )
    asked = []
    monkeypatch.setattr(singular, "truth_for", lambda given: SimpleNamespace(poses=lambda times: still))
    monkeypatch.setattr(singular.constraints, "scene_length", lambda given: 2.0)
    monkeypatch.setattr(singular.constraints, "jacobian", lambda s, t, r, p: asked.append(t) or (row, None))
    values = singular.scaled_singular_values(scene, still.times)
    assert values == pytest.approx(np.ones((2, 2))) and asked == [0.0, 1.0]
    monkeypatch.setattr(singular, "truth_for", lambda given: None)
    with pytest.raises(ValueError, match="s: no exact motion is known"):
        singular.scaled_singular_values(scene, still.times)
    assert singular._of_unit_length(np.array([[3.0, 4.0], [0.0, 2.0]])).tolist() == [[0.6, 0.8], [0.0, 1.0]]


def test_errors_of_the_right_hand_side_near_a_singular_position(monkeypatch):
    """The error is a part of γ, in the direction of the smallest singular value that is not zero."""
    rows = np.array([[0.0, 2.0, 0.0], [5.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    asked: list[Any] = []
    monkeypatch.setattr(singular.constraints, "initial_poses", lambda scene: ("r", "p"))
    monkeypatch.setattr(singular.constraints, "jacobian", lambda scene, t, r, p: (rows, None))
    monkeypatch.setattr(singular, "bias", lambda scene: np.array([-6.0, 0.0, 0.0]))
    monkeypatch.setattr(singular, "_iterations", lambda *given: asked.append(given) or 7)
    assert singular.alf_iterations(0.3, 0.25) == 7
    [(d, gamma, alpha, epsilon)] = asked
    assert d.tolist() == [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
    assert (alpha, epsilon) == (1e4, 1e-11)
    assert np.abs(gamma - [3.0, 0.0, 0.0]) == pytest.approx([0.75, 0.0, 0.0]), "two rows are one"


def test_the_committed_explanation_answers_the_present_question():
    """Settings and constants of the explanation are those of the record, so that nothing is computed."""
    path = Path(__file__).parents[2] / "reports" / "paper" / "paper-illustration.jsonl"
    assert illustration._key() in stored(path)


def test_residuals_on_the_fold():
    """The crank turns 0.2 rad further from π: the joints hold; from 0 the driver is off by 0.2 rad."""
    assert singular.fold_residual(math.pi, -0.2) < 1e-14
    assert singular.fold_residual(0.0, -0.2) == pytest.approx(0.2)


# --- the page of findings ---------------------------------------------------------------------------------
PROOF = Finding("drift", "mujoco", "a-package", "1.0", "It drifts.", "It stays.", "A cause.", unit="m")


def test_the_page_of_findings(monkeypatch, tmp_path):
    """A number of a script, a crash, and a scene at a setting."""
    (tmp_path / "s.toml").write_text("\nname = 's'\n\n")
    found = [
        dataclasses.replace(PROOF, measured=0.012345, script="\nprint(1)\n"),
        dataclasses.replace(PROOF, name="end", script="import os", crashes=True, measured=0.5),
        dataclasses.replace(
            PROOF,
            name="far",
            measured=2.0,
            unit="",
            scene="s.toml",
            family="f",
            options={"step": 0.1, "n": 4},
        ),
    ]
    monkeypatch.setattr(document, "findings", lambda: found)
    monkeypatch.setattr(document, "FOLDER", tmp_path)
    assert document.page() == document.HEAD + "\n" + "\n".join(
        [
            "| finding | engine | version | measured |",
            "| --- | --- | --- | --- |",
            "| [drift](#drift) | mujoco | 1.0 | 0.0123 m |",
            "| [end](#end) | mujoco | 1.0 | the process ends |",
            "| [far](#far) | mujoco | 1.0 | 2 |",
            "",
            *("## drift\n", "a-package 1.0. It drifts.\n", "Right is: It stays.\n", "A cause.\n"),
            "```python\nprint(1)\n```\n",
            "`crosscheck findings --recheck drift`\n",
            *("## end\n", "a-package 1.0. It drifts.\n", "Right is: It stays.\n", "A cause.\n"),
            "```python\nimport os\n```\n",
            "`crosscheck findings --recheck end`\n",
            *("## far\n", "a-package 1.0. It drifts.\n", "Right is: It stays.\n", "A cause.\n"),
            "Scene `s.toml` at the setting `f` (step 0.1, n 4):\n",
            "```toml\nname = 's'\n```\n",
            "`crosscheck findings --recheck far`\n",
            "",
        ]
    )


def test_a_finding_without_a_limit_is_gone():
    """No number exceeds a limit that is not given; a finding has no number, script or crash unless given."""
    assert math.isinf(PROOF.wrong_above) and math.isnan(PROOF.measured)
    assert not PROOF.crashes and not PROOF.script and PROOF.options == {}
    assert PROOF._of_number("1", 1e300).status is finding.Status.GONE
    assert finding.SAMPLES == 11 and {found.name for found in finding.findings()}
