"""mbref list and mbref completion: what there is to name, and a shell that completes it."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping
from typing import Any

from rich.table import Table

from mbref.cli.options import TEXT
from mbref.cli.output import console
from mbref.formulations import FORMULATIONS
from mbref.integrators import INTEGRATORS
from mbref.scenes import SCENES
from mbref.stabilisation import STABILISATIONS

SHELLS = ("bash", "zsh", "tcsh")


def add(commands: Any) -> None:
    """The commands' grammar."""
    listing = commands.add_parser(
        "list", help="the built-in scenes and the methods", formatter_class=TEXT,
        description="The built-in scenes, or the parts of a method with their options.",
        epilog="examples:\n  mbref list\n  mbref list methods",
    )  # fmt: skip
    listing.add_argument("what", nargs="?", choices=list(TABLES), help="default: both")
    listing.set_defaults(action=_list)

    completion = commands.add_parser(
        "completion", help="completion of commands and options by the shell", formatter_class=TEXT,
        description="A script by which the shell completes commands and options of mbref.",
        epilog="example:\n  mbref completion bash > ~/.local/share/bash-completion/completions/mbref",
    )  # fmt: skip
    completion.add_argument("shell", choices=SHELLS)
    completion.set_defaults(action=_complete)


def _list(options: argparse.Namespace) -> int:
    for name in [options.what] if options.what else TABLES:
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
    table = Table(
        "part", "name", "options and their defaults", title="a method: formulation+stabilisation/integrator"
    )
    parts: Mapping[str, Mapping[str, Any]] = {
        "formulation": FORMULATIONS, "stabilisation": STABILISATIONS, "integrator": INTEGRATORS,
    }  # fmt: skip
    for part, entries in parts.items():
        for name, entry in entries.items():
            table.add_row(part, name, ", ".join(f"{k}={v:g}" for k, v in entry.options.items()))
        table.add_section()
    return table


TABLES: dict[str, Callable[[], Table]] = {"scenes": _scenes, "methods": _methods}


def _complete(options: argparse.Namespace) -> int:
    import shtab

    from mbref.cli.commands import parser

    sys.stdout.write(shtab.complete(parser(), options.shell))
    return 0
