"""Commands that README and docs print are accepted; `tests/test_printed_commands.py` runs them."""

import functools
import re

import pytest

import crosscheck.cli.parser
import mbref.cli.commands
from tests.printed_commands import FOUND, ROOT

PARSERS = {
    "mbref": functools.cache(mbref.cli.commands.parser),
    "crosscheck": functools.cache(crosscheck.cli.parser.parser),
}


def test_pages_print_more_than_50_commands_of_both_programs():
    """The collector finds them: without any, the test below would have no case."""
    assert len(FOUND) > 50 and {words[0] for _, words in FOUND} >= set(PARSERS)


@pytest.mark.parametrize(("page", "words"), FOUND, ids=[f"{page} {' '.join(words)}" for page, words in FOUND])
def test_command_that_a_page_prints_is_accepted_by_its_parser(page, words):
    """The parsers of mbref and crosscheck accept it. Other commands name a file or module for python that
    exists, an existing test after ``-k``, or the packaged conformance tests."""
    program, *arguments = words
    if program in PARSERS:
        plain = arguments[: arguments.index(">")] if ">" in arguments else arguments
        known = PARSERS[program]().parse_args(plain)
        assert callable(known.action) if program == "mbref" else known.command == plain[0]
    elif program == "python":
        assert (ROOT / arguments[0]).is_file() or (ROOT / arguments[1].replace(".", "/")).exists()
    elif "-k" in arguments:
        name = arguments[arguments.index("-k") + 1]
        assert any(f"def {name}(" in path.read_text() for path in (ROOT / "tests").rglob("test_*.py"))
    else:
        assert arguments[:2] == ["--pyargs", "crosscheck.conformance"]


def test_tests_that_the_gate_names_exist():
    """.ci/run names tests as FILE::TEST; pytest would end with an error in CI alone."""
    named = re.findall(r"(tests/\S+\.py)::(\w+)", (ROOT / ".ci" / "run").read_text())
    assert named
    for path, name in named:
        assert f"def {name}(" in (ROOT / path).read_text(), (path, name)
