"""The section on conformance: counts, violations and causes of what `crosscheck verify --json` prints."""

import json
from collections import Counter
from pathlib import Path

from crosscheck.conformance import explained
from crosscheck.conformance.many_mechanisms import AGREEMENT, Plan, Tally
from crosscheck.conformance.properties import PROPERTIES
from crosscheck.conformance.suite import FIRST, Conformance, Verdict, record_of
from crosscheck.engine import engine_names
from reports import stored
from reports.blocks import Table
from reports.sections import conformance

ROOT = Path(__file__).parents[2]


def test_conformance_tables_count_passes_failures_and_refusals(tmp_path):
    """MuJoCo passes `truth` on the door and fails it on the pendulum, refuses the door for `closure`, and
    `energy` does not apply to it: one check each. Exudyn has the pass alone. Engines come in their usual
    order; of a check the table has its planted defects, the passes and who fails."""
    passed = Verdict("truth", "door", "pass", 1e-12, 1e-6)
    others = (
        Verdict("truth", "pendulum", "fail", 2e-3, 1e-6),
        Verdict("closure", "door", "cannot", reason="no such joint"),
        Verdict("energy", "door", "outside", reason="a driver moves it"),
    )
    (tmp_path / "conformance").mkdir()
    for name, verdicts in (("exudyn", [passed]), ("mujoco", [passed, *others])):
        record = json.dumps(Conformance(name, "1.0", verdicts).to_record())
        (tmp_path / "conformance" / f"{name}.json").write_text(record)
    _, engines, checks, *_ = conformance.render(stored.verified(tmp_path))
    assert engines.rows == [("MuJoCo", "1.0", "1", "1", "1", "1"), ("Exudyn", "1.0", "1", "0", "0", "0")]
    rows = {row[0].partition("/")[0]: tuple(row[2:]) for row in checks.rows}  # by check, without its version
    proofs = sum(proof.check == "truth" for proof in explained.proofs())
    assert rows["truth"] == (str(proofs), "1 of 2", "MuJoCo on 1 of 2")
    assert rows["closure"][1:] == rows["energy"][1:] == ("0 of 0", "none")


def test_explanations_name_known_engines_and_checks_and_every_check_of_the_suite_has_a_proof():
    """The explanations are of violations by engines; a proof is a planted defect that the check detects.
    `agreement` is of two engines on random mechanisms, and no check of the suite."""
    assert explained.explanations()
    for engine, check, _ in explained.explanations():
        assert engine.partition(" ")[0] in engine_names(), engine
        assert check in {*FIRST, *PROPERTIES, AGREEMENT}, check
    assert {proof.check for proof in explained.proofs()} == {*FIRST, *PROPERTIES}


def test_random_violations_are_counted_by_check_with_the_worst_of_each(tmp_path):
    """The worst is the largest multiple of what is allowed. Of `truth`, drawn_1 violates by 1e-3 / 1e-6 =
    1000 and drawn_0 by 2. Of `closure`, drawn_3 has no number."""
    (tmp_path / "conformance").mkdir()
    tally = Tally(Plan("mujoco", 4))
    for seed, (check, measured, allowed) in enumerate(
        (("truth", 2e-3, 1e-3), ("truth", 1e-3, 1e-6), ("closure", 5e-2, 1e-2), ("closure", None, None))
    ):
        verdict = Verdict(check, f"drawn_{seed}", "fail", measured, allowed, reason=f"reason {seed}")
        tally.add({"version": "1.0", "verdicts": [record_of(verdict)]})
    (tmp_path / "conformance" / "mujoco_drawn.json").write_text(json.dumps(tally.to_record()))
    tables = [b for b in conformance.render(stored.verified(tmp_path)) if isinstance(b, Table)]
    [table] = [each for each in tables if each.header[2] == "Times"]
    truth, closure = (f"{name}/{PROPERTIES[name].version}" for name in ("truth", "closure"))
    assert [row[:6] for row in table.rows] == [
        ("MuJoCo", truth, "2", "drawn_1", "1.0e-03", "1.0e-06"),
        ("MuJoCo", closure, "2", "drawn_2", "5.0e-02", "1.0e-02"),
    ]


def test_each_committed_violation_on_a_mechanism_of_the_suite_has_a_cause():
    """An engine, a check and a scene are the key of an explanation."""
    known = explained.explanations()
    verdicts = stored.verified(ROOT / "reports" / "reference")
    assert verdicts
    for found in verdicts:
        failed = [v for v in found.get("verdicts", ()) if v["status"] == "fail"]
        unknown = [(v["property"], v["scene"]) for v in failed]
        unknown = [pair for pair in unknown if (found["engine"], *pair) not in known]
        assert not unknown, (found["engine"], unknown)


def test_page_on_engines_counts_the_violations_of_warp_by_cause():
    """The truth are Warp's stored verdicts: each row of the table has a cause and its number of failed
    checks. The sentence before the table has the numbers of passed, refused and failed checks."""
    [warp] = [v for v in stored.verified(ROOT / "reports" / "reference") if v["engine"] == "warp"]
    failed = [v for v in warp["verdicts"] if v["status"] == "fail"]
    causes = Counter(explained.explanations()["warp", v["property"], v["scene"]].cause for v in failed)
    page = (ROOT / "docs" / "engines.md").read_text()
    rows = page.partition("| mechanisms | violated checks |")[2].partition("\n\n")[0].splitlines()[2:]
    cells = [[cell.strip() for cell in row.strip("| ").split("|")] for row in rows]
    assert sorted(int(row[1]) for row in cells) == sorted(causes.values())
    passed = sum(v["status"] == "pass" for v in warp["verdicts"])
    refused = sum(v["property"] == "refusal" and v["status"] == "cannot" for v in warp["verdicts"])
    words = " ".join(page.split())
    assert f"passes {passed} checks, refuses {refused} mechanisms, and violates {len(failed)}. " in words
