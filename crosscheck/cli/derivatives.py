"""The command `crosscheck derivatives`: derivatives of accelerations by engines, against the judge's."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from rich.box import SIMPLE
from rich.table import Table

from crosscheck.cli import request
from crosscheck.cli.running import COMPLETED, OTHERWISE, console, notice, print_json
from crosscheck.cli.scene_request import find_scenes
from crosscheck.derivatives import compare, sentences
from crosscheck.derivatives.mechanisms import mechanisms
from crosscheck.differentiating import Differentiating
from crosscheck.engine import all_engines, engine, engine_names
from crosscheck.judge.state_derivatives import NotSmooth
from crosscheck.processes import pool
from crosscheck.processes.child import ChildFailed
from mbref.scene import Scene

Refusals = list[dict[str, str]]
SECONDS = 300.0  # of CPU time of an engine on a scene


def derivatives(arguments: argparse.Namespace) -> int:
    """Compare engines on scenes; return 1 if a derivative is wrong or nothing was compared."""
    known = engine_names()
    names = [what for what in arguments.what if what in known or ":" in what]
    paths = [what for what in arguments.what if what not in names]
    scenes = find_scenes(paths, notice=notice) if paths else mechanisms()
    asked = [*names, *(arguments.engine or ())]
    engines = request.find_engines(asked, notice) if asked else _differentiating()
    found: list[compare.Row] = []
    refused: Refusals = []
    for name in engines:
        for scene in scenes:
            _compare(name, scene, found, refused)
    if arguments.json:
        print_json([{"rows": [_record(row) for row in found], "refused": refused}])
    else:
        _show(found, refused)
    wrong = any(row.grade == compare.WRONG for row in found)
    return OTHERWISE if wrong or not found else COMPLETED


def _differentiating() -> list[str]:
    return [name for name in all_engines() if isinstance(engine(name), Differentiating)]


def _compare(name: str, scene: Scene, found: list[compare.Row], refused: Refusals) -> None:
    """Add the rows of an engine on a scene, or the reason why there are none."""
    notice(f"{name}: {scene.name}")
    try:
        rows, reason = pool.apart(_of_engine, (name, scene), SECONDS)
    except ChildFailed as failure:
        rows, reason = [], str(failure)
    found += rows
    if reason:
        refused.append({"engine": name, "scene": scene.name, "reason": reason})


def _of_engine(name: str, scene: Scene) -> tuple[list[compare.Row], str]:
    """Return an engine's rows, or the reason why there are none; called in a child."""
    asked = engine(name)
    if (refusal := compare.refusal(asked, scene)) is not None:
        return [], str(refusal)
    try:
        return [*compare.rows(asked, scene)], ""
    except NotSmooth as why:
        return [], str(why)


def _record(row: compare.Row) -> dict[str, object]:
    return {**vars(row), "grade": row.grade}


def _show(found: Sequence[compare.Row], refused: Refusals) -> None:
    out = console()
    if found:
        headings = ("engine", "function", "scene", "state", "against", *compare.BLOCKS)
        table = Table(*headings, title="relative errors of derivatives of accelerations", box=SIMPLE)
        cells: dict[tuple[str, ...], dict[str, str]] = {}
        for row in found:
            key = (row.engine, row.function, row.scene, row.state, row.truth)
            cells.setdefault(key, {})[row.by] = f"{row.error:.0e} {row.grade}"
        for names, by in cells.items():
            table.add_row(*names, *(by.get(block, "–") for block in compare.BLOCKS))
        out.print(table)
    for sentence in sentences.of_rows(found):
        out.print(sentence, soft_wrap=True)
    for each in refused:
        out.print(f"{each['engine']}, {each['scene']}: refused: {each['reason']}", soft_wrap=True)
