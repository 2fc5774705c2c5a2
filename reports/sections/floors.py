"""The first table: which engine gives which error at which setting and cost, on which scene."""

from __future__ import annotations

from collections.abc import Sequence

from crosscheck.floors import HEADER, floors
from crosscheck.tolerances import FLOOR
from reports.blocks import Block, Heading, Table, Text
from reports.runs import SceneRuns, short


def render(groups: Sequence[SceneRuns]) -> list[Block]:
    """One row a scene and engine: its run of least error, and what its other families reach."""
    found = floors([run.record for group in groups for run in group.runs])
    text = (
        "Each engine's least error on each scene, the setting that gives it and its time of stepping; "
        f"then the families that reach {short(FLOOR)} at some setting, and the best or the end of the "
        "others. Many scenes have singular positions. What brings an engine through them: projection "
        "after every step, or closure errors that decay within some ten steps (Pinocchio's Baumgarte "
        "terms at 0.1/h, MuJoCo's at 0.2/h with its regulariser scaled away); in Exudyn a loose Newton "
        "tolerance at second order, or a leap over the position and a restart behind it, which "
        "extrapolation to h = 0 then bears. Exudyn's static analysis passes where no step ends on the "
        "position."
    )
    reached = sum(floor.is_reached for floor in found)
    caption = f"{reached} of {len(found)} pairs of scene and engine are within {short(FLOOR)} of the truth."
    header = [name.capitalize() for name in HEADER]
    return [Heading("Floors", 2), Text(text),
            Table(caption, header, [floor.row() for floor in found], right=frozenset({4, 5}))]  # fmt: skip
