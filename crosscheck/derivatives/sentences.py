"""Sentences on what the errors of an engine's derivatives depend on."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

from crosscheck.derivatives.compare import JUDGE, MOVING, OWN, WRONG, Row

CAUSES = {
    "stabilisation": "only off the constraints: terms of the closures' errors, as of a stabilisation",
    "velocity": "only in motion: terms of velocities in the closures, such as J̇ v",
    "step": "only about the exact motion: its own step or soft constraints are differentiated right",
    "everywhere": "also at rest with closed loops: terms of positions, such as ∂(Jᵀλ)/∂q",
}


def of_rows(rows: Sequence[Row]) -> Iterator[str]:
    """Yield a sentence for each function and scene on which derivatives are wrong, with `code` of names."""
    for (engine, function, scene), group in itertools.groupby(
        rows, lambda r: (r.engine, r.function, r.scene)
    ):
        wrong = [row for row in found if row.grade == WRONG] if (found := [*group]) else []
        if wrong:
            worst = max(wrong, key=lambda row: row.error)
            blocks = ", ".join(dict.fromkeys(row.by for row in wrong))
            where = f"{engine}, {function}, {scene}: wrong by {worst.error:.1e}"
            yield f"{where} to {blocks}, most in `{worst.worst}`; {CAUSES[cause(found)]}"


def cause(rows: Sequence[Row]) -> str:
    """Return what the wrong ones of the rows of a function on a scene depend on, a key of CAUSES."""
    wrong = [row for row in rows if row.grade == WRONG]
    if all(row.truth == OWN for row in wrong):
        return "stabilisation"
    if all(row.truth == JUDGE for row in wrong) and any(row.truth == OWN for row in rows):
        return "step"
    judged = [row for row in wrong if row.truth == JUDGE]
    return "velocity" if all(row.state == MOVING for row in judged) else "everywhere"
