"""Keep the records of a report, to be committed: one compressed file, from which its pages are rendered.

``python -m reports.keep build/reference reports/reference`` packs the records of a folder into another one.
"""

from __future__ import annotations

from pathlib import Path

from crosscheck.study.store import MOTION, pack
from mbref.command_line import Parser

if __name__ == "__main__":
    parser = Parser(description=__doc__)
    parser.add_argument("source", type=Path, help="folder of the records")
    parser.add_argument("folder", type=Path, help="folder of the compressed file")
    parser.add_argument("--without-motions", action="store_true", help="leave out the motions of runs")
    options = parser.parse_args()
    pack(options.source, options.folder, MOTION if options.without_motions else ())
