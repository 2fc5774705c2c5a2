"""Messages are in plain words; `python -m tests.messages` prints all of them in a row."""

import ast
import functools
import re

import pytest

from tests.messages import collected, messages
from tests.meta.test_words import WORDS

RIDDLES = re.compile(  # turns of which a reader has to find the noun, or the meaning
    r"\b(of no joint|whatever its error\b(?! estimate)|as it comes|left as it is|done without|is told|"
    r"made anew|cannot be told|out of reach|bear that)\b"
)


@functools.cache
def every_message():
    return list(collected())


@pytest.mark.parametrize("unclear", [WORDS, RIDDLES], ids=["private words", "phrases without a noun"])
def test_messages_contain_no_private_word_and_no_phrase_without_a_noun(unclear):
    """WORDS are words of this project's history; of RIDDLES a user has to guess the thing that is meant. More
    than 800 messages are read from the source."""
    assert len(every_message()) > 800, len(every_message())
    wrong = [f"{place}:{line}: {text}" for place, line, text in every_message() if unclear.search(text)]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ('raise ValueError(f"the step {h} is too small")', ["the step {…} is too small"]),
        ('say("one of the " "rows is redundant")', ["one of the rows is redundant"]),
        ('"""A docstring is not a message."""', []),
        ('x = "short text"', []),
    ],
)
def test_collector_finds_messages_and_leaves_out_docstrings_and_short_texts(source, found):
    """Four lines of source and the messages in them; ``{…}`` stands for a value."""
    assert [text for _, text in messages(ast.parse(source))] == found
