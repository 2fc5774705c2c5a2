"""The page on the features that each engine can simulate, from the adapters."""

from __future__ import annotations

from crosscheck.cli.support import KNOWN, of_features

from ..blocks import Fold, Parts, Table, listing

CAPTION = "A number names one of the reasons below the table."


def parts() -> Parts:
    """Return the table of features and engines, and the reasons."""
    found = of_features(KNOWN)
    notes = found.notes()
    rows = [(name, *found.row(name, notes)) for name in found.answers]
    return {
        "table": [Table(CAPTION, ("feature", *found.engines), rows)],
        "reasons": [Fold("Reasons", "reasons", listing(notes, numbered=True))],
    }
