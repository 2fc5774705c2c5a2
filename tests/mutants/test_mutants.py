"""Drawn mutants: sources worked out by hand / the mutants, the tests chosen and the results."""

from __future__ import annotations

import json
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.mutants import __main__ as runner
from tests.mutants import drawing, tree, workers
from tests.mutants.equivalent import COMMUTES, EXCHANGED, REASONS, SYMMETRY, UNKNOWN_LENGTH, reason
from tests.mutants.operators import KINDS, Mutant, mutants
from tests.mutants.reach import Reach, around, lines_of

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
    first, again, other = (drawing.drawn(seed, 20, "crosscheck/study") for seed in (1, 1, 2))
    assert first == again and len(set(first)) == 20 and set(first) != set(other)
    assert all(m.file.startswith("crosscheck/study/") for m in first)
    assert len(drawing.drawn(1, 10**6, "mbref/energy.py")) == len(
        set(mutants("mbref/energy.py", (ROOT / "mbref/energy.py").read_text()))
    )


def test_no_mutant_is_drawn_of_an_engine_that_is_not_installed(monkeypatch):
    monkeypatch.setattr(drawing, "installed", lambda name: name != "bullet")
    files = list(drawing._files("crosscheck/engines/"))
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
def copy(tmp_path_factory):
    """A copy of the tiny sources, whose tests may take 3 s."""
    folder = tmp_path_factory.mktemp("mutants")
    for name, text in TINY.items():
        (folder / "root" / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / "root" / name).write_text(text)
    names = [name.partition("/")[0] for name in TINY]
    with (
        pytest.MonkeyPatch.context() as patch,
        closing(tree.Tree(folder / "place", folder / "root", names, budget=2.0)) as made,
    ):
        patch.setattr(tree, "SNAPSHOTS", ("test_text.py",))
        patch.setattr(tree, "RENDERED", ("mbref/",))
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
def test_results_of_tests_that_see_it_or_not(copy, tests, new, expected):
    """A time-out is no kill, and tests that fail without the mutant say nothing."""
    assert copy.result(planted(new), dict.fromkeys(tests)) == expected
    if expected[0] == runner.BY_TEXT:
        assert copy.result(planted(new), dict.fromkeys(tests), with_texts=False) == (runner.SURVIVED, "")
    assert (copy.place / "mbref/sums.py").read_text() == TINY["mbref/sums.py"], "the mutant was left"


def test_the_time_of_a_file_begins_after_its_imports(monkeypatch):
    """Imports take 7 s here; tests may take 5 s after them."""
    session, now = workers.Session(5.0, None, ()), [7.0]
    monkeypatch.setattr(workers, "_cpu", lambda: now[0])
    session.pytest_collection_finish()
    now[0] = 11.9
    session.pytest_runtest_logfinish("a")
    now[0] = 12.1
    with pytest.raises(pytest.exit.Exception, match="long enough"):
        session.pytest_runtest_logfinish("a")


@pytest.mark.parametrize(
    ("wanted", "expected"), [(["c", "out", "a", "gone"], ["c", "a"]), (None, ["a", "b", "c"])]
)
def test_wanted_tests_run_in_their_order(wanted, expected):
    items = [SimpleNamespace(nodeid=name) for name in ("a", "b", "out", "c")]
    workers.Session(5.0, wanted, ["out"]).pytest_collection_modifyitems(items)
    assert [item.nodeid for item in items] == expected


SOURCE = """\
SCALE, OTHER = 2, 5
UNUSED = 3


class Sum:
    first: int = 4

    def total(self, second=6):
        return SCALE * (
            self.first + second
        )


def both(a):
    if a > 0:
        return [
            a,
            7,
        ]
    return None
"""


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        (1, {9}),  # the line of the function that names SCALE
        (2, set(range(200))),  # nobody names it: every line of the source
        (6, {10}),
        (8, {9, 10, 11}),  # a default: the lines of its function
        (10, {9, 10, 11}),
        (15, {15}),  # a condition, without what follows
        (18, {16, 17, 18, 19}),
        (20, {20}),
    ],
)
def test_lines_whose_tests_see_a_change_of_a_line(line, expected):
    assert {k for k in range(200) if lines_of(SOURCE, line) >> k & 1} == expected


RECORDED = {
    "tests/test_near.py": {"t::test_a": 3.0, "t::test_total": 5.0, "t::test_b": 0.1, "t::test_other": 0.2},
    "tests/test_far.py": {"t::test_c": 0.3},
    "tests/test_quick.py": {"t::test_d": 0.1},
    "tests/test_import.py": {"t::test_e": 0.1},
}


@pytest.fixture
def reach(tmp_path):
    """Recordings of four test files: all tests but ``test_other`` and ``test_e`` run line 2 of sums.py."""
    for name, text in {**dict.fromkeys(RECORDED, ""), "mbref/sums.py": TINY["mbref/sums.py"]}.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    (tmp_path / "tests/test_near.py").write_text("from mbref.sums import total")
    found = Reach(tmp_path / "lines.jsonl", tmp_path)
    assert found.missing() == sorted(RECORDED)
    inside = {name: list(tests) for name, tests in RECORDED.items()} | {"tests/test_import.py": []}
    inside["tests/test_near.py"].remove("t::test_other")
    for name, tests in RECORDED.items():
        lines = {"outside": f"{0b10_0010:x}", "tests": [[f"{0b100:x}", inside[name]]]}
        if name == "tests/test_quick.py":
            lines = {"outside": f"{0b10_0110:x}", "tests": []}  # its fixture runs line 2
        found.add(name, {"starting": 1.0, "seconds": tests, "reached": {"mbref/sums.py": lines}})
    return found


def test_tests_that_run_the_line_are_chosen_and_ordered(reach, tmp_path):
    """Named functions count first, then time; of one file tests that run the line, then named tests."""
    mutant, source = planted("((a) - (b))"), TINY["mbref/sums.py"]
    assert around(source, mutant) == ["total"]
    expected = {
        "tests/test_near.py": ["t::test_total", "t::test_b", "t::test_a", "t::test_other"],  # names it
        "tests/test_quick.py": ["t::test_d"],
        "tests/test_far.py": ["t::test_c"],
    }
    found = reach.ordered(mutant, source, {})
    assert found == expected and list(found) == list(expected)
    first = [next(iter(reach.ordered(mutant, source, {"tests/test_far.py": n}))) for n in (1, 1000)]
    assert first == ["tests/test_near.py", "tests/test_far.py"], "one kill does not outweigh the names"
    again = Reach(tmp_path / "lines.jsonl", tmp_path)
    assert again.missing() == [] and again.ordered(mutant, source, {}) == expected


def test_a_constant_is_known_by_its_name_and_by_the_functions_that_use_it():
    source = "LIMIT = 3\n\n\ndef within(x):\n    return x < LIMIT\n\n\ndef other(x):\n    return x < 4\n"
    of = {m.line: m for m in mutants("mbref/a.py", source) if m.kind == "constant"}
    assert around(source, of[1]) == ["LIMIT", "within"] and around(source, of[9]) == ["other"]


def test_a_line_that_no_test_runs_is_left_to_tests_that_import_its_source(reach):
    mutant, source = planted("((n) + (1))"), TINY["mbref/sums.py"]  # line 7
    assert set(reach.tests(mutant, source)) == set(RECORDED)
    assert reach.tests(mutant._replace(file="mbref/none.py"), source) == {}


def test_a_test_file_that_has_changed_is_recorded_again(reach, tmp_path):
    """Of a source that has changed every test counts that ran one of its lines."""
    (tmp_path / "tests/test_far.py").write_text("x = 1")
    assert Reach(tmp_path / "lines.jsonl", tmp_path).missing() == ["tests/test_far.py"]
    (tmp_path / "mbref/sums.py").write_text("\n" + TINY["mbref/sums.py"])
    again = Reach(tmp_path / "lines.jsonl", tmp_path)
    assert set(again.tests(planted("((a) - (b))"), TINY["mbref/sums.py"])) == set(RECORDED)


def test_a_recording_has_the_lines_of_each_test(copy, tmp_path):
    """``test_wait`` runs lines 6 and 7 of ``wait``; the import runs the lines of ``def``, 1 and 5."""
    tests = copy.place / "tests"
    tests.mkdir(exist_ok=True)
    (tests / "test_wait.py").write_text(TINY["test_wait.py"])
    seen = []
    copy.record(False, tmp_path / "lines.jsonl", 2, lambda done, total: seen.append((done, total)))
    [record] = [json.loads(line) for line in (tmp_path / "lines.jsonl").read_text().splitlines()]
    assert seen == [(1, 1)] and record["file"] == "tests/test_wait.py"
    assert set(record["seconds"]) == {"tests/test_wait.py::test_wait"}
    reached = record["reached"]["mbref/sums.py"]
    assert int(reached["outside"], 16) == 1 << 1 | 1 << 5
    assert reached["tests"] == [[f"{1 << 6 | 1 << 7:x}", ["tests/test_wait.py::test_wait"]]]
    found = copy.tests(planted("((n) + (1))"))
    assert found == {"tests/test_wait.py": ["tests/test_wait.py::test_wait"]}


def test_a_test_that_takes_too_long_to_be_recorded_keeps_its_lines(copy, tmp_path, monkeypatch):
    """``test_forever`` is ended in line 7 of ``wait``; ``test_failing`` fails and keeps none."""
    (copy.place / "tests").mkdir(exist_ok=True)
    (copy.place / "tests/test_forever.py").write_text(
        "from mbref.sums import total, wait\n\n\n"
        "def test_forever():\n    wait(float('inf'))\n\n\n"
        "def test_failing():\n    assert total(1, 1) == 3\n"
    )
    monkeypatch.setattr(tree, "OF_TEST", 0.2)
    copy.record(True, tmp_path / "lines.jsonl", 1, lambda done, total: None)
    records = map(json.loads, (tmp_path / "lines.jsonl").read_text().splitlines())
    [record] = [record for record in records if record["file"] == "tests/test_forever.py"]
    [(name, seconds)] = record["seconds"].items()
    assert name == "tests/test_forever.py::test_forever" and seconds > 0.0
    assert record["reached"]["mbref/sums.py"]["tests"] == [[f"{1 << 6 | 1 << 7:x}", [name]]]


def test_files_beside_kernels_run_without_compilation():
    for file in (
        "mbref/taylor/series.py",
        "mbref/equations/loads.py",
        "crosscheck/engines/compiled/calls.py",
    ):
        assert tree.is_plain(file, (ROOT / file).read_text()), file
    compiling = ("mbref/kernels/disk_cache.py", "mbref/kernels/named_memory.py")
    for file in (*compiling, "mbref/scene.py", "mbref/simulation/outcome.py", "crosscheck/study/grid.py"):
        assert not tree.is_plain(file, (ROOT / file).read_text()), file


def test_a_larger_budget_runs_survivors_again(tmp_path):
    """A kill stays a kill."""
    kept = tmp_path / "mutants.jsonl"
    assert runner.known(20.0, kept) == {}
    results = {"a": (runner.KILLED, 20.0), "b": (runner.SURVIVED, 20.0), "c": (runner.TIMED_OUT, 100.0)}
    lines = [json.dumps({"key": k, "result": r, "budget": b}) for k, (r, b) in results.items()]
    kept.write_text("\n".join(lines))
    assert runner.known(20.0, kept) == {k: result for k, (result, _) in results.items()}
    assert runner.known(100.0, kept) == {"a": runner.KILLED, "c": runner.TIMED_OUT}
    assert runner.known(101.0, kept) == {"a": runner.KILLED}


def test_the_score_counts_no_equivalent_mutant_and_no_time_out():
    results = [runner.KILLED] * 3 + [runner.SURVIVED, runner.TIMED_OUT, runner.EQUIVALENT]
    assert runner.score(results) == "3 of 5 killed (60%), 1 timed out, 1 survived, 1 equivalent"


def test_parts_of_sums_and_products_may_be_exchanged():
    source = "x = product_order(a[c], b, k) + cross(a, b)\n"
    orders = [m for m in mutants("mbref/a.py", source) if m.kind == "argument order"]
    assert [(m.new, bool(reason(m, source) == COMMUTES)) for m in orders] == [
        ("product_order(a[c], k, b)", False),
        ("product_order(b, a[c], k)", True),
        ("cross(b, a)", False),
    ]
    assert not reason(orders[1]._replace(file="crosscheck/a.py"), source)


def test_rows_that_are_exchanged_may_be_named_in_any_order():
    source = "exchange_rows(a, n, k, best, rows)\nexchange_entries(r, k, k, best)\nother(a, n, k, best)\n"
    orders = [m for m in mutants("mbref/a.py", source) if m.kind == "argument order"]
    found = [m.new for m in orders if reason(m, source) == EXCHANGED]
    assert (
        found == ["exchange_rows(a, n, best, k, rows)", "exchange_entries(r, k, best, k)"]
        and len(orders) == 9
    )


def test_arguments_that_a_function_treats_alike_may_be_exchanged():
    source = "x = np.swapaxes(a, 1, 2) + np.moveaxis(a, 1, 2) + difference(s, f(a), b)\n"
    orders = [m for m in mutants("crosscheck/a.py", source) if m.kind == "argument order"]
    assert {m.new: reason(m, source) == SYMMETRY for m in orders} == {
        "np.swapaxes(1, a, 2)": False,
        "np.swapaxes(a, 2, 1)": True,
        "np.moveaxis(1, a, 2)": False,
        "np.moveaxis(a, 2, 1)": False,
        "difference(f(a), s, b)": False,
        "difference(s, b, f(a))": True,
    }


def test_any_negative_length_is_unknown():
    source = "x = a.reshape(n, -1) + b[-1] + f(-1).reshape(1, 2)\n"
    found = [m for m in mutants("mbref/a.py", source) if (m.old, m.new) == ("1", "2")]
    assert [reason(m, source) == UNKNOWN_LENGTH for m in found] == [True, False, False, False]


def test_reasons_name_lines_that_are_there():
    for (file, line, _), why in REASONS.items():
        assert line in [text.strip() for text in (ROOT / file).read_text().splitlines()], (file, line)
        assert why.endswith("."), (file, line, why)


def test_a_crash_is_a_kill_only_where_the_mutant_causes_it(copy):
    mutant = planted("((a) - (b))")
    assert copy.result(mutant, {"test_crash.py": None}) == (runner.KILLED, "test_crash.py")
    path = copy.place / "test_always.py"
    path.write_text("import os\n\n\ndef test_always():\n    os._exit(1)\n")
    assert copy.result(mutant, {path.name: None, "test_weak.py": None}, False) == (runner.SURVIVED, "")


def test_a_test_that_fails_only_after_another_kills_nothing(copy):
    """The first test of the file fails alone, so that it needs no second run."""
    mutant = planted("((a) - (b))")
    texts = {
        "test_first.py": "from mbref.sums import total\n\n\ndef test_first():\n    assert total(1, 1) == 2\n",
        "test_after.py": "import sys\n\nfrom mbref.sums import total\n\n\ndef test_before():\n"
        "    sys.seen = total(1, 1)\n\n\ndef test_after():\n    assert getattr(sys, 'seen', 2) == 2\n",
    }
    for name, text in texts.items():
        (copy.place / name).write_text(text)
    assert copy.result(mutant, {"test_after.py": None}, False) == (runner.SURVIVED, "")
    assert copy.result(mutant, {"test_first.py": None}, False) == (runner.KILLED, "test_first.py::test_first")
