"""The command `crosscheck derivatives`: derivatives of accelerations by engines, against the judge's."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from functools import partial

from rich.box import SIMPLE
from rich.table import Table

from crosscheck.cli import request
from crosscheck.cli.running import COMPLETED, OTHERWISE, console, notice, print_json
from crosscheck.cli.scene_request import find_scenes
from crosscheck.cli.stored_tables import measured, some
from crosscheck.derivatives import compare, records, sentences, table
from crosscheck.derivatives.cards import CARDS, Verdict
from crosscheck.derivatives.mechanisms import MECHANISMS
from crosscheck.differentiating import Differentiating
from crosscheck.engine import all_engines, engine, engine_names
from crosscheck.processes.child import ChildFailed
from mbref.records import finite
from mbref.scene import Scene

Refusals = list[dict[str, str]]


def derivatives(arguments: argparse.Namespace) -> int:
    """Compare engines on scenes, or show stored records; return 1 if a derivative that was compared is wrong
    or nothing was compared."""
    if arguments.cards:
        return _cards(arguments)
    if not arguments.what and (arguments.run or not arguments.engine):
        return _stored(arguments)
    if arguments.run or arguments.page:
        raise request.RequestError("--run and --page: serve the stored mechanisms, without ENGINE and SCENE")
    known = engine_names()
    names = [what for what in arguments.what if what in known or ":" in what]
    scenes = _scenes([what for what in arguments.what if what not in names])
    asked = [*names, *(arguments.engine or ())]
    engines = request.find_engines(asked, notice) if asked else _differentiating()
    found: list[compare.Row] = []
    refused: Refusals = []
    for name in engines:
        for scene in scenes:
            notice(f"{name}: {scene.name}")
            rows, cannot = records.compared(name, scene)
            found += rows
            if cannot:
                refused.append({"engine": name, "scene": scene.name, "reason": str(cannot)})
    _print(arguments, found, refused)
    wrong = any(row.grade == compare.WRONG for row in found)
    return OTHERWISE if wrong or not found else COMPLETED


def _cards(arguments: argparse.Namespace) -> int:
    """Judge engines by all cards; return 1 if a card fails or none was asked."""
    if arguments.run or arguments.page:
        raise request.RequestError("--run and --page: serve the stored mechanisms, without --cards")
    asked = [*arguments.what, *(arguments.engine or ())]
    found: list[Verdict] = []
    for name in request.find_engines(asked, notice) if asked else _differentiating():
        notice(f"{name}: cards")
        try:
            found += records.carded(name)
        except ChildFailed as failure:
            found.append(Verdict(name, "", "", "", math.inf, 0.0, str(failure)))
    if arguments.json:
        print_json([{"cards": [_finite(each) for each in found]}])
    else:
        _show_cards(found)
    failed = any(verdict.fails for verdict in found)
    return OTHERWISE if failed or all(verdict.error is None for verdict in found) else COMPLETED


def _finite(verdict: Verdict) -> dict[str, object]:
    """Return the fields of a verdict; an infinite error, of derivatives that cannot be used, as None."""
    error = verdict.error
    unusable = error is not None and not math.isfinite(error)
    return {**verdict._asdict(), "error": None if unusable else error, "fails": verdict.fails}


def _show_cards(found: Sequence[Verdict]) -> None:
    out = console()
    shown = Table("engine", "function", "card", "mechanism", "error", "", title="cards", box=SIMPLE)
    for verdict in found:
        error = "–" if verdict.error is None else f"{verdict.error:.0e}"
        sign = "✗" if verdict.fails else "–" if verdict.error is None else "✓"
        shown.add_row(verdict.engine, verdict.function, verdict.card, verdict.scene, error, sign)
    out.print(shown)
    for card in dict.fromkeys(verdict.card for verdict in found if verdict.fails and verdict.card):
        out.print(f"{card}: {CARDS[card].about}", soft_wrap=True)
    for name, reason in dict.fromkeys((each.engine, each.reason) for each in found if each.reason):
        alike = [each for each in found if (each.engine, each.reason) == (name, reason)]
        where = dict.fromkeys(" on ".join(filter(None, (each.card, each.scene))) for each in alike)
        out.print(": ".join(filter(None, (name, ", ".join(where), reason))), soft_wrap=True)


def _scenes(paths: Sequence[str]) -> list[Scene]:
    """Return mechanisms by their names, and other scenes; without paths all mechanisms."""
    own = {mechanism.name: mechanism for mechanism in MECHANISMS}
    others = find_scenes([path for path in paths if path not in own], notice=notice)
    named = [mechanism.make() for name, mechanism in own.items() if name in paths or not paths]
    return [*named, *others]


def _stored(arguments: argparse.Namespace) -> int:
    """Measure engines and write the page if requested, and print the stored records."""
    if status := measured(arguments, "derivatives", partial(records.measure, report=notice)):
        return status
    stored = table.ordered(some(records.read, arguments.records))
    refused = [
        {"engine": r["engine"], "scene": r["scene"], "reason": f"{r['reason']} ({r['owner']})"}
        for r in stored
        if r["reason"]
    ]
    _print(arguments, [row for record in stored for row in records.rows_of(record)], refused)
    return COMPLETED


def _differentiating() -> list[str]:
    return [name for name in all_engines() if isinstance(engine(name), Differentiating)]


def _print(arguments: argparse.Namespace, found: Sequence[compare.Row], refused: Refusals) -> None:
    if arguments.json:
        print_json([{"rows": [_record(row) for row in found], "refused": refused}])
    else:
        _show(found, refused)


def _record(row: compare.Row) -> dict[str, object]:
    """Return the fields of a row; infinite numbers, of derivatives that are not finite, as None."""
    return {**finite(vars(row)), "grade": row.grade}


def _show(found: Sequence[compare.Row], refused: Refusals) -> None:
    out = console()
    if found:
        headings = ("engine", "function", "scene", "state", "against", *compare.BLOCKS)
        shown = Table(*headings, title="relative errors of derivatives of accelerations", box=SIMPLE)
        cells: dict[tuple[str, ...], dict[str, str]] = {}
        for row in found:
            key = (row.engine, row.function, row.scene, row.state, row.truth)
            cells.setdefault(key, {})[row.by] = f"{row.error:.0e} {row.grade}"
        for names, by in cells.items():
            shown.add_row(*names, *(by.get(block, "–") for block in compare.BLOCKS))
        out.print(shown)
    for sentence in sentences.of_rows(found):
        out.print(sentence.replace("`", ""), soft_wrap=True)
    for each in refused:
        out.print(f"{each['engine']}, {each['scene']}: refused: {each['reason']}", soft_wrap=True)
