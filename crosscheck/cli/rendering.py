"""Reports and pages: `reports` run as a program, a part of this package in a wheel, a folder in a checkout.

This package must not import `reports`, which depends on it.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from crosscheck.processes.program import run_program

KILLED = 128  # plus the number of the signal that ended a program


def rendered(options: Sequence[str], part: str = "") -> int:
    """Run `reports`, or a part of it, with options, and return the exit status."""
    inside = "crosscheck.reports"
    status = run_program((inside if find_spec(inside) else "reports") + part, options)
    return status if status >= 0 else KILLED - status


def write_page(name: str, records: Path, page: str | None) -> int:
    """Write a page of the documentation from a file of records, if a page is requested; return the exit
    status."""
    return rendered([name, f"--records={records}", f"--out={page}"], ".pages") if page else 0
