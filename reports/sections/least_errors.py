"""Section: the first table, with the least error of every engine on every scene, its setting and its cost."""

from __future__ import annotations

from collections.abc import Sequence

from crosscheck.judge.tolerances import FLOOR
from crosscheck.study.search.least_errors import HEADER, least_errors

from ..blocks import Block, Heading, Table, Text
from ..runs import SceneRuns, short

BEST = 6  # first cells of a row, which describe the run of least error


def render(groups: Sequence[SceneRuns]) -> list[Block]:
    """Return one row for each scene and engine: its run of least error, and the errors of its other
    families."""
    found = least_errors([run.record for group in groups for run in group.runs])
    text = (
        "Each engine's least error on each scene, the setting that gives it and its time of stepping; "
        f"then the number of its families that reach {short(FLOOR)} at some setting. "
        "Many scenes have singular positions. An engine passes them by projection after every step, or by "
        "closure errors that decay within some ten steps: Pinocchio's Baumgarte terms at 0.1/h, MuJoCo's at "
        "0.2/h with its regulariser scaled away. Exudyn passes them with a loose Newton tolerance at second "
        "order, or by an extrapolation over the position and a restart behind it, after which the "
        "extrapolation to h = 0 is still accurate. Exudyn's static analysis passes where no step ends on "
        "the position."
    )
    reached = sum(least.is_reached for least in found)
    caption = f"{reached} of {len(found)} pairs of scene and engine are within {short(FLOOR)} of the truth."
    rows = [(*least.row()[:BEST], least.share()) for least in found]
    others = [least.row() for least in found]
    header = [name.capitalize() for name in HEADER]
    return [
        Heading("Least errors", 2),
        Text(text),
        Table(caption, [*header[:BEST], "Families"], rows, right=frozenset({4, 5, 6})),
        Table(
            "Families within this error, and the least error or the end of all other families.",
            [*header[:2], *header[BEST:]],
            [(*row[:2], *row[BEST:]) for row in others],
            folded=True,
        ),
    ]
