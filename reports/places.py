"""Ids of runs, and of families on scenes, as targets of links in the page."""

from __future__ import annotations

import re
import zlib

from .runs import Curve, Run


def of_run(run: Run) -> str:
    """Return the id of a run: the first digits of its record's key."""
    return f"k-{_plain(run.record['key'][:12])}"


def of_family(scene: str, curve: Curve) -> str:
    """Return the id of a family's runs on a scene."""
    return f"r-{_plain(' '.join((scene, *curve)))}"


def of_cell(scene: str, curve: Curve) -> str:
    """Return the id of a family's entry in the matrix."""
    return f"c-{_plain(' '.join((scene, *curve)))}"


def _plain(text: str) -> str:
    """Return letters, digits and dashes of a text; if other characters are lost, a number computed from the
    text is added."""
    plain = re.sub(r"[^\w]+", "-", text).strip("-")
    return plain if re.fullmatch(r"[\w ]+", text) else f"{plain}-{zlib.crc32(text.encode()):08x}"
