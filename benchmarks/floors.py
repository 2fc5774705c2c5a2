"""Least error of every engine on every built-in scene, with its setting and cost.

``python benchmarks/floors.py [--records FILE] [--engine NAME …] [SCENE …]``: runs the finest settings of
every family, resumes from FILE, prints the table that the report opens with; its status is 1 where an engine
stays above the floor asked of it.
"""

import argparse
import sys

from rich.console import Console
from rich.table import Table

from crosscheck.floors import HEADER, candidates, floors
from crosscheck.progress import shown
from crosscheck.study import study
from mbref.scenes import SCENES

ENGINES = ("mujoco", "pinocchio", "exudyn")


def main() -> int:
    """Run and print; returns 1 where a floor is not reached."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", nargs="*", default=list(SCENES), metavar="SCENE")
    parser.add_argument("--engine", action="append", metavar="NAME")
    parser.add_argument("--records", metavar="FILE")
    arguments = parser.parse_args()
    cases = [c for name in arguments.scene for c in candidates(SCENES[name](), arguments.engine or ENGINES)]
    with shown("running", len(cases)) as progress:
        found = floors(study(cases, records_path=arguments.records, progress=progress))
    table = Table(*HEADER, title="floors")
    for floor in found:
        table.add_row(*floor.row())
    Console(width=None if sys.stdout.isatty() else 220).print(table)
    return 0 if all(floor.is_reached for floor in found) else 1


if __name__ == "__main__":
    sys.exit(main())
