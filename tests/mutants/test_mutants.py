"""Drawn mutants: sources worked out by hand / the mutants, the tests chosen and the results."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.mutants import __main__ as runner
from tests.mutants import order, workers
from tests.mutants.equivalent import REASONS
from tests.mutants.importers import SNAPSHOTS, importers
from tests.mutants.operators import KINDS, Mutant, mutants

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


@pytest.mark.slow
def test_tests_are_those_that_import_the_file_the_nearest_first():
    found = importers("crosscheck/study/difference.py")
    assert "tests/crosscheck/test_verdict.py" in found, found
    assert not set(found) & set(SNAPSHOTS)
    assert importers("tests/nothing.py") == []
    assert "tests/crosscheck/test_ondsel.py" in importers("crosscheck/engines/ondsel/model.py")
    assert "tests/crosscheck/test_clocks.py" in importers("crosscheck/engines/exudyn/dynamic.py")


def test_no_mutant_is_drawn_of_an_engine_that_is_not_installed(monkeypatch):
    monkeypatch.setattr(runner, "installed", lambda name: name != "bullet")
    files = list(runner._files("crosscheck/engines/"))
    assert "crosscheck/engines/ondsel/model.py" in files
    assert not [name for name in files if "/bullet/" in name]


TINY = {
    "test_text.py": "from mbref.sums import total\n\n\n"
    "def test_text():\n    assert str(total(1, 1)) == '2'\n",
    "test_crash.py": "import os\n\nfrom mbref.sums import total\n\n\n"
    "def test_crash():\n    if total(1, 1) == 0:\n        os._exit(1)\n",
    "mbref/sums.py": "def total(a, b):\n    return a + b\n\n\n"
    "def wait(n):\n    while n > 0:\n        n = n - 1\n",
    "test_total.py": "from mbref.sums import total\n\n\ndef test_total():\n    assert total(2, 3) == 5\n",
    "test_weak.py": "from mbref.sums import total\n\n\ndef test_total():\n    assert total(2, 0) == 2\n",
    "test_wait.py": "from mbref.sums import wait\n\n\ndef test_wait():\n    wait(3)\n",
    "test_slow.py": "def test_slow():\n    while True:\n        pass\n",
    "test_broken.py": "def test_broken():\n    assert False\n",
}


@pytest.fixture(scope="module")
def tree(tmp_path_factory):
    """A tree of the tiny sources, whose tests may take 3 s."""
    folder = tmp_path_factory.mktemp("mutants")
    for name, text in TINY.items():
        (folder / "root" / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / "root" / name).write_text(text)
    names = [name.partition("/")[0] for name in TINY]
    with (
        pytest.MonkeyPatch.context() as patch,
        closing(runner.Tree(folder / "place", folder / "root", names, budget=2.0)) as made,
    ):
        patch.setattr(runner, "SNAPSHOTS", ("test_text.py",))
        patch.setattr(runner, "RENDERED", ("mbref/",))
        yield made


def planted(new: str) -> Mutant:
    [found] = [m for m in mutants("mbref/sums.py", TINY["mbref/sums.py"]) if m.new == new]
    return found


@pytest.mark.parametrize(
    ("tests", "new", "expected"),
    [
        (["test_total.py"], "((a) - (b))", (runner.KILLED, "test_total.py::test_total")),
        (["test_weak.py"], "((a) - (b))", (runner.BY_TEXT, "test_text.py::test_text")),
        (["test_weak.py"], "2", (runner.SURVIVED, "")),
        (["test_weak.py", "test_total.py"], "((a) - (b))", (runner.KILLED, "test_total.py::test_total")),
        (["test_wait.py"], "((n) + (1))", (runner.TIMED_OUT, "test_wait.py::test_wait")),
        (["test_slow.py", "test_weak.py"], "2", (runner.SURVIVED, "")),
        (["test_broken.py", "test_weak.py"], "2", (runner.SURVIVED, "")),
        ([], "((a) - (b))", (runner.UNTESTED, "")),
    ],
)
def test_results_of_tests_that_see_it_or_not(tree, tests, new, expected):
    """A time-out is no kill, and tests that fail without the mutant say nothing."""
    assert tree.result(planted(new), tests) == expected
    if expected[0] == runner.BY_TEXT:
        assert tree.result(planted(new), tests, with_texts=False) == (runner.SURVIVED, "")
    assert (tree.place / "mbref/sums.py").read_text() == TINY["mbref/sums.py"], "the mutant was left"


def test_the_time_of_a_file_begins_after_its_imports(monkeypatch):
    """Imports take 7 s here; tests may take 5 s after them."""
    session, now = workers.Session({"out": [], "only": "", "of_file": 5.0, "known": {}, "words": []}), [7.0]
    monkeypatch.setattr(workers, "_cpu", lambda: now[0])
    session.pytest_collection_finish()
    now[0] = 11.9
    session.pytest_runtest_logfinish("a")
    now[0] = 12.1
    with pytest.raises(pytest.exit.Exception, match="long enough"):
        session.pytest_runtest_logfinish("a")


def test_tests_of_a_file_with_a_word_run_first_and_then_the_quick_ones():
    known = {"t.py::test_slow": 3.0, "t.py::test_quick": 0.1, "t.py::test_sum[total]": 9.0}
    request = {"out": ["t.py::test_out"], "only": "", "of_file": 5.0, "known": known, "words": ["total"]}
    names = [*known, "t.py::test_out", "t.py::test_new"]
    items = [SimpleNamespace(nodeid=name) for name in names]
    workers.Session(request).pytest_collection_modifyitems(items)
    assert [item.nodeid[6:] for item in items] == ["test_sum[total]", "test_new", "test_quick", "test_slow"]


def test_quick_tests_that_name_the_function_run_first():
    mutant, source = planted("((a) - (b))"), TINY["mbref/sums.py"]
    tests = ["test_broken.py", "test_wait.py", "test_weak.py", "test_total.py"]
    seconds = {"test_weak.py": 1.5, "test_total.py": 0.9, "test_broken.py": 2.0, "test_wait.py": 0.8}
    assert order.around(source, mutant) == ["total"]
    texts = {test: TINY[test] for test in tests}
    assert order.ordered(mutant, source, texts, seconds, {}) == [
        "test_total.py",  # one name more in 0.9 s
        "test_wait.py",  # names the module ``sums`` alone
        "test_weak.py",  # the names of test_total.py in 1.5 s
        "test_broken.py",
    ]
    kills = {"test_weak.py": 1, "test_broken.py": 2}
    assert order.ordered(mutant, source, texts, seconds, kills)[:2] == ["test_broken.py", "test_weak.py"]
    texts = {"word": "sums", "both": "sums total", "near": "from pack.part import sums, total", "none": ""}
    texts |= {
        "calls": "from pack.part import sums\nsums.total()",
        "parts": "from pack.part.sums import other",
    }
    deep = mutant._replace(file="pack/part/sums.py")
    assert order.ordered(deep, source, texts, {}, {}) == [
        "calls",
        *("parts", "near"),
        *("both", "word", "none"),
    ]


def test_files_with_kernels_run_without_compilation():
    for file in (
        "mbref/taylor/series.py",
        "mbref/equations/loads.py",
        "mbref/scene.py",
        "crosscheck/engines/compiled/calls.py",
    ):
        assert runner.is_plain(file, (ROOT / file).read_text()), file
    compiling = ("mbref/kernels/disk_cache.py", "mbref/kernels/named_memory.py")
    for file in (*compiling, "crosscheck/study/grid.py"):
        assert not runner.is_plain(file, (ROOT / file).read_text()), file


def test_the_score_counts_no_equivalent_mutant_and_no_time_out():
    results = [runner.KILLED] * 3 + [runner.SURVIVED, runner.TIMED_OUT, runner.EQUIVALENT]
    assert runner.score(results) == "3 of 5 killed (60%), 1 timed out, 1 survived, 1 equivalent"


def test_reasons_name_lines_that_are_there():
    for (file, line, _), why in REASONS.items():
        assert line in [text.strip() for text in (ROOT / file).read_text().splitlines()], (file, line)
        assert why.endswith("."), (file, line, why)


def test_a_crash_is_a_kill_only_where_the_mutant_causes_it(tree):
    mutant = planted("((a) - (b))")
    assert tree.result(mutant, ["test_crash.py"]) == (runner.KILLED, "")
    path = tree.place / "test_crash.py"
    path.write_text("import os\n\n\ndef test_crash():\n    os._exit(1)\n")
    with pytest.raises(RuntimeError, match="end early without a mutant, too: test_crash"):
        tree.result(mutant, [path.name])
