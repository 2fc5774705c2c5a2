"""Drawn mutants: sources worked out by hand / the mutants, the tests chosen and the results."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.mutants import __main__ as runner
from tests.mutants.equivalent import REASONS
from tests.mutants.importers import SNAPSHOTS, importers
from tests.mutants.operators import KINDS, mutants

ROOT = Path(__file__).parents[2]
BY_KIND = {
    "sign": ("x = a - b", {"x = ((a) + (b))"}),
    "sign of one": ("x = -a", {"x = (+a)"}),
    "factor": ("x = a * b", {"x = ((a) / (b))"}),
    "comparison": ("x = a < b", {"x = (a <= b)"}),
    "constant": ("x = 3", {"x = 4"}),
    "real constant": ("x = 0.5", {"x = 1.0"}),
    "zero": ("x = 0.0", {"x = 1.0"}),
    "truth": ("x = True", {"x = False"}),
    "index": ("x = a[1]", {"x = a[2]"}),
    "extreme": ("x = np.min(a)", {"x = np.max(a)"}),
    "argument order": ("x = f(a, b)", {"x = f(b, a)"}),
    "statement": ("f(a)", {"pass"}),
    "condition": ("x = a and b", {"x = (a)", "x = (b)"}),
    "condition of a loop": ("x = [a for a in b if a]", {"x = [a for a in b if True]"}),
    "bodies": ("x = a if b else c", {"x = (c if b else a)"}),
    "condition of bodies": (
        "if a:\n    x = b\nelse:\n    x = c",
        {"if (not (a)):\n    x = b\nelse:\n    x = c"},
    ),
    "a product is not a text": ("x = 'a' + b", set()),
    "annotations": ("x: f[1] = a", set()),
    "documentation": ('def f():\n    """Return 3."""', set()),
    "a formatted text": ("x = f'{3} {a - b}'", set()),
    "imports for types": ("if TYPE_CHECKING:\n    import a", set()),
    "equal arguments": ("x = f(a, a)", set()),
    "arguments in any order": ("x = np.hypot(a, b)", set()),
    "a check of lengths": ("x = zip(a, a, strict=True)", set()),
    "umlauts before the place": ("x = 'ä', a - b", {"x = 'ä', ((a) + (b))"}),
}


@pytest.mark.parametrize("name", BY_KIND)
def test_each_operator_and_the_sources_it_makes(name):
    source, expected = BY_KIND[name]
    assert {m.planted(source) for m in mutants("a.py", source)} == expected


def test_every_mutant_of_a_source_is_another_source_that_compiles():
    path = "crosscheck/study/wording.py"
    source = (ROOT / path).read_text()
    made = mutants(path, source)
    assert {m.kind for m in made} <= set(KINDS) and len(made) > 20
    for mutant in made:
        assert mutant.planted(source) != source, mutant
        compile(mutant.planted(source), path, "exec")


def test_a_seed_draws_the_same_mutants_and_another_seed_others():
    first, again, other = (runner.drawn(seed, 20, "crosscheck/study") for seed in (1, 1, 2))
    assert first == again and len(set(first)) == 20 and set(first) != set(other)
    assert all(m.file.startswith("crosscheck/study/") for m in first)
    assert len(runner.drawn(1, 10**6, "mbref/energy.py")) == len(
        set(mutants("mbref/energy.py", (ROOT / "mbref/energy.py").read_text()))
    )


def test_tests_are_those_that_import_the_file_the_nearest_first():
    found = importers("crosscheck/study/difference.py")
    assert "tests/crosscheck/test_verdict.py" in found, found
    assert not set(found) & set(SNAPSHOTS)
    assert importers("tests/nothing.py") == []
    assert "tests/crosscheck/test_ondsel.py" in importers("crosscheck/engines/ondsel/model.py")


def test_no_mutant_is_drawn_of_an_engine_that_is_not_installed(monkeypatch):
    monkeypatch.setattr(runner, "installed", lambda name: name != "bullet")
    files = list(runner._files("crosscheck/engines/"))
    assert "crosscheck/engines/ondsel/model.py" in files
    assert not [name for name in files if "/bullet/" in name]


TINY = {
    "mbref/sums.py": "def total(a, b):\n    return a + b\n\n\n"
    "def wait(n):\n    while n > 0:\n        n = n - 1\n",
    "test_total.py": "from mbref.sums import total\n\n\ndef test_total():\n    assert total(2, 3) == 5\n",
    "test_weak.py": "from mbref.sums import total\n\n\ndef test_total():\n    assert total(2, 0) == 2\n",
    "test_wait.py": "from mbref.sums import wait\n\n\ndef test_wait():\n    wait(3)\n",
    "test_broken.py": "def test_broken():\n    assert False\n",
}


@pytest.mark.parametrize(
    ("tests", "new", "expected"),
    [
        (["test_total.py"], "((a) - (b))", runner.KILLED),
        (["test_weak.py"], "((a) - (b))", runner.SURVIVED),
        (["test_weak.py", "test_total.py"], "((a) - (b))", runner.KILLED),
        (["test_wait.py"], "((n) + (1))", runner.TIMED_OUT),
        (["test_broken.py"], "((a) - (b))", runner.UNTESTED),
    ],
)
def test_results_of_tests_that_see_it_or_not(tmp_path, monkeypatch, tests, new, expected):
    """A time-out is no kill, and tests that fail without the mutant say nothing."""
    monkeypatch.setattr(runner, "LEAST", 2.0)
    monkeypatch.setattr(runner, "FACTOR", 1.0)
    root, place = tmp_path / "root", tmp_path / "place"
    for name, text in TINY.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    place.mkdir()
    copied = ("mbref", *(name for name in TINY if name.startswith("test")))
    tree = runner.Tree(place, root, copied, tmp_path / "kept.jsonl")
    [mutant] = [m for m in mutants("mbref/sums.py", TINY["mbref/sums.py"]) if m.new == new]
    assert tree.result(mutant, tests) == expected
    assert (place / "mbref/sums.py").read_text() == TINY["mbref/sums.py"], "the mutant was left in the tree"
    again = runner.Tree(place, root, (), tmp_path / "kept.jsonl")
    monkeypatch.setattr(again, "_run", None)
    assert all(again._time(test, False) > 0 for test in tests), "times of tests are measured once"


def test_the_score_counts_no_equivalent_mutant_and_no_time_out():
    results = [runner.KILLED] * 3 + [runner.SURVIVED, runner.TIMED_OUT, runner.EQUIVALENT]
    assert runner.score(results) == "3 of 5 killed (60%), 1 timed out, 1 survived, 1 equivalent"


def test_reasons_name_lines_that_are_there():
    for (file, line, _), why in REASONS.items():
        assert line in [text.strip() for text in (ROOT / file).read_text().splitlines()], (file, line)
        assert why.endswith("."), (file, line, why)
