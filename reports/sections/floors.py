"""The first table: which engine gives which error at which setting and cost, on which scene."""

from __future__ import annotations

from collections.abc import Sequence

from crosscheck.judge.tolerances import FLOOR
from crosscheck.study.least_errors import HEADER, floors
from reports.blocks import Block, Heading, Table, Text
from reports.runs import SceneRuns, short

BEST = 6  # cells of a floor's row that tell of its run of least error


def render(groups: Sequence[SceneRuns]) -> list[Block]:
    """One row a scene and engine: its run of least error, and what its other families reach."""
    found = floors([run.record for group in groups for run in group.runs])
    text = (
        "Each engine's least error on each scene, the setting that gives it and its time of stepping; "
        f"then how many of its families reach {short(FLOOR)} at some setting. "
        "Many scenes have singular positions. What brings an engine through them: projection "
        "after every step, or closure errors that decay within some ten steps (Pinocchio's Baumgarte "
        "terms at 0.1/h, MuJoCo's at 0.2/h with its regulariser scaled away); in Exudyn a loose Newton "
        "tolerance at second order, or a leap over the position and a restart behind it, which "
        "extrapolation to h = 0 then bears. Exudyn's static analysis passes where no step ends on the "
        "position."
    )
    reached = sum(floor.is_reached for floor in found)
    caption = f"{reached} of {len(found)} pairs of scene and engine are within {short(FLOOR)} of the truth."
    rows = [(*floor.row()[:BEST], floor.share()) for floor in found]
    others = [floor.row() for floor in found]
    header = [name.capitalize() for name in HEADER]
    return [
        Heading("Floors", 2), Text(text),
        Table(caption, [*header[:BEST], "Families"], _once(rows), right=frozenset({4, 5, 6})),
        Table("The families that are within it, and the best or the end of the others.",
              [*header[:2], *header[BEST:]], _once([(*row[:2], *row[BEST:]) for row in others]), folded=True),
    ]  # fmt: skip


def _once(rows: Sequence[Sequence[str]]) -> list[Sequence[str]]:
    """The rows with each scene named in the first of its own only."""
    before = ["", *(row[0] for row in rows)]
    return [("" if row[0] == last else row[0], *row[1:]) for row, last in zip(rows, before, strict=False)]
