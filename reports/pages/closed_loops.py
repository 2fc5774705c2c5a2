"""The page on engines and closed loops."""

from __future__ import annotations

from pathlib import Path

from crosscheck.closed_loops.records import FILE
from crosscheck.study.store import read_runs

from ..blocks import Parts
from ..sections.closed_loops import overview, runs


def parts(records: Path = FILE) -> Parts:
    """Return the parts of the page from the records in a file."""
    found = read_runs(records)
    return {"overview": overview(found), "runs": runs(found)}
