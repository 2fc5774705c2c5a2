"""The certified tables, made again: `python benchmarks/certified.py [--add NAME=SECONDS …] [NAME …]`.

Without names all tables are made again and compared with the stored tables; a difference above the bound of a
table is reported.  ``--add`` makes a table of a built-in scene or of a random mechanism, random_N, from 0 to
SECONDS.  No table is edited: with ``--supersede`` a table that differs, or has other times, is replaced by
the next version, which names the hash of the previous version.
"""

from __future__ import annotations

import argparse
import json
import time
from typing import Any

import numpy as np

from crosscheck.cli.scene_request import find_certifiable
from crosscheck.judge.reference import certify

DIGITS, SAMPLES = 20, 3
COLUMNS = ("scene", "s", "digits", "bound", "replaced joints", "CPU s")
SAME = "as kept"


def main() -> None:
    """Print one row a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("name", nargs="*", metavar="NAME")
    parser.add_argument("--add", action="append", default=[], metavar="NAME=SECONDS")
    parser.add_argument(
        "--supersede", action="store_true", help="replace tables that differ by the next version"
    )
    asked = parser.parse_args()
    known = {path.stem: json.loads(path.read_text()) for path in sorted(certify.FOLDER.glob("*.json"))}
    print(f"| {' | '.join(COLUMNS)} | |\n| --- {'| --: ' * 3}| --- | --: | --- |")
    for name, _, end in (given.partition("=") for given in asked.add):
        row(name, np.linspace(0.0, float(end), SAMPLES), DIGITS, known.get(name), asked.supersede)
    for name in () if asked.add else asked.name or known:
        row(name, np.array(known[name]["times"]), known[name]["digits"], known[name], asked.supersede)


def row(name: str, times: np.ndarray, digits: int, kept: dict[str, Any] | None, supersede: bool) -> None:
    """Print the row of a table; write the table if it is missing, or if it differs and is to be replaced."""
    began = time.process_time()
    try:
        made = certify.certified(find_certifiable(name), times, digits)
    except certify.NotCertified as reason:
        print(f"| {name} | {times[-1]:g} | | | | {time.process_time() - began:.0f} | {reason} |", flush=True)
        return
    said = compared(made, kept)
    if kept is None:
        write(name, made)
    elif supersede and said != SAME:
        write(name, made | {"version": kept["version"] + 1, "supersedes": kept["hash"]})
    others = ", ".join(f"{joint} {kind}" for joint, kind in made.get("replaced", {}).items())
    cells = [name, f"{times[-1]:g}", str(digits), made["bound"], others]
    print(f"| {' | '.join(cells)} | {time.process_time() - began:.0f} | {said} |", flush=True)


def write(name: str, table: dict[str, Any]) -> None:
    """Store a table with its hash."""
    text = json.dumps(table | {"hash": certify.digest(table)}, indent=1, ensure_ascii=False)
    (certify.FOLDER / f"{name}.json").write_text(text + "\n", encoding="utf-8")


def compared(made: dict[str, Any], kept: dict[str, Any] | None) -> str:
    """Return whether a table agrees with the stored table to its digits."""
    from flint import arb

    if kept is None:
        return "added"
    if made["times"] != kept["times"]:
        return f"instead of one to {kept['times'][-1]:g} s"
    pairs = zip(*(np.ravel(np.array(t["position"], dtype=object)) for t in (made, kept)), strict=True)
    apart = max(abs(float(arb(a) - arb(b))) for a, b in pairs)
    return SAME if apart <= 10.0 ** -kept["digits"] else f"{apart:.0e} m from the one kept"


if __name__ == "__main__":
    main()
