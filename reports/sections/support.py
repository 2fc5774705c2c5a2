"""Section: the features that each engine of the study supports, as its adapter declares."""

from __future__ import annotations

from collections.abc import Sequence

from crosscheck.cli import support
from crosscheck.engine import engine_names

from ..blocks import Block, Heading, Table, Text
from ..runs import SceneRuns

CAPTION = "✓: supported; –: not supported, for the numbered reason below."


def render(groups: Sequence[SceneRuns]) -> list[Block]:
    """Return the support matrix of the engines that have records; engines that are not installed here are
    left out."""
    ran = dict.fromkeys(run.curve[0] for group in groups for run in group.runs)
    engines = [name for name in ran if name in engine_names()]
    if not engines:
        return []
    found = support.of_features(engines)
    notes = found.notes()
    rows = [(name, *found.row(name, notes)) for name in found.answers]
    sentences = [Text(f"{i}. {note}.") for i, note in enumerate(notes, 1)]
    return [Heading("Support", 2), Table(CAPTION, ("Feature", *engines), rows), *sentences]
