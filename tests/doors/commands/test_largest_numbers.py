"""Numbers beyond the ends of an option are refused before anything is built, with the largest value."""

from typing import Any

import pytest

import crosscheck
from crosscheck.cli import main
from crosscheck.cli.request import RequestError
from mbref.cli import main as mbref
from tests.helpers.still_engines import resting

NO_COUNTS = ("99999999999999999999", "9" * 5000, "-1", "0.5", "many")
PROGRAMS = {"crosscheck": main, "mbref": mbref}
SAMPLES = "from 2 to 1000000"
VARIED = ("mbref", "ensemble", "four_bar", "--vary", "gravity[1]=0:1")
COUNTS = {
    **{("crosscheck", c, "four_bar", "--samples"): SAMPLES for c in ("run", "compare", "certify")},
    ("crosscheck", "compare", "four_bar", "--repeats"): "from 5 to 1000",
    ("crosscheck", "reference", "four_bar", "--out", "new.csv", "--samples"): SAMPLES,
    ("crosscheck", "verify", "mbref", "--mechanisms"): "from 1 to 100000",
    ("crosscheck", "verify", "mbref", "--first-seed"): "from 0 to 1000000000000",
    ("crosscheck", "modes", "four_bar", "--starts"): "from 1 to 10000",
    **{("mbref", c, "four_bar", "--samples"): SAMPLES for c in ("run", "plot", "animate")},
    **{("mbref", c, "four_bar", "--starts"): "from 1 to 10000" for c in ("equilibrium", "modes")},
    (*VARIED, "--count"): "from 1 to 1000000",
    (*VARIED, "--workers"): "from 1 to 1000",
    (*VARIED, "--seed"): "from 0 to 1000000000000",
}
NO_TIMES = ["99999999999999999999", "1.1e9", "inf", "nan", "-1"]
NO_ERRORS = ["1e20", "1.1", "inf", "nan", "-1e-3"]
RANGES = {  # command line up to an option: its numbers allowed, and some beyond
    "run four_bar --time-limit": ("positive and at most 1e+07 s", NO_TIMES),
    "compare four_bar --time-limit": ("positive and at most 1e+07 s", NO_TIMES),
    "report four_bar --reference-time": ("from 0 to 1e+07 s", NO_TIMES),
    "compare four_bar --reference-time": ("from 0 to 1e+07 s", NO_TIMES),
    "run four_bar --duration": ("positive and at most 1e+09 s", ["0", *NO_TIMES]),
    "compare four_bar --duration": ("positive and at most 1e+09 s", ["0", *NO_TIMES]),
    "tune mbref four_bar --duration": ("positive and at most 1e+09 s", ["0", *NO_TIMES]),
    "reference four_bar --out new.csv --duration": ("positive and at most 1e+09 s", ["0", *NO_TIMES]),
    "run four_bar --rtol": ("positive and at most 0.99", ["0", "1", *NO_ERRORS]),
    "compare four_bar --rtol": ("positive and at most 0.99", ["0", "1", *NO_ERRORS]),
    "tune mbref four_bar --error": ("positive and at most 1", NO_ERRORS),
    "judge four_bar run.csv --tolerance": ("from 0 to 1", NO_ERRORS),
}


def ended(capsys: pytest.CaptureFixture[str], *command: str, program: str = "crosscheck"):
    """Return the exit status of a command line, and its standard error."""
    try:
        status: object = PROGRAMS[program](command)
    except SystemExit as end:
        status = end.code
    return status, capsys.readouterr().err


@pytest.mark.parametrize("text", NO_COUNTS, ids=lambda text: f"{text[:6]} ({len(text)})")
@pytest.mark.parametrize("command", COUNTS, ids=" ".join)
def test_count_outside_its_range_is_refused_with_the_range(command: tuple[str, ...], text: str, capsys):
    """COUNTS has the range of each option; NO_COUNTS are too large, negative, a fraction and a word. The last
    line of the error is a screen's width or two long, with 40 of 5000 digits."""
    program, *words = command
    status, said = ended(capsys, *words, text, program=program)
    assert status == 2
    assert f"{command[-1]}: must be a whole number {COUNTS[command]}, got {text[:40]}" in said
    assert len(said.splitlines()[-1]) < 200


@pytest.mark.parametrize(("command", "text"), [(c, text) for c in RANGES for text in RANGES[c][1]])
def test_number_outside_its_range_is_refused_with_the_range(command: str, text: str, capsys):
    """RANGES has the option's range and numbers outside of it. Errors are relative to the mechanism's length,
    so that their limits are at most 1. The number is shown as it was given, or with six digits."""
    *words, option = command.split()
    status, said = ended(capsys, *words, f"{option}={text}")
    beginning = f"{option}: must be {RANGES[command][0]}, got "
    assert status == 2 and any(beginning + got in said for got in (text, f"{float(text):g}")), said


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("99999999999999999999", "the end must be positive and at most 1e+09 s, got 1e+20"),
        ("1.1e9", "the end must be positive and at most 1e+09 s, got 1.1e+09"),
        ("nan", "must be finite and not negative, got nan"),
        ("0", "must increase, got 0 after 0"),
    ],
)
@pytest.mark.parametrize("command", ["run", "compare"])
def test_sample_time_beyond_the_largest_or_not_increasing_is_refused_by_option(command, text, says, capsys):
    status, said = ended(capsys, command, "four_bar", "--times", f"0,{text}")
    assert status == 2 and f"--times: {says}" in said


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--times=0.2,0.1"], "must be finite, not negative and increasing, got 0.2,0.1"),
        (["--times=0,nan"], "must be finite, not negative and increasing, got 0,nan"),
        (["--times=-1,0"], "must be finite, not negative and increasing, got -1,0"),
        (["--times=1,x"], "must be numbers separated by commas, got '1,x'"),
        (["--times=1", "--duration=0.5"], "must end by --duration 0.5, got 1"),
    ],
)
def test_times_of_mbref_that_are_no_samples_are_refused_with_the_option(words: list[str], says: str, capsys):
    assert mbref(["run", "four_bar", *words]) == 2
    assert capsys.readouterr().err == f"--times: {says}\n"


@pytest.mark.parametrize("option", ["--duration", "--times"])
@pytest.mark.parametrize(
    "command", [("run",), ("plot",), ("animate",), ("ensemble", "--vary", "duration=0.1:0.2")], ids=" ".join
)
def test_duration_of_more_than_a_billion_seconds_is_refused_with_the_limit(command, option: str, capsys):
    assert mbref([*command, "four_bar", option, "1e20"]) == 2
    assert f"{option}: must be" in (said := capsys.readouterr().err) and "at most 1e+09 s, got 1e+20" in said


@pytest.mark.parametrize(
    ("gap", "says"),
    [
        ("1km", "must be at most the mechanism's length, 0.707 m, got 1000 m"),
        *((gap, "must be positive") for gap in ("0mm", "-1 mm")),
        *(("3 parsec", "'parsec' is no unit of length"), ("wide", "must be a number")),
    ],
)
def test_closure_gap_that_is_no_length_up_to_the_mechanisms_own_is_refused(capsys, gap, says):
    """The largest distance in the start pose of the four-bar, a rhombus of 0.5 m sides, is 0.5 √2 m."""
    engine = "tests.helpers.still_engines:LOGGED"
    status, said = ended(capsys, "tune", engine, "four_bar", f"--closure={gap}")
    assert status == 2 and "--closure: " in said and says in said, said


def test_samples_that_would_fill_the_memory_are_refused_with_the_largest_number(tmp_path, capsys):
    """A reference may have 5 million samples times bodies; 20 four-bars in a chain have 41 bodies."""
    out = tmp_path / "ref.csv"
    status, said = ended(capsys, "reference", "four_bar_chain[20]", "--out", str(out), "--samples", "1000000")
    assert f"--samples: at least 2 and at most {5_000_000 // 41} for the 41 bodies of four_bar_chain" in said
    assert status == 2 and not out.exists()


@pytest.mark.parametrize(
    ("wanted", "said"),
    [
        ({"samples": 10**20}, "at least 2 and at most 5000000 for the 1 bodies of resting, got 10"),
        ({"samples": 1}, "--samples: at least 2 and at most 5000000 for the 1 bodies of resting, got 1$"),
        ({"time_limit": 1e30}, r"--time-limit: must be positive and at most 1e\+07 s, got 1e\+30"),
        ({"time_limit": -1.0}, r"--time-limit: must be positive and at most 1e\+07 s, got -1"),
    ],
)
def test_function_compare_refuses_samples_and_times_as_the_command_does(wanted: dict[str, Any], said: str):
    """The scene has one body; a reference may have 5 million samples times bodies."""
    with pytest.raises(RequestError, match=said):
        crosscheck.compare(resting(), "tests.helpers.still_engines:LOGGED", **wanted)
