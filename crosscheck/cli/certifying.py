"""`crosscheck certify`: write the motion of a scene as a CSV table, with 20 and more certified digits."""

from __future__ import annotations

import argparse
import importlib.util
import json

from crosscheck.cli import request, scene_request
from crosscheck.cli.request import RequestError
from crosscheck.study.progress import followed
from mbref.files import write


def certify(arguments: argparse.Namespace) -> int:
    """Write or print the table of `crosscheck certify`; returns the exit status 0.

    Raises RequestError for a bad request, and if the digits of the two formulations differ.
    """
    from crosscheck.judge.reference.certify import NotCertified, certified

    _refuse_without_flint()
    scene = scene_request.find_certifiable(arguments.scene)
    times = request.sample_times(request.lasting(scene, None, arguments.duration), None, arguments.samples)
    try:
        table = certified(scene, times, arguments.digits, shown=lambda name: followed(name, times[-1]))
    except NotCertified as error:
        raise RequestError(str(error)) from None
    text = json.dumps(table, indent=1, ensure_ascii=False)
    if arguments.out:
        write(arguments.out, text + "\n")
    else:
        print(text)
    return 0


def _refuse_without_flint() -> None:
    """Raise RequestError if python-flint, the package for arithmetic of many digits, is not installed."""
    if importlib.util.find_spec("flint") is None:
        raise RequestError("certify: the package python-flint is not installed: pip install python-flint")
