"""Initial accelerations of random loop mechanisms in every engine beside mbref's: median and worst error.

``python benchmarks/random_mechanisms.py [COUNT]``, by default 200 mechanisms of seeds 0, 1, 2, …
"""

from collections import Counter
from collections.abc import Sequence

import numpy as np
from rich.console import Console
from rich.table import Table

from crosscheck.conformance.initial_accelerations import PRINCIPLE, Comparison, compare
from crosscheck.conformance.mechanisms.random_mechanisms import random_mechanism
from mbref.command_line import Parser

ENGINES = ("mujoco", "pinocchio", "exudyn")
EXPECTED = 1e-6  # larger differences must be explained by a small distance to singularity


def main(count: int) -> None:
    """Compare and print."""
    found = [compare(random_mechanism(seed), ENGINES) for seed in range(count)]
    console = Console()
    console.print(describe(found))
    table = Table("engine", "median", "worst", "in", "distance to singularity", f"above {EXPECTED:g}")
    for name in (*ENGINES, PRINCIPLE):
        errors = np.array([c.errors[name] for c in found])
        worst = found[int(errors.argmax())]
        row = (f"{np.median(errors):.1e}", f"{errors.max():.1e}", worst.scene.name, f"{worst.distance:.1e}")
        table.add_row(name, *row, str(int((errors > EXPECTED).sum())))
    console.print(table)
    for c in found:
        if max(c.errors.values()) > EXPECTED:
            errors = ", ".join(f"{name} {error:.1e}" for name, error in c.errors.items())
            console.print(
                f"{c.scene.name}: {c.distance:.1e} from singular, {c.redundant} redundant: {errors}"
            )


def describe(found: Sequence[Comparison]) -> str:
    """The mechanisms: bodies, loops, redundancy, joints."""
    kinds = Counter(joint.type for c in found for joint in c.scene.joint)
    bodies = [len(c.scene.body) for c in found]
    loops = Counter(len(c.scene.joint) - len(c.scene.body) for c in found)
    redundant = sum(c.redundant > 0 for c in found)
    joints = ", ".join(f"{n} {kind}" for kind, n in kinds.most_common())
    return (
        f"{len(found)} mechanisms of {min(bodies)} to {max(bodies)} bodies, {redundant} redundant; "
        f"by loops {dict(sorted(loops.items()))}; joints {joints}"
    )


if __name__ == "__main__":
    parser = Parser(description=__doc__)
    parser.add_argument("count", nargs="?", type=int, default=200, help="random mechanisms; default: 200")
    main(parser.parse_args().count)
