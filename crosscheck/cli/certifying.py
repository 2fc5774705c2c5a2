"""`crosscheck certify`: the motion of a scene to many digits, as a table to be kept."""

from __future__ import annotations

import argparse
import importlib.util
import json
from pathlib import Path

from crosscheck.cli import request, scene_request
from crosscheck.cli.request import RequestError
from crosscheck.study.progress import followed


def certify(arguments: argparse.Namespace) -> int:
    """Write the table, or print it; returns 0.

    Raises RequestError for a bad request, and where the digits of both formulations differ.
    """
    from crosscheck.judge.reference.certify import NotCertified, certified

    _refuse_without_flint()
    _refuse_missing_folder(arguments.out)
    scene = scene_request.find_certifiable(arguments.scene)
    times = request.sample_times(request.lasting(scene, None, arguments.duration), None, arguments.samples)
    try:
        table = certified(scene, times, arguments.digits, shown=lambda name: followed(name, times[-1]))
    except NotCertified as error:
        raise RequestError(str(error)) from None
    text = json.dumps(table, indent=1, ensure_ascii=False)
    if arguments.out:
        Path(arguments.out).write_text(text + "\n")
    else:
        print(text)
    return 0


def _refuse_without_flint() -> None:
    """Raise RequestError where the package for numbers of many digits is not installed."""
    if importlib.util.find_spec("flint") is None:
        raise RequestError("certify: the package python-flint is not installed: pip install python-flint")


def _refuse_missing_folder(file: str | None) -> None:
    """Raise RequestError where a file cannot be written for want of its folder."""
    if file and not Path(file).parent.is_dir():
        raise RequestError(f"--out: {Path(file).parent} must be in an existing folder")
