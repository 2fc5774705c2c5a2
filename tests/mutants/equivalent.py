"""Mutants that change nothing that a program could observe, each with the reason."""

from __future__ import annotations

from tests.mutants.operators import Mutant

REASONS: dict[tuple[str, str, str], str] = {}
"""By file, the line of the source and the new text of the mutant."""


def reason(mutant: Mutant, source: str) -> str:
    """Return why a mutant of a source changes nothing; empty where it does."""
    line = source.splitlines()[mutant.line - 1].strip()
    return REASONS.get((mutant.file, line, mutant.new), "")
