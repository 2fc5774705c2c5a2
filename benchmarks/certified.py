"""The certified tables, made again: `python benchmarks/certified.py [--add NAME=SECONDS …] [NAME …]`.

Without names all tables are made again and compared with those that are kept; a difference above the bound of
a table is told.  ``--add`` makes a table of a built-in scene or of a random mechanism, random_N, that has
none: of NAME from 0 to SECONDS.  No table is overwritten.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.cli.request import find_certifiable
from crosscheck.judge.reference import certify

FOLDER = Path(certify.__file__).with_name("certified")
DIGITS, SAMPLES = 20, 3
COLUMNS = ("scene", "s", "digits", "bound", "replaced joints", "CPU s")


def main() -> None:
    """Print one row a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("name", nargs="*", metavar="NAME")
    parser.add_argument("--add", action="append", default=[], metavar="NAME=SECONDS")
    asked = parser.parse_args()
    known = {path.stem: json.loads(path.read_text()) for path in sorted(FOLDER.glob("*.json"))}
    print(f"| {' | '.join(COLUMNS)} | |\n| --- {'| --: ' * 3}| --- | --: | --- |")
    for name, _, end in (given.partition("=") for given in asked.add):
        row(name, np.linspace(0.0, float(end), SAMPLES), DIGITS, None)
    for name in () if asked.add else asked.name or known:
        row(name, np.array(known[name]["times"]), known[name]["digits"], known[name])


def row(name: str, times: np.ndarray, digits: int, kept: dict[str, Any] | None) -> None:
    """Print a table's row; write the table where there is none."""
    began = time.process_time()
    try:
        made = certify.certified(find_certifiable(name), times, digits)
    except certify.NotCertified as reason:
        print(f"| {name} | {times[-1]:g} | | | | {time.process_time() - began:.0f} | {reason} |", flush=True)
        return
    if kept is None:
        text = json.dumps(made, indent=1, ensure_ascii=False)
        with open(FOLDER / f"{name}.json", "x", encoding="utf-8") as file:
            file.write(text + "\n")
    others = ", ".join(f"{joint} {kind}" for joint, kind in made.get("replaced", {}).items())
    cells = [name, f"{times[-1]:g}", str(digits), made["bound"], others]
    print(f"| {' | '.join(cells)} | {time.process_time() - began:.0f} | {compared(made, kept)} |", flush=True)


def compared(made: dict[str, Any], kept: dict[str, Any] | None) -> str:
    """Whether a table agrees with the kept one to its digits."""
    from flint import arb

    if kept is None:
        return "added"
    pairs = zip(*(np.ravel(np.array(t["position"], dtype=object)) for t in (made, kept)), strict=True)
    apart = max(abs(float(arb(a) - arb(b))) for a, b in pairs)
    return "as kept" if apart <= 10.0 ** -kept["digits"] else f"{apart:.0e} m from the one kept"


if __name__ == "__main__":
    main()
