"""Keep the records of stability ladders without their motions, to be committed.

``python -m reports.ladders build/stability reports/stability`` writes them to another folder; `make ladders`
runs the ladders before, and renders them afterwards.
"""

from __future__ import annotations

from pathlib import Path

from crosscheck.study.stability import FILE
from mbref.command_line import Parser
from mbref.files import write
from mbref.records import looked_at, strict_json

# fields of a record that the section shows, and its origin
KEPT = ("schema", "key", "scene", "engine", "version", "family", "outcome", "message", "t_end", "metrics")
ORIGIN = ("asked", "time_limit", "versions", "commit", "date")


def keep(source: Path, folder: Path) -> None:
    """Write the records of a folder to another one, in the order of rungs, without motions and costs."""
    folder.mkdir(parents=True, exist_ok=True)
    records = sorted(looked_at(source / FILE).values(), key=lambda r: (r["scene"], r["engine"], r["family"]))
    lines = (strict_json({name: record[name] for name in (*KEPT, *ORIGIN)}) for record in records)
    write(folder / FILE, "\n".join(lines) + "\n")


if __name__ == "__main__":
    parser = Parser(description=__doc__)
    parser.add_argument("source", type=Path, help="folder of the records with their motions")
    parser.add_argument("folder", type=Path, help="folder of the records without motions")
    options = parser.parse_args()
    keep(options.source, options.folder)
