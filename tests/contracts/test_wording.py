"""Words for numbers and lists, worked out by hand at the ends of ranges."""

import pytest

from crosscheck.study.words import text


def test_list_is_joined_by_commas_and_the_word_and():
    """Lists of none, one, two and three names."""
    assert [text.listed(names) for names in ([], "a", "ab", "abc")] == ["", "a", "a and b", "a, b and c"]


@pytest.mark.parametrize(
    ("value", "bound", "said"),
    [
        (6.04e-9, 1e-14, "6.1e-9"),
        (6.0e-9, 6.0e-9, "6.0e-9"),
        (9.91e-9, 0.0, "1.0e-8"),
        (0.0, 0.0, "0"),
        (5e-15, 3e-14, "less than the truth's own bound, 3e-14"),
    ],
)
def test_error_is_rounded_up_or_called_less_than_the_bound(value, bound, said):
    """``value`` is a run's error, ``bound`` that of the truth: two digits, rounded up, hold for "at most"."""
    assert text.at_most(value, bound) == said


def test_times_and_ratios_are_rounded_across_their_units():
    """Three digits and two digits: 0.9996 s are 1 s, not 1000 ms; 9.95 times are 10 times, not 9.9."""
    assert [text.seconds(t) for t in (1.0, 0.999, 1e-3, 9.99e-4)] == ["1 s", "999 ms", "1 ms", "999 µs"]
    assert [text.seconds(t) for t in (0.9996, 0.9994, 9.996e-4)] == ["1 s", "999 ms", "1 ms"]
    assert [text.multiple(r) for r in (9.94, 9.95)] == ["9.9 times", "10 times"]
    assert (text.span(2.0, 2.04), text.span(1.5, 30.0)) == ("2.0 times", "1.5 to 30 times")
