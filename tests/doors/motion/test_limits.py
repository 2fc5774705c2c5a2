"""Limits: a number outside its interval is refused by its name."""

import math
from itertools import product

import numpy as np
import pytest

from mbref.cli import main
from mbref.stepping.limits import Limits

STEPS = ("first_step", "smallest_step", "forced_step", "largest_step", "largest_turn")
NUMBERS = ("rtol", "atol", "rank_tolerance", "violation", *STEPS)
WRONG = (-1.0, math.nan, math.inf, 5e-324, 10**400, "1", True, [1.0])


def test_limit_that_is_no_finite_number_in_its_interval_is_refused_by_name():
    """NUMBERS are the tolerances and lengths of steps. WRONG has a negative number, NaN, infinity, a denormal
    number, an integer above all floats, a text, a truth value and a list. Tolerances of 0 and an rtol of 1
    are refused, too."""
    ends = ("rtol", 0.0), ("rtol", 1.0), ("atol", 0.0), ("violation", 0.0)
    for name, value in (*product(NUMBERS, WRONG), *ends):
        with pytest.raises(ValueError, match=f"^{name}: must be "):
            Limits(**{name: value})


def test_step_limit_of_zero_which_means_no_limit_is_accepted():
    """STEPS limit the length and turn of a step. A whole number, 0, is stored as the float 0.0."""
    assert [repr(getattr(Limits(**{name: 0}), name)) for name in STEPS] == ["0.0"] * len(STEPS)


def test_largest_number_of_steps_that_is_no_positive_whole_number_is_refused():
    """Zero, a negative number, floats, a truth value, a text, nothing, and more than 64 bits hold."""
    for value in (0, -1, 1.5, 100.0, 2**63, True, "9", None):
        with pytest.raises(ValueError, match=r"^most_steps: must be a whole number from 1"):
            Limits(most_steps=value)


def test_unknown_kind_of_code_is_refused_with_the_three_known():
    """Code is generated for a scene, general, or chosen by the program."""
    with pytest.raises(ValueError, match=r"^code: must be one of auto, generic, generated, got 'fast'"):
        Limits(code="fast")


def test_numpy_numbers_are_stored_as_python_floats_and_integers():
    """The limits of numpy's numbers are equal to those of Python's numbers."""
    limits = Limits(rtol=np.float32(0.5), atol=np.int64(1), most_steps=np.int32(7))
    assert [type(x) for x in (limits.rtol, limits.atol, limits.most_steps)] == [float, float, int]
    assert limits == Limits(rtol=0.5, atol=1.0, most_steps=7)


@pytest.mark.parametrize("word", ["--rtol=5e-324", "--rtol=1", "--rtol=nan", "--max-step=-1"])
def test_command_refuses_a_limit_by_the_name_of_its_option(word, capsys):
    """`mbref run` ends with status 2; ``--max-step`` is the option of ``largest_step``."""
    assert main(["run", "four_bar", word]) == 2
    assert capsys.readouterr().err.startswith(f"{word.partition('=')[0]}: must be ")
