"""The page on the features that each engine can simulate, from the adapters."""

from __future__ import annotations

from crosscheck.cli.support import KNOWN, of_features

from ..blocks import Block, Fold, Prose, Table

TITLE = "Features of engines"
HEAD = """
`crosscheck list support` prints this table from the adapters. A tick means that the adapter and the engine
can simulate the feature at some setting. A tick does not mean that the defaults are right: on a redundant
loop the defaults of Pinocchio and Exudyn fail. CasADi and heyoka are not in the table;
[Generated code](../engines.md#generated-code) lists what they support. Names such as `J` and `load[0]` belong
to the small scenes for which the engines were asked. Reason 1 means that the drivers of the small scene do
not prescribe its whole motion: in a mechanism whose drivers do, `ondsel` maps these joints and loads. Reason
14 concerns a `joint_torque`: `newton` does map polynomials and sines over time as factors of a `force` or
`moment`.
"""
CAPTION = "A number names one of the reasons below the table."


def blocks() -> list[Block]:
    """Return the table of features and engines, and the reasons."""
    found = of_features(KNOWN)
    notes = found.notes()
    rows = [(name, *found.row(name, notes)) for name in found.answers]
    listed = "\n".join(f"{i}. {note}" for i, note in enumerate(notes, 1))
    table = Table(CAPTION, ("feature", *found.engines), rows)
    return [Prose(HEAD), table, Fold("Reasons", "reasons", [Prose(listed)])]
