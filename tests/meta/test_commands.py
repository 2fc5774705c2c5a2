"""Commands that README and docs print are accepted; `tests/test_printed_commands.py` runs them."""

import functools
import importlib
import re

import crosscheck.cli.parser
import mbref.cli.commands
from tests.printed_commands import FOUND, ROOT

MODULES = {"mbref": mbref.cli.commands, "crosscheck": crosscheck.cli.parser}
PARSERS = {name: functools.cache(module.parser) for name, module in MODULES.items()}


OF_PROGRAMS = [(page, words) for page, words in FOUND if words[0] in PARSERS]


def test_pages_print_more_than_50_commands_of_both_programs():
    """The collector finds them: without any, the test below would have no case."""
    assert len(OF_PROGRAMS) > 50 and {words[0] for _, words in OF_PROGRAMS} == set(PARSERS)


def test_commands_that_pages_print_are_accepted_by_their_parsers():
    """OF_PROGRAMS are the commands of README and docs. The parser of mbref or crosscheck ends the program for
    an unknown word; ``> FILE`` is the shell's."""
    refused = []
    for page, words in OF_PROGRAMS:
        program, *arguments = words[: words.index(">")] if ">" in words else words
        try:
            PARSERS[program]().parse_args(arguments)
        except SystemExit:
            refused.append(f"{page}: {' '.join(words)}")
    assert not refused, refused


def test_files_that_pages_run_by_python_exist():
    """A page prints ``python FILE``."""
    files = [words[1] for _, words in FOUND if words[0] == "python"]
    assert files and not [file for file in files if not (ROOT / file).is_file()], files


def test_tests_that_pages_select_by_name_exist():
    """A page prints ``pytest -k NAME``."""
    names = [words[words.index("-k") + 1] for _, words in FOUND if "-k" in words]
    defined = "".join(path.read_text() for path in (ROOT / "tests").rglob("test_*.py"))
    assert names and not [name for name in names if f"def {name}(" not in defined], names


def test_tests_that_the_gate_names_exist():
    """.ci/run names files, and tests as FILE::TEST[CASE], a text of the test's cases or of their ids; pytest
    would end with an error in CI alone."""
    named = re.findall(r"(tests/\S+)\.py(?:::(\w+)\[(.+?)\])?", (ROOT / ".ci" / "run").read_text())
    assert any(name for _, name, _ in named)
    for path, name, case in named:
        assert (ROOT / f"{path}.py").is_file(), path
        if name:
            marks = getattr(importlib.import_module(path.replace("/", ".")), name).pytestmark
            [cases] = [m.kwargs.get("ids", m.args[1]) for m in marks if m.name == "parametrize"]
            assert case in cases, (path, name, case)
