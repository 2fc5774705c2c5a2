"""`crosscheck judge`: errors of a recorded motion. `crosscheck reference`: the reference motion as a
table."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.table import Table

from crosscheck.cli import request, scene_request
from crosscheck.cli.request import RequestError
from crosscheck.cli.running import COMPLETED, OTHERWISE, console
from crosscheck.judge.start import started
from crosscheck.recorded.column_errors import ColumnError
from crosscheck.recorded.columns import SI, kind_of
from crosscheck.recorded.exact import exact, reference_table, uncounted, write
from crosscheck.recorded.judgement import Judgement, judge_motion
from crosscheck.recorded.reading import read
from crosscheck.recorded.search import SECONDS as SEARCHED
from mbref.command_line import each_once

SHOWN = 6  # number of headers that are printed of the columns that were not read


def judge(arguments: argparse.Namespace) -> int:
    """Print the errors of a recorded table; returns 0 if all columns are right.

    Raises RequestError and SceneError.
    """
    (scene,) = scene_request.read_scenes([arguments.scene])
    columns = each_once("--column", map(_assigned, arguments.column))
    try:
        recording = read(Path(arguments.table), scene, columns, arguments.unit, arguments.quaternion)
    except OSError as error:
        raise RequestError(f"{arguments.table}: {error.strerror}") from None
    found = judge_motion(scene, recording, arguments.reference_time, arguments.tolerance, _said)
    if arguments.json:
        print(json.dumps(found.to_record(), allow_nan=False))
    else:
        _show(found)
    return COMPLETED if found.is_right else OTHERWISE


def _said(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _assigned(text: str) -> tuple[str, str]:
    name, _, place = text.partition("=")
    if not place:
        raise RequestError(f"--column {text}: must be NAME=PLACE, such as rod.position.x=3")
    return name, place


def _show(found: Judgement) -> None:
    table = Table("column", "largest error", "bound", "", "begins at", title="against the reference")
    for c in found.columns:
        begins = "" if c.begins is None else f"{c.begins:.4g} s"
        unit = SI[kind_of(c.name)]
        until = "" if found.is_whole or not c.is_right else f", to {found.until:.6g} s"
        table.add_row(c.name, f"{c.largest:.2e} {unit}", f"{c.bound:.2e} {unit}", _verdict(c) + until, begins)
    console().print(table)
    if undetermined := [n for n in found.left if n not in found.uncounted]:
        console().print(f"not determined by the mechanism: {', '.join(undetermined)}", soft_wrap=True)
    _say_uncounted(found.uncounted)
    if found.reason:
        end = f"The reference ends at t = {found.until:.6g} s; later rows are not judged: {found.reason}"
        console().print(end, soft_wrap=True)
    if any(c.largest > c.allowed for c in found.columns) and not found.explanations:
        console().print(f"{_nothing(found)}.")
    for e in found.explanations:
        console().print(f"{e.sentence}: {100 * e.remains:.2g} % of the difference remains", soft_wrap=True)
    if found.ignored:
        rest = f" and {len(found.ignored) - SHOWN} more" if len(found.ignored) > SHOWN else ""
        console().print(f"not read: {', '.join(found.ignored[:SHOWN])}{rest}", soft_wrap=True)


def _say_uncounted(names: Sequence[str]) -> None:
    if names:
        text = f"unknown: {', '.join(names)}; full turns between samples cannot be counted, use more samples"
        console().print(text, soft_wrap=True)


def _nothing(found: Judgement) -> str:
    if not found.is_searched:
        return "No explanation is searched for where constraints come and go or stops are met"
    if found.alike:
        return f"{found.alike} changes explain the difference equally well, so that none is named"
    if found.is_complete:
        return "No single change explains the difference"
    return (
        f"No single change was found that explains the difference; the search ended after {SEARCHED:g} CPU s"
    )


def _verdict(column: ColumnError) -> str:
    digits = f"rounded to {column.rounded_to} digit{'s' * (column.rounded_to != 1)}"
    if column.is_right:
        within = f", within {column.allowed:.1e} {SI[kind_of(column.name)]}" if column.is_small else ""
        return f"right{within}" if column.rounded_to is None else f"right, {digits}"
    return f"too coarse, {digits}" if column.largest <= column.allowed else "off"


def write_reference(arguments: argparse.Namespace) -> int:
    """Write the reference motion as a table; returns 0 if it reaches the end time.

    Raises RequestError.
    """
    (scene,) = scene_request.read_scenes([arguments.scene])
    scene = request.lasting(scene, arguments.times, arguments.duration)
    times = request.sample_times(scene, arguments.times, arguments.samples)
    table = reference_table(scene, times, arguments.reference_time)
    if not len(table["time"]):
        reason = exact(started(scene), times, arguments.reference_time).reason
        raise RequestError(f"{scene.name}: no reference was found: {reason}")
    write(table, Path(arguments.out))
    reached = float(table["time"][-1])
    console().print(
        f"{arguments.out}: {len(table['time'])} samples to t = {reached:g} s, error at most "
        f"{table['bound'].max():.1e} of the mechanism's length or rad",
        soft_wrap=True,
    )
    missing = uncounted(table)
    _say_uncounted(missing)
    return COMPLETED if reached == times[-1] and not missing else OTHERWISE
