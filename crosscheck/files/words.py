"""Sentences on readings, for an engineer who uses the file."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from crosscheck.engines.loaders.machine import Machine
from crosscheck.files.differences import ADDED, LOST, Difference
from crosscheck.files.reading import ALMOST, ANOTHER, REFUSED, File, Reading
from mbref.formats import numbered

SHOWN = 4  # fields in the sentence of a reader; the table has all
NAMED = 3  # parts with the same difference that a sentence names
LETTERS = 2  # of a name that may be a word of a message by chance; it must stand in quotation marks
PLURALS = {"body": "bodies", "joint": "joints", "loop": "loops", "coupling": "couplings"}
WORDS = {  # words of a message that announce a lost part, by field
    "armature": ("armature", "rotor"),
    "body": ("body", "link", "joint"),
    "joint": ("joint",),
    "coupling": ("equality", "mimic", "coupling"),
    "damping": ("damping",),
    "friction": ("friction",),
    "limits": ("limit", "range"),
    "loop": ("equality", "connect", "weld", "closure", "constraint"),
    "stiffness": ("stiffness", "spring"),
}


def is_announced(difference: Difference, messages: Sequence[str]) -> bool:
    """Return whether a message names the part of a difference, or its kind."""
    name, words = difference.name, "|".join(WORDS.get(difference.field, ()))
    named = re.compile(rf"\b{re.escape(name)}\b" if len(name) > LETTERS else f"['\"]{re.escape(name)}['\"]")
    return any(named.search(m) or (words and re.search(words, m, re.I)) for m in messages)


def shown(value: Any) -> str:
    """Return a value of a table: a number, a vector, a matrix or a text."""
    if value is None:
        return "–"
    if isinstance(value, str):
        return value
    if isinstance(value, int | float):
        return "no limit" if math.isinf(value) else f"{0.0 if abs(value) < 1e-15 else value:.6g}"
    if not value:
        return "none"
    if isinstance(value[0], list | tuple):  # a symmetric matrix
        names = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
        if len(value) == 3:
            return " ".join(f"{'xyz'[i]}{'xyz'[j]} {shown(value[i][j])}" for i, j in names)
        return "; ".join(map(shown, value))
    return f"({', '.join(map(shown, value))})" if len(value) > 1 else shown(value[0])


def part(difference: Difference) -> str:
    """Return the name of a part with its kind, such as ``joint crank: axis``."""
    if difference.part == "gravity":
        return "gravity"
    if difference.part in ("statics", "motion"):
        return f"{difference.field} of {difference.name}"
    field = "" if difference.field == difference.part else f": {difference.field}"
    return f"{difference.part} {difference.name}{field}"


def sentence(alike: Sequence[Difference], messages: Sequence[str]) -> str:
    """Return how a reader differs in one field of one or more parts, with both values of the first part."""
    first = alike[0]
    file, own = shown(first.file), shown(first.reader)
    names = ", ".join(difference.name for difference in alike[:NAMED])
    names += f" and {len(alike) - NAMED} more" if len(alike) > NAMED else ""
    several = first.part in PLURALS and len(alike) > 1
    parts = f"{PLURALS.get(first.part, first.part) if several else first.part} {names}"
    if first.part == "gravity":
        parts = first.field
    elif first.field != first.part:
        parts = f"{first.field} of {names if first.part in ('statics', 'motion') else parts}"
    if first.kind == ADDED:
        return f"{parts} {'are' if several else 'is'} not in the file"
    if first.kind != LOST:
        of = f" ({first.name})" if several else ""
        return f"{parts} {'are' if first.field == 'limits' else 'is'} {own}, in the file {file}{of}"
    silently = "with a message" if all(is_announced(d, messages) for d in alike) else "without a message"
    if first.field == "loop":
        return f"{parts} {'are' if several else 'is'} open, dropped {silently}"
    if first.field == "coupling":
        return f"{names} {'follow' if several else 'follows'} nothing ({file}), dropped {silently}"
    if first.field != "limits" and np.any(first.reader):
        return f"{parts} is {own}, and the rest of {file} is dropped {silently}"
    value = "" if several or first.field in ("body", "joint") else f" ({file.strip('()')})"
    return f"{parts}{value} dropped {silently}"


def sentences(differences: Sequence[Difference], messages: Sequence[str]) -> list[str]:
    """Return a sentence for each field in which parts differ."""
    groups: dict[tuple[str, str, str], list[Difference]] = {}
    for difference in differences:
        groups.setdefault((difference.kind, difference.part, difference.field), []).append(difference)
    return [sentence(alike, messages) for alike in groups.values()]


def verdict(reading: Reading) -> str:
    """Return the grade with its causes in one sentence."""
    if reading.grade == REFUSED:
        return f"cannot read: {reading.refusal}"
    facts = sentences(reading.differences, reading.messages)
    more = f"; and {len(facts) - SHOWN} more" if len(facts) > SHOWN else ""
    joined = "; ".join(facts[:SHOWN]) + more
    if reading.grade == ALMOST:
        return f"the same except for: {joined}"
    return f"another machine: {joined}" if reading.grade == ANOTHER else reading.grade


def heading(file: File, source: str) -> str:
    """Return a sentence on the file's machine."""
    machine = file.machine
    counts = [
        numbered(len(machine.bodies), "body", "bodies"),
        numbered(_moving(machine), "joint that moves", "joints that move"),
        numbered(len(machine.loops or ()), "loop", "loops"),
        numbered(len(machine.couplings or ()), "coupling", "couplings"),
    ]
    return f"{file.path}: {file.form}, {', '.join(counts)}, by {source}"


def _moving(machine: Machine) -> int:
    return sum(joint.type != "fixed" for joint in machine.joints)
