"""The page "Which engine, which settings" on a few plain records / cells and sentences worked out by hand."""

from __future__ import annotations

import json
from types import SimpleNamespace
from typing import Any

import pytest
from test_figures_by_hand import SCENE, plain

from crosscheck.study.verdict import Judged
from mbref.scenes import SCENES
from reports import which_engine as page
from reports.runs import Run, SceneRuns
from reports.which_engine import Kind


def record(
    engine: str, family: str, error: float | None, seconds: float, *ends: Any, **more: Any
) -> dict[str, Any]:
    made = plain(engine, family, error, seconds, *ends, step=0.1)
    return {**made, "cost": {**made["cost"], "build_seconds": 0.25}, "metrics": {**made["metrics"]}, **more}


TRUTH = {"kind": "reference", "until": 1.0, "reason": "", "bound": 1e-14, "scene": "block"}
RECORDS = (
    record("mujoco", "tuned", 1e-7, 4.0),
    record("mujoco", "tuned", 1e-4, 1.0),
    record("mujoco", "defaults", 0.5, 0.5),
    record("pinocchio", "tuned", 5e-8, 2.0),
    record("exudyn", "defaults", None, 20.0, "TIMED_OUT", 0.5),
    record("simbody", "merson", 1e-3, 0.001),
)


def judged(*records: dict[str, Any], **truth: Any) -> Judged:
    return Judged(SCENE, TRUTH | truth, list(records or RECORDS))


@pytest.fixture(autouse=True)
def no_code(monkeypatch):
    monkeypatch.setattr(page, "own_code", lambda scene, record: "")


def test_the_fastest_engines_within_the_level():
    """An error of 1e-6: Pinocchio in 2 s before MuJoCo in 4 s; the others have no such run."""
    assert [r["engine"] for r in page._fastest(judged())] == ["pinocchio", "mujoco"]
    assert page._named(RECORDS[0]) == "MuJoCo, `tuned`, 4 s" and page._named(None) == "none"
    assert page._bad_defaults(judged()) == f"MuJoCo: error 5.00e-01; Exudyn: {page._failed(RECORDS[4])}"
    assert (
        page._failed(RECORDS[4]).endswith(" (limit 20 s)")
        and page._bad_defaults(judged(RECORDS[3])) == "none"
    )
    assert page._failed(record("a", "x", None, 1.0, "NOT_CONVERGED", 0.5)).endswith("0.5 s")


def test_answers_in_short():
    kinds = [
        (Kind("Open chains and more", "About.", ("block",)), [group(RECORDS)]),
        (Kind("Loops", "About.", ("block",)), [group(RECORDS[3:4])]),
    ]
    title, head, rule, first, second, last = page._in_short(kinds)
    assert title == "## In short\n" and head.endswith("| next engine | defaults that end wrong or fail |")
    assert rule == "|---|---|---|---|" and last == ""
    assert first == (
        "| [Open chains and more](#open-chains-and-more) | Pinocchio, `tuned`, 2 s | MuJoCo, `tuned`, 4 s | "
        f"{page._bad_defaults(judged())} |"
    )
    assert second == "| [Loops](#loops) | Pinocchio, `tuned`, 2 s | none | none |"


def group(records: tuple[dict[str, Any], ...]) -> SceneRuns:
    return SceneRuns(SCENE, [Run(r) for r in records], truth=TRUTH)


def test_the_table_of_a_scene():
    """Engines within the level come first, the fastest first; then the others as they come."""
    intro, header, rule, *rows, end = page._answers(judged())
    assert intro == (
        "`block` over 1 s: 1 body, 6 degrees of freedom, no redundant rows. `crosscheck compare 'block'` "
        "repeats these runs.\n"
    )
    assert header.endswith("| time | error | least error | library defaults |") and end == ""
    assert rule == "|---|---|--:|--:|--:|---|" and header.count("|") == 7
    late = page._failed(RECORDS[4])
    assert rows == [
        "| Pinocchio | `tuned`, step=0.1 | 2 s | 5.00e-08 | 5.00e-08 | no such settings |",
        "| MuJoCo | `tuned`, step=0.1 | 4 s | 1.00e-07 | 1.00e-07 | error 5.00e-01 |",
        f"| Exudyn | none | – | – | {late} | no run completes: {late} |",
        "| Simbody | none | – | – | 1.00e-03 | no such settings |",
    ]
    assert page._place(["a", "b"], "b") == 1 and page._place(["a", "b"], "c") == 2
    counts = [page._count(k, "row", "rows") for k in (0, 1, 2)]
    assert counts == ["no rows", "1 row", "2 rows"]


def test_a_truth_that_ends_before_the_motion():
    assert page._known(judged()) == "" and page._end_time(judged()) == 1.0
    short = judged(until=0.75)
    assert page._known(short) == " Errors are of the part up to 0.75 s, where the truth ends."
    assert page._known(short) in next(iter(page._answers(short)))


def test_lines_to_copy(monkeypatch):
    assert list(page._lines(judged())) == [""]
    monkeypatch.setattr(
        page, "own_code", lambda scene, r: f"<{r['family']}/>" if r["engine"] == "mujoco" else ""
    )
    about, fence, line, close, end = page._lines(judged())
    assert about.startswith("\nLines to copy, ") and about.endswith("otherwise the most accurate run.\n")
    assert (fence, close, end) == ("```text", "```", "")
    assert line == "MuJoCo, error 1.00e-07: <tuned/>"
    *_, line, _, _ = page._lines(judged(*RECORDS[1:3]))
    assert line == "MuJoCo, error 1.00e-04: <tuned/>", "the most accurate run, if none is within the level"


def test_a_section_has_a_table_for_each_scene():
    lines = list(
        page._section(Kind("Loops", "They close.", ("block",)), [group(RECORDS), group(RECORDS[:1])])
    )
    assert lines[:2] == ["## Loops\n", "They close.\n"]
    assert sum(line.startswith("`block` over") for line in lines) == 2


def test_many_variants_cost_construction_and_steps():
    """The sums of both times are 2.1, 2.3 and 2.5 s; neither part alone has this order."""
    costs = {"mujoco": (0.1, 2.2), "pinocchio": (1.5, 1.0), "simbody": (1.3, 0.8)}
    made = [
        record(engine, "tuned", 1e-7, steps, cost={"build_seconds": build, "seconds": steps})
        for engine, (build, steps) in costs.items()
    ]
    title, about, head, rule, *rows, hint, link = page._many(group(tuple(made)))
    assert title == "## Many variants at once\n" and about.endswith(
        "One run of `block`, the fastest of each engine within 1e-6:\n"
    )
    assert (head, rule) == ("| engine | construction | stepping | both |", "|---|--:|--:|--:|")
    assert rows == [
        "| Simbody, `tuned` | 1.3 s | 800 ms | 2.1 s |",
        "| MuJoCo, `tuned` | 100 ms | 2.2 s | 2.3 s |",
        "| Pinocchio, `tuned` | 1.5 s | 1 s | 2.5 s |",
    ]
    assert hint.startswith("\n`mbref ensemble`") and link == (
        "([Many runs at once](methods.md#many-runs-at-once)).\n"
    )


def test_kinds_of_mechanisms_have_a_title_a_sentence_and_scenes():
    assert len({kind.title for kind in page.KINDS}) == len(page.KINDS)
    for kind in page.KINDS:
        assert kind.title[0].isupper() and not kind.title.endswith("."), kind
        assert kind.about[0].isupper() and kind.about.endswith("."), kind
        assert {name.partition("[")[0] for name in kind.scenes} <= {*SCENES}, kind


def test_failed_checks_and_findings(monkeypatch, tmp_path):
    found = [
        SimpleNamespace(name=n, engine=e)
        for n, e in (("drift", "mujoco"), ("jump", "mujoco"), ("lost", "dart"))
    ]
    states = ["pass", "fail", "cannot", "pass", "outside"]
    documents = [
        {"engine": "mujoco", "verdicts": [{"status": s} for s in states]},
        {"engine": "pinocchio", "verdicts": [{"status": "pass"}]},
        {"engine": "exudyn", "verdicts": [{"status": "cannot"}]},
        {"engine": "simbody"},
    ]
    monkeypatch.setattr(page, "findings", lambda: found)
    monkeypatch.setattr(page, "verified", lambda folder: documents if folder == tmp_path else [])
    assert list(page._checks(tmp_path)) == [("mujoco", 1, 3), ("pinocchio", 0, 1)]
    title, about, head, rule, *rows, hint = page._failures(tmp_path)
    assert title == "## What each engine fails at\n" and about.endswith("defects that a script shows:\n")
    assert (head, rule) == ("| engine | checks that fail | of | findings |", "|---|--:|--:|---|")
    assert (
        hint == "\n`crosscheck verify ENGINE` runs the checks, `crosscheck findings --recheck` the scripts."
    )
    assert rows == [
        "| MuJoCo | 1 | 3 | [drift](findings.md#drift), [jump](findings.md#jump) |",
        "| Pinocchio | 0 | 1 | none |",
        f"| {page.title('dart')} | – | – | [lost](findings.md#lost) |",
    ]


def test_kept_records_have_no_motion(tmp_path):
    made = record(
        "mujoco", "tuned", 1e-7, 4.0, bodies={"b": {}}, reactions={}, open_reactions=None, crossings=[]
    )
    page.keep([group((made,)), SceneRuns(SCENE.with_(name="other"), [])], tmp_path / "new")
    [line] = (tmp_path / "new" / "records.jsonl").read_text().splitlines()
    kept = json.loads(line)
    assert kept == {
        k: v for k, v in made.items() if k not in ("bodies", "reactions", "open_reactions", "crossings")
    }
    assert [json.loads(t) for t in (tmp_path / "new" / "truths.jsonl").read_text().splitlines()] == [TRUTH]
    assert sorted(p.name for p in (tmp_path / "new" / "scenes").iterdir()) == ["block.toml", "other.toml"]
