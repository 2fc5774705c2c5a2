"""The page on findings in other engines, and the scripts that prove them without crosscheck."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping

from crosscheck.findings.finding import FOLDER, Finding, When, findings

from ..blocks import Block, Fold, Heading, Listing, Parts, Prose, Table, Within

DIFFERENT = 0.1  # relative difference of a number from the stated one that counts as a change
WIDTH = 118  # of a comment


def parts() -> Parts:
    """Return the parts of the page of the stored findings."""
    rows = [(Within(f.name, f"#{f.name}"), f.engine, f.version, _measured(f)) for f in findings()]
    table = Table("Findings by engine.", ("finding", "engine", "version", "measured"), rows)
    return {"table": [table], "findings": [block for found in findings() for block in _entry(found)]}


def scripts(template: str) -> Mapping[str, str]:
    """Return the shell scripts, by name, that prove the stored findings with the engine's package alone."""
    return {found.name: template.format(**_fields(found)) for found in findings() if found.script}


def _fields(found: Finding) -> Mapping[str, str | Finding]:
    said = f"Does: {found.does}", f"Right: {found.right}", f"Cause: {found.cause}"
    words = "\n".join(
        textwrap.fill(each, WIDTH, initial_indent="# ", subsequent_indent="#   ") for each in said
    )
    if math.isnan(found.measured):
        stated, holds = f"more than {found.wrong_above:g}", f"seen > {found.wrong_above!r}"
    else:
        most = DIFFERENT * abs(found.measured)
        stated, holds = f"{found.measured:g}", f"abs(seen - {found.measured!r}) <= {most:g}"
    packages = " ".join([f"{found.package}=={found.version}", "numpy", *found.needs])
    return {"found": found, "packages": packages, "words": words, "stated": stated, "holds": holds}


def _measured(found: Finding) -> str:
    if found.crashes:
        return "the process ends"
    number = f"more than {found.wrong_above:.3g}" if math.isnan(found.measured) else f"{found.measured:.3g}"
    return f"{number} {found.unit}".strip()


def _tried(found: Finding, when: When) -> str:
    """Return the sentence on mechanisms on which `crosscheck diagnose` tries a finding."""
    parts = [f"version {' or '.join(when.versions)}"] if when.versions else []
    parts += [f"mechanisms of at least {when.loops} loop{'s' * (when.loops > 1)}"] if when.loops else []
    parts += ["redundant rows"] if when.redundant else []
    parts += [f"a joint of the type {', '.join(when.joints)}"] if when.joints else []
    parts += ["a coupling by a polynomial"] if when.polynomial else []
    parts += [f"bodies at least {when.away:g} m from the origin"] if when.away else []
    parts += [f"{name} {value}" for name, value in when.settings.items()]
    parts += ["the finest step"] if when.finest else []
    parts += [f"motions that keep the {when.keeps}"] if when.keeps else []
    command = f"`crosscheck diagnose SCENE --engine {found.engine}`"
    return f"{command} tries it on your mechanism ({', '.join(parts)}). Remedy: {when.advice}."


def _entry(found: Finding) -> list[Block]:
    said = [f"{found.package} {found.version}. {found.does}", f"Right is: {found.right}", found.cause]
    said += [_tried(found, found.when)] if found.when else []
    told: list[Block] = [Heading(found.name, 2), Prose("\n\n".join(said))]
    if found.crashes:
        return told
    if found.script:
        proof: list[Block] = [Listing(found.script.strip(), "python")]
    else:
        options = ", ".join(f"{name} {value:g}" for name, value in found.options.items())
        words = f"Scene `{found.scene}` at the setting `{found.family}` ({options}):"
        proof = [Prose(words), Listing((FOLDER / found.scene).read_text().strip(), "toml")]
    return [*told, Fold("Proof", f"{found.name}-proof", [*proof, Prose(f"`{found.command()}`")])]
