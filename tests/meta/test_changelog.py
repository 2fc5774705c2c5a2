"""The changelog: one plain line for each change, and a section for the version of the packages."""

import re
from pathlib import Path

from mbref import __version__

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "CHANGELOG.md").read_text()
SECTIONS = re.split(r"^## ", TEXT, flags=re.M)[1:]
MOST, LONGEST = 60, 125  # entries of a version, characters of an entry


def entries(section: str) -> list[str]:
    """Return the lines of a section that are neither blank nor headings."""
    return [line for line in section.splitlines()[1:] if line and not line.startswith("### ")]


def test_newest_released_section_and_the_citation_are_of_the_version_of_the_packages():
    """A section Unreleased may stand before the newest released one."""
    released = SECTIONS[1:] if SECTIONS[0].startswith("Unreleased\n") else SECTIONS
    assert released[0].startswith(f"{__version__}\n"), released[0][:20]
    assert f"\nversion: {__version__}\n" in (ROOT / "CITATION.cff").read_text()


def test_section_has_at_most_60_entries_of_one_line_without_timings():
    """A line has at most 125 characters (LONGEST); times stand in docs/speed.md."""
    for section in SECTIONS:
        lines = entries(section)
        assert 0 < len(lines) <= MOST, f"{section[:6]} has {len(lines)} entries, at most {MOST} are allowed"
        wrong = [line for line in lines if not line.startswith("- ") or len(line) > LONGEST]
        assert not wrong, f"one line of at most {LONGEST} characters each: {wrong}"
        assert not [line for line in lines if re.search(r"\d (ms|µs|s|min)\b", line)], "timings: speed.md"


def test_headings_are_the_six_of_keep_a_changelog():
    """Headings of the third level, below those of versions."""
    found = re.findall(r"^### (.*)$", TEXT, flags=re.M)
    assert found and set(found) <= {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}
