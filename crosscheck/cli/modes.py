"""`crosscheck modes`: equilibria, steady motions and eigenvalues by the judge, mbref and engines."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from crosscheck.cli import request
from crosscheck.cli.rendering import write_page
from crosscheck.cli.running import COMPLETED, OTHERWISE, console, notice, print_json
from crosscheck.cli.scene_request import find_scenes
from crosscheck.engine import all_engines
from crosscheck.small_motions import records, sentences
from crosscheck.small_motions.records import Record
from mbref.records import rewrite

# engines whose accelerations at a pose are asked for, if they are installed
ENGINES = ("mujoco", "pinocchio", "exudyn", "simbody", "dart", "drake")


def modes(arguments: argparse.Namespace) -> int:
    """Measure a scene, or show the stored records of mechanisms with closed forms."""
    engines = _engines(arguments.engine)
    if arguments.scene:
        (scene,) = find_scenes([arguments.scene], notice=notice)
        found = records.measured(scene, engines, starts=arguments.starts, progress=notice)
    else:
        if arguments.run:
            rewrite(records.FILE, records.merged(records.of_mechanisms(engines, notice), records.read()))
        found = records.read()
    with TemporaryDirectory() as place:
        path = Path(place) / "records.jsonl"
        rewrite(path, found)
        if status := write_page("small-motions", path, arguments.page):
            return status
    if arguments.json:
        print_json([{"poses": found}])
    else:
        _show(console(), found)
    return COMPLETED if found else OTHERWISE


def _engines(named: Sequence[str] | None) -> list[str]:
    if named:
        return request.find_engines(named, notice)
    here = all_engines()
    return [name for name in ENGINES if name in here]


def _show(out: Console, found: Sequence[Record]) -> None:
    if not found:
        out.print("The judge's search finds no equilibrium and no steady motion; --starts tries more.")
    for record in found:
        listed = ", ".join(sentences.written(*s) for s in record["eigenvalues"])
        out.print(f"{record['scene']}: {sentences.heading(record)}", soft_wrap=True)
        out.print(f"  s = {listed} 1/s", soft_wrap=True)
        out.print(f"  {sentences.search(record)}".replace("`", ""), soft_wrap=True)
        table = Table("method", "error of the eigenvalues", box=SIMPLE)
        for name, value in sentences.rows(record):
            table.add_row(name, value)
        out.print(table)
