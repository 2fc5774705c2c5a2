"""Sections: numbers and words in the blocks, from made-up records; nothing is simulated."""

import dataclasses
import re
from pathlib import Path

import pytest

import mbref
from crosscheck.conformance.suite import Conformance, Verdict
from crosscheck.judge.constraints import scene_length
from crosscheck.judge.model_identity import gate_times
from crosscheck.judge.truth import truth_for
from mbref.motions.trajectory import Outcome
from reports import sections
from reports.blocks import Figure, Heading, Table, Text
from reports.runs import Run, SceneRuns, by_scene
from tests.reports.synthetic import groups, nothing, record, records, scene

VERIFIED = [Conformance("mujoco", "1.0", [Verdict("truth", "door", "pass")]).to_record()]


def table(parts, word: str) -> Table:
    [found] = [b for b in parts if isinstance(b, Table) and word in b.header]
    return found


def column(found: Table, name: str) -> dict[tuple[str, str], str]:
    """Cells of a column by engine and family."""
    return {tuple(row[:2]): row[list(found.header).index(name)] for row in found.rows}


@pytest.fixture(scope="module")
def everything():
    return sections.blocks(groups(), verified=VERIFIED)


def test_page_on_comparisons_lists_all_sections_of_a_report_in_their_order():
    """The page is docs/compare.md."""
    page = (Path(__file__).parents[2] / "docs" / "compare.md").read_text()
    listed = page.split("## Sections of a report")[1].split("The section `conformance`")[0]
    assert re.findall(r"`(\w+)`", listed) == [*sections.NAMES, "stability", "closed_loops", "paper"]


@pytest.mark.parametrize("name", sections.NAMES)
def test_section_rendered_alone_has_blocks_of_the_whole_report_and_of_no_other_section(name, everything):
    """Headings and tables are compared by their text."""
    alone, whole = (
        {b.text if isinstance(b, Heading) else b.caption for b in parts if isinstance(b, Heading | Table)}
        for parts in (sections.blocks(groups(), [name], VERIFIED), everything)
    )
    assert alone < whole


def test_summary_shows_costs_errors_and_failures_of_the_records():
    """mbref's error is 1e-3 in 10 ms at its coarsest step: the cheapest at 1e-3, ratio 1.0. MuJoCo "tuned"
    ends at 8e-3 / 2² and "defaults" is off by 0.5; Exudyn's runs did not converge."""
    found = table(sections.summary.render(groups()[:1]), "Least error")
    at = column(found, "At 1e-3")
    assert at["mbref", "mpi-svd+projection"] == "1.0", at
    assert at["mujoco", "tuned"] == at["mujoco", "defaults"] == "–", at
    assert column(found, "Completed")["exudyn", "tuned"] == "0 of 2", found.rows
    assert column(found, "Wrong or failed")["exudyn", "tuned"] == "NOT_CONVERGED from 0.01 s", found.rows
    assert column(found, "Wrong or failed")["mujoco", "defaults"] == "1 with error above 1e-2", found.rows
    assert column(found, "Least error")["mujoco", "tuned"] == "2.00e-03", found.rows
    assert column(found, "Its settings")["mujoco", "tuned"] == "step=0.025", found.rows
    assert "at 1e-3 mbref mpi-svd+projection (10 ms), at 1e-6 none" in found.caption, found.caption


def test_published_problem_accepts_a_run_by_its_own_measure():
    """The measure of the H-frame is the largest distance of its block from the truth (m). No accepted error
    is published, so that the project's 1e-6 m applies. The block is off by 1.1e-6 m, by 0.9e-6 m, or exact.
    A scene with other masses is not the published problem."""
    frame = scene("h_frame")
    length = scene_length(frame)
    runs = [
        record("a", "x", 1.1e-6 / length, 0.1, a_scene=frame),
        record("b", "y", 0.9e-6 / length, 0.1, a_scene=frame),
        record("c", "z", 0.0, 0.1, a_scene=frame),
    ]
    found = table(sections.published.render(by_scene(runs, {frame.name: frame})), "Accepted")
    assert column(found, "Accepted") == {("a", "x"): "no", ("b", "y"): "yes", ("c", "z"): "yes"}
    errors = {("a", "x"): "1.1e-06", ("b", "y"): "9.0e-07", ("c", "z"): "< 1e-14"}
    assert column(found, "Error") == errors
    heavier = frame.with_(body=tuple(b.model_copy(update={"mass": 1.0}) for b in frame.body))
    assert sections.published.render(by_scene(runs, {frame.name: heavier})) == []


def test_best_run_may_end_within_rounding_of_the_end_of_the_motion():
    """The better run, off by 1e-5, ends 1e-10 s before 0.02 s, and counts as completed."""
    better = {**record("a", "x", 1e-5, 0.1, step=0.1), "t_end": 0.0199999999}
    ends = [record("a", "x", 1e-3, 0.1, step=1.0), better]
    [group] = by_scene(ends, {scene().name: scene()})
    assert group.best()["a", "x"].error == pytest.approx(1e-5), group.best()


def test_convergence_table_shows_the_orders_put_into_the_records():
    """Errors at steps 0.1 / 2^k: 1e-3 / 8^k (order 3), 8e-3 / 2^k (order 1), and one run only (none)."""
    found = table(sections.convergence.render(groups()[:1]), "Over")
    orders = column(found, "spatial_slider_crank")
    assert orders["mbref", "mpi-svd+projection"] == "3", orders
    assert orders["mujoco", "tuned"] == "1", orders
    assert orders["mujoco", "defaults"] == "–", orders


def test_limit_table_shows_the_bias_and_discretisation_put_in():
    """At the step h, a is off by 1e-4 + 1e-2 h: 1e-5 is discretisation at 1e-3; b by 1e-2 h², no bias."""
    soft = [record("a", "soft", 1e-4 + 1e-2 * h, 0.1, step=h) for h in (0.04, 0.02, 0.001)]
    true = [record("b", "true", 1e-2 * h**2, 0.1, step=h) for h in (0.04, 0.02, 0.01)]
    [group] = by_scene([*soft, *true], {scene().name: scene()})
    found = table(sections.convergence.render([group]), "Bias")
    cells = {row[1]: dict(zip(found.header, row, strict=True)) for row in found.rows}
    assert cells["a"]["Bias"] == "1.0e-04" and cells["a"]["Larger"] == "bias", cells
    assert cells["a"]["Discretisation"] == "1.0e-05" and cells["a"]["Order"] == "1", cells
    assert cells["a"]["Its error"] == "1.1e-04", cells
    assert float(cells["b"]["Bias"]) < 1e-12 and cells["b"]["Larger"] == "discretisation", cells
    assert "1 of them bias" in found.caption, found.caption


def test_least_errors_table_shows_best_settings_and_failures():
    """tests/reports/synthetic.py has records of four engines on the first scene, and of two on the second:
    six pairs, none within 1e-8. On the first, mbref's one family has 1e-3 / 8² at step 0.1 / 2², and Exudyn's
    last run ended at 0.6 · 0.02 s."""
    parts = sections.least_errors.render(groups())
    found, others = table(parts, "Families"), table(parts, "Within 1e-08")
    shown = [dict(zip(found.header, row, strict=True)) for row in found.rows]
    rows = {row["Engine"]: row for row in shown if row["Scene"] == "spatial_slider_crank"}
    assert set(rows) == {"mbref", "mujoco", "exudyn", "pinocchio"} and len(shown) == 6
    best = rows["mbref"]
    assert best["Least error"] == "1.56e-05" and best["Settings"] == "step=0.025", best
    assert best["Families"] == "0 of 1", best
    assert rows["exudyn"]["Least error"] == "not converged at 0.012 s", rows
    assert found.caption.startswith("0 of 6 pairs"), found.caption
    within = {row[:2]: dict(zip(others.header, row, strict=True)) for row in others.rows}
    mbref = within["spatial_slider_crank", "mbref"]
    assert mbref["Within 1e-08"] == "" and mbref["Others"] == "mpi-svd+projection 1.56e-05", mbref


@pytest.mark.parametrize(
    ("shifts", "words"), [((0.0,), "The same mechanism in b"), ((0.0, 1e-4), "different mechanisms")]
)
def test_summary_says_if_engines_move_different_mechanisms(shifts, words):
    """Short motions of the model check are equal to the truth, or one of them is 1e-4 m off."""
    gate = [at_gate(shift) for shift in shifts]
    [group] = by_scene(records()[:3], {scene().name: scene()}, gate)
    [_, said] = [b.text for b in sections.summary.render([group]) if isinstance(b, Text)]
    assert words in said, (words, said)


def test_model_check_that_timed_out_is_no_difference():
    """One short motion is the truth: one that timed out is no difference, one that is 1e-4 m off is."""
    late = {**nothing("c", "x"), "outcome": "TIMED_OUT"}
    gates = [[at_gate(0.0), other] for other in (late, at_gate(1e-4))]
    found = [by_scene(records()[:3], {scene().name: scene()}, each)[0].difference() for each in gates]
    assert found[0] is None and found[1] is not None


def at_gate(shift: float) -> dict:
    """A record of the gate: the truth, moved."""
    true = truth_for(scene()).poses(gate_times(scene()))
    moved = dataclasses.replace(true, engine="b", position=true.position + shift)
    return {**moved.to_record(), "scene": scene().name}


def test_outcome_table_shows_outcome_and_end_time_of_each_run():
    """Of ten records seven complete at 0.02 s. Two of Exudyn do not converge, which the paper calls (b), and
    end at 0.5 and 0.6 of this time. One of Pinocchio crashes at the start."""
    found = table(sections.outcomes.render(groups()[0]), "Outcome")
    outcome, end = (list(found.header).index(name) for name in ("Outcome", "End time (s)"))
    assert [(row[0], row[outcome].strip(), row[end]) for row in found.rows] == [
        *[("mbref", "COMPLETED", "0.02")] * 3,
        *[("mujoco", "COMPLETED", "0.02")] * 4,
        ("exudyn", "NOT_CONVERGED (b)", "0.01"),
        ("exudyn", "NOT_CONVERGED (b)", "0.012"),
        ("pinocchio", "CRASHED", "0"),
    ]


def test_failure_marks_are_explained_with_outcome_and_message():
    """Mark 1: two runs of Exudyn that did not converge; mark 2: Pinocchio crashed at the start."""
    found = table(sections.speed.render(groups()[0]), "Mark")
    assert [row[:5] for row in found.rows] == [
        ("1", "exudyn", "tuned", "2", "NOT_CONVERGED"),
        ("2", "pinocchio", "defaults", "1", "CRASHED"),
    ], found.rows
    assert "SIGSEGV" in found.rows[1][-1] and "did not converge" in found.rows[0][-1], found.rows


def test_scene_whose_only_run_crashed_at_the_start_has_sentences_instead_of_figures():
    """The sections on the mechanism's motion and on energy have nothing to draw."""
    [group] = by_scene([nothing("a", "x")], {scene().name: scene()})
    for render in (sections.mechanism.render, sections.energy.render):
        parts = render(group)
        assert any(isinstance(b, Text) for b in parts), parts
        assert not any(isinstance(b, Figure) for b in parts), parts


def test_mechanism_table_has_the_scene_s_rows_and_rank():
    """`mbref.counts` has rows and rank. The rows of the joints, one column each, add up to the scene's."""
    found = table(sections.mechanism.render(groups()[0]), "Redundant rows")
    cells = dict(zip(found.header, found.rows[0], strict=True))
    counts = mbref.counts(scene())
    assert cells["Rank"] == str(counts.rank) and cells["Rows"] == str(counts.rows), (cells, counts)
    heads = {f"{joint.name} " for joint in scene().joint}
    assert sum(int(v) for k, v in cells.items() if k[:2] in heads) == counts.rows


def test_provenance_lists_versions_machine_settings_and_seed():
    """All 12 records are of version 1.0, except for crashes, of packages and a machine in `MADE_OF`, and of
    the seed 0. Steps of a family are listed from the first to the last record."""
    parts = sections.provenance.render(groups())
    versions, machines, settings = (list(b.rows) for b in parts if isinstance(b, Table))
    assert {("engine", name, "1.0") for name in ("mbref", "mujoco", "exudyn")} < set(versions)
    assert {("package", "numpy", "2.x"), ("package", "numba", "not installed")} < set(versions)
    assert machines == [("a processor", "2", "a system")]
    assert settings == [
        ("mbref", "mpi-svd+projection", "step", "0.1, 0.05, 0.025"),
        ("mujoco", "tuned", "step", "0.1, 0.05, 0.025"),
        ("mujoco", "defaults", "step", "0.1"),
        ("exudyn", "tuned", "step", "0.1, 0.01"),
    ]
    text = next(b.text for b in parts if isinstance(b, Text))
    assert text.startswith("12 records; seed 0. ") and "the least of 1 runs" in text, text


def test_runs_with_errors_above_a_hundred_tolerances_are_counted():
    """rtol 1e-6: 0.9e-4 is within, 1.1e-4 over. A failed run and one without rtol do not count."""
    asked = [record("a", "b", error, 1.0, rtol=1e-6) for error in (0.9e-4, 1.1e-4)]
    failed = record("a", "b", 1e-3, 1.0, rtol=1e-6, outcome=Outcome.NOT_CONVERGED)
    runs = [Run(r) for r in (*asked, failed, record("a", "c", 1e-3, 1.0, step=1e-6))]
    assert [r.is_short_of_tolerance for r in runs] == [False, True, False, False]
    found = sections.summary.render([SceneRuns(scene(), runs)])
    text = next(b.text for b in found if isinstance(b, Text))
    assert "relative tolerance: 2; of these, with an error above 100 times their tolerance: 1." in text, text
    shown = next(b for b in found if isinstance(b, Table))
    assert column(shown, "Wrong or failed")["a", "b"].startswith("1 with error above 100 rtol, NOT_CONV")
