"""mbref list and mbref completion: available names, and completion of commands by the shell."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping
from typing import Any

from rich.table import Table

from mbref.cli.output import console
from mbref.formulations import FORMULATIONS
from mbref.integrators import INTEGRATORS, TAYLOR
from mbref.motions.outputs import OUTPUTS
from mbref.scenes import SCENES
from mbref.stabilisation import STABILISATIONS

METHOD = "a method: formulation+stabilisation/integrator, such as lm2+baumgarte[alpha=10,beta=10]/rk4"
SHELLS = ("bash", "zsh", "tcsh")
MEANINGS = {  # meanings of stabilisations and integrators
    "none": "constraint violations grow",
    "baumgarte": "violations decay by feedback; an error in the motion remains",
    "partitioning": "integrates independent coordinates and solves for the others",
    "projection": "projects onto the constraints after each step; ends at singular positions",
    "dop853": "Runge-Kutta of order 8 with adaptive steps",
    "rk4": "classical Runge-Kutta with a fixed step (s)",
    "adams": "predictor-corrector of orders 1 to 12 with adaptive steps",
    "taylor": "power series of order 4 to 30; crosses singular positions; the default",
}


def add(commands: Any) -> None:
    """Add the parsers of both commands."""
    listing = commands.add_parser(
        "list",
        action=_list,
        help="the built-in scenes, the methods, the outputs of a motion",
        description="The built-in scenes, the parts of a method with their options, or the numbers\n"
        "that a motion has over time.",
        epilog="examples:\n  mbref list\n  mbref list methods\n  mbref list outputs",
    )
    listing.add_argument("what", nargs="?", choices=list(TABLES), help="default: scenes and methods")

    completion = commands.add_parser(
        "completion",
        action=_complete,
        help="completion of commands and options by the shell",
        description="A script by which the shell completes commands and options of mbref.",
        epilog="example:\n  mbref completion bash > ~/.local/share/bash-completion/completions/mbref",
    )
    completion.add_argument("shell", choices=SHELLS)


def _list(options: argparse.Namespace) -> int:
    for name in [options.what] if options.what else BOTH:
        console().print(TABLES[name]())
    return 0


def _scenes() -> Table:
    table = Table(title="scenes")
    table.add_column("scene", no_wrap=True)
    for heading in ("bodies", "joints", "moved by", "end, s"):
        table.add_column(heading)
    for name, make in SCENES.items():
        scene = make()
        gravity = ["gravity"] if any(scene.gravity) else []
        causes = gravity + [f"driver of {d.joint}" for d in scene.driver] + [load.type for load in scene.load]
        numbers = str(len(scene.body)), str(len(scene.joint))
        table.add_row(name, *numbers, ", ".join(causes) or "initial velocities", f"{scene.duration:g}")
    return table


def _methods() -> Table:
    table = Table("part", "name", "meaning; options and their defaults", title=METHOD)
    parts: Mapping[str, Mapping[str, Any]] = {
        "formulation": FORMULATIONS,
        "stabilisation": STABILISATIONS,
        "integrator": INTEGRATORS,
        "in place of all three": {TAYLOR.name: TAYLOR},
    }
    meanings = MEANINGS | {name: entry.about.meaning for name, entry in FORMULATIONS.items()}
    for part, entries in parts.items():
        for name, entry in entries.items():
            options = ", ".join(f"{k}={v:g}" for k, v in entry.options.items())
            table.add_row(part, name, f"{meanings[name]}\n[{options}]" if options else meanings[name])
        table.add_section()
    return table


def _outputs() -> Table:
    table = Table("column", "unit", "meaning", title="numbers of a motion over time")
    for k, output in enumerate(OUTPUTS):
        ends = OUTPUTS[min(k + 1, len(OUTPUTS) - 1)].owner != output.owner
        table.add_row(output.column, output.unit, output.meaning, end_section=ends)
    return table


BOTH = ("scenes", "methods")
TABLES: dict[str, Callable[[], Table]] = {"scenes": _scenes, "methods": _methods, "outputs": _outputs}


def _complete(options: argparse.Namespace) -> int:
    import shtab

    sys.stdout.write(shtab.complete(options.grammar(), options.shell))
    return 0
