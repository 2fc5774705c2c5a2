"""Orders of convergence of engines.

``python -m crosscheck.convergence docs/convergence.md`` writes the page from the stored records, without a
path it prints the page. ``python -m crosscheck.convergence --run --engine drake`` first makes the runs of an
engine that the records lack.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from crosscheck.convergence.document import page
from crosscheck.convergence.ladders import ROWS, measure


def main() -> None:
    """Make runs if requested, and write or print the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("page", nargs="?", metavar="FILE")
    parser.add_argument("--run", action="store_true", help="make the runs that the records lack")
    parser.add_argument("--engine", action="append", metavar="E", help="only this engine; may repeat")
    arguments = parser.parse_args()
    if arguments.run:
        measure(arguments.engine or [row.engine for row in ROWS])
    if arguments.page:
        Path(arguments.page).write_text(page())
    else:
        print(page(), end="")


if __name__ == "__main__":
    main()
