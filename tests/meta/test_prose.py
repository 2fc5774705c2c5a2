"""README, CHANGELOG and docs are in plain words: no fault by proselint with the rules of tests/prose.toml."""

import pytest

pytest.importorskip("proselint", reason="installed by the extra `dev`")
from tests import prose

PAGES = prose.pages()


@pytest.mark.parametrize("path", PAGES, ids=[str(path.relative_to(prose.ROOT)) for path in PAGES])
def test_page_has_no_fault_by_the_rules_of_prose(path):
    """``prose.faults`` finds private words, long sentences and faults by proselint."""
    found = [f"{path.name}:{line}: {message}" for line, message in prose.faults(path.read_text())]
    assert not found, "\n".join(found)


@pytest.mark.parametrize("path", PAGES, ids=[str(path.relative_to(prose.ROOT)) for path in PAGES])
def test_page_begins_with_a_sentence_and_shows_code_or_a_picture_in_30_lines(path):
    """The first line is the title; the changelog shows no code."""
    lines = path.read_text().splitlines()
    first = next(line for line in lines[1:] if line)
    assert lines[0].startswith("# ") and first[:1] not in "#|-", first
    assert path.name == "CHANGELOG.md" or "`" in "".join(lines[1:30]) or "![" in "".join(lines[1:30])


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        ("# A page\n\nThe rows, but for one.\n", [3]),
        ("A run tells the error.\n", [1]),
        ("`told` is a name.\n\n```sh\ntells\n```\n", []),
        ("One | cell told | here\n", [1]),
        ("Word " * 37 + ".\n", [1]),
        (("Word " * 30 + ".\n") * 3, []),
        ("It is very unique.\n", [1, 1]),  # by two rules of proselint
    ],
)
def test_faults_of_prose_are_found_with_their_lines(text, lines):
    """Private words, sentences of more than 36 words, faults by proselint; code is left out."""
    assert [line for line, _ in prose.faults(text)] == lines
