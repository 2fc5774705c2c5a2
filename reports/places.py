"""Ids of places in the page, for runs and for families on scenes."""

from __future__ import annotations

import re
import zlib

from reports.runs import Curve, Run


def of_run(run: Run) -> str:
    """The place of a run: the first digits of its record's key."""
    return f"k-{_plain(run.record['key'][:12])}"


def of_family(scene: str, curve: Curve) -> str:
    """The place of a family's runs on a scene."""
    return f"r-{_plain(' '.join((scene, *curve)))}"


def of_cell(scene: str, curve: Curve) -> str:
    """The place of a family in the matrix."""
    return f"c-{_plain(' '.join((scene, *curve)))}"


def _plain(text: str) -> str:
    """Letters, digits and dashes; where that loses something, a number of the text's own is added."""
    plain = re.sub(r"[^\w]+", "-", text).strip("-")
    return plain if re.fullmatch(r"[\w ]+", text) else f"{plain}-{zlib.crc32(text.encode()):08x}"
