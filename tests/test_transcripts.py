"""Outputs shown in README and docs: each command still prints what stands under it, except for numbers."""

from pathlib import Path

import pytest

from tests.printed_commands import PAGES, ROOT
from tests.transcripts import BLOCK, OUTPUT, blocks, commands, filled, shape

SHOWING = {str(page.relative_to(ROOT)): page for page in PAGES if blocks(page.read_text())}
RENEW = "python -m tests.transcripts {} renews the outputs"


def is_costly(page: Path) -> bool:
    """Return whether the commands of a page compare engines or make whole studies."""
    found = [command for block in blocks(page.read_text()) for command in commands(block)]
    return page.name == "gallery.md" or any(command.startswith("crosscheck ") for command in found)


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] * is_costly(page)) for n, page in SHOWING.items()]
)
def test_commands_print_what_pages_show(name):
    """Words are compared; numbers and borders of tables may differ between machines."""
    text = SHOWING[name].read_text()
    for shown, found in zip(blocks(text), blocks(filled(text)), strict=True):
        assert shape(shown) == shape(found), RENEW.format(name)


def test_every_command_of_a_page_has_its_output():
    """A block of console text begins with a command, and no command follows another one directly."""
    for name, page in SHOWING.items():
        for block in BLOCK.findall(page.read_text()):
            lines = block.splitlines()
            bare = [a for a, b in zip(lines, [*lines[1:], "$ "], strict=True) if a[:2] == b[:2] == "$ "]
            assert lines[0].startswith("$ ") and not bare, f"{name}: {bare}; {RENEW.format(name)}"


def test_output_of_each_command_is_filled_in_under_it():
    """`filled` runs the commands of a page by a shell; text outside the block stays."""
    text = "Before.\n\n```console\n$ echo 0.25 m\n$ echo two\n```\n\nBehind.\n"
    assert filled(text) == text.replace("$ echo two", "0.25 m\n$ echo two\ntwo")


def test_command_that_prints_nothing_is_an_error():
    """An output cannot be shown; the error has the exit status."""
    with pytest.raises(RuntimeError, match="printed nothing, with exit status 3"):
        filled("```console\n$ exit 3\n```\n")


def test_comparison_of_outputs_ignores_numbers_and_sees_units():
    """``shape`` of a text is equal for outputs that differ in numbers alone."""
    assert shape("0.25 m") == shape("< 1e-13 m") != shape("0.25 mm")


def test_output_of_python_is_filled_in_behind_it():
    """`filled` runs the block of Python and writes what it prints into the block of text after it."""
    text = f"```python\nprint(1 + 1)\n```\n\n{OUTPUT}\n```text\n```\n"
    assert filled(text) == text.replace("```text\n", "```text\n2\n")
    assert blocks(filled(text)) == ["2\n"]
