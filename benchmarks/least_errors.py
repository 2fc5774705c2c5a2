"""Least error of every engine on every built-in scene, with its setting and cost.

``python benchmarks/least_errors.py [--records FILE] [--engine NAME …] [SCENE …]``: runs the finest settings
of every family, resumes from FILE and prints the table that the report opens with; its exit status is 1 if an
engine has no completed run within FLOOR of the truth.
"""

import argparse
import sys

from rich.console import Console
from rich.table import Table

from crosscheck.study.grid import study
from crosscheck.study.progress import shown
from crosscheck.study.search.least_errors import HEADER, LeastError, least_errors
from crosscheck.study.search.selection import candidates
from mbref.scene import Scene
from mbref.scenes import SCENES

ENGINES = ("mujoco", "pinocchio", "exudyn")


def main() -> int:
    """Run and print; returns 1 where FLOOR is not reached."""
    _, found, _ = asked_for(__doc__)
    table = Table(*HEADER, title="least errors")
    for least in found:
        table.add_row(*least.row())
    Console(width=None if sys.stdout.isatty() else 220).print(table)
    return 0 if all(least.is_reached for least in found) else 1


def asked_for(about: str) -> tuple[dict[str, Scene], list[LeastError], str | None]:
    """Return the scenes of the command line by name, the least errors of the engines on these scenes, and the
    file of the records."""
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("scene", nargs="*", default=list(SCENES), metavar="SCENE")
    parser.add_argument("--engine", action="append", metavar="NAME")
    parser.add_argument("--records", metavar="FILE")
    arguments = parser.parse_args()
    scenes = {name: SCENES[name]() for name in arguments.scene}
    cases = [c for scene in scenes.values() for c in candidates(scene, arguments.engine or ENGINES)]
    with shown("finding the least errors", len(cases)) as progress:
        found = least_errors(study(cases, records_path=arguments.records, progress=progress))
    return scenes, found, arguments.records


if __name__ == "__main__":
    sys.exit(main())
