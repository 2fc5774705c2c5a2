"""Thresholds outside crossings of singular positions: a page that lists them, and a check of most of them."""

from pathlib import Path

from tests import thresholds
from tests.mbref import (  # noqa: F401 - what is checked
    limits_of_equations,
    limits_of_runs,
    limits_of_scenes,
    limits_of_solutions,
)
from tests.mbref.test_thresholds import interpreted
from tests.mbref.threshold_checks import CHECKS

FILE = Path(__file__).with_name("interpreted_limits.py")
PAGE = thresholds.ROOT / "docs" / "internals" / "thresholds.md"


def test_each_checked_decision_outside_crossings_changes_at_its_threshold():
    done = interpreted("-m", "pytest", "-q", "-p", "no:cacheprovider", str(FILE))
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-1000:]
    assert len(thresholds.checked()) == len(CHECKS)
    assert f"{3 * len(CHECKS)} passed" in done.stdout, done.stdout[-500:]


def test_the_page_lists_all_thresholds_with_their_comments():
    assert PAGE.read_text() == thresholds.page(), "python -m tests.thresholds docs/internals/thresholds.md"
    assert "| no |" not in PAGE.read_text(), "give the threshold a check, or put its name in thresholds.COSTS"


def test_a_constant_is_read_with_its_value_and_comment():
    text = "# reason\nONE, TWO = 1.0, -2\nTHREE = 3  # other\nFOUR = 4\nFIVE = name()  # no number\n"
    found = list(thresholds.constants("folder/file.py", text))
    assert [each[:3] for each in found] == [
        ("folder.file", "ONE", "1.0"),
        ("folder.file", "TWO", "-2"),
        ("folder.file", "THREE", "3"),
    ]
    assert [each.comment for each in found] == ["reason", "reason", "other"]
